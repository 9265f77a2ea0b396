/* Recorded point clouds: reading, the way back to the scene, statistics with known answers. */
#include <math.h>

#include "core/cloud.h"
#include "tests/unit/scene_files.h"

#define LENGTH(a) (sizeof(a) / sizeof *(a))

static const struct sh_report report = {.warn = keep_warning};

static int read_cloud(const char *name, const void *data, size_t len, struct cloud *c, struct sh_err *err)
{
    n_warnings = 0;
    warnings[0] = err->text[0] = '\0';
    int rc = cloud_read(write_file(name, data, len), &report, c, err);
    unlink(path);
    return rc;
}

static struct cloud must_read(const char *name, const void *data, size_t len)
{
    struct cloud c;
    struct sh_err err;
    if (read_cloud(name, data, len, &c, &err) != SH_OK) fail_msg("%s", err.text);
    return c;
}

static void must_refuse(const void *data, size_t len, const char *expected)
{
    struct cloud c;
    struct sh_err err;
    int rc = read_cloud("bad.ply", data, len, &c, &err);
    if (rc != SH_EINPUT || c.xyz_m != NULL || c.n != 0) fail_msg("for '%s': returned %d", expected, rc);
    if (!strstr(err.text, "bad.ply") || !strstr(err.text, expected) || strchr(err.text, '\n'))
        fail_msg("'%s' doesn't say '%s' in one line", err.text, expected);
}

/* The same three points in every encoding: properties out of order, some to pass over, an element before and
 * after. */
#define BODY                                                                                       \
    "comment made by a test\ncomment epsg 32633\nelement camera 1\nproperty float f\n"             \
    "element vertex 3\nproperty ushort label\nproperty double z\nproperty list uchar short tags\n" \
    "property uchar echo\nproperty double x\nproperty float reflectance\nproperty double y\n"      \
    "property int station\nelement face 1\nproperty list uchar int any\nend_header\n"

static const struct {
    double x, y, z;
    int station, label, echo, n_tags;
} POINT[3] = {
    {391438.3219301, 5819725.4599562, 114.6983941, 2, 300, 1, 2},
    {-0.1, 1e-300, 1.0 / 3.0, 65535, 0, 15, 0},
    {NAN, NAN, NAN, 1, 65535, 0, 1},
};

struct bytes {
    char data[2048];
    size_t n;
    bool big;
};

static void put(struct bytes *b, const void *value, size_t size)
{
    for (size_t i = 0; i < size; i++)
        b->data[b->n++] = ((const char *)value)[b->big ? size - 1 - i : i]; /* the host is little-endian */
}

#define PUT(b, type, value) put(b, &(type){(type)(value)}, sizeof(type))

static void make_binary(struct bytes *b, bool big)
{
    b->big = big;
    b->n = (size_t)sprintf(b->data, "ply\nformat binary_%s_endian 1.0\n" BODY, big ? "big" : "little");
    PUT(b, float, 1.5);
    for (int i = 0; i < 3; i++) {
        PUT(b, uint16_t, POINT[i].label);
        PUT(b, double, POINT[i].z);
        PUT(b, uint8_t, POINT[i].n_tags);
        for (int k = 0; k < POINT[i].n_tags; k++)
            PUT(b, int16_t, -7);
        PUT(b, uint8_t, POINT[i].echo);
        PUT(b, double, POINT[i].x);
        PUT(b, float, -12.5);
        PUT(b, double, POINT[i].y);
        PUT(b, int32_t, POINT[i].station);
    }
    PUT(b, uint8_t, 1);
    PUT(b, int32_t, 99);
}

static void make_text(struct bytes *b)
{
    b->n = (size_t)sprintf(b->data, "ply\nformat ascii 1.0\n" BODY "1.5\n");
    for (int i = 0; i < 3; i++) {
        b->n += (size_t)sprintf(b->data + b->n, "%d %.17g %d ", POINT[i].label, POINT[i].z, POINT[i].n_tags);
        for (int k = 0; k < POINT[i].n_tags; k++)
            b->n += (size_t)sprintf(b->data + b->n, "-7 ");
        b->n += (size_t)sprintf(b->data + b->n, "%d %.17g -12.5 %.17g %d\r\n", POINT[i].echo, POINT[i].x,
                                POINT[i].y, POINT[i].station);
    }
    b->n += (size_t)sprintf(b->data + b->n, "1 99\n\n");
}

