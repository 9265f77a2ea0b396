/* SPDX-License-Identifier: MIT */
/* The picture of map --perspective: eye, points, colours, legend. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/colour.h"
#include "core/newfile.h"
#include "core/studio/cloud.h"
#include "core/vec3.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/ranking.h"
#include "firmware_sim/app/studio/map/view_inside.h"
#include "firmware_sim/config/places.h"

/* ---- points */

static void add_batch(struct picturing *p)
{
    view_add_points(p->view, p->n, (const double(*)[3])p->xyz_m, p->value,
                    p->plan->colour == MAP_VIEW_RGB ? (const uint8_t(*)[3])p->rgb : NULL);
    p->n = 0;
}

void picturing_add(struct picturing *p, const double xyz_m[3], const struct picturing_figures *f)
{
    if (xyz_m[2] > p->plan->given->below_m || xyz_m[2] < p->plan->given->above_m) {
        p->cut++;
        return;
    }
    float value = 0;
    switch (p->plan->colour) {
    case MAP_VIEW_HEIGHT:
        value = (float)xyz_m[2];
        break;
    case MAP_VIEW_RANGE:
        value = (float)f->range_m;
        break;
    case MAP_VIEW_REFLECTANCE:
        value = (float)f->refl_db;
        break;
    case MAP_VIEW_LABEL:
        value = (float)f->label;
        break;
    case MAP_VIEW_STATION:
        value = (float)f->station;
        break;
    case MAP_VIEW_RGB:
        memcpy(p->rgb[p->n], f->rgb, 3);
        break;
    }
    if (isfinite(xyz_m[0])) p->number[p->plan->colour == MAP_VIEW_STATION ? f->station : f->label]++;
    memcpy(p->xyz_m[p->n], xyz_m, sizeof p->xyz_m[0]);
    p->value[p->n] = value;
    if (++p->n == MAP_VIEW_BATCH) add_batch(p);
}

/* ---- the eye */

void picturing_include(struct picturing_bounds *b, const double p_m[3])
{
    if (!isfinite(p_m[0]) || !isfinite(p_m[1]) || !isfinite(p_m[2])) return;
    vec3_bound(b->min_m, b->max_m, p_m);
}

int picturing_look(struct picturing *p, const struct picturing_bounds *bounds, struct sh_err *err)
{
    struct picturing_bounds b = *bounds;
    struct view_spec spec = {p->plan->camera, p->plan->given->point_m, p->plan->given->point_px};
    struct view_camera framed = p->plan->camera;
    b.max_m[2] = fmax(b.min_m[2], fmin(b.max_m[2], p->plan->given->below_m));
    b.min_m[2] = fmin(b.max_m[2], fmax(b.min_m[2], p->plan->given->above_m));
    view_frame(b.min_m, b.max_m, p->plan->azimuth_rad, p->plan->elevation_rad, &framed);
    if (!p->plan->has_look_at) memcpy(spec.camera.look_at_m, framed.look_at_m, sizeof framed.look_at_m);
    for (int i = 0; i < 3 && !p->plan->has_eye; i++)
        spec.camera.eye_m[i] = framed.eye_m[i] + spec.camera.look_at_m[i] - framed.look_at_m[i];
    if (spec.point_m < 0) { /* with 700 points along the longest side a surface shows no gaps */
        spec.point_m = 0;
        for (int i = 0; i < 3; i++)
            spec.point_m = fmax(spec.point_m, (b.max_m[i] - b.min_m[i]) / 700);
    }
    return view_create(&spec, &p->view, err);
}

/* ---- colours */

static void colour_of(const void *ctx, double value, uint8_t rgb[3])
{
    const struct picturing *p = ctx;
    const double part = p->limit[1] > p->limit[0] ? (value - p->limit[0]) / (p->limit[1] - p->limit[0]) : 0.5;
    switch (p->plan->colour) {
    case MAP_VIEW_HEIGHT:
        view_ramp(part, rgb);
        break;
    case MAP_VIEW_RANGE:
        colour_ramp(part, rgb);
        break;
    case MAP_VIEW_REFLECTANCE:
        colour_reflectance(value, rgb);
        break;
    default:
        if (value >= CLOUD_LABEL_NONE)
            memcpy(rgb, colour_grey, 3);
        else
            colour_number((uint32_t)value, rgb);
        for (int i = 0; i < 3; i++) /* paler, so that shading is seen on dark ones, too */
            rgb[i] = (uint8_t)(rgb[i] + (255 - rgb[i]) / 4);
        break;
    }
}

static void name_station(const struct picturing *p, uint32_t station, char *out, size_t room)
{
    if (p->site != NULL && station <= p->site->n_stations)
        snprintf(out, room, "%s", p->site->station[station - 1].station->name);
    else
        snprintf(out, room, "station %u", station);
}

static void name_label(const struct picturing *p, uint32_t label, char *out, size_t room)
{
    if (p->site != NULL && label < p->site->n_surfaces) {
        char whole[2 * SCENE_NAME_LEN + 4];
        const int n = snprintf(whole, sizeof whole, "%s | %s", site_surface(p->site, label)->object,
                               site_surface(p->site, label)->material);
        scene_copy_name(out, room, whole, (size_t)n);
    } else
        snprintf(out, room, label == CLOUD_LABEL_NONE ? "no label" : "label %u", label);
}

