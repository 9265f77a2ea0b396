/* SPDX-License-Identifier: MIT */
#include "drivers/record/repair.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/newfile.h"
#include "drivers/record/recorder.h"

enum { BLOCK = 1 << 20, LINE_MOST = 1 << 16 };

/* ---- bytes of the file */

static int ends_in_part(const char *path)
{
    const size_t n = strlen(path);
    return n > 5 && strcmp(path + n - 5, ".part") == 0;
}

int repair_is_part(const struct repair *r)
{
    return ends_in_part(r->path);
}

int repair_read(const struct repair *r, uint64_t at, void *to, size_t len, struct sh_err *err)
{
    for (size_t done = 0; done < len;) {
        const ssize_t n = pread(r->fd, (char *)to + done, len - done, (off_t)(at + done));
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0)
            return sh_fail(err, SH_EIO, "%s: cannot be read: %s", r->path,
                           n < 0 ? strerror(errno) : "it got shorter while it was read");
        done += (size_t)n;
    }
    return SH_OK;
}

/* A file that we may not change was opened for reading only. */
static int check_writable(const struct repair *r, struct sh_err *err)
{
    if ((fcntl(r->fd, F_GETFL) & O_ACCMODE) != O_RDONLY) return SH_OK;
    return sh_fail(err, SH_EPERM,
                   "%s: needs a repair, but is not writable; allowed is a file that you own and that has one hard link",
                   r->path);
}

int repair_write(const struct repair *r, uint64_t at, const void *from, size_t len, struct sh_err *err)
{
    const int rc = check_writable(r, err);
    if (rc != SH_OK) return rc;
    for (size_t done = 0; done < len;) {
        const ssize_t n = pwrite(r->fd, (const char *)from + done, len - done, (off_t)(at + done));
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0)
            return sh_fail(err, SH_EIO, "%s: cannot be repaired: %s", r->path, strerror(n < 0 ? errno : ENOSPC));
        done += (size_t)n;
    }
    return SH_OK;
}

int repair_cut(struct repair *r, uint64_t end, struct sh_err *err)
{
    if (end >= r->len) return SH_OK;
    const int rc = check_writable(r, err);
    if (rc != SH_OK) return rc;
    if (ftruncate(r->fd, (off_t)end) != 0)
        return sh_fail(err, SH_EIO, "%s: cannot be cut: %s", r->path, strerror(errno));
    r->cut_bytes += r->len - end;
    return SH_OK;
}

/* Reports progress, and checks whether a stop was asked for; called between blocks. */
static int go_on(const struct repair *r, uint64_t at, struct sh_err *err)
{
    sh_progress(r->report, "looking for complete data", (double)at / (double)(r->len + 1));
    return sh_check_stop(r->report, err);
}

int repair_rows(const struct repair *r, const struct repair_rows *rows, void (*fn)(void *ctx, const uint8_t *row),
                void *ctx, struct sh_err *err)
{
    const size_t len = rows->len, at_once = len < BLOCK ? BLOCK / len : 1;
    uint8_t *block = malloc(at_once * len);
    int rc = block != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "%s: no memory to read it", r->path);
    for (uint64_t i = 0; rc == SH_OK && i < rows->n; i += at_once) {
        const size_t n = rows->n - i < at_once ? (size_t)(rows->n - i) : at_once;
        rc = go_on(r, rows->from + i * len, err);
        if (rc == SH_OK) rc = repair_read(r, rows->from + i * len, block, n * len, err);
        for (size_t row = 0; rc == SH_OK && row < n; row++)
            fn(ctx, block + row * len);
    }
    free(block);
    return rc;
}

int repair_is_zero(const uint8_t *row, size_t len)
{
    return row[0] == 0 && memcmp(row, row + 1, len - 1) == 0;
}

int repair_find_zeros(const struct repair *r, uint64_t from, uint64_t end, uint64_t *zeros_at, struct sh_err *err)
{
    uint8_t *block = malloc(BLOCK);
    int rc = block != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "%s: no memory to read it", r->path);
    size_t n = 0; /* bytes of the block, up to its last one that is not zero */
    while (rc == SH_OK && n == 0 && end > from) {
        n = end - from < BLOCK ? (size_t)(end - from) : BLOCK;
        end -= n;
        rc = sh_check_stop(r->report, err);
        if (rc == SH_OK) rc = repair_read(r, end, block, n, err);
        while (rc == SH_OK && n > 0 && block[n - 1] == 0)
            n--;
    }
    free(block);
    *zeros_at = end + n;
    return rc;
}

