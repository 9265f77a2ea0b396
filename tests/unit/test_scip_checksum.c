/* SPDX-License-Identifier: MIT */
/* SCIP: scans whose values are changed on request, with right sums. A decoder written from the protocol's description
 * alone reads them. */
#include "tests/unit/scip_rig.h"
#include "tests/unit/checksum_rig.h"

static int n_chars, intensity;

static const void *read_scan(const uint8_t *unit, size_t len, size_t *size)
{
    static struct scip_decoded scan;
    static char text[1 << 16];
    const char *at = text;
    assert_true(len < sizeof text);
    memcpy(text, unit, len);
    text[len] = 0;
    memset(&scan, 0, sizeof scan);
    scip_decode(&scan, &at, n_chars, intensity);
    assert_true(at == text + len);
    assert_string_equal(scan.status, strncmp(scan.echo, "GD", 2) == 0 ? "00" : "99");
    *size = sizeof scan;
    return &scan;
}

/* Forty steps, some with several echoes, take more than one line of data. */
static void open_forty(void)
{
    scip_open_head("UTM-30LX-EW", 1440, 0, 39, 20, -1, 40);
    protocol_rig_describe(&rig, 0);
    for (int i = 0; i < 40; i++)
        shot[i] = (struct protocol_rig_shot){
            .n = i % 3 == 2 ? 2 : 1, .range_m = {0.5 + 0.37 * i, 20.0}, .refl_cdb = {-700, -100}};
}

static void check_scans(const char *request, int chars, int with_intensity, uint32_t n_bits)
{
    n_chars = chars;
    intensity = with_intensity;
    open_forty();
    protocol_rig_input(&rig, "BM\n");
    protocol_rig_input(&rig, request);
    protocol_rig_clear(&rig);
    scip_turn(0);
    assert_int_equal(rig.n_units, 1);
    assert_int_equal(seal_count(rig.ops, rig.bytes, rig.len), n_bits);
    seal_check(rig.ops, rig.bytes, rig.len, read_scan);
}

/* There are four bits a character: 40 steps, or 53 echoes, as every third step has two. */
static void values_of_all_kinds(void **state)
{
    (void)state;
    check_scans("MD0000003901001\n", 3, 0, 4 * 40 * 3);
    check_scans("MS0000003901001\n", 2, 0, 4 * 40 * 2);
    check_scans("ME0000003901001\n", 3, 1, 4 * 40 * 6);
    check_scans("NE0000003901001\n", 3, 1, 4 * 53 * 6);
    check_scans("GD0000003901\n", 3, 0, 4 * 40 * 3);
}

/* Other replies have no measured values. The replies' sums are made right, too; the sum of a key line is without the
 * line's ';'. */
static void other_replies_keep_their_sums(void **state)
{
    (void)state;
    static const char *const requests[] = {"VV\n", "PP\n", "II\n", "BM\n", "QT\n", "XX\n", "TM0\n"};
    static uint8_t clean[4096];
    scip_open("UTM-30LX");
    for (size_t i = 0; i < sizeof requests / sizeof requests[0]; i++) {
        protocol_rig_clear(&rig);
        protocol_rig_input(&rig, requests[i]);
        assert_true(rig.len > 4 && rig.len < sizeof clean);
        memcpy(clean, rig.bytes, rig.len);
        assert_int_equal(seal_count(rig.ops, clean, rig.len), 0);
        for (size_t at = strlen(requests[i]); at + 1 < rig.len; at++)
            if (rig.bytes[at + 1] == '\n' && rig.bytes[at] != '\n') rig.bytes[at] = '?'; /* a sum */
        assert_memory_not_equal(rig.bytes, clean, rig.len);
        rig.ops->reseal(rig.bytes, rig.len);
        assert_memory_equal(rig.bytes, clean, rig.len);
        seal_check_broken(rig.ops, clean, rig.len);
    }
}

/* Scans with a % are scans, too. 1035 mm are "0@;": the line of data looks like a key line. */
static void a_scan_in_microseconds(void **state)
{
    (void)state;
    static uint8_t clean[256];
    scip_open_head("UTM-30LX-EW 2", 1440, 0, 39, 20, -1, 40); /* any other model; its firmware is 1.2.3 */
    protocol_rig_describe(&rig, 0);
    scip_flat(1.035);
    scip_ask("%MD0000000001001\n", "%MD0000000001001\n00P\n\n");
    scip_turn(0);
    const char *unit = "%MD0000000001000\n99b\n00000000000@\n0@;[\n\n"; /* 48 + 64 + 59 = 171 = 2 * 64 + 43 */
    assert_int_equal(rig.len, strlen(unit));
    assert_memory_equal(rig.bytes, unit, rig.len);
    memcpy(clean, rig.bytes, rig.len);
    assert_int_equal(seal_count(rig.ops, clean, rig.len), 4 * 3);
    rig.bytes[rig.len - 3] = '?';
    rig.ops->reseal(rig.bytes, rig.len);
    assert_memory_equal(rig.bytes, clean, rig.len);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_of_all_kinds),
        cmocka_unit_test(other_replies_keep_their_sums),
        cmocka_unit_test(a_scan_in_microseconds),
    };
    return cmocka_run_group_tests(tests, NULL, scip_teardown);
}
