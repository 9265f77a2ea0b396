/* SPDX-License-Identifier: MIT */
/* Points, stations, meshes and losses of a stream that is shown. The stream is written shot by shot, so that each
 * figure is known by hand. */
#include "tests/unit/recorder_rig.h"

#include "firmware_sim/app/studio/view/viewed.h"

static struct viewed shown;
static struct sh_err err;

static void viewed_warn(void *ctx, const char *text)
{
    (void)ctx;
    const size_t at = strlen(rig_notes);
    snprintf(rig_notes + at, sizeof rig_notes - at, "%s\n", text);
}

static int show(void)
{
    const struct sh_report report = {.warn = viewed_warn};
    fclose(rig_stream);
    rig_stream = NULL;
    rig_notes[0] = '\0';
    memset(&err, 0, sizeof err);
    return viewed_load(&shown, rig_shs, &report, &err);
}

static void loads(void)
{
    if (show() != SH_OK) fail_msg("%s", err.text);
}

static void near(double got, double want)
{
    if (!(fabs(got - want) <= 1e-9)) fail_msg("%.12g, not %.12g", got, want);
}

/* A head that pans, with 100 lines/s. */
static void pan(uint32_t scan)
{
    static uint8_t out[1024];
    const struct native_descriptor d = {.idn = "I",
                                        .profile = "p",
                                        .scan = scan,
                                        .layout = NATIVE_GEO,
                                        .prr_uhz = 1000000000,
                                        .lines_uhz = 100000000,
                                        .pan_udeg_s = 10000000,
                                        .mirror_counts_per_turn = 3600,
                                        .pan_counts_per_turn = 3600,
                                        .range_max_m = 100,
                                        .range_scale_m = 1e-3};
    rig_put(out, native_encode_descriptor(out, sizeof out, &d, 0, 0));
}

/* Begins a scan in the geo layout: millimetres from (500000.25, 5e6, 400.125). */
static void begin_geo(uint32_t crs, uint32_t epsg, uint32_t station)
{
    const struct native_anchor anchor = rig_anchor_of(crs, epsg, station);
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&anchor);
}

/* Two lines of three shots, 3 m and 1 m apart, with a second echo, and an empty shot. The lines are 1 m apart. */
static void write_two_lines(void)
{
    static const struct rig_point first[] = {{0, 0, -2000, -150, 7, 1, 1},
                                             {3000, 0, -2000, -250, 7, 1, 2},
                                             {3500, 0, -2000, 50, 9, 2, 2},
                                             {4000, 0, -2000, 0, 7, 1, 1}};
    static const struct rig_point second[] = {{0, 1000, -2000, -100, 8, 1, 1},
                                              {3000, 1000, -2000, -200, 8, 1, 1},
                                              {4000, 1000, -2000, -300, 8, 1, 1},
                                              {0, 0, 0, 0, 0xffff, 0, 0}};
    rig_points(0, 0, 0, first, 4);
    rig_points(1, 10, 10, second, 4);
}

static void each_point_has_its_columns(void **state)
{
    static const struct {
        double x, y, z, db, t_s;
        unsigned label, echo, echoes;
    } rows[] = {{0, 0, -2, -1.5, 0.0, 7, 1, 1}, {3, 0, -2, -2.5, 0.001, 7, 1, 2}, {3.5, 0, -2, 0.5, 0.001, 9, 2, 2},
                {4, 0, -2, 0, 0.002, 7, 1, 1},  {0, 1, -2, -1, 0.010, 8, 1, 1},   {3, 1, -2, -2, 0.011, 8, 1, 1},
                {4, 1, -2, -3, 0.012, 8, 1, 1}};
    enum { N = sizeof rows / sizeof rows[0] };
    const struct cloud *p = &shown.points;
    (void)state;
    begin_geo(NATIVE_CRS_LOCAL, 0, 3);
    write_two_lines();
    loads();
    assert_int_equal(p->n, N);
    for (int i = 0; i < N; i++) {
        near(p->xyz_m[i][0] - 500000.25, rows[i].x);
        near(p->xyz_m[i][1] - 5e6, rows[i].y);
        near(p->xyz_m[i][2] - 400.125, rows[i].z);
        near((double)p->reflectance_db[i], rows[i].db);
        near(p->time_s[i], rows[i].t_s);
        assert_true(p->label[i] == rows[i].label && p->station[i] == 3);
        assert_true(p->echo[i] == rows[i].echo && p->echo_count[i] == rows[i].echoes);
    }
    assert_true(p->range_m != NULL && p->amplitude_db == NULL && p->rgb == NULL);
    assert_true(shown.n_empty == 1 && shown.n_left_out == 0 && shown.turned == 0 && shown.points.epsg == 0);
    assert_string_equal(shown.format, "shs");
    assert_string_equal(shown.idn, "Maker,<Model> & Co,SN1,1.0");
    assert_string_equal(shown.profile, "model");
    near(shown.min_m[1], 5e6);
    near(shown.max_m[2], 398.125);
    near(shown.origin_m[0], 500002.0); /* the middle, to a metre */
    near(shown.low[CLOUD_REFLECTANCE], -3.0);
    near(shown.high[CLOUD_REFLECTANCE], 0.5);
    near(shown.low[CLOUD_LABEL], 7.0);
    near(shown.high[CLOUD_ECHO], 2.0);
    near(shown.high[CLOUD_ECHO_COUNT], 2.0);
    near(shown.low[CLOUD_STATION], 3.0);
    near(shown.high[CLOUD_TIME], 0.012);
    near(shown.t0_s, 0.0);
    assert_true(isnan(shown.low[CLOUD_AMPLITUDE]) && isnan(shown.high[CLOUD_AMPLITUDE]));
    /* The scan has no end in this stream. */
    assert_int_equal(shown.complete, 0);
    assert_non_null(strstr(rig_notes,
                           ": not complete: 0 pulses lost by the head, 0 did not arrive, 0 bad bytes; it ends "
                           "in the middle of a scan\n"));
    viewed_free(&shown);
}

