/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/native_sequence.h"

#include "drivers/protocol/native.h"

static int native_sequence_is_same(const struct native_header *a, const struct native_header *b)
{
    return a->seq == b->seq && a->t_ns == b->t_ns && a->payload_crc == b->payload_crc && a->type == b->type &&
           a->length == b->length && a->flags == b->flags;
}

/* Whether the frame is among the last `most` ones. */
static int has_come(const struct native_sequence *s, const struct native_header *frame, uint32_t most)
{
    for (uint32_t i = 1; i <= most && i <= s->n_seen; i++)
        if (native_sequence_is_same(&s->seen[(s->n_seen - i) % NATIVE_SEEN], frame)) return 1;
    return 0;
}

/* Remembers a range of up to NATIVE_GAP_MOST missing frames, in place of the oldest one where there is no room. */
static void add_gap(struct native_sequence *s, uint32_t first, uint32_t n)
{
    if (n == 0 || n > NATIVE_GAP_MOST) return;
    s->gap[s->n_gaps % NATIVE_GAPS].first = first;
    s->gap[s->n_gaps++ % NATIVE_GAPS].n = n;
}

/* 1: seq was missing; now it counts as there. */
static int fills_gap(struct native_sequence *s, uint32_t seq)
{
    for (uint32_t i = 0; i < NATIVE_GAPS; i++) {
        const uint32_t first = s->gap[i].first, n = s->gap[i].n, before = seq - first;
        if (before >= n) continue;
        s->gap[i].n = before;
        if (s->n_gaps % NATIVE_GAPS == i) s->n_gaps++; /* entry i has the first part: add_gap must not overwrite it */
        add_gap(s, seq + 1, n - before - 1);
        return 1;
    }
    return 0;
}

static void forget(struct native_sequence *s)
{
    s->n_seen = s->n_gaps = 0;
    for (uint32_t i = 0; i < NATIVE_GAPS; i++)
        s->gap[i].n = 0;
}

/* Whether late frames in a row are another sequence. If a head started again while many frames were lost, each new
 * frame may have the number of a lost one, so it seems late. */
static int is_run(struct native_sequence *s, uint32_t seq)
{
    s->late_run = s->late_run > 0 && seq == s->last_late + 1 ? s->late_run + 1 : 1;
    s->last_late = seq;
    return s->late_run == NATIVE_LATE_RUN;
}

/* The kind of notice for a frame that is not the next one. */
static enum native_notice_kind look_at_jump(struct native_sequence *s, const struct native_header *frame, int fresh,
                                            uint32_t *first, uint32_t *n)
{
    const uint32_t missing = frame->seq - s->next;
    if (missing < UINT32_C(0x80000000)) {
        *first = s->next;
        *n = missing;
        add_gap(s, s->next, missing);
        return NATIVE_GAP;
    }
    if (has_come(s, frame, fresh ? 1 : NATIVE_SEEN)) return NATIVE_REPEATED;
    if (!fresh && fills_gap(s, frame->seq) && !is_run(s, frame->seq)) return NATIVE_LATE;
    forget(s);
    return NATIVE_RESTARTED;
}

/* LOCAL frames are not numbered, and a head may send equal ones, but never two in a row. */
static enum native_notice_kind look_at_local(struct native_sequence *s, const struct native_header *frame)
{
    if (native_sequence_is_same(&s->local, frame)) return NATIVE_REPEATED;
    s->local = *frame;
    return NATIVE_NO_NOTICE;
}

/* Counts repeated frames whose numbers lead up to the next frame. */
static void count_again(struct native_sequence *s, uint32_t seq, int is_again)
{
    if (seq != s->again_next) s->again = 0;
    if (!is_again) return;
    s->again++;
    s->again_next = seq + 1;
}

enum native_notice_kind native_sequence_take(struct native_sequence *s, const struct native_header *frame,
                                             uint32_t *first, uint32_t *n)
{
    enum native_notice_kind kind = NATIVE_NO_NOTICE;
    *first = frame->seq;
    *n = 1;
    if ((frame->flags & NATIVE_LOCAL) != 0) return look_at_local(s, frame);
    s->local.type = 0;
    const int fresh = s->fresh;
    s->fresh = 0;
    if (s->have && frame->seq != s->next) kind = look_at_jump(s, frame, fresh, first, n);
    count_again(s, frame->seq, kind == NATIVE_REPEATED);
    if (kind == NATIVE_REPEATED) return kind;
    s->seen[s->n_seen++ % NATIVE_SEEN] = *frame;
    if (kind == NATIVE_LATE) return kind;
    s->late_run = 0;
    s->next = frame->seq + 1;
    s->have = 1;
    return kind;
}

void native_sequence_resume(struct native_sequence *s)
{
    s->fresh = 1;
    s->local.type = 0;
}
