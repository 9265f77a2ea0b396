/* SPDX-License-Identifier: MIT */
/* .pcapng: each frame of the stream as a packet, for capinfos, tshark and other readers of captures
 * (drivers/protocol/pcapng.h). A packet's time is the frame's device time, nanoseconds since power-up. */
#include "drivers/protocol/pcapng.h"

#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "drivers/protocol/native.h"
#include "drivers/record/recorder.h"
#include "drivers/record/scan_count.h"

static int pcapng_begin(void *rec, struct sh_err *err)
{
    struct recorder *pcapng = rec;
    uint8_t front[2 * PCAPNG_FRONT_ROOM];
    size_t len = pcapng_put_section(front, "scanhead");
    len += pcapng_put_interface(
        front + len, PCAPNG_USER0, NATIVE_MAX_FRAME, "scan head",
        "Frames of scanhead's native protocol (PROTOCOL.md); times are device time since power-up.");
    return outfile_write(&pcapng->file, front, len, err);
}

static int pcapng_frame(void *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct outfile *file = &((struct recorder *)rec)->file;
    (void)sh;
    uint8_t *to = outfile_room(file, pcapng_packet_len(frame->raw_len), err);
    if (to == NULL) return SH_EIO;
    outfile_used(file, pcapng_put_packet(to, 0, frame->t_ns, frame->raw, frame->raw_len, 0));
    return 0;
}

struct packets {
    struct pcapng_reader reader;
    struct scan_count scans;
    uint64_t n;
    int is_noted; /* the last block is a note */
    int is_ours;  /* the first one is that of this program's captures */
    size_t held;  /* bytes in block, which begin where the reader is */
    uint8_t block[2 * PCAPNG_MAX_BLOCK];
};

static void count_packet(struct packets *p, const struct pcapng_packet *packet)
{
    p->n++;
    if (packet->link == PCAPNG_USER0 && packet->len >= NATIVE_HEADER_LEN &&
        packet->len == native_frame_len(packet->data))
        scan_count_frame(&p->scans, packet->data);
}

/* A repair ends the file with a note that data may be missing. */
static int is_note(const uint8_t *block, size_t len)
{
    uint8_t note[PCAPNG_FRONT_ROOM];
    return len == pcapng_put_note(note, REPAIR_INCOMPLETE) && memcmp(block, note, len) == 0;
}

static int is_own_section(const uint8_t *block, size_t len)
{
    uint8_t own[PCAPNG_FRONT_ROOM];
    return len == pcapng_put_section(own, "scanhead") && memcmp(block, own, len) == 0;
}

/* Takes all whole blocks of the bytes that are held. Returns 1 if no block can follow. */
static int take_blocks(struct packets *p)
{
    struct pcapng_packet packet;
    size_t at = 0, used;
    int item;
    while ((item = pcapng_read(&p->reader, p->block + at, p->held - at, &packet, &used, NULL)) > 0) {
        if (item == PCAPNG_PACKET) count_packet(p, &packet);
        p->is_noted = is_note(p->block + at, used);
        if (p->reader.at_byte == used) p->is_ours = is_own_section(p->block, used);
        at += used;
    }
    memmove(p->block, p->block + at, p->held -= at);
    return item < 0;
}

static int read_packets(const struct repair *r, struct packets *p, struct sh_err *err)
{
    enum { PIECE = 1 << 20 };
    int rc = SH_OK, over = 0;
    for (uint64_t at = 0; at < r->len && rc == SH_OK && !over;) {
        const size_t n = r->len - at < PIECE ? (size_t)(r->len - at) : PIECE;
        rc = repair_read(r, at, p->block + p->held, n, err);
        if (rc == SH_OK) rc = sh_check_stop(r->report, err);
        p->held += n;
        at += n;
        over = take_blocks(p);
    }
    return rc;
}

/* Returns 1 if the file ends with a whole block, so that it was not cut; else 0, or SH_E. */
static int ends_with_block(const struct repair *r, uint64_t from, struct sh_err *err)
{
    enum { LEAST = 12 };
    uint8_t last[4], first[4];
    if (r->len - from < LEAST) return 0;
    int rc = repair_read(r, r->len - sizeof last, last, sizeof last, err);
    const uint32_t n = le_get32(last);
    if (rc != SH_OK || n < LEAST || n % 4 != 0 || n > r->len - from) return rc;
    rc = repair_read(r, r->len - n + 4, first, sizeof first, err);
    return rc != SH_OK ? rc : le_get32(first) == n;
}

/* Checks that only a piece of one more block, and then zeros, follow the last whole block. */
static int check_behind(const struct repair *r, const struct packets *p, struct sh_err *err)
{
    enum { HEAD = 12 };
    const uint64_t end = p->reader.at_byte;
    const uint32_t said = p->held >= HEAD ? le_get32(p->block + 4) : HEAD;
    const uint32_t piece = said >= HEAD && said <= OUTFILE_BUFFER ? said : HEAD;
    int rc = ends_with_block(r, end, err);
    if (rc == 0 && r->len - end > piece) rc = repair_check_rest(r, end + piece, 0, err);
    return rc > 0 || rc == SH_EFORMAT ? repair_fail_damaged(r, end, err) : rc;
}

/* Cuts the file after the last whole block. A file that was not whole then gets a note, unless it ends with one. */
static int pcapng_repair(struct repair *r, struct sh_err *err)
{
    struct packets *p = malloc(sizeof *p);
    if (p == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory to read it", r->path);
    memset(p, 0, offsetof(struct packets, block));
    int rc = read_packets(r, p, err);
    const uint64_t end = p->reader.at_byte;
    if (rc == SH_OK && p->reader.n_interfaces == 0) rc = repair_fail_none(r, "capture (pcapng)", err);
    if (rc == SH_OK) rc = check_behind(r, p, err);
    if (rc == SH_OK) {
        repair_say_kept(r, "packets", p->n, p->scans.n_scans);
        r->was_whole = end == r->len && (p->is_noted || !repair_is_part(r));
        rc = r->was_whole || p->is_ours ? repair_cut(r, end, err) : repair_fail_foreign(r, err);
    }
    if (rc == SH_OK && !r->was_whole && !p->is_noted) {
        uint8_t note[PCAPNG_FRONT_ROOM];
        repair_append_note(r, end, note, pcapng_put_note(note, REPAIR_INCOMPLETE));
    }
    free(p);
    return rc;
}

const struct recorder_ops recorder_pcapng = {
    .ending = ".pcapng",
    .size = sizeof(struct recorder),
    .begin = pcapng_begin,
    .frame = pcapng_frame,
    .repair = pcapng_repair,
};
