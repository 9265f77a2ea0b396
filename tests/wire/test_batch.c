/* SPDX-License-Identifier: MIT */
/* Campaigns have the same bytes in 1, 2 and 7 shards, by Slurm's variables and by GNU parallel. Jobs may fail. */
#include "tests/wire/batch_rig.h"

/* One job by `record` is the same file. So is the whole campaign in 2 and in 7 shards, which run from the last to the
 * first. One of the seven shards has no job. */
static void test_shards(void **state)
{
    struct wire *wire = *state;
    batch_shards(wire, "two", 2, "2");
    batch_shards(wire, "seven", 7, "1");
    batch_expect_equal(wire, "two", "ref");
    batch_expect_equal(wire, "seven", "ref");
    char config[352], ply[352];
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "alone.ply"));
    wire_run(
        wire,
        WITH("record", config, "-o", ply, "--set", "head.prr_hz=150000", "--station", "2", "--crs", "utm", "--quiet"),
        0);
    batch_expect_same(ply, batch_file(wire, "ref", 3, ".ply"));
}

/* One process shares meshes among all jobs, and a BVH among jobs at the same place. That changes no byte. There are
 * two scanners, two places of the second one, and three rates of the first. The jobs run in one process, and then in
 * one process for each job. */
static void test_shared(void **state)
{
    static const char sweep[] = "stations.1.position_m=[0.5,0.25,1.5],[-0.5,0,1.25]";
    struct wire *wire = *state;
    batch_change(wire_path(wire, "config.yaml"), "heading_deg: 30", "scanner: {head: {prr_hz: 300000}}");
    batch_expect(wire, "one", WITH("--sweep", sweep), 0, "12 jobs done, 12 of them now; meshes read 1 time\n");
    batch_expect(wire, "one", WITH("--sweep", sweep, "--merge"), 0, "12 jobs are complete");
    for (int i = 1; i <= 12; i++) {
        char shard[32];
        snprintf(shard, sizeof shard, "%d/12", i);
        batch_expect(wire, "each", WITH("--sweep", sweep, "--shard", shard), 0, "1 jobs done, 1 of them now");
    }
    batch_expect(wire, "each", WITH("--sweep", sweep, "--merge"), 0, "12 jobs are complete");
    batch_expect_same(batch_in(wire, "each", "manifest.json"), batch_in(wire, "one", "manifest.json"));
}

/* A mesh that can't be loaded fails its jobs, and no others. A value out of range stops all before the first one. */
static void test_failing(void **state)
{
    struct wire *wire = *state;
    char sweep[800];
    wire_write_text(wire, "broken.obj", "v 0 0 0\nf 1 2 3\n");
    snprintf(sweep, sizeof sweep, "scene.meshes.0.file=%s,%s", wire_path(wire, "room.obj"),
             wire_path(wire, "broken.obj"));
    batch_expect(wire, "one", WITH("--sweep", sweep), 1, "6 of 12 jobs of shard 1/1 failed");
    batch_expect(wire, "one", WITH("--sweep", sweep), 1, ": 6 of 12 here done\n"); /* the others are not done again */
    char *text = wire_read(batch_in(wire, "one", "manifest-1-of-1.jsonl"), NULL);
    int lines = 0;
    for (const char *at = text; (at = strchr(at, '\n')) != NULL; at++)
        lines++;
    assert_int_equal(lines, 6);
    free(text);
    batch_expect(wire, "none", WITH("--sweep", "head.lines_hz=50,1e9"), 2, "head.lines_hz");
    batch_expect(wire, "none", WITH("--stations", "3"), 2, "allowed 1 to 2");
    batch_expect(wire, "none", WITH("--set", "time.epoch=utc"), 2, "time.epoch");
    /* an option, or --set, sets these keys, too */
    batch_expect(wire, "none", WITH("--sweep", "head.frames=1,2", "--frames", "1"), 2, "--frames also sets it");
    batch_expect(wire, "none", WITH("--sweep", "output.crs=local,utm"), 2, "--crs also sets it");
    batch_expect(wire, "none", WITH("--sweep", "head.station=1,2"), 2, "--stations sets the station");
    batch_expect(wire, "none", WITH("--sweep", "scene.meshes.0.scale=1,2", "--set", "scene.meshes[0].scale=3"), 2,
                 "is in --set and in --sweep");
    /* 3 x 167 x 1000 combinations at 2 stations: the first one shows that a million jobs are not enough */
    batch_expect(wire, "none", WITH("--sweep", "noise.seed=1:1000:1", "--sweep", "head.lines_hz=40:123:0.5"), 2,
                 "501000 combinations of --sweep at 2 stations are 1002000 jobs; allowed are 1000000");
    text = wire_read(wire_path(wire, "err"), NULL);
    assert_null(strstr(text, "the values are")); /* those of one job are not the reason */
    free(text);
    assert_int_not_equal(access(wire_path(wire, "none"), F_OK), 0); /* nothing was begun */
}

