/* SPDX-License-Identifier: MIT */
/* Carries out commands, writes them to the journal, and replays them from one. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/device/device_state.h"

_Static_assert((int)COMMAND_MAX_LINE == (int)NATIVE_MAX_COMMAND, "clients send what the head takes, and no more");
_Static_assert((int)COMMAND_PEERS == (int)DEVICE_MAX_SESSIONS + 1, "each session has a place for its client's name");

/* Gives a scan those of the present settings that may change within it. A step of the next scan stays away, and so do
 * the rates that go with that step. */
static void take_settings(struct head_settings *scan, const struct head_settings *present)
{
    const struct head_settings was = *scan;
    *scan = *present;
    if (present->step_udeg == was.step_udeg) return;
    scan->step_udeg = was.step_udeg;
    scan->prr_uhz = was.prr_uhz;
    scan->lines_uhz = was.lines_uhz;
}

/* A scan may be on although clients see a state that allows settings of the next scan. A stopped scan has its last
 * pulses in the next tick. A scan from power-up (--start) is claimed ahead of the boot's end. */
static void change_settings(struct device *device, const struct command_result *command)
{
    if (!device->scan.on || command->for_next_scan) return;
    struct schedule_spec spec;
    take_settings(&device->scan.settings, &device->cmd.settings);
    if (device->scan.settings.lines_uhz != device->scan.lines_uhz) device->beam.held_uhz = 0; /* until the next PPS */
    device_fill_spec(&device->beam, device->scan.site, &spec);
    schedule_change(&device->scan.segment, &device->scan.segment, &spec, device->scan.pulse_next);
    device->scan.describe = 1;
    device_push_event(&device->events, NATIVE_EV_SETTINGS, device->scan.pulse_next, 0, 0, "");
}

static void stop(struct device *device, enum head_event event, uint64_t tick)
{
    device->machine.n_stopped = device->machine.n_changes;
    if (device->scan.on)
        device->scan.stop_requested = 1; /* the next claim ends the scan, and then the state changes */
    else
        device_transition(device, event, tick);
}

static void carry_out(struct device *device, const struct command_result *command, uint64_t released)
{
    switch (command->effect) {
    case COMMAND_MOVE: /* the caller begins the move; change_settings does nothing where no scan is on */
    case COMMAND_SETTINGS:
        change_settings(device, command);
        break;
    case COMMAND_START:
        device_transition(device, HEAD_EV_START, released);
        break;
    case COMMAND_STOP:
        stop(device, HEAD_EV_STOP, released);
        break;
    case COMMAND_RESET:
        stop(device, HEAD_EV_RESET, released);
        device_say_time_server(device);
        break;
    case COMMAND_REBOOT:
        device->power.reboots = 1;
        break;
    case COMMAND_STORE:
        device_keep_settings(device);
        break;
    case COMMAND_RELEASE:
        device_push_event(&device->events, NATIVE_EV_CONTROL, 0, 0, 0, "released");
        break;
    case COMMAND_SERVER:
        device_say_time_server(device);
        break;
    case COMMAND_CLOCK:
    case COMMAND_STEP:
    case COMMAND_FAULTS:
    case COMMAND_REPLAY: /* a head refuses it */
    case COMMAND_NONE:
    case COMMAND_TAKE:
        break;
    }
}

/* Why a session can't move stations: a journal that is being replayed moves them itself. */
static const char *why_fixed(const struct device *device, uint32_t session)
{
    const int replays = device->journal.at < device->journal.n_replay;
    return session != 0 && replays ? "a journal is being replayed" : site_why_fixed(device->site);
}

/* Why a session can change nothing: its change would be gone with the power. NULL: it can. */
static const char *why_dead(const struct device *device, uint64_t released)
{
    if (device->power.reboots) return "the head reboots";
    return device_is_dead(device, released) ? "the head has no power" : NULL;
}

/* Takes over what a command that changes no setting has done to a copy of the device: to the error queue, and to
 * control, which it may have given back. Both hold until power goes. */
static void keep_beside_changes(struct device *device, const struct command_device *copy, uint32_t session,
                                const struct command_result *result)
{
    device->cmd.queue = copy->queue;
    if (result->error != 0)
        device_push_error(&device->events, session, result->error, command_error_text(result->error));
    if (result->effect != COMMAND_RELEASE) return;
    device->cmd.control = copy->control;
    carry_out(device, result, device->next_tick);
}

/* Answers a command while power is gone, or is about to go since HEAD:REBoot has been answered. The old sessions are
 * cut off when the tick without power is released. Meanwhile native sessions get no further answer; others have to
 * answer, and learn why a change is refused. In the pace `step` links are back at once, so that new sessions can come
 * while power is gone. The new sessions may send queries and steps. */
static void do_dead(struct device *device, uint32_t session, const char *line, const char *why,
                    struct command_result *out)
{
    struct command_device *cmd = malloc(sizeof *cmd);
    if (cmd == NULL) return;
    *cmd = device->cmd;
    cmd->faults = &fault_desk_queries; /* the copy must not change the device's own faults */
    if (!device->power.reboots) memset(&cmd->queue, 0, sizeof cmd->queue); /* without power it holds nothing */
    command_execute(cmd, session, line, out);
    const int is_act = out->changes || out->effect == COMMAND_TAKE;
    if (is_act && out->effect != COMMAND_STEP) {
        memset(out, 0, sizeof *out);
        command_refuse(cmd, CMD_E_SETTINGS, why, out);
    }
    if (device->power.reboots) keep_beside_changes(device, cmd, session, out);
    free(cmd);
}

