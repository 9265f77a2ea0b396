/* SPDX-License-Identifier: MIT */
/* A whole scan through the real program, over a pty and over TCP, compared with geometry and exact arithmetic. */
#include "tests/wire/room.h"

#include "drivers/protocol/native.h"

enum { MAX_POINTS = 4096 };

/* The encoders give the angles to half a count. So the range of a point is only known within the change that half a
 * count either way makes. Where one wall is met the range is monotonic over that square of 6e-6 rad (its curvature, R *
 * 1e-11, is below SLACK_M), so the corners bound it. Where walls meet, the nearest wall is the least of several such
 * ranges. Half a range count and the roundings of the doubles, SLACK_M, are added. */
static const double SLACK_M = 1e-9;

static void bounds(const struct scanhead_point *p, double half_mirror_rad, double half_pan_rad, double *lo, double *hi,
                   int possible[6])
{
    double most[6] = {0};
    *lo = INFINITY;
    memset(possible, 0, 6 * sizeof possible[0]);
    for (int corner = 0; corner < 4; corner++) {
        struct room_ray ray;
        room_cast(p->mirror_rad + (corner & 1 ? half_mirror_rad : -half_mirror_rad),
                  p->pan_rad + (corner & 2 ? half_pan_rad : -half_pan_rad), &ray);
        if (ray.range_m < *lo) *lo = ray.range_m;
        possible[ray.wall] = 1;
        for (int w = 0; w < 6; w++)
            if (ray.plane_m[w] > most[w]) most[w] = ray.plane_m[w];
    }
    *hi = INFINITY;
    for (int w = 0; w < 6; w++)
        if (most[w] < *hi) *hi = most[w];
}

struct check {
    struct oracle oracle;
    int ground; /* open ground instead of the room */
    double half_mirror_rad, half_pan_rad, scale_m;
    uint64_t next; /* pulse expected next */
    uint64_t line, line_echoes, echoes, empty, lines;
    int64_t scan_t0_ns;
    int wall_of_label[8];
    int n_labels;
};

static void check_room_point(struct check *c, const struct scanhead_point *p, uint64_t k)
{
    double lo, hi;
    int possible[6];
    assert_int_equal(p->echo, 1);
    assert_int_equal(p->echo_count, 1);
    bounds(p, c->half_mirror_rad, c->half_pan_rad, &lo, &hi, possible);
    if (p->range_m < lo - 0.5 * c->scale_m - SLACK_M || p->range_m > hi + 0.5 * c->scale_m + SLACK_M)
        fail_msg("pulse %" PRIu64 ": range %.9f, expected %.9f to %.9f", k, p->range_m, lo, hi);
    assert_true(p->label < c->n_labels);
    if (!possible[c->wall_of_label[p->label]])
        fail_msg("pulse %" PRIu64 ": label %u is %s", k, p->label, WALLS[c->wall_of_label[p->label]]);
}

/* The ground has an echo where the ray goes down and its range is below 800 m. Near the angle at which it is 800 m,
 * within two mirror counts, either result is right, and nothing is compared. */
static void check_ground_point(struct check *c, const struct scanhead_point *p, uint64_t k)
{
    double below = STATION[2] + 1.7;
    double steep = asin(below / 800.0), down = -oracle_mirror_deg(&c->oracle, k) * M_PI / 180.0;
    if (fabs(down - steep) < 4.0 * c->half_mirror_rad) return;
    assert_int_equal(p->echo_count, down > steep);
    if (p->echo_count == 0) {
        assert_true(isnan(p->range_m) && isnan(p->x) && p->label == SCANHEAD_NO_LABEL);
        return;
    }
    double near = below / sin(down + 2.0 * c->half_mirror_rad), far = below / sin(down - 2.0 * c->half_mirror_rad);
    assert_true(p->range_m >= near - c->scale_m && p->range_m <= far + c->scale_m);
    assert_int_equal(p->label, 0);
}

/* An angle on the wire is the exact one to half a count; 1e-9 rad are the roundings of doubles on both sides.
 */
static void check_angles(const struct check *c, const struct scanhead_point *p, uint64_t k)
{
    double mirror = oracle_mirror_deg(&c->oracle, k) * M_PI / 180.0, pan = oracle_pan_deg(&c->oracle, k) * M_PI / 180.0;
    assert_true(fabs(p->mirror_rad - mirror) <= c->half_mirror_rad + 1e-9);
    assert_true(fabs(remainder(p->pan_rad - pan, 2.0 * M_PI)) <= c->half_pan_rad + 1e-9);
}

