/* SPDX-License-Identifier: MIT */
/* These are searches for a page: the next place, what can be seen at all, and previews that come in between. */
#include "tests/unit/preview_room.h"
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/bytes.h"

/* Returns what a head in the right leg sees. */
static struct web_body see_leg(struct room *r)
{
    return room_need(r, "/preview", "station=1&x_m=5&y_m=1&z_m=1.2&heading_deg=0&step_deg=0.5&points=0");
}

/* With a head in the right leg, the next one stands where it sees the upper leg. The area that neither sees then is
 * less than the ground and the ceiling within the cones that heads can't scan. */
static void test_next(void **state)
{
    (void)state;
    struct room r = room_open("");
    struct web_body leg = see_leg(&r);
    struct web_body none;
    char query[64];
    snprintf(query, sizeof query, "station=1&height_m=1.2&p1=%u", le_get32(leg.bytes + 8));
    struct web_body next = room_need(&r, "/next", query);
    char json[512];
    snprintf(json, sizeof json, "%.*s", (int)next.len, next.bytes);
    const double x_m = room_number(json, "x_m"), y_m = room_number(json, "y_m"), z_m = room_number(json, "z_m");
    assert_true(x_m > 0.0 && x_m < 2.0 && y_m > 0.0 && y_m < 5.0 && z_m == 1.2);
    assert_true(room_number(json, "gain_m2") > 3.0 * ROOM_HEIGHT_M * 2.0); /* the walls of the upper leg */
    assert_true(room_number(json, "none_m2") < 0.1 * ROOM_AREA_M2);
    assert_int_equal(room_ask(&r, "/next", "station=1&p1=999", &none), SH_EINPUT);
    assert_non_null(strstr(err.text, "preview 999 is kept no more"));
    preview_release(r.preview, leg.bytes);
    preview_release(r.preview, next.bytes);
    room_close(&r);
}

/* Asks for the next place beside a head in the right leg, of what is in a box. */
static void next_within(struct room *r, uint32_t beside, const char *box, char json[512])
{
    char query[256];
    snprintf(query, sizeof query, "station=1&height_m=1.2&p1=%u&%s", beside, box);
    struct web_body next = room_need(r, "/next", query);
    snprintf(json, 512, "%.*s", (int)next.len, next.bytes);
    preview_release(r->preview, next.bytes);
}

/* Only the surface in a section counts. In the right leg the head misses at most floor and ceiling, which have 4 m2
 * each there. In the upper leg it sees nothing. There the section has 14.4 m2 of walls and 8 m2 of floor and ceiling.
 * Cells of 0.2 m may add 0.1 m along the 8.8 m of its cut. A box that is turned by 90 degrees has its sides
 * exchanged. */
static void test_next_in_section(void **state)
{
    (void)state;
    struct room r = room_open("");
    struct web_body leg = see_leg(&r);
    const uint32_t beside = le_get32(leg.bytes + 8);
    char json[512], turned[512];
    next_within(&r, beside, "middle_x_m=5&middle_y_m=1&half_x_m=1&half_y_m=1&half_z_m=9", json);
    assert_true(room_number(json, "gain_m2") > 0.0 && room_number(json, "gain_m2") < 8.0);
    next_within(&r, beside, "middle_x_m=1&middle_y_m=4&half_x_m=1.1&half_y_m=1&half_z_m=9", json);
    const double gain_m2 = room_number(json, "gain_m2");
    assert_true(gain_m2 > 0.9 * 14.4 && gain_m2 < 14.4 + 8.0 + 0.1 * (2 * 2.4 + 2 * 2.0));
    assert_true(gain_m2 + room_number(json, "none_m2") < 14.4 + 8.0 + 0.1 * (2 * 2.4 + 2 * 2.0));
    next_within(&r, beside, "middle_x_m=1&middle_y_m=4&half_x_m=1&half_y_m=1.1&half_z_m=9&turn_deg=90", turned);
    assert_string_equal(turned, json);
    /* A side that is not given has no limit. The scene is less than 9 m long. */
    next_within(&r, beside, "middle_x_m=1&middle_y_m=4&half_x_m=9&half_y_m=1&half_z_m=9", json);
    next_within(&r, beside, "middle_x_m=1&middle_y_m=4&half_y_m=1", turned);
    assert_string_equal(turned, json);
    preview_release(r.preview, leg.bytes);
    room_close(&r);
}

/* Every part of a closed room is seen from some of its places, except near walls. Near walls the ground and the ceiling
 * lie within the cones that heads can't scan, and few places are far enough away. A body in the room is hidden
 * within. */
