/* SPDX-License-Identifier: MIT */
/* The client in Python beside libscanhead: every number of every point is the same, with numpy and without. */
#include "tests/wire/python_rig.h"

#include "drivers/protocol/native_encode.h"

#define AT(lat, lon, height)                                                                 \
    " scene.anchor.source=explicit scene.anchor.lat_deg=" #lat " scene.anchor.lon_deg=" #lon \
    " scene.anchor.height_m=" #height " scene.anchor.north_deg=17"

/* The scene is in a grid. */
#define IN_UTM                                                                        \
    " scene.anchor.source=utm scene.anchor.utm_zone=33 scene.anchor.hemisphere=north" \
    " scene.meshes.0.offset_m=[391431,5819708,110] stations.0.position_m=[391431,5819708,110]"

/* ---- every number of every point */

struct __attribute__((packed)) row {
    double at[3], range_m, mirror_rad, pan_rad, reflectance_db, scene[3];
    int64_t t_ns;
    int32_t echo, echo_count, label;
};
struct __attribute__((packed)) beside {
    int64_t gps_ns;
    double position_m[3], quat[4], frame;
    int32_t flags; /* -1: no pose */
};

struct dump {
    char *bytes;
    size_t len, at;
};

static const void *take(struct dump *dump, size_t len)
{
    assert_true(dump->at + len <= dump->len);
    dump->at += len;
    return dump->bytes + dump->at - len;
}

static uint32_t take_block(struct dump *dump, char kind)
{
    uint32_t n;
    assert_int_equal(*(const char *)take(dump, 1), kind);
    memcpy(&n, take(dump, 4), 4);
    return n;
}

static void near(const char *what, double ours, double theirs, double error)
{
    if (memcmp(&ours, &theirs, sizeof ours) == 0 || (isnan(ours) && isnan(theirs))) return;
    if (fabs(ours - theirs) <= error) return;
    fail_msg("%s: %.17g in Python, %.17g in libscanhead", what, ours, theirs);
}

/* Values are equal bit for bit: both are IEEE 754 doubles, with the same operations in the same order, sine and cosine
 * from the same C library. The sign of NaN does not count. */
static void same(const char *what, double ours, double theirs)
{
    near(what, ours, theirs, 0.0);
}

/* In degrees a range is the difference of places 6.4e6 m from the middle of the Earth. Python and C round sines, and
 * angles up to pi, to 2^-53 of them, a few times each. Each rounding moves a place by up to 2.2e-9 m. */
static void same_point(const struct row *r, const struct scanhead_point *p, const struct scanhead_point *in_scene,
                       int is_geodetic)
{
    static const char *const names[] = {"x", "y", "z"};
    const double at[3] = {p->x, p->y, p->z}, scene[3] = {in_scene->x, in_scene->y, in_scene->z};
    for (int i = 0; i < 3; i++) {
        same(names[i], r->at[i], at[i]);
        same("scene", r->scene[i], scene[i]);
    }
    near("range_m", r->range_m, p->range_m, is_geodetic ? 2e-8 : 0.0);
    same("mirror_rad", r->mirror_rad, p->mirror_rad);
    same("pan_rad", r->pan_rad, p->pan_rad);
    same("reflectance_db", r->reflectance_db, p->reflectance_db);
    assert_int_equal(r->t_ns, p->t_ns);
    assert_int_equal(r->echo, p->echo);
    assert_int_equal(r->echo_count, p->echo_count);
    assert_int_equal(r->label, p->label);
}

static void same_beside(struct scanhead *sh, const struct beside *b, int64_t t_ns)
{
    struct scanhead_pose pose;
    double gps_s;
    int known = scanhead_gps_time(sh, t_ns, &gps_s) == SCANHEAD_OK;
    assert_int_equal(known, b->gps_ns >= 0);
    if (known)
        same("gps", (double)(b->gps_ns / 1000000000 - 1000000000) + (double)(b->gps_ns % 1000000000) / 1e9, gps_s);
    known = scanhead_pose(sh, t_ns + 1000, &pose) == SCANHEAD_OK;
    assert_int_equal(known ? pose.flags : -1, b->flags);
    if (!known) return;
    for (int i = 0; i < 3; i++)
        same("pose", b->position_m[i], pose.position_m[i]);
    for (int i = 0; i < 4; i++)
        same("quat", b->quat[i], pose.quat[i]);
    same("frame scalar", b->frame, pose.frame);
}

