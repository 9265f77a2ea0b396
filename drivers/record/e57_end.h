/* SPDX-License-Identifier: MIT */
/* Writes the end of an E57 file, which makes it complete. For the recorder and for the repair. */
#ifndef DRIVERS_RECORD_E57_END_H
#define DRIVERS_RECORD_E57_END_H

#include "drivers/record/e57_pages.h"
#include "drivers/record/e57_xml.h"

enum {
    E57_XML_ROOM = 16384,
    E57_XML_ROOM_SCAN = 8192
}; /* bytes that are enough for the XML section, and for each scan in it */

/* Writes the XML section, cuts the file after it, then writes the headers of the scans. The file's own header comes
 * last, once all that is on the disk. report may be NULL. Returns SH_ESTOPPED where the report's stop
 * says so. */
int e57_end(struct e57_pages *pages, const struct e57_facts *facts, const struct sh_report *report, struct sh_err *err);

#endif
