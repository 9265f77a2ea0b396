/* SPDX-License-Identifier: MIT */
/* The part that a tripod hides, by geometry alone: the cone on level and sloping ground, at heights up to where it
 * hovers, and legs as prisms. Nothing else of a scan changes. */
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/schedule.h"

enum { MAX_PULSES = 1 << 16, MAX_ECHOES = 15 };
static const double RAD = M_PI / 180;

struct shot {
    double d[3]; /* in the scene */
    int echoes;
    double range_m;
    uint16_t label;
};
static struct shot shot[MAX_PULSES];
static int n_shots;
static struct cast_counters counted;

/* ---- a scan from a station, in memory */

static struct site *load(const char *text)
{
    struct site *site = NULL;
    clear_warned();
    write_in("test.yaml", text);
    int rc = config_load(config_path, NULL, 0, cfg, &err);
    if (rc == SH_OK) rc = site_load(cfg, &report, &site, &err);
    if (rc == SH_OK) rc = site_open_sights(site, 0, site->n_stations, &report, &err);
    if (rc != SH_OK) fail_msg("%s", err.text);
    return site;
}

static void keep(const struct cast_setup *s, const struct schedule_segment *seg, const struct line_block *b)
{
    uint64_t k = b->pulse0;
    for (uint32_t i = 0; i < b->n_points; i++) {
        if ((b->echo[i] & 15) > 1) continue; /* a further one */
        const double pan = 2 * M_PI * schedule_pan_turn(seg, k), mirror = 2 * M_PI * schedule_mirror_turn(seg, k);
        const double socs[3] = {sin(pan) * cos(mirror), cos(pan) * cos(mirror), sin(mirror)};
        struct shot *to = &shot[n_shots++];
        assert_true(n_shots < MAX_PULSES);
        for (int a = 0; a < 3; a++)
            to->d[a] =
                s->rotation[3 * a] * socs[0] + s->rotation[3 * a + 1] * socs[1] + s->rotation[3 * a + 2] * socs[2];
        to->echoes = b->echo[i] >> 4;
        to->range_m = s->range_scale_m * b->a[i];
        to->label = b->label[i];
        k++;
    }
}

static void scan(const struct site *site, uint32_t station)
{
    struct cast_setup setup;
    struct schedule_spec spec;
    struct schedule_segment seg;
    struct schedule_line line;
    struct schedule_run run;
    struct line_block block;
    struct caster *caster;
    n_shots = 0;
    site_fill_spec(site, &site->cfg->head.settings, &spec);
    spec.frames = 1;
    schedule_start(&seg, &spec);
    site_cast_setup(site, station, &setup);
    site_move(site, 0, 0.0, &setup);
    assert_int_equal(caster_create(&caster, &err), SH_OK);
    assert_int_equal(line_block_alloc(&block, 65536, &err), SH_OK);
    for (uint64_t n = 0;; n++) {
        schedule_get_line(&seg, n, &line);
        if (line.pulse0 >= seg.end_pulse) break;
        if (line.cast0 == line.cast_end) continue;
        schedule_get_run(&seg, &line, line.cast0, (uint32_t)(line.cast_end - line.cast0), &run);
        caster_cast(caster, &setup, &run, &block);
        keep(&setup, &seg, &block);
    }
    caster_get_counters(caster, &counted);
    line_block_free(&block);
    caster_free(caster);
}

/* ---- holes */

static const char SLOPE[] = "o slope\nv -20 -20 -4\nv 20 -20 4\nv 20 20 4\nv -20 20 -4\nf 1 2 3 4\n"; /* z = x / 5 */
static const char LEVEL[] = "o level\nv -20 -20 0\nv 20 -20 0\nv 20 20 0\nv -20 20 0\nf 1 2 3 4\n";

/* Returns the range from (0, 0, h) to the ground z = slope x, 40 m wide. 0: beyond it. */
static double ground_range(const double d[3], double h, double slope)
{
    const double t = h / (slope * d[0] - d[2]);
    return t > 0 && fabs(t * d[0]) < 20 && fabs(t * d[1]) < 20 ? t : 0;
}

