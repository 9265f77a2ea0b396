/* SPDX-License-Identifier: MIT */
/* Casting: ranges against planes worked out in long double, independence of the cuts, limits and noise. */
#include <math.h>

#include "core/cast/kernels_points.h"
#include "tests/common/hits.h"
#include "tests/common/made.h"
#include "tests/common/thorough.h"
#include "tests/unit/cast_rig.h"

static const double LO[3] = {-2, -1.75, -1.5}, HI[3] = {2, 2.25, 1.25}, HERE[3] = {0.25, 0.125, 0};

static struct cast_rig *room(void)
{
    return cast_rig_open(box_scene(LO, HI), HERE);
}

/* Gives any direction, evenly. */
static void any_direction(uint64_t *seed, double d[3])
{
    double s, c, z = 2.0 * case_unit(seed) - 1.0, r = sqrt(1.0 - z * z);
    vec_sincos_turn(case_unit(seed), &s, &c);
    d[0] = r * s;
    d[1] = r * c;
    d[2] = z;
}

/* Rooms of up to 200 m and a head anywhere in them, as near to a wall as 1 % of the room. Coordinates are within 400 m,
 * and for these rays the cosine of incidence is at least 1/300. Rounding may then cost some 2e-10 m, as is worked out
 * below. The promise is 1 nm. */
static void ranges_in_a_room_are_exact_to_the_planes_tilt(void **state)
{
    (void)state;
    enum { RAYS = 512 };
    static double dx[RAYS], dy[RAYS], dz[RAYS], range[RAYS];
    static uint32_t triangle[RAYS];
    uint64_t seed = 1;
    long double worst = 0.0L;
    for (int r = 0; r < fewer(60); r++) {
        double lo[3], hi[3], station[3];
        for (int i = 0; i < 3; i++) {
            lo[i] = -100.0 * case_unit(&seed) - 1.0;
            hi[i] = 100.0 * case_unit(&seed) + 1.0;
            station[i] = lo[i] + (0.01 + 0.98 * case_unit(&seed)) * (hi[i] - lo[i]);
        }
        struct cast_rig *rig = cast_rig_open(box_scene(lo, hi), station);
        for (int i = 0; i < RAYS; i++) {
            double d[3];
            any_direction(&seed, d);
            dx[i] = d[0];
            dy[i] = d[1];
            dz[i] = d[2];
        }
        hits_from(rig->caster, rig->bvh, station, 1000.0, RAYS, dx, dy, dz, range, triangle);
        for (int i = 0; i < RAYS; i++) {
            int wall = -1;
            const long double d[3] = {dx[i], dy[i], dz[i]};
            long double error = fabsl((long double)range[i] - box_range(lo, hi, station, d, &wall));
            /* Both terms of a plane's range have errors of 8 units of 2^-53 of up to 400 m. The incidence's cosine is
             * at least 1/300: 16 * 2^-53 * 400 * 300 = 2.1e-10 m. Corners, normal and direction leave as much again,
             * and more. */
            if (!(error < 1e-9L)) fail_msg("room %d, ray %d: range %.12g, %.3Lg m off", r, i, range[i], error);
            assert_int_equal(rig->scene->label[triangle[i]], wall);
            if (error > worst) worst = error;
        }
        cast_rig_close(rig);
    }
    print_message("# rooms: worst range error %.2Lg m\n", worst);
}

/* A square with any tilt, 50 to 150 m away, whose own vertices give the plane. Corners are up to 4.3 km away,
 * and the cosine of incidence is at least 0.05. Rounding may then cost some 1.5e-10 m, as is worked out below. */
