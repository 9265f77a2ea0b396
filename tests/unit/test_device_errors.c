/* SPDX-License-Identifier: MIT */
/* Events of errors: their number is limited, and none is forgotten. */
#include "firmware_sim/device/device_state.h"
#include "tests/unit/device_rig.h"

/* A tick holds 24 events. The errors of a client that sends them all the time must not displace the scan's end. */
static void the_last_events_are_said_however_many(void **state)
{
    (void)state;
    struct rig *rig = rig_open(&(struct device_options){.start = 1, .one_scan = 1}, NULL, 0);
    struct command_result result;
    rig_go_to(rig, 230 + 499);
    for (int i = 0; i < 100; i++)
        device_command(rig->device, 1, "nonsense", rig->next, &result);
    uint64_t single = 0, held = 0, ends = 0;
    while (rig_claim(rig))
        for (uint32_t i = 0; i < rig->work.n_events; i++) {
            const struct native_event *event = &rig->work.event[i];
            ends += event->code == NATIVE_EV_SCAN_END;
            if (event->code != NATIVE_EV_ERROR) continue;
            assert_true(event->b == 1 && (int64_t)event->a == CMD_E_HEADER);
            single += event->c == 0;
            held += event->c;
        }
    assert_int_equal(single, 10);
    assert_int_equal(held, 90); /* reported though the second was not over */
    assert_int_equal(ends, 1);
    rig_close(rig);
}

/* Each session has ten errors in a second of its own. A second later the held back ones are counted, and there is room
 * for ten more. */
static void errors_are_held_back_by_session(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    struct command_result result;
    uint64_t single[3] = {0}, held[3] = {0}, events = 0;
    for (uint64_t tick = 0; tick < 3500; tick++) {
        for (uint32_t session = 1; session <= 2 && tick < 2000; session++)
            if (session == 1 || tick % 150 == 0) device_command(rig->device, session, "nonsense", tick, &result);
        assert_true(rig_claim(rig));
        for (uint32_t i = 0; i < rig->work.n_events; i++) {
            const struct native_event *event = &rig->work.event[i];
            if (event->code != NATIVE_EV_ERROR) continue;
            assert_in_range(event->b, 1, 2);
            single[event->b] += event->c == 0;
            held[event->b] += event->c;
            events++;
        }
    }
    assert_true(single[2] == 14 && held[2] == 0); /* a session with few errors is not affected, however long */
    assert_int_equal(single[1] + held[1], 2000);
    assert_in_range(events - 14, 2 * 11, 3 * 11);
    rig_close(rig);
}

static void keep_warning(void *ctx, const char *text)
{
    strcpy(ctx, text); /* sh_warn has 512 bytes */
}

/* A journal has only commands that had an effect. Where the head refuses some of them, the replay differs from the
 * session. One warning says so, with the first of them. */
static void a_replay_says_what_it_refused(void **state)
{
    (void)state;
    static const struct {
        const char *lines, *says; /* says NULL: nothing */
    } cases[] = {{"300 300000000 1 HEAD:LINES 50\n", NULL},
                 {"300 300000000 1 HEAD:LINES 50\n301 301000000 1 HEAD:LINES 99999\n302 302000000 2 BLAH\n",
                  ":3: HEAD:LINES 99999: ERR -222"},
                 {"0 300000000 0 POSE 1 2 3 4 5 6\n", ":2: POSE 1 2 3 4 5 6: a pose needs platform.kind: live"},
                 {"300 300000000 1 SITE:POSE 1, 0,0,-1.9,0,0,0\n", /* only planning shows that it can't stand there */
                  ":2: SITE:POSE 1, 0,0,-1.9,0,0,0: ERR -221"}};
    static const char *const sets[] = {"stations[0].tripod.leg_m=2.5", "stations[0].tripod.head_above_m=0.2"};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char warned[512] = "";
        const struct sh_report report = {.ctx = warned, .warn = keep_warning};
        FILE *f = fopen(journal_path, "w");
        assert_non_null(f);
        fprintf(f, "# scanhead journal 1\n%s", cases[i].lines);
        assert_int_equal(fclose(f), 0);
        struct rig *rig = rig_open(&(struct device_options){.replay = journal_path, .report = &report}, sets, 2);
        rig_go_to(rig, 400);
        rig_close(rig);
        if (cases[i].says == NULL ? warned[0] != '\0' : strstr(warned, cases[i].says) == NULL) fail_msg("%s", warned);
        if (i == 1) assert_non_null(strstr(warned, "of 3 replayed commands the head refused 2"));
    }
}

