/* SPDX-License-Identifier: MIT */
/* Decodes the stream frames that follow the points: attributes and colour of each point, sums of each line. waves.c has
 * waveforms. */
#include <math.h>
#include <string.h>

#include "core/vecmath.h"
#include "drivers/host/host.h"
#include "drivers/protocol/native_waves.h"

int host_has_content(const struct scanhead *sh, enum native_content content)
{
    if (!sh->have_descriptor) return SCANHEAD_ESTATE;
    return (sh->descriptor.content & (uint32_t)content) != 0;
}

int scanhead_has_attributes(const struct scanhead *sh)
{
    return host_has_content(sh, NATIVE_HAS_ATTRIBUTES);
}

int scanhead_has_colours(const struct scanhead *sh)
{
    return host_has_content(sh, NATIVE_HAS_COLOURS);
}

int scanhead_has_deviations(const struct scanhead *sh)
{
    return host_has_content(sh, NATIVE_HAS_DEVIATIONS);
}

/* Returns whether the frame's number is that of the last points frame plus `after`, and the frame belongs to these
 * points. */
static int is_of_points(const struct scanhead *sh, const struct scanhead_frame *frame, uint32_t after)
{
    return sh->have_points && frame->seq == sh->points_seq + after && frame->pulse0 == sh->of_points.pulse0 &&
           frame->scan_line == sh->of_points.line && frame->n_points == sh->of_points.n_points;
}

/* Returns how many attributes, or colours, there are from `first` on, at most max; or an error. */
static int attributes_from(struct scanhead *sh, const struct scanhead_frame *frame, enum scanhead_frame_type type,
                           uint32_t first, uint32_t max)
{
    const int is_colours = type == SCANHEAD_COLOURS, rc = host_check_last(sh, frame, type);
    if (rc != 0) return rc;
    if (!is_of_points(sh, frame, is_colours && scanhead_has_attributes(sh) == 1 ? 2 : 1))
        return sh_fail(&sh->err, SCANHEAD_ESTATE, "%s: the points of these %s were lost", sh->source.name,
                       is_colours ? "colours" : "attributes");
    const uint32_t n = first < frame->n_points ? frame->n_points - first : 0;
    return (int)(n < max ? n : max);
}

/* Indices begin at 0, and `from` is at the first record wanted. Compilers make no vectors of an index that is a sum, as
 * it may wrap. */
VEC_CLONES static void set_deviations(const uint8_t *restrict from, uint32_t n_points, uint32_t n,
                                      double *restrict deviation)
{
    for (uint32_t i = 0; i < n; i++)
        deviation[i] = native_decode_deviation(from, n_points, i) / 1000.0;
}

VEC_CLONES static void set_attributes(const uint8_t *restrict from, uint32_t n,
                                      struct scanhead_attribute *restrict attributes)
{
    for (uint32_t i = 0; i < n; i++) {
        struct native_attribute a;
        native_decode_attribute(from, i, &a);
        attributes[i].amplitude_db = a.amplitude_cdb == NATIVE_AMPLITUDE_NONE ? (double)NAN : a.amplitude_cdb / 100.0;
        attributes[i].width_ns = a.width_cns == NATIVE_WIDTH_NONE ? (double)NAN : a.width_cns / 100.0;
    }
}

int scanhead_deviations(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first, double *deviation,
                        uint32_t max)
{
    if (scanhead_has_deviations(sh) != 1)
        return sh_fail(&sh->err, SCANHEAD_ESTATE, "%s: the head's attributes have no deviations", sh->source.name);
    const int n = attributes_from(sh, frame, SCANHEAD_ATTRIBUTES, first, max);
    if (n > 0)
        set_deviations(frame->payload + (size_t)first * NATIVE_DEVIATION_LEN, frame->n_points, (uint32_t)n, deviation);
    return n;
}

int scanhead_attributes(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first,
                        struct scanhead_attribute *attributes, uint32_t max)
{
    const int n = attributes_from(sh, frame, SCANHEAD_ATTRIBUTES, first, max);
    if (n > 0) set_attributes(frame->payload + (size_t)first * NATIVE_ATTRIBUTE_LEN, (uint32_t)n, attributes);
    return n;
}

int scanhead_colours(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first,
                     struct scanhead_colour *colours, uint32_t max)
{
    const int n = attributes_from(sh, frame, SCANHEAD_COLOURS, first, max);
    _Static_assert(sizeof *colours == NATIVE_COLOUR_LEN, "a colour is as on the wire");
    if (n > 0)
        memcpy(colours, frame->payload + NATIVE_COLOURS_HEAD_LEN + (size_t)first * NATIVE_COLOUR_LEN,
               (size_t)n * sizeof *colours);
    return n;
}

int scanhead_line_end(struct scanhead *sh, const struct scanhead_frame *frame, struct scanhead_line_end *end)
{
    struct line_end wire;
    if (frame->type != SCANHEAD_LINE_END || frame->payload == NULL)
        return sh_fail(&sh->err, SCANHEAD_EINPUT, "this is not a line end frame");
    if (native_decode_line_end(frame->payload, frame->payload_len, &wire) != 0)
        return sh_fail(&sh->err, SCANHEAD_EFORMAT, "%s: a line end frame is too short", sh->source.name);
    *end = (struct scanhead_line_end){.scan_frame = wire.frame,
                                      .scan_line = wire.line,
                                      .pulse0 = wire.pulse0,
                                      .t0_ns = wire.t0_ns,
                                      .t1_ns = wire.t1_ns,
                                      .n_fired = wire.n_fired,
                                      .n_cast = wire.n_cast,
                                      .n_echoes = wire.n_echoes,
                                      .mirror_count = wire.mirror_count,
                                      .pan_count = wire.pan_count,
                                      .status = wire.status,
                                      .n_crowded = wire.n_crowded,
                                      .n_faint = wire.n_faint,
                                      .n_unfit = wire.n_unfit};
    return SCANHEAD_OK;
}
