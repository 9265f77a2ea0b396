/* SPDX-License-Identifier: MIT */
/* Trajectories from files: samples, and way-points. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/angle.h"
#include "core/grow.h"
#include "core/mat3.h"
#include "core/csv.h"
#include "core/pose/trajectory.h"

static const double STEP_S = 0.02;  /* between the samples that way-points become */
static const double STEP_M = 0.01;  /* between these samples, where the platform needs longer than STEP_S for it */
static const double LEG_PARTS = 64; /* a leg may have this many, however short: a cubic curve needs them */
static const double SLOWEST_M_S = 1e-3;
static const double LATEST_S = 4e9; /* the year 2096, in seconds since 1970; differences fit into 63 bits of ns */

struct samples {
    struct pose_sample *at;
    size_t n, room;
};

static struct pose_sample *add_sample(struct samples *s)
{
    if (!grow(&s->at, &s->room, s->n + 1, sizeof *s->at)) return NULL;
    struct pose_sample *sample = &s->at[s->n++];
    memset(sample, 0, sizeof *sample);
    return sample;
}

/* ---- samples */

enum { T, X, Y, Z, HEADING, PITCH, ROLL, QW, QX, QY, QZ, FRAME, SCAN, FLAGS };
static const char *const sample_columns[] = {"t_s", "x_m", "y_m", "z_m",   "heading_deg", "pitch_deg", "roll_deg", "qw",
                                             "qx",  "qy",  "qz",  "frame", "scan",        "flags",     NULL};

static int has_all(const struct csv *csv, uint32_t mask)
{
    return (csv->has & mask) == mask;
}

static int check_columns(const struct csv *csv, struct sh_err *err)
{
    const uint32_t place = 1u << T | 1u << X | 1u << Y | 1u << Z, quat = 1u << QW | 1u << QX | 1u << QY | 1u << QZ;
    const uint32_t angles = 1u << HEADING | 1u << PITCH | 1u << ROLL;
    int by_quat = has_all(csv, quat) && !(csv->has & angles),
        by_angles = has_all(csv, 1u << HEADING) && !(csv->has & quat);
    if (has_all(csv, place) && (by_quat || by_angles)) return SH_OK;
    return text_fail(
        &csv->text, csv->line, SH_EINPUT, err,
        "the columns must be t_s, x_m, y_m, z_m and either heading_deg (with pitch_deg, roll_deg) or qw, qx, qy, qz");
}

static int check_position(const struct csv *csv, int x, struct sh_err *err)
{
    for (int k = x; k < x + 3; k++)
        if (fabs(csv->value[k]) > 1e9)
            return text_fail(&csv->text, csv->line, SH_EINPUT, err, "%s %.6g; allowed -1e9 to 1e9", csv->known[k],
                             csv->value[k]);
    return SH_OK;
}

static int take_sample(const struct csv *csv, const struct pose_sample *before, struct pose_sample *s,
                       struct sh_err *err)
{
    const double *v = csv->value;
    s->t_s = v[T];
    memcpy(s->pose.position_m, v + X, sizeof s->pose.position_m);
    if (csv->has & 1u << QW) {
        double length = sqrt(v[QW] * v[QW] + v[QX] * v[QX] + v[QY] * v[QY] + v[QZ] * v[QZ]);
        if (!(length >= 0.9995 && length <= 1.0005))
            return text_fail(&csv->text, csv->line, SH_EINPUT, err,
                             "a quaternion of length %.6g; allowed 0.9995 to 1.0005", length);
        memcpy(s->pose.quat, v + QW, sizeof s->pose.quat);
    } else {
        if (fabs(v[PITCH]) > 90.0 || fabs(v[HEADING]) > 1e6 || fabs(v[ROLL]) > 360.0)
            return text_fail(
                &csv->text, csv->line, SH_EINPUT, err,
                "an attitude out of range; allowed heading_deg -1e6 to 1e6, pitch_deg -90 to 90, roll_deg -360 to 360");
        pose_from_angles(angle_rad(fmod(v[HEADING], 360.0)), angle_rad(v[PITCH]), angle_rad(v[ROLL]), s->pose.quat);
    }
    int rc = check_position(csv, X, err);
    if (rc != SH_OK) return rc;
    if (!(fabs(s->t_s) <= LATEST_S))
        return text_fail(&csv->text, csv->line, SH_EINPUT, err, "t_s %.9g; allowed %g to %g", s->t_s, -LATEST_S,
                         LATEST_S);
    if (before != NULL && !trajectory_is_later(s, before))
        return text_fail(&csv->text, csv->line, SH_EINPUT, err,
                         "t_s %.15g comes after %.15g; allowed rising times, at least %g s apart", s->t_s, before->t_s,
                         1e-6 * POSE_MIN_STEP_US);
    return SH_OK;
}

