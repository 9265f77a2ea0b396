/* SPDX-License-Identifier: MIT */
/* Points of a batch become rows of .las. */
#include "drivers/record/las_inside.h"

#include <math.h>
#include <string.h>

#define M_PER_PS (0.5 * 299792458e-12) /* metres of range for a picosecond: light goes out and back */

/* ---- the batch's columns. Functions with an rc return how many points are good. Where that is not all of them, *rc
 * says why. */

static int too_far(const struct las *las, const double p[3], struct sh_err *err)
{
    return sh_fail(err, SH_EFORMAT,
                   "%s: a point of station %u at (%.3f %.3f %.3f) is beyond the %.0f m from the first station that LAS "
                   "can hold in steps of %g m; give the head a coarser output.scale_m, or each station its own file",
                   las->base.file.path, las->base.track.info.station, p[0], p[1], p[2],
                   2147483647 * las->base.track.scale_m, las->base.track.scale_m);
}

/* Leaves out echoes that the version has no room for. */
static int leave_out_beyond(struct las *las, int n)
{
    const uint8_t *echo = las->base.track.points.echo;
    uint16_t index[TRACK_BATCH];
    int kept = 0;
    for (int i = 0; i < n; i++) {
        index[kept] = (uint16_t)i;
        kept += echo[i] <= LAS_12_RETURNS;
    }
    las->n_beyond_returns += (uint64_t)(n - kept);
    if (kept < n) track_pick(&las->base.track, index, kept);
    return kept;
}

static int check_count(const struct las *las, int n, int *rc, struct sh_err *err)
{
    const uint64_t room = UINT32_MAX - las->facts.n_points;
    if (las->facts.minor != 2 || (uint64_t)n <= room) return n;
    *rc = sh_fail(err, SH_EFORMAT, "%s: LAS 1.2 holds up to 4294967295 points; use --las-version 1.4, or --split",
                  las->base.file.path);
    return (int)room;
}

/* Times of points that waited for later frames were set when the points came (track.h: waited). */
static int set_times(struct las *las, int n, int *rc, struct sh_err *err)
{
    const struct track *t = &las->base.track;
    double *to = las->columns.time_s;
    int known = 0;
    if (!las->facts.gps_time) {
        track_seconds(t, n, to);
        return n;
    }
    if (t->waited)
        memcpy(to, t->gps_s, (size_t)n * sizeof *to);
    else if (scanhead_gps_times(t->sh, t->points.t_ns, (uint32_t)n, to) == 0)
        return n;
    while (t->waited && known < n && !isnan(to[known]))
        known++;
    if (known < n)
        *rc = sh_fail(err, SH_EFORMAT, "%s: the head no longer reports the time; a LAS file holds one kind of time",
                      las->base.file.path);
    return known;
}

static void copy_places(struct las *las, int n)
{
    const struct track_points *p = &las->base.track.points;
    const double *from[3] = {p->x, p->y, p->z};
    for (int k = 0; k < 3; k++)
        memcpy(las->place[k], from[k], (size_t)n * sizeof *from[k]);
}

static int count_places(struct las *las, int n, int *rc, struct sh_err *err)
{
    const struct track *t = &las->base.track;
    const struct las_facts *f = &las->facts;
    const int asked = n;
    double *at[3] = {las->place[0], las->place[1], las->place[2]}, lon_offset = f->offset[0];
    copy_places(las, n);
    if (!t->info.geo) station_pose_forward_all(&t->pose, n, at[0], at[1], at[2]);
    if (las_is_swapped(las)) {
        at[0] = las->place[1];
        at[1] = las->place[0];
        lon_offset = 0;
        for (int i = 0; i < n; i++)
            at[0][i] = remainder(at[0][i] - f->offset[0], 360);
    }
    for (int k = 0; k < 3; k++)
        n = las_set_counts(at[k], n, k == 0 ? lon_offset : f->offset[k], f->scale[k], las->columns.xyz[k]);
    if (n == asked) return n;
    double p[3] = {t->points.x[n], t->points.y[n], t->points.z[n]};
    if (!t->info.geo) station_pose_forward(&t->pose, p);
    if (las_is_swapped(las)) las_swap(p);
    *rc = too_far(las, p, err);
    return n;
}

/* Converts latitude and longitude to metres east and north of the pose, accurately enough for an angle. The pose's
 * shift is added, since the reverse of the pose subtracts it. */
static void make_level(const struct track *t, double *x, double *y, int n)
{
    for (int i = 0; i < n; i++) {
        double east_north_m[2];
        station_pose_level(&t->pose, x[i], y[i], east_north_m);
        x[i] = t->pose.shift_m[0] + east_north_m[0];
        y[i] = t->pose.shift_m[1] + east_north_m[1];
    }
}

/* Angles are seen in the head's frame, so points of a CRS are taken back into it. */
static void set_angles(struct las *las, int n)
{
    const struct track *t = &las->base.track;
    const double *x = t->points.x, *y = t->points.y, *z = t->points.z;
    if (t->info.moving || las->facts.minor == 2) return;
    if (t->info.geo) {
        copy_places(las, n);
        if (t->info.crs == NATIVE_CRS_GEODETIC) make_level(t, las->place[0], las->place[1], n);
        station_pose_reverse_all(&t->pose, n, las->place[0], las->place[1], las->place[2]);
        x = las->place[0], y = las->place[1], z = las->place[2];
    }
    las->n_no_angle += las_set_scan_angles(x, y, z, n, las->columns.scan_angle);
}

