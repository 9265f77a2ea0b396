/* SPDX-License-Identifier: MIT */
/* Samples over time -> the pose at any time, and the knots that a scan uses. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/pose/trajectory.h"

static const double LONGEST_RAD = 0.01; /* see struct pose_knot_rules */

static double chord_rate(const struct trajectory *tr, size_t i, int axis)
{
    return (tr->sample[i + 1].pose.position_m[axis] - tr->sample[i].pose.position_m[axis]) /
           (tr->sample[i + 1].t_s - tr->sample[i].t_s);
}

static int stands(const struct trajectory *tr, size_t i)
{
    const double *a = tr->sample[i].pose.position_m, *b = tr->sample[i + 1].pose.position_m;
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2]; /* a file may say -0 for 0 */
}

/* Derivative at sample i of the parabola through it and its neighbours (at an end: through the nearest three). With two
 * samples it is that of their straight line. Next to an interval in which the platform stands it is 0. */
static double velocity(const struct trajectory *tr, size_t i, int axis)
{
    size_t last = tr->n - 1;
    if (last == 0 || (i > 0 && stands(tr, i - 1)) || (i < last && stands(tr, i))) return 0.0;
    if (last == 1) return chord_rate(tr, 0, axis);
    size_t mid = i == 0 ? 1 : i == last ? last - 1 : i;
    double h0 = tr->sample[mid].t_s - tr->sample[mid - 1].t_s, h1 = tr->sample[mid + 1].t_s - tr->sample[mid].t_s;
    double d0 = chord_rate(tr, mid - 1, axis), d1 = chord_rate(tr, mid, axis);
    double bend = (d1 - d0) / (h0 + h1); /* half the second derivative */
    if (i == 0) return d0 - bend * h0;
    if (i == last) return d1 + bend * h1;
    return d0 + bend * h0;
}

static int check_sample(const struct pose_sample *s, const struct pose_sample *before, size_t i, struct sh_err *err)
{
    double norm2 = 0.0;
    int finite = isfinite(s->t_s) && isfinite(s->frame);
    for (int k = 0; k < 3; k++)
        finite = finite && isfinite(s->pose.position_m[k]);
    for (int k = 0; k < 4; k++)
        norm2 += s->pose.quat[k] * s->pose.quat[k];
    if (!finite || !isfinite(norm2)) return sh_fail(err, SH_EINPUT, "sample %zu: not a finite number", i);
    if (!(norm2 > 1e-12)) return sh_fail(err, SH_EINPUT, "sample %zu: a quaternion of length 0", i);
    if (before != NULL && !trajectory_is_later(s, before))
        return sh_fail(err, SH_EINPUT, "sample %zu: %.9g s after the one before; allowed at least %g s", i,
                       s->t_s - before->t_s, 1e-6 * POSE_MIN_STEP_US);
    return SH_OK;
}

int trajectory_from_samples(const struct pose_sample *sample, size_t n, struct trajectory **out, struct sh_err *err)
{
    *out = NULL;
    if (n == 0) return sh_fail(err, SH_EINPUT, "the trajectory has no samples");
    for (size_t i = 0; i < n; i++) {
        int rc = check_sample(&sample[i], i > 0 ? &sample[i - 1] : NULL, i, err);
        if (rc != SH_OK) return rc;
    }
    struct trajectory *tr = calloc(1, sizeof *tr);
    if (tr != NULL) tr->sample = malloc(n * sizeof *tr->sample);
    if (tr != NULL) tr->velocity_m_s = malloc(n * sizeof *tr->velocity_m_s);
    if (tr == NULL || tr->sample == NULL || tr->velocity_m_s == NULL) {
        trajectory_free(tr);
        return sh_fail(err, SH_ENOMEM, "no memory for a trajectory of %zu samples", n);
    }
    tr->n = n;
    memcpy(tr->sample, sample, n * sizeof *sample);
    for (size_t i = 0; i < n; i++) {
        double *q = tr->sample[i].pose.quat, norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
        for (int k = 0; k < 4; k++)
            q[k] /= norm;
        for (int k = 0; k < 3; k++)
            tr->velocity_m_s[i][k] = velocity(tr, i, k);
    }
    *out = tr;
    return SH_OK;
}

void trajectory_free(struct trajectory *tr)
{
    if (tr == NULL) return;
    free(tr->sample);
    free(tr->velocity_m_s);
    free(tr);
}

void trajectory_span(const struct trajectory *tr, double *first_s, double *last_s)
{
    *first_s = tr->sample[0].t_s;
    *last_s = tr->sample[tr->n - 1].t_s;
}

/* The last sample at or before t_s, but never the very last one; t_s lies within the span. */
static size_t trajectory_find(const struct trajectory *tr, double t_s)
{
    size_t lo = 0, hi = tr->n - 1;
    while (hi - lo > 1) {
        size_t mid = lo + (hi - lo) / 2;
        if (tr->sample[mid].t_s <= t_s)
            lo = mid;
        else
            hi = mid;
    }
    return lo;
}

