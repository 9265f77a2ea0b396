/* SPDX-License-Identifier: MIT */
/* `scanhead view` and a recording: files become points, points and triangles become bytes, queries become answers.
 * Expected values are worked out by hand. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "core/bytes.h"
#include "firmware_sim/app/studio/view/encode.h"
#include "firmware_sim/app/studio/view/serve.h"
#include "tests/common/free_fd.h"

static struct sh_err err;
static char path[64];
static int fd_before;

/* Writes a PLY file of the test's own, as text. The file's name is good until the next one. */
static const char *write_ply(const char *comments, const char *properties, int n, const char *rows)
{
    snprintf(path, sizeof path, "/tmp/test_viewed.XXXXXX.ply");
    int fd = mkstemps(path, 4);
    assert_true(fd >= 0);
    FILE *out = fdopen(fd, "w");
    fprintf(
        out,
        "ply\nformat ascii 1.0\n%selement vertex %d\nproperty double x\nproperty double y\nproperty double z\n%send_header\n%s",
        comments, n, properties, rows);
    assert_int_equal(fclose(out), 0);
    return path;
}

static void load(struct viewed *v, const char *file)
{
    if (viewed_load(v, file, NULL, &err) != SH_OK) fail_msg("%s", err.text);
    unlink(file);
}

static float float_at(const char *p)
{
    const uint32_t bits = le_get32(p);
    float f;
    memcpy(&f, &bits, sizeof f);
    return f;
}

static double double_at(const char *p)
{
    const uint64_t bits = le_get64(p);
    double d;
    memcpy(&d, &bits, sizeof d);
    return d;
}

/* ---- files */

static void a_ply_with_all_columns(void **state)
{
    struct viewed v;
    size_t size;
    (void)state;
    load(
        &v,
        write_ply(
            "comment epsg 0\ncomment idn Maker,Model,17,x\ncomment label 3 wall | lime plaster\ncomment profile "
            "sphere\ncomment label 5 door\ncomment label 65535 none\n",
            "property float range\nproperty float amplitude\nproperty uchar echo\nproperty uchar echo_count\nproperty ushort label\n"
            "property ushort station\nproperty double time\nproperty uchar red\nproperty uchar green\n"
            "property uchar blue\n",
            3,
            "1 2 3  5 20 1 2 3 7  10.5  255 0 9\n"
            "nan nan nan  nan nan 0 0 65535 7  11  0 0 0\n"
            "3 6 -1  8 30.5 2 2 65535 9  12.5  1 2 3\n"));
    assert_string_equal(v.format, "ply");
    assert_int_equal(v.points.n, 2);
    assert_int_equal(v.n_empty, 1);
    assert_int_equal(v.points.epsg, 0);
    assert_int_equal(v.points.echo[1], 2);
    assert_int_equal(v.points.label[1], CLOUD_LABEL_NONE);
    assert_int_equal(v.points.rgb[1][2], 3);
    assert_true(v.points.xyz_m[1][2] == -1);
    assert_null(cloud_array(&v.points, CLOUD_REFLECTANCE, &size));
    assert_true(v.low[CLOUD_AMPLITUDE] == 20 && v.high[CLOUD_AMPLITUDE] == 30.5);
    assert_true(v.min_m[1] == 2 && v.max_m[1] == 6 && v.min_m[2] == -1 && v.max_m[2] == 3);
    assert_true(v.origin_m[0] == 2 && v.origin_m[1] == 4 && v.origin_m[2] == 1); /* the middle */
    assert_true(v.t0_s == 10.5 && v.high[CLOUD_TIME] == 12.5);
    assert_true(v.low[CLOUD_LABEL] == 3 && v.high[CLOUD_LABEL] == 3);
    assert_true(v.low[CLOUD_RANGE] == 5 && v.high[CLOUD_RANGE] == 8);
    assert_true(v.low[CLOUD_STATION] == 7 && v.high[CLOUD_STATION] == 9);
    assert_true(v.low[CLOUD_ECHO] == 1 && v.high[CLOUD_ECHO] == 2);
    assert_true(v.low[CLOUD_ECHO_COUNT] == 2 && v.high[CLOUD_ECHO_COUNT] == 2);
    assert_true(isnan(v.low[CLOUD_RGB]) && isnan(v.high[CLOUD_REFLECTANCE]));
    assert_string_equal(v.why_no_mesh, "a .ply holds points without the scan's grid; meshes are shown of a .shs");
    assert_string_equal(v.idn, "Maker,Model,17,x");
    assert_string_equal(v.profile, "sphere");
    assert_int_equal(v.n_surfaces, 2); /* 65535 is no label */
    assert_int_equal(v.surface[1].label, 5);
    assert_string_equal(v.surface[1].object, "door");
    assert_string_equal(v.surface[1].material, "");
    assert_string_equal(v.surface[0].object, "wall");
    assert_string_equal(v.surface[0].material, "lime plaster");
    assert_int_equal(v.n_stations, 2);
    assert_int_equal(v.station[1].number, 9);
    assert_false(v.station[1].placed);
    viewed_free(&v);
}