static void check_points(struct cloud c)
{
    assert_int_equal(c.n, 3);
    assert_int_equal(c.epsg, 32633);
    for (int i = 0; i < 3; i++) {
        const double expected[3] = {POINT[i].x, POINT[i].y, POINT[i].z};
        for (int k = 0; k < 3; k++)
            assert_true(c.xyz_m[i][k] == expected[k] || (isnan(c.xyz_m[i][k]) && isnan(expected[k])));
        assert_int_equal(c.station[i], POINT[i].station);
        assert_int_equal(c.label[i], POINT[i].label);
        assert_int_equal(c.echo[i], POINT[i].echo);
    }
    assert_int_equal(n_warnings, 2);
    assert_non_null(strstr(warnings, "element 'camera' (1 of it) passed over"));
    assert_non_null(strstr(warnings, "element 'face' (1 of it) passed over"));
    cloud_free(&c);
}

static void all_encodings_are_read(void **state)
{
    (void)state;
    struct bytes b;
    for (int big = 0; big < 2; big++) {
        make_binary(&b, big);
        check_points(must_read("points.ply", b.data, b.n));
        for (size_t len = 0; len < b.n; len++)
            must_refuse(b.data, len, "");
    }
    make_text(&b);
    check_points(must_read("points.ply", b.data, b.n));
}

#define TEXT "ply\nformat ascii 1.0\n"
#define XYZ  "property float x\nproperty float y\nproperty float z\n"

static void what_is_missing_is_told_apart(void **state)
{
    (void)state;
    static const char bare[] = TEXT "comment epsg none\nelement vertex 2\n" XYZ "end_header\n1 2 3\n4 5 6";
    struct cloud c = must_read("bare.ply", bare, sizeof bare - 1);
    assert_int_equal(c.n, 2);
    assert_null(c.station);
    assert_null(c.label);
    assert_null(c.echo);
    assert_int_equal(c.epsg, CLOUD_EPSG_UNKNOWN);
    assert_true(c.xyz_m[1][2] == 6);
    assert_int_equal(n_warnings, 0);
    cloud_free(&c);
    static const char none[] = TEXT "element vertex 0\n" XYZ "end_header\n";
    c = must_read("none.ply", none, sizeof none - 1);
    assert_int_equal(c.n, 0);
    cloud_free(&c);
}

