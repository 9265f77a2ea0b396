/* SPDX-License-Identifier: MIT */
/* The place of a GeoTIFF by its tags alone, without a raster. The files are made here, byte by byte, after TIFF 6.0 and
 * BigTIFF. */
#include <math.h>

#include "core/geotiff.h"
#include "tests/common/free_fd.h"
#include "tests/unit/scene_files.h"

enum { ASCII = 2, SHORT = 3, LONG = 4, DOUBLE = 12, LONG8 = 16, MOST = 12 };

struct tag {
    unsigned tag, type;
    size_t n;
    const void *value; /* text; uint16_t; uint32_t; double; uint64_t */
};

struct made {
    struct tag tag[MOST];
    size_t n;
    int is_big_endian, is_big;
};

static struct geotiff g;
static struct sh_err err;

static size_t size_of(unsigned type)
{
    return type == ASCII ? 1 : type == SHORT ? 2 : type == LONG ? 4 : 8;
}

static void put(const struct made *m, uint8_t *to, uint64_t value, size_t size)
{
    for (size_t i = 0; i < size; i++)
        to[m->is_big_endian ? size - 1 - i : i] = (uint8_t)(value >> 8 * i);
}

static uint64_t value_of(const struct tag *t, size_t i)
{
    uint64_t v = 0;
    memcpy(&v, (const uint8_t *)t->value + i * size_of(t->type), size_of(t->type)); /* little-endian machines */
    return v;
}

/* Head, directory, then the values that don't fit into their entries. No descriptor stays open. */
static int read_made(const struct made *m)
{
    static uint8_t file[1 << 17];
    const size_t field = m->is_big ? 8 : 4, head = m->is_big ? 16 : 8, count = m->is_big ? 8 : 2;
    size_t entry = head + count, end = entry + m->n * (4 + 2 * field) + field;
    memset(file, 0, sizeof file);
    memset(file, m->is_big_endian ? 'M' : 'I', 2);
    put(m, file + 2, m->is_big ? 43 : 42, 2);
    if (m->is_big) put(m, file + 4, 8, 2);
    put(m, file + (m->is_big ? 8 : 4), head, field);
    put(m, file + head, m->n, count);
    for (size_t k = 0; k < m->n; k++, entry += 4 + 2 * field) {
        const struct tag *t = &m->tag[k];
        const size_t size = size_of(t->type), fits = t->n * size <= field, at = fits ? entry + 4 + field : end;
        put(m, file + entry, t->tag, 2);
        put(m, file + entry + 2, t->type, 2);
        put(m, file + entry + 4, t->n, field);
        if (!fits) put(m, file + entry + 4 + field, end, field);
        for (size_t i = 0; i < t->n; i++)
            put(m, file + at + i * size, value_of(t, i), size);
        if (!fits) end += t->n * size;
    }
    memset(&g, 0x55, sizeof g);
    memset(&err, 0, sizeof err);
    write_file("tags.tif", file, end);
    const int before = free_fd(), rc = geotiff_read(path, &g, &err);
    assert_int_equal(free_fd(), before);
    unlink(path);
    return rc;
}

static void add(struct made *m, unsigned tag, unsigned type, size_t n, const void *value)
{
    assert_true(m->n < MOST);
    m->tag[m->n++] = (struct tag){tag, type, n, value};
}

static void add_text(struct made *m, unsigned tag, const char *text)
{
    add(m, tag, ASCII, strlen(text) + 1, text);
}

static const uint16_t width = 5, height = 4;
static const double scale[3] = {2.0, 3.0, 0.0}, tie[18] = {1.0, 2.0, 0.0, 690000.0, 5336000.0, 0.0, 4.0, 3.0};

/* 5 x 4 cells of 2 x 3 m; the corner of cell 1, 2 is at the tie point. */
static struct made usual(void)
{
    struct made m = {.n = 0};
    add(&m, 256, SHORT, 1, &width);
    add(&m, 257, SHORT, 1, &height);
    add(&m, 33550, DOUBLE, 3, scale);
    add(&m, 33922, DOUBLE, 6, tie);
    return m;
}

