/* SPDX-License-Identifier: MIT */
/* The files that a line of `record` writes or reads without naming them. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "firmware_sim/app/studio/record/line.h"

/* A file beside FILE, if FILE has the ending `of`. */
struct beside {
    const char *of, *ending;
};

/* In place of FILE's ending: the files that a mesh names, and the files of waveforms. */
static const struct beside instead[] = {{".obj", ".mtl"}, {".obj", ".png"}, {".gltf", ".bin"},    {".gltf", ".png"},
                                        {".fbx", ".png"}, {".las", ".wdp"}, {".las", ".wdp.part"}};
/* After FILE's ending: what is renamed or removed at the end. */
static const struct beside after[] = {{"", ".part"}, {".ptx", ".grid"}};

enum { N_INSTEAD = sizeof instead / sizeof instead[0], N_AFTER = sizeof after / sizeof after[0] };

static int add_beside(struct record_line *r, const struct app_file *named)
{
    int status = APP_OK;
    struct app_file beside = *named;
    beside.is_given = 0; /* a recording may have none of these files */
    for (size_t k = 0; k < N_INSTEAD && status == APP_OK; k++) {
        struct app_file other = beside;
        other.ending = instead[k].ending;
        if (strcmp(other.ending, ".wdp") == 0 && !r->job.files.recorder.las_wdp) continue;
        if (app_ends_in(named->path, instead[k].of)) status = app_add_file(&r->in, &other);
    }
    for (size_t k = 0; k < N_AFTER && status == APP_OK; k++) {
        struct app_file other = beside;
        other.added = after[k].ending;
        if (app_ends_in(named->path, after[k].of)) status = app_add_file(&r->in, &other);
    }
    return status;
}

int record_line_add_files(struct record_line *r)
{
    const int n_files = r->in.n_files;
    int file = 0, status = APP_OK;
    for (int i = 0; i < n_files && status == APP_OK; i++) {
        struct app_file *named = &r->in.file[i];
        if (named->option == NULL || strcmp(named->option, "output") != 0) continue;
        const struct recorder_ops *ops = r->job.files.file[file++].ops; /* both lists have the order of -o */
        named->n_ending = strlen(ops->ending);
        named->each = r->job.files.split || r->job.each;
        status = add_beside(r, named);
    }
    return status;
}

/* Whether there is a file that has `ending` in place of the last n bytes of the path. */
static int is_there(const char *path, size_t n, const char *ending)
{
    char *other;
    if (asprintf(&other, "%.*s%s", (int)(strlen(path) - n), path, ending) < 0) return 1;
    const int there = access(other, F_OK) == 0;
    free(other);
    return there;
}

static size_t len_of_file(const char *path)
{
    return strlen(path) - (app_ends_in(path, ".part") ? strlen(".part") : 0);
}

/* Whether an earlier --repair names FILE or FILE.part, too. One repair follows the other, so that is allowed. */
static int is_named_before(const struct record_line *r, int i)
{
    const size_t n = len_of_file(r->repair[i]);
    int k = 0;
    while (k < i && (len_of_file(r->repair[k]) != n || strncmp(r->repair[k], r->repair[i], n) != 0))
        k++;
    return k < i;
}

/* FILE is the file that a repair makes of FILE.part, which it also takes as its operand. X.wdp is the file of waveforms
 * that it makes of X.wdp.part. A repair replaces nothing: where these are there, it reads them. */
int record_line_add_repaired(struct record_line *r)
{
    static const char part[] = ".part", las[] = ".las", wdp[] = ".wdp";
    int status = APP_OK;
    for (int i = 0; i < r->n_repairs && status == APP_OK; i++) {
        const char *path = r->repair[i];
        if (is_named_before(r, i)) continue;
        const size_t n_part = app_ends_in(path, part) ? strlen(part) : 0, n_las = n_part + strlen(las);
        const int is_las = app_ends_in(path, n_part != 0 ? ".las.part" : las);
        const struct app_file is = {.option = "repair", .path = path, .n_ending = n_part, .use = APP_READS};
        struct app_file other[] = {is, is, is, is, is};
        other[0].ending = "";
        if (!is_there(path, n_part, "")) other[0].use = APP_WRITES;
        other[1].ending = part;
        other[2].ending = ".grid";
        other[3].n_ending = other[4].n_ending = n_las;
        other[3].ending = ".wdp.part";
        other[4].ending = wdp;
        if (is_las && !is_there(path, n_las, wdp)) other[4].use = APP_WRITES;
        for (int k = 0; k < (is_las ? 5 : 3) && status == APP_OK; k++)
            status = app_add_file(&r->in, &other[k]);
    }
    return status == APP_OK ? APP_GO_ON : APP_USAGE;
}
