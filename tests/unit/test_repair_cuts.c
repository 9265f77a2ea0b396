/* Repair, in process: a small file of each format cut at every byte, damaged at every byte, of another format, and with
 * numbers beyond all reason. What comes out holds the whole units and is whole, or it is as it was. */
#include <sys/stat.h>

#include "core/newfile.h"
#include "drivers/protocol/pcapng.h"
#include "drivers/record/outfile.h"
#include "tests/unit/recorder_rig.h"

/* ---- in place of libc's: thousands of small files need not reach a disk */

int fsync(int fd)
{
    (void)fd;
    return 0;
}

/* ---- what a killed recorder leaves */

static const struct format {
    const char *name;
    struct recorder_options options;
    int knows_damage; /* a wrong byte within its units is noticed */
} formats[] = {
    {"a.shs", {0}, 0},          {"a.pcapng", {0}, 0},
    {"a.ply", {0}, 0},          {"b.ply", {.columns = PLY_XYZ | PLY_FLOAT}, 0},
    {"c.ply", {.ascii = 1}, 1}, {"d.ply", {.colour = {.given = 1, .scale.mode = COLOUR_LABEL}, .scalar_names = 1}, 0},
    {"a.las", {0}, 0},          {"b.las", {.las_minor = 2, .colour = {.given = 1, .scale.mode = COLOUR_LABEL}}, 0},
    {"a.poses.csv", {0}, 1},
};
enum { N_FORMATS = sizeof formats / sizeof formats[0], N_ROWS = 12 };

struct bytes {
    uint8_t *data;
    size_t len;
};

static struct bytes left[N_FORMATS], whole[N_FORMATS];
static struct sh_err err;

static struct bytes slurp(const char *path)
{
    struct stat st;
    FILE *in = fopen(path, "rb");
    assert_non_null(in);
    assert_int_equal(fstat(fileno(in), &st), 0);
    struct bytes b = {calloc(1, (size_t)st.st_size + 1), (size_t)st.st_size};
    assert_int_equal(fread(b.data, 1, b.len, in), b.len);
    fclose(in);
    return b;
}

static void put_scan(uint32_t scan)
{
    static const struct rig_point p[] = {
        {100, 200, 300, -1000, 1, 1, 1}, {-100, 5, 6, -2000, 2, 1, 2}, {-90, 6, 7, 30, 2, 2, 2}};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, scan);
    memset(a.anchor, 0, sizeof a.anchor);
    rig_descriptor(1, scan);
    rig_anchor(&a);
    for (uint32_t i = 0; i < N_ROWS / 6; i++)
        rig_points(i, 2 * i, 2 * i, p, 3);
}

/* Two scans, 12 points. */
static void put_stream(void)
{
    rig_begin();
    put_scan(1);
    put_scan(2);
    fclose(rig_stream);
    rig_stream = NULL;
}

/* What is on the disk when all frames have come, and nothing else. */
static struct bytes leave(const struct format *f)
{
    struct scanhead *sh;
    struct scanhead_frame frame;
    struct recorder *rec;
    char path[160];
    snprintf(path, sizeof path, "%s", rig_path(f->name));
    assert_int_equal(scanhead_open(rig_shs, &sh, NULL, 0), 0);
    assert_int_equal(recorder_open(recorder_find(path, &err), path, &f->options, &rec, &err), 0);
    while (scanhead_next(sh, &frame, -1) == 0)
        if (recorder_frame(rec, sh, &frame, &err) != 0) fail_msg("%s", err.text);
    assert_int_equal(recorder_save(rec, &err), 0);
    snprintf(path + strlen(path), 8, ".part");
    struct bytes b = slurp(path);
    assert_int_equal(recorder_close(rec, 0, &err), 0);
    scanhead_close(sh);
    return b;
}

static int set_up(void **state)
{
    if (rig_set_up(state) != 0) return -1;
    put_stream();
    for (int i = 0; i < N_FORMATS; i++) {
        left[i] = leave(&formats[i]);
        const char *path = rig_path(formats[i].name);
        assert_int_equal(rig_record(path, formats[i].options, RIG_KEEP, &err), 0);
        whole[i] = slurp(path);
        unlink(path);
    }
    return 0;
}

static int tear_down(void **state)
{
    for (int i = 0; i < N_FORMATS; i++) {
        free(left[i].data);
        free(whole[i].data);
    }
    return rig_tear_down(state);
}

/* ---- one repair */

static char path[160], part[168];

static void name(const char *file)
{
    snprintf(path, sizeof path, "%s", rig_path(file));
    snprintf(part, sizeof part, "%s.part", path);
}

