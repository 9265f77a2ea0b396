/* SPDX-License-Identifier: MIT */
/* `loop.tick_hz` cuts the stream into other frames, so that its hash differs. The points in them are the same. */
#include "drivers/protocol/native.h"
#include "tests/wire/room.h"

enum { POINTS_MAX = 200000, LINES_MAX = 200 };

static const struct room_config SCAN = {.profile = "any-rate",
                                        .prr_hz = 123456.7,
                                        .lines_hz = 97.7,
                                        .pan_deg_s = 150,
                                        .pan_stop_deg = 45,
                                        .frames = 1,
                                        .links = LINK_YAML_TCP};

/* A decoded scan, and the frames that it was cut into. */
struct scan {
    struct scanhead_point *point;
    uint32_t n_points, n_lines, n_frames;
    uint64_t pulses, n_echoes, n_several;
    struct line_end line[LINES_MAX];
    char hash[65];
};

/* The room, and slats in it across the lines, not quite level, each at another distance. Footprints overlap their
 * edges. */
static void slats_write(const struct wire *wire)
{
    room_write(wire);
    FILE *f = fopen(wire_path(wire, "room.obj"), "a");
    assert_non_null(f);
    fprintf(f, "o slats\nusemtl steel\n");
    for (int i = 0; i < 60; i++) {
        double left = STATION[0] - 0.5, right = STATION[0] + 5, y = STATION[1] + 1.1 + 0.7 * (i % 3),
               z = -1.5 + 0.07 * i;
        fprintf(f,
                "v %.17g %.17g %.17g\nv %.17g %.17g %.17g\nv %.17g %.17g %.17g\nv %.17g %.17g %.17g\nf -4 -3 -2 -1\n",
                left, y, z, right, y, z + 0.05, right, y, z + 0.08, left, y, z + 0.03);
    }
    assert_int_equal(fclose(f), 0);
}

/* The head goes along an arc in the room, and rises and turns. */
static void ride_write(const struct wire *wire)
{
    FILE *f = fopen(wire_path(wire, "ride.csv"), "w");
    assert_non_null(f);
    fprintf(f, "t_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg\n");
    for (int i = 0; i <= 100; i++)
        fprintf(f, "%.17g,%.17g,%.17g,%.17g,%d,%d,%d\n", 0.01 * i, 0.6 + 1.7 * cos(0.02 * i),
                -1.1 + 1.7 * sin(0.02 * i), 0.1 + 0.01 * i, i % 7, i % 5, i);
    assert_int_equal(fclose(f), 0);
}

static void take(struct scanhead *sh, const struct scanhead_frame *frame, struct scan *scan)
{
    if (frame->type == SCANHEAD_LINE_END) {
        assert_true(scan->n_lines < LINES_MAX);
        assert_int_equal(native_decode_line_end(frame->payload, frame->payload_len, &scan->line[scan->n_lines++]), 0);
    }
    if (frame->type != SCANHEAD_POINTS) return;
    assert_true(scan->n_points + frame->n_points <= POINTS_MAX);
    assert_int_equal(scanhead_points(sh, frame, 0, scan->point + scan->n_points, frame->n_points), frame->n_points);
    scan->n_points += frame->n_points;
    scan->pulses += frame->n_pulses;
    scan->n_frames++;
}

static struct scan *record(struct wire *wire, const char *config, const char *tick, const char *const *more)
{
    struct scan *scan = calloc(1, sizeof *scan);
    assert_non_null(scan);
    scan->point = calloc(POINTS_MAX, sizeof *scan->point);
    assert_non_null(scan->point);
    char path[352];
    snprintf(path, sizeof path, "%s", wire_path(wire, "scan.shs"));
    const char *args[24] = {"record", config, "-o", path, "--quiet", "--set", tick};
    for (int n = 7; more != NULL && *more != NULL; more++) {
        args[n++] = "--set";
        args[n++] = *more;
    }
    wire_run(wire, args, 0);
    struct scanhead *sh = client_open(path);
    struct scanhead_frame frame;
    scanhead_hash_start(sh);
    while (scanhead_next(sh, &frame, DEADLINE_MS) == SCANHEAD_OK)
        take(sh, &frame, scan);
    scanhead_hash_hex(sh, scan->hash);
    scanhead_close(sh);
    for (uint32_t i = 0; i < scan->n_points; i++) {
        scan->n_echoes += scan->point[i].echo != 0;
        scan->n_several += scan->point[i].echo_count > 1;
    }
    return scan;
}

