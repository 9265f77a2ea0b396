/* SPDX-License-Identifier: MIT */
/* Recordings of a moving head, and in degrees, are read by other people's software. All formats have the same
 * points. */
#include "drivers/record/crs_wkt.h"
#include "tests/common/thorough.h"
#include "tests/wire/readers.h"

/* A yard with three walls and no roof, and a head that drives and turns in it for a second. */
static const char CONFIG[] =
    "head: {profile: full-sweep, prr_hz: 10000, lines_hz: 47, pan_deg_s: 120, pan_stop_deg: 350, frames: 1}\n"
    "scene: {meshes: [{file: yard.obj, up: z, scale: 1}]}\n"
    "stations: [{position_m: [1.5, -2.25, 0.2], heading_deg: 30, lat_deg: %s, lon_deg: %s, height_m: 110.2}]\n"
    "output: {crs: %s, layout: %s}\n"
    "noise: {range: off}\n"
    "links: [{type: \"null\"}]\n";
static const char DRIVE[] = "platform: {kind: trajectory, file: drive.csv, mount_m: [0.1, 0.2, 0.3]}\n";
static const char YARD[] = "v -20 -15 -1.5\nv 25 -15 -1.5\nv 25 18 -1.5\nv -20 18 -1.5\n"
                           "v -20 -15 4\nv 25 -15 4\nv 25 18 4\nv -20 18 4\n"
                           "o floor\nf 1 2 3 4\no south\nf 1 2 6 5\no east\nf 2 3 7 6\no north\nf 3 4 8 7\n";
static const char PATH_CSV[] = "t_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg\n0,1.5,-2.25,0.2,0,0,30\n"
                               "0.5,3.25,1.75,0.3,2,-3,75\n1,1.125,4.5,0.25,0,3,110\n";

static double stream_scale_m;

static void record(const char *lat, const char *lon, const char *crs, const char *layout, const char *platform,
                   const char *const *names)
{
    char text[2048], path[8][352];
    const char *args[32] = {"record", path[7]};
    size_t n = 2;
    wire_write_text(wire, "yard.obj", YARD);
    wire_write_text(wire, "drive.csv", PATH_CSV);
    snprintf(text, sizeof text, CONFIG, lat, lon, crs, layout);
    snprintf(text + strlen(text), sizeof text - strlen(text), "%s", platform);
    snprintf(path[7], sizeof path[7], "%s", wire_write_text(wire, "config.yaml", text));
    for (int i = 0; names[i] != NULL; i++) {
        snprintf(path[i], sizeof path[i], "%s", wire_path(wire, names[i]));
        args[n++] = "-o";
        args[n++] = path[i];
    }
    args[n++] = "--quiet";
    wire_run(wire, args, 0);
}

/* Reads the stream's points where they were hit: in the CRS, or by the library's poses in the scene. */
static void read_truth(void)
{
    static struct scanhead_point point[4096];
    struct scanhead_frame frame;
    struct scanhead_info info;
    struct scanhead *sh = client_open(wire_path(wire, "f.shs"));
    n_truth = n_first = 0;
    while (scanhead_next(sh, &frame, -1) == 0) {
        if (frame.type != SCANHEAD_POINTS) continue;
        int n = scanhead_points(sh, &frame, 0, point, 4096);
        assert_int_equal(n, frame.n_points);
        assert_int_equal(scanhead_get_info(sh, &info), 0);
        if (!info.geo) assert_int_equal(scanhead_to_scene(sh, point, (uint32_t)n, NULL), 0);
        for (int i = 0; i < n; i++)
            if (point[i].echo_count != 0) keep_truth(&point[i], 1);
        stream_scale_m = info.scale_m;
    }
    scanhead_close(sh);
    assert_true(n_truth > 2000);
}

static void check_las(const double tolerance_m)
{
    const double tolerance[N_STATIONS] = {tolerance_m};
    run_reader("las.mjs", wire_path(wire, "f.las"), wire_path(wire, "las.xyz"));
    char *text = wire_read(wire_path(wire, "las.xyz"), NULL), *points = strchr(strchr(text, '\n') + 1, '\n') + 1;
    assert_int_equal(strtoull(text, NULL, 10), n_truth);
    assert_int_equal(compare(points, 0, tolerance), n_truth);
    tell("LAS", "@loaders.gl/las", tolerance);
    free(text);
}

