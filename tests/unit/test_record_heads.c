/* SPDX-License-Identifier: MIT */
/* Recordings with the heads of several scanners: which head scans from which stations, when each is set up and ends,
 * and what is added up. Heads and recordings are the test's; each call is written to `trace`. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <nettle/base16.h>
#include <nettle/sha2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/app/studio/record/heads.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "tests/unit/clock_rig.h"
#include "tests/unit/trace_rig.h"

/* The scanners of five stations. A is that of the head. */
static const char SCANNERS[] = "ABBAC";
enum { N = 5 };

static struct config cfg;
static struct heads *heads;
static struct site site_of[3];
static char progress[256];
static int n_seconds;

/* The number of a head, by its configuration, site or offline head. */
static int of_cfg(const struct config *of)
{
    return of == &cfg ? 0 : (int)of->head.settings.station;
}

static int of_offline(const struct offline *off)
{
    for (int k = 0; k < 3; k++)
        if (off == &heads->one[k].offline) return k;
    return -1;
}

static int of_handle(const struct scanhead *sh)
{
    return (int)(&site_of[2] - (const struct site *)(const void *)sh);
}

static struct scanhead *handle_of(int k)
{
    return (struct scanhead *)(void *)&site_of[2 - k];
}

int config_serves(const struct config *of, uint32_t i)
{
    assert_ptr_equal(of, &cfg);
    return SCANNERS[i] == 'A';
}

int config_load_scanner(const struct config *of, uint32_t station, struct config *out, struct sh_err *err)
{
    assert_ptr_equal(of, &cfg);
    *out = (struct config){.n_stations = N};
    out->head.settings.station = heads->n - 1;
    return call(err, "scanner:%u", station);
}

void scanner_report_set_up(struct scanner_report *report, const struct sh_report *to, uint32_t station,
                           struct scanner_warnings *warnings)
{
    assert_true((to == heads->report || to->progress == NULL) && warnings == &heads->warnings);
    *report = (struct scanner_report){.station = station, .report = *to};
}

void scanner_warnings_say(struct scanner_warnings *warnings, const struct site *first, const struct sh_report *to)
{
    assert_true(warnings == &heads->warnings && first == &site_of[0] && to == heads->report);
    say("warnings ");
}

void scanner_warnings_free(struct scanner_warnings *warnings)
{
    assert_ptr_equal(warnings, &heads->warnings);
    say("free_warnings");
}

int offline_load(struct config *of, const struct site *beside, const struct sh_report *report, struct site **site,
                 struct sh_err *err)
{
    assert_true(beside == &site_of[0] && report->progress == NULL);
    *site = &site_of[of_cfg(of)];
    return call(err, "load:%d", of_cfg(of));
}

void site_free(struct site *site)
{
    if (site == NULL)
        say("free:none ");
    else
        say("free:%d ", (int)(site - site_of));
}

int offline_open(struct config *of, const struct site *beside, double scan_s, const struct sh_report *report,
                 struct offline *off, struct sh_err *err)
{
    const int k = of_cfg(of);
    if (beside == NULL)
        assert_ptr_equal(report, heads->report);
    else
        assert_true(beside == &site_of[0] && report->progress != NULL);
    assert_true(scan_s == 2.5 && k == of_offline(off));
    off->site = &site_of[k];
    off->sh = handle_of(k);
    return call(err, "%s:%d", beside == NULL ? "open" : "beside", k);
}

int site_open_sights(struct site *site, uint32_t first, uint32_t n, const struct sh_report *report, struct sh_err *err)
{
    assert_true(n == 1 && report == heads->report);
    return call(err, "prepare:%d:%u", (int)(site - site_of), first);
}

void offline_stop(struct offline *off)
{
    say("stop:%d ", of_offline(off));
}

void offline_close(struct offline *off)
{
    say("close:%d ", of_offline(off));
}

void scanhead_hash_start(struct scanhead *sh)
{
    say("hash:%d ", of_handle(sh));
}

