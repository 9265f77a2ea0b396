/* SPDX-License-Identifier: MIT */
/* Frames of a planar head become whole turns: the places of shots, and missing frames. The head has 16 steps a turn:
 * steps 3 to 14 are cast, and step 6 looks straight ahead. It makes 100 turns a second. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/native_encode.h"
#include "drivers/protocol/planar_scan.h"
#include "tests/common/protocol_rig.h"

enum { STEPS = 16, FIRST = 3, LAST = 14, N = LAST - FIRST + 1, FRONT = 6 };

static struct protocol_rig rig;
static struct planar_scan scan;
static struct planar_news news; /* of all frames since clear() */
static struct protocol_rig_shot shot[N];
static int left_out; /* the frame with this number from now on, from 1, is dropped; 0: none */

static void frame(void *protocol, const uint8_t *bytes, size_t len)
{
    (void)protocol;
    (void)len;
    if (left_out != 0 && --left_out == 0) return;
    const struct planar_news n = planar_scan_frame(&scan, bytes);
    news.begun += n.begun;
    news.whole += n.whole;
    news.broken += n.broken;
}

static void open_head(int turn, int attributes)
{
    static const struct protocol_ops ops = {.name = "test", .frame = frame};
    memset(&rig, 0, sizeof rig);
    rig.ops = &ops;
    rig.attributes = attributes;
    rig.scan_t0_ns = 5000000000;
    planar_scan_init(&scan);
    left_out = 0;
    protocol_rig_planar(&rig, STEPS, FIRST, LAST, FRONT, turn, 100);
    protocol_rig_describe(&rig, 0);
    for (int i = 0; i < N; i++)
        shot[i] =
            (struct protocol_rig_shot){.n = 1, .range_m = {1.0 + i}, .refl_cdb = {(int16_t)-i}, .amplitude_cdb = {1}};
}

static void expect(int begun, int whole, uint32_t broken)
{
    assert_int_equal(news.begun, begun);
    assert_int_equal(news.whole, whole);
    assert_int_equal(news.broken, broken);
    news = (struct planar_news){0, 0, 0};
}

/* Feeds shots from..to of a turn, in the order of firing, as one frame of points. */
static void part(uint32_t line, int from, int to)
{
    protocol_rig_part(&rig, line, (uint32_t)from, (uint32_t)(to - from) + 1, shot + from);
}

/* Feeds three frames and the end. */
static void turn(uint32_t line)
{
    part(line, 0, 3);
    part(line, 4, 7);
    part(line, 8, N - 1);
    protocol_rig_turn_end(&rig, line, 0);
}

/* The rig looks to the right by turn * (step - 6) / 16 of a turn. The scan's numbers rise to the left,
 * counter-clockwise, and `front` is the number straight ahead. */
static void echoes_stand_where_they_look(void **state)
{
    (void)state;
    for (int way = -1; way <= 1; way += 2) {
        open_head(way, 0);
        turn(0);
        expect(1, 1, 0);
        assert_int_equal(scan.head.first, FIRST);
        assert_int_equal(scan.head.last, LAST);
        assert_int_equal(scan.head.front, way < 0 ? FRONT : FIRST + LAST - FRONT);
        assert_int_equal(scan.head.n, N);
        for (int i = 0; i < N; i++) {
            const int left = -way * (FIRST + i - FRONT); /* steps counter-clockwise from ahead */
            const int place = scan.head.front + left - scan.head.first;
            assert_in_range(place, 0, N - 1);
            assert_int_equal(scan.whole->n[place], 1);
            const struct planar_echo *echo = &scan.whole->echo[place][0];
            assert_int_equal(echo->range, 1000000 * (1 + i)); /* counts of 1e-6 m */
            assert_int_equal(echo->refl_cdb, -i);
            assert_int_equal(echo->amplitude_cdb, NATIVE_AMPLITUDE_NONE);
        }
    }
}

