/* .shs: the stream as it came, frame after frame, without the reply lines. What scanhead_open reads as a
 * source. */
#include <stdlib.h>

#include "drivers/record/outfile.h"
#include "drivers/record/recorder_list.h"

static int shs_open(const char *path, const struct recorder_options *options, void **rec, struct sh_err *err)
{
    (void)options;
    struct outfile *file = malloc(sizeof *file);
    if (file == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", path);
    int rc = outfile_open(file, path, err);
    if (rc != 0) {
        free(file);
        return rc;
    }
    *rec = file;
    return 0;
}

static int shs_frame(void *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    (void)sh;
    return outfile_write(rec, frame->raw, frame->raw_len, err);
}

static int shs_close(void *rec, int keep, struct sh_err *err)
{
    int rc = outfile_close(rec, keep, err);
    free(rec);
    return rc;
}

const struct recorder_ops recorder_shs = {".shs", shs_open, shs_frame, shs_close, 0};
