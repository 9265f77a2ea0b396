/* SPDX-License-Identifier: MIT */
/* The note before a scan of an E57 file comes back as it was put. What is no note, or has numbers that no recorder
 * writes, is refused. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "core/bytes.h"
#include "drivers/record/e57_note.h"

static uint8_t note[E57_NOTE_LEN];

static struct e57_scan make_scan(void)
{
    struct e57_scan s = {.number = 3,
                         .station = 4,
                         .scale_m = 0.25,
                         .start_gps_s = 5.5,
                         .pose = {.shift_m = {1, 2, 3}, .rotation = {4, 5, 6, 7, 8, 9, 10, 11, 12}}};
    strcpy(s.idn, "Maker,Model,SN1,1.0");
    strcpy(s.profile, "model");
    return s;
}

static void test_there_and_back(void **state)
{
    (void)state;
    for (int bits = 0; bits < 16; bits++) {
        struct e57_scan scan = make_scan(), got;
        struct e57_facts got_facts;
        const struct e57_facts facts = {
            .epsg = 32632, .geoid_heights = bits & 1, .empty_shots = bits >> 1 & 1, .has_colours = bits >> 2 & 1};
        scan.have_start = bits >> 3;
        e57_note_put(&facts, &scan, note);
        memset(&got, 0, sizeof got);
        memset(&got_facts, 0, sizeof got_facts);
        assert_int_equal(e57_note_get(note, &got_facts, &got), 0);
        assert_int_equal(got_facts.epsg, 32632);
        assert_int_equal(got_facts.geoid_heights, facts.geoid_heights);
        assert_int_equal(got_facts.empty_shots, facts.empty_shots);
        assert_int_equal(got_facts.has_colours, facts.has_colours);
        assert_true(got.number == 3 && got.station == 4 && got.have_start == scan.have_start);
        assert_true(got.scale_m == 0.25 && got.start_gps_s == 5.5);
        assert_memory_equal(&got.pose, &scan.pose, sizeof got.pose);
        assert_string_equal(got.idn, scan.idn);
        assert_string_equal(got.profile, scan.profile);
    }
}

/* Bytes 0 to 23, which are changed here, say that the note is a blob of this length, and ours. Flags after the first
 * four would be of another release. */
static void test_refused(void **state)
{
    (void)state;
    struct e57_scan scan = make_scan(), got;
    struct e57_facts facts = {.epsg = 1};
    static const double scales[] = {0, -1, INFINITY, NAN};
    e57_note_put(&facts, &scan, note);
    assert_int_equal(e57_note_get(note, &facts, &got), 0);
    for (size_t i = 0; i < 16 + 8; i++) {
        note[i] ^= 1;
        assert_int_equal(e57_note_get(note, &facts, &got), -1);
        note[i] ^= 1;
    }
    for (int bit = 4; bit < 32; bit++) {
        const uint32_t bits = le_get32(note + 44);
        le_put32(note + 44, bits | 1u << bit);
        assert_int_equal(e57_note_get(note, &facts, &got), -1);
        le_put32(note + 44, bits);
    }
    for (size_t i = 0; i < sizeof scales / sizeof *scales; i++) {
        le_put_double(note + 48, scales[i]);
        assert_int_equal(e57_note_get(note, &facts, &got), -1);
    }
    le_put_double(note + 48, 1e-3);
    memset(note + 160, 'x', E57_NOTE_LEN - 160); /* texts without an end get one */
    assert_int_equal(e57_note_get(note, &facts, &got), 0);
    assert_int_equal(strlen(got.idn), sizeof got.idn - 1);
    assert_int_equal(strlen(got.profile), sizeof got.profile - 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_there_and_back), cmocka_unit_test(test_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
