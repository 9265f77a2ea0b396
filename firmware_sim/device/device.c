/* SPDX-License-Identifier: MIT */
#include "firmware_sim/device/device.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/device/device_state.h"
#include "firmware_sim/site/plan_rows.h"

/* A live head needs a pose for the first pulse of a tick, which may be 15 periods old. */
static int check_live(const struct device *device, struct sh_err *err)
{
    const struct config *cfg = device->site->cfg;
    double ticks = SCHEDULE_PACKET * 1e6 / (double)cfg->profile.prr_min_uhz * (double)device->tick_hz + 3.0;
    if (cfg->platform.kind != PLATFORM_LIVE || ticks <= DEVICE_MAX_POSES) return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s: platform.kind: live needs prr_min_hz of head profile %s to be at least %.0f",
                   cfg->file, cfg->profile.name, SCHEDULE_PACKET * (double)device->tick_hz / (DEVICE_MAX_POSES - 3.0));
}

static int64_t to_nm(double m)
{
    return llround(1e9 * m);
}

/* Whether commands may only narrow the ranges of power-up. Methods that were chosen by trying them on the scene, and
 * the outlines of an adaptive beam, hold for these ranges. */
static int was_tried(const struct site *site)
{
    const struct config *cfg = site->cfg;
    const int beam = config_has_footprint(cfg) && (cfg->beam.mode == BEAM_AUTO || cfg->beam.mode == BEAM_ADAPTIVE);
    return beam || (site->detect.surfaces.has_optics && !cfg->optics.depth_given);
}

/* Sets the limits for commands that set ranges: within the profile, and with some range left at each pulse rate. */
static void set_range_limits(const struct site *site, struct head_limits *l)
{
    const struct config *cfg = site->cfg;
    const struct config_profile *p = &cfg->profile;
    double near_most_m = INFINITY, far_least_m = 0.0;
    for (uint32_t i = 0; i < (p->n_programs > 0 ? p->n_programs : 1); i++) {
        near_most_m = fmin(near_most_m, p->program[i].own_max_m);
        far_least_m = fmax(far_least_m, p->program[i].own_min_m);
    }
    const int tried = was_tried(site);
    l->range_min_nm = tried ? cfg->head.settings.range_min_nm : to_nm(cfg->head.profile_min_m);
    l->range_max_nm = tried ? cfg->head.settings.range_max_nm : to_nm(cfg->head.profile_max_m);
    l->near_most_nm = to_nm(near_most_m) - 1;
    l->far_least_nm = to_nm(far_least_m) + 1;
}

static void set_noise_limits(const struct config *cfg, struct head_limits *l)
{
    static const double BALL_MOST_M = 100.0; /* as noise.ball.radius_m */
    const int may_move = cfg->platform.kind == PLATFORM_STATIC || cfg->noise.ball.local;
    l->noise_most = cfg->signal.on ? RANGE_NOISE_SIGNAL : RANGE_NOISE_ON;
    l->angle_most = cfg->profile.mirror_sigma_deg > 0.0 || cfg->profile.pan_sigma_deg > 0.0;
    l->sigma_min_nm = cfg->signal.on ? to_nm(cfg->profile.range_sigma_floor_m) : 0;
    l->ball_max_nm = may_move ? to_nm(BALL_MOST_M) : 0;
}

static void set_pattern(const struct config *cfg, struct head_limits *l)
{
    const struct config_profile *p = &cfg->profile;
    l->emitter = p->emitter.kind;
    l->line_pulses = emitter_line_pulses(&p->emitter);
    l->round = p->emitter.kind == EMITTER_SPHERE;
    l->step_fixed = config_head_moves(&cfg->platform);
    for (uint32_t i = 0; i < p->arrangement.n_geometries; i++) {
        const struct config_geometry *g = &p->arrangement.geometry[i];
        if (l->step_fixed && g->steps_per_turn != p->emitter.steps) continue;
        l->geometry[l->n_geometries++] = (struct head_geometry){g->lines_uhz, g->steps_per_turn};
    }
    l->sweep_udeg = l->emitter == EMITTER_LINE ? llround(360e6 * p->optical_gain / p->facets) : 0;
    l->sequence_ps = p->arrangement.firing_fs / 1000;
}

