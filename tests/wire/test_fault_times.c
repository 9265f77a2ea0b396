/* SPDX-License-Identifier: MIT */
/* Faults on request that cost a client time: replies that don't come, or come late; a stall, which makes a slow reader.
 * And the frames that a run still sends at its end. */
#include "tests/wire/fault_head.h"

/* ---- replies */

static void expect_no_reply(struct scanhead *sh, const char *command)
{
    char reply[600];
    assert_int_equal(scanhead_command(sh, command, reply, sizeof reply, 100), SCANHEAD_ETIMEOUT);
}

static void count(void *ctx, const struct scanhead_notice *notice)
{
    int *seen = ctx;
    seen[notice->kind]++;
}

static void test_replies_that_go_wrong(void **state)
{
    struct wire *wire = *state;
    int seen[SCANHEAD_NOTICE_REATTACHED + 1] = {0};
    struct head head = fault_head_start(wire, &FAULT_ROOM, NULL, NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    scanhead_on_notice(sh, count, seen);
    client_wait_state(sh, "idle");
    assert_string_equal(client_ask(sh, "FAUL:LIST?"), "none");
    fault_head_add(sh, "{kind: no_reply, at: 1}", "1");
    expect_no_reply(sh, "SYST:VERS?");
    assert_string_equal(client_ask(sh, "HEAD:STAT?"), "idle");
    fault_head_add(sh, "{kind: late_reply, at: 1, for_ms: 300}", "2");
    expect_no_reply(sh, "SYST:VERS?");
    assert_string_equal(client_ask(sh, "HEAD:STAT?"), "idle"); /* the answer, and not the late one */
    assert_int_equal(seen[SCANHEAD_NOTICE_LATE_REPLY], 1);
    fault_head_add(sh, "{kind: echo, at: 1}", "3");
    assert_string_equal(client_ask(sh, "SYST:VERS?"), "1999.0");
    assert_int_equal(seen[SCANHEAD_NOTICE_ECHO], 1);
    fault_head_add(sh, "{kind: wrong_reply, at: 1}", "4");
    assert_string_equal(client_ask(sh, "SYST:VERS?"), "4"); /* the reply of the command before: a client can't tell */
    assert_string_equal(client_ask(sh, "SYST:VERS?"), "1999.0");
    assert_string_equal(client_ask(sh, "FAUL:LIST?"), "1 no_reply, 2 late_reply, 3 echo, 4 wrong_reply");
    assert_string_equal(client_ask(sh, "FAUL:INJ?"), "4");
    assert_string_equal(client_ask(sh, "FAUL:INJ? 3"), "1");
    client_tell(sh, "FAUL:CLE 3");
    client_tell(sh, "FAUL:CLE ALL");
    assert_string_equal(client_ask(sh, "FAUL:LIST?"), "none");
    assert_string_equal(client_ask(sh, "FAUL:INJ? 3"), "1");
    assert_int_equal(seen[SCANHEAD_NOTICE_BAD_BYTES] + seen[SCANHEAD_NOTICE_UNASKED], 0);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* A client that goes on asking always has a late reply on its way. The head ends all the same. */
static void test_late_replies_do_not_keep_a_head(void **state)
{
    struct wire *wire = *state;
    struct room_config c = FAULT_ROOM;
    c.links = LINK_YAML_TCP;
    struct head head = fault_head_start(wire, &c, "faults: [{kind: late_reply, for_ms: 300}]\n", NULL);
    int fd = raw_connect(head_endpoint(&head, "tcp")), told[2];
    assert_int_equal(pipe2(told, O_CLOEXEC), 0);
    pid_t pid = wire_fork(wire);
    if (pid == 0) {
        char sink[4096];
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        while (write(fd, "*OPC?\n", 6) == 6)
            if (poll(&slot, 1, 50) > 0 && read(fd, sink, sizeof sink) > 0 && write(told[1], "r", 1) != 1) break;
        _exit(0);
    }
    close(fd);
    close(told[1]);
    char byte;
    assert_int_equal(read(told[0], &byte, 1), 1);
    head_end(&head, SIGTERM);
    close(told[0]);
}

/* Lines that wait for a step are carried out while its frames are taken. A fault that one of them adds strikes at the
 * replies to those after it. */
static void test_a_fault_strikes_at_once(void **state)
{
    static const char lines[] = "TIME:STEP 5 MS\nFAUL:ADD {kind: echo}\nSYST:VERS?\nSYST:VERS?\n",
                      want[] = "1\r\nSYST:VERS?\r\n1999.0\r\nSYST:VERS?\r\n1999.0\r\n";
    const char *const more[] = {"--pace", "step", NULL};
    struct wire *wire = *state;
    char got[8192];
    size_t n = 0;
    struct head head = fault_head_start(wire, &FAULT_ROOM, NULL, more);
    int fd = raw_connect(head_endpoint(&head, "tcp"));
    raw_send(fd, lines, sizeof lines - 1);
    while (n < 8 || memcmp(got + n - 8, "1999.0\r\n", 8) != 0 || memmem(got, n - 8, "1999.0\r\n", 8) == NULL) {
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        const ssize_t more_n = read(fd, got + n, sizeof got - n);
        assert_true(more_n > 0);
        n += (size_t)more_n;
    }
    assert_true(n >= sizeof want - 1);
    assert_memory_equal(got + n - (sizeof want - 1), want, sizeof want - 1);
    close(fd);
    head_end(&head, SIGTERM);
}

/* ---- stalls, and the end of the run */

/* The wire keeps about 140 kB, the queue 50 ms of 2 MB/s, so a stall of 300 ms is too long. */
static void test_a_stall_makes_a_slow_reader(void **state)
{
    struct wire *wire = *state;
    struct room_config c = FAULT_ROOM;
    struct scanhead_frame frame;
    uint64_t pulses = 0, told = 0;
    c.links = LINK_YAML_TCP;
    c.pan_stop_deg = 60;
    c.more = "loop: {queue_ms: 50, late_ms: 10000}\n";
    struct head head = fault_head_start(wire, &c, "faults: [{kind: stall, at: 100, for_ms: 300}]\n", NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    do {
        client_next(sh, &frame);
        if (frame.type == SCANHEAD_POINTS) pulses += frame.n_pulses;
        if (is_event(&frame, SCANHEAD_EV_READER_LOST)) told += frame.event_value[1];
    } while (!is_event(&frame, SCANHEAD_EV_SCAN_END));
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    assert_true(told > 0 && stats_link_uint(wire, "left_out_frames") > 0);
    assert_int_equal(stats_link_uint(wire, "left_out_pulses"), told);
    assert_int_equal(stats_link_uint(wire, "received_pulses"), pulses);
    assert_int_equal(stats_uint(wire, "pulses"), pulses + told);
}

/* Frames that would come within two seconds are not cut. Later ones are, and count as left out, also where each of
 * many stalls is shorter than that. */
static void test_the_end_waits_for_what_is_on_its_way(void **state)
{
    static const struct {
        const char *faults;
        int all;
    } cases[] = {{"faults: [{kind: delay, from: 50, for_ms: 400}, {kind: reorder, from: 100, every: 20, n: 1000}, "
                  "{kind: merge, from: 150, n: 64}]\n",
                  1},
                 {"faults: [{kind: stall, at: 100, for_ms: 1e8}]\n", 0},
                 {"faults: [{kind: stall, from: 100, for_ms: 700}]\n", 0}};
    struct wire *wire = *state;
    for (int i = 0; i < 3; i++) {
        const char *const more[] = {"--start", "--duration", "0.3", NULL};
        struct room_config c = FAULT_ROOM;
        c.links = "links: [{type: file, path: out.bin}]\n";
        struct head head = fault_head_start(wire, &c, cases[i].faults, more);
        head_end(&head, 0);
        const uint64_t received = stats_link_uint(wire, "received_pulses");
        const uint64_t left = stats_link_uint(wire, "left_out_pulses");
        assert_int_equal(received + left, stats_uint(wire, "pulses"));
        assert_int_equal(left == 0, cases[i].all);
        struct scanhead *sh = client_open(wire_path(wire, "out.bin"));
        struct scanhead_frame frame;
        uint64_t pulses = 0;
        while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK)
            if (frame.type == SCANHEAD_POINTS) pulses += frame.n_pulses;
        struct scanhead_stats stats;
        scanhead_get_stats(sh, &stats);
        assert_int_equal(stats.bad_bytes + stats.bad_payload, 0);
        if (!cases[i].all) assert_int_equal(pulses, received);
        if (cases[i].all) assert_true(stats.late > 0 && stats.late == stats.seq_lost); /* all there, in some order */
        scanhead_close(sh);
    }
}

/* Frames that a fault holds back, to reorder or merge them, go out at a power cycle at the latest. A run that waits for
 * its readers does not wait for such frames. */
static void test_power_does_not_wait_for_what_is_held(void **state)
{
    static const char *const held[] = {"{kind: reorder, at: 60, n: 1000}", "{kind: merge, at: 60, n: 64}"};
    const char *const more[] = {"--start", "--frames", "1", "--pace", "fast", NULL};
    struct wire *wire = *state;
    for (int i = 0; i < 2; i++) {
        char faults[256];
        struct room_config c = FAULT_ROOM;
        struct scanhead_stats stats;
        struct scanhead_frame frame;
        c.more = "loop: {queue_ms: 100}\n"; /* less than the time without power: the run waits for its reader */
        c.links = "links: [{type: file, path: out.bin}]\n";
        snprintf(faults, sizeof faults, "faults: [%s, {kind: power_cycle, from_pulse: 10000, for_ms: 300}]\n", held[i]);
        struct head head = fault_head_start(wire, &c, faults, more);
        head_end(&head, 0);
        assert_int_equal(stats_link_uint(wire, "left_out_frames"), 0);
        struct scanhead *sh = client_open(wire_path(wire, "out.bin"));
        while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK)
            continue;
        scanhead_get_stats(sh, &stats);
        assert_int_equal(stats.bad_bytes + stats.bad_payload, 0);
        assert_true(stats.late == stats.seq_lost && stats.late == (i == 0));
        scanhead_close(sh);
    }
}

/* Runs a VLP-16 whose packets go to out.bin. */
static void write_packets(struct wire *wire, const char *more, const char *option, const char *value)
{
    char config[352], stats[352], text[512];
    room_write(wire);
    snprintf(text, sizeof text,
             "head: {profile: velodyne-vlp16}\nscene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
             "stations: [{position_m: [0, 0, 0]}]\nlinks: [{type: file, protocol: velodyne, path: out.bin}]\n%s",
             more);
    wire_write_text(wire, "config.yaml", text);
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    const char *const args[] = {"run", config, "--start", option, value, "--stats", stats, "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
}

/* A packet of the dual return mode has 12 firing sequences of 16 pulses. The last pulses of a scan fill none, and are
 * counted. */
static void test_each_pulse_is_in_a_packet_or_counted(void **state)
{
    struct wire *wire = *state;
    write_packets(wire, "", "--frames", "2");
    const uint64_t unsent = stats_link_uint(wire, "unsent_pulses");
    assert_in_range(unsent, 1, 12 * 16 - 1);
    assert_int_equal(stats_uint(wire, "pulses"), 12 * 16 * stats_link_uint(wire, "sent_units") + unsent);
}

/* Packets that a fault holds back when power goes are neither sent nor counted as sent. Packets in the file are
 * counted. */
static void test_what_power_takes_is_not_sent(void **state)
{
    enum { PACKET_BYTES = 1206 };
    struct wire *wire = *state;
    write_packets(wire,
                  "faults: [{kind: delay, for_ms: 9000, from: 20}, {kind: power_cycle, for_ms: 1, from_s: 0.3}]\n",
                  "--duration", "0.3");
    size_t len;
    free(wire_read(wire_path(wire, "out.bin"), &len));
    assert_true(len > 0);
    assert_int_equal(stats_link_uint(wire, "sent_units") * PACKET_BYTES, len);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_replies_that_go_wrong, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_late_replies_do_not_keep_a_head, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_fault_strikes_at_once, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_stall_makes_a_slow_reader, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_the_end_waits_for_what_is_on_its_way, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_power_does_not_wait_for_what_is_held, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_each_pulse_is_in_a_packet_or_counted, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_what_power_takes_is_not_sent, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests_name("faults in time", tests, NULL, NULL);
}