static void malformed_files_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *text, *expected;
    } table[] = {
        {"", "not a PLY file"},
        {"solid ply", "not a PLY file"},
        {TEXT, "ends within the header"},
        {TEXT "element face 0\nproperty list uchar int vertex_indices\nend_header\n", "no element vertex"},
        {TEXT "element vertex 1\nproperty float x\nproperty float y\nend_header\n1 2\n",
         "lacks one of the properties x, y, z"},
        {TEXT "element vertex 1\nproperty list uchar float x\nproperty float y\nproperty float "
              "z\nend_header\n1 1 2 3\n",
         "lacks one of the properties x, y, z"},
        {TEXT "element vertex 0\n" XYZ "property int label\nproperty int label\nend_header\n",
         "twice: 'label'"},
        {TEXT "element vertex 0\n" XYZ "element vertex 0\n" XYZ "end_header\n", "vertex is there twice"},
        {TEXT "element vertex 100000000000000000\n" XYZ "end_header\n1 2 3\n",
         "100000000000000000 of element vertex"},
        {TEXT "element vertex 3\n" XYZ "end_header\n1 2 3\n4 5 6\n", "3 of element vertex need"},
        {TEXT "element vertex 2\n" XYZ "end_header\n1 2 3000000\n",
         "line 9: vertex 2 of 2: the file ends before it"},
        {TEXT "element vertex 1\n" XYZ "end_header\n1 2\n3\n", "line 8: vertex 1 of 1: a value is missing"},
        {TEXT "element vertex 1\n" XYZ "end_header\n1 2 3 4\n", "there are more values"},
        {TEXT "element vertex 1\n" XYZ "end_header\n1 2 3m\n", "not a number"},
        {TEXT "element vertex 1\n" XYZ "end_header\n1 inf 3\n",
         "line 8: vertex 1 of 1: (1 inf 3) is no position"},
        {TEXT "element vertex 1\n" XYZ "end_header\nnan nan 3\n", "(nan nan 3) is no position"},
        {TEXT "element vertex 1\n" XYZ "property int station\nend_header\n1 2 3 0\n",
         "station 0; allowed are whole"},
        {TEXT "element vertex 1\n" XYZ "property int station\nend_header\n1 2 3 65536\n", "from 1 to 65535"},
        {TEXT "element vertex 1\n" XYZ "property float label\nend_header\n1 2 3 0.5\n", "label 0.5; allowed"},
        {TEXT "element vertex 1\n" XYZ "property float label\nend_header\n1 2 3 nan\n", "label nan; allowed"},
        {TEXT "element vertex 1\n" XYZ "property char echo\nend_header\n1 2 3 -1\n", "echo -1; allowed"},
    };
    for (size_t i = 0; i < LENGTH(table); i++)
        must_refuse(table[i].text, strlen(table[i].text), table[i].expected);
    struct cloud c;
    struct sh_err err;
    assert_int_equal(cloud_read("/nowhere/at all.ply", NULL, &c, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "/nowhere/at all.ply"));
    assert_int_equal(cloud_read(folder, NULL, &c, &err), SH_EINPUT);
}

static void losses_of_the_file_are_told(void **state)
{
    (void)state;
    struct bytes b = {.big = true};
    b.n = (size_t)sprintf(b.data, "ply\nformat binary_big_endian 1.0\nelement vertex 1\n" XYZ "end_header\n");
    PUT(&b, float, 391438.25);
    PUT(&b, float, 5819725.5);
    PUT(&b, float, 1);
    PUT(&b, char, 'x');
    struct cloud c = must_read("float.ply", b.data, b.n);
    assert_int_equal(n_warnings, 2);
    assert_non_null(strstr(warnings, "1 bytes after the last element"));
    assert_non_null(strstr(warnings, "single precision, so good to 0.35 m only")); /* 5819725.5 * 6e-8 */
    cloud_free(&c);
}

/* A plate z = 0 from (0, 0) to (8, 8) as two triangles, of surface 0 (below its diagonal) and 2. */
static struct scene *make_plate(void)
{
    static const double v[4][3] = {{0, 0, 0}, {8, 0, 0}, {8, 8, 0}, {0, 8, 0}};
    static const uint32_t t[2][3] = {{0, 1, 2}, {0, 2, 3}};
    static const uint16_t label[2] = {0, 2};
    static const struct scene_surface surface[3] = {{"floor", "oak"}, {"roof", "tin"}, {"floor", "pine"}};
    struct scene *s;
    struct sh_err err;
    if (scene_from_arrays(v, 4, t, 2, label, surface, 3, &s, &err) != SH_OK) fail_msg("%s", err.text);
    return s;
}

static struct distance *make_index(const struct scene *s)
{
    struct distance *d;
    struct sh_err err;
    if (distance_create(s, &d, &err) != SH_OK) fail_msg("%s", err.text);
    return d;
}