/* While a journal still has commands, only the journal moves stations. After its last command clients may, whether
 * the journal has an END or none. */
static void clients_move_after_a_journals_last_command(void **state)
{
    (void)state;
    static const char *const ends[] = {"", "400 400000000 0 END\n"};
    for (int i = 0; i < 2; i++) {
        struct command_result result;
        FILE *f = fopen(journal_path, "w");
        assert_non_null(f);
        fprintf(f, "# scanhead journal 1\n310 310000000 1 SITE:POSE 1, 2,0,0,0,0,0\n%s", ends[i]);
        assert_int_equal(fclose(f), 0);
        struct rig *rig = rig_open(&(struct device_options){.replay = journal_path}, NULL, 0);
        rig_go_to(rig, 305);
        device_command(rig->device, 1, "SITE:POSE 1, 3,0,0,0,0,0", rig->next, &result);
        assert_non_null(strstr(result.reply, "a journal is being replayed"));
        rig_go_to(rig, 315);
        assert_string_equal(rig_tell(rig, "SITE:POSE? 1", rig->next), "2,0,0,0,0,0");
        device_command(rig->device, 1, "SITE:POSE 1, 3,0,0,0,0,0", rig->next, &result);
        assert_int_equal(result.effect, COMMAND_MOVE);
        device_plan_move(rig->device);
        device_finish_move(rig->device, rig->next, &result);
        assert_string_equal(rig_tell(rig, "SITE:POSE? 1", rig->next), "3,0,0,0,0,0");
        rig_close(rig);
    }
}

/* The error that the next query takes from the queue. */
static const char *next_error(struct rig *rig)
{
    static struct command_result result;
    device_command(rig->device, 7, "SYST:ERR?", rig->next, &result);
    return result.reply;
}

static void expect_error(struct rig *rig, int number, const char *text)
{
    char start[32];
    snprintf(start, sizeof start, "%d,", number);
    const char *error = next_error(rig);
    if (strncmp(error, start, strlen(start)) != 0 || strstr(error, text) == NULL)
        fail_msg("%s, not %s%s", error, start, text);
}

/* A client goes. The client's going is an error where it had control, or while a scan is on. Half a line is an
 * error by itself. */
static void a_client_that_goes_is_an_error_where_it_is_missed(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, 300);
    device_session_closed(rig->device, 2, "tcp 127.0.0.1:9", 0);
    expect_error(rig, 0, "");
    device_session_closed(rig->device, 2, "tcp 127.0.0.1:9", 1);
    expect_error(rig, CMD_E_PARTIAL, "session 2, tcp 127.0.0.1:9");
    expect_error(rig, 0, "");
    assert_true(rig_claim(rig));
    const struct native_event *event = rig_event(rig, NATIVE_EV_ERROR);
    assert_true(event != NULL && (int64_t)event->a == CMD_E_PARTIAL && event->b == 0);
    assert_null(rig_event(rig, NATIVE_EV_CONTROL));
    rig_tell(rig, "SCAN:START", 300); /* session 1 has control now */
    rig_wait(rig, NATIVE_EV_SCAN_START, 100);
    device_session_closed(rig->device, 2, "tcp 127.0.0.1:9", 0);
    expect_error(rig, CMD_E_CLIENT_LOST, "session 2, tcp 127.0.0.1:9");
    device_session_closed(rig->device, 1, "pty", 1);
    expect_error(rig, CMD_E_PARTIAL, "session 1, pty");
    expect_error(rig, CMD_E_CLIENT_LOST, "session 1, pty");
    expect_error(rig, 0, "");
    assert_true(rig_claim(rig));
    event = rig_event(rig, NATIVE_EV_CONTROL);
    assert_true(event != NULL && event->a == 0);
    assert_string_equal(event->text, "client gone");
    struct command_result result;
    device_command(rig->device, 3, "SCAN:STOP", rig->next, &result); /* control is free */
    assert_int_equal(result.error, 0);
    rig_close(rig);
}

