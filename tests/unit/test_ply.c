/* The recorders: what they write is read back by a reader of its own. */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/host/recorder.h"
#include "drivers/protocol/native_encode.h"

enum { N = 5, RECORD = 50 };

static char dir[] = "/tmp/test_ply_XXXXXX";
static char shs_path[64], out_path[64], part_path[64];
static uint8_t out[1 << 18];
static FILE *shs;

/* ---- a stream to record */

static const int32_t xyz[N][3] = {
    {300000, -400000, 1200000}, {-1, 1, 0}, {INT32_MAX, -INT32_MAX, 7}, {0, 0, 0}, {123456789, 5, -987654321}};
static uint32_t a[N], b[N], c[N], dt[N] = {0, 1000, 2000, 3000, 0xffffff};
static int16_t refl[N] = {-1234, INT16_MIN, 0, 5, 32767};
static uint16_t label[N] = {0, 1, 2, 0xffff, 1};
static uint8_t echo[N] = {0x11, 0x21, 0x22, 0x00, 0xff};

static void put(size_t len)
{
    assert_true(len > 0);
    assert_int_equal(fwrite(out, 1, len, shs), len);
}

static void put_descriptor(int geo, uint32_t scan, uint32_t n_surfaces)
{
    struct native_descriptor d = {.idn = "Maker,Model,SN1,1.0",
                                  .profile = "model",
                                  .scan = scan,
                                  .n_surfaces = n_surfaces,
                                  .layout = geo ? NATIVE_GEO : NATIVE_POLAR,
                                  .mirror_counts_per_turn = 3600,
                                  .pan_counts_per_turn = 3600,
                                  .range_scale_m = 1e-3};
    put(native_encode_descriptor(out, sizeof out, &d, 0, 0));
}

static void put_anchor(uint32_t crs, uint32_t epsg, uint32_t station)
{
    /* heading 90 degrees: the head's y axis (forward) is the scene's x axis */
    struct native_anchor anchor = {.crs = crs,
                                   .epsg = epsg,
                                   .station = station,
                                   .anchor = {500000.25, 5e6, 400.125},
                                   .scale_m = 1e-5,
                                   .station_m = {10, 20, 30},
                                   .rotation = {0, 1, 0, -1, 0, 0, 0, 0, 1}};
    put(native_encode_anchor(out, sizeof out, &anchor, 0, 0));
}

static void put_points(uint64_t pulse0)
{
    struct line_block block = {.pulse0 = pulse0,
                               .n_pulses = N - 1,
                               .t0_ns = 5000000001,
                               .n_points = N,
                               .dt_ns = dt,
                               .a = a,
                               .b = b,
                               .c = c,
                               .refl_cdb = refl,
                               .echo = echo,
                               .label = label};
    put(native_encode_points(out, sizeof out, &block, 0));
}

static void name_of(void *ctx, uint32_t i, const char **object, const char **material)
{
    static const char *const names[3] = {"wall\nof brick", "door", "roof"};
    *object = ctx != NULL ? ctx : names[i];
    *material = "mat";
}

static void put_surfaces(uint32_t first, uint32_t n, char *name)
{
    uint32_t done;
    put(native_encode_surfaces(out, sizeof out, first, n, 65536, name_of, name, 0, 0, &done));
    assert_int_equal(done, n);
}

static void begin_stream(void)
{
    for (int i = 0; i < N; i++) {
        a[i] = (uint32_t)xyz[i][0];
        b[i] = (uint32_t)xyz[i][1];
        c[i] = (uint32_t)xyz[i][2];
    }
    shs = fopen(shs_path, "wb");
    assert_non_null(shs);
}

/* Records the stream at shs_path; the code of the call that failed, or of close. */
static int record(const char *path, struct recorder_options options, int keep, struct sh_err *err)
{
    struct scanhead *sh;
    struct scanhead_frame frame;
    void *rec;
    if (shs != NULL) fclose(shs);
    shs = NULL;
    const struct recorder_ops *ops = recorder_find(path, err);
    assert_non_null(ops);
    assert_int_equal(scanhead_open(shs_path, &sh, NULL, 0), 0);
    int rc = ops->open(path, &options, &rec, err);
    if (rc == 0) {
        while (rc == 0 && scanhead_next(sh, &frame, -1) == 0)
            rc = ops->frame(rec, sh, &frame, err);
        int closed = ops->close(rec, rc == 0 && keep, err);
        if (rc == 0) rc = closed;
    }
    scanhead_close(sh);
    return rc;
}

/* ---- a reader of its own */

struct vertex {
    double x, y, z, range, time;
    float reflectance;
    unsigned echo, echo_count, label, station;
};

static char *text;
static size_t text_len, body;
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

