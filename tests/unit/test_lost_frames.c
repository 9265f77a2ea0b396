/* SPDX-License-Identifier: MIT */
/* Losses of a reader with the shortest queue that the configuration allows: two ticks. The error queue gets an entry for
 * each episode, and an episode ends when the reader has caught up. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/loop/pump_inside.h"

static struct pump pump;
static struct stream stream;
static struct links links;
static struct device_counters counters;
static int n_reports;

static void report(void *self, int number, const char *text)
{
    (void)self, (void)text;
    assert_int_equal(number, CMD_E_READER);
    n_reports++;
}

static const struct loop_source_ops ops = {.report = report};
static const struct loop_source source = {&ops, NULL};

/* The session reads an empty tick whose next frame has this number, when so many ticks are released after it. */
static uint32_t read_tick(struct session *s, uint32_t first_seq, uint64_t behind)
{
    uint8_t frames[REPLY_ROOM];
    const struct ring_copy tick = {.buf = frames, .cap = sizeof frames, .first_seq = first_seq};
    s->cursor++;
    atomic_store(&stream.ring.released, s->cursor + behind);
    return session_check_lost(&pump, s, &tick, s->cursor + behind);
}

static void each_episode_is_reported_once(void **state)
{
    (void)state;
    static const struct ring_size size = {.ahead_ticks = 2, .queue_ticks = 2, .spare_ticks = 1, .usual_bytes = 512};
    struct sh_err err;
    struct session *s = &pump.session[0];
    stream.counters = &counters;
    assert_int_equal(stream_create(&stream, &size, 10000000, &err), SH_OK);
    links = (struct links){.stream = &stream, .source = &source};
    pump.links = &links;
    pump.stream = &stream;
    pump.protocol = protocol_ops_get(PROTOCOL_NATIVE);
    assert_int_equal(read_tick(s, 100, 0), 0); /* the first one: nothing shows a loss */
    for (int episode = 1; episode <= 3; episode++) {
        const uint32_t at = 100 + 20 * (uint32_t)episode;
        assert_int_equal(read_tick(s, at - 10, 2), 10);
        assert_int_equal(read_tick(s, at, 2), 10);
        assert_int_equal(n_reports, episode);
        assert_int_equal(read_tick(s, at, 0), 0); /* it has caught up */
    }
    assert_int_equal(counters.reader_lost_frames, 60);
    stream_free(&stream);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(each_episode_is_reported_once)};
    return cmocka_run_group_tests_name("lost frames", tests, NULL, NULL);
}
