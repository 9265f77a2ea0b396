/* SPDX-License-Identifier: MIT */
/* Serves a head, or a recording in its place, until the end, and writes statistics. */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>

#include "firmware_sim/app/run/run.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/base/notify.h"
#include "firmware_sim/config/config.h"

enum { VIEW_SESSIONS = 4 };

static int add_view(struct config *cfg, struct sh_err *err)
{
    for (uint32_t i = 0; i < cfg->n_links; i++)
        if (cfg->link[i].type == LINK_WEB) return SH_OK;
    if (cfg->n_links == CONFIG_MAX_LINKS)
        return sh_fail(err, SH_EINPUT, "%s: links: with --view there is one more than the allowed %d", cfg->file,
                       (int)CONFIG_MAX_LINKS);
    cfg->link[cfg->n_links++] = (struct link_spec){.type = LINK_WEB, .max_sessions = VIEW_SESSIONS};
    return SH_OK;
}

int run_complete_links(const struct run_options *o, struct config *cfg, struct sh_err *err)
{
    if (o->view) return add_view(cfg, err);
    if (cfg->n_links != 0) return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "%s: links: none; run needs at least one of pty, tcp, udp, usb, web, file, null, or --view",
                   cfg->file);
}

void run_say_links(const struct loop *loop)
{
    struct link_place place;
    for (uint32_t i = 0; loop_get_place(loop, i, &place); i++)
        if (strcmp(place.type, "fd") != 0) /* within this process */
            app_say("link %s%s%s", place.endpoint, place.protocol != NULL ? ", " : "",
                    place.protocol != NULL ? place.protocol : "");
}

static void put_endpoints(struct json *json, const void *loop)
{
    loop_put_endpoints(loop, json);
}

static int say_view(const struct loop *loop, struct sh_err *err)
{
    struct link_place place;
    for (uint32_t i = 0; loop_get_place(loop, i, &place); i++)
        if (strcmp(place.type, "web") == 0) printf("%s\n", place.endpoint);
    return fflush(stdout) == 0 ? SH_OK : sh_fail(err, SH_EIO, "standard output: %s", strerror(errno));
}

/* Reports to the service manager that the links are open: services that depend on this head wait for that. */
static int notify_ready(const struct loop *loop, struct sh_err *err)
{
    enum { ROOM = 64 + (CONFIG_MAX_LINKS + 1) * (int)sizeof(struct link_place) }; /* + 1: a link of the page's own */
    struct link_place place;
    char text[ROOM] = "READY=1\nSTATUS=links open:";
    size_t n = strlen(text);
    if (!notify_is_wanted()) return SH_OK;
    for (uint32_t i = 0; loop_get_place(loop, i, &place); i++) {
        if (strcmp(place.type, "fd") == 0) continue; /* within this process */
        sh_keep_line(place.endpoint);
        n += (size_t)snprintf(text + n, sizeof text - n, " %s", place.endpoint);
    }
    return notify_send(text, err);
}

/* Reports that the run is ending. Until it is over, links still write what their readers take. */
static void notify_stopping(void)
{
    struct sh_err err;
    if (notify_send("STOPPING=1\nSTATUS=ending", &err) != SH_OK) sh_warn(&app_report_stderr, "%s", err.text);
}

static void wait_for_end(struct loop *loop)
{
    int ending = 0;
    while (!loop_is_over(loop)) {
        if (app_interrupted() && !ending) {
            ending = 1;
            notify_stopping();
            loop_end(loop);
        }
        poll(NULL, 0, 20); /* ends early on a signal */
    }
    if (!ending) notify_stopping();
}

struct run_stats {
    const struct loop *loop;
    struct loop_stats stats;
};

static void put_pulses(struct json *json, const struct device_counters *c)
{
    json_uint(json, "pulses", c->pulses);
    json_uint(json, "fired_pulses", c->fired);
    json_uint(json, "blind_pulses", c->fired - c->cast);
    json_uint(json, "cast_pulses", c->cast);
    json_uint(json, "lost_pulses", c->lost_pulses);
    json_uint(json, "lost_ticks", c->lost_ticks);
}

