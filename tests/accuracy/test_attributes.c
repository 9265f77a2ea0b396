/* SPDX-License-Identifier: MIT */
/* Amplitudes against the range equation. Amplitude and width stay with their echo, whatever happens to it. */
#include "tests/accuracy/lit_plates.h"

/* A = rho cos i / rho_min(R), and rho_min goes with R^2: 20 dB less at ten times the range. */
static void amplitudes_follow_the_range_equation(void **state)
{
    (void)state;
    static const double ranges_m[] = {10.0, 30.0, 100.0, 300.0, 1000.0};
    static const enum beam_mode modes[] = {BEAM_SINGLE, BEAM_ADAPTIVE, BEAM_RINGS};
    for (int m = 0; m < 3; m++) {
        int16_t told[5];
        for (int r = 0; r < 5; r++) {
            struct lit l = {.near_m = ranges_m[r], .far_m = ranges_m[r] + 50.0, .rho = {0.4, 0.4}};
            const double least = 0.2 / 1e6; /* at 1 m: 20 % are just seen at 1,000 m */
            struct sh_err err;
            double d[3][4];
            open_lit(&l, plates(l.near_m, l.far_m, 1), &(const struct beam_view){0.0, 1.0, -3.0, -2.9, 2, 4}, least);
            if (line_block_alloc_attributes(&l.rig.block, &err) != 0) fail_msg("%s", err.text);
            l.rig.setup.pulse_m = l.rig.beam.beam.resolution_m;
            beam_rig_mode(&l.rig, modes[m], 4);
            beam_rig_line(&l.rig, 0);
            beam_rig_directions(&l.rig, 0, d[0], d[1], d[2]);
            const struct line_block *b = &l.rig.block;
            assert_int_equal(b->echo[0], 0x11);
            double range_m = l.near_m / d[1][0], want = 10.0 * log10(0.4 * d[1][0] / (least * range_m * range_m));
            told[r] = b->amplitude_cdb[0];
            assert_true(fabs(told[r] - 100.0 * want) < 0.51); /* rounded to 0.01 dB */
            close_lit(&l);
        }
        assert_true(abs(told[0] - told[2] - 2000) <= 1); /* a factor of 10; both are rounded */
        assert_true(abs(told[2] - told[4] - 2000) <= 1);
    }
}

/* A data sheet gives two reaches, but the air is clearer, and at short range light is lost. At a reach the sheet's own
 * target is at the threshold, apart from what the air changes. */
static void amplitudes_in_fog_and_at_short_range(void **state)
{
    (void)state;
    static const double rho[] = {0.1, 0.9};
    const double reach_m[] = {400.0, 900.0}, overlap_m = 3.0, fog_1_m = 1e-3;
    const struct detect_signal_spec spec = {.n_reaches = 2,
                                            .reach = {{0.1, 400.0}, {0.9, 900.0}},
                                            .threshold_snr = 8.0,
                                            .sharp = 1,
                                            .overlap_m = overlap_m,
                                            .extinction_1_m = -fog_1_m}; /* clearer, so that it is still seen */
    struct detect_signal signal;
    struct sh_err err;
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), 0);
    double range_m[3] = {400.0, 900.0, 2.0}, what[3] = {0.1, 0.9, 0.5}, amplitude[3];
    const uint64_t key[3] = {1, 2, 3};
    int16_t refl[3], cdb[3];
    const struct detect_echoes echoes = {
        .n = 3, .key = key, .range_m = range_m, .rho = what, .amplitude = amplitude, .refl_cdb = refl};
    detect_by_signal(&signal, &echoes);
    detect_amplitudes(&signal, &echoes, cdb);
    for (int k = 0; k < 2; k++) {
        double clear_db = 10.0 * log10(exp(2.0 * fog_1_m * reach_m[k]));
        assert_true(fabs(cdb[k] - 100.0 * clear_db) < 0.51);
    }
    /* by the line through both reaches: log rho_min = 2 log R + g */
    double g400 = log(rho[0] / (400.0 * 400.0)), g900 = log(rho[1] / (900.0 * 900.0));
    double g2 = g400 + (g900 - g400) * (2.0 - 400.0) / 500.0;
    double a = 0.5 * (1.0 - exp(-4.0 / 9.0)) * exp(2.0 * fog_1_m * 2.0) / (4.0 * exp(g2));
    assert_true(fabs(cdb[2] - 1000.0 * log10(a)) < 0.51);
}

