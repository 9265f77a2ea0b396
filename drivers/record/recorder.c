/* SPDX-License-Identifier: MIT */
#include "drivers/record/recorder.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* The one list of formats. */
extern const struct recorder_ops recorder_ply, recorder_las, recorder_ptx, recorder_e57, recorder_poses, recorder_waves,
    recorder_pcapng, recorder_shs, recorder_mesh_ply, recorder_obj, recorder_gltf, recorder_glb, recorder_fbx;
static const struct recorder_ops *const recorders[] = {
    &recorder_ply,    &recorder_las, &recorder_ptx, &recorder_e57,  &recorder_poses, &recorder_waves,
    &recorder_pcapng, &recorder_shs, &recorder_obj, &recorder_gltf, &recorder_glb,   &recorder_fbx};

enum { N_RECORDERS = sizeof recorders / sizeof recorders[0] };

const struct recorder_ops *recorder_find(const char *path, struct sh_err *err)
{
    size_t len = strlen(path);
    char known[128] = "";
    for (size_t i = 0; i < N_RECORDERS; i++) {
        size_t n = strlen(recorders[i]->ending);
        if (len > n && strcasecmp(path + len - n, recorders[i]->ending) == 0) return recorders[i];
        snprintf(known + strlen(known), sizeof known - strlen(known), " %s", recorders[i]->ending);
    }
    sh_fail(err, SH_EINPUT, "%s: no recorder has this ending; allowed are%s", path, known);
    return NULL;
}

const struct recorder_ops *recorder_shape(const struct recorder_ops *ops, const struct recorder_options *options)
{
    return ops == &recorder_ply && (options->mesh || options->sparse_per_m2 > 0) ? &recorder_mesh_ply : ops;
}

