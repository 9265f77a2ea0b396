/* SPDX-License-Identifier: MIT */
/* The figures of a recording: each key of --stats, sums of parts, and the messages about what is missing. No two
 * figures are the same, so exchanged ones show. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/app/studio/record/recording.h"

static struct recording_result a_result(void)
{
    return (struct recording_result){
        .points = 1,
        .empty = 2,
        .frames = 3,
        .with_reflectance = 4,
        .counts = {.scans = 5, .pulses = 6000, .fired = 7, .cast = 8, .lost = 9, .left_out = 10, .missing = 11},
        .crowded = 12,
        .faint = 13,
        .unfit = 14,
        .lost_samples = 15,
        .wall_s = 4.0,
        .stream = {.frames = 16,
                   .bytes = 17,
                   .bad_payload = 18,
                   .bad_bytes = 19,
                   .seq_lost = 20,
                   .repeated = 21,
                   .late = 22,
                   .restarts = 23,
                   .dropped = 24,
                   .reader_lost = 25,
                   .refused = 29},
        .sha256 = "12ab",
        .replugs = 26,
        .broken_scans = 27,
        .bus_resets = 28};
}

static void expect(const struct recording_result *result, const char *before_cpu, const char *after_cpu)
{
    struct web_body body;
    struct sh_err err;
    assert_int_equal(page_json(recording_put, result, &body, &err), 0);
    char *cpu = strstr(body.bytes, "\"cpu_s\":"), *rest;
    assert_non_null(cpu);
    assert_true(strtod(cpu + strlen("\"cpu_s\":"), &rest) > 0.0);
    assert_string_equal(rest, after_cpu);
    *cpu = '\0';
    assert_string_equal(body.bytes, before_cpu);
    free(body.bytes);
}

static void each_key(void **state)
{
    struct recording_result result = a_result();
    (void)state;
    expect(&result,
           "{\"points\":1,\"empty_shots\":2,\"pulses\":6000,\"fired_pulses\":7,\"cast_pulses\":8,\"lost_pulses\":9,"
           "\"missing_pulses\":11,\"reader_lost_pulses\":10,\"scans\":5,\"frames\":16,\"bytes\":17,\"bad_payload\":18,"
           "\"bad_bytes\":19,\"seq_lost\":20,\"repeated\":21,\"late\":22,\"restarts\":23,\"refused\":29,\"dropped\":24,"
           "\"reader_lost_frames\":25,\"crowded_echoes\":12,\"faint_hits\":13,\"unfit_echoes\":14,\"lost_samples\":15,"
           "\"replugs\":26,\"bus_resets\":28,\"wall_s\":4,",
           ",\"pulses_per_s\":1500,\"stream_sha256\":\"12ab\"}\n");
    result.counts.unknown = 1; /* then three counts are not known */
    expect(
        &result,
        "{\"points\":1,\"empty_shots\":2,\"pulses\":6000,\"fired_pulses\":null,\"cast_pulses\":null,"
        "\"lost_pulses\":9,\"missing_pulses\":null,\"reader_lost_pulses\":10,\"scans\":5,\"frames\":16,"
        "\"bytes\":17,\"bad_payload\":18,\"bad_bytes\":19,\"seq_lost\":20,\"repeated\":21,\"late\":22,"
        "\"restarts\":23,\"refused\":29,\"dropped\":24,\"reader_lost_frames\":25,\"crowded_echoes\":12,\"faint_hits\":13,"
        "\"unfit_echoes\":14,\"lost_samples\":15,\"replugs\":26,\"bus_resets\":28,\"wall_s\":4,",
        ",\"pulses_per_s\":1500,\"stream_sha256\":\"12ab\"}\n");
    result = (struct recording_result){.points = 1};
    expect(&result,
           "{\"points\":1,\"empty_shots\":0,\"pulses\":0,\"fired_pulses\":0,\"cast_pulses\":0,\"lost_pulses\":0,"
           "\"missing_pulses\":0,\"reader_lost_pulses\":0,\"scans\":0,\"frames\":0,\"bytes\":0,\"bad_payload\":0,"
           "\"bad_bytes\":0,\"seq_lost\":0,\"repeated\":0,\"late\":0,\"restarts\":0,\"refused\":0,\"dropped\":0,"
           "\"reader_lost_frames\":0,\"crowded_echoes\":0,\"faint_hits\":0,\"unfit_echoes\":0,\"lost_samples\":0,"
           "\"replugs\":0,\"bus_resets\":0,\"wall_s\":0,",
           ",\"pulses_per_s\":0,\"stream_sha256\":null}\n");
}