/* A frame of a later version is passed over. The line of what is missing names it, since nothing else does. */
static void frames_left_out_are_told(void **state)
{
    (void)state;
    uint8_t out[256];
    const struct native_event end = {.code = NATIVE_EV_SCAN_END, .a = 1, .b = 6};
    begin_geo(NATIVE_CRS_UTM, 32632, 3);
    write_two_lines();
    const size_t len = native_encode_event(out, sizeof out, &end, 0, 0);
    out[2] = 9;
    rig_put(out, len);
    loads();
    assert_int_equal(shown.complete, 0);
    assert_non_null(strstr(rig_notes, ", 0 bad bytes, 1 frames left out for their contents or version; it ends"));
    viewed_free(&shown);
}

/* Frame 5 was lost. It may have been points, and the telemetry with the final counts did not come, either. */
static void a_gap_before_the_end_leaves_counts_unknown(void **state)
{
    (void)state;
    uint8_t out[256];
    const struct native_event start = {.code = NATIVE_EV_SCAN_START, .a = 1},
                              end = {.code = NATIVE_EV_SCAN_END, .a = 1, .b = 6};
    begin_geo(NATIVE_CRS_UTM, 32632, 3);
    rig_put(out, native_encode_event(out, sizeof out, &start, 0, 0));
    write_two_lines();
    const size_t len = native_encode_event(out, sizeof out, &end, 0, 0);
    native_finish_frame(out, 6);
    rig_put(out, len);
    loads();
    assert_int_equal(shown.complete, 0);
    assert_non_null(strstr(rig_notes, ": not complete: 0 pulses lost by the head, at least 0 did not arrive"));
    viewed_free(&shown);
}

/* The rig's head has a heading of 90 degrees. */
static void stations_have_their_places(void **state)
{
    (void)state;
    begin_geo(NATIVE_CRS_LOCAL, 0, 3);
    write_two_lines();
    const struct native_anchor next = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 2);
    rig_descriptor(1, 2);
    rig_anchor(&next);
    write_two_lines();
    loads();
    assert_int_equal(shown.n_stations, 2);
    for (int i = 0; i < 2; i++) {
        const struct viewed_station *s = &shown.station[i];
        assert_true(s->number == (i == 0 ? 3 : 2) && s->placed == 1);
        near(s->heading_rad, M_PI_2);
        near(s->pitch_rad, 0.0);
        near(s->roll_rad, 0.0);
        near(s->p_m[0], 500000.25); /* of points in the scene's frame, the anchor is the head's origin */
        near(s->p_m[1], 5e6);
        near(s->p_m[2], 400.125);
    }
    assert_int_equal(shown.points.n, 14);
    assert_int_equal(shown.points.station[13], 2);
    viewed_free(&shown);
}

/* A grid of 2 x 3 shots has a cell of 3 x 1 m and one of 1 x 1 m, with two triangles each. Before the filter of long
 * edges there are nine edges: 3 + 1 + 3 + 1 m along the lines, three of 1 m across, and diagonals of root 10 and 2. */
