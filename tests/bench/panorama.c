/* SPDX-License-Identifier: MIT */
/* This measures a whole panorama of 0.1 degrees to files, beside Embree alone on the same rays, in the same order.
 *
 *   build/tests/bench/panorama [options]
 *
 * Each round runs all in turns. Embree alone casts all rays, robust, with ready packets at its best width, on one
 * thread. The head scans the same panorama off line, as `scanhead record` does, into files. Loading and building the
 * BVH come before. Figures are processor time of all threads, kernel included, so they are those of one core. */
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "firmware_sim/app/studio/record/files.h"
#include "firmware_sim/app/studio/record/offline.h"
#include "firmware_sim/app/studio/record/recording.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "tests/bench/options.h"
#include "tests/bench/sight.h"

enum { MAX_ROUNDS = 99, MAX_ENDINGS = 8, PATH_ROOM = 96, STEPS = 3600, RINGS = 1801 };

static const char HELP[] =
    "panorama [options]: a panorama of 0.1 degrees to files, beside Embree alone on the same rays\n\n"
    "  --scene NAME    1M (default), another number of triangles, house or garden\n"
    "  --rounds N      default 7, at most 99\n"
    "  --folder DIR    where the files go, default /tmp\n"
    "  --ending LIST   .ply (default) or others that `scanhead record` knows, with commas; none: no file\n"
    "  --columns LIST  of .ply, as --ply-columns of `scanhead record`\n"
    "  --set KEY=VALUE another value of a configuration key; may be repeated\n"
    "  --lines         upright lines of a scanner, -40 to 60 degrees, in place of rings from pole to pole\n"
    "  --raw           each round's figures, a line each, in place of medians\n";

struct options {
    const char *scene, *folder, *ending[MAX_ENDINGS];
    uint32_t rounds, n_endings;
    unsigned columns;
    int raw, lines;
    const char *set[16];
    int n_sets;
};

static char folder[PATH_ROOM], config_path[PATH_ROOM + 32], head_path[PATH_ROOM + 32], mesh_path[PATH_ROOM + 32],
    cloud_path[PATH_ROOM + 32];

static const double RAD = M_PI / 180.0;

/* ---- the scene */

static int write_head(struct sh_err *err)
{
    static const struct {
        const char *key, *value;
    } FIGURES[] = {
        {"step_deg", "0.1"},          {"lines_min_hz", "1"},   {"lines_max_hz", "1000"}, {"range_min_m", "0.1"},
        {"range_max_m", "9000"},      {"range_sigma_m", "0"},  {"range_sigma_ppm", "0"}, {"mirror_sigma_deg", "0"},
        {"pan_sigma_deg", "0"},       {"mirror_counts", "0"},  {"pan_counts", "0"},      {"beam_exit_m", "0"},
        {"beam_divergence_rad", "0"}, {"pulse_width_ns", "4"}, {"max_echoes", "1"},      {"overlap_m", "1"},
        {"wavelength_nm", "1550"},    {"boot_s", "0.2"},       {"spin_up_s", "0.03"},    {"spin_down_s", "0.2"}};
    FILE *f = fopen(head_path, "w");
    if (f == NULL) return sh_fail(err, SH_EIO, "%s: %s", head_path, strerror(errno));
    fprintf(f, "maker: scanhead\nmodel: panorama\nemitter: sphere\n");
    for (size_t i = 0; i < sizeof FIGURES / sizeof *FIGURES; i++)
        fprintf(f, "%s: {value: %s, from: assumed}\n", FIGURES[i].key, FIGURES[i].value);
    fprintf(f, "reaches: [{reflectance: 0.9, range_m: 9000, from: assumed}]\n");
    return fclose(f) == 0 ? SH_OK : sh_fail(err, SH_EIO, "%s: %s", head_path, strerror(errno));
}

/* A line of the scanner has 2400 pulses, of which 1000 or 1001 are cast, and the pan turns 0.1 degrees a line. */
static const char RINGS_HEAD[] = "profile: head.yaml, lines_hz: 1000",
                  LINES_HEAD[] = "profile: riegl-vz2000i, prr_hz: 300000, lines_hz: 125, pan_deg_s: 12.5, frames: 1";

