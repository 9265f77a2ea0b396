/* SPDX-License-Identifier: MIT */
/* Decodes the points of a stream frame into doubles: the hot path of every recorder of points.
 *
 * A frame is taken in blocks of rows. The rows of a block become columns of words, and loops that compilers turn into
 * vectors make each column of figures from these. */
#include <math.h>

#include "core/vecmath.h"
#include "drivers/host/host.h"

enum { BLOCK = HOST_BLOCK };

/* A block has the words of its rows as columns. It also has room for columns that the caller does not ask for, since
 * others are computed from them. */
struct block {
    uint32_t a[BLOCK], b[BLOCK], c[BLOCK], middle[BLOCK], tail[BLOCK];
    double sin_m[BLOCK], cos_m[BLOCK], sin_pan[BLOCK], cos_pan[BLOCK];
    double mirror[BLOCK], pan[BLOCK]; /* turns */
    double x[BLOCK], y[BLOCK], z[BLOCK], range_m[BLOCK];
    uint8_t echo[BLOCK], echo_count[BLOCK];
};

/* ---- what all layouts share */

VEC_CLONES static void split_fours(const uint32_t (*restrict four)[4], int n, struct block *restrict b)
{
    for (int i = 0; i < n; i++) {
        b->a[i] = le32toh(four[i][0]);
        b->b[i] = le32toh(four[i][1]);
        b->c[i] = le32toh(four[i][2]);
        b->middle[i] = le32toh(four[i][3]);
    }
}

/* Compilers make shuffles for words that are four apart, but not for words that are five apart. */
static void take_words(const uint8_t *row, int n, struct block *b)
{
    uint32_t four[BLOCK][4];
    _Static_assert(NATIVE_POINT_LEN == sizeof four[0] + sizeof b->tail[0], "five words a row");
    for (int i = 0; i < n; i++, row += NATIVE_POINT_LEN) {
        memcpy(four[i], row, sizeof four[i]);
        b->tail[i] = le_get32(row + sizeof four[i]);
    }
    split_fours((const uint32_t(*)[4])four, n, b);
}

VEC_INLINE struct native_point point_of_middle(uint32_t middle)
{
    const uint32_t word[5] = {[3] = middle};
    return native_point_of(word);
}

VEC_INLINE struct native_point point_of_tail(uint32_t tail)
{
    const uint32_t word[5] = {[4] = tail};
    return native_point_of(word);
}

VEC_CLONES static void set_times(const uint32_t *restrict tail, int n, int64_t t0_ns, int64_t *restrict t_ns)
{
    for (int i = 0; i < n; i++) /* unsigned: with a broken stream's t0_ns the sum may be beyond 2^63 */
        t_ns[i] = (int64_t)((uint64_t)t0_ns + point_of_tail(tail[i]).dt_ns);
}

VEC_CLONES static void set_reflectances(const uint32_t *restrict middle, int n, double *restrict reflectance_db)
{
    for (int i = 0; i < n; i++) {
        const int cdb = point_of_middle(middle[i]).refl_cdb;
        reflectance_db[i] = cdb == INT16_MIN ? (double)NAN : cdb / 100.0;
    }
}

VEC_CLONES static void set_labels(const uint32_t *restrict middle, int n, uint16_t *restrict label)
{
    for (int i = 0; i < n; i++)
        label[i] = point_of_middle(middle[i]).label;
}

VEC_CLONES static void set_echoes(const uint32_t *restrict tail, int n, uint8_t *restrict echo,
                                  uint8_t *restrict echo_count)
{
    for (int i = 0; i < n; i++) {
        const struct native_point w = point_of_tail(tail[i]);
        echo[i] = w.echo;
        echo_count[i] = w.echo_count;
    }
}

VEC_INLINE int is_empty(uint32_t tail)
{
    return point_of_tail(tail).echo_count == 0;
}

static void set_all(double *to, int n, double value)
{
    for (int i = 0; i < n; i++)
        to[i] = value;
}

/* ---- geo */

