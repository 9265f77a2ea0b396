/* SPDX-License-Identifier: MIT */
/* These are tests of the output of `scanhead check`: all errors of a configuration, the keys of a section, an example
 * that passes, links that a head would refuse. And short options in getopt's forms. */
#include "tests/wire/room.h"
#include "tests/wire/usage_rig.h"

static void run(struct wire *wire, const char *line, int status)
{
    assert_int_equal(wire_wait(wire, wire_spawn(wire, usage_words(wire, line), "out", "err", -1)), status);
}

/* A value may follow its letter at once: -oFILE. */
static void test_short_forms(void **state)
{
    struct wire *wire = *state;
    room_write(wire);
    room_config_write(
        wire, &(struct room_config){
                  .prr_hz = 20000, .lines_hz = 50, .pan_deg_s = 360, .pan_stop_deg = 36, .frames = 1, .links = ""});
    run(wire, "record -o@x.ply @config.yaml --quiet", 0);
    assert_int_equal(access(wire_path(wire, "x.ply"), R_OK), 0);
}

/* All errors of a configuration are printed, a line each, at most 20. */
static void test_all_faults(void **state)
{
    struct wire *wire = *state;
    char text[4096], config[352];
    int n = snprintf(text, sizeof text,
                     "head: {profile: full-sweep, prr_hz: fast, frame: 1}\nscene: {meshes: []}\n"
                     "stations: [{position_m: [0, 0]}]\nsurfaces:\n");
    for (int i = 0; i < 19; i++)
        n += snprintf(text + n, sizeof text - (size_t)n, "  - {retro: -1}\n");
    snprintf(config, sizeof config, "%s", wire_write_text(wire, "config.yaml", text));
    run(wire, "check @config.yaml", 2);
    char *told = wire_read(wire_path(wire, "err"), NULL), *rest = told;
    static const char *const keys[] = {":1: head.prr_hz: ", ":1: head.frame: unknown key, did you mean head.frames?",
                                       ":2: scene.meshes: ", ":3: stations[0].position_m: ", ":5: surfaces[0].retro: "};
    for (int line = 0; line < 20; line++) {
        assert_int_equal(strncmp(rest, "scanhead: ", 10), 0);
        if (line < 5 && strncmp(rest + 10 + strlen(config), keys[line], strlen(keys[line])) != 0) fail_msg("%s", rest);
        rest = strchr(rest, '\n') + 1;
    }
    assert_string_equal(rest, "scanhead: and 3 more\n");
    free(told);
}

/* `memory 1.3 MB for meshes and BVH, 205 bytes a triangle; 18 MB at the peak`: the figures agree, up to their four
 * digits, and the peak includes all. A triangle takes at least 58 bytes: its plane, its corners' numbers and label, and
 * a leaf that it shares. */
static void check_memory(char *told)
{
    const char *memory = strstr(told, "\nmemory "), *scene = strstr(told, "\nscene ");
    double mb, each, peak_mb;
    unsigned triangles;
    assert_non_null(memory);
    assert_non_null(scene);
    assert_int_equal(sscanf(scene, " scene %u triangles", &triangles), 1);
    assert_int_equal(sscanf(memory, " memory %lf MB for meshes and BVH, %lf bytes a triangle; %lf MB at the peak", &mb,
                            &each, &peak_mb),
                     3);
    assert_true(each >= 58.0 && peak_mb > mb);
    assert_true(fabs(1e6 * mb - each * triangles) <= 0.5 * triangles + 1e3 * mb);
    free(told);
}

/* Runs the program with so much address space. Returns its status. */
static int run_within(struct wire *wire, int kib, const char *words)
{
    char command[1024];
    snprintf(command, sizeof command, "ulimit -c 0; ulimit -v %d && exec '%s' %s", kib, wire_program(), words);
    const char *const args[] = {"-c", command, NULL};
    return wire_wait(wire, wire_spawn_program(wire, "/bin/sh", args, "out", "err", -1));
}

