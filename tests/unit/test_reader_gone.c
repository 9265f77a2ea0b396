/* SPDX-License-Identifier: MIT */
/* Sessions whose next tick the ring no longer has, and sessions that end: where they go on, and what counts as lost.
 * Each tick has a frame of 100 pulses, numbered from 10 on, unless a test says otherwise. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/loop/pump_inside.h"

enum { QUEUE = 8, RELEASED = 20, OLDEST = RELEASED - QUEUE, FIRST_SEQ = 10, PULSES = 100 };

static struct pump pump;
static struct stream stream;
static struct links links;
static struct device_counters counters;
static int n_reports;
static uint8_t out[4096];
static struct session *const s = &pump.session[1];

static void report(void *self, int number, const char *text)
{
    (void)self;
    (void)text;
    assert_int_equal(number, CMD_E_READER);
    n_reports++;
}

static int64_t no_time(void *owner)
{
    (void)owner;
    return 0;
}

static const struct loop_source_ops ops = {.report = report};
static const struct loop_source source = {&ops, NULL};

static int open_stream(void **state)
{
    (void)state;
    static const struct ring_size size = {.ahead_ticks = 2, .queue_ticks = QUEUE, .spare_ticks = 1, .usual_bytes = 64};
    static const struct link_spec null_link = {.type = LINK_NULL};
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
    s->reader = 1;
    s->out = out;
    const struct faulty_spec faults = {.protocol = pump.protocol, .time_ns = no_time};
    if (faulty_open(&faults, &null_link, &pump.link, &err) != SH_OK) return -1;
    return stream_create(&stream, &size, 10000000, &err);
}

static int close_stream(void **state)
{
    (void)state;
    faulty_ops(pump.link)->close(pump.link);
    stream_free(&stream);
    return 0;
}

static void release(uint32_t first_seq, uint32_t n_frames, uint64_t pulses_before)
{
    const uint64_t tick = stream_released(&stream);
    struct ring_slot *slot = ring_claim(&stream.ring, tick);
    assert_non_null(slot);
    ring_begin(slot);
    slot->tick.n_cast = n_frames * (uint64_t)PULSES;
    assert_int_equal(ring_end(slot), SH_OK);
    assert_int_equal(ring_ready(slot, tick), 1);
    assert_ptr_equal(ring_peek(&stream.ring, tick), slot);
    slot->first_seq = first_seq;
    slot->n_frames = n_frames;
    slot->pulses_before = pulses_before;
    ring_release(&stream.ring, tick);
}

/* Releases ticks until there are RELEASED. Of these, the head itself lost those from `lost` up to `until`: they have no
 * frames and no numbers. */
static void release_all(uint64_t lost, uint64_t until)
{
    uint32_t n = 0;
    for (uint64_t tick = 0; tick < RELEASED; tick++) {
        if (tick >= lost && tick < until) {
            assert_int_equal(ring_lose(&stream.ring, tick), 1);
            continue;
        }
        release(FIRST_SEQ + n, 1, (uint64_t)n * PULSES);
        n++;
    }
}

/* The session has taken the ticks before `cursor`, n frames in all. */
static void stand_at(uint64_t cursor, uint32_t n)
{
    s->cursor = cursor;
    s->lost.have_seq = 1;
    s->lost.next_seq = FIRST_SEQ + n;
    s->lost.next_pulse = (uint64_t)n * PULSES;
}

static void assert_looks_at_nothing(void)
{
    assert_true(atomic_load(&stream.ring.hazard[s->reader]) == 0);
}

static void expect_cursor(uint64_t off_tick, uint64_t cursor)
{
    s->cursor = 3;
    session_catch_up(&pump, s, RELEASED, off_tick);
    assert_int_equal(s->cursor, cursor);
    assert_looks_at_nothing();
}

/* A session goes on at the oldest tick if no frame is missing before it, else with half a queue of room. */
static void a_late_session_goes_on_where_it_can(void **state)
{
    (void)state;
    release_all(0, 0);
    stand_at(3, OLDEST); /* as if the ticks between had had no frames */
    expect_cursor(UINT64_MAX, OLDEST);
    expect_cursor(OLDEST + 1, OLDEST);
    expect_cursor(OLDEST, OLDEST);
    expect_cursor(OLDEST - 1, OLDEST - 1); /* power goes with this tick */
    s->lost.next_seq--;                    /* a frame is missing */
    expect_cursor(UINT64_MAX, RELEASED - QUEUE / 2);
    expect_cursor(RELEASED - QUEUE / 2 - 1, RELEASED - QUEUE / 2 - 1);
    s->lost.next_seq++;
    s->lost.have_seq = 0; /* nobody knows */
    expect_cursor(UINT64_MAX, RELEASED - QUEUE / 2);
}

