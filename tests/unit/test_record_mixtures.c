/* SPDX-License-Identifier: MIT */
/* Streams that change: the part that one file can hold, and its notes; rows and grids of heads that are no line heads.
 */
#include "drivers/record/mesh_grid.h"
#include "tests/unit/e57_rig.h"

static const struct rig_point one = {3000, -4000, 12000, -1234, 7, 1, 1};
static uint8_t out[8192];

static struct native_descriptor descriptor(const char *idn, const char *profile, uint32_t scan)
{
    struct native_descriptor d = {.scan = scan,
                                  .layout = NATIVE_GEO,
                                  .frames = 1,
                                  .prr_uhz = 1000000000,
                                  .lines_uhz = 100000000,
                                  .line_stop_udeg = 90000000,
                                  .sweep_udeg = 90000000};
    snprintf(d.idn, sizeof d.idn, "%s", idn);
    snprintf(d.profile, sizeof d.profile, "%s", profile);
    return d;
}

static void put_scan(const char *idn, const char *profile, uint32_t scan, const struct native_anchor *a)
{
    const struct native_descriptor d = descriptor(idn, profile, scan);
    rig_put(out, native_encode_descriptor(out, sizeof out, &d, 0, 0));
    rig_anchor(a);
    rig_points(0, 0, 0, &one, 1);
}

static int record(const char *name, struct recorder_options options, struct sh_err *err)
{
    return rig_record(rig_path(name), options, 1, err);
}

/* The names of two heads of one model are kept apart. For two models LAS has MERGE. */
static void test_several_heads(void **state)
{
    (void)state;
    const struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1), b = rig_anchor_of(NATIVE_CRS_UTM, 32632, 2);
    rig_begin();
    put_scan("Maker,Model,SN1,1", "model", 1, &a);
    put_scan("Maker,Model,SN2,1", "model", 1, &b);
    char *text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1, .n_heads = 2}, NULL);
    assert_non_null(strstr(text, "comment station 1 idn Maker,Model,SN1,1\n"));
    assert_non_null(strstr(text, "comment station 2 idn Maker,Model,SN2,1\n"));
    const char *end = strstr(text, "end_header\n");
    char *single = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1, .n_heads = 1}, NULL);
    /* Room was left for two lines of the second head, whose names may have 95 and 31 bytes. */
    assert_true(end - text - (strstr(single, "end_header\n") - single) >=
                (int)sizeof "comment station 2 idn \ncomment station 2 profile \n" - 1 + 95 + 31);
    free(single);
    free(text);
    for (int other = 0; other < 2; other++) {
        rig_begin();
        put_scan("Maker,Model,SN1,1", "model", 1, &a);
        put_scan("Maker,Model,SN2,1", other ? "other" : "model", 1, &b);
        text = rig_record_bytes("a.las", (struct recorder_options){0}, NULL);
        assert_string_equal(text + 26, other ? "MERGE" : "model");
        free(text);
    }
}

/* Names of a stream can't end their line. While more may come, the header says that the end is missing. */
static void test_header_of_part(void **state)
{
    (void)state;
    const struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1), b = rig_anchor_of(NATIVE_CRS_UTM, 32632, 2);
    const char *path = rig_path("a.ply");
    char part[160];
    struct scanhead *sh;
    struct scanhead_frame frame;
    struct recorder *rec;
    struct sh_err err = {0};
    rig_begin();
    put_scan("Maker,Model\nend_header,SN1,1", "mo\ndel", 1, &a);
    put_scan("Maker,Model,SN2,1", "model", 1, &b);
    fclose(rig_stream);
    rig_stream = NULL;
    snprintf(part, sizeof part, "%s.part", path);
    assert_int_equal(
        recorder_open(recorder_find(path, &err), path, &(struct recorder_options){.n_heads = 2}, &rec, &err), 0);
    assert_int_equal(scanhead_open(rig_shs, &sh, NULL, 0), 0);
    while (scanhead_next(sh, &frame, -1) == 0)
        assert_int_equal(recorder_frame(rec, sh, &frame, &err), 0);
    assert_int_equal(recorder_save(rec, &err), 0);
    char *text = (char *)rig_read(part, NULL);
    assert_non_null(strstr(text, "comment incomplete: its end is missing, and losses were not counted\n"));
    assert_non_null(strstr(text, "comment station 1 idn Maker,Model?end_header,SN1,1\n"));
    assert_non_null(strstr(text, "comment station 1 profile mo?del\n"));
    assert_non_null(strstr(text, "comment station 2 idn Maker,Model,SN2,1\n"));
    free(text);
    assert_int_equal(recorder_close(rec, 0, &err), 0);
    scanhead_close(sh);
    unlink(part);
}

