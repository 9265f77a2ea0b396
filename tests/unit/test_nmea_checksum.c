/* SPDX-License-Identifier: MIT */
/* NMEA, position packets and data packets: units are changed on request, with right checksums where they have some. */
#include <stdlib.h>

#include "tests/common/nmea_reader.h"
#include "tests/unit/checksum_rig.h"
#include "tests/unit/velodyne_head.h"

static void open_rig(enum protocol_id id)
{
    protocol_rig_open(&rig, id, "Velodyne", "VLP-16");
    rig.fix = protocol_rig_fix;
    rig.ops->open(rig.protocol, 0);
    rig.ops->time(rig.protocol, 1000000);
    assert_int_equal(rig.n_units, 1);
}

/* Reads the sentences of a unit, one after the other. Angles and times of day must be within their limits. */
static size_t read_sentences(const uint8_t *unit, size_t len, int wanted, char *said)
{
    const char *at = (const char *)unit;
    struct nmea_line line;
    size_t n = 0;
    for (int i = 0; i < wanted; i++) {
        const char *end = memchr(at, '\n', len - (size_t)(at - (const char *)unit));
        assert_non_null(end);
        read_line(at, (size_t)(end + 1 - at), "", 0, &line);
        for (int k = 0; k < line.n; k++) {
            memcpy(said + n, line.field[k], strlen(line.field[k]) + 1);
            n += strlen(line.field[k]) + 1;
            if (k > 0 && strlen(line.field[k]) == 1 && strchr("NS", line.field[k][0]) != NULL)
                read_angle(line.field[k - 1], line.field[k], 2, "NS");
        }
        at = end + 1;
    }
    return n;
}

static const void *read_fix(const uint8_t *unit, size_t len, size_t *size)
{
    static char said[4096];
    *size = read_sentences(unit, len, NMEA_ALL_SENTENCES, said);
    return said;
}

/* The packet outside of its sentence is unchanged. */
static const void *read_position(const uint8_t *unit, size_t len, size_t *size)
{
    enum { AT_NMEA = 0xce };
    static char said[4096];
    assert_int_equal(len, 512);
    assert_memory_equal(unit, rig.bytes, AT_NMEA);
    assert_int_equal(unit[len - 1], 0);
    *size = read_sentences(unit + AT_NMEA, len - AT_NMEA, 1, said);
    return said;
}

/* Azimuths, time and mode are unchanged. */
static const void *read_data(const uint8_t *unit, size_t len, size_t *size)
{
    assert_int_equal(len, 1206);
    for (size_t at = 0; at < 1200; at += 100)
        assert_memory_equal(unit + at, rig.bytes + at, 4);
    assert_memory_equal(unit + 1200, rig.bytes + 1200, 6);
    static uint8_t said[1206];
    memcpy(said, unit, len);
    *size = len;
    return said;
}

/* Only decimals change: 2 of each time of day, 7 of each minute, and so on. */
static void sentences_say_something_else(void **state)
{
    (void)state;
    open_rig(PROTOCOL_NMEA);
    seal_check(rig.ops, rig.bytes, rig.len, read_fix);
    /* 030405.00: three bits of each 0 after the point, none before it. */
    uint8_t time[] = "$GPZDA,030405.00,02,01,2026,,*00\r\n", mask[sizeof time] = {0};
    rig.ops->content(time, sizeof time - 1, mask);
    for (size_t i = 0; i < sizeof time; i++)
        assert_int_equal(mask[i], i == 14 || i == 15 ? 7 : 0);
    protocol_rig_close(&rig);
}

static void positions_say_something_else(void **state)
{
    (void)state;
    open_rig(PROTOCOL_VELODYNE_POSITION);
    seal_check(rig.ops, rig.bytes, rig.len, read_position);
    protocol_rig_close(&rig);
}

/* A data packet has no checksum of its own. Its ranges change all the same. */
static void ranges_say_something_else(void **state)
{
    (void)state;
    velodyne_head_setup(NULL);
    protocol_rig_describe(&rig, 0);
    velodyne_head_fire_alike(0, 384, 12.34);
    assert_int_equal(rig.n_units, 1);
    assert_null(rig.ops->reseal);
    assert_int_equal(seal_count(rig.ops, rig.bytes, rig.len), 8 * 12 * 96);
    seal_check(rig.ops, rig.bytes, rig.len, read_data);
    protocol_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sentences_say_something_else),
        cmocka_unit_test(positions_say_something_else),
        cmocka_unit_test(ranges_say_something_else),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
