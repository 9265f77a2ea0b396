/* SPDX-License-Identifier: MIT */
/* Chooses how points get into the CRS. */
#include "core/plan.h"

#include <math.h>
#include <stdio.h>

static const struct {
    const char *name;
    double cost_ns;
} methods[] = {[GEOREF_AUTO] = {"auto", 0.0},     [GEOREF_EXACT] = {"exact", 0.0}, /* by CRS */
               [GEOREF_ORDER1] = {"order1", 1.0}, [GEOREF_ORDER2] = {"order2", 2.0},
               [GEOREF_ORDER3] = {"order3", 4.0}, [GEOREF_ORDER5] = {"order5", 4.0}};

static double cost_ns(const struct georef *georef, enum georef_method method)
{
    if (method != GEOREF_EXACT) return methods[method].cost_ns;
    return georef_crs(georef) == GEOREF_UTM ? 600.0 : 250.0;
}

/* Fills the row for local and ecef, where the head's rotation and the CRS's are one matrix. */
static void say_linear(const struct georef *georef, struct plan_row *row, double error_m)
{
    int local = georef_crs(georef) == GEOREF_LOCAL;
    plan_say(row, "georef", local ? "none" : "rotation", error_m, 0.0,
             local ? "points stay in the scene frame"
                   : "ECEF is a rotation; one matrix does this and the head's rotation together");
}

static void leave_out(const struct georef *georef, const struct plan_georef_need *need, enum georef_method chosen,
                      struct plan_row *row)
{
    for (enum georef_method m = GEOREF_EXACT; m <= GEOREF_ORDER5; m++) {
        if (m == chosen) continue;
        struct plan_option *left = &row->left[row->n_left++];
        *left = (struct plan_option){.error_m = georef_bound_m(georef, m, need->radius_m, need->height_m),
                                     .cost_ns = cost_ns(georef, m)};
        snprintf(left->method, sizeof left->method, "%s", methods[m].name);
        snprintf(left->why_not, sizeof left->why_not, "%s",
                 !isfinite(left->error_m)            ? "its error has no bound here"
                 : left->error_m > need->tolerance_m ? "its error is above the tolerance"
                 : need->forced != GEOREF_AUTO       ? "not asked for"
                                                     : "costs more, or is not better");
    }
}

int plan_georef(const struct georef *georef, const struct plan_georef_need *need, enum georef_method *method,
                struct plan_row *row, struct sh_err *err)
{
    double bound_m = georef_bound_m(georef, GEOREF_EXACT, need->radius_m, need->height_m), rotation[9];
    *method = GEOREF_EXACT;
    if (georef_rotation(georef, rotation)) {
        say_linear(georef, row, bound_m);
        return SH_OK;
    }
    enum georef_method first = GEOREF_ORDER1, last = GEOREF_ORDER5;
    if (need->forced != GEOREF_AUTO) first = last = need->forced;
    for (enum georef_method m = first; m <= last; m++) {
        double b = georef_bound_m(georef, m, need->radius_m, need->height_m);
        int meets = b <= need->tolerance_m;
        if (need->forced != GEOREF_AUTO && !isfinite(b))
            return sh_fail(err, SH_EINPUT,
                           "georeferencing by %s has no bound for points up to %.4g m away; allowed exact",
                           methods[m].name, need->radius_m);
        if (!meets && need->forced == GEOREF_AUTO) continue;
        *method = m;
        bound_m = b;
        break;
    }
    plan_say(row, "georef", methods[*method].name, bound_m, cost_ns(georef, *method), "");
    row->forced = need->forced != GEOREF_AUTO;
    leave_out(georef, need, *method, row);
    const char *why = need->forced != GEOREF_AUTO       ? "asked for by output.georef"
                      : !(bound_m <= need->tolerance_m) ? "no method meets the tolerance"
                      : *method != GEOREF_EXACT         ? "the cheapest that meets the tolerance"
                      : georef_has_geoid(georef)        ? "the geoid is interpolated for each point"
                                                        : "no polynomial meets the tolerance";
    snprintf(row->why, sizeof row->why, "%s: %.3g m for points up to %.5g m away, %.5g m up or down", why,
             need->tolerance_m, need->radius_m, need->height_m);
    return SH_OK;
}

void plan_georef_polar(struct plan_row *row)
{
    plan_say(row, "georef", "none", 0.0, 0.0,
             "output.layout is polar: points are sent as range and angles, and the anchor gives the place");
}
