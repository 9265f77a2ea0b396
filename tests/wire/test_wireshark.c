/* SPDX-License-Identifier: MIT */
/* These tests compare the dissector in Wireshark with libscanhead: frames of every kind over TCP, on USB and in packets
 * of their own. Each value is compared. */
#include "tests/wire/dissected_frames.h"

#include "drivers/protocol/native.h"

static void put_user0(struct capture *c, uint32_t interface, const uint8_t *bytes, size_t len)
{
    for (size_t at = 0; at < len; at += native_frame_len(bytes + at))
        capture_packet(c, interface, bytes + at, native_frame_len(bytes + at));
}

/* The long stream is on TCP alone, as it takes as long as all others. In packets of one frame none can begin within
 * one. */
static int n_streams(int carrier)
{
    return N_STREAMS - carrier;
}

static void write_clean(void)
{
    struct capture c = {0};
    capture_begin(&c);
    const uint32_t ethernet = capture_interface(&c, CAPTURE_ETHERNET), usb = capture_interface(&c, CAPTURE_USBMON);
    const uint32_t user0 = capture_interface(&c, CAPTURE_USER0);
    for (int carrier = 0; carrier < 3; carrier++)
        for (int i = 0; i < n_streams(carrier); i++) {
            size_t len;
            char *bytes = wire_read(wire_path(wire, stream_name[i]), &len);
            if (carrier == 0) put_tcp(&c, ethernet, i, (uint8_t *)bytes, len);
            if (carrier == 1) put_usb(&c, usb, i, (uint8_t *)bytes, len);
            if (carrier == 2) put_user0(&c, user0, (uint8_t *)bytes, len);
            free(bytes);
        }
    wire_write(wire, "clean.pcapng", c.bytes, c.len);
    free(c.bytes);
}

/* The second answer has its command in this capture; the first one's is before it. */
static void expect_tcp_lines(int number)
{
    if (number != JOINED) { /* the stream is not known yet: the first bytes in a segment */
        expect_text(S "reply", "est,1,scanhead native 1");
        expect_text(S "reply", "idle");
    }
    expect_text(S "command", "*IDN?");
    expect_text(S "command", "HEAD:STATe?");
    expect_text(S "reply", "ERR -222,\"Data out of range\"");
    expect_int(S "reply.error", -222);
    expect_text(S "reply", "idle");
}

static void expect_usb_lines(void)
{
    expect_text(S "command", "TIME?");
    expect_text(S "reply", "123456");
}

/* Nothing is malformed. Whole scans miss nothing, and the line of the samples has 3 of its 400 pulses. Warnings are
 * of two kinds: the LOCAL event of the samples, once on each carrier, and the jumps from one stream to the next in
 * packets of their own. */
static void expect_marks(void)
{
    int n_lost = 0;
    while (dissected_left(S "missing_pulses") > 0)
        expect_int(S "missing_pulses", 0);
    while (dissected_left(S "line_end.lost_pulses") > 0) {
        const char *lost = take_text(S "line_end.lost_pulses");
        n_lost += strcmp(lost, "397") == 0;
        assert_true(strcmp(lost, "0") == 0 || strcmp(lost, "397") == 0);
    }
    assert_int_equal(n_lost, 3);
    while (dissected_left(S "command_in") > 0)
        take_text(S "command_in");
    while (dissected_left(S "reply_in") > 0)
        take_text(S "reply_in");
    assert_int_equal(dissected_left(S "bad_bytes"), 2); /* before the first header, on TCP and on USB */
    take_text(S "bad_bytes");
    take_text(S "bad_bytes");
    int n_warnings = 0;
    while (dissected_left("_ws.expert.severity") > 0) {
        const int severity = atoi(take_text("_ws.expert.severity"));
        n_warnings += severity == EXPERT_WARN;
        assert_true(severity < EXPERT_ERROR);
    }
    assert_int_equal(n_warnings, 3 + n_streams(2) - 1);
}

static void test_every_value(void **state)
{
    (void)state;
    write_clean();
    dissect("clean.pcapng", 1, all_fields);
    for (int carrier = 0; carrier < 3; carrier++) {
        unsigned types = 0;
        for (int i = 0; i < n_streams(carrier); i++) {
            types |= expect_stream(stream_name[i]);
            if (carrier == 0) expect_tcp_lines(i);
            if (carrier == 1) expect_usb_lines();
        }
        assert_int_equal(types, 0x1ffe); /* 1 to 12 */
    }
    expect_marks();
    expect_no_more();
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_every_value)};
    return cmocka_run_group_tests(tests, wireshark_setup, wire_teardown);
}
