/* SPDX-License-Identifier: MIT */
/* The state that the stream describes: descriptor, anchor, names, losses, hash. */
#include <math.h>
#include <nettle/base16.h>
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "core/grow.h"
#include "core/vecmath.h"
#include "drivers/host/host.h"
#include "drivers/protocol/native_waves.h"

static int bad(struct scanhead *sh, const char *what)
{
    return sh_fail(&sh->err, SH_EFORMAT, "%s: a frame with a good CRC holds %s", sh->source.name, what);
}

static int absorb_descriptor(struct scanhead *sh, const struct native_header *header, const uint8_t *payload)
{
    struct native_descriptor d;
    if (native_decode_descriptor(payload, header->length, &d) != 0) return bad(sh, "a wrong descriptor");
    if (d.layout == NATIVE_POLAR &&
        !(d.mirror_counts_per_turn >= 1 && d.pan_counts_per_turn >= 1 && d.range_scale_m > 0))
        return bad(sh, "a polar descriptor without scales");
    if (d.n_surfaces > SCANHEAD_NO_LABEL) return bad(sh, "a descriptor with more surfaces than labels");
    /* The anchor at hand stays valid only if this descriptor repeats the last one. After any other descriptor
     * comes another anchor, which may be that of another station. */
    int same_scan = sh->have_descriptor && sh->descriptor.scan == d.scan && (header->flags & NATIVE_REPEAT) != 0;
    if (!same_scan) {
        sh->have_anchor = sh->have_pulse = 0;
        host_forget_poses(sh);
        sh->emitter = (struct native_emitter){.kind = NATIVE_EMIT_LINE};
        sh->descriptor_seq = header->seq;
    }
    sh->descriptor = d;
    sh->have_descriptor = 1;
    sh->told_alone |= (header->flags & NATIVE_LOCAL) != 0;
    return 0;
}

static int absorb_emitter(struct scanhead *sh, const struct native_header *header, const uint8_t *payload)
{
    struct native_emitter e;
    if (native_decode_emitter(payload, header->length, &e) != 0) return bad(sh, "a wrong emitter");
    sh->emitter = e;
    for (uint32_t i = 0; i < e.n_beams; i++)
        native_decode_beam(payload, i, &sh->beam[i]);
    return 0;
}

static int absorb_anchor(struct scanhead *sh, const struct native_header *header, const uint8_t *payload)
{
    struct native_anchor a;
    if (native_decode_anchor(payload, header->length, &a) != 0) return bad(sh, "a wrong anchor");
    sh->anchor = a;
    if (!sh->have_anchor || (header->flags & NATIVE_REPEAT) == 0) sh->anchor_seq = header->seq;
    /* Without the descriptor of its scan, an anchor may be one of the scan before. */
    sh->have_anchor = sh->have_descriptor;
    return 0;
}

/* Another scan has begun, and its descriptor did not reach us. So the state of the scan before is forgotten. */
static void forget(struct scanhead *sh)
{
    sh->have_descriptor = sh->have_anchor = 0;
    host_forget_poses(sh);
}

/* Whether a recording holds a second copy of frame `seq` right before the present one. Recordings that were put one
 * after the other may begin with the same frames. The parser drops the second copies as repeated, up to the first frame
 * that differs. The state that comes from such a frame is that of the new sequence, too. */
static int came_again(const struct scanhead *sh, const struct native_header *header, uint32_t seq)
{
    return sh->source.is_file && header->seq - 1 - seq < sh->parser.sequence.again;
}

/* Forgets the state where another sequence of numbers begins: the head has started again, or recordings were put one
 * after the other. The parser drops repeated and late frames. So a number that goes back, or does not go on, means
 * another sequence. Where a descriptor for this reader alone (LOCAL) came just before, the state since then is that of
 * the new sequence. */
