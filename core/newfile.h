/* SPDX-License-Identifier: MIT */
/* Files that the program makes: recordings, streams, statistics, journals, maps. In: a path. Out: an empty
 * file behind a descriptor.
 *
 * The rule for links: a symbolic link at the last name of a path is always refused. In a folder like /tmp anybody can
 * put one there, and the program would write to its target. Links to folders are followed. newfile_open also follows
 * the system's own: /dev/stdout, /dev/stderr, /dev/fd/N and /proc/self/fd/N. A file with more than one name (hard
 * links) is not written in place either.
 *
 * Any thread. Errors name the path: SH_EINPUT (no such folder, a link, the wrong kind of file, another writer),
 * SH_EPERM, SH_EIO, SH_ENOMEM. Some functions also return SH_ESTATE, as their comments say. */
#ifndef CORE_NEWFILE_H
#define CORE_NEWFILE_H

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "core/err.h"

/* Opens a file that is written in place: it is made, or emptied. It is locked as long as *fd is open: a second
 * writer is refused before it empties the file. Devices are taken as they are, and pipes that have a reader. A file
 * behind /dev/stdout, /dev/stderr or /dev/fd/N is neither emptied nor locked: *fd is then a duplicate of that
 * descriptor, since others write there. *fd is for writing, and blocks. */
int newfile_open(const char *path, int *fd, struct sh_err *err);

/* Opens a file that grows line by line, for reading and appending: it is made, or stays as it is. It is locked as long
 * as *fd is open; SH_ESTATE where another process has it. On a file system without locks the file is not locked. */
int newfile_append(const char *path, int *fd, struct sh_err *err);

/* A file that appears at `path` whole or not at all. It is written as `part` in the same folder, and renamed
 * at the end. `path` is free or a regular file: nothing else is ever replaced. `part` is locked as long as it
 * has its name, so that a second writer of the same file is refused. A writer of a file that is being written in
 * place is refused, too. A `part` that a killed writer has left is taken over. *fd is for reading and writing. */
int newfile_part(const char *path, const char *part, int *fd, struct sh_err *err);
/* Writes such a file by one call of put, as PATH.part. Errors of put are reported as "PATH: cannot be written: ...".
 * put need not check its writes to the file: a failed one is found here. */
typedef int newfile_put(const void *source, FILE *file, struct sh_err *why);
int newfile_write(const char *path, newfile_put *put, const void *source, struct sh_err *err);
/* The same for a file that newfile_append has opened as *fd. The new file is locked, too, and *fd becomes its
 * descriptor. SH_ESTATE: path no longer names the file of *fd. */
int newfile_replace(const char *path, int *fd, newfile_put *put, const void *source, struct sh_err *err);
/* A stream on a duplicate of fd, whose end leaves fd open. NULL: errno has the reason. */
static inline FILE *newfile_stream(int fd, const char *mode)
{
    const int own = dup(fd);
    FILE *file = own >= 0 ? fdopen(own, mode) : NULL;
    if (file == NULL && own >= 0) close(own);
    return file;
}
/* Before long work: checks whether newfile_part would make `path`, with `path`.part as its part. The check leaves no
 * file behind: a part that a killed writer has left is removed. */
int newfile_check(const char *path, struct sh_err *err);
/* Returns 0 where files can be made in the folder of `path`, else the reason as errno has it. */
static inline int newfile_folder_error(const char *path)
{
    char folder[PATH_MAX];
    const char *slash = strrchr(path, '/');
    snprintf(folder, sizeof folder, "%.*s", slash != NULL ? (int)(slash - path) + 1 : 0, path);
    return faccessat(AT_FDCWD, folder[0] != '\0' ? folder : ".", W_OK | X_OK, AT_EACCESS) == 0 ? 0 : errno;
}
/* Says in err that the path is a symbolic link, and where it leads. Returns SH_EINPUT. */
int newfile_fail_link(const char *path, struct sh_err *err);
/* Opens the `part` that a killed writer has left: an existing regular file, for reading and writing, locked as
 * newfile_part does. SH_EINPUT: there is none; SH_ESTATE: it is still being written. */
int newfile_left(const char *part, int *fd, struct sh_err *err);
/* Opens an existing regular file for reading. Where it is the user's own, has no other name, and is not locked by
 * another process, it is opened for writing, too, and locked. */
int newfile_whole(const char *path, int *fd, struct sh_err *err);
/* The size in bytes of a part that was left and that nobody writes, or 0. */
long long newfile_left_len(const char *part);
/* Syncs, renames and closes. After a failure part stays, and fd is open. */
int newfile_settle(const char *path, const char *part, int fd, struct sh_err *err);
/* The two steps of newfile_settle, for files that belong together: all are synced before any is renamed. fd
 * stays open. */
int newfile_sync(const char *part, int fd, struct sh_err *err);
int newfile_rename(const char *path, const char *part, struct sh_err *err);
/* newfile_settle, but nothing at path is replaced: SH_ESTATE where something is there. */
int newfile_settle_free(const char *path, const char *part, int fd, struct sh_err *err);
/* Syncs and renames; after a failure part is removed. fd is closed in any case. */
int newfile_keep(const char *path, const char *part, int fd, struct sh_err *err);
/* Removes part and closes. */
void newfile_drop(const char *part, int fd);

#endif
