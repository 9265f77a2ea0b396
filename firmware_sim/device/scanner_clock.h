/* SPDX-License-Identifier: MIT */
/* The clock of a scanner that has a date of its own and no battery, as SICK's: device time -> ns since 1970.
 *
 * This clock runs as the head's clock does, with the same errors (head_clock.h). At power-up it begins with 1970 where
 * a time server is to be asked (ntp.role: client), or where the head does not know the time of day. Else it shows UTC.
 * TIME:SHIFt sets it, and so do answers of a time server. The commands are journalled, so a replayed session has the
 * same dates.
 *
 * Thread: any. */
#ifndef FIRMWARE_SIM_DEVICE_SCANNER_CLOCK_H
#define FIRMWARE_SIM_DEVICE_SCANNER_CLOCK_H

#include <stdint.h>

#include "drivers/protocol/ntp.h"
#include "firmware_sim/command/command.h"

struct device;

/* The clock between two power-ups. */
struct scanner_clock {
    int64_t from_ns;  /* device time of power-up */
    int by_utc;       /* it began with UTC */
    int64_t zero_ns;  /* time of the head's clock at that moment, TAI */
    int64_t shift_ns; /* of the clock before the last power-up; that of the present clock is command_device.shift_ns */
};

int64_t device_date_ns(void *self, int64_t t_ns);

/* A client of a time server needs to know this. */
struct device_time_server {
    struct command_time_server set;
    uint16_t port;
    int asks;           /* 1: it is to be asked now */
    int refused;        /* 1: its address forbids it: not this machine, not as configured, and ntp.anywhere is off */
    uint32_t power_ons; /* how often power has come */
    int64_t max_offset_ns;
};
void device_get_time_server(struct device *device, struct device_time_server *out);
/* Sets the eventfd that is written whenever the facts of device_get_time_server may have changed; -1: none. With an
 * eventfd TIME:SERVer may be CLIENT. */
void device_watch_time_server(struct device *device, int fd);
/* Applies injected faults to a server's answer that comes at a device time. 1: it is as if it had not come. */
int device_change_time_answer(struct device *device, int64_t t_ns, uint8_t packet[NTP_LEN]);
/* Sets the clock forward by by_ns, which the answer of a server gave. The device itself carries out TIME:SHIFt for it,
 * which the journal then has. 0: since the server was asked, settings have changed or power has come again. Then the
 * clock stays as it is. */
int device_shift_date(struct device *device, const struct device_time_server *asked, int64_t by_ns);
/* Replaces what TIME:SERVer? STATe replies. report: error 107 and an event; NULL: nothing is to be reported. */
void device_put_time_answers(struct device *device, const struct command_time_answers *answers, const char *report);

#endif
