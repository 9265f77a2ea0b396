/* SPDX-License-Identifier: MIT */
/* Messages of recorders and repairs are compared whole, with their numbers. */
#include "drivers/record/outfile.h"
#include "drivers/record/repair.h"
#include "tests/unit/recorder_rig.h"

static const struct rig_point point = {1000, 2000, 3000, 0, 0, 1, 1};
static struct sh_err err;

static void put_scan(uint32_t scan, const struct native_anchor *a)
{
    rig_descriptor(1, scan);
    rig_anchor(a);
    rig_points(0, 0, 0, &point, 1);
}

/* Records the stream, which must be refused so. The file's path stands before `want`. */
static void expect_refusal(const char *name, const struct recorder_options *options, const char *want)
{
    char text[600], path[128];
    snprintf(path, sizeof path, "%s", rig_path(name));
    err = (struct sh_err){0};
    assert_int_not_equal(rig_record(path, *options, 0, &err), SH_OK);
    snprintf(text, sizeof text, "%s: %s", path, want);
    assert_string_equal(err.text, text);
}

static const struct recorder_options none;

/* A file holds one CRS, one kind of heights and one kind of head. */
static void test_streams_that_change(void **state)
{
    (void)state;
    const struct native_anchor first = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    static const struct {
        uint32_t epsg, heights, moving, station;
        const char *want;
    } rows[] = {
        {32633, 0, 0, 1, "the stream changed from EPSG 32632 to 32633; a file holds one CRS"},
        {32632, NATIVE_HEIGHTS_GEOID, 0, 1, "the stream changed to other heights (geoid); a file holds one kind"},
        {32632, 0, NATIVE_MOVING, 1, "the stream changed to a head that moves; a file holds one kind"},
        {32632, 0, NATIVE_STOP, 1, "the stream changed to a head that stops on a trajectory; a file holds one kind"},
        {32632, 0, 0, 65536, "station 65536; a file holds stations up to 65535"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct native_anchor a = first;
        a.epsg = rows[i].epsg;
        a.heights = rows[i].heights;
        a.moving = rows[i].moving;
        a.station = rows[i].station;
        rig_begin();
        put_scan(1, &first);
        put_scan(2, &a);
        expect_refusal("a.ply", &none, rows[i].want);
        if (rows[i].heights == 0 && rows[i].moving == 0) continue;
        rig_begin();
        put_scan(1, &a);
        put_scan(2, &first);
        expect_refusal("a.ply", &none,
                       rows[i].heights != 0 ? "the stream changed to other heights (ellipsoid); a file holds one kind"
                                            : "the stream changed to a head that stands still; a file holds one kind");
    }
}

/* Scales of 0, points beyond 32 bits, and poses that are no numbers. */
static void test_numbers(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    rig_begin();
    a.scale_m = 0;
    put_scan(1, &a);
    expect_refusal("a.e57", &none, "the stream's scale is 0 m; an E57 file needs one above 0");
    rig_begin();
    rig_begin();
    a.scale_m = 1e-3;
    memset(a.anchor, 0, sizeof a.anchor);
    memset(a.station_m, 0, sizeof a.station_m);
    memset(a.rotation, 0, sizeof a.rotation);
    a.rotation[0] = a.rotation[4] = a.rotation[8] = 1;
    a.scale[0] = a.scale[1] = a.scale[2] = 4000;
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, &(const struct rig_point){1000, -2000, 500, 0, 0, 1, 1}, 1);
    expect_refusal(
        "a.e57", &none,
        "a point at (4000000.000 -8000000.000 2000000.000) from the head is beyond the 2147484 m that 32 bits "
        "hold in steps of 0.001 m; give the head a coarser output.scale_m");
}

