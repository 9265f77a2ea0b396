/* SPDX-License-Identifier: MIT */
#include "core/huge_pages.h"

#include <stdlib.h>
#include <sys/mman.h>

void *huge_pages_alloc(size_t size)
{
    const size_t page = (size_t)2 << 20;
    size_t align = size < page ? 128 : page;
    void *p = aligned_alloc(align, (size + align - 1) / align * align);
#ifdef MADV_HUGEPAGE
    if (p != NULL && align == page) madvise(p, size, MADV_HUGEPAGE); /* without large pages it works as well */
#endif
    return p;
}
