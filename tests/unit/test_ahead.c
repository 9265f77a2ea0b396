/* SPDX-License-Identifier: MIT */
/* Casters are ahead exactly as far as loop.ahead_ms allows: a command would have to wait for more, and the ring has no
 * slots for more. */
#include "tests/unit/device_rig.h"

#include <poll.h>
#include <pthread.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/loop/loop_inside.h"

/* Returns how many ticks are claimed and not released. Released is read last: it only grows, so this is never too
 * much. */
static int64_t ahead(struct loop *loop)
{
    pthread_mutex_lock(&loop->casters.claim_lock);
    const uint64_t next = loop->casters.next_tick;
    pthread_mutex_unlock(&loop->casters.claim_lock);
    return (int64_t)(next - stream_released(&loop->stream));
}

static void check_ahead(const char *const *sets, int n_sets, int64_t allowed)
{
    static const struct link_spec null_link = {.type = LINK_NULL};
    const struct loop_options options = {.extra = &null_link};
    const int64_t until_ns = clock_now_ns() + 240000000000;
    struct sh_err err;
    struct loop *loop;
    struct loop_stats stats;
    int64_t most = 0;
    struct rig *rig = rig_open(&(struct device_options){.start = 1, .duration_s = 0.1}, sets, n_sets);
    need(loop_create(rig->site, rig->device, &options, &loop, &err), &err);
    need(loop_start(loop, &err), &err);
    while (!loop_is_over(loop) && clock_now_ns() < until_ns) {
        const int64_t now = ahead(loop);
        if (now > most) most = now;
        poll(NULL, 0, 1);
    }
    assert_true(loop_is_over(loop));
    loop_join(loop, &stats);
    loop_free(loop);
    rig_close(rig);
    assert_int_equal(most, allowed);
}

/* The limit is ahead_ms in whole ticks, and the current one. */
static void casters_are_ahead_as_far_as_allowed(void **state)
{
    (void)state;
    static const char *const few[] = {"head.frames=0", "loop.threads=1", "loop.ahead_ms=4"};
    static const char *const slow[] = {"head.frames=0", "loop.threads=2", "loop.ahead_ms=2", "loop.tick_hz=100"};
    check_ahead(few, 3, 5);
    check_ahead(slow, 4, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(casters_are_ahead_as_far_as_allowed),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
