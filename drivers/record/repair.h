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

#include <stdint.h>

#include "core/err.h"

struct repair {
    int fd;           /* of the file, for reading and writing, locked */
    const char *path; /* in messages */
    uint64_t len;     /* its bytes as it was left */
    const struct sh_report *report; /* progress; may be NULL */

    /* out */
    uint64_t n_kept; /* of its units */
    const char *unit; /* "frames", "packets", "points", "shots" */
    uint64_t n_scans; /* that they are of, as far as the format knows; 0: it does not */
    uint64_t cut_bytes; /* that were at its end, and are in no whole unit */
    int was_whole; /* there was nothing to repair, and nothing was changed */
};

#endif
