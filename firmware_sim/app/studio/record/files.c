/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/record/files.h"

#include <dirent.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/newfile.h"
#include "core/studio/mesh.h"
#include "drivers/protocol/native.h"
#include "firmware_sim/app/app.h"

int record_files_add(struct record_files *files, const char *path, struct sh_err *err)
{
    if (files->n == RECORD_MAX_FILES) return sh_fail(err, SH_EINPUT, "record: at most %d files", RECORD_MAX_FILES);
    for (int i = 0; i < files->n; i++)
        if (strcmp(files->file[i].path, path) == 0) return sh_fail(err, SH_EINPUT, "record: -o %s: given twice", path);
    const struct recorder_ops *ops = recorder_find(path, err);
    if (ops == NULL) return err->code;
    files->file[files->n++] = (struct record_file){.path = path, .ops = ops};
    return SH_OK;
}

static int is_name_of_scan(const struct record_file *file, const char *path)
{
    return app_is_name_of_scan(file->path, strlen(file->ops->ending), path);
}

int record_files_check_each(const struct record_files *files, struct sh_err *err)
{
    for (int i = 0; i < files->n; i++)
        for (int k = 0; k < files->n; k++)
            if (is_name_of_scan(&files->file[i], files->file[k].path))
                return sh_fail(err, SH_EINPUT,
                               "-o %s: with --each the file of one scan of %s has that name; allowed is any other name",
                               files->file[k].path, files->file[i].path);
    return SH_OK;
}

void record_files_shape(struct record_files *files)
{
    for (int i = 0; i < files->n; i++)
        files->file[i].ops = recorder_shape(files->file[i].ops, &files->recorder);
}

int record_files_have_meshes(const struct record_files *files)
{
    for (int i = 0; i < files->n; i++)
        if (files->file[i].ops->is_mesh) return 1;
    return 0;
}

int record_files_have(const struct record_files *files, const char *ending)
{
    for (int i = 0; i < files->n; i++)
        if (strcmp(files->file[i].ops->ending, ending) == 0) return 1;
    return 0;
}

int record_files_have_colours(const struct record_files *files)
{
    const unsigned columns = files->recorder.columns;
    const int ply_has = columns == 0 || (columns & PLY_COLOUR) != 0;
    for (int i = 0; i < files->n; i++) {
        const struct recorder_ops *ops = files->file[i].ops;
        if (ops->track.wants_colours && (ply_has || strcmp(ops->ending, ".ply") != 0)) return 1;
    }
    return 0;
}

int record_files_check_degrees(const struct record_files *files, struct sh_err *err)
{
    for (int i = 0; i < files->n; i++)
        if (files->file[i].ops->track.metres)
            return sh_fail(err, SH_EINPUT,
                           "record: -o %s: this format holds metres, and output.crs is geodetic; allowed local, ecef, "
                           "utm, or .las, .ply",
                           files->file[i].path);
    return SH_OK;
}

int record_files_check_floats(const struct record_files *files, struct sh_err *err)
{
    for (int i = 0; i < files->n; i++)
        if (files->file[i].ops->is_mesh && mesh_is_float(files->file[i].path))
            return sh_fail(
                err, SH_EINPUT,
                "record: -o %s: %s holds coordinates as float, which are up to 0.5 m apart at the millions of "
                "metres of utm and ecef; allowed --crs local, or .ply, .obj",
                files->file[i].path, files->file[i].ops->ending);
    return SH_OK;
}

int record_files_refuse_meshes(const struct record_files *files, const char *why, struct sh_err *err)
{
    for (int i = 0; i < files->n; i++)
        if (files->file[i].ops->is_mesh)
            return sh_fail(err, SH_EINPUT, "record: -o %s: a mesh %s", files->file[i].path, why);
    return SH_OK;
}

int record_files_check_emitter(const struct record_files *files, enum emitter_kind kind, struct sh_err *err)
{
    if (kind != EMITTER_BEAMS && kind != EMITTER_DIRECTIONS) return SH_OK;
    for (int i = 0; i < files->n; i++)
        if (files->file[i].ops->track.grid)
            return sh_fail(
                err, SH_EINPUT,
                "record: -o %s: a grid has rows and columns, but this head fires %s; allowed are .ply .las .e57 "
                ".poses.csv .waves.csv .shs .pcapng",
                files->file[i].path, kind == EMITTER_BEAMS ? "beams in turn" : "along a list");
    return SH_OK;
}

int record_files_check_heads(const struct record_files *files, struct sh_err *err)
{
    for (int i = 0; i < files->n && !files->split; i++)
        if (files->file[i].ops->track.points == NULL && files->file[i].ops->track.scan == NULL)
            return sh_fail(
                err, SH_EINPUT,
                "record: -o %s: the file is the stream of one head, but the stations have several scanners; allowed "
                "with --split, or with --station N",
                files->file[i].path);
    return SH_OK;
}

