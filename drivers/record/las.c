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

#include "core/bytes.h"
#include "drivers/protocol/native.h"
#include "drivers/record/las_header.h"
#include "drivers/record/las_repair.h"
#include "drivers/record/recorder.h"

#define M_PER_PS                  (0.5 * 299792458e-12) /* range, of a pulse's way out and back */
#define SCAN_ANGLE_COUNTS_PER_RAD (1.0 / NATIVE_RAD_PER_DEG / 0.006)

enum { LAS_BATCH_LEN = TRACK_BATCH * LAS_POINT_LEN_MAX };

struct las {
    struct recorder base;
    struct las_facts facts;
    int begun, time_came_late;
    size_t front_len;
    uint64_t n_empty, n_no_angle;
    uint64_t n_beyond_returns, n_returns_cut, n_waves_left_out; /* LAS 1.2 */
    struct las_waves waves;
    struct las_packet packet[TRACK_BATCH]; /* of the points of the batch */
};

static int las_begin(void *rec, struct sh_err *err)
{
    struct las *las = rec;
    las->facts.track = &las->base.track;
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

/* The angle from straight down, in the head's frame. */
static uint16_t scan_angle(struct las *las, const double p_socs[3])
{
    float flat = sqrtf((float)(p_socs[0] * p_socs[0] + p_socs[1] * p_socs[1]));
    float up = atan2f(flat, (float)-p_socs[2]);
    if (isnan(up)) {
        las->n_no_angle++;
        return 0;
    }
    return (uint16_t)lrintf(up * (float)SCAN_ANGLE_COUNTS_PER_RAD);
}

/* 0 where not modelled, so that the rest keeps its 0.01 dB: 1 is -327.67 dB. */
static uint16_t intensity(double reflectance_db)
{
    return isnan(reflectance_db) ? 0 : (uint16_t)(lrint(reflectance_db * 100) + 32768);
}

static int set_xyz(struct las *las, int32_t n[3], const double p[3], struct sh_err *err)
{
    struct las_facts *f = &las->facts;
    for (int i = 0; i < 3; i++) {
        double from_offset = p[i] - f->offset[i];
        if (i == 0 && is_swapped(las)) from_offset = remainder(from_offset, 360);
        double counts = rint(from_offset / f->scale[i]);
        if (!(fabs(counts) <= INT32_MAX)) return too_far(las, p, err);
        n[i] = (int32_t)counts;
    }
    return 0;
}

/* The time of point i of the batch. One that has waited got its time before it waited. */
static int has_time(const struct track *t, int i, double *gps_s)
{
    *gps_s = t->gps_s[i];
    return t->waited ? !isnan(*gps_s) : scanhead_gps_time(t->sh, t->points.t_ns[i], gps_s) == 0;
}

static int set_time(const struct las *las, double *time_s, int i, struct sh_err *err)
{
    *time_s = (double)las->base.track.points.t_ns[i] / 1e9;
    if (las->facts.gps_time && !has_time(&las->base.track, i, time_s))
        return sh_fail(err, SH_EFORMAT, "%s: the head no longer reports the time; a LAS file holds one kind of time",
                       las->base.file.path);
    return 0;
}

/* Turns p into the head's frame, accurately enough for an angle. */
static void set_socs(const struct track *t, double p[3])
{
    if (t->info.crs == NATIVE_CRS_GEODETIC) {
        const double m_deg = 6371000 * NATIVE_RAD_PER_DEG, north = (p[0] - t->pose.shift_m[0]) * m_deg;
        const double east = remainder(p[1] - t->pose.shift_m[1], 360) * m_deg * cos(p[0] * NATIVE_RAD_PER_DEG);
        p[0] = t->pose.shift_m[0] + east;
        p[1] = t->pose.shift_m[1] + north;
    }
    station_pose_reverse(&t->pose, p);
}

/* 0.01 dB and 0.01 ns, as on the wire. */
static void set_attribute(struct las_point *to, const struct scanhead_attribute *a, double deviation)
{
    int amplitude = isnan(a->amplitude_db) ? NATIVE_AMPLITUDE_NONE : (int)lrint(100 * a->amplitude_db);
    int width = isnan(a->width_ns) ? NATIVE_WIDTH_NONE : (int)lrint(100 * a->width_ns);
    to->amplitude = (uint16_t)amplitude;
    to->width = (uint16_t)width;
    to->deviation = isnan(deviation) ? UINT16_MAX : (uint16_t)lrint(1000 * fmin(deviation, 65.534));
}

/* LAS 1.2 counts to five. */
static void set_returns(struct las *las, struct las_point *to, int i)
{
    to->echo = las->base.track.points.echo[i];
    to->echo_count = las->base.track.points.echo_count[i];
    if (las->facts.minor != 2 || to->echo_count <= LAS_12_RETURNS) return;
    to->echo_count = LAS_12_RETURNS;
    las->n_returns_cut++;
}

/* ---- waveforms */

/* The packets of the batch are written before its points, as a new descriptor changes what comes before all points. */
static int put_packets(struct las *las, int n, struct sh_err *err)
{
    const struct track *t = &las->base.track;
    int rc = 0, is_new, any_new = 0;
    for (int i = 0; rc == 0 && i < n; i++) {
        las->packet[i] = (struct las_packet){0};
        if (t->wave[i] == NULL) continue;
        rc = las_waves_put(&las->waves, t->n_scans, t->wave[i], &las->packet[i], &is_new, err);
        any_new |= is_new;
    }
    return rc == 0 && any_new ? write_front(las, err) : rc;
}

/* The specification puts a packet's first sample at point + location * (dx, dy, dz), which is nearer to the head
 * than the point. So (dx, dy, dz) leads back to the head, as readers take it. */
static void set_wave(struct las *las, struct las_point *to, int i)
{
    struct track *t = &las->base.track;
    double beam[3];
    if (las->packet[i].kind == 0) return;
    if (!track_beam(t, i, beam)) {
        t->missing.n_without_waves++;
        return;
    }
    if (is_swapped(las)) swap(beam);
    to->packet = las->packet[i];
    to->location_ps = (float)(t->wave_at[i] * t->wave[i]->sample_ps);
    for (int k = 0; k < 3; k++)
        to->back_ps[k] = (float)(-beam[k] * M_PER_PS);
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

/* Point i of the batch. */
static int put_point(struct las *las, uint8_t *to, int i, struct sh_err *err)
{
    struct track *t = &las->base.track;
    const struct track_points *p = &t->points;
    struct las_point las_point = {
        .intensity = intensity(p->reflectance_db[i]), .station = (uint16_t)t->info.station, .label = p->label[i]};
    double p_crs[3] = {p->x[i], p->y[i], p->z[i]}, p_socs[3] = {p->x[i], p->y[i], p->z[i]};
    if (!t->info.geo)
        station_pose_forward(&t->pose, p_crs);
    else
        set_socs(t, p_socs);
    if (is_swapped(las)) swap(p_crs);
    int rc = set_time(las, &las_point.time_s, i, err);
    if (rc == 0) rc = set_xyz(las, las_point.xyz, p_crs, err);
    if (rc != 0) return rc;
    set_returns(las, &las_point, i);
    if (!t->info.moving && las->facts.minor != 2) las_point.scan_angle = scan_angle(las, p_socs);
    if (t->has_attributes) set_attribute(&las_point, &t->attribute[i], t->deviation[i]);
    if (t->has_colours) memcpy(las_point.rgb, t->rgb[i], sizeof las_point.rgb);
    if (las->facts.has_waves) set_wave(las, &las_point, i);
    las_put_point(&las->facts, &las_point, to);
    return 0;
}

/* Has the version no room for it? Counts why. */
static int is_left_out(struct las *las, int i)
{
    const struct track_points *p = &las->base.track.points;
    const int is_empty = p->echo_count[i] == 0, beyond = las->facts.minor == 2 && p->echo[i] > LAS_12_RETURNS;
    las->n_empty += (uint64_t)is_empty;
    las->n_beyond_returns += (uint64_t)(!is_empty && beyond);
    return is_empty || beyond;
}

static int check_count(const struct las *las, struct sh_err *err)
{
    if (las->facts.minor != 2 || las->facts.n_points < UINT32_MAX) return 0;
    return sh_fail(err, SH_EFORMAT, "%s: LAS 1.2 holds up to 4294967295 points; use --las-version 1.4, or --split",
                   las->base.file.path);
}

static int las_points(void *rec, int n, struct sh_err *err)
{
    struct las *las = rec;
    struct outfile *file = &las->base.file;
    double s;
    int rc = las->facts.has_waves ? put_packets(las, n, err) : 0;
    if (rc == 0 && OUTFILE_BUFFER - file->len < LAS_BATCH_LEN) rc = las_waves_flush(&las->waves, err);
    if (rc != 0) return rc;
    uint8_t *to = outfile_room(file, LAS_BATCH_LEN, err), *at = to;
    if (to == NULL) return SH_EIO;
    if (!las->facts.gps_time && !las->time_came_late)
        las->time_came_late = scanhead_gps_time(las->base.track.sh, 0, &s) == 0;
    for (int i = 0; i < n; i++) {
        if (is_left_out(las, i)) continue;
        las->n_waves_left_out += las->base.track.has_waves && !las->facts.has_waves && las->base.track.wave[i] != NULL;
        rc = check_count(las, err);
        if (rc == 0) rc = put_point(las, at, i, err);
        if (rc != 0) break;
        las_count_record(&las->facts, at);
        at += las_point_len(&las->facts);
    }
    outfile_used(file, (size_t)(at - to)); /* also before a failure: the file may be kept */
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
    recorder_report(rec, las->n_empty, "shots without echo left out; LAS has no place for them");
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
