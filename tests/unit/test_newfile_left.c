/* SPDX-License-Identifier: MIT */
/* Files that are there already (core/newfile.h): parts that a killed writer has left, files that are read and perhaps
 * mended, and names that must not be replaced. */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "core/newfile.h"
#include "tests/common/cases.h"

static char dir[] = "/tmp/test_newfile_left_XXXXXX", path[64], part[64], other[64];
static struct sh_err err;

/* ---- file systems that lack something; these take the place of libc's */

static int renameat2_fails, link_fails; /* with this error; 0: they do their work */

int renameat2(int from_dir, const char *from, int to_dir, const char *to, unsigned flags)
{
    errno = renameat2_fails;
    return errno != 0 ? -1 : (int)syscall(SYS_renameat2, from_dir, from, to_dir, to, flags);
}

int link(const char *from, const char *to)
{
    errno = link_fails;
    return errno != 0 ? -1 : (int)syscall(SYS_linkat, AT_FDCWD, from, AT_FDCWD, to, 0);
}

static void write_text(const char *name, const char *text)
{
    FILE *out = fopen(name, "w");
    assert_non_null(out);
    fputs(text, out);
    assert_int_equal(fclose(out), 0);
}

static void expect_text(const char *name, const char *want)
{
    char text[64] = "";
    FILE *in = fopen(name, "r");
    assert_non_null(in);
    text[fread(text, 1, sizeof text - 1, in)] = '\0';
    fclose(in);
    assert_string_equal(text, want);
}

static void expect_error(int rc, int code, const char *name, const char *says)
{
    char want[200];
    snprintf(want, sizeof want, "%s: %s", name, says);
    if (rc != code || strncmp(err.text, want, strlen(want)) != 0) fail_msg("%d, no \"%s\" in: %s", rc, want, err.text);
    err.text[0] = '\0';
}

static int mode_of(int fd)
{
    return fcntl(fd, F_GETFL) & O_ACCMODE;
}

/* Another descriptor has a lock of its own, as another process would. */
static int lock_of_another(const char *name, int kind)
{
    const int fd = open(name, O_RDWR | O_CLOEXEC);
    assert_int_equal(flock(fd, kind | LOCK_NB), 0);
    return fd;
}

static void a_part_that_was_left(void **state)
{
    (void)state;
    int fd;
    char c;
    expect_error(newfile_left(part, &fd, &err), SH_EINPUT, part,
                 "cannot be opened for reading and writing: No such file or directory");
    assert_int_equal(newfile_left_len(part), 0);
    write_text(part, "left");
    assert_int_equal(newfile_left_len(part), 4);
    assert_int_equal(newfile_left(part, &fd, &err), SH_OK);
    assert_int_equal(mode_of(fd), O_RDWR);
    assert_true(pread(fd, &c, 1, 3) == 1 && c == 't'); /* its bytes stay */
    assert_int_equal(newfile_left_len(part), 0);       /* it is locked now */
    const int second = open(part, O_RDWR | O_CLOEXEC);
    assert_int_equal(flock(second, LOCK_SH | LOCK_NB), -1);
    close(second);
    close(fd);
    const int writer = lock_of_another(part, LOCK_EX);
    expect_error(newfile_left(part, &fd, &err), SH_ESTATE, part, "is still being written by another process");
    assert_int_equal(newfile_left_len(part), 0);
    close(writer);
    assert_int_equal(link(part, other), 0);
    expect_error(newfile_left(part, &fd, &err), SH_EINPUT, part, "is a file with 2 hard links");
    unlink(part);
    assert_int_equal(symlink(other, part), 0);
    expect_error(newfile_left(part, &fd, &err), SH_EINPUT, part, "is a symbolic link to ");
    assert_int_equal(newfile_left_len(part), 0);
    unlink(part);
    assert_int_equal(mkfifo(part, 0600), 0);
    expect_error(newfile_left(part, &fd, &err), SH_EINPUT, part, "is a FIFO; allowed is a regular file");
    assert_int_equal(newfile_left_len(part), 0);
    unlink(part);
    unlink(other);
}

