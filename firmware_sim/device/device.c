/* SPDX-License-Identifier: MIT */
#include "firmware_sim/device/device.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/device/clock_faults.h"
#include "firmware_sim/device/device_state.h"
#include "firmware_sim/device/fault_desk.h"
#include "firmware_sim/device/limits.h"
#include "firmware_sim/site/plan_rows.h"

/* With platform.kind live the head needs poses for all pulses that a tick casts. Pulses are cast in packets of 16, so
 * the first of a packet may have been fired 15 pulse periods before the tick. There is room for DEVICE_MAX_POSES
 * ticks. */
static int check_live(const struct device *device, struct sh_err *err)
{
    const struct config *cfg = device->site->cfg;
    double ticks = SCHEDULE_PACKET * 1e6 / (double)cfg->profile.prr_min_uhz * (double)device->tick_hz + 3.0;
    if (cfg->platform.kind != PLATFORM_LIVE || ticks <= DEVICE_MAX_POSES) return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s: platform.kind: live needs prr_min_hz of head profile %s to be at least %.0f",
                   cfg->file, cfg->profile.name,
                   ceil(SCHEDULE_PACKET * (double)device->tick_hz / (DEVICE_MAX_POSES - 3.0)));
}

static int set_up_commands(struct device *device, struct sh_err *err)
{
    const struct config *cfg = device->site->cfg;
    const struct config_profile *p = &cfg->profile;
    device_set_limits(device->site, &device->cmd.limits);
    device->cmd.can_plan = device_can_plan;
    device->cmd.owner = device;
    device->cmd.settings = device->cmd.defaults = cfg->head.settings;
    int len = snprintf(device->idn, sizeof device->idn, "%s,%s,%s,scanhead native %d", p->maker, p->model,
                       cfg->head.serial, NATIVE_VERSION);
    if (len >= (int)sizeof device->idn)
        return sh_fail(err, SH_EINPUT,
                       "%s: maker, model and head.serial are together too long for *IDN?; allowed are %zu bytes",
                       cfg->file, sizeof device->idn - 1 - strlen(",,,scanhead native 1"));
    device->cmd.idn = device->idn;
    site_plan_text(device->site, device->plan, sizeof device->plan);
    device->cmd.plan = device->plan;
    device->cmd.step_allowed = cfg->loop.pace == PACE_STEP;
    device->cmd.pose_allowed = cfg->platform.kind == PLATFORM_LIVE;
    device->cmd.pose_reach_m = cfg->platform.reach_m;
    device->cmd.fixed = site_why_fixed(device->site);
    device->cmd.place = device->moves.place;
    device->cmd.first_place = device->moves.first_place;
    return SH_OK;
}

static void end_run_at(struct device *device, uint64_t tick)
{
    if (tick < device->end_tick) device->end_tick = tick;
}

/* A replayed journal ends the run where its own run ended. */
static int open_replay(struct device *device, struct sh_err *err)
{
    struct device_journal *journal = &device->journal;
    int rc = journal_read(device->options.replay, &journal->replay, &journal->n_replay, err);
    if (rc != SH_OK) return rc;
    for (size_t i = 0; i < journal->n_replay && !journal->ends; i++) {
        journal->has_poses |= journal_pose(&journal->replay[i]) != NULL;
        if (!journal_is_end(&journal->replay[i])) continue;
        end_run_at(device, journal->replay[i].tick);
        journal->n_replay = i; /* commands after the end had no effect */
        journal->ends = 1;
    }
    return SH_OK;
}

static int open_journals(struct device *device, struct sh_err *err)
{
    int rc = journal_check_paths(device->options.journal, device->options.replay, err);
    if (rc == SH_OK && device->options.replay != NULL) rc = open_replay(device, err);
    if (rc != SH_OK || device->options.journal == NULL) return rc;
    device->journal.out = journal_open(device->options.journal, &device->counters.lost_journal_lines, err);
    if (device->journal.out == NULL) return err->code;
    char note[16 + sizeof device->plan];
    snprintf(note, sizeof note, "plan: %s", device->plan);
    journal_note(device->journal.out, note);
    return SH_OK;
}

/* Some parts of the device don't know struct device. This function gives such parts pointers to the members that they
 * need. */
