/* SPDX-License-Identifier: MIT */
/* The head reports a fault in the thread of the link. The client can see a fault of a frame only after that. Frames are
 * identified by their numbers, which are the same on all links. */
#include <string.h>

#include "drivers/host/scanhead.h"
#include "firmware_sim/app/studio/soak/ask.h"
#include "firmware_sim/app/studio/soak/clean.h"
#include "firmware_sim/app/studio/soak/datagrams.h"
#include "firmware_sim/app/studio/soak/frame.h"
#include "firmware_sim/app/studio/soak/head.h"
#include "firmware_sim/app/studio/soak/judge.h"
#include "firmware_sim/app/studio/soak/ledger.h"
#include "firmware_sim/app/studio/soak/link.h"
#include "firmware_sim/app/studio/soak/row.h"
#include "firmware_sim/app/studio/soak/soak.h"
#include "firmware_sim/app/studio/soak/usb.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/fault/fault.h"

/* AHEAD_NS: blocks are computed at most this far ahead. JUST_NS: a fault that ends or refuses a connection may be
 * reported this long after the client saw it. */
static const int64_t AHEAD_NS = 500000000, JUST_NS = 500000000;

struct soak_fact *soak_fact_at(struct soak_link *link, soak_seq seq)
{
    struct soak_fact *fact = &link->fact[seq % SOAK_RING];
    return fact->there && fact->seq == seq ? fact : NULL;
}

/* The client has read the stream up to here. */
static void reach(struct soak_link *link, soak_seq seq)
{
    if (seq <= link->reached) return;
    link->reached = seq;
    soak_judge(link, 0);
}

/* An absence may be longer than the ring. What came before it is judged while the clean reader still has it. */
void soak_saw_none(struct soak_link *link, soak_seq top)
{
    pthread_mutex_lock(&link->lock);
    if (link->begun && !link->is_open) reach(link, top);
    pthread_mutex_unlock(&link->lock);
}

/* The frame's entry, a new one where there is none. NULL: it was judged already, or the client is too far behind it.
 * The board and the library may report frames that the client has still to read. So in a session only the frames that
 * the client reads move `reached`. */
static struct soak_fact *touch(struct soak_link *link, soak_seq seq)
{
    struct soak_fact *fact = soak_fact_at(link, seq);
    if (fact != NULL) return fact;
    if (link->reached == 0 || !(link->is_open || link->in_session)) reach(link, seq);
    if (seq + SOAK_RING / 2 <= link->reached || (link->begun && seq < link->judged)) return NULL;
    if (seq >= link->reached + SOAK_RING / 2) {
        link->too_far++;
        return NULL;
    }
    if (seq > link->top) link->top = seq;
    if (link->judged == 0 || (!link->begun && seq < link->judged)) link->judged = seq;
    fact = &link->fact[seq % SOAK_RING];
    *fact = (struct soak_fact){.seq = seq, .there = 1};
    return fact;
}

/* Marks the frames before `to`. */
static void mark(struct soak_link *link, soak_seq from, soak_seq to, unsigned marks)
{
    for (; from < to; from++) {
        struct soak_fact *fact = touch(link, from);
        if (fact != NULL) fact->marks |= marks;
    }
}

/* ---- what was done */

static void take_kind(struct soak_fact *fact, const struct fault_note *note)
{
    switch (note->kind) {
    case FAULT_DUPLICATE:
        fact->copies += (uint32_t)note->n;
        break;
    case FAULT_REORDER:
        fact->behind = (uint32_t)note->n;
        break;
    case FAULT_TRUNCATE:
        fact->cut_to = (uint32_t)note->byte;
        break;
    case FAULT_GARBAGE:
        fact->garbage += (uint32_t)note->n;
        break;
    case FAULT_DELAY:
    case FAULT_JITTER:
    case FAULT_STALL:
    case FAULT_CABLE:
        if (note->for_ms > fact->for_ms) fact->for_ms = note->for_ms;
        break;
    default:
        break;
    }
}

static int row_of(const struct fault_note *note)
{
    return note->kind == FAULT_FLIP && strcmp(note->text, "resealed") == 0 ? SOAK_RESEALED : (int)note->kind;
}

