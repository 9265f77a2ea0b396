/* SPDX-License-Identifier: MIT */
/* Each reading of the system's clocks lies between two of the test's own, by clock_gettime. */
#include "firmware_sim/base/clock.h"

#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <sys/time.h>
#include <sys/timex.h>

#include <cmocka.h>

enum { MS = 1000000 };

static int64_t ns_of(clockid_t id)
{
    struct timespec t;
    assert_int_equal(clock_gettime(id, &t), 0);
    return (int64_t)t.tv_sec * 1000 * MS + t.tv_nsec;
}

static void readings_lie_between_others(void **state)
{
    (void)state;
    int64_t from = ns_of(CLOCK_MONOTONIC), is = clock_now_ns();
    assert_true(from <= is && is <= ns_of(CLOCK_MONOTONIC));
    from = ns_of(CLOCK_THREAD_CPUTIME_ID);
    is = clock_thread_ns();
    assert_true(from <= is && is <= ns_of(CLOCK_THREAD_CPUTIME_ID));
    from = ns_of(CLOCK_PROCESS_CPUTIME_ID);
    const double cpu_s = clock_cpu_s(), to = (double)ns_of(CLOCK_PROCESS_CPUTIME_ID);
    assert_true(1e-9 * (double)from <= cpu_s && cpu_s <= 1e-9 * to);
}

/* from and to are times of a clock before and after the monotonic clock was read. Expects `is` to be the clock's time
 * `after` later than that reading, which is known to half the span of two readings: at most to - from. */
static void expect_between(int64_t from, int64_t is, int64_t to, int64_t after)
{
    assert_true(is - after >= from - (to - from) && is - after <= to + (to - from));
}

/* The day's clocks may be asked for a monotonic time before or after now. */
static void clocks_of_the_day_are_read_at_a_monotonic_time(void **state)
{
    (void)state;
    static const int64_t after[] = {0, 3600000 * INT64_C(1000000), -5};
    struct timex timex = {.modes = 0};
    adjtimex(&timex);
    for (size_t i = 0; i < sizeof after / sizeof after[0]; i++) {
        int64_t from = ns_of(CLOCK_REALTIME), now = clock_now_ns();
        int64_t is = clock_utc_ns(now + after[i]);
        expect_between(from, is, ns_of(CLOCK_REALTIME), after[i]);
        from = ns_of(CLOCK_TAI);
        now = clock_now_ns();
        assert_int_equal(clock_tai_ns(now + after[i], &is), timex.tai != 0);
        expect_between(from, is, ns_of(CLOCK_TAI), after[i]);
    }
}

static void *give_clock(void *arg)
{
    pthread_getcpuclockid(pthread_self(), arg);
    return NULL;
}

static void a_threads_clock_is_read_until_it_ends(void **state)
{
    (void)state;
    pthread_t thread;
    clockid_t clock;
    int64_t ns = -7;
    assert_int_equal(pthread_getcpuclockid(pthread_self(), &clock), 0);
    const int64_t from = ns_of(CLOCK_THREAD_CPUTIME_ID);
    assert_int_equal(clock_read_of_thread(clock, &ns), 1);
    assert_true(from <= ns && ns <= ns_of(CLOCK_THREAD_CPUTIME_ID));
    assert_int_equal(pthread_create(&thread, NULL, give_clock, &clock), 0);
    assert_int_equal(pthread_join(thread, NULL), 0);
    ns = -7;
    assert_int_equal(clock_read_of_thread(clock, &ns), 0);
    assert_int_equal(ns, -7);
}

static volatile sig_atomic_t n_signals;

static void count_signal(int number)
{
    (void)number;
    n_signals++;
}

/* Signals each 0.5 ms don't end a sleep of 3 ms. A time that is past is no sleep. */
static void a_sleep_goes_on_after_signals(void **state)
{
    (void)state;
    const struct sigaction act = {.sa_handler = count_signal};
    const struct itimerval each = {{0, 500}, {0, 500}}, never = {{0, 0}, {0, 0}};
    struct sigaction before;
    clock_sleep_until_ns(clock_now_ns() - 1);
    clock_sleep_until_ns(0);
    assert_int_equal(sigaction(SIGALRM, &act, &before), 0);
    assert_int_equal(setitimer(ITIMER_REAL, &each, NULL), 0);
    const int64_t until = clock_now_ns() + 3 * MS;
    while (n_signals == 0)
        clock_sleep_until_ns(until);
    clock_sleep_until_ns(until);
    assert_true(clock_now_ns() >= until);
    assert_int_equal(setitimer(ITIMER_REAL, &never, NULL), 0);
    assert_int_equal(sigaction(SIGALRM, &before, NULL), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(readings_lie_between_others),
        cmocka_unit_test(clocks_of_the_day_are_read_at_a_monotonic_time),
        cmocka_unit_test(a_threads_clock_is_read_until_it_ends),
        cmocka_unit_test(a_sleep_goes_on_after_signals),
    };
    return cmocka_run_group_tests_name("clock", tests, NULL, NULL);
}
