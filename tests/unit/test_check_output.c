/* SPDX-License-Identifier: MIT */
/* The lines of `scanhead check`: scanners, target, anchors of all kinds, platform, output, links and time. Positions
 * are chosen so that their figures are known by hand. Run from the top of the source tree. */
#include "firmware_sim/app/app.h"
#include "tests/unit/output_rig.h"
#include "tests/unit/site_rig.h"

#include <math.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <netinet/in.h>

#include "firmware_sim/device/head_clock.h"

enum { MOST_SETS = 8 };

/* A floor of 60 x 60 m around (x, y), and a triangle on it. */
static void write_scene(double x, double y, double z)
{
    char text[512];
    snprintf(text, sizeof text,
             "o floor\nv %.3f %.3f %.3f\nv %.3f %.3f %.3f\nv %.3f %.3f %.3f\nv %.3f %.3f %.3f\nf 1 2 3 4\n"
             "o pole\nusemtl b\nv %.3f %.3f %.3f\nv %.3f %.3f %.3f\nv %.3f %.3f %.3f\nf 5 6 7\n",
             x - 30, y - 30, z, x + 30, y - 30, z, x + 30, y + 30, z, x - 30, y + 30, z, x + 5, y + 5, z, x + 6, y + 5,
             z, x + 6, y + 5, z + 2);
    write_in("scene.obj", text);
}

/* Returns what `check` prints with these settings; free it. */
static char *checked(const char *stations, const char *const *set)
{
    char text[2048], name[] = "check", path[128], option[] = "--set", *argv[3 + 2 * MOST_SETS] = {name, path}, *kept[8];
    struct output output;
    int argc = 2, n = 0;
    snprintf(text, sizeof text,
             "head: {profile: full-sweep, prr_hz: 20000, lines_hz: 100, pan_deg_s: 240, frames: 1}\n"
             "scene: {meshes: [{file: scene.obj, up: z, scale: 1}]}\nstations: [%s]\n"
             "output: {crs: local, layout: polar}\nlinks: [{type: \"null\"}]\n",
             stations);
    write_in("test.yaml", text);
    snprintf(path, sizeof path, "%s", config_path);
    for (; set[n] != NULL; n++) {
        argv[argc++] = option;
        argv[argc++] = kept[n] = strdup(set[n]);
    }
    output_take(&output, stdout);
    const int status = app_check.run(argc, argv);
    char *said = output_give(&output);
    while (n > 0)
        free(kept[--n]);
    if (status != APP_OK) fail_msg("status %d", status);
    return said;
}

/* A whole line, or its beginning where it ends with ... */
static void has(const char *text, const char *line)
{
    const size_t len = strlen(line), n = len > 3 && strcmp(line + len - 3, "...") == 0 ? len - 3 : len;
    for (const char *at = text; (at = strstr(at, "\n")) != NULL && at[1] != '\0'; at++)
        if (strncmp(at + 1, line, n) == 0 && (n < len || at[1 + n] == '\n')) return;
    fail_msg("no line %s in %s", line, text);
}

static void has_not(const char *text, const char *begin)
{
    char line[64];
    snprintf(line, sizeof line, "\n%s", begin);
    if (strstr(text, line) != NULL) fail_msg("%s in %s", begin, text);
}

#define ONE    "{name: one, position_m: [0, 0, 2]}"
#define PLACED "{name: one, position_m: [0, 0, 2], lat_deg: 52, lon_deg: 15, height_m: 40}"

