/* SPDX-License-Identifier: MIT */
/* Rows of the stages about which there is little to choose. */
#include "core/plan.h"

#include <math.h>
#include <stdio.h>

#include "core/plan/cost.h"

void plan_say(struct plan_row *row, const char *stage, const char *method, double error_m, double cost_ns,
              const char *why)
{
    *row = (struct plan_row){.error_m = error_m, .cost_ns = cost_ns};
    snprintf(row->stage, sizeof row->stage, "%s", stage);
    snprintf(row->method, sizeof row->method, "%s", method);
    snprintf(row->why, sizeof row->why, "%s", why);
}

static struct plan_row *plan_add(struct plan_row *row, const char *stage, const char *method, double error_m,
                                 double cost_ns, const char *why)
{
    plan_say(row, stage, method, error_m, cost_ns, why);
    return row + 1;
}

/* The bound of the cast for incidence up to 89.9 degrees, which tests/stability checks. */
static const double CAST_ERROR_M = 1e-6;

void plan_mesh(double error_m, struct plan_row *row)
{
    if (error_m > 0.0)
        plan_say(row, "mesh", "single precision", error_m, 0.0,
                 "its coordinates were rounded to single precision, in the file or by its reader");
    else
        plan_say(row, "mesh", "double", 0.0, 0.0, "its vertices have the file's coordinates");
}

void plan_cast(uint32_t packet, struct plan_row *row)
{
    char method[sizeof row->method];
    snprintf(method, sizeof method, "packets of %u, in double", packet);
    plan_say(row, "cast", method, CAST_ERROR_M, 0.0, "triangle and range in double, for any origin of rays");
}

void plan_beam_option(enum beam_mode mode, uint32_t rings, struct plan_option *option)
{
    uint32_t n = 1 + 3 * rings * (rings + 1);
    *option = (struct plan_option){
        .method = "single", .error_m = (double)NAN, .echo_share = (double)NAN, .mode = mode, .rings = rings};
    if (mode == BEAM_RINGS) {
        snprintf(option->method, sizeof option->method, "rings %u (%u rays)", rings, n);
        option->cost_ns = n * PLAN_COST_SUB_RAY;
    } else if (mode == BEAM_ADAPTIVE) {
        snprintf(option->method, sizeof option->method, "adaptive");
        option->cost_ns = (double)NAN;
    }
}

static struct plan_row *plan_signal(struct plan_row *row, const struct plan_head *head)
{
    char why[192];
    if (!head->signal)
        return plan_add(row, "signal", "none", 0.0, 0.0, "signal.model is off: each hit within range_max_m is an echo");
    snprintf(why, sizeof why, "signal.model: targets vanish %s; the largest reach in the head profile is %.4g m",
             head->sharp ? "sharply" : "by chance", head->reach_m);
    return plan_add(row, "signal", "range equation", 0.0, 30.0, why);
}

static struct plan_row *plan_noise(struct plan_row *row, const struct plan_head *head)
{
    char why[192];
    if (head->noise_on && head->range_sigma_at_m > 0.0) {
        snprintf(why, sizeof why,
                 "noise.range: sigma %.3g m at %.4g m, elsewhere it depends on the signal, and %.3g ppm",
                 head->range_sigma_m, head->range_sigma_at_m, head->range_sigma_ppm);
        row = plan_add(row, "noise", "gauss, by signal", 0.0, 3.0, why);
    } else if (head->noise_on) {
        snprintf(why, sizeof why, "noise.range: sigma %.3g m and %.3g ppm; noise of the head, not an error of the plan",
                 head->range_sigma_m, head->range_sigma_ppm);
        row = plan_add(row, "noise", "gauss", 0.0, 1.5, why);
    } else {
        row = plan_add(row, "noise", "none", 0.0, 0.0, "noise.range is off");
    }
    if (!(head->ball_radius_m > 0.0)) return row;
    snprintf(why, sizeof why, "noise.ball: points move by up to %.3g m, times its factors", head->ball_radius_m);
    return plan_add(row, "ball", "uniform in a ball", 0.0, 130.0, why);
}

size_t plan_head(const struct plan_head *head, struct plan_row rows[PLAN_HEAD_ROWS])
{
    struct plan_row *row = rows;
    if (head->n_movers > 0)
        row = plan_add(row, "movers", "cast separately", CAST_ERROR_M, (double)NAN, "meshes that move");
    else
        row = plan_add(row, "movers", "none", 0.0, 0.0, "no mesh moves");
    row = plan_signal(row, head);
    row = plan_noise(row, head);
    if (head->ambiguity == DETECT_AMBIGUITY_NONE)
        row = plan_add(row, "zones", "none", 0.0, 0.0, "head.ambiguity is none: echoes have their true range");
    else
        row = plan_add(row, "zones", head->ambiguity == DETECT_FOLDED ? "folded" : "resolved", 0.0, 1.0,
                       "head.ambiguity: echoes that return after the next pulse");
    if (head->instrument || head->angle_noise)
        row = plan_add(
            row, "geometry", head->instrument ? "errors of geometry" : "angle noise", 0.0, 15.0,
            "instrument, noise.angle: the beam follows the mechanics with their errors, points follow the encoders");
    else
        row = plan_add(row, "geometry", "none", 0.0, 0.0, "instrument is all zero, noise.angle off: the head is ideal");
    return (size_t)(row - rows);
}
