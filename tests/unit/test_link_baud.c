/* SPDX-License-Identifier: MIT */
/* A pty link whose head has a bit rate: a client of another rate gets and sends other bytes, and the right ones as soon
 * as it has the right rate. (The bytes are those of test_uart.c.) */
#include <termios.h>

#include "drivers/link/uart.h"
#include "tests/unit/pty_rig.h"

static const struct link_spec at_115200 = {.type = LINK_PTY, .baud = 115200};

static void set_rate(int fd, speed_t rate)
{
    struct termios settings;
    assert_int_equal(tcgetattr(fd, &settings), 0);
    cfsetspeed(&settings, rate);
    assert_int_equal(tcsetattr(fd, TCSANOW, &settings), 0);
}

static int connect_at(struct bench *bench, speed_t rate)
{
    const int fd = client_open(bench);
    bench_expect(bench, LINK_OPENED, 0);
    set_rate(fd, rate);
    return fd;
}

static void expect(struct bench *bench, int fd, const char *sent, size_t n, const char *read, size_t n_read)
{
    char text[32];
    bench_write_all(bench, 0, sent, n);
    fd_read_all(fd, text, n_read);
    assert_memory_equal(text, read, n_read);
}

static void expect_back(struct bench *bench, int fd, const char *sent, size_t n, const char *read, size_t n_read)
{
    char text[32];
    assert_int_equal(write(fd, sent, n), n);
    bench_expect(bench, LINK_READABLE, 0);
    assert_int_equal(bench->ops->read(bench->link, 0, text, sizeof text), n_read);
    assert_memory_equal(text, read, n_read);
}

static void both_ways(void **state)
{
    (void)state;
    struct bench bench = bench_open(&at_115200);
    const int fd = connect_at(&bench, B57600);
    expect(&bench, fd, "\x00", 1, "\xf8", 1);
    expect_back(&bench, fd, "\x55", 1, "\x66\xe6", 2);
    char few[UART_MOST_PER_BYTE - 1]; /* no room for what a byte may become */
    assert_int_equal(write(fd, "\x55", 1), 1);
    bench_expect(&bench, LINK_READABLE, 0);
    assert_int_equal(bench.ops->read(bench.link, 0, few, sizeof few), 0);
    char two[UART_MOST_PER_BYTE];
    assert_int_equal(bench.ops->read(bench.link, 0, two, sizeof two), 2);
    assert_memory_equal(two, "\x66\xe6", 2);
    set_rate(fd, B115200);
    exchange(&bench, 0, fd);
    expect(&bench, fd, "\x00", 1, "\x00", 1);
    expect_back(&bench, fd, "\x55", 1, "\x55", 1);
    /* A client that sets no rate has the terminal's own, which is 38400. */
    set_rate(fd, B38400);
    expect(&bench, fd, "\x00", 1, "\xfc", 1); /* samples 1, 4, 7 are 0; those from 10 on lie in the resting line */
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);
}

static void without_a_rate(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    const int fd = connect_at(&bench, B57600);
    expect(&bench, fd, "\x00\x55", 2, "\x00\x55", 2);
    expect_back(&bench, fd, "\x00\x55", 2, "\x00\x55", 2);
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);
}

/* More than the terminal holds: the rest waits, goes out as its client reads, and does not go to the next client. */
static void much_at_once(void **state)
{
    (void)state;
    enum { N = 40000 };
    static uint8_t sent[N], want[N * UART_MOST_PER_BYTE], got[N * UART_MOST_PER_BYTE];
    struct bench bench = bench_open(&at_115200);
    int fd = connect_at(&bench, B230400);
    const struct uart uart = {115200, 230400, UART_KEEPS_ERRORS, 0};
    for (size_t i = 0; i < N; i++)
        sent[i] = (uint8_t)(i * 7 + i / 256);
    const size_t n = uart_read(&uart, sent, N, want);
    assert_true(n > N);
    for (int round = 0; round < 2; round++) {
        assert_int_equal(bench.ops->write(bench.link, 0, sent, N), N);
        assert_int_equal(bench.ops->write(bench.link, 0, sent, N), 0);
        assert_true(is_calm(&bench, 1));
        assert_true(is_calm(&bench, 0));
        for (size_t at = 0; at < n && round == 0;) {
            bench_poll(&bench, 0, 0);
            const ssize_t more = fd_read(fd, got + at, n - at);
            assert_true(more > 0);
            at += (size_t)more;
        }
        if (round == 0) assert_memory_equal(got, want, n);
    }
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    fd = connect_at(&bench, B115200);
    expect(&bench, fd, "new", 3, "new", 3);
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);
}

/* A client that looks for errors of framing gets 0 for such a byte. */
static void marked_errors(void **state)
{
    (void)state;
    struct bench bench = bench_open(&at_115200);
    const int fd = connect_at(&bench, B230400);
    struct termios settings;
    expect(&bench, fd, "\x55", 1, "\x66\xe6", 2);
    assert_int_equal(tcgetattr(fd, &settings), 0);
    settings.c_iflag |= INPCK;
    assert_int_equal(tcsetattr(fd, TCSANOW, &settings), 0);
    expect(&bench, fd, "\x55", 1, "\x00\xe6", 2);
    settings.c_iflag |= IGNPAR;
    assert_int_equal(tcsetattr(fd, TCSANOW, &settings), 0);
    expect(&bench, fd, "\x55", 1, "\xe6", 1);
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(both_ways), cmocka_unit_test(without_a_rate),
                                       cmocka_unit_test(much_at_once), cmocka_unit_test(marked_errors)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
