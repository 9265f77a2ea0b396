/* SPDX-License-Identifier: MIT */
/* Faults on the wire: replies that are missing, late or wrong, echoes, and the first reply that a fault counts. */
#include "tests/unit/wire_rig.h"

static struct fault f;

/* The text that went out must be this. */
static void expect_text(const char *text)
{
    if (rig.n_out != strlen(text) || memcmp(rig.out, text, rig.n_out) != 0)
        fail_msg("'%.*s' went out, not '%s'", (int)rig.n_out, (const char *)rig.out, text);
}

static void hear(const char *text)
{
    wire_heard_add(&rig.heard, text, strlen(text));
}

static void a_reply_that_is_dropped_is_missing(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_NO_REPLY);
    f.from = f.until = 2;
    rig_open(&f, 1, 1);
    rig_reply("1");
    rig_reply("2");
    rig_frame(RIG_STREAM); /* frames are not counted */
    rig_reply("3");
    rig_drain();
    rig_expect((const int[]){0, 2, 3, -1});
    assert_true(rig.n_notes == 1 && rig.note[0].number == 2 && rig.note[0].of == FAULT_OF_REPLIES);
}

/* The device time at which the fault ends is still to come: it is the tick in which the command took effect. */
static void a_fault_that_was_taken_out_changes_no_reply(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_NO_REPLY);
    rig_open(&f, 1, 1);
    rig_reply("1");
    assert_int_equal(fault_board_end(rig.board, 1, 1000000 * MS), 1);
    rig_reply("2");
    rig_drain();
    rig_expect((const int[]){1, -1});
}

static void frames_overtake_a_late_reply_and_replies_do_not(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_LATE_REPLY);
    f.at = 1;
    f.for_ms = 4.0;
    rig_open(&f, 1, 1);
    const int64_t due_ns = rig.now_ns + 4 * MS;
    rig_reply("late");
    rig_frame(RIG_STREAM);
    rig_reply("next");
    assert_int_equal(rig_take(0), 1);
    assert_int_equal(wire_next_ns(rig.wire), due_ns);
    rig.now_ns = due_ns - 1;
    assert_int_equal(rig_take(1), 0); /* nor at the end of the run */
    rig.now_ns = due_ns;
    assert_int_equal(rig_take(0), 2);
    rig_expect((const int[]){1, 0, 2, -1});
    rig_reply("4");
    assert_int_equal(rig_take(0), 1);
}

/* The wrong reply always differs from the right one. */
static void a_wrong_reply_is_wrong(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_WRONG_REPLY);
    rig_open(&f, 1, 1);
    rig_reply("42");
    rig_reply("43");
    rig_reply("43");
    rig_reply("OK");
    rig_reply("OK");
    rig_drain();
    expect_text("OK\r\n42\r\nOK\r\n43\r\n0\r\n");
    assert_int_equal(rig.n_notes, 5);
    rig_close();
    rig_open(&f, 1, 0); /* in another protocol the wrong reply is an earlier one */
    rig_unit(5, 1);
    rig_unit(6, 1);
    rig_drain();
    assert_true(rig.n_notes == 1 && rig.n_out == 10);
    assert_memory_equal(rig.out + 5, rig.item[0].bytes, 5);
}

/* An echo is that of the line that it answers, however the lines came. Lines without an answer are skipped. */
static void an_echo_is_that_of_the_replys_own_line(void **state)
{
    (void)state;
    char overlong[400], want[600];
    memset(overlong, 'x', sizeof overlong - 1);
    overlong[sizeof overlong - 1] = '\0';
    f = fault_of_kind(FAULT_ECHO);
    rig_open(&f, 1, 1);
    hear("A 1\nB?\r\n\r\n  \t\nC");
    rig_reply("a");
    rig_reply("b");
    hear("C\rD");
    hear("\n");
    hear(overlong);
    rig_reply("c");
    rig_reply("d");
    hear("\n");
    rig_reply("too long");
    rig_reply("to nothing");
    rig_drain();
    snprintf(want, sizeof want, "A 1\r\na\r\nB?\r\nb\r\nCC\r\nc\r\nD\r\nd\r\n%.256s\r\ntoo long\r\nto nothing\r\n",
             overlong);
    expect_text(want);
    assert_int_equal(rig.n_notes, 5);
    assert_true(rig.note[0].n == 5 && rig.note[2].n == 4);
    rig_close();
    rig_open(&f, 1, 0); /* in a protocol without lines the echo is all that came since the last answer */
    hear("\x02s\n");
    hear("\x03");
    rig_unit(7, 1);
    rig_drain();
    assert_true(rig.n_writes == 2 && rig.n_out == 11);
    assert_memory_equal(rig.out, "\x02s\n\x03", 4);
}

