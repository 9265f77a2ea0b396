/* SPDX-License-Identifier: MIT */
/* Where to stand next: places, the area that each would see and no station has seen, and scans of the best. */
#include "firmware_sim/app/studio/coverage/next.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/angle.h"
#include "core/mat3.h"
#include "firmware_sim/app/options.h"
#include "firmware_sim/config/profile.h"

static const double LEAST_FRONT = 0.5;

struct chooser {
    struct coverage_finder *f;
    struct coverage *coverage;
    struct coverage_gain *gain; /* [places] */
    double (*open_m)[3];        /* positions of the places that are open; then their numbers */
    uint32_t *open, n_open;
};

/* ---- rounds */

/* Estimates the gains of all places with one heading, which share their directions. */
static int estimate(struct chooser *c, double heading_deg, double (*turned)[3], struct sh_err *err)
{
    const struct config_profile *profile = site_profile(c->f->site);
    double rotation[9];
    c->n_open = 0;
    for (uint32_t i = 0; i < c->f->next->n; i++) {
        const struct coverage_next_place *p = &c->f->next->place[i];
        if (p->state || p->heading_deg != heading_deg) continue;
        memcpy(c->open_m[c->n_open], p->position_m, sizeof *c->open_m);
        c->open[c->n_open++] = i;
    }
    pose_heading(angle_rad(heading_deg), rotation);
    for (uint32_t i = 0; i < c->f->n_dir; i++)
        mat3_apply(rotation, c->f->dir[i], turned[i]);
    const struct coverage_directions directions = {c->f->n_dir, (const double(*)[3])turned, c->f->each_sr,
                                                   profile->range_min_m, profile->range_max_m};
    const struct coverage_places places = {c->n_open, (const double(*)[3])c->open_m, NULL};
    return coverage_gains(c->coverage, &directions, &places, c->f->report, c->gain, err);
}

static int estimate_all(struct chooser *c, double *estimate_m2, struct sh_err *err)
{
    struct coverage_next *next = c->f->next;
    double(*turned)[3] = malloc(c->f->n_dir * sizeof *turned);
    char *done = calloc(next->n, 1);
    int rc = turned != NULL && done != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for directions");
    for (uint32_t i = 0; i < next->n; i++)
        estimate_m2[i] = 0.0;
    for (uint32_t i = 0; i < next->n && rc == SH_OK; i++) {
        if (done[i] || next->place[i].state) continue;
        rc = estimate(c, next->place[i].heading_deg, turned, err);
        for (uint32_t k = 0; k < c->n_open && rc == SH_OK; k++) {
            estimate_m2[c->open[k]] = c->gain[k].gain_m2;
            next->place[c->open[k]].front = c->gain[k].front;
            done[c->open[k]] = 1;
        }
    }
    free(turned);
    free(done);
    return rc;
}

/* Where the stations see fronts, a place that sees backs lies within a closed body. Places of --candidates are never
 * left out. */
static void leave_out_bodies(struct chooser *c, double *estimate_m2)
{
    uint64_t hits = 0, front = 0;
    for (uint32_t i = 0; i < c->f->site->n_stations; i++) {
        hits += c->f->result->station[i].pulses.hits;
        front += c->f->result->station[i].pulses.front;
    }
    if (c->f->o->candidates != NULL || (double)front < LEAST_FRONT * (double)hits) return;
    for (uint32_t i = 0; i < c->f->next->n; i++) {
        struct coverage_next_place *p = &c->f->next->place[i];
        if (p->state || !(p->front < LEAST_FRONT)) continue;
        p->state = COVERAGE_PLACE_WITHIN;
        c->f->next->within++;
        estimate_m2[i] = 0.0;
    }
}

/* Returns the open place with the largest estimate among those not tried yet; n: there is none. */
static uint32_t best_of(const struct coverage_next *next, const double *estimate_m2,
                        const struct coverage_next_round *round)
{
    uint32_t best = next->n;
    for (uint32_t i = 0; i < next->n; i++) {
        int tried = next->place[i].state != 0 || !(estimate_m2[i] > 0.0);
        for (uint32_t k = 0; k < round->n_tried; k++)
            tried |= round->tried[k].place == i;
        if (!tried && (best == next->n || estimate_m2[i] > estimate_m2[best])) best = i;
    }
    return best;
}

