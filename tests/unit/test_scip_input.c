/* SPDX-License-Identifier: MIT */
/* SCIP, the sensor's side: any bytes of a line, and a client that sends nonsense. */
#include "tests/unit/scip_rig.h"

static void bytes_in(const void *bytes, size_t len)
{
    rig.ops->input(rig.protocol, bytes, len);
}

/* Noise, of a wrong bit rate for example, is counted, but not answered. The line after it is. */
static void noise(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    bytes_in("V\0V\nQT\n", 7);
    scip_expect("QT\n00P\n\n");
    assert_int_equal(rig.count[PROTOCOL_INPUT_LOST], 3);
    bytes_in("\xff\xfe\x80\r\nQT\x7f\nBM\t\nQT\n", 16);
    scip_expect("QT\n00P\n\n");
    assert_int_equal(rig.count[PROTOCOL_INPUT_LOST], 3 + 3 + 3 + 3);
    assert_int_equal(rig.count[PROTOCOL_WRONG], 0);
}

/* A line that is too long gets an echo of the part that fits, and 0B. A client's line of 72 bytes has room for it. */
static void overlong_lines(void **state)
{
    (void)state;
    static char line[100002];
    char answer[80];
    scip_open("UTM-30LX");
    memset(line, 'Q', sizeof line);
    line[64] = '\n'; /* the longest that is read whole */
    bytes_in(line, 65);
    snprintf(answer, sizeof answer, "%.64s\n0Ee\n\n", line);
    scip_expect(answer);
    assert_int_equal(rig.count[PROTOCOL_INPUT_LOST], 0);
    line[64] = 'Q';
    line[100000] = '\n';
    bytes_in(line, 1000);
    assert_int_equal(rig.count[PROTOCOL_INPUT_LOST], 1000 - 64); /* whether its end comes or not */
    for (size_t at = 1000; at <= 100000; at += 1000)
        bytes_in(line + at, 100001 - at < 1000 ? 100001 - at : 1000);
    snprintf(answer, sizeof answer, "%.64s\n0Bb\n\n", line);
    scip_expect(answer);
    assert_int_equal(rig.count[PROTOCOL_INPUT_LOST], 100000 - 64);
    assert_int_equal(rig.count[PROTOCOL_WRONG], 2);
    scip_ask("QT\n", "QT\n00P\n\n");
}

/* Each of many lines that come at once has its answer, in order. Answers without room are lost. */
static void ten_thousand_at_once(void **state)
{
    (void)state;
    static char lines[10000 * 9 + 1];
    size_t len = 0;
    uint32_t i = 0;
    for (int k = 0; k < 10000; k++)
        len += (size_t)snprintf(lines + len, sizeof lines - len, "QT;%05d\n", k);
    scip_open("UTM-30LX");
    for (size_t half = 0; half < 2; half++) {
        const size_t cut = half == 0 ? 3000 * 9 : 4000 * 9;
        bytes_in(lines + half * 3000 * 9, cut - half * 3000 * 9);
        const char *at = (const char *)rig.bytes;
        for (; at < (const char *)rig.bytes + rig.len; at += 14, i++) {
            char answer[20];
            snprintf(answer, sizeof answer, "QT;%05u\n00P\n\n", i);
            assert_memory_equal(at, answer, 14);
        }
        protocol_rig_clear(&rig);
    }
    assert_int_equal(i, 4000);
    rig.room = 0;
    bytes_in(lines + 4000 * 9, len - 4000 * 9);
    scip_expect("");
    rig.room = SIZE_MAX;
    scip_ask("QT\n", "QT\n00P\n\n");
}

/* A scan without room is lost. The next one comes, and the count goes on as from a sensor on a bad line. */
static void scans_without_room(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("MD0000108000003\n", "MD0000108000003\n00P\n\n");
    rig.room = 100;
    scip_turn(0);
    scip_expect("");
    rig.room = SIZE_MAX;
    scip_turn(1);
    assert_memory_equal(rig.bytes, "MD0000108000001\n99b\n", 20);
}