static void push_control(struct device *device, uint32_t session)
{
    const char *peer = command_peer(&device->cmd, session);
    device_push_event(&device->events, NATIVE_EV_CONTROL, session, 0, 0, peer[0] != '\0' ? peer : "taken");
}

/* once: the session does not keep control. */
static void do_command(struct device *device, uint32_t session, const char *line, uint64_t released, int once,
                       struct command_result *out)
{
    struct command_device *cmd = &device->cmd;
    cmd->state = device_visible_state(device, released, &cmd->stops);
    cmd->t_ns = (int64_t)released * device->tick_ns;
    device->desk.now_ns = (int64_t)device->next_tick * device->tick_ns;
    cmd->fixed = why_fixed(device, session);
    cmd->poses_replayed = device_replays_poses(device);
    memcpy(cmd->pose_centre_m, device_reach_centre(device), sizeof cmd->pose_centre_m);
    /* HEAD:STORe of a journal (session 0) is not refused, though a replay stores nothing. */
    cmd->keeps = session == 0 || device->settings != NULL;
    cmd->lost_journal_lines = atomic_load(&device->counters.lost_journal_lines);
    cmd->lost_truth_lines = atomic_load(&device->counters.lost_truth_lines);
    device_set_time_texts(device);
    const char *dead = session != 0 ? why_dead(device, released) : NULL;
    if (dead != NULL) {
        const int is_cut_off = !device->power.reboots && released < device->power.off_tick;
        memset(out, 0, sizeof *out);
        if (once || !is_cut_off) do_dead(device, session, line, dead, out);
        return;
    }
    command_execute(cmd, session, line, out);
    if (out->took_control && once)
        cmd->control = 0;
    else if (out->took_control)
        push_control(device, session);
    if (out->error != 0)
        device_push_error(&device->events, session, out->error, command_error_text(out->error));
    else if (out->changes && device->journal.out != NULL && out->effect != COMMAND_STEP && out->effect != COMMAND_MOVE)
        journal_write(device->journal.out, device->next_tick, cmd->t_ns, session, line);
    if (out->error == 0) carry_out(device, out, released);
}

void device_carry_out_line(struct device *device, const char *line)
{
    struct command_result result;
    do_command(device, 0, line, device->next_tick, 0, &result);
}

void device_command(void *self, uint32_t session, const char *line, uint64_t released, struct command_result *out)
{
    struct device *device = self;
    pthread_mutex_lock(&device->lock);
    do_command(device, session, line, released, 0, out);
    if (out->effect == COMMAND_MOVE) device_begin_move(device, session, line, -1, out);
    pthread_mutex_unlock(&device->lock);
}

void device_command_once(void *self, uint32_t session, const char *line, uint64_t released, struct command_result *out)
{
    struct device *device = self;
    pthread_mutex_lock(&device->lock);
    do_command(device, session, line, released, 1, out);
    pthread_mutex_unlock(&device->lock);
}

void device_report(void *self, int number, const char *text)
{
    struct device *device = self;
    pthread_mutex_lock(&device->lock);
    command_queue_push(&device->cmd.queue, number, text);
    device_push_error(&device->events, 0, number, text);
    pthread_mutex_unlock(&device->lock);
}

void device_overlong(void *self, uint32_t session, struct command_result *out)
{
    struct device *device = self;
    char text[96];
    snprintf(text, sizeof text, "session %u, longest line %d bytes", session, COMMAND_MAX_LINE);
    memset(out, 0, sizeof *out);
    pthread_mutex_lock(&device->lock);
    command_refuse(&device->cmd, CMD_E_OVERRUN, text, out);
    device_push_error(&device->events, session, CMD_E_OVERRUN, text);
    pthread_mutex_unlock(&device->lock);
}

void device_session_opened(void *self, uint32_t session, const char *who)
{
    struct device *device = self;
    pthread_mutex_lock(&device->lock);
    command_set_peer(&device->cmd, session, who);
    pthread_mutex_unlock(&device->lock);
}

void device_session_closed(void *self, uint32_t session, const char *who, int partial)
{
    struct device *device = self;
    pthread_mutex_lock(&device->lock);
    int in_control = device->cmd.control == session;
    if (in_control) {
        device->cmd.control = 0;
        device_push_event(&device->events, NATIVE_EV_CONTROL, 0, 0, 0, "client gone");
    }
    int scanning = device->scan.on;
    pthread_mutex_unlock(&device->lock);
    char text[96];
    snprintf(text, sizeof text, "session %u, %.60s", session, who);
    if (partial) device_report(device, CMD_E_PARTIAL, text);
    if (in_control || scanning) device_report(device, CMD_E_CLIENT_LOST, text);
}

void device_note_replayed(struct device *device, const struct command_result *result)
{
    struct device_journal *journal = &device->journal;
    if (result->error == 0 || journal->n_refused++ != 0) return;
    journal->refused = &journal->replay[journal->at - 1];
    snprintf(journal->why, sizeof journal->why, "%.127s", result->reply);
}

int device_run_replay(struct device *device, uint64_t tick)
{
    while (device->journal.at < device->journal.n_replay && device->journal.replay[device->journal.at].tick <= tick) {
        const struct journal_entry *entry = &device->journal.replay[device->journal.at++];
        struct command_result result;
        if (journal_pose(entry) != NULL)
            device_replay_pose(device, entry, &result);
        else
            do_command(device, 0, entry->line, (uint64_t)(entry->t_ns / device->tick_ns), 0, &result);
        if (result.effect == COMMAND_MOVE) {
            device_begin_move(device, entry->session, entry->line, entry->t_ns, &result);
            return 1;
        }
        device_note_replayed(device, &result);
    }
    return 0;
}
