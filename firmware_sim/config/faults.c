/* SPDX-License-Identifier: MIT */
/* Injected faults: checks of their keys against each other, the links and the head; scenarios, and faults that commands
 * add. (Diagnostics of a configuration are in table/diagnostics.c.) */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/protocol.h"
#include "firmware_sim/config/check_faults.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/config/shared.h"
#include "firmware_sim/config/table/diagnostics.h"
#include "firmware_sim/config/table/document.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"

/* clang-format off */
#define FAULT_LIST_AT(member) offsetof(struct fault_list, member)
static const struct cfg_key fault_keys[] = {
#include "firmware_sim/config/fault_rows.h"
};
/* clang-format on */
static const struct cfg_table fault_table = {fault_keys, CFG_LEN(fault_keys)};

enum {
    WHEN_FRAME = 1 << FAULT_AT_FRAME,
    WHEN_REPLY = 1 << FAULT_AT_REPLY,
    WHEN_CONNECTION = 1 << FAULT_AT_CONNECTION,
    WHEN_MOMENT = 1 << FAULT_AT_MOMENT,
    WHEN_COUNTED = WHEN_FRAME | WHEN_REPLY | WHEN_CONNECTION,
};

/* Keys that say when a fault strikes, and the places that have them. */
static const struct {
    const char *path;
    unsigned places;
} when[] = {
    {"faults[].link", WHEN_COUNTED},
    {"faults[].of", WHEN_FRAME},
    {"faults[].at", WHEN_COUNTED},
    {"faults[].from", WHEN_COUNTED},
    {"faults[].until", WHEN_COUNTED},
    {"faults[].every", WHEN_COUNTED},
    {"faults[].probability", WHEN_COUNTED},
    {"faults[].count", WHEN_COUNTED},
    {"faults[].seed", WHEN_COUNTED},
    {"faults[].from_pulse", WHEN_FRAME | WHEN_MOMENT},
    {"faults[].until_pulse", WHEN_FRAME | WHEN_MOMENT},
};

/* Keys that say what a fault does. */
static const char *const what[] = {"n",  "byte",    "reseal", "for_ms", "reset", "factor",      "deg",
                                   "hz", "loss_db", "jump_s", "ppm",    "ns",    "grandmaster", "clock_class"};

/* The keys that a kind has, and its largest n. needs_ms: for_ms above 0 must be given. */
static const struct {
    const char *keys;
    double n_max;
    int needs_ms;
} kinds[FAULT_N_KINDS] = {
    [FAULT_DUPLICATE] = {"n", 100, 0},
    [FAULT_REORDER] = {"n", 1000, 0},
    [FAULT_DELAY] = {"for_ms", 0, 1},
    [FAULT_JITTER] = {"for_ms", 0, 1},
    [FAULT_TRUNCATE] = {"n", 1e6, 0},
    [FAULT_FLIP] = {"n, byte, reseal", 1000, 0},
    [FAULT_STALL] = {"for_ms", 0, 1},
    [FAULT_SPLIT] = {"n", 64, 0},
    [FAULT_MERGE] = {"n", 64, 0},
    [FAULT_GARBAGE] = {"n", 1024, 0},
    [FAULT_LATE_REPLY] = {"for_ms", 0, 1},
    [FAULT_DISCONNECT] = {"for_ms", 0, 0},
    [FAULT_UNPLUG] = {"for_ms", 0, 1},
    [FAULT_CABLE] = {"for_ms, reset", 0, 1},
    [FAULT_SHORT_PACKETS] = {"n", 1e6, 0},
    [FAULT_SLOW_ENUMERATION] = {"for_ms", 0, 1},
    [FAULT_DESCRIPTOR_LENGTH] = {"n", 1000, 0},
    [FAULT_SLOW_BOOT] = {"for_ms", 0, 1},
    [FAULT_POWER_CYCLE] = {"for_ms", 0, 1},
    [FAULT_MIRROR_SLOW] = {"factor", 0, 0},
    [FAULT_MIRROR_WOBBLE] = {"deg, hz", 0, 0},
    [FAULT_PAN_SLIP] = {"deg", 0, 0},
    [FAULT_WINDOW_SOILED] = {"loss_db", 0, 0},
    [FAULT_CLOCK_JUMP] = {"jump_s", 0, 0},
    [FAULT_CLOCK_DRIFT] = {"ppm", 0, 0},
    [FAULT_PPS_JITTER] = {"for_ms", 0, 1},
    [FAULT_NMEA_LATE] = {"for_ms", 0, 1},
    [FAULT_PTP_LOST] = {"ppm", 0, 0},
    [FAULT_PTP_NO_SYNC] = {"ppm", 0, 0},
    [FAULT_PTP_FAULTY] = {"ppm", 0, 0},
    [FAULT_PTP_GRANDMASTER] = {"ns, grandmaster, clock_class", 0, 0},
    [FAULT_PTP_STEP] = {"ns", 0, 0},
    [FAULT_PTP_ASYMMETRY] = {"ns", 0, 0},
    [FAULT_PTP_JITTER] = {"ns", 0, 0},
    [FAULT_COUNTERS_HIGH] = {"n", 1e9, 0},
    [FAULT_NTP_STEP] = {"jump_s", 0, 0},
};

