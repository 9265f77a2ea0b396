/* SPDX-License-Identifier: MIT */
/* A kill or a full disk leaves a LAS file with waveforms cut anywhere. The repair keeps whole points and whole packets.
 * Points without their packets say so. */
#include <sys/stat.h>

#include "tests/unit/las_packets_rig.h"

enum { LINES = 400 };

static char said[400];

static void hear(void *ctx, const char *words)
{
    (void)ctx;
    if (strstr(words, "no waveform") != NULL) snprintf(said, sizeof said, "%s", words);
}

/* The repair counts points that lost their packets, where there are any. */
static void check_said(size_t n_points, size_t n_packets)
{
    char lost[80];
    snprintf(lost, sizeof lost, " %zu points have no waveform: ", n_points - n_packets);
    if (n_packets >= n_points ? said[0] != '\0' : strstr(said, lost) == NULL) fail_msg("'%s', not '%s'", said, lost);
}

/* n_points points are whole in the .las. Only the first n_packets of them have a whole packet in the .wdp. */
static void check(size_t n_points, size_t n_packets)
{
    static const uint8_t none[29];
    const int has_packets = access(wdp, F_OK) == 0;
    struct bytes got = repair_slurp(repair_path), packets = has_packets ? repair_slurp(wdp) : (struct bytes){NULL, 0};
    const size_t front = packets_front_of(&whole);
    const uint64_t first = rig_uint(whole.data + 227, 8);
    if (n_packets > n_points) n_packets = n_points;
    assert_int_equal(got.len, front + n_points * POINT);
    assert_int_equal(rig_uint(got.data + 247, 8), n_points);
    assert_int_equal(rig_uint(got.data + 6, 2), 1 << 4 | has_packets << 2);
    assert_int_equal(rig_uint(got.data + 227, 8), 0);
    assert_string_equal((char *)got.data + 58, "scanhead, its end is missing");
    for (size_t i = 0; i < n_points; i++) {
        const uint8_t *is = got.data + front + i * POINT, *was = whole.data + front + i * POINT;
        assert_memory_equal(is, was, WAVE_AT);
        assert_memory_equal(is + WAVE_AT, i < n_packets ? was + WAVE_AT : none, 29);
    }
    if (has_packets) {
        assert_int_equal(packets.len, EVLR + n_packets * PACKET);
        assert_int_equal(rig_uint(packets.data + 20, 8), n_packets * PACKET);
        assert_memory_equal(packets.data + EVLR, whole.data + first + EVLR, n_packets * PACKET);
    }
    free(got.data);
    free(packets.data);
}

static void repair_cut_to(size_t las_len, size_t wdp_len)
{
    static const struct sh_report report = {.warn = hear};
    struct repaired file;
    repair_write_file(repair_part, left.data, las_len);
    repair_write_file(wdp_part, left_wdp.data, wdp_len);
    said[0] = '\0';
    if (repair_file(repair_path, &report, &file, &repair_err) != 0) fail_msg("%s", repair_err.text);
    assert_true(file.was_left);
    repair_free(&file);
    assert_int_equal(access(wdp_part, F_OK), -1);
    assert_int_equal(access(repair_part, F_OK), -1);
}

static void test_cut(void **state)
{
    (void)state;
    const size_t front = packets_front_of(&left), n = 2 * N;
    assert_int_equal(left.len, front + n * POINT);
    assert_int_equal(left_wdp.len, EVLR + n * PACKET);
    assert_int_equal(packets_front_of(&whole), front); /* with the descriptors of all packets that are there */
    assert_int_equal(rig_uint(left.data + 100, 4), rig_uint(whole.data + 100, 4));
    assert_memory_equal(left.data + 375, whole.data + 375, front - 375);
    for (size_t cut = 0; cut < 40; cut++) {
        const size_t las_len = front + (cut * 977) % (n * POINT + 1), wdp_len = (cut * 613) % (left_wdp.len + 1);
        struct repaired again;
        repair_cut_to(las_len, wdp_len);
        check((las_len - front) / POINT, wdp_len < EVLR ? 0 : (wdp_len - EVLR) / PACKET);
        check_said((las_len - front) / POINT, wdp_len < EVLR ? 0 : (wdp_len - EVLR) / PACKET);
        assert_int_equal(access(wdp, F_OK) == 0, wdp_len >= EVLR);
        if (repair_file(repair_path, NULL, &again, &repair_err) != 0) fail_msg("%s", repair_err.text);
        if (!again.was_whole) fail_msg("cut to %zu and %zu: the repaired file is not whole", las_len, wdp_len);
        repair_free(&again);
        unlink(repair_path);
        unlink(wdp);
    }
}

