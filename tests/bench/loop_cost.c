/* SPDX-License-Identifier: MIT */
/* This measures what the real loop costs around the cast: whole programs in turns, on the null link, with one caster.
 *
 *   build/tests/bench/loop_cost [options] PROGRAM...
 *
 * A PROGRAM is a path of scanhead, and more of its options after blanks: 'build/scanhead --no-hash'. Each round runs
 * each program twice, for a short and for a long scan. The difference of both is the cost of the pulses between them.
 * Loading the scene is in both, so it cancels out. Processor time is that of all threads, from --stats. */
#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/bench/bench.h"
#include "tests/bench/clients.h"
#include "tests/bench/options.h"

enum { MAX_PROGRAMS = 8, MAX_ROUNDS = 99, MAX_WORDS = 32, PATH_ROOM = 64 };

static const char HELP[] =
    "loop_cost [options] PROGRAM...: processor time a pulse of whole programs, in turns\n\n"
    "  --config FILE   what to scan; default: closed terrain of 100,000 triangles at 300 kHz\n"
    "  --pace PACE     fast (default) or realtime, which gives the share of one processor as well\n"
    "  --clients       read from all pty and tcp links of the configuration, in processes of their own\n"
    "  --seconds S     of device time in the long scan, default 16; the short one has an eighth\n"
    "  --rounds N      default 9, at most 99\n\n"
    "A PROGRAM is a path of scanhead and more of its options, with blanks between. Columns: medians of the rounds,\n"
    "the spread of the middle half, and the median of the ratios to the first program of the same round. Then, as\n"
    "medians: how often a second its threads gave up or lost a processor (switch/s); and, of the long scan, how late\n"
    "ticks were released (us), and the frames that clients lost (lost).\n";

struct options {
    const char *config, *pace;
    double seconds;
    uint32_t rounds, n;
    char **program;
    int clients; /* 1: clients read the links */
};

struct figures {
    double cpu_s, wall_s, pulses, switches, p50_us, p99_us, lost_frames;
    char sha256[65]; /* empty if the program kept none */
};

struct costs {
    double ns[MAX_ROUNDS], share[MAX_ROUNDS], ratio[MAX_ROUNDS];
    double switches_s[MAX_ROUNDS], p50_us[MAX_ROUNDS], p99_us[MAX_ROUNDS], lost_frames[MAX_ROUNDS];
    uint64_t pulses;
    char sha256[65];
    int differs; /* it differs between its own rounds */
};

static char folder[] = "/tmp/scanhead-loop-XXXXXX";
static char config_path[PATH_ROOM], mesh_path[PATH_ROOM], stats_path[PATH_ROOM], messages_path[PATH_ROOM];

/* ---- the scene */

static int write_mesh(struct sh_err *err)
{
    struct bench_target target;
    int rc = bench_target_load("100k", NULL, NULL, &target, err);
    if (rc != SH_OK) return rc;
    rc = bench_target_write(&target, mesh_path, err);
    bench_target_free(&target);
    return rc;
}

static int write_config(struct sh_err *err)
{
    FILE *f = fopen(config_path, "w");
    if (f != NULL)
        fprintf(f,
                "head: {profile: full-sweep, prr_hz: 300000, lines_hz: 120, pan_deg_s: 36, frames: 0}\n"
                "scene:\n  meshes:\n    - {file: %s, up: z, scale: 1}\n"
                "stations:\n  - {name: middle, position_m: [0, 0, 4.7], heading_deg: 0}\n"
                "output: {crs: local, layout: polar}\n"
                "links:\n  - {type: 'null'}\n",
                mesh_path);
    return f != NULL && fclose(f) == 0 ? SH_OK : sh_fail(err, SH_EIO, "%s: %s", config_path, strerror(errno));
}

/* ---- one run */

static double number_of(const char *text, const char *key)
{
    const char *at = strstr(text, key);
    return at != NULL ? strtod(at + strlen(key), NULL) : -1.0;
}

static int read_figures(struct figures *out, struct sh_err *err)
{
    char text[16384];
    FILE *f = fopen(stats_path, "r");
    size_t n = f != NULL ? fread(text, 1, sizeof text - 1, f) : 0;
    if (f != NULL) fclose(f);
    text[n] = '\0';
    *out = (struct figures){.cpu_s = number_of(text, "\"cpu_s\":"),
                            .wall_s = number_of(text, "\"wall_s\":"),
                            .pulses = number_of(text, "\"pulses\":"),
                            .p50_us = number_of(text, "\"late_p50_us\":"),
                            .p99_us = number_of(text, "\"late_p99_us\":"),
                            .lost_frames = number_of(text, "\"reader_lost_frames\":")};
    const char *hash = strstr(text, "\"stream_sha256\": \"");
    if (hash != NULL) sscanf(hash + 18, "%64[0-9a-f]", out->sha256);
    if (out->cpu_s < 0.0 || out->pulses <= 0.0) return sh_fail(err, SH_EFORMAT, "%s: no figures", stats_path);
    if (number_of(text, "\"lost_pulses\":") > 0.0)
        return sh_fail(err, SH_ESTATE, "pulses were lost; lower head.prr_hz");
    return SH_OK;
}