/* Each shot is hidden where its cosine with straight down is above the opening's, else at the ground's range. Shots
 * within 1e-12 of the border may be either, as arithmetic is in double. */
static void check_holes(double h, double slope, double cos_opening)
{
    int hidden = 0, seen = 0;
    for (int i = 0; i < n_shots; i++) {
        const double range_m = ground_range(shot[i].d, h, slope);
        const int is_hidden = -shot[i].d[2] > cos_opening;
        if (fabs(-shot[i].d[2] - cos_opening) < 1e-12) continue;
        assert_int_equal(shot[i].echoes, range_m > 0 && !is_hidden);
        hidden += is_hidden;
        seen += shot[i].echoes;
        if (shot[i].echoes == 0) continue;
        assert_true(fabs(shot[i].range_m - range_m) < 0.51e-6); /* half a count */
        const double out_m = hypot(shot[i].d[0], shot[i].d[1]) * range_m;
        if (slope == 0) assert_true(out_m > h * tan(acos(cos_opening)) - 1e-6); /* the round hole */
    }
    assert_true(seen > 200 && hidden > 200);
    assert_true(llabs((long long)counted.hidden - hidden) <= 1); /* the border */
}

static void holes_by_height(void **state)
{
    (void)state;
    static const struct {
        const char *ground;
        double slope, z, above_m;
        double cos_opening; /* by hand: (z - above) / 1.8, at most cos 20 deg = 0.9396926207859084 */
        const char *more, *says;
    } cases[] = {
        {LEVEL, 0, 0.36, 0, 0.2, "", ""},
        {LEVEL, 0, 0.9, 0, 0.5, ", heading_deg: 33, pitch_deg: 12, roll_deg: -21", ""},
        {LEVEL, 0, 0.9000001, 0, 0.5000000555555556, "", ""}, /* a ring at 60 deg from straight down is in, ... */
        {LEVEL, 0, 0.8999999, 0, 0.4999999444444444, "", ""}, /* ... or out */
        {LEVEL, 0, 1.6, 0.25, 0.75, "", ""},
        {LEVEL, 0, 1.68, 0, 0.9333333333333333, "", ""},
        {LEVEL, 0, 1.7, 0, 0.9396926207859084, "",
         "station 1 station-1: tripod: it hovers: its top is 1.7 m above the ground, and legs of 1.8 m reach down "
         "1.69145 m at their smallest opening, 20 deg: 0.00855328 m are missing\n"},
        {LEVEL, 0, 2.5, 0.1, 0.9396926207859084, ", roll_deg: 40", "0.708553 m are missing"},
        {SLOPE, 0.2, 1.26, 0, 0.7, ", pitch_deg: 20", ""},
    };
    char text[1024];
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        write_in("ground.obj", cases[i].ground);
        snprintf(
            text, sizeof text,
            "head: {profile: sphere, step_deg: 3}\nscene: {meshes: [{file: ground.obj, up: z, scale: 1}]}\n"
            "stations:\n  - {position_m: [0, 0, %.10g]%s, tripod: {leg_m: 1.8, opening_min_deg: 20, head_above_m: %g}}\n"
            "output: {scale_m: 1e-6}\n",
            cases[i].z, cases[i].more, cases[i].above_m);
        struct site *site = load(text);
        if (strstr(warned, cases[i].says) == NULL) fail_msg("%s", warned);
        if (cases[i].says[0] == '\0') assert_string_equal(warned, "");
        site_describe_tripod(&site->station[0], text, sizeof text);
        assert_int_equal(strstr(text, " above the ground, hovering; opening ") != NULL, cases[i].says[0] != '\0');
        scan(site, 0);
        check_holes(cases[i].z, cases[i].slope, cases[i].cos_opening);
        site_free(site);
    }
}

