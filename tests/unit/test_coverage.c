/* SPDX-License-Identifier: MIT */
/* Coverage: areas are kept, all of a box is seen, and the visible part of an L-shaped room follows from geometry.
 * Threads change nothing. */
#include "tests/unit/coverage_rig.h"

static const double LO[3] = {-1.9, -1.4, -1.1}, HI[3] = {2.2, 1.7, 1.3}, WITHIN[3] = {0.1, 0.2, 0.05};
static const double BOX_M2 = 2.0 * (4.1 * 3.1 + 4.1 * 2.4 + 3.1 * 2.4);

/* The directions are a square grid; on a plane its squares are stretched by up to range / cosine, that is range^2 /
 * distance from the plane. A circle without points has a radius of at most half of such a diagonal. 1 % is added: the
 * step isn't infinitely small, and the pan turns by a step during a line. */
static int is_resolved(const struct cover_cell *cell)
{
    return cell->least_m > 1.01 * M_SQRT1_2 * cell->spacing_m;
}

static struct cover_cell *cells_of(const struct cover *c, const double station_m[3], double step_deg,
                                   int (*sees)(const double p_m[3]))
{
    struct cover_cell *cell = calloc(coverage_cells(c->coverage), sizeof *cell);
    assert_non_null(cell);
    cover_cells(c, station_m, step_deg, sees, cell);
    return cell;
}

static void sums_of(const struct cover *c, struct coverage_sums *sums)
{
    struct sh_err err;
    if (coverage_sum(c->coverage, sums, &err) != 0) fail_msg("%s", err.text);
}

static void assert_near(const char *what, double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("%s: %.17g, and it should be %.17g", what, got, want);
}

/* Each triangle's area is shared out among cells by some thousand additions. */
static void test_area_is_kept(void **state)
{
    (void)state;
    static const double cells_m[] = {0.07, 0.25, 1.0, 50.0};
    for (size_t i = 0; i < sizeof cells_m / sizeof cells_m[0]; i++) {
        struct cover *c = cover_open(cover_box(LO, HI), cells_m[i], 1);
        struct coverage_sums sums;
        double low[3], high[3];
        memset(&sums, 0, sizeof sums);
        sums_of(c, &sums);
        const struct coverage_spread *const unknown[] = {&sums.density_1_m2, &sums.incidence_rad, &sums.range_m};
        for (int k = 0; k < 3; k++) /* of cells that no station sees there are no figures */
            assert_true(isnan(unknown[k]->mean) && isnan(unknown[k]->p05) && isnan(unknown[k]->p50) &&
                        isnan(unknown[k]->p95));
        assert_near("area", sums.area_m2, BOX_M2, 1e-11);
        assert_near("seen by none", sums.none_m2, BOX_M2, 1e-11);
        struct cover_cell *cell = cells_of(c, WITHIN, 1.0, NULL);
        for (uint32_t k = 0; k < sums.cells; k++) {
            struct coverage_cell got;
            coverage_get(c->coverage, k, &got);
            assert_near("a cell's area", got.area_m2, cell[k].area_m2, 1e-12);
            memcpy(low, cell[k].low_m, sizeof low);
            memcpy(high, cell[k].high_m, sizeof high);
            for (int a = 0; a < 3; a++)
                assert_true(high[a] - low[a] <= 2.5 * cells_m[i] + 1e-9);
        }
        /* The largest cells are one for each wall. */
        if (cells_m[i] > 10.0) assert_int_equal(sums.cells, 6);
        free(cell);
        cover_close(c);
    }
}

static void count_progress(void *ctx, const char *what, double fraction)
{
    assert_string_equal(what, "scan");
    assert_near("progress", fraction, ++*(int *)ctx / 5.0, 1e-12);
}

