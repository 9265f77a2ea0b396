/* SPDX-License-Identifier: MIT */
/* What a command line of `record --raw` becomes: its place, its ports and what it sends; and the exit status. The
 * test has its own raw_run, which records nothing. Wrong lines are in test_record_lines. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/app/studio/record/raw.h"
#include "tests/unit/output_rig.h"

static struct raw got;
static uint8_t sent[2][16];
static int n_runs, run_rc;

int raw_run(struct raw *r, struct sh_err *err)
{
    got = *r;
    for (int i = 0; i < r->n_sends && i < 2; i++)
        memcpy(sent[i], r->send[i].bytes, r->send[i].len);
    n_runs++;
    return run_rc == SH_OK ? SH_OK : sh_fail(err, run_rc, "it failed");
}

int raw_write(struct raw *r, const struct capture_frame *frame, size_t payload, struct sh_err *err)
{
    (void)r;
    (void)frame;
    (void)payload;
    (void)err;
    return SH_OK;
}

struct ethernet_end raw_end_of(const struct sockaddr_storage *at)
{
    (void)at;
    return (struct ethernet_end){0};
}

/* Runs the words, and returns the exit status. */
static int record_words(const char *source, const char *const *more)
{
    char *argv[24] = {"record", "--raw", "-o", "a.pcapng", (char *)source};
    struct output output;
    int argc = 5;
    for (; *more != NULL; more++)
        argv[argc++] = (char *)*more;
    n_runs = 0;
    output_take(&output, stderr);
    const int status = raw_record(argc, argv);
    free(output_give(&output));
    return status;
}

static const char *const NONE[] = {NULL};