static void check_e57(const double tolerance_m)
{
    const double tolerance[N_STATIONS] = {tolerance_m};
    run_reader("e57.mjs", wire_path(wire, "f.e57"), wire_path(wire, "e57.xyz"));
    char *text = wire_read(wire_path(wire, "e57.xyz"), NULL);
    assert_int_equal(compare(text, 0, tolerance), n_truth);
    tell("E57", "web-e57", tolerance);
    free(text);
}

static void check_ptx(const double tolerance_m)
{
    const char *const argv[] = {"CloudCompare",  "-SILENT", "-NO_TIMESTAMP", "-O", "-GLOBAL_SHIFT", "AUTO", "f.ptx",
                                "-C_EXPORT_FMT", "ASC",     "-PREC",         "9",  "-SAVE_CLOUDS",  NULL};
    const double tolerance[N_STATIONS] = {tolerance_m};
    run_well(argv);
    char *text = wire_read(wire_path(wire, "f.asc"), NULL);
    assert_int_equal(compare(text, 0, tolerance), n_truth);
    tell("PTX", "CloudCompare", tolerance);
    free(text);
}

static void check_ply(void)
{
    char script[PATH_MAX];
    assert_non_null(realpath("tests/readers/ply.py", script));
    const char *const argv[] = {"/usr/bin/python3", script, "f.ply", "ply.xyz", NULL};
    const double tolerance[N_STATIONS] = {0};
    run_well(argv);
    char *text = wire_read(wire_path(wire, "ply.xyz"), NULL);
    assert_int_equal(compare(text, 0, tolerance), n_truth);
    tell("PLY", "Python's struct", tolerance);
    free(text);
}

static const char *const ALL[] = {"f.shs", "f.las", "f.ptx", "f.e57", "f.ply", NULL};

/* Half of the recording's step of 0.1 mm. CloudCompare adds six decimals, and floats of less than 32 m with steps of
 * 2e-6 m, rounded and transformed. */
static void test_moving_in_the_scene(void **state)
{
    wire = *state;
    record("52.5167", "13.4", "local", "polar", DRIVE, ALL);
    read_truth();
    assert_true(stream_scale_m < 1e-4);
    check_ply();
    check_ptx(5e-7 + 2e-6);
    check_las(0.5e-4 + 1e-12);
    check_e57(0.5e-4 + 1e-12);
}

/* The bounds are those of test_readers.c: steps of a double there, of E57 in turned axes, CloudCompare's floats. */
static void test_moving_in_utm(void **state)
{
    wire = *state;
    record("52.5167", "13.4", "utm", "geo", DRIVE, ALL);
    read_truth();
    check_ply();
    check_ptx(9.2e-5);
    check_las(0.5e-4 + 3e-9);
    check_e57(0.5e-4 * sqrt(3) + 3e-9);
}

/* Returns the WKT of a LAS file. */
static char *read_wkt(const char *name)
{
    size_t len, at;
    char *las = wire_read(wire_path(wire, name), &len), *wkt = NULL;
    for (at = 375; at + 54 < len && wkt == NULL; at += 54u + (uint8_t)las[at + 20] + 256u * (uint8_t)las[at + 21])
        if (strcmp(las + at + 2, "LASF_Projection") == 0) wkt = strdup(las + at + 54);
    free(las);
    assert_non_null(wkt);
    return wkt;
}

static void transform(const char *to, const char *from, double p[3])
{
    const char *const argv[] = {"cs2cs", "-f", "%.12f", "EPSG:4979", to, "place.txt", NULL};
    wire_write_text(wire, "place.txt", from);
    run_well(argv);
    char *out = wire_read(wire_path(wire, "tool.out"), NULL);
    assert_int_equal(sscanf(out, "%lf %lf %lf", &p[0], &p[1], &p[2]), 3);
    free(out);
}

