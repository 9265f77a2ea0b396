/* scanhead bench: speed figures. */
#include <errno.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "tests/bench/bench.h"
#include "tests/bench/print.h"
#include "firmware_sim/app/app.h"

#define HOUSE_FILE     "/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc"
#define DEFAULT_SCENES "10k,100k,1M,10M,house"

static const char HELP[] =
    "scanhead bench [options]: speed figures as JSON on standard output\n\n"
    "  --scenes LIST   of generated closed terrain by its number of triangles (10k, 2M, 25000), and house, "
    "the IFC\n"
    "                  model; default " DEFAULT_SCENES "\n"
    "  --house FILE    the IFC model; default " HOUSE_FILE "\n"
    "  --seconds S     measure each scene for S seconds, but at least seven rounds; default 3\n"
    "  --threads N     casters of the run on all threads; default: one per processor\n"
    "  --leaks N       aim N rays at edges and corners of closed meshes and count those that slip through "
    "(fails when\n"
    "                  one does); without --scenes nothing else is done\n"
    "  -o FILE         JSON to FILE, and a table to standard output\n\n"
    "In one run and in turns, pinned to one processor: Embree alone on prepared rays at its best packet "
    "width; the exact\n"
    "cast of the same rays (cast_ratio); everything from the schedule to the frame's checksum "
    "(pipeline_ratio). Ratios are\n"
    "medians over the rounds of Embree's time by ours. Then the same through the real loop with the null "
    "link.\n";

struct bench_options {
    const char *scenes, *house, *out;
    double seconds;
    long threads;
    double leaks;
};

enum { OPT_SCENES = 256, OPT_HOUSE, OPT_SECONDS, OPT_THREADS, OPT_LEAKS };

static const struct option OPTIONS[] = {{"scenes", required_argument, NULL, OPT_SCENES},
                                        {"house", required_argument, NULL, OPT_HOUSE},
                                        {"seconds", required_argument, NULL, OPT_SECONDS},
                                        {"threads", required_argument, NULL, OPT_THREADS},
                                        {"leaks", required_argument, NULL, OPT_LEAKS},
                                        {"help", no_argument, NULL, 'h'},
                                        {NULL, 0, NULL, 0}};

static int parse_option(struct bench_options *o, int opt, char **argv)
{
    switch (opt) {
    case OPT_SCENES:
        o->scenes = optarg;
        return APP_OK;
    case OPT_HOUSE:
        o->house = optarg;
        return APP_OK;
    case 'o':
        o->out = optarg;
        return APP_OK;
    case OPT_SECONDS:
        return app_parse_double("bench", "--seconds", optarg, 0.0, 3600.0, &o->seconds);
    case OPT_THREADS:
        return app_parse_long("bench", "--threads", optarg, 1, 64, &o->threads);
    case OPT_LEAKS:
        return app_parse_double("bench", "--leaks", optarg, 4.0, 1e12, &o->leaks);
    default:
        return app_bad_option("bench", opt, argv);
    }
}

/* The next name of a list with commas; NULL at its end. */
static const char *next_name(const char *list, char *name, size_t len)
{
    size_t n = strcspn(list, ",");
    if (*list == '\0') return NULL;
    snprintf(name, len, "%.*s", (int)n, list);
    return list + n + (list[n] == ',');
}

static int check_scenes(const char *list)
{
    char name[32];
    uint32_t n = 0;
    if (*list == '\0') return app_usage("bench", "--scenes: a list is needed, such as %s", DEFAULT_SCENES);
    while ((list = next_name(list, name, sizeof name)) != NULL)
        if ((strcmp(name, "house") != 0 && bench_count(name) == 0) || ++n > BENCH_MAX_SCENES)
            return app_usage("bench",
                             "--scenes %s: allowed are up to %d of house and numbers of triangles from 100 to 100M",
                             name, BENCH_MAX_SCENES);
    return APP_OK;
}

/* Returns -1 to go on, else the exit status. */
static int parse(struct bench_options *o, int argc, char **argv)
{
    int opt, status = APP_OK;
    opterr = 0;
    while ((opt = getopt_long(argc, argv, ":ho:", OPTIONS, NULL)) != -1) {
        if (opt == 'h') {
            fputs(HELP, stdout);
            return APP_OK;
        }
        status = parse_option(o, opt, argv);
        if (status != APP_OK) return status;
    }
    if (optind != argc) return app_usage("bench", "it takes no arguments, only options");
    if (o->scenes == NULL && o->leaks == 0.0) o->scenes = DEFAULT_SCENES;
    if (o->scenes != NULL) status = check_scenes(o->scenes);
    return status == APP_OK ? -1 : status;
}

/* The calling thread to one processor, the one it runs on; `before` undoes it. */
static void pin(cpu_set_t *before)
{
    cpu_set_t one;
    int cpu = sched_getcpu();
    if (sched_getaffinity(0, sizeof *before, before) != 0) CPU_ZERO(before);
    CPU_ZERO(&one);
    CPU_SET(cpu < 0 ? 0U : (unsigned)cpu, &one);
    sched_setaffinity(0, sizeof one, &one);
}

static void unpin(const cpu_set_t *before)
{
    if (CPU_COUNT(before) != 0) sched_setaffinity(0, sizeof *before, before);
}