static void places(void **state)
{
    static const struct {
        const char *source, *host;
        int n_ports, ports[3], is_udp;
    } rows[] = {{"udp:127.0.0.1:2368", "127.0.0.1", 1, {2368}, 1},
                {"udp:0.0.0.0:2368,8308,0", "0.0.0.0", 3, {2368, 8308, 0}, 1},
                {"udp:a:0,0", "a", 2, {0, 0}, 1},
                {"udp:a:65535", "a", 1, {65535}, 1},
                {"udp:[::1]:5", "::1", 1, {5}, 1},
                {"udp:::1:5", "::1", 1, {5}, 1},
                {"udp:[a:5", "[a", 1, {5}, 1},
                {"udp:a]:5", "a]", 1, {5}, 1},
                {"tcp:scanner:2111", "scanner", 1, {2111}, 0},
                {"tcp:[fe80::1%eth0]:1", "fe80::1%eth0", 1, {1}, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        assert_int_equal(record_words(rows[i].source, NONE), APP_OK);
        assert_int_equal(n_runs, 1);
        assert_string_equal(got.place.host, rows[i].host);
        assert_int_equal(got.place.n_ports, rows[i].n_ports);
        assert_memory_equal(got.place.port, rows[i].ports, (size_t)rows[i].n_ports * sizeof(int));
        assert_ptr_equal(got.ops, rows[i].is_udp ? &raw_udp : &raw_tcp);
        assert_true(strcmp(got.path, "a.pcapng") == 0 && strcmp(got.in.operand[0], rows[i].source) == 0);
        assert_true(got.duration_s == 0 && got.wait_s == 0 && got.relay == NULL && got.stats == NULL && !got.quiet);
    }
}

/* There may be 16 ports, and a host of 127 characters. */
static void limits(void **state)
{
    char source[256] = "udp:a:1";
    (void)state;
    for (int i = 2; i <= 17; i++) {
        snprintf(source + strlen(source), sizeof source - strlen(source), ",%d", i);
        assert_int_equal(record_words(source, NONE), i <= 16 ? APP_OK : APP_USAGE);
        if (i <= 16) assert_true(got.place.n_ports == i && got.place.port[i - 1] == i);
    }
    for (int len = 127; len <= 128; len++) {
        snprintf(source, sizeof source, "tcp:%0*d:5", len, 0);
        assert_int_equal(record_words(source, NONE), len == 127 ? APP_OK : APP_USAGE);
        assert_int_equal(n_runs, len == 127);
    }
    assert_int_equal(record_words("tcp::5", NONE), APP_USAGE);
    assert_int_equal(record_words("udp:a:5,6,5", NONE), APP_USAGE);
    assert_int_equal(record_words("udp:a:5,6,6", NONE), APP_USAGE);
}

static void options(void **state)
{
    (void)state;
    assert_int_equal(record_words("tcp:a:5", (const char *const[]){"--duration", "2.5", "--wait", "3", "--stats", "j",
                                                                   "--quiet", "--ready-fd", "1", "--send", "ab\\n",
                                                                   "--send", "\\x41\\0\\\\", NULL}),
                     APP_OK);
    assert_true(got.duration_s == 2.5 && got.wait_s == 3 && got.quiet == 1 && got.ready_fd == 1 && got.n_sends == 2);
    assert_string_equal(got.stats, "j");
    assert_true(got.send[0].len == 3 && memcmp(sent[0], "ab\n", 3) == 0);
    assert_true(got.send[1].len == 3 && memcmp(sent[1], "A\0\\", 3) == 0);
}

static void where_clients_come(void **state)
{
    static const struct {
        const char *relay, *host; /* NULL: it is refused */
        int port;
    } rows[] = {{"9000", "", 9000},     {"0", "", 0},   {"65535", "", 65535}, {"127.0.0.2:1", "127.0.0.2", 1},
                {"[::1]:1", "::1", 1},  {":1", "", 1},  {"65536", NULL, 0},   {"-1", NULL, 0},
                {"", NULL, 0},          {"a", NULL, 0}, {"1a", NULL, 0},      {"1,2", NULL, 0},
                {"127.0.0.1:", NULL, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const int is_right = rows[i].host != NULL;
        assert_int_equal(record_words("tcp:a:5", (const char *const[]){"--relay", rows[i].relay, NULL}),
                         is_right ? APP_OK : APP_USAGE);
        assert_int_equal(n_runs, is_right);
        if (!is_right) continue;
        assert_string_equal(got.relay, rows[i].relay);
        assert_string_equal(got.clients.host, rows[i].host);
        assert_int_equal(got.clients.port[0], rows[i].port);
    }
}

static void exit_statuses(void **state)
{
    static const int codes[][2] = {{SH_OK, APP_OK},
                                   {SH_EIO, APP_FAILED},
                                   {SH_ELOST, APP_FAILED},
                                   {SH_ETIMEOUT, APP_FAILED},
                                   {SH_EINPUT, APP_USAGE}};
    (void)state;
    for (size_t i = 0; i < sizeof codes / sizeof codes[0]; i++) {
        run_rc = codes[i][0];
        assert_int_equal(record_words("udp:a:5", NONE), codes[i][1]);
    }
    run_rc = SH_OK;
}

/* raw_is_wanted looks for --raw before the line is read. After -- there are no options. */
static void who_wants_raw_data(void **state)
{
    static const struct {
        char *argv[4];
        int wants;
    } rows[] = {{{"record", "--raw"}, 1},
                {{"record", "a", "--raw"}, 1},
                {{"record", "--", "--raw"}, 0},
                {{"record", "a", "b", "--"}, 0},
                {{"record"}, 0},
                {{"--raw"}, 0},
                {{"record", "--raw", "--"}, 1}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char *argv[4];
        int argc = 0;
        for (; argc < 4 && rows[i].argv[argc] != NULL; argc++)
            argv[argc] = rows[i].argv[argc];
        assert_int_equal(raw_is_wanted(argc, argv), rows[i].wants);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(places),        cmocka_unit_test(limits),
        cmocka_unit_test(options),       cmocka_unit_test(where_clients_come),
        cmocka_unit_test(exit_statuses), cmocka_unit_test(who_wants_raw_data),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
