/* SPDX-License-Identifier: MIT */
/* Files that the program makes. Links are not followed, only files are replaced, and two writers never end in one
 * file. */
#include <errno.h>
#include <fcntl.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/sysmacros.h>
#include <sys/un.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/newfile.h"
#include "drivers/record/outfile.h"

static char dir[] = "/tmp/test_newfile_XXXXXX", path[64], part[64], other[64];
static struct sh_err err;

/* ---- two steps of a writer, before which another one acts */

static void (*before_lock)(void), (*before_rename)(void);

static void act(void (**fn)(void))
{
    void (*now)(void) = *fn;
    *fn = NULL;
    if (now != NULL) now();
}

/* This flock takes the place of libc's. */
int flock(int fd, int operation)
{
    act(&before_lock);
    return (int)syscall(SYS_flock, fd, operation);
}

int rename(const char *from, const char *to)
{
    act(&before_rename);
    return (int)syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0);
}

/* ---- helpers */

static void write_text(const char *name, const char *text)
{
    FILE *out = fopen(name, "w");
    assert_non_null(out);
    fputs(text, out);
    fclose(out);
}

static void expect_text(const char *name, const char *want)
{
    char text[64] = "";
    FILE *in = fopen(name, "r");
    assert_non_null(in);
    size_t n = fread(text, 1, sizeof text - 1, in);
    fclose(in);
    text[n] = '\0';
    assert_string_equal(text, want);
}

static void expect_error(int rc, int code, const char *name, const char *says)
{
    if (rc != code || strstr(err.text, name) == NULL || strstr(err.text, says) == NULL)
        fail_msg("%d, no '%s' in: %s", rc, says, err.text);
    err.text[0] = '\0';
}

static void expect_missing(const char *name)
{
    struct stat st;
    assert_int_equal(lstat(name, &st), -1);
}

static mode_t kind_of(const char *name)
{
    struct stat st;
    assert_int_equal(lstat(name, &st), 0);
    return st.st_mode & S_IFMT;
}

/* ---- links */

static void test_links(void **state)
{
    (void)state;
    struct outfile file;
    int fd;
    write_text(other, "precious");
    assert_int_equal(symlink(other, path), 0);
    expect_error(newfile_open(path, &fd, &err), SH_EINPUT, path, "symbolic link to");
    expect_error(outfile_open(&file, path, &err), SH_EINPUT, path, "symbolic link to");
    unlink(path);
    assert_int_equal(symlink(other, part), 0);
    expect_error(outfile_open(&file, path, &err), SH_EINPUT, part, "symbolic link to");
    unlink(part);
    assert_int_equal(link(other, path), 0);
    expect_error(newfile_open(path, &fd, &err), SH_EINPUT, path, "2 hard links");
    unlink(path);
    assert_int_equal(link(other, part), 0);
    expect_error(outfile_open(&file, path, &err), SH_EINPUT, part, "2 hard links");
    unlink(part);
    /* A link that leads nowhere makes no file there. */
    assert_int_equal(symlink("nowhere", path), 0);
    expect_error(newfile_open(path, &fd, &err), SH_EINPUT, path, "symbolic link to nowhere");
    unlink(path);
    expect_text(other, "precious");
    unlink(other);
}

/* A link that comes while the file is written is not followed, and stays. */
static void test_late_link(void **state)
{
    (void)state;
    struct outfile file;
    write_text(other, "precious");
    assert_int_equal(outfile_open(&file, path, &err), 0);
    assert_int_equal(outfile_write(&file, "new", 3, &err), 0);
    assert_int_equal(symlink(other, path), 0);
    expect_error(outfile_close(&file, 1, &err), SH_EINPUT, path, "symbolic link to");
    expect_missing(part);
    expect_text(other, "precious");
    unlink(path);
    unlink(other);
}

/* /dev/fd/N and the like lead to our own open files. */
static void test_own_descriptors(void **state)
{
    (void)state;
    char name[32], text[8] = "";
    int pipe_fd[2], fd;
    assert_int_equal(pipe(pipe_fd), 0);
    snprintf(name, sizeof name, "/dev/fd/%d", pipe_fd[1]);
    assert_int_equal(newfile_open(name, &fd, &err), 0);
    assert_int_equal(write(fd, "hello", 5), 5);
    assert_int_equal(read(pipe_fd[0], text, 5), 5);
    assert_string_equal(text, "hello");
    close(fd);
    close(pipe_fd[0]);
    close(pipe_fd[1]);
}

/* ---- paths that are no files */

static void test_kinds(void **state)
{
    (void)state;
    struct outfile file;
    int fd;
    assert_int_equal(mkfifo(path, 0600), 0);
    expect_error(outfile_open(&file, path, &err), SH_EINPUT, path, "is a FIFO");
    expect_error(newfile_open(path, &fd, &err), SH_EINPUT, path,
                 "FIFO without a reader"); /* and did not wait for a reader */
    assert_int_equal(kind_of(path), S_IFIFO);
    unlink(path);
    assert_int_equal(mkfifo(part, 0600), 0);
    expect_error(outfile_open(&file, path, &err), SH_EINPUT, part, "is a FIFO");
    unlink(part);
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    int s = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    snprintf(at.sun_path, sizeof at.sun_path, "%s", path);
    assert_int_equal(bind(s, (struct sockaddr *)&at, sizeof at), 0);
    close(s);
    expect_error(outfile_open(&file, path, &err), SH_EINPUT, path, "is a socket");
    assert_int_equal(kind_of(path), S_IFSOCK);
    unlink(path);
    assert_int_equal(mkdir(path, 0700), 0);
    expect_error(outfile_open(&file, path, &err), SH_EINPUT, path, "is a directory");
    rmdir(path);
}

