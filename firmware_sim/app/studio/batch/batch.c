/* SPDX-License-Identifier: MIT */
/* scanhead batch: its options (batch.h). */
#include "firmware_sim/app/studio/batch/batch.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int take_sweep(void *values, const char *text)
{
    struct batch *b = values;
    struct sh_err err = {0};
    return batch_sweeps_add(&b->sweeps, text, &err) == SH_OK ? APP_OK : app_fail(&err);
}

/* ---- what was given */

/* Whether an ending is known is checked later, by `record` (batch_plan). */
static int read_format(struct batch *b)
{
    b->endings = strdup(b->format);
    if (b->endings == NULL) return app_fail(&(struct sh_err){SH_ENOMEM, "no memory"});
    for (char *p = b->endings, *next; p != NULL; p = next) {
        if ((next = strchr(p, ',')) != NULL) *next++ = '\0';
        if (*p == '.') p++;
        if (*p == '\0' || strchr(p, '/') != NULL || b->n_endings == RECORD_MAX_FILES)
            return app_usage(&app_batch, "--format %s: allowed are up to %d endings of record, as in ply,las",
                             b->format, RECORD_MAX_FILES);
        for (int i = 0; i < b->n_endings; i++)
            if (strcmp(b->ending[i], p) == 0)
                return app_usage(&app_batch, "--format %s: the ending %s is given twice; allowed once", b->format, p);
        b->ending[b->n_endings++] = p;
    }
    return APP_OK;
}

/* An option that sets a key would set it in every job, and the names of jobs would be wrong. */
static int check_option(const struct batch *b, const char *key)
{
    static const char *const by[][2] = {{"head.frames", "--frames"},
                                        {"output.crs", "--crs"},
                                        {"output.colour", "--colour"},
                                        {"loop.threads", "--threads"}};
    if (strcmp(key, "head.station") == 0)
        return app_usage(&app_batch, "--sweep %s: --stations sets the station of a job; allowed is any other key", key);
    for (size_t i = 0; i < sizeof by / sizeof by[0]; i++) {
        int given = strcmp(by[i][1], "--threads") == 0 && b->threads != NULL;
        for (int k = 0; k < b->options.n_names; k++)
            given |= strcmp(b->options.name[k], by[i][1]) == 0;
        const char *after = batch_after_key(by[i][0], key);
        if (given && after != NULL && (*after == '\0' || *after == '.'))
            return app_usage(&app_batch, "%s is in --sweep, but %s also sets %s; allowed is one of them", key, by[i][1],
                             *after == '\0' ? "it" : by[i][0]);
    }
    return APP_OK;
}

static int check_together(const struct batch *b)
{
    if (b->dir == NULL && !b->list) return app_usage(&app_batch, "-o DIR is needed");
    if (b->json && !b->list) return app_usage(&app_batch, "--json: allowed with --list");
    if (b->list && b->merge) return app_usage(&app_batch, "--list and --merge: allowed is one of them");
    if (b->merge && b->shard_text != NULL)
        return app_usage(&app_batch, "--merge checks all shards; allowed without --shard");
    for (uint32_t k = 0; k < b->sweeps.n; k++) {
        const char *key = b->sweeps.sweep[k].key;
        if (check_option(b, key) != APP_OK) return APP_USAGE;
        for (int i = 0; i < b->in.sets.n; i++) {
            const char *after = batch_after_key(b->in.sets.set[i], key);
            if (after != NULL && *after == '=')
                return app_usage(&app_batch, "%s is in --set and in --sweep; allowed is one of them", key);
            if (after != NULL && (*after == '.' || *after == '['))
                return app_usage(&app_batch, "--set %s would be lost: --sweep %s replaces it; allowed is one of them",
                                 b->in.sets.set[i], key);
        }
    }
    return APP_OK;
}

/* Only the manifest is checked here. The names of jobs' files come from the plan, and batch_run compares them with the
 * inputs. */
static int check_manifest(const struct batch *b, struct sh_err *err)
{
    char path[PATH_MAX];
    struct app_input in = b->in;
    if (b->list) return SH_OK;
    if (b->merge)
        snprintf(path, sizeof path, "%s/manifest.json", b->dir);
    else
        snprintf(path, sizeof path, "%s/manifest-%u-of-%u.jsonl", b->dir, b->shard, b->n_shards);
    const struct app_file file = {.option = "output", .path = path, .use = APP_WRITES};
    if (app_add_file(&in, &file) != APP_OK) return sh_fail(err, SH_EINPUT, "too many files");
    return app_check_files(&in, NULL, err);
}