/* A kill while the packets were copied: the points are counted, and the copy is cut off. */
static void test_cut_copy(void **state)
{
    (void)state;
    const size_t front = packets_front_of(&left), n = 2 * N, half = whole.len - 5 * PACKET - 3;
    struct repaired file;
    repair_write_file(repair_part, whole.data, half);
    FILE *part = fopen(repair_part, "r+b");
    fwrite(left.data, 1, 375, part); /* the header of before, with the counts */
    fseek(part, 247, SEEK_SET);
    fwrite(whole.data + 247, 1, 128, part);
    fclose(part);
    repair_write_file(wdp_part, left_wdp.data, left_wdp.len);
    if (repair_file(repair_path, NULL, &file, &repair_err) != 0) fail_msg("%s", repair_err.text);
    assert_int_equal(file.n_kept, n);
    assert_int_equal(file.cut_bytes, half - front - n * POINT);
    repair_free(&file);
    check(n, n);
    unlink(repair_path);
    unlink(wdp);
}

/* A completed file, cut in the packets by a copy, keeps the packets that are whole in it. */
static void test_cut_inside(void **state)
{
    (void)state;
    const size_t first = (size_t)rig_uint(whole.data + 227, 8), n = 2 * N;
    for (size_t n_bytes = 0; n_bytes < whole.len - first; n_bytes += 59) {
        struct repaired file;
        const size_t packets = n_bytes < EVLR ? 0 : (n_bytes - EVLR) / PACKET;
        repair_write_file(repair_path, whole.data, first + n_bytes);
        if (repair_file(repair_path, NULL, &file, &repair_err) != 0) fail_msg("%s", repair_err.text);
        assert_int_equal(file.n_kept, n);
        assert_false(file.was_whole);
        repair_free(&file);
        struct bytes got = repair_slurp(repair_path);
        assert_int_equal(got.len, first + (n_bytes < EVLR ? 0 : EVLR + packets * PACKET));
        assert_int_equal(rig_uint(got.data + 6, 2), 1 << 4 | (n_bytes < EVLR ? 0 : 1 << 1));
        if (n_bytes >= EVLR) assert_int_equal(rig_uint(got.data + first + 20, 8), packets * PACKET);
        for (size_t i = 0; i < n; i++)
            assert_int_equal(got.data[packets_front_of(&got) + i * POINT + WAVE_AT] != 0, i < packets);
        free(got.data);
        if (repair_file(repair_path, NULL, &file, &repair_err) != 0) fail_msg("%s", repair_err.text);
        assert_true(file.was_whole);
        repair_free(&file);
    }
    for (int length_is_wrong = 1; length_is_wrong >= 0; length_is_wrong--) { /* round 2: it is repaired */
        struct repaired file;
        if (length_is_wrong) {
            repair_write_file(repair_path, whole.data, whole.len);
            FILE *f = fopen(repair_path, "r+b");
            fseek(f, (long)first + 20, SEEK_SET);
            fputc(0, f);
            fclose(f);
        }
        assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), 0);
        assert_int_equal(file.was_whole, !length_is_wrong);
        repair_free(&file);
    }
    struct bytes got = repair_slurp(repair_path);
    assert_int_equal(rig_uint(got.data + first + 20, 8), whole.len - first - EVLR);
    free(got.data);
    unlink(repair_path);
}

