/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/record/recording_counts.h"

#include <string.h>

#include "drivers/protocol/native.h"
#include "firmware_sim/command/head.h"

/* The figures that are known of a scan that ended. */
struct known {
    int is_final;
    uint64_t fired, cast, lost;
};

static uint64_t more_of(uint64_t a, uint64_t b)
{
    return a > b ? a : b;
}

/* The scan at hand is over. Where `cast` is less than the pulses received plus those lost, their sum counts instead. */
static void recording_counts_end(struct recording_counts *c, const struct known *k)
{
    const uint64_t least = c->scan.pulses + k->lost, cast = more_of(k->cast, least);
    c->scans++;
    c->fired += k->fired;
    c->cast += cast;
    c->lost += k->lost;
    c->missing += cast - least;
    c->unknown += !k->is_final;
    memset(&c->due, 0, sizeof c->due);
    if (!k->is_final) {
        c->due.scan = c->scan.number;
        c->due.pulses = c->scan.pulses;
        c->due.fired = k->fired;
        c->due.cast = cast;
        c->due.lost = k->lost;
    }
    c->ended = c->scan.number;
    c->within = 0;
    memset(&c->scan, 0, sizeof c->scan);
}

/* The final counts of the scan that is due have come: they replace what was counted. */
static void correct(struct recording_counts *c, const struct native_telemetry *t)
{
    const uint64_t least = c->due.pulses + t->scan_lost, cast = more_of(t->scan_cast, least);
    c->fired += t->scan_fired - c->due.fired;
    c->cast += cast - c->due.cast;
    c->lost += t->scan_lost - c->due.lost;
    c->missing += cast - least - (c->due.cast - c->due.pulses - c->due.lost);
    c->unknown--;
    memset(&c->due, 0, sizeof c->due);
}

/* Telemetry and events say at least so much of the scan at hand. */
static struct known known_so_far(const struct recording_counts *c)
{
    const int is_told = c->told.scan != 0 && c->told.scan == c->scan.number;
    struct known k = {.cast = c->scan.pulses + c->scan.lost + c->scan.left_out, .lost = c->scan.lost};
    if (!is_told) return k;
    if (c->told.is_final) return (struct known){1, c->told.fired, c->told.cast, c->told.lost};
    k.fired = c->told.fired;
    k.cast = more_of(k.cast, c->told.cast);
    return k;
}

void recording_count_end(struct recording_counts *c)
{
    const struct known k = known_so_far(c);
    if (c->within) recording_counts_end(c, &k);
}

/* Frames of scan `number` come. Where the scan at hand is another one, its end was lost, and its counts with it. */
static enum recording_news enter(struct recording_counts *c, uint32_t number)
{
    int end_lost = c->within && c->scan.number != 0 && c->scan.number != number;
    if (end_lost) recording_count_end(c);
    c->scan.number = number;
    return end_lost ? RECORDING_END_LOST : RECORDING_NOTHING;
}

/* Whether a SCAN_START begins another scan of the same number: that scan has another start, or time has gone back. The
 * event of the scan at hand can come after its first points, where the head lost the tick with it. */
static int is_same_number_again(const struct recording_counts *c, const struct scanhead_frame *frame)
{
    const int64_t t0_ns = (int64_t)frame->event_value[1];
    if (!c->within || c->scan.number != (uint32_t)frame->event_value[0]) return 0;
    return t0_ns != c->scan.t0_ns || frame->t_ns < c->scan.last_ns;
}

static enum recording_news recording_counts_begin(struct recording_counts *c, const struct scanhead_frame *frame)
{
    const uint32_t number = (uint32_t)frame->event_value[0];
    const int is_again = is_same_number_again(c, frame);
    if (is_again) recording_count_end(c);
    enum recording_news news = enter(c, number);
    if (!c->within) {
        memset(&c->scan, 0, sizeof c->scan); /* overruns of the scan before may have come after its end */
        c->scan.is_seen_begin = 1;
    }
    c->scan.number = number;
    c->ended = 0;
    /* An earlier scan of this number was one of another head, or from before this head started again. */
    if (c->told.scan == number) c->told.scan = 0;
    if (c->due.scan == number) c->due.scan = 0;
    return is_again ? RECORDING_END_LOST : news;
}

