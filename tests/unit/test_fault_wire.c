/* SPDX-License-Identifier: MIT */
/* Faults on the wire, each kind by itself. Exactly the noted frames are changed, at exactly the noted byte. All others
 * come unchanged and in order. (Kinds that change when a frame comes are in test_fault_wire_order.c.) */
#include "drivers/protocol/native.h"
#include "tests/unit/wire_rig.h"

static struct fault f;

static void dropped_frames_are_missing(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_DROP);
    f.from = 2;
    f.every = 3;
    rig_run(&f, 9);
    rig_drain();
    rig_expect((const int[]){0, 2, 3, 5, 6, 8, -1});
    assert_int_equal(rig.n_notes, 3);
    for (uint32_t i = 0; i < 3; i++) {
        const struct fault_note *note = &rig.note[i];
        assert_true(note->kind == FAULT_DROP && note->fault == 1 && note->number == 2 + 3 * i && note->byte == -1);
        assert_true(note->has_seq && note->seq == UINT32_MAX - 5 + (uint32_t)note->number - 1);
        assert_true(note->type == NATIVE_LINE_END && !note->has_pulse && note->of == FAULT_OF_STREAM);
    }
    assert_int_equal(fault_board_injected(rig.board, 1), 3);
    assert_int_equal(fault_board_injected(rig.board, 0), 3);
    rig_end(6);
}

static void duplicates_follow_at_once(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_DUPLICATE);
    f.at = 2;
    f.n = 3;
    rig_run(&f, 3);
    rig_drain();
    rig_expect((const int[]){0, 1, 1, 1, 1, 2, -1});
    assert_true(rig.n_notes == 1 && rig.note[0].n == 3);
    rig_end(6);
}

static void truncated_frames_lack_their_end(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_TRUNCATE);
    f.at = 2;
    f.n = 7;
    rig_run(&f, 3);
    assert_true(rig.note[0].n == 7 && rig.note[0].byte == (int64_t)rig.item[1].len - 7);
    rig_end(2);
    f.n = 1000000; /* more than there are: one byte is left */
    rig_run(&f, 3);
    assert_true(rig.note[0].n == rig.item[1].len - 1 && rig.note[0].byte == 1);
    rig_end(2);
    f.n = 0; /* any number */
    f.at = 0;
    rig_run(&f, 100);
    for (uint32_t i = 0; i < rig.n_notes; i++)
        assert_in_range(rig.note[i].n, 1, rig.item[i].len - 1);
    assert_int_equal(rig.n_notes, 100);
    rig_end(0);
    rig_open(&f, 1, 0); /* of one byte nothing can be missing */
    rig_unit(1, 0);
    assert_int_equal(rig.n_notes, 0);
    rig_end(1);
}

/* Returns how many bits of an item differ from the sent one, which came alone. */
static uint32_t count_bits(const struct rig_item *item)
{
    uint32_t n = 0;
    assert_int_equal(rig.n_out, item->len);
    for (size_t i = 0; i < item->len; i++)
        n += (uint32_t)__builtin_popcount(rig.out[i] ^ item->bytes[i]);
    return n;
}

static void so_many_bits_are_flipped_where_noted(void **state)
{
    (void)state;
    static const struct {
        uint32_t n;
        int64_t byte;
        uint32_t bits;
    } cases[] = {{0, -1, 1}, {1, 30, 1}, {3, 30, 3}, {8, 0, 8}, {1000, 30, 8}, {17, -1, 17}, {1000, -1, 8 * 68}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        f = fault_of_kind(FAULT_FLIP);
        f.n = cases[i].n;
        f.byte = cases[i].byte;
        f.seed = i;
        rig_run(&f, 1);
        rig_drain();
        assert_int_equal(rig.item[0].len, 68);
        assert_int_equal(count_bits(&rig.item[0]), cases[i].bits);
        assert_int_equal(rig.note[0].n, cases[i].bits);
        if (f.byte >= 0) assert_int_equal(rig.note[0].byte, f.byte);
        if (cases[i].bits == 1)
            assert_int_equal(rig.out[rig.note[0].byte] ^ rig.item[0].bytes[rig.note[0].byte], 1 << rig.note[0].bit);
        rig_end(0);
    }
    f.byte = 68; /* a frame that has no such byte is not hit */
    rig_run(&f, 1);
    assert_int_equal(rig.n_notes, 0);
    rig_end(1);
}

