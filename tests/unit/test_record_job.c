/* SPDX-License-Identifier: MIT */
/* `record` refuses a configuration that it can't record before the scene is loaded, with the file and what is allowed.
 * The command leaves all else as it is. */
#include "firmware_sim/app/studio/record/job.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/config/config.h"

static struct config *cfg;
static struct record_job *job;
static struct sh_err err;

/* A head that scans lines and pans, of one frame. */
static int make(void **state)
{
    (void)state;
    cfg = calloc(1, sizeof *cfg);
    job = calloc(1, sizeof *job);
    if (cfg == NULL || job == NULL) return -1;
    strcpy(cfg->file, "c.yaml");
    cfg->profile.emitter.kind = EMITTER_LINE;
    cfg->head.settings.frames = 1;
    cfg->head.settings.pan_udeg_s = 1000000;
    cfg->head.settings.pan_stop_udeg = 360000000;
    cfg->output.layout = LINE_GEO;
    cfg->output.crs = GEOREF_LOCAL;
    job->recording.frames = -1;
    return 0;
}

static int end(void **state)
{
    (void)state;
    free(cfg);
    free(job);
    return 0;
}

static void files(const char *const *paths)
{
    job->files.n = 0;
    for (; *paths != NULL; paths++)
        if (record_files_add(&job->files, *paths, &err) != SH_OK) fail_msg("%s", err.text);
    record_files_shape(&job->files);
}

#define FILES(...) files((const char *const[]){__VA_ARGS__, NULL})

static void accepts(void)
{
    if (record_job_check(job, cfg, &err) != SH_OK) fail_msg("%s", err.text);
}

static void refuses(const char *why)
{
    assert_int_equal(record_job_check(job, cfg, &err), SH_EINPUT);
    assert_string_equal(err.text, why);
}

static void a_scan_must_end(void **state)
{
    (void)state;
    static const char endless[] = "c.yaml: head.frames is 0, a scan without end; give --frames or --duration";
    FILES("a.ply");
    accepts();
    cfg->head.settings.frames = 0;
    refuses(endless);
    job->recording.frames = 0;
    cfg->head.settings.frames = 1;
    refuses(endless);
    job->recording.frames = 1;
    cfg->head.settings.frames = 0;
    accepts();
    job->recording.frames = -1;
    job->recording.duration_s = 0.1;
    accepts();
    job->recording.duration_s = 0;
    cfg->platform.kind = PLATFORM_TRAJECTORY;
    cfg->platform.at_end = PLATFORM_STOP; /* the path has an end */
    accepts();
    cfg->head.settings.frames = 1;
    cfg->platform.kind = PLATFORM_LIVE;
    refuses("c.yaml: platform.kind: a live platform can't be recorded off line; use scanhead run, and record its link");
}

static void a_crs_needs_points_in_it(void **state)
{
    (void)state;
    FILES("a.ply");
    cfg->output.layout = LINE_POLAR;
    accepts();
    assert_int_equal(cfg->output.layout, LINE_POLAR);
    job->crs_given = 1;
    accepts();
    assert_int_equal(cfg->output.layout, LINE_GEO);
    cfg->output.layout = LINE_POLAR;
    cfg->output.layout_given = 1;
    refuses("c.yaml: output.layout is polar, and polar recordings are in the scene frame; --crs needs geo: --set "
            "output.layout=geo");
}