static void ranges_to_a_tilted_plane_are_exact_to_the_planes_tilt(void **state)
{
    (void)state;
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {0, 2, 3}};
    uint64_t seed = 2;
    long double worst = 0.0L;
    for (int p = 0; p < fewer(thorough(300, 60)); p++) {
        double axis[3], across[3], u[3], v[3], vertex[4][3];
        any_direction(&seed, axis);
        any_direction(&seed, across);
        for (int i = 0; i < 3; i++)
            u[i] = axis[(i + 1) % 3] * across[(i + 2) % 3] - axis[(i + 2) % 3] * across[(i + 1) % 3];
        double length = sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
        for (int i = 0; i < 3; i++)
            v[i] = axis[(i + 1) % 3] * u[(i + 2) % 3] - axis[(i + 2) % 3] * u[(i + 1) % 3];
        double off = 50.0 + 100.0 * case_unit(&seed);
        for (int c = 0; c < 4; c++)
            for (int i = 0; i < 3; i++)
                vertex[c][i] =
                    off * axis[i] + 3000.0 / length * ((c == 1 || c == 2 ? 1 : -1) * u[i] + (c >= 2 ? 1 : -1) * v[i]);
        static const double origin[3] = {0};
        struct scene *scene =
            made_scene(&(struct scene_arrays){(const double(*)[3])vertex, 4, triangle, 2, NULL, NULL, 0});
        struct cast_rig *rig = cast_rig_open(scene, origin);
        double d[3], range;
        uint32_t hit;
        for (int ray = 0; ray < 50; ray++) {
            do
                any_direction(&seed, d);
            while (d[0] * axis[0] + d[1] * axis[1] + d[2] * axis[2] < 0.05);
            hits_from(rig->caster, rig->bvh, origin, 4000.0, 1, &d[0], &d[1], &d[2], &range, &hit);
            assert_true(hit < 2);
            /* The plane is that of the triangle's own vertices, which rounding has moved away from the square's. */
            const double *a = vertex[0], *b = vertex[triangle[hit][1]], *c = vertex[triangle[hit][2]];
            long double n[3], no = 0.0L, nd = 0.0L;
            for (int i = 0; i < 3; i++) {
                int j = (i + 1) % 3, k = (i + 2) % 3;
                n[i] = ((long double)b[j] - a[j]) * ((long double)c[k] - a[k]) -
                       ((long double)b[k] - a[k]) * ((long double)c[j] - a[j]);
            }
            for (int i = 0; i < 3; i++) {
                no += n[i] * a[i];
                nd += n[i] * d[i];
            }
            long double error = fabsl((long double)range - no / nd);
            /* Both terms of a plane's range have errors of 8 units of 2^-53 of up to 4.3 km. The incidence's cosine is
             * at least 0.05: 16 * 2^-53 * 4300 / 0.05 = 1.5e-10 m. Corners, normal and direction leave as much again,
             * and more. */
            if (!(error < 1e-9L)) fail_msg("plane %d, ray %d: range %.12g, %.3Lg m off", p, ray, range, error);
            if (error > worst) worst = error;
        }
        cast_rig_close(rig);
    }
    print_message("# tilted planes: worst range error %.2Lg m\n", worst);
}

/* Other widths may choose the other triangle of a wall where a ray passes through the diagonal, and so another
 * rounding. */
static void the_width_of_packets_does_not_matter(void **state)
{
    (void)state;
    static const uint32_t width[] = {16, 8, 4, 1};
    static uint32_t first[3][RIG_LINE];
    struct cast_rig *rig = room();
    struct schedule_line line;
    rig->setup.range_scale_m = 1e-9;
    for (uint64_t n = 0; n < 20; n++)
        for (size_t w = 0; w < 4; w++) {
            struct bvh_info info;
            bvh_set_packet(rig->bvh, width[w]);
            info = *bvh_get_info(rig->bvh);
            assert_true(info.packet == width[w] || (info.packet == 1 && width[w] > 4)); /* SSE has packets of 4 */
            uint32_t echoes = cast_line(rig, n, &line);
            const uint32_t *out[] = {rig->block.a, rig->block.b, rig->block.c};
            assert_int_equal(echoes, line.cast_end - line.cast0);
            for (int i = 0; i < 3 && w == 0; i++)
                memcpy(first[i], out[i], echoes * sizeof *out[i]);
            assert_memory_equal(first[1], out[1], echoes * sizeof *out[1]);
            assert_memory_equal(first[2], out[2], echoes * sizeof *out[2]);
            for (uint32_t i = 0; i < echoes; i++)
                assert_true(first[0][i] - out[0][i] + 1 <= 2); /* a count of 1 nm */
        }
    cast_rig_close(rig);
}

