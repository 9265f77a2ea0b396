/* SPDX-License-Identifier: MIT */
/* libscanhead: columns of points, and points, beside the plain formula of one point, bit for bit but for geodetic
 * ranges. */
#include <math.h>

#include "core/vecmath.h"
#include "tests/unit/host_rig.h"

/* N is no multiple of any block. */
enum { N = 3001, GUARD = 16, FIGURES = 7 };

/* ---- the plain formula */

struct kind {
    const char *name;
    int geo, moving;
    uint32_t crs, emitter;
    double mirror_counts, pan_counts, scale[3], at[3];
    int one_mirror;
};

static const struct kind KINDS[] = {
    {"line head", .mirror_counts = 3600000, .pan_counts = 7200000},
    {"planar head", .emitter = NATIVE_EMIT_PLANAR, .mirror_counts = 1 << 20, .pan_counts = 1 << 20},
    {"ring", .emitter = NATIVE_EMIT_SPHERE, .mirror_counts = 4294967296.0, .pan_counts = 12345.678, .one_mirror = 1},
    {"few counts", .mirror_counts = 1, .pan_counts = 3},
    {"utm", 1, .crs = NATIVE_CRS_UTM, .scale = {1e-5, 2e-5, 3e-5}, .at = {5e5, 5.4e6, 300}},
    {"utm, moving", 1, 1, .crs = NATIVE_CRS_UTM, .scale = {1e-4, 1e-4, 1e-4}, .at = {5e5, 5.4e6, 300}},
    {"geodetic", 1, .crs = NATIVE_CRS_GEODETIC, .scale = {1e-8, 1e-7, 1e-3}, .at = {45, 179.9999, 100}},
    {"geodetic, west", 1, .crs = NATIVE_CRS_GEODETIC, .scale = {1e-8, 1e-7, 1e-3}, .at = {-80, -179.9999, 100}},
    {"geodetic, moving", 1, 1, .crs = NATIVE_CRS_GEODETIC, .scale = {1e-8, 1e-7, 1e-3}, .at = {45, 10, 100}},
};

static void sincos_plain(double u, double *sine, double *cosine)
{
    const double part = u * 256, whole = floor(part + 0.5);
    const double r = (part - whole) * (VEC_TURN_RAD / 256), r2 = r * r;
    const double sin_r = r + r * r2 * (-1.0 / 6 + r2 * (1.0 / 120));
    const double cos_r_1 = r2 * (-0.5 + r2 * (1.0 / 24 - r2 * (1.0 / 720)));
    const int k = (int)fmod(whole, 256);
    const double sk = sin(VEC_TURN_RAD * k / 256), ck = cos(VEC_TURN_RAD * k / 256);
    *sine = sk + (ck * sin_r + sk * cos_r_1);
    *cosine = ck + (ck * cos_r_1 - sk * sin_r);
}

static void polar_plain(const struct kind *k, uint32_t i, struct scanhead_point *p)
{
    const double lo = (k->emitter == NATIVE_EMIT_LINE ? 0.25 : 0) - 0.5; /* the line's middle is at 90 degrees */
    const double mirror = b[i] * (1 / k->mirror_counts), pan = c[i] * (1 / k->pan_counts);
    double sin_m, cos_m, sin_pan, cos_pan;
    sincos_plain(mirror, &sin_m, &cos_m);
    sincos_plain(pan, &sin_pan, &cos_pan);
    p->range_m = p->echo_count == 0 ? (double)NAN : 1e-4 * a[i];
    p->x = p->range_m * cos_m * sin_pan;
    p->y = p->range_m * cos_m * cos_pan;
    p->z = p->range_m * sin_m;
    p->mirror_rad = VEC_TURN_RAD * (mirror - floor(mirror - lo));
    p->pan_rad = VEC_TURN_RAD * (pan - floor(pan));
}

/* WGS 84, NIMA TR8350.2. */
static void geocentric_plain(const double at[3], double p[3])
{
    const double f = 1 / 298.257223563, e2 = f * (2 - f), rad = NATIVE_RAD_PER_DEG;
    const double s = sin(at[0] * rad), co = cos(at[0] * rad), n = 6378137.0 / sqrt(1 - e2 * s * s);
    p[0] = (n + at[2]) * co * cos(at[1] * rad);
    p[1] = (n + at[2]) * co * sin(at[1] * rad);
    p[2] = (n * (1 - e2) + at[2]) * s;
}

