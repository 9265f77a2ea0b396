/* SPDX-License-Identifier: MIT */
/* These tests repair in process. A small file of each format is cut at every byte, damaged at every third, replaced by
 * another format, and given absurd numbers. The result holds the whole units and is whole, or nothing has changed. */
#include "tests/common/free_fd.h"
#include "tests/common/thorough.h"
#include "tests/unit/repair_rig.h"

enum { EACH = SANITIZED ? 101 : 1 }; /* of the bytes */

/* Repairs the file at repair_part. Returns 1 where it is whole now, as *file says, with the bytes in *got; 0 where it
 * was refused, and stays. */
static int repair(const void *data, size_t len, struct repaired *file, struct bytes *got)
{
    repair_write_file(repair_part, data, len);
    const int before = free_fd();
    const int rc = repair_file(repair_path, NULL, file, &repair_err);
    assert_int_equal(free_fd(), before);
    *got = repair_slurp(rc == 0 ? repair_path : repair_part);
    if (rc != 0) {
        assert_int_equal(rc, SH_EFORMAT);
        assert_non_null(strstr(repair_err.text, repair_part));
        assert_int_equal(access(repair_path, F_OK), -1);
        assert_int_equal(got->len, len);
        assert_memory_equal(got->data, data, len);
        unlink(repair_part);
        return 0;
    }
    assert_true(file->was_left && !file->is_part);
    assert_int_equal(access(repair_part, F_OK), -1);
    repair_free(file);
    struct repaired again;
    if (repair_file(repair_path, NULL, &again, &repair_err) != 0) fail_msg("%s", repair_err.text);
    assert_true(again.was_whole && !again.was_left && again.cut_bytes == 0);
    assert_int_equal(again.n_kept, file->n_kept);
    repair_free(&again);
    struct bytes twice = repair_slurp(repair_path);
    assert_int_equal(twice.len, got->len);
    assert_memory_equal(twice.data, got->data, got->len);
    free(twice.data);
    unlink(repair_path);
    return 1;
}

/* Returns where a whole file and a repaired one begin to be the same: after the header, which a repair changes. */
static size_t begin_of(const struct bytes *b)
{
    static const char last[] = "\nend_header\n";
    if (memcmp(b->data, "LASF", 4) == 0) return (size_t)rig_uint(b->data + 96, 4);
    const uint8_t *at = memmem(b->data, b->len, last, sizeof last - 1);
    return memcmp(b->data, "ply\n", 4) == 0 && at != NULL ? (size_t)(at - b->data) + sizeof last - 1 : 0;
}

static size_t end_of(const struct bytes *b)
{
    const uint8_t *mark = memmem(b->data, b->len, "# incomplete", 12);
    const uint8_t *note = memmem(b->data, b->len, "incomplete: the recording", 25); /* of a capture: its block */
    if (mark != NULL) return (size_t)(mark - b->data);
    return note != NULL && rig_uint(b->data, 4) == 0x0a0d0d0a ? (size_t)(note - b->data) - 24 : b->len;
}

/* ---- tests */

/* All points are there. The header is the whole file's, but for the note of the missing end. */
static void expect_header(const struct bytes *got, const struct bytes *all)
{
    const size_t begin = begin_of(all);
    if (memcmp(got->data, "LASF", 4) == 0) {
        assert_memory_equal(got->data, all->data, 58);
        assert_memory_equal(got->data + 90, all->data + 90, begin - 90);
        assert_string_equal((char *)got->data + 58, "scanhead, its end is missing");
    } else if (memcmp(got->data, "ply\n", 4) == 0) {
        assert_non_null(memmem(got->data, begin, "\nelement vertex 12\n", 19));
        assert_non_null(memmem(got->data, begin, "\ncomment incomplete", 19));
    }
}

