/* SPDX-License-Identifier: MIT */
/* Threads of links, casters and the player call these functions at any time, so each of them locks the shared state.
 * Two threads that meet without the lock rarely show it. So the test counts how often a call takes a lock, and that it
 * holds none at its end. */
#include "firmware_sim/config/config.h"
#include "firmware_sim/device/device_state.h"
#include "firmware_sim/device/settings_file.h"
#include "firmware_sim/fault/board.h"
#include "firmware_sim/loop/mover.h"
#include "firmware_sim/replay/replay_state.h"
#include "tests/unit/device_rig.h"
#include "tests/unit/event_recording.h"
#include "tests/unit/lock_rig.h"

/* ---- the device */

static void the_device_is_locked(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    struct device *d = rig->device;
    struct command_result result;
    static struct device_work work;
    struct device_time_server server;
    struct command_time_answers answers = {0};
    struct nmea_fix fix;
    struct sh_err err;
    const char *warning;
    uint8_t packet[NTP_LEN] = {0};
    uint32_t station;
    int64_t hour_ns;
    TAKES(1, device_power_up(d, 0, &warning, &err));
    TAKES(1, (device_command(d, 1, "*IDN?", 0, &result), 0));
    TAKES(1, (device_command_once(d, 1, "*IDN?", 0, &result), 0));
    TAKES(1, (device_report(d, CMD_E_REFUSED, "why"), 0));
    TAKES(1, (device_overlong(d, 1, &result), 0));
    TAKES(1, (device_session_opened(d, 1, "who"), 0));
    TAKES(1, (device_session_closed(d, 1, "who", 0), 0));
    TAKES(2, (device_session_closed(d, 1, "who", 1), 0)); /* once more for the error */
    TAKES(1, (device_describe_now(d, &work), 0));
    TAKES(1, device_claim(d, &work));
    TAKES(1, (device_lost(d, &work), 0));
    device_done(&work);
    TAKES(1, device_is_idle(d));
    TAKES(1, device_settles(d));
    TAKES(1, device_last_scan(d, &station));
    TAKES(1, device_scan_ns(d));
    TAKES(1, device_rests_from(d));
    TAKES(1, (device_last_power(d, 0), 0));
    TAKES(1, device_window_loss_db(d));
    TAKES(1, device_date_ns(d, 0));
    TAKES(1, (device_get_time_server(d, &server), 0));
    TAKES(1, device_shift_date(d, &server, 5));
    TAKES(1, device_change_time_answer(d, 0, packet));
    TAKES(1, (device_put_time_answers(d, &answers, NULL), 0));
    TAKES(2, (device_put_time_answers(d, &answers, "why"), 0)); /* once more for the report */
    TAKES(1, (device_watch_time_server(d, -1), 0));
    TAKES(1, device_pps(d, 0, &hour_ns));
    TAKES(1, device_next_fix_ns(d, 0));
    TAKES(1, device_fix(d, -1, &fix)); /* there is none yet */
    TAKES(1, (device_end(d), 0));
    rig_close(rig);
}

/* A station's move: begun, planned without the lock, taken and ended. */
static void a_move_is_locked(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    struct device *d = rig->device;
    struct command_result result;
    struct device_version *version;
    rig_go_to(rig, 230);
    TAKES(1, (device_command(d, 1, "SITE:POSE 1, 0.1,0,0,0,0,0", rig->next, &result), 0));
    assert_int_equal(result.effect, COMMAND_MOVE);
    TAKES(0, (device_plan_move(d), 0));
    TAKES(2, (device_finish_move(d, rig->next, &result), 0)); /* it is taken, and it ends */
    TAKES(1, device_hold_site(d, &version));
    device_give_back(version);
    TAKES(1, device_hold_scan(d, 1, &version));
    device_give_back(version);
    rig_close(rig);
}

/* A tick that replays a move takes the lock four times: at first, once the move is planned, to end the move, and to go
 * on after that. */
