/* What exact ranges and the decision of doubtful hits cost: single rays with them, by single rays as Embree has them
 * (bvh_create_plain), the whole cast of the same lines in turns. Processor time of the thread; medians of rounds.
 *
 *   build/tests/bench/refine [polar|ecef] [house|10k|1M|...] ... */
#include <stdio.h>
#include <string.h>

#include "core/cast.h"
#include "tests/bench/bench.h"
#include "tests/bench/pin.h"

enum { LINES = 400, ROUNDS = 21 };

static const char HOUSE[] = "/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc";

struct run {
    struct bench_target target;
    struct bench_rays rays;
    struct bvh *bvh[2]; /* refined, plain */
    struct georef *georef;
    struct caster *caster;
    struct line_block block;
    struct cast_setup setup;
};

static int open_run(struct run *r, const char *scene, int polar, struct sh_err *err)
{
    struct bench_case c = {.target = &r->target, .rays = &r->rays};
    int rc = bench_target_load(scene, HOUSE, NULL, &r->target, err);
    if (rc == SH_OK) rc = bench_rays_create(LINES, &r->rays, err);
    if (rc == SH_OK) rc = bvh_create(r->target.scene, r->target.station_m, 0.0, 0, NULL, &r->bvh[0], err);
    if (rc == SH_OK) rc = bvh_create_plain(r->target.scene, r->target.station_m, 0.0, 0, NULL, &r->bvh[1], err);
    if (rc == SH_OK) rc = bench_georef(&r->target, &r->georef, err);
    if (rc == SH_OK) rc = caster_create(&r->caster, err);
    if (rc == SH_OK) rc = line_block_alloc(&r->block, BENCH_LINE_PULSES, err);
    if (rc != SH_OK) return rc;
    c.bvh = r->bvh[0];
    bench_setup(&c, r->georef, &r->setup);
    r->setup.noise_on = 0;
    if (polar) r->setup.layout = LINE_POLAR;
    return SH_OK;
}

static void close_run(struct run *r)
{
    line_block_free(&r->block);
    caster_free(r->caster);
    georef_free(r->georef);
    bvh_free(r->bvh[0]);
    bvh_free(r->bvh[1]);
    bench_rays_free(&r->rays);
    bench_target_free(&r->target);
}

static double line_s(struct run *r, uint32_t l, uint32_t which)
{
    struct schedule_line line;
    struct schedule_run run;
    schedule_get_line(&r->rays.segment, l, &line);
    schedule_get_run(&r->rays.segment, &line, line.cast0, BENCH_LINE_PULSES, &run);
    r->setup.bvh = r->bvh[which];
    double start_s = bench_thread_s();
    caster_cast(r->caster, &r->setup, &run, &r->block);
    return bench_thread_s() - start_s;
}

static void measure(struct run *r, const char *scene)
{
    double ns[2][ROUNDS], ratio[ROUNDS];
    for (uint32_t k = 0; k < ROUNDS; k++) {
        double s[2] = {0.0, 0.0};
        for (uint32_t l = 0; l < LINES; l++) /* who comes second finds the caches warm */
            for (uint32_t turn = 0; turn < 2; turn++) {
                uint32_t which = (k + l + turn) % 2;
                s[which] += line_s(r, l, which);
            }
        for (int which = 0; which < 2; which++)
            ns[which][k] = 1e9 * s[which] / r->rays.n;
        ratio[k] = s[1] / s[0];
    }
    double refined = bench_median(ns[0], ROUNDS), plain = bench_median(ns[1], ROUNDS);
    printf("%-8s %9.2f %9.2f %9.2f %7.3f\n", scene, refined, plain, refined - plain, bench_median(ratio, ROUNDS));
    fflush(stdout);
}

int main(int argc, char **argv)
{
    int polar = 1;
    pin();
    printf("%-8s %9s %9s %9s %7s\n", "scene", "refined", "plain", "saved ns", "ratio");
    for (int i = 1; i < argc; i++) {
        struct run run = {0};
        struct sh_err err = {0};
        if (strcmp(argv[i], "polar") == 0 || strcmp(argv[i], "ecef") == 0) {
            polar = argv[i][0] == 'p';
            continue;
        }
        int rc = open_run(&run, argv[i], polar, &err);
        if (rc == SH_OK) measure(&run, argv[i]);
        close_run(&run);
        if (rc == SH_OK) continue;
        fprintf(stderr, "refine: %s\n", err.text);
        return 1;
    }
    return 0;
}
