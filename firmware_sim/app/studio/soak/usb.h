/* SPDX-License-Identifier: MIT */
/* A head that is attached to this machine by USB: how its client finds it, and enumerations that went wrong. */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_USB_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_USB_H

#include <stddef.h>
#include <stdint.h>

#include "firmware_sim/fault/board.h"

struct link_spec;
struct soak_row;

/* Whether the link's device is attached to this machine, and has the native stream. */
int soak_usb_is_here(const struct link_spec *spec);
/* Gives the link's device a serial number where none is configured, so that its client can name the device. number: of
 * the link, from 1. */
void soak_usb_name(struct link_spec *spec, uint32_t number);
/* Writes the source that the link's client opens. */
void soak_usb_source(const struct link_spec *spec, char *source, size_t len);

/* The faults of the enumeration at hand, until a client opens the device. */
enum { SOAK_MAX_PLUGS = 8 };
struct soak_plugs {
    struct fault_note note[SOAK_MAX_PLUGS];
    uint32_t n;
};
/* In all three, `row` has the rows of the link, and the caller has the link's lock. */
/* Notes a fault of an enumeration that begins. */
void soak_usb_plugged(struct soak_plugs *plugs, struct soak_row *row, const struct fault_note *note);
/* The client has opened the device, `source`, which took opened_ms. Notes which faults of the enumeration it noticed: a
 * slow one by this time, others by the descriptors that the system has read. */
void soak_usb_opened(struct soak_plugs *plugs, struct soak_row *row, const char *source, double opened_ms);
/* Hides the faults so far: no client will notice them. */
void soak_usb_forget(struct soak_plugs *plugs, struct soak_row *row, const char *why);

#endif
