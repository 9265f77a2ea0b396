/* SPDX-License-Identifier: MIT */
/* Waveforms in LAS files are at the offsets of the ASPRS specification (LAS 1.4 R15): point formats 9 and 10, wave
 * packet descriptors, and the record of packets, inside or as a .wdp. */
#include "tests/unit/waves_rig.h"

enum { HEADER = 375, VLR = 54, EVLR = 60, WAVE = 29, DESCRIPTOR = 26 };

static uint8_t *las, *wdp;
static size_t las_len, wdp_len;

/* With a .wdp beside it, `wdp` has its bytes, else those of the record in the file. */
static void record(struct recorder_options options)
{
    free(las);
    free(wdp);
    wdp = NULL;
    las = rig_record_bytes("a.las", options, &las_len);
    if (access(rig_path("a.wdp"), F_OK) == 0) wdp = rig_take("a.wdp", &wdp_len);
}

static const uint8_t *point_at(size_t i)
{
    return las + rig_uint(las + 96, 4) + i * rig_uint(las + 105, 2);
}

/* Where the waveform's fields are in a point's record: format 9 has them behind the GPS time, 10 behind the colours. */
static const uint8_t *wave_at(size_t i)
{
    return point_at(i) + (las[104] == 9 ? 30 : 38);
}

/* Returns the descriptor with this index, from 1 on, whose record id is 99 + index. */
static const uint8_t *descriptor(unsigned index)
{
    size_t at = rig_uint(las + 94, 2);
    for (uint64_t i = 0; i < rig_uint(las + 100, 4); i++) {
        const uint8_t *vlr = las + at;
        const size_t len = (size_t)rig_uint(vlr + 20, 2);
        at += VLR + len;
        assert_true(at <= rig_uint(las + 96, 4));
        if (rig_uint(vlr + 18, 2) != 99 + index) continue;
        assert_string_equal((const char *)vlr + 2, "LASF_Spec");
        assert_int_equal(len, DESCRIPTOR);
        assert_int_equal(vlr[VLR + 1], 0); /* no compression */
        return vlr + VLR;
    }
    fail_msg("no descriptor %u", index);
    return NULL;
}

static uint32_t packet_sample(size_t i, uint32_t k)
{
    const uint8_t *w = wave_at(i), *packets = wdp != NULL ? wdp : las + rig_uint(las + 227, 8);
    const size_t bytes = descriptor(w[0])[0] / 8;
    return (uint32_t)rig_uint(packets + rig_uint(w + 1, 8) + k * bytes, (int)bytes);
}

/* Point i has the packet of that window of the pulse. */
static void check_packet(size_t i, const struct rig_digitiser *d, uint64_t pulse, uint32_t first, uint32_t n)
{
    const uint8_t *w = wave_at(i), *kind = descriptor(w[0]);
    assert_int_equal(kind[0], d->bits > 8 ? 16 : 8);
    assert_true(rig_uint(kind + 2, 4) >= n);
    assert_int_equal(rig_uint(w + 9, 4), rig_uint(kind + 2, 4) * (d->bits > 8 ? 2 : 1));
    assert_int_equal(rig_uint(kind + 6, 4), d->sample_ps);
    assert_true(rig_double(kind + 10) == (double)d->count_signal);
    assert_true(rig_double(kind + 18) == -(double)d->count_signal * d->baseline_16 / 16);
    for (uint32_t k = 0; k < rig_uint(kind + 2, 4); k++)
        assert_int_equal(packet_sample(i, k), k < n ? rig_sample(d, pulse, first + k) : d->baseline_16 / 16);
}

/* The specification puts the first sample at point + location * (dx, dy, dz). */
static void check_first(size_t i, const double want[3], const double tolerance[3])
{
    const uint8_t *p = point_at(i), *w = wave_at(i);
    for (int k = 0; k < 3; k++) {
        const double at = rig_int32(p + 4 * k) * rig_double(las + 131 + 8 * k) + rig_double(las + 155 + 8 * k);
        const double first = at + (double)rig_float(w + 13) * (double)rig_float(w + 17 + 4 * k);
        if (!(fabs(first - want[k]) <= tolerance[k])) fail_msg("axis %d: %.12g, not %.12g", k, first, want[k]);
    }
}

