/* SPDX-License-Identifier: MIT */
/* Hits that give no echo are counted, in every line end and in the statistics of head and recorder. */
#include <inttypes.h>

#include "drivers/protocol/native.h"
#include "tests/wire/room.h"

/* This is a profile like full-sweep, but with two echoes a pulse, which sees half a white target at REACH_M. */
static const double REACH_M = 4.0;
static const char PROFILE[] = "maker: scanhead\n"
                              "model: two echoes\n"
                              "prr_min_hz: { value: 1000, from: assumed }\n"
                              "prr_max_hz: { value: 2200000, from: assumed }\n"
                              "lines_min_hz: { value: 4, from: assumed }\n"
                              "lines_max_hz: { value: 1000, from: assumed }\n"
                              "pan_max_deg_s: { value: 360, from: assumed }\n"
                              "fov_min_deg: { value: -40, from: assumed }\n"
                              "fov_max_deg: { value: 60, from: assumed }\n"
                              "pan_min_deg: { value: 0, from: assumed }\n"
                              "pan_max_deg: { value: 360, from: assumed }\n"
                              "facets: { value: 36, from: assumed }\n"
                              "optical_gain: { value: 10, from: assumed }\n"
                              "range_min_m: { value: 0.1, from: assumed }\n"
                              "range_max_m: { value: 1000, from: assumed }\n"
                              "range_sigma_m: { value: 0.003, from: assumed }\n"
                              "range_sigma_ppm: { value: 0, from: assumed }\n"
                              "reaches: [{ reflectance: 0.5, range_m: 4, from: assumed }]\n"
                              "mirror_counts: { value: 0, from: assumed }\n"
                              "pan_counts: { value: 0, from: assumed }\n"
                              "beam_exit_m: { value: 0.007, from: assumed }\n"
                              "beam_divergence_rad: { value: 0.00035, from: assumed }\n"
                              "pulse_width_ns: { value: 1, from: assumed }\n" /* 0.15 m */
                              "max_echoes: { value: 2, from: assumed }\n"
                              "boot_s: { value: 0.01, from: assumed }\n"
                              "spin_up_s: { value: 0.01, from: assumed }\n"
                              "spin_down_s: { value: 0.01, from: assumed }\n";

static const struct room_config SCAN = {.profile = "two-echoes.yaml",
                                        .prr_hz = 99999.7,
                                        .lines_hz = 97.7,
                                        .pan_deg_s = 150,
                                        .pan_stop_deg = 60,
                                        .frames = 1,
                                        .links = LINK_YAML_TCP};

/* The room, and two closed boxes of glass around the station. Each ray from there meets both, then a wall, each 0.5 m
 * or more behind the one before. */
static void panes_write(const struct wire *wire)
{
    static const int quad[6][4] = {{1, 3, 7, 5}, {2, 6, 8, 4}, {1, 5, 6, 2}, {3, 4, 8, 7}, {1, 2, 4, 3}, {5, 7, 8, 6}};
    room_write(wire);
    FILE *f = fopen(wire_path(wire, "room.obj"), "a");
    assert_non_null(f);
    for (int box = 1; box <= 2; box++) {
        double half = 0.6 * box;
        for (int i = 0; i < 8; i++)
            fprintf(f, "v %.17g %.17g %.17g\n", STATION[0] + (i & 1 ? half : -half),
                    STATION[1] + (i & 2 ? half : -half), STATION[2] + (i & 4 ? half : -half));
        fprintf(f, "o pane-%d\nusemtl glass\n", box);
        for (int w = 0; w < 6; w++)
            fprintf(f, "f %d %d %d %d\n", 8 * box + quad[w][0], 8 * box + quad[w][1], 8 * box + quad[w][2],
                    8 * box + quad[w][3]);
    }
    assert_int_equal(fclose(f), 0);
}

/* Sums over a scan's line ends. */
struct sums {
    uint64_t lines, cast, echoes, crowded, faint, unfit;
};

typedef void check_fn(const struct line_end *end, const struct oracle *oracle);

static void take_lines(struct scanhead *sh, const struct oracle *oracle, check_fn *check, struct sums *sums)
{
    struct scanhead_frame frame;
    do {
        struct line_end end;
        client_next(sh, &frame);
        if (frame.type != SCANHEAD_LINE_END) continue;
        assert_int_equal(native_decode_line_end(frame.payload, frame.payload_len, &end), 0);
        check(&end, oracle);
        sums->lines++;
        sums->cast += end.n_cast;
        sums->echoes += end.n_echoes;
        sums->crowded += end.n_crowded;
        sums->faint += end.n_faint;
        sums->unfit += end.n_unfit;
    } while (!is_event(&frame, SCANHEAD_EV_SCAN_END));
}