static void same_points(struct scanhead *sh, const struct scanhead_frame *frame, struct dump *dump)
{
    static struct scanhead_point point[NATIVE_MAX_POINTS], in_scene[NATIVE_MAX_POINTS];
    struct beside beside;
    struct scanhead_info info;
    assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_OK);
    const int is_geodetic = info.geo && info.crs == 3;
    int n = scanhead_points(sh, frame, 0, point, NATIVE_MAX_POINTS);
    assert_int_equal(take_block(dump, 'P'), n);
    memcpy(in_scene, point, sizeof in_scene);
    if (scanhead_to_scene(sh, in_scene, (uint32_t)n, NULL) < 0)
        for (int i = 0; i < n; i++)
            in_scene[i].x = in_scene[i].y = in_scene[i].z = NAN;
    for (int i = 0; i < n; i++) {
        struct row row;
        memcpy(&row, take(dump, sizeof row), sizeof row);
        same_point(&row, &point[i], &in_scene[i], is_geodetic);
    }
    memcpy(&beside, take(dump, sizeof beside), sizeof beside);
    same_beside(sh, &beside, frame->scan_t0_ns);
}

static void same_attributes(struct scanhead *sh, const struct scanhead_frame *frame, struct dump *dump)
{
    static struct scanhead_attribute attribute[NATIVE_MAX_POINTS];
    int n = scanhead_attributes(sh, frame, 0, attribute, NATIVE_MAX_POINTS);
    assert_int_equal(take_block(dump, 'A'), n);
    for (int i = 0; i < n; i++) {
        double pair[2];
        memcpy(pair, take(dump, sizeof pair), sizeof pair);
        same("amplitude_db", pair[0], attribute[i].amplitude_db);
        same("width_ns", pair[1], attribute[i].width_ns);
    }
}

static uint64_t same_stream(struct wire *wire, const char *path, const char *hash, const char *flavour)
{
    char dump_path[352];
    struct scanhead_frame frame;
    snprintf(dump_path, sizeof dump_path, "%s", wire_path(wire, "dump"));
    const char *said = ask_python(wire, flavour, "dump", path, dump_path);
    if (said == NULL) return 0;
    assert_int_equal(strncmp(said, hash, 64), 0); /* as the head counted it */
    struct dump dump = {.at = 0};
    dump.bytes = wire_read(dump_path, &dump.len);
    struct scanhead *sh = client_open(path);
    uint64_t points = 0;
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        if (frame.type == SCANHEAD_POINTS) same_points(sh, &frame, &dump);
        if (frame.type == SCANHEAD_ATTRIBUTES) same_attributes(sh, &frame, &dump);
        points += frame.n_points;
    }
    assert_int_equal(take_block(&dump, 'E'), 6); /* names */
    assert_int_equal(dump.at, dump.len);
    free(dump.bytes);
    scanhead_close(sh);
    return points;
}