/* Too little address space ends in one line, also where memory or a thread is refused within Embree's scheduler, which
 * throws, or where the stack has to grow. Limits too small for --version are left out: the system loads nothing. */
static void little_memory_ends_in_a_line(void **state)
{
#ifdef SH_SANITIZE
    skip(); /* a sanitizer needs more address space than that */
#endif
    struct wire *wire = *state;
    char words[400];
    int n_refused = 0;
    room_write(wire);
    snprintf(words, sizeof words, "check '%s'", wire_write_text(wire, "good.yaml", USAGE_GOOD));
    for (int kib = 48000; kib <= 84000; kib += 1000) {
        if (run_within(wire, kib, "--version") != 0) continue;
        const int status = run_within(wire, kib, words);
        char *err = wire_read(wire_path(wire, "err"), NULL), *end = strchr(err, '\n');
        n_refused += status != 0;
        if (status != 0 && (status != 1 || strncmp(err, "scanhead: ", 10) != 0 || end == NULL || end[1] != '\0'))
            fail_msg("%d KiB: status %d: %s", kib, status, err);
        free(err);
    }
    print_message("# %d limits of address space were too small for a check\n", n_refused);
}

/* The example passes `check` without a message, so each of its keys is known. */
static void test_example(void **state)
{
    struct wire *wire = *state;
    assert_int_equal(
        wire_wait(wire, wire_spawn(wire, (const char *const[]){"check", "--example", NULL}, "x.yaml", "err", -1)), 0);
    run(wire, "check @x.yaml", 0);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    assert_string_equal(err, "");
    free(err);
    check_memory(wire_read(wire_path(wire, "out"), NULL));
}

/* 60 boxes of 2 x 3 x 4 m, each a little higher than the one before. The first has no top. */
static void write_boxes(struct wire *wire)
{
    char *text = NULL;
    size_t len;
    FILE *out = open_memstream(&text, &len);
    for (int i = 0; i < 60; i++) {
        const int n = 8 * i;
        fprintf(out, "o box %d, \"red\"\n", i);
        for (int c = 0; c < 8; c++)
            fprintf(out, "v %g %g %g\n", 10.0 * i + 2 * (c % 4 == 1 || c % 4 == 2), 3.0 * (c % 4 >= 2),
                    c < 4 ? 0.0 : 4 + 0.01 * i);
        static const int face[6][4] = {{4, 3, 2, 1}, {1, 2, 6, 5}, {2, 3, 7, 6},
                                       {3, 4, 8, 7}, {4, 1, 5, 8}, {5, 6, 7, 8}};
        for (int f = 0; f < (i == 0 ? 5 : 6); f++)
            fprintf(out, "f %d %d %d %d\n", n + face[f][0], n + face[f][1], n + face[f][2], n + face[f][3]);
    }
    assert_int_equal(fclose(out), 0);
    wire_write_text(wire, "boxes.obj", text);
    free(text);
    wire_write_text(wire, "boxes.yaml",
                    "head: {profile: sphere, step_deg: 2}\noutput: {crs: local}\n"
                    "scene: {meshes: [{file: boxes.obj, up: z, scale: 1}]}\nstations: [{position_m: [5, 1, 1]}]\n");
}

/* The table has the 50 largest objects, the sums over all 60, and the open one by name, though it is the smallest. The
 * file has all. */
