/* SPDX-License-Identifier: MIT */
/* The pages of an E57 file (ASTM E2807). A page is 1020 bytes of content, then their CRC-32C, big-endian.
 * Offsets that count content alone are logical, those that count the CRCs too are physical. */
#ifndef DRIVERS_RECORD_E57_PAGES_H
#define DRIVERS_RECORD_E57_PAGES_H

#include "drivers/record/outfile.h"

enum {
    E57_PAGE = 1024,
    E57_PAGE_CONTENT = 1020,
    E57_FILE_HEADER_LEN = 48,    /* at the file's begin */
    E57_SECTION_HEADER_LEN = 32, /* before the packets of a scan */
};

struct e57_pages {
    struct outfile *file;
    uint64_t n_full; /* pages that went to the file */
    size_t used;     /* of the page at hand */
    uint8_t page[E57_PAGE];
};

uint64_t e57_logical(const struct e57_pages *pages); /* where the next byte will be */
uint64_t e57_physical(uint64_t logical);
int e57_page_is_right(const uint8_t page[E57_PAGE]); /* whether its CRC is right */

int e57_put(struct e57_pages *pages, const void *data, size_t len, struct sh_err *err);
/* Fills the page at hand with zeros and flushes the file. */
int e57_finish(struct e57_pages *pages, struct sh_err *err);
/* Flushes, and puts the page at hand into the file as it is, filled up with zeros. The page is written again when it is
 * full. */
int e57_keep_page(struct e57_pages *pages, struct sh_err *err);
/* Overwrites content. */
int e57_patch(struct e57_pages *pages, uint64_t logical, const void *data, size_t len, struct sh_err *err);

/* Makes the file's own header, which is written once everything else is there. */
void e57_file_header(uint64_t n_pages, uint64_t xml, size_t xml_len, uint8_t out[E57_FILE_HEADER_LEN]);
/* Makes the header of a section of packets without an index. section and len are logical. */
void e57_section_header(uint64_t section, uint64_t len, uint8_t out[E57_SECTION_HEADER_LEN]);

#endif