/* A node like /dev/full is made here, before the recording and while it is written. */
static void test_device(void **state)
{
    (void)state;
    struct outfile file;
    if (mknod(path, S_IFCHR | 0600, makedev(1, 7)) != 0) {
        print_message("skipped: %s: mknod: %s\n", path, strerror(errno));
        skip();
    }
    expect_error(outfile_open(&file, path, &err), SH_EINPUT, path, "is a character device");
    unlink(path);
    assert_int_equal(outfile_open(&file, path, &err), 0);
    assert_int_equal(mknod(path, S_IFCHR | 0600, makedev(1, 7)), 0);
    expect_error(outfile_close(&file, 1, &err), SH_EINPUT, path, "is a character device");
    assert_int_equal(kind_of(path), S_IFCHR);
    unlink(path);
}

/* ---- part files that are there already */

static void test_left_part(void **state)
{
    (void)state;
    struct outfile file;
    write_text(part, "left by one that was killed");
    assert_int_equal(outfile_open(&file, path, &err), 0);
    assert_int_equal(outfile_write(&file, "new", 3, &err), 0);
    assert_int_equal(outfile_close(&file, 1, &err), 0);
    expect_text(path, "new");
    expect_missing(part);
    unlink(path);
    if (geteuid() != 0) return; /* only root can give files away */
    write_text(part, "of another user");
    assert_int_equal(chown(part, 65534, 65534), 0);
    expect_error(outfile_open(&file, path, &err), SH_EINPUT, part, "of another user");
    expect_text(part, "of another user");
    unlink(part);
}

/* ---- two writers */

static struct outfile first, second;

static void end_first(void)
{
    assert_int_equal(outfile_close(&first, 1, &err), 0);
}

static void begin_second(void)
{
    expect_error(outfile_open(&second, path, &err), SH_EINPUT, part, "is being written by process");
}

/* The first writer ends between the second one's open and its lock. The second one has then opened the finished file,
 * and must not empty it. */
static void test_end_between_open_and_lock(void **state)
{
    (void)state;
    assert_int_equal(outfile_open(&first, path, &err), 0);
    assert_int_equal(outfile_write(&first, "first", 5, &err), 0);
    before_lock = end_first;
    assert_int_equal(outfile_open(&second, path, &err), 0);
    expect_text(path, "first");
    assert_int_equal(outfile_close(&second, 0, &err), 0);
    expect_text(path, "first");
    expect_missing(part);
    unlink(path);
}

/* The second writer begins just before the first one's file gets its name, and is refused: that file is still being
 * written. */
static void test_begin_before_rename(void **state)
{
    (void)state;
    assert_int_equal(outfile_open(&first, path, &err), 0);
    assert_int_equal(outfile_write(&first, "first", 5, &err), 0);
    before_rename = begin_second;
    assert_int_equal(outfile_close(&first, 1, &err), 0);
    assert_null(before_rename);
    expect_text(path, "first");
    expect_missing(part);
    unlink(path);
}

/* A file that is written in place has one writer, and the first one's bytes stay. */
static void test_one_writer_in_place(void **state)
{
    (void)state;
    char pid[96], name[16]; /* of this program, or of the emulator that runs it */
    int fd, again;
    prctl(PR_GET_NAME, name);
    snprintf(pid, sizeof pid, "process %ld (%s)", (long)getpid(), name);
    assert_int_equal(newfile_open(path, &fd, &err), 0);
    assert_int_equal(write(fd, "one", 3), 3);
    expect_error(newfile_open(path, &again, &err), SH_EINPUT, path, pid);
    expect_error(newfile_append(path, &again, &err), SH_ESTATE, path, pid);
    expect_error(newfile_check(path, &err), SH_EINPUT, path, pid); /* once replaced, the writer's file has no name */
    expect_missing(part);
    expect_text(path, "one");
    close(fd);
    assert_int_equal(newfile_open(path, &fd, &err), 0); /* free again, and empty */
    close(fd);
    expect_text(path, "");
    unlink(path);
}

/* A file is begun in place while a part file is to get that name. The file stays, and so does the part file. */
static void test_begun_in_place_meanwhile(void **state)
{
    (void)state;
    int whole, fd;
    assert_int_equal(newfile_part(path, part, &whole, &err), 0);
    assert_int_equal(write(whole, "whole", 5), 5);
    assert_int_equal(newfile_open(path, &fd, &err), 0);
    assert_int_equal(write(fd, "one", 3), 3);
    expect_error(newfile_settle(path, part, whole, &err), SH_EINPUT, path, "is being written by");
    expect_text(path, "one");
    expect_text(part, "whole");
    close(fd);
    assert_int_equal(newfile_settle(path, part, whole, &err), 0);
    expect_text(path, "whole");
    unlink(path);
}

