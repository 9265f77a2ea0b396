/* Wrong input through the real program: exit status 2, one line on stderr that says what, where and what is
 * allowed, nothing on stdout, no file left behind. */
#include "tests/wire/room.h"

#include <sys/resource.h>

/* ---- the files that the cases need, written into each test's folder */

static const char GOOD[] = "head: {profile: full-sweep, prr_hz: 100000, lines_hz: 50, pan_deg_s: 100, frames: 1}\n"
                           "scene:\n"
                           "  meshes:\n"
                           "    - {file: room.obj, up: z, scale: 1}\n"
                           "stations:\n"
                           "  - {position_m: [0, 0, 0]}\n"
                           "links: [{type: \"null\"}]\n"
                           "plan: {tolerance_m: 1e-3}\n"; /* and a tenth of it for meshes */

/* How many files the folder holds. */
static int count_files(const struct wire *wire)
{
    DIR *dir = opendir(wire->dir);
    int n = -2;
    while (readdir(dir) != NULL)
        n++;
    closedir(dir);
    return n;
}

/* Lines of a text that are no warnings; *line is the last of them. */
static int count_errors(char *text, char **line)
{
    int n = 0;
    for (char *at = strtok(text, "\n"); at != NULL; at = strtok(NULL, "\n")) {
        if (strncmp(at, "scanhead: warning:", 18) == 0) continue;
        *line = at;
        n++;
    }
    return n;
}

/* All that is wrong is told, not only the first. */
static int complaints;

#define complain(...) (complaints++, print_message(__VA_ARGS__), print_message("\n"))

/* Runs the program; its status must be `status`, and its one line of error must have all of `says` (ends with
 * NULL). */
static void expect(struct wire *wire, const char *what, const char *const *args, int status, const char *const *says)
{
    int before = count_files(wire);
    int got = wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
    char *err = wire_read(wire_path(wire, "err"), NULL), *out = wire_read(wire_path(wire, "out"), NULL), *line = err;
    remove(wire_path(wire, "err"));
    remove(wire_path(wire, "out"));
    int left = count_files(wire), ends = err[0] != '\0' && err[strlen(err) - 1] == '\n', n = count_errors(err, &line);
    if (got != status) complain("# %s: status %d, not %d: %s", what, got, status, line);
    if (n != 1 || !ends) complain("# %s: %d lines of error: %s", what, n, line);
    if (strncmp(line, "scanhead", 8) != 0) complain("# %s: who says that? %s", what, line);
    for (; *says != NULL; says++)
        if (strstr(line, *says) == NULL) complain("# %s: no '%s' in: %s", what, *says, line);
    if (out[0] != '\0') complain("# %s: output: %.100s", what, out);
    if (left != before) complain("# %s: %d files before, %d after", what, before, left);
    free(err);
    free(out);
}

/* GOOD with one part replaced by another. */
static void write_config(const struct wire *wire, const char *part, const char *by)
{
    const char *at = strstr(GOOD, part);
    char text[2048];
    if (at == NULL) fail_msg("no '%s' in the good configuration", part);
    snprintf(text, sizeof text, "%.*s%s%s", (int)(at - GOOD), GOOD, by, at + strlen(part));
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
    {"unknown link", "\"null\"", "udp", {"config.yaml:7:", "links[0].type", "pty", "tcp", "file"}},
    {"port 65536", "\"null\"", "tcp, port: 65536", {"config.yaml:7:", "links[0].port", "0 to 65535"}},
    {"port of a pty", "\"null\"", "pty, port: 1", {"config.yaml:7:", "links[0].port", "type, path"}},
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
    complaints = 0;
    room_write(wire);
    for (size_t i = 0; i < sizeof CONFIGS / sizeof CONFIGS[0]; i++) {
        const struct config_case *c = &CONFIGS[i];
        write_config(wire, c->part, c->by);
        char config[352];
        snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
        expect(wire, c->what, (const char *const[]){i % 2 == 0 ? "run" : "check", config, NULL}, 2, c->says);
    }
    assert_int_equal(complaints, 0);
}

/* ---- meshes: each takes the place of room.obj; says: beside the file's name */

static const char CUT_PLY[] = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
                              "property float y\nproperty float z\nelement face 1\n"
                              "property list uchar int vertex_indices\nend_header\n0123456789";