/* An encoder has few more counts than steps. The nearest step is right while a count is less than a step. */
static void coarse_encoders(void **state)
{
    (void)state;
    open_head(-1, 0);
    for (int k = 0; k < 3; k++) { /* first the steps change alone, then the counts */
        const uint32_t steps = k == 0 ? 3000 : 2999, counts = k < 2 ? 4096 : 8192;
        protocol_rig_planar(&rig, steps, 0, (int)steps - 1, 7, -1, 10);
        rig.descriptor.pan_counts_per_turn = counts;
        protocol_rig_describe(&rig, 0);
        uint8_t bytes[512];
        struct line_block b;
        struct sh_err err;
        news = (struct planar_news){0, 0, 0};
        assert_int_equal(line_block_alloc(&b, 1, &err), SH_OK);
        b.n_points = b.n_pulses = 1;
        b.line = (uint32_t)k;
        b.echo[0] = 0x11;
        for (uint32_t i = 0; i < steps; i++) {
            const uint32_t right = (steps + 7 - i) % steps; /* in steps; c is the nearest count */
            b.c[0] = (right * counts + steps / 2) / steps % counts;
            b.a[0] = i + 5000 * (uint32_t)k;
            planar_scan_frame(&scan, (native_encode_points(bytes, sizeof bytes, &b, 0), bytes));
        }
        line_block_free(&b);
        assert_non_null(scan.whole);
        for (uint32_t i = 0; i < steps; i++)
            assert_int_equal(scan.whole->echo[i][0].range, i + 5000 * (uint32_t)k);
    }
}

static void times_and_numbers(void **state)
{
    (void)state;
    open_head(-1, 0);
    turn(7);
    assert_int_equal(scan.whole->t0_ns, 5070000000); /* of step 0, which is not cast */
    assert_int_equal(scan.whole->number, 7);
    const struct planar_turn *before = scan.whole;
    turn(9);
    expect(2, 2, 1);
    assert_int_equal(scan.whole->number, 9);
    part(10, 0, 3);
    assert_int_equal(scan.t0_ns, 5100000000);
    assert_int_equal(scan.whole->number, 9); /* the last whole one stays while the next one comes */
    assert_ptr_not_equal(scan.whole, before);
    rig.descriptor.scan = 2;
    rig.scan_t0_ns = 50000000000;
    protocol_rig_describe(&rig, 0);
    turn(0);
    expect(2, 1, 0); /* turn 10 is the one within which the scan ended */
    assert_int_equal(scan.whole->t0_ns, 50000000000);
    assert_int_equal(scan.whole->number, 11);
}

/* There are six echoes. Four are kept, the first three and the last, each with its own amplitude. */
static void many_echoes(void **state)
{
    (void)state;
    uint8_t bytes[1024];
    struct line_block b;
    struct sh_err err;
    open_head(-1, 1);
    protocol_rig_planar(&rig, STEPS, 4, 4, FRONT, -1, 10);
    protocol_rig_describe(&rig, 0);
    assert_int_equal(line_block_alloc(&b, 6, &err), SH_OK);
    assert_int_equal(line_block_alloc_attributes(&b, &err), SH_OK);
    b.n_pulses = 1;
    b.n_points = 6;
    for (uint32_t i = 0; i < 6; i++) {
        b.a[i] = 100 * (i + 1);
        b.c[i] = 0x20000000; /* two steps to the right of step 6 */
        b.echo[i] = (uint8_t)((i + 1) | 6 << 4);
        b.refl_cdb[i] = (int16_t)(10 * (i + 1));
        b.amplitude_cdb[i] = (int16_t)(i + 1);
    }
    const size_t len = native_encode_points(bytes, sizeof bytes, &b, 0);
    for (size_t at = 0; at < len; at += native_frame_len(bytes + at))
        frame(NULL, bytes + at, 0);
    line_block_free(&b);
    expect(1, 1, 0);
    assert_int_equal(scan.whole->n[0], 4);
    static const uint32_t kept[] = {1, 2, 3, 6};
    for (int k = 0; k < 4; k++) {
        assert_int_equal(scan.whole->echo[0][k].range, 100 * kept[k]);
        assert_int_equal(scan.whole->echo[0][k].refl_cdb, 10 * kept[k]);
        assert_int_equal(scan.whole->echo[0][k].amplitude_cdb, kept[k]);
    }
}

static void shots_without_echo(void **state)
{
    (void)state;
    open_head(-1, 1);
    for (int i = 0; i < N; i += 2)
        shot[i].n = 0;
    turn(0);
    expect(1, 1, 0);
    for (int i = 0; i < N; i++)
        assert_int_equal(scan.whole->n[i], i % 2);
}

