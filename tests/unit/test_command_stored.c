/* SPDX-License-Identifier: MIT */
/* A head keeps its settings as lines, which are carried out again in whatever order they stand. */
#include "firmware_sim/command/stored.h"
#include "tests/unit/command_device.h"

static char done[512]; /* lines that were carried out, each with its '\n' */

static void note(void *ctx, const char *line)
{
    assert_ptr_equal(ctx, done);
    const size_t used = strlen(done);
    snprintf(done + used, sizeof done - used, "%s\n", line);
}

static char why[400];

static int apply(struct command_device *dev, const char *text)
{
    done[0] = why[0] = '\0';
    return command_stored_apply(dev, text, note, done, why, sizeof why);
}

/* Each setting that differs from the configuration's has its line, but for station, frames and steps. */
static void what_differs_is_stored(void **state)
{
    (void)state;
    struct command_device dev = command_test_device();
    const struct head_settings configured = dev.settings;
    static const char want[] =
        "HEAD:PRR 200000\nHEAD:LINes 50.5\nHEAD:RANGe:MIN 2.5\nHEAD:NOISe ON\nSCAN:LINE:STOP 40\n"
        "SCAN:ECHoes LAST\nTIME:SERVer CLIENT,1.2.3.4,60,-2,CAN\n";
    char text[512], none[8];
    assert_int_equal(command_stored_text(&dev, &configured, none, 1), 0);
    assert_string_equal(none, "");
    dev.settings.prr_uhz = 200000 * MICRO;
    dev.settings.lines_uhz = 50500000;
    dev.settings.range_min_nm = 2500000000;
    dev.settings.noise = 1;
    dev.settings.line_stop_udeg = 40 * MICRO;
    dev.settings.echoes = 2;
    dev.settings.frames = 7;
    dev.settings.station = 2;
    dev.server = (struct command_time_server){1, 1, {1, 2, 3, 4}, 60, -2, 5};
    const struct head_settings now = dev.settings;
    const struct command_time_server server = dev.server;
    assert_int_equal(command_stored_text(&dev, &configured, text, sizeof text), 0);
    assert_string_equal(text, want);
    assert_memory_equal(&dev.settings, &now, sizeof now);
    assert_memory_equal(&dev.server, &server, sizeof server);
    assert_int_equal(dev.queue.count, 0);
    assert_int_equal(command_stored_text(&dev, &configured, text, sizeof want), 0);
    assert_string_equal(text, want);
    assert_int_equal(command_stored_text(&dev, &configured, text, sizeof want - 1), -1);
}

/* A step is stored where it is a setting of its own, as on a sphere. */
static void a_sphere_keeps_its_step(void **state)
{
    (void)state;
    struct command_device dev = command_test_device();
    char text[128];
    dev.limits.emitter = EMITTER_SPHERE;
    dev.limits.line_pulses = 360;
    dev.settings.step_udeg = MICRO;
    const struct head_settings configured = dev.settings;
    dev.settings.step_udeg = 2 * MICRO;
    assert_int_equal(command_stored_text(&dev, &configured, text, sizeof text), 0);
    assert_non_null(strstr(text, "SCAN:STEP 2\n"));
}

static void lines_are_carried_out_in_an_order_that_works(void **state)
{
    (void)state;
    struct command_device dev = command_test_device();
    const struct head_settings before = dev.settings;
    /* SCAN:LINE:STOP comes first, and is below the present start, -30. The pulse rate is set already. */
    assert_int_equal(apply(&dev, "SCAN:LINE:STOP -35\nSCAN:LINE:STARt -38\nHEAD:PRR 300000\nHEAD:LIN 50\n"), 0);
    assert_string_equal(done, "SCAN:LINE:STARt -38\nHEAD:LIN 50\nSCAN:LINE:STOP -35\n");
    assert_memory_equal(&dev.settings, &before, sizeof before); /* lines only go to note() here */
    assert_int_equal(dev.queue.count, 0);
    assert_int_equal(apply(&dev, ""), 0);
    assert_string_equal(done, "");
    assert_int_equal(apply(&dev, "HEAD:PAN 5"), 0); /* without its end of line */
    assert_string_equal(done, "HEAD:PAN 5\n");
}

static void lines_that_can_not_be_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *text, *why;
    } cases[] = {
        {"HEAD:PAN 5\nHEAD:PRR 5\n",
         "'HEAD:PRR 5' is refused: ERR -222,\"Data out of range; HEAD:PRR 5 Hz, allowed 1000 to 1200000\""},
        {"HEAD:STATION 2\n", "'HEAD:STATION 2' is no setting that this head stores"},
        {"SCAN:FRAM 2\n", "'SCAN:FRAM 2' is no setting that this head stores"},
        {"SCAN:STEP 1\n", "'SCAN:STEP 1' is no setting that this head stores"},
        {"SCAN:STAR\n", "'SCAN:STAR' is no setting that this head stores"},
        {"HEAD:XYZ 5\n", "'HEAD:XYZ 5' is no setting that this head stores"},
        {"\n", "'' is no setting that this head stores"},
    };
    struct command_device dev = command_test_device();
    for (size_t i = 0; i < N_OF(cases); i++) {
        assert_int_equal(apply(&dev, cases[i].text), -1);
        assert_string_equal(why, cases[i].why);
    }
}

/* The text may have 32 lines of 256 bytes. */
static void there_is_room_for_32_lines(void **state)
{
    (void)state;
    static char text[40 * (COMMAND_MAX_LINE + 2)];
    struct command_device dev = command_test_device();
    for (int lines = 32; lines <= 33; lines++) {
        text[0] = '\0';
        for (int i = 0; i < lines; i++)
            sprintf(text + strlen(text), "HEAD:PAN %d\n", 1 + i % 2);
        assert_int_equal(apply(&dev, text), lines == 32 ? 0 : -1);
        if (lines > 32) assert_string_equal(why, "allowed are 32 lines of up to 256 bytes");
    }
    for (int len = COMMAND_MAX_LINE; len <= COMMAND_MAX_LINE + 1; len++) {
        snprintf(text, sizeof text, "HEAD:PAN %0*d\n", len - 9, 7);
        assert_int_equal(apply(&dev, text), len == COMMAND_MAX_LINE ? 0 : -1);
        if (len > COMMAND_MAX_LINE) assert_string_equal(why, "allowed are 32 lines of up to 256 bytes");
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_differs_is_stored),
        cmocka_unit_test(a_sphere_keeps_its_step),
        cmocka_unit_test(lines_are_carried_out_in_an_order_that_works),
        cmocka_unit_test(lines_that_can_not_be_are_refused),
        cmocka_unit_test(there_is_room_for_32_lines),
    };
    return cmocka_run_group_tests_name("stored settings", tests, NULL, NULL);
}
