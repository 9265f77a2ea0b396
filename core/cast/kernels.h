/* Private to core/cast: the arithmetic around the cast, as loops over arrays that compilers turn into vectors. */
#ifndef CORE_CAST_KERNELS_H
#define CORE_CAST_KERNELS_H

#include "core/bvh/bvh_inside.h"

/* Mirror and pan angle of n pulses of a run, from its pulse `first` on. */
void kernel_angles(const struct schedule_run *run, uint32_t first, uint32_t n, double *mirror_turn, double *pan_turn);

/* Directions in prcs: rotation times (sin p cos m, cos p cos m, sin m). */
void kernel_directions(const double *mirror_turn, const double *pan_turn, const double rotation[9], uint32_t n,
                       double *dx, double *dy, double *dz);
/* The same, and beside it e: the directions as the encoders read them (whole counts), turned by to_crs instead. */
void kernel_directions_read(const struct cast_setup *setup, const double *mirror_turn, const double *pan_turn,
                            const double rotation[9], const double to_crs[9], uint32_t n, double *dx, double *dy,
                            double *dz, double *ex, double *ey, double *ez);
void kernel_to_float(const double *dx, const double *dy, const double *dz, uint32_t n, float *fx, float *fy, float *fz);

/* What Embree proposed, and what double precision makes of it. */
struct kernel_hits {
    const double *dx, *dy, *dz;
    const uint32_t *prim;
    const float *u, *v;
    double *range_m; /* out: (d - n.o) / (n.dir) of the proposed triangle's plane; NaN for none */
    uint32_t *label; /* out: of the proposed triangle; LINE_LABEL_NONE for none */
    float *steep;    /* out: 1 / cos^2 of the incidence, for rays from one point; NULL: not asked for */
    uint32_t *doubt; /* out: 1 where the hit is so near to the border, across the ray, that the proposal is in doubt */
};
/* Returns how many are in doubt. */
uint32_t kernel_refine(const struct bvh *bvh, const struct kernel_hits *hits, const double o[3], uint32_t n);

/* The same for rays with origins of their own (local frame). */
uint32_t kernel_refine_from(const struct bvh *bvh, const struct kernel_hits *hits, const double *ox, const double *oy,
                            const double *oz, uint32_t n);

/* What Embree proposed as it is: range NaN and label LINE_LABEL_NONE for a miss. */
void kernel_plain(const struct bvh *bvh, const uint32_t *prim, const float *t, uint32_t n, double *range_m,
                  uint32_t *label);

/* Cosine of the incidence on the triangles that were hit, 0..1; NaN for none. */
void kernel_cosines(const struct bvh *bvh, const uint32_t *hit, const double *dx, const double *dy, const double *dz,
                    uint32_t n, double *cosine);

/* ---- kernels_moving.c: pulses between two poses of a moving head */
struct kernel_leg {
    double before_ns, span_ns;         /* from the first pose to the run's t0; to the second pose */
    double position_m[3], shift_m[3];  /* at the first pose; from there to the second */
    double rotation[9], axis[3], turn; /* socs -> prcs at the first; about this axis of socs by `turn` turns */
};
void kernel_leg(const struct pose_knot *a, const struct pose_knot *b, int64_t t0_ns, struct kernel_leg *leg);
/* Directions s (socs) -> d (prcs) of n pulses, dt_ns after the run's t0. */
void kernel_turn_leg(const struct kernel_leg *leg, const uint32_t *dt_ns, uint32_t n, const double *sx,
                     const double *sy, const double *sz, double *dx, double *dy, double *dz);
/* Their origins, prcs. */
void kernel_place_leg(const struct kernel_leg *leg, const uint32_t *dt_ns, uint32_t n, double *px, double *py,
                      double *pz);
/* p - from */
void kernel_subtract(const double *px, const double *py, const double *pz, const double from[3], uint32_t n, double *ox,
                     double *oy, double *oz);
/* e * range + p - station. */
void kernel_scale_from(const double *range_m, const double *px, const double *py, const double *pz,
                       const double station_m[3], uint32_t n, double *ex, double *ey, double *ez);

/* True when one of the rays may meet the sphere at v (from the rays' origin). */
int kernel_meets_sphere(const double *dx, const double *dy, const double *dz, uint32_t n, const double v[3],
                        double radius_m);
/* Directions turned by the inverse of a rotation. */
void kernel_turn_back(const double *dx, const double *dy, const double *dz, const double rotation[9], uint32_t n,
                      double *ex, double *ey, double *ez);

/* Gaussian range noise on n ranges; NaN stays NaN. */
void kernel_noise(const struct cast_setup *setup, uint64_t pulse0, uint32_t n, double *range_m);

/* Echo byte and NaN for ranges outside of the head's limits. Returns the number of echoes. */
uint32_t kernel_detect(double *range_m, double min_m, double max_m, uint32_t n, uint8_t *echo);

/* Labels of echoes, LINE_LABEL_NONE for the other shots. */
void kernel_labels(const uint32_t *label, const uint8_t *echo, uint32_t n, uint16_t *out);

/* Wire numbers. a: range in counts, 0 for none; b, c: encoder counts modulo a turn. */
void kernel_polar(const struct cast_setup *setup, const double *range_m, const double *mirror_turn,
                  const double *pan_turn, uint32_t n, uint32_t *a, uint32_t *b, uint32_t *c);
/* Coordinates in counts of scale[], LINE_XYZ_NONE for NaN and for what doesn't fit. Returns how many coordinates did
 * not. */
uint32_t kernel_geo(const double *x, const double *y, const double *z, const double scale[3], uint32_t n, uint32_t *a,
                    uint32_t *b, uint32_t *c);
void kernel_scale(const double *range_m, uint32_t n, double *x, double *y, double *z);

/* ---- kernels_beam.c */
/* 1 / cos^2 for one; RTC_INVALID_GEOMETRY_ID: NaN. */
void kernel_steep(const struct bvh *bvh, uint32_t prim, const double dir[3], float *steep);
/* Up to where outlines may cut a footprint whose centre meets a surface at that range, and 1 / cos^2 of its incidence:
 * beyond it by the slope of the surface, doubled and more, for it may bend away, and by some footprints. */
double kernel_limit(const struct beam *beam, double range_m, float steep);
/* Ranges of centres -> means over footprints on planes; the first term of beam_plane_excess, which has them all. */
void kernel_excess(const struct beam *beam, const float *steep, uint32_t n, double *range_m);

/* Firing times after the run's first pulse: j * quot + floor((acc + j * rem) / den). */
void kernel_times(const struct schedule_run *run, uint32_t *dt_ns);

#endif
