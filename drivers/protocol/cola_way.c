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
    if (scan != w->scan || p.t_ns < w->t_ns[2]) *w = (struct cola_way){.scan = scan};
    if (w->have_pose && p.t_ns > w->t_ns[2]) { /* neighbouring frames have some poses in common, or all */
        memmove(w->t_ns, w->t_ns + 1, 2 * sizeof *w->t_ns);
        memmove(w->path_m, w->path_m + 1, 2 * sizeof *w->path_m);
    }
    for (uint32_t i = 0; i < n; i++) {
        native_decode_pose(payload, i, &p);
        const double *a = w->at_m, *b = p.position_m;
        if (!w->have_pose) w->t_ns[0] = w->t_ns[1] = w->t_ns[2] = p.t_ns;
        if (w->have_pose && p.t_ns > w->t_ns[2]) {
            w->path_m[2] += hypot(hypot(b[0] - a[0], b[1] - a[1]), b[2] - a[2]);
            w->t_ns[2] = p.t_ns;
        }
        memcpy(w->at_m, b, sizeof w->at_m);
        w->have_pose = 1;
    }
}

struct cola_encoder cola_way_at(const struct cola_way *w, uint32_t scan, int64_t t_ns)
{
    if (scan != w->scan) return (struct cola_encoder){0, 0};
    const int from = t_ns >= w->t_ns[1] || w->t_ns[0] == w->t_ns[1]; /* the interval that has the time begins here */
    const double span_ns = (double)native_since_ns(w->t_ns[from + 1], w->t_ns[from]);
    const double way_m = w->path_m[from + 1] - w->path_m[from];
    double part = span_ns > 0 ? (double)native_since_ns(t_ns, w->t_ns[from]) / span_ns : 1.0;
    double speed_mm_s = span_ns > 0 ? way_m * 1e12 / span_ns : 0.0;
    if (part < 0.0) part = 0.0;
    if (part > 1.0) part = 1.0;
    if (speed_mm_s > INT16_MAX) speed_mm_s = INT16_MAX;
    const long long path_mm = llround((w->path_m[from] + part * way_m) * 1000.0);
    return (struct cola_encoder){.path_mm = (int32_t)(uint32_t)(uint64_t)path_mm,
                                 .speed_mm_s = (int16_t)lround(speed_mm_s)};
}
