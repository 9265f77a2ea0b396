/* SPDX-License-Identifier: MIT */
/* This measures the cost of effects that a configuration names but the scene doesn't need. It compares the cast as the
 * program sets it up with the plain cast of the same rays, which has none of the effects. Both casts run in turns, line
 * by line, in processor time of the thread. The median of the rounds' ratios must be within 5 % of 1.
 *
 *   build/tests/bench/plain */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/site/site.h"
#include "tests/bench/bench.h"
#include "tests/bench/pin.h"

enum { LINES = 100, ROUNDS = 41, MAX_SETS = 24, STATION = 2 };
static const double ALLOWED = 0.05;

struct plain_case {
    const char *name;
    int hall; /* if 0, the demo's house, from its living room */
    const char *set[MAX_SETS];
};

#define NO_SIGNAL     "signal.model=off", "signal.visibility_m=500"
#define NO_INSTRUMENT "instrument.collimation_deg=0", "instrument.trunnion_deg=0", "instrument.range_offset_m=0"
#define NO_NOISE      "noise.range=off", "noise.angle=off", "noise.ball.radius_m=0"
#define NO_GLASS      "optics.depth=4", "surfaces[0].material=*", "surfaces[0].reflectance=0.4"
static const struct plain_case CASES[] = {
    {"nothing asked for", 0, {NULL}},
    {"signal off", 0, {NO_SIGNAL}},
    {"instrument, all zero", 0, {NO_INSTRUMENT}},
    {"noise off", 0, {NO_NOISE}},
    {"optics of depth 4, no glass", 0, {NO_GLASS}},
    {"one zone of range", 0, {"head.ambiguity=none"}},
    {"all of these", 0, {NO_SIGNAL, NO_INSTRUMENT, NO_NOISE, NO_GLASS, "head.ambiguity=none"}},
    {"all of these, a hall", 1, {NO_SIGNAL, NO_INSTRUMENT, NO_NOISE, NO_GLASS, "head.ambiguity=none"}},
    {"beam auto, a hall without edges to cut a footprint", 1, {"beam.mode=auto"}},
};

/* The hall is 30 m x 20 m x 8 m, with walls of triangles of about 20 cm. No outline is seen from inside. */
static int write_hall(const char *path)
{
    static const double size_m[3] = {30.0, 20.0, 8.0}, low_m[3] = {-9.5, -7.8, 0.0};
    FILE *f = fopen(path, "w");
    unsigned long base = 1;
    if (f == NULL) return -1;
    for (int face = 0; face < 6; face++) {
        int across = face / 2, u = (across + 1) % 3, v = (across + 2) % 3;
        unsigned long nu = (unsigned long)(size_m[u] / 0.2), nv = (unsigned long)(size_m[v] / 0.2);
        for (unsigned long j = 0; j <= nv; j++)
            for (unsigned long i = 0; i <= nu; i++) {
                double p[3];
                p[across] = low_m[across] + (face % 2) * size_m[across];
                p[u] = low_m[u] + size_m[u] * (double)i / (double)nu;
                p[v] = low_m[v] + size_m[v] * (double)j / (double)nv;
                fprintf(f, "v %.9g %.9g %.9g\n", p[0], p[1], p[2]);
            }
        for (unsigned long j = 0; j < nv; j++)
            for (unsigned long i = 0; i < nu; i++) {
                unsigned long a = base + j * (nu + 1) + i, b = a + nu + 1;
                fprintf(f, "f %lu %lu %lu\nf %lu %lu %lu\n", a, a + 1, b + 1, a, b + 1, b);
            }
        base += (nu + 1) * (nv + 1);
    }
    return fclose(f);
}

struct run {
    struct site *site;
    struct config *cfg;
    struct cast_setup setup, plain;
    struct caster *caster;
    struct line_block block;
    struct bench_rays rays;
};

