/* SPDX-License-Identifier: MIT */
/* .las: LAS 1.4, point data record format 6 (7 with colour) followed by the label; one record per echo. Where the head
 * sends waveforms it is format 9 (10), and packets of samples follow (las_waves.c). On request it is LAS 1.2 for older
 * readers: format 1 (3), five returns, no labels, scan angles, attributes or waveforms. The file itself describes its
 * numbers (las_header.c).
 *
 * Coordinates are counts of the stream's own scale from the first scan's station. So those of the first scan
 * are the numbers of the stream. Those of other stations are rounded once, by half a count at most. Nothing
 * is clipped: a point too far for 32 bits is an error. Longitudes go on beyond 180 or -180 degrees where a
 * scan crosses the antimeridian: all lie within 180 degrees of the first station. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "drivers/protocol/native.h"
#include "drivers/record/las_columns.h"
#include "drivers/record/las_repair.h"
#include "drivers/record/recorder.h"

#define M_PER_PS (0.5 * 299792458e-12) /* range, of a pulse's way out and back */

struct las {
    struct recorder base;
    struct las_facts facts;
    int begun, time_came_late;
    size_t front_len;
    uint64_t n_no_angle;
    uint64_t n_beyond_returns, n_returns_cut, n_waves_left_out; /* LAS 1.2 */
    struct las_waves waves;
    struct las_columns columns;   /* of the batch */
    double place[3][TRACK_BATCH]; /* likewise, on the way to counts or angles */
};

static int las_begin(void *rec, struct sh_err *err)
{
    struct las *las = rec;
    las->facts.track = &las->base.track;
    las->base.track.no_empty = 1;
    las->base.track.spared = TRACK_RANGE;
    las->facts.minor = las->base.options.las_minor == 2 ? 2 : 4;
    las->facts.has_colour = las->base.track.has_colours;
    for (int i = 0; i < 3; i++)
        las->facts.scale[i] = 1;
    strcpy(las->facts.profile, "OTHER"); /* until points have come */
    return las->base.options.las_wdp ? las_waves_check(las->base.file.path, err) : 0;
}

/* Writes header and records before the points. Their counts are overwritten at the end. Until then they mark the file
 * as incomplete, for a repair (las_repair.c). */
static int put_front(struct las *las, struct sh_err *err)
{
    uint8_t front[LAS_FRONT_MAX];
    las->begun = 1;
    las->facts.incomplete = las->facts.is_growing = 1;
    las->front_len = las_front(&las->facts, front);
    return outfile_write(&las->base.file, front, las->front_len, err);
}

static int write_front(struct las *las, struct sh_err *err)
{
    uint8_t front[LAS_FRONT_MAX];
    int rc = las_waves_flush(&las->waves, err);
    if (rc == 0) rc = outfile_flush(&las->base.file, err);
    return rc != 0 ? rc : outfile_patch(&las->base.file, 0, front, las_front(&las->facts, front), err);
}

/* Geodetic coordinates are longitude, latitude in LAS, as GIS software draws x and y. */
static int is_swapped(const struct las *las)
{
    return las->base.track.crs == NATIVE_CRS_GEODETIC;
}

static void swap(double v[3])
{
    double x = v[0];
    v[0] = v[1];
    v[1] = x;
}

/* The stream's own counts from the first anchor, or coarser ones for a head that moves. */
static void set_counts(struct las *las)
{
    const struct track *t = &las->base.track;
    struct las_facts *f = &las->facts;
    memcpy(f->offset, t->pose.shift_m, sizeof f->offset);
    for (int i = 0; i < 3; i++)
        f->scale[i] = t->info.geo ? t->info.scale[i] * (t->scale_m / t->info.scale_m) : t->scale_m;
    if (!is_swapped(las)) return;
    swap(f->offset);
    swap(f->scale);
}

static int las_scan(void *rec, struct sh_err *err)
{
    struct las *las = rec;
    const struct track *t = &las->base.track;
    struct las_facts *f = &las->facts;
    if (las->begun && strcmp(f->profile, t->info.profile) != 0 && strcmp(f->profile, "MERGE") != 0) {
        strcpy(f->profile, "MERGE"); /* as LAS calls it */
        return write_front(las, err);
    }
    if (las->begun) return 0;
    set_counts(las);
    f->has_colour = t->has_colours;
    f->has_waves = t->has_waves && f->minor != 2;
    snprintf(f->profile, sizeof f->profile, "%s", t->info.profile);
    f->gps_time = scanhead_gps_time(t->sh, t->t0_ns, &f->created_gps_s) == 0;
    if (!(f->scale[0] > 0 && f->scale[1] > 0 && f->scale[2] > 0))
        return sh_fail(err, SH_EFORMAT, "%s: the stream's scale is %g; a LAS file needs one above 0",
                       las->base.file.path, f->scale[0]);
    f->waves = &las->waves;
    const int rc = f->has_waves && !las->waves.is_open ? las_waves_open(&las->waves, las->base.file.path, err) : 0;
    las->waves.file.may_be_direct = las->base.options.may_wait;
    return rc == 0 ? put_front(las, err) : rc;
}

