/* SPDX-License-Identifier: MIT */
#include "core/studio/view.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/studio/analysis/view_inside.h"
#include "core/vec3.h"

/* The largest radius of a disc, in pixels. Larger discs are of points close to the eye, and would only cost time. */
#define MAX_RADIUS 24.0

static int check_camera(const struct view_camera *c, struct sh_err *err)
{
    for (int i = 0; i < 3; i++)
        if (!isfinite(c->eye_m[i]) || !isfinite(c->look_at_m[i]) || !isfinite(c->look_at_m[i] - c->eye_m[i]))
            return sh_fail(err, SH_EINPUT, "view: %c of the eye or of its target is not finite", "xyz"[i]);
    if (!(c->fov_rad >= 0.01 && c->fov_rad <= 2.8))
        return sh_fail(err, SH_EINPUT, "view: field of view %g rad; allowed are 0.01 to 2.8", c->fov_rad);
    if (c->width < VIEW_MIN_PX || c->height < VIEW_MIN_PX || c->width > VIEW_MAX_SIDE_PX ||
        c->height > VIEW_MAX_SIDE_PX || (uint64_t)c->width * c->height > VIEW_MAX_PIXELS)
        return sh_fail(err, SH_EINPUT, "view: %u x %u pixels; allowed are %d to %d a side, and %d in all", c->width,
                       c->height, VIEW_MIN_PX, VIEW_MAX_SIDE_PX, VIEW_MAX_PIXELS);
    return SH_OK;
}

static int set_axes(struct view *view, struct sh_err *err)
{
    const struct view_camera *c = &view->spec.camera;
    double d[3];
    for (int i = 0; i < 3; i++)
        d[i] = c->look_at_m[i] - c->eye_m[i];
    const double length = sqrt(vec3_dot(d, d)), flat = hypot(d[0], d[1]);
    if (!(length > 0)) return sh_fail(err, SH_EINPUT, "view: the eye is at its target");
    /* straight down or up: the right axis is that of an eye that faces +y */
    const int nods = !(flat > 1e-9 * length);
    const double right[3] = {nods ? 1 : d[1] / flat, nods ? 0 : -d[0] / flat, 0};
    for (int i = 0; i < 3; i++)
        view->ahead[i] = d[i] / length;
    memcpy(view->right, right, sizeof right);
    vec3_cross(right, view->ahead, view->up);
    return SH_OK;
}

int view_create(const struct view_spec *spec, struct view **out, struct sh_err *err)
{
    int rc = check_camera(&spec->camera, err);
    if (rc == SH_OK && !(spec->point_m >= 0 && spec->point_m <= 1e9 && spec->point_px > 0 && spec->point_px <= 32))
        rc = sh_fail(err, SH_EINPUT,
                     "view: points of %g m, at least %g pixels; allowed are 0 to 1e9 m, above 0 to 32 pixels",
                     spec->point_m, spec->point_px);
    if (rc != SH_OK) return rc;
    struct view *view = calloc(1, sizeof *view);
    if (view == NULL) return sh_fail(err, SH_ENOMEM, "view: no memory");
    view->spec = *spec;
    view->width = VIEW_SUB * spec->camera.width;
    view->height = VIEW_SUB * spec->camera.height;
    view->focal = 0.5 * view->width / tan(0.5 * spec->camera.fov_rad);
    const size_t n = (size_t)view->width * view->height;
    rc = set_axes(view, err);
    if (rc == SH_OK && (view->place = malloc(n * sizeof *view->place)) == NULL)
        rc = sh_fail(err, SH_ENOMEM, "view: no memory for %u x %u pixels", spec->camera.width, spec->camera.height);
    if (rc != SH_OK) {
        view_free(view);
        return rc;
    }
    for (size_t i = 0; i < n; i++)
        view->place[i] = (struct view_place){INFINITY, INFINITY, {0}};
    *out = view;
    return SH_OK;
}

