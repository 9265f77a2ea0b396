/* SPDX-License-Identifier: MIT */
/* Shades a picture of points: closes holes between them, smooths their depths to surfaces, and lights these. */
#include <math.h>
#include <stdlib.h>

#include "core/studio/analysis/view_inside.h"

enum { CLOSE_REACH = 3, SMOOTH_REACH = 3 };

/* Depths that differ by more than this share of the depth are of two surfaces. */
#define SAME_SURFACE 0.004f

static const int compass[8][2] = {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}};

/* A place without a point that has points on at least six of eight sides takes the nearest of them. */
static void close_hole(const struct view *view, int x, int y, float *depth_m, uint32_t *near)
{
    int sides = 0, least = CLOSE_REACH + 1;
    size_t found = 0;
    for (int s = 0; s < 8; s++)
        for (int k = 1; k <= CLOSE_REACH; k++) {
            const int cx = x + k * compass[s][0], cy = y + k * compass[s][1];
            if (cx < 0 || cy < 0 || cx >= (int)view->width || cy >= (int)view->height) break;
            const size_t at = (size_t)cy * view->width + (size_t)cx;
            if (!isfinite(view->place[at].order_m)) continue;
            sides++;
            if (k < least) found = at;
            if (k < least) least = k;
            break;
        }
    if (sides < 6) return;
    const size_t i = (size_t)y * view->width + (size_t)x;
    depth_m[i] = view->place[found].depth_m;
    near[i] = (uint32_t)found;
}

/* Takes means along one axis, over depths that change evenly and little. Weights fall with the second difference of the
 * depths and with their slope, both as shares of the depth. */
static void smooth_line(const float *in, float *out, size_t n, size_t step)
{
    for (size_t i = 0; i < n; i++) {
        const float own = in[i * step];
        out[i * step] = own;
        if (!isfinite(own)) continue;
        float sum = own, weight = 1;
        for (size_t k = 1; k <= SMOOTH_REACH; k++) {
            if (i < k || i + k >= n) break;
            const float before = in[(i - k) * step], after = in[(i + k) * step];
            if (!isfinite(before) || !isfinite(after)) break;
            const float mean = 0.5f * (before + after), off = (mean - own) / (SAME_SURFACE * own);
            const float slope = (after - before) / (16 * SAME_SURFACE * own);
            const float w = 2 / (1 + off * off * off * off) / (1 + slope * slope * slope * slope);
            sum += w * mean;
            weight += w;
        }
        out[i * step] = sum / weight;
    }
}

int view_smooth(const struct view *view, float *depth_m, uint32_t *near, struct sh_err *err)
{
    const size_t w = view->width, h = view->height;
    float *other = malloc(w * h * sizeof *other);
    if (other == NULL) return sh_fail(err, SH_ENOMEM, "view: no memory for shading");
    for (size_t i = 0; i < w * h; i++) {
        depth_m[i] = view->place[i].depth_m;
        near[i] = (uint32_t)i;
    }
    for (size_t i = 0; i < w * h; i++)
        if (!isfinite(view->place[i].order_m)) close_hole(view, (int)(i % w), (int)(i / w), depth_m, near);
    for (int pass = 0; pass < 2; pass++) {
        for (size_t y = 0; y < h; y++)
            smooth_line(depth_m + y * w, other + y * w, w, 1);
        for (size_t x = 0; x < w; x++)
            smooth_line(other + x, depth_m + x, h, w);
    }
    free(other);
    return SH_OK;
}

/* Returns Boucheny's response: how much nearer the eight neighbours at a distance are, in logarithms of depth. A place
 * without depth, as the sky, is infinitely far and darkens none. */
static float nearer(const struct view *view, const float *log_depth, int x, int y, int reach)
{
    const float own = log_depth[(size_t)y * view->width + (size_t)x];
    const int slant = (int)lrintf(0.7f * (float)reach);
    float sum = 0;
    for (int s = 0; s < 8; s++) {
        const int by = s % 2 ? slant : reach, cx = x + by * compass[s][0], cy = y + by * compass[s][1];
        if (cx < 0 || cy < 0 || cx >= (int)view->width || cy >= (int)view->height) continue;
        const float other = log_depth[(size_t)cy * view->width + (size_t)cx];
        sum += fminf(0.06f, fmaxf(0, own - other));
    }
    return sum / 8;
}