static void two_flips_never_make_each_other_right(void **state)
{
    (void)state;
    struct fault two[4] = {fault_of_kind(FAULT_FLIP), fault_of_kind(FAULT_FLIP), fault_of_kind(FAULT_FLIP),
                           fault_of_kind(FAULT_FLIP)};
    for (int i = 0; i < 4; i++) {
        two[i].byte = 40;
        two[i].n = 3;
    }
    rig_open(two, 4, 1);
    rig_frame(RIG_STREAM);
    rig_drain();
    assert_true(rig.n_notes == 3 && rig.note[2].n == 2); /* 3 + 3 + 2 of the byte's 8; nothing is left for the fourth */
    assert_int_equal(count_bits(&rig.item[0]), 8);
    rig_end(0);
}

/* A resealed flip is in the payload, and no checksum shows it. */
static void resealed_flips_are_right_by_their_checksums(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_FLIP);
    f.reseal = 1;
    f.n = 2;
    rig_run(&f, 50);
    rig_drain();
    static struct native_parser parser;
    size_t room;
    uint32_t n = 0;
    native_parser_init(&parser);
    memcpy(native_parser_room(&parser, &room), rig.out, rig.n_out);
    native_parser_added(&parser, rig.n_out);
    while (native_parser_next(&parser) == NATIVE_FRAME) {
        uint32_t bits = 0;
        for (size_t i = NATIVE_HEADER_LEN; i < rig.item[n].len; i++)
            bits += (uint32_t)__builtin_popcount(parser.frame[i] ^ rig.item[n].bytes[i]);
        assert_int_equal(bits, 2);
        assert_in_range(rig.note[n].byte, NATIVE_HEADER_LEN, rig.item[n].len - 1);
        assert_string_equal(rig.note[n].text, "resealed");
        n++;
    }
    assert_true(n == 50 && parser.stats.bad_bytes == 0 && parser.stats.bad_payload == 0);
    rig_end(50);
    f.byte = NATIVE_HEADER_LEN - 1; /* not the header */
    rig_run(&f, 2);
    assert_int_equal(rig.n_notes, 0);
    rig_end(2);
    struct fault both[2] = {fault_of_kind(FAULT_FLIP), f}; /* resealing does not right another fault's flip */
    both[1].byte = -1;
    rig_open(both, 2, 1);
    for (int i = 0; i < 20; i++)
        rig_frame(RIG_STREAM);
    assert_int_equal(rig.n_notes, 40);
    rig_end(0);
    both[0] = fault_of_kind(FAULT_TRUNCATE); /* nothing makes a cut frame right */
    rig_open(both, 2, 1);
    for (int i = 0; i < 20; i++)
        rig_frame(RIG_STREAM);
    assert_int_equal(rig.n_notes, 20);
    rig_end(0);
    both[1].byte = 5;
    rig_open(both + 1, 1, 0); /* units are hit anywhere */
    rig_unit(9, 0);
    assert_int_equal(rig.note[0].byte, 5);
    rig_end(1);
}

/* A receiver's system drops datagrams that were damaged on their way, so a damaged one is not sent. A resealed one is
 * sent. */
static void a_damaged_datagram_is_not_sent(void **state)
{
    (void)state;
    struct fault list[2] = {fault_of_kind(FAULT_DUPLICATE), fault_of_kind(FAULT_FLIP)};
    list[1].at = 2;
    for (int reseal = 0; reseal < 2; reseal++) {
        list[1].reseal = reseal;
        rig_open(list, 2, 0);
        const struct wire_spec spec = {
            .board = rig.board, .link = 1, .session = 1, .max_unit = 64, .units = 1, .datagrams = 1};
        wire_free(rig.wire);
        rig.wire = wire_create(&spec);
        assert_non_null(rig.wire);
        for (int i = 0; i < 3; i++)
            rig_unit(20, 0);
        rig_drain();
        assert_int_equal(rig.n_writes, reseal ? 6 : 4);
        assert_int_equal(rig.n_notes, reseal ? 4 : 3);
        assert_true(rig.note[1].kind == FAULT_FLIP && rig.note[1].number == 2 && rig.note[1].n == 1);
        assert_string_equal(rig.note[1].text, reseal ? "resealed" : "not sent: its UDP checksum would be wrong");
        rig_close();
    }
}

static void garbage_stands_before_the_frame(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_GARBAGE);
    f.at = 2;
    f.n = 1024;
    rig_run(&f, 3);
    rig_drain();
    assert_int_equal(rig.n_out, rig.item[0].len + 1024 + rig.item[1].len + rig.item[2].len);
    int counts[256] = {0};
    for (size_t i = 0; i < 1024; i++)
        counts[rig.out[rig.item[0].len + i]]++;
    assert_int_equal(counts['\r'], 0); /* or it could hold a reply line */
    for (int i = 0; i < 256; i++)
        assert_true(counts[i] < 20); /* 4 each; 20 of one value have a chance of 1e-7 */
    rig_end(3);
    struct fault two[2] = {fault_of_kind(FAULT_REORDER), f};
    two[0].at = 2;
    rig_open(two, 2, 1); /* it stays where the frame would have been */
    for (int i = 0; i < 4; i++)
        rig_frame(RIG_STREAM);
    rig_end(4);
}

