/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/links.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/digits.h"
#include "drivers/protocol/native.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/loop/pump.h"

/* Returns the bytes per second of the points at the present rates, with one echo per pulse, and one window of its
 * waveform. The result is a lower bound: further echoes and the frames' headers come on top. A command can raise the
 * rates later. If a link can't carry the stream then, it announces what it loses. */
static double stream_rate(const struct links *links, const struct config *cfg)
{
    double point_len = NATIVE_POINT_LEN + (cfg->output.attributes ? NATIVE_ATTRIBUTE_LEN : 0) +
                       (cfg->output.colour != COLOUR_NONE ? NATIVE_COLOUR_LEN : 0);
    return config_cast_hz(cfg) * point_len + links->waves_bytes_s;
}

/* Writes how to reduce the stream to this share of its rate. A head that fires at steps of a turn has no pulse rate of
 * its own. Some heads have no rate that is low enough. */
static void advise(const struct config *cfg, double share, char *text, size_t len)
{
    const struct config_profile *p = &cfg->profile;
    const struct head_settings *s = &cfg->head.settings;
    const int steps = emitter_line_pulses(&p->emitter) != 0;
    const int64_t wanted_uhz = llround((double)(steps ? s->lines_uhz : s->prr_uhz) * share);
    const int64_t lower_uhz = steps ? wanted_uhz : config_rate_below(p, wanted_uhz);
    const int fits =
        steps ? lower_uhz >= p->lines_min_uhz && p->arrangement.n_geometries == 0 : lower_uhz <= wanted_uhz;
    const char *less = s->waves != 0                       ? ", or leave out waveform.send"
                       : cfg->output.attributes            ? ", or leave out output.attributes"
                       : cfg->output.colour != COLOUR_NONE ? ", or leave out output.colour"
                                                           : "";
    if (fits)
        snprintf(text, len, "lower head.%s to %.0f%s", steps ? "lines_hz" : "prr_hz", floor(1e-6 * (double)lower_uhz),
                 less);
    else
        snprintf(text, len, "no rate of the head is low enough; allowed is a faster link%s", less);
}

/* A link of the native protocol that can't carry the stream is refused before it loses any of it. The other protocols
 * are not checked: their rates depend on what clients ask for. Such a link loses whole units, which are counted. */
static int check_capacity(const struct links *links, const struct config *cfg, const struct pump *pump,
                          struct sh_err *err)
{
    struct link_place place;
    char advice[128];
    pump_get_place(pump, &place);
    if (strcmp(place.protocol, "native") != 0) return SH_OK;
    const double capacity = place.bytes_s, rate = stream_rate(links, cfg);
    if (capacity <= 0.0 || capacity >= rate) return SH_OK;
    if (links->source->ops->next != NULL) /* a recording */
        snprintf(advice, sizeof advice, "allowed is %.2g times this speed, or another link",
                 digits_down(capacity / rate, 2));
    else
        advise(cfg, capacity / rate, advice, sizeof advice);
    return sh_fail(err, SH_EINPUT, "link %s: the stream has %.2f MB/s, the link carries %.2f MB/s; %s", place.endpoint,
                   1e-6 * rate, 1e-6 * capacity, advice);
}

static void identify(struct links *links, const struct config *cfg)
{
    struct protocol_identity *id = &links->identity;
    snprintf(id->maker, sizeof id->maker, "%s", cfg->profile.maker);
    snprintf(id->model, sizeof id->model, "%s", cfg->profile.model);
    snprintf(id->firmware, sizeof id->firmware, "%s", cfg->profile.firmware);
    snprintf(id->serial, sizeof id->serial, "%s", cfg->head.serial);
    snprintf(id->name, sizeof id->name, "%s", cfg->head.name);
    id->n_geometries = cfg->profile.arrangement.n_geometries;
    for (uint32_t i = 0; i < id->n_geometries; i++)
        id->geometry[i] = (struct protocol_geometry){cfg->profile.arrangement.geometry[i].lines_uhz,
                                                     cfg->profile.arrangement.geometry[i].steps_per_turn};
    id->spin_up_ns = llround(1e9 * cfg->profile.spin_up_s);
    id->queue_ns = llround(1e6 * cfg->loop.queue_ms);
    config_fill_fields(cfg, &links->fields);
    id->fields = cfg->n_fields + cfg->n_inputs != 0 ? &links->fields : NULL; /* pump_protocol.c: look_back */
}

/* Finds where the packets of a VLP-16 go: its clients read that from its settings, and post it. The first link wins. */
static void find_receiver(struct links *links, const struct config *cfg)
{
    for (uint32_t i = cfg->n_links; i-- > 0;) {
        const struct link_spec *l = &cfg->link[i];
        if (l->type != LINK_UDP) continue;
        if (l->protocol == PROTOCOL_VELODYNE_POSITION) links->position_port = l->port;
        if (l->protocol != PROTOCOL_VELODYNE) continue;
        snprintf(links->data_address, sizeof links->data_address, "%s", l->address);
        links->data_port = l->port;
    }
}

/* Whether the address, as it is written, is one that only this machine reaches. Other machines may reach any other. */
static int is_loopback(const char *address)
{
    return address[0] == '\0' || strncmp(address, "127.", 4) == 0 || strcmp(address, "localhost") == 0 ||
           strcmp(address, "::1") == 0;
}

/* Warns where other machines can reach a link: a head keeps no secret, and a user may not expect that. */
static void warn_open(const struct links *links, const struct link_spec *spec, const struct pump *pump)
{
    struct link_place place;
    if ((spec->type != LINK_TCP && spec->type != LINK_WEB) || spec->protocol == PROTOCOL_NMEA ||
        is_loopback(spec->address))
        return;
    pump_get_place(pump, &place);
    sh_warn(links->report, "link %s: other machines can reach and command it: there is no %spassword", place.endpoint,
            spec->protocol == PROTOCOL_COLA ? "secret " : "");
}

int links_open(struct links *links, const struct config *cfg, const struct link_spec *extra, struct sh_err *err)
{
    int rc = SH_OK;
    identify(links, cfg);
    find_receiver(links, cfg);
    for (uint32_t i = 0; i < cfg->n_links + (extra != NULL) && rc == SH_OK; i++) {
        const struct link_spec *spec = i < cfg->n_links ? &cfg->link[i] : extra;
        rc = pump_open(links, i, spec, &links->pump[i], err);
        if (rc != SH_OK) break;
        links->n++;
        warn_open(links, spec, links->pump[i]);
        rc = check_capacity(links, cfg, links->pump[i], err);
        if (rc == SH_OK) rc = pump_check_stored(links->pump[i], err);
    }
    return rc;
}

int links_start(struct links *links, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t i = 0; i < links->n && rc == SH_OK; i++)
        rc = pump_start(links->pump[i], err);
    return rc;
}

void links_join(struct links *links)
{
    for (uint32_t i = 0; i < links->n; i++)
        pump_join(links->pump[i]);
}

void links_close(struct links *links)
{
    for (uint32_t i = 0; i < links->n; i++)
        pump_close(links->pump[i]);
}
