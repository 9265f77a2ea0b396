/* SPDX-License-Identifier: MIT */
/* Returns -> echoes. */
#include <math.h>
#include <string.h>

#include "core/footprint.h"
#include "core/vecmath.h"

void beam_merging(const struct beam *beam, uint32_t most, struct beam_merging *how)
{
    *how = (struct beam_merging){.gap_m = beam->resolution_m,
                                 .pulse_m = beam->resolution_m,
                                 .least_energy = BEAM_LEAST_ENERGY,
                                 .by_surface = 1,
                                 .most = most};
}

/* Shell's sort with Ciura's steps, in place. Few returns need only the last steps. */
void beam_sort(struct beam_return *r, uint32_t n)
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

/* The first-order shift of a mean is at most the variance of the ranges times the change of log A with range. The
 * variance is at most a quarter of the square of the depth (T. Popoviciu, 1935). */
int beam_is_deep(const struct detect_signal *signal, double near_m, double far_m)
{
    const double depth_m = far_m - near_m;
    return signal != NULL && depth_m * depth_m * detect_steepness(signal, near_m) > 4.0 * BEAM_LEAST_SHIFT_M;
}

/* Returns whether the first-order shift is not enough. Let s be the bound of the change of log A with range. Then A is
 * curved by up to 1.5 s^2 of itself, as 1 / R^2 is, and the third moment is at most 0.096 of the depth's cube. The rest
 * of the shift is less than 0.1 s^2 times that cube. */
static int is_curved(const struct detect_signal *signal, double near_m, double far_m)
{
    const double depth_m = far_m - near_m, s = detect_steepness(signal, near_m);
    return 0.1 * s * s * depth_m * depth_m * depth_m > BEAM_LEAST_SHIFT_M;
}

double beam_gains(const struct detect_signal *signal, struct beam_return *r, uint32_t n)
{
    enum { BLOCK = 64 };
    double range_m[BLOCK], amplitude[BLOCK], nearest = 0.0;
    for (uint32_t at = 0, m; at < n; at += m) {
        m = n - at < BLOCK ? n - at : BLOCK;
        for (uint32_t i = 0; i < m; i++)
            range_m[i] = r[at + i].range_m;
        detect_unit_amplitudes(signal, m, range_m, amplitude);
        if (at == 0) nearest = amplitude[0];
        for (uint32_t i = 0; i < m; i++)
            r[at + i].gain = (float)(amplitude[i] / nearest);
    }
    return nearest;
}

/* The weight of a return: the power that is received from it, relative to the nearest return (BY_POWER), or the power
 * that comes back (BY_BACK). If no power comes back from any of the returns, it is the energy of the return. */
enum weighting { BY_ENERGY, BY_BACK, BY_POWER };

static double weight_of(const struct beam_return *r, enum weighting by)
{
    return by == BY_BACK ? r->back : by == BY_POWER ? r->back * (double)r->gain : r->energy;
}

/* Finds the surface from which most power comes back, perhaps by many weak returns. Returns the index of its first
 * return. */
static uint32_t of_strongest_surface(const struct beam_return *r, uint32_t n, enum weighting by)
{
    uint32_t best = 0;
    double most = -1.0;
    for (uint32_t i = 0; i < n; i++) {
        uint32_t first = 0;
        double sum = 0.0;
        while (r[first].label != r[i].label)
            first++;
        if (first != i) continue;
        for (uint32_t k = i; k < n; k++)
            if (r[k].label == r[i].label) sum += weight_of(&r[k], by);
        if (sum > most) {
            most = sum;
            best = i;
        }
    }
    return best;
}

/* An echo's mean range (relative to the first return's), the variance of its ranges, that variance without the spread
 * within the returns, and the index of the return that gives its surface. */
struct average {
    double mean, variance, between;
    uint32_t strongest;
};

/* Averages returns, weighted by the power that comes back, or by energy; `all` is the sum of the
 * weights. */