/* Six shots go forward, at (10, 20, 30) with heading 90: +x. Pulse 0: one return; 1: two in one window; 2: two in
 * two windows; 3: no return in its window; 4: an empty shot; 5: a return without window. */
static const struct rig_point points[] = {{5000, 0, 0, -1000, 1, 1, 1},       {6000, 0, 0, -1000, 2, 1, 2},
                                          {6500, 0, 0, -1000, 3, 2, 2},       {7000, 0, 0, -1000, 4, 1, 2},
                                          {9000, 0, 0, -1000, 5, 2, 2},       {1000, 0, 0, -1000, 6, 1, 1},
                                          {0, 0, 0, INT16_MIN, 0xffff, 0, 0}, {2000, 0, 0, -1000, 7, 1, 1}};
static const struct rig_window windows[] = {
    {0, 30, 8, {0, 0, 0}}, {1, 36, 12, {0, 0, 0}}, {2, 44, 7, {0, 0, 0}}, {2, 57, 8, {0, 0, 0}}, {3, 90, 8, {0, 0, 0}}};
enum { N_POINTS = 7, N_WINDOWS = sizeof windows / sizeof windows[0] };

static void put_polar(const struct rig_digitiser *d, uint32_t content)
{
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    rig_begin();
    rig_wave_descriptor(0, 1, content);
    rig_anchor(&a);
    rig_points(0, 0, 0, points, sizeof points / sizeof points[0]);
    if ((content & 4) == 0) return;
    rig_waves(0, 0, d, windows, 2); /* in two frames */
    rig_waves(0, 0, d, windows + 2, N_WINDOWS - 2);
}

static void check_points(const struct rig_digitiser *d)
{
    assert_int_equal(rig_uint(las + 247, 8), N_POINTS);
    check_packet(0, d, 0, 30, 8);
    check_packet(1, d, 1, 36, 12);
    check_packet(2, d, 1, 36, 12);
    assert_int_equal(rig_uint(wave_at(1) + 1, 8), rig_uint(wave_at(2) + 1, 8)); /* one packet */
    check_packet(3, d, 2, 44, 7);
    check_packet(4, d, 2, 57, 8);
    static const uint8_t none[WAVE];
    assert_memory_equal(wave_at(5), none, WAVE);
    assert_memory_equal(wave_at(6), none, WAVE);
    static const uint32_t first[5] = {30, 36, 36, 44, 57};
    static const int echo[5] = {0, 1, 2, 3, 4};
    for (int i = 0; i < 5; i++) {
        /* floats have 24 bits: 6e-8 of the location and of the step, of 4 m at most between point and sample */
        const double tolerance[3] = {1e-6, 1e-6, 1e-6}, step_m = RIG_C_M_S * 0.5e-12 * d->sample_ps;
        const double range_m = points[echo[i]].a / 1000.0;
        check_first((size_t)i, (double[]){10 + first[i] * step_m, 20, 30}, tolerance);
        const double location_ps = 2e12 * range_m / RIG_C_M_S - first[i] * (double)d->sample_ps;
        assert_true(fabs((double)rig_float(wave_at((size_t)i) + 13) - location_ps) < 1e-3);
    }
    assert_non_null(strstr(rig_notes, "1 waveforms left out without a point in them"));
    assert_non_null(strstr(rig_notes, "2 points without a waveform"));
}

static void check_record(const uint8_t *record, size_t len)
{
    assert_int_equal(rig_uint(record, 2), 0);
    assert_string_equal((const char *)record + 2, "LASF_Spec");
    assert_int_equal(rig_uint(record + 18, 2), 65535);
    assert_int_equal(rig_uint(record + 20, 8), len - EVLR);
}

