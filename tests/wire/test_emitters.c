/* SPDX-License-Identifier: MIT */
/* Heads that are no line heads, through the real program. Each shot's time, direction and range are compared with the
 * formulas of their data sheets (emitter_rig.c) and the known walls of a room. */
#include "tests/wire/emitter_rig.h"
#include "tests/wire/room.h"

enum { MAX_POINTS = 4096 };

struct model {
    const char *profile;
    double prr_hz, lines_hz;
    unsigned frames;
    void (*shot)(uint64_t k, struct shot *out);
    struct scanhead_emitter emitter; /* as the stream is to say it */
    uint64_t cast;                   /* of the scan */
    double reach_m;                  /* 0: beyond the room */
    int geo;
};

/* ---- comparing */

static void check_emitter(const struct model *m, const struct scanhead *sh)
{
    static struct scanhead_emitter e;
    const struct scanhead_emitter *want = &m->emitter;
    assert_int_equal(scanhead_get_emitter(sh, &e), SCANHEAD_OK);
    assert_int_equal(e.kind, want->kind);
    assert_int_equal(e.steps, want->steps);
    assert_int_equal(e.first_step, want->first_step);
    assert_int_equal(e.last_step, want->last_step);
    assert_int_equal(e.front_step, want->front_step);
    assert_int_equal(e.turn, want->turn);
    assert_int_equal(e.rings, want->rings);
    assert_int_equal(e.n_beams, want->n_beams);
    assert_int_equal(e.sequence_ns_num, want->sequence_ns_num);
    assert_int_equal(e.sequence_ns_den, want->sequence_ns_den);
    assert_int_equal(e.echoes, 0);
    for (uint32_t i = 0; i < e.n_beams; i++) {
        assert_true(fabs(e.beam[i].elevation_deg - vlp_deg[i]) < 1e-9);
        assert_true(e.beam[i].azimuth_deg == 0);
        assert_int_equal(e.beam[i].offset_ns, 2304 * i);
    }
}

/* The room is at most 11 m long. So half a count of the angle moves the range by less than 11 m x 1e-9 rad over the
 * sine of the incidence. The range's own count is 1e-6 m. */
static void check_range(const struct model *m, const struct scanhead_point *p, const struct shot *s, uint64_t k)
{
    struct room_ray ray, near;
    const double mirror_rad = s->elevation_deg * M_PI / 180, pan_rad = s->azimuth_deg * M_PI / 180;
    double slack_m = 0.51e-6;
    room_cast(mirror_rad, pan_rad, &ray);
    if (fabs(ray.range_m - m->reach_m) < 1e-6) return;
    const int seen = m->reach_m == 0 || ray.range_m < m->reach_m;
    assert_int_equal(p->echo_count, seen);
    if (!seen) return;
    for (int i = 0; i < 4; i++) {
        room_cast(mirror_rad + (i & 1 ? ANGLE_RAD : -ANGLE_RAD), pan_rad + (i & 2 ? ANGLE_RAD : -ANGLE_RAD), &near);
        slack_m = fmax(slack_m, 0.51e-6 + fabs(near.range_m - ray.range_m));
        if (near.wall != ray.wall) return; /* an edge: either wall will do */
    }
    if (fabs(p->range_m - ray.range_m) > slack_m)
        fail_msg("pulse %" PRIu64 ": range %.9f m, expected %.9f", k, p->range_m, ray.range_m);
}

/* In the geo layout a point is where the ray ends, in the scene's frame. A range good to slack_m, and an angle to
 * ANGLE_RAD at 11 m, move it by less than that and a count of 1e-6 m. */
static void check_place(const struct scanhead_point *p, const struct shot *s, uint64_t k)
{
    const double mirror_rad = s->elevation_deg * M_PI / 180, pan_rad = s->azimuth_deg * M_PI / 180;
    const double turn = pan_rad + HEADING_DEG * M_PI / 180, xyz[3] = {p->x, p->y, p->z};
    const double dir[3] = {cos(mirror_rad) * sin(turn), cos(mirror_rad) * cos(turn), sin(mirror_rad)};
    struct room_ray ray;
    room_cast(mirror_rad, pan_rad, &ray);
    for (int i = 0; i < 3; i++)
        if (fabs(xyz[i] - STATION[i] - ray.range_m * dir[i]) > 0.6e-6)
            fail_msg("pulse %" PRIu64 ": %.7f along axis %d, expected %.7f", k, xyz[i], i,
                     STATION[i] + ray.range_m * dir[i]);
}

