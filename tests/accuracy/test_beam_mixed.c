/* SPDX-License-Identifier: MIT */
/* Several surfaces in one echo: every way of casting a footprint gives the mean of their ranges, weighted by the power
 * received from them. The reference sums the beam over small cells, in long double and with the range equation. */
#include "tests/accuracy/lit_plates.h"

/* Pulses straight ahead, over `half` radians on each side of the plate in front. */
enum { LINES = 9, PULSES = 4 };
static struct beam_view edge(double half)
{
    const double deg = half * 180.0 / M_PI;
    return (struct beam_view){-0.02, 0.02, -deg, deg, LINES, PULSES};
}

/* Two plates, each n . p = d with its own normal. The one in front lies where x < 0. */
struct two_plates {
    double n[2][3], d[2], rho[2];
};

/* Returns the range at which a ray meets a plate. */
static long double meet(const struct two_plates *t, int plate, const long double from[3], const long double dir[3])
{
    long double to = (long double)t->d[plate], along = 0.0L;
    for (int a = 0; a < 3; a++) {
        to -= (long double)t->n[plate][a] * from[a];
        along += (long double)t->n[plate][a] * dir[a];
    }
    return to / along;
}

/* A pulse must measure the mean range, and the reflectance that belongs to it. front is the share of the light that
 * meets the plate in front. */
struct sum {
    double mean_m, reflectance, front;
};

/* Sums the footprint of a pulse along dir, over cells of equal width in rho and phi. */
static struct sum sum_footprint(const struct beam *beam, const struct two_plates *t, const double dir[3])
{
    enum { RINGS = 120, PARTS = 240 };
    long double sum = 0.0L, first = 0.0L, light = 0.0L, in_front = 0.0L;
    double e1[3], e2[3];
    beam_axes(dir, e1, e2);
    for (int i = 0; i < RINGS; i++)
        for (int k = 0; k < PARTS; k++) {
            const long double rho = (i + 0.5L) / RINGS, phi = 2.0L * acosl(-1.0L) * (k + 0.5L) / PARTS;
            const long double x = rho * cosl(phi), y = rho * sinl(phi), energy = rho * expl(-2.0L * rho * rho);
            long double from[3], to[3], length = 0.0L;
            for (int a = 0; a < 3; a++) {
                from[a] = (long double)beam->exit_radius_m * (x * (long double)e1[a] + y * (long double)e2[a]);
                to[a] =
                    (long double)dir[a] + (long double)beam->slope * (x * (long double)e2[a] - y * (long double)e1[a]);
                length += to[a] * to[a];
            }
            for (int a = 0; a < 3; a++)
                to[a] /= sqrtl(length);
            long double range_m = meet(t, FRONT, from, to);
            const int plate = from[0] + range_m * to[0] < 0.0L ? FRONT : BACK;
            if (plate == BACK) range_m = meet(t, BACK, from, to);
            long double cosine = 0.0L;
            for (int a = 0; a < 3; a++)
                cosine += (long double)t->n[plate][a] * to[a];
            const long double power = energy * (long double)t->rho[plate] * cosine / (range_m * range_m);
            sum += power;
            first += power * range_m;
            light += energy;
            in_front += plate == FRONT ? energy : 0.0L;
        }
    const double mean_m = (double)(first / sum);
    return (struct sum){mean_m, (double)(sum / light) * mean_m * mean_m, (double)(in_front / light)};
}

/* Sums the footprints of all pulses. */
static void sum_pulses(struct lit *l, const struct two_plates *t, struct sum sum[LINES][PULSES])
{
    for (uint32_t line = 0; line < LINES; line++) {
        beam_rig_directions(&l->rig, line, l->d[0], l->d[1], l->d[2]);
        for (uint32_t p = 0; p < PULSES; p++)
            sum[line][p] = sum_footprint(&l->rig.beam.beam, t, (double[]){l->d[0][p], l->d[1][p], l->d[2][p]});
    }
}

/* Casts the view in a way, and compares. `slack` is the error of the light on a plate, as a share of the footprint.
 * Returns how many pulses meet both plates. */
