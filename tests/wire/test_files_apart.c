/* SPDX-License-Identifier: MIT */
/* Every file that a command writes is tried as every file that it reads, and as every other that it writes. There is
 * one line that names both, status 2, and nothing has changed. The tables of options and of keys show whether these
 * tables are whole. */
#include "firmware_sim/config/keys.h"
#include "firmware_sim/config/profile_keys.h"
#include "firmware_sim/config/table/row.h"
#include "tests/wire/emitter_rig.h"
#include "tests/wire/room.h"
#include "tests/wire/usage_rig.h"

static const char CONFIG[] = "head: {profile: full-sweep, lines_hz: 10, frames: 1}\n"
                             "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
                             "stations: [{position_m: [0, 0, 0]}, {position_m: [1, 0, 0]}]\n"
                             "links: [{type: \"null\"}]\n";

enum {
    RUN = 1,
    RECORD = 2,
    BATCH = 4,
    REPORT = 8,
    MAP = 16,
    COVERAGE = 32,
    VIEW = 64,
    SOAK = 128,
    INIT = 256,
    CHECK = 512,
    ALL = 1023
};

/* In the words @ stands for the folder and a slash. */
static const struct {
    unsigned bit;
    const char *name, *operands;
} COMMANDS[] = {
    {RUN, "run", "@c.yaml"},      {RECORD, "record", "@c.yaml"},
    {BATCH, "batch", "@c.yaml"},  {REPORT, "report", "@c.yaml @cloud.ply"},
    {MAP, "map", "@c.yaml"},      {COVERAGE, "coverage", "@c.yaml"},
    {VIEW, "view", "@cloud.ply"}, {SOAK, "soak", "@c.yaml"},
    {INIT, "init", "@room.obj"},  {CHECK, "check", "@c.yaml"},
};
enum { N_COMMANDS = sizeof COMMANDS / sizeof COMMANDS[0] };

/* The written files: the option or key, the words, and the file. If one command writes two, the words of both are
 * given. */
static const struct output {
    unsigned bit;
    const char *who, *words, *file;
} OUTPUTS[] = {
    {RUN, "--stats", "--stats=@o", "o"},
    {RUN, "--journal", "--journal=@o", "o"},
    {RUN, "--truth", "--truth=@o", "o"},
    {RUN, "--surfaces", "--surfaces=@o", "o"},
    {RUN, "links[0].path", "--set=links[0].type=file --set=links[0].path=@o", "o"},
    {RUN, "head.settings_file", "--set=head.settings_file=@o", "o"},
    {RECORD, "--output", "--output=@o.ply", "o.ply"},
    {RECORD, "--output", "--output=@o.obj", "o.mtl"},
    {RECORD, "--output", "--output=@o.obj", "o.png"},
    {RECORD, "--output", "--output=@o.gltf", "o.bin"},
    {RECORD, "--output", "--output=@o.las --wdp", "o.wdp"},
    {RECORD, "--stats", "--stats=@o", "o"},
    {RECORD, "--surfaces", "--surfaces=@o --output=@x.ply", "o"},
    {RECORD, "--truth", "--output=@x.shs --truth=@o", "o"},
    {BATCH, "--output", "--output=@", "manifest-1-of-1.jsonl"},
    {BATCH, "--output", "--output=@ --merge", "manifest.json"},
    {REPORT, "--html", "--html=@o.html", "o.html"},
    {MAP, "--output", "--output=@o.svg", "o.svg"},
    {COVERAGE, "--output", "--output=@o.ply", "o.ply"},
    {COVERAGE, "--output", "--output=@o.gltf", "o.bin"},
    {SOAK, "--json", "--json=@o", "o"},
    {SOAK, "--junit", "--client=true --junit=@o", "o"},
    {SOAK, "--truth", "--truth=@o", "o"},
    {SOAK, "links[0].path", "--set=links[0].type=file --set=links[0].path=@o", "o"},
    {CHECK, "--scene-csv", "--scene-csv=@o", "o"},
    {CHECK, "links[0].path", "--set=links[0].type=file --set=links[0].path=@o", "o"},
    {INIT, "--output", "--force --output=@o.yaml", "o.yaml"},
};
enum { N_OUTPUTS = sizeof OUTPUTS / sizeof OUTPUTS[0] };

