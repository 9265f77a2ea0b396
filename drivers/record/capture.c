/* SPDX-License-Identifier: MIT */
#include "drivers/record/capture.h"

#include <stdio.h>
#include <stdlib.h>

#include "drivers/protocol/pcapng.h"

enum { SNAP_LEN = 262144 }; /* as other programs write it; no frame is longer */

int capture_open(struct capture *capture, const char *path, struct sh_err *err)
{
    *capture = (struct capture){.file.fd = -1};
    uint8_t section[PCAPNG_FRONT_ROOM];
    char *part;
    if (asprintf(&part, "%s.part", path) < 0) return sh_fail(err, SH_ENOMEM, "%s: no memory for its name", path);
    int rc = outfile_check_left(part, path, err);
    free(part);
    if (rc == SH_OK) rc = outfile_open(&capture->file, path, err);
    return rc == SH_OK ? outfile_write(&capture->file, section, pcapng_put_section(section, "scanhead"), err) : rc;
}

int capture_add_interface(struct capture *capture, const char *name, const char *comment, struct sh_err *err)
{
    uint8_t block[PCAPNG_FRONT_ROOM];
    capture->n_interfaces++;
    return outfile_write(&capture->file, block, pcapng_put_interface(block, PCAPNG_ETHERNET, SNAP_LEN, name, comment),
                         err);
}

int capture_add(struct capture *capture, const struct capture_frame *f, struct sh_err *err)
{
    uint8_t *to = outfile_room(&capture->file, pcapng_packet_len(f->len) + PCAPNG_LOST, err);
    if (to == NULL) return SH_EIO;
    outfile_used(&capture->file, pcapng_put_packet(to, f->interface, f->t_ns, f->bytes, f->len, f->lost));
    capture->packets++;
    return SH_OK;
}

int capture_add_statistics(struct capture *capture, uint32_t interface, int64_t t_ns, uint64_t received,
                           uint64_t dropped, struct sh_err *err)
{
    uint8_t block[PCAPNG_FRONT_ROOM];
    return outfile_write(&capture->file, block, pcapng_put_statistics(block, interface, t_ns, received, dropped), err);
}

int capture_save(struct capture *capture, struct sh_err *err)
{
    return outfile_save(&capture->file, err);
}

int capture_close(struct capture *capture, int keep, struct sh_err *err)
{
    return outfile_close(&capture->file, keep ? OUTFILE_KEEP_PART : OUTFILE_DROP, err);
}