/* If the detector has noise, amplitude and reflectance carry the same noise. Echoes that are sent are above the
 * threshold. */
static void amplitude_and_reflectance_agree(void **state)
{
    (void)state;
    enum { N = 4000 };
    static double range_m[N], rho[N], amplitude[N];
    static uint64_t key[N];
    static int16_t refl[N], cdb[N];
    const struct detect_signal_spec spec = {.n_reaches = 1, .reach = {{0.2, 300.0}}, .threshold_snr = 6.0, .seed = 11};
    struct detect_signal signal;
    struct sh_err err;
    uint32_t seen = 0, near = 0;
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), 0);
    for (uint32_t i = 0; i < N; i++) {
        range_m[i] = 200.0 + 0.05 * i;
        rho[i] = 0.2;
        key[i] = i;
    }
    const struct detect_echoes echoes = {
        .n = N, .key = key, .range_m = range_m, .rho = rho, .amplitude = amplitude, .refl_cdb = refl};
    detect_by_signal(&signal, &echoes);
    detect_amplitudes(&signal, &echoes, cdb);
    for (uint32_t i = 0; i < N; i++) {
        assert_int_equal(cdb[i] == LINE_AMPLITUDE_NONE, isnan(range_m[i]));
        if (isnan(range_m[i])) continue;
        double least_db = 10.0 * log10(0.2 * pow((200.0 + 0.05 * i) / 300.0, 2));
        assert_true(cdb[i] >= 0);
        assert_true(fabs(refl[i] - cdb[i] - 100.0 * least_db) < 1.01); /* each is rounded */
        seen++;
        near += cdb[i] < 20;
    }
    assert_true(seen > N / 4 && seen < N && near > 100);
}

/* ---- beside their echo */

/* Attributes of pulses on two plates, by plate. The nearer one is slanted. */
struct told {
    int16_t amplitude_cdb[2];
    uint16_t width_cns[2];
};

static struct told *tell(struct beam_rig *rig, uint32_t line, struct told told[16])
{
    const struct line_block *b = &rig->block;
    beam_rig_line(rig, line);
    memset(told, 0, 16 * sizeof told[0]);
    for (uint32_t i = 0, p = 0; i < b->n_points; i++) {
        if (i > 0 && (b->echo[i] & 15) <= 1) p++;
        if (b->echo[i] == 0) {
            assert_int_equal(b->amplitude_cdb[i], LINE_AMPLITUDE_NONE);
            assert_int_equal(b->width_cns[i], LINE_WIDTH_NONE);
            continue;
        }
        told[p].amplitude_cdb[b->label[i]] = b->amplitude_cdb[i];
        told[p].width_cns[b->label[i]] = b->width_cns[i];
    }
    return told;
}

/* Every echo that is sent has the attributes that it had when all were sent. Returns their number. */
static uint32_t same_as(const struct told all[16], const struct told now[16])
{
    uint32_t n = 0;
    for (int p = 0; p < 16; p++)
        for (int k = 0; k < 2; k++) {
            if (now[p].width_cns[k] == 0) continue;
            assert_int_equal(now[p].width_cns[k], all[p].width_cns[k]);
            assert_int_equal(now[p].amplitude_cdb[k], all[p].amplitude_cdb[k]);
            n++;
        }
    return n;
}

