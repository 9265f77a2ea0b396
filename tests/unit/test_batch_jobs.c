/* SPDX-License-Identifier: MIT */
/* A campaign of four jobs from its list to manifest.json, in this process: which jobs there are, what is said of them,
 * what a manifest has of their files, and what follows where a file is not as it was. */
#include "tests/unit/commands_rig.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "firmware_sim/app/studio/batch/manifest.h"

/* The jobs of noise.seed=1,2 at two stations: all stations of the first value, then all of the second. */
static const char *const NAMES[] = {"0001_station-1_noise.seed=1", "0002_station-2_noise.seed=1",
                                    "0003_station-1_noise.seed=2", "0004_station-2_noise.seed=2"};
enum { N_JOBS = 4 };

static int go_there(void **state)
{
    (void)state;
    if (commands_begin() != 0) return -1;
    write_text("floor.obj", "v -30 -30 0\nv 30 -30 0\nv 30 30 0\nv -30 30 0\nf 1 2 3 4\n");
    write_text("c.yaml",
               "head: {profile: sphere, step_deg: 10}\nscene: {meshes: [{file: floor.obj, up: z, scale: 1}]}\n"
               "stations: [{position_m: [0, 0, 2]}, {position_m: [4, 0, 2]}]\noutput: {crs: local}\n");
    return 0;
}

/* The first job of a command is always named; which others are depends on the machine. */
static void keep_first_job(char *text)
{
    static const char end[] = " here done";
    char *first = strstr(text, end);
    while (first != NULL) {
        char *again = strstr(first + 1, end);
        if (again == NULL) return;
        char *begin = again, *rest = strchr(again, '\n') + 1;
        while (begin[-1] != '\n')
            begin--;
        memmove(begin, rest, strlen(rest) + 1);
    }
}

/* Runs `batch c.yaml WORDS`, and compares what is printed. said NULL: anything. */
static void batch(const char *words, int want, const char *printed, const char *said)
{
    char text[512];
    snprintf(text, sizeof text, "c.yaml %s", words);
    does(&app_batch, text, want);
    assert_string_equal(on_out, printed);
    keep_first_job(on_err);
    if (said != NULL) assert_string_equal(on_err, said);
}

#define SEEDS "--sweep noise.seed=1,2 "

/* Returns the lines of a list of the jobs from `first` on, each `step`-th, with `mark` before each. */
static const char *list_of(const char *mark, int first, int step)
{
    static char text[1024];
    size_t n = 0;
    text[0] = '\0';
    for (int i = first; i < N_JOBS; i += step)
        n += (size_t)snprintf(text + n, sizeof text - n, "%s%s station %d noise.seed=%d\n", mark, NAMES[i], 1 + i % 2,
                              1 + i / 2);
    return text;
}

static void jobs_are_listed(void **state)
{
    (void)state;
    batch(SEEDS "--list", 0, list_of("", 0, 1), "");
    batch(SEEDS "--list --shard 2/3", 0, list_of("", 1, 3), "");
    batch(SEEDS "--list --shard 1/2", 0, list_of("", 0, 2), "");
    batch(SEEDS "--list -o none", 0, list_of("-    ", 0, 1), "");
    batch("--list --stations 2", 0, "0001_station-2 station 2\n", "");
    char json[2048] = "[\n";
    for (int i = 0; i < N_JOBS; i++)
        snprintf(json + strlen(json), sizeof json - strlen(json),
                 "  {\n    \"job\": %d,\n    \"name\": \"%s\",\n    \"station\": %d,\n    \"set\": [\n      "
                 "\"noise.seed=%d\"\n    ]\n  }%s\n",
                 i + 1, NAMES[i], 1 + i % 2, 1 + i / 2, i < N_JOBS - 1 ? "," : "");
    strcat(json, "]\n");
    batch(SEEDS "--list --json", 0, json, "");
}

/* The sum that coreutils work out. */
static void sum_of(const char *path, char sum[BATCH_SHA_LEN])
{
    char command[160];
    snprintf(command, sizeof command, "sha256sum '%s'", path);
    FILE *in = popen(command, "r");
    assert_non_null(in);
    assert_int_equal(fscanf(in, "%64[0-9a-f]", sum), 1);
    assert_int_equal(pclose(in), 0);
}

static struct batch_entry entry_of[N_JOBS + 1];