static uint32_t check_way(struct lit *l, struct sum want[LINES][PULSES], double step_m, double slack, double *worst_m)
{
    uint32_t mixed = 0;
    for (uint32_t line = 0; line < LINES; line++) {
        const struct line_block *b = lit_line(l, line);
        assert_int_equal(b->n_points, PULSES);
        for (uint32_t p = 0; p < PULSES; p++) {
            const struct sum *w = &want[line][p];
            const double off_m = fabs(1e-6 * b->a[p] - w->mean_m);
            if (w->front < 0.02 || w->front > 0.98) continue;
            mixed++;
            *worst_m = fmax(*worst_m, off_m);
            if (!(off_m < slack * step_m + 1.2e-4))
                fail_msg("%.5f m, not %.5f m: step %.2f m, %.3f in front", 1e-6 * b->a[p], w->mean_m, step_m, w->front);
            assert_true(fabs(linear(b, p) / w->reflectance - 1.0) < 4.0 * slack + 2e-3);
        }
    }
    return mixed;
}

/* Shifts below BEAM_LEAST_SHIFT_M are left out, and the wire rounds. The light on a plate is exact to PARTS_OFF with
 * parts, and to RINGS_OFF with 18 rings; the reference's cells have as much as 1e-3. An echo that ignores distance lies
 * up to step / 4 * 2 step / R too far: 45 mm for 0.3 m at 1 m. */
static void plates_mix_by_received_power(void **state)
{
    (void)state;
    static const double range_m[] = {1.0, 3.0, 10.0}, step_m[] = {0.05, 0.1, 0.2, 0.3};
    static const enum beam_mode modes[] = {BEAM_ADAPTIVE, BEAM_RINGS};
    static const double slack[] = {2.0 * PARTS_OFF, RINGS_OFF};
    for (int r = 0; r < 3; r++)
        for (int s = 0; s < 4; s++) {
            struct lit l = {.near_m = range_m[r], .far_m = range_m[r] + step_m[s], .rho = {0.4, 0.5}};
            const struct two_plates t = {
                .n = {{0, 1, 0}, {0, 1, 0}}, .d = {l.near_m, l.far_m}, .rho = {l.rho[0], l.rho[1]}};
            const double radius_m = hypot(0.0035, 0.000175 * l.near_m);
            const struct beam_view view = edge(0.9 * radius_m / l.near_m);
            struct sum want[LINES][PULSES];
            double worst_m[2] = {0.0, 0.0};
            open_lit(&l, plates(l.near_m, l.far_m, 1), &view, 0.0);
            sum_pulses(&l, &t, want);
            for (int m = 0; m < 2; m++) {
                beam_rig_mode(&l.rig, modes[m], BEAM_MAX_RINGS);
                assert_true(check_way(&l, want, step_m[s], slack[m], &worst_m[m]) > 4);
            }
            print_message("# %4.1f m, step %.2f m: adaptive within %.3f mm, rings within %.3f mm\n", l.near_m,
                          step_m[s], 1e3 * worst_m[0], 1e3 * worst_m[1]);
            close_lit(&l);
        }
}

/* A floor of small triangles, 1 m below the station. */
static struct scene *floor_of_triangles(void)
{
    enum { N = 80 };
    static double vertex[(N + 1) * (N + 1)][3];
    static uint32_t triangle[2 * N * N][3];
    static uint16_t label[2 * N * N];
    static const struct scene_surface surface = {.object = "floor"};
    for (uint32_t i = 0; i <= N; i++)
        for (uint32_t j = 0; j <= N; j++) {
            double *v = vertex[i * (N + 1) + j];
            v[0] = 0.11 * (i - 0.5 * N);
            v[1] = 2.0 + 0.11 * j;
            v[2] = -1.0;
        }
    for (uint32_t i = 0, n = 0; i < N; i++)
        for (uint32_t j = 0; j < N; j++, n += 2) {
            const uint32_t a = i * (N + 1) + j, b = a + N + 1;
            memcpy(triangle[n], (uint32_t[]){a, b, b + 1}, sizeof triangle[n]);
            memcpy(triangle[n + 1], (uint32_t[]){a, b + 1, a + 1}, sizeof triangle[n]);
        }
    return made_scene(&(struct scene_arrays){(const double(*)[3])vertex, (N + 1) * (N + 1),
                                             (const uint32_t(*)[3])triangle, 2 * N * N, label, &surface, 1});
}

/* On one plane, distance has no part in the weights, whether a footprint is one ray or many. So a signal moves no range
 * there. With a beam of 15 mrad at 80 degrees and 5.8 m, 2 sigma^2 / R would be 3.6 mm. */