static void follow_sequence(struct scanhead *sh, const struct native_header *header)
{
    if ((header->flags & NATIVE_LOCAL) != 0) return;
    const int is_back = sh->have_seq && header->seq - sh->last_seq - 1 > INT32_MAX;
    if (is_back) sh->have_pulse = 0;
    if (is_back && !sh->told_alone) {
        sh->have_descriptor &= came_again(sh, header, sh->descriptor_seq);
        sh->have_anchor &= sh->have_descriptor && came_again(sh, header, sh->anchor_seq);
        if (!came_again(sh, header, sh->times.gps_seq)) sh->times.have_gps = 0;
        sh->times.have_scan_t0 = 0;
        host_forget_poses(sh);
    }
    sh->have_seq = 1;
    sh->last_seq = header->seq;
    sh->told_alone = 0;
}

static int absorb_points(struct scanhead *sh, const struct native_header *header, const uint8_t *payload)
{
    struct native_points points;
    if (native_decode_points(payload, header->length, &points) != 0) return bad(sh, "wrong points");
    if (sh->have_pulse && points.pulse0 < sh->last_pulse0) forget(sh);
    sh->times.scan_t0_ns = native_since_ns(header->t_ns, points.t0_ns);
    sh->times.have_scan_t0 = 1;
    int64_t until_ns = 1000000 * (int64_t)sh->anchor.until_ms; /* later points have an anchor that did not reach us */
    if (sh->have_anchor && until_ns != 0 && points.t0_ns >= until_ns) sh->have_anchor = 0;
    sh->have_pulse = 1;
    sh->last_pulse0 = points.pulse0;
    return 0;
}

static int absorb_attributes(struct scanhead *sh, const struct native_header *header, const uint8_t *payload)
{
    struct native_attributes attributes;
    if (native_decode_attributes(payload, header->length, &attributes) != 0) return bad(sh, "wrong attributes");
    if (scanhead_has_deviations(sh) != 1) return 0;
    return native_check_deviations(header->length, attributes.n_points) != 0 ? bad(sh, "too few deviations") : 0;
}

static int absorb_colours(struct scanhead *sh, const struct native_header *header, const uint8_t *payload)
{
    struct native_attributes colours;
    return native_decode_colours(payload, header->length, &colours) != 0 ? bad(sh, "wrong colours") : 0;
}

static int absorb_waves(struct scanhead *sh, const struct native_header *header, const uint8_t *payload)
{
    struct native_waves waves;
    return native_decode_waves(payload, header->length, &waves) != 0 ? bad(sh, "wrong waveforms") : 0;
}

static int absorb_poses(struct scanhead *sh, const struct native_header *header, const uint8_t *payload)
{
    if (host_absorb_poses(sh, payload, header->length) == SH_EFORMAT) return bad(sh, "wrong poses");
    return sh->poses != NULL ? 0 : sh_fail(&sh->err, SH_ENOMEM, "no memory for poses");
}

/* Notes the head's clock at a device time. GPS time fits: it is below 2^63 ns until 2272. */
static void set_gps(struct scanhead *sh, uint32_t seq, uint64_t at_ns, uint64_t gps_ns)
{
    sh->times.gps_seq = seq;
    sh->times.gps_at_ns = (int64_t)at_ns;
    sh->times.gps_ns = (int64_t)gps_ns;
    sh->times.have_gps = 1;
}

static void absorb_time(struct scanhead *sh, uint32_t seq, const struct native_event *event)
{
    if (event->code == NATIVE_EV_SCAN_START) {
        sh->times.scan_t0_ns = (int64_t)event->b;
        sh->times.have_scan_t0 = 1;
        set_gps(sh, seq, event->b, event->c);
        sh->times.have_gps = event->c != 0;
    }
    if (event->code == NATIVE_EV_TIME) set_gps(sh, seq, event->b, event->c);
    if (event->code == NATIVE_EV_PPS) set_gps(sh, seq, event->b, event->c * 1000000000u);
}

/* A SCAN_START with the descriptor's number is of another scan if that scan has another start: the head has started
 * again. The event of the scan at hand can come after its first points, where the head lost the tick with it. */
static int is_other_scan(const struct scanhead *sh, const struct native_event *start)
{
    if (!sh->have_descriptor) return 0;
    return start->a != sh->descriptor.scan || (sh->have_pulse && (int64_t)start->b != sh->times.scan_t0_ns);
}

