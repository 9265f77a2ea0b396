/* SPDX-License-Identifier: MIT */
/* A frame is judged once the client has read thousands of later ones, or at the end. Then nothing more will come of the
 * frame, and the clean reader has it. */
#include "firmware_sim/app/studio/soak/clean.h"
#include "firmware_sim/app/studio/soak/datagrams.h"
#include "firmware_sim/app/studio/soak/frame.h"
#include "firmware_sim/app/studio/soak/judge.h"
#include "firmware_sim/app/studio/soak/ledger.h"
#include "firmware_sim/app/studio/soak/link.h"
#include "firmware_sim/app/studio/soak/row.h"
#include "firmware_sim/app/studio/soak/soak.h"
#include "firmware_sim/fault/fault.h"

/* Delays below LATE_MS are not judged. MARGIN_MS is the tolerance: the time of a frame is exact only to a tick, and the
 * smallest delay that was seen may be above the smallest possible one. */
static const double LATE_MS = 10.0, MARGIN_MS = 5.0;
enum { NEAR_FRAMES = 64 };
static const int64_t NEAR_NS = 20000000, FAR_NS = 20000000000;

/* Kinds that destroy a frame. */
static const enum fault_kind destroying[] = {FAULT_DROP, FAULT_TRUNCATE, FAULT_FLIP};
enum { N_DESTROYING = sizeof destroying / sizeof *destroying };

static int is_destroyed(const struct soak_fact *f)
{
    return f->times[FAULT_DROP] + f->times[FAULT_TRUNCATE] + f->times[FAULT_FLIP] != 0;
}

static void hide_all(struct soak_link *link, const struct soak_fact *f, const char *why)
{
    for (int kind = 0; kind < FAULT_REFUSE; kind++)
        soak_hide(&link->row[kind], f->times[kind], why);
    soak_hide(&link->row[SOAK_RESEALED], f->resealed, why);
}

static void decide(struct soak_row *row, uint64_t n, int was_noticed)
{
    if (was_noticed)
        row->noticed += n;
    else
        row->missed += n;
}

/* ---- what each kind must show */

static int is_gap(const struct soak_fact *f)
{
    return f->got == 0 && (f->marks & SOAK_GAP) != 0;
}

/* The frame must be missing, with a gap at its number. */
static void judge_destroyed(struct soak_link *link, const struct soak_fact *f)
{
    for (size_t i = 0; i < N_DESTROYING; i++)
        decide(&link->row[destroying[i]], f->times[destroying[i]], is_gap(f));
}

static void judge_resealed(struct soak_link *link, const struct soak_fact *f, int is_known, int is_wrong)
{
    struct soak_row *row = &link->row[SOAK_RESEALED];
    if (f->resealed == 0) return;
    if (is_destroyed(f))
        soak_hide(row, f->resealed, "the frame was destroyed besides");
    else if (!is_known && f->got != 0)
        soak_hide(row, f->resealed, "the clean reader did not get the frame");
    else if (f->got != 0 && is_wrong)
        row->accepted += f->resealed;
    else
        decide(row, f->resealed, is_gap(f)); /* refused for what it holds, or late */
}

static void judge_duplicate(struct soak_link *link, const struct soak_fact *f)
{
    struct soak_row *row = &link->row[FAULT_DUPLICATE];
    if (f->times[FAULT_DUPLICATE] == 0) return;
    if (is_destroyed(f) || (f->resealed != 0 && f->got == 0))
        soak_hide(row, f->times[FAULT_DUPLICATE], "no copy of the frame was right");
    else
        decide(row, f->times[FAULT_DUPLICATE], f->got + f->late + f->repeated == 1 + f->copies);
}

/* Returns whether no frame overtook f. Then each frame that f was held back behind was destroyed, was held back itself,
 * or came while there was no session. */
static int nothing_overtook(struct soak_link *link, const struct soak_fact *f)
{
    for (uint32_t i = 1; i <= f->behind; i++) {
        const struct soak_fact *next = soak_fact_at(link, f->seq + i);
        if (next == NULL || !(is_destroyed(next) || next->times[FAULT_REORDER] != 0 || (next->marks & SOAK_AWAY) != 0))
            return 0;
    }
    return 1;
}

static void judge_reorder(struct soak_link *link, const struct soak_fact *f)
{
    struct soak_row *row = &link->row[FAULT_REORDER];
    if (f->times[FAULT_REORDER] == 0) return;
    if (is_destroyed(f) || (f->resealed != 0 && f->got == 0))
        soak_hide(row, f->times[FAULT_REORDER], "the frame was destroyed besides");
    else if (f->late == 0 && f->got != 0 && nothing_overtook(link, f))
        soak_hide(row, f->times[FAULT_REORDER], "those that overtook it were destroyed");
    else
        decide(row, f->times[FAULT_REORDER], f->late != 0);
}

static void judge_late(struct soak_link *link, const struct soak_fact *f)
{
    static const enum fault_kind kinds[] = {FAULT_DELAY, FAULT_JITTER, FAULT_STALL, FAULT_CABLE};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        struct soak_row *row = &link->row[kinds[i]];
        const uint64_t n = f->times[kinds[i]];
        if (n == 0) continue;
        if (!link->soak->realtime)
            soak_hide(row, n, "no frame is late at this pace: only realtime has delays");
        else if (f->for_ms < LATE_MS)
            soak_hide(row, n, "shorter than 10 ms");
        else if (link->datagrams != NULL)
            soak_hide(row, n, "packets are compared only by their contents");
        else if (f->got == 0)
            soak_hide(row, n, "the frame did not come in its place");
        else
            decide(row, n, 1e-6 * (double)(f->after_ns - link->offset_ns) >= f->for_ms - MARGIN_MS);
    }
}

