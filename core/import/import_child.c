/* SPDX-License-Identifier: MIT */
/* The process that reads sets its limits, does the work, and writes the scene into the file of the task.
 *
 * Except for node, which reads IFC, it is a fork without exec. The parent may have threads; the fork has only a copy of
 * the thread that called fork. glibc lets such a process use malloc and stdio; libraries are loaded before the fork.
 * The fork ends by _exit, which runs no destructors. */
#include "core/import/import_child.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include "core/import/import_apart.h"
#include "core/import/import_result.h"
#include "core/scene/build_load.h"

enum { RESULT_FD = 3, NOTE_FD, FIRST_FREE_FD, INPUT_FD = FIRST_FREE_FD /* of a program */ };
enum { PROGRAM_FILES = 256 }; /* node opens some 30 of its own */

_Static_assert(sizeof(struct import_note) <= 4096, "PIPE_BUF on Linux: written in one piece");

static int note_fd; /* the pipe, before and after it is moved to its place */

/* Only the pipe reports errors. Where a write to it fails, the exit status still shows that reading failed. */
static void send_text(int kind, int code, double fraction, const char *text)
{
    struct import_note note = {.kind = kind, .code = code, .fraction = fraction};
    snprintf(note.text, sizeof note.text, "%s", text);
    while (write(note_fd, &note, sizeof note) < 0 && errno == EINTR)
        continue;
}

static void send_warning(void *ctx, const char *text)
{
    (void)ctx;
    send_text(IMPORT_WARNING, 0, 0.0, text);
}

static void send_progress(void *ctx, const char *what, double fraction)
{
    (void)ctx;
    send_text(IMPORT_PROGRESS, 0, fraction, what);
}

/* Resets signals as in a new program. Signals in the list are ignored: Ctrl-C reaches both processes, and the parent
 * decides what it means; a write that fails returns an error. */
static void set_signals(void)
{
    static const int ignored[] = {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE, SIGXFSZ};
    sigset_t none;
    for (int s = 1; s < NSIG; s++)
        signal(s, SIG_DFL);
    for (size_t i = 0; i < sizeof ignored / sizeof ignored[0]; i++)
        signal(ignored[i], SIG_IGN);
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
}

/* Makes the file that a program finds as descriptor 5. pwrite leaves its position at the start. */
static bool set_input(struct text_span input)
{
    const int fd = memfd_create("input", 0);
    if (fd < 0) return false;
    for (size_t done = 0; done < input.n;) {
        const ssize_t n = pwrite(fd, input.p + done, input.n - done, (off_t)done);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return false;
        done += (size_t)n;
    }
    return fd == INPUT_FD || dup2(fd, INPUT_FD) == INPUT_FD;
}

/* Closes all of the parent's descriptors that the task doesn't need: its sockets and terminals must close
 * when the parent closes them. Output is discarded. */
static int set_descriptors(const struct import_task *task)
{
    /* Both descriptors move beyond their places first, since either may stand in the other's. */
    int result = fcntl(task->result_fd, F_DUPFD, FIRST_FREE_FD), note = fcntl(task->note_fd, F_DUPFD, FIRST_FREE_FD);
    int nothing = open("/dev/null", O_RDWR);
    if (result < 0 || note < 0 || nothing < 0) return 0;
    note_fd = note;
    for (int fd = 0; fd < 3; fd++)
        if (dup2(nothing, fd) < 0) return 0;
    if (dup2(result, RESULT_FD) < 0 || dup2(note, NOTE_FD) < 0) return 0;
    note_fd = NOTE_FD;
    if (task->argv == NULL) return close_range(FIRST_FREE_FD, ~0u, 0) == 0;
    return set_input(task->input) && close_range(INPUT_FD + 1, ~0u, 0) == 0;
}

static int set_limit(__rlimit_resource_t resource, uint64_t value)
{
    struct rlimit limit;
    if (getrlimit(resource, &limit) != 0) return 0;
    if (value < limit.rlim_max) limit.rlim_max = (rlim_t)value;
    limit.rlim_cur = limit.rlim_max;
    return setrlimit(resource, &limit) == 0;
}

/* Where memory still runs short, the kernel ends this process first. */
static void offer_to_the_oom_killer(void)
{
    int fd = open("/proc/self/oom_score_adj", O_WRONLY);
    if (fd < 0) return;
    if (write(fd, "1000", 4) < 0) send_warning(NULL, "import: /proc/self/oom_score_adj can't be written");
    close(fd);
}

/* The parent watches the memory in use, and the clock. The kernel's limits also work while the parent is stopped:
 * processor time, and in a fork the address space. The address space may grow by twice the limit of memory, since a
 * process has more address space than memory. The address sanitizer takes terabytes of it. */
static int set_limits(const struct import_task *task)
{
    const struct scene_import_limits *limits = &task->limits;
    const uint64_t bytes = (uint64_t)limits->memory_mib << 20;
    const uint64_t files = task->argv != NULL ? PROGRAM_FILES : limits->files;
    int done = set_limit(RLIMIT_CORE, 0) && set_limit(RLIMIT_CPU, (uint64_t)ceil(limits->time_s) + 1) &&
               set_limit(RLIMIT_NOFILE, FIRST_FREE_FD + files) && set_limit(RLIMIT_FSIZE, bytes);
#ifndef SH_SANITIZE
    /* node reserves many times the address space that it uses. */
    if (task->argv == NULL)
        done = done && set_limit(RLIMIT_AS, import_memory_of(getpid(), IMPORT_ADDRESSES) + 2 * bytes);
#endif
    offer_to_the_oom_killer();
    return done && prctl(PR_SET_DUMPABLE, 0) == 0; /* a core dump into a pipe ignores RLIMIT_CORE */
}

static int prepare(const struct import_task *task, struct sh_err *err)
{
    note_fd = task->note_fd;
    set_signals();
    if (!set_descriptors(task))
        return sh_fail(err, SH_EIO, "the descriptors of the process that reads can't be set: %s", strerror(errno));
    if (!set_limits(task))
        return sh_fail(err, SH_EIO, "the limits of the process that reads can't be set: %s", strerror(errno));
    return SH_OK;
}

/* Returns only where the program can't be started. */
static int run_program(const struct import_task *task, struct sh_err *err)
{
    execvp(task->argv[0], (char *const *)(uintptr_t)task->argv);
    return sh_fail(err, SH_EIO, "%s: %s", task->argv[0], strerror(errno));
}

static int read_scene(const struct import_task *task, struct sh_err *err)
{
    static const struct sh_report report = {.warn = send_warning, .progress = send_progress};
    struct scene_build own;
    int rc = build_init(&own, task->b->tolerance_m, &report, err);
    if (rc != SH_OK) return rc;
    own.start_ns = task->b->start_ns;
    build_begin_file(&own, task->b->spec);
    own.instead = task->b->instead;
    rc = task->read(&own, err);
    if (rc == SH_OK) rc = build_end_file(&own, err);
    return rc == SH_OK ? import_result_write(own.scene, RESULT_FD, err) : rc;
}

_Noreturn void import_child(const struct import_task *task)
{
    struct sh_err err = {0};
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != task->parent) _exit(1); /* the parent died before that */
    int rc = prepare(task, &err);
    if (rc == SH_OK) rc = task->argv != NULL ? run_program(task, &err) : read_scene(task, &err);
    if (rc != SH_OK) send_text(IMPORT_ERROR, rc, 0.0, err.text);
    _exit(rc == SH_OK ? 0 : 1);
}
