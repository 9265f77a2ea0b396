/* Glass and mirrors, against rooms whose images can be written down; and detection that asks for nothing. */
#include "tests/unit/cast_rig.h"

#include "core/surface.h"

static const double STATION[3] = {0.5, 0.25, 0.125};
static const double LO[3] = {-4, -5, -2}, HI[3] = {6, 5, 3};

struct optics {
    struct cast_rig *rig;
    struct surface_table table;
    struct cast_detect detect;
};

static void open_optics(struct optics *o, struct scene *scene)
{
    struct sh_err err;
    uint32_t n = scene->n_surfaces;
    o->rig = cast_rig_open(scene, STATION);
    bvh_free(o->rig->bvh); /* rays begin all over the room */
    if (bvh_create(scene, STATION, 50.0, 1, NULL, &o->rig->bvh, &err) != 0 ||
        surface_table_alloc(n, &o->table, &err) != 0)
        fail_msg("%s", err.text);
    line_block_free(&o->rig->block);
    assert_int_equal(line_block_alloc(&o->rig->block, RIG_LINE * (1 + CAST_MAX_DEPTH), &err), 0);
    for (uint32_t i = 0; i < n; i++)
        o->table.surface[i].reflectance = 0.5;
    o->detect =
        (struct cast_detect){.surfaces = &o->table, .depth = CAST_MAX_DEPTH, .ghost_label = n, .max_echoes = 15};
    o->rig->setup.bvh = o->rig->bvh;
    o->rig->setup.detect = &o->detect;
}

static void close_optics(struct optics *o)
{
    surface_table_free(&o->table);
    cast_rig_close(o->rig);
}

/* Direction of cast pulse i of a line. */
static void direction(const struct cast_rig *rig, const struct schedule_line *line, uint32_t i, long double d[3])
{
    long double turn = 6.283185307179586476925286766559L;
    long double m = turn * (long double)schedule_mirror_turn(&rig->segment, line->cast0 + i);
    long double p = turn * (long double)schedule_pan_turn(&rig->segment, line->cast0 + i);
    d[0] = sinl(p) * cosl(m);
    d[1] = cosl(p) * cosl(m);
    d[2] = sinl(m);
}

static void near_range(const struct cast_rig *rig, uint32_t entry, long double range_m)
{
    double told = rig->block.a[entry] * 1e-5;
    if (!(fabs(told - (double)range_m) < 0.51e-5)) fail_msg("entry %u: %.6f m, not %.6Lf m", entry, told, range_m);
}

/* A whole line; 5 looks along y, 40 beside it. */
static uint32_t shoot_line(struct optics *o, uint64_t number, struct schedule_line *line)
{
    schedule_get_line(&o->rig->segment, number, line);
    uint32_t n = (uint32_t)(line->cast_end - line->cast0);
    cast_some(o->rig, line, line->cast0, n);
    return n;
}

/* The wall ahead is a mirror: the room goes on behind it as its own image, and each ray as if there were none. */
static void a_mirror_shows_the_room_behind_it(void **state)
{
    (void)state;
    struct optics o;
    struct schedule_line line;
    open_optics(&o, box_scene(LO, HI));
    o.table.surface[3] = (struct surface){.mirror = 0.9};
    o.table.has_optics = 1;
    const double far[3] = {HI[0], 2.0 * HI[1] - LO[1], HI[2]};
    uint32_t n = shoot_line(&o, 40, &line), ghosts = 0;
    assert_int_equal(o.rig->block.n_points, n); /* a clean mirror has no echo of its own */
    for (uint32_t i = 0; i < n; i++) {
        long double d[3];
        int wall = -1, image = -1;
        direction(o.rig, &line, i, d);
        long double plain = box_range(LO, HI, STATION, d, &wall), folded = box_range(LO, far, STATION, d, &image);
        assert_int_equal(o.rig->block.echo[i], 0x11);
        near_range(o.rig, i, wall == 3 ? folded : plain);
        assert_int_equal(o.rig->block.label[i], wall != 3 ? wall : 6 + (image == 3 ? 2 : image));
        ghosts += wall == 3;
    }
    assert_true(ghosts > 500 && ghosts < n - 500);
    close_optics(&o);
}

