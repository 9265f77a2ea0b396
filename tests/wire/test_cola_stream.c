/* SPDX-License-Identifier: MIT */
/* Three SICK clients at once: CoLa-A and CoLa-B over TCP, CoLa-B over a pty. Others between them send garbage. Each
 * client gets every scan, and all get the same figures of a scan. */
#include "tests/wire/house.h"
#include "tests/wire/wire.h"

enum { CLIENTS = 3, SCANS = 15, BEAMS = 541, PERIOD_US = 20000, ROOM = 1 << 16 };

struct client {
    int fd, is_b;
    uint8_t bytes[ROOM];
    size_t len, used; /* used: by the telegram found last */
};

/* The compared figures of a scan. */
struct scan {
    uint32_t telegram, count, start_us, range[BEAMS];
};

/* Returns the length of the whole telegram at the buffer's begin; 0: there is none yet. */
static size_t whole(const struct client *c)
{
    if (!c->is_b) {
        const uint8_t *end = memchr(c->bytes, 3, c->len);
        return end == NULL ? 0 : (size_t)(end - c->bytes) + 1;
    }
    const size_t len = c->len < 8 ? 0 : 9 + (size_t)(c->bytes[6] << 8 | c->bytes[7]);
    return c->len < len ? 0 : len;
}

static const uint8_t *next_telegram(struct client *c)
{
    c->len -= c->used;
    memmove(c->bytes, c->bytes + c->used, c->len);
    while ((c->used = whole(c)) == 0) {
        struct pollfd slot = {.fd = c->fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        const ssize_t n = read(c->fd, c->bytes + c->len, sizeof c->bytes - c->len);
        assert_true(n > 0);
        c->len += (size_t)n;
    }
    return c->bytes;
}

static uint32_t big_endian(const uint8_t *at, int n)
{
    uint32_t v = 0;
    while (n-- > 0)
        v = v << 8 | *at++;
    return v;
}

/* Returns field i of a telegram in CoLa-A. */
static uint32_t field(const uint8_t *telegram, int i)
{
    const char *at = (const char *)telegram;
    for (; i > 0; i--)
        at = strchr(at, ' ') + 1;
    return (uint32_t)strtoul(at, NULL, 16);
}

static void read_scan(struct client *c, struct scan *s)
{
    const uint8_t *t = next_telegram(c);
    assert_memory_equal(t + (c->is_b ? 8 : 1), "sSN LMDscandata ", 16);
    if (c->is_b) {
        *s = (struct scan){big_endian(t + 34, 2), big_endian(t + 36, 2), big_endian(t + 38, 4), {0}};
        for (int i = 0; i < BEAMS; i++)
            s->range[i] = big_endian(t + 64 + 21 + 2 * i, 2);
        return;
    }
    *s = (struct scan){field(t, 7), field(t, 8), field(t, 9), {0}};
    const char *at = (const char *)t;
    for (int i = 0; i < 26; i++)
        at = strchr(at, ' ') + 1;
    for (int i = 0; i < BEAMS; i++) {
        char *end;
        s->range[i] = (uint32_t)strtoul(at, &end, 16);
        at = end;
    }
}

/* Opens a pty with its default settings: no program has made its terminal raw. */
static int connect_to(const char *endpoint)
{
    if (strncmp(endpoint, "tty:", 4) != 0) return raw_connect(endpoint);
    const int fd = open(endpoint + 4, O_RDWR | O_NOCTTY | O_CLOEXEC);
    assert_true(fd >= 0);
    return fd;
}

static void start_client(struct client *c, const char *endpoint, int is_b)
{
    static const char a[] = "\2sEN LMDscandata 1\3";
    static const char b[] = "\2\2\2\2\0\0\0\x11sEN LMDscandata \1\x33"; /* 0x11 bytes; their XOR */
    *c = (struct client){.fd = connect_to(endpoint), .is_b = is_b};
    raw_send(c->fd, is_b ? b : a, (is_b ? sizeof b : sizeof a) - 1);
    assert_memory_equal(next_telegram(c) + (is_b ? 8 : 1), "sEA LMDscandata ", 16);
}

/* Sends bytes as a port scan may; none of them is a request. */
static void send_garbage(const char *endpoint, int i)
{
    static const char *const garbage[] = {"GET / HTTP/1.1\r\n\r\n", "\2\2\2\2\xff\xff\xff\xff", "\2sRN ", "\r\n\r\n"};
    const int fd = raw_connect(endpoint);
    raw_send(fd, garbage[i % 4], strlen(garbage[i % 4]));
    close(fd);
}

static void test_clients(void **state)
{
    struct wire *wire = *state;
    static struct client client[CLIENTS];
    static struct scan scan[CLIENTS][SCANS];
    const char *const more[] = {"--set", "links.0.port=0", "--set", "head.profile=sick-lms111", NULL};
    struct head head = head_start(wire, "config/sick.yaml", house_options(wire, "13", more));
    for (int k = 0; k < CLIENTS; k++)
        start_client(&client[k], head_link(&head, k / 2), k != 0);
    for (int n = 0; n < SCANS; n++) {
        for (int k = 0; k < CLIENTS; k++)
            read_scan(&client[k], &scan[k][n]);
        send_garbage(head_link(&head, 0), n);
    }
    for (int k = 0; k < CLIENTS; k++)
        for (int n = 1; n < SCANS; n++) {
            assert_int_equal(scan[k][n].telegram, scan[k][n - 1].telegram + 1);
            assert_int_equal(scan[k][n].count, scan[k][n - 1].count + 1);
            assert_int_equal(scan[k][n].start_us, scan[k][n - 1].start_us + PERIOD_US);
        }
    for (int k = 1; k < CLIENTS; k++) { /* its first scan is one of the first client's */
        const uint32_t behind = scan[k][0].count - scan[0][0].count;
        assert_true(behind < SCANS);
        for (uint32_t n = 0; n + behind < SCANS; n++) {
            assert_int_equal(scan[0][n + behind].start_us, scan[k][n].start_us);
            assert_memory_equal(scan[0][n + behind].range, scan[k][n].range, sizeof scan[k][n].range);
        }
    }
    for (int k = 0; k < CLIENTS; k++)
        close(client[k].fd);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_clients, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
