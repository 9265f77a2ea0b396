/* SPDX-License-Identifier: MIT */
/* The scanned part of a scene: surfaces that are left out of it, and surfaces that give no echo. */
#include "firmware_sim/site/site.h"
#include "tests/unit/cast_rig.h"
#include "tests/unit/config_rig.h"

/* Three surfaces of two triangles are side by side along x; neighbours share vertices 2 and 3, or 4 and 5. */
static struct scene *strip(void)
{
    static const double v[8][3] = {{0, 0, 0}, {0, 1, 0}, {1, 0, 0}, {1, 1, 0},
                                   {2, 0, 0}, {2, 1, 0}, {3, 0, 7}, {3, 1, 7}};
    static const uint32_t t[6][3] = {{0, 2, 1}, {2, 3, 1}, {2, 4, 3}, {4, 5, 3}, {4, 6, 5}, {6, 7, 5}};
    static const uint16_t label[6] = {0, 0, 1, 1, 2, 2};
    static const struct scene_surface surface[3] = {{.object = "a"}, {.object = "b"}, {.object = "c"}};
    struct scene *scene;
    if (scene_from_arrays(&(struct scene_arrays){v, 8, t, 6, label, surface, 3}, &scene, &err) != SH_OK)
        fail_msg("%s", err.text);
    return scene;
}

static void what_is_left_has_its_own_numbers(void **state)
{
    (void)state;
    struct scene *scene = strip();
    assert_int_equal(scene_keep(scene, (const uint8_t[]){0, 1, 1}, &err), SH_OK);
    assert_true(scene->n_triangles == 4 && scene->n_surfaces == 2 && scene->n_vertices == 6);
    assert_string_equal(scene->surface[0].object, "b");
    assert_string_equal(scene->surface[1].object, "c");
    static const uint16_t label[4] = {0, 0, 1, 1};
    static const uint32_t t[4][3] = {{0, 2, 1}, {2, 3, 1}, {2, 4, 3}, {4, 5, 3}}; /* numbers of vertices are two less */
    assert_memory_equal(scene->label, label, sizeof label);
    assert_memory_equal(scene->triangle, t, sizeof t);
    assert_true(scene->vertex_m[0][0] == 1 && scene->vertex_m[5][2] == 7);
    assert_true(scene->min_m[0] == 1 && scene->max_m[0] == 3 && scene->max_m[2] == 7);
    assert_int_equal(scene_keep(scene, (const uint8_t[]){1, 0}, &err), SH_OK);
    assert_true(scene->n_triangles == 2 && scene->max_m[0] == 2 && scene->max_m[2] == 0);
    assert_int_equal(scene_keep(scene, (const uint8_t[]){0}, &err), SH_OK);
    assert_true(scene->n_triangles == 0 && scene->n_surfaces == 0 && scene->n_vertices == 0);
    scene_free(scene);
}

/* A line is scanned in a box. Pulses that meet a silent wall are shots without echo, and counted; all others are
 * unchanged. */
static void silent_surfaces_give_no_echo(void **state)
{
    (void)state;
    static const double lo[3] = {-4, -5, -2}, hi[3] = {6, 5, 3}, station[3] = {0.5, 0.25, 0.125};
    enum { CEILING = 5 };
    uint8_t silent[6] = {[CEILING] = 1};
    struct cast_rig *rig = cast_rig_open(box_scene(lo, hi), station);
    struct schedule_line line;
    struct cast_counters counters;
    const uint32_t all = cast_line(rig, 7, &line), n = rig->block.n_points;
    uint8_t echo[RIG_LINE];
    uint16_t label[RIG_LINE];
    uint32_t range[RIG_LINE], hidden = 0;
    memcpy(echo, rig->block.echo, n);
    memcpy(label, rig->block.label, n * sizeof *label);
    memcpy(range, rig->block.a, n * sizeof *range);
    rig->setup.silent = silent;
    const uint32_t rest = cast_line(rig, 7, &line);
    assert_int_equal(rig->block.n_points, n);
    for (uint32_t i = 0; i < n; i++) {
        long double d[3], mirror, pan;
        int wall;
        true_angles(&rig->spec, line.cast0 + i, &mirror, &pan);
        true_direction(mirror, pan, 0.0L, d);
        box_range(lo, hi, station, d, &wall);
        hidden += wall == CEILING;
        assert_int_equal(rig->block.echo[i] != 0, wall != CEILING);
        if (wall == CEILING) continue;
        assert_true(rig->block.echo[i] == echo[i] && rig->block.label[i] == label[i]);
        assert_true((uint32_t)rig->block.a[i] == range[i]);
    }
    assert_true(hidden > n / 20 && hidden < n);
    assert_int_equal(rest, all - hidden);
    caster_get_counters(rig->caster, &counters);
    assert_int_equal(counters.faint, hidden);
    cast_rig_close(rig);
}