static void geo_plain(const struct kind *k, uint32_t i, struct scanhead_point *p)
{
    double d[3] = {k->scale[0] * (int32_t)a[i], k->scale[1] * (int32_t)b[i], k->scale[2] * (int32_t)c[i]};
    double at[3] = {k->at[0] + d[0], k->at[1] + d[1], k->at[2] + d[2]};
    if (k->crs == NATIVE_CRS_GEODETIC) {
        double from[3], to[3];
        if (at[1] > 180) at[1] -= 360;
        if (at[1] < -180) at[1] += 360;
        geocentric_plain(k->at, from);
        geocentric_plain(at, to);
        for (int j = 0; j < 3; j++)
            d[j] = to[j] - from[j];
    }
    p->x = at[0];
    p->y = at[1];
    p->z = at[2];
    p->range_m = k->moving ? (double)NAN : sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    p->mirror_rad = p->pan_rad = NAN;
    if (p->echo_count == 0) p->x = p->y = p->z = p->range_m = NAN;
}

static void point_plain(const struct kind *k, uint32_t i, struct scanhead_point *p)
{
    p->echo = echo[i] & 15;
    p->echo_count = echo[i] >> 4;
    p->label = label[i];
    p->t_ns = 1000000 + dt[i];
    p->reflectance_db = refl[i] == INT16_MIN ? (double)NAN : refl[i] / 100.0;
    if (k->geo)
        geo_plain(k, i, p);
    else
        polar_plain(k, i, p);
}

/* ---- rows */

static uint32_t next_random(void)
{
    static uint64_t x = 88172645463325252u;
    x ^= x << 13;
    x ^= x >> 7;
    x ^= x << 17;
    return (uint32_t)(x >> 20);
}

/* Returns any number, an end of its range, or a count at or beside a border of the table's parts of a turn. */
static uint32_t make_word(double counts_per_turn)
{
    static const uint32_t ends[] = {0, 1, 2, 0x7fffffff, 0x80000000, 0x80000001, 0xfffffffe, UINT32_MAX};
    const uint32_t x = next_random();
    if (x % 4 == 0) return ends[x / 4 % 8];
    if (x % 4 == 1 && counts_per_turn > 0)
        return (uint32_t)(int64_t)(counts_per_turn * (x / 4 % 512) / 512) + x / 2048 % 3 - 1;
    if (x % 4 == 2) return next_random() % 20000000;
    return next_random();
}

static void make_rows(const struct kind *k)
{
    static const int16_t refls[] = {INT16_MIN, INT16_MIN + 1, INT16_MAX, -1, 0, 1};
    const uint32_t mirror = make_word(k->mirror_counts);
    for (uint32_t i = 0; i < N; i++) {
        a[i] = make_word(0);
        b[i] = k->one_mirror ? mirror : make_word(k->mirror_counts);
        c[i] = make_word(k->pan_counts);
        const uint32_t x = next_random();
        dt[i] = i == 7 ? 0xffffff : x % 0x1000000;
        refl[i] = x % 3 == 0 ? refls[x / 4 % 6] : (int16_t)(uint16_t)x;
        label[i] = (uint16_t)(next_random() >> 3);
        echo[i] = x % 5 == 0 ? 0 : (uint8_t)(next_random() >> 5);
    }
    if (k->one_mirror) b[N - 1]++; /* the last block has two mirror angles */
}

static struct scanhead *open_rows(const struct kind *k, struct scanhead_frame *frame)
{
    int head;
    struct scanhead *sh = open_pair(&head);
    struct native_descriptor d = make_descriptor(k->geo, 1);
    struct native_anchor anchor = make_anchor();
    const struct native_emitter e = {.kind = k->emitter,
                                     .steps = 3600,
                                     .turn = 1,
                                     .rings = 3,
                                     .gaps = 2,
                                     .sequence_ns_num = 1,
                                     .sequence_ns_den = 1};
    d.mirror_counts_per_turn = k->mirror_counts;
    d.pan_counts_per_turn = k->pan_counts;
    anchor.crs = k->crs;
    anchor.moving = k->moving ? NATIVE_MOVING : 0;
    memcpy(anchor.anchor, k->at, sizeof k->at);
    memcpy(anchor.scale, k->scale, sizeof k->scale);
    const size_t room = sizeof out;
    for (int i = 0; i < 3; i++) {
        if (i == 1 && k->emitter == NATIVE_EMIT_LINE) continue;
        const size_t len = i == 0   ? native_encode_descriptor(out, room, &d, 1, 0)
                           : i == 1 ? native_encode_emitter(out, room, &e, NULL, 1, 0)
                                    : native_encode_anchor(out, room, &anchor, 1, 0);
        native_finish_frame(out, rig_next_seq());
        put_all(head, out, len);
    }
    put_points(head, N, 0);
    do
        if (scanhead_next(sh, frame, WAIT_MS) != 0) fail_msg("%s: %s", k->name, scanhead_error(sh));
    while (frame->type != SCANHEAD_POINTS);
    assert_int_equal(frame->n_points, N);
    close(head);
    return sh;
}