/* An act is a fault that ends or refuses a connection. The link reports it once it is done. So the client may have seen
 * it already. */
static int was_just_seen(struct soak_link *link, enum fault_kind kind)
{
    const int64_t now_ns = clock_now_ns();
    if (link->odd_closings != 0 && now_ns - link->odd_ns < JUST_NS)
        link->odd_closings--;
    else if (kind == FAULT_REFUSE && link->no_open_ns != 0 && now_ns - link->no_open_ns < JUST_NS)
        link->no_open_ns = 0;
    else
        return 0;
    link->row[kind].noticed++;
    return 1;
}

/* A cable that is pulled without a reset only holds up a connection by TCP. A terminal or a USB device vanishes with
 * its cable. */
static int is_pause(const struct soak_link *link, const struct fault_note *note)
{
    return note->kind == FAULT_CABLE && note->text[0] == '\0' && strcmp(link->type, "tcp") == 0;
}

static void hit_frame(struct soak_link *link, const struct fault_note *note)
{
    struct soak_row *row = &link->row[row_of(note)];
    if (note->kind == FAULT_ENDPOINT_STALL || note->kind == FAULT_SHORT_PACKETS) {
        soak_hide(row, 1,
                  note->kind == FAULT_SHORT_PACKETS ? "the bytes are the same"
                                                    : "the library clears the halt: the bytes are the same");
        return;
    }
    if (note->kind >= FAULT_DISCONNECT && !is_pause(link, note)) {
        if (was_just_seen(link, note->kind)) return;
        if (link->n_acts < SOAK_MAX_ACTS)
            link->act[link->n_acts++] = (struct soak_act){note->kind, note->t_ns};
        else
            soak_hide(row, 1, "too many at a time");
        return;
    }
    if (!note->has_seq && link->datagrams == NULL) {
        soak_hide(row, 1, "a frame for a single reader has no number");
        return;
    }
    if ((note->kind == FAULT_FLIP || note->kind == FAULT_TRUNCATE) && note->n == 0) {
        soak_hide(row, 1, "the frame has no such byte: nothing was changed");
        return;
    }
    const uint64_t too_far = link->too_far;
    struct soak_fact *fact =
        touch(link, link->datagrams != NULL ? soak_unit(note->number) : soak_seq_of(link->soak, note->seq));
    if (fact == NULL) {
        soak_hide(row, 1, link->too_far != too_far ? "the client was too far behind it" : "it was seen too late");
        return;
    }
    fact->t_ns = note->t_ns;
    if (row_of(note) == SOAK_RESEALED)
        fact->resealed++;
    else
        fact->times[note->kind]++;
    take_kind(fact, note);
    if (note->kind == FAULT_MERGE && link->datagrams != NULL)
        mark(link, soak_unit(note->number), soak_unit(note->number + note->n), SOAK_MERGED);
}

static void hit_reply(struct soak_link *link, const struct fault_note *note)
{
    struct soak_ask *ask = &link->ask;
    if (ask->active && ask->n < SOAK_MAX_REPLY_NOTES)
        ask->note[ask->n++] = *note;
    else
        soak_hide(&link->row[note->kind], 1, "nobody waited for this reply");
}

static void hit_connection(struct soak_link *link, const struct fault_note *note)
{
    if (note->kind == FAULT_REFUSE && was_just_seen(link, note->kind)) return;
    if (note->kind == FAULT_REFUSE && link->n_refusals < SOAK_MAX_ACTS)
        link->refusal[link->n_refusals++] = (struct soak_act){note->kind, note->t_ns};
    else if (note->kind != FAULT_REFUSE)
        soak_usb_plugged(&link->plugs, link->row, note);
    else
        soak_hide(&link->row[note->kind], 1, "too many at a time");
}

static void hit_link(struct soak_link *link, const struct fault_note *note)
{
    struct soak_row *row = &link->row[row_of(note)];
    row->injected++;
    link->ask.others += fault_place_of(note->kind) != FAULT_AT_REPLY;
    if (!link->usable) {
        soak_hide(row, 1, "the link has no client here");
        return;
    }
    if (fault_place_of(note->kind) == FAULT_AT_FRAME)
        hit_frame(link, note);
    else if (fault_place_of(note->kind) == FAULT_AT_REPLY)
        hit_reply(link, note);
    else
        hit_connection(link, note);
}