/* The clean frame that the link's is compared with. 0: it is not known (any more, or not yet). */
static int get_clean(struct soak_link *link, soak_seq seq, struct soak_clean_frame *out)
{
    return link->datagrams != NULL ? soak_datagrams_get(link->datagrams, seq, out)
                                   : soak_clean_get(link->soak, seq, out);
}

/* Takes n bytes that belong to no frame out of a run near this place. Returns 0 where there is none. */
static int take_bytes(struct soak_link *link, const struct soak_fact *f, uint64_t n)
{
    struct soak_clean_frame before;
    const int64_t from_ns = get_clean(link, f->seq - NEAR_FRAMES, &before) ? before.t_ns : f->t_ns - FAR_NS;
    for (uint32_t i = 0; i < link->n_runs; i++) {
        struct soak_run *run = &link->run[i];
        if (run->t_ns < from_ns || run->t_ns > f->t_ns + NEAR_NS || run->n < n) continue;
        run->n -= n;
        return 1;
    }
    return 0;
}

static void judge_garbage(struct soak_link *link, const struct soak_fact *f)
{
    if (f->garbage == 0) return;
    if (link->datagrams != NULL) { /* a datagram of its own: any bad one counts; sheet.c compares the bytes */
        const int is_there = link->bad_units >= f->times[FAULT_GARBAGE];
        if (is_there) link->bad_units -= f->times[FAULT_GARBAGE];
        decide(&link->row[FAULT_GARBAGE], f->times[FAULT_GARBAGE], is_there);
        return;
    }
    decide(&link->row[FAULT_GARBAGE], f->times[FAULT_GARBAGE], take_bytes(link, f, f->garbage));
}

static void judge_same_bytes(struct soak_link *link, const struct soak_fact *f)
{
    static const enum fault_kind kinds[] = {FAULT_SPLIT, FAULT_MERGE};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        if (link->datagrams == NULL)
            soak_hide(&link->row[kinds[i]], f->times[kinds[i]], "the bytes are the same");
        else if (is_destroyed(f))
            soak_hide(&link->row[kinds[i]], f->times[kinds[i]], "the frame was destroyed besides");
        else /* its datagrams have the wrong length */
            decide(&link->row[kinds[i]], f->times[kinds[i]], is_gap(f));
    }
}

/* ---- a frame */

/* Counts the bytes that no reader can take for a frame or a reply. */
static uint64_t bad_bytes_of(const struct soak_link *link, const struct soak_fact *f,
                             const struct soak_clean_frame *clean)
{
    uint64_t n = f->garbage;
    /* A datagram whose bits changed does not arrive: its checksum is wrong. */
    if (link->datagrams != NULL && f->times[FAULT_FLIP] != 0) return n;
    if (link->datagrams != NULL && ((f->marks & SOAK_MERGED) != 0 || f->times[FAULT_SPLIT] != 0)) return n + clean->len;
    if (is_destroyed(f) && f->times[FAULT_DROP] == 0)
        n += (uint64_t)(f->cut_to != 0 ? f->cut_to : clean->len) * (1 + f->copies);
    return n;
}

static void judge_loss(struct soak_link *link, const struct soak_fact *f)
{
    if (f->got != 0) return;
    for (size_t i = 0; i < N_DESTROYING; i++) {
        if (f->times[destroying[i]] == 0) continue;
        link->row[destroying[i]].lost++;
        return;
    }
    if (f->times[FAULT_REORDER] != 0 && f->late != 0)
        link->row[FAULT_REORDER].lost++;
    else if (link->datagrams != NULL && ((f->marks & SOAK_MERGED) != 0 || f->times[FAULT_SPLIT] != 0))
        link->row[(f->marks & SOAK_MERGED) != 0 ? FAULT_MERGE : FAULT_SPLIT].lost++;
    else if (f->resealed != 0)
        link->row[SOAK_RESEALED].lost++;
    else
        link->lost_plain++;
}

static void judge_frame(struct soak_link *link, const struct soak_fact *f)
{
    struct soak_clean_frame clean = {0};
    const int is_known = get_clean(link, f->seq, &clean);
    const uint64_t bad = bad_bytes_of(link, f, &clean);
    link->expected_bad_max += bad;
    if ((f->marks & SOAK_AWAY) != 0) {
        link->away++;
        hide_all(link, f, "there was no session then");
        return;
    }
    if (f->seq > link->last) {
        hide_all(link, f, "it was the last before the end");
        return;
    }
    link->expected_bad_min += bad;
    if (!is_known) link->unknown++;
    const int is_wrong = is_known && f->got != 0 && f->digest != clean.digest;
    judge_loss(link, f);
    judge_destroyed(link, f);
    judge_resealed(link, f, is_known, is_wrong);
    judge_duplicate(link, f);
    judge_reorder(link, f);
    judge_late(link, f);
    judge_garbage(link, f);
    judge_same_bytes(link, f);
    if ((is_wrong && f->resealed == 0) || f->got > 1) link->wrong_plain++; /* once, even where both hold */
}

void soak_judge(struct soak_link *link, int all)
{
    if (link->judged == 0) return;
    for (; all ? link->judged <= link->top : link->judged + SOAK_RING / 2 <= link->reached; link->judged++) {
        const struct soak_fact *f = soak_fact_at(link, link->judged);
        if (f != NULL)
            judge_frame(link, f);
        else if (link->begun && link->judged >= link->first && link->judged < link->last)
            link->lost_plain++;
    }
}