/* A scanner whose scans never end can't record. Such a scanner stops only campaigns in which its station is chosen. */
static void test_chosen_stations(void **state)
{
    struct wire *wire = *state;
    char config[352];
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    batch_change(config, "heading_deg: 30,", "heading_deg: 30, scanner: {head: {frames: 0}},");
    wire_run(wire, WITH("batch", config, "-o", "x", "--format", "ply", "--list", "--stations", "1"), 0);
    wire_expect_usage(wire, WITH("batch", config, "-o", "x", "--format", "ply", "--list", "--stations", "2"),
                      "head.frames");
    wire_expect_usage(wire, WITH("batch", config, "-o", "x", "--format", "ply", "--list"), "head.frames");
    wire_expect_usage(wire, WITH("batch", config, "-o", "x", "--format", "las,ply,.las", "--list"),
                      "batch: --format las,ply,.las: the ending las is given twice; allowed once");
}

/* Jobs are counted from 1 over all shards; a job's shard is its number modulo their count (batch.h). */
static void test_list(void **state)
{
    struct wire *wire = *state;
    char config[352], dir[352];
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(dir, sizeof dir, "%s", wire_path(wire, "listed"));
    static const char *const sweeps[] = {"head.prr_hz=100000,150000", "head.lines_hz=50,60"};
    const char *const list[] = {"batch",      config, "-o",      dir,       "--format", "ply",
                                "--stations", "2",    "--sweep", sweeps[0], "--sweep",  sweeps[1],
                                "--shard",    "2/2",  "--list",  "--json",  NULL};
    wire_run(wire, list, 0);
    char *text = wire_read(wire_path(wire, "out"), NULL);
    assert_string_equal(text, "[\n  {\n    \"job\": 2,\n"
                              "    \"name\": \"0002_station-2_head.prr_hz=100000_head.lines_hz=60\",\n"
                              "    \"station\": 2,\n    \"set\": [\n      \"head.prr_hz=100000\",\n"
                              "      \"head.lines_hz=60\"\n    ],\n    \"done\": false\n  },\n"
                              "  {\n    \"job\": 4,\n"
                              "    \"name\": \"0004_station-2_head.prr_hz=150000_head.lines_hz=60\",\n"
                              "    \"station\": 2,\n    \"set\": [\n      \"head.prr_hz=150000\",\n"
                              "      \"head.lines_hz=60\"\n    ],\n    \"done\": false\n  }\n]\n");
    free(text);
}

/* All files that are written with a mesh are the job's: for two frames, two images. Without one of them the job isn't
 * whole. */
static void expect_images(struct wire *wire, const char *format)
{
    char config[352], dir[352];
    const char *job[] = {"batch",    config,  "-o",       dir,    "--stations", "2",  "--frames", "2",
                         "--colour", "range", "--format", format, "--quiet",    NULL, NULL};
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(dir, sizeof dir, "%s", wire_path(wire, format));
    assert_int_equal(wire_wait(wire, wire_spawn(wire, job, "out", "err", -1)), 0);
    assert_int_equal(unlink(batch_in(wire, format, "0001_station-2.2.png")), 0);
    job[sizeof job / sizeof job[0] - 2] = "--merge";
    assert_int_equal(wire_wait(wire, wire_spawn(wire, job, "out", "err", -1)), 1);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(err, "0001_station-2.2.png: is missing"));
    free(err);
}

static void test_images(void **state)
{
    expect_images(*state, "obj");
    expect_images(*state, "fbx");
}

/* A campaign says once what is true of each combination. */
static void test_one_warning(void **state)
{
    struct wire *wire = *state;
    char set[352];
    snprintf(set, sizeof set, "head.settings_file=%s", wire_write_text(wire, "kept.json", "{}"));
    batch_expect(wire, "none", WITH("--list", "--set", set), 0, "kept.json");
    char *err = wire_read(wire_path(wire, "err"), NULL);
    assert_null(strstr(strstr(err, "kept.json: is not used") + 1, "kept.json: is not used"));
    free(err);
}

static int points_of(struct wire *wire, const char *dir, const char *name)
{
    int n = -1;
    char *text = wire_read(batch_in(wire, dir, name), NULL);
    const char *at = strstr(text, "element vertex ");
    assert_non_null(at);
    assert_int_equal(sscanf(at, "element vertex %d", &n), 1);
    free(text);
    return n;
}