/* The last 420 of 720 lines are a segment of their own: their 151,200 pulses alone are cast in five parts of 32,768. */
static void test_later_segment(void **state)
{
    (void)state;
    struct cover *c = cover_open(cover_box(LO, HI), 1.0, 1);
    struct coverage_scan scan;
    struct coverage_pulses pulses;
    struct sh_err err;
    int n = 0;
    const struct sh_report report = {.ctx = &n, .progress = count_progress};
    cover_scan(c, WITHIN, &cover_everywhere, &scan);
    const struct schedule_segment whole = scan.segment;
    schedule_change(&scan.segment, &whole, &whole.spec, 360 * 300);
    assert_int_equal(coverage_look(c->coverage, &scan, "scan", &report, &pulses, &err), SH_OK);
    assert_int_equal(pulses.cast, 360 * 420);
    assert_int_equal(n, 5);
    cover_close(c);
}

/* All of a box is seen from inside if each cell holds a circle larger than any gap between the points. Much smaller
 * cells are not all seen. */
static void test_box(void **state)
{
    (void)state;
    struct cover *c = cover_open(cover_box(LO, HI), 1.0, 2);
    struct coverage_pulses pulses;
    struct coverage_sums sums;
    double worst = INFINITY;
    struct cover_cell *cell = cells_of(c, WITHIN, 0.5, NULL);
    for (uint32_t i = 0; i < coverage_cells(c->coverage); i++) {
        assert_true(is_resolved(&cell[i]));
        worst = fmin(worst, cell[i].least_m / cell[i].spacing_m);
    }
    cover_look(c, WITHIN, &cover_everywhere, &pulses);
    sums_of(c, &sums);
    assert_true(sums.none_m2 == 0.0);
    assert_true(sums.several_m2 == 0.0);
    assert_near("seen by one", sums.one_m2, BOX_M2, 1e-11);
    assert_true(pulses.met == pulses.cast && pulses.hits == pulses.cast && pulses.front == pulses.hits);
    /* 360 pulses a line, both ends of which are within the window, and 720 lines */
    assert_true(pulses.cast == 360 * 720);
    assert_near("density", sums.density_1_m2.mean, (double)pulses.cast / BOX_M2, 1e-6);
    print_message("a cell of 1 m holds a circle of at least %.2g of the distance of points\n", worst);
    free(cell);
    cover_close(c);
    c = cover_open(cover_box(LO, HI), 0.025, 2);
    cover_look(c, WITHIN, &cover_everywhere, &pulses);
    sums_of(c, &sums);
    assert_true(sums.none_m2 > 0.01 * BOX_M2);
    cover_close(c);
}

/* Beyond the range nothing is seen, and within it all is. */
static void test_range_limit(void **state)
{
    (void)state;
    struct cover *c = cover_open(cover_box(LO, HI), 0.5, 1);
    struct cover_sweep sweep = cover_everywhere;
    struct coverage_pulses pulses;
    uint32_t within = 0, beyond = 0;
    sweep.range_max_m = 1.8;
    cover_look(c, WITHIN, &sweep, &pulses);
    struct cover_cell *cell = cells_of(c, WITHIN, sweep.step_deg, NULL);
    for (uint32_t i = 0; i < coverage_cells(c->coverage); i++) {
        struct coverage_cell got;
        double nearest2 = 0.0; /* of the cell's bounds */
        coverage_get(c->coverage, i, &got);
        for (int a = 0; a < 3; a++) {
            const double to = fmax(fmax(cell[i].low_m[a] - WITHIN[a], WITHIN[a] - cell[i].high_m[a]), 0.0);
            nearest2 += to * to;
        }
        if (cell[i].farthest_m < sweep.range_max_m) {
            within++;
            assert_true(is_resolved(&cell[i]));
            assert_int_equal(got.stations, 1);
            assert_true(got.range_m <= cell[i].farthest_m && got.range_m >= sqrt(nearest2) - 1e-6);
        }
        if (sqrt(nearest2) > sweep.range_max_m) {
            beyond++;
            assert_int_equal(got.stations, 0);
        }
    }
    assert_true(within > 10 && beyond > 10);
    free(cell);
    cover_close(c);
}

/* ---- the L. From its right leg everything beyond the line through the inner corner (2, 2) is hidden. A point on that
 * line, or on the walls that end there, belongs to both. */
static const double RIGHT[3] = {5.0, 1.0, 1.2}, UPPER[3] = {1.0, 4.0, 1.2};
static const double SLACK = 1e-9;

