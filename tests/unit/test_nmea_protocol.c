/* SPDX-License-Identifier: MIT */
/* The GNSS receiver as a protocol: from device time to sentences. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "tests/common/protocol_rig.h"

static struct protocol_rig rig;

static void open_rig(int64_t t_ns)
{
    protocol_rig_open(&rig, PROTOCOL_NMEA, "RIEGL", "VZ-400i");
    rig.fix = (struct nmea_fix){.talker = {'G', 'N'}, .year = 2026, .month = 1, .day = 1, .quality = 1, .hdop = 1.0};
    rig.ops->open(rig.protocol, t_ns);
}

/* There is a fix each second. A fix's sentences come once its time has passed, as one unit, and each once. */
static void each_fix_once_and_after_its_time(void **state)
{
    (void)state;
    const int64_t ms = 1000000;
    open_rig(0);
    for (int64_t t = 1; t <= 2500; t++) {
        rig.ops->time(rig.protocol, t * ms);
        /* Fixes are at 0, 1000 and 2000 ms; time(t) means that all before t has come. */
        assert_int_equal(rig.n_units, 1 + (t > 1000) + (t > 2000));
    }
    assert_int_equal(rig.ops->next_ns(rig.protocol), 3000 * ms);
    static const char *const types[NMEA_ALL_SENTENCES] = {"$GNRMC,", "$GNGGA,", "$GNGSA,", "$GNGST,", "$GNZDA,"};
    const char *at = (const char *)rig.bytes;
    for (int i = 0; i < NMEA_ALL_SENTENCES; i++) {
        assert_memory_equal(at, types[i], 7);
        at = strchr(at, '\n') + 1;
    }
    assert_int_equal(at - (const char *)rig.bytes, rig.end[0]);
    protocol_rig_close(&rig);
}

/* A client that comes later gets the fixes from then on. A jump of time sends all of its fixes at once. */
static void from_the_session_s_begin_on(void **state)
{
    (void)state;
    const int64_t second = 1000000000;
    open_rig(5 * second + 1);
    rig.ops->time(rig.protocol, 6 * second);
    assert_int_equal(rig.n_units, 0);
    rig.ops->time(rig.protocol, 9 * second + 1);
    assert_int_equal(rig.n_units, 4); /* 6, 7, 8, 9 s */
    protocol_rig_close(&rig);
}

/* The protocol takes no commands: received bytes are counted, and get no answer. */
static void what_comes_is_counted(void **state)
{
    (void)state;
    open_rig(0);
    protocol_rig_input(&rig, "$PUBX,00*33\r\n");
    assert_int_equal(rig.n_units, 0);
    assert_int_equal(rig.n_lines, 0);
    assert_int_equal(rig.count[PROTOCOL_INPUT_LOST], 13);
    protocol_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_fix_once_and_after_its_time),
        cmocka_unit_test(from_the_session_s_begin_on),
        cmocka_unit_test(what_comes_is_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