static int write_config(const struct options *o, const struct bench_target *t, struct sh_err *err)
{
    FILE *f = fopen(config_path, "w");
    if (f == NULL) return sh_fail(err, SH_EIO, "%s: %s", config_path, strerror(errno));
    fprintf(f,
            "head: {%s}\nbeam: {mode: single}\nscene:\n  meshes:\n    - {file: %s, up: %s, scale: 1}\n"
            "stations:\n  - {name: middle, position_m: [%.9g, %.9g, %.9g]}\n",
            o->lines ? LINES_HEAD : RINGS_HEAD, bench_is_house(t->name) ? BENCH_HOUSE_FILE : mesh_path,
            bench_is_house(t->name) ? "y" : "z", t->station_m[0], t->station_m[1], t->station_m[2]);
    return fclose(f) == 0 ? SH_OK : sh_fail(err, SH_EIO, "%s: %s", config_path, strerror(errno));
}

static int prepare_files(const struct options *o, const struct bench_target *t, struct sh_err *err)
{
    snprintf(folder, sizeof folder, "%.60s/scanhead-panorama-XXXXXX", o->folder);
    if (mkdtemp(folder) == NULL) return sh_fail(err, SH_EIO, "%s: %s", folder, strerror(errno));
    snprintf(config_path, sizeof config_path, "%s/scan.yaml", folder);
    snprintf(head_path, sizeof head_path, "%s/head.yaml", folder);
    snprintf(mesh_path, sizeof mesh_path, "%s/mesh.ply", folder);
    int rc = write_head(err);
    if (rc == SH_OK && !bench_is_house(t->name)) rc = bench_target_write(t, mesh_path, err);
    return rc == SH_OK ? write_config(o, t, err) : rc;
}

static void remove_files(void)
{
    unlink(config_path);
    unlink(head_path);
    unlink(mesh_path);
    if (folder[0] != '\0') rmdir(folder);
}

/* ---- Embree alone */

struct alone {
    struct embree_alone e;
    struct bench_block *block;
    float *d[3]; /* [n]: the rays, and then the last one again up to whole blocks */
    uint32_t rays, n, width;
    enum embree_feed feed;
};

static void add_ray(struct alone *a, double round_deg, double up_deg)
{
    const double round = round_deg * RAD, up = up_deg * RAD;
    if (a->rays < a->n) {
        a->d[0][a->rays] = (float)(sin(round) * cos(up));
        a->d[1][a->rays] = (float)(cos(round) * cos(up));
        a->d[2][a->rays] = (float)sin(up);
    }
    a->rays++;
}

static void aim(struct alone *a, int lines)
{
    a->rays = 0;
    for (uint32_t k = 0; lines && k < STEPS; k++)
        for (uint32_t i = 0; i < 1000; i++)
            add_ray(a, 0.1 * k, -40.0 + 0.1 * i);
    for (uint32_t ring = 0; !lines && ring < RINGS; ring++) {
        const uint32_t steps = ring == 0 || ring == RINGS - 1 ? 1 : STEPS;
        for (uint32_t k = 0; k < steps; k++)
            add_ray(a, 0.1 * k, -90.0 + 0.1 * ring);
    }
    for (uint32_t i = a->rays; i < a->n; i++)
        for (int k = 0; k < 3; k++)
            a->d[k][i] = a->d[k][i - 1];
}

/* Returns the seconds for all rays. Rays of a block lie in the cache when their time begins. */
static double alone_pass(void *ctx)
{
    struct alone *a = ctx;
    double spent_s = 0.0;
    for (uint32_t at = 0; at < a->n; at += BENCH_BLOCK) {
        memcpy(a->block->fx, a->d[0] + at, sizeof a->block->fx);
        memcpy(a->block->fy, a->d[1] + at, sizeof a->block->fy);
        memcpy(a->block->fz, a->d[2] + at, sizeof a->block->fz);
        if (a->feed == EMBREE_PREPARED) embree_alone_refill(&a->e);
        const double start_s = bench_thread_s();
        embree_alone_pass(&a->e, a->width, a->feed, 0, BENCH_BLOCK);
        spent_s += bench_thread_s() - start_s;
    }
    return spent_s;
}