/* Colours of the configuration without limits get those of the recording. Colours of a texture come from the head. */
static void whose_colours(void **state)
{
    struct colour_choice *c = &job->files.recorder.colour;
    (void)state;
    FILES("a.ply");
    accepts();
    assert_true(c->given == 0 && job->files.own_limits == 0 && cfg->output.colour == COLOUR_NONE);
    cfg->output.colour = COLOUR_RANGE;
    accepts();
    assert_true(c->given == 1 && c->scale.mode == COLOUR_RANGE && job->files.own_limits == 1);
    *c = (struct colour_choice){0};
    job->files.own_limits = 0;
    cfg->output.colour_limited = 1;
    accepts();
    assert_int_equal(c->given, 0);
    cfg->output.colour_limited = 0;
    job->texture = 1;
    accepts();
    assert_true(c->given == 0 && cfg->output.colour == COLOUR_TEXTURE);
    job->texture = 0;
    cfg->output.colour = COLOUR_LABEL; /* it has no limits */
    accepts();
    assert_int_equal(c->given, 0);
    cfg->platform.kind = PLATFORM_TRAJECTORY; /* ranges of a head that moves are not in geo points */
    cfg->output.colour = COLOUR_RANGE;
    accepts();
    assert_int_equal(c->given, 0);
}

static void colours_that_points_do_not_have(void **state)
{
    struct colour_choice *c = &job->files.recorder.colour;
    (void)state;
    FILES("a.ply");
    *c = (struct colour_choice){.given = 1, .scale.mode = COLOUR_FRAME};
    refuses("c.yaml: --colour frame, but points have no frame scalar; it needs platform.kind trajectory or stops");
    cfg->platform.kind = PLATFORM_STOPS;
    accepts();
    cfg->platform.kind = PLATFORM_TRAJECTORY;
    accepts();
    c->scale.mode = COLOUR_RANGE;
    refuses("c.yaml: --colour range, but points of a moving head do not have it in output.layout geo; allowed "
            "output.colour with limits, or output.layout: polar");
    cfg->output.layout = LINE_POLAR;
    accepts();
    cfg->output.layout = LINE_GEO;
    c->scale.mode = COLOUR_HEIGHT;
    accepts();
    cfg->output.crs = GEOREF_ECEF;
    refuses(
        "c.yaml: --colour height, but points of a moving head do not have it in output.layout geo and ECEF; allowed "
        "output.colour with limits, or output.layout: polar");
    cfg->platform.kind = PLATFORM_STATIC;
    accepts();
}

static void formats_that_hold_metres_or_floats(void **state)
{
    (void)state;
    cfg->output.crs = GEOREF_GEODETIC;
    FILES("a.ply", "a.las");
    accepts();
    FILES("a.las", "a.ptx");
    refuses(
        "record: -o a.ptx: this format holds metres, and output.crs is geodetic; allowed local, ecef, utm, or .las, "
        ".ply");
    cfg->output.layout = LINE_POLAR; /* these are in the scene's frame */
    accepts();
    cfg->output.layout = LINE_GEO;
    cfg->output.crs = GEOREF_UTM;
    accepts();
    FILES("a.obj"); /* text */
    accepts();
    FILES("a.obj", "b.gltf");
    refuses(
        "record: -o b.gltf: .gltf holds coordinates as float, which are up to 0.5 m apart at the millions of metres "
        "of utm and ecef; allowed --crs local, or .ply, .obj");
    cfg->output.crs = GEOREF_LOCAL;
    accepts();
}

