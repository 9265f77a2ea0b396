/* SPDX-License-Identifier: MIT */
#include "core/newfile.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

enum { TRIES = 100 }; /* a try fails only where another writer ends at that moment */
/* Opening neither follows a link nor waits, and takes no terminal. */
enum { PLAIN = O_NOFOLLOW | O_NONBLOCK | O_NOCTTY | O_CLOEXEC };

static int code_of(int error)
{
    switch (error) {
    case EACCES:
    case EPERM:
    case EROFS:
        return SH_EPERM;
    case ENOENT:
    case ENOTDIR:
    case EISDIR:
    case ENAMETOOLONG:
    case ENXIO:
        return SH_EINPUT;
    default:
        return SH_EIO;
    }
}

static int newfile_fail(const char *path, const char *what, struct sh_err *err)
{
    int error = errno;
    return sh_fail(err, code_of(error), "%s: cannot %s: %s", path, what, strerror(error));
}

/* ---- files that must not be written to */

int newfile_fail_link(const char *path, struct sh_err *err)
{
    char to[200];
    ssize_t n = readlink(path, to, sizeof to - 1);
    to[n > 0 ? n : 0] = '\0';
    return sh_fail(err, SH_EINPUT,
                   "%s: is a symbolic link to %s; links are not followed: remove it, or give its target", path, to);
}

static int fail_hard_link(const char *path, const struct stat *st, struct sh_err *err)
{
    return sh_fail(err, SH_EINPUT, "%s: is a file with %lu hard links, and all of them would change; remove it first",
                   path, (unsigned long)st->st_nlink);
}

/* Returns the open descriptor that a name like /dev/stdout or /dev/fd/3 stands for; -1: it is no such name. */
static int number_of(const char *path)
{
    int n = -1;
    char rest;
    if (strcmp(path, "/dev/stdout") == 0) return STDOUT_FILENO;
    if (strcmp(path, "/dev/stderr") == 0) return STDERR_FILENO;
    const int found =
        sscanf(path, "/dev/fd/%d%c", &n, &rest) == 1 || sscanf(path, "/proc/self/fd/%d%c", &n, &rest) == 1;
    return found ? n : -1;
}

static const char *kind_of(mode_t mode)
{
    return S_ISDIR(mode)    ? "directory"
           : S_ISFIFO(mode) ? "FIFO"
           : S_ISSOCK(mode) ? "socket"
           : S_ISCHR(mode)  ? "character device"
                            : "block device";
}

/* Checks that a rename may replace the target. */
static int check_target(const char *path, struct sh_err *err)
{
    struct stat st;
    if (lstat(path, &st) != 0) return errno == ENOENT ? SH_OK : newfile_fail(path, "create", err);
    if (S_ISLNK(st.st_mode)) return newfile_fail_link(path, err);
    if (!S_ISREG(st.st_mode))
        return sh_fail(err, SH_EINPUT, "%s: is a %s; allowed is a regular file, or a name that doesn't exist", path,
                       kind_of(st.st_mode));
    return SH_OK;
}

/* ---- locks */

/* The process that holds the lock of a file, as the kernel lists locks; 0: it isn't listed, as in another container. */
static long holder_of(const struct stat *st)
{
    unsigned long ino;
    unsigned major_no, minor_no;
    long pid, found = 0;
    char line[256];
    FILE *locks = fopen("/proc/locks", "re");
    while (locks != NULL && found == 0 && fgets(line, sizeof line, locks) != NULL)
        if (sscanf(line, "%*d: FLOCK %*s %*s %ld %x:%x:%lu", &pid, &major_no, &minor_no, &ino) == 4 && pid > 0 &&
            ino == st->st_ino && major_no == major(st->st_dev) && minor_no == minor(st->st_dev))
            found = pid;
    if (locks != NULL) fclose(locks);
    return found;
}

static int fail_locked(const char *path, int fd, int code, struct sh_err *err)
{
    struct stat st;
    char comm[64], name[64] = "";
    const long pid = fstat(fd, &st) == 0 ? holder_of(&st) : 0;
    snprintf(comm, sizeof comm, "/proc/%ld/comm", pid);
    FILE *in = pid != 0 ? fopen(comm, "re") : NULL;
    if (in != NULL && fgets(name, sizeof name, in) != NULL) name[strcspn(name, "\n")] = '\0';
    if (in != NULL) fclose(in);
    if (name[0] == '\0')
        return sh_fail(err, code, "%s: is being written by another process; choose another file name", path);
    return sh_fail(err, code, "%s: is being written by process %ld (%s); choose another file name", path, pid, name);
}

/* Locks the file as long as fd is open, for writing (LOCK_EX) or against writers (LOCK_SH). Returns 0 where another
 * process has the lock. On a file system without locks the function does nothing. */