static void test_inside(void **state)
{
    (void)state;
    put_polar(&rig_12_bits, 4);
    record((struct recorder_options){0});
    assert_null(wdp);
    assert_int_equal(las[25], 4);
    assert_int_equal(las[104], 9);
    assert_int_equal(rig_uint(las + 105, 2), 59 + 2);
    assert_int_equal(rig_uint(las + 6, 2), 1 << 4 | 1 << 1);
    const size_t end = (size_t)rig_uint(las + 96, 4) + N_POINTS * 61;
    assert_int_equal(rig_uint(las + 227, 8), end); /* the waveforms begin where the points end */
    assert_int_equal(rig_uint(las + 235, 8), end);
    assert_int_equal(rig_uint(las + 243, 4), 1);
    check_record(las + end, las_len - end);
    assert_string_equal((char *)las + 58, "scanhead");
    assert_int_equal(rig_uint(las + 100, 4), 2 + 3); /* text, extra bytes; three lengths */
    check_points(&rig_12_bits);
    assert_int_equal(las_len - end, EVLR + 2 * (8 + 12 + 7 + 8)); /* nothing else is in it */
    assert_int_equal(rig_uint(point_at(4) + 59, 2), 5);           /* the label */
    assert_int_equal(access(rig_path("a.wdp.part"), F_OK), -1);
}

static void test_outside(void **state)
{
    (void)state;
    put_polar(&rig_12_bits, 4);
    record((struct recorder_options){.las_wdp = 1});
    assert_non_null(wdp);
    assert_int_equal(rig_uint(las + 6, 2), 1 << 4 | 1 << 2);
    static const uint8_t zeros[20];
    assert_memory_equal(las + 227, zeros, 20);
    assert_int_equal(las_len, rig_uint(las + 96, 4) + N_POINTS * 61);
    check_record(wdp, wdp_len);
    check_points(&rig_12_bits);
}

/* Format 10 has colours and near infrared, which stays 0, before the waveform. */
static void test_colour(void **state)
{
    (void)state;
    uint8_t rgb[3];
    put_polar(&rig_12_bits, 4);
    record((struct recorder_options){.colour = {.given = 1, .scale.mode = COLOUR_LABEL}});
    assert_int_equal(las[104], 10);
    assert_int_equal(rig_uint(las + 105, 2), 67 + 2);
    check_points(&rig_12_bits);
    colour_number(5, rgb);
    for (int i = 0; i < 3; i++)
        assert_int_equal(rig_uint(point_at(4) + 30 + 2 * i, 2), rgb[i] * 257);
    assert_int_equal(rig_uint(point_at(4) + 36, 2), 0);
    assert_int_equal(rig_uint(point_at(4) + 67, 2), 5);
}

/* Samples of eight bits are bytes. */
static void test_8_bits(void **state)
{
    (void)state;
    static const struct rig_digitiser d = {1000, 13 * 16, 8, 0.25f, 0};
    put_polar(&d, 4);
    record((struct recorder_options){0});
    check_points(&d);
    assert_int_equal(las_len, rig_uint(las + 227, 8) + EVLR + 8 + 12 + 7 + 8);
}

/* A stream without waveforms is recorded as ever. Where a .wdp was asked for, a note says that there are none. */
static void test_none(void **state)
{
    (void)state;
    put_polar(&rig_12_bits, 0);
    record((struct recorder_options){.las_wdp = 1});
    assert_null(wdp);
    assert_int_equal(las[104], 6);
    assert_int_equal(rig_uint(las + 105, 2), 32);
    assert_int_equal(rig_uint(las + 6, 2), 1 << 4);
    assert_int_equal(las_len, rig_uint(las + 96, 4) + N_POINTS * 32);
    assert_non_null(strstr(rig_notes, "no .wdp is written: the head sends no waveforms"));
    assert_int_equal(access(rig_path("a.wdp.part"), F_OK), -1);
}

