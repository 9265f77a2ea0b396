/* SPDX-License-Identifier: MIT */
/* The shape of a monitored field, and whether a measured point lies in it.
 *
 * Coordinate frame: the head's, x right and y forward. Angles are SICK's: 0 is right, 90 degrees forward,
 * counter-clockwise seen from above. Lengths are whole micrometres and angles are compared as fractions of a turn, so
 * each decision is exact.
 *
 * Polygon: corners in order, of either sense; the last one is joined to the first. The polygon may be concave, may have
 * the head inside and may lie across any angle. A point on an edge or on a corner is in it. Where edges cross, a point
 * is in it if the outline winds about it (nonzero rule).
 *
 * Sector: from start to stop counter-clockwise, and from the inner to the outer radius; all four limits are in it.
 *
 * Chain: a list of directions in ascending order, which spans a turn at most. Each direction has a nearest and a
 * farthest distance. Straight lines join the nearest points of neighbouring directions, and likewise the farthest ones.
 * A beam that looks exactly in a direction is compared with that direction's two distances; both limits are in it.
 *
 * Pure. */
#ifndef DRIVERS_PROTOCOL_COLA_SHAPE_H
#define DRIVERS_PROTOCOL_COLA_SHAPE_H

#include <stdint.h>

enum {
    COLA_SHAPE_CORNERS = 128,
    COLA_SHAPE_LINKS = 64,
    COLA_SHAPE_REACH_UM = 1000000000, /* no coordinate is larger: 64 bits then hold each product that decides */
    COLA_TURN_E4 = 3600000,
};
static const double COLA_TURN_RAD = 6.283185307179586;

enum cola_shape_kind { COLA_SHAPE_NONE, COLA_SHAPE_POLYGON, COLA_SHAPE_SECTOR, COLA_SHAPE_CHAIN };

struct cola_point {
    int32_t x_um, y_um;
};

/* A direction of a chain: step / steps of a turn. Near 0: the field begins at the head. */
struct cola_link {
    int32_t step, steps;
    int32_t near_um, far_um;
    struct cola_point near, far;
};

struct cola_shape {
    enum cola_shape_kind kind;
    uint32_t n; /* corners or links; fewer than three corners are an empty polygon */
    union {
        struct cola_point corner[COLA_SHAPE_CORNERS];
        struct cola_link link[COLA_SHAPE_LINKS];
        struct {
            int32_t start_e4, span_e4; /* 1/10000 deg; span 0..COLA_TURN_E4 */
            int32_t inner_um, outer_um;
        } sector;
    };
};

/* A measured point: the coordinates are those of range and angle, to the nearest micrometre. */
struct cola_measured {
    struct cola_point at;
    int32_t range_um;
    int32_t step, steps; /* the beam's angle is step / steps of a turn; step may be negative */
};

/* Range at most COLA_SHAPE_REACH_UM. */
struct cola_measured cola_measured_at(int32_t step, int32_t steps, int32_t range_um);
int cola_shape_has(const struct cola_shape *shape, const struct cola_measured *point);
/* The nearest and the farthest place of a polygon or a sector on a ray from the head, to the nearest micrometre; a head
 * inside has nearest 0. Returns 0 where the ray misses the shape. */
int cola_shape_cut(const struct cola_shape *shape, double turns, int32_t *near_um, int32_t *far_um);
/* The outline of a polygon or a sector as corners, the arcs of a sector in steps. Returns how many corners, up to
 * COLA_SHAPE_CORNERS; 0: the shape has none. */
uint32_t cola_shape_outline(const struct cola_shape *shape, double out_m[COLA_SHAPE_CORNERS][2]);
/* Adds a corner of a polygon. Returns -1 where x or y is beyond COLA_SHAPE_REACH_UM, or there are too many. */
int cola_shape_add(struct cola_shape *shape, double x_um, double y_um);
/* Adds a link. The link's direction must be beyond the last one's, at most a turn beyond the first one's, and near not
 * above far: else -1, as also for the reasons above. All links of a shape have the same steps. */
int cola_shape_link(struct cola_shape *shape, int32_t step, int32_t steps, int32_t near_um, int32_t far_um);
/* A rectangle: width to the right and length forward from its corner, then turned counter-clockwise about the corner.
 * -1 as above. */
int cola_shape_rectangle(struct cola_shape *shape, const double corner_um[2], const double size_um[2], double turns);

#endif
