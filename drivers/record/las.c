/* SPDX-License-Identifier: MIT */
/* .las: LAS 1.4, point data record format 6 (7 with colour) followed by the label; one record per echo. Where the head
 * sends waveforms the format is 9 (10), and packets of samples follow (las_waves.c). On request the file is LAS 1.2 for
 * older readers: format 1 (3), five returns, no labels, scan angles, attributes or waveforms. The file itself describes
 * its numbers (las_header.c).
 *
 * Coordinates are counts from the first scan's station, in the stream's own scale, or in a coarser one for a head that
 * moves. In the geo layout of a head that stands, coordinates of the first scan are thus the numbers of the stream.
 * Coordinates of other stations are rounded once, by half a count at most. Nothing is clipped: a point too far for 32
 * bits is an error. Longitudes go on beyond 180 or -180 degrees where a scan crosses the antimeridian: all lie within
 * 180 degrees of the first station. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/newfile.h"
#include "drivers/record/las_inside.h"

static int las_begin(void *rec, struct sh_err *err)
{
    struct las *las = rec;
    las->facts.track = &las->base.track;
    las->base.track.no_empty = 1;
    las->base.track.spared = TRACK_RANGE;
    las->facts.minor = las->base.options.las_minor == 2 ? 2 : 4;
    for (int i = 0; i < 3; i++)
        las->facts.scale[i] = 1;
    strcpy(las->facts.profile, "OTHER"); /* until points have come */
    return las->base.options.las_wdp ? las_waves_check(las->base.file.path, err) : 0;
}

int las_write_front(struct las *las, struct sh_err *err)
{
    struct outfile *file = &las->base.file;
    uint8_t front[LAS_FRONT_MAX];
    int rc = las_waves_flush(&las->waves, err);
    if (rc == 0) rc = outfile_flush(file, err);
    if (rc != 0) return rc;
    const size_t len = las_front(&las->facts, front);
    return file->written == 0 ? outfile_write(file, front, len, err) : outfile_patch(file, 0, front, len, err);
}

/* Writes the header and the records before the points. Until the header is written again at the end, with the counts,
 * it marks the file as incomplete, for a repair (las_repair.c). */
static int put_front(struct las *las, struct sh_err *err)
{
    las->begun = 1;
    las->facts.incomplete = las->facts.is_growing = 1;
    return las_write_front(las, err);
}

/* Sets the offset to the first anchor, and the scale to the stream's own, or to a coarser one for a head that moves. */
static void set_scale(struct las *las)
{
    const struct track *t = &las->base.track;
    struct las_facts *f = &las->facts;
    memcpy(f->offset, t->pose.shift_m, sizeof f->offset);
    for (int i = 0; i < 3; i++)
        f->scale[i] = t->info.geo ? t->info.scale[i] * (t->scale_m / t->info.scale_m) : t->scale_m;
    if (!las_is_swapped(las)) return;
    las_swap(f->offset);
    las_swap(f->scale);
}

static int las_scan(void *rec, struct sh_err *err)
{
    struct las *las = rec;
    const struct track *t = &las->base.track;
    struct las_facts *f = &las->facts;
    if (las->begun && strcmp(f->profile, t->info.profile) != 0 && strcmp(f->profile, "MERGE") != 0) {
        strcpy(f->profile, "MERGE"); /* as LAS calls it */
        return las_write_front(las, err);
    }
    if (las->begun) return 0;
    set_scale(las);
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

/* Completes the packets. An internal record follows the points. Until it is copied, the header says that the packets
 * are in a .wdp, and how many points there are. From this a repair finds the end of the points. */
static int end_waves(struct las *las, struct sh_err *err)
{
    int rc = las_waves_end(&las->waves, err);
    if (rc != 0 || las->base.options.las_wdp) return rc;
    rc = las_write_front(las, err);
    const uint64_t at = las->base.file.written;
    if (rc == 0) rc = las_waves_copy(&las->waves, &las->base.file, las->base.options.report, err);
    las->facts.waves_at = at;
    return rc;
}

/* The points are synced first. Else a power cut could leave X.wdp beside a .part whose header does not say that it is
 * complete, and X.wdp would count as that of an older recording (las_waves_repair.c). */
static int keep_waves(struct las *las, struct sh_err *err)
{
    const int rc = newfile_sync(las->base.file.part, las->base.file.fd, err);
    return rc == 0 ? las_waves_keep(&las->waves, err) : rc;
}

static void report_waves(struct las *las)
{
    const struct recorder *r = &las->base;
    const struct las_waves *w = &las->waves;
    char what[160];
    recorder_report(
        r, las->n_waves_left_out,
        las->facts.minor == 2
            ? "points whose waveforms are left out; LAS 1.2 has no place for them"
            : "points whose waveforms are left out: the file began without waveforms, as the head sent none");
    if (las->facts.has_waves) {
        snprintf(what, sizeof what,
                 "waveforms filled up with %llu samples without light: LAS allows 255 lengths of waveforms",
                 (unsigned long long)w->n_fill);
        recorder_report(r, w->n_filled, what);
        recorder_report(r, w->n_kindless, "waveforms left out: LAS allows 255 lengths of waveforms, of all digitisers");
    } else if (r->options.las_wdp && las->n_waves_left_out == 0) {
        sh_warn(r->options.report, "%s: no .wdp is written: the head sends no waveforms (waveform.send)", r->file.path);
    }
}

static int las_finish(void *rec, struct sh_err *err)
{
    struct las *las = rec;
    int rc = las->begun ? 0 : put_front(las, err);
    las->facts.is_growing = 0;
    if (rc == 0 && las->facts.has_waves) rc = end_waves(las, err);
    las->facts.incomplete = 0;
    if (rc == 0) rc = las_write_front(las, err);
    if (rc == 0 && las->facts.has_waves && las->base.options.las_wdp) rc = keep_waves(las, err);
    if (rc != 0) return rc;
    report_waves(las);
    recorder_report(rec, las->base.track.missing.n_empty, "shots without echo left out; LAS has no place for them");
    recorder_report(rec, las->n_beyond_returns,
                    "echoes left out: the sixth and later ones of a pulse; LAS 1.2 holds five");
    recorder_report(rec, las->n_returns_cut,
                    "points of pulses with more than 5 echoes; LAS 1.2 counts up to 5, so 5 is written");
    if (las->facts.minor == 2 && las->facts.n_points != 0)
        sh_warn(las->base.options.report,
                "%s: LAS 1.2 has no place for labels and exact scan angles%s; they are left out", las->base.file.path,
                las->base.track.has_attributes ? ", amplitude and width" : "");
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
