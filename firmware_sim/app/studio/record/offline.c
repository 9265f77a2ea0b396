/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/record/offline.h"

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/host/source.h"
#include "drivers/link/memory.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/loop/loop.h"

/* The longer this time, the slower lines can be that are cast together (firmware_sim/loop/casters.c). */
static const double AHEAD_MS = 256.0;
enum { SETTLE_MS = 5 }; /* between two looks at a head that comes to rest */

int offline_connect(const char *who, struct link_spec *link, struct scanhead **sh, struct sh_err *err)
{
    int fd[2];
    char source[32], why[256];
    link->type = LINK_FD;
    link->fd = -1;
    snprintf(link->path, sizeof link->path, "%s", who);
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, fd) != 0)
        return sh_fail(err, SH_EIO, "socket pair: %s", strerror(errno));
    snprintf(source, sizeof source, "fd:%d", fd[1]);
    const int rc = scanhead_open(source, sh, why, sizeof why);
    if (rc == SCANHEAD_OK) {
        link->fd = fd[0];
        return fd[1];
    }
    close(fd[0]);
    close(fd[1]);
    return sh_fail(err, rc, "%s: %s", who, why);
}

int offline_load(struct config *cfg, const struct site *beside, const struct sh_report *report, struct site **site,
                 struct sh_err *err)
{
    cfg->loop.pace = PACE_FAST;
    cfg->loop.ahead_ms = fmax(cfg->loop.ahead_ms, AHEAD_MS);
    cfg->n_links = 0;
    return site_load_for(cfg, SITE_FOR_SCANS, beside, report, site, err);
}

/* ---- the client's end of a memory link, as a source of the library */

static struct link_memory *memory_of(const struct host_source *source)
{
    return ((const struct offline *)source->ctx)->memory;
}

static ssize_t offline_lend(struct host_source *source, const uint8_t **bytes)
{
    struct link_memory *memory = memory_of(source);
    const size_t n = memory_take(memory, bytes);
    if (n != 0 || memory->over) return (ssize_t)n;
    errno = EAGAIN;
    return -1;
}

/* A head that comes to rest has time pass, tick by tick. A command before its last tick would find another device time
 * in each run, and so would the scan that it starts. */
static int takes_commands(const struct offline *off)
{
    return off->memory->over || off->loop == NULL || !loop_settles(off->loop);
}

static ssize_t offline_write(struct host_source *source, const void *data, size_t len)
{
    struct link_memory *memory = memory_of(source);
    const size_t n = memory->over || !takes_commands(source->ctx) ? 0 : memory_send(memory, data, len);
    if (n != 0) return (ssize_t)n;
    errno = memory->over ? EPIPE : EAGAIN;
    return -1;
}

/* A signal ends no wait: the caller looks for signals between two waits. */
static int offline_wait(struct host_source *source, short events, int64_t deadline_ns, short *revents)
{
    struct link_memory *memory = memory_of(source);
    for (int is_late = 0;; is_late = host_deadline_ns(0) >= deadline_ns) {
        const int64_t left_ms = (deadline_ns - host_deadline_ns(0) + 999999) / 1000000;
        const int64_t most_ms =
            (events & POLLOUT) != 0 ? SETTLE_MS : INT32_MAX; /* a tick without frames wakes nobody */
        *revents = memory->n_taken != memory->n_pieces || memory->over ? POLLIN : 0;
        if (memory->sent_len < sizeof memory->sent && takes_commands(source->ctx)) *revents |= POLLOUT;
        *revents &= events;
        if (*revents != 0 || is_late) return *revents != 0;
        memory_turn(memory, (int)(left_ms < 0 ? 0 : left_ms < most_ms ? left_ms : most_ms));
    }
}

static void offline_leave(struct host_source *source)
{
    memory_leave(memory_of(source));
}

static const struct host_source_ops offline_ops = {
    .lend = offline_lend, .write = offline_write, .wait = offline_wait, .close = offline_leave};

int offline_open(struct config *cfg, const struct site *beside, double scan_s, const struct sh_report *report,
                 struct offline *off, struct sh_err *err)
{
    struct device_options device = {.scan_s = scan_s, .truth = off->truth};
    off->shares_site = off->site != NULL;
    int rc = off->shares_site ? SH_OK : offline_load(cfg, beside, report, &off->site, err);
    if (rc != SH_OK) return rc;
    off->memory = calloc(1, sizeof *off->memory);
    const struct link_spec spec = {.type = LINK_MEMORY, .memory = off->memory};
    const struct loop_options options = {.extra = &spec, .report = report};
    const struct host_source source = {.ops = &offline_ops, .fd = -1, .ctx = off, .name = "off line"};
    if (off->memory == NULL || (off->sh = host_open(&source)) == NULL)
        return sh_fail(err, SH_ENOMEM, "no memory for a head off line");
    rc = device_create(off->site, &device, &off->device, err);
    if (rc == SH_OK) rc = loop_create(off->site, off->device, &options, &off->loop, err);
    return rc == SH_OK ? loop_start(off->loop, err) : rc;
}

static void end_loop(struct offline *off)
{
    struct loop_stats stats;
    if (off->loop != NULL) {
        loop_end(off->loop);
        loop_join(off->loop, &stats);
    }
    loop_free(off->loop);
    off->loop = NULL;
}

static void offline_end(struct offline *off)
{
    end_loop(off);
    device_free(off->device);
    if (!off->shares_site) site_free(off->site);
    off->device = NULL;
    off->site = NULL;
}

int offline_finish(struct offline *off, struct sh_err *err)
{
    if (off->sh != NULL) host_hang_up(off->sh); /* a loop that waited for this client goes on */
    end_loop(off);
    return off->device != NULL ? device_close_journal(off->device, err) : SH_OK;
}

void offline_stop(struct offline *off)
{
    if (off->sh != NULL) host_hang_up(off->sh); /* a loop that waited for this client goes on */
    offline_end(off);
}

void offline_close(struct offline *off)
{
    if (off->sh != NULL) scanhead_close(off->sh); /* a loop that waited for this client goes on */
    off->sh = NULL;
    offline_end(off);
    free(off->memory);
    off->memory = NULL;
}
