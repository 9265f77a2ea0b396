/* SPDX-License-Identifier: MIT */
/* These are previews of stations for a page. Expected values are worked out by hand for an L-shaped room, or by
 * another way: each point lies on a wall, at its range from the place that was asked for. */
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/bytes.h"
#include "firmware_sim/app/studio/preview/preview.h"
#include "firmware_sim/base/clock.h"

/* The L is (0, 0) (6, 0) (6, 2) (2, 2) (2, 5) (0, 5), from z = 0 to 2.4; its faces look inward. */
static const char ROOM[] = "v 0 0 0\nv 6 0 0\nv 6 2 0\nv 2 2 0\nv 2 5 0\nv 0 5 0\n"
                           "v 0 0 2.4\nv 6 0 2.4\nv 6 2 2.4\nv 2 2 2.4\nv 2 5 2.4\nv 0 5 2.4\n"
                           "f 2 1 7 8\nf 3 2 8 9\nf 4 3 9 10\nf 5 4 10 11\nf 6 5 11 12\nf 1 6 12 7\n"
                           "f 1 2 3 4\nf 1 4 5 6\nf 10 9 8 7\nf 12 11 10 7\n";
static const double HEIGHT_M = 2.4, AREA_M2 = 2 * (12.0 + 6.0) + 22.0 * 2.4;

struct room {
    struct site *site;
    struct coverage *coverage;
    struct preview *preview;
};

/* A closed body is in the right leg, from the ground to 0.1 m below the ceiling, wide enough to stand in. None of
 * its walls goes through a place of the grid. */
static const char BODY[] = "o body\nv 3.1 0.2 0.01\nv 5.1 0.2 0.01\nv 5.1 1.8 0.01\nv 3.1 1.8 0.01\n"
                           "v 3.1 0.2 2.3\nv 5.1 0.2 2.3\nv 5.1 1.8 2.3\nv 3.1 1.8 2.3\n"
                           "f 13 16 15 14\nf 17 18 19 20\nf 13 14 18 17\nf 14 15 19 18\nf 15 16 20 19\nf 16 13 17 20\n";

static struct room open_with(const char *tripod, const char *body);

/* The head scans everything but cones of 50 degrees below and 30 degrees above. */
static struct room open_room(const char *tripod)
{
    return open_with(tripod, "");
}

