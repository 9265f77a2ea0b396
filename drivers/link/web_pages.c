/* SPDX-License-Identifier: MIT */
#include "drivers/link/web_pages.h"

#include <string.h>

/* A line for each file, WEB_PAGE(its number, its path on the disk, its path on the link): the Makefile writes them. */
#define WEB_PAGE(number, file, at)                                                                 \
    extern const char web_page_##number[], web_page_##number##_end[];                              \
    __asm__(".pushsection .rodata\nweb_page_" #number ":\n.incbin \"" file "\"\nweb_page_" #number \
            "_end:\n.byte 0\n.popsection\n");
#include "drivers/link/web_pages.inc"
#undef WEB_PAGE

#define WEB_PAGE(number, file, at) {at, web_page_##number, web_page_##number##_end},
static const struct {
    const char *path, *begin, *end;
} pages[] = {
#include "drivers/link/web_pages.inc"
};
#undef WEB_PAGE

static const char *type_of(const char *path)
{
    static const char *const types[][2] = {{".html", "text/html; charset=utf-8"},
                                           {".css", "text/css; charset=utf-8"},
                                           {".js", "text/javascript; charset=utf-8"},
                                           {".svg", "image/svg+xml"}};
    const char *ending = strrchr(path, '.');
    for (size_t i = 0; ending != NULL && i < sizeof types / sizeof *types; i++)
        if (strcmp(ending, types[i][0]) == 0) return types[i][1];
    return "application/octet-stream";
}

int web_page_at(const char *path, struct web_page *out)
{
    if (strcmp(path, "/") == 0) path = "/index.html";
    for (size_t i = 0; i < sizeof pages / sizeof *pages; i++) {
        if (strcmp(pages[i].path, path) != 0) continue;
        *out = (struct web_page){type_of(path), pages[i].begin, (size_t)(pages[i].end - pages[i].begin)};
        return 1;
    }
    return 0;
}
