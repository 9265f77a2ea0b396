/* SPDX-License-Identifier: MIT */
/* Decides whether to make a map of what the station sees: it must save more time than it costs. */
#include <math.h>
#include <stdio.h>

#include "core/plan.h"
#include "core/plan/cost.h"

/* This share of a map's saving must be left after its cost. Costs here are rounded, and a wrong choice must not
 * make a scan slower. */
static const double LEAST_LEFT = 0.2;

enum { NO_MAP, MAP, OPTIONS };

static const struct plan_ray_cost *ray_cost(uint32_t packet)
{
    const struct plan_ray_cost *cost = plan_ray_costs;
    const struct plan_ray_cost *last = cost + sizeof plan_ray_costs / sizeof plan_ray_costs[0] - 1;
    while (cost < last && cost->packet > packet)
        cost++;
    return cost;
}

/* Returns the cost of reading a triangle's plane. A pulse that hits something needs it with a map and without one. */
static double plane_ns(double n_triangles)
{
    return PLAN_COST_MILLION * fmin(1.0, sqrt(1e-6 * n_triangles));
}

double plan_pulse_ns(double n_triangles, uint32_t packet)
{
    return PLAN_COST_PULSE + ray_cost(packet)->hit + plane_ns(n_triangles);
}

/* Returns the number of cells of a map. The cells divide the six faces of a cube around the station (core/sight.h).
 * sight_cells chooses how many lie along an edge, for the pulses that all directions would have at this density. */
static double cells(const struct plan_sight_need *need)
{
    const double edge = sight_cells(need->pulses / need->share, need->memory_bytes);
    return 6.0 * edge * edge;
}

/* Returns the least cost of making a map, whatever it shows. */
static double least_build_ns(const struct plan_sight_need *need)
{
    return PLAN_COST_SIGHT + PLAN_COST_SIGHT_TRIANGLE * need->n_triangles;
}

/* Returns the map's cost without that of its cells. */
static double triangles_build_ns(const struct plan_sight_need *need, const struct plan_sight_found *f)
{
    return least_build_ns(need) + PLAN_COST_SIGHT_EXAMINED * f->examined;
}

/* Costs of a scan, ns: per pulse, except build. */
struct costs {
    double bvh, map, build;
};

/* Returns the share of the cells with more than one triangle that the memory holds. */
static double fitting(const struct plan_sight_need *need, const struct plan_sight_found *f, double mixed)
{
    const double bytes = PLAN_SIGHT_CELL_BYTES * (mixed + 1.0) +
                         PLAN_SIGHT_RECORD_BYTES * fmin(need->n_triangles, 4.0 * f->per_pulse * need->pulses);
    return fmin(1.0, (double)need->memory_bytes / bytes);
}

/* If the memory does not hold the cells, the map is made again with cells of twice the width (core/sight/sight.c). An
 * outline crosses half as many of these, but there are only a quarter as many in all. So the share of crossed cells is
 * twice as large. */
static void coarsen(const struct plan_sight_found *f, struct plan_sight_found *coarse)
{
    const double mixed = f->few + f->ask, all = f->one + f->nothing, wider = fmin(mixed + all, 2.0 * mixed);
    *coarse = *f;
    if (!(mixed > 0.0) || !(all > 0.0)) return;
    coarse->few *= wider / mixed;
    coarse->ask *= wider / mixed;
    coarse->one *= (mixed + all - wider) / all;
    coarse->nothing *= (mixed + all - wider) / all;
}

static void estimate(const struct plan_sight_need *need, const struct plan_sight_found *found, struct costs *c)
{
    const struct plan_ray_cost *cost = ray_cost(need->packet);
    const struct plan_sight_found *f = found;
    struct plan_sight_found coarse;
    double mixed = (f->few + f->ask) * need->share * cells(need), fits = fitting(need, f, mixed);
    c->build = triangles_build_ns(need, f) + PLAN_COST_SIGHT_CELL * fits * mixed;
    if (fits < 1.0) {
        coarsen(f, &coarse);
        f = &coarse;
        mixed = (f->few + f->ask) * need->share * cells(need) / 4.0;
        fits = fitting(need, f, mixed);
        c->build += triangles_build_ns(need, f) + PLAN_COST_SIGHT_CELL * fits * mixed;
    }
    const double few = fits * f->few, ask = f->ask + f->few - few;
    c->bvh = found->nothing * cost->miss + (1.0 - found->nothing) * (cost->hit + plane_ns(need->n_triangles)) +
             (found->few + found->ask + found->small) * cost->border;
    c->map = (f->one + f->nothing) * PLAN_COST_SIGHT_ONE + f->one * plane_ns(need->n_triangles) +
             few * PLAN_COST_SIGHT_FEW + ask * (c->bvh + PLAN_COST_SIGHT_ASK) +
             f->small * (cost->hit + plane_ns(need->n_triangles) + cost->border + PLAN_COST_SIGHT_SMALL);
}

