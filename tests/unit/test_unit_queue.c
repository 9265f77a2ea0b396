/* SPDX-License-Identifier: MIT */
/* The queue of units to a client, and the frames that are kept for one that joins. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <pthread.h>
#include <stdatomic.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/loop/latched.h"
#include "firmware_sim/loop/unit_queue.h"

enum { CAP = 1000, HEAD = 32 }; /* a unit's cost beside its bytes: two ticks, a kind and a length, aligned */

static void units_come_out_as_they_went_in(void **state)
{
    (void)state;
    struct unit_queue queue;
    uint8_t unit[200], out[200];
    uint64_t put = 0, got = 0;
    uint32_t random = 1;
    assert_int_equal(unit_queue_create(&queue, CAP), 0);
    while (got < 10000) {
        random = random * 1664525 + 1013904223;
        size_t len = 1 + (random >> 8) % sizeof unit, left;
        memset(unit, (int)(put & 255), len);
        unit[0] = (uint8_t)len;
        const uint32_t room = unit_queue_room(&queue);
        const struct unit_kind kind = {put, 2 * put, (int)(put & 1)};
        const int lost = unit_queue_put(&queue, unit, len, &kind);
        assert_int_equal(lost, room < len + HEAD); /* whole, or not at all */
        put += !lost;
        if (!lost && (random & 3) != 0) continue;
        /* The oldest is read in pieces. */
        const struct unit_kind oldest = unit_queue_kind(&queue);
        assert_true(oldest.tick == got && oldest.made_tick == 2 * got && oldest.is_reply == (int)(got & 1));
        size_t n = 0;
        for (int last = 0; !last;) {
            const uint8_t *rest = unit_queue_next(&queue, &left);
            size_t piece = left < 7 ? left : 7;
            memcpy(out + n, rest, piece);
            n += piece;
            last = unit_queue_written(&queue, piece);
            assert_int_equal(last, piece == left);
        }
        assert_int_equal(n, out[0]);
        for (size_t i = 1; i < n; i++)
            assert_int_equal(out[i], got & 255);
        got++;
    }
    unit_queue_clear(&queue);
    size_t len;
    assert_null(unit_queue_next(&queue, &len));
    assert_int_equal(unit_queue_room(&queue), CAP);
    unit_queue_free(&queue);
}

static size_t encode(uint8_t *dst, int type, uint32_t number)
{
    static const struct native_beam beam[NATIVE_MAX_BEAMS];
    const struct native_descriptor d = {.scan = number};
    const struct native_anchor a = {.station = number};
    const struct native_emitter e = {
        .kind = NATIVE_EMIT_BEAMS, .n_beams = NATIVE_MAX_BEAMS, .steps = number, .turn = 1, .sequence_ns_den = 1};
    if (type == NATIVE_DESCRIPTOR) return native_encode_descriptor(dst, 4096, &d, 0, 0);
    if (type == NATIVE_ANCHOR) return native_encode_anchor(dst, 4096, &a, 0, 0);
    return native_encode_emitter(dst, 4096, &e, beam, 0, 0);
}

static void the_last_ones_are_kept(void **state)
{
    (void)state;
    static struct latched kept;
    static uint8_t frame[4096], copy[LATCHED_MAX_BYTES];
    static const int order[] = {NATIVE_ANCHOR, NATIVE_DESCRIPTOR, NATIVE_EMITTER, NATIVE_ANCHOR};
    const struct native_event event = {.code = NATIVE_EV_STATE};
    uint32_t version, was;
    assert_int_equal(latched_copy(&kept, copy, &was), 0);
    native_encode_event(frame, sizeof frame, &event, 0, 0);
    latched_put(&kept, frame);
    assert_int_equal(latched_copy(&kept, copy, &version), 0);
    assert_int_equal(version, was);
    for (uint32_t i = 0; i < 4; i++) {
        encode(frame, order[i], i);
        native_finish_frame(frame, 7 + i);
        latched_put(&kept, frame);
    }
    uint32_t len = latched_copy(&kept, copy, &version), at = 0;
    assert_int_not_equal(version, was);
    static const int wanted[] = {NATIVE_DESCRIPTOR, NATIVE_EMITTER, NATIVE_ANCHOR};
    static struct native_parser parser; /* it checks both sums of each frame */
    native_parser_init(&parser);
    for (int i = 0; i < 3; i++) {
        size_t room;
        uint8_t *to = native_parser_room(&parser, &room);
        size_t n = native_frame_len(copy + at);
        assert_true(n <= room && at + n <= len);
        memcpy(to, copy + at, n);
        native_parser_added(&parser, n);
        assert_int_equal(native_parser_next(&parser), NATIVE_FRAME);
        assert_int_equal(parser.header.type, wanted[i]);
        assert_int_equal(parser.header.flags, NATIVE_REPEAT | NATIVE_LOCAL);
        at += (uint32_t)n;
    }
    assert_int_equal(at, len);
    struct native_anchor anchor;
    assert_int_equal(native_decode_anchor(parser.payload, parser.header.length, &anchor), 0);
    assert_int_equal(anchor.station, 3); /* the later of the two */
}

static struct latched shared;
static _Atomic int over;

static void *keep(void *arg)
{
    static uint8_t frame[4096];
    for (uint32_t i = 1; !atomic_load(&over); i++) {
        encode(frame, NATIVE_DESCRIPTOR, i);
        latched_put(&shared, frame);
        encode(frame, NATIVE_EMITTER, i);
        latched_put(&shared, frame);
        for (volatile int rest = 0; rest < 2000; rest++) /* in the head this takes a second */
            continue;
    }
    return arg;
}

/* A thread that reads while another one stores frames never gets half of one frame and half of another. */
static void copies_are_whole(void **state)
{
    (void)state;
    static uint8_t copy[LATCHED_MAX_BYTES];
    pthread_t thread;
    uint32_t last = 0, seen = 0;
    assert_int_equal(pthread_create(&thread, NULL, keep, NULL), 0);
    while (seen < 200) {
        uint32_t version;
        uint32_t len = latched_copy(&shared, copy, &version);
        if (len == 0) continue;
        const uint32_t n = (uint32_t)native_frame_len(copy);
        struct native_header header;
        struct native_descriptor d;
        native_read_header(copy, &header);
        assert_int_equal(native_decode_descriptor(copy + NATIVE_HEADER_LEN, header.length, &d), 0);
        assert_true(d.scan >= last);
        seen += d.scan != last;
        last = d.scan;
        if (n == len) continue;
        struct native_emitter e;
        native_read_header(copy + n, &header);
        assert_int_equal(native_decode_emitter(copy + n + NATIVE_HEADER_LEN, header.length, &e), 0);
        assert_true(e.steps == d.scan || e.steps + 1 == d.scan); /* it follows the descriptor */
    }
    atomic_store(&over, 1);
    pthread_join(thread, NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(units_come_out_as_they_went_in),
        cmocka_unit_test(the_last_ones_are_kept),
        cmocka_unit_test(copies_are_whole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
