/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/native_encode.h"

#include <string.h>

#include "core/bytes.h"
#include "drivers/protocol/crc32c.h"
#include "drivers/protocol/fields.h"
#include "drivers/protocol/native_rows.h"
#include "drivers/protocol/native_waves.h"

/* Writes the header before the payload that already stands at dst + NATIVE_HEADER_LEN. */
static size_t put_header(uint8_t *dst, enum native_type type, int flags, size_t payload_len, int64_t t_ns)
{
    dst[0] = NATIVE_SYNC;
    dst[1] = (uint8_t)type;
    dst[2] = NATIVE_VERSION;
    dst[3] = (uint8_t)flags;
    le_put32(dst + 4, (uint32_t)payload_len);
    le_put32(dst + 12, crc32c(0, dst + NATIVE_HEADER_LEN, payload_len));
    le_put64(dst + 16, (uint64_t)t_ns);
    return native_finish_frame(dst, 0);
}

size_t native_finish_frame(uint8_t *frame, uint32_t seq)
{
    le_put32(frame + 8, seq);
    le_put32(frame + 24, crc32c(0, frame, 24));
    return native_frame_len(frame);
}

void native_reseal(uint8_t *frame, size_t len)
{
    if (len < NATIVE_HEADER_LEN) return;
    le_put32(frame + 12, crc32c(0, frame + NATIVE_HEADER_LEN, len - NATIVE_HEADER_LEN));
    le_put32(frame + 24, crc32c(0, frame, 24));
}

static size_t encode_fixed(uint8_t *dst, size_t cap, const struct field_table *table, const void *from, int64_t t_ns,
                           int flags)
{
    if (cap < NATIVE_HEADER_LEN + table->wire_len) return 0;
    fields_encode(table, from, dst + NATIVE_HEADER_LEN);
    return put_header(dst, (enum native_type)table->type, flags, table->wire_len, t_ns);
}

size_t native_encode_descriptor(uint8_t *dst, size_t cap, const struct native_descriptor *d, int64_t t_ns, int flags)
{
    const struct field_table *table = d->content != 0 ? &fields_descriptor_content : &fields_descriptor;
    return encode_fixed(dst, cap, table, d, t_ns, flags);
}

size_t native_encode_anchor(uint8_t *dst, size_t cap, const struct native_anchor *a, int64_t t_ns, int flags)
{
    return encode_fixed(dst, cap, &fields_anchor, a, t_ns, flags);
}

size_t native_encode_emitter(uint8_t *dst, size_t cap, const struct native_emitter *e, const struct native_beam *beam,
                             int64_t t_ns, int flags)
{
    const size_t len = NATIVE_EMITTER_HEAD_LEN + (size_t)e->n_beams * NATIVE_BEAM_LEN;
    uint8_t *at = dst + NATIVE_HEADER_LEN + NATIVE_EMITTER_HEAD_LEN;
    if (e->n_beams > NATIVE_MAX_BEAMS || cap < NATIVE_HEADER_LEN + len) return 0;
    fields_encode(&fields_emitter, e, dst + NATIVE_HEADER_LEN);
    for (uint32_t i = 0; i < e->n_beams; i++, at += NATIVE_BEAM_LEN) {
        le_put32(at, (uint32_t)beam[i].elevation_udeg);
        le_put32(at + 4, (uint32_t)beam[i].azimuth_udeg);
        le_put32(at + 8, beam[i].offset_ns);
    }
    return put_header(dst, NATIVE_EMITTER, flags, len, t_ns);
}

size_t native_encode_telemetry(uint8_t *dst, size_t cap, const struct native_telemetry *t, int64_t t_ns, int flags)
{
    const struct field_table *table = t->ptp_port != NATIVE_PTP_NONE ? &fields_telemetry_ptp
                                      : t->lost_lines != 0           ? &fields_telemetry_lines
                                                                     : &fields_telemetry;
    return encode_fixed(dst, cap, table, t, t_ns, flags);
}

size_t native_encode_event(uint8_t *dst, size_t cap, const struct native_event *e, int64_t t_ns, int flags)
{
    return encode_fixed(dst, cap, &fields_event, e, t_ns, flags);
}

size_t native_encode_line_end(uint8_t *dst, size_t cap, const struct line_end *end, int64_t scan_t0_ns)
{
    return encode_fixed(dst, cap, &fields_line_end, end, scan_t0_ns + end->t1_ns, 0);
}

