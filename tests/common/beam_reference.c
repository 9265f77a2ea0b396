/* SPDX-License-Identifier: MIT */
#include "tests/common/beam_reference.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/common/aimed.h"

struct met {
    double range_m;
    uint32_t label;
};

static int by_range(const void *a, const void *b)
{
    const struct met *x = a, *y = b;
    return (x->range_m > y->range_m) - (x->range_m < y->range_m);
}

/* Sub-rays have equal energies: the i-th of n lies where (i + 1/2) / n of the energy is inside of it. */
static void spiral(double (*place)[2], int n)
{
    for (int i = 0; i < n; i++) {
        double inside = (i + 0.5) / n * (1.0 - exp(-2.0));
        double r = sqrt(-0.5 * log(1.0 - inside)), phi = i * M_PI * (3.0 - sqrt(5.0));
        place[i][0] = r * cos(phi);
        place[i][1] = r * sin(phi);
    }
}

static void across(const double d[3], double e1[3], double e2[3])
{
    int least = fabs(d[0]) < fabs(d[1]) ? 0 : 1;
    if (fabs(d[2]) < fabs(d[least])) least = 2;
    double length = 0.0;
    for (int i = 0; i < 3; i++) {
        e1[i] = (i == least) - d[least] * d[i];
        length += e1[i] * e1[i];
    }
    for (int i = 0; i < 3; i++)
        e1[i] /= sqrt(length);
    for (int i = 0; i < 3; i++)
        e2[i] = d[(i + 1) % 3] * e1[(i + 2) % 3] - d[(i + 2) % 3] * e1[(i + 1) % 3];
}

static uint32_t strongest_label(const struct met *m, uint32_t n)
{
    uint32_t best = 0, most = 0;
    for (uint32_t i = 0; i < n; i++) {
        uint32_t same = 0;
        for (uint32_t k = 0; k < n; k++)
            same += m[k].label == m[i].label;
        if (same > most) {
            most = same;
            best = m[i].label;
        }
        if (2 * same > n) break;
    }
    return best;
}

/* A pulse's sub-rays: the points where they begin, and their directions. */
struct rays {
    double p[3][BEAM_REF_RAYS], d[3][BEAM_REF_RAYS], range_m[BEAM_REF_RAYS];
    uint32_t triangle[BEAM_REF_RAYS];
};

static void cast_places(struct caster *c, const struct bvh *bvh, const struct beam *beam, const double station_m[3],
                        const double dir[3], double range_max_m, uint32_t n, double (*place)[2], struct rays *rays)
{
    double e1[3], e2[3];
    across(dir, e1, e2);
    for (uint32_t i = 0; i < n; i++) {
        double length = 0.0, x = place[i][0], y = place[i][1];
        for (int k = 0; k < 3; k++) {
            rays->p[k][i] = station_m[k] + beam->exit_radius_m * (x * e1[k] + y * e2[k]);
            rays->d[k][i] = dir[k] + beam->slope * (x * e2[k] - y * e1[k]);
            length += rays->d[k][i] * rays->d[k][i];
        }
        for (int k = 0; k < 3; k++)
            rays->d[k][i] /= sqrt(length);
    }
    const struct bvh_rays cast = {.n = n,
                                  .from.own = {rays->p[0], rays->p[1], rays->p[2]},
                                  .dir = {rays->d[0], rays->d[1], rays->d[2]},
                                  .range_max_m = range_max_m,
                                  .range_m = rays->range_m,
                                  .triangle = rays->triangle};
    caster_hits(c, bvh, &cast);
}

