#include "core/plan.h"

#include <math.h>
#include <stdio.h>

static const struct {
    const char *name;
    double cost_ns;
} methods[] = {[GEOREF_AUTO] = {"auto", 0.0},     [GEOREF_EXACT] = {"exact", 0.0}, /* by CRS */
               [GEOREF_ORDER1] = {"order1", 1.0}, [GEOREF_ORDER2] = {"order2", 2.0},
               [GEOREF_ORDER3] = {"order3", 4.0}, [GEOREF_ORDER5] = {"order5", 4.0}};

const char *plan_method_name(enum georef_method method)
{
    return methods[method].name;
}

static double cost_ns(const struct georef *georef, enum georef_method method)
{
    if (method != GEOREF_EXACT) return methods[method].cost_ns;
    return georef_crs(georef) == GEOREF_UTM ? 600.0 : 250.0;
}

/* Local and ecef: the head's rotation and the CRS's are one matrix. */
static void say_linear(const struct georef *georef, struct plan_row *row, double error_m)
{
    int local = georef_crs(georef) == GEOREF_LOCAL;
    snprintf(row->method, sizeof row->method, "%s", local ? "none" : "rotation");
    row->error_m = error_m;
    row->cost_ns = 0.0;
    snprintf(row->why, sizeof row->why, "%s",
             local ? "points stay in the scene frame" : "ECEF is a rotation, which the head's rotation takes in");
}

int plan_georef(const struct georef *georef, const struct plan_georef_need *need, enum georef_method *method,
                struct plan_row *row, struct sh_err *err)
{
    double bound_m = georef_bound_m(georef, GEOREF_EXACT, need->radius_m, need->height_m), rotation[9];
    *row = (struct plan_row){.stage = "georef"};
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
    snprintf(row->method, sizeof row->method, "%s", methods[*method].name);
    row->error_m = bound_m;
    row->cost_ns = cost_ns(georef, *method);
    const char *why = need->forced != GEOREF_AUTO       ? "asked for by output.georef"
                      : !(bound_m <= need->tolerance_m) ? "nothing meets the tolerance"
                      : *method != GEOREF_EXACT         ? "the cheapest that meets the tolerance"
                      : georef_has_geoid(georef)        ? "the geoid is interpolated for each point"
                                                        : "no polynomial meets the tolerance";
    snprintf(row->why, sizeof row->why, "%s: %.3g m within %.5g m, %.5g m up or down", why, need->tolerance_m,
             need->radius_m, need->height_m);
    return SH_OK;
}

void plan_georef_polar(struct plan_row *row)
{
    *row = (struct plan_row){.stage = "georef", .method = "none"};
    snprintf(row->why, sizeof row->why,
             "output.layout is polar: points leave as range and angles, the anchor says where");
}

static struct plan_row *add(struct plan_row *row, const char *stage, const char *method, double error_m, double cost_ns,
                            const char *why)
{
    *row = (struct plan_row){.error_m = error_m, .cost_ns = cost_ns};
    snprintf(row->stage, sizeof row->stage, "%s", stage);
    snprintf(row->method, sizeof row->method, "%s", method);
    snprintf(row->why, sizeof row->why, "%s", why);
    return row + 1;
}

/* Within how much of the range float can't tell two surfaces apart. */
static const double FLOAT_ORDER = 5e-7;
/* What the cast promises for incidence up to 89.9 degrees; tests/stability holds it to that. */
static const double CAST_ERROR_M = 1e-6;

static struct plan_row *plan_optics(struct plan_row *row, const struct plan_head *head)
{
    char why[192];
    if (head->n_glass == 0)
        return add(row, "optics", "none", 0.0, 0.0, "no surface is of glass or a mirror: no pulse is cast twice");
    if (head->depth == 0) return add(row, "optics", "none", (double)NAN, 0.0, "optics.depth is 0");
    snprintf(why, sizeof why,
             "%u surfaces of glass or mirrors; only pulses that meet one are cast again, up to %u times", head->n_glass,
             head->depth);
    return add(row, "optics", "secondary rays", CAST_ERROR_M, (double)NAN, why);
}