/* Two mirrors face each other: their images go on for ever, a pulse is followed through four. */
static void facing_mirrors_end_at_the_depth(void **state)
{
    (void)state;
    struct optics o;
    struct schedule_line line;
    open_optics(&o, box_scene(LO, HI));
    o.table.surface[2] = o.table.surface[3] = (struct surface){.mirror = 1.0};
    o.table.has_optics = 1;
    const double lo[3] = {LO[0], -INFINITY, LO[2]}, hi[3] = {HI[0], INFINITY, HI[2]};
    uint32_t n = shoot_line(&o, 5, &line), lost = 0, most = 0;
    for (uint32_t i = 0; i < n; i++) {
        long double d[3];
        int wall = -1;
        direction(o.rig, &line, i, d);
        long double range = box_range(lo, hi, STATION, d, &wall);
        double y = STATION[1] + (double)(range * d[1]);
        uint32_t mirrors = (uint32_t)(fabs(y) + 5.0) / 10; /* walls at +-5, 15, 25 ... m */
        assert_int_equal(o.rig->block.echo[i], mirrors > 4 ? 0 : 0x11);
        if (mirrors > 4)
            lost++;
        else
            near_range(o.rig, i, range);
        if (mirrors <= 4 && mirrors > most) most = mirrors;
        if (mirrors <= 4) assert_int_equal(o.rig->block.label[i], wall + (mirrors > 0 ? 6 : 0));
    }
    assert_true(most == 4 && lost > 10);
    close_optics(&o);
}

/* Squares of 60 m across y, at these places. */
static struct scene *sheets(const double y[3], const uint16_t label[3])
{
    double vertex[12][3];
    uint32_t triangle[6][3];
    uint16_t labels[6];
    static const struct scene_surface surface[3] = {{.object = "window", .material = "glass"},
                                                    {.object = "wall", .material = "brick"},
                                                    {.object = "mirror", .material = "silver"}};
    struct scene *scene;
    struct sh_err err;
    for (uint32_t p = 0; p < 3; p++) {
        for (uint32_t v = 0; v < 4; v++) {
            vertex[4 * p + v][0] = v == 1 || v == 2 ? 30.0 : -30.0;
            vertex[4 * p + v][1] = y[p];
            vertex[4 * p + v][2] = v >= 2 ? 30.0 : -30.0;
        }
        for (uint32_t t = 0; t < 2; t++)
            for (uint32_t v = 0; v < 3; v++)
                triangle[2 * p + t][v] = 4 * p + (v == 0 ? 0 : v + t);
        labels[2 * p] = labels[2 * p + 1] = label[p];
    }
    if (scene_from_arrays(&(struct scene_arrays){(const double(*)[3])vertex, 12, (const uint32_t(*)[3])triangle, 6,
                                                 labels, surface, 3},
                          &scene, &err) != 0)
        fail_msg("%s", err.text);
    return scene;
}

/* Panes at y = 2, and 2.004 m, as a box of glass has them; a wall behind. */
static struct scene *window(void)
{
    return sheets((const double[]){2.0, 2.004, 5.0}, (const uint16_t[]){0, 0, 1});
}

/* A mirror ahead, a pane behind the head, a wall behind that: pane and wall, seen in the mirror, are both ghosts, and
 * are met by nobody. Straight at the pane they are none. Their ranges are those of the folded way. */
