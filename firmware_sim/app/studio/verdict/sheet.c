/* SPDX-License-Identifier: MIT */
/* A verdict as text, and as JSON. */
#include <inttypes.h>

#include "firmware_sim/app/studio/verdict/verdict.h"

static const char *const STATES[] = {"-", "passed", "FINDING", "allowed"};
static const char *const STATE_KEYS[] = {"not_judged", "passed", "finding", "allowed"};

uint32_t verdict_count(const struct verdict *v, enum verdict_state state)
{
    uint32_t n = 0;
    for (int check = 0; check < VERDICT_N_CHECKS; check++)
        n += v->check[check].state == state;
    return n;
}

void verdict_print(const struct verdict *v, FILE *out)
{
    const struct verdict_figures *f = &v->figures;
    fprintf(out, "%s: %.1f s, %" PRIu64 " faults injected, %" PRIu64 " connections; log: %s\n", v->scenario, f->wall_s,
            f->injected, f->sessions, v->log);
    for (int check = 0; check < VERDICT_N_CHECKS; check++) {
        const struct verdict_result *r = &v->check[check];
        fprintf(out, "  %-13s %-8s %s\n", verdict_names[check], STATES[r->state], r->text);
    }
    if (f->lost_pulses != 0)
        fprintf(out, "  this machine was too slow for the head: it lost %" PRIu64 " pulses\n", f->lost_pulses);
}

static void put_checks(const struct verdict *v, struct json *json)
{
    json_open_array(json, "checks");
    for (int check = 0; check < VERDICT_N_CHECKS; check++) {
        json_open_object(json, NULL);
        json_string(json, "check", verdict_names[check]);
        json_string(json, "result", STATE_KEYS[v->check[check].state]);
        json_string(json, "text", v->check[check].text);
        json_close_object(json);
    }
    json_close_array(json);
}

static void put_breaks(const struct verdict *v, struct json *json)
{
    json_open_array(json, "disturbances");
    for (uint64_t i = 0; i < v->figures.breaks && i < VERDICT_MAX_BREAKS; i++) {
        json_open_object(json, NULL);
        json_string(json, "kind", v->broken[i].kind);
        json_uint(json, "link", v->broken[i].link);
        json_double(json, "back_s", v->broken[i].back_s);
        json_close_object(json);
    }
    json_close_array(json);
}

static void put_points(const struct verdict_points *p, struct json *json)
{
    if (p->frame == NULL) return;
    json_open_object(json, "points");
    json_uint(json, "points", p->n);
    json_uint(json, "empty", p->empty);
    json_uint(json, "sent", p->sent);
    json_uint(json, "unknown", p->unknown);
    json_uint(json, "repeated", p->repeated);
    json_string(json, "frame", p->frame);
    json_double(json, "file_unit_m", p->unit_m);
    json_double(json, "match_m", p->within_m);
    json_close_object(json);
}

void verdict_put(const struct verdict *v, struct json *json)
{
    const struct verdict_figures *f = &v->figures;
    json_open_object(json, NULL);
    json_string(json, "scenario", v->scenario);
    json_string(json, "log", v->log);
    json_double(json, "wall_s", f->wall_s);
    json_uint(json, "injected", f->injected);
    json_uint(json, "connections", f->sessions);
    json_uint(json, "ended_by_faults", f->breaks);
    json_double(json, "connected_s", f->connected_s);
    json_double(json, "back_mean_s", f->back_mean_s);
    json_double(json, "back_max_s", f->back_max_s);
    json_uint(json, "heard_bytes", f->heard_bytes);
    json_uint(json, "refused", f->refused);
    json_uint(json, "refused_by_state", f->refused_by_state);
    json_uint(json, "left_out_frames", f->left_out);
    json_uint(json, "lost_pulses", f->lost_pulses);
    json_open_array(json, "refused_lines");
    for (size_t i = 0; i < sizeof f->wrong_lines / sizeof f->wrong_lines[0]; i++)
        if (f->wrong_lines[i][0] != '\0') json_string(json, NULL, f->wrong_lines[i]);
    json_close_array(json);
    json_string(json, "exit", f->exit);
    put_breaks(v, json);
    put_points(&v->points, json);
    put_checks(v, json);
    json_uint(json, "findings", verdict_count(v, VERDICT_FOUND));
    json_close_object(json);
}
