/* SPDX-License-Identifier: MIT */
/* The map of a report: the cloud from above, coloured by distance from the scene, with the stations. */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "core/colour.h"
#include "core/geoframe.h"
#include "core/mat3.h"
#include "core/studio/cloud_picture.h"
#include "core/studio/picture.h"
#include "core/vec3.h"
#include "firmware_sim/app/studio/report/page.h"
#include "firmware_sim/app/studio/report/report.h"
#include "firmware_sim/config/places.h"

enum { MOST_NAMES = 40, WIDTH = 900 };

struct view {
    const struct report *r;
    int turned; /* a scene in ECEF: east, north, up of the first station */
    double origin_m[3], to_enu[9];
};

static void to_map(const struct view *v, const double p_prcs[3], double place_m[2])
{
    double d[3], p[3] = {p_prcs[0], p_prcs[1], p_prcs[2]};
    if (v->turned) {
        vec3_sub(p_prcs, v->origin_m, d);
        mat3_apply(v->to_enu, d, p);
    }
    place_m[0] = p[0];
    place_m[1] = p[1];
}

static int point(void *ctx, size_t i, double place_m[2], double *figure)
{
    const struct view *v = ctx;
    if (isnan(v->r->distance_m[i])) return 0;
    to_map(v, v->r->cloud.xyz_m[i], place_m);
    *figure = v->r->distance_m[i];
    return 1;
}

static int set_view(const struct report *r, struct view *v, struct sh_err *err)
{
    const struct geoframe *frame = &r->site->anchor.frame;
    *v = (struct view){.r = r, .turned = r->site->anchor.known && frame->kind == GEOFRAME_ECEF};
    if (!v->turned) return SH_OK;
    memcpy(v->origin_m, r->site->station[0].at.position_m, sizeof v->origin_m);
    return geoframe_to_enu(frame, v->origin_m, v->to_enu, err);
}

static void include_stations(const struct view *v, struct cloud_picture_spec *spec)
{
    for (int k = 0; k < 2; k++)
        spec->include_m[0][k] = spec->include_m[1][k] = (double)NAN;
    for (uint32_t s = 0; s < v->r->site->n_stations && !v->r->site->moving; s++) {
        double m[2];
        to_map(v, v->r->site->station[s].at.position_m, m);
        for (int k = 0; k < 2; k++) {
            spec->include_m[0][k] = fmin(spec->include_m[0][k], m[k]);
            spec->include_m[1][k] = fmax(spec->include_m[1][k], m[k]);
        }
    }
}

/* Places a label right or left of the station, above or below: at the first of these places that lies within the map
 * and is free. Returns 0 where none is. */
static int place_label(const double at[2], double wide, double height, const struct picture_box *taken, uint32_t n,
                       struct picture_box *out)
{
    enum { LETTER_HEIGHT = 18, GAP = 12, PLACES = 4 };
    const double x[PLACES] = {at[0] + GAP, at[0] - GAP - wide, at[0] - 0.5 * wide, at[0] - 0.5 * wide};
    const double y[PLACES] = {at[1], at[1], at[1] - 20.0, at[1] + 18.0};
    for (int k = 0; k < PLACES; k++) {
        *out = (struct picture_box){x[k], y[k] - 0.5 * LETTER_HEIGHT, x[k] + wide, y[k] + 0.5 * LETTER_HEIGHT};
        int is_free = out->left >= 0.0 && out->right <= WIDTH && out->top >= 0.0 && out->bottom <= height;
        for (uint32_t i = 0; i < n && is_free; i++)
            is_free = !picture_box_overlaps(out, &taken[i]);
        if (is_free) return 1;
    }
    return 0;
}

static void station_at(const struct view *v, const struct cloud_picture *p, double scale, uint32_t station,
                       double at[2])
{
    to_map(v, v->r->site->station[station].at.position_m, at);
    at[0] = (at[0] - p->min_m[0]) * scale;
    at[1] = (p->max_m[1] - at[1]) * scale;
}

static void put_mark(FILE *out, const double at[2], const char *name)
{
    fprintf(out, "<polygon class=\"station\" points=\"%.1f,%.1f %.1f,%.1f %.1f,%.1f\"><title>", at[0], at[1] - 9.0,
            at[0] - 8.0, at[1] + 6.0, at[0] + 8.0, at[1] + 6.0);
    picture_put_escaped(out, name);
    fputs("</title></polygon>\n", out);
}

/* Draws the marks of all stations, and those names that cover no other name and no mark; none where there are more than
 * MOST_NAMES stations. Returns how many names are left out. */