static void a_replayed_move_is_locked(void **state)
{
    (void)state;
    FILE *f = fopen(journal_path, "w");
    assert_non_null(f);
    fputs("# scanhead journal 1\n310 310000000 1 SITE:POSE 1, 0.1,0,0,0,0,0\n", f);
    assert_int_equal(fclose(f), 0);
    struct rig *rig = rig_open(&(struct device_options){.replay = journal_path}, NULL, 0);
    rig_go_to(rig, 309);
    TAKES(1, device_claim(rig->device, &rig->work));
    device_done(&rig->work);
    TAKES(4, device_claim(rig->device, &rig->work));
    device_done(&rig->work);
    assert_string_equal(rig_tell(rig, "SITE:POSE? 1", 310), "0.1,0,0,0,0,0");
    rig_close(rig);
    unlink(journal_path);
}

static void the_head_follows_a_pose_with_its_lock(void **state)
{
    (void)state;
    static const char *const sets[] = {"platform.kind=live"};
    static const double pose[6] = {0, 0, 0, 0, 0, 0};
    struct rig *rig = rig_open(NULL, sets, 1);
    TAKES(1, device_pose(rig->device, 1000000, pose, NULL));
    rig_close(rig);
}

/* ---- the list of faults */

static void the_faults_are_locked(void **state)
{
    (void)state;
    static const struct fault_list none;
    static struct fault_entry entries[FAULT_KEPT];
    static const struct fault fault = {.kind = FAULT_DROP};
    const struct fault_note note = {.number = 1};
    _Atomic uint64_t lost = 0;
    struct fault_board *board;
    struct sh_err err;
    uint32_t n, number;
    need(fault_board_create(&none, NULL, &lost, &board, &err), &err);
    TAKES(1, fault_board_add(board, &fault, 0, &number, &err));
    TAKES(1, fault_board_copy(board, entries, &n));
    TAKES(1, fault_board_copy_all(board, entries, &n));
    TAKES(1, fault_board_last(board));
    TAKES(1, (fault_board_note(board, &note), 0));
    TAKES(1, fault_board_injected(board, number));
    TAKES(1, fault_board_end(board, number, 5));
    fault_board_free(board);
}

/* With a file of the truth a note takes three locks: the board's, the file's, and that of its queue. */
static void notes_of_faults_are_locked(void **state)
{
    (void)state;
    static const struct fault_list none;
    const struct fault_note note = {.number = 1};
    _Atomic uint64_t lost = 0;
    struct fault_board *board;
    struct sh_err err;
    need(fault_board_create(&none, journal_path, &lost, &board, &err), &err);
    TAKES(3, (fault_board_note(board, &note), 0));
    need(fault_board_close(board, &err), &err);
    fault_board_free(board);
    unlink(journal_path);
}

/* ---- what other threads write and plan */

static void stored_settings_are_locked(void **state)
{
    (void)state;
    char text[SETTINGS_FILE_TEXT];
    struct settings_file *file;
    struct sh_err err;
    need(settings_file_open(journal_path, "head", NULL, &file, &err), &err);
    TAKES(1, settings_file_put(file, "head", "a 1\n"));
    TAKES(1, (settings_file_get(file, "head", text), 0));
    assert_string_equal(text, "a 1\n");
    TAKES(1, settings_file_close(file, &err));
    unlink(journal_path);
}

/* After the end a move is carried out by the thread that asks. It takes the box's lock, two of the device, and the
 * reply's. */