/* A file cut at a byte has as many units as are whole before it, and these are the first of the whole file. */
static void test_cut(void **state)
{
    (void)state;
    for (int i = 0; i < REPAIR_FORMATS; i++) {
        uint64_t before = 0;
        repair_name(repair_formats[i].name);
        for (size_t n = 1 + (repair_left[i].len - 1) % EACH; n <= repair_left[i].len; n += EACH) {
            struct repaired file;
            struct bytes got;
            const int is_whole = repair(repair_left[i].data, n, &file, &got);
            if (!is_whole && before > 0) fail_msg("%s, %zu bytes: %s", repair_path, n, repair_err.text);
            const size_t begin = begin_of(&repair_whole[i]), end = end_of(&got);
            if (is_whole) {
                assert_true((file.n_kept >= before && file.n_kept <= before + EACH) || before == 0);
                assert_int_equal(end + file.cut_bytes, n);
                assert_true(end >= begin && end <= repair_whole[i].len);
                assert_memory_equal(got.data + begin, repair_whole[i].data + begin, end - begin);
                before = file.n_kept;
                if (n == repair_left[i].len) expect_header(&got, &repair_whole[i]);
                /* Without stations and times nothing shows where a scan begins. */
                const int has_times = repair_formats[i].options.columns != (PLY_XYZ | PLY_FLOAT);
                if (n == repair_left[i].len) assert_int_equal(file.n_scans, has_times ? 2 : 0);
            }
            free(got.data);
        }
        if (strstr(repair_path, ".ply") || strstr(repair_path, ".las")) assert_int_equal(before, REPAIR_POINTS);
        assert_int_equal(before > 1, 1);
    }
}

/* A finished file was cut later, as by a copy. */
static void test_cut_whole(void **state)
{
    (void)state;
    for (int i = 0; i < REPAIR_FORMATS; i++) {
        struct repaired file;
        struct bytes got;
        repair_name(repair_formats[i].name);
        repair_write_file(repair_path, repair_whole[i].data, repair_whole[i].len);
        assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), 0);
        assert_true(file.was_whole && !file.was_left && file.n_kept > 0);
        repair_free(&file);
        got = repair_slurp(repair_path);
        assert_int_equal(got.len, repair_whole[i].len);
        assert_memory_equal(got.data, repair_whole[i].data, got.len);
        free(got.data);
        assert_int_equal(truncate(repair_path, (off_t)repair_whole[i].len - 1), 0);
        assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), 0);
        assert_true(!file.was_whole && file.cut_bytes > 0);
        repair_free(&file);
        assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), 0);
        assert_true(file.was_whole);
        repair_free(&file);
        unlink(repair_path);
    }
}

/* Bytes are changed here and there. Nothing crashes, and an accepted file is whole. If damage can be seen, it is
 * refused. */
static void test_damaged(void **state)
{
    (void)state;
    for (int i = 0; i < REPAIR_FORMATS; i++) {
        repair_name(repair_formats[i].name);
        const size_t begin = begin_of(&repair_left[i]);
        for (size_t n = (size_t)i % 3; n < repair_left[i].len; n += 3 * EACH) {
            struct repaired file;
            struct bytes got;
            repair_left[i].data[n] ^= 0x80;
            const int is_whole = repair(repair_left[i].data, repair_left[i].len, &file, &got);
            repair_left[i].data[n] ^= 0x80;
            if (repair_formats[i].knows_damage && is_whole && n >= begin && file.cut_bytes == 0)
                fail_msg("%s: byte %zu", repair_path, n);
            free(got.data);
        }
    }
}

/* The first n bytes are there, and then zeros. All that is kept are bytes of the whole file. That may be a unit less
 * than without zeros: where a unit ends in zero bytes, nothing says whether they are its own. */
static void check_zeros(int i, size_t n, size_t n_zeros)
{
    struct repaired file, without;
    struct bytes got, longer = {calloc(1, n + n_zeros), n + n_zeros};
    const size_t begin = begin_of(&repair_whole[i]);
    memcpy(longer.data, repair_left[i].data, n);
    if (!repair(longer.data, n, &without, &got)) fail_msg("%s", repair_err.text);
    free(got.data);
    if (!repair(longer.data, longer.len, &file, &got)) fail_msg("%s", repair_err.text);
    const size_t end = end_of(&got);
    assert_true(end >= begin && end <= repair_whole[i].len);
    if (memcmp(got.data + begin, repair_whole[i].data + begin, end - begin) != 0)
        fail_msg("%s, %zu bytes and %zu zeros: a cut unit is kept", repair_path, n, n_zeros);
    assert_int_equal(end + file.cut_bytes, longer.len);
    assert_true(file.n_kept + 1 >= without.n_kept);
    free(got.data);
    free(longer.data);
}

/* Zeros are at the end, as a power cut leaves them. */
static void test_zeros(void **state)
{
    (void)state;
    for (int i = 0; i < REPAIR_FORMATS; i++) {
        const size_t len = repair_left[i].len;
        repair_name(repair_formats[i].name);
        for (size_t missing = 0; missing < 60; missing += SANITIZED ? 7 : 1) /* more than a row */
            check_zeros(i, len - missing, missing % 2 ? 200 : 4096);
        check_zeros(i, len, 300000);
        check_zeros(i, len - 1, 2 << 20); /* more than a block that is read at once */
    }
}

