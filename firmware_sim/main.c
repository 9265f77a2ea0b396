/* SPDX-License-Identifier: MIT */
/* The command line of both programs: scanhead, and scanheadd (HEAD_ALONE), which is the head alone, for a board. */
#include <fcntl.h>
#include <malloc.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "drivers/host/scanhead.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/help/help.h"
#ifndef HEAD_ALONE
#include "firmware_sim/app/studio/watch/watch.h"
#endif

#define COMMAND(name) &app_##name,
#define NAME(name)    #name,
#define NOTHING(name)
#ifdef HEAD_ALONE
#define STUDIO_HERE      NOTHING
#define STUDIO_ELSEWHERE NAME
#else
#define STUDIO_HERE      COMMAND
#define STUDIO_ELSEWHERE NOTHING
#endif
static const struct app_command *const COMMANDS[] = {APP_COMMANDS(COMMAND, STUDIO_HERE) NULL};
static const char *const ELSEWHERE[] = {APP_COMMANDS(NOTHING, STUDIO_ELSEWHERE) NULL}; /* scanhead alone has these */

static int is_elsewhere(const char *word)
{
    for (const char *const *name = ELSEWHERE; *name != NULL; name++)
        if (strcmp(word, *name) == 0) return 1;
    return 0;
}

static int fail_elsewhere(const char *word)
{
    app_say("%s: not in scanheadd; use scanhead", word);
    return APP_USAGE;
}

static int fail_unknown(const char *word)
{
    const char *meant = help_nearest(COMMANDS, word);
    app_say("unknown command %s%s%s%s; see %s --help", word, meant != NULL ? ", did you mean " : "",
            meant != NULL ? meant : "", meant != NULL ? "?" : "", app_program);
    return APP_USAGE;
}

static int main_run(int argc, char **argv)
{
    if (argc < 2) {
        help_print(COMMANDS, stderr);
        return APP_USAGE;
    }
    if (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0) {
        help_print(COMMANDS, stdout);
        return APP_OK;
    }
    const char *word = strcmp(argv[1], "help") == 0 && argc > 2 ? argv[2] : argv[1];
    if (is_elsewhere(word)) return fail_elsewhere(word);
    if (strcmp(argv[1], "help") == 0) return help_run(COMMANDS, argc - 1, argv + 1);
    if (strcmp(argv[1], "--version") == 0 && argc > 2) {
        app_say("--version: %s is too many; allowed is --version alone", argv[2]);
        return APP_USAGE;
    }
    if (strcmp(argv[1], "--version") == 0) {
        printf("%s %s\n", app_program, scanhead_version());
        return APP_OK;
    }
    for (const struct app_command *const *c = COMMANDS; *c != NULL; c++)
        if (strcmp(argv[1], (*c)->name) == 0) return (*c)->run(argc - 1, argv + 1);
    return fail_unknown(argv[1]);
}

enum { STACK_ROOM = 512 * 1024 };

/* In a function of its own: the calls of the function that has this frame would touch the stack below the frame. */
static __attribute__((noinline)) int touch_stack(void)
{
    volatile char stack[STACK_ROOM];
    stack[0] = APP_OK;
    return stack[0];
}

/* The first thread's stack grows where it is touched. A limit of address space (ulimit -v) would end the program by a
 * signal then, anywhere. So the stack gets its room at the start. It takes no memory until it is used. */
static int reserve_stack(void)
{
    void *room = mmap(NULL, STACK_ROOM, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (room == MAP_FAILED) {
        app_say("no memory for the stack");
        return APP_FAILED;
    }
    munmap(room, STACK_ROOM);
    return touch_stack();
}

/* Configurations and blocks of pulses lie on stacks. Each thread's stack is as large as this limit. In trials 384 KiB
 * were enough. */
static int check_stack(void)
{
    enum { NEEDED_KIB = 1024 };
    struct rlimit limit;
    if (getrlimit(RLIMIT_STACK, &limit) != 0 || limit.rlim_cur >= NEEDED_KIB * 1024) return reserve_stack();
    app_say("the stack is limited to %llu KiB; allowed %d and more: ulimit -s %d",
            (unsigned long long)limit.rlim_cur / 1024, NEEDED_KIB, NEEDED_KIB);
    return APP_USAGE;
}

/* A closed standard stream gets a descriptor that can be neither read nor written. Otherwise the next file would have
 * its number, and messages would be written into it. */
static void hold_streams(void)
{
    int fd;
    do
        fd = open("/", O_PATH);
    while (fd >= 0 && fd <= STDERR_FILENO);
    if (fd >= 0) close(fd);
}

/* Another program with the same pipe may make it non-blocking, and stdio would then lose what a full pipe doesn't take.
 * So standard output and error open their pipe once more, for themselves. Opening must not wait for a reader. */
static void own_pipes(void)
{
    for (int fd = STDOUT_FILENO; fd <= STDERR_FILENO; fd++) {
        struct stat st;
        char path[32];
        snprintf(path, sizeof path, "/proc/self/fd/%d", fd);
        if (fstat(fd, &st) != 0 || !S_ISFIFO(st.st_mode)) continue;
        const int own = open(path, O_WRONLY | O_NONBLOCK | O_CLOEXEC);
        if (own < 0) continue; /* another user's pipe, or one without a reader */
        if (fcntl(own, F_SETFL, 0) == 0) dup2(own, fd);
        close(own);
    }
}

/* std::set_terminate of C++, by the name that all compilers for Linux give it. */
void (*set_terminate(void (*handler)(void)))(void) __asm__("_ZSt13set_terminatePFvvE");

/* Threads of Embree's scheduler (TBB) throw where memory or a thread is refused, and nothing catches that. The program
 * can't go on then. It ends with a line, as for other lack of memory, and not by abort(). */
static void end_of_library(void)
{
    dprintf(STDERR_FILENO,
            "%s: a library (Embree) got no memory or no thread; raise the limits (ulimit -v, ulimit -u), or take a "
            "smaller scene\n",
            app_program);
    _exit(APP_FAILED);
}

/* A command's output may still be in the buffer. A full disk or a closed pipe shows only here. */
int main(int argc, char **argv)
{
    hold_streams();
    own_pipes();
    set_terminate(end_of_library);
    /* malloc would raise this threshold with each large block that is freed, and then keep memory of meshes. */
    mallopt(M_MMAP_THRESHOLD, 4 << 20);
#ifdef HEAD_ALONE
    app_program = "scanheadd";
#else
    run_take_page(&watch_page);
#endif
    int status = check_stack();
    if (status == APP_OK) status = main_run(argc, argv);
    const char *why = app_write_failure(stdout);
    if (why != NULL && status == APP_OK) {
        app_say("standard output: %s", why);
        status = APP_FAILED;
    }
    app_end_messages();
    return status;
}