static int has_locked(int fd, int kind)
{
    return flock(fd, kind | LOCK_NB) == 0 || errno != EWOULDBLOCK;
}

/* Does the name still belong to what was opened? Another writer may have renamed it before we had the lock. */
static int is_named(const char *name, int fd)
{
    struct stat open_st, named;
    return fstat(fd, &open_st) == 0 && lstat(name, &named) == 0 && open_st.st_dev == named.st_dev &&
           open_st.st_ino == named.st_ino;
}

/* Locks a file that is written in place. The file must still have its name, since bytes in a file without a name are
 * lost. */
static int lock_named(const char *path, int fd, int code, struct sh_err *err)
{
    if (!has_locked(fd, LOCK_EX)) return fail_locked(path, fd, code, err);
    return is_named(path, fd) ? SH_OK : sh_fail(err, code, "%s: another process has just written it anew", path);
}

/* A file that somebody writes in place must not be replaced: its writer would go on in a file without a
 * name. */
static int check_unlocked(const char *path, struct sh_err *err)
{
    const int fd = open(path, O_RDONLY | PLAIN);
    if (fd < 0) return SH_OK; /* there is no file, or it can't be opened to ask for its lock */
    const int rc = has_locked(fd, LOCK_SH) ? SH_OK : fail_locked(path, fd, SH_EINPUT, err);
    close(fd);
    return rc;
}

/* ---- files in place */

/* Hands an open file out, or closes it after an error. */
static int hand_out(int rc, int fd, int *out)
{
    if (rc != SH_OK)
        close(fd);
    else
        *out = fd;
    return rc;
}

/* Locks and empties a regular file. */
static int empty_it(const char *path, int fd, struct sh_err *err)
{
    struct stat st;
    if (fstat(fd, &st) != 0) return newfile_fail(path, "be opened for writing", err);
    if (!S_ISREG(st.st_mode)) return SH_OK;
    if (st.st_nlink > 1) return fail_hard_link(path, &st, err);
    const int rc = lock_named(path, fd, SH_EINPUT, err);
    return rc == SH_OK && ftruncate(fd, 0) != 0 ? newfile_fail(path, "be emptied", err) : rc;
}

int newfile_open(const char *path, int *out, struct sh_err *err)
{
    const int flags = O_WRONLY | O_CREAT | O_NONBLOCK | O_NOCTTY | O_CLOEXEC; /* opening a FIFO must not wait */
    int fd = open(path, flags | O_NOFOLLOW, 0666), is_shared = 0;
    if (fd < 0 && errno == ELOOP) {
        struct stat st;
        const int n = number_of(path);
        if (n < 0) return newfile_fail_link(path, err);
        /* A shell's `>FILE` is a regular file. A duplicate of its descriptor shares the offset with other writers. */
        is_shared = fstat(n, &st) == 0 && S_ISREG(st.st_mode);
        fd = is_shared ? fcntl(n, F_DUPFD_CLOEXEC, 0) : open(path, flags, 0666);
    }
    if (fd < 0 && errno == ENXIO)
        return sh_fail(err, SH_EINPUT,
                       "%s: is a FIFO without a reader, or a socket; allowed are a regular file, a device, and a FIFO "
                       "with a reader",
                       path);
    if (fd < 0) return newfile_fail(path, "be opened for writing", err);
    if (is_shared) return hand_out(SH_OK, fd, out);
    if (fcntl(fd, F_SETFL, 0) != 0) return hand_out(newfile_fail(path, "be opened for writing", err), fd, out);
    return hand_out(empty_it(path, fd, err), fd, out);
}

int newfile_append(const char *path, int *out, struct sh_err *err)
{
    struct stat st;
    int rc = check_target(path, err), fd;
    if (rc != SH_OK) return rc;
    fd = open(path, O_RDWR | O_CREAT | O_APPEND | PLAIN, 0666);
    if (fd < 0) return newfile_fail(path, "be opened for writing", err);
    if (fstat(fd, &st) != 0) rc = newfile_fail(path, "be opened for writing", err);
    if (rc == SH_OK && st.st_nlink > 1) rc = fail_hard_link(path, &st, err);
    if (rc == SH_OK) rc = lock_named(path, fd, SH_ESTATE, err);
    return hand_out(rc, fd, out);
}

/* ---- files that appear whole */

/* Checks a part that existed before: left by a killed writer, or put there by somebody. */
static int check_left(const char *part, int fd, struct sh_err *err)
{
    struct stat st;
    if (fstat(fd, &st) != 0) return newfile_fail(part, "create", err);
    if (!S_ISREG(st.st_mode))
        return sh_fail(err, SH_EINPUT, "%s: is a %s, but a file must be created here; remove it", part,
                       kind_of(st.st_mode));
    if (st.st_uid != geteuid())
        return sh_fail(err, SH_EINPUT, "%s: is a file of another user, but a file must be created here; remove it",
                       part);
    return st.st_nlink > 1 ? fail_hard_link(part, &st, err) : SH_OK;
}