/* The hash of head k is 64 times the digit k. */
void scanhead_hash_hex(const struct scanhead *sh, char hex[65])
{
    memset(hex, '0' + of_handle(sh), 64);
    hex[64] = '\0';
}

void scanhead_get_stats(const struct scanhead *sh, struct scanhead_stats *stats)
{
    const uint64_t k = (uint64_t)of_handle(sh) + 1;
    *stats = (struct scanhead_stats){.bytes = k, .frames = 10 * k, .bad_unseen = 100 * k};
}

int recording_run(struct scanhead *sh, const struct recording_options *o, struct recording_result *result,
                  struct sh_err *err)
{
    *result = (struct recording_result){.frames = o->first_station};
    clock_rig_ns += 700000000;
    return call(err, "run:%d:%u-%u/%u-%u%s", of_handle(sh), o->first_station, o->last_station, o->begin_station,
                o->end_station, o->hash ? "#" : "");
}

void recording_add(struct recording_result *sum, const struct recording_result *more)
{
    sum->frames += more->frames;
}

static int fit(void *ctx, const struct site *site, uint32_t station, struct sh_err *err)
{
    assert_ptr_equal(ctx, &cfg);
    return call(err, "fits:%d:%u", (int)(site - site_of), station);
}

static int second(void *ctx, struct sh_err *err)
{
    assert_ptr_equal(ctx, &cfg);
    return ++n_seconds == 2 && fails != NULL ? call(err, "second") : SH_OK;
}

static void say_progress(void *ctx, const char *what, double fraction)
{
    (void)ctx;
    const size_t n = strlen(progress);
    snprintf(progress + n, sizeof progress - n, "%s: %.2f\n", what, fraction);
}

static const struct sh_report REPORT = {.progress = say_progress};

/* The heads of all stations, of which the first is open. */
static void begin(void)
{
    struct sh_err err;
    memset(&cfg, 0, sizeof cfg);
    cfg.n_stations = N;
    cfg.head.settings.station = 4;
    strcpy(cfg.file, "head.yaml");
    for (uint32_t i = 0; i < N; i++)
        cfg.station[i].scanner = (uint32_t)(SCANNERS[i] - 'A');
    for (int k = 0; k < 3; k++)
        site_of[k] = (struct site){.cfg = &cfg, .n_stations = N};
    heads = calloc(1, sizeof *heads);
    assert_non_null(heads);
    fails = NULL;
    trace[0] = progress[0] = '\0';
    n_seconds = 0;
    clock_rig_ns = 1000000000;
    assert_int_equal(heads_load(&cfg, heads, &err), SH_OK);
    assert_string_equal(trace, "scanner:2 scanner:5 ");
    assert_int_equal(heads_open(heads, NULL, 2.5, &REPORT, &err), SH_OK);
    assert_string_equal(trace, "scanner:2 scanner:5 open:0 ");
    heads->fits = fit;
    heads->ctx = &cfg;
    trace[0] = '\0';
}

static void end(void)
{
    trace[0] = '\0';
    heads_close(heads);
    assert_string_equal(trace, "close:2 close:1 close:0 free_warnings");
    free(heads);
}

static void each_scanner_has_a_head(void **state)
{
    static const uint32_t head_of[N] = {0, 1, 1, 0, 2}, last[3] = {4, 3, 5};
    (void)state;
    begin();
    assert_int_equal(heads->n, 3);
    for (int i = 0; i < N; i++)
        assert_int_equal(heads->head_of[i], head_of[i]);
    for (int k = 0; k < 3; k++) {
        assert_int_equal(heads->one[k].last_station, last[k]);
        assert_int_equal(of_cfg(heads->one[k].cfg), k);
    }
    assert_ptr_equal(heads_site(heads), &site_of[0]);
    struct sh_err err;
    assert_int_equal(heads_prepare(heads, 3, &err), SH_OK);
    assert_int_equal(heads_prepare(heads, 0, &err), SH_OK); /* where it stands at power-up */
    assert_string_equal(trace, "prepare:0:2 prepare:0:3 ");
    end();
}

