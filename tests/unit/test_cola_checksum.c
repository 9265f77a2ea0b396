/* SPDX-License-Identifier: MIT */
/* CoLa: LMDscandata whose values are changed on request, with a right check byte. The telegram is read by the public
 * layout alone (cola_rig). */
#include "tests/unit/cola_rig.h"
#include "tests/unit/checksum_rig.h"

static struct protocol_rig_shot shots[40];

/* Checks length and check byte of CoLa-B, which cola_read_lmd doesn't look at. */
static void check_frame(const uint8_t *unit, size_t len)
{
    uint8_t check = 0;
    if (unit[1] != 2) return;
    assert_int_equal((uint32_t)unit[4] << 24 | (uint32_t)unit[5] << 16 | (uint32_t)unit[6] << 8 | unit[7], len - 9);
    for (size_t i = 8; i < len; i++)
        check ^= unit[i];
    assert_int_equal(check, 0);
}

static const void *read_scan(const uint8_t *unit, size_t len, size_t *size)
{
    static struct cola_lmd lmd;
    check_frame(unit, len);
    memcpy(cola.bytes, unit, len);
    cola.n_units = 1;
    cola.end[0] = len;
    cola_read_lmd(0, &lmd);
    *size = sizeof lmd;
    return &lmd;
}

/* Twelve beams of a head with 48 steps. The settings are those of LMDscandatacfg in CoLa-A. Returns the telegram. */
static size_t telegram(const char *cfg, int is_b, uint8_t *unit)
{
    cola_open("LMS111");
    protocol_rig_planar(&cola, 48, 0, 11, 6, -1, 10);
    cola.scan_t0_ns = INT64_C(1000000000);
    cola.utc0_ns = INT64_C(1767323040000000000);
    protocol_rig_describe(&cola, 0);
    for (int i = 0; i < 12; i++)
        shots[i] =
            (struct protocol_rig_shot){i % 3 == 0 ? 2 : 1, {0.7 * i + 0.6, 17.0}, {(int16_t)(-100 * i), -700}, {0}};
    cola_authorise();
    cola_expect(cfg, "sWA LMDscandatacfg");
    cola_stream(is_b);
    protocol_rig_clear(&cola);
    protocol_rig_turn(&cola, 0, shots, 5);
    assert_int_equal(cola.n_units, 1);
    memcpy(unit, cola.bytes, cola.len);
    return cola.len;
}

static void check(const char *cfg, int is_b, uint32_t n_bits)
{
    static uint8_t unit[4096];
    const size_t len = telegram(cfg, is_b, unit);
    if (n_bits != 0) assert_int_equal(seal_count(cola.ops, unit, len), n_bits);
    assert_true(seal_count(cola.ops, unit, len) > 12);
    seal_check(cola.ops, unit, len, read_scan);
}

/* The numbers are channels (2), RSSI, 16 bit, unit, encoder (2), position, name, comment, time, and each n-th scan. */
static void values_of_all_kinds(void **state)
{
    (void)state;
    static const char *const cfg[] = {"sWN LMDscandatacfg 1 0 0 0 0 0 0 0 0 0 0 1",
                                      "sWN LMDscandatacfg 3 0 1 0 0 1 0 0 0 0 1 1",
                                      "sWN LMDscandatacfg 3 0 1 1 0 0 0 0 1 0 1 1"};
    static const uint32_t n_bits[] = {12 * 16, 2 * 12 * (16 + 8), 2 * 12 * (16 + 16)};
    for (int i = 0; i < 3; i++) {
        check(cfg[i], 1, n_bits[i]);
        check(cfg[i], 0, 0); /* their digits give the number of bits */
    }
}

