/* SPDX-License-Identifier: MIT */
/* A head that follows a PTP master, and loses it, over TCP: the answers, events, telemetry, PPS, truth and journal
 * agree with each other and with times worked out by hand.
 *
 * Announce comes each 0.5 s and Sync each 0.25 s; the boot is over at 0.2 s. So the second Announce is at 1 s, the
 * samples at 1 and 1.25 s give the rate, and the third one locks. The last Announce before the loss at 3.1 s is at 3 s,
 * and is missed three times at 4.5 s. In holdover the clock gains 100 ppm for 2.9 s. The two Announce messages at 6 and
 * 6.5 s bring the master back; 290 us are more than the 100 us of the threshold, so that the servo begins again. */
#include <inttypes.h>

#include "drivers/protocol/native.h"
#include "tests/wire/room.h"

#define SECOND_NS INT64_C(1000000000)

static const char MORE[] = "time:\n"
                           "  epoch: 2026-01-01T00:00:00Z\n"
                           "  drift_ppm: 20\n"
                           "  ptp: {follower: on, announce_ms: 500, sync_ms: 250, path_delay_ns: 640,\n"
                           "        step_threshold_ns: 100000, grandmaster: 0xec4670fffe0a1b2c}\n"
                           "faults: [{kind: ptp_lost, from_s: 3.1, until_s: 6, ppm: 100}]\n";

static const struct {
    int64_t at_ns;
    uint64_t port, servo;
    const char *text;
} SAID[] = {
    {200000000, 4, 0, "INITIALIZING to LISTENING on INIT_COMPLETE"},
    {1000000000, 8, 0, "LISTENING to UNCALIBRATED on RS_SLAVE"},
    {1250000000, 8, 1, "servo s0 to s1"},
    {1500000000, 9, 2, "UNCALIBRATED to SLAVE on MASTER_CLOCK_SELECTED, servo s1 to s2"},
    {4500000000, 4, 2, "SLAVE to LISTENING on ANNOUNCE_RECEIPT_TIMEOUT_EXPIRES"},
    {6500000000, 8, 2, "LISTENING to UNCALIBRATED on RS_SLAVE"},
    {6500000000, 8, 0, "servo s2 to s0"},
    {7000000000, 8, 1, "servo s0 to s1"},
    {7250000000, 9, 2, "UNCALIBRATED to SLAVE on MASTER_CLOCK_SELECTED, servo s1 to s2"},
};
enum { N_SAID = sizeof SAID / sizeof SAID[0] };

/* The servo has measured the rate to 1 ns over 0.25 s, which is 4e-9: after 3 s that is 12 ns. Times are rounded
 * down three times. */
static const int64_t WITHIN_NS = 15;

static int64_t gained_ns(int64_t t_ns)
{
    if (t_ns < 3100000000 || t_ns >= 7 * SECOND_NS) return 0; /* the step */
    return ((t_ns < 6000000000 ? t_ns : 6000000000) - 3100000000) / 10000;
}

/* An edge comes early by what the clock is ahead. Before the lock it has its own drift. */
static int take_pps(const struct scanhead_frame *frame)
{
    const int64_t at_ns = (int64_t)frame->event_value[1];
    const int64_t shown_ns = ((int64_t)frame->event_value[0] - INT64_C(1767225600)) * SECOND_NS;
    if (at_ns < 2 * SECOND_NS) return 0;
    if (llabs(shown_ns - at_ns - gained_ns(at_ns)) > WITHIN_NS)
        fail_msg("the second at %" PRId64 " ns shows %" PRId64 " ns", at_ns, shown_ns);
    return 1;
}