/* LAS 1.2 has room for five returns. */
static void set_returns(struct las *las, int n)
{
    const struct track_points *p = &las->base.track.points;
    const int most = las->facts.minor == 2 ? LAS_12_RETURNS : LAS_RETURNS, shift = las->facts.minor == 2 ? 3 : 4;
    for (int i = 0; i < n; i++) {
        const int is_cut = p->echo_count[i] > most;
        las->columns.returns[i] = (uint8_t)(p->echo[i] | (is_cut ? most : p->echo_count[i]) << shift);
        las->n_returns_cut += (uint64_t)is_cut;
    }
}

/* Units are 0.01 dB and 0.01 ns, as on the wire. */
static void set_attributes(struct las *las, int n)
{
    const struct track *t = &las->base.track;
    struct las_columns *c = &las->columns;
    for (int i = 0; i < n && t->has_attributes; i++) {
        const struct scanhead_attribute *a = &t->attribute[i];
        const int amplitude = isnan(a->amplitude_db) ? NATIVE_AMPLITUDE_NONE : (int)lrint(100 * a->amplitude_db);
        const int width = isnan(a->width_ns) ? NATIVE_WIDTH_NONE : (int)lrint(100 * a->width_ns);
        const double deviation = t->deviation[i];
        c->amplitude[i] = (uint16_t)amplitude;
        c->width[i] = (uint16_t)width;
        c->deviation[i] = isnan(deviation) ? UINT16_MAX : (uint16_t)lrint(1000 * fmin(deviation, 65.534));
    }
}

/* The packets of the batch are written before its points: where a packet needs a new descriptor, the bytes before all
 * points are written again, with this descriptor. */
static int put_packets(struct las *las, int n, struct sh_err *err)
{
    const struct track *t = &las->base.track;
    int rc = 0, is_new, any_new = 0;
    for (int i = 0; rc == 0 && i < n; i++) {
        las->columns.packet[i] = (struct las_packet){0};
        if (!t->has_waves || t->wave[i] == NULL) continue;
        rc = las_waves_put(&las->waves, t->n_scans, t->wave[i], &las->columns.packet[i], &is_new, err);
        any_new |= is_new;
    }
    return rc == 0 && any_new ? las_write_front(las, err) : rc;
}

/* The specification puts a packet's first sample at point + location * (dx, dy, dz), which is nearer to the head
 * than the point. So (dx, dy, dz) points from the target to the head. Programs that read LAS take the vector so
 * (WAVES.md). */
static void set_wave(struct las *las, int i)
{
    struct track *t = &las->base.track;
    struct las_columns *c = &las->columns;
    double beam[3] = {0, 0, 0};
    int is_there = c->packet[i].kind != 0;
    if (is_there && !track_beam(t, i, beam)) {
        t->missing.n_without_waves++;
        c->packet[i] = (struct las_packet){0};
        is_there = 0;
    }
    if (las_is_swapped(las)) las_swap(beam);
    c->location_ps[i] = is_there ? (float)(t->wave_at[i] * t->wave[i]->sample_ps) : 0;
    for (int k = 0; k < 3; k++)
        c->back_ps[i][k] = is_there ? (float)(-beam[k] * M_PER_PS) : 0;
}

/* Sets the columns of the first of n points that the file can hold, and returns how many these are. */
static int set_columns(struct las *las, int n, int *rc, struct sh_err *err)
{
    n = check_count(las, n, rc, err);
    n = set_times(las, n, rc, err);
    n = count_places(las, n, rc, err);
    set_angles(las, n);
    set_returns(las, n);
    las_set_intensities(las->base.track.points.reflectance_db, n, las->columns.intensity);
    set_attributes(las, n);
    for (int i = 0; i < n && las->facts.has_waves; i++)
        set_wave(las, i);
    return n;
}

int las_points(void *rec, int n, struct sh_err *err)
{
    struct las *las = rec;
    const struct track *t = &las->base.track;
    struct outfile *file = &las->base.file;
    const size_t len = las_point_len(&las->facts);
    double s;
    if (las->facts.minor == 2) n = leave_out_beyond(las, n);
    int rc = las->facts.has_waves ? put_packets(las, n, err) : 0;
    if (rc == 0 && OUTFILE_BUFFER - file->len < (size_t)n * len) rc = las_waves_flush(&las->waves, err);
    if (rc != 0) return rc;
    uint8_t *to = outfile_room(file, (size_t)n * len, err);
    if (to == NULL) return SH_EIO;
    if (!las->facts.gps_time && !las->time_came_late) las->time_came_late = scanhead_gps_time(t->sh, 0, &s) == 0;
    for (int i = 0; i < n && t->has_waves && !las->facts.has_waves; i++)
        las->n_waves_left_out += t->wave[i] != NULL;
    n = set_columns(las, n, &rc, err);
    las_put_rows(&las->facts, &las->columns, n, to);
    las_count_rows(&las->facts, &las->columns, n);
    outfile_used(file, (size_t)n * len); /* also before a failure: the file may be kept */
    return rc;
}
