/* SPDX-License-Identifier: MIT */
/* Opening: reads the description of the head from the recording, before anything is played. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/native_encode.h"
#include "drivers/protocol/protocol.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/replay/replay_state.h"

static int front_place(uint8_t type)
{
    return type == NATIVE_DESCRIPTOR ? 0 : type == NATIVE_EMITTER ? 1 : type == NATIVE_ANCHOR ? 2 : -1;
}

void replay_keep_front(struct replay_front *front, const uint8_t *frame)
{
    const int place = front_place(frame[1]);
    const size_t len = native_frame_len(frame);
    if (place < 0 || len > REPLAY_FRONT_ROOM) return;
    if (place == 0) front->len[1] = 0; /* a new descriptor: its head has another emitter, or none */
    memcpy(front->bytes[place], frame, len);
    front->len[place] = (uint32_t)len;
}

/* Reads up to the first anchor that follows a descriptor, or to the end: the recording may begin anywhere. */
static int read_front(struct replay *r, struct sh_err *err)
{
    struct recording_frame frame;
    int got, is_first = 1, is_anchored = 0;
    while ((got = recording_next(&r->recording, &frame, err)) == 1) {
        if (is_first && (frame.bytes[3] & NATIVE_LOCAL) == 0) {
            r->first_ns = frame.t_ns;
            is_first = 0;
        }
        replay_keep_front(&r->front, frame.bytes);
        /* The emitter is between the descriptor and the anchor, so an anchor before the descriptor ends nothing. */
        if (frame.bytes[1] == NATIVE_DESCRIPTOR) is_anchored = 0;
        if (frame.bytes[1] == NATIVE_ANCHOR) is_anchored = r->front.len[0] != 0;
        if (!is_first && is_anchored) break;
    }
    if (got < 0) return got;
    if (r->front.len[0] == 0)
        return sh_fail(err, SH_EINPUT, "%s: it has no descriptor: it is not a recording of a head's stream",
                       r->options.path);
    r->first_front = r->front;
    return recording_rewind(&r->recording, err);
}

/* Begins the clock with the first telemetry frame, if it comes within two seconds. Heads send one each second. */
static int read_clock(struct replay *r, struct sh_err *err)
{
    enum { LONG_ENOUGH_NS = 2000000000 };
    struct recording_frame frame;
    struct native_telemetry t;
    struct native_header header;
    int got;
    while ((got = recording_next(&r->recording, &frame, err)) == 1 &&
           (double)frame.t_ns - (double)r->first_ns <= LONG_ENOUGH_NS) {
        native_read_header(frame.bytes, &header);
        if (header.type != NATIVE_TELEMETRY) continue;
        if (native_decode_telemetry(frame.bytes + NATIVE_HEADER_LEN, header.length, &t) != SH_OK) continue;
        replay_clock_begin(&r->clock, header.t_ns, t.utc_ns);
        break;
    }
    return got < 0 ? got : recording_rewind(&r->recording, err);
}

/* A recorded text may have any bytes. A reply is one line of ASCII, without the byte that begins a frame. */
static void keep_ascii(char *text)
{
    for (; *text != '\0'; text++)
        if (*text < 0x20 || *text > 0x7e) *text = '~';
}

/* Copies "MAKER,MODEL,SERIAL,REST" into the fields of the configuration that links show to hosts. */
static void take_identity(struct config *cfg, const char *idn)
{
    char text[96];
    char *field[3] = {text, "", ""};
    snprintf(text, sizeof text, "%s", idn);
    for (int i = 0; i < 3; i++) {
        char *comma = strchr(field[i], ',');
        if (comma == NULL) break;
        *comma = '\0';
        if (i < 2) field[i + 1] = comma + 1;
    }
    snprintf(cfg->profile.maker, sizeof cfg->profile.maker, "%.31s", field[0]);
    snprintf(cfg->profile.model, sizeof cfg->profile.model, "%.63s", field[1]);
    snprintf(cfg->head.serial, sizeof cfg->head.serial, "%.31s", field[2]);
    for (uint32_t i = 0; i < cfg->n_links; i++)
        if (cfg->link[i].type == LINK_USB && cfg->link[i].own_serial)
            snprintf(cfg->link[i].serial, sizeof cfg->link[i].serial, "%.31s", field[2]);
}

static const double MOST_UHZ = 1e15; /* 1 GHz, since a recording may give any rate */

