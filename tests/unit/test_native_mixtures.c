/* SPDX-License-Identifier: MIT */
/* Random mixtures of faults on a synthetic stream whose truth is known. The parser gives exactly the frames that came
 * whole, in order and for the first time, and notices each fault at its byte.
 *
 * The truth follows from the list of the parts on the wire, with numbers that don't wrap and a table of received
 * frames. Seeds are fixed. Two accidents could make the truth wrong, and neither happens with these seeds: a damaged
 * frame whose checksum is right all the same, and bytes lost at an end that equal those that follow. */
#include "tests/unit/native_stream.h"

enum { N_FRAMES = 80, WIRE_MAX = 1 << 16, NOTES_MAX = 600, SEEDS = 1000, DELAY_MAX = 20, PAYLOAD_MAX = 200 };

/* ---- the parts on the wire */

enum condition { WHOLE, BAD_PAYLOAD, CUT_IN_PAYLOAD, NOISE };

struct part {
    int frame; /* index in the stream; -1: garbage */
    enum condition condition;
    size_t at, len;
};
static struct part part[4 * N_FRAMES];
static int n_parts;
static uint8_t frame_bytes[N_FRAMES][NATIVE_HEADER_LEN + PAYLOAD_MAX];
static uint64_t number[N_FRAMES]; /* of the sequence, without the wrap */
static uint8_t on_wire[WIRE_MAX];
static size_t n_wire;

static uint32_t dice;
static uint32_t roll(uint32_t n)
{
    dice = dice * 1664525u + 1013904223u;
    return (dice >> 8) % n;
}

static size_t len_of(int frame)
{
    return native_frame_len(frame_bytes[frame]);
}

static int is_local(int frame)
{
    return (frame_bytes[frame][3] & NATIVE_LOCAL) != 0;
}

/* Frames have any size from 0 on, and are full of sync bytes. Their numbers run over 2^32. */
static void make_frames(void)
{
    uint64_t next = UINT64_C(0x100000000) - roll(2 * N_FRAMES) + N_FRAMES / 2;
    for (int i = 0; i < N_FRAMES; i++) {
        uint8_t *f = frame_bytes[i];
        const uint32_t len = roll(PAYLOAD_MAX + 1);
        memset(f, 0, NATIVE_HEADER_LEN);
        f[0] = NATIVE_SYNC;
        f[1] = NATIVE_EVENT;
        f[2] = NATIVE_VERSION;
        f[3] = i > 0 && i < N_FRAMES - 4 && roll(15) == 0 ? NATIVE_LOCAL : 0;
        le_put32(f + 4, len);
        le_put64(f + 16, (uint64_t)(1000 + i));
        for (uint32_t k = 0; k < len; k++)
            f[NATIVE_HEADER_LEN + k] = (uint8_t)(roll(4) == 0 && k + 1 < len ? NATIVE_SYNC : roll(0xd5));
        le_put32(f + 12, crc32c(0, f + NATIVE_HEADER_LEN, len));
        number[i] = is_local(i) ? 0 : next++;
        native_finish_frame(f, (uint32_t)number[i]);
        while (f[NATIVE_HEADER_LEN - 1] == NATIVE_SYNC) { /* if it is cut off, the next sync byte replaces it */
            f[1]++;
            native_finish_frame(f, (uint32_t)number[i]);
        }
    }
}

static void put(int frame, enum condition condition, const uint8_t *data, size_t len)
{
    assert_true(n_wire + len <= sizeof on_wire);
    part[n_parts++] = (struct part){frame, condition, n_wire, len};
    memcpy(on_wire + n_wire, data, len);
    n_wire += len;
}

static void put_garbage(void)
{
    uint8_t noise[64] = {0}; /* no text: its first byte is not printable */
    const size_t len = 1 + roll(sizeof noise);
    for (size_t k = 1; k < len; k++)
        noise[k] = (uint8_t)roll(256);
    put(-1, NOISE, noise, len);
}

static void put_hurt(int frame)
{
    uint8_t hurt[NATIVE_HEADER_LEN + PAYLOAD_MAX];
    const size_t len = len_of(frame), bit = roll((uint32_t)(8 * len));
    memcpy(hurt, frame_bytes[frame], len);
    hurt[bit / 8] ^= (uint8_t)(1 << bit % 8);
    put(frame, bit / 8 < NATIVE_HEADER_LEN ? NOISE : BAD_PAYLOAD, hurt, len);
}

