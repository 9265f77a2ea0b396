/* SPDX-License-Identifier: MIT */
/* Commands to a recording: its descriptor answers queries. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/replay/replay_state.h"

static const char RECORDED[] = "a recording is replayed; its settings are fixed";
static const char FIXED[] = "a recording is replayed; its stations are fixed";

void replay_set_state(struct replay *r, uint64_t tick, enum head_state state)
{
    r->change[r->n_changes++ % REPLAY_CHANGES] = (struct replay_change){tick, state};
}

/* Returns the number of the last change that is released, plus 1; 0: none that is kept. */
static uint32_t find_change(const struct replay *r, uint64_t released)
{
    for (uint32_t i = r->n_changes; i > 0 && i + REPLAY_CHANGES > r->n_changes; i--)
        if (r->change[(i - 1) % REPLAY_CHANGES].tick < released) return i;
    return 0;
}

/* Returns the state at the last released tick. A command to begin or to end the playing is seen at once. */
static enum head_state visible_state(const struct replay *r, uint64_t released)
{
    const uint32_t i = find_change(r, released);
    const enum head_state state = i != 0 ? r->change[(i - 1) % REPLAY_CHANGES].state : HEAD_IDLE;
    const int moves = state == HEAD_SPIN_UP || state == HEAD_SCANNING, is_to_begin = i < r->begun;
    const int ready = r->n_clients >= (int)r->options.clients;
    const int stops = r->wants_stop || i < r->stopped;
    if ((r->wants_start && ready) || r->wants_seek || (is_to_begin && r->begun > r->stopped && !r->wants_stop))
        return moves && !stops ? state : HEAD_SPIN_UP;
    return stops && (moves || is_to_begin) ? HEAD_SPIN_DOWN : state;
}

static int64_t to_nm(double m)
{
    return isfinite(m) && fabs(m) < 1e9 ? llround(1e9 * m) : 0;
}

void replay_take_descriptor(struct replay *r, const struct native_descriptor *d)
{
    struct head_settings *s = &r->cmd.settings;
    struct head_limits *l = &r->cmd.limits;
    s->prr_uhz = l->prr_min_uhz = l->prr_max_uhz = (int64_t)d->prr_uhz;
    s->lines_uhz = l->lines_min_uhz = l->lines_max_uhz = (int64_t)d->lines_uhz;
    s->pan_udeg_s = l->pan_max_udeg_s = (int64_t)d->pan_udeg_s;
    s->line_start_udeg = l->fov_min_udeg = d->line_start_udeg;
    s->line_stop_udeg = l->fov_max_udeg = d->line_stop_udeg;
    s->pan_start_udeg = l->pan_min_udeg = d->pan_start_udeg;
    s->pan_stop_udeg = l->pan_max_udeg = d->pan_stop_udeg;
    s->frames = d->frames;
    s->waves = l->waves_most = (d->content & NATIVE_HAS_WAVES) != 0;
    s->range_min_nm = l->range_min_nm = l->near_most_nm = to_nm(d->range_min_m);
    s->range_max_nm = l->range_max_nm = l->far_least_nm = to_nm(d->range_max_m);
    l->sweep_udeg = d->sweep_udeg;
    l->emitter = EMITTER_LINE;
    l->line_pulses = 0;
    r->cmd.defaults = *s;
}

void replay_take_emitter(struct replay *r, const struct native_emitter *e)
{
    struct command_device *cmd = &r->cmd;
    cmd->limits.emitter = (enum emitter_kind)e->kind; /* the same numbers (config/link_protocol.c) */
    cmd->limits.line_pulses = e->steps;
    cmd->limits.step_fixed = 1;
    cmd->settings.echoes = e->echoes <= NATIVE_ECHOES_STRONGEST ? e->echoes : COMMAND_NOT_RECORDED_U32;
    if (e->kind == NATIVE_EMIT_SPHERE && e->steps > 0) cmd->settings.step_udeg = llround(360e6 / e->steps);
    if (e->sequence_ns_den > 0)
        cmd->limits.sequence_ps = llround(1e3 * (double)e->sequence_ns_num / (double)e->sequence_ns_den);
    cmd->defaults = cmd->settings;
}

void replay_take_anchor(struct replay *r, const struct native_anchor *anchor)
{
    r->anchor = *anchor;
    r->cmd.settings.station = r->cmd.defaults.station = anchor->station;
    r->cmd.limits.n_stations = anchor->station;
}

void replay_open_commands(struct replay *r)
{
    struct command_device *cmd = &r->cmd;
    cmd->recorded = RECORDED;
    cmd->fixed = FIXED;
    cmd->plan = "none: a recording is replayed";
    cmd->state = HEAD_IDLE;
    cmd->faults = &fault_desk_commands;
    cmd->faults_owner = &r->desk;
    cmd->step_allowed = r->cfg->loop.pace == PACE_STEP;
    cmd->settings = (struct head_settings){.station = 1,
                                           .echoes = COMMAND_NOT_RECORDED_U32,
                                           .noise = COMMAND_NOT_RECORDED_U32,
                                           .angle_noise = COMMAND_NOT_RECORDED_U32,
                                           .phase_lock = COMMAND_NOT_RECORDED_U32,
                                           .phase_udeg = COMMAND_NOT_RECORDED,
                                           .sigma_nm = COMMAND_NOT_RECORDED,
                                           .ball_nm = COMMAND_NOT_RECORDED};
    cmd->limits.n_stations = 1;
}