static void glass_in_a_mirror(void **state)
{
    (void)state;
    static struct cast_hit hit[2 * (1 + CAST_MAX_DEPTH)];
    struct optics o;
    struct schedule_line line;
    struct schedule_run run;
    open_optics(&o, sheets((const double[]){3.0, -1.0, -2.0}, (const uint16_t[]){2, 0, 1}));
    o.table.surface[0] = (struct surface){.reflectance = 0.05, .glass = 0.9};
    o.table.surface[1] = (struct surface){.reflectance = 0.6};
    o.table.surface[2] = (struct surface){.mirror = 1.0};
    o.table.has_optics = 1;
    o.rig->spec.pan_udeg_s = 0;
    schedule_start(&o.rig->segment, &o.rig->spec);
    schedule_get_line(&o.rig->segment, 0, &line);
    for (uint32_t back = 0; back < 2; back++) { /* level, ahead; level, back */
        const uint64_t k = line.pulse0 + (line.pulse_end - line.pulse0) * (back ? 220 : 40) / 240;
        const double far[2] = {back ? 1.25 : 2.75 + 4.0, back ? 2.25 : 2.75 + 5.0};
        assert_int_equal(cast_some(o.rig, &line, k, 1), 2);
        for (uint32_t i = 0; i < 2; i++) {
            near_range(o.rig, i, (long double)far[i]);
            assert_int_equal(o.rig->block.echo[i], (i + 1) | 0x20);
            assert_int_equal(o.rig->block.label[i], i + (back ? 0 : 3));
        }
        schedule_get_run(&o.rig->segment, &line, k, 1, &run);
        assert_int_equal(caster_meet(o.rig->caster, &o.rig->setup, &run, hit), back ? 2 : 0);
    }
    close_optics(&o);
}

/* Three echoes: both sides of the pane, and the wall, whose light passes four of them. Only the middle of the line. Of
 * more than are asked for, the weakest is left out: the pane's far side, then its near one. */
static void a_pane_and_what_is_behind_it(void **state)
{
    (void)state;
    struct optics o;
    struct schedule_line line;
    struct detect_signal signal;
    struct sh_err err;
    const struct detect_signal_spec spec = {.n_reaches = 1, .reach = {{0.9, 900.0}}, .threshold_snr = 8.0, .sharp = 1};
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), SH_OK);
    open_optics(&o, window());
    o.table.surface[0] = (struct surface){.reflectance = 0.05, .glass = 0.9};
    o.table.surface[1] = (struct surface){.reflectance = 0.6};
    o.table.has_optics = 1;
    for (int with_signal = 0; with_signal < 2; with_signal++)
        for (uint32_t most = 1; most <= 3; most++) {
            o.detect.signal = with_signal ? &signal : NULL;
            o.detect.max_echoes = most;
            schedule_get_line(&o.rig->segment, 0, &line);
            uint64_t k = line.cast0 + 10; /* -39.2 deg on */
            uint32_t echoes = cast_some(o.rig, &line, k, 1000);
            assert_int_equal(echoes, 1000 * most);
            assert_int_equal(o.rig->block.n_points, 1000 * most);
            assert_int_equal(o.rig->block.n_pulses, 1000);
            for (uint32_t i = 0; i < 1000 * most; i++) {
                static const double y[] = {2.0, 2.004, 5.0}, rho[] = {0.05, 0.05 * 0.81, 0.6 * 0.6561};
                static const uint32_t sent[3][3] = {{2}, {0, 2}, {0, 1, 2}};
                uint32_t pulse = i / most, number = sent[most - 1][i % most];
                long double d[3];
                direction(o.rig, &line, 10 + pulse, d);
                assert_int_equal(o.rig->block.echo[i], (i % most + 1) | most << 4);
                assert_int_equal(o.rig->block.label[i], number == 2);
                near_range(o.rig, i, ((long double)y[number] - (long double)STATION[1]) / d[1]);
                assert_true(o.rig->block.t0_ns + o.rig->block.dt_ns[i] == schedule_time_ns(&o.rig->segment, k + pulse));
                double cdb = 1000.0 * log10(rho[number] * (double)d[1]);
                assert_true(with_signal ? fabs(o.rig->block.refl_cdb[i] - cdb) < 0.51
                                        : o.rig->block.refl_cdb[i] == LINE_REFL_NONE);
            }
        }
    close_optics(&o);
}