static void check_shot(const struct model *m, const struct scanhead_point *p, uint64_t k)
{
    struct shot s;
    m->shot(k, &s);
    if (m->geo) {
        assert_true(s.cast && p->t_ns == s.t_ns);
        check_place(p, &s, k);
        return;
    }
    const double mirror_rad = s.elevation_deg * M_PI / 180, pan_rad = s.azimuth_deg * M_PI / 180;
    assert_true(s.cast);
    assert_int_equal(p->t_ns, s.t_ns);
    if (fabs(p->mirror_rad - mirror_rad) > ANGLE_RAD || fabs(remainder(p->pan_rad - pan_rad, 2 * M_PI)) > ANGLE_RAD)
        fail_msg("pulse %" PRIu64 ": %.9f %.9f deg, expected %.9f %.9f", k, p->mirror_rad * 180 / M_PI,
                 p->pan_rad * 180 / M_PI, s.elevation_deg, s.azimuth_deg);
    check_range(m, p, &s, k);
}

struct seen {
    uint64_t next, cast, lines, emitters, descriptors;
};

static void check_points(const struct model *m, struct scanhead *sh, const struct scanhead_frame *frame,
                         struct seen *seen)
{
    static struct scanhead_point point[MAX_POINTS];
    struct shot s;
    for (m->shot(seen->next, &s); !s.cast; m->shot(++seen->next, &s))
        ;
    assert_int_equal(frame->pulse0, seen->next);
    assert_int_equal(scanhead_points(sh, frame, 0, point, MAX_POINTS), frame->n_points);
    assert_int_equal(frame->n_points, frame->n_pulses);
    assert_int_equal(frame->scan_line, seen->lines);
    for (uint32_t i = 0; i < frame->n_points; i++)
        check_shot(m, &point[i], frame->pulse0 + i);
    seen->next += frame->n_pulses;
    seen->cast += frame->n_pulses;
}

static void check_recording(const struct model *m, const char *path)
{
    struct scanhead *sh = client_open(path);
    struct scanhead_frame frame;
    struct seen seen = {0};
    int last = 0;
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        if (frame.type == SCANHEAD_EMITTER) check_emitter(m, sh);
        if (frame.type == SCANHEAD_EMITTER) assert_int_equal(last, SCANHEAD_DESCRIPTOR);
        if (frame.type == SCANHEAD_ANCHOR) assert_int_equal(last, SCANHEAD_EMITTER);
        if (frame.type == SCANHEAD_POINTS) check_points(m, sh, &frame, &seen);
        seen.lines += frame.type == SCANHEAD_LINE_END;
        last = frame.type;
    }
    assert_int_equal(seen.cast, m->cast);
    scanhead_close(sh);
}

static void record(struct wire *wire, const struct model *m)
{
    const struct room_config c = {.profile = m->profile,
                                  .prr_hz = m->prr_hz,
                                  .lines_hz = m->lines_hz,
                                  .frames = m->frames,
                                  .links = "links: []\n",
                                  .more = m->geo ? "output: {scale_m: 1e-6, crs: local, layout: geo}\n"
                                                 : "output: {scale_m: 1e-6}\n"};
    room_write(wire);
    const char *config = room_config_write(wire, &c);
    const char *const args[] = {"record", config, "-o", wire_path(wire, "out.shs"), "--quiet", NULL};
    wire_run(wire, args, 0);
    check_recording(m, wire_path(wire, "out.shs"));
    unlink(wire_path(wire, "out.shs"));
}

/* ---- heads */

#define PLANAR(n, first, last, front)                                                                       \
    {                                                                                                       \
        .kind = SCANHEAD_EMIT_PLANAR, .steps = (n), .first_step = (first), .last_step = (last), .turn = -1, \
        .front_step = (front)                                                                               \
    }