/* Between two Sync messages telemetry has the port and the offset of the last one. */
static int take_telemetry(const struct scanhead_frame *frame)
{
    struct native_telemetry t;
    assert_int_equal(native_decode_telemetry(frame->payload, frame->payload_len, &t), 0);
    if (frame->t_ns < 2 * SECOND_NS) return 0;
    const int lost = frame->t_ns >= 4500000000 && frame->t_ns < 6500000000, again = frame->t_ns == 7 * SECOND_NS;
    assert_int_equal(t.ptp_port, lost ? NATIVE_PTP_LISTENING : again ? NATIVE_PTP_UNCALIBRATED : NATIVE_PTP_SLAVE);
    assert_true(t.ptp_grandmaster == UINT64_C(0xec4670fffe0a1b2c) && t.ptp_delay_ns == 640 && t.ptp_class == 6);
    assert_true(llabs(t.ptp_offset_ns - (again ? 290000 : 0)) <= WITHIN_NS);
    return 1;
}

static void expect_event(const struct scanhead_frame *frame, int n)
{
    assert_true(n < N_SAID);
    assert_string_equal(frame->event_text, SAID[n].text);
    assert_true(frame->event_value[0] == SAID[n].port + 256 * SAID[n].servo);
    assert_true((int64_t)frame->event_value[1] == SAID[n].at_ns && frame->t_ns == SAID[n].at_ns);
}

static void take_frames(struct scanhead *sh)
{
    struct scanhead_frame frame;
    int n = 0, n_pps = 0, n_telemetry = 0;
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        if (is_event(&frame, SCANHEAD_EV_PTP)) expect_event(&frame, n++);
        if (is_event(&frame, SCANHEAD_EV_PPS)) n_pps += take_pps(&frame);
        if (frame.type == SCANHEAD_TELEMETRY) n_telemetry += take_telemetry(&frame);
    }
    assert_true(n == N_SAID && n_pps >= 7 && n_telemetry >= 7);
}

/* The journal's notes are those of the events, and the truth has the fault's begin and end. */
static void expect_files(struct wire *wire)
{
    char line[200];
    char *journal = wire_read(wire_path(wire, "journal"), NULL), *truth = wire_read(wire_path(wire, "truth"), NULL);
    for (int i = 0; i < N_SAID; i++) {
        snprintf(line, sizeof line, "# ptp: t_ns %" PRId64 ", %s\n", SAID[i].at_ns, SAID[i].text);
        assert_non_null(strstr(journal, line));
    }
    assert_non_null(strstr(truth, "\"kind\":\"ptp_lost\",\"t_ns\":3100000000"));
    assert_non_null(strstr(truth, "\"kind\":\"ptp_lost\",\"t_ns\":6000000000"));
    free(journal);
    free(truth);
}

static void test_holdover(void **state)
{
    struct wire *wire = *state;
    const struct room_config config = {.prr_hz = 20000,
                                       .lines_hz = 50,
                                       .pan_deg_s = 60,
                                       .pan_stop_deg = 120,
                                       .frames = 1,
                                       .links = LINK_YAML_TCP,
                                       .more = MORE};
    char journal[352], truth[352];
    snprintf(journal, sizeof journal, "%s", wire_path(wire, "journal"));
    snprintf(truth, sizeof truth, "%s", wire_path(wire, "truth"));
    const char *const args[] = {"--pace", "step", "--journal", journal, "--truth", truth, NULL};
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), args);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_tell(sh, "TIME:STEP 5500 MS");
    /* 2.4 s of holdover: 240 us ahead. */
    int64_t ns;
    assert_int_equal(sscanf(client_ask(sh, "TIME:UTC?"), "2026-01-01T00:00:05.%9" SCNd64 "Z", &ns), 1);
    assert_true(llabs(ns - 500240000) <= WITHIN_NS);
    assert_int_equal(strncmp(client_ask(sh, "TIME:PTP?"), "LISTENING,s2,", 13), 0);
    client_tell(sh, "TIME:STEP 4 S");
    const char *last = strchr(client_ask(sh, "TIME:PTP?"), '6');
    assert_non_null(last);
    assert_string_equal(last, "640,ec4670.fffe.0a1b2c,6,0x21,1");
    take_frames(sh);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    expect_files(wire);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_holdover, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
