/* SPDX-License-Identifier: MIT */
/* A gadget and its controller: plugging in and out, speeds and states as the kernel writes them
 * (ABI/stable/sysfs-class-udc), the descriptions that FunctionFS gets (linux/usb/functionfs.h has the layout), and
 * gadgets of other containers. Bytes are written out by hand. */
#include "tests/unit/configfs_rig.h"
#include "tests/unit/usb_models.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/bytes.h"
#include "drivers/usb/gadget.h"
#include "drivers/usb/personalities.h"

static struct gadget gadget;
static struct sh_err err;

static void make(void)
{
    const struct usb_identity id = {.vid = 1, .pid = 2, .highest = USB_RATE_HIGH};
    if (gadget_create(&gadget, &pair_model, &id, &err) != SH_OK) fail_msg("%s", err.text);
}

static void expect_failure(int rc, const char *text)
{
    assert_int_equal(rc, strstr(text, "Device or resource busy") != NULL ? SH_EIO : SH_EINPUT);
    assert_string_equal(err.text, text);
    assert_string_equal(gadget.udc, "");
}

static void test_plugging(void **state)
{
    (void)state;
    make();
    expect_failure(gadget_bind(&gadget, "", &err),
                   "functionfs: no USB device controller in " CONFIGFS_UDCS
                   ": the machine has none, or its driver is not loaded (dwc2 on a Raspberry Pi; dummy_hcd to try "
                   "without one)");
    expect_failure(gadget_bind(&gadget, "none.0", &err),
                   "functionfs: there is no device controller none.0; " CONFIGFS_UDCS " lists the controllers");
    configfs_add_udc("udc.0", "not attached\n", "UNKNOWN\n", "high-speed\n");
    configfs.busy = "udc.0";
    expect_failure(gadget_bind(&gadget, "", &err),
                   "functionfs: none of the 1 device controllers accepts the gadget: Device or resource busy");
    expect_failure(gadget_bind(&gadget, "udc.0", &err), "functionfs: device controller udc.0: Device or resource busy");
    configfs_add_udc("udc.1", "not attached\n", "UNKNOWN\n", "high-speed\n");
    assert_int_equal(gadget_bind(&gadget, "", &err), SH_OK); /* the one that is free, wherever it is listed */
    assert_string_equal(gadget.udc, "udc.1");
    assert_string_equal(configfs_get(gadget.dir, "UDC"), "udc.1\n");
    gadget_unbind(&gadget);
    assert_string_equal(gadget.udc, "");
    assert_string_equal(configfs_get(gadget.dir, "UDC"), "\n");
    configfs.busy = NULL;
    assert_int_equal(gadget_bind(&gadget, "udc.0", &err), SH_OK);
    assert_string_equal(configfs_get(gadget.dir, "UDC"), "udc.0\n");
    gadget_remove(&gadget);
    assert_int_equal(configfs.was_bound, 0);
    assert_int_equal(configfs_count(), 0);
}

/* The states are those of USB 2.0's chapter 9, as the kernel calls them (usb_state_string). */
static void test_states(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        int on_bus, configured, still;
    } rows[] = {{"not attached\n", 0, 0, 0}, {"attached\n", 1, 0, 0},  {"powered\n", 1, 0, 0},
                {"default\n", 1, 0, 0},      {"addressed\n", 1, 0, 0}, {"configured\n", 1, 1, 1},
                {"suspended\n", 1, 0, 1},    {"\n", 0, 0, 0}};
    make();
    configfs_add_udc("udc.0", "attached\n", "", "");
    assert_int_equal(gadget_bind(&gadget, "udc.0", &err), SH_OK);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        configfs_add_udc("udc.0", rows[i].text, "", "");
        assert_int_equal(gadget_is_on_bus(&gadget), rows[i].on_bus);
        assert_int_equal(gadget_is_configured(&gadget, 0), rows[i].configured);
        assert_int_equal(gadget_is_configured(&gadget, 1), rows[i].still);
    }
    assert_int_equal(gadget_watch_state(&gadget, &err), SH_OK);
    char text[16] = "";
    configfs_add_udc("udc.0", "powered\n", "", "");
    assert_int_equal(read(gadget.state_fd, text, sizeof text), 8);
    assert_string_equal(text, "powered\n");
    const int fd = gadget.state_fd;
    gadget_remove(&gadget);
    assert_int_equal(gadget.state_fd, -1);
    assert_int_equal(fcntl(fd, F_GETFD), -1);
    /* Without a controller there is no state. */
    assert_int_equal(gadget_is_on_bus(&gadget), 0);
    assert_int_equal(gadget_is_configured(&gadget, 1), 0);
    snprintf(gadget.udc, sizeof gadget.udc, "gone");
    assert_int_equal(gadget_watch_state(&gadget, &err), SH_EIO);
    assert_string_equal(err.text, "functionfs: " CONFIGFS_UDCS "/gone/state: No such file or directory");
}

