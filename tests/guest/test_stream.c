/* SPDX-License-Identifier: MIT */
/* Tests of the client's side of a head on a real bus: the console, a scan with every frame looked at, and unplugging in
 * its middle.
 *
 * The environment gives SOURCE (default usb), CONSOLE (a tty), PLUG and UNPLUG (the shell commands that do it), and
 * REPLUGS (how often). A test whose values are missing is skipped. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <cmocka.h>

#include "drivers/host/scanhead.h"

/* This is ample for an emulated machine, so only a head that never answers reaches it. */
enum { WAIT_MS = 240000 };

static const char *env(const char *name)
{
    const char *value = getenv(name);
    if (value == NULL || *value == 0) {
        print_message("%s is not given\n", name);
        skip();
    }
    return value;
}

static const char *source(void)
{
    const char *value = getenv("SOURCE");
    return value != NULL ? value : "usb";
}

/* Tries until the time is over, because a device that was plugged in just now takes a moment. */
static struct scanhead *open_head(const char *name)
{
    struct scanhead *sh = NULL;
    char why[256] = "";
    struct timespec pause = {.tv_nsec = 50000000};
    for (int i = 0; i < WAIT_MS / 50 && sh == NULL; i++)
        if (scanhead_open(name, &sh, why, sizeof why) != 0) nanosleep(&pause, NULL);
    if (sh == NULL) fail_msg("%s", why);
    return sh;
}

static void tell(struct scanhead *sh, const char *command, char reply[512])
{
    if (scanhead_command(sh, command, reply, 512, WAIT_MS) != 0) fail_msg("%s: %s", command, scanhead_error(sh));
}

static void do_command(struct scanhead *sh, const char *command)
{
    char reply[512];
    tell(sh, command, reply);
    if (strncmp(reply, "ERR", 3) == 0) fail_msg("%s: %s", command, reply);
}

static void wait_idle(struct scanhead *sh)
{
    char reply[512] = "";
    struct scanhead_frame frame;
    for (time_t end_s = time(NULL) + WAIT_MS / 1000; strcmp(reply, "idle") != 0 && time(NULL) < end_s;) {
        scanhead_next(sh, &frame, 50);
        tell(sh, "HEAD:STAT?", reply);
    }
    if (strcmp(reply, "idle") != 0) fail_msg("the head stays %s", reply);
}

/* ---- every frame is looked at. Missing pulses must have been announced before, as a gap in the sequence numbers or as
 * pulses that the head could not compute. */

struct watch {
    uint64_t frames, pulses, next_pulse, announced, scan_pulses;
    int over, have_pulse;
};

static void look(struct watch *w, struct scanhead *sh, const struct scanhead_frame *frame)
{
    struct scanhead_stats s;
    scanhead_get_stats(sh, &s);
    uint64_t announced = s.seq_gaps + s.pulses_lost;
    w->frames++;
    if (frame->type == SCANHEAD_POINTS) {
        if (w->have_pulse && frame->pulse0 != w->next_pulse && announced == w->announced)
            fail_msg("pulse %llu follows %llu, and nothing was said to be lost", (unsigned long long)frame->pulse0,
                     (unsigned long long)w->next_pulse);
        w->have_pulse = 1;
        w->pulses += frame->n_pulses;
        w->next_pulse = frame->pulse0 + frame->n_pulses;
        w->announced = announced;
    }
    if (frame->type == SCANHEAD_EVENT && frame->event == SCANHEAD_EV_SCAN_END) {
        w->scan_pulses = frame->event_value[1];
        w->over = 1;
    }
}

static int next(struct watch *w, struct scanhead *sh)
{
    struct scanhead_frame frame;
    int rc = scanhead_next(sh, &frame, WAIT_MS);
    if (rc == 0) look(w, sh, &frame);
    return rc;
}

/* Starts a scan and waits for its beginning, because a gadget's tty first brings what it holds of an earlier
 * session. */
static void start_scan(struct scanhead *sh)
{
    char reply[512];
    struct scanhead_frame frame = {0};
    tell(sh, "TIME?", reply);
    do_command(sh, "SCAN:STAR");
    while (frame.type != SCANHEAD_EVENT || frame.event != SCANHEAD_EV_SCAN_START ||
           frame.event_value[1] < strtoull(reply, NULL, 10))
        if (scanhead_next(sh, &frame, WAIT_MS) != 0) fail_msg("%s", scanhead_error(sh));
}

static void scan(const char *name, struct watch *w)
{
    struct scanhead_stats s, before;
    struct scanhead *sh = open_head(name);
    memset(w, 0, sizeof *w);
    wait_idle(sh);
    start_scan(sh);
    scanhead_get_stats(sh, &before);
    while (!w->over)
        if (next(w, sh) != 0) fail_msg("%s", scanhead_error(sh));
    scanhead_get_stats(sh, &s);
    assert_int_equal(s.bad_bytes + s.bad_payload + s.seq_lost + s.reader_lost + s.pulses_lost,
                     before.bad_bytes + before.bad_payload + before.seq_lost + before.reader_lost + before.pulses_lost);
    assert_true(w->pulses > 0);
    assert_int_equal(w->next_pulse, w->scan_pulses);
    assert_int_equal(w->pulses, w->scan_pulses);
    do_command(sh, "SYST:CONT:REL");
    scanhead_close(sh);
}

static void test_scan(void **state)
{
    struct watch w;
    (void)state;
    for (int i = 0; i < 2; i++)
        scan(source(), &w);
}

