/* SPDX-License-Identifier: MIT */
/* Casting: the meaning of the counts on the wire. Angles, senses of rotation, encoders, positions, and frames far from
 * the origin. */
#include "core/cast/kernels_points.h"
#include "tests/common/hits.h"
#include "tests/common/made.h"
#include "tests/unit/cast_rig.h"

static const double LO[3] = {-20, -17.5, -15}, HI[3] = {20, 22.5, 12.5}, HERE[3] = {2.5, 1.25, 0};

static struct cast_rig *room(void)
{
    return cast_rig_open(box_scene(LO, HI), HERE);
}

/* Fires one pulse at whole micro-degrees, from a head with this heading, and writes its block entry. */
static uint32_t fire(struct cast_rig *rig, int64_t mirror_udeg, int64_t pan_udeg, double heading_rad)
{
    struct schedule_line line;
    rig->spec.fov_min_udeg = rig->spec.line_start_udeg = mirror_udeg;
    rig->spec.line_stop_udeg = mirror_udeg + rig->spec.sweep_udeg;
    rig->spec.pan_start_udeg = rig->spec.pan_stop_udeg = pan_udeg;
    schedule_start(&rig->segment, &rig->spec);
    pose_heading(heading_rad, rig->setup.rotation);
    schedule_get_line(&rig->segment, 0, &line);
    return cast_some(rig, &line, 0, 1);
}

/* There is one wall for each way the beam can go: labels are x-, x+, y-, y+, z-, z+. */
static void the_beam_goes_where_the_angles_say(void **state)
{
    (void)state;
    static const struct {
        int mirror_deg, pan_deg, heading_deg, wall;
    } way[] = {{0, 0, 0, 3},   {0, 90, 0, 1},   {0, 180, 0, 2},  {0, 270, 0, 0}, {90, 0, 0, 5},    {-89, 0, 0, 4},
               {0, 0, 90, 1},  {0, 0, 180, 2},  {0, 0, 270, 0},  {0, 0, -90, 0}, {0, 90, 90, 2},   {0, -90, 90, 3},
               {179, 0, 0, 2}, {180, 90, 0, 0}, {170, 0, 90, 0}, {100, 0, 0, 5}, {0, 360, 360, 3}, {-10, 45, 45, 1}};
    struct cast_rig *rig = room();
    for (size_t i = 0; i < sizeof way / sizeof *way; i++) {
        assert_int_equal(fire(rig, way[i].mirror_deg * DEG, way[i].pan_deg * DEG, way[i].heading_deg * M_PI / 180.0),
                         1);
        if (rig->block.label[0] != way[i].wall)
            fail_msg("way %zu meets wall %d, not %d", i, rig->block.label[0], way[i].wall);
    }
    cast_rig_close(rig);
}

/* The mirror turns up, and then over the zenith down to the back. The pan stays the same, and the encoder goes on
 * counting. */
static void beyond_90_degrees_the_beam_looks_back(void **state)
{
    (void)state;
    struct cast_rig *rig = room();
    rig->setup.layout = LINE_GEO;
    fire(rig, 80 * DEG, 0, 0.0);
    int32_t y_before = (int32_t)rig->block.b[0], z_before = (int32_t)rig->block.c[0];
    fire(rig, 100 * DEG, 0, 0.0);
    assert_true(y_before > 0 && (int32_t)rig->block.b[0] < 0 && z_before > 0 && (int32_t)rig->block.c[0] > 0);
    /* the ceiling is 12.5 m up: cot 80 deg of that to the front and to the back */
    assert_true(fabs(y_before * 1e-5 - 12.5 / tan(80.0 * M_PI / 180.0)) < 1e-5);
    assert_true(fabs((int32_t)rig->block.b[0] * 1e-5 + 12.5 / tan(80.0 * M_PI / 180.0)) < 1e-5);
    rig->setup.layout = LINE_POLAR;
    rig->setup.mirror_counts = rig->setup.pan_counts = 36000;
    fire(rig, 100 * DEG, 30 * DEG, 0.0);
    assert_true(rig->block.b[0] == 10000 && rig->block.c[0] == 3000);
    cast_rig_close(rig);
}