/* Stations have the order of their numbers. */
static double points_of(const void *ctx, uint32_t i)
{
    const struct picturing *p = ctx;
    return p->plan->colour == MAP_VIEW_STATION ? p->number[i] > 0 : (double)p->number[i];
}

/* Draws the names of stations in the order of their numbers, those of labels with the most points first. */
static int draw_names(const struct picturing *p, struct picture *picture, struct sh_err *err)
{
    const int stations = p->plan->colour == MAP_VIEW_STATION;
    uint32_t *order = ranking_make(MAP_VIEW_NUMBERS, points_of, p), n = 0;
    struct view_entry entry[VIEW_MAX_NAMES];
    if (order == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the legend");
    for (; n < MAP_VIEW_NUMBERS && p->number[order[n]] > 0; n++) {
        if (n >= VIEW_MAX_NAMES) continue; /* they are only counted */
        colour_of(p, order[n], entry[n].rgb);
        (stations ? name_station : name_label)(p, order[n], entry[n].name, sizeof entry[n].name);
    }
    free(order);
    view_draw_names(picture, stations ? "Stations" : "Surfaces", entry, n);
    return SH_OK;
}

static int draw_legend(struct picturing *p, const struct view_colours *colours, struct picture *picture,
                       struct sh_err *err)
{
    static const char *const titles[] = {"Height z (m)", "Range (m)", "Reflectance (dB)"};
    if (p->plan->colour <= MAP_VIEW_REFLECTANCE)
        view_draw_scale(picture, titles[p->plan->colour], p->limit[0], p->limit[1], colours);
    else if (p->plan->colour != MAP_VIEW_RGB)
        return draw_names(p, picture, err);
    return SH_OK;
}

static int check_figures(struct picturing *p, struct sh_err *err)
{
    struct view_counts counts;
    view_get_counts(p->view, &counts);
    if (counts.drawn == 0)
        return sh_fail(
            err, SH_EINPUT,
            "%s: no point is in the picture: %llu are outside of it or behind the eye, --below and --above leave out "
            "%llu, and %llu shots have no echo",
            p->plan->output, (unsigned long long)counts.beyond, (unsigned long long)p->cut,
            (unsigned long long)counts.empty);
    if (p->plan->colour == MAP_VIEW_RGB) return SH_OK;
    const int known = view_range(p->view, &p->limit[0], &p->limit[1]);
    if (!known && p->plan->colour == MAP_VIEW_REFLECTANCE)
        return sh_fail(err, SH_EINPUT,
                       "--colour reflectance: no point has one; --set signal.model=on gives them one in a scan");
    if (!known) return sh_fail(err, SH_EINPUT, "--colour range: no point has a range, as with a head that moves");
    if (p->plan->colour == MAP_VIEW_REFLECTANCE) {
        p->limit[0] = -30; /* colour_reflectance */
        p->limit[1] = 0;
    }
    if (p->plan->has_limits) memcpy(p->limit, p->plan->limit, sizeof p->limit);
    return SH_OK;
}

static int draw_stations(const struct picturing *p, struct picture *picture, struct sh_err *err)
{
    const struct site *site = p->site;
    struct view_station *station = calloc(site->n_stations, sizeof *station);
    if (station == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %u stations", site->n_stations);
    for (uint32_t s = 0; s < site->n_stations; s++) {
        memcpy(station[s].p_m, site->station[s].at.position_m, sizeof station[s].p_m);
        station[s].name = site->station[s].station->name;
    }
    const uint32_t left_out = view_draw_stations(p->view, picture, station, site->n_stations);
    free(station);
    if (left_out > 0 && !p->plan->quiet)
        fprintf(stderr, "scanhead: %s: %u names of stations would cover other names or marks, and are left out\n",
                p->plan->output, left_out);
    return SH_OK;
}

int picturing_finish(struct picturing *p, struct sh_err *err)
{
    struct picture picture = {0};
    const struct view_colours colours = {colour_of, p, p->plan->given->shade, {252, 252, 252}, &app_report_seconds};
    add_batch(p);
    int rc = check_figures(p, err);
    if (rc == SH_OK) rc = view_draw(p->view, &colours, &picture, err);
    if (rc == SH_OK && p->site != NULL && !p->site->moving) rc = draw_stations(p, &picture, err);
    if (rc == SH_OK) rc = draw_legend(p, &colours, &picture, err);
    if (rc == SH_OK) rc = picture_write_png(&picture, "map", p->plan->output, err);
    picture_free(&picture);
    if (rc == SH_ESTOPPED) return sh_fail(err, rc, "interrupted; nothing written");
    if (rc != SH_OK || p->plan->quiet) return rc;
    struct view_counts counts;
    view_get_counts(p->view, &counts);
    fprintf(stderr, "scanhead: %s: %llu points in the picture, %llu outside of it", p->plan->output,
            (unsigned long long)counts.drawn, (unsigned long long)counts.beyond);
    if (p->cut > 0) fprintf(stderr, ", %llu left out by height", (unsigned long long)p->cut);
    fputc('\n', stderr);
    return rc;
}

void picturing_end(struct picturing *p)
{
    view_free(p->view);
    free(p);
}

int picturing_begin(const struct map_view_plan *plan, struct picturing **out, struct sh_err *err)
{
    const int rc = newfile_check(plan->output, err);
    if (rc != SH_OK) return rc;
    struct picturing *p = calloc(1, sizeof *p);
    if (p == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a picture");
    p->plan = plan;
    *out = p;
    return SH_OK;
}