static int pays(const struct plan_sight_need *need, const struct costs *c)
{
    return (1.0 - LEAST_LEFT) * (c->bvh - c->map) * need->pulses > c->build;
}

int plan_sight_may_pay(const struct plan_sight_need *need)
{
    const double saved_ns = ray_cost(need->packet)->hit + ray_cost(need->packet)->border - PLAN_COST_SIGHT_ONE;
    return (1.0 - LEAST_LEFT) * saved_ns * need->pulses > least_build_ns(need);
}

static void say_why(const struct plan_sight_need *need, const struct plan_sight_found *found, const struct costs *c,
                    int it_pays, struct plan_row *row)
{
    size_t used = 0;
    if (row->forced) used = (size_t)snprintf(row->why, sizeof row->why, "forced by cast.sight; ");
    char *why = row->why + used;
    const size_t room = sizeof row->why - used;
    const double pulses_m = 1e-6 * need->pulses, plain = found != NULL ? 100.0 * (found->one + found->nothing) : 0.0;
    if (need->why_not != NULL)
        snprintf(why, room, "%s", need->why_not);
    else if (found == NULL)
        snprintf(why, room, "%.4g million pulses of a scan are too few: a map would cost more than it saves", pulses_m);
    else if (!it_pays && c->map >= c->bvh)
        snprintf(why, room, "a map saves nothing: only %.3g %% of the pulses go to a cell of one surface or none",
                 plain);
    else
        snprintf(why, room,
                 "%.4g million pulses of a scan %s for a map, which saves %.2g ns each and takes %.2g s to make; "
                 "%.3g %% go to a cell of one surface or none",
                 pulses_m, it_pays ? "pay" : "do not pay", c->bvh - c->map, 1e-9 * c->build, plain);
}

int plan_sight_choose(const struct plan_sight_need *need, const struct plan_sight_found *found, struct plan_row *row)
{
    static const struct plan_tolerance any = {INFINITY, 1.0};
    static const struct plan_sight_found best = {.one = 1.0};
    struct plan_option option[OPTIONS] = {[NO_MAP] = {.method = "none"}, [MAP] = {.method = "map"}};
    struct costs c;
    estimate(need, found != NULL ? found : &best, &c);
    const int can = need->why_not == NULL, it_pays = can && found != NULL && pays(need, &c);
    if (can)
        option[MAP].cost_ns = c.map - c.bvh + c.build / fmax(1.0, need->pulses);
    else
        snprintf(option[MAP].why_not, sizeof option[MAP].why_not, "%s", need->why_not);
    if (!can) option[MAP].cost_ns = (double)NAN;
    if (!it_pays && option[MAP].cost_ns < 0.0) option[MAP].cost_ns = 0.0; /* below LEAST_LEFT: not a sure saving */
    const struct plan_choice ask = {"sight", option, OPTIONS, need->forced, "cast.sight", any};
    const int map = plan_choose(&ask, row) == MAP;
    say_why(need, found, &c, it_pays, row);
    return map;
}

int plan_sight(const struct plan_sight_need *need, const struct plan_places *places, const struct sh_report *report,
               int *map, struct plan_row *row, struct sh_err *err)
{
    const int samples = need->why_not == NULL && need->forced != 0 && plan_sight_may_pay(need);
    struct plan_sight_found found;
    if (samples) {
        struct plan_sample *sample;
        int rc = plan_sample_create(places, report, &sample, err);
        if (rc != SH_OK) return rc;
        plan_sample_sight(sample, sqrt(4.0 * M_PI / cells(need)), need->pulses / need->share, &found);
        plan_sample_free(sample);
        rc = sh_check_stop(report, err);
        if (rc != SH_OK) return rc;
    }
    *map = plan_sight_choose(need, samples ? &found : NULL, row);
    return SH_OK;
}
