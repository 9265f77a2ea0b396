/* SPDX-License-Identifier: MIT */
/* Several scanners in one scene, range limits and targets: the recorded points are checked one by one. The room's walls
 * are known planes; a board stands before one of them. */
#include "tests/wire/room.h"

/* The board's label is 6, after the walls. */
static const char BOARD[] = "v 2 -2 -1\nv 2 2 -1\nv 2 2 2\nv 2 -2 2\no board\nusemtl wood\nf -4 -3 -2 -1\n";

/* The middle one of three stations has a Velodyne. */
static const char CONFIG[] =
    "head: {profile: full-sweep, prr_hz: 20000, lines_hz: 50, pan_deg_s: 150, pan_stop_deg: 60}\n"
    "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
    "stations:\n"
    "  - {position_m: [0.31, -0.42, 0.17], heading_deg: 30}\n"
    "  - position_m: [-1.5, 1.25, 0.4]\n"
    "    scanner: {head: {profile: velodyne-vlp16, lines_hz: 20}}\n"
    "  - {position_m: [1.2, 2.2, 0.3]}\n"
    "links: [{type: tcp, port: 0}]\n";

enum { MOST_ARGS = 24 };

static void begin(struct wire *wire)
{
    room_write(wire);
    FILE *f = fopen(wire_path(wire, "room.obj"), "a");
    assert_non_null(f);
    fputs(BOARD, f);
    assert_int_equal(fclose(f), 0);
    wire_write_text(wire, "config.yaml", CONFIG);
}

/* Runs scanhead record config.yaml -o NAME --quiet and more. Returns the exit status. */
static int record(struct wire *wire, const char *name, const char *const *more)
{
    char config[352], out[352];
    const char *args[MOST_ARGS] = {"record", config, "-o", out, "--quiet"};
    int n = 5;
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(out, sizeof out, "%s", wire_path(wire, name));
    while (*more != NULL)
        args[n++] = *more++;
    args[n] = NULL;
    return wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
}

/* A vertex of a text PLY: x y z range reflectance time echo echo_count label station. */
struct vertex {
    double p[3], range_m;
    int echoes, label, station;
};

struct cloud {
    char *text, *at; /* the first vertex's line */
    uint64_t n;
};

static struct cloud cloud_open(struct wire *wire, const char *name)
{
    struct cloud c = {.text = wire_read(wire_path(wire, name), NULL)};
    const char *count = strstr(c.text, "element vertex ");
    assert_non_null(count);
    assert_int_equal(sscanf(count, "element vertex %" SCNu64, &c.n), 1);
    c.at = strstr(c.text, "end_header\n") + strlen("end_header\n");
    return c;
}

static struct vertex cloud_next(struct cloud *c)
{
    struct vertex v;
    int used = 0;
    if (sscanf(c->at, "%lf %lf %lf %lf %*s %*s %*d %d %d %d\n%n", &v.p[0], &v.p[1], &v.p[2], &v.range_m, &v.echoes,
               &v.label, &v.station, &used) != 7)
        fail_msg("no vertex: %.80s", c->at);
    c->at += used;
    return v;
}

/* Half a count of full-sweep's encoders, of 2^20 a turn, is 3e-6 rad: over 12 m, by two angles, 5e-5 m. A range's count
 * and the text's last digit are less. */
static const double NEAR_M = 6e-5;

/* Returns whether the point is on one of the walls, or the board. */
static int is_on_plane(const double p[3])
{
    for (int w = 0; w < 6; w++)
        if (fabs(p[w / 2] - (w & 1 ? ROOM_MAX : ROOM_MIN)[w / 2]) < NEAR_M) return 1;
    return fabs(p[0] - 2.0) < NEAR_M;
}

/* One file has the points of all stations, and three files those of one each. Each point has its station's number. The
 * points are the scanners' own: the Velodyne's elevations are odd degrees from -15 to 15, by its manual. */
