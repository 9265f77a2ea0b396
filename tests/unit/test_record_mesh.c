/* SPDX-License-Identifier: MIT */
/* Meshes of recorded grids, and points spread over them. The triangles of the streams are counted by hand. */
#include "core/scene.h"
#include "tests/unit/grid_rig.h"

static struct sh_err err;

static void record_ok(const char *name, struct recorder_options options)
{
    if (rig_record(rig_path(name), options, RIG_KEEP, &err) != SH_OK) fail_msg("%s", err.text);
}

static void has(const char *text, const char *expected)
{
    if (strstr(text, expected) == NULL) fail_msg("no '%s' in:\n%s", expected, text);
}

static void remove_file(const char *name)
{
    assert_int_equal(unlink(rig_path(name)), 0);
}

/* ---- .ply */

static void a_step_as_ply(void **state)
{
    (void)state;
    rig_begin();
    grid_rig_begin_scan(1, 3);
    grid_rig_put_step(5);
    char *text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1, .mesh = 1, .long_edge = 1.2}, NULL);
    has(text, "comment crs scene frame, metres\n");
    has(text, "comment mean_edge_m 1.18972");
    has(text, "comment long_edge 1.2 left_out 4\n");
    has(text, "element vertex 12\n");
    has(text, "property double z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty double range\n"
              "property float reflectance\nproperty ushort label\nproperty ushort station\nelement face 8\n");
    /* The first point is 10 m away, with a reflectance of -5 dB. The point's normal points to the head. */
    has(text, "end_header\n10 30 30 0 -1 0 10 -5 0 3\n");
    has(text, "\n13 31 32 0 -1 0 "); /* the last one */
    assert_int_equal(rig_count(text, "\n3 "), 8);
    has(rig_notes, "4 triangles left out, with an edge over 1.2 times their scan's mean edge, 1.19 m (--long-edge)");
    assert_int_equal(rig_count(rig_notes, "\n"), 1);
    free(text);
    rig_begin();
    grid_rig_begin_scan(1, 3);
    grid_rig_put_step(5);
    text = rig_record_bytes("a.ply",
                            (struct recorder_options){.ascii = 1, .mesh = 1, .columns = PLY_LABEL | PLY_COLOUR}, NULL);
    has(text, "property float nz\nproperty ushort label\nelement face 12\n"); /* there are no colours */
    free(text);
    rig_begin();
    grid_rig_begin_scan(1, 3);
    grid_rig_put_step(5);
    text = rig_record_bytes("a.ply",
                            (struct recorder_options){.ascii = 1, .mesh = 1, .long_edge = 1, .scalar_names = 1}, NULL);
    has(text, "comment points_without_triangle 12\n");
    has(text, "property double scalar_range\n");
    has(text, "element vertex 0\n");
    has(text, "element face 0\n");
    has(rig_notes, "it has no triangles");
    has(rig_notes, "12 points left out that belong to no triangle");
    free(text);
    rig_begin();
    grid_rig_begin_scan(1, 3);
    grid_rig_put_line(2, 20, (struct rig_point[]){grid_rig_hit(-5, 10, 0, 9)},
                      1); /* no line is beside it: the points after it take its place */
    grid_rig_put_step(5);
    text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1, .mesh = 1}, NULL);
    has(text, "comment points_without_triangle 1\n");
    has(text, "end_header\n10 30 30 0 -1 0 10 -5 0 3\n");
    free(text);
}

/* Each sweep of the pan is a mesh by itself: 12 triangles each, and none between the two. */
static void sweeps_are_apart(void **state)
{
    (void)state;
    rig_begin();
    grid_rig_begin_scan(1, 3);
    grid_rig_put_step(0);
    rig_sweep = 1;
    grid_rig_put_step(4);
    char *text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1, .mesh = 1}, NULL);
    has(text, "element face 24\n");
    assert_string_equal(rig_notes, "");
    free(text);
}

/* A moving head passes a wall at 5 m: triangles face the head. The line without a pose is left out. */
static void a_wall_beside_the_way(void **state)
{
    (void)state;
    static uint8_t out[1024];
    const struct native_descriptor d = grid_rig_descriptor(1);
    struct native_anchor a = grid_rig_anchor(1);
    struct native_pose pose[2];
    a.moving = NATIVE_MOVING;
    for (int i = 0; i < 2; i++)
        pose[i] =
            (struct native_pose){.t_ns = 4000000000 * i,
                                 .position_m = {grid_rig_head_m[0], grid_rig_head_m[1] + 4 * i, grid_rig_head_m[2]},
                                 .quat = {1, 0, 0, 0}};
    rig_begin();
    grid_rig_put_descriptor(&d);
    rig_anchor(&a);
    rig_put(out, native_encode_poses(out, sizeof out, pose, 2, 0, 0));
    for (uint32_t line = 0; line < 5; line++) {
        const struct rig_point p[3] = {grid_rig_hit(5, line, 0, 0), grid_rig_hit(5, line, 1, 0),
                                       grid_rig_hit(5, line, 2, 0)};
        grid_rig_put_line(line, 20, p, 3);
    }
    char *text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1, .mesh = 1}, NULL);
    has(text, "element face 12\n");
    has(text, "end_header\n15 20 30 -1 0 0 ");
    has(text, "\n15 23 32 -1 0 0 ");
    has(rig_notes, "3 points left out whose pose was lost");
    free(text);
}

