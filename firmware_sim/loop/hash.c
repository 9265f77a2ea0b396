/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/hash.h"

#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <nettle/base16.h>
#include <nettle/sha2.h>

#include "drivers/protocol/native.h"

struct hasher {
    struct stream *stream;
    struct sha256_ctx sha;
    int wake_fd;
    uint64_t cursor;
    uint32_t next_seq;
    int lost;
    pthread_t thread;
};

/* As COUNTS.md defines it: type, length and payload of each hashed frame. */
static void hash_frames(struct hasher *h, const uint8_t *bytes, uint32_t len)
{
    for (uint32_t at = 0; at < len;) {
        struct native_header header;
        native_read_header(bytes + at, &header);
        if (native_is_hashed(&header)) {
            sha256_update(&h->sha, 1, bytes + at + 1);
            sha256_update(&h->sha, 4, bytes + at + 4);
            sha256_update(&h->sha, header.length, bytes + at + NATIVE_HEADER_LEN);
        }
        at += (uint32_t)native_frame_len(bytes + at);
    }
}

/* Hashes the next tick in the ring itself, without a copy. */
static enum ring_read take_tick(struct hasher *h)
{
    struct ring *ring = &h->stream->ring;
    struct ring_copy tick = {.buf = NULL};
    enum ring_read got = ring_look(ring, STREAM_HASH_READER, h->cursor, &tick);
    if (got == RING_READ && tick.n_frames != 0) {
        /* Empty ticks wake nobody, so old ones may be gone; only a gap in the frames' numbers is a loss. */
        if (tick.first_seq != h->next_seq) h->lost = 1;
        h->next_seq = tick.first_seq + tick.n_frames;
        hash_frames(h, tick.buf, tick.len);
    }
    ring_leave(ring, STREAM_HASH_READER);
    return got;
}

static void *hasher_main(void *arg)
{
    struct hasher *h = arg;
    for (;;) {
        int over = atomic_load(&h->stream->over);
        if (take_tick(h) == RING_NONE) {
            eventfd_t n;
            stream_rest_reader(h->stream);
            if (over || (eventfd_read(h->wake_fd, &n) != 0 && errno != EINTR)) break;
            continue;
        }
        stream_move_reader(h->stream, STREAM_HASH_READER, ++h->cursor);
    }
    return NULL;
}

static void hasher_free(struct hasher *h)
{
    if (h->wake_fd >= 0) close(h->wake_fd);
    free(h);
}

int hasher_start(struct stream *stream, struct hasher **out, struct sh_err *err)
{
    *out = NULL;
    struct hasher *h = calloc(1, sizeof *h);
    if (h == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    h->stream = stream;
    h->next_seq = stream->seq;
    h->wake_fd = eventfd(0, EFD_CLOEXEC);
    sha256_init(&h->sha);
    int failed = h->wake_fd < 0 ? errno : 0;
    if (failed == 0) failed = pthread_create(&h->thread, NULL, hasher_main, h);
    if (failed != 0) {
        hasher_free(h);
        return sh_fail(err, SH_EIO, "the stream hash cannot start: %s", strerror(failed));
    }
    stream_set_reader(stream, STREAM_HASH_READER, 0, 1);
    stream_listen(stream, h->wake_fd, stream->lazy_ticks);
    *out = h;
    return SH_OK;
}

int hasher_join(struct hasher *hasher, char hex[65])
{
    uint8_t digest[SHA256_DIGEST_SIZE];
    pthread_join(hasher->thread, NULL);
    sha256_digest(&hasher->sha, sizeof digest, digest);
    base16_encode_update(hex, sizeof digest, digest);
    hex[64] = '\0';
    int good = !hasher->lost;
    hasher_free(hasher);
    return good;
}
