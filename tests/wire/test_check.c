/* What `scanhead check` prints: all faults of a configuration, the keys of a section, an example that
 * passes. And short options as getopt takes them. */
#include "tests/wire/room.h"

/* A value may follow its letter at once: -oFILE. */
static void test_short_forms(void **state)
{
    struct wire *wire = *state;
    char option[352], config[352];
    room_write(wire);
    snprintf(config, sizeof config, "%s",
             room_config_write(
                 wire,
                 &(struct room_config){
                     .prr_hz = 20000, .lines_hz = 50, .pan_deg_s = 360, .pan_stop_deg = 36, .frames = 1, .links = ""}));
    snprintf(option, sizeof option, "-o%s", wire_path(wire, "x.ply"));
    const char *const args[] = {"record", option, config, "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
    assert_int_equal(access(wire_path(wire, "x.ply"), R_OK), 0);
}

/* All faults of a configuration, a line each, at most 20. */
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
    const char *const args[] = {"check", config, NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 2);
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

/* `memory    1.3 MB for meshes and BVH, 205 bytes a triangle; 18 MB at the peak`: the figures fit together, up to the four
 * digits they have, and the peak has all of it. A triangle takes 58 bytes at the least: its plane, its corners' numbers
 * and label, and a leaf that it shares. */
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

/* The example passes `check`, and each of its keys is the one that the help has. */
static void test_example(void **state)
{
    struct wire *wire = *state;
    char config[352];
    assert_int_equal(
        wire_wait(wire, wire_spawn(wire, (const char *const[]){"check", "--example", NULL}, "x.yaml", "err", -1)), 0);
    snprintf(config, sizeof config, "%s", wire_path(wire, "x.yaml"));
    const int status =
        wire_wait(wire, wire_spawn(wire, (const char *const[]){"check", config, NULL}, "out", "err", -1));
    char *err = wire_read(wire_path(wire, "err"), NULL);
    if (status != 0 || err[0] != '\0') fail_msg("status %d: %s", status, err);
    free(err);
    check_memory(wire_read(wire_path(wire, "out"), NULL));
}

static void test_help_of_a_section(void **state)
{
    struct wire *wire = *state;
    static const char *const parts[] = {"plan", "scene.anchor", "head.prr_hz", "profile"};
    static const char *const begins[] = {"plan\n", "scene.anchor\n", "head.prr_hz\n", "Head profile"};
    for (int i = 0; i < 4; i++) {
        const char *const args[] = {"check", "--help", parts[i], NULL};
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
        char *out = wire_read(wire_path(wire, "out"), NULL);
        assert_int_equal(strncmp(out, begins[i], strlen(begins[i])), 0);
        assert_true(strstr(out, "\nloop") == NULL && strstr(out, "usage:") == NULL);
        if (i == 3) assert_non_null(strstr(out, "allowed -180 to 360 deg; required with emitter: line\n"));
        free(out);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_short_forms, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_all_faults, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_help_of_a_section, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_example, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