static struct plan_row *plan_signal(struct plan_row *row, const struct plan_head *head)
{
    char why[192];
    if (!head->signal)
        return add(row, "signal", "none", 0.0, 0.0, "signal.model is off: each hit within range_max_m is an echo");
    snprintf(why, sizeof why, "signal.model: targets vanish %s; the farthest of the profile's reaches is %.4g m",
             head->sharp ? "sharply" : "by chance", head->reach_m);
    return add(row, "signal", "range equation", 0.0, 30.0, why);
}

static struct plan_row *plan_noise(struct plan_row *row, const struct plan_head *head)
{
    char why[192];
    if (head->noise_on && head->range_sigma_at_m > 0.0) {
        snprintf(why, sizeof why, "noise.range: sigma %.3g m at %.4g m, by the signal elsewhere, and %.3g ppm",
                 head->range_sigma_m, head->range_sigma_at_m, head->range_sigma_ppm);
        row = add(row, "noise", "gauss, by signal", 0.0, 3.0, why);
    } else if (head->noise_on) {
        snprintf(why, sizeof why, "noise.range: sigma %.3g m and %.3g ppm, which are the head's, not an error",
                 head->range_sigma_m, head->range_sigma_ppm);
        row = add(row, "noise", "gauss", 0.0, 1.5, why);
    } else {
        row = add(row, "noise", "none", 0.0, 0.0, "noise.range is off");
    }
    if (!(head->ball_radius_m > 0.0)) return row;
    snprintf(why, sizeof why, "noise.ball: points move by up to %.3g m, and more by its factors", head->ball_radius_m);
    return add(row, "ball", "uniform in a ball", 0.0, 130.0, why);
}

size_t plan_head(const struct plan_head *head, struct plan_row rows[PLAN_HEAD_ROWS])
{
    struct plan_row *row = rows;
    char method[32], why[192];
    snprintf(method, sizeof method, "packets of %u, decided", head->packet);
    row = add(row, "cast", method, CAST_ERROR_M, (double)NAN,
              "the widest packets of this CPU; triangle and range in double where float can't tell; cost: make bench");
    if (head->order_exactly)
        row = add(row, "order", "double", 0.0, (double)NAN, "scene.order_exactly: surfaces that overlap are ordered");
    else {
        snprintf(why, sizeof why,
                 "scene.order_exactly is off: of surfaces within %.2g m of each other at %.4g m any one",
                 FLOAT_ORDER * head->range_max_m, head->range_max_m);
        row = add(row, "order", "none", FLOAT_ORDER * head->range_max_m, 0.0, why);
    }
    if (head->n_movers > 0)
        row = add(row, "movers", "cast on their own", CAST_ERROR_M, (double)NAN, "meshes that move");
    else
        row = add(row, "movers", "none", 0.0, 0.0, "no mesh moves");
    if (head->beam_adaptive) {
        row = add(row, "beam", "adaptive", (double)NAN, (double)NAN,
                  "one ray, and one for each part that outlines cut a footprint into; nothing moves");
    } else if (head->beam_rays > 0) {
        snprintf(method, sizeof method, "rings of %u", head->beam_rays);
        row = add(row, "beam", method, (double)NAN, (double)NAN, "so many rays for each pulse");
    } else {
        row = add(row, "beam", "none", 0.0, 0.0, "beam.mode is single: one ray per pulse");
    }
    row = plan_optics(row, head);
    row = plan_signal(row, head);
    row = plan_noise(row, head);
    if (head->ambiguity == DETECT_AMBIGUITY_NONE)
        row = add(row, "zones", "none", 0.0, 0.0, "head.ambiguity is none: echoes are told where they are");
    else
        row = add(row, "zones", head->ambiguity == DETECT_FOLDED ? "folded" : "resolved", 0.0, 1.0,
                  "head.ambiguity: echoes from behind the next pulse");
    if (head->instrument || head->angle_noise)
        row = add(row, "geometry", head->instrument ? "errors of geometry" : "angle noise", 0.0, 15.0,
                  "instrument, noise.angle: each beam is aimed by the real mechanics, read by the encoders");
    else
        row = add(row, "geometry", "none", 0.0, 0.0, "instrument is all zero, noise.angle off: the head is ideal");
    return (size_t)(row - rows);
}
