/* SPDX-License-Identifier: MIT */
/* Chooses one of several options. */
#include <math.h>
#include <stdio.h>

#include "core/plan.h"

int plan_holds(const struct plan_option *option, const struct plan_tolerance *tolerance)
{
    return option->why_not[0] == '\0' && option->error_m <= tolerance->range_m &&
           option->echo_share <= tolerance->echo_share;
}

/* Returns how far an option misses the tolerance. An unknown bound is worse than any known one, and an option that
 * can't be used is worst. */
static double excess(const struct plan_option *option, const struct plan_tolerance *tolerance)
{
    if (option->why_not[0] != '\0') return (double)INFINITY;
    double range = option->error_m / tolerance->range_m, echoes = option->echo_share / tolerance->echo_share;
    return isnan(range) || isnan(echoes) ? 1e300 : fmax(range, echoes);
}

static void leave_out(struct plan_row *row, const struct plan_option *option, const struct plan_tolerance *tolerance,
                      double chosen_ns)
{
    struct plan_option *left = &row->left[row->n_left++];
    *left = *option;
    if (option->why_not[0] != '\0') return;
    if (option->error_m > tolerance->range_m)
        snprintf(left->why_not, sizeof left->why_not, "its range error is above %.3g m", tolerance->range_m);
    else if (option->echo_share > tolerance->echo_share)
        snprintf(left->why_not, sizeof left->why_not, "more than %.3g %% of the pulses get another echo count",
                 100.0 * tolerance->echo_share);
    else
        snprintf(left->why_not, sizeof left->why_not, "%s",
                 option->cost_ns <= chosen_ns ? "not asked for" : "costs more");
}

static void say_why(struct plan_row *row, const struct plan_option *it, uint32_t can, const struct plan_choice *choice)
{
    const struct plan_tolerance *tolerance = &choice->tolerance;
    char first[96];
    int holds = plan_holds(it, tolerance), known = !isnan(it->error_m) && !isnan(it->echo_share);
    const char *verdict = holds ? "holds" : "does not hold";
    if (row->forced)
        snprintf(first, sizeof first, "forced by %s", choice->key);
    else
        snprintf(first, sizeof first, "%s",
                 can == 1 ? "the only possible one"
                 : holds  ? "the cheapest"
                          : "the one with the least error");
    if (known)
        snprintf(row->why, sizeof row->why, "%s; %s %.3g m, and %.3g %% of the pulses with another echo count", first,
                 verdict, tolerance->range_m, 100.0 * tolerance->echo_share);
    else
        snprintf(row->why, sizeof row->why, "%s; its error is not known", first);
}

uint32_t plan_choose(const struct plan_choice *choice, struct plan_row *row)
{
    const struct plan_option *option = choice->option;
    const struct plan_tolerance *tolerance = &choice->tolerance;
    uint32_t chosen = 0, can = 0;
    int holds = 0;
    for (uint32_t i = 0; i < choice->n; i++) {
        can += option[i].why_not[0] == '\0';
        if (!plan_holds(&option[i], tolerance) || (holds && !(option[i].cost_ns < option[chosen].cost_ns))) continue;
        chosen = i;
        holds = 1;
    }
    /* Where options of known bounds miss the tolerance equally, the last is taken, which is the most exact. */
    for (uint32_t i = 0; i < choice->n && !holds; i++) {
        double over = excess(&option[i], tolerance), least = excess(&option[chosen], tolerance);
        if (over < least || (over == least && over < 1e300)) chosen = i;
    }
    if (choice->forced >= 0) chosen = (uint32_t)choice->forced;
    const struct plan_option *it = &option[chosen];
    plan_say(row, choice->stage, it->method, it->error_m, it->cost_ns, "");
    row->echo_share = it->echo_share;
    row->forced = choice->forced >= 0;
    say_why(row, it, can, choice);
    for (uint32_t i = 0; i < choice->n; i++)
        if (i != chosen) leave_out(row, &option[i], tolerance, it->cost_ns);
    return chosen;
}
