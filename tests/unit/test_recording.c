/* SPDX-License-Identifier: MIT */
/* Taking a scan: a scripted head, over TCP, loses frames to the recorder and is unplugged. Some scans count as
 * broken. */
#include <arpa/inet.h>
#include <poll.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/app/studio/record/recording.h"
#include "firmware_sim/command/head.h"

/* The head's actions, one after the other. */
enum deed {
    END,
    PULSES,    /* some of a scan */
    LINES,     /* two ends of lines, with counts */
    LOSES,     /* frames do not reach the recorder, the scan's end among them */
    TELLS,     /* that it is idle, and what the scan had */
    ENDS,      /* the scan, with the same counts */
    IDLE,      /* is asked its state, and says so */
    SCANNING,  /* likewise */
    SLOWS,     /* likewise, after a scan */
    ASKED,     /* likewise, and says nothing */
    STARTS,    /* a scan, as it is told */
    FAR,       /* a scan begins, and a time goes back by all that 64 bits hold */
    UNPLUGGED, /* and plugged in again */
    UNASKED    /* for longer than a recorder waits for pulses */
};

struct head {
    int listener;
    const enum deed *script;
    const char *wrong;
    int fd;
    uint32_t seq;
    int listens;                  /* the recorder; else it starts the scan itself, and ends with it */
    _Atomic uint32_t sent, taken; /* frames */
    _Atomic int over;
};

static struct head head;

static void send_frame(uint8_t *frame, size_t len)
{
    native_finish_frame(frame, head.seq++);
    if (send(head.fd, frame, len, MSG_NOSIGNAL) != (ssize_t)len) head.wrong = "a frame was not taken";
    atomic_fetch_add(&head.sent, 1);
}

/* Sends telemetry of scan 3 with 100 pulses, 60 of them cast and 7 of those lost by the head. */
static void send_telemetry(uint32_t state)
{
    uint8_t frame[256];
    struct native_telemetry t = {.state = state, .scan = 3, .scan_fired = 100, .scan_cast = 60, .scan_lost = 7};
    send_frame(frame, native_encode_telemetry(frame, sizeof frame, &t, 0, 0));
}

static void send_end(void)
{
    uint8_t frame[256];
    struct native_event end = {.code = NATIVE_EV_SCAN_END, .a = 3, .b = 100, .c = 7};
    send_telemetry(HEAD_SPIN_DOWN);
    send_frame(frame, native_encode_event(frame, sizeof frame, &end, 0, 0));
}

static void send_pulse(void)
{
    uint8_t frame[256], echo = 0x11;
    uint32_t zero = 0;
    int16_t refl = 0;
    uint16_t label = 0;
    struct line_block block = {.n_pulses = 1,
                               .n_points = 1,
                               .dt_ns = &zero,
                               .a = &zero,
                               .b = &zero,
                               .c = &zero,
                               .refl_cdb = &refl,
                               .echo = &echo,
                               .label = &label};
    send_frame(frame, native_encode_points(frame, sizeof frame, &block, 0));
}

/* Two lines that left out 1 and 10 echoes for the lack of room, 2 and 20 faint ones, 3 and 30 that do not fit. */
static void send_lines(void)
{
    uint8_t frame[256];
    for (uint32_t times = 1; times <= 10; times += 9) {
        const struct line_end end = {.n_crowded = times, .n_faint = 2 * times, .n_unfit = 3 * times};
        send_frame(frame, native_encode_line_end(frame, sizeof frame, &end, 0));
    }
}

static void send_far(void)
{
    uint8_t frame[256];
    struct native_event start = {.code = NATIVE_EV_SCAN_START, .a = 3, .b = 1};
    struct native_telemetry t = {.state = HEAD_SCANNING, .scan = 3};
    send_frame(frame, native_encode_event(frame, sizeof frame, &start, 0, 0));
    send_frame(frame, native_encode_telemetry(frame, sizeof frame, &t, INT64_MIN, 0));
}

static void answer(const char *question, const char *state)
{
    char line[64];
    size_t n = 0;
    while (n < sizeof line - 1 && read(head.fd, line + n, 1) == 1 && line[n] != '\n')
        n++;
    line[n] = '\0';
    if (strcmp(line, question) != 0) head.wrong = "asked something else";
    if (send(head.fd, state, strlen(state), MSG_NOSIGNAL) != (ssize_t)strlen(state))
        head.wrong = "an answer was not taken";
}

