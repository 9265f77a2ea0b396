/* SPDX-License-Identifier: MIT */
/* The header of a PLY file, line by line. The header's words are those of the format by Turk; each comment is compared
 * with the facts that were given. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/native.h"
#include "drivers/record/ply_columns.h"
#include "drivers/record/recorder.h"

static struct track track;
static struct ply_facts facts;

static void begin(void)
{
    memset(&track, 0, sizeof track);
    memset(&facts, 0, sizeof facts);
    track.begun = 1;
    facts.track = &track;
    facts.n_heads = 1;
    facts.head[0] = (struct ply_head){7, "a,b,c,d", "tls"};
}

static void expect(const char *want)
{
    struct sh_err err = {0};
    char *text;
    size_t len;
    uint64_t n_left_out;
    assert_int_equal(ply_header_make(&facts, 0, &text, &len, &n_left_out, &err), 0);
    assert_int_equal(len, strlen(text));
    assert_int_equal(n_left_out, 0);
    assert_string_equal(text, want);
    free(text);
}

#define FRONT(format, crs, epsg) \
    "ply\nformat " format " 1.0\ncomment crs " crs "\ncomment epsg " epsg "\ncomment idn a,b,c,d\ncomment profile tls\n"
#define METRES "comment x y z range in metres, time in seconds since the scan's start\n"

static void test_all(void **state)
{
    (void)state;
    begin();
    track.moving = 1;
    track.has_attributes = track.has_deviations = track.has_colours = 1;
    track.colour.given = 1;
    track.colour.scale.mode = COLOUR_RANGE;
    track.colour.scale.low = 1.5;
    track.colour.scale.high = 20;
    facts.ascii = facts.empty_shots = facts.have_gps = 1;
    facts.gps_s = 2 * 604800 + 12.25;
    facts.columns = ply_columns_there(&track, 0);
    facts.n_vertices = 5000000000;
    facts.n_unplaced = 11;
    facts.n_without_pose = 12;
    facts.n_without_attributes = 13;
    facts.stats = (struct scanhead_stats){.seq_lost = 1,
                                          .reader_lost = 2,
                                          .dropped = 3,
                                          .bad_payload = 4,
                                          .repeated = 5,
                                          .late = 6,
                                          .restarts = 7,
                                          .refused = 9,
                                          .pulses_lost = 8};
    expect(
        FRONT("ascii", "scene frame, metres", "0") METRES
        "comment the first scan starts at GPS week 2 second 12.250000\n"
        "comment reflectance in dB, nan: not modelled\n"
        "comment amplitude in dB above the detection threshold, width of the echo in ns at half maximum\n"
        "comment points_without_attributes 13\n"
        "comment echo and echo_count 0: shot without echo; label 65535: none\n"
        "comment the head moved, each point has its own pose; frame: frame scalar of the trajectory, nan: lost\n"
        "comment points_without_pose 12\n"
        "comment red green blue show the range, blue is 1.5, red 20 m\n"
        "comment empty_shots kept\n"
        "comment frames_lost 1 reader_lost 2 dropped 3 bad_payload 4\n"
        "comment frames_repeated 5 frames_late 6 restarts 7\n"
        "comment frames_refused 9\n"
        "comment pulses_lost 8 points_before_descriptor 11\n"
        "element vertex 5000000000\n"
        "property double x\nproperty double y\nproperty double z\nproperty double range\nproperty float reflectance\n"
        "property double time\nproperty uchar echo\nproperty uchar echo_count\nproperty ushort label\n"
        "property ushort station\nproperty double frame\nproperty float amplitude\nproperty float width\n"
        "property float deviation\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n");
    assert_int_equal(ply_row_len(facts.columns), 3 * 8 + 8 + 4 + 8 + 2 + 2 + 2 + 8 + 3 * 4 + 3);
}

/* Until a file has its end, its losses are not known. */
static void test_least(void **state)
{
    (void)state;
    begin();
    track.crs = NATIVE_CRS_UTM;
    track.epsg = 32632;
    track.stops = 1;
    facts.incomplete = 1;
    facts.columns = ply_columns_there(&track, PLY_XYZ | PLY_FLOAT);
    expect("ply\nformat binary_little_endian 1.0\n"
           "comment incomplete: its end is missing, and losses were not counted\n"
           "comment crs UTM or UPS with ellipsoidal height, metres\ncomment epsg 32632\ncomment idn a,b,c,d\n"
           "comment profile tls\n" METRES
           "comment the stations are stops on a trajectory; frame: its frame scalar there\n"
           "comment empty_shots left out\nelement vertex 0\n"
           "property float x\nproperty float y\nproperty float z\nend_header\n");
    assert_int_equal(ply_row_len(facts.columns), 12);
}