static void test_together(void **state)
{
    struct wire *wire = *state;
    begin(wire);
    assert_int_equal(record(wire, "all.ply", (const char *const[]){"--station", "all", "--each", "--ascii", NULL}), 0);
    struct cloud all = cloud_open(wire, "all.ply");
    uint64_t n = 0;
    for (int i = 1; i <= 3; i++) {
        char part[32], number[4];
        snprintf(part, sizeof part, "all-%d.ply", i);
        snprintf(number, sizeof number, "%d", i);
        struct cloud one = cloud_open(wire, part);
        const size_t len = strlen(one.at);
        assert_int_equal(strncmp(one.at, all.at, len), 0);
        for (uint64_t k = 0; k < one.n; k++) {
            const struct vertex v = cloud_next(&all);
            assert_int_equal(v.station, i);
            assert_true(is_on_plane(v.p));
            if (i != 2) continue;
            const double up = v.p[2] - 0.4, flat = hypot(v.p[0] + 1.5, v.p[1] - 1.25);
            const double deg = atan2(up, flat) * 180.0 / M_PI, odd = 2.0 * round((deg - 1.0) / 2.0) + 1.0;
            if (fabs(deg - odd) > 0.001 || fabs(odd) > 15.0) fail_msg("an elevation of %.4f deg", deg);
        }
        n += one.n;
        /* Alone it gives the same file. */
        assert_int_equal(record(wire, "one.ply", (const char *const[]){"--station", number, "--ascii", NULL}), 0);
        char *alone = wire_read(wire_path(wire, "one.ply"), NULL);
        assert_string_equal(alone, one.text);
        free(alone);
        free(one.text);
    }
    assert_int_equal(n, all.n);
    assert_int_equal(*all.at, '\0');
    assert_non_null(strstr(all.text, "comment station 2 profile velodyne-vlp16\n"));
    free(all.text);
}

static void expect_refusal(struct wire *wire, const char *name, const char *const *more, const char *says)
{
    const int status = record(wire, name, more);
    char *text = wire_read(wire_path(wire, "err"), NULL);
    if (status != 2 || strstr(text, says) == NULL) fail_msg("status %d, no '%s' in: %s", status, says, text);
    free(text);
    assert_int_equal(access(wire_path(wire, name), F_OK), -1);
}

static void test_what_a_file_cannot_hold(void **state)
{
    struct wire *wire = *state;
    begin(wire);
    const char *const all[] = {"--station", "all", NULL};
    expect_refusal(wire, "a.shs", all, "the stations have several scanners; allowed with --split");
    expect_refusal(wire, "a.pcapng", all, "the stations have several scanners; allowed with --split");
    expect_refusal(wire, "a.ptx", all, "this head fires beams in turn");
    expect_refusal(wire, "a.ply", (const char *const[]){"--split", "--each", NULL}, "allowed is one of them");
    assert_int_equal(record(wire, "a.ptx", (const char *const[]){"--station", "1", NULL}), 0);
    /* Each stream by itself belongs to one head. */
    char ply[352];
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "a.ply"));
    assert_int_equal(record(wire, "a.shs", (const char *const[]){"--station", "all", "--split", "-o", ply, NULL}), 0);
    for (int i = 1; i <= 3; i++) {
        char stream[352], name[16];
        snprintf(name, sizeof name, "a-%d.shs", i);
        snprintf(stream, sizeof stream, "%s", wire_path(wire, name));
        const char *const args[] = {"record", stream, "-o", wire_path(wire, "again.ply"), "--quiet", NULL};
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
        snprintf(name, sizeof name, "a-%d.ply", i);
        size_t len[2];
        char *again = wire_read(wire_path(wire, "again.ply"), &len[0]),
             *was = wire_read(wire_path(wire, name), &len[1]);
        assert_int_equal(len[0], len[1]);
        assert_memory_equal(again, was, len[0]);
        free(again);
        free(was);
    }
}