/* The same bytes, cut anywhere, get the same answers. */
static void in_pieces(void **state)
{
    (void)state;
    static const char talk[] =
        "\nQT\r\nBM\nVV;tag\nII\nXX\nTM0\nTM1;a\rTM2\nMD0000108001000\nQT\nGD0000000401\n\x01\nPP\n";
    static uint8_t whole[8192];
    scip_open("UTM-30LX");
    bytes_in(talk, sizeof talk - 1);
    const size_t len = rig.len;
    memcpy(whole, rig.bytes, len);
    for (size_t size = 1; size < 20; size++) {
        scip_open("UTM-30LX");
        for (size_t at = 0; at < sizeof talk - 1; at += size)
            bytes_in(talk + at, sizeof talk - 1 - at < size ? sizeof talk - 1 - at : size);
        assert_int_equal(rig.len, len);
        assert_memory_equal(rig.bytes, whole, len);
    }
}

static uint32_t dice(uint32_t *seed, uint32_t n)
{
    *seed = *seed * 1664525u + 1013904223u;
    return (*seed >> 8) % n;
}

/* Makes a line near a command: with up to three bytes changed, left out or put in. */
static size_t odd_line(uint32_t *seed, char *line)
{
    static const char *const good[] = {"QT\n",
                                       "BM\n",
                                       "VV\n",
                                       "PP;x\n",
                                       "II\n",
                                       "RS\n",
                                       "RT\n",
                                       "RB\n",
                                       "TM0\n",
                                       "TM1\n",
                                       "TM2\n",
                                       "CR05\n",
                                       "CR00\n",
                                       "HS1\n",
                                       "%SL\n",
                                       "DB02\n",
                                       "SS115200\n",
                                       "DB03\n",
                                       "DB10\n",
                                       "\r\n",
                                       "SCIP2.0\n",
                                       "MD0000108001000\n",
                                       "ME0000108001012\n",
                                       "NE0000108000000\n",
                                       "ND0044072500203\n",
                                       "GD0000108001\n",
                                       "GE0010000301\n",
                                       "HE0000108099;tag\n",
                                       "MS0000108001900\n",
                                       "GS0000108000\n",
                                       "%TM1\n",
                                       "%ST\n",
                                       "%MD0000108001003\n",
                                       "%ME0000108001000;tag\n"};
    strcpy(line, good[dice(seed, sizeof good / sizeof *good)]);
    size_t len = strlen(line);
    for (uint32_t k = dice(seed, 8); k > 5 && len > 1; k--) {
        const size_t at = dice(seed, (uint32_t)len);
        const uint32_t how = dice(seed, 3);
        if (how == 0) line[at] = (char)dice(seed, 256);
        if (how == 1) memmove(line + at, line + at + 1, len-- - at);
        if (how == 2 && len < 60) memmove(line + at + 1, line + at, len++ - at);
    }
    return len;
}

/* Odd lines come among turns with missing frames. The session goes on, units stay within their bound (the rig asserts
 * it), and at the end it answers as usual. The seed is fixed. Sanitizers are in where the unit tests have them. */
static void nonsense(void **state)
{
    (void)state;
    static const char *const models[] = {"URG-04LX", "UTM-30LX", "UTM-30LX-EW", "UST-20LX", "other"};
    uint32_t seed = 20261122;
    for (size_t m = 0; m < sizeof models / sizeof *models; m++) {
        scip_open(models[m]);
        rig.attributes = (int)(m & 1);
        protocol_rig_describe(&rig, 0);
        const int n = rig.emitter.last_step - rig.emitter.first_step;
        for (uint32_t k = 0; k < 60; k++) {
            for (int i = 0; i <= n; i++)
                shot[i] = (struct protocol_rig_shot){.n = dice(&seed, 4), .range_m = {dice(&seed, 40), 60.0, 4294.0}};
            for (uint32_t i = 0; i < 40; i++) {
                char line[80];
                bytes_in(line, odd_line(&seed, line));
                if (i == 20 && dice(&seed, 3) != 0) scip_part(k, 0, (int)dice(&seed, (uint32_t)n));
                protocol_rig_clear(&rig);
            }
            if (dice(&seed, 3) != 0) scip_turn(k);
            protocol_rig_clear(&rig);
        }
        bytes_in("\nDB10\nTM2\nQT\n", 13);
        protocol_rig_clear(&rig);
        scip_ask("QT;end\n", "QT;end\n00P\n\n");
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(noise),
        cmocka_unit_test(overlong_lines),
        cmocka_unit_test(ten_thousand_at_once),
        cmocka_unit_test(scans_without_room),
        cmocka_unit_test(in_pieces),
        cmocka_unit_test(nonsense),
    };
    return cmocka_run_group_tests(tests, NULL, scip_teardown);
}