/* ---- a file that grows */

static void test_append(void **state)
{
    (void)state;
    int fd, again;
    char c;
    assert_int_equal(newfile_append(path, &fd, &err), 0);
    assert_int_equal(write(fd, "one", 3), 3);
    expect_error(newfile_append(path, &again, &err), SH_ESTATE, path, "is being written by process");
    close(fd);
    assert_int_equal(newfile_append(path, &fd, &err), 0); /* it is unchanged, and free again */
    assert_int_equal(pread(fd, &c, 1, 0), 1);
    assert_int_equal(c, 'o');
    assert_int_equal(write(fd, "two", 3), 3); /* at the end, though nothing was sought */
    close(fd);
    expect_text(path, "onetwo");
    assert_int_equal(link(path, other), 0);
    expect_error(newfile_append(path, &fd, &err), SH_EINPUT, path, "2 hard links");
    unlink(path);
    assert_int_equal(symlink(other, path), 0);
    expect_error(newfile_append(path, &fd, &err), SH_EINPUT, path, "symbolic link to");
    unlink(path);
    assert_int_equal(mkdir(path, 0700), 0);
    expect_error(newfile_append(path, &fd, &err), SH_EINPUT, path, "is a directory");
    rmdir(path);
    expect_text(other, "onetwo");
    unlink(other);
}

/* The user's umask holds, and no made file is executable. */
static void test_rights(void **state)
{
    (void)state;
    static const struct {
        mode_t mask, want;
    } rows[] = {{022, 0644}, {077, 0600}, {0, 0666}};
    struct stat st;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const mode_t before = umask(rows[i].mask);
        int fd;
        assert_int_equal(newfile_part(path, part, &fd, &err), SH_OK);
        assert_int_equal(fstat(fd, &st), 0);
        assert_int_equal(st.st_mode & 07777, rows[i].want);
        newfile_drop(part, fd);
        assert_int_equal(newfile_open(path, &fd, &err), SH_OK);
        umask(before);
        assert_int_equal(fstat(fd, &st), 0);
        assert_int_equal(st.st_mode & 07777, rows[i].want);
        close(fd);
        unlink(path);
    }
}

static int set_up(void **state)
{
    (void)state;
    if (mkdtemp(dir) == NULL) return -1;
    snprintf(path, sizeof path, "%s/a.shs", dir);
    snprintf(part, sizeof part, "%s/a.shs.part", dir);
    snprintf(other, sizeof other, "%s/other", dir);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    return rmdir(dir);
}

static int put_two(const void *source, FILE *file, struct sh_err *why)
{
    (void)source;
    (void)why;
    fputs("two", file);
    return SH_OK;
}

static int put_fails(const void *source, FILE *file, struct sh_err *why)
{
    (void)source;
    fputs("th", file);
    return sh_fail(why, SH_EIO, "no more");
}

static int first_fd;

static void begin_append(void)
{
    int fd;
    expect_error(newfile_append(path, &fd, &err), SH_ESTATE, path, "is being written by process");
}

static void replace_first(void)
{
    assert_int_equal(newfile_replace(path, &first_fd, put_two, NULL, &err), 0);
}

/* A locked file is written anew, and has no moment without its lock: neither for a second writer that begins just
 * before the rename, nor for one that has opened the old file by then. */
static void test_replace_keeps_the_lock(void **state)
{
    (void)state;
    int fd;
    assert_int_equal(newfile_append(path, &first_fd, &err), 0);
    before_rename = begin_append;
    assert_int_equal(newfile_replace(path, &first_fd, put_two, NULL, &err), 0);
    assert_null(before_rename);
    expect_text(path, "two");
    expect_missing(part);
    expect_error(newfile_append(path, &fd, &err), SH_ESTATE, path, "is being written by process");
    before_lock = replace_first;
    expect_error(newfile_append(path, &fd, &err), SH_ESTATE, path, "has just written it anew");
    assert_int_equal(newfile_replace(path, &first_fd, put_fails, NULL, &err), SH_EIO);
    assert_non_null(strstr(err.text, "cannot be written: no more"));
    expect_text(path, "two");
    expect_missing(part);
    close(first_fd);
    assert_int_equal(newfile_append(path, &fd, &err), 0);
    close(fd);
    unlink(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_links),
        cmocka_unit_test(test_late_link),
        cmocka_unit_test(test_own_descriptors),
        cmocka_unit_test(test_kinds),
        cmocka_unit_test(test_device),
        cmocka_unit_test(test_left_part),
        cmocka_unit_test(test_end_between_open_and_lock),
        cmocka_unit_test(test_begin_before_rename),
        cmocka_unit_test(test_one_writer_in_place),
        cmocka_unit_test(test_begun_in_place_meanwhile),
        cmocka_unit_test(test_append),
        cmocka_unit_test(test_replace_keeps_the_lock),
        cmocka_unit_test(test_rights),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