/* ---- comparing */

struct room {
    double figure[FIGURES][N + GUARD];
    int64_t t_ns[N + GUARD];
    uint16_t label[N + GUARD];
    uint8_t echo[N + GUARD], echo_count[N + GUARD];
};
static struct room room;
static struct scanhead_point want[N], got[N];

static struct scanhead_columns all_columns(void)
{
    return (struct scanhead_columns){.x = room.figure[0],
                                     .y = room.figure[1],
                                     .z = room.figure[2],
                                     .range_m = room.figure[3],
                                     .mirror_rad = room.figure[4],
                                     .pan_rad = room.figure[5],
                                     .reflectance_db = room.figure[6],
                                     .t_ns = room.t_ns,
                                     .label = room.label,
                                     .echo = room.echo,
                                     .echo_count = room.echo_count};
}

static const double *figures_of(const struct scanhead_point *p)
{
    _Static_assert(offsetof(struct scanhead_point, reflectance_db) == 6 * sizeof(double), "seven figures in a row");
    return &p->x;
}

/* NaN has many forms, and all of them say the same. Geodetic ranges are differences of places up to 8.5e6 m from the
 * middle of the Earth. The plain formula rounds angles up to 395 degrees to 4e-16 rad and multiplies them, which moves
 * places by 8e-9 m; latitudes add as much, and the products less. */
static int is_same(const struct kind *k, int j, double x, double y)
{
    const int rounds = k->crs == NATIVE_CRS_GEODETIC && j == 3;
    return memcmp(&x, &y, sizeof x) == 0 || (isnan(x) && isnan(y)) || (rounds && fabs(x - y) < 2e-8);
}

static void expect_points(const struct kind *k)
{
    for (uint32_t i = 0; i < N; i++) {
        for (int j = 0; j < FIGURES; j++)
            if (!is_same(k, j, figures_of(&got[i])[j], figures_of(&want[i])[j]))
                fail_msg("%s: figure %d of point %u is %.17g; the formula says %.17g", k->name, j, i,
                         figures_of(&got[i])[j], figures_of(&want[i])[j]);
        assert_int_equal(got[i].t_ns, want[i].t_ns);
        assert_int_equal(got[i].label, want[i].label);
        assert_int_equal(got[i].echo, want[i].echo);
        assert_int_equal(got[i].echo_count, want[i].echo_count);
    }
}

/* The n points from `first` on are in the columns; after them `room` is as it was. */
static void expect_columns(const struct kind *k, const struct scanhead_columns *to, uint32_t first, uint32_t n)
{
    const double *const figure[FIGURES] = {
        to->x, to->y, to->z, to->range_m, to->mirror_rad, to->pan_rad, to->reflectance_db};
    const struct scanhead_point *p = &want[n > 0 ? first : 0];
    for (int j = 0; j < FIGURES; j++)
        for (uint32_t i = 0; figure[j] != NULL && i < n; i++)
            if (!is_same(k, j, figure[j][i], figures_of(&p[i])[j]))
                fail_msg("%s: figure %d of point %u is %.17g; the formula says %.17g", k->name, j, first + i,
                         figure[j][i], figures_of(&p[i])[j]);
    for (uint32_t i = 0; i < n; i++) {
        assert_true(to->t_ns == NULL || to->t_ns[i] == p[i].t_ns);
        assert_true(to->label == NULL || to->label[i] == p[i].label);
        assert_true(to->echo == NULL || to->echo[i] == p[i].echo);
        assert_true(to->echo_count == NULL || to->echo_count[i] == p[i].echo_count);
    }
    static const uint8_t untouched[sizeof(double) * GUARD] = {[0] = 0};
    for (int j = 0; j < FIGURES; j++)
        assert_memory_equal(&room.figure[j][figure[j] != NULL ? n : 0], untouched, sizeof untouched);
    assert_memory_equal(&room.t_ns[to->t_ns != NULL ? n : 0], untouched, sizeof untouched);
    assert_memory_equal(&room.label[to->label != NULL ? n : 0], untouched, sizeof *room.label * GUARD);
    assert_memory_equal(&room.echo[to->echo != NULL ? n : 0], untouched, GUARD);
    assert_memory_equal(&room.echo_count[to->echo_count != NULL ? n : 0], untouched, GUARD);
}

