/* SPDX-License-Identifier: MIT */
/* These tests go on a drive of 30 km. The anchor moves along with the head, so that counts keep 1e-6 m, and every point
 * is where GeographicLib puts it. */
#include "tests/wire/room.h"

#include "core/geoframe.h"
#include "core/pose.h"

static const struct georef_place PLACE = {52.5, 13.4, 80.0};
static const double NORTH_DEG = 30.0, WAY_M = 30000.0, STRETCH_M = 2000.0;

/* The drive goes along a wall, 12 m away on the left. The pan turns, so that the wall is met up to the head's range of
 * 1000 m ahead and behind. */
static void write_drive(struct wire *wire, char config[352])
{
    wire_write_text(wire, "wall.obj",
                    "o wall\nv -2000 12 -30\nv 33000 12 -30\nv 33000 12 30\nv -2000 12 30\nf 1 2 3 4\n");
    wire_write_text(wire, "way.csv", "x_m,y_m,z_m,speed_m_s\n0,0,0,500\n15000,0,0,500\n30000,0,0,500\n");
    snprintf(config, 352, "%s",
             wire_write_text(wire, "drive.yaml",
                             "head: {profile: full-sweep, prr_hz: 1500, lines_hz: 20, pan_deg_s: 100, frames: 0}\n"
                             "scene:\n  meshes:\n    - {file: wall.obj, up: z, scale: 1}\n"
                             "  anchor: {source: explicit, origin_m: [0, 0, 0], lat_deg: 52.5, lon_deg: 13.4,"
                             " height_m: 80, north_deg: 30}\n"
                             "stations: [{position_m: [0, 0, 0]}]\n"
                             "platform: {kind: trajectory, waypoints: way.csv, mount_heading_deg: -90}\n"
                             "loop: {queue_ms: 10000, late_ms: 10000}\n"
                             "links: [{type: tcp, port: 0}]\n"));
}

enum { MOST = 200000 };
struct drive {
    uint32_t n, anchors;
    int epsg;
    double scale_m;
    char hash[65];
    double p[MOST][3];
};

static void keep(struct scanhead *sh, const struct scanhead_frame *frame, int polar, struct drive *drive)
{
    struct scanhead_point point[256];
    for (uint32_t first = 0; first < frame->n_points;) {
        int n = scanhead_points(sh, frame, first, point, 256);
        if (n <= 0) fail_msg("%s", scanhead_error(sh));
        if (polar) assert_int_equal(scanhead_to_scene(sh, point, (uint32_t)n, NULL), 0);
        for (int i = 0; i < n; i++, drive->n++) {
            assert_true(drive->n < MOST);
            drive->p[drive->n][0] = point[i].x;
            drive->p[drive->n][1] = point[i].y;
            drive->p[drive->n][2] = point[i].z;
        }
        first += (uint32_t)n;
    }
}

static struct drive *drive_once(struct wire *wire, const char *config, const char *threads, const char *output)
{
    const char *const more[] = {"--pace", "fast", "--threads", threads, "--set", output, NULL};
    char layout[64], crs[64];
    int polar = sscanf(output, "output.crs=%31s", crs) != 1;
    snprintf(layout, sizeof layout, "output.layout=%s", polar ? "polar" : "geo");
    const char *const geo[] = {"--pace", "fast", "--threads", threads, "--set", output, "--set", layout, NULL};
    struct drive *drive = calloc(1, sizeof *drive);
    assert_non_null(drive);
    struct head head = head_start(wire, config, polar ? more : geo);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    struct scanhead_info info;
    double last[3] = {NAN, 0, 0};
    scanhead_hash_start(sh);
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    do {
        client_next(sh, &frame);
        if (frame.type != SCANHEAD_POINTS) continue;
        keep(sh, &frame, polar, drive);
        assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_OK);
        drive->anchors += memcmp(last, info.anchor, sizeof last) != 0;
        memcpy(last, info.anchor, sizeof last);
    } while (!is_event(&frame, SCANHEAD_EV_SCAN_END));
    drive->scale_m = info.scale_m;
    drive->epsg = info.epsg;
    scanhead_hash_hex(sh, drive->hash);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    return drive;
}