static void write_file(const char *to, const void *data, size_t len)
{
    FILE *out = fopen(to, "wb");
    assert_non_null(out);
    assert_int_equal(fwrite(data, 1, len, out), len);
    fclose(out);
}

/* Repairs what is in part; 1: it is whole now, as *file says, and the bytes are in *got. 0: it was refused, and stays. */
static int repair(const void *data, size_t len, struct repaired *file, struct bytes *got)
{
    write_file(part, data, len);
    const int rc = repair_file(path, NULL, file, &err);
    *got = slurp(rc == 0 ? path : part);
    if (rc != 0) {
        assert_int_equal(rc, SH_EFORMAT);
        assert_non_null(strstr(err.text, part));
        assert_int_equal(access(path, F_OK), -1);
        assert_int_equal(got->len, len);
        assert_memory_equal(got->data, data, len);
        unlink(part);
        return 0;
    }
    assert_true(file->was_left && !file->is_part);
    assert_int_equal(access(part, F_OK), -1);
    repair_free(file);
    struct repaired again;
    if (repair_file(path, NULL, &again, &err) != 0) fail_msg("%s", err.text);
    assert_true(again.was_whole && !again.was_left && again.cut_bytes == 0);
    assert_int_equal(again.n_kept, file->n_kept);
    repair_free(&again);
    struct bytes twice = slurp(path);
    assert_int_equal(twice.len, got->len);
    assert_memory_equal(twice.data, got->data, got->len);
    free(twice.data);
    unlink(path);
    return 1;
}

/* Where both begin to be the same: behind the header, which a repair changes. */
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
    const uint8_t *note = memmem(b->data, b->len, "incomplete: the recorder", 24); /* of a capture: its block */
    if (mark != NULL) return (size_t)(mark - b->data);
    return note != NULL && rig_uint(b->data, 4) == 0x0a0d0d0a ? (size_t)(note - b->data) - 24 : b->len;
}

/* ---- tests */

/* What is cut at a byte has as many units as are whole before it, and these are the first of the whole file. */
static void test_cut(void **state)
{
    (void)state;
    for (int i = 0; i < N_FORMATS; i++) {
        uint64_t before = 0;
        name(formats[i].name);
        for (size_t n = 1; n <= left[i].len; n++) {
            struct repaired file;
            struct bytes got;
            const int is_whole = repair(left[i].data, n, &file, &got);
            if (!is_whole && before > 0) fail_msg("%s, %zu bytes: %s", path, n, err.text);
            const size_t begin = begin_of(&whole[i]), end = end_of(&got);
            if (is_whole) {
                assert_true(file.n_kept == before || file.n_kept == before + 1 || before == 0);
                assert_int_equal(end + file.cut_bytes, n);
                assert_true(end >= begin && end <= whole[i].len);
                assert_memory_equal(got.data + begin, whole[i].data + begin, end - begin);
                before = file.n_kept;
            }
            free(got.data);
        }
        if (strstr(path, ".ply") || strstr(path, ".las")) assert_int_equal(before, N_ROWS);
        assert_int_equal(before > 1, 1);
    }
}

/* A finished file that was cut later, as by a copy. */
static void test_cut_whole(void **state)
{
    (void)state;
    for (int i = 0; i < N_FORMATS; i++) {
        struct repaired file;
        struct bytes got;
        name(formats[i].name);
        write_file(path, whole[i].data, whole[i].len);
        assert_int_equal(repair_file(path, NULL, &file, &err), 0);
        assert_true(file.was_whole && !file.was_left && file.n_kept > 0);
        repair_free(&file);
        got = slurp(path);
        assert_int_equal(got.len, whole[i].len);
        assert_memory_equal(got.data, whole[i].data, got.len);
        free(got.data);
        assert_int_equal(truncate(path, (off_t)whole[i].len - 1), 0);
        assert_int_equal(repair_file(path, NULL, &file, &err), 0);
        assert_true(!file.was_whole && file.cut_bytes > 0);
        repair_free(&file);
        assert_int_equal(repair_file(path, NULL, &file, &err), 0);
        assert_true(file.was_whole);
        repair_free(&file);
        unlink(path);
    }
}