static void test_the_head_on_the_wire(void **state)
{
    struct wire *wire = *state;
    begin(wire);
    char path[352];
    snprintf(path, sizeof path, "%s", wire_path(wire, "config.yaml"));
    struct head head = head_start(wire, path, (const char *const[]){"--pace", "fast", "--quiet", NULL});
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    assert_non_null(strstr(client_ask(sh, "*IDN?"), "full sweep"));
    client_tell(sh, "HEAD:STATION 3");
    assert_non_null(strstr(client_ask(sh, "HEAD:STATION 2"), "-221"));
    assert_string_equal(client_ask(sh, "HEAD:STATION?"), "3");
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    head = head_start(wire, path,
                      (const char *const[]){"--pace", "fast", "--quiet", "--set", "head.station=2", "--set",
                                            "stations.1.scanner.head.range_max_m=9.5", "--set",
                                            "stations.1.scanner.head.range_min_m=1", NULL});
    sh = client_open(head_endpoint(&head, "tcp"));
    assert_non_null(strstr(client_ask(sh, "*IDN?"), "VLP-16"));
    /* The second scanner's range limits are in the descriptor. */
    struct scanhead_frame frame;
    struct scanhead_info info;
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    do
        client_next(sh, &frame);
    while (frame.type != SCANHEAD_POINTS);
    assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_OK);
    assert_true(info.range_min_m == 1.0 && info.range_max_m == 9.5 && info.station == 2);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* Shots, points, and points that pass a test, in the first station's scan. */
struct tally {
    uint64_t shots, points, chosen;
};
static struct tally tally_of(struct wire *wire, const char *const *sets, int (*chosen)(const struct vertex *v))
{
    const char *more[MOST_ARGS] = {"--station", "1", "--ascii", "--empty-shots"};
    struct tally t = {0};
    for (int n = 4; *sets != NULL; n += 2) {
        more[n] = "--set";
        more[n + 1] = *sets++;
    }
    assert_int_equal(record(wire, "t.ply", more), 0);
    struct cloud c = cloud_open(wire, "t.ply");
    for (uint64_t i = 0; i < c.n; i++) {
        const struct vertex v = cloud_next(&c);
        t.shots++;
        t.points += v.echoes > 0;
        t.chosen += v.echoes > 0 && chosen(&v);
    }
    free(c.text);
    return t;
}

static int is_within(const struct vertex *v)
{
    return v->range_m >= 3.0 && v->range_m <= 5.0;
}

/* No range is within a micrometre of a limit by chance: 8,000 of them spread over metres. */
static void test_range_limit(void **state)
{
    struct wire *wire = *state;
    begin(wire);
    const char *const sets[] = {"head.range_min_m=3", "head.range_max_m=5", NULL};
    const struct tally whole = tally_of(wire, sets + 2, is_within), part = tally_of(wire, sets, is_within);
    assert_int_equal(whole.points, whole.shots);
    assert_true(whole.chosen > whole.shots / 10 && whole.chosen < whole.shots);
    assert_int_equal(part.shots, whole.shots);
    assert_int_equal(part.points, whole.chosen);
    assert_int_equal(part.chosen, part.points);
}

static int is_board(const struct vertex *v)
{
    return v->label == 6;
}

static int is_board_alone(const struct vertex *v)
{
    return v->label == 0 && fabs(v->p[0] - 2.0) < NEAR_M;
}