/* This computes one coordinate. */
VEC_CLONES static void set_places(const uint32_t *restrict count, const uint32_t *restrict tail, int n, double anchor,
                                  double scale, double *restrict at)
{
    for (int i = 0; i < n; i++)
        at[i] = is_empty(tail[i]) ? (double)NAN : anchor + scale * (int32_t)count[i];
}

VEC_CLONES static void set_distances(const struct block *restrict b, int n, const double scale[3],
                                     double *restrict range_m)
{
    const double sx = scale[0], sy = scale[1], sz = scale[2];
    for (int i = 0; i < n; i++) {
        const double dx = sx * (int32_t)b->a[i], dy = sy * (int32_t)b->b[i], dz = sz * (int32_t)b->c[i];
        range_m[i] = is_empty(b->tail[i]) ? (double)NAN : sqrt(dx * dx + dy * dy + dz * dz);
    }
}

/* Longitudes stay within 180 degrees. */
VEC_CLONES static void fold_longitudes(double *y, int n)
{
    for (int i = 0; i < n; i++) {
        const double below = y[i] > 180 ? y[i] - 360 : y[i];
        y[i] = below < -180 ? below + 360 : below;
    }
}

/* Converts geodetic coordinates to the distances from the Earth's polar axis and from the plane of its equator (WGS 84,
 * NIMA TR8350.2). */
VEC_INLINE void geocentric(double lat_deg, double h, double *from_axis, double *from_equator)
{
    const double a = 6378137.0, f = 1 / 298.257223563, e2 = f * (2 - f);
    double s, c;
    vec_sincos_turn(lat_deg / 360, &s, &c);
    const double n = a / sqrt(1 - e2 * s * s);
    *from_axis = (n + h) * c;
    *from_equator = (n * (1 - e2) + h) * s;
}

/* Ranges go from the anchor straight through space. Longitudes are relative to the anchor's meridian. The anchor has
 * its ellipsoidal height here. */
VEC_CLONES static void set_geodetic_ranges(const struct block *restrict b, int n, const double anchor[3],
                                           const double scale[3], double *restrict range_m)
{
    const double lat = anchor[0], h = anchor[2], per_lat = scale[0], per_lon = scale[1] / 360, per_h = scale[2];
    double axis0, equator0;
    geocentric(lat, h, &axis0, &equator0);
    for (int i = 0; i < n; i++) {
        double axis, equator, s, c;
        geocentric(lat + per_lat * (int32_t)b->a[i], h + per_h * (int32_t)b->c[i], &axis, &equator);
        vec_sincos_turn(per_lon * (int32_t)b->b[i], &s, &c);
        const double dx = axis * c - axis0, dy = axis * s, dz = equator - equator0;
        range_m[i] = is_empty(b->tail[i]) ? (double)NAN : sqrt(dx * dx + dy * dy + dz * dz);
    }
}

static void columns_geo(const struct scanhead *sh, const struct block *b, int n, const struct scanhead_columns *to)
{
    const double *anchor = sh->anchor.anchor, *scale = sh->anchor.scale;
    const int geodetic = sh->anchor.crs == NATIVE_CRS_GEODETIC;
    const double h_m = sh->anchor.heights == NATIVE_HEIGHTS_GEOID ? sh->anchor.height_m : anchor[2];
    if (to->x != NULL) set_places(b->a, b->tail, n, anchor[0], scale[0], to->x);
    if (to->y != NULL) set_places(b->b, b->tail, n, anchor[1], scale[1], to->y);
    if (to->z != NULL) set_places(b->c, b->tail, n, anchor[2], scale[2], to->z);
    if (geodetic && to->y != NULL) fold_longitudes(to->y, n);
    if (to->range_m != NULL && sh->anchor.moving & NATIVE_MOVING)
        set_all(to->range_m, n, NAN);
    else if (to->range_m != NULL && geodetic)
        set_geodetic_ranges(b, n, (const double[]){anchor[0], anchor[1], h_m}, scale, to->range_m);
    else if (to->range_m != NULL)
        set_distances(b, n, scale, to->range_m);
    if (to->mirror_rad != NULL) set_all(to->mirror_rad, n, NAN);
    if (to->pan_rad != NULL) set_all(to->pan_rad, n, NAN);
}

