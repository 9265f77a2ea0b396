/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/pcapng.h"

#include <string.h>

#include "core/bytes.h"

enum {
    BLOCK_SECTION = 0x0a0d0d0a,
    BLOCK_INTERFACE = 1,
    BLOCK_SIMPLE_PACKET = 3,
    BLOCK_STATISTICS = 5,
    BLOCK_PACKET = 6,
    BYTE_ORDER_MAGIC = 0x1a2b3c4d,
    OPTION_END = 0,
    OPTION_COMMENT = 1,
    OPTION_NAME = 2,
    OPTION_APPLICATION = 4,
    OPTION_TIME_RESOLUTION = 9,
    OPTION_TIME_OFFSET = 14,
    OPTION_LOST = 4,     /* of a packet */
    OPTION_RECEIVED = 4, /* of statistics */
    OPTION_DROPPED_BY_SYSTEM = 7,
    MICROSECONDS = 6, /* where an interface says nothing else */
    LEAST_BLOCK = 12,
    SECTION_LEN = 28, /* without options */
    INTERFACE_LEN = 20,
    SIMPLE_HEAD = 12,
    STATISTICS_HEAD = 20,
};

/* ---- writing */

/* Everything is padded to four bytes. */
static uint8_t *put_padded(uint8_t *to, const void *data, size_t len)
{
    memcpy(to, data, len);
    memset(to + len, 0, (4 - len % 4) % 4);
    return to + (len + 3) / 4 * 4;
}

static uint8_t *put_option(uint8_t *to, uint16_t code, const void *data, size_t len)
{
    le_put16(to, code);
    le_put16(to + 2, (uint16_t)len);
    return put_padded(to + 4, data, len);
}

static uint8_t *put_text_option(uint8_t *to, uint16_t code, const char *text)
{
    return text != NULL ? put_option(to, code, text, strnlen(text, PCAPNG_MAX_TEXT)) : to;
}

/* A block's length stands at both its ends. */
static size_t put_length(uint8_t *block, uint8_t *to)
{
    const uint32_t len = (uint32_t)(to - block) + 4;
    le_put32(block + 4, len);
    le_put32(to, len);
    return len;
}

/* Writes what ends the options and their block. Returns the block's length. */
static size_t end_block(uint8_t *block, uint8_t *to)
{
    return put_length(block, put_option(to, OPTION_END, "", 0));
}

size_t pcapng_put_section(uint8_t *to, const char *application)
{
    le_put32(to, BLOCK_SECTION);
    le_put32(to + 8, BYTE_ORDER_MAGIC);
    le_put16(to + 12, 1); /* version 1.0 */
    le_put16(to + 14, 0);
    le_put64(to + 16, UINT64_MAX); /* of unknown length */
    return end_block(to, put_text_option(to + 24, OPTION_APPLICATION, application));
}

size_t pcapng_put_interface(uint8_t *to, enum pcapng_link link, uint32_t snap_len, const char *name,
                            const char *comment)
{
    static const uint8_t nanoseconds = 9;
    le_put32(to, BLOCK_INTERFACE);
    le_put16(to + 8, (uint16_t)link);
    le_put16(to + 10, 0);
    le_put32(to + 12, snap_len);
    uint8_t *at = put_text_option(to + 16, OPTION_NAME, name);
    at = put_option(at, OPTION_TIME_RESOLUTION, &nanoseconds, 1);
    return end_block(to, put_text_option(at, OPTION_COMMENT, comment));
}

size_t pcapng_packet_len(size_t data_len)
{
    return PCAPNG_PACKET_HEAD + (data_len + 3) / 4 * 4 + 4;
}

static uint8_t *put_number_option(uint8_t *to, uint16_t code, uint64_t number)
{
    uint8_t bytes[8];
    le_put64(bytes, number);
    return put_option(to, code, bytes, sizeof bytes);
}

size_t pcapng_put_packet(uint8_t *to, uint32_t interface, int64_t t_ns, const void *data, size_t data_len,
                         uint64_t lost)
{
    le_put32(to, BLOCK_PACKET);
    le_put32(to + 8, interface);
    le_put32(to + 12, (uint32_t)((uint64_t)t_ns >> 32));
    le_put32(to + 16, (uint32_t)t_ns);
    le_put32(to + 20, (uint32_t)data_len);
    le_put32(to + 24, (uint32_t)data_len);
    uint8_t *end = put_padded(to + PCAPNG_PACKET_HEAD, data, data_len);
    return lost > 0 ? end_block(to, put_number_option(end, OPTION_LOST, lost)) : put_length(to, end);
}

