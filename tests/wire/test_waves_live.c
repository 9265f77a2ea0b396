/* SPDX-License-Identifier: MIT */
/* Waveforms of a head that scans: a client switches them off and on, and each window is that of its pulse. */
#include "tests/wire/room.h"

enum { MOST = 4096 };

/* The pan has 720,000 counts, so 25 degrees a second are half a count a pulse: every second pulse is between two. */
static const struct room_config SCAN = {.profile = "riegl-vz400i",
                                        .prr_hz = 100000,
                                        .lines_hz = 50,
                                        .pan_deg_s = 25,
                                        .pan_stop_deg = 90,
                                        .links = LINK_YAML_TCP,
                                        .more = "signal: {model: on}\nsurfaces: [{reflectance: 0.02}]\n"
                                                "waveform: {send: on}\nloop: {queue_ms: 2000}\n"};

struct live {
    struct scanhead *sh;
    uint64_t changed_at;               /* first pulse with the last settings */
    uint64_t echoes, windows, matched; /* since `changed_at`; windows on their pulse's echo */
    uint64_t pulse0;                   /* of the last points */
    uint32_t n;
    uint64_t pulse[MOST];
    struct scanhead_point point[MOST];
};

static void take_points(struct live *live, const struct scanhead_frame *frame)
{
    live->pulse0 = frame->pulse0;
    live->n = frame->n_points;
    assert_int_equal(scanhead_points(live->sh, frame, 0, live->point, MOST), frame->n_points);
    uint64_t pulse = frame->pulse0 - 1;
    for (uint32_t i = 0; i < live->n; i++) {
        live->pulse[i] = pulse += live->point[i].echo < 2;
        live->echoes += live->point[i].echo != 0;
    }
}

/* A wall that is hit head on or slanted peaks within a sample of its range, and the half of its spread; 1 m is far above
 * both here. The beam of window and point is the same count of the same encoders, so it is the same to rounding. */
static void match(struct live *live, const struct scanhead_wave *w)
{
    uint32_t best = 0;
    for (uint32_t k = 1; k < w->n; k++)
        if (scanhead_wave_signal(w, k) > scanhead_wave_signal(w, best)) best = k;
    for (uint32_t i = 0; i < live->n; i++) {
        const struct scanhead_point *p = &live->point[i];
        if (live->pulse[i] != w->pulse || p->echo == 0) continue;
        assert_int_equal(p->t_ns, w->t_ns);
        const double at[3] = {p->x, p->y, p->z};
        for (int k = 0; k < 3; k++)
            assert_true(fabs(at[k] - p->range_m * w->direction[k]) < 1e-12 * p->range_m);
        if (fabs(w->range_m + best * w->step_m - p->range_m) < 1.0) live->matched++;
    }
}

static void take_waves(struct live *live, const struct scanhead_frame *frame)
{
    static struct scanhead_wave wave[MOST];
    const int n = scanhead_waves(live->sh, frame, 0, wave, MOST);
    assert_true(n >= 0);
    assert_int_equal(frame->pulse0, live->pulse0);
    for (int i = 0; i < n; i++)
        match(live, &wave[i]);
    live->windows += (uint64_t)n;
}

static void take_all(struct live *live)
{
    struct scanhead_frame frame;
    while (scanhead_next(live->sh, &frame, 0) == SCANHEAD_OK) {
        if (is_event(&frame, SCANHEAD_EV_SETTINGS)) {
            live->changed_at = frame.event_value[0];
            live->echoes = live->windows = live->matched = 0;
        }
        if (frame.type == SCANHEAD_POINTS) take_points(live, &frame);
        if (frame.type == SCANHEAD_WAVES) take_waves(live, &frame);
    }
}

static void step(struct live *live, const char *command)
{
    if (command != NULL) client_tell(live->sh, command);
    client_tell(live->sh, "TIME:STEP 100 MS");
    take_all(live);
}

static void test_switched_within_a_scan(void **state)
{
    struct wire *wire = *state;
    const char *const more[] = {"--pace", "step", NULL};
    static struct live live;
    char hash[65], want[65];
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &SCAN), more);
    live.sh = client_open(head_endpoint(&head, "tcp"));
    scanhead_hash_start(live.sh);
    while (strcmp(client_ask(live.sh, "HEAD:STAT?"), "idle") != 0)
        step(&live, NULL);
    assert_string_equal(client_ask(live.sh, "SCAN:WAV?"), "ON");
    client_tell(live.sh, "SCAN:STAR");
    for (int part = 0; part < 3; part++) {
        step(&live, part == 0 ? NULL : part == 1 ? "SCAN:WAV OFF" : "SCAN:WAV DEF");
        step(&live, NULL);
        assert_true(live.echoes > 2000);
        assert_int_equal(scanhead_has_waves(live.sh), part != 1);
        if (part == 1) assert_int_equal(live.windows, 0);
        if (part != 1) assert_true(live.matched > 0 && live.matched == live.echoes);
    }
    client_tell(live.sh, "SCAN:STOP");
    client_tell(live.sh, "TIME:STEP 500 MS");
    take_all(&live);
    scanhead_hash_hex(live.sh, hash);
    scanhead_close(live.sh);
    head_end(&head, SIGTERM);
    stats_hash(wire, want);
    assert_string_equal(hash, want);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_switched_within_a_scan, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
