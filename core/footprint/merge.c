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

/* Returns the amplitude that light from range_m has at the head, for rho = 1. The head receives nothing from below
 * least_m. */
static double gain_at(const struct beam_merging *how, double range_m)
{
    return range_m < how->least_m ? 0.0 : detect_amplitude(how->signal, fmax(range_m, 1e-6), 1.0);
}

/* The mean moves by the covariance of the ranges and the gains: at most a quarter of the product of what they span
 * (Cauchy and Schwarz; T. Popoviciu, 1935). The gains span up to spread_m times the steepest change of log A. */
int beam_is_deep(const struct detect_signal *signal, double near_m, double depth_m, double spread_m)
{
    return signal != NULL &&
           depth_m * spread_m * (2.0 + signal->steepest_1_m * near_m) > 4.0 * BEAM_LEAST_SHIFT_M * near_m;
}

/* Sets the gains of an echo's returns, the nearest of which is the first. Returns 0 where they may be left out, because
 * they do not move the echo. */
static int set_gains(const struct beam_merging *how, struct beam_return *r, uint32_t n)
{
    const double near_m = r[0].range_m;
    double far_m = near_m, first_m = INFINITY, last_m = 0.0;
    if (how->signal == NULL) return 0;
    for (uint32_t i = 1; i < n; i++)
        far_m = r[i].range_m > far_m ? r[i].range_m : far_m;
    if (!beam_is_deep(how->signal, near_m, far_m - near_m, far_m - near_m)) return 0;
    for (uint32_t i = 0; i < n; i++) {
        /* An axis that turns past a plane's direction meets it ever farther away, and then behind the head. */
        r[i].plane_m = r[i].plane_m >= 0.0 ? fmin(fmax(r[i].plane_m, near_m), far_m) : far_m; /* also for NaN */
        first_m = fmin(first_m, r[i].plane_m);
        last_m = fmax(last_m, r[i].plane_m);
    }
    if (!beam_is_deep(how->signal, near_m, far_m - near_m, last_m - first_m)) return 0;
    for (uint32_t i = 0; i < n; i++)
        r[i].gain = gain_at(how, r[i].plane_m);
    return 1;
}

/* The weight of a return: the power that is received from it (BY_POWER), or the power that comes back, where the gains
 * do not matter (BY_BACK). Where there is no power from any of the returns, it is the energy of the return. */
enum weighting { BY_ENERGY, BY_BACK, BY_POWER };

static double weight_of(const struct beam_return *r, enum weighting by)
{
    return by == BY_BACK ? r->back : by == BY_POWER ? r->back * r->gain : r->energy;
}

