/* SPDX-License-Identifier: MIT */
/* The terminal of the pty link: the pair, its resting state and the symlink to its slave. Private to the
 * link. */
#ifndef DRIVERS_LINK_PTY_DEVICE_H
#define DRIVERS_LINK_PTY_DEVICE_H

#include <termios.h>

#include "core/err.h"

struct pty_device {
    int master;     /* not blocking */
    char slave[64]; /* "/dev/pts/3" */
    char path[256]; /* the symlink to the slave; empty: none */
};

/* Makes the pair, at rest, and the symlink (path may be empty). An existing path is replaced only where it is a symlink
 * that dangles, names our own slave, or was left by a head that was killed. A symlink was left so if it is our user's,
 * and older than the terminal that it names. Any other path that exists is SH_EINPUT. */
int pty_device_open(struct pty_device *device, const char *path, struct sh_err *err);

/* Brings the slave back to how a fresh client expects it: raw, nothing to read, no exclusive use, not
 * stopped. To be called while no client has it open. Opens and closes the slave, which inotify sees. A slave
 * that refuses us (a client left TIOCEXCL set, which only root may undo) is replaced by a new pair under
 * the same symlink; slave is then another name. SH_EIO when that fails as well. Without a free descriptor the slave is
 * not opened: it becomes raw and empty, but keeps exclusive use, and stays stopped. */
int pty_device_rest(struct pty_device *device);

/* Hangs up all clients, and drops what they have not read: a new pair at rest takes the old one's place under the same
 * symlink, and slave is another name. SH_EIO: no new pair can be had, and the old one stays. */
int pty_device_renew(struct pty_device *device);

/* Drops what was sent and not read. Settings stay, since a client may have the slave open. */
void pty_device_drop_output(struct pty_device *device);

/* Closes the pair and removes the symlink, if it still is ours. */
void pty_device_close(struct pty_device *device);

#endif
