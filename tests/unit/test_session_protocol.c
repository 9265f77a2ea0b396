/* SPDX-License-Identifier: MIT */
/* A session of a protocol that is not native: what its protocol is told and when, which of its units go out, and what
 * it may call. */
#include "tests/unit/session_rig.h"

static void a_protocol_learns_of_its_head(void **state)
{
    (void)state;
    strcpy(stored, "kept\n");
    strcpy(links.data_address, "127.0.0.9");
    links.data_port = 77;
    links.position_port = 78;
    pump.dialect = PROTOCOL_COLA_B;
    open_session();
    expect_log("create kept\n|open 0|");
    assert_true(spec.power_ns == 4 * TICK_NS && spec.power_ons == 3 && spec.near_wrap == 9 && spec.keeps);
    assert_true(spec.dialect == PROTOCOL_COLA_B && spec.port == 77 && spec.position_port == 78);
    assert_true(!spec.waits && spec.talk == NULL);
    assert_string_equal(spec.address, "127.0.0.9");
    assert_ptr_equal(spec.identity, &links.identity);
    assert_ptr_equal(spec.shared, &pump.shared);
    session_close_protocol(&pump, s);
    expect_log("destroy|");
    own_source.stored = NULL;
    stream.waits = 1;
    open_session();
    assert_true(!spec.keeps && spec.waits);
}

static void calls_reach_the_source(void **state)
{
    (void)state;
    struct nmea_fix fix;
    char reply[PROTOCOL_REPLY];
    int64_t hour_ns;
    open_session();
    logged[0] = '\0';
    release(0);
    const struct protocol_host *h = &spec.host;
    assert_int_equal(h->command(h->ctx, "LINE", reply, sizeof reply), -7);
    assert_string_equal(reply, "3 LINE 1");
    assert_int_equal(h->command(h->ctx, "LINE", reply, 4), -7);
    assert_string_equal(reply, "3 L");
    assert_true(h->fix(h->ctx, 70, &fix) == 5 && fix.lat_deg == 70.0);
    assert_true(h->next_fix_ns(h->ctx, 70) == 71 && h->date_ns(h->ctx, 70) == 72);
    assert_true(h->pps(h->ctx, 70, &hour_ns) == PROTOCOL_PPS_ERROR && hour_ns == 73);
    assert_true(h->window_loss_db(h->ctx) == 1.5 && h->store(h->ctx, "lines") == 0);
    expect_log("store own lines|");
    own_source.store = NULL;
    own_source.window_loss_db = NULL;
    assert_true(h->window_loss_db(h->ctx) == 0.0 && h->store(h->ctx, "lines") == 1);
}

static void counts_have_their_places(void **state)
{
    (void)state;
    open_session();
    const struct protocol_host *h = &spec.host;
    h->count(h->ctx, PROTOCOL_WRONG, 0);
    assert_true(n_refused == 0 && s->commands.wrong == 0);
    for (int what = 0; what < PROTOCOL_N_COUNTS; what++)
        for (int i = 0; i < 2; i++)
            h->count(h->ctx, (enum protocol_count)what, 10 + (uint64_t)what);
    const struct link_counts *n = &pump.counts;
    assert_true(n->lost_units == 20 && n->lost_input_bytes == 22 && n->wrong_requests == 24);
    assert_true(n->lost_points == 26 && n->unsent_pulses == 28 && n->sent_units == 0);
    assert_true(n_refused == 4 && s->commands.wrong == 4); /* wrong requests, and bytes that are none */
}

static void a_line_is_told_once(void **state)
{
    (void)state;
    char text[32], want[128];
    open_session();
    for (int i = 0; i < 2 * MAX_TOLD; i++) {
        snprintf(text, sizeof text, "line %d", i);
        for (int again = 0; again < 2; again++)
            spec.host.tell_once(spec.host.ctx, text);
        assert_int_equal(n_warned, i < MAX_TOLD ? i + 1 : MAX_TOLD);
        snprintf(want, sizeof want, "link here: %s", text);
        if (i < MAX_TOLD - 1) assert_string_equal(warned, want);
    }
    assert_string_equal(warned, "link here: further messages of its protocol are not shown; the statistics count what "
                                "they are about");
}