static void test_rates(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        enum usb_rate rate;
    } rows[] = {{"UNKNOWN\n", USB_RATE_FULL},      {"low-speed\n", USB_RATE_FULL},
                {"full-speed\n", USB_RATE_FULL},   {"high-speed\n", USB_RATE_HIGH},
                {"super-speed\n", USB_RATE_SUPER}, {"super-speed-plus\n", USB_RATE_SUPER}};
    static const struct {
        const char *most, *text;
        enum usb_rate wanted;
    } refused[] = {{"full-speed\n", "high speed; allowed full", USB_RATE_HIGH},
                   {"full-speed\n", "super speed; allowed full", USB_RATE_SUPER},
                   {"high-speed\n", "super speed; allowed full, high", USB_RATE_SUPER}};
    char text[160];
    make();
    configfs_add_udc("udc.0", "configured\n", "", "");
    assert_int_equal(gadget_bind(&gadget, "udc.0", &err), SH_OK);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        configfs_add_udc("udc.0", "configured\n", rows[i].text, "full-speed\n");
        assert_int_equal(gadget_rate(&gadget), rows[i].rate);
        configfs_add_udc("udc.0", "configured\n", "full-speed\n", rows[i].text);
        for (int wanted = 0; wanted < USB_N_RATES; wanted++)
            assert_int_equal(gadget_check_rate(&gadget, (enum usb_rate)wanted, &err) == SH_OK,
                             wanted <= (int)rows[i].rate);
    }
    for (size_t i = 0; i < sizeof refused / sizeof refused[0]; i++) {
        configfs_add_udc("udc.0", "configured\n", "", refused[i].most);
        snprintf(text, sizeof text, "functionfs: device controller udc.0 does not reach %s", refused[i].text);
        assert_int_equal(gadget_check_rate(&gadget, refused[i].wanted, &err), SH_EINPUT);
        assert_string_equal(err.text, text);
    }
    gadget_remove(&gadget);
}

/* ---- descriptions */

static int ep0[2];

static void describe(const struct usb_model *model, enum usb_rate highest)
{
    const struct usb_identity id = {.vid = 1, .pid = 2, .serial = "S1", .highest = highest};
    if (gadget_create(&gadget, model, &id, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, ep0), 0); /* keeps writes apart */
    if (gadget_describe(&gadget, ep0[0], &id, &err) != SH_OK) fail_msg("%s", err.text);
}

static void expect_write(const uint8_t *bytes, size_t n)
{
    uint8_t got[2048];
    assert_int_equal(recv(ep0[1], got, sizeof got, 0), n);
    for (size_t i = 0; i < n; i++)
        if (got[i] != bytes[i]) fail_msg("byte %zu is %02x, not %02x", i, got[i], bytes[i]);
}

static void end_description(void)
{
    close(ep0[0]);
    close(ep0[1]);
    gadget_remove(&gadget);
}

static size_t put(uint8_t *to, size_t at, const void *bytes, size_t n)
{
    memcpy(to + at, bytes, n);
    return at + n;
}

/* The bulk pair is described at full and high speed. Counts are of descriptors: an interface and two endpoints. WinUSB
 * is announced by a compatible id and by a property (OS descriptors 1.0). */