/* 4 m2 have 400 points at 100 a square metre. The points lie on the walls, with their labels. */
static void points_spread_over_the_step(void **state)
{
    (void)state;
    char *text[3];
    for (int i = 0; i < 3; i++) {
        rig_begin();
        grid_rig_begin_scan(1, 3);
        grid_rig_put_step(0);
        text[i] = rig_record_bytes(
            "a.ply",
            (struct recorder_options){.ascii = 1, .sparse_per_m2 = 100, .sparse_seed = i < 2 ? 7 : 8, .long_edge = 1.2},
            NULL);
    }
    has(text[0], "comment sparse 100 points per m2, seed 7: 400 points on 4 m2\n");
    has(text[0], "element vertex 400\n");
    assert_null(strstr(text[0], "element face"));
    assert_string_equal(text[0], text[1]);
    assert_string_not_equal(strstr(text[0], "end_header"), strstr(text[2], "end_header"));
    const char *p = strstr(text[0], "end_header\n") + 11;
    for (int i = 0; i < 400; i++) {
        double x, y, z, range, reflectance;
        unsigned label, station;
        int used;
        assert_int_equal(
            sscanf(p, "%lf %lf %lf %lf %lf %u %u%n", &x, &y, &z, &range, &reflectance, &label, &station, &used), 7);
        p += used;
        const int is_far = label == 1;
        assert_true(fabs(y - (is_far ? 31 : 30)) < 1e-9 && x >= 10 + 2 * is_far && x <= 11 + 2 * is_far);
        assert_true(z >= 30 && z <= 32 && station == 3 && reflectance == -5);
        /* The range lies between those of the corners, which are at most 0.2 m apart, and above the true one: the mean
         * of a convex function's values is more than its value at the mean. */
        const double there = sqrt((x - 10) * (x - 10) + (y - 20) * (y - 20) + (z - 30) * (z - 30));
        assert_true(range >= there - 1e-6 && range < there + 0.1);
    }
    for (int i = 0; i < 3; i++)
        free(text[i]);
}

/* ---- meshes with a material */

/* Ten lines of four shots are on a tube of 5 m radius, rows 0.5 m apart. The tube is closed: 10 * 3 cells of two. */
static void put_tube(uint32_t lines)
{
    for (uint32_t line = 0; line < lines; line++) {
        struct rig_point p[4];
        const double angle = 2 * 3.14159265358979323846 * line / FULL;
        for (uint32_t row = 0; row < 4; row++)
            p[row] = grid_rig_hit(5 * sin(angle), 5 * cos(angle), 0.5 * row, (uint16_t)line);
        grid_rig_put_line(line, 20, p, 4);
    }
}

/* The texture has ten columns and four rows; texels' middles are at 0.05, 0.15, ... The seam's far side is at 1.05. */
static void a_full_turn_and_its_texture(void **state)
{
    (void)state;
    struct scene *scene;
    for (uint32_t lines = 8; lines <= FULL; lines++) {
        rig_begin();
        grid_rig_begin_scan(1, 1);
        put_tube(lines);
        record_ok("a.obj", (struct recorder_options){.long_edge = 0});
        const struct scene_mesh_spec spec = {.file = rig_path("a.obj"), .scale = 1, .textures = 1};
        if (scene_load(&spec, 1, 1e-3, NULL, &scene, &err) != SH_OK) fail_msg("%s", err.text);
        /* 10 lines: 1 step from the last to the first; 9: 2 steps, which is too far */
        const uint32_t cells = 3 * (lines == FULL ? FULL : lines - 1);
        assert_int_equal(scene->n_triangles, 2 * cells);
        float most = 0;
        for (uint32_t i = 0; i < scene->n_triangles; i++)
            for (int k = 0; k < 3; k++)
                if (scene->uv[i][k][0] > most) most = scene->uv[i][k][0];
        const double last = (lines == FULL ? lines + 0.5 : lines - 0.5) / lines;
        assert_true(fabs((double)most - last) < 1e-6);
        assert_int_equal(scene->n_textures, 1);
        has(scene->texture[0].file, "a.png");
        struct texture_image image;
        assert_int_equal(scene_read_texture(&scene->texture[0], 0, &image, &err), SH_OK);
        assert_int_equal(image.width, lines);
        assert_int_equal(image.height, 4);
        assert_memory_not_equal(image.rgba, image.rgba + 4, 3); /* a hue for each label */
        texture_image_free(&image);
        scene_free(scene);
        remove_file("a.obj");
        remove_file("a.mtl");
        remove_file("a.png");
    }
}

