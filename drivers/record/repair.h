/* SPDX-License-Identifier: MIT */
/* Repair: what a recorder that was killed, or a full disk, has left as FILE.part becomes a whole file of the same format,
 * with what is in it.
 *
 * In: the bytes that reached the disk. Out: the same file, in place: cut behind the last whole unit (a frame, a packet, a
 * point, a shot), and with the header, the index or the end that the format wants. Nothing is invented: what the recorder
 * would have known from later frames stays as it was at first, or is counted again from what is there. In place, as a full
 * disk has no room for a copy; and so that a repair that is itself interrupted can begin again: until the file is whole, what
 * makes it whole is written first, and nothing that is read is overwritten before. One thread. */
#ifndef DRIVERS_RECORD_REPAIR_H
#define DRIVERS_RECORD_REPAIR_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"

struct repair {
    int fd;                         /* of the file, for reading and writing, locked */
    const char *path;               /* in messages */
    uint64_t len;                   /* its bytes as it was left */
    const struct sh_report *report; /* progress; may be NULL */

    /* out */
    uint64_t n_kept;    /* of its units */
    const char *unit;   /* "frames", "packets", "points", "shots" */
    uint64_t n_scans;   /* that they are of, as far as the format knows; 0: it does not */
    uint64_t cut_bytes; /* that were at its end, and are in no whole unit */
    int was_whole;      /* there was nothing to repair, and nothing was changed */
};

/* The path of a file, or of what was left of it (FILE.part), as its user names it. What was left and is whole now is renamed,
 * unless a file of that name is there: nothing is replaced. A file without anything left beside it is checked, and repaired
 * where it needs that. */
struct repaired {
    char *path, *part;                   /* of the file, and of what was left; repair_free frees them */
    int was_left;                        /* what was repaired had the name of part */
    int is_part;                         /* and has it still: another file has its name */
    uint64_t n_kept, n_scans, cut_bytes; /* as in struct repair */
    const char *unit;
    int was_whole;
};
/* SH_EINPUT: no such file, no such format; SH_ESTATE: it is still being written, or both are there, and the file is named;
 * SH_EFORMAT: it can't be repaired, and is as it was. */
int repair_file(const char *path, const struct sh_report *report, struct repaired *repaired, struct sh_err *err);
void repair_free(struct repaired *repaired);

/* ---- for formats. Errors name the path. */

/* All len bytes; SH_EIO where there are fewer. */
int repair_read(const struct repair *repair, uint64_t at, void *to, size_t len, struct sh_err *err);
/* SH_EIO: also where the disk has no room; what is in the file takes none. */
int repair_write(const struct repair *repair, uint64_t at, const void *from, size_t len, struct sh_err *err);
/* Whether it has the name FILE.part: its recorder did not complete it. */
int repair_is_part(const struct repair *repair);
/* Cuts the file behind `end`, and counts what is cut. */
int repair_cut(struct repair *repair, uint64_t end, struct sh_err *err);
/* Rows of row_len bytes from `from` on, n of them. fn may not keep the pointer. */
int repair_rows(const struct repair *repair, uint64_t from, size_t row_len, uint64_t n,
                void (*fn)(void *ctx, const uint8_t *row), void *ctx, struct sh_err *err);
/* A power cut leaves zeros at a file's end. */
int repair_is_zero(const uint8_t *row, size_t len);
/* Lines from `from` on, each with its newline but not given with it. fn returns 1: a line of this format, 0: none. *end is
 * behind the last good one. SH_EFORMAT: good lines follow a bad one, which no kill and no full disk does. */
int repair_lines(const struct repair *repair, uint64_t from, int (*fn)(void *ctx, const char *line, size_t len),
                 void *ctx, uint64_t *end, struct sh_err *err);
/* What is behind the last whole unit is the piece of one, of `most` bytes, and then zeros, which a power cut leaves. Else
 * SH_EFORMAT: that is damage, and no kill and no full disk does it. */
int repair_check_rest(const struct repair *repair, uint64_t end, uint64_t most, struct sh_err *err);
/* Puts a note at the end that the file may be incomplete. On a full disk there may be no room for it, which is reported. */
void repair_append_note(const struct repair *repair, uint64_t end, const void *note, size_t len);
/* SH_EFORMAT: damage at that byte, which no recorder leaves. */
int repair_fail_damaged(const struct repair *repair, uint64_t at, struct sh_err *err);
/* SH_EFORMAT: it is not whole, and another program has written it. Such files are checked, and never changed: what is damage
 * here may be a kind of line or of block that only that program knows. */
int repair_fail_foreign(const struct repair *repair, struct sh_err *err);
/* SH_EFORMAT: "PATH: is no FORMAT, or too little of it came to the disk". */
int repair_fail_none(const struct repair *repair, const char *format, struct sh_err *err);

#endif