/* The read files: the option or key, the commands, the words, and the file. */
enum { WITH_CONFIG = RUN | RECORD | REPORT | MAP | COVERAGE | SOAK | CHECK };
static const struct input {
    unsigned bits;
    const char *who, *words, *file;
} INPUTS[] = {
    {WITH_CONFIG | BATCH, "the operand", "", "c.yaml"},
    {REPORT, "the operand", "", "cloud.ply"},
    {INIT, "the operand", "", "room.obj"},
    {WITH_CONFIG, "scene.meshes[0].file", "", "room.obj"},
    {WITH_CONFIG | INIT, "room.mtl, named in", "", "room.mtl"},
    {WITH_CONFIG | INIT, "room.png, named in", "", "room.png"},
    {WITH_CONFIG, "scene.meshes[0].copies", "--set=scene.meshes[0].copies=@path.csv", "path.csv"},
    {WITH_CONFIG, "head.profile", "--set=head.profile=@own.yaml", "own.yaml"},
    {WITH_CONFIG, "head.profile: directions", "--set=head.profile=@own.yaml", "list.txt"},
    {WITH_CONFIG, "stations[1].scanner.head.profile", "--set=stations[1].scanner.head.profile=@own.yaml", "own.yaml"},
    {RUN | RECORD | CHECK, "platform.file", "--set=platform.kind=trajectory --set=platform.file=@path.csv", "path.csv"},
    {RUN | RECORD | CHECK, "platform.waypoints", "--set=platform.kind=trajectory --set=platform.waypoints=@path.csv",
     "path.csv"},
    {WITH_CONFIG, "waveform.pulse_file", "--set=waveform.pulse=table --set=waveform.pulse_file=@path.csv", "path.csv"},
    {RUN | RECORD | SOAK | CHECK, "--scenario", "--scenario=@loss.yaml", "loss.yaml"},
    {BATCH, "--scenario", "--scenario=@loss.yaml", "loss.yaml"},
    {RUN, "--replay-journal", "--replay-journal=@journal", "journal"},
    {COVERAGE, "--candidates", "--candidates=@path.csv", "path.csv"},
};
enum { N_INPUTS = sizeof INPUTS / sizeof INPUTS[0] };

/* Cases that are not in the pairs above, as their command lines are of another kind. ALIAS stands for the file's other
 * name. */
static const struct {
    const char *line, *file, *alias, *who, *other;
} LINES[] = {
    {"run @scan.shs --stats=@o", "scan.shs", "o", "--stats", "the operand"},
    {"run @scan.shs --truth=@o", "scan.shs", "o", "--truth", "the operand"},
    {"run @scan.shs --config=@c.yaml --stats=@o", "c.yaml", "o", "--stats", "--config"},
    {"run @scan.shs --config=@f.yaml", "scan.shs", "o", "links[0].path", "the operand"},
    {"run @scan.shs --config=@f.yaml", "f.yaml", "o", "links[0].path", "--config"},
    {"record @scan.shs --output=@o.ply", "scan.shs", "o.ply", "--output", "the operand"},
    {"record @scan.shs --output=@x.ply --stats=@o", "scan.shs", "o", "--stats", "the operand"},
    {"record --repair @scan.shs --stats=@o", "scan.shs", "o", "--stats", "--repair"},
    {"record --repair @k.ptx --stats=@o", "k.ptx.part", "o", "--stats", "--repair"},
    {"record --repair @k.ptx --stats=@o", "k.ptx.grid", "o", "--stats", "--repair"},
    {"record --repair @k.ptx.part --stats=@o", "k.ptx.grid", "o", "--stats", "--repair"},
    {"record --repair @k.las --stats=@o", "k.wdp.part", "o", "--stats", "--repair"},
    {"record --repair @k.las.part --stats=@o", "k.wdp.part", "o", "--stats", "--repair"},
    {"record --repair @k.las --stats=@o", "k.wdp", "o", "--stats", "--repair"},
    {"record --repair @k.las.part --stats=@o", "k.wdp", "o", "--stats", "--repair"},
    {"record @c.yaml --set=scene.meshes[0].file=@o-1.obj --output=@o.obj --split", "room.obj", "o-1.obj", "--output",
     "scene.meshes[0].file"},
    {"record @c.yaml --set=platform.kind=trajectory --set=platform.file=@o-11.poses.csv --output=@o.poses.csv --each",
     "path.csv", "o-11.poses.csv", "--output", "platform.file"},
    {"map @cloud.ply --perspective --output=@o.png", "cloud.ply", "o.png", "--output", "the operand"},
    {"map @c.yaml --perspective --cloud=@cloud.ply --output=@o.png", "cloud.ply", "o.png", "--output", "--cloud"},
    {"soak @c.yaml --client=true --client-file=@path.csv --json=@o", "path.csv", "o", "--json", "--client-file"},
    {"soak @c.yaml --client=true --client-folder=@ --scenario=@loss.yaml", "loss.yaml", "loss.log", "--client-folder",
     "--scenario"},
    {"batch @c.yaml --output=@ --format=obj --set=scene.meshes[0].file=@0001_station-1.obj", "room.obj",
     "0001_station-1.obj", "--output", "an input"},
};

