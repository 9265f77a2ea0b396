/* SPDX-License-Identifier: MIT */
/* Checks the files that a command names: it writes none twice, and none that it reads, so that none is destroyed.
 * This file also checks that a file that an option or a link writes has a folder. */
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/grow.h"
#include "core/newfile.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/sidecars.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/files.h"
#include "firmware_sim/config/load.h"

struct named {
    char *who, *path;
    int is_there, is_written;
    struct stat st;  /* where it is there */
    int needs_place; /* its folder must be there already */
    int is_given;    /* by an option that writes it, or by a file link */
    int is_filled;   /* likewise, and in place */
    int is_image;    /* of a mesh, beside it: meshes of one scan share their image */
    size_t n_ending; /* where each scan gets a file of its own: bytes of the path's ending; 0: it is one file */
};

struct files {
    struct named *file;
    size_t n, room;
    const struct config *cfg;
    const char *prefix; /* before the names of keys */
    int keeps_written;  /* 1: files that the configuration names for writing are written */
    struct sh_err *err;
};

/* ---- the same file */

/* Finds the folder of a path, and the name in it. */
static int split(const char *path, struct stat *folder, const char **name)
{
    char dir[PATH_MAX] = ".";
    *name = basename(path);
    if (*name - path >= PATH_MAX) return 0; /* no such file can be made */
    if (*name != path) snprintf(dir, sizeof dir, "%.*s", (int)(*name - path), path);
    return stat(dir, folder) == 0;
}

int app_is_name_of_scan(const char *file, size_t n_ending, const char *name)
{
    const size_t len = strlen(file), stem = len > n_ending ? len - n_ending : len;
    if (n_ending == 0 || strncmp(name, file, stem) != 0 || name[stem] != '-') return 0;
    const size_t digits = strspn(name + stem + 1, "0123456789");
    return digits > 0 && strcmp(name + stem + 1 + digits, file + stem) == 0;
}

/* Whether both are one name in one folder: then they would be one file, also where that file is not there yet. */
static int is_same_name(const struct named *a, const struct named *b)
{
    struct stat folder[2];
    const char *name[2];
    const int has_a = split(a->path, &folder[0], &name[0]), has_b = split(b->path, &folder[1], &name[1]);
    if (!has_a || !has_b) return strcmp(a->path, b->path) == 0;
    if (folder[0].st_dev != folder[1].st_dev || folder[0].st_ino != folder[1].st_ino) return 0;
    return strcmp(name[0], name[1]) == 0 || app_is_name_of_scan(name[0], a->n_ending, name[1]) ||
           app_is_name_of_scan(name[1], b->n_ending, name[0]);
}

/* Whether both are the same file, also under two names. Devices and pipes may be given twice. Standard output, as -,
 * may not: two of a command's files there, say CSV and JSON, would be one text that nothing reads. */
static int outputs_is_same(const struct named *a, const struct named *b)
{
    const int both = a->is_there && b->is_there;
    const int a_out = strcmp(a->path, "-") == 0, b_out = strcmp(b->path, "-") == 0;
    if (a_out || b_out) return a_out && b_out;
    if ((a->is_there && !S_ISREG(a->st.st_mode)) || (b->is_there && !S_ISREG(b->st.st_mode))) return 0;
    if (both && a->st.st_dev == b->st.st_dev && a->st.st_ino == b->st.st_ino) return 1;
    return is_same_name(a, b);
}

/* ---- the list of files */

/* Adds a file. `who` and `path` then belong to the list; both are freed after a failure. A NULL means that there was no
 * memory for it. */
static int outputs_add(struct files *f, char *who, char *path, int is_written, size_t n_ending)
{
    if (who != NULL && path != NULL && grow(&f->file, &f->room, f->n + 1, sizeof *f->file)) {
        struct named *file = &f->file[f->n++];
        *file = (struct named){.who = who, .path = path, .is_written = is_written, .n_ending = n_ending};
        file->is_there = stat(path, &file->st) == 0;
        return SH_OK;
    }
    free(who);
    free(path);
    return sh_fail(f->err, SH_ENOMEM, "no memory for the names of files");
}

static char *join(const char *a, size_t n, const char *b, const char *c)
{
    char *text;
    return asprintf(&text, "%.*s%s%s", (int)n, a, b, c) >= 0 ? text : NULL;
}

