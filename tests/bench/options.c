/* SPDX-License-Identifier: MIT */
#include "tests/bench/options.h"

#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/bench/bench.h"
#include "tests/bench/print.h"

#define DEFAULT_SCENES "10k,100k,1M,10M,house,garden"

static const char HELP[] =
    "bench [options]: speed figures as JSON on standard output\n\n"
    "  --scenes LIST   names with commas between: a number of triangles (10k, 2M, 25000) is generated closed terrain,\n"
    "                  house is the IFC model from its living room, garden from outside; foliage, huge: README.md;\n"
    "                  default " DEFAULT_SCENES "\n"
    "  --house FILE    the IFC model; default " BENCH_HOUSE_FILE "\n"
    "  --seconds S     measure each scene for S seconds, but at least seven rounds; default 3\n"
    "  --pulses LIST   whole scans with and without a sight, of so many pulses (22.5M, 300k), or none; default 22.5M and\n"
    "                  1M in the house, 22.5M and 2.8M in scenes of 90,000 to 2 million triangles, none in others\n"
    "  --whole         cast all lines of these scans, not about 5 million pulses a round\n"
    "  --only-sight    measure nothing but these scans\n"
    "  --reach         what a pulse costs a head or a body that moves, with a far station or reach, beside one that\n"
    "                  stands; without --scenes nothing else is done\n"
    "  --threads N     casters of the run on all threads; default: one per processor\n"
    "  --leaks N       aim N rays at edges and corners of closed meshes and count those that slip through (fails\n"
    "                  when one does); without --scenes nothing else is done\n"
    "  -o FILE         JSON to FILE, and a table to standard output\n\n"
    "In one run and in turns, pinned to one processor: Embree alone on prepared rays at its best packet width; the\n"
    "exact cast of the same rays (cast_ratio); everything from the schedule to the frame's checksum (pipeline_ratio).\n"
    "Ratios are medians over the rounds of Embree's time by ours. Then the same through the real loop with the null\n"
    "link.\n";

enum {
    OPT_SCENES = 256,
    OPT_HOUSE,
    OPT_PULSES,
    OPT_WHOLE,
    OPT_ONLY_SIGHT,
    OPT_SECONDS,
    OPT_THREADS,
    OPT_LEAKS,
    OPT_REACH
};

static const struct option OPTIONS[] = {{"scenes", required_argument, NULL, OPT_SCENES},
                                        {"house", required_argument, NULL, OPT_HOUSE},
                                        {"seconds", required_argument, NULL, OPT_SECONDS},
                                        {"pulses", required_argument, NULL, OPT_PULSES},
                                        {"whole", no_argument, NULL, OPT_WHOLE},
                                        {"only-sight", no_argument, NULL, OPT_ONLY_SIGHT},
                                        {"threads", required_argument, NULL, OPT_THREADS},
                                        {"leaks", required_argument, NULL, OPT_LEAKS},
                                        {"reach", no_argument, NULL, OPT_REACH},
                                        {"help", no_argument, NULL, 'h'},
                                        {NULL, 0, NULL, 0}};

static int usage(const char *fmt, ...) __attribute__((format(printf, 1, 2)));
static int usage(const char *fmt, ...)
{
    va_list args;
    va_start(args, fmt);
    fputs("bench: ", stderr);
    vfprintf(stderr, fmt, args);
    fputs("; see bench --help\n", stderr);
    va_end(args);
    return BENCH_USAGE;
}

static int parse_number(const char *option, double min, double max, double *out)
{
    char *end;
    errno = 0;
    *out = strtod(optarg, &end);
    if (end != optarg && *end == '\0' && errno == 0 && *out >= min && *out <= max) return BENCH_OK;
    return usage("%s %s: allowed is a number from %.10g to %.10g", option, optarg, min, max);
}

static int parse_threads(long *out)
{
    double n;
    int status = parse_number("--threads", 1.0, 64.0, &n);
    if (status == BENCH_OK && n != floor(n)) status = usage("--threads %s: allowed is a whole number", optarg);
    *out = (long)n;
    return status;
}

