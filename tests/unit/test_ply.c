/* SPDX-License-Identifier: MIT */
/* These are tests of the PLY recorder. A reader of the test's own reads its files. */
#include <math.h>

#include "tests/common/thorough.h"
#include "tests/unit/ply_rig.h"

/* ---- the reader */

struct vertex {
    double x, y, z, range, time;
    float reflectance;
    unsigned echo, echo_count, label, station;
};

static size_t body;
static struct vertex vertex[64];
static int n_vertices;

static uint64_t le(const char *p, int bytes)
{
    uint64_t v = 0;
    for (int i = bytes - 1; i >= 0; i--)
        v = v << 8 | (uint8_t)p[i];
    return v;
}

static double real(const char *p)
{
    uint64_t v = le(p, 8);
    double d;
    memcpy(&d, &v, 8);
    return d;
}

static void read_binary(void)
{
    assert_int_equal(text_len, body + (size_t)n_vertices * RECORD);
    for (int i = 0; i < n_vertices; i++) {
        const char *p = text + body + (size_t)i * RECORD;
        struct vertex *v = &vertex[i];
        uint32_t bits = (uint32_t)le(p + 32, 4);
        memcpy(&v->reflectance, &bits, 4);
        v->x = real(p);
        v->y = real(p + 8);
        v->z = real(p + 16);
        v->range = real(p + 24);
        v->time = real(p + 36);
        v->echo = (unsigned)le(p + 44, 1);
        v->echo_count = (unsigned)le(p + 45, 1);
        v->label = (unsigned)le(p + 46, 2);
        v->station = (unsigned)le(p + 48, 2);
    }
}

static void read_ascii(void)
{
    char *at = text + body;
    for (int i = 0; i < n_vertices; i++) {
        struct vertex *v = &vertex[i];
        int used = 0;
        assert_int_equal(sscanf(at, "%lf %lf %lf %lf %f %lf %u %u %u %u\n%n", &v->x, &v->y, &v->z, &v->range,
                                &v->reflectance, &v->time, &v->echo, &v->echo_count, &v->label, &v->station, &used),
                         10);
        at += used;
    }
    assert_int_equal(*at, 0);
}

static const char *const properties[] = {"double x",          "double y",      "double z",   "double range",
                                         "float reflectance", "double time",   "uchar echo", "uchar echo_count",
                                         "ushort label",      "ushort station"};

/* Reads line by line, as strictly as possible: no line beyond 399 bytes, exactly these properties, comments
 * anywhere. */
static void read_ply(const char *path, int ascii)
{
    slurp(path);
    size_t n_properties = 0;
    char line[400] = "";
    n_vertices = -1;
    for (body = 0; strcmp(line, "end_header") != 0;) {
        const char *end = memchr(text + body, '\n', text_len - body);
        assert_non_null(end);
        size_t len = (size_t)(end - text) - body, first = body;
        assert_true(len < sizeof line);
        memcpy(line, text + body, len);
        line[len] = 0;
        body += len + 1;
        if (first == 0) {
            assert_string_equal(line, "ply");
        } else if (first == 4) {
            assert_string_equal(line, ascii ? "format ascii 1.0" : "format binary_little_endian 1.0");
        } else if (strncmp(line, "comment", 7) == 0) {
            assert_true(line[7] == 0 || line[7] == ' ');
        } else if (strncmp(line, "element vertex ", 15) == 0) {
            n_vertices = atoi(line + 15);
        } else if (strncmp(line, "property ", 9) == 0) {
            assert_true(n_properties < 10);
            assert_string_equal(line + 9, properties[n_properties++]);
        } else {
            assert_string_equal(line, "end_header");
        }
    }
    assert_int_equal(n_properties, 10);
    assert_in_range(n_vertices, 0, 64);
    if (ascii)
        read_ascii();
    else
        read_binary();
}

static void expect_comment(const char *comment)
{
    char *at = memmem(text, body, comment, strlen(comment));
    assert_non_null(at);
    assert_true(at[-1] == '\n' && at[strlen(comment)] == '\n');
}

static void check_geo(int first, int at, unsigned station)
{
    for (int i = first, k = at; i < N; i++) {
        if (i == 3) continue; /* shot without echo */
        const struct vertex *v = &vertex[k++];
        assert_true(v->x == 500000.25 + 1e-5 * xyz[i][0]);
        assert_true(v->y == 5e6 + 1e-5 * xyz[i][1]);
        assert_true(v->z == 400.125 + 1e-5 * xyz[i][2]);
        assert_true(v->time == (double)(5000000001 + dt[i]) / 1e9);
        if (i == 1)
            assert_true(isnan(v->reflectance));
        else
            assert_true(v->reflectance == (float)(refl[i] / 100.0));
        assert_true(v->echo == (echo[i] & 15u) && v->echo_count == echo[i] >> 4);
        assert_true(v->label == label[i] && v->station == station);
    }
}