/* A .wdp that can't be written is refused before the first scan, and no file is made. */
static void test_no_wdp(void **state)
{
    (void)state;
    struct sh_err err = {0};
    char path[128];
    snprintf(path, sizeof path, "%s", rig_path("a.wdp"));
    assert_int_equal(symlink("elsewhere", path), 0);
    put_polar(&rig_12_bits, 0);
    assert_int_equal(rig_record(rig_path("a.las"), (struct recorder_options){.las_wdp = 1}, 1, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "a.wdp: is a symbolic link"));
    assert_int_equal(access(rig_path("a.las.part"), F_OK), -1);
    unlink(path);
}

/* A point lies 40 m along a beam, of which a metre changes the coordinates by per_m. The point and its range are each
 * wrong by half a count on an axis. The tolerance is a whole one. */
static void check_geo(const struct native_anchor *a, const double per_m[3], const double tolerance[3])
{
    const double range_m = 40, first_m = 0.5e-9 * RIG_C_M_S * 250;
    struct rig_window w = {0, 250, 40, {0, 0, 0}};
    struct rig_point p = {(int32_t)lrint(range_m * per_m[0] / tolerance[0]),
                          (int32_t)lrint(range_m * per_m[1] / tolerance[1]),
                          0,
                          0,
                          1,
                          1,
                          1};
    double first[3];
    for (int i = 0; i < 3; i++) {
        w.beam[i] = rig_float_bits((float)per_m[i]);
        first[i] = a->anchor[i] + first_m * per_m[i];
    }
    rig_begin();
    rig_wave_descriptor(1, 1, 4);
    rig_anchor(a);
    rig_points(0, 0, 0, &p, 1);
    rig_waves(0, 0, &rig_12_bits, &w, 1);
    record((struct recorder_options){0});
    check_packet(0, &rig_12_bits, 0, 250, 40);
    const int in_degrees = a->crs == NATIVE_CRS_GEODETIC; /* then x is the longitude */
    const double xyz[3] = {first[in_degrees], first[!in_degrees], first[2]};
    check_first(0, xyz, tolerance);
}

/* On the central meridian a metre of range is 0.9996 m of the grid. */
static void test_utm(void **state)
{
    (void)state;
    const struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    check_geo(&a, (double[]){0.6 * 0.9996, 0.8 * 0.9996, 0}, (double[]){1e-3, 1e-3, 1e-3});
}

/* The divisors are about the metres of a degree at 45 north. */
static void test_geodetic(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_GEODETIC, 4979, 1);
    const double anchor[3] = {45, 9, 400}, scale[3] = {1e-8, 1e-8, 1e-3};
    memcpy(a.anchor, anchor, sizeof anchor);
    memcpy(a.scale, scale, sizeof scale);
    check_geo(&a, (double[]){0.6 / 111132, 0.8 / 78847, 0}, scale);
}

/* A stream has more than 255 lengths. The first 128 are exact; later ones are rounded up and filled with as many
 * samples of 205 counts as are reported. The energy is that of the frames, since 205 counts are the baseline. */