static void skip_blind(struct check *c, uint64_t end)
{
    while (c->next < end && !oracle_is_cast(&c->oracle, c->next))
        c->next++;
}

static void check_points(struct check *c, struct scanhead *sh, const struct scanhead_frame *frame)
{
    static struct scanhead_point point[MAX_POINTS];
    const struct oracle *o = &c->oracle;
    int n = scanhead_points(sh, frame, 0, point, MAX_POINTS);
    skip_blind(c, frame->pulse0);
    assert_int_equal(frame->pulse0, c->next);
    assert_int_equal(frame->n_pulses, frame->n_points); /* one echo or one empty shot each */
    assert_int_equal(n, frame->n_points);
    assert_int_equal(frame->scan_line, oracle_line(o, frame->pulse0));
    assert_int_equal(frame->scan_line, c->line);
    assert_int_equal(frame->scan_frame, frame->scan_line / oracle_frame_lines(o));
    assert_int_equal(frame->scan_t0_ns, oracle_time_ns(o, frame->pulse0));
    assert_int_equal(frame->line_t0_ns, oracle_time_ns(o, oracle_first_pulse(o, frame->scan_line)));
    assert_int_equal(frame->t_ns, c->scan_t0_ns + frame->scan_t0_ns);
    for (int i = 0; i < n; i++) {
        uint64_t k = c->next + (uint64_t)i;
        assert_true(oracle_is_cast(o, k));
        assert_int_equal(point[i].t_ns, oracle_time_ns(o, k));
        assert_true(isnan(point[i].reflectance_db));
        check_angles(c, &point[i], k);
        if (c->ground)
            check_ground_point(c, &point[i], k);
        else
            check_room_point(c, &point[i], k);
        int echo = point[i].echo_count != 0;
        c->line_echoes += (uint64_t)echo;
        c->echoes += (uint64_t)echo;
        c->empty += (uint64_t)!echo;
    }
    c->next += (uint64_t)n;
    assert_int_equal(oracle_line(o, c->next - 1), c->line);
}

static void check_line_end(struct check *c, const struct scanhead_frame *frame)
{
    const struct oracle *o = &c->oracle;
    struct line_end end;
    uint64_t lines = oracle_frame_lines(o);
    assert_int_equal(native_decode_line_end(frame->payload, frame->payload_len, &end), 0);
    uint64_t first = oracle_first_pulse(o, c->line), next = oracle_first_pulse(o, c->line + 1);
    skip_blind(c, next);
    assert_int_equal(c->next, next); /* every cast pulse of the line has come */
    assert_int_equal(end.line, c->line);
    assert_int_equal(end.frame, c->line / lines);
    assert_int_equal(end.pulse0, first);
    assert_int_equal(end.n_fired, next - first);
    assert_int_equal(end.n_cast, oracle_count_cast(o, first, next));
    assert_int_equal(end.n_echoes, c->line_echoes);
    assert_int_equal(end.t0_ns, oracle_time_ns(o, first));
    assert_int_equal(end.t1_ns, oracle_time_ns(o, next));
    assert_int_equal(end.status, (c->line + 1) % lines == 0); /* last of a frame */
    c->line_echoes = 0;
    c->line++;
    c->lines++;
}

static void check_descriptor(struct check *c, const struct scanhead_frame *frame)
{
    struct native_descriptor d;
    assert_int_equal(native_decode_descriptor(frame->payload, frame->payload_len, &d), 0);
    assert_int_equal(d.prr_uhz, c->oracle.prr_uhz);
    assert_int_equal(d.lines_uhz, c->oracle.lines_uhz);
    assert_int_equal(d.pan_udeg_s, c->oracle.pan_udeg_s);
    assert_int_equal(d.line_start_udeg, c->oracle.start_udeg);
    assert_int_equal(d.line_stop_udeg, c->oracle.stop_udeg);
    assert_int_equal(d.n_surfaces, c->ground ? 1 : 6);
    c->half_mirror_rad = M_PI / d.mirror_counts_per_turn;
    c->half_pan_rad = M_PI / d.pan_counts_per_turn;
    c->scale_m = d.range_scale_m;
    assert_true(c->scale_m > 0.0 && c->scale_m <= 1e-6); /* 800 m in 31 bits leave a micrometre */
}

