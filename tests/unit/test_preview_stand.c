/* SPDX-License-Identifier: MIT */
/* The answers to /next and /reach: which cells count as seen, by which grid and rays places are compared, and the bytes
 * of the answers. The scene has 70 cells; the places, their gains and the search are the test's. */
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
#include "firmware_sim/app/studio/coverage/next.h"
#include "firmware_sim/app/studio/preview/inside.h"
#include "firmware_sim/config/profile.h"
#include "tests/unit/trace_rig.h"

enum { PLACES = 4 };

static const struct config_profile profile = {.range_min_m = 1.5, .range_max_m = 70};
static struct scene scene;
static struct preview_options options;
static struct preview_work work;
static struct preview_request request;
static struct preview_seen seen[2];
static uint64_t cells[2][2];
static struct coverage *const coverage = (struct coverage *)&scene;
static struct web_body body;
static struct sh_err err;
static uint32_t n_cells, n_rounds;
static double front[PLACES], grid_m;
static struct coverage_pulses sum;

const struct config_profile *site_profile(const struct site *site)
{
    assert_ptr_equal(site->scene, &scene);
    return &profile;
}

uint32_t coverage_cells(const struct coverage *of)
{
    return of == coverage ? n_cells : 0;
}

void coverage_forget(struct coverage *of)
{
    say(of == coverage ? "forget " : "FORGET ");
}

void coverage_keep_cells(struct coverage *of, const uint64_t *bits)
{
    say(of == coverage ? "keep:%llx,%llx " : "KEEP ", (unsigned long long)bits[0], (unsigned long long)bits[1]);
}

/* Cell i has its middle at (i, 0, 0). It has two pieces, whose middles are 8 m before and 8 m after that in x. */
void coverage_pieces(const struct coverage *of, coverage_piece *piece, void *ctx)
{
    assert_ptr_equal(of, coverage);
    for (uint32_t i = 0; i < n_cells; i++)
        for (int side = -1; side <= 1; side += 2) {
            const double x = i + 8.0 * side;
            const double quad[4][3] = {{x - 1, -1, 2}, {x + 1, -1, 2}, {x + 1, 1, -2}, {x - 1, 1, -2}};
            piece(ctx, i, 4, quad);
        }
}

int coverage_gains(const struct coverage *of, const struct coverage_directions *d, const struct coverage_places *places,
                   const struct sh_report *report, struct coverage_gain *gain, struct sh_err *e)
{
    assert_true(of == coverage && report == &work.stop && places->n == 1);
    assert_true(d->n == 3 && d->range_min_m == 1.5 && d->range_max_m == 70);
    const int place = (int)places->place_m[0][0];
    for (int i = 0; i < 2; i++)
        assert_int_equal(atomic_load(&places->cells[i]), 0);
    atomic_store(&places->cells[0], UINT64_C(1) << place);
    atomic_store(&places->cells[1], UINT64_C(16) << place);
    *gain = (struct coverage_gain){.gain_m2 = 1, .front = front[place]};
    return call(e, "gain");
}

int preview_site_open(const struct preview_work *of, const struct preview_request *r, struct preview_site **out,
                      struct sh_err *e)
{
    assert_true(of == &work && r == &request);
    *out = calloc(1, sizeof **out);
    assert_non_null(*out);
    (*out)->site.scene = &scene;
    (*out)->site.n_stations = 2;
    return call(e, "site");
}

int coverage_next_open(const struct coverage_next_options *o, const struct coverage_result *result,
                       const struct sh_report *report, struct coverage_next *next, struct coverage_finder *finder,
                       struct sh_err *e)
{
    assert_true(o->stations == 1 && o->height_m == 1.25 && o->step_deg == 3 && o->scans == 3 && o->candidates == NULL);
    for (int i = 0; i < 3; i++)
        assert_true(isnan(o->area_m[0][i]) && isnan(o->area_m[1][i]));
    assert_true(result->base == 1 && result->cell_m == 0.2 && result->site->scene == &scene && report == &work.stop);
    assert_int_equal(result->station[1].pulses.hits, 0);
    grid_m = o->grid_m;
    sum = result->station[0].pulses;
    *finder = (struct coverage_finder){.next = next, .n_dir = 3, .site = result->site};
    next->n = PLACES;
    next->within = 1;
    next->place = calloc(PLACES, sizeof *next->place);
    next->round = calloc(1, sizeof *next->round);
    assert_true(next->place != NULL && next->round != NULL);
    for (int i = 0; i < PLACES; i++)
        next->place[i] = (struct coverage_next_place){.position_m = {i, 10, 20}, .heading_deg = 30 + i};
    return call(e, "open");
}