/* Of a pane and a dark wall behind it a head sends the first, the last or the strongest. */
static void one_of_a_pulse_s_echoes(void **state)
{
    (void)state;
    static const enum beam_select select[] = {BEAM_FIRST, BEAM_LAST, BEAM_STRONGEST};
    static const double y[] = {2.0, 5.0, 2.004};
    struct optics o;
    struct schedule_line line;
    open_optics(&o, window());
    o.table.surface[0] = (struct surface){.reflectance = 0.05, .glass = 0.9, .specular = 0.0};
    o.table.surface[1] = (struct surface){.reflectance = 0.01};
    o.table.has_optics = 1;
    schedule_get_line(&o.rig->segment, 0, &line);
    for (int k = 0; k < 2; k++) { /* the strongest is the pane's near side, too */
        o.rig->setup.echoes = select[k];
        assert_int_equal(cast_some(o.rig, &line, line.cast0 + 10, 100), 100);
        for (uint32_t i = 0; i < 100; i++) {
            long double d[3];
            direction(o.rig, &line, 10 + i, d);
            near_range(o.rig, i, ((long double)y[k] - (long double)STATION[1]) / d[1]);
            assert_int_equal(o.rig->block.echo[i], 0x11);
        }
    }
    o.rig->setup.echoes = BEAM_STRONGEST;
    o.table.surface[1].reflectance = 0.6;
    cast_some(o.rig, &line, line.cast0 + 10, 100);
    for (uint32_t i = 0; i < 100; i++)
        assert_int_equal(o.rig->block.label[i], 1);
    close_optics(&o);
}

/* What does not fit into 31 bits of counts is no echo, and counted: of the pane's two sides and the wall the wall. The
 * others are numbered as two. Where none fits one entry stays, without echo. */
static void echoes_that_do_not_fit(void **state)
{
    (void)state;
    static const double most_m[] = {4.0, 0.5};
    struct optics o;
    struct schedule_line line;
    struct cast_counters before, after;
    open_optics(&o, window());
    o.table.surface[0] = (struct surface){.reflectance = 0.05, .glass = 0.9};
    o.table.has_optics = 1;
    o.rig->setup.layout = LINE_GEO;
    schedule_get_line(&o.rig->segment, 0, &line);
    const uint64_t level = line.pulse0 + (line.pulse_end - line.pulse0) * 40 / 240;
    for (int k = 0; k < 2; k++) {
        const uint32_t fit = k == 0 ? 2 : 0, entries = k == 0 ? 2 : 1;
        for (int i = 0; i < 3; i++)
            o.rig->setup.xyz_scale[i] = most_m[k] / 2147483647.0;
        caster_get_counters(o.rig->caster, &before);
        assert_int_equal(cast_some(o.rig, &line, level, 100), 100 * fit);
        caster_get_counters(o.rig->caster, &after);
        assert_int_equal(after.unfit - before.unfit, 100 * (3 - fit));
        assert_int_equal(o.rig->block.n_points, 100 * entries);
        for (uint32_t i = 0; i < 100 * entries; i++) {
            assert_int_equal(o.rig->block.echo[i], fit == 0 ? 0 : (i % 2 + 1) | 0x20);
            assert_int_equal(o.rig->block.label[i], fit == 0 ? LINE_LABEL_NONE : 0);
        }
    }
    close_optics(&o);
}

/* A head that moves along x: all three echoes of a pulse lie where its own beam has gone, on the planes and at its x. */
static void echoes_of_a_moving_head(void **state)
{
    (void)state;
    static const double y[] = {2.0, 2.004, 5.0};
    struct optics o;
    struct schedule_line line;
    const struct pose_knot knot[2] = {{.t_ns = 0, .pose = {.position_m = {0, 0, 0}, .quat = {1, 0, 0, 0}}},
                                      {.t_ns = 10000000, .pose = {.position_m = {20, 0.5, 0}, .quat = {1, 0, 0, 0}}}};
    open_optics(&o, window());
    o.table.surface[0] = (struct surface){.reflectance = 0.05, .glass = 0.9};
    o.table.has_optics = 1;
    o.rig->setup.layout = LINE_GEO;
    o.rig->setup.xyz_scale[0] = o.rig->setup.xyz_scale[1] = o.rig->setup.xyz_scale[2] = 1e-6;
    o.rig->setup.knot = knot;
    o.rig->setup.n_knots = 2;
    o.rig->spec.pan_udeg_s = 0;
    schedule_start(&o.rig->segment, &o.rig->spec);
    schedule_get_line(&o.rig->segment, 0, &line);
    const uint64_t level = line.pulse0 + (line.pulse_end - line.pulse0) * 40 / 240;
    assert_int_equal(cast_some(o.rig, &line, level, 500), 1500);
    for (uint32_t i = 0; i < 1500; i++) {
        const double x_m = 20.0 * (double)schedule_time_ns(&o.rig->segment, level + i / 3) / 1e7;
        /* half a count; from the station, as counts are */
        assert_true(fabs((int32_t)o.rig->block.b[i] * 1e-6 - (y[i % 3] - STATION[1])) < 0.5e-6 + 1e-9);
        assert_true(fabs((int32_t)o.rig->block.a[i] * 1e-6 - (x_m - STATION[0])) < 0.5e-6 + 1e-9);
    }
    close_optics(&o);
}