/* This does not return. ready_fd: where the head says that its links are open. */
static void become(const struct options *o, const char *program, double seconds, int ready_fd)
{
    char words[512], duration[32], ready[16], *arg[MAX_WORDS + 1], *save = NULL;
    int n = 0;
    snprintf(words, sizeof words, "%s", program);
    snprintf(duration, sizeof duration, "%.3f", seconds);
    snprintf(ready, sizeof ready, "%d", ready_fd);
    arg[n++] = strtok_r(words, " ", &save);
    const char *const fixed[] = {"run",        o->config != NULL ? o->config : config_path,
                                 "--start",    "--quiet",
                                 "--pace",     o->pace,
                                 "--stats",    stats_path,
                                 "--threads",  "1",
                                 "--ready-fd", ready,
                                 "--duration", duration};
    for (size_t i = 0; i < sizeof fixed / sizeof *fixed; i++)
        arg[n++] = (char *)(uintptr_t)fixed[i];
    while (n < MAX_WORDS && (arg[n] = strtok_r(NULL, " ", &save)) != NULL)
        n++;
    arg[n] = NULL;
    if (freopen(messages_path, "w", stderr) == NULL) _exit(127);
    execvp(arg[0], arg);
    perror(arg[0]);
    _exit(127);
}

/* Waits for the head and its clients. */
static int wait_for(pid_t head, struct bench_clients *clients, double *switches)
{
    struct rusage usage = {0};
    int status = -1;
    if (wait4(head, &status, 0, &usage) != head) status = -1;
    *switches = (double)(usage.ru_nvcsw + usage.ru_nivcsw);
    bench_clients_end(clients);
    return status;
}

static int run_once(const struct options *o, const char *program, double seconds, struct figures *out,
                    struct sh_err *err)
{
    struct bench_clients clients = {0};
    int ready[2];
    double switches;
    unlink(stats_path);
    if (pipe(ready) != 0) return sh_fail(err, SH_EIO, "pipe: %s", strerror(errno));
    pid_t pid = fork();
    if (pid < 0) return sh_fail(err, SH_EIO, "fork: %s", strerror(errno));
    if (pid == 0) {
        close(ready[0]);
        become(o, program, seconds, ready[1]);
    }
    close(ready[1]);
    bench_clients_begin(&clients, ready[0], o->clients);
    const int status = wait_for(pid, &clients, &switches);
    if (status != 0) {
        bench_show_file(messages_path);
        return sh_fail(err, SH_EIO, "%s failed", program);
    }
    int rc = read_figures(out, err);
    out->switches = switches;
    return rc;
}

/* ---- all of them */

static int run_pair(const struct options *o, const char *program, struct costs *costs, uint32_t round,
                    struct sh_err *err)
{
    struct figures few, many;
    int rc = run_once(o, program, o->seconds / 8, &few, err);
    if (rc == SH_OK) rc = run_once(o, program, o->seconds, &many, err);
    if (rc != SH_OK) return rc;
    const double pulses = many.pulses - few.pulses, cpu_s = many.cpu_s - few.cpu_s;
    costs->ns[round] = 1e9 * cpu_s / pulses;
    costs->share[round] = 100.0 * cpu_s / (many.wall_s - few.wall_s);
    costs->switches_s[round] = (many.switches - few.switches) / (many.wall_s - few.wall_s);
    costs->p50_us[round] = many.p50_us;
    costs->p99_us[round] = many.p99_us;
    costs->lost_frames[round] = many.lost_frames;
    costs->pulses = (uint64_t)pulses;
    if (round != 0 && strcmp(costs->sha256, many.sha256) != 0) costs->differs = 1;
    memcpy(costs->sha256, many.sha256, sizeof costs->sha256);
    return SH_OK;
}

