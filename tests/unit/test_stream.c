/* SPDX-License-Identifier: MIT */
/* The stream at release: numbers of frames, counts of echoes in line ends, and readers that are waited for. */
#include "tests/common/cases.h"

#include <poll.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/loop/stream.h"

static const struct ring_size SIZE = {.ahead_ticks = 4, .queue_ticks = 3, .spare_ticks = 2, .usual_bytes = 512};
static struct device_counters counters;
static struct stream stream;

static int open_stream(void **state)
{
    (void)state;
    struct sh_err err;
    memset(&stream, 0, sizeof stream);
    memset(&counters, 0, sizeof counters);
    stream.counters = &counters;
    return stream_create(&stream, &SIZE, 1000000, &err);
}

static int close_stream(void **state)
{
    (void)state;
    stream_free(&stream);
    return 0;
}

/* Makes a tick of n_events events and, unless before < 0, a line end. So many echoes come before the line end, and
 * `tail` echoes after it. */
static struct ring_slot *make_tick(uint64_t tick, int n_events, int before, uint32_t tail)
{
    static const struct native_event event = {.code = NATIVE_EV_PPS, .text = "text"};
    uint8_t bytes[512];
    struct ring_mark mark = {.before.echoes = (uint32_t)before, .end = {.n_fired = 9, .n_cast = 9}};
    struct ring_tick made = {.bytes = bytes, .mark = &mark, .tail.echoes = tail};
    struct ring_slot *slot = ring_claim(&stream.ring, tick);
    assert_non_null(slot);
    for (int i = 0; i < n_events; i++)
        made.len += (uint32_t)native_encode_event(bytes + made.len, sizeof bytes - made.len, &event, 0, 0);
    if (before >= 0) {
        mark.frame_at = made.len;
        made.n_marks = 1;
        made.len += (uint32_t)native_encode_line_end(bytes + made.len, sizeof bytes - made.len, &mark.end, 0);
    }
    made.hits.echoes = (uint32_t)(before > 0 ? before : 0) + tail;
    made.hits.empty = 2 * made.hits.echoes;
    made.n_lines = made.n_marks;
    assert_int_equal(ring_put(slot, &made), SH_OK);
    return slot;
}

static void release(struct ring_slot *slot, uint64_t tick)
{
    assert_true(ring_ready(slot, tick));
    stream_release(&stream, slot, tick, 5);
}

/* Returns the echoes of the only line end of a tick. The tick's frames have the numbers from first_seq on. */
static uint32_t read_echoes(uint64_t tick, uint32_t first_seq, uint32_t n_frames)
{
    uint8_t bytes[512];
    struct ring_copy copy = {.buf = bytes, .cap = sizeof bytes};
    struct line_end end = {.n_echoes = UINT32_MAX};
    assert_int_equal(ring_read(&stream.ring, 0, tick, &copy), RING_READ);
    assert_true(copy.first_seq == first_seq && copy.n_frames == n_frames);
    for (uint32_t at = 0, i = 0; at < copy.len; i++) {
        uint32_t len = bytes[at + 4] | (uint32_t)bytes[at + 5] << 8, seq;
        memcpy(&seq, bytes + at + 8, sizeof seq);
        assert_int_equal(seq, first_seq + i);
        if (bytes[at + 1] == NATIVE_LINE_END)
            assert_int_equal(native_decode_line_end(bytes + at + NATIVE_HEADER_LEN, len, &end), 0);
        at += NATIVE_HEADER_LEN + len;
    }
    return end.n_echoes;
}

static void a_line_has_the_echoes_of_all_its_ticks(void **state)
{
    (void)state;
    release(make_tick(0, 2, -1, 5), 0);
    release(make_tick(1, 0, -1, 4), 1); /* no frame */
    release(make_tick(2, 1, 7, 2), 2);
    assert_int_equal(read_echoes(0, 0, 2), UINT32_MAX);
    assert_int_equal(read_echoes(1, 2, 0), UINT32_MAX);
    assert_int_equal(read_echoes(2, 2, 2), 5 + 4 + 7);
    release(make_tick(3, 0, 1, 0), 3);
    assert_int_equal(read_echoes(3, 4, 1), 2 + 1);
    assert_int_equal(counters.echoes, 5 + 4 + 7 + 2 + 1);
    assert_int_equal(counters.empty, 2 * counters.echoes);
    assert_int_equal(counters.lines, 2);
}