/* Packets that are not there, or whose name is taken: nothing is changed, and the error says what to do. */
static void test_refused(void **state)
{
    (void)state;
    struct repaired file;
    repair_write_file(repair_part, left.data, left.len);
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), SH_EINPUT);
    char want[700];
    snprintf(
        want, sizeof want,
        "%s: its waveforms are not there: put %s beside it; or an empty file of that name, to keep the points alone",
        repair_part, wdp_part);
    assert_string_equal(repair_err.text, want);
    assert_true(fcntl(STDOUT_FILENO, F_GETFD) >= 0); /* only what the repair has opened is closed */
    repair_write_file(wdp_part, left_wdp.data, left_wdp.len);
    repair_write_file(wdp, "other", 5);
    assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), SH_ESTATE);
    snprintf(want, sizeof want, "%s: %s exists, and is not replaced; move it away, and repeat the command", wdp_part,
             wdp);
    assert_string_equal(repair_err.text, want);
    assert_true(fcntl(STDOUT_FILENO, F_GETFD) >= 0);
    assert_int_equal(packets_len_of(wdp_part), left_wdp.len);
    assert_int_equal(packets_len_of(repair_part), left.len);
    unlink(wdp);
    /* Beside another FILE both parts keep their names. */
    repair_write_file(repair_path, "", 0);
    assert_int_equal(repair_file(repair_part, NULL, &file, &repair_err), 0);
    assert_true(file.is_part);
    repair_free(&file);
    assert_int_equal(access(wdp, F_OK), -1);
    assert_int_equal(packets_len_of(wdp_part), left_wdp.len);
    unlink(repair_path);
    unlink(repair_part);
    unlink(wdp_part);
    /* A record that begins within a point, and one that is both inside and outside. */
    for (int i = 0; i < 2; i++) {
        struct bytes wrong = {malloc(whole.len), whole.len};
        memcpy(wrong.data, whole.data, whole.len);
        wrong.data[i == 0 ? 227 : 6] ^= i == 0 ? 1 : 1 << 2;
        repair_write_file(repair_path, wrong.data, wrong.len);
        assert_int_equal(repair_file(repair_path, NULL, &file, &repair_err), SH_EFORMAT);
        assert_non_null(strstr(repair_err.text, "is damaged at byte 227"));
        assert_int_equal(packets_len_of(repair_path), wrong.len);
        free(wrong.data);
        unlink(repair_path);
    }
}

/* A limit on the files' size stands for a full disk. The rest is repaired: so many points, so many of them with
 * packets. */
static void check_full(rlim_t size, uint16_t n_samples, const char *names, size_t n_points, size_t n_packets)
{
    struct sh_err err = {0};
    struct rlimit old, small;
    struct repaired file;
    void (*was)(int) = signal(SIGXFSZ, SIG_IGN);
    packets_put_stream(LINES, n_samples);
    fclose(rig_stream);
    rig_stream = NULL;
    getrlimit(RLIMIT_FSIZE, &old);
    small = (struct rlimit){size, old.rlim_max};
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    const int rc = rig_record(repair_path, (struct recorder_options){0}, RIG_KEEP_ALWAYS, &err);
    setrlimit(RLIMIT_FSIZE, &old);
    signal(SIGXFSZ, was);
    assert_int_equal(rc, SH_EIO);
    assert_non_null(strstr(err.text, names));
    assert_non_null(strstr(rig_notes, "--repair"));
    assert_int_equal(access(repair_path, F_OK) | access(wdp, F_OK), -1);
    if (repair_file(repair_path, NULL, &file, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(file.n_kept, n_points);
    repair_free(&file);
    struct bytes got = repair_slurp(repair_path);
    size_t with = 0;
    while (with < n_points && got.data[packets_front_of(&got) + with * POINT + WAVE_AT] != 0)
        with++;
    assert_int_equal(with, n_packets);
    assert_int_equal(packets_len_of(wdp), EVLR + n_packets * 2 * n_samples);
    free(got.data);
    unlink(repair_path);
    unlink(wdp);
}

/* A packet of 60 samples is longer than a point, so packets find no room first. Points that fit are kept. */
static void test_disk_full(void **state)
{
    (void)state;
    check_full(100000, 60, "a.wdp", (100000 - packets_front_of(&left)) / POINT, (100000 - EVLR) / 120);
}

/* Only the copy of the packets has no room: all is kept, in two files. */
static void test_no_room_for_copy(void **state)
{
    (void)state;
    const rlim_t size = packets_front_of(&left) + (rlim_t)LINES * N * POINT + 5000;
    assert_true(EVLR + (rlim_t)LINES * N * PACKET < size);
    check_full(size, N_SAMPLES, "a.las", LINES * N, LINES * N);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cut),     cmocka_unit_test(test_cut_copy),  cmocka_unit_test(test_cut_inside),
        cmocka_unit_test(test_refused), cmocka_unit_test(test_disk_full), cmocka_unit_test(test_no_room_for_copy),
    };
    return cmocka_run_group_tests(tests, packets_set_up, packets_tear_down);
}
