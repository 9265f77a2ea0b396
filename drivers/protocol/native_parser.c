/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "core/bytes.h"
#include "drivers/protocol/crc32c.h"
#include "drivers/protocol/native.h"

enum look { LOOK_GOOD, LOOK_WAIT, LOOK_BAD };

void native_parser_init(struct native_parser *parser)
{
    memset(parser, 0, sizeof *parser);
    parser->in_step = 1;
    parser->last_t_ns = NATIVE_NO_TIME;
}

/* The buffer in which start and end are offsets. */
static const uint8_t *bytes_of(const struct native_parser *parser)
{
    return parser->lent != NULL ? parser->lent : parser->buf;
}

uint8_t *native_parser_room(struct native_parser *parser, size_t *room)
{
    size_t pending = parser->end - parser->start;
    /* A move copies the pending bytes. It is made only where at least as many bytes were parsed since the last move, so
     * that the cost per byte is constant. After NATIVE_MORE there is always room: pending is less than a frame. Where
     * start < pending, nothing is moved, but end < 2 pending, which is less than the buffer's two frames. */
    if (pending <= parser->start && sizeof parser->buf - parser->end < NATIVE_MAX_FRAME) {
        memmove(parser->buf, parser->buf + parser->start, pending);
        parser->start = 0;
        parser->end = pending;
    }
    *room = sizeof parser->buf - parser->end;
    return parser->buf + parser->end;
}

void native_parser_lend(struct native_parser *parser, const uint8_t *items, size_t n)
{
    parser->lent = items;
    parser->start = 0;
    parser->end = n;
    parser->stats.bytes += n;
}

void native_parser_added(struct native_parser *parser, size_t n)
{
    parser->end += n;
    parser->stats.bytes += n;
}

void native_parser_finish(struct native_parser *parser)
{
    parser->finished = 1;
}

/* Where buf[start] stands in the stream. */
static uint64_t at_byte(const struct native_parser *parser)
{
    return parser->stats.bytes - (parser->end - parser->start);
}

static void give_notice(const struct native_parser *parser, const struct native_notice *notice)
{
    if (parser->notice != NULL) parser->notice(parser->notice_ctx, notice);
}

/* ---- bytes that belong to no item */

/* Counts the frame that `bad` begins with. A LOCAL frame has no number in the sequence: such a frame does not count as
 * lost. */
static void count_bad_payload(struct native_parser *parser)
{
    parser->stats.bad_payload++;
    parser->stats.bad_unseen += (uint64_t)!parser->bad.is_local;
}

/* Ends the run of bad bytes, because an item follows or (at_end) the bytes are over. NATIVE_CUT means that the stream
 * seemed to end within a frame. If an item follows after all, the frame is not cut but broken. */
static void end_bad(struct native_parser *parser, int at_end)
{
    struct native_bad *bad = &parser->bad;
    if (bad->kind == NATIVE_NO_NOTICE) return;
    if (bad->kind == NATIVE_CUT && !at_end) {
        bad->kind = bad->has_header ? NATIVE_BAD_PAYLOAD : NATIVE_BAD_BYTES;
        if (bad->has_header) count_bad_payload(parser);
    }
    parser->stats.cuts += bad->kind == NATIVE_CUT;
    const struct native_notice notice = {bad->kind, bad->seq, bad->at_byte, bad->n, bad->t_ns};
    bad->kind = NATIVE_NO_NOTICE;
    give_notice(parser, &notice);
}

static void begin_bad(struct native_parser *parser, enum native_notice_kind kind, uint64_t at)
{
    end_bad(parser, 0);
    parser->bad = (struct native_bad){.kind = kind, .t_ns = parser->last_t_ns, .at_byte = at, .most = UINT64_MAX};
}

/* The header at hand is right, and what follows it is not its payload. */
static void begin_bad_frame(struct native_parser *parser, enum native_notice_kind kind,
                            const struct native_header *header)
{
    begin_bad(parser, kind, at_byte(parser));
    parser->bad.has_header = 1;
    parser->bad.is_local = (header->flags & NATIVE_LOCAL) != 0;
    parser->bad.seq = header->seq;
    parser->bad.t_ns = header->t_ns;
    parser->bad.most = NATIVE_HEADER_LEN + (uint64_t)header->length;
}

/* Adds n bytes from the present one on. Bytes beyond the length of a broken frame give a notice of their own. */
static void add_bad(struct native_parser *parser, uint64_t n)
{
    struct native_bad *bad = &parser->bad;
    uint64_t at = at_byte(parser);
    parser->stats.bad_bytes += n;
    if (bad->kind != NATIVE_NO_NOTICE && n > bad->most - bad->n) {
        const uint64_t rest = bad->most - bad->n;
        bad->n = bad->most;
        at += rest;
        n -= rest;
        begin_bad(parser, NATIVE_BAD_BYTES, at);
    }
    if (bad->kind == NATIVE_NO_NOTICE) begin_bad(parser, NATIVE_BAD_BYTES, at);
    bad->n += n;
}

/* No more bytes will come, and the item at hand is not complete. */
static void begin_cut(struct native_parser *parser)
{
    const uint8_t *at = bytes_of(parser) + parser->start;
    if (at[0] == NATIVE_SYNC && parser->end - parser->start >= NATIVE_HEADER_LEN) {
        struct native_header header;
        native_read_header(at, &header);
        begin_bad_frame(parser, NATIVE_CUT, &header);
    } else if (parser->bad.kind == NATIVE_NO_NOTICE || parser->bad.n == parser->bad.most) {
        begin_bad(parser, NATIVE_CUT, at_byte(parser));
    } /* else it is part of the garbage before it */
}

