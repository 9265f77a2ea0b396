/* SPDX-License-Identifier: MIT */
/* The cells of the surface that have points, by station, and the coarse scene as bytes. Run from the top of the source
 * tree. */
#include "firmware_sim/app/studio/watch/inside.h"
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/bytes.h"
#include "core/studio/cloud.h"

static struct watch w;

/* A floor of 4 x 2 m, whose diagonal is y = x / 2, and two stations above it; a body of one triangle moves with 1 m/s.
 */
static void open_site(const char *more)
{
    char text[1024];
    struct site *site;
    write_in("floor.obj", "v 0 0 0\nv 4 0 0\nv 4 2 0\nv 0 2 0\nf 1 2 3\nf 1 3 4\n");
    write_in("body.obj", "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n");
    snprintf(text, sizeof text,
             "head: {profile: full-sweep}\nscene:\n  meshes:\n    - {file: floor.obj, up: z, scale: 1}\n%s"
             "stations: [{position_m: [1, 1, 1]}, {position_m: [3, 1, 1]}]\n",
             more);
    write_in("test.yaml", text);
    if (config_load(config_path, NULL, 0, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    if (site_load_for(cfg, SITE_WRITTEN_OUT, NULL, NULL, &site, &err) != SH_OK) fail_msg("%s", err.text);
    memset(&w, 0, sizeof w);
    w.cfg = cfg;
    w.site = site;
    w.options.report = &report;
    clear_warned();
}

static void close_site(void)
{
    watch_seen_close(&w.seen);
    assert_null(w.seen.coverage);
    free(w.scene_bytes);
    site_free((struct site *)w.site);
}

static void open_cells(double cell_m, double memory_mib)
{
    open_site("");
    cfg->coverage.cell_m = cell_m;
    cfg->coverage.memory_mib = memory_mib;
    if (watch_seen_open(&w, &err) != SH_OK) fail_msg("%s", err.text);
}

/* Marks the cell with this middle: below the diagonal is the first triangle. */
static void mark(uint32_t station, double x, double y)
{
    watch_seen_mark(&w.seen, station, y > x / 2, (const double[3]){x, y, 0});
}

static void near(double got, double want)
{
    if (!(fabs(got - want) <= 1e-9)) fail_msg("%.12g, not %.12g", got, want);
}

static double area_at(double x, double y)
{
    struct coverage_cell cell;
    coverage_get(w.seen.coverage, coverage_cell_at(w.seen.coverage, y > x / 2, (const double[3]){x, y, 0}), &cell);
    return cell.area_m2;
}

/* Cells of 0.25 m: at least 16 x 8, in more than two words of bits. */
static void each_station_has_its_cells(void **state)
{
    (void)state;
    open_cells(0.25, 100);
    struct watch_seen *s = &w.seen;
    assert_true(s->n_cells >= 128 && s->n_cells == coverage_cells(s->coverage));
    near(s->cell_m, 0.25);
    near(s->area_m2, 8.0);
    near(watch_seen_count(s, 1, 2), 0.0);
    assert_true(s->n_seen == 0 && s->seen_m2 == 0.0);
    mark(1, 3.875, 0.125);
    mark(1, 3.9, 0.1); /* the same cell */
    mark(1, 0.125, 1.875);
    mark(2, 3.875, 0.125);
    mark(2, 2.125, 0.125);
    watch_seen_mark(s, 2, CLOUD_TRIANGLE_NONE, (const double[3]){0.125, 0.125, 0});
    const double both_m2 = area_at(3.875, 0.125), first_m2 = area_at(0.125, 1.875), second_m2 = area_at(2.125, 0.125);
    near(watch_seen_count(s, 1, 2), (both_m2 + first_m2) / 8.0);
    assert_int_equal(s->n_seen, 3); /* by either */
    near(s->seen_m2, both_m2 + first_m2 + second_m2);
    near(watch_seen_count(s, 2, 2), (both_m2 + second_m2) / 8.0);
    assert_int_equal(s->n_seen, 3);
    watch_seen_begin(s, 1); /* its scan begins anew, and the other's cells stay */
    near(watch_seen_count(s, 1, 2), 0.0);
    assert_int_equal(s->n_seen, 2);
    near(watch_seen_count(s, 2, 2), (both_m2 + second_m2) / 8.0);
    for (int y = 0; y < 100; y++)
        for (int x = 0; x < 200; x++)
            mark(2, 0.02 * x + 0.01, 0.02 * y + 0.009);
    near(watch_seen_count(s, 2, 2), 1.0);
    assert_int_equal(s->n_seen, s->n_cells);
    near(s->seen_m2, 8.0);
    close_site();
}

/* There are about 20,000 cells at most: of 8 m2 that is a side of 0.02 m. Where they take too much memory, their side
 * is made 1.5 times as long, as often as needed. */
static void fine_cells_are_made_coarser(void **state)
{
    (void)state;
    open_cells(0.001, 100);
    near(w.seen.cell_m, 0.02);
    close_site();
    open_cells(0.001, 1);
    double cell_m = 0.02 * 1.5;
    for (int i = 0; i < 10 && cell_m < 0.999 * w.seen.cell_m; i++)
        cell_m *= 1.5;
    near(w.seen.cell_m, cell_m);
    assert_non_null(w.seen.coverage);
    assert_string_equal(warned, "");
    close_site();
}

/* A triangle takes 148 bytes at least. Without cells nothing is marked, and the share is not known. */
static void without_memory_there_is_no_coverage(void **state)
{
    (void)state;
    open_cells(0.25, 295.0 / 0x1p20);
    assert_null(w.seen.coverage);
    assert_string_equal(warned,
                        "the page shows no coverage: the cells of 2 triangles take 0 MiB or more; allowed are 0 "
                        "MiB\n");
    watch_seen_begin(&w.seen, 1);
    mark(1, 1, 0.1);
    assert_true(isnan(watch_seen_count(&w.seen, 1, 2)));
    close_site();
}

/* ---- the scene */

static double float_at(const char *at)
{
    float f;
    memcpy(&f, at, sizeof f);
    return (double)f;
}

/* All vertices come before all triangles, whose corners are numbers among all vertices. Vertices are relative to the
 * middle of the floor. */
static void the_scene_is_in_bytes(void **state)
{
    (void)state;
    static const double floor_m[4][3] = {{0, 0, 0}, {4, 0, 0}, {4, 2, 0}, {0, 2, 0}};
    static const double body_m[3][3] = {{2, 0.5, 1}, {3, 0.5, 1}, {2, 0.5, 2}};
    struct web_body body;
    int rc;
    open_site("    - {file: body.obj, up: z, scale: 1, move_m_s: [1, 0, 0], offset_m: [2, 0.5, 1]}\n");
    w.options.scene_triangles = 1000;
    rc = watch_make_scene(&w, &err);
    if (rc == SH_OK) rc = watch_get_scene(&w, &body, &err);
    if (rc != SH_OK) fail_msg("%s", err.text);
    assert_string_equal(body.type, "application/octet-stream");
    assert_int_equal(body.len, 40 + 7 * 12 + 3 * 12);
    assert_memory_equal(body.bytes, "SHSC", 4);
    assert_int_equal(le_get32(body.bytes + 4), 1);
    assert_int_equal(le_get32(body.bytes + 8), 7);
    assert_int_equal(le_get32(body.bytes + 12), 3);
    double origin_m[3];
    memcpy(origin_m, body.bytes + 16, sizeof origin_m);
    near(origin_m[0], 2.0);
    near(origin_m[1], 1.0);
    near(origin_m[2], 0.0);
    int seen[7] = {0};
    for (int v = 0; v < 7; v++) {
        const char *at = body.bytes + 40 + 12 * v;
        for (int k = 0; k < 7; k++) {
            const double *p = k < 4 ? floor_m[k] : body_m[k - 4];
            if (fabs(origin_m[0] + float_at(at) - p[0]) + fabs(origin_m[1] + float_at(at + 4) - p[1]) +
                    fabs(origin_m[2] + float_at(at + 8) - p[2]) <
                1e-6)
                seen[k] += (k < 4) == (v < 4);
        }
    }
    for (int k = 0; k < 7; k++)
        assert_int_equal(seen[k], 1);
    for (int t = 0; t < 3; t++)
        for (int c = 0; c < 3; c++)
            assert_int_equal(le_get32(body.bytes + 40 + 84 + 12 * t + 4 * c) >= 4, t == 2);
    free(body.bytes);
    close_site();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_station_has_its_cells),
        cmocka_unit_test(fine_cells_are_made_coarser),
        cmocka_unit_test(without_memory_there_is_no_coverage),
        cmocka_unit_test(the_scene_is_in_bytes),
    };
    return cmocka_run_group_tests(tests, site_rig_setup, site_rig_teardown);
}