int coverage_next_find(struct coverage_finder *finder, struct coverage *of, struct sh_err *e)
{
    assert_ptr_equal(of, coverage);
    finder->next->n_rounds = n_rounds;
    finder->next->round[0] = (struct coverage_next_round){
        .n_tried = 2, .tried = {{.place = 2, .gain_m2 = 7.5}, {.place = 3, .gain_m2 = 4}}, .none_m2 = 1.25};
    return call(e, "find");
}

void coverage_next_free(struct coverage_next *next, struct coverage_finder *finder)
{
    (void)finder;
    say("free ");
    free(next->place);
    free(next->round);
}

static int make(void **state)
{
    (void)state;
    scene = (struct scene){.min_m = {-10, 5, 0}, .max_m = {15, 15, 9}};
    options = (struct preview_options){.cell_m = 0.2};
    work = (struct preview_work){.options = &options, .coverage = coverage};
    request = (struct preview_request){.station = 1, .height_m = 1.25, .n_named = 2};
    for (int i = 0; i < 3; i++)
        request.section.half_m[i] = INFINITY;
    for (int i = 0; i < 2; i++) {
        cells[i][0] = i == 0 ? 0x5 : 0xa0;
        cells[i][1] = (uint64_t)i;
        seen[i] = (struct preview_seen){.cells = cells[i], .hits = 10 + (uint64_t)i, .front = 4 + 3 * (uint64_t)i};
    }
    for (int i = 0; i < PLACES; i++)
        front[i] = 1;
    trace[0] = '\0';
    fails = NULL;
    n_cells = 70;
    n_rounds = 1;
    body = (struct web_body){0};
    return 0;
}

static void ask_next(const char *json, const char *calls)
{
    assert_int_equal(preview_next(&work, &request, seen, &body, &err), SH_OK);
    assert_string_equal(body.bytes, json);
    assert_string_equal(trace, calls);
    free(body.bytes);
}

/* Cells that the named previews see count as seen. The grid has about 250 places: 1 m apart in 25 m by 10 m. */
static void the_next_place(void **state)
{
    static const char calls[] = "site forget keep:5,0 keep:a0,1 open find forget free ";
    (void)state;
    ask_next("{\"places\":3,\"place\":{\"x_m\":2,\"y_m\":10,\"z_m\":20,\"heading_deg\":32},\"gain_m2\":7.5,\"none_m2\":"
             "1.25}\n",
             calls);
    assert_true(grid_m == 1.0 && sum.hits == 21 && sum.front == 11);
    make(NULL);
    n_rounds = 0;
    scene.max_m[0] = -9; /* a small scene */
    ask_next("{\"places\":3,\"place\":null}\n", calls);
    assert_true(grid_m == 0.25);
    make(NULL);
    request.n_named = 0;
    ask_next("{\"places\":3,\"place\":{\"x_m\":2,\"y_m\":10,\"z_m\":20,\"heading_deg\":32},\"gain_m2\":7.5,\"none_m2\":"
             "1.25}\n",
             "site forget open find forget free ");
    assert_true(sum.hits == 0 && sum.front == 0);
}