int repair_leave_zeros(const struct repair *r, struct repair_rows *rows, uint64_t end, size_t least, struct sh_err *err)
{
    uint64_t zeros_at;
    int rc = repair_find_zeros(r, rows->from, end, &zeros_at, err);
    if (rc != SH_OK) return rc;
    const uint64_t n = (zeros_at - rows->from) / rows->len, row_at = rows->from + n * rows->len;
    rows->n = n + (row_at < zeros_at && row_at + rows->len == end);
    int is_whole = 0;
    while (rc == SH_OK && !is_whole && rows->n > 0) { /* so a further repair finds the same rows */
        const uint64_t at = rows->from + (rows->n - 1) * rows->len;
        rc = repair_find_zeros(r, at, at + rows->len, &zeros_at, err);
        is_whole = zeros_at > at && zeros_at - at >= least;
        rows->n -= !is_whole;
    }
    return rc;
}

struct lines {
    int (*fn)(void *ctx, const char *line, size_t len);
    void *ctx;
    uint64_t end, bad_at; /* where the last good line ends; where the first bad one begins */
    int has_bad;
};

int repair_fail_damaged(const struct repair *r, uint64_t at, struct sh_err *err)
{
    return sh_fail(
        err, SH_EFORMAT,
        "%s: is damaged at byte %llu, with good data after it; an interrupted recording does not do that; the file is "
        "unchanged",
        r->path, (unsigned long long)at);
}

static int repair_take_line(const struct repair *r, struct lines *l, const char *line, size_t len, uint64_t at,
                            struct sh_err *err)
{
    const int good = len < LINE_MOST && strlen(line) == len && l->fn(l->ctx, line, len);
    if (good && l->has_bad) return repair_fail_damaged(r, l->bad_at, err);
    if (good) l->end = at + len + 1;
    if (!good && !l->has_bad) l->bad_at = at;
    l->has_bad |= !good;
    return SH_OK;
}

int repair_lines(const struct repair *r, uint64_t from, int (*fn)(void *ctx, const char *line, size_t len), void *ctx,
                 uint64_t *end, struct sh_err *err)
{
    struct lines l = {.fn = fn, .ctx = ctx, .end = from};
    char *block = malloc(BLOCK);
    int rc = block != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "%s: no memory to read it", r->path);
    for (uint64_t at = from; rc == SH_OK && at < r->len;) {
        const size_t n = r->len - at < BLOCK ? (size_t)(r->len - at) : BLOCK;
        size_t used = 0;
        rc = go_on(r, at, err);
        if (rc == SH_OK) rc = repair_read(r, at, block, n, err);
        for (char *stop; rc == SH_OK && (stop = memchr(block + used, '\n', n - used)) != NULL;) {
            const size_t len = (size_t)(stop - block) - used;
            *stop = '\0';
            rc = repair_take_line(r, &l, block + used, len, at + used, err);
            used += len + 1;
        }
        if (used == 0 && n < BLOCK) break; /* the rest is a piece of a line */
        if (used == 0 && rc == SH_OK) rc = repair_take_line(r, &l, block, used = n, at, err);
        at += used;
    }
    free(block);
    *end = l.end;
    return rc;
}

static void note_data(void *has_data, const uint8_t *byte)
{
    if (*byte != 0) *(int *)has_data = 1;
}

int repair_check_rest(const struct repair *r, uint64_t end, uint64_t most, struct sh_err *err)
{
    int has_data = 0;
    if (r->len - end <= most) return SH_OK;
    const struct repair_rows behind = {end + most, r->len - end - most, 1};
    const int rc = repair_rows(r, &behind, note_data, &has_data, err);
    return rc != SH_OK || !has_data ? rc : repair_fail_damaged(r, end, err);
}

void repair_append_note(const struct repair *r, uint64_t end, const void *note, size_t len)
{
    if (repair_write(r, end, note, len, NULL) == SH_OK) return;
    sh_warn(r->report, "%s: the disk has no room for the note that the file may be incomplete", r->path);
    if (ftruncate(r->fd, (off_t)end) != 0) return; /* the piece of a note is cut by the next repair */
}

static const char MARK[] = "# " REPAIR_INCOMPLETE "\n";

int repair_is_mark(const char *line, size_t len)
{
    return len == sizeof MARK - 2 && memcmp(line, MARK, len) == 0;
}