/* Fills in the rates, since a link that can't carry the stream is refused. */
static void fill_config(struct replay *r, const struct native_descriptor *d)
{
    struct config *cfg = r->cfg;
    take_identity(cfg, d->idn);
    snprintf(cfg->profile.name, sizeof cfg->profile.name, "%s", d->profile);
    cfg->profile.facets = 1;
    cfg->profile.optical_gain = d->sweep_udeg > 0 ? (double)d->sweep_udeg * 1e-6 / 360.0 : 1.0;
    cfg->head.settings = r->cmd.settings;
    cfg->head.settings.prr_uhz = llround(fmin((double)d->prr_uhz * r->options.speed, MOST_UHZ));
    cfg->output.attributes = (d->content & NATIVE_HAS_ATTRIBUTES) != 0;
    cfg->output.colour = (d->content & NATIVE_HAS_COLOURS) != 0 ? COLOUR_SOLID : COLOUR_NONE;
}

static int check_faults(const struct config *cfg, struct sh_err *err)
{
    for (uint32_t i = 0; i < cfg->faults.n; i++) {
        const struct fault *fault = &cfg->faults.fault[i];
        const char *why = fault_desk_why_not(fault);
        if (why != NULL) return sh_fail(err, SH_EINPUT, "fault %u, %s: %s", i + 1, fault_names[fault->kind], why);
    }
    return SH_OK;
}

/* Takes the firmware from the profile of the recorded head: other protocols report it, and the stream lacks it. */
static void take_firmware(struct config *cfg)
{
    struct config_profile *profile = calloc(1, sizeof *profile);
    struct sh_err err;
    if (profile != NULL && config_load_profile(cfg->profile.name, cfg->file, profile, &err) == SH_OK &&
        strcmp(profile->model, cfg->profile.model) == 0)
        snprintf(cfg->profile.firmware, sizeof cfg->profile.firmware, "%s", profile->firmware);
    free(profile);
}

static int is_device(const struct config *cfg)
{
    for (uint32_t i = 0; i < cfg->n_links; i++)
        if (cfg->link[i].protocol != PROTOCOL_NATIVE) return 1;
    return 0;
}

/* Sets the figures that SCAN:REPLay reports and allows. length_s is from the recording's first frame to the end of the
 * part that is played. */
static void describe_replay(struct replay *r)
{
    int64_t last_ns;
    double length_s =
        recording_last_ns(r->options.path, &last_ns) ? 1e-9 * ((double)last_ns - (double)r->first_ns) : 0.0;
    if (r->options.to_s > 0.0 && (length_s <= 0.0 || r->options.to_s < length_s)) length_s = r->options.to_s;
    r->cmd.replay = (struct command_replay){.is_there = 1, .length_s = length_s > 0.0 ? length_s : 0.0};
    if (r->cfg->loop.pace != PACE_REALTIME) r->cmd.replay.fixed_speed = "only the pace realtime has others";
    if (r->is_device) r->cmd.replay.fixed_speed = "a link's times are those of the device";
}

int replay_open_recording(struct replay *r, struct sh_err *err)
{
    struct native_descriptor d;
    struct native_emitter e;
    struct native_anchor a;
    int rc = check_faults(r->cfg, err);
    r->is_device = is_device(r->cfg);
    if (r->options.talk != NULL) {
        replay_open_commands(r);
        r->cmd.idn = r->idn;
        return rc;
    }
    if (rc == SH_OK) rc = recording_open(&r->recording, r->options.path, err);
    if (rc == SH_OK) rc = read_front(r, err);
    if (rc != SH_OK) return rc;
    const struct replay_front *front = &r->front;
    if (native_decode_descriptor(front->bytes[0] + NATIVE_HEADER_LEN, front->len[0] - NATIVE_HEADER_LEN, &d) != SH_OK)
        return sh_fail(err, SH_EINPUT, "%s: its descriptor can't be read", r->options.path);
    keep_ascii(d.idn);
    replay_open_commands(r);
    replay_take_descriptor(r, &d);
    const uint8_t *emitter = front->bytes[1] + NATIVE_HEADER_LEN;
    const int has_emitter =
        front->len[1] != 0 && native_decode_emitter(emitter, front->len[1] - NATIVE_HEADER_LEN, &e) == SH_OK;
    if (has_emitter) replay_take_emitter(r, &e);
    if (front->len[2] != 0 &&
        native_decode_anchor(front->bytes[2] + NATIVE_HEADER_LEN, front->len[2] - NATIVE_HEADER_LEN, &a) == SH_OK)
        replay_take_anchor(r, &a);
    if (r->is_device && (rc = read_clock(r, err)) != SH_OK) return rc;
    rc = replay_check_links(r, &d, has_emitter ? &e : NULL, emitter, err);
    if (rc != SH_OK) return rc;
    fill_config(r, &d);
    if (r->is_device) take_firmware(r->cfg);
    snprintf(r->idn, sizeof r->idn, "%s", d.idn);
    r->cmd.idn = r->idn;
    describe_replay(r);
    return SH_OK;
}