static void expect_stats(const struct wire *wire, const struct sums *sums)
{
    assert_int_equal(stats_uint(wire, "crowded_echoes"), sums->crowded);
    assert_int_equal(stats_uint(wire, "faint_hits"), sums->faint);
    assert_int_equal(stats_uint(wire, "unfit_echoes"), sums->unfit);
    assert_int_equal(stats_uint(wire, "lost_pulses"), 0);
}

/* Scans by a head with several threads, whose blocks end within lines. */
static void scan_live(struct wire *wire, const char *noise, const char *more, check_fn *check, struct sums *sums)
{
    struct room_config config = SCAN;
    char path[352];
    config.noise = noise;
    config.more = more;
    wire_write_text(wire, "two-echoes.yaml", PROFILE);
    snprintf(path, sizeof path, "%s", room_config_write(wire, &config));
    struct oracle oracle = oracle_of(&config, -40, 60, 100);
    struct head head = head_start(wire, path, (const char *const[]){"--pace", "fast", "--threads", "3", NULL});
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    memset(sums, 0, sizeof *sums);
    take_lines(sh, &oracle, check, sums);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    assert_int_equal(sums->cast, oracle_count_cast(&oracle, 0, oracle_end(&oracle)));
    assert_int_equal(sums->lines, oracle_frame_lines(&oracle));
    expect_stats(wire, sums);
}