#define STL_FACET(x)                                                 \
    "solid s\nfacet normal 0 0 1\nouter loop\nvertex " x             \
    " 5800000 0\nvertex 500001 5800000 0\nvertex 500001 5800001 0\n" \
    "endloop\nendfacet\nendsolid s\n"

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
    {"STL at UTM coordinates", "bad.stl", STL_FACET("500000"), {"bad.stl", ".ply"}},
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
    complaints = 0;
    char config[352], mesh[128];
    for (size_t i = 0; i < sizeof MESHES / sizeof MESHES[0]; i++) {
        if (MESHES[i].text != NULL) wire_write_text(wire, MESHES[i].name, MESHES[i].text);
        snprintf(mesh, sizeof mesh, "file: %s", MESHES[i].name);
        write_config(wire, "file: room.obj", mesh);
        snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
        expect(wire, MESHES[i].what, (const char *const[]){i % 2 == 0 ? "run" : "check", config, NULL}, 2,
               (const char *const[]){MESHES[i].says[0], MESHES[i].says[1],
                                     MESHES[i].says[1] != NULL ? MESHES[i].says[2] : NULL, NULL});
        remove(wire_path(wire, MESHES[i].name));
    }
    assert_int_equal(mkdir(wire_path(wire, "dir.obj"), 0700), 0);
    write_config(wire, "file: room.obj", "file: dir.obj");
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    expect(wire, "directory", (const char *const[]){"run", config, NULL}, 2,
           (const char *const[]){"config.yaml:4:", "dir.obj: a directory, not a file", NULL});
    assert_int_equal(complaints, 0);
}

static const char JOURNAL[] = "# scanhead journal 1\n0 0 1 *RST\n";

/* ---- options. CONFIG stands for a good configuration, DIR for the folder. */

