/* SPDX-License-Identifier: MIT */
/* A LAS file with waveforms is repaired, and this may lie beside it: any file of the name X.wdp, the .wdp of an older
 * recording, or packets whose end a power cut has made zeros. */
#include "tests/unit/las_packets_rig.h"

static void put_int(struct bytes *b, size_t at, uint64_t v, int n_bytes)
{
    for (int i = 0; i < n_bytes; i++)
        b->data[at + (size_t)i] = (uint8_t)(v >> 8 * i);
}

/* The whole recording with --wdp, made of the one with packets inside. */
static struct bytes las_outside(void)
{
    struct bytes b = {malloc(whole.len), packets_front_of(&whole) + 2 * N * POINT};
    memcpy(b.data, whole.data, whole.len);
    put_int(&b, 6, 1 << 4 | 1 << 2, 2);
    put_int(&b, 227, 0, 8); /* where the record of packets begins, */
    put_int(&b, 235, 0, 8); /* where extended records begin, */
    put_int(&b, 243, 0, 4); /* and how many they are */
    return b;
}

/* The .las at las_path has a .wdp of these bytes beside it, which is not its own: the repair changes neither file. */
static void check_untouched(const char *las_path, const char *wdp_path, const void *packets, size_t len)
{
    const struct bytes before = repair_slurp(las_path);
    struct repaired file;
    repair_write_file(wdp_path, packets, len);
    assert_int_equal(repair_file(las_path, NULL, &file, &repair_err), SH_EFORMAT);
    assert_ptr_equal(strstr(repair_err.text, wdp_path), repair_err.text);
    assert_non_null(strstr(repair_err.text, "unchanged"));
    const struct bytes las = repair_slurp(las_path), is = repair_slurp(wdp_path);
    assert_int_equal(las.len, before.len);
    assert_memory_equal(las.data, before.data, las.len);
    assert_int_equal(is.len, len);
    assert_memory_equal(is.data, packets, len);
    free(before.data);
    free(las.data);
    free(is.data);
    unlink(wdp_path);
}

/* Any file can have the name X.wdp. Only a record of packets that is long enough belongs to X.las. */
static void test_foreign_wdp(void **state)
{
    (void)state;
    static uint8_t text[5000], zeros[100];
    struct bytes las = las_outside();
    const size_t first = (size_t)rig_uint(whole.data + 227, 8);
    const struct bytes packets = {whole.data + first, whole.len - first};
    struct repaired file;
    memset(text, '1', sizeof text);
    repair_write_file(repair_path, las.data, las.len);
    check_untouched(repair_path, wdp, text, sizeof text);
    check_untouched(repair_path, wdp, text, 91);
    check_untouched(repair_path, wdp, text, 1);
    check_untouched(repair_path, wdp, zeros, sizeof zeros);
    check_untouched(repair_path, wdp, packets.data, packets.len - 1); /* a piece of the right one */
    check_untouched(repair_path, wdp, packets.data, EVLR - 1);
    repair_write_file(wdp, packets.data, packets.len); /* the right one completes it */
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), 0);
    assert_true(file.was_whole);
    repair_free(&file);
    unlink(wdp);
    repair_write_file(wdp, "", 0); /* an empty one keeps the points alone */
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), 0);
    assert_int_equal(file.n_kept, 2 * N);
    repair_free(&file);
    unlink(repair_path);
    unlink(wdp);
    repair_write_file(repair_part, left.data, left.len);
    check_untouched(repair_part, wdp_part, text, sizeof text);
    unlink(repair_part);
    free(las.data);
}

/* The repair of .part fails, since its packets are not there, and changes nothing. */
static void check_not_there(const void *packets, size_t len)
{
    struct repaired file;
    assert_int_equal(repair_file(repair_part, NULL, &file, &repair_err), SH_EINPUT);
    assert_non_null(strstr(repair_err.text, wdp_part));
    assert_non_null(strstr(repair_err.text, "if it is of this recording"));
    const struct bytes is = repair_slurp(wdp);
    assert_int_equal(packets_len_of(repair_part), left.len);
    assert_int_equal(is.len, len);
    assert_memory_equal(is.data, packets, len);
    free(is.data);
}

/* X.wdp of an older recording is not that of X.las.part. It is that of a .part that is complete, or whose repair was
 * interrupted. */