static struct room open_with(const char *tripod, const char *body)
{
    struct room r;
    char text[1024], mesh[1024];
    snprintf(mesh, sizeof mesh, "%s%s", ROOM, body);
    write_in("room.obj", mesh);
    snprintf(
        text, sizeof text,
        "head: {profile: full-sweep, prr_hz: 100000, lines_hz: 100, pan_deg_s: 100, frames: 1}\n"
        "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
        "stations:\n  - {position_m: [5, 1, 1.2], heading_deg: 0%s}\n  - {position_m: [1, 1, 1.2], heading_deg: 0}\n",
        tripod);
    write_in("test.yaml", text);
    if (config_load(config_path, NULL, 0, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    if (site_load_written_out(cfg, NULL, &r.site, &err) != SH_OK) fail_msg("%s", err.text);
    const struct coverage_spec spec = {.bvh = r.site->bvh, .cell_m = 0.2, .memory_mib = 64, .threads = 1};
    if (coverage_create(&spec, NULL, &r.coverage, &err) != SH_OK) fail_msg("%s", err.text);
    const struct preview_options options = {.cfg = cfg, .site = r.site, .coverage = r.coverage, .cell_m = spec.cell_m};
    if (preview_create(&options, &r.preview, &err) != SH_OK) fail_msg("%s", err.text);
    return r;
}

static void close_room(struct room *r)
{
    preview_free(r->preview);
    coverage_free(r->coverage);
    site_free(r->site);
}

/* Asks until there is an answer. The deadline is that of the whole test program. */
static int ask(struct room *r, const char *path, const char *query, struct web_body *out)
{
    for (;;) {
        const int rc = preview_get(r->preview, path, query, out, &err);
        if (rc != SH_OK || out->len > 0) return rc;
        free(out->bytes);
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    }
}

static struct web_body need(struct room *r, const char *path, const char *query)
{
    struct web_body body;
    if (ask(r, path, query, &body) != SH_OK) fail_msg("%s?%s: %s", path, query, err.text);
    return body;
}

static uint32_t points_of(const struct web_body *b)
{
    return le_get32(b->bytes + 16);
}

/* Where positions begin. */
static const char *xyz_of(const struct web_body *b)
{
    return b->bytes + 72 + 8 * (((size_t)le_get32(b->bytes + 12) + 63) / 64);
}

static int sees(const struct web_body *b, uint32_t cell)
{
    return (int)(le_get64(b->bytes + 72 + 8 * (cell / 64)) >> cell % 64 & 1);
}

static double off_walls(const double p[3])
{
    const double d[8] = {p[0], p[1], p[0] - 6.0, p[1] - 5.0, p[0] - 2.0, p[1] - 2.0, p[2], p[2] - HEIGHT_M};
    double least = INFINITY;
    for (int i = 0; i < 8; i++)
        least = fmin(least, fabs(d[i]));
    return least;
}

/* Every pulse of a closed room has a point. A float of up to 8 m has steps of 2^-21 m, and three of them add up. */
static void test_points(void **state)
{
    (void)state;
    struct room r = open_room("");
    struct web_body b = need(&r, "/preview", "station=1&x_m=4.25&y_m=0.75&z_m=1.5&heading_deg=33&step_deg=2");
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
    close_room(&r);
}

/* With `far_m` only what is within it has points; with a half of the pan only what is on that side. */
static void test_settings(void **state)
{
    (void)state;
    struct room r = open_room("");
    struct web_body near_by = need(&r, "/preview", "station=1&x_m=3&y_m=1&z_m=1.2&heading_deg=0&far_m=2");
    struct web_body east = need(&r, "/preview", "station=1&x_m=3&y_m=1&z_m=1.2&heading_deg=0&pan0_deg=1&pan1_deg=179");
    assert_true(points_of(&near_by) > 0 && points_of(&near_by) < le_get32(near_by.bytes + 20));
    for (uint32_t i = 0; i < points_of(&near_by); i++)
        assert_true(le_get_float(xyz_of(&near_by) + 12 * (size_t)points_of(&near_by) + 4 * i) <= 2.0f);
    assert_true(points_of(&east) > 4000);
    uint32_t behind = 0;
    for (uint32_t i = 0; i < points_of(&east); i++)
        behind += le_get_float(xyz_of(&east) + 12 * i) < 0.0f;
    assert_true(behind < points_of(&east)); /* lines go up to 60 degrees, so none goes over the zenith */
    assert_int_equal(behind, 0);
    preview_release(r.preview, near_by.bytes);
    preview_release(r.preview, east.bytes);
    close_room(&r);
}

/* From the corner of the L all walls are seen. From its right leg the west end of the upper leg is hidden behind the
 * edge. A line from (5, 1) by the edge (2, 2) meets x = 0 at y = 2.67. */
static void test_cells(void **state)
{
    (void)state;
    struct room r = open_room("");
    struct web_body cells = need(&r, "/cells", "");
    struct web_body leg = need(&r, "/preview", "station=1&x_m=5&y_m=1&z_m=1.2&heading_deg=0&step_deg=0.5&points=0");
    const uint32_t n = le_get32(cells.bytes + 8), pieces = le_get32(cells.bytes + 12);
    const char *of = cells.bytes + 48 + 4 * (size_t)n, *corner = of + 4 * (size_t)pieces;
    double area_m2 = 0.0;
    uint32_t dark = 0, lit = 0;
    assert_int_equal(n, coverage_cells(r.coverage));
    assert_int_equal(points_of(&leg), 0);
    for (uint32_t i = 0; i < n; i++)
        area_m2 += (double)le_get_float(cells.bytes + 48 + 4 * i);
    assert_true(fabs(area_m2 - AREA_M2) < 1e-4);
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
            assert_int_equal(sees(&leg, cell), 0);
        }
        if (low_x > 5.999 && low_z > 0.5 && low_z < 1.5) { /* the wall 1 m away: points are 1 cm apart */
            lit++;
            assert_int_equal(sees(&leg, cell), 1);
        }
    }
    assert_true(dark > 100 && lit > 20);
    preview_release(r.preview, cells.bytes);
    preview_release(r.preview, leg.bytes);
    close_room(&r);
}

/* Every part of a closed room is seen from some of its places, except near walls. There the ground and the ceiling
 * lie within the cones that heads can't scan, and few places are far enough away. A body in the room is hidden
 * within. */
