/* SPDX-License-Identifier: MIT */
/* The report as text. Its first lines stay as they are, since scripts read them. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "firmware_sim/app/studio/report/report.h"
#include "firmware_sim/config/places.h"

enum { MOST_LABELS = 20 };

static void print_length(const char *what, double m)
{
    if (isnan(m))
        printf("%-10s -\n", what);
    else if (m < 0.1)
        printf("%-10s %.6f mm\n", what, m * 1e3);
    else
        printf("%-10s %.6f m\n", what, m);
}

void report_name_surface(const struct scene_surface *surface, char name[REPORT_SURFACE_LEN])
{
    const char *apart = surface->material[0] != 0 ? " | " : "";
    snprintf(name, REPORT_SURFACE_LEN, "%s%s%s", surface->object, apart, surface->material);
    sh_keep_line(name); /* a mesh may have any bytes */
}

void report_put_worst(FILE *out, const struct report *r)
{
    const double *p = r->f.worst;
    for (int k = 0; k < 3; k++)
        if (fabs(p[k]) < 1e12)
            fprintf(out, " %.*f", r->f.epsg == 4979 && k < 2 ? 11 : 6, p[k]); /* degrees, or metres */
        else
            fprintf(out, " %.10g", p[k]);
}

static void print_summary(const struct report *r)
{
    const struct cloud_stats *s = &r->f.stats;
    char name[REPORT_SURFACE_LEN];
    const struct scene_surface *surface = report_worst_surface(r);
    printf("%-10s %zu\n%-10s %zu shots without echo\n", "points", s->points, "empty", s->empty - r->f.ghosts);
    if (r->f.ghosts != 0) printf("%-10s %zu points seen in mirrors, left out\n", "ghosts", r->f.ghosts);
    print_length("mean", s->mean_m);
    print_length("RMS", s->rms_m);
    print_length("50 %", s->p50_m);
    print_length("95 %", s->p95_m);
    print_length("99.9 %", s->p999_m);
    print_length("max", s->max_m);
    printf("%-10s point %zu at", "worst", s->worst + 1);
    report_put_worst(stdout, r);
    if (surface != NULL) {
        report_name_surface(surface, name);
        printf(" on %s", name);
    }
    printf("\n%-10s %zu farther than %g m\n", "beyond", s->beyond, r->tolerance_m);
    printf("%-10s %zu farther than %g m from everything\n", "far", s->far, r->max_m);
    printf("%-10s %" PRIu32 " of %" PRIu32 " surfaces, %" PRIu32 " of %" PRIu32 " triangles\n", "coverage",
           r->f.coverage.surfaces_hit, r->site->n_surfaces, r->f.coverage.triangles_hit, r->site->scene->n_triangles);
}

/* Millimetres of a column; "-" where there is no figure. */
static void put_mm(double m, int is_signed)
{
    if (isnan(m))
        printf(" %10s", "-");
    else
        printf(is_signed ? " %+10.4f" : " %10.4f", 1e3 * m);
}

static void print_head(const char *what)
{
    printf("\n%-34s %10s %10s %10s %10s %10s | %10s %10s %10s %10s\n", what, "points", "mean", "RMS", "95 %", "max",
           "judged", "mean", "RMS", "expected");
}

/* A name of n characters at the most, filled up with spaces. */
static void put_name(const char *name, size_t n)
{
    size_t len = 0, characters = 0;
    for (; name[len] != 0; len++) {
        if (((unsigned char)name[len] & 0xc0) == 0x80) continue;
        if (characters == n) break;
        characters++;
    }
    printf("%.*s%*s", (int)len, name, (int)(n - characters), "");
}

/* Prints a row without its newline. */
static void print_row(const char *name, const struct figures *f)
{
    put_name(name, 34);
    printf(" %10zu", f->points);
    put_mm(f->mean_m, 0);
    put_mm(f->rms_m, 0);
    put_mm(f->p95_m, 0);
    put_mm(f->max_m, 0);
    printf(" | %10zu", f->judged);
    put_mm(f->judged_mean_m, 1);
    put_mm(f->judged_rms_m, 0);
    put_mm(f->expected_rms_m, 0);
}

