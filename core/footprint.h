/* SPDX-License-Identifier: MIT */
/* The beam of a pulse, which is wider than a ray. In: exit diameter, divergence, pulse width. Out:
 * sub-rays, outlines that cut a footprint, and the echoes that returns are merged into.
 *
 * Width. Irradiance across the beam is Gaussian, I = I0 exp(-2 r^2 / w^2); w is the 1/e^2 radius. Diameters
 * and divergences are full widths at 1/e^2. Other definitions that makers use are in enum beam_definition.
 * With exit diameter D and divergence theta, and the waist in the exit plane, w(R)^2 = (D/2)^2 + (R
 * theta/2)^2: the hyperbola of ISO 11146-1, which holds for beams that are not diffraction-limited as well.
 *
 * Footprint. The circle of radius w(R). The energy within it counts as 1; the 13.5 % outside of it is not modelled.
 *
 * Sub-rays. The hyperboloid is a ruled surface: the straight line from rho D/2 (cos phi, sin phi) in the exit
 * plane, with slope rho theta/2 (-sin phi, cos phi), is rho w(R) from the axis at every R. So a sub-ray is a
 * straight line from its own point of the exit plane, at (x, y) = rho (cos phi, sin phi) of the unit disc. A part
 * of the disc has the same share of the energy in every footprint. A sub-ray's range counts along itself from the
 * exit plane.
 * Rings: one sub-ray in the centre and 6 k on ring k = 1 .. N, 1 + 3 N (N + 1) in all, each with the same
 * energy: ring k lies where half of the energy of its annulus is inside. (Energy within rho, from the
 * irradiance: (1 - exp(-2 rho^2)) / (1 - exp(-2)).) Odd rings are turned by half a step.
 *
 * Echoes. Each sub-ray that hits something is a return. Returns of a pulse are sorted by range; a gap larger
 * than the range resolution (c tau / 2 of the pulse width tau) begins a new echo. An echo's range is the
 * energy-weighted mean of its returns: the centroid of equal pulses that overlap, whatever their shape. Two
 * surfaces closer than the resolution make a mixed pixel. An echo's energy is the sum of its returns'; its
 * surface is the one that sends most of it back. Returns of less than 1 % of the footprint's energy make no echo. Where
 * there are more echoes than the head can report, the weakest are left out, and counted. Where surfaces are
 * modelled (core/surface.h), the weight of a return is the power that comes back: energy times the surface's
 * return, times the share that glass and mirrors before it let through. The 1 % is still of the footprint's
 * energy. Where no return sends anything back, energy is the weight.
 *
 * Distance. Where a signal is modelled, the weight of a return is the power received: the power that comes back times
 * the amplitude (core/detect.h: distance, overlap, air) at the range where the beam's axis meets the plane of the
 * return's surface. So surfaces at different distances have different weights. The returns of one plane have the same,
 * so a signal does not move its mean range: not that of many returns, nor that of one ray for the whole footprint.
 * Within a plane, distance would move the mean by another -2 sigma^2 / R, with sigma of its ranges: 4 mm for 15 mrad at
 * 80 deg and 6 m, 0.05 mm for 0.35 mrad at 84 deg and 10 m. This is left out. (The incidence changes
 * within a plane as well. Where surfaces are modelled, this moves the mean of many returns by -sigma^2 / R.) A return
 * behind glass, or on a body that moves, counts at its own range, since only its incidence is known. An echo's power is
 * the sum of what is received, and the weakest echo is that of the least power. Nothing is received from below
 * range_min_m. Where distance moves an echo by less than BEAM_LEAST_SHIFT_M, the weights are those without a signal.
 *
 * Width. An echo's width adds two widths as squares: that of the pulse, resolution_m, and 2.355 sigma of its
 * ranges (full widths at half maximum of Gaussians). A return may stand for a part of the footprint, or for
 * the area around a sub-ray. The ranges within it count as well, to first order on its plane: the standard
 * deviation comes out too small, by a share of (s tan i)^2 / 2, with s = theta / 2. Where outlines cross
 * in the footprint, the deviation is a few percent smaller still: each part is then a set of places of BEAM_FINE_RINGS.
 *
 * One ray for the whole footprint. Where the footprint lies on one plane at incidence i, its mean range is
 * not that of its centre: a sub-ray at (rho, phi) meets the plane at (R - rho D/2 tan i cos phi) / (1 - rho
 * s tan i sin phi), s = theta / 2, times sqrt(1 + rho^2 s^2) along itself. The mean over phi is R sqrt((1 +
 * rho^2 s^2) / (1 - rho^2 s^2 tan^2 i)). Over the footprint, with t = rho^2 distributed as exp(-2 t) on 0 ..
 * 1, mean t = 0.343, mean t^2 = 0.187:
 * R (1 + 0.343 s^2 / (2 cos^2 i) + ...), 0.14 mm at 800 m, 80 deg and 0.35 mrad. */