static uint32_t all_threads(const struct bench_options *o)
{
    long n = o->threads != 0 ? o->threads : sysconf(_SC_NPROCESSORS_ONLN);
    return n < 1 ? 1 : n > 64 ? 64 : (uint32_t)n;
}

static int measure_case(const struct bench_options *o, const struct bench_case *c, struct bench_scene_report *out,
                        struct sh_err *err)
{
    cpu_set_t before;
    pin(&before);
    int rc = bench_measure(c, &out->result, err);
    unpin(&before);
    uint32_t threads[2] = {1, all_threads(o)};
    for (uint32_t i = 0; i < (threads[1] > 1 ? 2U : 1U) && rc == SH_OK; i++) {
        rc = bench_loop(c, &out->result, threads[i], &out->loop[i], err);
        if (rc == SH_OK) out->n_loop++;
    }
    return rc;
}

static int measure_target(const struct bench_options *o, const struct bench_target *target,
                          struct bench_scene_report *out, struct sh_err *err)
{
    struct bench_embree embree = {0}, fast = {0};
    struct bench_rays rays = {0};
    struct bench_case c = {.target = target, .rays = &rays, .embree = &embree, .fast = &fast, .seconds = o->seconds};
    int rc = bench_rays_create(BENCH_LINES, &rays, err);
    if (rc == SH_OK) rc = bench_embree_create(target->scene, target->station_m, 1, &embree, err);
    if (rc == SH_OK) rc = bench_embree_create(target->scene, target->station_m, 0, &fast, err);
    if (rc == SH_OK) rc = bvh_create(target->scene, target->station_m, 0.0, 0, &app_report_stderr, &c.bvh, err);
    if (rc == SH_OK) {
        snprintf(out->name, sizeof out->name, "%s", target->name);
        out->triangles = target->scene->n_triangles;
        out->load_s = target->load_s;
        out->embree_build_s = embree.build_s;
        bvh_get_info(c.bvh, &out->info);
        rc = measure_case(o, &c, out, err);
    }
    bvh_free(c.bvh);
    bench_embree_free(&embree);
    bench_embree_free(&fast);
    bench_rays_free(&rays);
    return rc;
}

static int measure_scene(const struct bench_options *o, const char *name, struct bench_report *report,
                         struct sh_err *err)
{
    struct bench_target target;
    const char *house = o->house != NULL ? o->house : HOUSE_FILE;
    if (strcmp(name, "house") == 0 && o->house == NULL && access(house, R_OK) != 0) {
        snprintf(report->note[report->n_notes++ % BENCH_MAX_NOTES], sizeof report->note[0],
                 "house left out: %s: %s (Debian: assimp-testmodels; or --house FILE)", house, strerror(errno));
        return SH_OK;
    }
    fprintf(stderr, "scanhead: bench: %s\n", name);
    int rc = bench_target_load(name, house, &app_report_stderr, &target, err);
    if (rc == SH_OK) rc = measure_target(o, &target, &report->scene[report->n_scenes], err);
    if (rc == SH_OK) report->n_scenes++;
    bench_target_free(&target);
    return rc;
}

static int measure(const struct bench_options *o, struct bench_report *report, struct sh_err *err)
{
    const char *list = o->scenes != NULL ? o->scenes : "";
    char name[32];
    int rc = SH_OK;
    while (rc == SH_OK && (list = next_name(list, name, sizeof name)) != NULL)
        rc = measure_scene(o, name, report, err);
    if (rc == SH_OK && o->leaks > 0.0) {
        rc = bench_leaks((uint64_t)o->leaks, 1, all_threads(o), &app_report_stderr, report->leaks, err);
        report->have_leaks = rc == SH_OK;
    }
    return rc;
}

static int write_out(const struct bench_options *o, const struct bench_report *report, struct sh_err *err)
{
    if (o->out == NULL) return bench_print_json(stdout, report, err);
    FILE *out = fopen(o->out, "w");
    if (out == NULL) return sh_fail(err, SH_EIO, "%s: %s", o->out, strerror(errno));
    int rc = bench_print_json(out, report, err);
    if (fclose(out) != 0 && rc == SH_OK) rc = sh_fail(err, SH_EIO, "%s: %s", o->out, strerror(errno));
    if (rc == SH_OK) bench_print_table(stdout, report);
    return rc;
}

static int judge(const struct bench_report *report, struct sh_err *err)
{
    uint64_t leaks = 0; /* what passes its target by has slipped through, too */
    for (int i = 0; i < BENCH_LEAK_MESHES && report->have_leaks; i++)
        leaks += report->leaks[i].leaks + report->leaks[i].passed;
    return leaks == 0 ? SH_OK : sh_fail(err, SH_ESTATE, "bench: %llu rays leaked", (unsigned long long)leaks);
}

int main(int argc, char **argv)
{
    struct bench_options o = {.seconds = 3.0};
    struct sh_err err = {0};
    int status = parse(&o, argc, argv);
    if (status >= 0) return status;
    struct bench_report *report = calloc(1, sizeof *report);
    int rc = report != NULL ? measure(&o, report, &err) : sh_fail(&err, SH_ENOMEM, "no memory");
    if (rc == SH_OK) rc = write_out(&o, report, &err);
    if (rc == SH_OK) rc = judge(report, &err);
    free(report);
    return rc == SH_OK ? APP_OK : app_fail(&err);
}