/* Two heads take turns at 130 stations. The header names 128 of these turns, and a note counts the others. */
static void test_many_heads(void **state)
{
    (void)state;
    rig_begin();
    for (uint32_t i = 1; i <= 130; i++) {
        const struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, i);
        put_scan(i % 2 == 0 ? "Maker,Model,SN1,1" : "Maker,Model,SN2,1", "model", 1, &a);
    }
    char *text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1, .n_heads = 130}, NULL);
    assert_int_equal(rig_count(text, " idn "), 128);
    assert_non_null(strstr(rig_notes, "a.ply: 2 names of surfaces and heads left out"));
    free(text);
}

static void expect_refused(const struct native_anchor *a, const struct native_anchor *b, const char *why)
{
    static const char *const name[] = {"a.ply", "a.las", "a.e57"};
    for (int i = 0; i < 3; i++) {
        struct sh_err err = {0};
        char part[160];
        rig_begin();
        put_scan("a,b,c,d", "model", 1, a);
        put_scan("a,b,c,d", "model", 2, b);
        assert_int_equal(record(name[i], (struct recorder_options){0}, &err), SH_EFORMAT);
        if (strstr(err.text, why) == NULL) fail_msg("%s", err.text);
        snprintf(part, sizeof part, "%s.part", rig_path(name[i]));
        unlink(part);
    }
}

static void test_other_kinds(void **state)
{
    (void)state;
    const struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    struct native_anchor b = a;
    b.heights = NATIVE_HEIGHTS_GEOID;
    expect_refused(&a, &b, "the stream changed to other heights (geoid)");
    b = a;
    b.moving = NATIVE_MOVING;
    expect_refused(&a, &b, "a head that moves");
    expect_refused(&b, &a, "a head that stands still");
    b.moving = NATIVE_STOP;
    expect_refused(&a, &b, "stops on a trajectory");
    expect_refused(&b, &a, "a head that stands still");
    b = a;
    b.heights = NATIVE_HEIGHTS_GEOID;
    expect_refused(&b, &a, "the stream changed to other heights (ellipsoid)");
    b = a;
    b.epsg = 32633;
    expect_refused(&a, &b, "the stream changed from EPSG 32632 to 32633; a file holds one CRS");
    b = a;
    b.station = 65536;
    expect_refused(&a, &b, "station 65536; a file holds stations up to 65535");
}

/* 65535 is the last station, and the last stop, that a file takes. */
static void test_same_kinds(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 65535);
    a.moving = NATIVE_STOP;
    rig_begin();
    put_scan("a,b,c,d", "model", 1, &a);
    put_scan("a,b,c,d", "model", 2, &a);
    char *text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1}, NULL);
    assert_int_equal(rig_count(text, " 7 65535"), 2);
    assert_int_equal(rig_count(text, "comment the stations are stops on a trajectory; frame: its frame scalar there"),
                     1);
    free(text);
}

/* PLY describes its coordinates. As float, degrees would be wrong by metres. */
static void test_ply_says(void **state)
{
    (void)state;
    struct sh_err err = {0};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_GEODETIC, 4979, 1);
    a.anchor[0] = 45;
    a.anchor[1] = 9;
    a.scale[0] = a.scale[1] = 1e-9;
    for (int geoid = 0; geoid < 2; geoid++) {
        a.heights = geoid ? NATIVE_HEIGHTS_GEOID : NATIVE_HEIGHTS_ELLIPSOID;
        rig_begin();
        put_scan("a,b,c,d", "model", 1, &a);
        char *text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1}, NULL);
        assert_non_null(strstr(text, geoid ? "in degrees, height above the geoid in metres\n"
                                           : "in degrees, ellipsoidal height in metres\n"));
        assert_non_null(strstr(text, "comment x latitude, y longitude in degrees, z range in metres, time"));
        free(text);
    }
    rig_begin();
    put_scan("a,b,c,d", "model", 1, &a);
    assert_int_equal(record("a.ply", (struct recorder_options){.columns = PLY_XYZ | PLY_FLOAT}, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "degrees as float"));
    unlink(rig_path("a.ply.part"));
}

/* As float, coordinates of a kilometre have steps of 0.06 mm. A station farther away on any axis is refused. */
static void test_floats(void **state)
{
    (void)state;
    for (int axis = 0; axis < 3; axis++)
        for (int sign = -1; sign <= 1; sign += 2)
            for (int beyond = 0; beyond < 2; beyond++) {
                struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
                struct sh_err err = {0};
                memset(a.anchor, 0, sizeof a.anchor);
                a.anchor[axis] = sign * (beyond ? 1000.5 : 1000.0);
                rig_begin();
                put_scan("a,b,c,d", "model", 1, &a);
                assert_int_equal(record("a.ply", (struct recorder_options){.columns = PLY_XYZ | PLY_FLOAT}, &err),
                                 beyond ? SH_EINPUT : SH_OK);
                unlink(rig_path(beyond ? "a.ply.part" : "a.ply"));
            }
}