void native_parser_resume(struct native_parser *parser)
{
    const size_t rest = parser->end - parser->start;
    if (rest > 0 && parser->bad.kind == NATIVE_NO_NOTICE) begin_bad(parser, NATIVE_CUT, at_byte(parser));
    if (rest > 0) add_bad(parser, rest);
    end_bad(parser, 1);
    native_sequence_resume(&parser->sequence);
    parser->start = parser->end = 0;
    parser->finished = 0;
    parser->in_step = 1;
}

/* ---- frames */

static enum look look_frame(struct native_parser *parser)
{
    const uint8_t *frame = bytes_of(parser) + parser->start;
    size_t have = parser->end - parser->start;
    if (have < NATIVE_HEADER_LEN) return LOOK_WAIT;
    if (crc32c(0, frame, 24) != le_get32(frame + 24)) return LOOK_BAD;
    struct native_header header;
    native_read_header(frame, &header);
    if (header.length > NATIVE_MAX_PAYLOAD) return LOOK_BAD;
    if (have - NATIVE_HEADER_LEN < header.length) return LOOK_WAIT;
    if (parser->lent == NULL && crc32c(0, frame + NATIVE_HEADER_LEN, header.length) != header.payload_crc) {
        begin_bad_frame(parser, NATIVE_BAD_PAYLOAD, &header);
        count_bad_payload(parser);
        return LOOK_BAD;
    }
    parser->header = header;
    parser->frame = frame;
    parser->payload = frame + NATIVE_HEADER_LEN;
    return LOOK_GOOD;
}

static void count_notice(struct native_stats *stats, const struct native_notice *notice)
{
    stats->seq_gaps += notice->kind == NATIVE_GAP || notice->kind == NATIVE_RESTARTED;
    if (notice->kind == NATIVE_GAP) stats->seq_lost += notice->n;
    stats->repeated += notice->kind == NATIVE_REPEATED;
    stats->late += notice->kind == NATIVE_LATE;
    stats->restarts += notice->kind == NATIVE_RESTARTED;
}

/* Renews bad_unseen at a frame of the sequence. The frame's number shows all frames that are missing before it, broken
 * ones too, but none before the first frame of the sequence. So bad_unseen goes back to its value at the first one. */
static void see_bad(struct native_parser *parser, int is_first)
{
    if (is_first)
        parser->bad_before = parser->stats.bad_unseen;
    else
        parser->stats.bad_unseen = parser->bad_before;
}

/* 1: the frame is to be given; 0: it is dropped. */
static int take_frame(struct native_parser *parser)
{
    end_bad(parser, 0);
    uint32_t first, n;
    const int has_begun = parser->sequence.have;
    const enum native_notice_kind kind = native_sequence_take(&parser->sequence, &parser->header, &first, &n);
    const struct native_notice notice = {kind, first, at_byte(parser), n, parser->header.t_ns};
    parser->start += native_frame_len(parser->frame);
    parser->in_step = 1;
    parser->last_t_ns = parser->header.t_ns;
    if (kind != NATIVE_NO_NOTICE) {
        count_notice(&parser->stats, &notice);
        give_notice(parser, &notice);
    }
    if (kind == NATIVE_REPEATED || kind == NATIVE_LATE) return 0;
    if ((parser->header.flags & NATIVE_LOCAL) == 0) see_bad(parser, !has_begun || kind == NATIVE_RESTARTED);
    parser->stats.frames++;
    return 1;
}

static int is_printable(uint8_t byte)
{
    return byte >= 0x20 && byte <= 0x7e;
}

static enum look look_text(const struct native_parser *parser, size_t *len)
{
    const uint8_t *text = bytes_of(parser) + parser->start;
    size_t have = parser->end - parser->start, n = 0;
    while (n < have && n < NATIVE_MAX_TEXT - 2 && is_printable(text[n]))
        n++;
    *len = n;
    if (n < have && text[n] != '\r') return LOOK_BAD;
    if (n + 1 < have) return text[n + 1] == '\n' ? LOOK_GOOD : LOOK_BAD;
    return LOOK_WAIT;
}

static enum native_item take_text(struct native_parser *parser, size_t len)
{
    end_bad(parser, 0);
    memcpy(parser->text, bytes_of(parser) + parser->start, len);
    parser->text[len] = 0;
    parser->text_at = at_byte(parser);
    parser->start += len + 2;
    parser->stats.texts++;
    return NATIVE_TEXT;
}

/* Goes on at the next sync byte after the present one. */
static void skip(struct native_parser *parser)
{
    const uint8_t *from = bytes_of(parser) + parser->start, *to = bytes_of(parser) + parser->end;
    const uint8_t *sync = memchr(from + 1, NATIVE_SYNC, (size_t)(to - from) - 1);
    size_t n = (size_t)((sync != NULL ? sync : to) - from);
    add_bad(parser, n);
    parser->start += n;
    parser->in_step = 0;
}

enum native_item native_parser_next(struct native_parser *parser)
{
    while (parser->start < parser->end) {
        uint8_t first = bytes_of(parser)[parser->start];
        enum look look = LOOK_BAD;
        size_t text_len = 0;
        if (first == NATIVE_SYNC) {
            look = look_frame(parser);
            if (look == LOOK_GOOD && take_frame(parser)) return NATIVE_FRAME;
            if (look == LOOK_GOOD) continue;
        } else if (parser->in_step && is_printable(first)) {
            look = look_text(parser, &text_len);
            if (look == LOOK_GOOD) return take_text(parser, text_len);
        }
        if (look == LOOK_WAIT && !parser->finished) return NATIVE_MORE;
        if (look == LOOK_WAIT) begin_cut(parser);
        skip(parser);
    }
    if (parser->finished) end_bad(parser, 1);
    return NATIVE_MORE;
}