static void a_floor_does_not_move(void **state)
{
    (void)state;
    static const struct beam_view view = {-11.0, -9.0, -5.0, 5.0, 40, 16};
    static const enum beam_mode modes[] = {BEAM_ADAPTIVE, BEAM_RINGS};
    struct lit l = {.near_m = 1.0, .far_m = 1.0, .rho = {0.5, 0.5}};
    open_lit(&l, floor_of_triangles(), &view, 0.0);
    beam_init(&l.rig.beam.beam, 0.008, 0.015, 4e-9);
    for (int m = 0; m < 2; m++) {
        beam_rig_mode(&l.rig, modes[m], 4);
        for (uint32_t line = 0; line < view.lines; line++) {
            int32_t range[16];
            l.detect.signal = NULL;
            memcpy(range, lit_line(&l, line)->a, sizeof range);
            l.detect.signal = &l.signal;
            assert_int_equal(lit_line(&l, line)->n_points, 16);
            assert_memory_equal(range, l.rig.block.a, sizeof range);
        }
    }
    close_lit(&l);
}

/* Light from below range_min_m is not received, so only the plate behind is measured. */
static void too_near_a_plate_is_not_mixed(void **state)
{
    (void)state;
    struct lit l = {.near_m = 0.3, .far_m = 0.5, .rho = {0.5, 0.5}};
    static const enum beam_mode modes[] = {BEAM_ADAPTIVE, BEAM_RINGS};
    const struct beam_view view = edge(0.008);
    open_lit(&l, plates(l.near_m, l.far_m, 1), &view, 0.0);
    l.rig.setup.range_min_m = 0.4;
    for (int m = 0; m < 2; m++) {
        uint32_t mixed = 0;
        beam_rig_mode(&l.rig, modes[m], BEAM_MAX_RINGS);
        for (uint32_t line = 0; line < LINES; line++) {
            const struct line_block *b = lit_line(&l, line);
            for (uint32_t p = 0; p < PULSES; p++) {
                const struct edge e = at_edge(&l, l.d[0][p], l.d[1][p]);
                if (e.front < 0.05 || e.front > 0.95) continue;
                mixed++;
                assert_true(fabs(1e-6 * b->a[p] - e.range_m[BACK]) < 1e-4);
                near_energy(linear(b, p), e.back[BACK], 0.5, modes[m] == BEAM_RINGS ? RINGS_OFF : 2e-3);
            }
        }
        assert_true(mixed > 4);
    }
    close_lit(&l);
}

/* A pane in front of the plate behind, 0.3 m apart. Each ray has both. The pane sends 0.1 back, and the plate 0.8 of
 * the 0.9^2 that pass twice. */
static void a_pane_mixes_by_received_power(void **state)
{
    (void)state;
    struct lit l = {.near_m = 1.0, .far_m = 1.3, .rho = {0.1, 0.8}};
    const struct beam_view view = {-1.0, 1.0, -2.0, 2.0, LINES, PULSES};
    const double power[2] = {0.1, 0.81 * 0.8 / (1.3 * 1.3)};
    uint32_t both = 0;
    open_lit(&l, plates(l.near_m, l.far_m, 1), &view, 0.0);
    l.table.surface[FRONT].glass = 0.9;
    l.table.has_optics = 1;
    l.detect.depth = 2;
    l.detect.separation_m = 0.6;
    beam_rig_mode(&l.rig, BEAM_SINGLE, 0);
    for (uint32_t line = 0; line < LINES; line++) {
        const struct line_block *b = lit_line(&l, line);
        for (uint32_t p = 0; p < PULSES; p++) {
            if (b->n_points != PULSES || l.d[0][p] > -0.001) continue;
            both++;
            const double want_m = (1.0 + 0.3 * power[BACK] / (power[FRONT] + power[BACK])) / l.d[1][p];
            assert_true(fabs(1e-6 * b->a[p] - want_m) < 1e-5);
        }
    }
    assert_true(both > 10);
    close_lit(&l);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(plates_mix_by_received_power),
        cmocka_unit_test(a_floor_does_not_move),
        cmocka_unit_test(too_near_a_plate_is_not_mixed),
        cmocka_unit_test(a_pane_mixes_by_received_power),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
