/* SPDX-License-Identifier: MIT */
/* The file of packets by itself: places beyond 4 GiB of a .wdp, which is a file with a hole here, and the kinds of
 * packets. */
#include "core/bytes.h"
#include "drivers/record/las_columns.h"
#include "tests/unit/waves_rig.h"

static const uint64_t BEGIN = (uint64_t)5 << 30;

static void test_large(void **state)
{
    (void)state;
    static const uint8_t sample[] = {1, 0, 2, 0, 3, 0};
    const struct scanhead_wave wave = {.n = 3, .sample = sample, .sample_ps = 1000, .bits = 12, .count_signal = 1};
    const struct track track = {.n_scans = 1};
    struct las_waves waves = {.n_kinds = 0};
    const struct las_facts facts = {.minor = 4, .track = &track, .has_waves = 1, .waves = &waves};
    static struct las_columns columns = {.returns = {0x11}};
    struct las_packet *packet_0 = columns.packet;
    struct sh_err err = {0};
    uint8_t record[LAS_POINT_LEN_MAX], len[8], packet[6];
    int is_new;
    assert_int_equal(las_waves_open(&waves, rig_path("a.las"), &err), 0);
    waves.file.written = BEGIN;
    if (las_waves_put(&waves, 1, &wave, packet_0, &is_new, &err) != 0) fail_msg("%s", err.text);
    assert_true(is_new && packet_0->kind == 1);
    assert_true(packet_0->at == BEGIN + LAS_WAVES_HEAD_LEN);
    las_put_rows(&facts, &columns, 1, record);
    assert_true(rig_uint(record + 31, 8) == BEGIN + LAS_WAVES_HEAD_LEN); /* behind the descriptor's index */
    if (las_waves_end(&waves, &err) != 0) fail_msg("%s", err.text);
    assert_int_equal(pread(waves.file.fd, len, sizeof len, 20), sizeof len);
    assert_true(rig_uint(len, 8) == BEGIN + sizeof sample);
    assert_int_equal(pread(waves.file.fd, packet, sizeof packet, (off_t)packet_0->at), sizeof packet);
    assert_memory_equal(packet, sample, sizeof sample);
    las_waves_close(&waves);
    assert_int_equal(access(rig_path("a.wdp.part"), F_OK), -1);
}

/* The first 128 lengths have kinds of their own. Lengths after them are rounded up to four an octave. The kinds of all
 * lengths up to 600 are thus 128 and 160, 192, 224, 256, 320, 384, 448, 512, 640. Samples without light fill the
 * rest. */
static void test_kinds(void **state)
{
    (void)state;
    enum { EXACT = 128, LONGEST = 600, LARGE = 1024 };
    static const uint32_t rounded[] = {160, 192, 224, 256, 320, 384, 448, 512, 640};
    static uint8_t sample[2 * LARGE];
    struct scanhead_wave wave = {.sample = sample, .sample_ps = 1000, .bits = 12, .count_signal = 1};
    struct las_waves waves = {.n_kinds = 0};
    struct las_packet packet;
    struct sh_err err = {0};
    uint64_t n_fill = 0;
    int is_new;
    assert_int_equal(las_waves_open(&waves, rig_path("a.las"), &err), 0);
    for (uint32_t n = 1, k = 0; n <= LONGEST; n++) {
        wave.n = (uint16_t)n;
        wave.pulse = n;
        if (n > EXACT && n > rounded[k] && k + 1 < sizeof rounded / sizeof rounded[0]) k++;
        const uint32_t want = n <= EXACT ? n : rounded[k], before = waves.n_kinds;
        assert_int_equal(las_waves_put(&waves, 1, &wave, &packet, &is_new, &err), 0);
        assert_int_equal(packet.len, 2 * want);
        assert_int_equal(packet.kind, n <= EXACT ? n : EXACT + 1 + k);
        assert_int_equal(is_new, waves.n_kinds > before);
        assert_int_equal(waves.kind[packet.kind - 1].n, want);
        n_fill += want - n;
    }
    assert_int_equal(waves.n_kinds, EXACT + sizeof rounded / sizeof rounded[0]);
    assert_true(waves.n_fill == n_fill);
    assert_int_equal(waves.n_kindless, 0);
    wave.pulse = LARGE;
    wave.n = LARGE; /* this length is one of the rounded ones, so it needs no fill */
    assert_int_equal(las_waves_put(&waves, 1, &wave, &packet, &is_new, &err), 0);
    assert_int_equal(packet.len, 2 * LARGE);
    assert_int_equal(is_new, 1);
    las_waves_close(&waves);
}