/* The user's own file, with no other name, is opened for writing and locked. Any other is only read. */
static void a_file_that_is_whole(void **state)
{
    (void)state;
    int fd;
    expect_error(newfile_whole(path, &fd, &err), SH_EINPUT, path, "cannot be opened: No such file or directory");
    write_text(path, "whole");
    assert_int_equal(newfile_whole(path, &fd, &err), SH_OK);
    assert_int_equal(mode_of(fd), O_RDWR);
    const int second = open(path, O_RDWR | O_CLOEXEC);
    assert_int_equal(flock(second, LOCK_SH | LOCK_NB), -1);
    close(second);
    close(fd);
    const int writer = lock_of_another(path, LOCK_EX);
    assert_int_equal(newfile_whole(path, &fd, &err), SH_OK);
    assert_int_equal(mode_of(fd), O_RDONLY);
    close(fd);
    close(writer);
    assert_int_equal(link(path, other), 0);
    assert_int_equal(newfile_whole(path, &fd, &err), SH_OK);
    assert_int_equal(mode_of(fd), O_RDONLY);
    close(fd);
    unlink(other);
    assert_int_equal(symlink(path, other), 0);
    expect_error(newfile_whole(other, &fd, &err), SH_EINPUT, other, "is a symbolic link to ");
    unlink(other);
    assert_int_equal(mkdir(other, 0700), 0);
    expect_error(newfile_whole(other, &fd, &err), SH_EINPUT, other, "is a directory; allowed is a regular file");
    rmdir(other);
    expect_text(path, "whole");
    unlink(path);
}

static void a_name_that_is_taken(void **state)
{
    (void)state;
    int fd;
    assert_int_equal(newfile_part(path, part, &fd, &err), SH_OK);
    assert_int_equal(write(fd, "new", 3), 3);
    write_text(path, "old");
    expect_error(newfile_settle_free(path, part, fd, &err), SH_ESTATE, path, "exists, and is not replaced by ");
    expect_text(path, "old");
    expect_text(part, "new");
    unlink(path);
    assert_int_equal(newfile_settle_free(path, part, fd, &err), SH_OK);
    expect_text(path, "new");
    assert_int_equal(access(part, F_OK), -1);
    assert_int_equal(fcntl(fd, F_GETFD), -1); /* it is closed */
    /* In two steps the descriptor stays open. */
    assert_int_equal(newfile_part(path, part, &fd, &err), SH_OK);
    assert_int_equal(write(fd, "third", 5), 5);
    assert_int_equal(newfile_sync(part, fd, &err), SH_OK);
    assert_int_equal(newfile_rename(path, part, &err), SH_OK);
    expect_text(path, "third");
    assert_true(fcntl(fd, F_GETFD) >= 0);
    close(fd);
    unlink(path);
    assert_int_equal(mkdir(path, 0700), 0);
    write_text(part, "fourth");
    expect_error(newfile_rename(path, part, &err), SH_EINPUT, path, "is a directory; allowed is a regular file");
    rmdir(path);
    unlink(part);
    expect_error(newfile_rename(path, part, &err), SH_EINPUT, part, "cannot be renamed to ");
    expect_error(newfile_sync(part, -1, &err), SH_EIO, part, "cannot be synced: Bad file descriptor");
}

/* Where a file system can't rename without replacing, or has no hard links either, a name that is taken stays all the
 * same. Any other error is reported. */
static void a_name_is_kept_on_any_file_system(void **state)
{
    (void)state;
    static const struct {
        int renameat2, link, code;
        const char *says; /* for a free name; NULL: the file gets it */
    } is[] = {{EINVAL, 0, SH_OK, NULL},
              {ENOSYS, 0, SH_OK, NULL},
              {EINVAL, EPERM, SH_OK, NULL},
              {ENOSYS, EOPNOTSUPP, SH_OK, NULL},
              {EACCES, 0, SH_EPERM, ": Permission denied"},
              {EINVAL, EIO, SH_EIO, ": Input/output error"}};
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        int fd, rc;
        assert_int_equal(newfile_part(path, part, &fd, &err), SH_OK);
        assert_int_equal(write(fd, "new", 3), 3);
        renameat2_fails = is[i].renameat2;
        link_fails = is[i].link;
        if (is[i].says == NULL) {
            write_text(path, "old");
            expect_error(newfile_settle_free(path, part, fd, &err), SH_ESTATE, path, "exists, and is not replaced by ");
            expect_text(path, "old");
            expect_text(part, "new");
            unlink(path);
        }
        rc = newfile_settle_free(path, part, fd, &err);
        renameat2_fails = link_fails = 0;
        assert_int_equal(rc, is[i].code);
        if (rc != SH_OK) {
            assert_non_null(strstr(err.text, is[i].says));
            newfile_drop(part, fd);
            continue;
        }
        expect_text(path, "new");
        assert_int_equal(access(part, F_OK), -1);
        unlink(path);
    }
}

/* After a failure newfile_keep removes the part, and newfile_settle leaves it. */
static void a_file_that_cannot_have_its_name(void **state)
{
    (void)state;
    int fd;
    assert_int_equal(newfile_part(path, part, &fd, &err), SH_OK);
    assert_int_equal(mkdir(path, 0700), 0);
    expect_error(newfile_settle(path, part, fd, &err), SH_EINPUT, path, "is a directory");
    assert_int_equal(access(part, F_OK), 0);
    expect_error(newfile_keep(path, part, fd, &err), SH_EINPUT, path, "is a directory");
    assert_int_equal(access(part, F_OK), -1);
    assert_int_equal(fcntl(fd, F_GETFD), -1);
    rmdir(path);
}