/* On the equator at longitude 0 the axes of ECEF are up, east and north. */
static void geocentric_places_are_turned(void **state)
{
    const double tolerance_m = 1e-8; /* steps of doubles at 6.4e6 are 1e-9 */
    struct viewed v;
    (void)state;
    load(&v, write_ply("comment epsg 4978\n", "", 2, "6378137 0 0\n6378138 3 4\n"));
    assert_true(v.turned && fabs(v.lat_deg) < 1e-12 && fabs(v.lon_deg) < 1e-12 && fabs(v.height_m) < tolerance_m);
    assert_true(fabs(v.points.xyz_m[0][0]) < tolerance_m);
    assert_true(fabs(v.points.xyz_m[1][0] - 3) < tolerance_m && fabs(v.points.xyz_m[1][1] - 4) < tolerance_m &&
                fabs(v.points.xyz_m[1][2] - 1) < tolerance_m);
    viewed_free(&v);
    load(&v, write_ply("comment epsg 4979\n", "", 2, "0 0 100\n0 90 100\n"));
    const double radius_m = 6378237; /* the equator's, 100 m above it; a quarter of a turn to the east */
    assert_true(fabs(v.points.xyz_m[1][0] - radius_m) < 1e-6 && fabs(v.points.xyz_m[1][2] + radius_m) < 1e-6);
    viewed_free(&v);
}

static void wrong_files_are_refused(void **state)
{
    static const struct {
        const char *path, *says;
    } cases[] = {{"-", "standard input"},      {"a.e57", "CloudCompare"},  {"a.ptx", "-o scan.ply"},
                 {"a.yaml", "--view"},         {"a.laz", "compressed"},    {"a.xyz", "FILE.las"},
                 {".ply", "with this ending"}, {"/nowhere.shs", "No such"}};
    struct viewed v;
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        assert_int_equal(viewed_load(&v, cases[i].path, NULL, &err), SH_EINPUT);
        if (strstr(err.text, cases[i].says) == NULL) fail_msg("%s: %s", cases[i].path, err.text);
        viewed_free(&v);
    }
    assert_int_equal(viewed_load(&v, write_ply("", "", 1, "nan nan nan\n"), NULL, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "it has no points, but 1 shots without echo"));
    unlink(path);
    viewed_free(&v);
}

/* ---- bytes */

enum { N = 5 };

/* Five points are on a line, of stations 1 to 5; the clock begins at 100 s. */
static void fill(struct cloud *p)
{
    memset(p, 0, sizeof *p);
    assert_int_equal(cloud_make_room(p, N, 1u << CLOUD_TIME | 1u << CLOUD_STATION | 1u << CLOUD_RGB, &err), SH_OK);
    p->n = N;
    for (int i = 0; i < N; i++) {
        p->xyz_m[i][0] = 500000 + i;
        p->xyz_m[i][1] = 5e6;
        p->xyz_m[i][2] = -i;
        p->time_s[i] = 100 + 0.25 * i;
        p->station[i] = (uint16_t)(i + 1);
        memset(p->rgb[i], 10 * i, 3);
    }
}

