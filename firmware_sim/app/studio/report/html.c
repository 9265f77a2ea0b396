/* SPDX-License-Identifier: MIT */
/* The report as a page: its sections in their order. */
#include <ctype.h>
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "core/date.h"
#include "core/newfile.h"
#include "core/studio/picture.h"
#include "firmware_sim/app/studio/report/page.h"
#include "firmware_sim/app/studio/report/report.h"
#include "firmware_sim/config/config.h"

static void put_fact(FILE *out, const char *what, const char *text)
{
    fprintf(out, "<dt>%s</dt><dd>", what);
    picture_put_escaped(out, text);
    fputs("</dd>\n", out);
}

static const char *frame_name(const struct report *r)
{
    static const char *const names[] = {"the scene's own frame", "ECEF", "UTM or UPS", "latitude, longitude, height"};
    if (r->cfg->output.layout == LINE_POLAR) return "the scene's own frame";
    return names[r->cfg->output.crs];
}

/* Names the scanner. Where stations have different scanners, each change of the scanner is named, with its station. So
 * a scanner may be named twice. */
static void put_scanners(FILE *out, const struct report *r)
{
    char what[48] = "Scanner", text[256];
    for (uint32_t s = 0; s < r->site->n_stations; s++) {
        const struct config *cfg = sites_of(&r->sites, s)->cfg;
        if (s > 0 && cfg == sites_of(&r->sites, s - 1)->cfg) continue;
        if (r->sites.n > 0) snprintf(what, sizeof what, "Scanner, from station %" PRIu32 " on", s + 1);
        snprintf(text, sizeof text, "%s %s, range noise %s, angle noise %s, ball noise %s", cfg->profile.maker,
                 cfg->profile.model,
                 cfg->noise.range == RANGE_NOISE_OFF  ? "off"
                 : cfg->noise.range == RANGE_NOISE_ON ? "on"
                                                      : "by the signal",
                 cfg->noise.angle ? "on" : "off", cfg->noise.ball.radius_m > 0.0 ? "on" : "off");
        put_fact(out, what, text);
    }
}

static void put_top(FILE *out, const struct report *r)
{
    char text[CONFIG_PATH_LEN + 64];
    struct date_time at;
    fputs("<h1>Scan report: ", out);
    picture_put_escaped(out, basename(r->cloud_path));
    fputs("</h1>\n<dl class=\"facts\">\n", out);
    put_fact(out, "Recording", r->cloud_path);
    if (date_of_posix(r->modified.tv_sec, &at)) {
        snprintf(text, sizeof text, "%04d-%02d-%02d %02d:%02d:%02d UTC", at.year, at.month, at.day, at.hour, at.minute,
                 at.second);
        put_fact(out, "Written", text);
    }
    put_fact(out, "Configuration", r->cfg->file);
    for (uint32_t i = 0; i < r->cfg->scene.n_meshes; i++)
        put_fact(out, i == 0 ? "Scene" : "", r->cfg->scene.mesh[i].file);
    put_scanners(out, r);
    snprintf(text, sizeof text, "%s; EPSG %lld", frame_name(r), (long long)r->f.epsg);
    if (r->f.epsg <= 0) snprintf(text, sizeof text, "%s", frame_name(r));
    put_fact(out, "Coordinates", text);
    fputs("</dl>\n", out);
}

static void put_verdict(FILE *out, const struct report_verdict *v)
{
    static const char *const kind[] = {"open", "within", "beyond"};
    static const char *const sign[] = {"? Not judged", "\xe2\x9c\x93 Within the expected error",
                                       "\xe2\x9c\x97 Not within the expected error"};
    const char *text = strpbrk(v->text, ":.,"); /* the words before stand in the heading */
    if (text != NULL) text += 1 + strspn(text + 1, " ");
    fprintf(out, "<div class=\"verdict %s\"><b>%s</b>", kind[v->judgement], sign[v->judgement]);
    if (text == NULL) text = v->text;
    if (*text != 0) fputc(toupper((unsigned char)*text), out); /* ours begin with a letter of ASCII */
    picture_put_escaped(out, *text != 0 ? text + 1 : text);
    fputs("</div>\n", out);
}

static void begin_card(FILE *out, const char *what)
{
    fprintf(out, "<div><span>%s</span><b>", what);
}

static void put_length_card(FILE *out, const char *what, double m, int is_signed)
{
    begin_card(out, what);
    page_length(out, m, is_signed);
    fputs("</b></div>\n", out);
}

static void put_count_card(FILE *out, const char *what, uint64_t n, const char *more)
{
    begin_card(out, what);
    page_count(out, n);
    fprintf(out, "</b>%s</div>\n", more);
}

