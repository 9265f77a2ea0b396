/* SPDX-License-Identifier: MIT */
/* A recording is replayed, without threads: the times at which its frames are sent, and commands. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/replay/replay_state.h"
#include "tests/unit/file_rig.h"
#include "tests/unit/event_recording.h"

/* ---- ticks */

enum { EVENTS = 6, TICK_NS = 1000000, MOST = 40 };

static struct config *config_new(void)
{
    struct config *cfg = calloc(1, sizeof *cfg);
    assert_non_null(cfg);
    cfg->loop.tick_hz = 1e9 / TICK_NS;
    return cfg;
}

static struct {
    uint64_t tick;
    struct native_header header;
} played[MOST];

/* Plays from a tick on, until the end or `most` frames. Returns how many were sent. */
static int play(const struct replay_options *given, uint64_t first_tick, int most)
{
    struct config *cfg = config_new();
    struct replay_options options = *given;
    options.path = file_path;
    options.start = 1;
    struct replay *r;
    struct ring_tick tick;
    struct sh_err err;
    if (replay_open(cfg, &options, &r, &err) != SH_OK) fail_msg("%s", err.text);
    int n = 0;
    for (uint64_t i = first_tick; n < most && replay_source.next(r, i, 0, 0, &tick) == LOOP_SOURCE_TICK; i++)
        for (uint32_t at = 0; at < tick.len && n < most; n++) {
            played[n].tick = i;
            native_read_header(tick.bytes + at, &played[n].header);
            at += (uint32_t)native_frame_len(tick.bytes + at);
        }
    replay_free(r);
    free(cfg);
    return n;
}

/* Frames are sent at the end of the tick that has their time; at half the speed, one tick later. Time that goes back by
 * more than a second is that of another head, whose first frame comes with the next tick. */
static void frames_go_out_in_their_ticks(void **state)
{
    (void)state;
    static const struct {
        int64_t event_ms[EVENTS];
        double speed;
        uint64_t after[EVENTS]; /* ticks after the first */
    } rows[] = {{{0, 0, 1, 2, 3, 10}, 1, {0, 0, 1, 2, 3, 10}},
                {{0, 0, 1, 2, 3, 10}, 2, {0, 0, 0, 1, 1, 5}},
                {{0, 0, 1, 2, 3, 10}, 0.5, {1, 1, 3, 5, 7, 21}},
                {{0, 5000, 4500, 5001, 3000, 3002}, 1, {0, 5000, 5000, 5001, 5002, 5004}}};
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        FILE *f = recording_begin(file_path);
        recording_put_head(f, "", 0);
        for (int i = 0; i < EVENTS; i++)
            recording_put_event(f, NATIVE_EV_CONTROL, rows[k].event_ms[i] * TICK_NS);
        recording_end(f);
        for (uint64_t first = 0; first < 200; first += 77) {
            assert_int_equal(play(&(struct replay_options){.speed = rows[k].speed}, first, MOST), 1 + EVENTS);
            for (int i = 0; i < EVENTS; i++)
                if (played[1 + i].tick != first + rows[k].after[i])
                    fail_msg("row %zu, event %d: tick %llu after the first, not %llu", k, i,
                             (unsigned long long)(played[1 + i].tick - first), (unsigned long long)rows[k].after[i]);
        }
    }
}

/* Each round of a repeated recording has a sequence of its own. Frames for one reader have no number. */
static void each_time_has_its_numbers(void **state)
{
    (void)state;
    uint8_t frame[256];
    const struct native_event local = {.code = NATIVE_EV_READER_LOST};
    FILE *f = recording_begin(file_path);
    recording_put_head(f, "", 0);
    recording_put_event(f, NATIVE_EV_CONTROL, 0);
    recording_put_event(f, NATIVE_EV_CONTROL, 2 * TICK_NS);
    const size_t len = native_encode_event(frame, sizeof frame, &local, 2 * TICK_NS, NATIVE_LOCAL);
    assert_int_equal(fwrite(frame, 1, len, f), len);
    recording_end(f);
    assert_int_equal(play(&(struct replay_options){.speed = 1, .loop = 1}, 0, 12), 12);
    uint32_t last = 0;
    for (int i = 0; i < 12; i++) {
        const struct native_header *h = &played[i].header;
        if (i % 4 == 3) {
            assert_true((h->flags & NATIVE_LOCAL) != 0 && h->seq == 0);
            continue;
        }
        const uint32_t step = i != 0 && i % 4 == 0 ? 1 - (UINT32_C(1) << 30) : 1; /* far back: a restart */
        assert_int_equal(h->seq, i == 0 ? 0 : last + step);
        last = h->seq;
    }
}