static uint32_t put_stations(FILE *out, const struct view *v, const struct cloud_picture *p, double scale)
{
    const struct site *site = v->r->site;
    const uint32_t n = site->moving ? 0 : site->n_stations;
    const double height = scale * (p->max_m[1] - p->min_m[1]), letter = 8.5; /* bold, of 14 units */
    struct picture_box taken[2 * MOST_NAMES];
    uint32_t n_taken = 0, left_out = 0;
    char name[CONFIG_STATION_NAME_LEN + 16];
    double at[2];
    for (uint32_t s = 0; s < n && n_taken < MOST_NAMES; s++) {
        station_at(v, p, scale, s, at);
        taken[n_taken++] = (struct picture_box){at[0] - 8.0, at[1] - 9.0, at[0] + 8.0, at[1] + 6.0};
    }
    for (uint32_t s = 0; s < n; s++) {
        struct picture_box box;
        station_at(v, p, scale, s, at);
        snprintf(name, sizeof name, "%" PRIu32 " %s", s + 1, site->station[s].station->name);
        put_mark(out, at, name);
        if (n > MOST_NAMES || !place_label(at, letter * page_letters(name), height, taken, n_taken, &box)) {
            left_out++;
            continue;
        }
        taken[n_taken++] = box;
        const int is_right = box.left > at[0], is_left = box.right < at[0];
        fprintf(out, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\">",
                is_right  ? box.left
                : is_left ? box.right
                          : at[0],
                0.5 * (box.top + box.bottom) + 5.0,
                is_right  ? "start"
                : is_left ? "end"
                          : "middle");
        picture_put_escaped(out, name);
        fputs("</text>\n", out);
    }
    return left_out;
}

/* Draws a scale bar of 1, 2 or 5 times a power of ten, and the colours with their figures. */
static void put_legend(FILE *out, double top, double m_per_unit, double most_m)
{
    const double bar_m = figures_nice(0.12 * WIDTH * m_per_unit), bar = bar_m / m_per_unit;
    const int left = WIDTH - 370, right = WIDTH - 130;
    double per_m;
    const char *unit = page_unit(most_m, &per_m);
    fprintf(
        out,
        "<line class=\"mark\" x1=\"20\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\"/><text x=\"%.1f\" y=\"%.1f\">%g m</text>\n"
        "<defs><linearGradient id=\"ramp\">",
        top + 20.0, 20.0 + bar, top + 20.0, 28.0 + bar, top + 25.0, bar_m);
    for (int k = 0; k <= 6; k++) {
        uint8_t rgb[3];
        colour_ramp(k / 6.0, rgb);
        fprintf(out, "<stop offset=\"%.4f\" stop-color=\"#%02x%02x%02x\"/>", k / 6.0, rgb[0], rgb[1], rgb[2]);
    }
    fprintf(out,
            "</linearGradient></defs><rect x=\"%d\" y=\"%.1f\" width=\"%d\" height=\"14\" fill=\"url(#ramp)\"/>"
            "<text x=\"%d\" y=\"%.1f\" text-anchor=\"end\">0</text><text x=\"%d\" y=\"%.1f\">%g %s</text>\n",
            left, top + 13.0, right - left, left - 6, top + 25.0, right + 6, top + 25.0, most_m * per_m, unit);
}

int report_put_map(const struct report *r, FILE *out, struct sh_err *err)
{
    static const uint8_t white[3] = {255, 255, 255};
    struct view view;
    struct cloud_picture p;
    const double p999_m = r->f.stats.p999_m;
    struct cloud_picture_spec spec = {
        .n = r->cloud.n, .point = point, .ctx = &view, .most = p999_m > 0.0 ? figures_nice(p999_m) : 1e-3};
    int rc = set_view(r, &view, err);
    if (rc != SH_OK) return rc;
    include_stations(&view, &spec);
    rc = cloud_picture_make(&spec, &p, err);
    if (rc != SH_OK) return rc;
    const double scale = WIDTH / (p.max_m[0] - p.min_m[0]), height = scale * (p.max_m[1] - p.min_m[1]);
    fprintf(
        out,
        "<figure><svg class=\"map\" viewBox=\"0 0 %d %.0f\" style=\"max-height:45rem\" role=\"img\"><title>The cloud from "
        "above, coloured by distance from the scene</title>\n<image width=\"%d\" height=\"%.1f\" "
        "preserveAspectRatio=\"none\" style=\"image-rendering:pixelated\" href=\"",
        WIDTH, height + 40.0, WIDTH, height);
    rc = picture_put_uri(out, &p.image, white, err);
    picture_free(&p.image);
    fputs("\"/>\n", out);
    const uint32_t nameless = put_stations(out, &view, &p, scale);
    put_legend(out, height, 1.0 / scale, spec.most);
    fprintf(out,
            "</svg><figcaption>The cloud from above%s. A pixel's colour is the mean distance of its points from the "
            "scene; black: nothing within %g m. Red triangles are the stations.",
            view.turned ? ", north up" : ", the scene's y axis up", r->max_m);
    if (nameless > 0)
        fprintf(out, " There is no room for the names of %" PRIu32 " of them; the pointer on a triangle shows it.",
                nameless);
    fputs("</figcaption></figure>\n", out);
    return rc;
}