/* Refuses stations whose points are all too far from the first one. In degrees that is found when the points come. */
static int las_fits(const char *path, const struct recorder_options *options, const struct recorder_scan *first,
                    const struct recorder_scan *scan, struct sh_err *err)
{
    const double most_m = 2147483647 * first->scale_m;
    double apart_m = 0;
    (void)options;
    for (int i = 0; i < 3; i++)
        apart_m = fmax(apart_m, fabs(scan->place_m[i] - first->place_m[i]));
    if (scan->moves || scan->in_degrees || apart_m <= most_m + scan->range_max_m) return SH_OK;
    return sh_fail(
        err, SH_EINPUT,
        "%s: the station is %.0f m from station %u, and LAS holds %.0f m in steps of %g m: give the head a coarser "
        "output.scale_m, or each station its own file (--split)",
        path, apart_m, first->station, most_m, first->scale_m);
}

static int too_far(const struct las *las, const double p[3], struct sh_err *err)
{
    return sh_fail(err, SH_EFORMAT,
                   "%s: a point of station %u at (%.3f %.3f %.3f) is beyond the %.0f m from the first station that LAS "
                   "can hold in steps of %g m; give the head a coarser output.scale_m, or each station its own file",
                   las->base.file.path, las->base.track.info.station, p[0], p[1], p[2],
                   2147483647 * las->base.track.scale_m, las->base.track.scale_m);
}

/* ---- the batch's columns. Those that fail return how many points come before. */

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

/* Points that have waited got their times before they waited. */
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

static int set_counts(struct las *las, int n, int *rc, struct sh_err *err)
{
    const struct track *t = &las->base.track;
    const struct las_facts *f = &las->facts;
    const int asked = n;
    double *at[3] = {las->place[0], las->place[1], las->place[2]}, lon_offset = f->offset[0];
    copy_places(las, n);
    if (!t->info.geo) station_pose_forward_all(&t->pose, n, at[0], at[1], at[2]);
    if (is_swapped(las)) {
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
    if (is_swapped(las)) swap(p);
    *rc = too_far(las, p, err);
    return n;
}

/* Makes metres of geodetic coordinates about the pose's place, accurately enough for an angle. */
static void make_level(const struct track *t, double *x, double *y, int n)
{
    const double *s = t->pose.shift_m, m_deg = 6371000 * NATIVE_RAD_PER_DEG;
    for (int i = 0; i < n; i++) {
        const double north = (x[i] - s[0]) * m_deg;
        const double east = remainder(y[i] - s[1], 360) * m_deg * cos(x[i] * NATIVE_RAD_PER_DEG);
        x[i] = s[0] + east;
        y[i] = s[1] + north;
    }
}

/* Of points in the head's frame, into which those of a CRS are taken back. */
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

/* LAS 1.2 counts to five. */
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

/* 0.01 dB and 0.01 ns, as on the wire. */
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

/* ---- waveforms */

/* The packets of the batch are written before its points, as a new descriptor changes what comes before all points. */
static int put_packets(struct las *las, int n, struct sh_err *err)
{
    const struct track *t = &las->base.track;
    int rc = 0, is_new, any_new = 0;
    for (int i = 0; rc == 0 && i < n; i++) {
        las->columns.packet[i] = (struct las_packet){0};
        if (t->wave[i] == NULL) continue;
        rc = las_waves_put(&las->waves, t->n_scans, t->wave[i], &las->columns.packet[i], &is_new, err);
        any_new |= is_new;
    }
    return rc == 0 && any_new ? write_front(las, err) : rc;
}

/* The specification puts a packet's first sample at point + location * (dx, dy, dz), which is nearer to the head
 * than the point. So (dx, dy, dz) leads back to the head, as readers take it. */
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
    if (is_swapped(las)) swap(beam);
    c->location_ps[i] = is_there ? (float)(t->wave_at[i] * t->wave[i]->sample_ps) : 0;
    for (int k = 0; k < 3; k++)
        c->back_ps[i][k] = is_there ? (float)(-beam[k] * M_PER_PS) : 0;
}