size_t native_encode_poses(uint8_t *dst, size_t cap, const struct native_pose *pose, uint32_t n, int64_t t_ns,
                           int flags)
{
    size_t len = NATIVE_POSES_HEAD_LEN + (size_t)n * NATIVE_POSE_LEN;
    if (n > NATIVE_MAX_POSES || cap < NATIVE_HEADER_LEN + len) return 0;
    uint8_t *payload = dst + NATIVE_HEADER_LEN;
    le_put32(payload, n);
    le_put32(payload + 4, 0);
    for (uint32_t i = 0; i < n; i++)
        fields_encode(&fields_pose, &pose[i], payload + NATIVE_POSES_HEAD_LEN + (size_t)i * NATIVE_POSE_LEN);
    return put_header(dst, NATIVE_POSES, flags, len, t_ns);
}

static size_t frames_bound(uint32_t n_points)
{
    /* a cut goes back to the start of a pulse: at most LINE_MAX_ECHOES - 1 points */
    const size_t least = NATIVE_MAX_POINTS - (LINE_MAX_ECHOES - 1);
    return n_points == 0 ? 1 : (n_points + least - 1) / least;
}

size_t native_points_bound(uint32_t n_points)
{
    return frames_bound(n_points) * (NATIVE_HEADER_LEN + NATIVE_POINTS_HEAD_LEN) + (size_t)n_points * NATIVE_POINT_LEN;
}

size_t native_attributes_bound(uint32_t n_points)
{
    return frames_bound(n_points) * (NATIVE_HEADER_LEN + NATIVE_ATTRIBUTES_HEAD_LEN) +
           (size_t)n_points * (NATIVE_ATTRIBUTE_LEN + NATIVE_DEVIATION_LEN);
}

size_t native_colours_bound(uint32_t n_points)
{
    return frames_bound(n_points) * (NATIVE_HEADER_LEN + NATIVE_COLOURS_HEAD_LEN) +
           (size_t)n_points * NATIVE_COLOUR_LEN;
}

size_t native_waves_bound(uint32_t n_points, uint32_t n_windows, uint32_t n_samples)
{
    /* a frame ends where the next window doesn't fit, so less than the longest window stays free in it */
    const size_t least = NATIVE_MAX_PAYLOAD - NATIVE_WAVES_HEAD_LEN - native_wave_len(NATIVE_MAX_SAMPLES);
    const size_t windows = n_windows * native_wave_len(1) + (size_t)n_samples * NATIVE_SAMPLE_LEN;
    return (frames_bound(n_points) + windows / least) * (NATIVE_HEADER_LEN + NATIVE_WAVES_HEAD_LEN) + windows;
}

/* The first entry of each pulse has the echo number 0 or 1, and no other entry has. */
static int starts_pulse(uint8_t echo)
{
    return (echo & 15) <= 1;
}

/* How many points from `first` on go into one frame. 0: a pulse has more echoes than a frame holds. */
static uint32_t points_that_fit(const struct line_block *block, uint32_t first)
{
    uint32_t n = block->n_points - first;
    if (n <= NATIVE_MAX_POINTS) return n;
    n = NATIVE_MAX_POINTS;
    while (n > 0 && !starts_pulse(block->echo[first + n]))
        n--;
    return n;
}

static uint32_t count_pulses(const uint8_t *echo, uint32_t n)
{
    uint32_t pulses = 0;
    for (uint32_t i = 0; i < n; i++)
        pulses += (uint32_t)starts_pulse(echo[i]);
    return pulses;
}

/* The entries of a block that go into one points frame, and into the frames that follow it. */
struct encode_cut {
    const struct line_block *block;
    struct native_points head;
    uint32_t first;  /* entry */
    uint32_t pulse0; /* pulses since the block's pulse0 */
    uint32_t dt0_ns; /* time since the block's t0_ns */
    uint32_t wave;   /* first window that was not sent yet */
    uint32_t n_lost; /* samples lost, which the next frame of waveforms reports */
    int is_last;
    int64_t t_ns; /* in the headers */
};

/* Attributes and colours begin alike. */
static void put_attributes_head(uint8_t *dst, const struct encode_cut *cut)
{
    const struct native_attributes head = {cut->head.pulse0, cut->head.line, cut->head.n_points};
    fields_encode(&fields_attributes, &head, dst + NATIVE_HEADER_LEN);
}

