/* SPDX-License-Identifier: MIT */
/* The results of a soak: a row for each kind of fault and link, the sums, and the verdict. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "firmware_sim/app/studio/soak/link.h"
#include "firmware_sim/app/studio/soak/row.h"
#include "firmware_sim/app/studio/soak/sheet.h"
#include "firmware_sim/app/studio/soak/soak.h"
#include "firmware_sim/base/json.h"
#include "firmware_sim/fault/board.h"
#include "firmware_sim/fault/fault.h"

static const char *row_name(int row)
{
    return row == SOAK_RESEALED ? "flip, resealed" : fault_names[row];
}

static void sheet_add(struct soak_row *sum, const struct soak_row *row)
{
    sum->injected += row->injected;
    sum->noticed += row->noticed;
    sum->hidden += row->hidden;
    sum->missed += row->missed;
    sum->lost += row->lost;
    sum->accepted += row->accepted;
}

static struct soak_row sum_of(const struct soak *soak)
{
    struct soak_row sum = {0};
    for (int row = 0; row < SOAK_N_ROWS; row++)
        for (uint32_t i = 0; i < soak->n_links; i++)
            sheet_add(&sum, &soak->link[i].row[row]);
    return sum;
}

/* ---- the verdict */

static void sheet_fail(struct soak *soak, int is_wrong, const char *why)
{
    for (uint32_t i = 0; i < soak->n_failures; i++)
        if (strcmp(soak->failures[i], why) == 0) return;
    if (is_wrong && soak->n_failures < sizeof soak->failures / sizeof *soak->failures)
        soak->failures[soak->n_failures++] = why;
}

static int has_open_rows(const struct soak_row rows[SOAK_N_ROWS])
{
    for (int row = 0; row < SOAK_N_ROWS; row++)
        if (rows[row].injected != rows[row].noticed + rows[row].hidden + rows[row].missed + rows[row].accepted)
            return 1;
    return 0;
}

/* Frames that the clean reader itself lost can't be compared, either. */
static int is_overrun(const struct soak *soak, const struct soak_link *link)
{
    return link->too_far != 0 || (link->datagrams == NULL && link->unknown > soak->clean.reader_lost);
}

static void conclude_link(struct soak *soak, struct soak_link *link)
{
    const uint64_t bad = link->bad_bytes;
    struct soak_row sum = {0};
    /* Faults that end or refuse connections, and that the client has not noticed by now, are missed. */
    for (uint32_t i = 0; i < link->n_acts; i++)
        link->row[link->act[i].kind].missed++;
    for (uint32_t i = 0; i < link->n_refusals; i++)
        link->row[link->refusal[i].kind].missed++;
    for (uint32_t i = 0; i < link->plugs.n; i++)
        link->row[link->plugs.note[i].kind].missed++;
    for (int row = 0; row < SOAK_N_ROWS; row++)
        sheet_add(&sum, &link->row[row]);
    sheet_fail(soak, has_open_rows(link->row),
               "the counts of a fault do not add up: injected is not noticed + hidden + missed + accepted");
    if (!link->usable) return;
    sheet_fail(soak, link->failed[0] != '\0', "a client gave up");
    sheet_fail(soak, link->dropped != 0, "a client's library dropped frames while the client waited for a reply");
    sheet_fail(soak, is_overrun(soak, link), "a client was too far behind the head, so not all could be compared");
    sheet_fail(soak, sum.missed != 0, "a fault that can be noticed was not noticed");
    sheet_fail(soak, link->wrong_plain != 0, "a frame that was accepted differs from the clean one, without a fault");
    sheet_fail(soak, link->lost_plain > link->reader_lost + link->dropped, "frames were lost without a fault");
    sheet_fail(soak, link->ask.odd != 0, "a reply was wrong or missing without a fault");
    sheet_fail(soak, link->odd_closings != 0, "a connection was closed without a fault");
    sheet_fail(soak, link->frames == 0, "a client got no frame");
    sheet_fail(soak, !link->in_session, "a client had no connection at the end");
    sheet_fail(soak, bad < link->expected_bad_min || bad > link->expected_bad_max,
               "the number of bytes outside of frames is not that of the faults");
}