static void test_reach(void **state)
{
    (void)state;
    struct room r = open_room("");
    struct web_body cells = need(&r, "/cells", "");
    struct web_body leg = need(&r, "/preview", "station=1&x_m=5&y_m=1&z_m=1.2&heading_deg=0&step_deg=0.5&points=0");
    char query[64];
    snprintf(query, sizeof query, "station=1&height_m=1.2&p1=%u", le_get32(leg.bytes + 8));
    struct web_body reach = need(&r, "/reach", query);
    const uint32_t n = le_get32(reach.bytes + 8);
    double hidden_m2 = 0.0;
    assert_memory_equal(reach.bytes, "SHRE", 4);
    assert_int_equal(reach.len, 16 + 8 * (((size_t)n + 63) / 64));
    assert_true(le_get32(reach.bytes + 12) > 50);
    for (uint32_t i = 0; i < n; i++)
        if ((le_get64(reach.bytes + 16 + 8 * (i / 64)) >> i % 64 & 1) == 0)
            hidden_m2 += (double)le_get_float(cells.bytes + 48 + 4 * i);
    assert_true(hidden_m2 < 0.01 * AREA_M2);
    preview_release(r.preview, cells.bytes);
    preview_release(r.preview, leg.bytes);
    preview_release(r.preview, reach.bytes);
    close_room(&r);
}

/* Places that are asked for while a search is on are answered, and so is the search in the end. */
static void test_search_gives_way(void **state)
{
    (void)state;
    struct room r = open_room("");
    struct web_body body, reach;
    char query[96];
    assert_int_equal(preview_get(r.preview, "/reach", "station=1&height_m=1.2", &body, &err), SH_OK);
    for (int i = 0; i < 20; i++) {
        preview_release(r.preview, body.bytes);
        snprintf(query, sizeof query, "station=1&x_m=%g&y_m=1&z_m=1.2&heading_deg=0", 1.0 + 0.1 * i);
        body = need(&r, "/preview", query);
        assert_int_equal(points_of(&body), 50 * 180);
    }
    preview_release(r.preview, body.bytes);
    reach = need(&r, "/reach", "station=1&height_m=1.2");
    assert_true(le_get32(reach.bytes + 12) > 50);
    preview_release(r.preview, reach.bytes);
    close_room(&r);
}

static void ask_dragged(struct room *r, int i, int waits)
{
    struct web_body body;
    char query[96];
    snprintf(query, sizeof query, "station=1&x_m=%g&y_m=1&z_m=1.2&heading_deg=0&step_deg=%d", 1.0 + 0.01 * i,
             waits ? 4 : 1);
    if (waits)
        body = need(r, "/preview", query);
    else
        assert_int_equal(preview_get(r->preview, "/preview", query, &body, &err), SH_OK);
    preview_release(r->preview, body.bytes);
}

/* Pages that drag on and on neither keep the suggestion of another page waiting, nor take its preview out. 64 answers
 * are kept, and that preview is the oldest of 62 when the search is asked for. Only the newest of three places is waited
 * for each time, so that another one always waits. */
static void test_drag_beside_search(void **state)
{
    (void)state;
    enum { KEPT = 61, ROUNDS = 20 };
    struct room r = open_room("");
    struct web_body leg = need(&r, "/preview", "station=1&x_m=5&y_m=1&z_m=1.2&heading_deg=0&step_deg=0.5&points=0");
    struct web_body body = {NULL, NULL, 0};
    char query[64];
    int n = 0;
    snprintf(query, sizeof query, "station=1&height_m=1.2&p1=%u", le_get32(leg.bytes + 8));
    while (n < KEPT)
        ask_dragged(&r, n++, 1);
    while (body.len == 0 && n < KEPT + 3 * ROUNDS) {
        preview_release(r.preview, body.bytes);
        if (preview_get(r.preview, "/next", query, &body, &err) != SH_OK) fail_msg("after %d places: %s", n, err.text);
        for (int i = 0; i < 3; i++)
            ask_dragged(&r, n++, i == 2);
    }
    assert_int_not_equal(body.len, 0);
    preview_release(r.preview, body.bytes);
    preview_release(r.preview, leg.bytes);
    close_room(&r);
}

