/* SPDX-License-Identifier: MIT */
#include "drivers/record/e57_end.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int put_xml(struct e57_pages *pages, const struct e57_facts *facts, size_t *len, struct sh_err *err)
{
    char *xml;
    int rc = e57_xml(facts, &xml, len, err);
    if (rc != 0) return rc;
    rc = e57_put(pages, xml, *len, err);
    if (rc == 0) rc = e57_finish(pages, err);
    free(xml);
    return rc;
}

static int patch_sections(struct e57_pages *pages, const struct e57_facts *facts, const struct sh_report *report,
                          struct sh_err *err)
{
    int rc = 0;
    for (uint32_t i = 0; rc == 0 && i < facts->n_scans; i++) {
        uint8_t section[E57_SECTION_HEADER_LEN];
        const struct e57_scan *s = &facts->scan[i];
        e57_section_header(s->section, s->section_len, section);
        rc = outfile_check_stop(pages->file, report, err); /* a page is read and written for each scan */
        if (rc == 0) rc = e57_patch(pages, s->section, section, sizeof section, err);
    }
    return rc;
}

static int cut_and_sync(const struct e57_pages *pages, struct sh_err *err)
{
    const struct outfile *file = pages->file;
    if (ftruncate(file->fd, (off_t)(pages->n_full * E57_PAGE)) == 0 && fdatasync(file->fd) == 0) return 0;
    return sh_fail(err, SH_EIO, "%s: cannot write: %s", file->part, strerror(errno));
}

int e57_end(struct e57_pages *pages, const struct e57_facts *facts, const struct sh_report *report, struct sh_err *err)
{
    uint8_t header[E57_FILE_HEADER_LEN];
    const uint64_t at = e57_logical(pages);
    size_t len;
    /* The points are written before the reserved room is freed: if that fails, a repair still needs the room. */
    int rc = outfile_flush(pages->file, err);
    if (rc != 0) return rc;
    outfile_release(pages->file);
    rc = put_xml(pages, facts, &len, err);
    if (rc == 0) rc = patch_sections(pages, facts, report, err);
    if (rc == 0) rc = cut_and_sync(pages, err);
    if (rc != 0) return rc;
    e57_file_header(pages->n_full, at, len, header);
    return e57_patch(pages, 0, header, sizeof header, err);
}
