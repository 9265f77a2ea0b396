/* SPDX-License-Identifier: MIT */
/* Faults on the wire that change when a frame comes, after which others, and in which write: reorder, delay, jitter,
 * stall, split, merge. */
#include "tests/unit/wire_rig.h"

static struct fault f;

/* A reordered frame comes after the frame whose number is n higher. Notices are not counted with stream frames. */
static void a_reordered_frame_comes_behind_as_many_as_noted(void **state)
{
    (void)state;
    int seen[4] = {0};
    for (uint64_t seed = 1; seed <= 30; seed++) {
        f = fault_of_kind(FAULT_REORDER);
        f.at = 2;
        f.n = 3;
        f.seed = seed;
        rig_open(&f, 1, 1);
        for (int i = 0; i < 8; i++) {
            rig_frame(RIG_STREAM);
            if (i % 3 == 0) rig_frame(RIG_NOTICE);
            rig_take(0); /* all that may go out has gone before the next comes */
        }
        assert_int_equal(rig.n_notes, 1);
        assert_in_range(rig.note[0].n, 1, 3);
        seen[rig.note[0].n]++;
        assert_true(wire_is_empty(rig.wire));
        rig_end(11);
    }
    assert_true(seen[1] > 0 && seen[2] > 0 && seen[3] > 0);
}

static void frames_that_are_all_reordered_all_come(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_REORDER);
    f.n = 20;
    rig_run(&f, 300);
    assert_true(rig_take(0) > 250); /* only some of the last 20 still wait */
    rig_end(300);
    assert_int_equal(rig.n_notes, 300);
}

/* Frames held beyond the end come when no more follow, or two seconds of device time later. */
static void a_held_frame_waits_no_longer_than_said(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_REORDER);
    f.at = 1;
    f.n = 1000;
    rig_open(&f, 1, 1);
    rig_frame_at(RIG_STREAM, 50, 0, 0);
    rig_frame_at(RIG_STREAM, 50, WIRE_HOLD_MS * MS, 0);
    assert_int_equal(rig_take(0), 1);
    assert_true(rig.note[0].n > 3);
    rig_frame_at(RIG_STREAM, 50, WIRE_HOLD_MS * MS + 1, 0);
    assert_int_equal(rig_take(0), 2);
    rig_expect((const int[]){1, 0, 2, -1});
    rig_close();
    rig_open(&f, 1, 1);
    rig_frame_at(RIG_STREAM, 50, 0, 0);
    assert_int_equal(wire_time(rig.wire, WIRE_HOLD_MS * MS), SH_OK);
    assert_int_equal(rig_take(0), 0);
    assert_int_equal(wire_next_ns(rig.wire), INT64_MAX); /* time alone brings nothing: nobody spins for it */
    assert_int_equal(wire_time(rig.wire, WIRE_HOLD_MS * MS + 1), SH_OK);
    assert_int_equal(rig_take(0), 1);
}

static void a_delayed_frame_is_not_overtaken(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_DELAY);
    f.at = 2;
    f.for_ms = 5.0;
    rig_open(&f, 1, 1);
    for (int i = 0; i < 3; i++)
        rig_frame(RIG_STREAM);
    const int64_t due_ns = 1000 * MS + 1000 + 5 * MS; /* the second was put 1 us after the first */
    assert_int_equal(rig_take(0), 1);
    assert_int_equal(wire_next_ns(rig.wire), due_ns);
    rig.now_ns = due_ns - 1;
    assert_int_equal(rig_take(0), 0);
    rig.now_ns = due_ns;
    assert_int_equal(rig_take(0), 2); /* and the third with it */
    rig_frame(RIG_STREAM);
    assert_int_equal(rig_take(0), 1); /* later ones come at once */
    assert_true(rig.n_notes == 1 && rig.note[0].for_ms == 5.0);
    rig_end(4);
}

static void jitter_stays_below_its_time_and_in_order(void **state)
{
    (void)state;
    enum { N = 200 };
    double sum_ms = 0.0;
    f = fault_of_kind(FAULT_JITTER);
    f.for_ms = 2.0;
    rig_open(&f, 1, 1);
    int64_t put_ns[N];
    for (int i = 0; i < N; i++) {
        rig_take(0);
        put_ns[i] = rig.now_ns;
        rig_frame(RIG_STREAM);
        rig.now_ns += 100000;
    }
    rig_drain();
    assert_int_equal(rig.n_writes, N);
    for (int i = 0; i < N; i++) {
        assert_true(rig.note[i].for_ms >= 0.0 && rig.note[i].for_ms < 2.0);
        assert_true(rig.write[i].at_ns >= put_ns[i] + (int64_t)(rig.note[i].for_ms * 1e6));
        assert_true(rig.write[i].at_ns < put_ns[i] + 2 * MS + 102000); /* the test looks each 101 us */
        sum_ms += rig.note[i].for_ms;
    }
    assert_true(sum_ms > 0.7 * N && sum_ms < 1.3 * N); /* mean 1 ms; 0.3 are 7 sigma of 2 / sqrt(12 N) */
    rig_end(N);
}

static void a_stall_begins_when_all_before_is_out(void **state)
{
    (void)state;
    struct fault two[2] = {fault_of_kind(FAULT_STALL), fault_of_kind(FAULT_STALL)};
    two[0].at = two[1].at = 2;
    two[0].for_ms = 10.0;
    two[1].for_ms = 5.0;
    rig_open(two, 2, 1);
    for (int i = 0; i < 3; i++)
        rig_frame(RIG_STREAM);
    rig.now_ns += 100 * MS; /* the link was full meanwhile */
    assert_int_equal(rig_take(0), 1);
    const int64_t from_ns = rig.now_ns;
    assert_int_equal(wire_next_ns(rig.wire), from_ns + 10 * MS);
    rig_drain();
    assert_true(rig.n_writes == 3 && rig.write[1].at_ns == from_ns + 15 * MS); /* one after the other */
    rig_expect((const int[]){0, 1, 2, -1});
    rig_end(3);
}

