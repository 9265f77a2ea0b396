/* SPDX-License-Identifier: MIT */
#include "core/infile.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Returns the reason to refuse a file of that mode; NULL: it is a regular file. */
static const char *why_none(mode_t mode)
{
    if (S_ISREG(mode)) return NULL;
    if (S_ISDIR(mode)) return "a directory, not a file";
    if (S_ISFIFO(mode)) return "a FIFO, not a file";
    return "a device, not a file";
}

FILE *infile_open(const char *path, const char **why)
{
    struct stat st;
    FILE *file = NULL;
    /* O_NONBLOCK: opening a FIFO does not wait. Reading a regular file is the same with it. */
    const int fd = open(path, O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    if (fd < 0 || fstat(fd, &st) != 0)
        *why = errno == ENXIO ? "a socket or a device, not a file" : strerror(errno);
    else if ((*why = why_none(st.st_mode)) == NULL && (file = fdopen(fd, "rb")) == NULL)
        *why = strerror(errno);
    if (file == NULL && fd >= 0) close(fd);
    return file;
}

int infile_begins(const char *path, const char *magic)
{
    char begin[8] = "";
    const char *why;
    FILE *in = infile_open(path, &why);
    if (in == NULL) return -1;
    const size_t n = strlen(magic), got = fread(begin, 1, n < sizeof begin ? n : sizeof begin, in);
    fclose(in);
    return got == n && memcmp(begin, magic, n) == 0;
}