static void replies_of_moves_are_locked(void **state)
{
    (void)state;
    static struct mover mover;
    static struct stream stream;
    struct rig *rig = rig_open(NULL, NULL, 0);
    struct command_result result;
    struct move_box box = {.ticket = 0};
    char reply[COMMAND_MAX_REPLY];
    wakeup_create(&stream.work);
    wakeup_create(&stream.pace);
    mover_create(&mover, rig->device, &stream);
    rig_go_to(rig, 230);
    device_command(rig->device, 1, "SITE:POSE 1, 0.1,0,0,0,0,0", rig->next, &result);
    assert_int_equal(result.effect, COMMAND_MOVE);
    TAKES(2, (mover_join(&mover), 0)); /* and the device's, which ends */
    TAKES(4, (mover_ask(&mover, &box, -1), 0));
    TAKES(1, mover_take(&mover, &box, reply));
    wakeup_free(&stream.work);
    wakeup_free(&stream.pace);
    rig_close(rig);
}

/* ---- a recording */

static char recording_path[] = "/tmp/scanhead-locks-XXXXXX";

static void a_recording_is_locked(void **state)
{
    (void)state;
    struct config *cfg = calloc(1, sizeof *cfg);
    struct replay *r;
    struct sh_err err;
    struct command_result result;
    struct ring_tick tick;
    struct replay_summary summary;
    struct nmea_fix fix;
    int64_t hour_ns;
    assert_non_null(cfg);
    cfg->loop.tick_hz = 1000;
    close(mkstemp(recording_path));
    event_recording_write(recording_path, 20);
    const struct replay_options options = {.path = recording_path, .speed = 1, .start = 1};
    need(replay_open(cfg, &options, &r, &err), &err);
    TAKES(1, (replay_source.session_opened(r, 1, "who"), 0));
    TAKES(1, (replay_source.command(r, 1, "*IDN?", 0, &result), 0));
    TAKES(1, (replay_source.command_once(r, 1, "*IDN?", 0, &result), 0));
    TAKES(1, (replay_source.overlong(r, 1, &result), 0));
    TAKES(1, (replay_source.report(r, CMD_E_REFUSED, "why"), 0));
    TAKES(1, replay_source.rests_from(r));
    TAKES(1, replay_source.scans(r));
    TAKES(1, replay_source.date_ns(r, 0));
    TAKES(1, replay_source.pps(r, 0, &hour_ns));
    TAKES(1, replay_source.next_fix_ns(r, 0));
    TAKES(1, replay_source.fix(r, 0, &fix));         /* it has no time of day, and so no fix */
    TAKES(4, replay_source.next(r, 0, 0, 0, &tick)); /* wishes, the beginning, the descriptor and an event */
    TAKES(2, replay_source.next(r, 1, 0, 0, &tick)); /* wishes, an event */
    TAKES(1, (replay_pace(r, 2), 0));
    TAKES(1, (replay_source.session_closed(r, 1, "who", 0), 0));
    TAKES(1, (replay_source.session_over(r), 0));
    TAKES(1, (replay_get_summary(r, &summary), 0));
    r->begin_s = 0.019; /* its end, which is no failure */
    r->cmd.replay.length_s = 0.019;
    r->options.to_s = 0.01;
    TAKES(2, (replay_begin(r, 5), 0)); /* the position, and the stop */
    r->begin_s = 100;                  /* there is nothing */
    TAKES(2, (replay_begin(r, 6), 0)); /* the stop, and the failure */
    assert_int_equal(replay_check(r, &err), SH_EINPUT);
    TAKES(1, (replay_stop(r, 7, 0), 0));
    TAKES(1, (replay_source.end(r), 0));
    replay_free(r);
    free(cfg);
    unlink(recording_path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_device_is_locked),       cmocka_unit_test(a_move_is_locked),
        cmocka_unit_test(a_replayed_move_is_locked),  cmocka_unit_test(the_head_follows_a_pose_with_its_lock),
        cmocka_unit_test(the_faults_are_locked),      cmocka_unit_test(notes_of_faults_are_locked),
        cmocka_unit_test(stored_settings_are_locked), cmocka_unit_test(replies_of_moves_are_locked),
        cmocka_unit_test(a_recording_is_locked),
    };
    return cmocka_run_group_tests_name("locks", tests, make_folder, remove_folder);
}
