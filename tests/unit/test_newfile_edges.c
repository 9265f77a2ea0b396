/* SPDX-License-Identifier: MIT */
/* Files that the program makes, where the system does something rare: another writer between two steps, no locks, a
 * write that fails and a later one that does not. */
#include <errno.h>
#include <fcntl.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/newfile.h"

static char dir[] = "/tmp/test_newfile_edges_XXXXXX", path[64];
static struct sh_err err;
static void (*before_lock)(void);
static int has_locks = 1;

/* This flock takes the place of libc's. */
int flock(int fd, int operation)
{
    void (*now)(void) = before_lock;
    before_lock = NULL;
    if (now != NULL) now();
    if (has_locks) return (int)syscall(SYS_flock, fd, operation);
    errno = ENOLCK;
    return -1;
}

static int open_with(const char *name, const char *text)
{
    const int fd = open(name, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, strlen(text)), strlen(text));
    return fd;
}

static void expect_text(int fd, const char *want)
{
    char text[64] = "";
    assert_int_equal(pread(fd, text, sizeof text - 1, 0), strlen(want));
    assert_string_equal(text, want);
}

static void replace(void)
{
    char other[80];
    snprintf(other, sizeof other, "%s.other", path);
    close(open_with(other, "new"));
    assert_int_equal(rename(other, path), 0);
}

/* Another file gets the name between open and lock. The one that is open has no name any more, and what was written to
 * it would be lost. */
static void test_another_gets_the_name(void **state)
{
    (void)state;
    int fd;
    close(open_with(path, "old"));
    before_lock = replace;
    assert_int_equal(newfile_open(path, &fd, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "another process has just written it anew"));
    const int now = open(path, O_RDONLY | O_CLOEXEC);
    expect_text(now, "new");
    close(now);
    unlink(path);
}

static void complete(void)
{
    char part[80];
    snprintf(part, sizeof part, "%s.part", path);
    assert_int_equal(rename(part, path), 0);
}

/* Another writer completes its file between open and lock. Ours is made anew, and theirs stays as it is. */
static void test_another_completes(void **state)
{
    (void)state;
    int fd;
    char part[80];
    snprintf(part, sizeof part, "%s.part", path);
    close(open_with(part, "theirs"));
    before_lock = complete;
    assert_int_equal(newfile_part(path, part, &fd, &err), 0);
    expect_text(fd, "");
    newfile_drop(part, fd);
    fd = open(path, O_RDONLY | O_CLOEXEC);
    expect_text(fd, "theirs");
    close(fd);
    unlink(path);
}

/* A shell redirects our output to a file, and writes to it before and afterwards. Nothing is lost, whether the shell
 * appends or not. */
static void test_redirected(void **state)
{
    (void)state;
    char name[32];
    int fd;
    for (int appends = 0; appends < 2; appends++) {
        const int shell = open_with(path, "before ");
        assert_int_equal(fcntl(shell, F_SETFL, appends ? O_APPEND : 0), 0);
        snprintf(name, sizeof name, "/dev/fd/%d", shell);
        assert_int_equal(newfile_open(name, &fd, &err), 0);
        assert_int_equal(write(fd, "ours ", 5), 5);
        assert_int_equal(write(shell, "after ", 6), 6);
        assert_int_equal(write(fd, "again", 5), 5);
        expect_text(shell, "before ours after again");
        assert_int_equal(!!(fcntl(shell, F_GETFL) & O_APPEND), appends);
        close(fd);
        close(shell);
        unlink(path);
    }
}

/* On a file system without locks a whole file is opened for writing all the same. */
static void test_without_locks(void **state)
{
    (void)state;
    int fd;
    close(open_with(path, "whole"));
    has_locks = 0;
    assert_int_equal(newfile_whole(path, &fd, &err), 0);
    has_locks = 1;
    assert_int_equal(fcntl(fd, F_GETFL) & O_ACCMODE, O_RDWR);
    close(fd);
    unlink(path);
}

/* The disk is full for a moment; the last lines find room again. */
static int put_with_a_gap(const void *source, FILE *file, struct sh_err *why)
{
    (void)source;
    (void)why;
    struct rlimit before, none;
    getrlimit(RLIMIT_FSIZE, &before);
    none = before;
    none.rlim_cur = 1;
    fputs("begin", file);
    setrlimit(RLIMIT_FSIZE, &none);
    fflush(file);
    setrlimit(RLIMIT_FSIZE, &before);
    fputs("end", file);
    return SH_OK;
}

static void test_gap(void **state)
{
    (void)state;
    struct stat st;
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(newfile_write(path, put_with_a_gap, NULL, &err), SH_EIO);
    assert_non_null(strstr(err.text, "cannot be written: File too large"));
    assert_int_equal(lstat(path, &st), -1);
}

static int put_a_word(const void *source, FILE *file, struct sh_err *why)
{
    (void)source, (void)why;
    fputs("word", file);
    return SH_OK;
}

/* With ever fewer descriptors left, the file is written, or the reason is that there are too few. */
static void test_few_descriptors(void **state)
{
    struct rlimit before;
    int n_failed = 0, rc = -1;
    (void)state;
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &before), 0);
    for (int left = 0; rc != SH_OK; left++) {
        const int next = open("/dev/null", O_RDONLY | O_CLOEXEC);
        const struct rlimit few = {.rlim_cur = (rlim_t)(next + left), .rlim_max = before.rlim_max};
        close(next);
        assert_int_equal(setrlimit(RLIMIT_NOFILE, &few), 0);
        rc = newfile_write(path, put_a_word, NULL, &err);
        assert_int_equal(setrlimit(RLIMIT_NOFILE, &before), 0);
        assert_true(left < 10);
        n_failed += rc != SH_OK;
        if (rc != SH_OK && strstr(err.text, "Too many open files") == NULL) fail_msg("%d left: %s", left, err.text);
    }
    assert_true(n_failed >= 2); /* the file itself, and the stream on it */
    unlink(path);
}

static int set_up(void **state)
{
    (void)state;
    if (mkdtemp(dir) == NULL) return -1;
    snprintf(path, sizeof path, "%s/a", dir);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    return rmdir(dir);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_another_gets_the_name),
        cmocka_unit_test(test_another_completes),
        cmocka_unit_test(test_redirected),
        cmocka_unit_test(test_without_locks),
        cmocka_unit_test(test_gap),
        cmocka_unit_test(test_few_descriptors),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