static void a_dropped_frame_is_hit_by_nothing_else(void **state)
{
    (void)state;
    struct fault all[] = {fault_of_kind(FAULT_FLIP),      fault_of_kind(FAULT_TRUNCATE), fault_of_kind(FAULT_DELAY),
                          fault_of_kind(FAULT_DUPLICATE), fault_of_kind(FAULT_REORDER),  fault_of_kind(FAULT_MERGE),
                          fault_of_kind(FAULT_GARBAGE),   fault_of_kind(FAULT_STALL),    fault_of_kind(FAULT_DROP),
                          fault_of_kind(FAULT_DROP)};
    enum { N = sizeof all / sizeof all[0] };
    for (int i = 0; i < N; i++) {
        all[i].at = 2;
        all[i].for_ms = 1.0;
    }
    all[0].at = 0;
    all[0].count = 2; /* one that does not strike is not counted */
    rig_open(all, N, 1);
    for (int i = 0; i < 4; i++)
        rig_frame(RIG_STREAM);
    assert_int_equal(rig.n_notes, 5);
    static const enum fault_kind in_order[] = {FAULT_FLIP, FAULT_DROP, FAULT_GARBAGE, FAULT_STALL, FAULT_FLIP};
    for (int i = 0; i < 5; i++)
        assert_int_equal(rig.note[i].kind, in_order[i]);
    assert_int_equal(rig.note[4].number, 3);
    rig_end(1);
}

/* After the end nothing more is noted, as no client will see it. */
static void a_session_that_ends_takes_nothing_more(void **state)
{
    (void)state;
    struct fault list[3] = {fault_of_kind(FAULT_REORDER), fault_of_kind(FAULT_DROP), fault_of_kind(FAULT_DISCONNECT)};
    uint64_t frames, pulses;
    list[0].at = 2;
    list[0].n = 100;
    list[1].from = 5;
    list[2].at = 5;
    list[2].for_ms = 7.0;
    rig_open(list, 3, 1);
    for (int i = 0; i < 8; i++)
        rig_frame(RIG_POINTS);
    rig_reply("OK");
    assert_int_equal(rig.n_notes, 1); /* the end is not there yet */
    wire_count_unwritten(rig.wire, &frames, &pulses);
    assert_true(frames == 8 && pulses == 800);
    assert_int_equal(rig_take(0), 5);
    assert_int_equal(rig.n_notes, 2);
    assert_true(rig.note[1].kind == FAULT_DISCONNECT && rig.note[1].number == 5);
    rig_expect((const int[]){0, 2, 3, 1, -1}); /* held units come before the end */
    assert_true(rig.write[4].kind == WIRE_ACT && rig.write[4].act == FAULT_DISCONNECT);
    wire_count_unwritten(rig.wire, &frames, &pulses);
    assert_true(frames == 4 && pulses == 400);
    assert_true(wire_is_empty(rig.wire));
}

/* The note of an act says how long it holds, whether it is a reset, and how many packets it makes short. The link gets
 * its figures. Some acts end the session, and others let it go on. */
static void an_act_has_its_figures(void **state)
{
    (void)state;
    static const struct {
        enum fault_kind kind;
        int reset;
        uint64_t noted_n;
        const char *text;
        uint32_t n, n_notes; /* two frames come, of which the second does not come after an end */
    } rows[] = {{FAULT_SHORT_PACKETS, 0, 3, "", 3, 2}, {FAULT_DISCONNECT, 1, 0, "reset", 3, 1},
                {FAULT_CABLE, 1, 0, "reset", 1, 2},    {FAULT_CABLE, 0, 0, "", 0, 2},
                {FAULT_USB_RESET, 0, 0, "", 3, 1},     {FAULT_ENDPOINT_STALL, 0, 0, "", 3, 2},
                {FAULT_UNPLUG, 0, 0, "", 3, 1}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        f = fault_of_kind(rows[i].kind);
        f.n = 3;
        f.reset = rows[i].reset;
        f.for_ms = 7.0;
        rig_open(&f, 1, 1);
        rig_frame(RIG_POINTS);
        rig_frame(RIG_POINTS);
        rig_drain();
        assert_int_equal(rig.n_notes, rows[i].n_notes);
        assert_true(rig.note[0].kind == rows[i].kind && rig.note[0].n == rows[i].noted_n);
        assert_true(rig.note[0].for_ms == 7.0 && rig.note[0].number == 1 && rig.note[0].link == 1);
        assert_string_equal(rig.note[0].text, rows[i].text);
        assert_true(rig.write[0].kind == WIRE_ACT && rig.write[0].act == (uint32_t)rows[i].kind);
        assert_true(rig.write[0].n == rows[i].n && rig.write[0].for_ms == 7.0);
        rig_close();
    }
}