/* Pairs of written files, whose names say what they are. */
static const struct {
    const char *line, *who, *other;
} DOUBLES[] = {
    {"record @c.yaml --output=@o.ply --output=@./o.ply", "--output", "--output"},
    {"record @c.yaml --output=@o.ply --surfaces=@o.ply", "--surfaces", "--output"},
    {"record @c.yaml --output=@o.ply --stats=@o.ply", "--stats", "--output"},
    {"record @c.yaml --truth=@o.ply --output=@o.ply", "--output", "--truth"},
    {"record @c.yaml --output=@o.obj --stats=@o.mtl", "--output", "--stats"},
    {"record @c.yaml --output=@o.gltf --truth=@o.bin", "--output", "--truth"},
    {"record @c.yaml --output=@o.las --wdp --stats=@o.wdp", "--output", "--stats"},
    {"record @c.yaml --output=@o.ply --each --stats=@o-3.ply", "--stats", "--output"},
    {"record @c.yaml --stats=@o --truth=@./o", "--truth", "--stats"},
    {"record @c.yaml --output=@o.ply --stats=@o.ply.part", "--output", "--stats"},
    {"record @c.yaml --output=@o.PTX --stats=@o.PTX.grid", "--output", "--stats"},
    {"record @c.yaml --truth=@o-2.ptx.grid --output=@o.ptx --split", "--output", "--truth"},
    {"record @c.yaml --output=@o.las --surfaces=@o.wdp.part", "--output", "--surfaces"},
    {"record @c.yaml --output=@o.LAS --output=@o.las", "--output", "--output"}, /* o.wdp.part */
    {"record @c.yaml --output=@o.OBJ --output=@o.obj", "--output", "--output"}, /* o.mtl */
    {"record udp:127.0.0.1:0 --raw --output=@o.pcapng --stats=@o.pcapng", "--stats", "--output"},
    {"record udp:127.0.0.1:0 --raw --output=@o.pcapng --stats=@o.pcapng.part", "--output", "--stats"},
    {"record --repair @o.ply --stats=@o.ply", "--repair", "--stats"}, /* of o.ply.part */
    {"record --repair @o.ply.part --stats=@o.ply", "--repair", "--stats"},
    {"record --repair @o.las --stats=@o.wdp", "--repair", "--stats"}, /* of o.wdp.part */
    {"record --repair @o.las.part --stats=@o.wdp", "--repair", "--stats"},
    {"run @scan.shs --stats=@o --truth=@./o", "--truth", "--stats"},
    {"run @scan.shs --config=@f.yaml --stats=@o", "links[0].path", "--stats"},
};

/* ---- one command line */