static void encoders_count_modulo_a_turn(void **state)
{
    (void)state;
    static const struct {
        double turn, counts;
        uint32_t count;
    } is[] = {{0, 4, 0},
              {0.25, 4, 1},
              {-0.25, 4, 3},
              {1.0, 4, 0},
              {0.99, 4, 0},
              {0.87, 4, 3},
              {-1.0, 4, 0},
              {7.5, 4, 2},
              {-7.25, 4, 3},
              {-1e-20, 4, 0},
              {0.5, 0x1p32, 0x80000000U},
              {-0.25, 0x1p32, 0xc0000000U},
              {1.0 - 0x1p-33, 0x1p32, 0},
              {1.0 - 0x1p-31, 0x1p32, 0xfffffffeU},
              {100.125, 1048576, 131072},
              {-40.0 / 360.0, 36000, 32000}};
    for (size_t i = 0; i < sizeof is / sizeof *is; i++)
        if (instrument_encoder_count(is[i].turn, is[i].counts) != is[i].count)
            fail_msg("%g turns of %g counts: %u", is[i].turn, is[i].counts,
                     instrument_encoder_count(is[i].turn, is[i].counts));
}

/* The same for points, also with negative angles and beyond a turn. */
static void points_have_the_encoders_counts(void **state)
{
    (void)state;
    struct cast_rig *rig = room();
    uint64_t seed = 1;
    for (int i = 0; i < 5000; i++) {
        double counts[] = {0x1p32, 0x1p20, 36000, 7};
        rig->setup.mirror_counts = counts[i % 4];
        rig->setup.pan_counts = counts[i / 4 % 4];
        int64_t mirror = case_between(&seed, -180 * DEG, 360 * DEG), pan = case_between(&seed, -360 * DEG, 720 * DEG);
        if (i % 7 == 0) mirror -= mirror % (90 * DEG);
        if (i % 11 == 0) pan -= pan % (90 * DEG);
        fire(rig, mirror, pan, 0.0);
        /* The count is the nearest whole one, in exact integers. Angles about halfway between two counts are left out:
         * 2 turns in a double are good to 1e-6 counts of 2^32. */
        for (int axis = 0; axis < 2; axis++) {
            int64_t udeg = axis ? pan : mirror, n = (int64_t)(axis ? rig->setup.pan_counts : rig->setup.mirror_counts);
            int64_t within = (udeg % (360 * DEG) + 360 * DEG) % (360 * DEG);
            int64_t twice = 2 * within * (n / 4), rest; /* n / 4 fits 64 bits; 7 is not a multiple of 4 */
            if (n == 7) continue;
            rest = twice % (180 * DEG);
            int64_t count = (twice / (180 * DEG) + (rest > 90 * DEG)) % n;
            if (llabs(rest - 90 * DEG) < 1000) continue;
            uint32_t got = axis ? rig->block.c[0] : rig->block.b[0];
            if (got != (uint32_t)count) fail_msg("%lld udeg of %lld counts: %u", (long long)udeg, (long long)n, got);
            assert_int_equal(instrument_encoder_count((double)udeg / 360e6, (double)n), count);
        }
        if (rig->setup.mirror_counts == 7.0) assert_true(rig->block.b[0] < 7);
    }
    cast_rig_close(rig);
}

/* An angle halfway between two counts reads as one of them. Points and the ends of lines, which call
 * instrument_encoder_count, read the same one. With 4 counts a turn these angles are exact in binary. */
static void halfway_both_read_the_same(void **state)
{
    (void)state;
    struct cast_rig *rig = room();
    rig->setup.mirror_counts = rig->setup.pan_counts = 4.0;
    for (int64_t deg = -135; deg <= 315; deg += 90) {
        fire(rig, deg * DEG, deg * DEG, 0.0);
        const uint32_t count = instrument_encoder_count((double)deg / 360.0, 4.0);
        assert_int_equal(rig->block.b[0], count);
        assert_int_equal(rig->block.c[0], count);
        assert_true(fabs(remainder(count - (double)deg / 90.0, 4.0)) == 0.5);
    }
    cast_rig_close(rig);
}

