/* SPDX-License-Identifier: MIT */
/* Footprints and detection together: each echo of a pulse by itself, against values worked out by hand. */
#include "core/rng.h"
#include "tests/accuracy/block_copy.h"
#include "tests/accuracy/lit_plates.h"

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
                if (fabs(e.back[FRONT] / e.back[BACK] - 1.0) < 0.1) continue; /* nearly equal; below also with R^2 */
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

/* A pulse that may send one echo sends the one with more signal. The plate behind, three times as far, may return more
 * light and still have less signal. An echo below the threshold takes no room, so the other one is sent. */
static void of_a_crowd_the_strongest_signal_is_sent(void **state)
{
    (void)state;
    static const enum beam_mode modes[] = {BEAM_ADAPTIVE, BEAM_RINGS};
    const double least = 0.05 / 400.0;
    struct lit l = {.near_m = 20.0, .far_m = 60.0, .rho = {0.2, 0.8}};
    open_lit(&l, plates(l.near_m, l.far_m, 1), &ACROSS, least);
    l.rig.setup.max_echoes = 1;
    for (int m = 0; m < 2; m++) {
        uint32_t sent[2] = {0}, against = 0;
        beam_rig_mode(&l.rig, modes[m], BEAM_MAX_RINGS);
        for (uint32_t line = 0; line < ACROSS.lines; line++) {
            const struct line_block *b = lit_line(&l, line);
            assert_int_equal(b->n_points, ACROSS.pulses);
            for (uint32_t p = 0; p < ACROSS.pulses; p++) {
                struct edge e = at_edge(&l, l.d[0][p], l.d[1][p]);
                double a[2];
                for (int k = FRONT; k <= BACK; k++)
                    a[k] = e.back[k] / (least * e.range_m[k] * e.range_m[k]);
                const double slack = modes[m] == BEAM_RINGS ? RINGS_OFF : PARTS_OFF; /* of the footprint's energy */
                const double doubt[2] = {slack * l.rho[FRONT] / (least * 400.0),
                                         slack * l.rho[BACK] / (least * 3600.0)};
                if (fabs(a[FRONT] - a[BACK]) < doubt[FRONT] + doubt[BACK]) continue;
                const int want = a[BACK] > a[FRONT];
                if (fabs(a[want] - 1.0) < doubt[want] || fmin(e.front, 1.0 - e.front) < 0.05) continue;
                assert_int_equal(b->echo[p], a[want] > 1.0 ? 0x11 : 0);
                if (a[want] < 1.0) continue;
                assert_int_equal(b->label[p], want);
                sent[want]++;
                against += want == FRONT && e.back[BACK] > e.back[FRONT];
            }
        }
        assert_true(sent[FRONT] > 50 && sent[BACK] > 50 && against > 50);
    }
    close_lit(&l);
}

/* Two plates within the range resolution give one echo, at the mean weighted by what each returns, and with their
 * sum. */
static void a_mixed_pixel_leans_to_what_is_bright(void **state)
{
    (void)state;
    struct lit l = {.near_m = 20.0, .far_m = 20.3, .rho = {0.1, 0.8}};
    uint32_t mixed = 0;
    open_lit(&l, plates(l.near_m, l.far_m, 1), &ACROSS, 0.0);
    beam_rig_mode(&l.rig, BEAM_ADAPTIVE, 4);
    for (uint32_t line = 0; line < ACROSS.lines; line++) {
        const struct line_block *b = lit_line(&l, line);
        assert_int_equal(b->n_points, ACROSS.pulses);
        for (uint32_t p = 0; p < ACROSS.pulses; p++) {
            struct edge e = at_edge(&l, l.d[0][p], l.d[1][p]);
            double sum = e.back[FRONT] + e.back[BACK], want = e.range_m[FRONT] + 0.3 / l.d[1][p] * e.back[BACK] / sum;
            near_energy(linear(b, p), sum, 0.8, PARTS_OFF);
            /* weights are off by a part in 1,000 of the footprint, times 8: the plates' ratio of brightness */
            assert_true(fabs(1e-6 * b->a[p] - want) < 0.3 * 8e-3 + 1e-5);
            if (fabs(e.back[FRONT] / sum - 0.5) < 0.1) continue;
            assert_int_equal(b->label[p], e.back[BACK] > e.back[FRONT] ? BACK : FRONT);
            mixed += e.front > 0.05 && e.front < 0.95;
        }
    }
    assert_true(mixed > 100);
    close_lit(&l);
}

/* An echo is missing when its returned light is below the threshold: A = back / (least R^2) < 1. The other echo
 * stays. */
static void an_echo_drops_out_by_itself(void **state)
{
    (void)state;
    const double least = 0.09 / 400.0;
    struct lit l = {.near_m = 20.0, .far_m = 23.0, .rho = {0.3, 0.5}};
    uint32_t count[3] = {0};
    struct cast_counters before, after;
    open_lit(&l, plates(l.near_m, l.far_m, 1), &ACROSS, least);
    beam_rig_mode(&l.rig, BEAM_ADAPTIVE, 4);
    for (uint32_t line = 0; line < ACROSS.lines; line++) {
        uint32_t faint = 0, n_unsure = 0;
        caster_get_counters(l.rig.caster, &before);
        const struct line_block *b = lit_line(&l, line);
        caster_get_counters(l.rig.caster, &after);
        for (uint32_t p = 0, i = 0; p < ACROSS.pulses; p++) {
            struct edge e = at_edge(&l, l.d[0][p], l.d[1][p]);
            uint32_t n = b->echo[i] >> 4, first = i, want = 0, unsure = 0;
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
            n_unsure += unsure;
            if (unsure > 0) continue;
            assert_int_equal(n, want);
            count[n]++;
        }
        if (n_unsure == 0) assert_int_equal(after.faint - before.faint, faint);
    }
    assert_true(count[1] > 100 && count[2] > 100);
    close_lit(&l);
}

/* Angle noise moves the whole footprint. Ranges and energies are those of where the beam went, angles those of where it
 * was meant to go. */
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
        const struct vec3_out beams = {d[0], d[1], d[2]}, origins = {0};
        schedule_get_line(&l.rig.segment, number, &line);
        for (uint32_t p = 0; p < 16; p++) {
            mirror[p] = schedule_mirror_turn(&l.rig.segment, line.cast0 + p);
            pan[p] = schedule_pan_turn(&l.rig.segment, line.cast0 + p);
        }
        instrument_aim(&k, &(struct instrument_turns){line.cast0, 16, mirror, pan, 0}, &beams, &origins);
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

/* At 650 kHz the second plate lies behind the first zone, whose end is at R_u = 230.6 m. Folded, its echo is reported
 * at 260 - R_u, before the other; resolved, where it is. */
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_echo_has_its_own_reflectance),
        cmocka_unit_test(a_mixed_pixel_leans_to_what_is_bright),
        cmocka_unit_test(an_echo_drops_out_by_itself),
        cmocka_unit_test(angle_noise_moves_the_footprint),
        cmocka_unit_test(ball_noise_moves_each_echo),
        cmocka_unit_test(each_echo_is_folded_by_itself),
        cmocka_unit_test(of_a_crowd_the_strongest_signal_is_sent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