/* ---- a site with things that move */

static int load_moving(const char *target, struct site **site)
{
    static const char quad[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n";
    char text[1024];
    FILE *f;
    const char *const object[2][2] = {{"house", "tree"}, {"car", "flag"}};
    for (int i = 0; i < 2; i++) {
        snprintf(text, sizeof text, "%s/%s", dir, i == 0 ? "still.obj" : "moving.obj");
        f = fopen(text, "w");
        assert_non_null(f);
        for (int k = 0; k < 2; k++)
            fprintf(f, "o %s\n%s", object[i][k], quad);
        assert_int_equal(fclose(f), 0);
    }
    snprintf(text, sizeof text,
             "head: {profile: any-rate}\nscene:\n  target: %s\n  meshes:\n    - {file: still.obj, up: z, scale: 1}\n"
             "    - {file: cube.obj, up: z, scale: 1, move_m_s: [1, 0, 0]}\n"
             "    - {file: moving.obj, up: z, scale: 1, move_m_s: [1, 0, 0]}\nstations: [{position_m: [0, 0, 2]}]\n",
             target);
    int rc = load_text(text);
    if (rc == SH_OK) rc = site_load(cfg, NULL, site, &err);
    snprintf(text, sizeof text, "%s/still.obj", dir);
    unlink(text);
    snprintf(text, sizeof text, "%s/moving.obj", dir);
    unlink(text);
    return rc;
}

static void targets_are_chosen_in_all_meshes(void **state)
{
    (void)state;
    struct site *site;
    assert_loads(load_moving("{objects: [tree, flag]}", &site));
    assert_true(site->n_movers == 1 && site->scene->n_triangles == 1 && site->n_surfaces == 2 && site->silent == NULL);
    assert_string_equal(site_surface(site, 0)->object, "tree");
    assert_string_equal(site_surface(site, 1)->object, "flag");
    assert_string_equal(strrchr(cfg->scene.mesh[site->mover[0].number].file, '/'), "/moving.obj");
    assert_int_equal(site->mover[0].scene->label[0], 1);
    const struct site_target *t = &site->world->target;
    assert_true(t->triangles == 2 && t->all_triangles == 5 && t->surfaces == 2 && t->all_surfaces == 5);
    struct site *beside;
    assert_int_equal(site_load_for(cfg, SITE_FOR_SCANS, site, NULL, &beside, &err), SH_OK);
    assert_ptr_equal(beside->world, site->world);
    site_free(site);
    site_free(beside);
    assert_loads(load_moving("{objects: [tree, \"c?r\"], others: hide}", &site));
    assert_true(site->n_movers == 2 && site->n_surfaces == 5);
    for (uint32_t i = 0; i < 5; i++) {
        const char *object = site_surface(site, i)->object;
        assert_int_equal(site->silent[i], strcmp(object, "tree") != 0 && strcmp(object, "car") != 0);
    }
    site_free(site);
    assert_loads(load_moving("{objects: [\"*\"], others: hide}", &site));
    assert_null(site->silent); /* all of them: nothing is spent on it */
    site_free(site);
}

/* Patterns have * and ? alone: no brackets and no backslash of a shell's. ? is a character, not a byte. */
static void names_fit_patterns(void **state)
{
    (void)state;
    static const struct {
        const char *pattern, *fits, *not ;
    } rows[] = {
        {"", "", "a"},
        {"*", "", NULL},
        {"*", "a[1]\\", NULL},
        {"a*", "a", "ba"},
        {"*a*b*", "xxaybyab", "ba"},
        {"*aab", "aaab", "aabb"}, /* the star takes more once the rest doesn't fit */
        {"a*b?d", "abcbcd", "abcd\xc3\xa4"},
        {"b[1]", "b[1]", "b1"},
        {"[a-c]", "[a-c]", "b"},
        {"a\\b", "a\\b", "ab"},
        {"a\\\\b", "a\\\\b", "a\\b"},
        {"\\*", "*", "\\x"},
        {"a\\?*", "a?b", "abc"},
        {"a\\\\*", "a\\*", "a\\x"}, /* a\* is a name, too: its backslash stands before an escaped star */
        {"a\\", "a\\", "a"},
        {"K?che",
         "K\xc3\xbc"
         "che",
         "K\xc3\xbc"
         "xche"},
        {"*?", "\xe2\x82\xac", ""},
        {"?", "\xe2\x82\xac",
         "\xe2\x82\xac"
         "a"},
        {"??", "\xfc\xc3", "\xfc"}, /* Latin-1, which is no UTF-8: each byte is one */
        {"A", "A", "a"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        if (!scene_name_fits(rows[i].pattern, rows[i].fits)) fail_msg("%s: not %s", rows[i].pattern, rows[i].fits);
        if (rows[i].not != NULL && scene_name_fits(rows[i].pattern, rows[i].not ))
            fail_msg("%s: %s", rows[i].pattern, rows[i].not );
    }
}

/* If a mesh has copies, each copy of a target counts. */
static void targets_count_in_all_copies(void **state)
{
    (void)state;
    static const char *const target[] = {"{objects: ['b[1]\\x'], others: hide}", "{objects: [a], others: hide}",
                                         "{objects: [\"*\"], others: hide}"};
    static const uint32_t triangles[] = {6, 3, 9};
    write_in("cube.obj",
             "o a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\no b[1]\\x\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\nf 4 5 6\n"
             "f 5 7 6\n");
    for (int i = 0; i < 3; i++) {
        char text[512];
        struct site *site;
        snprintf(text, sizeof text,
                 "head: {profile: any-rate}\nscene:\n  target: %s\n  meshes:\n    - {file: cube.obj, up: z, scale: 1, "
                 "copies: [{offset_m: [0, 0, 0]}, {offset_m: [9, 0, 0]}, {offset_m: [18, 0, 0]}]}\n"
                 "stations: [{position_m: [0, 0, 5]}]\nbeam: {mode: single}\n",
                 target[i]);
        assert_loads(load_text(text));
        if (site_load(cfg, NULL, &site, &err) != SH_OK) fail_msg("%s", err.text);
        assert_int_equal(site->world->target.triangles, triangles[i]);
        assert_int_equal(site->world->target.all_triangles, 9);
        site_free(site);
    }
    write_in("cube.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
}

static void wrong_targets_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *target, *says;
    } wrong[] = {
        {"{objects: [tre]}",
         "scene.target.objects[0]: no object fits \"tre\"; allowed names of the scene's 5 objects, similar ones are "
         "\"tree\""},
        {"{objects: [tree, \"xyzzy*\"]}", "scene.target.objects[1]: no object fits \"xyzzy*\""},
        /* nearest first: letters in any case, without wildcards, or to the beginning of the name */
        {"{objects: [HOU]}", "similar ones are \"house\""},
        {"{objects: [\"*Fl?\"]}", "similar ones are \"flag\""},
        {"{objects: [hoXY]}", "similar ones are \"house\""},
        {"{objects: [caree]}", "similar ones are \"tree\", \"car\""},
        {"{objects: [hoXYZ]}", "5 objects, as \"house\""}, /* three letters are not similar */
        {"{objects: [treehouse]}", "5 objects, as \"house\", \"tree\", \"cube\""},
        {"{objects: [flag]}", "none of them stands still; allowed with an object that does, or with others: hide"},
        {"{others: hide}", "scene.target.others: given, but there are no scene.target.objects"},
        {"{objects: tree}", "scene.target.objects: here stands a single value; allowed a list of 0 to 64"},
        {"{objects: [{a: b}]}", "scene.target.objects[0]: here stands a section with keys"},
        {"{objects: [\"\"]}", "scene.target.objects[0]"},
        {"{objects: [tree], others: keep}", "scene.target.others: \"keep\" is not known; allowed left_out, hide"},
        {"7", "scene.target: here stands a single value"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        struct site *site = NULL;
        assert_int_equal(load_moving(wrong[i].target, &site), SH_EINPUT);
        assert_null(site);
        assert_says(wrong[i].says);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_left_has_its_own_numbers), cmocka_unit_test(silent_surfaces_give_no_echo),
        cmocka_unit_test(targets_are_chosen_in_all_meshes), cmocka_unit_test(targets_count_in_all_copies),
        cmocka_unit_test(wrong_targets_are_refused),        cmocka_unit_test(names_fit_patterns),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
