/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/cola_shape.h"

#include <math.h>

struct cola_measured cola_measured_at(int32_t step, int32_t steps, int32_t range_um)
{
    const double angle = COLA_TURN_RAD * step / steps;
    return (struct cola_measured){
        {(int32_t)lround(range_um * cos(angle)), (int32_t)lround(range_um * sin(angle))}, range_um, step, steps};
}

/* Twice the area of a, b, p: above 0 where p is left of the way from a to b. Exact: differences are up to 2e9. */
static int64_t cola_shape_side(const struct cola_point *a, const struct cola_point *b, const struct cola_point *p)
{
    return ((int64_t)b->x_um - a->x_um) * ((int64_t)p->y_um - a->y_um) -
           ((int64_t)b->y_um - a->y_um) * ((int64_t)p->x_um - a->x_um);
}

static int is_between(int32_t v, int32_t a, int32_t b)
{
    return (v >= a && v <= b) || (v >= b && v <= a);
}

/* The winding number counts edges that cross the ray to the right of p: upward ones with p at their left, downward ones
 * with p at their right. An edge includes its lower end, not its upper one, so a corner on the ray counts once. */
static int polygon_has(const struct cola_shape *s, const struct cola_point *p)
{
    int winding = 0;
    if (s->n < 3) return 0;
    for (uint32_t i = 0; i < s->n; i++) {
        const struct cola_point *a = &s->corner[i], *b = &s->corner[i + 1 < s->n ? i + 1 : 0];
        const int up = a->y_um <= p->y_um && b->y_um > p->y_um, down = a->y_um > p->y_um && b->y_um <= p->y_um;
        if (!up && !down && !is_between(p->y_um, a->y_um, b->y_um)) continue;
        const int64_t side = cola_shape_side(a, b, p);
        if (side == 0 && is_between(p->x_um, a->x_um, b->x_um) && is_between(p->y_um, a->y_um, b->y_um)) return 1;
        if (up && side > 0) winding++;
        if (down && side < 0) winding--;
    }
    return winding != 0;
}

/* Angles are compared in the unit (1/10000 deg) / steps, in which the beam's and the sector's are whole numbers. */
static int sector_has(const struct cola_shape *s, const struct cola_measured *m)
{
    if (m->range_um < s->sector.inner_um || m->range_um > s->sector.outer_um) return 0;
    const int64_t turn = (int64_t)COLA_TURN_E4 * m->steps;
    int64_t after = ((int64_t)m->step * COLA_TURN_E4 - (int64_t)s->sector.start_e4 * m->steps) % turn;
    if (after < 0) after += turn;
    return after <= (int64_t)s->sector.span_e4 * m->steps || s->sector.span_e4 == COLA_TURN_E4;
}

/* Below 0, 0 or above 0: a beam's direction is before that of a link, the same, or beyond it. */
static int64_t chain_turn(const struct cola_measured *m, const struct cola_link *link)
{
    return (int64_t)m->step * link->steps - (int64_t)link->step * m->steps;
}

/* Moves the beam's step by whole turns, so that it lies less than a turn beyond the first link. */
static int32_t chain_step(const struct cola_measured *m, const struct cola_link *first)
{
    const int64_t turn = (int64_t)m->steps * first->steps, beyond = chain_turn(m, first);
    const int64_t turns = beyond / turn - (beyond % turn < 0);
    return (int32_t)(m->step - turns * m->steps);
}

/* Between two links a point is in the field if it lies left of the far line (on the head's side) and right of the near
 * one. A point on a line is in it, too. */
static int chain_has(const struct cola_shape *s, const struct cola_measured *seen)
{
    struct cola_measured m = *seen;
    if (s->n != 0) m.step = chain_step(seen, &s->link[0]);
    for (uint32_t i = 0; i < s->n; i++) {
        const struct cola_link *link = &s->link[i];
        const int64_t beyond = chain_turn(&m, link);
        if (beyond == 0) return m.range_um >= link->near_um && m.range_um <= link->far_um;
        if (beyond > 0) continue;
        return i > 0 && cola_shape_side(&link[-1].far, &link->far, &m.at) >= 0 &&
               cola_shape_side(&link[-1].near, &link->near, &m.at) <= 0;
    }
    return 0;
}

int cola_shape_has(const struct cola_shape *shape, const struct cola_measured *point)
{
    if (shape->kind == COLA_SHAPE_SECTOR) return sector_has(shape, point);
    if (shape->kind == COLA_SHAPE_CHAIN) return chain_has(shape, point);
    return shape->kind == COLA_SHAPE_POLYGON && polygon_has(shape, &point->at);
}

/* ---- where a ray meets a shape */

static void widen(double r, double *near, double *far)
{
    if (r < *near) *near = r;
    if (r > *far) *far = r;
}

/* An edge that the ray touches along its length counts with both ends. */
static void cut_edge(const struct cola_point *a, const struct cola_point *b, const double ray[2], double *near,
                     double *far)
{
    const double sa = ray[0] * a->y_um - ray[1] * a->x_um, sb = ray[0] * b->y_um - ray[1] * b->x_um;
    const double ra = ray[0] * a->x_um + ray[1] * a->y_um, rb = ray[0] * b->x_um + ray[1] * b->y_um;
    /* A corner on the ray is rounded to whole um, so it may lie this far beside the ray. */
    const double slack = 0.5;
    if (fabs(sa) <= slack && ra >= 0.0) widen(ra, near, far);
    if (fabs(sb) <= slack && rb >= 0.0) widen(rb, near, far);
    if ((sa < 0.0) == (sb < 0.0)) return;
    const double r = ra + (rb - ra) * (sa / (sa - sb));
    if (r >= 0.0) widen(r, near, far);
}