static void set_parts(struct device *device)
{
    device->events.tick_hz = device->overrun.tick_hz = device->tick_hz;
    device->events.next_tick = &device->next_tick;
    device->overrun.counters = &device->counters;
    device->overrun.events = &device->events;
    device->overrun.queue = &device->cmd.queue;
}

static void write_note(void *ctx, const struct fault_note *note)
{
    const struct device *device = ctx;
    char text[TRUTH_TEXT_LEN];
    truth_text(note, text);
    if (device->journal.out != NULL) journal_note(device->journal.out, text);
}

static int open_faults(struct device *device, struct sh_err *err)
{
    const int rc = fault_board_create(&device->site->cfg->faults, device->options.truth,
                                      &device->counters.lost_truth_lines, &device->faults, err);
    if (rc != SH_OK) return rc;
    fault_board_listen(device->faults, write_note, device);
    head_faults_init(&device->head_faults, device->faults, device->tick_ns);
    device->ptp = (struct ptp){.faults = &device->head_faults,
                               .clock = &device->clock,
                               .events = &device->events,
                               .journal = device->journal.out};
    ptp_init(&device->ptp, &device->site->cfg->time.ptp, device->site->cfg->noise.seed);
    device->beam = (struct device_beam){.scan = &device->scan,
                                        .board = device->faults,
                                        .tick_ns = device->tick_ns,
                                        .free_ppm = device->site->cfg->head.motor_ppm};
    device->desk = (struct fault_desk){.cfg = device->site->cfg, .board = device->faults};
    device->cmd.faults = &fault_desk_commands;
    device->cmd.faults_owner = &device->desk;
    return SH_OK;
}