/* Rows of zeros, then some bytes, then zeros again: pages of a file may reach the disk in any order. What is repaired is
 * whole, also for a second repair. */
static void test_zeros_twice(void **state)
{
    (void)state;
    for (int i = 0; i < REPAIR_FORMATS; i++) {
        if (strstr(repair_formats[i].name, ".las") == NULL) continue;
        const size_t len = repair_left[i].len;
        repair_name(repair_formats[i].name);
        for (size_t some = 1; some < 60; some++) {
            struct repaired file, again;
            struct bytes got, second, left = {calloc(1, len + 200), len + 200};
            memcpy(left.data, repair_left[i].data, len);
            memset(left.data + len - 150 - some, 0, 150);
            assert_int_equal(repair(left.data, left.len, &file, &got), 1);
            assert_in_range(file.n_kept, 1, REPAIR_POINTS);
            assert_int_equal(repair(got.data, got.len, &again, &second), 1);
            assert_true(again.was_whole && again.cut_bytes == 0 && again.n_kept == file.n_kept);
            free(got.data);
            free(second.data);
            free(left.data);
        }
    }
}

/* A whole file whose last row ends in a zero byte, and then zeros: the header counts that row. */
static void test_zeros_after_a_whole_file(void **state)
{
    (void)state;
    static const char count[] = "\nelement vertex ";
    for (int i = 0; i < REPAIR_FORMATS; i++) {
        const int is_las = strstr(repair_formats[i].name, ".las") != NULL;
        if (!is_las && (strstr(repair_formats[i].name, ".ply") == NULL || i == REPAIR_ASCII)) continue;
        const size_t n = repair_whole[i].len;
        struct repaired file;
        struct bytes got, longer = {calloc(1, n + 100), n + 100};
        memcpy(longer.data, repair_whole[i].data, n);
        longer.data[n - 1] = 0;
        repair_name(repair_formats[i].name);
        if (!repair(longer.data, longer.len, &file, &got)) fail_msg("%s", repair_err.text);
        assert_int_equal(file.n_kept, REPAIR_POINTS);
        assert_int_equal(got.len, n);
        assert_memory_equal(got.data + begin_of(&got), longer.data + begin_of(&got), n - begin_of(&got));
        free(got.data);
        free(longer.data);
        if (is_las) continue;
        /* A header that is written again as names come counts the points of that moment. */
        uint8_t *digit = memmem(repair_left[i].data, repair_left[i].len, count, sizeof count - 1);
        digit += sizeof count - 1;
        const uint8_t was = *digit;
        *digit = '3';
        assert_int_equal(repair(repair_left[i].data, repair_left[i].len, &file, &got), 1);
        assert_int_equal(file.n_kept, REPAIR_POINTS);
        free(got.data);
        *digit = was;
    }
}

/* A file of another format with that ending is not touched. */
static void test_other_format(void **state)
{
    (void)state;
    for (int i = 0; i < REPAIR_FORMATS; i++)
        for (int k = 0; k < REPAIR_FORMATS; k++) {
            struct repaired file;
            struct bytes got;
            if (strcmp(strchr(repair_formats[i].name, '.'), strchr(repair_formats[k].name, '.')) == 0) continue;
            repair_name(repair_formats[i].name);
            /* A capture holds whole frames, which a stream's reader finds. */
            const int finds =
                strcmp(repair_formats[i].name, "a.shs") == 0 && strcmp(repair_formats[k].name, "a.pcapng") == 0;
            if (!finds && repair(repair_left[k].data, repair_left[k].len, &file, &got))
                fail_msg("%s as %s", repair_formats[k].name, repair_path);
            if (!finds) free(got.data);
        }
}

static void expect_refused(const char *file_name, const void *data, size_t len)
{
    struct repaired file;
    struct bytes got;
    repair_name(file_name);
    if (repair(data, len, &file, &got)) fail_msg("%s of %zu bytes was taken", repair_path, len);
    free(got.data);
}