struct copy {
    uint32_t a[RIG_LINE], b[RIG_LINE], c[RIG_LINE];
    int64_t t[RIG_LINE];
    uint16_t label[RIG_LINE];
    uint8_t echo[RIG_LINE];
    int16_t refl[RIG_LINE];
    uint32_t n, echoes;
};

static void append(struct copy *copy, const struct line_block *block, uint32_t echoes)
{
    for (uint32_t i = 0; i < block->n_points; i++, copy->n++) {
        copy->a[copy->n] = block->a[i];
        copy->b[copy->n] = block->b[i];
        copy->c[copy->n] = block->c[i];
        copy->t[copy->n] = block->t0_ns + block->dt_ns[i];
        copy->label[copy->n] = block->label[i];
        copy->echo[copy->n] = block->echo[i];
        copy->refl[copy->n] = block->refl_cdb[i];
    }
    copy->echoes += echoes;
}

/* A line is cast as one run, then in pieces that end at multiples of 16 from its first pulse: bit by bit the same. The
 * cast window begins and ends within a packet. Some shots are too near or too far. Noise is on. There are both layouts,
 * with and without encoders. */
static void cuts_leave_no_trace(void **state)
{
    (void)state;
    static struct copy whole, pieces;
    struct cast_rig *rig = room();
    struct schedule_line line;
    uint64_t seed = 3;
    rig->spec.line_start_udeg = -37 * DEG - 123456;
    rig->spec.line_stop_udeg = 190 * DEG + 54321;
    schedule_start(&rig->segment, &rig->spec);
    rig->setup.range_min_m = 1.6;
    rig->setup.range_max_m = 2.4;
    rig->setup.noise_on = 1;
    rig->setup.range_sigma_m = 0.003;
    rig->setup.noise_key = rng_key(1, RNG_RANGE);
    for (uint64_t n = 0; n < 40; n++) {
        rig->setup.layout = n % 2 ? LINE_GEO : LINE_POLAR;
        rig->setup.mirror_counts = rig->setup.pan_counts = n % 4 < 2 ? 0x1p32 : 0x1p20;
        memset(&whole, 0, sizeof whole);
        memset(&pieces, 0, sizeof pieces);
        uint32_t echoes = cast_line(rig, n, &line);
        append(&whole, &rig->block, echoes);
        assert_true((line.cast0 - line.pulse0) % SCHEDULE_PACKET != 0);
        for (uint64_t k = line.cast0; k < line.cast_end;) {
            uint64_t end = k + (uint64_t)case_between(&seed, 1, n < 20 ? 2000 : 70);
            end -= (end - line.pulse0) % SCHEDULE_PACKET;
            if (end <= k) end += SCHEDULE_PACKET;
            if (end > line.cast_end) end = line.cast_end;
            echoes = cast_some(rig, &line, k, end - k);
            append(&pieces, &rig->block, echoes);
            k = end;
        }
        assert_true(whole.n == line.cast_end - line.cast0 && whole.echoes > 0 && whole.echoes < whole.n);
        assert_memory_equal(&whole, &pieces, sizeof whole);
    }
    cast_rig_close(rig);
}

