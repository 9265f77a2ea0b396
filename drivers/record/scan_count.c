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

void scan_count_frame(struct scan_count *count, const uint8_t *frame)
{
    struct native_header header;
    struct native_descriptor d;
    native_read_header(frame, &header);
    int begins = header.type == NATIVE_POINTS && count->n_scans == 0;
    if (header.type == NATIVE_DESCRIPTOR &&
        native_decode_descriptor(frame + NATIVE_HEADER_LEN, header.length, &d) == 0) {
        begins = scan_count_begins(count, &d, &header);
        count->number = d.scan;
        count->t_ns = header.t_ns;
    }
    count->n_scans += (uint64_t)begins;
}