size_t pcapng_put_statistics(uint8_t *to, uint32_t interface, int64_t t_ns, uint64_t received, uint64_t dropped)
{
    le_put32(to, BLOCK_STATISTICS);
    le_put32(to + 8, interface);
    le_put32(to + 12, (uint32_t)((uint64_t)t_ns >> 32));
    le_put32(to + 16, (uint32_t)t_ns);
    uint8_t *at = put_number_option(to + STATISTICS_HEAD, OPTION_RECEIVED, received);
    return end_block(to, put_number_option(at, OPTION_DROPPED_BY_SYSTEM, dropped));
}

size_t pcapng_put_note(uint8_t *to, const char *text)
{
    memset(to, 0, STATISTICS_HEAD);
    le_put32(to, BLOCK_STATISTICS);
    return end_block(to, put_text_option(to + STATISTICS_HEAD, OPTION_COMMENT, text));
}

/* ---- reading */

static int pcapng_fail(const struct pcapng_reader *reader, struct sh_err *err, const char *what)
{
    return sh_fail(err, SH_EFORMAT, "at byte %llu: %s", (unsigned long long)reader->at_byte, what);
}

/* The unit of a time is if_tsresol: 10^-n s, or with the top bit 2^-n s. The whole seconds of if_tsoffset are added.
 * The sum counts from 1970. Times farther than 292 years from 1970 are INT64_MAX or INT64_MIN. */
static int64_t to_ns(uint64_t time, const struct pcapng_interface *interface)
{
    const int n = interface->resolution & 0x7f;
    __int128 ns = time;
    if (interface->resolution & 0x80) {
        const uint64_t whole = n < 64 ? time >> n : 0, part = n < 64 ? time & ((UINT64_C(1) << n) - 1) : 0;
        const double part_ns = n < 64 ? 1e9 * (double)part / (double)(UINT64_C(1) << n) : 0.0;
        ns = (__int128)whole * 1000000000 + (__int128)part_ns;
    } else {
        for (int i = 9; i < n; i++)
            ns /= 10;
        for (int i = n; i < 9; i++)
            ns *= 10;
    }
    ns += (__int128)interface->offset_s * 1000000000;
    return ns > INT64_MAX ? INT64_MAX : ns < INT64_MIN ? INT64_MIN : (int64_t)ns;
}

static int read_section(struct pcapng_reader *reader, const uint8_t *block, size_t len, struct sh_err *err)
{
    if (len < SECTION_LEN) return pcapng_fail(reader, err, "a section's block is too short");
    if (le_get16(block + 12) != 1) return pcapng_fail(reader, err, "its version of pcapng is not 1");
    reader->in_section = 1;
    reader->n_interfaces = 0;
    return PCAPNG_OTHER;
}

static int read_interface(struct pcapng_reader *reader, const uint8_t *block, size_t len, struct sh_err *err)
{
    if (len < INTERFACE_LEN) return pcapng_fail(reader, err, "an interface's block is too short");
    if (reader->n_interfaces == PCAPNG_MAX_INTERFACES) return pcapng_fail(reader, err, "more than 64 interfaces");
    struct pcapng_interface *interface = &reader->interface[reader->n_interfaces++];
    *interface = (struct pcapng_interface){
        .link = le_get16(block + 8), .snap_len = le_get32(block + 12), .resolution = MICROSECONDS};
    for (size_t at = 16; at + 8 <= len;) {
        const uint16_t code = le_get16(block + at), n = le_get16(block + at + 2);
        if (code == OPTION_END || at + 4 + n > len - 4) break;
        if (code == OPTION_TIME_RESOLUTION && n == 1) interface->resolution = block[at + 4];
        if (code == OPTION_TIME_OFFSET && n == 8) interface->offset_s = (int64_t)le_get64(block + at + 4);
        at += 4 + ((size_t)n + 3) / 4 * 4;
    }
    return PCAPNG_OTHER;
}