static void planar_heads(void **state)
{
    struct model utm = {"hokuyo-utm-30lx", 57600, 40, 20, shot_utm, PLANAR(1440, 0, 1080, 540), 20 * 1081, 0, 0};
    struct model ust = utm;
    struct model urg = {"hokuyo-urg-04lx", 10240, 10, 15, shot_urg, PLANAR(1024, 44, 725, 384), 15 * 682, 5.6, 0};
    struct model tim = {"sick-tim571", 16200, 15, 10, shot_tim, PLANAR(1080, 0, 810, 405), 10 * 811, 0, 0};
    ust.profile = "hokuyo-ust-20lx";
    /* A pulse lasts 1e9 / rate nanoseconds. */
    utm.emitter.sequence_ns_num = ust.emitter.sequence_ns_num = 156250;
    utm.emitter.sequence_ns_den = ust.emitter.sequence_ns_den = 9;
    urg.emitter.sequence_ns_num = 390625;
    urg.emitter.sequence_ns_den = 4;
    tim.emitter.sequence_ns_num = 5000000;
    tim.emitter.sequence_ns_den = 81;
    record(*state, &utm);
    utm.geo = 1;
    record(*state, &utm);
    record(*state, &ust);
    record(*state, &urg);
    record(*state, &tim);
}

static void spinning_beams(void **state)
{
    /* Three turns of 100 ms: 5425 sequences of 55.296 us begin in 300 ms, and the last of them has 6 firings. */
    struct model vlp = {.profile = "velodyne-vlp16",
                        .prr_hz = 289351.851852,
                        .lines_hz = 10,
                        .frames = 3,
                        .shot = shot_vlp,
                        .emitter = {.kind = SCANHEAD_EMIT_BEAMS,
                                    .turn = 1,
                                    .n_beams = VLP_BEAMS,
                                    .sequence_ns_num = 55296,
                                    .sequence_ns_den = 1}};
    for (struct shot s = {0}; s.t_ns < 300000000; vlp.shot(++vlp.cast, &s))
        ;
    record(*state, &vlp);
    vlp.geo = 1;
    record(*state, &vlp);
}

static void spheres(void **state)
{
    const struct model sphere = {"own.yaml",
                                 720,
                                 20,
                                 2,
                                 shot_sphere,
                                 {.kind = SCANHEAD_EMIT_SPHERE,
                                  .steps = 36,
                                  .last_step = 35,
                                  .turn = 1,
                                  .rings = 19,
                                  .sequence_ns_num = 12500000,
                                  .sequence_ns_den = 9},
                                 2 * (17 * 36 + 2),
                                 0,
                                 0};
    emitter_write_profile(*state, "emitter: sphere\nstep_deg: {value: 10, from: assumed}\n");
    record(*state, &sphere);
}

static void lists_of_directions(void **state)
{
    const struct model list = {"own.yaml",
                               50,
                               10,
                               4,
                               shot_list,
                               {.kind = SCANHEAD_EMIT_DIRECTIONS,
                                .steps = 5,
                                .last_step = 4,
                                .turn = 1,
                                .sequence_ns_num = 20000000,
                                .sequence_ns_den = 1},
                               20,
                               0,
                               0};
    emitter_write_profile(*state, "emitter: directions\ndirections: list.txt\n");
    wire_write_text(*state, "list.txt", "# azimuth, elevation\n0 0\n90 0 # right\n\n-150 12.5\n300 -60\n45 89\n");
    record(*state, &list);
    char xyz[1024];
    for (size_t i = 0, n = 0; i < 5; i++) { /* of any length */
        const double azimuth_rad = list_deg[i][0] * M_PI / 180, elevation_rad = list_deg[i][1] * M_PI / 180;
        const double length = 0.1 + (double)i, flat = length * cos(elevation_rad);
        n += (size_t)snprintf(xyz + n, sizeof xyz - n, "%.17g %.17g %.17g\n", flat * sin(azimuth_rad),
                              flat * cos(azimuth_rad), length * sin(elevation_rad));
    }
    wire_write_text(*state, "list.txt", xyz);
    record(*state, &list);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(planar_heads, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(spinning_beams, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(spheres, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(lists_of_directions, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