/* Returns the largest distance of a point from its scene point by GeographicLib, on the ground. */
static double worst_m(const struct drive *scene, const struct drive *drive, enum georef_crs crs)
{
    static const double origin[3] = {0, 0, 0};
    struct georef_spec spec = {.crs = crs};
    struct geoframe frame;
    struct georef *georef;
    struct sh_err err;
    double anchor[3], worst = 0.0;
    uint32_t echoes = 0;
    assert_int_equal(geoframe_set_tangent(&frame, origin, &PLACE, NORTH_DEG, &err), SH_OK);
    assert_int_equal(geoframe_fill(&frame, origin, &spec, &err), SH_OK);
    assert_int_equal(georef_create(&spec, &georef, &err), SH_OK); /* exact */
    assert_int_equal(georef_epsg(georef), drive->epsg);
    georef_anchor(georef, anchor);
    for (uint32_t i = 0; i < scene->n; i++) {
        const double *s = scene->p[i], *p = drive->p[i];
        double want[3], off[3], sum = 0.0;
        assert_int_equal(isnan(s[0]), isnan(p[0]));
        if (isnan(s[0])) continue;
        echoes++;
        georef_forward(georef, 1, (struct vec3_in){&s[0], &s[1], &s[2]},
                       (struct vec3_out){&want[0], &want[1], &want[2]});
        for (int k = 0; k < 3; k++)
            off[k] = p[k] - anchor[k] - want[k];
        if (crs == GEOREF_GEODETIC) {
            double degree_m = 6400000.0 * M_PI / 180.0;
            off[0] *= degree_m;
            off[1] *= degree_m * cos(p[0] * M_PI / 180.0);
        }
        for (int k = 0; k < 3; k++)
            sum += off[k] * off[k];
        worst = fmax(worst, sqrt(sum));
    }
    georef_free(georef);
    assert_true(echoes > scene->n / 10);
    return worst;
}

/* The truth is the points of the polar layout, through the head's poses, with an error of half of 1e-6 m in the range.
 * The polynomials are good to tolerance_m, 1e-6 m; half a count of 1e-6 m in each coordinate is added. The BVHs lie 2
 * km apart, and each of their stretches has an anchor of its own. */
static void test_anchor_moves(void **state)
{
    static const struct {
        const char *set;
        enum georef_crs crs;
    } runs[] = {
        {"output.crs=utm", GEOREF_UTM}, {"output.crs=geodetic", GEOREF_GEODETIC}, {"output.crs=ecef", GEOREF_ECEF}};
    struct wire *wire = *state;
    char config[352];
    write_drive(wire, config);
    struct drive *scene = drive_once(wire, config, "2", "output.layout=polar");
    assert_int_equal(scene->anchors, 1);
    for (int i = 0; i < 3; i++) {
        struct drive *drive = drive_once(wire, config, "2", runs[i].set);
        assert_int_equal(drive->n, scene->n);
        double off_m = worst_m(scene, drive, runs[i].crs);
        print_message("# 30 km, %s: %u points, %u anchors, off by %.3g m at most\n", runs[i].set, drive->n,
                      drive->anchors, off_m);
        assert_true(drive->scale_m == 1e-6);
        assert_true(drive->anchors >= (uint32_t)(WAY_M / STRETCH_M));
        assert_true(off_m <= 1e-6 + 0.5e-6 * sqrt(3.0) + 0.5e-6);
        if (i == 0) { /* the same by any number of threads: anchors are in the hash */
            struct drive *again = drive_once(wire, config, "1", runs[i].set);
            assert_string_equal(again->hash, drive->hash);
            free(again);
        }
        free(drive);
    }
    free(scene);
}

/* ---- an anchor that did not come */

enum { HEADER = 28, TYPE_ANCHOR = 2, FLAG_REPEAT = 1 };

/* Takes the nth anchor frame that is no repetition out of a recorded stream. */
static size_t drop_anchor(uint8_t *bytes, size_t len, int nth)
{
    for (size_t at = 0; at + HEADER <= len;) {
        size_t frame = HEADER + ((size_t)bytes[at + 4] | (size_t)bytes[at + 5] << 8 | (size_t)bytes[at + 6] << 16);
        if (bytes[at] != 0xd5) fail_msg("no frame at byte %zu", at);
        if (bytes[at + 1] == TYPE_ANCHOR && (bytes[at + 3] & FLAG_REPEAT) == 0 && nth-- == 0) {
            memmove(bytes + at, bytes + at + frame, len - at - frame);
            return len - frame;
        }
        at += frame;
    }
    fail_msg("no such anchor");
    return 0;
}

struct replay {
    uint32_t n, unplaced;
    double x[MOST]; /* infinity: not placed */
};

static struct replay *replay(const char *path)
{
    struct scanhead_frame frame;
    struct scanhead_point point[256];
    struct replay *out = calloc(1, sizeof *out);
    assert_non_null(out);
    struct scanhead *sh = client_open(path);
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK)
        for (uint32_t first = 0; frame.type == SCANHEAD_POINTS && first < frame.n_points;) {
            int n = scanhead_points(sh, &frame, first, point, 256), placed = n > 0;
            if (!placed) {
                assert_int_equal(n, SCANHEAD_ESTATE);
                n = (int)(frame.n_points - first);
                out->unplaced += (uint32_t)n;
            }
            assert_true(out->n + (uint32_t)n <= MOST);
            for (int i = 0; i < n; i++)
                out->x[out->n++] = placed ? point[i].x : (double)INFINITY;
            first += (uint32_t)n;
        }
    scanhead_close(sh);
    return out;
}

