/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/watch/past.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "drivers/protocol/native_encode.h"
#include "firmware_sim/app/studio/page_query.h"
#include "firmware_sim/base/clock.h"

enum {
    VERSION = 1,
    LOST_ROOM = 256, /* for a READER_LOST, which takes about 150 bytes */
    /* A piece ends after the block of points that fills it. */
    ROOM = PAST_PIECE + 4 * NATIVE_MAX_FRAME + LOST_ROOM,
    MOST_PIECES = 2 * (PAST_MOST_BYTES / PAST_PIECE),
};

struct piece {
    uint8_t *bytes; /* [ROOM]; the system gives the memory as it is written */
    size_t len;
    uint64_t base;   /* position of its first byte */
    uint64_t points; /* in it */
};

/* Descriptor, emitter, anchor: the frames that points need, as they came. */
enum { KINDS = 3 };
struct placing {
    uint8_t *frame; /* NULL: there is none */
    size_t len;
};

struct past {
    struct past_limits limits;
    uint64_t run; /* another one in each run of a head */
    /* only for the thread that takes frames */
    struct placing placing[KINDS];
    int is_new;          /* one of `placing` is not in the last piece yet */
    struct placing lost; /* the last READER_LOST, which has the sum of all */
    int lost_is_new;     /* it is not in the last piece yet */
    int after_pose;      /* the last frame had poses: the points that need them follow */

    pthread_mutex_t lock; /* of all below */
    struct piece piece[MOST_PIECES];
    uint32_t first, n; /* a ring of pieces */
    uint64_t points, bytes, end, gone, lost_frames;
    uint32_t next_seq; /* frames before this number were taken, or lost */
};

struct past *past_create(const struct past_limits *limits)
{
    struct past *past = calloc(1, sizeof *past);
    if (past == NULL) return NULL;
    past->limits = *limits;
    const int64_t now_ns = clock_now_ns();
    past->run = (uint64_t)clock_utc_ns(now_ns) ^ (uint64_t)now_ns << 20;
    pthread_mutex_init(&past->lock, NULL);
    return past;
}

void past_free(struct past *past)
{
    if (past == NULL) return;
    for (uint32_t i = 0; i < MOST_PIECES; i++)
        free(past->piece[i].bytes);
    for (int k = 0; k < KINDS; k++)
        free(past->placing[k].frame);
    free(past->lost.frame);
    pthread_mutex_destroy(&past->lock);
    free(past);
}

uint64_t past_run(const struct past *past)
{
    return past->run;
}

/* ---- taking */

static struct piece *piece_at(struct past *past, uint32_t i)
{
    return &past->piece[(past->first + i) % MOST_PIECES];
}

static void drop_oldest(struct past *past)
{
    struct piece *oldest = piece_at(past, 0);
    past->points -= oldest->points;
    past->bytes -= oldest->len;
    past->gone += oldest->points;
    free(oldest->bytes);
    *oldest = (struct piece){0};
    past->first = (past->first + 1) % MOST_PIECES;
    past->n--;
}

/* The last piece stays, however much it has. */
static void keep_limits(struct past *past)
{
    while (past->n > 1 && (past->points > past->limits.points || past->bytes > past->limits.bytes))
        drop_oldest(past);
}

static void append(struct past *past, struct piece *piece, const uint8_t *frame, size_t len)
{
    memcpy(piece->bytes + piece->len, frame, len);
    piece->len += len;
    past->bytes += len;
    past->end += len;
}

/* A reader that has these frames already, because it has read the piece before, finds them marked as repeated. */
static void append_placing(struct past *past, struct piece *piece, int again)
{
    for (int k = 0; k < KINDS; k++) {
        const struct placing *p = &past->placing[k];
        uint8_t *at = piece->bytes + piece->len;
        if (p->frame == NULL) continue;
        append(past, piece, p->frame, p->len);
        if (!again) continue;
        at[3] |= NATIVE_REPEAT | NATIVE_LOCAL;
        native_finish_frame(at, 0);
    }
}

/* The report stands where the loss was, or in the first piece, and in each later piece, marked as repeated. */
static void append_lost(struct past *past, struct piece *piece)
{
    uint8_t *at = piece->bytes + piece->len;
    if (past->lost.frame == NULL) return;
    append(past, piece, past->lost.frame, past->lost.len);
    if (!past->lost_is_new) at[3] |= NATIVE_REPEAT;
    native_finish_frame(at, 0);
    past->lost_is_new = 0;
}

/* The piece that a frame goes into; NULL: no memory. */
static struct piece *find_piece(struct past *past, const struct scanhead_frame *frame)
{
    struct piece *last = past->n > 0 ? piece_at(past, past->n - 1) : NULL;
    const int may_begin = frame->type == SCANHEAD_POSES || (frame->type == SCANHEAD_POINTS && !past->after_pose);
    const size_t need = frame->raw_len + KINDS * (size_t)NATIVE_MAX_FRAME + LOST_ROOM;
    if (last != NULL && !(may_begin && last->len >= PAST_PIECE) && last->len + need <= ROOM) {
        if (past->is_new) append_placing(past, last, 0);
        past->is_new = 0;
        if (past->lost_is_new) append_lost(past, last);
        return last;
    }
    if (past->n == MOST_PIECES) drop_oldest(past);
    last = piece_at(past, past->n);
    *last = (struct piece){.bytes = malloc(ROOM), .base = past->end};
    if (last->bytes == NULL) return NULL;
    past->n++;
    append_placing(past, last, !past->is_new);
    past->is_new = 0;
    append_lost(past, last);
    return last;
}

