/* SPDX-License-Identifier: MIT */
/* A site's beams and mirrors: names of ghosts, and profiles whose footprint can't be used. */
#include "tests/unit/cast_rig.h"

#include <unistd.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/site/site.h"

static char folder[] = "/tmp/scanhead-site-XXXXXX";

static int make_folder(void **state)
{
    (void)state;
    return mkdtemp(folder) != NULL ? 0 : -1;
}

static int remove_folder(void **state)
{
    (void)state;
    static const char *const names[] = {"room.obj", "room.mtl", "run.yaml", "head.yaml"};
    char path[128];
    for (int i = 0; i < 4; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        unlink(path);
    }
    return rmdir(folder);
}

static void write_text(const char *name, const char *text)
{
    char path[128];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs(text, f);
    assert_int_equal(fclose(f), 0);
}

static int load(const char *head, const char *more, struct config *cfg, struct sh_err *err)
{
    char text[1024], path[128];
    write_text("room.mtl", "newmtl silver\nnewmtl plaster\n");
    write_text("room.obj", "mtllib room.mtl\no glass\nusemtl silver\nv -5 5 -5\nv 5 5 -5\nv 5 5 5\nf 1 2 3\n"
                           "o back\nusemtl plaster\nv -5 -5 -5\nv 5 -5 -5\nv 5 -5 5\nf 4 5 6\n");
    snprintf(text, sizeof text,
             "head: {profile: %s}\nscene:\n  meshes:\n    - {file: room.obj, up: z, scale: 1}\n"
             "stations:\n  - {position_m: [0, 0, 0]}\n%s",
             head, more);
    write_text("run.yaml", text);
    snprintf(path, sizeof path, "%s/run.yaml", folder);
    return config_load(path, NULL, 0, cfg, err);
}

/* A ghost is named after the surface that is seen in the mirror, and keeps its material. */
static void ghosts_have_names(void **state)
{
    (void)state;
    static struct config cfg;
    struct site *site;
    struct sh_err err;
    if (load("riegl-vz400i", "surfaces: [{material: silver, mirror: 0.9}]\n", &cfg, &err) != SH_OK ||
        site_load(&cfg, NULL, &site, &err) != SH_OK)
        fail_msg("%s", err.text);
    assert_int_equal(site->n_surfaces, 4);
    for (uint32_t i = 0; i < 2; i++) {
        const struct scene_surface *of = site_surface(site, i), *ghost = site_surface(site, i + 2);
        char name[2 * SCENE_NAME_LEN];
        snprintf(name, sizeof name, "ghost of %s", of->object);
        assert_string_equal(of->object, i == 0 ? "glass" : "back");
        assert_string_equal(ghost->object, name);
        assert_string_equal(ghost->material, of->material);
    }
    site_free(site);
}

#ifndef SH_SANITIZE /* it draws 8 million pulses */
static int n_bounds;

static void count_bounds(void *ctx, const char *text)
{
    (void)ctx;
    n_bounds += strstr(text, "the plan drew 8388608 pulses") != NULL;
}

/* A hundred of 300,000 pulses a second are cast. The search for them ends, and reports that. */
static void the_search_for_pulses_is_bounded(void **state)
{
    (void)state;
    static struct config cfg;
    const struct sh_report report = {.warn = count_bounds};
    struct site *site;
    struct sh_err err;
    const char *head = "riegl-vz400i, prr_hz: 300000, lines_hz: 100, line_start_deg: 30, line_stop_deg: 30.000001";
    if (load(head, "beam: {mode: auto}\n", &cfg, &err) != SH_OK || site_load(&cfg, &report, &site, &err) != SH_OK)
        fail_msg("%s", err.text);
    assert_int_equal(n_bounds, 1);
    /* About 2,796 of the draws are cast, 3,061 with five standard errors. If none of them has a wrong number of echoes,
     * the limit at 95 % is 2.996 pulses. The plan's formula is right to a hundredth. */
    assert_true(site->plan.beam.echo_share > 0.99 * 2.996 / 3061);
    site_free(site);
}

#endif

/* Writes a profile like that of the VZ-400i, with another pulse width. */
static void write_head(const char *width)
{
    static char text[8192];
    static const char key[] = "pulse_width_ns: { value: ";
    FILE *f = fopen("config/heads/riegl-vz400i.yaml", "r");
    assert_non_null(f);
    text[fread(text, 1, sizeof text - 1, f)] = '\0';
    fclose(f);
    char *at = strstr(text, key), path[128];
    assert_non_null(at);
    snprintf(path, sizeof path, "%s/head.yaml", folder);
    f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f, "%.*s%s%s", (int)(at - text + (long)strlen(key)), text, width, strchr(at, ','));
    assert_int_equal(fclose(f), 0);
}

/* Without a range resolution each sub-ray would be an echo of its own, or too weak for one: a wall would vanish. */
static void footprints_need_a_pulse_width(void **state)
{
    (void)state;
    static struct config cfg;
    static const char *const modes[] = {"rings", "adaptive", "auto"}, *const widths[] = {"0", "1e-300", "0.09"};
    struct sh_err err;
    char more[64];
    for (int w = 0; w < 3; w++) {
        write_head(widths[w]);
        assert_int_equal(load("head.yaml", "beam: {mode: single}\n", &cfg, &err), SH_OK);
        for (int m = 0; m < 3; m++) {
            snprintf(more, sizeof more, "beam: {mode: %s}\n", modes[m]);
            assert_int_equal(load("head.yaml", more, &cfg, &err), SH_EINPUT);
            assert_non_null(strstr(err.text, "beam.mode: "));
            assert_non_null(strstr(err.text, "allowed single, or a pulse_width_ns of at least 0.1"));
        }
    }
    write_head("0.1");
    assert_int_equal(load("head.yaml", "beam: {mode: auto}\n", &cfg, &err), SH_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ghosts_have_names),
#ifndef SH_SANITIZE
        cmocka_unit_test(the_search_for_pulses_is_bounded),
#endif
        cmocka_unit_test(footprints_need_a_pulse_width),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
