/* SPDX-License-Identifier: MIT */
#include "tests/unit/las_packets_rig.h"

struct bytes left, left_wdp, whole;
char wdp[168], wdp_part[176];

/* At the end of a line its points are written. */
static void put_line_end(uint32_t line)
{
    static uint8_t out[256];
    const struct line_end end = {.line = line, .pulse0 = line * N, .n_fired = N, .n_cast = N, .n_echoes = N};
    rig_put(out, native_encode_line_end(out, sizeof out, &end, 0));
}

void packets_put_stream(uint32_t lines, uint16_t n_samples)
{
    static struct rig_point p[N];
    static struct rig_window w[N];
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    for (uint32_t i = 0; i < N; i++) {
        p[i] = (struct rig_point){5000, 0, 0, 0, 1, 1, 1};
        w[i] = (struct rig_window){i, 28, n_samples, {0, 0, 0}};
    }
    rig_begin();
    rig_wave_descriptor(0, 1, 4);
    rig_anchor(&a);
    for (uint32_t line = 0; line < lines; line++) {
        /* Another digitiser needs a new descriptor: the header is written again while points come. */
        struct rig_digitiser d = rig_12_bits;
        if (line > 0) d.baseline_16++;
        rig_points(line, line * N, line * N, p, N);
        rig_waves(line, line * N, &d, w, N);
        put_line_end(line);
    }
}

size_t packets_front_of(const struct bytes *b)
{
    return (size_t)rig_uint(b->data + 96, 4);
}

size_t packets_len_of(const char *path)
{
    struct stat st;
    assert_int_equal(stat(path, &st), 0);
    return (size_t)st.st_size;
}

/* All frames have come, and are on the disk; the end has not. */
static void leave(void)
{
    struct scanhead *sh;
    struct scanhead_frame frame;
    struct recorder *rec;
    const struct recorder_options options = {0};
    fclose(rig_stream);
    rig_stream = NULL;
    assert_int_equal(scanhead_open(rig_shs, &sh, NULL, 0), 0);
    assert_int_equal(recorder_open(recorder_find(repair_path, &repair_err), repair_path, &options, &rec, &repair_err),
                     0);
    while (scanhead_next(sh, &frame, -1) == 0)
        if (recorder_frame(rec, sh, &frame, &repair_err) != 0) fail_msg("%s", repair_err.text);
    for (int i = 0; i < 2; i++) /* the second call finds that nothing was written since the first */
        assert_int_equal(recorder_save(rec, &repair_err), 0);
    left = repair_slurp(repair_part);
    left_wdp = repair_slurp(wdp_part);
    assert_int_equal(recorder_close(rec, 0, &repair_err), 0);
    scanhead_close(sh);
    assert_int_equal(access(wdp_part, F_OK), -1);
}

int packets_set_up(void **state)
{
    if (rig_set_up(state) != 0) return -1;
    repair_name("a.las");
    snprintf(wdp, sizeof wdp, "%s", rig_path("a.wdp"));
    snprintf(wdp_part, sizeof wdp_part, "%s.part", wdp);
    packets_put_stream(2, N_SAMPLES);
    leave();
    packets_put_stream(2, N_SAMPLES);
    assert_int_equal(rig_record(repair_path, (struct recorder_options){0}, RIG_KEEP, &repair_err), 0);
    whole = repair_slurp(repair_path);
    unlink(repair_path);
    return 0;
}

int packets_tear_down(void **state)
{
    free(left.data);
    free(left_wdp.data);
    free(whole.data);
    return rig_tear_down(state);
}