static void check_keys(struct cfg_reader *rd, const struct fault *f, uint32_t i)
{
    const enum fault_place place = fault_place_of(f->kind);
    const char *keys = kinds[f->kind].keys, *name = fault_names[f->kind];
    for (size_t k = 0; k < CFG_LEN(when); k++)
        if (cfg_is_item_given(rd, when[k].path, i) && (when[k].places & 1U << place) == 0)
            cfg_fail_item(rd, when[k].path, i, "%s has no such key; allowed %s", name,
                          place == FAULT_AT_MOMENT
                              ? "from_s, until_s, from_pulse, until_pulse"
                              : "link, at, from, until, every, probability, count, seed, from_s, until_s");
    for (size_t k = 0; k < CFG_LEN(what); k++) {
        char path[CFG_PATH_MAX];
        snprintf(path, sizeof path, "faults[].%s", what[k]);
        if (cfg_is_item_given(rd, path, i) && !cfg_list_has(keys, what[k]))
            cfg_fail_item(rd, path, i, "%s has no such key; allowed %s", name,
                          keys != NULL ? keys : "only keys that say when and where");
    }
}

/* Returns the longest for_ms of a kind, as text: a late pulse must come before the next one. */
static const char *find_most_ms(enum fault_kind kind)
{
    return kind == FAULT_PPS_JITTER ? "400" : kind == FAULT_NMEA_LATE ? "5000" : "1e8";
}

static void check_values(struct cfg_reader *rd, const struct fault *f, uint32_t i)
{
    const char *name = fault_names[f->kind];
    const char *most_ms = find_most_ms(f->kind);
    if (kinds[f->kind].n_max > 0.0 && (double)f->n > kinds[f->kind].n_max)
        cfg_fail_item(rd, "faults[].n", i, "%u is too many for %s; allowed up to %.0f", f->n, name,
                      kinds[f->kind].n_max);
    if (kinds[f->kind].needs_ms && f->for_ms <= 0.0 && CFG_ITEM_SOUND(rd, i, "faults[].for_ms"))
        cfg_fail_item(rd, cfg_is_item_given(rd, "faults[].for_ms", i) ? "faults[].for_ms" : "faults[].kind", i,
                      "%s needs for_ms; allowed above 0 to %s ms", name, most_ms);
    if (f->for_ms > strtod(most_ms, NULL))
        cfg_fail_item(rd, "faults[].for_ms", i, "%.10g is too long for %s; allowed above 0 to %s ms", f->for_ms, name,
                      most_ms);
    if (f->at != 0 && (cfg_is_item_given(rd, "faults[].from", i) || cfg_is_item_given(rd, "faults[].until", i) ||
                       cfg_is_item_given(rd, "faults[].every", i)))
        cfg_fail_item(rd, "faults[].at", i, "is a single number; allowed only without from, until and every");
    if (f->until != 0 && f->until < f->from)
        cfg_fail_item(rd, "faults[].until", i, "is before from, which is %llu; allowed is that number or more",
                      (unsigned long long)f->from);
    if (f->until_s > 0.0 && f->until_s <= f->from_s)
        cfg_fail_item(rd, "faults[].until_s", i, "is not after from_s, which is %.10g s; allowed is a later time",
                      f->from_s);
    if (f->kind == FAULT_PTP_JITTER && (f->ns < 0.0 || f->ns > 1e9))
        cfg_fail_item(rd, "faults[].ns", i, "%.10g is out of range for %s; allowed 0 to 1e9 ns", f->ns, name);
    if (f->until_pulse < f->from_pulse)
        cfg_fail_item(rd, "faults[].until_pulse", i,
                      "is before from_pulse, which is %llu; allowed is that number or more",
                      (unsigned long long)f->from_pulse);
}

/* Values with which a fault would change nothing. Times of the clock are whole nanoseconds, so less than half of one is
 * nothing, too. */
