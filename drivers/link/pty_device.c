/* SPDX-License-Identifier: MIT */
#include "drivers/link/pty_device.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

static int pair_open(int *master, char *slave, size_t slave_len)
{
    *master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (*master < 0) return -1;
    if (grantpt(*master) == 0 && unlockpt(*master) == 0 && ptsname_r(*master, slave, slave_len) == 0) return 0;
    int error = errno;
    close(*master);
    errno = error;
    return -1;
}

/* The master's ioctls for settings act on the slave. TCOFLUSH drops what is still on its way to the slave's line
 * discipline. Then TCSAFLUSH drops what the line discipline holds. Unlike tcflush on the slave these ioctls need no
 * open slave. The settings are read just before they are written, as the next client may set its own at any moment. */
static int drop_output(int master, int makes_raw)
{
    struct termios settings;
    tcflush(master, TCOFLUSH);
    if (tcgetattr(master, &settings) != 0) return -1;
    if (makes_raw) cfmakeraw(&settings);
    tcsetattr(master, TCSAFLUSH, &settings);
    return 0;
}

void pty_device_drop_output(struct pty_device *device)
{
    drop_output(device->master, 0);
}

/* Brings the slave to rest (pty_device.h). This opens and closes the slave once, so that the master reports the hang-up
 * from then on. Where no descriptor or memory is left, the slave stays closed, and only its settings are brought to
 * rest. */
static int slave_rest(struct pty_device *device)
{
    int fd = open(device->slave, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) {
        const int error = errno;
        const int rc = drop_output(device->master, 1);
        return error == EMFILE || error == ENFILE || error == ENOMEM ? rc : -1;
    }
    ioctl(fd, TIOCNXCL);
    tcflow(fd, TCOON);
    const int rc = drop_output(device->master, 1);
    close(fd);
    return rc;
}

static int symlink_refuse(const char *path, const char *why, struct sh_err *err)
{
    return sh_fail(err, SH_EINPUT, "link pty:%s: exists and %s; remove it or choose another path", path, why);
}

static int symlink_errno(const char *path, struct sh_err *err)
{
    int code = errno == EACCES || errno == EPERM || errno == EROFS                              ? SH_EPERM
               : errno == ENOENT || errno == ENOTDIR || errno == ELOOP || errno == ENAMETOOLONG ? SH_EINPUT
                                                                                                : SH_EIO;
    return sh_fail(err, code, "link pty:%s: the symlink cannot be made: %s", path, strerror(errno));
}

/* Whether the symlink is left from a head that was killed, while its terminal's number went to another program.
 * Such a symlink names a slave, and is older than the terminal, as a head makes the terminal first. */
static int is_left_over(const char *text, const struct stat *link, const struct stat *terminal)
{
    const struct timespec made = link->st_mtim, born = terminal->st_ctim;
    if (link->st_uid != geteuid() || strncmp(text, "/dev/pts/", 9) != 0 || !S_ISCHR(terminal->st_mode)) return 0;
    return made.tv_sec < born.tv_sec || (made.tv_sec == born.tv_sec && made.tv_nsec < born.tv_nsec);
}

/* Returns 1: there is nothing at path; 0: a symlink that may be replaced; or an error. */
static int symlink_look(const char *path, const char *slave, struct sh_err *err)
{
    struct stat self, target;
    char text[256];
    if (lstat(path, &self) != 0) return errno == ENOENT ? 1 : symlink_errno(path, err);
    if (!S_ISLNK(self.st_mode)) return symlink_refuse(path, "is not a symlink", err);
    ssize_t n = readlink(path, text, sizeof text - 1);
    if (n < 0) return symlink_errno(path, err);
    text[n] = '\0';
    if (strcmp(text, slave) == 0 || stat(path, &target) != 0 || is_left_over(text, &self, &target)) return 0;
    const int is_slave = S_ISCHR(target.st_mode) && strncmp(text, "/dev/pts/", 9) == 0;
    return symlink_refuse(path,
                          is_slave ? "leads to a terminal in use by another program"
                                   : "leads to something that is not a terminal of this program",
                          err);
}

/* Replaces what is at path by the new symlink: 0, or -1 with errno. */
static int symlink_replace(const char *path, const char *slave)
{
    char temporary[300];
    snprintf(temporary, sizeof temporary, "%s.%ld.tmp", path, (long)getpid());
    if (symlink(slave, temporary) != 0) return -1;
    if (rename(temporary, path) == 0) return 0;
    int error = errno;
    unlink(temporary);
    errno = error;
    return -1;
}

/* symlink and symlink_replace are both atomic: a client finds the old target, ours, or nothing. */
static int symlink_make(const char *path, const char *slave, struct sh_err *err)
{
    int rc = symlink_look(path, slave, err);
    if (rc < 0) return rc;
    rc = rc == 1 ? symlink(slave, path) : symlink_replace(path, slave);
    return rc == 0 ? SH_OK : symlink_errno(path, err);
}

static int symlink_is_ours(const struct pty_device *device)
{
    char text[sizeof device->slave + 1];
    ssize_t n = readlink(device->path, text, sizeof text - 1);
    if (n < 0) return 0;
    text[n] = '\0';
    return strcmp(text, device->slave) == 0;
}

int pty_device_open(struct pty_device *device, const char *path, struct sh_err *err)
{
    const char *name = path[0] != '\0' ? path : "(no symlink)";
    if (pair_open(&device->master, device->slave, sizeof device->slave) != 0)
        return sh_fail(err, SH_EIO, "link pty:%s: no pseudo terminal: %s", name, strerror(errno));
    int rc = SH_OK;
    if (slave_rest(device) != 0)
        rc = sh_fail(err, SH_EIO, "link pty:%s: %s cannot be set up: %s", name, device->slave, strerror(errno));
    else if (path[0] != '\0')
        rc = symlink_make(path, device->slave, err);
    if (rc != SH_OK) {
        close(device->master);
        return rc;
    }
    snprintf(device->path, sizeof device->path, "%s", path);
    return SH_OK;
}

int pty_device_renew(struct pty_device *device)
{
    struct pty_device fresh = *device;
    if (pair_open(&fresh.master, fresh.slave, sizeof fresh.slave) != 0) return SH_EIO;
    int ours = device->path[0] != '\0' && symlink_is_ours(device);
    /* The old slave exists until its master is closed, so symlink_look would refuse the path. */
    if (slave_rest(&fresh) != 0 || (ours && symlink_replace(fresh.path, fresh.slave) != 0)) {
        close(fresh.master);
        return SH_EIO;
    }
    close(device->master);
    *device = fresh;
    return SH_OK;
}

int pty_device_rest(struct pty_device *device)
{
    return slave_rest(device) == 0 ? SH_OK : pty_device_renew(device);
}

void pty_device_close(struct pty_device *device)
{
    if (device->path[0] != '\0' && symlink_is_ours(device)) unlink(device->path);
    close(device->master);
}
