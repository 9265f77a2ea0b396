/* SPDX-License-Identifier: MIT */
/* Recordings as pcapng: the packets of link type 147 (drivers/protocol/pcapng.h) are the stream, one after the other.
 *
 * Bytes after a block that is cut or damaged go to the parser as they are. The parser finds the frames in them, and
 * counts the rest as bad bytes: nothing is left out in silence. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "drivers/host/source.h"
#include "drivers/protocol/native.h"
#include "drivers/protocol/pcapng.h"

struct host_capture {
    struct pcapng_reader reader;
    size_t start, end; /* of the bytes in buf that were not taken */
    const uint8_t *data;
    size_t data_len; /* of a packet's bytes that were not handed on yet */
    int is_raw;      /* 1: the rest of the file is handed on as it is, not block by block */
    uint8_t buf[4 * NATIVE_MAX_FRAME];
};

static size_t capture_take(const uint8_t *from, size_t have, void *to, size_t room)
{
    const size_t n = have < room ? have : room;
    memcpy(to, from, n);
    return n;
}

/* Reads more of the file into the buffer. Returns as read() does. */
static ssize_t capture_fill(struct host_source *source)
{
    struct host_capture *c = source->capture;
    memmove(c->buf, c->buf + c->start, c->end - c->start);
    c->end -= c->start;
    c->start = 0;
    const ssize_t n = read(source->fd, c->buf + c->end, sizeof c->buf - c->end);
    if (n > 0) c->end += (size_t)n;
    return n;
}

/* Goes on to the next packet of frames. Returns 1 if there are bytes to hand on: a packet, or, from a damaged block on,
 * the rest of the file (is_raw). Returns 0 at the file's end, -1 with errno. */
static int next_packet(struct host_source *source)
{
    struct host_capture *c = source->capture;
    struct pcapng_packet packet;
    struct sh_err unsaid;
    for (;;) {
        size_t used;
        const int item = pcapng_read(&c->reader, c->buf + c->start, c->end - c->start, &packet, &used, &unsaid);
        c->start += used;
        if (item == PCAPNG_PACKET && packet.link == PCAPNG_USER0 && packet.len != 0) {
            c->data = packet.data;
            c->data_len = packet.len;
            return 1;
        }
        if (item > 0) continue;
        c->is_raw = item < 0 || c->reader.needed > sizeof c->buf;
        if (c->is_raw) return 1;
        const ssize_t n = capture_fill(source);
        if (n < 0) return -1;
        c->is_raw = n == 0 && c->start < c->end; /* cut within a block */
        if (n == 0) return c->is_raw;
    }
}

static ssize_t capture_read(struct host_source *source, void *to, size_t len)
{
    struct host_capture *c = source->capture;
    if (c->data_len == 0 && !c->is_raw) {
        const int got = next_packet(source);
        if (got <= 0) return got;
    }
    if (c->data_len != 0) {
        const size_t n = capture_take(c->data, c->data_len, to, len);
        c->data += n;
        c->data_len -= n;
        return (ssize_t)n;
    }
    if (c->start == c->end) return read(source->fd, to, len);
    const size_t n = capture_take(c->buf + c->start, c->end - c->start, to, len);
    c->start += n;
    return (ssize_t)n;
}

static void capture_close(struct host_source *source)
{
    close(source->fd);
    free(source->capture);
}

static const struct host_source_ops capture_ops = {.read = capture_read, .wait = host_fd_wait, .close = capture_close};

/* The first interface says what the packets are. */
static int check_front(struct host_source *source, struct sh_err *err)
{
    struct host_capture *c = source->capture;
    struct pcapng_packet packet;
    struct sh_err why;
    size_t used, at = 0;
    while (c->reader.n_interfaces == 0) {
        const int item = pcapng_read(&c->reader, c->buf + at, c->end - at, &packet, &used, &why);
        if (item < 0) return sh_fail(err, SH_EFORMAT, "%s: %s", source->name, why.text);
        if (item == PCAPNG_MORE)
            return sh_fail(err, SH_EFORMAT, "%s: not a pcapng file: no interface is described at its beginning",
                           source->name);
        at += used;
    }
    const uint16_t link = c->reader.interface[0].link;
    c->reader = (struct pcapng_reader){0};
    if (link == PCAPNG_USER0) return 0;
    return sh_fail(err, SH_EFORMAT,
                   "%s: its packets are of link type %u; allowed are frames of the head's stream, link type 147, as "
                   "record writes them without --raw",
                   source->name, link);
}

int host_capture_open(struct host_source *source, struct sh_err *err)
{
    source->capture = calloc(1, sizeof *source->capture);
    if (source->capture == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    int rc = 0;
    ssize_t n;
    while (source->capture->end < sizeof source->capture->buf / 2 && (n = capture_fill(source)) != 0)
        if (n < 0) {
            rc = sh_fail(err, SH_EIO, "%s: %s", source->name, strerror(errno));
            break;
        }
    if (rc == 0) rc = check_front(source, err);
    if (rc == 0) {
        source->ops = &capture_ops;
        return 0;
    }
    free(source->capture);
    source->capture = NULL;
    return rc;
}