/* Formats with rows and columns, and heads that have none. */
static void test_heads_without_rows(void **state)
{
    (void)state;
    static uint8_t frame[512];
    static const struct recorder_options mesh = {.mesh = 1};
    static const struct native_beam beam;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    for (int i = 0; i < 2; i++) {
        const struct native_emitter e = {.kind = i == 0 ? NATIVE_EMIT_BEAMS : NATIVE_EMIT_DIRECTIONS,
                                         .n_beams = i == 0,
                                         .steps = (uint32_t)i,
                                         .turn = 1,
                                         .sequence_ns_num = 1000,
                                         .sequence_ns_den = 1};
        const size_t len = native_encode_emitter(frame, sizeof frame, &e, &beam, 0, 0);
        rig_begin();
        rig_descriptor(0, 1);
        rig_put(frame, len);
        rig_anchor(&a);
        rig_points(0, 0, 0, &point, 1);
        expect_refusal("a.ptx", &none,
                       i == 0
                           ? "a PTX grid has rows and columns, but this head fires beams in turn; allowed are .ply "
                             ".las .e57 .poses.csv .waves.csv .shs .pcapng"
                           : "a PTX grid has rows and columns, but this head fires along a list; allowed are .ply .las "
                             ".e57 .poses.csv .waves.csv .shs .pcapng");
        expect_refusal("a.ply", &mesh,
                       i == 0 ? "a mesh needs rows and columns, but this head fires beams in turn; allowed are .ply "
                                "(without --mesh and --sparse) .las .e57 .poses.csv .waves.csv .shs .pcapng"
                              : "a mesh needs rows and columns, but this head fires along a list; allowed are .ply "
                                "(without --mesh and --sparse) .las .e57 .poses.csv .waves.csv .shs .pcapng");
    }
}

static void write_file(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

enum { WARNING_LEN = 800 };

static void keep_warning(void *ctx, const char *text)
{
    snprintf(ctx, WARNING_LEN, "%s", text);
}

/* Names: an ending that nobody writes, a recording that was left, and files that a repair must not touch. */
static void test_names(void **state)
{
    (void)state;
    char path[128], part[140], want[800], got[WARNING_LEN];
    struct repaired file;
    snprintf(path, sizeof path, "%s", rig_path("a.ply"));
    snprintf(part, sizeof part, "%s.part", path);
    assert_null(recorder_find("a.txt", &err));
    assert_string_equal(err.text, "a.txt: no recorder has this ending; allowed are .ply .las .ptx .e57 .poses.csv "
                                  ".waves.csv .pcapng .shs .obj .gltf .glb .fbx");
    write_file(part, "seven b");
    assert_int_not_equal(outfile_check_left(part, path, &err), SH_OK);
    snprintf(
        want, sizeof want,
        "%s: an earlier recording left 7 bytes there; scanhead record --repair %s makes a complete file of them; or "
        "remove it",
        part, path);
    assert_string_equal(err.text, want);
    assert_int_equal(repair_file(path, NULL, &file, &err), SH_EFORMAT);
    snprintf(want, sizeof want, "%s: is not a PLY file of points, or too short to tell; it is unchanged", part);
    assert_string_equal(err.text, want);
    write_file(path, "another");
    assert_int_not_equal(outfile_check_left(part, path, &err), SH_OK); /* the command that it names has to do */
    snprintf(want, sizeof want,
             "%s: an earlier recording left 7 bytes there; scanhead record --repair %s makes a complete file of them; "
             "or remove it",
             part, part);
    assert_string_equal(err.text, want);
    outfile_say_left(path, &(struct sh_report){.ctx = got, .warn = keep_warning});
    snprintf(want, sizeof want,
             "%s keeps the data that reached the disk; scanhead record --repair %s makes a complete file of it", part,
             part);
    assert_string_equal(got, want);
    assert_int_equal(repair_file(part, NULL, &file, &err), SH_EFORMAT); /* and not SH_ESTATE */
    assert_int_equal(repair_file(path, NULL, &file, &err), SH_ESTATE);
    snprintf(want, sizeof want,
             "%s: both this file and %s exist; give %s to repair it (it keeps its name), or move %s away", path, part,
             part, path);
    assert_string_equal(err.text, want);
    unlink(path);
    unlink(part);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_streams_that_change),
        cmocka_unit_test(test_numbers),
        cmocka_unit_test(test_heads_without_rows),
        cmocka_unit_test(test_names),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
