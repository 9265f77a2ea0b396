/* SPDX-License-Identifier: MIT */
/* Tables of the report's page. */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "core/studio/picture.h"
#include "firmware_sim/app/studio/report/page.h"
#include "firmware_sim/app/studio/report/report.h"
#include "firmware_sim/config/places.h"

enum { MOST_LABELS = 200 };

void report_name_ranges(const struct report *r, char (*name)[32])
{
    for (uint32_t k = 0; k < r->f.n_ranges; k++)
        snprintf(name[k], sizeof name[k], "%g\xe2\x80\x93%g", k * r->f.range_step_m, (k + 1) * r->f.range_step_m);
}

void report_name_incidences(char (*name)[32])
{
    for (int k = 0; k < REPORT_INCIDENCES; k++)
        snprintf(name[k], sizeof name[k], "%d\xe2\x80\x93%d\xc2\xb0", 10 * k, 10 * k + 10);
}

static void begin_table(FILE *out, const char *caption, const char *first, int density)
{
    fprintf(
        out,
        "<div class=\"wide\"><table><caption>%s</caption>\n<thead><tr><th rowspan=\"2\">%s</th><th rowspan=\"2\">"
        "points</th><th colspan=\"4\">distance from the scene</th><th colspan=\"3\">along the beam, on smooth faces</th>"
        "<th colspan=\"3\">of these, judged</th>%s</tr>\n<tr><th>mean</th><th>RMS</th><th>95 %%</th><th>largest</th>"
        "<th>points</th><th>mean</th><th>RMS</th><th>points</th><th>RMS</th><th>expected</th>%s</tr></thead>\n<tbody>\n",
        caption, first, density ? "<th colspan=\"3\">points/m\xc2\xb2</th>" : "",
        density ? "<th>5 %</th><th>median</th><th>95 %</th>" : "");
}

static void put_density_cells(FILE *out, const struct figures_density_row *d)
{
    const double v[] = {d->p5, d->p50, d->p95};
    for (int k = 0; k < 3; k++) {
        fputs("<td>", out);
        page_number(out, v[k]);
        fputs("</td>", out);
    }
}

/* Writes nothing where there are no points. d: NULL in a table without density. */
static void put_row(FILE *out, const char *name, const struct figures *f, const struct figures_density_row *d)
{
    if (f->points == 0) return;
    const double length[] = {f->mean_m, f->rms_m, f->p95_m, f->max_m};
    fputs("<tr><td>", out);
    picture_put_escaped(out, name);
    fputs("</td><td>", out);
    page_count(out, f->points);
    for (int k = 0; k < 4; k++) {
        fputs("</td><td>", out);
        page_length(out, length[k], 0);
    }
    fputs("</td><td>", out);
    page_count(out, f->along);
    fputs("</td><td>", out);
    page_length(out, f->along_mean_m, 1);
    fputs("</td><td>", out);
    page_length(out, f->along_rms_m, 0);
    fputs("</td><td>", out);
    page_count(out, f->judged);
    fputs("</td><td>", out);
    page_length(out, f->judged_rms_m, 0);
    fputs("</td><td>", out);
    page_length(out, f->expected_rms_m, 0);
    fputs("</td>", out);
    if (d != NULL) put_density_cells(out, d);
    fputs("</tr>\n", out);
}

static void end_table(FILE *out)
{
    fputs("</tbody></table></div>\n", out);
}

void report_put_stations(FILE *out, const struct report *r)
{
    char name[CONFIG_STATION_NAME_LEN + 16];
    fputs("<h2>Stations</h2>\n", out);
    begin_table(out, "Each station by itself.", "station", 1);
    for (uint32_t s = 0; s < r->site->n_stations; s++) {
        snprintf(name, sizeof name, "%" PRIu32 " %s", s + 1, r->site->station[s].station->name);
        put_row(out, name, &r->f.station[s].figures, &r->f.station[s].density);
    }
    end_table(out);
    for (uint32_t s = 0; s < r->site->n_stations; s++) {
        const char *verdict = r->f.station[s].verdict.text;
        if (r->f.station[s].figures.points == 0 || strcmp(verdict, r->f.verdict.text) == 0) continue;
        fprintf(out, "<p>Station %" PRIu32 ", ", s + 1);
        picture_put_escaped(out, r->site->station[s].station->name);
        fputs(". ", out);
        picture_put_escaped(out, verdict);
        fputs("</p>\n", out);
    }
}