/* A recording that begins within a scan has only repetitions of its descriptor. When it begins anew, its readers get
 * one that holds at once, which is for them alone. */
static void a_new_round_begins_with_the_head(void **state)
{
    (void)state;
    FILE *f = recording_begin(file_path);
    recording_put_head(f, "", NATIVE_REPEAT);
    recording_put_event(f, NATIVE_EV_CONTROL, TICK_NS);
    recording_end(f);
    static const uint8_t flags[] = {NATIVE_REPEAT, 0, NATIVE_LOCAL, NATIVE_REPEAT, 0, NATIVE_LOCAL, NATIVE_REPEAT};
    assert_int_equal(play(&(struct replay_options){.speed = 1, .loop = 1}, 0, 7), 7);
    for (int i = 0; i < 7; i++)
        if (played[i].header.flags != flags[i]) fail_msg("frame %d: %d", i, played[i].header.flags);
}

/* A part goes from 5 ms to 12 ms, both included. A reader first gets the head's description. */
static void a_part_begins_with_the_head(void **state)
{
    (void)state;
    event_recording_write(file_path, 20);
    const int n = play(&(struct replay_options){.speed = 1, .from_s = 0.005, .to_s = 0.012}, 3, MOST);
    assert_int_equal(n, 1 + 8);
    assert_int_equal(played[0].header.type, NATIVE_DESCRIPTOR);
    assert_int_equal(played[0].header.flags, NATIVE_REPEAT | NATIVE_LOCAL);
    for (int i = 0; i < n - 1; i++) {
        assert_int_equal(played[1 + i].header.type, NATIVE_EVENT);
        assert_int_equal(played[1 + i].header.t_ns, (5 + i) * TICK_NS);
        assert_int_equal(played[1 + i].tick, 3 + i);
    }
}

/* Plays one tick. Returns the times of its events in ms, one after the other; D is a repeated descriptor. */
static const char *tick_of_replay(struct replay *r, uint64_t i)
{
    static char text[256];
    struct ring_tick tick;
    struct native_header h;
    text[0] = '\0';
    assert_int_equal(replay_source.next(r, i, 0, 0, &tick), LOOP_SOURCE_TICK);
    for (uint32_t at = 0; at < tick.len; at += (uint32_t)native_frame_len(tick.bytes + at)) {
        const size_t len = strlen(text);
        native_read_header(tick.bytes + at, &h);
        if (h.type == NATIVE_EVENT)
            snprintf(text + len, sizeof text - len, "%lld ", (long long)h.t_ns / TICK_NS);
        else if ((h.flags & NATIVE_LOCAL) != 0)
            snprintf(text + len, sizeof text - len, "D ");
    }
    return text;
}

static const char *said(struct replay *r, const char *line)
{
    static struct command_result result;
    replay_source.command(r, 1, line, 0, &result);
    return result.reply;
}

static struct replay *open_replay(struct config *cfg, const struct replay_options *options)
{
    struct replay *r;
    struct sh_err err;
    if (replay_open(cfg, options, &r, &err) != SH_OK) fail_msg("%s", err.text);
    return r;
}

