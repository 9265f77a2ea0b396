/* SPDX-License-Identifier: MIT */
/* CoLa: mSCreboot reboots the head. All sessions end, and its clock, counters and count of power-ups begin anew. */

#include "tests/wire/room.h"
#include "tests/wire/wire.h"

struct client {
    int fd;
    char bytes[1 << 16], text[1 << 16];
    size_t len;
};

/* Returns the next telegram without its marks; NULL: the connection has ended. */
static const char *next(struct client *c)
{
    for (;;) {
        const char *end = memchr(c->bytes, 3, c->len);
        if (end != NULL) {
            const size_t n = (size_t)(end - c->bytes);
            memcpy(c->text, c->bytes + 1, n - 1);
            c->text[n - 1] = '\0';
            memmove(c->bytes, end + 1, c->len -= n + 1);
            return c->text;
        }
        struct pollfd slot = {.fd = c->fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        const ssize_t got = read(c->fd, c->bytes + c->len, sizeof c->bytes - c->len);
        if (got <= 0) return NULL;
        c->len += (size_t)got;
    }
}

/* Returns the answer; NULL as next() does. Scans that come before it are passed over. */
static const char *ask(struct client *c, const char *request)
{
    char line[64];
    const char *answer;
    const int n = snprintf(line, sizeof line, "\2%s\3", request);
    if (send(c->fd, line, (size_t)n, MSG_NOSIGNAL) != n) return NULL;
    while ((answer = next(c)) != NULL && strncmp(answer, "sSN ", 4) == 0)
        continue;
    return answer;
}

static void expect(struct client *c, const char *request, const char *answer)
{
    const char *said = ask(c, request);
    assert_non_null(said);
    assert_string_equal(said, answer);
}

/* Reads the counts of telegrams and scans, and the scan's start in us, of the next scan. */
static void read_scan(struct client *c, unsigned *telegrams, unsigned *scans, unsigned *start_us)
{
    const char *scan = ask(c, "sRN LMDscandata");
    assert_non_null(scan);
    assert_int_equal(sscanf(scan, "sRA LMDscandata 1 1 %*s 0 0 %X %X %X", telegrams, scans, start_us), 3);
}

static int64_t device_ns(const struct head *head)
{
    struct scanhead *sh = client_open(head_endpoint(head, "pty"));
    const int64_t t_ns = strtoll(client_ask(sh, "TIME?"), NULL, 10);
    scanhead_close(sh);
    return t_ns;
}

static void reboots(void **state)
{
    struct wire *wire = *state;
    static struct client c, other;
    unsigned telegrams, scans, start_us;
    const struct room_config config = {
        .profile = "sick-lms111",
        .prr_hz = 36000,
        .lines_hz = 50,
        .links = "links: [{type: tcp, port: 0, protocol: cola}, {type: pty, path: native}]\n"};
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    c.fd = raw_connect(head_endpoint(&head, "tcp"));
    other.fd = raw_connect(head_endpoint(&head, "tcp"));
    expect(&c, "sMN SetAccessMode 03 F4724744", "sAN SetAccessMode 1");
    expect(&other, "sRN ODpwrc", "sRA ODpwrc 1");
    read_scan(&c, &telegrams, &scans, &start_us);
    read_scan(&c, &telegrams, &scans, &start_us);
    assert_int_equal(telegrams, 1);
    const int64_t before_ns = device_ns(&head);
    expect(&c, "sMN mSCreboot", "sAN mSCreboot");
    assert_null(next(&c));
    assert_null(next(&other)); /* all clients share the device */
    close(c.fd);
    close(other.fd);
    c = (struct client){.fd = raw_connect_again(head_endpoint(&head, "tcp"), "\2sRN ODpwrc\3")};
    assert_non_null(next(&c));
    expect(&c, "sRN ODpwrc", "sRA ODpwrc 2");
    expect(&c, "sMN GetAccessMode", "sAN GetAccessMode 1");
    read_scan(&c, &telegrams, &scans, &start_us);
    assert_int_equal(telegrams, 0);
    assert_int_equal(scans, 0);
    assert_true((int64_t)start_us * 1000 <= device_ns(&head) - before_ns); /* it began after the reboot */
    close(c.fd);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(reboots, wire_setup, wire_teardown)};
    return cmocka_run_group_tests_name("cola reboot", tests, NULL, NULL);
}
