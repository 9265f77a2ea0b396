/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/record/recording.h"

#include <stdio.h>
#include <string.h>

#include "firmware_sim/base/clock.h"

void recording_add(struct recording_result *sum, const struct recording_result *more)
{
    recording_add_counts(sum, more, offsetof(struct recording_result, counts));
    recording_add_counts(&sum->counts, &more->counts, offsetof(struct recording_counts, within));
    memcpy(sum->missing, more->missing, sizeof sum->missing);
}

/* null where the final counts of a scan did not come. */
static void put_known(struct json *json, const char *key, const struct recording_counts *counts, uint64_t n)
{
    if (counts->unknown == 0)
        json_uint(json, key, n);
    else
        json_string(json, key, NULL);
}

void recording_put(struct json *json, const void *ctx)
{
    const struct recording_result *result = ctx;
    const struct scanhead_stats *s = &result->stream;
    const struct recording_counts *counts = &result->counts;
    json_open_object(json, NULL);
    json_uint(json, "points", result->points);
    json_uint(json, "empty_shots", result->empty);
    json_uint(json, "pulses", counts->pulses);
    put_known(json, "fired_pulses", counts, counts->fired);
    put_known(json, "cast_pulses", counts, counts->cast);
    json_uint(json, "lost_pulses", counts->lost);
    put_known(json, "missing_pulses", counts, counts->missing);
    json_uint(json, "reader_lost_pulses", counts->left_out);
    json_uint(json, "scans", counts->scans);
    json_uint(json, "frames", s->frames);
    json_uint(json, "bytes", s->bytes);
    json_uint(json, "bad_payload", s->bad_payload);
    json_uint(json, "bad_bytes", s->bad_bytes);
    json_uint(json, "seq_lost", s->seq_lost);
    json_uint(json, "repeated", s->repeated);
    json_uint(json, "late", s->late);
    json_uint(json, "restarts", s->restarts);
    json_uint(json, "refused", s->refused);
    json_uint(json, "dropped", s->dropped);
    json_uint(json, "reader_lost_frames", s->reader_lost);
    json_uint(json, "crowded_echoes", result->crowded);
    json_uint(json, "faint_hits", result->faint);
    json_uint(json, "unfit_echoes", result->unfit);
    json_uint(json, "lost_samples", result->lost_samples);
    json_uint(json, "replugs", result->replugs);
    json_uint(json, "bus_resets", result->bus_resets);
    json_double(json, "wall_s", result->wall_s);
    json_double(json, "cpu_s", clock_cpu_s());
    json_double(json, "pulses_per_s", result->wall_s > 0.0 ? (double)counts->pulses / result->wall_s : 0.0);
    json_string(json, "stream_sha256", result->sha256[0] != '\0' ? result->sha256 : NULL);
    json_close_object(json);
}

/* Adds ", N what" where there were any. */
static void add_count(char *text, size_t len, uint64_t n, const char *what)
{
    const size_t at = strlen(text);
    if (n != 0) snprintf(text + at, len - at, "%s%llu %s", at > 0 ? ", " : "", (unsigned long long)n, what);
}

int recording_describe_order(const struct recording_result *result, char *text, size_t len)
{
    const struct scanhead_stats *s = &result->stream;
    text[0] = '\0';
    add_count(text, len, s->repeated, "frames came twice (used once)");
    add_count(text, len, s->late, "frames came after newer ones (lost)");
    add_count(text, len, s->restarts, "restarts of the sequence");
    return text[0] != '\0';
}

/* A file may lack its beginning, and no gap in the sequence says so. */
static int check_beginning(const struct recording_result *result, struct sh_err *err)
{
    if (!result->is_file || (result->counts.missing == 0 && result->unplaced == 0)) return SH_OK;
    return sh_fail(
        err, SH_EIO,
        "the recording is not complete: the file begins within a scan; of the pulses that the head sent %llu are "
        "missing, and %llu points came before the descriptor and the anchor of their scan",
        (unsigned long long)result->counts.missing, (unsigned long long)result->unplaced);
}

int recording_check_complete(const struct recording_result *result, struct sh_err *err)
{
    const struct scanhead_stats *s = &result->stream;
    /* Frames that never came leave gaps in the sequence. Frames with a wrong checksum leave gaps, too, but not before
     * the first frame and after the last. Refused frames came, but their contents are lost. */
    const unsigned long long lost = s->seq_lost + s->bad_unseen + s->dropped + s->refused;
    char refused[64] = "";
    if (s->refused != 0)
        snprintf(refused, sizeof refused, " (%llu for their contents or version)", (unsigned long long)s->refused);
    const uint64_t pulses = s->pulses_lost > result->counts.lost ? s->pulses_lost : result->counts.lost;
    if (result->missing[0] != '\0') return sh_fail(err, SH_ESTATE, "interrupted; missing: %s", result->missing);
    if (result->broken_scans != 0)
        return sh_fail(
            err, SH_ELOST, "the recording is not complete: %s within %llu scans; %llu frames known to be lost",
            result->replugs == 0 && result->bus_resets != 0 ? "the USB bus was reset" : "the head was disconnected",
            (unsigned long long)result->broken_scans, lost);
    if (lost == 0 && pulses == 0) return check_beginning(result, err);
    return sh_fail(
        err, SH_EIO,
        "the recording is not complete: %llu frames lost to this reader%s, %llu pulses by the head; of the pulses "
        "that it sent %s%llu are missing",
        lost, refused, (unsigned long long)pulses, result->counts.unknown != 0 ? "at least " : "",
        (unsigned long long)result->counts.missing);
}
