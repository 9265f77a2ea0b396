/* SPDX-License-Identifier: MIT */
/* Finds the deviations to be expected from a recording's configuration, and judges whether points stay within them. */
#include <math.h>
#include <stdio.h>

#include "firmware_sim/app/studio/report/report.h"
#include "firmware_sim/config/config.h"

/* In a LAS file that `record` wrote, points of the first scan's station have the same integer coordinates as the
 * stream. Points of other stations were rounded once more. */
static double file_count_m(const struct report *r, uint32_t station, int polar)
{
    const struct cloud *c = &r->cloud;
    const int is_first = c->n > 0 && cloud_station(c, 0) == station + 1;
    return !polar && c->has_own_counts && is_first ? 0.0 : c->count_m;
}

void report_heads(struct report *r)
{
    const int polar = r->cfg->output.layout == LINE_POLAR;
    for (uint32_t s = 0; s < r->site->n_stations; s++) {
        report_head_of(sites_of(&r->sites, s), s, &r->f.head[s]);
        r->f.head[s].file_count_m = file_count_m(r, s, polar);
    }
}

static void count_beyond(struct report *r)
{
    for (size_t i = 0; i < r->cloud.n; i++) {
        const uint32_t s = cloud_station(&r->cloud, i) - 1;
        report_count(&r->f.station[s].verdict, &r->f.head[s], r->distance_m[i], (double)r->points.along_m[i],
                     (double)r->points.range_m[i]);
    }
}

static void judge_all(struct report *r)
{
    struct report_verdict *all = &r->f.verdict;
    uint32_t n[3] = {0, 0, 0}, n_with_points = 0;
    const struct report_verdict *only = NULL;
    all->bound_m = 0.0;
    for (uint32_t s = 0; s < r->site->n_stations; s++) {
        const struct report_verdict *v = &r->f.station[s].verdict;
        if (r->f.station[s].figures.points == 0) continue;
        n[v->judgement]++;
        n_with_points++;
        only = v;
        all->judged += v->judged;
        all->beyond += v->beyond;
        all->bound_m = fmax(all->bound_m, v->bound_m);
    }
    all->judgement = n[REPORT_BEYOND] > 0 ? REPORT_BEYOND : n[REPORT_NONE] > 0 ? REPORT_NONE : REPORT_WITHIN;
    if (n_with_points == 1)
        *all = *only;
    else if (all->judgement == REPORT_WITHIN)
        snprintf(all->text, sizeof all->text, "Within the expected error, at all %u stations.", n_with_points);
    else
        snprintf(all->text, sizeof all->text,
                 "%s: of %u stations, %u are within the expected error, %u are not, %u can't be judged.",
                 all->judgement == REPORT_BEYOND ? "Not within the expected error" : "Not judged", n_with_points,
                 n[REPORT_WITHIN], n[REPORT_BEYOND], n[REPORT_NONE]);
}

void report_judge(struct report *r)
{
    if (!r->site->moving) count_beyond(r);
    for (uint32_t s = 0; s < r->site->n_stations; s++) {
        const struct report_subject subject = {&r->f.station[s].figures, &r->f.head[s], r->site->moving, "--max-m"};
        report_judge_one(&subject, &r->f.station[s].verdict);
    }
    judge_all(r);
}
