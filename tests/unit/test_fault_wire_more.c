/* SPDX-License-Identifier: MIT */
/* Faults on the wire: when they strike, also as they are added and taken out at run time; how much a wire keeps; and
 * random mixtures of all kinds, whose output follows from their notes. */
#include "tests/common/thorough.h"
#include "tests/unit/wire_rig.h"

static struct fault f;

/* ---- when */

/* Expects the numbers of the frames that were hit. */
static void expect_hits(const uint64_t *numbers)
{
    uint32_t n = 0;
    for (; numbers[n] != 0; n++)
        if (n >= rig.n_notes || rig.note[n].number != numbers[n])
            fail_msg("hit %u is at frame %llu, not %llu", n, (unsigned long long)rig.note[n].number,
                     (unsigned long long)numbers[n]);
    assert_int_equal(rig.n_notes, n);
    rig_close();
}
#define HITS(...) expect_hits((const uint64_t[]){__VA_ARGS__, 0})

static void run_drop(void)
{
    rig_open(&f, 1, 1);
    for (int i = 0; i < 20; i++) {
        rig_frame_at(RIG_POINTS, 40, i * 100 * MS, 100 * (uint64_t)i);
        if (i % 2 == 0) rig_frame_at(RIG_NOTICE, 40, i * 100 * MS, 0);
    }
}

static void each_key_says_when(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_DROP);
    f.at = 7;
    run_drop();
    HITS(7);
    f = fault_of_kind(FAULT_DROP);
    f.from = 3;
    f.until = 11;
    f.every = 4;
    run_drop();
    HITS(3, 7, 11);
    f.count = 2;
    run_drop();
    HITS(3, 7);
    f = fault_of_kind(FAULT_DROP);
    f.from_pulse = 500; /* frame k has pulses 100 (k - 1) to 100 k - 1 */
    f.until_pulse = 800;
    run_drop();
    HITS(6, 7, 8, 9);
    f.from_pulse = 499;
    f.until_pulse = 499;
    run_drop();
    HITS(5);
    f = fault_of_kind(FAULT_DROP);
    f.from_s = 0.3;
    f.until_s = 0.6;
    run_drop();
    HITS(4, 5, 6);
    f.of = FAULT_OF_NOTICES; /* at 0, 0.2, 0.4, ... */
    run_drop();
    HITS(3);
    f = fault_of_kind(FAULT_DROP);
    f.of = FAULT_OF_NOTICES;
    f.from_pulse = 1; /* they have no pulses */
    run_drop();
    HITS(0);
    f = fault_of_kind(FAULT_DROP);
    f.link = 2; /* this is link 1 */
    run_drop();
    HITS(0);
    f.link = 1;
    f.at = 20;
    run_drop();
    HITS(20);
}

static int add(const struct fault *fault, int64_t since_ns)
{
    uint32_t number;
    struct sh_err err;
    return fault_board_add(rig.board, fault, since_ns, &number, &err) == SH_OK ? (int)number : -1;
}