static struct average average(const struct beam_merging *how, const struct beam_return *r, uint32_t n, double all,
                              enum weighting by)
{
    struct average a = {.strongest = 0};
    double first = 0.0, second = 0.0, between = 0.0;
    int alike = 1;
    for (uint32_t i = 0; i < n; i++) {
        double d = r[i].range_m - r[0].range_m, weight = weight_of(&r[i], by);
        first += weight * d;
        second += weight * (d * d + (double)r[i].sigma_m * (double)r[i].sigma_m);
        between += weight * (d * d);
        if (weight > weight_of(&r[a.strongest], by)) a.strongest = i;
        alike &= r[i].label == r[0].label;
    }
    if (!alike && how->by_surface) a.strongest = of_strongest_surface(r, n, by);
    a.mean = first / all;
    a.variance = fmax(0.0, second / all - a.mean * a.mean);
    a.between = between / all - a.mean * a.mean;
    return a;
}

/* Makes one echo from returns without a gap between them. The nearest is the first one, and the farthest is at far_m.
 * Returns 0 where they are too weak for an echo. */
static int make_echo(const struct beam_merging *how, struct beam_return *r, uint32_t n, double far_m,
                     struct beam_echo *echo)
{
    const struct detect_signal *signal = how->signal;
    const int deep = beam_is_deep(signal, r[0].range_m, far_m), curved = deep && is_curved(signal, r[0].range_m, far_m);
    const double nearest = curved ? beam_gains(signal, r, n) : 0.0;
    enum weighting by = curved ? BY_POWER : BY_BACK;
    double energy = 0.0, back = 0.0;
    struct average a = {.variance = (double)r[0].sigma_m * (double)r[0].sigma_m};
    for (uint32_t i = 0; i < n; i++) {
        energy += r[i].energy;
        back += weight_of(&r[i], by);
    }
    if (energy < how->least_energy) return 0;
    if (!(back > 0.0)) by = BY_ENERGY;
    if (n > 1) a = average(how, r, n, by == BY_ENERGY ? energy : back, by);
    if (deep && !curved) a.mean += a.between * detect_slope(signal, r[0].range_m + a.mean);
    if (curved) back *= nearest / detect_amplitude(signal, r[0].range_m + a.mean, 1.0);
    *echo = (struct beam_echo){.range_m = r[0].range_m + a.mean,
                               .energy = energy,
                               .back = back,
                               .width_m = (float)beam_echo_width(how->pulse_m, a.variance),
                               .label = r[a.strongest].label,
                               .colour = r[a.strongest].colour};
    return 1;
}

/* Drops the weakest echo. Echoes that differ by less than a float's resolution count as equal: the first
 * of them goes. */
static void drop_weakest(const struct detect_signal *signal, struct beam_echo *e, uint32_t n)
{
    uint32_t weakest = 0;
    float least = INFINITY;
    for (uint32_t i = 0; i < n; i++) {
        const float power = (float)(signal != NULL ? detect_amplitude(signal, e[i].range_m, e[i].back) : e[i].back);
        if (power < least) weakest = i;
        least = power < least ? power : least;
    }
    memmove(e + weakest, e + weakest + 1, (n - weakest - 1) * sizeof *e);
}

/* With this many returns or more it is faster to look for gaps before sorting. */
enum { MANY = 7 };

/* Most footprints lie on one surface: there is no gap between their returns, whatever their order. The
 * nearest one goes to the front, as sorting would have it. far_m: the farthest range. */
static int have_no_gap(double gap_m, struct beam_return *r, uint32_t n, double *far_m)
{
    uint32_t nearest = 0;
    double farthest_m = r[0].range_m;
    for (uint32_t i = 1; i < n; i++) {
        if (r[i].range_m < r[nearest].range_m) nearest = i;
        farthest_m = r[i].range_m > farthest_m ? r[i].range_m : farthest_m;
    }
    if (farthest_m - r[nearest].range_m > gap_m) return 0;
    struct beam_return one = r[0];
    r[0] = r[nearest];
    r[nearest] = one;
    *far_m = farthest_m;
    return 1;
}

