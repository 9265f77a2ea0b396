/* SPDX-License-Identifier: MIT */
/* Repair: FILE.part, as a killed recorder or a full disk has left it, becomes a whole file of the same format.
 *
 * In: the bytes that reached the disk. Out: the same file, cut after the last whole unit (a frame, a packet, a point,
 * a shot), and with the header, the index or the end that the format needs. Nothing is invented: a figure that the
 * recorder would have learnt from later frames keeps its first value, or is counted again from the data.
 *
 * The repair works in place, since a full disk has no room for a copy. An interrupted repair can begin again: no byte
 * that it needs is overwritten before the file is whole. One thread. */
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
    uint64_t n_kept;    /* units kept */
    const char *unit;   /* "frames", "packets", "points", "points and empty shots", "poses", "waveforms" */
    uint64_t n_scans;   /* scans of these units; 0: the format can't say */
    uint64_t cut_bytes; /* bytes at the end that were in no whole unit */
    int was_whole;      /* there was nothing to repair, and nothing was changed */
};

/* The result of repair_file. repair_file takes the name FILE or FILE.part, as the user gives it. A repaired FILE.part
 * is renamed to FILE, unless FILE exists: nothing is replaced. A FILE without a FILE.part beside it is checked, and
 * repaired if it needs that. */
struct repaired {
    char *path, *part;                   /* FILE and FILE.part; repair_free frees them */
    int was_left;                        /* FILE.part was repaired */
    int is_part;                         /* it keeps the name FILE.part, since FILE exists */
    uint64_t n_kept, n_scans, cut_bytes; /* as in struct repair */
    const char *unit;
    int was_whole;
};
/* SH_EINPUT: no such file, no such format; SH_ESTATE: the file is still being written, or FILE is named and FILE.part
 * exists, too; SH_EFORMAT: the file can't be repaired, and is unchanged; SH_EPERM: the file needs a repair, but is not
 * ours to write. */
int repair_file(const char *path, const struct sh_report *report, struct repaired *repaired, struct sh_err *err);
void repair_free(struct repaired *repaired);

/* ---- for formats. Errors name the path. */

/* The words of a note at the end of a file that was not completed. */
#define REPAIR_INCOMPLETE "incomplete: the recording was not completed; data may be missing after this"

/* Says what is kept of the file. */
static inline void repair_say_kept(struct repair *repair, const char *unit, uint64_t n, uint64_t n_scans)
{
    repair->unit = unit;
    repair->n_kept = n;
    repair->n_scans = n_scans;
}
/* Reads len bytes; SH_EIO where there are fewer. */
int repair_read(const struct repair *repair, uint64_t at, void *to, size_t len, struct sh_err *err);
/* SH_EIO also where the disk is full; overwriting bytes of the file needs no room. */
int repair_write(const struct repair *repair, uint64_t at, const void *from, size_t len, struct sh_err *err);
/* Returns whether the file has the name FILE.part: its recorder did not complete it. */
int repair_is_part(const struct repair *repair);
/* Returns whether there is a file of that name, or a link. */
int repair_exists(const char *path);
/* Cuts the file at `end`, and counts the bytes that go. */
int repair_cut(struct repair *repair, uint64_t end, struct sh_err *err);
/* Rows of one length lie one after the other. repair_rows calls fn for each; fn may not keep the pointer. */
struct repair_rows {
    uint64_t from, n;
    size_t len; /* of a row */
};
int repair_rows(const struct repair *repair, const struct repair_rows *rows, void (*fn)(void *ctx, const uint8_t *row),
                void *ctx, struct sh_err *err);
/* Finds where the zeros begin that a power cut leaves before `end`: there are none where that is `end`. */
int repair_find_zeros(const struct repair *repair, uint64_t from, uint64_t end, uint64_t *zeros_at, struct sh_err *err);
/* Leaves out the rows of zeros before `end`, where the file's rows end. The row in which the zeros begin is left out,
 * too, since its rest is lost: where zeros follow it, or where fewer than `least` bytes are before them. So are rows
 * before it that are no better. */
int repair_leave_zeros(const struct repair *repair, struct repair_rows *rows, uint64_t end, size_t least,
                       struct sh_err *err);
/* Returns whether all bytes of a row are 0: a power cut leaves zeros at a file's end. */
int repair_is_zero(const uint8_t *row, size_t len);
/* Calls fn for each line from `from` on that ends in a newline, without the newline. fn returns 1 for a line of this
 * format, else 0. A line with a NUL, or of 64 KiB and more, belongs to no format. *end is where the last good line
 * ends. SH_EFORMAT: good lines follow a bad one, which no kill and no full disk causes. */
int repair_lines(const struct repair *repair, uint64_t from, int (*fn)(void *ctx, const char *line, size_t len),
                 void *ctx, uint64_t *end, struct sh_err *err);
/* Checks that nothing follows `end` but a piece of a unit, of at most `most` bytes, and then zeros (after a power cut).
 * Else SH_EFORMAT: no kill and no full disk causes that damage. */
int repair_check_rest(const struct repair *repair, uint64_t end, uint64_t most, struct sh_err *err);
/* Puts a note at the end that the file may be incomplete. Where a full disk has no room for the note, that is
 * reported. */
void repair_append_note(const struct repair *repair, uint64_t end, const void *note, size_t len);
/* SH_EFORMAT: there is damage at that byte, which no recorder leaves. */
int repair_fail_damaged(const struct repair *repair, uint64_t at, struct sh_err *err);
/* SH_EFORMAT: the file is not whole, and another program wrote it. Such files are checked, but never changed: what
 * looks like damage may be a kind of line or block that only that program knows. */
int repair_fail_foreign(const struct repair *repair, struct sh_err *err);
/* SH_EFORMAT: the file is not of that format, or too short to tell. */
int repair_fail_none(const struct repair *repair, const char *format, struct sh_err *err);

/* Ends a text after its last good line, and sets was_whole. If the text was not whole, the note follows as a comment.
 * is_marked: this comment is there already. SH_EFORMAT where the text is not whole and not ours. */
int repair_end_text(struct repair *repair, uint64_t end, int is_marked, int is_ours, struct sh_err *err);
/* Returns whether a line is that comment. */
int repair_is_mark(const char *line, size_t len);

/* ---- the repairs, each in a file of its name */

int e57_repair(struct repair *repair, struct sh_err *err);
int las_repair(struct repair *repair, struct sh_err *err);
int obj_repair(struct repair *repair, struct sh_err *err);
int ply_repair(struct repair *repair, struct sh_err *err);
int ptx_repair(struct repair *repair, struct sh_err *err);

#endif
