#include "firmware_sim/app/record_files.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

int record_files_have(const struct record_files *files, const char *ending)
{
    for (int i = 0; i < files->n; i++)
        if (strcmp(files->file[i].ops->ending, ending) == 0) return 1;
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

int record_files_check_emitter(const struct record_files *files, enum emitter_kind kind, struct sh_err *err)
{
    if (kind != EMITTER_BEAMS && kind != EMITTER_DIRECTIONS) return SH_OK;
    for (int i = 0; i < files->n; i++)
        if (files->file[i].ops->track.grid)
            return sh_fail(err, SH_EINPUT,
                           "record: -o %s: a grid has rows and columns, and this head fires %s; allowed .ply .las "
                           ".e57 .shs",
                           files->file[i].path, kind == EMITTER_BEAMS ? "beams in turn" : "along a list");
    return SH_OK;
}

static int open_file(const struct record_files *files, struct record_file *file, struct sh_err *err)
{
    char *path = NULL;
    if (!files->split) return recorder_open(file->ops, file->path, &files->recorder, &file->rec, err);
    const char *ending = file->path + strlen(file->path) - strlen(file->ops->ending);
    if (asprintf(&path, "%.*s-%u%s", (int)(ending - file->path), file->path, files->part, ending) < 0)
        return sh_fail(err, SH_ENOMEM, "%s: no memory for its name", file->path);
    int rc = recorder_open(file->ops, path, &files->recorder, &file->rec, err);
    free(path);
    return rc;
}

int record_files_open(struct record_files *files, struct sh_err *err)
{
    int rc = SH_OK;
    files->part++;
    files->recorder.padding = &files->padding;
    files->has_points = 0;
    for (int i = 0; i < files->n && rc == SH_OK; i++)
        rc = open_file(files, &files->file[i], err);
    return rc;
}

int record_files_close(struct record_files *files, int keep, struct sh_err *err)
{
    int rc = SH_OK;
    for (int i = 0; i < files->n; i++) {
        struct sh_err why = {0};
        if (files->file[i].rec == NULL) continue;
        int e = recorder_close(files->file[i].rec, keep, &why);
        files->file[i].rec = NULL;
        if (e != SH_OK && rc == SH_OK) rc = sh_fail(err, e, "%s", why.text);
    }
    return rc;
}

/* A scan begins with its event or, where that was lost, with a descriptor that is no repetition. */
static int begins_scan(const struct scanhead_frame *frame)
{
    if (frame->type == SCANHEAD_EVENT) return frame->event == SCANHEAD_EV_SCAN_START;
    return frame->type == SCANHEAD_DESCRIPTOR && (frame->flags & SCANHEAD_REPEAT) == 0;
}

int record_files_frame(struct record_files *files, struct scanhead *sh, const struct scanhead_frame *frame,
                       struct sh_err *err)
{
    int rc = SH_OK;
    if (files->split && files->has_points && begins_scan(frame)) {
        rc = record_files_close(files, 1, err);
        if (rc == SH_OK) rc = record_files_open(files, err);
    }
    if (frame->type == SCANHEAD_POINTS) files->has_points = 1;
    for (int i = 0; i < files->n && rc == SH_OK; i++)
        rc = recorder_frame(files->file[i].rec, sh, frame, err);
    return rc;
}
