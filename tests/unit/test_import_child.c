/* SPDX-License-Identifier: MIT */
/* The process that reads a mesh has two descriptors of its own and the time at which the load began. It has no other
 * descriptors of its parent, no output and no signals, and its memory is not dumped. */
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include "core/import/import_apart.h"
#include "core/scene/build_load.h"
#include "tests/common/cases.h"

enum { RESULT = 3, NOTE = 4, OF_PARENT = 40, FILES = 17 };

static int64_t start_ns;
static char wrong[256];

static void check(int is_right, const char *what)
{
    if (!is_right) snprintf(wrong + strlen(wrong), sizeof wrong - strlen(wrong), " %s;", what);
}

static int disposition_is(int number, void (*want)(int))
{
    struct sigaction now;
    return sigaction(number, NULL, &now) == 0 && now.sa_handler == want;
}

static int limit_is(__rlimit_resource_t resource, rlim_t want)
{
    struct rlimit limit;
    return getrlimit(resource, &limit) == 0 && limit.rlim_cur == want && limit.rlim_max == want;
}

/* Runs in the other process. */
static int look_around(struct scene_build *b, struct sh_err *err)
{
    struct stat st;
    sigset_t blocked;
    for (int fd = 0; fd < 3; fd++)
        check(fstat(fd, &st) == 0 && S_ISCHR(st.st_mode) && st.st_rdev == makedev(1, 3), "a stream is not /dev/null");
    check(fstat(RESULT, &st) == 0 && S_ISREG(st.st_mode) && st.st_size == 0, "the result is no empty file");
    check(fstat(NOTE, &st) == 0 && S_ISFIFO(st.st_mode), "the messages are no pipe");
    for (int fd = NOTE + 1; fd <= OF_PARENT; fd++)
        check(fcntl(fd, F_GETFD) < 0, "a descriptor of the parent");
    check(disposition_is(SIGUSR1, SIG_DFL) && disposition_is(SIGCHLD, SIG_DFL), "a handler of the parent");
    static const int ignored[] = {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE, SIGXFSZ};
    for (size_t i = 0; i < sizeof ignored / sizeof ignored[0]; i++)
        check(disposition_is(ignored[i], SIG_IGN), "a signal that is not ignored");
    sigprocmask(SIG_BLOCK, NULL, &blocked);
    for (int s = 1; s < 32; s++)
        check(!sigismember(&blocked, s), "a signal that is blocked");
    check(prctl(PR_GET_DUMPABLE) == 0, "it can be dumped");
    check(limit_is(RLIMIT_CORE, 0), "RLIMIT_CORE");
    check(limit_is(RLIMIT_CPU, 8), "RLIMIT_CPU"); /* 6.5 s, in whole seconds, and one more */
    check(limit_is(RLIMIT_NOFILE, NOTE + 1 + FILES), "RLIMIT_NOFILE");
    check(limit_is(RLIMIT_FSIZE, 300 << 20), "RLIMIT_FSIZE");
    check(b->start_ns == start_ns, "another start");
    return sh_fail(err, SH_EINPUT, "wrong:%s", wrong);
}

static void on_signal(int number)
{
    (void)number;
}

static void it_has_nothing_of_its_parent(void **state)
{
    (void)state;
    const struct scene_mesh_spec spec = {.file = "a.dae", .scale = 1};
    struct scene_import_limits limits = scene_import_defaults;
    struct sh_err err = {0};
    struct scene_build b;
    sigset_t some, was_blocked;
    limits.memory_mib = 300;
    limits.time_s = 6.5;
    limits.files = FILES;
    assert_int_equal(build_init(&b, 1e-3, NULL, &err), SH_OK);
    build_begin_file(&b, &spec);
    start_ns = b.start_ns -= 123456789;
    assert_int_equal(dup2(0, OF_PARENT), OF_PARENT);
    void (*const was)(int) = signal(SIGUSR1, on_signal);
    sigemptyset(&some);
    sigaddset(&some, SIGUSR2);
    sigprocmask(SIG_BLOCK, &some, &was_blocked);
    struct import_apart a = {.task = {.b = &b, .limits = limits, .name = "a reader", .read = look_around}};
    struct import_apart *const all[1] = {&a};
    assert_int_equal(import_start(&a, &err), SH_OK);
    import_watch(all, 1);
    assert_int_equal(import_judge(&a, &err), SH_EINPUT);
    import_close(&a);
    build_release(&b);
    sigprocmask(SIG_SETMASK, &was_blocked, NULL);
    signal(SIGUSR1, was);
    close(OF_PARENT);
    assert_string_equal(err.text, "wrong:");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(it_has_nothing_of_its_parent)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