static int keep(void *ctx, struct batch_entry *entry, struct sh_err *err)
{
    (void)ctx, (void)err;
    assert_in_range(entry->job, 1, N_JOBS);
    batch_entry_free(&entry_of[entry->job]);
    entry_of[entry->job] = *entry;
    return SH_OK;
}

/* The points of a .ply, by its header. */
static unsigned points_in(const char *path)
{
    char head[4096] = "";
    unsigned n = 0;
    FILE *in = fopen(path, "r");
    assert_non_null(in);
    assert_true(fread(head, 1, sizeof head - 1, in) > 100);
    fclose(in);
    const char *at = strstr(head, "element vertex ");
    assert_true(at != NULL && sscanf(at, "element vertex %u", &n) == 1);
    return n;
}

static void expect_files(const struct batch_entry *entry, const char *name, const char *const *ending, uint32_t n)
{
    assert_int_equal(entry->n_files, n);
    for (uint32_t i = 0; i < n; i++) {
        char want[80], path[96], sum[BATCH_SHA_LEN];
        struct stat st;
        snprintf(want, sizeof want, "%s%s", name, ending[i]);
        snprintf(path, sizeof path, "d/%s", want);
        assert_string_equal(entry->file[i].name, want);
        assert_int_equal(stat(path, &st), 0);
        assert_int_equal(entry->file[i].bytes, st.st_size);
        sum_of(path, sum);
        assert_string_equal(entry->file[i].sha, sum);
    }
}

/* Takes the entries of the jobs from the manifests of all shards, and compares them with the files. */
static void read_entries(void)
{
    struct sh_err err;
    char config[BATCH_SHA_LEN], path[96];
    assert_int_equal(batch_manifest_read("d", keep, NULL, NULL, &err), SH_OK);
    sum_of("c.yaml", config);
    for (int i = 0; i < N_JOBS; i++) {
        const struct batch_entry *e = &entry_of[i + 1];
        expect_files(e, NAMES[i], (const char *const[]){".ply", ".surfaces.csv"}, 2);
        snprintf(path, sizeof path, "d/%s.ply", NAMES[i]);
        assert_int_equal(e->points, points_in(path));
        assert_string_equal(e->made.configuration, config);
        assert_string_equal(e->made.inputs, entry_of[1].made.inputs);
        assert_string_equal(e->made.engine, entry_of[1].made.engine);
        assert_true(e->pulses > e->points && e->points > 100 && strlen(e->stream_sha) == 64 && e->seconds >= 0.0);
        for (int k = 0; k < i; k++)
            assert_string_not_equal(e->made.job, entry_of[k + 1].made.job);
    }
}

static void put_job(FILE *out, int i)
{
    const struct batch_entry *e = &entry_of[i + 1];
    fprintf(out,
            "    {\n      \"job\": %d,\n      \"name\": \"%s\",\n      \"station\": %d,\n      \"set\": [\n        "
            "\"noise.seed=%d\"\n      ],\n      \"inputs_sha256\": \"%s\",\n      \"job_sha256\": \"%s\",\n"
            "      \"pulses\": %llu,\n      \"points\": %llu,\n      \"stream_sha256\": \"%s\",\n      \"files\": [\n",
            i + 1, NAMES[i], 1 + i % 2, 1 + i / 2, e->made.inputs, e->made.job, (unsigned long long)e->pulses,
            (unsigned long long)e->points, e->stream_sha);
    for (uint32_t k = 0; k < e->n_files; k++)
        fprintf(out,
                "        {\n          \"name\": \"%s\",\n          \"bytes\": %llu,\n          \"sha256\": \"%s\"\n"
                "        }%s\n",
                e->file[k].name, (unsigned long long)e->file[k].bytes, e->file[k].sha, k + 1 < e->n_files ? "," : "");
    fprintf(out, "      ]\n    }%s\n", i + 1 < N_JOBS ? "," : "");
}

static void the_whole_manifest_is_right(void)
{
    char *want = NULL, got[16384] = "";
    size_t len;
    FILE *out = open_memstream(&want, &len), *in = fopen("d/manifest.json", "r");
    assert_true(out != NULL && in != NULL);
    fprintf(out,
            "{\n  \"program\": \"%s\",\n  \"engine\": \"%s\",\n  \"configuration\": \"c.yaml\",\n"
            "  \"configuration_sha256\": \"%s\",\n  \"set\": [\n    \"output.tolerance_m=0.002\"\n  ],\n"
            "  \"options\": [\n    \"--ascii\"\n  ],\n  \"jobs\": [\n",
            entry_of[1].made.program, entry_of[1].made.engine, entry_of[1].made.configuration);
    for (int i = 0; i < N_JOBS; i++)
        put_job(out, i);
    fputs("  ]\n}\n", out);
    fclose(out);
    assert_true(fread(got, 1, sizeof got - 1, in) > 0);
    fclose(in);
    assert_string_equal(got, want);
    free(want);
}

