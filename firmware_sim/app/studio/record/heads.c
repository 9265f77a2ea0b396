/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/record/heads.h"

#include <nettle/base16.h>
#include <nettle/sha2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"

/* Returns the number of the head with the scanner of station i, from 0; heads->n: no head has it yet. */
static uint32_t heads_find(const struct heads *heads, uint32_t i)
{
    const struct config_station *station = heads->one[0].cfg->station;
    uint32_t k = 0;
    if (config_serves(heads->one[0].cfg, i)) return 0;
    for (k = 1; k < heads->n; k++)
        if (station[heads->one[k].last_station - 1].scanner == station[i].scanner) break;
    return k;
}

/* Returns the number of the head, from 0, that scans from station s. s counts from 1 and may be larger than the number
 * of stations: stops without a trajectory go through all stations again and again. */
static uint32_t head_of(const struct heads *heads, uint32_t s)
{
    return heads->head_of[(s - 1) % heads->one[0].cfg->n_stations];
}

int heads_load(struct config *cfg, struct heads *heads, struct sh_err *err)
{
    int rc = SH_OK;
    heads->n = 1;
    heads->one[0].cfg = cfg;
    for (uint32_t i = 0; i < cfg->n_stations && rc == SH_OK; i++) {
        const uint32_t k = heads_find(heads, i);
        struct heads_one *one = &heads->one[k];
        if (k == heads->n) {
            one->cfg = calloc(1, sizeof *one->cfg);
            if (one->cfg == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the scanner of station %u", i + 1);
            heads->n++;
            rc = config_load_scanner(cfg, i + 1, one->cfg, err);
        }
        heads->head_of[i] = k;
        one->last_station = i + 1;
    }
    return rc;
}

uint32_t heads_turns(const struct heads *heads, uint32_t first, uint32_t last)
{
    uint32_t n = 1;
    for (uint32_t s = first + 1; first != 0 && s <= last; s++)
        n += head_of(heads, s) != head_of(heads, s - 1);
    return n;
}

struct config *heads_config(const struct heads *heads, uint32_t i, uint32_t first, uint32_t last)
{
    uint8_t is_used[CONFIG_MAX_STATIONS] = {0};
    if (first == 0 || heads->n == 1) return i == 0 ? heads->one[0].cfg : NULL;
    for (uint32_t s = first; s <= last && s < first + heads->one[0].cfg->n_stations; s++)
        is_used[head_of(heads, s)] = 1;
    for (uint32_t k = 0; k < heads->n; k++)
        if (is_used[k] && i-- == 0) return heads->one[k].cfg;
    return NULL;
}

static int open_one(struct heads *heads, struct heads_one *one, struct sh_err *err)
{
    if (one->is_open) return SH_OK;
    one->is_open = 1;
    scanner_report_set_up(&one->report, heads->report, one->cfg->head.settings.station, &heads->warnings);
    return offline_open(one->cfg, heads->first->site, heads->scan_s, &one->report.report, &one->offline, err);
}

int heads_open(struct heads *heads, struct site *site, double scan_s, const struct sh_report *report,
               struct sh_err *err)
{
    struct heads_one *one = &heads->one[0];
    heads->scan_s = scan_s;
    heads->report = report;
    heads->at = one;
    heads->first = &one->offline;
    one->is_open = 1;
    one->offline.site = site;
    return offline_open(one->cfg, NULL, scan_s, report, &one->offline, err);
}

const struct site *heads_site(const struct heads *heads)
{
    return heads->at->offline.site;
}

int heads_prepare(struct heads *heads, uint32_t station, struct sh_err *err)
{
    struct site *site = heads->at->offline.site;
    if (station == 0) station = site->cfg->head.settings.station;
    return site_open_sights(site, station - 1, 1, heads->report, err);
}

/* The hash of several streams is that of their hashes, as text, in the order of their heads. */
static void add_streams(const struct heads *heads, int hash, struct recording_result *sum)
{
    struct sha256_ctx ctx;
    uint8_t digest[SHA256_DIGEST_SIZE];
    char hex[65];
    sha256_init(&ctx);
    for (uint32_t i = 0; i < heads->n; i++) {
        const struct scanhead *sh = heads->one[i].offline.sh;
        struct scanhead_stats stats;
        if (sh == NULL) continue;
        scanhead_get_stats(sh, &stats);
        recording_add_counts(&sum->stream, &stats, sizeof stats);
        scanhead_hash_hex(sh, hex);
        sha256_update(&ctx, 64, (const uint8_t *)hex);
    }
    sha256_digest(&ctx, sizeof digest, digest);
    if (hash) base16_encode_update(sum->sha256, sizeof digest, digest);
}

/* Reports progress between the parts of a long recording, about once a second; within a part recording_run does so. */
static void say_progress(struct heads *heads, const struct recording_options *all, uint32_t station)
{
    const int64_t now_ns = clock_now_ns();
    char what[64];
    if (!all->progress || now_ns - heads->said_ns < 1000000000) return;
    if (heads->said_ns != 0) {
        snprintf(what, sizeof what, "recording from station %u of %u", station, all->last_station);
        sh_progress(heads->report, what,
                    (double)(station - all->first_station) / (1.0 + all->last_station - all->first_station));
    }
    heads->said_ns = now_ns;
}

/* Records from stations first to last, which share one scanner. */
static int record_some(struct heads *heads, const struct recording_options *all, uint32_t first, uint32_t last,
                       struct recording_result *sum, struct sh_err *err)
{
    struct heads_one *one = &heads->one[head_of(heads, first)];
    struct recording_options options = *all;
    struct recording_result result;
    say_progress(heads, all, first);
    int rc = open_one(heads, one, err);
    if (rc != SH_OK) return rc;
    options.first_station = first;
    options.last_station = last;
    options.end_station = all->last_station;
    options.begin_station = all->first_station;
    options.hash = 0;
    heads->at = one;
    if (all->hash && !one->is_hashed) scanhead_hash_start(one->offline.sh);
    one->is_hashed = 1;
    rc = recording_run(one->offline.sh, &options, &result, err);
    recording_add(sum, &result);
    if (rc == SH_OK && all->second != NULL) rc = all->second(all->ctx, err); /* parts may be shorter than a second */
    int again = 0;
    for (uint32_t s = last + 1; s <= all->last_station; s++)
        again |= head_of(heads, s) == (uint32_t)(one - heads->one);
    if (!again && one != heads->one) offline_stop(&one->offline);
    return rc;
}

/* Asks heads->fits about each station of head k. */
static int check_fits(const struct heads *heads, uint32_t k, const struct site *site, uint32_t first, uint32_t last,
                      struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t s = first; s <= last && rc == SH_OK && heads->fits != NULL; s++)
        if (head_of(heads, s) == k) rc = heads->fits(heads->ctx, site, s, err);
    return rc;
}

