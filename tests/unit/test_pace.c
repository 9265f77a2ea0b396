/* SPDX-License-Identifier: MIT */
/* The pacing thread's decisions on a machine with a clock of its own: in time, late, and after the machine stood still.
 * Two naive ways are tried beside ours: to sleep up to the next beat while late, and to give a stall no credit. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/loop/pace.h"

enum { MAX_TICKS = 400 };
static const int64_t MS = 1000000, NEVER = INT64_MAX / 4;

/* One pacing thread, and one caster that is at most ahead_ticks ahead and takes cast_ns for a tick. Thread and caster
 * stand still for still_ns from still_at_ns on. */
struct machine {
    struct pace pace;
    struct device_counters counters;
    int naive_beats, naive_credit;
    int64_t wake_ns; /* that each wake-up takes */
    int64_t cost_ns; /* of a release */
    int64_t cast_ns; /* NEVER: casters make nothing */
    int64_t still_at_ns, still_ns;
    uint64_t ahead_ticks, n_ticks, n_lost;
    uint64_t together; /* this many ticks go out together; 0: each one alone */
    int64_t now_ns;
    int64_t ready_ns[MAX_TICKS];                  /* when the tick is made */
    int64_t let_ns[MAX_TICKS], out_ns[MAX_TICKS]; /* released or lost: the caster may go on; out: published */
};

static struct machine machine;

static struct machine *machine_of(int64_t tick_ns, int64_t late_ns, uint64_t ahead_ticks)
{
    struct machine *m = &machine;
    memset(m, 0, sizeof *m);
    m->pace.tick_ns = tick_ns;
    m->pace.late_ns = late_ns;
    m->pace.counters = &m->counters;
    m->pace.epoch_ns = m->now_ns = 5000 * MS;
    m->ahead_ticks = ahead_ticks;
    m->still_at_ns = NEVER;
    return m;
}

/* Returns when work that begins at a time, and takes so long, is done: the machine may stand still meanwhile. */
static int64_t after(const struct machine *m, int64_t from_ns, int64_t for_ns)
{
    const int64_t at_ns = m->pace.epoch_ns + m->still_at_ns;
    const int64_t end_ns = from_ns + for_ns;
    return end_ns > at_ns && from_ns <= at_ns ? end_ns + m->still_ns : end_ns;
}

/* Returns when an event due at t_ns happens: while the machine stands still, only once it goes on. */
static int64_t when(const struct machine *m, int64_t t_ns)
{
    const int64_t at_ns = m->pace.epoch_ns + m->still_at_ns;
    return t_ns > at_ns && t_ns < at_ns + m->still_ns ? at_ns + m->still_ns : t_ns;
}

static int64_t ready_at(struct machine *m, uint64_t tick)
{
    if (m->cast_ns == NEVER) return NEVER;
    if (m->ready_ns[tick] != 0) return m->ready_ns[tick];
    int64_t from_ns = m->pace.epoch_ns;
    if (tick > 0 && ready_at(m, tick - 1) > from_ns) from_ns = m->ready_ns[tick - 1];
    if (tick >= m->ahead_ticks && m->let_ns[tick - m->ahead_ticks] > from_ns)
        from_ns = m->let_ns[tick - m->ahead_ticks];
    return m->ready_ns[tick] = after(m, from_ns, m->cast_ns);
}