/* Writes attributes. Here and below, 0 means that there is no room. */
static size_t put_attributes(uint8_t *dst, size_t cap, const struct encode_cut *cut)
{
    const struct line_block *block = cut->block;
    const uint32_t n = cut->head.n_points, end = cut->first + n;
    const size_t each = NATIVE_ATTRIBUTE_LEN + (block->deviation != NULL ? (size_t)NATIVE_DEVIATION_LEN : 0);
    const size_t payload_len = NATIVE_ATTRIBUTES_HEAD_LEN + n * each;
    uint8_t *at = dst + NATIVE_HEADER_LEN + NATIVE_ATTRIBUTES_HEAD_LEN;
    if (cap < NATIVE_HEADER_LEN + payload_len) return 0;
    put_attributes_head(dst, cut);
    for (uint32_t i = cut->first; i < end; i++, at += NATIVE_ATTRIBUTE_LEN)
        le_put32(at, (uint16_t)block->amplitude_cdb[i] | (uint32_t)block->width_cns[i] << 16);
    for (uint32_t i = cut->first; block->deviation != NULL && i < end; i++, at += NATIVE_DEVIATION_LEN)
        le_put16(at, block->deviation[i]);
    return put_header(dst, NATIVE_ATTRIBUTES, 0, payload_len, cut->t_ns);
}

/* Writes colours. */
static size_t put_colours(uint8_t *dst, size_t cap, const struct encode_cut *cut)
{
    const size_t len = (size_t)cut->head.n_points * NATIVE_COLOUR_LEN, payload_len = NATIVE_COLOURS_HEAD_LEN + len;
    if (cap < NATIVE_HEADER_LEN + payload_len) return 0;
    put_attributes_head(dst, cut);
    memcpy(dst + NATIVE_HEADER_LEN + NATIVE_COLOURS_HEAD_LEN, cut->block->rgb + cut->first, len);
    return put_header(dst, NATIVE_COLOURS, 0, payload_len, cut->t_ns);
}

/* Writes a window, whose length is checked. */
static void put_wave(uint8_t *restrict at, const struct line_waves *waves, const struct line_wave *w,
                     const struct encode_cut *cut)
{
    const uint16_t *restrict sample = waves->sample + w->at;
    const uint32_t n = w->n;
    le_put64(at, (w->pulse - cut->pulse0) | (uint64_t)(w->dt_ns - cut->dt0_ns) << 32);
    le_put64(at + 8, w->first | (uint64_t)n << 32);
    le_put64(at + 16, w->a | (uint64_t)w->b << 32);
    le_put32(at + 24, w->c);
    at += NATIVE_WAVE_LEN;
    for (uint32_t i = 0; i < n; i++)
        le_put16(at + NATIVE_SAMPLE_LEN * (size_t)i, sample[i]);
    if (n & 1) le_put16(at + NATIVE_SAMPLE_LEN * (size_t)n, 0);
}

/* Returns whether a frame of waveforms is still to come. */
static int has_waves(const struct encode_cut *cut)
{
    const struct line_waves *waves = cut->block->waves;
    if (waves == NULL) return 0;
    if (cut->n_lost != 0) return 1;
    return cut->wave < waves->n && (cut->is_last || waves->wave[cut->wave].pulse - cut->pulse0 < cut->head.n_pulses);
}

/* Writes the next windows of these pulses, as many as one frame holds. Returns 0 also where a window has no samples,
 * or too many. */
static size_t put_waves(uint8_t *dst, size_t cap, struct encode_cut *cut)
{
    const struct line_waves *waves = cut->block->waves;
    struct native_waves head = {.pulse0 = cut->head.pulse0,
                                .line = cut->head.line,
                                .sample_ps = waves->sample_ps,
                                .baseline_16 = waves->baseline_16,
                                .bits = waves->bits,
                                .count_signal = waves->count_signal,
                                .n_lost = cut->n_lost};
    uint8_t *payload = dst + NATIVE_HEADER_LEN;
    size_t len = NATIVE_WAVES_HEAD_LEN;
    if (cap < NATIVE_HEADER_LEN + len) return 0;
    const size_t room = cap - NATIVE_HEADER_LEN, most = room < NATIVE_MAX_PAYLOAD ? room : NATIVE_MAX_PAYLOAD;
    for (cut->n_lost = 0; has_waves(cut); cut->wave++, head.n_windows++) {
        const struct line_wave *w = &waves->wave[cut->wave];
        if (w->n == 0 || w->n > NATIVE_MAX_SAMPLES) return 0;
        if (native_wave_len(w->n) > most - len) break;
        put_wave(payload + len, waves, w, cut);
        len += native_wave_len(w->n);
    }
    if (head.n_windows == 0 && has_waves(cut)) return 0;
    fields_encode(&fields_waves, &head, payload);
    return put_header(dst, NATIVE_WAVES, 0, len, cut->t_ns);
}

