/* SPDX-License-Identifier: MIT */
#include "drivers/usb/sysfile.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

int sysfile_write(const char *dir, const char *file, const char *fmt, ...)
{
    char path[512], text[128];
    va_list ap;
    va_start(ap, fmt);
    int len = vsnprintf(text, sizeof text, fmt, ap);
    va_end(ap);
    if (len < 0 || (size_t)len >= sizeof text) {
        errno = ENAMETOOLONG;
        return -1;
    }
    snprintf(path, sizeof path, "%s/%s", dir, file);
    int fd = open(path, O_WRONLY | O_CLOEXEC);
    if (fd < 0) return -1;
    ssize_t n = write(fd, text, (size_t)len);
    int error = errno;
    close(fd);
    errno = error;
    return n == len ? 0 : -1;
}

int sysfile_read(const char *dir, const char *file, char *text, size_t len)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s", dir, file);
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) return -1;
    ssize_t n = read(fd, text, len - 1);
    close(fd);
    text[n > 0 ? n : 0] = '\0';
    text[strcspn(text, "\n")] = '\0';
    return n < 0 ? -1 : 0;
}

int sysfile_mkdir(const char *dir, const char *name)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    return mkdir(path, 0755);
}

int sysfile_link(const char *dir, const char *target, const char *name)
{
    char from[512], to[512];
    snprintf(from, sizeof from, "%s/%s", dir, target);
    snprintf(to, sizeof to, "%s/%s", dir, name);
    return symlink(from, to);
}
