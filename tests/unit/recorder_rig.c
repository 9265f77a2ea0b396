/* SPDX-License-Identifier: MIT */
#include "tests/unit/recorder_rig.h"

#include "tests/common/free_fd.h"

static char rig_dir[] = "/tmp/test_recorder_XXXXXX";

char rig_shs[64];

FILE *rig_stream;

char rig_notes[2048];
int (*rig_stop)(void *ctx);

static uint32_t rig_seq;

int64_t rig_scan_t0_ns;
uint32_t rig_sweep;

/* A frame without a number gets the next one. */
void rig_put(const uint8_t *frame, size_t len)
{
    uint8_t header[NATIVE_HEADER_LEN];
    assert_true(len >= sizeof header);
    memcpy(header, frame, sizeof header);
    if (le_get32(header + 8) == 0) native_finish_frame(header, rig_seq++);
    assert_int_equal(fwrite(header, 1, sizeof header, rig_stream), sizeof header);
    assert_int_equal(fwrite(frame + sizeof header, 1, len - sizeof header, rig_stream), len - sizeof header);
}

void rig_begin(void)
{
    rig_seq = 0;
    rig_scan_t0_ns = 0;
    rig_sweep = 0;
    rig_stream = fopen(rig_shs, "wb");
    assert_non_null(rig_stream);
}

void rig_descriptor(int geo, uint32_t scan)
{
    static uint8_t out[1024];
    struct native_descriptor d = {.idn = "Maker,<Model> & Co,SN1,1.0",
                                  .profile = "model",
                                  .scan = scan,
                                  .layout = geo ? NATIVE_GEO : NATIVE_POLAR,
                                  .prr_uhz = 1000000000,
                                  .mirror_counts_per_turn = 3600,
                                  .pan_counts_per_turn = 3600,
                                  .range_scale_m = 1e-3};
    rig_put(out, native_encode_descriptor(out, sizeof out, &d, 0, 0));
}

/* Heading 90 degrees: the head's y axis (forward) is the scene's x axis, its x axis (right) the scene's -y. */
static const double RIG_ROTATION[9] = {0, 1, 0, -1, 0, 0, 0, 0, 1};

struct native_anchor rig_anchor_of(uint32_t crs, uint32_t epsg, uint32_t station)
{
    struct native_anchor a = {.crs = crs,
                              .epsg = epsg,
                              .station = station,
                              .anchor = {500000.25, 5e6, 400.125},
                              .scale_m = 1e-3,
                              .lat_deg = 45,
                              .lon_deg = 9, /* the central meridian of zone 32: no convergence */
                              .height_m = 400.125,
                              .station_m = {10, 20, 30}};
    memcpy(a.rotation, RIG_ROTATION, sizeof a.rotation);
    return a;
}

void rig_anchor(const struct native_anchor *anchor)
{
    static uint8_t out[1024];
    rig_put(out, native_encode_anchor(out, sizeof out, anchor, 0, 0));
}

void rig_points(uint32_t line, uint64_t line_pulse0, uint64_t pulse0, const struct rig_point *p, uint32_t n)
{
    static uint8_t out[1 << 17], echo[RIG_MAX_POINTS];
    static uint32_t a[RIG_MAX_POINTS], b[RIG_MAX_POINTS], c[RIG_MAX_POINTS], dt[RIG_MAX_POINTS];
    static int16_t refl[RIG_MAX_POINTS];
    static uint16_t label[RIG_MAX_POINTS];
    uint32_t pulses = 0;
    for (uint32_t i = 0; i < n; i++) {
        if (p[i].echo <= 1) pulses++;
        a[i] = (uint32_t)p[i].a;
        b[i] = (uint32_t)p[i].b;
        c[i] = (uint32_t)p[i].c;
        dt[i] = (pulses - 1) % 16 * 1000000; /* 24 bits hold 16 ms */
        refl[i] = p[i].refl_cdb;
        label[i] = p[i].label;
        echo[i] = (uint8_t)(p[i].count << 4 | p[i].echo);
    }
    struct line_block block = {.frame = rig_sweep,
                               .line = line,
                               .pulse0 = pulse0,
                               .n_pulses = pulses,
                               .t0_ns = (int64_t)pulse0 * 1000000,
                               .line_t0_ns = (int64_t)line_pulse0 * 1000000,
                               .n_points = n,
                               .dt_ns = dt,
                               .a = a,
                               .b = b,
                               .c = c,
                               .refl_cdb = refl,
                               .echo = echo,
                               .label = label};
    rig_put(out, native_encode_points(out, sizeof out, &block, rig_scan_t0_ns));
}

static void rig_warn(void *ctx, const char *text)
{
    (void)ctx;
    size_t at = strlen(rig_notes);
    snprintf(rig_notes + at, sizeof rig_notes - at, "%s\n", text);
}