/* ---- polar */

VEC_CLONES static void set_turns(const uint32_t *restrict count, int n, double per_count, double *restrict turn)
{
    for (int i = 0; i < n; i++)
        turn[i] = count[i] * per_count;
}

VEC_CLONES static void set_ranges(const struct block *restrict b, int n, double scale, double *restrict range_m)
{
    for (int i = 0; i < n; i++)
        range_m[i] = is_empty(b->tail[i]) ? (double)NAN : scale * b->a[i];
}

VEC_CLONES static void set_xyz(const struct block *restrict b, int n, const double *restrict range_m,
                               double *restrict x, double *restrict y, double *restrict z)
{
    for (int i = 0; i < n; i++) {
        const double flat = range_m[i] * b->cos_m[i];
        x[i] = flat * b->sin_pan[i];
        y[i] = flat * b->cos_pan[i];
        z[i] = range_m[i] * b->sin_m[i];
    }
}

/* Along a ring all mirror angles are equal. */
static int is_one_mirror(const struct block *b, int n)
{
    uint32_t differ = 0;
    for (int i = 0; i < n; i++)
        differ |= b->b[i] ^ b->b[0];
    return differ == 0;
}

static void set_positions(const struct scanhead *sh, struct block *b, int n, int one_mirror,
                          const struct scanhead_columns *to)
{
    const int m = one_mirror ? 1 : n;
    const double *range_m = to->range_m;
    if (range_m == NULL) {
        set_ranges(b, n, sh->descriptor.range_scale_m, b->range_m);
        range_m = b->range_m;
    }
    host_sincos_turns(sh->turn_part, b->mirror, m, b->sin_m, b->cos_m);
    host_sincos_turns(sh->turn_part, b->pan, n, b->sin_pan, b->cos_pan);
    if (one_mirror) {
        set_all(b->sin_m, n, b->sin_m[0]);
        set_all(b->cos_m, n, b->cos_m[0]);
    }
    set_xyz(b, n, range_m, to->x != NULL ? to->x : b->x, to->y != NULL ? to->y : b->y, to->z != NULL ? to->z : b->z);
}

static void columns_polar(const struct scanhead *sh, struct block *b, int n, const struct scanhead_columns *to)
{
    const struct native_descriptor *d = &sh->descriptor;
    const int one_mirror = is_one_mirror(b, n), m = one_mirror ? 1 : n;
    /* The mirror angle lies within half a turn of the line's middle, so that it has no jump along the line. With other
     * heads the angle is an elevation. */
    const double middle = ((double)d->line_start_udeg + (double)d->line_stop_udeg) / 720e6;
    const double lo = (sh->emitter.kind == NATIVE_EMIT_LINE ? middle : 0) - 0.5;
    set_turns(b->b, m, 1 / d->mirror_counts_per_turn, b->mirror);
    set_turns(b->c, n, 1 / d->pan_counts_per_turn, b->pan);
    if (to->range_m != NULL) set_ranges(b, n, d->range_scale_m, to->range_m);
    if (to->x != NULL || to->y != NULL || to->z != NULL) set_positions(sh, b, n, one_mirror, to);
    if (to->mirror_rad != NULL) {
        host_fold_turns(b->mirror, m, lo, to->mirror_rad);
        if (one_mirror) set_all(to->mirror_rad, n, to->mirror_rad[0]);
    }
    if (to->pan_rad != NULL) host_fold_turns(b->pan, n, 0, to->pan_rad);
}

/* ---- blocks */

/* Takes n <= BLOCK points from `first` on. */
static void columns_of_block(const struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first, int n,
                             struct block *b, const struct scanhead_columns *to)
{
    take_words(frame->payload + NATIVE_POINTS_HEAD_LEN + (size_t)first * NATIVE_POINT_LEN, n, b);
    if (sh->descriptor.layout == NATIVE_GEO)
        columns_geo(sh, b, n, to);
    else
        columns_polar(sh, b, n, to);
    if (to->reflectance_db != NULL) set_reflectances(b->middle, n, to->reflectance_db);
    if (to->label != NULL) set_labels(b->middle, n, to->label);
    if (to->t_ns != NULL) set_times(b->tail, n, frame->scan_t0_ns, to->t_ns);
    if (to->echo != NULL || to->echo_count != NULL)
        set_echoes(b->tail, n, to->echo != NULL ? to->echo : b->echo,
                   to->echo_count != NULL ? to->echo_count : b->echo_count);
}