static const struct {
    const char *args[8];
    const char *says[3];
} OPTIONS[] = {
    {{"fly"}, {"unknown command fly;", "--help"}},
    {{"recrod", "CONFIG"}, {"unknown command recrod, did you mean record?"}},
    {{"run"}, {"one CONFIG"}},
    {{"run", "CONFIG", "CONFIG"}, {"one CONFIG is needed, and 2 are given", "config.yaml, ", "config.yaml; see"}},
    {{"run", "--", "CONFIG", "--start"}, {"one CONFIG is needed, and 2 are given", "--start"}},
    {{"report", "CONFIG", "DIR/x.ply", "DIR/y.ply"}, {"y.ply is one too many"}},
    {{"run", "DIR/scan.shs"}, {"scan.shs is a recorded stream", "scanhead record ", "scan.shs -o points.ply"}},
    {{"check", "DIR/SCAN.SHS"}, {"SCAN.SHS is a recorded stream"}},
    {{"plan", "DIR/room.obj"}, {"room.obj is a mesh", "scanhead init ", "room.obj writes a configuration"}},
    {{"record", "DIR/room.ifc", "-o", "DIR/x.ply"}, {"room.ifc is a mesh, and SOURCE is a head", "scanhead init "}},
    {{"report", "DIR/x.ply", "CONFIG"}, {"x.ply is a mesh or a point cloud, and CONFIG is a configuration"}},
    {{"check", "DIR/x.las"}, {"x.las is a recording", "scanhead report CONFIG "}},
    {{"run", "CONFIG", "-start"}, {"-start: did you mean --start?"}},
    {{"run", "CONFIG", "-stats=x"}, {"-stats=x: did you mean --stats?"}},
    {{"run", "CONFIG", "--strat"}, {"unknown option --strat, did you mean --start?"}},
    {{"run", "CONFIG", "--thread=2", "--durations", "2"}, {"unknown option --durations, did you mean --duration?"}},
    {{"run", "CONFIG", "--start=1"}, {"--start=1: the option takes no value"}},
    {{"record", "CONFIG", "-out", "DIR/x.ply"}, {"-out: did you mean --output FILE, or -o FILE?"}},
    {{"record", "-out", "DIR/x.ply", "CONFIG"}, {"-out: did you mean --output FILE, or -o FILE?"}},
    {{"record", "CONFIG", "-o", "DIR/x.ply", "-station", "2"}, {"-station: did you mean --station?"}},
    {{"run", "DIR/none.yaml"}, {"none.yaml", "No such file"}},
    {{"run", "DIR"}, {"irectory"}},
    {{"run", "DIR/fifo"}, {"fifo: cannot be opened: a FIFO, not a file"}},
    {{"run", "CONFIG", "--replay-journal", "DIR/fifo"}, {"fifo: a FIFO, not a file"}},
    {{"run", "CONFIG", "--replay-journal", "/dev/zero"}, {"/dev/zero: a device, not a file"}},
    {{"run", "CONFIG", "--journal", "DIR/journal", "--replay-journal", "DIR/./journal"}, {"--journal ", "overwrite"}},
    {{"run", "CONFIG", "--journal", "DIR/link", "--replay-journal", "DIR/journal"}, {"--journal ", "overwrite"}},
    {{"check", "CONFIG", "--set", "platform.kind=trajectory", "--set", "platform.file=DIR/fifo"},
     {"fifo: a FIFO, not a file"}},
    {{"record", "DIR/fifo.shs", "-o", "DIR/x.ply"}, {"fifo.shs: is a FIFO, not a recorded stream"}},
    {{"report", "CONFIG", "DIR/fifo"}, {"fifo: a FIFO, not a file"}},
    {{"check", "--help", "haed"}, {"no section \"haed\", did you mean head?", "scene, stations", "profile"}},
    {{"run", "CONFIG", "--fast"}, {"--fast", "run --help"}},
    {{"run", "CONFIG", "--pace"}, {"--pace", "needs a value"}},
    {{"run", "CONFIG", "--pace", "foo"}, {"loop.pace", "realtime", "step"}},
    {{"run", "CONFIG", "--threads", "x"}, {"loop.threads", "0 to 64"}},
    {{"run", "CONFIG", "--threads", "-1"}, {"loop.threads", "0 to 64"}},
    {{"run", "CONFIG", "--threads", "2x"}, {"loop.threads", "0 to 64"}},
    {{"run", "CONFIG", "--duration", "-1"}, {"--duration -1", "0.001"}},
    {{"run", "CONFIG", "--duration", "nan"}, {"--duration nan"}},
    {{"run", "CONFIG", "--duration", "5s"}, {"--duration 5s"}},
    {{"run", "CONFIG", "--duration", ""}, {"--duration"}},
    {{"run", "CONFIG", "--frames", "many"}, {"head.frames", "0 to 1000000"}},
    {{"run", "CONFIG", "--ready-fd", "zero"}, {"--ready-fd zero", "1 to 65535"}},
    {{"run", "CONFIG", "--quiet", "--ready-fd", "77"}, {"--ready-fd 77"}},
    {{"run", "CONFIG", "--set", "head.prr_hz"}, {"--set", "head.prr_hz"}},
    {{"run", "CONFIG", "--set", "head.prr_hz=fast"}, {"--set head.prr_hz", "not a number", "1000 to 2200000 Hz"}},
    {{"run", "CONFIG", "--set", "head.colour=red"}, {"--set", "head.colour"}},
    {{"run", "CONFIG", "--set", "links[3].type=tcp"}, {"links[3]"}},
    {{"run", "CONFIG", "--set", "links=[]"}, {"links"}},
    {{"run", "CONFIG", "--replay-journal", "DIR/none"}, {"none", "No such file"}},
    {{"run", "CONFIG", "--replay-journal", "CONFIG"}, {"config.yaml:1", "journal"}},
    {{"check"}, {"one CONFIG"}},
    {{"check", "CONFIG", "--pace", "fast"}, {"--pace"}},
    {{"report", "CONFIG"}, {"one CONFIG and one CLOUD", "report --help"}},
    {{"report", "CONFIG", "DIR/x.ply", "--max-m", "0"}, {"--max-m 0", "1000000000"}},
    {{"report", "CONFIG", "DIR/x.ply", "--json=1"}, {"--json=1: the option takes no value"}},
    {{"map", "CONFIG", "-o", "DIR/x.png", "--pixel-m", "1m"}, {"--pixel-m 1m", "0.0001 to 10000"}},
    {{"record", "CONFIG", "-o", "DIR/x.ply", "--frames", "1.5"}, {"--frames 1.5", "whole number from 0"}},
    {{"record", "CONFIG"}, {"-o FILE"}},
    {{"record", "-o", "DIR/x.ply"}, {"one SOURCE"}},
    {{"record", "CONFIG", "-o", "DIR/x.xyz"}, {"x.xyz", ".ply"}},
    {{"record", "CONFIG", "-o"}, {"-o", "needs a value"}},
    {{"record", "CONFIG", "-o", "DIR/x.ply", "--station", "0"}, {"--station 0", "1"}},
    {{"record", "CONFIG", "-o", "DIR/x.ply", "--frames", "0"}, {"head.frames", "--duration"}},
    {{"record", "CONFIG", "-o", "DIR/x.ply", "--crs", "moon"}, {"output.crs", "utm"}},
    {{"record", "tcp:localhost", "-o", "DIR/x.ply"}, {"tcp:localhost", "PORT"}},
    {{"record", "DIR/none.shs", "-o", "DIR/x.ply"}, {"none.shs", "No such file"}},
    {{"record", "tty:/dev/null", "-o", "DIR/x.ply"}, {"/dev/null", "terminal"}},
    {{"record", "tcp:localhost:1", "--set", "a=b", "-o", "DIR/x.ply"}, {"--set", "CONFIG"}},
    {{"record", "CONFIG", "-o", "DIR/x.las", "--las-version", "1.3"}, {"--las-version 1.3", "1.2, 1.4"}},
    {{"record", "CONFIG", "-o", "DIR/x.ply", "--colour", "red"}, {"--colour red", "reflectance, label"}},
    {{"record", "CONFIG", "-o", "DIR/x.ply", "--ply-names", "x"}, {"--ply-names x", "scanhead, cloudcompare"}},
    {{"record", "CONFIG", "-o", "DIR/x.e57", "--ply-names", "cloudcompare"}, {"--ply-names: no .ply"}},
    {{"record", "CONFIG", "-o", "DIR/x.ply", "--las-version", "1.2"}, {"--las-version: no .las"}},
    {{"record", "CONFIG", "-o", "DIR/x.ptx", "--colour", "label"}, {"--colour: no .ply or .las"}},
    {{"map", "CONFIG"}, {"-o"}},
    {{"list", "all"}, {"no arguments"}},
};