static void a_fault_counts_from_when_it_was_added(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_DROP);
    rig_open(NULL, 0, 1);
    rig_frame_at(RIG_STREAM, 40, 0, 0);
    f.from = 2;
    f.every = 3;
    assert_int_equal(add(&f, 50 * MS), 1);
    for (int i = 0; i < 14; i++) /* frames before 50 ms are not counted, nor is one that comes late */
        rig_frame_at(RIG_STREAM, 40, i == 8 ? 49 * MS : 10 * i * MS, 0);
    static const int hit[] = {7, 11, 14}; /* 5, 6, 7, 9, 10, ... count 1, 2, 3, 4, 5, ... */
    assert_int_equal(rig.n_notes, 3);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(rig.note[i].number, 2 + 3 * i);
        assert_int_equal(rig.note[i].seq, le_get32(rig.item[hit[i]].bytes + 8));
    }
    f.from_s = 0.02; /* seconds, too, count from when it was added */
    f.from = f.every = 1;
    f.kind = FAULT_STALL;
    assert_int_equal(add(&f, 1000 * MS), 2);
    assert_int_equal(fault_board_end(rig.board, 1, 1025 * MS), 1); /* up to there it still holds */
    for (int i = 0; i < 4; i++)
        rig_frame_at(RIG_STREAM, 40, (1000 + 10 * i) * MS, 0);
    assert_true(rig.n_notes == 6 && rig.note[3].number == 11 && rig.note[3].fault == 1);
    assert_true(rig.note[4].number == 3 && rig.note[5].number == 4 && rig.note[4].fault == 2);
    assert_int_equal(fault_board_end(rig.board, 0, 1040 * MS), 1);
    assert_int_equal(fault_board_end(rig.board, 2, INT64_MIN), 0);
    rig_frame_at(RIG_STREAM, 40, 2000 * MS, 0);
    assert_int_equal(rig.n_notes, 6);
    assert_int_equal(fault_board_injected(rig.board, 1), 4); /* removed faults keep their count */
    assert_int_equal(fault_board_injected(rig.board, 0), 6);
    assert_int_equal(add(&f, 0), 3); /* and its number */
}

/* Each fault drops a frame of its own. The first 32 are cleared at a later time, so they strike, too. */
static void as_many_faults_as_are_kept_strike(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_DROP);
    rig_open(NULL, 0, 1);
    for (int i = 1; i <= FAULT_KEPT; i++) {
        f.at = (uint64_t)i;
        assert_int_equal(add(&f, 0), i);
        if (i == FAULT_MAX) assert_int_equal(fault_board_end(rig.board, 0, 1000 * MS), FAULT_MAX);
    }
    for (int i = 0; i <= FAULT_KEPT; i++)
        rig_frame_at(RIG_STREAM, 40, MS, 0);
    assert_int_equal(rig.n_notes, FAULT_KEPT);
    for (uint32_t i = 0; i < rig.n_notes; i++)
        assert_true(rig.note[i].fault == i + 1 && rig.note[i].number == i + 1);
    rig_end(1);
}

static void what_is_held_when_its_fault_goes_still_comes(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_REORDER);
    f.at = 1;
    f.n = 1;
    rig_open(&f, 1, 1);
    rig_frame(RIG_STREAM);
    fault_board_end(rig.board, 0, INT64_MIN);
    rig_frame(RIG_STREAM);
    rig_frame(RIG_STREAM);
    assert_int_equal(rig_take(0), 3);
    rig_expect((const int[]){1, 0, 2, -1});
}

/* ---- how much it keeps */

static void a_wire_is_full_by_what_only_time_keeps_back(void **state)
{
    (void)state;
    enum { CAP = 5000 };
    f = fault_of_kind(FAULT_STALL);
    f.at = 1;
    f.for_ms = 1000.0;
    rig_open(&f, 1, 1);
    int n = 0;
    for (; !wire_is_full(rig.wire, CAP, rig.now_ns); n++)
        rig_frame(RIG_STREAM);
    assert_in_range(n, 10, 60); /* a piece's overhead counts, too */
    rig_close();
    f.kind = FAULT_DELAY; /* a long way holds more */
    rig_open(&f, 1, 1);
    for (n = 0; n < RIG_ITEMS; n++)
        rig_frame(RIG_STREAM);
    assert_false(wire_is_full(rig.wire, CAP, rig.now_ns));
    rig.now_ns += 2000 * MS; /* the way is over, and nobody has read */
    assert_true(wire_is_full(rig.wire, CAP, rig.now_ns));
    rig_close();
    for (int i = 0; i < 2; i++) { /* waiting units must not keep frames out */
        f = fault_of_kind(i == 0 ? FAULT_REORDER : FAULT_MERGE);
        f.n = i == 0 ? 300 : 64;
        rig_open(&f, 1, 1);
        for (n = 0; n < (i == 0 ? 200 : 63); n++) {
            rig_frame(RIG_STREAM);
            rig_take(0);
        }
        assert_false(wire_is_full(rig.wire, CAP, rig.now_ns));
        rig_close();
    }
    struct fault two[2] = {fault_of_kind(FAULT_STALL), fault_of_kind(FAULT_DROP)}; /* pauses alone fill it */
    two[0].for_ms = 1e8;
    rig_open(two, 2, 1);
    for (n = 0; !wire_is_full(rig.wire, CAP, rig.now_ns); n++)
        rig_frame(RIG_STREAM);
    assert_in_range(n, 10, 60);
}

