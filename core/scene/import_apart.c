#include "core/scene/import.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/pidfd.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { LOOK_MS = 20, MAX_WARNINGS = 1000 };

#define ELSE_CONVERT "export the mesh again, or convert it to .obj or .ply"

enum end { ENDED, END_STOPPED, END_TIME, END_MEMORY };

struct apart {
    struct import_task task;
    int result_fd, note[2], pid_fd;
    pid_t pid;
    int64_t end_ns;
    uint64_t most_bytes; /* the child's resident memory */
    int status;          /* as of waitpid */
    int n_warnings;
    struct sh_err said; /* the child's error */
};

static int64_t now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

uint64_t import_memory_of(pid_t pid, enum import_memory which)
{
    char path[32], text[128];
    unsigned long long pages[2] = {0, 0};
    snprintf(path, sizeof path, "/proc/%ld/statm", (long)pid);
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) return 0;
    ssize_t n = read(fd, text, sizeof text - 1);
    close(fd);
    if (n <= 0) return 0;
    text[n] = '\0';
    if (sscanf(text, "%llu %llu", &pages[0], &pages[1]) != 2) return 0;
    return pages[which] * (uint64_t)sysconf(_SC_PAGESIZE);
}

/* ---- start */

static int open_all(struct apart *a, struct sh_err *err)
{
    a->result_fd = memfd_create("scene", MFD_CLOEXEC);
    if (a->result_fd < 0 || pipe2(a->note, O_CLOEXEC) != 0)
        return build_fail(a->task.b, SH_EIO, err, "no process can be made to read it: %s", strerror(errno));
    fcntl(a->note[0], F_SETFL, O_NONBLOCK);
    return SH_OK;
}

static void close_all(struct apart *a)
{
    const int fd[] = {a->result_fd, a->note[0], a->note[1], a->pid_fd};
    for (size_t i = 0; i < sizeof fd / sizeof fd[0]; i++)
        if (fd[i] >= 0) close(fd[i]);
}

/* Signals are blocked until the child has handlers of its own: this process's must not run there. */
static int start(struct apart *a, struct sh_err *err)
{
    sigset_t all, before;
    const struct scene_import_limits *limits = &a->task.limits;
    a->task.parent = getpid();
    a->task.result_fd = a->result_fd;
    a->task.note_fd = a->note[1];
    a->most_bytes = import_memory_of(a->task.parent, IMPORT_RESIDENT) + ((uint64_t)limits->memory_mib << 20);
    a->end_ns = now_ns() + (int64_t)(1e9 * limits->time_s);
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    a->pid = fork();
    if (a->pid == 0) import_child(&a->task);
    int why = errno;
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (a->pid < 0) return build_fail(a->task.b, SH_EIO, err, "no process can be made to read it: %s", strerror(why));
    close(a->note[1]);
    a->note[1] = -1;
    a->pid_fd = pidfd_open(a->pid, 0);
    return SH_OK;
}

/* ---- what it says */

static void take_note(struct apart *a, struct import_note *note)
{
    const struct sh_report *report = a->task.b->report;
    note->text[sizeof note->text - 1] = '\0';
    sh_keep_line(note->text);
    if (note->kind == IMPORT_WARNING && a->n_warnings++ < MAX_WARNINGS) sh_warn(report, "%s", note->text);
    if (note->kind == IMPORT_PROGRESS) sh_progress(report, note->text, note->fraction <= 1.0 ? note->fraction : -1.0);
    if (note->kind == IMPORT_ERROR)
        sh_fail(&a->said, note->code >= SH_ELOST && note->code < 0 ? note->code : SH_EINPUT, "%s", note->text);
}

/* All that has come. Notes come whole. 0: the pipe is closed. */
static int take_notes(struct apart *a)
{
    struct import_note note;
    for (;;) {
        ssize_t n = read(a->note[0], &note, sizeof note);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return 1;
        if (n == 0) return 0;
        if (n == (ssize_t)sizeof note) take_note(a, &note);
    }
}

/* ---- how it ends */

