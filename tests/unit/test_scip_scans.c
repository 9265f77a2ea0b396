/* SPDX-License-Identifier: MIT */
/* SCIP, the sensor's side: the contents of a scan. The bytes are worked out by hand from the protocol's description,
 * and a decoder is written from it. */
#include "tests/unit/scip_rig.h"

static struct scip_decoded got;

/* Five steps, 0 to 4, and a scan of them with all kinds of value: 1234 mm, 5432 mm, no echo, too near, 30000 mm. The
 * description encodes 1234 as CB in two characters, 5432 as 1Dh in three and 16000000 as m2@0 in four. 30000 is 7 *
 * 4096 + 20 * 64 + 48. */
static void open_five(const char *model)
{
    scip_open_head(model, 360, 0, 4, 2, -1, 10);
    protocol_rig_describe(&rig, 0);
    rig.scan_t0_ns = 16000000 * 1000000LL;
    rig.ops->time(rig.protocol, rig.scan_t0_ns);
    shot[0] = (struct protocol_rig_shot){.n = 1, .range_m = {1.234}};
    shot[1] = (struct protocol_rig_shot){.n = 1, .range_m = {5.432}};
    shot[2] = (struct protocol_rig_shot){.n = 0};
    shot[3] = (struct protocol_rig_shot){.n = 1, .range_m = {0.05}};
    shot[4] = (struct protocol_rig_shot){.n = 1, .range_m = {30.0}};
}

static void bytes_by_hand(void **state)
{
    (void)state;
    open_five("UTM-30LX");
    scip_ask("MD0000000401002;tag\n", "MD0000000401002;tag\n00P\n\n");
    scip_turn(0);
    scip_expect("MD0000000401001;tag\n99b\nm2@0?\n0CB1Dh0010047D`B\n\n");
    scip_ask("MS0000000400001\n", "MS0000000400001\n00P\n\n");
    scip_turn(1); /* 100 ms later: 16000100 is 61, 2, 17, 36 */
    scip_expect("MS0000000400000\n99b\nm2ATd\nCBoo0104oo6\n\n");
    scip_ask("BM\nGD0001000101;1\n", "BM\n00P\n\n");
    scip_turn(2); /* 16000200: 61, 2, 19, 8 */
    scip_expect("GD0001000101;1\n00P\nm2C8J\n1DhM\n\n");
}

/* Draws ranges of 0.1 to 30 m in steps of 1 um, which the description rounds to mm. */
static uint32_t random_um(uint32_t *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return 100000 + *seed % 29900000;
}

static void ranges_to_the_millimetre(void **state)
{
    (void)state;
    static uint32_t um[3][1081];
    uint32_t seed = 1;
    scip_open("UTM-30LX");
    scip_ask("MD0000108000003\n", "MD0000108000003\n00P\n\n");
    for (uint32_t k = 0; k < 3; k++) {
        static const char *const echo[] = {"MD0000108000002", "MD0000108000001", "MD0000108000000"};
        for (int i = 0; i < 1081; i++)
            shot[i].range_m[0] = (um[k][i] = random_um(&seed)) * 1e-6;
        scip_turn(k);
        scip_decode_only(&got, 3, 0);
        assert_string_equal(got.echo, echo[k]);
        assert_string_equal(got.status, "99");
        assert_int_equal(got.time_ms, 25 * k);
        assert_int_equal(got.n_steps, 1081);
        for (int i = 0; i < 1081; i++)
            assert_int_equal(got.range_mm[i][0], (um[k][i] + 500) / 1000);
    }
    scip_turn(3);
    scip_expect("");
    scip_ask("GD0000108001\n", "GD0000108001\n10Q\n\n"); /* the laser went off after the last */
}

/* In an endless stream the two digits stay 00. A scan is as long as the description makes it: 6717 bytes of 1081 steps
 * with intensity, in lines of 64 characters and a sum. */
static void without_end(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("ME0000108001000\n", "ME0000108001000\n00P\n\n");
    for (uint32_t k = 0; k < 120; k++) {
        scip_turn(k);
        assert_int_equal(rig.n_units, 1);
        assert_int_equal(rig.len, 6717);
        assert_memory_equal(rig.bytes, "ME0000108001000\n99b\n", 20);
        scip_decode_only(&got, 3, 1);
        assert_int_equal(got.time_ms, 25 * k);
    }
    assert_int_equal(rig.count[PROTOCOL_UNITS_LOST], 0);
}

/* Steps count counter-clockwise seen from above. A target to the left, 90 degrees from the front, is a quarter of a
 * turn above the front step. The rig places a shot by its pan, which is clockwise from the front. */
