/* SPDX-License-Identifier: MIT */
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "firmware_sim/app/studio/verdict/watch.h"
#include "firmware_sim/base/clock.h"

/* Returns the number of the session's link, from 1. */
static uint32_t link_of(uint32_t session)
{
    return (session - 1) / LINK_MAX_SESSIONS + 1;
}

/* ---- sessions */

static void add_break(struct watch *w, const struct watch_break *broken)
{
    w->is_short |= !grow(&w->broken, &w->room_broken, w->n_broken + 1, sizeof *w->broken);
    if (!w->is_short) w->broken[w->n_broken++] = *broken;
}

/* A client is back on the link of that number. */
static void come_back(struct watch *w, uint32_t number)
{
    const int64_t now_ns = clock_now_ns();
    for (size_t i = 0; i < w->n_broken; i++)
        if (w->broken[i].link == number && w->broken[i].back_ns == 0) w->broken[i].back_ns = now_ns;
}

static void begin_session(struct watch *w, uint32_t session, int64_t t_ns)
{
    const uint32_t number = link_of(session);
    struct watch_link *link = &w->link[number - 1];
    link->open++;
    link->acted = 0;
    if ((w->must_ask >> (number - 1) & 1) == 0) come_back(w, number);
    if (number != w->chosen) return;
    if (w->first_open_ns == 0) w->first_open_ns = clock_now_ns();
    w->is_short |= !grow(&w->span, &w->room_span, w->n_span + 1, sizeof *w->span);
    if (!w->is_short) w->span[w->n_span++] = (struct watch_span){session, t_ns, INT64_MAX};
}

/* Whether a fault leaves sessions open. The client may then end its own. */
static int leaves_sessions(enum fault_kind kind)
{
    return kind == FAULT_STALL || kind == FAULT_CABLE || kind == FAULT_ENDPOINT_STALL || kind == FAULT_SHORT_PACKETS;
}

/* Whether the fault is why a session ends now. After a fault that leaves sessions open, an end within the limit counts
 * as its effect, and the client has the whole limit again from there. A later end is the client's own. */
static int is_caused(const struct watch *w, const struct watch_link *link, int64_t *over_ns)
{
    const int64_t now_ns = clock_now_ns();
    *over_ns = link->over_ns;
    if (!link->acted) return 0;
    if (!leaves_sessions(link->kind)) return 1;
    if (now_ns > *over_ns) *over_ns = now_ns;
    return now_ns <= link->over_ns + w->limit_ns;
}

static void end_session(struct watch *w, uint32_t session, const char *peer, int64_t t_ns)
{
    const uint32_t number = link_of(session);
    struct watch_link *link = &w->link[number - 1];
    link->open -= link->open != 0;
    for (size_t i = w->n_span; i-- > 0;)
        if (w->span[i].session == session && w->span[i].to_ns == INT64_MAX) w->span[i].to_ns = t_ns;
    struct watch_break broken = {.link = number, .kind = link->kind};
    if (w->is_over || !is_caused(w, link, &broken.over_ns)) return;
    snprintf(broken.peer, sizeof broken.peer, "%s", peer);
    add_break(w, &broken);
}

static void on_session(void *ctx, uint32_t session, int begins, const char *peer, int64_t t_ns)
{
    struct watch *w = ctx;
    if (link_of(session) > w->n_links) return;
    pthread_mutex_lock(&w->lock);
    if (begins)
        begin_session(w, session, t_ns);
    else
        end_session(w, session, peer, t_ns);
    pthread_mutex_unlock(&w->lock);
}

/* ---- requests */

static void keep_printable(char *to, size_t cap, const void *bytes, size_t len)
{
    const unsigned char *p = bytes;
    size_t n = 0;
    for (size_t i = 0; i < len && n + 1 < cap; i++)
        if (isprint(p[i])) to[n++] = (char)p[i];
    to[n] = '\0';
}

static void on_heard(void *ctx, uint32_t session, const void *bytes, size_t len)
{
    struct watch *w = ctx;
    if (link_of(session) > w->n_links) return;
    pthread_mutex_lock(&w->lock);
    w->heard_bytes += len;
    if (w->link[link_of(session) - 1].open != 0) come_back(w, link_of(session));
    keep_printable(w->last, sizeof w->last, bytes, len);
    pthread_mutex_unlock(&w->lock);
}

/* Whether a request was refused because another session had control, or because it conflicted with the head's state or
 * with another setting. A client can't always know that beforehand. */
static int is_of_state(const char *reply)
{
    const int number = strncmp(reply, "ERR ", 4) == 0 ? atoi(reply + 4) : 0;
    return number == CMD_E_PROTECTED || number == CMD_E_SETTINGS;
}