static void no_ground_is_said(void **state)
{
    (void)state;
    write_in("ground.obj", LEVEL);
    struct site *site = load("head: {profile: sphere, step_deg: 3}\n"
                             "scene: {meshes: [{file: ground.obj, up: z, scale: 1}]}\n"
                             "stations: [{position_m: [20.5, 0, 1], tripod: {leg_m: 1.8, opening_min_deg: 30}}]\n");
    assert_non_null(strstr(
        warned,
        "station 1 station-1: tripod: there is no ground below it, so its legs have their smallest opening, 30 deg\n"));
    assert_true(fabs(site->station[0].tripod.cast.cos_opening - sqrt(0.75)) < 1e-15);
    char text[256];
    site_describe_tripod(&site->station[0], text, sizeof text);
    assert_string_equal(text, "legs of 1.8 m, no ground below; opening 30 deg");
    site_free(site);
}

/* ---- legs */

/* A prism of six sides between a and b, as the head of tripod.c describes it. Returns where a ray from o enters it; 0:
 * not. *deep: the way within. */
static double prism_range(const double o[3], const double d[3], const double a[3], const double axis[3],
                          const double across[3], double length, double radius, double *deep)
{
    double outward[3] = {across[1] * axis[2] - across[2] * axis[1], across[2] * axis[0] - across[0] * axis[2],
                         across[0] * axis[1] - across[1] * axis[0]};
    double in = -INFINITY, out = INFINITY;
    for (int i = 0; i < 8; i++) { /* six sides, and the ends */
        const double turn = (30 + 60 * i) * RAD, c = cos(turn), s = sin(turn);
        double n[3], limit = radius * cos(30 * RAD), along = 0, at = 0;
        for (int k = 0; k < 3; k++) {
            n[k] = i < 6 ? c * across[k] + s * outward[k] : i == 6 ? axis[k] : -axis[k];
            along += n[k] * d[k];
            at += n[k] * (o[k] - a[k]);
        }
        if (i >= 6) limit = i == 6 ? length : 0;
        const double t = (limit - at) / along;
        if (along < 0) in = fmax(in, t);
        if (along > 0) out = fmin(out, t);
    }
    *deep = out - in;
    return in < out && in > 0 ? in : 0;
}

static void legs_hide_what_is_behind_them(void **state)
{
    (void)state;
    static const double leg_m = 1.7, h = 1.02, above = 0.31, heading = 17, diameter = 0.11;
    const double s = 0.8, c = 0.6, top[3] = {0, 0, h}, eye[3] = {0, 0, h + above}; /* 1.02 / 1.7 = 0.6 */
    int on_legs = 0, on_ground = 0, grazing = 0;
    write_in("ground.obj", LEVEL);
    struct site *site =
        load("head: {profile: sphere, step_deg: 0.9, ring_stop_deg: 20}\n"
             "scene: {meshes: [{file: ground.obj, up: z, scale: 1}]}\n"
             "stations: [{position_m: [0, 0, 1.33], pitch_deg: 30, tripod: {leg_m: 1.7, head_above_m: 0.31, legs: on,\n"
             "            legs_heading_deg: 17, leg_diameter_m: 0.11}}]\noutput: {scale_m: 1e-6}\n");
    scan(site, 0);
    for (int i = 0; i < n_shots; i++) {
        double range_m = ground_range(shot[i].d, h + above, 0), deep = INFINITY;
        int leg_first = 0;
        for (int leg = 0; leg < 3; leg++) {
            const double az = (heading + 120 * leg) * RAD, axis[3] = {s * sin(az), s * cos(az), -c};
            const double across[3] = {cos(az), -sin(az), 0};
            double begin[3], within;
            for (int k = 0; k < 3; k++)
                begin[k] = top[k] + 0.1 * leg_m * axis[k];
            const double t = prism_range(eye, shot[i].d, begin, axis, across, 0.9 * leg_m, 0.5 * diameter, &within);
            deep = fmin(deep, fabs(within));
            if (t > 0 && (range_m == 0 || t < range_m)) {
                range_m = t;
                leg_first = 1;
            }
        }
        if (deep < 1e-6) { /* within rounding of an edge */
            grazing++;
            continue;
        }
        assert_int_equal(shot[i].echoes, range_m > 0);
        if (range_m == 0) continue;
        assert_true(fabs(shot[i].range_m - range_m) < 0.51e-6);
        assert_int_equal(shot[i].label, leg_first ? site->legs_label : 0);
        *(leg_first ? &on_legs : &on_ground) += 1;
    }
    assert_true(on_legs > 300 && on_ground > 5000 && grazing < 5);
    assert_int_equal(counted.hidden, 0);
    assert_int_equal(site->station[0].tripod.legs->label0, site->legs_label);
    assert_string_equal(site_surface(site, site->legs_label)->object, "tripod");
    assert_string_equal(site_surface(site, site->legs_label)->material, "leg");
    site_free(site);
}

