/* SPDX-License-Identifier: MIT */
/* Options and help of each command. A wrong one gives exit status 2 and one line of error, which suggests what was
 * meant. */
#include "tests/wire/room.h"
#include "tests/wire/usage_rig.h"

#include <ctype.h>
#include <glob.h>
#include <sys/resource.h>

enum { MOST_WORDS = 11 };

static const char JOURNAL[] = "# scanhead journal 1\n0 0 1 *RST\n";

/* ---- options. CONFIG stands for a good configuration, DIR for the folder. */

static const struct {
    const char *args[MOST_WORDS];
    const char *says[3];
} OPTIONS[] = {
    {{"fly"}, {"unknown command fly;", "--help"}},
    {{"fly\nhigh\033[31m"}, {"unknown command fly?high?[31m;"}},
    {{"hlep"}, {"unknown command hlep, did you mean help?"}},
    {{"recrod", "CONFIG"}, {"unknown command recrod, did you mean record?"}},
    {{"run"}, {"one CONFIG"}},
    {{"run", "CONFIG", "CONFIG"},
     {"one CONFIG|FILE.shs|FILE.pcap is needed, and 2 are given", "config.yaml, ", "config.yaml; see"}},
    {{"plan", "1", "2", "3", "4", "5", "6", "7", "8", "9", "10"},
     {"one CONFIG is needed, and 10 are given: 1, 2, ..."}},
    {{"run", "--", "CONFIG", "--start"}, {"one CONFIG|FILE.shs|FILE.pcap is needed, and 2 are given", "--start"}},
    {{"report", "CONFIG", "DIR/x.ply", "DIR/y.ply"}, {"y.ply is one too many"}},
    {{"plan", "DIR/scan.shs"}, {"scan.shs is a recorded stream", "scanhead record ", "scan.shs -o points.ply"}},
    {{"check", "DIR/SCAN.SHS"}, {"SCAN.SHS is a recorded stream"}},
    {{"plan", "a\nroom.obj"}, {"a?room.obj is a mesh"}},
    {{"plan", "DIR/room.obj"}, {"room.obj is a mesh", "scanhead init ", "room.obj writes a configuration"}},
    {{"record", "DIR/room.ifc", "-o", "DIR/x.ply"}, {"room.ifc is a mesh, and SOURCE is a head", "scanhead init "}},
    {{"report", "DIR/x.ply", "CONFIG"}, {"x.ply is a mesh or a point cloud, and CONFIG is a configuration"}},
    {{"check", "DIR/x.las"}, {"x.las is a recording", "scanhead report CONFIG "}},
    {{"check", "DIR/x.e57"}, {"x.e57 is a recording for other programs, and CONFIG is ", "a YAML file; see"}},
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
    {{"run", "CONFIG", "--journal", "DIR/journal", "--replay-journal", "DIR/./journal"}, {"--journal ", "overwritten"}},
    {{"run", "CONFIG", "--journal", "DIR/link", "--replay-journal", "DIR/journal"}, {"--journal ", "overwritten"}},
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
    {{"run", "CONFIG", "--journal", "DIR/journal", "--ready-fd", "77"}, {"--ready-fd 77: not open for writing"}},
    /* Nothing runs before: else there would be more messages. */
    {{"run", "CONFIG", "--duration", "0.01", "--stats", "DIR/none/x"}, {"--stats ", "none/x: No such file"}},
    {{"run", "CONFIG", "--duration", "0.01", "--stats", "DIR"}, {"--stats ", ": is a directory; allowed is a file"}},
    {{"run", "CONFIG", "--duration", "0.01", "--stats", ""}, {"--stats : No such file"}},
    {{"record", "CONFIG", "-o", "DIR/x.ply", "--stats", "DIR/config.yaml/x"}, {"--stats ", "Not a directory"}},
    {{"run", "none.yaml", "--from", "0"}, {"--from is for a recording of a head, but none.yaml is a configuration"}},
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
    {{"record", "CONFIG", "-o", "DIR/x.ply", "--ply-columns", "range,size"},
     {"--ply-columns range,size", "reflectance"}},
    {{"record", "CONFIG", "-o", "DIR/x.e57", "--ply-columns", "xyz"}, {"--ply-columns: no .ply"}},
    {{"record", "CONFIG", "-o", "DIR/x.e57", "--ply-names", "cloudcompare"}, {"--ply-names: no .ply"}},
    {{"record", "CONFIG", "-o", "DIR/x.ply", "--las-version", "1.2"}, {"--las-version: no .las"}},
    {{"record", "CONFIG", "-o", "DIR/x.las", "--ascii"}, {"--ascii: no .ply is among the files"}},
    {{"record", "CONFIG", "-o", "DIR/x.las", "--empty-shots"}, {"--empty-shots: no .ply and no .e57"}},
    {{"record", "DIR/scan.shs", "-o", "DIR/x.ply", "--station", "2"}, {"--station: ", "has the scans that it has"}},
    {{"record", "DIR/scan.pcapng", "-o", "DIR/x.ply", "--frames", "2"}, {"--frames: ", "has the scans that it has"}},
    {{"record", "tcp:localhost:1", "-o", "DIR/x.ply", "--listen", "--frames", "2"},
     {"--frames: --listen sends no command"}},
    {{"record", "tcp:localhost:1", "-o", "DIR/x.ply", "--listen", "--station", "all"},
     {"--station: --listen sends no command"}},
    {{"record", "DIR/scan.shs", "-o", "DIR/x.ply", "--replug", "2"}, {"--wait, --replug: a recorded stream"}},
    {{"record", "DIR/scan.shs", "-o", "DIR/x.ply", "--wait", "2"}, {"--wait, --replug: a recorded stream"}},
    {{"record", "fd:0", "-o", "DIR/x.ply", "--replug", "2"}, {"--replug: an open descriptor", "usb, tty:PATH"}},
    {{"record", "CONFIG", "-o", "DIR/x.ply", "--colour", "height", "--ply-columns", "xyz,range"},
     {"--colour: no .ply", "--ply-columns has no colour"}},
    {{"record", "tcp:localhost:1", "-o", "DIR/x.ply", "--send=a", "--send=b"}, {"--send", "allowed with --raw"}},
    {{"record", "CONFIG", "-o", "DIR/x.shs", "--colour", "label"}, {"--colour: no .ply, .las, .ptx, .e57, .obj"}},
    {{"map", "CONFIG"}, {"-o"}},
    {{"batch", "CONFIG"}, {"-o DIR is needed"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--sweep", "head.prr_hz"}, {"--sweep head.prr_hz", "KEY=A,B"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--sweep", "noise.seed=1,,2"}, {"an empty value"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--sweep", "noise.seed=1,[2"}, {"is not closed"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--sweep", "noise.seed=1:0:1"}, {"no value from FIRST to LAST"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--sweep=noise.seed=1", "--set", "noise.seed=2"}, {"in --set and in --sweep"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--sweep=noise={},{range: on}", "--set", "noise.seed=2"}, {"would be lost"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--sweep=noise.seed=1,2", "--sweep=noise={}"}, {"the other order"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--stations", "3-1"}, {"--stations 3-1", "as in 1,3-5"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--shard", "3/2"}, {"--shard 3/2", "1/N to N/N"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--format", "ply,xyz"}, {".xyz", ".ply"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--format", "ply,"}, {"--format ply,", "ply,las"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--colour", "red"}, {"--colour red"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--ascii", "--ascii"}, {"--ascii", "given twice"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--split"}, {"unknown option --split"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--merge", "--shard", "1/2"}, {"--merge", "without --shard"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--json"}, {"--json", "--list"}},
    {{"batch", "CONFIG", "-o", "DIR/d", "--merge"}, {"no such folder"}},
    {{"batch", "CONFIG", "-o", "DIR/none/d"}, {"none/d", "No such file"}},
    {{"map", "CONFIG", "-o", "DIR/x.jpg"}, {"x.jpg", ".png or .svg"}},
    {{"map", "DIR/x.ply", "-o", "DIR/x.png"}, {"x.ply is a point cloud", "--perspective"}},
    {{"map", "CONFIG", "-o", "DIR/x.png", "--eye", "1,2,3"}, {"--perspective", "--pixel-m"}},
    {{"map", "CONFIG", "-o", "DIR/x.svg", "--perspective"}, {"x.svg", ".png"}},
    {{"map", "CONFIG", "-o", "DIR/x.png", "--perspective", "--pixel-m", "1"}, {"--pixel-m"}},
    {{"map", "CONFIG", "-o", "DIR/x.png", "--perspective", "--from", "up"}, {"--from up", "south-west", "degrees"}},
    {{"map", "CONFIG", "-o", "DIR/x.png", "--perspective", "--eye", "1,2"}, {"--eye 1,2", "X,Y,Z"}},
    {{"map", "CONFIG", "-o", "DIR/x.png", "--perspective", "--size", "1200"}, {"--size 1200", "1200x800"}},
    {{"map", "CONFIG", "-o", "DIR/x.png", "--perspective", "--colour", "rgb"}, {"--colour rgb", "output.colour"}},
    {{"map", "CONFIG", "-o", "DIR/x.png", "--perspective", "--colour", "hue"}, {"--colour hue", "reflectance"}},
    {{"map", "CONFIG", "-o", "DIR/x.png", "--perspective", "--limits", "2,1"}, {"--limits 2,1", "LOW,HIGH"}},
    {{"map", "CONFIG", "-o", "DIR/x.png", "--perspective", "--below", "-50"}, {"no point is in the picture"}},
    {{"map", "CONFIG", "-o", "DIR/a.png", "-o", "DIR/b.png"}, {"--output", "given twice"}},
    {{"list", "all"}, {"no arguments"}},
};

/* Returns the word with CONFIG and DIR replaced. */
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
    usage_complaints = 0;
    room_write(wire);
    wire_write_text(wire, "config.yaml", USAGE_GOOD);
    wire_write_text(wire, "journal", JOURNAL);
    assert_int_equal(symlink("journal", wire_path(wire, "link")), 0);
    assert_int_equal(mkfifo(wire_path(wire, "fifo"), 0600), 0);
    assert_int_equal(mkfifo(wire_path(wire, "fifo.shs"), 0600), 0);
    for (size_t i = 0; i < sizeof OPTIONS / sizeof OPTIONS[0]; i++) {
        char word[MOST_WORDS][352], what[128] = "";
        const char *args[MOST_WORDS + 1] = {0};
        for (int k = 0; k < MOST_WORDS && OPTIONS[i].args[k] != NULL; k++) {
            args[k] = fill_in(wire, OPTIONS[i].args[k], word[k], sizeof word[k]);
            snprintf(what + strlen(what), sizeof what - strlen(what), "%s ", OPTIONS[i].args[k]);
        }
        const char *const says[] = {OPTIONS[i].says[0], OPTIONS[i].says[1],
                                    OPTIONS[i].says[1] ? OPTIONS[i].says[2] : NULL, NULL};
        usage_expect(wire, what, args, 2, says);
    }
    char *journal = wire_read(wire_path(wire, "journal"), NULL);
    assert_string_equal(journal, JOURNAL);
    free(journal);
    assert_int_equal(usage_complaints, 0);
}

