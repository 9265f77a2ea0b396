/* SPDX-License-Identifier: MIT */
/* Packets between a client and a time server: SNTPv4 (RFC 4330; RFC 5905 has the same packet). Big-endian, 48 bytes:
 *
 *    0  2 bits leap  3 bits version  3 bits mode    u8 stratum    i8 poll    i8 precision
 *    4  u32 root delay    8  u32 root dispersion, both s with 16 bits of fraction
 *   12  reference; 4 characters where the stratum is 0: a kiss-o'-death
 *   16  reference time   24  originate time T1   32  receive time T2   40  transmit time T3
 *
 * A time has 32 bits of seconds and 32 of fraction. Seconds with the first bit set count from 1900, others from 2036.
 * The client writes T1 as its transmit time, and notes T4, at which the answer came:
 *
 *   offset = ((T2 - T1) + (T3 - T4)) / 2      delay = (T4 - T1) - (T3 - T2)
 *
 * Times in memory are ns since 1970, T1 and T4 within 1820 to 2170. Pure. */
#ifndef DRIVERS_PROTOCOL_NTP_H
#define DRIVERS_PROTOCOL_NTP_H

#include <stddef.h>
#include <stdint.h>

enum { NTP_LEN = 48 };

enum ntp_kind {
    NTP_GOOD,
    NTP_FOREIGN,        /* no answer to this request: shorter than 48 bytes, not from a server, of a version other than
                         * 1 to 4, or with another T1 */
    NTP_UNSYNCHRONISED, /* the server says that it has no time, or sends impossible times: RFC 4330, section 5 */
    NTP_KISS,
};

struct ntp_answer {
    char kiss[5]; /* printable; empty: none */
    int64_t offset_ns, delay_ns;
};

/* A request that is sent at T1. */
void ntp_write_request(uint8_t packet[NTP_LEN], int64_t t1_ns);
/* Reads an answer to a request that was sent at t1_ns. offset_ns and delay_ns are set where it is good. */
enum ntp_kind ntp_read_answer(const uint8_t *packet, size_t len, int64_t t1_ns, int64_t t4_ns, struct ntp_answer *out);

/* For injected faults: turns an answer into that of a server which is not synchronised, which refuses further requests
 * (DENY), or whose clock is ahead by step_ns. */
enum ntp_change { NTP_UNSYNCHRONISE, NTP_DENY, NTP_STEP };
void ntp_change_answer(uint8_t packet[NTP_LEN], enum ntp_change change, int64_t step_ns);

#endif
