/* SPDX-License-Identifier: MIT */
/* Repair, in process: it finds the meant file, replaces none, and changes nothing when given up. And the moments at
 * which a recorder writes its bytes. */
#include <fcntl.h>
#include <sys/stat.h>

#include "core/newfile.h"
#include "drivers/protocol/pcapng.h"
#include "drivers/record/outfile.h"
#include "tests/unit/repair_rig.h"

/* A row that never came to the disk is zeros. A row of other equal bytes did come. */
static void test_zeros(void **state)
{
    static const uint8_t none[5], some[5] = {0, 0, 0, 0, 1}, first[5] = {1}, alike[5] = {7, 7, 7, 7, 7};
    (void)state;
    assert_true(repair_is_zero(none, 5));
    assert_true(!repair_is_zero(some, 5) && !repair_is_zero(first, 5) && !repair_is_zero(alike, 5));
}

/* The meant file is found, and none is replaced. */
static void test_names(void **state)
{
    (void)state;
    struct repaired file;
    struct outfile writer;
    struct bytes got;
    repair_name("a.las");
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), SH_EINPUT);
    assert_int_equal(repair_file("/nonexistent/a.xyz", NULL, &file, &repair_err), SH_EINPUT);
    repair_write_file(repair_path, "old", 3);
    repair_write_file(repair_part, repair_left[REPAIR_LAS].data, repair_left[REPAIR_LAS].len - 1);
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), SH_ESTATE);
    assert_non_null(strstr(repair_err.text, repair_part));
    assert_int_equal(repair_file(repair_part, NULL, &file, &repair_err), 0);
    assert_true(file.is_part && file.was_left && file.n_kept == REPAIR_POINTS - 1);
    repair_free(&file);
    got = repair_slurp(repair_path);
    assert_string_equal((char *)got.data, "old");
    free(got.data);
    assert_int_equal(unlink(repair_path), 0);
    assert_int_equal(repair_file(repair_part, NULL, &file, &repair_err), 0); /* now it gets its name */
    assert_true(!file.is_part && file.was_left && file.was_whole);
    repair_free(&file);
    assert_int_equal(access(repair_part, F_OK), -1);
    assert_int_equal(unlink(repair_path), 0);
    assert_int_equal(symlink("/dev/null", repair_part), 0);
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), SH_EINPUT);
    assert_int_equal(unlink(repair_part), 0);
    /* This file is still being written. */
    assert_int_equal(outfile_open(&writer, repair_path, &repair_err), 0);
    assert_int_equal(outfile_write(&writer, repair_left[REPAIR_LAS].data, repair_left[REPAIR_LAS].len, &repair_err), 0);
    assert_int_equal(outfile_flush(&writer, &repair_err), 0);
    assert_int_equal(newfile_left_len(repair_part), 0);
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), SH_ESTATE);
    assert_non_null(strstr(repair_err.text, "still being written"));
    assert_int_equal(outfile_close(&writer, OUTFILE_LEAVE, &repair_err), 0);
    assert_int_equal(newfile_left_len(repair_part), repair_left[REPAIR_LAS].len);
    assert_int_equal(unlink(repair_part), 0);
}

/* A file that may not be written to is only checked. */
static void test_not_ours(void **state)
{
    (void)state;
    struct repaired file;
    char other[180];
    repair_name("a.las");
    snprintf(other, sizeof other, "%s.other", repair_path);
    repair_write_file(repair_path, repair_whole[REPAIR_LAS].data, repair_whole[REPAIR_LAS].len);
    assert_int_equal(link(repair_path, other), 0);
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), 0);
    assert_true(file.was_whole);
    repair_free(&file);
    assert_int_equal(truncate(repair_path, (off_t)repair_whole[REPAIR_LAS].len - 1), 0);
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), SH_EPERM);
    assert_non_null(strstr(repair_err.text, "needs a repair, but is not writable"));
    assert_int_equal(unlink(other), 0);
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), 0);
    assert_true(!file.was_whole && file.n_kept == REPAIR_POINTS - 1);
    repair_free(&file);
    assert_int_equal(unlink(repair_path), 0);
}

