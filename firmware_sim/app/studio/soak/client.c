/* SPDX-License-Identifier: MIT */
/* A client for each link, which behaves like a good recorder. The client starts a scan, reads all frames, asks now and
 * then, opens the head again when the connection goes, and starts the scan again when the head has forgotten it. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/host/scanhead.h"
#include "drivers/link/link.h"
#include "firmware_sim/app/studio/soak/ask.h"
#include "firmware_sim/app/studio/soak/client.h"
#include "firmware_sim/app/studio/soak/datagrams.h"
#include "firmware_sim/app/studio/soak/head.h"
#include "firmware_sim/app/studio/soak/ledger.h"
#include "firmware_sim/app/studio/soak/link.h"
#include "firmware_sim/app/studio/soak/soak.h"
#include "firmware_sim/app/studio/soak/usb.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/fault/fault.h"
#include "firmware_sim/loop/loop.h"

enum { NEXT_MS = 50 };
static const int64_t OPEN_EVERY_NS = 20000000, ASK_EVERY_NS = 200000000, POINTS_WITHIN_NS = 500000000;

struct recorder {
    struct soak_link *link;
    int64_t asked_ns, points_ns;
    int ended;
};

/* ---- which links */

/* Why a link has no client here; NULL: it has one. */
static const char *why_not(const struct link_place *place, const struct link_spec *spec)
{
    if (strcmp(place->type, "usb") == 0)
        return soak_usb_is_here(spec) ? NULL
                                      : "only a USB head with backend usbip, attach on and protocol native is attached "
                                        "to this machine";
    if (strcmp(place->type, "udp") == 0) return "its packets go to another place, or their port is taken";
    if (strcmp(place->type, "pty") != 0 && strcmp(place->type, "tcp") != 0) {
        if (strcmp(place->type, "web") == 0) return "libscanhead does not support WebSocket";
        return "nothing answers there";
    }
    if (strncmp(place->endpoint, "tty:/dev/pts/", 13) == 0)
        return "a terminal that disappears and appears again needs a fixed path, links[].path";
    if (place->protocol != NULL && strcmp(place->protocol, "native") != 0)
        return "libscanhead supports only the native protocol";
    return NULL;
}

/* Whether a fault makes the packets of a link begin anew, or stop for a while: they can't be compared then. */
static int begins_anew(const struct soak *soak)
{
    for (uint32_t i = 0; i < soak->faults.n; i++) {
        const enum fault_kind kind = soak->faults.fault[i].kind;
        if (kind == FAULT_POWER_CYCLE || kind == FAULT_UNPLUG || kind == FAULT_CABLE) return 1;
    }
    return 0;
}

static int open_link(struct soak *soak, uint32_t i, const struct link_place *place, uint32_t only)
{
    struct soak_link *link = &soak->link[i];
    link->soak = soak;
    link->number = i + 1;
    snprintf(link->type, sizeof link->type, "%s", place->type);
    snprintf(link->endpoint, sizeof link->endpoint, "%s", place->endpoint);
    snprintf(link->source, sizeof link->source, "%.191s", place->endpoint);
    if (strcmp(place->type, "usb") == 0) soak_usb_source(&soak->cfg->link[i], link->source, sizeof link->source);
    pthread_mutex_init(&link->lock, NULL);
    link->datagrams = soak->datagrams[i];
    link->not_soaked = only != 0 && only != i + 1 ? "not asked for (--link)"
                       : link->datagrams == NULL  ? why_not(place, &soak->cfg->link[i])
                       : begins_anew(soak)
                           ? "its packets restart with power, plug or cable, so they can not be compared"
                           : NULL;
    link->usable = link->not_soaked == NULL;
    if (!link->usable) return 0;
    link->fact = calloc(SOAK_RING, sizeof *link->fact);
    return link->fact != NULL ? 1 : -1;
}

int soak_clients_open(struct soak *soak, const struct loop *loop, uint32_t only, struct sh_err *err)
{
    struct link_place place;
    int n = 0;
    for (uint32_t i = 0; i < soak->n_links && loop_get_place(loop, i, &place); i++) {
        const int is_open = open_link(soak, i, &place, only);
        if (is_open < 0) return sh_fail(err, SH_ENOMEM, "no memory for the clients");
        n += is_open;
    }
    if (n > 0) return SH_OK;
    return sh_fail(
        err, SH_EINPUT,
        "%s: links: soak can use none of them; allowed are pty, tcp and usb (attach on) with protocol native, as "
        "--set links.0.type=tcp",
        soak->cfg->file);
}

/* ---- the thread */

static int is_over(const struct soak_link *link)
{
    const int phase = atomic_load(&link->soak->phase);
    return phase == SOAK_ENDS || (phase == SOAK_DRAINS && atomic_load(&link->done));
}

/* A client is done once it has all frames up to the last fault, and the head scans. */
static void see_whether_done(struct recorder *r)
{
    struct soak_link *link = r->link;
    if (atomic_load(&link->soak->phase) != SOAK_DRAINS || atomic_load(&link->done)) return;
    pthread_mutex_lock(&link->lock);
    const int is_done = link->in_session && link->last >= atomic_load(&link->soak->until);
    pthread_mutex_unlock(&link->lock);
    if (is_done && clock_now_ns() - r->points_ns < POINTS_WITHIN_NS) atomic_store(&link->done, 1);
}

static void give_up(struct recorder *r, const char *why)
{
    snprintf(r->link->failed, sizeof r->link->failed, "%.255s", why);
    r->ended = 1;
}

