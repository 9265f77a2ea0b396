/* SPDX-License-Identifier: MIT */
/* Instrument errors, each against a closed form of its own, and measured in two faces. */
#include "tests/unit/cast_rig.h"

#include "core/instrument.h"

static const double TURN = 6.283185307179586477;

/* The readings of a head with such errors for targets in all directions around it: mirror angle, pan angle and range.
 * The beam of mirror angle m and pan p meets the inside of a sphere at R(beam). The head's angles are those of its
 * encoders. */
struct shot {
    double s[3], o[3];  /* direction and origin of the beam, socs */
    double mirror, pan; /* read, turns */
};

static struct shot shoot(const struct instrument *k, double mirror_turn, double pan_turn, uint64_t pulse)
{
    struct shot shot = {.mirror = mirror_turn, .pan = pan_turn};
    const struct vec3_out s = {&shot.s[0], &shot.s[1], &shot.s[2]}, o = {&shot.o[0], &shot.o[1], &shot.o[2]};
    instrument_aim(k, &(struct instrument_turns){pulse, 1, &mirror_turn, &pan_turn, 0}, &s, &o);
    instrument_read(k, 1, &shot.mirror, &shot.pan);
    return shot;
}

/* Writes the true horizontal direction (clockwise from y), elevation and distance of the point at `range` along the
 * beam. */
static void true_place(const struct shot *shot, double range_m, double *pan, double *elevation, double *distance_m)
{
    double p[3];
    for (int i = 0; i < 3; i++)
        p[i] = shot->o[i] + range_m * shot->s[i];
    *pan = atan2(p[0], p[1]) / TURN;
    *elevation = atan2(p[2], hypot(p[0], p[1])) / TURN;
    *distance_m = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
}

static double wrapped(double turn)
{
    return turn - floor(turn + 0.5);
}

static void an_ideal_instrument_is_one(void **state)
{
    (void)state;
    struct instrument none = {0};
    assert_true(instrument_is_ideal(&none) && !instrument_has_offset(&none));
    struct shot shot = shoot(&none, 0.1, 0.3, 5);
    double pan, elevation, distance_m;
    true_place(&shot, 10.0, &pan, &elevation, &distance_m);
    assert_true(fabs(pan - 0.3) < 1e-15 && fabs(elevation - 0.1) < 1e-15 && shot.mirror == 0.1 && shot.pan == 0.3);
}

/* Each error alone makes a head that is not ideal. A phase without eccentricity is no error. */
static void each_error_alone_is_one(void **state)
{
    (void)state;
    static const struct instrument one[] = {{.collimation_rad = 1e-6},
                                            {.trunnion_rad = 1e-6},
                                            {.mirror_offset_m = 1e-6},
                                            {.transit_offset_m = 1e-6},
                                            {.mirror = {.index_rad = 1e-6}},
                                            {.mirror = {.scale = 1e-6}},
                                            {.mirror = {.eccentricity_rad = 1e-6}},
                                            {.pan = {.index_rad = 1e-6}},
                                            {.pan = {.scale = 1e-6}},
                                            {.pan = {.eccentricity_rad = 1e-6}},
                                            {.range_offset_m = 1e-6},
                                            {.range_scale = 1e-6},
                                            {.mirror_sigma_rad = 1e-6},
                                            {.pan_sigma_rad = 1e-6}};
    const struct instrument none = {.pan = {.phase_rad = 1.0}};
    for (size_t i = 0; i < sizeof one / sizeof one[0]; i++)
        if (instrument_is_ideal(&one[i])) fail_msg("error %zu", i);
    assert_true(instrument_is_ideal(&none));
}

/* The closed forms are from spherical triangles. Collimation c puts the beam on a circle at c from the one across the
 * mirror's axis: tan(pan error) = tan c / cos m, sin(elevation) = cos c sin m. Trunnion t tilts the circle itself:
 * tan(pan error) = sin t tan m, sin(elevation) = cos t sin m. To first order they are Muralikrishnan's c / sin V and -t
 * / tan V, V from the zenith. */
static void tilts_follow_spherical_trigonometry(void **state)
{
    (void)state;
    static const double angle_rad = 0.02;
    for (double m = -0.2; m <= 0.2; m += 0.01) {
        double pan, elevation, distance_m;
        struct shot shot = shoot(&(struct instrument){.collimation_rad = angle_rad}, m, 0.15, 0);
        true_place(&shot, 1.0, &pan, &elevation, &distance_m);
        assert_true(fabs(pan - 0.15 - atan(tan(angle_rad) / cos(TURN * m)) / TURN) < 1e-14);
        assert_true(fabs(elevation - asin(cos(angle_rad) * sin(TURN * m)) / TURN) < 1e-14);
        shot = shoot(&(struct instrument){.trunnion_rad = angle_rad}, m, 0.15, 0);
        true_place(&shot, 1.0, &pan, &elevation, &distance_m);
        assert_true(fabs(pan - 0.15 - atan(sin(angle_rad) * tan(TURN * m)) / TURN) < 1e-14);
        assert_true(fabs(elevation - asin(cos(angle_rad) * sin(TURN * m)) / TURN) < 1e-14);
    }
}

