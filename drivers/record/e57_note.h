/* SPDX-License-Identifier: MIT */
/* The note before the points of each scan in an E57 file. The note lets a repair complete a file whose recorder was
 * killed (e57_repair.c): it holds what the XML section would say about the scan, except what is counted from the
 * points. The note is a binary section that the standard calls a blob, and the XML names it as the scan's `sh:begin`.
 * Readers skip it.
 *
 *   0   blob's header: type 0, zeros   8 bytes; length of the section   uint64
 *  16   "scanhead e57 1"   16 bytes
 *  32   number and station of the scan, EPSG code, bits: 1 heights above the geoid, 2 shots without echo, 4 colours,
 *       8 the start is known   4 x uint32
 *  48   step of coordinates, m; start, GPS s   2 x double
 *  64   pose: shift, m; rotation, row by row   12 x double
 * 160   identity   96 bytes; profile   32 bytes; each with zeros up to its end
 *
 * The note lies in one page of the file, so that it is there as a whole or not at all. Pure. */
#ifndef DRIVERS_RECORD_E57_NOTE_H
#define DRIVERS_RECORD_E57_NOTE_H

#include "drivers/record/e57_pages.h"
#include "drivers/record/e57_xml.h"

enum { E57_BLOB_HEADER_LEN = 16, E57_NOTE_LEN = 288 }; /* of the section, with the blob's header */

/* Returns the place of the next note in a file that ends at `logical`: there or, where the note would not fit into the
 * page, in the next page. */
static inline uint64_t e57_note_place(uint64_t logical)
{
    const uint64_t used = logical % E57_PAGE_CONTENT;
    return used + E57_NOTE_LEN <= E57_PAGE_CONTENT ? logical : logical - used + E57_PAGE_CONTENT;
}

void e57_note_put(const struct e57_facts *facts, const struct e57_scan *scan, uint8_t out[E57_NOTE_LEN]);
/* Sets those members of facts and scan that the note has. -1: it is not a note. */
int e57_note_get(const uint8_t note[E57_NOTE_LEN], struct e57_facts *facts, struct e57_scan *scan);

#endif
