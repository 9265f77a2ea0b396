/* SPDX-License-Identifier: MIT */
/* Data packets of an E57 file (ASTM E2807), as our files have them. Each field of a record has its own stream in the
 * packet, with as many bits per record as its range needs. Packets hold a multiple of 8 records, so that no stream
 * of bits runs across packets; only the last packet of a scan may hold another number.
 *
 *   type = 1, flags = 0   2 x uint8
 *   length of the packet less 1, number of streams   2 x uint16
 *   length of each stream   uint16 each
 *   streams, in the order of enum e57_stream; zeros up to a multiple of 4
 *
 * Records go in, bytes come out. Recorder and repair count the figures of the XML section from these bytes. Pure. */
#ifndef DRIVERS_RECORD_E57_PACKET_H
#define DRIVERS_RECORD_E57_PACKET_H

#include "drivers/record/e57_xml.h"

enum {
    E57_PACKET_HEADER_LEN = 6,
    E57_PACKET_RECORDS = 1920,  /* a multiple of 8; their packet is shorter than 64 KiB */
    E57_PACKET_COLOURED = 1792, /* likewise, with colours */
    E57_PACKET_MAX = 65536,
};
enum e57_stream {
    E57_X, /* coordinates are counts from INT32_MIN on, so the smallest is 0 */
    E57_Y,
    E57_Z,
    E57_INVALID, /* if the file may have shots without echo: 2 for such a shot, 0 for a point */
    E57_INTENSITY,
    E57_NO_INTENSITY,
    E57_RED, /* where there are colours */
    E57_GREEN,
    E57_BLUE,
    E57_TIME,
    E57_RETURN,
    E57_RETURNS,
    E57_ROW,
    E57_COLUMN,
    E57_LABEL,
    E57_N_STREAMS
};

/* Records that are gathered for a packet. Streams of whole bytes lie where they will be in a full packet, which
 * therefore needs no copy. Streams of bits have a byte a record until the packet is made. */
struct e57_packet {
    unsigned n, most;               /* records in the streams, and in a full packet */
    uint8_t *stream[E57_N_STREAMS]; /* nothing may be put into the stream of a field that the file lacks */
    uint8_t bits[4][E57_PACKET_RECORDS + 8];
    uint8_t full[E57_PACKET_MAX], part[E57_PACKET_MAX];
};

/* Begins a packet without records, for a file with these fields. The packet must stay where it is in memory. */
void e57_packet_begin(struct e57_packet *packet, const struct e57_facts *facts);
/* Makes the packet of the records; then no record is left in `packet`. The returned bytes are good until the next
 * records are put. */
const uint8_t *e57_packet_make(struct e57_packet *packet, const struct e57_facts *facts, size_t *len);
/* Adds the packet to the figures of its scan. -1: it is not a packet of this file. */
int e57_packet_count(const uint8_t *packet, size_t len, const struct e57_facts *facts, struct e57_scan *scan);

#endif