static int parse_option(struct bench_options *o, int opt, char **argv)
{
    switch (opt) {
    case OPT_SCENES:
        o->scenes = optarg;
        return BENCH_OK;
    case OPT_HOUSE:
        o->house = optarg;
        return BENCH_OK;
    case OPT_PULSES:
        o->pulses = optarg;
        return BENCH_OK;
    case OPT_WHOLE:
        o->whole = 1;
        return BENCH_OK;
    case OPT_ONLY_SIGHT:
        o->only_sight = 1;
        return BENCH_OK;
    case OPT_REACH:
        o->reach = 1;
        return BENCH_OK;
    case 'o':
        o->out = optarg;
        return BENCH_OK;
    case OPT_SECONDS:
        return parse_number("--seconds", 0.0, 3600.0, &o->seconds);
    case OPT_THREADS:
        return parse_threads(&o->threads);
    case OPT_LEAKS:
        return parse_number("--leaks", 4.0, 1e12, &o->leaks);
    case ':':
        return usage("%s: a value is missing", argv[optind - 1]);
    default:
        return usage("%s: no such option", argv[optind - 1]);
    }
}

void bench_show_file(const char *path)
{
    char line[512];
    FILE *f = fopen(path, "r");
    while (f != NULL && fgets(line, sizeof line, f) != NULL)
        fputs(line, stderr);
    if (f != NULL) fclose(f);
}

const char *bench_next_name(const char *list, char *name, size_t len)
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
    if (*list == '\0') return usage("--scenes: a list is needed, such as %s", DEFAULT_SCENES);
    while ((list = bench_next_name(list, name, sizeof name)) != NULL)
        if ((!bench_is_house(name) && !bench_is_made(name) && bench_count(name) == 0) || ++n > BENCH_MAX_SCENES)
            return usage(
                "--scenes %s: allowed are up to %d of house, garden, foliage, huge and numbers of triangles from "
                "100 to 100M",
                name, BENCH_MAX_SCENES);
    return BENCH_OK;
}

double bench_pulses(const char *name)
{
    char *end;
    if (name[0] < '0' || name[0] > '9') return 0.0;
    double n = strtod(name, &end);
    if (*end == 'k' || *end == 'M') n *= *end++ == 'k' ? 1e3 : 1e6;
    return *end == '\0' && n >= 1e3 && n <= 1e8 ? n : 0.0;
}

static int check_pulses(const char *list)
{
    char name[32];
    uint32_t n = 0;
    if (strcmp(list, "none") == 0) return BENCH_OK;
    if (*list == '\0') return usage("--pulses: a list is needed, such as 22.5M,1M, or none");
    while ((list = bench_next_name(list, name, sizeof name)) != NULL)
        if (bench_pulses(name) == 0.0 || ++n > BENCH_MAX_SCANS)
            return usage("--pulses %s: allowed are none, or up to %d numbers from 1k to 100M", name, BENCH_MAX_SCANS);
    return BENCH_OK;
}

int bench_parse(struct bench_options *o, int argc, char **argv)
{
    int opt, status = BENCH_OK;
    opterr = 0;
    *o = (struct bench_options){.seconds = 3.0};
    while ((opt = getopt_long(argc, argv, ":ho:", OPTIONS, NULL)) != -1) {
        if (opt == 'h') {
            fputs(HELP, stdout);
            return BENCH_OK;
        }
        status = parse_option(o, opt, argv);
        if (status != BENCH_OK) return status;
    }
    if (optind != argc) return usage("%s: it takes no arguments, only options", argv[optind]);
    if (o->scenes == NULL && o->leaks == 0.0 && !o->reach) o->scenes = DEFAULT_SCENES;
    if (o->scenes != NULL) status = check_scenes(o->scenes);
    if (status == BENCH_OK && o->pulses != NULL) status = check_pulses(o->pulses);
    return status == BENCH_OK ? -1 : status;
}
