/* SPDX-License-Identifier: MIT */
/* The client in Python gives the same as libscanhead: every number of every window of a waveform, and of every
 * deviation. */
#include "tests/wire/python_rig.h"

#include "core/rng.h"
#include "drivers/protocol/native_encode.h"
#include "drivers/protocol/native_waves.h"

enum { PULSES = 60, WINDOWS = 2 * PULSES, LONGEST = 300 };

struct __attribute__((packed)) window {
    int64_t pulse, t_ns;
    uint32_t first, n, sample_ps, bits;
    double range_m, step_m, direction[3], baseline;
};

static uint8_t stream[1 << 18];
static size_t stream_len;
static uint64_t drawn;

static uint32_t random_u32(void)
{
    return (uint32_t)rng_u64(7, ++drawn);
}

static void add(size_t len)
{
    static uint32_t seq;
    assert_true(len > 0);
    for (const size_t end = stream_len + len; stream_len < end;)
        stream_len += native_finish_frame(stream + stream_len, seq++);
}

static float some_float(void)
{
    return (float)(int32_t)random_u32() * 1e-9F;
}

static void add_window(struct line_waves *waves, uint32_t pulse, int geo)
{
    struct line_wave *w = &waves->wave[waves->n++];
    *w = (struct line_wave){.pulse = pulse,
                            .dt_ns = 3333 * pulse,
                            .first = random_u32() % 100000,
                            .n = 1 + random_u32() % LONGEST,
                            .at = waves->n_samples,
                            .b = random_u32() & 0xfffff,
                            .c = random_u32() & 0xfffff};
    if (geo) w->a = float_bits(some_float()), w->b = float_bits(some_float()), w->c = float_bits(some_float());
    for (uint32_t i = 0; i < w->n; i++)
        waves->sample[waves->n_samples++] = (uint16_t)(random_u32() & 0x3fff);
}

static void add_block(int geo)
{
    struct line_block b;
    assert_int_equal(line_block_alloc(&b, PULSES, NULL), 0);
    assert_int_equal(line_block_alloc_attributes(&b, NULL), 0);
    assert_int_equal(line_block_alloc_deviations(&b, NULL), 0);
    assert_int_equal(line_block_alloc_waves(&b, WINDOWS, WINDOWS * LONGEST, NULL), 0);
    b.n_points = b.n_pulses = PULSES;
    b.t0_ns = 5000;
    b.pulse0 = UINT64_C(0x100000005);
    b.waves->sample_ps = 1000 + random_u32() % 1000;
    b.waves->baseline_16 = (uint16_t)(random_u32() & 0xfff);
    b.waves->bits = 14;
    b.waves->count_signal = 0.1F;
    for (uint32_t i = 0; i < PULSES; i++) {
        b.echo[i] = 0x11;
        b.deviation[i] = (uint16_t)random_u32();
        for (uint32_t k = random_u32() % 3; k > 0; k--)
            add_window(b.waves, i, geo);
    }
    add(native_encode_points(stream + stream_len, sizeof stream - stream_len, &b, 1000000));
    line_block_free(&b);
}

static void write_stream(struct wire *wire, int geo)
{
    const struct native_descriptor d = {.idn = "a,b,c,d",
                                        .layout = geo ? NATIVE_GEO : NATIVE_POLAR,
                                        .mirror_counts_per_turn = 1048576,
                                        .pan_counts_per_turn = 1000003,
                                        .range_scale_m = 1e-6,
                                        .scan = 1,
                                        .content = NATIVE_HAS_ATTRIBUTES | NATIVE_HAS_WAVES | NATIVE_HAS_DEVIATIONS};
    const struct native_anchor anchor = {.scale_m = 1e-6, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    stream_len = 0;
    add(native_encode_descriptor(stream, sizeof stream, &d, 0, 0));
    add(native_encode_anchor(stream + stream_len, sizeof stream - stream_len, &anchor, 0, 0));
    add_block(geo);
    wire_write(wire, "waves.shs", stream, stream_len);
}

struct dump {
    char *bytes;
    size_t len, at;
};

static void take(struct dump *dump, void *to, size_t len)
{
    assert_true(dump->at + len <= dump->len);
    memcpy(to, dump->bytes + dump->at, len);
    dump->at += len;
}

static void expect_block(struct dump *dump, char kind, int n)
{
    char is;
    uint32_t count;
    take(dump, &is, 1);
    take(dump, &count, 4);
    assert_int_equal(is, kind);
    assert_int_equal(count, n);
}

/* Values agree bit for bit: the same operations in the same order, sine and cosine from the same C library. */
static void expect_real(struct dump *dump, double value)
{
    double said;
    take(dump, &said, sizeof said);
    if (memcmp(&said, &value, sizeof said) != 0) fail_msg("%.17g in Python, %.17g in libscanhead", said, value);
}

static void expect_window(struct dump *dump, const struct scanhead_wave *w)
{
    struct window said;
    take(dump, &said, sizeof said);
    assert_true(said.pulse == (int64_t)w->pulse && said.t_ns == w->t_ns && said.first == w->first && said.n == w->n);
    assert_true(said.sample_ps == w->sample_ps && said.bits == w->bits && said.baseline == w->baseline);
    assert_true(said.range_m == w->range_m && said.step_m == w->step_m);
    assert_memory_equal(said.direction, w->direction, sizeof w->direction);
    for (uint32_t i = 0; i < w->n; i++)
        expect_real(dump, scanhead_wave_signal(w, i));
}

static void expect_frame_of(struct scanhead *sh, const struct scanhead_frame *f, struct dump *dump)
{
    static struct scanhead_wave wave[WINDOWS];
    static double deviation[PULSES];
    if (f->type == SCANHEAD_ATTRIBUTES) {
        assert_int_equal(scanhead_deviations(sh, f, 0, deviation, PULSES), PULSES);
        expect_block(dump, 'D', PULSES);
        for (int i = 0; i < PULSES; i++)
            expect_real(dump, deviation[i]);
    }
    if (f->type != SCANHEAD_WAVES) return;
    const int n = scanhead_waves(sh, f, 0, wave, WINDOWS);
    expect_block(dump, 'W', n);
    for (int i = 0; i < n; i++)
        expect_window(dump, &wave[i]);
}

static void test_same_waves(void **state)
{
    struct wire *wire = *state;
    need_python();
    for (int geo = 0; geo < 2; geo++)
        for (int k = 0; k < 2; k++) {
            char path[352], out[352], hash[65];
            struct scanhead_frame f;
            struct dump dump = {.at = 0};
            write_stream(wire, geo);
            snprintf(path, sizeof path, "%s", wire_path(wire, "waves.shs"));
            snprintf(out, sizeof out, "%s", wire_path(wire, "dump"));
            const char *said = ask_python(wire, flavours[k], "waves", path, out);
            if (said == NULL) continue;
            dump.bytes = wire_read(out, &dump.len);
            struct scanhead *sh = client_open(path);
            scanhead_hash_start(sh);
            while (scanhead_next(sh, &f, 0) == SCANHEAD_OK)
                expect_frame_of(sh, &f, &dump);
            assert_int_equal(dump.at, dump.len);
            scanhead_hash_hex(sh, hash);
            assert_int_equal(strncmp(said, hash, 64), 0);
            free(dump.bytes);
            scanhead_close(sh);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_same_waves, setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
