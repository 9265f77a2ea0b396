/* SPDX-License-Identifier: MIT */
/* The end of an E57 file: the disk has all that its header describes before it gets the header. A disk that fails there
 * is an error, and the points stay for a repair. */
#include <errno.h>
#include <fcntl.h>
#include <sys/syscall.h>

#include "drivers/record/e57_pages.h"
#include "tests/unit/e57_rig.h"

/* ---- replacements of libc's: the first call of one kind fails, and the file at its first synchronisation is kept */

enum { NOTHING, CUT, SYNC };
static int failing;
static int n_syncs;
static uint8_t synced[1 << 16];
static ssize_t synced_len;

int ftruncate(int fd, off_t len)
{
    if (failing != CUT || len == 0) return (int)syscall(SYS_ftruncate, fd, len); /* 0: it begins */
    failing = NOTHING;
    errno = EIO;
    return -1;
}

int fdatasync(int fd)
{
    if (n_syncs++ == 0) synced_len = pread(fd, synced, sizeof synced, 0);
    if (failing != SYNC) return (int)syscall(SYS_fdatasync, fd);
    failing = NOTHING;
    errno = EIO;
    return -1;
}

static int record(const char *path, struct sh_err *err)
{
    const struct rig_point points[] = {{3000, -4000, 12000, 0, 7, 1, 1}, {3, -4, 12, 0, 7, 1, 1}};
    const struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, points, 2);
    n_syncs = 0;
    return rig_record(path, (struct recorder_options){0}, RIG_KEEP_ALWAYS, err);
}

static void test_header_comes_last(void **state)
{
    (void)state;
    static const uint8_t none[48];
    const char *path = rig_path("a.e57");
    struct sh_err err = {0};
    size_t len;
    if (record(path, &err) != SH_OK) fail_msg("%s", err.text);
    uint8_t *file = rig_read(path, &len);
    assert_true(n_syncs >= 1);
    assert_int_equal(synced_len, len);
    assert_memory_equal(file, "ASTM-E57", 8);
    assert_memory_equal(synced, none, sizeof none);              /* the header has 48 bytes */
    assert_memory_equal(synced + 1024, file + 1024, len - 1024); /* it changes the first page alone */
    free(file);
    e57rig_read(path);
    assert_int_equal(unlink(path), 0);
}

static void test_failing_disk(void **state)
{
    (void)state;
    const char *path = rig_path("a.e57");
    for (int kind = CUT; kind <= SYNC; kind++) {
        struct sh_err err = {0};
        char want[200];
        failing = kind;
        assert_int_equal(record(path, &err), SH_EIO);
        snprintf(want, sizeof want, "%s.part: cannot write: Input/output error", path);
        assert_string_equal(err.text, want);
        assert_int_equal(failing, NOTHING);
        rig_check_left(path);
    }
}

/* A page with one byte of content is a page. */
static void test_last_byte(void **state)
{
    (void)state;
    const char *path = rig_path("pages");
    static struct outfile file;
    struct e57_pages pages = {.file = &file};
    uint8_t content[E57_PAGE_CONTENT + 1];
    struct sh_err err;
    size_t len;
    memset(content, 0x55, sizeof content);
    assert_int_equal(outfile_open(&file, path, &err), SH_OK);
    assert_int_equal(e57_put(&pages, content, sizeof content, &err), SH_OK);
    assert_int_equal(e57_finish(&pages, &err), SH_OK);
    assert_int_equal(outfile_close(&file, OUTFILE_KEEP, &err), SH_OK);
    uint8_t *bytes = rig_read(path, &len);
    assert_int_equal(len, 2 * E57_PAGE);
    assert_true(e57_page_is_right(bytes) && e57_page_is_right(bytes + E57_PAGE));
    assert_true(bytes[E57_PAGE] == 0x55 && bytes[E57_PAGE + 1] == 0);
    free(bytes);
    assert_int_equal(unlink(path), 0);
}

static int tear_down(void **state)
{
    e57rig_free();
    return rig_tear_down(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_header_comes_last), cmocka_unit_test(test_failing_disk),
                                       cmocka_unit_test(test_last_byte)};
    return cmocka_run_group_tests(tests, rig_set_up, tear_down);
}