void view_free(struct view *view)
{
    if (view == NULL) return;
    free(view->place);
    free(view);
}

/* Sets `at` to the point's image, in places: a pixel is VIEW_SUB places wide. Returns 0 for a point behind the eye. */
static int project(const struct view *view, const double p_m[3], double at[2], double *depth_m)
{
    const double *eye = view->spec.camera.eye_m;
    const double d[3] = {p_m[0] - eye[0], p_m[1] - eye[1], p_m[2] - eye[2]};
    *depth_m = vec3_dot(d, view->ahead);
    if (!(*depth_m > 1e-6)) return 0;
    at[0] = 0.5 * view->width + view->focal * vec3_dot(d, view->right) / *depth_m;
    at[1] = 0.5 * view->height - view->focal * vec3_dot(d, view->up) / *depth_m;
    return 1;
}

int view_project(const struct view *view, const double p_m[3], double place_px[2], double *depth_m)
{
    if (!project(view, p_m, place_px, depth_m)) return 0;
    place_px[0] /= VIEW_SUB;
    place_px[1] /= VIEW_SUB;
    return 1;
}

/* Draws the places whose middle is in the disc. The place that has the point is always drawn. */
static int draw_disc(struct view *view, const double at[2], double depth_m, const struct view_place *what)
{
    const struct view_spec *spec = &view->spec;
    double radius = 0.5 * fmax(spec->point_m * view->focal / depth_m, spec->point_px * VIEW_SUB);
    radius = fmin(MAX_RADIUS * VIEW_SUB, radius);
    if (!(at[0] > -radius && at[1] > -radius && at[0] < view->width + radius && at[1] < view->height + radius))
        return 0;
    const int left = (int)fmax(0, floor(at[0] - radius)), top = (int)fmax(0, floor(at[1] - radius));
    const int right = (int)fmin(view->width - 1, floor(at[0] + radius));
    const int bottom = (int)fmin(view->height - 1, floor(at[1] + radius));
    const int column = (int)floor(at[0]), row = (int)floor(at[1]);
    const float bulge = (float)(depth_m / view->focal / radius); /* at the rim it adds the disc's radius, in metres */
    const float r2 = (float)(radius * radius), x0 = (float)at[0] - 0.5f, y0 = (float)at[1] - 0.5f;
    for (int y = top; y <= bottom; y++) {
        struct view_place *line = view->place + (size_t)y * view->width;
        const float dy = (float)y - y0;
        for (int x = left; x <= right; x++) {
            const float dx = (float)x - x0, d2 = dx * dx + dy * dy;
            const float order_m = what->depth_m + bulge * d2;
            if ((d2 > r2 && (x != column || y != row)) || !(order_m < line[x].order_m)) continue;
            line[x] = *what;
            line[x].order_m = order_m;
        }
    }
    return 1;
}

void view_add_points(struct view *view, size_t n, const double (*xyz_m)[3], const float *value, const uint8_t (*rgb)[3])
{
    view->has_rgb |= rgb != NULL;
    for (size_t i = 0; i < n; i++) {
        double at[2], depth_m;
        if (!isfinite(xyz_m[i][0]) || !isfinite(xyz_m[i][1]) || !isfinite(xyz_m[i][2])) {
            view->counts.empty++;
            continue;
        }
        int drawn = project(view, xyz_m[i], at, &depth_m);
        struct view_place what = {.depth_m = (float)depth_m};
        if (rgb != NULL)
            memcpy(what.rgb, rgb[i], 3);
        else
            what.value = value[i];
        if (drawn) drawn = draw_disc(view, at, depth_m, &what);
        view->counts.drawn += (uint64_t)drawn;
        view->counts.beyond += !drawn;
    }
}

void view_get_counts(const struct view *view, struct view_counts *counts)
{
    *counts = view->counts;
}