static void put_cut(int frame)
{
    const size_t len = 1 + roll((uint32_t)len_of(frame) - 1);
    put(frame, len < NATIVE_HEADER_LEN ? NOISE : CUT_IN_PAYLOAD, frame_bytes[frame], len);
}

/* Frames on their way, each with a time to go. The waiting frames are the copies and the delayed ones. */
static struct {
    int frame, left;
} waiting[2 * N_FRAMES];
static int n_waiting;

static void put_due(int all)
{
    for (int i = 0; i < n_waiting; i++) {
        if (waiting[i].left < 0 || (waiting[i].left-- > 0 && !all)) continue;
        put(waiting[i].frame, WHOLE, frame_bytes[waiting[i].frame], len_of(waiting[i].frame));
        waiting[i].left = -1;
    }
}

static void wait_for(int frame, int left)
{
    waiting[n_waiting].frame = frame;
    waiting[n_waiting++].left = left;
}

/* A LOCAL frame is not delayed, as nothing shows where it belongs. */
static void put_with_fault(int i)
{
    enum { DROP, COPY, DELAY, HURT, CUT, GARBAGE, FAULTS };
    const uint32_t fault = roll(FAULTS);
    if (fault == DROP) return;
    if (fault == DELAY && !is_local(i)) {
        wait_for(i, 1 + (int)roll(DELAY_MAX));
    } else if (fault == HURT) {
        put_hurt(i);
    } else if (fault == CUT) {
        put_cut(i);
    } else {
        if (fault == GARBAGE) put_garbage();
        put(i, WHOLE, frame_bytes[i], len_of(i));
        if (fault == COPY) wait_for(i, (int)roll(DELAY_MAX));
    }
}

/* The first frame is not touched, since its loss can't be noticed. Nor are the last, so that the end hides nothing. */
static void put_stream(uint32_t seed)
{
    dice = seed;
    n_parts = n_waiting = 0;
    n_wire = 0;
    make_frames();
    const uint32_t percent = 1 + roll(60);
    for (int i = 0; i < N_FRAMES; i++) {
        if (i > 0 && i < N_FRAMES - 4 && roll(100) < percent)
            put_with_fault(i);
        else
            put(i, WHOLE, frame_bytes[i], len_of(i));
        put_due(i == N_FRAMES - 5);
    }
}

/* ---- the truth */

static struct native_notice truth[NOTES_MAX], noticed[NOTES_MAX];
static int n_truth, n_noticed;
static int given[2 * N_FRAMES], n_given, n_taken;
static uint64_t lost, repeated, late, bad_bytes;

static void expect_notice(struct native_notice notice)
{
    assert_true(n_truth < NOTES_MAX);
    truth[n_truth++] = notice;
}

/* Expects the run of bad bytes that ends where part i begins, from its parts. */
static void expect_bad(int from, int to, int64_t t_ns)
{
    for (int i = from; i < to;) {
        const int header = part[i].condition != NOISE;
        struct native_notice notice = {.kind = header ? NATIVE_BAD_PAYLOAD : NATIVE_BAD_BYTES,
                                       .seq = header ? (uint32_t)number[part[i].frame] : 0,
                                       .at_byte = part[i].at,
                                       .t_ns = header ? 1000 + part[i].frame : t_ns};
        /* Bytes that fit into a broken frame's length count as its own. */
        const size_t most = header ? len_of(part[i].frame) : SIZE_MAX;
        notice.n = part[i].len;
        for (i++; i < to && part[i].condition == NOISE; i++)
            notice.n += part[i].len;
        bad_bytes += notice.n;
        const uint64_t beyond = notice.n > most ? notice.n - most : 0;
        notice.n -= beyond;
        expect_notice(notice);
        notice = (struct native_notice){NATIVE_BAD_BYTES, 0, notice.at_byte + most, beyond, t_ns};
        if (beyond > 0) expect_notice(notice);
    }
}