/* Completes the packets. An internal record follows the points. Until it is copied, the header says that the packets
 * are in a .wdp, and how many points there are. From this a repair finds the end of the points. */
static int end_waves(struct las *las, struct sh_err *err)
{
    int rc = las_waves_end(&las->waves, err);
    if (rc != 0 || las->base.options.las_wdp) return rc;
    rc = write_front(las, err);
    const uint64_t at = las->base.file.written;
    if (rc == 0) rc = las_waves_copy(&las->waves, &las->base.file, las->base.options.report, err);
    las->facts.waves_at = at;
    return rc;
}

/* Sets the columns of the first of n points that the file can hold, and returns how many these are. */
static int set_columns(struct las *las, int n, int *rc, struct sh_err *err)
{
    n = check_count(las, n, rc, err);
    n = set_times(las, n, rc, err);
    n = set_counts(las, n, rc, err);
    set_angles(las, n);
    set_returns(las, n);
    las_set_intensities(las->base.track.points.reflectance_db, n, las->columns.intensity);
    set_attributes(las, n);
    for (int i = 0; i < n && las->facts.has_waves; i++)
        set_wave(las, i);
    return n;
}

static int las_points(void *rec, int n, struct sh_err *err)
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

static void report_waves(struct las *las)
{
    const struct recorder *r = &las->base;
    const struct las_waves *w = &las->waves;
    char what[160];
    recorder_report(r, las->n_waves_left_out, "points whose waveforms are left out; LAS 1.2 has no place for them");
    if (las->facts.has_waves) {
        snprintf(what, sizeof what,
                 "waveforms filled up with %llu samples without light: LAS allows 255 lengths of waveforms",
                 (unsigned long long)w->n_fill);
        recorder_report(r, w->n_filled, what);
        recorder_report(r, w->n_kindless, "waveforms left out: LAS allows 255 lengths of waveforms, of all digitisers");
    } else if (r->options.las_wdp) {
        sh_warn(r->options.report, "%s: no .wdp is written: the head sends no waveforms (waveform.send)", r->file.path);
    }
}

static int las_finish(void *rec, struct sh_err *err)
{
    struct las *las = rec;
    int rc = outfile_check(&las->base.file, err); /* then the header goes on saying that the file is incomplete */
    if (rc == 0 && !las->begun) rc = put_front(las, err);
    las->facts.is_growing = 0;
    if (rc == 0 && las->facts.has_waves) rc = end_waves(las, err);
    las->facts.incomplete = 0;
    if (rc == 0) rc = write_front(las, err);
    if (rc == 0 && las->facts.has_waves && las->base.options.las_wdp) rc = las_waves_keep(&las->waves, err);
    if (rc != 0) return rc;
    report_waves(las);
    recorder_report(rec, las->base.track.missing.n_empty, "shots without echo left out; LAS has no place for them");
    recorder_report(rec, las->n_beyond_returns,
                    "echoes left out: the sixth and later ones of a pulse; LAS 1.2 holds five");
    recorder_report(rec, las->n_returns_cut,
                    "points of pulses with more than 5 echoes; LAS 1.2 counts up to 5, so 5 is written");
    if (las->facts.minor == 2 && las->facts.n_points != 0)
        sh_warn(las->base.options.report, "%s: LAS 1.2 has no place for labels and scan angles%s; they are left out",
                las->base.file.path, las->base.track.has_attributes ? ", amplitude and width" : "");
    recorder_report(rec, las->n_no_angle,
                    "points without a scan angle (0 is written): the scan's pose is infinite or NaN");
    if (las->time_came_late)
        sh_warn(las->base.options.report,
                "%s: times count from the scan's start: the head's messages about its clock were lost before the first "
                "points",
                las->base.file.path);
    return 0;
}

static int las_save(void *rec, struct sh_err *err)
{
    struct las *las = rec;
    const int rc = las_waves_flush(&las->waves, err); /* before the points, which refer to them */
    return rc == 0 ? outfile_save(&las->base.file, err) : rc;
}

static void las_release(void *rec)
{
    las_waves_close(&((struct las *)rec)->waves);
}

const struct recorder_ops recorder_las = {
    .ending = ".las",
    .size = sizeof(struct las),
    .track = {.scan = las_scan, .points = las_points, .wants_attributes = 1, .wants_colours = 1, .wants_waves = 1},
    .fits = las_fits,
    .begin = las_begin,
    .finish = las_finish,
    .save = las_save,
    .release = las_release,
    .repair = las_repair,
};