static int set_limits(struct device *device, struct sh_err *err)
{
    const struct config *cfg = device->site->cfg;
    const struct config_profile *p = &cfg->profile;
    device->cmd.limits = (struct head_limits){.prr_min_uhz = p->prr_min_uhz,
                                              .prr_max_uhz = p->prr_max_uhz,
                                              .lines_min_uhz = p->lines_min_uhz,
                                              .lines_max_uhz = p->lines_max_uhz,
                                              .pan_max_udeg_s = p->pan_max_udeg_s,
                                              .fov_min_udeg = p->fov_min_udeg,
                                              .fov_max_udeg = p->fov_max_udeg,
                                              .pan_min_udeg = p->pan_min_udeg,
                                              .pan_max_udeg = p->pan_max_udeg,
                                              .n_rates = p->n_programs,
                                              .n_stations = device->site->n_stations};
    set_pattern(cfg, &device->cmd.limits);
    set_range_limits(device->site, &device->cmd.limits);
    set_noise_limits(cfg, &device->cmd.limits);
    device->cmd.can_plan = device_can_plan;
    device->cmd.owner = device;
    for (uint32_t i = 0; i < p->n_programs; i++)
        device->cmd.limits.rate_uhz[i] = p->program[i].prr_uhz;
    for (uint32_t i = 0; i < device->site->n_stations && i < 64; i++)
        if (!config_serves(cfg, i)) device->cmd.limits.elsewhere |= (uint64_t)1 << i;
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
    memcpy(device->cmd.pose_centre_m, device->site->station[0].at.position_m, sizeof device->cmd.pose_centre_m);
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
    device->machine.due_tick = device->end_tick = device->overrun.first = UINT64_MAX;
    if (options->duration_s > 0.0 && !options->start)
        device->end_tick = (uint64_t)ceil(options->duration_s * (double)device->tick_hz);
    device->station_scans = calloc(site->n_stations, sizeof *device->station_scans);
    int rc = device->station_scans != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory");
    if (rc == SH_OK) rc = device_open_moves(device, err);
    if (rc == SH_OK) rc = set_limits(device, err);
    if (rc == SH_OK) rc = check_live(device, err);
    if (rc == SH_OK) rc = head_clock_create(site->cfg, &device->clock, err);
    gnss_init(&device->gnss, site, &device->clock);
    if (rc == SH_OK) rc = open_journals(device, err);
    if (rc == SH_OK) rc = device_open_faults(device, err);
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

int device_close_journal(struct device *device, struct sh_err *err)
{
    const uint64_t tick = device->journal.end_tick;
    if (device->journal.out != NULL && device->over)
        journal_end(device->journal.out, tick, (int64_t)tick * device->tick_ns);
    int rc = journal_close(device->journal.out, err);
    device->journal.out = NULL;
    struct sh_err why;
    const int truth_rc = fault_board_close(device->faults, &why);
    return rc != SH_OK || truth_rc == SH_OK ? rc : sh_fail(err, truth_rc, "%s", why.text);
}

int device_files_fill(const struct device *device)
{
    return journal_is_filling(device->journal.out) || fault_board_is_filling(device->faults);
}

void device_free(struct device *device)
{
    if (device == NULL) return;
    journal_close(device->journal.out, NULL);
    fault_board_free(device->faults);
    device_free_variants(device);
    free(device->journal.replay);
    free(device->station_scans);
    device_close_moves(device);
    pthread_mutex_destroy(&device->lock);
    free(device);
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
    return device->held == 0 && device->overrun.ticks_said == atomic_load(&device->counters.lost_ticks);
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
    device_run_faults(device, tick, work);
    device_use_site(device, work);
    device_run_timers(device, tick);
    const int off = device->machine.state == HEAD_OFF;
    if (!off) {
        device_say_overrun(device, tick);
        device_say_held(device, tick);
        device_say_lost_lines(device, tick);
        device_say_pps(device, tick);
    }
    const int repeated = device_is_repeated(device, tick);
    if (repeated) device_say_time(device, tick); /* a reader that joins gets the time before the first point */
    device_take_events(device, work);
    work->n_events_before = work->n_events;
    if (device->scan.on)
        device_claim_scan(device, tick, work);
    else if (repeated)
        device_describe(device, work);
    work->telemetry = tick % device->tick_hz == 0 && !off;
    if (work->telemetry || ends_scan(work)) device_fill_telemetry(device, tick, &work->telemetry_frame);
    int told = device->ending || tick >= device->end_tick; /* 1: told to end; 0: at most its one scan is over */
    if (!was_over && (told || device->over)) device->journal.end_tick = told ? tick : tick + 1;
    device->over |= told;
    device->next_tick = tick + 1;
    pthread_mutex_unlock(&device->lock);
    return 0;
}

int device_is_idle(struct device *device)
{
    pthread_mutex_lock(&device->lock);
    int still =
        device->machine.state == HEAD_IDLE || device->machine.state == HEAD_FAULT || device->machine.state == HEAD_OFF;
    int idle = still && device->machine.due_tick == UINT64_MAX && device->events.n == 0 && device->held == 0 &&
               !device->ending && !device->over && device->journal.at == device->journal.n_replay &&
               device->end_tick == UINT64_MAX;
    pthread_mutex_unlock(&device->lock);
    return idle;
}

void device_end(struct device *device)
{
    pthread_mutex_lock(&device->lock);
    device->ending = 1;
    atomic_store(&device->moves.stops, 1);
    pthread_mutex_unlock(&device->lock);
}

struct device_counters *device_counters(struct device *device)
{
    return &device->counters;
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

int64_t device_tick_ns(const struct device *device)
{
    return device->tick_ns;
}
