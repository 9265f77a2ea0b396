/* SPDX-License-Identifier: MIT */
/* Faults of packets in a soak: which units came, which the ledger misses, and how each fault is judged by them. The
 * clean packets are the test's: 200 of 100 bytes. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/app/studio/soak/datagrams.h"
#include "firmware_sim/app/studio/soak/judge.h"
#include "firmware_sim/app/studio/soak/row.h"
#include "firmware_sim/app/studio/soak/sheet.h"
#include "tests/unit/soak_rig.h"

enum { UNITS = 1 << 20, N = 200, BYTES = 100, AT = 50 };

static struct soak *soak;
static struct soak_link *at;

soak_seq soak_unit(uint64_t number)
{
    return UNITS + number;
}

static uint64_t digest_of(soak_seq seq)
{
    return 7 * seq;
}

int soak_datagrams_get(const struct soak_datagrams *datagrams, soak_seq seq, struct soak_clean_frame *out)
{
    if ((const void *)datagrams != soak || seq <= UNITS || seq > UNITS + N) return 0;
    *out = (struct soak_clean_frame){.seq = seq, .digest = digest_of(seq), .len = BYTES, .there = 1};
    return 1;
}

static int begin(void **state)
{
    (void)state;
    soak = soak_rig_make();
    at = &soak->link[0];
    at->datagrams = (struct soak_datagrams *)soak;
    at->in_session = 0;
    strcpy(at->type, "udp");
    return 0;
}

static int end(void **state)
{
    (void)state;
    soak_rig_end(soak);
    return 0;
}

static void inject_at(enum fault_kind kind, uint64_t number, uint64_t n, int64_t byte)
{
    const struct fault_note note = {
        .fault = 1, .kind = kind, .link = 1, .number = number, .n = n, .byte = byte, .for_ms = 100};
    soak_heard(soak, &note);
}

static void come(unsigned number)
{
    soak_saw_unit(at, soak_unit(number), digest_of(soak_unit(number)), BYTES);
}

/* The units `from` to `to` - 1 come. */
static void come_all(unsigned from, unsigned to)
{
    while (from < to)
        come(from++);
}

static void bad_unit(uint64_t bytes)
{
    at->bad_units++;
    at->bad_bytes += bytes;
}

/* All units from this one on come, and are judged. Returns how many reasons for a bad verdict there are. */
static unsigned judge_after(unsigned from)
{
    come_all(from, N + 1);
    soak_judge(at, 1);
    soak_conclude(soak);
    return soak->n_failures;
}

static void expect_row(enum fault_kind kind, unsigned injected, unsigned noticed, unsigned lost, const char *why)
{
    const struct soak_row *row = &at->row[kind];
    assert_int_equal(row->injected, injected);
    assert_int_equal(row->noticed, noticed);
    assert_int_equal(row->lost, lost);
    assert_int_equal(row->hidden, why != NULL ? injected - noticed : 0);
    assert_int_equal(row->missed, why == NULL ? injected - noticed : 0);
    if (why != NULL) assert_string_equal(row->why, why);
}

static void clean_packets(void **state)
{
    (void)state;
    assert_int_equal(judge_after(1), 0);
    assert_true(at->frames == N && at->bytes == N * BYTES && at->first == soak_unit(1) && at->last == soak_unit(N));
    assert_true(at->lost_plain == 0 && at->wrong_plain == 0 && at->unknown == 0 && at->in_session == 1);
}

/* Packets that are lost before the first one came do not count; a later lost one does. */
static void lost_packets(void **state)
{
    (void)state;
    come_all(3, AT);
    assert_int_equal(at->first, soak_unit(3));
    assert_int_equal(judge_after(AT + 2), 1);
    assert_string_equal(soak->failures[0], "frames were lost without a fault");
    assert_int_equal(at->lost_plain, 2);
}

static void a_wrong_packet(void **state)
{
    (void)state;
    come_all(1, AT);
    soak_saw_unit(at, soak_unit(AT), 5, BYTES);
    assert_int_equal(judge_after(AT + 1), 1);
    assert_int_equal(at->wrong_plain, 1);
}

/* A packet whose bits changed does not arrive, since its checksum is wrong. */
static void drops_and_flips(void **state)
{
    static const enum fault_kind kinds[] = {FAULT_DROP, FAULT_FLIP};
    (void)state;
    for (int i = 0; i < 2; i++) {
        for (int arrives = 0; arrives < 2; arrives++) {
            end(NULL);
            begin(NULL);
            inject_at(kinds[i], AT, 3, 30);
            come_all(1, AT + (unsigned)arrives);
            assert_int_equal(judge_after(AT + 1) == 0, !arrives);
            expect_row(kinds[i], 1, !arrives, !arrives, NULL);
            assert_true(at->expected_bad_min == 0 && at->expected_bad_max == 0);
        }
    }
}

