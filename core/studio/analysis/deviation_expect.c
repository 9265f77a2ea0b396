/* SPDX-License-Identifier: MIT */
/* The sigma and the bound expected of a point, by noise and counts; formulas in core/studio/deviation.h. */
#include <math.h>
#include <string.h>

#include "core/studio/deviation.h"
#include "core/vec3.h"

static double square(double v)
{
    return v * v;
}

/* The counts of both encoders, in radians; an angle is rounded by up to half a count. Where both are ideal, positions
 * have the true angles. */
static void encoder_steps(const struct cast_setup *setup, double step_rad[2])
{
    const int ideal = setup->mirror_counts >= 4294967296.0 && setup->pan_counts >= 4294967296.0;
    const int counts = !ideal || setup->layout == LINE_POLAR;
    step_rad[0] = counts ? 2.0 * M_PI / setup->mirror_counts : 0.0;
    step_rad[1] = counts ? 2.0 * M_PI / setup->pan_counts : 0.0;
}

/* Returns sigma of the range noise of one pulse. */
static double range_sigma_m(const struct cast_setup *setup, double range_m, double cosine, int32_t label)
{
    const struct cast_detect *detect = setup->detect;
    if (setup->noise_on) return setup->range_sigma_m + 1e-6 * setup->range_sigma_ppm * range_m;
    if (detect == NULL || !detect->noise_by_signal || detect->signal == NULL) return 0.0;
    const struct surface_table *table = detect->surfaces;
    if (label < 0 || table == NULL || (uint32_t)label >= table->n) return (double)NAN;
    if (table->texture != NULL && table->texture[label] != NULL) return (double)NAN;
    if (table->by_vertex != NULL && table->by_vertex[label]) return (double)NAN;
    const uint32_t one = (uint32_t)label;
    double rho;
    surface_return(table, 1, &one, &cosine, &rho);
    const double a = detect_amplitude(detect->signal, range_m, rho);
    return sqrt(detect->signal->floor2 + detect->signal->jitter2 / (a * a)) + detect->signal->per_distance * range_m;
}

/* Sets effect to how far mirror and pan move the beam along the normal, per radian and per metre of range. */
static void angle_effects(const double rotation[9], const double beam[3], const double normal[3], double effect[2])
{
    const double up[3] = {rotation[2], rotation[5], rotation[8]};
    double by_pan[3], by_mirror[3];
    vec3_cross(up, beam, by_pan);
    vec3_cross(beam, by_pan, by_mirror);
    const double flat = vec3_length(by_pan);
    effect[0] = flat > 0.0 ? vec3_dot(normal, by_mirror) / flat : 1.0; /* straight up or down: the largest value */
    effect[1] = vec3_dot(normal, by_pan);
}

/* Points are moved within a ball (noise.ball). Returns the variance of these moves along the normal (formula:
 * core/studio/deviation.h). */
static double ball_variance(const struct deviation_head *head, double range_m, const double beam[3],
                            const double normal[3])
{
    const struct detect_ball *ball = head->setup.detect != NULL ? head->setup.detect->ball : NULL;
    if (ball == NULL) return 0.0;
    const double radius_m = ball->radius_m * (1.0 + ball->per_distance_1_m * range_m);
    double axis[3] = {normal[0], normal[1], normal[2]}, sum = 0.0;
    if (ball->local) { /* along the beam, to the right, up */
        const double *m = head->setup.rotation;
        const double up[3] = {m[2], m[5], m[8]};
        double right[3], across[3];
        vec3_cross(beam, up, right);
        vec3_cross(right, beam, across);
        const double flat = vec3_length(right);
        axis[0] = vec3_dot(normal, beam);
        axis[1] = flat > 0.0 ? vec3_dot(normal, right) / flat : 0.0;
        axis[2] = flat > 0.0 ? vec3_dot(normal, across) / flat : 0.0;
    }
    for (int k = 0; k < 3; k++)
        sum += square(axis[k] * ball->factor[k]);
    return square(radius_m) / 5.0 * sum;
}

