/* SPDX-License-Identifier: MIT */
#include "tests/common/free_fd.h"

#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

int free_fd(void)
{
    const int fd = fcntl(STDERR_FILENO, F_DUPFD, 0);
    if (fd >= 0) close(fd);
    return fd;
}

int free_fd_check(int before)
{
    for (int fd = before; fcntl(fd, F_GETFD) >= 0; fd++) {
        char link[64], file[512];
        snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
        const ssize_t n = readlink(link, file, sizeof file - 1);
        file[n > 0 ? n : 0] = '\0';
        if (strstr(file, "/proj.db") != NULL) continue;
        fprintf(stderr, "a file was left open: %s\n", file);
        return -1;
    }
    return 0;
}
