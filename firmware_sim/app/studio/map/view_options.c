/* SPDX-License-Identifier: MIT */
/* Turns the options of map --perspective into a plan. */
#include <math.h>
#include <string.h>

#include "core/angle.h"
#include "firmware_sim/app/options.h"
#include "firmware_sim/app/studio/map/view.h"

const struct map_view_options map_view_default = {.elevation_deg = 40,
                                                  .fov_deg = 40,
                                                  .point_m = -1,
                                                  .point_px = 1.5,
                                                  .below_m = INFINITY,
                                                  .above_m = -INFINITY,
                                                  .shade = 1};

const char *const map_view_colours[6] = {"height", "range", "reflectance", "label", "station", "rgb"};

const char *const map_view_winds[8] = {"north", "north-east", "east", "south-east",
                                       "south", "south-west", "west", "north-west"};

/* A point of the compass, or degrees clockwise from north. */
static int read_direction(const char *text, double *azimuth_rad, struct sh_err *err)
{
    double azimuth_deg;
    if (text == NULL) text = "south-west";
    if (!app_read_numbers(text, ',', &azimuth_deg, 1) || fabs(azimuth_deg) > 360) {
        const int wind = app_find_word("from", text, map_view_winds, 8, err);
        if (wind < 0)
            return sh_fail(err, SH_EINPUT, "%s, and degrees clockwise from north, -360 to 360", strdupa(err->text));
        azimuth_deg = 45.0 * wind;
    }
    *azimuth_rad = angle_rad(azimuth_deg);
    return SH_OK;
}

static int read_place(const char *option, const char *text, double place_m[3], int *has, struct sh_err *err)
{
    *has = text != NULL;
    if (text == NULL) return SH_OK;
    if (app_read_numbers(text, ',', place_m, 3) &&
        fmax(fmax(fabs(place_m[0]), fabs(place_m[1])), fabs(place_m[2])) <= 1e9)
        return SH_OK;
    return sh_fail(err, SH_EINPUT, "--%s %s: allowed are X,Y,Z in metres, each within 1e9, as in --%s 10,-5,8.5",
                   option, text, option);
}

static int read_size(const char *text, struct view_camera *camera, struct sh_err *err)
{
    double size[2] = {1200, 800};
    if (text != NULL &&
        (!app_read_numbers(text, 'x', size, 2) || size[0] != floor(size[0]) || size[1] != floor(size[1]) ||
         !(fmin(size[0], size[1]) >= VIEW_MIN_PX && fmax(size[0], size[1]) <= VIEW_MAX_SIDE_PX)))
        return sh_fail(err, SH_EINPUT, "--size %s: allowed are WIDTHxHEIGHT in pixels, %d to %d each, as in 1200x800",
                       text, VIEW_MIN_PX, VIEW_MAX_SIDE_PX);
    if (size[0] * size[1] > VIEW_MAX_PIXELS)
        return sh_fail(err, SH_EINPUT, "--size %s: %.0f pixels; allowed are %d in all, as in 4096x4096", text,
                       size[0] * size[1], VIEW_MAX_PIXELS);
    camera->width = (uint32_t)size[0];
    camera->height = (uint32_t)size[1];
    return SH_OK;
}

static int read_limits(const struct map_view_options *o, struct map_view_plan *plan, struct sh_err *err)
{
    plan->has_limits = o->limits != NULL;
    if (o->limits == NULL) return SH_OK;
    if (!app_read_numbers(o->limits, ',', plan->limit, 2) || !(plan->limit[1] > plan->limit[0]))
        return sh_fail(err, SH_EINPUT, "--limits %s: allowed are LOW,HIGH, the second larger than the first",
                       o->limits);
    if (plan->colour > MAP_VIEW_RANGE)
        return sh_fail(err, SH_EINPUT, "--limits: allowed with --colour height and range, not %s",
                       map_view_colours[plan->colour]);
    return SH_OK;
}

int map_view_read(const struct map_view_options *o, struct map_view_plan *plan, struct sh_err *err)
{
    memset(plan, 0, sizeof *plan);
    int colour = app_find_word("colour", o->colour != NULL ? o->colour : "height", map_view_colours, 6, err);
    if (colour < 0) return colour;
    plan->colour = (enum map_view_colour)colour;
    plan->elevation_rad = angle_rad(o->elevation_deg);
    plan->camera.fov_rad = angle_rad(o->fov_deg);
    plan->given = o;
    int rc = read_direction(o->from, &plan->azimuth_rad, err);
    if (rc == SH_OK) rc = read_place("eye", o->eye, plan->camera.eye_m, &plan->has_eye, err);
    if (rc == SH_OK) rc = read_place("look-at", o->look_at, plan->camera.look_at_m, &plan->has_look_at, err);
    if (rc == SH_OK) rc = read_size(o->size, &plan->camera, err);
    if (rc == SH_OK) rc = read_limits(o, plan, err);
    if (rc == SH_OK && plan->has_eye && o->from != NULL)
        rc = sh_fail(err, SH_EINPUT, "--eye and --from: both give the place of the eye; allowed is one of them");
    if (rc == SH_OK && !(o->below_m > o->above_m))
        rc = sh_fail(err, SH_EINPUT, "--below %g: allowed is a height above that of --above, %g", o->below_m,
                     o->above_m);
    return rc;
}