/* ---- help */

/* -h and --help of a command go to standard output: its purpose, the usage, and lines of at most 110 columns. The help
 * of check is only looked at up to its configuration keys. */
static void expect_help(struct wire *wire, const char *name, const char *option)
{
    char want[128];
    int status = wire_wait(wire, wire_spawn(wire, (const char *const[]){name, option, NULL}, "out", "err", -1));
    char *out = wire_read(wire_path(wire, "out"), NULL), *err = wire_read(wire_path(wire, "err"), NULL);
    if (status != 0 || err[0] != '\0') usage_complain("# %s %s: status %d: %s", name, option, status, err);
    snprintf(want, sizeof want, "scanhead %s: ", name);
    if (strncmp(out, want, strlen(want)) != 0) usage_complain("# %s %s: begins with %.40s", name, option, out);
    snprintf(want, sizeof want, "\n\nusage: scanhead %s", name);
    if (strstr(out, want) == NULL) usage_complain("# %s %s: no usage", name, option);
    if (strstr(out, "  -h, --help ") == NULL) usage_complain("# %s %s: no --help in it", name, option);
    char *keys = strstr(out, "Configuration keys:");
    if (keys != NULL) *keys = '\0';
    for (char *at = strtok(out, "\n"); at != NULL; at = strtok(NULL, "\n"))
        if (strlen(at) > 110) usage_complain("# %s %s: %zu columns: %s", name, option, strlen(at), at);
    free(out);
    free(err);
}