/* With a range resolution of 10 cm both sides of the pane are one echo, between them by what each sends back, and their
 * sum; the wall stays apart. Without the pane's far side in reach of the resolution (1 mm), three. */
static void what_is_too_near_is_one_echo(void **state)
{
    (void)state;
    struct optics o;
    struct schedule_line line;
    struct detect_signal signal;
    struct sh_err err;
    const struct detect_signal_spec spec = {.n_reaches = 1, .reach = {{0.9, 900.0}}, .threshold_snr = 8.0, .sharp = 1};
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), SH_OK);
    open_optics(&o, window());
    o.table.surface[0] = (struct surface){.reflectance = 0.05, .glass = 0.9};
    o.table.surface[1] = (struct surface){.reflectance = 0.6};
    o.table.has_optics = 1;
    o.detect.signal = &signal;
    schedule_get_line(&o.rig->segment, 0, &line);
    o.detect.separation_m = 0.001;
    assert_int_equal(cast_some(o.rig, &line, line.cast0 + 10, 1000), 3000);
    o.detect.separation_m = 0.1;
    assert_int_equal(cast_some(o.rig, &line, line.cast0 + 10, 1000), 2000);
    for (uint32_t i = 0; i < 2000; i++) {
        long double d[3];
        direction(o.rig, &line, 10 + i / 2, d);
        double pane = 0.05 + 0.05 * 0.81, y = i % 2 ? 5.0 : 2.0 + 0.004 * 0.05 * 0.81 / pane;
        near_range(o.rig, i, ((long double)y - (long double)STATION[1]) / d[1]);
        assert_int_equal(o.rig->block.label[i], i % 2);
        double cdb = 1000.0 * log10((i % 2 ? 0.6 * 0.6561 : pane) * (double)d[1]);
        assert_true(fabs(o.rig->block.refl_cdb[i] - cdb) < 0.51);
    }
    close_optics(&o);
}

