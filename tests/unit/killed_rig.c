/* SPDX-License-Identifier: MIT */
#include "tests/unit/killed_rig.h"

#include <fcntl.h>
#include <sys/stat.h>

/* These functions replace the system's, as thousands of repairs would wait for the disk, and power never fails here. */
int fdatasync(int fd)
{
    return fd >= 0 ? 0 : -1;
}

int fsync(int fd)
{
    return fd >= 0 ? 0 : -1;
}

void killed_rig_record(const char *path, struct recorder_options options, void (*seen)(const char *path))
{
    struct sh_err err = {0};
    struct scanhead *sh;
    struct scanhead_frame frame;
    struct recorder *rec;
    if (rig_stream != NULL) fclose(rig_stream);
    rig_stream = NULL;
    assert_int_equal(scanhead_open(rig_shs, &sh, NULL, 0), 0);
    assert_int_equal(recorder_open(recorder_find(path, &err), path, &options, &rec, &err), 0);
    while (scanhead_next(sh, &frame, -1) == 0) {
        assert_int_equal(recorder_frame(rec, sh, &frame, &err), 0);
        assert_int_equal(recorder_save(rec, &err), 0);
        if (seen != NULL) seen(rec->file.part);
    }
    assert_int_equal(recorder_close(rec, 1, &err), 0);
    scanhead_close(sh);
}

void killed_rig_write(const char *path, const void *data, size_t len)
{
    unlink(path); /* after a file was truncated, some file systems write it to the disk at once */
    FILE *out = fopen(path, "wb");
    assert_non_null(out);
    assert_int_equal(fwrite(data, 1, len, out), len);
    fclose(out);
}

int killed_rig_repair(const char *path, struct repair *repair, struct sh_err *err)
{
    struct stat st;
    char name[160];
    const size_t len = strlen(path), part = len > 5 && strcmp(path + len - 5, ".part") == 0 ? 5 : 0;
    snprintf(name, sizeof name, "%.*s", (int)(len - part), path);
    *err = (struct sh_err){0};
    *repair = (struct repair){.fd = open(path, O_RDWR | O_CLOEXEC), .path = path};
    assert_true(repair->fd >= 0 && fstat(repair->fd, &st) == 0);
    repair->len = (uint64_t)st.st_size;
    int rc = recorder_find(name, err)->repair(repair, err);
    close(repair->fd);
    repair->fd = -1;
    return rc;
}