static void on_refused(void *ctx, uint32_t session, const char *line, const char *reply)
{
    struct watch *w = ctx;
    if (link_of(session) > w->n_links) return;
    pthread_mutex_lock(&w->lock);
    if (reply != NULL && is_of_state(reply)) {
        w->wrong_state++;
    } else {
        if (w->wrong < WATCH_REFUSED) {
            char *to = w->refused[w->wrong];
            snprintf(to, sizeof w->refused[0], "'%.60s'%s%.80s", line != NULL ? line : w->last,
                     reply != NULL ? ": " : "", reply != NULL ? reply : "");
        }
        w->wrong++;
    }
    pthread_mutex_unlock(&w->lock);
}

/* ---- faults */

/* Whether a fault ends sessions, or makes the head silent, so that a client may end its own. */
static int ends_sessions(enum fault_kind kind)
{
    return fault_is_act(kind) || kind == FAULT_POWER_CYCLE || kind == FAULT_STALL;
}

/* Notes the fault; the link's thread reports later that sessions have ended. */
static void watch_act(struct watch *w, const struct fault_note *note)
{
    const int64_t over_ns = clock_now_ns() + (int64_t)(1e6 * note->for_ms);
    for (uint32_t i = 0; i < w->n_links; i++) {
        if (note->link != 0 && note->link != i + 1) continue;
        struct watch_link *link = &w->link[i];
        if (link->acted && link->over_ns > over_ns) continue;
        link->acted = 1;
        link->kind = note->kind;
        link->over_ns = over_ns;
    }
}

/* Power is back now, which may be later than the fault said. */
static void power_is_back(struct watch *w)
{
    for (size_t i = 0; i < w->n_broken; i++)
        if (w->broken[i].kind == FAULT_POWER_CYCLE && w->broken[i].back_ns == 0) w->broken[i].over_ns = clock_now_ns();
}

static void watch_spoil(struct watch *w, const struct fault_note *note)
{
    w->is_short |= !grow(&w->spoiled, &w->room_spoiled, w->n_spoiled + 1, sizeof *w->spoiled);
    if (!w->is_short) w->spoiled[w->n_spoiled++] = (struct watch_spoiled){note->session, note->seq};
}

void watch_note(void *ctx, const struct fault_note *note)
{
    struct watch *w = ctx;
    pthread_mutex_lock(&w->lock);
    w->injected += !note->ended;
    w->stalls += note->kind == FAULT_STALL;
    if (note->kind == FAULT_POWER_CYCLE && note->ended)
        power_is_back(w);
    else if (ends_sessions(note->kind))
        watch_act(w, note);
    else if (note->kind == FAULT_REFUSE && note->link != 0)
        add_break(w, &(struct watch_break){.link = note->link, .kind = note->kind, .over_ns = clock_now_ns()});
    else if (note->has_seq && (note->kind == FAULT_DROP || note->kind == FAULT_TRUNCATE))
        watch_spoil(w, note);
    pthread_mutex_unlock(&w->lock);
}

/* ---- for the run */

int watch_is_whole(struct watch *w)
{
    pthread_mutex_lock(&w->lock);
    int whole = w->link[w->chosen - 1].open != 0;
    for (size_t i = 0; i < w->n_broken; i++)
        whole &= w->broken[i].back_ns != 0;
    pthread_mutex_unlock(&w->lock);
    return whole;
}

int64_t watch_over_ns(struct watch *w)
{
    int64_t over_ns = 0;
    pthread_mutex_lock(&w->lock);
    for (size_t i = 0; i < w->n_broken; i++)
        if (w->broken[i].over_ns > over_ns) over_ns = w->broken[i].over_ns;
    pthread_mutex_unlock(&w->lock);
    return over_ns;
}

int64_t watch_first_open_ns(struct watch *w)
{
    pthread_mutex_lock(&w->lock);
    const int64_t first_ns = w->first_open_ns;
    pthread_mutex_unlock(&w->lock);
    return first_ns;
}

void watch_begin(struct watch *w, uint32_t n_links, uint32_t chosen, double limit_s)
{
    memset(w, 0, sizeof *w);
    w->limit_ns = (int64_t)(1e9 * limit_s);
    w->n_links = n_links;
    w->chosen = chosen;
    pthread_mutex_init(&w->lock, NULL);
    w->observer = (struct links_observer){w, on_session, on_heard, on_refused};
}

void watch_end(struct watch *w)
{
    pthread_mutex_lock(&w->lock);
    w->is_over = 1;
    pthread_mutex_unlock(&w->lock);
}

void watch_free(struct watch *w)
{
    free(w->broken);
    free(w->span);
    free(w->spoiled);
    pthread_mutex_destroy(&w->lock);
}
