/* SPDX-License-Identifier: MIT */
/* Wrong input through the real program: exit status 2, one line on stderr that names the error, its place and the
 * allowed values, nothing on stdout, no new file. */
#include "tests/common/collada.h"
#include "tests/wire/room.h"
#include "tests/wire/usage_rig.h"

#include <sys/resource.h>

/* Writes USAGE_GOOD with one part replaced by another. */
static void write_config(const struct wire *wire, const char *part, const char *by)
{
    const char *at = strstr(USAGE_GOOD, part);
    char text[2048];
    if (at == NULL) fail_msg("no '%s' in the good configuration", part);
    snprintf(text, sizeof text, "%.*s%s%s", (int)(at - USAGE_GOOD), USAGE_GOOD, by, at + strlen(part));
    wire_write_text(wire, "config.yaml", text);
}

struct config_case {
    const char *what, *part, *by;
    const char *says[6]; /* beside the file: its line, the key, what is allowed */
};

#define LONG_40 "0123456789012345678901234567890123456789"

static const struct config_case CONFIGS[] = {
    {"unknown key", "frames: 1", "frame: 1", {"config.yaml:1:", "head.frame", "frames"}},
    {"unknown section", "links:", "wires:", {"config.yaml:7:", "wires", "links"}},
    {"duplicate key", "frames: 1", "frames: 1, frames: 2", {"config.yaml:1:", "head.frames"}},
    {"unit in the value",
     "prr_hz: 100000",
     "prr_hz: 100 kHz",
     {"config.yaml:1:", "head.prr_hz", "not a number", "1000 to 2200000 Hz"}},
    {"NaN", "prr_hz: 100000", "prr_hz: .nan", {"config.yaml:1:", "head.prr_hz", "not a number", "1000 to 2200000 Hz"}},
    {"nan", "prr_hz: 100000", "prr_hz: nan", {"config.yaml:1:", "head.prr_hz"}},
    {"infinity", "lines_hz: 50", "lines_hz: .inf", {"config.yaml:1:", "head.lines_hz", "4 to 1000 Hz"}},
    {"above the profile",
     "prr_hz: 100000",
     "prr_hz: 2200000.1",
     {"config.yaml:1:", "head.prr_hz", "1000 to 2200000 Hz"}},
    {"below the profile", "lines_hz: 50", "lines_hz: 3.9", {"config.yaml:1:", "head.lines_hz", "4 to 1000 Hz"}},
    {"negative speed", "pan_deg_s: 100", "pan_deg_s: -1", {"config.yaml:1:", "head.pan_deg_s", "0 to 360 deg/s"}},
    {"finer than a micro-unit", "lines_hz: 50", "lines_hz: 50.0000001", {"config.yaml:1:", "head.lines_hz"}},
    {"a list for a number", "lines_hz: 50", "lines_hz: [50]", {"config.yaml:1:", "head.lines_hz"}},
    {"text for a number", "lines_hz: 50", "lines_hz: fifty", {"config.yaml:1:", "head.lines_hz", "fifty"}},
    {"empty value", "lines_hz: 50", "lines_hz: ", {"config.yaml:1:", "head.lines_hz"}},
    {"half a frame", "frames: 1", "frames: 1.5", {"config.yaml:1:", "head.frames", "0 to 1000000"}},
    {"line start above stop",
     "frames: 1",
     "frames: 1, line_start_deg: 20, line_stop_deg: 10",
     {"config.yaml:1:", "head.line_st", "below"}},
    {"pan out of order",
     "frames: 1",
     "frames: 1, pan_start_deg: 20, pan_stop_deg: 10",
     {"config.yaml:1:", "head.pan_st"}},
    {"no such station", "frames: 1", "frames: 1, station: 2", {"config.yaml:1:", "head.station", "1 to 1"}},
    {"no profile", "profile: full-sweep, ", "", {"config.yaml:", "head.profile"}},
    {"unknown profile", "full-sweep", "half-sweep", {"config.yaml:1:", "head.profile", "half-sweep"}},
    {"no meshes", "    - {file: room.obj, up: z, scale: 1}\n", "", {"config.yaml:", "scene.meshes"}},
    {"no up axis", "up: z, ", "", {"config.yaml:4:", "scene.meshes[0].up", "z", "y"}},
    {"unknown up axis", "up: z", "up: x", {"config.yaml:4:", "scene.meshes[0].up", "z", "y"}},
    {"no scale", ", scale: 1", "", {"config.yaml:4:", "scene.meshes[0].scale"}},
    {"scale 0", "scale: 1", "scale: 0", {"config.yaml:4:", "scene.meshes[0].scale", "1e-09", "m/unit"}},
    {"no position", "position_m: [0, 0, 0]", "name: here", {"config.yaml:6:", "stations[0].position_m"}},
    {"two coordinates", "[0, 0, 0]", "[0, 0]", {"config.yaml:6:", "stations[0].position_m"}},
    {"NaN coordinate", "[0, 0, 0]", "[0, .nan, 0]", {"config.yaml:6:", "stations[0].position_m"}},
    {"UTM without latitude",
     "links:",
     "output: {crs: utm}\nlinks:",
     {"config.yaml:6:", "stations[0].lat_deg", "-90 to 90 deg"}},
    {"unknown CRS",
     "links:",
     "output: {crs: mercator}\nlinks:",
     {"config.yaml:7:", "output.crs", "local", "ecef", "utm"}},
    {"zone 61", "links:", "output: {utm_zone: 61}\nlinks:", {"config.yaml:7:", "output.utm_zone", "0 to 60"}},
    {"too fine a scale",
     "links:",
     "output: {scale_m: 1e-9}\nlinks:",
     {"config.yaml:7:", "output.scale_m", "1e-6 to 1 m"}},
    {"unknown link", "\"null\"", "uart", {"config.yaml:7:", "links[0].type", "pty", "tcp", "file"}},
    {"port 65536", "\"null\"", "tcp, port: 65536", {"config.yaml:7:", "links[0].port", "0 to 65535"}},
    {"port of a pty",
     "\"null\"",
     "pty, port: 1",
     {"config.yaml:7:", "links[0].port", "allowed type, protocol, dialect, path"}},
    {"9 sessions", "\"null\"", "tcp, max_sessions: 9", {"config.yaml:7:", "links[0].max_sessions", "1 to 8"}},
    {"file link without path", "\"null\"", "file", {"config.yaml:7:", "links[0].path"}},
    {"tick rate 999", "links:", "loop: {tick_hz: 999}\nlinks:", {"config.yaml:7:", "loop.tick_hz", "divisor"}},
    {"ahead too far", "links:", "loop: {ahead_ms: 91}\nlinks:", {"config.yaml:7:", "loop.ahead_ms", "2 to 90 ms"}},
    {"65 threads", "links:", "loop: {threads: 65}\nlinks:", {"config.yaml:7:", "loop.threads", "0 to 64"}},
    {"unknown pace",
     "links:",
     "loop: {pace: quick}\nlinks:",
     {"config.yaml:7:", "loop.pace", "realtime", "fast", "step"}},
    {"noise maybe", "links:", "noise: {range: maybe}\nlinks:", {"config.yaml:7:", "noise.range"}},
    {"broken YAML", "links:", "\tlinks:", {"config.yaml:"}},
    {"YAML left open", "links: [{", "links: [[{", {"config.yaml:"}},
    {"serial too long", "frames: 1", "frames: 1, serial: " LONG_40, {"config.yaml:1:", "head.serial"}},
};