static void offsets_from_a_plate(void **state)
{
    (void)state;
    /* Whole binary fractions: differences, feet and 3-4-5 roots are exact. */
    static double xyz[][3] = {
        {3, 1, 0},   {3, 1, 0.0009765625}, {1, 6, -0.25},         {NAN, NAN, NAN}, {12, 4, 3},
        {-3, -4, 0}, {4, 1, 10},           {4, 1, 10.0009765625}, {4, 1, -1e300},  {1, 7, 0.0078125},
    };
    static const double expected[] = {0, 0.0009765625, 0.25, NAN, 5, 5, 10, INFINITY, INFINITY, 0.0078125};
    static const uint32_t nearest[] = {
        0, 0, 1, CLOUD_TRIANGLE_NONE, 0, 0, 0, CLOUD_TRIANGLE_NONE, CLOUD_TRIANGLE_NONE, 1};
    enum { N = LENGTH(expected) };
    struct scene *s = make_plate();
    struct distance *d = make_index(s);
    const struct cloud c = {.n = N, .xyz_m = xyz, .epsg = CLOUD_EPSG_UNKNOWN};
    const struct cloud_site site = {.index = d, .n_stations = 1, .max_m = 10, .threads = 1};
    double distance_m[N];
    uint32_t triangle[N];
    assert_int_equal(cloud_compare(&c, &site, &report, distance_m, triangle, NULL), SH_OK);
    for (int i = 0; i < N; i++) {
        assert_true(distance_m[i] == expected[i] || (isnan(distance_m[i]) && isnan(expected[i])));
        if (i != 4 && i != 5)
            assert_int_equal(triangle[i], nearest[i]); /* these two lie nearest to the diagonal's ends */
    }
    struct cloud_stats stats;
    cloud_stats(distance_m, N, 0.005, &stats);
    assert_int_equal(stats.points, 9);
    assert_int_equal(stats.empty, 1);
    assert_int_equal(stats.far, 2);
    assert_int_equal(stats.beyond, 7);
    assert_int_equal(stats.worst, 7);
    assert_true(stats.max_m == 10);
    distance_free(d);
    scene_free(s);
}

static void threads_change_nothing(void **state)
{
    (void)state;
    enum { N = 30011 };
    double(*xyz)[3] = malloc(N * sizeof *xyz), *distance_m = malloc(2 * N * sizeof *distance_m);
    uint32_t *triangle = malloc(2 * N * sizeof *triangle);
    srand(7);
    for (int i = 0; i < N; i++)
        for (int k = 0; k < 3; k++)
            xyz[i][k] = i % 100 == 0 ? NAN : 16.0 * rand() / RAND_MAX - 4;
    struct scene *s = make_plate();
    struct distance *d = make_index(s);
    const struct cloud c = {.n = N, .xyz_m = xyz, .epsg = CLOUD_EPSG_UNKNOWN};
    static const unsigned threads[] = {1, 2, 7};
    for (size_t i = 0; i < LENGTH(threads); i++) {
        size_t to = i > 0 ? N : 0;
        const struct cloud_site site = {.index = d, .n_stations = 1, .max_m = 10, .threads = threads[i]};
        assert_int_equal(cloud_compare(&c, &site, NULL, distance_m + to, triangle + to, NULL), SH_OK);
        assert_memory_equal(distance_m, distance_m + to, N * sizeof *distance_m);
        assert_memory_equal(triangle, triangle + to, N * sizeof *triangle);
    }
    distance_free(d);
    scene_free(s);
    free(xyz);
    free(distance_m);
    free(triangle);
}

static const struct georef *make_georef(enum georef_crs crs, int station)
{
    /* Half a degree apart, though two metres apart in the scene: a mixed-up station is kilometres off. */
    const struct georef_spec spec = {.crs = crs,
                                     .station_m = {1.0 + 2 * station, 2, 1.5},
                                     .utm_zone = 33,
                                     .lat_deg = 52.5 + 0.5 * station,
                                     .lon_deg = 13.4,
                                     .height_m = 110};
    struct georef *g;
    struct sh_err err;
    if (georef_create(&spec, &g, &err) != SH_OK) fail_msg("%s", err.text);
    return g;
}

