/* SPDX-License-Identifier: MIT */
/* A preview: which settings its head gets, what is refused, where its station stands, and each byte of the answer. The
 * scan and the place are the test's. The station is the second one. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/bytes.h"
#include "firmware_sim/app/studio/coverage/coverage.h"
#include "firmware_sim/app/studio/preview/inside.h"
#include "firmware_sim/config/places.h"
#include "firmware_sim/site/placement.h"
#include "tests/unit/trace_rig.h"

static struct config *cfg;
static struct site site;
static struct preview_options options = {.site = &site};
static struct preview_work work;
static struct preview_request request;
static struct coverage *const coverage = (struct coverage *)&site;
static struct web_body body;
static struct sh_err err;

static struct head_settings applied; /* what the head gets */
static struct config_station placed; /* as the place was looked for */
static struct emitter emitter;       /* of the schedule; kind EMITTER_LINE: none */
static enum emitter_kind cast_kind;  /* of the emitter that is cast */
static uint64_t n_pulses;
static struct site_tripod tripod; /* as the place has it */
static int serves, n_freed;
static uint32_t n_cells;

struct site *sites_of(const struct sites *sites, uint32_t station)
{
    assert_true(sites == (const struct sites *)&work && station == 1);
    return fails != NULL && strcmp(fails, "sites") == 0 ? NULL : &site;
}

int config_serves(const struct config *of, uint32_t station)
{
    assert_true(of == cfg && station == 1);
    return serves;
}

int config_apply_settings(struct config *to, const struct head_settings *settings, struct sh_err *e)
{
    assert_true(to != cfg && e == &err);
    applied = *settings;
    return attempt(e, "settings");
}

void site_fill_spec(const struct site *of, const struct head_settings *settings, struct schedule_spec *spec)
{
    (void)settings;
    assert_ptr_equal(of, &site);
    *spec = (struct schedule_spec){.sweep_udeg = 360000000, .emitter = emitter.kind == EMITTER_LINE ? NULL : &emitter};
}

void coverage_scan_of(const struct site *of, uint32_t station, struct coverage_scan_at *at)
{
    assert_true(of != &site && of->bvh == site.bvh && station == 1);
    cast_kind = of->emitter.kind;
    memset(at, 0, sizeof *at);
    at->scan.segment.k0 = 1000;
    at->scan.segment.end_pulse = 1000 + n_pulses;
    at->scan.setup.sight = (const void *)&site;
    at->scan.setup.tripod = (const void *)&site;
}

int placement_find(const struct config *of, uint32_t i, const struct placement_anchor *anchor, const struct bvh *bvh,
                   struct placement *out, struct sh_err *e)
{
    assert_true(of != cfg && i == 1 && anchor->known == site.anchor.known && bvh == site.bvh && e == &err);
    placed = of->station[1];
    *out = (struct placement){.position_m = {100, 200, 300}, .rotation = {1, 2, 3, 4, 5, 6, 7, 8, 9}};
    return attempt(e, "place");
}

int site_tripod_at(const struct site *of, uint32_t station, const double position_m[3], struct site_tripod *out,
                   struct sh_err *e)
{
    assert_true(of != &site && station == 1 && position_m[2] == 300 && e == &err);
    *out = tripod;
    return attempt(e, "tripod");
}

void site_free_tripod(struct site_tripod *of)
{
    (void)of;
    n_freed++;
}

/* Three hits come in two parts. */
int coverage_look(struct coverage *of, const struct coverage_scan *scan, const char *what,
                  const struct sh_report *report, struct coverage_pulses *pulses, struct sh_err *e)
{
    static const struct cast_hit hits[] = {{.p_m = {101, 202, 303}, .range_m = 5, .triangle = 1},
                                           {.p_m = {99, 199.5, 300}, .range_m = 6, .triangle = 2, .body = 2},
                                           {.p_m = {100, 200, 299}, .range_m = 7, .body = CAST_MAX_MOVERS + 1}};
    const struct cast_setup *setup = &scan->setup;
    assert_true(of == coverage && strcmp(what, "preview") == 0 && report == &work.stop && e == &err);
    assert_true(setup->sight == NULL && setup->station_m[0] == 100 && setup->station_m[2] == 300);
    assert_true(setup->rotation[0] == 1 && setup->rotation[8] == 9);
    assert_int_equal(setup->tripod != NULL, tripod.from != NULL);
    if (setup->tripod != NULL) assert_true(setup->tripod->cos_opening == tripod.cast.cos_opening);
    scan->take(scan->take_ctx, hits, 2);
    scan->take(scan->take_ctx, hits + 2, 1);
    *pulses = (struct coverage_pulses){.cast = 11, .met = 12, .hits = 13, .front = 14};
    return attempt(e, "scan");
}