/* Writes percentiles, and a histogram: a member for each octave that is not empty, named by its upper bound in ns. */
static void put_lateness(struct json *json, const char *name, const struct lateness *lateness)
{
    static const struct {
        const char *name;
        double q;
    } percentile[] = {{"p50", 0.5}, {"p99", 0.99}, {"p999", 0.999}, {"max", 1.0}};
    uint64_t below_ns, count;
    char key[32];
    for (size_t i = 0; i < sizeof percentile / sizeof *percentile; i++) {
        snprintf(key, sizeof key, "%s_%s_us", name, percentile[i].name);
        json_double(json, key, lateness_us(lateness, percentile[i].q));
    }
    snprintf(key, sizeof key, "%s_below_ns", name);
    json_open_object(json, key);
    for (uint32_t i = 0; lateness_row(lateness, i, &below_ns, &count); i++) {
        if (count == 0) continue;
        snprintf(key, sizeof key, "%llu", (unsigned long long)below_ns);
        json_uint(json, key, count);
    }
    json_close_object(json);
}

static void put_stats(struct json *json, const void *ctx)
{
    const struct run_stats *run = ctx;
    const struct loop_stats *s = &run->stats;
    const struct device_counters *c = &s->counters;
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    json_open_object(json, NULL);
    put_pulses(json, c);
    json_uint(json, "echoes", c->echoes);
    json_uint(json, "lines", c->lines);
    json_uint(json, "scans", s->scans);
    json_double(json, "wall_s", s->wall_s);
    json_double(json, "cpu_s", clock_cpu_s());
    json_double(json, "pulses_per_s", s->wall_s > 0.0 ? (double)c->pulses / s->wall_s : 0.0);
    json_uint(json, "crowded_echoes", c->crowded);
    json_uint(json, "faint_hits", c->faint);
    json_uint(json, "unfit_echoes", c->unfit);
    json_uint(json, "lost_samples", c->lost_samples);
    json_uint(json, "reader_lost_frames", c->reader_lost_frames);
    json_uint(json, "reader_lost_pulses", c->reader_lost_pulses);
    json_uint(json, "late_blocks", c->late_blocks);
    json_uint(json, "late_poses", c->late_poses);
    json_uint(json, "bad_poses", c->bad_poses);
    json_uint(json, "lost_journal_lines", c->lost_journal_lines);
    json_uint(json, "lost_truth_lines", c->lost_truth_lines);
    put_lateness(json, "late", s->late);
    put_lateness(json, "wake", s->wake);
    json_int(json, "rss_peak_kib", usage.ru_maxrss);
    json_string(json, "stream_sha256", s->have_hash ? s->sha256 : NULL);
    loop_put_links(run->loop, json);
    json_close_object(json);
}

static void warn_losses(const struct device_counters *c)
{
    if (c->lost_pulses != 0)
        sh_warn(&app_report_stderr, "%llu pulses could not be computed in time", (unsigned long long)c->lost_pulses);
    app_warn_left_out(c->crowded, c->unfit, c->lost_samples);
    app_warn_empty(c->pulses, c->empty, c->faint);
    if (c->reader_lost_frames != 0)
        sh_warn(&app_report_stderr, "readers lost %llu frames with %llu pulses",
                (unsigned long long)c->reader_lost_frames, (unsigned long long)c->reader_lost_pulses);
}

static void warn_lines(const char *file, uint64_t n)
{
    if (n != 0)
        sh_warn(&app_report_stderr, "%s: %llu lines are missing in its file; they could not be written in time", file,
                (unsigned long long)n);
}

/* Closes the journal and the truth. Lines that are missing in them are reported once: as the error, or as a warning. */
static int close_files(struct loop *loop, struct loop_stats *stats, struct sh_err *err)
{
    const int rc = loop_close_files(loop, stats, err);
    if (rc != SH_OK) return rc;
    warn_lines("journal", stats->counters.lost_journal_lines);
    warn_lines("truth", stats->counters.lost_truth_lines);
    return SH_OK;
}

int run_serve(const struct run_options *o, struct loop *loop, struct sh_err *err)
{
    struct run_stats run = {.loop = loop};
    struct loop_stats *stats = &run.stats;
    int rc = app_begin_messages(err);
    if (rc == SH_OK) rc = loop_start(loop, err);
    if (rc == SH_OK) rc = app_say_ready(o->ready_fd, put_endpoints, loop, err);
    if (rc == SH_OK && o->view) rc = say_view(loop, err);
    if (rc == SH_OK) rc = notify_ready(loop, err);
    if (rc == SH_OK)
        wait_for_end(loop);
    else
        loop_end(loop);
    loop_join(loop, stats);
    struct sh_err why = {0};
    const int files_rc = close_files(loop, stats, &why);
    if (rc == SH_OK && o->stats != NULL) rc = app_write_json(o->stats, put_stats, &run, err);
    warn_losses(&stats->counters);
    rc = app_and_also(rc, files_rc, &why, err);
    return rc == SH_OK ? loop_check_links(loop, err) : rc;
}