static void parts_are_added(void **state)
{
    struct recording_result sum = a_result(), more = a_result();
    (void)state;
    more.points = 100; /* so that a doubled sum does not pass */
    sum.counts.unknown = sum.unplaced = 3;
    more.counts.unknown = 40;
    more.unplaced = 4;
    strcpy(more.missing, "the scan");
    recording_add(&sum, &more);
    assert_true(sum.points == 101 && sum.empty == 4 && sum.frames == 6 && sum.with_reflectance == 8);
    assert_true(sum.counts.scans == 10 && sum.counts.pulses == 12000 && sum.counts.fired == 14);
    assert_true(sum.counts.cast == 16 && sum.counts.lost == 18 && sum.counts.left_out == 20);
    assert_int_equal(sum.unplaced, 7);
    assert_true(sum.counts.unknown == 43 && sum.counts.missing == 22 && sum.crowded == 24 && sum.faint == 26 &&
                sum.unfit == 28);
    assert_true(sum.lost_samples == 30 && sum.replugs == 52 && sum.broken_scans == 54 && sum.bus_resets == 56);
    assert_true(sum.stream.frames == 16 && sum.wall_s == 4.0); /* as the header says: not those of its stream */
    assert_string_equal(sum.missing, "the scan");
}

static void order_is_described(void **state)
{
    char text[256];
    struct recording_result result = a_result();
    (void)state;
    assert_int_equal(recording_describe_order(&result, text, sizeof text), 1);
    assert_string_equal(text, "21 frames came twice (used once), 22 frames came after newer ones (lost), 23 restarts "
                              "of the sequence");
    result.stream.repeated = result.stream.restarts = 0;
    assert_int_equal(recording_describe_order(&result, text, sizeof text), 1);
    assert_string_equal(text, "22 frames came after newer ones (lost)");
    result.stream.late = 0;
    assert_int_equal(recording_describe_order(&result, text, sizeof text), 0);
}

static void incomplete(const struct recording_result *result, int code, const char *says)
{
    struct sh_err err = {0, ""};
    assert_int_equal(recording_check_complete(result, &err), code);
    assert_string_equal(err.text, says);
}

static void missing_parts_are_named(void **state)
{
    struct recording_result r = {.counts = {.left_out = 5}, .crowded = 7, .replugs = 1, .bus_resets = 1};
    (void)state;
    incomplete(&r, SH_OK, ""); /* what the head left out, and replugs between scans, cost nothing here */
    /* Frames are lost in gaps, with a bad checksum at the ends, or dropped here. */
    r.stream = (struct scanhead_stats){.seq_lost = 1, .bad_unseen = 20, .dropped = 300};
    r.counts.missing = 4;
    incomplete(
        &r, SH_EIO,
        "the recording is not complete: 321 frames lost to this reader, 0 pulses by the head; of the pulses that "
        "it sent 4 are missing");
    r.stream.refused = 4000; /* frames that came, with contents that are wrong */
    incomplete(&r, SH_EIO,
               "the recording is not complete: 4321 frames lost to this reader (4000 for their contents or version), 0 "
               "pulses by the head; of the pulses that it sent 4 are missing");
    r.stream.refused = 0;
    struct recording_result joined = {.counts = {.missing = 4}, .unplaced = 3};
    incomplete(&joined, SH_OK, ""); /* of a live stream: the recorder came within the scan */
    joined.is_file = 1;
    incomplete(&joined, SH_EIO,
               "the recording is not complete: the file begins within a scan; of the pulses that the head sent 4 are "
               "missing, and 3 points came before the descriptor and the anchor of their scan");
    joined.counts.missing = 0;
    incomplete(&joined, SH_EIO,
               "the recording is not complete: the file begins within a scan; of the pulses that the head sent 0 are "
               "missing, and 3 points came before the descriptor and the anchor of their scan");
    joined.unplaced = 0;
    incomplete(&joined, SH_OK, "");
    r.counts.unknown = 1;
    incomplete(
        &r, SH_EIO,
        "the recording is not complete: 321 frames lost to this reader, 0 pulses by the head; of the pulses that "
        "it sent at least 4 are missing");
    r.counts.unknown = 0;
    r.stream = (struct scanhead_stats){.pulses_lost = 6};
    r.counts.lost = 5;
    r.counts.missing = 0;
    incomplete(&r, SH_EIO,
               "the recording is not complete: 0 frames lost to this reader, 6 pulses by the head; of the pulses that "
               "it sent 0 are missing");
    r.counts.lost = 7; /* the larger of both */
    incomplete(&r, SH_EIO,
               "the recording is not complete: 0 frames lost to this reader, 7 pulses by the head; of the pulses that "
               "it sent 0 are missing");
    r.broken_scans = 2;
    r.stream.dropped = 3;
    incomplete(&r, SH_ELOST,
               "the recording is not complete: the head was disconnected within 2 scans; 3 frames known to be lost");
    r.replugs = 0;
    incomplete(&r, SH_ELOST,
               "the recording is not complete: the USB bus was reset within 2 scans; 3 frames known to be lost");
    r.bus_resets = 0;
    incomplete(&r, SH_ELOST,
               "the recording is not complete: the head was disconnected within 2 scans; 3 frames known to be lost");
    strcpy(r.missing, "the scan");
    incomplete(&r, SH_ESTATE, "interrupted; missing: the scan");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_key),
        cmocka_unit_test(parts_are_added),
        cmocka_unit_test(order_is_described),
        cmocka_unit_test(missing_parts_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