#ifndef CORE_FOOTPRINT_H
#define CORE_FOOTPRINT_H

#include <stdint.h>

#include "core/detect.h"
#include "core/err.h"
#include "core/line.h"
#include "core/scene.h"
#include "core/vec3.h"

enum beam_mode { BEAM_SINGLE, BEAM_RINGS, BEAM_ADAPTIVE, BEAM_AUTO };

/* Definitions of a diameter or a divergence. Where the irradiance above has fallen to a share q of its peak,
 * r = w sqrt(ln(1/q) / 2). So a full width times beam_widening() is the full width at 1/e^2 (q = exp(-2)):
 *   1/e     q = exp(-1)   r = w / sqrt(2)          sqrt(2)         = 1.4142
 *   FWHM    q = 1/2       r = w sqrt(ln(2) / 2)    sqrt(2 / ln(2)) = 1.6986
 *   half    the radius, or the half angle, at 1/e^2                = 2
 * (A. Siegman, Lasers, 1986, section 17.1; ISO 11146-1 has the widths of a Gaussian beam.) */
enum beam_definition { BEAM_AT_1_E2, BEAM_AT_1_E, BEAM_AT_HALF_MAXIMUM, BEAM_HALF_AT_1_E2 };
double beam_widening(enum beam_definition definition);

enum beam_select { BEAM_ALL, BEAM_FIRST, BEAM_LAST, BEAM_STRONGEST };

enum {
    BEAM_MAX_RINGS = 18,
    BEAM_FINE_RINGS = 12, /* for beam_cut: 469 places */
    BEAM_MAX_SUBRAYS = 1 + 3 * BEAM_MAX_RINGS * (BEAM_MAX_RINGS + 1),
    BEAM_SUBRAY_ROOM = (BEAM_MAX_SUBRAYS + 63) / 64 * 64,
    BEAM_HALF_STEPS = 1024,
};
#define BEAM_LEAST_ENERGY  0.01 /* of the footprint's, for an echo */
#define BEAM_LEAST_STEP_M  5e-4 /* no outline where both sides are nearer to each other */
#define BEAM_LEAST_SHIFT_M 1e-4 /* of an echo's range, by the distances of its surfaces; less is left out */

/* A beam's figures. Constant after beam_init; any thread. */
struct beam {
    double exit_radius_m; /* D / 2 */
    double slope;         /* theta / 2 */
    double resolution_m;
    /* tables over the distance -1 .. 1 of a line from the centre: the energy beyond the line, and its first moment */
    double half[BEAM_HALF_STEPS + 2], moment[BEAM_HALF_STEPS + 2];
    /* second moments of that energy about the footprint's centre: along the line's normal, and along the line */
    double along[BEAM_HALF_STEPS + 2], across[BEAM_HALF_STEPS + 2];
};

/* Sets a beam's figures. exit_m is D and divergence_rad is theta, both full widths at 1/e^2. */
void beam_init(struct beam *beam, double exit_m, double divergence_rad, double pulse_width_s);
double beam_radius(const struct beam *beam, double range_m);
/* Replaces the range at a footprint's centre by the mean of the footprint's ranges. The footprint lies on one plane,
 * with steep = 1 / cos^2 of the incidence. The mean is range (1 + a x + b x^2 + c x^3), x = steep. Where
 * s / cos i is above 1/2, the plane is nearly along the beam, and x is limited to its value at 1/2. */
void beam_plane_means(const struct beam *beam, const float *steep, uint32_t n, double *range_m);
/* Sets the widths of the echoes of such footprints, for pulses of beam->resolution_m. */
void beam_plane_widths(const struct beam *beam, const float *steep, const double *range_m, uint32_t n, float *width_m);
/* Returns the width of an echo whose ranges have this variance. pulse_m is the pulse's own width, c tau / 2. */
double beam_echo_width(double pulse_m, double variance_m2);

/* Gives the part of the unit disc beyond the line n . u = h, n a unit vector, |h| <= 1: its energy, and the energy
 * times the distance of its centre of energy along n. */
void beam_half(const struct beam *beam, double h, double *energy, double *moment);
/* Gives the second moments of that part, along n and along the line. */
void beam_half_squares(const struct beam *beam, double h, double *along, double *across);

