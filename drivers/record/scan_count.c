/* SPDX-License-Identifier: MIT */
#include "drivers/record/scan_count.h"

/* Between scans the head repeats the descriptor of the last scan, which begins no scan. If a repeated descriptor has
 * another scan number than the one before, the first descriptor of a new scan was lost. A head that was started again
 * counts scans from 1 again, and its time begins anew. */
static int scan_count_begins(const struct scan_count *count, const struct native_descriptor *d,
                             const struct native_header *header)
{
    const int is_other = d->scan != count->number;
    if ((header->flags & NATIVE_REPEAT) != 0)
        return count->n_scans != 0 && is_other && count->number != 0 && d->scan != 0;
    return count->n_scans == 0 || is_other || header->t_ns < count->t_ns;
}

/* The head has started again where a scan with another start has the number of the last one. */
static int scan_count_starts(const struct scan_count *count, const struct native_event *e)
{
    return e->code == NATIVE_EV_SCAN_START && count->has_points && e->a == count->number &&
           (int64_t)e->b != count->begin_ns;
}

void scan_count_frame(struct scan_count *count, const uint8_t *frame)
{
    struct native_header header;
    struct native_descriptor d;
    struct native_points points;
    struct native_event event;
    native_read_header(frame, &header);
    const uint8_t *payload = frame + NATIVE_HEADER_LEN;
    int begins = header.type == NATIVE_POINTS && count->n_scans == 0;
    if (header.type == NATIVE_POINTS && native_decode_points(payload, header.length, &points) == 0) {
        count->has_points = 1;
        count->begin_ns = native_since_ns(header.t_ns, points.t0_ns);
    }
    if (header.type == NATIVE_EVENT && native_decode_event(payload, header.length, &event) == 0 &&
        scan_count_starts(count, &event)) {
        begins = 1;
        count->has_points = 0;
        count->t_ns = header.t_ns;
    }
    if (header.type == NATIVE_DESCRIPTOR && native_decode_descriptor(payload, header.length, &d) == 0) {
        begins = scan_count_begins(count, &d, &header);
        if (begins) count->has_points = 0;
        count->number = d.scan;
        count->t_ns = header.t_ns;
    }
    count->n_scans += (uint64_t)begins;
}