static void a_tick_that_the_head_lost_shows_nothing(void **state)
{
    (void)state;
    release_all(OLDEST, OLDEST + 1);
    stand_at(3, OLDEST);
    expect_cursor(UINT64_MAX, RELEASED - QUEUE / 2);
}

static void expect_lost(uint32_t frames, uint64_t pulses)
{
    assert_int_equal(pump.counts.left_out_frames, frames);
    assert_int_equal(pump.counts.left_out_pulses, pulses);
    assert_int_equal(counters.reader_lost_frames, frames);
    assert_int_equal(counters.reader_lost_pulses, pulses);
    assert_looks_at_nothing();
}

/* The tick that would have shown the loss is not taken any more. */
static void frames_that_were_overtaken_are_lost(void **state)
{
    (void)state;
    release_all(0, 0);
    stand_at(OLDEST, OLDEST);
    session_gone(&pump, s); /* the ring has all that it did not take */
    stand_at(5, OLDEST);
    session_gone(&pump, s); /* the ticks between had no frames */
    expect_lost(0, 0);
    assert_int_equal(n_reports, 0);
    stand_at(5, 5);
    s->lost.have_seq = 0;
    session_gone(&pump, s);
    expect_lost(0, 0);
    stand_at(5, 5);
    session_gone(&pump, s);
    expect_lost(OLDEST - 5, (OLDEST - 5) * PULSES);
    assert_int_equal(n_reports, 1);
    stand_at(OLDEST - 1, OLDEST - 1);
    session_gone(&pump, s); /* one tick too late: one frame more */
    expect_lost(OLDEST - 4, (OLDEST - 4) * PULSES);
}

/* Where the head itself lost the oldest ticks, the tick after them gives the number. Where it lost all ticks, no number
 * shows what is missing. */
static void numbers_come_from_the_first_tick_that_has_some(void **state)
{
    (void)state;
    release_all(OLDEST, RELEASED - 1);
    stand_at(5, 5);
    session_gone(&pump, s);
    expect_lost(OLDEST - 5, (OLDEST - 5) * PULSES);
}

static void without_numbers_nothing_is_counted(void **state)
{
    (void)state;
    release_all(OLDEST, RELEASED);
    stand_at(5, 5);
    session_gone(&pump, s);
    expect_lost(0, 0);
    assert_int_equal(n_reports, 0);
}

/* Fills the buffer: a reply, a frame of 5 pulses, a reply, a frame of 3 pulses, an event of the stream, and one of this
 * reader alone, which has no number. Returns where the frame of 5 pulses ends. */
static uint32_t fill_buffer(void)
{
    static uint32_t zeros[8];
    static int16_t reflectances[8];
    static uint8_t echoes[8];
    static uint16_t labels[8];
    static const struct native_event event = {.code = NATIVE_EV_PPS};
    struct line_block block = {.n_pulses = 5,
                               .n_points = 5,
                               .dt_ns = zeros,
                               .a = zeros,
                               .b = zeros,
                               .c = zeros,
                               .refl_cdb = reflectances,
                               .echo = echoes,
                               .label = labels};
    uint32_t len = 3;
    memcpy(out, "OK\n", 3);
    len += (uint32_t)native_encode_points(out + len, sizeof out - len, &block, 0);
    const uint32_t first_end = len;
    memcpy(out + len, "OK\n", 3);
    len += 3;
    block.n_pulses = block.n_points = 3;
    len += (uint32_t)native_encode_points(out + len, sizeof out - len, &block, 0);
    len += (uint32_t)native_encode_event(out + len, sizeof out - len, &event, 0, 0);
    len += (uint32_t)native_encode_event(out + len, sizeof out - len, &event, 0, NATIVE_LOCAL);
    s->out_len = len;
    pump.counts.received_pulses = 1000;
    return first_end;
}

/* A client that went away has received what was written to it as whole frames. The rest does not count as lost. */
static void what_was_not_written_is_not_received(void **state)
{
    (void)state;
    const uint32_t first_end = fill_buffer();
    static const uint64_t received[] = {1000 - 8, 1000 - 8, 1000 - 3, 1000 - 3};
    const uint32_t out_pos[] = {0, first_end - 1, first_end, first_end + 1};
    for (int i = 0; i < 4; i++) {
        fill_buffer();
        s->out_pos = out_pos[i];
        session_gone(&pump, s);
        assert_int_equal(pump.counts.received_pulses, received[i]);
    }
    expect_lost(0, 0);
}

