/* Widths of echoes against the spread of many sub-rays, worked out here from the definition in core/beam.h; amplitudes
 * against the range equation; and both beside their echo, whatever becomes of that. */
#include "tests/accuracy/lit_plates.h"

#define CNS_PER_M (2e11 / 299792458.0)
#define FULL2     (8.0 * M_LN2) /* square of the full width at half maximum of a Gaussian, in sigma^2 */

/* Pulses close together, so that they all look at the same. */
static const struct beam_view AHEAD = {0.0, 0.001, -0.001, 0.001, 4, 4};
enum { MOST_CUTS = 3 };

/* A plane n . p = d seen from the origin, as far as its points lie beyond all cuts: c . p >= e. */
struct face {
    double n[3], d;
    int n_cuts;
    double cut[MOST_CUTS][4];
};

/* Mean and variance of the ranges of sub-rays on a Vogel spiral, equal energy each, that meet the face; their share. */
static double spread(const struct beam *beam, const double dir[3], const struct face *f, double *mean, double *variance)
{
    enum { RAYS = 40000 };
    double e1[3], e2[3], sum = 0.0, sum2 = 0.0, first = NAN;
    int met = 0;
    beam_axes(dir, e1, e2);
    for (int i = 0; i < RAYS; i++) {
        double inside = (i + 0.5) / RAYS * (1.0 - exp(-2.0)), rho = sqrt(-0.5 * log(1.0 - inside));
        double x = rho * cos(2.399963229728653 * i), y = rho * sin(2.399963229728653 * i);
        double o[3], v[3], along = 0.0, at = 0.0, v2 = 0.0;
        for (int k = 0; k < 3; k++) {
            o[k] = beam->exit_radius_m * (x * e1[k] + y * e2[k]);
            v[k] = dir[k] + beam->slope * (x * e2[k] - y * e1[k]);
            along += f->n[k] * v[k];
            at += f->n[k] * o[k];
            v2 += v[k] * v[k];
        }
        double t = (f->d - at) / along, range_m = t * sqrt(v2);
        int is_on = 1;
        for (int c = 0; c < f->n_cuts; c++) {
            const double *cut = f->cut[c];
            is_on &= cut[0] * (o[0] + t * v[0]) + cut[1] * (o[1] + t * v[1]) + cut[2] * (o[2] + t * v[2]) >= cut[3];
        }
        if (!is_on) continue;
        if (met++ == 0) first = range_m;
        sum += range_m - first;
        sum2 += (range_m - first) * (range_m - first);
    }
    *mean = first + sum / met;
    *variance = sum2 / met - sum / met * sum / met;
    return (double)met / RAYS;
}

static double width_of(double pulse_m, double variance)
{
    return CNS_PER_M * sqrt(pulse_m * pulse_m + FULL2 * variance);
}

/* A quad on the plane through (0, range, 0) that is slanted by i, about an axis that is turned by `about` from
 * vertical; its corners u, v of the plane's axes, the second one along the slant. */
static struct scene *slanted(double range_m, double i, double about, const double u[2], const double v[2],
                             struct face *face)
{
    const double across[3] = {sin(about), 0.0, cos(about)}; /* in the plane, across the beam */
    const double up[3] = {cos(about) * cos(i), sin(i), -sin(about) * cos(i)};
    double vertex[4][3];
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {0, 2, 3}};
    static const uint16_t label[2] = {0, 0};
    static const struct scene_surface surface = {.object = "wall"};
    struct scene *scene;
    struct sh_err err;
    for (int k = 0; k < 4; k++)
        for (int x = 0; x < 3; x++)
            vertex[k][x] = (x == 1 ? range_m : 0.0) + u[k == 1 || k == 2] * across[x] + v[k >= 2] * up[x];
    *face = (struct face){.n = {across[1] * up[2] - across[2] * up[1], across[2] * up[0] - across[0] * up[2],
                                across[0] * up[1] - across[1] * up[0]}};
    face->d = face->n[1] * range_m;
    if (scene_from_arrays((const double(*)[3])vertex, 4, triangle, 2, label, &surface, 1, &scene, &err) != 0)
        fail_msg("%s", err.text);
    return scene;
}