static void begin(struct wire *wire)
{
    room_write(wire);
    char *mesh = wire_read(wire_path(wire, "room.obj"), NULL), text[1 << 14];
    snprintf(text, sizeof text, "mtllib room.mtl\n%s", mesh);
    free(mesh);
    wire_write_text(wire, "room.obj", text);
    wire_write_text(wire, "room.mtl", "newmtl a\nmap_Kd room.png\n");
    wire_write_text(wire, "room.png", "an image");
    wire_write_text(wire, "c.yaml", CONFIG);
    snprintf(text, sizeof text, "%.*slinks: [{type: file, path: o}]\n", (int)(strstr(CONFIG, "links") - CONFIG),
             CONFIG);
    wire_write_text(wire, "f.yaml", text);
    wire_write_text(wire, "cloud.ply", "a cloud");
    wire_write_text(wire, "scan.shs", "a stream");
    wire_write_text(wire, "k.ptx.part", "of a killed recorder");
    wire_write_text(wire, "k.ptx.grid", "of a killed recorder");
    wire_write_text(wire, "k.wdp.part", "of a killed recorder");
    wire_write_text(wire, "k.wdp", "of a killed recorder");
    wire_write_text(wire, "journal", "a journal");
    wire_write_text(wire, "path.csv", "a path");
    wire_write_text(wire, "list.txt", "0 0\n90 0\n");
    wire_write_text(wire, "loss.yaml", "faults: [{kind: drop, every: 10}]\n");
    emitter_write_profile(wire, "emitter: directions\ndirections: list.txt\n");
}

/* The file has another name, `alias`, which the command is told to write. The file's bytes stay. */
static void expect_refusal(struct wire *wire, const char *line, const char *file, const char *alias, const char *who,
                           const char *other)
{
    char path[352], given[80], read_as[80];
    size_t len[2];
    snprintf(path, sizeof path, "%s", wire_path(wire, file));
    char *before = wire_read(path, &len[0]);
    assert_int_equal(link(path, wire_path(wire, alias)), 0);
    snprintf(given, sizeof given, "scanhead: %s ", who);
    snprintf(read_as, sizeof read_as, " is also read as %s", other);
    usage_expect(wire, line, usage_words(wire, line), 2,
                 (const char *const[]){given, read_as, "and would be overwritten; name another ", NULL});
    unlink(wire_path(wire, alias));
    char *after = wire_read(path, &len[1]);
    if (len[0] != len[1] || memcmp(before, after, len[0]) != 0) usage_complain("# %s: %s has changed", line, file);
    free(before);
    free(after);
}

static void test_pairs(void **state)
{
    struct wire *wire = *state;
    char line[1024];
    int n = 0;
    begin(wire);
    for (int c = 0; c < N_COMMANDS; c++)
        for (int o = 0; o < N_OUTPUTS; o++) {
            const struct output *out = &OUTPUTS[o];
            if (out->bit != COMMANDS[c].bit) continue;
            for (int i = 0; i < N_INPUTS; i++) {
                if ((INPUTS[i].bits & out->bit) == 0) continue;
                snprintf(line, sizeof line, "%s %s %s %s", COMMANDS[c].name, COMMANDS[c].operands, INPUTS[i].words,
                         out->words);
                expect_refusal(wire, line, INPUTS[i].file, out->file, out->who, INPUTS[i].who);
                n++;
            }
            for (int k = 0; k < o; k++) {
                const struct output *other = &OUTPUTS[k];
                if (other->bit != out->bit || strcmp(other->file, out->file) != 0 || strcmp(other->who, out->who) == 0)
                    continue;
                snprintf(line, sizeof line, "%s %s %s %s", COMMANDS[c].name, COMMANDS[c].operands, other->words,
                         out->words);
                usage_expect(
                    wire, line, usage_words(wire, line), 2,
                    (const char *const[]){out->who, other->who, " writes the same file; name another one", NULL});
                n++;
            }
        }
    for (size_t i = 0; i < sizeof DOUBLES / sizeof DOUBLES[0]; i++)
        usage_expect(
            wire, DOUBLES[i].line, usage_words(wire, DOUBLES[i].line), 2,
            (const char *const[]){DOUBLES[i].who, DOUBLES[i].other, " writes the same file; name another one", NULL});
    for (size_t i = 0; i < sizeof LINES / sizeof LINES[0]; i++)
        expect_refusal(wire, LINES[i].line, LINES[i].file, LINES[i].alias, LINES[i].who, LINES[i].other);
    print_message("# %d pairs\n", n);
    assert_int_equal(usage_complaints, 0);
}

/* ---- nothing is missing above */

