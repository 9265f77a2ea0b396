/* SPDX-License-Identifier: MIT */
/* Files that the program makes, where others may have put a link or a device. And a standard output that takes
 * nothing, or a stream's file that does not take its end. */
#include <sys/resource.h>

#include "tests/common/collada.h"
#include "tests/wire/room.h"

static const struct room_config SCAN = {.prr_hz = 20000,
                                        .lines_hz = 50,
                                        .pan_deg_s = 150,
                                        .pan_stop_deg = 60,
                                        .frames = 1,
                                        .links = "links: [{type: \"null\"}]\n"};

static void begin(struct wire *wire, char config[352])
{
    room_write(wire);
    snprintf(config, 352, "%s", room_config_write(wire, &SCAN));
}

/* The program ends with this status and one line on standard error that has both texts. */
static void expect(struct wire *wire, pid_t pid, int want, const char *says, const char *more)
{
    int status = wire_wait(wire, pid);
    char *text = wire_read(wire_path(wire, "err"), NULL), *end = strchr(text, '\n');
    if (status != want || strstr(text, says) == NULL || strstr(text, more) == NULL || end == NULL || end[1] != '\0')
        fail_msg("status %d, no '%s' and '%s' in: %s", status, says, more, text);
    free(text);
}

/* `name` leads to a file that must not change. */
static void plant(struct wire *wire, const char *name)
{
    wire_write_text(wire, "precious", "keep me\n");
    assert_int_equal(symlink("precious", wire_path(wire, name)), 0);
}

static void expect_unharmed(struct wire *wire, const char *name)
{
    struct stat st;
    char *kept = wire_read(wire_path(wire, "precious"), NULL);
    assert_string_equal(kept, "keep me\n");
    free(kept);
    assert_int_equal(lstat(wire_path(wire, name), &st), 0);
    assert_true(S_ISLNK(st.st_mode));
    assert_int_equal(unlink(wire_path(wire, name)), 0);
}

static void test_links(void **state)
{
    struct wire *wire = *state;
    static const struct {
        const char *link, *command, *option, *file;
    } made[] = {
        {"stats.json", "run", "--stats", "stats.json"},    {"journal", "run", "--journal", "journal"},
        {"stats.json", "record", "--stats", "stats.json"}, {"a.shs", "record", "-o", "a.shs"},
        {"a.shs.part", "record", "-o", "a.shs"},           {"a.ptx.part", "record", "-o", "a.ptx"},
        {"a.poses.csv", "record", "-o", "a.poses.csv"},    {"map.png", "map", "-o", "map.png"},
        {"map.png.part", "map", "-o", "map.png"},
    };
    char config[352], path[352];
    begin(wire, config);
    for (size_t i = 0; i < sizeof made / sizeof made[0]; i++) {
        const int run = strcmp(made[i].command, "run") == 0;
        plant(wire, made[i].link);
        snprintf(path, sizeof path, "%s", wire_path(wire, made[i].file));
        const char *const args[] = {made[i].command,           config, made[i].option, path,   "--quiet",
                                    run ? "--duration" : NULL, "0.01", "--pace",       "fast", NULL};
        expect(wire, wire_spawn(wire, args, "out", "err", -1), 2, made[i].link, "is a symbolic link to precious");
        expect_unharmed(wire, made[i].link);
    }
    struct room_config stream = SCAN;
    stream.links = "links: [{type: file, path: stream.shs}]\n";
    plant(wire, "stream.shs");
    snprintf(config, sizeof config, "%s", room_config_write(wire, &stream));
    for (int checks = 0; checks < 2; checks++) {
        const char *const args[] = {checks ? "check" : "run", config, checks ? NULL : "--duration", "0.01", NULL};
        expect(wire, wire_spawn(wire, args, "out", "err", -1), 2, "links[0].path",
               "stream.shs: is a symbolic link to precious");
    }
    expect_unharmed(wire, "stream.shs");
}

/* Where all standard streams are closed, no file of the run gets one of their numbers, and with it the messages. */
static void test_closed_streams(void **state)
{
    struct wire *wire = *state;
    static const char *const script[] = {"exec \"$0\" \"$@\"", "exec \"$0\" \"$@\" <&- >&- 2>&-"};
    char config[352], journal[352], *stream[2], *lines[2];
    size_t size[2];
    struct room_config file = SCAN;
    file.links = "links: [{type: file, path: stream.shs}]\n";
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &file));
    snprintf(journal, sizeof journal, "%s", wire_path(wire, "journal"));
    for (int i = 0; i < 2; i++) {
        const char *const args[] = {"-c",       script[i], wire_program(), "run",   config, "--start", "--pace", "fast",
                                    "--frames", "1",       "--journal",    journal, NULL};
        assert_int_equal(wire_wait(wire, wire_spawn_program(wire, "/bin/sh", args, "out", "err", -1)), 0);
        stream[i] = wire_read(wire_path(wire, "stream.shs"), &size[i]);
        lines[i] = wire_read(journal, NULL);
    }
    assert_string_equal(lines[0], lines[1]);
    assert_int_equal(size[0], size[1]);
    assert_memory_equal(stream[0], stream[1], size[0]);
    for (int i = 0; i < 2; i++) {
        free(stream[i]);
        free(lines[i]);
    }
}