/* Goes on up to n_ticks. */
static void run(struct machine *m, uint64_t n_ticks)
{
    int64_t until_ns = 0;
    if (m->n_ticks == 0) pace_begin(&m->pace, m->now_ns);
    for (uint64_t tick = m->n_ticks; tick < n_ticks;) {
        const int64_t ready_ns = ready_at(m, tick);
        if (m->naive_credit) m->pace.credit_ns = 0;
        if (tick > m->pace.together_until) m->pace.together_until = tick + m->together;
        const enum pace_step step = pace_look(&m->pace, tick, ready_ns <= m->now_ns, m->now_ns, &until_ns);
        switch (step) {
        case PACE_SLEEP:
            m->now_ns = when(m, until_ns) + m->wake_ns;
            break;
        case PACE_AWAIT:
            m->now_ns = when(m, !m->naive_beats && ready_ns < until_ns ? ready_ns : until_ns) + m->wake_ns;
            break;
        case PACE_RELEASE:
            m->let_ns[tick] = m->now_ns;
            m->out_ns[tick] = m->now_ns = after(m, m->now_ns, m->cost_ns);
            pace_released(&m->pace, tick++, m->now_ns);
            break;
        case PACE_GIVE_UP:
            m->let_ns[tick++] = m->now_ns;
            m->n_lost++;
            break;
        }
    }
    m->n_ticks = n_ticks;
}

static int64_t late_of(const struct machine *m, uint64_t tick)
{
    return m->out_ns[tick] - m->pace.epoch_ns - (int64_t)(tick + 1) * m->pace.tick_ns;
}

/* All is in time: each wake-up is late by its own duration, and a release by its cost more. */
static void known_latenesses(void **state)
{
    (void)state;
    struct machine *m = machine_of(MS, 100 * MS, 64);
    m->wake_ns = 31;
    m->cost_ns = 1000;
    run(m, 300);
    assert_int_equal(lateness_count(&m->pace.late), 300);
    assert_int_equal(lateness_count(&m->pace.wake), 300);
    assert_true(lateness_us(&m->pace.wake, 1.0) == 0.031 && lateness_us(&m->pace.late, 1.0) == 1.031);
    assert_int_equal(atomic_load(&m->counters.late_max_ns), 1031);
    assert_int_equal(atomic_load(&m->counters.late_blocks), 0);
}

/* Ticks that go out together are due together: their thread wakes up once, and none of them is late. */
static void ticks_go_out_together(void **state)
{
    (void)state;
    struct machine *m = machine_of(MS, 100 * MS, 64);
    m->wake_ns = 31;
    m->cost_ns = 1000;
    m->together = 9;
    run(m, 301); /* the first one alone, and thirty times ten */
    assert_int_equal(lateness_count(&m->pace.late), 301);
    assert_int_equal(lateness_count(&m->pace.wake), 31);
    for (uint64_t tick = 1; tick < 301; tick++) {
        const uint64_t last = (tick + 9) / 10 * 10;
        assert_int_equal(late_of(m, tick), (int64_t)(last - tick) * MS + 31 + (int64_t)(tick - (last - 10)) * 1000);
    }
    assert_true(atomic_load(&m->counters.late_max_ns) == 10031 && atomic_load(&m->counters.late_blocks) == 0);
}

/* A delay of exactly one tick does not count as more than one. */
static void late_ticks_are_counted(void **state)
{
    (void)state;
    struct machine *m = machine_of(MS, 100 * MS, 64);
    static const int64_t late_ns[] = {0, 1, 999999, 1000000, 40000000, 1000001, 1500000, -3};
    pace_begin(&m->pace, m->now_ns);
    for (uint64_t tick = 0; tick < 8; tick++)
        pace_released(&m->pace, tick, m->pace.epoch_ns + (int64_t)(tick + 1) * MS + late_ns[tick]);
    assert_int_equal(atomic_load(&m->counters.late_blocks), 3);
    assert_int_equal(atomic_load(&m->counters.late_max_ns), 40000000);
    assert_int_equal(lateness_count(&m->pace.late), 8);
}

/* The machine stands still for 300 ms. A caster takes 1 ms for a tick of 10 ms, so a head with one tick ahead gains
 * 9 ms a tick. It has caught up after ceil(300 / 9) ticks and the tick that was waited for. */
