/* SPDX-License-Identifier: MIT */
/* This fuzzes the client library with a head that may say anything. The input is a byte, then records: bytes that come,
 * a command, or a frame that is asked for. A reply must fit its room and be one line. The library must never wait
 * longer than it was told. */
#include <stdlib.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/host/scanhead.h"
#include "tests/fuzz/rig.h"
#include "tests/fuzz/seal.h"

enum { MAX_RECORDS = 64, MAX_BYTES = 2048 };

static void note(void *ctx, const struct scanhead_notice *notice)
{
    uint64_t *last = ctx;
    const int is_refused = notice->kind == SCANHEAD_NOTICE_REFUSED; /* it may wait for its turn */
    fuzz_must(is_refused || notice->at_byte >= *last, "notices come in the order of the stream");
    fuzz_must((notice->why != NULL) == is_refused, "a refusal has a reason");
    fuzz_must(scanhead_notice_name((int)notice->kind)[0] != '?', "each kind has a name");
    if (!is_refused) *last = notice->at_byte;
}

static void ask(struct scanhead *sh, unsigned how)
{
    static const char *const commands[] = {"*IDN?", "HEAD:PRR 300000", "", "SYST:ERR?"};
    char reply[300];
    memset(reply, 'x', sizeof reply);
    const size_t room = (how & 4) != 0 ? 8 : sizeof reply;
    if (scanhead_command(sh, commands[how & 3], reply, room, 0) != SCANHEAD_OK) return;
    fuzz_must(memchr(reply, '\0', room) != NULL, "a reply fits its room");
    fuzz_must(strpbrk(reply, "\r\n") == NULL, "a reply is one line");
}

static void take(struct scanhead *sh)
{
    struct scanhead_frame frame;
    struct scanhead_point point[8];
    if (scanhead_next(sh, &frame, 0) != SCANHEAD_OK) return;
    fuzz_must(frame.raw_len == frame.payload_len + 28, "a frame is header and payload");
    scanhead_points(sh, &frame, 0, point, 8);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct fuzz_bytes in = {data, size};
    const unsigned how = fuzz_u8(&in);
    uint64_t last = 0;
    char source[32], why[256];
    struct scanhead *sh;
    struct scanhead_stats stats;
    int pair[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair) != 0) abort();
    snprintf(source, sizeof source, "fd:%d", pair[0]);
    if (scanhead_open(source, &sh, why, sizeof why) != SCANHEAD_OK) abort();
    scanhead_on_notice(sh, note, &last);
    for (int i = 0; i < MAX_RECORDS && in.n > 0; i++) {
        uint8_t bytes[MAX_BYTES];
        const unsigned what = fuzz_u8(&in);
        size_t n;
        if ((what & 3) == 2) ask(sh, what >> 2);
        if ((what & 3) == 3) take(sh);
        if ((what & 3) > 1) continue;
        const uint8_t *from = fuzz_take(&in, fuzz_u16(&in) % MAX_BYTES, &n);
        memcpy(bytes, from, n);
        if ((how & 1) == 0) fuzz_seal(bytes, n);
        if (send(pair[1], bytes, n, MSG_DONTWAIT | MSG_NOSIGNAL) < 0) break;
    }
    close(pair[1]);
    for (struct scanhead_frame frame; scanhead_next(sh, &frame, 0) == SCANHEAD_OK;)
        continue;
    scanhead_get_stats(sh, &stats);
    scanhead_close(sh);
    return 0;
}