static int right_sees(const double p[3])
{
    return !(p[1] > 2.0 + SLACK && p[1] > 1.0 + (5.0 - p[0]) / 3.0 + SLACK);
}

static int upper_sees(const double p[3])
{
    return !(p[0] > 2.0 + SLACK && p[0] > 1.0 + (4.0 - p[1]) / 2.0 + SLACK);
}

/* A triangle of 2 m by 2/3 m of the upper leg, 2 m by 3 m, is seen on floor and ceiling. The wall at x = 0 is seen
 * below y = 8/3, and nothing of the walls at x = 2 and y = 5. */
#define RIGHT_HIDDEN_M2 (2.0 * (6.0 - 2.0 / 3.0) + L_HEIGHT_M * (7.0 / 3.0 + 3.0 + 2.0))
/* A triangle of 1 m by 2 m of the right leg beyond x = 2, 4 m by 2 m, is seen. The wall at y = 0 is seen up to x = 3,
 * and nothing of those at x = 6 and y = 2. */
#define UPPER_HIDDEN_M2 (2.0 * (8.0 - 1.0) + L_HEIGHT_M * (3.0 + 2.0 + 4.0))
#define L_M2            (2.0 * 18.0 + L_HEIGHT_M * 22.0)

/* The head scans a whole turn coarsely, and the far part finely. */
static const struct cover_sweep RIGHT_FAR = {0.15, -40.0, 40.0, 235.0, 325.0, 1000.0};
static const struct cover_sweep UPPER_FAR = {0.15, -40.0, 40.0, 90.0, 200.0, 1000.0};

struct view {
    double seen_m2, cut_m2; /* cut: of cells that lie on both sides of the shadow's line */
    double coarse_m2;       /* of visible cells that may lie between the points */
};

/* Each cell is seen as geometry says: one that is all visible is seen, and one that is all hidden is not. */
static struct view check_cells(const struct cover *c, const double station_m[3], int (*sees)(const double p_m[3]))
{
    struct cover_cell *coarse = cells_of(c, station_m, 0.5, sees), *fine = cells_of(c, station_m, 0.15, sees);
    struct view view = {0.0, 0.0, 0.0};
    for (uint32_t i = 0; i < coverage_cells(c->coverage); i++) {
        const struct cover_cell *cell = &coarse[i];
        struct coverage_cell got;
        coverage_get(c->coverage, i, &got);
        if (got.stations > 0) view.seen_m2 += got.area_m2;
        if (cell->seen == 0 && got.stations > 0)
            fail_msg("cell %u at %.2f %.2f %.2f is hidden, and %u pulses meet it", i, cell->low_m[0], cell->low_m[1],
                     cell->low_m[2], got.pulses);
        if (cell->seen == cell->corners && !is_resolved(cell) && !is_resolved(&fine[i]))
            view.coarse_m2 += got.area_m2;
        else if (cell->seen == cell->corners && got.stations == 0)
            fail_msg("cell %u at %.2f %.2f %.2f is visible, and not seen", i, cell->low_m[0], cell->low_m[1],
                     cell->low_m[2]);
        else if (cell->seen > 0 && cell->seen < cell->corners)
            view.cut_m2 += got.area_m2;
    }
    free(coarse);
    free(fine);
    return view;
}

static void check_l(const double station_m[3], const struct cover_sweep *far, int (*sees)(const double p_m[3]),
                    double hidden_m2, double line_m)
{
    const double cell_m = 0.6;
    struct cover *c = cover_open(cover_l_room(), cell_m, 2);
    struct coverage_pulses pulses;
    struct coverage_sums sums;
    cover_look(c, station_m, &cover_everywhere, &pulses);
    cover_look(c, station_m, far, &pulses);
    const struct view view = check_cells(c, station_m, sees);
    sums_of(c, &sums);
    assert_near("area", sums.area_m2, L_M2, 1e-11);
    /* A cell that the line cuts is seen or not. Such cells lie within a cell's width, 2.5 cell_m across, of the
     * line. */
    print_message("%.3f m2 seen, %.3f m2 visible, %.3f m2 in cells that the shadow's line cuts, %.3f m2 perhaps "
                  "between the points\n",
                  view.seen_m2, L_M2 - hidden_m2, view.cut_m2, view.coarse_m2);
    assert_true(view.cut_m2 <= line_m * 2.0 * 2.5 * cell_m);
    assert_true(view.coarse_m2 < 0.02 * L_M2);
    assert_near("seen", view.seen_m2, L_M2 - hidden_m2, view.cut_m2 + view.coarse_m2);
    assert_near("by none", sums.none_m2, L_M2 - view.seen_m2, 1e-11);
    cover_close(c);
}

