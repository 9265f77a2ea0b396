/* SPDX-License-Identifier: MIT */
/* Work that several threads share: how many threads call it, which one of them reports, and what happens where the
 * system makes too few. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>

static int n_made, n_may_be_made;

/* Makes n_may_be_made threads, and then none, as where the system has no room for more. */
static int make_thread(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *), void *arg)
{
    if (n_made == n_may_be_made) return EAGAIN;
    n_made++;
    return pthread_create(thread, attributes, run, arg);
}

#define pthread_create make_thread
#include "core/together.h"
#undef pthread_create

struct calls {
    pthread_t caller;
    atomic_uint all, reports, reports_elsewhere;
};

static void note(void *ctx, int reports)
{
    struct calls *calls = ctx;
    atomic_fetch_add(&calls->all, 1);
    if (reports == 0) return;
    atomic_fetch_add(&calls->reports, 1);
    if (reports != 1 || !pthread_equal(pthread_self(), calls->caller)) atomic_fetch_add(&calls->reports_elsewhere, 1);
}

/* Only the caller's thread may report progress: reports of several threads would meet. */
static void only_the_caller_reports(void **state)
{
    (void)state;
    static const struct {
        unsigned threads, calls;
        int may_be_made, made;
    } rows[] = {{0, 1, 1000, 0},
                {1, 1, 1000, 0},
                {2, 2, 1000, 1},
                {5, 5, 1000, 4},
                {5, 1, 0, 0},
                {5, 4, 3, 3},
                {TOGETHER_MAX + 1, TOGETHER_MAX + 1, 1000, TOGETHER_MAX},
                {TOGETHER_MAX + 2, TOGETHER_MAX + 1, 1000, TOGETHER_MAX}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct calls calls = {.caller = pthread_self()};
        n_made = 0;
        n_may_be_made = rows[i].may_be_made;
        together(rows[i].threads, note, &calls);
        assert_int_equal(atomic_load(&calls.all), rows[i].calls);
        assert_int_equal(atomic_load(&calls.reports), 1);
        assert_int_equal(atomic_load(&calls.reports_elsewhere), 0);
        assert_int_equal(n_made, rows[i].made);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(only_the_caller_reports),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
