/* SPDX-License-Identifier: MIT */
/* drivers/record/outfile.h: beyond DIRECT_FROM a file is written past the system's cache, in whole blocks. The file's
 * bytes are the given ones, in any pieces, and on any file system. Files begin with a hole up to DIRECT_FROM, so that
 * the tests cost little. */
#include <errno.h>
#include <fcntl.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/record/outfile.h"

enum { DATA_LEN = 5 << 20 };

static char dir[] = "/tmp/test_outfile_XXXXXX", path[64];
static uint8_t data[DATA_LEN], back[DATA_LEN];
static struct sh_err err;

/* ---- replacements of libc's: direct writes are whole blocks, of aligned memory */

static enum { AS_IT_IS, NOT_DIRECT, HALF_OF_IT, FULL } disk;
static int n_direct;

ssize_t pwrite(int fd, const void *from, size_t len, off_t at)
{
    if (fcntl(fd, F_GETFL) & O_DIRECT) {
        n_direct++;
        if (disk == NOT_DIRECT || len % DIRECT_BLOCK != 0 || at % DIRECT_BLOCK != 0 ||
            (uintptr_t)from % DIRECT_BLOCK != 0) {
            assert_true(disk == NOT_DIRECT || disk == HALF_OF_IT);
            errno = EINVAL;
            return -1;
        }
    }
    if (disk == FULL) {
        errno = ENOSPC;
        return -1;
    }
    if (disk == HALF_OF_IT && len > 1000) len = len / 2 - 100; /* not a whole block any more */
    return syscall(SYS_pwrite64, fd, from, len, at);
}

/* ---- helpers */

static void begin(struct outfile *file, uint64_t at)
{
    n_direct = 0;
    assert_int_equal(outfile_open(file, path, &err), 0);
    file->may_be_direct = 1;
    file->written = at;
}

static void expect_data(uint64_t at, size_t len)
{
    struct stat st;
    int fd = open(path, O_RDONLY);
    assert_true(fd >= 0);
    assert_int_equal(fstat(fd, &st), 0);
    assert_int_equal(st.st_size, at + len);
    assert_int_equal(pread(fd, back, len, (off_t)at), len);
    assert_memory_equal(back, data, len);
    close(fd);
}

/* Writes pieces of all kinds of lengths, from byte `from` of data on. */
static size_t write_pieces(struct outfile *file, size_t from)
{
    static const size_t piece[] = {1, 4096, 70001, 123, OUTFILE_BUFFER - 1, 512, 8191, OUTFILE_BUFFER + 1, 65536, 3};
    for (size_t i = 0;; i++) {
        const size_t n = piece[i % (sizeof piece / sizeof piece[0])];
        if (from + n > DATA_LEN) return from;
        assert_int_equal(outfile_write(file, data + from, n, &err), 0);
        from += n;
    }
}

/* ---- tests */

/* Files begin on the border, one byte before it, and one after it. */
static void test_pieces(void **state)
{
    (void)state;
    for (int mode = AS_IT_IS; mode < FULL; mode++)
        for (int shift = -1; shift <= 1; shift++) {
            struct outfile file;
            const uint64_t at = (uint64_t)(DIRECT_FROM + shift);
            disk = mode;
            begin(&file, at);
            const size_t n = write_pieces(&file, 0);
            assert_int_equal(outfile_flush(&file, &err), 0);
            assert_int_equal(outfile_patch(&file, at + 7, data + 7, 5000, &err), 0);
            assert_int_equal(outfile_close(&file, 1, &err), 0);
            expect_data(at, n);
        }
    disk = AS_IT_IS;
}

/* A whole buffer may be asked for, although the buffer holds bytes that do not fill a block. */
static void test_whole_buffer(void **state)
{
    struct outfile file;
    (void)state;
    begin(&file, DIRECT_FROM + 5);
    assert_int_equal(outfile_write(&file, data, 10, &err), 0);
    uint8_t *to = outfile_room(&file, OUTFILE_BUFFER, &err);
    assert_non_null(to);
    memcpy(to, data + 10, OUTFILE_BUFFER);
    outfile_used(&file, OUTFILE_BUFFER);
    assert_int_equal(outfile_close(&file, 1, &err), 0);
    expect_data(DIRECT_FROM + 5, 10 + OUTFILE_BUFFER);
}