static int put_text(const void *source, FILE *file, struct sh_err *why)
{
    (void)why;
    fputs(source, file);
    return SH_OK;
}

/* A file that grows is written anew only while it has its name. */
static void a_file_that_was_replaced(void **state)
{
    (void)state;
    int fd;
    assert_int_equal(newfile_append(path, &fd, &err), SH_OK);
    assert_int_equal(rename(path, other), 0);
    expect_error(newfile_replace(path, &fd, put_text, "new", &err), SH_ESTATE, path,
                 "was removed or replaced by somebody else; it is not written any more");
    assert_int_equal(access(part, F_OK), -1);
    write_text(path, "theirs");
    expect_error(newfile_replace(path, &fd, put_text, "new", &err), SH_ESTATE, path, "was removed or replaced");
    expect_text(path, "theirs");
    assert_int_equal(access(part, F_OK), -1);
    assert_int_equal(rename(other, path), 0);
    assert_int_equal(newfile_replace(path, &fd, put_text, "new", &err), SH_OK);
    expect_text(path, "new");
    close(fd);
    unlink(path);
}

/* newfile_check, asked before long work, leaves no file, and fails where the work itself would. */
static void paths_that_cannot_be_made(void **state)
{
    (void)state;
    char missing[80], below[80], too_long[400];
    int fd;
    assert_int_equal(newfile_check(path, &err), SH_OK);
    assert_int_equal(access(path, F_OK) + access(part, F_OK), -2);
    snprintf(missing, sizeof missing, "%s/no/file", dir);
    expect_error(newfile_open(missing, &fd, &err), SH_EINPUT, missing,
                 "cannot be opened for writing: No such file or directory");
    assert_int_equal(newfile_check(missing, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "/no/file.part: cannot create: No such file or directory"));
    write_text(path, "a file");
    snprintf(below, sizeof below, "%s/file", path);
    expect_error(newfile_check(below, &err), SH_EINPUT, below, "cannot create: Not a directory");
    snprintf(too_long, sizeof too_long, "%s/%0300d", dir, 0);
    expect_error(newfile_check(too_long, &err), SH_EINPUT, too_long, "cannot create: File name too long");
    expect_error(newfile_open(dir, &fd, &err), SH_EINPUT, dir, "cannot be opened for writing: Is a directory");
    unlink(path);
}

/* Names of our own descriptors are followed, whoever made them: a duplicate has the same file. */
static void names_of_descriptors(void **state)
{
    (void)state;
    static const char *const forms[] = {"/dev/fd/%d", "/proc/self/fd/%d"};
    char name[64];
    for (int i = 0; i < 2; i++) {
        const int shell = open(path, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
        int fd;
        assert_int_equal(write(shell, "one ", 4), 4);
        snprintf(name, sizeof name, forms[i], shell);
        assert_int_equal(newfile_open(name, &fd, &err), SH_OK);
        assert_int_equal(write(fd, "two", 3), 3);
        expect_text(path, "one two");
        close(fd);
        snprintf(name + strlen(name), sizeof name - strlen(name), "x"); /* no such name */
        assert_int_equal(newfile_open(name, &fd, &err) == SH_OK, 0);
        close(shell);
        unlink(path);
    }
    for (int n = STDOUT_FILENO; n <= STDERR_FILENO; n++) {
        const int kept = dup(n), to = open(path, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
        int fd = -1;
        fflush(stdout);
        dup2(to, n);
        const int rc = newfile_open(n == STDOUT_FILENO ? "/dev/stdout" : "/dev/stderr", &fd, &err);
        const ssize_t got = rc == SH_OK ? write(fd, "taken", 5) : -1;
        dup2(kept, n);
        close(kept);
        close(to);
        close(fd);
        assert_int_equal(got, 5);
        expect_text(path, "taken");
        unlink(path);
    }
}

static int set_up(void **state)
{
    (void)state;
    if (mkdtemp(dir) == NULL) return -1;
    snprintf(path, sizeof path, "%s/a", dir);
    snprintf(part, sizeof part, "%s/a.part", dir);
    snprintf(other, sizeof other, "%s/other", dir);
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
        cmocka_unit_test(a_part_that_was_left),
        cmocka_unit_test(a_file_that_is_whole),
        cmocka_unit_test(a_name_that_is_taken),
        cmocka_unit_test(a_name_is_kept_on_any_file_system),
        cmocka_unit_test(a_file_that_cannot_have_its_name),
        cmocka_unit_test(a_file_that_was_replaced),
        cmocka_unit_test(paths_that_cannot_be_made),
        cmocka_unit_test(names_of_descriptors),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
