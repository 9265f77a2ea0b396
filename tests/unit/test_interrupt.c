/* SPDX-License-Identifier: MIT */
/* Signals of the command line. One signal asks for an end in good order, and so do two within a second. Any other
 * signal after the first one ends the program immediately, but for SIGHUP. */
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

/* Returns the fate of a process whose SIGHUP was at first as in `hangup`. The process gets these signals, one after the
 * other (0: a second and a bit passes before the next). 0: it goes on and knows of them; -1: it goes on and does not;
 * else the signal that ended it. */
static int outcome(void (*hangup)(int), const int *signals, int n)
{
    const pid_t pid = fork();
    assert_true(pid >= 0);
    if (pid == 0) {
        signal(SIGHUP, hangup);
        app_catch_signals();
        if (app_interrupted()) _exit(2);
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
    assert_in_range(WEXITSTATUS(status), 0, 1);
    return -WEXITSTATUS(status);
}
#define OUTCOME(...) \
    outcome(SIG_DFL, (const int[]){__VA_ARGS__}, (int)(sizeof((const int[]){__VA_ARGS__}) / sizeof(int)))

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

/* A terminal that closes sends SIGHUP several times, of which none ends the process at once. SIGHUP does not count as a
 * first signal either: someone who then sends SIGTERM wants the same end. */
static void a_closed_terminal_asks_for_an_end(void **state)
{
    (void)state;
    assert_int_equal(OUTCOME(SIGHUP), 0);
    assert_int_equal(OUTCOME(SIGHUP, SIGHUP, SIGHUP), 0);
    assert_int_equal(OUTCOME(SIGINT, SIGINT, SIGHUP), 0);
    assert_int_equal(OUTCOME(SIGHUP, SIGTERM, SIGTERM), 0);
    assert_int_equal(OUTCOME(SIGHUP, SIGTERM, SIGTERM, SIGTERM), SIGTERM);
}

/* As `nohup` starts a program. */
static void an_ignored_hangup_stays_ignored(void **state)
{
    (void)state;
    const int signals[] = {SIGHUP, SIGTERM};
    assert_int_equal(outcome(SIG_IGN, signals, 1), -1);
    assert_int_equal(outcome(SIG_IGN, signals, 2), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(two_at_once_are_one),
        cmocka_unit_test(a_third_ends_at_once),
        cmocka_unit_test(a_second_that_comes_later_ends_at_once),
        cmocka_unit_test(a_closed_terminal_asks_for_an_end),
        cmocka_unit_test(an_ignored_hangup_stays_ignored),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