static void a_line_that_is_too_long_is_an_error_of_its_session(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    struct command_result result;
    char text[64];
    snprintf(text, sizeof text, "session 5, longest line %d bytes", COMMAND_MAX_LINE);
    device_overlong(rig->device, 5, &result);
    assert_true(result.error == CMD_E_OVERRUN && strstr(result.reply, text) != NULL);
    expect_error(rig, CMD_E_OVERRUN, text);
    assert_true(rig_claim(rig));
    const struct native_event *event = rig_event(rig, NATIVE_EV_ERROR);
    assert_true(event != NULL && (int64_t)event->a == CMD_E_OVERRUN && event->b == 5);
    assert_string_equal(event->text, text);
    rig_close(rig);
}

/* Telemetry comes with each full second. Its figures are filled in for the end of a scan, too. Nothing is released
 * here, so all pulses that were cast count as lost. */
static void telemetry_has_the_figures_of_its_tick(void **state)
{
    (void)state;
    static const char *const sets[] = {"head.pan_deg_s=60"};
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, 1);
    struct device_counters *counters = device_counters(rig->device);
    struct command_result result;
    atomic_store(&counters->late_blocks, 5);
    atomic_store(&counters->late_max_ns, 1234999);
    atomic_store(&counters->lost_journal_lines, 3);
    atomic_store(&counters->lost_truth_lines, 4);
    device_report(rig->device, CMD_E_REFUSED, "once");
    device_command(rig->device, 1, "nonsense", 0, &result);
    rig_wait(rig, NATIVE_EV_SCAN_START, 1000);
    uint64_t cast = rig->work.n_cast, full = 0;
    int ends = 0;
    while (!ends) {
        assert_true(rig_claim(rig));
        const struct native_telemetry *t = &rig->work.telemetry_frame;
        cast += rig->work.n_cast;
        ends = rig_event(rig, NATIVE_EV_SCAN_END) != NULL;
        assert_int_equal(rig->work.telemetry != 0, rig->work.tick % 1000 == 0);
        if (!ends && !rig->work.telemetry) continue;
        full += rig->work.telemetry != 0;
        assert_int_equal(t->state, ends ? HEAD_SPIN_DOWN : HEAD_SCANNING);
        assert_true(t->scan == 1 && t->scan_fired == rig->work.pulse_end);
        assert_true(t->scan_cast == cast && t->scan_lost == cast && t->lost_pulses == cast);
        assert_true(t->late_blocks == 5 && t->late_max_us == 1234 && t->lost_lines == 7);
        assert_true(t->errors_queued >= 2 && t->utc_ns == 0);
    }
    assert_int_equal(full, 1); /* the scan is from 0.23 s to 1.73 s */
    rig_close(rig);
}

/* Settings that were accepted may fit no more when the scan begins. 31 bits of 1e-6 m end at 2147 m. */
static void a_scan_that_cannot_be_planned_is_a_fault(void **state)
{
    (void)state;
    static const char *const sets[] = {"output.layout=geo", "output.scale_m=1e-6"};
    struct rig *rig = rig_open(NULL, sets, 2);
    rig_go_to(rig, 300);
    rig->device->cmd.settings.range_max_nm = INT64_C(3000) * 1000000000;
    rig_tell(rig, "SCAN:START", 300);
    const struct native_event *error = rig_wait(rig, NATIVE_EV_ERROR, 100);
    assert_true((int64_t)error->a == CMD_E_SETTINGS && error->b == 0);
    assert_non_null(strstr(error->text, "output.scale_m"));
    for (int i = 0; i < 5; i++) {
        assert_null(rig_event(rig, NATIVE_EV_SCAN_START));
        assert_true(rig_claim(rig) && !rig->work.scanning);
    }
    assert_string_equal(rig_state(rig, rig->next), "fault");
    assert_int_equal(strncmp(rig_tell(rig, "SYST:ERR?", rig->next), "-221,\"Settings conflict; ", 25), 0);
    rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_scan_that_cannot_be_planned_is_a_fault),
        cmocka_unit_test(the_last_events_are_said_however_many),
        cmocka_unit_test(errors_are_held_back_by_session),
        cmocka_unit_test(a_replay_says_what_it_refused),
        cmocka_unit_test(clients_move_after_a_journals_last_command),
        cmocka_unit_test(a_client_that_goes_is_an_error_where_it_is_missed),
        cmocka_unit_test(a_line_that_is_too_long_is_an_error_of_its_session),
        cmocka_unit_test(telemetry_has_the_figures_of_its_tick),
    };
    return cmocka_run_group_tests_name("device errors", tests, make_folder, remove_folder);
}