static void test_objects(void **state)
{
    struct wire *wire = *state;
    write_boxes(wire);
    run(wire, "check @boxes.yaml --scene --scene-csv @all.csv", 0);
    char *out = wire_read(wire_path(wire, "out"), NULL), *all = wire_read(wire_path(wire, "all.csv"), NULL);
    int rows = 0;
    for (const char *p = out; (p = strstr(p, " closed none ")) != NULL; p++)
        rows++;
    assert_int_equal(rows, 50);
    static const char *const has[] = {
        "\nobjects   60, the largest first\n", "\n  and 10 more; --scene-csv FILE has all\n",
        "\nopen      box 0, \"red\", 4 open edges\n", "sum: 59 closed, 1 open, 0 turned, 0 empty\n",
        /* 5 * 2 + 59 * 12 triangles; 52 m2 + 10 i / 100 each, without the top of 6; 24 m3 + 6 i / 100 each but one */
        "\n         718          4         3291       1522.2  sum: "};
    for (size_t i = 0; i < sizeof has / sizeof has[0]; i++)
        if (strstr(out, has[i]) == NULL) fail_msg("%s is not in\n%s", has[i], out);
    const char *last = strstr(all, "\n\"box 59, \"\"red\"\"\",,,no,12,0,closed,57.9,27.54,1,none,0\n");
    if (last == NULL || strstr(all, "\n\"box 0, \"\"red\"\"\",,,no,10,4,open,46,,1,none,0\n") == NULL)
        fail_msg("%s", all);
    free(out);
    free(all);
}

/* On a pipe there is only the table, from its first line on. */
static void test_objects_by_pipe(void **state)
{
    struct wire *wire = *state;
    write_boxes(wire);
    run(wire, "check @boxes.yaml --scene --scene-csv -", 0);
    char *out = wire_read(wire_path(wire, "out"), NULL), *err = wire_read(wire_path(wire, "err"), NULL);
    int lines = 0;
    for (const char *p = out; (p = strchr(p, '\n')) != NULL; p++)
        lines++;
    assert_int_equal(strncmp(out, "object,type,", 12), 0);
    assert_int_equal(lines, 61);
    assert_true(strstr(err, ": ok\n") != NULL && strstr(err, "\nobjects   60") != NULL);
    free(out);
    free(err);
}

/* A warning of surfaces without colours is for those that have none. Surfaces with some get a warning of their own. */
static void test_colours_in_part(void **state)
{
    struct wire *wire = *state;
    wire_write_text(wire, "part.obj",
                    "v 0 0 0 1 0 0\nv 9 0 0 0 1 0\nv 9 9 0 0 0 1\nv 0 9 0\no part\nf 1 2 3\nf 1 3 4\n");
    wire_write_text(wire, "part.yaml",
                    "head: {profile: sphere, step_deg: 2}\noutput: {crs: local, colour: texture}\n"
                    "scene: {meshes: [{file: part.obj, up: z, scale: 1}]}\nstations: [{position_m: [5, 1, 1]}]\n");
    run(wire, "check @part.yaml", 0);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    if (strstr(err, "have neither") != NULL ||
        strstr(err, "1 of 1 surfaces have colours at only some of their corners") == NULL)
        fail_msg("%s", err);
    free(err);
}

/* Surfaces that a file calls transparent are solid until `surfaces` says otherwise. The warning has the line to
 * write. */
static void test_transparent(void **state)
{
    struct wire *wire = *state;
    static const char begin[] =
        "head: {profile: sphere, step_deg: 2}\noutput: {crs: local}\nstations: [{position_m: [5, 1, 1]}]\n"
        "scene: {meshes: [{file: pane.obj, up: z, scale: 1}]}\n";
    static const char line[] = "surfaces: [{material: \"a [1]\", glass: 0.7}, {material: \"b\", glass: 0.9}]";
    char text[1024], *rules;
    wire_write_text(wire, "pane.mtl", "newmtl a [1]\nKd 1 1 1\nTr 0.1\nd 0.3\nnewmtl b\nTr 1\nnewmtl c\nd 1\n");
    wire_write_text(wire, "pane.obj",
                    "mtllib pane.mtl\nv 0 0 0\nv 9 0 0\nv 9 9 0\nv 0 9 0\nusemtl a [1]\no x\nf 1 2 3\no y\nf 1 3 4\n"
                    "usemtl b\nf 1 2 4\nusemtl c\nf 2 3 4\n");
    for (int i = 0; i < 2; i++) {
        snprintf(text, sizeof text, "%s%s\n", begin, i == 0 ? "" : line);
        wire_write_text(wire, "pane.yaml", text);
        run(wire, "check @pane.yaml --scene", 0);
        char *err = wire_read(wire_path(wire, "err"), NULL), *out = wire_read(wire_path(wire, "out"), NULL);
        rules = strstr(err, "3 surfaces are transparent in the file, but scanned as opaque;");
        assert_int_equal(rules != NULL, i == 0);
        if (i == 0) assert_non_null(strstr(rules, line));
        if (strstr(out, "clear     70 %: x, material a [1]\n") == NULL ||
            strstr(out, "clear     100 %: y, material b\n") == NULL || strstr(out, "material c") != NULL)
            fail_msg("%s", out);
        free(err);
        free(out);
    }
}