void soak_conclude(struct soak *soak)
{
    const char *state = soak->clean.state;
    for (uint32_t i = 0; i < soak->n_links; i++)
        conclude_link(soak, &soak->link[i]);
    soak->healthy = soak->clean.idn[0] != '\0' && strcmp(state, "scanning") == 0;
    soak->hash_is_same = soak->stats.have_hash && strcmp(soak->stats.sha256, soak->clean.sha256) == 0;
    sheet_fail(soak, soak->clean.failed[0] != '\0', "the clean reader ended before the head did");
    sheet_fail(soak, !soak->healthy, "the head is not healthy at the end");
    sheet_fail(soak, !soak->stats.have_hash, "the head could not compute its hash fast enough");
    sheet_fail(soak, soak->stats.have_hash && !soak->hash_is_same && soak->clean.reader_lost == 0,
               "the clean reader's hash is not that of the head");
    sheet_fail(soak, soak->stats.counters.lost_pulses != 0, "the head lost pulses");
}

void soak_warn_hidden(const struct soak *soak, const struct sh_report *report)
{
    static const uint64_t MANY = 10;
    const struct soak_row sum = sum_of(soak);
    if (sum.injected < MANY || 10 * sum.hidden < 9 * sum.injected) return;
    sh_warn(report,
            "soak: %" PRIu64 " of %" PRIu64 " injected faults can't be noticed, so the verdict says little; the table "
            "has the reasons",
            sum.hidden, sum.injected);
}

/* ---- text */

static void print_row(FILE *out, const char *where, int row, const struct soak_row *r)
{
    if (r->injected == 0) return;
    fprintf(out, "%-22s %-16s %8" PRIu64 " ", where, row_name(row), r->injected);
    if (r->hidden == r->injected)
        fprintf(out, "%8s ", "-");
    else
        fprintf(out, "%8" PRIu64 " ", r->noticed);
    fprintf(out, "%8" PRIu64 " %8" PRIu64 "  ", r->lost, r->accepted);
    if (r->missed != 0) fprintf(out, "%" PRIu64 " NOT NOTICED; ", r->missed);
    if (r->hidden == r->injected)
        fprintf(out, "%s", r->why != NULL ? r->why : "");
    else if (r->hidden != 0)
        fprintf(out, "%" PRIu64 " can't be noticed: %s", r->hidden, r->why);
    fprintf(out, "\n");
}

static void print_link(const struct soak_link *link, FILE *out)
{
    char where[40];
    snprintf(where, sizeof where, "%" PRIu32 " %s", link->number, link->type);
    for (int row = 0; row < SOAK_N_ROWS; row++)
        print_row(out, where, row, &link->row[row]);
    if (!link->usable) {
        fprintf(out, "%-22s not soaked: %s\n", where, link->not_soaked);
        return;
    }
    fprintf(out, "%-22s %" PRIu64 " frames in %" PRIu64 " session%s, %" PRIu64 " questions", where, link->frames,
            link->sessions, link->sessions == 1 ? "" : "s", link->ask.asked);
    if (link->away != 0) fprintf(out, "; %" PRIu64 " frames came while there was no session", link->away);
    if (link->reader_lost != 0) fprintf(out, "; %" PRIu64 " left out, the client was too slow", link->reader_lost);
    if (link->dropped != 0) fprintf(out, "; %" PRIu64 " dropped by its library", link->dropped);
    if (link->too_far != 0) fprintf(out, "; %" PRIu64 " reports were too far ahead of it", link->too_far);
    if (link->ask.hurt != 0)
        fprintf(out, "; %" PRIu64 " replies were lost or wrong beside another fault, or just after a session",
                link->ask.hurt);
    if (link->unknown != 0) fprintf(out, "; %" PRIu64 " frames the clean reader did not get", link->unknown);
    if (link->failed[0] != '\0') fprintf(out, "; gave up: %s", link->failed);
    fprintf(out, "\n");
}

void soak_print(const struct soak *soak, FILE *out)
{
    const struct soak_row sum = sum_of(soak);
    fprintf(out, "%-22s %-16s %8s %8s %8s %8s\n", "link", "fault", "injected", "noticed", "lost", "accepted");
    for (uint32_t i = 0; i < soak->n_links; i++)
        print_link(&soak->link[i], out);
    fprintf(out,
            "%-22s %-16s %8" PRIu64 " %8" PRIu64 " %8" PRIu64 " %8" PRIu64 "  %" PRIu64 " can't be noticed, %" PRIu64
            " not noticed\n",
            "all", "", sum.injected, sum.noticed, sum.lost, sum.accepted, sum.hidden, sum.missed);
    if (soak->n_failures == 0)
        fprintf(out, "verdict: good; frames wrongly accepted: %" PRIu64 ", all of them resealed flips\n", sum.accepted);
    for (uint32_t i = 0; i < soak->n_failures; i++)
        fprintf(out, "verdict: bad: %s\n", soak->failures[i]);
}

/* ---- JSON */