/* Names for CloudCompare, and two heads. Each has its station in front. */
static void test_names(void **state)
{
    (void)state;
    begin();
    track.crs = NATIVE_CRS_GEODETIC;
    track.epsg = 4979;
    track.geoid_heights = 1;
    facts.scalar_names = 1;
    facts.n_heads = 2;
    facts.head[1] = (struct ply_head){8, "e,f,g,h", "other"};
    facts.columns = ply_columns_there(&track, PLY_ECHO | PLY_RANGE | PLY_FRAME | PLY_COLOUR | PLY_ATTRIBUTES);
    expect("ply\nformat binary_little_endian 1.0\n"
           "comment crs latitude and longitude in degrees, height above the geoid in metres\ncomment epsg 4979\n"
           "comment station 7 idn a,b,c,d\ncomment station 7 profile tls\n"
           "comment station 8 idn e,f,g,h\ncomment station 8 profile other\n"
           "comment x latitude, y longitude in degrees, z range in metres, time in seconds since the scan's start\n"
           "comment echo and echo_count 0: shot without echo; label 65535: none\n"
           "comment empty_shots left out\n"
           "comment frames_lost 0 reader_lost 0 dropped 0 bad_payload 0\n"
           "comment pulses_lost 0 points_before_descriptor 0\n"
           "element vertex 0\nproperty double x\nproperty double y\nproperty double z\n"
           "property double scalar_range\nproperty uchar scalar_echo\nproperty uchar scalar_echo_count\nend_header\n");
}

static char *made(void)
{
    struct sh_err err = {0};
    char *text;
    size_t len;
    uint64_t n_left_out;
    assert_int_equal(ply_header_make(&facts, 0, &text, &len, &n_left_out, &err), 0);
    return text;
}

static void expect_line(const char *line, int is_there)
{
    char *text = made();
    if ((strstr(text, line) != NULL) != is_there) fail_msg("%s\n%s", line, text);
    free(text);
}

static void test_single_lines(void **state)
{
    (void)state;
    static const struct {
        int given;
        enum colour_mode mode;
        const char *line;
    } colours[] = {
        {0, COLOUR_NONE, "comment red green blue as the head sent them (output.colour)\n"},
        {1, COLOUR_SOLID, "comment red green blue are one colour for all\n"},
        {1, COLOUR_LABEL, "comment red green blue show the label\n"},
        {1, COLOUR_REFLECTANCE, "show the reflectance, black is -30 dB, white 0 dB, blue not modelled\n"},
        {1, COLOUR_HEIGHT, "comment red green blue show the height, blue is -1, red 2.5 m\n"},
        {1, COLOUR_FRAME, "comment red green blue show the frame, blue is -1, red 2.5\n"},
    };
    begin();
    track.has_colours = 1;
    track.colour.scale.low = -1;
    track.colour.scale.high = 2.5;
    facts.columns = ply_columns_there(&track, PLY_COLOUR);
    for (size_t i = 0; i < sizeof colours / sizeof colours[0]; i++) {
        track.colour.given = colours[i].given;
        track.colour.scale.mode = colours[i].mode;
        expect_line(colours[i].line, 1);
    }
    /* Each of the three counts alone gives their line. */
    uint64_t *const count[] = {&facts.stats.repeated, &facts.stats.late, &facts.stats.restarts};
    expect_line("frames_repeated", 0);
    for (int i = 0; i < 3; i++) {
        *count[i] = 1;
        expect_line(i == 0   ? "comment frames_repeated 1 frames_late 0 restarts 0\n"
                    : i == 1 ? "comment frames_repeated 0 frames_late 1 restarts 0\n"
                             : "comment frames_repeated 0 frames_late 0 restarts 1\n",
                    1);
        *count[i] = 0;
    }
    facts.stats.repeated = facts.stats.late = 1;
    expect_line("comment frames_repeated 1 frames_late 1 restarts 0\n", 1);
    facts.columns = ply_columns_there(&track, PLY_LABEL);
    expect_line("comment echo and echo_count 0: shot without echo; label 65535: none\n", 1);
    expect_line("comment red", 0);
    facts.columns = ply_columns_there(&track, PLY_STATION);
    expect_line("comment echo", 0);
    track.begun = 0;
    expect_line("comment crs unknown, no points were recorded\n", 1);
}

