/* SPDX-License-Identifier: MIT */
/* The client of a time server, turn by turn: its waits and its clock go through this rig, and a test plays the server.
 * So all times are exact. A test's times are multiples of 1/8 s, which packets of time servers have exactly. */
#ifndef TESTS_UNIT_TIME_CLIENT_RIG_H
#define TESTS_UNIT_TIME_CLIENT_RIG_H

#include "firmware_sim/device/scanner_clock.h"
#include "firmware_sim/loop/time_client.h"
#include "tests/unit/device_rig.h"

#define S INT64_C(1000000000)

extern struct rig *rig;                    /* the scanner, which has booted */
extern int64_t now_ns;                     /* the machine's clock, as the client sees it */
extern int waits_ms;                       /* for so long the client wants to wait; -1: for ever */
extern int is_interrupted;                 /* its next wait is */
extern int has_no_way, has_no_descriptors; /* on this machine */
extern const int64_t time_client_epoch_ns; /* device time 0 by the machine's clock */
extern uint8_t request[48];                /* the last one of the client */

/* Start and end one test: a scanner whose clock shows 1970 and a second, a client, and a server at 127.1.2.3. Clocks
 * that are set take steps up to 2 s. */
int time_client_setup(void **state);
int time_client_teardown(void **state);

/* Lets the client's wait end after so long, and waits until it waits again. */
void turn_after(int64_t ns);
/* Sets the server, its period and the zone, and lets the client take that. */
void set_server(const char *role, int period_s, int zone_h);
/* Lets the first request go out, and the clock be set to t_ns. */
void set_clock(int period_s, int zone_h, int64_t t_ns);

/* Whether the client has asked. */
int has_asked(void);
/* Checks that it has asked once, at T1 by its own clock. */
void expect_request(int64_t t1_ns);

struct answer {
    int64_t t2_ns, t3_ns;
    int leap, stratum;
    const char *kiss;
    size_t len;
};
/* Sends an answer to the last request, which the client takes after so long. */
void answer_after(int64_t ns, struct answer a);
/* The server's time is t_ns, and an answer takes no time. */
void answer_with(int64_t t_ns);
void kiss_with(const char *kiss);

/* Checks what TIME:SERVer? STATe replies. */
void expect_state(const char *state, int64_t offset_ns, int64_t delay_ns, int good, int refused, int none);
/* Checks the next error of the queue. NULL: there is none. */
void expect_error(const char *text);
/* Returns the scanner's clock, now. */
int64_t date_ns(void);

#endif
