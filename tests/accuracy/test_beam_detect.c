/* Footprints and detection together: each echo of a pulse by itself, against what can be written down. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/generate.h"
#include "core/rng.h"
#include "core/surface.h"
#include "tests/accuracy/beam_reference.h"

static const double STATION[3] = {0.0, 0.0, 0.0};

static void open_rig(struct beam_rig *rig, struct scene *scene, const struct beam_view *view)
{
    struct sh_err err;
    if (beam_rig_open(rig, scene, STATION, view, &err) != 0) fail_msg("%s", err.text);
}

/* ---- nothing asked for */

struct copy {
    uint32_t n, *a, *b, *c, *dt_ns;
    uint16_t *label;
    int16_t *refl_cdb;
    uint8_t *echo;
};

static void *twin(const void *from, size_t bytes)
{
    void *to = malloc(bytes);
    assert_non_null(to);
    return memcpy(to, from, bytes);
}

static void copy_block(const struct line_block *b, struct copy *to)
{
    uint32_t n = to->n = b->n_points;
    to->a = twin(b->a, n * sizeof *b->a);
    to->b = twin(b->b, n * sizeof *b->b);
    to->c = twin(b->c, n * sizeof *b->c);
    to->dt_ns = twin(b->dt_ns, n * sizeof *b->dt_ns);
    to->label = twin(b->label, n * sizeof *b->label);
    to->refl_cdb = twin(b->refl_cdb, n * sizeof *b->refl_cdb);
    to->echo = twin(b->echo, n);
}

static void free_copy(struct copy *c)
{
    free(c->a);
    free(c->b);
    free(c->c);
    free(c->dt_ns);
    free(c->label);
    free(c->refl_cdb);
    free(c->echo);
}

static void same_block(const struct line_block *b, const struct copy *c)
{
    assert_int_equal(b->n_points, c->n);
    assert_memory_equal(b->echo, c->echo, c->n);
    assert_memory_equal(b->label, c->label, c->n * sizeof *c->label);
    assert_memory_equal(b->dt_ns, c->dt_ns, c->n * sizeof *c->dt_ns);
    assert_memory_equal(b->refl_cdb, c->refl_cdb, c->n * sizeof *c->refl_cdb);
    assert_memory_equal(b->b, c->b, c->n * sizeof *c->b);
    assert_memory_equal(b->c, c->c, c->n * sizeof *c->c);
    assert_memory_equal(b->a, c->a, c->n * sizeof *c->a);
}

/* A railing, wires and leaves before a wall that is out of range in part: pulses of none, one and several echoes. */
static struct scene *railing(void)
{
    struct generate_bar bar[48];
    struct scene *scene;
    struct sh_err err;
    uint32_t n = 0;
    for (uint16_t k = 0; k < 48; k++) {
        double x = -4.7 + 0.2 * k, y = 6.0 + 0.3 * (k % 12);
        bar[n++] = (struct generate_bar){
            .a = {x, y, -2.0}, .b = {x + 0.3, y + 1.0, 2.0}, .diameter_m = k % 3 == 0 ? 0.003 : 0.02, .label = 1};
    }
    if (generate_bars(bar, n, 20.0, &scene, &err) != 0) fail_msg("%s", err.text);
    return scene;
}