static void test_reach(void **state)
{
    (void)state;
    struct room r = room_open("");
    struct web_body cells = room_need(&r, "/cells", "");
    struct web_body leg = see_leg(&r);
    char query[64];
    snprintf(query, sizeof query, "station=1&height_m=1.2&p1=%u", le_get32(leg.bytes + 8));
    struct web_body reach = room_need(&r, "/reach", query);
    const uint32_t n = le_get32(reach.bytes + 8);
    double hidden_m2 = 0.0;
    assert_memory_equal(reach.bytes, "SHRE", 4);
    assert_int_equal(reach.len, 16 + 8 * (((size_t)n + 63) / 64));
    assert_true(le_get32(reach.bytes + 12) > 50);
    for (uint32_t i = 0; i < n; i++)
        if ((le_get64(reach.bytes + 16 + 8 * (i / 64)) >> i % 64 & 1) == 0)
            hidden_m2 += (double)le_get_float(cells.bytes + 48 + 4 * i);
    assert_true(hidden_m2 < 0.01 * ROOM_AREA_M2);
    preview_release(r.preview, cells.bytes);
    preview_release(r.preview, leg.bytes);
    preview_release(r.preview, reach.bytes);
    room_close(&r);
}

/* Places that are asked for while a search is on are answered, and so is the search in the end. */
static void test_search_gives_way(void **state)
{
    (void)state;
    struct room r = room_open("");
    struct web_body body, reach;
    char query[96];
    assert_int_equal(preview_get(r.preview, "/reach", "station=1&height_m=1.2", &body, &err), SH_OK);
    for (int i = 0; i < 20; i++) {
        preview_release(r.preview, body.bytes);
        snprintf(query, sizeof query, "station=1&x_m=%g&y_m=1&z_m=1.2&heading_deg=0", 1.0 + 0.1 * i);
        body = room_need(&r, "/preview", query);
        assert_int_equal(le_get32(body.bytes + 16), 50 * 180);
    }
    preview_release(r.preview, body.bytes);
    reach = room_need(&r, "/reach", "station=1&height_m=1.2");
    assert_true(le_get32(reach.bytes + 12) > 50);
    preview_release(r.preview, reach.bytes);
    room_close(&r);
}

static void ask_dragged(struct room *r, int i, int waits)
{
    struct web_body body;
    char query[96];
    snprintf(query, sizeof query, "station=1&x_m=%g&y_m=1&z_m=1.2&heading_deg=0&step_deg=%d", 1.0 + 0.01 * i,
             waits ? 4 : 1);
    if (waits)
        body = room_need(r, "/preview", query);
    else
        assert_int_equal(preview_get(r->preview, "/preview", query, &body, &err), SH_OK);
    preview_release(r->preview, body.bytes);
}

/* Pages that drag on and on neither keep the suggestion of another page waiting, nor take its preview out. 64 answers
 * are kept, and that preview is the oldest of 62 when the search is asked for. In each round three places are asked
 * for, and only the last one is waited for. So there is always work that could delay the search. */
static void test_drag_beside_search(void **state)
{
    (void)state;
    enum { KEPT = 61, ROUNDS = 20 };
    struct room r = room_open("");
    struct web_body leg = see_leg(&r);
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
    room_close(&r);
}

/* The bottom of a closed body lies on the ground. The bottom is seen only from within the body, where nobody stands. */
static void test_bodies(void **state)
{
    (void)state;
    struct room r = room_open_with("", ROOM_BODY);
    struct web_body cells = room_need(&r, "/cells", "");
    struct web_body leg =
        room_need(&r, "/preview", "station=1&x_m=1&y_m=1&z_m=1.2&heading_deg=0&step_deg=0.5&points=0");
    char query[64];
    snprintf(query, sizeof query, "station=1&height_m=1.2&p1=%u", le_get32(leg.bytes + 8));
    struct web_body reach = room_need(&r, "/reach", query);
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
    room_close(&r);
}

/* All readers of an answer share it. They keep it when 64 later answers have taken its slot. */
static void test_shared(void **state)
{
    (void)state;
    static const char query[] = "station=1&x_m=5&y_m=1&z_m=1.2&heading_deg=0";
    struct room r = room_open("");
    struct web_body one = room_need(&r, "/preview", query), two = room_need(&r, "/preview", query);
    assert_ptr_equal(one.bytes, two.bytes);
    for (int i = 0; i < 64; i++)
        ask_dragged(&r, i, 1);
    struct web_body again = room_need(&r, "/preview", query);
    assert_ptr_not_equal(one.bytes, again.bytes);
    preview_release(r.preview, two.bytes);
    assert_int_equal(le_get32(one.bytes + 16), le_get32(again.bytes + 16));
    preview_release(r.preview, one.bytes);
    preview_release(r.preview, again.bytes);
    room_close(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_next),
        cmocka_unit_test(test_next_in_section),
        cmocka_unit_test(test_reach),
        cmocka_unit_test(test_search_gives_way),
        cmocka_unit_test(test_drag_beside_search),
        cmocka_unit_test(test_shared),
        cmocka_unit_test(test_bodies),
    };
    return cmocka_run_group_tests(tests, site_rig_setup, site_rig_teardown);
}