/* A setting of speed is no part of a job. */
#define ALL SEEDS "-o d --surfaces --ascii --set output.tolerance_m=0.002 --set loop.threads=1 "

static void jobs_are_done_once(void **state)
{
    (void)state;
    batch(ALL "--shard 2/3", 0, "",
          "scanhead: job 2 of 4, 0002_station-2_noise.seed=1: 0 of 1 here done\n"
          "scanhead: shard 2/3: 1 jobs done, 1 of them now; meshes read 1 time\n");
    batch(ALL "--merge", 1, "",
          "scanhead: job 1, 0001_station-1_noise.seed=1: missing\n"
          "scanhead: job 3, 0003_station-1_noise.seed=2: missing\n"
          "scanhead: job 4, 0004_station-2_noise.seed=2: missing\n"
          "scanhead: d: 3 of 4 jobs are incomplete; run their shards again\n");
    batch(ALL, 0, "",
          "scanhead: job 1 of 4, 0001_station-1_noise.seed=1: 1 of 4 here done\n"
          "scanhead: shard 1/1: 4 jobs done, 3 of them now; meshes read 1 time\n");
    batch(ALL "--set loop.threads=2", 0, "", "scanhead: shard 1/1: 4 jobs done, 0 of them now; meshes read 0 times\n");
    batch(ALL "--list", 0, list_of("done ", 0, 1), "");
    batch(ALL "--merge", 0, "", "scanhead: 4 jobs are complete: d/manifest.json\n");
    read_entries();
    the_whole_manifest_is_right();
}

/* A job of the same name that writes another file is another job. */
static void other_formats_are_other_jobs(void **state)
{
    (void)state;
    batch("-o g --stations 1 --format obj", 0, "", NULL);
    batch("-o g --stations 1 --format obj --list", 0, "done 0001_station-1 station 1\n", "");
    batch(
        "-o g --stations 1 --format las --list", 1, "",
        "scanhead: g: its job 1 was made with another station, other values of keys or other options; --force repeats "
        "such jobs, another -o begins another campaign\n");
}

/* A file that is too short is found by its size, and a changed file by its checksum. A missing file is found, too. Only
 * the jobs of such files are done again. */
static void a_changed_file_is_made_again(void **state)
{
    (void)state;
    char said[1024];
    const unsigned long long was = entry_of[3].file[0].bytes;
    FILE *file = fopen("d/0002_station-2_noise.seed=1.ply", "r+");
    assert_non_null(file);
    fseek(file, -1, SEEK_END); /* the last newline */
    fputc(' ', file);
    fclose(file);
    assert_int_equal(truncate("d/0003_station-1_noise.seed=2.ply", 10), 0);
    assert_int_equal(unlink("d/0004_station-2_noise.seed=2.surfaces.csv"), 0);
    snprintf(said, sizeof said,
             "scanhead: warning: d/0003_station-1_noise.seed=2.ply: has 10 bytes, but had %llu; job 3 is to be done "
             "again\nscanhead: warning: d/0004_station-2_noise.seed=2.surfaces.csv: is missing; job 4 is to be done "
             "again\n",
             was);
    char listed[1024];
    snprintf(listed, sizeof listed, "done %s station 1 noise.seed=1\ndone %s station 2 noise.seed=1\n", NAMES[0],
             NAMES[1]); /* the second file's size is right */
    strcat(listed, list_of("-    ", 2, 1));
    batch(ALL "--list", 0, listed, said);
    snprintf(
        said, sizeof said,
        "scanhead: job 2, 0002_station-2_noise.seed=1: d/0002_station-2_noise.seed=1.ply: its contents have changed "
        "(sha256)\n"
        "scanhead: job 3, 0003_station-1_noise.seed=2: d/0003_station-1_noise.seed=2.ply: has 10 bytes, but had "
        "%llu\n"
        "scanhead: job 4, 0004_station-2_noise.seed=2: d/0004_station-2_noise.seed=2.surfaces.csv: is missing\n"
        "scanhead: d: 3 of 4 jobs are incomplete; run their shards again\n",
        was);
    batch(ALL "--merge", 1, "", said);
    snprintf(said, sizeof said,
             "scanhead: warning: d/0003_station-1_noise.seed=2.ply: has 10 bytes, but had %llu; job 3 is done again\n"
             "scanhead: job 3 of 4, 0003_station-1_noise.seed=2: 1 of 2 here done\n"
             "scanhead: shard 1/2: 2 jobs done, 1 of them now; meshes read 1 time\n",
             was);
    batch(ALL "--shard 1/2", 0, "", said);
    assert_int_not_equal(access("d/manifest.json", F_OK), 0); /* it was that of the files before */
    batch(ALL "--shard 2/2 --quiet", 0, "",
          "scanhead: warning: d/0002_station-2_noise.seed=1.ply: its contents have changed (sha256); job 2 is done "
          "again\n"
          "scanhead: warning: d/0004_station-2_noise.seed=2.surfaces.csv: is missing; job 4 is done again\n");
    batch(ALL "--merge --quiet", 0, "", "");
    read_entries();
    the_whole_manifest_is_right();
}

