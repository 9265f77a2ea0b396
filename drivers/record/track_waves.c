/* SPDX-License-Identifier: MIT */
/* Windows of waveforms, kept until the points that lie in them are given out. */
#include <math.h>
#include <stdlib.h>

#include "core/grow.h"
#include "drivers/protocol/native.h"
#include "drivers/record/track_inside.h"

/* This much is kept for one frame of points. A head has at most as many windows as 64 MiB of samples fill; a broken
 * stream might have more. */
enum { WAVES_MOST_BYTES = 64 << 20, WAVES_AT_ONCE = 64 };

struct kept_wave {
    struct scanhead_wave wave;
    size_t sample_at;
    int is_used;
};

struct track_waves {
    struct kept_wave *wave;
    size_t n, room, at; /* windows before `at` belong to pulses before the one that was asked for last */
    uint8_t *sample;
    size_t n_bytes, bytes_room;
};

static int keep_wave(struct track *t, const struct scanhead_wave *wave)
{
    struct track_waves *w = t->waves;
    const size_t len = 2 * (size_t)wave->n;
    if (w->n_bytes + len + (w->n + 1) * sizeof *w->wave > WAVES_MOST_BYTES) {
        t->missing.n_waves_unplaced++;
        return 1;
    }
    if (!grow(&w->wave, &w->room, w->n + 1, sizeof *w->wave) || !grow(&w->sample, &w->bytes_room, w->n_bytes + len, 1))
        return 0;
    memcpy(w->sample + w->n_bytes, wave->sample, len);
    w->wave[w->n++] = (struct kept_wave){.wave = *wave, .sample_at = w->n_bytes};
    w->n_bytes += len;
    return 1;
}

int track_waves(struct track *t, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct scanhead_wave wave[WAVES_AT_ONCE];
    if (t->ops->points == NULL) return 0;
    /* has_waves is set with each frame of points, for recorders that want waveforms. Where has_waves of such a recorder
     * is 0, no points came since the head began to send windows, so these can't be placed. */
    if (!t->has_waves) {
        *(t->ops->wants_waves ? &t->missing.n_waves_unplaced : &t->missing.n_waves_unheld) += frame->n_points;
        return 0;
    }
    const int64_t lost = scanhead_waves_lost(t->sh, frame);
    if (lost > 0) t->missing.n_samples_lost += (uint64_t)lost;
    if (t->waves == NULL) t->waves = calloc(1, sizeof *t->waves);
    if (t->waves == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory for waveforms", t->path);
    for (uint32_t first = 0; first < frame->n_points;) {
        const int n = scanhead_waves(t->sh, frame, first, wave, WAVES_AT_ONCE);
        if (n <= 0) {
            t->missing.n_waves_unplaced += frame->n_points - first;
            return 0;
        }
        for (int i = 0; i < n; i++)
            if (!keep_wave(t, &wave[i])) return sh_fail(err, SH_ENOMEM, "%s: no memory for waveforms", t->path);
        first += (uint32_t)n;
    }
    return 0;
}

/* Writes the length of one unit of each axis on the ground, m. */
static void units_m(const struct scanhead_info *info, double to[3])
{
    const double degree_m = EARTH_RADIUS_M * NATIVE_RAD_PER_DEG;
    const int in_degrees = info->crs == NATIVE_CRS_GEODETIC;
    to[0] = in_degrees ? degree_m : 1;
    to[1] = in_degrees ? degree_m * cos(info->anchor[0] * NATIVE_RAD_PER_DEG) : 1;
    to[2] = 1;
}

/* Finds where the head was in the CRS when it fired. Poses are in the scene's frame, which is the local CRS. Only
 * the head knows how that frame lies in other systems along the way. 0: the place is not known. */
static int find_head(const struct track *t, const struct scanhead_point *p, double at[3])
{
    struct scanhead_pose pose;
    memcpy(at, t->info.anchor, sizeof t->info.anchor);
    if (!t->info.moving) return 1;
    if (t->info.crs != NATIVE_CRS_LOCAL || scanhead_pose(t->sh, p->t_ns, &pose) != SCANHEAD_OK) return 0;
    memcpy(at, pose.position_m, sizeof pose.position_m);
    return 1;
}

/* In the geo layout a point has no range, but its window says how coordinates change along a metre of range. The range
 * is the length of the way from the head to the point, projected onto the beam's direction. In some CRS a beam is
 * slightly curved. Such a beam leaves that direction sideways, so the error of the range is of second order. NaN: the
 * head's place is not known. */
static double range_along(const struct track *t, const struct scanhead_point *p, const struct scanhead_wave *wave)
{
    const double xyz[3] = {p->x, p->y, p->z};
    double head[3], unit_m[3], along = 0, square = 0;
    if (!find_head(t, p, head)) return (double)NAN;
    units_m(&t->info, unit_m);
    for (int i = 0; i < 3; i++) {
        double way = xyz[i] - head[i];
        if (i == 1 && t->info.crs == NATIVE_CRS_GEODETIC) way = remainder(way, 360);
        const double step_m = wave->direction[i] * unit_m[i];
        along += way * unit_m[i] * step_m;
        square += step_m * step_m;
    }
    return along / square;
}

const struct scanhead_wave *track_find_wave(struct track *t, const struct scanhead_point *p, uint64_t pulse, double *at)
{
    struct track_waves *w = t->waves;
    if (t->info.geo && t->info.moving && t->info.crs != NATIVE_CRS_LOCAL) {
        t->missing.n_without_ranges++;
        return NULL;
    }
    while (w != NULL && w->at < w->n && w->wave[w->at].wave.pulse < pulse)
        w->at++;
    for (size_t i = w != NULL ? w->at : 0; w != NULL && i < w->n && w->wave[i].wave.pulse == pulse; i++) {
        struct kept_wave *k = &w->wave[i];
        const double range_m = t->info.geo ? range_along(t, p, &k->wave) : p->range_m;
        *at = (range_m - k->wave.range_m) / k->wave.step_m;
        if (!(*at >= -0.5 && *at < k->wave.n - 0.5)) continue;
        k->is_used = 1;
        k->wave.sample = w->sample + k->sample_at;
        return &k->wave;
    }
    return NULL;
}

int track_beam(const struct track *t, int i, double beam[3])
{
    const struct track_points *p = &t->points;
    const double xyz[3] = {p->x[i], p->y[i], p->z[i]}, range_m = p->range_m[i];
    struct scanhead_pose pose;
    if (t->info.geo) {
        memcpy(beam, t->wave[i]->direction, sizeof t->wave[i]->direction);
        return 1;
    }
    if (!(range_m > 0)) return 0;
    if (!t->info.moving) {
        mat3_apply(t->pose.rotation, xyz, beam);
        for (int k = 0; k < 3; k++)
            beam[k] /= range_m;
        return 1;
    }
    if (scanhead_pose(t->sh, p->t_ns[i], &pose) != SCANHEAD_OK) return 0;
    for (int k = 0; k < 3; k++)
        beam[k] = (xyz[k] - pose.position_m[k]) / range_m;
    return 1;
}

void track_clear_waves(struct track *t)
{
    struct track_waves *w = t->waves;
    if (w == NULL) return;
    for (size_t i = 0; i < w->n; i++)
        t->missing.n_waves_alone += !w->wave[i].is_used;
    w->n = w->at = w->n_bytes = 0;
}

void track_free_waves(struct track *t)
{
    if (t->waves == NULL) return;
    free(t->waves->wave);
    free(t->waves->sample);
    free(t->waves);
    t->waves = NULL;
}