/* Frames and time come tick by tick. Ticks that the head could not compute are gaps, and so are missing numbers. */
static void ticks_come_in_order(void **state)
{
    (void)state;
    open_session();
    logged[0] = '\0';
    release(2);
    release(0);
    assert_int_equal(session_write_protocol(&pump, s, 2), 0);
    expect_log("frame 10 at 100|frame 11 at 101|1|2|");
    assert_int_equal(ring_lose(&stream.ring, 2), 1);
    next_seq = 17;
    release(1);
    assert_int_equal(session_write_protocol(&pump, s, 2), 0);
    expect_log("gap 1|3|report reader|gap 5|frame 17 at 100|4|");
    assert_int_equal(s->cursor, 4);
    assert_int_equal(session_write_protocol(&pump, s, 2), 0);
    expect_log("");
}

static void units_go_out_whole(void **state)
{
    (void)state;
    open_session();
    logged[0] = '\0';
    assert_int_equal(spec.host.send(spec.host.ctx, "one", 3), 0);
    assert_int_equal(spec.host.send(spec.host.ctx, "two", 3), 0);
    assert_int_equal(spec.host.send(spec.host.ctx, "", 0), 0);
    link_room = 2;
    assert_int_equal(session_write_protocol(&pump, s, 2), 0);
    expect_log("out on|out e|out tw|out o|");
    assert_int_equal(pump.counts.sent_units, 2);
    spec.host.send(spec.host.ctx, "three", 5);
    link_room = 0;
    release(0);
    assert_int_equal(session_write_protocol(&pump, s, 2), 1); /* time goes on without the client */
    expect_log("1|out |");
    assert_true(pump.counts.sent_units == 2 && s->units.n == 1 && s->cursor == 1);
}

/* Once a unit has waited for longer than the queue, further ones are lost; answers are not. */
static void late_units_are_lost(void **state)
{
    (void)state;
    open_session();
    spec.host.send(spec.host.ctx, "old", 3);
    for (int i = 0; i < QUEUE; i++)
        release(0);
    assert_int_equal(spec.host.send(spec.host.ctx, "in time", 7), 0);
    release(0);
    assert_int_equal(spec.host.send(spec.host.ctx, "late", 4), 1);
    assert_true(pump.counts.lost_units == 1 && s->units.n == 2);
    s->answering = 1;
    assert_int_equal(spec.host.send(spec.host.ctx, "answer", 6), 0);
    s->answering = 0;
    stream.waits = 1; /* then nothing is late */
    assert_int_equal(spec.host.send(spec.host.ctx, "unit", 4), 0);
    assert_int_equal(pump.counts.lost_units, 1);
}

static void input_comes_in_pieces(void **state)
{
    (void)state;
    char text[141];
    open_session();
    logged[0] = '\0';
    memset(text, 'x', 140);
    text[140] = '\0';
    say(text);
    session_write_protocol(&pump, s, 2);
    expect_log("in 64 x|in 64 x|in 12 x|");
    say(text);
    does.takes = 50;
    session_write_protocol(&pump, s, 2);
    expect_log("in 50 x|in 50 x|in 40 x|");
    say(text);
    s->commands.wrong = WRONG_AT_ONCE; /* the link rests */
    session_write_protocol(&pump, s, 2);
    expect_log("");
    assert_int_equal(session_owes_protocol(&pump, s), 1);
    own_link.datagrams = 1;
    session_write_protocol(&pump, s, 2);
    expect_log("in 140 x|");
    assert_int_equal(session_owes_protocol(&pump, s), 0);
    does.owes = 1;
    assert_int_equal(session_owes_protocol(&pump, s), 1);
}

/* The session ends after its units. What the client has sent meanwhile counts as lost. */
static void a_protocol_hangs_up(void **state)
{
    (void)state;
    open_session();
    logged[0] = '\0';
    does.takes = 1;
    does.n_answers = 1;
    say("a!bcd");
    session_write_protocol(&pump, s, 2);
    expect_log("in 1 a|in 1 !|out answer|"); /* no answer after the end */
    assert_int_equal(s->answering, 0);
    assert_true(s->hang_up == 1 && pump.counts.lost_input_bytes == 3 && pump.counts.sent_units == 1);
    assert_true(session_is_done(&pump, s) && pump.counts.lost_units == 0);
    own_link.end = NULL; /* a link that can't end it */
    s->hang_up = 0;
    say("!b");
    session_write_protocol(&pump, s, 2);
    expect_log("in 1 !|in 1 b|out answer|out answer|");
    s->hang_up = 1;
    session_close_protocol(&pump, s);
    open_session(); /* the next client's */
    assert_int_equal(s->hang_up, 0);
}

