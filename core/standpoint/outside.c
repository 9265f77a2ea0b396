/* Places around the scene, from which it is looked at. */
#include <math.h>
#include <string.h>

#include "core/angle.h"
#include "core/standpoint/survey.h"
#include "core/vec3.h"

enum { SIDES = 8, HEIGHTS = 3, GRID = 24 };

/* Front, half front, sides, backs: azimuths at which the station looks, and what each is worth. */
static const double side_deg[SIDES] = {0, 45, -45, 90, -90, 135, -135, 180};
static const double side_worth[SIDES] = {1.0, 0.95, 0.95, 0.9, 0.9, 0.85, 0.85, 0.8};
static const double height_deg[HEIGHTS] = {8, 22, 35}, height_worth[HEIGHTS] = {1.0, 0.9, 0.8};

/* The distance from the centre: the sphere around the scene fills 47 degrees. Not nearer than the head sees;
 * and where the scene is larger than its range, near enough to its side. */
static double distance_m(const struct survey *s, const double toward[3])
{
    const struct standpoint_view *v = s->view;
    double far_m = fmax(2.5 * s->radius_m, s->radius_m + 1.3 * v->range_min_m), half_m = 0.0;
    for (int i = 0; i < 3; i++)
        half_m += 0.5 * s->size_m[i] * fabs(toward[i]);
    return fmin(far_m, half_m + 0.3 * v->range_max_m + v->range_min_m);
}

/* The part of the view that holds the scene's bounds, as seen from p with the azimuth `ahead` in its middle. */
static void frame(const struct survey *s, double ahead_rad, struct standpoint *at)
{
    const double *p = at->position_m, *low = s->scene->min_m, *high = s->scene->max_m;
    double left = 0.0, right = 0.0, near_m[2], far_m = 0.0;
    for (int i = 0; i < 4; i++) {
        double x = (i & 1 ? high : low)[0] - p[0], y = (i & 2 ? high : low)[1] - p[1];
        double turn = remainder(atan2(x, y) - ahead_rad, 2.0 * M_PI);
        left = fmin(left, turn);
        right = fmax(right, turn);
        far_m = fmax(far_m, hypot(x, y));
    }
    for (int i = 0; i < 2; i++)
        near_m[i] = fmax(fmax(low[i] - p[i], p[i] - high[i]), 0.0);
    double near = hypot(near_m[0], near_m[1]), up = high[2] - p[2], below = low[2] - p[2];
    double margin = angle_rad(1.0) + 0.03 * (right - left);
    at->heading_rad = ahead_rad + left - margin;
    at->pan_rad = fmin(right - left + 2.0 * margin, 2.0 * M_PI);
    at->line0_rad = fmax(atan2(below, below < 0.0 ? near : far_m) - margin, s->view->line_min_rad);
    at->line1_rad = fmin(atan2(up, up > 0.0 ? near : far_m) + margin, fmin(s->view->line_max_rad, M_PI_2));
}

/* What a place sees within its frame. */
static struct survey_sight look(struct survey *s, const struct standpoint *at)
{
    survey_clear(s);
    for (int i = 0; i < GRID * GRID; i++) {
        double dir[3], across = (i % GRID + 0.5) / GRID, up = (i / GRID + 0.5) / GRID;
        survey_direction(at->heading_rad + at->pan_rad * across, at->line0_rad + (at->line1_rad - at->line0_rad) * up,
                         dir);
        survey_add(s, at->position_m, dir);
    }
    survey_cast(s);
    return survey_look(s, 0, GRID * GRID);
}

void survey_outside(struct survey *s, struct standpoint *out)
{
    double best = -1.0;
    for (int k = 0; k < SIDES * HEIGHTS; k++) {
        struct standpoint at = {.kind = STANDPOINT_OUTSIDE, .floor_m = NAN};
        double ahead = angle_rad(side_deg[k % SIDES]), toward[3];
        survey_direction(ahead, -angle_rad(height_deg[k / SIDES]), toward);
        double away_m = distance_m(s, toward);
        for (int i = 0; i < 3; i++)
            at.position_m[i] = s->centre_m[i] - away_m * toward[i];
        frame(s, ahead, &at);
        if (!(at.line1_rad > at.line0_rad)) continue;
        struct survey_sight sight = look(s, &at);
        double liked = height_worth[k / SIDES] * side_worth[k % SIDES] * (0.5 + 0.5 * sight.front);
        double value = sight.seen * at.pan_rad * (at.line1_rad - at.line0_rad) * liked;
        if (value <= best) continue;
        best = value;
        *out = at;
        out->seen = sight.seen;
    }
}
