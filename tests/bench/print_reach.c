/* SPDX-License-Identifier: MIT */
/* This prints the results of bench_reach, as JSON and as a table, and beside each figure its bound. */
#include <string.h>

#include "tests/bench/reach.h"

struct bound {
    const char *name;
    double value, at_most;
};

static int has_bound(const struct bench_reach *r)
{
    return r->of != &REACH_CASE[r->of->standing];
}

/* A body that moves may cost half as much again as one that stands, and a head that moves three tenths. How far a head
 * goes, or how far away a station is, may add a tenth. */
static struct bound bound_of(const struct bench_reach *r)
{
    const struct reach_case *of = r->of;
    if (of->ball != 0) return (struct bound){"by_standing", r->by_standing, 1.5};
    if (of->head_moves && of->near == of->standing) return (struct bound){"by_standing", r->by_standing, 1.3};
    return (struct bound){"by_near", r->by_near, 1.1};
}

void bench_put_reach(struct json *json, const struct bench_reach *reach, uint32_t n)
{
    json_open_array(json, "reach");
    for (uint32_t i = 0; i < n; i++) {
        const struct bench_reach *r = &reach[i];
        const struct bound bound = bound_of(r);
        json_open_object(json, NULL);
        json_string(json, "case", r->of->name);
        json_uint(json, "triangles", r->triangles);
        json_double(json, "ns_per_pulse", r->ns);
        json_double(json, "by_standing", r->by_standing);
        json_string(json, "near", REACH_CASE[r->of->near].name);
        json_double(json, "by_near", r->by_near);
        json_double(json, "leaves_per_packet", r->leaves);
        json_double(json, "decided_per_million", 1e6 * r->decided);
        json_double(json, "load_s", r->load_s);
        json_double(json, "mib", r->mib);
        if (has_bound(r)) {
            json_string(json, "bound_of", bound.name);
            json_double(json, "at_most", bound.at_most);
            json_bool(json, "reached", bound.value <= bound.at_most);
        }
        json_close_object(json);
    }
    json_close_array(json);
}

void bench_table_reach(FILE *out, const struct bench_reach *reach, uint32_t n)
{
    if (n == 0) return;
    fprintf(out,
            "\nwhat moves or is far, without a sight; one thread, the whole cast\n"
            "%-26s %9s | %7s %9s %7s | %7s %8s | %7s %7s | %s\n",
            "case", "triangles", "ns", "standing", "near", "leaves", "decided", "load s", "MiB", "bound, and reached");
    for (uint32_t i = 0; i < n; i++) {
        const struct bench_reach *r = &reach[i];
        const struct bound bound = bound_of(r);
        fprintf(out, "%-26s %9u | %7.1f %9.3f %7.3f | %7.3f %8.5f | %7.2f %7.1f |", r->of->name, r->triangles, r->ns,
                r->by_standing, r->by_near, r->leaves, r->decided, r->load_s, r->mib);
        if (has_bound(r))
            fprintf(out, " %-11s <= %.1f %s", bound.name, bound.at_most, bound.value <= bound.at_most ? "yes" : "no");
        fputc('\n', out);
    }
}
