/* SPDX-License-Identifier: MIT */
/* The system has no thread left at the moment when the loop starts one of its own. Each thread of the loop is the
 * missing one in turn. The start fails with a line that names it, and the threads that had started end. The time limit
 * of tests catches a loop that waits for ever. */
#include "tests/unit/device_rig.h"
#include "tests/unit/plain_source.h"

#include <dlfcn.h>
#include <errno.h>
#include <poll.h>
#include <pthread.h>

#include "firmware_sim/loop/loop.h"

#ifndef SH_SANITIZE /* which has a pthread_create of its own */

static int n_created, refused; /* threads since the start, and the one that the system refuses, from 1 on; 0: none */

/* This pthread_create takes the place of the C library's. */
int pthread_create(pthread_t *thread, const pthread_attr_t *attr, void *(*begin)(void *), void *arg)
{
    int (*next)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *) = NULL;
    void *found = dlsym(RTLD_NEXT, "pthread_create");
    memcpy(&next, &found, sizeof next); /* ISO C has no cast from void * to a function */
    return ++n_created == refused ? EAGAIN : next(thread, attr, begin, arg);
}

static int is_one_of(const char *text, const char *const *known)
{
    while (*known != NULL && strncmp(text, *known, strlen(*known)) != 0)
        known++;
    return *known != NULL;
}

/* Starts a loop without its thread number `which`, and ends it. Returns 0 where the loop has fewer threads. */
static int start_without(int which, const char *const *sets, int is_made, const char *const *known)
{
    static const struct link_spec null_link = {.type = LINK_NULL};
    const struct loop_options options = {.hash = 1, .extra = &null_link};
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, 3);
    struct plain_source made = {.next = NULL};
    const struct loop_source source = {&plain_source_ops, &made};
    struct loop *loop;
    struct loop_stats stats;
    struct sh_err err = {0, ""};
    need(is_made ? loop_create_of(rig->cfg, &source, &options, &loop, &err)
                 : loop_create(rig->site, rig->device, &options, &loop, &err),
         &err);
    n_created = 0;
    refused = which;
    const int rc = loop_start(loop, &err), n = n_created;
    refused = 0;
    if (rc == SH_OK) loop_end(loop);
    memset(&stats, 0xff, sizeof stats);
    loop_join(loop, &stats);
    assert_int_equal(stats.have_hash, which > 1); /* the hash has the first thread */
    loop_free(loop);
    rig_close(rig);
    if (rc != SH_OK) {
        assert_int_equal(n, which); /* it tries no further one */
        assert_int_equal(rc, SH_EIO);
        assert_non_null(strstr(err.text, "Resource temporarily unavailable"));
        if (!is_one_of(err.text, known)) fail_msg("%s", err.text);
    }
    return n >= which;
}

static const char *const known[] = {"the stream hash cannot start: ",
                                    "link null: no thread: ",
                                    "loop: no pacing thread: ",
                                    "loop: no thread for a caster: ",
                                    "loop: no thread for the recording: ",
                                    NULL};

static void a_start_without_threads_ends(void **state)
{
    (void)state;
    static const char *const paces[] = {"loop.pace=fast", "loop.pace=step", "loop.pace=realtime"};
    for (int i = 0; i < 3; i++)
        for (int is_made = 0; is_made < 2; is_made++) {
            const char *const sets[] = {paces[i], "loop.threads=2", "head.frames=0"};
            int which = 1;
            while (start_without(which, sets, is_made, known))
                which++;
            assert_true(which > 3); /* the hash, the pacing thread and one that computes, at least */
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_start_without_threads_ends)};
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}

#else

int main(void)
{
    print_message("1..0 # SKIP sanitizers have a pthread_create of their own\n");
    return 0;
}

#endif