static void test_configurations(void **state)
{
    struct wire *wire = *state;
    usage_complaints = 0;
    room_write(wire);
    for (size_t i = 0; i < sizeof CONFIGS / sizeof CONFIGS[0]; i++) {
        const struct config_case *c = &CONFIGS[i];
        write_config(wire, c->part, c->by);
        char config[352];
        snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
        usage_expect(wire, c->what, (const char *const[]){i % 2 == 0 ? "run" : "check", config, NULL}, 2, c->says);
    }
    assert_int_equal(usage_complaints, 0);
}

/* ---- meshes: each takes the place of room.obj; says: beside the file's name */

static const char CUT_PLY[] = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
                              "property float y\nproperty float z\nelement face 1\n"
                              "property list uchar int vertex_indices\nend_header\n0123456789";
static const struct {
    const char *what, *name, *text; /* text NULL: no such file */
    const char *says[3];
} MESHES[] = {
    {"missing mesh", "none.obj", NULL, {"config.yaml:4:", "scene.meshes[0].file", "No such file"}},
    {"unknown ending", "room.3ds", "x", {"config.yaml:4:", ".obj .ply .stl"}},
    {"no ending", "room", "x", {"config.yaml:4:", ".obj .ply .stl"}},
    {"empty OBJ", "bad.obj", "", {"bad.obj"}},
    {"OBJ without faces", "bad.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", {"bad.obj", "no triangles"}},
    {"OBJ with NaN", "bad.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", {"bad.obj, line 2", "nan"}},
    {"OBJ with infinity", "bad.obj", "v 0 0 0\nv 0 inf 0\nv 0 1 0\nf 1 2 3\n", {"bad.obj, line 2", "inf"}},
    {"OBJ beyond 1e9 m", "bad.obj", "v 0 0 0\nv 2e9 0 0\nv 0 1 0\nf 1 2 3\n", {"bad.obj", "1e+09"}},
    {"OBJ index out of range", "bad.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", {"bad.obj, line 4", "4"}},
    {"OBJ index 0", "bad.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", {"bad.obj, line 4"}},
    {"OBJ face of text", "bad.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf one two three\n", {"bad.obj, line 4"}},
    {"OBJ vertex of two", "bad.obj", "v 0 0\nf 1 1 1\n", {"bad.obj, line 1"}},
    {"OBJ without area", "bad.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", {"bad.obj", "no triangles"}},
    {"empty PLY", "bad.ply", "", {"bad.ply"}},
    {"PLY that is none", "bad.ply", "plywood\n", {"bad.ply"}},
    {"PLY cut in its data", "bad.ply", CUT_PLY, {"bad.ply"}},
    {"PLY cut in its header", "bad.ply", "ply\nformat ascii 1.0\nelement vertex 3\n", {"bad.ply"}},
    {"STL garbage", "bad.stl", "\x01\x02garbage", {"bad.stl"}},
    {"Collada at UTM coordinates",
     "bad.dae",
     COLLADA_TRIANGLE("500000 5800000 0 500001 5800000 0 500001 5800001 0"),
     {"bad.dae", ".ply"}},
    {"empty glTF", "bad.gltf", "{}", {"bad.gltf"}},
    {"glTF that is none", "bad.glb", "glTFxxxx", {"bad.glb"}},
    {"IFC that is none", "bad.ifc", "ISO-10303-21;", {"bad.ifc"}},
    {"IFC with a record missing",
     "bad.ifc",
     "ISO-10303-21;\nDATA;\n#2= IFCSITE('a#9',$);\n#1= IFCRELAGGREGATES('b',$,$,$,#2,(#3));\nEND-ISO-10303-21;\n",
     {"bad.ifc, line 4", "#1 refers to #3"}},
};