/* The pacing thread gave it up, or there was no memory for it. */
static void a_line_that_lacks_a_tick_has_no_count(void **state)
{
    (void)state;
    for (int lost = 0; lost < 2; lost++) {
        uint64_t tick = lost ? 4 : 0;
        uint32_t seq = stream.seq;
        release(make_tick(tick, 0, -1, 5), tick);
        if (lost) {
            assert_true(stream_lose(&stream, tick + 1));
        } else {
            struct ring_slot *slot = ring_claim(&stream.ring, tick + 1);
            slot->tick.broken = 1;
            release(slot, tick + 1);
            assert_int_equal(read_echoes(tick + 1, seq, 0), UINT32_MAX);
        }
        release(make_tick(tick + 2, 0, 7, 2), tick + 2);
        assert_int_equal(read_echoes(tick + 2, seq, 1), 0);
        release(make_tick(tick + 3, 0, 1, 0), tick + 3); /* the next line is whole */
        assert_int_equal(read_echoes(tick + 3, seq + 1, 1), 2 + 1);
    }
}

/* Power goes with tick 2 and comes back with tick 3. The lines before have no end; what they lacked, and their echoes,
 * are none of the next line's. */
static void a_power_cycle_leaves_nothing_to_the_next_line(void **state)
{
    (void)state;
    stream_power(&stream, 2);
    stream_power(&stream, 3);
    release(make_tick(0, 0, -1, 5), 0);
    assert_true(stream_lose(&stream, 1));
    release(make_tick(2, 1, -1, 0), 2);
    release(make_tick(3, 0, 7, 2), 3);
    assert_int_equal(read_echoes(3, 1, 1), 7);
    release(make_tick(4, 0, 1, 0), 4);
    assert_int_equal(read_echoes(4, 2, 1), 2 + 1);
}

/* Makes a tick of a scan with n_cast pulses, then telemetry and the scan's end where `cast` is not 0. `cast` pulses
 * were to be cast in the whole scan. */
static struct ring_slot *make_pulses(uint64_t tick, uint32_t scan, uint64_t n_cast, uint64_t cast)
{
    uint8_t bytes[512];
    struct ring_tick made = {.bytes = bytes, .scan = scan, .n_cast = n_cast};
    struct native_telemetry t = {.scan = scan, .scan_cast = cast, .scan_lost = cast, .lost_pulses = 1000 + cast};
    struct native_event end = {.code = NATIVE_EV_SCAN_END, .a = scan, .b = 99, .c = cast};
    struct ring_slot *slot = ring_claim(&stream.ring, tick);
    assert_non_null(slot);
    if (cast != 0) {
        made.len = (uint32_t)native_encode_telemetry(bytes, sizeof bytes, &t, 7, 0);
        made.len += (uint32_t)native_encode_event(bytes + made.len, sizeof bytes - made.len, &end, 7, 0);
    }
    assert_int_equal(ring_put(slot, &made), SH_OK);
    return slot;
}

static void read_end(uint64_t tick, struct native_telemetry *t, struct native_event *end)
{
    static struct native_parser parser;
    size_t room;
    native_parser_init(&parser);
    struct ring_copy copy = {.buf = native_parser_room(&parser, &room), .cap = 512};
    assert_int_equal(ring_read(&stream.ring, 0, tick, &copy), RING_READ);
    native_parser_added(&parser, copy.len);
    assert_int_equal(native_parser_next(&parser), NATIVE_FRAME); /* its CRC is right */
    assert_int_equal(native_decode_telemetry(parser.payload, parser.header.length, t), SH_OK);
    assert_int_equal(native_parser_next(&parser), NATIVE_FRAME);
    assert_int_equal(native_decode_event(parser.payload, parser.header.length, end), SH_OK);
}

/* A scan has 10 + 20 + 30 + 40 pulses. A tick before the last one is lost after the last one was made. */
static void a_scan_end_counts_what_was_lost_after_it_was_made(void **state)
{
    (void)state;
    struct native_telemetry t;
    struct native_event end;
    atomic_store(&counters.pulses, 1000); /* of scans before */
    release(make_pulses(0, 3, 10, 0), 0);
    release(make_pulses(1, 3, 20, 0), 1);
    struct ring_slot *last = make_pulses(3, 3, 40, 100);
    assert_true(stream_lose(&stream, 2));
    release(last, 3);
    read_end(3, &t, &end);
    assert_true(end.a == 3 && end.b == 99 && end.c == 30);
    assert_true(t.scan_cast == 100 && t.scan_lost == 30 && t.pulses == 1070 && t.lost_pulses == 30);
    struct ring_copy copy = {.buf = NULL};
    assert_int_equal(ring_read(&stream.ring, 0, 3, &copy), RING_READ);
    assert_true(copy.pulses_before == 1030 && copy.n_cast == 40);
}

