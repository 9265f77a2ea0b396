/* SPDX-License-Identifier: MIT */
/* The file link: one session, whose bytes go into a file unchanged.
 *
 * Regular files and character devices (/dev/null, /dev/full) are taken; a directory, a FIFO, a socket or a block device
 * is refused. A FIFO needs a reader that is there already; a pty or TCP link doesn't. The first failed write (disk
 * full) ends the session; its LINK_CLOSED has the reason in `peer`. */
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/newfile.h"
#include "drivers/link/link_poll.h"

struct file_link {
    struct link_base base; /* its name is the path after "file:" */
    int fd;
    int reported_closed;
    int failed; /* errno of the write that failed, 0: none */
};

static int file_open(const struct link_spec *spec, void **link, struct sh_err *err)
{
    struct sh_err why = {0};
    struct stat st;
    int fd;
    if (spec->path[0] == '\0') return sh_fail(err, SH_EINPUT, "link file: a path is needed");
    int rc = newfile_open(spec->path, &fd, &why);
    if (rc != SH_OK) return sh_fail(err, rc, "link file:%s", why.text);
    struct file_link *file = link_new(sizeof *file, err, "file:%s", spec->path);
    if (file == NULL)
        rc = SH_ENOMEM;
    else if (fstat(fd, &st) != 0 || fcntl(fd, F_SETFL, O_APPEND | (S_ISCHR(st.st_mode) ? O_NONBLOCK : 0)) != 0)
        rc = sh_fail(err, SH_EIO, "link file:%s: %s", spec->path, strerror(errno));
    else if (!S_ISREG(st.st_mode) && !S_ISCHR(st.st_mode))
        rc = sh_fail(err, SH_EINPUT,
                     "link file:%s: neither a regular file nor a character device; use a pty or tcp link", spec->path);
    if (rc != SH_OK) {
        close(fd);
        free(file);
        return rc;
    }
    file->fd = fd;
    *link = file;
    return SH_OK;
}

static int file_poll(void *link, int wake_fd, uint32_t want_write, int timeout_ms, struct link_event *event, int max)
{
    struct file_link *file = link;
    struct link_events events = {event, 0, max};
    const char *const path = file->base.name + sizeof "file:" - 1;
    if (!file->base.reported_opened) file->base.reported_opened = link_events_push(&events, LINK_OPENED, 0, path);
    if (file->failed != 0 && !file->reported_closed)
        file->reported_closed = link_events_push(&events, LINK_CLOSED, 0, strerror(file->failed));
    /* A device may be full, such as a serial port with flow control; a regular file never is. */
    struct pollfd fds[2] = {{.fd = wake_fd, .events = POLLIN}, {.fd = -1, .events = POLLOUT}};
    if ((want_write & 1u) != 0 && file->failed == 0) fds[1].fd = file->fd;
    const int rc = link_wait(fds, 2, events.n > 0 ? 0 : timeout_ms);
    if (rc != SH_OK) return rc;
    link_take_wake(&fds[0], &events);
    if (fds[1].revents != 0) link_events_push(&events, LINK_WRITABLE, 0, NULL);
    return events.n;
}

static ssize_t file_read(void *link, int session, void *buf, size_t len)
{
    const struct file_link *file = link;
    (void)buf;
    (void)len;
    return session == 0 && file->failed == 0 ? 0 : SH_ECLOSED;
}

static ssize_t file_write(void *link, int session, const void *buf, size_t len)
{
    struct file_link *file = link;
    if (session != 0 || file->failed != 0) return SH_ECLOSED;
    ssize_t n = write(file->fd, buf, len);
    if (n >= 0) return n;
    if (errno == EINTR || errno == EAGAIN) return 0;
    file->failed = errno;
    return SH_EIO;
}

static void file_close(void *link)
{
    struct file_link *file = link;
    close(file->fd);
    free(file);
}

const struct link_ops link_file = {
    .name = "file",
    .stalls = 1,
    .open = file_open,
    .endpoint = link_base_endpoint,
    .poll = file_poll,
    .read = file_read,
    .write = file_write,
    .close = file_close,
};