/* Blocks have the schedule's times, for rates whose period is no whole number of nanoseconds, after changes of them. */
static void blocks_carry_the_schedule_s_times(void **state)
{
    (void)state;
    static const int64_t rate[] = {2200000 * HZ, 333333333333, 999983 * HZ, 142857142857, 1000 * HZ, 1299709 * HZ};
    struct cast_rig *rig = room();
    struct schedule_line line;
    uint64_t k = 0;
    for (size_t r = 0; r < sizeof rate / sizeof *rate; r++) {
        rig->spec.prr_uhz = rate[r];
        rig->spec.lines_uhz = rate[r] / 3000 + 12345;
        if (r == 0)
            schedule_start(&rig->segment, &rig->spec);
        else
            schedule_change(&rig->segment, &rig->segment, &rig->spec, k);
        for (int i = 0; i < 3; i++) {
            schedule_get_line(&rig->segment, schedule_line_of(&rig->segment, k), &line);
            for (uint64_t at = line.cast0; at < line.cast_end;) {
                uint64_t n = line.cast_end - at < 333 ? line.cast_end - at : 333;
                cast_some(rig, &line, at, n);
                assert_true(rig->block.n_points == n && rig->block.pulse0 == at && rig->block.line == line.line);
                assert_true(rig->block.line_t0_ns == line.begin_ns);
                for (uint32_t j = 0; j < n; j++)
                    assert_true(rig->block.t0_ns + rig->block.dt_ns[j] == schedule_time_ns(&rig->segment, at + j));
                at += n;
            }
            k = i < 2 ? line.pulse_end : line.pulse_end + 1234;
        }
    }
    cast_rig_close(rig);
}

/* Both limits are allowed. */
static void limits_are_allowed_ranges(void **state)
{
    (void)state;
    double range_m[] = {1.0, 2.0, nextafter(1.0, 0.0), nextafter(2.0, 3.0), NAN};
    kernel_limit(range_m, 1.0, 2.0, 5);
    assert_true(range_m[0] == 1.0 && range_m[1] == 2.0);
    assert_true(isnan(range_m[2]) && isnan(range_m[3]) && isnan(range_m[4]));
}

/* Two walls, one behind the other, are seen head on. A wall nearer than the head can measure blocks the beam all the
 * same. */
