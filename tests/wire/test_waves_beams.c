/* SPDX-License-Identifier: MIT */
/* Each window of a head's waveforms has the time and the beam of its pulse's points, to the count. */
#include "tests/wire/room.h"

enum { MOST = 4096 };

/* The pan has 720,000 counts, so 25 degrees a second are half a count a pulse: every second pulse is between two. */
static const struct room_config SCAN = {.profile = "riegl-vz400i",
                                        .prr_hz = 100000,
                                        .lines_hz = 50,
                                        .pan_deg_s = 25,
                                        .pan_stop_deg = 2,
                                        .frames = 1,
                                        .links = "links: []\n",
                                        .more = "signal: {model: on}\nsurfaces: [{reflectance: 0.02}]\n"
                                                "waveform: {send: on}\n"};

struct points {
    uint32_t n;
    uint64_t pulse[MOST];
    struct scanhead_point point[MOST];
};

static void take_points(struct scanhead *sh, const struct scanhead_frame *frame, struct points *points)
{
    points->n = frame->n_points;
    assert_int_equal(scanhead_points(sh, frame, 0, points->point, MOST), frame->n_points);
    uint64_t pulse = frame->pulse0 - 1;
    for (uint32_t i = 0; i < points->n; i++)
        points->pulse[i] = pulse += points->point[i].echo < 2;
}

/* The point is range times direction; five operations and sine and cosine round, each by 1.2e-16 of it. Another count
 * would be 9e-6. */
static void expect_beam(const struct scanhead_wave *w, const struct scanhead_point *p)
{
    const double at[3] = {p->x, p->y, p->z};
    assert_int_equal(p->t_ns, w->t_ns);
    for (int k = 0; k < 3; k++)
        assert_true(fabs(at[k] - p->range_m * w->direction[k]) < 1e-14 * p->range_m);
}

static uint64_t take_waves(struct scanhead *sh, const struct scanhead_frame *frame, const struct points *points)
{
    static struct scanhead_wave wave[MOST];
    uint64_t matched = 0;
    const int n = scanhead_waves(sh, frame, 0, wave, MOST);
    assert_true(n >= 0);
    for (int i = 0; i < n; i++)
        for (uint32_t k = 0; k < points->n; k++) {
            if (points->pulse[k] != wave[i].pulse || points->point[k].echo == 0) continue;
            expect_beam(&wave[i], &points->point[k]);
            matched++;
        }
    return matched;
}

static void test_beams(void **state)
{
    struct wire *wire = *state;
    static struct points points;
    struct scanhead_frame frame;
    uint64_t echoes = 0, matched = 0;
    char config[352], path[352];
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &SCAN));
    snprintf(path, sizeof path, "%s", wire_path(wire, "waves.shs"));
    const char *const args[] = {"record", config, "-o", path, "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
    struct scanhead *sh = client_open(path);
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        if (frame.type == SCANHEAD_POINTS) take_points(sh, &frame, &points);
        if (frame.type == SCANHEAD_POINTS)
            for (uint32_t i = 0; i < points.n; i++)
                echoes += points.point[i].echo != 0;
        if (frame.type == SCANHEAD_WAVES) matched += take_waves(sh, &frame, &points);
    }
    assert_true(echoes > 1000);
    assert_int_equal(matched, echoes); /* one window a pulse here: walls without edges in depth */
    scanhead_close(sh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_beams, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
