/* SPDX-License-Identifier: MIT */
/* The thread that plans a station's new place. While the run ends, links still take commands: a move that comes then is
 * refused, and no thread is left that nobody waits for. After a move the head's plan is that of the new place. */
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

/* Does all that the mover's thread does, without a thread. */
static void move_now(struct rig *rig, const char *line)
{
    struct command_result result;
    device_command(rig->device, 1, line, rig->next, &result);
    assert_int_equal(result.effect, COMMAND_MOVE);
    device_plan_move(rig->device);
    device_finish_move(rig->device, rig->next, &result);
    assert_string_equal(result.reply, "OK");
}

/* A plane that touches the Earth leaves it by r^2 / 2R: 0.02 mm at 16 m, and 0.8 mm at 100 m. So georeferencing by a
 * plane is within 0.3 mm for corners up to 15 m away. From a place 90 m farther it is not. SYSTem:PLAN? reports the
 * plan at the present place. A change of the plan stands once in the journal, before its command. */
static void the_plan_is_that_of_the_present_place(void **state)
{
    (void)state;
    static const char *const sets[] = {"output.crs=utm",
                                       "output.layout=geo",
                                       "output.tolerance_m=0.0003",
                                       "scene.anchor.source=explicit",
                                       "scene.anchor.lat_deg=47",
                                       "scene.anchor.lon_deg=8",
                                       "scene.anchor.height_m=400"};
    static const char *const order[] = {"georef order1\n", "# plan: ", "georef order2\n", " SITE:POSE 1, 90,",
                                        " SITE:POSE 1, 91,"};
    char text[4096] = "";
    struct rig *rig = rig_open(&(struct device_options){.journal = journal_path}, sets, 7);
    rig_go_to(rig, 300); /* it boots for 200 ms */
    assert_non_null(strstr(rig_tell(rig, "SYSTem:PLAN?", rig->next), "georef order1"));
    move_now(rig, "SITE:POSE 1, 90,0,0,0,0,0");
    assert_non_null(strstr(rig_tell(rig, "SYSTem:PLAN?", rig->next), "georef order2"));
    move_now(rig, "SITE:POSE 1, 91,0,0,0,0,0");
    rig_close(rig);
    FILE *in = fopen(journal_path, "r");
    assert_non_null(in);
    text[fread(text, 1, sizeof text - 1, in)] = '\0';
    fclose(in);
    const char *at = strstr(text, "# plan: ");
    for (size_t i = 0; i < sizeof order / sizeof order[0]; i++) {
        if (at == NULL || (at = strstr(at, order[i])) == NULL)
            fail_msg("%s is not in its place in:\n%s", order[i], text);
        at++;
    }
    assert_null(strstr(strstr(text, "order2"), "# plan: "));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_thread_plans),
        cmocka_unit_test(a_move_after_the_end_is_refused_at_once),
        cmocka_unit_test(the_plan_is_that_of_the_present_place),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
