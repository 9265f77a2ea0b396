/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/record/recording_counts.h"

#include <string.h>

#include "drivers/protocol/native.h"
#include "firmware_sim/command/head.h"

/* The scan at hand is over. Where `cast` is less than the pulses received plus those lost, their sum counts instead. */
static void recording_counts_end(struct recording_counts *c, uint64_t fired, uint64_t cast, uint64_t lost)
{
    uint64_t least = c->scan.pulses + lost;
    c->scans++;
    c->fired += fired;
    c->cast += cast > least ? cast : least;
    c->lost += lost;
    c->missing += cast > least ? cast - least : 0;
    c->ended = c->scan.number;
    c->within = 0;
    memset(&c->scan, 0, sizeof c->scan);
}

void recording_count_end(struct recording_counts *c)
{
    if (c->within) recording_counts_end(c, 0, c->scan.pulses + c->scan.lost + c->scan.left_out, c->scan.lost);
}

/* Frames of scan `number` come. Where the scan at hand is another one, its end was lost, and its counts with it. */
static enum recording_news enter(struct recording_counts *c, uint32_t number)
{
    int end_lost = c->within && c->scan.number != 0 && c->scan.number != number;
    if (end_lost) recording_count_end(c);
    c->scan.number = number;
    return end_lost ? RECORDING_END_LOST : RECORDING_NOTHING;
}

static enum recording_news recording_counts_begin(struct recording_counts *c, uint32_t number)
{
    enum recording_news news = enter(c, number);
    if (!c->within) memset(&c->scan, 0, sizeof c->scan); /* overruns of the scan before may have come after its end */
    c->scan.number = number;
    c->ended = 0;
    return news;
}

static enum recording_news take_telemetry(struct recording_counts *c, const struct scanhead_frame *frame,
                                          int frames_lost)
{
    struct native_telemetry t;
    if (native_decode_telemetry(frame->payload, frame->payload_len, &t) != 0) return RECORDING_NOTHING;
    if (c->scan.number == 0 && c->within) c->scan.number = t.scan;
    c->told.scan = t.scan;
    c->told.cast = t.scan_cast;
    if (!c->within || !frames_lost || t.state != HEAD_IDLE) return RECORDING_NOTHING;
    if (c->scan.number == t.scan)
        recording_counts_end(c, t.scan_fired, t.scan_cast, t.scan_lost);
    else
        recording_count_end(c);
    return RECORDING_END_LOST;
}

static enum recording_news take_scan_end(struct recording_counts *c, const struct scanhead_frame *frame)
{
    uint32_t number = (uint32_t)frame->event_value[0];
    uint64_t lost = frame->event_value[2];
    if (number == c->ended && !c->within) return RECORDING_SCAN_OVER; /* telemetry has said so */
    enter(c, number);
    recording_counts_end(c, frame->event_value[1],
                         c->told.scan == number ? c->told.cast : c->scan.pulses + lost + c->scan.left_out, lost);
    return RECORDING_SCAN_OVER;
}

static enum recording_news recording_counts_take_event(struct recording_counts *c, const struct scanhead_frame *frame)
{
    switch (frame->event) {
    case SCANHEAD_EV_SCAN_START:
        return recording_counts_begin(c, (uint32_t)frame->event_value[0]);
    case SCANHEAD_EV_SCAN_END:
        return take_scan_end(c, frame);
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
        c->within = 1;
        c->pulses += frame->n_pulses;
        c->scan.pulses += frame->n_pulses;
        return RECORDING_NOTHING;
    case SCANHEAD_DESCRIPTOR:
        if (native_decode_descriptor(frame->payload, frame->payload_len, &descriptor) != 0) return RECORDING_NOTHING;
        return enter(c, descriptor.scan);
    case SCANHEAD_TELEMETRY:
        return take_telemetry(c, frame, frames_lost);
    case SCANHEAD_EVENT:
        return recording_counts_take_event(c, frame);
    default:
        return RECORDING_NOTHING;
    }
}
