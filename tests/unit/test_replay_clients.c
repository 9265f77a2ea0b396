/* SPDX-License-Identifier: MIT */
/* The clients of a recording that is replayed come and go as those of a head, and it may wait for them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/replay/replay_state.h"
#include "tests/unit/file_rig.h"
#include "tests/unit/event_recording.h"

static void expect_next_error(struct replay *r, const char *start, const char *text)
{
    char error[256];
    command_queue_pop(&r->cmd.queue, error, sizeof error);
    if (strncmp(error, start, strlen(start)) != 0 || strstr(error, text) == NULL) fail_msg("%s, not %s", error, start);
}

/* A client that goes is an error if it had control, or while the recording is played. Half a line is an error by
 * itself. The client's control is free then. */
static void a_client_that_goes_is_an_error_where_it_is_missed(void **state)
{
    (void)state;
    struct replay *r = calloc(1, sizeof *r);
    assert_non_null(r);
    pthread_mutex_init(&r->lock, NULL);
    replay_session_opened(r, 1, "tcp a");
    replay_session_opened(r, 2, "tcp b");
    assert_int_equal(r->n_clients, 2);
    r->cmd.control = 1;
    replay_session_closed(r, 2, "tcp b", 0);
    expect_next_error(r, "0,", "");
    replay_session_closed(r, 2, "tcp b", 1);
    expect_next_error(r, "105,", "session 2, tcp b");
    expect_next_error(r, "0,", "");
    assert_int_equal(r->cmd.control, 1);
    replay_session_closed(r, 1, "tcp a", 1);
    expect_next_error(r, "105,", "session 1, tcp a");
    expect_next_error(r, "101,", "session 1, tcp a");
    expect_next_error(r, "0,", "");
    assert_int_equal(r->cmd.control, 0);
    r->playing = 1;
    replay_session_closed(r, 3, "tcp c", 0);
    expect_next_error(r, "101,", "session 3, tcp c");
    replay_session_over(r);
    assert_int_equal(r->n_clients, 1);
    struct command_result result;
    char longest[64];
    snprintf(longest, sizeof longest, "session 4, longest line %d bytes", COMMAND_MAX_LINE);
    replay_overlong(r, 4, &result);
    assert_int_equal(result.error, CMD_E_OVERRUN);
    expect_next_error(r, "-363,", longest);
    replay_report(r, CMD_E_REFUSED, "why");
    expect_next_error(r, "104,", "why");
    assert_int_equal(pthread_mutex_destroy(&r->lock), 0); /* nobody holds it */
    free(r);
}

/* A client of another protocol has control for its one command alone. What another session has stays with it. */
static void a_single_command_keeps_no_control(void **state)
{
    (void)state;
    struct config *cfg = calloc(1, sizeof *cfg);
    struct replay *r = calloc(1, sizeof *r);
    struct command_result result;
    assert_true(cfg != NULL && r != NULL);
    pthread_mutex_init(&r->lock, NULL);
    r->cfg = cfg;
    replay_open_commands(r);
    replay_command_once(r, 4, "SYST:CONT:TAKE", 0, &result);
    assert_true(result.error == 0 && r->cmd.control == 0);
    replay_command(r, 4, "SYST:CONT:TAKE", 0, &result);
    assert_true(result.error == 0 && r->cmd.control == 4);
    replay_command_once(r, 5, "HEAD:STATE?", 0, &result);
    assert_true(result.error == 0 && r->cmd.control == 4);
    pthread_mutex_destroy(&r->lock);
    free(r);
    free(cfg);
}

/* Returns how many events the tick has. */
static int events_of(struct replay *r, uint64_t number)
{
    struct ring_tick tick;
    int n = 0;
    assert_int_equal(replay_source.next(r, number, 0, 0, &tick), LOOP_SOURCE_TICK);
    for (uint32_t at = 0; at < tick.len; at += (uint32_t)native_frame_len(tick.bytes + at))
        n += tick.bytes[at + 1] == NATIVE_EVENT;
    return n;
}

/* The state is that of the last released tick, or spin-up where the recording is about to play. */
static void expect_state(struct replay *r, uint64_t released, const char *state)
{
    struct command_result result;
    replay_source.command(r, 1, "HEAD:STATE?", released, &result);
    assert_string_equal(result.reply, state);
}

/* With two clients wanted it begins when the second one is there, and not when one of two has gone. Links that open a
 * session for themselves are no clients. */
static void it_waits_for_its_clients(void **state)
{
    (void)state;
    enum { N_OWN = 4 };
    static const enum link_type own[N_OWN] = {LINK_NULL, LINK_NULL, LINK_UDP, LINK_FILE};
    struct config *cfg = calloc(1, sizeof *cfg);
    struct replay *r;
    struct ring_tick tick;
    struct sh_err err;
    assert_non_null(cfg);
    event_recording_write(file_path, 3);
    cfg->loop.tick_hz = 1000;
    cfg->n_links = N_OWN;
    for (uint32_t i = 0; i < N_OWN; i++)
        cfg->link[i].type = own[i];
    const struct replay_options options = {.path = file_path, .speed = 1, .start = 1, .clients = 2};
    if (replay_open(cfg, &options, &r, &err) != SH_OK) fail_msg("%s", err.text);
    for (uint32_t i = 0; i < N_OWN; i++)
        replay_source.session_opened(r, 10 + i, "the link's own");
    replay_source.session_opened(r, 2, "tcp a");
    assert_int_equal(replay_source.next(r, 0, 1, 0, &tick), LOOP_SOURCE_IDLE);
    replay_source.session_over(r);
    replay_source.session_opened(r, 3, "tcp b");
    assert_int_equal(events_of(r, 1), 0);
    expect_state(r, 2, "idle");
    replay_source.session_opened(r, 4, "tcp c");
    assert_int_equal(events_of(r, 2), 1);
    expect_state(r, 2, "spin-up"); /* the tick that begins it has number 2, and is not released yet */
    expect_state(r, 3, "scanning");
    assert_int_equal(events_of(r, 3), 1);
    replay_stop(r, 4, 0);
    expect_state(r, 4, "scanning");
    expect_state(r, 5, "idle");
    replay_free(r);
    free(cfg);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_client_that_goes_is_an_error_where_it_is_missed),
        cmocka_unit_test(a_single_command_keeps_no_control),
        cmocka_unit_test(it_waits_for_its_clients),
    };
    return cmocka_run_group_tests_name("replay clients", tests, make_file, remove_file);
}