static const struct {
    enum fault_kind kind;
    const char *path;
    size_t offset; /* in struct fault */
    double none, within;
} idle[] = {
    {FAULT_MIRROR_SLOW, "faults[].factor", offsetof(struct fault, factor), 1.0, 0.0},
    {FAULT_MIRROR_WOBBLE, "faults[].deg", offsetof(struct fault, deg), 0.0, 0.0},
    {FAULT_PAN_SLIP, "faults[].deg", offsetof(struct fault, deg), 0.0, 0.0},
    {FAULT_WINDOW_SOILED, "faults[].loss_db", offsetof(struct fault, loss_db), 0.0, 0.0},
    {FAULT_CLOCK_JUMP, "faults[].jump_s", offsetof(struct fault, jump_s), 0.0, 4.9e-10},
    {FAULT_NTP_STEP, "faults[].jump_s", offsetof(struct fault, jump_s), 0.0, 4.9e-10},
    {FAULT_CLOCK_DRIFT, "faults[].ppm", offsetof(struct fault, ppm), 0.0, 0.0},
    {FAULT_PTP_STEP, "faults[].ns", offsetof(struct fault, ns), 0.0, 0.49},
    {FAULT_PTP_ASYMMETRY, "faults[].ns", offsetof(struct fault, ns), 0.0, 0.49},
    {FAULT_PTP_JITTER, "faults[].ns", offsetof(struct fault, ns), 0.0, 0.49},
};

static void check_effect(struct cfg_reader *rd, const struct fault *f, uint32_t i)
{
    for (size_t k = 0; k < CFG_LEN(idle); k++) {
        double is;
        if (idle[k].kind != f->kind || !CFG_ITEM_SOUND(rd, i, idle[k].path)) continue;
        memcpy(&is, (const char *)f + idle[k].offset, sizeof is);
        if (fabs(is - idle[k].none) <= idle[k].within)
            cfg_fail_item(rd, idle[k].path, i, "%s would have no effect with %.10g; allowed are other values",
                          fault_names[f->kind], is);
    }
}

void cfg_check_faults(struct cfg_reader *rd, struct fault_list *list)
{
    for (uint32_t i = 0; i < list->n; i++) {
        struct fault *f = &list->fault[i];
        if (!cfg_is_item_given(rd, "faults[].until_pulse", i)) f->until_pulse = UINT64_MAX;
        if (!cfg_is_item_given(rd, "faults[].byte", i)) f->byte = -1;
        if (!CFG_ITEM_SOUND(rd, i, "faults[].kind")) continue;
        check_keys(rd, f, i);
        check_values(rd, f, i);
        check_effect(rd, f, i);
    }
}

static int needs_ptp(enum fault_kind kind)
{
    return kind >= FAULT_PTP_LOST && kind <= FAULT_PTP_JITTER;
}

static int needs_server(enum fault_kind kind)
{
    return kind >= FAULT_NTP_SILENT && kind <= FAULT_NTP_STEP;
}

static int needs_time(enum fault_kind kind)
{
    return kind == FAULT_CLOCK_JUMP || kind == FAULT_CLOCK_DRIFT || kind == FAULT_CLOCK_STOP ||
           kind == FAULT_LEAP_SECOND || (kind >= FAULT_PPS_LOST && kind <= FAULT_NMEA_CHECKSUM);
}

/* ntp.role: client is not required here: a client may set it later by telegram. */
static int can_ask_server(const struct config *cfg)
{
    return cfg->links_are_not_here || (config_speaks(cfg, PROTOCOL_COLA) && cfg->loop.pace == PACE_REALTIME);
}

static void check_needs(struct cfg_reader *rd, const struct config *cfg, const struct fault *f, uint32_t i)
{
    const char *name = fault_names[f->kind];
    if (needs_time(f->kind) && (cfg->time.epoch[0] == '\0' || strcmp(cfg->time.epoch, "none") == 0))
        cfg_fail_item(rd, "faults[].kind", i, "%s needs a time of day; allowed where time.epoch is not none", name);
    if (needs_ptp(f->kind) && !cfg->time.ptp.follower)
        cfg_fail_item(rd, "faults[].kind", i, "%s needs a follower of PTP; allowed where time.ptp.follower is on",
                      name);
    if (needs_server(f->kind) && !can_ask_server(cfg) && CFG_SOUND(rd, "links", "loop.pace"))
        cfg_fail_item(rd, "faults[].kind", i,
                      "%s needs a scanner that can ask a time server; allowed with a link of protocol: cola, and "
                      "loop.pace: realtime",
                      name);
}

