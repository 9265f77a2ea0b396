/* SPDX-License-Identifier: MIT */
/* The XML section of E57 files, element by element, against the elements of ASTM E2807 that a file of ours has. A small
 * reader of this test takes the text apart. The reader fails where tags are not in pairs. */
#include <ctype.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/record/crs_wkt.h"
#include "drivers/record/e57_xml.h"

enum { MAX_DEPTH = 8, MAX_ELEMENTS = 160 };

/* An element is a line: its depth, its tag with attributes, and the text of one that has no children. */
static char got[MAX_ELEMENTS][1700];
static int n_got;

/* A guid has the form of a UUID of version 8, variant 10 (RFC 9562), in braces. The text {} takes the guid's place. */
static void hide_guid(char *text)
{
    static const char form[] = "{xxxxxxxx-xxxx-8xxx-vxxx-xxxxxxxxxxxx}";
    assert_int_equal(strlen(text), sizeof form - 1);
    for (size_t i = 0; form[i] != 0; i++) {
        const int c = text[i];
        assert_true(form[i] == 'x'   ? isxdigit(c) && !isupper(c)
                    : form[i] == 'v' ? strchr("89ab", c) != NULL
                                     : c == form[i]);
    }
    strcpy(text, "{}");
}

static void take_apart(char *xml)
{
    char name[MAX_DEPTH][40];
    int depth = 0, is_leaf = 0;
    n_got = 0;
    for (char *at = strchr(xml, '\n'); *at != 0;) {
        char *tag = strchr(at, '<');
        if (tag == NULL) break;
        *tag++ = 0;
        char *end = strchr(tag, '>');
        assert_non_null(end);
        *end = 0;
        if (*tag == '/') {
            assert_true(depth > 0);
            assert_string_equal(tag + 1, name[--depth]);
            if (is_leaf && strcmp(name[depth], "guid") == 0) hide_guid(at);
            if (is_leaf) strcat(strcat(got[n_got - 1], "="), at);
            is_leaf = 0;
        } else {
            assert_true(depth < MAX_DEPTH && n_got < MAX_ELEMENTS);
            snprintf(name[depth], sizeof name[depth], "%.*s", (int)strcspn(tag, " "), tag);
            snprintf(got[n_got++], sizeof got[0], "%d %s", depth++, tag);
            is_leaf = 1;
        }
        at = end + 1;
    }
    assert_int_equal(depth, 0);
}

#define INTEGER(low, high) " type=\"Integer\" minimum=\"" low "\" maximum=\"" high "\"=0"
#define COORDINATE(axis, step)                                                                                \
    "5 cartesian" axis " type=\"ScaledInteger\" minimum=\"-2147483648\" maximum=\"2147483647\" scale=\"" step \
    "\" offset=\"0\"=0"

/* Elements of a root, of a scan's pose, and of a prototype's end are the same in both files. */
#define ROOT                                                                                                             \
    "0 e57Root type=\"Structure\" xmlns=\"http://www.astm.org/COMMIT/E57/2010-e57-v1.0\" xmlns:sh=\"urn:scanhead:e57\"", \
        "1 formatName type=\"String\"=ASTM E57 3D Imaging Data File", "1 guid type=\"String\"={}",                       \
        "1 versionMajor type=\"Integer\"=1", "1 versionMinor type=\"Integer\"=0",                                        \
        "1 e57LibraryVersion type=\"String\"=scanhead"
#define POSE                                                                                                          \
    "3 pose type=\"Structure\"", "4 rotation type=\"Structure\"", "5 w type=\"Float\"=0", "5 x type=\"Float\"=0",     \
        "5 y type=\"Float\"=0", "5 z type=\"Float\"=1", "4 translation type=\"Structure\"", "5 x type=\"Float\"=0.5", \
        "5 y type=\"Float\"=-2", "5 z type=\"Float\"=0.25"
#define INTENSITY                                                                                            \
    "5 intensity type=\"ScaledInteger\" minimum=\"-32768\" maximum=\"32767\" scale=\"0.01\" offset=\"0\"=0", \
        "5 isIntensityInvalid" INTEGER("0", "1")