/* Poses of a head that moves, with a comment where some were lost. */
static void test_moving_poses(void **state)
{
    static const char poses[] = "scan,t_s,x_m,y_m,z_m,qw,qx,qy,qz,frame,flags\n1,0.000000000,1,2,3,1,0,0,0,nan,0\n"
                                "# poses are missing here\n1,0.100000000,1,2,-3e-05,1,0,0,0,nan,1\n1,0.2000";
    (void)state;
    struct repaired file;
    repair_name("m.poses.csv");
    repair_write_file(repair_part, poses, sizeof poses - 1);
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), 0);
    assert_true(file.n_kept == 2 && file.n_scans == 1 && file.cut_bytes == 8);
    repair_free(&file);
    assert_int_equal(unlink(repair_path), 0);
}

/* The disk was full for a while, and points were lost. Later writes do not make the file whole. */
static void test_full_for_a_while(void **state)
{
    static const char *const unit[REPAIR_FORMATS] = {"frames", "packets", "points", "points", "points",
                                                     "points", "points",  "points", "poses"};
    (void)state;
    for (int i = 0; i < REPAIR_FORMATS; i++) {
        struct scanhead *sh;
        struct scanhead_frame frame;
        struct recorder *rec;
        struct repaired file;
        repair_name(repair_formats[i].name);
        assert_int_equal(scanhead_open(rig_shs, &sh, NULL, 0), 0);
        assert_int_equal(recorder_open(recorder_find(repair_path, &repair_err), repair_path, &repair_formats[i].options,
                                       &rec, &repair_err),
                         0);
        while (scanhead_next(sh, &frame, -1) == 0)
            assert_int_equal(recorder_frame(rec, sh, &frame, &repair_err), 0);
        struct rlimit old, small;
        void (*was)(int) = signal(SIGXFSZ, SIG_IGN);
        getrlimit(RLIMIT_FSIZE, &old);
        small = (struct rlimit){repair_left[i].len - 2, old.rlim_max};
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
        assert_int_equal(recorder_save(rec, &repair_err), SH_EIO);
        setrlimit(RLIMIT_FSIZE, &old);
        signal(SIGXFSZ, was);
        assert_int_equal(recorder_close(rec, 1, &repair_err), SH_EIO);
        assert_non_null(strstr(repair_err.text, "File too large"));
        scanhead_close(sh);
        assert_int_equal(access(repair_path, F_OK), -1);
        assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), 0);
        assert_true(file.was_left && file.n_kept > 0);
        assert_string_equal(file.unit, unit[i]);
        repair_free(&file);
        struct bytes got = repair_slurp(repair_path);
        if (strstr(repair_path, ".ply") != NULL) /* it says so once */
            assert_int_equal(rig_count((char *)got.data, "comment incomplete:"), 1);
        if (strcmp(unit[i], "packets") == 0)
            assert_non_null(memmem(got.data, got.len, REPAIR_INCOMPLETE, sizeof REPAIR_INCOMPLETE - 1));
        if (strcmp(unit[i], "poses") == 0)
            assert_int_equal(rig_count((char *)got.data, "\n# " REPAIR_INCOMPLETE "\n"), 1);
        free(got.data);
        assert_int_equal(unlink(repair_path), 0);
    }
}

static void take_row(void *ctx, const uint8_t *row)
{
    (void)row;
    ++*(int *)ctx;
}

