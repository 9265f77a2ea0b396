/* SPDX-License-Identifier: MIT */
/* Copies of meshes in the configuration itself: where they stand, whose they are, and which of them --set replaces. */
#include "firmware_sim/config/load.h"
#include "tests/unit/config_rig.h"

static const char two[] =
    "    - {file: cube.obj, up: z, scale: 1, copies: [{offset_m: [1, 0, 0]}, {offset_m: [2, 0, 0]}]}\n"
    "    - {file: cube.obj, up: z, scale: 1, copies: [{offset_m: [3, 4, 5], turn_deg: 6, scale: 7}]}\n";

static int load_copies(const char *const *sets, int n)
{
    char *text = edited("    - file: cube.obj\n      up: z\n      scale: 1\n", two);
    write_file(config_path, text, strlen(text));
    free(text);
    return load_sets(sets, n);
}

/* Expects the meshes and the x of all copies: "0:1 0:2 1:3". */
static void expect_copies(const char *want)
{
    char got[256] = "";
    for (uint32_t i = 0; i < cfg->scene.n_copies; i++) {
        const struct config_copy *copy = &cfg->scene.copy[i];
        const size_t used = strlen(got);
        snprintf(got + used, sizeof got - used, "%s%u:%g", i > 0 ? " " : "", copy->mesh, copy->place.at_m[0]);
    }
    assert_string_equal(got, want);
}

static void each_copy_has_its_mesh_and_place(void **state)
{
    (void)state;
    assert_loads(load_copies(NULL, 0));
    expect_copies("0:1 0:2 1:3");
    const struct scene_place *first = &cfg->scene.copy[0].place, *last = &cfg->scene.copy[2].place;
    assert_true(first->at_m[1] == 0.0 && first->turn_deg == 0.0 && first->scale == 1.0);
    assert_true(last->at_m[1] == 4.0 && last->at_m[2] == 5.0 && last->turn_deg == 6.0 && last->scale == 7.0);
}

/* Where --set replaces a list, a mesh, all meshes or the whole scene, the copies there go, and no others. */
static void what_is_replaced_loses_its_copies(void **state)
{
    (void)state;
/* paths of --set are those of the working directory */
#define MESH "{file: config/scenes/glass_room.obj, up: z, scale: 1"
    static const struct {
        const char *set, *copies;
    } cases[] = {
        {"scene.meshes.0.copies=[{offset_m: [9, 0, 0]}]", "1:3 0:9"},
        {"scene.meshes.1.copies=[{offset_m: [9, 0, 0]}]", "0:1 0:2 1:9"},
        {"scene.meshes.1.copies=README.md", "0:1 0:2"}, /* a file, which is only opened here */
        {"scene.meshes.0=" MESH "}", "1:3"},
        {"scene.meshes.1=" MESH "}", "0:1 0:2"},
        {"scene.meshes.1=" MESH ", copies: [{offset_m: [8, 0, 0]}]}", "0:1 0:2 1:8"},
        {"scene.meshes=[" MESH "}]", ""},
        {"scene.meshes=[" MESH ", copies: [{offset_m: [8, 0, 0]}]}]", "0:8"},
        {"scene={meshes: [" MESH "}]}", ""},
        {"scene.meshes.0.scale=2", "0:1 0:2 1:3"},
        {"scene.meshes.0.copy_labels=on", "0:1 0:2 1:3"},
        {"scene.tolerance_m=0.5", "0:1 0:2 1:3"},
        {"scene.meshes.2=" MESH "}", "0:1 0:2 1:3"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        if (load_copies(&cases[i].set, 1) != SH_OK) fail_msg("%s: %s", cases[i].set, err.text);
        expect_copies(cases[i].copies);
        for (uint32_t k = cfg->scene.n_copies; k < 4; k++)
            assert_true(cfg->scene.copy[k].place.scale == 0.0); /* nothing is left of those that went */
    }
}

static void wrong_copies_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *set, *text;
    } cases[] = {
        {"scene.meshes.1.copies=[]",
         "--set scene.meshes[1].copies: a list of 0 copies; allowed 1 to 256 of all meshes together, more in a CSV file"},
        {"scene.meshes.0.copies=[5]", "--set scene.meshes[0].copies[0]: here stands a single value; allowed a section "
                                      "with offset_m, turn_deg, scale"},
        {"scene.meshes.0.copies=[{turn_deg: 5}]",
         "--set scene.meshes[0].copies[0].offset_m: missing, and it has no default; allowed [x, y, z], each -1000000000 to "
         "1000000000 m"},
        {"scene.meshes.0.copies=[{offset_m: [1, 2, 3], scale: 1001}]",
         "--set scene.meshes[0].copies[0].scale: \"1001\" is out of range; allowed 0.001 to 1000"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        assert_int_equal(load_copies(&cases[i].set, 1), SH_EINPUT);
        if (strcmp(err.text, cases[i].text) != 0) fail_msg("\"%s\"\nexpected \"%s\"", err.text, cases[i].text);
    }
}

/* There is room for 256 copies of all meshes together. */
static void the_most_copies(void **state)
{
    (void)state;
    char set[8192];
    const char *const sets[] = {set};
    for (int n = CONFIG_MAX_COPIES - 2; n <= CONFIG_MAX_COPIES - 1; n++) {
        size_t len = (size_t)snprintf(set, sizeof set, "scene.meshes.1.copies=[");
        for (int i = 0; i < n; i++)
            len += (size_t)snprintf(set + len, sizeof set - len, "%s{offset_m: [%d, 0, 0]}", i > 0 ? ", " : "", i);
        snprintf(set + len, sizeof set - len, "]");
        const int code = load_copies(sets, 1);
        if (n < CONFIG_MAX_COPIES - 1) {
            assert_loads(code);
            assert_int_equal(cfg->scene.n_copies, CONFIG_MAX_COPIES);
            assert_true(cfg->scene.copy[CONFIG_MAX_COPIES - 1].place.at_m[0] == n - 1);
        } else {
            assert_int_equal(code, SH_EINPUT);
            assert_says("a list of 255 copies; allowed 1 to 256 of all meshes together, more in a CSV file");
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_copy_has_its_mesh_and_place),
        cmocka_unit_test(what_is_replaced_loses_its_copies),
        cmocka_unit_test(wrong_copies_are_refused),
        cmocka_unit_test(the_most_copies),
    };
    return cmocka_run_group_tests_name("copies of meshes", tests, set_up, tear_down);
}
