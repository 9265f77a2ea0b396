/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/init/text.h"

#include <math.h>

#include "core/angle.h"
#include "firmware_sim/config/escape.h"
#include "firmware_sim/config/profile.h"
#include "firmware_sim/site/site.h"

static const double MOST_PULSES = 200000.0, MOST_LINES_HZ = 200.0;

static double from_micro(int64_t micro)
{
    return 1e-6 * (double)micro;
}

static double clamp(double value, double low, double high)
{
    return fmin(fmax(value, low), high);
}

/* Steps that people would choose. */
static double choose_step(double area_deg2)
{
    static const double step_deg[] = {0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3};
    for (size_t i = 0; i < sizeof step_deg / sizeof step_deg[0]; i++)
        if (area_deg2 <= MOST_PULSES * step_deg[i] * step_deg[i]) return step_deg[i];
    return 0.5;
}

static void choose_window(const struct config_profile *p, const struct viewpoint *at, struct init_scan *scan)
{
    const double pan_min_deg = from_micro(p->pan_min_udeg), pan_max_deg = from_micro(p->pan_max_udeg);
    const double fov_min_deg = from_micro(p->fov_min_udeg), fov_max_deg = from_micro(p->fov_max_udeg);
    scan->pan_stop_deg = pan_max_deg;
    scan->line_start_deg = fov_min_deg;
    scan->line_stop_deg = fov_max_deg;
    if (at->kind != VIEWPOINT_OUTSIDE) return;
    scan->pan_stop_deg = fmin(pan_min_deg + ceil(10.0 * angle_deg(at->pan_rad)) / 10.0, pan_max_deg);
    scan->line_start_deg = clamp(floor(10.0 * angle_deg(at->line0_rad)) / 10.0, fov_min_deg, fov_max_deg);
    scan->line_stop_deg = clamp(ceil(10.0 * angle_deg(at->line1_rad)) / 10.0, fov_min_deg, fov_max_deg);
}

/* A head with fixed pulse rates gets the largest one that is not above the wanted rate. Lines and pan then follow from
 * it, so that steps along and across the lines stay alike. */
static void choose_rates(const struct config_profile *p, double sweep_deg, struct init_scan *scan)
{
    const double most_hz = fmin(MOST_LINES_HZ, floor(from_micro(p->pan_max_udeg_s) / scan->step_deg));
    const double min_hz = from_micro(p->lines_min_uhz), max_hz = from_micro(p->lines_max_uhz);
    const double per_line = sweep_deg / scan->step_deg;
    scan->lines_hz = clamp(most_hz, min_hz, max_hz);
    scan->prr_hz =
        clamp(1000.0 * ceil(1e-3 * per_line * scan->lines_hz), from_micro(p->prr_min_uhz), from_micro(p->prr_max_uhz));
    if (p->n_programs == 0) return;
    scan->prr_hz = from_micro(config_rate_below(p, llround(1e6 * scan->prr_hz)));
    scan->lines_hz = clamp(fmin(most_hz, floor(scan->prr_hz / per_line)), min_hz, max_hz);
}

void init_choose_scan(const struct config_profile *p, const struct viewpoint *at, struct init_scan *scan)
{
    choose_window(p, at, scan);
    const double pan_deg = scan->pan_stop_deg - from_micro(p->pan_min_udeg);
    scan->step_deg = choose_step(pan_deg * (scan->line_stop_deg - scan->line_start_deg));
    choose_rates(p, 360.0 * p->optical_gain / p->facets, scan);
    scan->pan_deg_s = fmin(scan->step_deg * scan->lines_hz, from_micro(p->pan_max_udeg_s));
    scan->duration_s = pan_deg / scan->pan_deg_s;
}

void init_describe(const struct viewpoint *at, char *buf, size_t len)
{
    if (at->kind == VIEWPOINT_INSIDE)
        snprintf(buf, len, "inside, %.3g m above a floor", at->floor_m);
    else if (at->kind == VIEWPOINT_GROUND)
        snprintf(buf, len, "on open ground, %.3g m above it", at->floor_m);
    else
        snprintf(buf, len, "outside, facing the mesh");
}

static void put_escaped(const char *text, FILE *out)
{
    char one[CONFIG_ESCAPE_ROOM];
    for (const char *p = text; *p != '\0';) {
        p += config_escape(p, one);
        fputs(one, out);
    }
}

