/* Returns -> echoes. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/footprint.h"

int beam_echoes_alloc(struct beam_echoes *e, uint32_t capacity, struct sh_err *err)
{
    memset(e, 0, sizeof *e);
    e->capacity = capacity;
    e->pulse = malloc(capacity * sizeof *e->pulse);
    e->range_m = malloc(capacity * sizeof *e->range_m);
    e->energy = malloc(capacity * sizeof *e->energy);
    e->back = malloc(capacity * sizeof *e->back);
    e->cosine = malloc(capacity * sizeof *e->cosine);
    e->width_m = malloc(capacity * sizeof *e->width_m);
    e->triangle = malloc(capacity * sizeof *e->triangle);
    e->label = malloc(capacity * sizeof *e->label);
    e->number = malloc(capacity);
    if (e->pulse != NULL && e->range_m != NULL && e->energy != NULL && e->back != NULL && e->cosine != NULL &&
        e->width_m != NULL && e->triangle != NULL && e->label != NULL && e->number != NULL)
        return SH_OK;
    beam_echoes_free(e);
    return sh_fail(err, SH_ENOMEM, "beam: no memory for %u echoes", capacity);
}

void beam_echoes_free(struct beam_echoes *e)
{
    free(e->pulse);
    free(e->range_m);
    free(e->energy);
    free(e->back);
    free(e->cosine);
    free(e->width_m);
    free(e->triangle);
    free(e->label);
    free(e->number);
    memset(e, 0, sizeof *e);
}

/* Shell's sort, with Ciura's steps: in place, and few are many. */
static void sort(struct beam_return *r, uint32_t n)
{
    static const uint32_t steps[] = {301, 132, 57, 23, 10, 4, 1};
    size_t s = n < 10 ? 5 : 0;
    for (; s < sizeof steps / sizeof steps[0]; s++)
        for (uint32_t i = steps[s]; i < n; i++) {
            struct beam_return one = r[i];
            uint32_t j = i;
            for (; j >= steps[s] && r[j - steps[s]].range_m > one.range_m; j -= steps[s])
                r[j] = r[j - steps[s]];
            r[j] = one;
        }
}

/* What counts of a return: what comes back, or its energy where nothing does of any. */
static double weight_of(const struct beam_return *r, int by_back)
{
    return by_back ? r->back : r->energy;
}

/* Of the surface that most comes back from, its strongest return: many weak returns may be of one surface. */
static uint32_t of_strongest_surface(const struct beam_return *r, uint32_t n, int by_back)
{
    uint32_t best = 0;
    double most = -1.0;
    for (uint32_t i = 0; i < n; i++) {
        uint32_t first = 0, strongest = i;
        double sum = 0.0;
        while (r[first].label != r[i].label)
            first++;
        if (first != i) continue;
        for (uint32_t k = i; k < n; k++) {
            if (r[k].label != r[i].label) continue;
            sum += weight_of(&r[k], by_back);
            if (weight_of(&r[k], by_back) > weight_of(&r[strongest], by_back)) strongest = k;
        }
        if (sum > most) {
            most = sum;
            best = strongest;
        }
    }
    return best;
}

/* Mean (less the first one's) and variance of ranges, weighted by what comes back or else by energy, `all` together.
 * Gives the index of the strongest, of the strongest surface. */
static uint32_t average(const struct beam_return *r, uint32_t n, double all, int by_back, double *mean,
                        double *variance)
{
    double first = 0.0, second = 0.0;
    uint32_t strongest = 0;
    int alike = 1;
    for (uint32_t i = 0; i < n; i++) {
        double d = r[i].range_m - r[0].range_m, weight = weight_of(&r[i], by_back);
        first += weight * d;
        second += weight * (d * d + (double)r[i].sigma_m * (double)r[i].sigma_m);
        if (weight > weight_of(&r[strongest], by_back)) strongest = i;
        alike &= r[i].label == r[0].label;
    }
    if (!alike) strongest = of_strongest_surface(r, n, by_back);
    *mean = first / all;
    *variance = fmax(0.0, second / all - *mean * *mean);
    return strongest;
}

/* One echo from returns that hang together. Returns 0 where they are too weak for one. */
static int append(const struct beam *beam, const struct beam_return *r, uint32_t n, uint32_t pulse,
                  struct beam_echoes *e)
{
    double energy = 0.0, back = 0.0, mean = 0.0, variance = (double)r[0].sigma_m * (double)r[0].sigma_m;
    uint32_t strongest = 0;
    for (uint32_t i = 0; i < n; i++) {
        energy += r[i].energy;
        back += r[i].back;
    }
    if (energy < BEAM_LEAST_ENERGY) return 0;
    if (n > 1) strongest = average(r, n, back > 0.0 ? back : energy, back > 0.0, &mean, &variance);
    uint32_t at = e->n++;
    e->pulse[at] = pulse;
    e->range_m[at] = r[0].range_m + mean;
    e->energy[at] = (float)energy;
    e->back[at] = (float)back;
    e->cosine[at] = r[strongest].cosine;
    e->width_m[at] = (float)beam_echo_width(beam->resolution_m, variance);
    e->triangle[at] = r[strongest].triangle;
    e->label[at] = r[strongest].label;
    return 1;
}

static void move_echo(struct beam_echoes *e, uint32_t to, uint32_t from)
{
    e->pulse[to] = e->pulse[from];
    e->range_m[to] = e->range_m[from];
    e->energy[to] = e->energy[from];
    e->back[to] = e->back[from];
    e->cosine[to] = e->cosine[from];
    e->width_m[to] = e->width_m[from];
    e->triangle[to] = e->triangle[from];
    e->label[to] = e->label[from];
    e->number[to] = e->number[from];
}

static void drop_weakest(struct beam_echoes *e, uint32_t first)
{
    uint32_t weakest = first;
    for (uint32_t i = first; i < e->n; i++)
        if (e->back[i] < e->back[weakest]) weakest = i;
    for (uint32_t i = weakest; i + 1 < e->n; i++)
        move_echo(e, i, i + 1);
    e->n--;
}

/* From so many returns on it is faster to look first. */
enum { MANY = 7 };

/* Most footprints lie on one surface: their returns hang together whatever their order. The nearest one goes to the
 * front, as sorting would have it. */
static int hang_together(const struct beam *beam, struct beam_return *r, uint32_t n)
{
    uint32_t nearest = 0;
    double farthest_m = r[0].range_m;
    for (uint32_t i = 1; i < n; i++) {
        if (r[i].range_m < r[nearest].range_m) nearest = i;
        farthest_m = r[i].range_m > farthest_m ? r[i].range_m : farthest_m;
    }
    if (farthest_m - r[nearest].range_m > beam->resolution_m) return 0;
    struct beam_return one = r[0];
    r[0] = r[nearest];
    r[nearest] = one;
    return 1;
}

uint32_t beam_merge(const struct beam *beam, struct beam_return *r, uint32_t n, uint32_t pulse, uint32_t most,
                    struct beam_echoes *e)
{
    uint32_t first = e->n, left_out = 0;
    uint8_t number = 0;
    if (n < MANY || !hang_together(beam, r, n)) sort(r, n);
    for (uint32_t i = 0, end; i < n; i = end) {
        for (end = i + 1; end < n && r[end].range_m - r[end - 1].range_m <= beam->resolution_m;)
            end++;
        if (!append(beam, r + i, end - i, pulse, e)) continue;
        e->number[e->n - 1] = number++;
        if (e->n - first <= most) continue;
        drop_weakest(e, first);
        left_out++;
    }
    return left_out;
}
