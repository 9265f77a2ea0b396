/* SPDX-License-Identifier: MIT */
#include "tests/unit/pacing_rig.h"

#ifndef SH_SANITIZE

#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/futex.h>
#include <linux/seccomp.h>
#include <malloc.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <threads.h>
#include <time.h>

#if defined __x86_64__
#define THIS_ARCH AUDIT_ARCH_X86_64
#elif defined __aarch64__
#define THIS_ARCH AUDIT_ARCH_AARCH64
#else
#define THIS_ARCH 0 /* every call is shown */
#endif

enum { MOST_FOUND = 256, NAME_LEN = 40 };

static _Thread_local int is_pacer;
static void (*plant)(int sleep);
static int handover = -1; /* an eventfd: the filter is there */
static pthread_t watcher;
static int watching;
static _Atomic int sleeps, listener, n_found;
static _Atomic long slow_ns;
static struct found {
    char name[NAME_LEN];
    int nr;       /* of a system call; -1: of a function */
    int at_sleep; /* after so many */
} found[MOST_FOUND];

static void find(const char *name, int nr)
{
    const int i = atomic_fetch_add(&n_found, 1);
    if (i >= MOST_FOUND) return;
    found[i].nr = nr;
    found[i].at_sleep = atomic_load(&sleeps);
    for (size_t k = 0; k + 1 < sizeof found[i].name && name[k] != '\0'; k++) /* strcpy might be one that is noted */
        found[i].name[k] = name[k];
}

/* ---- functions */

static void note(const char *name)
{
    if (is_pacer) find(name, -1);
}

/* Returns the function that was replaced. For conditions dlsym would return an older kind, and dlvsym allocates when
 * asked for a missing version. */
static void *next_of(const char *name)
{
    const int is_condition = strncmp(name, "pthread_cond_", strlen("pthread_cond_")) == 0;
    void *f = is_condition ? dlvsym(RTLD_NEXT, name, "GLIBC_2.3.2") : NULL;
    if (f == NULL) f = dlsym(RTLD_NEXT, name);
    if (f == NULL) abort();
    return f;
}

/* The replaced functions are found before main, since dlsym takes a lock for which the pacing thread would wait. One
 * that is called even earlier is found at its call. */