/* A double-quoted scalar of YAML. */
static void put_quoted(const char *text, FILE *out)
{
    fputc('"', out);
    put_escaped(text, out);
    fputc('"', out);
}

static void text_put_head(const struct init_text *t, FILE *out)
{
    const struct init_scan *scan = &t->scan;
    fprintf(out, "head:\n  profile: %s # sees from %g to %g m; `scanhead list` shows others\n", t->profile->name,
            t->profile->range_min_m, t->profile->range_max_m);
    fprintf(
        out,
        "  prr_hz: %.0f # a coarse scan of %.2g s, a line every %g deg; higher rates and a slower pan make it finer\n",
        scan->prr_hz, scan->duration_s, scan->step_deg);
    fprintf(out, "  lines_hz: %g\n  pan_deg_s: %.6g\n", scan->lines_hz, scan->pan_deg_s);
    if (t->at->kind != VIEWPOINT_OUTSIDE) return;
    fprintf(out, "  pan_stop_deg: %g # only the part of the view that holds the mesh\n", scan->pan_stop_deg);
    fprintf(out, "  line_start_deg: %g\n  line_stop_deg: %g\n", scan->line_start_deg, scan->line_stop_deg);
}

static void put_scene(const struct init_text *t, FILE *out)
{
    fprintf(out, "scene:\n  meshes:\n    - file: ");
    put_quoted(t->mesh_path, out);
    fprintf(out, "\n      up: %s # %s\n", t->mesh->up == SCENE_UP_Y ? "y" : "z", t->mesh->up_from);
    fprintf(out, "      scale: %.7g # metres per unit; %s\n", t->mesh->scale, t->mesh->scale_from);
    if (t->mesh->crs[0] != '\0')
        fprintf(out, "  anchor: {source: geotiff} # %s; height_m: height of the raster's 0 above the ellipsoid\n",
                t->mesh->crs);
}

/* A mesh file can't decide which surfaces are glass, so the line is a comment, whose # the user may remove. */
static void put_clear(const struct scene *scene, FILE *out)
{
    struct site_clear clear = {0};
    for (uint32_t i = 0; i < scene->n_surfaces; i++)
        site_clear_add(&clear, &scene->surface[i], NULL, 0);
    if (clear.n > 0)
        fprintf(out, "# The file calls these transparent. To make them glass, remove the # below:\n# surfaces: [%s]\n",
                clear.rules);
    if (clear.n_left_out > 0) fputs("# and more: `scanhead check --scene-csv FILE` lists all\n", out);
}

static void put_station(const struct init_text *t, FILE *out)
{
    static const char *const name[] = {
        [VIEWPOINT_INSIDE] = "inside", [VIEWPOINT_GROUND] = "ground", [VIEWPOINT_OUTSIDE] = "outside"};
    const double *p = t->at->position_m;
    char where[128];
    double heading_deg = fmod(floor(10.0 * angle_deg(t->at->heading_rad)) / 10.0 + 720.0, 360.0);
    init_describe(t->at, where, sizeof where);
    fprintf(out, "stations:\n  # %s; %.0f %% of the view hits something\n", where, 100.0 * t->at->seen);
    fprintf(out, "  - {name: %s, position_m: [%.4f, %.4f, %.4f], heading_deg: %g}\n", name[t->at->kind], p[0], p[1],
            p[2], heading_deg);
}

void init_write_text(const struct init_text *t, FILE *out)
{
    const struct scene *s = t->scene;
    fputs("# ", out);
    put_escaped(t->mesh_name, out); /* a line end of YAML would end the comment */
    fprintf(out, ": %.4g x %.4g x %.4g m, %u triangles. Change what does not fit.\n", s->max_m[0] - s->min_m[0],
            s->max_m[1] - s->min_m[1], s->max_m[2] - s->min_m[2], s->n_triangles);
    text_put_head(t, out);
    put_scene(t, out);
    put_clear(s, out);
    put_station(t, out);
    fprintf(out, "links: # for `scanhead run`; recording off line needs none\n  - {type: pty");
    if (t->link_name != NULL) {
        fprintf(out, ", path: ");
        put_quoted(t->link_name, out);
    }
    fprintf(out, "}\n");
}