void host_count_reader_lost(struct scanhead *sh, uint64_t n)
{
    if (n < sh->reader_lost) sh->reader_lost_before += sh->reader_lost;
    sh->reader_lost = n;
}

static int absorb_event(struct scanhead *sh, const struct native_header *header, const uint8_t *payload)
{
    struct native_event event;
    if (native_decode_event(payload, header->length, &event) != 0) return bad(sh, "a wrong event");
    if (event.code == NATIVE_EV_READER_LOST) host_count_reader_lost(sh, event.c);
    if (event.code == NATIVE_EV_OVERRUN) sh->pulses_lost_told += event.b;
    if (event.code == NATIVE_EV_SCAN_END) sh->pulses_lost_ended += event.c;
    if (event.code == NATIVE_EV_SCAN_START && is_other_scan(sh, &event)) forget(sh);
    absorb_time(sh, header->seq, &event);
    return 0;
}

struct naming {
    struct scanhead *sh;
    int rc;
};

static int no_names(struct scanhead *sh, uint32_t label)
{
    return sh_fail(&sh->err, SH_ENOMEM, "no memory for %u surface names", label + 1);
}

static void set_surface(void *ctx, uint32_t label, const char *object, const char *material)
{
    struct naming *naming = ctx;
    struct scanhead *sh = naming->sh;
    if (!grow(&sh->surface, &sh->surface_room, label + 1, sizeof *sh->surface)) {
        naming->rc = no_names(sh, label);
        return;
    }
    while (sh->n_surfaces <= label)
        sh->surface[sh->n_surfaces++] = (struct host_surface){NULL, NULL};
    struct host_surface *s = &sh->surface[label];
    if (s->object != NULL && strcmp(s->object, object) == 0 && strcmp(s->material, material) == 0) return;
    struct host_surface named = {strdup(object), strdup(material)};
    if (named.object == NULL || named.material == NULL) {
        free(named.object);
        free(named.material);
        naming->rc = no_names(sh, label);
        return;
    }
    free(s->object);
    free(s->material);
    *s = named;
}

static int absorb_surfaces(struct scanhead *sh, const struct native_header *header, const uint8_t *payload)
{
    struct naming naming = {sh, 0};
    if (native_decode_surfaces(payload, header->length, set_surface, &naming) != 0)
        return bad(sh, "wrong surface names");
    return naming.rc;
}

static void absorb_hash(struct scanhead *sh, const struct native_header *header, const uint8_t *payload)
{
    if (!sh->hashing || !native_is_hashed(header)) return;
    uint8_t head[5] = {header->type};
    le_put32(head + 1, header->length);
    sha256_update(&sh->sha256, sizeof head, head);
    sha256_update(&sh->sha256, header->length, payload);
}

static int (*const absorbers[])(struct scanhead *sh, const struct native_header *header, const uint8_t *payload) = {
    [NATIVE_DESCRIPTOR] = absorb_descriptor, [NATIVE_EMITTER] = absorb_emitter,       [NATIVE_ANCHOR] = absorb_anchor,
    [NATIVE_POINTS] = absorb_points,         [NATIVE_ATTRIBUTES] = absorb_attributes, [NATIVE_COLOURS] = absorb_colours,
    [NATIVE_WAVES] = absorb_waves,           [NATIVE_POSES] = absorb_poses,           [NATIVE_EVENT] = absorb_event,
    [NATIVE_SURFACES] = absorb_surfaces,
};

int host_absorb(struct scanhead *sh, const struct native_header *header, const uint8_t *payload)
{
    absorb_hash(sh, header, payload);
    follow_sequence(sh, header);
    if (header->version != NATIVE_VERSION)
        return sh_fail(&sh->err, SH_EFORMAT, "%s: the head speaks version %u of the protocol; this library reads %d",
                       sh->source.name, header->version, NATIVE_VERSION);
    /* line end and telemetry change nothing; unknown types are for later readers */
    if (header->type >= sizeof absorbers / sizeof absorbers[0] || absorbers[header->type] == NULL) return 0;
    return absorbers[header->type](sh, header, payload);
}