static void an_item_longer_than_usual_is_taken(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_DUPLICATE);
    rig_open(&f, 1, 1); /* the wire was made for items of 64 bytes */
    uint8_t *big = calloc(1, 100000);
    const struct wire_item item = {FAULT_OF_REPLIES, big, 100000, 0};
    assert_int_equal(wire_put(rig.wire, &item, rig.now_ns), SH_OK);
    const struct wire_piece *piece = wire_due(rig.wire, rig.now_ns);
    assert_true(piece != NULL && piece->len == 100000);
    free(big);
}

/* ---- all together */

static uint64_t random_state;

static uint32_t below(uint32_t n)
{
    random_state = random_state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)((random_state >> 33) % n);
}

static struct fault any_fault(int native)
{
    static const enum fault_kind kinds[] = {FAULT_DROP,   FAULT_DUPLICATE, FAULT_REORDER, FAULT_DELAY,
                                            FAULT_JITTER, FAULT_TRUNCATE,  FAULT_FLIP,    FAULT_FLIP,
                                            FAULT_STALL,  FAULT_SPLIT,     FAULT_MERGE,   FAULT_GARBAGE};
    struct fault any = fault_of_kind(kinds[below(sizeof kinds / sizeof kinds[0])]);
    any.seed = below(1000);
    any.of = native && below(4) == 0 ? FAULT_OF_NOTICES : FAULT_OF_STREAM;
    any.n = below(3) == 0 ? 0 : 1 + below(12);
    any.for_ms = 1 + below(40);
    any.reseal = below(2) == 0;
    if (below(3) == 0) any.byte = below(120);
    if (below(3) == 0) any.count = 1 + below(5);
    switch (below(3)) {
    case 0:
        any.at = 1 + below(60);
        break;
    case 1:
        any.from = 1 + below(20);
        any.every = 1 + below(10);
        break;
    default:
        any.probability = 0.01 * (1 + below(40));
    }
    return any;
}

/* The clock and the taking go on at random. Neither changes the output or the notes. */
static void mix(uint64_t seed, int pace, int native)
{
    struct fault list[12];
    random_state = seed;
    const uint32_t n = 1 + below(12);
    for (uint32_t i = 0; i < n; i++)
        list[i] = any_fault(native);
    rig_open(list, n, native);
    for (uint32_t i = 0; i < 150; i++) {
        const uint32_t which = below(5), len = 1 + below(150);
        if (!native)
            rig_unit(len, which == 0);
        else if (which == 0)
            rig_reply("42");
        else
            rig_frame(which == 1 ? RIG_NOTICE : which == 2 ? RIG_LOCAL : which == 3 ? RIG_POINTS : RIG_STREAM);
        if (pace == 1) rig_take(0);
        if (pace == 2 && i % 7 == 0) rig.now_ns += 20 * MS;
        if (pace == 2 && i % 3 == 0) rig_take(0);
    }
    rig_drain();
}