static void put_emitter(const struct native_emitter *e, const struct native_beam *beam)
{
    rig_put(out, native_encode_emitter(out, sizeof out, e, beam, 0, 0));
}

/* Four beams fire a microsecond apart, every 10 us. A turn that begins at 12 us begins with the third beam of the
 * second sequence, firing 6. The frame begins with firing 8, row 2 of its line. The line's end was lost. */
static void test_rows_of_beams(void **state)
{
    (void)state;
    const struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    const struct native_emitter e = {
        .kind = NATIVE_EMIT_BEAMS, .n_beams = 4, .turn = 1, .sequence_ns_num = 10000, .sequence_ns_den = 1};
    const struct native_beam beam[4] = {{0, 0, 0}, {1, 0, 1000}, {2, 0, 2000}, {3, 0, 3000}};
    const struct native_descriptor d = descriptor("a,b,c,d", "model", 1);
    uint32_t zero = 0, x = 100;
    int16_t refl = 0;
    uint16_t label = 0;
    uint8_t echo = 0x11;
    struct line_block block = {.line = 1,
                               .pulse0 = 8,
                               .n_pulses = 1,
                               .t0_ns = 20000,
                               .n_points = 1,
                               .dt_ns = &zero,
                               .a = &x,
                               .b = &x,
                               .c = &x,
                               .refl_cdb = &refl,
                               .echo = &echo,
                               .label = &label};
    static const struct {
        int first, t0_ns;
    } lines[] = {{3, 9999}, {4, 10000}, {4, 10999}, {6, 12000}};
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        block.line_t0_ns = lines[i].t0_ns;
        rig_begin();
        rig_put(out, native_encode_descriptor(out, sizeof out, &d, 0, 0));
        put_emitter(&e, beam);
        rig_anchor(&a);
        rig_put(out, native_encode_points(out, sizeof out, &block, 0));
        e57rig_record_one((struct recorder_options){0});
        e57rig_scan(0, 0, 0);
        assert_int_equal(e57rig_record[0].row, 8 - lines[i].first);
    }
}

static const struct native_emitter ten_rings = {.kind = NATIVE_EMIT_SPHERE,
                                                .steps = 10,
                                                .rings = 10,
                                                .turn = 1,
                                                .sequence_ns_den = 1,
                                                .first_ring_udeg = -90000000};

/* A sphere of ten rings has ten lines, and the first and the last one are in one grid. An eleventh line begins another
 * grid, even if descriptor, emitter and anchor were repeated before it. */
static void test_lines_of_rings(void **state)
{
    (void)state;
    const struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    const struct native_descriptor d = descriptor("a,b,c,d", "model", 1);
    for (int eleven = 0; eleven < 2; eleven++) {
        rig_begin();
        for (int flags = 0; flags <= (eleven ? NATIVE_REPEAT : 0); flags += NATIVE_REPEAT) {
            rig_put(out, native_encode_descriptor(out, sizeof out, &d, 0, flags));
            rig_put(out, native_encode_emitter(out, sizeof out, &ten_rings, NULL, 0, flags));
            rig_put(out, native_encode_anchor(out, sizeof out, &a, 0, flags));
            if (flags == 0) rig_points(0, 0, 0, &one, 1);
        }
        rig_points(9, 90, 90, &one, 1);
        if (eleven) rig_points(10, 100, 100, &one, 1);
        char *text = rig_record_bytes("a.ptx", (struct recorder_options){0}, NULL);
        assert_memory_equal(text, "10\n1\n", 5);
        assert_int_equal(strstr(rig_notes, "1 additional grids begun") != NULL, eleven);
        free(text);
    }
}

/* A line beyond the rings begins another grid, whether the emitter comes before the anchor or after it. */
static void test_a_line_beyond(void **state)
{
    (void)state;
    const struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    const struct native_descriptor d = descriptor("a,b,c,d", "model", 1);
    for (int emitter_first = 0; emitter_first < 2; emitter_first++) {
        rig_begin();
        rig_put(out, native_encode_descriptor(out, sizeof out, &d, 0, 0));
        if (!emitter_first) rig_anchor(&a);
        put_emitter(&ten_rings, NULL);
        if (emitter_first) rig_anchor(&a);
        rig_points(0, 0, 0, &one, 1);
        rig_points(10, 100, 100, &one, 1);
        char *text = rig_record_bytes("a.ptx", (struct recorder_options){0}, NULL);
        assert_memory_equal(text, "1\n1\n", 4);
        assert_non_null(strstr(rig_notes, "grids begun"));
        free(text);
    }
}

