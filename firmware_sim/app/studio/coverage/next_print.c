/* SPDX-License-Identifier: MIT */
/* The next stations of `scanhead coverage` as text and as JSON. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "firmware_sim/app/studio/coverage/next.h"
#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/config/config.h"

enum { LINE_LEN = 160 };

/* Places of a grid are whole millimetres. Those of a file may be finer, and scans are from there. */
static int digits_of(const struct coverage_next_place *p)
{
    int digits = 3;
    for (int i = 0; i < 3; i++)
        if (fabs(p->position_m[i] - 1e-3 * round(1e3 * p->position_m[i])) > 5e-7) digits = 6;
    return digits;
}

/* An element of the list `stations`, as YAML has it on one line. */
static const char *ready_line(const struct coverage_next_place *p, uint32_t number, char line[LINE_LEN])
{
    char heading[40] = "";
    if (p->heading_deg != 0.0) snprintf(heading, sizeof heading, ", heading_deg: %.10g", p->heading_deg);
    const int n = digits_of(p);
    snprintf(line, LINE_LEN, "{name: next-%u, position_m: [%.*f, %.*f, %.*f]%s}", number, n, p->position_m[0], n,
             p->position_m[1], n, p->position_m[2], heading);
    return line;
}

/* The sections of the station whose scanner and tripod's cone the scans have. The line of a place lacks them. */
static const struct config_station *like_of(const struct coverage_result *result)
{
    const struct config *cfg = result->site->cfg;
    return &cfg->station[result->base % cfg->n_stations]; /* stops go through all stations, round after round */
}

static double estimate_of(const struct coverage_next *next, uint32_t round, uint32_t place)
{
    return next->estimate_m2[(size_t)round * next->n + place];
}

/* The largest difference between a scan's gain and its estimate by rays. */
static double largest_error_m2(const struct coverage_next *next)
{
    double most_m2 = 0.0;
    for (uint32_t i = 0; i < next->n_rounds; i++) {
        const struct coverage_next_round *r = &next->round[i];
        for (uint32_t k = 0; k < r->n_tried; k++)
            most_m2 = fmax(most_m2, fabs(r->tried[k].gain_m2 - estimate_of(next, i, r->tried[k].place)));
    }
    return most_m2;
}

static void print_round(const struct coverage_next *next, const struct coverage_result *result, uint32_t number)
{
    const struct coverage_next_round *r = &next->round[number];
    char line[LINE_LEN];
    printf("\nnext station %u: the best places, by a whole scan from each\n", number + 1);
    printf("%10s %10s %10s %9s %12s %8s %12s %12s\n", "x m", "y m", "z m", "height m", "gains m2", "%", "estimated",
           "sees m2");
    for (uint32_t k = 0; k < r->n_tried; k++) {
        const struct coverage_next_tried *tried = &r->tried[k];
        const struct coverage_next_place *p = &next->place[tried->place];
        char height[24] = "-";
        if (!isnan(p->floor_m)) snprintf(height, sizeof height, "%.3f", p->position_m[2] - p->floor_m);
        printf("%10.3f %10.3f %10.3f %9s %12.3f %8.3f %12.3f %12.3f\n", p->position_m[0], p->position_m[1],
               p->position_m[2], height, tried->gain_m2, coverage_percent(tried->gain_m2, result->sums.area_m2),
               estimate_of(next, number, tried->place), tried->seen_m2);
    }
    printf("with the first of them %.3f m2 (%.3f %%) are seen by no station:\n  - %s\n", r->none_m2,
           coverage_percent(r->none_m2, result->sums.area_m2),
           ready_line(&next->place[r->tried[0].place], number + 1, line));
    const struct config_station *like = like_of(result);
    if (like->tripod.given || like->has_scanner)
        printf("    the scans have the scanner and the tripod's cone of station %s: add its %s\n", like->name,
               !like->has_scanner    ? "tripod"
               : !like->tripod.given ? "scanner"
                                     : "tripod and scanner");
}

/* Says why a round has chosen no place. */
static const char *why_none(const struct coverage_next *next)
{
    int sees = 0;
    for (uint32_t i = 0; i < next->n; i++)
        sees |= next->place[i].state != COVERAGE_PLACE_WITHIN && !isnan(next->place[i].front);
    if (next->within == next->n)
        return "no place is left to compare; try --at, --candidates, or a mesh whose faces are turned round";
    if (!sees) return "no ray from these places hits a surface within the head's ranges; try --at or --candidates";
    if (next->round[next->n_rounds].n_tried > 0) return "whole scans from the best places add nothing";
    return "all that can be seen from these places is seen by a station already";
}