/* 1: part is open. 0: it appeared or vanished between two calls, try again. Negative: it can't be opened. */
static int open_part(const char *part, int *fd, struct sh_err *err)
{
    *fd = open(part, O_RDWR | PLAIN | O_CREAT | O_EXCL, 0666);
    if (*fd >= 0) return 1;
    if (errno != EEXIST) return newfile_fail(part, "create", err);
    *fd = open(part, O_RDWR | PLAIN);
    if (*fd < 0 && errno == ENOENT) return 0;
    if (*fd < 0 && errno == ELOOP) return newfile_fail_link(part, err);
    if (*fd < 0) return newfile_fail(part, "create", err);
    int rc = check_left(part, *fd, err);
    if (rc != SH_OK) close(*fd);
    return rc == SH_OK ? 1 : rc;
}

/* Does the work of newfile_part once path is known to be replaceable. */
static int lock_part(const char *part, int *out, struct sh_err *err)
{
    for (int fd, i = 0; i < TRIES; i++) {
        const int opened = open_part(part, &fd, err);
        if (opened < 0) return opened;
        if (opened == 0) continue;
        if (!has_locked(fd, LOCK_EX)) return hand_out(fail_locked(part, fd, SH_EINPUT, err), fd, out);
        if (is_named(part, fd))
            return hand_out(ftruncate(fd, 0) == 0 ? SH_OK : newfile_fail(part, "create", err), fd, out);
        close(fd);
    }
    return sh_fail(err, SH_EIO, "%s: appears and disappears; another program writes it", part);
}

int newfile_part(const char *path, const char *part, int *out, struct sh_err *err)
{
    int rc = check_target(path, err);
    if (rc == SH_OK) rc = check_unlocked(path, err);
    return rc == SH_OK ? lock_part(part, out, err) : rc;
}

int newfile_left(const char *part, int *out, struct sh_err *err)
{
    int rc = check_target(part, err);
    if (rc != SH_OK) return rc;
    const int fd = open(part, O_RDWR | PLAIN);
    if (fd < 0) return newfile_fail(part, "be opened for reading and writing", err);
    rc = check_left(part, fd, err);
    if (rc == SH_OK && !has_locked(fd, LOCK_EX))
        rc = sh_fail(err, SH_ESTATE, "%s: is still being written by another process", part);
    if (rc == SH_OK && !is_named(part, fd))
        rc = sh_fail(err, SH_ESTATE, "%s: another process has just completed or removed it", part);
    return hand_out(rc, fd, out);
}

int newfile_whole(const char *path, int *out, struct sh_err *err)
{
    int rc = check_target(path, err);
    if (rc != SH_OK) return rc;
    int fd = open(path, O_RDWR | PLAIN);
    if (fd >= 0 && check_left(path, fd, NULL) == SH_OK && has_locked(fd, LOCK_EX)) return hand_out(SH_OK, fd, out);
    if (fd >= 0) close(fd);
    *out = open(path, O_RDONLY | PLAIN);
    return *out >= 0 ? SH_OK : newfile_fail(path, "be opened", err);
}

long long newfile_left_len(const char *part)
{
    struct stat st;
    long long len = 0;
    const int fd = open(part, O_RDONLY | PLAIN);
    if (fd < 0) return 0;
    if (fstat(fd, &st) == 0 && S_ISREG(st.st_mode) && has_locked(fd, LOCK_SH)) len = st.st_size;
    close(fd);
    return len;
}

/* Syncs the folder, so that the new name survives a power cut, too. Errors are ignored: some file systems
 * can't sync a directory. */
static void sync_folder(const char *path)
{
    char *copy = strdup(path);
    if (copy == NULL) return;
    int fd = open(dirname(copy), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd >= 0) {
        fsync(fd);
        close(fd);
    }
    free(copy);
}

static int fail_rename(const char *path, const char *part, struct sh_err *err)
{
    return sh_fail(err, code_of(errno), "%s: cannot be renamed to %s: %s", part, path, strerror(errno));
}

static int close_renamed(const char *path, int fd)
{
    close(fd); /* this also unlocks it: another writer may now use the name of part */
    sync_folder(path);
    return SH_OK;
}

int newfile_sync(const char *part, int fd, struct sh_err *err)
{
    return fsync(fd) == 0 ? SH_OK : newfile_fail(part, "be synced", err);
}