/* The line of --ready-fd may go to standard output, and the rest of the output goes there, too. */
static void test_ready_on_output(void **state)
{
    struct wire *wire = *state;
    char config[352];
    begin(wire, config);
    const char *const args[] = {"run",        config, "--duration", "0.01",    "--pace", "fast",
                                "--ready-fd", "1",    "--quiet",    "--stats", "-",      NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
    char *text = wire_read(wire_path(wire, "out"), NULL), *line_end = strchr(text, '\n');
    assert_int_equal(text[0], '{');
    assert_non_null(line_end);
    assert_non_null(strstr(line_end, "\"stream_sha256\": "));
    free(text);
}

/* A map replaces only a regular file. */
static void test_map_on_a_fifo(void **state)
{
    struct wire *wire = *state;
    char config[352], path[352];
    struct stat st;
    begin(wire, config);
    snprintf(path, sizeof path, "%s", wire_path(wire, "map.png"));
    assert_int_equal(mkfifo(path, 0600), 0);
    const char *const args[] = {"map", config, "-o", path, "--quiet", NULL};
    expect(wire, wire_spawn(wire, args, "out", "err", -1), 2, path, "is a FIFO");
    assert_int_equal(lstat(path, &st), 0);
    assert_true(S_ISFIFO(st.st_mode));
}

/* Output that can't be written is a failure, with a full device and with a closed stream. */
static void test_full_output(void **state)
{
    struct wire *wire = *state;
    static const char *const where[] = {">/dev/full", ">&-"};
    char config[352], script[64];
    begin(wire, config);
    const char *const commands[][3] = {{"list"}, {"--help"}, {"run", "--help"}, {"check", "--help"}, {"check", config}};
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++)
        for (int k = 0; k < 2; k++) {
            snprintf(script, sizeof script, "exec \"$0\" \"$@\" %s", where[k]);
            const char *const args[] = {"-c", script, wire_program(), commands[i][0], commands[i][1], NULL};
            expect(wire, wire_spawn_program(wire, "/bin/sh", args, "out", "err", -1), 1, "standard output",
                   k == 0 ? "No space left" : "Bad file descriptor");
        }
    const char *const stats[] = {"run",  config,    "--duration", "0.01",      "--pace",
                                 "fast", "--quiet", "--stats",    "/dev/full", NULL};
    expect(wire, wire_spawn(wire, stats, "out", "err", -1), 1, "/dev/full", "No space left");
}

/* With so many bytes allowed for a file. */
static pid_t stream_to_file(struct wire *wire, const char *config, rlim_t bytes)
{
    struct rlimit before;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    const struct rlimit small = {bytes, before.rlim_max};
    const char *const args[] = {"run", config, "--start", "--duration", "0.1", "--pace", "fast", "--quiet", NULL};
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    const pid_t pid = wire_spawn(wire, args, "out", "err", -1);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    return pid;
}

/* The last bytes of a stream, which the run writes at its end, have no room. */
static void test_no_room_for_the_end(void **state)
{
    struct wire *wire = *state;
    struct room_config stream = SCAN;
    struct stat st;
    char config[352];
    stream.links = "links: [{type: file, path: stream.shs}]\n";
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &stream));
    assert_int_equal(wire_wait(wire, stream_to_file(wire, config, RLIM_INFINITY)), 0);
    assert_int_equal(stat(wire_path(wire, "stream.shs"), &st), 0);
    assert_true(st.st_size > 1000);
    for (int cut = 1; cut < 400; cut += 57) {
        assert_int_equal(wire_wait(wire, stream_to_file(wire, config, (rlim_t)st.st_size - (rlim_t)cut)), 1);
        char *text = wire_read(wire_path(wire, "err"), NULL);
        assert_non_null(strstr(text, "stream.shs: File too large; it is cut short"));
        free(text);
    }
}

/* A file that Assimp reads is announced where it has more than 8 MiB. With --quiet it is not; warnings stay. */
static void test_quiet(void **state)
{
    struct wire *wire = *state;
    static char blanks[9 << 20];
    FILE *f = fopen(wire_write_text(wire, "hall.dae", COLLADA_TRIANGLE("-1 -1 0 31 -1 0 0 31 0")), "ab");
    assert_non_null(f);
    memset(blanks, '\n', sizeof blanks);
    assert_int_equal(fwrite(blanks, 1, sizeof blanks, f), sizeof blanks);
    assert_int_equal(fclose(f), 0);
    char config[352], points[352];
    snprintf(
        config, sizeof config, "%s",
        wire_write_text(wire, "config.yaml",
                        "head: {profile: riegl-vz400i}\nscene:\n  meshes:\n    - {file: hall.dae, up: z, scale: 1}\n"
                        "stations:\n  - {position_m: [1, 1, 2]}\noutput: {crs: local}\nlinks: [{type: \"null\"}]\n"));
    snprintf(points, sizeof points, "%s", wire_path(wire, "points.ply"));
    const char *const args[][9] = {{"run", config, "--pace", "fast", "--duration", "0.01"},
                                   {"run", config, "--pace", "fast", "--duration", "0.01", "--quiet"},
                                   {"record", config, "--duration", "0.01", "-o", points, "--quiet"}};
    for (size_t i = 0; i < sizeof args / sizeof args[0]; i++) {
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args[i], "out", "err", -1)), 0);
        char *text = wire_read(wire_path(wire, "err"), NULL);
        if ((strstr(text, "reading ") != NULL) != (i == 0)) fail_msg("%s: %s", args[i][0], text);
        assert_non_null(strstr(text, "warning: "));
        free(text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_links, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_closed_streams, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_ready_on_output, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_map_on_a_fifo, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_full_output, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_no_room_for_the_end, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_quiet, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests_name("files", tests, NULL, NULL);
}
