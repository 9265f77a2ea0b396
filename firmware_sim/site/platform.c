/* SPDX-License-Identifier: MIT */
#include "firmware_sim/site/steps.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/angle.h"
#include "core/grow.h"
#include "core/vec3.h"
#include "firmware_sim/config/config.h"

/* Limits for the head's poses. Their path is within TOLERANCE_M of the trajectory. Two poses are at most LONGEST_NS
 * apart, as recorded ones are. They may be further apart while the head moves by at most LONGEST_M and turns by at most
 * 0.01 rad. */
static const double TOLERANCE_M = 1e-4, LONGEST_M = 0.01;
static const int64_t LONGEST_NS = 10000000;

/* The part of the trajectory that the configuration names, in the times of the trajectory's file. */
struct part {
    struct trajectory *trajectory; /* the caller that opened it frees it; NULL: the head stands at its stations */
    double start_s, end_s;
};

/* A sum of two times is rounded, by up to 2e-7 s where they count from 1970. So a part that ends with the trajectory
 * may seem to end this much later. */
static const double ROUNDING_S = 1e-6;

/* The keys that give the times, and their unit, for messages: with frames_per_s the configuration has frames. */
struct times {
    const char *start, *end, *step, *unit;
    double per_s;
};

static struct times times_of(const struct config_platform *p)
{
    if (p->frames_per_s > 0.0)
        return (struct times){"first_frame", "last_frame", "frame_step", "frames", p->frames_per_s};
    return (struct times){"start_s", "end_s", "step_s", "s", 1.0};
}

static int check_part(const struct site *site, double length_s, struct sh_err *err)
{
    const struct config_platform *p = &site->cfg->platform;
    const struct times times = times_of(p);
    const int wrong_end = p->has_end && p->end_s > length_s + ROUNDING_S;
    /* A scan that ends with the trajectory has no pulse if it begins at the trajectory's end. A head that scans at
     * stops may begin there: it has one stop. So may a platform that waits at the end. */
    const int must_go = p->kind == PLATFORM_TRAJECTORY && p->at_end == PLATFORM_STOP;
    if (must_go && !(length_s > 0.0))
        return sh_fail(
            err, SH_EINPUT,
            "%s: platform.kind trajectory: the trajectory has one pose, and the scan would end with it; allowed "
            "two poses and more, or at_end: hold",
            site->cfg->file);
    if (!wrong_end && must_go && p->start_s >= length_s - ROUNDING_S)
        return sh_fail(err, SH_EINPUT,
                       "%s: platform.%s: %.9g %s is not before the trajectory's end; allowed 0 to below %.9g",
                       site->cfg->file, times.start, times.per_s * p->start_s, times.unit, times.per_s * length_s);
    if (!wrong_end && p->start_s <= length_s + ROUNDING_S) return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s: platform.%s: %.9g %s is after the trajectory's end; allowed %.9g to %.9g",
                   site->cfg->file, wrong_end ? times.end : times.start,
                   times.per_s * (wrong_end ? p->end_s : p->start_s), times.unit,
                   wrong_end ? times.per_s * p->start_s : 0.0, times.per_s * length_s);
}

static int open_trajectory(const struct site *site, const struct sh_report *report, struct part *part,
                           struct sh_err *err)
{
    const struct config_platform *p = &site->cfg->platform;
    double first_s, last_s;
    if (p->file[0] == '\0' && p->waypoints[0] == '\0') { /* the head stands at its stations */
        *part = (struct part){NULL, p->start_s, p->end_s};
        return SH_OK;
    }
    int rc = p->file[0] != '\0'
                 ? trajectory_read_csv(p->file, report, &part->trajectory, err)
                 : trajectory_read_waypoints(p->waypoints, site->anchor.known ? &site->anchor.frame : NULL, report,
                                             &part->trajectory, err);
    if (rc != SH_OK) return rc;
    trajectory_span(part->trajectory, &first_s, &last_s);
    part->start_s = fmin(first_s + p->start_s, last_s);
    part->end_s = p->has_end ? fmin(first_s + p->end_s, last_s) : last_s;
    rc = check_part(site, last_s - first_s, err);
    if (rc != SH_OK) trajectory_free(part->trajectory);
    return rc;
}

