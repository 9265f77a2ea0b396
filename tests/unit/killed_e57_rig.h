/* SPDX-License-Identifier: MIT */
/* For tests of repair: an E57 file that was recorded to its end, and the file as a power cut would have left it. */
#ifndef TESTS_UNIT_KILLED_E57_RIG_H
#define TESTS_UNIT_KILLED_E57_RIG_H

#include <stdbool.h>

#include "tests/unit/e57_rig.h"
#include "tests/unit/killed_rig.h"

enum { PAGE = 1024, CONTENT = 1020 }; /* a page's bytes, and those before its CRC */

#define KILLED_E57_MISSING "; repaired: its end is missing"

/* The complete file, and what the disk had before it was completed. */
struct killed_e57 {
    uint8_t *whole, *left;
    size_t whole_len, left_len;
};
extern struct killed_e57 killed_e57;

/* Records three scans. Lines have a second or more between them, so that packets are short. The stream's last points
 * are written in the packet that the end of the recording makes. The third scan has nine lines, or one of shots without
 * echo. */
void killed_e57_record(bool has_third, bool empty_shots, bool coloured);

/* Frees the bytes of both files, and those of e57_rig. */
void killed_e57_free(void);

#endif