/* Any one frame of a turn is missing: 3 of points, each with attributes or without. The turn is counted once. */
static void a_frame_is_missing(void **state)
{
    (void)state;
    for (int attributes = 0; attributes < 2; attributes++)
        for (int k = 1; k <= 3 * (1 + attributes); k++) {
            open_head(1, attributes);
            turn(0);
            expect(1, 1, 0);
            left_out = k;
            turn(1);
            expect(1, 0, 1);
            assert_int_equal(scan.whole->t0_ns, rig.scan_t0_ns); /* still turn 0 */
            left_out = 3 * (1 + attributes) + 1;                 /* its end: nothing is missing */
            turn(2);
            expect(1, 1, 0);
            turn(3);
            expect(1, 1, 0);
        }
}

/* The last attributes of a turn are lost. The next turn's frame has as many points, and all of it but the attributes is
 * lost. */
static void attributes_of_another_turn(void **state)
{
    (void)state;
    open_head(-1, 1);
    part(0, 0, 3);
    part(0, 4, 7);
    left_out = 2;
    part(0, 8, N - 1);
    left_out = 1;
    part(1, 0, 3);
    expect(1, 0, 0);
    part(1, 4, 7);
    expect(1, 0, 1);
}

static void turns_are_missing(void **state)
{
    (void)state;
    open_head(-1, 0);
    turn(0);
    protocol_rig_turn_end(&rig, 1, 0); /* all its points */
    turn(5);                           /* 2, 3, 4 */
    expect(3, 2, 4);
    part(6, 0, 3);
    turn(9); /* the rest of 6; 7, 8 */
    expect(2, 1, 3);
    rig.scan_t0_ns += 60000000000; /* another scan, whose descriptor is missing, too; 0, 1 */
    turn(2);
    expect(1, 1, 2);
}

/* These turns could not become whole, so they are no losses. Only the last one is a loss. */
static void what_is_no_loss(void **state)
{
    (void)state;
    open_head(-1, 0);
    part(3, 4, 7); /* the client came within it */
    part(3, 8, N - 1);
    protocol_rig_turn_end(&rig, 3, 0);
    expect(1, 0, 0);
    part(4, 0, 3);
    protocol_rig_turn_end(&rig, 4, LINE_PARTIAL); /* the scan was stopped within it */
    expect(1, 0, 0);
    rig.scan_t0_ns += 60000000000; /* another scan, whose descriptor is missing */
    turn(0);
    expect(1, 1, 0);
    open_head(-1, 0);
    protocol_rig_turn_end(&rig, 8, 0);
    turn(9);
    expect(2, 1, 0);
    open_head(-1, 0);
    part(0, 0, 3); /* the client was there from its first step on */
    protocol_rig_turn_end(&rig, 0, 0);
    expect(1, 0, 1);
}

static void parts_of_two_turns_make_none(void **state)
{
    (void)state;
    open_head(-1, 1);
    turn(0);
    part(1, 0, 3);
    part(1, 4, 7);
    rig.scan_t0_ns += 60000000000; /* a turn of that number in another scan */
    part(1, 8, N - 1);
    protocol_rig_turn_end(&rig, 1, 0);
    expect(3, 1, 3); /* turn 1 of both scans, and turn 0 of the second */
    part(2, 0, 3);
    part(2, 0, 3); /* twice the same */
    part(2, 4, 7);
    protocol_rig_turn_end(&rig, 2, 0);
    expect(1, 0, 1);
    for (int i = 0; i < N; i++)
        shot[i].n = 2;
    for (int twice = 0; twice < 2; twice++)
        part(3, 0, 3);
    part(3, 4, N - 1);
    expect(1, 1, 0);
    assert_int_equal(scan.whole->n[0], 2);
}

/* A replayed recording goes to line 50 of the scan that it is in, and back to its beginning. */
static void a_jump_within_a_scan_is_no_loss(void **state)
{
    (void)state;
    uint8_t bytes[1024];
    open_head(-1, 0);
    turn(0);
    part(1, 0, 3);
    expect(2, 1, 0);
    for (uint32_t line = 50; line != UINT32_MAX; line = line == 50 ? 0 : UINT32_MAX) {
        assert_true(native_encode_descriptor(bytes, sizeof bytes, &rig.descriptor, 0, NATIVE_LOCAL) != 0);
        frame(NULL, bytes, 0);
        rig.scan_t0_ns += 7000000000;
        turn(line);
        assert_int_equal(scan.whole->number, line == 50 ? 2 : 6); /* the device's own count goes on */
        turn(line + 2);                                           /* one is missing after it */
        part(line + 3, 0, 3);
        expect(3, 2, 1);
    }
}