static void test_geo(void **state)
{
    (void)state;
    struct sh_err err;
    begin_stream();
    put_surfaces(0, 3, NULL);
    put_descriptor(1, 1, 3);
    put_anchor(NATIVE_CRS_UTM, 32632, 2);
    put_points(0);
    put_descriptor(1, 2, 3);
    put_anchor(NATIVE_CRS_UTM, 32632, 3);
    put_points(0);
    assert_int_equal(record(out_path, (struct recorder_options){0}, 1, &err), 0);
    read_ply(out_path, 0);
    assert_int_equal(n_vertices, 8);
    check_geo(0, 0, 2);
    check_geo(0, 4, 3);
    assert_true(fabs(vertex[0].range - 13) < 1e-14); /* 3, 4, 12 */
    expect_comment("comment epsg 32632");
    expect_comment("comment idn Maker,Model,SN1,1.0");
    expect_comment("comment profile model");
    expect_comment("comment label 0 wall?of brick | mat"); /* a name can't end its line */
    expect_comment("comment label 2 roof | mat");
    expect_comment("comment pulses_lost 0 points_before_descriptor 0");
    assert_int_equal(access(part_path, F_OK), -1);
}

static void test_ascii(void **state)
{
    (void)state;
    struct sh_err err;
    begin_stream();
    put_descriptor(1, 1, 0);
    put_anchor(NATIVE_CRS_ECEF, 4978, 65535);
    put_points(0);
    assert_int_equal(record(out_path, (struct recorder_options){.ascii = 1, .empty_shots = 1}, 1, &err), 0);
    read_ply(out_path, 1);
    assert_int_equal(n_vertices, N);
    for (int i = 0; i < N; i++) {
        const struct vertex *v = &vertex[i];
        assert_int_equal(v->station, 65535);
        assert_int_equal(v->label, label[i]);
        assert_true(v->time == (double)(5000000001 + dt[i]) / 1e9); /* nanoseconds are printed in full */
        if (i == 3) {
            assert_true(isnan(v->x) && isnan(v->y) && isnan(v->z) && isnan(v->range));
            continue;
        }
        /* six decimals: half a micrometre, and the rounding of 5e6 as a double */
        assert_true(fabs(v->x - (500000.25 + 1e-5 * xyz[i][0])) < 0.51e-6);
        assert_true(fabs(v->y - (5e6 + 1e-5 * xyz[i][1])) < 0.51e-6);
        assert_true(fabs(v->z - (400.125 + 1e-5 * xyz[i][2])) < 0.51e-6);
    }
    assert_null(strstr(text + body, "-nan"));
}

static void test_empty_shots(void **state)
{
    (void)state;
    struct sh_err err;
    begin_stream();
    put_descriptor(1, 1, 0);
    put_anchor(NATIVE_CRS_UTM, 32632, 1);
    put_points(0);
    assert_int_equal(record(out_path, (struct recorder_options){.empty_shots = 1}, 1, &err), 0);
    read_ply(out_path, 0);
    assert_int_equal(n_vertices, N);
    const struct vertex *v = &vertex[3];
    assert_true(isnan(v->x) && isnan(v->y) && isnan(v->z) && isnan(v->range));
    assert_true(v->echo == 0 && v->echo_count == 0 && v->label == 65535);
    expect_comment("comment empty_shots kept");
}

static void test_polar(void **state)
{
    (void)state;
    struct sh_err err;
    begin_stream();
    for (int i = 0; i < N; i++) {
        a[i] = 5000; /* 5 m */
        b[i] = 0;
        c[i] = 900 * (uint32_t)i; /* forward, right, back, left */
    }
    b[4] = 900; /* up */
    put_descriptor(0, 1, 0);
    put_anchor(NATIVE_CRS_UTM, 32632, 1);
    put_points(0);
    assert_int_equal(record(out_path, (struct recorder_options){0}, 1, &err), 0);
    read_ply(out_path, 0);
    assert_int_equal(n_vertices, 4);
    static const double want[4][3] = {{15, 20, 30}, {10, 15, 30}, {5, 20, 30}, {10, 20, 35}};
    for (int i = 0; i < 4; i++) { /* 5 m times the 6e-17 of a right angle, and the rounding at 35 */
        assert_true(fabs(vertex[i].x - want[i][0]) < 1e-14);
        assert_true(fabs(vertex[i].y - want[i][1]) < 1e-14);
        assert_true(fabs(vertex[i].z - want[i][2]) < 1e-14);
        assert_true(fabs(vertex[i].range - 5) < 1e-14);
    }
    expect_comment("comment crs scene frame, metres");
    expect_comment("comment epsg 0");
}

static char note[300];

static void keep_note(void *ctx, const char *words)
{
    (void)ctx;
    snprintf(note, sizeof note, "%s", words);
}

