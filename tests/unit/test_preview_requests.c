/* SPDX-License-Identifier: MIT */
/* A page asks for previews by queries: each word is a figure of the request, with its default and its limits. A
 * previewed head looks where it is asked to. */
#include "firmware_sim/app/studio/preview/inside.h"
#include "tests/unit/preview_room.h"
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/bytes.h"

static struct room room;

static int open_room(void **state)
{
    if (site_rig_setup(state) != 0) return -1;
    room = room_open_with("", ROOM_BODY);
    return 0;
}

static int close_room(void **state)
{
    room_close(&room);
    return site_rig_teardown(state);
}

static int read_request(const char *path, const char *query, struct preview_request *r)
{
    const struct preview_options options = {.cfg = cfg, .site = room.site, .coverage = room.coverage};
    err.text[0] = '\0';
    return preview_read_request(&options, path, query, r, &err);
}

static void need_request(const char *path, const char *query, struct preview_request *r)
{
    if (read_request(path, query, r) != SH_OK) fail_msg("%s?%s: %s", path, query, err.text);
}

static void each_word_is_a_figure(void **state)
{
    struct preview_request r;
    (void)state;
    need_request("/preview",
                 "station=2&x_m=1.5&y_m=-2&z_m=3&heading_deg=4&pitch_deg=5&roll_deg=-6&step_deg=7&far_m=8&"
                 "line0_deg=-9&line1_deg=10&pan0_deg=11&pan1_deg=12&points=0",
                 &r);
    assert_true(r.kind == PREVIEW_PLACE && r.station == 1 && r.points == 0);
    assert_true(r.place.position_m[0] == 1.5 && r.place.position_m[1] == -2.0 && r.place.position_m[2] == 3.0);
    assert_true(r.place.heading_deg == 4.0 && r.place.pitch_deg == 5.0 && r.place.roll_deg == -6.0);
    assert_true(r.step_deg == 7.0 && r.far_m == 8.0 && r.line_deg[0] == -9.0 && r.line_deg[1] == 10.0);
    assert_true(r.pan_deg[0] == 11.0 && r.pan_deg[1] == 12.0);
    need_request("/preview", "station=1&x_m=0&y_m=0&z_m=0&heading_deg=0", &r);
    assert_true(r.station == 0 && r.points == 1 && r.place.pitch_deg == 0.0 && r.place.roll_deg == 0.0);
    assert_true(isinf(r.far_m) && isinf(r.line_deg[0]) && isinf(r.line_deg[1]) && isinf(r.pan_deg[0]));
    assert_true(isinf(r.pan_deg[1]) && r.step_deg == 2.0);
    need_request("/cells", "", &r);
    assert_int_equal(r.kind, PREVIEW_CELLS);
    assert_int_equal(read_request("/cells", "x=1", &r), SH_EINPUT);
    assert_string_equal(err.text, "x: unknown; allowed nothing after ?");
    assert_int_equal(read_request("/other", "", &r), SH_EINPUT);
}

/* Up to 16 previews are named, by words that may leave numbers out. */
static void a_search_has_named_previews_and_a_section(void **state)
{
    struct preview_request r;
    (void)state;
    need_request(
        "/next",
        "station=2&height_m=1.25&p1=7&p3=8&p16=9&middle_x_m=1&middle_y_m=-2&middle_z_m=3&half_x_m=4&half_y_m=5&"
        "half_z_m=6&turn_deg=-30",
        &r);
    assert_true(r.kind == PREVIEW_NEXT && r.station == 1 && r.height_m == 1.25 && r.n_named == 3);
    assert_true(r.named[0] == 7 && r.named[1] == 8 && r.named[2] == 9);
    for (int i = 0; i < 3; i++)
        assert_true(r.section.middle_m[i] == (i == 1 ? -2 : i + 1) && r.section.half_m[i] == 4 + i);
    assert_true(r.section.heading_deg == -30.0 && isinf(r.far_m) && isinf(r.line_deg[0]) && isinf(r.pan_deg[1]));
    need_request("/next", "station=1", &r);
    assert_true(r.n_named == 0 && r.height_m == 1.6 && r.section.heading_deg == 0.0);
    for (int i = 0; i < 3; i++)
        assert_true(r.section.middle_m[i] == 0.0 && isinf(r.section.half_m[i]));
    need_request("/reach", "station=1&p2=5", &r);
    assert_true(r.kind == PREVIEW_REACH && r.n_named == 1 && r.named[0] == 5 && isinf(r.section.half_m[2]));
    assert_int_equal(read_request("/reach", "station=1&turn_deg=1", &r), SH_EINPUT); /* it has no section */
}