/* Another byte anywhere: nothing crashes, and what is not refused is whole. Where damage can be seen, it is refused. */
static void test_damaged(void **state)
{
    (void)state;
    for (int i = 0; i < N_FORMATS; i++) {
        name(formats[i].name);
        const size_t begin = begin_of(&left[i]);
        for (size_t n = 0; n < left[i].len; n++) {
            struct repaired file;
            struct bytes got;
            left[i].data[n] ^= 0x80;
            const int is_whole = repair(left[i].data, left[i].len, &file, &got);
            left[i].data[n] ^= 0x80;
            if (formats[i].knows_damage && is_whole && n >= begin && file.cut_bytes == 0)
                fail_msg("%s: byte %zu", path, n);
            free(got.data);
        }
    }
}

/* Zeros at the end, as a power cut leaves them. */
static void test_zeros(void **state)
{
    (void)state;
    for (int i = 0; i < N_FORMATS; i++) {
        struct repaired file;
        struct bytes got, longer = {calloc(1, left[i].len + 300000), left[i].len + 300000};
        memcpy(longer.data, left[i].data, left[i].len);
        name(formats[i].name);
        if (!repair(longer.data, longer.len, &file, &got)) fail_msg("%s", err.text);
        assert_int_equal(file.cut_bytes, 300000);
        assert_true(file.n_kept > 1);
        free(got.data);
        free(longer.data);
    }
}

/* A file of another format under that ending is not touched. */
static void test_other_format(void **state)
{
    (void)state;
    for (int i = 0; i < N_FORMATS; i++)
        for (int k = 0; k < N_FORMATS; k++) {
            struct repaired file;
            struct bytes got;
            if (strcmp(strchr(formats[i].name, '.'), strchr(formats[k].name, '.')) == 0) continue;
            name(formats[i].name);
            /* a capture holds whole frames, which a stream's reader finds */
            const int finds = strcmp(formats[i].name, "a.shs") == 0 && strcmp(formats[k].name, "a.pcapng") == 0;
            if (!finds && repair(left[k].data, left[k].len, &file, &got)) fail_msg("%s as %s", formats[k].name, path);
            if (!finds) free(got.data);
        }
}

static void expect_refused(const char *file_name, const void *data, size_t len)
{
    struct repaired file;
    struct bytes got;
    name(file_name);
    if (repair(data, len, &file, &got)) fail_msg("%s of %zu bytes was taken", path, len);
    free(got.data);
}

static void test_huge_numbers(void **state)
{
    (void)state;
    static const char *const ply[] = {
        "ply\nformat binary_little_endian 1.0\nelement vertex 18446744073709551615\nproperty double x\nend_header\n12345678",
        "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty list uchar int x\nend_header\n12345678",
        "ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty double x\nend_header\n12345678",
        "ply\nformat binary_little_endian 1.0\nelement vertex 3\nend_header\n12345678",
        "ply\nformat binary_little_endian 1.0\nproperty double x\nelement vertex 3\nend_header\n12345678",
        "ply\nformat ascii 1.0\nelement edge 3\nproperty double x\nend_header\n1\n"};
    /* the first has eight bytes, and is made right where its header has room for that: by blanks it has */
    for (size_t i = 1; i < sizeof ply / sizeof ply[0]; i++)
        expect_refused("h.ply", ply[i], strlen(ply[i]));
    struct repaired file;
    struct bytes got, las = {malloc(left[6].len), left[6].len};
    name("h.ply");
    assert_int_equal(repair(ply[0], strlen(ply[0]), &file, &got), 1);
    assert_int_equal(file.n_kept, 1);
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
        memcpy(las.data, left[6].data, las.len);
        memcpy(las.data + bad[i].at, bad[i].value, (size_t)bad[i].len);
        expect_refused("h.las", las.data, las.len);
    }
    free(las.data);
    uint8_t frame[64] = {0xd5, 3, 1, 0, 255, 255, 255, 255};
    expect_refused("h.shs", frame, sizeof frame);
    const uint32_t block[] = {0x0a0d0d0a, 0xfffffffc, 0x1a2b3c4d, 1, 0, 0, 0, 0};
    expect_refused("h.pcapng", block, sizeof block);
    expect_refused("h.pcapng", "", 0);
    expect_refused("h.obj", "v 0 0 0\n", 8);
}

/* A meshless gap: where good lines follow a bad one, no recorder has left it so. */
static void test_damage_within_text(void **state)
{
    (void)state;
    struct repaired file;
    struct bytes got;
    const size_t begin = begin_of(&left[4]);
    name(formats[4].name);
    left[4].data[begin + 3] = 'x';
    assert_int_equal(repair(left[4].data, left[4].len, &file, &got), 0);
    assert_non_null(strstr(err.text, "is damaged at byte"));
    free(got.data);
    left[4].data[begin + 3] = whole[4].data[begin + 3];
}