/* The faults of a scenario are in each job, whatever scanner its station has. The file's contents count, not its
 * name. */
static void test_scenario(void **state)
{
    struct wire *wire = *state;
    char config[352], dir[352], scenario[352], other[352];
    const char *job[] = {"batch", config, "-o", dir, "--format", "ply", "--quiet", "--scenario", scenario, NULL};
    const char **last = &job[sizeof job / sizeof job[0] - 2];
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(dir, sizeof dir, "%s", wire_path(wire, "dark"));
    snprintf(scenario, sizeof scenario, "%s", wire_path(wire, "dark.yaml"));
    snprintf(other, sizeof other, "%s", wire_path(wire, "other.yaml"));
    batch_change(config, "heading_deg: 30,", "heading_deg: 30, scanner: {noise: {seed: 7}},");
    wire_write_text(wire, "dark.yaml", "faults: [{kind: laser_off, from_pulse: 3000}]\n");
    assert_int_equal(wire_wait(wire, wire_spawn(wire, job, "out", "err", -1)), 0);
    /* Without the fault 3,900 of a job's 10,000 pulses have points. The others are blind. */
    assert_in_range(points_of(wire, "dark", "0001_station-1.ply"), 1000, 3000);
    assert_in_range(points_of(wire, "dark", "0002_station-2.ply"), 1000, 3000);
    wire_write_text(wire, "other.yaml", "faults: [{kind: laser_off, from_pulse: 3000}]\n");
    *last = other;
    assert_int_equal(wire_wait(wire, wire_spawn(wire, job, "out", "err", -1)), 0);
    batch_change(other, "3000", "4000");
    assert_int_equal(wire_wait(wire, wire_spawn(wire, job, "out", "err", -1)), 1);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(err, "scenario"));
    free(err);
}

/* ---- the manifest of the whole campaign, beside its files */

static void next(const char **at, const char *text)
{
    const char *found = strstr(*at, text);
    if (found == NULL) fail_msg("no %s in %.300s", text, *at);
    *at = found + strlen(text);
}

/* coreutils says the hash of a file. */
static void next_sha(const char **at, const char *key, const char *path)
{
    char command[512], sha[65] = "", text[128];
    snprintf(command, sizeof command, "sha256sum '%s'", path);
    FILE *in = popen(command, "r");
    assert_true(in != NULL && fscanf(in, "%64[0-9a-f]", sha) == 1);
    assert_int_equal(pclose(in), 0);
    snprintf(text, sizeof text, "\"%s\": \"%s\"", key, sha);
    next(at, text);
}

static void next_file(struct wire *wire, const char **at, int job, const char *ending)
{
    char text[256];
    struct stat st;
    assert_int_equal(stat(batch_file(wire, "ref", job, ending), &st), 0);
    snprintf(text, sizeof text, "\"name\": \"%s%s\",\n          \"bytes\": %lld,", batch_names[job], ending,
             (long long)st.st_size);
    next(at, text);
    next_sha(at, "sha256", batch_file(wire, "ref", job, ending));
}

/* A job's pulses are those that the head casts: each is a point or a shot without echo. The stream's hash is that of
 * the same scan by `record`. */
static void next_job(struct wire *wire, const char **at, int job)
{
    static const char *const rates[] = {"100000", "150000", "200000"};
    char text[256], ply[64], config[352], set[64], stats[352], out[352];
    char hex[65];
    snprintf(ply, sizeof ply, "%s.ply", batch_names[job]);
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(set, sizeof set, "head.prr_hz=%s", rates[job / 2]);
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    snprintf(out, sizeof out, "%s", wire_path(wire, "again.ply"));
    wire_run(wire,
             WITH("record", config, "-o", out, "--set", set, "--station", job % 2 ? "2" : "1", "--crs", "utm",
                  "--stats", stats, "--quiet"),
             0);
    snprintf(
        text, sizeof text,
        "{\n      \"job\": %d,\n      \"name\": \"%s\",\n      \"station\": %d,\n      \"set\": [\n        \"%s\"\n"
        "      ],",
        job + 1, batch_names[job], job % 2 + 1, set);
    next(at, text);
    stats_hash(wire, hex);
    snprintf(text, sizeof text, "\"pulses\": %llu,\n      \"points\": %d,\n      \"stream_sha256\": \"%s\"",
             (unsigned long long)stats_uint(wire, "pulses"), points_of(wire, "ref", ply), hex);
    next(at, text);
    next_file(wire, at, job, ".ply");
    next_file(wire, at, job, ".las");
}

