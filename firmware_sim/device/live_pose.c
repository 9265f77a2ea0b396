/* SPDX-License-Identifier: MIT */
/* The head's pose: the end of a trajectory, and a live platform's poses. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/angle.h"
#include "core/vec3.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/device/device_state.h"
#include "firmware_sim/device/pose_line.h"

#define LEN(array) ((int64_t)(sizeof(array) / sizeof((array)[0])))

static const int64_t PAST_NS = 2000000000; /* a fix of the receiver is of a time up to so long ago */

int64_t device_path_end_ns(const struct device *device)
{
    const struct site *site = device->site;
    if (site->n_knots == 0 || site->cfg->platform.at_end == PLATFORM_HOLD) return INT64_MAX;
    return site->knot[site->n_knots - 1].t_ns;
}

int device_open_poses(struct device *device, struct sh_err *err)
{
    if (device->site->cfg->platform.kind != PLATFORM_LIVE) return SH_OK;
    device->live.sample = calloc(DEVICE_POSES_KEPT, sizeof *device->live.sample);
    return device->live.sample != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for the platform's poses");
}

static struct device_sample *sample_at(const struct device_live *live, uint64_t i)
{
    return &live->sample[i % DEVICE_POSES_KEPT];
}

const double *device_reach_centre(const struct device *device)
{
    const uint32_t station = device->scan.on ? device->scan.station : device->cmd.settings.station - 1;
    return device->site->station[station].at.position_m;
}

static int is_near(const struct device *device, const struct pose *pose)
{
    double off_m = vec3_distance(pose->position_m, device_reach_centre(device));
    return off_m <= device->site->cfg->platform.reach_m;
}

/* Whether a pose is so far ahead that its time must be wrong. Such a pose would keep out all poses with right times. In
 * the pace `step` a client grants the time, so no pose counts as too far ahead. */
static int is_early(const struct device *device, int64_t t_ns)
{
    int64_t now_ns = (int64_t)device->next_tick * device->tick_ns;
    return device->site->cfg->loop.pace != PACE_STEP && t_ns > now_ns + DEVICE_POSE_AHEAD_S * INT64_C(1000000000);
}

/* Whether one more pose has room: it may replace none that unclaimed pulses still need. A pose over PAST_NS ahead can
 * come later, so it may replace none that the receiver's fixes need, either. */
static int has_room(const struct device *device, int64_t t_ns)
{
    const struct device_live *live = &device->live;
    if (live->n < DEVICE_POSES_KEPT) return 1;
    const uint64_t tick = device->scan.on ? device->scan.tick0 + (uint64_t)live->next : device->next_tick;
    const int64_t oldest_ns = sample_at(live, live->n - DEVICE_POSES_KEPT + 1)->t_ns; /* once the new one is there */
    const int can_wait = t_ns > (int64_t)device->next_tick * device->tick_ns + PAST_NS;
    return oldest_ns <= (int64_t)tick * device->tick_ns - (device->gnss.on && can_wait ? PAST_NS : 0);
}

static int check_pose(const struct device *device, int64_t t_ns, const struct pose *pose, struct sh_err *err)
{
    const struct device_live *live = &device->live;
    const int64_t last_ns = live->n != 0 ? sample_at(live, live->n - 1)->t_ns : INT64_MIN;
    if (live->sample == NULL) return sh_fail(err, SH_EINPUT, "a pose needs platform.kind: live");
    if (!is_near(device, pose))
        return sh_fail(err, SH_EINPUT, "a pose is over %g m from the station", device->site->cfg->platform.reach_m);
    if (t_ns <= last_ns)
        return sh_fail(err, SH_EINPUT, "a pose is not after the last pose, of %.15g s", (double)last_ns / 1e9);
    if (t_ns < 0) return sh_fail(err, SH_EINPUT, "a pose is before power-up; allowed is 0 s on");
    if (is_early(device, t_ns)) return sh_fail(err, SH_EINPUT, "a pose is over %d s ahead", DEVICE_POSE_AHEAD_S);
    if (has_room(device, t_ns)) return SH_OK;
    return sh_fail(err, SH_ESTATE, "a pose has no room: the %d that the head keeps are still needed; send it later",
                   DEVICE_POSES_KEPT);
}

static int take_pose(struct device *device, int64_t t_ns, const double v[6], struct sh_err *err)
{
    struct device_live *live = &device->live;
    struct pose pose = {.position_m = {v[0], v[1], v[2]}};
    pose_from_angles(angle_rad(v[5]), angle_rad(v[4]), angle_rad(v[3]), pose.quat);
    const int rc = check_pose(device, t_ns, &pose, err);
    if (rc != SH_OK) {
        atomic_fetch_add(&device->counters.bad_poses, 1);
        return rc;
    }
    *sample_at(live, live->n++) = (struct device_sample){t_ns, pose};
    /* Poses are made of this one from the next claim on, so a replay gives it before that claim. */
    if (device->journal.out != NULL) journal_write_pose(device->journal.out, device->next_tick, t_ns, v);
    return SH_OK;
}

