/* SPDX-License-Identifier: MIT */
/* Checks what a link's protocol needs from the link, the stream, the head and the time. */
#include <stdio.h>

#include "drivers/protocol/native.h"
#include "drivers/protocol/native_encode.h"
#include "drivers/protocol/velodyne.h"
#include "firmware_sim/config/check_links.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"

/* The kinds of links that each protocol works on. */
static const unsigned ways[PROTOCOL_N] = {
    [PROTOCOL_NATIVE] = CFG_KIND(LINK_NULL) | CFG_KIND(LINK_FILE) | CFG_KIND(LINK_PTY) | CFG_KIND(LINK_TCP) |
                        CFG_KIND(LINK_USB) | CFG_KIND(LINK_FD) | CFG_KIND(LINK_WEB),
    [PROTOCOL_NMEA] =
        CFG_KIND(LINK_NULL) | CFG_KIND(LINK_FILE) | CFG_KIND(LINK_PTY) | CFG_KIND(LINK_TCP) | CFG_KIND(LINK_UDP),
    [PROTOCOL_SCIP] = CFG_KIND(LINK_PTY) | CFG_KIND(LINK_TCP) | CFG_KIND(LINK_USB) | CFG_KIND(LINK_FD),
    [PROTOCOL_COLA] = CFG_KIND(LINK_PTY) | CFG_KIND(LINK_TCP) | CFG_KIND(LINK_USB) | CFG_KIND(LINK_FD),
    [PROTOCOL_VELODYNE] = CFG_KIND(LINK_UDP) | CFG_KIND(LINK_FILE) | CFG_KIND(LINK_NULL),
    [PROTOCOL_VELODYNE_POSITION] = CFG_KIND(LINK_UDP) | CFG_KIND(LINK_FILE) | CFG_KIND(LINK_NULL),
    [PROTOCOL_VELODYNE_HTTP] = CFG_KIND(LINK_TCP) | CFG_KIND(LINK_FD),
    [PROTOCOL_CAPTURE] = CFG_KIND(LINK_PTY) | CFG_KIND(LINK_TCP) | CFG_KIND(LINK_UDP),
};

_Static_assert((int)HEAD_MAX_RATES == (int)PROTOCOL_MAX_GEOMETRIES, "geometries");
_Static_assert((int)EMITTER_LINE == (int)NATIVE_EMIT_LINE && (int)EMITTER_PLANAR == (int)NATIVE_EMIT_PLANAR &&
                   (int)EMITTER_BEAMS == (int)NATIVE_EMIT_BEAMS && (int)EMITTER_SPHERE == (int)NATIVE_EMIT_SPHERE &&
                   (int)EMITTER_DIRECTIONS == (int)NATIVE_EMIT_DIRECTIONS,
               "protocols name emitters as the profiles do");

static const char PROTOCOL_KEY[] = "links[].protocol";

static int is_spoken_on(const struct link_spec *link)
{
    return (ways[link->protocol] & CFG_KIND(link->type)) != 0;
}

static const struct protocol_ops *ops_of(const struct link_spec *link)
{
    return protocol_ops_get((enum protocol_id)link->protocol);
}

int cfg_link_that_needs(const struct config *cfg, enum protocol_needs need)
{
    for (uint32_t i = 0; i < cfg->n_links; i++)
        if (is_spoken_on(&cfg->link[i]) && (ops_of(&cfg->link[i])->needs & need) != 0) return (int)i;
    return -1;
}

/* Writes " (line 12)" or " (--set)": where a key, or else its section, is given. buf holds 40. */
static const char *link_protocol_place_of(const struct cfg_reader *rd, const char *path, char *buf)
{
    int line = cfg_where(rd, cfg_find(&rd->table, path), 0);
    if (line == CFG_FROM_SET)
        snprintf(buf, 40, " (--set)");
    else
        snprintf(buf, 40, " (line %d)", line);
    return buf;
}

