/* SPDX-License-Identifier: MIT */
/* These tests give recordings to other people's readers. A scan of two stations in UTM is written in each format at
 * once. Each format's own software reads it back, and each point is compared with the raw stream. A reader that is not
 * installed is skipped. */
#include "core/georef.h"
#include "drivers/record/crs_wkt.h"
#include "tests/wire/readers.h"

/* Two stations on the ground of a yard with three walls and no roof. There are shots without echo, and lines of unequal
 * length (47 lines of 10,000 pulses). The second station's degrees are close to those of its position in metres. */
static const char CONFIG[] =
    "head: {profile: full-sweep, prr_hz: 10000, lines_hz: 47, pan_deg_s: 120, pan_stop_deg: 350, frames: 1}\n"
    "scene: {meshes: [{file: yard.obj, up: z, scale: 1}]}\n"
    "stations:\n"
    "  - {position_m: [1.5, -2.25, 0.2], heading_deg: 30, lat_deg: 52.5167, lon_deg: 13.4, height_m: 110.2}\n"
    "  - {position_m: [-7.1, 3.3, 1.1], heading_deg: 215, lat_deg: 52.51674987, lon_deg: 13.39987326, height_m: "
    "111.1}\n"
    "output: {crs: utm, layout: geo}\n"
    "noise: {range: off}\n"
    "links: [{type: \"null\"}]\n";
static const char YARD[] = "v -20 -15 -1.5\nv 25 -15 -1.5\nv 25 18 -1.5\nv -20 18 -1.5\n"
                           "v -20 -15 4\nv 25 -15 4\nv 25 18 4\nv -20 18 4\n"
                           "o floor\nf 1 2 3 4\no south\nf 1 2 6 5\no east\nf 2 3 7 6\no north\nf 3 4 8 7\n";
static const double LAT_LON_H[N_STATIONS][3] = {{52.5167, 13.4, 110.2}, {52.51674987, 13.39987326, 111.1}};

static size_t n_frames;
static double scale_m, anchor[N_STATIONS][3];

/* ---- the recording, once for all tests */

static void record_all(void)
{
    static const char *const name[] = {"f.shs", "f.las", "f.ptx", "f.e57", "f.ply", "f.poses.csv", "f.pcapng"};
    enum { N = sizeof name / sizeof name[0] };
    static char path[N][352], config[352];
    const char *args[4 + 2 * N + 3] = {"record", config, "--station", "all"};
    wire_write_text(wire, "yard.obj", YARD);
    snprintf(config, sizeof config, "%s", wire_write_text(wire, "config.yaml", CONFIG));
    size_t n = 4;
    for (int i = 0; i < N; i++) {
        snprintf(path[i], sizeof path[i], "%s", wire_path(wire, name[i]));
        args[n++] = "-o";
        args[n++] = path[i];
    }
    args[n++] = "--quiet";
    wire_run(wire, args, 0);
}

static void keep_points(struct scanhead *sh, const struct scanhead_frame *frame)
{
    static struct scanhead_point point[4096];
    struct scanhead_info info;
    assert_int_equal(scanhead_get_info(sh, &info), 0);
    scale_m = info.scale_m;
    memcpy(anchor[info.station - 1], info.anchor, sizeof info.anchor);
    int n = scanhead_points(sh, frame, 0, point, 4096);
    assert_int_equal(n, frame->n_points);
    for (int i = 0; i < n; i++) {
        assert_true(point[i].echo_count <= 1);
        if (point[i].echo_count == 0) continue;
        keep_truth(&point[i], info.station);
    }
}

/* These are time and length of the first frames. */
static struct {
    int64_t t_ns;
    size_t len;
} frames[1024];

static void keep_frame(struct scanhead *sh, const struct scanhead_frame *frame)
{
    if (frame->type == SCANHEAD_POINTS) keep_points(sh, frame);
    if (n_frames < 1024) {
        frames[n_frames].t_ns = frame->t_ns;
        frames[n_frames].len = frame->raw_len;
    }
    n_frames++;
}

static int set_up(void **state)
{
    struct scanhead_frame frame;
    if (wire_setup(state) != 0) return -1;
    wire = *state;
    record_all();
    struct scanhead *sh = client_open(wire_path(wire, "f.shs"));
    while (scanhead_next(sh, &frame, -1) == 0)
        keep_frame(sh, &frame);
    scanhead_close(sh);
    assert_true(n_first > 10000 && n_truth - n_first > 10000);
    return 0;
}