/* A journal with an END has all poses up to its END: after its last line of a pose none came. */
int device_replays_poses(const struct device *device)
{
    const struct device_journal *journal = &device->journal;
    return journal->has_poses && (journal->at < journal->n_replay || (journal->ends && !device->over));
}

int device_pose(struct device *device, int64_t t_ns, const double v[6], struct sh_err *err)
{
    int rc;
    pthread_mutex_lock(&device->lock);
    if (device_replays_poses(device)) {
        rc = sh_fail(err, SH_ESTATE, "a pose came while a journal with poses is being replayed");
        atomic_fetch_add(&device->counters.bad_poses, 1);
    } else {
        rc = take_pose(device, t_ns, v, err);
    }
    pthread_mutex_unlock(&device->lock);
    return rc;
}

void device_replay_pose(struct device *device, const struct journal_entry *entry, struct command_result *out)
{
    double v[6];
    struct sh_err err;
    memset(out, 0, sizeof *out);
    int rc = pose_line_read(journal_pose(entry), v, &err);
    if (rc == SH_OK) rc = take_pose(device, entry->t_ns, v, &err);
    if (rc == SH_OK) return;
    out->error = CMD_E_SETTINGS;
    snprintf(out->reply, sizeof out->reply, "%.200s", err.text);
}

/* After the last pose the motion between the last two poses goes on for extrapolate_ms. Then the platform stands. Where
 * the motion would leave the reach, the platform stands at the last pose instead. It stands there, too, where the pose
 * before is out of reach: that one came while the head was at another station. */
static uint32_t extrapolate(const struct device *device, int64_t t_ns, struct pose *out)
{
    const struct device_live *live = &device->live;
    int64_t last_ns = sample_at(live, live->n - 1)->t_ns,
            most_ns = (int64_t)(device->site->cfg->platform.extrapolate_ms * 1e6);
    uint32_t flags = t_ns - last_ns > most_ns ? POSE_LATE : POSE_EXTRAPOLATED;
    *out = sample_at(live, live->n - 1)->pose;
    if (live->n < 2 || !is_near(device, &sample_at(live, live->n - 2)->pose)) return flags;
    int64_t before_ns = sample_at(live, live->n - 2)->t_ns;
    int64_t on_ns = flags == POSE_LATE ? last_ns + most_ns : t_ns;
    struct pose on;
    pose_between(&sample_at(live, live->n - 2)->pose, out, (double)(on_ns - before_ns) / (double)(last_ns - before_ns),
                 &on);
    if (!is_near(device, &on)) return POSE_LATE;
    *out = on;
    return flags;
}

/* In the pace `step` the first pose comes with the step that leads to it, and holds for that whole step. Elsewhere it
 * may be of any time ahead, so it says nothing of the time before. */
static uint32_t before_poses(const struct device *device, struct pose *out)
{
    const struct device_live *live = &device->live;
    const int holds = device->site->cfg->loop.pace == PACE_STEP && live->n != 0 && live->n <= DEVICE_POSES_KEPT;
    if (!holds || !is_near(device, &sample_at(live, 0)->pose)) return POSE_NONE;
    *out = sample_at(live, 0)->pose;
    return 0;
}