static void test_help_of_a_section(void **state)
{
    struct wire *wire = *state;
    static const char *const lines[] = {"check --help plan", "check --help scene.anchor", "check --help head.prr_hz",
                                        "check --help profile"};
    static const char *const begins[] = {"plan\n", "scene.anchor\n", "head.prr_hz\n", "Head profile"};
    for (int i = 0; i < 4; i++) {
        run(wire, lines[i], 0);
        char *out = wire_read(wire_path(wire, "out"), NULL);
        assert_int_equal(strncmp(out, begins[i], strlen(begins[i])), 0);
        assert_true(strstr(out, "\nloop") == NULL && strstr(out, "usage:") == NULL);
        if (i == 3) assert_non_null(strstr(out, "allowed -180 to 360 deg; required with emitter: line\n"));
        free(out);
    }
}

/* Links that can be opened, but not together, or that can't carry 500,000 points of 20 bytes a second. `run` refuses
 * them, and `check` says the same. */
static void test_links_as_run(void **state)
{
    static const char *const says[] = {": cannot listen: Address already in use", ": the stream has 10.00 MB/s"};
    struct wire *wire = *state;
    int port;
    close(wire_bind(SOCK_STREAM, &port)); /* it is free now */
    room_write(wire);
    for (int i = 0; i < 2; i++) {
        char links[120] = "links: [{type: usb, port: 0, speed: full}]\n", *said[2], *from[2];
        if (i == 0)
            snprintf(links, sizeof links, "links: [{type: tcp, port: %d}, {type: tcp, address: 127.1, port: %d}]\n",
                     port, port);
        const struct room_config c = {
            .prr_hz = 500000, .lines_hz = 50, .pan_deg_s = 360, .pan_stop_deg = 36, .links = links};
        room_config_write(wire, &c);
        for (int k = 0; k < 2; k++) {
            run(wire, k == 0 ? "check @config.yaml" : "run @config.yaml", 2);
            said[k] = wire_read(wire_path(wire, "err"), NULL);
            from[k] = strstr(said[k], says[i]);
            if (from[k] == NULL) fail_msg("%s", said[k]);
        }
        assert_string_equal(from[0], from[1]);
        free(said[0]);
        free(said[1]);
    }
}

/* A file of a link is shown, and stays as it is. The file needs a folder. */
static void test_file_stays(void **state)
{
    struct wire *wire = *state;
    const struct room_config c = {.prr_hz = 20000,
                                  .lines_hz = 50,
                                  .pan_deg_s = 360,
                                  .pan_stop_deg = 36,
                                  .links = "links: [{type: file, path: kept}]\n"};
    room_write(wire);
    wire_write_text(wire, "kept", "keep me\n");
    room_config_write(wire, &c);
    run(wire, "check @config.yaml", 0);
    char *out = wire_read(wire_path(wire, "out"), NULL), *kept = wire_read(wire_path(wire, "kept"), NULL);
    if (strstr(out, "\nlink      file:") == NULL) fail_msg("%s", out);
    assert_string_equal(kept, "keep me\n");
    free(out);
    free(kept);
    wire_expect_usage(wire, usage_words(wire, "check @config.yaml --set links[0].path=none/x"),
                      "links[0].path none/x: No such file or directory");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_short_forms, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_all_faults, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_help_of_a_section, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_objects, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_objects_by_pipe, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_transparent, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_colours_in_part, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(little_memory_ends_in_a_line, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_example, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_links_as_run, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_file_stays, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