/* Stations count on beyond the last one: 6 is the first again. */
static void turns_and_configurations(void **state)
{
    static const struct {
        uint32_t first, last, turns;
        const char *heads;
    } rows[] = {{0, 0, 1, "0"},   {0, 9, 1, "0"},   {1, 1, 1, "0"}, {2, 3, 1, "1"},  {1, 5, 4, "012"},
                {3, 5, 3, "012"}, {4, 7, 4, "012"}, {5, 5, 1, "2"}, {6, 8, 2, "01"}, {5, 6, 2, "02"}};
    (void)state;
    begin();
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char found[8] = "";
        const struct config *one;
        assert_int_equal(heads_turns(heads, rows[i].first, rows[i].last), rows[i].turns);
        for (uint32_t k = 0; (one = heads_config(heads, k, rows[i].first, rows[i].last)) != NULL && k < 7; k++)
            found[k] = (char)('0' + of_cfg(one));
        assert_string_equal(found, rows[i].heads);
    }
    end();
}

/* All are set up before the first scan. A head ends after its last station, but the first one stays. */
static void from_all_stations(void **state)
{
    struct recording_options options = {
        .first_station = 1, .last_station = N, .hash = 1, .progress = 1, .second = second, .ctx = &cfg};
    struct recording_result result;
    struct sh_err err;
    (void)state;
    begin();
    assert_int_equal(heads_record(heads, &options, &result, &err), SH_OK);
    assert_string_equal(trace,
                        "fits:0:1 fits:0:4 load:1 fits:1:2 fits:1:3 free:1 load:2 fits:2:5 free:2 warnings "
                        "hash:0 run:0:1-1/1-5 beside:1 hash:1 run:1:2-3/1-5 stop:1 run:0:4-4/1-5 beside:2 hash:2 "
                        "run:2:5-5/1-5 stop:2 ");
    assert_int_equal(n_seconds, 4);
    assert_int_equal(result.frames, 1 + 2 + 4 + 5);
    assert_true(result.stream.bytes == 6 && result.stream.frames == 60 && result.stream.bad_unseen == 600);
    assert_true(result.wall_s > 2.7999 && result.wall_s < 2.8001);
    assert_ptr_equal(heads_site(heads), &site_of[2]);
    assert_string_equal(progress, "recording from station 4 of 5: 0.60\n"); /* 1.4 s after the first one */
    end();
}

/* The hash is that of all hashes as text, one after the other. */
static void the_hash(void **state)
{
    struct recording_options options = {.first_station = 1, .last_station = N, .hash = 1};
    struct recording_result result;
    struct sha256_ctx ctx;
    uint8_t digest[SHA256_DIGEST_SIZE], text[3 * 64];
    char hex[65] = "";
    struct sh_err err;
    (void)state;
    for (int k = 0; k < 3; k++)
        memset(text + 64 * k, '0' + k, 64);
    sha256_init(&ctx);
    sha256_update(&ctx, sizeof text, text);
    sha256_digest(&ctx, sizeof digest, digest);
    base16_encode_update(hex, sizeof digest, digest);
    begin();
    assert_int_equal(heads_record(heads, &options, &result, &err), SH_OK);
    assert_string_equal(result.sha256, hex);
    assert_string_equal(progress, "");
    end();
    options.hash = 0;
    begin();
    assert_int_equal(heads_record(heads, &options, &result, &err), SH_OK);
    assert_string_equal(result.sha256, "");
    assert_null(strstr(trace, "hash"));
    end();
}

/* Where the first station has another scanner, its head is opened at once. Stations that are not scanned are not asked
 * about. */
