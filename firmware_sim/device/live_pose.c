/* SPDX-License-Identifier: MIT */
/* The head's pose: the end of a trajectory, and a live platform's poses. */
#include <stdio.h>
#include <string.h>

#include "core/angle.h"
#include "core/vec3.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/device/device_state.h"

#define LEN(array) ((int64_t)(sizeof(array) / sizeof((array)[0])))

int64_t device_path_end_ns(const struct device *device)
{
    const struct site *site = device->site;
    if (site->n_knots == 0 || site->cfg->platform.at_end == PLATFORM_HOLD) return INT64_MAX;
    return site->knot[site->n_knots - 1].t_ns;
}

static const struct device_sample *sample_at(const struct device_live *live, uint64_t i)
{
    return &live->sample[i % LEN(live->sample)];
}

static int is_near(const struct device *device, const struct pose *pose)
{
    double off_m = vec3_distance(pose->position_m, device->site->station[0].at.position_m);
    return off_m <= device->site->cfg->platform.reach_m;
}

/* Whether a pose is so far ahead that its time must be wrong. Such a pose would keep out all poses with right times. In
 * the pace `step` a client grants the time, so no pose counts as too far ahead. */
static int is_early(const struct device *device, int64_t t_ns)
{
    int64_t now_ns = (int64_t)device->next_tick * device->tick_ns;
    return device->site->cfg->loop.pace != PACE_STEP && t_ns > now_ns + DEVICE_POSE_AHEAD_S * INT64_C(1000000000);
}

int device_pose(struct device *device, int64_t t_ns, const double v[6])
{
    struct device_live *live = &device->live;
    struct pose pose = {.position_m = {v[0], v[1], v[2]}};
    pose_from_angles(angle_rad(v[5]), angle_rad(v[4]), angle_rad(v[3]), pose.quat);
    pthread_mutex_lock(&device->lock);
    int bad = (live->n != 0 && t_ns <= sample_at(live, live->n - 1)->t_ns) || !is_near(device, &pose) ||
              is_early(device, t_ns);
    if (!bad) live->sample[live->n++ % LEN(live->sample)] = (struct device_sample){t_ns, pose};
    pthread_mutex_unlock(&device->lock);
    if (bad) atomic_fetch_add(&device->counters.bad_poses, 1);
    return bad;
}

/* After the last pose the motion between the last two poses goes on for extrapolate_ms. Then the platform stands. Where
 * the motion would leave the reach, the platform stands at the last pose instead. */
static uint32_t extrapolate(const struct device *device, int64_t t_ns, struct pose *out)
{
    const struct device_live *live = &device->live;
    int64_t last_ns = sample_at(live, live->n - 1)->t_ns,
            most_ns = (int64_t)(device->site->cfg->platform.extrapolate_ms * 1e6);
    uint32_t flags = t_ns - last_ns > most_ns ? POSE_LATE : POSE_EXTRAPOLATED;
    *out = sample_at(live, live->n - 1)->pose;
    if (live->n < 2) return flags;
    int64_t before_ns = sample_at(live, live->n - 2)->t_ns;
    int64_t on_ns = flags == POSE_LATE ? last_ns + most_ns : t_ns;
    struct pose on;
    pose_between(&sample_at(live, live->n - 2)->pose, out, (double)(on_ns - before_ns) / (double)(last_ns - before_ns),
                 &on);
    if (!is_near(device, &on)) return POSE_LATE;
    *out = on;
    return flags;
}

static uint32_t platform_at(const struct device *device, int64_t t_ns, struct pose *out)
{
    const struct device_live *live = &device->live;
    uint64_t kept = live->n < (uint64_t)LEN(live->sample) ? live->n : (uint64_t)LEN(live->sample);
    if (t_ns > sample_at(live, live->n - 1)->t_ns) return extrapolate(device, t_ns, out);
    for (uint64_t i = live->n - 1; i + kept > live->n; i--) {
        int64_t a_ns = sample_at(live, i - 1)->t_ns, b_ns = sample_at(live, i)->t_ns;
        if (t_ns < a_ns) continue;
        pose_between(&sample_at(live, i - 1)->pose, &sample_at(live, i)->pose,
                     (double)(t_ns - a_ns) / (double)(b_ns - a_ns), out);
        return 0;
    }
    *out = sample_at(live, live->n - kept)->pose; /* t_ns is before all poses that are still here */
    return 0;
}

/* Finds the pose of the head on the platform. Returns the pose's flags. */
static uint32_t live_head_at(const struct device *device, int64_t t_ns, struct pose *head)
{
    struct pose body;
    uint32_t flags = platform_at(device, t_ns, &body);
    pose_mount(&body, &device->site->mount, head);
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
    if (!site->moving || (site->n_knots == 0 && device->live.n == 0)) return 0;
    if (site->n_knots != 0) {
        int64_t start_ns = (int64_t)device->scan.tick0 * device->tick_ns;
        int64_t end_ns = device->scan.on ? t_ns : (int64_t)device->scan.end_tick * device->tick_ns;
        on_path(site, device->scan.number == 0 ? 0 : (t_ns < end_ns ? t_ns : end_ns) - start_ns, head);
        return 1;
    }
    live_head_at(device, t_ns, head);
    return 1;
}

static void make_knot(struct device *device, int64_t t_ns, struct pose_knot *knot)
{
    const struct site *site = device->site;
    *knot = (struct pose_knot){.t_ns = t_ns};
    if (device->live.n == 0) {
        const struct placement *at = &site->station[device->scan.station].at;
        memcpy(knot->pose.position_m, at->position_m, sizeof at->position_m);
        pose_from_matrix(at->rotation, knot->pose.quat);
        knot->flags = POSE_NONE;
        return;
    }
    knot->flags = live_head_at(device, (int64_t)device->scan.tick0 * device->tick_ns + t_ns, &knot->pose);
}

/* Adds the event once per episode: a second without a late pose ends an episode. */
static void count_late(struct device *device, const struct pose_knot *knot, struct device_work *work)
{
    struct device_live *live = &device->live;
    if ((knot->flags & (POSE_LATE | POSE_NONE)) == 0) return;
    uint64_t n = atomic_fetch_add(&device->counters.late_poses, 1) + 1;
    int64_t since_ns =
        live->n == 0 ? 0
                     : (int64_t)device->scan.tick0 * device->tick_ns + knot->t_ns - sample_at(live, live->n - 1)->t_ns;
    if (live->said_tick == 0 || work->tick - live->said_tick > device->tick_hz) {
        char text[96];
        snprintf(text, sizeof text,
                 live->n == 0 ? "no pose yet: the head is assumed to be at the station"
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