/* A folder stands for a disk that cannot be read, and /dev/full for one that is full. */
static void test_broken_disk(void **state)
{
    (void)state;
    struct repair r = {.path = "a.las", .fd = open("/", O_RDONLY | O_CLOEXEC), .len = 100};
    char text[16];
    int n = 0;
    assert_int_equal(repair_read(&r, 0, text, sizeof text, &repair_err), SH_EIO);
    assert_string_equal(repair_err.text, "a.las: cannot be read: Is a directory");
    assert_int_equal(repair_rows(&r, &(struct repair_rows){0, 2, 50}, take_row, &n, &repair_err), SH_EIO);
    assert_int_equal(n, 0);
    assert_int_equal(repair_write(&r, 0, "x", 1, &repair_err), SH_EPERM);
    assert_int_equal(repair_cut(&r, 99, &repair_err), SH_EPERM);
    assert_int_equal(repair_cut(&r, 100, &repair_err), SH_OK);
    close(r.fd);
    r.fd = open("/dev/full", O_RDWR | O_CLOEXEC);
    assert_int_equal(repair_write(&r, 0, "x", 1, &repair_err), SH_EIO);
    assert_string_equal(repair_err.text, "a.las: cannot be repaired: No space left on device");
    assert_int_equal(repair_cut(&r, 99, &repair_err), SH_EIO);
    assert_string_equal(repair_err.text, "a.las: cannot be cut: Invalid argument");
    assert_int_equal(r.cut_bytes, 0);
    close(r.fd);
    repair_name("a.las");
    repair_write_file(repair_path, "abc", 3);
    r.fd = open(repair_path, O_RDWR | O_CLOEXEC);
    assert_int_equal(repair_read(&r, 0, text, 4, &repair_err), SH_EIO);
    assert_string_equal(repair_err.text, "a.las: cannot be read: it got shorter while it was read");
    assert_int_equal(repair_read(&r, 1, text, 2, &repair_err), SH_OK);
    assert_memory_equal(text, "bc", 2);
    close(r.fd);
    assert_int_equal(unlink(repair_path), 0);
}

static int take_long_line(void *ctx, const char *line, size_t len)
{
    ++*(int *)ctx;
    return len == 99 && line[0] == 'a' && line[98] == 'z';
}

/* Files are read in blocks of 1 MiB. Lines and rows lie across their edges. */
static void test_several_blocks(void **state)
{
    enum { LINES = 30000, LINE = 100 };
    (void)state;
    char *text = malloc(LINES * LINE);
    struct repair r = {.path = "a.csv", .len = LINES * LINE};
    uint64_t end;
    int n = 0;
    memset(text, 'b', LINES * LINE);
    for (int i = 0; i < LINES; i++) {
        text[i * LINE] = 'a';
        text[i * LINE + 98] = 'z';
        text[i * LINE + 99] = '\n';
    }
    repair_name("a.las");
    repair_write_file(repair_path, text, LINES * LINE);
    free(text);
    r.fd = open(repair_path, O_RDONLY | O_CLOEXEC);
    assert_int_equal(repair_lines(&r, 0, take_long_line, &n, &end, &repair_err), SH_OK);
    assert_int_equal(n, LINES);
    assert_int_equal(end, LINES * LINE);
    n = 0;
    assert_int_equal(repair_rows(&r, &(struct repair_rows){0, LINES * LINE / 24, 24}, take_row, &n, &repair_err), 0);
    assert_int_equal(n, LINES * LINE / 24);
    close(r.fd);
    assert_int_equal(unlink(repair_path), 0);
}

static void test_large_capture(void **state)
{
    enum { PACKETS = 40000 };
    (void)state;
    struct repaired file;
    const struct bytes *whole = &repair_whole[1];
    uint8_t *all = malloc(whole->len + PACKETS * pcapng_packet_len(50));
    size_t len = whole->len;
    memcpy(all, whole->data, len);
    for (int i = 0; i < PACKETS; i++)
        len += pcapng_put_packet(all + len, 0, i, "0123456789012345678901234567890123456789012345678",
                                 1 + (size_t)i % 50, 0);
    repair_name("a.pcapng");
    repair_write_file(repair_path, whole->data, whole->len);
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), SH_OK);
    const uint64_t n = file.n_kept;
    repair_free(&file);
    repair_write_file(repair_path, all, len);
    free(all);
    if (repair_file(repair_path, NULL, &file, &repair_err) != SH_OK) fail_msg("%s", repair_err.text);
    assert_int_equal(file.n_kept, n + PACKETS);
    assert_int_equal(file.was_whole, 1);
    repair_free(&file);
    assert_int_equal(unlink(repair_path), 0);
}

/* ctx: how many questions are answered with no before that; NULL: none. */
static int stop(void *ctx)
{
    return ctx == NULL || --*(int *)ctx < 0;
}