/* The tick of a scan's end was lost, too. The end comes in a tick of the next scan, whose pulses do not count for
 * it. */
static void a_scan_end_that_comes_late_counts_its_own_scan(void **state)
{
    (void)state;
    struct native_telemetry t;
    struct native_event end;
    release(make_pulses(0, 3, 10, 0), 0);
    release(make_pulses(1, 4, 500, 0), 1);
    release(make_pulses(2, 3, 0, 25), 2);
    read_end(2, &t, &end);
    assert_true(end.c == 15 && t.scan_lost == 15);
}

static void active_readers_hold_back(void **state)
{
    (void)state;
    stream.waits = 1;
    assert_true(stream_has_room(&stream, 100)); /* there is no reader */
    stream_set_reader(&stream, STREAM_HASH_READER, 10, 1);
    assert_true(stream_has_room(&stream, 11)); /* 10, 11 and 12 would fill the queue of 3 */
    assert_false(stream_has_room(&stream, 12));
    stream_move_reader(&stream, STREAM_HASH_READER, 11);
    assert_true(stream_has_room(&stream, 12));
    stream_set_reader(&stream, STREAM_HASH_READER, 11, 0);
    assert_true(stream_has_room(&stream, 100));
}

static void grants_add_up(void **state)
{
    (void)state;
    assert_int_equal(stream_grant(&stream, 1500000), 1500000);
    assert_int_equal(stream_pass(&stream, 1500000), 1);
    assert_int_equal(stream_grant(&stream, 600000), 2100000);
    assert_int_equal(stream_pass(&stream, 2100000), 2);
    assert_int_equal(stream.granted, 2);
}

/* Grants of two sessions may be passed on in any order, and so may one after the run's end, which lets all time pass.
 */
static void time_that_may_pass_is_not_taken_back(void **state)
{
    (void)state;
    assert_int_equal(stream_pass(&stream, 9000000), 9);
    assert_int_equal(stream_pass(&stream, 2000000), 2);
    assert_int_equal(stream.granted, 9);
    atomic_store(&stream.granted, UINT64_MAX);
    assert_int_equal(stream_pass(&stream, 10000000), 10);
    assert_true(atomic_load(&stream.granted) == UINT64_MAX);
}

/* Other readers rest, and commands come, again and again. Each of these wakes the pacing thread. */
static void a_reader_that_stands_still_delays_the_end_for_a_limited_time(void **state)
{
    (void)state;
    const int64_t begin_ns = clock_now_ns();
    stream.waits = 1;
    atomic_store(&stream.ending, 1);
    stream_set_reader(&stream, 0, 10, 1);
    while (!stream_has_room(&stream, 12) && clock_now_ns() - begin_ns < 20000000000) {
        stream_poke(&stream);
        stream_wait_for_readers(&stream, 12);
        poll(NULL, 0, 10);
    }
    assert_true(stream_has_room(&stream, 12));
    assert_true(clock_now_ns() - begin_ns >= 2000000000); /* it has that time, as stream.h says */
}

/* Before the pacing thread sleeps, those that wait for what was released are woken, though it is less than a batch. */
static void the_pacing_thread_tells_all_before_it_sleeps(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        int value;
        eventfd_t count;
        close_stream(NULL);
        open_stream(NULL);
        stream.waits = 1;
        stream.say_ticks = 100;
        stream.n_casters = 1;
        const int fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
        stream_listen(&stream, fd, 1);
        release(make_tick(0, 1, -1, 0), 0);
        assert_int_equal(eventfd_read(fd, &count), -1);
        assert_true(sem_getvalue(&stream.work.signals, &value) == 0 && value == 0);
        stream_say_ready(&stream); /* it does not sleep in this test */
        if (i == 0) stream_wait_for_casters(&stream);
        if (i == 1) stream_wait_for_readers(&stream, 1);
        if (i == 2) stream_wait_for_files(&stream);
        assert_int_equal(eventfd_read(fd, &count), 0);
        assert_true(sem_getvalue(&stream.work.signals, &value) == 0 && value == 1);
        close(fd);
    }
}