/* Steps of a double at 5.8e6 m are 9e-10 m; a few operations of reader and writer are within three. */
static const double DOUBLE_M = 3e-9;

static void test_las(void **state)
{
    (void)state;
    run_reader("las.mjs", wire_path(wire, "f.las"), wire_path(wire, "las.xyz"));
    char *text = wire_read(wire_path(wire, "las.xyz"), NULL), *points = strchr(strchr(text, '\n') + 1, '\n') + 1;
    /* the first station's counts are the stream's own, the second one's are rounded to them */
    const double tolerance_m[N_STATIONS] = {DOUBLE_M, 0.5 * scale_m + DOUBLE_M};
    assert_int_equal(strtoull(text, NULL, 10), n_truth);
    assert_int_equal(compare(points, 0, tolerance_m), n_truth);
    double bound[6];
    assert_int_equal(sscanf(strchr(text, '\n'), "%lf %lf %lf %lf %lf %lf", &bound[0], &bound[1], &bound[2], &bound[3],
                            &bound[4], &bound[5]),
                     6);
    for (int i = 0; i < 3; i++) {
        double lo = INFINITY, hi = -INFINITY;
        for (size_t k = 0; k < n_truth; k++) {
            lo = fmin(lo, truth[k][i]);
            hi = fmax(hi, truth[k][i]);
        }
        assert_true(fabs(bound[2 * i] - lo) <= tolerance_m[1] && fabs(bound[2 * i + 1] - hi) <= tolerance_m[1]);
    }
    tell("LAS", "@loaders.gl/las", tolerance_m);
    free(text);
}

/* Counts in the head's axes are turned by the pose: half a step on each of three axes, which at most add up along
 * one. */
static void test_e57(void **state)
{
    (void)state;
    run_reader("e57.mjs", wire_path(wire, "f.e57"), wire_path(wire, "e57.xyz"));
    double m = 0.5 * sqrt(3) * scale_m + DOUBLE_M, tolerance_m[N_STATIONS] = {m, m};
    char *text = wire_read(wire_path(wire, "e57.xyz"), NULL);
    assert_int_equal(compare(text, 0, tolerance_m), n_truth);
    tell("E57", "web-e57", tolerance_m);
    free(text);
}

/* CloudCompare keeps coordinates as floats, less its own global shift, which is a round number within a kilometre:
 * steps of 6.1e-5 m there. Half a step is lost when it reads, when it turns and when it shifts a point: three times
 * 3.05e-5 m. (2.11 loses two of them, 2.13 all three: 6.25e-5 m was seen.) */
static void test_ptx(void **state)
{
    (void)state;
    const char *const argv[] = {"CloudCompare",  "-SILENT", "-NO_TIMESTAMP", "-O", "-GLOBAL_SHIFT", "AUTO", "f.ptx",
                                "-C_EXPORT_FMT", "ASC",     "-PREC",         "9",  "-SAVE_CLOUDS",  NULL};
    const double tolerance_m[N_STATIONS] = {9.2e-5, 9.2e-5};
    run_well(argv);
    char *first = wire_read(wire_path(wire, "f_0.asc"), NULL), *second = wire_read(wire_path(wire, "f_1.asc"), NULL);
    assert_int_equal(compare(first, 0, tolerance_m), n_first);
    assert_int_equal(compare(second, n_first, tolerance_m), n_truth - n_first);
    tell("PTX", "CloudCompare", tolerance_m);
    free(first);
    free(second);
}

static void test_ply(void **state)
{
    (void)state;
    char script[PATH_MAX];
    assert_non_null(realpath("tests/readers/ply.py", script));
    const char *const argv[] = {"/usr/bin/python3", script, "f.ply", "ply.xyz", NULL};
    const double tolerance_m[N_STATIONS] = {0, 0};
    run_well(argv);
    char *text = wire_read(wire_path(wire, "ply.xyz"), NULL);
    assert_int_equal(compare(text, 0, tolerance_m), n_truth);
    tell("PLY", "Python's struct", tolerance_m);
    free(text);
}