static void test_l_from_the_right(void **state)
{
    (void)state;
    check_l(RIGHT, &RIGHT_FAR, right_sees, RIGHT_HIDDEN_M2, 2.0 * hypot(2.0, 2.0 / 3.0) + L_HEIGHT_M);
}

static void test_l_from_above(void **state)
{
    (void)state;
    check_l(UPPER, &UPPER_FAR, upper_sees, UPPER_HIDDEN_M2, 2.0 * hypot(1.0, 2.0) + L_HEIGHT_M);
}

/* The part that one station hides is seen by the other. Scans at one place count as stations, so each place has one
 * here. */
static void test_two_stations(void **state)
{
    (void)state;
    struct cover *c = cover_open(cover_l_room(), 0.6, 2);
    const struct cover_sweep sweep = {0.4, -90.0, 90.0, 0.0, 360.0, 1000.0};
    struct coverage_pulses pulses;
    struct coverage_sums sums;
    double alone_m2[2];
    cover_look(c, RIGHT, &sweep, &pulses);
    struct cover_cell *by_right = cells_of(c, RIGHT, sweep.step_deg, right_sees);
    struct cover_cell *by_upper = cells_of(c, UPPER, sweep.step_deg, upper_sees);
    double cut_right_m2 = 0.0, cut_upper_m2 = 0.0;
    for (uint32_t i = 0; i < coverage_cells(c->coverage); i++) {
        if (by_right[i].seen != 0 && by_right[i].seen != by_right[i].corners) cut_right_m2 += by_right[i].area_m2;
        if (by_upper[i].seen != 0 && by_upper[i].seen != by_upper[i].corners) cut_upper_m2 += by_upper[i].area_m2;
    }
    cover_look(c, UPPER, &sweep, &pulses);
    sums_of(c, &sums);
    coverage_alone(c->coverage, alone_m2);
    assert_true(sums.none_m2 == 0.0);
    assert_near("one, several", sums.one_m2 + sums.several_m2, L_M2, 1e-11);
    assert_near("alone", alone_m2[0] + alone_m2[1], sums.one_m2, 1e-11);
    assert_near("only from the right", alone_m2[0], UPPER_HIDDEN_M2, cut_upper_m2);
    assert_near("only from above", alone_m2[1], RIGHT_HIDDEN_M2, cut_right_m2);
    assert_near("from both", sums.several_m2, L_M2 - RIGHT_HIDDEN_M2 - UPPER_HIDDEN_M2, cut_right_m2 + cut_upper_m2);
    free(by_right);
    free(by_upper);
    cover_close(c);
}

/* All figures of all cells are the same, to the last bit. */
static void test_threads(void **state)
{
    (void)state;
    struct cover *one = cover_open(cover_l_room(), 0.3, 1), *five = cover_open(cover_l_room(), 0.3, 5);
    struct coverage_pulses a, b;
    cover_look(one, RIGHT, &cover_everywhere, &a);
    cover_look(five, RIGHT, &cover_everywhere, &b);
    assert_memory_equal(&a, &b, sizeof a);
    assert_int_equal(coverage_cells(one->coverage), coverage_cells(five->coverage));
    for (uint32_t i = 0; i < coverage_cells(one->coverage); i++) {
        struct coverage_cell x, y;
        memset(&x, 0, sizeof x);
        memset(&y, 0, sizeof y);
        coverage_get(one->coverage, i, &x);
        coverage_get(five->coverage, i, &y);
        assert_true(x.pulses == y.pulses && x.stations == y.stations && x.area_m2 == y.area_m2);
        if (x.stations > 0) assert_true(x.incidence_rad == y.incidence_rad && x.range_m == y.range_m);
    }
    cover_close(one);
    cover_close(five);
}

