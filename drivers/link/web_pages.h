/* SPDX-License-Identifier: MIT */
/* The page's own files, as they stand in the folder web, built into the program. Private to the web link. */
#ifndef DRIVERS_LINK_WEB_PAGES_H
#define DRIVERS_LINK_WEB_PAGES_H

#include <stddef.h>

struct web_page {
    const char *type, *bytes;
    size_t len;
};

/* Finds the file at a path; "/" is index.html. Returns 0: there is none. */
int web_page_at(const char *path, struct web_page *out);

#endif
