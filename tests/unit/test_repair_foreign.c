/* SPDX-License-Identifier: MIT */
/* Repair and the files of other programs. Such files may end or go on in ways that no recorder writes, so they are
 * checked, and never changed. */
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/bytes.h"
#include "core/newfile.h"
#include "drivers/protocol/pcapng.h"
#include "drivers/record/repair.h"
#include "tests/unit/repair_rig.h"

#define PLY_HEAD(n)                                                                    \
    "ply\nformat ascii 1.0\ncomment made elsewhere, with    blanks\nelement vertex " n \
    "\nproperty float x\nproperty float y\nend_header\n"
#define PTX_HEAD(rows) "1\n" rows "\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"

#define PCAPNG_SECTION   "\x0a\x0d\x0d\x0a\x1c\0\0\0\x4d\x3c\x2b\x1a\x01\0\0\0\xff\xff\xff\xff\xff\xff\xff\xff\x1c\0\0\0"
#define PCAPNG_INTERFACE "\x01\0\0\0\x14\0\0\0\x01\0\0\0\0\0\0\0\x14\0\0\0"

/* Returns SH_OK, or the repair's error. The bytes stay the same in any case. */
static int repair_untouched(const char *name, const void *data, size_t len)
{
    struct repaired file = {0};
    repair_name(name);
    repair_write_file(repair_path, data, len);
    const int rc = repair_file(repair_path, NULL, &file, &repair_err);
    struct bytes got = repair_slurp(repair_path);
    if (got.len != len || memcmp(got.data, data, len) != 0) fail_msg("%s of %zu bytes was changed", name, len);
    if (rc == SH_OK) assert_int_equal(file.was_whole, 1);
    repair_free(&file);
    free(got.data);
    unlink(repair_path);
    return rc;
}

/* The files are whole for their programs: without a last newline, with tabs, an empty line, or unknown kinds of
 * lines. */
static void test_whole_elsewhere(void **state)
{
    (void)state;
    static const struct {
        const char *name, *text;
        int rc;
    } rows[] = {
        {"f.ply", PLY_HEAD("2") "1 2\n3 4\n", SH_OK},
        {"f.ply", PLY_HEAD("2") "1 2\n3 4", SH_EFORMAT},
        {"f.ply", PLY_HEAD("2") "1 2\n3 4\n\n", SH_EFORMAT},
        {"f.ply", PLY_HEAD("2") "1\t2\n3\t4\n", SH_EFORMAT},
        {"f.ply", PLY_HEAD("9") "1 2\n3 4\n", SH_EFORMAT},
        {"f.obj", "v 1 2 3\nv 1 2 3\nv 1 2 4\nf 1 2 3\n", SH_OK},
        {"f.obj", "v 1 2 3\nv 1 2 3\nv 1 2 4\nf 1 2 3", SH_EFORMAT},
        {"f.obj", "v 1 2 3\nv 1 2 3\nv 1 2 4\nf -1 -2 -3\n", SH_EFORMAT},
        {"f.obj", "v 1 2 3\nv 1 2 3\nv 1 2 4\nf 1 2 3\ng x\n", SH_EFORMAT},
        {"f.ptx", PTX_HEAD("2") "1 2 3 0.5\n1 2 3 0.5\n", SH_OK},
        {"f.ptx", PTX_HEAD("2") "1 2 3 0.5\n1 2 3 0.5", SH_EFORMAT},
        {"f.ptx", PTX_HEAD("2") "1 2 3 0.5\n1 2 3 0.5\n\n", SH_EFORMAT},
        {"f.ptx", PTX_HEAD("4294967295") "1 2 3 0.5\n", SH_EFORMAT},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const int rc = repair_untouched(rows[i].name, rows[i].text, strlen(rows[i].text));
        if (rc != rows[i].rc) fail_msg("row %zu: %d: %s", i, rc, repair_err.text);
    }
    static const char capture[] = PCAPNG_SECTION PCAPNG_INTERFACE,
                      more[] = PCAPNG_SECTION PCAPNG_INTERFACE "\x06\0\0\0";
    assert_int_equal(repair_untouched("f.pcapng", capture, sizeof capture - 1), SH_OK);
    assert_int_equal(repair_untouched("f.pcapng", more, sizeof more - 1), SH_EFORMAT);
    assert_non_null(strstr(repair_err.text, "was written by another program"));
    uint8_t other[128]; /* its name is as long as ours */
    size_t len = pcapng_put_section(other, "Scanhead");
    memcpy(other + len, PCAPNG_INTERFACE "\x06\0\0\0", 24);
    assert_int_equal(repair_untouched("f.pcapng", other, len + 24), SH_EFORMAT);
}

/* A grid of absurd size is not filled up. */
static void test_absurd_grid(void **state)
{
    (void)state;
    static const char *const text[] = {PTX_HEAD("4294967295") "1 2 3 0.5\n", PTX_HEAD("4194305") "1 2 3 0.5\n"};
    for (size_t i = 0; i < 2; i++) {
        struct repaired file;
        repair_name("f.ptx");
        repair_write_file(repair_part, text[i], strlen(text[i]));
        assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), SH_EFORMAT);
        struct bytes got = repair_slurp(repair_part);
        assert_int_equal(got.len, strlen(text[i]));
        free(got.data);
        unlink(repair_part);
    }
}