static void refused(const struct made *m, const char *part)
{
    assert_int_equal(read_made(m), SH_EINPUT);
    if (strstr(err.text, part) == NULL || strstr(err.text, "tags.tif: ") == NULL)
        fail_msg("'%s', not '%s'", err.text, part);
}

static void ok(const struct made *m)
{
    if (read_made(m) != SH_OK) fail_msg("%s", err.text);
}

/* The corner is at 690000 - 2 and 5336000 + 2 * 3, and the first cell's middle is half a cell from there. */
static void expect_usual(void)
{
    assert_true(g.width == 5 && g.height == 4 && g.unit_m == 1.0 && g.crs[0] == '\0');
    assert_true(g.easting_m[0] == 690000.0 - 2.0 + 1.0 && g.easting_m[1] == 2.0 && g.easting_m[2] == 0.0);
    assert_true(g.northing_m[0] == 5336000.0 + 6.0 - 1.5 && g.northing_m[1] == 0.0 && g.northing_m[2] == -3.0);
    assert_true(g.height_m == 0.0 && g.height_scale_m == 1.0 && isnan(g.no_data));
    assert_true(!g.unit_given && !g.height_unit_given && !g.above_ellipsoid && !g.maps_heights && !g.turns_heights);
}

/* Sizes may be of 16, 32 and, in BigTIFF, 64 bits; in both byte orders. */
static void sizes_in_all_forms(void **state)
{
    (void)state;
    static const uint32_t wide[2] = {5, 4};
    static const uint64_t wider[2] = {5, 4};
    for (int form = 0; form < 4; form++)
        for (unsigned type = SHORT; type <= LONG8; type += type == LONG ? LONG8 - LONG : 1) {
            struct made m = usual();
            m.is_big_endian = form & 1;
            m.is_big = form >> 1;
            if (type == LONG8 && !m.is_big) continue;
            for (size_t k = 0; k < 2 && type != SHORT; k++)
                m.tag[k] = (struct tag){256 + (unsigned)k, type, 1,
                                        type == LONG ? (const void *)&wide[k] : (const void *)&wider[k]};
            ok(&m);
            expect_usual();
        }
}

/* A tie point without a scale is no place. Several tie points are control points. */
static void places_that_are_no_grid(void **state)
{
    (void)state;
    static const struct {
        size_t n_scale, n_tie;
        const char *part;
    } row[] = {{0, 0, "doesn't say where its cells are"}, {0, 6, "doesn't say where its cells are"},
               {3, 0, "doesn't say where its cells are"}, {3, 5, "doesn't say where its cells are"},
               {1, 6, "doesn't say where its cells are"}, {0, 7, "given by control points"},
               {0, 12, "given by control points"},        {0, 18, "given by control points"}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct made m = usual();
        m.n = 2;
        if (row[i].n_scale > 0) add(&m, 33550, DOUBLE, row[i].n_scale, scale);
        if (row[i].n_tie > 0) add(&m, 33922, DOUBLE, row[i].n_tie, tie);
        refused(&m, row[i].part);
    }
    struct made m = usual();
    m.tag[2].n = 2; /* the scale of heights may be missing */
    ok(&m);
    expect_usual();
}

static void sizes_that_are_refused(void **state)
{
    (void)state;
    static const uint16_t one = 1, two = 2;
    for (int k = 0; k < 2; k++) {
        struct made m = usual();
        m.tag[k].tag = 258; /* another tag */
        refused(&m, k == 0 ? "0 x 4 cells; allowed are at least 2 x 2" : "5 x 0 cells; allowed are at least 2 x 2");
        m = usual();
        m.tag[k].value = &one;
        refused(&m, k == 0 ? "1 x 4 cells" : "5 x 1 cells");
        m.tag[k].value = &two;
        ok(&m);
    }
}