/* Cells whose middles lie outside of a section count as seen. Its limits belong to it. */
static void sections(void **state)
{
    static const struct {
        struct preview_section section;
        const char *outside;
    } rows[] = {{{{3, 0, 0}, {1, 9, 9}, 0}, "keep:ffffffffffffffe3,3f "},  /* 2 to 4 are within */
                {{{3, 0, 0}, {9, 1, 9}, 90}, "keep:ffffffffffffffe3,3f "}, /* turned */
                {{{3, 0, 0}, {1, 9, 9}, 90}, "keep:ffffffffffffe000,3f "}, /* 9 m ahead and back: 0 to 12 */
                {{{3, 0, 0}, {INFINITY, 9, 9}, 0}, "keep:0,0 "},
                {{{66, 0, 0}, {2, INFINITY, INFINITY}, 0}, "keep:ffffffffffffffff,20 "}, /* 64 to 68: the last is 69 */
                {{{3, 5, 0}, {1, 4.9, 9}, 0}, "keep:ffffffffffffffff,3f "},
                {{{3, 5, 0}, {1, 5, 9}, 0}, "keep:ffffffffffffffe3,3f "},
                {{{3, 0, 5}, {1, 9, 4.9}, 0}, "keep:ffffffffffffffff,3f "},
                {{{3, 0, -5}, {1, 9, 5}, 0}, "keep:ffffffffffffffe3,3f "}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char expected[128];
        make(NULL);
        request.section = rows[i].section;
        request.n_named = 1;
        assert_int_equal(preview_next(&work, &request, seen, &body, &err), SH_OK);
        free(body.bytes);
        snprintf(expected, sizeof expected, "site forget keep:5,0 %sopen find forget free ", rows[i].outside);
        assert_string_equal(trace, expected);
    }
}

static void failures(void **state)
{
    static const struct {
        const char *step, *calls;
    } rows[] = {{"site", "site forget free "},
                {"open", "site forget keep:5,0 keep:a0,1 open forget free "},
                {"find", "site forget keep:5,0 keep:a0,1 open find forget free "}};
    (void)state;
    for (size_t i = 0; i < 3; i++) {
        make(NULL);
        fails = rows[i].step;
        assert_int_equal(preview_next(&work, &request, seen, &body, &err), SH_EIO);
        assert_string_equal(trace, rows[i].calls);
        if (i == 2) continue;
        trace[0] = '\0';
        assert_int_equal(preview_reach(&work, &request, seen, &body, &err), SH_EIO);
        assert_string_equal(trace, rows[i].calls);
        assert_null(body.bytes);
    }
    make(NULL);
    n_cells = 0;
    assert_int_equal(preview_next(&work, &request, seen, &body, &err), SH_ESTATE);
    assert_string_equal(err.text, "the scene has too many triangles for coverage, so no place can be suggested");
    make(NULL);
    fails = "gain";
    assert_int_equal(preview_reach(&work, &request, seen, &body, &err), SH_EIO);
    assert_string_equal(trace, "site forget keep:5,0 keep:a0,1 open gain forget free ");
    assert_null(body.bytes);
}

/* A cell that any place sees can be seen. If at least half of the previews' hits are fronts, places that see fewer than
 * half lie within bodies. */
static void what_can_be_seen(void **state)
{
    static const struct {
        uint64_t fronts; /* of 21 hits */
        uint32_t n;
        uint64_t bits;
    } rows[] = {{11, 2, 0x9}, {10, 4, 0xf}};
    (void)state;
    for (size_t i = 0; i < 2; i++) {
        make(NULL);
        seen[0].front = rows[i].fronts;
        seen[1].front = 0;
        front[0] = 0.5;
        front[1] = 0.49;
        front[2] = NAN; /* it sees nothing */
        assert_int_equal(preview_reach(&work, &request, seen, &body, &err), SH_OK);
        assert_string_equal(trace, "site forget keep:5,0 keep:a0,1 open gain gain gain gain forget free ");
        assert_string_equal(body.type, "application/octet-stream");
        assert_int_equal(body.len, 16 + 16);
        assert_memory_equal(body.bytes, "SHRE", 4);
        assert_true(le_get32(body.bytes + 4) == 1 && le_get32(body.bytes + 8) == 70);
        assert_int_equal(le_get32(body.bytes + 12), rows[i].n);
        assert_int_equal(le_get64(body.bytes + 16), rows[i].bits);
        assert_int_equal(le_get64(body.bytes + 24), 16 * rows[i].bits);
        free(body.bytes);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(the_next_place, make),
        cmocka_unit_test_setup(sections, make),
        cmocka_unit_test_setup(failures, make),
        cmocka_unit_test_setup(what_can_be_seen, make),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
