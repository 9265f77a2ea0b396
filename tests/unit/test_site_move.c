/* SPDX-License-Identifier: MIT */
/* Bodies that move: a wall that goes away, and a door that turns. Ranges are worked out by hand at any time. */
#include "tests/unit/cast_rig.h"

#include <unistd.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/site/site.h"

static char folder[] = "/tmp/scanhead-move-XXXXXX";

static void write_text(const char *name, const char *text)
{
    char path[128];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs(text, f);
    assert_int_equal(fclose(f), 0);
}

static int make_folder(void **state)
{
    (void)state;
    return mkdtemp(folder) != NULL ? 0 : -1;
}

static int remove_folder(void **state)
{
    (void)state;
    static const char *const names[] = {"room.obj", "body.obj", "run.yaml"};
    char path[128];
    for (int i = 0; i < 3; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        unlink(path);
    }
    return rmdir(folder);
}

/* A back wall is at y = 50, and before it a body with these keys. */
static struct site *load(const char *body_obj, const char *motion, struct config *cfg)
{
    char text[1024], path[128];
    struct site *site;
    struct sh_err err;
    write_text("room.obj", "o back\nv -500 50 -500\nv 500 50 -500\nv 500 50 500\nv -500 50 500\nf 1 2 3 4\n");
    write_text("body.obj", body_obj);
    snprintf(text, sizeof text,
             "head: {profile: full-sweep}\nscene:\n  meshes:\n    - {file: room.obj, up: z, scale: 1}\n"
             "    - {file: body.obj, up: z, scale: 1%s}\nstations:\n  - {position_m: [0, 0, 0]}\n",
             motion);
    write_text("run.yaml", text);
    snprintf(path, sizeof path, "%s/run.yaml", folder);
    if (config_load(path, NULL, 0, cfg, &err) != SH_OK || site_load(cfg, NULL, &site, &err) != SH_OK)
        fail_msg("%s", err.text);
    return site;
}

/* Ranges at time t_s of the scan towards azimuths of -60 to 60 degrees, level. */
enum { RAYS = 2000 };
struct look {
    long double azimuth[RAYS];
    uint32_t count[RAYS];
    uint16_t label[RAYS];
    uint32_t movers;
};

/* The line's plane is level when the head lies on its side: socs z (90 degrees of the mirror) is east. */
static void look(const struct site *site, double t_s, struct look *out)
{
    struct cast_setup setup;
    struct caster *caster;
    struct line_block block;
    struct sh_err err;
    struct schedule_segment segment;
    struct schedule_line line;
    struct schedule_run run;
    struct schedule_spec spec = {.prr_uhz = RAYS * HZ,
                                 .lines_uhz = HZ,
                                 .fov_min_udeg = -60 * DEG,
                                 .sweep_udeg = 120 * DEG,
                                 .line_start_udeg = -60 * DEG,
                                 .line_stop_udeg = 60 * DEG};
    assert_int_equal(caster_create(&caster, &err), SH_OK);
    assert_int_equal(line_block_alloc(&block, RAYS, &err), SH_OK);
    site_cast_setup(site, 0, &setup);
    static const double side[9] = {0, 0, 1, 0, 1, 0, -1, 0, 0};
    memcpy(setup.rotation, side, sizeof side);
    site_move(site, 0, t_s, &setup);
    schedule_start(&segment, &spec);
    schedule_get_line(&segment, 0, &line);
    schedule_get_run(&segment, &line, 0, RAYS, &run);
    caster_cast(caster, &setup, &run, &block);
    out->movers = setup.n_movers;
    for (uint32_t i = 0; i < RAYS; i++) {
        long double mirror, pan;
        true_angles(&spec, i, &mirror, &pan);
        out->azimuth[i] = mirror * 6.283185307179586476925286766559L;
        out->count[i] = block.a[i];
        out->label[i] = block.label[i];
    }
    line_block_free(&block);
    caster_free(caster);
}

/* A count is a micrometre: half of one is rounding, and 1e-9 m is arithmetic. */
static void assert_range(const struct look *l, int i, long double want_m, int label)
{
    assert_int_equal(l->label[i], label);
    if (!(fabsl(l->count[i] * 1e-6L - want_m) < 0.5e-6L + 1e-9L))
        fail_msg("ray %d: %.9Lf m instead of %.9Lf m", i, l->count[i] * 1e-6L, want_m);
}

static const char WALL[] = "o wall\nv -100 5 -1\nv 100 5 -1\nv 100 5 1\nv -100 5 1\nf 1 2 3 4\n";