static enum recording_news take_telemetry(struct recording_counts *c, const struct scanhead_frame *frame,
                                          int frames_lost)
{
    struct native_telemetry t;
    if (native_decode_telemetry(frame->payload, frame->payload_len, &t) != 0) return RECORDING_NOTHING;
    const int is_final = t.state != HEAD_SCANNING;
    if (c->scan.number == 0 && c->within) c->scan.number = t.scan;
    c->told.scan = t.scan;
    c->told.is_final = is_final;
    c->told.fired = t.scan_fired;
    c->told.cast = t.scan_cast;
    c->told.lost = t.scan_lost;
    if (is_final && t.scan != 0 && t.scan == c->due.scan) correct(c, &t);
    if (!c->within || !frames_lost || t.state != HEAD_IDLE) return RECORDING_NOTHING;
    recording_count_end(c);
    return RECORDING_END_LOST;
}

/* SCAN_END has the final counts but for the pulses cast. If no frame was lost since SCAN_START, all others came. */
static enum recording_news take_scan_end(struct recording_counts *c, const struct scanhead_frame *frame,
                                         int frames_lost)
{
    uint32_t number = (uint32_t)frame->event_value[0];
    if (number == c->ended && !c->within) return RECORDING_SCAN_OVER; /* telemetry has said so */
    enter(c, number);
    struct known k = known_so_far(c);
    const uint64_t lost = frame->event_value[2], least = c->scan.pulses + lost + c->scan.left_out;
    k.fired = frame->event_value[1];
    k.cast = k.is_final ? k.cast : more_of(k.cast, least);
    k.lost = lost;
    k.is_final |= c->scan.is_seen_begin && !frames_lost;
    recording_counts_end(c, &k);
    return RECORDING_SCAN_OVER;
}

static enum recording_news recording_counts_take_event(struct recording_counts *c, const struct scanhead_frame *frame,
                                                       int frames_lost)
{
    switch (frame->event) {
    case SCANHEAD_EV_SCAN_START:
        return recording_counts_begin(c, frame);
    case SCANHEAD_EV_SCAN_END:
        return take_scan_end(c, frame, frames_lost);
    case SCANHEAD_EV_OVERRUN:
        c->scan.lost += frame->event_value[1];
        return RECORDING_NOTHING;
    case SCANHEAD_EV_READER_LOST:
        c->left_out += frame->event_value[1];
        c->scan.left_out += frame->event_value[1];
        return RECORDING_NOTHING;
    default:
        return RECORDING_NOTHING;
    }
}

enum recording_news recording_count(struct recording_counts *c, const struct scanhead_frame *frame, int frames_lost)
{
    struct native_descriptor descriptor;
    switch (frame->type) {
    case SCANHEAD_POINTS:
        if (!c->within) c->due.scan = 0; /* no points of a scan come after its end: these are of another one */
        c->within = 1;
        c->pulses += frame->n_pulses;
        c->scan.pulses += frame->n_pulses;
        c->scan.t0_ns = native_since_ns(frame->t_ns, frame->scan_t0_ns);
        c->scan.last_ns = frame->t_ns;
        return RECORDING_NOTHING;
    case SCANHEAD_DESCRIPTOR:
        if (native_decode_descriptor(frame->payload, frame->payload_len, &descriptor) != 0) return RECORDING_NOTHING;
        return enter(c, descriptor.scan);
    case SCANHEAD_TELEMETRY:
        return take_telemetry(c, frame, frames_lost);
    case SCANHEAD_EVENT:
        return recording_counts_take_event(c, frame, frames_lost);
    default:
        return RECORDING_NOTHING;
    }
}
