/* SPDX-License-Identifier: MIT */
/* This fuzzes the native stream through the client library, with recorders behind it. The input is three bytes of
 * choices, then the stream, whose checksums are made right. Whatever comes, each recorder must make a file or say in a
 * line why it can't. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "drivers/record/recorder.h"
#include "tests/fuzz/rig.h"
#include "tests/fuzz/seal.h"

enum { MAX_STREAM = 1 << 15, MAX_RECORDERS = 3, SOME_POINTS = 64, MAX_CHECKS = 4 };

static const char *const names[] = {"out.ply", "out.las", "out.ptx",  "out.e57", "out.poses.csv", "out.pcapng",
                                    "out.shs", "out.obj", "out.gltf", "out.glb", "out.fbx",       "out.waves.csv"};
enum { N_NAMES = sizeof names / sizeof names[0] };

/* After MAX_CHECKS the recorder is told to stop, as by a user who gives up. From a damaged grid that is kilometres wide
 * --sparse makes millions of points. */
static int n_checks;

static int is_enough(void *ctx)
{
    (void)ctx;
    return ++n_checks > MAX_CHECKS;
}

struct output {
    struct recorder *rec;
    char path[600];
};

static struct recorder_options options_of(unsigned how)
{
    static struct sh_report report;
    report = fuzz_report;
    report.stop = is_enough;
    n_checks = 0;
    return (struct recorder_options){.ascii = how & 1,
                                     .empty_shots = how >> 1 & 1,
                                     .mesh = how >> 2 & 1,
                                     .las_minor = how & 8 ? 2 : 4,
                                     .las_wdp = how & 1,
                                     .scalar_names = how >> 4 & 1,
                                     .columns = how & 32 ? PLY_ALL | PLY_FLOAT : 0,
                                     .long_edge = how & 64 ? 2.0 : 0.0,
                                     .sparse_per_m2 = how & 128 ? 10.0 : 0.0,
                                     .sparse_seed = 7,
                                     .report = &report};
}

static void open_output(struct output *out, unsigned which, const struct recorder_options *options)
{
    struct sh_err err = {0};
    snprintf(out->path, sizeof out->path, "%s/%s", fuzz_folder(), names[which % N_NAMES]);
    const struct recorder_ops *ops = recorder_find(out->path, &err);
    fuzz_must(ops != NULL, "the format is known");
    if (recorder_open(recorder_shape(ops, options), out->path, options, &out->rec, &err) == SH_OK) return;
    fuzz_must_be_line(&err);
    out->rec = NULL;
}

static void close_output(struct output *out, int keep)
{
    struct sh_err err = {0};
    char part[640];
    if (out->rec != NULL && recorder_close(out->rec, keep, &err) != SH_OK && keep) fuzz_must_be_line(&err);
    snprintf(part, sizeof part, "%s.part", out->path);
    unlink(out->path);
    unlink(part);
    snprintf(part, sizeof part, "%s/out.wdp.part", fuzz_folder());
    unlink(part);
    snprintf(part, sizeof part, "%s/out.wdp", fuzz_folder());
    unlink(part);
}

/* Asks for everything else that a client may want of a frame and of the stream so far. */
static void ask(struct scanhead *sh, const struct scanhead_frame *frame)
{
    static struct scanhead_point point[SOME_POINTS];
    static struct scanhead_attribute attribute[SOME_POINTS];
    static struct scanhead_colour colour[SOME_POINTS];
    static struct scanhead_wave wave[SOME_POINTS];
    static struct scanhead_pose pose[4];
    static struct scanhead_emitter emitter;
    struct scanhead_info info;
    struct scanhead_line_end end;
    const char *object, *material;
    double seconds, scalar[SOME_POINTS];
    const int n = scanhead_points(sh, frame, 0, point, SOME_POINTS);
    fuzz_must(n <= SOME_POINTS, "no more points than asked for");
    if (n > 0) scanhead_to_scene(sh, point, (uint32_t)n, scalar);
    if (n > 0) scanhead_surface(sh, point[0].label, &object, &material);
    if (frame->n_points > SOME_POINTS) scanhead_points(sh, frame, frame->n_points - 1, point, SOME_POINTS);
    scanhead_attributes(sh, frame, 0, attribute, SOME_POINTS);
    scanhead_colours(sh, frame, 0, colour, SOME_POINTS);
    scanhead_deviations(sh, frame, 0, scalar, SOME_POINTS);
    const int windows = scanhead_waves(sh, frame, 0, wave, SOME_POINTS);
    for (int i = 0; i < windows; i++)
        scanhead_wave_signal(&wave[i], wave[i].n - 1);
    scanhead_waves_lost(sh, frame);
    scanhead_poses(sh, frame, 1, pose, 4);
    scanhead_line_end(sh, frame, &end);
    scanhead_get_info(sh, &info);
    scanhead_get_emitter(sh, &emitter);
    scanhead_pose(sh, frame->t_ns, pose);
    scanhead_gps_time(sh, frame->line_t0_ns, &seconds);
}

static void feed(struct scanhead *sh, struct output *out, unsigned n)
{
    struct scanhead_frame frame;
    struct sh_err err = {0};
    while (scanhead_next(sh, &frame, -1) == SCANHEAD_OK) {
        ask(sh, &frame);
        for (unsigned i = 0; i < n; i++) {
            if (out[i].rec == NULL || recorder_frame(out[i].rec, sh, &frame, &err) == SH_OK) continue;
            fuzz_must_be_line(&err);
            close_output(&out[i], 0);
            out[i].rec = NULL;
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t sealed[MAX_STREAM];
    static struct output out[MAX_RECORDERS];
    struct fuzz_bytes in = {data, size};
    const unsigned which = fuzz_u8(&in), how = fuzz_u8(&in), more = fuzz_u8(&in);
    const unsigned n = 1 + (more & 3) % MAX_RECORDERS;
    struct scanhead *sh;
    char why[256], hex[65];
    if (in.n > sizeof sealed) return 0;
    memcpy(sealed, in.p, in.n);
    if ((more & 4) == 0) fuzz_seal(sealed, in.n);
    const struct recorder_options options = options_of(how);
    if (scanhead_open(fuzz_file(".shs", sealed, in.n), &sh, why, sizeof why) != SCANHEAD_OK) return 0;
    scanhead_hash_start(sh);
    for (unsigned i = 0; i < n; i++)
        open_output(&out[i], which + i, &options);
    feed(sh, out, n);
    for (unsigned i = 0; i < n; i++)
        close_output(&out[i], (more & 8) == 0);
    scanhead_hash_hex(sh, hex);
    fuzz_must(strlen(hex) == 64, "the hash has 64 digits");
    scanhead_close(sh);
    return 0;
}
