/* SPDX-License-Identifier: MIT */
/* The bytes that a UART reads at another rate: some worked out by hand, and all others against a simulation that steps
 * through time with a receiver that has counters, as one in hardware. */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

#include "drivers/link/uart.h"
#include "tests/common/thorough.h"

enum { MOST = 300 };

/* ---- by hand. The bits of a byte on the line: 0, d0 to d7, 1. */

static const struct {
    uint32_t sender, receiver;
    uint8_t sent[2];
    size_t n;
    uint8_t read[4];
    size_t n_read;
} EXAMPLES[] = {
    /* A slow receiver looks at bits 1, 3, 5, 7, 9 of 0x00, then at the resting line: 0 | 0 0 0 1 1 1 1 1 | 1. */
    {115200, 57600, {0x00}, 1, {0xf8}, 1},
    /* Each start bit of 0x55 is over when it looks for it. */
    {115200, 57600, {0x55}, 1, {0}, 0},
    /* 0 0000 1111 1 twice: it looks at bits 1, 3, 5, 7, 9, and at the same ones of the second byte. */
    {115200, 57600, {0xf0, 0xf0}, 2, {0xce}, 1},
    /* A fast one sees each bit twice: 0 | 0 1 1 0 0 1 1 0 | 0, an error of framing; from the next falling edge on
     * 0 | 0 1 1 0 0 1 1 1 | 1. */
    {57600, 115200, {0x55}, 1, {0x66, 0xe6}, 2},
    /* A break: the line is at 0 for longer than a byte. */
    {57600, 115200, {0x00}, 1, {0x00}, 1},
    /* 12 of its bits last as long as one of the sender: it sees a break at each falling edge, here four. */
    {9600, 115200, {0xaa}, 1, {0x00, 0x00, 0x00, 0x00}, 4},
};

static void examples(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof EXAMPLES / sizeof EXAMPLES[0]; i++) {
        uint8_t out[2 * UART_MOST_PER_BYTE];
        const struct uart uart = {EXAMPLES[i].sender, EXAMPLES[i].receiver, UART_KEEPS_ERRORS, 0};
        assert_int_equal(uart_read(&uart, EXAMPLES[i].sent, EXAMPLES[i].n, out), EXAMPLES[i].n_read);
        assert_memory_equal(out, EXAMPLES[i].read, EXAMPLES[i].n_read);
    }
}

/* The driver marks errors: 0x00 is a break, 0x66 has an error, and 0xe6 has none. */
static void errors(void **state)
{
    (void)state;
    static const uint8_t bytes[] = {0x00, 0x55};
    uint8_t out[2 * UART_MOST_PER_BYTE];
    struct uart uart = {57600, 115200, UART_ZEROES_ERRORS, 0};
    assert_int_equal(uart_read(&uart, bytes, 2, out), 3);
    assert_memory_equal(out, "\x00\x00\xe6", 3);
    uart.errors = UART_DROPS_ERRORS;
    assert_int_equal(uart_read(&uart, bytes, 2, out), 2);
    assert_memory_equal(out, "\x00\xe6", 2);
    uart.drops_breaks = 1;
    assert_int_equal(uart_read(&uart, bytes, 2, out), 1);
    assert_memory_equal(out, "\xe6", 1);
}

/* ---- against time */

static uint64_t gcd(uint64_t a, uint64_t b)
{
    return b == 0 ? a : gcd(b, a % b);
}

/* Returns the level of the line at a tick. A sent bit lasts `bit_ticks` ticks. */
static int level_at_tick(const uint8_t *sent, size_t n, uint64_t tick, uint64_t bit_ticks)
{
    const uint64_t bit = tick / bit_ticks;
    if (bit >= 10 * n || bit % 10 == 9) return 1;
    return bit % 10 == 0 ? 0 : sent[bit / 10] >> (bit % 10 - 1) & 1;
}

/* Half a bit of either side is a whole number of ticks. */
static size_t simulate(const struct uart *uart, const uint8_t *sent, size_t n, uint8_t *out)
{
    const uint64_t g = gcd(uart->sender_baud, uart->receiver_baud);
    const uint64_t sent_ticks = 2 * uart->receiver_baud / g, half_ticks = uart->sender_baud / g;
    uint64_t left = 0; /* ticks until the next sample */
    int phase = -1;    /* waits for an edge; 0: the start bit; 1 to 8: data; 9: the stop bit */
    int before = 1, shift = 0;
    size_t n_out = 0;
    const uint64_t end = sent_ticks * 10 * n + 22 * half_ticks;
    for (uint64_t tick = 0; tick < end; tick++) {
        const int level = level_at_tick(sent, n, tick, sent_ticks);
        if (phase < 0 && before == 1 && level == 0) {
            phase = 0;
            left = half_ticks;
        }
        before = level;
        if (phase < 0 || left-- != 0) continue;
        left = 2 * half_ticks - 1;
        if (phase == 0 && level == 1) {
            phase = -1;
            continue;
        }
        if (phase >= 1 && phase <= 8) shift = shift >> 1 | level << 7;
        if (phase == 9) out[n_out++] = (uint8_t)shift;
        phase = phase == 9 ? -1 : phase + 1;
    }
    return n_out;
}

static void check_pair(uint32_t sender, uint32_t receiver)
{
    const struct uart uart = {sender, receiver, UART_KEEPS_ERRORS, 0};
    for (int round = 0; round < 4; round++) {
        uint8_t sent[MOST], out[MOST * UART_MOST_PER_BYTE], want[MOST * UART_MOST_PER_BYTE];
        const size_t n = round == 0 ? 1 : 1 + (size_t)rand() % (size_t)thorough(MOST, 40);
        for (size_t i = 0; i < n; i++)
            sent[i] = (uint8_t)rand();
        const size_t n_want = simulate(&uart, sent, n, want);
        assert_true(n_want <= n * UART_MOST_PER_BYTE);
        assert_int_equal(uart_read(&uart, sent, n, out), n_want);
        assert_memory_equal(out, want, n_want);
        if (!uart_reads_right(&uart)) continue;
        assert_int_equal(n_want, n);
        assert_memory_equal(out, sent, n);
    }
}

static void usual_rates(void **state)
{
    (void)state;
    static const uint32_t rates[] = {1200, 9600, 19200, 38400, 57600, 115200, 230400, 500000, 750000};
    srand(36);
    for (size_t i = 0; i < sizeof rates / sizeof rates[0]; i++)
        for (size_t k = 0; k < sizeof rates / sizeof rates[0]; k++) {
            const struct uart uart = {rates[i], rates[k], UART_KEEPS_ERRORS, 0};
            assert_int_equal(uart_reads_right(&uart), i == k);
            check_pair(rates[i], rates[k]);
        }
}

/* The stop bit is sampled after 9.5 bits. The sampled bit is the right one from 9 up to 10 bits of the sender: 9/9.5 is
 * 0.9474, and 10/9.5 is 1.0526. */
static void near_rates(void **state)
{
    (void)state;
    srand(37);
    for (uint32_t per_mille = 900; per_mille <= 1100; per_mille += 5) {
        const struct uart uart = {per_mille * 100, 100000, UART_KEEPS_ERRORS, 0};
        assert_int_equal(uart_reads_right(&uart), per_mille >= 948 && per_mille <= 1052);
        check_pair(uart.sender_baud, uart.receiver_baud);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(examples), cmocka_unit_test(errors),
                                       cmocka_unit_test(usual_rates), cmocka_unit_test(near_rates)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