static int open_run(struct run *r, const struct plain_case *c, const char *hall, struct sh_err *err)
{
    char mesh[256];
    const char *set[MAX_SETS + 6];
    int n = 0;
    snprintf(mesh, sizeof mesh, "scene.meshes[0].file=%s", hall);
    if (c->hall) {
        set[n++] = mesh;
        set[n++] = "scene.meshes[0].up=z";
        set[n++] = "scene.anchor.source=explicit";
        set[n++] = "scene.anchor.lat_deg=52.5";
        set[n++] = "scene.anchor.lon_deg=13.4";
    }
    for (int i = 0; i < MAX_SETS && c->set[i] != NULL; i++)
        set[n++] = c->set[i];
    memset(r, 0, sizeof *r);
    r->cfg = calloc(1, sizeof *r->cfg);
    if (r->cfg == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    int rc = config_load("config/demo.yaml", set, n, r->cfg, err);
    if (rc == SH_OK) rc = site_load(r->cfg, NULL, &r->site, err);
    if (rc == SH_OK) rc = caster_create(&r->caster, err);
    if (rc == SH_OK) rc = line_block_alloc(&r->block, BENCH_LINE_PULSES * site_points_per_pulse(r->site), err);
    if (rc == SH_OK) rc = bench_rays_create(LINES, &r->rays, err);
    if (rc != SH_OK) return rc;
    site_cast_setup(r->site, STATION, &r->setup);
    r->plain = r->setup;
    r->plain.detect = NULL;
    r->plain.beam = NULL;
    r->plain.noise_on = 0;
    return SH_OK;
}

static void close_run(struct run *r)
{
    bench_rays_free(&r->rays);
    line_block_free(&r->block);
    caster_free(r->caster);
    site_free(r->site);
    free(r->cfg);
}

static double line_s(struct run *r, const struct cast_setup *setup, uint32_t l)
{
    struct schedule_line line;
    struct schedule_run run;
    schedule_get_line(&r->rays.segment, l, &line);
    schedule_get_run(&r->rays.segment, &line, line.cast0, BENCH_LINE_PULSES, &run);
    double start_s = bench_thread_s();
    caster_cast(r->caster, setup, &run, &r->block);
    return bench_thread_s() - start_s;
}

/* Returns the median of the ratios. */
static double measure(struct run *r, double *plain_ns, double *ns)
{
    double plain[ROUNDS], asked[ROUNDS], ratio[ROUNDS];
    for (uint32_t k = 0; k < ROUNDS; k++) {
        double s[2] = {0.0, 0.0};
        for (uint32_t l = 0; l < LINES; l++) /* the second of the two finds the caches warm */
            for (uint32_t turn = 0; turn < 2; turn++) {
                uint32_t which = (k + l + turn) % 2;
                s[which] += line_s(r, which == 0 ? &r->plain : &r->setup, l);
            }
        plain[k] = 1e9 * s[0] / r->rays.n;
        asked[k] = 1e9 * s[1] / r->rays.n;
        ratio[k] = s[1] / s[0];
    }
    *plain_ns = bench_median(plain, ROUNDS);
    *ns = bench_median(asked, ROUNDS);
    return bench_median(ratio, ROUNDS);
}

int main(void)
{
    char folder[] = "/tmp/scanhead-plain-XXXXXX", hall[sizeof folder + 16];
    int beyond = 0, rc = SH_OK;
    struct sh_err err = {0};
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(hall, sizeof hall, "%s/hall.obj", folder);
    if (write_hall(hall) != 0) rc = sh_fail(&err, SH_EIO, "%s can't be written", hall);
    pin(NULL);
    printf("%-52s %9s %9s %7s\n", "asked for", "plain ns", "ns", "ratio");
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES && rc == SH_OK; i++) {
        static struct run run;
        double plain_ns, ns, ratio;
        rc = open_run(&run, &CASES[i], hall, &err);
        if (rc == SH_OK) {
            ratio = measure(&run, &plain_ns, &ns);
            int bad = !(fabs(ratio - 1.0) <= ALLOWED);
            beyond += bad;
            printf("%-52s %9.2f %9.2f %7.3f%s\n", CASES[i].name, plain_ns, ns, ratio, bad ? "  BEYOND 5 %" : "");
            fflush(stdout);
        }
        close_run(&run);
    }
    unlink(hall);
    rmdir(folder);
    if (rc != SH_OK) fprintf(stderr, "plain: %s\n", err.text);
    return rc == SH_OK && beyond == 0 ? 0 : 1;
}
