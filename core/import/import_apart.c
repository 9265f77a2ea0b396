/* SPDX-License-Identifier: MIT */
#include "core/import/import_apart.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/pidfd.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/geotiff.h"
#include "core/import/geotiff/geotiff_read.h"
#include "core/import/gltf/gltf_read.h"
#include "core/import/import_assimp.h"
#include "core/import/import_result.h"
#include "core/import/readers.h"
#include "core/monotonic.h"
#include "core/late.h"

enum { LOOK_MS = 20, MAX_WARNINGS = 1000 };

#define LEAST_MORE_NS ((int64_t)10000000000) /* least time of the second reader, once the first has ended */

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

static int open_all(struct import_apart *a, struct sh_err *err)
{
    a->result_fd = memfd_create("scene", MFD_CLOEXEC);
    if (a->result_fd < 0 || pipe2(a->note, O_CLOEXEC) != 0)
        return build_fail(a->task.b, SH_EIO, err, "no process can be made to read it: %s", strerror(errno));
    fcntl(a->note[0], F_SETFL, O_NONBLOCK);
    return SH_OK;
}

void import_close(struct import_apart *a)
{
    int *const fd[] = {&a->result_fd, &a->note[0], &a->note[1], &a->pid_fd};
    for (size_t i = 0; i < sizeof fd / sizeof fd[0]; i++) {
        if (*fd[i] >= 0) close(*fd[i]);
        *fd[i] = -1;
    }
}