/* Descriptor and emitter are repeated at a change of speed, and for readers that join. The turn goes on. */
static void repeated_descriptors(void **state)
{
    (void)state;
    uint8_t bytes[1024];
    open_head(-1, 0);
    turn(0);
    part(1, 0, 3);
    rig.descriptor.lines_uhz = 12000000;
    protocol_rig_describe(&rig, 0);
    part(1, 4, N - 1);
    expect(2, 2, 0);
    rig.scan_t0_ns += 60000000000; /* the next scan's descriptor is missing; it is repeated in the middle of a turn */
    part(0, 0, 3);
    rig.descriptor.scan = 2;
    assert_true(native_encode_descriptor(bytes, sizeof bytes, &rig.descriptor, 0, NATIVE_REPEAT) != 0);
    frame(NULL, bytes, 0);
    part(0, 4, N - 1);
    expect(1, 1, 0);
}

static void other_steps(void **state)
{
    (void)state;
    open_head(-1, 0);
    turn(0);
    part(1, 0, 3);
    rig.emitter.last_step = LAST - 1;
    protocol_rig_describe(&rig, 0);
    expect(2, 1, 0);
    assert_null(scan.whole);
    part(2, 0, N - 2);
    expect(1, 1, 0);
    assert_non_null(scan.whole);
}

static void heads_that_it_can_t_read(void **state)
{
    (void)state;
    static const struct {
        uint32_t steps;
        int first, last, front, known;
        double pan_counts;
    } rows[] = {{3000, 0, 2999, 1500, 1, 65536}, {4000, 0, 3000, 1500, 0, 65536},
                {0, 0, 0, 0, 0, 65536},          {16, 3, 2, 6, 0, 65536},
                {16, -1, 14, 6, 0, 65536},       {16, 0, 16, 6, 0, 65536},
                {16, 0, 15, 16, 0, 65536},       {16, 0, 15, -1, 0, 65536},
                {16, 0, 15, 15, 1, 65536},       {16, 0, 15, 6, 0, 0},
                {0x20000000, 0, 9, 6, 0, 65536}, {16, INT32_MIN, INT32_MAX, 6, 0, 9}};
    struct sh_err err;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        open_head(-1, 0);
        const struct native_emitter good = rig.emitter;
        protocol_rig_planar(&rig, rows[i].steps, rows[i].first, rows[i].last, rows[i].front, -1, 10);
        rig.emitter.sequence_ns_den = 160;
        rig.descriptor.pan_counts_per_turn = rows[i].pan_counts;
        protocol_rig_describe(&rig, 0);
        assert_int_equal(scan.head.known, rows[i].known);
        if (protocol_ops_get(PROTOCOL_COLA)->check_head(&rig.descriptor, &rig.emitter, NULL, &err) == SH_OK)
            assert_int_equal(rows[i].known, 1);
        rig.emitter = good; /* whose points come all the same */
        part(0, 0, 3);
        protocol_rig_turn_end(&rig, 0, 0);
        if (!rows[i].known) expect(0, 0, 0);
        news = (struct planar_news){0, 0, 0};
    }
    open_head(-1, 0);
    rig.emitter.kind = NATIVE_EMIT_SPHERE;
    protocol_rig_describe(&rig, 0);
    assert_int_equal(scan.head.known, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(echoes_stand_where_they_look),
        cmocka_unit_test(coarse_encoders),
        cmocka_unit_test(times_and_numbers),
        cmocka_unit_test(many_echoes),
        cmocka_unit_test(shots_without_echo),
        cmocka_unit_test(a_frame_is_missing),
        cmocka_unit_test(attributes_of_another_turn),
        cmocka_unit_test(turns_are_missing),
        cmocka_unit_test(what_is_no_loss),
        cmocka_unit_test(parts_of_two_turns_make_none),
        cmocka_unit_test(a_jump_within_a_scan_is_no_loss),
        cmocka_unit_test(repeated_descriptors),
        cmocka_unit_test(other_steps),
        cmocka_unit_test(heads_that_it_can_t_read),
    };
    return cmocka_run_group_tests_name("planar scan", tests, NULL, NULL);
}
