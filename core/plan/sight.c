/* Whether a map of what the station sees pays. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/plan.h"
#include "core/plan/cost.h"

/* Of what a map saves, so much must be left when it is paid for: costs here are rounded, and a wrong choice shall
 * not make a scan slower. */
static const double LEAST_LEFT = 0.3;

enum { NO_MAP, MAP, OPTIONS };

/* ns per pulse; without a map, and looked up in one. */
static double bvh_ns(const struct plan_sight_found *f)
{
    return f->nothing * PLAN_COST_RAY_OUT + (1.0 - f->nothing) * PLAN_COST_RAY + (f->few + f->ask) * PLAN_COST_BORDER;
}

static double map_ns(const struct plan_sight_found *f)
{
    return (f->one + f->nothing) * PLAN_COST_SIGHT_ONE + f->few * PLAN_COST_SIGHT_FEW + f->ask * PLAN_COST_SIGHT_ASK;
}

/* Without a map, where surfaces are to be ordered exactly, the BVH has to be prepared for that, too. */
static double ordering_ns(const struct plan_sight_need *need)
{
    return need->saves_order ? PLAN_COST_ORDER * need->n_triangles + PLAN_COST_ORDERED * need->pulses : 0.0;
}

/* A map costs at least that, whatever it shows. */
static double least_build_ns(const struct plan_sight_need *need)
{
    return PLAN_COST_SIGHT + PLAN_COST_SIGHT_TRIANGLE * need->n_triangles;
}

static double build_ns(const struct plan_sight_need *need, const struct plan_sight_found *f)
{
    const double mixed = (f->few + f->ask) * need->cells;
    return least_build_ns(need) + PLAN_COST_SIGHT_CELL * mixed;
}

int plan_sight_may_pay(const struct plan_sight_need *need)
{
    const double saved_ns = (1.0 - LEAST_LEFT) * (PLAN_COST_RAY - PLAN_COST_SIGHT_ONE) * need->pulses;
    return saved_ns + ordering_ns(need) > least_build_ns(need);
}

/* found NULL: too few pulses to look. */
static void fill_options(const struct plan_sight_need *need, const struct plan_sight_found *found,
                         struct plan_option option[OPTIONS])
{
    const struct plan_sight_found best = {.one = 1.0}, *f = found != NULL ? found : &best;
    option[NO_MAP] = (struct plan_option){.method = "none"};
    option[MAP] = (struct plan_option){.method = "map"};
    snprintf(option[MAP].why_not, sizeof option[MAP].why_not, "%s", need->why_not != NULL ? need->why_not : "");
    if (need->why_not != NULL)
        option[MAP].cost_ns = (double)NAN;
    else
        option[MAP].cost_ns = map_ns(f) - bvh_ns(f) + (build_ns(need, f) - ordering_ns(need)) / fmax(1.0, need->pulses);
}

static void say_why(const struct plan_sight_need *need, const struct plan_sight_found *f, int map, struct plan_row *row)
{
    const double saved_ns = bvh_ns(f) - map_ns(f), build_s = 1e-9 * build_ns(need, f);
    size_t used = 0;
    if (row->forced) used = (size_t)snprintf(row->why, sizeof row->why, "forced by cast.sight; ");
    snprintf(row->why + used, sizeof row->why - used,
             "%.3g million pulses from a station %s for about %.2g s to make a map, which saves about %.2g ns each; "
             "%.3g %% meet a cell of one surface or none",
             1e-6 * need->pulses, map ? "pay" : "do not pay", build_s, fmax(0.0, saved_ns),
             100.0 * (f->one + f->nothing));
}

int plan_sight(const struct plan_sight_need *need, const struct plan_sight_found *found, struct plan_row *row)
{
    static const struct plan_tolerance any = {INFINITY, 1.0};
    struct plan_option option[OPTIONS];
    fill_options(need, found, option);
    /* What it costs is shown; whether it pays is asked with room for doubt. */
    const double cost_ns = option[MAP].cost_ns;
    int pays = 0;
    if (found != NULL && need->why_not == NULL) {
        const double saved_ns = (1.0 - LEAST_LEFT) * (bvh_ns(found) - map_ns(found)) * need->pulses;
        pays = saved_ns + ordering_ns(need) > build_ns(need, found);
    }
    if (need->why_not == NULL && !pays) option[MAP].cost_ns = fmax(0.0, cost_ns);
    const struct plan_choice choice = {"sight", option, OPTIONS, need->forced, "cast.sight", any};
    const int map = plan_choose(&choice, row) == MAP;
    if (need->why_not != NULL) {
        snprintf(row->why, sizeof row->why, "%s%s", row->forced ? "forced by cast.sight; " : "", need->why_not);
    } else if (found != NULL) {
        say_why(need, found, row->forced ? pays : map, row);
    } else {
        snprintf(row->why, sizeof row->why, "%s%.3g million pulses from a station are too few to pay for a map",
                 row->forced ? "forced by cast.sight; " : "", 1e-6 * need->pulses);
    }
    return map;
}