static void *play(void *arg)
{
    (void)arg;
    head.fd = accept(head.listener, NULL, NULL);
    for (const enum deed *deed = head.script; *deed != END && head.wrong == NULL; deed++) {
        if (*deed == PULSES) send_pulse();
        if (*deed == LINES) send_lines();
        if (*deed == IDLE) answer("HEAD:STAT?", "idle\r\n");
        if (*deed == SCANNING) answer("HEAD:STAT?", "scanning\r\n");
        if (*deed == SLOWS) answer("HEAD:STAT?", "spin-down\r\n");
        if (*deed == ASKED) answer("HEAD:STAT?", "");
        if (*deed == STARTS) answer("SCAN:STAR", "OK\r\n");
        if (*deed == LOSES) {
            head.seq += 5;
            send_telemetry(HEAD_SCANNING);
        }
        if (*deed == TELLS) send_telemetry(HEAD_IDLE);
        if (*deed == ENDS) send_end();
        if (*deed == FAR) send_far();
        if (*deed == UNASKED && poll(&(struct pollfd){.fd = head.fd, .events = POLLIN}, 1, 3000) != 0)
            head.wrong = "was asked something";
        if (*deed == UNPLUGGED) {
            close(head.fd);
            head.fd = accept(head.listener, NULL, NULL);
        }
    }
    atomic_store(&head.over, 1);
    if (head.listens) send_telemetry(HEAD_SCANNING); /* so that the recorder need not wait to see that it is over */
    return NULL;
}

/* Returns whether the head is over and the recorder has taken all of its frames. */
static int is_over(void)
{
    return atomic_load(&head.over) && atomic_load(&head.taken) >= atomic_load(&head.sent);
}

static int take_frame(void *ctx, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    (void)ctx;
    (void)sh;
    (void)frame;
    (void)err;
    atomic_fetch_add(&head.taken, 1);
    return SH_OK;
}

static double last_fraction;

static void keep_fraction(void *ctx, const char *what, double fraction)
{
    (void)ctx;
    (void)what;
    last_fraction = fraction;
}

static void record_with(const enum deed *script, double replug_s, int listens, struct recording_result *result)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t len = sizeof at;
    head = (struct head){.script = script, .listens = listens, .listener = socket(AF_INET, SOCK_STREAM, 0)};
    assert_int_equal(bind(head.listener, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(listen(head.listener, 1), 0);
    assert_int_equal(getsockname(head.listener, (struct sockaddr *)&at, &len), 0);
    char source[64], why[256];
    struct scanhead *sh;
    snprintf(source, sizeof source, "tcp:127.0.0.1:%d", ntohs(at.sin_port));
    if (scanhead_open(source, &sh, why, sizeof why) != SCANHEAD_OK) fail_msg("%s", why);
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, play, NULL), 0);
    const struct sh_report report = {.progress = keep_fraction};
    const struct recording_options options = {.listen = listens,
                                              .frames = -1,
                                              .replug_s = replug_s,
                                              .progress = 1,
                                              .source_bytes = 1000000,
                                              .report = &report,
                                              .frame = take_frame,
                                              .interrupted = listens ? is_over : NULL};
    last_fraction = -1;
    struct sh_err err = {0, ""};
    int rc = recording_run(sh, &options, result, &err);
    scanhead_close(sh);
    shutdown(head.listener, SHUT_RDWR); /* this ends any wait of the head */
    pthread_join(thread, NULL);
    close(head.fd);
    close(head.listener);
    if (head.wrong != NULL) fail_msg("the head: %s", head.wrong);
    if (rc != SH_OK) fail_msg("%s", err.text);
}

static void record(const enum deed *script, struct recording_result *result)
{
    record_with(script, 20, 1, result);
}

static void check_counts(const struct recording_counts *counts, uint64_t pulses)
{
    assert_int_equal(counts->scans, 1);
    assert_int_equal(counts->fired, 100);
    assert_int_equal(counts->cast, 60);
    assert_int_equal(counts->lost, 7);
    assert_int_equal(counts->pulses, pulses);
    assert_int_equal(counts->missing, 60 - 7 - pulses);
    assert_int_equal(counts->unknown, 0);
}

static void test_unplugged_within_a_scan(void **state)
{
    (void)state;
    static const enum deed once[] = {PULSES, UNPLUGGED, SCANNING, PULSES, UNPLUGGED, SCANNING, END};
    struct recording_result result;
    record(once, &result);
    assert_int_equal(result.replugs, 2);
    assert_int_equal(result.broken_scans, 1); /* one scan, however often */
    assert_int_equal(result.counts.pulses, 2);
}

static void test_lines_add_up(void **state)
{
    (void)state;
    static const enum deed script[] = {PULSES, LINES, PULSES, PULSES, ENDS, END};
    struct recording_result result;
    record(script, &result);
    assert_true(result.crowded == 11 && result.faint == 22 && result.unfit == 33);
    assert_true(result.points == 3 && result.empty == 0 && result.lost_samples == 0);
    check_counts(&result.counts, 3);
}

/* The scan was over, though its end was lost, so nothing was left to break. */
static void test_unplugged_after_a_lost_end(void **state)
{
    (void)state;
    static const enum deed after[] = {PULSES, LOSES, IDLE, UNPLUGGED, IDLE, END};
    struct recording_result result;
    record(after, &result);
    assert_int_equal(result.replugs, 1);
    assert_int_equal(result.broken_scans, 0);
    /* The two seconds of silence had reports of progress: two frames of a source of a million bytes. */
    assert_true(last_fraction > 0 && last_fraction < 0.01);
}