/* In geodetic LAS x is longitude, and continuous across the antimeridian. The WKT makes PROJ take latitude and
 * longitude in the file's own order. Counts are the stream's, so the error is a double's steps at 180 degrees (3e-14),
 * and a reader that multiplies and adds makes two of them. */
static void test_degrees(void **state)
{
    static const char *const lon[] = {"13.4", "179.9999", "-179.9999"};
    static const char *const names[] = {"f.shs", "f.las", NULL};
    wire = *state;
    for (int k = 0; k < thorough(3, 2); k++) { /* the date line from one side, or from both */
        double middle = strtod(lon[k], NULL), lo = INFINITY, hi = -INFINITY, p[3];
        const double tolerance[N_STATIONS] = {1e-13};
        char from[64];
        record("52.5167", lon[k], "geodetic", "geo", "", names);
        read_truth();
        for (size_t i = 0; i < n_truth; i++) {
            double lat = truth[i][0];
            lo = fmin(lo, truth[i][1]);
            hi = fmax(hi, truth[i][1]);
            truth[i][0] = middle + remainder(truth[i][1] - middle, 360);
            truth[i][1] = lat;
        }
        assert_int_equal(hi - lo > 359, k > 0); /* PLY and the stream stay within -180..180 */
        run_reader("las.mjs", wire_path(wire, "f.las"), wire_path(wire, "las.xyz"));
        char *text = wire_read(wire_path(wire, "las.xyz"), NULL), *points = strchr(strchr(text, '\n') + 1, '\n') + 1;
        assert_int_equal(compare(points, 0, tolerance), n_truth);
        double bound[6];
        assert_int_equal(sscanf(strchr(text, '\n'), "%lf %lf %lf %lf %lf %lf", &bound[0], &bound[1], &bound[2],
                                &bound[3], &bound[4], &bound[5]),
                         6);
        /* 20 m to each side are 3e-4 degrees of longitude here, 1.8e-4 of latitude */
        assert_true(bound[0] < middle && bound[1] > middle && bound[1] - bound[0] < 1e-3);
        assert_true(bound[2] < 52.5167 && bound[3] > 52.5167 && bound[3] - bound[2] < 5e-4);
        free(text);
        snprintf(from, sizeof from, "52.5167 %s 110.2\n", lon[k]);
        char *wkt = read_wkt("f.las");
        transform(wkt, from, p);
        free(wkt);
        assert_true(fabs(p[0] - middle) < 1e-11 && fabs(p[1] - 52.5167) < 1e-11 && fabs(p[2] - 110.2) < 1e-9);
    }
}

/* Heights are above EGM96. PROJ does the same by our text as by EPSG's own codes, with or without its grid of the
 * geoid. */
static void test_geoid_text(void **state)
{
    static const struct {
        int epsg;
        const char *code;
    } crs[] = {{4979, "EPSG:4326+5773"},
               {32633, "EPSG:32633+5773"},
               {32720, "EPSG:32720+5773"},
               {32661, "EPSG:5041+5773"},
               {32761, "EPSG:5042+5773"}};
    wire = *state;
    for (size_t i = 0; i < sizeof crs / sizeof crs[0]; i++) {
        char wkt[CRS_WKT_MAX];
        double ours[3], theirs[3];
        const char *from = crs[i].epsg == 32720 || crs[i].epsg == 32761 ? "-81.5 -62.25 2800.5\n" : "82.5 13.4 110\n";
        assert_true(crs_wkt(crs[i].epsg, 1, wkt) > 0);
        transform(wkt, from, ours);
        transform(crs[i].code, from, theirs);
        if (crs[i].epsg == 4979) { /* EPSG's has the latitude first */
            double lat = theirs[0];
            theirs[0] = theirs[1];
            theirs[1] = lat;
        }
        for (int k = 0; k < 3; k++)
            if (!(fabs(ours[k] - theirs[k]) < 1e-8))
                fail_msg("%s, axis %d: %.9f, not %.9f", crs[i].code, k, ours[k], theirs[k]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_moving_in_the_scene, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_moving_in_utm, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_degrees, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_geoid_text, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests_name("moving readers", tests, NULL, NULL);
}