/* Finds where a place of the image lies in space: right, up, ahead from the eye. */
static void spot(const struct view *view, const float *depth_m, int x, int y, float p[3])
{
    const float d = depth_m[(size_t)y * view->width + (size_t)x];
    p[0] = ((float)x + 0.5f - 0.5f * (float)view->width) / (float)view->focal * d;
    p[1] = (0.5f * (float)view->height - (float)y - 0.5f) / (float)view->focal * d;
    p[2] = d;
}

/* Sets `out` to the difference to one of two neighbours, the one whose depth differs less. Returns 0 if neither has a
 * depth. */
static int slope(const struct view *view, const float *depth_m, const int at[2], const int step[2], float out[3])
{
    float own[3], side[2][3];
    int use = -1;
    spot(view, depth_m, at[0], at[1], own);
    for (int s = 0; s < 2; s++) {
        const int cx = at[0] + (s ? -step[0] : step[0]), cy = at[1] + (s ? -step[1] : step[1]);
        side[s][2] = INFINITY;
        if (cx < 0 || cy < 0 || cx >= (int)view->width || cy >= (int)view->height) continue;
        spot(view, depth_m, cx, cy, side[s]);
    }
    for (int s = 0; s < 2; s++)
        if (isfinite(side[s][2]) && (use < 0 || fabsf(side[s][2] - own[2]) < fabsf(side[use][2] - own[2]))) use = s;
    if (use < 0) return 0;
    for (int i = 0; i < 3; i++)
        out[i] = (side[use][i] - own[i]) * (use ? -1.0f : 1.0f);
    return 1;
}

/* Returns the brightness by Lambert's law: 0.38 of the light is at the eye's upper left, 0.62 comes from all sides. */
static float facing(const struct view *view, const float *depth_m, int x, int y)
{
    static const int right[2] = {3, 0}, up[2] = {0, -3};
    static const float light[3] = {-0.40f, 0.62f, -0.674f}; /* right, up, ahead: towards the light */
    const int at[2] = {x, y};
    float a[3], b[3];
    if (!slope(view, depth_m, at, right, a) || !slope(view, depth_m, at, up, b)) return 0.8f;
    float n[3] = {b[1] * a[2] - b[2] * a[1], b[2] * a[0] - b[0] * a[2], b[0] * a[1] - b[1] * a[0]};
    const float length = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (!(length > 0)) return 0.8f;
    float cosine = (n[0] * light[0] + n[1] * light[1] + n[2] * light[2]) / length;
    if (n[2] > 0) cosine = -cosine; /* surfaces show the side that is seen */
    return 0.62f + 0.38f * fmaxf(0, cosine);
}

int view_shade(const struct view *view, const float *depth_m, const struct view_colours *colours, float *log_depth,
               float *light, struct sh_err *err)
{
    const float strength = (float)colours->shade;
    static const struct {
        int reach;
        float weight;
    } scale[] = {{2, 14}, {5, 9}, {12, 5}, {28, 3}};
    const int w = (int)view->width, h = (int)view->height;
    for (size_t i = 0; i < (size_t)view->width * view->height; i++)
        log_depth[i] = logf(depth_m[i]);
    for (int y = 0; y < h; y++) {
        if (sh_stopped(colours->report)) return sh_fail_stopped(err);
        sh_progress(colours->report, "shading the picture", (double)y / h);
        for (int x = 0; x < w; x++) {
            const size_t i = (size_t)y * view->width + (size_t)x;
            light[i] = 1;
            if (!isfinite(depth_m[i]) || !(strength > 0)) continue;
            float dark = 0;
            for (size_t s = 0; s < sizeof scale / sizeof scale[0]; s++)
                dark += scale[s].weight * nearer(view, log_depth, x, y, scale[s].reach);
            light[i] = powf(facing(view, depth_m, x, y), strength) * expf(-strength * dark);
        }
    }
    return SH_OK;
}