/* Casts a whole scan from a place. The result waits for coverage_keep, or is replaced by the next scan. */
static int scan(struct chooser *c, uint32_t place, const char *what, struct sh_err *err)
{
    const struct coverage_next_place *p = &c->f->next->place[place];
    struct coverage_scan_at *at = malloc(sizeof *at);
    struct coverage_pulses pulses;
    struct cast_tripod tripod;
    if (at == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a scan");
    coverage_scan_of(c->f->site, c->f->result->base, at);
    at->scan.setup.bvh = c->f->site->bvh;
    at->scan.setup.sight = NULL;
    if (at->scan.setup.tripod != NULL) { /* the cone moves with the head; the legs stay at a station */
        tripod = *at->scan.setup.tripod;
        tripod.has_legs = 0;
        at->scan.setup.tripod = &tripod;
    }
    memcpy(at->scan.setup.station_m, p->position_m, sizeof at->scan.setup.station_m);
    pose_heading(angle_rad(p->heading_deg), at->scan.setup.rotation);
    int rc = coverage_look(c->coverage, &at->scan, what, c->f->report, &pulses, err);
    free(at);
    return rc;
}

/* Keeps the tried places in order of gain; of equal ones the first one tried comes first. */
static void insert(struct coverage_next_round *round, const struct coverage_next_tried *tried)
{
    uint32_t at = round->n_tried++;
    for (; at > 0 && tried->gain_m2 > round->tried[at - 1].gain_m2; at--)
        round->tried[at] = round->tried[at - 1];
    round->tried[at] = *tried;
}

static double none_m2(struct coverage *coverage)
{
    double sum_m2 = 0.0;
    for (uint32_t i = 0; i < coverage_cells(coverage); i++) {
        struct coverage_cell cell;
        coverage_get(coverage, i, &cell);
        if (cell.stations == 0) sum_m2 += cell.area_m2;
    }
    return sum_m2;
}

/* 1: a place was chosen; 0: there is nothing to gain; or a negative error. */
static int choose(struct chooser *c, uint32_t number, struct sh_err *err)
{
    struct coverage_next *next = c->f->next;
    double *estimate_m2 = next->estimate_m2 + (size_t)number * next->n;
    struct coverage_next_round *round = &next->round[number];
    struct coverage_next_tried tried = {.place = next->n};
    char what[64];
    int rc = estimate_all(c, estimate_m2, err);
    if (rc == SH_OK && number == 0) leave_out_bodies(c, estimate_m2);
    while (rc == SH_OK && round->n_tried < (uint32_t)c->f->o->scans) {
        const uint32_t best = best_of(next, estimate_m2, round);
        if (best == next->n) break;
        snprintf(what, sizeof what, "next station %u, scan %u of %ld", number + 1, round->n_tried + 1, c->f->o->scans);
        rc = scan(c, best, what, err);
        if (rc != SH_OK) break;
        tried.place = best;
        coverage_waiting(c->coverage, &tried.seen_m2, &tried.gain_m2);
        insert(round, &tried);
    }
    const uint32_t chosen = round->tried[0].place;
    if (rc != SH_OK || round->n_tried == 0 || !(round->tried[0].gain_m2 > 0.0)) return rc;
    if (chosen != tried.place) rc = scan(c, chosen, "next station, once more", err);
    if (rc != SH_OK) return rc;
    coverage_keep(c->coverage);
    next->place[chosen].state = COVERAGE_PLACE_CHOSEN;
    round->none_m2 = none_m2(c->coverage);
    return 1;
}

static int choose_all(struct chooser *c, struct sh_err *err)
{
    struct coverage_next *next = c->f->next;
    const size_t rounds = (size_t)c->f->o->stations;
    c->gain = malloc(next->n * sizeof *c->gain);
    c->open_m = malloc(next->n * sizeof *c->open_m);
    c->open = malloc(next->n * sizeof *c->open);
    next->estimate_m2 = calloc(rounds * next->n, sizeof *next->estimate_m2);
    next->round = calloc(rounds, sizeof *next->round);
    if (c->gain == NULL || c->open_m == NULL || c->open == NULL || next->estimate_m2 == NULL || next->round == NULL)
        return sh_fail(err, SH_ENOMEM, "no memory for %u places", next->n);
    next->n_asked = (uint32_t)rounds;
    for (uint32_t i = 0; i < rounds; i++) {
        int chosen = choose(c, i, err);
        if (chosen < 0) return chosen;
        if (chosen == 0) break;
        next->n_rounds++;
    }
    return SH_OK;
}

int coverage_next_find(struct coverage_finder *finder, struct coverage *coverage, struct sh_err *err)
{
    struct chooser c = {.f = finder, .coverage = coverage};
    int rc = choose_all(&c, err);
    free(c.gain);
    free(c.open_m);
    free(c.open);
    return rc;
}

void coverage_next_free(struct coverage_next *next, struct coverage_finder *finder)
{
    free(finder->dir);
    free(finder->each_sr);
    free(next->place);
    free(next->estimate_m2);
    free(next->round);
}

int coverage_next_area(const char *text, double area_m[2][3])
{
    double v[6] = {[4] = (double)NAN, [5] = (double)NAN};
    if (!app_read_numbers(text, ',', v, 4) && !app_read_numbers(text, ',', v, 6)) return 0;
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 2; k++)
            area_m[i][k] = v[2 * i + k];
    area_m[0][2] = v[4];
    area_m[1][2] = v[5];
    return area_m[0][0] < area_m[1][0] && area_m[0][1] < area_m[1][1] && !(area_m[0][2] > area_m[1][2]);
}