static void left_is_left(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_flat(5.0);
    shot[540 + 360].range_m[0] = 2.0; /* pan - (900 - 540) / 1440 of a turn: left */
    scip_ask("MD0000108000001\n", "MD0000108000001\n00P\n\n");
    scip_turn(0);
    scip_decode_only(&got, 3, 0);
    for (int i = 0; i < 1081; i++)
        assert_int_equal(got.range_mm[i][0], i == 540 + 1440 / 4 ? 2000 : 5000);

    scip_open_head("UTM-30LX", 1440, 100, 1000, 500, 1, 40); /* a head that turns clockwise */
    protocol_rig_describe(&rig, 0);
    scip_flat(5.0);
    shot[500 - 360 - 100].range_m[0] = 2.0;                          /* pan (140 - 500) / 1440: left */
    EXPECT_IN("PP\n", "\nAMIN:100;", "\nAMAX:1000;", "\nAFRT:600;"); /* 400 steps to the left of it, 500 to the right */
    scip_ask("MD0100100000001\n", "MD0100100000001\n00P\n\n");
    scip_turn(0);
    scip_decode_only(&got, 3, 0);
    for (int i = 100; i <= 1000; i++)
        assert_int_equal(got.range_mm[i - 100][0], i == 600 + 1440 / 4 ? 2000 : 5000);
}

/* A single scan is one that began with the laser on. To switch it on once more changes nothing. The head's 40 turns a
 * second take 25 ms each. */
static void a_single_scan_begins_with_the_laser(void **state)
{
    (void)state;
    static const struct {
        const char *lines, *answer;
        int has_scan; /* of the same turn */
    } rows[] = {
        {"BM\nGD0000108001\n", "BM\n00P\n\n", 0}, {"GD0000108001\n", "", 1}, {"BM\nGD0000108001\n", "BM\n02R\n\n", 1}};
    scip_open("UTM-30LX");
    scip_flat(1.0);
    scip_turn(0);
    protocol_rig_clear(&rig);
    for (uint32_t i = 0; i < 3; i++) {
        const uint32_t line = 2 * i + 1;
        scip_part(line, 0, 500);
        rig.ops->time(rig.protocol, (25 * (int64_t)line + 12) * 1000000);
        scip_ask(rows[i].lines, rows[i].answer);
        scip_part(line, 501, 1080);
        scip_line_end(line, 0);
        assert_int_equal(rig.n_units, rows[i].has_scan);
        scip_turn(line + 1);
        assert_int_equal(rig.n_units, 1);
        scip_decode_only(&got, 3, 0);
        assert_int_equal(got.n_steps, 1081);
    }
}

/* A cluster has the least of its ranges. The cluster has an error code only where none of its steps has a range. */
static void clusters(void **state)
{
    (void)state;
    static const struct {
        const char *parameters, *data;
    } rows[] = {{"0000000402", "0CB0017D`Q"},
                {"0000000403", "0CB7D`@"},
                {"0000000499", "0CBe"},
                {"0001000302", "1Dh004a"},
                {"0000000400", "0CB1Dh0010047D`B"}};
    open_five("UTM-30LX");
    scip_ask("BM\n", "BM\n00P\n\n");
    for (uint32_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char line[40], tail[60];
        snprintf(line, sizeof line, "GD%s\n", rows[i].parameters);
        snprintf(tail, sizeof tail, "\n%s\n\n", rows[i].data);
        scip_ask(line, "");
        scip_turn(i);
        rig.bytes[rig.len] = 0;
        assert_int_equal(rig.len, 22 + strlen(tail)); /* echo, status, time without its line end */
        assert_string_equal((char *)rig.bytes + 22, tail);
        protocol_rig_clear(&rig);
    }
    shot[0].range_m[0] = 30.0; /* the nearest is the last of them now */
    shot[4].range_m[0] = 1.234;
    scip_ask("GD0000000499\n", "");
    scip_turn(9);
    rig.bytes[rig.len] = 0;
    assert_string_equal((char *)rig.bytes + 22, "\n0CBe\n\n");
    protocol_rig_clear(&rig);
    shot[3].range_m[0] = 0.1; /* the least range, DMIN, is no error: 100 is 64 + 36 */
    scip_ask("GD0000000499\n", "");
    scip_turn(10);
    rig.bytes[rig.len] = 0;
    assert_string_equal((char *)rig.bytes + 22, "\n01Te\n\n");
}

static void several_echoes(void)
{
    shot[0] = (struct protocol_rig_shot){.n = 3,
                                         .range_m = {1.234, 5.432, 30.0},
                                         .refl_cdb = {0, -2000, LINE_REFL_NONE},
                                         .amplitude_cdb = {0, 4000, LINE_AMPLITUDE_NONE}};
    shot[1] = (struct protocol_rig_shot){.n = 0};
}