int scanhead_get_info(const struct scanhead *sh, struct scanhead_info *info)
{
    memset(info, 0, sizeof *info);
    if (!sh->have_descriptor || !sh->have_anchor) return SCANHEAD_ESTATE;
    const struct native_descriptor *d = &sh->descriptor;
    const struct native_anchor *a = &sh->anchor;
    info->idn = d->idn;
    info->profile = d->profile;
    info->geo = d->layout == NATIVE_GEO;
    info->crs = (int)a->crs;
    info->epsg = (int)a->epsg;
    info->scale_m = a->scale_m;
    memcpy(info->scale, a->scale, sizeof info->scale);
    info->geoid_heights = a->heights == NATIVE_HEIGHTS_GEOID;
    info->lat_deg = a->lat_deg;
    info->lon_deg = a->lon_deg;
    info->height_m = a->height_m;
    memcpy(info->anchor, a->anchor, sizeof info->anchor);
    memcpy(info->station_m, a->station_m, sizeof info->station_m);
    memcpy(info->rotation, a->rotation, sizeof info->rotation);
    memcpy(info->axes, a->axes, sizeof info->axes);
    info->prr_hz = (double)d->prr_uhz / 1e6;
    info->lines_hz = (double)d->lines_uhz / 1e6;
    info->pan_deg_s = (double)d->pan_udeg_s / 1e6;
    info->range_min_m = d->range_min_m;
    info->range_max_m = d->range_max_m;
    info->station = a->station;
    info->n_surfaces = d->n_surfaces;
    info->frames = d->frames;
    info->scan = d->scan;
    info->moving = (a->moving & NATIVE_MOVING) != 0;
    info->stop = (a->moving & NATIVE_STOP) != 0;
    info->frame = a->frame;
    return SCANHEAD_OK;
}

/* On the wire the first elevation is rounded to a micro-degree; the exact one is a multiple of the step from -90
 * degrees. */
static void set_rings(struct scanhead_emitter *out, uint32_t gaps)
{
    if (gaps == 0) return;
    out->ring_step_deg = 180.0 / gaps;
    out->first_ring_deg = floor((out->first_ring_deg + 90.0) * gaps / 180.0 + 0.5) * 180.0 / gaps - 90.0;
}

int scanhead_get_emitter(const struct scanhead *sh, struct scanhead_emitter *out)
{
    memset(out, 0, sizeof *out);
    if (!sh->have_descriptor) return SCANHEAD_ESTATE;
    const struct native_emitter *e = &sh->emitter;
    out->kind = (int)e->kind;
    out->steps = e->steps;
    out->first_step = e->first_step;
    out->last_step = e->last_step;
    out->front_step = e->front_step;
    out->turn = e->turn;
    out->rings = e->rings;
    out->first_ring_deg = 1e-6 * (double)e->first_ring_udeg;
    if (e->kind == NATIVE_EMIT_SPHERE) set_rings(out, e->gaps != 0 || e->rings == 0 ? e->gaps : e->rings - 1);
    out->echoes = (int)e->echoes;
    out->sequence_ns_num = e->sequence_ns_num;
    out->sequence_ns_den = e->sequence_ns_den;
    out->n_beams = e->n_beams;
    for (uint32_t i = 0; i < e->n_beams; i++)
        out->beam[i] = (struct scanhead_beam){1e-6 * sh->beam[i].elevation_udeg, 1e-6 * sh->beam[i].azimuth_udeg,
                                              sh->beam[i].offset_ns};
    return SCANHEAD_OK;
}

int scanhead_gps_time(const struct scanhead *sh, int64_t t_ns, double *adjusted_standard_gps_time_s)
{
    if (!sh->times.have_gps || !sh->times.have_scan_t0) return SCANHEAD_ESTATE;
    /* Modulo 2^64, so that a wrong stream can't overflow; seconds and the rest apart, so that only the sum is
     * rounded. */
    uint64_t gps_ns =
        (uint64_t)sh->times.gps_ns + ((uint64_t)sh->times.scan_t0_ns + (uint64_t)t_ns - (uint64_t)sh->times.gps_at_ns);
    int64_t s = (int64_t)gps_ns / 1000000000, ns = (int64_t)gps_ns % 1000000000;
    *adjusted_standard_gps_time_s = (double)(s - 1000000000) + (double)ns / 1e9;
    return SCANHEAD_OK;
}