static void it_wakes_for_its_protocol(void **state)
{
    (void)state;
    open_session();
    s->cursor = 5;
    does.next_ns = INT64_MAX;
    assert_true(session_wake_tick(&pump, s) == UINT64_MAX);
    does.next_ns = 9 * TICK_NS - 1;
    assert_int_equal(session_wake_tick(&pump, s), 8);
    does.next_ns = 9 * TICK_NS;
    assert_int_equal(session_wake_tick(&pump, s), 9);
    does.next_ns = -1;
    assert_int_equal(session_wake_tick(&pump, s), 5);
    const struct protocol_ops *const all = pump.protocol;
    struct protocol_ops some = *all;
    pump.protocol = &some;
    some.next_ns = NULL;
    assert_int_equal(session_wake_tick(&pump, s), 5);
    some.time = NULL; /* without frames it has nothing to do */
    assert_true(session_wake_tick(&pump, s) == UINT64_MAX);
    pump.protocol = all;
}

/* A link that fails ends the session. A client that went away is no failure of the link. */
static void a_failing_link_ends_the_session(void **state)
{
    (void)state;
    static const struct {
        ssize_t fails;
        int failed;
    } rows[] = {{SH_ECLOSED, 0}, {SH_EIO, 1}};
    for (int i = 0; i < 2; i++) {
        open_session();
        logged[0] = '\0';
        release(0);
        spec.host.send(spec.host.ctx, "unit", 4);
        link_fails = rows[i].fails;
        assert_int_equal(session_write_protocol(&pump, s, 2), 0);
        expect_log(i == 0 ? "1|destroy|" : "2|destroy|");
        assert_true(s->open == 0 && s->protocol == NULL && s->units.n == 0 && pump.failed == rows[i].failed);
        assert_int_equal(pump.counts.sent_units, 0);
    }
}

/* A client that joins first gets the last descriptor, as a frame without a number. Where fields are watched, a session
 * begins with earlier ticks, but with none from before power came. */
static void a_client_joins_late(void **state)
{
    (void)state;
    uint8_t frame[1024];
    const struct native_descriptor d = {.range_scale_m = 1, .mirror_counts_per_turn = 1, .pan_counts_per_turn = 1};
    assert_true(native_encode_descriptor(frame, sizeof frame, &d, 50, 0) > 0);
    native_finish_frame(frame, 4);
    latched_put(&stream.latched, frame);
    for (int i = 0; i < 9; i++)
        release(0);
    open_session();
    expect_log("create |open 9|frame 0 at 50|");
    session_close_protocol(&pump, s);
    links.identity.fields = &links.fields;
    logged[0] = '\0';
    open_session();                              /* 6 ticks, as three quarters of the queue */
    expect_log("create |open 4|frame 0 at 50|"); /* power came with tick 4 */
    assert_true(s->cursor == 4 && s->came_at == 9 && s->power_from == 9);
    session_close_protocol(&pump, s);
    release(0);
    release(0);
    release(0);
    logged[0] = '\0';
    open_session();
    expect_log("create |open 6|frame 0 at 50|");
    session_close_protocol(&pump, s);
    stream.waits = 1;
    logged[0] = '\0';
    open_session();
    expect_log("create |open 12|frame 0 at 50|");
}

/* When power goes, the protocol of a session that goes on ends, and what still waited in it is gone. Power goes with
 * ticks 2 and 5, and comes with 4 and 7. The new instance learns of times after 4 alone, though both power cycles are
 * known already. */