static void record_it(struct wire *wire)
{
    char path[352], stats[352];
    snprintf(path, sizeof path, "%s", wire_path(wire, "config.yaml"));
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    const char *const args[] = {"record", path, "--stats", stats, "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "head.out", "head.err", -1)), 0);
}

/* The head scans, and then `record` does. */
static void scan(struct wire *wire, const char *noise, const char *more, check_fn *check, struct sums *sums)
{
    scan_live(wire, noise, more, check, sums);
    record_it(wire);
    expect_stats(wire, sums);
}

/* Every pulse has three returns, and two of them are sent. */
static void three_for_two(const struct line_end *end, const struct oracle *oracle)
{
    (void)oracle;
    assert_int_equal(end->n_echoes, 2 * end->n_cast);
    assert_int_equal(end->n_crowded, end->n_cast);
    assert_int_equal(end->n_faint + end->n_unfit, 0);
}

static void test_echoes_left_out(void **state)
{
    struct sums sums;
    panes_write(*state);
    scan(*state, NULL,
         "beam: {mode: single}\noptics: {depth: 2}\nsurfaces: [{material: glass, glass: 0.9, reflectance: 0.1}]\n",
         three_for_two, &sums);
    assert_true(sums.crowded > 10000);
}

/* The range equation: a wall of the reflectance that is just seen at REACH_M is seen where cos i / R^2 >= 1 /
 * REACH_M^2. Within a part in 1e9 of that either result is right. Each hit is an echo or faint. */
static void as_the_range_equation_says(const struct line_end *end, const struct oracle *oracle)
{
    uint32_t faint = 0, unsure = 0;
    for (uint64_t k = end->pulse0; k < end->pulse0 + end->n_fired; k++) {
        struct room_ray ray;
        if (!oracle_is_cast(oracle, k)) continue;
        room_cast(oracle_mirror_deg(oracle, k) * M_PI / 180.0, oracle_pan_deg(oracle, k) * M_PI / 180.0, &ray);
        int axis = ray.wall / 2;
        double across_m = fabs((ray.wall & 1 ? ROOM_MAX : ROOM_MIN)[axis] - STATION[axis]);
        double amplitude = across_m / ray.range_m * REACH_M * REACH_M / (ray.range_m * ray.range_m);
        unsure += fabs(amplitude - 1.0) < 1e-9;
        faint += amplitude < 1.0;
    }
    assert_int_equal(end->n_faint + end->n_echoes, end->n_cast);
    assert_true(end->n_faint + unsure >= faint && end->n_faint <= faint + unsure);
    assert_int_equal(end->n_crowded + end->n_unfit, 0);
}

static void test_hits_too_faint(void **state)
{
    struct sums sums;
    room_write(*state);
    scan(*state, NULL, "signal: {model: on, detection: sharp, reflectance: 0.5}\nbeam: {mode: single}\n",
         as_the_range_equation_says, &sums);
    assert_true(sums.faint > 1000 && sums.echoes > 1000);
}

/* Every pulse has its one echo, and there is nothing else. */
static void nothing_else(const struct line_end *end, const struct oracle *oracle)
{
    (void)oracle;
    assert_int_equal(end->n_echoes, end->n_cast);
    assert_int_equal(end->n_crowded + end->n_faint + end->n_unfit, 0);
}

static void test_a_plain_scan(void **state)
{
    struct sums sums;
    room_write(*state);
    scan(*state, NULL, "beam: {mode: single}\n", nothing_else, &sums);
}

/* A ball that is flattened to a rod along the scene's x axis. The ball is so large that points leave the stream's
 * integers, +-(2^31 - 1) counts of the automatic 1e-6 m from the station. */
static const double BALL_M = 100.0, GROWTH_1_M = 5.0, FARTHEST_M = 2147.483647;

/* Returns the probability that the x of a point in a ball of radius 1, uniform over its volume, is beyond q. The disc
 * at x has the share 3/4 (1 - x^2) of the volume, summed from q to 1. */
static double beyond(double q)
{
    return q >= 1.0 ? 0.0 : 0.5 - 0.75 * q + 0.25 * q * q * q;
}

/* The expected number of lost echoes of a scan, and its variance. */
static double unfit_mean, unfit_variance;

static void as_the_ball_says(const struct line_end *end, const struct oracle *oracle)
{
    for (uint64_t k = end->pulse0; k < end->pulse0 + end->n_fired; k++) {
        struct room_ray ray;
        if (!oracle_is_cast(oracle, k)) continue;
        double mirror = oracle_mirror_deg(oracle, k) * M_PI / 180.0, pan = oracle_pan_deg(oracle, k) * M_PI / 180.0;
        room_cast(mirror, pan, &ray);
        double x = ray.range_m * cos(mirror) * sin(pan + HEADING_DEG * M_PI / 180.0);
        double radius_m = BALL_M * (1.0 + GROWTH_1_M * ray.range_m);
        double share = beyond((FARTHEST_M - x) / radius_m) + beyond((FARTHEST_M + x) / radius_m);
        unfit_mean += share;
        unfit_variance += share * (1.0 - share);
    }
    assert_int_equal(end->n_echoes + end->n_unfit, end->n_cast); /* none is anything else */
    assert_int_equal(end->n_crowded + end->n_faint, 0);
}

static void test_positions_beyond_the_integers(void **state)
{
    struct sums sums;
    room_write(*state);
    unfit_mean = unfit_variance = 0.0;
    scan(*state, ", ball: {radius_m: 100, distance_1_m: 5, factor: [1, 0, 0]}",
         "beam: {mode: single}\noutput: {layout: geo}\n", as_the_ball_says, &sums);
    assert_true(unfit_mean > 1000.0);
    /* five sigma: by chance once in 1.7 million seeds */
    assert_true(fabs((double)sums.unfit - unfit_mean) < 5.0 * sqrt(unfit_variance));
    char *said = wire_read(wire_path(*state, "head.err"), NULL), want[96];
    snprintf(want, sizeof want, "%" PRIu64 " echoes left out, too far from the anchor", sums.unfit);
    assert_non_null(strstr(said, want));
    free(said);
}

/* Two panes of glass, upright and 2 degrees wide as seen from the station, in the middle of the scan's 60 degrees of
 * pan. There is nothing else. */
static void two_panes_write(const struct wire *wire)
{
    const double turn = (30.0 + HEADING_DEG) * M_PI / 180.0, half = tan(M_PI / 180.0);
    FILE *f = fopen(wire_path(wire, "room.obj"), "w");
    assert_non_null(f);
    fprintf(f, "usemtl glass\n");
    for (int far_m = 1; far_m <= 2; far_m++)
        for (int i = 0; i < 4; i++) {
            const double side = i == 1 || i == 2 ? half : -half, up = i >= 2 ? 2.0 : -1.0;
            fprintf(f, "v %.17g %.17g %.17g\n", STATION[0] + far_m * (sin(turn) + side * cos(turn)),
                    STATION[1] + far_m * (cos(turn) - side * sin(turn)), STATION[2] + far_m * up);
        }
    fprintf(f, "f 1 2 3 4\nf 5 6 7 8\n");
    assert_int_equal(fclose(f), 0);
}

static void with_two_or_none(const struct line_end *end, const struct oracle *oracle)
{
    (void)oracle;
    assert_int_equal(end->n_echoes % 2, 0);
}

static void expect_mostly_empty(struct wire *wire, const struct sums *sums)
{
    char *said = wire_read(wire_path(wire, "head.err"), NULL), want[96];
    snprintf(want, sizeof want, "mostly empty: %" PRIu64 " of %" PRIu64 " pulses have an echo", sums->echoes / 2,
             sums->cast);
    if (strstr(said, want) == NULL) fail_msg("no \"%s\" in: %s", want, said);
    free(said);
}

/* One pulse in thirty has two echoes: more than one echo for twenty pulses. The warning counts pulses. */
static void test_a_pulse_with_two_echoes_is_one_pulse(void **state)
{
    struct sums sums;
    two_panes_write(*state);
    scan_live(*state, NULL,
              "beam: {mode: single}\noptics: {depth: 2}\nsurfaces: [{material: glass, glass: 0.9, reflectance: 0.1}]\n",
              with_two_or_none, &sums);
    assert_true(20 * sums.echoes > sums.cast && 10 * sums.echoes < sums.cast);
    expect_mostly_empty(*state, &sums);
    record_it(*state);
    expect_mostly_empty(*state, &sums);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_echoes_left_out, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_hits_too_faint, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_positions_beyond_the_integers, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_pulse_with_two_echoes_is_one_pulse, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_plain_scan, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