/* Sets the pose of the head on the platform. */
static void set_mount(struct site *site)
{
    const struct config_platform *p = &site->cfg->platform;
    struct pose *mount = &site->mount;
    memcpy(mount->position_m, p->mount_m, sizeof p->mount_m);
    pose_from_angles(angle_rad(p->mount_heading_deg), angle_rad(p->mount_pitch_deg), angle_rad(p->mount_roll_deg),
                     mount->quat);
}

/* ---- a head that moves */

static int load_knots(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct config_platform *p = &site->cfg->platform;
    struct part part;
    struct sh_err why;
    int rc = open_trajectory(site, report, &part, err);
    if (rc != SH_OK) return rc;
    const struct pose_knot_rules rules = {part.start_s, part.end_s, TOLERANCE_M, LONGEST_NS, LONGEST_M};
    struct pose_path path;
    rc = trajectory_knots(part.trajectory, &site->mount, &rules, report, &path, &why);
    site->knot = path.knot;
    site->n_knots = path.n;
    site->knot_error_m = path.error_m;
    trajectory_free(part.trajectory);
    if (rc == SH_ESTOPPED) return sh_fail_stopped(err);
    if (rc != SH_OK)
        return sh_fail(err, rc, "%s: platform.%s: %.300s", site->cfg->file, p->file[0] != '\0' ? "file" : "waypoints",
                       why.text);
    if (site->knot_error_m > TOLERANCE_M * 1.001)
        sh_warn(
            report,
            "the trajectory bends more than poses %g ms apart can follow: the head deviates from it by up to %.2g m",
            1e-3 * POSE_MIN_STEP_US, site->knot_error_m);
    return rc;
}

/* Gathers poses from `first` on while their box fits into the reach. Returns the first that does not fit; also the
 * box's centre and radius. */
static size_t gather(const struct site *site, size_t first, double centre_m[3], double *radius_m)
{
    double lo[3], hi[3];
    size_t i = first;
    *radius_m = 0.0;
    memcpy(lo, site->knot[first].pose.position_m, sizeof lo);
    memcpy(hi, lo, sizeof hi);
    for (; i < site->n_knots; i++) {
        double next_lo[3], next_hi[3], half2 = 0.0;
        for (int k = 0; k < 3; k++) {
            next_lo[k] = fmin(lo[k], site->knot[i].pose.position_m[k]);
            next_hi[k] = fmax(hi[k], site->knot[i].pose.position_m[k]);
            half2 += 0.25 * (next_hi[k] - next_lo[k]) * (next_hi[k] - next_lo[k]);
        }
        if (half2 > SITE_STRETCH_M * SITE_STRETCH_M) break;
        memcpy(lo, next_lo, sizeof lo);
        memcpy(hi, next_hi, sizeof hi);
        *radius_m = sqrt(half2);
    }
    for (int k = 0; k < 3; k++)
        centre_m[k] = lo[k] + 0.5 * (hi[k] - lo[k]);
    return i;
}

static int add_stretch(struct site *site, const double centre_m[3], double reach_m, int64_t until_ns,
                       struct sh_err *err)
{
    if (site->n_stretches == SITE_MAX_STRETCHES)
        return sh_fail(err, SH_EINPUT, "%s: platform: the path is too long; allowed %d stretches of %.0f m across",
                       site->cfg->file, SITE_MAX_STRETCHES, 2.0 * SITE_STRETCH_M);
    if (!resize(&site->stretch, site->n_stretches + 1, sizeof *site->stretch))
        return sh_fail(err, SH_ENOMEM, "no memory for the path");
    struct site_stretch *stretch = &site->stretch[site->n_stretches++];
    *stretch = (struct site_stretch){.until_ns = until_ns, .reach_m = reach_m};
    memcpy(stretch->centre_m, centre_m, sizeof stretch->centre_m);
    return SH_OK;
}

/* Cuts the path into stretches. A stretch ends at the time of its last pose, rounded up to a millisecond. In the rest
 * of that millisecond the head moves on beyond the last pose. So the reach also covers the poses of the next 100 ms,
 * which is more than enough. */
