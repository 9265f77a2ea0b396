/* SPDX-License-Identifier: MIT */
/* Losses of a reader with the shortest queue that the configuration allows: two ticks. The error queue gets an entry
 * for each episode, and an episode ends when the reader has caught up. Each loss is announced to its reader, and
 * counted. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/loop/pump_inside.h"

static struct pump pump;
static struct stream stream;
static struct links links;
static struct device_counters counters;
static int n_reports;
static char reported[128];

static void report(void *self, int number, const char *text)
{
    (void)self;
    assert_int_equal(number, CMD_E_READER);
    snprintf(reported, sizeof reported, "%s", text);
    n_reports++;
}

static const struct loop_source_ops ops = {.report = report};
static const struct loop_source source = {&ops, NULL};

/* The session reads an empty tick whose next frame has this number. `behind` more ticks are released after it. */
static uint32_t read_tick(struct session *s, uint32_t first_seq, uint64_t behind)
{
    uint8_t frames[REPLY_ROOM];
    const struct ring_copy tick = {.buf = frames, .cap = sizeof frames, .first_seq = first_seq};
    s->cursor++;
    atomic_store(&stream.ring.released, s->cursor + behind);
    return session_check_lost(&pump, s, &tick, s->cursor + behind);
}

static int open_stream(void **state)
{
    (void)state;
    static const struct ring_size size = {.ahead_ticks = 2, .queue_ticks = 2, .spare_ticks = 1, .usual_bytes = 512};
    struct sh_err err;
    memset(&pump, 0, sizeof pump);
    memset(&stream, 0, sizeof stream);
    memset(&counters, 0, sizeof counters);
    n_reports = 0;
    stream.counters = &counters;
    links = (struct links){.stream = &stream, .source = &source};
    pump.links = &links;
    pump.stream = &stream;
    pump.protocol = protocol_ops_get(PROTOCOL_NATIVE);
    return stream_create(&stream, &size, 10000000, &err);
}

static int close_stream(void **state)
{
    (void)state;
    stream_free(&stream);
    return 0;
}

static void each_episode_is_reported_once(void **state)
{
    (void)state;
    struct session *s = &pump.session[0];
    assert_int_equal(read_tick(s, 100, 0), 0); /* the first one: nothing shows a loss */
    for (int episode = 1; episode <= 3; episode++) {
        const uint32_t at = 100 + 20 * (uint32_t)episode;
        assert_int_equal(read_tick(s, at - 10, 2), 10);
        assert_int_equal(read_tick(s, at, 2), 10);
        assert_int_equal(n_reports, episode);
        assert_int_equal(read_tick(s, at, 0), 0); /* it has caught up */
    }
    assert_int_equal(counters.reader_lost_frames, 60);
}

/* Reads a tick with one frame, of this number, and n_cast pulses after pulses_before. Returns how many frames were
 * lost. */
static uint32_t read_pulses(struct session *s, uint8_t *buf, uint32_t first_seq, uint64_t pulses_before,
                            uint64_t n_cast)
{
    static const struct native_event event = {.code = NATIVE_EV_PPS, .a = 77};
    struct ring_copy tick = {
        .buf = buf, .first_seq = first_seq, .n_frames = 1, .pulses_before = pulses_before, .n_cast = n_cast};
    tick.len = (uint32_t)native_encode_event(buf, 512, &event, 0, 0);
    const uint32_t lost = session_check_lost(&pump, s, &tick, atomic_load(&stream.ring.released));
    s->cursor++;
    return lost;
}

static size_t expect_loss(const uint8_t *frame, uint64_t frames, uint64_t pulses, uint64_t all, const char *text)
{
    struct native_header header;
    struct native_event event;
    native_read_header(frame, &header);
    assert_int_equal(header.type, NATIVE_EVENT);
    assert_true(header.flags == NATIVE_LOCAL && header.t_ns == 500 * INT64_C(10000000)); /* of the last released tick */
    assert_int_equal(native_decode_event(frame + NATIVE_HEADER_LEN, header.length, &event), SH_OK);
    assert_true(event.code == NATIVE_EV_READER_LOST && event.a == frames && event.b == pulses && event.c == all);
    assert_string_equal(event.text, text);
    return native_frame_len(frame);
}

