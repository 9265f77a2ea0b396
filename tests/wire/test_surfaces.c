/* SPDX-License-Identifier: MIT */
/* --surfaces of record and run: the meaning of each label of a point, as CSV beside the recording. */
#include "tests/wire/room.h"

static const char EXPECTED[] = "label,object,material,type,guid,colour\n"
                               "0,ground,\"grass, wet\",,,#3380cc\n"
                               "1,\"the \"\"wall\"\"\",,,,\n"
                               "2,cart,,,,\n"
                               "3,ghost of ground,\"grass, wet\",,,#3380cc\n"
                               "4,\"ghost of the \"\"wall\"\"\",,,,\n"
                               "5,ghost of cart,,,,\n";

/* Two objects that stand still, one that moves, and a mirror, which gives each a ghost. */
static void write_scene(struct wire *wire)
{
    wire_write_text(wire, "yard.mtl", "newmtl grass, wet\nKd 0.2 0.5 0.8\n");
    wire_write_text(wire, "yard.obj",
                    "mtllib yard.mtl\nv -9 -9 0\nv 9 -9 0\nv 9 9 0\nv -9 9 0\nv 9 9 5\nv -9 9 5\n"
                    "o ground\nusemtl grass, wet\nf 1 2 3 4\no the \"wall\"\nusemtl\nf 4 3 5 6\n");
    wire_write_text(wire, "cart.obj", "o cart\nv -2 4 1\nv -1 4 1\nv -1 4 2\nf 1 2 3\n");
    wire_write_text(wire, "c.yaml",
                    "head: {profile: sphere, step_deg: 5, frames: 1}\noutput: {crs: local}\n"
                    "scene:\n  meshes:\n    - {file: yard.obj, up: z, scale: 1}\n"
                    "    - {file: cart.obj, up: z, scale: 1, move_m_s: [1, 0, 0]}\n"
                    "surfaces: [{object: the*, mirror: 0.9}]\n"
                    "optics: {depth: 1}\nstations: [{position_m: [0, 0, 1.5]}]\nlinks: [{type: \"null\"}]\n");
}

static void surfaces_of_recordings(void **state)
{
    struct wire *wire = *state;
    char config[352], csv[352], ply[352];
    write_scene(wire);
    snprintf(config, sizeof config, "%s", wire_path(wire, "c.yaml"));
    snprintf(csv, sizeof csv, "%s", wire_path(wire, "labels.csv"));
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "x.ply"));
    const char *const lines[][16] = {
        {"record", config, "-o", ply, "--surfaces", csv, "--quiet", NULL},
        {"run", config, "--start", "--frames", "1", "--pace", "fast", "--surfaces", csv, "--quiet", NULL},
    };
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        unlink(csv);
        if (wire_wait(wire, wire_spawn(wire, lines[i], "out", "err", -1)) != 0)
            fail_msg("%s", wire_read(wire_path(wire, "err"), NULL));
        char *text = wire_read(csv, NULL);
        assert_string_equal(text, EXPECTED);
        free(text);
    }
}

/* Each job of a campaign has its table, which is one of its files. */
static void surfaces_of_a_campaign(void **state)
{
    struct wire *wire = *state;
    char config[352];
    write_scene(wire);
    snprintf(config, sizeof config, "%s", wire_path(wire, "c.yaml"));
    const char *line[] = {"batch", config, "-o", wire->dir, "--surfaces", "--quiet", NULL, NULL};
    for (int i = 0; i < 2; i++) { /* they are made, and made again where they are lost */
        if (wire_wait(wire, wire_spawn(wire, line, "out", "err", -1)) != 0)
            fail_msg("%s", wire_read(wire_path(wire, "err"), NULL));
        char *text = wire_read(wire_path(wire, "0001_station-1.surfaces.csv"), NULL);
        assert_string_equal(text, EXPECTED);
        free(text);
        assert_int_equal(unlink(wire_path(wire, "0001_station-1.surfaces.csv")), 0);
    }
    line[6] = "--merge";
    assert_int_equal(wire_wait(wire, wire_spawn(wire, line, "out", "err", -1)), 1);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(err, "0001_station-1.surfaces.csv: is missing"));
    free(err);
}

/* A recording has labels, but no surfaces. */
static void a_recording_has_none(void **state)
{
    struct wire *wire = *state;
    char shs[352], ply[352], csv[352];
    snprintf(shs, sizeof shs, "%s", wire_write_text(wire, "scan.shs", ""));
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "x.ply"));
    snprintf(csv, sizeof csv, "%s", wire_path(wire, "labels.csv"));
    const char *const lines[][8] = {{"record", shs, "-o", ply, "--surfaces", csv, NULL},
                                    {"run", shs, "--surfaces", csv, NULL}};
    static const char *const says[] = {"--scenario, --truth and --surfaces need a CONFIG as SOURCE",
                                       "--surfaces is for a configuration, but "};
    for (size_t i = 0; i < 2; i++) {
        assert_int_equal(wire_wait(wire, wire_spawn(wire, lines[i], "out", "err", -1)), 2);
        char *err = wire_read(wire_path(wire, "err"), NULL);
        if (strstr(err, says[i]) == NULL) fail_msg("%s", err);
        free(err);
        assert_int_not_equal(access(csv, F_OK), 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(surfaces_of_recordings, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(surfaces_of_a_campaign, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_recording_has_none, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
