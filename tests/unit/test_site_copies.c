/* SPDX-License-Identifier: MIT */
/* Copies of meshes in a whole site: points as from the same triangles written out, lists from the configuration and
 * from a file, and their errors. */
#include <math.h>

#include <png.h>

#include "core/cast.h"
#include "firmware_sim/site/site.h"
#include "tests/common/thorough.h"
#include "tests/unit/config_rig.h"

enum { CAST_LINES = 40, LINE_ROOM = 8192 };

static const char TREE[] =
    "o trunk\nv -0.1 -0.1 0\nv 0.1 -0.1 0\nv 0 0.1 0\nv 0 0 2\nf 3 2 1\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
    "o crown\nv -1 -1 1\nv 1 -1 1\nv 0 1 1\nv 0 0 4\nf 7 6 5\nf 5 6 8\nf 6 7 8\nf 7 5 8\n";
static const char GROUND[] = "o ground\nv -50 -50 0\nv 50 -50 0\nv 50 50 0\nv -50 50 0\nf 1 2 3 4\n";
static const char PLACES[] =
    "x_m,y_m,z_m,turn_deg,scale\n4,3,0,30,1\n\n-5,2,0.5,-200,1.5\n1,-7,0,0,0.7\n2.5,6,-0.1,77,2\n";
static const char LIST[] = "[{offset_m: [4, 3, 0], turn_deg: 30}, {offset_m: [-5, 2, 0.5], turn_deg: -200, scale: 1.5},"
                           " {offset_m: [1, -7, 0], scale: 0.7}, {offset_m: [2.5, 6, -0.1], turn_deg: 77, scale: 2}]";
static const char *const files[] = {"tree.obj", "ground.obj", "trees.csv", "board.obj", "board.mtl", "board.png"};

/* Writes a board whose texture gets lighter and is a hole in every other square. */
static int write_board(void)
{
    static uint8_t rgba[8 * 8][4];
    char path[256];
    png_image image = {.version = PNG_IMAGE_VERSION, .width = 8, .height = 8, .format = PNG_FORMAT_RGBA};
    for (int i = 0; i < 8 * 8; i++) {
        rgba[i][0] = rgba[i][1] = rgba[i][2] = (uint8_t)(4 * i);
        rgba[i][3] = (i % 8 + i / 8) % 2 != 0 ? 255 : 0;
    }
    write_in("board.mtl", "newmtl leaves\nmap_Kd board.png\n");
    write_in("board.obj", "mtllib board.mtl\nusemtl leaves\nv -1 0 0\nv 1 0 0\nv 1 0 3\nv -1 0 3\n"
                          "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n");
    snprintf(path, sizeof path, "%s/board.png", dir);
    return png_image_write_to_file(&image, path, 0, rgba, 0, NULL);
}

static int write_files(void **state)
{
    (void)state;
    if (set_up(state) != 0) return -1;
    write_in("tree.obj", TREE);
    write_in("ground.obj", GROUND);
    write_in("trees.csv", PLACES);
    return write_board() ? 0 : -1;
}

static int remove_files(void **state)
{
    char path[256];
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        snprintf(path, sizeof path, "%s/%s", dir, files[i]);
        unlink(path);
    }
    return tear_down(state);
}

#define STATION "{position_m: [0.3, 0.2, 1.6], heading_deg: 20}"
static const char *station = STATION;

/* tree: more keys of the mesh that has copies; more: further sections. */
static const char *text_of(const char *scene, const char *tree, const char *more)
{
    static char text[4096];
    snprintf(
        text, sizeof text,
        "head: {profile: riegl-vz400i, lines_hz: 40, pan_deg_s: 60}\nscene:\n%s  meshes:\n    - {file: ground.obj, up: z, scale: 1}\n"
        "    - {file: tree.obj, up: z, scale: 1, offset_m: [0.1, 0, 0], %s}\n"
        "stations: [%s]\n%s",
        scene, tree, station, more);
    return text;
}