/* Places of sub-rays in the unit disc, each with 1/n of the energy. */
struct beam_pattern {
    uint32_t n;
    float x[BEAM_SUBRAY_ROOM], y[BEAM_SUBRAY_ROOM]; /* 0 from n on; the room is a multiple of 64 */
    double rest; /* variance of x (and of y) around a place: that of the footprint minus that of the places */
};
/* Makes a pattern of 0 (the centre alone) to BEAM_MAX_RINGS rings. */
void beam_rings(uint32_t rings, struct beam_pattern *pattern);

/* Where a plane ends within a footprint, the sub-rays that hit the plane stand for the part of the footprint on it.
 * Returns a bound b: the error of their centre is less than b w, and that of the echo's range less than b w(R) tan i.
 * The bound holds for parts with 1 % of the energy or more. b is 0.12 with 4 rings and 0.05 with 12. The RMS over all
 * cuts is about b / 4. No fit through the same sub-rays does better, since each has 1/n of the energy or nothing.
 * Outlines (below) cut exactly. */
double beam_end_error(uint32_t rings);

/* Chooses two axes across a beam's direction. */
void beam_axes(const double dir[3], double e1[3], double e2[3]);
struct beam_sight {
    double dir[3], e1[3], e2[3];
};

/* The return of one sub-ray, or of one part of a footprint. */
struct beam_return {
    double range_m;
    double energy; /* of the footprint's */
    double back;   /* the part of it that comes back, where surfaces are modelled; else the energy again */
    float sigma_m; /* of the ranges within it */
    uint32_t label;
    uint32_t colour; /* goes along with the label */
    double plane_m;  /* where the beam's axis meets the plane of the surface; read only with a signal */
    double gain;     /* set by beam_merge */
};

struct beam_echo {
    double range_m;
    /* Sums over its returns. With a signal, detect_amplitude of range_m and back is the power received. */
    double energy, back;
    float width_m;
    uint32_t label, colour;
    uint8_t number; /* among the pulse's echoes, from 0, left-out ones included; keys random numbers */
};

/* This says how returns are merged into echoes. */
struct beam_merging {
    double gap_m;        /* a larger one begins a new echo */
    double pulse_m;      /* width of the pulse, c tau / 2 */
    double least_energy; /* less is no echo */
    int by_surface;      /* 1: an echo's surface is the one that returns most; 0: that of its strongest return */
    uint32_t most;       /* echoes of a pulse; the weakest are left out */
    const struct detect_signal *signal; /* for weights by received power; NULL: distance has no part in them */
    double least_m;                     /* with a signal: planes below are not received */
};
/* Sets how the returns of a footprint are merged, as defined above, without a signal. */
void beam_merging(const struct beam *beam, uint32_t most, struct beam_merging *how);
/* Returns whether distances may move an echo by more than BEAM_LEAST_SHIFT_M. Its returns lie between near_m and
 * depth_m beyond, and their planes meet the axis within spread_m. 0 where there is no signal. */
int beam_is_deep(const struct detect_signal *signal, double near_m, double depth_m, double spread_m);
/* Sorts returns by range, in place. */
void beam_sort(struct beam_return *returns, uint32_t n);
/* Merges the returns of one pulse into its echoes, by range; echo has room for most + 1. Reorders the
 * returns. Returns the number of echoes, and adds the number of those left out to *left_out. */
uint32_t beam_merge(const struct beam_merging *how, struct beam_return *returns, uint32_t n, struct beam_echo *echo,
                    uint64_t *left_out);

/* BEAM_ALIKE footprints of n returns each. All returns have the same energy. The returns of pulse i begin at index i
 * n. */
struct beam_alike {
    uint32_t n;
    double energy;         /* of a return */
    const double *range_m; /* NaN: the sub-ray hits nothing */
    const uint32_t *label;
    const double *rho;     /* the share of the energy that comes back; NULL: all */
    const uint32_t *plane; /* equal where the returns of a pulse lie on one plane; NULL: not known */
};
enum { BEAM_ALIKE = 16 };
/* Merges the pulses whose returns all lie on one surface without a gap, as most do, several at a time. The echoes are
 * those of beam_merge, bit by bit, but without width and colour. Returns a bit for each pulse that was merged; echo has
 * an element for each pulse. */
uint32_t beam_merge_alike(const struct beam_merging *how, const struct beam_alike *alike, struct beam_echo *echo);

/* ---- outlines: other surfaces that a footprint may reach */

/* The outlines of a scene as seen from one place: edges with the surface on one side only. A footprint
 * without an outline lies on the surface that its centre hits: one ray is enough. An edge with a triangle on
 * each side is no outline, however sharp: ranges are continuous there. All edges are examined once, here.
 * For a pulse, the cell of its direction is looked up. The cell lists the edges that footprints within it may
 * reach, and the nearest of them. Constant after it is made; any thread. */