static void a_plain_scene(void **state)
{
    (void)state;
    char first[160];
    write_scene(0, 0, 0);
    char *text = checked(ONE, (const char *const[]){NULL});
    snprintf(first, sizeof first, "%s: ok\n", config_path);
    assert_int_equal(strncmp(text, first, strlen(first)), 0);
    has(text, "head      scanhead full sweep (full-sweep), 20000 Hz pulses, 100 lines/s, pan 240 deg/s");
    has(text, "scene     3 triangles, 2 surfaces, x -30.000..30.000  y -30.000..30.000  z 0.000..2.000 m");
    double mb, each, peak_mb;
    struct rusage usage;
    const char *memory = strstr(text, "\nmemory ");
    assert_non_null(memory);
    assert_int_equal(sscanf(memory, " memory %lf MB for meshes and BVH, %lf bytes a triangle; %lf MB at the peak", &mb,
                            &each, &peak_mb),
                     3);
    getrusage(RUSAGE_SELF, &usage);
    /* The figures agree for 3 triangles, up to their four digits. The peak was no higher then than now. */
    assert_true(fabs(3.0 * each - 1e6 * mb) <= 1.5 + 1e3 * mb && peak_mb > 1.0);
    assert_true(peak_mb <= 1024e-6 * (double)usage.ru_maxrss * 1.001);
    has(text, "anchor    none: each station has a place of its own, with the scene's y axis as its true north");
    has(text, "station 1 one, EPSG 0, anchor 0.000000 0.000000 2.000000");
    has(text, "  scene     0.0000 0.0000 2.0000 m; heading 0, pitch 0, roll 0 deg");
    has(text, "output    polar, 1e-06 m per count");
    has(text, "link      null, native");
    for (const char *const *not_there = (const char *const[]){"range ", "target ", "platform ", "stops ", "waveforms ",
                                                              "time ", "  geodetic ", "objects ", NULL};
         *not_there != NULL; not_there++)
        has_not(text, *not_there);
    free(text);
}

/* Each of 1000 copies has the 3 triangles of the mesh, which is kept once. */
static void memory_is_that_of_a_triangle_of_the_scene(void **state)
{
    (void)state;
    char set[200], *copies = malloc(20000);
    double mb, each;
    assert_non_null(copies);
    int n = snprintf(copies, 20000, "x_m,y_m,z_m\n");
    for (int i = 0; i < 1000; i++)
        n += snprintf(copies + n, 20000 - (size_t)n, "%d,0,0\n", 100 * i);
    write_scene(0, 0, 0);
    write_in("copies.csv", copies);
    free(copies);
    snprintf(set, sizeof set, "scene.meshes[0].copies=%.*s/copies.csv", (int)(strrchr(config_path, '/') - config_path),
             config_path);
    char *text = checked(ONE, (const char *const[]){set, NULL});
    has(text, "scene     3000 triangles, 2 surfaces, 1000 copies (3 triangles are kept), ...");
    assert_int_equal(
        sscanf(strstr(text, "\nmemory "), " memory %lf MB for meshes and BVH, %lf bytes a triangle;", &mb, &each), 2);
    assert_true(fabs(3000.0 * each - 1e6 * mb) <= 1500.0 + 1e3 * mb);
    free(text);
}

/* A window has 28 bytes and two for each sample, of an even number: 84 bytes, 20,000 times in a second. */
static void waveforms(void **state)
{
    (void)state;
    write_scene(0, 0, 0);
    char *text = checked(ONE, (const char *const[]){"waveform.send=on", "signal.model=on", NULL});
    has(text, "waveforms 27 samples for a usual pulse, 1.68 MB/s");
    free(text);
}

/* Each scanner has its stations, and the limits that the configuration sets. The second sets only the end of
 * its range, and begins at the 0.5 m of the profile. */