static void began(struct recorder *r)
{
    struct soak_link *link = r->link;
    r->points_ns = r->asked_ns = clock_now_ns() - ASK_EVERY_NS;
    soak_saw_open(link);
    pthread_mutex_lock(&link->lock);
    link->ask.settling = strcmp(link->type, "pty") == 0;
    pthread_mutex_unlock(&link->lock);
}

/* Tries until the head is there, or the soak ends. The library makes a single attempt in each try, so that a refusal is
 * seen. */
static void open_head(struct recorder *r)
{
    struct soak_link *link = r->link;
    while (atomic_load(&link->soak->phase) != SOAK_ENDS) {
        const int64_t from_ns = clock_now_ns();
        const int rc =
            link->sh == NULL ? scanhead_open(link->source, &link->sh, NULL, 0) : scanhead_reattach(link->sh, 0);
        if (rc == SCANHEAD_OK) {
            scanhead_on_notice(link->sh, soak_saw_notice, link);
            const double opened_ms = 1e-6 * (double)(clock_now_ns() - from_ns);
            pthread_mutex_lock(&link->lock);
            soak_usb_opened(&link->plugs, link->row, link->source, opened_ms);
            pthread_mutex_unlock(&link->lock);
            began(r);
            return;
        }
        soak_saw_no_open(link);
        clock_sleep_until_ns(clock_now_ns() + OPEN_EVERY_NS);
    }
    r->ended = 1;
}

/* The connection is over. */
static void reattach(struct recorder *r)
{
    struct soak_link *link = r->link;
    if (atomic_load(&link->soak->phase) == SOAK_ENDS) {
        r->ended = 1;
        return;
    }
    soak_saw_end(link);
    open_head(r);
}

/* Either the stream ended without a frame, and the connection is over. Or the stream begins with a frame of another
 * version: its notice has counted it. */
static void begin_wrong(struct recorder *r)
{
    struct scanhead_stats stats;
    scanhead_get_stats(r->link->sh, &stats);
    if (stats.frames == 0) reattach(r);
}

static void take_frame(struct recorder *r, const struct scanhead_frame *frame)
{
    const int64_t now_ns = clock_now_ns();
    soak_saw_frame(r->link, frame, now_ns);
    soak_saw_inside(r->link, frame);
    if (frame->type == SCANHEAD_POINTS) r->points_ns = now_ns;
}

static void client_ask(struct recorder *r)
{
    const int64_t now_ns = clock_now_ns();
    if (now_ns - r->asked_ns < ASK_EVERY_NS || atomic_load(&r->link->soak->phase) == SOAK_ENDS) return;
    r->asked_ns = now_ns;
    if (now_ns - r->points_ns > POINTS_WITHIN_NS || r->link->frames == 0)
        soak_ask_scan(r->link);
    else
        soak_ask_next(r->link);
}

static void step(struct recorder *r)
{
    struct scanhead_frame frame;
    const int rc = scanhead_next(r->link->sh, &frame, NEXT_MS);
    switch (rc) {
    case SCANHEAD_OK:
        take_frame(r, &frame);
        break;
    case SCANHEAD_ETIMEOUT:
        break;
    case SCANHEAD_EFORMAT:
        begin_wrong(r);
        break;
    case SCANHEAD_ECLOSED:
    case SCANHEAD_ELOST:
    case SCANHEAD_ERESET:
        reattach(r);
        break;
    default:
        give_up(r, scanhead_error(r->link->sh));
        break;
    }
}

static void *client_compare(void *arg)
{
    struct soak_link *link = arg;
    while (atomic_load(&link->soak->phase) == SOAK_RUNS)
        soak_datagrams_step(link);
    const soak_seq until = soak_datagrams_top(link) + 1; /* the last datagram that a fault can have hit is before it */
    while (atomic_load(&link->soak->phase) != SOAK_ENDS) {
        soak_datagrams_step(link);
        if (link->last >= until) atomic_store(&link->done, 1);
    }
    soak_datagrams_finish(link);
    return NULL;
}

static void *record(void *arg)
{
    struct recorder r = {.link = arg};
    struct soak_link *link = arg;
    open_head(&r);
    while (!r.ended) {
        step(&r);
        see_whether_done(&r);
        if (!r.ended && !is_over(link)) client_ask(&r);
    }
    atomic_store(&link->done, 1);
    return NULL;
}

int soak_clients_start(struct soak *soak, struct sh_err *err)
{
    for (uint32_t i = 0; i < soak->n_links; i++) {
        struct soak_link *link = &soak->link[i];
        if (!link->usable) continue;
        link->running =
            pthread_create(&link->thread, NULL, link->datagrams != NULL ? client_compare : record, link) == 0;
        if (!link->running) return sh_fail(err, SH_EIO, "no thread for the client of link %u", link->number);
    }
    return SH_OK;
}

void soak_clients_join(struct soak *soak)
{
    for (uint32_t i = 0; i < soak->n_links; i++) {
        struct soak_link *link = &soak->link[i];
        if (link->running) pthread_join(link->thread, NULL);
        link->running = 0;
        if (link->sh == NULL) continue;
        struct scanhead_stats stats;
        scanhead_get_stats(link->sh, &stats);
        link->reader_lost = stats.reader_lost;
        link->dropped = stats.dropped;
    }
}

void soak_clients_close(struct soak *soak)
{
    for (uint32_t i = 0; i < soak->n_links; i++) {
        scanhead_close(soak->link[i].sh);
        free(soak->link[i].fact);
        soak_datagrams_close(soak->datagrams[i]);
    }
}