/* The recorder waits for the mirror to come to rest after an earlier scan. */
static void test_unplugged_between_scans(void **state)
{
    (void)state;
    static const enum deed script[] = {SLOWS, ASKED, UNPLUGGED, SLOWS, IDLE, STARTS, PULSES, ENDS, END};
    struct recording_result result;
    record_with(script, 20, 0, &result);
    assert_int_equal(result.replugs, 1);
    assert_int_equal(result.broken_scans, 0);
    check_counts(&result.counts, 1);
}

/* A source that is only listened to may be a pipe. */
static void test_nothing_is_asked_of_a_source(void **state)
{
    (void)state;
    static const enum deed script[] = {PULSES, LOSES, UNASKED, END};
    struct recording_result result;
    record_with(script, 0, 1, &result);
    assert_int_equal(result.counts.pulses, 1);
}

/* A recorder that lost a scan's end has its counts from the next telemetry. When the head is unplugged then, no scan is
 * broken. */
static void test_telemetry_after_a_lost_end(void **state)
{
    (void)state;
    static const enum deed script[] = {PULSES, PULSES, LOSES, TELLS, UNPLUGGED, IDLE, END};
    struct recording_result result;
    record(script, &result);
    assert_int_equal(result.broken_scans, 0);
    check_counts(&result.counts, 2);
}

/* A recorder that joined within a scan knows at its end how much came before. */
static void test_joined_within_a_scan(void **state)
{
    (void)state;
    static const enum deed script[] = {PULSES, ENDS, UNPLUGGED, IDLE, END};
    struct recording_result result;
    record(script, &result);
    check_counts(&result.counts, 1);
}

/* A head that is much too slow sends an end again after the mirror has come to rest. Both ends are of one scan. */
static void test_an_end_after_telemetry(void **state)
{
    (void)state;
    static const enum deed script[] = {PULSES, LOSES, PULSES, TELLS, ENDS, UNPLUGGED, IDLE, END};
    struct recording_result result;
    record(script, &result);
    check_counts(&result.counts, 2);
}

/* The next scan does not take over a break of this one. */
static void test_broken_once_more_after_a_lost_end(void **state)
{
    (void)state;
    static const enum deed twice[] = {PULSES, UNPLUGGED, SCANNING, LOSES, IDLE, PULSES, UNPLUGGED, SCANNING, END};
    struct recording_result result;
    record(twice, &result);
    assert_int_equal(result.replugs, 2);
    assert_int_equal(result.broken_scans, 2);
}

/* A hostile stream: 64 bits do not hold the difference of two times, and a sanitizer would report that. */
static void test_times_far_apart(void **state)
{
    (void)state;
    static const enum deed script[] = {FAR, PULSES, END};
    struct recording_result result;
    record(script, &result);
    assert_int_equal(result.counts.pulses, 1);
}

static void test_order_is_said(void **state)
{
    struct recording_result result = {.stream = {.frames = 9, .seq_lost = 4}};
    char text[256] = "";
    (void)state;
    assert_int_equal(recording_describe_order(&result, text, sizeof text), 0);
    assert_string_equal(text, "");
    result.stream.repeated = 3;
    result.stream.late = 2;
    assert_int_equal(recording_describe_order(&result, text, sizeof text), 1);
    assert_string_equal(text, "3 frames came twice (used once), 2 frames came after newer ones (lost)");
    struct sh_err err = {0};
    /* A broken frame whose copy came is not lost; those at the ends of a stream are. */
    result.stream = (struct scanhead_stats){.bad_payload = 5};
    assert_int_equal(recording_check_complete(&result, &err), SH_OK);
    result.stream = (struct scanhead_stats){.bad_payload = 5, .bad_unseen = 2, .seq_lost = 3, .dropped = 4};
    assert_int_equal(recording_check_complete(&result, &err), SH_EIO);
    assert_non_null(strstr(err.text, ": 9 frames lost to this reader"));
    result.stream = (struct scanhead_stats){.restarts = 1};
    assert_int_equal(recording_describe_order(&result, text, sizeof text), 1);
    assert_string_equal(text, "1 restarts of the sequence");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lines_add_up),
        cmocka_unit_test(test_unplugged_within_a_scan),
        cmocka_unit_test(test_unplugged_after_a_lost_end),
        cmocka_unit_test(test_unplugged_between_scans),
        cmocka_unit_test(test_nothing_is_asked_of_a_source),
        cmocka_unit_test(test_telemetry_after_a_lost_end),
        cmocka_unit_test(test_joined_within_a_scan),
        cmocka_unit_test(test_an_end_after_telemetry),
        cmocka_unit_test(test_broken_once_more_after_a_lost_end),
        cmocka_unit_test(test_times_far_apart),
        cmocka_unit_test(test_order_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
