/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/pcap.h"

#include "core/bytes.h"

/* The file's head: u32 magic, u16 major, u16 minor, 2 x u32, u32 snap length, u32 link type (its low 16 bits).
 * A record: u32 seconds, u32 parts of a second, u32 captured length, u32 length on the wire, then the bytes. */
enum { HEAD_LEN = 24, RECORD_LEN = 16, MAGIC_US = (int)0xa1b2c3d4, MAGIC_NS = (int)0xa1b23c4d };

static uint32_t get32(int is_big, const uint8_t *p)
{
    return is_big ? be_get32(p) : le_get32(p);
}

/* 0, or the magic number. */
static int magic_of(const uint8_t *bytes, int *is_big)
{
    for (*is_big = 0; *is_big < 2; ++*is_big) {
        const int magic = (int)get32(*is_big, bytes);
        if (magic == MAGIC_US || magic == MAGIC_NS) return magic;
    }
    return 0;
}

int pcap_is(const uint8_t *bytes)
{
    int is_big;
    return magic_of(bytes, &is_big) != 0;
}

static int read_head(struct pcap_reader *reader, const uint8_t *bytes, struct sh_err *err)
{
    const int magic = magic_of(bytes, &reader->is_big);
    if (magic == 0) return sh_fail(err, SH_EFORMAT, "at byte 0: not a pcap file: its first number is wrong");
    const uint16_t major = reader->is_big ? be_get16(bytes + 4) : le_get16(bytes + 4);
    if (major != 2) return sh_fail(err, SH_EFORMAT, "at byte 4: its version of pcap is %u; allowed is 2", major);
    reader->is_ns = magic == MAGIC_NS;
    reader->link = (uint16_t)get32(reader->is_big, bytes + 20);
    reader->in_file = 1;
    return PCAPNG_OTHER;
}

int pcap_read(struct pcap_reader *reader, const uint8_t *bytes, size_t len, struct pcapng_packet *packet, size_t *used,
              struct sh_err *err)
{
    *used = 0;
    if (!reader->in_file) {
        if (len < HEAD_LEN) return PCAPNG_MORE;
        const int rc = read_head(reader, bytes, err);
        if (rc < 0) return rc;
        reader->at_byte = *used = HEAD_LEN;
        return rc;
    }
    if (len < RECORD_LEN) return PCAPNG_MORE;
    const uint32_t n = get32(reader->is_big, bytes + 8), part = get32(reader->is_big, bytes + 4);
    if (n > PCAPNG_MAX_BLOCK)
        return sh_fail(err, SH_EFORMAT, "at byte %llu: a packet of %u bytes; allowed are %d at most",
                       (unsigned long long)reader->at_byte, n, (int)PCAPNG_MAX_BLOCK);
    if (len - RECORD_LEN < n) return PCAPNG_MORE;
    *packet = (struct pcapng_packet){.link = reader->link,
                                     .has_time = 1,
                                     .t_ns = (int64_t)get32(reader->is_big, bytes) * 1000000000 +
                                             (int64_t)part * (reader->is_ns ? 1 : 1000),
                                     .data = bytes + RECORD_LEN,
                                     .len = n,
                                     .original_len = get32(reader->is_big, bytes + 12)};
    *used = RECORD_LEN + (size_t)n;
    reader->at_byte += *used;
    return PCAPNG_PACKET;
}
