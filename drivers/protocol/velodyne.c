/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/velodyne.h"

#include <math.h>
#include <string.h>

#include "drivers/protocol/native.h"

/* A data packet, little-endian. Single return: a block is two firing sequences. Dual: a pair of blocks is
 * the same two sequences, the last returns in the even one, the strongest (or second strongest) in the odd
 * one.
 *
 *      0 +----------------------------------------------+
 *        | block 0: u16 0xeeff  u16 azimuth 0.01 deg    |
 *        |          32 x { u16 range 2 mm, u8 refl. }   |
 *    100 +----------------------------------------------+
 *        | blocks 1 .. 11                               |
 *   1200 +----------------------------------------------+
 *        | u32 us since the top of the hour             |
 *   1204 | u8 return mode   u8 model                    |
 *   1206 +----------------------------------------------+ */
enum { AT_TIME = 1200, AT_MODE = 1204, AT_MODEL = 1205, ENTRY_LEN = 3, FLAG = 0xeeff };

enum { VELODYNE_VLP16 = 0x22, VELODYNE_HI_RES = 0x24 }; /* VLP-16 and Puck LITE; Puck Hi-Res */

/* Range of the table of reflectivities, 0.01 dB. A reflectance below the table gives 0, one above the table 255. */
enum { REFL_LEAST_CDB = -2302, REFL_MOST_CDB = 3080, N_REFL = REFL_MOST_CDB - REFL_LEAST_CDB + 1 };

struct velodyne {
    struct protocol_spec spec;
    /* the head, from descriptor and emitter frames */
    uint32_t scan;
    double range_units_per_count, azimuth_per_count; /* of 2 mm, of 0.01 degree */
    uint8_t mode, model;                             /* mode 0: no head that this device could be */
    /* the packet at hand */
    uint32_t n_firings; /* in it; 0: none is begun */
    int64_t t0_ns;      /* device time of its first one */
    uint64_t next_pulse;
    int in_step;      /* 1: next_pulse is the one that has to come */
    int is_left_over; /* 1: the beginning of this firing sequence is missing, and its other pulses count as unsent */
    uint8_t packet[VELODYNE_DATA_LEN];
    uint8_t reflectivity[N_REFL];
};

uint32_t velodyne_hour_us(const struct protocol_host *host, int64_t t_ns)
{
    int64_t hour_ns;
    host->pps(host->ctx, t_ns, &hour_ns);
    return (uint32_t)(hour_ns / 1000);
}

enum protocol_pps velodyne_pps(const struct protocol_host *host, int64_t t_ns)
{
    int64_t hour_ns;
    return host->pps(host->ctx, t_ns, &hour_ns);
}

uint8_t velodyne_reflectivity(int refl_cdb)
{
    if (refl_cdb < REFL_LEAST_CDB) return 0;
    if (refl_cdb >= REFL_MOST_CDB) return 255;
    if (refl_cdb <= 0) return (uint8_t)lround(100.0 * pow(10.0, refl_cdb / 1000.0));
    return (uint8_t)(101 + refl_cdb / 20);
}

static int velodyne_begin(void *protocol, struct sh_err *err)
{
    struct velodyne *v = protocol;
    (void)err;
    for (int i = 0; i < N_REFL; i++)
        v->reflectivity[i] = velodyne_reflectivity(REFL_LEAST_CDB + i);
    for (int b = 0; b < VELODYNE_BLOCKS; b++)
        le_put16(v->packet + b * VELODYNE_BLOCK_LEN, FLAG);
    return SH_OK;
}

/* The next pulse does not follow the last one, or another scan or head begins. So the packet is dropped: the device has
 * no packets with holes. The packet's pulses count as unsent, not as lost by a slow reader: the pulses that would fill
 * the packet never came. */
static void fall_out_of_step(struct velodyne *v)
{
    v->spec.host.count(v->spec.host.ctx, PROTOCOL_PULSES_UNSENT, v->n_firings);
    v->n_firings = 0;
    if (v->in_step) v->is_left_over = 1;
    v->in_step = 0;
}

