/* SPDX-License-Identifier: MIT */
/* The recording of `record --raw`, whatever the source is. */
#include <errno.h>
#include <netinet/in.h>
#include <string.h>

#include "firmware_sim/app/studio/record/raw.h"
#include "firmware_sim/base/clock.h"

enum { POLL_MS = 200 };
static const int64_t SECOND_NS = 1000000000;

int raw_write(struct raw *r, const struct capture_frame *frame, size_t payload, struct sh_err *err)
{
    if (r->first_ns == 0) r->first_ns = clock_now_ns();
    r->bytes += payload;
    r->last_t_ns = frame->t_ns;
    return capture_add(&r->capture, frame, err);
}

struct ethernet_end raw_end_of(const struct sockaddr_storage *at)
{
    struct ethernet_end end = {.is_v6 = at->ss_family == AF_INET6};
    if (end.is_v6) {
        const struct sockaddr_in6 *six = (const void *)at;
        memcpy(end.address, &six->sin6_addr, 16);
        end.port = ntohs(six->sin6_port);
    } else {
        const struct sockaddr_in *four = (const void *)at;
        memcpy(end.address, &four->sin_addr, 4);
        end.port = ntohs(four->sin_port);
    }
    return end;
}

static void put_ready(struct json *json, const void *ctx)
{
    const struct raw *r = ctx;
    json_open_object(json, NULL);
    json_string(json, "endpoint", r->endpoint);
    json_close_object(json);
}

static void put_stats(struct json *json, const void *ctx)
{
    const struct raw *r = ctx;
    json_open_object(json, NULL);
    json_uint(json, "packets", r->capture.packets);
    json_uint(json, "bytes", r->bytes);
    json_uint(json, "dropped", r->ops->dropped(r));
    r->ops->put(json, r);
    json_double(json, "wall_s", r->wall_s);
    json_double(json, "cpu_s", clock_cpu_s());
    json_close_object(json);
}

/* The first packet is waited for as long as --wait says, else --duration. Once it is there, the duration counts from
 * it. */
static int64_t deadline_of(const struct raw *r, int64_t begin_ns)
{
    const double first_s = r->wait_s > 0.0 ? r->wait_s : r->duration_s;
    if (r->first_ns == 0) return first_s > 0.0 ? begin_ns + (int64_t)(1e9 * first_s) : INT64_MAX;
    return r->duration_s > 0.0 ? r->first_ns + (int64_t)(1e9 * r->duration_s) : INT64_MAX;
}

static void raw_run_describe(const struct raw *r, char *text, size_t len)
{
    const uint64_t dropped = r->ops->dropped(r);
    const int n =
        snprintf(text, len, "%llu packets, %.3f MB", (unsigned long long)r->capture.packets, 1e-6 * (double)r->bytes);
    if (dropped != 0) snprintf(text + n, len - (size_t)n, ", %llu dropped", (unsigned long long)dropped);
}

/* Reports once a second, and saves: the packets so far are in the file then. */
static int raw_run_report(struct raw *r, int64_t now_ns, int64_t *next_ns, struct sh_err *err)
{
    char what[112] = "recording: ";
    if (now_ns < *next_ns) return SH_OK;
    *next_ns = now_ns + SECOND_NS;
    raw_run_describe(r, what + strlen(what), sizeof what - strlen(what));
    const double done =
        r->duration_s > 0.0 && r->first_ns != 0 ? 1e-9 * (double)(now_ns - r->first_ns) / r->duration_s : -1.0;
    sh_progress(&app_report_stderr, what, done < 1.0 ? done : 1.0);
    return capture_save(&r->capture, err);
}

static int wait_until(struct raw *r, int64_t now_ns, int64_t end_ns)
{
    struct pollfd fds[RAW_MAX_POLLS];
    const int64_t left_ms = (end_ns - now_ns) / 1000000 + 1;
    int timeout_ms = left_ms < POLL_MS ? (int)left_ms : POLL_MS;
    const int n = r->ops->wait_for(r, fds, &timeout_ms);
    return poll(fds, (nfds_t)n, timeout_ms) >= 0 || errno == EINTR ? SH_OK : SH_EIO;
}

static int raw_run_follow(struct raw *r, struct sh_err *err)
{
    const int64_t begin_ns = clock_now_ns();
    int64_t next_ns = begin_ns + SECOND_NS, now_ns;
    int rc = SH_OK;
    while (!r->over && !app_interrupted() && (now_ns = clock_now_ns()) < deadline_of(r, begin_ns)) {
        if (wait_until(r, now_ns, deadline_of(r, begin_ns)) != SH_OK)
            return sh_fail(err, SH_EIO, "%s: cannot wait: %s", r->in.operand[0], strerror(errno));
        rc = r->ops->work(r, err);
        if (rc >= 0) rc = raw_run_report(r, clock_now_ns(), &next_ns, err);
        if (rc < 0) return rc;
    }
    /* Packets that the system holds now came before the end, so they are written. As more may come all the time, this
     * has a limit. */
    for (const int64_t stop_ns = clock_now_ns() + SECOND_NS; rc >= 0 && !r->over && clock_now_ns() < stop_ns;)
        if ((rc = r->ops->work(r, err)) == 0) break;
    r->wall_s = 1e-9 * (double)(clock_now_ns() - (r->first_ns != 0 ? r->first_ns : begin_ns));
    return rc < 0 ? rc : r->ops->finish(r, err);
}

static int record(struct raw *r, struct sh_err *err)
{
    struct stamped_socket keeper;
    stamped_begin(&keeper);
    int rc = r->ops->open(r, err);
    if (rc == SH_OK) rc = app_say_ready(r->ready_fd, put_ready, r, err);
    if (rc == SH_OK) rc = raw_run_follow(r, err);
    stamped_close(&keeper);
    return rc;
}

static int check_any(const struct raw *r, struct sh_err *err)
{
    if (r->capture.packets != 0) return SH_OK;
    return sh_fail(err, SH_ETIMEOUT, "%s: no packet came; %s is not written", r->in.operand[0], r->path);
}

/* Like other recordings, one that failed keeps the packets that came. */
int raw_run(struct raw *r, struct sh_err *err)
{
    struct sh_err why = {0};
    int rc = capture_open(&r->capture, r->path, err);
    if (rc != SH_OK) {
        capture_close(&r->capture, 0, NULL);
        return rc;
    }
    rc = record(r, err);
    const int has_figures = r->capture.packets != 0 || rc == SH_OK;
    if (rc == SH_OK) rc = check_any(r, err);
    int after = capture_close(&r->capture, r->capture.packets != 0, &why);
    rc = app_and_also(rc, after, &why, err);
    if (after != SH_OK) outfile_say_left(r->path, &app_report_stderr);
    if (rc == SH_OK) rc = r->ops->check(r, err);
    char text[96];
    raw_run_describe(r, text, sizeof text);
    if (r->capture.packets != 0 && after == SH_OK && !r->quiet) fprintf(stderr, "scanhead: %s in %s\n", text, r->path);
    if (has_figures && r->stats != NULL) {
        after = app_write_json(r->stats, put_stats, r, &why);
        rc = app_and_also(rc, after, &why, err);
    }
    r->ops->close(r);
    return rc;
}