static void limits_block_or_swallow_the_echo(void **state)
{
    (void)state;
    static const double vertex[8][3] = {{-9, 1, -9}, {9, 1, -9}, {9, 1, 9}, {-9, 1, 9},
                                        {-9, 5, -9}, {9, 5, -9}, {9, 5, 9}, {-9, 5, 9}};
    static const uint32_t triangle[4][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
    static const double origin[3] = {0};
    static const struct {
        double min, max;
        int hit;
    } limit[] = {{0, 10, 1},    {1.001, 10, 0}, {0.999, 10, 1}, {0.9999999999999998, 1.0000000000000002, 1},
                 {0, 0.999, 0}, {2, 6, 0},      {0, 1.001, 1}}; /* the fourth: level but for the mirror's last bit */
    struct scene *scene = made_scene(&(struct scene_arrays){vertex, 8, triangle, 4, NULL, NULL, 0});
    struct cast_rig *rig = cast_rig_open(scene, origin);
    struct schedule_line line;
    rig->spec.pan_udeg_s = 0;
    rig->spec.pan_stop_udeg = 0;
    schedule_start(&rig->segment, &rig->spec);
    rig->setup.noise_on = 1; /* noise never moves a shot over the limits, and never falls on an empty one */
    rig->setup.range_sigma_m = 0.01;
    schedule_get_line(&rig->segment, 0, &line);
    for (size_t i = 0; i < sizeof limit / sizeof *limit; i++) {
        rig->setup.range_min_m = limit[i].min;
        rig->setup.range_max_m = limit[i].max;
        /* 0 degrees is pulse 500 of 3000: -40 + 240 * 500/3000 */
        assert_int_equal(cast_some(rig, &line, 500, 1), limit[i].hit);
        assert_int_equal(rig->block.echo[0], limit[i].hit ? 0x11 : 0);
        assert_int_equal(rig->block.label[0], limit[i].hit ? 0 : LINE_LABEL_NONE);
        assert_int_equal(rig->block.refl_cdb[0], LINE_REFL_NONE);
        if (limit[i].hit)
            assert_in_range(rig->block.a[0], 93000, 107000);
        else
            assert_int_equal(rig->block.a[0], 0);
        rig->setup.layout = LINE_GEO;
        cast_some(rig, &line, 500, 1);
        if (!limit[i].hit)
            assert_true((int32_t)rig->block.a[0] == LINE_XYZ_NONE && (int32_t)rig->block.b[0] == LINE_XYZ_NONE &&
                        (int32_t)rig->block.c[0] == LINE_XYZ_NONE);
        rig->setup.layout = LINE_POLAR;
    }
    cast_rig_close(rig);
}

/* 60,000 shots: mean and standard deviation of the noise are within 4.75 standard errors (false alarms: 2e-6 each), the
 * part per distance included. Counts of 10 um add (10 um)^2/12, a millionth of the variance. */
static void noise_has_its_sigma(void **state)
{
    (void)state;
    static uint32_t exact[RIG_LINE];
    static const double sigma_m[] = {0.003, 0.0, 0.002}, sigma_ppm[] = {0, 1000, 500};
    struct cast_rig *rig = room();
    struct schedule_line line;
    for (int s = 0; s < 3; s++) {
        double sum = 0.0, sum2 = 0.0, n = 0.0;
        rig->setup.range_sigma_m = sigma_m[s];
        rig->setup.range_sigma_ppm = sigma_ppm[s];
        rig->setup.noise_key = rng_key(11 + (uint64_t)s, RNG_RANGE);
        for (uint64_t at = 0; at < 20; at++) {
            rig->setup.noise_on = 0;
            uint32_t shots = cast_line(rig, at, &line);
            memcpy(exact, rig->block.a, shots * sizeof *exact);
            rig->setup.noise_on = 1;
            cast_line(rig, at, &line);
            for (uint32_t i = 0; i < shots; i++) {
                double sigma = sigma_m[s] + 1e-6 * sigma_ppm[s] * exact[i] * 1e-5;
                double z = ((double)rig->block.a[i] - (double)exact[i]) * 1e-5 / sigma;
                sum += z;
                sum2 += z * z;
                n++;
            }
        }
        double mean = sum / n, sd = sqrt(sum2 / n - mean * mean);
        assert_true(n == 60000.0);
        assert_true(fabs(mean) < 4.75 / sqrt(n));
        assert_true(fabs(sd - 1.0) < 4.75 / sqrt(2.0 * n));
    }
    cast_rig_close(rig);
}

/* The instrument reads 2 m too little, or the noise is as large as the room. Hits that are then at or behind the head
 * have no echo in either layout, and count as not detected. Counts are 10 um. */
static void no_range_is_below_zero(void **state)
{
    (void)state;
    static uint32_t exact[RIG_LINE];
    static struct cast_hit hit[RIG_LINE];
    static const struct instrument near_by_2 = {.range_offset_m = -2.0};
    struct cast_detect detect = {.max_echoes = 1, .instrument = &near_by_2};
    struct cast_rig *rig = room();
    struct schedule_line line;
    struct cast_counters before, after;
    for (int i = 0; i < 4; i++) {
        const int noisy = i >= 2;
        uint32_t echoes = 0, n;
        rig->setup.layout = LINE_POLAR;
        rig->setup.noise_on = 0;
        rig->setup.detect = NULL;
        n = cast_line(rig, 40, &line);
        memcpy(exact, rig->block.a, n * sizeof *exact);
        rig->setup.layout = i % 2 == 0 ? LINE_POLAR : LINE_GEO;
        rig->setup.detect = noisy ? NULL : &detect;
        rig->setup.noise_on = noisy;
        rig->setup.range_sigma_m = 5.0;
        caster_get_counters(rig->caster, &before);
        cast_line(rig, 40, &line);
        caster_get_counters(rig->caster, &after);
        for (uint32_t k = 0; k < n; k++) {
            const int has_echo = rig->block.echo[k] != 0;
            echoes += (uint32_t)has_echo;
            if (!noisy) assert_int_equal(has_echo, exact[k] > 200000);
            if (rig->setup.layout == LINE_POLAR) assert_int_equal(has_echo, rig->block.a[k] != 0);
            if (!noisy && i == 0 && has_echo) assert_in_range(exact[k] - rig->block.a[k], 199999, 200001);
        }
        assert_true(echoes > 100 && n - echoes > 100);
        assert_int_equal(after.faint - before.faint, n - echoes);
        if (noisy) continue;
        struct schedule_run run;
        schedule_get_run(&rig->segment, &line, line.cast0, n, &run);
        assert_int_equal(caster_meet(rig->caster, &rig->setup, &run, hit), echoes);
    }
    cast_rig_close(rig);
}

static struct scene *tetrahedron(const double vertex[4][3])
{
    static const uint32_t triangle[4][3] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};
    static const uint16_t label[4] = {0};
    const struct scene_surface surface = {.object = "tetrahedron", .material = "plain"};
    return made_scene(&(struct scene_arrays){vertex, 4, triangle, 4, label, &surface, 1});
}

