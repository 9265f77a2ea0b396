/* SPDX-License-Identifier: MIT */
/* The PTP follower selects another master after two Announce messages of it in a row. Announce messages come at even
 * seconds. */
#include "tests/unit/device_rig.h"

#include <inttypes.h>

#define MASTER(identity, from_s, until_s)                                                                            \
    "FAULt:ADD {kind: ptp_grandmaster, from_s: " from_s ", until_s: " until_s ", grandmaster: " identity ", ns: 0, " \
    "clock_class: 6}"
#define A "0xec4670fffe0a1b2c"
#define B "0xec4670fffe0a1b2d"

/* Goes on to the next event of the follower. Returns its time; -1: none comes before until_tick. */
static int64_t next_event_ns(struct rig *rig, uint64_t until_tick)
{
    while (rig->next < until_tick) {
        assert_true(rig_claim(rig));
        const struct native_event *event = rig_event(rig, NATIVE_EV_PTP);
        if (event != NULL) return (int64_t)event->b;
    }
    return -1;
}

/* A is heard at 10 and 14 s, and the head's own master between. At 18 s it is A, at 20 s B, and then the own one. B
 * alone is heard twice in a row, at 24 and 26 s. */
static void a_master_is_selected_after_two_in_a_row(void **state)
{
    (void)state;
    static const char *const sets[] = {"time.epoch=2026-01-01T00:00:00Z", "time.ptp.follower=on"};
    static const char *const lines[] = {MASTER(A, "9", "11"), MASTER(A, "13", "15"), MASTER(A, "17", "19"),
                                        MASTER(B, "19", "21"), MASTER(B, "23", "27")};
    struct rig *rig = rig_open(NULL, sets, 2);
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++)
        assert_string_not_equal(rig_tell(rig, lines[i], 0), "");
    rig_go_to(rig, 6000);
    assert_int_equal(next_event_ns(rig, 27000), INT64_C(26000000000));
    assert_non_null(strstr(rig_tell(rig, "TIME:PTP?", rig->next - 1), "ec4670.fffe.0a1b2d"));
    rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_master_is_selected_after_two_in_a_row)};
    return cmocka_run_group_tests_name("ptp masters", tests, make_folder, remove_folder);
}