int device_create(const struct site *site, const struct device_options *options, struct device **out,
                  struct sh_err *err)
{
    *out = NULL;
    struct device *device = calloc(1, sizeof *device);
    if (device == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    pthread_mutex_init(&device->lock, NULL);
    device->site = site;
    device->options = *options;
    device->tick_hz = (uint64_t)llround(site->cfg->loop.tick_hz);
    device->tick_ns = 1000000000 / (int64_t)device->tick_hz;
    set_parts(device);
    device->machine.due_tick = device->end_tick = device->overrun.first = UINT64_MAX;
    if (options->duration_s > 0.0 && !options->start)
        device->end_tick = (uint64_t)ceil(options->duration_s * (double)device->tick_hz);
    device->station_scans = calloc(site->n_stations, sizeof *device->station_scans);
    int rc = device->station_scans != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory");
    if (rc == SH_OK) rc = device_open_moves(&device->moves, device->site, err);
    if (rc == SH_OK) rc = set_up_commands(device, err);
    if (rc == SH_OK) rc = check_live(device, err);
    if (rc == SH_OK) rc = device_open_poses(device, err);
    if (rc == SH_OK) rc = head_clock_create(&site->cfg->time, &device->clock, err);
    gnss_init(&device->gnss, site, &device->clock);
    device_init_time_server(device);
    if (rc == SH_OK) rc = open_journals(device, err);
    if (rc == SH_OK) rc = open_faults(device, err);
    if (rc == SH_OK) rc = device_restore(device, err);
    if (rc != SH_OK) {
        device_free(device);
        return rc;
    }
    if (site->cfg->loop.pace == PACE_REALTIME && options->replay != NULL) device_plan_ahead(device);
    device_before_scans(device);
    device_first_power(device);
    *out = device;
    return SH_OK;
}

int device_replay_ends(const struct device *device)
{
    return device->journal.ends;
}

int device_replays(const struct device *device)
{
    return device->options.replay != NULL;
}

/* A journal has only commands that had an effect. With other options, or after an edit, the head may refuse some. */
static void warn_refused(const struct device *device)
{
    const struct device_journal *journal = &device->journal;
    if (journal->n_refused == 0) return;
    sh_warn(device->options.report,
            "journal: %.200s:%u: %.60s: %s; of %zu replayed commands the head refused %zu, so the session differs",
            device->options.replay, journal->refused->line_no, journal->refused->line, journal->why, journal->at,
            journal->n_refused);
}

int device_close_journal(void *self, struct sh_err *err)
{
    struct device *device = self;
    warn_refused(device);
    const uint64_t tick = device->journal.end_tick;
    if (device->journal.out != NULL && device->over)
        journal_end(device->journal.out, tick, (int64_t)tick * device->tick_ns);
    int rc = journal_close(device->journal.out, err);
    device->journal.out = NULL;
    struct sh_err why;
    const int truth_rc = fault_board_close(device->faults, &why);
    return rc != SH_OK || truth_rc == SH_OK ? rc : sh_fail(err, truth_rc, "%s", why.text);
}

int device_files_fill(const void *self)
{
    const struct device *device = self;
    return journal_is_filling(device->journal.out) || fault_board_is_filling(device->faults);
}

void device_free(struct device *device)
{
    if (device == NULL) return;
    journal_close(device->journal.out, NULL);
    fault_board_free(device->faults);
    free(device->journal.replay);
    free(device->station_scans);
    free(device->live.sample);
    device_close_moves(&device->moves);
    pthread_mutex_destroy(&device->lock);
    free(device);
}

static void run_faults(struct device *device, uint64_t tick, struct device_work *work)
{
    const struct head_faults_tick at = {.t_ns = (int64_t)tick * device->tick_ns,
                                        .has_pulses = device->scan.on,
                                        .pulse0 = device->scan.pulse_next,
                                        .n_pulses = 1}; /* a fault waits for a tick that begins at its pulse or later */
    static const uint64_t kinds = HEAD_FAULTS_CLOCK | HEAD_FAULTS_SERVER | HEAD_FAULT(FAULT_POWER_CYCLE);
    if (head_faults_step(&device->head_faults, kinds, &at))
        device_run_clock_faults(&device->head_faults, &device->clock, &device->events, tick);
    device_run_power(device, tick, work);
}

/* Pulses, echoes and lines are filled in at release (stream.c), since they count what was released. This function sets
 * both counts of lost pulses to the pulses cast; the release subtracts those delivered. */
static void fill_telemetry(const struct device *device, uint64_t tick, struct native_telemetry *t)
{
    const struct device_counters *c = &device->counters;
    memset(t, 0, sizeof *t);
    t->state = (uint32_t)device->machine.state;
    t->scan = device->scan.number;
    t->lost_pulses = atomic_load(&c->cast);
    t->scan_fired = device->scan.pulse_next;
    t->scan_cast = t->scan_lost = device->scan.cast;
    t->late_blocks = atomic_load(&c->late_blocks);
    t->late_max_us = (uint32_t)(atomic_load(&c->late_max_ns) / 1000);
    t->errors_queued = device->cmd.queue.count;
    t->lost_lines = atomic_load(&c->lost_journal_lines) + atomic_load(&c->lost_truth_lines);
    device_tell_time(device, (int64_t)tick * device->tick_ns, t);
}

static int ends_scan(const struct device_work *work)
{
    for (uint32_t i = 0; i < work->n_events; i++)
        if (work->event[i].code == NATIVE_EV_SCAN_END) return 1;
    return 0;
}

/* Unlocks for planning. Claims come one after the other, so no tick passes meanwhile. */
static void replay(struct device *device, uint64_t tick)
{
    struct command_result result;
    while (device_run_replay(device, tick)) {
        pthread_mutex_unlock(&device->lock);
        device_plan_move(device);
        pthread_mutex_lock(&device->lock);
        device_take_move(device, device->moves.plan.t_ns, &result);
        device_note_replayed(device, &result);
        pthread_mutex_unlock(&device->lock);
        device_end_move(device);
        pthread_mutex_lock(&device->lock);
    }
}

/* A head without power reports no errors and lost ticks, so the end of a run does not wait for these. */
static int has_said_all(const struct device *device)
{
    if (device->events.n != 0) return 0;
    if (device->machine.state == HEAD_OFF) return 1;
    return device->events.held == 0 && device->overrun.ticks_said == atomic_load(&device->counters.lost_ticks);
}

int device_claim(struct device *device, struct device_work *work)
{
    pthread_mutex_lock(&device->lock);
    if (device->over && has_said_all(device)) { /* else one more tick carries the remaining events */
        pthread_mutex_unlock(&device->lock);
        return 1;
    }
    uint64_t tick = device->next_tick;
    int was_over = device->over;
    memset(work, 0, offsetof(struct device_work, event));
    work->describe = work->scanning = work->telemetry = work->cut_short = 0;
    work->variant = NULL;
    work->surfaces_n = work->n_poses = 0;
    work->tick = tick;
    work->t_ns = (int64_t)tick * device->tick_ns;
    replay(device, tick);
    run_faults(device, tick, work);
    work->version = device_use(device->moves.current);
    device_run_timers(device, tick);
    device_follow_ptp(device, tick);
    const int off = device->machine.state == HEAD_OFF;
    if (!off) {
        device_say_overrun(&device->overrun, device->scan.pulse_next, tick);
        device_say_held(&device->events, tick, device->over);
        device_say_lost_lines(&device->overrun, tick);
        device_say_pps(device, tick);
        device_follow_receiver(device, tick);
    }
    const int repeated = device_is_repeated(device, tick);
    if (repeated) device_say_time(device, tick); /* a reader that joins gets the time before the first point */
    device_take_events(&device->events, work);
    work->n_events_before = work->n_events;
    if (device->scan.on)
        device_claim_scan(device, tick, work);
    else if (repeated)
        device_describe(device, work);
    work->telemetry = tick % device->tick_hz == 0 && !off;
    if (work->telemetry || ends_scan(work)) fill_telemetry(device, tick, &work->telemetry_frame);
    /* told: the run had to end before this tick. Else its only scan ended, or its self-test failed, in this tick. */
    const int told = device->ending || tick >= device->end_tick;
    if (!was_over && (told || device->over)) device->journal.end_tick = told ? tick : tick + 1;
    device->over |= told;
    device->next_tick = tick + 1;
    pthread_mutex_unlock(&device->lock);
    return 0;
}

void device_lost(struct device *device, const struct device_work *work)
{
    pthread_mutex_lock(&device->lock);
    device_count_lost(&device->overrun, work, device->power.off_tick);
    if (work->describe && work->describe_flags == 0 && device->scan.on) device->scan.describe = 1;
    if (work->scanning && work->stretch != device->scan.stretch)
        device->scan.anchor_lost = 1; /* a new anchor was due in this tick, or in a later one */
    if (work->describe && work->describe_flags != 0)
        device->scan.anchor_lost = 1; /* the tick had a repetition, maybe of a lost anchor */
    pthread_mutex_unlock(&device->lock);
}

/* Whether only events that wait for a tick can happen without a command. */
static int is_still(const struct device *device)
{
    const int still =
        device->machine.state == HEAD_IDLE || device->machine.state == HEAD_FAULT || device->machine.state == HEAD_OFF;
    return still && device->machine.due_tick == UINT64_MAX && !device->ending && !device->over &&
           device->journal.at == device->journal.n_replay && device->end_tick == UINT64_MAX;
}

int device_is_idle(struct device *device)
{
    pthread_mutex_lock(&device->lock);
    const int idle = is_still(device) && device->events.n == 0 && device->events.held == 0;
    pthread_mutex_unlock(&device->lock);
    return idle;
}

int device_settles(struct device *device)
{
    pthread_mutex_lock(&device->lock);
    const int settles = is_still(device) && (device->events.n != 0 || device->events.held != 0);
    pthread_mutex_unlock(&device->lock);
    return settles;
}

void device_end(void *self)
{
    struct device *device = self;
    pthread_mutex_lock(&device->lock);
    device->ending = 1;
    atomic_store(&device->moves.stops, 1);
    pthread_mutex_unlock(&device->lock);
}

struct device_counters *device_counters(void *self)
{
    return &((struct device *)self)->counters;
}

uint32_t device_last_scan(struct device *device, uint32_t *station)
{
    pthread_mutex_lock(&device->lock);
    const uint32_t number = device->scan.number;
    if (station != NULL) *station = device->scan.station + 1;
    pthread_mutex_unlock(&device->lock);
    return number;
}

int64_t device_scan_ns(struct device *device)
{
    pthread_mutex_lock(&device->lock);
    const struct device_scan *scan = &device->scan;
    int64_t ticks = scan->number != 0 && !scan->on ? (int64_t)(scan->end_tick - scan->tick0) : 0;
    pthread_mutex_unlock(&device->lock);
    return ticks * device->tick_ns;
}

int64_t device_tick_ns(const void *self)
{
    return ((const struct device *)self)->tick_ns;
}

struct fault_board *device_faults(const void *self)
{
    return ((const struct device *)self)->faults;
}
