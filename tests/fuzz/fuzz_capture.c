/* SPDX-License-Identifier: MIT */
/* This fuzzes captures and recordings that are replayed: .pcapng by its reader, in pieces, and then as a recording,
 * frame by frame with its times. Captures are replayed as answers, too, to a client that repeats what their clients
 * said. The input is a byte (how it is cut, which ending), then the file. The reader must give the same packets in
 * pieces as at once, and must refuse in one line. */
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/pcapng.h"
#include "drivers/protocol/protocol.h"
#include "firmware_sim/replay/capture.h"
#include "firmware_sim/replay/recording.h"
#include "tests/fuzz/rig.h"
#include "tests/fuzz/seal.h"

enum { MAX_INPUT = 1 << 15 };

struct sums {
    uint64_t packets, bytes;
    int rc;
};

/* Gives the reader `piece` bytes more each time it wants some. */
static struct sums read_all(const uint8_t *data, size_t size, size_t piece)
{
    struct pcapng_reader reader = {0};
    struct sums sums = {0};
    struct sh_err err = {0};
    size_t at = 0, given = piece < size ? piece : size;
    for (;;) {
        struct pcapng_packet packet;
        size_t used = 0;
        sums.rc = pcapng_read(&reader, data + at, given - at, &packet, &used, &err);
        if (sums.rc < 0) fuzz_must_be_line(&err);
        if (sums.rc < 0) return sums;
        fuzz_must(used <= given - at, "no more is taken than there is");
        if (sums.rc == PCAPNG_PACKET) {
            fuzz_must(packet.data >= data + at && packet.data + packet.len <= data + given,
                      "a packet lies in the bytes");
            sums.packets++;
            sums.bytes += packet.len;
        }
        at += used;
        if (sums.rc != PCAPNG_MORE) continue;
        fuzz_must(used == 0 && reader.needed > given - at, "it says how many bytes it needs");
        if (given == size) return sums;
        given = size - given < piece ? size : given + piece;
    }
}

static void replay(const char *path)
{
    static struct recording recording;
    struct recording_frame frame;
    struct scanhead_stats stats;
    struct sh_err err = {0};
    int rc = recording_open(&recording, path, &err);
    for (int round = 0; rc == SH_OK && round < 2; round++) {
        while ((rc = recording_next(&recording, &frame, &err)) == 1)
            fuzz_must(frame.len == native_frame_len(frame.bytes), "a frame is whole");
        if (rc == SH_OK) recording_stats(&recording, &stats);
        if (rc == SH_OK && round == 0) rc = recording_rewind(&recording, &err);
    }
    if (rc < 0) fuzz_must_be_line(&err);
    recording_close(&recording);
}

static int take_unit(void *ctx, const void *unit, size_t len)
{
    *(uint64_t *)ctx += len != 0 ? ((const uint8_t *)unit)[0] + ((const uint8_t *)unit)[len - 1] : 0u;
    fuzz_must(len <= TALK_MAX_MESSAGE, "a unit is no longer than the protocol says");
    return 0;
}

static void count(void *ctx, enum protocol_count what, uint64_t n)
{
    *(uint64_t *)ctx += (uint64_t)what + n;
}

static void end(void *ctx)
{
    ++*(uint64_t *)ctx;
}

static void tell(void *ctx, const char *text)
{
    *(uint64_t *)ctx += strlen(text);
}

static void say_again(const struct talk *talk, int loop)
{
    uint64_t sum = 0;
    const struct talk_options options = {.unknown = TALK_ERROR, .loop = loop};
    const struct protocol_spec spec = {
        .host = {.ctx = &sum, .send = take_unit, .count = count, .hang_up = end, .tell_once = tell},
        .talk = talk,
        .talk_options = &options};
    const struct protocol_ops *ops = protocol_ops_get(PROTOCOL_CAPTURE);
    void *protocol;
    struct sh_err err;
    int64_t t_ns = 0;
    if (protocol_create(ops, &spec, &protocol, &err) != SH_OK) return;
    ops->open(protocol, 0);
    for (uint32_t i = 0; i < talk->n_requests && i < 100; i++) {
        const struct talk_request *r = &talk->request[i];
        for (uint32_t at = 0; at < r->len; at += 64)
            ops->input(protocol, talk->bytes + r->at + at, r->len - at < 64 ? r->len - at : 64);
        ops->input(protocol, (const uint8_t *)"?\n", 2 * (i % 2));
        ops->time(protocol, t_ns += 3000000);
        sum += (uint64_t)ops->owes(protocol);
    }
    for (int i = 0; i < 100 && ops->next_ns(protocol) != INT64_MAX; i++)
        ops->time(protocol, ops->next_ns(protocol));
    protocol_destroy(ops, protocol);
}

static void answer(const char *path, int loop)
{
    struct replay_capture *capture;
    struct sh_err err = {0};
    capture_is(path);
    if (capture_load(path, NULL, &capture, &err) != SH_OK) {
        fuzz_must_be_line(&err);
        return;
    }
    for (uint32_t i = 0; i < capture_n(capture); i++)
        say_again(&capture_place(capture, i)->talk, loop);
    capture_free(capture);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t bytes[MAX_INPUT];
    struct fuzz_bytes in = {data, size};
    const unsigned how = fuzz_u8(&in);
    if (in.n > sizeof bytes) return 0;
    memcpy(bytes, in.p, in.n);
    if ((how & 1) == 0) fuzz_seal(bytes, in.n);
    if ((how & 2) == 0) {
        const struct sums whole = read_all(bytes, in.n, in.n), cut = read_all(bytes, in.n, 1 + (how >> 2));
        fuzz_must(whole.packets == cut.packets && whole.bytes == cut.bytes && whole.rc == cut.rc,
                  "pieces change nothing");
    }
    const char *path = fuzz_file((how & 2) == 0 ? ".pcapng" : ".shs", bytes, in.n);
    replay(path);
    answer(path, (int)(how >> 7));
    return 0;
}