/* 1000 is 15 * 64 + 40: a matt white surface. 20 dB below it is a tenth: 100, 64 + 36. An amplitude of 0 dB is 100, of
 * 40 dB a hundred times that: 10000, 2 * 4096 + 28 * 64 + 16. */
static void echoes_and_intensity(void **state)
{
    (void)state;
    static const struct {
        const char *command, *data;
        int attributes;
    } rows[] = {{"HD", "0CB&1Dh&7D`001:", 0},
                {"HE", "0CB0?X&1Dh01T&7D`000001000V", 0},
                {"HE", "0CB01T&1Dh2L@&7D`000001000M", 1},
                {"GD", "0CB0016", 0},
                {"GE", "0CB0?X001000M", 0},
                {"GE", "0CB01T001000;", 1}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char line[40], tail[60];
        open_five("UTM-30LX-EW");
        several_echoes();
        rig.attributes = rows[i].attributes;
        protocol_rig_describe(&rig, 0);
        snprintf(line, sizeof line, "%s0000000101\n", rows[i].command);
        snprintf(tail, sizeof tail, "\n%s\n\n", rows[i].data);
        protocol_rig_input(&rig, "BM\n");
        protocol_rig_clear(&rig);
        scip_ask(line, "");
        scip_turn(0);
        rig.bytes[rig.len] = 0;
        assert_string_equal((char *)rig.bytes + 22, tail);
    }
}

/* Marks may be at the end of a line of 64 characters: a scan of two echoes tries all places. */
static void marks_anywhere(void **state)
{
    (void)state;
    scip_open("UTM-30LX-EW");
    for (int i = 0; i < 1081; i++)
        shot[i] = (struct protocol_rig_shot){.n = 1 + (uint32_t)(i % 3), .range_m = {1.0 + i * 1e-3, 10.0, 20.0}};
    scip_ask("ND0000108000001\n", "ND0000108000001\n00P\n\n");
    scip_turn(0);
    scip_decode_only(&got, 3, 0);
    assert_int_equal(got.n_steps, 1081);
    for (uint32_t i = 0; i < 1081; i++) {
        assert_int_equal(got.n[i], 1 + i % 3);
        assert_int_equal(got.range_mm[i][0], 1000 + i);
        assert_int_equal(got.range_mm[i][1], i % 3 >= 1 ? 10000 : 0);
        assert_int_equal(got.range_mm[i][2], i % 3 == 2 ? 20000 : 0);
    }
}

/* These codes take a range's place. 44 is the URG-04LX's first step; 40 to 43 can't be measured. */
static void codes_of_a_urg(void **state)
{
    (void)state;
    scip_open("URG-04LX");
    shot[1] = (struct protocol_rig_shot){.n = 0};
    shot[2].range_m[0] = 0.019;
    scip_ask("MS0040004601001\n", "MS0040004601001\n00P\n\n");
    scip_turn(0);
    scip_decode_only(&got, 2, 0);
    static const uint32_t want[] = {19, 19, 19, 19, 1000, 0, 6};
    assert_int_equal(got.n_steps, 7);
    for (int i = 0; i < 7; i++)
        assert_int_equal(got.range_mm[i][0], want[i]);
}

static void parameters(void **state)
{
    (void)state;
    static const struct {
        const char *line, *status;
    } rows[] = {{"MDx000108001000", "01Q"}, {"MD0000 08001000", "02R"}, {"MD00001080-1000", "03S"},
                {"MD000010800a000", "03S"}, {"MD0000108001a00", "06V"}, {"MD0000108001000", "00P"},
                {"MD000010800100x", "07W"}, {"MD0000108101000", "04T"}, {"MD0541054001000", "05U"},
                {"MD0540054001000", "00P"}, {"GDx000108001", "01Q"},    {"GD0000x08001", "02R"},
                {"GD00001080x1", "03S"},    {"GD0000108101", "04T"},    {"GD0541054001", "05U"}};
    scip_open("UTM-30LX");
    scip_ask("BM\n", "BM\n00P\n\n");
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char line[40], answer[40];
        snprintf(line, sizeof line, "%s\n", rows[i].line);
        snprintf(answer, sizeof answer, "%s\n%s\n\n", rows[i].line, rows[i].status);
        scip_ask(line, answer);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bytes_by_hand),
        cmocka_unit_test(ranges_to_the_millimetre),
        cmocka_unit_test(without_end),
        cmocka_unit_test(left_is_left),
        cmocka_unit_test(a_single_scan_begins_with_the_laser),
        cmocka_unit_test(clusters),
        cmocka_unit_test(echoes_and_intensity),
        cmocka_unit_test(marks_anywhere),
        cmocka_unit_test(codes_of_a_urg),
        cmocka_unit_test(parameters),
    };
    return cmocka_run_group_tests(tests, NULL, scip_teardown);
}
