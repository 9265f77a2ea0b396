/* .shs: the stream as it came, frame after frame, without the reply lines. scanhead_open reads it as a
 * source. */
#include "drivers/record/recorder.h"

static int shs_frame(void *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct recorder *shs = rec;
    (void)sh;
    return outfile_write(&shs->file, frame->raw, frame->raw_len, err);
}

const struct recorder_ops recorder_shs = {
    .ending = ".shs",
    .size = sizeof(struct recorder),
    .frame = shs_frame,
};