/* Records the stream again, in colour and in the forms of older programs or viewers. */
static void record_again(const char *name, const char *option, const char *value)
{
    char from[352], to[352];
    snprintf(from, sizeof from, "%s", wire_path(wire, "f.shs"));
    snprintf(to, sizeof to, "%s", wire_path(wire, name));
    const char *const args[] = {"record", from, "-o", to, "--colour", "label", option, value, "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
}

static void test_las_12(void **state)
{
    (void)state;
    const double tolerance_m[N_STATIONS] = {DOUBLE_M, 0.5 * scale_m + DOUBLE_M};
    record_again("f12.las", "--las-version", "1.2");
    run_reader("las.mjs", wire_path(wire, "f12.las"), wire_path(wire, "las12.xyz"));
    char *text = wire_read(wire_path(wire, "las12.xyz"), NULL), *points = strchr(strchr(text, '\n') + 1, '\n') + 1;
    assert_int_equal(strtoull(text, NULL, 10), n_truth);
    assert_int_equal(compare(points, 0, tolerance_m), n_truth);
    tell("LAS 1.2", "@loaders.gl/las", tolerance_m);
    free(text);
}

/* CloudCompare lists the loaded colours and scalar fields as columns. CloudCompare's positions are floats, as for
 * PTX. */
static void test_ply_cloudcompare(void **state)
{
    (void)state;
    const char *const argv[] = {
        "CloudCompare",  "-SILENT", "-NO_TIMESTAMP", "-O", "-GLOBAL_SHIFT", "AUTO",         "cc.ply",
        "-C_EXPORT_FMT", "ASC",     "-PREC",         "9",  "-ADD_HEADER",   "-SAVE_CLOUDS", NULL};
    const double tolerance_m[N_STATIONS] = {9.2e-5, 9.2e-5};
    static const char header[] = "//X Y Z R G B range reflectance time echo echo_count label station";
    record_again("cc.ply", "--ply-names", "cloudcompare");
    run_well(argv);
    char *text = wire_read(wire_path(wire, "cc.asc"), NULL);
    assert_memory_equal(text, header, sizeof header - 1);
    assert_int_equal(compare(strchr(text, '\n') + 1, 0, tolerance_m), n_truth);
    tell("PLY", "CloudCompare", tolerance_m);
    free(text);
}

/* The Point Cloud Library knows our properties and counts the same. */
static void test_ply_pcl(void **state)
{
    (void)state;
    const char *const argv[] = {"pcl_ply2pcd", "f.ply", "f.pcd", NULL};
    run_well(argv);
    char *text = wire_read(wire_path(wire, "f.pcd"), NULL), want[64];
    snprintf(want, sizeof want, "\nPOINTS %zu\n", n_truth);
    assert_non_null(strstr(text, want));
    assert_non_null(strstr(text, "\nFIELDS x y z range reflectance time echo echo_count label station\nSIZE 8 8 8 8 "));
    free(text);
}

/* There are as many packets as frames, of the same length, with their times to the nanosecond. */
static void test_pcapng(void **state)
{
    (void)state;
    const char *const argv[] = {"tshark",           "-n", "-r",        "f.pcapng", "-T", "fields", "-e",
                                "frame.time_epoch", "-e", "frame.len", NULL};
    run_well(argv);
    char *text = wire_read(wire_path(wire, "tool.out"), NULL), *at = text;
    size_t n = 0;
    for (; *at != 0; n++) {
        long long s, ns;
        size_t len;
        int used;
        assert_int_equal(sscanf(at, "%lld.%9lld %zu%n", &s, &ns, &len, &used), 3);
        if (n < 1024) {
            assert_int_equal(s * 1000000000 + ns, frames[n].t_ns);
            assert_int_equal(len, frames[n].len);
        }
        at += used + 1;
    }
    assert_int_equal(n, n_frames);
    free(text);
}

/* The LAS file's CRS, by PROJ, takes the stations' degrees to the positions in .poses.csv. */
static void test_crs(void **state)
{
    (void)state;
    size_t len, at;
    char *las = wire_read(wire_path(wire, "f.las"), &len), *wkt = NULL, from[128] = "";
    for (at = 375; at + 54 < len && wkt == NULL; at += 54u + (uint8_t)las[at + 20] + 256u * (uint8_t)las[at + 21])
        if (strcmp(las + at + 2, "LASF_Projection") == 0) wkt = las + at + 54;
    assert_non_null(wkt);
    for (int i = 0; i < N_STATIONS; i++) {
        snprintf(from, sizeof from, "%.8f %.8f %.1f\n", LAT_LON_H[i][0], LAT_LON_H[i][1], LAT_LON_H[i][2]);
        wire_write_text(wire, "station.txt", from);
        const char *const argv[] = {"cs2cs", "-f", "%.6f", "EPSG:4979", wkt, "station.txt", NULL};
        double p[3], pose[3];
        run_well(argv);
        char *out = wire_read(wire_path(wire, "tool.out"), NULL),
             *csv = wire_read(wire_path(wire, "f.poses.csv"), NULL), *row = csv;
        assert_int_equal(sscanf(out, "%lf %lf %lf", &p[0], &p[1], &p[2]), 3);
        for (int k = 0; k <= i; k++)
            row = strchr(row, '\n') + 1;
        unsigned scan, station, epsg;
        assert_int_equal(sscanf(row, "%u,%u,%u,%lf,%lf,%lf", &scan, &station, &epsg, &pose[0], &pose[1], &pose[2]), 6);
        assert_int_equal(scan, i + 1);
        assert_int_equal(station, i + 1);
        assert_int_equal(epsg, 32633);
        for (int k = 0; k < 3; k++) {
            assert_true(fabs(p[k] - anchor[i][k]) < 1e-5); /* two series for the same projection, six decimals */
            assert_true(fabs(pose[k] - anchor[i][k]) < 1e-9);
        }
        free(out);
        free(csv);
    }
    free(las);
}

/* Every kind of CRS is compared, by PROJ and by GeographicLib. */
static void test_all_crs(void **state)
{
    (void)state;
    static const struct georef_spec spec[] = {{.crs = GEOREF_ECEF, .lat_deg = -33.9, .lon_deg = 18.4, .height_m = 55},
                                              {.crs = GEOREF_UTM, .lat_deg = -33.9, .lon_deg = 18.4, .height_m = 55},
                                              {.crs = GEOREF_UTM, .lat_deg = 83.5, .lon_deg = -179, .height_m = -3},
                                              {.crs = GEOREF_UTM, .lat_deg = 87, .lon_deg = -120, .height_m = 8},
                                              {.crs = GEOREF_UTM, .lat_deg = -85, .lon_deg = 70, .height_m = 2800}};
    for (size_t i = 0; i < sizeof spec / sizeof spec[0]; i++) {
        struct georef *georef;
        struct sh_err err = {0};
        char wkt[CRS_WKT_MAX], from[128];
        double want[3], p[3];
        assert_int_equal(georef_create(&spec[i], &georef, &err), 0);
        georef_anchor(georef, want);
        crs_wkt(georef_epsg(georef), 0, wkt);
        georef_free(georef);
        snprintf(from, sizeof from, "%.8f %.8f %.1f\n", spec[i].lat_deg, spec[i].lon_deg, spec[i].height_m);
        wire_write_text(wire, "station.txt", from);
        const char *const argv[] = {"cs2cs", "-f", "%.6f", "EPSG:4979", wkt, "station.txt", NULL};
        run_well(argv);
        char *out = wire_read(wire_path(wire, "tool.out"), NULL);
        assert_int_equal(sscanf(out, "%lf %lf %lf", &p[0], &p[1], &p[2]), 3);
        for (int k = 0; k < 3; k++)
            if (!(fabs(p[k] - want[k]) < 1e-5)) fail_msg("case %zu axis %d: %.6f, not %.6f", i, k, p[k], want[k]);
        free(out);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_las),     cmocka_unit_test(test_e57),
        cmocka_unit_test(test_ptx),     cmocka_unit_test(test_ply),
        cmocka_unit_test(test_ply_pcl), cmocka_unit_test(test_pcapng),
        cmocka_unit_test(test_las_12),  cmocka_unit_test(test_ply_cloudcompare),
        cmocka_unit_test(test_crs),     cmocka_unit_test(test_all_crs),
    };
    return cmocka_run_group_tests(tests, set_up, wire_teardown);
}
