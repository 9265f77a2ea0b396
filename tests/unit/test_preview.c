/* SPDX-License-Identifier: MIT */
/* These are previews of stations for a page. Expected values are worked out by hand for an L-shaped room, or by
 * another way: each point lies on a wall, at its range from the place that was asked for. */
#include "firmware_sim/app/studio/preview/inside.h"
#include "tests/unit/preview_room.h"
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/bytes.h"

static uint32_t points_of(const struct web_body *b)
{
    return le_get32(b->bytes + 16);
}

/* Where positions begin. */
static const char *xyz_of(const struct web_body *b)
{
    return b->bytes + 72 + 8 * (((size_t)le_get32(b->bytes + 12) + 63) / 64);
}

static double off_walls(const double p[3])
{
    const double d[8] = {p[0], p[1], p[0] - 6.0, p[1] - 5.0, p[0] - 2.0, p[1] - 2.0, p[2], p[2] - ROOM_HEIGHT_M};
    double least = INFINITY;
    for (int i = 0; i < 8; i++)
        least = fmin(least, fabs(d[i]));
    return least;
}

/* Every pulse of a closed room has a point. A float of up to 8 m has steps of 2^-21 m, and three of them add up. */
static void test_points(void **state)
{
    (void)state;
    struct room r = room_open("");
    struct web_body b = room_need(&r, "/preview", "station=1&x_m=4.25&y_m=0.75&z_m=1.5&heading_deg=33&step_deg=2");
    const char *at = xyz_of(&b);
    const uint32_t n = points_of(&b);
    assert_memory_equal(b.bytes, "SHPV", 4);
    assert_int_equal(n, 50 * 180);
    assert_int_equal(le_get32(b.bytes + 20), n);
    assert_int_equal(b.len, (size_t)(at - b.bytes) + 18 * (size_t)n);
    for (uint32_t i = 0; i < n; i++) {
        double p[3], range2 = 0.0;
        for (int k = 0; k < 3; k++) {
            const double d = (double)le_get_float(at + 12 * i + 4 * k);
            range2 += d * d;
            p[k] = d + le_get_double(b.bytes + 32 + 8 * k);
        }
        assert_true(off_walls(p) < 3 * 0x1p-21);
        assert_true(fabs(sqrt(range2) - (double)le_get_float(at + 12 * (size_t)n + 4 * i)) < 3 * 0x1p-21);
    }
    preview_release(r.preview, b.bytes);
    room_close(&r);
}

/* With `far_m` only what is within it has points; with a half of the pan only what is on that side. */
static void test_settings(void **state)
{
    (void)state;
    struct room r = room_open("");
    struct web_body near_by = room_need(&r, "/preview", "station=1&x_m=3&y_m=1&z_m=1.2&heading_deg=0&far_m=2");
    struct web_body east =
        room_need(&r, "/preview", "station=1&x_m=3&y_m=1&z_m=1.2&heading_deg=0&pan0_deg=1&pan1_deg=179");
    assert_true(points_of(&near_by) > 0 && points_of(&near_by) < le_get32(near_by.bytes + 20));
    for (uint32_t i = 0; i < points_of(&near_by); i++)
        assert_true(le_get_float(xyz_of(&near_by) + 12 * (size_t)points_of(&near_by) + 4 * i) <= 2.0f);
    assert_true(points_of(&east) > 4000);
    uint32_t behind = 0;
    for (uint32_t i = 0; i < points_of(&east); i++)
        behind += le_get_float(xyz_of(&east) + 12 * i) < 0.0f;
    assert_int_equal(behind, 0); /* lines go up to 60 degrees, so none goes over the zenith */
    preview_release(r.preview, near_by.bytes);
    preview_release(r.preview, east.bytes);
    room_close(&r);
}

struct body_pieces {
    const char *of, *corner, *origin;
    uint32_t n, triangles;
};

/* A triangle has its last corner twice. */
static void compare_piece(void *ctx, uint32_t cell, int n, const double corner[4][3])
{
    struct body_pieces *p = ctx;
    assert_int_equal(le_get32(p->of + 4 * (size_t)p->n), cell);
    for (int k = 0; k < 4; k++)
        for (int i = 0; i < 3; i++) {
            const double want = corner[n == 3 && k == 3 ? 2 : k][i];
            const char *at = p->corner + 48 * (size_t)p->n + 12 * k + 4 * i;
            assert_true(fabs((double)le_get_float(at) + le_get_double(p->origin + 8 * i) - want) < 1e-5);
        }
    p->n++;
    p->triangles += n == 3;
}

/* From the corner of the L all walls are seen. From its right leg the west end of the upper leg is hidden behind the
 * edge. A line from (5, 1) by the edge (2, 2) meets x = 0 at y = 2.67. */