/* All readers of an answer share it, and it stays for them once 64 later ones have taken its slot. */
static void test_shared(void **state)
{
    (void)state;
    static const char query[] = "station=1&x_m=5&y_m=1&z_m=1.2&heading_deg=0";
    struct room r = open_room("");
    struct web_body one = need(&r, "/preview", query), two = need(&r, "/preview", query);
    assert_ptr_equal(one.bytes, two.bytes);
    for (int i = 0; i < 64; i++)
        ask_dragged(&r, i, 1);
    struct web_body again = need(&r, "/preview", query);
    assert_ptr_not_equal(one.bytes, again.bytes);
    preview_release(r.preview, two.bytes);
    assert_int_equal(points_of(&one), points_of(&again));
    preview_release(r.preview, one.bytes);
    preview_release(r.preview, again.bytes);
    close_room(&r);
}

/* The bottom of a closed body lies on the ground. It is seen only from within the body, where nobody stands. */
static void test_bodies(void **state)
{
    (void)state;
    struct room r = open_with("", BODY);
    struct web_body cells = need(&r, "/cells", "");
    struct web_body leg = need(&r, "/preview", "station=1&x_m=1&y_m=1&z_m=1.2&heading_deg=0&step_deg=0.5&points=0");
    char query[64];
    snprintf(query, sizeof query, "station=1&height_m=1.2&p1=%u", le_get32(leg.bytes + 8));
    struct web_body reach = need(&r, "/reach", query);
    const uint32_t n = le_get32(cells.bytes + 8), pieces = le_get32(cells.bytes + 12);
    const char *of = cells.bytes + 48 + 4 * (size_t)n, *corner = of + 4 * (size_t)pieces;
    uint32_t bottom = 0, seen = 0;
    for (uint32_t i = 0; i < pieces; i++) {
        const uint32_t cell = le_get32(of + 4 * i);
        double off = 0.0;
        for (int k = 0; k < 4; k++)
            off = fmax(
                off, fabs((double)le_get_float(corner + 48 * i + 12 * k + 8) + le_get_double(cells.bytes + 32) - 0.01));
        if (off > 1e-6) continue;
        bottom++;
        seen += (le_get64(reach.bytes + 16 + 8 * (cell / 64)) >> cell % 64 & 1) != 0;
    }
    assert_true(bottom > 50);
    assert_int_equal(seen, 0);
    preview_release(r.preview, cells.bytes);
    preview_release(r.preview, leg.bytes);
    preview_release(r.preview, reach.bytes);
    close_room(&r);
}

static double number_of(const char *json, const char *key)
{
    const char *at = strstr(json, key);
    if (at == NULL) fail_msg("no %s in %s", key, json);
    return atof(at + strlen(key) + 2);
}

/* With a head in the right leg, the next one stands where it sees the upper leg. The area that neither sees then is
 * less than the ground and the ceiling within the cones that heads can't scan. */
static void test_next(void **state)
{
    (void)state;
    struct room r = open_room("");
    struct web_body leg = need(&r, "/preview", "station=1&x_m=5&y_m=1&z_m=1.2&heading_deg=0&step_deg=0.5&points=0");
    struct web_body none;
    char query[64];
    snprintf(query, sizeof query, "station=1&height_m=1.2&p1=%u", le_get32(leg.bytes + 8));
    struct web_body next = need(&r, "/next", query);
    char json[512];
    snprintf(json, sizeof json, "%.*s", (int)next.len, next.bytes);
    const double x_m = number_of(json, "x_m"), y_m = number_of(json, "y_m"), z_m = number_of(json, "z_m");
    assert_true(x_m > 0.0 && x_m < 2.0 && y_m > 0.0 && y_m < 5.0 && z_m == 1.2);
    assert_true(number_of(json, "gain_m2") > 3.0 * HEIGHT_M * 2.0); /* the walls of the upper leg */
    assert_true(number_of(json, "none_m2") < 0.1 * AREA_M2);
    assert_int_equal(ask(&r, "/next", "station=1&p1=999", &none), SH_EINPUT);
    assert_non_null(strstr(err.text, "preview 999 is kept no more"));
    preview_release(r.preview, leg.bytes);
    preview_release(r.preview, next.bytes);
    close_room(&r);
}

/* The head has a height above the ground, and the cone of its tripod hides a part of it: cos(opening) = height of
 * the top / length of a leg. */
