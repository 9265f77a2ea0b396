/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/cola_way.h"

#include <math.h>
#include <string.h>

#include "drivers/protocol/native.h"

void cola_way_add(struct cola_way *w, uint32_t scan, const uint8_t *payload, size_t len)
{
    struct native_pose p;
    uint32_t n;
    if (native_decode_poses(payload, len, &n) != 0) return;
    native_decode_pose(payload, n - 1, &p);
    if (scan != w->scan || p.t_ns < w->t1_ns) *w = (struct cola_way){.scan = scan};
    const int has_newer = p.t_ns > w->t1_ns; /* neighbouring frames have some poses in common, or all */
    for (uint32_t i = 0; i < n; i++) {
        native_decode_pose(payload, i, &p);
        const double *a = w->at_m, *b = p.position_m;
        if (!w->have_pose) w->t0_ns = w->t1_ns = p.t_ns;
        if (i == 0 && w->have_pose && has_newer) {
            w->t0_ns = w->t1_ns;
            w->path0_m = w->path1_m;
        }
        if (w->have_pose && p.t_ns > w->t1_ns) {
            w->path1_m += hypot(hypot(b[0] - a[0], b[1] - a[1]), b[2] - a[2]);
            w->t1_ns = p.t_ns;
        }
        memcpy(w->at_m, b, sizeof w->at_m);
        w->have_pose = 1;
    }
}

struct cola_encoder cola_way_at(const struct cola_way *w, uint32_t scan, int64_t t_ns)
{
    if (scan != w->scan) return (struct cola_encoder){0, 0};
    const double span_ns = (double)native_since_ns(w->t1_ns, w->t0_ns), way_m = w->path1_m - w->path0_m;
    double part = span_ns > 0 ? (double)native_since_ns(t_ns, w->t0_ns) / span_ns : 1.0;
    double speed_mm_s = span_ns > 0 ? way_m * 1e12 / span_ns : 0.0;
    if (part < 0.0) part = 0.0;
    if (part > 1.0) part = 1.0;
    if (speed_mm_s > INT16_MAX) speed_mm_s = INT16_MAX;
    return (struct cola_encoder){.path_mm = (int32_t)(uint32_t)(uint64_t)llround((w->path0_m + part * way_m) * 1000.0),
                                 .speed_mm_s = (int16_t)lround(speed_mm_s)};
}