static int cover_path(struct site *site, struct sh_err *err)
{
    int rc = SH_OK;
    for (size_t i = 0; i < site->n_knots && rc == SH_OK;) {
        double centre_m[3], radius_m;
        size_t end = gather(site, i, centre_m, &radius_m);
        double beyond_m = 0.0;
        int64_t until_ns = end < site->n_knots ? site->knot[end - 1].t_ns : INT64_MAX;
        for (size_t k = end; k < site->n_knots && site->knot[k - 1].t_ns < until_ns + 100000000; k++)
            beyond_m =
                fmax(beyond_m, vec3_distance(site->knot[k].pose.position_m, site->knot[end - 1].pose.position_m));
        if (until_ns != INT64_MAX) until_ns = (until_ns + 999999) / 1000000 * 1000000; /* anchors have milliseconds */
        rc = add_stretch(site, centre_m, radius_m + beyond_m + 1e-3, until_ns, err);
        i = end == site->n_knots || end == i + 1 ? end : end - 1; /* two stretches share a pose */
    }
    return rc;
}

int site_load_platform(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    const struct config_platform *p = &cfg->platform;
    set_mount(site);
    if (p->kind == PLATFORM_LIVE) {
        const double *arm = p->mount_m;
        site->live_reach_m = p->reach_m + sqrt(vec3_dot(arm, arm));
        return add_stretch(site, site->station[0].at.position_m, site->live_reach_m, INT64_MAX, err);
    }
    int rc = load_knots(site, report, err);
    return rc == SH_OK ? cover_path(site, err) : rc;
}

/* ---- a head that stops */

/* The last stop may be after the end by a rounding error. 1e-9 of a step is enough for times that people write. */
static int count_stops(const struct site *site, const struct part *part, uint32_t *n, struct sh_err *err)
{
    const struct config_platform *p = &site->cfg->platform;
    double length_s = part->end_s - part->start_s, steps = floor(length_s / p->step_s + 1e-9);
    const double n_each = part->trajectory != NULL ? 1 : site->cfg->n_stations;
    const struct times times = times_of(p);
    const double length = times.per_s * length_s;
    if (n_each * (steps + 1.0) > CONFIG_MAX_STOPS && part->trajectory == NULL)
        return sh_fail(err, SH_EINPUT,
                       "%s: platform.%s: %.0f stops at %.0f stations in %.9g %s; allowed at most %d in all",
                       site->cfg->file, times.step, steps + 1.0, n_each, length, times.unit, CONFIG_MAX_STOPS);
    if (steps + 1.0 > CONFIG_MAX_STOPS)
        return sh_fail(err, SH_EINPUT, "%s: platform.%s: %.0f stops in %.9g %s; allowed at most %d, steps of %.9g %s",
                       site->cfg->file, times.step, steps + 1.0, length, times.unit, CONFIG_MAX_STOPS,
                       length / (CONFIG_MAX_STOPS - 1), times.unit);
    *n = (uint32_t)n_each * ((uint32_t)steps + 1);
    if (site->cfg->head.settings.station > *n)
        return sh_fail(err, SH_EINPUT, "%s: head.station: there is no stop %u; allowed 1 to %u", site->cfg->file,
                       site->cfg->head.settings.station, *n);
    return SH_OK;
}

/* Makes the only station's place on the Earth an anchor of the scene. */
static int anchor_scene(struct site *site, struct sh_err *err)
{
    const struct placement *at = &site->station[0].at;
    if (site->anchor.known || !at->on_earth) return SH_OK;
    site->anchor.known = 1;
    return geoframe_set_tangent(&site->anchor.frame, at->position_m, &at->place, 0.0, err);
}

static int place(const struct site *site, const struct pose *head, struct placement *at, struct sh_err *err)
{
    memcpy(at->position_m, head->position_m, sizeof at->position_m);
    quat_matrix(head->quat, at->rotation);
    at->floor_m = NAN;
    at->on_earth = site->anchor.known;
    return at->on_earth ? geoframe_locate(&site->anchor.frame, at->position_m, &at->place, err) : SH_OK;
}

/* Describes a stop as a station of the configuration. */
static void platform_describe(const struct pose *head, uint32_t i, struct config_station *out)
{
    double heading, pitch, roll;
    pose_to_angles(head->quat, &heading, &pitch, &roll);
    snprintf(out->name, sizeof out->name, "stop-%u", i + 1);
    memcpy(out->position_m, head->position_m, sizeof out->position_m);
    out->has_position = 1;
    out->heading_deg = angle_deg(heading);
    out->pitch_deg = angle_deg(pitch);
    out->roll_deg = angle_deg(roll);
}

/* Sets the k-th time of the stops, from the trajectory's first sample on. Where the configuration counts in frames, the
 * frame number is set, too. */