/* Opens the first head that is due. The other scanners are set up once and freed again, so that their errors come
 * before the first scan, and a warning of several of them comes once. The scanners' BVHs stay in struct site_world,
 * which the sites share, and are found there when their turn comes. */
static int check_all(struct heads *heads, uint32_t first, uint32_t last, struct sh_err *err)
{
    uint8_t is_known[CONFIG_MAX_STATIONS] = {1};
    struct scanner_report report;
    struct sh_report quiet = *heads->report;
    const uint32_t begins = head_of(heads, first);
    quiet.progress = NULL;
    int rc = check_fits(heads, 0, heads->first->site, first, last, err);
    if (rc == SH_OK) rc = open_one(heads, &heads->one[begins], err);
    if (rc == SH_OK && begins != 0) rc = check_fits(heads, begins, heads->one[begins].offline.site, first, last, err);
    is_known[begins] = 1;
    for (uint32_t s = first; s <= last && rc == SH_OK; s++) {
        const uint32_t k = head_of(heads, s);
        struct site *site = NULL;
        if (is_known[k]) continue;
        is_known[k] = 1;
        scanner_report_set_up(&report, &quiet, s, &heads->warnings);
        rc = offline_load(heads->one[k].cfg, heads->first->site, &report.report, &site, err);
        if (rc == SH_OK) rc = check_fits(heads, k, site, first, last, err);
        site_free(site);
    }
    scanner_warnings_say(&heads->warnings, heads->first->site, heads->report);
    return rc;
}

/* Records one head, which stands where it is set to or goes from station to station. */
static int record_one(struct heads *heads, const struct recording_options *options, struct recording_result *result,
                      struct sh_err *err)
{
    const struct site *site = heads->first->site;
    const uint32_t own = site->cfg->head.settings.station;
    const uint32_t first = options->first_station != 0 ? options->first_station : own;
    const uint32_t last = options->first_station != 0 ? options->last_station : own;
    memset(result, 0, sizeof *result);
    const int rc = check_fits(heads, 0, site, first, last, err);
    return rc == SH_OK ? recording_run(heads->first->sh, options, result, err) : rc;
}

int heads_record(struct heads *heads, const struct recording_options *options, struct recording_result *result,
                 struct sh_err *err)
{
    const uint32_t last = options->last_station;
    const int64_t start_ns = clock_now_ns();
    int rc = SH_OK;
    if (options->first_station != 0 && last > heads->first->site->n_stations)
        return sh_fail(err, SH_EINPUT, "%s: there is no station %u; allowed 1 to %u", heads->one[0].cfg->file, last,
                       heads->first->site->n_stations);
    if (heads->n == 1 || options->first_station == 0) return record_one(heads, options, result, err);
    memset(result, 0, sizeof *result);
    rc = check_all(heads, options->first_station, last, err);
    for (uint32_t from = options->first_station, to; from <= last && rc == SH_OK && result->missing[0] == '\0';
         from = to + 1) {
        for (to = from; to < last && head_of(heads, to + 1) == head_of(heads, from);)
            to++;
        rc = record_some(heads, options, from, to, result, err);
    }
    add_streams(heads, options->hash, result);
    result->wall_s = 1e-9 * (double)(clock_now_ns() - start_ns);
    return rc;
}

void heads_close(struct heads *heads)
{
    for (uint32_t i = heads->n; i-- > 0;) {
        offline_close(&heads->one[i].offline);
        if (i > 0) free(heads->one[i].cfg);
    }
    scanner_warnings_free(&heads->warnings);
}