static void two_scanners(void **state)
{
    (void)state;
    char *text =
        checked(ONE ", {name: two, position_m: [4, 0, 2], scanner: {head: {profile: full-sweep, prr_hz: 20000, "
                    "lines_hz: 50, pan_deg_s: 120, range_max_m: 900}}}, {position_m: [0, 4, 2]}",
                (const char *const[]){"head.range_min_m=2", "head.range_max_m=50", NULL});
    has(text, "head      stations 1, 3: scanhead full sweep (full-sweep), 20000 Hz pulses, 100 lines/s, pan 240 deg/s");
    has(text, "range     2 to 50 m only (head.range_min_m, range_max_m); the head profile has 0.5 to 1000");
    has(text, "head      station 2: scanhead full sweep (full-sweep), 20000 Hz pulses, 50 lines/s, pan 120 deg/s");
    has(text, "range     0.5 to 900 m only (head.range_min_m, range_max_m); the head profile has 0.5 to 1000");
    has(text, "station 2 two, ...");
    has(text, "station 3 ...");
    has_not(text, "output    of this head"); /* the same for both: it stands once */
    free(text);
}

/* Micrometres in 31 bits and a sign reach 2147 m: enough for a range of 1000 m, not for one of 2500 m. */
static void scanners_with_other_counts(void **state)
{
    (void)state;
    char *text = checked(ONE ", {name: two, position_m: [4, 0, 2], scanner: {head: {profile: riegl-vz2000i}}}",
                         (const char *const[]){"output.layout=geo", NULL});
    has(text, "output    geo, 1e-06 m per count");
    has(text, "output    of this head 1e-05 m per count");
    free(text);
}

static void the_target_and_the_others(void **state)
{
    (void)state;
    char *text = checked(ONE, (const char *const[]){"scene.target={objects: [pole], others: hide}", NULL});
    has(text, "target    1 of 3 triangles, 1 of 2 surfaces; the others hide surfaces behind them and give no points");
    free(text);
    text = checked(ONE, (const char *const[]){"scene.target={objects: [floor], others: left_out}", NULL});
    has(text, "target    2 of 3 triangles, 1 of 2 surfaces; the others are left out");
    free(text);
}

static void an_output_has_heights(void **state)
{
    static const struct {
        const char *crs, *heights, *line;
    } rows[] = {{"utm", "ellipsoid", "output    geo, 1e-05 m per count, heights above the ellipsoid"},
                {"geodetic", "ellipsoid", "output    geo, 1e-05 m per count, heights above the ellipsoid"},
                {"ecef", "ellipsoid", "output    geo, 1e-05 m per count"}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char crs[64], heights[64];
        snprintf(crs, sizeof crs, "output.crs=%s", rows[i].crs);
        snprintf(heights, sizeof heights, "output.heights=%s", rows[i].heights);
        char *text =
            checked(PLACED, (const char *const[]){crs, heights, "output.layout=geo", "output.scale_m=1e-5", NULL});
        has(text, rows[i].line);
        free(text);
    }
}

/* At the zone's middle, 500 km, grid north is true north, and the grid has 0.9996 of true lengths. A level range
 * reads 400 ppm less than it is, and 0.3 ppm less again at a height of 2 m: that is 2 m of the Earth's radius. */
static void anchors(void **state)
{
    (void)state;
    write_scene(0, 0, 0);
    char *text = checked("{name: one, position_m: [1, 2, 4], heading_deg: 350, pitch_deg: 1, roll_deg: -2}",
                         (const char *const[]){"scene.anchor={source: explicit, origin_m: [1, 2, 3], lat_deg: 52.5, "
                                               "lon_deg: 15, height_m: 100, north_deg: 30}",
                                               NULL});
    has(text, "anchor    explicit: scene point 1.0000 2.0000 3.0000 at lat 52.500000000 lon 15.000000000 deg, height "
              "100.0000 m; true north 30.000000 deg clockwise from y");
    has(text, "  geodetic  lat 52.500000000 lon 15.000000000 deg, height 101.0000 m");
    has(text, "  utm       33 north  500000.0000 ...");
    /* y is 30 deg west of north, and the head 10 deg west of y; pitch and roll are small angles that add as squares,
     * but for 1e-4 of them. */
    has(text, "  y axis    azimuth 320.000000 deg from true north, 320.000000 from grid north; z axis 2.2359...");
    free(text);
    write_scene(500000, 5800000, 0);
    text = checked("{name: one, position_m: [500000, 5800000, 2]}",
                   (const char *const[]){"scene.anchor={source: utm, utm_zone: 33, hemisphere: north}", NULL});
    has(text, "anchor    utm: the scene's coordinates are UTM 33 north");
    has(text, "  utm       33 north  500000.0000 5800000.0000 2.0000 m; convergence 0.000000 deg, scale 0.99960000");
    has(text, "            ranges are grid lengths: a level one of 1000 m reads -0.4003 m (-400.3 ppm)");
    has(text, "  y axis    azimuth 0.000000 deg from true north, 0.000000 from grid north; z axis 0.000000 deg off the "
              "plumb line");
    free(text);
}

