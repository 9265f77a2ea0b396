/* The pages of an E57 file (ASTM E2807). A page is 1020 bytes of content, then their CRC-32C, big-endian.
 * Offsets that count content alone are logical, those that count the CRCs too are physical. */
#ifndef DRIVERS_RECORD_E57_PAGES_H
#define DRIVERS_RECORD_E57_PAGES_H

#include "drivers/record/outfile.h"

enum { E57_PAGE = 1024, E57_PAGE_CONTENT = 1020 };

struct e57_pages {
    struct outfile *file;
    uint64_t n_full; /* pages that went to the file */
    size_t used;     /* of the page at hand */
    uint8_t page[E57_PAGE];
};

uint64_t e57_logical(const struct e57_pages *pages); /* where the next byte will be */
uint64_t e57_physical(uint64_t logical);

int e57_put(struct e57_pages *pages, const void *data, size_t len, struct sh_err *err);
/* Fills the page at hand with zeros and flushes the file. */
int e57_finish(struct e57_pages *pages, struct sh_err *err);
/* Overwrites content that is in the file: only after e57_finish. */
int e57_patch(struct e57_pages *pages, uint64_t logical, const void *data, size_t len, struct sh_err *err);

#endif
