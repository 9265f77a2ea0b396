/* SPDX-License-Identifier: MIT */
/* Tests of a head that shows itself as a SICK TiM561: what its users' programs find and do over libusb.
 *
 * The sequence is sick_tim's: open by ids, claim interface 0, bulk OUT 02h, and bulk IN 81h with reads of 65535 bytes.
 * A command is followed by one read, which must be its reply, and events come after sEN. One transfer must hold one
 * telegram. CoLa-A is STX, fields with a blank between, and ETX. CoLa-B is four STX, the length (big-endian), the
 * payload and its XOR. The distances must be those of the room, at the right angles: -45 to 225 deg counter-clockwise,
 * with 90 ahead. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <libusb.h>
#include <math.h>
#include <cmocka.h>

#include "tests/guest/plan_room.h"

/* This is ample for an emulated machine, so only a head that never answers reaches it. */
enum { WAIT_MS = 240000, MOST = 65535, BEAMS = 811, OUT = 0x02, IN = 0x81 };

static libusb_context *ctx;
static libusb_device_handle *dev;
static uint8_t in[MOST + 1];
static int n_in;

static int open_device(void **state)
{
    const struct timespec pause = {.tv_nsec = 50000000};
    (void)state;
    /* The context is made anew each time. Without a udev daemon, as in the guest, it knows only the devices that were
     * there when it was made. */
    for (int i = 0; i < WAIT_MS / 50 && dev == NULL; i++) {
        if (i > 0) nanosleep(&pause, NULL);
        if (ctx != NULL) libusb_exit(ctx);
        if (libusb_init(&ctx) != 0) return -1;
        dev = libusb_open_device_with_vid_pid(ctx, 0x19a2, 0x5001);
    }
    return dev != NULL ? libusb_claim_interface(dev, 0) : -1;
}

static int close_device(void **state)
{
    (void)state;
    libusb_close(dev);
    libusb_exit(ctx);
    return 0;
}

static void send(const void *bytes, int len)
{
    int n = 0;
    assert_int_equal(libusb_bulk_transfer(dev, OUT, (uint8_t *)(uintptr_t)bytes, len, &n, WAIT_MS), 0);
    assert_int_equal(n, len);
}

/* Reads once, as the clients do, and returns libusb's status. The bytes are in `in`, with a NUL after them. */
static int receive(unsigned timeout_ms)
{
    n_in = 0;
    const int rc = libusb_bulk_transfer(dev, IN, in, MOST, &n_in, timeout_ms);
    in[n_in] = '\0';
    return rc;
}

/* The transfer must be one telegram of CoLa-A, from its STX to its ETX, with no other one in it. */
static void check_telegram(void)
{
    assert_true(n_in > 2);
    assert_int_equal(in[0], 2);
    assert_int_equal(in[n_in - 1], 3);
    assert_null(memchr(in + 1, 2, (size_t)n_in - 1));
    assert_null(memchr(in + 1, 3, (size_t)n_in - 2));
}

static void expect_reply(const char *begin)
{
    assert_int_equal(receive(WAIT_MS), 0);
    check_telegram();
    if (strncmp((char *)in + 1, begin, strlen(begin)) != 0) fail_msg("%s instead of %s", in, begin);
}

static void ask(const char *command, const char *reply)
{
    char text[128];
    send(text, snprintf(text, sizeof text, "\002%s\003", command));
    expect_reply(reply);
}

/* ---- identity */

static void test_identity(void **state)
{
    struct libusb_device_descriptor d;
    struct libusb_config_descriptor *config;
    char text[64];
    int value = 0;
    (void)state;
    assert_int_equal(libusb_get_device_descriptor(libusb_get_device(dev), &d), 0);
    assert_int_equal(d.bDeviceClass, 0);
    assert_true(libusb_get_string_descriptor_ascii(dev, d.iProduct, (uint8_t *)text, sizeof text) > 0);
    assert_string_equal(text, "TIM3xx");
    assert_int_equal(libusb_get_configuration(dev, &value), 0);
    assert_int_equal(value, 1);
    assert_int_equal(libusb_get_config_descriptor(libusb_get_device(dev), 0, &config), 0);
    assert_int_equal(config->bNumInterfaces, 1);
    const struct libusb_interface_descriptor *i = config->interface[0].altsetting;
    assert_int_equal(i->bInterfaceClass, LIBUSB_CLASS_VENDOR_SPEC);
    assert_int_equal(i->bNumEndpoints, 2);
    for (int k = 0; k < 2; k++) {
        assert_int_equal(i->endpoint[k].bEndpointAddress, k == 0 ? IN : OUT);
        assert_int_equal(i->endpoint[k].bmAttributes, LIBUSB_TRANSFER_TYPE_BULK);
    }
    libusb_free_config_descriptor(config);
}

/* ---- commands */

static void test_start(void **state)
{
    (void)state;
    assert_int_equal(receive(100), LIBUSB_ERROR_TIMEOUT); /* nothing comes without a request */
    assert_int_equal(n_in, 0);
    ask("sRI0", "sRA 0 6 TiM561 ");
    ask("sRN SerialNumber", "sRA SerialNumber ");
    ask("sRN FirmwareVersion", "sRA FirmwareVersion ");
    ask("sRN SCdevicestate", "sRA SCdevicestate 1");
    send("\002sRN SCdev", 10); /* the telegram comes in pieces */
    send("icestate\003", 9);
    expect_reply("sRA SCdevicestate 1");
}

/* ---- scans */

static const char *field(const char *telegram, int n)
{
    for (; n > 0 && telegram != NULL; n--)
        telegram = strchr(telegram + 1, ' ');
    assert_non_null(telegram);
    return telegram;
}