static struct site *load_site(const char *text, int written_out)
{
    struct site *site;
    assert_loads(load_text(text));
    const int rc = site_load_for(cfg, written_out ? SITE_WRITTEN_OUT : SITE_FOR_SCANS, NULL, NULL, &site, &err);
    if (rc != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(site->scene->n_copies > 0 || (site->n_movers > 0 && site->mover[0].scene->n_copies > 0),
                     !written_out);
    return site;
}

struct lines {
    struct line_block block[CAST_LINES];
    uint32_t n;
};

static void cast_lines(const struct site *site, double t_s, struct lines *out)
{
    struct caster *caster;
    struct schedule_spec spec;
    struct schedule_segment segment;
    struct cast_setup setup;
    assert_int_equal(caster_create(&caster, &err), SH_OK);
    site_fill_spec(site, &cfg->head.settings, &spec);
    schedule_start(&segment, &spec);
    site_cast_setup(site, 0, &setup);
    site_move(site, 0, t_s, &setup);
    out->n = 0;
    for (uint64_t i = 0; i < CAST_LINES; i++) {
        struct schedule_line line;
        struct schedule_run run;
        schedule_get_line(&segment, i * 6, &line);
        const uint64_t n = line.cast_end - line.cast0;
        schedule_get_run(&segment, &line, line.cast0, (uint32_t)(n < LINE_ROOM ? n : LINE_ROOM), &run);
        assert_int_equal(line_block_alloc(&out->block[i], run.n * site_points_per_pulse(site), &err), SH_OK);
        out->n += caster_cast(caster, &setup, &run, &out->block[i]);
    }
    caster_free(caster);
}

/* A micrometre is a count, so a rounding may move from one count to the next. If a ray passes an edge by less than
 * rounding, it may meet either side. */
static void compare(struct lines *a, struct lines *b, uint32_t least_on_trees)
{
    uint32_t on_trees = 0, other = 0;
    assert_int_equal(a->n, b->n);
    for (int i = 0; i < CAST_LINES; i++) {
        const struct line_block *p = &a->block[i], *q = &b->block[i];
        assert_int_equal(p->n_points, q->n_points);
        for (uint32_t k = 0; k < p->n_points; k++) {
            const int64_t off = (int64_t)(uint32_t)p->a[k] - (int64_t)(uint32_t)q->a[k];
            on_trees += p->echo[k] != 0 && p->label[k] != 0;
            other += p->echo[k] != q->echo[k] || p->label[k] != q->label[k] || off > 1 || off < -1;
            other += p->refl_cdb[k] - q->refl_cdb[k] > 1 || q->refl_cdb[k] - p->refl_cdb[k] > 1;
        }
        line_block_free(&a->block[i]);
        line_block_free(&b->block[i]);
    }
    if (on_trees < least_on_trees) fail_msg("%u points are on trees", on_trees);
    assert_int_equal(other, 0);
}

static void compare_sites(const char *text, double t_s)
{
    static struct lines lines[2];
    for (int k = 0; k < 2; k++) {
        struct site *site = load_site(text, k);
        cast_lines(site, t_s, &lines[k]);
        site_free(site);
    }
    compare(&lines[0], &lines[1], 500);
}

static void points_are_those_of_triangles(void **state)
{
    (void)state;
    static const char *const more[] = {
        "", "beam: {mode: rings, rings: 2}\n", "signal: {model: on}\nnoise: {range: signal}\n",
        "signal: {model: on}\nbeam: {mode: rings, rings: 2}\noutput: {attributes: on}\n",
        "signal: {model: on}\nsurfaces: [{object: crown*, mirror: 0.6, reflectance: 0.1}]\noptics: {depth: 2}\n"};
    for (size_t i = SANITIZED ? 3 : 0; i < sizeof more / sizeof *more; i++) {
        compare_sites(text_of("", "copies: trees.csv", more[i]), 0.0);
        compare_sites(text_of("", "copies: trees.csv, copy_labels: on", more[i]), 0.0);
    }
}

/* Holes of textures, and their reflectances, are looked up in the mesh. */
static void textures_lie_on_copies(void **state)
{
    (void)state;
    static struct lines lines[2];
    char text[1024];
    for (int own = 0; own < 2; own++) {
        snprintf(text, sizeof text,
                 "head: {profile: riegl-vz400i, lines_hz: 40, pan_deg_s: 60}\nsignal: {model: on}\nscene:\n  meshes:\n"
                 "    - {file: ground.obj, up: z, scale: 1}\n"
                 "    - {file: board.obj, up: z, scale: 1, copies: trees.csv, copy_labels: %s}\n"
                 "stations: [{position_m: [0.3, 0.2, 1.6]}]\n",
                 own ? "on" : "off");
        for (int k = 0; k < 2; k++) {
            struct site *site = load_site(text, k);
            const struct scene *mesh = k == 0 ? site->scene->copied[0].mesh : site->scene;
            assert_true(mesh->cutout != NULL && mesh->uv != NULL);
            cast_lines(site, 0.0, &lines[k]);
            site_free(site);
        }
        compare(&lines[0], &lines[1], 500);
    }
}

static void copies_move_as_one_body(void **state)
{
    (void)state;
    const char *text =
        text_of("", "copies: trees.csv, move_m_s: [0.5, 0.2, 0], turn_deg_s: 20, pivot_m: [1, 1, 0]", "");
    compare_sites(text, 0.0);
    compare_sites(text, 3.0);
}

static void a_list_is_as_good_as_a_file(void **state)
{
    (void)state;
    static struct lines lines[2];
    char tree[1024], set[1024];
    snprintf(tree, sizeof tree, "copies: %s", LIST);
    for (int k = 0; k < 2; k++) {
        struct site *site = load_site(text_of("", k == 0 ? "copies: trees.csv" : tree, ""), 0);
        assert_int_equal(site->scene->n_copies, 4);
        cast_lines(site, 0.0, &lines[k]);
        site_free(site);
    }
    compare(&lines[0], &lines[1], 500);
    snprintf(set, sizeof set, "scene.meshes[1].copies=%s", LIST);
    write_file(config_path, text_of("", "copies: [{offset_m: [1, 1, 1]}]", ""),
               strlen(text_of("", "copies: [{offset_m: [1, 1, 1]}]", "")));
    assert_loads(load_sets((const char *const[]){set}, 1));
    assert_int_equal(cfg->scene.n_copies, 4);
    assert_true(cfg->scene.copy[3].mesh == 1 && cfg->scene.copy[3].place.scale == 2.0);
    assert_loads(load_sets((const char *const[]){"scene.meshes[1].copies=none", set}, 2));
    assert_int_equal(cfg->scene.n_copies, 4);
    assert_int_equal(load_sets((const char *const[]){"scene.meshes[1].copies=[{offset_m: [1, 2]}]"}, 1), SH_EINPUT);
    assert_says("2 numbers instead of 3");
}

/* An error in a file is reported with its line, the wrong value, and the allowed ones. */
static void faults_of_a_file_say_where(void **state)
{
    (void)state;
    static const struct {
        const char *text, *says;
    } fault[] = {
        {"", "trees.csv"},
        {"x_m,y_m\n1,2\n", "trees.csv, line 1: the first line needs x_m,y_m,z_m, and may have turn_deg,scale"},
        {"x_m,y_m,z_m,turn\n1,2,3,4\n", "turn"},
        {"x_m,y_m,z_m\n", "trees.csv: no copies below the first line"},
        {"x_m,y_m,z_m\n1,2,3\n\n1,2\n", "trees.csv, line 4: 2 values, but the first line names 3"},
        {"x_m,y_m,z_m\n1,2,x\n", "trees.csv, line 2: z_m is not a finite decimal number"},
        {"x_m,y_m,z_m\n1,2,1.1e9\n", "trees.csv, line 2: z_m 1.1e+09; allowed -1e9 to 1e9 m"},
        {"x_m,y_m,z_m,turn_deg\n1,2,2,0\n1,2,2,361\n", "trees.csv, line 3: turn_deg 361; allowed -360 to 360 deg"},
        {"x_m,y_m,z_m,scale\n1,2,2,0\n", "trees.csv, line 2: scale 0; allowed 0.001 to 1000"},
        {"x_m,y_m,z_m\n1e9,2,2\n", "trees.csv: copy 1 goes from"},
    };
    for (size_t i = 0; i < sizeof fault / sizeof *fault; i++) {
        struct site *site = NULL;
        write_in("trees.csv", fault[i].text);
        assert_loads(load_text(text_of("", "copies: trees.csv", "")));
        assert_int_equal(site_load(cfg, NULL, &site, &err), SH_EINPUT);
        assert_says(fault[i].says);
    }
    /* Limits themselves are allowed. */
    write_in("trees.csv", "x_m,y_m,z_m,turn_deg,scale\n1,2,3,360,1000\n1,2,3,-360,0.001\n");
    site_free(load_site(text_of("", "copies: trees.csv", ""), 0));
    write_in("trees.csv", PLACES);
}

/* 40,000 times two surfaces: that many copies alone are too many before the mesh is read. */
static void too_many_surfaces_are_refused(void **state)
{
    (void)state;
    static const uint32_t rows[] = {40000, 70000};
    static const char *const says[] = {"40000 copies with 2 surfaces each are too many: a scene holds up to 65534",
                                       "scene.meshes[1].copy_labels: on, with 70000 copies, but a scene holds up to"};
    char path[256];
    for (int k = 0; k < 2; k++) {
        struct site *site = NULL;
        snprintf(path, sizeof path, "%s/trees.csv", dir);
        FILE *f = fopen(path, "w");
        assert_non_null(f);
        fprintf(f, "x_m,y_m,z_m\n");
        for (uint32_t i = 0; i < rows[k]; i++)
            fprintf(f, "%u,0,0\n", i);
        assert_int_equal(fclose(f), 0);
        assert_loads(load_text(text_of("", "copies: trees.csv, copy_labels: on", "")));
        assert_int_equal(site_load(cfg, NULL, &site, &err), SH_EINPUT);
        assert_says(says[k]);
    }
    assert_loads(load_text(text_of("", "copies: trees.csv", "")));
    struct site *site = load_site(text_of("", "copies: trees.csv", ""), 0);
    assert_true(site->scene->n_copies == 70000 && site->scene->n_all == 2 + 70000 * 8 && site->n_surfaces == 3);
    site_free(site);
    write_in("trees.csv", PLACES);
}

/* Patterns choose among the copies' surfaces. The rest is scanned unchanged. */
static void targets_are_chosen_among_copies(void **state)
{
    (void)state;
    struct site *site = load_site(text_of("  target: {objects: [ground, crown]}\n", "copies: trees.csv", ""), 0);
    assert_true(site->n_surfaces == 2 && site->scene->n_all == 2 + 4 * 4 && site->scene->n_copies == 4);
    assert_string_equal(site_surface(site, scene_label(site->scene, 2))->object, "crown");
    const struct site_target *t = &site->world->target;
    assert_true(t->triangles == 18 && t->all_triangles == 34 && t->surfaces == 2 && t->all_surfaces == 3);
    site_free(site);
    const char *own = "copies: trees.csv, copy_labels: on";
    site = load_site(text_of("  target: {objects: [\"* 3\", \"* 2\"]}\n", own, ""), 0);
    assert_true(site->n_surfaces == 4 && site->scene->n_all == 16 && site->scene->n_copies == 2);
    assert_string_equal(site_surface(site, scene_label(site->scene, 15))->object, "crown 3");
    assert_true(site->scene->max_m[0] < 3.0);
    site_free(site);
    compare_sites(text_of("  target: {objects: [ground, \"* 4\"]}\n", own, ""), 0.0);
    compare_sites(text_of("  target: {objects: [\"* 4\", \"* 1\", \"* 2\"], others: hide}\n", own, ""), 0.0);
    assert_loads(load_text(text_of("  target: {objects: [\"crown 1\", \"trunk 2\"]}\n", own, "")));
    assert_int_equal(site_load(cfg, NULL, &site, &err), SH_EINPUT);
    assert_says("copy 2 of a mesh would keep other objects than an earlier copy");
}

/* A station stands on the second copy, 0.3 m from the axis of its crown. The crown's sides rise 3 m within 0.5 m. */
static void stations_stand_on_copies(void **state)
{
    (void)state;
    static struct lines lines;
    struct site *sites[2];
    station = "{position_m: [-5.1, 2.1, 30], instrument_height_m: 1.5}";
    for (int k = 0; k < 2; k++)
        sites[k] = load_site(text_of("", "copies: trees.csv", ""), k);
    station = STATION;
    const double *a = sites[0]->station[0].at.position_m, *b = sites[1]->station[0].at.position_m;
    assert_true(fabs(a[2] - b[2]) < 1e-9 && a[2] > 4.0);
    cast_lines(sites[0], 0.0, &lines);
    for (int i = 0; i < CAST_LINES; i++)
        line_block_free(&lines.block[i]);
    for (int k = 0; k < 2; k++)
        site_free(sites[k]);
}

static void methods_without_copies_say_so(void **state)
{
    (void)state;
    struct site *site = NULL;
    assert_loads(load_text(text_of("", "copies: trees.csv", "cast: {sight: on}\n")));
    assert_int_equal(site_load(cfg, NULL, &site, &err), SH_EINPUT);
    assert_says("cast.sight: on, but meshes have copies (scene.meshes[].copies); allowed auto, off");
    assert_loads(load_text(text_of("", "copies: trees.csv", "beam: {mode: adaptive}\n")));
    assert_int_equal(site_load(cfg, NULL, &site, &err), SH_EINPUT);
    assert_says("outlines of copies (scene.meshes[].copies) are not known; allowed here are single, rings and auto");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_are_those_of_triangles),   cmocka_unit_test(textures_lie_on_copies),
        cmocka_unit_test(copies_move_as_one_body),         cmocka_unit_test(a_list_is_as_good_as_a_file),
        cmocka_unit_test(faults_of_a_file_say_where),      cmocka_unit_test(too_many_surfaces_are_refused),
        cmocka_unit_test(targets_are_chosen_among_copies), cmocka_unit_test(stations_stand_on_copies),
        cmocka_unit_test(methods_without_copies_say_so),
    };
    return cmocka_run_group_tests_name("site copies", tests, write_files, remove_files);
}
