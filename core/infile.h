/* SPDX-License-Identifier: MIT */
/* Opens input files. In: a path. Out: a stream to read, or the reason why there is none, as text for a
 * message.
 *
 * Only regular files: a FIFO waits for a writer, perhaps for ever, and a device may have no end. Readers of files that
 * a user names open them here first. libscanhead opens recordings itself. */
#ifndef CORE_INFILE_H
#define CORE_INFILE_H

#include <stdio.h>

/* Opens path for reading; never waits. NULL on failure, with *why: "No such file or directory", "a FIFO,
 * not a file", ... The words live until the thread's next call of strerror. */
FILE *infile_open(const char *path, const char **why);

/* Returns whether a file begins with magic, which has up to 8 characters; -1: it can't be opened. */
int infile_begins(const char *path, const char *magic);

#endif