/* SCAN:REPLay: another time, another speed, a pause, a loop. */
static void a_command_seeks_paces_and_loops(void **state)
{
    (void)state;
    static const struct {
        uint64_t tick;
        const char *line, *events;
    } rows[] = {{0, "", "0 "},
                {1, "", "1 "},
                {2, "SCAN:REPL 0.012", "D 12 "}, /* a reader needs the descriptor that it was not sent */
                {3, "SCAN:REPL ,0", ""},
                {4, "", ""},
                {5, "SCAN:REPL ,2", "13 14 "},
                {6, "", "15 16 "},
                {7, "SCAN:REPL 0.019 , 0.5 , ON", "D "}, /* at half the speed each takes two ticks */
                {8, "", "19 "},
                {9, "SCAN:REPL ,1", "0 "}, /* anew, by the loop */
                {10, "SCAN:REPL ,,OFF", "1 "},
                {11, "SCAN:REPL 0", "0 "},
                {12, "", "1 "}};
    struct config *cfg = config_new();
    event_recording_write(file_path, 20);
    const struct replay_options options = {.path = file_path, .speed = 1, .start = 1};
    struct replay *r = open_replay(cfg, &options);
    assert_string_equal(said(r, "SCAN:REPL?"), "PLAYING,0.000000,0.019000,1,OFF");
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        if (rows[i].line[0] != '\0') assert_string_equal(said(r, rows[i].line), "OK");
        const char *events = tick_of_replay(r, rows[i].tick);
        if (strcmp(events, rows[i].events) != 0)
            fail_msg("tick %zu, %s: '%s', wanted '%s'", i, rows[i].line, events, rows[i].events);
    }
    assert_string_equal(said(r, "SCAN:REPL?"), "PLAYING,0.001000,0.019000,1,OFF");
    struct ring_tick last;
    for (uint64_t tick = 13; replay_source.next(r, tick, 0, 0, &last) == LOOP_SOURCE_TICK; tick++) {
    } /* it was begun with --start, and ends with the recording */
    assert_string_equal(said(r, "SCAN:REPL?"), "IDLE,0.019000,0.019000,1,OFF");
    replay_free(r);
    free(cfg);
}

/* Ticks are made ahead, and none of them is released. The state follows commands at once. */
static void a_command_is_seen_at_once(void **state)
{
    (void)state;
    static const struct {
        uint64_t tick;
        const char *line, *before, *after; /* `after`: when the tick is made */
    } rows[] = {{0, "SCAN:START", "spin-up", "spin-up"},
                {1, "SCAN:STOP", "spin-down", "spin-down"},
                {2, "SCAN:START", "spin-up", "spin-up"},
                {3, "*RST", "spin-down", "spin-down"},
                {4, "SCAN:REPL 0.003", "spin-up", "spin-up"}};
    struct config *cfg = config_new();
    event_recording_write(file_path, 20);
    const struct replay_options options = {.path = file_path, .speed = 1};
    struct replay *r = open_replay(cfg, &options);
    struct ring_tick tick;
    assert_string_equal(said(r, "HEAD:STATE?"), "idle");
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        assert_string_equal(said(r, rows[i].line), "OK");
        assert_string_equal(said(r, "HEAD:STATE?"), rows[i].before);
        const int plays = strcmp(rows[i].before, "spin-up") == 0;
        assert_memory_equal(said(r, "SCAN:REPL?"), plays ? "PLAYING," : "IDLE,", plays ? 8 : 5);
        if (!plays) assert_string_equal(said(r, rows[i].line), "OK"); /* once more is no error */
        assert_int_equal(replay_source.next(r, rows[i].tick, 0, 0, &tick), LOOP_SOURCE_TICK);
        assert_string_equal(said(r, "HEAD:STATE?"), rows[i].after);
    }
    struct command_result released;
    replay_source.command(r, 1, "HEAD:STATE?", 9, &released);
    assert_string_equal(released.reply, "scanning");
    replay_source.command(r, 1, "SCAN:STOP", 9, &released);
    replay_source.command(r, 1, "HEAD:STATE?", 9, &released);
    assert_string_equal(released.reply, "spin-down");
    assert_int_equal(replay_source.next(r, 10, 0, 0, &tick), LOOP_SOURCE_TICK);
    replay_source.command(r, 1, "HEAD:STATE?", 9, &released);
    assert_string_equal(released.reply, "spin-down");
    replay_source.command(r, 1, "HEAD:STATE?", 11, &released);
    assert_string_equal(released.reply, "idle");
    replay_free(r);
    free(cfg);
}