/* ---- who is woken in real time */

enum { LISTENERS = 3, POWER_TICK = 57, END_TICK = 100 };

/* For each listener, and for casters (the last one): the first tick that it wants and was not woken for. */
struct due {
    uint64_t from[LISTENERS + 1];
};

static void open_listeners(uint64_t *seed)
{
    stream.say_ticks = (uint64_t)case_between(seed, 1, 12);
    stream.n_casters = 1;
    for (int i = 0; i < LISTENERS; i++)
        stream_listen(&stream, eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK), (uint64_t)case_between(seed, 1, 10));
    stream_power(&stream, POWER_TICK);
}

static void change_listeners(uint64_t *seed, uint64_t tick)
{
    for (int i = 0; i < LISTENERS; i++) {
        if (case_between(seed, 0, 3) != 0) continue;
        const uint64_t wake = tick + (uint64_t)case_between(seed, 0, 15);
        stream_wake_at(&stream, &stream.listener[i], case_between(seed, 0, 4) == 0,
                       case_between(seed, 0, 1) == 0 ? UINT64_MAX : wake);
    }
}

static void release_noting(uint64_t tick, int frames, struct due *due)
{
    eventfd_t count;
    release(make_tick(tick, frames, -1, 0), tick);
    for (int i = 0; i < LISTENERS; i++) {
        const struct stream_listener *l = &stream.listener[i];
        const int wants = (frames && l->wants_frames) || l->wake_tick <= tick || tick == POWER_TICK;
        if (wants && due->from[i] == UINT64_MAX) due->from[i] = tick;
        if (eventfd_read(l->fd, &count) == 0) due->from[i] = UINT64_MAX;
    }
    if (due->from[LISTENERS] == UINT64_MAX) due->from[LISTENERS] = tick;
    while (sem_trywait(&stream.work.signals) == 0)
        due->from[LISTENERS] = UINT64_MAX;
}

/* Ticks that are released together wait for the last one of them. From the first tick that it wants, no listener then
 * waits longer than `every` ticks, and no caster longer than say_ticks. */
static void nobody_is_woken_too_late(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed < 400; seed += 2) {
        uint64_t rng = seed;
        struct due due;
        memset(&due, 0xff, sizeof due);
        close_stream(NULL);
        open_stream(NULL);
        open_listeners(&rng);
        for (uint64_t tick = 0, next; tick < END_TICK; tick = next + 1) {
            change_listeners(&rng, tick);
            next = stream_next_wake(&stream, tick);
            for (uint64_t t = tick; t <= next; t++) {
                release_noting(t, (int)case_between(&rng, 0, 1), &due);
                for (int i = 0; i <= LISTENERS; i++) {
                    const uint64_t most = i < LISTENERS ? stream.listener[i].every : stream.say_ticks;
                    assert_true(due.from[i] == UINT64_MAX || next < due.from[i] + most);
                }
            }
        }
        for (int i = 0; i < LISTENERS; i++)
            close(stream.listener[i].fd);
    }
}

int main(void)
{
#define WITH_STREAM(test) cmocka_unit_test_setup_teardown(test, open_stream, close_stream)
    const struct CMUnitTest tests[] = {
        WITH_STREAM(a_line_has_the_echoes_of_all_its_ticks),
        WITH_STREAM(a_line_that_lacks_a_tick_has_no_count),
        WITH_STREAM(a_power_cycle_leaves_nothing_to_the_next_line),
        WITH_STREAM(a_scan_end_counts_what_was_lost_after_it_was_made),
        WITH_STREAM(a_scan_end_that_comes_late_counts_its_own_scan),
        WITH_STREAM(active_readers_hold_back),
        WITH_STREAM(grants_add_up),
        WITH_STREAM(time_that_may_pass_is_not_taken_back),
        WITH_STREAM(a_reader_that_stands_still_delays_the_end_for_a_limited_time),
        WITH_STREAM(the_pacing_thread_tells_all_before_it_sleeps),
        WITH_STREAM(nobody_is_woken_too_late),
    };
    return cmocka_run_group_tests_name("stream", tests, NULL, NULL);
}
