/* SPDX-License-Identifier: MIT */
/* A cable that is pulled on request, by the program: what was begun goes on, or is reset, or is hung up; what the
 * head's queue could not hold is announced; the truth has the beginning and the end. And: connections that come while
 * the head has no power are not those that a fault counts. */
#include "tests/wire/fault_head.h"
#include "tests/wire/unit_faults.h"

/* As FAULT_ROOM, for nine tenths of a second: 90 lines, some 600 frames. */
static struct head start(struct wire *wire, const char *fault, const char *loop)
{
    char faults[200];
    struct room_config config = FAULT_ROOM;
    config.pan_stop_deg = 90;
    config.more = loop;
    snprintf(faults, sizeof faults, "faults: [{kind: cable, at: 60, %s}]\n", fault);
    return fault_head_start(wire, &config, faults, NULL);
}

/* The truth has two notes: the cable was pulled at frame 60, with this text, and the pull's end. */
static void check_truth(const struct wire *wire, int link, const char *text)
{
    uint32_t n;
    struct truth_note *note = truth_read(wire_path(wire, "truth.json"), link, &n);
    char *all = wire_read(wire_path(wire, "truth.json"), NULL);
    assert_int_equal(n, 2);
    for (uint32_t i = 0; i < n; i++)
        assert_string_equal(note[i].kind, "cable");
    assert_int_equal(note[0].number, 60);
    assert_string_equal(note[0].text, text);
    assert_null(memmem(all, (size_t)(strchr(all, '\n') - all), "\"ended\":true", 12));
    assert_non_null(strstr(strchr(all, '\n'), "\"ended\":true"));
    free(all);
    free(note);
}

/* The head's queue holds the frames of the 200 ms, and the client gets them all. */
static void goes_on(void **state)
{
    struct wire *wire = *state;
    struct head head = start(wire, "link: 1, count: 1, for_ms: 200", "loop: {queue_ms: 10000, late_ms: 10000}\n");
    struct scanhead *sh = client_open(head_link(&head, 0));
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    char seen[65], said[65];
    scanhead_hash_start(sh);
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:START");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.seq_lost + stats.reader_lost + stats.bad_payload + stats.bad_bytes, 0);
    scanhead_hash_hex(sh, seen);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    stats_hash(wire, said);
    assert_string_equal(seen, said);
    check_truth(wire, 1, "");
}

/* Each of the clients comes to the fault's frame, and there is one cable: it is pulled once. */
static void is_pulled_once_for_all(void **state)
{
    struct wire *wire = *state;
    struct head head = start(wire, "link: 1, for_ms: 200", "loop: {queue_ms: 10000, late_ms: 10000}\n");
    struct scanhead *sh[3];
    struct scanhead_frame frame;
    for (int i = 0; i < 3; i++) {
        sh[i] = client_open(head_link(&head, 0));
        client_wait_state(sh[i], "idle");
    }
    client_tell(sh[0], "SCAN:START");
    for (int i = 0; i < 3; i++)
        client_until(sh[i], SCANHEAD_EV_SCAN_END, &frame);
    for (int i = 0; i < 3; i++)
        scanhead_close(sh[i]);
    head_end(&head, SIGTERM);
    check_truth(wire, 1, "");
}

static int was_pulled(struct wire *wire)
{
    char *told = wire_read(wire_path(wire, "truth.json"), NULL);
    const int pulled = strstr(told, "\"cable\"") != NULL;
    free(told);
    return pulled;
}

/* A queue of 100 ms can't hold the frames of 400 ms: the client learns how many frames it lost. */
static void loses_what_the_queue_cant_hold(void **state)
{
    struct wire *wire = *state;
    struct head head = start(wire, "link: 1, count: 1, for_ms: 400", "loop: {queue_ms: 100, late_ms: 10000}\n");
    struct scanhead *sh = client_open(head_link(&head, 0));
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:START");
    for (int has_lost = 0; !has_lost || !was_pulled(wire);) { /* on a busy machine it may lose frames before the pull */
        client_next(sh, &frame);
        has_lost |= is_event(&frame, SCANHEAD_EV_READER_LOST);
    }
    scanhead_get_stats(sh, &stats);
    assert_true(stats.reader_lost > 0);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    assert_true(stats_uint(wire, "reader_lost_frames") >= stats.reader_lost);
    check_truth(wire, 1, "");
}