static void test_help(void **state)
{
    struct wire *wire = *state;
    int n = 0;
    usage_complaints = 0;
    assert_int_equal(wire_wait(wire, wire_spawn(wire, (const char *const[]){"--help", NULL}, "all", "err", -1)), 0);
    char *all = wire_read(wire_path(wire, "all"), NULL), name[16];
    for (const char *at = all; (at = strstr(at, "\n  scanhead ")) != NULL; at++, n++) {
        assert_int_equal(sscanf(at, " scanhead %15s", name), 1);
        expect_help(wire, name, "--help");
        expect_help(wire, name, "-h");
    }
    free(all);
    assert_true(n >= 7);
    assert_int_equal(usage_complaints, 0);
}

/* Without a command the program is used wrongly: the list that --help gives goes to standard error, not to standard
 * output. */
static void test_no_command(void **state)
{
    struct wire *wire = *state;
    assert_int_equal(wire_wait(wire, wire_spawn(wire, (const char *const[]){"--help", NULL}, "all", "err", -1)), 0);
    assert_int_equal(wire_wait(wire, wire_spawn(wire, (const char *const[]){NULL}, "out", "err", -1)), 2);
    char *all = wire_read(wire_path(wire, "all"), NULL), *out = wire_read(wire_path(wire, "out"), NULL),
         *err = wire_read(wire_path(wire, "err"), NULL);
    assert_string_equal(out, "");
    assert_string_equal(err, all);
    free(all);
    free(out);
    free(err);
}