/* The word with CONFIG and DIR replaced. */
static const char *fill_in(const struct wire *wire, const char *word, char *buf, size_t len)
{
    const char *dir = strstr(word, "DIR");
    if (strcmp(word, "CONFIG") == 0)
        snprintf(buf, len, "%s", wire_path(wire, "config.yaml"));
    else if (dir != NULL)
        snprintf(buf, len, "%.*s%s%s", (int)(dir - word), word, wire->dir, dir + 3);
    else
        return word;
    return buf;
}

static void test_options(void **state)
{
    struct wire *wire = *state;
    complaints = 0;
    room_write(wire);
    wire_write_text(wire, "config.yaml", GOOD);
    wire_write_text(wire, "journal", JOURNAL);
    assert_int_equal(symlink("journal", wire_path(wire, "link")), 0);
    assert_int_equal(mkfifo(wire_path(wire, "fifo"), 0600), 0);
    assert_int_equal(mkfifo(wire_path(wire, "fifo.shs"), 0600), 0);
    for (size_t i = 0; i < sizeof OPTIONS / sizeof OPTIONS[0]; i++) {
        char word[8][352], what[128] = "";
        const char *args[9] = {0};
        for (int k = 0; k < 8 && OPTIONS[i].args[k] != NULL; k++) {
            args[k] = fill_in(wire, OPTIONS[i].args[k], word[k], sizeof word[k]);
            snprintf(what + strlen(what), sizeof what - strlen(what), "%s ", OPTIONS[i].args[k]);
        }
        const char *const says[] = {OPTIONS[i].says[0], OPTIONS[i].says[1],
                                    OPTIONS[i].says[1] ? OPTIONS[i].says[2] : NULL, NULL};
        expect(wire, what, args, 2, says);
    }
    char *journal = wire_read(wire_path(wire, "journal"), NULL);
    assert_string_equal(journal, JOURNAL);
    free(journal);
    assert_int_equal(complaints, 0);
}

/* ---- help */

/* -h and --help of a command, on standard output: what it does, the usage, lines of at most 110 columns.
 * Those of check end where the keys begin. */
static void expect_help(struct wire *wire, const char *name, const char *option)
{
    char want[128];
    int status = wire_wait(wire, wire_spawn(wire, (const char *const[]){name, option, NULL}, "out", "err", -1));
    char *out = wire_read(wire_path(wire, "out"), NULL), *err = wire_read(wire_path(wire, "err"), NULL);
    if (status != 0 || err[0] != '\0') complain("# %s %s: status %d: %s", name, option, status, err);
    snprintf(want, sizeof want, "scanhead %s: ", name);
    if (strncmp(out, want, strlen(want)) != 0) complain("# %s %s: begins with %.40s", name, option, out);
    snprintf(want, sizeof want, "\n\nusage: scanhead %s", name);
    if (strstr(out, want) == NULL) complain("# %s %s: no usage", name, option);
    if (strstr(out, "  -h, --help ") == NULL) complain("# %s %s: no --help in it", name, option);
    char *keys = strstr(out, "Configuration keys:");
    if (keys != NULL) *keys = '\0';
    for (char *at = strtok(out, "\n"); at != NULL; at = strtok(NULL, "\n"))
        if (strlen(at) > 110) complain("# %s %s: %zu columns: %s", name, option, strlen(at), at);
    free(out);
    free(err);
}