static void a_stall_is_caught_up(void **state)
{
    (void)state;
    for (int naive = 0; naive < 2; naive++) {
        struct machine *m = machine_of(10 * MS, 1000 * MS, 1);
        m->naive_beats = naive;
        m->cast_ns = MS;
        m->still_at_ns = 205 * MS;
        m->still_ns = 300 * MS;
        run(m, 200);
        assert_int_equal(m->n_lost, 0);
        assert_true(late_of(m, 19) < MS && late_of(m, 20) > 280 * MS);
        if (naive) {
            assert_true(late_of(m, 199) > 280 * MS); /* one wait for a beat per tick: it never catches up */
            continue;
        }
        assert_in_range(atomic_load(&m->counters.late_blocks), 30, 35);
        for (uint64_t tick = 20 + 35; tick < 200; tick++)
            assert_true(late_of(m, tick) < MS);
    }
}

/* Late ticks are sent when they are ready, not on a beat. A caster that is slow once delays only its own tick. */
static void a_late_tick_goes_out_at_once(void **state)
{
    (void)state;
    struct machine *m = machine_of(10 * MS, 100 * MS, 2);
    m->cast_ns = MS;
    m->ready_ns[7] = m->pace.epoch_ns + 83 * MS;
    run(m, 20);
    assert_true(late_of(m, 7) == 3 * MS);
    for (uint64_t tick = 0; tick < 20; tick++)
        if (tick != 7) assert_true(late_of(m, tick) == 0);
}

static uint64_t lost_by_a_stall(int naive_credit, int64_t still_at_ns)
{
    struct machine *m = machine_of(MS, 2 * MS, 3);
    m->naive_credit = naive_credit;
    m->cast_ns = MS / 5;
    m->cost_ns = MS / 100;
    m->still_at_ns = still_at_ns;
    m->still_ns = 300 * MS;
    run(m, 400);
    return m->n_lost;
}

/* Ticks that are late since all stood still are not given up, wherever the thread was: asleep, in a release, or waiting
 * for a tick. */
static void a_stall_costs_nothing(void **state)
{
    (void)state;
    for (int64_t at_ns = 20 * MS; at_ns < 22 * MS; at_ns += MS / 200) {
        assert_int_equal(lost_by_a_stall(0, at_ns), 0);
        assert_true(lost_by_a_stall(1, at_ns) > 0);
    }
}

/* Credit ends with the stall: a thread that has caught up gives up a tick after late_ns, within a beat. */
static void credit_ends(void **state)
{
    (void)state;
    struct machine *m = machine_of(MS, 5 * MS, 64);
    m->cast_ns = MS / 10;
    m->still_at_ns = 20 * MS;
    m->still_ns = 200 * MS;
    run(m, 300);
    assert_int_equal(m->n_lost, 0);
    assert_true(late_of(m, 299) < MS);
    m->cast_ns = NEVER;
    run(m, 301);
    assert_int_equal(m->n_lost, 1);
    assert_in_range(m->now_ns - m->pace.epoch_ns, 301 * MS + 5 * MS + 1, 301 * MS + 6 * MS + 1);
}

/* Credit is as long as the stall. A tick that is never made is then given up after that credit and late_ns. */
static void credit_is_as_long_as_the_stall(void **state)
{
    (void)state;
    struct machine *m = machine_of(MS, 5 * MS, 64);
    m->cast_ns = MS / 10;
    run(m, 20);
    m->cast_ns = NEVER;
    m->still_at_ns = 20 * MS + MS / 2;
    m->still_ns = 200 * MS;
    run(m, 21);
    assert_int_equal(m->n_lost, 1);
    /* Asleep up to 21 ms, the thread woke at 220.5, so it stood still for 199.5 ms. The limit is 21 + 199.5 + 5 = 225.5
     * ms, and the last look before it is at 225 ms. */
    assert_in_range(m->now_ns - m->pace.epoch_ns, 225 * MS, 227 * MS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(known_latenesses),
        cmocka_unit_test(ticks_go_out_together),
        cmocka_unit_test(late_ticks_are_counted),
        cmocka_unit_test(a_stall_is_caught_up),
        cmocka_unit_test(a_late_tick_goes_out_at_once),
        cmocka_unit_test(a_stall_costs_nothing),
        cmocka_unit_test(credit_ends),
        cmocka_unit_test(credit_is_as_long_as_the_stall),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
