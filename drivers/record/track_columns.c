/* SPDX-License-Identifier: MIT */
/* The columns of a batch of points. */
#include "drivers/record/track_inside.h"

#include <string.h>

#include "core/vecmath.h"

struct scanhead_columns track_columns_to(struct track *t)
{
    struct track_points *p = &t->points;
    const int made = t->has_colours && t->colour.given; /* a colour may show any figure */
    const unsigned spared = made || track_waits(t) || t->info.moving ? 0 : t->spared;
    return (struct scanhead_columns){
        .x = p->x,
        .y = p->y,
        .z = p->z,
        .range_m = (spared & TRACK_RANGE) != 0 ? NULL : p->range_m,
        .reflectance_db = (spared & TRACK_REFLECTANCE) != 0 ? NULL : p->reflectance_db,
        .t_ns = (spared & TRACK_TIME) != 0 ? NULL : p->t_ns,
        .label = (spared & TRACK_LABEL) != 0 ? NULL : p->label,
        .echo = p->echo,
        .echo_count = p->echo_count,
    };
}

VEC_CLONES static int any_later_echo(const uint8_t *restrict echo, int n)
{
    uint8_t any = 0;
    for (int i = 0; i < n; i++)
        any = (uint8_t)(any | (echo[i] > 1));
    return any;
}

/* Echoes of one pulse follow each other: a new pulse begins wherever the number is 0 or 1. No head sends a frame that
 * begins with a later echo; such an echo goes to the row before. */
uint64_t track_number_rows(struct track *t, uint64_t row, int n)
{
    const int all_are_first = !any_later_echo(t->points.echo, n);
    for (int i = 0; i < n && all_are_first; i++)
        t->row[i] = (uint32_t)row + (uint32_t)i;
    if (all_are_first) return row + (uint64_t)n;
    for (int i = 0; i < n; i++) {
        if (t->points.echo[i] <= 1) row++;
        t->row[i] = (uint32_t)(row > 0 ? row - 1 : 0);
    }
    return row;
}

int track_to_scene(struct track *t, int n)
{
    struct scanhead_point point[TRACK_BATCH];
    struct track_points *p = &t->points;
    for (int i = 0; i < n; i++)
        point[i] = track_get_point(t, i);
    const int lost = scanhead_to_scene(t->sh, point, (uint32_t)n, t->frame);
    for (int i = 0; i < n; i++) {
        p->x[i] = point[i].x;
        p->y[i] = point[i].y;
        p->z[i] = point[i].z;
    }
    return lost;
}

#define PICK(column)            \
    for (int i = 0; i < n; i++) \
    (column)[i] = (column)[index[i]]

void track_pick(struct track *t, const uint16_t *index, int n)
{
    struct track_points *p = &t->points;
    PICK(p->x);
    PICK(p->y);
    PICK(p->z);
    PICK(p->range_m);
    PICK(p->reflectance_db);
    PICK(p->t_ns);
    PICK(p->label);
    PICK(p->echo);
    PICK(p->echo_count);
    PICK(t->row);
    if (t->info.moving) PICK(t->frame);
    if (track_waits(t)) PICK(t->index);
    if (t->waited) PICK(t->gps_s);
    if (t->has_attributes) PICK(t->attribute);
    if (t->has_deviations) PICK(t->deviation);
    for (int i = 0; i < n && t->has_colours; i++)
        memcpy(t->rgb[i], t->rgb[index[i]], sizeof t->rgb[i]);
    if (!t->has_waves) return;
    PICK(t->wave);
    PICK(t->wave_at);
}

/* x - x is 0, or NaN where x is not finite. */
VEC_CLONES static int all_are_finite(const double *restrict x, const double *restrict y, const double *restrict z,
                                     int n)
{
    uint64_t any = 0;
    for (int i = 0; i < n; i++) {
        const double none = (x[i] - x[i]) + (y[i] - y[i]) + (z[i] - z[i]);
        uint64_t bits;
        memcpy(&bits, &none, sizeof bits);
        any |= bits;
    }
    return any == 0;
}

int track_leave_out(struct track *t, int n)
{
    const struct track_points *p = &t->points;
    uint16_t index[TRACK_BATCH];
    int kept = 0;
    if (n <= 0) return 0;
    if (all_are_finite(p->x, p->y, p->z, n) && memchr(p->echo_count, 0, (size_t)n) == NULL) return n;
    for (int i = 0; i < n; i++) {
        const int is_empty = p->echo_count[i] == 0;
        t->missing.n_empty += (uint64_t)(is_empty && t->no_empty);
        index[kept] = (uint16_t)i;
        kept += is_empty ? !t->no_empty : !track_is_nowhere(t, p->x[i], p->y[i], p->z[i]);
    }
    if (kept < n) track_pick(t, index, kept);
    return kept;
}

/* Vectors convert whole numbers of up to 2^51; others are left to the caller, who gets 0. */
VEC_CLONES static int seconds_of_near(const int64_t *restrict t_ns, int n, double *restrict to)
{
    uint64_t any_far = 0;
    for (int i = 0; i < n; i++) {
        const uint64_t above = (uint64_t)t_ns[i] + (1ULL << 51);
        any_far |= above >> 52;
        to[i] = (vec_from_u64(above) - 0x1p51) / 1e9;
    }
    return any_far == 0;
}

void track_seconds(const struct track *t, int n, double *to)
{
    if (seconds_of_near(t->points.t_ns, n, to)) return;
    for (int i = 0; i < n; i++)
        to[i] = (double)t->points.t_ns[i] / 1e9;
}
