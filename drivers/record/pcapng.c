/* .pcapng: each frame of the stream as a packet, for capinfos, tshark and other readers of captures
 * (drivers/protocol/pcapng.h). A packet's time is the frame's device time, nanoseconds since power-up. */
#include "drivers/protocol/pcapng.h"

#include <stdlib.h>
#include <string.h>

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
    outfile_used(file, pcapng_put_packet(to, 0, frame->t_ns, frame->raw, frame->raw_len));
    return 0;
}

struct packets {
    struct pcapng_reader reader;
    struct scan_count scans;
    uint64_t n;
    size_t held; /* bytes in block, which begin where the reader is */
    uint8_t block[2 * PCAPNG_MAX_BLOCK];
};

static void count_packet(struct packets *p, const struct pcapng_packet *packet)
{
    p->n++;
    if (packet->link == PCAPNG_USER0 && packet->len >= NATIVE_HEADER_LEN)
        scan_count_frame(&p->scans, packet->data[1], packet->data[3]);
}

/* All whole blocks of what is held. 1: no block follows. */
static int take_blocks(struct packets *p)
{
    struct pcapng_packet packet;
    size_t at = 0, used;
    int item;
    while ((item = pcapng_read(&p->reader, p->block + at, p->held - at, &packet, &used, NULL, NULL)) > 0) {
        if (item == PCAPNG_PACKET) count_packet(p, &packet);
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

/* Cut behind the last whole block. */
static int pcapng_repair(struct repair *r, struct sh_err *err)
{
    struct packets *p = malloc(sizeof *p);
    if (p == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory to read it", r->path);
    memset(p, 0, offsetof(struct packets, block));
    int rc = read_packets(r, p, err);
    const uint64_t end = p->reader.at_byte;
    if (rc == SH_OK && p->reader.n_interfaces == 0) rc = repair_fail_none(r, "capture (pcapng)", err);
    if (rc == SH_OK) rc = repair_check_rest(r, end, OUTFILE_BUFFER, err);
    if (rc == SH_OK) {
        r->unit = "packets";
        r->n_kept = p->n;
        r->n_scans = p->scans.n_scans;
        r->was_whole = end == r->len;
        rc = repair_cut(r, end, err);
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