static void take_descriptor(struct velodyne *v, const uint8_t *payload, size_t len)
{
    struct native_descriptor d;
    if (native_decode_descriptor(payload, len, &d) != SH_OK) return;
    if (d.scan != v->scan) fall_out_of_step(v);
    v->scan = d.scan;
    v->range_units_per_count = d.range_scale_m / 0.002;
    /* In the polar layout pan_counts_per_turn is at least 1. fmax() keeps the 0 of another layout from the division. */
    v->azimuth_per_count = 36000.0 / fmax(d.pan_counts_per_turn, 1.0);
}

/* Finds the model by the elevations of the beams in the order of firing, as packets have it. 0: none has them. */
static uint8_t model_of(const struct native_beam *beam)
{
    static const struct {
        uint8_t model;
        int32_t step_udeg;
    } models[] = {{VELODYNE_VLP16, 2000000}, {VELODYNE_HI_RES, 1333333}};
    for (size_t m = 0; m < sizeof models / sizeof models[0]; m++) {
        int k = 0;
        for (; k < VELODYNE_BEAMS; k++) {
            /* beams 0, 2, 4 ... are the lower half from below, 1, 3, 5 ... the upper half */
            double place = k / 2 + (k % 2 != 0 ? VELODYNE_BEAMS / 2 : 0) - (VELODYNE_BEAMS - 1) / 2.0;
            if (fabs(beam[k].elevation_udeg - place * models[m].step_udeg) > 10000.0) break;
        }
        if (k == VELODYNE_BEAMS) return models[m].model;
    }
    return 0;
}

static void take_emitter(struct velodyne *v, const uint8_t *payload, size_t len)
{
    static const uint8_t modes[] = {[NATIVE_ECHOES_ALL] = VELODYNE_DUAL,
                                    [NATIVE_ECHOES_FIRST] = 0, /* the device has no such mode */
                                    [NATIVE_ECHOES_LAST] = VELODYNE_LAST,
                                    [NATIVE_ECHOES_STRONGEST] = VELODYNE_STRONGEST};
    struct native_emitter e;
    struct native_beam beam[VELODYNE_BEAMS];
    uint8_t mode = 0, model = 0;
    if (native_decode_emitter(payload, len, &e) != SH_OK) return;
    if (e.kind == NATIVE_EMIT_BEAMS && e.n_beams == VELODYNE_BEAMS && e.echoes < sizeof modes) {
        for (uint32_t i = 0; i < VELODYNE_BEAMS; i++)
            native_decode_beam(payload, i, &beam[i]);
        mode = modes[e.echoes];
        model = model_of(beam);
        if (model == 0) model = VELODYNE_VLP16;
    }
    if (mode != v->mode || model != v->model) fall_out_of_step(v);
    v->mode = mode;
    v->model = model;
}

/* Writes a point as range and reflectivity. Returns 1 if it is an echo whose range can't be written: the range rounds
 * to 0, or needs more than 16 bits. */
static uint32_t put_entry(const struct velodyne *v, uint8_t *at, const struct native_point *p)
{
    double units = p->echo == 0 ? 0.0 : p->a * v->range_units_per_count + 0.5;
    const int is_lost = units >= 65536.0 || (p->echo != 0 && units < 1.0);
    uint8_t refl = 0;
    if (is_lost) units = 0.0;
    if (units >= 1.0 && p->refl_cdb >= REFL_LEAST_CDB)
        refl = p->refl_cdb < REFL_MOST_CDB ? v->reflectivity[p->refl_cdb - REFL_LEAST_CDB] : 255;
    le_put16(at, (uint16_t)units);
    at[2] = refl;
    return (uint32_t)is_lost;
}

/* Received power in 0.01 dB, up to a constant of the head: from the reflectance and the square of the range.
 * Without modelled reflectances the nearest is the strongest. */
static double strength_cdb(const struct native_point *p)
{
    const double refl_cdb = p->refl_cdb == (int16_t)LINE_REFL_NONE ? 0.0 : p->refl_cdb;
    return refl_cdb - 2000.0 * log10(p->a);
}