/* GDAL's names of units. Lengths are those of EPSG: a foot is 0.3048 m, a US survey foot 1200/3937 m. */
static void names_of_units(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        double unit_m; /* 0: refused */
    } row[] = {{"m", 1.0},
               {"metre", 1.0},
               {"meter", 1.0},
               {"ft", 0.3048},
               {"foot", 0.3048},
               {"US survey foot", 1200.0 / 3937.0},
               {"us-ft", 1200.0 / 3937.0},
               {"ftUS", 1200.0 / 3937.0},
               {"f", 0.0},
               {"feet", 0.0}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        char text[128];
        struct made m = usual();
        snprintf(text, sizeof text, "<Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">%s</Item>", row[i].name);
        add_text(&m, 42112, text);
        if (row[i].unit_m == 0.0) {
            refused(&m, "allowed are m, ft, US survey foot");
            continue;
        }
        ok(&m);
        assert_true(g.height_scale_m == row[i].unit_m && g.height_unit_given && g.height_m == 0.0);
    }
}

/* Blanks may follow a number. Blanks alone are not a number. */
static void numbers_of_metadata(void **state)
{
    (void)state;
    static const struct {
        const char *scale, *offset, *part;
    } row[] = {{"0.25", "-7", NULL},        {"0.25 \t\r\n", "-7 ", NULL}, {" ", "1", "the scale of"},
               {"1", " ", "the offset of"}, {"1 m", "1", "the scale of"}, {"0", "0", "no scale of 0"}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        char text[160];
        struct made m = usual();
        snprintf(text, sizeof text, "<Item role=\"scale\">%s</Item><Item role=\"offset\">%s</Item>", row[i].scale,
                 row[i].offset);
        add_text(&m, 42112, text);
        if (row[i].part != NULL) {
            refused(&m, row[i].part);
            continue;
        }
        ok(&m);
        assert_true(g.height_scale_m == 0.25 && g.height_m == -7.0);
    }
}

/* A no-data value that is not a number is ignored, and kept for a warning. Its text has up to 62 characters. */
static void no_data_values(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        double want;
        const char *odd;
    } row[] = {{"-9999", -9999.0, ""},
               {"0", 0.0, ""},
               {"none", NAN, "none"},
               {"", NAN, ""},
               {" 1e3 ", 1000.0, ""},
               {"nan", NAN, ""},
               {"-9999 -32768", -9999.0, "-9999 -32768"},
               {"-9999 m above the geoid by", -9999.0, "-9999 m above the geoid"}};
    char text[80];
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct made m = usual();
        add_text(&m, 42113, row[i].text);
        ok(&m);
        assert_true(isnan(row[i].want) ? isnan(g.no_data) : g.no_data == row[i].want);
        assert_string_equal(g.odd_no_data, row[i].odd);
    }
    for (size_t n = 62; n <= 63; n++) {
        struct made m = usual();
        snprintf(text, sizeof text, "%0*d", (int)n, 17);
        add_text(&m, 42113, text);
        if (n == 62) {
            ok(&m);
            assert_true(g.no_data == 17.0);
        } else {
            refused(&m, "its tag 42113 has 64 bytes; allowed are up to 63");
        }
    }
}

static void set_keys(struct made *m, uint16_t keys[8], unsigned id, unsigned value)
{
    memcpy(keys, (const uint16_t[8]){1, 1, 0, 1, (uint16_t)id, 0, 1, (uint16_t)value}, 16);
    add(m, 34735, SHORT, 8, keys);
}

/* Codes 5001 to 5033 mean heights above an ellipsoid. A code whose value is in another tag is ignored. */
static void codes_of_heights(void **state)
{
    (void)state;
    static const struct {
        unsigned code;
        int above_ellipsoid;
    } row[] = {{5000, 0}, {5001, 1}, {5033, 1}, {5034, 0}, {5099, 0}, {32767, 0}};
    uint16_t keys[8];
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct made m = usual();
        set_keys(&m, keys, 4096, row[i].code);
        ok(&m);
        assert_true(g.above_ellipsoid == row[i].above_ellipsoid && !g.height_unit_given);
    }
    struct made m = usual();
    set_keys(&m, keys, 4096, 5030);
    keys[5] = 34736;
    ok(&m);
    assert_int_equal(g.above_ellipsoid, 0);
    m = usual();
    set_keys(&m, keys, 4096, 5100); /* codes of the registry begin here; there is no system 5100 */
    refused(&m, "EPSG:5100");
    m = usual();
    set_keys(&m, keys, 4099, 9002);
    ok(&m);
    assert_true(g.height_unit_given && g.height_scale_m == 0.3048);
    m = usual();
    set_keys(&m, keys, 3076, 9003);
    ok(&m);
    assert_true(g.unit_given && g.unit_m == 1200.0 / 3937.0);
    assert_true(fabs(g.easting_m[0] - 689999.0 * 1200.0 / 3937.0) < 1e-9 && g.easting_m[1] == 2.0 * 1200.0 / 3937.0);
}

