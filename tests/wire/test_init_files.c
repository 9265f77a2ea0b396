/* SPDX-License-Identifier: MIT */
/* `scanhead init` takes more from a mesh's file than its shape: a raster's place, glass, and the warnings of its
 * reader. */
#include "tests/common/tif.h"
#include "tests/wire/wire.h"

static char *err_text, *made; /* of the last command; the configuration */

/* Runs init on a file of the test's folder; `made` is NULL where nothing was written. */
static int init(struct wire *wire, const char *file)
{
    char mesh[352], config[352];
    snprintf(mesh, sizeof mesh, "%s", wire_path(wire, file));
    snprintf(config, sizeof config, "%s", wire_path(wire, "made.yaml"));
    const char *const args[] = {"init", mesh, "-o", config, "--force", NULL};
    free(err_text);
    free(made);
    made = NULL;
    const int status = wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
    err_text = wire_read(wire_path(wire, "err"), NULL);
    if (access(config, F_OK) == 0) made = wire_read(config, NULL);
    return status;
}

static int forget(void **state)
{
    free(err_text);
    free(made);
    err_text = made = NULL;
    return wire_teardown(state);
}

static void has(const char *in, const char *what)
{
    if (in == NULL || strstr(in, what) == NULL) fail_msg("\"%s\" is missing in:\n%s", what, in);
}

/* The raster is a hill of 60 m. The scene is anchored where the file's system is one of the registry, in metres. */
static void a_raster_gives_the_place(void **state)
{
    struct wire *wire = *state;
    enum { N = 31 };
    static double hill[N * N];
    for (int i = 0; i < N * N; i++)
        hill[i] = 500.0 + 0.1 * (double)((i % N - 15) * (i % N - 15) + (i / N - 15) * (i / N - 15));
    struct tif t = tif_of(N, N, hill);
    char file[352];
    snprintf(file, sizeof file, "%s", wire_path(wire, "hill.tif"));
    tif_write(file, &t);
    if (init(wire, "hill.tif") != 0) fail_msg("%s", err_text);
    has(made, "\n  anchor: {source: geotiff} # EPSG:32632; height_m: ");
    has(err_text, "scene.anchor.height_m sets the height of the raster's 0 above the ellipsoid");
    t.key[0][1] = 32767;
    t.key[2][1] = 32767;
    tif_write(file, &t);
    if (init(wire, "hill.tif") != 0) fail_msg("%s", err_text);
    assert_null(strstr(made, "anchor"));
}

/* Names are too long for a warning. The configuration has the whole rule. */
static void long_names_of_glass_stay_whole(void **state)
{
    struct wire *wire = *state;
    char name[251], text[2048], rule[2048] = "# surfaces: [{material: \"";
    for (size_t i = 0; i < sizeof name - 1; i++)
        name[i] = i % 2 == 0 ? '*' : 'x';
    name[sizeof name - 1] = '\0';
    snprintf(text, sizeof text, "newmtl %s\nKd 1 1 1\nd 0.3\n", name);
    wire_write_text(wire, "pane.mtl", text);
    snprintf(text, sizeof text,
             "mtllib pane.mtl\nv 0 0 0\nv 9 0 0\nv 9 0 3\nv 0 0 3\no pane\nusemtl %s\nf 1 2 3\nf 1 3 4\n", name);
    wire_write_text(wire, "pane.obj", text);
    for (const char *p = name; *p != '\0'; p++)
        strcat(rule, *p == '*' ? "\\\\*" : "x");
    strcat(rule, "\", glass: 0.7}]\n");
    if (init(wire, "pane.obj") != 0) fail_msg("%s", err_text);
    has(made, rule);
    assert_null(strstr(made, "and more"));
    has(err_text, "surfaces: [...]; check --scene-csv FILE lists all");
}

/* The mesh has only degenerate faces. The reader's words give the reason why nothing is left. */
static void warnings_of_a_mesh_that_fails_are_said(void **state)
{
    struct wire *wire = *state;
    wire_write_text(wire, "flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\nf 1 2 2\n");
    assert_int_equal(init(wire, "flat.obj"), 2);
    assert_null(made);
    has(err_text, "flat.obj: 2 triangles without area left out");
}

/* Only the path from the configuration's folder is written. So the folder may have any name, and the mesh's may not. */
static void names_of_folders_may_be_any(void **state)
{
    struct wire *wire = *state;
    static const char *const names[] = {"b\xe4u", "two\nlines"}; /* Latin-1 */
    static const char *const says[] = {"its path is not UTF-8", "its path has control characters"};
    static const char floor[] = "v 0 0 0\nv 9 0 0\nv 9 9 0\nv 0 9 0\nf 1 2 3 4\n";
    for (int i = 0; i < 2; i++) {
        char there[64], mesh[352], config[352];
        snprintf(there, sizeof there, "%s/floor.obj", names[i]);
        assert_int_equal(mkdir(wire_path(wire, names[i]), 0700), 0);
        wire_write_text(wire, there, floor);
        snprintf(mesh, sizeof mesh, "%s", wire_path(wire, there));
        assert_int_equal(init(wire, there), 2);
        assert_null(made);
        has(err_text, says[i]);
        snprintf(there, sizeof there, "%s/floor.yaml", names[i]);
        snprintf(config, sizeof config, "%s", wire_path(wire, there));
        const char *const args[] = {"init", mesh, "-o", config, NULL};
        const int status = wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
        char *err_here = wire_read(wire_path(wire, "err"), NULL);
        if (status != 0) fail_msg("%s", err_here);
        free(err_here);
        char *yaml = wire_read(config, NULL);
        has(yaml, "file: \"floor.obj\"");
        free(yaml);
        unlink(config);
        unlink(mesh);
        rmdir(wire_path(wire, names[i]));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_raster_gives_the_place, wire_setup, forget),
        cmocka_unit_test_setup_teardown(long_names_of_glass_stay_whole, wire_setup, forget),
        cmocka_unit_test_setup_teardown(warnings_of_a_mesh_that_fails_are_said, wire_setup, forget),
        cmocka_unit_test_setup_teardown(names_of_folders_may_be_any, wire_setup, forget),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
