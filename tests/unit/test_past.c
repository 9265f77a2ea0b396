/* SPDX-License-Identifier: MIT */
/* The points that a head keeps for pages that come late: pieces that a reader can begin with, bounds, and queries. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "drivers/protocol/native_encode.h"
#include "firmware_sim/app/studio/watch/past.h"

enum { POINTS_OF_FRAME = 3000 };

static uint8_t raw[NATIVE_MAX_FRAME];

/* Gives a frame with a payload of zeros, but for its first byte; n: its points. */
static void give(struct past *past, int type, int flags, uint32_t seq, uint32_t n, uint8_t mark)
{
    const size_t payload = type == SCANHEAD_POINTS ? NATIVE_POINTS_HEAD_LEN + (size_t)NATIVE_POINT_LEN * n : 64;
    memset(raw, 0, sizeof raw);
    raw[0] = NATIVE_SYNC;
    raw[1] = (uint8_t)type;
    raw[2] = 1;
    raw[3] = (uint8_t)flags;
    le_put32(raw + 4, (uint32_t)payload);
    raw[NATIVE_HEADER_LEN] = mark;
    native_reseal(raw, NATIVE_HEADER_LEN + payload);
    native_finish_frame(raw, seq);
    const struct scanhead_frame frame = {.type = type,
                                         .flags = flags,
                                         .seq = seq,
                                         .payload = raw + NATIVE_HEADER_LEN,
                                         .payload_len = payload,
                                         .raw = raw,
                                         .raw_len = NATIVE_HEADER_LEN + payload,
                                         .n_points = n};
    past_take(past, &frame);
}

/* Gives an event of the head; its last value is `value`. */
static void give_event(struct past *past, uint32_t code, int flags, uint32_t seq, uint64_t value)
{
    const struct native_event event = {.code = code, .a = 1, .b = 2, .c = value};
    native_encode_event(raw, sizeof raw, &event, 0, (uint8_t)flags);
    const size_t len = native_finish_frame(raw, seq);
    const struct scanhead_frame frame = {.type = SCANHEAD_EVENT,
                                         .flags = flags,
                                         .seq = seq,
                                         .payload = raw + NATIVE_HEADER_LEN,
                                         .payload_len = len - NATIVE_HEADER_LEN,
                                         .raw = raw,
                                         .raw_len = len,
                                         .event = code,
                                         .event_value = {1, 2, value}};
    past_take(past, &frame);
}

/* Gives a scan: the frames that place its points, then so many frames of them. The frames' numbers go on from *seq. */
static void give_scan(struct past *past, uint32_t *seq, uint32_t frames, uint8_t mark)
{
    give(past, SCANHEAD_DESCRIPTOR, 0, (*seq)++, 0, mark);
    give(past, SCANHEAD_ANCHOR, 0, (*seq)++, 0, mark);
    for (uint32_t i = 0; i < frames; i++) {
        if (i % 8 == 7) give(past, SCANHEAD_DESCRIPTOR, SCANHEAD_REPEAT, (*seq)++, 0, mark);
        give(past, SCANHEAD_POINTS, 0, (*seq)++, POINTS_OF_FRAME, mark);
    }
}

struct reading {
    uint64_t at, end, gone, lost;
    uint32_t next_seq, pieces, points, last_seq;
    int descriptor, anchor; /* marks of those that came last */
};

static void read_frames(struct reading *r, const uint8_t *frame, const uint8_t *end)
{
    for (int first = 1; frame < end; frame += native_frame_len(frame), first = 0) {
        struct native_header h;
        native_read_header(frame, &h);
        const int mark = frame[NATIVE_HEADER_LEN], again = r->pieces > 1 && (h.flags & NATIVE_LOCAL) != 0;
        if (first) assert_int_equal(h.type, NATIVE_DESCRIPTOR);
        if (h.type == NATIVE_DESCRIPTOR) r->descriptor = mark;
        if (h.type == NATIVE_ANCHOR) r->anchor = mark;
        if (again) assert_true((h.flags & NATIVE_REPEAT) != 0 && h.seq == 0);
        if (h.type != NATIVE_POINTS) continue;
        assert_true(r->descriptor == mark && r->anchor == mark); /* it can be placed by what this reader has */
        assert_true(r->points == 0 || h.seq > r->last_seq);
        r->last_seq = h.seq;
        r->points += POINTS_OF_FRAME;
    }
}