void report_put_bins(FILE *out, const struct report *r)
{
    char ranges[REPORT_MAX_RANGES][32], incidences[REPORT_INCIDENCES][32];
    report_name_ranges(r, ranges);
    report_name_incidences(incidences);
    if (r->f.n_ranges == 0) return;
    fputs("<h2>By range and by incidence</h2>\n", out);
    begin_table(
        out,
        "By the distance from the station, m, up to the farthest point that is near the scene. Density is that of one "
        "station's points.",
        "range, m", 1);
    for (uint32_t k = 0; k < r->f.n_ranges; k++)
        put_row(out, ranges[k], &r->f.range[k], &r->f.density_range[k]);
    end_table(out);
    if (r->site->moving) return;
    begin_table(out, "By the angle between the beam and the surface's normal.", "incidence", 0);
    for (int k = 0; k < REPORT_INCIDENCES; k++)
        put_row(out, incidences[k], &r->f.incidence[k], NULL);
    end_table(out);
}

void report_put_surfaces(FILE *out, const struct report *r)
{
    const uint32_t n = r->f.n_with_points;
    fputs("<h2>Surfaces</h2>\n", out);
    begin_table(out, "By surface: object | material; most points first.", "surface", 0);
    for (uint32_t k = 0; k < n && k < MOST_LABELS; k++) {
        char name[REPORT_SURFACE_LEN] = "surface not known";
        const uint32_t i = r->f.by_points[k];
        if (i < r->site->n_surfaces) report_name_surface(site_surface(r->site, i), name);
        put_row(out, name, &r->f.label[i], NULL);
    }
    end_table(out);
    if (n > MOST_LABELS)
        fprintf(out, "<p class=\"soft\">%u more surfaces have points; <code>--json</code> has all of them.</p>\n",
                n - MOST_LABELS);
}

static void put_echoes(FILE *out, const struct report *r)
{
    if (!r->f.has_echoes) return;
    fputs("<p>Echoes per shot: ", out);
    const char *apart = "";
    for (int k = 0; k <= FIGURES_MAX_ECHOES; k++) {
        if (r->f.shots[k] == 0) continue;
        fputs(apart, out);
        page_count(out, r->f.shots[k]);
        fprintf(out, " shots have %d%s", k, k == FIGURES_MAX_ECHOES ? " or more" : "");
        apart = ", ";
    }
    fputs(".</p>\n", out);
}

void report_put_times(FILE *out, const struct report *r)
{
    fputs("<h2>Time and echoes</h2>\n", out);
    if (r->f.times == NULL) {
        fputs("<p>The file has no times.</p>\n", out);
    } else {
        fputs(
            "<div class=\"wide\"><table><caption>Times are those of the points. A pause is longer than two lines of the "
            "station's scan.</caption>\n<thead><tr><th>station</th><th>points</th><th>scans</th>"
            "<th>time span, s</th><th>points/s</th><th>pauses</th><th>longest, s</th><th>it begins at, s</th></tr>"
            "</thead>\n<tbody>\n",
            out);
        for (uint32_t s = 0; s < r->site->n_stations; s++) {
            const struct figures_times *t = &r->f.times[s];
            if (t->points == 0) continue;
            fprintf(out, "<tr><td>%" PRIu32 " ", s + 1);
            picture_put_escaped(out, r->site->station[s].station->name);
            fprintf(out, "</td><td>%zu</td><td>%zu</td><td>%.6g</td><td>", t->points, t->scans, t->span_s);
            page_number(out, t->span_s > 0.0 ? (double)t->points / t->span_s : (double)NAN);
            fprintf(out, "</td><td>%zu</td><td>%.3g</td><td>%.6f</td></tr>\n", t->gaps, t->longest_s, t->longest_at_s);
        }
        end_table(out);
    }
    put_echoes(out, r);
}
