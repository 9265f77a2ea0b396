/* SPDX-License-Identifier: MIT */
/* Captures as pcapng has them (draft-ietf-opsawg-pcapng): blocks to bytes, and bytes to packets.
 *
 * In and out: bytes of a file, in pieces of any size. Times are nanoseconds. Pure: no I/O, no clock, no allocation.
 *
 * The module writes one section of little-endian blocks: interfaces with times in nanoseconds, enhanced packets, and
 * statistics of interfaces. It also reads what tshark, editcap and mergecap make of these: simple packets and other
 * resolutions. Blocks of other kinds are skipped, and so are statistics. Big-endian sections are refused. */
#ifndef DRIVERS_PROTOCOL_PCAPNG_H
#define DRIVERS_PROTOCOL_PCAPNG_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"

enum pcapng_link {
    PCAPNG_ETHERNET = 1,
    PCAPNG_USER0 = 147, /* here: a packet is one frame of the native protocol, header and payload */
};

enum {
    PCAPNG_FRONT_ROOM = 512,     /* enough for a section or an interface with its texts */
    PCAPNG_MAX_TEXT = 160,       /* longer texts are cut */
    PCAPNG_PACKET_HEAD = 28,     /* of a packet block, before its data */
    PCAPNG_MAX_BLOCK = 16 << 20, /* a longer one is no block */
    PCAPNG_MAX_INTERFACES = 64,
    PCAPNG_LOST = 16,
};

/* ---- writing; all return how many bytes they put. Texts may be NULL: none. */

/* Begins a file. */
size_t pcapng_put_section(uint8_t *to, const char *application);
/* Interfaces count from 0. snap_len: no packet of it is longer. */
size_t pcapng_put_interface(uint8_t *to, enum pcapng_link link, uint32_t snap_len, const char *name,
                            const char *comment);
/* The length of a packet's block. */
size_t pcapng_packet_len(size_t data_len);
/* Puts a packet. t_ns: 0 or later. lost: how many packets were lost at this interface since its packet before. Where
 * that is above 0, the block is PCAPNG_LOST bytes longer than pcapng_packet_len. */
size_t pcapng_put_packet(uint8_t *to, uint32_t interface, int64_t t_ns, const void *data, size_t data_len,
                         uint64_t lost);
/* Puts statistics of an interface: how many frames came until t_ns, and how many the system dropped. PCAPNG_FRONT_ROOM
 * bytes are enough. */
size_t pcapng_put_statistics(uint8_t *to, uint32_t interface, int64_t t_ns, uint64_t received, uint64_t dropped);
/* Puts a text that belongs to no packet: statistics of the first interface without figures, but with a comment.
 * PCAPNG_FRONT_ROOM bytes are enough. */
size_t pcapng_put_note(uint8_t *to, const char *text);

/* ---- reading */

struct pcapng_reader { /* begins as zeros */
    int in_section;
    uint64_t at_byte; /* of the blocks taken so far */
    size_t needed;    /* after PCAPNG_MORE: number of bytes known to be needed */
    uint32_t n_interfaces;
    struct pcapng_interface {
        uint16_t link;
        uint32_t snap_len;
        int resolution;   /* as in the option if_tsresol; 6 where there is none */
        int64_t offset_s; /* as in the option if_tsoffset */
    } interface[PCAPNG_MAX_INTERFACES];
};

struct pcapng_packet {
    uint16_t link; /* enum pcapng_link, or another link type */
    int has_time;
    int64_t t_ns;               /* since 1970; negative: before it. INT64_MIN, INT64_MAX: farther than 292 years */
    const uint8_t *data;        /* within the bytes that were given */
    uint32_t len, original_len; /* original_len > len: the capture cut it */
};

enum pcapng_item { PCAPNG_MORE = 0, PCAPNG_PACKET = 1, PCAPNG_OTHER = 2 };

/* Takes the block that the bytes begin with. PCAPNG_MORE: they have no whole block yet; *used is 0, and reader->needed
 * says how many bytes are needed. PCAPNG_PACKET and PCAPNG_OTHER: *used bytes were the block.
 * SH_EFORMAT: this is no block, or a block that can't be read, as a packet of an interface that is not described; err
 * says at which byte of the file, and why. */
int pcapng_read(struct pcapng_reader *reader, const uint8_t *bytes, size_t len, struct pcapng_packet *packet,
                size_t *used, struct sh_err *err);

#endif