static void mixtures_are_what_their_notes_say(void **state)
{
    (void)state;
    static uint8_t out[RIG_OUT];
    static struct fault_note note[RIG_NOTES];
    uint32_t kinds[FAULT_N_KINDS] = {0}, whole = 0, in = 0;
    const uint32_t seeds = (uint32_t)thorough(600, SANITIZED ? 40 : 120);
    for (uint64_t seed = 0; seed < seeds; seed++) {
        size_t n_out = 0;
        uint32_t n_notes = 0;
        for (int pace = 0; pace < 3; pace++) {
            mix(seed, pace, seed % 3 != 0);
            whole += rig_check_notes();
            in += rig.n_items;
            assert_true(pace == 0 || (rig.n_out == n_out && rig.n_notes == n_notes));
            if (pace != 0) assert_memory_equal(rig.out, out, n_out);
            for (uint32_t i = 0; i < n_notes; i++) {
                const struct fault_note *a = &rig.note[i], *b = &note[i];
                assert_true(a->kind == b->kind && a->number == b->number && a->byte == b->byte && a->n == b->n);
            }
            memcpy(out, rig.out, n_out = rig.n_out);
            memcpy(note, rig.note, sizeof note);
            n_notes = rig.n_notes;
            for (uint32_t i = 0; i < n_notes; i++)
                kinds[note[i].kind]++;
            rig_close();
        }
    }
    for (int kind = FAULT_DROP; kind <= FAULT_GARBAGE; kind++)
        assert_true(kinds[kind] > 5 * seeds); /* the rarest kind has 7.5 notes a mixture, of three paces together */
    assert_true(whole > in / 2);
}

/* ---- several at one frame */

/* Only within the last group of kinds (fault/README.md) faults strike in the order of the list. A frame that is split
 * already is not split again. */
static void faults_strike_in_their_order(void **state)
{
    (void)state;
    static const struct {
        enum fault_kind first, second;
        int reseal;
        uint32_t n_notes;
        enum fault_kind noted;
    } rows[] = {
        {FAULT_FLIP, FAULT_TRUNCATE, 1, 1, FAULT_TRUNCATE}, /* of a cut frame no checksum can be made right */
        {FAULT_FLIP, FAULT_TRUNCATE, 0, 2, FAULT_TRUNCATE}, {FAULT_TRUNCATE, FAULT_DROP, 0, 1, FAULT_DROP},
        {FAULT_GARBAGE, FAULT_FLIP, 1, 2, FAULT_FLIP},      {FAULT_GARBAGE, FAULT_FLIP, 0, 2, FAULT_GARBAGE},
        {FAULT_SPLIT, FAULT_SPLIT, 0, 1, FAULT_SPLIT},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct fault list[2] = {fault_of_kind(rows[i].first), fault_of_kind(rows[i].second)};
        list[0].reseal = list[1].reseal = rows[i].reseal;
        if (rows[i].second == FAULT_SPLIT) list[1].n = 3;
        rig_open(list, 2, 1);
        rig_frame(RIG_POINTS);
        rig_drain();
        if (rig.n_notes != rows[i].n_notes || rig.note[0].kind != rows[i].noted)
            fail_msg("row %zu: %u notes, first %d", i, rig.n_notes, (int)rig.note[0].kind);
        if (rows[i].second == FAULT_SPLIT) assert_int_equal(rig.n_writes, 2);
        rig_close();
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_key_says_when),
        cmocka_unit_test_teardown(a_fault_counts_from_when_it_was_added, rig_teardown),
        cmocka_unit_test_teardown(as_many_faults_as_are_kept_strike, rig_teardown),
        cmocka_unit_test_teardown(what_is_held_when_its_fault_goes_still_comes, rig_teardown),
        cmocka_unit_test_teardown(a_wire_is_full_by_what_only_time_keeps_back, rig_teardown),
        cmocka_unit_test_teardown(an_item_longer_than_usual_is_taken, rig_teardown),
        cmocka_unit_test_teardown(faults_strike_in_their_order, rig_teardown),
        cmocka_unit_test_teardown(mixtures_are_what_their_notes_say, rig_teardown),
    };
    return cmocka_run_group_tests_name("faults on the wire, more", tests, NULL, NULL);
}