/* The index of the strongest of n points from `first` on. */
static uint32_t strongest(const uint8_t *payload, uint32_t first, uint32_t n)
{
    double best_cdb = -INFINITY;
    uint32_t best = first;
    for (uint32_t i = first; i < first + n; i++) {
        struct native_point p;
        native_decode_point(payload, i, &p);
        if (strength_cdb(&p) <= best_cdb) continue;
        best_cdb = strength_cdb(&p);
        best = i;
    }
    return best;
}

static void send_packet(struct velodyne *v)
{
    le_put32(v->packet + AT_TIME, velodyne_hour_us(&v->spec.host, v->t0_ns));
    v->packet[AT_MODE] = v->mode;
    v->packet[AT_MODEL] = v->model;
    v->spec.host.send(v->spec.host.ctx, v->packet, sizeof v->packet);
    v->n_firings = 0;
}

static void put_azimuth(const struct velodyne *v, uint8_t *block, uint32_t pan_count)
{
    le_put16(block + 2, (uint16_t)((uint32_t)(pan_count * v->azimuth_per_count + 0.5) % 36000u));
}

/* The return for the odd block of a pair: the strongest of n > 1 returns or, if that is the last one, the second
 * strongest. */
static void find_other(const uint8_t *payload, uint32_t first, uint32_t n, struct native_point *out)
{
    uint32_t at = strongest(payload, first, n);
    if (at == first + n - 1) at = strongest(payload, first, n - 1);
    native_decode_point(payload, at, out);
}

/* One firing: n points from `first` on. */
static void add_firing(struct velodyne *v, const uint8_t *payload, uint32_t first, uint32_t n, int64_t frame_t_ns)
{
    const uint32_t entry = v->n_firings % VELODYNE_BLOCK_FIRINGS, pair = v->n_firings / VELODYNE_BLOCK_FIRINGS;
    const int dual = v->mode == VELODYNE_DUAL;
    uint8_t *block = v->packet + pair * VELODYNE_BLOCK_LEN * (dual ? 2u : 1u), *at = block + 4 + entry * ENTRY_LEN;
    struct native_point p;
    native_decode_point(payload, first + n - 1, &p); /* the last; of a single return the only one */
    if (v->n_firings == 0) v->t0_ns = native_after_ns(frame_t_ns, p.dt_ns);
    if (entry == 0) put_azimuth(v, block, p.c);
    uint32_t n_lost = put_entry(v, at, &p);
    if (dual) {
        if (entry == 0) put_azimuth(v, block + VELODYNE_BLOCK_LEN, p.c);
        if (n > 1) find_other(payload, first, n, &p);
        const uint32_t other_lost = put_entry(v, at + VELODYNE_BLOCK_LEN, &p);
        if (n > 1) n_lost += other_lost; /* a single return is in both blocks, and counts once */
    }
    if (n_lost != 0) v->spec.host.count(v->spec.host.ctx, PROTOCOL_POINTS_LOST, n_lost);
    v->n_firings++;
    if (v->n_firings == (dual ? VELODYNE_PACKET_FIRINGS / 2 : VELODYNE_PACKET_FIRINGS)) send_packet(v);
}

/* How many points the pulse has that begins at i; all are in this frame. */
static uint32_t points_of_pulse(const uint8_t *payload, uint32_t i, uint32_t n_points)
{
    struct native_point p;
    native_decode_point(payload, i, &p);
    const uint32_t n = p.echo_count > 1 ? p.echo_count : 1;
    return n < n_points - i ? n : n_points - i;
}

