#include <string.h>

#include "drivers/protocol/bytes.h"
#include "drivers/protocol/crc32c.h"
#include "drivers/protocol/native.h"

enum look { LOOK_GOOD, LOOK_WAIT, LOOK_BAD };

void native_parser_init(struct native_parser *parser)
{
    memset(parser, 0, sizeof *parser);
    parser->in_step = 1;
}

uint8_t *native_parser_room(struct native_parser *parser, size_t *room)
{
    size_t pending = parser->end - parser->start;
    /* Moving at most what was used up since the last move keeps the cost per byte constant. There is always
     * room after NATIVE_MORE: pending is less than a frame, and where start < pending, end < 2 pending. */
    if (pending <= parser->start && sizeof parser->buf - parser->end < NATIVE_MAX_FRAME) {
        memmove(parser->buf, parser->buf + parser->start, pending);
        parser->start = 0;
        parser->end = pending;
    }
    *room = sizeof parser->buf - parser->end;
    return parser->buf + parser->end;
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

void native_parser_resume(struct native_parser *parser)
{
    parser->stats.bad_bytes += parser->end - parser->start;
    parser->start = parser->end = 0;
    parser->finished = 0;
    parser->in_step = 1;
}

static enum look look_frame(struct native_parser *parser)
{
    const uint8_t *frame = parser->buf + parser->start;
    size_t have = parser->end - parser->start;
    if (have < NATIVE_HEADER_LEN) return LOOK_WAIT;
    if (crc32c(0, frame, 24) != le_get32(frame + 24)) return LOOK_BAD;
    struct native_header header;
    native_read_header(frame, &header);
    if (header.length > NATIVE_MAX_PAYLOAD) return LOOK_BAD;
    if (have - NATIVE_HEADER_LEN < header.length) return LOOK_WAIT;
    if (crc32c(0, frame + NATIVE_HEADER_LEN, header.length) != header.payload_crc) {
        parser->stats.bad_payload++;
        return LOOK_BAD;
    }
    parser->header = header;
    parser->frame = frame;
    parser->payload = frame + NATIVE_HEADER_LEN;
    return LOOK_GOOD;
}

static void count_seq(struct native_parser *parser)
{
    if ((parser->header.flags & NATIVE_LOCAL) != 0) return;
    uint32_t missing = parser->header.seq - parser->next_seq;
    if (parser->have_seq && missing != 0) {
        parser->stats.seq_gaps++;
        /* A jump back is a head that has started again. How many frames are missing is not known. */
        if (missing < UINT32_C(0x80000000)) parser->stats.seq_lost += missing;
    }
    parser->next_seq = parser->header.seq + 1;
    parser->have_seq = 1;
}

static enum native_item take_frame(struct native_parser *parser)
{
    parser->start += native_frame_len(parser->frame);
    parser->in_step = 1;
    parser->stats.frames++;
    count_seq(parser);
    return NATIVE_FRAME;
}

static int is_printable(uint8_t byte)
{
    return byte >= 0x20 && byte <= 0x7e;
}

static enum look look_text(const struct native_parser *parser, size_t *len)
{
    const uint8_t *text = parser->buf + parser->start;
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
    memcpy(parser->text, parser->buf + parser->start, len);
    parser->text[len] = 0;
    parser->start += len + 2;
    parser->stats.texts++;
    return NATIVE_TEXT;
}

/* Goes on at the next sync byte after the one at hand. */
static void skip(struct native_parser *parser)
{
    const uint8_t *from = parser->buf + parser->start, *to = parser->buf + parser->end;
    const uint8_t *sync = memchr(from + 1, NATIVE_SYNC, (size_t)(to - from) - 1);
    size_t n = (size_t)((sync != NULL ? sync : to) - from);
    parser->start += n;
    parser->stats.bad_bytes += n;
    parser->in_step = 0;
}

enum native_item native_parser_next(struct native_parser *parser)
{
    while (parser->start < parser->end) {
        uint8_t first = parser->buf[parser->start];
        enum look look = LOOK_BAD;
        size_t text_len = 0;
        if (first == NATIVE_SYNC) {
            look = look_frame(parser);
            if (look == LOOK_GOOD) return take_frame(parser);
        } else if (parser->in_step && is_printable(first)) {
            look = look_text(parser, &text_len);
            if (look == LOOK_GOOD) return take_text(parser, text_len);
        }
        if (look == LOOK_WAIT && !parser->finished) return NATIVE_MORE;
        skip(parser);
    }
    return NATIVE_MORE;
}
