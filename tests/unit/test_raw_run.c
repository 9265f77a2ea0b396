/* SPDX-License-Identifier: MIT */
/* The recording of `record --raw`, whatever the source is: how long it waits, when it reports and saves, what it says
 * at the end, and each step that fails. The source, the file and the clock are the test's; times are in ms. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <errno.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/record/outfile.h"
#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/app/studio/record/raw.h"
#include "tests/unit/clock_rig.h"
#include "tests/unit/output_rig.h"
#include "tests/unit/trace_rig.h"

#define MS INT64_C(1000000)

static struct raw r;
static char stats[512], progress[512], ready[128];
static int packets_at[8]; /* ms, ended by 0: when packets come */
static int n_came, stop_ms, over_ms, busy, poll_fails, shorter_ms;
static uint64_t dropped;

static int now(void)
{
    return (int)(clock_rig_ns / MS);
}

/* ---- what surrounds the recording */

static void take_progress(void *ctx, const char *what, double fraction)
{
    (void)ctx;
    const size_t n = strlen(progress);
    snprintf(progress + n, sizeof progress - n, "%d %s: %.3f\n", now(), what, fraction);
}

const struct sh_report app_report_stderr = {.progress = take_progress};

int app_interrupted(void)
{
    return stop_ms != 0 && now() >= stop_ms;
}

static void keep_json(char *to, size_t cap, void (*put)(struct json *json, const void *ctx), const void *ctx)
{
    struct web_body body;
    struct sh_err err;
    assert_int_equal(page_json(put, ctx, &body, &err), SH_OK);
    snprintf(to, cap, "%s", body.bytes);
    free(body.bytes);
}

int app_write_json(const char *path, void (*put)(struct json *json, const void *ctx), const void *ctx,
                   struct sh_err *err)
{
    assert_string_equal(path, "stats.json");
    keep_json(stats, sizeof stats, put, ctx);
    return call(err, "stats");
}

int app_say_ready(long fd, void (*put)(struct json *json, const void *ctx), const void *ctx, struct sh_err *err)
{
    assert_int_equal(fd, 9);
    keep_json(ready, sizeof ready, put, ctx);
    return call(err, "ready");
}

int app_and_also(int rc, int more, const struct sh_err *why, struct sh_err *err)
{
    return rc == SH_OK && more != SH_OK ? sh_fail(err, more, "%s", why->text) : rc;
}

void outfile_say_left(const char *path, const struct sh_report *report)
{
    assert_true(strcmp(path, "a.pcapng") == 0 && report == &app_report_stderr);
    say("left ");
}

void stamped_begin(struct stamped_socket *keeper)
{
    (void)keeper;
    say("stamp ");
}

void stamped_close(struct stamped_socket *keeper)
{
    (void)keeper;
    say("unstamp ");
}

int capture_open(struct capture *capture, const char *path, struct sh_err *err)
{
    assert_true(capture == &r.capture && strcmp(path, "a.pcapng") == 0);
    return call(err, "file");
}

int capture_add(struct capture *capture, const struct capture_frame *frame, struct sh_err *err)
{
    assert_int_equal(frame->len, 3);
    capture->packets++;
    return call(err, "add");
}

int capture_save(struct capture *capture, struct sh_err *err)
{
    assert_ptr_equal(capture, &r.capture);
    return call(err, "save");
}

int capture_close(struct capture *capture, int keep, struct sh_err *err)
{
    assert_ptr_equal(capture, &r.capture);
    return call(err, keep ? "keep" : "drop");
}

int poll(struct pollfd *fds, nfds_t n, int timeout_ms)
{
    assert_true(n == 1 && fds != NULL);
    say("%d+%d ", now(), timeout_ms);
    clock_rig_ns += timeout_ms * MS;
    errno = poll_fails;
    return poll_fails != 0 ? -1 : 0;
}

/* ---- the source */

static int ops_open(struct raw *of, struct sh_err *err)
{
    assert_ptr_equal(of, &r);
    strcpy(r.endpoint, "udp:here");
    return call(err, "open");
}

static int ops_wait_for(struct raw *of, struct pollfd *fds, int *timeout_ms)
{
    assert_ptr_equal(of, &r);
    fds[0] = (struct pollfd){.fd = 77};
    if (shorter_ms != 0 && *timeout_ms > shorter_ms) *timeout_ms = shorter_ms;
    return 1;
}

static int ops_work(struct raw *of, struct sh_err *err)
{
    if (call(err, "work") != SH_OK) return SH_EIO;
    if (over_ms != 0 && now() >= over_ms) r.over = 1;
    int n = 0;
    for (; packets_at[n_came] != 0 && packets_at[n_came] <= now(); n_came++, n++) {
        const struct capture_frame frame = {.t_ns = 5000 + n_came, .len = 3};
        const int rc = raw_write(of, &frame, 1000000, err);
        if (rc != SH_OK) return rc;
    }
    if (!busy) return n;
    clock_rig_ns += 300 * MS; /* more and more comes */
    return 1;
}

static int ops_finish(struct raw *of, struct sh_err *err)
{
    assert_ptr_equal(of, &r);
    return call(err, "finish");
}