static void expect_frame(const struct part *p, int before, uint64_t *newest)
{
    static int came[N_FRAMES];
    if (before < 0) memset(came, 0, sizeof came);
    const int f = p->frame;
    struct native_notice notice = {NATIVE_NO_NOTICE, (uint32_t)number[f], p->at, 1, 1000 + f};
    if (is_local(f)) {
        if (before == f) notice.kind = NATIVE_REPEATED;
    } else if (came[f]) {
        notice.kind = NATIVE_REPEATED;
    } else if (before >= 0 && number[f] < *newest) {
        notice.kind = NATIVE_LATE;
    } else if (before >= 0 && number[f] > *newest + 1) {
        notice.kind = NATIVE_GAP;
        notice.seq = (uint32_t)(*newest + 1);
        notice.n = number[f] - *newest - 1;
        lost += notice.n;
    }
    came[f] = 1;
    repeated += notice.kind == NATIVE_REPEATED;
    late += notice.kind == NATIVE_LATE;
    if (notice.kind != NATIVE_NO_NOTICE) expect_notice(notice);
    if (notice.kind == NATIVE_REPEATED || notice.kind == NATIVE_LATE) return;
    given[n_given++] = f;
    if (!is_local(f)) *newest = number[f];
}

static void find_truth(void)
{
    int bad_from = 0, before = -1;
    uint64_t newest = 0;
    n_truth = n_given = 0;
    lost = repeated = late = bad_bytes = 0;
    for (int i = 0; i < n_parts; i++) {
        if (part[i].condition != WHOLE) continue;
        expect_bad(bad_from, i, before < 0 ? NATIVE_NO_TIME : 1000 + before);
        expect_frame(&part[i], before, &newest);
        bad_from = i + 1;
        before = part[i].frame;
    }
    assert_int_equal(bad_from, n_parts);
}

/* ---- the parser's notices */

static void on_notice(void *ctx, const struct native_notice *notice)
{
    (void)ctx;
    assert_true(n_noticed < NOTES_MAX);
    noticed[n_noticed++] = *notice;
}

static void take_items(void)
{
    for (enum native_item item; (item = native_parser_next(&parser)) != NATIVE_MORE;) {
        assert_int_equal(item, NATIVE_FRAME);
        assert_true(n_taken < n_given);
        assert_memory_equal(parser.frame, frame_bytes[given[n_taken]], len_of(given[n_taken]));
        n_taken++;
    }
}

static void run(size_t piece_max)
{
    native_parser_init(&parser);
    parser.notice = on_notice;
    n_noticed = n_taken = 0;
    for (size_t at = 0, n; at < n_wire; at += n) {
        size_t room;
        uint8_t *to = native_parser_room(&parser, &room);
        n = piece_max < n_wire ? 1 + roll((uint32_t)piece_max) : n_wire;
        if (n > n_wire - at) n = n_wire - at;
        if (n > room) n = room;
        memcpy(to, on_wire + at, n);
        native_parser_added(&parser, n);
        take_items();
    }
    native_parser_finish(&parser);
    take_items();
}

static void check(uint32_t seed)
{
    int i = 0;
    while (i < n_truth && i < n_noticed && truth[i].kind == noticed[i].kind && truth[i].seq == noticed[i].seq &&
           truth[i].at_byte == noticed[i].at_byte && truth[i].n == noticed[i].n && truth[i].t_ns == noticed[i].t_ns)
        i++;
    if (i < n_truth || i < n_noticed)
        fail_msg(
            "seed %u, notice %d of %d, given %d: kind %d at %llu seq %u n %llu; given: kind %d at %llu seq %u n %llu",
            seed, i, n_truth, n_noticed, (int)truth[i].kind, (unsigned long long)truth[i].at_byte, truth[i].seq,
            (unsigned long long)truth[i].n, (int)noticed[i].kind, (unsigned long long)noticed[i].at_byte,
            noticed[i].seq, (unsigned long long)noticed[i].n);
    assert_int_equal(n_taken, n_given);
    assert_int_equal(parser.stats.frames, n_given);
    assert_int_equal(parser.stats.seq_lost, lost);
    assert_int_equal(parser.stats.repeated, repeated);
    assert_int_equal(parser.stats.late, late);
    assert_int_equal(parser.stats.bad_bytes, bad_bytes);
    assert_int_equal(parser.stats.restarts + parser.stats.cuts, 0);
}

static void test_mixtures(void **state)
{
    (void)state;
    uint64_t all_lost = 0, all_repeated = 0, all_late = 0, all_bad = 0;
    for (uint32_t seed = 1; seed <= SEEDS; seed++) {
        put_stream(seed);
        find_truth();
        run(SIZE_MAX);
        check(seed);
        run(1 + roll(300));
        check(seed);
        all_lost += lost;
        all_repeated += repeated;
        all_late += late;
        all_bad += bad_bytes;
    }
    /* The mixtures have some of everything: on average more than one of each. */
    assert_true(all_lost > SEEDS && all_repeated > SEEDS && all_late > SEEDS && all_bad > SEEDS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_mixtures)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
