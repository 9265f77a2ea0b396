/* SPDX-License-Identifier: MIT */
/* A source that makes its ticks itself. Where there is no memory for one of them, or where it comes too late in real
 * time, the tick goes out empty, and its frames with the next one. In the paces that wait, the run goes on. */
#include "tests/unit/device_rig.h"
#include "tests/unit/plain_source.h"

#include <poll.h>
#include <sys/resource.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/loop/loop_inside.h"

enum { TICKS = 10, FULL_TICK = 3, LATE_TICK = 5, TOO_LONG = 1 << 28 };
static const int64_t DEADLINE_NS = 60000000000;

static struct {
    struct plain_source source;
    struct rlimit was;
    uint8_t *bytes;
    uint64_t again_at; /* the tick that was to have the frames of the one before */
    struct loop *loop;
    int is_again[TICKS + 1], n_again; /* all of them */
} made;

/* One tick has more bytes than there is memory for. */
static enum loop_source_tick next(struct plain_source *self, uint64_t tick, int again, struct ring_tick *out)
{
    const struct rlimit low = {.rlim_cur = TOO_LONG, .rlim_max = made.was.rlim_max}; /* less than there is already */
    *out = (struct ring_tick){.bytes = made.bytes};
    if (again) made.again_at = tick;
    if (tick == TICKS || atomic_load(&self->ending)) return LOOP_SOURCE_OVER;
    setrlimit(RLIMIT_AS, tick == FULL_TICK ? &low : &made.was);
    if (tick == FULL_TICK) out->len = TOO_LONG;
    return LOOP_SOURCE_TICK;
}

static void without_memory_a_tick_goes_out_empty(void **state)
{
    (void)state;
#ifdef SH_SANITIZE
    skip(); /* a sanitizer's allocator stops the program instead */
#endif
    static const char *const sets[] = {"loop.pace=fast"};
    static const struct link_spec null_link = {.type = LINK_NULL};
    const struct loop_options options = {.extra = &null_link};
    const struct loop_source source = {&plain_source_ops, &made.source};
    struct rig *rig = rig_open(NULL, sets, 1);
    struct loop *loop;
    struct loop_stats stats;
    struct sh_err err;
    made.source.next = next;
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
    assert_int_equal(made.source.n_reports, 1);
    assert_int_equal(stats.counters.late_blocks, 1);
}

/* One tick is made when it was given up already. */
static enum loop_source_tick next_late(struct plain_source *self, uint64_t tick, int again, struct ring_tick *out)
{
    *out = (struct ring_tick){.bytes = NULL};
    made.n_again += again;
    made.is_again[tick] = again;
    if (tick == TICKS || atomic_load(&self->ending)) return LOOP_SOURCE_OVER;
    const int64_t until_ns = clock_now_ns() + DEADLINE_NS;
    while (tick == LATE_TICK && stream_released(&made.loop->stream) <= tick && clock_now_ns() < until_ns)
        poll(NULL, 0, 1);
    return LOOP_SOURCE_TICK;
}

/* On a busy machine other ticks may be late, too. Each counts. */
static void a_tick_that_is_late_goes_out_empty(void **state)
{
    (void)state;
    static const struct link_spec null_link = {.type = LINK_NULL};
    const struct loop_options options = {.extra = &null_link};
    const struct loop_source source = {&plain_source_ops, &made.source};
    struct rig *rig = rig_open(NULL, NULL, 0);
    struct loop_stats stats;
    struct sh_err err;
    made.source = (struct plain_source){.next = next_late};
    need(loop_create_of(rig->cfg, &source, &options, &made.loop, &err), &err);
    need(loop_start(made.loop, &err), &err);
    for (int64_t until_ns = clock_now_ns() + DEADLINE_NS; !loop_is_over(made.loop) && clock_now_ns() < until_ns;)
        poll(NULL, 0, 1);
    assert_true(loop_is_over(made.loop));
    loop_join(made.loop, &stats);
    loop_free(made.loop);
    rig_close(rig);
    assert_true(made.is_again[LATE_TICK + 1]);
    assert_true(stats.counters.late_blocks >= (uint64_t)made.n_again); /* the pacing thread counts its own there, too */
    assert_int_equal(made.source.n_reports, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(without_memory_a_tick_goes_out_empty),
        cmocka_unit_test(a_tick_that_is_late_goes_out_empty),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
