/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/batch/manifest.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/infile.h"
#include "core/newfile.h"
#include "firmware_sim/app/app.h"

/* ---- all manifests of a folder */

static int read_lines(const char *path, int (*take)(void *ctx, struct batch_entry *entry, struct sh_err *err),
                      void *ctx, const struct sh_report *report, struct sh_err *err)
{
    const char *why;
    char *line = NULL;
    size_t room = 0;
    unsigned number = 0;
    int rc = SH_OK;
    FILE *in = infile_open(path, &why);
    if (in == NULL) return sh_fail(err, SH_EINPUT, "%s: cannot be read: %s", path, why);
    for (ssize_t n; rc == SH_OK && (n = getline(&line, &room, in)) > 0;) {
        struct batch_entry entry;
        number++;
        if (line[n - 1] != '\n') break; /* not whole */
        if (batch_entry_read(line, &entry))
            rc = take(ctx, &entry, err);
        else
            sh_warn(report, "%s:%u: this is not a line of a manifest; it is ignored", path, number);
    }
    if (rc == SH_OK && ferror(in)) rc = sh_fail(err, SH_EIO, "%s: cannot be read", path);
    free(line);
    fclose(in);
    return rc;
}

static int is_manifest(const struct dirent *entry)
{
    unsigned i, n;
    int end = 0;
    return sscanf(entry->d_name, "manifest-%u-of-%u.jsonl%n", &i, &n, &end) == 2 && end > 0 &&
           entry->d_name[end] == '\0';
}

int batch_manifest_read(const char *dir, int (*take)(void *ctx, struct batch_entry *entry, struct sh_err *err),
                        void *ctx, const struct sh_report *report, struct sh_err *err)
{
    struct dirent **found = NULL;
    const int n = scandir(dir, &found, is_manifest, alphasort);
    int rc = SH_OK;
    if (n < 0 && errno != ENOENT) rc = sh_fail(err, SH_EINPUT, "%s: cannot be read: %s", dir, strerror(errno));
    for (int i = 0; i < n; i++) {
        char path[PATH_MAX];
        snprintf(path, sizeof path, "%s/%s", dir, found[i]->d_name);
        if (rc == SH_OK) rc = read_lines(path, take, ctx, report, err);
        free(found[i]);
    }
    free(found);
    return rc;
}

/* ---- a shard's own */

/* Text after the last newline is a line whose writer was killed; it is cut off. */
static int cut_tail(int fd, const char *path, struct sh_err *err)
{
    off_t end = lseek(fd, 0, SEEK_END), at = end;
    char c = '\0';
    while (at > 0 && c != '\n')
        if (pread(fd, &c, 1, --at) != 1) return sh_fail(err, SH_EIO, "%s: cannot be read: %s", path, strerror(errno));
    if (c == '\n') at++;
    if (at == end || ftruncate(fd, at) == 0) return SH_OK;
    return sh_fail(err, SH_EIO, "%s: its unfinished line cannot be cut off: %s", path, strerror(errno));
}

int batch_manifest_open(const char *dir, uint32_t shard, uint32_t n_shards, int *fd, struct sh_err *err)
{
    char path[PATH_MAX];
    struct sh_err why;
    snprintf(path, sizeof path, "%s/manifest-%u-of-%u.jsonl", dir, shard, n_shards);
    int rc = newfile_append(path, fd, &why);
    if (rc == SH_ESTATE)
        return sh_fail(err, rc, "%s: another process does shard %u/%u; wait for its end, or choose another shard", path,
                       shard, n_shards);
    if (rc != SH_OK) return sh_fail(err, rc, "%s", why.text);
    rc = cut_tail(*fd, path, err);
    if (rc != SH_OK) close(*fd);
    return rc;
}

void batch_put_files(struct json *json, const struct batch_entry *entry)
{
    json_open_array(json, "files");
    for (uint32_t i = 0; i < entry->n_files; i++) {
        json_open_object(json, NULL);
        json_string(json, "name", entry->file[i].name);
        json_uint(json, "bytes", entry->file[i].bytes);
        json_string(json, "sha256", entry->file[i].sha);
        json_close_object(json);
    }
    json_close_array(json);
}

static void put_entry(FILE *out, const struct batch_entry *entry)
{
    struct json json;
    json_begin_one_line(&json, out);
    json_open_object(&json, NULL);
    json_uint(&json, "job", entry->job);
    json_open_object(&json, "made_with");
    json_string(&json, "program", entry->made.program);
    json_string(&json, "engine", entry->made.engine);
    json_string(&json, "configuration_sha256", entry->made.configuration);
    json_string(&json, "inputs_sha256", entry->made.inputs);
    json_string(&json, "job_sha256", entry->made.job);
    json_close_object(&json);
    json_uint(&json, "pulses", entry->pulses);
    json_uint(&json, "points", entry->points);
    json_string(&json, "stream_sha256", entry->stream_sha);
    json_double(&json, "seconds", entry->seconds);
    batch_put_files(&json, entry);
    json_close_object(&json);
    json_end(&json, NULL);
}

/* Returns 0, or the errno of the write that failed. One call writes all, so that no reader sees a part of the line,
 * except where the disk is full. After such a short write, the next one has the reason. */
static int write_line(int fd, const char *line, size_t len)
{
    for (size_t done = 0; done < len;) {
        const ssize_t n = write(fd, line + done, len - done);
        if (n < 0 && errno != EINTR) return errno;
        if (n > 0) done += (size_t)n;
    }
    return fsync(fd) == 0 ? 0 : errno;
}

int batch_manifest_add(int fd, const struct batch_entry *entry, struct sh_err *err)
{
    char *line = NULL;
    size_t len = 0;
    FILE *out = open_memstream(&line, &len);
    if (out == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a line of the manifest");
    put_entry(out, entry);
    int rc = fclose(out) == 0 ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for a line of the manifest");
    if (rc == SH_OK) {
        const off_t before = lseek(fd, 0, SEEK_END);
        const int error = write_line(fd, line, len);
        if (error != 0) {
            rc = sh_fail(err, SH_EIO, "the manifest: cannot write: %s", strerror(error));
            if (ftruncate(fd, before) != 0) sh_fail(err, SH_EIO, "the manifest: cannot write: %s", strerror(errno));
        }
    }
    free(line);
    return rc;
}