/* Returns whether a text has the key as a word: after a blank or a line's end, and before a comma, a bracket or a
 * line's end. */
static int names_key(const char *words, const char *key)
{
    const size_t len = strlen(key);
    for (const char *at = words; (at = strstr(at, key)) != NULL; at++)
        if (strchr(" \n", at[-1]) != NULL && strchr(",[\n", at[len]) != NULL) return 1;
    return 0;
}

/* Each key of a profile's file stands in the list below the grade that the file gives it. */
static void expect_grades(const char *list, const char *path)
{
    char head[64], begin[80], grade[32] = "", key[64] = "";
    assert_int_equal(sscanf(path, "config/heads/%63[^.]", head), 1);
    snprintf(begin, sizeof begin, "\n%s: ", head);
    const char *at = strstr(list, begin);
    if (at == NULL) fail_msg("no %s", head);
    const size_t len = strcspn(at + 1, ":") + 1;
    char *of_head = strdup(at + len), *end = of_head, *text = wire_read(path, NULL), *rest = text;
    while ((end = strchr(end + 1, '\n')) != NULL && end[1] == ' ')
        continue;
    if (end != NULL) end[1] = '\0';
    for (char *line; (line = strsep(&rest, "\n")) != NULL;) {
        if (isalpha((unsigned char)*line)) assert_int_equal(sscanf(line, "%63[^:]", key), 1);
        const char *from = strstr(line, "from: ");
        if (from == NULL || *line == '#') continue;
        assert_int_equal(sscanf(from, "from: %31[a-z ]", grade), 1);
        snprintf(begin, sizeof begin, "\n  %.*s", (int)strcspn(grade, ",}"), grade);
        char *block = strstr(of_head, begin);
        if (block == NULL) fail_msg("%s: no figures from %s", path, grade);
        char *last = strchr(block + 1, '\n');
        while (last != NULL && strncmp(last, "\n   ", 4) == 0)
            last = strchr(last + 1, '\n');
        char *words = strndup(block, last != NULL ? (size_t)(last - block) + 1 : strlen(block));
        if (!names_key(words, key)) fail_msg("%s: %s from %s is not in:%s", path, key, grade, words);
        free(words);
    }
    free(text);
    free(of_head);
}

static void test_grades(void **state)
{
    struct wire *wire = *state;
    glob_t profiles;
    assert_int_equal(wire_wait(wire, wire_spawn(wire, (const char *const[]){"list", NULL}, "out", "err", -1)), 0);
    char *list = wire_read(wire_path(wire, "out"), NULL), *whole;
    assert_true(asprintf(&whole, "\n%s", list) > 0); /* also the first head comes after the end of a line */
    assert_int_equal(glob("config/heads/*.yaml", 0, NULL, &profiles), 0);
    for (size_t i = 0; i < profiles.gl_pathc; i++)
        expect_grades(whole, profiles.gl_pathv[i]);
    globfree(&profiles);
    free(whole);
    free(list);
}

static void test_list(void **state)
{
    static const char *const links[] = {" pty ", " tcp", " udp", " usb ", " web ", " file", " null"};
    struct wire *wire = *state;
    assert_int_equal(wire_wait(wire, wire_spawn(wire, (const char *const[]){"list", NULL}, "out", "err", -1)), 0);
    char *out = wire_read(wire_path(wire, "out"), NULL), *line = strstr(out, "\nlinks:");
    assert_non_null(line);
    *strchr(line + 1, '\n') = '\0';
    for (size_t i = 0; i < sizeof links / sizeof links[0]; i++)
        if (strstr(line, links[i]) == NULL) fail_msg("no%s in %s", links[i], line);
    free(out);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_options, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_help, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_no_command, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_list, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_grades, wire_setup, wire_teardown),
    };
    setrlimit(RLIMIT_CORE, &(struct rlimit){0, 0});
    return cmocka_run_group_tests(tests, NULL, NULL);
}
