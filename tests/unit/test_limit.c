/* SPDX-License-Identifier: MIT */
/* The limit of test programs (tests/common/limit.c, tests/run_tap.sh). This program is run again with tests that
 * hang. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

/* The limit of this program itself is far beyond: a planted hang ends after 1 s, longer by the machine's load. */
enum { DEADLINE_MS = 300000 };

static const char *self;

/* ---- the planted tests: one that waits as test_host_commands did, and one that computes for ever */

static void planted_first(void **state)
{
    (void)state;
}

static void *reads_for_ever(void *arg)
{
    char byte;
    while (read(*(int *)arg, &byte, 1) > 0) {
    }
    return NULL;
}

static void planted_join(void **state)
{
    (void)state;
    int ends[2];
    pthread_t thread;
    assert_int_equal(pipe(ends), 0);
    assert_int_equal(pthread_create(&thread, NULL, reads_for_ever, ends), 0);
    pthread_join(thread, NULL);
}

static int planted_setup(void **state)
{
    *state = &planted_setup;
    return 0;
}

static void planted_spin(void **state)
{
    assert_ptr_equal(*state, &planted_setup); /* its own setup has run */
    for (volatile int i = 0;; i = 1 - i) {
    }
}

static int planted(const char *which)
{
    const struct CMUnitTest join[] = {cmocka_unit_test(planted_first), cmocka_unit_test(planted_join)};
    const struct CMUnitTest spin[] = {cmocka_unit_test_setup(planted_spin, planted_setup)};
    if (strcmp(which, "join") == 0) return cmocka_run_group_tests(join, NULL, NULL);
    if (strcmp(which, "spin") == 0) return cmocka_run_group_tests(spin, NULL, NULL);
    for (;;) /* no test runs */
        pause();
}

/* ---- running them */

struct outcome {
    int status; /* exit status, or 256 + the signal */
    char text[1 << 16];
};

static void run(struct outcome *outcome, const char *const *argv, const char *limit_s)
{
    int ends[2];
    assert_int_equal(pipe(ends), 0);
    fflush(NULL);
    pid_t parent = getpid(), child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (getppid() != parent) _exit(127);
        dup2(ends[1], 1);
        dup2(ends[1], 2);
        close(ends[0]);
        close(ends[1]);
        setenv("CMOCKA_MESSAGE_OUTPUT", "TAP", 1);
        if (limit_s != NULL) setenv("TEST_LIMIT_S", limit_s, 1);
        execvp(argv[0], (char *const *)(uintptr_t)argv);
        _exit(127);
    }
    close(ends[1]);
    size_t n = 0;
    for (ssize_t got = 1; got > 0 && n<sizeof outcome->text - 1; n += got> 0 ? (size_t)got : 0) {
        struct pollfd slot = {.fd = ends[0], .events = POLLIN};
        if (poll(&slot, 1, DEADLINE_MS) != 1) {
            kill(child, SIGKILL);
            fail_msg("%s %s did not end", argv[0], argv[1]);
        }
        got = read(ends[0], outcome->text + n, sizeof outcome->text - 1 - n);
    }
    outcome->text[n] = '\0';
    close(ends[0]);
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    outcome->status = WIFEXITED(status) ? WEXITSTATUS(status) : 256 + WTERMSIG(status);
}

static void run_planted(struct outcome *outcome, const char *which, const char *limit_s)
{
    run(outcome, (const char *const[]){self, which, NULL}, limit_s);
}

static void expect_text(const struct outcome *outcome, const char *text)
{
    if (strstr(outcome->text, text) == NULL) fail_msg("no \"%s\" in: %s", text, outcome->text);
}

static struct outcome outcome;

static void test_join_names_test_and_threads(void **state)
{
    (void)state;
    run_planted(&outcome, "join", "1");
    assert_int_equal(outcome.status, 124);
    expect_text(&outcome, "ok 1 - planted_first\n");
    expect_text(&outcome, "not ok 2 - planted_join\n");
    expect_text(&outcome, "TEST_LIMIT_S=1;");
    expect_text(&outcome, "# thread ");
    if (system("command -v addr2line >/dev/null") == 0) expect_text(&outcome, "reads_for_ever at test_limit.c:");
}

static void test_spin_ends(void **state)
{
    (void)state;
    run_planted(&outcome, "spin", "1");
    assert_int_equal(outcome.status, 124);
    expect_text(&outcome, "not ok 1 - planted_spin\n");
}

static void test_outside_tests(void **state)
{
    (void)state;
    run_planted(&outcome, "pause", "1");
    assert_int_equal(outcome.status, 124);
    expect_text(&outcome, "not ok 0 - outside its tests\n");
}

static void test_limit_refused(void **state)
{
    (void)state;
    static const char *const bad[] = {"", "1s", "-1", "1000001"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        run_planted(&outcome, "spin", bad[i]);
        assert_int_equal(outcome.status, 2);
        expect_text(&outcome, "allowed are whole seconds from 0 (no limit) to 1000000");
    }
}

/* run_tap.sh ends a script that waits for ever, and its child that ignores SIGTERM. (The tests before end by
 * themselves.) If the child went on, its end of the pipe would stay open, and run() would report it. */
static void test_run_tap(void **state)
{
    (void)state;
    char script[] = "/tmp/scanhead-limit-XXXXXX";
    int fd = mkstemp(script);
    assert_true(fd >= 0);
    static const char text[] =
        "#!/bin/sh\necho '1..1'\nsh -c 'trap \"\" TERM; sleep 1000; sleep 1000' >&9 9>&9 &\nwait\n";
    assert_int_equal(write(fd, text, sizeof text - 1), sizeof text - 1);
    assert_int_equal(fchmod(fd, 0700), 0);
    close(fd);
    run(&outcome, (const char *const[]){"bash", "-c", "exec bash tests/run_tap.sh -t 1 \"$0\" 9>&1", script, NULL},
        NULL);
    unlink(script);
    assert_int_equal(outcome.status, 1);
    expect_text(&outcome, "did not end within 1 s");
    expect_text(&outcome, "0 passed, 1 failed, 0 skipped");
}

int main(int argc, char **argv)
{
    self = argv[0];
    if (argc > 1) return planted(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_join_names_test_and_threads),
        cmocka_unit_test(test_spin_ends),
        cmocka_unit_test(test_outside_tests),
        cmocka_unit_test(test_limit_refused),
        cmocka_unit_test(test_run_tap),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