static void a_session_outlasts_power(void **state)
{
    (void)state;
    open_session();
    static const uint64_t ticks[] = {2, 4, 5, 7};
    for (int i = 0; i < 4; i++)
        stream_power(&stream, ticks[i]);
    for (int i = 0; i < 8; i++)
        release(0);
    s->cursor = 2;
    say("half");
    spec.host.send(spec.host.ctx, "unit", 4);
    logged[0] = '\0';
    s->moved_ns = 0;
    session_power_off(&pump, s, 2);
    assert_true(s->moved_ns > 0); /* else the end of a run would not wait for the rest */
    assert_true(s->power_from == 3 && s->units.n == 0 && s->commands.in_len == 0 && s->open == 1);
    say("lost");
    session_write_protocol(&pump, s, 2);
    expect_log("destroy|");
    assert_true(s->cursor == 4 && pump.counts.lost_input_bytes == 4);
    assert_true(session_wake_tick(&pump, s) == UINT64_MAX && session_owes_protocol(&pump, s));
    session_power_on(&pump, s, 4);
    expect_log("create |open 4|");
    session_write_protocol(&pump, s, 2);
    expect_log("5|");
    assert_int_equal(s->cursor, 5);
    session_power_off(&pump, s, 5);
    session_power_on(&pump, s, 7); /* its link takes no more, and it is still at 5 */
    expect_log("destroy|create |open 7|");
    assert_int_equal(s->cursor, 7);
    session_power_on(&pump, s, 7); /* it has power */
    expect_log("");
}

/* A session that outlasts power takes no tick beyond a change of power until the link has carried that out, though later
 * changes are known. So its log is the same however far the head is ahead. */
static void power_changes_in_turn(void **state)
{
    (void)state;
    static const char *const logs[] = {"1|2|destroy|", "create |open 4|", "5|destroy|", "create |open 7|", "8|"};
    static const uint64_t ticks[] = {2, 4, 5, 7};
    open_session();
    own_link.end = NULL;
    stream.waits = 1;
    for (int i = 0; i < 4; i++)
        stream_power(&stream, ticks[i]);
    for (int i = 0; i < 8; i++)
        release(0);
    s->cursor = 0;
    logged[0] = '\0';
    for (uint32_t i = 0; i < 5; i++) {
        session_write_protocol(&pump, s, 2);
        assert_int_equal(s->cursor, i < 4 ? ticks[i] : 8);
        assert_int_equal(pump_power(&pump, 0), i < 4);
        expect_log(logs[i]);
        assert_int_equal(pump.power_seen, i < 4 ? i + 1 : 4);
    }
}

/* Settings that were stored are tried when the link is opened. */
static void stored_settings_are_checked(void **state)
{
    (void)state;
    struct sh_err err;
    assert_int_equal(pump_check_stored(&pump, &err), SH_OK);
    expect_log(""); /* nothing is stored */
    strcpy(stored, "kept\n");
    assert_int_equal(pump_check_stored(&pump, &err), SH_OK);
    expect_log("create kept\n|destroy|");
    unit_queue_free(&pump.session[0].units);
    pump.session[0].units = (struct unit_queue){0};
    own_source.stored = NULL;
    assert_int_equal(pump_check_stored(&pump, &err), SH_OK);
    expect_log("");
}

/* The times of a recording's frames become those of the run. A session that was overtaken goes on with newer ticks. */
static void ticks_are_shifted_and_overtaken(void **state)
{
    (void)state;
    open_session();
    logged[0] = '\0';
    release_shifted(1, 1000);
    assert_int_equal(session_write_protocol(&pump, s, 2), 0);
    expect_log("frame 10 at 1100|1|");
    for (int i = 0; i < QUEUE + 4; i++)
        release(1);
    assert_int_equal(session_write_protocol(&pump, s, 2), 0);
    assert_int_equal(strncmp(logged, "report reader|gap 8|frame 19 at 100|10|", 39), 0);
    assert_int_equal(s->cursor, QUEUE + 5);
}

#define WITH_SESSION(test) cmocka_unit_test_setup_teardown(test, session_setup, session_teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        WITH_SESSION(a_protocol_learns_of_its_head),
        WITH_SESSION(calls_reach_the_source),
        WITH_SESSION(counts_have_their_places),
        WITH_SESSION(a_line_is_told_once),
        WITH_SESSION(ticks_come_in_order),
        WITH_SESSION(units_go_out_whole),
        WITH_SESSION(late_units_are_lost),
        WITH_SESSION(input_comes_in_pieces),
        WITH_SESSION(a_protocol_hangs_up),
        WITH_SESSION(it_wakes_for_its_protocol),
        WITH_SESSION(a_failing_link_ends_the_session),
        WITH_SESSION(a_client_joins_late),
        WITH_SESSION(a_session_outlasts_power),
        WITH_SESSION(power_changes_in_turn),
        WITH_SESSION(stored_settings_are_checked),
        WITH_SESSION(ticks_are_shifted_and_overtaken),
    };
    return cmocka_run_group_tests_name("session of a protocol", tests, NULL, NULL);
}