int record_files_check_scan(const struct record_files *files, const struct recorder_scan *first,
                            const struct recorder_scan *scan, struct sh_err *err)
{
    struct sh_err why = {0};
    for (int i = 0; i < files->n; i++) {
        const struct record_file *file = &files->file[i];
        const int rc = file->ops->fits != NULL
                           ? file->ops->fits(file->path, &files->recorder, files->split ? scan : first, scan, &why)
                           : SH_OK;
        if (rc != SH_OK) return sh_fail(err, rc, "record: station %u: -o %s", scan->station, why.text);
    }
    return SH_OK;
}

static void close_spools(struct record_files *files)
{
    for (uint32_t i = 0; i < files->n_spools; i++) {
        colour_spool_close(files->spool[i]);
        free(files->spool[i]);
    }
    free(files->spool);
    files->spool = NULL;
    files->n_spools = 0;
}

/* The path of the file at hand: with --split it has the scan's number. To be freed; NULL: no memory. */
static char *present_path(const struct record_files *files, const struct record_file *file, struct sh_err *err)
{
    const int stem = (int)(strlen(file->path) - strlen(file->ops->ending));
    char *path = NULL;
    if ((files->split ? asprintf(&path, "%.*s-%u%s", stem, file->path, files->part, file->path + stem)
                      : asprintf(&path, "%s", file->path)) >= 0)
        return path;
    sh_fail(err, SH_ENOMEM, "%s: no memory for its name", file->path);
    return NULL;
}

/* Frames of another head are a stream of their own, so they get a spool of their own. */
static int add_spool(struct record_files *files, struct sh_err *err)
{
    struct colour_spool *spool = NULL;
    if (!resize(&files->spool, files->n_spools + (size_t)1, sizeof(struct colour_spool *)) ||
        (spool = calloc(1, sizeof *spool)) == NULL)
        return sh_fail(err, SH_ENOMEM, "%s: no memory to keep its frames", files->file[0].path);
    const int rc = colour_spool_open(spool, files->file[0].now, files->recorder.colour.scale.mode, err);
    if (rc == SH_OK) {
        files->spool[files->n_spools++] = spool;
        return SH_OK;
    }
    colour_spool_close(spool); /* it has no file, so nothing may be read back from it */
    free(spool);
    return rc;
}

/* A file that gets its colours at the end is opened now, too: an error of writing must come before the scan. */
static int open_file(const struct record_files *files, struct record_file *file, struct sh_err *err)
{
    file->now = present_path(files, file, err);
    return file->now != NULL ? recorder_open(file->ops, file->now, &files->recorder, &file->rec, err) : SH_ENOMEM;
}

/* The ending of the second file that a format leaves behind, in place of FILE's own ending; NULL: it leaves none. The
 * second file may be there without FILE.part, where somebody moved only FILE.part away. */
static const char *second_of(const struct record_files *files, const struct record_file *file)
{
    const char *ending = file->ops->ending;
    if (strcmp(ending, ".las") == 0 && files->recorder.las_minor != 2) return ".wdp.part";
    return strcmp(ending, ".ptx") == 0 ? ".ptx.grid" : NULL;
}

static int check_second(const char *second, const char *path, struct sh_err *err)
{
    const long long len = newfile_left_len(second);
    if (len == 0) return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "%s: an earlier recording left %lld bytes there, which the repair of its %s.part needs; move it "
                   "beside that file, or remove it",
                   second, len, path);
}

/* With --split: looks for remains of any scan's file before the recording begins. Without this they would stop the
 * recording only when their scan begins. `end` is the ending of the remains, in place of FILE's own ending. */
static int check_parts_of_scans(const struct record_file *file, const char *end,
                                int (*check)(const char *left, const char *path, struct sh_err *err),
                                struct sh_err *err)
{
    const int folder = (int)(basename(file->path) - file->path);
    char *name = folder > 0 ? strndup(file->path, (size_t)folder) : strdup(".");
    DIR *dir = name != NULL ? opendir(name) : NULL;
    int rc = SH_OK;
    free(name);
    for (const struct dirent *entry; dir != NULL && rc == SH_OK && (entry = readdir(dir)) != NULL;) {
        const int n = (int)strlen(entry->d_name) - (int)strlen(end); /* without it */
        char path[PATH_MAX], left[PATH_MAX];
        if (n <= 0 || strcmp(entry->d_name + n, end) != 0) continue;
        snprintf(path, sizeof path, "%.*s%.*s%s", folder, file->path, n, entry->d_name, file->ops->ending);
        snprintf(left, sizeof left, "%.*s%s", folder, file->path, entry->d_name);
        if (is_name_of_scan(file, path)) rc = check(left, path, err);
    }
    if (dir != NULL) closedir(dir); /* a missing folder is reported when the file is opened */
    return rc;
}