/* The names come as frames of their own, and give the meaning of a label. */
static void check_surfaces(struct check *c, struct scanhead *sh)
{
    const char *object, *material;
    for (c->n_labels = 0; scanhead_surface(sh, (uint32_t)c->n_labels, &object, &material); c->n_labels++) {
        int w = 0;
        while (w < 6 && strcmp(object, WALLS[w]) != 0)
            w++;
        if (c->ground) continue;
        assert_true(w < 6);
        assert_string_equal(material + strlen("paint-"), WALLS[w]);
        c->wall_of_label[c->n_labels] = w;
    }
    assert_int_equal(c->n_labels, c->ground ? 1 : 6);
}

static void take(struct check *c, struct scanhead *sh, struct scanhead_frame *frame)
{
    if (frame->type == SCANHEAD_DESCRIPTOR) check_descriptor(c, frame);
    if (frame->type == SCANHEAD_SURFACES) check_surfaces(c, sh);
    if (frame->type == SCANHEAD_POINTS) check_points(c, sh, frame);
    if (frame->type == SCANHEAD_LINE_END) check_line_end(c, frame);
    if (is_event(frame, SCANHEAD_EV_SCAN_START)) c->scan_t0_ns = (int64_t)frame->event_value[1];
}

/* One scan by command, with every frame checked; then the statistics of both sides. */
static void scan(struct wire *wire, const struct room_config *config, struct check *c, const char *link,
                 const char *pace)
{
    const char *const more[] = {"--pace", pace, "--set", "loop.queue_ms=10000", "--set", "loop.late_ms=10000", NULL};
    struct head head = head_start(wire, room_config_write(wire, config), more);
    struct scanhead *sh = client_open(head_endpoint(&head, link));
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    do {
        client_next(sh, &frame);
        take(c, sh, &frame);
    } while (!is_event(&frame, SCANHEAD_EV_SCAN_END));
    uint64_t end = oracle_end(&c->oracle);
    assert_int_equal(frame.event_value[1], end);
    assert_int_equal(frame.event_value[2], 0);
    assert_int_equal(c->lines, config->frames * oracle_frame_lines(&c->oracle));
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.bad_payload + stats.bad_bytes + stats.seq_lost + stats.dropped, 0);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    uint64_t cast = oracle_count_cast(&c->oracle, 0, end);
    assert_int_equal(c->echoes + c->empty, cast);
    assert_int_equal(stats_uint(wire, "pulses"), cast);
    assert_int_equal(stats_uint(wire, "fired_pulses"), end);
    assert_int_equal(stats_uint(wire, "echoes"), c->echoes);
    assert_int_equal(stats_uint(wire, "lines"), c->lines);
    assert_int_equal(stats_uint(wire, "lost_pulses"), 0);
}

/* Rates that divide nothing: pulse period and pulses per line are fractions, and lines begin at any phase. The window
 * cuts the line within the profile's 100 of 240 deg. */
static const struct room_config ODD = {.profile = "any-rate",
                                       .prr_hz = 299999.7,
                                       .lines_hz = 101.3,
                                       .pan_deg_s = 149.9,
                                       .pan_stop_deg = 40.1,
                                       .line_start_deg = -35.5,
                                       .line_stop_deg = 58.25,
                                       .frames = 2};

static void test_room_over_pty(void **state)
{
    struct room_config config = ODD;
    config.links = LINK_YAML_PTY;
    struct check check = {.oracle = oracle_of(&config, -40, 60, 240)};
    room_write(*state);
    scan(*state, &config, &check, "pty", "realtime");
    assert_int_equal(check.empty, 0);
}

static void test_room_over_tcp(void **state)
{
    struct room_config config = {
        .prr_hz = 1200000, .lines_hz = 240, .pan_deg_s = 360, .pan_stop_deg = 360, .frames = 1, .links = LINK_YAML_TCP};
    struct check check = {.oracle = oracle_of(&config, -40, 60, 100)};
    room_write(*state);
    scan(*state, &config, &check, "tcp", "fast");
    assert_int_equal(check.empty, 0);
    assert_int_equal(check.echoes, oracle_end(&check.oracle)); /* a full sweep casts every pulse */
}

static void test_ground_half_empty(void **state)
{
    struct room_config config = ODD;
    config.links = LINK_YAML_PTY;
    struct check check = {.oracle = oracle_of(&config, -40, 60, 240), .ground = 1};
    ground_write(*state);
    scan(*state, &config, &check, "pty", "fast");
    assert_true(check.empty > check.echoes && check.echoes > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_room_over_pty, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_room_over_tcp, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_ground_half_empty, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
