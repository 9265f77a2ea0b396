/* SPDX-License-Identifier: MIT */
/* rawlog-grabber's CLMS100Eth reads a SICK LMS111 over TCP. The client polls, and logs times of the host, so the
 * device's own times and counts are in the telegrams alone. A relay between the two keeps them. The client itself waits
 * 15 s while it turns the scanner on. */
#include "tests/wire/grabber.h"
#include "tests/wire/house.h"

enum { SCANS = 20, FIELDS = 26 + 1081 };

static const double STEP_DEG = 0.25, FIRST_DEG = -45.0; /* 90 is forward, counter-clockwise from above */
static const double MIN_M = 0.5, MAX_M = 20.0;
static const uint32_t PERIOD_US = 40000; /* 25 Hz */

static int pass_on(int from, int to, FILE *keep)
{
    char bytes[16384];
    ssize_t n = read(from, bytes, sizeof bytes);
    if (n <= 0) return 0;
    if (keep != NULL) fwrite(bytes, 1, (size_t)n, keep);
    raw_send(to, bytes, (size_t)n);
    return 1;
}

/* Starts a child between a client and the head. Telegrams of the head are kept in the file "telegrams". */
static pid_t relay_start(struct wire *wire, int listener, const char *endpoint)
{
    pid_t pid = wire_fork(wire);
    if (pid != 0) return pid;
    FILE *keep = fopen(wire_path(wire, "telegrams"), "wb");
    int client = accept(listener, NULL, NULL), head = raw_connect(endpoint), open = keep != NULL && client >= 0;
    while (open) {
        struct pollfd slot[2] = {{.fd = client, .events = POLLIN}, {.fd = head, .events = POLLIN}};
        if (poll(slot, 2, DEADLINE_MS) <= 0) _exit(1);
        if (slot[1].revents != 0) open = pass_on(head, client, keep);
        if (open && slot[0].revents != 0) open = pass_on(client, head, NULL);
    }
    _exit(fclose(keep) != 0);
}

/* This is one telegram in CoLa-A, with its fields as text. */
struct telegram {
    char *field[FIELDS];
    int n;
};

/* Cuts the next polled scan out of *at. Returns 0 where there is none. */
static int next_telegram(char **at, struct telegram *t)
{
    static const char begin[] = "\2sRA LMDscandata ";
    char *start = strstr(*at, begin), *end = start != NULL ? strchr(start, 3) : NULL, *rest;
    if (end == NULL) return 0;
    *end = '\0';
    *at = end + 1;
    t->n = 0;
    for (char *word = strtok_r(start + 1, " ", &rest); word != NULL && t->n < FIELDS; word = strtok_r(NULL, " ", &rest))
        t->field[t->n++] = word;
    return 1;
}

static uint32_t hex(const struct telegram *t, int i)
{
    assert_true(i < t->n);
    return (uint32_t)strtoul(t->field[i], NULL, 16);
}

static void check_geometry(const struct telegram *t)
{
    assert_int_equal(t->n, FIELDS);
    assert_int_equal(hex(t, 16), 2500); /* 25 Hz */
    assert_string_equal(t->field[20], "DIST1");
    assert_string_equal(t->field[21], "3F800000");
    assert_int_equal((int32_t)hex(t, 23), (int32_t)(10000 * FIRST_DEG));
    assert_int_equal(hex(t, 24), (uint32_t)(10000 * STEP_DEG));
    assert_int_equal(hex(t, 25), 1081);
}

static void check_ranges(const struct house *house, const struct telegram *t)
{
    for (int i = 0; i < 1081; i++) {
        const double azimuth = (90.0 - FIRST_DEG - STEP_DEG * i) * M_PI / 180.0, range_m = 1e-3 * hex(t, 26 + i);
        /* half a millimetre, and the rounding of the sum; angles as in test_grabber_hokuyo */
        if (!house_agrees(house, azimuth, 0.0, 1e-7, range_m, 0.000501, MIN_M, MAX_M))
            fail_msg("direction %d: %.3f m instead of %.4f", i, range_m, house_range_m(house, azimuth, 0.0));
    }
}

/* The log has the figures of the telegrams, in the same order. */
static void check_log(const struct telegram *t, const struct rawlog_item *scan)
{
    assert_int_equal(scan->kind, RAWLOG_SCAN);
    for (uint32_t i = 0; i < scan->n; i++)
        assert_true(fabs(rawlog_range_m(scan, i) - 1e-3 * hex(t, 26 + (int)i)) < 1e-5); /* float */
}

/* Lets the client poll, and reads its log. Returns 0 where it complains, or took a part of a telegram for a scan: it
 * waits 40 ms for the rest, which on a busy machine may come later. */
static int poll_scans(struct wire *wire, const char *endpoint, int number, struct rawlog *log)
{
    static struct grabber grabber;
    char sensor[256], name[16];
    int port, listener = wire_bind(SOCK_STREAM, &port), is_whole = 1;
    assert_int_equal(listen(listener, 1), 0);
    pid_t relay = relay_start(wire, listener, endpoint);
    grabber_hurry(relay); /* else the client, which polls all the time, would go before it */
    close(listener);
    snprintf(name, sizeof name, "SICK%d", number);
    snprintf(sensor, sizeof sensor, "driver = CLMS100Eth\nip_address = 127.0.0.1\nTCP_port = %d\n", port);
    grabber_start(wire, name, sensor, &grabber);
    *log = (struct rawlog){0};
    const int is_content = grabber_wait(&grabber, SCANS);
    grabber_end(&grabber);
    assert_int_equal(wire_wait(wire, relay), 0);
    if (!is_content) return 0;
    rawlog_read(&grabber, log);
    assert_true(log->n_items >= SCANS);
    for (uint32_t i = 0; i < log->n_items; i++)
        is_whole &= log->item[i].n == 1081;
    return is_whole;
}

static void test_polled(void **state)
{
    enum { TRIES = 5 };
    struct wire *wire = *state;
    struct telegram t;
    struct rawlog log;
    grabber_or_skip();
    const char *const more[] = {"--set", "links.0.port=0", "--set", "head.profile=sick-lms111", NULL};
    struct head head = head_start(wire, "config/sick.yaml", house_options(wire, "13", more));
    struct house *house = house_load(wire);
    grabber_hurry(head.pid);
    for (int i = 1; !poll_scans(wire, head_link(&head, 0), i, &log); i++) {
        rawlog_free(&log);
        if (i == TRIES) fail_msg("rawlog-grabber complains, or logs parts of scans, %d times", i);
    }
    head_end(&head, SIGTERM);
    char *text = wire_read(wire_path(wire, "telegrams"), NULL), *at = text;
    uint32_t last_count = 0, last_us = 0, n = 0;
    for (; next_telegram(&at, &t) && n < log.n_items; n++) {
        check_geometry(&t);
        check_ranges(house, &t);
        check_log(&t, &log.item[n]);
        const uint32_t count = hex(&t, 8), us = hex(&t, 9);
        /* The client is a little slower than the scanner, as it waits 40 ms for more after each telegram. */
        if (n > 0) assert_int_equal((uint16_t)(count - last_count) * PERIOD_US, us - last_us);
        last_count = count;
        last_us = us;
    }
    assert_int_equal(n, log.n_items);
    free(text);
    rawlog_free(&log);
    house_free(house);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_polled, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