static void a_split_frame_goes_out_in_so_many_writes(void **state)
{
    (void)state;
    static const struct {
        uint32_t n, writes;
        int noted;
    } cases[] = {{0, 2, 1}, {1, 1, 0}, {5, 5, 1}, {1000, 68, 1}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        f = fault_of_kind(FAULT_SPLIT);
        f.n = cases[i].n;
        f.at = 1;
        rig_run(&f, 2);
        rig_drain();
        assert_int_equal(rig.n_writes, cases[i].writes + 1);
        for (uint32_t w = 0; w < cases[i].writes; w++)
            assert_in_range(rig.write[w].len, 68 / cases[i].writes, 68 / cases[i].writes + 1);
        assert_int_equal(rig.n_notes, cases[i].noted);
        if (cases[i].noted) assert_int_equal(rig.note[0].n, cases[i].writes);
        rig_end(2);
    }
}

static void merged_frames_go_out_in_one_write(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_MERGE); /* at every frame that no write has taken already */
    f.n = 3;
    rig_open(&f, 1, 1);
    for (int i = 0; i < 8; i++) {
        rig_frame(RIG_STREAM);
        assert_int_equal(rig_take(0), i % 3 == 2);
        if (i == 3) rig_frame(RIG_NOTICE); /* goes with them, and is not counted */
    }
    assert_int_equal(wire_next_ns(rig.wire), INT64_MAX); /* time alone brings nothing */
    rig_drain();
    assert_int_equal(rig.n_writes, 3);
    assert_int_equal(rig.write[1].len, rig.item[3].len + rig.item[4].len + rig.item[5].len + rig.item[6].len);
    assert_int_equal(rig.n_notes, 3);
    rig_end(9);
    rig_open(&f, 1, 1); /* a reply does not wait for frames */
    rig_frame(RIG_STREAM);
    rig_reply("OK");
    assert_int_equal(rig_take(0), 2);
    rig_frame(RIG_STREAM);
    assert_int_equal(rig_take(0), 1);
    rig_end(3);
    rig_open(&f, 1, 0); /* nor does an answer of another protocol */
    rig_unit(20, 0);
    rig_unit(20, 1);
    assert_int_equal(rig_take(0), 2);
    rig_unit(20, 0);
    assert_int_equal(rig_take(0), 1);
    rig_end(3);
    struct fault two[2] = {f, fault_of_kind(FAULT_SPLIT)}; /* a frame that is split is in writes of its own */
    two[0].at = 1;
    two[1].at = 2;
    rig_open(two, 2, 1);
    for (int i = 0; i < 3; i++)
        rig_frame(RIG_STREAM);
    assert_int_equal(rig_take(0), 4);
    rig_end(3);
    rig_open(&f, 1, 1); /* nor does anything wait for frames that don't come */
    rig_frame(RIG_STREAM);
    wire_time(rig.wire, 10 * WIRE_HOLD_MS * MS);
    assert_int_equal(rig_take(0), 1);
}

/* However a piece goes through a queue, its bytes no longer count once it is out. */
static void a_queue_gives_back_its_room(void **state)
{
    (void)state;
    struct wire_queue queue = {0};
    for (int way = 0; way < 4; way++) {
        struct wire_piece *piece = wire_piece_new(WIRE_FRAMES, "abcdef", 6);
        if (way == 1) piece->not_before_ns = 100; /* held by its time */
        if (way == 2) piece->after = 7;           /* or until a frame has come */
        if (way == 1 || way == 2)
            wire_queue_hold(&queue, piece);
        else
            assert_int_equal(wire_queue_put(&queue, piece), 0);
        assert_int_equal(queue.n_bytes != 0, way != 2); /* a piece that waits for a frame does not count yet */
        if (way == 3) {                                 /* into the write of one that is open */
            piece->open = 1;
            assert_int_equal(wire_queue_put(&queue, wire_piece_new(WIRE_FRAMES, "gh", 2)), 0);
            assert_int_equal(piece->len, 8);
            wire_queue_close(&queue);
        }
        assert_int_equal(wire_queue_let_go(&queue, 100), 0);
        assert_int_equal(wire_queue_pass(&queue, 0, 7, 0), 0);
        assert_ptr_equal(wire_queue_due(&queue, 100), piece);
        wire_queue_pop(&queue);
        assert_int_equal(queue.n_bytes, 0);
        assert_null(queue.first);
        assert_null(queue.held);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(a_reordered_frame_comes_behind_as_many_as_noted, rig_teardown),
        cmocka_unit_test_teardown(frames_that_are_all_reordered_all_come, rig_teardown),
        cmocka_unit_test_teardown(a_held_frame_waits_no_longer_than_said, rig_teardown),
        cmocka_unit_test_teardown(a_delayed_frame_is_not_overtaken, rig_teardown),
        cmocka_unit_test_teardown(jitter_stays_below_its_time_and_in_order, rig_teardown),
        cmocka_unit_test_teardown(a_stall_begins_when_all_before_is_out, rig_teardown),
        cmocka_unit_test_teardown(a_split_frame_goes_out_in_so_many_writes, rig_teardown),
        cmocka_unit_test_teardown(merged_frames_go_out_in_one_write, rig_teardown),
        cmocka_unit_test(a_queue_gives_back_its_room),
    };
    return cmocka_run_group_tests_name("faults on the wire, order", tests, NULL, NULL);
}
