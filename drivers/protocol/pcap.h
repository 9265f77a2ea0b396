/* SPDX-License-Identifier: MIT */
/* Classic captures (.pcap): bytes to packets, with the calls and structs of pcapng.h.
 *
 * Both byte orders, times in microseconds or nanoseconds. Pure: no I/O, no clock, no allocation. */
#ifndef DRIVERS_PROTOCOL_PCAP_H
#define DRIVERS_PROTOCOL_PCAP_H

#include "drivers/protocol/pcapng.h"

struct pcap_reader { /* begins as zeros */
    int in_file;     /* its head was taken */
    int is_big, is_ns;
    uint16_t link;
    uint64_t at_byte; /* of what was taken so far */
};

/* 1: the bytes, 4 at least, begin such a file. */
int pcap_is(const uint8_t *bytes);
/* As pcapng_read. PCAPNG_MORE: the bytes have no whole record yet. */
int pcap_read(struct pcap_reader *reader, const uint8_t *bytes, size_t len, struct pcapng_packet *packet, size_t *used,
              struct sh_err *err);

#endif