static void open_attributes(struct beam_rig *rig, struct scene *scene, const struct beam_view *view, double pulse_s)
{
    struct sh_err err;
    open_rig(rig, scene, view);
    beam_init(&rig->beam.beam, 0.007, 0.35e-3, pulse_s);
    rig->setup.pulse_m = rig->beam.beam.resolution_m;
    rig->setup.range_max_m = 3000.0;
    if (line_block_alloc_attributes(&rig->block, &err) != 0) fail_msg("%s", err.text);
}

/* Half a count, and 0.02 % of 40,000 rays' spread. Beyond that the closed form is first order in b = s tan i, and short
 * by b^2 / 2: E sin^2 rho^2 = 0.1715, so the series of 1 / (1 - b rho sin phi) has (3 * 0.0701 - 0.1715^2) / 0.1715 /
 * 2 = 0.53 b^2 of the standard deviation. */
static void check_width(double told_cns, double want_cns, double b, double slack)
{
    if (!(fabs(told_cns - want_cns) < 0.5 + (2e-4 + slack + 0.7 * b * b) * want_cns))
        fail_msg("width %.0f, not %.3f of 0.01 ns", told_cns, want_cns);
}

/* What is off beyond the wire's rounding, as a share of the width. */
static double excess(double told_cns, double want_cns)
{
    return fmax(0.0, fabs(told_cns - want_cns) - 0.5) / want_cns;
}

/* One ray stands for the footprint; with rings the sub-rays have spreads of their own, so that few do. */
static void a_slanted_wall_widens_the_echo(void **state)
{
    (void)state;
    static const double ranges_m[] = {10.0, 100.0, 800.0}, slants_deg[] = {0.0, 30.0, 60.0, 80.0, 85.0, 89.0, 89.8};
    static const uint32_t rings[] = {0, 0, 1, 4, BEAM_MAX_RINGS};
    double worst = 0.0;
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 7; k++) {
            struct beam_rig rig;
            struct face face;
            double i = slants_deg[k] * M_PI / 180.0, half = 0.3 * ranges_m[r], mean, variance, d[3][4];
            struct scene *scene =
                slanted(ranges_m[r], i, 0.7, (const double[]){-half, half}, (const double[]){-half, half}, &face);
            open_attributes(&rig, scene, &AHEAD, 0.2e-9);
            for (int m = 0; m < 5; m++) {
                beam_rig_mode(&rig, m == 0 ? BEAM_ADAPTIVE : BEAM_RINGS, rings[m]);
                beam_rig_line(&rig, 1);
                beam_rig_directions(&rig, 1, d[0], d[1], d[2]);
                /* at 89.8 degrees and 10 m the returns of rings lie apart, and are several echoes */
                if (m > 0 && 2.0 * beam_radius(&rig.beam.beam, ranges_m[r]) * tan(i) > 0.03) continue;
                const double dir[3] = {d[0][0], d[1][0], d[2][0]};
                spread(&rig.beam.beam, dir, &face, &mean, &variance);
                double want = width_of(rig.beam.beam.resolution_m, variance);
                check_width(rig.block.width_cns[0], want < 65535.0 ? want : 65535.0, rig.beam.beam.slope * tan(i), 0.0);
                assert_int_equal(rig.block.echo[0], 0x11);
                assert_int_equal(rig.block.amplitude_cdb[0], LINE_AMPLITUDE_NONE);
                worst = fmax(worst, excess(rig.block.width_cns[0], want < 65535.0 ? want : 65535.0));
            }
            beam_rig_close(&rig);
        }
    print_message("# slanted walls, 10 to 800 m, 0 to 89.8 degrees: widths within %.2f %% and half of 0.01 ns\n",
                  1e2 * worst);
}