/* 1: it has ended, and is gone. */
static int reap(struct apart *a, int flags)
{
    for (;;) {
        pid_t got = waitpid(a->pid, &a->status, flags);
        if (got < 0 && errno == EINTR) continue;
        /* Where SIGCHLD is ignored, as some programs leave it to those they start, or where somebody else has waited, there
         * is no status. Its error and its result say enough: a result that is not whole is refused. */
        if (got < 0) a->status = 0;
        return got != 0;
    }
}

/* Why it must end now; ENDED: it need not. */
static enum end must_end(const struct apart *a)
{
    if (sh_stopped(a->task.b->report)) return END_STOPPED;
    if (now_ns() > a->end_ns) return END_TIME;
    return import_memory_of(a->pid, IMPORT_RESIDENT) > a->most_bytes ? END_MEMORY : ENDED;
}

static enum end watch(struct apart *a)
{
    struct pollfd on[2] = {{.fd = a->pid_fd, .events = POLLIN}, {.fd = a->note[0], .events = POLLIN}};
    for (;;) {
        poll(on, 2, LOOK_MS);
        if (!take_notes(a)) on[1].fd = -1;
        if (reap(a, WNOHANG)) {
            take_notes(a);
            return ENDED;
        }
        enum end why = must_end(a);
        if (why == ENDED) continue;
        kill(a->pid, SIGKILL);
        reap(a, 0);
        return why;
    }
}

static int fail_by_memory(const struct apart *a, struct sh_err *err)
{
    return build_fail(a->task.b, SH_EINPUT, err,
                      "Assimp takes more than %u MiB to read it (scene.import_memory_mib): raise that where the mesh "
                      "needs it; a broken file takes any amount: " ELSE_CONVERT,
                      a->task.limits.memory_mib);
}

static int fail_by_time(const struct apart *a, struct sh_err *err)
{
    return build_fail(a->task.b, SH_EINPUT, err,
                      "Assimp has not read it within %g s (scene.import_s): raise that where the mesh needs it; with "
                      "a broken file it may hang: " ELSE_CONVERT,
                      a->task.limits.time_s);
}

static int fail_by_signal(const struct apart *a, int number, struct sh_err *err)
{
    const char *name = sigabbrev_np(number);
    if (number == SIGXCPU) return fail_by_time(a, err);
    if (number == SIGKILL)
        return build_fail(a->task.b, SH_EINPUT, err,
                          "the process in which Assimp read it was killed (SIGKILL), as the system does where memory "
                          "is short; scene.import_memory_mib is %u: " ELSE_CONVERT,
                          a->task.limits.memory_mib);
    return build_fail(a->task.b, SH_EINPUT, err, "Assimp crashed on it (SIG%s): the file is broken: " ELSE_CONVERT,
                      name != NULL ? name : "?");
}

static int judge(struct apart *a, enum end end, struct sh_err *err)
{
    if (end == END_STOPPED) return sh_fail_stopped(err);
    if (end == END_TIME) return fail_by_time(a, err);
    if (end == END_MEMORY) return fail_by_memory(a, err);
    if (WIFSIGNALED(a->status)) return fail_by_signal(a, WTERMSIG(a->status), err);
    /* What is refused at once, as larger than all memory, never was in use. */
    if (a->said.code == SH_ENOMEM || strstr(a->said.text, "bad_alloc") != NULL) return fail_by_memory(a, err);
    if (a->said.code != 0) return sh_fail(err, a->said.code, "%s", a->said.text);
    if (WEXITSTATUS(a->status) == 0) return SH_OK;
    return build_fail(a->task.b, SH_EINPUT, err,
                      "the process in which Assimp read it ended without a word (exit status %d): the file is "
                      "broken: " ELSE_CONVERT,
                      WEXITSTATUS(a->status));
}

int import_apart(struct scene_build *b, struct sh_err *err)
{
    struct apart a = {.task = {.b = b, .limits = b->spec->limits != NULL ? *b->spec->limits : scene_import_defaults},
                      .result_fd = -1,
                      .note = {-1, -1},
                      .pid_fd = -1};
    int rc = open_all(&a, err);
    if (rc == SH_OK) rc = start(&a, err);
    if (rc == SH_OK) rc = judge(&a, watch(&a), err);
    if (rc == SH_OK) rc = import_result_read(b, a.result_fd, err);
    close_all(&a);
    return rc;
}
