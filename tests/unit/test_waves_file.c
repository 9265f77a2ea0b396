/* SPDX-License-Identifier: MIT */
/* A .waves.csv has a row for each window, from which its samples' places and signals are computed. The tests check
 * these, and its repair. */
#include "tests/unit/repair_rig.h"
#include "tests/unit/waves_rig.h"

static const char TITLE[] = "scan,station,pulse,t_s,range_m,step_m,n,baseline,count_signal,dx,dy,dz,samples\n";
static const struct rig_digitiser d = {1000, 205 * 16 + 8, 12, 0.0625f, 0};

/* Two pulses of which only the first has an echo; mirror and pan of the second: 30 and 90 degrees of 3600 counts. */
static void put_stream(int geo)
{
    static const struct rig_point p[] = {{5000, 0, 0, 0, 1, 1, 1}, {0, 0, 0, INT16_MIN, 0xffff, 0, 0}};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 7);
    const struct rig_window w[] = {
        {0, 30, 3, {0, 0, 0}},
        {1,
         200,
         2,
         {geo ? rig_float_bits(0.5f) : 0, geo ? rig_float_bits(-0.25f) : 300, geo ? rig_float_bits(0.125f) : 900}}};
    rig_begin();
    rig_wave_descriptor(geo, 1, 4);
    rig_anchor(&a);
    rig_points(0, 0, 0, p, 2);
    rig_waves(0, 0, &d, w, 2);
}

static struct bytes record(const char *name)
{
    if (rig_record(rig_path(name), (struct recorder_options){0}, 1, &repair_err) != 0) fail_msg("%s", repair_err.text);
    struct bytes b = repair_slurp(rig_path(name));
    unlink(rig_path(name));
    return b;
}

static void test_rows(void **state)
{
    (void)state;
    for (int geo = 0; geo < 2; geo++) {
        put_stream(geo);
        struct bytes b = record("a.waves.csv");
        char want[512];
        /* range: 30 and 200 times the step of 0.149896229 m; direction: forward, then 30 degrees up, to the right */
        snprintf(want, sizeof want,
                 "%s1,7,0,0.000000000,4.49688687,0.149896229,3,205.5,0.0625,%s,%u %u %u\n"
                 "1,7,1,0.001000000,29.9792458,0.149896229,2,205.5,0.0625,%s,%u %u\n",
                 TITLE, geo ? "0,0,0" : "0,1,0", rig_sample(&d, 0, 30), rig_sample(&d, 0, 31), rig_sample(&d, 0, 32),
                 geo ? "0.5,-0.25,0.125" : "0.866025404,5.30287619e-17,0.5", rig_sample(&d, 1, 200),
                 rig_sample(&d, 1, 201));
        assert_string_equal((const char *)b.data, want);
        free(b.data);
    }
}

/* A head that has no waveforms: the title alone, and a note. */
static void test_none(void **state)
{
    (void)state;
    static const struct rig_point p = {5000, 0, 0, 0, 1, 1, 1};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 7);
    for (uint32_t content = 0; content <= 4; content += 4) {
        rig_begin();
        rig_wave_descriptor(0, 1, content);
        rig_anchor(&a);
        rig_points(0, 0, 0, &p, 1);
        struct bytes b = record("a.waves.csv");
        assert_string_equal((const char *)b.data, TITLE);
        assert_int_equal(strstr(rig_notes, "the head sends none (waveform.send)") != NULL, content == 0);
        free(b.data);
    }
}

/* Without waveforms there is the title; windows without points are counted, and so is one sample that was lost. */
static void test_without(void **state)
{
    (void)state;
    const struct rig_window w = {0, 30, 3, {0, 0, 0}};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 7);
    rig_begin();
    rig_wave_descriptor(0, 1, 4);
    rig_anchor(&a);
    struct rig_digitiser full = d;
    full.n_lost = 1;
    rig_waves(0, 0, &full, &w, 1);
    struct bytes b = record("a.waves.csv");
    assert_string_equal((const char *)b.data, TITLE);
    assert_non_null(strstr(rig_notes, "1 samples of waveforms that found no room in the head"));
    assert_non_null(strstr(rig_notes, "1 waveforms left out whose points were lost"));
    assert_null(strstr(rig_notes, "the head sends none"));
    free(b.data);
}

/* The anchor of a scan is lost: until it is repeated, no file may count the scan's windows as those of the scan before,
 * or as a kind that it has no place for. */
static void test_lost_anchor(void **state)
{
    (void)state;
    static const struct rig_point p = {5000, 0, 0, 0, 1, 1, 1};
    static const struct rig_window w = {0, 30, 3, {0, 0, 0}};
    static const char *const names[] = {"a.waves.csv", "a.las"};
    for (size_t i = 0; i < 2; i++) {
        struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 7);
        rig_begin();
        for (uint32_t scan = 1; scan <= 2; scan++) {
            rig_wave_descriptor(0, scan, 4);
            rig_points(0, 0, 0, &p, 1);
            rig_waves(0, 0, &d, &w, 1);
            a.station = 6 + scan;
            rig_anchor(&a);
            rig_points(0, 0, 5, &p, 1);
            rig_waves(0, 5, &d, &w, 1);
        }
        struct bytes b = record(names[i]);
        assert_non_null(strstr(rig_notes, i == 0 ? "2 waveforms left out whose points were lost"
                                                 : "1 waveforms left out whose points were lost"));
        assert_null(strstr(rig_notes, "has no place for them, allowed"));
        if (i == 0) {
            const char *row = strchr((const char *)b.data, '\n') + 1;
            assert_int_equal(strncmp(row, "1,7,5,0.005", 11), 0);
            row = strchr(row, '\n') + 1;
            assert_int_equal(strncmp(row, "2,8,5,0.005", 11), 0);
            assert_null(strchr(strchr(row, '\n') + 1, '\n'));
        }
        free(b.data);
    }
}

static void test_repair(void **state)
{
    (void)state;
    put_stream(0);
    struct bytes b = record("a.waves.csv");
    repair_name("a.waves.csv");
    for (size_t len = sizeof TITLE - 1; len <= b.len; len++) {
        struct repaired file;
        char *end = (char *)b.data + len;
        uint64_t rows = 0;
        repair_write_file(repair_part, b.data, len);
        while (end[-1] != '\n')
            end--;
        for (const char *at = (char *)b.data; at < end; at++)
            rows += *at == '\n';
        if (repair_file(repair_path, NULL, &file, &repair_err) != 0) fail_msg("%s", repair_err.text);
        assert_int_equal(file.n_kept, rows - 1);
        assert_string_equal(file.unit, "waveforms");
        repair_free(&file);
        struct bytes got = repair_slurp(repair_path);
        assert_memory_equal(got.data, b.data, (size_t)(end - (char *)b.data));
        assert_memory_equal(got.data + (end - (char *)b.data), "# incomplete", 12);
        free(got.data);
        unlink(repair_path);
    }
    free(b.data);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rows),        cmocka_unit_test(test_none),   cmocka_unit_test(test_without),
        cmocka_unit_test(test_lost_anchor), cmocka_unit_test(test_repair),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