static void test_manifest(void **state)
{
    struct wire *wire = *state;
    char *text = wire_read(batch_in(wire, "ref", "manifest.json"), NULL);
    const char *at = text;
    next(&at, "\"configuration\": \"config.yaml\",\n  ");
    next_sha(&at, "configuration_sha256", wire_path(wire, "config.yaml"));
    next(&at, ",\n  \"set\": [],\n  \"options\": [\n    \"--crs\",\n    \"utm\"\n  ],\n  \"jobs\": [\n");
    for (int job = 0; job < BATCH_JOBS; job++)
        next_job(wire, &at, job);
    assert_null(strstr(at, "\"job\""));
    free(text);
}

/* ---- engines */

static void by_script(struct wire *wire, const char *shell, const char *script, const char *dir)
{
    struct batch_words w;
    batch_campaign(wire, &w, WITH(script), dir, WITH("--quiet"));
    wire_run_program(wire, shell, w.word, 0);
}

/* Bash runs the script once for each task, with Slurm's variables, as Slurm does. Directives are comments. Tasks 4, 6
 * and 8 of an array are shards 1 to 3. */
static void test_slurm(void **state)
{
    struct wire *wire = *state;
    setenv("SCANHEAD", wire_program(), 1);
    setenv("SLURM_ARRAY_TASK_MIN", "4", 1);
    setenv("SLURM_ARRAY_TASK_STEP", "2", 1);
    setenv("SLURM_ARRAY_TASK_COUNT", "3", 1);
    setenv("SLURM_CPUS_PER_TASK", "1", 1);
    for (const char *const *id = WITH("8", "4", "6"); *id != NULL; id++) {
        setenv("SLURM_ARRAY_TASK_ID", *id, 1);
        by_script(wire, "/bin/bash", "config/campaign/slurm.sh", "slurm");
    }
    assert_int_equal(access(batch_in(wire, "slurm", "manifest-3-of-3.jsonl"), F_OK), 0);
    batch_expect(wire, "slurm", WITH("--merge"), 0, "6 jobs are complete");
    batch_expect_equal(wire, "slurm", "ref");
    /* One task of an array of seven runs alone. SHARDS says that there are seven. */
    setenv("SHARDS", "7", 1);
    setenv("SLURM_ARRAY_TASK_ID", "3", 1);
    by_script(wire, "/bin/bash", "config/campaign/slurm.sh", "again");
    assert_int_equal(access(batch_in(wire, "again", "manifest-3-of-7.jsonl"), F_OK), 0);
    batch_expect_same(batch_file(wire, "again", 2, ".ply"), batch_file(wire, "ref", 2, ".ply"));
    unsetenv("SHARDS");
    unsetenv("SLURM_ARRAY_TASK_ID");
    struct batch_words w;
    batch_campaign(wire, &w, WITH("config/campaign/slurm.sh"), "none", NULL);
    assert_true(wire_wait(wire, wire_spawn_program(wire, "/bin/bash", w.word, "out", "err", -1)) != 0);
}

static void test_parallel(void **state)
{
    struct wire *wire = *state;
    if (system("command -v parallel >/dev/null") != 0) {
        print_message("# no GNU parallel\n");
        skip();
    }
    setenv("SCANHEAD", wire_program(), 1);
    setenv("SHARDS", "3", 1);
    by_script(wire, "/bin/sh", "config/campaign/parallel.sh", "parallel");
    unsetenv("SHARDS");
    batch_expect_equal(wire, "parallel", "ref");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_shards, batch_setup_with_ref, batch_teardown),
        cmocka_unit_test_setup_teardown(test_shared, batch_setup, batch_teardown),
        cmocka_unit_test_setup_teardown(test_failing, batch_setup, batch_teardown),
        cmocka_unit_test_setup_teardown(test_chosen_stations, batch_setup, batch_teardown),
        cmocka_unit_test_setup_teardown(test_list, batch_setup, batch_teardown),
        cmocka_unit_test_setup_teardown(test_images, batch_setup, batch_teardown),
        cmocka_unit_test_setup_teardown(test_one_warning, batch_setup, batch_teardown),
        cmocka_unit_test_setup_teardown(test_scenario, batch_setup, batch_teardown),
        cmocka_unit_test_setup_teardown(test_manifest, batch_setup_with_ref, batch_teardown),
        cmocka_unit_test_setup_teardown(test_slurm, batch_setup_with_ref, batch_teardown),
        cmocka_unit_test_setup_teardown(test_parallel, batch_setup_with_ref, batch_teardown),
    };
    return cmocka_run_group_tests(tests, batch_make_ref, batch_remove_ref);
}