/* ---- the console */

static void test_console(void **state)
{
    char command[300], reply[512];
    const char *tty = env("CONSOLE");
    (void)state;
    snprintf(command, sizeof command, "tty:%s", tty);
    struct scanhead *sh = open_head(command);
    for (int i = 0; i < 100; i++) { /* each command gets its own reply, and none of an earlier one */
        tell(sh, "*IDN?", reply);
        assert_int_equal(strncmp(reply, "scanhead,", 9), 0);
        snprintf(command, sizeof command, "SCAN:FRAM %d", 1 + i % 7);
        do_command(sh, command);
        tell(sh, "SCAN:FRAM?", reply);
        assert_int_equal(atoi(reply), 1 + i % 7);
    }
    do_command(sh, "SCAN:FRAM 1");
    memset(command, ' ', 250); /* the longest command allowed takes several packets at full speed */
    strcpy(command + 250, "*IDN?");
    tell(sh, command, reply);
    assert_int_equal(strncmp(reply, "scanhead,", 9), 0);
    do_command(sh, "*CLS");
    tell(sh, "NO:SUCH:COMMAND", reply);
    assert_int_equal(strncmp(reply, "ERR -113,", 9), 0);
    tell(sh, "SYST:ERR?", reply);
    assert_non_null(strstr(reply, "-113,"));
    do_command(sh, "SYST:CONT:REL"); /* the head does not see at once that a gadget's console is closed */
    scanhead_close(sh);
}

static void test_scan_on_console(void **state)
{
    char name[256];
    struct watch w;
    (void)state;
    snprintf(name, sizeof name, "tty:%s", env("CONSOLE"));
    scan(name, &w);
}

/* ---- sessions */

static void test_sessions(void **state)
{
    char reply[512];
    (void)state;
    for (int i = 0; i < 10; i++) {
        struct scanhead *sh = open_head(source());
        tell(sh, "*IDN?", reply);
        assert_int_equal(strncmp(reply, "scanhead,", 9), 0);
        scanhead_close(sh);
    }
    struct scanhead *first = open_head(source()), *second;
    assert_int_equal(scanhead_open(source(), &second, reply, sizeof reply), SCANHEAD_EIO);
    assert_non_null(strstr(reply, "another program"));
    scanhead_close(first);
}

/* ---- unplugging */

static void run(const char *command)
{
    int status = system(command);
    if (status != 0) fail_msg("%s: status %d", command, status);
}

static void unplug_in_the_middle(struct scanhead *sh, struct watch *w)
{
    struct scanhead_stats before, after;
    char reply[512];
    w->over = 0;
    tell(sh, "HEAD:STAT?", reply);
    if (strcmp(reply, "idle") == 0) {
        w->have_pulse = 0; /* this is another scan */
        do_command(sh, "SCAN:STAR");
    }
    uint64_t pulses = w->pulses;
    while (w->pulses < pulses + 200 && !w->over)
        if (next(w, sh) != 0) fail_msg("%s", scanhead_error(sh));
    run(env("UNPLUG"));
    int rc;
    while ((rc = next(w, sh)) == 0) {
    }
    assert_int_equal(rc, SCANHEAD_ELOST);
    scanhead_get_stats(sh, &before);
    run(env("PLUG"));
    if (scanhead_reattach(sh, WAIT_MS) != 0) fail_msg("%s", scanhead_error(sh));
    tell(sh, "*IDN?", reply);
    scanhead_get_stats(sh, &after);
    assert_int_equal(after.bad_payload, 0);
    /* At most one frame was cut, and only its bytes were thrown away. */
    assert_true(after.bad_bytes - before.bad_bytes < 65536);
}

static void test_replug(void **state)
{
    struct watch w = {0};
    struct scanhead_stats s;
    const char *times = env("REPLUGS");
    (void)state;
    struct scanhead *sh = open_head(source());
    wait_idle(sh);
    do_command(sh, "SCAN:FRAM 1000");
    for (int i = 0; i < atoi(times); i++)
        unplug_in_the_middle(sh, &w);
    char reply[512];
    tell(sh, "HEAD:STAT?", reply); /* a head that was started anew may have ended its scan */
    if (strcmp(reply, "idle") != 0) do_command(sh, "SCAN:STOP");
    wait_idle(sh);
    do_command(sh, "SCAN:FRAM 1");
    scanhead_get_stats(sh, &s);
    print_message("%s times: %llu frames, %llu lost meanwhile, in %llu gaps; %llu pulses too late\n", times,
                  (unsigned long long)s.frames, (unsigned long long)s.seq_lost, (unsigned long long)s.seq_gaps,
                  (unsigned long long)s.pulses_lost);
    scanhead_close(sh);
}

/* Stops a head that still scans for a client that has gone, so that the tests begin with a head at rest. */
static int settle(void **state)
{
    char reply[512];
    (void)state;
    struct scanhead *sh = open_head(source());
    tell(sh, "HEAD:STAT?", reply);
    if (strcmp(reply, "scanning") == 0) do_command(sh, "SCAN:STOP");
    wait_idle(sh);
    do_command(sh, "SCAN:FRAM 1");
    scanhead_close(sh);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sessions),        cmocka_unit_test(test_console), cmocka_unit_test(test_scan),
        cmocka_unit_test(test_scan_on_console), cmocka_unit_test(test_replug),
    };
    return cmocka_run_group_tests_name("stream", tests, settle, NULL);
}