static int is_option_in(unsigned bit, const char *command, const char *who)
{
    for (int o = 0; o < N_OUTPUTS; o++)
        if (OUTPUTS[o].bit == bit && strcmp(OUTPUTS[o].who, who) == 0) return 1;
    for (int i = 0; i < N_INPUTS; i++)
        if ((INPUTS[i].bits & bit) != 0 && strcmp(INPUTS[i].who, who) == 0) return 1;
    for (size_t i = 0; i < sizeof LINES / sizeof LINES[0]; i++)
        if (strncmp(LINES[i].line, command, strlen(command)) == 0 && strstr(LINES[i].line, who) != NULL) return 1;
    return 0;
}

/* Checks each option that has a file in the help. */
static void check_options(struct wire *wire, unsigned bit, const char *command)
{
    const pid_t pid = wire_spawn(wire, (const char *const[]){command, "--help", NULL}, "out", "err", -1);
    assert_int_equal(wire_wait(wire, pid), 0);
    char *help = wire_read(wire_path(wire, "out"), NULL);
    for (char *row = strtok(help, "\n"); row != NULL; row = strtok(NULL, "\n")) {
        char who[32], argument[32];
        const char *name = strstr(row, "--");
        if (name == NULL || name - row > 6 || sscanf(name, "%31s %31s", who, argument) != 2) continue;
        if (strncmp(argument, "FILE", 4) != 0 && strcmp(argument, "CONFIG") != 0 && strcmp(argument, "DIR") != 0)
            continue;
        if (!is_option_in(bit, command, who)) usage_complain("# %s %s %s is in no pair", command, who, argument);
    }
    free(help);
}

static int is_key_in(const struct cfg_table *table, const struct cfg_key *key)
{
    char name[CFG_PATH_MAX], who[CFG_PATH_MAX + 16];
    int found = 0;
    snprintf(who, sizeof who, "%s%s", table == &cfg_profile_table ? "head.profile: " : "",
             cfg_name(key->path, 0, name));
    for (int o = 0; o < N_OUTPUTS && (key->flags & CFG_WRITTEN) != 0; o++)
        found |= strcmp(OUTPUTS[o].who, who) == 0;
    for (int i = 0; i < N_INPUTS && (key->flags & CFG_WRITTEN) == 0; i++)
        found |= strcmp(INPUTS[i].who, who) == 0;
    return found;
}

static void test_the_tables_are_whole(void **state)
{
    const struct cfg_table *const tables[] = {&cfg_config_table, &cfg_profile_table};
    for (int c = 0; c < N_COMMANDS; c++)
        check_options(*state, COMMANDS[c].bit, COMMANDS[c].name);
    for (int t = 0; t < 2; t++)
        for (size_t i = 0; i < tables[t]->n; i++)
            if (tables[t]->keys[i].type == CFG_PATH && !is_key_in(tables[t], &tables[t]->keys[i]))
                usage_complain("# %s is in no pair", tables[t]->keys[i].path);
    assert_int_equal(usage_complaints, 0);
}

/* ---- two processes */

/* The second head of one file link ends before it empties the file, and names the process that has it. So does every
 * other command that would write there. */
static void test_two_heads_one_file(void **state)
{
    struct wire *wire = *state;
    char config[352], says[128];
    begin(wire);
    snprintf(config, sizeof config, "%s", wire_path(wire, "f.yaml"));
    struct head first = head_start(wire, config, (const char *const[]){"--start", "--set", "head.frames=0", NULL});
    snprintf(says, sizeof says, "is being written by process %ld (scanhead); choose another file name",
             (long)first.pid);
    static const char *const lines[] = {"run @f.yaml --start --frames=1", "run @c.yaml --start --frames=1 --journal=@o",
                                        "run @c.yaml --start --frames=1 --truth=@o",
                                        "run @c.yaml --start --frames=1 --set=head.settings_file=@o",
                                        "soak @f.yaml --duration=1"};
    struct stat st, later;
    assert_int_equal(stat(wire_path(wire, "o"), &st), 0);
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++)
        usage_expect(wire, lines[i], usage_words(wire, lines[i]), 2, (const char *const[]){says, NULL});
    assert_int_equal(stat(wire_path(wire, "o"), &later), 0);
    assert_true(later.st_size >= st.st_size);
    head_end(&first, SIGINT);
    assert_int_equal(usage_complaints, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_two_heads_one_file, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_pairs, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_the_tables_are_whole, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