static void put_cards(FILE *out, const struct report *r)
{
    const struct report_figures *f = &r->f;
    char more[96];
    fputs("<div class=\"cards\">\n", out);
    put_count_card(out, "Points", f->stats.points, "");
    put_count_card(out, "Shots without echo in the file", f->stats.empty - f->ghosts, "");
    if (f->ghosts > 0) put_count_card(out, "Seen in mirrors, left out", f->ghosts, "");
    put_length_card(out, "Distance, mean", f->stats.mean_m, 0);
    put_length_card(out, "Distance, RMS", f->stats.rms_m, 0);
    put_length_card(out, "Distance, 95 % within", f->stats.p95_m, 0);
    put_length_card(out, "Distance, largest", f->stats.max_m, 0);
    snprintf(more, sizeof more, "<span>than %g m</span>", r->tolerance_m);
    put_count_card(out, "Farther", f->stats.beyond, more);
    put_length_card(out, "Along the beam, mean", f->all.along_mean_m, 1);
    put_length_card(out, "Along the beam, RMS", f->all.along_rms_m, 0);
    begin_card(out, "Density, median");
    page_number(out, f->density_all.p50);
    fputs("</b><span>points/m\xc2\xb2</span></div>\n", out);
    snprintf(more, sizeof more, "<span>of %u have points</span>", r->site->n_surfaces);
    put_count_card(out, "Surfaces", f->coverage.surfaces_hit, more);
    snprintf(more, sizeof more, "<span>of %u have points</span>", r->site->scene->n_triangles);
    put_count_card(out, "Triangles", f->coverage.triangles_hit, more);
    fputs("</div>\n", out);
}

/* Returns how many points are expected between two deviations: those of each station, spread by their RMS sigma. */
static double expected_within(const void *ctx, double from, double to)
{
    const struct report *r = ctx;
    double n = 0.0;
    for (uint32_t s = 0; s < r->site->n_stations; s++) {
        const struct figures *f = &r->f.station[s].figures;
        if (f->judged == 0 || !(f->expected_rms_m > 0.0)) continue;
        const double per = M_SQRT1_2 / f->expected_rms_m;
        n += (double)f->along * 0.5 * (erf(to * per) - erf(from * per));
    }
    return n;
}

static void put_beyond(FILE *out, const struct figures_histogram *h)
{
    if (h->below + h->above == 0) return;
    fputs(" Not shown, as they lie beyond the axis: ", out);
    page_count(out, h->below + h->above);
    fputs(" points.", out);
}

static void put_histograms(FILE *out, const struct report *r)
{
    const struct report_figures *f = &r->f;
    const int noisy = f->all.judged > 0 && !isfinite(f->verdict.bound_m);
    fputs("<div class=\"pair\">\n<figure>\n", out);
    page_histogram(out, "How many points lie how far from the scene", &f->distances, NULL, NULL);
    fputs("<figcaption>Points by their distance from the nearest surface.", out);
    put_beyond(out, &f->distances);
    fputs("</figcaption></figure>\n<figure>\n", out);
    page_histogram(out, "How many points lie how far before or after the surface along the beam", &f->along,
                   noisy ? expected_within : NULL, r);
    fputs("<figcaption>Points by their deviation along the beam; to the right of 0 they lie beyond the surface.", out);
    if (noisy) fputs(" The line shows the expected noise.", out);
    put_beyond(out, &f->along);
    fputs("</figcaption></figure>\n</div>\n", out);
}

/* A chart of bars: its texts, and the figures of each group. */
struct chart {
    const char *title, *axis, *caption;
    uint32_t n;
    const char (*group)[32];
    const struct figures *figures;
};

static void put_bars(FILE *out, const struct chart *chart)
{
    const struct figures *figures = chart->figures;
    double value_m[REPORT_MAX_RANGES][PAGE_SERIES];
    for (uint32_t k = 0; k < chart->n; k++) {
        value_m[k][0] = figures[k].rms_m;
        value_m[k][1] = figures[k].p95_m;
        value_m[k][2] = figures[k].judged_rms_m;
        value_m[k][3] = figures[k].expected_rms_m;
    }
    const struct page_bars bars = {.title = chart->title,
                                   .axis = chart->axis,
                                   .series = {"RMS distance", "95 % distance", "RMS along the beam", "expected"},
                                   .n_groups = chart->n,
                                   .group = chart->group,
                                   .value_m = (const double(*)[PAGE_SERIES])value_m};
    fputs("<figure>\n", out);
    page_bars(out, &bars);
    fprintf(out, "<figcaption>%s</figcaption></figure>\n", chart->caption);
}

