/* SPDX-License-Identifier: MIT */
/* Signals of the command line. One signal asks for an end in good order, and so do two within a second. Any other
 * signal after the first one ends the program immediately. */
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include <cmocka.h>

#include "firmware_sim/app/app.h"

/* Returns the fate of a process that gets these signals, one after the other (0: a second and a bit passes before the
 * next): 0 where it goes on and knows of them, else the signal that ended it. */
static int outcome(const int *signals, int n)
{
    const pid_t pid = fork();
    assert_true(pid >= 0);
    if (pid == 0) {
        app_catch_signals();
        if (app_interrupted()) _exit(1);
        for (int i = 0; i < n; i++) {
            struct timespec second = {1, 50000000};
            while (signals[i] == 0 && nanosleep(&second, &second) != 0) {
            }
            if (signals[i] != 0) raise(signals[i]);
        }
        _exit(app_interrupted() ? 0 : 1);
    }
    int status;
    assert_int_equal(waitpid(pid, &status, 0), pid);
    if (WIFSIGNALED(status)) return WTERMSIG(status);
    assert_int_equal(WEXITSTATUS(status), 0);
    return 0;
}
#define OUTCOME(...) outcome((const int[]){__VA_ARGS__}, (int)(sizeof((const int[]){__VA_ARGS__}) / sizeof(int)))

static void two_at_once_are_one(void **state)
{
    (void)state;
    assert_int_equal(OUTCOME(SIGTERM), 0);
    assert_int_equal(OUTCOME(SIGINT), 0);
    assert_int_equal(OUTCOME(SIGTERM, SIGTERM), 0); /* as `timeout` sends them */
    assert_int_equal(OUTCOME(SIGINT, SIGTERM), 0);
}

static void a_third_ends_at_once(void **state)
{
    (void)state;
    assert_int_equal(OUTCOME(SIGTERM, SIGTERM, SIGTERM), SIGTERM);
    assert_int_equal(OUTCOME(SIGINT, SIGINT, SIGINT), SIGINT);
    assert_int_equal(OUTCOME(SIGTERM, SIGTERM, SIGINT), SIGINT);
}

static void a_second_that_comes_later_ends_at_once(void **state)
{
    (void)state;
    assert_int_equal(OUTCOME(SIGTERM, 0, SIGTERM), SIGTERM); /* it has to wait: the limit of a second is tested */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(two_at_once_are_one),
        cmocka_unit_test(a_third_ends_at_once),
        cmocka_unit_test(a_second_that_comes_later_ends_at_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