static void test_tripod(void **state)
{
    (void)state;
    struct room r = open_room(", tripod: {leg_m: 1.5, head_above_m: 0.1}");
    struct web_body b = need(&r, "/preview", "station=1&x_m=5&y_m=1&z_m=1.3&heading_deg=0");
    struct web_body none = need(&r, "/preview", "station=2&x_m=5&y_m=1&z_m=1.3&heading_deg=0");
    const double opening_rad = acos(1.2 / 1.5);
    assert_true(fabs((double)le_get_float(b.bytes + 56) - 1.3) < 1e-6);
    assert_true(fabs((double)le_get_float(b.bytes + 60) - 1.3 * tan(opening_rad)) < 1e-6);
    assert_true(fabs((double)le_get_float(b.bytes + 64) - 1.5 * sin(opening_rad)) < 1e-6);
    assert_true(isnan(le_get_float(none.bytes + 56)));
    preview_release(r.preview, b.bytes);
    preview_release(r.preview, none.bytes);
    close_room(&r);
}

/* A station of another scanner is previewed with that one. A VLP-16 fires 16 beams 1809 times in a turn at 10 Hz,
 * whatever the step (55.296 us a sequence). */
static void test_scanners(void **state)
{
    (void)state;
    struct room r = open_room(
        "}\n  - {position_m: [1, 3, 1.2], heading_deg: 0, scanner: {head: {profile: velodyne-vlp16, lines_hz: 10}}");
    struct web_body coarse = need(&r, "/preview", "station=2&x_m=4&y_m=1&z_m=1.2&heading_deg=0&step_deg=4");
    struct web_body fine = need(&r, "/preview", "station=2&x_m=4&y_m=1&z_m=1.2&heading_deg=0&step_deg=1");
    const uint32_t pulses = le_get32(fine.bytes + 20);
    assert_true(pulses >= 16 * 1808 && pulses <= 16 * 1809);
    assert_int_equal(le_get32(coarse.bytes + 20), pulses);
    preview_release(r.preview, coarse.bytes);
    preview_release(r.preview, fine.bytes);
    close_room(&r);
}

/* A scene without a coverage has points, and no cells. */
static void test_without_cells(void **state)
{
    (void)state;
    struct room r = open_room("");
    const struct preview_options options = {.cfg = cfg, .site = r.site};
    struct web_body body;
    preview_free(r.preview);
    if (preview_create(&options, &r.preview, &err) != SH_OK) fail_msg("%s", err.text);
    struct web_body b = need(&r, "/preview", "station=1&x_m=4.25&y_m=0.75&z_m=1.5&heading_deg=33&step_deg=2");
    assert_int_equal(le_get32(b.bytes + 12), 0);
    assert_int_equal(points_of(&b), 50 * 180);
    preview_release(r.preview, b.bytes);
    assert_int_equal(ask(&r, "/cells", "", &body), SH_ESTATE);
    assert_non_null(strstr(err.text, "too many triangles"));
    assert_int_equal(ask(&r, "/next", "station=1", &body), SH_ESTATE);
    close_room(&r);
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
        {"/preview", "station=1&x_m=1&y_m=1&z_m=1&heading_deg=0&step_deg=0.1", "allowed are 1500000"},
        {"/preview", "station=1&x_m=1&y_m=1&z_m=1&heading_deg=0&line0_deg=-60", "lines from -60 to 60 deg: allowed is"},
        {"/preview", "station=1&x_m=1&y_m=1&z_m=1&heading_deg=0&pan1_deg=361", "pan from 0 to 361 deg: allowed is"},
        {"/preview", "station=1&x_m=1&y_m=1&z_m=1&heading_deg=0&far_m=0.1", "far_m=0.1: allowed is more than 0.5"},
        {"/next", "station=1&p17=1", "p17: unknown"},
        {"/cells", "a=1", "allowed nothing after ?"},
    };
    struct room r = open_room("");
    struct web_body body;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        assert_int_equal(ask(&r, wrong[i].path, wrong[i].query, &body), SH_EINPUT);
        if (strstr(err.text, wrong[i].words) == NULL) fail_msg("%s: %s", wrong[i].query, err.text);
    }
    err.text[0] = '\0';
    assert_int_equal(preview_get(r.preview, "/other", "", &body, &err), SH_EINPUT);
    assert_string_equal(err.text, "");
    close_room(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_points),
        cmocka_unit_test(test_settings),
        cmocka_unit_test(test_cells),
        cmocka_unit_test(test_next),
        cmocka_unit_test(test_reach),
        cmocka_unit_test(test_search_gives_way),
        cmocka_unit_test(test_drag_beside_search),
        cmocka_unit_test(test_shared),
        cmocka_unit_test(test_bodies),
        cmocka_unit_test(test_tripod),
        cmocka_unit_test(test_scanners),
        cmocka_unit_test(test_without_cells),
        cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, site_rig_setup, site_rig_teardown);
}