/* A repair that is given up leaves the file as it was. */
static void test_stopped(void **state)
{
    (void)state;
    const struct sh_report report = {.stop = stop};
    for (int i = 0; i < REPAIR_FORMATS; i++) {
        struct repaired file;
        repair_name(repair_formats[i].name);
        repair_write_file(repair_part, repair_left[i].data, repair_left[i].len - 1);
        assert_int_equal(repair_file(repair_path, &report, &file, &repair_err), SH_ESTOPPED);
        struct bytes got = repair_slurp(repair_part);
        assert_int_equal(got.len, repair_left[i].len - 1);
        assert_memory_equal(got.data, repair_left[i].data, got.len);
        free(got.data);
        unlink(repair_part);
    }
}

/* A power cut can leave a file of zeros that is long: their search can be stopped, too, at each block of 1 MiB. */
static void test_search_for_zeros_is_stopped(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        int n_before = 4;
        const int i = k == 0 ? REPAIR_LAS : 2; /* the latter is binary PLY */
        const struct sh_report report = {.stop = stop, .ctx = &n_before};
        struct repaired file;
        repair_name(repair_formats[i].name);
        repair_write_file(repair_part, repair_left[i].data, repair_left[i].len);
        assert_int_equal(truncate(repair_part, 8 << 20), 0);
        assert_int_equal(repair_file(repair_path, &report, &file, &repair_err), SH_ESTOPPED);
        assert_int_equal(access(repair_path, F_OK), -1);
        struct bytes got = repair_slurp(repair_part);
        assert_int_equal(got.len, 8 << 20);
        assert_memory_equal(got.data, repair_left[i].data, repair_left[i].len);
        free(got.data);
        unlink(repair_part);
    }
}

static char warnings[1024];

static void keep_warning(void *ctx, const char *text)
{
    (void)ctx;
    const size_t at = strlen(warnings);
    snprintf(warnings + at, sizeof warnings - at, "%s\n", text);
}

/* Bytes between the frames of a stream stay, and their number is said; those after the last frame are cut. */
static void test_bytes_between_frames(void **state)
{
    (void)state;
    static const int n_bad[] = {0, 1, 5};
    const struct bytes *whole = &repair_whole[0];
    const struct sh_report report = {.warn = keep_warning};
    const size_t first = NATIVE_HEADER_LEN + rig_uint(whole->data + 4, 4); /* PROTOCOL.md: length of the payload */
    for (int i = 0; i < 3; i++)
        for (int cut = 0; cut < 2; cut++) {
            struct repaired file;
            const size_t n = (size_t)n_bad[i], len = whole->len + n + (size_t)cut;
            uint8_t *bytes = malloc(len);
            char want[300] = "";
            memcpy(bytes, whole->data, first);
            memset(bytes + first, 'x', n);
            memcpy(bytes + first + n, whole->data + first, whole->len - first);
            memset(bytes + whole->len + n, 'x', (size_t)cut);
            repair_name("a.shs");
            repair_write_file(repair_part, bytes, len);
            warnings[0] = 0;
            if (repair_file(repair_path, &report, &file, &repair_err) != SH_OK) fail_msg("%s", repair_err.text);
            if (n > 0)
                snprintf(want, sizeof want,
                         "%s: %zu bytes between frames belong to no frame; they stay, and readers skip them\n",
                         repair_part, n);
            assert_string_equal(warnings, want);
            assert_int_equal(file.cut_bytes, cut);
            assert_int_equal(file.was_whole, !cut);
            assert_string_equal(file.unit, "frames");
            repair_free(&file);
            struct bytes got = repair_slurp(repair_path);
            assert_int_equal(got.len, len - (size_t)cut);
            assert_memory_equal(got.data, bytes, got.len);
            free(got.data);
            free(bytes);
            unlink(repair_path);
        }
}

static void put_descriptor(uint32_t scan, int64_t t_s, int flags)
{
    static uint8_t out[1024];
    const struct native_descriptor d = {.idn = "Maker,Model,SN1,1.0",
                                        .profile = "model",
                                        .scan = scan,
                                        .prr_uhz = 1000000000,
                                        .mirror_counts_per_turn = 3600,
                                        .pan_counts_per_turn = 3600,
                                        .range_scale_m = 1e-3};
    rig_put(out, native_encode_descriptor(out, sizeof out, &d, t_s * 1000000000, flags));
}

