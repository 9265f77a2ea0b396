/* SPDX-License-Identifier: MIT */
#include "tests/unit/repair_rig.h"

#include <sys/stat.h>

/* ---- replacements of libc's: thousands of small files need not reach a disk */

void (*repair_at_sync)(int fd);

int fsync(int fd)
{
    if (repair_at_sync != NULL) repair_at_sync(fd);
    return 0;
}

/* ---- files that a killed recorder leaves */

const struct repair_format repair_formats[REPAIR_FORMATS] = {
    {"a.shs", {0}, 0},          {"a.pcapng", {0}, 0},
    {"a.ply", {0}, 0},          {"b.ply", {.columns = PLY_XYZ | PLY_FLOAT}, 0},
    {"c.ply", {.ascii = 1}, 1}, {"d.ply", {.colour = {.given = 1, .scale.mode = COLOUR_LABEL}, .scalar_names = 1}, 0},
    {"a.las", {0}, 0},          {"b.las", {.las_minor = 2, .colour = {.given = 1, .scale.mode = COLOUR_LABEL}}, 0},
    {"a.poses.csv", {0}, 1},
};

struct bytes repair_left[REPAIR_FORMATS], repair_whole[REPAIR_FORMATS];
struct sh_err repair_err;
char repair_path[160], repair_part[168];

struct bytes repair_slurp(const char *path)
{
    struct stat st;
    FILE *in = fopen(path, "rb");
    assert_non_null(in);
    assert_int_equal(fstat(fileno(in), &st), 0);
    struct bytes b = {calloc(1, (size_t)st.st_size + 1), (size_t)st.st_size};
    assert_int_equal(fread(b.data, 1, b.len, in), b.len);
    fclose(in);
    return b;
}

static void put_scan(uint32_t scan)
{
    static const struct rig_point p[] = {
        {100, 200, 300, -1000, 1, 1, 1}, {-100, 5, 6, -2000, 2, 1, 2}, {-90, 6, 7, 30, 2, 2, 2}};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, scan);
    memset(a.anchor, 0, sizeof a.anchor);
    rig_descriptor(1, scan);
    rig_anchor(&a);
    for (uint32_t i = 0; i < REPAIR_POINTS / 6; i++)
        rig_points(i, 2 * i, 2 * i, p, 3);
}

/* Writes two scans with 12 points. */
static void put_stream(void)
{
    rig_begin();
    put_scan(1);
    put_scan(2);
    fclose(rig_stream);
    rig_stream = NULL;
}

/* Returns the disk's contents when all frames have come, and the end has not. */
static struct bytes leave(const struct repair_format *f)
{
    struct scanhead *sh;
    struct scanhead_frame frame;
    struct recorder *rec;
    char path[160];
    snprintf(path, sizeof path, "%s", rig_path(f->name));
    assert_int_equal(scanhead_open(rig_shs, &sh, NULL, 0), 0);
    assert_int_equal(recorder_open(recorder_find(path, &repair_err), path, &f->options, &rec, &repair_err), 0);
    while (scanhead_next(sh, &frame, -1) == 0)
        if (recorder_frame(rec, sh, &frame, &repair_err) != 0) fail_msg("%s", repair_err.text);
    assert_int_equal(recorder_save(rec, &repair_err), 0);
    snprintf(path + strlen(path), 8, ".part");
    struct bytes b = repair_slurp(path);
    assert_int_equal(recorder_close(rec, 0, &repair_err), 0);
    scanhead_close(sh);
    return b;
}

int repair_set_up(void **state)
{
    if (rig_set_up(state) != 0) return -1;
    put_stream();
    for (int i = 0; i < REPAIR_FORMATS; i++) {
        repair_left[i] = leave(&repair_formats[i]);
        const char *path = rig_path(repair_formats[i].name);
        assert_int_equal(rig_record(path, repair_formats[i].options, RIG_KEEP, &repair_err), 0);
        repair_whole[i] = repair_slurp(path);
        unlink(path);
    }
    return 0;
}

int repair_tear_down(void **state)
{
    for (int i = 0; i < REPAIR_FORMATS; i++) {
        free(repair_left[i].data);
        free(repair_whole[i].data);
    }
    return rig_tear_down(state);
}

void repair_name(const char *file)
{
    snprintf(repair_path, sizeof repair_path, "%s", rig_path(file));
    snprintf(repair_part, sizeof repair_part, "%s.part", repair_path);
}

void repair_write_file(const char *to, const void *data, size_t len)
{
    FILE *out = fopen(to, "wb");
    assert_non_null(out);
    assert_int_equal(fwrite(data, 1, len, out), len);
    fclose(out);
}