int view_range(const struct view *view, double *low, double *high)
{
    enum { BINS = 4096 };
    const size_t n = (size_t)view->width * view->height;
    uint64_t used = 0, count[BINS] = {0};
    *low = INFINITY;
    *high = -INFINITY;
    for (size_t i = 0; i < n && !view->has_rgb; i++) {
        const struct view_place *p = &view->place[i];
        if (!isfinite(p->order_m) || isnan(p->value)) continue;
        *low = fmin(*low, (double)p->value);
        *high = fmax(*high, (double)p->value);
        used++;
    }
    if (used == 0) return 0;
    const double bin = (*high - *low) / BINS;
    if (!(bin > 0)) return 1;
    for (size_t i = 0; i < n; i++) {
        const struct view_place *p = &view->place[i];
        if (isfinite(p->order_m) && !isnan(p->value)) count[(int)fmin(BINS - 1, ((double)p->value - *low) / bin)]++;
    }
    uint64_t below = 0, above = 0;
    int first = 0, last = BINS - 1;
    while ((below += count[first]) * 200 < used)
        first++;
    while ((above += count[last]) * 200 < used)
        last--;
    *high = *low + (last + 1) * bin;
    *low += first * bin;
    return 1;
}

/* ---- where to look from */

/* A box is fitted into the image along one of its axes. Corner i is across[i] away from the box's middle along that
 * axis, and deep[i] beyond it. An eye that is `back` in front of the middle, and `aside` along the axis, sees all
 * corners if |across - aside| <= tangent (deep + back). */
struct fit {
    double low, high; /* least of across + tangent deep, most of across - tangent deep */
    double tangent;
};

static double fit_back(const struct fit *f)
{
    return (f->high - f->low) / (2 * f->tangent);
}

static double fit_aside(const struct fit *f)
{
    return 0.5 * (f->high + f->low);
}

void view_frame(const double min_m[3], const double max_m[3], double azimuth_rad, double elevation_rad,
                struct view_camera *camera)
{
    const double flat = cos(elevation_rad), margin = 0.94;
    struct view view = {
        .spec.camera = {.look_at_m = {-flat * sin(azimuth_rad), -flat * cos(azimuth_rad), -sin(elevation_rad)}}};
    const double tangent = margin * tan(0.5 * camera->fov_rad);
    struct fit fit[2] = {{INFINITY, -INFINITY, tangent},
                         {INFINITY, -INFINITY, tangent * camera->height / camera->width}};
    double nearest_m = INFINITY, size_m = 0;
    set_axes(&view, NULL);
    for (int corner = 0; corner < 8; corner++) {
        double p[3];
        for (int i = 0; i < 3; i++)
            p[i] = 0.5 * (corner >> i & 1 ? max_m[i] - min_m[i] : min_m[i] - max_m[i]);
        const double deep = vec3_dot(p, view.ahead), across[2] = {vec3_dot(p, view.right), vec3_dot(p, view.up)};
        for (int k = 0; k < 2; k++) {
            fit[k].low = fmin(fit[k].low, across[k] + fit[k].tangent * deep);
            fit[k].high = fmax(fit[k].high, across[k] - fit[k].tangent * deep);
        }
        if (deep < nearest_m) nearest_m = deep; /* gcc 12 for ARM has an internal error on fmin here */
        size_m = fmax(size_m, sqrt(vec3_dot(p, p)));
    }
    if (!(size_m > 0)) size_m = 1;
    const double back_m = fmax(fmax(fit_back(&fit[0]), fit_back(&fit[1])), 0.2 * size_m - nearest_m);
    for (int i = 0; i < 3; i++) {
        camera->look_at_m[i] =
            0.5 * (min_m[i] + max_m[i]) + fit_aside(&fit[0]) * view.right[i] + fit_aside(&fit[1]) * view.up[i];
        camera->eye_m[i] = camera->look_at_m[i] - back_m * view.ahead[i];
    }
}