static void test_cells(void **state)
{
    (void)state;
    struct room r = room_open("");
    struct web_body cells = room_need(&r, "/cells", "");
    struct web_body leg =
        room_need(&r, "/preview", "station=1&x_m=5&y_m=1&z_m=1.2&heading_deg=0&step_deg=0.5&points=0");
    const uint32_t n = le_get32(cells.bytes + 8), pieces = le_get32(cells.bytes + 12);
    const char *of = cells.bytes + 48 + 4 * (size_t)n, *corner = of + 4 * (size_t)pieces;
    double area_m2 = 0.0;
    uint32_t dark = 0, lit = 0;
    assert_memory_equal(cells.bytes, "SHCE", 4);
    assert_int_equal(le_get32(cells.bytes + 4), 1); /* versions */
    assert_int_equal(le_get32(leg.bytes + 4), 1);
    assert_true(le_get_double(cells.bytes + 40) == 0.2);
    assert_int_equal(n, coverage_cells(r.coverage));
    assert_int_equal(points_of(&leg), 0);
    for (uint32_t i = 0; i < n; i++)
        area_m2 += (double)le_get_float(cells.bytes + 48 + 4 * i);
    assert_true(fabs(area_m2 - ROOM_AREA_M2) < 1e-4);
    struct body_pieces body = {of, corner, cells.bytes + 16, 0, 0};
    coverage_pieces(r.coverage, compare_piece, &body);
    assert_int_equal(body.n, pieces);
    assert_true(body.triangles > 0 && body.triangles < pieces);
    for (uint32_t i = 0; i < pieces; i++) {
        const uint32_t cell = le_get32(of + 4 * i);
        double low_y = INFINITY, low_z = INFINITY, low_x = INFINITY, high_x = -INFINITY;
        for (int k = 0; k < 4; k++) {
            const char *p = corner + 48 * i + 12 * k;
            low_x = fmin(low_x, (double)le_get_float(p) + le_get_double(cells.bytes + 16));
            high_x = fmax(high_x, (double)le_get_float(p) + le_get_double(cells.bytes + 16));
            low_y = fmin(low_y, (double)le_get_float(p + 4) + le_get_double(cells.bytes + 24));
            low_z = fmin(low_z, (double)le_get_float(p + 8) + le_get_double(cells.bytes + 32));
        }
        if (low_y > 2.7 + 2.5 * 0.2) { /* a cell reaches 2.5 times its size */
            dark++;
            assert_int_equal(room_sees(&leg, cell), 0);
        }
        if (low_x > 5.999 && low_z > 0.5 && low_z < 1.5) { /* the wall 1 m away: points are 1 cm apart */
            lit++;
            assert_int_equal(room_sees(&leg, cell), 1);
        }
    }
    assert_true(dark > 100 && lit > 20);
    preview_release(r.preview, cells.bytes);
    preview_release(r.preview, leg.bytes);
    room_close(&r);
}

/* The head has a height above the ground, and the cone of its tripod hides a part of it: cos(opening) = height of
 * the top / length of a leg. */
static void test_tripod(void **state)
{
    (void)state;
    struct room r = room_open(", tripod: {leg_m: 1.5, head_above_m: 0.1}");
    struct web_body b = room_need(&r, "/preview", "station=1&x_m=5&y_m=1&z_m=1.3&heading_deg=0");
    struct web_body none = room_need(&r, "/preview", "station=2&x_m=5&y_m=1&z_m=1.3&heading_deg=0");
    const double opening_rad = acos(1.2 / 1.5);
    assert_true(fabs((double)le_get_float(b.bytes + 56) - 1.3) < 1e-6);
    assert_true(fabs((double)le_get_float(b.bytes + 60) - 1.3 * tan(opening_rad)) < 1e-6);
    assert_true(fabs((double)le_get_float(b.bytes + 64) - 1.5 * sin(opening_rad)) < 1e-6);
    assert_true(isnan(le_get_float(none.bytes + 56)));
    preview_release(r.preview, b.bytes);
    preview_release(r.preview, none.bytes);
    room_close(&r);
}

/* A station of another scanner is previewed with that one. A VLP-16 fires 16 beams 1809 times in a turn at 10 Hz,
 * whatever the step (55.296 us a sequence). */
static void test_scanners(void **state)
{
    (void)state;
    struct room r = room_open(
        "}\n  - {position_m: [1, 3, 1.2], heading_deg: 0, scanner: {head: {profile: velodyne-vlp16, lines_hz: 10}}");
    struct web_body coarse = room_need(&r, "/preview", "station=2&x_m=4&y_m=1&z_m=1.2&heading_deg=0&step_deg=4");
    struct web_body fine = room_need(&r, "/preview", "station=2&x_m=4&y_m=1&z_m=1.2&heading_deg=0&step_deg=1");
    const uint32_t pulses = le_get32(fine.bytes + 20);
    assert_true(pulses >= 16 * 1808 && pulses <= 16 * 1809);
    assert_int_equal(le_get32(coarse.bytes + 20), pulses);
    preview_release(r.preview, coarse.bytes);
    preview_release(r.preview, fine.bytes);
    room_close(&r);
}