static void test_lengths(void **state)
{
    (void)state;
    enum { N = 300 };
    static struct rig_point many[N];
    static struct rig_window window[N];
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    rig_begin();
    rig_wave_descriptor(0, 1, 4);
    rig_anchor(&a);
    for (uint32_t i = 0; i < N; i++) {
        many[i] = (struct rig_point){5000, 0, 0, 0, 1, 1, 1};
        window[i] = (struct rig_window){i, 30, (uint16_t)(4 + i), {0, 0, 0}};
    }
    rig_points(0, 0, 0, many, N);
    for (uint32_t i = 0; i < N; i += 30)
        rig_waves(0, 0, &rig_12_bits, window + i, 30);
    record((struct recorder_options){0});
    uint64_t n_filled = 0, n_fill = 0;
    double is = 0, want = 0;
    for (uint32_t i = 0; i < N; i++) {
        const uint32_t n = window[i].n, in_file = (uint32_t)rig_uint(descriptor(wave_at(i)[0]) + 2, 4);
        check_packet(i, &rig_12_bits, i, 30, n);
        if (i < 128) assert_int_equal(in_file, n);
        assert_true(4 * (in_file - n) <= n); /* four steps an octave: a quarter at most */
        n_filled += in_file > n;
        n_fill += in_file - n;
        for (uint32_t k = 0; k < in_file; k++)
            is += rig_double(descriptor(wave_at(i)[0]) + 10) * packet_sample(i, k) +
                  rig_double(descriptor(wave_at(i)[0]) + 18);
        for (uint32_t k = 0; k < n; k++)
            want += 0.0625 * (rig_sample(&rig_12_bits, i, 30 + k) - 205.0);
    }
    assert_true(fabs(is - want) < 1e-9 * fabs(want)); /* sums of small fractions: exact but for rounding */
    char note[160];
    assert_true(n_filled > 0);
    snprintf(note, sizeof note, "%llu waveforms filled up with %llu samples without light",
             (unsigned long long)n_filled, (unsigned long long)n_fill);
    assert_non_null(strstr(rig_notes, note));
    assert_true(rig_uint(las + 100, 4) <= 2 + 255);
}

/* Windows wait until those of their last point have come. Meanwhile so much comes that the client's memory of frames is
 * used anew. */
static void test_long_wait(void **state)
{
    (void)state;
    put_polar(&rig_12_bits, 4);
    for (int i = 0; i < 40; i++)
        rig_waves(0, 0, &rig_12_bits, &(struct rig_window){5, 1000, 4000, {0, 0, 0}}, 1);
    record((struct recorder_options){0});
    check_packet(0, &rig_12_bits, 0, 30, 8);
    check_packet(1, &rig_12_bits, 1, 36, 12);
    check_packet(4, &rig_12_bits, 2, 57, 8);
    assert_non_null(strstr(rig_notes, "41 waveforms left out without a point in them"));
}

/* Formats without a place for waveforms say so. Lost samples and windows are counted. */
static void test_unheld(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        struct recorder_options options;
        const char *note;
    } cases[] = {{"a.ply", {0}, "5 waveforms left out; this format has no place for them"},
                 {"a.e57", {0}, "5 waveforms left out; this format has no place for them"},
                 {"a.ptx", {0}, "5 waveforms left out; this format has no place for them"},
                 {"a.las", {.las_minor = 2}, "5 points whose waveforms are left out; LAS 1.2"},
                 {"a.las", {0}, "42 samples of waveforms that found no room in the head"}};
    struct rig_digitiser d = rig_12_bits;
    d.n_lost = 21; /* of each frame */
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct sh_err err = {0};
        put_polar(&d, 4);
        if (rig_record(rig_path(cases[i].name), cases[i].options, 1, &err) != 0) fail_msg("%s", err.text);
        if (strstr(rig_notes, cases[i].note) == NULL) fail_msg("%s: %s", cases[i].name, rig_notes);
        unlink(rig_path(cases[i].name));
    }
    /* The points of a frame of waveforms are lost. */
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    rig_begin();
    rig_wave_descriptor(0, 1, 4);
    rig_anchor(&a);
    rig_points(0, 0, 0, points, 1);
    rig_waves(0, 5, &rig_12_bits, windows, 1);
    record((struct recorder_options){0});
    assert_non_null(strstr(rig_notes, "1 waveforms left out whose points were lost"));
    assert_non_null(strstr(rig_notes, "1 points without a waveform"));
}

/* A head that goes along y by 1 m/s fires 2 ms after the scan's start, 5 m along x. Where its ranges are not known, its
 * points have no waveform. */