static void from_some_stations(void **state)
{
    struct recording_options options = {.first_station = 3, .last_station = 4};
    struct recording_result result;
    struct sh_err err;
    (void)state;
    begin();
    assert_int_equal(heads_record(heads, &options, &result, &err), SH_OK);
    assert_string_equal(trace, "fits:0:4 beside:1 fits:1:3 warnings run:1:3-3/3-4 stop:1 run:0:4-4/3-4 ");
    assert_true(result.stream.bytes == 3); /* of two heads */
    end();
    begin(); /* a head with later stations stays */
    options = (struct recording_options){.first_station = 4, .last_station = N};
    heads->fits = NULL;
    assert_int_equal(heads_record(heads, &options, &result, &err), SH_OK);
    assert_string_equal(trace, "load:2 free:2 warnings run:0:4-4/4-5 beside:2 run:2:5-5/4-5 stop:2 ");
    end();
    begin();
    for (uint32_t first = 1; first <= 5; first += 4) {
        options = (struct recording_options){.first_station = first, .last_station = 6};
        assert_int_equal(heads_record(heads, &options, &result, &err), SH_EINPUT);
        assert_string_equal(err.text, "head.yaml: there is no station 6; allowed 1 to 5");
    }
    assert_string_equal(trace, "");
    end();
}

/* Without stations the head scans where it is set to stand, by a single recording. */
static void from_its_own_station(void **state)
{
    struct recording_options options = {.hash = 1};
    struct recording_result result;
    struct sh_err err;
    (void)state;
    begin();
    assert_int_equal(heads_record(heads, &options, &result, &err), SH_OK);
    assert_string_equal(trace, "fits:0:4 run:0:0-0/0-0# ");
    fails = "fits:0:4";
    assert_int_equal(heads_record(heads, &options, &result, &err), SH_EIO);
    end();
    begin(); /* a single scanner goes from station to station */
    options = (struct recording_options){.first_station = 1, .last_station = 4};
    heads->n = 1;
    memset(heads->head_of, 0, sizeof heads->head_of);
    assert_int_equal(heads_record(heads, &options, &result, &err), SH_OK);
    assert_string_equal(trace, "fits:0:1 fits:0:2 fits:0:3 fits:0:4 run:0:1-4/0-0 ");
    assert_int_equal(heads_turns(heads, 1, 5), 1);
    assert_ptr_equal(heads_config(heads, 0, 2, 3), &cfg);
    assert_null(heads_config(heads, 1, 2, 3));
    heads->n = 3;
    end();
}

static void each_step_may_fail(void **state)
{
    static const struct {
        const char *step, *trace;
    } rows[] = {
        {"fits:0:4", "fits:0:1 fits:0:4 warnings "},
        {"load:1", "fits:0:1 fits:0:4 load:1 free:1 warnings "},
        {"fits:1:2", "fits:0:1 fits:0:4 load:1 fits:1:2 free:1 warnings "},
        {"run:0:1-1/1-4", "fits:0:1 fits:0:4 load:1 fits:1:2 fits:1:3 free:1 warnings run:0:1-1/1-4 "},
        {"beside:1", "fits:0:1 fits:0:4 load:1 fits:1:2 fits:1:3 free:1 warnings run:0:1-1/1-4 beside:1 "},
        {"second", "fits:0:1 fits:0:4 load:1 fits:1:2 fits:1:3 free:1 warnings run:0:1-1/1-4 beside:1 run:1:2-3/1-4 "
                   "second stop:1 "},
    };
    struct recording_options options = {.first_station = 1, .last_station = 4, .second = second, .ctx = &cfg};
    struct recording_result result;
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char text[64];
        struct sh_err err;
        begin();
        fails = rows[i].step;
        assert_int_equal(heads_record(heads, &options, &result, &err), SH_EIO);
        assert_string_equal(trace, rows[i].trace);
        snprintf(text, sizeof text, "%s failed", rows[i].step);
        assert_string_equal(err.text, text);
        fails = NULL;
        end();
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_scanner_has_a_head), cmocka_unit_test(turns_and_configurations),
        cmocka_unit_test(from_all_stations),       cmocka_unit_test(the_hash),
        cmocka_unit_test(from_some_stations),      cmocka_unit_test(from_its_own_station),
        cmocka_unit_test(each_step_may_fail),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
