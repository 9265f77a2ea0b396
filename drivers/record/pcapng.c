/* .pcapng: each frame of the stream as a packet, for capinfos, tshark and other readers of captures
 * (draft-ietf-opsawg-pcapng). Link type 147 (USER0): a packet is one frame of the native protocol, header and
 * payload. Its time is the frame's device time, nanoseconds since power-up. */
#include <string.h>

#include "drivers/protocol/bytes.h"
#include "drivers/protocol/native.h"
#include "drivers/record/recorder.h"

enum {
    BLOCK_SECTION = 0x0a0d0d0a,
    BLOCK_INTERFACE = 1,
    BLOCK_PACKET = 6,
    BYTE_ORDER_MAGIC = 0x1a2b3c4d,
    LINK_USER0 = 147,
    OPTION_COMMENT = 1,
    OPTION_NAME = 2,
    OPTION_APPLICATION = 4,
    OPTION_TIME_RESOLUTION = 9,
    PACKET_HEAD_LEN = 28,
    FRONT_MAX = 512,
};

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
    return put_option(to, code, text, strlen(text));
}

/* The end of the options; then a block's length, which stands at both its ends. */
static uint8_t *end_block(uint8_t *block, uint8_t *to)
{
    to = put_option(to, 0, "", 0);
    uint32_t len = (uint32_t)(to - block) + 4;
    le_put32(block + 4, len);
    le_put32(to, len);
    return to + 4;
}

static size_t put_front(uint8_t *to)
{
    static const uint8_t nanoseconds = 9;
    uint8_t *at = to;
    le_put32(at, BLOCK_SECTION);
    le_put32(at + 8, BYTE_ORDER_MAGIC);
    le_put16(at + 12, 1); /* version 1.0 */
    le_put16(at + 14, 0);
    le_put64(at + 16, UINT64_MAX); /* of unknown length */
    uint8_t *interface = end_block(at, put_text_option(at + 24, OPTION_APPLICATION, "scanhead"));
    le_put32(interface, BLOCK_INTERFACE);
    le_put16(interface + 8, LINK_USER0);
    le_put16(interface + 10, 0);
    le_put32(interface + 12, NATIVE_MAX_FRAME);
    at = put_text_option(interface + 16, OPTION_NAME, "scan head");
    at = put_option(at, OPTION_TIME_RESOLUTION, &nanoseconds, 1);
    at = put_text_option(at, OPTION_COMMENT,
                         "Frames of scanhead's native protocol (PROTOCOL.md); times are device time since power-up.");
    return (size_t)(end_block(interface, at) - to);
}

static int pcapng_begin(void *rec, struct sh_err *err)
{
    struct recorder *pcapng = rec;
    uint8_t front[FRONT_MAX];
    return outfile_write(&pcapng->file, front, put_front(front), err);
}

static int pcapng_frame(void *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct outfile *file = &((struct recorder *)rec)->file;
    (void)sh;
    size_t len = PACKET_HEAD_LEN + (frame->raw_len + 3) / 4 * 4 + 4;
    uint8_t *to = outfile_room(file, len, err);
    if (to == NULL) return SH_EIO;
    le_put32(to, BLOCK_PACKET);
    le_put32(to + 4, (uint32_t)len);
    le_put32(to + 8, 0); /* the one interface */
    le_put32(to + 12, (uint32_t)((uint64_t)frame->t_ns >> 32));
    le_put32(to + 16, (uint32_t)frame->t_ns);
    le_put32(to + 20, (uint32_t)frame->raw_len);
    le_put32(to + 24, (uint32_t)frame->raw_len);
    le_put32(put_padded(to + PACKET_HEAD_LEN, frame->raw, frame->raw_len), (uint32_t)len);
    outfile_used(file, len);
    return 0;
}

const struct recorder_ops recorder_pcapng = {
    .ending = ".pcapng",
    .size = sizeof(struct recorder),
    .begin = pcapng_begin,
    .frame = pcapng_frame,
};