static void test_description(void **state)
{
    (void)state;
    static const uint8_t full[] = {9, 4, 0, 0, 2, 0xff, 1, 2, 1, 7, 5, 0x81, 2, 64, 0, 0, 7, 5, 2, 2, 64, 0, 0};
    static const uint8_t high[] = {9, 4, 0, 0, 2, 0xff, 1, 2, 1, 7, 5, 0x81, 2, 0, 2, 0, 7, 5, 2, 2, 0, 2, 0};
    static const uint8_t id[] = {
        0, 35, 0,   0,   0,   1,   0,   4,   0, 1, 0, /* interface 0, length, 1, index 4, one */
        0, 1,  'W', 'I', 'N', 'U', 'S', 'B', 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    static const uint8_t property[] = {0,  84, 0, 0, 0, 1, 0, 5, 0,  1, 0, /* 11 + 73 bytes, index 5, one */
                                       73, 0,  0, 0, 1, 0, 0, 0, 20, 0};   /* REG_SZ; 14 + 20 + 39 bytes */
    static const char name[20] = "DeviceInterfaceGUID", guid[39] = "{01234567-89AB-CDEF-0123-456789ABCDEF}";
    uint8_t want[400] = {3, 0, 0, 0, 0, 0, 0, 0, 1 | 2 | 8, 0, 0, 0, 3, 0, 0, 0, 3, 0, 0, 0, 2, 0, 0, 0};
    size_t at = put(want, 24, full, sizeof full);
    at = put(want, at, high, sizeof high);
    at = put(want, at, id, sizeof id);
    at = put(want, at, property, sizeof property);
    at = put(want, at, name, sizeof name);
    at = put(want, at, (const uint8_t[]){39, 0, 0, 0}, 4);
    at = put(want, at, guid, sizeof guid);
    le_put32(want + 4, (uint32_t)at);
    describe(&pair_model, USB_RATE_HIGH);
    expect_write(want, at);
    /* Only the interface has a string; the function has none. */
    static const uint8_t strings[] = {2, 0, 0, 0, 28,  0,    0,    0,   1,   0,    0,    0,    1,    0,
                                      0, 0, 9, 4, 'B', 0xc3, 0xa4, 'r', ' ', 0xf0, 0x9f, 0x90, 0xbb, 0};
    expect_write(strings, sizeof strings);
    end_description();
}

/* Functions may lack WinUSB, or have an id of their own and no property. The device has one speed here. */
static void test_plain_descriptions(void **state)
{
    (void)state;
    static const uint8_t two[] = {3,    0, 0, 0, 41, 0, 0, 0, 1, 0,    0, 0, 3, 0, 0, 0,    9, 4,  0, 0, 0,
                                  0xff, 0, 0, 0, 9,  4, 1, 0, 1, 0xff, 0, 0, 0, 7, 5, 0x82, 2, 64, 0, 0};
    static const uint8_t no_strings[] = {2, 0, 0, 0, 16, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    describe(&two_model, USB_RATE_FULL);
    expect_write(two, sizeof two);
    expect_write(no_strings, sizeof no_strings);
    end_description();
    const struct usb_function_row functions[2] = {{.first = 0, .count = 1, .compatible_id = "LONGNAME"},
                                                  {.first = 1, .count = 1, .compatible_id = "X"}};
    static const uint8_t ids[] = {0,   35,  0,   0, 0, 1, 0, 4, 0, 1, 0, 0, 1,   'L', 'O', 'N', 'G', 'N',
                                  'A', 'M', 'E', 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,   0,   0,   0,   0,   1,
                                  35,  0,   0,   0, 1, 0, 4, 0, 1, 0, 1, 1, 'X', 0,   0,   0,   0,   0,
                                  0,   0,   0,   0, 0, 0, 0, 0, 0, 0, 0, 0, 0,   0,   0,   0};
    struct usb_model model = two_model;
    model.function = functions;
    uint8_t want[200] = {3, 0, 0, 0, 115, 0, 0, 0, 9, 0, 0, 0, 3, 0, 0, 0, 2, 0, 0, 0};
    size_t at = put(want, 20, two + 16, sizeof two - 16);
    at = put(want, at, ids, sizeof ids);
    assert_int_equal(at, 115);
    describe(&model, USB_RATE_FULL);
    expect_write(want, at);
    end_description();
}

/* At super speed endpoints have companions: five descriptors in all. Only the stream of the head is described. */
static void test_super_speed(void **state)
{
    (void)state;
    uint8_t got[2048];
    describe(&scanhead_usb_model, USB_RATE_SUPER);
    const ssize_t n = recv(ep0[1], got, sizeof got, 0);
    assert_int_equal(le_get32(got + 4), n);
    assert_int_equal(le_get32(got + 8), 1 | 2 | 4 | 8);
    static const uint32_t counts[] = {3, 3, 5, 2};
    for (int i = 0; i < 4; i++)
        assert_int_equal(le_get32(got + 12 + 4 * i), counts[i]);
    assert_int_equal(got[28 + 2], 0); /* its interface has number 0 here */
    assert_int_equal(recv(ep0[1], got, sizeof got, 0), 18 + 2 * sizeof "Scanner stream");
    assert_int_equal(le_get32(got + 8), 2);
    assert_string_equal((const char *)got + 18, "Scanner stream");
    assert_string_equal((const char *)got + 33, "Scanner stream");
    end_description();
}

/* The kernel refuses the descriptors, or takes them and refuses the strings. */
static void test_refused_descriptions(void **state)
{
    (void)state;
    const struct usb_identity id = {.highest = USB_RATE_FULL};
    int pair[2];
    make();
    assert_int_equal(pipe(pair), 0);
    configfs.write_that_fails = 1;
    assert_int_equal(gadget_describe(&gadget, pair[1], &id, &err), SH_EIO);
    assert_string_equal(err.text, "functionfs: the kernel refuses the descriptors: No space left on device");
    configfs.write_that_fails = 2;
    assert_int_equal(gadget_describe(&gadget, pair[1], &id, &err), SH_EIO);
    assert_string_equal(err.text, "functionfs: the kernel refuses the strings: No space left on device");
    close(pair[0]);
    close(pair[1]);
    gadget_remove(&gadget);
}

/* Locks a gadget as another process does. -1: it is locked. */
static int lock(const char *path)
{
    const int fd = open(path, O_RDONLY | O_DIRECTORY);
    if (flock(fd, LOCK_EX | LOCK_NB) == 0) return fd;
    return close(fd), -1;
}

/* A container has its own numbers of processes, so a running head's gadget elsewhere seems left behind. Locks are the
 * file system's, whoever looks (flock(2)), and end with their process: the gadget stays that long. */
static void test_another_container(void **state)
{
    (void)state;
    static const char path[] = CONFIGFS_GADGETS "/scanhead-99999999-1-5"; /* proc(5), pid_max: no process has it */
    assert_int_equal(mkdir(path, 0755), 0);
    const int fd = lock(path);
    for (int runs = 1; runs >= 0; runs--) {
        make();
        assert_int_equal(access(path, F_OK) == 0, runs);
        assert_int_equal(lock(gadget.dir), -1); /* it shows that it is in use */
        gadget_remove(&gadget);
        assert_int_equal(configfs_count(), runs);
        if (runs) assert_int_equal(close(fd), 0);
    }
}

/* Another head may lock the new directory first, and remove it. A gadget without its lock is not used. */
static void test_no_lock(void **state)
{
    (void)state;
    const struct usb_identity id = {.vid = 1, .pid = 2, .highest = USB_RATE_HIGH};
    configfs.locks_first = 1;
    make();
    assert_non_null(strstr(gadget.name, "-1")); /* the next number */
    assert_int_equal(lock(gadget.dir), -1);
    gadget_remove(&gadget);
    configfs.locks_first = 1000; /* more than there are numbers to try */
    assert_int_equal(gadget_create(&gadget, &pair_model, &id, &err), SH_EIO);
    assert_non_null(strstr(err.text, "functionfs: no gadget in"));
    configfs.locks_first = 0;
    assert_int_equal(configfs_count(), 0);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, configfs_set_up, configfs_tear_down)
    const struct CMUnitTest tests[] = {TEST(test_plugging),
                                       TEST(test_another_container),
                                       TEST(test_no_lock),
                                       TEST(test_states),
                                       TEST(test_rates),
                                       TEST(test_description),
                                       TEST(test_super_speed),
                                       TEST(test_plain_descriptions),
                                       TEST(test_refused_descriptions)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