/* The header has room for as many heads as were announced, each with the longest names, and for all that is known at
 * the end alone: figures of 20 digits, the time, and frames that were not in order. */
static void test_room(void **state)
{
    (void)state;
    struct sh_err err = {0};
    char *text;
    size_t len;
    uint64_t n_left_out;
    static const uint32_t n_heads[] = {1, 2, PLY_MAX_HEADS};
    for (size_t k = 0; k < sizeof n_heads / sizeof n_heads[0]; k++) {
        const uint32_t n = n_heads[k];
        begin();
        track.moving = track.has_attributes = 1;
        facts.columns = ply_columns_there(&track, 0);
        facts.more_heads = n - 1;
        for (uint32_t i = 0; i < n; i++) {
            facts.head[i].station = 65535 - i;
            memset(facts.head[i].idn, 'i', sizeof facts.head[i].idn - 1);
            memset(facts.head[i].profile, 'p', sizeof facts.head[i].profile - 1);
        }
        const size_t room = ply_header_reserve(&facts, 0);
        facts.n_heads = n;
        facts.stats.seq_lost = facts.stats.reader_lost = facts.stats.dropped = facts.stats.bad_payload = UINT64_MAX;
        facts.stats.repeated = facts.stats.late = facts.stats.restarts = facts.stats.pulses_lost = facts.n_unplaced =
            UINT64_MAX;
        facts.n_vertices = facts.n_without_attributes = facts.n_without_pose = UINT64_MAX;
        facts.have_gps = 1;
        facts.gps_s = 604800.0 * 9999 + 604799.999999;
        assert_int_equal(ply_header_make(&facts, room, &text, &len, &n_left_out, &err), 0);
        assert_int_equal(len, room);
        assert_int_equal(n_left_out, 0);
        free(text);
    }
}

/* A week has the seconds 0 to 604,799. A time just before its end, to a microsecond, is the begin of the next. */
static void test_weeks(void **state)
{
    (void)state;
    static const struct {
        double second;
        const char *text;
    } rows[] = {{604799.9999997, "GPS week 2400 second 0.000000\n"},
                {604799.999999, "GPS week 2399 second 604799.999999\n"},
                {0.0, "GPS week 2399 second 0.000000\n"},
                {12.25, "GPS week 2399 second 12.250000\n"}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct sh_err err;
        char *text;
        size_t len;
        uint64_t n_left_out;
        begin();
        facts.have_gps = 1;
        facts.gps_s = 2399 * 604800.0 + rows[i].second;
        assert_int_equal(ply_header_make(&facts, 0, &text, &len, &n_left_out, &err), 0);
        if (strstr(text, rows[i].text) == NULL) fail_msg("case %zu: %s", i, text);
        free(text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_all),          cmocka_unit_test(test_least), cmocka_unit_test(test_names),
        cmocka_unit_test(test_single_lines), cmocka_unit_test(test_room),  cmocka_unit_test(test_weeks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