static void print_line(const char *name, const struct figures *f)
{
    print_row(name, f);
    putchar('\n');
}

/* The surfaces with the most points first, up to MOST_LABELS. */
static void print_labels(const struct report *r)
{
    const uint32_t n = r->f.n_with_points;
    print_head("by surface");
    for (uint32_t k = 0; k < n && k < MOST_LABELS; k++) {
        const uint32_t i = r->f.by_points[k];
        char number[32] = "not known", name[REPORT_SURFACE_LEN];
        if (i < r->site->n_surfaces) snprintf(number, sizeof number, "label %" PRIu32, i);
        print_row(number, &r->f.label[i]);
        if (i < r->site->n_surfaces) {
            report_name_surface(site_surface(r->site, i), name);
            printf("  %s", name);
        }
        putchar('\n');
    }
    if (n > MOST_LABELS) printf("not shown: %u more with points; --json has all of them\n", n - MOST_LABELS);
}

static void print_tables(const struct report *r)
{
    char name[CONFIG_STATION_NAME_LEN + 16];
    print_head("by station");
    for (uint32_t s = 0; s < r->site->n_stations; s++) {
        snprintf(name, sizeof name, "%" PRIu32 " %s", s + 1, r->site->station[s].station->name);
        if (r->f.station[s].figures.points > 0) print_line(name, &r->f.station[s].figures);
    }
    if (r->f.n_ranges > 0) print_head("by range, m");
    for (uint32_t k = 0; k < r->f.n_ranges; k++) {
        snprintf(name, sizeof name, "%g to %g", k * r->f.range_step_m, (k + 1) * r->f.range_step_m);
        if (r->f.range[k].points > 0) print_line(name, &r->f.range[k]);
    }
    if (!r->site->moving) print_head("by incidence, degrees");
    for (int k = 0; k < REPORT_INCIDENCES && !r->site->moving; k++) {
        snprintf(name, sizeof name, "%d to %d", 10 * k, 10 * k + 10);
        if (r->f.incidence[k].points > 0) print_line(name, &r->f.incidence[k]);
    }
    print_labels(r);
    puts(
        "\nAll in mm. Left: distance from the nearest triangle. Right: deviation along the beam, measured minus exact\n"
        "range, of points on smooth faces where nothing else is near.\n"
        "Expected: the RMS of the deviation that noise and rounding to counts cause.");
}

static void print_time(const struct report *r)
{
    for (uint32_t s = 0; s < r->site->n_stations && r->f.times != NULL; s++) {
        const struct figures_times *t = &r->f.times[s];
        if (t->points == 0) continue;
        char rate[32] = "-";
        if (t->span_s > 0.0) snprintf(rate, sizeof rate, "%.6g", (double)t->points / t->span_s);
        printf("%-10s station %" PRIu32 ": %.6g s, %s points/s; %zu pauses over %.3g s, the longest %.3g s at %.6f s\n",
               "time", s + 1, t->span_s, rate, t->gaps, r->f.gap_s[s], t->longest_s, t->longest_at_s);
    }
    if (!r->f.has_echoes) return;
    printf("%-10s", "echoes");
    for (int k = 0; k <= FIGURES_MAX_ECHOES; k++)
        if (r->f.shots[k] > 0)
            printf(" %" PRIu64 " shots with %d%s", r->f.shots[k], k, k == FIGURES_MAX_ECHOES ? " or more" : "");
    putchar('\n');
}

void report_print_text(const struct report *r)
{
    const struct report_figures *f = &r->f;
    print_summary(r);
    if (f->density_all.cells > 0)
        printf(
            "%-10s half of the points lie where a station has %.4g points/m2 or more, 95 %% where %.4g (cells of %g m)\n",
            "density", f->density_all.p50, f->density_all.p5, f->density.cell_m);
    print_time(r);
    print_tables(r);
    printf("\n%s\n", f->verdict.text);
    for (uint32_t s = 0; s < r->site->n_stations; s++)
        if (f->station[s].figures.points > 0 && strcmp(f->station[s].verdict.text, f->verdict.text) != 0)
            printf("station %" PRIu32 " %s: %s\n", s + 1, r->site->station[s].station->name,
                   f->station[s].verdict.text);
}