uint32_t beam_merge(const struct beam_merging *how, struct beam_return *r, uint32_t n, struct beam_echo *echo,
                    uint64_t *left_out)
{
    uint32_t found = 0;
    uint8_t number = 0;
    double whole_m = 0.0;
    const int is_whole = n >= MANY && have_no_gap(how->gap_m, r, n, &whole_m);
    if (!is_whole) beam_sort(r, n);
    for (uint32_t i = 0, end; i < n; i = end) {
        for (end = i + 1; end < n && r[end].range_m - r[end - 1].range_m <= how->gap_m;)
            end++;
        if (!make_echo(how, r + i, end - i, is_whole ? whole_m : r[end - 1].range_m, &echo[found])) continue;
        echo[found++].number = number++;
        if (found <= how->most) continue;
        drop_weakest(how->signal, echo, found--);
        ++*left_out;
    }
    return found;
}

/* ---- several pulses at a time, one in each lane */

/* For each pulse: its nearest range, the place of that return, and its farthest range; is_whole: no return is
 * missing. */
struct reaches {
    double near_m[BEAM_ALIKE], far_m[BEAM_ALIKE];
    int64_t nearest[BEAM_ALIKE], is_whole[BEAM_ALIKE];
};

VEC_CLONES
static void find_reaches(const struct beam_alike *alike, struct reaches *of)
{
    const double *range_m = alike->range_m;
    const int64_t n = alike->n;
    struct reaches r;
    for (int64_t i = 0; i < BEAM_ALIKE; i++) {
        r.near_m[i] = r.far_m[i] = range_m[i * n];
        r.nearest[i] = 0;
        r.is_whole[i] = range_m[i * n] == range_m[i * n];
    }
    for (int64_t j = 1; j < n; j++) {
        VEC_LOOP
        for (int64_t i = 0; i < BEAM_ALIKE; i++) {
            const double here_m = range_m[i * n + j];
            r.nearest[i] = here_m < r.near_m[i] ? j : r.nearest[i];
            r.near_m[i] = here_m < r.near_m[i] ? here_m : r.near_m[i];
            r.far_m[i] = here_m > r.far_m[i] ? here_m : r.far_m[i];
            r.is_whole[i] = here_m == here_m ? r.is_whole[i] : 0;
        }
    }
    *of = r;
}

/* Sums for each pulse: the energy that comes back, and that energy times the range beyond the nearest. */
struct lane_sums {
    double back[BEAM_ALIKE], first[BEAM_ALIKE];
};

/* Sums are in the order of beam_merge, which swaps the first return with the nearest one. */
VEC_CLONES
static void sum_ranges(const struct beam_alike *alike, const struct reaches *of, struct lane_sums *sums)
{
    const double *range_m = alike->range_m, energy = alike->energy;
    const int64_t n = alike->n;
    const struct reaches r = *of;
    double beyond_m[BEAM_ALIKE], first[BEAM_ALIKE];
    for (int64_t i = 0; i < BEAM_ALIKE; i++) {
        beyond_m[i] = range_m[i * n] - r.near_m[i];
        first[i] = 0.0;
    }
    for (int64_t j = 1; j < n; j++) {
        VEC_LOOP
        for (int64_t i = 0; i < BEAM_ALIKE; i++) {
            const double here_m = range_m[i * n + j] - r.near_m[i];
            first[i] += energy * (j == r.nearest[i] ? beyond_m[i] : here_m);
        }
    }
    memcpy(sums->first, first, sizeof first);
}

/* Computes the same sums where surfaces are modelled. */
VEC_CLONES
static void sum_returns(const struct beam_alike *alike, const struct reaches *of, struct lane_sums *sums)
{
    const double *range_m = alike->range_m, *rho = alike->rho, energy = alike->energy;
    const int64_t n = alike->n;
    const struct reaches r = *of;
    double beyond_m[BEAM_ALIKE], back0[BEAM_ALIKE];
    struct lane_sums s;
    for (int64_t i = 0; i < BEAM_ALIKE; i++) {
        beyond_m[i] = range_m[i * n] - r.near_m[i];
        back0[i] = energy * rho[i * n];
        s.back[i] = energy * rho[i * n + r.nearest[i]];
        s.first[i] = 0.0;
    }
    for (int64_t j = 1; j < n; j++) {
        VEC_LOOP
        for (int64_t i = 0; i < BEAM_ALIKE; i++) {
            const int64_t is_first = j == r.nearest[i];
            const double here_m = range_m[i * n + j] - r.near_m[i], back = energy * rho[i * n + j];
            const double weight = is_first ? back0[i] : back;
            s.back[i] += weight;
            s.first[i] += weight * (is_first ? beyond_m[i] : here_m);
        }
    }
    *sums = s;
}