uint32_t coverage_cells(const struct coverage *of)
{
    return of == coverage ? n_cells : 0;
}

void coverage_waiting_cells(const struct coverage *of, uint64_t *cells)
{
    assert_ptr_equal(of, coverage);
    cells[0] = 0x1122334455667788;
    cells[1] = 0x99;
}

void coverage_drop(struct coverage *of)
{
    assert_ptr_equal(of, coverage);
    n_freed++;
}

static struct scene scene, other_scene;
static struct site_mover movers[2];

static int make(void **state)
{
    static uint16_t labels[] = {0, 31, 32}, other_labels[] = {0, 0, 52};
    (void)state;
    cfg = calloc(1, sizeof *cfg);
    if (cfg == NULL) return -1;
    memset(&site, 0, sizeof site);
    scene = (struct scene){.label = labels};
    other_scene = (struct scene){.label = other_labels};
    movers[1].scene = &other_scene;
    site.cfg = cfg;
    site.bvh = (struct bvh *)&scene;
    site.scene = &scene;
    site.mover = movers;
    site.legs_label = 77;
    site.anchor.known = 1;
    work = (struct preview_work){.options = &options, .coverage = coverage, .sites = (const struct sites *)&work};
    request = (struct preview_request){.station = 1,
                                       .place = {{1, 2, 3}, 40, 5, 6},
                                       .step_deg = 0.5,
                                       .far_m = INFINITY,
                                       .line_deg = {INFINITY, INFINITY},
                                       .pan_deg = {INFINITY, INFINITY},
                                       .points = 1};
    cfg->head.settings = (struct head_settings){.prr_uhz = 720000000000,
                                                .lines_uhz = 1,
                                                .pan_udeg_s = 1,
                                                .line_start_udeg = -40000000,
                                                .line_stop_udeg = 60000000,
                                                .pan_stop_udeg = 360000000,
                                                .frames = 9,
                                                .range_min_nm = 1500000000,
                                                .range_max_nm = 70000000000};
    cfg->profile.emitter.kind = EMITTER_LINE;
    cfg->profile.fov_min_udeg = -45000000;
    cfg->profile.fov_max_udeg = 65000000;
    cfg->profile.pan_min_udeg = -180000000;
    cfg->profile.pan_max_udeg = 360000000;
    cfg->station[1].has_instrument_height = 1;
    emitter = (struct emitter){.kind = EMITTER_LINE};
    n_pulses = PREVIEW_MOST_PULSES;
    tripod = (struct site_tripod){.from = NULL};
    fails = NULL;
    serves = 1;
    n_freed = 0;
    n_cells = 65;
    return 0;
}

static int end(void **state)
{
    (void)state;
    free(cfg);
    return 0;
}

static void look(void)
{
    assert_int_equal(preview_look(&work, &request, 8, &body, &err), SH_OK);
    assert_int_equal(n_freed, 2);
    n_freed = 0;
}

static void refuse(int rc, const char *text)
{
    assert_int_equal(preview_look(&work, &request, 8, &body, &err), rc);
    assert_string_equal(err.text, text);
    assert_int_equal(n_freed, 2);
    n_freed = 0;
}

