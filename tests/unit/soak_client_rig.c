/* SPDX-License-Identifier: MIT */
#include "tests/unit/soak_client_rig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/link/link.h"
#include "firmware_sim/app/studio/soak/client.h"
#include "firmware_sim/app/studio/soak/datagrams.h"
#include "firmware_sim/app/studio/soak/ledger.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/loop/loop.h"
#include "tests/unit/clock_rig.h"

struct config cfg;
struct soak soak;
struct soak_link *const at = &soak.link[0];
struct scanhead *const handle = (struct scanhead *)&cfg;
const struct turn *turns;
uint64_t frames_in_stats, reader_lost, top;

static int64_t now_ms(void)
{
    return clock_rig_ns / MS;
}

static const struct turn *take_turn(void)
{
    static const struct turn last = {.rc = SCANHEAD_ECLOSED};
    const struct turn *turn = turns->rc == 1 ? &last : turns++;
    clock_rig_ns += turn->ms * MS;
    if (turn == &last) atomic_store(&soak.phase, SOAK_ENDS);
    if (turn->after != NULL) turn->after();
    return turn;
}

/* Says whether the caller holds the lock, as it should. */
static void say_lock(int held)
{
    const int is_free = pthread_mutex_trylock(&at->lock) == 0;
    if (is_free) pthread_mutex_unlock(&at->lock);
    if (is_free == held) say("LOCK ");
}

int scanhead_open(const char *source, struct scanhead **out, char *err, size_t err_len)
{
    const struct turn *turn = take_turn();
    (void)err; /* nobody reads why the head is not there */
    (void)err_len;
    say("open:%s=%d ", source, turn->rc);
    if (turn->rc == SCANHEAD_OK) *out = handle;
    return turn->rc;
}

int scanhead_reattach(struct scanhead *sh, int timeout_ms)
{
    const struct turn *turn = take_turn();
    say("reattach:%d=%d%s ", timeout_ms, turn->rc, sh == handle ? "" : "!");
    return turn->rc;
}

int scanhead_next(struct scanhead *sh, struct scanhead_frame *frame, int timeout_ms)
{
    const struct turn *turn = take_turn();
    if (sh != handle || timeout_ms != 50) say("NEXT:%d ", timeout_ms);
    *frame = (struct scanhead_frame){.type = turn->type};
    return turn->rc;
}

void scanhead_on_notice(struct scanhead *sh, void (*fn)(void *ctx, const struct scanhead_notice *notice), void *ctx)
{
    say(sh == handle && fn == soak_saw_notice && ctx == at ? "listen " : "LISTEN ");
}

void scanhead_get_stats(const struct scanhead *sh, struct scanhead_stats *stats)
{
    (void)sh;
    *stats = (struct scanhead_stats){.frames = frames_in_stats, .reader_lost = reader_lost, .dropped = 2 * reader_lost};
}

const char *scanhead_error(const struct scanhead *sh)
{
    return sh == handle ? "it broke" : "?";
}

void scanhead_close(struct scanhead *sh)
{
    say(sh == handle ? "close " : "close:none ");
}

void soak_saw_open(struct soak_link *link)
{
    (void)link;
    say_lock(0);
    say("saw_open@%lld ", (long long)now_ms());
}

void soak_saw_no_open(struct soak_link *link)
{
    (void)link;
    say_lock(0);
    say("no_open@%lld ", (long long)now_ms());
}

void soak_saw_end(struct soak_link *link)
{
    (void)link;
    say_lock(0);
    say("end@%lld ", (long long)now_ms());
}

void soak_saw_frame(struct soak_link *link, const struct scanhead_frame *frame, int64_t now_ns)
{
    link->frames++;
    say_lock(0);
    if (now_ns != clock_rig_ns) say("NOW ");
    say("%s@%lld ", frame->type == SCANHEAD_POINTS ? "points" : "line", (long long)now_ms());
}

void soak_saw_inside(struct soak_link *link, const struct scanhead_frame *frame)
{
    if (link != at || (frame->type != SCANHEAD_LINE_END && frame->type != SCANHEAD_POINTS)) say("INSIDE ");
    say("inside ");
}

void soak_saw_notice(void *link, const struct scanhead_notice *notice)
{
    (void)link;
    (void)notice;
}

void soak_ask_next(struct soak_link *link)
{
    if (link == at) say("ask@%lld ", (long long)now_ms());
}

void soak_ask_scan(struct soak_link *link)
{
    if (link == at) say("scan@%lld ", (long long)now_ms());
}

int soak_usb_is_here(const struct link_spec *spec)
{
    return spec->attach;
}

void soak_usb_source(const struct link_spec *spec, char *source, size_t len)
{
    snprintf(source, len, "usb:%s", spec->serial);
}

void soak_usb_opened(struct soak_plugs *plugs, struct soak_row *row, const char *source, double opened_ms)
{
    say_lock(1);
    if (plugs != &at->plugs || row != at->row || source != at->source) say("PLUGS ");
    say("opened:%g ", opened_ms);
}

uint64_t soak_datagrams_top(struct soak_link *link)
{
    (void)link;
    say("top ");
    return top;
}

void soak_datagrams_step(struct soak_link *link)
{
    take_turn();
    say("step:%llu%s ", (unsigned long long)link->last, atomic_load(&link->done) ? ",done" : "");
}

void soak_datagrams_finish(struct soak_link *link)
{
    (void)link;
    say("finish ");
}

void soak_datagrams_close(struct soak_datagrams *datagrams)
{
    say(datagrams != NULL ? "datagrams " : "datagrams:none ");
}

static struct link_place places[CONFIG_MAX_LINKS];
static uint32_t n_places;

int loop_get_place(const struct loop *loop, uint32_t i, struct link_place *place)
{
    if (loop != (const struct loop *)&cfg || i >= n_places) return 0;
    *place = places[i];
    return 1;
}

int make_soak(void **unused)
{
    (void)unused;
    memset(&soak, 0, sizeof soak);
    memset(&cfg, 0, sizeof cfg);
    memset(places, 0, sizeof places);
    soak.cfg = &cfg;
    strcpy(cfg.file, "head.yaml");
    trace[0] = '\0';
    clock_rig_ns = 1000 * MS;
    frames_in_stats = reader_lost = 0;
    n_places = 0;
    return 0;
}

void add_place(const char *type, const char *endpoint, const char *protocol)
{
    struct link_place *place = &places[n_places++];
    *place = (struct link_place){.type = type, .protocol = protocol};
    strcpy(place->endpoint, endpoint);
    soak.n_links = n_places;
}

int open_all(uint32_t only, struct sh_err *err)
{
    return soak_clients_open(&soak, (const struct loop *)&cfg, only, err);
}