static void test_meshes(void **state)
{
    struct wire *wire = *state;
    usage_complaints = 0;
    char config[352], mesh[128];
    for (size_t i = 0; i < sizeof MESHES / sizeof MESHES[0]; i++) {
        if (MESHES[i].text != NULL) wire_write_text(wire, MESHES[i].name, MESHES[i].text);
        snprintf(mesh, sizeof mesh, "file: %s", MESHES[i].name);
        write_config(wire, "file: room.obj", mesh);
        snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
        usage_expect(wire, MESHES[i].what, (const char *const[]){i % 2 == 0 ? "run" : "check", config, NULL}, 2,
                     (const char *const[]){MESHES[i].says[0], MESHES[i].says[1],
                                           MESHES[i].says[1] != NULL ? MESHES[i].says[2] : NULL, NULL});
        remove(wire_path(wire, MESHES[i].name));
    }
    assert_int_equal(mkdir(wire_path(wire, "dir.obj"), 0700), 0);
    write_config(wire, "file: room.obj", "file: dir.obj");
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    usage_expect(wire, "directory", (const char *const[]){"run", config, NULL}, 2,
                 (const char *const[]){"config.yaml:4:", "dir.obj: a directory, not a file", NULL});
    assert_int_equal(usage_complaints, 0);
}
/* ---- links that cannot be opened, and files that cannot be written */