/* Reads all kept frames, from a position on, as a page does. */
static struct reading read_all(struct past *past, uint64_t from)
{
    struct reading r = {.at = from, .end = from + 1, .descriptor = -1, .anchor = -1};
    while (r.at != r.end) {
        char query[32];
        struct web_body body;
        struct sh_err err = {0};
        snprintf(query, sizeof query, "from=%llu", (unsigned long long)r.at);
        assert_int_equal(past_get(past, query, &body, &err), SH_OK);
        const uint8_t *b = (const uint8_t *)body.bytes;
        assert_memory_equal(b, "SHPA", 4);
        assert_true(body.len <= PAST_HEAD_LEN + PAST_PIECE + 4 * NATIVE_MAX_FRAME);
        r.pieces++;
        read_frames(&r, b + PAST_HEAD_LEN, b + body.len);
        assert_true(body.len == PAST_HEAD_LEN || le_get64(b + 16) > r.at);
        r.at = le_get64(b + 16);
        r.end = le_get64(b + 24);
        r.gone = le_get64(b + 32);
        r.lost = le_get64(b + 40);
        r.next_seq = le_get32(b + 48);
        free(body.bytes);
    }
    return r;
}

static void any_piece_can_be_the_first(void **state)
{
    (void)state;
    const struct past_limits limits = {PAST_MOST_POINTS, PAST_MOST_BYTES};
    struct past *past = past_create(&limits);
    uint32_t seq = 5;
    assert_int_equal(read_all(past, 0).points, 0);
    give_event(past, SCANHEAD_EV_READER_LOST, SCANHEAD_LOCAL, 0, 7);
    give_scan(past, &seq, 40, 1);
    give_scan(past, &seq, 30, 2);
    const struct reading all = read_all(past, 0);
    assert_int_equal(all.points, 70 * POINTS_OF_FRAME);
    assert_int_equal(all.next_seq, seq);
    assert_int_equal(all.gone, 0);
    assert_int_equal(all.lost, 7);
    assert_true(all.pieces > 3);
    /* Later frames are read from the reader's position on, and none twice. */
    const uint32_t before = seq - 1;
    give(past, SCANHEAD_POINTS, 0, seq++, POINTS_OF_FRAME, 2);
    char query[32];
    struct web_body body;
    struct sh_err err = {0};
    snprintf(query, sizeof query, "from=%llu", (unsigned long long)all.end);
    assert_int_equal(past_get(past, query, &body, &err), SH_OK);
    struct native_header h;
    native_read_header((const uint8_t *)body.bytes + PAST_HEAD_LEN, &h);
    assert_true(h.type == NATIVE_POINTS && h.seq == before + 1);
    free(body.bytes);
    assert_int_equal(read_all(past, UINT32_MAX).points, 0); /* a position of nobody's */
    past_free(past);
}

/* Whole pieces are dropped, so up to a piece less is kept than the limit allows. */
static void the_oldest_go_and_are_counted(void **state)
{
    (void)state;
    const struct past_limits limits = {.points = 200000, .bytes = PAST_MOST_BYTES};
    struct past *past = past_create(&limits);
    uint32_t seq = 0;
    for (uint8_t scan = 1; scan <= 9; scan++) {
        give_scan(past, &seq, 30, scan);
        const struct reading r = read_all(past, 0);
        const uint32_t all = scan * 30u * POINTS_OF_FRAME;
        assert_int_equal(r.points + r.gone, all);
        assert_true(r.points <= limits.points);
        assert_true(r.points + PAST_PIECE / NATIVE_POINT_LEN + POINTS_OF_FRAME >
                    (all < limits.points ? all : limits.points));
        assert_int_equal(r.last_seq, seq - 1);
    }
    past_free(past);
}

/* Writes the kinds of all kept frames, a letter each: D, A, P, L for READER_LOST, E for SCAN_END, ? for others. Frames
 * that open a piece are left out where the piece before has them, too. */
static void kinds_of(struct past *past, char *to)
{
    struct web_body body;
    struct sh_err err = {0};
    assert_int_equal(past_get(past, "", &body, &err), SH_OK);
    const uint8_t *frame = (const uint8_t *)body.bytes + PAST_HEAD_LEN, *end = (const uint8_t *)body.bytes + body.len;
    for (; frame < end; frame += native_frame_len(frame)) {
        static const char letters[] = "?DAP";
        struct native_event event = {0};
        if (frame[1] < sizeof letters - 1) *to++ = letters[frame[1]];
        if (frame[1] < sizeof letters - 1) continue;
        assert_int_equal(
            native_decode_event(frame + NATIVE_HEADER_LEN, native_frame_len(frame) - NATIVE_HEADER_LEN, &event), SH_OK);
        *to++ = event.code == NATIVE_EV_READER_LOST ? 'L' : event.code == NATIVE_EV_SCAN_END ? 'E' : '?';
    }
    *to = '\0';
    free(body.bytes);
}

