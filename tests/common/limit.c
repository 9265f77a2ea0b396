/* SPDX-License-Identifier: MIT */
/* This is a limit for each test program. It ends a program that waits for ever, and prints where the program waits.
 * This file is linked with every test program.
 *
 * The limit is TEST_LIMIT_S seconds, else DEFAULT_S; 0 sets none. run_tap.sh sets the variable to its own limit. The
 * limit only catches a hang, and no result depends on it. If more processes want to run than there are processors,
 * the limit is longer by that ratio. The main thread gets the signal of a timer. The thread prints the running test as
 * failed and where each thread is, and ends the program with status 124, as timeout(1) does. A SIGALRM of a test's own
 * alarm() does the same at once. */
#include <errno.h>
#include <execinfo.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <dirent.h>
#include <setjmp.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

enum { DEFAULT_S = 600, MOST_S = 1000000, MAX_FRAMES = 64, MAX_THREADS = 256, ANSWER_MS = 2000 };

extern const char __executable_start, etext; /* the linker's: they bound the program's own code */

static long limit_s;
static struct timespec began;
static const struct CMUnitTest *asked; /* the tests of the group that runs, as the program gave them */
static volatile size_t n_begun;
static volatile sig_atomic_t ended_one; /* a thread has begun to print where all are */
static volatile sig_atomic_t answered;

#ifdef SH_SANITIZE
/* With these options the address sanitizer keeps its shadow memory mapped, and overwrites it. To unmap and map it again
 * takes a quarter of the time of a test that often makes large arrays. */
const char *__asan_default_options(void);
const char *__asan_default_options(void)
{
    return "clear_shadow_mmap_threshold=1073741824:allocator_release_to_os_interval_ms=-1";
}
#endif

/* ---- output in a signal handler, which may only use write(2) */

__attribute__((format(printf, 1, 2))) static void say(const char *format, ...)
{
    char text[512];
    va_list args;
    va_start(args, format);
    int n = vsnprintf(text, sizeof text, format, args); /* without %f glibc's vsnprintf needs no memory */
    va_end(args);
    if (n > (int)sizeof text - 1) n = (int)sizeof text - 1;
    for (ssize_t done = 0, w; done < n; done += w)
        if ((w = write(STDOUT_FILENO, text + done, (size_t)(n - done))) < 0) return;
}

/* Returns how many processes want to run, in percent of the processors, as the mean of the last minute. */
static long load_percent(void)
{
    char text[64] = "";
    int fd = open("/proc/loadavg", O_RDONLY | O_CLOEXEC);
    if (fd < 0) return 0;
    if (read(fd, text, sizeof text - 1) < 0) text[0] = '\0';
    close(fd);
    char *rest;
    long whole = strtol(text, &rest, 10), hundredths = *rest == '.' ? strtol(rest + 1, NULL, 10) : 0;
    long processors = sysconf(_SC_NPROCESSORS_ONLN);
    return (whole * 100 + hundredths) / (processors > 0 ? processors : 1);
}

static long elapsed_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (long)(now.tv_sec - began.tv_sec);
}

/* Prints the source lines of the program's own frames. Without addr2line only their addresses are known. */
static void say_lines(void *const *frames, int n)
{
    char command[128 + 20 * MAX_FRAMES];
    int at = snprintf(command, sizeof command, "addr2line -sfpie /proc/%d/exe", (int)getpid());
    for (int i = 0; i < n; i++) {
        const char *code = frames[i];
        if (code > &__executable_start && code < &etext) /* a return address is beyond its call */
            at += snprintf(command + at, sizeof command - (size_t)at, " %#lx",
                           (unsigned long)(code - &__executable_start - 1));
    }
    snprintf(command + at, sizeof command - (size_t)at, " 2>/dev/null | sed 's/^/#     /'");
    pid_t child = _Fork();
    if (child == 0) {
        execl("/bin/sh", "sh", "-c", command, (char *)NULL);
        _exit(127);
    }
    while (child > 0 && waitpid(child, NULL, 0) < 0 && errno == EINTR) {
    }
}

static void say_where(void)
{
    void *frames[MAX_FRAMES];
    int n = backtrace(frames, MAX_FRAMES);
    say("# thread %ld:\n", (long)gettid());
    for (int i = 2; i < n; i++) { /* without this function and the handler */
        say("#   ");
        backtrace_symbols_fd(frames + i, 1, STDOUT_FILENO);
    }
    if (n > 2) say_lines(frames + 2, n - 2);
}