/* At the pole UPS has 2000 km as easting and as northing, and a scale of 0.994. */
static void anchors_at_a_pole_and_in_ecef(void **state)
{
    (void)state;
    write_scene(2000000, 2000000, 0);
    for (int north = 0; north < 2; north++) {
        char anchor[80], line[120];
        snprintf(anchor, sizeof anchor, "scene.anchor={source: utm, utm_zone: 0, hemisphere: %s}",
                 north ? "north" : "south");
        char *text = checked("{name: one, position_m: [2000000, 2000100, 2]}", (const char *const[]){anchor, NULL});
        snprintf(line, sizeof line, "anchor    utm: the scene's coordinates are UPS %s", north ? "north" : "south");
        has(text, line);
        snprintf(line, sizeof line, "  ups       %s  2000000.0000 2000100.0000 2.0000 m; convergence ...",
                 north ? "north" : "south");
        has(text, line);
        assert_non_null(strstr(text, ", scale 0.99400000\n"));
        free(text);
    }
    write_in("scene.obj", "o floor\nv 6378140 -9 -9\nv 6378140 9 -9\nv 6378140 9 9\nv 6378140 -9 9\nf 1 2 3 4\n");
    char *text =
        checked("{name: one, position_m: [6378142, 0, 0]}", (const char *const[]){"scene.anchor={source: ecef}", NULL});
    has(text, "anchor    ecef: the scene's coordinates are ECEF");
    /* The equatorial radius of WGS 84 is 6378137 m. */
    has(text, "  geodetic  lat 0.000000000 lon 0.000000000 deg, height 5.0000 m");
    has(text, "  ecef      6378142.0000 0.0000 0.0000 m");
    has(text, "  y axis    azimuth 0.000000 deg from true north, ...");
    free(text);
}

/* In the northern grid of the scene a place 1 km south of the equator has the northing -1 km, and in a scene of the
 * southern grid, 1 km north of it, 10,001 km. */
static void a_northing_counts_from_the_grid_s_equator(void **state)
{
    (void)state;
    write_scene(500000, -1000, 0);
    char *text = checked("{name: one, position_m: [500000, -1000, 2]}",
                         (const char *const[]){"scene.anchor={source: utm, utm_zone: 33, hemisphere: north}", NULL});
    has(text, "  utm       33 north  500000.0000 -1000.0000 2.0000 m; ...");
    free(text);
    write_scene(500000, 10001000, 0);
    text = checked("{name: one, position_m: [500000, 10001000, 2]}",
                   (const char *const[]){"scene.anchor={source: utm, utm_zone: 33, hemisphere: south}", NULL});
    has(text, "  utm       33 south  500000.0000 10001000.0000 2.0000 m; ...");
    free(text);
}

/* A scene with coordinates of its own, given as UTM: easting 0 on the equator is 500 km west of the zone's middle, which
 * is more than the grid reaches. The second station is 83 degrees east of zone 33's middle, the anchor's. A run needs
 * neither grid. */
