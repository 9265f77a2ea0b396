/* SPDX-License-Identifier: MIT */
#include "tests/unit/record_files_rig.h"

#include "core/newfile.h"
#include "core/studio/mesh.h"
#include "drivers/record/outfile.h"
#include "firmware_sim/app/app.h"

struct record_files files;
struct sh_err err;
char warned[1024];
const char *left;
int spool_rc;
static int n_spools;
double lows[4], highs[4];

static int is_repaired(struct repair *repair, struct sh_err *e)
{
    (void)repair;
    (void)e;
    return SH_OK;
}

static const struct recorder_ops OPS[] = {{.ending = ".ply", .track = {.wants_colours = 1}, .repair = is_repaired},
                                          {.ending = ".shs", .repair = is_repaired},
                                          {.ending = ".obj"},
                                          {.ending = ".las", .repair = is_repaired},
                                          {.ending = ".ptx", .repair = is_repaired}};

const struct recorder_ops *recorder_find(const char *path, struct sh_err *e)
{
    for (size_t i = 0; i < sizeof OPS / sizeof OPS[0]; i++)
        if (strcmp(strrchr(path, '.'), OPS[i].ending) == 0) return &OPS[i];
    sh_fail(e, SH_EINPUT, "unknown");
    return NULL;
}

const struct recorder_ops *recorder_shape(const struct recorder_ops *ops, const struct recorder_options *options)
{
    (void)options;
    return ops;
}

int recorder_open(const struct recorder_ops *ops, const char *path, const struct recorder_options *options,
                  struct recorder **rec, struct sh_err *e)
{
    for (int i = 0; i < files.n; i++)
        if (files.file[i].now == path) *rec = (struct recorder *)&files.file[i];
    if (options != &files.recorder || options->padding != &files.padding) say("OPTIONS ");
    if (strstr(path, ops->ending) == NULL) say("OPS ");
    const int rc = call(e, "open:%s", path);
    if (rc != SH_OK) *rec = NULL;
    return rc;
}

/* Returns the place of a file in the list. */
static int of(const struct recorder *rec)
{
    return (int)((const struct record_file *)(const void *)rec - files.file);
}

void recorder_set_limits(struct recorder *rec, double low, double high)
{
    say("limits%d:%g-%g ", of(rec), low, high);
}

int recorder_frame(struct recorder *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *e)
{
    (void)sh;
    return call(e, "%d<%u", of(rec), frame->seq);
}

int recorder_save(struct recorder *rec, struct sh_err *e)
{
    return call(e, "save%d", of(rec));
}

void recorder_set_failed(struct recorder *rec)
{
    say("failed%d ", of(rec));
}

int recorder_close(struct recorder *rec, int keep, struct sh_err *e)
{
    return call(e, "%s%d", keep ? "keep" : "drop", of(rec));
}

int colour_spool_open(struct colour_spool *spool, const char *path, enum colour_mode mode, struct sh_err *e)
{
    if (mode != COLOUR_RANGE) say("MODE ");
    spool->bytes = (uint64_t)n_spools++;
    spool->low = lows[spool->bytes];
    spool->high = highs[spool->bytes];
    spool->has_points = spool->low < spool->high;
    return call(e, "spool:%s", path);
}

int colour_spool_frame(struct colour_spool *spool, struct scanhead *sh, const struct scanhead_frame *frame,
                       struct sh_err *e)
{
    (void)sh;
    return call(e, "s%u<%u", (unsigned)spool->bytes, frame->seq);
}

int colour_spool_drain(struct colour_spool *spool,
                       int (*fn)(void *ctx, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *e),
                       void *ctx, const struct sh_report *report, struct sh_err *e)
{
    const struct scanhead_frame frame = {.seq = 90 + (uint32_t)spool->bytes};
    if (report != files.recorder.report) say("REPORT ");
    const int rc = call(e, "drain%u", (unsigned)spool->bytes);
    return rc == SH_OK ? fn(ctx, NULL, &frame, e) : rc;
}

int colour_spool_keep(struct colour_spool *spool, const char *path, struct sh_err *e)
{
    return call(e, "frames%u:%s", (unsigned)spool->bytes, path) == SH_OK ? SH_OK : spool_rc;
}

void colour_spool_close(struct colour_spool *spool)
{
    say("close_spool%u ", (unsigned)spool->bytes);
}

void outfile_say_left(const char *path, const struct sh_report *report)
{
    if (report != files.recorder.report) say("REPORT ");
    say("left:%s ", path);
}

int outfile_check_left(const char *part, const char *path, struct sh_err *e)
{
    return call(e, "part:%s:%s", part, path);
}

/* Returns whether the path is a name of one scan: that of all scans with -NUMBER before its ending. */
int app_is_name_of_scan(const char *of_all, size_t ending, const char *path)
{
    const size_t stem = strlen(of_all) - ending;
    const size_t digits =
        strncmp(path, of_all, stem) == 0 && path[stem] == '-' ? strspn(path + stem + 1, "0123456789") : 0;
    return digits != 0 && strcmp(path + stem + 1 + digits, of_all + stem) == 0;
}

int mesh_is_float(const char *path)
{
    (void)path;
    return 0;
}

long long newfile_left_len(const char *part)
{
    say("second:%s ", part);
    return left != NULL && strcmp(part, left) == 0 ? 12 : 0;
}

static void warn(void *ctx, const char *text)
{
    (void)ctx;
    const size_t n = strlen(warned);
    snprintf(warned + n, sizeof warned - n, "%s\n", text);
}

static const struct sh_report REPORT = {.warn = warn};

int make(void **state)
{
    (void)state;
    memset(&files, 0, sizeof files);
    files.recorder.report = &REPORT;
    files.recorder.colour.scale.mode = COLOUR_RANGE;
    files.takes_over = 1;
    trace[0] = warned[0] = '\0';
    fails = fails_too = left = NULL;
    n_spools = 0;
    return 0;
}

void add(const char *path)
{
    assert_int_equal(record_files_add(&files, path, &err), SH_OK);
}

void expect(const char *expected)
{
    assert_string_equal(trace, expected);
    trace[0] = '\0';
}

int frame(int head, uint32_t seq, int type, uint32_t event, int flags)
{
    const struct scanhead_frame it = {.type = type, .seq = seq, .event = event, .flags = flags};
    return record_files_frame(&files, (struct scanhead *)(trace + head), &it, &err);
}

void points(int head, uint32_t seq)
{
    assert_int_equal(frame(head, seq, SCANHEAD_POINTS, 0, 0), SH_OK);
}

void open_all(void)
{
    assert_int_equal(record_files_open(&files, &err), SH_OK);
}

void close_all(int keep, int rc)
{
    assert_int_equal(record_files_close(&files, keep, &err), rc);
    for (int i = 0; i < files.n; i++)
        assert_true(files.file[i].now == NULL && files.file[i].rec == NULL);
    assert_true(files.spool == NULL && files.n_spools == 0);
}