/* The number of the next frame comes from the last tick before the cursor that has one, if the ring still has it. */
static void a_session_learns_the_next_number(void **state)
{
    (void)state;
    stream.first_seq = 7;
    session_know_next(&pump, s); /* at the beginning */
    assert_true(s->lost.have_seq && s->lost.next_seq == 7 && s->lost.next_pulse == 0);
    release_all(RELEASED - 3, RELEASED - 1); /* the head lost the two ticks before the last */
    static const struct {
        uint64_t cursor;
        uint32_t n;
    } at[] = {{RELEASED, RELEASED - 2},
              {RELEASED - 1, RELEASED - 3},
              {RELEASED - 2, RELEASED - 3},
              {RELEASED - 3, RELEASED - 3},
              {OLDEST + 1, OLDEST + 1}};
    for (size_t i = 0; i < sizeof at / sizeof at[0]; i++) {
        s->cursor = at[i].cursor;
        session_know_next(&pump, s);
        assert_int_equal(s->lost.have_seq, 1);
        assert_int_equal(s->lost.next_seq, FIRST_SEQ + at[i].n);
        assert_int_equal(s->lost.next_pulse, at[i].n * PULSES);
        assert_looks_at_nothing();
    }
    s->cursor = OLDEST; /* the ring no longer has the tick before */
    session_know_next(&pump, s);
    assert_int_equal(s->lost.have_seq, 0);
}

/* A reader has caught up when it is behind by one tick and an eighth of the queue at most. */
static void an_episode_ends_near_the_end(void **state)
{
    (void)state;
    static const struct ring_copy tick = {.first_seq = FIRST_SEQ, .pulses_before = 0};
    stand_at(10, 0);
    s->lost.lagging = 1;
    session_check_lost(&pump, s, &tick, s->cursor + 1 + QUEUE / 8 + 1);
    assert_int_equal(s->lost.lagging, 1);
    s->units.n = 1; /* of another protocol: a unit still waits */
    session_check_lost(&pump, s, &tick, s->cursor);
    assert_int_equal(s->lost.lagging, 1);
    s->units.n = 0;
    session_check_lost(&pump, s, &tick, s->cursor + 1 + QUEUE / 8);
    assert_int_equal(s->lost.lagging, 0);
}

static int n_destroyed;

static void destroy(void *protocol)
{
    assert_null(protocol);
    n_destroyed++;
}

/* Units of another protocol that still wait at the end are lost, too. What lies in the buffer is no frame then. */
static void units_that_wait_at_the_end_are_lost(void **state)
{
    (void)state;
    static const struct protocol_ops other = {.name = "other", .end = destroy};
    pump.protocol = &other;
    pump.counts.sent_units = 50;
    n_destroyed = 0;
    s->units.n = 4;
    session_leave(&pump, s); /* the run goes on */
    assert_int_equal(pump.counts.lost_units, 0);
    atomic_store(&stream.over, 1);
    session_leave(&pump, s); /* nothing waits any more */
    assert_true(pump.counts.lost_units == 0 && n_reports == 0 && n_destroyed == 2);
    s->units.n = 1;
    session_leave(&pump, s);
    assert_true(pump.counts.lost_units == 1 && n_reports == 1 && counters.reader_lost_frames == 1);
    assert_true(pump.counts.sent_units == 50 && s->units.n == 0);
}

/* Once the run is over, what the reader has not got is lost: frames in its buffer, and those that it has not taken. */
static void the_end_counts_what_is_left(void **state)
{
    (void)state;
    stand_at(15, 15);
    stream.seq = FIRST_SEQ + RELEASED;
    atomic_store(&counters.pulses, RELEASED * PULSES);
    s->out_pos = fill_buffer();
    stream_set_reader(&stream, s->reader, 15, 1);
    session_leave(&pump, s); /* the run goes on: nothing is lost yet */
    assert_int_equal(pump.counts.received_pulses, 1000 - 3);
    expect_lost(0, 0);
    assert_int_equal(atomic_load(&stream.reader[s->reader].active), 0);
    assert_int_equal(atomic_load(&stream.reader[s->reader].cursor), 15);
    s->out_pos = fill_buffer();
    atomic_store(&stream.over, 1);
    session_leave(&pump, s);
    assert_int_equal(pump.counts.received_pulses, 1000 - 3);
    expect_lost(2 + 5, 3 + 5 * PULSES); /* a frame of points and an event in the buffer */
    fill_buffer();
    s->lost.have_seq = 0; /* it has taken no tick, so its buffer holds none */
    session_leave(&pump, s);
    assert_int_equal(pump.counts.received_pulses, 1000);
    expect_lost(2 + 5, 3 + 5 * PULSES);
}