/* At the pace fast a paused recording makes no ticks. It makes the one that ends its scan. */
static void a_paused_recording_can_be_stopped(void **state)
{
    (void)state;
    struct config *cfg = config_new();
    event_recording_write(file_path, 20);
    const struct replay_options options = {.path = file_path, .speed = 1};
    struct replay *r = open_replay(cfg, &options);
    struct command_result result;
    struct ring_tick tick;
    assert_string_equal(said(r, "SCAN:REPL 0,1"), "OK");
    assert_string_equal(tick_of_replay(r, 0), "0 ");
    assert_string_equal(said(r, "SCAN:REPL ,0"), "OK");
    assert_int_equal(replay_source.next(r, 1, 1, 0, &tick), LOOP_SOURCE_IDLE);
    assert_string_equal(said(r, "SCAN:STOP"), "OK");
    assert_int_equal(replay_source.next(r, 1, 1, 0, &tick), LOOP_SOURCE_TICK);
    assert_int_equal(replay_source.next(r, 2, 1, 0, &tick), LOOP_SOURCE_IDLE);
    replay_source.command(r, 1, "HEAD:STATE?", 2, &result);
    assert_string_equal(result.reply, "idle");
    replay_free(r);
    free(cfg);
}

/* Two commands between two ticks do what they would do with a tick between them. */
static void the_last_of_two_commands_decides(void **state)
{
    (void)state;
    static const struct {
        const char *line[2], *events, *next;
        int is_over; /* the last frame was sent before, and a loop is to begin anew */
    } rows[] = {{{"SCAN:STOP", "SCAN:REPL 0.012"}, "D 12 ", "13 ", 0},
                {{"*RST", "SCAN:REPL 0.012"}, "D 12 ", "13 ", 0},
                {{"SCAN:STOP", "SCAN:STAR"}, "0 ", "1 ", 0},
                {{"SCAN:REPL 0.012", "SCAN:STAR"}, "0 ", "1 ", 0},
                {{"SCAN:REPL 0.012", "SCAN:REPL 0.003"}, "D 3 ", "4 ", 0},
                {{"SCAN:STAR", "SCAN:REPL 0.012"}, "D 12 ", "13 ", 0},
                {{"SCAN:REPL 0.012", "SCAN:STOP"}, "", "", 0},
                {{"SCAN:REPL 0.012", "*RST"}, "", "", 0},
                {{"SCAN:STAR", "SCAN:STOP"}, "", "", 0},
                {{"SCAN:STOP", "SCAN:REPL ,2"}, "", "", 0}, /* without a time it starts nothing */
                {{"SCAN:REPL ,0", "SCAN:STAR"}, "", "", 0}, /* it is paused */
                {{"SCAN:REPL ,0", "SCAN:REPL ,1"}, "2 ", "3 ", 0},
                {{"SCAN:REPL ,2", "SCAN:STOP"}, "", "", 0},
                {{"SCAN:STOP", "SCAN:REPL 0.012"}, "D 12 ", "13 ", 1},
                {{"SCAN:REPL 0.012", "SCAN:STOP"}, "", "", 1},
                {{"SCAN:REPL ,2", "SCAN:STOP"}, "", "", 1},
                {{"SCAN:REPL ,2", "SCAN:REPL ,,OFF"}, "", "", 1},
                {{"SCAN:REPL ,,OFF", "SCAN:REPL ,,ON"}, "", "", 1}, /* the loop was off: it is over */
                {{"SCAN:REPL ,1", "SCAN:REPL ,,ON"}, "0 ", "1 ", 1}};
    struct config *cfg = config_new();
    event_recording_write(file_path, 20);
    const struct replay_options options = {.path = file_path, .speed = 1};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct replay *r = open_replay(cfg, &options);
        assert_string_equal(said(r, rows[i].is_over ? "SCAN:REPL 0.018,1,ON" : "SCAN:REPL 0,1,ON"), "OK");
        assert_string_equal(tick_of_replay(r, 0), rows[i].is_over ? "D 18 " : "0 ");
        assert_string_equal(tick_of_replay(r, 1), rows[i].is_over ? "19 " : "1 ");
        for (int k = 0; k < 2; k++)
            assert_string_equal(said(r, rows[i].line[k]), "OK");
        for (uint64_t k = 0; k < 2; k++) {
            const char *events = tick_of_replay(r, 2 + k), *wanted = k == 0 ? rows[i].events : rows[i].next;
            if (strcmp(events, wanted) != 0)
                fail_msg("row %zu, %s then %s: '%s', wanted '%s'", i, rows[i].line[0], rows[i].line[1], events, wanted);
        }
        assert_string_equal(said(r, "SYST:ERR:COUN?"), "0");
        replay_free(r);
    }
    free(cfg);
}

/* A part ends 0.5 ms after its last frame. A seek to a time between these two goes to the end, where a loop begins
 * anew. */