static void another_campaign_is_refused(void **state)
{
    (void)state;
#define REST "-o d --surfaces --ascii --set output.tolerance_m=0.002 "
    batch("--sweep noise.seed=1 " REST, 1, "",
          "scanhead: d: has a job 4, but this campaign ends with job 2; --force leaves that one in place, another -o "
          "begins another campaign\n");
    batch(
        "--sweep noise.seed=1,3 " REST, 1, "",
        "scanhead: d: its job 3 was made with another station, other values of keys or other options; --force repeats "
        "such jobs, another -o begins another campaign\n");
    /* A setting of speed changes no bytes, but where it is swept it is in the job's name. */
    batch("--stations 1 --sweep loop.threads=1,2 -o e", 0, "", NULL);
    batch(
        "--stations 1 --sweep loop.threads=1,3 -o e", 1, "",
        "scanhead: e: its job 2 was made with another station, other values of keys or other options; --force repeats "
        "such jobs, another -o begins another campaign\n");
    write_text("d/0009_x", "");
    write_text("d/0002_y", "");
    write_text("d/002_z", "");
    write_text("d/x0002_y", "");
    batch(ALL "--merge", 0, "",
          "scanhead: warning: d: 2 files belong to no job of this campaign, the first: 0002_y\n"
          "scanhead: 4 jobs are complete: d/manifest.json\n");
    batch(SEEDS "-o none --merge", 2, "", "scanhead: -o none: no such folder; allowed is the folder of a campaign\n");
    batch("-o c.yaml", 2, "", "scanhead: -o c.yaml: the folder cannot be made: Not a directory\n");
    batch("-o nowhere/d", 2, "", "scanhead: -o nowhere/d: the folder cannot be made: No such file or directory\n");
    batch("-o c.yaml/d", 2, "", "scanhead: -o c.yaml/d: the folder cannot be made: Not a directory\n");
}

/* An error of a combination names its values, and no job is begun. */
static void what_is_wrong_is_said_before_the_first_job(void **state)
{
    (void)state;
    batch("-o f --sweep noise.seed=1,x", 2, "", NULL);
    assert_int_not_equal(access("f", F_OK), 0);
    batch("-o f --stations 3", 2, "", "scanhead: --stations 3: there is no station 3; allowed 1 to 2\n");
    batch("-o f --stations 1,3 --sweep noise.seed=1,2 --sweep noise.ball.radius_m=0", 2, "",
          "scanhead: --stations 1,3: there is no station 3; allowed 1 to 2\n"
          "scanhead: no job was begun; the values are noise.seed=1, noise.ball.radius_m=0\n");
    batch(
        "-o f --set time.epoch=utc", 2, "",
        "scanhead: c.yaml: time.epoch: utc is the clock of the machine, but a campaign's files must not depend on when "
        "they are made; allowed none, or a date such as 2026-01-01T00:00:00Z\n");
    for (int i = 0; i <= N_JOBS; i++)
        batch_entry_free(&entry_of[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(jobs_are_listed),
        cmocka_unit_test(jobs_are_done_once),
        cmocka_unit_test(other_formats_are_other_jobs),
        cmocka_unit_test(a_changed_file_is_made_again),
        cmocka_unit_test(another_campaign_is_refused),
        cmocka_unit_test(what_is_wrong_is_said_before_the_first_job),
    };
    return cmocka_run_group_tests_name("batch", tests, go_there, commands_end);
}
