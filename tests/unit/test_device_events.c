/* SPDX-License-Identifier: MIT */
/* Events on their way into ticks, and what the head says of its losses: numbers, texts, how many and when, at each
 * limit and one beyond. Ticks are the test's own, 100 a second. */
#include "firmware_sim/command/command.h"
#include "firmware_sim/device/events.h"
#include "firmware_sim/device/overrun.h"
#include "tests/unit/device_rig.h"

enum { HZ = 100, NUMBER = -222 };

static uint64_t next_tick;
static struct device_events events;
static struct device_work work;
static struct device_counters counters;
static struct command_queue queue;
static struct device_overrun overrun;

static int begin(void **state)
{
    (void)state;
    next_tick = 0;
    memset(&events, 0, sizeof events);
    memset(&work, 0, sizeof work);
    memset(&counters, 0, sizeof counters);
    memset(&queue, 0, sizeof queue);
    events.tick_hz = HZ;
    events.next_tick = &next_tick;
    overrun = (struct device_overrun){
        .tick_hz = HZ, .counters = &counters, .events = &events, .queue = &queue, .first = UINT64_MAX};
    return 0;
}

static void push_numbered(uint32_t from, uint32_t to)
{
    for (uint32_t i = from; i < to; i++)
        device_push_event(&events, NATIVE_EV_PPS, i, 0, 0, NULL);
}

static void expect_event(const struct native_event *event, enum native_event_code code, uint64_t a, uint64_t b,
                         uint64_t c, const char *text)
{
    if (event->code != (uint32_t)code || event->a != a || event->b != b || event->c != c ||
        strcmp(event->text, text) != 0)
        fail_msg("event %u %lld %llu %llu \"%s\"", event->code, (long long)event->a, (unsigned long long)event->b,
                 (unsigned long long)event->c, event->text);
}

/* A tick takes as many as fit, in their order; the rest waits for the next ones. */
static void events_keep_their_order(void **state)
{
    (void)state;
    push_numbered(0, DEVICE_MAX_EVENTS + 2);
    device_take_events(&events, &work);
    assert_true(work.n_events == DEVICE_MAX_EVENTS && events.n == 2);
    for (uint32_t i = 0; i < DEVICE_MAX_EVENTS; i++)
        expect_event(&work.event[i], NATIVE_EV_PPS, i, 0, 0, "");
    work.n_events = 1; /* the next tick has one of its own */
    device_take_events(&events, &work);
    assert_true(work.n_events == 3 && events.n == 0);
    expect_event(&work.event[1], NATIVE_EV_PPS, DEVICE_MAX_EVENTS, 0, 0, "");
    expect_event(&work.event[2], NATIVE_EV_PPS, DEVICE_MAX_EVENTS + 1, 0, 0, "");
    device_take_events(&events, &work);
    assert_int_equal(work.n_events, 3);
}

/* Texts are printable ASCII (PROTOCOL.md), whatever names they have, and as long as the field (char[96]) with its NUL. */
static void texts_are_ascii(void **state)
{
    (void)state;
    char longest[120];
    memset(longest, 'x', sizeof longest - 1);
    longest[94] = (char)0xc3; /* a character across the end of the field */
    longest[95] = (char)0xbc;
    longest[sizeof longest - 1] = '\0';
    device_push_event(&events, NATIVE_EV_SITE, 2, 0, 0, "Z\xc3\xbcrich ~\x1f\x7f");
    device_push_error(&events, 0, NUMBER, longest);
    expect_event(&events.event[0], NATIVE_EV_SITE, 2, 0, 0, "Z~~rich ~~~");
    for (size_t i = 0; i < 95; i++)
        assert_int_equal(events.event[1].text[i], i == 94 ? '~' : 'x');
    assert_int_equal(events.event[1].text[95], '\0');
}

/* An event that finds no room is counted. The count is reported once there is room. */
static void events_without_room_are_said(void **state)
{
    (void)state;
    push_numbered(0, DEVICE_MAX_PENDING);
    assert_true(events.n == DEVICE_MAX_PENDING && events.dropped == 0);
    push_numbered(1000, 1003);
    assert_true(events.n == DEVICE_MAX_PENDING && events.dropped == 3);
    device_take_events(&events, &work);
    assert_int_equal(events.n, DEVICE_MAX_PENDING - DEVICE_MAX_EVENTS + 1);
    expect_event(&events.event[events.n - 1], NATIVE_EV_ERROR, (uint64_t)(int64_t)CMD_E_QUEUE, 0, 0,
                 "3 events had no room");
    device_take_events(&events, &work); /* the work is full: no more room, and nothing more to say */
    assert_int_equal(events.n, DEVICE_MAX_PENDING - DEVICE_MAX_EVENTS + 1);
}

static void push_errors(uint32_t session, int n)
{
    for (int i = 0; i < n; i++)
        device_push_error(&events, session, NUMBER - i, "why");
}

/* The tenth has an event, the eleventh does not. Errors that were held back are said when the second is over: with the
 * number of the last one, the session and how many. */