static void a_grid_is_a_mesh(void **state)
{
    (void)state;
    const struct native_anchor anchor = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 5);
    const double mean_m = (11.0 + sqrt(10.0) + sqrt(2.0)) / 9.0;
    rig_begin();
    pan(4);
    rig_anchor(&anchor);
    write_two_lines();
    pan(6);
    rig_anchor(&anchor);
    write_two_lines();
    loads();
    assert_int_equal(shown.n_meshes, 2);
    assert_string_equal(shown.why_no_mesh, "");
    for (uint32_t k = 0; k < 2; k++) {
        const struct viewed_mesh *m = &shown.mesh[k];
        assert_true(m->station == 5 && m->scan == (k == 0 ? 4 : 6) && m->sweep == 0);
        assert_true(m->first_point == 7 * k && m->n_points == 7 && m->n_faces == 4);
        assert_true(m->n_edges == 9 && m->n_flat == 0);
        near(m->mean_edge_m, mean_m);
        for (uint32_t i = 0; i < 4; i++) {
            /* Corners of the first cell are the points 0, 1, 4, 5, those of the second 1, 3, 5, 6. */
            const uint64_t cell = i < 2 ? 1 << 0 | 1 << 1 | 1 << 4 | 1 << 5 : 1 << 1 | 1 << 3 | 1 << 5 | 1 << 6;
            const double ratio = (i < 2 ? sqrt(10.0) : sqrt(2.0)) / mean_m;
            for (int c = 0; c < 3; c++)
                assert_true(cell >> m->face[i][c] & 1);
            assert_true((double)m->ratio[i] >= ratio && (double)m->ratio[i] < ratio * (1.0 + 2e-7)); /* rounded up */
            assert_int_equal(m->order[i], (i + 2) % 4);
        }
    }
    viewed_free(&shown);
}

/* A head that neither pans nor moves has no surface. One line has no cell. */
static void without_a_grid_the_reason_is_there(void **state)
{
    static const struct rig_point line[] = {{0, 0, -2000, 0, 1, 1, 1}, {1000, 0, -2000, 0, 1, 1, 1}};
    (void)state;
    begin_geo(NATIVE_CRS_LOCAL, 0, 1);
    write_two_lines();
    loads();
    assert_string_equal(shown.why_no_mesh, "a mesh needs a surface, but this head scans a single line: it neither pans "
                                           "nor moves, and has one ring");
    viewed_free(&shown);
    const struct native_anchor anchor = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    rig_begin();
    pan(1);
    rig_anchor(&anchor);
    rig_points(0, 0, 0, line, 2);
    loads();
    assert_int_equal(shown.n_meshes, 0);
    assert_string_equal(shown.why_no_mesh, "no four points lie in neighbouring rows and lines");
    viewed_free(&shown);
    /* One scan that has a mesh is enough, whatever the one before it lacks. */
    begin_geo(NATIVE_CRS_LOCAL, 0, 1);
    write_two_lines();
    pan(2);
    rig_anchor(&anchor);
    write_two_lines();
    loads();
    assert_int_equal(shown.n_meshes, 1);
    assert_string_equal(shown.why_no_mesh, "");
    viewed_free(&shown);
}

/* Points in degrees are shown in metres east, north and up of the first one. At latitude 45 the meridian has the
 * radius a (1 - e2) / (1 - e2 / 2)^1.5 = 6367381.8 m, and 400.125 m above it that much more. No place has a latitude of
 * 145 degrees. */
static void degrees_are_turned_to_metres(void **state)
{
    static const struct rig_point line[] = {
        {0, 0, 0, 0, 1, 1, 1}, {100000, 0, 0, 0, 1, 1, 1}, {0, 0, 1500, 0, 1, 1, 1}};
    (void)state;
    for (int wide = 0; wide < 2; wide++) {
        struct native_anchor anchor = rig_anchor_of(NATIVE_CRS_GEODETIC, 4979, 1);
        anchor.anchor[0] = 45.0;
        anchor.anchor[1] = 9.0;
        anchor.scale[0] = anchor.scale[1] = wide ? 1e-3 : 1e-8; /* degrees */
        anchor.scale[2] = 1e-3;
        rig_begin();
        pan(1);
        rig_anchor(&anchor);
        rig_points(0, 0, 0, line, 3);
        loads();
        const double(*xyz_m)[3] = (const double(*)[3])shown.points.xyz_m;
        assert_true(shown.turned == 1 && shown.points.epsg == 4979 && shown.n_meshes == 0);
        assert_string_equal(shown.why_no_mesh, "a mesh needs metres, and this recording's coordinates are degrees");
        near(shown.lat_deg, 45.0);
        near(shown.lon_deg, 9.0);
        near(shown.height_m, 400.125);
        assert_true(fabs(shown.station[0].p_m[0]) + fabs(shown.station[0].p_m[1]) < 1e-6); /* it is at the anchor */
        near(shown.station[0].heading_rad, M_PI_2);
        assert_int_equal(shown.points.n, wide ? 2 : 3);
        assert_int_equal(shown.n_left_out, wide);
        assert_true(fabs(xyz_m[0][0]) + fabs(xyz_m[0][1]) + fabs(xyz_m[0][2]) < 1e-6);
        assert_true(fabs(xyz_m[2 - wide][2] - 1.5) < 1e-6);
        const double r_m = 6367381.8 + 400.125, north_m = r_m * 0.001 * M_PI / 180.0;
        if (!wide) /* the ellipsoid falls by half the distance squared, over the radius */
            assert_true(fabs(xyz_m[1][1] - north_m) < 2e-5 && fabs(xyz_m[1][2] + 0.5 * north_m * north_m / r_m) < 1e-6);
        assert_int_equal(strstr(rig_notes,
                                ": 1 echoes left out, since their place is not known, or is beyond 1e12 m or a "
                                "latitude of 90 degrees\n") != NULL,
                         wide);
        viewed_free(&shown);
    }
}