/* The bound is half a count each: range_scale/2 along the beam, pi/counts across it for each encoder. 1e-9 m for the
 * range are added, and 1e-9 turns for rounding and the pan's 2^-24 udeg. */
static void polar_counts_give_the_position_back(void **state)
{
    (void)state;
    struct cast_rig *rig = room();
    struct schedule_line line;
    for (uint64_t n = 0; n < 2000; n += 97) {
        rig->setup.mirror_counts = n % 2 ? 0x1p32 : 0x1p20;
        rig->setup.pan_counts = n % 2 ? 0x1p32 : 36000;
        uint32_t shots = cast_line(rig, n, &line);
        assert_int_equal(shots, line.cast_end - line.cast0);
        for (uint32_t i = 0; i < shots; i += 7) {
            long double mirror, pan, d[3];
            int wall = -1;
            true_angles(&rig->spec, line.cast0 + i, &mirror, &pan);
            true_direction(mirror, pan, 0.0L, d);
            long double range = box_range(LO, HI, HERE, d, &wall);
            long double off_m = fabsl(rig->block.b[i] / (long double)rig->setup.mirror_counts - mirror);
            long double off_p = fabsl(rig->block.c[i] / (long double)rig->setup.pan_counts - pan);
            off_m = fabsl(off_m - roundl(off_m));
            off_p = fabsl(off_p - roundl(off_p));
            assert_true(fabsl(rig->block.a[i] * 1e-5L - range) < 0.5e-5L + 1e-9L);
            assert_true(off_m < 0.5L / (long double)rig->setup.mirror_counts + 1e-9L);
            assert_true(off_p < 0.5L / (long double)rig->setup.pan_counts + 1e-9L);
        }
    }
    cast_rig_close(rig);
}

static void check_geo_point(const struct cast_rig *rig, uint64_t k, uint32_t i, long double heading_rad)
{
    const long double two_pi = 6.283185307179586476925286766559L;
    long double mirror, pan, d[3], read[3];
    int wall = -1;
    true_angles(&rig->spec, k, &mirror, &pan);
    true_direction(mirror, pan, heading_rad, d);
    long double range = box_range(LO, HI, HERE, d, &wall), counts_m = rig->setup.mirror_counts,
                counts_p = rig->setup.pan_counts;
    assert_int_equal(rig->block.label[i], wall);
    int ideal = counts_m >= 0x1p32L;
    long double mirror_read = ideal ? mirror : roundl(mirror * counts_m) / counts_m;
    long double pan_read = ideal ? pan : roundl(pan * counts_p) / counts_p;
    true_direction(mirror_read, pan_read, heading_rad, read);
    const uint32_t *counts[] = {rig->block.a, rig->block.b, rig->block.c};
    double d_crs[3], p[3];
    for (int axis = 0; axis < 3; axis++)
        d_crs[axis] = (int32_t)counts[axis][i] * rig->setup.xyz_scale[axis];
    georef_reverse(rig->georef, d_crs, p);
    /* Half a count on each axis is sqrt(3)/2 counts. A count is at most scale_m, and 0.04 % more where the grid is
     * smaller than the ground. The method's bound is added, and GeographicLib's own 5 nm both ways. */
    long double rounding = 0.8664L * (long double)rig->setup.xyz_scale[2] +
                           (long double)georef_bound_m(rig->georef, georef_method(rig->georef), 20.0, 20.0) + 2e-8L;
    long double off_read = 0.0L, off_true = 0.0L;
    for (int axis = 0; axis < 3; axis++) {
        off_read += powl((long double)p[axis] - HERE[axis] - range * read[axis], 2);
        off_true += powl((long double)p[axis] - HERE[axis] - range * d[axis], 2);
    }
    int tie = fabsl(fabsl(mirror * counts_m - roundl(mirror * counts_m)) - 0.5L) < 1e-6L ||
              fabsl(fabsl(pan * counts_p - roundl(pan * counts_p)) - 0.5L) < 1e-6L;
    if (!tie) assert_true(sqrtl(off_read) <= rounding);
    long double encoders = ideal ? 0.0L : range * two_pi * 0.5L * (1.0L / counts_m + 1.0L / counts_p);
    assert_true(sqrtl(off_true) <= rounding + encoders);
}