static int read_samples(struct csv *csv, struct samples *samples, struct sh_err *err)
{
    int rc = check_columns(csv, err);
    while (rc == SH_OK) {
        int got = csv_next(csv, err);
        if (got <= 0) return got;
        struct pose_sample *s = add_sample(samples);
        if (s == NULL) return text_fail(&csv->text, 0, SH_ENOMEM, err, "no memory for its samples");
        s->frame = csv->has & 1u << FRAME ? csv->value[FRAME] : (double)(samples->n - 1);
        rc = take_sample(csv, samples->n > 1 ? s - 1 : NULL, s, err);
    }
    return rc;
}

int trajectory_read_csv(const char *path, const struct sh_report *report, struct trajectory **out, struct sh_err *err)
{
    struct csv csv;
    struct samples samples = {0};
    *out = NULL;
    int rc = csv_open(&csv, path, sample_columns, report, err);
    if (rc == SH_OK) rc = read_samples(&csv, &samples, err);
    if (rc == SH_OK && samples.n == 0) rc = text_fail(&csv.text, 0, SH_EINPUT, err, "no samples below the first line");
    if (rc == SH_OK) rc = trajectory_from_samples(samples.at, samples.n, out, err);
    csv_close(&csv);
    free(samples.at);
    return rc;
}

/* ---- way-points */

enum { WX, WY, WZ, SPEED, PAUSE };
static const char *const waypoint_columns[] = {"x_m", "y_m", "z_m", "speed_m_s", "pause_s", NULL};

/* Way-points of a file. */
struct way {
    struct samples points;     /* their times don't count pauses */
    double *pause_s, pauses_s; /* the pause of each point; the sum of all */
    size_t pauses_room;
};

static int check_waypoint(const struct csv *csv, struct sh_err *err)
{
    const double *v = csv->value, least_s = 1e-6 * POSE_MIN_STEP_US;
    if (!(v[SPEED] >= SLOWEST_M_S && v[SPEED] <= 1000.0))
        return text_fail(&csv->text, csv->line, SH_EINPUT, err, "speed_m_s %.6g; allowed %g to 1000", v[SPEED],
                         SLOWEST_M_S);
    if (v[PAUSE] != 0.0 && !(v[PAUSE] >= least_s && v[PAUSE] <= 86400.0))
        return text_fail(&csv->text, csv->line, SH_EINPUT, err, "pause_s %.6g; allowed 0, or %g to 86400", v[PAUSE],
                         least_s);
    return check_position(csv, WX, err);
}