static void velodyne_take_points(struct velodyne *v, const uint8_t *payload, size_t len, int64_t frame_t_ns)
{
    struct native_points head;
    if (native_decode_points(payload, len, &head) != SH_OK) return;
    if (v->mode == 0) {
        v->spec.host.count(v->spec.host.ctx, PROTOCOL_PULSES_UNSENT, head.n_pulses);
        return;
    }
    if (v->in_step && head.pulse0 != v->next_pulse) fall_out_of_step(v);
    uint64_t pulse = head.pulse0, unsent = 0;
    for (uint32_t i = 0, n; i < head.n_points; i += n, pulse++) {
        n = points_of_pulse(payload, i, head.n_points);
        if (!v->in_step && pulse % VELODYNE_BEAMS != 0) {
            unsent += (uint64_t)v->is_left_over;
            continue;
        }
        v->in_step = 1;
        v->is_left_over = 0;
        add_firing(v, payload, i, n, frame_t_ns);
    }
    v->next_pulse = pulse;
    v->spec.host.count(v->spec.host.ctx, PROTOCOL_PULSES_UNSENT, unsent);
}

static void velodyne_take_event(struct velodyne *v, const uint8_t *payload, size_t len)
{
    struct native_event e;
    if (native_decode_event(payload, len, &e) != SH_OK) return;
    if (e.code == NATIVE_EV_SCAN_END || e.code == NATIVE_EV_SCAN_START) fall_out_of_step(v);
}

static void velodyne_take_frame(void *protocol, const uint8_t *bytes, size_t len)
{
    struct velodyne *v = protocol;
    const uint8_t *payload = bytes + NATIVE_HEADER_LEN;
    struct native_header header;
    native_read_header(bytes, &header);
    len -= NATIVE_HEADER_LEN;
    if (header.type == NATIVE_POINTS) velodyne_take_points(v, payload, len, header.t_ns);
    if (header.type == NATIVE_DESCRIPTOR) take_descriptor(v, payload, len);
    if (header.type == NATIVE_EMITTER) take_emitter(v, payload, len);
    if (header.type == NATIVE_EVENT) velodyne_take_event(v, payload, len);
}

static void velodyne_take_gap(void *protocol, uint32_t n_frames)
{
    struct velodyne *v = protocol;
    (void)n_frames;
    if (v->n_firings != 0) v->spec.host.count(v->spec.host.ctx, PROTOCOL_UNITS_LOST, 1);
    v->n_firings = 0;
    fall_out_of_step(v);
    v->is_left_over = 0; /* the loss of the gap includes the other pulses of this firing sequence */
}

/* Readers take times of firing from the model's number. They take elevations from it, too, or from a calibration file,
 * which may have any. */
static int check_head(const struct native_descriptor *d, const struct native_emitter *e, const uint8_t *beams,
                      struct sh_err *err)
{
    enum { FIRING_NS = 2304, SEQUENCE_NS = 55296 };
    (void)d;
    int are_times = e->sequence_ns_num == e->sequence_ns_den * SEQUENCE_NS && e->turn > 0;
    for (uint32_t i = 0; i < VELODYNE_BEAMS; i++) {
        struct native_beam beam;
        native_decode_beam(beams, i, &beam);
        are_times &= beam.offset_ns == i * FIRING_NS && beam.azimuth_udeg == 0;
    }
    if (are_times) return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "another firing sequence; allowed is that of a VLP-16: clockwise, 55.296 us, with "
                   "a beam each 2.304 us, all at azimuth 0");
}

/* Marks the bytes of ranges and reflectivities. */
static void mark_entries(const uint8_t *packet, size_t len, uint8_t *mask)
{
    (void)packet;
    for (size_t block = 0; block < VELODYNE_BLOCKS && (block + 1) * VELODYNE_BLOCK_LEN <= len; block++)
        memset(mask + block * VELODYNE_BLOCK_LEN + 4, 0xff, VELODYNE_BLOCK_LEN - 4);
}

const struct protocol_ops protocol_velodyne = {
    .name = "velodyne",
    .needs = PROTOCOL_NEEDS_POLAR | PROTOCOL_NEEDS_LAST,
    .emitters = 1u << NATIVE_EMIT_BEAMS,
    .n_beams = VELODYNE_BEAMS,
    .max_unit = VELODYNE_DATA_LEN,
    .content = mark_entries,
    .check_head = check_head,
    .size = sizeof(struct velodyne),
    .begin = velodyne_begin,
    .frame = velodyne_take_frame,
    .gap = velodyne_take_gap,
    .input = protocol_lose_input,
};
