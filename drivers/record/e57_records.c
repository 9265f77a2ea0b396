/* SPDX-License-Identifier: MIT */
#include "drivers/record/e57_records.h"

#include <math.h>
#include <string.h>

#include "core/bytes.h"
#include "core/vecmath.h"

/* Coordinates of a run of points. They are the track's or, where they had to be changed, those in `own`. */
struct run {
    const double *p[3];
    double own[3][TRACK_BATCH];
};

static void set_run(struct run *run, const struct track *t, int has_empty, int first, int n)
{
    const struct track_points *points = &t->points;
    const double *p[3] = {points->x + first, points->y + first, points->z + first};
    memcpy(run->p, p, sizeof p);
    if (!t->info.geo && !has_empty) return;
    for (int k = 0; k < 3; k++) {
        memcpy(run->own[k], p[k], (size_t)n * sizeof *p[k]);
        run->p[k] = run->own[k];
    }
    if (t->info.geo) station_pose_reverse_all(&t->pose, n, run->own[0], run->own[1], run->own[2]);
    for (int k = 0; k < 3 && has_empty; k++)
        for (int i = 0; i < n; i++)
            if (points->echo_count[first + i] == 0) run->own[k][i] = 0;
}

/* Puts coordinates as counts from INT32_MIN on. Returns 0 where one of them has no room. */
VEC_CLONES static int put_counts(const double *restrict p, double scale_m, int n, uint8_t *restrict to)
{
    uint64_t n_bad = 0;
    for (size_t i = 0; i < (size_t)n; i++) {
        uint64_t bits;
        const double counts = vec_round(p[i] / scale_m, &bits);
        n_bad += fabs(counts) <= INT32_MAX ? 0 : 1;
        le_put32(to + 4 * i, (uint32_t)bits ^ 0x80000000u);
    }
    return n_bad == 0;
}

/* Returns how many points come before the first one whose counts have no room; far_m is that point's place. The loop
 * looks at one point after the other; put_counts has found that there is such a point. */
static int find_far(const struct run *run, double scale_m, int n, double far_m[3])
{
    int i = 0;
    while (i < n - 1 && fabs(rint(run->p[0][i] / scale_m)) <= INT32_MAX &&
           fabs(rint(run->p[1][i] / scale_m)) <= INT32_MAX && fabs(rint(run->p[2][i] / scale_m)) <= INT32_MAX)
        i++;
    for (int k = 0; k < 3; k++)
        far_m[k] = run->p[k][i];
    return i;
}

/* NaN: the reflectance is not modelled. Such a point has `none` 1, and the intensity of 0 dB. */
VEC_CLONES static void put_intensities(const double *restrict reflectance_db, int n, uint8_t *restrict to,
                                       uint8_t *restrict none)
{
    for (size_t i = 0; i < (size_t)n; i++) {
        const double db = reflectance_db[i];
        uint64_t cdb;
        vec_round(db == db ? db * 100 : 0, &cdb);
        le_put16(to + 2 * i, (uint16_t)(cdb + 32768));
        none[i] = db == db ? 0 : 1;
    }
}

static void put_times(const struct track *t, int first, int n, uint8_t *to)
{
    double t_s[TRACK_BATCH];
    track_seconds(t, first + n, t_s);
    for (int i = 0; i < n; i++)
        le_put_double(to + 8 * (size_t)i, t_s[first + i]);
}

VEC_CLONES static void put_returns(const uint8_t *restrict echo, int n, uint8_t *restrict to)
{
    for (int i = 0; i < n; i++)
        to[i] = (uint8_t)(echo[i] - (echo[i] > 0));
}

VEC_CLONES static void put_rows(const uint32_t *restrict row, uint32_t column, int n, uint8_t *restrict rows,
                                uint8_t *restrict columns)
{
    for (size_t i = 0; i < (size_t)n; i++) {
        le_put32(rows + 4 * i, row[i]);
        le_put32(columns + 4 * i, column);
    }
}

static void put_figures(struct e57_packet *packet, const struct e57_facts *facts, const struct track *t, int first,
                        int n)
{
    const struct track_points *p = &t->points;
    uint8_t *const *s = packet->stream;
    const size_t at = packet->n;
    put_intensities(p->reflectance_db + first, n, s[E57_INTENSITY] + 2 * at, s[E57_NO_INTENSITY] + at);
    put_times(t, first, n, s[E57_TIME] + 8 * at);
    put_returns(p->echo + first, n, s[E57_RETURN] + at);
    memcpy(s[E57_RETURNS] + at, p->echo_count + first, (size_t)n);
    put_rows(t->row + first, t->line, n, s[E57_ROW] + 4 * at, s[E57_COLUMN] + 4 * at);
    for (size_t i = 0; i < (size_t)n; i++)
        le_put16(s[E57_LABEL] + 2 * (at + i), p->label[first + (int)i]);
    for (size_t i = 0; facts->empty_shots && i < (size_t)n; i++)
        s[E57_INVALID][at + i] = p->echo_count[first + (int)i] == 0 ? 2 : 0;
    for (size_t i = 0; facts->has_colours && i < (size_t)n; i++)
        for (int c = 0; c < 3; c++)
            s[E57_RED + c][at + i] = t->rgb[first + (int)i][c];
}

int e57_records_put(struct e57_packet *packet, const struct e57_facts *facts, const struct track *track, int first,
                    int n, double far_m[3])
{
    const double scale_m = facts->scan[facts->n_scans - 1].scale_m;
    struct run run;
    int fit = 1;
    set_run(&run, track, facts->empty_shots, first, n);
    for (int k = 0; k < 3; k++)
        fit &= put_counts(run.p[k], scale_m, n, packet->stream[E57_X + k] + 4 * (size_t)packet->n);
    if (!fit) n = find_far(&run, scale_m, n, far_m);
    put_figures(packet, facts, track, first, n);
    packet->n += (unsigned)n;
    return fit ? 0 : -1;
}