/* Names that come after the points use the room left for them. Names without room are left out, and counted. */
static void test_late_names(void **state)
{
    (void)state;
    static const struct sh_report report = {.warn = keep_note};
    struct sh_err err;
    char name[256], comment[300];
    /* Lengths are all up to 36 and from 246 on; between them every 7th. */
    for (size_t len = 1; len < sizeof name; len += len < 36 || len >= 246 ? 1 : (size_t)thorough(1, 7)) {
        memset(name, 'n', len);
        name[len] = 0;
        begin_stream();
        put_surfaces(2, 1, NULL);
        put_descriptor(1, 1, 3);
        put_anchor(NATIVE_CRS_UTM, 32632, 2);
        put_points(0);
        put_surfaces(0, 2, name);
        if (len == sizeof name - 1) put_surfaces(3, 20, name); /* more than the descriptor has */
        assert_int_equal(record(out_path, (struct recorder_options){.report = &report}, 1, &err), 0);
        read_ply(out_path, 0);
        assert_int_equal(n_vertices, 4);
        check_geo(0, 0, 2);
        snprintf(comment, sizeof comment, "comment label 1 %s | mat", name);
        expect_comment(comment);
        expect_comment("comment label 2 roof | mat");
    }
    snprintf(comment, sizeof comment, "comment label 22 %s | mat", name);
    assert_null(strstr(text, comment));
    int n = 0;
    for (const char *at = text; (at = strstr(at, "\ncomment label ")) != NULL; at++)
        n++;
    snprintf(comment, sizeof comment, " %d names of surfaces and heads left out", 23 - n);
    assert_non_null(strstr(note, comment));
}

/* The stream ends before it has named all surfaces. */
static void test_names_that_never_come(void **state)
{
    (void)state;
    static const struct sh_report report = {.warn = keep_note};
    struct sh_err err;
    begin_stream();
    put_surfaces(2, 1, NULL);
    put_descriptor(1, 1, 3);
    put_anchor(NATIVE_CRS_UTM, 32632, 2);
    put_points(0);
    assert_int_equal(record(out_path, (struct recorder_options){.report = &report}, 1, &err), 0);
    assert_non_null(strstr(note, ": 2 surfaces have no name in the header"));
}

static void test_points_before_descriptor(void **state)
{
    (void)state;
    struct sh_err err;
    begin_stream();
    put_points(0);
    put_descriptor(1, 1, 3);
    put_points(10);
    put_anchor(NATIVE_CRS_UTM, 32632, 2);
    assert_int_equal(record(out_path, (struct recorder_options){0}, 1, &err), 0);
    read_ply(out_path, 0);
    assert_int_equal(n_vertices, 0);
    expect_comment("comment pulses_lost 0 points_before_descriptor 10");
}

static void test_losses_are_told(void **state)
{
    (void)state;
    struct sh_err err;
    struct native_event e = {.code = NATIVE_EV_OVERRUN, .b = 77};
    begin_stream();
    put_descriptor(1, 1, 3);
    put_anchor(NATIVE_CRS_UTM, 32632, 2);
    put_points(0);
    size_t len = native_encode_event(out, sizeof out, &e, 0, 0);
    native_finish_frame(out, 8); /* after 2 */
    put(len);
    put(len); /* once more */
    native_finish_frame(out, 4);
    put(len); /* too late */
    native_finish_frame(out, 0x90000000u);
    put(len); /* started again */
    assert_int_equal(record(out_path, (struct recorder_options){0}, 1, &err), 0);
    read_ply(out_path, 0);
    expect_comment("comment frames_lost 5 reader_lost 0 dropped 0 bad_payload 0");
    expect_comment("comment frames_repeated 1 frames_late 1 restarts 1");
    expect_comment("comment pulses_lost 154 points_before_descriptor 0");
}

static void test_crs_change_refused(void **state)
{
    (void)state;
    struct sh_err err;
    begin_stream();
    put_descriptor(1, 1, 3);
    put_anchor(NATIVE_CRS_UTM, 32632, 2);
    put_points(0);
    put_descriptor(1, 2, 3);
    put_anchor(NATIVE_CRS_UTM, 32633, 2);
    put_points(0);
    assert_int_equal(record(out_path, (struct recorder_options){0}, 1, &err), SH_EFORMAT);
    assert_non_null(strstr(err.text, "32633"));
    begin_stream();
    put_descriptor(1, 1, 3);
    put_anchor(NATIVE_CRS_UTM, 32632, 65536);
    put_points(0);
    assert_int_equal(record(out_path, (struct recorder_options){0}, 1, &err), SH_EFORMAT);
    assert_non_null(strstr(err.text, "65536"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_geo),
        cmocka_unit_test(test_ascii),
        cmocka_unit_test(test_empty_shots),
        cmocka_unit_test(test_polar),
        cmocka_unit_test(test_late_names),
        cmocka_unit_test(test_names_that_never_come),
        cmocka_unit_test(test_points_before_descriptor),
        cmocka_unit_test(test_losses_are_told),
        cmocka_unit_test(test_crs_change_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