void coverage_next_print(const struct coverage_next *next, const struct coverage_result *result)
{
    printf("\nplaces     %" PRIu32 " to stand at", next->n);
    if (next->within > 0)
        printf(", %" PRIu32 " of them left out: they see mostly backs of faces, so they are within bodies",
               next->within);
    printf("\nestimates  %" PRIu32 " rays from each place, ", next->directions);
    if (next->whole_cells)
        printf("pulses of the head; each cell that they hit counts");
    else
        printf("%g deg apart", next->step_deg);
    if (next->n_rounds > 0) printf("; whole scans differ by up to %.3f m2", largest_error_m2(next));
    printf("\n");
    for (uint32_t i = 0; i < next->n_rounds; i++)
        print_round(next, result, i);
    if (next->n_rounds < next->n_asked)
        printf("\nno %sstation: %s\n", next->n_rounds > 0 ? "further " : "", why_none(next));
}

static void put_round(struct json *json, const struct coverage_next *next, const struct coverage_result *result,
                      uint32_t number)
{
    const struct coverage_next_round *r = &next->round[number];
    const struct coverage_next_place *best = &next->place[r->tried[0].place];
    char line[LINE_LEN];
    json_open_object(json, NULL);
    page_put_vector(json, "position_m", best->position_m);
    json_double(json, "heading_deg", best->heading_deg);
    json_double(json, "gain_m2", r->tried[0].gain_m2);
    json_double(json, "gain_percent", coverage_percent(r->tried[0].gain_m2, result->sums.area_m2));
    json_double(json, "seen_m2", r->tried[0].seen_m2);
    json_double(json, "none_m2", r->none_m2);
    json_double(json, "none_percent", coverage_percent(r->none_m2, result->sums.area_m2));
    json_string(json, "station", ready_line(best, number + 1, line));
    json_open_array(json, "tried");
    for (uint32_t k = 0; k < r->n_tried; k++) {
        json_open_object(json, NULL);
        json_uint(json, "place", r->tried[k].place);
        json_double(json, "gain_m2", r->tried[k].gain_m2);
        json_double(json, "estimate_m2", estimate_of(next, number, r->tried[k].place));
        json_double(json, "seen_m2", r->tried[k].seen_m2);
        json_close_object(json);
    }
    json_close_array(json);
    json_close_object(json);
}

static void put_place(struct json *json, const struct coverage_next *next, uint32_t i)
{
    const struct coverage_next_place *p = &next->place[i];
    json_open_object(json, NULL);
    page_put_vector(json, "position_m", p->position_m);
    json_double(json, "heading_deg", p->heading_deg);
    json_double(json, "floor_m", p->floor_m);
    json_bool(json, "within_body", p->state == COVERAGE_PLACE_WITHIN);
    json_double(json, "front", p->front);
    json_open_array(json, "estimate_m2");
    for (uint32_t r = 0; r < next->n_rounds; r++)
        json_double(json, NULL, estimate_of(next, r, i));
    json_close_array(json);
    json_close_object(json);
}

void coverage_next_put(struct json *json, const struct coverage_next *next, const struct coverage_result *result)
{
    const struct config_station *like = like_of(result);
    json_open_object(json, "next");
    json_uint(json, "directions", next->directions);
    json_double(json, "step_deg", next->whole_cells ? (double)NAN : next->step_deg);
    json_double(json, "largest_difference_m2", largest_error_m2(next));
    json_string(json, "like", like->name);
    json_open_array(json, "sections");
    if (like->tripod.given) json_string(json, NULL, "tripod");
    if (like->has_scanner) json_string(json, NULL, "scanner");
    json_close_array(json);
    json_open_array(json, "stations");
    for (uint32_t i = 0; i < next->n_rounds; i++)
        put_round(json, next, result, i);
    json_close_array(json);
    json_open_array(json, "places");
    for (uint32_t i = 0; i < next->n; i++)
        put_place(json, next, i);
    json_close_array(json);
    json_close_object(json);
}
