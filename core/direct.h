/* SPDX-License-Identifier: MIT */
/* Writing past the system's cache (O_DIRECT). It saves copying, which is most of the cost of a long file, but each
 * write then waits for the disk. It takes whole blocks of aligned memory, at whole blocks of the file. */
#ifndef CORE_DIRECT_H
#define CORE_DIRECT_H

#include <fcntl.h>

enum {
    DIRECT_BLOCK = 4096,   /* places and lengths are multiples of it */
    DIRECT_FROM = 8 << 20, /* a shorter file stays in the system's cache, as it is often read again soon */
};

/* Switches it for the writes that follow. Returns 0; -1: the file system or an older kernel can't do it, and the
 * descriptor stays as it was. */
static inline int direct_set(int fd, int on)
{
    const int flags = fcntl(fd, F_GETFL);
    return flags >= 0 && fcntl(fd, F_SETFL, on ? flags | O_DIRECT : flags & ~O_DIRECT) == 0 ? 0 : -1;
}

#endif