/* Reads until the connection ends. */
static void read_to_cut(struct scanhead *sh)
{
    struct scanhead_frame frame;
    int rc;
    while ((rc = scanhead_next(sh, &frame, DEADLINE_MS)) == SCANHEAD_OK)
        continue;
    assert_int_equal(rc, SCANHEAD_ECLOSED);
}

static void ends(struct wire *wire, int link, const char *fault, const char *text)
{
    struct head head = start(wire, fault, "loop: {queue_ms: 10000, late_ms: 10000}\n");
    struct scanhead *sh = client_open(head_link(&head, link - 1));
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:START");
    read_to_cut(sh);
    assert_int_equal(scanhead_reattach(sh, DEADLINE_MS), SCANHEAD_OK);
    client_ask(sh, "*IDN?");
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    check_truth(wire, link, text);
}

static void is_reset(void **state)
{
    ends(*state, 1, "link: 1, count: 1, for_ms: 100, reset: on", "reset");
}

/* A terminal is hung up, and its port is gone, as by unplug. */
static void hangs_up_a_terminal(void **state)
{
    ends(*state, 2, "link: 2, count: 1, for_ms: 100", "");
}

/* The head ends within the silence: its client hears of that. */
static void ends_with_the_head(void **state)
{
    struct wire *wire = *state;
    struct head head = start(wire, "link: 1, count: 1, for_ms: 1e6", "loop: {queue_ms: 10000, late_ms: 10000}\n");
    struct scanhead *sh = client_open(head_link(&head, 0)), *beside = client_open(head_link(&head, 1));
    struct scanhead_frame frame;
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:START");
    client_until(beside, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_close(beside);
    head_end(&head, SIGTERM);
    read_to_cut(sh);
    scanhead_close(sh);
    check_truth(wire, 1, "");
}

/* ---- connections to a head without power */

/* Returns the connection when the head answers on it, -1 when it ends without a byte. */
static int connect_answered(const struct head *head)
{
    char byte;
    const int fd = raw_connect(head_link(head, 0));
    struct pollfd slot = {.fd = fd, .events = POLLIN};
    const int is_sent = write(fd, "*IDN?\n", 6) == 6; /* else it is reset already */
    assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
    if (is_sent && read(fd, &byte, 1) == 1) return fd;
    close(fd);
    return -1;
}

/* In lock-step links stay open while power is off, as their clients grant the time. The fault refuses only the first
 * connection to a head with power. */
static void no_power_no_count(void **state)
{
    struct wire *wire = *state;
    static const char FAULTS[] = "faults: [{kind: power_cycle, from_s: 1, until_s: 1.1, for_ms: 2000}, "
                                 "{kind: refuse, link: 1, count: 1}]\n";
    struct head head = fault_head_start(wire, &FAULT_ROOM, FAULTS, (const char *const[]){"--pace", "step", NULL});
    struct scanhead *sh = client_open(head_link(&head, 1));
    char reply[64];
    for (int n = 0; scanhead_command(sh, "TIME:STEP 100 MS", reply, sizeof reply, DEADLINE_MS) == SCANHEAD_OK; n++)
        assert_in_range(n, 0, 20); /* until power goes: from 1 s on */
    assert_int_equal(scanhead_reattach(sh, DEADLINE_MS), SCANHEAD_OK);
    assert_string_equal(client_ask(sh, "HEAD:STAT?"), "off");
    /* The other link's thread may still be on its way: then it cuts this client, and refuses others for a moment. The
     * thread has been there once the step is written to this client, or this client is cut. */
    int fd = raw_connect_again(head_link(&head, 0), "*IDN?\n");
    client_tell(sh, "TIME:STEP 2500 MS");
    close(fd);
    assert_string_not_equal(client_ask(sh, "HEAD:STAT?"), "off");
    assert_int_equal(connect_answered(&head), -1);
    fd = connect_answered(&head);
    assert_true(fd >= 0);
    close(fd);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    char *told = wire_read(wire_path(wire, "truth.json"), NULL);
    assert_non_null(strstr(told, "\"connection\":1}"));
    free(told);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(goes_on, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(is_pulled_once_for_all, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(loses_what_the_queue_cant_hold, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(is_reset, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(hangs_up_a_terminal, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(ends_with_the_head, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(no_power_no_count, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