static void test_wall_that_goes_away(void **state)
{
    (void)state;
    struct config *cfg = calloc(1, sizeof *cfg);
    struct look *l = malloc(sizeof *l);
    struct site *site = load(WALL, ", move_m_s: [0, 1, 0]", cfg);
    assert_int_equal(site->n_movers, 1);
    static const double times[] = {0.0, 0.001, 1.0, 7.25, 44.999, 100.0};
    for (int n = 0; n < 6; n++) {
        look(site, times[n], l);
        double wall_m = 5.0 + times[n], nearest_m = fmin(wall_m, 50.0);
        for (int i = 0; i < RAYS; i++)
            assert_range(l, i, nearest_m / cosl(l->azimuth[i]), wall_m < 50.0);
    }
    site_free(site);
    /* The wall goes back and forth within 4 s. At 3 s it is where it is at 1 s. At 10.5 s it is where it is at 2.5 s,
     * 1.5 s on the way back. */
    site = load(WALL, ", move_m_s: [0, 1, 0], cycle_s: 4", cfg);
    static const double cycle[][2] = {{0, 0}, {1, 1}, {2, 2}, {3, 1}, {4, 0}, {10.5, 1.5}};
    for (int n = 0; n < 6; n++) {
        look(site, cycle[n][0], l);
        for (int i = 0; i < RAYS; i++)
            assert_range(l, i, (5.0L + cycle[n][1]) / cosl(l->azimuth[i]), 1);
    }
    site_free(site);
    free(l);
    free(cfg);
}

/* A door of 2 m is on a hinge at (0, 6), at rest along x. Clockwise from above it swings towards the head: after an
 * angle a it points to (cos a, -sin a). A ray to azimuth b meets it at r with r (sin b, cos b) = (0, 6) + s (cos a,
 * -sin a). */
static void test_door(void **state)
{
    (void)state;
    struct config *cfg = calloc(1, sizeof *cfg);
    struct look *l = malloc(sizeof *l);
    struct site *site =
        load("o door\nv 0 6 -1\nv 2 6 -1\nv 2 6 1\nv 0 6 1\nf 1 2 3 4\n", ", turn_deg_s: 30, pivot_m: [0, 6, 0]", cfg);
    static const double times[] = {0.0, 0.5, 1.0, 2.0, 2.9, 10.0, 12.5};
    uint32_t hits = 0;
    for (int n = 0; n < 7; n++) {
        look(site, times[n], l);
        long double a = times[n] * 30.0L * 3.14159265358979323846264338L / 180.0L;
        for (int i = 0; i < RAYS; i++) {
            long double sb = sinl(l->azimuth[i]), cb = cosl(l->azimuth[i]);
            long double det = sb * sinl(a) + cb * cosl(a); /* of r (sin b, cos b) - s (cos a, -sin a) */
            long double r = 6.0L * cosl(a) / det, s = 6.0L * sb / det;
            int on = fabsl(det) > 1e-6L && r > 0.5L && s > 0.0L && s < 2.0L;
            if (fabsl(s) < 1e-6L || fabsl(s - 2.0L) < 1e-6L || fabsl(det) < 1e-4L) continue; /* its edges; edge-on */
            hits += (uint32_t)on;
            assert_range(l, i, on ? r : 50.0L / cb, on);
        }
    }
    assert_true(hits > 1000);
    site_free(site);
    free(l);
    free(cfg);
}

/* With all motions zero the body belongs to the fixed scene: there is no mover, and the numbers are those of one
 * scene. */
static void test_nothing_moves(void **state)
{
    (void)state;
    struct config *cfg = calloc(1, sizeof *cfg);
    struct look *still = malloc(sizeof *still), *zero = malloc(sizeof *zero);
    struct site *site = load(WALL, "", cfg);
    look(site, 3.0, still);
    site_free(site);
    site = load(WALL, ", move_m_s: [0, 0, 0], turn_deg_s: 0, cycle_s: 5", cfg);
    look(site, 3.0, zero);
    assert_int_equal(site->n_movers, 0);
    assert_int_equal(zero->movers, 0);
    assert_memory_equal(still->count, zero->count, sizeof zero->count);
    assert_memory_equal(still->label, zero->label, sizeof zero->label);
    site_free(site);
    free(still);
    free(zero);
    free(cfg);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_wall_that_goes_away),
        cmocka_unit_test(test_door),
        cmocka_unit_test(test_nothing_moves),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