/* Up to 8 samples are never rounded up, from there to 16 samples to even numbers. The window of
 * another digitiser comes after 128 kinds. */
static void test_short_kinds(void **state)
{
    (void)state;
    static const uint32_t want[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 10, 12, 12, 14, 14, 16, 16};
    enum { EXACT = 128, LONGEST = sizeof want / sizeof want[0] - 1 };
    static uint8_t sample[2 * EXACT];
    struct scanhead_wave wave = {.sample = sample, .sample_ps = 1000, .bits = 12, .count_signal = 1};
    struct las_packet packet;
    struct sh_err err = {0};
    int is_new;
    for (uint32_t n = 1; n <= LONGEST; n++) {
        struct las_waves waves = {.n_kinds = 0};
        assert_int_equal(las_waves_open(&waves, rig_path("a.las"), &err), 0);
        wave.sample_ps = 1000;
        for (uint32_t k = 1; k <= EXACT; k++) {
            wave.pulse = wave.n = (uint16_t)k;
            assert_int_equal(las_waves_put(&waves, 1, &wave, &packet, &is_new, &err), 0);
        }
        wave.sample_ps = 2000;
        wave.pulse++;
        wave.n = (uint16_t)n;
        assert_int_equal(las_waves_put(&waves, 1, &wave, &packet, &is_new, &err), 0);
        assert_true(is_new);
        assert_int_equal(packet.len, 2 * want[n]);
        las_waves_close(&waves);
    }
}

/* Puts a window, which must get the packet of that kind, new or not. */
static void put(struct las_waves *waves, const struct scanhead_wave *wave, uint32_t kind, int want_new)
{
    struct sh_err err = {0};
    struct las_packet packet;
    int is_new = !want_new;
    assert_int_equal(las_waves_put(waves, 1, wave, &packet, &is_new, &err), 0);
    assert_int_equal(packet.kind, kind);
    assert_int_equal(is_new, want_new);
}

/* A digitiser of its own takes a kind. When all 255 are taken, windows that fit none are counted, and left out. Points
 * in one window share its packet. */
static void test_no_kind_left(void **state)
{
    (void)state;
    static uint8_t sample[2 * 8];
    struct scanhead_wave wave = {.n = 4, .sample = sample, .bits = 12, .count_signal = 1};
    struct las_waves waves = {.n_kinds = 0};
    struct sh_err err = {0};
    assert_int_equal(las_waves_open(&waves, rig_path("a.las"), &err), 0);
    for (uint32_t kind = 1; kind <= LAS_KINDS; kind++) {
        wave.pulse = wave.sample_ps = kind;
        put(&waves, &wave, kind, 1);
    }
    const uint64_t len = waves.file.written + waves.file.len;
    put(&waves, &wave, LAS_KINDS, 0); /* the same window */
    assert_int_equal(waves.file.written + waves.file.len, len);
    for (uint32_t i = 1; i <= 2; i++) {
        wave.sample_ps = LAS_KINDS + i;
        wave.pulse++;
        put(&waves, &wave, 0, 0);
        assert_int_equal(waves.n_kindless, i);
    }
    wave.sample_ps = 2;
    wave.pulse++;
    wave.n = 8; /* longer than the kind of its digitiser */
    put(&waves, &wave, 0, 0);
    assert_int_equal(waves.n_kindless, 3);
    assert_int_equal(waves.file.written + waves.file.len, len);
    wave.n = 3; /* one sample follows */
    put(&waves, &wave, 2, 0);
    assert_int_equal(waves.n_filled, 1);
    assert_int_equal(waves.n_fill, 1);
    assert_int_equal(waves.file.written + waves.file.len, len + 2 * 4);
    las_waves_close(&waves);
}

/* Another program has made the file of packets shorter before it is copied. */
static void test_cut_before_copy(void **state)
{
    (void)state;
    static uint8_t sample[2 * 8];
    const struct scanhead_wave wave = {.n = 8, .sample = sample, .sample_ps = 1000, .bits = 12, .count_signal = 1};
    struct las_waves waves = {.n_kinds = 0};
    struct outfile to;
    struct sh_err err = {0};
    char want[200];
    assert_int_equal(las_waves_open(&waves, rig_path("a.las"), &err), 0);
    assert_int_equal(outfile_open(&to, rig_path("b.las"), &err), 0);
    put(&waves, &wave, 1, 1);
    assert_int_equal(las_waves_end(&waves, &err), 0);
    assert_int_equal(las_waves_copy(&waves, &to, NULL, &err), 0);
    assert_int_equal(to.written + to.len, LAS_WAVES_HEAD_LEN + sizeof sample);
    assert_int_equal(ftruncate(waves.file.fd, LAS_WAVES_HEAD_LEN), 0);
    assert_int_equal(las_waves_copy(&waves, &to, NULL, &err), SH_EIO);
    snprintf(want, sizeof want, "%s: cannot be read: it became shorter", rig_path("a.wdp.part"));
    assert_string_equal(err.text, want);
    outfile_close(&to, OUTFILE_DROP, NULL);
    las_waves_close(&waves);
}