static void two_stations_are_two_objects(void **state)
{
    (void)state;
    rig_begin();
    grid_rig_begin_scan(1, 1);
    grid_rig_put_step(0);
    grid_rig_begin_scan(2, 2);
    grid_rig_put_step(3);
    char *text = rig_record_bytes("b.obj", (struct recorder_options){.long_edge = 1.2}, NULL),
         *materials = rig_take("b.mtl", NULL);
    has(text, "mtllib b.mtl\no station 1\nv 10 30 30\nvt 0.125 0.166666672\nvn 0 -1 0\n");
    has(text, "usemtl station_1\nf ");
    has(text, "o station 2\nv 10 30 30\n");
    assert_int_equal(rig_count(text, "\nf "), 16);
    has(text, "\nf 13/13/13 "); /* the second object has vertices of its own */
    has(materials, "newmtl station_2\n");
    has(materials, "map_Kd b.2.png\n");
    free(text);
    free(materials);
    remove_file("b.1.png");
    remove_file("b.2.png");
    rig_begin();
    grid_rig_begin_scan(1, 1);
    grid_rig_put_step(0);
    struct native_descriptor d = grid_rig_descriptor(2);
    const struct native_anchor a = grid_rig_anchor(2);
    strcpy(d.profile, "other");
    grid_rig_put_descriptor(&d);
    rig_anchor(&a);
    grid_rig_put_step(3);
    text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1, .mesh = 1, .n_heads = 2}, NULL);
    has(text, "comment idn Maker,Model,SN1,1.0\ncomment profile other\n"); /* of the last scan */
    has(text, "comment station 1 scan 1 profile model\ncomment station 2 scan 2 profile other\n");
    free(text);
    rig_begin();
    grid_rig_begin_scan(1, 1);
    grid_rig_put_step(0);
    text = rig_record_bytes("c.obj", (struct recorder_options){.colour = {.given = 1}}, NULL); /* --colour none */
    assert_null(strstr(text, "mtl"));
    assert_null(strstr(text, "vt "));
    free(text);
}

static void name_surface(void *ctx, uint32_t label, const char **object, const char **material)
{
    (void)ctx;
    *object = label == 0 ? "wall" : "door";
    *material = "oak";
}

/* A second scan from a station is an object of another name. The file names the surfaces that the stream names. */
static void one_station_twice(void **state)
{
    (void)state;
    static uint8_t out[1024];
    struct native_names names = {0, 2, name_surface, NULL};
    struct native_descriptor d = grid_rig_descriptor(1);
    const struct native_anchor a = grid_rig_anchor(1);
    d.n_surfaces = 2;
    rig_begin();
    rig_put(out, native_encode_surfaces(out, sizeof out, 1024, &names, 0));
    grid_rig_put_descriptor(&d);
    rig_anchor(&a);
    grid_rig_put_step(0);
    d.scan = 2;
    grid_rig_put_descriptor(&d);
    rig_anchor(&a);
    grid_rig_put_step(0);
    char *text = rig_record_bytes("b.obj", (struct recorder_options){.colour = {.given = 1}}, NULL);
    assert_int_equal(rig_count(text, "\no station 1\n"), 1);
    has(text, "\no station 1 scan 2 part 2\n");
    assert_int_equal(rig_count(text, "\no "), 2);
    has(text, "# label 0 wall | oak\n# label 1 door | oak\n");
    free(text);
}

/* ---- more of the stream */

static void later_echoes_and_lines_that_go_back(void **state)
{
    (void)state;
    rig_begin();
    grid_rig_begin_scan(1, 1);
    for (uint32_t line = 0; line < 2; line++) {
        const struct rig_point p[5] = {{1000 * (int32_t)line, 10000, 0, 0, 0, 1, 2},
                                       {1000 * (int32_t)line, 12000, 0, 0, 0, 2, 2},
                                       grid_rig_hit(line, 10, 1, 0),
                                       {0, 0, 0, 0, 0xffff, 0, 0},
                                       grid_rig_hit(line, 10, 3, 0)};
        grid_rig_put_line(line, 0, p, 5);
    }
    grid_rig_first_pulse = 2 * PULSES;
    grid_rig_put_step(0); /* line 0 again: a mesh of its own */
    grid_rig_first_pulse = 0;
    char *text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1, .mesh = 1, .long_edge = 0}, NULL);
    has(text, "element face 14\n"); /* a cell, and the step */
    has(rig_notes, "2 echoes left out; a mesh holds the first of a shot\n");
    has(rig_notes, "1 additional meshes begun within a scan, since its line or row numbers went back\n");
    has(rig_notes, "2 points left out that belong to no triangle\n"); /* behind the empty shots */
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_step_as_ply),
        cmocka_unit_test(points_spread_over_the_step),
        cmocka_unit_test(sweeps_are_apart),
        cmocka_unit_test(a_wall_beside_the_way),
        cmocka_unit_test(a_full_turn_and_its_texture),
        cmocka_unit_test(two_stations_are_two_objects),
        cmocka_unit_test(one_station_twice),
        cmocka_unit_test(later_echoes_and_lines_that_go_back),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