/* speed_m_s is the speed on the way to this point. */
static int add_waypoint(const struct csv *csv, double speed_m_s, struct way *way, struct sh_err *err)
{
    const double *v = csv->value;
    struct pose_sample *s = add_sample(&way->points);
    if (s == NULL || !grow(&way->pause_s, &way->pauses_room, way->points.n, sizeof *way->pause_s))
        return text_fail(&csv->text, 0, SH_ENOMEM, err, "no memory for its way-points");
    way->pause_s[way->points.n - 1] = v[PAUSE];
    way->pauses_s += v[PAUSE];
    memcpy(s->pose.position_m, v + WX, sizeof s->pose.position_m);
    s->pose.quat[0] = 1.0;
    s->frame = (double)(way->points.n - 1);
    if (way->points.n == 1) return SH_OK;
    double chord_m = trajectory_chord_m(s, s - 1), way_s = chord_m / speed_m_s;
    if (!(way_s >= 1e-6 * POSE_MIN_STEP_US && way_s < 1e6))
        return text_fail(&csv->text, csv->line, SH_EINPUT, err,
                         "%.6g m from the previous way-point, which take %.6g s at its speed; allowed %g to 1e6 s",
                         chord_m, way_s, 1e-6 * POSE_MIN_STEP_US);
    s->t_s = s[-1].t_s + way_s;
    if (s->t_s + way->pauses_s <= LATEST_S) return SH_OK;
    return text_fail(&csv->text, csv->line, SH_EINPUT, err, "%.9g s from the first way-point on; allowed %g",
                     s->t_s + way->pauses_s, LATEST_S);
}

static int read_waypoints(struct csv *csv, struct way *way, struct sh_err *err)
{
    double speed_m_s = 0.0;
    if (!has_all(csv, 1u << WX | 1u << WY | 1u << WZ | 1u << SPEED))
        return text_fail(&csv->text, csv->line, SH_EINPUT, err,
                         "the columns must be x_m, y_m, z_m, speed_m_s, and may have pause_s");
    for (;;) {
        int rc = csv_next(csv, err);
        if (rc == 0 && way->points.n < 2) return text_fail(&csv->text, 0, SH_EINPUT, err, "fewer than two way-points");
        if (rc <= 0) return rc;
        rc = check_waypoint(csv, err);
        if (rc == SH_OK) rc = add_waypoint(csv, speed_m_s, way, err);
        if (rc != SH_OK) return rc;
        speed_m_s = csv->value[SPEED];
    }
}

/* Sets the heading of the way from d before t_s to d after it, in the axes of level. Where the way goes straight up,
 * *heading_rad stays as it is. */
static void heading_at(const struct trajectory *curve, double t_s, double d, const double level[9], double *heading_rad)
{
    struct pose a, b;
    double frame;
    trajectory_at(curve, t_s - d, &a, &frame);
    trajectory_at(curve, t_s + d, &b, &frame);
    double step_m[3], on_m[3];
    vec3_sub(b.position_m, a.position_m, step_m);
    mat3_apply_transposed(level, step_m, on_m);
    if (hypot(on_m[0], on_m[1]) > d * SLOWEST_M_S) *heading_rad = atan2(on_m[0], on_m[1]);
}

/* The share of an interval's way that is done after the share f of its time: the cubic from 0 to 1 whose slope at
 * either end is 1, or 0 where the platform is at rest there. */
static double along(double f, int from_rest, int to_rest)
{
    double g = 1.0 - f;
    return f + f * g * (f * to_rest - g * from_rest);
}

/* Returns the number of parts of the way after point i. A part takes STEP_S, or the time for STEP_M where that is
 * longer. A way may have LEG_PARTS parts even if they are shorter than STEP_M. */
static size_t leg_parts(const struct trajectory *curve, size_t i)
{
    if (i + 1 >= curve->n) return 1;
    double chord_m = trajectory_chord_m(&curve->sample[i], &curve->sample[i + 1]);
    double by_time = ceil((curve->sample[i + 1].t_s - curve->sample[i].t_s) / STEP_S);
    return (size_t)fmax(1.0, fmin(by_time, fmax(LEG_PARTS, ceil(chord_m / STEP_M))));
}

/* Going along a curve. */
struct walk {
    const struct trajectory *curve;
    const struct geoframe *frame; /* NULL: up is the scene's z everywhere */
    const struct sh_report *report;
    struct samples out;
    double heading_rad; /* of the last sample */
};

/* Adds a sample at time t_s. The sample's place is that of the curve at curve_s, its heading is that of the way from
 * curve_s - d to curve_s + d. */
