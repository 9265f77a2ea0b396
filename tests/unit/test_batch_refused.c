/* SPDX-License-Identifier: MIT */
/* Campaigns that are not complete, that come from several kinds of machine, that read what they would write, and whose
 * meshes differ: what is said, in this process. */
#include "tests/unit/commands_rig.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static int go_there(void **state)
{
    (void)state;
    if (commands_begin() != 0) return -1;
    write_text("floor.obj", "v -30 -30 0\nv 30 -30 0\nv 30 30 0\nv -30 30 0\nf 1 2 3 4\n");
    write_text("wall.obj", "v -3 5 0\nv 3 5 0\nv 3 5 4\nv -3 5 4\nf 1 2 3 4\n");
    write_text("c.yaml",
               "head: {profile: sphere, step_deg: 10}\nscene: {meshes: [{file: floor.obj, up: z, scale: 1}]}\n"
               "stations: [{position_m: [0, 0, 2]}]\noutput: {crs: local}\n");
    return mkdir("none", 0777) | mkdir("in", 0777);
}

/* The first 20 jobs that are not complete are named. */
static void many_jobs_are_missing(void **state)
{
    (void)state;
    for (int n = 20; n <= 22; n++) {
        char words[200] = "c.yaml -o none --merge --sweep noise.seed=1", want[4096] = "";
        for (int i = 2; i <= n; i++)
            snprintf(words + strlen(words), sizeof words - strlen(words), ",%d", i);
        for (int i = 1; i <= 20; i++)
            snprintf(want + strlen(want), sizeof want - strlen(want),
                     "scanhead: job %d, %04d_station-1_noise.seed=%d: missing\n", i, i, i);
        if (n > 20) snprintf(want + strlen(want), sizeof want - strlen(want), "scanhead: and %d more\n", n - 20);
        snprintf(want + strlen(want), sizeof want - strlen(want),
                 "scanhead: none: %d of %d jobs are incomplete; run their shards again\n", n, n);
        does(&app_batch, words, 1);
        assert_string_equal(on_err, want);
    }
}

/* The last job's line gets an engine of another name, as from another kind of processor. */
static void engines_are_not_mixed(void **state)
{
    (void)state;
    static const char key[] = "\"engine\":\"";
    char engine[128] = "", other[128], want[1024];
    does(&app_batch, "c.yaml -o e --quiet --sweep noise.seed=1,2,3", 0);
    char *manifest = contents("e/manifest-1-of-1.jsonl"), *last = NULL;
    for (char *at = manifest; (at = strstr(at, key)) != NULL; at++)
        last = at + strlen(key);
    assert_non_null(last);
    assert_int_equal(sscanf(last, "%127[^\"]", engine), 1);
    *last = *last == 'X' ? 'Y' : 'X';
    write_text("e/manifest-1-of-1.jsonl", manifest);
    snprintf(other, sizeof other, "%c%s", *last, engine + 1);
    free(manifest);
    snprintf(
        want, sizeof want,
        "scanhead: e: job 1 was made by %s, job 3 by %s; allowed is one kind of processor, since rays may hit other "
        "triangles on another kind\n",
        engine, other);
    does(&app_batch, "c.yaml -o e --merge --sweep noise.seed=1,2,3", 1);
    assert_string_equal(on_err, want);
    does(&app_batch, "c.yaml -o e --sweep noise.seed=1,2,3", 1);
    assert_string_equal(on_err,
                        "scanhead: e: its job 3 was made with a processor or an Embree of another kind; --force "
                        "repeats such jobs, another -o begins another campaign\n");
    does(&app_batch, "c.yaml -o e --quiet --force --sweep noise.seed=1,2,3", 0);
    does(&app_batch, "c.yaml -o e --merge --sweep noise.seed=1,2,3", 0);
    assert_string_equal(on_err, "scanhead: 3 jobs are complete: e/manifest.json\n");
}

/* An input may lie in the campaign's folder, unless a job's file has its name. */
static void an_input_is_not_overwritten(void **state)
{
    (void)state;
    char *mesh = contents("floor.obj");
    write_text("in/0001_station-1.ply.obj", mesh);
    write_text("in/0002_station-1.obj", mesh);
    write_text("in/0001_station-10.obj", mesh);
    does(&app_batch, "c.yaml -o in --set scene.meshes[0].file=in/0001_station-1.ply.obj", 2);
    assert_string_equal(on_err,
                        "scanhead: --output in: 0001_station-1.ply.obj, a file of job 1, is also read as an input, and "
                        "would be overwritten; name another folder\n");
    does(&app_batch, "c.yaml -o in --quiet --set scene.meshes[0].file=in/0002_station-1.obj", 0); /* there is one job */
    does(&app_batch, "c.yaml -o in2 --quiet --set scene.meshes[0].file=in/0001_station-1.ply.obj", 0);
    does(&app_batch, "c.yaml -o in --force --quiet --set scene.meshes[0].file=in/0001_station-10.obj", 0);
    free(mesh);
}

/* A mesh is read once for all jobs that follow each other with it. A mesh that is not one fails its jobs alone. */
static void meshes_are_shared_and_may_fail(void **state)
{
    (void)state;
    does(&app_batch,
         "c.yaml -o m --sweep scene.meshes[0].file=floor.obj,wall.obj --sweep noise.seed=1,2 --sweep loop.threads=1",
         0);
    has(on_err, "scanhead: shard 1/1: 4 jobs done, 4 of them now; meshes read 2 times\n");
    write_text("bad.obj", "v 0 0 0\nf 1 2 3\n");
    does(&app_batch, "c.yaml -o n --sweep scene.meshes[0].file=bad.obj,floor.obj --sweep noise.seed=1,2", 1);
    has(on_err, "bad.obj");
    has(on_err, "scanhead: job 1 failed: 0001_station-1_scene.meshes_0_.file=bad.obj_noise.seed=1\n");
    has(on_err, "scanhead: job 2 failed: 0002_station-1_scene.meshes_0_.file=bad.obj_noise.seed=2\n");
    has(on_err, "scanhead: 2 of 4 jobs of shard 1/1 failed; the same command tries them again\n");
    assert_int_equal(access("n/0003_station-1_scene.meshes_0_.file=floor.obj_noise.seed=1.ply", F_OK), 0);
    assert_int_equal(access("n/0004_station-1_scene.meshes_0_.file=floor.obj_noise.seed=2.ply", F_OK), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(many_jobs_are_missing),
        cmocka_unit_test(engines_are_not_mixed),
        cmocka_unit_test(an_input_is_not_overwritten),
        cmocka_unit_test(meshes_are_shared_and_may_fail),
    };
    return cmocka_run_group_tests_name("batch refused", tests, go_there, commands_end);
}
