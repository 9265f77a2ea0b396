/* SPDX-License-Identifier: MIT */
#include "drivers/record/e57_pages.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

#include "core/bytes.h"
#include "drivers/protocol/crc32c.h"

uint64_t e57_logical(const struct e57_pages *pages)
{
    return pages->n_full * E57_PAGE_CONTENT + pages->used;
}

uint64_t e57_physical(uint64_t logical)
{
    return logical / E57_PAGE_CONTENT * E57_PAGE + logical % E57_PAGE_CONTENT;
}

static void crc_of(const uint8_t *page, uint8_t out[4])
{
    be_put32(out, crc32c(0, page, E57_PAGE_CONTENT));
}

static void put_crc(uint8_t *page)
{
    crc_of(page, page + E57_PAGE_CONTENT);
}

int e57_page_is_right(const uint8_t page[E57_PAGE])
{
    uint8_t crc[4];
    crc_of(page, crc);
    return memcmp(crc, page + E57_PAGE_CONTENT, sizeof crc) == 0;
}

/* Puts a page of content into the file's buffer. */
static int put_page(struct e57_pages *pages, const uint8_t *content, struct sh_err *err)
{
    uint8_t *to = outfile_room(pages->file, E57_PAGE, err);
    if (to == NULL) return SH_EIO;
    memcpy(to, content, E57_PAGE_CONTENT);
    put_crc(to);
    outfile_used(pages->file, E57_PAGE);
    pages->n_full++;
    return 0;
}

int e57_put(struct e57_pages *pages, const void *data, size_t len, struct sh_err *err)
{
    const uint8_t *p = data;
    int rc = 0;
    while (rc == 0 && len > 0) {
        const size_t room = E57_PAGE_CONTENT - pages->used, n = room < len ? room : len;
        if (n == E57_PAGE_CONTENT) {
            rc = put_page(pages, p, err);
        } else {
            memcpy(pages->page + pages->used, p, n);
            pages->used = n < room ? pages->used + n : 0;
            rc = n < room ? 0 : put_page(pages, pages->page, err);
        }
        p += n;
        len -= n;
    }
    return rc;
}

int e57_finish(struct e57_pages *pages, struct sh_err *err)
{
    memset(pages->page + pages->used, 0, E57_PAGE_CONTENT - pages->used);
    int rc = pages->used > 0 ? put_page(pages, pages->page, err) : 0;
    pages->used = 0;
    return rc != 0 ? rc : outfile_flush(pages->file, err);
}

int e57_keep_page(struct e57_pages *pages, struct sh_err *err)
{
    uint8_t page[E57_PAGE] = {0};
    int rc = outfile_flush(pages->file, err); /* before the page, so that there is never a gap */
    if (rc != 0 || pages->used == 0) return rc;
    memcpy(page, pages->page, pages->used);
    put_crc(page);
    return outfile_patch(pages->file, pages->n_full * E57_PAGE, page, sizeof page, err);
}

/* Overwrites n bytes within one page. */
static int patch_page(struct e57_pages *pages, uint64_t logical, const uint8_t *p, size_t n, struct sh_err *err)
{
    uint8_t page[E57_PAGE];
    const uint64_t number = logical / E57_PAGE_CONTENT;
    const size_t first = logical % E57_PAGE_CONTENT;
    if (number == pages->n_full) {
        memcpy(pages->page + first, p, n);
        return 0;
    }
    int rc = outfile_flush(pages->file, err);
    if (rc != 0) return rc;
    const ssize_t n_read = pread(pages->file->fd, page, E57_PAGE, (off_t)(number * E57_PAGE));
    if (n_read != E57_PAGE)
        return sh_fail(err, SH_EIO, "%s: cannot be read back: %s", pages->file->part,
                       n_read < 0 ? strerror(errno) : "it became shorter");
    memcpy(page + first, p, n);
    put_crc(page);
    return outfile_patch(pages->file, number * E57_PAGE, page, E57_PAGE, err);
}

int e57_patch(struct e57_pages *pages, uint64_t logical, const void *data, size_t len, struct sh_err *err)
{
    const uint8_t *p = data;
    int rc = 0;
    while (rc == 0 && len > 0) {
        size_t n = E57_PAGE_CONTENT - logical % E57_PAGE_CONTENT;
        if (n > len) n = len;
        rc = patch_page(pages, logical, p, n, err);
        logical += n;
        p += n;
        len -= n;
    }
    return rc;
}

void e57_file_header(uint64_t n_pages, uint64_t xml, size_t xml_len, uint8_t out[E57_FILE_HEADER_LEN])
{
    memset(out, 0, E57_FILE_HEADER_LEN);
    memcpy(out, "ASTM-E57", 8);
    le_put32(out + 8, 1);
    le_put64(out + 16, n_pages * E57_PAGE);
    le_put64(out + 24, e57_physical(xml));
    le_put64(out + 32, xml_len);
    le_put64(out + 40, E57_PAGE);
}

void e57_section_header(uint64_t section, uint64_t len, uint8_t out[E57_SECTION_HEADER_LEN])
{
    memset(out, 0, E57_SECTION_HEADER_LEN);
    out[0] = 1; /* a compressed vector */
    le_put64(out + 8, len);
    le_put64(out + 16, e57_physical(section + E57_SECTION_HEADER_LEN));
}
