/* SPDX-License-Identifier: MIT */
/* The contents of CRS texts and LAS 1.2's keys: meridians, false origins, axes, codes and kinds of heights (EPSG). */
#include "drivers/record/crs_wkt.h"
#include "drivers/record/las_header.h"
#include "tests/unit/recorder_rig.h"

static void expect(int epsg, int geoid, const char *part)
{
    char text[CRS_WKT_MAX];
    crs_wkt(epsg, geoid, text);
    if (strstr(text, part) == NULL) fail_msg("EPSG %d: no %s in %s", epsg, part, text);
}

/* The text must name the first axis before the second one. */
static void expect_order(int epsg, const char *first, const char *second)
{
    char text[CRS_WKT_MAX];
    crs_wkt(epsg, 0, text);
    const char *a = strstr(text, first), *b = strstr(text, second);
    if (a == NULL || b == NULL || a > b) fail_msg("EPSG %d: %s, then %s: %s", epsg, first, second, text);
}

static void test_wkt(void **state)
{
    (void)state;
    expect(32601, 0, "PARAMETER[\"central_meridian\",-177]");
    expect(32660, 0, "PARAMETER[\"central_meridian\",177]");
    expect(32633, 0, "PARAMETER[\"central_meridian\",15],PARAMETER[\"scale_factor\",0.9996]");
    expect(32633, 0, "PARAMETER[\"false_easting\",500000],PARAMETER[\"false_northing\",0]");
    expect(32633, 0, "AUTHORITY[\"EPSG\",\"32633\"]");
    expect(32733, 0, "PARAMETER[\"false_easting\",500000],PARAMETER[\"false_northing\",10000000]");
    expect(32733, 0, "AUTHORITY[\"EPSG\",\"32733\"]");
    expect(32733, 0, "zone 33S");
    /* UPS: all axes point away from the pole, so in the northern grid both point south */
    expect(32661, 0, "PARAMETER[\"latitude_of_origin\",90]");
    expect(32661, 0, "AXIS[\"Easting\",SOUTH],AXIS[\"Northing\",SOUTH],AUTHORITY[\"EPSG\",\"5041\"]");
    expect(32761, 0, "PARAMETER[\"latitude_of_origin\",-90]");
    expect(32761, 0, "AXIS[\"Easting\",NORTH],AXIS[\"Northing\",NORTH],AUTHORITY[\"EPSG\",\"5042\"]");
    expect(32761, 0, "PARAMETER[\"scale_factor\",0.994],PARAMETER[\"false_easting\",2000000]");
    expect_order(4979, "AXIS[\"Longitude\",EAST]", "AXIS[\"Latitude\",NORTH]");
    for (int i = 0; i < 3; i++) {
        static const int epsg[] = {32633, 32761, 4979};
        expect(epsg[i], 0, "VERT_CS[\"Ellipsoid (metre)\",VERT_DATUM[\"Ellipsoid\",2002]");
        expect(epsg[i], 1, "VERT_CS[\"EGM96 height\",VERT_DATUM[\"EGM96 geoid\",2005");
        expect(epsg[i], 1, "AUTHORITY[\"EPSG\",\"5773\"]");
    }
}

/* Returns the value of a GeoTIFF key (OGC 19-008); 0: it is not there. */
static unsigned key_of(int epsg, int geoid, unsigned key)
{
    static uint8_t front[LAS_FRONT_MAX];
    static struct track track;
    track.epsg = epsg;
    track.geoid_heights = geoid;
    const struct las_facts facts = {.minor = 2, .track = &track, .scale = {1, 1, 1}};
    const size_t len = las_front(&facts, front);
    for (size_t at = LAS_HEADER_12_LEN; at + LAS_VLR_HEAD_LEN <= len;) {
        const uint8_t *content = front + at + LAS_VLR_HEAD_LEN;
        if (rig_uint(front + at + 18, 2) == 34735)
            for (unsigned i = 1; i <= rig_uint(content + 6, 2); i++)
                if (rig_uint(content + 8 * i, 2) == key) return (unsigned)rig_uint(content + 8 * i + 6, 2);
        at += LAS_VLR_HEAD_LEN + rig_uint(front + at + 20, 2);
    }
    return 0;
}

static void test_keys(void **state)
{
    (void)state;
    enum {
        MODEL = 1024,
        GEODETIC = 2048,
        ANGLES = 2054,
        PROJECTED = 3072,
        VERTICAL = 4096,
        METRE = 9001,
        DEGREE = 9102
    };
    static const struct {
        int epsg, geoid;
        unsigned key, value;
    } want[] = {
        {32633, 0, MODEL, 1},
        {32633, 0, PROJECTED, 32633},
        {32633, 0, GEODETIC, 0},
        {32661, 0, PROJECTED, 5041},
        {32761, 0, PROJECTED, 5042},
        {4979, 0, MODEL, 2},
        {4979, 0, GEODETIC, 4326},
        {4979, 0, ANGLES, DEGREE},
        {4979, 0, PROJECTED, 0},
        {4978, 0, MODEL, 3},
        {4978, 0, GEODETIC, 4978},
        {4978, 0, 2052, METRE},
        {4978, 0, VERTICAL, 0},
        {32633, 0, VERTICAL, 5030},
        {32633, 1, VERTICAL, 5773},
        {4979, 1, VERTICAL, 5773},
        {0, 0, MODEL, 0},
    };
    for (size_t i = 0; i < sizeof want / sizeof want[0]; i++) {
        const unsigned value = key_of(want[i].epsg, want[i].geoid, want[i].key);
        if (value != want[i].value)
            fail_msg("EPSG %d: key %u is %u, not %u", want[i].epsg, want[i].key, value, want[i].value);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_wkt), cmocka_unit_test(test_keys)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