/* Both tilts are applied: the beam on its cone about the mirror's axis (x), then all of it turned about y, with lengths
 * kept. */
static void tilts_add_up(void **state)
{
    (void)state;
    const double c = 0.1, t = -0.2;
    for (double m = -0.5; m <= 0.5; m += 0.03) {
        struct shot shot = shoot(&(struct instrument){.collimation_rad = c, .trunnion_rad = t}, m, 0.0, 0);
        const double axis[3] = {cos(t), 0.0, -sin(t)}, up[3] = {sin(t), 0.0, cos(t)};
        double along = 0.0, lift = 0.0, length2 = 0.0;
        for (int i = 0; i < 3; i++) {
            along += axis[i] * shot.s[i];
            lift += up[i] * shot.s[i];
            length2 += shot.s[i] * shot.s[i];
        }
        assert_true(fabs(along - sin(c)) < 1e-15 && fabs(lift - cos(c) * sin(TURN * m)) < 1e-15);
        assert_true(fabs(length2 - 1.0) < 1e-15 && fabs(shot.s[1] - cos(c) * cos(TURN * m)) < 1e-15);
    }
}

/* The point lies at R along the beam, seen from the head's origin. Plane triangles: for a transit offset e ahead
 * distance^2 = R^2 + e^2 + 2 R e cos m, and the pan does not change. A mirror offset e to the right changes the pan by
 * atan(e / (R cos m)). */
static void offsets_make_plane_triangles(void **state)
{
    (void)state;
    for (double m = -0.2; m <= 0.2; m += 0.04)
        for (double r = 0.5; r < 100.0; r *= 2.5) {
            double pan, elevation, distance_m, e = 0.03, cm = cos(TURN * m), sm = sin(TURN * m);
            struct shot shot = shoot(&(struct instrument){.transit_offset_m = e}, m, 0.4, 0);
            true_place(&shot, r, &pan, &elevation, &distance_m);
            assert_true(fabs(distance_m - sqrt(r * r + e * e + 2.0 * r * e * cm)) < 1e-13 * r &&
                        fabs(pan - 0.4) < 1e-14);
            assert_true(fabs(elevation - atan2(r * sm, r * cm + e) / TURN) < 1e-14);
            shot = shoot(&(struct instrument){.mirror_offset_m = e}, m, 0.4, 0);
            true_place(&shot, r, &pan, &elevation, &distance_m);
            assert_true(fabs(pan - 0.4 - atan(e / (r * cm)) / TURN) < 1e-14);
            assert_true(fabs(distance_m - sqrt(r * r + e * e)) < 1e-13 * r);
        }
}

static void encoders_read_by_their_errors(void **state)
{
    (void)state;
    const struct instrument k = {.mirror = {.index_rad = 0.001, .scale = 2e-4},
                                 .pan = {.index_rad = -0.002, .eccentricity_rad = 0.0005, .phase_rad = 0.7}};
    for (double a = -1.0; a < 1.0; a += 0.0371) {
        struct shot shot = shoot(&k, a, a, 0);
        assert_true(fabs((shot.mirror - a) * TURN - (0.001 + 2e-4 * a * TURN)) < 1e-14);
        assert_true(fabs((shot.pan - a) * TURN - (-0.002 + 0.0005 * sin(TURN * a - 0.7))) < 1e-14);
        struct shot ideal = shoot(&(struct instrument){0}, a, a, 0);
        assert_memory_equal(shot.s, ideal.s, sizeof ideal.s); /* the beam knows nothing of it */
    }
    double range_m[2] = {10.0, (double)NAN};
    assert_true(instrument_is_ideal(&(struct instrument){0}));
    assert_false(instrument_is_ideal(&(struct instrument){.range_scale = 1e-6})); /* alone */
    assert_false(instrument_is_ideal(&(struct instrument){.range_offset_m = 1e-3}));
    instrument_range(&(struct instrument){.range_offset_m = 0.02, .range_scale = 1e-4}, 2, range_m);
    assert_true(fabs(range_m[0] - 10.021) < 1e-12 && isnan(range_m[1]));
}