/* The same light from the same pulses, however a line is cut, with noise on everything, in both layouts. */
static void cuts_leave_no_trace(void **state)
{
    (void)state;
    struct optics o;
    struct schedule_line line;
    struct detect_signal signal;
    struct sh_err err;
    struct detect_signal_spec spec = {.n_reaches = 1,
                                      .reach = {{0.9, 20.0}},
                                      .threshold_snr = 8.0,
                                      .sigma_m = 0.003,
                                      .sigma_at_m = 10.0,
                                      .sigma_reflectance = 0.9,
                                      .sigma_floor_m = 0.001,
                                      .seed = 4};
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), SH_OK);
    open_optics(&o, window());
    o.table.surface[0] = (struct surface){.reflectance = 0.03, .glass = 0.9};
    o.table.surface[1] = (struct surface){.reflectance = 0.06};
    o.table.has_optics = 1;
    const struct instrument k = {.mirror_sigma_rad = 1e-4, .mirror_key = 5, .transit_offset_m = 0.01};
    struct detect_ball ball = {.radius_m = 0.01, .factor = {1, 1, 1}};
    detect_ball_keys(&ball, 3);
    o.detect.signal = &signal;
    o.detect.noise_by_signal = 1;
    o.detect.instrument = &k;
    o.detect.ball = &ball;
    static uint32_t whole[4][3 * RIG_LINE];
    uint64_t seed = 9;
    for (int geo = 0; geo < 2; geo++) {
        o.rig->setup.layout = geo ? LINE_GEO : LINE_POLAR;
        uint32_t n = shoot_line(&o, 40, &line), points = o.rig->block.n_points, at = 0, none = 0, several = 0;
        for (uint32_t i = 0; i < points; i++) {
            whole[0][i] = o.rig->block.a[i];
            whole[1][i] = o.rig->block.b[i];
            whole[2][i] = o.rig->block.c[i];
            whole[3][i] = (uint16_t)o.rig->block.refl_cdb[i] | (uint32_t)o.rig->block.echo[i] << 16;
            none += o.rig->block.echo[i] == 0;
            several += o.rig->block.echo[i] > 0x20;
        }
        assert_true(none > 100 && several > 100);
        for (uint32_t done = 0; done < n;) {
            uint32_t piece = (uint32_t)case_between(&seed, 1, 90) * SCHEDULE_PACKET;
            if (piece > n - done) piece = n - done;
            cast_some(o.rig, &line, line.cast0 + done, piece);
            for (uint32_t i = 0; i < o.rig->block.n_points; i++, at++)
                assert_true(o.rig->block.a[i] == whole[0][at] && o.rig->block.b[i] == whole[1][at] &&
                            o.rig->block.c[i] == whole[2][at] &&
                            ((uint16_t)o.rig->block.refl_cdb[i] | (uint32_t)o.rig->block.echo[i] << 16) ==
                                whole[3][at]);
            done += piece;
        }
        assert_int_equal(at, points);
    }
    close_optics(&o);
}

/* Where nothing is asked for, or nothing of it is met, the bytes are those of the plain caster. */
static void nothing_asked_for_changes_nothing(void **state)
{
    (void)state;
    static uint32_t plain[3][RIG_LINE];
    struct optics o;
    struct schedule_line line;
    open_optics(&o, box_scene(LO, HI));
    o.rig->setup.noise_on = 1;
    o.rig->setup.range_sigma_m = 0.003;
    o.rig->setup.noise_key = rng_key(1, RNG_RANGE);
    o.rig->setup.range_max_m = 5.5;
    for (int geo = 0; geo < 2; geo++) {
        o.rig->setup.layout = geo ? LINE_GEO : LINE_POLAR;
        o.rig->setup.detect = NULL;
        uint32_t n = shoot_line(&o, 40, &line);
        memcpy(plain[0], o.rig->block.a, n * sizeof(uint32_t));
        memcpy(plain[1], o.rig->block.b, n * sizeof(uint32_t));
        memcpy(plain[2], o.rig->block.c, n * sizeof(uint32_t));
        o.rig->setup.detect = &o.detect;
        assert_int_equal(shoot_line(&o, 40, &line), o.rig->block.n_points);
        assert_memory_equal(plain[0], o.rig->block.a, n * sizeof(uint32_t));
        assert_memory_equal(plain[1], o.rig->block.b, n * sizeof(uint32_t));
        assert_memory_equal(plain[2], o.rig->block.c, n * sizeof(uint32_t));
    }
    close_optics(&o);
}

/* A room whose ceiling and more is out of range: those shots keep their scheduled angles and a range of 0 to the bit,
 * whatever noise there is; the others don't. */