static void expect_damaged_at(const char *name, size_t at)
{
    char want[300];
    snprintf(
        want, sizeof want,
        "%s: is damaged at byte %zu, with good data after it; an interrupted recording does not do that; the file is "
        "unchanged",
        rig_path(name), at);
    assert_string_equal(repair_err.text, want);
}

/* The capture of a short recording is no longer than the part that a full disk may have cut off. The bytes after it
 * tell damage from a cut. */
static void test_damaged_capture(void **state)
{
    (void)state;
    int i = 0;
    while (strstr(repair_formats[i].name, ".pcapng") == NULL)
        assert_true(++i < REPAIR_FORMATS);
    struct bytes *of = &repair_whole[i];
    size_t at = 0;
    for (int block = 0; block < 3; block++)
        at += le_get32(of->data + at + 4);
    assert_true(at < of->len);
    static const uint8_t length[] = {0xff, 3, 0};
    for (size_t k = 0; k < sizeof length; k++) {
        uint8_t *byte = of->data + at + (k == 2 ? 4 : 6), was = *byte;
        *byte = length[k];
        assert_int_equal(repair_untouched("f.pcapng", of->data, of->len), was == length[k] ? SH_OK : SH_EFORMAT);
        if (was != length[k]) expect_damaged_at("f.pcapng", at);
        *byte = was;
    }
}

/* A capture whose last block is whole was not cut: what lies before it is damage. The least block has 12 bytes. */
static void test_block_at_the_end(void **state)
{
    (void)state;
    static const uint8_t cut[16] = {6, 0, 0, 0, 0, 2, 0, 0}, last[2][16] = {{9, 0, 0, 0, 12, 0, 0, 0, 12, 0, 0, 0},
                                                                            {9, 0, 0, 0, 16, 0, 0, 0, 1, 1, 1, 1, 16}};
    for (int i = 0; i < 3; i++) {
        const size_t n = i == 2 ? 0 : i == 0 ? 12 : 16;
        struct repaired file = {0};
        uint8_t *all = malloc(repair_whole[1].len + sizeof cut + n);
        memcpy(all, repair_whole[1].data, repair_whole[1].len);
        memcpy(all + repair_whole[1].len, cut, sizeof cut);
        memcpy(all + repair_whole[1].len + sizeof cut, last[i % 2], n);
        repair_name("a.pcapng");
        repair_write_file(repair_part, all, repair_whole[1].len + sizeof cut + n);
        assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), i == 2 ? SH_OK : SH_EFORMAT);
        if (i < 2) expect_damaged_at("a.pcapng.part", repair_whole[1].len);
        if (i == 2) assert_int_equal(file.cut_bytes, sizeof cut);
        repair_free(&file);
        free(all);
        unlink(i == 2 ? repair_path : repair_part);
    }
}

/* The longest block that may be is read whole. Its bytes are a hole in the file, so the disk keeps none of them. */
static void test_longest_block(void **state)
{
    (void)state;
    static const char front[] = PCAPNG_SECTION PCAPNG_INTERFACE, after[] = PCAPNG_INTERFACE;
    enum { FRONT = sizeof front - 1, AFTER = sizeof after - 1, END = FRONT + PCAPNG_MAX_BLOCK };
    struct repaired file = {0};
    uint8_t head[8] = {9}, len[4];
    le_put32(head + 4, PCAPNG_MAX_BLOCK);
    le_put32(len, PCAPNG_MAX_BLOCK);
    repair_name("f.pcapng");
    const int fd = open(repair_path, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    assert_int_equal(pwrite(fd, front, FRONT, 0), FRONT);
    assert_int_equal(pwrite(fd, head, sizeof head, FRONT), sizeof head);
    assert_int_equal(pwrite(fd, len, sizeof len, END - sizeof len), sizeof len);
    assert_int_equal(pwrite(fd, after, AFTER, END), AFTER);
    close(fd);
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), SH_OK);
    assert_int_equal(file.was_whole, 1);
    repair_free(&file);
    unlink(repair_path);
}

/* After bytes that are no block, no more is kept in memory, however long the file is. */
static void test_long_rest(void **state)
{
    (void)state;
    static const char front[] = PCAPNG_SECTION PCAPNG_INTERFACE;
    struct repaired file = {0};
    repair_name("f.pcapng");
    const int fd = open(repair_path, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    assert_int_equal(pwrite(fd, front, sizeof front - 1, 0), sizeof front - 1);
    static const uint8_t last[12] = {9, 0, 0, 0, 12, 0, 0, 0, 12};
    assert_int_equal(pwrite(fd, last, sizeof last, 2 * PCAPNG_MAX_BLOCK + (1 << 20)), sizeof last);
    close(fd);
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), SH_EFORMAT);
    expect_damaged_at("f.pcapng", sizeof front - 1);
    repair_free(&file);
    unlink(repair_path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_whole_elsewhere), cmocka_unit_test(test_absurd_grid),
        cmocka_unit_test(test_damaged_capture), cmocka_unit_test(test_block_at_the_end),
        cmocka_unit_test(test_longest_block),   cmocka_unit_test(test_long_rest),
    };
    return cmocka_run_group_tests(tests, repair_set_up, repair_tear_down);
}