static void test_huge_numbers(void **state)
{
    (void)state;
    static const char *const ply[] = {
        "ply\nformat binary_little_endian 1.0\ncomment crs x\nelement vertex 18446744073709551615\nproperty double x\nend_header\n12345678",
        "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty list uchar int x\nend_header\n12345678",
        "ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty double x\nend_header\n12345678",
        "ply\nformat binary_little_endian 1.0\nelement vertex 3\nend_header\n12345678",
        "ply\nformat binary_little_endian 1.0\nproperty double x\nelement vertex 3\nend_header\n12345678",
        "ply\nformat binary_little_endian 1.0\nelement vertex3\nproperty double x\nend_header\n12345678",
        "ply\nformat binary_little_endian 1.0\nelement vertex -3\nproperty double x\nend_header\n12345678",
        "ply\nformat binary_little_endian 1.0\nelement vertex 3 y\nproperty double x\nend_header\n12345678",
        "ply\nformat ascii 1.0\nelement edge 3\nproperty double x\nend_header\n1\n"};
    /* The first file has one row of eight bytes, and is repaired. Blanks in its comment make up for the shorter
     * count. */
    for (size_t i = 1; i < sizeof ply / sizeof ply[0]; i++)
        expect_refused("h.ply", ply[i], strlen(ply[i]));
    struct repaired file;
    struct bytes got, las = {malloc(repair_left[REPAIR_LAS].len), repair_left[REPAIR_LAS].len};
    repair_name("h.ply");
    assert_int_equal(repair(ply[0], strlen(ply[0]), &file, &got), 1);
    assert_int_equal(file.n_kept, 1);
    free(got.data);
    /* There is one digit less, and one blank more. */
    static const char digit[] =
        "ply\nformat ascii 1.0\ncomment crs x\nelement vertex 10\nproperty double x\nend_header\n1\n2\n";
    assert_int_equal(repair(digit, sizeof digit - 1, &file, &got), 1);
    assert_int_equal(file.n_kept, 2);
    assert_memory_equal(got.data, "ply\nformat ascii 1.0\ncomment crs x \nelement vertex 2\n", 53);
    free(got.data);
    /* The first comment alone gets the blank. */
    static const char comments[] =
        "ply\nformat ascii 1.0\ncomment crs x\ncomment b\nelement vertex 10\nproperty double x\nend_header\n1\n2\n";
    assert_int_equal(repair(comments, sizeof comments - 1, &file, &got), 1);
    assert_memory_equal(got.data, "ply\nformat ascii 1.0\ncomment crs x \ncomment b\nelement vertex 2\n", 63);
    free(got.data);
    static const struct {
        size_t at;
        uint8_t value[4];
        int len;
    } bad[] = {{96, {255, 255, 255, 255}, 4},
               {96, {0, 0, 0, 0}, 4},
               {105, {0, 0}, 2},
               {105, {255, 255}, 2},
               {104, {255}, 1},
               {25, {3}, 1},
               {24, {2}, 1},
               {58, {'x'}, 1}};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        memcpy(las.data, repair_left[REPAIR_LAS].data, las.len);
        memcpy(las.data + bad[i].at, bad[i].value, (size_t)bad[i].len);
        expect_refused("h.las", las.data, las.len);
    }
    free(las.data);
    uint8_t frame[64] = {0xd5, 3, 1, 0, 255, 255, 255, 255};
    expect_refused("h.shs", frame, sizeof frame);
    const uint32_t block[] = {0x0a0d0d0a, 0xfffffffc, 0x1a2b3c4d, 1, 0, 0, 0, 0};
    expect_refused("h.pcapng", block, sizeof block);
    expect_refused("h.pcapng", "", 0);
    expect_refused("h.glb", "v 0 0 0\n", 8);
}

/* Good lines follow a bad one. No recorder leaves a file so. */
static void test_damage_within_text(void **state)
{
    (void)state;
    struct repaired file;
    struct bytes got;
    const size_t begin = begin_of(&repair_left[REPAIR_ASCII]);
    repair_name(repair_formats[REPAIR_ASCII].name);
    repair_left[REPAIR_ASCII].data[begin + 3] = 'x';
    assert_int_equal(repair(repair_left[REPAIR_ASCII].data, repair_left[REPAIR_ASCII].len, &file, &got), 0);
    assert_non_null(strstr(repair_err.text, "is damaged at byte"));
    free(got.data);
    repair_left[REPAIR_ASCII].data[begin + 3] = repair_whole[REPAIR_ASCII].data[begin + 3];
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cut),
        cmocka_unit_test(test_cut_whole),
        cmocka_unit_test(test_damaged),
        cmocka_unit_test(test_zeros),
        cmocka_unit_test(test_zeros_twice),
        cmocka_unit_test(test_zeros_after_a_whole_file),
        cmocka_unit_test(test_other_format),
        cmocka_unit_test(test_huge_numbers),
        cmocka_unit_test(test_damage_within_text),
    };
    return cmocka_run_group_tests(tests, repair_set_up, repair_tear_down);
}