static unsigned long number(int n)
{
    return strtoul(field((char *)in, n), NULL, 16);
}

static void check_room(void)
{
    enum { START = 23, STEP, N, DISTANCES };
    const int32_t start = (int32_t)(uint32_t)number(START);
    assert_int_equal(start, -450000);
    assert_int_equal(number(STEP), 3333);
    assert_int_equal(number(N), BEAMS);
    const char *at = field((char *)in, DISTANCES);
    for (int i = 0; i < BEAMS; i++) {
        char *end;
        const unsigned long mm = strtoul(at, &end, 16);
        const double left_rad = (i / 3.0 - 135) * acos(-1) / 180, want_mm = 1000 * plan_room_range_m(left_rad);
        if (fabs((double)mm - want_mm) > 1) fail_msg("beam %d: %lu mm, the wall is at %.1f", i, mm, want_mm);
        at = end;
    }
}

static void end_events(void)
{
    send("\002sEN LMDscandata 0\003", 19);
    do
        assert_int_equal(receive(WAIT_MS), 0); /* a scan may come first */
    while (memcmp(in + 1, "sEA LMDscandata 0", 17) != 0);
}

/* Each telegram is there and carries its own count (field 7), even if the client gives up reads again and again. With
 * PATIENT in the environment no read is given up: over usbredir a telegram was lost once, presumably because its answer
 * crossed the read's cancellation on the socket. */
static void test_events(void **state)
{
    const int patient = getenv("PATIENT") != NULL;
    enum { COUNTER = 7, N_SCANS = 20, IMPATIENT_MS = 5 };
    unsigned long before = 0;
    int given_up = 0, whole = 0;
    (void)state;
    ask("sEN LMDscandata 1", "sEA LMDscandata 1");
    /* On a busy machine the next telegram may be there whenever a read begins. So the loop goes on until one read was
     * given up. */
    for (int i = 0; i < N_SCANS || (!patient && given_up == 0 && i < 50 * N_SCANS);) {
        const int impatient = !patient && i >= N_SCANS / 2, rc = receive(impatient ? IMPATIENT_MS : WAIT_MS);
        if (rc == LIBUSB_ERROR_TIMEOUT && n_in == 0 && impatient) {
            assert_true(++given_up < 10000);
            continue;
        }
        if (rc != 0 && n_in == 0) fail_msg("%s", libusb_error_name(rc));
        check_telegram();
        assert_memory_equal(in + 1, "sSN LMDscandata ", 16);
        if (i > 0) assert_int_equal((number(COUNTER) - before) & 0xffff, 1);
        before = number(COUNTER);
        check_room();
        whole += n_in % libusb_get_max_packet_size(libusb_get_device(dev), IN) == 0;
        i++;
    }
    print_message("%d reads given up, %d telegrams of whole packets\n", given_up, whole);
    assert_true(patient || given_up > 0);
    end_events();
    assert_int_equal(receive(200), LIBUSB_ERROR_TIMEOUT);
}

/* This runs after a failure, too, so that the next test finds a head that is still. */
static int no_events(void **state)
{
    (void)state;
    end_events();
    return 0;
}

/* ---- lengths that ask for a packet of no bytes */

static void put_be32(uint8_t *at, uint32_t v)
{
    for (int i = 0; i < 4; i++)
        at[i] = (uint8_t)(v >> (24 - 8 * i));
}

static int poll_binary(uint8_t *frame)
{
    static const char payload[] = "sRN LMDscandata";
    uint8_t sum = 0;
    const int n = (int)sizeof payload - 1;
    memset(frame, 2, 4);
    put_be32(frame + 4, (uint32_t)n);
    memcpy(frame + 8, payload, (size_t)n);
    for (int i = 0; i < n; i++)
        sum ^= (uint8_t)payload[i];
    frame[8 + n] = sum;
    return 9 + n;
}

/* Selects beams from the first on, 1/3 deg each, so that n of them are sent. */
static void set_beams(int n)
{
    char text[96];
    snprintf(text, sizeof text, "sWN LMPoutputRange 1 D05 FFF92230 %lX",
             (unsigned long)(uint32_t)(-450000 + (int32_t)lround((n - 1) * 10000 / 3.0)));
    ask(text, "sWA LMPoutputRange");
}

/* In CoLa-B the length is 119 + 3 n for n beams with an 8-bit RSSI. 131 beams (512 bytes) and 643 beams (2048 bytes)
 * make whole packets at full and at high speed, and their neighbours do not. A read of 65535 bytes ends there only by
 * the packet of no bytes. */
static void test_whole_packets(void **state)
{
    static const int beams[] = {130, 131, 132, 643, 644};
    uint8_t frame[64];
    (void)state;
    ask("sMN SetAccessMode 03 F4724744", "sAN SetAccessMode 1");
    for (size_t i = 0; i < sizeof beams / sizeof beams[0]; i++) {
        set_beams(beams[i]);
        for (int again = 0; again < 2; again++) {
            send(frame, poll_binary(frame));
            assert_int_equal(receive(WAIT_MS), 0);
            assert_int_equal(n_in, 119 + 3 * beams[i]);
            assert_memory_equal(in, "\002\002\002\002", 4);
            assert_int_equal(in[4] << 24 | in[5] << 16 | in[6] << 8 | in[7], n_in - 9);
            assert_memory_equal(in + 8, "sRA LMDscandata ", 16);
        }
    }
    set_beams(BEAMS);
    ask("sMN Run", "sAN Run 1");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_identity),
        cmocka_unit_test(test_start),
        cmocka_unit_test_teardown(test_events, no_events),
        cmocka_unit_test(test_whole_packets),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