/* Blanks get an answer once they are longer than a command may be, and their beginning is the echo. */
static void blanks_are_a_line_where_they_are_too_long(void **state)
{
    (void)state;
    char blanks[258], want[300];
    memset(blanks, ' ', sizeof blanks - 1);
    blanks[sizeof blanks - 1] = '\0';
    f = fault_of_kind(FAULT_ECHO);
    rig_open(&f, 1, 1);
    hear(blanks + 1); /* 256 */
    hear("\n");
    rig_reply("to nothing");
    hear(blanks);
    hear("\n");
    rig_reply("too long");
    rig_drain();
    snprintf(want, sizeof want, "to nothing\r\n%s\r\ntoo long\r\n", blanks + 1);
    expect_text(want);
}

/* Up to 65536 bytes are kept until an answer. With one byte more all are forgotten, and only bytes after them are
 * echoed. */
static void so_much_is_heard_and_no_more(void **state)
{
    (void)state;
    enum { MOST = 65536, LINE = 256 };
    static char bytes[MOST + 1];
    memset(bytes, 'y', sizeof bytes);
    f = fault_of_kind(FAULT_ECHO);
    for (int over = 0; over < 2; over++) {
        rig_open(&f, 1, 0);
        wire_heard_add(&rig.heard, bytes, MOST - 1 + (size_t)over);
        wire_heard_add(&rig.heard, "z", 1);
        rig_unit(7, 1);
        rig_drain();
        assert_int_equal(rig.n_out, (over ? 1 : MOST) + 7);
        assert_int_equal(rig.out[rig.n_out - 8], 'z');
        rig_close();
        for (size_t i = LINE - 1; i < MOST; i += LINE)
            bytes[i] = '\n';
        rig_open(&f, 1, 1);
        wire_heard_add(&rig.heard, bytes, MOST);
        if (over) wire_heard_add(&rig.heard, "z", 1);
        rig_reply("a");
        rig_drain();
        assert_int_equal(rig.n_out, over ? 3 : LINE + 1 + 3);
        rig_close();
        memset(bytes, 'y', sizeof bytes);
    }
    rig_open(&f, 1, 0);
    wire_heard_add(&rig.heard, bytes, MOST + 1); /* too much at once is not kept at all */
    rig_unit(7, 1);
    rig_drain();
    assert_int_equal(rig.n_out, 7);
}

static void more_than_can_be_heard_does_no_harm(void **state)
{
    (void)state;
    f = fault_of_kind(FAULT_ECHO);
    rig_open(&f, 1, 1);
    for (int i = 0; i < 100000; i++)
        hear("*IDN?\n");
    for (int i = 0; i < 300; i++)
        rig_reply("a");
    rig_drain();
    assert_int_equal(rig.n_notes, 300);
}

/* Replies count from after the command that added the fault, without that command's own. */
static void replies_count_from_after_the_command(void **state)
{
    (void)state;
    uint32_t number;
    struct sh_err err;
    f = fault_of_kind(FAULT_NO_REPLY);
    f.at = 1;
    f.from_s = 0.0;
    rig_open(NULL, 0, 1);
    rig_reply("1");
    assert_int_equal(fault_board_add(rig.board, &f, 500 * MS, &number, &err), SH_OK);
    wire_renew(rig.wire, 2); /* two replies are owed: one from before, and the command's own */
    rig_reply("2");
    rig_reply("3");
    rig_reply("hit");
    rig_reply("5");
    rig_drain();
    expect_text("1\r\n2\r\n3\r\n5\r\n");
    assert_int_equal(rig.note[0].number, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(a_reply_that_is_dropped_is_missing, rig_teardown),
        cmocka_unit_test_teardown(a_fault_that_was_taken_out_changes_no_reply, rig_teardown),
        cmocka_unit_test_teardown(frames_overtake_a_late_reply_and_replies_do_not, rig_teardown),
        cmocka_unit_test_teardown(a_wrong_reply_is_wrong, rig_teardown),
        cmocka_unit_test_teardown(an_echo_is_that_of_the_replys_own_line, rig_teardown),
        cmocka_unit_test_teardown(blanks_are_a_line_where_they_are_too_long, rig_teardown),
        cmocka_unit_test_teardown(so_much_is_heard_and_no_more, rig_teardown),
        cmocka_unit_test_teardown(more_than_can_be_heard_does_no_harm, rig_teardown),
        cmocka_unit_test_teardown(replies_count_from_after_the_command, rig_teardown),
    };
    return cmocka_run_group_tests_name("faults on the wire, replies", tests, NULL, NULL);
}