static int check_left(const struct record_files *files, const struct record_file *file, struct sh_err *err)
{
    const char *second = second_of(files, file);
    const int stem = (int)(strlen(file->path) - strlen(file->ops->ending));
    char end[32], left[PATH_MAX + 32];
    int rc;
    if (files->takes_over || file->ops->repair == NULL) return SH_OK;
    snprintf(end, sizeof end, "%s.part", file->ops->ending);
    if (files->split) {
        rc = check_parts_of_scans(file, end, outfile_check_left, err);
        return rc == SH_OK && second != NULL ? check_parts_of_scans(file, second, check_second, err) : rc;
    }
    snprintf(left, sizeof left, "%s.part", file->path);
    rc = outfile_check_left(left, file->path, err);
    if (rc != SH_OK || second == NULL) return rc;
    snprintf(left, sizeof left, "%.*s%s", stem, file->path, second);
    return check_second(left, file->path, err);
}

int record_files_open(struct record_files *files, struct sh_err *err)
{
    int rc = SH_OK;
    for (int i = 0; i < files->n && rc == SH_OK && files->part == 0; i++)
        rc = check_left(files, &files->file[i], err);
    files->part++;
    files->recorder.padding = &files->padding;
    files->has_points = 0;
    for (int i = 0; i < files->n && rc == SH_OK; i++)
        rc = open_file(files, &files->file[i], err);
    if (rc == SH_OK && files->own_limits && record_files_have_colours(files)) rc = add_spool(files, err);
    if (rc != SH_OK) record_files_close(files, 0, NULL); /* these files get no frame, so none is kept as a whole one */
    return rc;
}

/* Frames for files with colours, and the first error. A file that fails gets no more of them. */
struct colouring {
    struct record_files *files;
    struct sh_err first;
    int n_left; /* files that still get frames */
};

static int to_coloured(void *ctx, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct colouring *c = ctx;
    c->n_left = 0;
    for (int i = 0; i < c->files->n; i++) {
        struct record_file *file = &c->files->file[i];
        struct sh_err why = {0};
        if (!file->ops->track.wants_colours || file->lacks) continue;
        const int rc = recorder_frame(file->rec, sh, frame, &why);
        file->lacks = rc != SH_OK;
        c->n_left += rc == SH_OK;
        if (rc == SH_OK) continue;
        if (c->first.code == SH_OK)
            sh_fail(&c->first, rc, "%s", why.text);
        else
            sh_warn(c->files->recorder.report, "%s", why.text);
    }
    return c->n_left > 0 ? SH_OK : sh_fail(err, c->first.code, "%s", c->first.text);
}

/* Gives the frames that waited to the files with colours. The limits of the colours are taken over all spools. */
static int colour_files(struct record_files *files, struct sh_err *err)
{
    struct colouring c = {.files = files};
    double low = INFINITY, high = -INFINITY;
    int rc = SH_OK;
    for (uint32_t i = 0; i < files->n_spools; i++) {
        if (!files->spool[i]->has_points) continue;
        low = fmin(low, files->spool[i]->low);
        high = fmax(high, files->spool[i]->high);
    }
    for (int i = 0; i < files->n; i++)
        if (files->file[i].rec != NULL && low <= high) recorder_set_limits(files->file[i].rec, low, high);
    for (uint32_t i = 0; i < files->n_spools && rc == SH_OK; i++)
        rc = colour_spool_drain(files->spool[i], to_coloured, &c, files->recorder.report, err);
    /* Where files are left, the error is that of reading, and the file's own one would be lost. */
    if (rc != SH_OK && c.n_left > 0 && c.first.code != SH_OK) sh_warn(files->recorder.report, "%s", c.first.text);
    for (int i = 0; i < files->n && rc != SH_OK; i++)
        files->file[i].lacks = files->file[i].ops->track.wants_colours;
    return rc == SH_OK && c.first.code != SH_OK ? sh_fail(err, c.first.code, "%s", c.first.text) : rc;
}