static void test_older_wdp(void **state)
{
    (void)state;
    struct bytes las = las_outside();
    const uint8_t *packets = whole.data + rig_uint(whole.data + 227, 8);
    const size_t len = whole.len - (size_t)rig_uint(whole.data + 227, 8);
    struct repaired file;
    repair_write_file(wdp, packets, len);
    repair_write_file(repair_part, left.data, left.len);
    check_not_there(packets, len); /* also where X.las was removed */
    repair_write_file(repair_path, las.data, las.len);
    check_not_there(packets, len);
    memcpy(las.data + 58, "scanhead, its end is missing", 29);
    repair_write_file(repair_part, las.data, left.len);
    check_not_there(packets, len);
    unlink(repair_path); /* an interrupted repair found this name free */
    assert_int_equal(repair_file(repair_part, NULL, &file, &repair_err), 0);
    assert_int_equal(file.n_kept, 2 * N);
    repair_free(&file);
    memset(las.data + 58, 0, 32);
    memcpy(las.data + 58, "scanhead", 8);
    repair_write_file(repair_part, las.data, las.len); /* killed as it was renamed, with the older file still there */
    assert_int_equal(repair_file(repair_part, NULL, &file, &repair_err), 0);
    assert_true(file.was_whole && file.is_part);
    repair_free(&file);
    unlink(repair_path);
    unlink(repair_part);
    unlink(wdp);
    free(las.data);
}

/* The packets of an older recording: `more` packets more or fewer than those of this one, and a length that is right.
 * The last sample is less than 256, as most of 16 bits are, so the file ends in a zero byte. */
static struct bytes older_packets(int more)
{
    const size_t first = (size_t)rig_uint(whole.data + 227, 8), n = whole.len - first;
    struct bytes b = {calloc(1, n + 8 * PACKET), n + (size_t)(8 + more) * PACKET - 8 * PACKET};
    memcpy(b.data, whole.data + first, b.len < n ? b.len : n);
    for (size_t i = n; i < b.len; i++)
        b.data[i] = 7;
    b.data[b.len - 1] = 0;
    put_int(&b, 20, b.len - EVLR, 8);
    return b;
}

/* The header counts the points, before the packets are copied or when all is complete. X.las.part is left alone then,
 * with X.wdp of an older recording beside it: no byte of either changes, though zeros are at X.wdp's end. */
static void test_older_wdp_of_another_length(void **state)
{
    (void)state;
    for (int is_complete = 0; is_complete < 2; is_complete++)
        for (int more = -3; more <= 3; more++) {
            struct bytes las = las_outside(), packets = older_packets(more);
            if (!is_complete) memcpy(las.data + 58, "scanhead, its end is missing", 29);
            repair_write_file(repair_part, las.data, las.len);
            if (more != 0) check_untouched(repair_part, wdp, packets.data, packets.len);
            /* Fewer points need fewer packets: then one of the same length is longer than they need. */
            las.len -= POINT;
            repair_write_file(repair_part, las.data, las.len);
            if (more >= 0) check_untouched(repair_part, wdp, packets.data, packets.len);
            unlink(repair_part);
            free(las.data);
            free(packets.data);
        }
}

/* A repair that is interrupted between its two renames leaves X.las.part and X.wdp, and goes on where it was: also
 * where X.wdp.part was completed, and has packets for points that were lost. */
static void test_interrupted(void **state)
{
    (void)state;
    for (size_t lost = 0; lost < 3; lost++) {
        struct bytes las = las_outside(), packets = older_packets(0);
        struct repaired file;
        las.len = left.len - lost * POINT;
        memcpy(las.data, left.data, packets_front_of(&left));
        repair_write_file(repair_part, las.data, las.len);
        repair_write_file(wdp_part, packets.data, packets.len);
        assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), 0);
        assert_int_equal(file.n_kept, 2 * N - lost);
        repair_free(&file);
        assert_int_equal(packets_len_of(wdp), packets.len - lost * PACKET);
        assert_int_equal(rename(repair_path, repair_part), 0);
        if (repair_file(repair_path, NULL, &file, &repair_err) != 0) fail_msg("%s", repair_err.text);
        assert_true(file.was_whole && file.n_kept == 2 * N - lost);
        repair_free(&file);
        unlink(repair_path);
        unlink(wdp);
        free(las.data);
        free(packets.data);
    }
}

/* Both .part files were given their final names by hand. They are repaired as before: zeros at the end of X.wdp are
 * those of a power cut, and points without packets say so. */
static void test_renamed_by_hand(void **state)
{
    (void)state;
    for (size_t n_zeros = 0; n_zeros <= 512; n_zeros += 512) {
        const size_t len = left_wdp.len - 5 * PACKET - 3;
        struct bytes packets = {calloc(1, len + n_zeros), len + n_zeros};
        struct repaired file;
        memcpy(packets.data, left_wdp.data, len);
        repair_write_file(repair_path, left.data, left.len);
        repair_write_file(wdp, packets.data, packets.len);
        if (repair_file(repair_path, NULL, &file, &repair_err) != 0) fail_msg("%s", repair_err.text);
        assert_true(!file.was_whole && file.n_kept == 2 * N);
        repair_free(&file);
        assert_int_equal(packets_len_of(wdp), left_wdp.len - 6 * PACKET);
        if (repair_file(repair_path, NULL, &file, &repair_err) != 0) fail_msg("%s", repair_err.text);
        assert_true(file.was_whole);
        repair_free(&file);
        unlink(repair_path);
        unlink(wdp);
        free(packets.data);
    }
}