/* Returns whether faults of the kind can strike on the link. */
static int link_has_fault(const struct link_spec *link, enum fault_kind kind)
{
    const int is_of_link = fault_is_act(kind) || fault_place_of(kind) == FAULT_AT_CONNECTION;
    const uint32_t can = link_faults(link);
    return !is_of_link || (can & LINK_FAULT_BIT(fault_act_of(kind, can) - FAULT_DISCONNECT)) != 0;
}

void cfg_check_fault_links(struct cfg_reader *rd, const struct config *cfg, const struct fault_list *list)
{
    for (uint32_t i = 0; i < list->n; i++) {
        const struct fault *f = &list->fault[i];
        if (!CFG_ITEM_SOUND(rd, i, "faults[].kind", "faults[].link")) continue;
        if (!cfg->has_no_head) check_needs(rd, cfg, f, i);
        if (cfg->links_are_not_here) continue; /* checked with the scanner that has the links */
        if (f->link > cfg->n_links)
            cfg_fail_item(rd, "faults[].link", i, "there is no link %u; allowed 0 to %u", f->link, cfg->n_links);
        else if (f->link != 0 && fault_place_of(f->kind) != FAULT_AT_MOMENT &&
                 !link_has_fault(&cfg->link[f->link - 1], f->kind))
            cfg_fail_item(rd, "faults[].link", i, "link %u can't have %s; allowed 0, or a link that can", f->link,
                          fault_names[f->kind]);
    }
}

static int read_list(struct cfg_reader *rd, const struct config *cfg, struct fault_list *list)
{
    cfg_fill_defaults(rd, NULL);
    cfg_check_faults(rd, list);
    cfg_check_fault_links(rd, cfg, list);
    cfg_check_fault_beams(rd, cfg, list);
    return rd->diagnostics->n == 0 ? SH_OK : rd->diagnostics->err[0].code;
}

int config_add_scenario(struct config *cfg, const char *name, struct config_diagnostics *diagnostics)
{
    struct cfg_reader rd;
    char path[CONFIG_PATH_LEN], known[512];
    struct fault_list *list = calloc(1, sizeof *list);
    memset(diagnostics, 0, sizeof *diagnostics);
    const int is_there = cfg_find_scenario(name, path);
    cfg_reader_init(&rd, is_there ? path : name, &fault_table, list, diagnostics);
    config_name_scenarios(known, sizeof known);
    int code = SH_OK;
    if (!is_there)
        code = cfg_fail_file(&rd, SH_EINPUT, 0, "no such scenario; allowed the path of a file, or one of these: %s",
                             known);
    else if (list == NULL)
        code = cfg_fail_file(&rd, SH_ENOMEM, 0, "no memory");
    else
        code = cfg_read_file(&rd);
    if (code == SH_OK) code = read_list(&rd, cfg, list);
    if (code == SH_OK && list->n == 0)
        code = cfg_fail_file(&rd, SH_EINPUT, 0, "no faults; allowed a list of 1 to %d under faults:", FAULT_MAX);
    if (code == SH_OK && cfg->faults.n + list->n > FAULT_MAX)
        code = cfg_fail_file(&rd, SH_EINPUT, 0, "%u faults, and the configuration has %u; allowed %d together", list->n,
                             cfg->faults.n, FAULT_MAX);
    for (uint32_t i = 0; code == SH_OK && i < list->n; i++)
        cfg->faults.fault[cfg->faults.n++] = list->fault[i];
    if (code == SH_OK) snprintf(cfg->scenario_file, sizeof cfg->scenario_file, "%s", path);
    free(list);
    return code;
}

int config_read_fault(const struct config *cfg, const char *text, struct fault *out, struct sh_err *err)
{
    enum { TEXT_MAX = 1024 };
    struct cfg_reader rd;
    struct cfg_document *doc;
    struct config_diagnostics diagnostics = {0};
    struct fault_list list = {0};
    char yaml[TEXT_MAX];
    const int len = snprintf(yaml, sizeof yaml, "faults: [ %s ]\n", text);
    if (len >= (int)sizeof yaml) return sh_fail(err, SH_EINPUT, "longer than %d characters", TEXT_MAX - 14);
    cfg_reader_init(&rd, "fault", &fault_table, &list, &diagnostics);
    int code = cfg_open_text(&rd, (const unsigned char *)yaml, (size_t)len, &doc);
    if (code == SH_OK) cfg_close_file(doc);
    if (code == SH_OK) code = read_list(&rd, cfg, &list);
    if (code != SH_OK) return sh_fail(err, code, "%s", diagnostics.err[0].text);
    if (list.n != 1) return sh_fail(err, SH_EINPUT, "%u faults; allowed one, as {kind: drop, every: 10}", list.n);
    *out = list.fault[0];
    return SH_OK;
}
