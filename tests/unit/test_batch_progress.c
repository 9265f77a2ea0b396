/* SPDX-License-Identifier: MIT */
/* A batch that takes long says each second how far it is, and with --quiet it says nothing. Once its
 * jobs are done the clock is the test's: two seconds pass from one reading to the next. */
#include "tests/unit/commands_rig.h"

#include <stdio.h>
#include <stdlib.h>
#include <stdatomic.h>
#include <string.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include "tests/unit/output_rig.h"

static atomic_int n_read;
static int jumps; /* whether the clock does so */

int clock_gettime(clockid_t id, struct timespec *now)
{
    const long rc = syscall(SYS_clock_gettime, id, now);
    if (id == CLOCK_MONOTONIC && jumps) now->tv_sec += 2L * atomic_fetch_add(&n_read, 1);
    return (int)rc;
}

static int go_there(void **state)
{
    (void)state;
    if (commands_begin() != 0) return -1;
    write_text("floor.obj", "v -30 -30 0\nv 30 -30 0\nv 30 30 0\nv -30 30 0\nf 1 2 3 4\n");
    write_text("c.yaml",
               "head: {profile: sphere, step_deg: 10}\nscene: {meshes: [{file: floor.obj, up: z, scale: 1}]}\n"
               "stations: [{position_m: [0, 0, 2]}]\noutput: {crs: local}\n");
    return 0;
}

/* Returns all that the batch prints to standard error; free it. */
static char *said_by(const char *option)
{
    char *argv[] = {"batch", "c.yaml", "-o", "d", "--sweep", "noise.seed=1,2", NULL, NULL, NULL};
    char word[2][16] = {"", ""};
    struct output out, err;
    const int n = sscanf(option, "%15s %15s", word[0], word[1]);
    for (int i = 0; i < n; i++)
        argv[6 + i] = word[i];
    output_take(&out, stdout);
    output_take(&err, stderr);
    const int status = app_batch.run(6 + (n > 0 ? n : 0), argv);
    app_end_messages();
    char *said = output_give(&err);
    free(output_give(&out));
    if (status != APP_OK) fail_msg("%s", said);
    return said;
}

static void each_part_says_how_far_it_is(void **state)
{
    (void)state;
    free(said_by(""));
    jumps = 1;
    static const struct {
        const char *option, *says;
    } rows[] = {
        {"", "checking the configurations: "}, {"", "checking what is done: "}, {"--merge", "checking files: "}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char option[32], *said = said_by(rows[i].option);
        has(said, rows[i].says);
        free(said);
        snprintf(option, sizeof option, "--quiet %s", rows[i].option);
        said = said_by(option);
        assert_string_equal(said, "");
        free(said);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_part_says_how_far_it_is),
    };
    return cmocka_run_group_tests(tests, go_there, commands_end);
}