/* Bounds are those of the middles, whichever way columns and rows lead. */
static void bounds_of_turned_cells(void **state)
{
    (void)state;
    static const double turn[4][4] = {{2, 0, 0, -3}, {-2, 0, 0, 3}, {1, -2, 3, 0.5}, {-1, 2, -3, -0.5}};
    for (int k = 0; k < 4; k++) {
        const double *t = turn[k], matrix[16] = {t[0], t[1], 0, 1000, t[2], t[3], 0, 2000, 0, 0, 0, 0, 0, 0, 0, 1};
        struct made m = usual();
        m.n = 2;
        add(&m, 34264, DOUBLE, 16, matrix);
        ok(&m);
        double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, bounds_m[4];
        for (int i = 0; i < 20; i++)
            for (int axis = 0; axis < 2; axis++) {
                const double at = 1000 * (axis + 1) + t[2 * axis] * (i % 5 + 0.5) + t[2 * axis + 1] * (i / 5 + 0.5);
                low[axis] = fmin(low[axis], at);
                high[axis] = fmax(high[axis], at);
            }
        geotiff_bounds(&g, bounds_m);
        assert_true(bounds_m[0] == low[0] && bounds_m[1] == low[1]);
        assert_true(bounds_m[2] == high[0] && bounds_m[3] == high[1]);
    }
}

/* A ModelTransformation counts before scale and tie point. Its third row is not used. A number there is reported,
 * unless it is 0 or a factor of 1 for heights. With less than three rows there is nothing to report. */
static void rows_of_a_transformation(void **state)
{
    (void)state;
    static const double plane[8] = {2, 0, 0, 690000.0 - 2.0, 0, -3, 0, 5336000.0 + 6.0};
    static const struct {
        double z[4];
        int turns;
    } row[] = {{{0, 0, 0, 0}, 0}, {{0, 0, 1, 0}, 0}, {{1, 0, 0, 0}, 1},
               {{0, 1, 0, 0}, 1}, {{0, 0, 2, 0}, 1}, {{0, 0, 0, 1}, 1}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++)
        for (size_t n = 8; n <= 16; n += 4) {
            double matrix[16] = {0};
            struct made m = usual();
            memcpy(matrix, plane, sizeof plane);
            memcpy(matrix + 8, row[i].z, sizeof row[i].z);
            matrix[15] = 1.0;
            m.tag[2].value = tie; /* another scale, which is not used */
            add(&m, 34264, DOUBLE, n, matrix);
            ok(&m);
            assert_int_equal(g.turns_heights, n >= 12 && row[i].turns);
            g.turns_heights = 0;
            expect_usual();
        }
    struct made m = usual();
    add(&m, 34264, DOUBLE, 7, plane); /* too short: scale and tie point count */
    ok(&m);
    expect_usual();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sizes_in_all_forms),       cmocka_unit_test(places_that_are_no_grid),
        cmocka_unit_test(sizes_that_are_refused),   cmocka_unit_test(names_of_units),
        cmocka_unit_test(numbers_of_metadata),      cmocka_unit_test(no_data_values),
        cmocka_unit_test(codes_of_heights),         cmocka_unit_test(bounds_of_turned_cells),
        cmocka_unit_test(rows_of_a_transformation),
    };
    return cmocka_run_group_tests_name("geotiff_tags", tests, make_folder, remove_folder);
}
