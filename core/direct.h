/* SPDX-License-Identifier: MIT */
/* Writing past the system's cache (O_DIRECT). It saves copying, which is most of the cost of a long file, but each
 * write then waits for the disk. Each write takes whole blocks of aligned memory, at whole blocks of the file. */
#ifndef CORE_DIRECT_H
#define CORE_DIRECT_H

#include <errno.h>
#include <fcntl.h>
#include <unistd.h>

enum {
    DIRECT_BLOCK = 4096,   /* places and lengths are multiples of it */
    DIRECT_FROM = 8 << 20, /* a shorter file stays in the system's cache, as it is often read again soon */
};

/* Switches O_DIRECT on or off for the writes that follow. *is_on is 0 at first; it becomes -1 where the file system or
 * an older kernel can't do it, and then stays so. */
static inline void direct_set(int fd, int *is_on, int on)
{
    if (*is_on < 0 || *is_on == on) return;
    const int flags = fcntl(fd, F_GETFL);
    const int is_set = flags >= 0 && fcntl(fd, F_SETFL, on ? flags | O_DIRECT : flags & ~O_DIRECT) == 0;
    *is_on = is_set ? on : -1;
}

/* As pwrite(), but it tries again after a signal. Where the file system refuses a direct write after all, or wants
 * larger blocks, this write and all later ones go through the cache. Returns how many bytes were written, or -1 with
 * errno. */
static inline ssize_t direct_pwrite(int fd, int *is_on, const void *data, size_t len, off_t at)
{
    for (;;) {
        const ssize_t n = pwrite(fd, data, len, at);
        if (n > 0) return n;
        if (n == 0) errno = ENOSPC;
        if (n < 0 && errno == EINTR) continue;
        if (n == 0 || errno != EINVAL || *is_on <= 0) return -1;
        direct_set(fd, is_on, 0);
        *is_on = -1;
    }
}

#endif