static void the_eleventh_error_of_a_second_waits(void **state)
{
    (void)state;
    next_tick = 7;
    push_errors(2, 10);
    assert_true(events.n == 10 && events.held == 0);
    expect_event(&events.event[9], NATIVE_EV_ERROR, (uint64_t)(int64_t)(NUMBER - 9), 2, 0, "why");
    push_errors(2, 3);
    push_errors(DEVICE_MAX_SESSIONS, 12);    /* the last session has a second of its own */
    push_errors(DEVICE_MAX_SESSIONS + 1, 1); /* there is none of that number: it counts as the head's */
    assert_true(events.n == 21 && events.held == 5);
    device_say_held(&events, 7 + HZ - 1, 0);
    assert_true(events.n == 21 && events.held == 5);
    device_say_held(&events, 7 + HZ, 0);
    assert_true(events.n == 23 && events.held == 0);
    expect_event(&events.event[21], NATIVE_EV_ERROR, (uint64_t)(int64_t)(NUMBER - 2), 2, 3,
                 "3 more errors of session 2");
    char text[64];
    snprintf(text, sizeof text, "2 more errors of session %d", DEVICE_MAX_SESSIONS);
    expect_event(&events.event[22], NATIVE_EV_ERROR, (uint64_t)(int64_t)(NUMBER - 11), DEVICE_MAX_SESSIONS, 2, text);
    next_tick = 7 + HZ; /* the second that begins now has room for ten again */
    push_errors(2, 11);
    assert_true(events.n == 33 && events.held == 1);
}

/* The second is over just HZ ticks after its first error. */
static void a_second_ends_after_its_ticks(void **state)
{
    (void)state;
    for (int late = 0; late <= 1; late++) {
        begin(NULL);
        next_tick = 3;
        push_errors(1, 10);
        next_tick = 3 + HZ - 1 + (uint64_t)late;
        push_errors(1, 1);
        assert_int_equal(events.held, late == 0);
        assert_int_equal(events.n, 10 + late);
    }
}

/* At the end of the run no error stays held back. One that finds no room is reported once there is room. */
static void held_errors_are_said_at_the_end(void **state)
{
    (void)state;
    push_errors(0, 11);
    push_errors(1, 12);
    push_numbered(events.n, DEVICE_MAX_PENDING);
    device_say_held(&events, 1, 1);
    assert_true(events.n == DEVICE_MAX_PENDING && events.held == 3);
    events.n = DEVICE_MAX_PENDING - 1;
    device_say_held(&events, 1, 1);
    assert_true(events.n == DEVICE_MAX_PENDING && events.held == 2);
    expect_event(&events.event[DEVICE_MAX_PENDING - 1], NATIVE_EV_ERROR, (uint64_t)(int64_t)(NUMBER - 10), 0, 1,
                 "1 more errors of session 0");
}

/* Without room an error is held back, too, though it is the first of its second. */
static void an_error_without_room_is_held(void **state)
{
    (void)state;
    push_numbered(0, DEVICE_MAX_PENDING);
    push_errors(4, 1);
    assert_true(events.held == 1 && events.dropped == 0);
}

/* ---- losses */

static void lose(uint64_t tick, uint64_t cast0, uint64_t n_cast)
{
    static struct device_work lost;
    lost = (struct device_work){.tick = tick, .scanning = n_cast != 0, .cast0 = cast0, .n_cast = n_cast};
    device_count_lost(&overrun, &lost, 0);
}

/* Each loss has an event. The error comes once, until a second has passed without a loss. */
static void each_loss_has_an_event_and_each_episode_an_error(void **state)
{
    (void)state;
    device_say_overrun(&overrun, 500, 10);
    assert_true(events.n == 0 && queue.count == 0);
    lose(8, 430, 30);
    lose(7, 400, 30);
    lose(9, 0, 0); /* it has no pulse, so its first pulse's number does not count */
    device_say_overrun(&overrun, 500, 10);
    assert_int_equal(events.n, 1);
    expect_event(&events.event[0], NATIVE_EV_OVERRUN, 400, 60, 3, "60 pulses in 3 ticks not computed in time");
    assert_int_equal(queue.count, 1);
    device_say_overrun(&overrun, 500, 11);
    assert_int_equal(events.n, 1);
    lose(12, 600, 5);
    device_say_overrun(&overrun, 700, 10 + HZ); /* just a second later: the same episode */
    expect_event(&events.event[1], NATIVE_EV_OVERRUN, 600, 5, 1, "5 pulses in 1 ticks not computed in time");
    assert_int_equal(queue.count, 1);
    lose(13, 0, 0);
    device_say_overrun(&overrun, 800, 10 + HZ + HZ + 1);
    expect_event(&events.event[2], NATIVE_EV_OVERRUN, 800, 0, 1, "0 pulses in 1 ticks not computed in time");
    assert_int_equal(queue.count, 2);
    assert_true(counters.lost_pulses == 65 && counters.lost_ticks == 5);
}