/* The recording is played from another time on, at another speed, or with another loop. The last command decides: a
 * seek takes back a stop that no tick has carried out yet. Without the loop a round that has not begun is dropped. */
static void replay_change(struct replay *r, const struct command_replay_change *to)
{
    if (to->position_s >= 0.0) {
        r->seek_s = to->position_s;
        r->wants_seek = 1;
        r->wants_stop = 0;
    }
    if (to->loop >= 0) r->loop = to->loop;
    if (!r->loop) r->wants_again = 0;
    if (to->speed < 0.0) return;
    r->speed_changed |= to->speed != r->speed;
    r->speed = to->speed;
}

static void carry_out(struct replay *r, enum command_effect effect)
{
    if (effect != COMMAND_START && effect != COMMAND_STOP && effect != COMMAND_RESET) return;
    r->wants_start = effect == COMMAND_START;
    r->wants_stop = !r->wants_start;
    r->wants_seek = 0;
    if (r->wants_start) r->options.clients = 0; /* a client that commands the start does not wait for others */
}

/* once: the session does not keep control. */
static void do_command(struct replay *r, uint32_t session, const char *line, uint64_t released, int once,
                       struct command_result *out)
{
    pthread_mutex_lock(&r->lock);
    r->cmd.state = visible_state(r, released);
    r->cmd.t_ns = (int64_t)released * r->tick_ns;
    r->cmd.frames_done = r->frames_done;
    r->cmd.lost_truth_lines = atomic_load(&r->counters.lost_truth_lines);
    r->cmd.is_played = r->playing || r->wants_start || r->wants_again || r->wants_seek;
    r->cmd.replay.plays = r->wants_start || r->wants_seek || (!r->wants_stop && (r->playing || r->wants_again));
    r->cmd.replay.position_s = 1e-9 * (double)r->position_ns;
    if (r->wants_seek) r->cmd.replay.position_s = r->seek_s;
    r->cmd.replay.speed = r->speed;
    r->cmd.replay.loop = r->loop;
    r->desk.now_ns = r->cmd.t_ns;
    command_execute(&r->cmd, session, line, out);
    if (out->error == 0 && out->effect == COMMAND_REPLAY) replay_change(r, &out->replay);
    if (out->error == 0) carry_out(r, out->effect);
    if (once && out->took_control) r->cmd.control = 0;
    pthread_mutex_unlock(&r->lock);
}

void replay_command(void *self, uint32_t session, const char *line, uint64_t released, struct command_result *out)
{
    do_command(self, session, line, released, 0, out);
}

void replay_command_once(void *self, uint32_t session, const char *line, uint64_t released, struct command_result *out)
{
    do_command(self, session, line, released, 1, out);
}

void replay_report(void *self, int number, const char *text)
{
    struct replay *r = self;
    pthread_mutex_lock(&r->lock);
    command_queue_push(&r->cmd.queue, number, text);
    pthread_mutex_unlock(&r->lock);
}

void replay_overlong(void *self, uint32_t session, struct command_result *out)
{
    struct replay *r = self;
    char text[96];
    snprintf(text, sizeof text, "session %u, longest line %d bytes", session, COMMAND_MAX_LINE);
    memset(out, 0, sizeof *out);
    pthread_mutex_lock(&r->lock);
    command_refuse(&r->cmd, CMD_E_OVERRUN, text, out);
    pthread_mutex_unlock(&r->lock);
}

void replay_session_opened(void *self, uint32_t session, const char *who)
{
    struct replay *r = self;
    pthread_mutex_lock(&r->lock);
    command_set_peer(&r->cmd, session, who);
    r->n_clients++;
    pthread_mutex_unlock(&r->lock);
}

void replay_session_closed(void *self, uint32_t session, const char *who, int partial)
{
    struct replay *r = self;
    char text[96];
    snprintf(text, sizeof text, "session %u, %.60s", session, who);
    pthread_mutex_lock(&r->lock);
    const int in_control = r->cmd.control == session;
    if (in_control) r->cmd.control = 0;
    if (partial) command_queue_push(&r->cmd.queue, CMD_E_PARTIAL, text);
    if (in_control || r->playing) command_queue_push(&r->cmd.queue, CMD_E_CLIENT_LOST, text);
    pthread_mutex_unlock(&r->lock);
}

void replay_session_over(void *self)
{
    struct replay *r = self;
    pthread_mutex_lock(&r->lock);
    r->n_clients--;
    pthread_mutex_unlock(&r->lock);
}