static int alone_create(const struct options *o, const struct bench_target *t, struct alone *a, struct sh_err *err)
{
    memset(a, 0, sizeof *a);
    int rc = bench_embree(t->scene, t->station_m, 1, &a->e, err);
    aim(a, o->lines); /* counts them */
    a->n = (a->rays + BENCH_BLOCK - 1) / BENCH_BLOCK * BENCH_BLOCK;
    a->block = aligned_alloc(64, (sizeof *a->block + 63) / 64 * 64);
    for (int k = 0; k < 3; k++)
        a->d[k] = malloc(a->n * sizeof *a->d[k]);
    if (a->d[0] == NULL || a->d[1] == NULL || a->d[2] == NULL || a->block == NULL)
        return rc != SH_OK ? rc : sh_fail(err, SH_ENOMEM, "no memory for the rays");
    aim(a, o->lines);
    if (rc == SH_OK) rc = embree_alone_rays(&a->e, a->block->fx, a->block->fy, a->block->fz, BENCH_BLOCK, err);
    return rc == SH_OK ? bench_choose_embree(&a->e, &a->width, &a->feed, alone_pass, a, err) : rc;
}

static void alone_free(struct alone *a)
{
    embree_alone_free(&a->e);
    for (int k = 0; k < 3; k++)
        free(a->d[k]);
    free(a->block);
}

/* ---- the head */

static int write_frame(void *ctx, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    return record_files_frame(ctx, sh, frame, err);
}

/* Sets *ns to the processor time a pulse of a scan and its file of that ending. */
static int scan_once(const struct options *o, const char *ending, struct offline *off, uint32_t rays, double *ns,
                     struct sh_err *err)
{
    struct record_files files = {.recorder = {.may_wait = 1, .columns = o->columns}};
    struct recording_result result;
    const struct recording_options options = {
        .frames = -1, .first_station = 1, .last_station = 1, .head_ends = 1, .frame = write_frame, .ctx = &files};
    snprintf(cloud_path, sizeof cloud_path, "%s/scan%s", folder, ending);
    const double start_s = bench_process_s();
    int rc = ending[0] == '.' ? record_files_add(&files, cloud_path, err) : SH_OK;
    if (rc == SH_OK) rc = record_files_open(&files, err);
    if (rc == SH_OK) rc = recording_run(off->sh, &options, &result, err);
    if (rc == SH_OK) rc = record_files_close(&files, 1, err);
    const double spent_s = bench_process_s() - start_s, pulses = (double)result.counts.pulses;
    unlink(cloud_path);
    *ns = 1e9 * spent_s / pulses;
    if (rc == SH_OK && fabs(pulses - rays) > (o->lines ? STEPS : 0)) /* a line may have a pulse more */
        return sh_fail(err, SH_ESTATE, "%.0f pulses came, not %u", pulses, rays);
    return rc;
}

struct figures {
    double alone_ns[MAX_ROUNDS];
    /* of each ending: */
    double ns[MAX_ENDINGS][MAX_ROUNDS], by_alone[MAX_ENDINGS][MAX_ROUNDS], by_first[MAX_ENDINGS][MAX_ROUNDS];
};

static int measure(const struct options *o, struct alone *a, struct offline *off, struct figures *f, struct sh_err *err)
{
    for (uint32_t round = 0; round < o->rounds; round++) {
        f->alone_ns[round] = 1e9 * alone_pass(a) / a->n;
        for (uint32_t i = 0; i < o->n_endings; i++) {
            const int rc = scan_once(o, o->ending[i], off, a->rays, &f->ns[i][round], err);
            if (rc != SH_OK) return rc;
            f->by_alone[i][round] = f->ns[i][round] / f->alone_ns[round];
            f->by_first[i][round] = f->ns[i][round] / f->ns[0][round];
        }
    }
    return SH_OK;
}

static void print_raw(const struct options *o, const struct figures *f)
{
    const char *of = o->lines ? "lines_" : "";
    for (uint32_t round = 0; round < o->rounds; round++) {
        printf("%sembree_ns %.3f\n", of, f->alone_ns[round]);
        for (uint32_t i = 0; i < o->n_endings; i++)
            printf("%s%s_ns %.3f\n%s%s:embree %.4f\n%s%s:%s %.4f\n", of, o->ending[i], f->ns[i][round], of,
                   o->ending[i], f->by_alone[i][round], of, o->ending[i], o->ending[0], f->by_first[i][round]);
    }
}