/* Points of two stations, 2 mm above the plate and on it, there and back. */
static void check_crs(enum georef_crs crs, int epsg)
{
    const struct georef *georef[2] = {make_georef(crs, 0), make_georef(crs, 1)};
    static const double p_prcs[4][3] = {{7, 1, 0.002}, {0.5, 7.5, 0}, {4, 4, 0.002}, {1, 2, 0}};
    uint16_t station[4] = {1, 2, 2, 1};
    double xyz[4][3], distance_m[4];
    uint32_t triangle[4];
    for (int i = 0; i < 4; i++) {
        double anchor[3], d[3], station_m[3] = {1.0 + 2 * (station[i] - 1), 2, 1.5};
        for (int k = 0; k < 3; k++)
            d[k] = p_prcs[i][k] - station_m[k];
        georef_anchor(georef[station[i] - 1], anchor);
        georef_forward(georef[station[i] - 1], 1, &d[0], &d[1], &d[2], &d[0], &d[1], &d[2]);
        for (int k = 0; k < 3; k++)
            xyz[i][k] = anchor[k] + d[k];
    }
    struct scene *s = make_plate();
    struct distance *index = make_index(s);
    struct cloud c = {.n = 4, .xyz_m = xyz, .station = station, .epsg = epsg};
    struct cloud_site site = {.index = index, .georef = georef, .n_stations = 2, .max_m = 10, .threads = 2};
    struct sh_err err;
    assert_int_equal(cloud_compare(&c, &site, NULL, distance_m, triangle, &err), SH_OK);
    /* Sums of 6e6 m round by 4.7e-10 on each axis; GeographicLib states 5 nm for its transverse Mercator,
     * each way. */
    const double tolerance_m = 1.2e-8;
    for (int i = 0; i < 4; i++)
        assert_true(fabs(distance_m[i] - p_prcs[i][2]) < tolerance_m);
    c.epsg = epsg + 1;
    assert_int_equal(cloud_compare(&c, &site, NULL, distance_m, triangle, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "EPSG"));
    c.epsg = CLOUD_EPSG_UNKNOWN;
    site.n_stations = 1;
    assert_int_equal(cloud_compare(&c, &site, NULL, distance_m, triangle, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "point 2 is of station 2; there are 1"));
    for (int i = 0; i < 2; i++)
        georef_free((struct georef *)(uintptr_t)georef[i]);
    distance_free(index);
    scene_free(s);
}

static void points_go_back_to_the_scene(void **state)
{
    (void)state;
    check_crs(GEOREF_LOCAL, 0);
    check_crs(GEOREF_ECEF, 4978);
    check_crs(GEOREF_UTM, 32633);
}

static void coverage_is_counted(void **state)
{
    (void)state;
    struct scene *s = make_plate();
    uint16_t label[4] = {1, CLOUD_LABEL_NONE, 1, 2};
    const uint32_t triangle[4] = {1, CLOUD_TRIANGLE_NONE, 1, CLOUD_TRIANGLE_NONE};
    struct cloud c = {.n = 4, .label = label};
    struct cloud_coverage cover;
    struct sh_err err;
    assert_int_equal(cloud_cover(&c, s, triangle, &cover, &err), SH_OK);
    assert_int_equal(cover.surfaces_hit, 2);
    assert_int_equal(cover.triangles_hit, 1);
    c.label = NULL;
    assert_int_equal(cloud_surface(&c, s, triangle, 0), 2);
    assert_int_equal(cloud_surface(&c, s, triangle, 1), CLOUD_LABEL_NONE);
    assert_int_equal(cloud_cover(&c, s, triangle, &cover, &err), SH_OK);
    assert_int_equal(cover.surfaces_hit, 1);
    c.label = label;
    label[2] = 3;
    assert_int_equal(cloud_cover(&c, s, triangle, &cover, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "point 3 has label 3; the scene has 3 surfaces"));
    scene_free(s);
}

/* 1 to 1000 in a stirred order, between shots without echo: sums in closed form. */
static void statistics_of_whole_numbers(void **state)
{
    (void)state;
    enum { N = 1000 };
    double d[2 * N];
    for (int i = 0; i < N; i++) {
        d[2 * i] = NAN;
        d[2 * i + 1] = i * 389 % N + 1; /* 389 is prime: each once */
    }
    struct cloud_stats s;
    cloud_stats(d, 2 * N, 950, &s);
    assert_int_equal(s.points, N);
    assert_int_equal(s.empty, N);
    assert_int_equal(s.far, 0);
    assert_int_equal(s.beyond, 50); /* 950 itself isn't beyond */
    assert_true(s.mean_m == (N + 1) / 2.0);
    assert_true(s.rms_m == sqrt((N + 1) * (2 * N + 1) / 6.0));
    assert_true(s.p50_m == 500 && s.p95_m == 950 && s.p999_m == 999 && s.max_m == 1000);
    assert_true(d[s.worst] == 1000);
    d[0] = INFINITY;
    cloud_stats(d, 2 * N, 950, &s);
    assert_int_equal(s.far, 1);
    assert_int_equal(s.beyond, 51);
    assert_int_equal(s.worst, 0);
    assert_true(s.mean_m == (N + 1) / 2.0 && s.max_m == 1000);
}