#define PROTOTYPE_END                                                                        \
    "5 timeStamp type=\"Float\" precision=\"double\"=0", "5 returnIndex" INTEGER("0", "15"), \
        "5 returnCount" INTEGER("0", "15"), "5 rowIndex" INTEGER("0", "4294967295"),         \
        "5 columnIndex" INTEGER("0", "4294967295"), "5 sh:label" INTEGER("0", "65535"),      \
        "4 codecs type=\"Vector\" allowHeterogeneousChildren=\"1\"="
#define DATA   "1 data3D type=\"Vector\" allowHeterogeneousChildren=\"1\""
#define IMAGES "1 images2D type=\"Vector\" allowHeterogeneousChildren=\"1\"="

static void compare(const struct e57_facts *facts, const char *const *want)
{
    struct sh_err err = {0};
    size_t len;
    char *text;
    assert_int_equal(e57_xml(facts, &text, &len, &err), 0);
    assert_int_equal(strlen(text), len);
    assert_memory_equal(text, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n", 39);
    take_apart(text);
    for (int i = 0; i < n_got; i++) {
        assert_non_null(want[i]);
        assert_string_equal(got[i], want[i]);
    }
    assert_null(want[n_got]);
    free(text);
}

/* Half a turn about z is the quaternion (0, 0, 0, 1). Offsets in the file count 4 bytes more for each 1020 before them.
 */
static const struct e57_scan plain = {
    .note = 100,
    .section = 1020 + 30,
    .number = 1,
    .station = 7,
    .idn = "A,<&>\x01\x7f,\xc3",
    .profile = "tls",
    .pose = {{0.5, -2, 0.25}, {-1, 0, 0, 0, -1, 0, 0, 0, 1}},
    .scale_m = 0.5,
};

static void test_least(void **state)
{
    (void)state;
    static const char *const want[] = {
        ROOT,
        DATA,
        "2 vectorChild type=\"Structure\"",
        "3 guid type=\"String\"={}",
        "3 name type=\"String\"=scan 1, station 7",
        "3 description type=\"String\"=A,&#60;&#38;&#62;??,?",
        "3 sensorModel type=\"String\"=tls",
        POSE,
        "3 sh:begin type=\"Blob\" fileOffset=\"100\" length=\"272\"=", /* of the note's 288 the header takes 16 */
        "3 points type=\"CompressedVector\" fileOffset=\"1054\" recordCount=\"0\"",
        "4 prototype type=\"Structure\"",
        COORDINATE("X", "0.5"),
        COORDINATE("Y", "0.5"),
        COORDINATE("Z", "0.5"),
        INTENSITY,
        PROTOTYPE_END,
        IMAGES,
        NULL};
    struct e57_scan scan = plain;
    compare(&(struct e57_facts){.scan = &scan, .n_scans = 1}, want);
}

/* Only the last scan of an incomplete file lacks its end. */
static void test_all(void **state)
{
    (void)state;
    char metadata[CRS_WKT_MAX + 64];
    const char *const want[] = {ROOT,
                                "1 creationDateTime type=\"Structure\"",
                                "2 dateTimeValue type=\"Float\"=1400000000.5",
                                "2 isAtomicClockReferenced type=\"Integer\"=0",
                                metadata,
                                DATA,
                                "2 vectorChild type=\"Structure\"",
                                "3 guid type=\"String\"={}",
                                "3 name type=\"String\"=scan 1, station 7",
                                "3 description type=\"String\"=A,&#60;&#38;&#62;??,?",
                                "3 sensorModel type=\"String\"=tls",
                                POSE,
                                "3 acquisitionStart type=\"Structure\"",
                                "4 dateTimeValue type=\"Float\"=1400000000.5",
                                "4 isAtomicClockReferenced type=\"Integer\"=0",
                                "3 cartesianBounds type=\"Structure\"",
                                "4 xMinimum type=\"Float\"=-0.5",
                                "4 xMaximum type=\"Float\"=2",
                                "4 yMinimum type=\"Float\"=-1",
                                "4 yMaximum type=\"Float\"=2.5",
                                "4 zMinimum type=\"Float\"=-1.5",
                                "4 zMaximum type=\"Float\"=3",
                                "3 indexBounds type=\"Structure\"",
                                "4 rowMinimum type=\"Integer\"=11",
                                "4 rowMaximum type=\"Integer\"=12",
                                "4 columnMinimum type=\"Integer\"=13",
                                "4 columnMaximum type=\"Integer\"=4294967295",
                                "4 returnMinimum type=\"Integer\"=0",
                                "4 returnMaximum type=\"Integer\"=14",
                                "3 intensityLimits type=\"Structure\"",
                                "4 intensityMinimum type=\"Float\"=-12.5",
                                "4 intensityMaximum type=\"Float\"=3.25",
                                "3 colorLimits type=\"Structure\"",
                                "4 colorRedMinimum type=\"Integer\"=0",
                                "4 colorRedMaximum type=\"Integer\"=255",
                                "4 colorGreenMinimum type=\"Integer\"=0",
                                "4 colorGreenMaximum type=\"Integer\"=255",
                                "4 colorBlueMinimum type=\"Integer\"=0",
                                "4 colorBlueMaximum type=\"Integer\"=255",
                                "3 sh:begin type=\"Blob\" fileOffset=\"2048\" length=\"272\"=",
                                "3 points type=\"CompressedVector\" fileOffset=\"4098\" recordCount=\"5000000000\"",
                                "4 prototype type=\"Structure\"",
                                COORDINATE("X", "0.5"),
                                COORDINATE("Y", "0.5"),
                                COORDINATE("Z", "0.5"),
                                "5 cartesianInvalidState" INTEGER("0", "2"),
                                INTENSITY,
                                "5 colorRed" INTEGER("0", "255"),
                                "5 colorGreen" INTEGER("0", "255"),
                                "5 colorBlue" INTEGER("0", "255"),
                                PROTOTYPE_END,
                                IMAGES,
                                NULL};
    struct e57_scan scan = plain, *s = &scan;
    s->have_start = s->have_intensity = 1;
    s->start_gps_s = 1400000000.5;
    s->note = 2 * 1020;
    s->section = 4 * 1020 + 2;
    s->n_records = 5000000000;
    s->n_points = 1;
    for (int k = 0; k < 3; k++) {
        s->min[k] = -1 - k;
        s->max[k] = 4 + k;
    }
    s->intensity_min_cdb = -1250;
    s->intensity_max_cdb = 325;
    s->row_min = 11;
    s->row_max = 12;
    s->column_min = 13;
    s->column_max = UINT32_MAX;
    s->return_max = 14;
    strcpy(metadata, "1 coordinateMetadata type=\"String\"=");
    assert_true(crs_wkt(32632, 1, metadata + strlen(metadata)) > 0);
    struct e57_facts facts = {
        .epsg = 32632, .geoid_heights = 1, .empty_shots = 1, .has_colours = 1, .scan = &scan, .n_scans = 1};
    compare(&facts, want);
}

static void test_incomplete(void **state)
{
    (void)state;
    struct e57_scan scan[2] = {plain, plain};
    const char *of_scan[2];
    int n = 0;
    scan[1].number = 2;
    scan[1].station = 9;
    const struct e57_facts facts = {.is_incomplete = 1, .scan = scan, .n_scans = 2};
    struct sh_err err = {0};
    size_t len;
    char *text;
    assert_int_equal(e57_xml(&facts, &text, &len, &err), 0);
    take_apart(text);
    free(text);
    for (int i = 0; i < n_got; i++)
        if (strncmp(got[i], "3 description", 13) == 0 && n < 2) {
            assert_string_equal(got[i - 1], n == 0 ? "3 name type=\"String\"=scan 1, station 7"
                                                   : "3 name type=\"String\"=scan 2, station 9");
            of_scan[n++] = got[i];
        }
    assert_int_equal(n, 2);
    assert_string_equal(of_scan[0], "3 description type=\"String\"=A,&#60;&#38;&#62;??,?");
    assert_string_equal(of_scan[1],
                        "3 description type=\"String\"=A,&#60;&#38;&#62;??,?; repaired: its end is missing");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_least),
        cmocka_unit_test(test_all),
        cmocka_unit_test(test_incomplete),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