/* The smallest incidence and range of a large cell are known: a pulse meets its wall nearly head on, at the wall's
 * distance. */
static void test_figures_of_a_cell(void **state)
{
    (void)state;
    struct cover *c = cover_open(cover_box(LO, HI), 50.0, 1);
    struct coverage_pulses pulses;
    const double away_m[6] = {2.0, 2.1, 1.6, 1.5, 1.15, 1.25}; /* x-, x+, y-, y+, z-, z+ */
    const double step_rad = cover_everywhere.step_deg * M_PI / 180.0;
    cover_look(c, WITHIN, &cover_everywhere, &pulses);
    for (uint32_t i = 0; i < 6; i++) {
        struct coverage_cell cell;
        coverage_get(c->coverage, i, &cell);
        /* A line ends a step before the zenith; single precision of a cosine near 1 is 3.5e-4 rad. */
        assert_true(cell.incidence_rad <= step_rad + 3.5e-4);
        assert_near("range", cell.range_m, away_m[cell.label], step_rad * step_rad * away_m[cell.label]);
    }
    cover_close(c);
}

static void test_too_small(void **state)
{
    (void)state;
    struct scene *scene = cover_box(LO, HI);
    struct coverage *coverage;
    struct bvh *bvh;
    struct sh_err err;
    double allowed_m;
    assert_int_equal(bvh_create(scene, 1, NULL, &bvh, &err), 0);
    /* The limit in the text is rounded up, so that it is allowed. With 1.14 MiB 0.1922 m is allowed, 0.19 m is not. */
    for (double memory_mib = 1.10; memory_mib < 1.18; memory_mib += 0.01) {
        struct coverage_spec spec = {bvh, NULL, 0.001, memory_mib, 1};
        assert_int_equal(coverage_create(&spec, NULL, &coverage, &err), SH_EINPUT);
        assert_null(coverage);
        const char *says = strstr(err.text, "a cell of at least ");
        if (says == NULL || strstr(err.text, " MiB are allowed") == NULL) fail_msg("%s", err.text);
        assert_int_equal(sscanf(says, "a cell of at least %lf m", &allowed_m), 1);
        spec.cell_m = allowed_m;
        if (coverage_create(&spec, NULL, &coverage, &err) != 0) fail_msg("%g MiB: %s", memory_mib, err.text);
        coverage_free(coverage);
    }
    /* Numbers of cells along a side have 30 bits, so the scene's longest side may have 1e9 cells. */
    const double span_m = fmax(fmax(HI[0] - LO[0], HI[1] - LO[1]), HI[2] - LO[2]);
    char says[160];
    struct coverage_spec fine = {bvh, NULL, 0.99e-9 * span_m, 1e9, 1};
    assert_int_equal(coverage_create(&fine, NULL, &coverage, &err), SH_EINPUT);
    snprintf(says, sizeof says, "cells of %g m in a scene of %.3g m; allowed is a cell of at least ", fine.cell_m,
             span_m);
    if (strncmp(err.text, says, strlen(says)) != 0) fail_msg("%s", err.text);
    fine.cell_m = atof(err.text + strlen(says)); /* that is allowed, though memory then is another limit */
    assert_true(fine.cell_m >= 1e-9 * span_m && fine.cell_m <= 1.1e-9 * span_m);
    assert_int_equal(coverage_create(&fine, NULL, &coverage, &err), SH_EINPUT);
    assert_null(strstr(err.text, "in a scene of"));
    bvh_free(bvh);
    scene_free(scene);
}

/* Two faces with the same corners are one surface. */
static void test_twins(void **state)
{
    (void)state;
    static const double vertex[3][3] = {{2, -1, -1}, {2, 1, -1}, {2, 0, 1}};
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {0, 2, 1}};
    struct scene *scene;
    struct sh_err err;
    assert_int_equal(scene_from_arrays(&(struct scene_arrays){vertex, 3, triangle, 2, NULL, NULL, 0}, &scene, &err), 0);
    struct cover *c = cover_open(scene, 0.3, 1);
    struct coverage_pulses pulses;
    struct coverage_sums sums;
    cover_look(c, (const double[3]){0, 0, 0}, &cover_everywhere, &pulses);
    sums_of(c, &sums);
    assert_near("area", sums.area_m2, 2.0, 1e-12);
    assert_near("the other face", sums.duplicate_m2, 2.0, 1e-12);
    assert_near("seen", sums.one_m2, 2.0, 1e-12);
    cover_close(c);
}