static int read_packet(struct pcapng_reader *reader, const uint8_t *block, size_t len, struct pcapng_packet *packet,
                       struct sh_err *err)
{
    if (len < PCAPNG_PACKET_HEAD + 4) return pcapng_fail(reader, err, "a packet's block is too short");
    const uint32_t index = le_get32(block + 8), n = le_get32(block + 20);
    if (index >= reader->n_interfaces)
        return pcapng_fail(reader, err, "a packet of an interface that is not described");
    if (n > len - PCAPNG_PACKET_HEAD - 4) return pcapng_fail(reader, err, "a packet is longer than its block");
    const struct pcapng_interface *interface = &reader->interface[index];
    const uint64_t time = (uint64_t)le_get32(block + 12) << 32 | le_get32(block + 16);
    *packet = (struct pcapng_packet){.link = interface->link,
                                     .has_time = 1,
                                     .t_ns = to_ns(time, interface),
                                     .data = block + PCAPNG_PACKET_HEAD,
                                     .len = n,
                                     .original_len = le_get32(block + 24)};
    return PCAPNG_PACKET;
}

static int read_simple(struct pcapng_reader *reader, const uint8_t *block, size_t len, struct pcapng_packet *packet,
                       struct sh_err *err)
{
    if (len < SIMPLE_HEAD + 4) return pcapng_fail(reader, err, "a packet's block is too short");
    if (reader->n_interfaces == 0) return pcapng_fail(reader, err, "a packet of an interface that is not described");
    const size_t room = len - SIMPLE_HEAD - 4;
    uint32_t n = le_get32(block + 8);
    *packet = (struct pcapng_packet){.link = reader->interface[0].link, .original_len = n};
    if (reader->interface[0].snap_len != 0 && n > reader->interface[0].snap_len) n = reader->interface[0].snap_len;
    if (n > room) return pcapng_fail(reader, err, "a packet is longer than its block");
    packet->data = block + SIMPLE_HEAD;
    packet->len = n;
    return PCAPNG_PACKET;
}

/* Checks that a block may begin at bytes. Returns NULL if it may, else what is wrong. */
static const char *check_front(const struct pcapng_reader *reader, const uint8_t *bytes, size_t len)
{
    if (le_get32(bytes) == BLOCK_SECTION) {
        if (len >= 12 && le_get32(bytes + 8) == 0x4d3c2b1a)
            return "its numbers are big-endian; allowed are little-endian ones";
        if (len >= 12 && le_get32(bytes + 8) != BYTE_ORDER_MAGIC)
            return "not a pcapng file: its byte-order mark is wrong";
    } else if (!reader->in_section) {
        return "not a pcapng file: it does not begin with a section";
    }
    return NULL;
}

int pcapng_read(struct pcapng_reader *reader, const uint8_t *bytes, size_t len, struct pcapng_packet *packet,
                size_t *used, struct sh_err *err)
{
    *used = 0;
    reader->needed = LEAST_BLOCK;
    if (len < LEAST_BLOCK) return PCAPNG_MORE;
    const char *why = check_front(reader, bytes, len);
    if (why != NULL) return pcapng_fail(reader, err, why);
    const uint32_t type = le_get32(bytes), size = le_get32(bytes + 4);
    if (size < LEAST_BLOCK || size % 4 != 0 || size > PCAPNG_MAX_BLOCK)
        return sh_fail(err, SH_EFORMAT, "at byte %llu: a block of %u bytes; allowed are multiples of 4 from %d to %d",
                       (unsigned long long)reader->at_byte, size, (int)LEAST_BLOCK, (int)PCAPNG_MAX_BLOCK);
    reader->needed = size;
    if (len < size) return PCAPNG_MORE;
    if (le_get32(bytes + size - 4) != size) return pcapng_fail(reader, err, "the two lengths of a block differ");
    const int item = type == BLOCK_SECTION         ? read_section(reader, bytes, size, err)
                     : type == BLOCK_INTERFACE     ? read_interface(reader, bytes, size, err)
                     : type == BLOCK_PACKET        ? read_packet(reader, bytes, size, packet, err)
                     : type == BLOCK_SIMPLE_PACKET ? read_simple(reader, bytes, size, packet, err)
                                                   : PCAPNG_OTHER;
    if (item < 0) return item;
    *used = size;
    reader->at_byte += size;
    return item;
}