static int rename_checked(const char *path, const char *part, struct sh_err *err)
{
    int rc = check_target(path, err);
    if (rc == SH_OK) rc = check_unlocked(path, err);
    return rc == SH_OK && rename(part, path) != 0 ? fail_rename(path, part, err) : rc;
}

int newfile_rename(const char *path, const char *part, struct sh_err *err)
{
    const int rc = rename_checked(path, part, err);
    if (rc == SH_OK) sync_folder(path);
    return rc;
}

int newfile_settle(const char *path, const char *part, int fd, struct sh_err *err)
{
    int rc = newfile_sync(part, fd, err);
    if (rc == SH_OK) rc = rename_checked(path, part, err);
    return rc == SH_OK ? close_renamed(path, fd) : rc;
}

/* Some file systems can't rename without replacing. On such file systems link() gives the new name, since it never
 * replaces a file. */
static int rename_free(const char *path, const char *part)
{
    if (renameat2(AT_FDCWD, part, AT_FDCWD, path, RENAME_NOREPLACE) == 0) return 0;
    if (errno != EINVAL && errno != ENOSYS) return -1;
    if (link(part, path) == 0) return unlink(part);
    if (errno != EPERM && errno != EOPNOTSUPP) return -1;
    if (access(path, F_OK) != 0) return rename(part, path);
    errno = EEXIST;
    return -1;
}

int newfile_settle_free(const char *path, const char *part, int fd, struct sh_err *err)
{
    const int rc = newfile_sync(part, fd, err);
    if (rc != SH_OK) return rc;
    if (rename_free(path, part) == 0) return close_renamed(path, fd);
    return errno == EEXIST ? sh_fail(err, SH_ESTATE, "%s: exists, and is not replaced by %s", path, part)
                           : fail_rename(path, part, err);
}

int newfile_keep(const char *path, const char *part, int fd, struct sh_err *err)
{
    const int rc = newfile_settle(path, part, fd, err);
    if (rc != SH_OK) newfile_drop(part, fd);
    return rc;
}

void newfile_drop(const char *part, int fd)
{
    unlink(part); /* ours as long as it is locked */
    close(fd);
}

static int write_part(const char *path, int fd, newfile_put *put, const void *source, struct sh_err *err)
{
    struct sh_err why = {0};
    FILE *file = newfile_stream(fd, "wb");
    int rc = file != NULL ? SH_OK : sh_fail(&why, SH_EIO, "%s", strerror(errno));
    errno = 0;
    if (rc == SH_OK) rc = put(source, file, &why);
    const int has_failed = file != NULL && ferror(file); /* the last write may succeed where an earlier one failed */
    if (file != NULL && (fclose(file) != 0 || has_failed) && rc == SH_OK)
        rc = sh_fail(&why, SH_EIO, "%s", strerror(errno != 0 ? errno : EIO));
    return rc == SH_OK ? SH_OK : sh_fail(err, rc, "%s: cannot be written: %.300s", path, why.text);
}

int newfile_write(const char *path, newfile_put *put, const void *source, struct sh_err *err)
{
    char *part;
    int fd;
    if (asprintf(&part, "%s.part", path) < 0) return sh_fail(err, SH_ENOMEM, "%s: no memory", path);
    int rc = newfile_part(path, part, &fd, err);
    const int is_open = rc == SH_OK;
    if (rc == SH_OK && put != NULL) rc = write_part(path, fd, put, source, err);
    if (rc == SH_OK && put != NULL)
        rc = newfile_keep(path, part, fd, err);
    else if (is_open)
        newfile_drop(part, fd);
    free(part);
    return rc;
}

/* The new file is locked before it gets the name, so there is no moment in which another process could have it. */
int newfile_replace(const char *path, int *locked, newfile_put *put, const void *source, struct sh_err *err)
{
    char *part;
    int fd = -1;
    if (asprintf(&part, "%s.part", path) < 0) return sh_fail(err, SH_ENOMEM, "%s: no memory", path);
    int rc = check_target(path, err);
    if (rc == SH_OK) rc = lock_part(part, &fd, err);
    if (rc == SH_OK) rc = write_part(path, fd, put, source, err);
    if (rc == SH_OK) rc = newfile_sync(part, fd, err);
    if (rc == SH_OK && !is_named(path, *locked))
        rc = sh_fail(err, SH_ESTATE, "%s: was removed or replaced by somebody else; it is not written any more", path);
    if (rc == SH_OK && rename(part, path) != 0) rc = fail_rename(path, part, err);
    if (rc == SH_OK) {
        close_renamed(path, *locked);
        *locked = fd;
    } else if (fd >= 0) {
        newfile_drop(part, fd);
    }
    free(part);
    return rc;
}

int newfile_check(const char *path, struct sh_err *err)
{
    return newfile_write(path, NULL, NULL, err);
}