static void test_help(void **state)
{
    struct wire *wire = *state;
    int n = 0;
    complaints = 0;
    assert_int_equal(wire_wait(wire, wire_spawn(wire, (const char *const[]){"--help", NULL}, "all", "err", -1)), 0);
    char *all = wire_read(wire_path(wire, "all"), NULL), name[16];
    for (const char *at = all; (at = strstr(at, "\n  scanhead ")) != NULL; at++, n++) {
        assert_int_equal(sscanf(at, " scanhead %15s", name), 1);
        expect_help(wire, name, "--help");
        expect_help(wire, name, "-h");
    }
    free(all);
    assert_true(n >= 7);
    assert_int_equal(complaints, 0);
}

/* ---- links that cannot be opened, and files that cannot be written */

static void expect_link(struct wire *wire, const char *what, const char *link, int status, const char *says)
{
    char config[352];
    write_config(wire, "{type: \"null\"}", link);
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    expect(wire, what, (const char *const[]){"run", config, NULL}, status, (const char *const[]){says, NULL});
}

static void test_links(void **state)
{
    struct wire *wire = *state;
    complaints = 0;
    char link[128];
    room_write(wire);
    wire_write_text(wire, "plain", "keep me\n");
    expect_link(wire, "symlink path that is a file", "{type: pty, path: plain}", 2,
                "plain: exists and is not a symlink");
    char *kept = wire_read(wire_path(wire, "plain"), NULL);
    assert_string_equal(kept, "keep me\n");
    free(kept);
    expect_link(wire, "symlink in no folder", "{type: pty, path: none/port}", 2, "none/port");
    expect_link(wire, "file in no folder", "{type: file, path: none/x}", 2, "none/x");
    expect_link(wire, "file that is a folder", "{type: file, path: .}", 2, "irectory");
    expect_link(wire, "no such address", "{type: tcp, address: 300.1.1.1}", 2, "300.1.1.1");

    /* A live platform's socket is asked by `check`, too. */
    char config[352];
    write_config(wire, "{type: \"null\"}", "{type: \"null\"}");
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    expect(wire, "no such address of a platform",
           (const char *const[]){"check", config, "--set", "platform.kind=live", "--set", "platform.address=x y", NULL},
           2, (const char *const[]){"platform.address x y: no such address", NULL});

    struct sockaddr_in at = {.sin_family = AF_INET};
    socklen_t len = sizeof at;
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(listen(fd, 1), 0);
    getsockname(fd, (struct sockaddr *)&at, &len);
    snprintf(link, sizeof link, "{type: tcp, port: %d}", ntohs(at.sin_port));
    /* 2, as the remedy is another port in the configuration. */
    expect_link(wire, "port in use", link, 2, "Address already in use; port 0 lets the system choose");
    /* A pty made before the link that failed is gone again. */
    snprintf(link, sizeof link, "{type: pty, path: port}, {type: tcp, port: %d}", ntohs(at.sin_port));
    expect_link(wire, "port in use, after a pty", link, 2, "Address already in use");
    close(fd);
    assert_int_equal(complaints, 0);
}

/* The system's failures are status 1: a full disk, a refused connection. */
static void test_system_failures(void **state)
{
    struct wire *wire = *state;
    complaints = 0;
    char config[352], port[64];
    room_write(wire);
    snprintf(config, sizeof config, "%s", wire_write_text(wire, "config.yaml", GOOD));
    expect(wire, "statistics on a full disk",
           (const char *const[]){"run", config, "--duration", "0.1", "--pace", "fast", "--quiet", "--stats",
                                 "/dev/full", NULL},
           1, (const char *const[]){"No space left", NULL});
    expect(wire, "statistics in no folder",
           (const char *const[]){"run", config, "--duration", "0.1", "--pace", "fast", "--quiet", "--stats", "/none/x",
                                 NULL},
           2, (const char *const[]){"/none/x", "No such file", NULL});
    struct sockaddr_in at = {.sin_family = AF_INET};
    socklen_t len = sizeof at;
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0); /* bound, not listening: nobody is there */
    getsockname(fd, (struct sockaddr *)&at, &len);
    snprintf(port, sizeof port, "tcp:127.0.0.1:%d", ntohs(at.sin_port));
    expect(wire, "nobody listens", (const char *const[]){"record", port, "-o", wire_path(wire, "x.ply"), NULL}, 1,
           (const char *const[]){port, "Connection refused", NULL});
    close(fd);
    assert_int_equal(complaints, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_configurations, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_meshes, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_options, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_help, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_links, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_system_failures, wire_setup, wire_teardown),
    };
    setrlimit(RLIMIT_CORE, &(struct rlimit){0, 0});
    return cmocka_run_group_tests(tests, NULL, NULL);
}
