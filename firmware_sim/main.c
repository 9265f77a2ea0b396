/* SPDX-License-Identifier: MIT */
/* scanhead has head and studio, all commands. */
#include "firmware_sim/program.h"
#include "firmware_sim/app/studio/watch/watch.h"

#define COMMAND(name) &app_##name,
static const struct app_command *const COMMANDS[] = {APP_COMMANDS(COMMAND, COMMAND) NULL};
static const char *const ELSEWHERE[] = {NULL};

/* The only list of commands. */
static const struct app_command *const COMMANDS[] = {
    &app_run,   &app_record, &app_batch, &app_plan, &app_map,  &app_report, &app_coverage,
    &app_check, &app_list,   &app_init,  &app_view, &app_soak, NULL,
};

static int fail_unknown(const char *word)
{
    enum { N = sizeof COMMANDS / sizeof COMMANDS[0] - 1 };
    const char *known[N], *meant;
    for (size_t i = 0; i < N; i++)
        known[i] = COMMANDS[i]->name;
    meant = app_nearest(word, known, N);
    fprintf(stderr, "scanhead: unknown command %s%s%s%s; see scanhead --help\n", word,
            meant != NULL ? ", did you mean " : "", meant != NULL ? meant : "", meant != NULL ? "?" : "");
    return APP_USAGE;
}

static int run(int argc, char **argv)
{
    if (argc < 2) {
        help_print(COMMANDS, stderr);
        return APP_USAGE;
    }
    if (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0) {
        help_print(COMMANDS, stdout);
        return APP_OK;
    }
    if (strcmp(argv[1], "help") == 0) return help_run(COMMANDS, argc - 1, argv + 1);
    if (strcmp(argv[1], "--version") == 0) {
        printf("scanhead %s\n", scanhead_version());
        return APP_OK;
    }
    for (const struct app_command *const *c = COMMANDS; *c != NULL; c++)
        if (strcmp(argv[1], (*c)->name) == 0) return (*c)->run(argc - 1, argv + 1);
    return fail_unknown(argv[1]);
}

/* Configurations and blocks of pulses are on stacks. Threads get stacks as large as this limit; 384 KiB are enough. */
static int check_stack(void)
{
    enum { NEEDED_KIB = 1024 };
    struct rlimit limit;
    if (getrlimit(RLIMIT_STACK, &limit) != 0 || limit.rlim_cur >= NEEDED_KIB * 1024) return APP_OK;
    fprintf(stderr, "scanhead: the stack is limited to %llu KiB; allowed %d and more: ulimit -s %d\n",
            (unsigned long long)limit.rlim_cur / 1024, NEEDED_KIB, NEEDED_KIB);
    return APP_USAGE;
}

/* A command's output may still be in the buffer: a full disk or a closed pipe shows only when it is flushed here. */
int main(int argc, char **argv)
{
    /* A fixed threshold, so that freed memory of meshes always goes back to the system at once: glibc would raise it
     * after a large block was freed. */
    mallopt(M_MMAP_THRESHOLD, 4 << 20);
    int status = check_stack();
    if (status == APP_OK) status = run(argc, argv);
    errno = 0;
    const int failed = fflush(stdout) != 0 || ferror(stdout) != 0;
    if (!failed || status != APP_OK) return status;
    fprintf(stderr, "scanhead: standard output: writing failed%s%s\n", errno != 0 ? ": " : "",
            errno != 0 ? strerror(errno) : "");
    return APP_FAILED;
}