static int add_option(struct files *f, const struct app_file *file)
{
    const size_t len = strlen(file->path), stem = len > file->n_ending ? len - file->n_ending : 0;
    char *who = file->option != NULL ? join("--", 2, file->option, "") : join("the operand ", 12, file->path, "");
    const char *added = file->added != NULL ? file->added : "";
    char *path = file->ending != NULL ? join(file->path, stem, file->ending, "") : join(file->path, len, added, "");
    const size_t n_ending = file->ending != NULL ? strlen(file->ending) : file->n_ending + strlen(added);
    const int is_written = file->use == APP_WRITES || file->use == APP_FILLS;
    const int rc = outputs_add(f, who, path, is_written, file->each ? n_ending : 0);
    if (rc != SH_OK) return rc;
    f->file[f->n - 1].is_image = file->ending != NULL && strcmp(file->ending, ".png") == 0;
    f->file[f->n - 1].needs_place = f->file[f->n - 1].is_given = file->is_given && is_written;
    f->file[f->n - 1].is_filled = file->is_given && file->use == APP_FILLS;
    return SH_OK;
}

static int add_key(void *ctx, const char *key, const char *path, int is_written)
{
    struct files *f = ctx;
    if (is_written && !f->keeps_written) return SH_OK;
    const int rc = outputs_add(f, join(key[0] != '-' ? f->prefix : "", INT_MAX, key, ""), strdup(path), is_written, 0);
    if (rc != SH_OK) return rc;
    /* Only files of links are written in every run. head.settings_file, for one, is not written where a journal is
     * replayed. */
    unsigned link;
    struct named *file = &f->file[f->n - 1];
    file->needs_place = is_written && sscanf(key, "links[%u]", &link) == 1;
    file->is_given = file->is_filled = file->needs_place && f->cfg->link[link].type == LINK_FILE;
    return SH_OK;
}

static int add_of_mesh(void *ctx, const char *name, const char *path)
{
    struct files *f = ctx;
    return outputs_add(f, join(name, INT_MAX, ", named in ", f->prefix), strdup(path), 0, 0);
}

/* Adds the files that meshes name. The search takes as long as reading the meshes, so it is made only where a file may
 * be overwritten (any_is_there). */
static int add_of_meshes(struct files *f)
{
    static const char *const endings[] = {".obj", ".ply", ".gltf", ".glb", ".fbx", ".dae", ".ifc"};
    int rc = SH_OK;
    for (size_t i = 0, n = f->n; i < n && rc == SH_OK; i++) {
        for (size_t k = 0; k < sizeof endings / sizeof endings[0] && rc == SH_OK; k++) {
            struct sh_err why = {0};
            if (f->file[i].is_written || !app_ends_in(f->file[i].path, endings[k])) continue;
            f->prefix = f->file[i].who;
            rc = app_sidecars(f->file[i].path, add_of_mesh, f, &why);
            if (rc == SH_ENOMEM) sh_fail(f->err, rc, "no memory for the names of files");
            if (rc != SH_ENOMEM) rc = SH_OK; /* its reader says what is wrong with it */
        }
    }
    return rc;
}

/* Scanners of stations have profiles of their own. */
static int add_of_scanners(struct files *f, const struct config *cfg)
{
    struct config *own = calloc(1, sizeof *own);
    int rc = own != NULL ? SH_OK : sh_fail(f->err, SH_ENOMEM, "no memory for a scanner");
    f->keeps_written = 0;
    for (uint32_t i = 0; i < cfg->n_stations && rc == SH_OK; i++) {
        char prefix[48];
        if (config_serves(cfg, i) || cfg->station[i].scanner != i + 1) continue;
        snprintf(prefix, sizeof prefix, "stations[%u].scanner.", i);
        f->prefix = prefix;
        rc = config_load_scanner(cfg, i + 1, own, f->err);
        if (rc == SH_OK) rc = config_each_file(own, add_key, f);
    }
    free(own);
    return rc;
}

/* 1: a file that is to be written exists already, or each scan writes a file, whose name is not known yet. 0: nothing
 * can be overwritten. */
static int any_is_there(const struct files *f)
{
    for (size_t i = 0; i < f->n; i++) {
        const struct named *file = &f->file[i];
        if (file->is_written && (file->n_ending > 0 || (file->is_there && S_ISREG(file->st.st_mode)))) return 1;
    }
    return 0;
}

static int add_all(struct files *f, const struct app_input *in, const struct config *cfg)
{
    int rc = SH_OK;
    f->cfg = cfg;
    f->keeps_written = in->opens_links;
    f->prefix = "";
    for (int i = 0; i < in->n_files && rc == SH_OK; i++)
        rc = add_option(f, &in->file[i]);
    if (rc == SH_OK && cfg != NULL) rc = config_each_file(cfg, add_key, f);
    if (rc != SH_OK || !any_is_there(f)) return rc;
    if (cfg != NULL) rc = add_of_scanners(f, cfg);
    return rc == SH_OK ? add_of_meshes(f) : rc;
}

/* ---- the check */

static int is_of_system(const char *path)
{
    return strncmp(path, "/dev/", 5) == 0 || strncmp(path, "/proc/", 6) == 0;
}