/* With the walls as the target, a pulse to the board is an empty shot, or meets the wall behind it. */
static void test_target(void **state)
{
    struct wire *wire = *state;
    begin(wire);
    const char *const walls[] = {"scene.target.objects.0=*o*t*",   "scene.target.objects.1=ea*",
                                 "scene.target.objects.2=ceiling", "scene.target.others=hide",
                                 "scene.target.objects.3=w?*st",   NULL};
    const char *const without[] = {walls[0], walls[1], walls[2], walls[4], "scene.target.objects.4=floor", NULL};
    const char *const board[] = {"scene.target.objects.0=b?ard", NULL}, *const all[] = {NULL};
    const struct tally whole = tally_of(wire, all, is_board);
    assert_true(whole.chosen > whole.shots / 20 && whole.points == whole.shots);
    const char *const hidden[] = {walls[0], walls[1], walls[2], walls[4], "scene.target.objects.4=floor",
                                  walls[3], NULL};
    struct tally t = tally_of(wire, hidden, is_board);
    assert_int_equal(t.shots, whole.shots);
    assert_int_equal(t.points, whole.shots - whole.chosen);
    assert_int_equal(t.chosen, 0);
    t = tally_of(wire, without, is_board);
    assert_int_equal(t.points, whole.shots);
    t = tally_of(wire, board, is_board_alone); /* the only label */
    assert_int_equal(t.points, whole.chosen);
    assert_int_equal(t.chosen, t.points);
    /* If the board cuts a footprint, the part on the wall stays: board and wall are metres apart, two echoes. */
    const char *const rings[] = {"beam.mode=rings", NULL};
    const char *const behind[] = {"beam.mode=rings", "scene.target.objects.0=*t*", "scene.target.objects.1=*l*",
                                  walls[3], NULL};
    const struct tally edges = tally_of(wire, rings, is_board);
    t = tally_of(wire, behind, is_board);
    assert_true(edges.points > whole.points);
    assert_int_equal(t.points, edges.points - edges.chosen);
    assert_int_equal(t.chosen, 0);
    expect_refusal(wire, "x.ply", (const char *const[]){"--set", "scene.target.objects.0=bord*", NULL},
                   "no object fits \"bord*\"; allowed names of the scene's 7 objects, similar ones are \"board\"");
    expect_refusal(wire, "x.ply", (const char *const[]){"--set", "scene.target.others=hide", NULL},
                   "scene.target.others: given, but there are no scene.target.objects");
}

/* An error of a scanner whose turn comes late is reported before the first scan, and there is no file. The room isn't 9
 * m high. */
static void test_wrong_at_the_end(void **state)
{
    struct wire *wire = *state;
    char config[352], ply[352];
    begin(wire);
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "wrong.ply"));
    const char *const words[] = {"record",    config,
                                 "--station", "all",
                                 "-o",        ply,
                                 "--set",     "stations.1.tripod.leg_m=1",
                                 "--set",     "stations.1.tripod.head_above_m=9",
                                 NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, words, "out", "err", -1)), 2);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(err, "stations[1] (station-2): tripod.head_above_m"));
    assert_null(strstr(err, " points"));
    free(err);
    assert_int_not_equal(access(ply, F_OK), 0);
}

static unsigned times_said(struct wire *wire, const char *text)
{
    unsigned n = 0;
    char *err = wire_read(wire_path(wire, "err"), NULL);
    for (const char *at = err; (at = strstr(at, text)) != NULL; at++)
        n++;
    free(err);
    return n;
}

/* A warning of several scanners is printed once, with their stations. A warning that all have is printed once, too. A
 * step of 7 deg divides no turn. */
static void test_warnings_are_said_once(void **state)
{
    struct wire *wire = *state;
    static const char step[] = "head.step_deg: 7 deg does not divide", fills[] = "output.attributes: on, but";
    static const char *const sets[] = {
        "--set",     "head={profile: sphere, step_deg: 6}",
        "--set",     "stations.0.scanner={head: {profile: sphere, step_deg: 7}}",
        "--set",     "stations.1.scanner={head: {profile: sphere, step_deg: 7, range_max_m: 20}}",
        "--set",     "stations.3={position_m: [0, 0, 0.2]}",
        "--set",     "head.station=4",
        "--set",     "output.attributes=on",
        "--station", "all",
        NULL};
    char config[352];
    begin(wire);
    assert_int_equal(record(wire, "all.ply", sets), 0);
    assert_int_equal(times_said(wire, step), 1);
    assert_int_equal(times_said(wire, "scanners of stations 1, 2: "), 1);
    assert_int_equal(times_said(wire, fills), 1);
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    const char *words[MOST_ARGS] = {"check", config};
    memcpy(words + 2, sets, 12 * sizeof *sets);
    assert_int_equal(wire_wait(wire, wire_spawn(wire, words, "out", "err", -1)), 0);
    assert_int_equal(times_said(wire, step), 1);
    assert_int_equal(times_said(wire, "scanners of stations 1, 2: "), 1);
    assert_int_equal(times_said(wire, fills), 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_together, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_what_a_file_cannot_hold, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_the_head_on_the_wire, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_range_limit, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_target, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_wrong_at_the_end, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_warnings_are_said_once, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
