/* Whether what Embree proposes is refined. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/plan.h"
#include "core/plan/cost.h"

/* What the refined cast promises for incidence up to 89.9 degrees; tests/stability holds it to that. */
static const double REFINED_ERROR_M = 1e-6;

enum { REFINED, AS_IS, UNDECIDED, OPTIONS };

static void list_options(const struct plan_cast_need *need, const struct plan_option *as_is,
                         struct plan_option option[OPTIONS])
{
    option[REFINED] = (struct plan_option){.error_m = REFINED_ERROR_M};
    snprintf(option[REFINED].method, sizeof option[REFINED].method, "packets of %u, decided", need->packet);
    option[AS_IS] = *as_is;
    option[AS_IS].cost_ns = -(PLAN_COST_REFINE + PLAN_COST_DECIDE);
    snprintf(option[AS_IS].method, sizeof option[AS_IS].method, "packets of %u, float", need->packet);
    option[UNDECIDED] = (struct plan_option){.method = "refined, not decided",
                                             .error_m = (double)NAN,
                                             .echo_share = (double)NAN,
                                             .cost_ns = -PLAN_COST_DECIDE,
                                             .why_not = "at an edge it errs as float does, and saves next to nothing"};
}

/* Why the plan does not take what it could. */
static void judge(const struct plan_cast_need *need, struct plan_option *it)
{
    const struct plan_tolerance *t = &need->tolerance;
    const char *why = need->not_plain != NULL ? need->not_plain : need->forced < 0 ? need->not_by_itself : NULL;
    if (why != NULL)
        snprintf(it->why_not, sizeof it->why_not, "%s", why);
    else if (need->forced < 0 && !(it->error_m <= PLAN_CAST_SHARE * t->range_m))
        snprintf(it->why_not, sizeof it->why_not, "its ranges may be off by more than %.3g m, the cast's share",
                 PLAN_CAST_SHARE * t->range_m);
    else if (need->forced < 0 && !(it->echo_share <= PLAN_CAST_SHARE * t->echo_share))
        snprintf(it->why_not, sizeof it->why_not, "more than %.3g %% of the pulses, the cast's share, may err at edges",
                 100.0 * PLAN_CAST_SHARE * t->echo_share);
}

int plan_cast(const struct plan_cast_need *need, const struct plan_option *as_is, struct plan_row *row)
{
    struct plan_option option[OPTIONS];
    int forced = need->forced < 0 ? -1 : need->forced ? REFINED : AS_IS;
    list_options(need, as_is, option);
    judge(need, &option[AS_IS]);
    int plain = plan_choose(row, "cast", option, OPTIONS, forced, "cast.refine", &need->tolerance) == (uint32_t)AS_IS;
    size_t used = strlen(row->why);
    if (!plain && !row->forced)
        snprintf(row->why, sizeof row->why, "triangle and range in double where float can't tell; costs about %.2g ns",
                 PLAN_COST_REFINE + PLAN_COST_DECIDE);
    else
        snprintf(row->why + used, sizeof row->why - used, "; %s",
                 plain ? "Embree's own hits" : "in double where float can't tell");
    return plain;
}