static void set_time(const struct site *site, uint32_t k, struct site_station *s)
{
    const struct config_platform *p = &site->cfg->platform;
    s->t_s = p->start_s + k * p->step_s;
    if (!(p->frames_per_s > 0.0)) return;
    s->frame = p->first_frame + k * p->frame_step;
    s->t_s = s->frame / p->frames_per_s;
}

/* Digits that tell the numbers of all stops from each other: nine, or as many as the step between two needs. The last
 * digit is worth at most half a step, since numbers at the same distance from two others may be rounded to one. */
static int count_digits(const struct site *site)
{
    const struct config_platform *p = &site->cfg->platform;
    const uint32_t n_times = site->n_stations / site->cfg->n_stations;
    int digits = 9;
    if (!(p->frames_per_s > 0.0)) return digits;
    const double whole = floor(log10(p->first_frame + (n_times - 1) * p->frame_step)) + 1.0;
    while (digits < 17 && pow(10.0, whole - digits) > 0.5 * p->frame_step)
        digits++;
    return digits;
}

/* Without a trajectory the stops are all stations of the configuration at the first time, then all at the next time.
 * The times are numbered from 1 on, as way-points are. The frame of a stop is the number of its time, unless the
 * configuration counts in frames (set_time). */
static void add_standing(struct site *site, const struct site_station *standing, uint32_t i)
{
    const uint32_t n = site->cfg->n_stations, k = i / n;
    struct site_station *s = &site->station[i];
    const struct config_station *station = standing[i % n].station;
    s->at = standing[i % n].at;
    s->station = &site->stop[i];
    site->stop[i] = *station;
    s->frame = k + 1;
    set_time(site, k, s);
    char number[24]; /* %.17g of a number from 0 on has up to 23 bytes */
    snprintf(number, sizeof number, "%.*g", count_digits(site), s->frame);
    snprintf(site->stop[i].name, sizeof site->stop[i].name, "%.*s frame %s", CONFIG_NAME_LEN - 1, station->name,
             number);
}

static int add_stop(struct site *site, const struct part *part, uint32_t i, struct sh_err *err)
{
    const struct config_platform *p = &site->cfg->platform;
    struct site_station *s = &site->station[i];
    struct pose body, head;
    struct sh_err why;
    double since_s = i * p->step_s;
    trajectory_at(part->trajectory, fmin(part->start_s + since_s, part->end_s), &body, &s->frame);
    pose_mount(&body, &site->mount, &head);
    set_time(site, i, s);
    s->station = &site->stop[i];
    platform_describe(&head, i, &site->stop[i]);
    int rc = place(site, &head, &s->at, &why);
    return rc == SH_OK ? rc : sh_fail(err, rc, "%s: stop %u: %.300s", site->cfg->file, i + 1, why.text);
}

int site_load_stops(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    struct part part;
    uint32_t n = 0;
    int rc = open_trajectory(site, report, &part, err);
    if (rc != SH_OK) return rc;
    rc = count_stops(site, &part, &n, err);
    if (rc == SH_OK && part.trajectory != NULL) rc = anchor_scene(site, err);
    struct site_station *standing = site->station;
    if (rc == SH_OK) {
        site->station = calloc(n, sizeof *site->station);
        site->stop = calloc(n, sizeof *site->stop);
        site->n_stations = site->station != NULL ? n : 0;
        if (site->station == NULL || site->stop == NULL) rc = sh_fail(err, SH_ENOMEM, "no memory for %u stops", n);
    }
    set_mount(site);
    for (uint32_t i = 0; i < n && rc == SH_OK; i++) {
        if ((rc = sh_check_stop(report, err)) != SH_OK) break;
        if (part.trajectory != NULL)
            rc = add_stop(site, &part, i, err);
        else
            add_standing(site, standing, i);
    }
    if (standing != site->station) free(standing);
    trajectory_free(part.trajectory);
    return rc;
}

int site_count_stations(const struct config *cfg, const struct sh_report *report, uint32_t *n, struct sh_err *err)
{
    struct site site = {.cfg = cfg};
    struct part part;
    *n = cfg->n_stations;
    if (cfg->platform.kind != PLATFORM_STOPS) return SH_OK;
    int rc = placement_find_anchor(cfg, report, &site.anchor, err);
    if (rc == SH_OK) rc = open_trajectory(&site, report, &part, err);
    if (rc != SH_OK) return rc;
    rc = count_stops(&site, &part, n, err);
    trajectory_free(part.trajectory);
    return rc;
}