/* In ECEF at latitude 0 and longitude 0, X is up, Y is east and Z is north. */
static void ecef_is_turned_to_metres(void **state)
{
    static const struct rig_point line[] = {{0, 0, 0, 0, 1, 1, 1}, {1000, 2000, 3000, 0, 1, 1, 1}};
    static const double plain[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    (void)state;
    struct native_anchor anchor = rig_anchor_of(NATIVE_CRS_ECEF, 4978, 1);
    anchor.anchor[0] = 6378137.0;
    anchor.anchor[1] = anchor.anchor[2] = 0.0;
    anchor.lat_deg = anchor.lon_deg = anchor.height_m = 0.0;
    memcpy(anchor.rotation, plain, sizeof plain);
    rig_begin();
    pan(1);
    rig_anchor(&anchor);
    rig_points(0, 0, 0, line, 2);
    loads();
    assert_true(shown.turned == 1 && shown.points.n == 2 && shown.points.epsg == 4978);
    assert_true(fabs(shown.lat_deg) < 1e-9 && fabs(shown.lon_deg) < 1e-9 && fabs(shown.height_m) < 1e-6);
    for (int k = 0; k < 3; k++)
        assert_true(fabs(shown.points.xyz_m[1][k] - (const double[]){2.0, 3.0, 1.0}[k]) < 1e-6);
    /* The head's forward axis, Y, is east; its right axis, X, is up, and a roll that lowers the right side is
     * positive. */
    near(shown.station[0].heading_rad, M_PI_2);
    near(shown.station[0].pitch_rad, 0.0);
    near(shown.station[0].roll_rad, -M_PI_2);
    for (int k = 0; k < 3; k++)
        assert_true(fabs(shown.station[0].p_m[k]) < 1e-6);
    viewed_free(&shown);
}

static void surface_name(void *ctx, uint32_t i, const char **object, const char **material)
{
    static const char *const names[][2] = {{"wall", "brick"}, {"door", ""}};
    (void)ctx;
    *object = names[i - 7][0];
    *material = names[i - 7][1];
}

static void surfaces_have_their_names(void **state)
{
    static uint8_t out[1024];
    struct native_names names = {7, 2, surface_name, NULL};
    (void)state;
    begin_geo(NATIVE_CRS_LOCAL, 0, 3);
    rig_put(out, native_encode_surfaces(out, sizeof out, sizeof out, &names, 0));
    write_two_lines();
    loads();
    assert_int_equal(shown.n_surfaces, 2);
    assert_true(shown.surface[0].label == 7 && shown.surface[1].label == 8);
    assert_string_equal(shown.surface[0].object, "wall");
    assert_string_equal(shown.surface[0].material, "brick");
    assert_string_equal(shown.surface[1].object, "door");
    assert_string_equal(shown.surface[1].material, "");
    viewed_free(&shown);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_point_has_its_columns),
        cmocka_unit_test(frames_left_out_are_told),
        cmocka_unit_test(a_gap_before_the_end_leaves_counts_unknown),
        cmocka_unit_test(stations_have_their_places),
        cmocka_unit_test(a_grid_is_a_mesh),
        cmocka_unit_test(without_a_grid_the_reason_is_there),
        cmocka_unit_test(degrees_are_turned_to_metres),
        cmocka_unit_test(ecef_is_turned_to_metres),
        cmocka_unit_test(surfaces_have_their_names),
    };
    return cmocka_run_group_tests_name("view stream", tests, rig_set_up, rig_tear_down);
}