int recorder_open(const struct recorder_ops *ops, const char *path, const struct recorder_options *options,
                  struct recorder **out, struct sh_err *err)
{
    struct recorder *rec = calloc(1, ops->size);
    if (rec == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", path);
    int rc = outfile_open(&rec->file, path, err);
    if (rc != SH_OK) {
        free(rec);
        return rc;
    }
    rec->ops = ops;
    rec->options = *options;
    rec->file.may_be_direct = options->may_wait;
    rec->track.path = rec->file.path;
    rec->track.ops = &ops->track;
    rec->track.rec = rec;
    rec->track.colour = options->colour;
    rec->track.has_colours =
        ops->track.wants_colours && options->colour.given && options->colour.scale.mode != COLOUR_NONE;
    rc = ops->begin != NULL ? ops->begin(rec, err) : SH_OK;
    if (rc != SH_OK) {
        recorder_close(rec, 0, NULL);
        return rc;
    }
    *out = rec;
    return SH_OK;
}

void recorder_set_limits(struct recorder *rec, double low, double high)
{
    rec->track.colour.scale.low = low;
    rec->track.colour.scale.high = high;
}

int recorder_frame(struct recorder *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    const int is_first = rec->ops->track.points != NULL && rec->track.n_scans == 0;
    const int rc =
        rec->ops->frame != NULL ? rec->ops->frame(rec, sh, frame, err) : track_frame(&rec->track, sh, frame, err);
    const int is_refusal = rc == SH_EFORMAT || rc == SH_EINPUT;
    rec->has_failed |= rc != SH_OK && !is_refusal;
    rec->is_refused |= is_first && is_refusal;
    return rc;
}

void recorder_set_failed(struct recorder *rec)
{
    rec->has_failed = 1;
}

int recorder_save(struct recorder *rec, struct sh_err *err)
{
    const int rc = rec->ops->save != NULL ? rec->ops->save(rec, err) : outfile_save(&rec->file, err);
    rec->has_failed |= rc != SH_OK;
    return rc;
}

/* After a failure the file is not completed, even if there is room again: points in its middle would be missing.
 * A header that marks the file as incomplete stays. */
static int recorder_finish(struct recorder *rec, struct sh_err *err)
{
    int rc = outfile_check(&rec->file, err);
    if (rc == SH_OK && rec->has_failed)
        rc = sh_fail(err, SH_EIO, "%s: a part of it could not be written", rec->file.path);
    if (rc == SH_OK) rc = track_flush(&rec->track, err);
    if (rc == SH_OK && rec->ops->finish != NULL) rc = rec->ops->finish(rec, err);
    return rc == SH_OK ? outfile_check(&rec->file, err) : rc;
}

void recorder_report(const struct recorder *rec, uint64_t n, const char *what)
{
    if (n > 0) sh_warn(rec->options.report, "%s: %" PRIu64 " %s", rec->file.path, n, what);
}

static void report_waves(const struct recorder *rec)
{
    const struct track_missing *m = &rec->track.missing;
    recorder_report(rec, m->n_waves_unheld,
                    "waveforms left out; this format has no place for them, allowed are .las .waves.csv .shs .pcapng");
    recorder_report(rec, m->n_waves_unplaced, "waveforms left out whose points were lost, or which memory can't hold");
    recorder_report(rec, m->n_waves_alone, "waveforms left out without a point in them; .waves.csv holds them, too");
    recorder_report(rec, m->n_samples_lost, "samples of waveforms that found no room in the head");
    recorder_report(rec, m->n_without_waves, "points without a waveform: the head kept none there, or it was lost");
    recorder_report(
        rec, m->n_without_ranges,
        "of these points are of a moving head in the geo layout, without ranges; allowed are output.layout: "
        "polar, or output.crs: local");
}

static void report_losses(const struct recorder *rec)
{
    const struct track *t = &rec->track;
    if (rec->ops->track.points == NULL) return;
    recorder_report(rec, t->missing.n_unplaced,
                    "points left out that came before the descriptor and the anchor of their scan");
    recorder_report(rec, t->missing.n_without_pose, "points left out whose pose was lost");
    recorder_report(rec, t->missing.n_nowhere,
                    "points left out whose coordinates are infinite or NaN: the stream is broken");
    recorder_report(rec, t->missing.n_attributes_unheld,
                    "points whose amplitude and width are left out; this format has no place for them");
    recorder_report(rec, t->missing.n_without_attributes, "points without amplitude and width, which were lost");
    recorder_report(rec, t->missing.n_without_colours, "points that are grey, since their colours were lost");
    report_waves(rec);
}

/* After a failure what is on the disk stays, where a repair can use it. A file that the user gave up is removed. */
static enum outfile_end how_it_ends(const struct recorder *rec, int keep, int rc)
{
    const int can_be_repaired = rec->ops->repair != NULL;
    if (!keep || rc == SH_ESTOPPED) return OUTFILE_DROP;
    if (rc == SH_OK) return can_be_repaired ? OUTFILE_KEEP_PART : OUTFILE_KEEP;
    return can_be_repaired ? OUTFILE_LEAVE : OUTFILE_DROP;
}

int recorder_close(struct recorder *rec, int keep, struct sh_err *err)
{
    const struct recorder_ops *ops = rec->ops;
    char *path = strdup(rec->file.path);
    keep &= !rec->is_refused; /* a file without a scan would replace an older one that may be good */
    const int rc = keep ? recorder_finish(rec, err) : SH_OK;
    if (keep && rc == SH_OK) report_losses(rec);
    const enum outfile_end how = how_it_ends(rec, keep, rc);
    const int closed = outfile_close(&rec->file, how, err);
    if (path != NULL && (how == OUTFILE_LEAVE || (how == OUTFILE_KEEP_PART && closed != SH_OK)))
        outfile_say_left(path, rec->options.report);
    track_free(&rec->track);
    if (ops->release != NULL) ops->release(rec);
    free(rec);
    free(path);
    return rc != SH_OK ? rc : closed;
}