/* Where detection asks for nothing, the beam's blocks are its own, entry by entry: noise, numbers, order. */
static void nothing_asked_for_changes_nothing(void **state)
{
    (void)state;
    const struct beam_view view = {-20.0, 20.0, -45.0, 45.0, 12, 3000};
    const struct cast_detect nothing = {.max_echoes = LINE_MAX_ECHOES};
    static const enum beam_mode modes[] = {BEAM_ADAPTIVE, BEAM_RINGS, BEAM_RINGS};
    struct pose_knot knots[2] = {{.t_ns = 0, .pose = {.quat = {1.0, 0.0, 0.0, 0.0}}},
                                 {.t_ns = 120000000,
                                  .pose = {.position_m = {0.003, 0.004, 0.002},
                                           .quat = {cos(0.1), 0.0, 0.0, sin(0.1)}}}}; /* the last mode's head moves */
    uint64_t several = 0, none = 0;
    struct beam_rig rig;
    open_rig(&rig, railing(), &view);
    rig.setup.range_max_m = 22.0;
    rig.setup.noise_on = 1;
    rig.setup.range_sigma_m = 0.003;
    rig.setup.range_sigma_ppm = 10.0;
    rig.setup.noise_key = rng_key(7, RNG_RANGE);
    rig.setup.knot = knots;
    for (int m = 0; m < 3; m++)
        for (int geo = 0; geo < 2; geo++)
            for (int select = BEAM_ALL; select <= BEAM_STRONGEST; select++) {
                beam_rig_mode(&rig, modes[m], 3);
                rig.setup.n_knots = m == 2 ? 2 : 0;
                rig.setup.layout = geo ? LINE_GEO : LINE_POLAR;
                rig.setup.echoes = (enum beam_select)select;
                for (uint32_t l = 0; l < view.lines; l += 3) {
                    struct copy own;
                    rig.setup.detect = NULL;
                    uint32_t echoes = beam_rig_line(&rig, l);
                    copy_block(&rig.block, &own);
                    rig.setup.detect = &nothing;
                    assert_int_equal(beam_rig_line(&rig, l), echoes);
                    same_block(&rig.block, &own);
                    for (uint32_t i = 0; i < own.n; i++) {
                        several += own.echo[i] >> 4 > 1;
                        none += own.echo[i] == 0;
                    }
                    free_copy(&own);
                }
            }
    assert_true(several > 1000 && none > 1000);
    beam_rig_close(&rig);
}

/* The noise of an echo is its own, whichever of the pulse's are sent: first, last and strongest are entries of all. */
static void selection_keeps_the_noise(void **state)
{
    (void)state;
    const struct beam_view view = {-20.0, 20.0, -45.0, 45.0, 4, 3000};
    uint64_t several = 0;
    struct beam_rig rig;
    open_rig(&rig, railing(), &view);
    rig.setup.noise_on = 1;
    rig.setup.range_sigma_m = 0.003;
    rig.setup.noise_key = rng_key(7, RNG_RANGE);
    beam_rig_mode(&rig, BEAM_ADAPTIVE, 3);
    for (uint32_t l = 0; l < view.lines; l++) {
        struct copy all;
        rig.setup.echoes = BEAM_ALL;
        beam_rig_line(&rig, l);
        copy_block(&rig.block, &all);
        for (int select = BEAM_FIRST; select <= BEAM_LAST; select++) {
            rig.setup.echoes = (enum beam_select)select;
            beam_rig_line(&rig, l);
            assert_int_equal(rig.block.n_points, view.pulses);
            for (uint32_t p = 0, i = 0; p < view.pulses; p++) {
                uint32_t n = all.echo[i] == 0 ? 1 : all.echo[i] >> 4;
                assert_int_equal(rig.block.a[p], all.a[select == BEAM_FIRST ? i : i + n - 1]);
                several += n > 1;
                i += n;
            }
        }
        free_copy(&all);
    }
    assert_true(several > 100);
    beam_rig_close(&rig);
}

/* ---- an edge between two plates */

/* Energy beyond a line at h of the unit disc: the Gaussian's strips across, each an error function long, by Simpson's
 * rule over x = -cos a, which has no corner at the disc's border. */
static double energy_beyond(double h)
{
    enum { STEPS = 2000 };
    double sum[2] = {0.0, 0.0}, from = acos(-fmin(1.0, fmax(-1.0, h)));
    for (int part = 0; part < 2; part++) {
        double a0 = part == 0 ? from : 0.0, step = (M_PI - a0) / STEPS;
        for (int i = 0; i <= STEPS; i++) {
            double a = a0 + i * step, x = -cos(a);
            double strip = exp(-2.0 * x * x) * erf(sqrt(2.0) * sin(a)) * sin(a);
            sum[part] += step * strip * (i == 0 || i == STEPS ? 1.0 : i % 2 == 1 ? 4.0 : 2.0);
        }
    }
    return sum[0] / sum[1];
}

enum { FRONT, BACK };

