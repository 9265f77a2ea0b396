/* SPDX-License-Identifier: MIT */
/* A writer of lines that can't begin closes its file, and says why. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "firmware_sim/base/line_writer.h"

#ifndef SH_SANITIZE /* which has a pthread_create and a malloc of its own */

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <unistd.h>

/* It takes the place of the C library's. */
int pthread_create(pthread_t *thread, const pthread_attr_t *attr, void *(*begin)(void *), void *arg)
{
    (void)thread;
    (void)attr;
    (void)begin;
    (void)arg;
    return EAGAIN;
}

static void no_gap(char text[LINE_GAP_BYTES], const uint64_t lost[LINE_KINDS])
{
    (void)text;
    (void)lost;
}

static void expect_refused(size_t room, int code, const char *text)
{
    int fd[2];
    struct sh_err err = {0};
    struct line_writer *writer = (struct line_writer *)&err;
    assert_int_equal(pipe(fd), 0);
    const struct line_writer_spec spec = {.fd = fd[1], .what = "test", .path = "the file", .room = room, .gap = no_gap};
    assert_int_equal(line_writer_open(&spec, &writer, &err), code);
    assert_string_equal(err.text, text);
    assert_null(writer);
    assert_true(fcntl(fd[1], F_GETFD) < 0 && errno == EBADF);
    close(fd[0]);
}

static void without_a_thread(void **state)
{
    (void)state;
    expect_refused(8192, SH_EIO, "test: the file: no thread: Resource temporarily unavailable");
}

static void without_memory(void **state)
{
    (void)state;
    expect_refused(SIZE_MAX / 4, SH_ENOMEM, "test: the file: no memory");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(without_a_thread), cmocka_unit_test(without_memory)};
    return cmocka_run_group_tests_name("line_writer that can't begin", tests, NULL, NULL);
}

#else

int main(void)
{
    print_message("1..0 # SKIP sanitizers have a pthread_create of their own\n");
    return 0;
}

#endif