/* ---- power goes with tick 15, and comes back with tick 18 */

static int n_unplugs, n_plugs;

static int take_fault(void *link, enum link_fault what, int session, uint32_t n, double for_ms)
{
    assert_ptr_equal(link, pump.link);
    assert_true(session == 0 && n == 0 && for_ms <= 0.0);
    n_unplugs += what == LINK_FAULT_UNPLUG;
    n_plugs += what == LINK_FAULT_PLUG;
    return SH_OK;
}

static const struct link_ops power_ops = {.fault = take_fault};

static void let_power_go(void)
{
    pump.ops = &power_ops;
    pump.can_unplug = 1;
    pump.power_seen = 0;
    n_unplugs = n_plugs = 0;
    s->open = 1;
}

/* A session is cut off once it has taken all from before that tick. Where the pace waits for readers, all must be
 * written, too. In other paces a client that takes no more is not waited for. */
static void power_goes_once_a_session_has_its_ticks(void **state)
{
    (void)state;
    static const struct {
        int waits;
        uint64_t cursor;
        uint32_t unwritten, full;
        int goes, again;
    } row[] = {{1, 15, 0, 0, 1, 1}, {1, 16, 0, 0, 1, 1}, {1, 14, 0, 0, 0, 0}, {1, 15, 1, 0, 0, 0}, {1, 14, 0, 2, 0, 0},
               {0, 15, 1, 0, 1, 1}, {0, 14, 0, 0, 0, 1}, {0, 14, 1, 2, 1, 1}, {0, 14, 1, 1, 0, 1}};
    release_all(0, 0);
    stream_power(&stream, 15);
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        let_power_go();
        stream.waits = row[i].waits;
        s->cursor = row[i].cursor;
        s->out_pos = 3;
        s->out_len = 3 + row[i].unwritten;
        memcpy(out, "OK\nOK\n", 6);
        if (pump_power(&pump, row[i].full) != row[i].again) fail_msg("row %zu", i);
        assert_true(s->open == !row[i].goes && n_unplugs == row[i].goes && n_plugs == 0);
        assert_int_equal(pump.power_seen, row[i].goes);
        if (row[i].goes) assert_int_equal(pump.is_off, 1);
        pump.is_off = 0;
    }
}

/* Nothing happens before the tick is released, or on a link that sees nothing of faults. In the pace `step` the link is
 * back at once. */
static void power_goes_and_comes(void **state)
{
    (void)state;
    release_all(0, 0);
    for (int steps = 0; steps < 2; steps++) {
        atomic_store(&stream.n_power, 0);
        stream_power(&stream, 15);
        stream.steps = steps;
        let_power_go();
        s->open = 0;
        pump.is_clean = 1;
        assert_int_equal(pump_power(&pump, 0), 0);
        pump.is_clean = 0;
        assert_true(n_unplugs == 0 && pump.power_seen == 0);
        assert_int_equal(pump_power(&pump, 0), 1);
        assert_true(n_unplugs == 1 && n_plugs == steps && pump.is_off == !steps);
        stream_power(&stream, 18);
        assert_int_equal(pump_power(&pump, 0), 1);
        assert_true(n_unplugs == 1 && n_plugs == 1 && pump.is_off == 0 && pump.power_seen == 2);
        stream_power(&stream, RELEASED); /* not released yet */
        assert_int_equal(pump_power(&pump, 0), 0);
        assert_true(n_unplugs == 1 && pump.power_seen == 2);
    }
}

int main(void)
{
#define CASE(f) cmocka_unit_test_setup_teardown(f, open_stream, close_stream)
    const struct CMUnitTest tests[] = {
        CASE(a_late_session_goes_on_where_it_can),     CASE(a_tick_that_the_head_lost_shows_nothing),
        CASE(frames_that_were_overtaken_are_lost),     CASE(numbers_come_from_the_first_tick_that_has_some),
        CASE(without_numbers_nothing_is_counted),      CASE(what_was_not_written_is_not_received),
        CASE(a_session_learns_the_next_number),        CASE(an_episode_ends_near_the_end),
        CASE(units_that_wait_at_the_end_are_lost),     CASE(the_end_counts_what_is_left),
        CASE(power_goes_once_a_session_has_its_ticks), CASE(power_goes_and_comes),
    };
    return cmocka_run_group_tests_name("readers that are gone", tests, NULL, NULL);
}