static void expect_link(struct wire *wire, const char *what, const char *link, int status, const char *says)
{
    char config[352];
    write_config(wire, "{type: \"null\"}", link);
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    usage_expect(wire, what, (const char *const[]){"run", config, NULL}, status, (const char *const[]){says, NULL});
}

static void test_links(void **state)
{
    struct wire *wire = *state;
    usage_complaints = 0;
    char link[128], pts[64];
    int master;
    room_write(wire);
    wire_write_text(wire, "plain", "keep me\n");
    expect_link(wire, "symlink path that is a file", "{type: pty, path: plain}", 2,
                "plain: exists and is not a symlink");
    char *kept = wire_read(wire_path(wire, "plain"), NULL);
    assert_string_equal(kept, "keep me\n");
    free(kept);
    assert_int_equal(symlink("/dev/null", wire_path(wire, "device")), 0);
    expect_link(wire, "symlink to a device", "{type: pty, path: device}", 2,
                "device: exists and leads to something that is not a terminal of this program");
    master = posix_openpt(O_RDWR | O_NOCTTY);
    assert_true(master >= 0 && unlockpt(master) == 0 && ptsname_r(master, pts, sizeof pts) == 0);
    assert_int_equal(symlink(pts, wire_path(wire, "taken")), 0);
    expect_link(wire, "symlink to a terminal", "{type: pty, path: taken}", 2,
                "taken: exists and leads to a terminal in use by another program");
    close(master);
    expect_link(wire, "symlink in no folder", "{type: pty, path: none/port}", 2, "none/port");
    expect_link(wire, "file in no folder", "{type: file, path: none/x}", 2, "none/x");
    expect_link(wire, "file that is a folder", "{type: file, path: .}", 2, "irectory");
    expect_link(wire, "no such address", "{type: tcp, address: 300.1.1.1}", 2, "300.1.1.1");

    /* `check` opens a live platform's socket, too. */
    char config[352];
    write_config(wire, "{type: \"null\"}", "{type: \"null\"}");
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    usage_expect(
        wire, "no such address of a platform",
        (const char *const[]){"check", config, "--set", "platform.kind=live", "--set", "platform.address=x y", NULL}, 2,
        (const char *const[]){"platform.address x y: no such address", NULL});

    int port;
    const int fd = wire_bind(SOCK_STREAM, &port);
    assert_int_equal(listen(fd, 1), 0);
    snprintf(link, sizeof link, "{type: tcp, port: %d}", port);
    /* The status is 2, as the remedy is another port in the configuration. */
    expect_link(wire, "port in use", link, 2, "Address already in use; port 0 lets the system choose");
    /* A pty made before the link that failed is removed again. */
    snprintf(link, sizeof link, "{type: pty, path: port}, {type: tcp, port: %d}", port);
    expect_link(wire, "port in use, after a pty", link, 2, "Address already in use");
    close(fd);
    assert_int_equal(usage_complaints, 0);
}

/* The system's failures have status 1: a full disk, a refused connection. */
static void test_system_failures(void **state)
{
    struct wire *wire = *state;
    usage_complaints = 0;
    char config[352], source[64];
    room_write(wire);
    snprintf(config, sizeof config, "%s", wire_write_text(wire, "config.yaml", USAGE_GOOD));
    usage_expect(wire, "statistics on a full disk",
                 (const char *const[]){"run", config, "--duration", "0.1", "--pace", "fast", "--quiet", "--stats",
                                       "/dev/full", NULL},
                 1, (const char *const[]){"No space left", NULL});
    int port;
    const int fd = wire_bind(SOCK_STREAM, &port);
    snprintf(source, sizeof source, "tcp:127.0.0.1:%d", port);
    usage_expect(wire, "nobody listens", (const char *const[]){"record", source, "-o", wire_path(wire, "x.ply"), NULL},
                 1, (const char *const[]){source, "Connection refused", NULL});
    close(fd);
    assert_int_equal(usage_complaints, 0);
}