void beam_ref_pulse(struct caster *c, const struct bvh *bvh, const struct beam *beam, const double station_m[3],
                    const double dir[3], double range_max_m, struct beam_ref *out)
{
    enum { N = BEAM_REF_RAYS };
    static double place[N][2];
    static struct rays rays;
    static int known;
    uint32_t n = 0;
    struct met met[N];
    if (!known) spiral(place, N);
    known = 1;
    cast_places(c, bvh, beam, station_m, dir, range_max_m, N, place, &rays);
    for (int i = 0; i < N; i++)
        if (!isnan(rays.range_m[i])) met[n++] = (struct met){rays.range_m[i], bvh_scene(bvh)->label[rays.triangle[i]]};
    double least = INFINITY, most = -INFINITY;
    for (uint32_t i = 0; i < n; i++) {
        least = fmin(least, met[i].range_m);
        most = fmax(most, met[i].range_m);
    }
    int together = most - least <= beam->resolution_m; /* such returns are one echo, whatever their order */
    if (!together) qsort(met, n, sizeof *met, by_range);
    memset(out, 0, sizeof *out);
    out->partial = n < N;
    out->spread_m = n > 0 ? most - least : 0.0;
    for (uint32_t i = 0, end; i < n; i = end) {
        double sum = 0.0;
        for (end = i;
             end < n && (together || end == i || met[end].range_m - met[end - 1].range_m <= beam->resolution_m); end++)
            sum += met[end].range_m;
        if ((end - i) < BEAM_LEAST_ENERGY * N) {
            out->partial = 1;
            continue;
        }
        if (out->n == BEAM_REF_ECHOES) continue;
        out->echo[out->n++] = (struct beam_ref_echo){
            .range_m = sum / (end - i), .energy = (double)(end - i) / N, .label = strongest_label(met + i, end - i)};
    }
}

double beam_ref_plane_mean(const struct beam *beam, const double dir[3], const double n[3], double d)
{
    enum { STEPS = 40, TURN = 64 };
    long double sum = 0.0L, all = 0.0L;
    double e1[3], e2[3];
    beam_axes(dir, e1, e2);
    for (int i = 0; i <= STEPS; i++) {
        long double t = (long double)i / STEPS, rho = sqrtl(t);
        long double weight = expl(-2.0L * t) * (i == 0 || i == STEPS ? 1.0L : i % 2 == 1 ? 4.0L : 2.0L);
        for (int k = 0; k < TURN; k++) {
            long double x = rho * cosl(2.0L * (long double)M_PI * k / TURN);
            long double y = rho * sinl(2.0L * (long double)M_PI * k / TURN), top = d, along = 0.0L, length2 = 0.0L;
            for (int j = 0; j < 3; j++) {
                long double o = beam->exit_radius_m * (x * e1[j] + y * e2[j]);
                long double v = dir[j] + beam->slope * (x * e2[j] - y * e1[j]);
                top -= n[j] * o;
                along += n[j] * v;
                length2 += v * v;
            }
            sum += weight * top / along * sqrtl(length2);
            all += weight;
        }
    }
    return (double)(sum / all);
}

int beam_ref_plain(const struct beam_rig *rig, const double dir[3], struct beam_ref *out)
{
    enum { INSIDE = 80, RIM = 48, N = INSIDE + RIM };
    static double place[N][2];
    static struct rays rays;
    static int known;
    double least = INFINITY, most = -INFINITY, sum = 0.0;
    if (!known) spiral(place, INSIDE);
    for (int i = INSIDE; i < N && !known; i++) {
        place[i][0] = 0.93 * cos(2.0 * M_PI * i / RIM);
        place[i][1] = 0.93 * sin(2.0 * M_PI * i / RIM);
    }
    known = 1;
    cast_places(rig->caster, rig->bvh, &rig->beam.beam, rig->setup.station_m, dir, rig->setup.range_max_m, N, place,
                &rays);
    for (int i = 0; i < N; i++) {
        if (isnan(rays.range_m[i])) return 0;
        least = fmin(least, rays.range_m[i]);
        most = fmax(most, rays.range_m[i]);
        sum += i < INSIDE ? rays.range_m[i] : 0.0;
    }
    if (most - least > 0.005) return 0;
    *out = (struct beam_ref){.n = 1, .echo = {{sum / INSIDE, 1.0, rig->scene->label[rays.triangle[0]]}}};
    out->spread_m = most - least;
    return 1;
}

void beam_compare(struct beam_tally *t, const struct line_block *b, uint32_t *at, const struct beam_ref *ref)
{
    uint32_t first = *at, n = b->echo[first] >> 4;
    int mixed = ref->n > 1 || ref->partial;
    *at += n == 0 ? 1 : n;
    t->pulses++;
    t->mixed += (uint64_t)mixed;
    t->wrong += n != ref->n;
    t->wrong_mixed += n != ref->n && mixed;
    for (uint32_t k = 0; k < n && n == ref->n; k++) {
        double d = 1e-6 * b->a[first + k] - ref->echo[k].range_m;
        t->range2 += d * d;
        t->near2 += fabs(d) < 0.6 ? d * d : 0.0;
        t->off += fabs(d) >= 0.6;
        t->echoes++;
    }
}

