/* SPDX-License-Identifier: MIT */
/* Packets beyond 4 GiB of a .wdp, which is a file with a hole here: their places have 64 bits everywhere. */
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

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_large)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