/* In each coordinate reference system, the position by the encoders is right within half a count of a coordinate. The
 * true position is within half a count of each encoder more. */
static void geo_counts_give_the_position_back(void **state)
{
    (void)state;
    static const struct {
        enum georef_crs crs;
        enum georef_method method;
    } ways[] = {{GEOREF_LOCAL, GEOREF_EXACT},    {GEOREF_ECEF, GEOREF_EXACT}, {GEOREF_UTM, GEOREF_EXACT},
                {GEOREF_UTM, GEOREF_ORDER2},     {GEOREF_UTM, GEOREF_ORDER3}, {GEOREF_GEODETIC, GEOREF_EXACT},
                {GEOREF_GEODETIC, GEOREF_ORDER2}};
    enum { WAYS = sizeof ways / sizeof ways[0] };
    struct cast_rig *rig = room();
    struct schedule_line line;
    rig->setup.layout = LINE_GEO;
    for (int c = 0; c < 2 * WAYS; c++) {
        struct georef_spec spec = {.crs = ways[c / 2].crs,
                                   .station_m = {HERE[0], HERE[1], HERE[2]},
                                   .lat_deg = 52.5,
                                   .lon_deg = 13.4,
                                   .height_m = 110};
        struct sh_err err;
        double heading = 0.7 * c - 1.0;
        georef_free(rig->georef);
        if (georef_create(&spec, &rig->georef, &err) != 0) fail_msg("%s", err.text);
        assert_int_equal(georef_set_method(rig->georef, ways[c / 2].method, &err), 0);
        rig->setup.georef = rig->georef;
        rig->setup.mirror_counts = rig->setup.pan_counts = c % 2 ? 0x1p32 : 10000;
        assert_int_equal(georef_scale(rig->georef, c % 2 ? 1e-6 : 1e-4, 100.0, rig->setup.xyz_scale, &err), 0);
        pose_heading(heading, rig->setup.rotation);
        for (uint64_t n = 0; n < 2000; n += 331) {
            uint32_t shots = cast_line(rig, n, &line);
            for (uint32_t i = 0; i < shots; i += 13)
                check_geo_point(rig, line.cast0 + i, i, (long double)heading);
        }
    }
    cast_rig_close(rig);
}

enum { RAYS = 4096 };
static double ray[3][RAYS];

static void any_rays(uint64_t seed)
{
    for (int i = 0; i < RAYS; i++) {
        double z = 2.0 * case_unit(&seed) - 1.0, r = sqrt(1.0 - z * z), s, c;
        vec_sincos_turn(case_unit(&seed), &s, &c);
        ray[0][i] = r * s;
        ray[1][i] = r * c;
        ray[2][i] = z;
    }
}

static void hits(const double lo[3], const double hi[3], const double origin[3], const double station[3], double *range)
{
    static uint32_t triangle[RAYS];
    struct cast_rig *rig = cast_rig_open(box_scene(lo, hi), origin);
    hits_from(rig->caster, rig->bvh, station, 1000.0, RAYS, ray[0], ray[1], ray[2], range, triangle);
    cast_rig_close(rig);
}

static void move(const double offset[3], double grown_m, double lo[3], double hi[3], double here[3])
{
    for (int i = 0; i < 3; i++) {
        lo[i] = LO[i] - grown_m + offset[i];
        hi[i] = HI[i] + grown_m + offset[i];
        here[i] = HERE[i] + grown_m + offset[i];
    }
}

/* The room's coordinates are multiples of a quarter of a metre, and the offset is one of 2^-10 m. Every sum is exact,
 * so nothing at all may change. */
