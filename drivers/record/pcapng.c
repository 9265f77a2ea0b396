/* .pcapng: each frame of the stream as a packet, for capinfos, tshark and other readers of captures
 * (drivers/protocol/pcapng.h). A packet's time is the frame's device time, nanoseconds since power-up. */
#include "drivers/protocol/pcapng.h"

#include "drivers/protocol/native.h"
#include "drivers/record/recorder.h"

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

const struct recorder_ops recorder_pcapng = {
    .ending = ".pcapng",
    .size = sizeof(struct recorder),
    .begin = pcapng_begin,
    .frame = pcapng_frame,
};