/* A packet is filled up with the count without light, rounded; it is a count that the bits can have. */
static void test_fill(void **state)
{
    (void)state;
    enum { N = 600, KIND = 640 }; /* beyond 128 kinds lengths are rounded up */
    static const struct {
        unsigned bits;
        double baseline;
        uint64_t dark;
    } rows[] = {{12, 205.4, 205},   {12, 205.6, 206}, {12, -1, 0},   {12, 4095, 4095}, {12, 4096, 4095},
                {14, 20000, 16383}, {8, 255, 255},    {8, 256, 255}, {8, 200, 200}};
    static uint8_t sample[2 * N], bytes[2 * KIND];
    for (size_t i = 0; i < N; i++)
        sample[2 * i] = 1;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct scanhead_wave wave = {.sample = sample, .sample_ps = 1000, .count_signal = 1};
        struct las_waves waves = {.n_kinds = 0};
        struct las_packet packet;
        struct sh_err err = {0};
        int is_new;
        wave.bits = (uint8_t)rows[i].bits;
        wave.baseline = rows[i].baseline;
        assert_int_equal(las_waves_open(&waves, rig_path("a.las"), &err), 0);
        for (uint32_t n = 1; n <= 129; n++) {
            wave.n = (uint16_t)(n <= 128 ? n : N);
            wave.pulse = n;
            assert_int_equal(las_waves_put(&waves, 1, &wave, &packet, &is_new, &err), 0);
        }
        const size_t width = rows[i].bits == 8 ? 1 : 2;
        assert_int_equal(packet.len, width * KIND);
        if (las_waves_end(&waves, &err) != 0) fail_msg("%s", err.text);
        assert_int_equal(pread(waves.file.fd, bytes, packet.len, (off_t)packet.at), packet.len);
        for (size_t k = 0; k < KIND; k++)
            assert_int_equal(rig_uint(bytes + width * k, (int)width), k >= N ? rows[i].dark : 1);
        las_waves_close(&waves);
    }
}

/* A frame names 8 bits, and has a sample of 300: the packet has 16 bits, and the sample. */
static void test_more_bits(void **state)
{
    (void)state;
    static const uint8_t sample[] = {1, 0, 300 & 255, 300 >> 8, 3, 0}, plain[] = {1, 0, 255, 0, 3, 0};
    struct scanhead_wave wave = {.n = 3, .sample = sample, .sample_ps = 1000, .bits = 8, .count_signal = 1};
    struct las_waves waves = {.n_kinds = 0};
    struct las_packet packet;
    struct sh_err err = {0};
    uint8_t got[6];
    int is_new;
    assert_int_equal(las_waves_open(&waves, rig_path("a.las"), &err), 0);
    assert_int_equal(las_waves_put(&waves, 1, &wave, &packet, &is_new, &err), 0);
    assert_int_equal(waves.kind[packet.kind - 1].bits, 16);
    assert_int_equal(packet.len, sizeof sample);
    assert_int_equal(las_waves_flush(&waves, &err), 0);
    assert_int_equal(pread(waves.file.fd, got, sizeof got, (off_t)packet.at), sizeof got);
    assert_memory_equal(got, sample, sizeof sample);
    wave.sample = plain;
    wave.pulse++;
    assert_int_equal(las_waves_put(&waves, 1, &wave, &packet, &is_new, &err), 0);
    assert_int_equal(waves.kind[packet.kind - 1].bits, 8);
    assert_int_equal(packet.len, 3);
    las_waves_close(&waves);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_more_bits),    cmocka_unit_test(test_large),
                                       cmocka_unit_test(test_kinds),        cmocka_unit_test(test_short_kinds),
                                       cmocka_unit_test(test_no_kind_left), cmocka_unit_test(test_cut_before_copy),
                                       cmocka_unit_test(test_fill)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