static void test_same_numbers(void **state)
{
    struct wire *wire = *state;
    static const struct {
        const struct room_config *config;
        const char *keys;
    } scans[] = {
        {&SMALL, "output.attributes=on noise.range=on time.epoch=2026-01-01T00:00:00Z signal.model=on"},
        {&SMALL, "output.layout=geo output.crs=utm" AT(-33.9, 18.4, 1055)},
        {&SMALL, "output.layout=geo output.crs=geodetic" AT(60, 180, 5)},
        {&RIDE, "output.layout=polar"},
        {&RIDE, "output.layout=geo output.crs=ecef" AT(-33.9, 18.4, 1055)},
    };
    need_python();
    room_write(wire);
    write_ride(wire);
    for (size_t i = 0; i < sizeof scans / sizeof scans[0]; i++) {
        char path[352], hash[65];
        snprintf(path, sizeof path, "%s", record(wire, scans[i].config, "a.shs", scans[i].keys));
        stats_hash(wire, hash);
        for (int k = 0; k < 2; k++) {
            uint64_t points = same_stream(wire, path, hash, flavours[k]);
            if (points == 0) print_message("# numpy is missing (Debian: python3-numpy): compared without it\n");
            assert_true(points == 0 || points >= 1000);
        }
    }
}

/* ---- both layouts of one scan, in the CRS and in the scene. Both layouts are made of the same encoder counts. The two
 * differ in four ways: the range is a count of range_scale_m in one (0.5 um, half of it); coordinates are counts of
 * 1 um in the other (sqrt(3) / 2 um); georeferencing is good to output.tolerance_m (set to 1 um); the axes are good to
 * 1e-10 rad. */
static void test_both_layouts(void **state)
{
    struct wire *wire = *state;
    static const char *const places[] = {
        "output.crs=ecef" AT(-33.9, 18.4, 1055),
        "output.crs=utm" AT(-33.9, 18.4, 1055),
        "output.crs=geodetic" AT(60, 180, 5),
        "output.crs=utm" AT(83.9, 3.1, 2800),
        "output.crs=utm" AT(88, -100, 3),
        "output.crs=utm" AT(-85, 70, 3),
        "output.crs=geodetic" AT(90, 12, 3),
        "output.crs=geodetic" AT(-89.9999, 30, 3), /* 11 m from the pole */
        "output.crs=utm" AT(90, 12, 3),
        "output.crs=ecef" AT(-90, 12, 3),
        "output.crs=local",
        "output.crs=utm" IN_UTM,
        "output.crs=ecef" IN_UTM,
        "output.crs=geodetic" IN_UTM,
    };
    need_python();
    room_write(wire);
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        char keys[400], polar[352], geo[352];
        snprintf(keys, sizeof keys, "output.layout=polar output.tolerance_m=1e-6 %s", places[i]);
        snprintf(polar, sizeof polar, "%s", record(wire, &SMALL, "polar.shs", keys));
        snprintf(keys, sizeof keys, "output.layout=geo output.tolerance_m=1e-6 %s", places[i]);
        snprintf(geo, sizeof geo, "%s", record(wire, &SMALL, "geo.shs", keys));
        const char *said = ask_python(wire, flavours[i % 2], "crs", polar, geo);
        unsigned n;
        double crs_m, scene_m, page_m;
        if (said == NULL) continue;
        assert_int_equal(sscanf(said, "%u %lf %lf %lf", &n, &crs_m, &scene_m, &page_m), 4);
        assert_true(n >= 1000);
        if (!(crs_m < 2.6e-6 && scene_m < 2.6e-6))
            fail_msg("%s: %g m in the CRS, %g m in the scene", places[i], crs_m, scene_m);
        /* The tangent is off by 81 / 2R = 6.4e-6 m, 9 m away. R is good to half a percent. At the height h of 2800 m
         * that is half a percent of 9 m h / R: 2.0e-5 m. */
        const int is_tangent = strstr(places[i], "anchor.source=utm") == NULL; /* a scene in a grid is not metric */
        if (is_tangent && !(page_m < 2.9e-5)) fail_msg("%s: the page's formula is %g m off", places[i], page_m);
    }
}

/* ---- live */