static void noise_never_touches_empty_shots(void **state)
{
    (void)state;
    static uint32_t plain[3][RIG_LINE];
    struct optics o;
    struct schedule_line line;
    open_optics(&o, box_scene(LO, HI));
    const struct instrument k = {.mirror_sigma_rad = 1e-3, .pan_sigma_rad = 1e-3, .mirror_key = 5, .pan_key = 6};
    struct detect_ball ball = {.radius_m = 0.05, .factor = {1, 1, 1}};
    detect_ball_keys(&ball, 3);
    o.rig->setup.range_max_m = 4.0;
    o.rig->setup.noise_on = 1;
    o.rig->setup.range_sigma_m = 0.01;
    o.rig->setup.noise_key = rng_key(1, RNG_RANGE);
    o.rig->setup.detect = NULL;
    uint32_t n = shoot_line(&o, 40, &line), empty = 0, moved = 0;
    memcpy(plain[0], o.rig->block.a, n * sizeof(uint32_t));
    memcpy(plain[1], o.rig->block.b, n * sizeof(uint32_t));
    memcpy(plain[2], o.rig->block.c, n * sizeof(uint32_t));
    o.rig->setup.detect = &o.detect;
    o.detect.instrument = &k;
    o.detect.ball = &ball;
    shoot_line(&o, 40, &line);
    for (uint32_t i = 0; i < n; i++) {
        int same =
            o.rig->block.a[i] == plain[0][i] && o.rig->block.b[i] == plain[1][i] && o.rig->block.c[i] == plain[2][i];
        if (o.rig->block.echo[i] == 0) /* the beam may stray to where there is nothing: the angles are the schedule's */
            assert_true(o.rig->block.a[i] == 0 && o.rig->block.b[i] == plain[1][i] && o.rig->block.c[i] == plain[2][i]);
        empty += o.rig->block.echo[i] == 0;
        moved += o.rig->block.echo[i] != 0 && !same;
    }
    assert_true(empty > 500 && moved > 500 && empty + moved == n);
    close_optics(&o);
}

/* A mirror on a body that moves: turned by 45 degrees about z through (0, 2, 0), then 1 m ahead. Beams that meet it go
 * on to the wall at x = 6: the way there plus what is left, at right angles. */
static void a_mirror_that_moves(void **state)
{
    (void)state;
    static const double vertex[4][3] = {{-1, 2, -1}, {1, 2, -1}, {1, 2, 1}, {-1, 2, 1}};
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {0, 2, 3}};
    static const uint16_t label[2] = {6, 6};
    struct optics o;
    struct scene *body;
    struct bvh *bvh;
    struct sh_err err;
    struct schedule_line line;
    struct scene_surface named[7] = {{.object = ""}};
    const double centre[3] = {0, 2, 0};
    open_optics(&o, box_scene(LO, HI));
    surface_table_free(&o.table);
    assert_int_equal(surface_table_alloc(7, &o.table, &err), 0);
    for (int i = 0; i < 6; i++)
        o.table.surface[i].reflectance = 0.5;
    o.table.surface[6].mirror = 1.0;
    o.detect.ghost_label = 7;
    if (scene_from_arrays(&(struct scene_arrays){vertex, 4, triangle, 2, label, named, 7}, &body, &err) != 0 ||
        bvh_create(body, centre, 100.0, 1, NULL, &bvh, &err) != 0)
        fail_msg("%s", err.text);
    struct cast_mover *m = &o.rig->setup.mover[0];
    *m = (struct cast_mover){.bvh = bvh, .centre_m = {0, 2, 0}, .radius_m = 1.5};
    pose_heading(atan(1.0), m->rotation); /* clockwise: the mirror's plane is then y - 3 = -x */
    for (int i = 0; i < 3; i++)
        m->shift_m[i] = centre[i] - m->rotation[3 * i + 1] * 2.0 + (i == 1);
    o.rig->setup.n_movers = 1;
    o.rig->spec.pan_udeg_s = 0;
    o.rig->spec.pan_stop_udeg = 0;
    schedule_start(&o.rig->segment, &o.rig->spec);
    schedule_get_line(&o.rig->segment, 0, &line);
    cast_some(o.rig, &line, 500, 1); /* straight ahead */
    /* from (0.5, 0.25) along y to y = 2.5 on the plane; dir (0, 1, 0) becomes (-1, 0, 0): to the wall at x = -4 */
    assert_int_equal(o.rig->block.label[0], 7 + 0);
    near_range(o.rig, 0, 2.25L + 4.5L);
    close_optics(&o);
    bvh_free(bvh);
    scene_free(body);
}