/* A loss is known from its report on, also where no points follow it. Before there are points, the last report counts:
 * it has the sum. */
static void losses_and_ends_are_kept(void **state)
{
    (void)state;
    const struct past_limits limits = {PAST_MOST_POINTS, PAST_MOST_BYTES};
    struct past *past = past_create(&limits);
    uint32_t seq = 0;
    char kinds[64];
    give_event(past, SCANHEAD_EV_SCAN_END, 0, seq++, 0); /* without a piece it is not kept */
    give_event(past, SCANHEAD_EV_READER_LOST, SCANHEAD_LOCAL, 0, 2);
    assert_int_equal(read_all(past, 0).lost, 2);
    assert_int_equal(read_all(past, 0).next_seq, 1);
    give_event(past, SCANHEAD_EV_READER_LOST, SCANHEAD_LOCAL, 0, 3);
    give_scan(past, &seq, 2, 1);
    give_event(past, SCANHEAD_EV_SETTINGS, 0, seq++, 0);
    give_event(past, SCANHEAD_EV_READER_LOST, SCANHEAD_LOCAL, 0, 13);
    give_event(past, SCANHEAD_EV_READER_LOST, SCANHEAD_LOCAL, 0, 653);
    kinds_of(past, kinds);
    assert_string_equal(kinds, "DALPPLL");
    assert_int_equal(read_all(past, 0).lost, 653);
    give_event(past, SCANHEAD_EV_SCAN_END, 0, seq++, 0);
    give_scan(past, &seq, 1, 2);
    kinds_of(past, kinds);
    assert_string_equal(kinds, "DALPPLLEDAP");
    past_free(past);
}

static void a_wrong_query_is_refused(void **state)
{
    (void)state;
    static const char *const bad[] = {"from", "from=",        "from=-1", "from=1x", "from=1234567890123456789",
                                      "to=1", "from=1&from=2"};
    const struct past_limits limits = {PAST_MOST_POINTS, PAST_MOST_BYTES};
    struct past *past = past_create(&limits);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        struct web_body body;
        struct sh_err err = {0};
        assert_int_equal(past_get(past, bad[i], &body, &err), SH_EINPUT);
        assert_non_null(strstr(err.text, "allowed"));
    }
    past_free(past);
}

/* A piece ends before poses or points, not between points and the frames that belong to them. */
static void what_belongs_together_is_in_one_piece(void **state)
{
    (void)state;
    const struct past_limits limits = {PAST_MOST_POINTS, PAST_MOST_BYTES};
    struct past *past = past_create(&limits);
    uint32_t seq = 0, ends = 0;
    give_scan(past, &seq, 0, 1);
    for (int i = 0; i < 60; i++) {
        give(past, SCANHEAD_POSES, 0, seq++, 0, 1);
        give(past, SCANHEAD_POINTS, 0, seq++, POINTS_OF_FRAME, 1);
        give(past, SCANHEAD_ATTRIBUTES, 0, seq++, 0, 1);
        give(past, SCANHEAD_COLOURS, 0, seq++, 0, 1);
    }
    for (uint64_t at = 0, end = 1; at != end;) {
        char query[32];
        struct web_body body;
        struct sh_err err = {0};
        snprintf(query, sizeof query, "from=%llu", (unsigned long long)at);
        assert_int_equal(past_get(past, query, &body, &err), SH_OK);
        const uint8_t *b = (const uint8_t *)body.bytes, *frame = b + PAST_HEAD_LEN, *last = frame;
        for (; frame < b + body.len; frame += native_frame_len(frame))
            last = frame;
        assert_int_equal(last[1], NATIVE_COLOURS);
        at = le_get64(b + 16);
        end = le_get64(b + 24);
        ends++;
        free(body.bytes);
    }
    assert_true(ends > 3);
    past_free(past);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_piece_can_be_the_first),
        cmocka_unit_test(the_oldest_go_and_are_counted),
        cmocka_unit_test(losses_and_ends_are_kept),
        cmocka_unit_test(a_wrong_query_is_refused),
        cmocka_unit_test(what_belongs_together_is_in_one_piece),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