static void put_sums(struct json *json, const struct soak_row *r)
{
    json_uint(json, "injected", r->injected);
    json_uint(json, "noticed", r->noticed);
    json_uint(json, "hidden", r->hidden);
    json_uint(json, "missed", r->missed);
    json_uint(json, "lost", r->lost);
    json_uint(json, "wrongly_accepted", r->accepted);
}

static void put_row(struct json *json, int row, const struct soak_row *r)
{
    json_open_object(json, NULL);
    json_string(json, "fault", row_name(row));
    put_sums(json, r);
    if (r->hidden != 0) json_string(json, "hidden_because", r->why);
    json_close_object(json);
}

static void put_rows(struct json *json, const struct soak_row rows[SOAK_N_ROWS])
{
    json_open_array(json, "faults");
    for (int row = 0; row < SOAK_N_ROWS; row++)
        if (rows[row].injected != 0) put_row(json, row, &rows[row]);
    json_close_array(json);
}

static void put_counts(struct json *json, const struct soak_link *link)
{
    json_uint(json, "frames", link->frames);
    json_uint(json, "bytes", link->bytes);
    json_uint(json, "bad_bytes", link->bad_bytes);
    json_uint(json, "refused_frames", link->refused_frames);
    json_uint(json, "sessions", link->sessions);
    json_uint(json, "closed", link->closings);
    json_uint(json, "away_frames", link->away);
    json_uint(json, "reader_lost_frames", link->reader_lost);
    json_uint(json, "dropped_frames", link->dropped);
    json_uint(json, "reports_too_far_ahead", link->too_far);
    json_uint(json, "lost_without_fault", link->lost_plain);
    json_uint(json, "wrong_without_fault", link->wrong_plain);
    json_uint(json, "not_compared", link->unknown);
    json_uint(json, "questions", link->ask.asked);
    json_uint(json, "right_answers", link->ask.answered);
    json_uint(json, "timeouts", link->ask.timeouts);
    json_uint(json, "wrong_answers", link->ask.wrong);
    json_uint(json, "replies_hurt_beside_frames", link->ask.hurt);
    json_uint(json, "replies_wrong_without_fault", link->ask.odd);
    json_string(json, "gave_up", link->failed[0] != '\0' ? link->failed : NULL);
}

static void put_link(struct json *json, const struct soak_link *link)
{
    json_open_object(json, NULL);
    json_uint(json, "link", link->number);
    json_string(json, "type", link->type);
    json_string(json, "endpoint", link->endpoint);
    json_string(json, "not_soaked", link->not_soaked);
    put_rows(json, link->row);
    if (link->usable) put_counts(json, link);
    json_close_object(json);
}

void soak_put(struct json *json, const void *ctx)
{
    const struct soak *soak = ctx;
    const struct soak_row sum = sum_of(soak);
    json_open_object(json, NULL);
    json_double(json, "wall_s", soak->wall_s);
    json_open_array(json, "links");
    for (uint32_t i = 0; i < soak->n_links; i++)
        put_link(json, &soak->link[i]);
    json_close_array(json);
    json_open_object(json, "head");
    json_uint(json, "clean_frames", soak->clean.frames);
    json_uint(json, "clean_reader_lost_frames", soak->clean.reader_lost);
    json_uint(json, "lost_pulses", soak->stats.counters.lost_pulses);
    json_string(json, "identity", soak->clean.idn);
    json_string(json, "state", soak->clean.state);
    json_string(json, "stream_sha256", soak->stats.have_hash ? soak->stats.sha256 : NULL);
    json_string(json, "clean_sha256", soak->clean.sha256);
    json_close_object(json);
    put_sums(json, &sum);
    json_bool(json, "good", soak->n_failures == 0);
    json_open_array(json, "failures");
    for (uint32_t i = 0; i < soak->n_failures; i++)
        json_string(json, NULL, soak->failures[i]);
    json_close_array(json);
    json_close_object(json);
}

void soak_say_progress(struct soak *soak, double s)
{
    uint64_t frames = 0, missed = 0;
    for (uint32_t i = 0; i < soak->n_links; i++) {
        struct soak_link *link = &soak->link[i];
        pthread_mutex_lock(&link->lock);
        frames += link->frames;
        for (int row = 0; row < SOAK_N_ROWS; row++)
            missed += link->row[row].missed;
        pthread_mutex_unlock(&link->lock);
    }
    fprintf(stderr,
            "scanhead: soak: %.0f s, %" PRIu64 " faults injected, %" PRIu64 " frames received, %" PRIu64
            " faults not noticed\n",
            s, fault_board_injected(soak->board, 0), frames, missed);
}
