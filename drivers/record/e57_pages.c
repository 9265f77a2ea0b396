#include "drivers/record/e57_pages.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

#include "drivers/protocol/crc32c.h"

uint64_t e57_logical(const struct e57_pages *pages)
{
    return pages->n_full * E57_PAGE_CONTENT + pages->used;
}

uint64_t e57_physical(uint64_t logical)
{
    return logical / E57_PAGE_CONTENT * E57_PAGE + logical % E57_PAGE_CONTENT;
}

static void seal(uint8_t *page)
{
    uint32_t crc = crc32c(0, page, E57_PAGE_CONTENT);
    for (int i = 0; i < 4; i++)
        page[E57_PAGE_CONTENT + i] = (uint8_t)(crc >> (24 - 8 * i));
}

static int put_page(struct e57_pages *pages, struct sh_err *err)
{
    seal(pages->page);
    pages->used = 0;
    pages->n_full++;
    return outfile_write(pages->file, pages->page, E57_PAGE, err);
}

int e57_put(struct e57_pages *pages, const void *data, size_t len, struct sh_err *err)
{
    const uint8_t *p = data;
    while (len > 0) {
        size_t n = E57_PAGE_CONTENT - pages->used;
        if (n > len) n = len;
        memcpy(pages->page + pages->used, p, n);
        pages->used += n;
        p += n;
        len -= n;
        int rc = pages->used == E57_PAGE_CONTENT ? put_page(pages, err) : 0;
        if (rc != 0) return rc;
    }
    return 0;
}

int e57_finish(struct e57_pages *pages, struct sh_err *err)
{
    memset(pages->page + pages->used, 0, E57_PAGE_CONTENT - pages->used);
    int rc = pages->used > 0 ? put_page(pages, err) : 0;
    return rc != 0 ? rc : outfile_flush(pages->file, err);
}

int e57_patch(struct e57_pages *pages, uint64_t logical, const void *data, size_t len, struct sh_err *err)
{
    const uint8_t *p = data;
    while (len > 0) {
        uint8_t page[E57_PAGE];
        uint64_t at = logical / E57_PAGE_CONTENT * E57_PAGE;
        size_t first = logical % E57_PAGE_CONTENT, n = E57_PAGE_CONTENT - first;
        if (n > len) n = len;
        if (pread(pages->file->fd, page, E57_PAGE, (off_t)at) != E57_PAGE)
            return sh_fail(err, SH_EIO, "%s: cannot read back: %s", pages->file->part, strerror(errno));
        memcpy(page + first, p, n);
        seal(page);
        int rc = outfile_patch(pages->file, at, page, E57_PAGE, err);
        if (rc != 0) return rc;
        logical += n;
        p += n;
        len -= n;
    }
    return 0;
}