static void each_byte(void **state)
{
    (void)state;
    look();
    const char *b = body.bytes;
    assert_int_equal(body.len, 72 + 16 + 3 * 18);
    assert_memory_equal(b, "SHPV", 4);
    static const uint32_t words[] = {1, 8, 65, 3, 11, 13, 14};
    for (int i = 0; i < 7; i++)
        assert_int_equal(le_get32(b + 4 + 4 * i), words[i]);
    for (int i = 0; i < 3; i++)
        assert_true(le_get_double(b + 32 + 8 * i) == 100 * (i + 1));
    assert_true(isnan(le_get_float(b + 56)) && le_get_float(b + 60) == 0 && le_get_float(b + 64) == 0);
    assert_int_equal(le_get32(b + 68), 0);
    assert_true(le_get64(b + 72) == 0x1122334455667788 && le_get64(b + 80) == 0x99);
    static const float xyz[] = {1, 2, 3, -1, -0.5f, 0, 0, 0, -1}, range[] = {5, 6, 7};
    static const uint16_t label[] = {31, 52, 77};
    for (int i = 0; i < 9; i++)
        assert_true(le_get_float(b + 88 + 4 * i) == xyz[i]);
    for (int i = 0; i < 3; i++) {
        assert_true(le_get_float(b + 88 + 36 + 4 * i) == range[i]);
        assert_int_equal(le_get16(b + 88 + 48 + 2 * i), label[i]);
    }
    free(body.bytes);
    request.points = 0;
    n_cells = 64;
    look();
    assert_true(body.len == 72 + 8 && le_get32((const char *)body.bytes + 16) == 0);
    free(body.bytes);
}

/* The height of the head, the radius that a cone hides on the ground, and how far the feet reach: 30 degrees, whose
 * tangent is 0.57735. */
