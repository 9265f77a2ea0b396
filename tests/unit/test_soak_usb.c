/* SPDX-License-Identifier: MIT */
/* Faults of enumerations in a soak: each one is judged once a client has opened the device, or hidden with the reason.
 * A slow enumeration shows by its time, and a wrong length in the descriptors that a kernel keeps. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "drivers/link/link.h"
#include "drivers/usb/backend.h"
#include "firmware_sim/app/studio/soak/row.h"
#include "firmware_sim/app/studio/soak/usb.h"

static struct soak_plugs plugs;
static struct soak_row rows[SOAK_N_ROWS];
static struct soak_row *const row = &rows[FAULT_SLOW_ENUMERATION];

static void begin(void)
{
    plugs.n = 0;
    memset(rows, 0, sizeof rows);
}

static void plug(uint64_t number, double for_ms)
{
    const struct fault_note note = {.kind = FAULT_SLOW_ENUMERATION, .number = number, .for_ms = for_ms};
    soak_usb_plugged(&plugs, rows, &note);
}

/* A client opens a device by three requests, each of which is late by for_ms; 5 ms are the margin. */
static void slow_ones_are_noticed_by_their_time(void **state)
{
    static const struct {
        double for_ms, opened_ms;
        unsigned noticed, missed, hidden;
    } cases[] = {{10.0, 25.0, 1, 0, 0},
                 {10.0, 24.9, 0, 1, 0},
                 {9.9, 1000.0, 0, 0, 1},
                 {100.0, 295.0, 1, 0, 0},
                 {100.0, 294.9, 0, 1, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        begin();
        plug(1, cases[i].for_ms);
        soak_usb_opened(&plugs, rows, "usb:1:2:NONE", cases[i].opened_ms);
        assert_int_equal(row->noticed, cases[i].noticed);
        assert_int_equal(row->missed, cases[i].missed);
        assert_int_equal(row->hidden, cases[i].hidden);
        if (row->hidden != 0) assert_string_equal(row->why, "shorter than 10 ms");
        soak_usb_opened(&plugs, rows, "usb:1:2:NONE", 1e6); /* each is judged once */
        assert_int_equal(row->noticed + row->missed + row->hidden, 1);
    }
}

/* ---- descriptors that a kernel keeps, in one folder for each device. The folders are of the test's own. */

static char *sys_device[3];

int glob(const char *pattern, int flags, int (*failed)(const char *path, int number), glob_t *found)
{
    assert_string_equal(pattern, "/sys/bus/usb/devices/*");
    assert_true(flags == 0 && failed == NULL);
    if (sys_device[0] == NULL) return GLOB_NOMATCH;
    *found = (glob_t){.gl_pathc = 3, .gl_pathv = sys_device};
    return 0;
}

void globfree(glob_t *found)
{
    assert_ptr_equal(found->gl_pathv, sys_device);
}

static void put_file(const char *in, const char *name, const uint8_t *bytes, size_t len)
{
    char path[256];
    snprintf(path, sizeof path, "%s/%s", in, name);
    FILE *out = fopen(path, "w");
    assert_non_null(out);
    assert_int_equal(fwrite(bytes, 1, len, out), len);
    assert_int_equal(fclose(out), 0);
}

static void remove_device(const char *of)
{
    static const char *const names[] = {"serial", "descriptors"};
    char path[256];
    for (size_t i = 0; i < 2; i++) {
        snprintf(path, sizeof path, "%s/%s", of, names[i]);
        unlink(path);
    }
    assert_int_equal(rmdir(of), 0);
}

static uint64_t judged_noticed(const char *source, uint32_t announced)
{
    const struct fault_note note = {.kind = FAULT_DESCRIPTOR_LENGTH, .n = announced};
    begin();
    soak_usb_plugged(&plugs, rows, &note);
    soak_usb_opened(&plugs, rows, source, 1e6);
    assert_int_equal(rows[FAULT_DESCRIPTOR_LENGTH].noticed + rows[FAULT_DESCRIPTOR_LENGTH].missed, 1);
    return rows[FAULT_DESCRIPTOR_LENGTH].noticed;
}

/* A device descriptor has 18 bytes, and bytes 2 and 3 of a configuration descriptor are its whole length (USB 2.0,
 * tables 9-8 and 9-10). The second device announces 261 bytes, and 256 are there: 5 too many. The first one has another
 * serial number, which begins with the same letters; the third one has no files, as a hub's interface. */
static void bytes_that_are_not_there_are_noticed(void **state)
{
    char device[3][64];
    uint8_t descriptors[18 + 256] = {18, 1, [18] = 9, 2, 261 & 0xff, 261 >> 8};
    (void)state;
    for (int i = 0; i < 3; i++) {
        strcpy(device[i], "/tmp/scanhead-sys-XXXXXX");
        sys_device[i] = mkdtemp(device[i]);
        assert_non_null(sys_device[i]);
    }
    put_file(device[0], "serial", (const uint8_t *)"SN12\n", 5);
    put_file(device[0], "descriptors", descriptors, 18 + 100);
    put_file(device[1], "serial", (const uint8_t *)"SN1\n", 4);
    put_file(device[1], "descriptors", descriptors, sizeof descriptors);
    assert_int_equal(judged_noticed("usb:1:2:SN1", 5), 1);
    assert_int_equal(judged_noticed("usb:1:2:SN1", 4), 0);
    assert_int_equal(judged_noticed("usb:1:2:SN12", 161), 1);
    assert_int_equal(judged_noticed("usb:1:2:SN", 5), 0);
    put_file(device[1], "descriptors", descriptors, 18 + 4); /* all that is needed to know */
    assert_int_equal(judged_noticed("usb:1:2:SN1", 257), 1);
    put_file(device[1], "descriptors", descriptors, 18 + 3);
    assert_int_equal(judged_noticed("usb:1:2:SN1", 258), 0);
    for (int i = 0; i < 3; i++) {
        remove_device(device[i]);
        sys_device[i] = NULL;
    }
}

/* The wrong length of a descriptor shows in what the kernel keeps; no device has this serial number. */
static void a_device_that_is_not_here(void **state)
{
    const struct fault_note note = {.kind = FAULT_DESCRIPTOR_LENGTH, .n = 5};
    (void)state;
    begin();
    soak_usb_plugged(&plugs, rows, &note);
    soak_usb_opened(&plugs, rows, "usb:1:2:no such serial", 1e6);
    assert_int_equal(rows[FAULT_DESCRIPTOR_LENGTH].missed, 1);
}

/* The faults of one enumeration are judged together. The next one hides those that no client saw. */
static void another_enumeration(void **state)
{
    (void)state;
    begin();
    plug(1, 100.0);
    plug(1, 200.0);
    plug(2, 50.0);
    assert_int_equal(row->hidden, 2);
    assert_string_equal(row->why, "it was plugged in again before a client opened it");
    soak_usb_opened(&plugs, rows, "usb:1:2:NONE", 150.0);
    assert_true(row->noticed == 1 && row->missed == 0 && row->hidden == 2);
    for (int i = 0; i <= SOAK_MAX_PLUGS; i++)
        plug(3, 50.0);
    assert_int_equal(row->hidden, 3);
    assert_string_equal(row->why, "too many at a time");
    soak_usb_forget(&plugs, rows, "the end");
    assert_int_equal(row->hidden, 3 + SOAK_MAX_PLUGS);
    assert_string_equal(row->why, "the end");
    soak_usb_opened(&plugs, rows, "usb:1:2:NONE", 1e6);
    assert_int_equal(row->noticed, 1);
}

/* Only a device that this machine gets, with the native stream, has a client. */
static void devices_have_names(void **state)
{
    const struct link_spec here = {
        .type = LINK_USB, .backend = USB_BACKEND_USBIP, .attach = 1, .own_serial = 1, .vid = 0x1209, .pid = 0x1a};
    struct link_spec spec[] = {here, here, here, here};
    char expected[64], source[64];
    (void)state;
    assert_true(soak_usb_is_here(&here));
    spec[0].type = LINK_TCP;
    spec[1].backend = USB_BACKEND_USBREDIR;
    spec[2].attach = 0;
    spec[3].protocol = 1;
    for (int i = 0; i < 4; i++) {
        assert_false(soak_usb_is_here(&spec[i]));
        soak_usb_name(&spec[i], 3);
        assert_true(spec[i].own_serial && spec[i].serial[0] == '\0');
    }
    spec[0] = here;
    soak_usb_name(&spec[0], 3);
    snprintf(expected, sizeof expected, "SOAK-%ld-3", (long)getpid());
    assert_string_equal(spec[0].serial, expected);
    assert_int_equal(spec[0].own_serial, 0);
    snprintf(spec[0].serial, sizeof spec[0].serial, "mine"); /* a configured one stays */
    soak_usb_name(&spec[0], 4);
    assert_string_equal(spec[0].serial, "mine");
    soak_usb_source(&spec[0], source, sizeof source);
    assert_string_equal(source, "usb:1209:001a:mine");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(slow_ones_are_noticed_by_their_time),
        cmocka_unit_test(bytes_that_are_not_there_are_noticed),
        cmocka_unit_test(a_device_that_is_not_here),
        cmocka_unit_test(another_enumeration),
        cmocka_unit_test(devices_have_names),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