int cola_shape_cut(const struct cola_shape *s, double turns, int32_t *near_um, int32_t *far_um)
{
    static const struct cola_point head = {0, 0};
    const double ray[2] = {cos(COLA_TURN_RAD * turns), sin(COLA_TURN_RAD * turns)};
    double near = HUGE_VAL, far = -1.0;
    if (s->kind == COLA_SHAPE_SECTOR) {
        double after_e4 = fmod(turns * COLA_TURN_E4 - s->sector.start_e4, COLA_TURN_E4);
        if (after_e4 < 0.0) after_e4 += COLA_TURN_E4;
        if (after_e4 > s->sector.span_e4 + 0.5 && after_e4 < COLA_TURN_E4 - 0.5)
            return 0; /* 0.5: the sector's angles are rounded */
        *near_um = s->sector.inner_um;
        *far_um = s->sector.outer_um;
        return 1;
    }
    if (s->kind != COLA_SHAPE_POLYGON || s->n < 3) return 0;
    for (uint32_t i = 0; i < s->n; i++)
        cut_edge(&s->corner[i], &s->corner[i + 1 < s->n ? i + 1 : 0], ray, &near, &far);
    if (polygon_has(s, &head)) near = 0.0;
    if (far < 0.0) return 0;
    *near_um = (int32_t)lround(near);
    *far_um = (int32_t)lround(far);
    return 1;
}

static uint32_t sector_outline(const struct cola_shape *s, double out_m[][2])
{
    enum { STEPS = COLA_SHAPE_CORNERS / 2 };
    uint32_t n = 0;
    for (uint32_t i = 0; i < 2 * STEPS; i++) { /* out along the outer arc, and back along the inner one */
        const uint32_t k = i < STEPS ? i : 2 * STEPS - 1 - i;
        const double angle =
            COLA_TURN_RAD * (s->sector.start_e4 + (double)s->sector.span_e4 * k / (STEPS - 1)) / COLA_TURN_E4;
        const double radius_m = 1e-6 * (i < STEPS ? s->sector.outer_um : s->sector.inner_um);
        out_m[n][0] = radius_m * cos(angle);
        out_m[n++][1] = radius_m * sin(angle);
        if (i >= STEPS && s->sector.inner_um == 0) break; /* the head itself */
    }
    return n;
}

uint32_t cola_shape_outline(const struct cola_shape *shape, double out_m[COLA_SHAPE_CORNERS][2])
{
    if (shape->kind == COLA_SHAPE_SECTOR) return sector_outline(shape, out_m);
    if (shape->kind != COLA_SHAPE_POLYGON) return 0;
    for (uint32_t i = 0; i < shape->n; i++) {
        out_m[i][0] = 1e-6 * shape->corner[i].x_um;
        out_m[i][1] = 1e-6 * shape->corner[i].y_um;
    }
    return shape->n;
}

/* ---- making */

int cola_shape_add(struct cola_shape *shape, double x_um, double y_um)
{
    if (shape->n == COLA_SHAPE_CORNERS || !(fabs(x_um) <= COLA_SHAPE_REACH_UM) || !(fabs(y_um) <= COLA_SHAPE_REACH_UM))
        return -1;
    shape->kind = COLA_SHAPE_POLYGON;
    shape->corner[shape->n++] = (struct cola_point){(int32_t)lround(x_um), (int32_t)lround(y_um)};
    return 0;
}

int cola_shape_link(struct cola_shape *shape, int32_t step, int32_t steps, int32_t near_um, int32_t far_um)
{
    const struct cola_measured here = {.step = step, .steps = steps};
    if (shape->n == COLA_SHAPE_LINKS || far_um > COLA_SHAPE_REACH_UM || near_um > far_um) return -1;
    if (shape->n != 0 && chain_turn(&here, &shape->link[shape->n - 1]) <= 0) return -1;
    if (shape->n != 0 && chain_turn(&here, &shape->link[0]) > (int64_t)steps * steps) return -1;
    shape->kind = COLA_SHAPE_CHAIN;
    shape->link[shape->n++] = (struct cola_link){step,
                                                 steps,
                                                 near_um,
                                                 far_um,
                                                 cola_measured_at(step, steps, near_um).at,
                                                 cola_measured_at(step, steps, far_um).at};
    return 0;
}

int cola_shape_rectangle(struct cola_shape *shape, const double corner_um[2], const double size_um[2], double turns)
{
    const double c = cos(COLA_TURN_RAD * turns), s = sin(COLA_TURN_RAD * turns);
    for (int i = 0; i < 4; i++) {
        const double right = i == 1 || i == 2 ? size_um[0] : 0.0, forward = i >= 2 ? size_um[1] : 0.0;
        if (cola_shape_add(shape, corner_um[0] + right * c - forward * s, corner_um[1] + right * s + forward * c) != 0)
            return -1;
    }
    return 0;
}