static int put_sample(struct walk *w, double curve_s, double t_s, double d, struct sh_err *err)
{
    struct pose_sample *s = add_sample(&w->out);
    double level[9], level_quat[4], turn[4];
    if ((w->out.n & 0xfff) == 0 && sh_check_stop(w->report, err) != SH_OK) return SH_ESTOPPED;
    if (s == NULL) return sh_fail(err, SH_ENOMEM, "no memory for its samples");
    s->t_s = t_s;
    trajectory_at(w->curve, curve_s, &s->pose, &s->frame);
    int rc = w->frame != NULL ? geoframe_level(w->frame, s->pose.position_m, level, err) : SH_OK;
    if (rc != SH_OK) return rc;
    heading_at(w->curve, curve_s, d, w->frame != NULL ? level : mat3_unit, &w->heading_rad);
    pose_from_angles(w->heading_rad, 0.0, 0.0, w->frame != NULL ? turn : s->pose.quat);
    if (w->frame == NULL) return SH_OK;
    pose_from_matrix(level, level_quat);
    quat_multiply(level_quat, turn, s->pose.quat);
    return SH_OK;
}

/* Samples the curve densely, heading along it, with the pauses. */
static int trajectory_files_follow(struct walk *w, const double *pause_s, struct sh_err *err)
{
    const struct trajectory *curve = w->curve;
    const double near = 0.005; /* of a step, to either side, for the heading */
    double t_s = 0.0, before_s = STEP_S;
    size_t n = 0;
    int rc = SH_OK;
    for (size_t i = 0; i < curve->n; i++)
        n += leg_parts(curve, i) + 1;
    if (n > POSE_MAX_KNOTS)
        return sh_fail(err, SH_EINPUT, "the path is too long: %zu samples every %g s or %g m; allowed are %d", n,
                       STEP_S, STEP_M, POSE_MAX_KNOTS);
    for (size_t i = 0; i < curve->n && rc == SH_OK; i++) {
        double at_s = curve->sample[i].t_s, h = i + 1 < curve->n ? curve->sample[i + 1].t_s - at_s : 0.0;
        size_t parts = leg_parts(curve, i);
        double step_s = fmax(STEP_S, h / (double)parts), d = near * fmin(before_s, step_s);
        if (pause_s[i] > 0.0) rc = put_sample(w, at_s, t_s, d, err);
        t_s += pause_s[i];
        for (size_t j = 0; j < parts && rc == SH_OK; j++) {
            double f = (double)j / (double)parts;
            double on = along(f, pause_s[i] > 0.0, i + 1 < curve->n && pause_s[i + 1] > 0.0);
            rc = put_sample(w, at_s + h * on, t_s + h * f, d, err);
            d = near * step_s;
        }
        before_s = step_s;
        t_s += h;
    }
    return rc;
}

int trajectory_read_waypoints(const char *path, const struct geoframe *frame, const struct sh_report *report,
                              struct trajectory **out, struct sh_err *err)
{
    struct csv csv;
    struct way way = {0};
    struct sh_err why;
    struct walk walk = {.frame = frame, .report = report};
    struct trajectory *curve = NULL;
    *out = NULL;
    int rc = csv_open(&csv, path, waypoint_columns, report, err);
    if (rc == SH_OK) rc = read_waypoints(&csv, &way, err);
    if (rc == SH_OK) rc = trajectory_from_samples(way.points.at, way.points.n, &curve, err);
    walk.curve = curve;
    if (rc == SH_OK && (rc = trajectory_files_follow(&walk, way.pause_s, &why)) != SH_OK)
        rc =
            rc == SH_ESTOPPED ? sh_fail(err, rc, "%s", why.text) : text_fail(&csv.text, 0, rc, err, "%.300s", why.text);
    if (rc == SH_OK) rc = trajectory_from_samples(walk.out.at, walk.out.n, out, err);
    trajectory_free(curve);
    csv_close(&csv);
    free(way.points.at);
    free(way.pause_s);
    free(walk.out.at);
    return rc;
}