static void a_grid_may_not_reach_a_station(void **state)
{
    (void)state;
    write_scene(0, 0, 0);
    char *text = checked(ONE, (const char *const[]){"scene.anchor={source: utm, utm_zone: 32, hemisphere: north}",
                                                    "output.crs=utm", NULL});
    has(text, "  utm       none: UTM zone 32 does not reach latitude 0, ...");
    has(text, "  y axis    its azimuth is not known");
    has(text, "output    ...");
    has(text, "link      null, native");
    free(text);
    text =
        checked("{name: one, lat_deg: 52, lon_deg: 98, height_m: 40}",
                (const char *const[]){"scene.anchor={source: explicit, lat_deg: 52, lon_deg: 15, height_m: 0}", NULL});
    has(text, "  geodetic  lat 52.000000000 lon 98.000000000 deg, height 40.0000 m");
    has(text, "  utm       none: UTM zone 33 does not reach latitude 52, longitude 98 (Longitude 98d more than 60d...");
    assert_non_null(strstr(text, " deg from true north; z axis "));
    free(text);
}

/* 3 m and then 4 m, straight. The place on the Earth of all stops is that of the station. */
static void platforms(void **state)
{
    (void)state;
    char path[160], file[256];
    write_scene(0, 0, 0);
    write_in("ride.csv", "t_s,x_m,y_m,z_m,heading_deg\n0,0,0,2,0\n1,3,0,2,0\n2.5,7,0,2,0\n");
    snprintf(path, sizeof path, "%.*s/ride.csv", (int)(strrchr(config_path, '/') - config_path), config_path);
    snprintf(file, sizeof file, "platform={kind: trajectory, file: %s}", path);
    char *text = checked(ONE, (const char *const[]){file, NULL});
    has(text, "platform  trajectory of 2.500 s, 7.000 m; ...");
    free(text);
    text = checked(ONE, (const char *const[]){"platform={kind: live, reach_m: 7.5}", NULL});
    has(text, "platform  live, up to 7.5 m from its station");
    free(text);
    snprintf(file, sizeof file, "platform={kind: stops, file: %s, start_s: 0, step_s: 1}", path);
    text = checked(PLACED, (const char *const[]){file, NULL});
    has(text, "anchor    station 1 of the configuration: scene point 0.0000 0.0000 2.0000 at lat 52.000000000 lon "
              "15.000000000 deg, height 40.0000 m; true north along y");
    has(text, "stops     3, from 0 s on, each 1 s");
    has(text, "  stop-2    1 s, frame ...");
    assert_non_null(strstr(text, ", scene 3.0000 0.0000 2.0000 m; heading 0, pitch 0, roll 0 deg; lat 52.0"));
    has_not(text, "station 1");
    free(text);
}

/* The top of a tripod is 2 - 0.2 = 1.8 m above the ground, and its legs are 2.5 m long. The head sees no ground within
 * 2 m times the tangent of the legs' opening. */
static void tripods(void **state)
{
    (void)state;
    static const char stand[] = "{name: one, position_m: [0, 0, 2], tripod: {leg_m: 2.5, head_above_m: 0.2}}";
    char path[160], file[256], line[256];
    const double opening_rad = acos(1.8 / 2.5);
    write_scene(0, 0, 0);
    char *text = checked(stand, (const char *const[]){NULL});
    snprintf(
        line, sizeof line,
        "  tripod    legs of 2.5 m, top 1.8 m above the ground; opening %.6g deg, which hides %.6g m around on level "
        "ground",
        opening_rad * 180.0 / M_PI, 2.0 * tan(opening_rad));
    has(text, line);
    free(text);
    write_in("ride.csv", "t_s,x_m,y_m,z_m,heading_deg\n0,0,0,2,0\n1,3,0,2,0\n");
    snprintf(path, sizeof path, "%.*s/ride.csv", (int)(strrchr(config_path, '/') - config_path), config_path);
    snprintf(file, sizeof file, "platform={kind: stops, file: %s, start_s: 0, step_s: 1}", path);
    text = checked(stand, (const char *const[]){file, NULL});
    for (int stop = 1; stop <= 2; stop++) {
        snprintf(
            line, sizeof line,
            "  stop-%d    %d s, frame %d, scene %d.0000 0.0000 2.0000 m; heading 0, pitch 0, roll 0 deg; tripod: legs "
            "of 2.5 m, top 1.8 m above the ground; opening ...",
            stop, stop - 1, stop - 1, 3 * (stop - 1));
        has(text, line);
    }
    free(text);
}

