/* SPDX-License-Identifier: MIT */
/* A run that takes more than ten times its planned cost gives a warning. The first tests make up the figures. The last
 * one measures a loop whose plan gives a pulse next to no time. */
#include "tests/unit/device_rig.h"

#include <poll.h>
#include <signal.h>
#include <stdatomic.h>
#include <sys/socket.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/loop/cost_watch.h"
#include "firmware_sim/loop/loop.h"
#include "firmware_sim/site/plan_rows.h"

static const int64_t DEADLINE_NS = 240000000000;
#define SECOND COST_LEAST_NS

static double add(struct cost_figures *f, int64_t cast_ns, uint64_t pulses, uint64_t ticks)
{
    const struct cost_sample now = {f->last.cast_ns + cast_ns, f->last.pulses + pulses, f->last.ticks + ticks};
    return cost_add(f, &now);
}

static void more_than_ten_times_is_told(void **state)
{
    (void)state;
    struct cost_figures f = {.planned_ns = 100.0};
    assert_true(add(&f, SECOND, 1000100, 0) == 0.0);   /* 999.9 ns */
    assert_true(add(&f, SECOND - 1, 10, 0) == 0.0);    /* too little to say */
    assert_true(add(&f, 1, 990, 0) == 1e6);            /* a second of 1,000 pulses */
    assert_true(add(&f, SECOND, 1000000, 0) == 0.0);   /* 1,000 ns: not more than ten times */
    assert_true(add(&f, SECOND, 500000, 0) == 2000.0); /* of the last pulses alone */
}

/* At most open_pulses were claimed before the window and are cast in it. */
static void what_was_claimed_before_counts(void **state)
{
    (void)state;
    struct cost_figures f = {.planned_ns = 100.0, .open_pulses = 1000000};
    assert_true(add(&f, SECOND, 1, 0) == 0.0);
    assert_true(add(&f, 10 * SECOND, 0, 0) > 9999.0); /* a tick that never ends: nothing is claimed, nothing released */
}

/* Ticks without pulses give no warning, however long they take. Ticks have a cost of their own beside their pulses. */
static void a_head_that_rests_is_not_dear(void **state)
{
    (void)state;
    struct cost_figures f = {.planned_ns = 100.0};
    for (int i = 0; i < 1000; i++)
        assert_true(add(&f, SECOND, 0, 1000) == 0.0);
    assert_true(add(&f, SECOND, 100000, 90000) == 0.0); /* 10 us a tick are 0.9 s; the rest is 1,000 ns a pulse */
    assert_true(add(&f, SECOND, 100000, 80000) > 1999.0);
}

/* ---- the loop */

static char told[512];
static _Atomic int n_told;

static void tell(void *ctx, const char *text)
{
    (void)ctx;
    if (strstr(text, "ten times") == NULL) return;
    if (atomic_fetch_add(&n_told, 1) == 0) snprintf(told, sizeof told, "%s", text);
}

static void *read_all(void *fd)
{
    static uint8_t bytes[65536];
    while (read(*(int *)fd, bytes, sizeof bytes) > 0)
        continue;
    return NULL;
}

/* Runs until there was a warning, which must come. */
static void a_loop_tells_it_once(void **state)
{
    (void)state;
    static const char *const sets[] = {"loop.pace=fast", "head.frames=0", "loop.tick_hz=100", "loop.threads=2"};
    static const struct sh_report report = {.warn = tell};
    int fd[2];
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, fd), 0);
    const struct link_spec spec = {.type = LINK_FD, .fd = fd[0]};
    const struct loop_options options = {.extra = &spec, .report = &report, .planned_ns = 1e-6};
    struct sh_err err;
    struct loop *loop;
    struct loop_stats stats;
    pthread_t reader;
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, 4);
    assert_true(site_planned_ns(rig->site) > 20.0 && site_planned_ns(rig->site) < 2000.0);
    need(loop_create(rig->site, rig->device, &options, &loop, &err), &err);
    assert_int_equal(pthread_create(&reader, NULL, read_all, &fd[1]), 0);
    need(loop_start(loop, &err), &err);
    const int64_t until_ns = clock_now_ns() + DEADLINE_NS;
    while (atomic_load(&n_told) == 0 && clock_now_ns() < until_ns)
        poll(NULL, 0, 20);
    loop_end(loop);
    while (!loop_is_over(loop) && clock_now_ns() < until_ns)
        poll(NULL, 0, 2);
    loop_join(loop, &stats);
    loop_free(loop);
    pthread_join(reader, NULL);
    close(fd[1]);
    rig_close(rig);
    assert_int_equal(n_told, 1);
    assert_non_null(strstr(told, "1e-09 us that are planned"));
    assert_non_null(strstr(told, "possible causes: "));
}

int main(void)
{
    signal(SIGPIPE, SIG_IGN);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(more_than_ten_times_is_told),
        cmocka_unit_test(what_was_claimed_before_counts),
        cmocka_unit_test(a_head_that_rests_is_not_dear),
        cmocka_unit_test(a_loop_tells_it_once),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