/* The announcement goes before the frames of the tick that showed the loss. It has the lost frames and pulses, and all
 * frames that this session lost so far. */
static void a_loss_is_announced_and_counted(void **state)
{
    (void)state;
    struct session *s = &pump.session[1];
    static uint8_t buf[REPLY_ROOM];
    struct native_header header;
    s->id = 9;
    s->cursor = 100;
    s->came_at = 101; /* the first tick only prepares the session */
    strcpy(s->peer, "127.0.0.1:5");
    atomic_store(&stream.ring.released, 500);
    assert_int_equal(read_pulses(s, buf, 40, 1000, 10), 0);
    assert_true(pump.counts.received_pulses == 0 && s->out_len == 0);
    assert_int_equal(read_pulses(s, buf, 41, 1010, 10), 0); /* the next one */
    assert_true(pump.counts.received_pulses == 10 && n_reports == 0);
    assert_int_equal(read_pulses(s, buf, 49, 1090, 10), 7);
    const size_t len = expect_loss(buf, 7, 70, 7, "7 frames lost: the reader is too slow");
    assert_int_equal(s->out_len, len);
    native_read_header(buf + len, &header);
    assert_true(header.type == NATIVE_EVENT && (header.flags & NATIVE_LOCAL) == 0);
    assert_int_equal(read_pulses(s, buf, 53, 1130, 5), 3);
    expect_loss(buf, 3, 30, 10, "3 frames lost: the reader is too slow");
    assert_true(pump.counts.left_out_frames == 10 && pump.counts.left_out_pulses == 100);
    assert_true(counters.reader_lost_frames == 10 && counters.reader_lost_pulses == 100);
    assert_true(pump.counts.received_pulses == 25 && n_reports == 1);
    assert_string_equal(reported, "session 9, 127.0.0.1:5");
}

/* Units of another protocol count as frames in the statistics, once in an episode as an error. */
static void lost_units_are_counted(void **state)
{
    (void)state;
    session_count_units(&pump, &pump.session[0], 3);
    session_count_units(&pump, &pump.session[0], 4);
    assert_true(pump.counts.lost_units == 7 && counters.reader_lost_frames == 7 && n_reports == 1);
    assert_int_equal(pump.counts.left_out_frames, 0);
}

/* A part of this program loses frames, such as the page's observer. The head's clients miss nothing. So the loss is in
 * the counts of the link, and the reader is told of it, but neither the head's sums nor its errors have it. */
static void own_losses_are_no_clients(void **state)
{
    (void)state;
    struct session *s = &pump.session[1];
    static uint8_t buf[REPLY_ROOM];
    pump.is_own = 1;
    atomic_store(&stream.ring.released, 500);
    assert_int_equal(read_pulses(s, buf, 40, 1000, 10), 0);
    assert_int_equal(read_pulses(s, buf, 48, 1080, 10), 7);
    expect_loss(buf, 7, 70, 7, "7 frames lost: the reader is too slow");
    session_count_units(&pump, s, 3);
    assert_true(pump.counts.left_out_frames == 7 && pump.counts.left_out_pulses == 70 && pump.counts.lost_units == 3);
    assert_true(counters.reader_lost_frames == 0 && counters.reader_lost_pulses == 0 && n_reports == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(each_episode_is_reported_once, open_stream, close_stream),
        cmocka_unit_test_setup_teardown(a_loss_is_announced_and_counted, open_stream, close_stream),
        cmocka_unit_test_setup_teardown(lost_units_are_counted, open_stream, close_stream),
        cmocka_unit_test_setup_teardown(own_losses_are_no_clients, open_stream, close_stream),
    };
    return cmocka_run_group_tests_name("lost frames", tests, NULL, NULL);
}