static void a_room_at_utm_coordinates_is_the_room_at_the_origin(void **state)
{
    (void)state;
    static const double utm[3] = {391234.0 + 569.0 / 1024, 5818765.0 + 123.0 / 1024, 110.0 + 7.0 / 1024};
    static double near[RAYS], far[RAYS];
    double lo[3], hi[3], here[3];
    any_rays(1);
    move(utm, 0.0, lo, hi, here);
    hits(LO, HI, HERE, HERE, near);
    hits(lo, hi, here, here, far);
    assert_memory_equal(near, far, sizeof near);
}

/* Coordinates are rounded by double: at 5.8e6 m its steps are 2^-30 m. So a wall and the station are wrong by half of
 * that each, 9.3e-10 m at most along the wall's normal, which the incidence stretches. In float, steps would be 0.5
 * m. */
static void rounded_coordinates_cost_no_more_than_their_rounding(void **state)
{
    (void)state;
    static const double utm[3] = {391234.56789, 5818765.43219, 110.98765};
    static double near[RAYS], far[RAYS];
    double lo[3], hi[3], here[3], worst = 0.0;
    any_rays(2);
    static const double nowhere[3] = {0};
    move(nowhere, 0.0123, lo, hi, here);
    hits(lo, hi, here, here, near);
    double at_lo[3], at_hi[3], at[3];
    move(utm, 0.0123, at_lo, at_hi, at);
    hits(at_lo, at_hi, at, at, far);
    for (int i = 0; i < RAYS; i++) {
        const long double d[3] = {ray[0][i], ray[1][i], ray[2][i]};
        int wall = -1;
        box_range(lo, hi, here, d, &wall);
        double cosine = (double)fabsl(d[wall / 2]), step = wall / 2 == 1 ? 0x1p-30 : wall / 2 == 0 ? 0x1p-34 : 0x1p-46;
        double off = fabs(near[i] - far[i]);
        if (!(off <= step / cosine + 1e-12)) fail_msg("ray %d: %.3g m off, cosine %.3g", i, off, cosine);
        worst = fmax(worst, off);
    }
    assert_true(worst > 0.0);
}

/* The scene is the room, and a triangle 2 km away. The BVH's origin is the middle of that. */
static struct scene *room_and_far_triangle(void)
{
    struct scene *room = box_scene(LO, HI), *both;
    double vertex[11][3];
    uint32_t triangle[13][3];
    uint16_t label[13] = {0};
    assert_true(room->n_vertices == 8 && room->n_triangles == 12);
    memcpy(vertex, room->vertex_m, 8 * sizeof vertex[0]);
    memcpy(triangle, room->triangle, 12 * sizeof triangle[0]);
    memcpy(label, room->label, 12 * sizeof label[0]);
    for (uint32_t i = 0; i < 3; i++) {
        for (uint32_t k = 0; k < 3; k++)
            vertex[8 + i][k] = HERE[k] + (k == 0 ? -1200.0 : k == 1 ? 1400.0 : 100.0) + (i == k);
        triangle[12][i] = 8 + i;
    }
    both = made_scene(&(struct scene_arrays){(const double(*)[3])vertex, 11, (const uint32_t(*)[3])triangle, 13, label,
                                             room->surface, room->n_surfaces});
    scene_free(room);
    return both;
}

/* A kilometre from its origin the float coordinates of a BVH have steps of 0.06 mm, which must not reach the range. */
static void a_station_far_from_the_bvh_s_origin_is_as_exact(void **state)
{
    (void)state;
    static double range[RAYS];
    static uint32_t triangle[RAYS];
    struct scene *scene = room_and_far_triangle();
    struct sh_err err;
    struct caster *caster = NULL;
    any_rays(3);
    struct bvh *bvh = made_bvh(scene);
    if (caster_create(&caster, &err) != 0) fail_msg("%s", err.text);
    hits_from(caster, bvh, HERE, 1000.0, RAYS, ray[0], ray[1], ray[2], range, triangle);
    for (int i = 0; i < RAYS; i++) {
        const long double d[3] = {ray[0][i], ray[1][i], ray[2][i]};
        int wall = -1;
        long double expected = box_range(LO, HI, HERE, d, &wall);
        assert_true(fabsl((long double)range[i] - expected) < 1e-9L);
        assert_int_equal(scene->label[triangle[i]], wall);
    }
    caster_free(caster);
    bvh_free(bvh);
    scene_free(scene);
}