/* A frame is not written until all of its writes are out. A copy of it does not count. */
static void what_is_not_written_is_counted(void **state)
{
    (void)state;
    struct fault two[2] = {fault_of_kind(FAULT_SPLIT), fault_of_kind(FAULT_DUPLICATE)};
    uint64_t frames, pulses;
    rig_open(two, 2, 1);
    rig_frame(RIG_POINTS);
    rig_frame(RIG_LOCAL);
    for (int i = 0; i < 4; i++) {
        wire_count_unwritten(rig.wire, &frames, &pulses);
        assert_true(frames == (i < 2) && pulses == (i < 2 ? 100 : 0));
        assert_non_null(wire_due(rig.wire, rig.now_ns));
        wire_pop(rig.wire);
    }
}

static void what_was_begun_without_the_wire_goes_first_as_it_is(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_DROP);
    f.at = 1;
    rig_open(&f, 1, 1);
    assert_int_equal(wire_put_rest(rig.wire, (const uint8_t *)"rest", 4), SH_OK);
    rig_frame(RIG_STREAM);
    rig_frame(RIG_STREAM);
    rig_drain();
    assert_int_equal(rig.n_out, 4 + rig.item[1].len);
    assert_memory_equal(rig.out, "rest", 4);
    assert_memory_equal(rig.out + 4, rig.item[1].bytes, rig.item[1].len);
}

/* Two clients of a link each get the frame at which it is unplugged, and both sessions end. The unplugging is carried
 * out once. */
static void an_act_that_is_not_carried_out_does_not_count(void **state)
{
    (void)state;
    struct fault_tally tally = {0};
    struct wire *wire[2];
    f = fault_of_kind(FAULT_UNPLUG);
    f.count = 2;
    rig_open(&f, 1, 1);
    const struct rig_item *frame = rig_frame(RIG_STREAM);
    const struct wire_item item = {FAULT_OF_STREAM, frame->bytes, frame->len, 0};
    const struct wire_spec spec = {.board = rig.board,
                                   .link = 1,
                                   .session = 2,
                                   .max_unit = 64,
                                   .native = 1,
                                   .acts = UINT32_MAX,
                                   .tally = &tally,
                                   .heard = &rig.heard};
    for (int i = 0; i < 2; i++) {
        wire[i] = wire_create(&spec);
        assert_non_null(wire[i]);
        assert_int_equal(wire_put(wire[i], &item, rig.now_ns), SH_OK);
        assert_int_equal(wire_due(wire[i], rig.now_ns)->kind, WIRE_ACT);
    }
    wire_pop(wire[0]);
    for (int i = 0; i < 2; i++)
        wire_free(wire[i]);
    assert_int_equal(*fault_tally_hits(&tally, 1), 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(dropped_frames_are_missing, rig_teardown),
        cmocka_unit_test_teardown(duplicates_follow_at_once, rig_teardown),
        cmocka_unit_test_teardown(truncated_frames_lack_their_end, rig_teardown),
        cmocka_unit_test_teardown(so_many_bits_are_flipped_where_noted, rig_teardown),
        cmocka_unit_test_teardown(two_flips_never_make_each_other_right, rig_teardown),
        cmocka_unit_test_teardown(resealed_flips_are_right_by_their_checksums, rig_teardown),
        cmocka_unit_test_teardown(a_damaged_datagram_is_not_sent, rig_teardown),
        cmocka_unit_test_teardown(garbage_stands_before_the_frame, rig_teardown),
        cmocka_unit_test_teardown(a_dropped_frame_is_hit_by_nothing_else, rig_teardown),
        cmocka_unit_test(an_act_has_its_figures),
        cmocka_unit_test_teardown(a_session_that_ends_takes_nothing_more, rig_teardown),
        cmocka_unit_test_teardown(what_is_not_written_is_counted, rig_teardown),
        cmocka_unit_test_teardown(an_act_that_is_not_carried_out_does_not_count, rig_teardown),
        cmocka_unit_test_teardown(what_was_begun_without_the_wire_goes_first_as_it_is, rig_teardown),
    };
    return cmocka_run_group_tests_name("faults on the wire", tests, NULL, NULL);
}
