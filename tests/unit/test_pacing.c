/* The pacing thread allocates nothing, takes no lock and writes nothing but wake-ups, with readers, a hash, slots that
 * grow and ticks that come too late. The functions it must not call are replaced here by ones that count. */
#include "tests/unit/device_rig.h"

#include <dlfcn.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <time.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/loop/loop.h"

#ifndef SH_SANITIZE /* which has an allocator and locks of its own */

static _Thread_local int is_pacer; /* it alone sleeps until a time */
static _Atomic int sleeps, forbidden;

static void note(void)
{
    if (is_pacer) atomic_fetch_add(&forbidden, 1);
}

extern void *__libc_malloc(size_t n);
extern void *__libc_calloc(size_t n, size_t size);
extern void *__libc_realloc(void *p, size_t n);
extern void __libc_free(void *p);

/* The function that was replaced. */
static void *next_of(const char *name)
{
    void *f = dlsym(RTLD_NEXT, name);
    if (f == NULL) abort();
    return f;
}

void *malloc(size_t n)
{
    note();
    return __libc_malloc(n);
}

void *calloc(size_t n, size_t size)
{
    note();
    return __libc_calloc(n, size);
}

void *realloc(void *p, size_t n)
{
    note();
    return __libc_realloc(p, n);
}

void free(void *p)
{
    if (p != NULL) note(); /* the end of a thread frees nothing */
    __libc_free(p);
}

int pthread_mutex_lock(pthread_mutex_t *mutex)
{
    note();
    int (*next)(pthread_mutex_t *);
    *(void **)&next = next_of("pthread_mutex_lock");
    return next(mutex);
}

ssize_t write(int fd, const void *data, size_t n)
{
    if (n != sizeof(uint64_t)) note(); /* else to an eventfd */
    ssize_t (*next)(int, const void *, size_t);
    *(void **)&next = next_of("write");
    return next(fd, data, n);
}

int clock_nanosleep(clockid_t id, int flags, const struct timespec *t, struct timespec *left)
{
    is_pacer = 1;
    atomic_fetch_add(&sleeps, 1);
    int (*next)(clockid_t, int, const struct timespec *, struct timespec *);
    *(void **)&next = next_of("clock_nanosleep");
    return next(id, flags, t, left);
}

/* The counting counts. */
static void *bad_pacer(void *arg)
{
    pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
    clock_sleep_until_ns(clock_now_ns());
    *(void *volatile *)arg = malloc(1);
    pthread_mutex_lock(&lock);
    pthread_mutex_unlock(&lock);
    return NULL;
}

static void a_bad_pacer_is_found(void **state)
{
    (void)state;
    pthread_t thread;
    void *p = NULL;
    assert_int_equal(pthread_create(&thread, NULL, bad_pacer, &p), 0);
    pthread_join(thread, NULL);
    free(p);
    assert_true(atomic_exchange(&forbidden, 0) >= 2);
    assert_true(atomic_exchange(&sleeps, 0) == 1);
}

static void the_pacing_thread_does_nothing_else(void **state)
{
    (void)state;
    static const char *const sets[] = {"head.prr_hz=1000", "head.frames=0", "loop.queue_ms=20", "loop.threads=1"};
    const struct link_spec null_link = {.type = LINK_NULL};
    const struct loop_options options = {.hash = 1, .extra = &null_link};
    struct sh_err err;
    struct loop *loop;
    struct loop_stats stats;
    struct command_result result;
    struct rig *rig = rig_open(&(struct device_options){.start = 1, .duration_s = 0.5}, sets, 4);
    need(loop_create(rig->site, rig->device, &options, &loop, &err), &err);
    need(loop_start(loop, &err), &err);
    for (int ms = 0; !loop_is_over(loop) && ms < 30000; ms += 10) {
        poll(NULL, 0, 10);
        if (ms == 400) device_command(rig->device, 1, "HEAD:PRR MAX", 0, &result); /* slots grow */
    }
    assert_true(loop_is_over(loop));
    loop_join(loop, &stats);
    loop_free(loop);
    rig_close(rig);
    print_message("# %d sleeps, %u pulses, %u ticks lost\n", atomic_load(&sleeps), (unsigned)stats.counters.fired,
                  (unsigned)stats.counters.lost_ticks);
    assert_true(atomic_load(&sleeps) > 100 && stats.counters.fired > 10000);
    assert_int_equal(atomic_load(&forbidden), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_bad_pacer_is_found),
        cmocka_unit_test(the_pacing_thread_does_nothing_else),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}

#else

int main(void)
{
    print_message("1..0 # SKIP sanitizers have an allocator and locks of their own\n");
    return 0;
}

#endif