static void test_moving(void **state)
{
    (void)state;
    static uint8_t out[1024];
    static const double unit[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    const struct native_pose pose[2] = {{.position_m = {10, 20, 30}, .quat = {1, 0, 0, 0}},
                                        {.t_ns = 1000000000, .position_m = {10, 21, 30}, .quat = {1, 0, 0, 0}}};
    for (int kind = 0; kind < 4; kind++) { /* polar; geo, local; geo, UTM; geo, local, without poses */
        struct native_anchor a = rig_anchor_of(kind == 2 ? NATIVE_CRS_UTM : NATIVE_CRS_LOCAL, kind == 2 ? 32632 : 0, 1);
        const struct rig_point empty = {0, 0, 0, INT16_MIN, 0xffff, 0, 0}, polar = {5000, 0, 900, 0, 1, 1, 1};
        const struct rig_point geo = {5000, 2, 0, 0, 1, 1, 1}; /* from the anchor, which is where the way begins */
        const struct rig_window w = {2, 30, 8, {kind > 0 ? rig_float_bits(1) : 0, 0, 0}};
        a.moving = NATIVE_MOVING;
        memcpy(a.anchor, pose[0].position_m, sizeof a.anchor);
        memcpy(a.rotation, unit, sizeof unit);
        rig_begin();
        rig_wave_descriptor(kind > 0, 1, 4);
        rig_anchor(&a);
        if (kind < 3) rig_put(out, native_encode_poses(out, sizeof out, pose, 2, 0, 0));
        rig_points(0, 0, 0, (struct rig_point[]){empty, empty, kind > 0 ? geo : polar}, 3);
        rig_waves(0, 0, &rig_12_bits, &w, 1);
        record((struct recorder_options){0});
        assert_int_equal(rig_uint(las + 247, 8), 1);
        assert_int_equal(wave_at(0)[0], kind < 2);
        if (kind == 2) assert_non_null(strstr(rig_notes, "1 of these points are of a moving head"));
        if (kind >= 2) continue;
        check_packet(0, &rig_12_bits, 2, 30, 8);
        check_first(0, (double[]){10 + 30 * RIG_C_M_S * 0.5e-9, 20.002, 30}, (double[]){1e-3, 1e-3, 1e-3});
    }
}

/* Scans of different digitisers have descriptors of their own, and no packet is taken for that of an earlier scan. */
static void test_digitisers(void **state)
{
    (void)state;
    static const struct rig_digitiser other = {500, 8 * 16, 8, 0.5f, 0};
    const struct rig_digitiser *of[3] = {&rig_12_bits, &other, &rig_12_bits};
    static const struct rig_window w = {0, 60, 20, {0, 0, 0}}, coarse = {0, 30, 20, {0, 0, 0}};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    rig_begin();
    for (uint32_t scan = 0; scan < 3; scan++) {
        rig_wave_descriptor(0, scan + 1, 4);
        rig_anchor(&a);
        rig_points(0, 0, 0, points, 1);
        rig_waves(0, 0, of[scan], scan == 1 ? &w : &coarse, 1);
    }
    record((struct recorder_options){0});
    for (size_t i = 0; i < 3; i++)
        check_packet(i, of[i], 0, i == 1 ? 60 : 30, 20);
    assert_true(wave_at(0)[0] != wave_at(1)[0] && wave_at(0)[0] == wave_at(2)[0]);
    assert_int_equal(rig_uint(wave_at(2) + 1, 8), EVLR + 40 + 20);
    assert_int_equal(rig_uint(las + 100, 4), 2 + 2);
}

static int tear_down(void **state)
{
    free(las);
    free(wdp);
    return rig_tear_down(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_inside),     cmocka_unit_test(test_outside),   cmocka_unit_test(test_colour),
        cmocka_unit_test(test_8_bits),     cmocka_unit_test(test_none),      cmocka_unit_test(test_no_wdp),
        cmocka_unit_test(test_utm),        cmocka_unit_test(test_geodetic),  cmocka_unit_test(test_lengths),
        cmocka_unit_test(test_unheld),     cmocka_unit_test(test_long_wait), cmocka_unit_test(test_moving),
        cmocka_unit_test(test_digitisers),
    };
    return cmocka_run_group_tests(tests, rig_set_up, tear_down);
}
