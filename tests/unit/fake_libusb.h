/* SPDX-License-Identifier: MIT */
/* A scripted bus in place of libusb's. The functions defined here come before the library's when a test program is
 * linked. The bus has one thread, and no time of its own: scripted steps happen when events are handled. When nothing
 * is scripted, `idle` is called, where the test may plug and unplug. Errors that the library does not forgive end the
 * test: a transfer that is freed or submitted while it is under way, and anything left behind. */
#ifndef TESTS_UNIT_FAKE_LIBUSB_H
#define TESTS_UNIT_FAKE_LIBUSB_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <libusb.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define FAKE_NUL '\xff' /* for a NUL in a device's string; libusb gives ASCII alone */

enum { FAKE_DEVICES = 4, FAKE_FLYING = 64, FAKE_STEPS = 256, FAKE_DATA = 1024, FAKE_IN = 0x83, FAKE_OUT = 0x03 };

struct libusb_context {
    int listed;
    libusb_hotplug_callback_fn arrival; /* NULL: none is registered */
    void *arrival_data;
};

struct libusb_device {
    int present, other_class;             /* on the bus; not a head */
    int open_rc;                          /* the result of opening it */
    const char *maker, *product, *serial; /* NULL: none */
};

struct libusb_device_handle {
    struct libusb_device *device;
};

/* The next step for the oldest transfer of an endpoint, when events are handled. */
struct fake_step {
    uint8_t endpoint;
    enum libusb_transfer_status status;
    int len;
    uint8_t data[FAKE_DATA];
};

struct fake_bus {
    struct libusb_device device[FAKE_DEVICES];
    struct libusb_transfer *flying[FAKE_FLYING];
    int cancelled[FAKE_FLYING], n_flying;
    struct fake_step step[FAKE_STEPS];
    int n_steps, done;
    void (*idle)(void);
    int no_hotplug, no_udev, gone, init_rc; /* gone: every device that is open has been unplugged */
    int clear_halt_rc, submit_rc;           /* the results of these while not 0 */
    int claim_rc, session_rc;               /* the results of claiming the interface, and of opening the stream */
    int submit_fails;                       /* for so many times; < 0: always */
    int submit_room;                        /* how many transfers may be under way; 0: any number */
    int events_rc, events_in;               /* the result of handling events, once, after that many calls */
    int will_not_cancel, hold_writes;
    int was_reset, no_question; /* all sessions are over; the head stalls the request that asks whether they are */
    int contexts, handles, transfers, claimed, sessions, lists, configs; /* 0 at the end but for sessions */
    int n_lists, n_clear_halts, n_waits, last_wait_ms;
    const uint8_t *(*feed)(
        size_t *len);   /* the bytes of a read that nothing is scripted for, at most len of them; NULL: none come */
    char written[4096]; /* the commands so far */
    const char *answer; /* to each of them; NULL: none */
};
extern struct fake_bus bus;

void fake_reset(void);

void fake_expect_nothing_left(void);

void fake_script(uint8_t endpoint, enum libusb_transfer_status status, const void *data, size_t len);

/* ---- the library */

#endif