/* After a lost anchor points are placed again from its next repetition on, so about one of the 60 s is not placed. No
 * point is placed by the anchor before, 2 km away. */
static void test_lost_anchor(void **state)
{
    struct wire *wire = *state;
    char config[352], path[352];
    size_t len;
    write_drive(wire, config);
    snprintf(path, sizeof path, "%s", wire_path(wire, "drive.shs"));
    const char *const args[] = {
        "record", config, "-o", path, "--quiet", "--set", "output.crs=utm", "--set", "output.layout=geo", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "head.out", "head.err", -1)), 0);
    struct replay *whole = replay(path), *holed;
    assert_int_equal(whole->unplaced, 0);
    char *bytes = wire_read(path, &len);
    len = drop_anchor((uint8_t *)bytes, len, 7);
    snprintf(path, sizeof path, "%s", wire_write(wire, "holed.shs", bytes, len));
    free(bytes);
    holed = replay(path);
    print_message("# an anchor lost: %u of %u points not placed\n", holed->unplaced, whole->n);
    assert_int_equal(holed->n, whole->n);
    assert_true(holed->unplaced > 0 && holed->unplaced <= whole->n / 60 + 100);
    for (uint32_t i = 0; i < whole->n; i++)
        if (holed->x[i] != whole->x[i] && !isinf(holed->x[i]) && !isnan(whole->x[i]))
            fail_msg("point %u at %.3f, not %.3f", i, holed->x[i], whole->x[i]);
    free(whole);
    free(holed);
}

/* The poses of a recording in ECEF are in the scene frame. The file's own comments take each to the place
 * that GeographicLib gives. The file can be read as a trajectory. ECEF is rigid: only roundings of 7e6 m remain. */
static void test_poses_beside_a_crs(void **state)
{
    struct wire *wire = *state;
    char config[352], path[352];
    double at[3], place[3], r[9], base[3], anchor[3];
    static const double origin[3] = {0, 0, 0};
    write_drive(wire, config);
    snprintf(path, sizeof path, "%s", wire_path(wire, "a.poses.csv"));
    const char *const args[] = {"record",           config,       "-o", path,      "--crs", "ecef", "--set",
                                "head.prr_hz=1000", "--duration", "1",  "--quiet", NULL};
    if (wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)) != 0) wire_show(wire, "err");
    char *text = wire_read(path, NULL), *line = strstr(text, "EPSG 4978\n# scene point");
    assert_non_null(line);
    line = strstr(line, "height_m: ");
    assert_int_equal(
        sscanf(line, "height_m: %lf,%lf,%lf: %lf,%lf,%lf", &at[0], &at[1], &at[2], &place[0], &place[1], &place[2]), 6);
    line = strstr(line, "begins: ");
    assert_int_equal(sscanf(line, "begins: %lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf", &r[0], &r[1], &r[2], &r[3], &r[4],
                            &r[5], &r[6], &r[7], &r[8]),
                     9);
    struct geoframe frame;
    struct georef_spec spec = {.crs = GEOREF_ECEF},
                       there = {.crs = GEOREF_ECEF, .lat_deg = place[0], .lon_deg = place[1], .height_m = place[2]};
    struct georef *truth, *point;
    struct sh_err err;
    assert_int_equal(geoframe_set_tangent(&frame, origin, &PLACE, NORTH_DEG, &err), SH_OK);
    assert_int_equal(geoframe_fill(&frame, origin, &spec, &err), SH_OK);
    assert_int_equal(georef_create(&spec, &truth, &err), SH_OK);
    assert_int_equal(georef_create(&there, &point, &err), SH_OK);
    georef_anchor(point, base);
    georef_anchor(truth, anchor);
    int n = 0;
    for (char *row = strchr(line, '\n') + 1; *row != 0; row = strchr(row, '\n') + 1, n++) {
        double p[3], want[3];
        assert_int_equal(sscanf(row, "%*u,%*f,%lf,%lf,%lf", &p[0], &p[1], &p[2]), 3);
        georef_forward(truth, 1, (struct vec3_in){&p[0], &p[1], &p[2]},
                       (struct vec3_out){&want[0], &want[1], &want[2]});
        for (int k = 0; k < 3; k++) {
            double got = base[k] - anchor[k];
            for (int j = 0; j < 3; j++)
                got += r[3 * k + j] * (p[j] - at[j]);
            assert_true(fabs(got - want[k]) < 1e-7);
        }
    }
    assert_true(n > 10);
    struct trajectory *trajectory;
    int rc = trajectory_read_csv(path, NULL, &trajectory, &err);
    if (rc != SH_OK) fail_msg("%s", err.text);
    trajectory_free(trajectory);
    georef_free(truth);
    georef_free(point);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_anchor_moves, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_lost_anchor, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_poses_beside_a_crs, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
