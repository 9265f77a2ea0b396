/* SPDX-License-Identifier: MIT */
/* E57 files that a repair refuses, or in which any byte may be wrong. */
#include "tests/unit/killed_e57_rig.h"

/* A file that is no E57 file of ours, or that is damaged within, is refused in one line and left as it was. */
static void test_refused(void **state)
{
    (void)state;
    const char *path = rig_path("cut.e57");
    struct repair repair;
    struct sh_err err;
    size_t len;
    killed_e57_record(true, false, false);
    static const char text[3000] = "ply\nformat ascii 1.0\n";
    killed_rig_write(path, text, sizeof text);
    assert_int_equal(killed_rig_repair(path, &repair, &err), SH_EFORMAT);
    killed_rig_write(path, "", 0);
    assert_int_equal(killed_rig_repair(path, &repair, &err), SH_EFORMAT);
    for (size_t at = 5; at < killed_e57.left_len - PAGE; at += 2777) {
        killed_e57.left[at] ^= 0x40;
        killed_rig_write(path, killed_e57.left, killed_e57.left_len);
        assert_int_equal(killed_rig_repair(path, &repair, &err), SH_EFORMAT);
        char want[200];
        snprintf(want, sizeof want,
                 "%s: bytes %zu to %zu are damaged, and the file goes on after them; a repair can only cut its end",
                 path, at / PAGE * PAGE, at / PAGE * PAGE + PAGE);
        assert_string_equal(err.text, want);
        uint8_t *now = rig_read(path, &len);
        assert_true(len == killed_e57.left_len && memcmp(now, killed_e57.left, len) == 0);
        free(now);
        killed_e57.left[at] ^= 0x40;
    }
    unlink(path);
}

static void reseal(uint8_t *page)
{
    uint32_t crc = 0xffffffff;
    for (size_t i = 0; i < 8 * CONTENT; i++)
        crc = (crc & 1) ^ (page[i / 8] >> i % 8 & 1u) ? crc >> 1 ^ 0x82f63b78 : crc >> 1;
    for (int i = 0; i < 4; i++)
        page[CONTENT + i] = (uint8_t)(~crc >> (24 - 8 * i));
}

/* Bytes between our last packet and the XML section are another program's. Such a file is refused and stays. */
static void test_elsewhere(void **state)
{
    (void)state;
    const char *path = rig_path("cut.e57");
    struct repair repair;
    struct sh_err err;
    killed_e57_record(true, false, false);
    killed_e57.whole[24] ^= 4;
    reseal(killed_e57.whole);
    killed_rig_write(path, killed_e57.whole, killed_e57.whole_len);
    assert_int_equal(killed_rig_repair(path, &repair, &err), SH_EFORMAT);
    assert_non_null(strstr(err.text, "was written by another program"));
    size_t len;
    uint8_t *now = rig_read(path, &len);
    assert_int_equal(len, killed_e57.whole_len);
    assert_memory_equal(now, killed_e57.whole, len);
    free(now);
    unlink(path);
}

/* Any byte of notes, headers and packets may have any value, with a right CRC. The worst result is a refusal, and a
 * repaired file is whole. */
static void test_absurd(void **state)
{
    (void)state;
    const char *path = rig_path("cut.e57");
    struct repair repair;
    struct sh_err err;
    uint32_t random = 12345;
    int refused = 0;
    killed_e57_record(true, true, true);
    for (int i = 0; i < 200; i++) {
        uint8_t *file = malloc(killed_e57.left_len);
        memcpy(file, killed_e57.left, killed_e57.left_len);
        random = random * 1664525 + 1013904223;
        const size_t at = i < 100 ? 40 + (size_t)i * 4 : random % killed_e57.left_len / PAGE * PAGE + random % 97 * 10;
        memset(file + at, i % 2 ? 0xff : (int)(random >> 24), 1 + random % 8);
        for (size_t p = 0; p + PAGE <= killed_e57.left_len; p += PAGE)
            reseal(file + p);
        killed_rig_write(path, file, killed_e57.left_len);
        free(file);
        int rc = killed_rig_repair(path, &repair, &err);
        refused += rc != 0;
        if (rc != 0) assert_int_equal(rc, SH_EFORMAT);
        if (rc == 0) e57rig_read(path);
    }
    assert_true(refused > 20 && refused < 180);
    unlink(path);
}

static int n_asked;

static int count_asked(void *ctx)
{
    (void)ctx;
    n_asked++;
    return 0;
}

/* A power cut may leave many pages of zeros. Among these, too, a repair asks whether it has to stop. */
static void test_many_zeros(void **state)
{
    (void)state;
    enum { PAGES = 20000 };
    const struct sh_report report = {.stop = count_asked};
    char part[160];
    int n[2];
    snprintf(part, sizeof part, "%s", rig_path("zeros.e57.part"));
    killed_e57_record(true, true, true);
    for (int i = 0; i < 2; i++) {
        struct repaired file;
        struct sh_err err = {0};
        n_asked = 0;
        killed_rig_write(part, killed_e57.left, killed_e57.left_len);
        if (i == 1) assert_int_equal(truncate(part, (off_t)PAGES * PAGE), 0);
        if (repair_file(part, &report, &file, &err) != 0) fail_msg("%s", err.text);
        assert_false(file.was_whole);
        n[i] = n_asked;
        unlink(file.path);
        repair_free(&file);
    }
    assert_in_range(n[0], 1, 1 + 3);               /* once for the file, once for each scan */
    assert_in_range(n[1] - n[0], 1, PAGES / 1000); /* rarely enough that questions take no time */
}

static int tear_down(void **state)
{
    killed_e57_free();
    return rig_tear_down(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_refused),
        cmocka_unit_test(test_elsewhere),
        cmocka_unit_test(test_absurd),
        cmocka_unit_test(test_many_zeros),
    };
    return cmocka_run_group_tests(tests, rig_set_up, tear_down);
}