/* An edge, or a corner, cuts the footprint: the echo is of a part, and as wide as that. */
static void a_part_has_its_own_width(void **state)
{
    (void)state;
    static const double slants_deg[] = {0.0, 60.0, 80.0}, abouts[] = {0.0, 0.5, 1.2};
    double worst = 0.0;
    uint32_t cut = 0;
    for (int s = 0; s < 3; s++)
        for (int a = 0; a < 3; a++)
            for (int k = 0; k < 24; k++) {
                struct beam_rig rig;
                struct face face;
                const double range_m = 100.0, i = slants_deg[s] * M_PI / 180.0, w = 0.0178;
                /* edges at all places of the footprint: one, or (k >= 12) two that meet in it */
                double u = (k % 12 - 5.7) / 6.5 * w, v = k < 12 ? -9.0 : 0.4 * w / cos(i) * sin(k);
                struct scene *scene =
                    slanted(range_m, i, abouts[a], (const double[]){u, 9.0}, (const double[]){v, 9.0}, &face);
                double mean, variance, d[3][4];
                const double across[3] = {sin(abouts[a]), 0.0, cos(abouts[a])};
                const double up[3] = {cos(abouts[a]) * cos(i), sin(i), -sin(abouts[a]) * cos(i)};
                face.n_cuts = 2;
                for (int x = 0; x < 3; x++) {
                    face.cut[0][x] = across[x];
                    face.cut[1][x] = up[x];
                }
                face.cut[0][3] = u;
                face.cut[1][3] = v + up[1] * range_m;
                open_attributes(&rig, scene, &AHEAD, 0.2e-9);
                beam_rig_mode(&rig, BEAM_ADAPTIVE, 4);
                beam_rig_line(&rig, 1);
                beam_rig_directions(&rig, 1, d[0], d[1], d[2]);
                const double dir[3] = {d[0][0], d[1][0], d[2][0]};
                double share = spread(&rig.beam.beam, dir, &face, &mean, &variance);
                if (share > 0.015) {
                    double want = width_of(rig.beam.beam.resolution_m, variance);
                    assert_int_equal(rig.block.echo[0], 0x11);
                    /* Where lines cross, 469 places stand for the disc: an edge along a part of n places may take half
                     * a row, of the root of n, to either side. */
                    check_width(rig.block.width_cns[0], want, 0.0, k < 12 ? 0.003 : 0.4 / sqrt(469.0 * share));
                    worst = fmax(worst, excess(rig.block.width_cns[0], want));
                    cut += share < 0.985;
                }
                beam_rig_close(&rig);
            }
    assert_true(cut > 100);
    print_message("# parts of footprints on slanted walls: widths within %.2f %% and half of 0.01 ns\n", 1e2 * worst);
}

/* Two plates closer than the pulse: shares e and 1 - e at 0.3 m are one echo, wider by e (1 - e) 0.3^2. */
static void a_mixed_pixel_is_wide(void **state)
{
    (void)state;
    struct lit l = {.near_m = 20.0, .far_m = 20.3, .rho = {0.5, 0.5}};
    uint32_t mixed = 0;
    double d[3][16];
    struct sh_err err;
    open_lit(&l, plates(l.near_m, l.far_m, 1), &ACROSS, 0.0);
    l.rig.setup.pulse_m = l.rig.beam.beam.resolution_m;
    if (line_block_alloc_attributes(&l.rig.block, &err) != 0) fail_msg("%s", err.text);
    for (int detect = 0; detect < 2; detect++) {
        if (!detect) l.rig.setup.detect = NULL;
        if (detect) l.rig.setup.detect = &l.detect;
        beam_rig_mode(&l.rig, BEAM_ADAPTIVE, 4);
        for (uint32_t line = 0; line < ACROSS.lines; line++) {
            beam_rig_directions(&l.rig, line, d[0], d[1], d[2]);
            beam_rig_line(&l.rig, line);
            for (uint32_t p = 0; p < ACROSS.pulses; p++) {
                double e = at_edge(&l, d[0][p], d[1][p]).front;
                /* shares are off by a part in 1,000 of the footprint */
                double slack = FULL2 * 0.09 * 1.5e-3 / (2.0 * 0.36);
                if (e < 0.001 || e > 0.999) e = 1.0;
                check_width(l.rig.block.width_cns[p], width_of(l.rig.setup.pulse_m, e * (1.0 - e) * 0.09), 0.0, slack);
                mixed += e > 0.05 && e < 0.95;
            }
        }
    }
    assert_true(mixed > 200);
    close_lit(&l);
}

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
            if (b->echo[0] == 0) { /* the plates are a tenth of their range wide */
                close_lit(&l);
                fail_msg("nothing met at %g m", ranges_m[r]);
            }
            double range_m = l.near_m / d[1][0], want = 10.0 * log10(0.4 * d[1][0] / (least * range_m * range_m));
            told[r] = b->amplitude_cdb[0];
            assert_true(fabs(told[r] - 100.0 * want) < 0.51 + 0.5);
            close_lit(&l);
        }
        assert_true(abs(told[0] - told[2] - 2000) <= 1); /* a factor of 10 */
        assert_true(abs(told[2] - told[4] - 2000) <= 1);
    }
}