/* Sums the squares of these ranges for each pulse, weighted as they are. */
VEC_CLONES
static void sum_squares(const struct beam_alike *alike, const struct reaches *of, double second[BEAM_ALIKE])
{
    const double *range_m = alike->range_m, *rho = alike->rho, energy = alike->energy;
    const int64_t n = alike->n;
    const struct reaches r = *of;
    double sum[BEAM_ALIKE] = {0.0};
    for (int64_t j = 1; j < n; j++)
        for (int64_t i = 0; i < BEAM_ALIKE; i++) {
            const int64_t at = i * n + (j == r.nearest[i] ? 0 : j);
            const double here_m = range_m[at] - r.near_m[i], weight = rho != NULL ? energy * rho[at] : energy;
            sum[i] += weight * (here_m * here_m);
        }
    memcpy(second, sum, sizeof sum);
}

/* Moves the means of deep pulses, whose bits are set, as make_echo does. */
static void shift_means(const struct detect_signal *signal, const struct beam_alike *alike, const struct reaches *r,
                        const struct lane_sums *sums, uint32_t deep, struct beam_echo *echo)
{
    double second[BEAM_ALIKE];
    sum_squares(alike, r, second);
    for (uint32_t i = 0; i < BEAM_ALIKE; i++) {
        if ((deep >> i & 1) == 0) continue;
        const double mean = sums->first[i] / echo[i].back, between = second[i] / echo[i].back - mean * mean;
        echo[i].range_m = r->near_m[i] + (mean + between * detect_slope(signal, r->near_m[i] + mean));
    }
}

/* Returns a bit for each pulse whose returns have one label. */
VEC_CLONES
static uint32_t have_one_label(const struct beam_alike *alike)
{
    const uint32_t *label = alike->label, n = alike->n, all = BEAM_ALIKE * n;
    uint32_t differ = 0, bits = 0;
    for (uint32_t i = 0; i < all; i++)
        differ |= label[i] ^ label[0];
    if (differ == 0) return (1U << BEAM_ALIKE) - 1;
    for (uint32_t i = 0; i < BEAM_ALIKE; i++) {
        differ = 0;
        for (uint32_t j = 0; j < n; j++)
            differ |= label[i * n + j] ^ label[i * n];
        bits |= (uint32_t)(differ == 0) << i;
    }
    return bits;
}

uint32_t beam_merge_alike(const struct beam_merging *how, const struct beam_alike *alike, struct beam_echo *echo)
{
    struct reaches r;
    struct lane_sums sums;
    double energy = 0.0;
    if (alike->n < MANY) return 0; /* beam_merge sorts these */
    for (uint32_t j = 0; j < alike->n; j++)
        energy += alike->energy;
    find_reaches(alike, &r);
    if (alike->rho != NULL)
        sum_returns(alike, &r, &sums);
    else
        sum_ranges(alike, &r, &sums);
    uint32_t done = have_one_label(alike), deep = 0;
    for (uint32_t i = 0; i < BEAM_ALIKE; i++) {
        const double back = alike->rho != NULL ? sums.back[i] : energy;
        if (!r.is_whole[i] || !(r.far_m[i] - r.near_m[i] <= how->gap_m) || !(back > 0.0)) done &= ~(1U << i);
        echo[i] = (struct beam_echo){.range_m = r.near_m[i] + sums.first[i] / back,
                                     .energy = energy,
                                     .back = back,
                                     .label = alike->label[i * alike->n]};
        if ((done >> i & 1) == 0 || !beam_is_deep(how->signal, r.near_m[i], r.far_m[i])) continue;
        if (is_curved(how->signal, r.near_m[i], r.far_m[i]))
            done &= ~(1U << i);
        else
            deep |= 1U << i;
    }
    if (deep != 0) shift_means(how->signal, alike, &r, &sums, deep, echo);
    return done;
}
