/* SPDX-License-Identifier: MIT */
/* Computes figures of points by group, of their times, and of echoes per shot. */
#include "core/studio/figures.h"

#include <math.h>
#include <stdlib.h>

/* Sums of one group. A long double has 64 bits of mantissa, 11 more than a double. The sum of 2^32 summands of one sign
 * is wrong by at most 2^-32 of it. */
struct sums {
    long double d, d2, a, a2, j, j2, s2, z, z2, c2;
};

static void add_along(const struct figures_in *in, size_t i, struct figures *f, struct sums *s)
{
    const double a = (double)in->points->along_m[i], sigma = (double)in->points->sigma_m[i];
    if (isnan(a) || (double)in->points->cosine[i] < FIGURES_STEEPEST) return;
    f->along++;
    s->a += a;
    s->a2 += (long double)a * a;
    f->along_max_m = fmax(f->along_max_m, fabs(a));
    if (isnan(sigma)) return;
    const double counts = (double)in->points->counts_m[i];
    f->judged++;
    s->j += a;
    s->j2 += (long double)a * a;
    s->s2 += (long double)sigma * sigma + (long double)counts * counts;
    if (!(sigma > 0.0)) return;
    const double z = a / sigma, c = counts / sigma;
    f->noisy++;
    s->z += z;
    s->z2 += (long double)z * z;
    s->c2 += (long double)c * c;
}

static void add_point(const struct figures_in *in, size_t i, struct figures *f, struct sums *s)
{
    const double d = in->distance_m[i];
    if (isnan(d)) return;
    f->points++;
    if (isinf(d)) {
        f->far++;
        return;
    }
    s->d += d;
    s->d2 += (long double)d * d;
    f->max_m = fmax(f->max_m, d);
    if (in->points != NULL) add_along(in, i, f, s);
}

static double mean(long double sum, size_t n)
{
    return n > 0 ? (double)(sum / (long double)n) : (double)NAN;
}

static void figures_finish(struct figures *f, const struct sums *s)
{
    const size_t near = f->points - f->far;
    f->mean_m = mean(s->d, near);
    f->rms_m = sqrt(mean(s->d2, near));
    f->along_mean_m = mean(s->a, f->along);
    f->along_rms_m = sqrt(mean(s->a2, f->along));
    f->judged_mean_m = mean(s->j, f->judged);
    f->judged_rms_m = sqrt(mean(s->j2, f->judged));
    f->expected_rms_m = sqrt(mean(s->s2, f->judged));
    f->z_mean = mean(s->z, f->noisy);
    f->z_rms = sqrt(mean(s->z2, f->noisy));
    f->z_counts = sqrt(mean(s->c2, f->noisy));
}

/* The groups that figures_by gets. */
struct groups {
    uint32_t n;
    uint32_t (*group)(void *ctx, size_t i);
    void *ctx;
};

/* Sorts distances by group, and finds the 95th percentile of each. at: room for by->n + 1
 * indices into by_group, where the next distance of each group is put. */
static void find_p95(const struct figures_in *in, const struct groups *by, double *by_group, size_t *at,
                     struct figures *out)
{
    size_t sum = 0;
    for (uint32_t g = 0; g < by->n; g++) {
        at[g] = sum;
        sum += out[g].points - out[g].far;
    }
    for (size_t i = 0; i < in->n; i++) {
        if (!isfinite(in->distance_m[i])) continue;
        const uint32_t g = by->group != NULL ? by->group(by->ctx, i) : 0;
        if (g < by->n) by_group[at[g]++] = in->distance_m[i];
    }
    for (uint32_t g = 0; g < by->n; g++) {
        const size_t n = out[g].points - out[g].far;
        out[g].p95_m = cloud_percentile(by_group + at[g] - n, n, n, 950);
    }
}

int figures_by(const struct figures_in *in, uint32_t n_groups, uint32_t (*group)(void *ctx, size_t i), void *ctx,
               struct figures *out, struct sh_err *err)
{
    struct sums *sums = calloc((size_t)n_groups + 1, sizeof *sums);
    double *by_group = malloc((in->n + 1) * sizeof *by_group);
    size_t *at = calloc((size_t)n_groups + 1, sizeof *at);
    int rc = SH_OK;
    if (sums == NULL || by_group == NULL || at == NULL) {
        rc = sh_fail(err, SH_ENOMEM, "no memory for figures of %zu points", in->n);
        goto done;
    }
    for (uint32_t g = 0; g < n_groups; g++)
        out[g] = (struct figures){.max_m = (double)NAN, .along_max_m = (double)NAN}; /* fmax ignores NaN */
    for (size_t i = 0; i < in->n; i++) {
        const uint32_t g = group != NULL ? group(ctx, i) : 0;
        if (g < n_groups) add_point(in, i, &out[g], &sums[g]);
    }
    for (uint32_t g = 0; g < n_groups; g++)
        figures_finish(&out[g], &sums[g]);
    find_p95(in, &(struct groups){n_groups, group, ctx}, by_group, at, out);
done:
    free(sums);
    free(by_group);
    free(at);
    return rc;
}

static void add_gap(struct figures_times *t, double from_s, double to_s, double gap_s)
{
    const double gap = to_s - from_s;
    t->span_s += gap;
    if (gap > gap_s) t->gaps++;
    if (gap > t->longest_s) {
        t->longest_s = gap;
        t->longest_at_s = from_s;
    }
}

void figures_times_of(const struct cloud *cloud, uint32_t n_stations, const double *gap_s, struct figures_times *out)
{
    for (uint32_t s = 0; s < n_stations; s++)
        out[s] = (struct figures_times){.first_s = (double)NAN, .last_s = (double)NAN};
    for (size_t i = 0; i < cloud->n; i++) {
        const unsigned station = cloud_station(cloud, i);
        struct figures_times *t = &out[station - 1];
        const double now_s = cloud->time_s[i];
        if (!isfinite(now_s)) continue;
        if (t->points++ == 0 || now_s < t->last_s)
            t->scans++;
        else
            add_gap(t, t->last_s, now_s, gap_s[station - 1]);
        if (t->points == 1) t->first_s = now_s;
        t->last_s = now_s;
    }
}

void figures_echoes_of(const struct cloud *cloud, uint64_t shots[FIGURES_MAX_ECHOES + 1])
{
    for (int k = 0; k <= FIGURES_MAX_ECHOES; k++)
        shots[k] = 0;
    for (size_t i = 0; i < cloud->n; i++) {
        const unsigned count = cloud->echo_count[i];
        if (cloud->echo[i] == 1 || count == 0) shots[count < FIGURES_MAX_ECHOES ? count : FIGURES_MAX_ECHOES]++;
    }
}
