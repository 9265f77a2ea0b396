/* SPDX-License-Identifier: MIT */
/* These tests use terrain in the program: init, check --scene, record, map and coverage of a GeoTIFF. */
#include <math.h>

#include "tests/common/tif.h"
#include "tests/wire/room.h"

enum { WIDTH = 60, HEIGHT = 50 };

/* Hills of 1 m, in cells of 0.5 m, with a hole of one cell. */
static void write_hills(const struct wire *wire, const char *name, uint16_t model, uint16_t system)
{
    static double value[WIDTH * HEIGHT];
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        value[i] = 500.0 + sin(i % WIDTH * 0.2) * cos(i / WIDTH * 0.3);
    value[20 * WIDTH + 20] = -9999.0;
    struct tif t = tif_of(WIDTH, HEIGHT, value);
    t.scale[0] = t.scale[1] = 0.5;
    t.no_data = "-9999";
    t.key[0][1] = model;
    t.key[2][0] = model == 1 ? 3072 : 2048;
    t.key[2][1] = system;
    tif_write(wire_path(wire, name), &t);
}

static char *run(struct wire *wire, int status, const char *const *args)
{
    const int got = wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
    char *out = wire_read(wire_path(wire, "out"), NULL), *err = wire_read(wire_path(wire, "err"), NULL), *both;
    assert_true(asprintf(&both, "%s%s", out, err) >= 0);
    free(out);
    free(err);
    if (got != status) fail_msg("%d: %s", got, both);
    return both;
}

#define RUN(wire, status, ...) run(wire, status, (const char *const[]){__VA_ARGS__, NULL})

static void contains(char *in, const char *what)
{
    if (strstr(in, what) == NULL) fail_msg("\"%s\" is missing in:\n%s", what, in);
}

static void terrain_becomes_a_scan(void **state)
{
    struct wire *wire = *state;
    char tif[256], yaml[256], ply[256], png[256];
    snprintf(tif, sizeof tif, "%s", wire_path(wire, "hills.tif"));
    snprintf(yaml, sizeof yaml, "%s", wire_path(wire, "hills.yaml"));
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "hills.ply"));
    snprintf(png, sizeof png, "%s", wire_path(wire, "hills.png"));
    write_hills(wire, "hills.tif", 1, 32632);
    char *said = RUN(wire, 0, "init", tif, "-o", yaml);
    contains(said, "size      29.5 x 24.5 x ");
    contains(said, "unit      1 m, as the format defines it");
    contains(said, "axes      z up, as the format defines it");
    contains(said, "1 of 3000 cells have no height, and are holes");
    free(said);
    /* The border has 2 (59 + 49) edges, the hole 4: the other three corners of each of its quads are joined. */
    said = RUN(wire, 0, "check", yaml, "--scene", "--set", "scene.anchor.source=geotiff");
    contains(said, "anchor    geotiff: the scene's coordinates are UTM 32 north");
    contains(said, "open      hills, 220 open edges");
    free(said);
    free(RUN(wire, 0, "record", yaml, "-o", ply, "--quiet"));
    said = RUN(wire, 0, "map", yaml, "-o", png, "--open-edges");
    contains(said, "220 open edges");
    free(said);
    free(RUN(wire, 0, "coverage", yaml));
}

static void what_is_no_terrain_is_told(void **state)
{
    struct wire *wire = *state;
    char tif[256], yaml[256];
    snprintf(tif, sizeof tif, "%s", wire_path(wire, "hills.tif"));
    snprintf(yaml, sizeof yaml, "%s", wire_path(wire, "hills.yaml"));
    write_hills(wire, "hills.tif", 2, 4326);
    char *said = RUN(wire, 2, "init", tif, "-o", yaml);
    contains(said, "its cells are degrees (EPSG:4326)");
    assert_null(strstr(said, "mesh of triangles"));
    free(said);
    said = RUN(wire, 2, "check", tif);
    contains(said, "hills.tif is a mesh");
    free(said);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(terrain_becomes_a_scan, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(what_is_no_terrain_is_told, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