/* The rest of a cut packet is no packet of the stream. */
static void cut_packets(void **state)
{
    (void)state;
    inject_at(FAULT_TRUNCATE, AT, 60, 40);
    come_all(1, AT);
    bad_unit(40);
    assert_int_equal(judge_after(AT + 1), 0);
    expect_row(FAULT_TRUNCATE, 1, 1, 1, NULL);
    assert_true(at->expected_bad_min == 40 && at->expected_bad_max == 40);
}

/* Packets that are split, or joined with others, have the wrong length, so none of them is known. */
static void split_and_merged_packets(void **state)
{
    (void)state;
    inject_at(FAULT_SPLIT, AT, 2, 0);
    come_all(1, AT);
    bad_unit(50);
    bad_unit(50);
    assert_int_equal(judge_after(AT + 1), 0);
    expect_row(FAULT_SPLIT, 1, 1, 1, NULL);
    assert_int_equal(at->expected_bad_min, BYTES);
    end(NULL);
    begin(NULL);
    inject_at(FAULT_MERGE, AT, 3, 0);
    come_all(1, AT);
    bad_unit(3 * BYTES);
    assert_int_equal(judge_after(AT + 3), 0);
    expect_row(FAULT_MERGE, 1, 1, 3, NULL);
    assert_int_equal(at->expected_bad_min, 3 * BYTES);
    end(NULL);
    begin(NULL);
    inject_at(FAULT_SPLIT, AT, 2, 0); /* it came as a whole */
    assert_int_equal(judge_after(1), 2);
    expect_row(FAULT_SPLIT, 1, 0, 0, NULL);
    end(NULL);
    begin(NULL);
    inject_at(FAULT_SPLIT, AT, 2, 0);
    inject_at(FAULT_DROP, AT, 0, 0);
    come_all(1, AT);
    bad_unit(BYTES);
    judge_after(AT + 1);
    expect_row(FAULT_SPLIT, 1, 0, 0, "the frame was destroyed besides");
    expect_row(FAULT_DROP, 1, 1, 1, NULL);
}

static void copies_and_order(void **state)
{
    (void)state;
    inject_at(FAULT_DUPLICATE, AT, 2, 0);
    come_all(1, AT + 1);
    come(AT);
    come(AT);
    assert_int_equal(judge_after(AT + 1), 0);
    expect_row(FAULT_DUPLICATE, 1, 1, 0, NULL);
    assert_true(at->frames == N && at->bytes == N * BYTES); /* a copy is no new packet */
    end(NULL);
    begin(NULL);
    inject_at(FAULT_DUPLICATE, AT, 2, 0);
    come_all(1, AT + 1);
    come(AT);
    assert_true(judge_after(AT + 1) != 0);
    expect_row(FAULT_DUPLICATE, 1, 0, 0, NULL);
    end(NULL);
    begin(NULL);
    inject_at(FAULT_REORDER, AT, 2, 0);
    come_all(1, AT);
    come_all(AT + 1, AT + 3);
    come(AT);
    assert_int_equal(judge_after(AT + 3), 0);
    expect_row(FAULT_REORDER, 1, 1, 1, NULL);
    assert_int_equal(at->frames, N - 1);
    end(NULL);
    begin(NULL);
    inject_at(FAULT_REORDER, AT, 2, 0);
    assert_true(judge_after(1) != 0);
    expect_row(FAULT_REORDER, 1, 0, 0, NULL);
}

/* Each piece of garbage is a packet of its own, and each bad packet counts as one piece of garbage. */
static void garbage(void **state)
{
    (void)state;
    inject_at(FAULT_GARBAGE, AT, 30, 0);
    inject_at(FAULT_GARBAGE, AT + 9, 20, 0);
    come_all(1, AT);
    bad_unit(30);
    bad_unit(20);
    assert_int_equal(judge_after(AT), 0);
    expect_row(FAULT_GARBAGE, 2, 2, 0, NULL);
    assert_true(at->bad_units == 0 && at->expected_bad_min == 50);
    end(NULL);
    begin(NULL);
    inject_at(FAULT_GARBAGE, AT, 30, 0);
    inject_at(FAULT_GARBAGE, AT + 9, 20, 0);
    come_all(1, AT);
    bad_unit(50);
    assert_int_equal(judge_after(AT), 1);
    expect_row(FAULT_GARBAGE, 2, 1, 0, NULL);
}

static void delays(void **state)
{
    (void)state;
    inject_at(FAULT_DELAY, AT, 0, 0);
    assert_int_equal(judge_after(1), 0);
    expect_row(FAULT_DELAY, 1, 0, 0, "packets are compared only by their contents");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(clean_packets, begin, end),
        cmocka_unit_test_setup_teardown(lost_packets, begin, end),
        cmocka_unit_test_setup_teardown(a_wrong_packet, begin, end),
        cmocka_unit_test_setup_teardown(drops_and_flips, begin, end),
        cmocka_unit_test_setup_teardown(cut_packets, begin, end),
        cmocka_unit_test_setup_teardown(split_and_merged_packets, begin, end),
        cmocka_unit_test_setup_teardown(copies_and_order, begin, end),
        cmocka_unit_test_setup_teardown(garbage, begin, end),
        cmocka_unit_test_setup_teardown(delays, begin, end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