#define FINDS(name)                                            \
    static void *next_##name;                                  \
    __attribute__((constructor)) static void find_##name(void) \
    {                                                          \
        if (next_##name == NULL) next_##name = next_of(#name); \
    }
/* A function that is noted where the pacing thread calls it, and then does its work. */
#define LOOKED_AT(type, name, params, args) \
    FINDS(name)                             \
    type name params;                       \
    type name params                        \
    {                                       \
        note(#name);                        \
        find_##name();                      \
        type(*next) params;                 \
        *(void **)&next = next_##name;      \
        return next args;                   \
    }
/* dlsym itself allocates. */
#define ALLOCATES(type, name, params, args) \
    extern type __libc_##name params;       \
    type name params                        \
    {                                       \
        note(#name);                        \
        return __libc_##name args;          \
    }

ALLOCATES(void *, malloc, (size_t n), (n))
ALLOCATES(void *, calloc, (size_t n, size_t size), (n, size))
ALLOCATES(void *, realloc, (void *p, size_t n), (p, n))

extern void __libc_free(void *p);
void free(void *p)
{
    if (p != NULL) note("free"); /* a thread that ends calls free(NULL) */
    __libc_free(p);
}

/* pthread_cond_wait is not here: its caller has locked a mutex before, which is noted. */
LOOKED_AT(int, posix_memalign, (void **p, size_t align, size_t n), (p, align, n))
LOOKED_AT(void *, aligned_alloc, (size_t align, size_t n), (align, n))
LOOKED_AT(void *, memalign, (size_t align, size_t n), (align, n))
LOOKED_AT(void *, valloc, (size_t n), (n))
LOOKED_AT(int, pthread_mutex_trylock, (pthread_mutex_t * m), (m))
LOOKED_AT(int, pthread_mutex_timedlock, (pthread_mutex_t * m, const struct timespec *t), (m, t))
LOOKED_AT(int, pthread_mutex_clocklock, (pthread_mutex_t * m, clockid_t id, const struct timespec *t), (m, id, t))
LOOKED_AT(int, mtx_lock, (mtx_t * m), (m))
LOOKED_AT(int, pthread_cond_signal, (pthread_cond_t * c), (c))
LOOKED_AT(int, pthread_cond_broadcast, (pthread_cond_t * c), (c))
LOOKED_AT(int, pthread_once, (pthread_once_t * once, void (*f)(void)), (once, f))
LOOKED_AT(int, pthread_rwlock_tryrdlock, (pthread_rwlock_t * l), (l))
LOOKED_AT(int, pthread_rwlock_trywrlock, (pthread_rwlock_t * l), (l))
LOOKED_AT(int, pthread_rwlock_rdlock, (pthread_rwlock_t * l), (l))
LOOKED_AT(int, pthread_rwlock_wrlock, (pthread_rwlock_t * l), (l))
LOOKED_AT(int, pthread_spin_lock, (pthread_spinlock_t * l), (l))
LOOKED_AT(int, fputs, (const char *text, FILE *f), (text, f))
LOOKED_AT(int, puts, (const char *text), (text))
LOOKED_AT(int, fflush, (FILE * f), (f))
LOOKED_AT(size_t, fwrite, (const void *p, size_t size, size_t n, FILE *f), (p, size, n, f))
LOOKED_AT(int, vfprintf, (FILE * f, const char *format, va_list args), (f, format, args))
LOOKED_AT(int, vprintf, (const char *format, va_list args), (format, args))
LOOKED_AT(int, vsprintf, (char *text, const char *format, va_list args), (text, format, args))
LOOKED_AT(int, vsnprintf, (char *text, size_t n, const char *format, va_list args), (text, n, format, args))
LOOKED_AT(struct tm *, localtime_r, (const time_t *t, struct tm *tm), (t, tm))
LOOKED_AT(char *, getenv, (const char *name), (name))

FINDS(pthread_mutex_lock)
int pthread_mutex_lock(pthread_mutex_t *m)
{
    const struct timespec t = {.tv_nsec = atomic_load(&slow_ns)};
    note("pthread_mutex_lock");
    if (t.tv_nsec != 0 && !is_pacer) syscall(SYS_clock_nanosleep, CLOCK_MONOTONIC, 0, &t, NULL);
    find_pthread_mutex_lock();
    int (*next)(pthread_mutex_t *);
    *(void **)&next = next_pthread_mutex_lock;
    return next(m);
}

/* The arguments are not known, so they are passed on as a list. */
#define FORMATS(name, params, list_name, args) \
    int name params                            \
    {                                          \
        va_list list;                          \
        note(#name);                           \
        va_start(list, format);                \
        const int written = list_name args;    \
        va_end(list);                          \
        return written;                        \
    }
FORMATS(printf, (const char *format, ...), vprintf, (format, list))
FORMATS(fprintf, (FILE * f, const char *format, ...), vfprintf, (f, format, list))
FORMATS(sprintf, (char *text, const char *format, ...), vsprintf, (text, format, list))
FORMATS(snprintf, (char *text, size_t cap, const char *format, ...), vsnprintf, (text, cap, format, list))

/* ---- system calls */

enum { MAX_EVENTFDS = 32, MAX_FILTER = 32 + 2 * MAX_EVENTFDS };

struct filter {
    struct sock_filter op[MAX_FILTER];
    unsigned short n;
};

static void add(struct filter *filter, struct sock_filter op)
{
    if (filter->n == MAX_FILTER) abort();
    filter->op[filter->n++] = op;
}

static void load(struct filter *filter, size_t at)
{
    add(filter, (struct sock_filter)BPF_STMT(BPF_LD | BPF_W | BPF_ABS, (uint32_t)at));
}

/* If the value is equal, `yes` ops are skipped, and otherwise `no` ops. */
static void compare(struct filter *filter, uint32_t value, uint8_t yes, uint8_t no)
{
    add(filter, (struct sock_filter)BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, yes, no));
}

static void end_with(struct filter *filter, uint32_t result)
{
    add(filter, (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, result));
}

static size_t low_half(int arg)
{
    const size_t at = offsetof(struct seccomp_data, args) + (size_t)arg * sizeof(uint64_t);
    return __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__ ? at + 4 : at;
}

/* Lets the call pass if the loaded value is `nr`. */
static void let_pass(struct filter *filter, long nr)
{
    compare(filter, (uint32_t)nr, 0, 1);
    end_with(filter, SECCOMP_RET_ALLOW);
}

/* Lets the calls of a semaphore pass: a wake-up and a wait. Waits for conditions and mutexes are noted by their
 * functions. */
static void let_semaphores(struct filter *filter)
{
    compare(filter, SYS_futex, 0, 6);
    load(filter, low_half(1));
    add(filter, (struct sock_filter)BPF_STMT(BPF_ALU | BPF_AND | BPF_K, (uint32_t)FUTEX_CMD_MASK));
    compare(filter, FUTEX_WAKE, 2, 0);
    compare(filter, FUTEX_WAIT_BITSET, 1, 0);
    end_with(filter, SECCOMP_RET_USER_NOTIF);
    end_with(filter, SECCOMP_RET_ALLOW);
}

static void let_wake_ups(struct filter *filter, const int *fd, int n)
{
    compare(filter, SYS_write, 1, 0);
    end_with(filter, SECCOMP_RET_USER_NOTIF);
    load(filter, low_half(2));
    compare(filter, sizeof(uint64_t), 1, 0);
    end_with(filter, SECCOMP_RET_USER_NOTIF);
    load(filter, low_half(0));
    for (int i = 0; i < n; i++)
        let_pass(filter, fd[i]);
    end_with(filter, SECCOMP_RET_USER_NOTIF);
}

static int list_eventfds(int *fd)
{
    int n = 0;
    DIR *dir = opendir("/proc/self/fd");
    for (struct dirent *entry; dir != NULL && (entry = readdir(dir)) != NULL;) {
        char path[300], to[64] = "";
        snprintf(path, sizeof path, "/proc/self/fd/%s", entry->d_name);
        if (readlink(path, to, sizeof to - 1) > 0 && strstr(to, "[eventfd]") != NULL && n < MAX_EVENTFDS)
            fd[n++] = atoi(entry->d_name);
    }
    if (dir != NULL) closedir(dir);
    return n;
}

/* Installs the filter for this thread alone, for ever. Returns the descriptor that shows the thread's other calls;
 * negative: there is no such filter. */
static int install(void)
{
    struct filter filter = {.n = 0};
    int fd[MAX_EVENTFDS];
    const int n = list_eventfds(fd);
    load(&filter, offsetof(struct seccomp_data, arch));
    compare(&filter, THIS_ARCH, 1, 0);
    end_with(&filter, SECCOMP_RET_USER_NOTIF);
    load(&filter, offsetof(struct seccomp_data, nr));
    let_pass(&filter, SYS_clock_nanosleep);
    let_pass(&filter, SYS_clock_gettime); /* where it is a system call */
    let_pass(&filter, SYS_restart_syscall);
    let_semaphores(&filter);
    let_wake_ups(&filter, fd, n);
    struct sock_fprog program = {.len = filter.n, .filter = filter.op};
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return -1;
    return (int)syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_NEW_LISTENER, &program);
}

/* Notes each call that the filter shows, and lets it go on, until the thread has ended. */
static void *watch(void *arg)
{
    struct seccomp_notif call;
    struct pollfd slot = {.fd = handover, .events = POLLIN};
    (void)arg;
    if (poll(&slot, 1, 240000) != 1 || (slot.fd = atomic_load(&listener)) < 0) return NULL;
    while (poll(&slot, 1, -1) == 1 && (slot.revents & POLLIN) != 0) {
        memset(&call, 0, sizeof call);
        if (ioctl(slot.fd, SECCOMP_IOCTL_NOTIF_RECV, &call) != 0) continue;
        char name[NAME_LEN];
        snprintf(name, sizeof name, "system call %d", call.data.nr);
        find(name, call.data.nr);
        struct seccomp_notif_resp go_on = {.id = call.id, .flags = SECCOMP_USER_NOTIF_FLAG_CONTINUE};
        ioctl(slot.fd, SECCOMP_IOCTL_NOTIF_SEND, &go_on);
    }
    close(slot.fd);
    return NULL;
}

int pacing_filter_works(void)
{
    struct seccomp_notif_sizes sizes;
    return syscall(SYS_seccomp, SECCOMP_GET_NOTIF_SIZES, 0, &sizes) == 0;
}

/* ---- the thread */

static void arm(void)
{
    atomic_store(&listener, install());
    eventfd_write(handover, 1);
    is_pacer = 1;
}

int clock_nanosleep(clockid_t id, int flags, const struct timespec *t, struct timespec *left)
{
    if (!is_pacer && watching) arm();
    if (is_pacer && plant != NULL) plant(atomic_load(&sleeps));
    atomic_fetch_add(&sleeps, 1);
    return syscall(SYS_clock_nanosleep, id, flags, t, left) == 0 ? 0 : errno;
}

void pacing_watch(void (*planted)(int sleep))
{
    if (handover < 0) handover = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    assert_true(handover >= 0);
    atomic_store(&sleeps, 0);
    atomic_store(&n_found, 0);
    plant = planted;
    watching = 1;
    assert_int_equal(pthread_create(&watcher, NULL, watch, NULL), 0);
}

/* The calls that end a thread, once it sleeps no more. */
static int is_the_end(const struct found *f)
{
    static const int ends[] = {SYS_madvise, SYS_munmap, SYS_rt_sigprocmask, SYS_rseq, SYS_exit};
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++)
        if (f->nr == ends[i] && f->at_sleep == atomic_load(&sleeps)) return 1;
    return 0;
}

int pacing_found(void)
{
    int n = 0;
    uint64_t ring;
    watching = 0;
    pthread_join(watcher, NULL);
    if (read(handover, &ring, sizeof ring) != sizeof ring || atomic_load(&listener) < 0)
        fail_msg("the pacing thread has no filter");
    const int all = atomic_load(&n_found) < MOST_FOUND ? atomic_load(&n_found) : MOST_FOUND;
    for (int i = 0; i < all; i++) {
        if (is_the_end(&found[i])) continue;
        if (n++ < 20) print_message("# %s, after %d sleeps\n", found[i].name, found[i].at_sleep);
    }
    return n;
}

int pacing_has(const char *name)
{
    for (int i = 0; i < atomic_load(&n_found) && i < MOST_FOUND; i++)
        if (strcmp(found[i].name, name) == 0) return 1;
    return 0;
}

void pacing_slow_locks(int64_t ns)
{
    atomic_store(&slow_ns, ns);
}

int pacing_sleeps(void)
{
    return atomic_load(&sleeps);
}

#endif