/* Returns 0 unless all t_ns + shift_ns are 0 to 999999999. The sums count from the second that begins 1e9 + whole_s
 * seconds after 1980-01-06. */
VEC_CLONES static int times_of_second(const int64_t *restrict t_ns, uint32_t n, uint64_t shift_ns, double whole_s,
                                      double *restrict to)
{
    uint64_t any_other = 0;
    for (uint32_t i = 0; i < n; i++) {
        const uint64_t ns = (uint64_t)t_ns[i] + shift_ns;
        any_other |= ns | (999999999 - ns);
        to[i] = whole_s + vec_from_u64(ns) / 1e9;
    }
    return any_other >> 63 == 0;
}

int scanhead_gps_times(const struct scanhead *sh, const int64_t *t_ns, uint32_t n, double *to)
{
    const struct host_times *times = &sh->times;
    if (!times->have_gps || !times->have_scan_t0) return SCANHEAD_ESTATE;
    const uint64_t shift_ns = (uint64_t)times->gps_ns + (uint64_t)times->scan_t0_ns - (uint64_t)times->gps_at_ns;
    const int64_t first_s = n > 0 ? (int64_t)((uint64_t)t_ns[0] + shift_ns) / 1000000000 : 0;
    const uint64_t within_ns = shift_ns - (uint64_t)first_s * 1000000000;
    if (times_of_second(t_ns, n, within_ns, (double)(first_s - 1000000000), to)) return SCANHEAD_OK;
    for (uint32_t i = 0; i < n; i++)
        scanhead_gps_time(sh, t_ns[i], &to[i]);
    return SCANHEAD_OK;
}

int scanhead_surface(const struct scanhead *sh, uint32_t label, const char **object, const char **material)
{
    if (label >= sh->n_surfaces || sh->surface[label].object == NULL) return 0;
    *object = sh->surface[label].object;
    *material = sh->surface[label].material;
    return 1;
}

void scanhead_get_stats(const struct scanhead *sh, struct scanhead_stats *stats)
{
    const struct native_stats *s = &sh->parser.stats;
    *stats = (struct scanhead_stats){
        .bytes = s->bytes,
        .frames = s->frames,
        .bad_payload = s->bad_payload,
        .bad_bytes = s->bad_bytes,
        .seq_gaps = s->seq_gaps,
        .seq_lost = s->seq_lost,
        .dropped = sh->dropped,
        .reader_lost = sh->reader_lost_before + sh->reader_lost,
        /* both count the same losses, and events of either kind may be lost; so the larger count is nearer */
        .pulses_lost = sh->pulses_lost_told > sh->pulses_lost_ended ? sh->pulses_lost_told : sh->pulses_lost_ended,
        .repeated = s->repeated,
        .late = s->late,
        .restarts = s->restarts,
        .cuts = s->cuts,
        .bad_unseen = s->bad_unseen,
        .echoes = sh->notices.echoes,
        .late_replies = sh->notices.late_replies,
        .unasked = sh->notices.unasked,
        .closed = sh->notices.closed,
        .reattached = sh->notices.reattached,
        .refused = sh->notices.refused,
    };
}

void scanhead_hash_start(struct scanhead *sh)
{
    sha256_init(&sh->sha256);
    sh->hashing = 1;
}

void scanhead_hash_hex(const struct scanhead *sh, char hex[65])
{
    struct sha256_ctx ctx = sh->sha256; /* a copy: taking the digest ends the hash */
    if (!sh->hashing) sha256_init(&ctx);
    uint8_t digest[SHA256_DIGEST_SIZE];
    sha256_digest(&ctx, sizeof digest, digest);
    base16_encode_update(hex, sizeof digest, digest);
    hex[64] = 0;
}