static void scan_free(struct scan *scan)
{
    free(scan->point);
    free(scan);
}

/* Values are equal bit by bit. NaN has to be NaN on both sides. */
static int same_reals(const struct scanhead_point *a, const struct scanhead_point *b)
{
    const double x[] = {a->x, a->y, a->z, a->range_m, a->mirror_rad, a->pan_rad, a->reflectance_db};
    const double y[] = {b->x, b->y, b->z, b->range_m, b->mirror_rad, b->pan_rad, b->reflectance_db};
    return memcmp(x, y, sizeof x) == 0;
}

static void expect_same(const struct scan *a, const struct scan *b)
{
    assert_int_equal(a->n_points, b->n_points);
    assert_int_equal(a->pulses, b->pulses);
    for (uint32_t i = 0; i < a->n_points; i++) {
        const struct scanhead_point *p = &a->point[i], *q = &b->point[i];
        if (!same_reals(p, q) || p->t_ns != q->t_ns || p->echo != q->echo || p->echo_count != q->echo_count ||
            p->label != q->label)
            fail_msg("point %u at %lld ns: range %.9g and %.9g m, echo %u of %u and %u of %u, label %u and %u", i,
                     (long long)p->t_ns, p->range_m, q->range_m, p->echo, p->echo_count, q->echo, q->echo_count,
                     p->label, q->label);
    }
    assert_int_equal(a->n_lines, b->n_lines);
    for (uint32_t i = 0; i < a->n_lines; i++)
        assert_memory_equal(&a->line[i], &b->line[i], sizeof a->line[i]);
}

/* sets: ends with NULL. several: at least so many points are of pulses with secondary echoes. */
static void compare(struct wire *wire, const char *more, const char *const *sets, uint64_t several)
{
    static const char *const ticks[] = {"loop.tick_hz=100", "loop.tick_hz=3125", "loop.tick_hz=10000"};
    struct room_config config = SCAN;
    char path[352];
    config.more = more;
    slats_write(wire);
    ride_write(wire);
    snprintf(path, sizeof path, "%s", room_config_write(wire, &config));
    struct scan *first = record(wire, path, "loop.tick_hz=1000", sets);
    assert_true(first->n_echoes > 10000 && first->n_several >= several);
    for (size_t i = 0; i < sizeof ticks / sizeof ticks[0]; i++) {
        struct scan *other = record(wire, path, ticks[i], sets);
        expect_same(first, other);
        /* the frames differ, else there was nothing to compare */
        assert_int_not_equal(first->n_frames, other->n_frames);
        assert_string_not_equal(first->hash, other->hash);
        scan_free(other);
    }
    scan_free(first);
}

#define NOISE    "noise.range=on", "noise.angle=on", "noise.seed=7"
#define ADAPTIVE "beam: {mode: adaptive}\n"

static void test_plain(void **state)
{
    compare(*state, NULL, (const char *const[]){NULL}, 0);
}

static void test_adaptive_with_noise(void **state)
{
    compare(*state, ADAPTIVE, (const char *const[]){NOISE, NULL}, 1000);
}

static void test_signal_in_geo(void **state)
{
    compare(*state, ADAPTIVE "signal: {model: on}\noutput: {layout: geo}\n",
            (const char *const[]){"noise.range=signal", "noise.angle=on", "noise.ball.radius_m=0.01", NULL}, 1000);
}

static void test_rings_on_the_move(void **state)
{
    compare(*state, "beam: {mode: rings}\nplatform: {kind: trajectory, file: ride.csv, mount_m: [0.1, 0.4, 0.3]}\n",
            (const char *const[]){NOISE, NULL}, 1000);
}

static void test_geo_on_the_move(void **state)
{
    compare(*state, "output: {layout: geo}\nplatform: {kind: trajectory, file: ride.csv, mount_m: [0.1, 0.4, 0.3]}\n",
            (const char *const[]){NOISE, NULL}, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_plain, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_adaptive_with_noise, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_signal_in_geo, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_rings_on_the_move, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_geo_on_the_move, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