static int ops_check(const struct raw *of, struct sh_err *err)
{
    assert_ptr_equal(of, &r);
    return call(err, "check");
}

static void ops_put(struct json *json, const struct raw *of)
{
    assert_ptr_equal(of, &r);
    json_uint(json, "own", 7);
}

static uint64_t ops_dropped(const struct raw *of)
{
    assert_ptr_equal(of, &r);
    return dropped;
}

static void ops_close(struct raw *of)
{
    assert_ptr_equal(of, &r);
    say("close");
}

static const struct raw_ops OPS = {.open = ops_open,
                                   .wait_for = ops_wait_for,
                                   .work = ops_work,
                                   .finish = ops_finish,
                                   .check = ops_check,
                                   .put = ops_put,
                                   .dropped = ops_dropped,
                                   .close = ops_close};

static int make(void **state)
{
    (void)state;
    memset(&r, 0, sizeof r);
    r.in.operand[0] = "udp:there";
    r.path = "a.pcapng";
    r.stats = "stats.json";
    r.ready_fd = 9;
    r.quiet = 1;
    r.ops = &OPS;
    trace[0] = stats[0] = progress[0] = ready[0] = '\0';
    memset(packets_at, 0, sizeof packets_at);
    fails = NULL;
    n_came = stop_ms = over_ms = busy = poll_fails = shorter_ms = 0;
    dropped = 0;
    clock_rig_ns = 0;
    clock_rig_cpu_s = 0.25;
    return 0;
}

#define BEGIN "file stamp open ready "

static void expect(int rc, const char *expected)
{
    struct sh_err err;
    assert_int_equal(raw_run(&r, &err), rc);
    assert_string_equal(trace, expected);
}

static void refuse(int rc, const char *text, const char *expected)
{
    struct sh_err err;
    assert_int_equal(raw_run(&r, &err), rc);
    assert_string_equal(err.text, text);
    assert_string_equal(trace, expected);
}

/* The duration counts from the first packet, which comes at 150 ms: it is read as the wait ends, at 200 ms. */
static void a_duration(void **state)
{
    (void)state;
    r.duration_s = 0.5;
    packets_at[0] = 150;
    packets_at[1] = 650;
    expect(SH_OK,
           BEGIN "0+200 work add 200+200 work 400+200 work 600+101 work add work finish unstamp keep check stats "
                 "close");
    assert_string_equal(ready, "{\"endpoint\":\"udp:here\"}\n");
    assert_string_equal(stats,
                        "{\"packets\":2,\"bytes\":2000000,\"dropped\":0,\"own\":7,\"wall_s\":0.501,\"cpu_s\":0.25}"
                        "\n");
    assert_true(r.first_ns == 200 * MS && r.last_t_ns == 5001);
}

/* The first packet has as long as --wait says, else as long as --duration; without either there is no limit. */
static void the_first_packet(void **state)
{
    (void)state;
    r.duration_s = 0.3;
    refuse(SH_ETIMEOUT, "udp:there: no packet came; a.pcapng is not written",
           BEGIN "0+200 work 200+101 work work finish unstamp drop stats close");
    make(NULL);
    r.duration_s = 0.2;
    r.wait_s = 0.4;
    packets_at[0] = 390;
    expect(SH_OK, BEGIN "0+200 work 200+200 work add 400+200 work work finish unstamp keep check stats close");
    make(NULL);
    stop_ms = 300;
    expect(SH_ETIMEOUT, BEGIN "0+200 work 200+200 work work finish unstamp drop stats close");
    assert_string_equal(stats, "{\"packets\":0,\"bytes\":0,\"dropped\":0,\"own\":7,\"wall_s\":0.4,\"cpu_s\":0.25}\n");
    make(NULL);
    r.wait_s = 0.1; /* once a packet came, there is no end without a duration */
    packets_at[0] = 50;
    stop_ms = 300;
    expect(SH_OK, BEGIN "0+101 work add 101+200 work work finish unstamp keep check stats close");
}

/* A source that is over has nothing more to read. It may ask for shorter waits. */
static void a_source_that_ends(void **state)
{
    (void)state;
    packets_at[0] = 10;
    over_ms = 20;
    shorter_ms = 10;
    expect(SH_OK, BEGIN "0+10 work add 10+10 work finish unstamp keep check stats close");
}

/* Once a second it reports, and saves. */
static void reports(void **state)
{
    (void)state;
    r.duration_s = 2.5;
    packets_at[0] = 400;
    dropped = 3;
    expect(SH_OK,
           BEGIN "0+200 work 200+200 work add 400+200 work 600+200 work 800+200 work save 1000+200 work 1200+200 "
                 "work 1400+200 work 1600+200 work 1800+200 work save 2000+200 work 2200+200 work 2400+200 work "
                 "2600+200 work 2800+101 work work finish unstamp keep check stats close");
    assert_string_equal(progress, "1000 recording: 1 packets, 1.000 MB, 3 dropped: 0.240\n"
                                  "2000 recording: 1 packets, 1.000 MB, 3 dropped: 0.640\n");
    make(NULL);
    stop_ms = 1200;
    packets_at[0] = 400;
    expect(SH_OK, BEGIN "0+200 work 200+200 work add 400+200 work 600+200 work 800+200 work save 1000+200 work work "
                        "finish unstamp keep check stats close");
    assert_string_equal(progress, "1000 recording: 1 packets, 1.000 MB: -1.000\n"); /* its end is not known */
}