/* Writes what follows a points frame: *len bytes. SH_ENOMEM: there is no room. */
static int put_following(uint8_t *dst, size_t cap, struct encode_cut *cut, size_t *len)
{
    size_t done = 0, more = 1;
    if (cut->block->width_cns != NULL) done += more = put_attributes(dst, cap, cut);
    if (more != 0 && cut->block->rgb != NULL) done += more = put_colours(dst + done, cap - done, cut);
    while (more != 0 && has_waves(cut))
        done += more = put_waves(dst + done, cap - done, cut);
    *len = done;
    return more != 0 ? SH_OK : SH_ENOMEM;
}

size_t native_encode_points(uint8_t *dst, size_t cap, const struct line_block *block, int64_t scan_t0_ns)
{
    size_t done = 0, following;
    struct encode_cut cut = {.block = block};
    do {
        const uint32_t n = points_that_fit(block, cut.first);
        cut.is_last = cut.first + n == block->n_points;
        size_t payload_len = NATIVE_POINTS_HEAD_LEN + (size_t)n * NATIVE_POINT_LEN;
        if ((n == 0 && !cut.is_last) || cap - done < NATIVE_HEADER_LEN + payload_len) return 0;
        cut.dt0_ns = cut.first == 0 ? 0 : block->dt_ns[cut.first];
        cut.head = (struct native_points){
            .frame = block->frame,
            .line = block->line,
            .pulse0 = block->pulse0 + cut.pulse0,
            .t0_ns = block->t0_ns + cut.dt0_ns,
            .line_t0_ns = block->line_t0_ns,
            .n_pulses = cut.is_last ? block->n_pulses - cut.pulse0 : count_pulses(block->echo + cut.first, n),
            .n_points = n,
        };
        cut.t_ns = scan_t0_ns + cut.head.t0_ns;
        uint8_t *payload = dst + done + NATIVE_HEADER_LEN;
        fields_encode(&fields_points, &cut.head, payload);
        if (native_put_rows(payload + NATIVE_POINTS_HEAD_LEN, block, cut.first, n, cut.dt0_ns) != 0) return 0;
        done += put_header(dst + done, NATIVE_POINTS, 0, payload_len, cut.t_ns);
        if (cut.is_last && block->waves != NULL) cut.n_lost = block->waves->n_left_out;
        if (put_following(dst + done, cap - done, &cut, &following) != SH_OK) return 0;
        done += following;
        cut.pulse0 += cut.head.n_pulses;
        cut.first += n;
    } while (cut.first < block->n_points);
    return done;
}

/* Writes a name with its length in front. Returns 0 where it is longer than 255 bytes, or than the room. */
static size_t put_name(uint8_t *dst, size_t room, const char *name)
{
    size_t len = strnlen(name, 256);
    if (len > 255 || room < len + 1) return 0;
    dst[0] = (uint8_t)len;
    memcpy(dst + 1, name, len);
    return len + 1;
}

size_t native_encode_surfaces(uint8_t *dst, size_t cap, size_t max_payload, struct native_names *names, int64_t t_ns)
{
    if (cap < NATIVE_HEADER_LEN + NATIVE_SURFACES_HEAD_LEN || max_payload < NATIVE_SURFACES_HEAD_LEN) return 0;
    if (max_payload > NATIVE_MAX_PAYLOAD) max_payload = NATIVE_MAX_PAYLOAD;
    if (max_payload > cap - NATIVE_HEADER_LEN) max_payload = cap - NATIVE_HEADER_LEN;
    uint8_t *payload = dst + NATIVE_HEADER_LEN;
    size_t len = NATIVE_SURFACES_HEAD_LEN;
    uint32_t i;
    for (i = 0; i < names->n; i++) {
        const char *object, *material;
        names->name(names->ctx, names->first + i, &object, &material);
        size_t n_object = put_name(payload + len, max_payload - len, object);
        if (n_object == 0) break;
        size_t n_material = put_name(payload + len + n_object, max_payload - len - n_object, material);
        if (n_material == 0) break;
        len += n_object + n_material;
    }
    if (i == 0 && names->n > 0) return 0;
    le_put32(payload, names->first);
    le_put32(payload + 4, i);
    names->first += i;
    names->n -= i;
    return put_header(dst, NATIVE_SURFACES, 0, len, t_ns);
}