void trajectory_at(const struct trajectory *tr, double t_s, struct pose *pose, double *frame)
{
    const struct pose_sample *first = &tr->sample[0], *last = &tr->sample[tr->n - 1];
    if (!(t_s > first->t_s) || t_s >= last->t_s) {
        const struct pose_sample *end = t_s >= last->t_s ? last : first;
        *pose = end->pose;
        *frame = end->frame;
        return;
    }
    size_t i = trajectory_find(tr, t_s);
    const struct pose_sample *a = &tr->sample[i], *b = &tr->sample[i + 1];
    double h = b->t_s - a->t_s, f = (t_s - a->t_s) / h, g = 1.0 - f;
    pose_between(&a->pose, &b->pose, f, pose);
    *frame = a->frame + f * (b->frame - a->frame);
    /* The Hermite curve is the straight line plus a cubic that is 0 at both ends and corrects the velocities there. */
    for (int k = 0; k < 3; k++) {
        double d = b->pose.position_m[k] - a->pose.position_m[k];
        double va = h * tr->velocity_m_s[i][k] - d, vb = h * tr->velocity_m_s[i + 1][k] - d;
        pose->position_m[k] += f * g * (g * va - f * vb);
    }
}

/* The largest acceleration within an interval: a cubic has it at one of the ends. */
static double acceleration(const struct trajectory *tr, size_t i)
{
    const struct pose_sample *a = &tr->sample[i], *b = &tr->sample[i + 1];
    double h = b->t_s - a->t_s, at_a = 0.0, at_b = 0.0;
    for (int k = 0; k < 3; k++) {
        double d = (b->pose.position_m[k] - a->pose.position_m[k]) / h;
        double va = tr->velocity_m_s[i][k], vb = tr->velocity_m_s[i + 1][k];
        double from = (6.0 * d - 4.0 * va - 2.0 * vb) / h, to = (2.0 * va + 4.0 * vb - 6.0 * d) / h;
        at_a += from * from;
        at_b += to * to;
    }
    return sqrt(fmax(at_a, at_b));
}

/* The number of parts for interval i, and the remaining deviation. arm_m: the head's distance from the
 * body's origin. */
static double parts_of(const struct trajectory *tr, size_t i, const struct pose_knot_rules *rules, double arm_m,
                       double *error_m)
{
    const struct pose *a = &tr->sample[i].pose, *b = &tr->sample[i + 1].pose;
    double h = tr->sample[i + 1].t_s - tr->sample[i].t_s, turn = pose_angle_between(a->quat, b->quat);
    double moves = fmax((trajectory_chord_m(&tr->sample[i], &tr->sample[i + 1]) + turn * arm_m) / rules->longest_m,
                        turn / LONGEST_RAD);
    double sag = (acceleration(tr, i) + turn / h * turn / h * arm_m) * h * h / 8.0; /* in one part */
    double longest_s = 1e-9 * (double)rules->longest_ns;
    /* Without the factor, rounding would make a part too many where h is a multiple of longest_s. */
    double parts = fmax(ceil(sqrt(sag / rules->tolerance_m)), fmin(ceil(h / longest_s * (1.0 - 1e-9)), ceil(moves)));
    double most = floor(h / (1e-6 * POSE_MIN_STEP_US));
    parts = fmax(1.0, fmin(parts, most));
    *error_m = fmax(*error_m, sag / (parts * parts));
    return parts;
}

static void set_knot(const struct trajectory *tr, double start_s, int64_t t_ns, const struct pose *mount,
                     struct pose_knot *knot)
{
    struct pose body;
    *knot = (struct pose_knot){.t_ns = t_ns};
    trajectory_at(tr, start_s + 1e-9 * (double)t_ns, &body, &knot->frame);
    pose_mount(&body, mount, &knot->pose);
}

int trajectory_knots(const struct trajectory *tr, const struct pose *mount, const struct pose_knot_rules *rules,
                     const struct sh_report *report, struct pose_path *out, struct sh_err *err)
{
    const double arm_m = vec3_length(mount->position_m), start_s = rules->start_s, end_s = rules->end_s;
    double most = 1.0;
    *out = (struct pose_path){0};
    for (size_t i = 0; i + 1 < tr->n; i++)
        if (tr->sample[i + 1].t_s > start_s && tr->sample[i].t_s < end_s)
            most += parts_of(tr, i, rules, arm_m, &out->error_m) + 1;
    if (!(most <= POSE_MAX_KNOTS))
        return sh_fail(err, SH_EINPUT, "the trajectory needs up to %.0f poses from %.9g s on; allowed %d", most,
                       start_s, POSE_MAX_KNOTS);
    out->knot = malloc((size_t)most * sizeof *out->knot);
    if (out->knot == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %.0f poses of a trajectory", most);
    set_knot(tr, start_s, 0, mount, &out->knot[out->n++]);
    for (size_t i = 0; i + 1 < tr->n && tr->sample[i].t_s < end_s; i++) {
        double a_s = tr->sample[i].t_s, b_s = tr->sample[i + 1].t_s;
        if (b_s <= start_s) continue;
        size_t parts = (size_t)parts_of(tr, i, rules, arm_m, &out->error_m);
        if ((i & 0xfff) == 0 && sh_check_stop(report, err) != SH_OK) return SH_ESTOPPED;
        for (size_t j = 1; j <= parts; j++) {
            double t_s = j == parts ? b_s : a_s + (b_s - a_s) * ((double)j / (double)parts);
            int64_t t_ns = llround(1e9 * (fmin(t_s, end_s) - start_s));
            if (t_ns > out->knot[out->n - 1].t_ns) set_knot(tr, start_s, t_ns, mount, &out->knot[out->n++]);
        }
    }
    return SH_OK;
}
