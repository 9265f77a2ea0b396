/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/progress.h"

#include <math.h>
#include <string.h>

#include "drivers/protocol/native.h"

double progress_left_s(struct progress_pace *pace, const char *what, double fraction, int64_t now_ns)
{
    size_t n = strcspn(what, ":");
    if (n >= sizeof pace->what) n = sizeof pace->what - 1;
    if (strlen(pace->what) != n || memcmp(pace->what, what, n) != 0 || fraction < pace->fraction) {
        memcpy(pace->what, what, n);
        pace->what[n] = '\0';
        pace->since_ns = now_ns;
        pace->fraction = fraction;
    }
    const double done = fraction - pace->fraction;
    if (fraction < 0 || done <= 0 || now_ns <= pace->since_ns) return -1;
    return 1e-9 * (double)(now_ns - pace->since_ns) * (1 - fmin(1, fraction)) / done;
}

/* `frames` counts sweeps of the pan, or lines where the pan stands still (core/schedule.h). */
double progress_scan_s(const struct scanhead_frame *frame)
{
    struct native_descriptor d;
    if (frame->type != SCANHEAD_DESCRIPTOR || native_decode_descriptor(frame->payload, frame->payload_len, &d) != 0)
        return 0;
    const double sweep_udeg = fabs((double)d.pan_stop_udeg - (double)d.pan_start_udeg);
    const double line_s = d.lines_uhz > 0 ? 1e6 / (double)d.lines_uhz : 0;
    const double frame_s = d.pan_udeg_s > 0 ? sweep_udeg / (double)d.pan_udeg_s : 0;
    return d.frames * fmax(frame_s, line_s);
}