int rig_record(const char *path, struct recorder_options options, int keep, struct sh_err *err)
{
    const struct sh_report report = {.warn = rig_warn, .stop = rig_stop};
    struct scanhead *sh;
    struct scanhead_frame frame;
    struct recorder *rec;
    if (rig_stream != NULL) fclose(rig_stream);
    rig_stream = NULL;
    rig_notes[0] = 0;
    const int before = free_fd();
    options.report = &report;
    const struct recorder_ops *ops = recorder_find(path, err);
    assert_non_null(ops);
    ops = recorder_shape(ops, &options);
    assert_int_equal(scanhead_open(rig_shs, &sh, NULL, 0), 0);
    int rc = recorder_open(ops, path, &options, &rec, err);
    if (rc == 0) {
        while (rc == 0 && scanhead_next(sh, &frame, -1) == 0)
            rc = recorder_frame(rec, sh, &frame, err);
        int closed = recorder_close(rec, keep == RIG_KEEP_ALWAYS || (rc == 0 && keep), rc == 0 ? err : NULL);
        if (rc == 0) rc = closed;
    }
    scanhead_close(sh);
    assert_int_equal(free_fd(), before);
    return rc;
}

const char *rig_path(const char *name)
{
    static char path[4][128];
    static int turn;
    turn = (turn + 1) % 4;
    snprintf(path[turn], sizeof path[turn], "%s/%s", rig_dir, name);
    return path[turn];
}

uint8_t *rig_read(const char *path, size_t *len)
{
    FILE *in = fopen(path, "rb");
    assert_non_null(in);
    uint8_t *data = calloc(1, 1 << 22);
    const size_t n = fread(data, 1, (1 << 22) - 1, in);
    fclose(in);
    if (len != NULL) *len = n;
    return data;
}

void *rig_take(const char *name, size_t *len)
{
    uint8_t *file = rig_read(rig_path(name), len);
    assert_int_equal(unlink(rig_path(name)), 0);
    return file;
}

void *rig_record_bytes(const char *name, struct recorder_options options, size_t *len)
{
    struct sh_err err = {0};
    if (rig_record(rig_path(name), options, RIG_KEEP, &err) != SH_OK) fail_msg("%s", err.text);
    return rig_take(name, len);
}

int rig_count(const char *text, const char *what)
{
    int n = 0;
    for (; (text = strstr(text, what)) != NULL; text++)
        n++;
    return n;
}

uint64_t rig_uint(const uint8_t *p, int bytes)
{
    uint64_t v = 0;
    for (int i = bytes - 1; i >= 0; i--)
        v = v << 8 | p[i];
    return v;
}

int32_t rig_int32(const uint8_t *p)
{
    return (int32_t)(uint32_t)rig_uint(p, 4);
}

double rig_double(const uint8_t *p)
{
    uint64_t v = rig_uint(p, 8);
    double d;
    memcpy(&d, &v, 8);
    return d;
}

void rig_check_disk_full(const char *path, rlim_t size)
{
    struct sh_err err = {0};
    struct rlimit old, small;
    char part[160];
    void (*was)(int) = signal(SIGXFSZ, SIG_IGN);
    fclose(rig_stream);
    rig_stream = NULL;
    getrlimit(RLIMIT_FSIZE, &old);
    small = (struct rlimit){size, old.rlim_max};
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    int rc = rig_record(path, (struct recorder_options){0}, RIG_KEEP_ALWAYS, &err);
    setrlimit(RLIMIT_FSIZE, &old);
    signal(SIGXFSZ, was);
    snprintf(part, sizeof part, "%s.part", path);
    assert_int_equal(rc, SH_EIO);
    assert_non_null(strstr(err.text, path));
    assert_int_equal(access(path, F_OK), -1);
    rig_check_left(path);
}

void rig_check_left(const char *path)
{
    struct sh_err err = {0};
    struct repaired file;
    char part[160];
    snprintf(part, sizeof part, "%s.part", path);
    if (recorder_find(path, &err)->repair == NULL) {
        assert_int_equal(access(part, F_OK), -1);
        return;
    }
    assert_non_null(strstr(rig_notes, "--repair"));
    if (repair_file(path, NULL, &file, &err) != SH_OK) fail_msg("%s", err.text);
    assert_true(file.was_left);
    repair_free(&file);
    assert_int_equal(access(part, F_OK), -1);
    assert_int_equal(unlink(path), 0);
}

int rig_set_up(void **state)
{
    (void)state;
    if (mkdtemp(rig_dir) == NULL) return -1;
    snprintf(rig_shs, sizeof rig_shs, "%s/in.shs", rig_dir);
    return 0;
}

int rig_tear_down(void **state)
{
    (void)state;
    unlink(rig_shs);
    return rmdir(rig_dir);
}
