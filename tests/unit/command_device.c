/* SPDX-License-Identifier: MIT */
#include "tests/unit/command_device.h"

static const struct command_place first_places[3] = {{{1, 2, 3, 0, 0, 0}}, {{4, 5, 6, 0, 0, 0}}, {{7, 8, 9, 0, 0, 0}}};
static const struct command_place places[3] = {
    {{1, 2, 3, 0, 0, 0}}, {{-0.1, 5e-7, 1e9, 359.5, -90, 1.0 / 3.0}}, {{7, 8, 9, 0, 0, 0}}};

/* Faults of a head that was given two and still has one. */
static int add_fault(void *owner, const char *text, uint32_t *number, char *why, size_t len)
{
    (void)owner;
    *number = 3;
    if (strcmp(text, "{kind: drop}") == 0) return 0;
    snprintf(why, len, "fault:1: faults[0]: unknown");
    return -1;
}

static uint32_t remove_fault(void *owner, uint32_t number)
{
    (void)owner;
    return number <= 1;
}

static int count_injected(void *owner, uint32_t number, uint64_t *n)
{
    (void)owner;
    *n = 40 + number;
    return number <= 2 ? 0 : -1;
}

static void list_faults(void *owner, char *text, size_t len)
{
    (void)owner;
    snprintf(text, len, "1 drop");
}

static const struct command_faults faults = {add_fault, remove_fault, count_injected, list_faults};

struct command_device command_test_device(void)
{
    struct command_device dev = {
        .idn = "Maker,Model,Serial,1.0",
        .limits = {.prr_min_uhz = 1000 * MICRO,
                   .prr_max_uhz = 1200000 * MICRO,
                   .lines_min_uhz = 1 * MICRO,
                   .lines_max_uhz = 2000 * MICRO,
                   .pan_max_udeg_s = 60 * MICRO,
                   .fov_min_udeg = -40 * MICRO,
                   .fov_max_udeg = 60 * MICRO,
                   .pan_min_udeg = -180 * MICRO,
                   .pan_max_udeg = 360 * MICRO,
                   .n_stations = 3,
                   .sweep_udeg = 360 * MICRO,
                   .range_min_nm = 500 * MICRO,
                   .range_max_nm = 800 * NANO,
                   .near_most_nm = 250 * NANO,
                   .far_least_nm = 2 * NANO,
                   .noise_most = 1,
                   .angle_most = 1,
                   .ball_max_nm = 100 * NANO},
        .settings = {.prr_uhz = 300000 * MICRO,
                     .lines_uhz = 100 * MICRO,
                     .pan_udeg_s = 18 * MICRO,
                     .line_start_udeg = -30 * MICRO,
                     .line_stop_udeg = 50 * MICRO,
                     .pan_start_udeg = 0,
                     .pan_stop_udeg = 180 * MICRO,
                     .frames = 1,
                     .station = 1,
                     .range_min_nm = NANO,
                     .range_max_nm = 400 * NANO,
                     .sigma_nm = 5 * MICRO},
        .replay = {.is_there = 1, .speed = 1},
        .state = HEAD_IDLE,
        .frames_done = 7,
        .t_ns = INT64_C(1234567890123),
        .utc = "2026-01-01T00:20:34.567890123Z",
        .gps = "2399,346852.567890123",
        .ptp = "SLAVE,s2,-12,850,00b0ae.fffe.000001,6,0x21,1",
    };
    dev.place = places;
    dev.first_place = first_places;
    dev.defaults = dev.settings;
    dev.faults = &faults;
    return dev;
}

struct command_result result;

const char *say(struct command_device *dev, uint32_t session, const char *line)
{
    command_execute(dev, session, line, &result);
    return result.reply;
}

void expect(struct command_device *dev, const char *line, const char *reply)
{
    const char *got = say(dev, 1, line);
    if (strcmp(got, reply) != 0) fail_msg("'%s' gives '%s', not '%s'", line, got, reply);
}

void expect_error(struct command_device *dev, uint32_t session, const char *line, int number, const char *part)
{
    const struct head_settings before = dev->settings;
    const uint32_t control = dev->control;
    char popped[COMMAND_MAX_REPLY], expected[COMMAND_MAX_REPLY + 8];
    memset(&dev->queue, 0, sizeof dev->queue);
    say(dev, session, line);
    if (result.error != number || strstr(result.reply, part) == NULL)
        fail_msg("'%s' gives '%s', not %d with '%s'", line, result.reply, number, part);
    assert_int_equal(dev->queue.count, 1);
    command_queue_pop(&dev->queue, popped, sizeof popped);
    snprintf(expected, sizeof expected, "ERR %s", popped);
    assert_string_equal(result.reply, expected);
    assert_int_equal(atoi(popped), number);
    assert_int_equal(result.effect, COMMAND_NONE);
    assert_false(result.changes || result.took_control);
    assert_int_equal(dev->control, control);
    assert_memory_equal(&before, &dev->settings, sizeof before);
}