/* A scanner that could not be set up has no site (firmware_sim/app/sites.h). */
static void test_broken_scanner(void **state)
{
    (void)state;
    struct room r = room_open("}\n  - {position_m: [1, 3, 1.2], heading_deg: 0, scanner: {head: {frames: 2}}");
    const struct preview_options options = {.cfg = cfg, .site = r.site};
    const struct sites broken = {.first = r.site, .n = 1, .other = {{.scanner = 2}}};
    const struct preview_work work = {.options = &options, .sites = &broken};
    const struct preview_request request = {.station = 1, .step_deg = 4.0};
    struct preview_site *site;
    assert_int_equal(preview_site_open(&work, &request, &site, &err), SH_EINPUT);
    assert_null(site);
    assert_string_equal(err.text, "station 2 has a scanner that can't be previewed");
    room_close(&r);
}

/* A scene without a coverage has points, and no cells. */
static void test_without_cells(void **state)
{
    (void)state;
    struct room r = room_open("");
    const struct preview_options options = {.cfg = cfg, .site = r.site};
    struct web_body body;
    preview_free(r.preview);
    if (preview_create(&options, &r.preview, &err) != SH_OK) fail_msg("%s", err.text);
    struct web_body b = room_need(&r, "/preview", "station=1&x_m=4.25&y_m=0.75&z_m=1.5&heading_deg=33&step_deg=2");
    assert_int_equal(le_get32(b.bytes + 12), 0);
    assert_int_equal(points_of(&b), 50 * 180);
    preview_release(r.preview, b.bytes);
    assert_int_equal(room_ask(&r, "/cells", "", &body), SH_ESTATE);
    assert_non_null(strstr(err.text, "too many triangles"));
    assert_int_equal(room_ask(&r, "/next", "station=1", &body), SH_ESTATE);
    room_close(&r);
}

static void test_refusals(void **state)
{
    (void)state;
    static const struct {
        const char *path, *query, *words;
    } wrong[] = {
        {"/preview", "station=3&x_m=1&y_m=1&z_m=1&heading_deg=0", "station=3: allowed whole numbers from 1 to 2"},
        {"/preview", "station=1&x_m=1&y_m=1&heading_deg=0", "z_m is needed"},
        {"/preview", "station=1&x_m=1&y_m=1&z_m=1&heading_deg=0&step=1", "step: unknown; allowed station"},
        {"/preview", "station=1&x_m=1&y_m=1&z_m=1&heading_deg=0&y_m=2", "y_m: given twice; allowed once"},
        {"/preview", "station=1&x_m=1&y_m=1&z_m=1&heading_deg=0&step_deg=0.1", "allowed are 1500000"},
        {"/preview", "station=1&x_m=1&y_m=1&z_m=1&heading_deg=0&line0_deg=-60", "lines from -60 to 60 deg: allowed is"},
        {"/preview", "station=1&x_m=1&y_m=1&z_m=1&heading_deg=0&pan1_deg=361", "pan from 0 to 361 deg: allowed is"},
        {"/preview", "station=1&x_m=1&y_m=1&z_m=1&heading_deg=0&far_m=0.1", "far_m=0.1: allowed is more than 0.5"},
        {"/next", "station=1&p17=1", "p17: unknown"},
        {"/next", "station=1&half_x_m=-1", "half_x_m=-1: allowed"},
        {"/reach", "station=1&half_x_m=1", "half_x_m: unknown"},
        {"/cells", "a=1", "allowed nothing after ?"},
    };
    struct room r = room_open("");
    struct web_body body;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        assert_int_equal(room_ask(&r, wrong[i].path, wrong[i].query, &body), SH_EINPUT);
        if (strstr(err.text, wrong[i].words) == NULL) fail_msg("%s: %s", wrong[i].query, err.text);
    }
    err.text[0] = '\0';
    assert_int_equal(preview_get(r.preview, "/other", "", &body, &err), SH_EINPUT);
    assert_string_equal(err.text, "");
    room_close(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_points),        cmocka_unit_test(test_settings), cmocka_unit_test(test_cells),
        cmocka_unit_test(test_tripod),        cmocka_unit_test(test_scanners), cmocka_unit_test(test_broken_scanner),
        cmocka_unit_test(test_without_cells), cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, site_rig_setup, site_rig_teardown);
}
