/* SPDX-License-Identifier: MIT */
/* A source that makes its ticks itself, where there is no memory for one of them: the tick goes out empty, and its frames
 * with the next one. In the paces that wait, the run goes on. */
#include "tests/unit/device_rig.h"

#include <poll.h>
#include <sys/resource.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/loop/loop_inside.h"

enum { TICKS = 10, FULL_TICK = 3, TOO_LONG = 1 << 28 };
static const int64_t DEADLINE_NS = 60000000000;

static struct {
    struct device_counters counters;
    struct rlimit was;
    uint8_t *bytes;
    uint64_t again_at; /* the tick that was to have the frames of the one before */
    int n_reports;
    _Atomic int ending;
} made;

static void session_opened(void *self, uint32_t session, const char *who)
{
    (void)self, (void)session, (void)who;
}

static void report(void *self, int number, const char *text)
{
    (void)self, (void)number, (void)text;
    made.n_reports++;
}

static struct fault_board *no_faults(const void *self)
{
    (void)self;
    return NULL;
}

static int64_t tick_ns(const void *self)
{
    (void)self;
    return 1000000;
}

static struct device_counters *get_counters(void *self)
{
    (void)self;
    return &made.counters;
}

static uint64_t none(void *self)
{
    (void)self;
    return 0;
}

static void end(void *self)
{
    (void)self;
    atomic_store(&made.ending, 1);
}

static int never(const void *self)
{
    (void)self;
    return 0;
}

static uint32_t some_bytes(const void *self)
{
    (void)self;
    return 4096;
}

static void describe(void *self, struct ring_tick *tick)
{
    (void)self;
    *tick = (struct ring_tick){.bytes = NULL};
}

/* One tick has more bytes than there is memory for. */
static enum loop_source_tick next(void *self, uint64_t tick, int may_idle, int again, struct ring_tick *out)
{
    (void)self, (void)may_idle;
    const struct rlimit low = {.rlim_cur = TOO_LONG, .rlim_max = made.was.rlim_max}; /* less than there is already */
    *out = (struct ring_tick){.bytes = made.bytes};
    if (again) made.again_at = tick;
    if (tick == TICKS || atomic_load(&made.ending)) return LOOP_SOURCE_OVER;
    setrlimit(RLIMIT_AS, tick == FULL_TICK ? &low : &made.was);
    if (tick == FULL_TICK) out->len = TOO_LONG;
    return LOOP_SOURCE_TICK;
}

static const struct loop_source_ops ops = {.session_opened = session_opened,
                                           .report = report,
                                           .faults = no_faults,
                                           .rests_from = none,
                                           .tick_ns = tick_ns,
                                           .counters = get_counters,
                                           .scans = none,
                                           .end = end,
                                           .files_fill = never,
                                           .most_bytes = some_bytes,
                                           .usual_bytes = some_bytes,
                                           .describe = describe,
                                           .next = next};

static void without_memory_a_tick_goes_out_empty(void **state)
{
    (void)state;
#ifdef SH_SANITIZE
    skip(); /* a sanitizer's allocator stops the program instead */
#endif
    static const char *const sets[] = {"loop.pace=fast"};
    static const struct link_spec null_link = {.type = LINK_NULL};
    const struct loop_options options = {.extra = &null_link};
    const struct loop_source source = {&ops, &made};
    struct rig *rig = rig_open(NULL, sets, 1);
    struct loop *loop;
    struct loop_stats stats;
    struct sh_err err;
    assert_int_equal(getrlimit(RLIMIT_AS, &made.was), 0);
    made.bytes = calloc(1, TOO_LONG);
    assert_non_null(made.bytes);
    need(loop_create_of(rig->cfg, &source, &options, &loop, &err), &err);
    need(loop_start(loop, &err), &err);
    for (int64_t until_ns = clock_now_ns() + DEADLINE_NS; !loop_is_over(loop) && clock_now_ns() < until_ns;)
        poll(NULL, 0, 1);
    assert_true(loop_is_over(loop));
    loop_join(loop, &stats);
    loop_free(loop);
    free(made.bytes);
    rig_close(rig);
    if (made.again_at == 0) skip(); /* QEMU's user mode has this limit for itself */
    assert_int_equal(made.again_at, FULL_TICK + 1);
    assert_int_equal(made.n_reports, 1);
    assert_int_equal(stats.counters.late_blocks, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(without_memory_a_tick_goes_out_empty)};
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