/* Returns the range from corner 0 along d to the opposite face, by the ray's shares of the three edges that leave the
 * corner. NaN: it does not go there. INFINITY: it is too near to an edge to decide. */
static double opposite_range(const double vertex[4][3], const double d[3])
{
    double e[3][3], share[3], sum = 0.0;
    for (int k = 0; k < 3; k++)
        vec3_sub(vertex[k + 1], vertex[0], e[k]);
    for (int k = 0; k < 3; k++) {
        double n[3];
        vec3_cross(e[(k + 1) % 3], e[(k + 2) % 3], n);
        share[k] = vec3_dot(n, d) / vec3_dot(n, e[k]);
        sum += share[k];
    }
    for (int k = 0; k < 3; k++)
        if (fabs(share[k]) < 1e-6) return INFINITY;
    return share[0] > 0.0 && share[1] > 0.0 && share[2] > 0.0 ? 1.0 / sum : (double)NAN;
}

/* A head is on a corner of a mesh. The corner is no echo, the face across is seen, and in other directions nothing is.
 * The BVH's origin, the middle of the mesh, is elsewhere. */
static void what_a_ray_begins_on_is_no_hit(void **state)
{
    (void)state;
    enum { RAYS = 512 };
    static double dx[RAYS], dy[RAYS], dz[RAYS], range[RAYS];
    static uint32_t triangle[RAYS];
    uint64_t seed = 7;
    for (int t = 0; t < fewer(100); t++) {
        double v[4][3], origin[3];
        for (int k = 0; k < 4; k++)
            for (int a = 0; a < 3; a++)
                v[k][a] = 50.0 * case_unit(&seed) - 25.0;
        for (int a = 0; a < 3; a++)
            origin[a] = v[0][a] + (t % 2 != 0 ? case_unit(&seed) - 0.5 : 0.0);
        struct cast_rig *rig = cast_rig_open(tetrahedron((const double(*)[3])v), origin);
        for (int i = 0; i < RAYS; i++) {
            double d[3];
            any_direction(&seed, d);
            dx[i] = d[0], dy[i] = d[1], dz[i] = d[2];
        }
        hits_from(rig->caster, rig->bvh, v[0], 1000.0, RAYS, dx, dy, dz, range, triangle);
        for (int i = 0; i < RAYS; i++) {
            const double d[3] = {dx[i], dy[i], dz[i]}, want = opposite_range((const double(*)[3])v, d);
            if (isinf(want)) continue;
            if (isnan(want) ? !isnan(range[i]) : !(fabs(range[i] - want) < 1e-6))
                fail_msg("tetrahedron %d, ray %d: %g m instead of %g", t, i, range[i], want);
        }
        cast_rig_close(rig);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ranges_in_a_room_are_exact_to_the_planes_tilt),
        cmocka_unit_test(what_a_ray_begins_on_is_no_hit),
        cmocka_unit_test(ranges_to_a_tilted_plane_are_exact_to_the_planes_tilt),
        cmocka_unit_test(the_width_of_packets_does_not_matter),
        cmocka_unit_test(cuts_leave_no_trace),
        cmocka_unit_test(blocks_carry_the_schedule_s_times),
        cmocka_unit_test(limits_are_allowed_ranges),
        cmocka_unit_test(limits_block_or_swallow_the_echo),
        cmocka_unit_test(noise_has_its_sigma),
        cmocka_unit_test(no_range_is_below_zero),
    };
    return cmocka_run_group_tests_name("cast", tests, NULL, NULL);
}