static void check_columns(struct scanhead *sh, const struct scanhead_frame *frame, const struct kind *k,
                          const struct scanhead_columns *to, uint32_t first, uint32_t max)
{
    memset(&room, 0, sizeof room);
    const uint32_t left = first < N ? N - first : 0, n = left < max ? left : max;
    assert_int_equal(scanhead_columns(sh, frame, first, to, max), n);
    expect_columns(k, to, first, n);
}

/* ---- the tests */

/* Makes rows of a kind and the points that are wanted of them. Returns the client that has the frame. */
static struct scanhead *open_kind(const struct kind *k, struct scanhead_frame *frame)
{
    make_rows(k);
    for (uint32_t i = 0; i < N; i++)
        point_plain(k, i, &want[i]);
    return open_rows(k, frame);
}

static void test_all_kinds(void **state)
{
    (void)state;
    const struct scanhead_columns all = all_columns();
    for (size_t j = 0; j < sizeof KINDS / sizeof *KINDS; j++) {
        const struct kind *k = &KINDS[j];
        struct scanhead_frame frame;
        struct scanhead *sh = open_kind(k, &frame);
        assert_int_equal(scanhead_points(sh, &frame, 0, got, N), N);
        expect_points(k);
        check_columns(sh, &frame, k, &all, 0, N + 9);
        scanhead_close(sh);
    }
}

/* Parts of a frame are written, and nothing beyond them. */
static void test_parts(void **state)
{
    static const uint32_t part[][2] = {{0, 0},   {0, 1},      {1, 7}, {5, 127},  {5, 128},
                                       {6, 129}, {2900, 256}, {N, 1}, {N + 1, 1}};
    (void)state;
    const struct scanhead_columns all = all_columns();
    for (size_t j = 0; j < sizeof KINDS / sizeof *KINDS; j++) {
        const struct kind *k = &KINDS[j];
        struct scanhead_frame frame;
        struct scanhead *sh = open_kind(k, &frame);
        for (size_t i = 0; i < sizeof part / sizeof *part; i++)
            check_columns(sh, &frame, k, &all, part[i][0], part[i][1]);
        scanhead_close(sh);
    }
}

/* Each column is written alone, or none is. */
static void test_chosen(void **state)
{
    (void)state;
    const struct scanhead_columns all = all_columns();
    const struct scanhead_columns one[] = {
        {.x = NULL},
        {.x = all.x},
        {.y = all.y},
        {.z = all.z},
        {.range_m = all.range_m},
        {.mirror_rad = all.mirror_rad},
        {.pan_rad = all.pan_rad},
        {.reflectance_db = all.reflectance_db},
        {.t_ns = all.t_ns},
        {.label = all.label},
        {.echo = all.echo},
        {.echo_count = all.echo_count},
    };
    for (size_t j = 0; j < sizeof KINDS / sizeof *KINDS; j++) {
        const struct kind *k = &KINDS[j];
        struct scanhead_frame frame;
        struct scanhead *sh = open_kind(k, &frame);
        for (size_t i = 0; i < sizeof one / sizeof *one; i++)
            check_columns(sh, &frame, k, &one[i], 3, 300);
        scanhead_close(sh);
    }
}

static void test_refused(void **state)
{
    (void)state;
    int head;
    struct scanhead_frame frame;
    const struct scanhead_columns all = all_columns();
    struct scanhead *sh = open_pair(&head);
    put_points(head, 3, 0);
    expect_frame(sh, SCANHEAD_POINTS, &frame);
    assert_int_equal(scanhead_columns(sh, &frame, 0, &all, 3), SCANHEAD_ESTATE);
    frame.payload = NULL;
    assert_int_equal(scanhead_columns(sh, &frame, 0, &all, 3), SCANHEAD_EINPUT);
    close(head);
    scanhead_close(sh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_all_kinds),
        cmocka_unit_test(test_parts),
        cmocka_unit_test(test_chosen),
        cmocka_unit_test(test_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