/* A port that is free now. */
static int free_port(void)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t len = sizeof at;
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    assert_true(fd >= 0 && bind(fd, (struct sockaddr *)&at, sizeof at) == 0);
    assert_int_equal(getsockname(fd, (struct sockaddr *)&at, &len), 0);
    close(fd);
    return ntohs(at.sin_port);
}

/* Returns the POSIX second at which the system's list of leap seconds ends; below 0: there is no list. The head takes
 * the list that reaches further. */
static int64_t system_expires_s(void)
{
    char line[512];
    long long ntp_s = 0;
    FILE *f = fopen("/usr/share/zoneinfo/leap-seconds.list", "r");
    while (f != NULL && fgets(line, sizeof line, f) != NULL && sscanf(line, "#@ %lld", &ntp_s) != 1)
        continue;
    if (f != NULL) fclose(f);
    return ntp_s - 2208988800; /* NTP counts from 1900 */
}

/* A link has its type, the place that is given, and its protocol. Port 0 is no place. */
static void links_and_time(void **state)
{
    (void)state;
    char links[512], line[400];
    const int port = free_port();
    const char *slash = strrchr(config_path, '/');
    snprintf(links, sizeof links,
             "links=[{type: tcp, port: %d}, {type: tcp}, {type: pty, path: %.*s/port}, {type: udp, port: 9, protocol: "
             "nmea}, {type: udp, port: 9, address: 127.0.0.2, protocol: nmea}]",
             port, (int)(slash - config_path), config_path);
    char *text = checked(PLACED, (const char *const[]){links, "time.epoch=2026-01-02T03:04:05Z", NULL});
    snprintf(line, sizeof line, "link      tcp:127.0.0.1:%d, native", port);
    has(text, line);
    has(text, "link      tcp, native");
    snprintf(line, sizeof line, "link      pty:%.*s/port, native", (int)(slash - config_path), config_path);
    has(text, line);
    has(text, "link      udp:127.0.0.1:9, nmea");
    has(text, "link      udp:127.0.0.2:9, nmea");
    char until[UTC_TEXT_LEN];
    struct utc_time utc;
    const struct utc_table *table = utc_table_builtin();
    const int64_t system_s = system_expires_s(), end_s = system_s > table->expires_s ? system_s : table->expires_s;
    utc_from_tai(table, utc_tai_from_posix(table, end_s * UTC_SECOND_NS), &utc);
    utc_format(&utc, 0, until);
    snprintf(line, sizeof line, "time      2026-01-02T03:04:05Z at power-up; leap seconds are known up to %.10s",
             until);
    has(text, line);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_plain_scene),
        cmocka_unit_test(memory_is_that_of_a_triangle_of_the_scene),
        cmocka_unit_test(waveforms),
        cmocka_unit_test(two_scanners),
        cmocka_unit_test(scanners_with_other_counts),
        cmocka_unit_test(the_target_and_the_others),
        cmocka_unit_test(an_output_has_heights),
        cmocka_unit_test(anchors),
        cmocka_unit_test(anchors_at_a_pole_and_in_ecef),
        cmocka_unit_test(a_northing_counts_from_the_grid_s_equator),
        cmocka_unit_test(a_grid_may_not_reach_a_station),
        cmocka_unit_test(platforms),
        cmocka_unit_test(tripods),
        cmocka_unit_test(links_and_time),
    };
    return cmocka_run_group_tests(tests, site_rig_setup, site_rig_teardown);
}