static void check_stream(struct cfg_reader *rd, const struct config *cfg, uint32_t i, const struct protocol_ops *ops)
{
    char where[40];
    if ((ops->needs & PROTOCOL_NEEDS_POLAR) != 0 && cfg->output.layout != LINE_POLAR && CFG_SOUND(rd, "output.layout"))
        cfg_fail_item(rd, PROTOCOL_KEY, i, "%s needs ranges, but output.layout is geo%s; required is layout: polar",
                      ops->name, link_protocol_place_of(rd, "output.layout", where));
    if ((ops->needs & PROTOCOL_NEEDS_LAST) != 0 && cfg->head.settings.echoes == BEAM_FIRST)
        cfg_fail_item(rd, PROTOCOL_KEY, i,
                      "%s has no first echoes, but beam.echoes is first%s; required is all, last or strongest",
                      ops->name, link_protocol_place_of(rd, "beam.echoes", where));
}

static int has_kind(const struct protocol_ops *ops, const struct emitter *emitter)
{
    return ops->emitters == 0 || (ops->emitters & 1u << emitter->kind) != 0;
}

static int has_beams(const struct protocol_ops *ops, const struct emitter *emitter)
{
    return emitter->kind != EMITTER_BEAMS || ops->n_beams == 0 || ops->n_beams == emitter->n_beams;
}

void config_describe_emitter(const struct emitter *from, struct native_emitter *e, struct native_beam *beam)
{
    *e = (struct native_emitter){.kind = from->kind, /* the same numbers, as asserted above */
                                 .n_beams = from->n_beams,
                                 .steps = from->steps,
                                 .first_step = (int32_t)from->first_step,
                                 .last_step = (int32_t)from->last_step,
                                 .front_step = (int32_t)from->front_step,
                                 .turn = from->turn,
                                 .sequence_ns_num = from->sequence_ticks * from->tick_num,
                                 .sequence_ns_den = from->tick_den};
    for (uint32_t i = 0; i < from->n_beams; i++)
        beam[i] = (struct native_beam){(int32_t)from->beam[i].elevation_udeg, (int32_t)from->beam[i].azimuth_udeg,
                                       from->beam[i].offset_ns};
}

/* Asks the protocol about an emitter as it asks about one of a recording: as the native frame describes it. */
static int ask_protocol(const struct protocol_ops *ops, const struct emitter *from, double pan_counts,
                        struct sh_err *why)
{
    const struct native_descriptor descriptor = {.pan_counts_per_turn = pan_counts};
    struct native_emitter e;
    struct native_beam beam[NATIVE_MAX_BEAMS];
    uint8_t frame[NATIVE_HEADER_LEN + NATIVE_EMITTER_HEAD_LEN + NATIVE_MAX_BEAMS * NATIVE_BEAM_LEN];
    config_describe_emitter(from, &e, beam);
    native_encode_emitter(frame, sizeof frame, &e, beam, 0, 0);
    return ops->check_head(&descriptor, &e, frame + NATIVE_HEADER_LEN, why);
}

/* A head with geometries changes between them by command, so all of them have to fit. */
int cfg_protocol_fits(const struct protocol_ops *ops, const struct config_profile *profile, struct sh_err *why)
{
    const double pan_counts = profile->pan_counts > 0 ? profile->pan_counts : 4294967296.0;
    const uint32_t n = profile->arrangement.n_geometries;
    if (!has_kind(ops, &profile->emitter) || !has_beams(ops, &profile->emitter)) return 0;
    if (ops->check_head == NULL) return 1;
    struct config_profile p = *profile;
    for (uint32_t i = 0; i < n; i++) {
        config_set_steps(&p, profile->arrangement.geometry[i].steps_per_turn);
        if (ask_protocol(ops, &p.emitter, pan_counts, why) != SH_OK) return 0;
    }
    return n > 0 || ask_protocol(ops, &p.emitter, pan_counts, why) == SH_OK;
}

