/* SPDX-License-Identifier: MIT */
/* This fuzzes the native stream's parser and decoders. The input is a byte that says how the stream is cut into pieces,
 * then the stream. The same bytes in other pieces must give the same frames, lines, notices and counts. Each byte must
 * be in one item, or be counted as bad. */
#include <string.h>

#include "drivers/protocol/native_waves.h"
#include "tests/fuzz/rig.h"
#include "tests/fuzz/seal.h"

/* This is the parser's output: a sum of all items and notices, in their order. */
struct outcome {
    uint64_t sum, item_bytes, notice_bytes;
    struct native_stats stats;
};

static uint64_t mix(uint64_t sum, const void *bytes, size_t len)
{
    const uint8_t *p = bytes;
    for (size_t i = 0; i < len; i++)
        sum = (sum ^ p[i]) * UINT64_C(1099511628211); /* FNV-1a */
    return sum;
}

static void note(void *ctx, const struct native_notice *notice)
{
    struct outcome *o = ctx;
    const uint64_t v[] = {(uint64_t)notice->kind, notice->seq, notice->at_byte, notice->n, (uint64_t)notice->t_ns};
    o->sum = mix(o->sum, v, sizeof v);
    if (notice->kind == NATIVE_BAD_PAYLOAD || notice->kind == NATIVE_BAD_BYTES || notice->kind == NATIVE_CUT)
        o->notice_bytes += notice->n;
}

static void name(void *ctx, uint32_t label, const char *object, const char *material)
{
    uint64_t *sum = ctx;
    *sum = mix(*sum, &label, sizeof label) + strlen(object) + strlen(material);
}

/* The last sample of each window of a payload that was found right. */
static uint64_t last_samples(const uint8_t *payload, size_t len, uint32_t n_windows)
{
    uint64_t sum = 0;
    size_t at = NATIVE_WAVES_HEAD_LEN;
    for (uint32_t i = 0; i < n_windows; i++) {
        struct native_wave w;
        at = native_decode_wave(payload, at, &w);
        fuzz_must(at <= len && w.n > 0, "a window within its payload");
        sum += le_get16(w.sample + NATIVE_SAMPLE_LEN * (size_t)(w.n - 1));
    }
    return sum;
}

/* Decodes the payload in every way, whatever its type, because decoders check for themselves. */
static uint64_t decode(const uint8_t *payload, size_t len)
{
    static union {
        struct native_descriptor descriptor;
        struct native_anchor anchor;
        struct native_emitter emitter;
        struct native_points points;
        struct native_attributes attributes;
        struct line_end end;
        struct native_telemetry telemetry;
        struct native_event event;
        struct native_point point;
        struct native_beam beam;
        struct native_pose pose;
        struct native_attribute attribute;
        uint8_t rgb[3];
    } u;
    struct native_waves waves;
    uint32_t n = 0;
    uint64_t sum = 0;
    native_decode_descriptor(payload, len, &u.descriptor);
    native_decode_anchor(payload, len, &u.anchor);
    native_decode_line_end(payload, len, &u.end);
    native_decode_telemetry(payload, len, &u.telemetry);
    native_decode_event(payload, len, &u.event);
    if (native_decode_emitter(payload, len, &u.emitter) == SH_OK && (n = u.emitter.n_beams) > 0)
        native_decode_beam(payload, n - 1, &u.beam);
    if (native_decode_points(payload, len, &u.points) == SH_OK && (n = u.points.n_points) > 0)
        native_decode_point(payload, n - 1, &u.point);
    if (native_decode_attributes(payload, len, &u.attributes) == SH_OK && (n = u.attributes.n_points) > 0)
        native_decode_attribute(payload, n - 1, &u.attribute);
    if (native_decode_colours(payload, len, &u.attributes) == SH_OK && (n = u.attributes.n_points) > 0)
        memcpy(u.rgb, payload + NATIVE_COLOURS_HEAD_LEN + (size_t)NATIVE_COLOUR_LEN * (n - 1), NATIVE_COLOUR_LEN);
    if (native_decode_attributes(payload, len, &u.attributes) == SH_OK && (n = u.attributes.n_points) > 0 &&
        native_check_deviations(len, n) == SH_OK)
        sum += native_decode_deviation(payload, n, n - 1);
    if (native_decode_waves(payload, len, &waves) == SH_OK) sum += last_samples(payload, len, waves.n_windows);
    if (native_decode_poses(payload, len, &n) == SH_OK) native_decode_pose(payload, n - 1, &u.pose);
    native_decode_surfaces(payload, len, name, &sum);
    return sum;
}

static void collect(struct native_parser *p, struct outcome *o)
{
    for (enum native_item item; (item = native_parser_next(p)) != NATIVE_MORE;) {
        if (item == NATIVE_TEXT) {
            fuzz_must(strlen(p->text) < NATIVE_MAX_TEXT, "a reply line within its room");
            o->sum = mix(o->sum, p->text, strlen(p->text));
            continue;
        }
        const size_t len = NATIVE_HEADER_LEN + (size_t)p->header.length;
        fuzz_must(len <= NATIVE_MAX_FRAME && p->payload == p->frame + NATIVE_HEADER_LEN, "a frame is whole");
        o->sum = mix(o->sum, p->frame, len) + decode(p->payload, p->header.length);
    }
}

static struct outcome parse(const uint8_t *data, size_t size, size_t piece)
{
    static struct native_parser parser;
    struct outcome o = {.sum = UINT64_C(14695981039346656037)};
    native_parser_init(&parser);
    parser.notice = note;
    parser.notice_ctx = &o;
    for (size_t at = 0, room; at < size;) {
        uint8_t *to = native_parser_room(&parser, &room);
        fuzz_must(room > 0, "there is room after all items were taken");
        size_t n = size - at < piece ? size - at : piece;
        if (n > room) n = room;
        memcpy(to, data + at, n);
        native_parser_added(&parser, n);
        collect(&parser, &o);
        at += n;
    }
    native_parser_finish(&parser);
    collect(&parser, &o);
    o.stats = parser.stats;
    return o;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t sealed[1 << 16];
    struct fuzz_bytes in = {data, size};
    const unsigned how = fuzz_u8(&in);
    if (in.n > sizeof sealed) return 0;
    memcpy(sealed, in.p, in.n);
    if ((how & 1) == 0) fuzz_seal(sealed, in.n);
    const struct outcome whole = parse(sealed, in.n, SIZE_MAX), cut = parse(sealed, in.n, 1 + (how >> 1));
    fuzz_must(whole.stats.bytes == in.n, "all bytes are counted");
    fuzz_must(whole.notice_bytes == whole.stats.bad_bytes, "each bad byte is in one notice");
    fuzz_must(memcmp(&whole.stats, &cut.stats, sizeof whole.stats) == 0, "pieces change no count");
    fuzz_must(whole.sum == cut.sum, "pieces change nothing that comes out");
    return 0;
}
