/* stream_sha256 of what is released: a reader of the ring with a thread of its own. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include <nettle/sha2.h>

#include "firmware_sim/loop/loop_inside.h"

struct hasher {
    struct loop *loop;
    struct sha256_ctx sha;
    sem_t wake;
    uint8_t *buf;
    uint64_t cursor;
    uint32_t next_seq;
    int lost;
    pthread_t thread;
};

/* As PROTOCOL.md defines it: type, length and payload of each hashed frame. */
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

static void *hasher_main(void *arg)
{
    struct hasher *h = arg;
    struct loop *loop = h->loop;
    for (;;) {
        int over = atomic_load(&loop->pacer_done);
        uint32_t len = 0, n_frames = 0, first_seq = 0;
        enum ring_read got =
            ring_read(&loop->ring, LOOP_HASH_READER, h->cursor, h->buf, loop->slot_bytes, &len, &n_frames, &first_seq);
        if (got == RING_NONE) {
            if (over) break;
            sem_wait(&h->wake);
            continue;
        }
        if (got == RING_READ && n_frames != 0) {
            /* Nobody is woken for empty ticks, so old ones may be gone; only a gap in the numbers is a loss. */
            if (first_seq != h->next_seq) h->lost = 1;
            h->next_seq = first_seq + n_frames;
            hash_frames(h, h->buf, len);
        }
        h->cursor++;
        atomic_store(&loop->reader[LOOP_HASH_READER].cursor, h->cursor);
        if (loop_waits(loop)) sem_post(&loop->progress);
    }
    return NULL;
}

int hasher_start(struct loop *loop, struct hasher **out, struct sh_err *err)
{
    *out = NULL;
    struct hasher *h = calloc(1, sizeof *h);
    uint8_t *buf = malloc(loop->slot_bytes);
    if (h == NULL || buf == NULL) {
        free(h);
        free(buf);
        return sh_fail(err, SH_ENOMEM, "no memory");
    }
    h->loop = loop;
    h->buf = buf;
    sha256_init(&h->sha);
    sem_init(&h->wake, 0, 0);
    atomic_store(&loop->reader[LOOP_HASH_READER].active, 1);
    int rc = pthread_create(&h->thread, NULL, hasher_main, h);
    if (rc != 0) {
        free(h);
        free(buf);
        return sh_fail(err, SH_EIO, "no thread for the stream hash: %s", strerror(rc));
    }
    *out = h;
    return SH_OK;
}

void hasher_wake(struct hasher *hasher)
{
    sem_post(&hasher->wake);
}

int hasher_join(struct hasher *hasher, char hex[65])
{
    uint8_t digest[SHA256_DIGEST_SIZE];
    pthread_join(hasher->thread, NULL);
    sha256_digest(&hasher->sha, sizeof digest, digest);
    for (int i = 0; i < SHA256_DIGEST_SIZE; i++) {
        static const char digit[] = "0123456789abcdef";
        hex[2 * i] = digit[digest[i] >> 4];
        hex[2 * i + 1] = digit[digest[i] & 15];
    }
    hex[64] = '\0';
    int good = !hasher->lost;
    sem_destroy(&hasher->wake);
    free(hasher->buf);
    free(hasher);
    return good;
}