static int work(struct batch *b)
{
    struct sh_err err = {0};
    int status = check_together(b), rc;
    if (status == APP_OK) status = read_format(b);
    if (status != APP_OK) return status;
    rc = batch_stations_parse(b->stations_text, &b->stations, &err);
    if (rc == SH_OK)
        rc = batch_shard_parse(b->shard_text != NULL ? b->shard_text : "1/1", &b->shard, &b->n_shards, &err);
    if (rc == SH_OK) rc = check_manifest(b, &err);
    if (rc != SH_OK) return app_fail(&err);
    app_catch_signals();
    status = batch_plan(b);
    if (status != APP_OK) return status;
    return b->list ? batch_list(b) : b->merge ? batch_merge(b) : batch_run(b);
}

#define AT(member) offsetof(struct batch, member)

/* clang-format off */
static struct app_option OPTIONS[APP_MAX_OPTIONS + 1] = {
    {APP_TEXT, "output", "DIR", .letter = 'o', .at = AT(dir),
     .help = "the campaign's folder, with the files of all jobs and the manifests; it is made if it doesn't exist"},
    {APP_CALL, "sweep", "KEY=A,B,...", .apply = take_sweep,
     .help = "values of a configuration key, or KEY=FIRST:LAST:STEP; repeated: all combinations, the last key varies "
             "fastest"},
    {APP_TEXT, "stations", "all|LIST", .at = AT(stations_text),
     .help = "the stations, or the stops of the platform, as in 1,3-5 (default all)"},
    {APP_TEXT, "format", "A,B,...", .at = AT(format), .help = "endings of files, as for record (default ply)"},
    {APP_FLAG, "list", NULL, .at = AT(list),
     .help = "print the jobs without doing them; with -o also which are done, by the sizes of their files"},
    {APP_FLAG, "json", NULL, .at = AT(json), .help = "with --list: as JSON"},
    {APP_TEXT, "shard", "I/N", .at = AT(shard_text), .help = "only every N-th job, from the I-th on (default 1/1: all)"},
    {APP_FLAG, "merge", NULL, .at = AT(merge),
     .help = "check all files of all shards, and write manifest.json if all are complete"},
    {APP_FLAG, "surfaces", NULL, .at = AT(surfaces),
     .help = "also write the surfaces of each job as CSV: NAME.surfaces.csv, as `record --surfaces` does"},
    {APP_FLAG, "force", NULL, .at = AT(force),
     .help = "repeat jobs that were done with another configuration, release, ..."},
    OPTION_SET,
    {APP_TEXT, "scenario", "FILE", .at = AT(in.scenario), .file = APP_READS,
     .help = "add the faults of this file to those of the configuration in each job; a bare name is one of "
             "config/faults. A job that loses frames by them fails"},
    {APP_TEXT, "threads", "N", .at = AT(threads), .help = "threads that cast; 0: one per processor. The files do not "
                                                          "depend on it"},
    {APP_FLAG, "quiet", NULL, .at = AT(quiet), .help = "no progress"},
    OPTION_END
};
/* clang-format on */

static int batch_run_command(int argc, char **argv)
{
    /* These options are passed on to record: they name no file, and make sense for one station off line. */
    static const char *const passed[] = {
        "frames", "duration",  "ascii",  "ply-names",   "ply-columns", "colour",      "colour-limits", "colour-rgb",
        "mesh",   "long-edge", "sparse", "sparse-seed", "las-version", "empty-shots", "crs",           NULL};
    struct batch *b = calloc(1, sizeof *b);
    if (b == NULL) return app_fail(&(struct sh_err){SH_ENOMEM, "no memory"});
    app_pass_options(OPTIONS, &app_record, passed, AT(options));
    int status = app_parse(&app_batch, argc, argv, &b->in, b);
    if (b->stations_text == NULL) b->stations_text = "all";
    if (b->format == NULL) b->format = "ply";
    if (status == APP_GO_ON) status = work(b);
    batch_free(b);
    free(b);
    return status;
}

static const char HELP_NOTES[] =
    "A job is one station with one combination of values. Each has a number, and its files begin with it:\n"
    "\n"
    "  0002_station-2_head.prr_hz=300000.ply\n"
    "\n"
    "All combinations are checked before the first job begins. A job's files appear complete or not at all.\n"
    "After them its line, with sizes and SHA-256, is added to manifest-I-of-N.jsonl. The same command again does\n"
    "the jobs that are not done: after a signal, a crash or a failed job. It checks the existing files. The number\n"
    "of shards may change each time.\n"
    "\n"
    "Files are the same bytes for any number of shards and threads, on processors of one kind. If something\n"
    "that they depend on has changed (the configuration, a mesh, the profile, a value, the release, the kind of\n"
    "processor), the command ends and names it, unless --force is given.\n"
    "\n"
    "--merge needs the same CONFIG, --sweep, --stations, --format and options as the shards had.\n"
    "\n"
    "Exit status 1: a job failed or is incomplete; a signal came; another process does this shard.\n";

const struct app_command app_batch = {
    .name = "batch",
    .operand = {"CONFIG"},
    .needs = "-o DIR",
    .summary = "scan all stations and values of a campaign",
    .options = OPTIONS,
    .notes = HELP_NOTES,
    .run = batch_run_command,
};