static void print_costs(const struct options *o, struct costs *costs, const struct costs *first, const char *program)
{
    const uint32_t n = o->rounds;
    const double ratio = bench_median(costs->ratio, n), share = bench_median(costs->share, n);
    const double ns = bench_median(costs->ns, n); /* they are sorted now */
    printf("%9.1f %9.1f %9.1f %8.3f %8.1f %9.0f %8.0f %8.0f %8.0f  %-9s  %s\n", ns, costs->ns[n / 4],
           costs->ns[n - 1 - n / 4], ratio, share, bench_median(costs->switches_s, n), bench_median(costs->p50_us, n),
           bench_median(costs->p99_us, n), bench_median(costs->lost_frames, n),
           costs->sha256[0] == '\0'                    ? "none"
           : costs->differs                            ? "CHANGES"
           : first->sha256[0] == '\0'                  ? "-"
           : strcmp(costs->sha256, first->sha256) == 0 ? "same"
                                                       : "DIFFERS",
           program);
}

static int measure(const struct options *o, struct sh_err *err)
{
    static struct costs costs[MAX_PROGRAMS];
    for (uint32_t round = 0; round < o->rounds; round++)
        for (uint32_t i = 0; i < o->n; i++) {
            const uint32_t which = (i + round) % o->n; /* the programs take turns at being first */
            int rc = run_pair(o, o->program[which], &costs[which], round, err);
            if (rc != SH_OK) return rc;
        }
    printf("%s, pace %s, %u rounds, %llu pulses each\n", o->config != NULL ? o->config : "terrain of 100k, 300 kHz",
           o->pace, o->rounds, (unsigned long long)costs[0].pulses);
    printf("%9s %9s %9s %8s %8s %9s %8s %8s %8s  %-9s  %s\n", "ns/pulse", "from", "to", "ratio", "core %", "switch/s",
           "late p50", "late p99", "lost", "sha256", "program");
    for (uint32_t i = 0; i < o->n; i++)
        for (uint32_t round = 0; round < o->rounds; round++)
            costs[i].ratio[round] = costs[i].ns[round] / costs[0].ns[round];
    for (uint32_t i = 0; i < o->n; i++)
        print_costs(o, &costs[i], &costs[0], o->program[i]);
    return SH_OK;
}

static int parse(struct options *o, int argc, char **argv)
{
    static const struct option table[] = {{"config", required_argument, NULL, 'c'},
                                          {"pace", required_argument, NULL, 'p'},
                                          {"seconds", required_argument, NULL, 's'},
                                          {"rounds", required_argument, NULL, 'r'},
                                          {"clients", no_argument, NULL, 'k'},
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
    *o = (struct options){.pace = "fast", .seconds = 16.0, .rounds = 9};
    for (int c; (c = getopt_long(argc, argv, "", table, NULL)) >= 0;) {
        if (c == 'c') o->config = optarg;
        if (c == 'p') o->pace = optarg;
        if (c == 's') o->seconds = strtod(optarg, NULL);
        if (c == 'r') o->rounds = (uint32_t)strtoul(optarg, NULL, 10);
        if (c == 'k') o->clients = 1;
        if (c == 'h') fputs(HELP, stdout);
        if (c == 'h' || c == '?') return c == 'h' ? BENCH_OK : BENCH_USAGE;
    }
    o->program = argv + optind;
    o->n = (uint32_t)(argc - optind);
    if (o->n >= 1 && o->n <= MAX_PROGRAMS && o->rounds >= 1 && o->rounds <= MAX_ROUNDS && o->seconds >= 1.0) return -1;
    fprintf(stderr, "loop_cost: allowed are 1 to %d programs, 1 to %d rounds, at least 1 s; see --help\n", MAX_PROGRAMS,
            MAX_ROUNDS);
    return BENCH_USAGE;
}

int main(int argc, char **argv)
{
    struct options o;
    struct sh_err err = {0};
    const int status = parse(&o, argc, argv);
    if (status >= 0) return status;
    if (mkdtemp(folder) == NULL) return BENCH_FAILED;
    snprintf(config_path, sizeof config_path, "%s/terrain.yaml", folder);
    snprintf(mesh_path, sizeof mesh_path, "%s/terrain.obj", folder);
    snprintf(messages_path, sizeof messages_path, "%s/messages", folder);
    snprintf(stats_path, sizeof stats_path, "%s/stats.json", folder);
    int rc = o.config != NULL ? SH_OK : write_mesh(&err);
    if (rc == SH_OK && o.config == NULL) rc = write_config(&err);
    if (rc == SH_OK) rc = measure(&o, &err);
    unlink(config_path);
    unlink(mesh_path);
    unlink(stats_path);
    unlink(messages_path);
    rmdir(folder);
    if (rc != SH_OK) fprintf(stderr, "loop_cost: %s\n", err.text);
    return rc == SH_OK ? BENCH_OK : BENCH_FAILED;
}