/* Thresholds of a data sheet with two reaches, in another air, with light lost at short range: at a reach the sheet's
 * own target is at the threshold but for that. */
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

/* With a noisy detector amplitude and reflectance carry the same noise, and what is told is above the threshold. */
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
    detect_amplitudes(NULL, &echoes, cdb);
    for (uint32_t i = 0; i < N; i++)
        assert_int_equal(cdb[i], LINE_AMPLITUDE_NONE);
}

/* ---- beside their echo */

/* Of pulses on two plates, the nearer one slanted: by plate, what goes with it. */
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

/* Every echo that is told has what it had when all were. Returns how many. */
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

/* Left of x = 0 a plate at 20 m, slanted by 70 degrees; behind it one at 23 m. */
static struct scene *slanted_front(void)
{
    const double vertex[8][3] = {{-1.0, 20.0 - 2.75, -1.0}, {0.0, 20.0, -1.0}, {0.0, 20.0, 1.0}, {-1.0, 17.25, 1.0},
                                 {-5.0, 23.0, -5.0},        {5.0, 23.0, -5.0}, {5.0, 23.0, 5.0}, {-5.0, 23.0, 5.0}};
    static const uint32_t triangle[4][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
    static const uint16_t label[4] = {FRONT, FRONT, BACK, BACK};
    static const struct scene_surface surface[2] = {{.object = "front"}, {.object = "back"}};
    struct scene *scene;
    struct sh_err err;
    if (scene_from_arrays(vertex, 8, triangle, 4, label, surface, 2, &scene, &err) != 0) fail_msg("%s", err.text);
    return scene;
}

/* Chosen, crowded out, folded in front of each other, moved by noise, or too far for the integers: those that stay keep
 * their own. */
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
            /* pulses 21.5 m of range apart: what is behind is told in front */
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

/* A pane in front of a wall, 0.2 m apart: one echo, its width that of two returns; at 2 m two, each a pulse wide. */
static void glass_and_what_is_behind(void **state)
{
    (void)state;
    static const double apart_m[] = {0.2, 2.0};
    for (int k = 0; k < 2; k++)
        for (int mode = 0; mode < 2; mode++) {
            struct lit l = {.near_m = 20.0, .far_m = 20.0 + apart_m[k], .rho = {0.2, 0.5}};
            struct sh_err err;
            double d[3][16], pulse = CNS_PER_M * 0.5 * 299792458.0 * 4e-9;
            open_lit(&l, plates(l.near_m, l.far_m, 1), &(const struct beam_view){0.0, 0.01, -0.5, -0.4, 2, 16}, 1e-9);
            if (line_block_alloc_attributes(&l.rig.block, &err) != 0) fail_msg("%s", err.text);
            l.table.surface[FRONT].glass = 0.7;
            l.table.has_optics = 1;
            l.detect.depth = 1;
            l.rig.setup.pulse_m = l.detect.separation_m = l.rig.beam.beam.resolution_m;
            beam_rig_mode(&l.rig, mode ? BEAM_ADAPTIVE : BEAM_SINGLE, 4);
            beam_rig_line(&l.rig, 0);
            beam_rig_directions(&l.rig, 0, d[0], d[1], d[2]);
            const struct line_block *b = &l.rig.block;
            double near = 0.2 * d[1][0], far = 0.5 * d[1][0] * 0.7 * 0.7, sum = near + far;
            double want = width_of(l.rig.setup.pulse_m, near * far / (sum * sum) * 0.04);
            if (k == 0) {
                assert_int_equal(b->echo[0], 0x11);
                check_width(b->width_cns[0], want, 0.0, 1e-3);
            } else {
                assert_int_equal(b->echo[0], 0x21);
                for (int e = 0; e < 2; e++)
                    check_width(b->width_cns[e], pulse, 0.0, 1e-3);
                double by_db = 10.0 * log10(near / far) + 20.0 * log10(22.0 / 20.0);
                assert_true(fabs(b->amplitude_cdb[0] - b->amplitude_cdb[1] - 100.0 * by_db) < 2.0);
            }
            close_lit(&l);
        }
}

/* Behind a pane, and on a body that moves, only the incidence of a sub-ray is known: a slanted wall there is as wide.
 */
static void slanted_behind_glass_and_in_motion(void **state)
{
    (void)state;
    const double range_m = 100.0, slant = 75.0 * M_PI / 180.0;
    for (int moving = 0; moving < 2; moving++) {
        struct lit l = {.near_m = 20.0, .far_m = 20.0, .rho = {0.2, 0.5}};
        struct face face;
        struct sh_err err;
        struct bvh *body = NULL;
        double d[3][4], mean, variance;
        struct scene *wall =
            slanted(range_m, slant, 0.7, (const double[]){-9.0, 9.0}, (const double[]){-9.0, 9.0}, &face);
        double vertex[8][3];
        static const uint32_t triangle[4][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
        static const uint16_t label[4] = {BACK, BACK, FRONT, FRONT};
        static const struct scene_surface surface[2] = {{.object = "pane"}, {.object = "wall"}};
        struct scene *both;
        for (int v = 0; v < 8; v++) { /* the pane beside the beam, or in it */
            double side = v % 4 == 1 || v % 4 == 2 ? 1.0 : -1.0, up = v % 4 >= 2 ? 1.0 : -1.0;
            const double pane[3] = {side + (moving ? 8.0 : 0.0), 20.0, up};
            memcpy(vertex[v], v < 4 ? wall->vertex_m[v] : pane, sizeof vertex[v]);
        }
        if (scene_from_arrays((const double(*)[3])vertex + (moving ? 4 : 0), moving ? 4 : 8, triangle, moving ? 2 : 4,
                              moving ? label + 2 : label, surface, 2, &both, &err) != 0)
            fail_msg("%s", err.text);
        open_lit(&l, both, &AHEAD, 1e-9);
        beam_init(&l.rig.beam.beam, 0.007, 0.35e-3, 0.4e-9);
        if (line_block_alloc_attributes(&l.rig.block, &err) != 0) fail_msg("%s", err.text);
        l.table.surface[FRONT].glass = 0.7;
        l.table.has_optics = 1;
        l.detect.depth = moving ? 0 : 1;
        l.rig.setup.pulse_m = l.detect.separation_m = l.rig.beam.beam.resolution_m;
        if (moving) {
            const double origin_m[3] = {0.0, 0.0, 0.0};
            struct cast_mover *m = &l.rig.setup.mover[0];
            if (bvh_create(wall, origin_m, 3000.0, 1, NULL, &body, &err) != 0) fail_msg("%s", err.text);
            *m = (struct cast_mover){.bvh = body, .centre_m = {0.0, range_m, 0.0}, .radius_m = 20.0};
            cast_rotation(0.0, m->rotation);
            l.rig.setup.n_movers = 1;
        }
        beam_rig_mode(&l.rig, moving ? BEAM_RINGS : BEAM_ADAPTIVE, 4);
        beam_rig_line(&l.rig, 1);
        beam_rig_directions(&l.rig, 1, d[0], d[1], d[2]);
        const double dir[3] = {d[0][0], d[1][0], d[2][0]};
        spread(&l.rig.beam.beam, dir, &face, &mean, &variance);
        double want = width_of(l.rig.setup.pulse_m, variance);
        assert_int_equal(l.rig.block.echo[0], moving ? 0x11 : 0x21);
        assert_true(want > 1.4 * width_of(l.rig.setup.pulse_m, 0.0));
        /* with 61 sub-rays that lie the same all around */
        check_width(l.rig.block.width_cns[moving ? 0 : 1], want, 0.0, 1e-3);
        close_lit(&l);
        bvh_free(body);
        scene_free(wall);
    }
}

/* A block without room for them is filled as ever, with the same points. */
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
        cmocka_unit_test(a_slanted_wall_widens_the_echo),
        cmocka_unit_test(a_part_has_its_own_width),
        cmocka_unit_test(a_mixed_pixel_is_wide),
        cmocka_unit_test(amplitudes_follow_the_range_equation),
        cmocka_unit_test(amplitudes_in_fog_and_at_short_range),
        cmocka_unit_test(amplitude_and_reflectance_agree),
        cmocka_unit_test(attributes_stay_with_their_echo),
        cmocka_unit_test(glass_and_what_is_behind),
        cmocka_unit_test(slanted_behind_glass_and_in_motion),
        cmocka_unit_test(points_are_the_same_without),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