static void slurp(const char *path)
{
    FILE *in = fopen(path, "rb");
    assert_non_null(in);
    free(text);
    text = calloc(1, 1 << 22);
    text_len = fread(text, 1, (1 << 22) - 1, in);
    fclose(in);
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

/* Line by line, as strict as a reader may be: no line beyond 200 bytes, properties as they are, comments
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

/* Names that come after the points: they use the room left for them, and more room than was left is made. */
static void test_late_names(void **state)
{
    (void)state;
    struct sh_err err;
    char name[256];
    for (size_t len = 1; len < sizeof name; len++) {
        memset(name, 'n', len);
        name[len] = 0;
        begin_stream();
        put_surfaces(2, 1, NULL);
        put_descriptor(1, 1, 3);
        put_anchor(NATIVE_CRS_UTM, 32632, 2);
        put_points(0);
        put_surfaces(0, 2, name);
        assert_int_equal(record(out_path, (struct recorder_options){0}, 1, &err), 0);
        read_ply(out_path, 0);
        assert_int_equal(n_vertices, 4);
        check_geo(0, 0, 2);
        char comment[300];
        snprintf(comment, sizeof comment, "comment label 1 %s | mat", name);
        expect_comment(comment);
        expect_comment("comment label 2 roof | mat");
    }
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
    native_seal(out, 6);
    put(len);
    assert_int_equal(record(out_path, (struct recorder_options){0}, 1, &err), 0);
    read_ply(out_path, 0);
    expect_comment("comment frames_lost 5 reader_lost 0 dropped 0 bad_payload 0");
    expect_comment("comment pulses_lost 77 points_before_descriptor 0");
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

static void test_whole_or_not_at_all(void **state)
{
    (void)state;
    struct sh_err err;
    FILE *old = fopen(out_path, "wb");
    fputs("old", old);
    fclose(old);
    begin_stream();
    put_descriptor(1, 1, 3);
    put_anchor(NATIVE_CRS_UTM, 32632, 2);
    put_points(0);
    assert_int_equal(record(out_path, (struct recorder_options){0}, 0, &err), 0);
    slurp(out_path);
    assert_string_equal(text, "old");
    assert_int_equal(access(part_path, F_OK), -1);
    assert_int_equal(record("/nonexistent/x.ply", (struct recorder_options){0}, 1, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "/nonexistent/x.ply"));
    char blocked[80];
    snprintf(blocked, sizeof blocked, "%s/d.ply", dir);
    assert_int_equal(mkdir(blocked, 0777), 0);
    assert_int_equal(record(blocked, (struct recorder_options){0}, 1, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, blocked));
    rmdir(blocked);
}

/* A limit on the file's size stands for the full disk: the same write fails. */
static void test_disk_full(void **state)
{
    (void)state;
    struct sh_err err;
    struct rlimit old, small = {3000, 0};
    void (*was)(int) = signal(SIGXFSZ, SIG_IGN);
    char path[80], part[96];
    begin_stream();
    put_descriptor(1, 1, 3);
    put_anchor(NATIVE_CRS_UTM, 32632, 2);
    for (int i = 0; i < 20; i++)
        put_points((uint64_t)i * 4);
    fclose(shs);
    shs = NULL;
    unlink(out_path);
    getrlimit(RLIMIT_FSIZE, &old);
    small.rlim_max = old.rlim_max;
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    int ply = record(out_path, (struct recorder_options){0}, 1, &err);
    char ply_text[512];
    snprintf(ply_text, sizeof ply_text, "%s", err.text);
    snprintf(path, sizeof path, "%s/full.shs", dir);
    snprintf(part, sizeof part, "%s.part", path);
    int raw = record(path, (struct recorder_options){0}, 1, &err);
    setrlimit(RLIMIT_FSIZE, &old);
    signal(SIGXFSZ, was);
    assert_int_equal(ply, SH_EIO);
    assert_non_null(strstr(ply_text, part_path));
    assert_int_equal(access(out_path, F_OK), -1);
    assert_int_equal(access(part_path, F_OK), -1);
    assert_int_equal(raw, SH_EIO);
    assert_non_null(strstr(err.text, part));
    assert_int_equal(access(path, F_OK), -1);
    assert_int_equal(access(part, F_OK), -1);
}

static void test_shs(void **state)
{
    (void)state;
    struct sh_err err;
    char path[80], *copy;
    begin_stream();
    put_surfaces(0, 3, NULL);
    put_descriptor(1, 1, 3);
    put_anchor(NATIVE_CRS_UTM, 32632, 2);
    for (int i = 0; i < 10000; i++) /* beyond the buffer */
        put_points((uint64_t)i * 4);
    snprintf(path, sizeof path, "%s/copy.SHS", dir);
    assert_int_equal(record(path, (struct recorder_options){0}, 1, &err), 0);
    slurp(shs_path);
    copy = text;
    text = NULL;
    size_t copy_len = text_len;
    slurp(path);
    assert_int_equal(text_len, copy_len);
    assert_memory_equal(text, copy, copy_len);
    free(copy);
    unlink(path);
}

static void test_find(void **state)
{
    (void)state;
    struct sh_err err;
    assert_string_equal(recorder_find("x.PLY", &err)->ending, ".ply");
    assert_string_equal(recorder_find("a/b.shs", &err)->ending, ".shs");
    assert_null(recorder_find("x.txt", &err));
    assert_int_equal(err.code, SH_EINPUT);
    assert_non_null(strstr(err.text, ".ply"));
    assert_null(recorder_find(".ply", &err));
}

static int set_up(void **state)
{
    (void)state;
    if (mkdtemp(dir) == NULL) return -1;
    snprintf(shs_path, sizeof shs_path, "%s/in.shs", dir);
    snprintf(out_path, sizeof out_path, "%s/out.ply", dir);
    snprintf(part_path, sizeof part_path, "%s/out.ply.part", dir);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    free(text);
    unlink(shs_path);
    unlink(out_path);
    return rmdir(dir);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_geo),
        cmocka_unit_test(test_ascii),
        cmocka_unit_test(test_empty_shots),
        cmocka_unit_test(test_polar),
        cmocka_unit_test(test_late_names),
        cmocka_unit_test(test_points_before_descriptor),
        cmocka_unit_test(test_losses_are_told),
        cmocka_unit_test(test_crs_change_refused),
        cmocka_unit_test(test_whole_or_not_at_all),
        cmocka_unit_test(test_disk_full),
        cmocka_unit_test(test_shs),
        cmocka_unit_test(test_find),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
