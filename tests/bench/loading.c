/* SPDX-License-Identifier: MIT */
/* This measures the cost to load a large mesh: `scanhead check` of terrain in a file, beside bare Embree on the same
 * triangles.
 *
 *   build/tests/bench/loading [options] [CASE...]
 *
 * Each round runs `check`, and then Embree's build of the triangles, which lie in memory. Each runs in a process of its
 * own. Processor time is that of all threads, kernel included. For Embree it is the time of its build alone. For
 * `check` it is that of the whole process, reading the file included. The peak of memory is that of `check`, as a
 * whole process. */
#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "firmware_sim/base/clock.h"
#include "tests/bench/bench.h"
#include "tests/bench/options.h"
#include "tests/bench/sight.h"

enum { MAX_ROUNDS = 99, PATH_ROOM = 96 };

static const char HELP[] =
    "loading [options] [CASE...]: `scanhead check` of a large mesh, beside bare Embree's build of it\n\n"
    "  --program FILE  default: build/scanhead\n"
    "  --triangles N   of all cases, like 250k; default: as each case has it\n"
    "  --rounds N      default 3, at most 99\n"
    "  --folder DIR    where the meshes go, default /tmp\n\n"
    "Cases: shared (10M triangles in binary PLY), private (likewise, three vertices for each triangle), obj (1M).\n"
    "Columns: processor time of Embree's build and of check; the median of the rounds' ratios; check's seconds by the\n"
    "clock, and its peak of memory in bytes for each triangle.\n";

struct options {
    const char *program, *folder;
    uint32_t triangles, rounds;
};

static const struct loading_case {
    const char *name, *ending;
    uint32_t triangles;
    int is_private;
} CASES[] = {{"shared", ".ply", 10000000, 0}, {"private", ".ply", 10000000, 1}, {"obj", ".obj", 1000000, 0}};
enum { N_CASES = sizeof CASES / sizeof *CASES };

static char folder[PATH_ROOM], config_path[PATH_ROOM + 32], mesh_path[PATH_ROOM + 32], messages_path[PATH_ROOM + 32];

/* ---- the mesh: a process that has it in memory ends afterwards, so that the peaks of the others are their own */

static int make_terrain(uint32_t triangles, struct bench_target *target, struct sh_err *err)
{
    char name[32];
    snprintf(name, sizeof name, "%u", triangles);
    return bench_target_load(name, NULL, NULL, target, err);
}

