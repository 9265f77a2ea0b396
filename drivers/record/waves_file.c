/* SPDX-License-Identifier: MIT */
/* A .waves.csv has the waveforms that the head sends, also those of pulses without an echo. Each window is a row.
 *
 * scan and station are as in .poses.csv; pulse is the pulse's number in the scan, and t_s its firing time since the
 * scan's start. Sample k of the n lies at range_m + k * step_m. The sample's signal, in units of the detection
 * threshold, is (count - baseline) * count_signal. dx, dy, dz lead along the beam: in the polar layout a vector of
 * length one in the head's frame, in the geo layout the change of the CRS's coordinates along a metre of range. The
 * last column has the counts, with blanks between. */
#include "core/bytes.h"
#include "core/decimal.h"
#include "drivers/record/csv_repair.h"
#include "drivers/record/recorder.h"

enum { WAVES_AT_ONCE = 64, FRONT_MOST = 1024, COUNT_MOST = 6, LINE_MOST = FRONT_MOST + 4096 * COUNT_MOST };

struct waves_file {
    struct recorder base;
    int is_sent; /* some head has waveforms */
    uint64_t n_lost, n_samples_lost;
};

static const char *const title[] = {"scan,station,pulse,t_s,range_m,step_m,n,baseline,count_signal,dx,dy,dz,samples\n",
                                    NULL};

/* Writes the columns before the samples. */
static char *put_front(char *at, const struct track *t, const struct scanhead_wave *w)
{
    const uint64_t whole[] = {t->n_scans, t->info.station, w->pulse};
    for (int i = 0; i < 3; i++) {
        at = decimal_put_whole(at, whole[i]);
        *at++ = ',';
    }
    at = decimal_put_fixed(at, 1e-9 * (double)w->t_ns, 9);
    *at++ = ',';
    at = decimal_put_cells(at, &w->range_m, 1, 9);
    at = decimal_put_cells(at, &w->step_m, 1, 12);
    at = decimal_put_whole(at, w->n);
    *at++ = ',';
    at = decimal_put_cells(at, &w->baseline, 1, 9);
    at = decimal_put_cells(at, &w->count_signal, 1, 9);
    return decimal_put_cells(at, w->direction, 3, 9);
}

static int put_wave(struct waves_file *file, const struct scanhead_wave *w, struct sh_err *err)
{
    const struct track *t = &file->base.track;
    char *row = (char *)outfile_room(&file->base.file, LINE_MOST, err), *at = row;
    if (row == NULL) return SH_EIO;
    at = put_front(at, t, w);
    for (uint32_t i = 0; i < w->n; i++) {
        if (i > 0) *at++ = ' ';
        at = decimal_put_whole(at, le_get16(w->sample + 2 * (size_t)i));
    }
    *at++ = '\n';
    outfile_used(&file->base.file, (size_t)(at - row));
    return SH_OK;
}

static int put_waves(struct waves_file *file, struct scanhead *sh, const struct scanhead_frame *frame,
                     struct sh_err *err)
{
    struct scanhead_wave wave[WAVES_AT_ONCE];
    struct scanhead_info info;
    const int64_t lost = scanhead_waves_lost(sh, frame);
    int rc = csv_put_title(&file->base.file, title[0], err);
    if (lost > 0) file->n_samples_lost += (uint64_t)lost;
    if (scanhead_get_info(sh, &info) != SCANHEAD_OK) { /* the track still has the scan before */
        file->n_lost += frame->n_points;
        return rc;
    }
    for (uint32_t first = 0; rc == SH_OK && first < frame->n_points;) {
        const int n = scanhead_waves(sh, frame, first, wave, WAVES_AT_ONCE);
        if (n <= 0) {
            file->n_lost += frame->n_points - first;
            return SH_OK;
        }
        for (int i = 0; i < n && rc == SH_OK; i++)
            rc = put_wave(file, &wave[i], err);
        first += (uint32_t)n;
    }
    return rc;
}

static int waves_file_frame(void *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct waves_file *file = rec;
    return frame->type == SCANHEAD_WAVES ? put_waves(file, sh, frame, err)
                                         : track_frame(&file->base.track, sh, frame, err);
}

/* The scans of a file may be of several heads, so one head that sends waveforms is enough to set is_sent. */
static int waves_file_scan(void *rec, struct sh_err *err)
{
    struct waves_file *file = rec;
    file->is_sent |= scanhead_has_waves(file->base.track.sh) == 1;
    return csv_put_title(&file->base.file, title[0], err);
}

static int waves_file_finish(void *rec, struct sh_err *err)
{
    struct waves_file *file = rec;
    const int rc = csv_put_title(&file->base.file, title[0], err);
    if (rc != SH_OK) return rc;
    if (!file->is_sent && file->base.track.n_scans > 0)
        sh_warn(file->base.options.report, "%s: there are no waveforms in it: the head sends none (waveform.send)",
                file->base.file.path);
    recorder_report(rec, file->n_lost,
                    "waveforms left out whose points were lost, or that came before the anchor of their scan");
    recorder_report(rec, file->n_samples_lost, "samples of waveforms that found no room in the head");
    return SH_OK;
}

static int waves_file_repair(struct repair *r, struct sh_err *err)
{
    static const struct csv_format format = {title, "0123456789+-.einfa, ", "waveforms", "file of waveforms",
                                             LINE_MOST};
    return csv_repair(r, &format, err);
}

const struct recorder_ops recorder_waves = {
    .ending = ".waves.csv",
    .size = sizeof(struct waves_file),
    .track = {.scan = waves_file_scan},
    .frame = waves_file_frame,
    .finish = waves_file_finish,
    .repair = waves_file_repair,
};