static void test_live(void **state)
{
    struct wire *wire = *state;
    need_python();
    room_write(wire);
    for (int k = 0; k < 2; k++) {
        const char *const more[] = {"--pace", "fast", NULL};
        struct room_config c = SMALL;
        c.links = LINK_YAML_BOTH;
        struct head head = head_start(wire, room_config_write(wire, &c), more);
        char source[352], said[512], want[128], hash[65];
        snprintf(source, sizeof source, "%s", head_endpoint(&head, k == 0 ? "tcp" : "pty"));
        snprintf(said, sizeof said, "%s", ask_python(wire, "plain", "live", source, NULL));
        head_end(&head, SIGTERM);
        stats_hash(wire, hash);
        struct oracle oracle = oracle_of(&c, -180, 180, 360);
        snprintf(want, sizeof want, "-131\n%llu 0 0 %s\ntimeout\n", (unsigned long long)oracle_end(&oracle), hash);
        assert_string_equal(said, want);
    }
}

/* Converts a recording into another format. */
static void convert(struct wire *wire, const char *from, const char *to)
{
    char source[352], file[352];
    snprintf(source, sizeof source, "%s", wire_path(wire, from));
    snprintf(file, sizeof file, "%s", wire_path(wire, to));
    const char *const args[] = {"record", source, "-o", file, "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "head.out", "head.err", -1)), 0);
}

/* A recording of an older head, whose telemetry ends at 72 bytes, gives the same points and the same hash. */
static void test_older(void **state)
{
    struct wire *wire = *state;
    char from[352], older[352], hash[65], want[66];
    need_python();
    room_write(wire);
    snprintf(from, sizeof from, "%s", record(wire, &SMALL, "a.shs", ""));
    snprintf(older, sizeof older, "%s", wire_path(wire, "older.shs"));
    stats_hash(wire, hash);
    snprintf(want, sizeof want, "%s\n", hash);
    assert_string_equal(ask_python(wire, "plain", "older", from, older), want);
    convert(wire, "a.shs", "a.ply");
    convert(wire, "older.shs", "older.ply");
    size_t len, older_len;
    char *points = wire_read(wire_path(wire, "a.ply"), &len);
    char *same_points = wire_read(wire_path(wire, "older.ply"), &older_len);
    assert_int_equal(len, older_len);
    assert_memory_equal(points, same_points, len);
    free(points);
    free(same_points);
}

/* Tries its parts with chosen numbers. Between two quaternions of one rotation the turn is the short one, of 30
 * degrees. Rings from pole to pole are a degree apart. A shot without echo has no place. */
static const char PARTS[] =
    "import math, sys\n"
    "sys.path.insert(0, 'drivers/host/python')\n"
    "sys.modules['numpy'] = None\n"
    "import scanhead as s\n"
    "half = math.radians(15)\n"
    "for sign in (-1, 1):\n"
    "    a = s.Pose(0, (0, 0, 0), (1, 0, 0, 0), 0.0, 0)\n"
    "    b = s.Pose(1000, (2, 0, 0), (sign * math.cos(half), 0, 0, sign * math.sin(half)), 0.0, 0)\n"
    "    leg = s._leg(a, b)\n"
    "    assert abs(leg.angle_rad - 2 * half) < 1e-12 and abs(leg.axis[2] - 1) < 1e-12, leg\n"
    "rings = s._rings({'gaps': 0, 'rings': 181, 'first_ring_udeg': -90000000})\n"
    "assert rings == {'first_ring_deg': -90.0, 'ring_step_deg': 1.0}, rings\n"
    "raw = [0, 10000], [0, 0], [0, 0], [0, 0], [0, 0], [0, 0x11000000]\n"
    "p = s._common(raw, 0, 0)\n"
    "s._polar_points(p, raw, {'mirror_counts_per_turn': 100, 'pan_counts_per_turn': 100, 'range_scale_m': 1e-4,\n"
    "                         'line_start_udeg': 0, 'line_stop_udeg': 90000000}, True)\n"
    "assert all(math.isnan(v[0]) for v in (p.x, p.y, p.z, p.range_m)) and p.range_m[1] == 1.0, p.range_m\n";

static void test_parts(void **state)
{
    need_python();
    const char *const args[] = {"-c", PARTS, NULL};
    wire_run_program(*state, python, args, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_same_numbers, setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_both_layouts, setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_live, setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_older, setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_parts, setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
