/* SPDX-License-Identifier: MIT */
/* The thread that plans a station's new place. While the run ends, links still take commands: a move that comes then is
 * refused, and no thread is left that nobody waits for. */
#include "tests/unit/device_rig.h"

#include <sys/eventfd.h>

#include "firmware_sim/loop/mover.h"

struct bench {
    struct rig *rig;
    struct stream stream;
    struct mover mover;
    struct move_box box;
    int wake_fd;
};

static void open_bench(struct bench *b)
{
    static const struct ring_size size = {.ahead_ticks = 4, .queue_ticks = 3, .spare_ticks = 2, .usual_bytes = 512};
    struct sh_err err;
    memset(b, 0, sizeof *b);
    b->rig = rig_open(NULL, NULL, 0);
    rig_go_to(b->rig, 300); /* it boots for 200 ms */
    need(stream_create(&b->stream, &size, 1000000, &err), &err);
    b->wake_fd = eventfd(0, EFD_CLOEXEC);
    assert_true(b->wake_fd >= 0);
    mover_create(&b->mover, b->rig->device, &b->stream);
}

static void close_bench(struct bench *b)
{
    stream_free(&b->stream);
    close(b->wake_fd);
    rig_close(b->rig);
}

static void ask(struct bench *b)
{
    struct command_result result;
    device_command(b->rig->device, 1, "SITE:POSE 1,0.1,0,0,0,0,0", b->rig->next, &result);
    assert_int_equal(result.effect, COMMAND_MOVE);
    mover_ask(&b->mover, &b->box, b->wake_fd);
}

static void a_thread_plans(void **state)
{
    (void)state;
    struct bench b;
    char reply[COMMAND_MAX_REPLY];
    eventfd_t n;
    open_bench(&b);
    ask(&b);
    assert_int_equal(eventfd_read(b.wake_fd, &n), 0); /* the reply is there */
    assert_true(mover_take(&b.mover, &b.box, reply));
    assert_string_equal(reply, "OK");
    assert_true(b.mover.running); /* the thread is there for the next one, and is waited for at the end */
    assert_false(mover_take(&b.mover, &b.box, reply));
    mover_join(&b.mover);
    close_bench(&b);
}

static void a_move_after_the_end_is_refused_at_once(void **state)
{
    (void)state;
    for (int had_thread = 0; had_thread < 2; had_thread++) {
        struct bench b;
        char reply[COMMAND_MAX_REPLY];
        eventfd_t n;
        open_bench(&b);
        if (had_thread) {
            ask(&b);
            assert_int_equal(eventfd_read(b.wake_fd, &n), 0);
            assert_true(mover_take(&b.mover, &b.box, reply));
        }
        mover_join(&b.mover);
        struct command_result result;
        device_command(b.rig->device, 1, "SITE:POSE 1,0.2,0,0,0,0,0", b.rig->next, &result);
        assert_int_equal(result.effect, COMMAND_MOVE);
        mover_ask(&b.mover, &b.box, b.wake_fd);
        assert_false(b.mover.running);
        assert_true(mover_take(&b.mover, &b.box, reply)); /* without waiting */
        assert_memory_equal(reply, "ERR -221,", 9);
        close_bench(&b);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_thread_plans),
        cmocka_unit_test(a_move_after_the_end_is_refused_at_once),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
