/* SPDX-License-Identifier: MIT */
#include "tests/unit/bus_rig.h"

size_t make_event(uint8_t *to, size_t room, uint32_t seq)
{
    struct native_event e = {.code = NATIVE_EV_ERROR, .a = seq};
    size_t len = native_encode_event(to, room, &e, 1, 0);
    native_finish_frame(to, seq);
    return len;
}

void script_events(uint32_t from, uint32_t to)
{
    uint8_t raw[512];
    for (uint32_t seq = from; seq < to; seq++)
        fake_script(FAKE_IN, LIBUSB_TRANSFER_COMPLETED, raw, make_event(raw, sizeof raw, seq));
}

void expect_events(struct scanhead *sh, uint32_t from, uint32_t to)
{
    struct scanhead_frame frame;
    for (uint32_t seq = from; seq < to; seq++) {
        if (scanhead_next(sh, &frame, TIMEOUT_MS) != 0) fail_msg("frame %u: %s", (unsigned)seq, scanhead_error(sh));
        assert_int_equal(frame.seq, seq);
    }
}

int rig_begin(void **state)
{
    (void)state;
    fake_reset();
    bus.device[0] = (struct libusb_device){.present = 1, .maker = "Maker", .product = "Head", .serial = "SH-1"};
    return 0;
}

int rig_end(void **state)
{
    (void)state;
    fake_expect_nothing_left();
    return 0;
}

struct scanhead *open_head(const char *source)
{
    struct scanhead *sh;
    char err[512];
    if (scanhead_open(source, &sh, err, sizeof err) != 0) fail_msg("%s", err);
    return sh;
}

void close_head(struct scanhead *sh)
{
    scanhead_close(sh);
    assert_int_equal(bus.sessions, bus.gone ? 1 : 0);
}

void unplug(void)
{
    bus.gone = 1;
    bus.device[0].present = 0;
}