static double sum_weights(const struct beam_return *r, uint32_t n, enum weighting by)
{
    double sum = 0.0;
    for (uint32_t i = 0; i < n; i++)
        sum += weight_of(&r[i], by);
    return sum;
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

/* An echo's mean range (relative to the first return's), the variance of its ranges, and the index of the
 * return that gives its surface. */
struct average {
    double mean, variance;
    uint32_t strongest;
};

/* Averages returns; `all` is the sum of their weights. */
static struct average average(const struct beam_merging *how, const struct beam_return *r, uint32_t n, double all,
                              enum weighting by)
{
    struct average a = {.strongest = 0};
    double first = 0.0, second = 0.0;
    int alike = 1;
    for (uint32_t i = 0; i < n; i++) {
        double d = r[i].range_m - r[0].range_m, weight = weight_of(&r[i], by);
        first += weight * d;
        second += weight * (d * d + (double)r[i].sigma_m * (double)r[i].sigma_m);
        if (weight > weight_of(&r[a.strongest], by)) a.strongest = i;
        alike &= r[i].label == r[0].label;
    }
    if (!alike && how->by_surface) a.strongest = of_strongest_surface(r, n, by);
    a.mean = first / all;
    a.variance = fmax(0.0, second / all - a.mean * a.mean);
    return a;
}

/* Returns the power that would come back from one surface in the place of these returns, for the head to receive as
 * much power as from all of them. */
static double joint_back(const struct beam_merging *how, const struct beam_return *r, uint32_t n, double power)
{
    double first = 0.0;
    for (uint32_t i = 0; i < n; i++)
        first += weight_of(&r[i], BY_POWER) * (r[i].plane_m - r[0].range_m);
    return power / gain_at(how, fmax(r[0].range_m + first / power, how->least_m));
}

/* Makes one echo from returns without a gap between them, the nearest of which is the first. Returns 0 where they are
 * too weak for one. */
static int make_echo(const struct beam_merging *how, struct beam_return *r, uint32_t n, struct beam_echo *echo)
{
    const double energy = sum_weights(r, n, BY_ENERGY);
    if (energy < how->least_energy) return 0;
    enum weighting by = n > 1 && set_gains(how, r, n) ? BY_POWER : BY_BACK;
    double all = sum_weights(r, n, by);
    if (by == BY_POWER && !(all > 0.0)) all = sum_weights(r, n, by = BY_BACK);
    const double back = by == BY_POWER ? joint_back(how, r, n, all) : all;
    if (!(all > 0.0)) {
        by = BY_ENERGY;
        all = energy;
    }
    struct average a = {.variance = (double)r[0].sigma_m * (double)r[0].sigma_m};
    if (n > 1) a = average(how, r, n, all, by);
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
static void drop_weakest(const struct beam_merging *how, struct beam_echo *e, uint32_t n)
{
    uint32_t weakest = 0;
    float least = INFINITY;
    for (uint32_t i = 0; i < n; i++) {
        const double gain = how->signal != NULL ? gain_at(how, e[i].range_m) : 1.0;
        const float power = (float)(e[i].back * gain);
        if (power < least) weakest = i;
        least = fminf(power, least);
    }
    memmove(e + weakest, e + weakest + 1, (n - weakest - 1) * sizeof *e);
}

/* With this many returns or more it is faster to look for gaps before sorting. */
enum { MANY = 7 };

/* Most footprints lie on one surface: there is no gap between their returns, whatever their order. The
 * nearest one goes to the front, as sorting would have it. */
static int have_no_gap(double gap_m, struct beam_return *r, uint32_t n)
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
    return 1;
}

uint32_t beam_merge(const struct beam_merging *how, struct beam_return *r, uint32_t n, struct beam_echo *echo,
                    uint64_t *left_out)
{
    uint32_t found = 0;
    uint8_t number = 0;
    if (n < MANY || !have_no_gap(how->gap_m, r, n)) beam_sort(r, n);
    for (uint32_t i = 0, end; i < n; i = end) {
        for (end = i + 1; end < n && r[end].range_m - r[end - 1].range_m <= how->gap_m;)
            end++;
        if (!make_echo(how, r + i, end - i, &echo[found])) continue;
        echo[found++].number = number++;
        if (found <= how->most) continue;
        drop_weakest(how, echo, found--);
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

/* Returns a bit for each pulse whose n returns have one label or plane. */
VEC_CLONES
static uint32_t have_one(const uint32_t *label, uint32_t n)
{
    const uint32_t all = BEAM_ALIKE * n;
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
    uint32_t done = have_one(alike->label, alike->n), deep = 0;
    for (uint32_t i = 0; i < BEAM_ALIKE; i++) {
        const double back = alike->rho != NULL ? sums.back[i] : energy;
        if (!r.is_whole[i] || !(r.far_m[i] - r.near_m[i] <= how->gap_m) || !(back > 0.0)) done &= ~(1U << i);
        echo[i] = (struct beam_echo){.range_m = r.near_m[i] + sums.first[i] / back,
                                     .energy = energy,
                                     .back = back,
                                     .label = alike->label[i * alike->n]};
        const double depth_m = r.far_m[i] - r.near_m[i];
        deep |= (uint32_t)beam_is_deep(how->signal, r.near_m[i], depth_m, depth_m) << i;
    }
    if ((done & deep) == 0) return done;
    return alike->plane != NULL ? done & (~deep | have_one(alike->plane, alike->n)) : done & ~deep;
}