static void put_charts(FILE *out, const struct report *r)
{
    char ranges[REPORT_MAX_RANGES][32], incidences[REPORT_INCIDENCES][32];
    report_name_ranges(r, ranges);
    report_name_incidences(incidences);
    if (r->f.n_ranges == 0) return;
    fputs("<div class=\"pair\">\n", out);
    put_bars(out, &(struct chart){.title = "Deviations by range",
                                  .axis = "distance from the station, m",
                                  .caption = "Deviations by the distance from the station.",
                                  .n = r->f.n_ranges,
                                  .group = (const char(*)[32])ranges,
                                  .figures = r->f.range});
    if (!r->site->moving)
        put_bars(out, &(struct chart){.title = "Deviations by incidence",
                                      .axis = "angle between the beam and the surface's normal",
                                      .caption = "Deviations by the angle at which the beam meets the surface; "
                                                 "0\xc2\xb0 is head on. Beyond 80\xc2\xb0 there are distances alone.",
                                      .n = REPORT_INCIDENCES,
                                      .group = (const char(*)[32])incidences,
                                      .figures = r->f.incidence});
    fputs("</div>\n", out);
}

static void put_worst(FILE *out, const struct report *r)
{
    const struct scene_surface *s = report_worst_surface(r);
    if (r->f.stats.far > 0)
        fprintf(out, "<p>The first point farther than %g m from everything is number %zu of the file, at", r->max_m,
                r->f.stats.worst + 1);
    else
        fprintf(out, "<p>The point farthest from the scene is number %zu of the file, at", r->f.stats.worst + 1);
    report_put_worst(out, r);
    if (s != NULL) {
        char name[REPORT_SURFACE_LEN];
        report_name_surface(s, name);
        fputs(", on ", out);
        picture_put_escaped(out, name);
    }
    fputs(".</p>\n", out);
}

static void put_words(FILE *out, const struct report *r)
{
    fputs(
        "<h2>What the words mean</h2>\n<dl class=\"words\">\n"
        "<dt>Distance</dt><dd>From the point to the nearest surface of the scene, whatever the direction. Never "
        "negative. There are its mean, its RMS (the root of the mean square), the distance that 95 % of the points do "
        "not exceed, and the largest one.</dd>\n"
        "<dt>Along the beam</dt><dd>The beam is followed from the station through the point to the scene. The "
        "deviation is the measured range minus the exact one. It is positive where the point lies beyond the "
        "surface.</dd>\n"
        "<dt>On smooth faces</dt><dd>Points whose nearest surface is the one that the beam meets, at an incidence up "
        "to 80\xc2\xb0. At an edge a small error across the beam is a large one along it, so there are distances "
        "alone.</dd>\n"
        "<dt>Judged</dt><dd>Points on smooth faces whose deviation is caused by noise alone: no other surface is "
        "nearer than about eight times their expected noise. Up to about 400,000 are taken, evenly.</dd>\n"
        "<dt>Expected</dt><dd>The RMS deviation along the beam that follows from the configured noise (of ranges, angles "
        "and places) and from rounding: of angles by the encoders, of coordinates on the wire. It is worked out for "
        "each judged point from its range and incidence.</dd>\n"
        "<dt>Bound</dt><dd>Noise with a normal distribution has no bound. Without such noise no point may be farther "
        "from the scene than the sum of these: the errors that the plan allows, half a count per axis of the numbers "
        "on the wire, half a count of the encoders, and the radius of the ball within which places are moved.</dd>\n",
        out);
    fprintf(
        out,
        "<dt>Density</dt><dd>Each surface is cut into squares with sides of %g m. A square's density is the number of "
        "one station's points in it, divided by its area. Half of the points lie where the density is the median or "
        "more. Squares at a border count as whole ones, so theirs is a lower limit.</dd>\n"
        "<dt>Surfaces, triangles</dt><dd>How many of those in the scene have at least one point.</dd>\n</dl>\n",
        r->f.density.cell_m);
}

static int put_page(const void *report, FILE *out, struct sh_err *err)
{
    const struct report *r = report;
    char title[300];
    snprintf(title, sizeof title, "Scan report: %.250s", basename(r->cloud_path));
    page_begin(out, title);
    put_top(out, r);
    put_verdict(out, &r->f.verdict);
    put_cards(out, r);
    put_worst(out, r);
    fputs("<h2>Pictures</h2>\n", out);
    const int rc = report_put_map(r, out, err);
    if (rc != SH_OK) return rc;
    put_histograms(out, r);
    put_charts(out, r);
    report_put_stations(out, r);
    report_put_bins(out, r);
    report_put_surfaces(out, r);
    report_put_times(out, r);
    put_words(out, r);
    page_end(out);
    return SH_OK;
}

int report_write_html(const struct report *r, struct sh_err *err)
{
    return newfile_write(r->html_path, put_page, r, err);
}