/* Returns the last of the poses from `first` on that is at t_ns or before. `first` itself is. */
static uint64_t find_sample(const struct device_live *live, uint64_t first, int64_t t_ns)
{
    uint64_t low = first, high = live->n;
    while (high - low > 1) {
        const uint64_t middle = low + (high - low) / 2;
        if (sample_at(live, middle)->t_ns <= t_ns)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* POSE_NONE: there is no pose of that time or before, and `out` is not set. Poses that came while the head was at
 * another station, and are out of reach of this one, don't count. */
static uint32_t platform_at(const struct device *device, int64_t t_ns, struct pose *out)
{
    const struct device_live *live = &device->live;
    const uint64_t first = live->n > DEVICE_POSES_KEPT ? live->n - DEVICE_POSES_KEPT : 0;
    if (live->n == 0 || t_ns < sample_at(live, first)->t_ns) return before_poses(device, out);
    const uint64_t i = find_sample(live, first, t_ns);
    const struct device_sample *a = sample_at(live, i), *b = sample_at(live, i + 1);
    if (!is_near(device, &a->pose)) return POSE_NONE;
    *out = a->pose;
    if (t_ns == a->t_ns) return 0;
    if (i + 1 == live->n) return extrapolate(device, t_ns, out);
    if (!is_near(device, &b->pose)) return POSE_NONE;
    pose_between(&a->pose, &b->pose, (double)(t_ns - a->t_ns) / (double)(b->t_ns - a->t_ns), out);
    return 0;
}

/* Finds the pose of the head on the platform. Returns the pose's flags; with POSE_NONE `head` is not set. */
static uint32_t live_head_at(const struct device *device, int64_t t_ns, struct pose *head)
{
    struct pose body;
    uint32_t flags = platform_at(device, t_ns, &body);
    if (flags != POSE_NONE) pose_mount(&body, &device->site->mount, head);
    return flags;
}

/* The pose on the trajectory. The platform stands before its begin and after its end. */
static void on_path(const struct site *site, int64_t t_ns, struct pose *out)
{
    const struct pose_knot *knot = site->knot;
    size_t low = pose_find_knot(knot, site->n_knots, t_ns), high = low + 1;
    *out = knot[low].pose;
    if (t_ns > knot[0].t_ns && high < site->n_knots)
        pose_between(&knot[low].pose, &knot[high].pose,
                     (double)(t_ns - knot[low].t_ns) / (double)(knot[high].t_ns - knot[low].t_ns), out);
}

int device_head_pose(struct device *device, int64_t t_ns, struct pose *head)
{
    const struct site *site = device->site;
    if (!site->moving) return 0;
    if (site->n_knots != 0) {
        int64_t start_ns = (int64_t)device->scan.tick0 * device->tick_ns;
        int64_t end_ns = device->scan.on ? t_ns : (int64_t)device->scan.end_tick * device->tick_ns;
        on_path(site, device->scan.number == 0 ? 0 : (t_ns < end_ns ? t_ns : end_ns) - start_ns, head);
        return 1;
    }
    return live_head_at(device, t_ns, head) != POSE_NONE;
}

static void make_knot(struct device *device, int64_t t_ns, struct pose_knot *knot)
{
    const struct placement *at = &device->site->station[device->scan.station].at;
    *knot = (struct pose_knot){.t_ns = t_ns};
    knot->flags = live_head_at(device, (int64_t)device->scan.tick0 * device->tick_ns + t_ns, &knot->pose);
    if (knot->flags != POSE_NONE) return;
    memcpy(knot->pose.position_m, at->position_m, sizeof at->position_m);
    pose_from_matrix(at->rotation, knot->pose.quat);
}

/* Adds the event once per episode: a second without a late pose ends an episode. */
static void count_late(struct device *device, const struct pose_knot *knot, struct device_work *work)
{
    struct device_live *live = &device->live;
    if ((knot->flags & (POSE_LATE | POSE_NONE)) == 0) return;
    uint64_t n = atomic_fetch_add(&device->counters.late_poses, 1) + 1;
    const int is_none = knot->flags == POSE_NONE;
    const int64_t at_ns = (int64_t)device->scan.tick0 * device->tick_ns + knot->t_ns;
    const int64_t since_ns = is_none ? 0 : at_ns - sample_at(live, live->n - 1)->t_ns;
    if (live->said_tick == 0 || work->tick - live->said_tick > device->tick_hz) {
        char text[96];
        snprintf(text, sizeof text,
                 is_none ? "no pose yet: the head is assumed to be at the station"
                         : "no pose came in time: the platform is assumed to stand");
        device_push_event(&device->events, NATIVE_EV_POSE_LATE, n, 0, (uint64_t)since_ns, text);
    }
    live->said_tick = work->tick;
}

void device_take_poses(struct device *device, struct device_work *work)
{
    struct device_live *live = &device->live;
    if (device->site->cfg->platform.kind != PLATFORM_LIVE || work->pulse_end == work->pulse0) return;
    int64_t from = schedule_time_ns(&work->segment, work->pulse0) / device->tick_ns;
    int64_t to = schedule_time_ns(&work->segment, work->pulse_end - 1) / device->tick_ns + 1;
    if (live->next == 0) memset(live->knot, 0, sizeof live->knot);
    for (; live->next <= to; live->next++) {
        struct pose_knot *knot = &live->knot[live->next % LEN(live->knot)];
        make_knot(device, live->next * device->tick_ns, knot);
        count_late(device, knot, work);
    }
    if (to - from >= DEVICE_MAX_POSES) from = to - DEVICE_MAX_POSES + 1; /* device_create has refused such heads */
    for (int64_t i = from; i <= to; i++)
        work->pose[work->n_poses++] = live->knot[i % LEN(live->knot)];
}