/* Finds the angles at which a head's beam meets a far target, by Newton's method on the beam's direction, and the
 * readings of its encoders there. face 2: over the zenith. */
static struct shot point_at(const struct instrument *k, double pan_to, double elevation_to, double range_m, int face)
{
    double m = face == 1 ? elevation_to : 0.5 - elevation_to, p = face == 1 ? pan_to : pan_to + 0.5;
    for (int step = 0; step < 12; step++) {
        struct shot shot = shoot(k, m, p, 0);
        double pan, elevation, distance_m;
        true_place(&shot, range_m, &pan, &elevation, &distance_m);
        p -= wrapped(pan - pan_to);
        m -= face == 1 ? elevation - elevation_to : elevation_to - elevation;
    }
    return shoot(k, m, p, 0);
}

/* Writes the readings of face 1 less those of face 2, which are converted to face 1. */
static void two_faces(const struct instrument *k, double elevation, double range_m, double *pan_rad, double *mirror_rad)
{
    struct shot one = point_at(k, 0.2, elevation, range_m, 1), two = point_at(k, 0.2, elevation, range_m, 2);
    *pan_rad = TURN * wrapped(one.pan - (two.pan - 0.5));
    *mirror_rad = TURN * wrapped(one.mirror - (0.5 - two.mirror));
}

/* Measured in both faces, each error shows as theory predicts: collimation -2c / cos e, trunnion -2t tan e, mirror
 * index 2i, mirror offset -2 d / (R cos e), transit offset 2 d sin e / R in elevation, pan eccentricity twice its
 * value; pan index cancels. To first order: errors of 1e-5 leave 1e-9. */
static void two_faces_show_what_they_should(void **state)
{
    (void)state;
    const double small = 1e-5, off = 1e-8, r = 20.0;
    for (double e = -0.15; e <= 0.15; e += 0.05) {
        double pan, mirror, ce = cos(TURN * e), se = sin(TURN * e), te = tan(TURN * e);
        two_faces(&(struct instrument){.collimation_rad = small}, e, r, &pan, &mirror);
        assert_true(fabs(pan + 2.0 * small / ce) < off && fabs(mirror) < off);
        two_faces(&(struct instrument){.trunnion_rad = small}, e, r, &pan, &mirror);
        assert_true(fabs(pan + 2.0 * small * te) < off && fabs(mirror) < off);
        two_faces(&(struct instrument){.mirror = {.index_rad = small}}, e, r, &pan, &mirror);
        assert_true(fabs(mirror - 2.0 * small) < off && fabs(pan) < off);
        two_faces(&(struct instrument){.pan = {.index_rad = small}}, e, r, &pan, &mirror);
        assert_true(fabs(mirror) < off && fabs(pan) < off);
        two_faces(&(struct instrument){.mirror_offset_m = small * r}, e, r, &pan, &mirror);
        assert_true(fabs(pan + 2.0 * small / ce) < off && fabs(mirror) < off);
        two_faces(&(struct instrument){.transit_offset_m = small * r}, e, r, &pan, &mirror);
        assert_true(fabs(mirror - 2.0 * small * se) < off && fabs(pan) < off);
        two_faces(&(struct instrument){.pan = {.eccentricity_rad = small, .phase_rad = 0.3}}, e, r, &pan, &mirror);
        assert_true(fabs(pan - 2.0 * small * sin(TURN * 0.2 - 0.3)) < off && fabs(mirror) < off);
    }
}

/* The beam strays, each axis by its sigma, and the encoders don't. 4.75 standard errors are allowed. */
static void angle_noise_is_the_beams(void **state)
{
    (void)state;
    enum { N = 100000 };
    const struct instrument k = {.mirror_sigma_rad = 2e-4,
                                 .pan_sigma_rad = 5e-4,
                                 .mirror_key = rng_key(3, RNG_MIRROR),
                                 .pan_key = rng_key(3, RNG_PAN)};
    double sum[2] = {0}, sum2[2] = {0}, both = 0.0;
    for (uint64_t i = 0; i < N; i++) {
        struct shot shot = shoot(&k, 0.05, 0.6, i);
        double pan, elevation, distance_m;
        true_place(&shot, 1.0, &pan, &elevation, &distance_m);
        double z[2] = {(elevation - 0.05) * TURN / 2e-4, wrapped(pan - 0.6) * TURN / 5e-4};
        for (int a = 0; a < 2; a++) {
            sum[a] += z[a];
            sum2[a] += z[a] * z[a];
        }
        both += z[0] * z[1];
        assert_true(shot.mirror == 0.05 && shot.pan == 0.6);
    }
    for (int a = 0; a < 2; a++)
        assert_true(fabs(sum[a] / N) < 4.75 / sqrt(N) && fabs(sqrt(sum2[a] / N) - 1.0) < 4.75 / sqrt(2.0 * N));
    assert_true(fabs(both / N) < 4.75 / sqrt(N));
}