int beam_rig_open(struct beam_rig *rig, struct scene *scene, const double station_m[3], const struct beam_view *view,
                  struct sh_err *err)
{
    const int64_t hz = 1000000, lines_hz = 100;
    memset(rig, 0, sizeof *rig);
    rig->scene = scene;
    struct schedule_spec spec = {.lines_uhz = lines_hz * hz,
                                 .prr_uhz = lines_hz * hz * view->pulses,
                                 .pan_udeg_s =
                                     llround((view->pan_stop_deg - view->pan_start_deg) * 1e6) * lines_hz / view->lines,
                                 .fov_min_udeg = llround(view->line_start_deg * 1e6),
                                 .sweep_udeg = llround((view->line_stop_deg - view->line_start_deg) * 1e6),
                                 .line_start_udeg = llround(view->line_start_deg * 1e6),
                                 .line_stop_udeg = llround(view->line_stop_deg * 1e6),
                                 .pan_start_udeg = llround(view->pan_start_deg * 1e6),
                                 .pan_stop_udeg = llround(view->pan_stop_deg * 1e6)};
    schedule_start(&rig->segment, &spec);
    beam_init(&rig->beam.beam, 0.007, 0.35e-3, 4e-9);
    beam_rings(BEAM_FINE_RINGS, &rig->beam.fine);
    rig->beam.max_echoes = LINE_MAX_ECHOES;
    struct georef_spec local = {.crs = GEOREF_LOCAL};
    memcpy(local.station_m, station_m, sizeof local.station_m);
    rig->setup = (struct cast_setup){.range_max_m = 2000.0,
                                     .mirror_counts = 0x1p32,
                                     .pan_counts = 0x1p32,
                                     .layout = LINE_POLAR,
                                     .range_scale_m = 1e-6,
                                     .xyz_scale = {1e-5, 1e-5, 1e-5}};
    memcpy(rig->setup.station_m, station_m, sizeof rig->setup.station_m);
    pose_heading(0.0, rig->setup.rotation);
    int rc = bvh_create(scene, 2, NULL, &rig->bvh, err);
    if (rc == SH_OK) rc = georef_create(&local, &rig->georef, err);
    if (rc == SH_OK) rc = caster_create(&rig->caster, err);
    if (rc == SH_OK) rc = line_block_alloc(&rig->block, view->pulses * LINE_MAX_ECHOES, err);
    if (rc == SH_OK)
        rc = cast_outlines(
            &(struct beam_outlines_spec){scene, station_m, &rig->beam.beam, rig->setup.range_max_m, NULL, NULL},
            rig->bvh, &rig->outlines, err);
    rig->setup.bvh = rig->bvh;
    rig->setup.georef = rig->georef;
    rig->beam.outlines = rig->outlines;
    return rc;
}

void beam_rig_close(struct beam_rig *rig)
{
    beam_outlines_free(rig->outlines);
    line_block_free(&rig->block);
    caster_free(rig->caster);
    georef_free(rig->georef);
    bvh_free(rig->bvh);
    scene_free(rig->scene);
}

void beam_rig_mode(struct beam_rig *rig, enum beam_mode mode, uint32_t rings)
{
    rig->setup.beam = mode == BEAM_SINGLE ? NULL : &rig->beam;
    rig->beam.mode = mode;
    beam_rings(rings, &rig->beam.pattern);
}

uint32_t beam_rig_line(struct beam_rig *rig, uint32_t l)
{
    struct schedule_line line;
    struct schedule_run run;
    schedule_get_line(&rig->segment, l, &line);
    schedule_get_run(&rig->segment, &line, line.cast0, (uint32_t)(line.cast_end - line.cast0), &run);
    return caster_cast(rig->caster, &rig->setup, &run, &rig->block);
}

void beam_rig_directions(struct beam_rig *rig, uint32_t l, double *dx, double *dy, double *dz)
{
    struct schedule_line line;
    struct schedule_run run;
    schedule_get_line(&rig->segment, l, &line);
    uint32_t n = (uint32_t)(line.cast_end - line.cast0);
    schedule_get_run(&rig->segment, &line, line.cast0, n, &run);
    aimed_directions(&run, rig->setup.rotation, &(struct vec3_out){dx, dy, dz});
}
