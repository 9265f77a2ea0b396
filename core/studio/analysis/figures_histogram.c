/* SPDX-License-Identifier: MIT */
#include <math.h>

#include "core/studio/figures.h"

double figures_nice(double v)
{
    static const double step[] = {1.0, 2.0, 5.0, 10.0};
    const double power = floor(log10(v));
    for (int i = 0; i < 4; i++) {
        /* pow is good to a unit in the last place or two; 10^-k itself is not a double */
        const double nice = power < 0.0 ? step[i] / pow(10.0, -power) : step[i] * pow(10.0, power);
        if (nice >= v * (1.0 - 1e-12)) return nice;
    }
    return 10.0 * pow(10.0, power);
}

/* Counts values by size, in eight classes an octave from 2^-60 m to 2^60 m: enough to choose an axis. */
enum { PER_OCTAVE = 8, OCTAVES = 120, CLASSES = PER_OCTAVE * OCTAVES };
struct sizes {
    uint64_t n, count[CLASSES];
};

static void add_size(struct sizes *s, double v)
{
    if (!isfinite(v)) return;
    s->n++;
    v = fabs(v);
    int k = v > 0.0 ? (int)floor(log2(v) * PER_OCTAVE) + CLASSES / 2 : 0;
    s->count[k < 0 ? 0 : k >= CLASSES ? CLASSES - 1 : k]++;
}

/* Returns a size above 0 that at least this share of the values does not exceed. */
static double size_of_share(const struct sizes *s, double share)
{
    uint64_t sum = 0;
    for (int k = 0; k < CLASSES; k++) {
        sum += s->count[k];
        if ((double)sum >= share * (double)s->n) return exp2((double)(k + 1 - CLASSES / 2) / PER_OCTAVE);
    }
    return exp2(OCTAVES / 2);
}

/* Sets the bins for the values; returns 0 where there are none. */
static int set_bins(const struct sizes *s, double share, int is_signed, struct figures_histogram *h)
{
    enum { WANTED = FIGURES_MAX_BINS / 2 - 1 };
    *h = (struct figures_histogram){0};
    if (s->n == 0) return 0;
    const double size_m = size_of_share(s, share);
    h->width = figures_nice(size_m / WANTED);
    const uint32_t bins = (uint32_t)ceil(size_m / h->width);
    h->bins = is_signed ? 2 * bins : bins;
    h->from = is_signed ? -(double)bins * h->width : 0.0;
    return 1;
}

static void figures_histogram_add(struct figures_histogram *h, double v)
{
    if (!isfinite(v)) return;
    const double bin = floor((v - h->from) / h->width);
    if (bin < 0.0)
        h->below++;
    else if (bin >= h->bins)
        h->above++;
    else
        h->count[(uint32_t)bin]++;
}

void figures_histogram_of(const double *value, size_t n, double share, struct figures_histogram *out)
{
    struct sizes sizes = {0};
    for (size_t i = 0; i < n; i++)
        add_size(&sizes, value[i]);
    if (!set_bins(&sizes, share, 0, out)) return;
    for (size_t i = 0; i < n; i++)
        figures_histogram_add(out, value[i]);
}

void figures_histogram_of_signed(const float *value, size_t n, double share, struct figures_histogram *out)
{
    struct sizes sizes = {0};
    for (size_t i = 0; i < n; i++)
        add_size(&sizes, (double)value[i]);
    if (!set_bins(&sizes, share, 1, out)) return;
    for (size_t i = 0; i < n; i++)
        figures_histogram_add(out, (double)value[i]);
}