void soak_heard(void *ctx, const struct fault_note *note)
{
    struct soak *soak = ctx;
    for (uint32_t i = 0; i < soak->n_links && note->link == 0; i++) {
        pthread_mutex_lock(&soak->link[i].lock);
        soak_heard_head(&soak->link[i], note);
        pthread_mutex_unlock(&soak->link[i].lock);
    }
    if (note->link == 0 || note->link > soak->n_links) return;
    struct soak_link *link = &soak->link[note->link - 1];
    pthread_mutex_lock(&link->lock);
    if (!note->ended) hit_link(link, note);
    pthread_mutex_unlock(&link->lock);
}

/* ---- what the client saw */

/* Frames before this one came while there was no session. */
static void ledger_begin(struct soak_link *link, soak_seq seq)
{
    soak_seq from = link->begun ? link->last + 1 : link->judged != 0 ? link->judged : seq;
    if (seq > from + SOAK_RING / 2) from = seq - SOAK_RING / 2;
    mark(link, from, seq, SOAK_AWAY); /* none where the first fault is of a later frame */
    if (!link->begun && (link->judged == 0 || link->judged > seq)) link->judged = seq;
    if (!link->begun) link->first = seq;
    link->begun = link->in_session = 1;
}

static void take_offset(struct soak_link *link, int64_t after_ns)
{
    if (!link->have_offset || after_ns < link->offset_ns) link->offset_ns = after_ns;
    link->have_offset = 1;
}

void soak_saw_frame(struct soak_link *link, const struct scanhead_frame *frame, int64_t now_ns)
{
    if ((frame->flags & SCANHEAD_LOCAL) != 0) return;
    pthread_mutex_lock(&link->lock);
    const soak_seq seq = soak_seq_of(link->soak, frame->seq);
    if (!link->begun) soak_head_begins(link, frame);
    reach(link, seq);
    if (!link->in_session) ledger_begin(link, seq);
    struct soak_fact *fact = touch(link, seq);
    link->frames++;
    link->bytes += frame->raw_len;
    link->last = seq;
    if (fact != NULL) {
        if (fact->got++ == 0) fact->digest = soak_digest(frame);
        fact->after_ns = now_ns - frame->t_ns;
        take_offset(link, fact->after_ns);
    }
    pthread_mutex_unlock(&link->lock);
}

void soak_saw_unit(struct soak_link *link, soak_seq seq, uint64_t digest, uint32_t len)
{
    reach(link, seq);
    if (!link->begun) ledger_begin(link, seq);
    struct soak_fact *fact = touch(link, seq);
    if (fact == NULL) return;
    if (link->frames != 0) mark(link, link->last + 1, seq, SOAK_GAP);
    if (fact->got != 0)
        fact->repeated++;
    else if (seq < link->last)
        fact->late++;
    if (fact->got != 0 || seq < link->last) return;
    fact->got = 1;
    fact->digest = digest;
    link->last = seq;
    link->frames++;
    link->bytes += len;
}

static void add_run(struct soak_link *link, const struct scanhead_notice *notice)
{
    link->bad_bytes += notice->n;
    link->ask.bad_bytes += notice->n;
    if (link->n_runs == SOAK_MAX_RUNS) memmove(link->run, link->run + 1, --link->n_runs * sizeof *link->run);
    link->run[link->n_runs++] = (struct soak_run){notice->t_ns, notice->n};
}

static void add_gap(struct soak_link *link, const struct scanhead_notice *notice)
{
    const soak_seq from = soak_seq_of(link->soak, notice->seq);
    const uint64_t n = notice->n < SOAK_RING / 2 ? notice->n : SOAK_RING / 2;
    mark(link, from, from + n, SOAK_GAP);
}

static void add_again(struct soak_link *link, const struct scanhead_notice *notice)
{
    struct soak_fact *fact = touch(link, soak_seq_of(link->soak, notice->seq));
    if (fact == NULL) return;
    if (notice->kind == SCANHEAD_NOTICE_LATE)
        fact->late++;
    else
        fact->repeated++;
}