/* Returns whether the frames of one spool have a name now. */
static int keep_spool(const struct record_files *files, uint32_t i)
{
    const struct sh_report *report = files->recorder.report;
    struct sh_err why = {0};
    char number[16] = "", *path = NULL;
    if (i > 0) snprintf(number, sizeof number, "-%u", i + 1);
    if (asprintf(&path, "%s.frames%s.shs", files->file[0].now, number) < 0) return 0;
    const int rc = colour_spool_keep(files->spool[i], path, &why);
    if (rc == SH_OK)
        sh_warn(report, "%s keeps all frames of the points; scanhead record %s -o FILE makes files of them", path,
                path);
    else
        sh_warn(report, "%s", why.text);
    if (rc == SH_EIO) outfile_say_left(path, report);
    free(path);
    return rc == SH_OK || rc == SH_EIO;
}

/* Keeps the frames, which needs no room: they are on the disk already. Returns whether all have a name now. */
static int keep_spools(const struct record_files *files)
{
    int all = 1;
    for (uint32_t i = 0; i < files->n_spools; i++)
        all &= keep_spool(files, i);
    return all;
}

/* Closes one file. drops: where it lacks points that could not be coloured, it is removed. Else the points that reached
 * the disk stay, as after a failed write. */
static int close_file(const struct record_files *files, struct record_file *file, int keep, int drops,
                      struct sh_err *err)
{
    if (file->rec == NULL) return SH_OK;
    if (keep && file->lacks) {
        sh_warn(files->recorder.report, "%s: its points could not be coloured; it is not written", file->now);
        recorder_set_failed(file->rec);
    }
    const int rc = recorder_close(file->rec, keep && !(file->lacks && drops), err);
    file->rec = NULL;
    file->lacks = 0;
    return rc;
}

int record_files_close(struct record_files *files, int keep, struct sh_err *err)
{
    const int coloured = files->n_spools > 0 && keep ? colour_files(files, err) : SH_OK;
    /* A campaign (takes_over) makes its files anew, and leaves nothing. */
    const int drops = coloured == SH_ESTOPPED || (coloured != SH_OK && (files->takes_over || keep_spools(files)));
    int rc = coloured, is_cut = 0; /* a file with colours could not be completed */
    for (int i = 0; i < files->n; i++) {
        struct sh_err why = {0};
        const int e = close_file(files, &files->file[i], keep, drops, &why);
        is_cut |= e != SH_OK && e != SH_ESTOPPED && files->file[i].ops->track.wants_colours;
        if (e != SH_OK && rc != SH_OK && why.text[0] != '\0') sh_warn(files->recorder.report, "%s", why.text);
        if (e != SH_OK && rc == SH_OK) rc = sh_fail(err, e, "%s", why.text); /* err has the first */
    }
    if (coloured == SH_OK && is_cut && keep && !files->takes_over) keep_spools(files);
    close_spools(files);
    for (int i = 0; i < files->n; i++) {
        free(files->file[i].now);
        files->file[i].now = NULL;
    }
    return rc;
}

int record_files_save(struct record_files *files, struct sh_err *err)
{
    int rc = SH_OK;
    for (int i = 0; i < files->n && rc == SH_OK; i++)
        if (files->file[i].rec != NULL) rc = recorder_save(files->file[i].rec, err);
    return rc;
}

/* A scan begins with its event or, where that was lost, with a descriptor that is no repetition. The event of the scan
 * at hand can come after its first points: with the same start, and later than these. */
static int begins_scan(const struct record_files *files, const struct scanhead_frame *frame)
{
    if (frame->type == SCANHEAD_EVENT)
        return frame->event == SCANHEAD_EV_SCAN_START &&
               !((int64_t)frame->event_value[1] == files->begin_ns && frame->t_ns > files->last_ns);
    return frame->type == SCANHEAD_DESCRIPTOR && (frame->flags & SCANHEAD_REPEAT) == 0;
}

int record_files_frame(struct record_files *files, struct scanhead *sh, const struct scanhead_frame *frame,
                       struct sh_err *err)
{
    int rc = SH_OK;
    const int is_other = files->sh != NULL && sh != files->sh;
    files->sh = sh;
    if (files->split && files->has_points && (begins_scan(files, frame) || is_other)) {
        rc = record_files_close(files, 1, err);
        if (rc == SH_OK) rc = record_files_open(files, err);
    } else if (files->n_spools > 0 && is_other) {
        rc = add_spool(files, err);
    }
    if (rc == SH_OK && files->n_spools > 0) rc = colour_spool_frame(files->spool[files->n_spools - 1], sh, frame, err);
    for (int i = 0; i < files->n && rc == SH_OK; i++)
        if (files->n_spools == 0 || !files->file[i].ops->track.wants_colours)
            rc = recorder_frame(files->file[i].rec, sh, frame, err);
    if (rc == SH_OK && frame->type == SCANHEAD_POINTS) {
        files->has_points = 1;
        files->begin_ns = native_since_ns(frame->t_ns, frame->scan_t0_ns);
        files->last_ns = frame->t_ns;
    }
    return rc;
}