/* A file that ends where direct writing begins uses none of it. */
static void test_border(void **state)
{
    struct outfile file;
    (void)state;
    begin(&file, DIRECT_FROM - OUTFILE_BUFFER);
    assert_int_equal(outfile_write(&file, data, OUTFILE_BUFFER, &err), 0);
    assert_int_equal(outfile_close(&file, 1, &err), 0);
    assert_int_equal(n_direct, 0);
    expect_data(DIRECT_FROM - OUTFILE_BUFFER, OUTFILE_BUFFER);
}

static void test_full(void **state)
{
    struct outfile file;
    (void)state;
    begin(&file, DIRECT_FROM);
    assert_int_equal(outfile_write(&file, data, OUTFILE_BUFFER, &err), 0);
    disk = FULL;
    assert_int_equal(outfile_write(&file, data, OUTFILE_BUFFER, &err), SH_EIO);
    assert_non_null(strstr(err.text, "No space left on device"));
    assert_int_equal(outfile_close(&file, 1, &err), SH_EIO);
    disk = AS_IT_IS;
    unlink(path);
    assert_int_equal(rmdir(dir), 0); /* no part is left */
    assert_int_equal(mkdir(dir, 0700), 0);
}

/* ---- room for the file's end */

static int n_reserved; /* reservations that were asked for */
static off_t reserved_at, reserved_len;
static int reserve_error; /* 0: the file system keeps room */

int fallocate(int fd, int mode, off_t at, off_t len)
{
    assert_true(fd >= 0);
    if (!(mode & FALLOC_FL_PUNCH_HOLE)) n_reserved++;
    assert_int_equal(mode & ~FALLOC_FL_PUNCH_HOLE, FALLOC_FL_KEEP_SIZE);
    reserved_at = at;
    reserved_len = mode & FALLOC_FL_PUNCH_HOLE ? -len : len;
    if (reserve_error == 0) return 0;
    errno = reserve_error;
    return -1;
}

/* Sets the process' limit on files, and returns the one before. */
static struct rlimit set_limit(rlim_t most)
{
    struct rlimit before;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    if (most > before.rlim_max) skip();
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &(struct rlimit){most, before.rlim_max}), 0);
    return before;
}

/* Without a limit on files, room is reserved beyond any recording, and freed as a whole. With a limit there is none, as
 * it would lie beyond the limit. */
static void test_room_and_limits(void **state)
{
    enum { ROOM = 1 << 20 };
    struct outfile file;
    (void)state;
    const struct rlimit before = set_limit(RLIM_INFINITY);
    begin(&file, 0);
    n_reserved = 0;
    assert_int_equal(outfile_reserve(&file, ROOM, &err), SH_OK);
    assert_true(n_reserved == 1 && reserved_at > (off_t)1 << 39 && reserved_len == ROOM);
    const off_t at = reserved_at;
    outfile_release(&file);
    assert_true(n_reserved == 1 && reserved_at == at && reserved_len <= -ROOM);
    set_limit(1 << 26);
    assert_int_equal(outfile_reserve(&file, ROOM, &err), SH_OK);
    set_limit(before.rlim_cur);
    assert_int_equal(n_reserved, 1);
    assert_int_equal(outfile_close(&file, OUTFILE_DROP, &err), 0);
}

/* A file system that keeps no room is no reason to fail: only a full one is. */
static void test_no_reserve(void **state)
{
    struct outfile file;
    char want[200];
    (void)state;
    const struct rlimit before = set_limit(RLIM_INFINITY);
    begin(&file, 0);
    reserve_error = EOPNOTSUPP;
    assert_int_equal(outfile_reserve(&file, 1, &err), SH_OK);
    reserve_error = ENOSPC;
    assert_int_equal(outfile_reserve(&file, 1, &err), SH_EIO);
    snprintf(want, sizeof want, "%s.part: cannot write: No space left on device", path);
    assert_string_equal(err.text, want);
    reserve_error = 0;
    set_limit(before.rlim_cur);
    assert_int_equal(outfile_close(&file, OUTFILE_DROP, &err), 0);
}

static int setup(void **state)
{
    uint32_t v = 1;
    (void)state;
    for (size_t i = 0; i < DATA_LEN; i++)
        data[i] = (uint8_t)((v = v * 1664525u + 1013904223u) >> 24);
    if (mkdtemp(dir) == NULL) return -1;
    snprintf(path, sizeof path, "%s/file", dir);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    unlink(path);
    return rmdir(dir);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pieces), cmocka_unit_test(test_whole_buffer), cmocka_unit_test(test_border),
        cmocka_unit_test(test_full),   cmocka_unit_test(test_no_reserve),   cmocka_unit_test(test_room_and_limits),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
