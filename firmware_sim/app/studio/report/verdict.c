/* SPDX-License-Identifier: MIT */
/* The deviations that are expected of a head, and whether its points have them. */
#include "firmware_sim/app/studio/report/verdict.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/angle.h"
#include "firmware_sim/config/config.h"

/* The error of the cast by the plan, which does not depend on the number of rays per call. */
static double cast_error_m(void)
{
    struct plan_row row;
    plan_cast(1, &row);
    return row.error_m;
}

static int has_instrument_errors(const struct config *cfg)
{
    static const struct config_instrument zero;
    return memcmp(&cfg->instrument, &zero, sizeof zero) == 0 ? 0 : 1;
}

void report_head_of(const struct site *site, uint32_t station, struct deviation_head *head)
{
    const struct config *cfg = site->cfg;
    *head =
        (struct deviation_head){.cast_error_m = cast_error_m(), .has_instrument_errors = has_instrument_errors(cfg)};
    site_cast_setup(site, station, &head->setup);
    if (cfg->noise.angle) {
        head->angle_sigma_rad[0] = angle_rad(cfg->profile.mirror_sigma_deg);
        head->angle_sigma_rad[1] = angle_rad(cfg->profile.pan_sigma_deg);
    }
    if (head->setup.beam != NULL) head->cast_error_m += fmax(site->plan.beam.error_m, 0.0);
    if (cfg->output.layout == LINE_POLAR || site->moving) return;
    head->georef_error_m = site->station[station].plan.error_m;
    if (isnan(head->georef_error_m)) head->georef_error_m = (double)INFINITY; /* not known: there is no bound */
    head->count_m =
        georef_count_m(site->station[station].georef, cfg->profile.range_max_m * SITE_MARGIN, head->setup.xyz_scale);
}

/* Without a footprint all points are judged by the bound. With a footprint only points on smooth faces are: at an edge
 * the footprint hits more than one surface. */
static int is_judged(const struct deviation_head *head, double distance_m, double along_m)
{
    if (isnan(distance_m)) return 0;
    return head->setup.beam == NULL || !isnan(along_m);
}

void report_count(struct report_verdict *v, const struct deviation_head *head, double distance_m, double along_m,
                  double range_m)
{
    if (!is_judged(head, distance_m, along_m) || isnan(range_m)) return;
    const double bound_m = deviation_bound_m(head, range_m);
    v->judged++;
    v->bound_m = fmax(v->bound_m, bound_m);
    v->beyond += distance_m > bound_m;
}

const char *report_judgement_name(enum report_judgement j)
{
    return j == REPORT_WITHIN ? "within" : j == REPORT_BEYOND ? "beyond" : "not judged";
}

static void judge_bound(struct report_verdict *v, const struct figures *f, int footprint)
{
    const char *which = footprint ? " on smooth faces" : "";
    v->judgement = v->beyond == 0 ? REPORT_WITHIN : REPORT_BEYOND;
    if (v->beyond == 0)
        snprintf(
            v->text, sizeof v->text,
            "Within the expected error: no point%s is farther from the scene than its bound, %.3g mm at the largest "
            "range. The bound is the plan's, plus half a count on each axis.",
            which, 1e3 * v->bound_m);
    else
        snprintf(
            v->text, sizeof v->text,
            "Not within the expected error: %zu of %zu points%s are farther from the scene than their bound, %.3g mm "
            "at the largest range; the largest distance is %.3g mm.",
            v->beyond, v->judged, which, 1e3 * v->bound_m, 1e3 * f->max_m);
}

enum { JUDGED_LEAST = 100 };

/* z^2 of a normal deviation has a variance of 2. Its mean is off by more than six standard errors once in 5e8. To this
 * limit 0.02 is added, since sigma is exact only to first order, and the noisy points decide where faces are smooth. To
 * the limit of the mean of z 0.01 is added. Rounding of positions and encoder angles to counts adds between nothing and
 * three times its expected variance (core/studio/deviation.h). */
static void judge_noise(struct report_verdict *v, const struct figures *f)
{
    const double n = (double)f->noisy, tolerance = 6.0 * sqrt(2.0 / n) + 0.02, z2 = f->z_rms * f->z_rms;
    const double mean_tolerance = 6.0 / sqrt(n) + 0.01 + f->z_counts;
    v->judged = f->noisy;
    v->least_ratio = sqrt(fmax(1.0 - tolerance, 0.0));
    v->most_ratio = sqrt(1.0 + tolerance + 3.0 * f->z_counts * f->z_counts);
    const int within = z2 >= v->least_ratio * v->least_ratio && z2 <= v->most_ratio * v->most_ratio &&
                       fabs(f->z_mean) <= mean_tolerance;
    v->judgement = within ? REPORT_WITHIN : REPORT_BEYOND;
    snprintf(
        v->text, sizeof v->text,
        "%s: along the beam, the RMS deviation of %zu points on smooth faces is %.4g mm, and %.4g mm is expected from "
        "noise and counts. Deviation over expected sigma: RMS %.4f, allowed %.4f to %.4f; mean %+.4f, allowed %.4f to "
        "both sides.",
        within ? "Within the expected error" : "Not within the expected error", f->noisy, 1e3 * f->judged_rms_m,
        1e3 * f->expected_rms_m, f->z_rms, v->least_ratio, v->most_ratio, f->z_mean, mean_tolerance);
}

static void beyond_everything(struct report_verdict *v, const struct figures *f, const char *reach)
{
    v->judgement = REPORT_BEYOND;
    snprintf(v->text, sizeof v->text,
             "Not within the expected error: %zu of %zu points are farther from everything than %s.", f->far, f->points,
             reach);
}

/* With a footprint only points on smooth faces are judged. A cloud that was scanned at another place has too few of
 * them for a judgement. */
static int can_judge_bound(const struct report_subject *s, const struct report_verdict *v)
{
    return s->head->setup.beam == NULL || v->beyond > 0 || 2 * s->figures->along >= s->figures->points;
}

void report_judge_one(const struct report_subject *s, struct report_verdict *v)
{
    const struct figures *f = s->figures;
    if (f->points == 0)
        snprintf(v->text, sizeof v->text, "Not judged: there is no point of this station.");
    else if (s->moving)
        snprintf(v->text, sizeof v->text,
                 "Not judged: the head moved, and the file doesn't say where each pulse began.");
    else if (s->head->has_instrument_errors)
        snprintf(v->text, sizeof v->text,
                 "Not judged: the configuration has errors of the instrument, which move points on purpose.");
    else if (f->far > 0)
        beyond_everything(v, f, s->reach);
    else if (isfinite(v->bound_m) && can_judge_bound(s, v))
        judge_bound(v, f, s->head->setup.beam != NULL);
    else if (2 * f->along < f->points)
        snprintf(
            v->text, sizeof v->text,
            "Not judged: only %zu of %zu points lie on smooth faces, and only those are judged; at least half of all "
            "points must lie there.",
            f->along, f->points);
    else if (f->noisy < JUDGED_LEAST)
        snprintf(v->text, sizeof v->text,
                 "Not judged: only %zu points on smooth faces have a known noise; %d are needed.", f->noisy,
                 JUDGED_LEAST);
    else
        judge_noise(v, f);
}