/* Left of x = 0 a plate at near_m, behind it another one, or on the right only. */
static struct scene *plates(double near_m, double far_m, int whole_back)
{
    double vertex[8][3], half = 0.1 * far_m;
    static const uint32_t triangle[4][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
    static const uint16_t label[4] = {FRONT, FRONT, BACK, BACK};
    static const struct scene_surface surface[2] = {{.object = "front"}, {.object = "back"}};
    struct scene *scene;
    struct sh_err err;
    for (int v = 0; v < 8; v++) {
        int back = v / 4, right = v % 4 == 1 || v % 4 == 2;
        vertex[v][0] = right ? (back ? half : 0.0) : back && !whole_back ? 0.0 : -half;
        vertex[v][1] = back ? far_m : near_m;
        vertex[v][2] = v % 4 >= 2 ? half : -half;
    }
    if (scene_from_arrays((const double(*)[3])vertex, 8, triangle, 4, label, surface, 2, &scene, &err) != 0)
        fail_msg("%s", err.text);
    return scene;
}

/* A rig with a signal: reflectances of both plates, and rho_min at 1 m (0: everything is seen). */
struct lit {
    struct beam_rig rig;
    struct surface_table table;
    struct detect_signal signal;
    struct cast_detect detect;
    double near_m, far_m, rho[2];
};

static void open_lit(struct lit *l, struct scene *scene, const struct beam_view *view, double least_at_1_m)
{
    struct sh_err err;
    const struct detect_signal_spec spec = {
        .n_reaches = 1, .reach = {{0.9, sqrt(0.9 / fmax(least_at_1_m, 1e-12))}}, .threshold_snr = 8.0, .sharp = 1};
    open_rig(&l->rig, scene, view);
    if (surface_table_alloc(2, &l->table, &err) != 0 || detect_signal_set_up(&spec, &l->signal, &err) != 0)
        fail_msg("%s", err.text);
    for (int i = 0; i < 2; i++)
        l->table.surface[i].reflectance = l->rho[i];
    l->detect = (struct cast_detect){
        .surfaces = &l->table, .signal = &l->signal, .ghost_label = 2, .max_echoes = LINE_MAX_ECHOES};
    l->rig.setup.detect = &l->detect;
}

static void close_lit(struct lit *l)
{
    surface_table_free(&l->table);
    beam_rig_close(&l->rig);
}

/* What a pulse along d meets: energy on the front plate, and what comes back of both, slope included. */
struct edge {
    double front, back[2], range_m[2];
};

static struct edge at_edge(const struct lit *l, double dx, double dy)
{
    struct edge e;
    e.front = energy_beyond(dx / dy * l->near_m / beam_radius(&l->rig.beam.beam, l->near_m));
    e.back[FRONT] = e.front * l->rho[FRONT] * dy;
    e.back[BACK] = (1.0 - e.front) * l->rho[BACK] * dy;
    e.range_m[FRONT] = l->near_m / dy;
    e.range_m[BACK] = l->far_m / dy;
    return e;
}

static double linear(const struct line_block *b, uint32_t i)
{
    return pow(10.0, 1e-3 * b->refl_cdb[i]);
}

/* Reflectances are told in 0.01 dB: 0.12 % of themselves. The edge lies off its place in the footprint by a part in
 * 1,000 of the radius (the view's slopes). Of 18 rings' 1,027 sub-rays, 37 lie on one line through the centre: an edge
 * along it has half of them on the wrong side, 1.8 %. */
#define PARTS_OFF 1e-3
#define RINGS_OFF 0.02
static void near_energy(double told, double want, double rho, double slack)
{
    if (!(fabs(told - want) < 0.0012 * want + slack * rho)) fail_msg("reflectance %.5f, not %.5f", told, want);
}

static const struct beam_view ACROSS = {0.0, 0.01, -0.03, 0.03, 60, 16};

static void each_echo_has_its_own_reflectance(void **state)
{
    (void)state;
    struct lit l = {.near_m = 20.0, .far_m = 23.0, .rho = {0.1, 0.8}};
    static const enum beam_mode modes[] = {BEAM_ADAPTIVE, BEAM_RINGS};
    static const double slack[] = {PARTS_OFF, RINGS_OFF};
    double d[3][16];
    open_lit(&l, plates(l.near_m, l.far_m, 1), &ACROSS, 0.0);
    for (int m = 0; m < 2; m++) {
        uint32_t several = 0, turned = 0;
        beam_rig_mode(&l.rig, modes[m], BEAM_MAX_RINGS);
        for (uint32_t line = 0; line < ACROSS.lines; line++) {
            const struct line_block *b = &l.rig.block;
            beam_rig_directions(&l.rig, line, d[0], d[1], d[2]);
            l.rig.setup.echoes = BEAM_STRONGEST;
            beam_rig_line(&l.rig, line);
            uint16_t strongest[16];
            memcpy(strongest, b->label, sizeof strongest);
            l.rig.setup.echoes = BEAM_ALL;
            beam_rig_line(&l.rig, line);
            for (uint32_t p = 0, i = 0; p < ACROSS.pulses; p++) {
                struct edge e = at_edge(&l, d[0][p], d[1][p]);
                uint32_t n = b->echo[i] >> 4, first = i;
                i += n;
                if (n != 2) continue;
                several++;
                for (uint32_t k = FRONT; k <= BACK; k++) {
                    assert_int_equal(b->label[first + k], k);
                    near_energy(linear(b, first + k), e.back[k], l.rho[k], slack[m]);
                    assert_true(fabs(1e-6 * b->a[first + k] - e.range_m[k]) < 1e-3 * 0.01 * e.range_m[k]);
                }
                if (fabs(e.back[FRONT] / e.back[BACK] - 1.0) < 0.1) continue; /* R^2 as well: 23 m */
                double signal[2] = {e.back[FRONT] / pow(e.range_m[FRONT], 2), e.back[BACK] / pow(e.range_m[BACK], 2)};
                if (fabs(signal[FRONT] / signal[BACK] - 1.0) < 0.1) continue;
                assert_int_equal(strongest[p], signal[BACK] > signal[FRONT] ? BACK : FRONT);
                turned += (signal[BACK] > signal[FRONT]) != (e.front < 0.5);
            }
        }
        assert_true(several > 100 && turned > 10);
    }
    close_lit(&l);
}

/* Two plates within the range resolution: one echo, at the mean weighted by what comes back of each, and its sum. */
static void a_mixed_pixel_leans_to_what_is_bright(void **state)
{
    (void)state;
    struct lit l = {.near_m = 20.0, .far_m = 20.3, .rho = {0.1, 0.8}};
    double d[3][16];
    uint32_t mixed = 0;
    open_lit(&l, plates(l.near_m, l.far_m, 1), &ACROSS, 0.0);
    beam_rig_mode(&l.rig, BEAM_ADAPTIVE, 4);
    for (uint32_t line = 0; line < ACROSS.lines; line++) {
        const struct line_block *b = &l.rig.block;
        beam_rig_directions(&l.rig, line, d[0], d[1], d[2]);
        beam_rig_line(&l.rig, line);
        assert_int_equal(b->n_points, ACROSS.pulses);
        for (uint32_t p = 0; p < ACROSS.pulses; p++) {
            struct edge e = at_edge(&l, d[0][p], d[1][p]);
            double sum = e.back[FRONT] + e.back[BACK], want = e.range_m[FRONT] + 0.3 / d[1][p] * e.back[BACK] / sum;
            near_energy(linear(b, p), sum, 0.8, PARTS_OFF);
            /* the weights are off by a part in 1,000 of the footprint, eight times as bright as the darker plate */
            assert_true(fabs(1e-6 * b->a[p] - want) < 0.3 * 8e-3 + 1e-5);
            if (fabs(e.back[FRONT] / sum - 0.5) < 0.1) continue;
            assert_int_equal(b->label[p], e.back[BACK] > e.back[FRONT] ? BACK : FRONT);
            mixed += e.front > 0.05 && e.front < 0.95;
        }
    }
    assert_true(mixed > 100);
    close_lit(&l);
}

/* An echo stays away when what comes back of it is below the threshold: A = back / (least R^2) < 1; the other stays,
 * and keeps its place among random numbers. */
static void an_echo_drops_out_by_itself(void **state)
{
    (void)state;
    const double least = 0.09 / 400.0;
    struct lit l = {.near_m = 20.0, .far_m = 23.0, .rho = {0.3, 0.5}};
    double d[3][16];
    uint32_t count[3] = {0};
    struct cast_counters before, after;
    open_lit(&l, plates(l.near_m, l.far_m, 1), &ACROSS, least);
    beam_rig_mode(&l.rig, BEAM_ADAPTIVE, 4);
    for (uint32_t line = 0; line < ACROSS.lines; line++) {
        const struct line_block *b = &l.rig.block;
        uint32_t faint = 0, unsure = 0;
        beam_rig_directions(&l.rig, line, d[0], d[1], d[2]);
        caster_get_counters(l.rig.caster, &before);
        beam_rig_line(&l.rig, line);
        caster_get_counters(l.rig.caster, &after);
        for (uint32_t p = 0, i = 0; p < ACROSS.pulses; p++) {
            struct edge e = at_edge(&l, d[0][p], d[1][p]);
            uint32_t n = b->echo[i] >> 4, first = i, want = 0;
            i += n == 0 ? 1 : n;
            for (uint32_t k = FRONT; k <= BACK; k++) {
                double a = e.back[k] / (least * e.range_m[k] * e.range_m[k]), energy = k ? 1.0 - e.front : e.front;
                /* a part in 1,000 of the footprint at the threshold, and at the least energy of an echo */
                unsure += fabs(a - 1.0) < 0.01 || fabs(energy - 0.01) < 0.001;
                faint += energy >= 0.01 && a < 1.0;
                if (energy < 0.01 || a < 1.0 || unsure > 0) continue;
                assert_true(want < n);
                assert_int_equal(b->label[first + want], k);
                want++;
            }
            if (unsure > 0) continue;
            assert_int_equal(n, want);
            count[n]++;
        }
        if (unsure == 0) assert_int_equal(after.faint - before.faint, faint);
    }
    assert_true(count[1] > 100 && count[2] > 100);
    close_lit(&l);
}

/* Angle noise moves the beam, footprint and all: ranges and energies are those of where it went, angles those of where
 * it was meant to go. */
static void angle_noise_moves_the_footprint(void **state)
{
    (void)state;
    struct lit l = {.near_m = 20.0, .far_m = 23.0, .rho = {0.4, 0.4}};
    const struct instrument k = {.pan_sigma_rad = 1e-4, .mirror_key = 3, .pan_key = 4};
    uint32_t several = 0, moved = 0;
    open_lit(&l, plates(l.near_m, l.far_m, 1), &ACROSS, 0.0);
    l.detect.instrument = &k;
    beam_rig_mode(&l.rig, BEAM_ADAPTIVE, 4);
    for (uint32_t number = 0; number < ACROSS.lines; number++) {
        struct schedule_line line;
        const struct line_block *b = &l.rig.block;
        double mirror[16], pan[16], d[3][16];
        const struct instrument_beams beams = {.sx = d[0], .sy = d[1], .sz = d[2]};
        schedule_get_line(&l.rig.segment, number, &line);
        for (uint32_t p = 0; p < 16; p++) {
            mirror[p] = schedule_mirror_turn(&l.rig.segment, line.cast0 + p);
            pan[p] = schedule_pan_turn(&l.rig.segment, line.cast0 + p);
        }
        instrument_aim(&k, line.cast0, 16, mirror, pan, &beams);
        beam_rig_line(&l.rig, number);
        for (uint32_t p = 0, i = 0; p < ACROSS.pulses; p++) {
            struct edge e = at_edge(&l, d[0][p], d[1][p]);
            uint32_t n = b->echo[i] >> 4, first = i;
            i += n;
            for (uint32_t j = first; j < i; j++) {
                uint32_t which = b->label[j];
                double turn = pan[p] - floor(pan[p]);
                assert_true(fabs((double)b->c[j] * 0x1p-32 - turn) < 1e-9);
                near_energy(linear(b, j), e.back[which], 0.4, PARTS_OFF);
                moved += fabs(tan(2.0 * M_PI * pan[p]) - d[0][p] / d[1][p]) > 5e-5;
            }
            several += n == 2;
        }
    }
    assert_true(several > 100 && moved > 100);
    close_lit(&l);
}

/* Ball noise moves each echo by itself, within the ball. */
static void ball_noise_moves_each_echo(void **state)
{
    (void)state;
    struct lit l = {.near_m = 20.0, .far_m = 23.0, .rho = {0.4, 0.4}};
    struct detect_ball ball = {.radius_m = 0.02, .factor = {1, 1, 1}};
    uint32_t several = 0;
    double apart = 0.0;
    detect_ball_keys(&ball, 3);
    open_lit(&l, plates(l.near_m, l.far_m, 1), &ACROSS, 0.0);
    beam_rig_mode(&l.rig, BEAM_ADAPTIVE, 4);
    l.rig.setup.layout = LINE_GEO;
    for (uint32_t line = 0; line < ACROSS.lines; line++) {
        const struct line_block *b = &l.rig.block;
        struct copy clean;
        l.detect.ball = NULL;
        beam_rig_line(&l.rig, line);
        copy_block(b, &clean);
        l.detect.ball = &ball;
        beam_rig_line(&l.rig, line);
        assert_int_equal(b->n_points, clean.n);
        assert_memory_equal(b->echo, clean.echo, clean.n);
        for (uint32_t i = 0; i < clean.n; i++) {
            double off[3] = {1e-5 * (int32_t)(b->a[i] - clean.a[i]), 1e-5 * (int32_t)(b->b[i] - clean.b[i]),
                             1e-5 * (int32_t)(b->c[i] - clean.c[i])};
            double far = sqrt(off[0] * off[0] + off[1] * off[1] + off[2] * off[2]);
            assert_true(far > 0.0 && far < 0.02 + 2e-5);
            if ((b->echo[i] & 15) < 2) continue;
            several++;
            apart += fabs(off[1] - 1e-5 * (int32_t)(b->b[i - 1] - clean.b[i - 1])) / 0.02;
        }
        free_copy(&clean);
    }
    assert_true(several > 100);
    /* the mean difference of two coordinates in unit balls is 36/70; 4 of its errors are 0.15 */
    assert_true(fabs(apart / several - 36.0 / 70.0) < 0.15);
    close_lit(&l);
}

/* At 650 kHz the second plate lies behind the first zone, whose end is at R_u = 230.6 m: folded, its echo is told at
 * 260 - R_u, before the other; resolved, where it is. */
static void each_echo_is_folded_by_itself(void **state)
{
    (void)state;
    const struct beam_view view = {0.0, 0.01, -0.01, 0.01, 40, 6500};
    struct lit l = {.near_m = 200.0, .far_m = 260.0, .rho = {0.4, 0.4}};
    const double zone_m = 0.5 * 299792458.0 / 650e3;
    uint32_t several = 0;
    open_lit(&l, plates(l.near_m, l.far_m, 1), &view, 0.0);
    beam_rig_mode(&l.rig, BEAM_ADAPTIVE, 4);
    l.detect.zones = 2;
    for (int folded = 0; folded < 2; folded++)
        for (uint32_t line = 10; line < 30; line++) {
            const struct line_block *b = &l.rig.block;
            l.detect.ambiguity = folded ? DETECT_FOLDED : DETECT_RESOLVED;
            beam_rig_line(&l.rig, line);
            for (uint32_t i = 0; i < b->n_points; i++) {
                double told = 1e-6 * b->a[i];
                double want = b->label[i] == FRONT ? 200.0 : folded ? 260.0 - zone_m : 260.0;
                assert_true(b->echo[i] != 0 && fabs(told - want) < 0.01 * 0.01 * 260.0);
                if ((b->echo[i] & 15) < 2) continue;
                assert_true(b->a[i] > b->a[i - 1]);
                assert_int_equal(b->label[i], folded ? FRONT : BACK);
                several++;
            }
        }
    assert_true(several > 1000);
    close_lit(&l);
}

/* A pane on the left, its border free, and a wall behind all of it: of the wall's echo, a part has passed the pane
 * there and back. Without a signal there are the same echoes. */
static void a_footprint_on_the_border_of_glass(void **state)
{
    (void)state;
    struct lit l = {.near_m = 20.0, .far_m = 23.0, .rho = {0.1, 0.5}};
    static const enum beam_mode modes[] = {BEAM_ADAPTIVE, BEAM_RINGS};
    double d[3][16];
    open_lit(&l, plates(l.near_m, l.far_m, 1), &ACROSS, 0.0);
    l.table.surface[FRONT].glass = 0.8;
    l.table.has_optics = 1;
    l.detect.depth = 2;
    for (int m = 0; m < 4; m++) {
        uint32_t several = 0, pure = 0;
        l.detect.signal = m < 2 ? &l.signal : NULL;
        beam_rig_mode(&l.rig, modes[m % 2], BEAM_MAX_RINGS);
        for (uint32_t line = 0; line < ACROSS.lines; line++) {
            const struct line_block *b = &l.rig.block;
            beam_rig_directions(&l.rig, line, d[0], d[1], d[2]);
            beam_rig_line(&l.rig, line);
            for (uint32_t p = 0, i = 0; p < ACROSS.pulses; p++) {
                struct edge e = at_edge(&l, d[0][p], d[1][p]);
                uint32_t n = b->echo[i] >> 4, first = i;
                i += n;
                if (fabs(e.front - 0.01) > 0.002) assert_int_equal(n, e.front > 0.01 ? 2 : 1);
                assert_int_equal(b->label[i - 1], BACK);
                double wall = (1.0 - e.front + 0.64 * e.front) * 0.5 * d[1][p];
                several += n == 2;
                pure += e.front > 0.999;
                if (m >= 2) continue;
                near_energy(linear(b, i - 1), wall, 0.5, RINGS_OFF);
                if (n == 2) near_energy(linear(b, first), e.back[FRONT], 0.1, RINGS_OFF);
            }
        }
        assert_true(several > 100 && pure > 100);
    }
    close_lit(&l);
}

/* Outlines where one kind of surface ends. */
static void outline_kinds(struct lit *l)
{
    uint16_t kind[2];
    struct sh_err err;
    beam_outlines_free(l->rig.outlines);
    if (surface_kinds(&l->table, kind, &err) != 0 ||
        cast_outlines(l->rig.scene, l->rig.bvh, STATION, &l->rig.beam.beam, l->rig.setup.range_max_m, kind,
                      &l->rig.outlines, &err) != 0)
        fail_msg("%s", err.text);
    l->rig.beam.outlines = l->rig.outlines;
}

/* Two surfaces in one plane, with corners in common (a part of a wall) or without (a foil on it): what comes back of a
 * footprint on both is the sum, of which the brighter one gives the label. Without a difference there is no outline. */
static void surfaces_mix_within_a_plane(void **state)
{
    (void)state;
    static const double gap_m[] = {0.0, 1e-7};
    double d[3][16];
    for (int free_edge = 0; free_edge < 2; free_edge++)
        for (int same = 0; same < 2; same++) {
            struct lit l = {.near_m = 20.0, .far_m = 20.0 + gap_m[free_edge], .rho = {0.1, same ? 0.1 : 0.8}};
            struct cast_counters counters;
            uint32_t mixed = 0;
            open_lit(&l, plates(l.near_m, l.far_m, 0), &ACROSS, 0.0);
            outline_kinds(&l);
            beam_rig_mode(&l.rig, BEAM_ADAPTIVE, 4);
            for (uint32_t line = 0; line < ACROSS.lines; line++) {
                const struct line_block *b = &l.rig.block;
                beam_rig_directions(&l.rig, line, d[0], d[1], d[2]);
                beam_rig_line(&l.rig, line);
                assert_int_equal(b->n_points, ACROSS.pulses);
                for (uint32_t p = 0; p < ACROSS.pulses; p++) {
                    struct edge e = at_edge(&l, d[0][p], d[1][p]);
                    near_energy(linear(b, p), e.back[FRONT] + e.back[BACK], 0.8, PARTS_OFF);
                    mixed += e.front > 0.05 && e.front < 0.95;
                }
            }
            caster_get_counters(l.rig.caster, &counters);
            assert_true(mixed > 100);
            assert_true(same ? counters.outlined == 0 : counters.outlined > 100);
            close_lit(&l);
        }
}

/* The same with a mirror in place of the pane: what is seen in it is the wall behind the head, 40 m and 12 m away, as a
 * ghost. */
static struct scene *mirror_and_two_walls(void)
{
    double vertex[12][3];
    uint32_t triangle[6][3];
    static const uint16_t label[6] = {FRONT, FRONT, BACK, BACK, BACK, BACK};
    static const struct scene_surface surface[2] = {{.object = "front"}, {.object = "back"}};
    static const double y[] = {20.0, 23.0, -12.0};
    struct scene *scene;
    struct sh_err err;
    for (int v = 0; v < 12; v++) {
        int right = v % 4 == 1 || v % 4 == 2;
        vertex[v][0] = right ? (v < 4 ? 0.0 : 5.0) : -5.0;
        vertex[v][1] = y[v / 4];
        vertex[v][2] = v % 4 >= 2 ? 5.0 : -5.0;
    }
    for (uint32_t t = 0; t < 6; t++)
        for (uint32_t v = 0; v < 3; v++)
            triangle[t][v] = t / 2 * 4 + (v == 0 ? 0 : v + t % 2);
    if (scene_from_arrays((const double(*)[3])vertex, 12, (const uint32_t(*)[3])triangle, 6, label, surface, 2, &scene,
                          &err) != 0)
        fail_msg("%s", err.text);
    return scene;
}

/* All light of a footprint that lies on surfaces comes back. Pulse 0 of line 30 goes along an axis of the scene, to the
 * digit: some of its sub-rays have a component of -1e-22 or so, which must not cost those that are packed with them
 * (core/cast/kernels.c). */
static void no_light_is_lost(void **state)
{
    (void)state;
    struct lit l = {.near_m = 20.0, .far_m = 23.0, .rho = {0.5, 0.5}};
    open_lit(&l, mirror_and_two_walls(), &ACROSS, 0.0);
    beam_rig_mode(&l.rig, BEAM_RINGS, BEAM_MAX_RINGS);
    for (uint32_t line = 0; line < ACROSS.lines; line++) {
        const struct line_block *b = &l.rig.block;
        beam_rig_line(&l.rig, line);
        for (uint32_t p = 0, i = 0; p < ACROSS.pulses; p++) {
            double sum = 0.0;
            for (uint32_t end = i + (b->echo[i] >> 4); i < end; i++)
                sum += linear(b, i);
            assert_true(fabs(sum - 0.5) < 0.01 * 0.5); /* what is too little for an echo: 1 % */
        }
    }
    close_lit(&l);
}

static void a_footprint_on_the_border_of_a_mirror(void **state)
{
    (void)state;
    struct lit l = {.near_m = 20.0, .far_m = 23.0, .rho = {0.0, 0.5}};
    double d[3][16];
    uint32_t several = 0, pure = 0;
    struct sh_err err;
    open_lit(&l, mirror_and_two_walls(), &ACROSS, 0.0);
    bvh_free(l.rig.bvh); /* rays begin at the mirror */
    if (bvh_create(l.rig.scene, STATION, 50.0, 1, NULL, &l.rig.bvh, &err) != 0) fail_msg("%s", err.text);
    l.rig.setup.bvh = l.rig.bvh;
    l.table.surface[FRONT].mirror = 0.8;
    l.table.has_optics = 1;
    l.detect.depth = 2;
    beam_rig_mode(&l.rig, BEAM_ADAPTIVE, BEAM_MAX_RINGS);
    for (uint32_t line = 0; line < ACROSS.lines; line++) {
        const struct line_block *b = &l.rig.block;
        beam_rig_directions(&l.rig, line, d[0], d[1], d[2]);
        beam_rig_line(&l.rig, line);
        for (uint32_t p = 0, i = 0; p < ACROSS.pulses; p++) {
            struct edge e = at_edge(&l, d[0][p], d[1][p]);
            uint32_t n = b->echo[i] >> 4;
            for (uint32_t end = i + n; i < end; i++) {
                int ghost = b->label[i] == 2 + BACK;
                assert_true(ghost || b->label[i] == BACK);
                near_energy(linear(b, i), ghost ? 0.64 * e.front * 0.5 * d[1][p] : e.back[BACK], 0.5, RINGS_OFF);
                assert_true(fabs(1e-6 * b->a[i] - (ghost ? 52.0 : 23.0) / d[1][p]) < 5e-4);
            }
            several += n == 2;
            pure += n == 1 && b->label[i - 1] == 2 + BACK;
        }
    }
    assert_true(several > 100 && pure > 100);
    close_lit(&l);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_asked_for_changes_nothing),
        cmocka_unit_test(selection_keeps_the_noise),
        cmocka_unit_test(each_echo_has_its_own_reflectance),
        cmocka_unit_test(a_mixed_pixel_leans_to_what_is_bright),
        cmocka_unit_test(an_echo_drops_out_by_itself),
        cmocka_unit_test(angle_noise_moves_the_footprint),
        cmocka_unit_test(ball_noise_moves_each_echo),
        cmocka_unit_test(each_echo_is_folded_by_itself),
        cmocka_unit_test(a_footprint_on_the_border_of_glass),
        cmocka_unit_test(surfaces_mix_within_a_plane),
        cmocka_unit_test(no_light_is_lost),
        cmocka_unit_test(a_footprint_on_the_border_of_a_mirror),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