/* Forks with all signals blocked, so that this process's handlers don't run in the child. The child unblocks them. */
static int start_child(struct import_apart *a, struct sh_err *err)
{
    sigset_t all, before;
    const struct scene_import_limits *limits = &a->task.limits;
    a->task.parent = getpid();
    a->task.result_fd = a->result_fd;
    a->task.note_fd = a->note[1];
    a->most_bytes = import_memory_of(a->task.parent, IMPORT_RESIDENT) + ((uint64_t)limits->memory_mib << 20);
    a->start_ns = monotonic_ns();
    a->end_ns = a->start_ns + (int64_t)(1e9 * limits->time_s);
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

int import_start(struct import_apart *a, struct sh_err *err)
{
    a->result_fd = a->note[0] = a->note[1] = a->pid_fd = -1;
    int rc = open_all(a, err);
    if (rc == SH_OK) rc = start_child(a, err);
    if (rc != SH_OK) import_close(a);
    return rc;
}

/* ---- messages */

static void take_note(struct import_apart *a, struct import_note *note)
{
    const struct sh_report *report = a->task.b->report;
    note->text[sizeof note->text - 1] = '\0';
    sh_keep_line(note->text);
    if (note->kind == IMPORT_WARNING && a->n_warnings++ < MAX_WARNINGS) sh_warn(report, "%s", note->text);
    if (note->kind == IMPORT_PROGRESS) sh_progress(report, note->text, note->fraction <= 1.0 ? note->fraction : -1.0);
    if (note->kind == IMPORT_ERROR)
        sh_fail(&a->said, note->code >= SH_ELOST && note->code < 0 ? note->code : SH_EINPUT, "%s", note->text);
}

/* Takes all notes that have arrived. A note is written in one piece, so it is read whole. 0: the pipe is closed. */
static int take_notes(struct import_apart *a)
{
    struct import_note note;
    if (a->note[0] < 0) return 0;
    for (;;) {
        ssize_t n = read(a->note[0], &note, sizeof note);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return 1;
        if (n == 0) return 0;
        if (n == (ssize_t)sizeof note) take_note(a, &note);
    }
}

/* ---- the end of a process */

/* Collects the process's status. 1: it has ended. */
static int reap(struct import_apart *a, int flags)
{
    for (;;) {
        pid_t got = waitpid(a->pid, &a->status, flags);
        if (got < 0 && errno == EINTR) continue;
        /* There is no status where SIGCHLD is ignored, which programs may inherit, or where another waiter has taken
         * it. The child's error and result are enough: an incomplete result is refused. */
        if (got < 0) a->status = 0;
        return got != 0;
    }
}

/* Returns the reason to end the process now; IMPORT_ENDED: there is none. */
static enum import_end must_end(const struct import_apart *a)
{
    if (sh_stopped(a->task.b->report)) return IMPORT_STOPPED;
    if (monotonic_ns() > a->end_ns) return IMPORT_TIME;
    return import_memory_of(a->pid, IMPORT_RESIDENT) > a->most_bytes ? IMPORT_MEMORY : IMPORT_ENDED;
}

/* Checks on the process. 1: it is over. */
static int import_apart_look(struct import_apart *a)
{
    if (!take_notes(a) && a->note[0] >= 0) {
        close(a->note[0]);
        a->note[0] = -1;
    }
    if (reap(a, WNOHANG)) {
        take_notes(a); /* it may have written between the two calls, its error among others */
        return 1;
    }
    a->end = must_end(a);
    if (a->end == IMPORT_ENDED) return 0;
    kill(a->pid, SIGKILL);
    reap(a, 0);
    return 1;
}

/* Shortens the other reader's time: one that never ends would delay the finished result for minutes. */
static void shorten(struct import_apart *a, const struct import_apart *done)
{
    const int64_t now = monotonic_ns(), took = 10 * (now - done->start_ns);
    const int64_t end_ns = now + (took > LEAST_MORE_NS ? took : LEAST_MORE_NS);
    if (a->is_over || done->status != 0 || done->end != IMPORT_ENDED || end_ns >= a->end_ns) return;
    a->end_ns = end_ns;
    a->is_shortened = true;
}

void import_watch(struct import_apart *const a[], size_t n)
{
    struct pollfd on[4];
    for (size_t left = n; left > 0;) {
        for (size_t i = 0; i < n; i++) {
            on[2 * i] = (struct pollfd){.fd = a[i]->is_over ? -1 : a[i]->pid_fd, .events = POLLIN};
            on[2 * i + 1] = (struct pollfd){.fd = a[i]->is_over ? -1 : a[i]->note[0], .events = POLLIN};
        }
        poll(on, 2 * n, LOOK_MS);
        for (size_t i = 0; i < n; i++) {
            if (a[i]->is_over || !import_apart_look(a[i])) continue;
            a[i]->is_over = 1;
            left--;
            for (size_t k = 0; k < n; k++)
                shorten(a[k], a[i]);
        }
    }
}

enum { LARGE_LIMIT_MIB = 64 << 10 };

/* Returns the address space that a limit of the user (`ulimit -v`) leaves to the process, in MiB. 0: there is no such
 * limit, or import_child.c sets a lower one. A reader that is a program has the user's limit alone. */
static uint64_t user_limit_mib(const struct import_apart *a)
{
    struct rlimit limit;
    if (getrlimit(RLIMIT_AS, &limit) != 0) return 0;
    const uint64_t own = import_memory_of(getpid(), IMPORT_ADDRESSES) + 2 * ((uint64_t)a->task.limits.memory_mib << 20);
    const rlim_t most = a->task.argv != NULL ? limit.rlim_cur : limit.rlim_max;
    if (most == RLIM_INFINITY || (a->task.argv == NULL && most >= own)) return 0;
    return most >> 20 > 0 ? most >> 20 : 1;
}

/* how: the way in which it ended. The file may be a good one. Few readers need more addresses than LARGE_LIMIT_MIB.
 * Above that limit the file may be the cause, unless is_sure. */
static int fail_by_addresses(const struct import_apart *a, const char *how, bool is_sure, struct sh_err *err)
{
    const uint64_t limit_mib = user_limit_mib(a);
    return build_fail(a->task.b, SH_EINPUT, err,
                      "%s %s; " IMPORT_USER_LIMIT
                      " leaves it %llu MiB of addresses, which may be too little: lift that "
                      "limit%s",
                      a->task.name, how, (unsigned long long)limit_mib,
                      !is_sure && limit_mib > LARGE_LIMIT_MIB ? "; the file may be broken" : "");
}

/* "memory access out of bounds" of WebAssembly is no lack of memory. */
static bool is_lack_of_memory(const char *said)
{
    static const char *const words[] = {"out of memory", "allocation failed", "could not allocate", "cannot allocate"};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
        if (strcasestr(said, words[i]) != NULL) return true;
    return false;
}

static int fail_by_memory(const struct import_apart *a, struct sh_err *err)
{
    if (user_limit_mib(a) > 0) return fail_by_addresses(a, "ran out of memory", true, err);
    return build_fail(
        a->task.b, SH_EINPUT, err,
        "%s needs more than %u MiB to read it (scene.import_memory_mib): raise that where the mesh needs more; a "
        "broken file may need any amount: " IMPORT_ELSE_CONVERT,
        a->task.name, a->task.limits.memory_mib);
}

static int fail_by_time(const struct import_apart *a, struct sh_err *err)
{
    if (a->is_shortened)
        return build_fail(a->task.b, SH_EINPUT, err,
                          "%s did not read it within %.3g s, the time that it gets once the other reader has "
                          "ended: " IMPORT_ELSE_CONVERT,
                          a->task.name, 1e-9 * (double)(a->end_ns - a->start_ns));
    return build_fail(
        a->task.b, SH_EINPUT, err,
        "%s did not read it within %g s (scene.import_s): raise that where the mesh needs more; a broken file may "
        "take any time: " IMPORT_ELSE_CONVERT,
        a->task.name, 1e-9 * (double)(a->end_ns - a->start_ns));
}

static int fail_by_signal(const struct import_apart *a, int number, struct sh_err *err)
{
    const char *name = sigabbrev_np(number);
    if (number == SIGXCPU) return fail_by_time(a, err);
    if (number == SIGKILL)
        return build_fail(
            a->task.b, SH_EINPUT, err,
            "the process in which %s read it was killed (SIGKILL), as the system does when memory is short; "
            "scene.import_memory_mib is %u: " IMPORT_ELSE_CONVERT,
            a->task.name, a->task.limits.memory_mib);
    if (user_limit_mib(a) > 0) {
        char how[48];
        snprintf(how, sizeof how, "crashed (SIG%s)", name != NULL ? name : "?");
        return fail_by_addresses(a, how, false, err);
    }
    return build_fail(a->task.b, SH_EINPUT, err,
                      "%s crashed while it read the file (SIG%s): the file is broken, or %s has a fault "
                      "itself: " IMPORT_ELSE_CONVERT,
                      a->task.name, name != NULL ? name : "?", a->task.name);
}

int import_judge(struct import_apart *a, struct sh_err *err)
{
    if (a->n_warnings > MAX_WARNINGS)
        build_warn(a->task.b, "%s gave %d warnings; the first %d are shown", a->task.name, a->n_warnings, MAX_WARNINGS);
    if (a->end == IMPORT_STOPPED) return sh_fail_stopped(err);
    if (a->end == IMPORT_TIME) return fail_by_time(a, err);
    if (a->end == IMPORT_MEMORY) return fail_by_memory(a, err);
    if (WIFSIGNALED(a->status)) return fail_by_signal(a, WTERMSIG(a->status), err);
    /* A request larger than all memory is refused at once, and never counts as memory in use. */
    if (a->said.code == SH_ENOMEM || strstr(a->said.text, "bad_alloc") != NULL) return fail_by_memory(a, err);
    if (is_lack_of_memory(a->said.text) && user_limit_mib(a) > 0)
        return fail_by_addresses(a, "ran out of memory", true, err);
    if (a->said.code != 0) return sh_fail(err, a->said.code, "%s", a->said.text);
    if (WEXITSTATUS(a->status) == 0) return SH_OK;
    if (user_limit_mib(a) > 0) return fail_by_addresses(a, "ended without a message", false, err);
    return build_fail(a->task.b, SH_EINPUT, err,
                      "the process in which %s read it ended without a message (exit status %d): the file is "
                      "broken: " IMPORT_ELSE_CONVERT,
                      a->task.name, WEXITSTATUS(a->status));
}

/* Loads the task's library before the fork. The child of a process with threads must not load libraries, and each
 * child would do it again. */
static int load_library(const struct import_apart *a, struct sh_err *err)
{
    if (a->task.read == import_assimp) return late_load(LATE_assimp, NULL, NULL, 0, err);
    if (a->task.read == import_geotiff) return late_load(LATE_tiff, NULL, NULL, 0, err);
    return SH_OK;
}

static int read_apart(struct import_apart *a, struct sh_err *err)
{
    struct import_apart *const all[1] = {a};
    int rc = load_library(a, err);
    if (rc == SH_OK) rc = import_start(a, err);
    if (rc != SH_OK) return rc;
    import_watch(all, 1);
    rc = import_judge(a, err);
    if (rc == SH_OK) rc = import_result_read(a->task.b, a->result_fd, err);
    import_close(a);
    return rc;
}

int import_apart(struct scene_build *b, struct sh_err *err)
{
    const struct import_task assimp = {.b = b, .limits = build_limits(b), .name = "Assimp", .read = import_assimp};
    struct import_apart a = {.task = assimp};
    if (gltf_is_name(b->spec->file)) {
        a.task.name = "the reader of glTF";
        a.task.read = import_gltf;
    } else if (geotiff_is_name(b->spec->file)) {
        a.task.name = "the reader of GeoTIFF";
        a.task.read = import_geotiff;
    }
    const int rc = read_apart(&a, err);
    if (rc != SH_ESTATE || a.task.read != import_gltf) return rc;
    a = (struct import_apart){.task = assimp}; /* another process, since a fork must not load Assimp's library */
    return read_apart(&a, err);
}