/* Counts on the wire have 31 bits and a sign. A point beyond them has no place, and is counted as left out. A shot
 * without echo is not counted. */
static void coordinates_fit_31_bits(void **state)
{
    (void)state;
    static const double most = 2147483647.0;
    const double x[] = {most - 1.0, 1.0 - most, most + 0.5, -most - 1.0, 1.2 * most, -1.2 * most, (double)NAN};
    const int32_t count[] = {INT32_MAX - 1, -INT32_MAX + 1, LINE_XYZ_NONE, LINE_XYZ_NONE,
                             LINE_XYZ_NONE, LINE_XYZ_NONE,  LINE_XYZ_NONE};
    const double none[7] = {0.0}, scale[3] = {1e-3, 1e-2, 1.0};
    for (int axis = 0; axis < 3; axis++) {
        double p[3][7];
        uint32_t wire[3][7];
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < 7; i++)
                p[k][i] = k == axis ? x[i] * scale[k] : none[i];
        assert_int_equal(
            kernel_geo(&(struct vec3_in){p[0], p[1], p[2]}, scale, 7, &(struct kernel_wire){wire[0], wire[1], wire[2]}),
            4);
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < 7; i++)
                assert_int_equal((int32_t)wire[k][i], k == axis ? count[i] : 0);
    }
}

/* The same for a direction and a range: a point has all three coordinates or none. The next entry is not written. */
static void points_fit_31_bits(void **state)
{
    (void)state;
    static const double range_m[] = {2.0, 2147483646.0, 2147483648.0, 2147483648.0, 3e9, (double)NAN};
    static const double along[3] = {1, -1, 1}, scale[3] = {1.0, 0.5, 0.25};
    for (int axis = 0; axis < 3; axis++)
        for (int i = 0; i < 6; i++) {
            double d[3];
            uint32_t wire[3][2] = {{7, 7}, {7, 7}, {7, 7}};
            for (int k = 0; k < 3; k++)
                d[k] = (k == axis ? along[k] : 0x1p-4) * scale[k];
            const uint32_t unfit = kernel_place(&(struct vec3_in){&d[0], &d[1], &d[2]}, &range_m[i], scale, 1,
                                                &(struct kernel_wire){wire[0], wire[1], wire[2]});
            assert_int_equal(unfit, i >= 2 && i <= 4);
            for (int k = 0; k < 3; k++) {
                const double want = i < 2 ? rint((k == axis ? along[k] : 0x1p-4) * range_m[i]) : LINE_XYZ_NONE;
                assert_true((double)(int32_t)wire[k][0] == want && wire[k][1] == 7);
            }
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_beam_goes_where_the_angles_say),
        cmocka_unit_test(beyond_90_degrees_the_beam_looks_back),
        cmocka_unit_test(encoders_count_modulo_a_turn),
        cmocka_unit_test(points_have_the_encoders_counts),
        cmocka_unit_test(halfway_both_read_the_same),
        cmocka_unit_test(polar_counts_give_the_position_back),
        cmocka_unit_test(geo_counts_give_the_position_back),
        cmocka_unit_test(a_room_at_utm_coordinates_is_the_room_at_the_origin),
        cmocka_unit_test(rounded_coordinates_cost_no_more_than_their_rounding),
        cmocka_unit_test(a_station_far_from_the_bvh_s_origin_is_as_exact),
        cmocka_unit_test(coordinates_fit_31_bits),
        cmocka_unit_test(points_fit_31_bits),
    };
    return cmocka_run_group_tests_name("cast frames", tests, NULL, NULL);
}