/* Through the caster: the range of each beam is that of its own way through the room, in both layouts and with the head
 * moving. A shot's angles are the encoders'. Counts are 10 um. */
static void the_caster_sends_beams_where_they_go(void **state)
{
    (void)state;
    static const double lo[3] = {-4, -5, -2}, hi[3] = {6, 5, 3}, station_m[3] = {0.5, 0.25, 0.125};
    struct cast_rig *rig = cast_rig_open(box_scene(lo, hi), station_m);
    const struct instrument k = {.collimation_rad = 0.01,
                                 .trunnion_rad = -0.02,
                                 .transit_offset_m = 0.1,
                                 .mirror_offset_m = -0.05,
                                 .mirror = {.index_rad = 0.003},
                                 .pan = {.eccentricity_rad = 0.002},
                                 .range_offset_m = 0.01};
    const struct cast_detect detect = {.instrument = &k, .max_echoes = 1};
    struct pose_knot knot[2] = {{.t_ns = 0}, {.t_ns = 1000000000}};
    struct schedule_line line;
    rig->setup.detect = &detect;
    pose_heading(0.3, rig->setup.rotation);
    for (int i = 0; i < 2; i++) {
        memcpy(knot[i].pose.position_m, station_m, sizeof station_m);
        pose_from_matrix(rig->setup.rotation, knot[i].pose.quat);
    }
    for (int how = 0; how < 4; how++) {
        rig->setup.layout = how % 2 ? LINE_GEO : LINE_POLAR;
        rig->setup.knot = knot;
        rig->setup.n_knots = how / 2 ? 2 : 0;
        schedule_get_line(&rig->segment, 7, &line);
        uint32_t n = (uint32_t)(line.cast_end - line.cast0);
        assert_int_equal(cast_some(rig, &line, line.cast0, n), n);
        for (uint32_t i = 0; i < n; i += 7) {
            double m = schedule_mirror_turn(&rig->segment, line.cast0 + i);
            double p = schedule_pan_turn(&rig->segment, line.cast0 + i);
            struct shot shot = shoot(&k, m, p, 0);
            double from[3];
            long double dir[3];
            const double *rot = rig->setup.rotation;
            for (int a = 0; a < 3; a++) {
                from[a] =
                    station_m[a] + rot[3 * a] * shot.o[0] + rot[3 * a + 1] * shot.o[1] + rot[3 * a + 2] * shot.o[2];
                dir[a] =
                    (long double)(rot[3 * a] * shot.s[0] + rot[3 * a + 1] * shot.s[1] + rot[3 * a + 2] * shot.s[2]);
            }
            int wall;
            double range_m = (double)box_range(lo, hi, from, dir, &wall) + 0.01;
            assert_int_equal(rig->block.label[i], wall);
            if (rig->setup.layout == LINE_POLAR) {
                assert_true(fabs(rig->block.a[i] * 1e-5 - range_m) < 0.51e-5);
                assert_true(fabs(wrapped(rig->block.b[i] * 0x1p-32 - shot.mirror)) < 1e-9);
                assert_true(fabs(wrapped(rig->block.c[i] * 0x1p-32 - shot.pan)) < 1e-9);
                continue;
            }
            double sm = sin(TURN * shot.mirror), cm = cos(TURN * shot.mirror), sp = sin(TURN * shot.pan),
                   cp = cos(TURN * shot.pan);
            const double read[3] = {range_m * sp * cm, range_m * cp * cm, range_m * sm};
            const uint32_t got[3] = {rig->block.a[i], rig->block.b[i], rig->block.c[i]};
            for (int a = 0; a < 3; a++) {
                double x = rot[3 * a] * read[0] + rot[3 * a + 1] * read[1] + rot[3 * a + 2] * read[2];
                assert_true(fabs((int32_t)got[a] * 1e-5 - x) < 0.52e-5);
            }
        }
    }
    cast_rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_ideal_instrument_is_one),           cmocka_unit_test(each_error_alone_is_one),
        cmocka_unit_test(tilts_follow_spherical_trigonometry),  cmocka_unit_test(tilts_add_up),
        cmocka_unit_test(offsets_make_plane_triangles),         cmocka_unit_test(encoders_read_by_their_errors),
        cmocka_unit_test(two_faces_show_what_they_should),      cmocka_unit_test(angle_noise_is_the_beams),
        cmocka_unit_test(the_caster_sends_beams_where_they_go),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