static void past_keep(struct past *past, const struct scanhead_frame *frame)
{
    const uint64_t points = frame->type == SCANHEAD_POINTS ? frame->n_points : 0;
    struct piece *piece = find_piece(past, frame);
    if (piece == NULL) {
        past->gone += points;
        return;
    }
    append(past, piece, frame->raw, frame->raw_len);
    piece->points += points;
    past->points += points;
    keep_limits(past);
}

/* A frame that is repeated says nothing new; its flags and its time may differ. */
static int past_is_same(const struct placing *p, const struct scanhead_frame *frame)
{
    return p->frame != NULL && p->len == frame->raw_len &&
           memcmp(p->frame + NATIVE_HEADER_LEN, frame->payload, frame->payload_len) == 0;
}

static void take_placing(struct past *past, int kind, const struct scanhead_frame *frame)
{
    struct placing *p = &past->placing[kind];
    if ((frame->flags & SCANHEAD_REPEAT) != 0 && past_is_same(p, frame)) return;
    uint8_t *copy = realloc(p->frame, frame->raw_len);
    if (copy == NULL) return; /* the next repetition brings it */
    p->frame = copy;
    p->len = frame->raw_len;
    memcpy(copy, frame->raw, frame->raw_len);
    past->is_new = 1;
    if (kind != 0) return;
    for (int k = 1; k < KINDS; k++) { /* emitter and anchor of the new descriptor follow it */
        free(past->placing[k].frame);
        past->placing[k] = (struct placing){0};
    }
}

/* READER_LOST comes to this taker alone: it has no number. */
static void take_lost(struct past *past, const struct scanhead_frame *frame)
{
    if (frame->type != SCANHEAD_EVENT || frame->event != SCANHEAD_EV_READER_LOST) return;
    past->lost_frames = frame->event_value[2];
    uint8_t *copy = frame->raw_len <= LOST_ROOM ? realloc(past->lost.frame, frame->raw_len) : NULL;
    if (copy == NULL) return; /* the next report has the sum */
    memcpy(copy, frame->raw, frame->raw_len);
    past->lost = (struct placing){copy, frame->raw_len};
    past->lost_is_new = 1;
    if (past->n == 0) return;
    find_piece(past, frame); /* which appends the report */
    keep_limits(past);
}

static void take_numbered(struct past *past, const struct scanhead_frame *frame)
{
    switch (frame->type) {
    case SCANHEAD_DESCRIPTOR:
        take_placing(past, 0, frame);
        break;
    case SCANHEAD_EMITTER:
        take_placing(past, 1, frame);
        break;
    case SCANHEAD_ANCHOR:
        take_placing(past, 2, frame);
        break;
    case SCANHEAD_POINTS:
    case SCANHEAD_POSES:
    case SCANHEAD_ATTRIBUTES:
    case SCANHEAD_COLOURS:
        past_keep(past, frame);
        past->after_pose = frame->type == SCANHEAD_POSES;
        break;
    case SCANHEAD_EVENT: /* it begins no piece */
        if (frame->event == SCANHEAD_EV_SCAN_END && past->n > 0) past_keep(past, frame);
        break;
    default:
        break;
    }
    past->next_seq = frame->seq + 1;
}

void past_take(struct past *past, const struct scanhead_frame *frame)
{
    pthread_mutex_lock(&past->lock);
    if ((frame->flags & SCANHEAD_LOCAL) != 0)
        take_lost(past, frame);
    else
        take_numbered(past, frame);
    pthread_mutex_unlock(&past->lock);
}

/* ---- giving */

static struct piece *past_find(struct past *past, uint64_t *from)
{
    if (past->n == 0) return NULL;
    if (*from < piece_at(past, 0)->base) *from = piece_at(past, 0)->base;
    for (uint32_t i = 0; i < past->n; i++) {
        struct piece *piece = piece_at(past, i);
        if (*from < piece->base + piece->len) return piece;
    }
    return NULL;
}

static void past_put_head(const struct past *past, uint64_t next, uint8_t *to)
{
    memcpy(to, "SHPA", 4);
    le_put32(to + 4, VERSION);
    le_put64(to + 8, past->run);
    le_put64(to + 16, next);
    le_put64(to + 24, past->end);
    le_put64(to + 32, past->gone);
    le_put64(to + 40, past->lost_frames);
    le_put32(to + 48, past->next_seq);
    le_put32(to + 52, 0);
}

int past_get(struct past *past, const char *query, struct web_body *out, struct sh_err *err)
{
    struct page_word words[] = {{"from", 0, PAST_MOST_POSITION, 1, 0}, {.name = NULL}};
    const int rc = page_read_query(words, query, err);
    if (rc != SH_OK) return rc;
    uint64_t from = (uint64_t)words[0].value;
    pthread_mutex_lock(&past->lock);
    const struct piece *piece = past_find(past, &from);
    const size_t len = piece != NULL ? piece->len - (size_t)(from - piece->base) : 0;
    *out = (struct web_body){"application/octet-stream", malloc(PAST_HEAD_LEN + len), PAST_HEAD_LEN + len};
    if (out->bytes != NULL) {
        past_put_head(past, piece != NULL ? from + len : past->end, (uint8_t *)out->bytes);
        if (len > 0) memcpy(out->bytes + PAST_HEAD_LEN, piece->bytes + (from - piece->base), len);
    }
    pthread_mutex_unlock(&past->lock);
    return out->bytes != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for the points so far");
}
