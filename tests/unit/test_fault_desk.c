/* SPDX-License-Identifier: MIT */
/* FAULt commands on the board of a run: what is added, counted and listed, and what a recording refuses. */
#include "firmware_sim/device/fault_desk.h"
#include "tests/unit/config_rig.h"

static struct fault_desk desk;
static char why[512];

static void open_desk(void)
{
    const struct fault_list none = {.n = 0};
    assert_loads(load_text(base));
    desk = (struct fault_desk){.cfg = cfg, .now_ns = 77};
    assert_int_equal(fault_board_create(&none, NULL, NULL, &desk.board, &err), SH_OK);
}

static int add(const char *text, uint32_t *number)
{
    why[0] = '\0';
    return fault_desk_commands.add(&desk, text, number, why, sizeof why);
}

static void faults_are_added_counted_and_removed(void **state)
{
    (void)state;
    struct fault_entry entry[FAULT_MAX];
    uint32_t number, n;
    uint64_t hits;
    char text[64];
    open_desk();
    assert_int_equal(add("{kind: drop, every: 7}", &number), 0);
    assert_int_equal(number, 1);
    assert_int_equal(add("{kind: laser_off}", &number), 0);
    assert_int_equal(number, 2);
    fault_board_copy(desk.board, entry, &n);
    assert_true(n == 2 && entry[0].since_ns == 77 && entry[0].fault.every == 7 && !entry[0].from_start);
    assert_int_equal(entry[1].fault.kind, FAULT_LASER_OFF);
    fault_board_note(desk.board, &(struct fault_note){.fault = 2, .byte = -1});
    for (int k = 0; k < 2; k++) {
        const struct command_faults *f = k == 0 ? &fault_desk_commands : &fault_desk_queries;
        assert_true(f->injected(&desk, 2, &hits) == 0 && hits == 1);
        assert_true(f->injected(&desk, 1, &hits) == 0 && hits == 0);
        assert_true(f->injected(&desk, 0, &hits) == 0 && hits == 1);
        assert_int_equal(f->injected(&desk, 3, &hits), -1);
        f->list(&desk, text, sizeof text);
        assert_string_equal(text, "1 drop, 2 laser_off");
    }
    assert_int_equal(add("{kind: dorp}", &number), -1);
    assert_non_null(strstr(why, "fault:1: faults[0].kind: \"dorp\" is not known"));
    /* The queries of a replay change nothing: its caller refuses changes. */
    assert_true(fault_desk_queries.add(&desk, "{kind: drop}", &number, why, sizeof why) == 0 && number == 0);
    assert_true(fault_desk_queries.remove(&desk, 1) == 1 && fault_desk_queries.remove(&desk, 0) == 0);
    assert_int_equal(fault_board_last(desk.board), 2);
    assert_int_equal(fault_desk_commands.remove(&desk, 1), 1);
    assert_int_equal(fault_desk_commands.remove(&desk, 1), 0);
    assert_int_equal(fault_desk_commands.remove(&desk, 0), 1);
    fault_desk_commands.list(&desk, text, sizeof text);
    assert_string_equal(text, "");
    fault_board_free(desk.board);
}

static void a_recording_has_no_head(void **state)
{
    (void)state;
    uint32_t number;
    open_desk();
    desk.no_head = 1;
    assert_int_equal(add("{kind: drop}", &number), 0);
    assert_int_equal(add("{kind: laser_off}", &number), -1);
    assert_string_equal(why,
                        "laser_off: it is a fault in the head, but a recording has no head; allowed are faults on the "
                        "wire and of links");
    assert_int_equal(fault_board_last(desk.board), 1);
    fault_board_free(desk.board);
}

/* A list that is too long for a reply says how many are not in it. "9 drop, " has 8 characters, "10 drop, " 9. */
static void a_long_list_is_cut_between_faults(void **state)
{
    (void)state;
    uint32_t number;
    char text[512], want[512];
    size_t room = sizeof ", and 32 more";
    open_desk();
    for (int i = 0; i < FAULT_MAX; i++)
        assert_int_equal(add("{kind: drop}", &number), 0);
    for (int n = 1; n <= 12; n++) {
        room += n == 1 ? 6 : n < 10 ? 8 : 9; /* the length that n faults need */
        for (int short_by = 0; short_by < 2; short_by++) {
            size_t used = 0;
            for (int i = 1; i <= n - short_by; i++)
                used += (size_t)snprintf(want + used, sizeof want - used, "%s%d drop", i > 1 ? ", " : "", i);
            snprintf(want + used, sizeof want - used, ", and %d more", FAULT_MAX - n + short_by);
            fault_desk_commands.list(&desk, text, room - (size_t)short_by);
            assert_string_equal(text, want);
        }
    }
    fault_board_free(desk.board);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(faults_are_added_counted_and_removed),
        cmocka_unit_test(a_recording_has_no_head),
        cmocka_unit_test(a_long_list_is_cut_between_faults),
    };
    return cmocka_run_group_tests_name("fault desk", tests, set_up, tear_down);
}