/* A head of several rings, and one that pans, have sweeps. Others have lines of one grid. */
static void test_sweeps(void **state)
{
    (void)state;
    static const struct {
        int kind;
        uint32_t rings;
        double pan_deg_s;
        int is_apart;
    } cases[] = {{SCANHEAD_EMIT_SPHERE, 1, 0, 0}, {SCANHEAD_EMIT_SPHERE, 2, 0, 1}, {SCANHEAD_EMIT_SPHERE, 1, 10, 0},
                 {SCANHEAD_EMIT_LINE, 0, 0, 0},   {SCANHEAD_EMIT_LINE, 0, 10, 1},  {SCANHEAD_EMIT_PLANAR, 2, 10, 0}};
    static struct track t;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const struct mesh_grid g = {.kind = cases[i].kind, .rings = cases[i].rings, .sweep = 3};
        t.info.pan_deg_s = cases[i].pan_deg_s;
        t.sweep = 3;
        assert_int_equal(mesh_grid_takes(&g, &t, 0), 1);
        t.sweep = 4;
        assert_int_equal(mesh_grid_takes(&g, &t, 0), !cases[i].is_apart);
    }
}

/* Elevations are rounded to 1e-6 degrees. An elevation a degree from the pole is a ring. */
static void test_poles(void **state)
{
    (void)state;
    struct mesh_grid g = {.kind = SCANHEAD_EMIT_SPHERE, .rings = 181, .first_ring_deg = -90, .ring_step_deg = 1};
    assert_true(mesh_grid_is_pole(&g, 0) && mesh_grid_is_pole(&g, 180) && mesh_grid_is_pole(&g, 181));
    assert_false(mesh_grid_is_pole(&g, 1) || mesh_grid_is_pole(&g, 179) || mesh_grid_is_pole(&g, 90));
    g = (struct mesh_grid){.kind = SCANHEAD_EMIT_SPHERE, .rings = 3, .first_ring_deg = -89.99, .ring_step_deg = 0.5};
    assert_false(mesh_grid_is_pole(&g, 0));
}

static int asked;

static int stops_once(void *ctx)
{
    (void)ctx;
    return asked++ == 0;
}

/* The triangles of the first scan fail as the second one begins; the stop stands for memory that runs out. A mesh
 * without them would pass for a mesh of all that came, so there is none, also for a keeper of all that came. */
static void test_a_grid_that_fails(void **state)
{
    (void)state;
    struct sh_err err;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    memcpy(a.anchor, a.station_m, sizeof a.anchor);
    rig_begin();
    for (uint32_t scan = 1; scan <= 2; scan++) {
        struct native_descriptor d = descriptor("Maker,Model,SN1,1", "model", scan);
        d.pan_udeg_s = 36000000;
        d.pan_stop_udeg = 360000000;
        rig_put(out, native_encode_descriptor(out, sizeof out, &d, 0, 0));
        rig_anchor(&a);
        for (uint32_t line = 0; line < 300; line++) /* a stop is asked for every 256 lines */
            rig_points(line, (uint64_t)line * 10, (uint64_t)line * 10, &one, 1);
    }
    asked = 0;
    rig_stop = stops_once;
    assert_int_equal(rig_record(rig_path("a.obj"), (struct recorder_options){0}, RIG_KEEP_ALWAYS, &err), SH_ESTOPPED);
    rig_stop = NULL;
    assert_int_equal(asked, 1);
    assert_int_equal(access(rig_path("a.obj"), F_OK), -1);
}

static int tear_down(void **state)
{
    e57rig_free();
    return rig_tear_down(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_several_heads),
        cmocka_unit_test(test_many_heads),
        cmocka_unit_test(test_header_of_part),
        cmocka_unit_test(test_other_kinds),
        cmocka_unit_test(test_same_kinds),
        cmocka_unit_test(test_ply_says),
        cmocka_unit_test(test_floats),
        cmocka_unit_test(test_rows_of_beams),
        cmocka_unit_test(test_lines_of_rings),
        cmocka_unit_test(test_a_line_beyond),
        cmocka_unit_test(test_sweeps),
        cmocka_unit_test(test_poles),
        cmocka_unit_test(test_a_grid_that_fails),
    };
    return cmocka_run_group_tests(tests, rig_set_up, tear_down);
}