static void a_tripod(void **state)
{
    static const struct config_tripod from = {.leg_m = 1.5};
    static const struct {
        double cos_opening, head_m;
        float height, radius;
    } rows[] = {{0.9, 1.6, 1.6f, 0.92376f}, {2, 1.6, 1.6f, 0}, {1, 1.6, 1.6f, 0}, {0.9, NAN, NAN, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        tripod = (struct site_tripod){.from = &from, .head_m = rows[i].head_m, .opening_rad = M_PI / 6};
        tripod.cast.cos_opening = rows[i].cos_opening;
        look();
        const float height = le_get_float(body.bytes + 56);
        assert_true(isnan(rows[i].height) ? isnan(height) : height == rows[i].height);
        assert_true(fabsf(le_get_float(body.bytes + 60) - rows[i].radius) < 1e-5f);
        assert_true(fabsf(le_get_float(body.bytes + 64) - 0.75f) < 1e-6f);
        free(body.bytes);
    }
}

/* The station stands as if its keys said so. A place on the Earth would go before them. */
static void the_place(void **state)
{
    (void)state;
    for (int known = 0; known < 2; known++) {
        site.anchor.known = known;
        cfg->station[1].place = PLACE_GEODETIC;
        look();
        free(body.bytes);
        assert_int_equal(placed.place, known ? PLACE_NONE : PLACE_GEODETIC);
        assert_true(placed.has_position == 1 && placed.has_instrument_height == 0);
        assert_true(placed.position_m[0] == 1 && placed.position_m[1] == 2 && placed.position_m[2] == 3);
        assert_true(placed.heading_deg == 40 && placed.pitch_deg == 5 && placed.roll_deg == 6);
        assert_int_equal(cfg->station[1].has_instrument_height, 1); /* the original stays */
    }
}

static void settings(void **state)
{
    (void)state;
    look(); /* 720 kHz in steps of 0.5 degrees: 1000 lines a second, and the pan takes such a step for each */
    free(body.bytes);
    assert_true(applied.frames == 1 && applied.prr_uhz == 720000000000);
    assert_true(applied.lines_uhz == 1000000000 && applied.pan_udeg_s == 500000000);
    assert_true(applied.range_max_nm == 70000000000 && applied.line_start_udeg == -40000000);
    request.far_m = 1.6;
    request.line_deg[0] = -45;
    request.line_deg[1] = 65;
    request.pan_deg[0] = -180;
    request.pan_deg[1] = 180;
    cfg->head.settings.pan_udeg_s = 0;
    look();
    free(body.bytes);
    assert_true(applied.range_max_nm == 1600000000 && applied.pan_udeg_s == 0);
    assert_true(applied.line_start_udeg == -45000000 && applied.line_stop_udeg == 65000000);
    assert_true(applied.pan_start_udeg == -180000000 && applied.pan_stop_udeg == 180000000);
    end(NULL);
    make(NULL);
    emitter.kind = EMITTER_SPHERE; /* 720 steps a ring */
    cfg->profile.emitter.kind = EMITTER_SPHERE;
    cfg->head.settings.lines_uhz = 3;
    look();
    free(body.bytes);
    assert_true(applied.step_udeg == 500000 && applied.prr_uhz == 720 * 3 && applied.lines_uhz == 3);
    assert_int_equal(cast_kind, EMITTER_SPHERE); /* the settings have changed its steps */
    end(NULL);
    make(NULL);
    emitter.kind = EMITTER_BEAMS; /* it has a pattern of its own */
    cfg->profile.emitter.kind = EMITTER_BEAMS;
    site.emitter.kind = EMITTER_DIRECTIONS;
    look();
    free(body.bytes);
    assert_true(applied.step_udeg == 0 && applied.prr_uhz == 720000000000 && applied.lines_uhz == 1);
    assert_int_equal(cast_kind, EMITTER_DIRECTIONS);
    site.emitter.kind = EMITTER_LINE;
}

static void windows_that_do_not_go(void **state)
{
    static const struct {
        double line[2], pan[2];
        const char *text; /* NULL: they go */
    } rows[] = {
        {{-45.5, INFINITY},
         {INFINITY, INFINITY},
         "lines from -45.5 to 60 deg: allowed is a part of -45 to 65 deg, the lower one first"},
        {{INFINITY, 65.5},
         {INFINITY, INFINITY},
         "lines from -40 to 65.5 deg: allowed is a part of -45 to 65 deg, the lower one first"},
        {{10, 10},
         {INFINITY, INFINITY},
         "lines from 10 to 10 deg: allowed is a part of -45 to 65 deg, the lower one first"},
        {{10, 10.1}, {INFINITY, INFINITY}, NULL},
        {{INFINITY, INFINITY},
         {-181, 0},
         "pan from -181 to 0 deg: allowed is a part of -180 to 360 deg, at most a turn, the lower one first"},
        {{INFINITY, INFINITY},
         {0, 361},
         "pan from 0 to 361 deg: allowed is a part of -180 to 360 deg, at most a turn, the lower one first"},
        {{INFINITY, INFINITY},
         {-180, 180.5},
         "pan from -180 to 180.5 deg: allowed is a part of -180 to 360 deg, at most a turn, the lower one first"},
        {{INFINITY, INFINITY},
         {10, 9},
         "pan from 10 to 9 deg: allowed is a part of -180 to 360 deg, at most a turn, the lower one first"},
        {{INFINITY, INFINITY}, {10, 10}, NULL},
        {{INFINITY, INFINITY}, {0, 360}, NULL}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        memcpy(request.line_deg, rows[i].line, sizeof request.line_deg);
        memcpy(request.pan_deg, rows[i].pan, sizeof request.pan_deg);
        cfg->profile.emitter.kind = EMITTER_LINE;
        if (rows[i].text != NULL) {
            refuse(SH_EINPUT, rows[i].text);
        } else {
            look();
            free(body.bytes);
        }
        cfg->profile.emitter.kind = EMITTER_PLANAR;
        refuse(SH_EINPUT, "line0_deg, line1_deg, pan0_deg, pan1_deg: allowed for heads that scan lines");
    }
}

static void refusals(void **state)
{
    static const char *const steps[] = {"settings", "place", "tripod", "scan"};
    (void)state;
    request.far_m = 1.5;
    refuse(SH_EINPUT, "far_m=1.5: allowed is more than 1.5");
    request.far_m = INFINITY;
    n_pulses++;
    refuse(SH_EINPUT, "step_deg=0.5: a scan of 1500001 pulses; allowed are 1500000, so take a larger step");
    n_pulses--;
    for (int i = 0; i < 4; i++) {
        char text[32];
        fails = steps[i];
        snprintf(text, sizeof text, "%s failed", steps[i]);
        refuse(SH_EIO, text);
    }
    static const char other[] = "station 2 has a scanner that can't be previewed";
    fails = "sites";
    refuse(SH_EINPUT, other);
    fails = NULL;
    serves = 0;
    refuse(SH_EINPUT, other);
    serves = 1;
    struct site another = site;
    another.bvh = NULL;
    options.site = &another;
    refuse(SH_EINPUT, other);
    options.site = &site;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(each_byte, make, end),
        cmocka_unit_test_setup_teardown(a_tripod, make, end),
        cmocka_unit_test_setup_teardown(the_place, make, end),
        cmocka_unit_test_setup_teardown(settings, make, end),
        cmocka_unit_test_setup_teardown(windows_that_do_not_go, make, end),
        cmocka_unit_test_setup_teardown(refusals, make, end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