int repair_end_text(struct repair *r, uint64_t end, int is_marked, int is_ours, struct sh_err *err)
{
    r->was_whole = end == r->len && (!repair_is_part(r) || is_marked);
    if (!r->was_whole && !is_ours) return repair_fail_foreign(r, err);
    const int rc = repair_cut(r, end, err);
    if (rc == SH_OK && !r->was_whole && !is_marked) repair_append_note(r, end, MARK, sizeof MARK - 1);
    return rc;
}

int repair_fail_foreign(const struct repair *r, struct sh_err *err)
{
    return sh_fail(
        err, SH_EFORMAT,
        "%s: is incomplete or has unknown contents, and was written by another program; only files of scanhead are "
        "repaired; it is unchanged",
        r->path);
}

int repair_fail_none(const struct repair *r, const char *format, struct sh_err *err)
{
    return sh_fail(err, SH_EFORMAT, "%s: is not a %s, or too short to tell; it is unchanged", r->path, format);
}

/* ---- the file */

int repair_exists(const char *path)
{
    struct stat st;
    return lstat(path, &st) == 0;
}

/* Finds out whether path means FILE or FILE.part. */
static int choose(const char *path, struct repaired *d, struct sh_err *err)
{
    const int named = ends_in_part(path);
    if (asprintf(&d->path, "%.*s", (int)(strlen(path) - (named ? 5 : 0)), path) < 0) d->path = NULL;
    if (d->path == NULL || asprintf(&d->part, "%s.part", d->path) < 0) {
        d->part = NULL;
        return sh_fail(err, SH_ENOMEM, "%s: no memory", path);
    }
    d->was_left = named || repair_exists(d->part);
    if (!named && d->was_left && repair_exists(d->path))
        return sh_fail(err, SH_ESTATE,
                       "%s: both this file and %s exist; give %s to repair it (it keeps its name), or move %s away",
                       d->path, d->part, d->part, d->path);
    return SH_OK;
}

static int repair_open(struct repair *r, const struct recorder_ops *ops, struct sh_err *err)
{
    struct stat st;
    if (fstat(r->fd, &st) != 0) return sh_fail(err, SH_EIO, "%s: %s", r->path, strerror(errno));
    r->len = (uint64_t)st.st_size;
    if (ops->repair == NULL)
        return sh_fail(err, SH_EFORMAT, "%s: %s is written in one piece at its end; nothing of this file can be kept",
                       r->path, ops->ending);
    if (r->len == 0)
        return sh_fail(
            err, SH_EFORMAT,
            "%s: is empty: nothing was written to the disk. Meshes, and files whose colours have no --colour-limits, "
            "are written after the last scan",
            r->path);
    return ops->repair(r, err);
}

/* Renames a repaired FILE.part to FILE. */
static int repair_settle(struct repaired *d, int *fd, struct sh_err *err)
{
    if (d->was_left && !repair_exists(d->path)) {
        const int rc = newfile_settle_free(d->path, d->part, *fd, err);
        if (rc == SH_OK) *fd = -1;
        return rc;
    }
    d->is_part = d->was_left;
    if (!d->was_whole && fsync(*fd) != 0)
        return sh_fail(err, SH_EIO, "%s: cannot be synced: %s", d->is_part ? d->part : d->path, strerror(errno));
    return SH_OK;
}

int repair_file(const char *path, const struct sh_report *report, struct repaired *d, struct sh_err *err)
{
    *d = (struct repaired){0};
    struct repair r = {.fd = -1, .report = report};
    int rc = choose(path, d, err);
    const struct recorder_ops *ops = rc == SH_OK ? recorder_find(d->path, err) : NULL;
    if (rc == SH_OK && ops == NULL) rc = err->code;
    r.path = d->was_left ? d->part : d->path;
    if (rc == SH_OK) rc = d->was_left ? newfile_left(r.path, &r.fd, err) : newfile_whole(r.path, &r.fd, err);
    if (rc == SH_OK) rc = repair_open(&r, ops, err);
    d->n_kept = r.n_kept;
    d->n_scans = r.n_scans;
    d->cut_bytes = r.cut_bytes;
    d->unit = r.unit;
    d->was_whole = r.was_whole;
    if (rc == SH_OK) rc = repair_settle(d, &r.fd, err);
    if (r.fd >= 0) close(r.fd);
    if (rc != SH_OK) repair_free(d);
    return rc;
}

void repair_free(struct repaired *d)
{
    free(d->path);
    free(d->part);
    d->path = d->part = NULL;
}