/* A link is not followed when the file is made (core/newfile.h), except for the system's own, such as /dev/stdout. */
static int check_link(const struct named *file, struct sh_err *err)
{
    struct stat st;
    struct sh_err why;
    if (is_of_system(file->path) || lstat(file->path, &st) != 0 || !S_ISLNK(st.st_mode)) return SH_OK;
    newfile_fail_link(file->path, &why);
    return sh_fail(err, why.code, "%s %s", file->who, why.text);
}

static int fail_file(const struct named *file, int code, const char *why, struct sh_err *err)
{
    return sh_fail(err, code, "%s %s: %s", file->who, file->path, why);
}

/* Checks whether a new file can be made in its folder. */
static int check_folder(const struct named *file, struct sh_err *err)
{
    struct stat st;
    if (lstat(file->path, &st) != 0 && errno == ENAMETOOLONG)
        return fail_file(file, SH_EINPUT, strerror(ENAMETOOLONG), err);
    const int error = newfile_folder_error(file->path);
    return error == 0 ? SH_OK : fail_file(file, SH_EPERM, strerror(error), err);
}

/* Tries whether a file can be filled that is perhaps opened only at the end of long work. Nothing is changed. A FIFO is
 * not opened: its reader may come later, and one that waits would take the check for the end of the data. */
static int check_filled(const struct named *file, struct sh_err *err)
{
    struct sh_err why = {0};
    int fd;
    if (is_of_system(file->path) || strcmp(file->path, "-") == 0) return SH_OK;
    if (!file->is_there) return check_folder(file, err);
    if (S_ISSOCK(file->st.st_mode))
        return fail_file(file, SH_EINPUT, "is a socket; allowed are a regular file, a device and a FIFO", err);
    if (faccessat(AT_FDCWD, file->path, W_OK, AT_EACCESS) != 0) return fail_file(file, SH_EPERM, strerror(errno), err);
    if (!S_ISREG(file->st.st_mode) || faccessat(AT_FDCWD, file->path, R_OK, AT_EACCESS) != 0) return SH_OK;
    const int rc = newfile_append(file->path, &fd, &why);
    if (rc == SH_OK) close(fd);
    if (rc == SH_OK) return SH_OK;
    return sh_fail(err, rc == SH_ESTATE ? SH_EINPUT : rc, "%s %s", file->who, why.text);
}

/* Some files are made at the end of long work. A missing folder shows now. */
static int check_place(const struct named *file, struct sh_err *err)
{
    struct stat st;
    const char *name;
    if (file->is_there && !S_ISDIR(file->st.st_mode)) return SH_OK;
    if (file->is_there)
        return sh_fail(err, SH_EINPUT, "%s %s: is a directory; allowed is a file", file->who, file->path);
    errno = ENOENT;
    if (file->path[0] != '\0' && (split(file->path, &st, &name) || (errno != ENOENT && errno != ENOTDIR))) return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s %s: %s", file->who, file->path, strerror(errno));
}

/* Refuses a file that is written twice, or read and written. A name that is read counts only if the file exists: a
 * scenario that comes with the program is named without a folder, and there may be no such file. */
static int check(const struct files *f, struct sh_err *err)
{
    for (size_t i = 0; i < f->n; i++) {
        const struct named *out = &f->file[i];
        for (size_t k = 0; k < f->n && out->is_written; k++) {
            const struct named *other = &f->file[k];
            if (!other->is_written && other->is_there && outputs_is_same(out, other))
                return sh_fail(err, SH_EINPUT, "%s %s: is also read as %s, and would be overwritten; name another file",
                               out->who, out->path, other->who);
            if (other->is_written && k < i && !(out->is_image && other->is_image) && outputs_is_same(out, other))
                return sh_fail(err, SH_EINPUT, "%s %s: %s writes the same file; name another one", out->who, out->path,
                               other->who);
        }
    }
    return SH_OK;
}

int app_check_files(const struct app_input *in, const struct config *cfg, struct sh_err *err)
{
    struct files f = {.err = err};
    int rc = add_all(&f, in, cfg);
    for (size_t i = 0; i < f.n && rc == SH_OK; i++)
        if (f.file[i].needs_place) rc = check_place(&f.file[i], err);
    if (rc == SH_OK) rc = check(&f, err);
    for (size_t i = 0; i < f.n && rc == SH_OK; i++)
        if (f.file[i].is_given) rc = check_link(&f.file[i], err);
    for (size_t i = 0; i < f.n && rc == SH_OK; i++)
        if (f.file[i].is_filled) rc = check_filled(&f.file[i], err);
    for (size_t i = 0; i < f.n; i++) {
        free(f.file[i].who);
        free(f.file[i].path);
    }
    free(f.file);
    return rc;
}