static void print_medians(const struct options *o, const struct alone *a, struct figures *f)
{
    char first[32];
    snprintf(first, sizeof first, "x %.16s", o->ending[0]);
    printf("%s, %u rays, %u rounds; Embree alone: packets of %u, %s\n", o->scene, a->rays, o->rounds, a->width,
           a->feed == EMBREE_PREPARED ? "ready" : "filled from arrays");
    printf("%-14s %9s %9s %9s\n", "file", "ns a ray", "x Embree", first);
    printf("%-14s %9.2f %9.3f\n", "Embree alone", bench_median(f->alone_ns, o->rounds), 1.0);
    for (uint32_t i = 0; i < o->n_endings; i++)
        printf("%-14s %9.2f %9.3f %9.3f\n", o->ending[i], bench_median(f->ns[i], o->rounds),
               bench_median(f->by_alone[i], o->rounds), bench_median(f->by_first[i], o->rounds));
}

static int run(const struct options *o, struct bench_target *t, struct alone *a, struct offline *off,
               struct config *cfg, struct sh_err *err)
{
    int rc = bench_target_load(o->scene, BENCH_HOUSE_FILE, NULL, t, err);
    if (rc == SH_OK) rc = prepare_files(o, t, err);
    if (rc == SH_OK) rc = alone_create(o, t, a, err);
    if (rc == SH_OK) rc = config_load(config_path, o->set, o->n_sets, cfg, err);
    if (rc == SH_OK) rc = offline_open(cfg, NULL, 0.0, NULL, off, err);
    static struct figures figures;
    if (rc == SH_OK) rc = site_open_sights(off->site, 0, 1, NULL, err);
    if (rc == SH_OK) rc = measure(o, a, off, &figures, err);
    if (rc == SH_OK && o->raw) print_raw(o, &figures);
    if (rc == SH_OK && !o->raw) print_medians(o, a, &figures);
    return rc;
}

/* Splits the list in place. */
static void split_endings(struct options *o, char *list)
{
    for (char *save = NULL, *name; o->n_endings < MAX_ENDINGS && (name = strtok_r(list, ",", &save)) != NULL;
         list = NULL)
        o->ending[o->n_endings++] = name;
}

static int parse(struct options *o, int argc, char **argv)
{
    static const struct option table[] = {
        {"scene", required_argument, NULL, 's'},   {"rounds", required_argument, NULL, 'r'},
        {"folder", required_argument, NULL, 'f'},  {"ending", required_argument, NULL, 'e'},
        {"columns", required_argument, NULL, 'c'}, {"set", required_argument, NULL, 'k'},
        {"lines", no_argument, NULL, 'l'},         {"raw", no_argument, NULL, 'w'},
        {"help", no_argument, NULL, 'h'},          {NULL, 0, NULL, 0}};
    *o = (struct options){.scene = "1M", .folder = "/tmp", .rounds = 7};
    for (int c; (c = getopt_long(argc, argv, "", table, NULL)) >= 0;) {
        if (c == 's') o->scene = optarg;
        if (c == 'f') o->folder = optarg;
        if (c == 'e') split_endings(o, optarg);
        if (c == 'w') o->raw = 1;
        if (c == 'l') o->lines = 1;
        if (c == 'r') o->rounds = (uint32_t)strtoul(optarg, NULL, 10);
        if (c == 'k' && o->n_sets < 16) o->set[o->n_sets++] = optarg;
        if (c == 'c' && !ply_columns_read(optarg, &o->columns)) c = '?';
        if (c == 'h') fputs(HELP, stdout);
        if (c == 'h' || c == '?') return c == 'h' ? BENCH_OK : BENCH_USAGE;
    }
    if (o->n_endings == 0) o->ending[o->n_endings++] = ".ply";
    if (optind == argc && o->rounds >= 1 && o->rounds <= MAX_ROUNDS &&
        (bench_is_house(o->scene) || bench_count(o->scene) != 0))
        return -1;
    fprintf(stderr, "panorama: allowed are 1 to %d rounds, and a scene of that name; see --help\n", MAX_ROUNDS);
    return BENCH_USAGE;
}

int main(int argc, char **argv)
{
    struct options o;
    struct bench_target target = {0};
    struct alone alone = {.n = 0};
    struct offline off = {0};
    struct sh_err err = {0};
    int status = parse(&o, argc, argv);
    if (status >= 0) return status;
    struct config *cfg = calloc(1, sizeof *cfg);
    int rc = cfg != NULL ? run(&o, &target, &alone, &off, cfg, &err) : sh_fail(&err, SH_ENOMEM, "no memory");
    if (rc != SH_OK) fprintf(stderr, "panorama: %s\n", err.text);
    offline_close(&off);
    alone_free(&alone);
    bench_target_free(&target);
    free(cfg);
    remove_files();
    return rc == SH_OK ? BENCH_OK : BENCH_FAILED;
}