/* The library gives no gap for a frame that came and that it refused for its contents. The frame is missing here. */
static void add_refused(struct soak_link *link, const struct scanhead_notice *notice)
{
    link->refused_frames++;
    if (!link->begun) return;
    struct soak_fact *fact = touch(link, soak_seq_of(link->soak, notice->seq));
    if (fact != NULL && fact->got == 0) fact->marks |= SOAK_GAP;
}

void soak_saw_notice(void *ctx, const struct scanhead_notice *notice)
{
    struct soak_link *link = ctx;
    pthread_mutex_lock(&link->lock);
    switch (notice->kind) {
    case SCANHEAD_NOTICE_GAP:
        add_gap(link, notice); /* it may come before the first frame is handed out */
        break;
    case SCANHEAD_NOTICE_REPEATED:
    case SCANHEAD_NOTICE_LATE:
        add_again(link, notice);
        break;
    case SCANHEAD_NOTICE_BAD_PAYLOAD:
    case SCANHEAD_NOTICE_BAD_BYTES:
        add_run(link, notice);
        break;
    case SCANHEAD_NOTICE_REFUSED:
        add_refused(link, notice);
        break;
    case SCANHEAD_NOTICE_ECHO:
        link->ask.echoes++;
        break;
    default: /* cuts and closings come with the end of the session, late replies with the question that was given up */
        break;
    }
    pthread_mutex_unlock(&link->lock);
}

void soak_saw_open(struct soak_link *link)
{
    pthread_mutex_lock(&link->lock);
    link->sessions++;
    link->is_open = 1;
    reach(link, soak_clean_top(link->soak)); /* the session has no frame from before it, but for the last few */
    pthread_mutex_unlock(&link->lock);
}

/* Hides the acts from number `from` on: the session that they were meant for had already ended. */
static void forget_acts(struct soak_link *link, uint32_t from)
{
    for (uint32_t i = from; i < link->n_acts; i++)
        soak_hide(&link->row[link->act[i].kind], 1, "the session was over before it");
    link->n_acts = 0;
}

/* The session was ended by the oldest act. */
static void end_by_act(struct soak_link *link)
{
    link->row[link->act[0].kind].noticed++;
    forget_acts(link, 1);
    link->was_cut = 1;
}

static void end_by_refusal(struct soak_link *link)
{
    if (link->n_refusals == 0) return; /* a disconnect for a while keeps clients out, too */
    link->row[link->refusal[0].kind].noticed++;
    memmove(link->refusal, link->refusal + 1, --link->n_refusals * sizeof *link->refusal);
}

void soak_saw_no_open(struct soak_link *link)
{
    pthread_mutex_lock(&link->lock);
    link->ask.ended_ns = clock_now_ns();
    if (link->n_refusals != 0)
        end_by_refusal(link);
    else
        link->no_open_ns = clock_now_ns();
    pthread_mutex_unlock(&link->lock);
}

void soak_saw_end(struct soak_link *link)
{
    pthread_mutex_lock(&link->lock);
    const int was_refused = !link->in_session;
    link->in_session = link->is_open = 0;
    link->ask.ended_ns = clock_now_ns();
    link->closings++;
    /* The board reports a power cycle some ticks before power goes. The client may be far behind then, the clean reader
     * is not. */
    const int64_t act_ns = link->n_acts != 0 ? link->act[0].t_ns : INT64_MAX;
    const int64_t now_ns = link->begun ? soak_clean_t_ns(link->soak) : INT64_MAX - AHEAD_NS;
    if (soak_saw_power_go(link, act_ns != INT64_MAX ? act_ns : now_ns + AHEAD_NS)) {
        forget_acts(link, 0);
        link->was_cut = 1;
    } else if (link->n_acts != 0) {
        end_by_act(link);
    } else if (was_refused && (link->n_refusals != 0 || link->was_cut)) {
        end_by_refusal(link);
    } else {
        link->odd_closings++;
        link->odd_ns = clock_now_ns();
    }
    pthread_mutex_unlock(&link->lock);
}