/* The head's emitter must be one that the protocol can describe. */
static void check_head(struct cfg_reader *rd, const struct config *cfg, uint32_t i, const struct protocol_ops *ops)
{
    const struct emitter *emitter = &cfg->profile.emitter;
    struct sh_err why;
    char where[40], allowed[64];
    if (!cfg_has_profile(rd) || cfg_protocol_fits(ops, &cfg->profile, &why)) return;
    if (cfg->link[i].protocol == PROTOCOL_CAPTURE) {
        cfg_fail_item(rd, PROTOCOL_KEY, i,
                      "capture is for `run FILE.pcap`; allowed for a head are all other protocols");
        return;
    }
    link_protocol_place_of(rd, "head.profile", where);
    if (!has_kind(ops, emitter))
        cfg_fail_item(rd, PROTOCOL_KEY, i,
                      "protocol %s does not support head profile %s%s, whose emitter is %s; allowed emitters: %s",
                      ops->name, cfg->profile.name, where, emitter_names[emitter->kind],
                      cfg_list_kinds(ops->emitters, emitter_names, allowed, sizeof allowed));
    else if (!has_beams(ops, emitter))
        cfg_fail_item(rd, PROTOCOL_KEY, i, "%s has %u beams, but head profile %s%s has %u; allowed %u", ops->name,
                      ops->n_beams, cfg->profile.name, where, emitter->n_beams, ops->n_beams);
    else
        cfg_fail_item(rd, PROTOCOL_KEY, i, "protocol %s does not support head profile %s%s, which has %s", ops->name,
                      cfg->profile.name, where, why.text);
}

/* The default source port is that of the real device's packets. */
static void set_source_port(const struct cfg_reader *rd, struct link_spec *link, uint32_t i)
{
    if (link->type != LINK_UDP || cfg_is_item_given(rd, "links[].source_port", i)) return;
    if (link->protocol == PROTOCOL_VELODYNE) link->source_port = VELODYNE_DATA_PORT;
    if (link->protocol == PROTOCOL_VELODYNE_POSITION) link->source_port = VELODYNE_POSITION_PORT;
    link->usual_port = 1;
}

/* Returns whether the link can have its protocol. */
static int check_link_alone(struct cfg_reader *rd, struct link_spec *link, uint32_t i)
{
    const struct protocol_ops *ops = ops_of(link);
    char allowed[64];
    if (!CFG_ITEM_SOUND(rd, i, "links[]")) return 0; /* a key of this link has a diagnostic */
    if (!is_spoken_on(link)) {
        cfg_fail_item(
            rd, PROTOCOL_KEY, i, "protocol %s is not available on a %s link; allowed %s", ops->name,
            cfg_word(rd, "links[].type", (int)link->type),
            cfg_list_kinds(ways[link->protocol], cfg_find(&rd->table, "links[].type")->names, allowed, sizeof allowed));
        return 0;
    }
    if (link->dialect != PROTOCOL_DIALECT_ANY && link->protocol != PROTOCOL_COLA)
        cfg_fail_item(rd, "links[].dialect", i, "%s, but the protocol is %s; allowed with protocol: cola, or any",
                      cfg_word(rd, "links[].dialect", link->dialect), ops->name);
    set_source_port(rd, link, i);
    /* The real device turns a second client away. */
    if (link->protocol == PROTOCOL_SCIP && !cfg_is_item_given(rd, "links[].max_sessions", i)) link->max_sessions = 1;
    return 1;
}

void cfg_check_protocols_alone(struct cfg_reader *rd, struct config *cfg)
{
    for (uint32_t i = 0; i < cfg->n_links; i++)
        check_link_alone(rd, &cfg->link[i], i);
}

void cfg_check_link_protocols(struct cfg_reader *rd, struct config *cfg)
{
    for (uint32_t i = 0; i < cfg->n_links; i++) {
        if (!check_link_alone(rd, &cfg->link[i], i)) continue;
        check_stream(rd, cfg, i, ops_of(&cfg->link[i]));
        check_head(rd, cfg, i, ops_of(&cfg->link[i]));
    }
}

int config_speaks(const struct config *cfg, int protocol)
{
    for (uint32_t i = 0; i < cfg->n_links; i++)
        if (cfg->link[i].protocol == protocol) return 1;
    return 0;
}
