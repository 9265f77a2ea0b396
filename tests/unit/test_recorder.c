/* SPDX-License-Identifier: MIT */
/* Recorders: a file is whole or missing, the raw stream is kept byte by byte, and endings are known. */
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "tests/unit/ply_rig.h"

static void test_whole_or_not_at_all(void **state)
{
    (void)state;
    struct sh_err err;
    FILE *old = fopen(out_path, "wb");
    fputs("old", old);
    fclose(old);
    begin_stream();
    put_descriptor(1, 1, 3);
    put_anchor(NATIVE_CRS_UTM, 32632, 2);
    put_points(0);
    assert_int_equal(record(out_path, (struct recorder_options){0}, 0, &err), 0);
    slurp(out_path);
    assert_string_equal(text, "old");
    assert_int_equal(access(part_path, F_OK), -1);
    assert_int_equal(record("/nonexistent/x.ply", (struct recorder_options){0}, 1, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "/nonexistent/x.ply"));
    char blocked[80];
    snprintf(blocked, sizeof blocked, "%s/d.ply", dir);
    assert_int_equal(mkdir(blocked, 0777), 0);
    assert_int_equal(record(blocked, (struct recorder_options){0}, 1, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, blocked));
    rmdir(blocked);
}

/* A limit on the file's size stands for the full disk: the same write fails. */
static void test_disk_full(void **state)
{
    (void)state;
    struct sh_err err;
    struct rlimit old, small = {3000, 0};
    void (*was)(int) = signal(SIGXFSZ, SIG_IGN);
    struct repaired file;
    char path[80], part[96];
    begin_stream();
    put_descriptor(1, 1, 3);
    put_anchor(NATIVE_CRS_UTM, 32632, 2);
    for (int i = 0; i < 20; i++)
        put_points((uint64_t)i * 4);
    fclose(shs);
    shs = NULL;
    unlink(out_path);
    getrlimit(RLIMIT_FSIZE, &old);
    small.rlim_max = old.rlim_max;
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    int ply = record(out_path, (struct recorder_options){0}, 1, &err);
    char ply_text[sizeof err.text];
    snprintf(ply_text, sizeof ply_text, "%s", err.text);
    snprintf(path, sizeof path, "%s/full.shs", dir);
    snprintf(part, sizeof part, "%s.part", path);
    int raw = record(path, (struct recorder_options){0}, 1, &err);
    setrlimit(RLIMIT_FSIZE, &old);
    signal(SIGXFSZ, was);
    assert_int_equal(ply, SH_EIO);
    assert_non_null(strstr(ply_text, part_path));
    assert_int_equal(access(out_path, F_OK), -1);
    assert_int_equal(raw, SH_EIO);
    assert_non_null(strstr(err.text, part));
    assert_int_equal(access(path, F_OK), -1);
    /* The bytes on the disk stay. */
    assert_int_equal(repair_file(out_path, NULL, &file, &err), 0);
    assert_true(file.was_left && file.n_kept > 0);
    repair_free(&file);
    assert_int_equal(repair_file(path, NULL, &file, &err), 0);
    assert_true(file.was_left && file.n_kept > 0);
    repair_free(&file);
    assert_int_equal(access(part_path, F_OK), -1);
    assert_int_equal(access(part, F_OK), -1);
    unlink(path);
}

static void test_shs(void **state)
{
    (void)state;
    struct sh_err err;
    char path[80], *copy;
    begin_stream();
    put_surfaces(0, 3, NULL);
    put_descriptor(1, 1, 3);
    put_anchor(NATIVE_CRS_UTM, 32632, 2);
    for (int i = 0; i < 10000; i++) /* beyond the buffer */
        put_points((uint64_t)i * 4);
    snprintf(path, sizeof path, "%s/copy.SHS", dir);
    assert_int_equal(record(path, (struct recorder_options){0}, 1, &err), 0);
    slurp(shs_path);
    copy = text;
    text = NULL;
    size_t copy_len = text_len;
    slurp(path);
    assert_int_equal(text_len, copy_len);
    assert_memory_equal(text, copy, copy_len);
    free(copy);
    unlink(path);
}

static void test_find(void **state)
{
    (void)state;
    struct sh_err err;
    assert_string_equal(recorder_find("x.PLY", &err)->ending, ".ply");
    assert_string_equal(recorder_find("a/b.shs", &err)->ending, ".shs");
    assert_null(recorder_find("x.txt", &err));
    assert_int_equal(err.code, SH_EINPUT);
    assert_non_null(strstr(err.text, ".ply"));
    assert_null(recorder_find(".ply", &err));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_whole_or_not_at_all),
        cmocka_unit_test(test_disk_full),
        cmocka_unit_test(test_shs),
        cmocka_unit_test(test_find),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