/* Both ends of a word's range are allowed, and nothing beyond. */
static void words_have_limits(void **state)
{
    static const struct {
        const char *path, *word, *low, *high, *below, *above, *says;
    } rows[] = {{"/preview", "station", "1", "2", "0", "3", "whole numbers from 1 to 2"},
                {"/preview", "x_m", "-1e+09", "1e9", "-1.1e9", "1.1e9", "numbers from -1000000000 to 1000000000"},
                {"/preview", "y_m", "-1e+09", "1e9", "-1.1e9", "1.1e9", "numbers from -1000000000 to 1000000000"},
                {"/preview", "z_m", "-1e+09", "1e9", "-1.1e9", "nan", "numbers from -1000000000 to 1000000000"},
                {"/preview", "heading_deg", "-360", "360", "-361", "361", "numbers from -360 to 360"},
                {"/preview", "pitch_deg", "-90", "90", "-91", "91", "numbers from -90 to 90"},
                {"/preview", "roll_deg", "-180", "180", "-181", "181", "numbers from -180 to 180"},
                {"/preview", "far_m", "0.01", "1e9", "0.009", "1.1e9", "numbers from 0.01 to 1000000000"},
                {"/preview", "line0_deg", "-360", "360", "-361", "361", "numbers from -360 to 360"},
                {"/preview", "line1_deg", "-360", "360", "-361", "361", "numbers from -360 to 360"},
                {"/preview", "pan0_deg", "-360", "360", "-361", "361", "numbers from -360 to 360"},
                {"/preview", "pan1_deg", "-360", "720", "-361", "721", "numbers from -360 to 720"},
                {"/preview", "points", "0", "1", "-1", "2", "whole numbers from 0 to 1"},
                {"/preview", "points", "0", "1", "0.5", "", "whole numbers from 0 to 1"},
                {"/next", "height_m", "0", "1000", "-1", "1001", "numbers from 0 to 1000"},
                {"/next", "p16", "1", "4294967295", "0", "4294967296", "whole numbers from 1 to 4294967295"},
                {"/next", "middle_z_m", "-1e9", "1e9", "-1.1e9", "1.1e9", "numbers from -1000000000 to 1000000000"},
                {"/next", "half_x_m", "0", "1e9", "-1", "1.1e9", "numbers from 0 to 1000000000"},
                {"/next", "turn_deg", "-360", "360", "-361", "361", "numbers from -360 to 360"}};
    static const char *const others[] = {"station", "x_m", "y_m", "z_m", "heading_deg"};
    struct preview_request r;
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const char *const value[] = {rows[i].low, rows[i].high, rows[i].below, rows[i].above};
        for (int k = 0; k < 4; k++) {
            char query[256], want[160];
            size_t n = (size_t)snprintf(query, sizeof query, "%s=%s", rows[i].word, value[k]);
            const int n_others = rows[i].path[1] == 'p' ? 5 : 1;
            for (int o = 0; o < n_others; o++)
                if (strcmp(others[o], rows[i].word) != 0)
                    n += (size_t)snprintf(query + n, sizeof query - n, "&%s=1", others[o]);
            const int rc = read_request(rows[i].path, query, &r);
            if ((rc == SH_OK) != (k < 2)) fail_msg("%s?%s: %s", rows[i].path, query, err.text);
            snprintf(want, sizeof want, "%s=%s: allowed %s", rows[i].word, value[k], rows[i].says);
            if (k >= 2) assert_string_equal(err.text, want);
        }
    }
}

static const char *xyz_of(const struct web_body *b)
{
    return b->bytes + 72 + 8 * (((size_t)le_get32(b->bytes + 12) + 63) / 64);
}

/* Half of the pan is on the side to which the head is turned: x from 0 on is east, and heading 180 makes it west. With
 * a pitch of 90 degrees the front is up. */
static void the_head_looks_where_it_is_asked(void **state)
{
    static const struct {
        const char *query;
        int axis, sign;
    } rows[] = {{"heading_deg=0&pan0_deg=5&pan1_deg=170", 0, 1},
                {"heading_deg=180&pan0_deg=5&pan1_deg=170", 0, -1},
                {"heading_deg=90&pan0_deg=5&pan1_deg=170", 1, -1},
                {"heading_deg=0&pitch_deg=90&pan0_deg=0&pan1_deg=60&line0_deg=-10&line1_deg=10", 2, 1},
                {"heading_deg=0&roll_deg=90&pan0_deg=30&pan1_deg=150&line0_deg=-10&line1_deg=10", 2, -1}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char query[160];
        snprintf(query, sizeof query, "station=1&x_m=1&y_m=1&z_m=1.2&step_deg=4&%s", rows[i].query);
        struct web_body b = room_need(&room, "/preview", query);
        const uint32_t n = le_get32(b.bytes + 16);
        assert_true(n > 10);
        for (uint32_t k = 0; k < n; k++)
            if (rows[i].sign * (double)le_get_float(xyz_of(&b) + 12 * (size_t)k + 4 * rows[i].axis) < 0.0)
                fail_msg("%s: point %u is on the other side", rows[i].query, k);
        preview_release(room.preview, b.bytes);
    }
}

/* A point has the label of its surface: the body is that between x = 3.1 and 5.1, all else is the room. */
static void points_have_labels(void **state)
{
    (void)state;
    struct web_body b = room_need(&room, "/preview", "station=1&x_m=1&y_m=1&z_m=1.2&heading_deg=0&step_deg=4");
    const uint32_t n = le_get32(b.bytes + 16);
    const char *xyz = xyz_of(&b), *labels = xyz + 16 * (size_t)n;
    uint32_t on_body = 0;
    for (uint32_t k = 0; k < n; k++) {
        double p[3];
        for (int i = 0; i < 3; i++)
            p[i] = (double)le_get_float(xyz + 12 * (size_t)k + 4 * i) + le_get_double(b.bytes + 32 + 8 * i);
        const int is_of_body = p[0] > 3.09 && p[0] < 5.11 && p[1] > 0.19 && p[1] < 1.81 && p[2] > 0.005 && p[2] < 2.31;
        const unsigned label = (uint8_t)labels[2 * k] | (unsigned)(uint8_t)labels[2 * k + 1] << 8;
        assert_int_equal(label, is_of_body);
        on_body += (uint32_t)is_of_body;
    }
    assert_true(on_body > 10 && on_body < n / 2);
    preview_release(room.preview, b.bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_word_is_a_figure), cmocka_unit_test(a_search_has_named_previews_and_a_section),
        cmocka_unit_test(words_have_limits),     cmocka_unit_test(the_head_looks_where_it_is_asked),
        cmocka_unit_test(points_have_labels),
    };
    return cmocka_run_group_tests(tests, open_room, close_room);
}