/* Just the values of the channels change, by COLA.md: 19 bytes from a channel's name on, then the number of values. */
static void values_and_nothing_else(void **state)
{
    (void)state;
    static const char *const cfg[] = {"sWN LMDscandatacfg 1 0 0 0 0 0 0 0 0 0 0 1",
                                      "sWN LMDscandatacfg 3 0 1 0 0 1 0 0 0 0 1 1",
                                      "sWN LMDscandatacfg 3 0 1 1 0 0 0 0 1 0 1 1"};
    static const char *const name[] = {"DIST1", "DIST2", "RSSI1", "RSSI2"};
    static const int n_channels[] = {1, 4, 4}, rssi_len[] = {0, 1, 2};
    for (int i = 0; i < 3; i++) {
        static uint8_t unit[4096];
        uint8_t mask[4096] = {0}, want[4096] = {0};
        const size_t len = telegram(cfg[i], 1, unit);
        int n = 0;
        for (int k = 0; k < 4; k++) {
            const uint8_t *at = memmem(unit, len, name[k], 5);
            if (at == NULL) continue;
            assert_int_equal(at[19] << 8 | at[20], 12);
            memset(want + (at - unit) + 21, 0xff, 12 * (size_t)(k < 2 ? 2 : rssi_len[i]));
            n++;
        }
        assert_int_equal(n, n_channels[i]);
        cola.ops->content(unit, len, mask);
        assert_memory_equal(mask, want, len);
    }
}

/* In this telegram of CoLa-A, the serial number and both times are as long as a channel's name, and stand before the
 * channel. Only the digits of the three values change. */
static void words_are_no_channels(void **state)
{
    (void)state;
    static const char unit[] = "\2sSN LMDscandata 1 1 12345 0 0 1 2 F4240 F4241 0 0 7 0 0 1388 168 0 1 "
                               "DIST1 3F800000 00000000 FFFD4EC0 1388 3 1B2 1B 1C0 0 0 0 0 0 0\3";
    uint8_t mask[sizeof unit] = {0};
    const char *values = strstr(unit, "1B2 1B 1C0");
    cola_open("LMS111");
    cola.ops->content((const uint8_t *)unit, sizeof unit - 1, mask);
    for (const char *at = unit; *at != '\0'; at++)
        assert_int_equal(mask[at - unit] != 0, at >= values && at < values + 10 && *at != ' ');
}

/* However short a damaged telegram is, its last byte is taken as the check byte or ETX, and is not changed. */
static void the_last_byte_stays(void **state)
{
    (void)state;
    static uint8_t unit[4096], mask[4096];
    for (int is_b = 0; is_b < 2; is_b++) {
        const size_t len = telegram("sWN LMDscandatacfg 3 0 1 0 0 1 0 0 0 0 1 1", is_b, unit);
        int n_cut_in_values = 0;
        for (size_t n = 1; n <= len; n++) {
            memset(mask, 0, sizeof mask);
            cola.ops->content(unit, n, mask);
            assert_int_equal(mask[n - 1], 0);
            n_cut_in_values += n < len && memchr(mask, 0xff, n) != NULL;
        }
        assert_true(!is_b || n_cut_in_values > 0);
    }
}

/* Other telegrams have no measured values. Their check byte is made right, too. */
static void answers_keep_their_check_byte(void **state)
{
    (void)state;
    static const char answer[] = "sRA SCdevicestate \1";
    uint8_t right[64], wrong[64];
    const size_t len = cola_frame_b(right, answer, sizeof answer - 1);
    cola_open_lms();
    assert_int_equal(seal_count(cola.ops, right, len), 0);
    memcpy(wrong, right, len);
    wrong[len - 1] ^= 0x55;
    cola.ops->reseal(wrong, len);
    assert_memory_equal(wrong, right, len);
    static const uint8_t in_a[] = "\2sRA SCdevicestate 1\3";
    assert_int_equal(seal_count(cola.ops, in_a, sizeof in_a - 1), 0);
    seal_check_broken(cola.ops, right, len);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_of_all_kinds),           cmocka_unit_test(values_and_nothing_else),
        cmocka_unit_test(words_are_no_channels),         cmocka_unit_test(the_last_byte_stays),
        cmocka_unit_test(answers_keep_their_check_byte),
    };
    return cmocka_run_group_tests(tests, NULL, cola_teardown);
}