/* Which file is meant, and that none is replaced. */
static void test_names(void **state)
{
    (void)state;
    struct repaired file;
    struct outfile writer;
    struct bytes got;
    name("a.las");
    assert_int_equal(repair_file(path, NULL, &file, &err), SH_EINPUT);
    assert_int_equal(repair_file("/nonexistent/a.xyz", NULL, &file, &err), SH_EINPUT);
    write_file(path, "old", 3);
    write_file(part, left[6].data, left[6].len - 1);
    assert_int_equal(repair_file(path, NULL, &file, &err), SH_ESTATE);
    assert_non_null(strstr(err.text, part));
    assert_int_equal(repair_file(part, NULL, &file, &err), 0);
    assert_true(file.is_part && file.was_left && file.n_kept == N_ROWS - 1);
    repair_free(&file);
    got = slurp(path);
    assert_string_equal((char *)got.data, "old");
    free(got.data);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(repair_file(part, NULL, &file, &err), 0); /* now it gets its name */
    assert_true(!file.is_part && file.was_left && file.was_whole);
    repair_free(&file);
    assert_int_equal(access(part, F_OK), -1);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(symlink("/dev/null", part), 0);
    assert_int_equal(repair_file(path, NULL, &file, &err), SH_EINPUT);
    assert_int_equal(unlink(part), 0);
    /* one that is still being written */
    assert_int_equal(outfile_open(&writer, path, &err), 0);
    assert_int_equal(outfile_write(&writer, left[6].data, left[6].len, &err), 0);
    assert_int_equal(outfile_flush(&writer, &err), 0);
    assert_int_equal(newfile_left_len(part), 0);
    assert_int_equal(repair_file(path, NULL, &file, &err), SH_ESTATE);
    assert_non_null(strstr(err.text, "still being written"));
    assert_int_equal(outfile_close(&writer, OUTFILE_LEAVE, &err), 0);
    assert_int_equal(newfile_left_len(part), left[6].len);
    assert_int_equal(unlink(part), 0);
}

static int stop(void *ctx)
{
    (void)ctx;
    return 1;
}

/* Who gives it up finds it as it was. */
static void test_stopped(void **state)
{
    (void)state;
    const struct sh_report report = {.stop = stop};
    for (int i = 0; i < N_FORMATS; i++) {
        struct repaired file;
        name(formats[i].name);
        write_file(part, left[i].data, left[i].len - 1);
        assert_int_equal(repair_file(path, &report, &file, &err), SH_ESTOPPED);
        struct bytes got = slurp(part);
        assert_int_equal(got.len, left[i].len - 1);
        assert_memory_equal(got.data, left[i].data, got.len);
        free(got.data);
        unlink(part);
    }
}

/* Nothing waits for longer than two calls, and a file that is written anyway is left alone. */
static void test_save(void **state)
{
    (void)state;
    struct outfile file;
    struct stat st;
    name("a.shs");
    assert_int_equal(outfile_open(&file, path, &err), 0);
    assert_int_equal(outfile_write(&file, "12345", 5, &err), 0);
    assert_int_equal(outfile_save(&file, &err), 0);
    assert_true(fstat(file.fd, &st) == 0 && st.st_size == 5);
    assert_int_equal(outfile_write(&file, "67", 2, &err), 0);
    assert_int_equal(outfile_flush(&file, &err), 0);
    assert_int_equal(outfile_write(&file, "8", 1, &err), 0);
    assert_int_equal(outfile_save(&file, &err), 0); /* 2 bytes went since the last call */
    assert_true(fstat(file.fd, &st) == 0 && st.st_size == 7);
    assert_int_equal(outfile_save(&file, &err), 0);
    assert_true(fstat(file.fd, &st) == 0 && st.st_size == 8);
    assert_int_equal(outfile_close(&file, OUTFILE_DROP, &err), 0);
    assert_int_equal(outfile_open(&file, path, &err), 0);
    assert_int_equal(outfile_close(&file, OUTFILE_LEAVE, &err), 0); /* an empty one is of no use */
    assert_int_equal(access(part, F_OK), -1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cut),
        cmocka_unit_test(test_cut_whole),
        cmocka_unit_test(test_damaged),
        cmocka_unit_test(test_zeros),
        cmocka_unit_test(test_other_format),
        cmocka_unit_test(test_huge_numbers),
        cmocka_unit_test(test_damage_within_text),
        cmocka_unit_test(test_names),
        cmocka_unit_test(test_stopped),
        cmocka_unit_test(test_save),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