/* A plate at 20 m on the left of x = 0, slanted by 70 degrees, and one at 23 m behind it. */
static struct scene *slanted_front(void)
{
    const double vertex[8][3] = {{-1.0, 20.0 - 2.75, -1.0}, {0.0, 20.0, -1.0}, {0.0, 20.0, 1.0}, {-1.0, 17.25, 1.0},
                                 {-5.0, 23.0, -5.0},        {5.0, 23.0, -5.0}, {5.0, 23.0, 5.0}, {-5.0, 23.0, 5.0}};
    static const uint32_t triangle[4][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
    static const uint16_t label[4] = {FRONT, FRONT, BACK, BACK};
    static const struct scene_surface surface[2] = {{.object = "front"}, {.object = "back"}};
    return made_scene(&(struct scene_arrays){vertex, 8, triangle, 4, label, surface, 2});
}

/* Echoes are chosen, crowded out, folded in front of each other, or too far for the integers. Echoes that stay keep
 * their own attributes. */
static void attributes_stay_with_their_echo(void **state)
{
    (void)state;
    struct lit l = {.near_m = 20.0, .far_m = 23.0, .rho = {0.3, 0.5}};
    struct told all[16], now[16];
    struct sh_err err;
    uint32_t n[8] = {0}, several = 0;
    open_lit(&l, slanted_front(), &ACROSS, 0.01 / 400.0);
    beam_rig_mode(&l.rig, BEAM_ADAPTIVE, 4);
    beam_init(&l.rig.beam.beam, 0.007, 0.35e-3, 0.02e-9); /* so that parts differ in width */
    if (line_block_alloc_attributes(&l.rig.block, &err) != 0) fail_msg("%s", err.text);
    struct cast_setup *s = &l.rig.setup;
    s->pulse_m = l.rig.beam.beam.resolution_m;
    for (int detect = 0; detect < 2; detect++)
        for (uint32_t line = 0; line < ACROSS.lines; line++) {
            const struct cast_setup plain = *s;
            s->detect = detect ? &l.detect : NULL;
            tell(&l.rig, line, all);
            for (int p = 0; p < 16; p++) {
                if (all[p].width_cns[0] == 0 || all[p].width_cns[1] == 0) continue;
                several += all[p].width_cns[FRONT] > all[p].width_cns[BACK];
                assert_true(!detect || all[p].amplitude_cdb[FRONT] != all[p].amplitude_cdb[BACK]);
            }
            for (int select = BEAM_FIRST; select <= BEAM_STRONGEST; select++) {
                s->echoes = (enum beam_select)select;
                n[0] += same_as(all, tell(&l.rig, line, now));
            }
            s->echoes = BEAM_ALL;
            l.rig.beam.max_echoes = l.detect.max_echoes = 1;
            n[1] += same_as(all, tell(&l.rig, line, now));
            l.rig.beam.max_echoes = l.detect.max_echoes = LINE_MAX_ECHOES;
            /* further than 2^31 counts: the plate behind */
            s->layout = LINE_GEO;
            for (int k = 0; k < 3; k++)
                s->xyz_scale[k] = 21.5 / 0x1p31;
            n[2] += same_as(all, tell(&l.rig, line, now));
            for (int p = 0; p < 16; p++)
                assert_int_equal(now[p].width_cns[BACK], 0);
            *s = plain;
            if (!detect) continue;
            s->detect = &l.detect;
            /* pulses are 21.5 m of range apart: the plate behind is reported in front */
            l.detect.ambiguity = DETECT_FOLDED;
            struct schedule_segment segment = l.rig.segment;
            l.rig.segment.ns_quot = 143;
            l.rig.segment.ns_rem = 0;
            n[3] += same_as(all, tell(&l.rig, line, now));
            for (uint32_t i = 1; i < l.rig.block.n_points; i++)
                n[4] += l.rig.block.echo[i] == 0x22 && l.rig.block.label[i] == FRONT;
            l.rig.segment = segment;
            l.detect.ambiguity = DETECT_AMBIGUITY_NONE;
        }
    assert_true(several > 100 && n[0] > 1000 && n[1] > 1000 && n[2] > 300 && n[3] > 300 && n[4] > 30);
    close_lit(&l);
}

/* A block without room for attributes is filled as ever, with the same points. */
static void points_are_the_same_without(void **state)
{
    (void)state;
    struct lit l = {.near_m = 20.0, .far_m = 23.0, .rho = {0.3, 0.5}};
    static uint32_t a[2][256];
    struct sh_err err;
    open_lit(&l, slanted_front(), &ACROSS, 0.01 / 400.0);
    l.rig.setup.pulse_m = l.rig.beam.beam.resolution_m;
    beam_rig_mode(&l.rig, BEAM_ADAPTIVE, 4);
    for (int with = 0; with < 2; with++) {
        if (with && line_block_alloc_attributes(&l.rig.block, &err) != 0) fail_msg("%s", err.text);
        beam_rig_line(&l.rig, 30);
        assert_true(l.rig.block.n_points <= 256);
        memcpy(a[with], l.rig.block.a, l.rig.block.n_points * sizeof a[0][0]);
    }
    assert_memory_equal(a[0], a[1], sizeof a[0]);
    close_lit(&l);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(amplitudes_follow_the_range_equation), cmocka_unit_test(amplitudes_in_fog_and_at_short_range),
        cmocka_unit_test(amplitude_and_reflectance_agree),      cmocka_unit_test(attributes_stay_with_their_echo),
        cmocka_unit_test(points_are_the_same_without),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