/* The tick with the event is lost as well. The tick's losses are reported again with the new ones, and its other events
 * go before those that wait. */
static void a_lost_tick_gives_its_events_back(void **state)
{
    (void)state;
    lose(8, 430, 30);
    device_say_overrun(&overrun, 500, 10);
    push_numbered(1, 3);
    device_take_events(&events, &work);
    push_numbered(7, 8);
    work.tick = 10;
    work.scanning = 1;
    work.cast0 = 460;
    work.n_cast = 20;
    device_count_lost(&overrun, &work, 0);
    assert_int_equal(events.n, 3);
    for (uint32_t i = 0; i < 3; i++)
        expect_event(&events.event[i], NATIVE_EV_PPS, i == 2 ? 7 : i + 1, 0, 0, "");
    device_say_overrun(&overrun, 500, 11);
    expect_event(&events.event[3], NATIVE_EV_OVERRUN, 430, 50, 2, "50 pulses in 2 ticks not computed in time");
    assert_int_equal(queue.count, 1);
}

/* Events of ticks before the power went are forgotten; those of the tick in which it went are not. */
static void a_power_cycle_forgets_events_of_before(void **state)
{
    (void)state;
    for (int at = 0; at <= 1; at++) {
        begin(NULL);
        work.tick = 9 + (uint64_t)at;
        work.n_events = 1;
        work.event[0] = (struct native_event){.code = NATIVE_EV_PPS, .a = 5};
        device_count_lost(&overrun, &work, 10);
        assert_int_equal(events.n, at);
    }
}

/* Events of a lost tick that find no room are counted. */
static void events_that_come_back_may_have_no_room(void **state)
{
    (void)state;
    work.n_events = 3;
    for (uint32_t i = 0; i < 3; i++)
        work.event[i] = (struct native_event){.code = NATIVE_EV_PPS, .a = 100 + i};
    push_numbered(0, DEVICE_MAX_PENDING - 1);
    device_count_lost(&overrun, &work, 0);
    assert_true(events.n == DEVICE_MAX_PENDING && events.dropped == 2);
    expect_event(&events.event[0], NATIVE_EV_PPS, 100, 0, 0, "");
    expect_event(&events.event[DEVICE_MAX_PENDING - 1], NATIVE_EV_PPS, DEVICE_MAX_PENDING - 2, 0, 0, "");
}

/* Lost lines are an event at most once a second. They are an error once, until two seconds go by without one. */
static void lost_lines_are_said_once_a_second(void **state)
{
    (void)state;
    static const struct {
        uint64_t tick, journal, truth;
        uint32_t events, errors; /* of all steps so far */
        const char *text;        /* of the last event */
    } steps[] = {{5, 0, 0, 0, 0, NULL},
                 {6, 2, 3, 1, 1, "so far of the journal 2, of the truth 3"},
                 {7, 2, 3, 1, 1, NULL},
                 {6 + HZ - 1, 4, 3, 1, 1, NULL},
                 {6 + HZ, 4, 3, 2, 1, "so far of the journal 4, of the truth 3"},
                 {6 + 3 * HZ, 4, 5, 3, 1, "so far of the journal 4, of the truth 5"},
                 {6 + 5 * HZ + 1, 5, 5, 4, 2, "so far of the journal 5, of the truth 5"}};
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++) {
        atomic_store(&counters.lost_journal_lines, steps[i].journal);
        atomic_store(&counters.lost_truth_lines, steps[i].truth);
        next_tick = steps[i].tick;
        device_say_lost_lines(&overrun, steps[i].tick);
        if (events.n != steps[i].events || queue.count != steps[i].errors)
            fail_msg("step %zu: %u events, %u errors", i, events.n, (unsigned)queue.count);
        if (steps[i].text != NULL)
            expect_event(&events.event[events.n - 1], NATIVE_EV_ERROR, (uint64_t)(int64_t)CMD_E_LINES, 0, 0,
                         steps[i].text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(events_keep_their_order, begin),
        cmocka_unit_test_setup(texts_are_ascii, begin),
        cmocka_unit_test_setup(events_without_room_are_said, begin),
        cmocka_unit_test_setup(the_eleventh_error_of_a_second_waits, begin),
        cmocka_unit_test_setup(a_second_ends_after_its_ticks, begin),
        cmocka_unit_test_setup(held_errors_are_said_at_the_end, begin),
        cmocka_unit_test_setup(an_error_without_room_is_held, begin),
        cmocka_unit_test_setup(each_loss_has_an_event_and_each_episode_an_error, begin),
        cmocka_unit_test_setup(a_lost_tick_gives_its_events_back, begin),
        cmocka_unit_test_setup(a_power_cycle_forgets_events_of_before, begin),
        cmocka_unit_test_setup(events_that_come_back_may_have_no_room, begin),
        cmocka_unit_test_setup(lost_lines_are_said_once_a_second, begin),
    };
    return cmocka_run_group_tests_name("device events", tests, NULL, NULL);
}