/* The second failure is a warning. */
static void test_two_failures_are_both_shown(void **state)
{
    static const char *const begins[][6] = {{"run", "--start", "--pace", "fast"}, {"record"}};
    struct wire *wire = *state;
    char config[352], scenario[352];
    room_write(wire);
    snprintf(config, sizeof config, "%s", wire_write_text(wire, "config.yaml", USAGE_GOOD));
    snprintf(scenario, sizeof scenario, "%s",
             wire_write_text(wire, "faults.yaml",
                             "faults: [{kind: drop, every: 10}, {kind: mirror_wobble, deg: 0.2, hz: 12}]\n"));
    for (size_t i = 0; i < sizeof begins / sizeof begins[0]; i++) {
        const char *args[20] = {0};
        const char *const rest[] = {config,      "--duration", "0.1",       "--quiet",    "--stats",
                                    "/dev/full", "--truth",    "/dev/full", "--scenario", scenario};
        memcpy(args, begins[i], sizeof begins[i]);
        size_t n = 0;
        while (args[n] != NULL)
            n++;
        memcpy(args + n, rest, sizeof rest);
        const int status = wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
        char *text = wire_read(wire_path(wire, "err"), NULL);
        if (status != 1 || strstr(text, "scanhead: /dev/full: ") == NULL ||
            strstr(text, "warning: truth: /dev/full: ") == NULL)
            fail_msg("%s: %s", args[0], text);
        free(text);
    }
}

/* The shell sets a limit that is too small for any command. Such a limit gives an error, not a crash. */
static void test_small_stack(void **state)
{
    struct wire *wire = *state;
    const char *const args[] = {"-c", "ulimit -s 64; exec \"$0\" --version", wire_program(), NULL};
    assert_int_equal(wire_wait(wire, wire_spawn_program(wire, "/bin/sh", args, "out", "err", -1)), 2);
    char *text = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(text, "64 KiB"));
    assert_non_null(strstr(text, "ulimit -s 1024"));
    assert_ptr_equal(strchr(text, '\n'), text + strlen(text) - 1);
    free(text);
}

/* Another program has made the pipe of standard output non-blocking, and reads more slowly than the command writes. */
static void test_pipe_of_another(void **state)
{
    enum { ROOM = 1 << 20, PIPE_BYTES = 4096 }; /* the help is some times longer than the pipe */
    struct wire *wire = *state;
    const char *const args[] = {"-c", "exec \"$0\" check --help >&3", wire_program(), NULL};
    size_t whole, len = 0;
    int fd[2];
    wire_run_program(wire, wire_program(), (const char *const[]){"check", "--help", NULL}, 0);
    char *want = wire_read(wire_path(wire, "out"), &whole), *got = malloc(ROOM);
    assert_in_range(whole, 4 * PIPE_BYTES, ROOM);
    assert_int_equal(pipe(fd), 0);
    assert_true(fcntl(fd[1], F_SETPIPE_SZ, PIPE_BYTES) >= 0);
    assert_int_equal(fcntl(fd[1], F_SETFL, O_NONBLOCK), 0);
    const pid_t pid = wire_spawn_program(wire, "/bin/sh", args, "out", "err", fd[1]);
    close(fd[1]);
    for (ssize_t n; (n = read(fd[0], got + len, ROOM - len)) > 0;)
        len += (size_t)n;
    close(fd[0]);
    assert_int_equal(wire_wait(wire, pid), 0);
    assert_int_equal(len, whole);
    assert_memory_equal(got, want, whole);
    free(want);
    free(got);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_pipe_of_another, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_small_stack, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_configurations, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_meshes, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_links, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_system_failures, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_two_failures_are_both_shown, wire_setup, wire_teardown),
    };
    setrlimit(RLIMIT_CORE, &(struct rlimit){0, 0});
    return cmocka_run_group_tests(tests, NULL, NULL);
}