/* Returns how many points there are from `first` on, at most max; or an error. */
static int points_from(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first, uint32_t max)
{
    int rc = host_check_last(sh, frame, SCANHEAD_POINTS);
    if (rc != 0) return rc;
    if (!sh->have_descriptor || !sh->have_anchor)
        return sh_fail(&sh->err, SCANHEAD_ESTATE, "%s: points came before the descriptor and the anchor of their scan",
                       sh->source.name);
    const uint32_t n = first < frame->n_points ? frame->n_points - first : 0;
    return (int)(n < max ? n : max);
}

#define COLUMN_FROM(column) .column = to->column != NULL ? to->column + at : NULL
static struct scanhead_columns columns_from(const struct scanhead_columns *to, int at)
{
    return (struct scanhead_columns){
        COLUMN_FROM(x),
        COLUMN_FROM(y),
        COLUMN_FROM(z),
        COLUMN_FROM(range_m),
        COLUMN_FROM(mirror_rad),
        COLUMN_FROM(pan_rad),
        COLUMN_FROM(reflectance_db),
        COLUMN_FROM(t_ns),
        COLUMN_FROM(label),
        COLUMN_FROM(echo),
        COLUMN_FROM(echo_count),
    };
}

int scanhead_columns(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first,
                     const struct scanhead_columns *to, uint32_t max)
{
    struct block b;
    const int n = points_from(sh, frame, first, max);
    for (int at = 0; at < n; at += BLOCK) {
        const struct scanhead_columns columns = columns_from(to, at);
        columns_of_block(sh, frame, first + (uint32_t)at, n - at < BLOCK ? n - at : BLOCK, &b, &columns);
    }
    return n;
}

/* The room holds a block of points. */
struct points_room {
    double x[BLOCK], y[BLOCK], z[BLOCK], range_m[BLOCK], mirror_rad[BLOCK], pan_rad[BLOCK], reflectance_db[BLOCK];
    int64_t t_ns[BLOCK];
    uint16_t label[BLOCK];
    uint8_t echo[BLOCK], echo_count[BLOCK];
};

/* There are two loops because a loop over figures of one size makes better vectors. */
static void put_points(const struct points_room *restrict from, int n, struct scanhead_point *restrict points)
{
    for (int i = 0; i < n; i++) {
        points[i].x = from->x[i];
        points[i].y = from->y[i];
        points[i].z = from->z[i];
        points[i].range_m = from->range_m[i];
        points[i].mirror_rad = from->mirror_rad[i];
        points[i].pan_rad = from->pan_rad[i];
        points[i].reflectance_db = from->reflectance_db[i];
        points[i].t_ns = from->t_ns[i];
    }
    for (int i = 0; i < n; i++) {
        points[i].echo = from->echo[i];
        points[i].echo_count = from->echo_count[i];
        points[i].label = from->label[i];
    }
}

int scanhead_points(struct scanhead *sh, const struct scanhead_frame *frame, uint32_t first,
                    struct scanhead_point *points, uint32_t max)
{
    struct block b;
    struct points_room r;
    const struct scanhead_columns columns = {
        r.x, r.y, r.z, r.range_m, r.mirror_rad, r.pan_rad, r.reflectance_db, r.t_ns, r.label, r.echo, r.echo_count};
    const int n = points_from(sh, frame, first, max);
    for (int at = 0; at < n; at += BLOCK, points += BLOCK) {
        const int m = n - at < BLOCK ? n - at : BLOCK;
        columns_of_block(sh, frame, first + (uint32_t)at, m, &b, &columns);
        put_points(&r, m, points);
    }
    return n;
}