double deviation_sigma_m(const struct deviation_head *head, const struct deviation_hit *hit, double *counts_m)
{
    const struct cast_setup *setup = &head->setup;
    const double cosine = fabs(vec3_dot(hit->beam, hit->normal)), range_m = hit->range_m;
    double step_rad[2], effect[2], noise = ball_variance(head, range_m, hit->beam, hit->normal), counts = 0.0;
    *counts_m = (double)NAN;
    if (head->has_instrument_errors) return (double)NAN;
    encoder_steps(setup, step_rad);
    angle_effects(setup->rotation, hit->beam, hit->normal, effect);
    for (int k = 0; k < 2; k++) {
        noise += square(range_m * effect[k] * head->angle_sigma_rad[k]);
        counts += square(range_m * effect[k] * step_rad[k]);
    }
    counts += square(head->count_m) + square(head->file_count_m);
    const double range_count_m = setup->layout == LINE_POLAR ? setup->range_scale_m : 0.0;
    *counts_m = sqrt((square(range_count_m) + counts / square(cosine)) / 12.0);
    return sqrt(square(range_sigma_m(setup, range_m, cosine, hit->label)) + noise / square(cosine));
}

static void signal_terms(const struct cast_detect *detect, struct deviation_terms *out)
{
    const struct detect_signal *signal = detect->signal;
    if (detect->noise_by_signal && signal != NULL) {
        out->range_floor_m = sqrt(signal->floor2);
        out->range_jitter_m = sqrt(signal->jitter2);
        out->range_sigma_per_m = signal->per_distance;
    }
    if (detect->ball == NULL) return;
    out->ball_m = detect->ball->radius_m;
    out->ball_per_m = detect->ball->per_distance_1_m;
    memcpy(out->ball_factor, detect->ball->factor, sizeof out->ball_factor);
    out->ball_local = detect->ball->local;
}

int deviation_terms_of(const struct deviation_head *head, struct deviation_terms *out)
{
    const struct cast_setup *setup = &head->setup;
    *out = (struct deviation_terms){.range_floor_m = (double)NAN, .range_jitter_m = (double)NAN};
    if (head->has_instrument_errors) return 0;
    if (setup->detect != NULL) signal_terms(setup->detect, out);
    if (setup->noise_on) { /* fixed noise replaces noise by the signal, as in range_sigma_m() */
        out->range_floor_m = out->range_jitter_m = (double)NAN;
        out->range_sigma_m = setup->range_sigma_m;
        out->range_sigma_per_m = 1e-6 * setup->range_sigma_ppm;
    }
    memcpy(out->angle_sigma_rad, head->angle_sigma_rad, sizeof out->angle_sigma_rad);
    encoder_steps(setup, out->angle_step_rad);
    out->range_step_m = setup->layout == LINE_POLAR ? setup->range_scale_m : 0.0;
    out->place_step_m = hypot(head->count_m, head->file_count_m);
    return 1;
}

double deviation_bound_m(const struct deviation_head *head, double range_m)
{
    const struct cast_setup *setup = &head->setup;
    const struct cast_detect *detect = setup->detect;
    const double half_diagonal = 0.5 * sqrt(3.0);
    double step_rad[2];
    if (setup->noise_on || head->has_instrument_errors || head->angle_sigma_rad[0] > 0.0 ||
        head->angle_sigma_rad[1] > 0.0 || (detect != NULL && detect->noise_by_signal && detect->signal != NULL))
        return (double)INFINITY;
    encoder_steps(setup, step_rad);
    const double range_count_m = setup->layout == LINE_POLAR ? setup->range_scale_m : 0.0;
    const double polar =
        0.5 * sqrt(square(range_count_m) + square(range_m * step_rad[0]) + square(range_m * step_rad[1]));
    double bound_m =
        head->cast_error_m + head->georef_error_m + half_diagonal * (head->count_m + head->file_count_m) + polar;
    if (detect != NULL && detect->ball != NULL) {
        const struct detect_ball *b = detect->ball;
        bound_m +=
            b->radius_m * (1.0 + b->per_distance_1_m * range_m) * fmax(b->factor[0], fmax(b->factor[1], b->factor[2]));
    }
    return bound_m;
}