/* ---- with all other parts of a scan */

static const char GLASS[] = "surfaces:\n  - {material: glass, glass: 0.9, reflectance: 0.02, specular: 0.05}\n"
                            "  - {material: mirror, mirror: 0.9, reflectance: 0.02}\n";

static void write_room(void)
{
    static char text[4096];
    FILE *file = fopen("config/scenes/glass_room.obj", "rb");
    assert_non_null(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    write_in("room.obj", text);
}

/* The cone takes pulses away. All others stay bit by bit as without it. */
static void nothing_else_changes(void **state)
{
    (void)state;
    static const char *const more[] = {
        "beam: {mode: single}\ncast: {sight: off}\n",
        "beam: {mode: single}\ncast: {sight: on}\n",
        "beam: {mode: adaptive}\ncast: {sight: on}\n",
        "beam: {mode: rings, rings: 2, echoes: all}\n",
        "beam: {mode: single}\nsignal: {model: on}\nnoise: {range: signal, angle: on}\n",
        "beam: {mode: adaptive, echoes: all}\noptics: {depth: 2}\nsignal: {model: on}\n",
        "beam: {mode: rings, rings: 2, echoes: last}\noptics: {depth: 2}\n",
    };
    static struct shot without[MAX_PULSES];
    write_room();
    for (size_t i = 0; i < sizeof more / sizeof more[0]; i++) {
        int hidden = 0, seen = 0;
        for (int with = 0; with < 2; with++) {
            char text[2048];
            snprintf(text, sizeof text,
                     "head: {profile: riegl-vz400i, prr_hz: 300000, lines_hz: 240, pan_deg_s: 150, pan_stop_deg: 6}\n"
                     "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
                     "stations: [{position_m: [-1, 1.6, 1.6], pitch_deg: -70%s}]\n%s%s",
                     with ? ", tripod: {leg_m: 4}" : "", strstr(more[i], "optics") != NULL ? GLASS : "", more[i]);
            struct site *site = load(text);
            scan(site, 0);
            if (!with) memcpy(without, shot, sizeof shot);
            site_free(site);
        }
        for (int k = 0; k < n_shots; k++) {
            /* With angle noise a beam strays by up to 7 sigma of 0.0005 deg twice: 0.01 deg is 2e-4. */
            const double margin = strstr(more[i], "angle") != NULL ? 2e-4 : 1e-12;
            const int is_hidden = -shot[k].d[2] > 0.4;
            if (fabs(-shot[k].d[2] - 0.4) < margin) continue;
            hidden += is_hidden && without[k].echoes > 0;
            seen += !is_hidden && shot[k].echoes > 0;
            if (is_hidden)
                assert_int_equal(shot[k].echoes, 0);
            else if (memcmp(&shot[k], &without[k], sizeof shot[k]) != 0)
                fail_msg("%s: pulse %d is another with a tripod", more[i], k);
        }
        if (!(hidden > 200 && seen > 200)) fail_msg("%s: %d hidden, %d seen: too few", more[i], hidden, seen);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(holes_by_height),
        cmocka_unit_test(no_ground_is_said),
        cmocka_unit_test(legs_hide_what_is_behind_them),
        cmocka_unit_test(nothing_else_changes),
    };
    return cmocka_run_group_tests(tests, site_rig_setup, site_rig_teardown);
}