/* What the system still holds is written, for a second at most. */
static void the_end(void **state)
{
    (void)state;
    stop_ms = 100;
    packets_at[0] = 50;
    packets_at[1] = 250;
    packets_at[2] = 210;
    expect(SH_OK, BEGIN "0+200 work add work finish unstamp keep check stats close");
    make(NULL);
    stop_ms = 100;
    packets_at[0] = 50;
    busy = 1;
    expect(SH_OK, BEGIN "0+200 work add work work work work finish unstamp keep check stats close");
    assert_true(r.wall_s > 1.4999 && r.wall_s < 1.5001);
}

static void what_it_says(void **state)
{
    struct output output;
    struct sh_err err;
    (void)state;
    for (int quiet = 0; quiet < 2; quiet++) {
        make(NULL);
        r.quiet = quiet;
        r.stats = NULL;
        over_ms = packets_at[0] = 1;
        dropped = 2;
        output_take(&output, stderr);
        const int rc = raw_run(&r, &err);
        char *said = output_give(&output);
        assert_int_equal(rc, SH_OK);
        assert_string_equal(said, quiet ? "" : "scanhead: 1 packets, 1.000 MB, 2 dropped in a.pcapng\n");
        free(said);
        assert_string_equal(trace, BEGIN "0+200 work add finish unstamp keep check close");
    }
}

static void each_step_may_fail(void **state)
{
    static const struct {
        const char *step, *trace;
    } rows[] = {{"file", "file drop "},
                {"open", "file stamp open unstamp drop close"},
                {"ready", BEGIN "unstamp drop close"},
                {"work", BEGIN "0+200 work unstamp drop close"},
                {"add", BEGIN "0+200 work add unstamp keep stats close"},
                {"save", BEGIN "0+200 work add 200+200 work 400+200 work 600+200 work 800+200 work save unstamp keep "
                               "stats close"},
                {"finish",
                 BEGIN "0+200 work add 200+200 work 400+200 work 600+200 work 800+200 work save 1000+200 work "
                       "work finish unstamp keep stats close"},
                {"keep", BEGIN "0+200 work add 200+200 work 400+200 work 600+200 work 800+200 work save 1000+200 work "
                               "work finish unstamp keep left stats close"},
                {"check", BEGIN "0+200 work add 200+200 work 400+200 work 600+200 work 800+200 work save 1000+200 work "
                                "work finish unstamp keep check stats close"},
                {"stats", BEGIN "0+200 work add 200+200 work 400+200 work 600+200 work 800+200 work save 1000+200 work "
                                "work finish unstamp keep check stats close"}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char text[32];
        make(NULL);
        r.duration_s = 1.0;
        packets_at[0] = 10;
        fails = rows[i].step;
        snprintf(text, sizeof text, "%s failed", rows[i].step);
        refuse(SH_EIO, text, rows[i].trace);
    }
    make(NULL);
    poll_fails = ENOMEM;
    refuse(SH_EIO, "udp:there: cannot wait: Cannot allocate memory", BEGIN "0+200 unstamp drop close");
    make(NULL);
    poll_fails = EINTR; /* a signal ends a wait, and no more */
    stop_ms = 200;
    expect(SH_ETIMEOUT, BEGIN "0+200 work work finish unstamp drop stats close");
}

static void names_of_ends(void **state)
{
    struct sockaddr_storage at = {0};
    struct sockaddr_in *four = (struct sockaddr_in *)&at;
    struct sockaddr_in6 *six = (struct sockaddr_in6 *)&at;
    (void)state;
    four->sin_family = AF_INET;
    four->sin_port = htons(2368);
    four->sin_addr.s_addr = htonl(0x7f000102);
    struct ethernet_end end = raw_end_of(&at);
    assert_true(!end.is_v6 && end.port == 2368);
    assert_memory_equal(end.address, ((const uint8_t[]){127, 0, 1, 2}), 4);
    memset(&at, 0, sizeof at);
    six->sin6_family = AF_INET6;
    six->sin6_port = htons(2369);
    for (int i = 0; i < 16; i++)
        six->sin6_addr.s6_addr[i] = (uint8_t)(i + 1);
    end = raw_end_of(&at);
    assert_true(end.is_v6 && end.port == 2369);
    assert_memory_equal(end.address, six->sin6_addr.s6_addr, 16);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_duration, make),
        cmocka_unit_test_setup(the_first_packet, make),
        cmocka_unit_test_setup(a_source_that_ends, make),
        cmocka_unit_test_setup(reports, make),
        cmocka_unit_test_setup(the_end, make),
        cmocka_unit_test_setup(what_it_says, make),
        cmocka_unit_test_setup(each_step_may_fail, make),
        cmocka_unit_test_setup(names_of_ends, make),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