static void points_as_bytes(void **state)
{
    const double origin_m[3] = {500001, 5e6, -1};
    struct cloud p;
    struct web_body b;
    (void)state;
    fill(&p);
    assert_int_equal(view_encode_points(&p, origin_m, 100, &(struct view_part){1, 3, 9}, &b, &err),
                     SH_OK); /* points 1 and 4 */
    /* head 56, four columns of 32: 184; xyz 24, t 8, station 4, rgb 6 and 2 to fill it up */
    assert_int_equal(b.len, 184 + 24 + 8 + 4 + 8);
    assert_memory_equal(b.bytes, "SHCL", 4);
    static const uint32_t head[] = {1, 2, 4, 1, 3, N, 0};
    for (size_t i = 0; i < sizeof head / sizeof head[0]; i++)
        assert_int_equal(le_get32(b.bytes + 4 + 4 * i), head[i]);
    assert_true(double_at(b.bytes + 40) == 5e6);
    static const struct {
        const char *name;
        uint32_t type, components, offset;
    } row[] = {{"xyz", VIEW_FLOAT32, 3, 184},
               {"t", VIEW_FLOAT32, 1, 208},
               {"station", VIEW_UINT16, 1, 216},
               {"rgb", VIEW_UINT8, 3, 220}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        const char *at = b.bytes + 56 + 32 * i;
        assert_string_equal(at, row[i].name);
        assert_int_equal(le_get32(at + 20), row[i].type);
        assert_int_equal(le_get32(at + 24), row[i].components);
        assert_int_equal(le_get32(at + 28), row[i].offset);
    }
    assert_true(float_at(b.bytes + 184) == 0 && float_at(b.bytes + 196) == 3 && float_at(b.bytes + 204) == -3);
    assert_true(float_at(b.bytes + 208) == 0.25f && float_at(b.bytes + 212) == 1);
    assert_int_equal(le_get16(b.bytes + 218), 5);
    assert_memory_equal(b.bytes + 220, "\12\12\12\50\50\50\0\0", 8);
    free(b.bytes);
    assert_int_equal(view_encode_points(&p, origin_m, 100, &(struct view_part){N, 1, 9}, &b, &err),
                     SH_OK); /* beyond the last one */
    assert_int_equal(le_get32(b.bytes + 8), 0);
    assert_int_equal(b.len, 184);
    free(b.bytes);
    cloud_free(&p);
}

static void triangles_as_bytes(void **state)
{
    uint32_t face[3][3] = {{0, 1, 2}, {2, 1, 3}, {3, 4, 2}}, order[3] = {1, 2, 0};
    float ratio[3] = {4, 1, 1.5f};
    const struct viewed_mesh m = {.first_point = 17,
                                  .n_points = N,
                                  .n_faces = 3,
                                  .face = face,
                                  .ratio = ratio,
                                  .order = order,
                                  .mean_edge_m = 0.125,
                                  .n_edges = 7};
    struct web_body b;
    (void)state;
    assert_int_equal(view_encode_mesh(&m, 1, 9, &b, &err), SH_OK);
    assert_int_equal(b.len, 40 + 2 * 16);
    assert_memory_equal(b.bytes, "SHMS", 4);
    static const uint32_t head[] = {1, 2, 1, 3, 17, N, 7};
    for (size_t i = 0; i < sizeof head / sizeof head[0]; i++)
        assert_int_equal(le_get32(b.bytes + 4 + 4 * i), head[i]);
    assert_true(double_at(b.bytes + 32) == 0.125);
    assert_int_equal(le_get32(b.bytes + 40), 3); /* face 2, then face 0 */
    assert_int_equal(le_get32(b.bytes + 52), 0);
    assert_true(float_at(b.bytes + 64) == 1.5f && float_at(b.bytes + 68) == 4);
    free(b.bytes);
}

/* ---- requests */

static int ask(struct view_serve *serve, const char *where, const char *query, struct web_body *b)
{
    err = (struct sh_err){0};
    *b = (struct web_body){0};
    return view_serve_get(serve, where, query, b, &err);
}