static void meshes_need_a_surface(void **state)
{
    static const char line[] =
        "record: -o a.obj: a mesh needs a surface, but this head scans a single line: it neither "
        "pans nor moves, and has one ring; allowed are .ply (without --mesh and --sparse) .las "
        ".ptx .e57 .poses.csv .waves.csv .shs .pcapng";
    (void)state;
    FILES("a.ply", "a.obj");
    accepts();
    cfg->head.settings.pan_udeg_s = 0;
    refuses(line);
    cfg->head.settings.pan_udeg_s = 1000000;
    cfg->head.settings.pan_start_udeg = 360000000; /* the range of the pan is empty: one line (core/schedule.h) */
    refuses(line);
    cfg->platform.kind = PLATFORM_TRAJECTORY; /* it moves */
    accepts();
    cfg->output.crs = GEOREF_UTM;
    refuses("record: -o a.obj: a mesh faces the head, but the places of a moving head are known only in the scene's "
            "frame; allowed output.crs: local, or output.layout: polar");
    cfg->output.crs = GEOREF_LOCAL;
    cfg->platform.kind = PLATFORM_STATIC;
    cfg->profile.emitter.kind = EMITTER_SPHERE;
    cfg->profile.emitter.rings = 2;
    accepts();
    cfg->profile.emitter.rings = 1;
    refuses(line);
    cfg->profile.emitter.kind = EMITTER_PLANAR;
    refuses(line);
    FILES("a.ply", "a.ptx");
    accepts();
    cfg->profile.emitter.kind = EMITTER_BEAMS;
    refuses("record: -o a.ptx: a grid has rows and columns, but this head fires beams in turn; allowed are .ply .las "
            ".e57 .poses.csv .waves.csv .shs .pcapng");
    cfg->profile.emitter.kind = EMITTER_DIRECTIONS;
    refuses(
        "record: -o a.ptx: a grid has rows and columns, but this head fires along a list; allowed are .ply .las .e57 "
        ".poses.csv .waves.csv .shs .pcapng");
    FILES("a.ply", "a.las", "a.e57", "a.shs");
    accepts();
}

/* ---- the list of files */

static void a_list_of_files(void **state)
{
    (void)state;
    FILES("a.ply", "a.las");
    assert_true(record_files_have(&job->files, ".ply") && record_files_have(&job->files, ".las"));
    assert_false(record_files_have(&job->files, ".e57") || record_files_have_meshes(&job->files));
    assert_int_equal(record_files_check_each(&job->files, &err), SH_OK);
    assert_int_equal(record_files_add(&job->files, "a.ply", &err), SH_EINPUT); /* the first one again */
    assert_string_equal(err.text, "record: -o a.ply: given twice");
    FILES("a-2.ply", "b.las", "a.ply");
    assert_int_equal(record_files_check_each(&job->files, &err), SH_EINPUT);
    assert_string_equal(
        err.text, "-o a-2.ply: with --each the file of one scan of a.ply has that name; allowed is any other name");
    FILES("a.shs");
    assert_int_equal(record_files_have_colours(&job->files), 0);
    assert_int_equal(record_files_check_heads(&job->files, &err), SH_EINPUT);
    assert_string_equal(err.text, "record: -o a.shs: the file is the stream of one head, but the stations have several "
                                  "scanners; allowed with --split, or with --station N");
    job->files.split = 1;
    assert_int_equal(record_files_check_heads(&job->files, &err), SH_OK);
    FILES("a.ply");
    job->files.recorder.columns = PLY_RANGE;
    assert_int_equal(record_files_have_colours(&job->files), 0);
    job->files.recorder.columns = PLY_RANGE | PLY_COLOUR;
    assert_int_equal(record_files_have_colours(&job->files), 1);
    job->files.recorder.columns = 0;
    assert_int_equal(record_files_have_colours(&job->files), 1);
    FILES("a.ply", "b.las"); /* columns are those of .ply */
    job->files.recorder.columns = PLY_RANGE;
    assert_int_equal(record_files_have_colours(&job->files), 1);
    FILES("m.obj");
    assert_int_equal(record_files_have_meshes(&job->files), 1);
    FILES("1.ply", "2.ply", "3.ply", "4.ply", "5.ply", "6.ply", "7.ply", "8.ply");
    assert_int_equal(record_files_add(&job->files, "9.ply", &err), SH_EINPUT);
    assert_string_equal(err.text, "record: at most 8 files");
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, make, end)
    const struct CMUnitTest tests[] = {
        TEST(a_scan_must_end),
        TEST(a_crs_needs_points_in_it),
        TEST(whose_colours),
        TEST(colours_that_points_do_not_have),
        TEST(formats_that_hold_metres_or_floats),
        TEST(meshes_need_a_surface),
        TEST(a_list_of_files),
    };
    return cmocka_run_group_tests_name("record job", tests, NULL, NULL);
}