/* A plate on a body, met from its front; with the body turned by 180 degrees in its place, from its back. */
static void which_side_of_a_body_is_met(void **state)
{
    (void)state;
    static const double vertex[4][3] = {{-1, 3, -1}, {1, 3, -1}, {1, 3, 1}, {-1, 3, 1}}, centre[3] = {0, 3, 0};
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {0, 2, 3}};
    struct optics o;
    struct scene *body;
    struct bvh *bvh;
    struct sh_err err;
    struct schedule_line line;
    struct schedule_run run;
    struct cast_hit hit[1 + CAST_MAX_DEPTH];
    open_optics(&o, box_scene(LO, HI));
    if (scene_from_arrays(&(struct scene_arrays){vertex, 4, triangle, 2, NULL, NULL, 0}, &body, &err) != 0 ||
        bvh_create(body, centre, 100.0, 1, NULL, &bvh, &err) != 0)
        fail_msg("%s", err.text);
    o.rig->spec.pan_udeg_s = 0;
    schedule_start(&o.rig->segment, &o.rig->spec);
    schedule_get_line(&o.rig->segment, 0, &line);
    schedule_get_run(&o.rig->segment, &line, 500, 1, &run); /* straight ahead */
    o.rig->setup.n_movers = 1;
    for (int turned = 0; turned < 2; turned++) {
        struct cast_mover *m = &o.rig->setup.mover[0];
        *m = (struct cast_mover){.bvh = bvh, .centre_m = {0, 3, 0}, .radius_m = 1.5};
        pose_heading(turned ? 4.0 * atan(1.0) : 0.0, m->rotation);
        m->shift_m[1] = turned ? 6.0 : 0.0;
        assert_int_equal(caster_meet(o.rig->caster, &o.rig->setup, &run, hit), 1);
        assert_int_equal(hit[0].body, 1);
        assert_int_equal(hit[0].front, !turned);
        assert_true(fabs(hit[0].range_m - 2.75) < 1e-9 && fabs(hit[0].cosine - 1.0) < 1e-9);
    }
    close_optics(&o);
    bvh_free(bvh);
    scene_free(body);
}

/* What lies below the threshold is not met, just as it has no echo: of a room whose walls are seen to 4 m. */
static void what_is_too_faint_is_not_met(void **state)
{
    (void)state;
    static struct cast_hit hit[RIG_LINE * (1 + CAST_MAX_DEPTH)];
    const struct detect_signal_spec spec = {.n_reaches = 1, .reach = {{0.5, 4.0}}, .threshold_snr = 8.0, .sharp = 1};
    struct detect_signal signal;
    struct optics o;
    struct schedule_line line;
    struct schedule_run run;
    struct sh_err err;
    uint32_t at = 0;
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), SH_OK);
    open_optics(&o, box_scene(LO, HI));
    o.detect.signal = &signal;
    const uint32_t n = shoot_line(&o, 40, &line);
    schedule_get_run(&o.rig->segment, &line, line.cast0, n, &run);
    const uint32_t met = caster_meet(o.rig->caster, &o.rig->setup, &run, hit);
    for (uint32_t i = 0; i < n; i++) {
        if (o.rig->block.echo[i] == 0) continue;
        assert_true(at < met && hit[at].pulse == i);
        at++;
    }
    assert_int_equal(at, met);
    assert_true(met > 500 && met < n - 500);
    close_optics(&o);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_mirror_shows_the_room_behind_it),
        cmocka_unit_test(facing_mirrors_end_at_the_depth),
        cmocka_unit_test(glass_in_a_mirror),
        cmocka_unit_test(a_pane_and_what_is_behind_it),
        cmocka_unit_test(one_of_a_pulse_s_echoes),
        cmocka_unit_test(echoes_that_do_not_fit),
        cmocka_unit_test(echoes_of_a_moving_head),
        cmocka_unit_test(what_is_too_near_is_one_echo),
        cmocka_unit_test(cuts_leave_no_trace),
        cmocka_unit_test(nothing_asked_for_changes_nothing),
        cmocka_unit_test(noise_never_touches_empty_shots),
        cmocka_unit_test(a_mirror_that_moves),
        cmocka_unit_test(which_side_of_a_body_is_met),
        cmocka_unit_test(what_is_too_faint_is_not_met),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