/* Makes three vertices for each triangle. */
static int tear(const struct mesh *mesh, double (**xyz_m)[3], uint32_t (**face)[3], struct sh_err *err)
{
    *xyz_m = malloc((size_t)mesh->n_faces * 3 * sizeof **xyz_m);
    *face = malloc((size_t)mesh->n_faces * sizeof **face);
    if (*xyz_m == NULL || *face == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the mesh");
    for (uint32_t i = 0; i < 3 * mesh->n_faces; i++) {
        memcpy((*xyz_m)[i], mesh->xyz_m[mesh->face[i / 3][i % 3]], sizeof **xyz_m);
        (*face)[i / 3][i % 3] = i;
    }
    return SH_OK;
}

static int write_mesh(const struct loading_case *c, uint32_t triangles, struct sh_err *err)
{
    struct bench_target target;
    double(*xyz_m)[3] = NULL;
    uint32_t(*face)[3] = NULL;
    int rc = make_terrain(triangles, &target, err);
    if (rc != SH_OK) return rc;
    struct mesh mesh = bench_target_mesh(&target);
    if (c->is_private) {
        rc = tear(&mesh, &xyz_m, &face, err);
        mesh.n_vertices = 3 * mesh.n_faces;
        mesh.xyz_m = (const double(*)[3])xyz_m;
        mesh.face = (const uint32_t(*)[3])face;
    }
    if (rc == SH_OK) rc = mesh_write(mesh_path, &mesh, NULL, err);
    free(xyz_m);
    free(face);
    bench_target_free(&target);
    return rc;
}

static int write_config(const char *ending, struct sh_err *err)
{
    FILE *f = fopen(config_path, "w");
    if (f != NULL)
        fprintf(f,
                "head: {profile: full-sweep, prr_hz: 300000, lines_hz: 120, pan_deg_s: 36}\n"
                "scene:\n  meshes:\n    - {file: mesh%s, up: z, scale: 1}\n"
                "stations:\n  - {name: middle, position_m: [0, 0, 4.7], heading_deg: 0}\n"
                "output: {crs: local, layout: polar}\n"
                "links:\n  - {type: 'null'}\n",
                ending);
    return f != NULL && fclose(f) == 0 ? SH_OK : sh_fail(err, SH_EIO, "%s: %s", config_path, strerror(errno));
}

/* ---- one process */

struct figures {
    double cpu_s, wall_s, bytes, triangles;
};

/* The parent sees the figures that a child leaves here. */
static struct figures *shared;

static int build_alone(uint32_t triangles, unsigned threads, struct sh_err *err)
{
    struct bench_target target;
    struct embree_alone embree;
    const struct embree_alone_spec spec = {.robust = 1, .medium = 1, .threads = threads, .range_max_m = 1000.0f};
    int rc = make_terrain(triangles, &target, err);
    if (rc != SH_OK) return rc;
    const double before_s = bench_process_s();
    rc = embree_alone_create(target.scene, &spec, &embree, err);
    *shared = (struct figures){bench_process_s() - before_s, embree.build_s, 0.0, target.scene->n_triangles};
    if (rc == SH_OK) embree_alone_free(&embree);
    bench_target_free(&target);
    return rc;
}

/* This does not return. */
static void become_check(const struct options *o, unsigned threads)
{
    char set[32];
    snprintf(set, sizeof set, "loop.threads=%u", threads);
    if (freopen(messages_path, "w", stdout) == NULL || dup2(STDOUT_FILENO, STDERR_FILENO) < 0) _exit(127);
    execlp(o->program, o->program, "check", config_path, "--set", set, (char *)NULL);
    perror(o->program);
    _exit(127);
}

static double seconds_of(const struct timeval *t)
{
    return (double)t->tv_sec + 1e-6 * (double)t->tv_usec;
}

/* Waits for the child and returns 0 if it ended well. *out gets the child's time, processor time and peak. */
static int wait_for(pid_t pid, const char *what, struct figures *out, struct sh_err *err)
{
    struct rusage usage;
    int status;
    if (pid < 0) return sh_fail(err, SH_EIO, "fork: %s", strerror(errno));
    const int64_t start_ns = clock_now_ns();
    if (wait4(pid, &status, 0, &usage) != pid || status != 0) {
        bench_show_file(messages_path);
        return sh_fail(err, SH_EIO, "%s failed", what);
    }
    out->wall_s = 1e-9 * (double)(clock_now_ns() - start_ns);
    out->cpu_s = seconds_of(&usage.ru_utime) + seconds_of(&usage.ru_stime);
    out->bytes = 1024.0 * (double)usage.ru_maxrss;
    return SH_OK;
}

static pid_t start_child(void)
{
    fflush(stdout);
    return fork();
}

static int in_child(int rc, const struct sh_err *err)
{
    if (rc != SH_OK) fprintf(stderr, "loading: %s\n", err->text);
    return rc == SH_OK ? BENCH_OK : BENCH_FAILED;
}

/* ---- a case */

static int run_round(const struct options *o, uint32_t triangles, unsigned threads, struct figures *alone,
                     struct figures *ours, struct sh_err *err)
{
    struct figures whole;
    pid_t pid = start_child();
    if (pid == 0) _exit(in_child(build_alone(triangles, threads, err), err));
    int rc = wait_for(pid, "Embree alone", &whole, err);
    *alone = *shared;
    if (rc != SH_OK) return rc;
    pid = start_child();
    if (pid == 0) become_check(o, threads);
    return wait_for(pid, o->program, ours, err);
}

static int measure(const struct options *o, const struct loading_case *c, uint32_t triangles, unsigned threads,
                   struct sh_err *err)
{
    double alone_s[MAX_ROUNDS], ours_s[MAX_ROUNDS], ratio[MAX_ROUNDS], wall_s[MAX_ROUNDS], bytes[MAX_ROUNDS];
    for (uint32_t i = 0; i < o->rounds; i++) {
        struct figures alone, ours;
        int rc = run_round(o, triangles, threads, &alone, &ours, err);
        if (rc != SH_OK) return rc;
        alone_s[i] = alone.cpu_s;
        ours_s[i] = ours.cpu_s;
        ratio[i] = ours.cpu_s / alone.cpu_s;
        wall_s[i] = ours.wall_s;
        bytes[i] = ours.bytes / alone.triangles;
    }
    printf("%-8s %9.0f %7s %9.2f %9.2f %7.2f %9.2f %9.1f\n", c->name, shared->triangles, threads == 0 ? "all" : "1",
           bench_median(alone_s, o->rounds), bench_median(ours_s, o->rounds), bench_median(ratio, o->rounds),
           bench_median(wall_s, o->rounds), bench_median(bytes, o->rounds));
    return SH_OK;
}

static int run_case(const struct options *o, const struct loading_case *c, struct sh_err *err)
{
    struct figures whole;
    const uint32_t triangles = o->triangles != 0 ? o->triangles : c->triangles;
    snprintf(mesh_path, sizeof mesh_path, "%s/mesh%s", folder, c->ending);
    pid_t pid = start_child();
    if (pid == 0) _exit(in_child(write_mesh(c, triangles, err), err));
    int rc = wait_for(pid, "the mesh", &whole, err);
    if (rc == SH_OK) rc = write_config(c->ending, err);
    if (rc == SH_OK) rc = measure(o, c, triangles, 1, err);
    if (rc == SH_OK) rc = measure(o, c, triangles, 0, err);
    unlink(mesh_path);
    return rc;
}

static int run(const struct options *o, char **name, int n, struct sh_err *err)
{
    int rc = SH_OK;
    shared = mmap(NULL, sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (shared == MAP_FAILED) return sh_fail(err, SH_ENOMEM, "no memory");
    snprintf(folder, sizeof folder, "%.60s/scanhead-loading-XXXXXX", o->folder);
    if (mkdtemp(folder) == NULL) return sh_fail(err, SH_EIO, "%s: %s", folder, strerror(errno));
    snprintf(config_path, sizeof config_path, "%s/check.yaml", folder);
    snprintf(messages_path, sizeof messages_path, "%s/messages", folder);
    printf("%-8s %9s %7s %9s %9s %7s %9s %9s\n", "case", "triangles", "threads", "Embree s", "check s", "ratio",
           "wall s", "bytes");
    for (int k = 0; k < N_CASES && rc == SH_OK; k++) {
        int asked = n == 0;
        for (int i = 0; i < n; i++)
            asked |= strcmp(name[i], CASES[k].name) == 0;
        if (asked) rc = run_case(o, &CASES[k], err);
    }
    unlink(config_path);
    unlink(messages_path);
    rmdir(folder);
    return rc;
}

static int is_case(const char *name)
{
    for (int k = 0; k < N_CASES; k++)
        if (strcmp(name, CASES[k].name) == 0) return 1;
    return 0;
}

static int parse(struct options *o, int argc, char **argv)
{
    static const struct option table[] = {
        {"program", required_argument, NULL, 'p'}, {"triangles", required_argument, NULL, 't'},
        {"rounds", required_argument, NULL, 'r'},  {"folder", required_argument, NULL, 'f'},
        {"help", no_argument, NULL, 'h'},          {NULL, 0, NULL, 0}};
    int ok = 1;
    *o = (struct options){.program = "build/scanhead", .folder = "/tmp", .rounds = 3};
    for (int c; (c = getopt_long(argc, argv, "", table, NULL)) >= 0;) {
        if (c == 'p') o->program = optarg;
        if (c == 'f') o->folder = optarg;
        if (c == 'r') o->rounds = (uint32_t)strtoul(optarg, NULL, 10);
        if (c == 't') ok &= (o->triangles = bench_count(optarg)) != 0;
        if (c == 'h') fputs(HELP, stdout);
        if (c == 'h' || c == '?') return c == 'h' ? BENCH_OK : BENCH_USAGE;
    }
    for (int i = optind; i < argc; i++)
        ok &= is_case(argv[i]);
    if (ok && o->rounds >= 1 && o->rounds <= MAX_ROUNDS) return -1;
    fprintf(stderr, "loading: allowed are the cases shared, private and obj, 100 to 100M triangles, 1 to %d rounds\n",
            MAX_ROUNDS);
    return BENCH_USAGE;
}

int main(int argc, char **argv)
{
    struct options o;
    struct sh_err err = {0};
    const int status = parse(&o, argc, argv);
    if (status >= 0) return status;
    int rc = run(&o, argv + optind, argc - optind, &err);
    if (rc != SH_OK) fprintf(stderr, "loading: %s\n", err.text);
    return rc == SH_OK ? BENCH_OK : BENCH_FAILED;
}
