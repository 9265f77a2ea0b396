/* SPDX-License-Identifier: MIT */
/* The client of a time server: asks it over UDP, and sets the scanner's clock (device/scanner_clock.h).
 *
 * In: the settings TIME:SERVer, and answers (drivers/protocol/ntp.h). Out: TIME:SHIFt, and what TIME:SERVer? STATe
 * replies. A thread of its own waits for both, so no link and no tick waits for a server. Device time is taken
 * from the clock here, not from released ticks, since they are released later than their time.
 *
 *   a good answer         sets the clock at once, by the offset in the answer, in a step
 *   beyond max_offset_s   is refused, once the clock was set: error 107
 *   no answer in 1 s      is counted; the clock runs on. Error 107
 *   not synchronised      is counted as refused: error 107
 *   kiss-o'-death         DENY and RSTR: the server is asked no more, until a setting changes or power comes again;
 *                         RATE: from then on it is asked half as often. Other kisses are counted as refused, and
 *                         change nothing. Error 107
 *   no route              is tried again after update_s
 *
 * Two requests are at least 1 s apart, however often settings change.
 *
 * An error is reported when the state changes, not for each answer. */
#ifndef FIRMWARE_SIM_LOOP_TIME_CLIENT_H
#define FIRMWARE_SIM_LOOP_TIME_CLIENT_H

#include "firmware_sim/device/device.h"

struct time_client;

/* epoch_ns: device time 0, by clock_now_ns(). */
int time_client_start(struct device *device, int64_t epoch_ns, struct time_client **out, struct sh_err *err);
/* Ends the thread; client may be NULL. */
void time_client_join(struct time_client *client);

#endif
