/* SPDX-License-Identifier: MIT */
#include "tests/unit/ply_rig.h"

char dir[] = "/tmp/test_ply_XXXXXX";

char shs_path[64], out_path[64], part_path[64];
uint8_t out[1 << 18];

FILE *shs;

const int32_t xyz[N][3] = {
    {300000, -400000, 1200000}, {-1, 1, 0}, {INT32_MAX, -INT32_MAX, 7}, {0, 0, 0}, {123456789, 5, -987654321}};

uint32_t a[N], b[N], c[N], dt[N] = {0, 1000, 2000, 3000, 0xffffff};

int16_t refl[N] = {-1234, INT16_MIN, 0, 5, 32767};

uint16_t label[N] = {0, 1, 40000, 0xffff, 1};

uint8_t echo[N] = {0x11, 0x21, 0x22, 0x00, 0xff};

static uint32_t next_seq;

void put(size_t len)
{
    assert_true(len > 0);
    if (le_get32(out + 8) == 0) native_finish_frame(out, next_seq++);
    assert_int_equal(fwrite(out, 1, len, shs), len);
}

void put_descriptor(int geo, uint32_t scan, uint32_t n_surfaces)
{
    struct native_descriptor d = {.idn = "Maker,Model,SN1,1.0",
                                  .profile = "model",
                                  .scan = scan,
                                  .n_surfaces = n_surfaces,
                                  .layout = geo ? NATIVE_GEO : NATIVE_POLAR,
                                  .mirror_counts_per_turn = 3600,
                                  .pan_counts_per_turn = 3600,
                                  .range_scale_m = 1e-3};
    put(native_encode_descriptor(out, sizeof out, &d, 0, 0));
}

void put_anchor(uint32_t crs, uint32_t epsg, uint32_t station)
{
    /* heading 90 degrees: the head's y axis (forward) is the scene's x axis */
    struct native_anchor anchor = {.crs = crs,
                                   .epsg = epsg,
                                   .station = station,
                                   .anchor = {500000.25, 5e6, 400.125},
                                   .scale_m = 1e-5,
                                   .station_m = {10, 20, 30},
                                   .rotation = {0, 1, 0, -1, 0, 0, 0, 0, 1}};
    put(native_encode_anchor(out, sizeof out, &anchor, 0, 0));
}

void put_points(uint64_t pulse0)
{
    struct line_block block = {.pulse0 = pulse0,
                               .n_pulses = N - 1,
                               .t0_ns = 5000000001,
                               .n_points = N,
                               .dt_ns = dt,
                               .a = a,
                               .b = b,
                               .c = c,
                               .refl_cdb = refl,
                               .echo = echo,
                               .label = label};
    put(native_encode_points(out, sizeof out, &block, 0));
}

static void name_of(void *ctx, uint32_t i, const char **object, const char **material)
{
    static const char *const names[3] = {"wall\nof brick", "door", "roof"};
    *object = ctx != NULL ? ctx : names[i];
    *material = "mat";
}

void put_surfaces(uint32_t first, uint32_t n, char *name)
{
    struct native_names labels = {first, n, name_of, name};
    put(native_encode_surfaces(out, sizeof out, 65536, &labels, 0));
    assert_int_equal(labels.n, 0);
}

void begin_stream(void)
{
    for (int i = 0; i < N; i++) {
        a[i] = (uint32_t)xyz[i][0];
        b[i] = (uint32_t)xyz[i][1];
        c[i] = (uint32_t)xyz[i][2];
    }
    next_seq = 0;
    shs = fopen(shs_path, "wb");
    assert_non_null(shs);
}

int record(const char *path, struct recorder_options options, int keep, struct sh_err *err)
{
    struct scanhead *sh;
    struct scanhead_frame frame;
    struct recorder *rec;
    if (shs != NULL) fclose(shs);
    shs = NULL;
    const struct recorder_ops *ops = recorder_find(path, err);
    assert_non_null(ops);
    assert_int_equal(scanhead_open(shs_path, &sh, NULL, 0), 0);
    int rc = recorder_open(ops, path, &options, &rec, err);
    if (rc == 0) {
        while (rc == 0 && scanhead_next(sh, &frame, -1) == 0)
            rc = recorder_frame(rec, sh, &frame, err);
        int closed = recorder_close(rec, rc == 0 && keep, err);
        if (rc == 0) rc = closed;
    }
    scanhead_close(sh);
    return rc;
}

char *text;
size_t text_len;

void slurp(const char *path)
{
    FILE *in = fopen(path, "rb");
    assert_non_null(in);
    free(text);
    text = calloc(1, 1 << 22);
    text_len = fread(text, 1, (1 << 22) - 1, in);
    fclose(in);
}

int set_up(void **state)
{
    (void)state;
    if (mkdtemp(dir) == NULL) return -1;
    snprintf(shs_path, sizeof shs_path, "%s/in.shs", dir);
    snprintf(out_path, sizeof out_path, "%s/out.ply", dir);
    snprintf(part_path, sizeof part_path, "%s/out.ply.part", dir);
    return 0;
}

int tear_down(void **state)
{
    (void)state;
    free(text);
    unlink(shs_path);
    unlink(out_path);
    return rmdir(dir);
}