static void a_seek_to_the_end_of_a_part_is_its_end(void **state)
{
    (void)state;
    struct config *cfg = config_new();
    event_recording_write(file_path, 20);
    const struct replay_options options = {.path = file_path, .speed = 1, .to_s = 0.0125};
    struct replay *r = open_replay(cfg, &options);
    assert_string_equal(said(r, "SCAN:REPL 0.0124,1,ON"), "OK");
    assert_string_equal(tick_of_replay(r, 0), "");
    assert_string_equal(tick_of_replay(r, 1), "0 ");
    replay_free(r);
    free(cfg);
}

/* A recording may have any bytes as the head's name: a line end, or 0xd5, which begins a frame. */
static void its_name_is_a_line(void **state)
{
    (void)state;
    struct config *cfg = config_new();
    FILE *f = recording_begin(file_path);
    recording_put_head(f, "Maker,Mo\r\ndel,\xd5,1", 0);
    recording_put_event(f, NATIVE_EV_CONTROL, 0);
    recording_end(f);
    const struct replay_options options = {.path = file_path, .speed = 1};
    struct replay *r = open_replay(cfg, &options);
    assert_string_equal(said(r, "*IDN?"), "Maker,Mo~~del,~,1");
    assert_string_equal(cfg->profile.model, "Mo~~del");
    replay_free(r);
    free(cfg);
}

static void what_a_replay_refuses(void **state)
{
    (void)state;
    static const struct {
        const char *line, *error, *words;
    } rows[] = {{"SCAN:REPL", "ERR -109", "time, speed or loop"},
                {"SCAN:REPL 0.0021", "ERR -222", "allowed 0 to 0.002"},
                {"SCAN:REPL -1", "ERR -222", "allowed 0 to 0.002"},
                {"SCAN:REPL ,1001", "ERR -222", "allowed 0 to 1000"},
                {"SCAN:REPL ,0.009", "ERR -222", "0.01 to 1000"},
                {"SCAN:REPL now", "ERR -104", "'now'"},
                {"SCAN:REPL 0 S", "ERR -104", "'0 S'"},
                {"SCAN:REPL 0,1,AGAIN", "ERR -104", "ON or OFF"},
                {"SCAN:REPL ,1.0000000000000000000000000000000000000000000000000000000000000e2", "ERR -222",
                 "a value has 65 characters, allowed up to 63"}, /* cut off it would be 1 */
                {"SCAN:REPL 0,1,ON,1", "ERR -108", "takes a time"},
                {"SCAN:REPL? 1", "ERR -108", ""}};
    struct config *cfg = config_new();
    event_recording_write(file_path, 3);
    struct replay_options options = {.path = file_path, .speed = 1};
    struct replay *r = open_replay(cfg, &options);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const char *reply = said(r, rows[i].line);
        if (strncmp(reply, rows[i].error, strlen(rows[i].error)) != 0 || strstr(reply, rows[i].words) == NULL)
            fail_msg("%s: %s", rows[i].line, reply);
    }
    assert_string_equal(said(r, "SCAN:REPL?"), "IDLE,0.000000,0.002000,1,OFF");
    replay_free(r);
    cfg->loop.pace = PACE_FAST;
    r = open_replay(cfg, &options);
    assert_int_equal(strncmp(said(r, "SCAN:REPL ,0"), "ERR -221", 8), 0); /* such a pace has one speed */
    assert_string_equal(said(r, "SCAN:REPL ,1"), "OK");
    replay_free(r);
    free(cfg);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_go_out_in_their_ticks),
        cmocka_unit_test(each_time_has_its_numbers),
        cmocka_unit_test(a_part_begins_with_the_head),
        cmocka_unit_test(its_name_is_a_line),
        cmocka_unit_test(a_command_seeks_paces_and_loops),
        cmocka_unit_test(a_command_is_seen_at_once),
        cmocka_unit_test(a_paused_recording_can_be_stopped),
        cmocka_unit_test(the_last_of_two_commands_decides),
        cmocka_unit_test(what_a_replay_refuses),
        cmocka_unit_test(a_new_round_begins_with_the_head),
        cmocka_unit_test(a_seek_to_the_end_of_a_part_is_its_end),
    };
    return cmocka_run_group_tests_name("replay state", tests, make_file, remove_file);
}