struct beam_outlines;

enum { BEAM_PROBE_MOST = 1024 };
/* Casts rays from the station: unit directions -> ranges, NaN for none, and the kinds of surfaces that they hit.
 * n is at most BEAM_PROBE_MOST. */
struct beam_probe {
    void (*cast)(void *ctx, uint32_t n, const struct vec3_in *dir, double *range_m, uint16_t *kind);
    void *ctx;
};
/* The scene, station and beam that outlines are made for. */
struct beam_outlines_spec {
    const struct scene *scene;
    const double *station_m; /* [3], prcs: all pulses come from here, their sub-rays from at most exit_radius_m away */
    const struct beam *beam;
    double range_max_m;
    /* By label: surfaces of one kind send back the same. Edges where one kind ends are outlines, too, with or
     * without a step. NULL: all surfaces are of one kind. */
    const uint16_t *kind;
    const struct sh_report *report; /* SH_ESTOPPED where it asks to stop; NULL: nothing does */
};
/* probe, NULL: all outlines count. Else rays are cast in pairs along each outline, one close beside it on each side.
 * The pairs are about a footprint's radius apart, and farther on an edge longer than BEAM_PROBE_MOST / 2 radii. A
 * stretch of an outline is left out where it is hidden, or where the ranges on both sides agree to BEAM_LEAST_STEP_M
 * plus 0.08 of that radius (a wall that stands on a floor; parts of a wall): it can't make another echo. Like any fold
 * between triangles, an outline that is left out may move a range by a sixth of the footprint's radius times the change
 * of slope. The rays begin at the station, and sub-rays up to the exit's radius beside it. So a sub-ray may see a strip
 * behind an edge that these rays don't, and an outline in it is left out. As an angle, the strip is at most as wide as
 * the exit's radius at that edge. */
int beam_outlines_create(const struct beam_outlines_spec *spec, const struct beam_probe *probe,
                         struct beam_outlines **out, struct sh_err *err);
void beam_outlines_free(struct beam_outlines *outlines);

enum { BEAM_NEAR_MOST = 1024 };
/* A pulse whose footprint may reach outlines first .. end. */
struct beam_near {
    uint32_t pulse, first, end;
    double next_m; /* set by beam_find_lines */
};
/* Finds such pulses, at any range, among n <= BEAM_NEAR_MOST unit directions. Returns how many. */
uint32_t beam_near_outlines(const struct beam_outlines *outlines, const struct beam *beam,
                            const struct vec3_floats *dir, uint32_t n, struct beam_near *near);

enum { BEAM_MAX_LINES = 12, BEAM_MAX_PARTS = 64 };

/* An outline across a footprint, in the unit disc: the line n . u = h. */
struct beam_line {
    double n[2], h;
};
/* Finds the outlines that cross the footprint of a pulse nearer than limit_m, as lines in the axes of `sight`. Returns
 * their number, up to BEAM_MAX_LINES, or BEAM_MAX_LINES + 1: more than that. From the range near->next_m on, further
 * outlines may cross the footprint. next_m is INFINITY where there are none, or where no outline crosses up to
 * limit_m. */
uint32_t beam_find_lines(const struct beam_outlines *outlines, const struct beam *beam, struct beam_near *near,
                         const struct beam_sight *sight, double limit_m, struct beam_line *line);

/* A part of the footprint: its energy, the centre of its energy, and the spread about that centre. The spread is the
 * variances and the covariance of x and y, where they are asked for. */
struct beam_part {
    double energy, x, y, xx, xy, yy;
};
/* The parts that lines cut the footprint into. Each lies on one surface, and is convex, so that its centre of energy
 * is in it. */
struct beam_parts {
    uint32_t n, centre; /* the part with the centre of the disc; BEAM_MAX_PARTS: it is left out */
    struct beam_part part[BEAM_MAX_PARTS];
};
/* Cuts a footprint by n lines. fine: the pattern of BEAM_FINE_RINGS. Returns 0, or 1 where there are more than
 * BEAM_MAX_PARTS. Parts of less than 0.05 % of the energy are left out. */
int beam_cut(const struct beam *beam, const struct beam_pattern *fine, const struct beam_line *line, uint32_t n,
             int spreads, struct beam_parts *parts);

/* Returns the standard deviation of the ranges within a part that lies on the plane with normal n, range_m away in its
 * centre. */
float beam_part_sigma(const struct beam *beam, const struct beam_sight *sight, const double n[3], double range_m,
                      const struct beam_part *part);
/* The same for a part that spreads the same all around, where only the incidence is known. */
float beam_round_sigma(const struct beam *beam, double range_m, double cosine, double variance);

#endif