static int points_were_first;

static void note_sync(int fd)
{
    char link_name[40], name[300] = "";
    snprintf(link_name, sizeof link_name, "/proc/self/fd/%d", fd);
    if (readlink(link_name, name, sizeof name - 1) < 0) return;
    if (strcmp(name, repair_part) == 0 && access(wdp, F_OK) != 0) points_were_first = 1;
}

/* A power cut may come after any rename. Then the header of X.las.part must be on the disk already: it says that X.wdp
 * is its own. */
static void test_points_are_synced_first(void **state)
{
    (void)state;
    struct repaired file;
    repair_at_sync = note_sync;
    packets_put_stream(2, N_SAMPLES);
    assert_int_equal(rig_record(repair_path, (struct recorder_options){.las_wdp = 1}, RIG_KEEP, &repair_err), 0);
    assert_int_equal(points_were_first, 1);
    unlink(repair_path);
    unlink(wdp);
    points_were_first = 0;
    repair_write_file(repair_part, left.data, left.len);
    repair_write_file(wdp_part, left_wdp.data, left_wdp.len);
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), 0);
    assert_int_equal(points_were_first, 1);
    repair_at_sync = NULL;
    repair_free(&file);
    unlink(repair_path);
    unlink(wdp);
}

/* The record inside a .las has a head, too. */
static void test_foreign_inside(void **state)
{
    (void)state;
    struct repaired file;
    struct bytes las = {malloc(whole.len), whole.len};
    memcpy(las.data, whole.data, whole.len);
    const size_t first = (size_t)rig_uint(whole.data + 227, 8);
    char want[80];
    las.data[first + 2] = 'l';
    repair_write_file(repair_path, las.data, las.len);
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), SH_EFORMAT);
    snprintf(want, sizeof want, "is damaged at byte %zu", first);
    assert_non_null(strstr(repair_err.text, want));
    unlink(repair_path);
    free(las.data);
}

/* n bytes of the packets are there, and then zeros. Each packet that is kept has its samples. That is one packet less
 * than without zeros at most: its last sample may be zero. */
static void check_zeros(size_t n, size_t n_zeros)
{
    struct repaired file;
    struct bytes cut = {calloc(1, n + n_zeros), n + n_zeros};
    const size_t whole_ones = n < EVLR ? 0 : (n - EVLR) / PACKET, front = packets_front_of(&whole);
    const uint8_t *samples = whole.data + rig_uint(whole.data + 227, 8);
    size_t with = 0;
    memcpy(cut.data, left_wdp.data, n);
    repair_write_file(repair_part, left.data, left.len);
    repair_write_file(wdp_part, cut.data, cut.len);
    if (repair_file(repair_path, NULL, &file, &repair_err) != 0)
        fail_msg("%zu and %zu: %s", n, n_zeros, repair_err.text);
    assert_int_equal(file.n_kept, 2 * N);
    repair_free(&file);
    const struct bytes las = repair_slurp(repair_path);
    const int has_packets = (rig_uint(las.data + 6, 2) & 1 << 2) != 0;
    while (with < 2 * N && las.data[front + with * POINT + WAVE_AT] != 0)
        with++;
    for (size_t i = with; i < 2 * N; i++)
        assert_int_equal(las.data[front + i * POINT + WAVE_AT], 0);
    if (with + 1 < whole_ones || with > whole_ones + 1) fail_msg("%zu and %zu: %zu packets", n, n_zeros, with);
    assert_int_equal(has_packets, access(wdp, F_OK) == 0);
    if (has_packets) {
        const struct bytes got = repair_slurp(wdp);
        assert_int_equal(got.len, EVLR + with * PACKET);
        if (memcmp(got.data + EVLR, samples + EVLR, with * PACKET) != 0) fail_msg("%zu and %zu: zeros", n, n_zeros);
        free(got.data);
        unlink(wdp);
    } else {
        assert_int_equal(with, 0);
    }
    free(las.data);
    free(cut.data);
    unlink(repair_path);
}

static void test_zeros(void **state)
{
    (void)state;
    for (size_t missing = 0; missing < 3 * PACKET; missing++)
        check_zeros(left_wdp.len - missing, missing % 2 ? 200 : 4096);
    for (size_t n = 0; n <= EVLR + PACKET; n += 7) /* also within the head */
        check_zeros(n, left_wdp.len - n);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_foreign_wdp),
        cmocka_unit_test(test_foreign_inside),
        cmocka_unit_test(test_older_wdp),
        cmocka_unit_test(test_older_wdp_of_another_length),
        cmocka_unit_test(test_interrupted),
        cmocka_unit_test(test_renamed_by_hand),
        cmocka_unit_test(test_points_are_synced_first),
        cmocka_unit_test(test_zeros),
    };
    return cmocka_run_group_tests(tests, packets_set_up, packets_tear_down);
}