/* Each other thread prints where it is, one after the other. */
static void ask_threads(void)
{
    DIR *dir = opendir("/proc/self/task");
    for (struct dirent *entry; dir != NULL && (entry = readdir(dir)) != NULL;) {
        pid_t thread = atoi(entry->d_name);
        if (thread <= 0 || thread == gettid()) continue;
        answered = 0;
        if (syscall(SYS_tgkill, getpid(), thread, SIGALRM) != 0) continue;
        const struct timespec ms = {.tv_nsec = 1000000};
        for (int i = 0; i < ANSWER_MS && !answered; i++)
            nanosleep(&ms, NULL);
        if (!answered) say("# thread %ld: it blocks signals\n", (long)thread);
    }
}

static void on_alarm(int number, siginfo_t *info, void *context)
{
    (void)number, (void)context;
    if (ended_one) {
        if (info->si_code == SI_TKILL) {
            say_where();
            answered = 1;
        }
        return;
    }
    long load = load_percent(), longer_s = load > 100 ? limit_s * load / 100 : limit_s;
    if (info->si_code == SI_TIMER && elapsed_s() < longer_s) return;
    ended_one = 1;
    const char *name = asked != NULL && n_begun > 0 ? asked[n_begun - 1].name : "outside its tests";
    say("not ok %zu - %s\n# %s: no end after %ld s (TEST_LIMIT_S=%ld; load: %ld %% of the processors)\n", n_begun, name,
        name, elapsed_s(), limit_s, load);
    say_where();
    ask_threads();
    _exit(124);
}

/* ---- the running test: each begins with a call that sets its name */

int __real__cmocka_run_group_tests(const char *group, const struct CMUnitTest *tests, size_t n, CMFixtureFunction setup,
                                   CMFixtureFunction teardown);
int __wrap__cmocka_run_group_tests(const char *group, const struct CMUnitTest *tests, size_t n, CMFixtureFunction setup,
                                   CMFixtureFunction teardown);

static int begin(void **state)
{
    const struct CMUnitTest *test = &asked[n_begun++];
    return test->setup_func != NULL ? test->setup_func(state) : 0;
}

int __wrap__cmocka_run_group_tests(const char *group, const struct CMUnitTest *tests, size_t n, CMFixtureFunction setup,
                                   CMFixtureFunction teardown)
{
    struct CMUnitTest *mine = calloc(n + 1, sizeof *mine);
    if (mine == NULL) abort();
    for (size_t i = 0; i < n; i++) {
        mine[i] = tests[i];
        mine[i].setup_func = begin;
    }
    asked = tests;
    n_begun = 0;
    int failed = __real__cmocka_run_group_tests(group, mine, n, setup, teardown);
    asked = NULL;
    free(mine);
    return failed;
}

__attribute__((constructor)) static void set_limit(void)
{
    const char *text = getenv("TEST_LIMIT_S");
    char *rest = NULL;
    limit_s = text != NULL ? strtol(text, &rest, 10) : DEFAULT_S;
    if (text != NULL && (rest == text || *rest != '\0' || limit_s < 0 || limit_s > MOST_S)) {
        fprintf(stderr, "TEST_LIMIT_S=%s: allowed are whole seconds from 0 (no limit) to %d\n", text, MOST_S);
        _exit(2);
    }
    setvbuf(stdout, NULL, _IOLBF, 0); /* results so far are printed before the end */
    void *frame;
    backtrace(&frame, 1); /* loads what it needs now, and not in the handler */
    struct sigaction action = {.sa_sigaction = on_alarm, .sa_flags = SA_SIGINFO | SA_RESTART};
    sigemptyset(&action.sa_mask);
    sigaction(SIGALRM, &action, NULL);
    if (limit_s == 0) return;
    clock_gettime(CLOCK_MONOTONIC, &began);
    struct sigevent event = {.sigev_notify = SIGEV_THREAD_ID, .sigev_signo = SIGALRM, ._sigev_un._tid = gettid()};
    timer_t timer;
    const struct itimerspec at = {.it_value.tv_sec = limit_s,
                                  .it_interval.tv_sec = limit_s}; /* seldom: it interrupts poll(2) */
    if (timer_create(CLOCK_MONOTONIC, &event, &timer) != 0 || timer_settime(timer, 0, &at, NULL) != 0)
        printf("# no limit, as there is no timer: %s\n", strerror(errno)); /* an emulated machine may have none */
}
