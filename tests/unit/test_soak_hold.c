/* SPDX-License-Identifier: MIT */
/* At pace fast the clean reader holds the head while a client is far behind it: by a quarter of the ledger, or by half
 * of what the library keeps. The clock is the test's. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "firmware_sim/app/studio/record/offline.h"
#include "firmware_sim/app/studio/soak/clean.h"
#include "firmware_sim/app/studio/soak/frame.h"
#include "firmware_sim/app/studio/soak/hold.h"
#include "firmware_sim/app/studio/soak/judge.h"
#include "firmware_sim/app/studio/soak/ledger.h"
#include "tests/unit/clock_rig.h"
#include "tests/unit/soak_rig.h"

enum { MOST = SOAK_RING / 4, HALF = 32 << 20 };

static struct soak *soak;
static struct soak_link *at;

/* It stands for the one that would need the whole head, with another clock. Nothing connects here. */
int offline_connect(const char *who, struct link_spec *link, struct scanhead **sh, struct sh_err *err)
{
    (void)link;
    (void)sh;
    return sh_fail(err, SH_ESTATE, "%s does not connect", who);
}

/* The client has read FIRST. */
static int begin(void **state)
{
    (void)state;
    clock_rig_ns = 5000000000;
    soak = soak_rig_make();
    soak->realtime = 0;
    at = &soak->link[0];
    see(soak, FIRST, 0, 0.0);
    return 0;
}

static int end(void **state)
{
    (void)state;
    soak_rig_end(soak);
    return 0;
}

/* The clean reader reads these frames, one after the other. */
static void stream_to(uint32_t from, uint32_t to)
{
    for (uint32_t seq = from; seq < to; seq++) {
        const soak_seq top = soak_seq_of(soak, seq);
        soak->clean.ring[top % SOAK_RING] = (struct soak_clean_frame){
            .seq = top, .digest = (uint64_t)seq << 32 | seq, .t_ns = (int64_t)seq * TICK_NS, .len = 60, .there = 1};
        soak->clean.top = top;
        atomic_store(&soak->base, top);
        soak->clean.frames++;
        assert_int_equal(soak_hold(soak), 0);
    }
}

/* The clean reader is n frames of that many bytes ahead of the client. */
static void run_ahead(uint32_t n, uint64_t bytes_each)
{
    struct soak_clean *c = &soak->clean;
    const soak_seq from = soak_seq_of(soak, FIRST);
    c->ring[from % SOAK_RING] = (struct soak_clean_frame){.seq = from, .end_byte = 1000, .there = 1};
    c->top = from + n;
    c->frames = n + 1;
    c->bytes = 1000 + n * bytes_each;
}

static void by_frames_and_bytes(void **state)
{
    static const struct {
        uint32_t n;
        uint64_t bytes_each;
        int holds;
    } rows[] = {{0, 0, 0},
                {1, 100, 0},
                {MOST, 100, 0},
                {MOST + 1, 100, 1},
                {32, 1 << 20, 0},
                {32, (1 << 20) + 1, 1},
                {1, HALF + UINT64_C(1), 1}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        run_ahead(rows[i].n, rows[i].bytes_each);
        const int64_t from_ns = clock_rig_ns;
        assert_int_equal(soak_hold(soak), rows[i].holds);
        assert_int_equal(clock_rig_ns - from_ns, rows[i].holds ? 1000000 : 0);
    }
    run_ahead(MOST + 1, 100);
    see(soak, FIRST + 1, 0, 0.0); /* it catches up */
    assert_int_equal(soak_hold(soak), 0);
}

/* In real time the head waits for nobody. A client without a connection may wait for the head's time. */
static void who_holds(void **state)
{
    (void)state;
    run_ahead(MOST + 1, 100);
    assert_int_equal(soak_hold(soak), 1);
    soak->realtime = 1;
    assert_int_equal(soak_hold(soak), 0);
    soak->realtime = 0;
    at->usable = 0;
    assert_int_equal(soak_hold(soak), 0);
    at->usable = 1;
    atomic_store(&soak->phase, SOAK_DRAINS);
    assert_int_equal(soak_hold(soak), 1);
    atomic_store(&soak->phase, SOAK_ENDS);
    assert_int_equal(soak_hold(soak), 0);
    atomic_store(&soak->phase, SOAK_RUNS);
    soak_saw_end(at);
    assert_int_equal(soak_hold(soak), 0);
    soak_saw_open(at); /* it reads from the top on */
    assert_int_equal(soak_hold(soak), 0);
    soak->clean.top += MOST + 1;
    assert_int_equal(soak_hold(soak), 1);
}

/* A client that waits for a reply stands still for 5 s at most. One that stands still for 6 s holds no more until it
 * reads again. */
static void not_for_ever(void **state)
{
    (void)state;
    run_ahead(MOST + 1000, 100);
    const int64_t from_ns = clock_rig_ns;
    while (soak_hold(soak))
        assert_true(clock_rig_ns - from_ns <= 6000000000);
    assert_int_equal(clock_rig_ns - from_ns, 6000000000);
    assert_int_equal(soak_hold(soak), 0);
    see(soak, FIRST + 1, 0, 0.0);
    assert_int_equal(soak_hold(soak), 1);
}

/* A client is away for longer than the ring of frames. Nothing of that is lost, and all before it is compared. */
static void absences_of_any_length(void **state)
{
    static const uint32_t away[] = {1000, 40000, 70000, 200000};
    (void)state;
    for (size_t i = 0; i < 2 * sizeof away / sizeof away[0]; i++) {
        const uint32_t from = FIRST + 100, to = from + away[i / 2];
        soak_rig_end(soak);
        soak = soak_rig_make();
        soak->realtime = 0;
        at = &soak->link[0];
        stream_to(FIRST, from);
        see_others(soak, FIRST, from);
        soak_saw_end(at);
        stream_to(from, to);
        soak_saw_open(at);
        if (i % 2 != 0) notice(soak, SCANHEAD_NOTICE_GAP, from, away[i / 2]);
        stream_to(to, to + 10);
        see_others(soak, to, to + 10);
        soak_judge(at, 1);
        assert_int_equal(at->lost_plain + at->unknown + at->too_far, 0);
    }
}

/* A client that has read nothing so far is behind by all that the clean reader has. */
static void before_its_first_frame(void **state)
{
    (void)state;
    soak_rig_end(soak);
    soak = soak_rig_make();
    soak->realtime = 0;
    soak->clean.top = soak_seq_of(soak, FIRST + MOST);
    soak->clean.frames = MOST;
    assert_int_equal(soak_hold(soak), 0);
    soak->clean.frames++;
    assert_int_equal(soak_hold(soak), 1);
    soak->clean.frames = 10;
    soak->clean.bytes = HALF + UINT64_C(1);
    assert_int_equal(soak_hold(soak), 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(by_frames_and_bytes, begin, end),
        cmocka_unit_test_setup_teardown(who_holds, begin, end),
        cmocka_unit_test_setup_teardown(not_for_ever, begin, end),
        cmocka_unit_test_setup_teardown(absences_of_any_length, begin, end),
        cmocka_unit_test_setup_teardown(before_its_first_frame, begin, end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