/* A descriptor of the same scan says that settings have changed (PROTOCOL.md), and begins no other scan. */
static void test_scans_of_a_stream(void **state)
{
    static const char *const names[] = {"s.shs", "s.pcapng"};
    static const struct rig_point p = {100, 200, 300, -1000, 1, 1, 1};
    struct repaired file;
    struct scanhead *sh;
    struct scanhead_frame frame;
    struct recorder *rec;
    (void)state;
    repair_name(names[0]);
    rig_stream = fopen(repair_path, "wb");
    assert_non_null(rig_stream);
    put_descriptor(4, 1, NATIVE_REPEAT); /* between scans: that of the last one */
    put_descriptor(5, 2, 0);
    rig_points(0, 0, 0, &p, 1);
    put_descriptor(5, 3, 0); /* other settings */
    put_descriptor(5, 4, NATIVE_REPEAT);
    put_descriptor(6, 6, NATIVE_REPEAT); /* the descriptor before it was lost */
    put_descriptor(6, 7, 0);
    put_descriptor(7, 8, 0);
    put_descriptor(1, 2, 0); /* the head was started again */
    put_descriptor(1, 1, 0); /* and once more */
    fclose(rig_stream);
    rig_stream = NULL;
    assert_int_equal(scanhead_open(repair_path, &sh, NULL, 0), 0);
    repair_name(names[1]);
    assert_int_equal(recorder_open(recorder_find(repair_path, &repair_err), repair_path, &(struct recorder_options){0},
                                   &rec, &repair_err),
                     0);
    while (scanhead_next(sh, &frame, -1) == 0)
        assert_int_equal(recorder_frame(rec, sh, &frame, &repair_err), 0);
    assert_int_equal(recorder_close(rec, 1, &repair_err), 0);
    scanhead_close(sh);
    for (int i = 0; i < 2; i++) {
        repair_name(names[i]);
        assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), 0);
        assert_true(file.was_whole);
        assert_int_equal(file.n_scans, 5);
        repair_free(&file);
        assert_int_equal(unlink(repair_path), 0);
    }
}

/* Bytes wait for two calls at most. A call writes nothing if bytes were written since the last call. */
static void test_save(void **state)
{
    (void)state;
    struct outfile file;
    struct stat st;
    repair_name("a.shs");
    assert_int_equal(outfile_open(&file, repair_path, &repair_err), 0);
    assert_int_equal(outfile_write(&file, "12345", 5, &repair_err), 0);
    assert_int_equal(outfile_save(&file, &repair_err), 0);
    assert_true(fstat(file.fd, &st) == 0 && st.st_size == 5);
    assert_int_equal(outfile_write(&file, "67", 2, &repair_err), 0);
    assert_int_equal(outfile_flush(&file, &repair_err), 0);
    assert_int_equal(outfile_write(&file, "8", 1, &repair_err), 0);
    assert_int_equal(outfile_save(&file, &repair_err), 0); /* 2 bytes went since the last call */
    assert_true(fstat(file.fd, &st) == 0 && st.st_size == 7);
    assert_int_equal(outfile_save(&file, &repair_err), 0);
    assert_true(fstat(file.fd, &st) == 0 && st.st_size == 8);
    assert_int_equal(outfile_close(&file, OUTFILE_DROP, &repair_err), 0);
    assert_int_equal(outfile_open(&file, repair_path, &repair_err), 0);
    assert_int_equal(outfile_close(&file, OUTFILE_LEAVE, &repair_err), 0); /* an empty one is of no use */
    assert_int_equal(access(repair_part, F_OK), -1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_names),
                                       cmocka_unit_test(test_not_ours),
                                       cmocka_unit_test(test_moving_poses),
                                       cmocka_unit_test(test_full_for_a_while),
                                       cmocka_unit_test(test_broken_disk),
                                       cmocka_unit_test(test_stopped),
                                       cmocka_unit_test(test_search_for_zeros_is_stopped),
                                       cmocka_unit_test(test_bytes_between_frames),
                                       cmocka_unit_test(test_several_blocks),
                                       cmocka_unit_test(test_large_capture),
                                       cmocka_unit_test(test_save),
                                       cmocka_unit_test(test_zeros),
                                       cmocka_unit_test(test_scans_of_a_stream)};
    return cmocka_run_group_tests(tests, repair_set_up, repair_tear_down);
}