static void statistics_of_little(void **state)
{
    (void)state;
    static const double one[] = {0.25}, same[] = {0.5, 0.5, 0.5}, none[] = {NAN, INFINITY};
    struct cloud_stats s;
    cloud_stats(one, 1, 1, &s);
    assert_true(s.mean_m == 0.25 && s.rms_m == 0.25 && s.p50_m == 0.25 && s.p999_m == 0.25 &&
                s.max_m == 0.25);
    assert_int_equal(s.worst, 0);
    cloud_stats(same, 3, 0, &s);
    assert_true(s.p50_m == 0.5 && s.p95_m == 0.5);
    assert_int_equal(s.beyond, 3);
    assert_int_equal(s.worst, 0);
    cloud_stats(none, 2, 1, &s);
    assert_true(isnan(s.mean_m) && isnan(s.p50_m) && isnan(s.max_m));
    assert_int_equal(s.points, 1);
    assert_int_equal(s.worst, 1);
    cloud_stats(none, 1, 1, &s);
    assert_int_equal(s.points, 0);
    assert_int_equal(s.worst, 1);
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Against sorting, over all magnitudes a double has. */
static void percentiles_are_nearest_ranks(void **state)
{
    (void)state;
    srand(11);
    for (size_t n = 1; n < 2600; n += n / 3 + 1) {
        double d[2600], sorted[2600];
        for (size_t i = 0; i < n; i++)
            sorted[i] = d[i] = rand() % 9 == 0 ? 0 : ldexp(rand(), rand() % 1900 - 1000);
        qsort(sorted, n, sizeof *sorted, by_value);
        struct cloud_stats s;
        cloud_stats(d, n, 1, &s);
        assert_true(s.p50_m == sorted[(n * 500 + 999) / 1000 - 1]);
        assert_true(s.p95_m == sorted[(n * 950 + 999) / 1000 - 1]);
        assert_true(s.p999_m == sorted[(n * 999 + 999) / 1000 - 1]);
        assert_true(s.max_m == sorted[n - 1]);
    }
}

/* Where adding in double drifts: a million equal values. */
static void sums_do_not_drift(void **state)
{
    (void)state;
    enum { N = 1000000 };
    double *d = malloc(N * sizeof *d), naive = 0;
    for (int i = 0; i < N; i++)
        naive += d[i] = 0.1;
    struct cloud_stats s;
    cloud_stats(d, N, 1, &s);
    assert_true(fabs(naive / N - 0.1) > 1e-13); /* or this test shows nothing */
    /* The long double sum is off by N * 2^-64 at most, relatively: 5.4e-14; half as much below the root. */
    assert_true(fabs(s.mean_m - 0.1) < 0.1 * (N * 0x1p-64 + 0x1p-52));
    assert_true(fabs(s.rms_m - 0.1) < 0.1 * (N * 0x1p-64 + 0x1p-52));
    free(d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_encodings_are_read),        cmocka_unit_test(what_is_missing_is_told_apart),
        cmocka_unit_test(malformed_files_are_refused),   cmocka_unit_test(losses_of_the_file_are_told),
        cmocka_unit_test(offsets_from_a_plate),          cmocka_unit_test(threads_change_nothing),
        cmocka_unit_test(points_go_back_to_the_scene),   cmocka_unit_test(coverage_is_counted),
        cmocka_unit_test(statistics_of_whole_numbers),   cmocka_unit_test(statistics_of_little),
        cmocka_unit_test(percentiles_are_nearest_ranks), cmocka_unit_test(sums_do_not_drift),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