struct counted {
    atomic_uint hits, beside; /* beside: not on a wall, or at another range */
};

static void take_hits(void *ctx, const struct cast_hit *hit, uint32_t n)
{
    struct counted *c = ctx;
    for (uint32_t i = 0; i < n; i++) {
        double least_m = INFINITY, to2 = 0.0;
        for (int a = 0; a < 3; a++) {
            least_m = fmin(least_m, fmin(fabs(hit[i].p_m[a] - LO[a]), fabs(hit[i].p_m[a] - HI[a])));
            to2 += (hit[i].p_m[a] - WITHIN[a]) * (hit[i].p_m[a] - WITHIN[a]);
        }
        atomic_fetch_add(&c->beside, least_m > 1e-9 || fabs(sqrt(to2) - hit[i].range_m) > 1e-9);
    }
    atomic_fetch_add(&c->hits, n);
}

/* Scans that were written down as cells give the same areas when they are kept again, in another order; and a scan's
 * hits can be had. */
static void test_written_down(void **state)
{
    (void)state;
    static const double places[2][3] = {{1.0, 1.0, 1.0}, {0.5, 0.7, 1.2}};
    struct cover *c = cover_open(cover_box(LO, HI), 0.2, 2);
    struct cover_sweep sweep = cover_everywhere;
    struct coverage_sums kept, again;
    struct coverage_pulses pulses;
    struct counted counted = {0, 0};
    uint64_t cells[2][1024];
    assert_true(coverage_cells(c->coverage) <= 64 * 1024);
    sweep.range_max_m = 1.5;
    sweep.step_deg = 2.0;
    for (int i = 0; i < 2; i++) {
        struct coverage_scan scan;
        struct sh_err err;
        cover_scan(c, i == 0 ? places[0] : places[1], &sweep, &scan);
        assert_int_equal(coverage_look(c->coverage, &scan, "a scan", NULL, &pulses, &err), SH_OK);
        coverage_waiting_cells(c->coverage, cells[i]);
        coverage_keep(c->coverage);
    }
    sums_of(c, &kept);
    coverage_forget(c->coverage);
    sums_of(c, &again);
    assert_true(again.none_m2 == again.area_m2 && again.stations == 0);
    coverage_keep_cells(c->coverage, cells[1]);
    coverage_keep_cells(c->coverage, cells[0]);
    sums_of(c, &again);
    assert_true(kept.one_m2 > 0.0 && kept.several_m2 > 0.0 && again.stations == 2);
    assert_true(again.none_m2 == kept.none_m2 && again.one_m2 == kept.one_m2 && again.several_m2 == kept.several_m2);
    struct coverage_scan scan;
    struct sh_err err;
    cover_scan(c, WITHIN, &cover_everywhere, &scan);
    scan.take = take_hits;
    scan.take_ctx = &counted;
    assert_int_equal(coverage_look(c->coverage, &scan, "a scan", NULL, &pulses, &err), SH_OK);
    assert_int_equal(counted.hits, pulses.hits);
    assert_int_equal(counted.beside, 0);
    cover_close(c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
#ifndef SH_SANITIZE /* millions of pulses */
        cmocka_unit_test(test_box),
        cmocka_unit_test(test_later_segment),
        cmocka_unit_test(test_range_limit),
        cmocka_unit_test(test_l_from_the_right),
        cmocka_unit_test(test_l_from_above),
        cmocka_unit_test(test_two_stations),
#endif
        cmocka_unit_test(test_area_is_kept),
        cmocka_unit_test(test_threads),
        cmocka_unit_test(test_figures_of_a_cell),
        cmocka_unit_test(test_too_small),
        cmocka_unit_test(test_twins),
        cmocka_unit_test(test_written_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