static void requests(void **state)
{
    static const struct {
        const char *path, *query, *says; /* "": nothing is there */
    } wrong[] = {{"/", "", ""},
                 {"/scene", "", ""},
                 {"/cloud", "first=-1", "from 0 to 4294967295"},
                 {"/cloud", "first=1.5", "whole numbers"},
                 {"/cloud", "first=", "allowed whole"},
                 {"/cloud", "first", "allowed whole"},
                 {"/cloud", "first=1x", "first=1x"},
                 {"/cloud", "every=0", "from 1"},
                 {"/cloud", "count=nan", "from 1"},
                 {"/cloud", "firs=1", "allowed first count every"},
                 {"/head", "a=1", "nothing after"},
                 {"/mesh", "scan=1", "no mesh: because"},
                 {"/sparse", "per_m2=1", "no mesh: because"}};
    struct viewed v = {.path = "a/b.ply", .format = "ply", .why_no_mesh = "because"};
    struct view_serve serve = {.viewed = &v};
    struct web_body b;
    (void)state;
    fill(&v.points);
    viewed_measure(&v);
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        assert_int_equal(ask(&serve, wrong[i].path, wrong[i].query, &b), SH_EINPUT);
        const int good = wrong[i].says[0] != '\0' ? strstr(err.text, wrong[i].says) != NULL : err.text[0] == '\0';
        if (!good) fail_msg("%s?%s: %s", wrong[i].path, wrong[i].query, err.text);
    }
    assert_int_equal(ask(&serve, "/cloud", "first=3&count=1", &b), SH_OK);
    assert_int_equal(le_get32(b.bytes + 8), 1);
    assert_int_equal(le_get32(b.bytes + 16), 3);
    free(b.bytes);
    assert_int_equal(ask(&serve, "/head", "", &b), SH_OK);
    assert_non_null(strstr(b.bytes, "\"file\":\"b.ply\""));
    assert_non_null(strstr(b.bytes, "\"points\":5,"));
    assert_non_null(strstr(
        b.bytes, "{\"name\":\"t\",\"type\":\"float32\",\"components\":1,\"unit\":\"s\",\"min\":100,\"max\":101}"));
    assert_non_null(strstr(
        b.bytes, "\"bounds\":{\"min\":[500000,5000000,-4],\"max\":[500004,5000000,0]},\"origin\":[500002,5000000,-2]"));
    free(b.bytes);
    view_serve_free(&serve);
    viewed_free(&v);
}

/* Latitudes beyond a pole, and coordinates whose squares are no numbers any more, are left out and counted. */
static void places_beyond_any_are_left_out(void **state)
{
    static const char geodetic[] = "52.5 13.4 35\n95 13.4 35\n-91 0 0\n52.5 13.4 1e300\n52.5001 13.4 35\n",
                      ecef[] = "6378137 0 0\n1e307 1e307 1e307\n6378137 0 -2e12\n6378137 100 0\n";
    static const struct {
        const char *comment, *rows;
        int n, left_out;
    } file[] = {{"comment epsg 4979\n", geodetic, 5, 3}, {"comment epsg 4978\n", ecef, 4, 2}};
    (void)state;
    for (int i = 0; i < 2; i++) {
        struct viewed v;
        load(&v, write_ply(file[i].comment, "", file[i].n, file[i].rows));
        assert_int_equal(v.points.n, 2);
        assert_int_equal(v.n_left_out, file[i].left_out);
        assert_int_equal(v.n_empty, 0);
        for (uint32_t k = 0; k < 2; k++)
            for (int c = 0; c < 3; c++)
                assert_true(isfinite(v.points.xyz_m[k][c]));
        viewed_free(&v);
    }
}

static int note_free_fd(void **state)
{
    (void)state;
    fd_before = free_fd();
    return 0;
}

static int no_file_is_open(void **state)
{
    (void)state;
    return free_fd_check(fd_before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_ply_with_all_columns),
        cmocka_unit_test(geocentric_places_are_turned),
        cmocka_unit_test(places_beyond_any_are_left_out),
        cmocka_unit_test(wrong_files_are_refused),
        cmocka_unit_test(points_as_bytes),
        cmocka_unit_test(triangles_as_bytes),
        cmocka_unit_test(requests),
    };
    return cmocka_run_group_tests(tests, note_free_fd, no_file_is_open);
}
