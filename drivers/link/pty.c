/* SPDX-License-Identifier: MIT */
/* The pty link: one session, a virtual serial port that clients open and close as they like.
 *
 * When does a session begin and end? The kernel offers two signals, each with a weakness:
 *   hang-up   poll(2) on the master reports POLLHUP exactly while nobody has the slave open. The hang-up is a level: a
 *             close followed by an open before we look leaves no trace. And POLLHUP makes every poll return at
 *             once. So a master that hangs up must stay out of the descriptors that we wait for, and can't
 *             report that somebody comes.
 *   inotify   reports each open and close of the slave, in order. But it merges equal events in a row as long
 *             as we have not read them, so opens and closes can't be counted when clients overlap.
 * So inotify wakes us, and the hang-up decides:
 *   - We keep no descriptor on the slave: it would hide the hang-up. Settings and data survive without one,
 *     because the slave lives as long as the master. pty_device_rest opens the slave for a moment, while we do not
 *     watch it.
 *   - No session: we wait for inotify only. An open event starts a session, even if the hang-up says that the
 *     client has left already: its bytes are still to be read (echo '*RST' > /dev/pts/3).
 *   - Session: we wait for the master as well. The session ends when the master hangs up and all that was
 *     written is read. A client that opens the slave just then is not missed: the kernel queues an open event
 *     after the open took effect. So when the watch is set up again, either the master no longer hangs up, or
 *     the event is still unread.
 *   - Session, and inotify reports that the last client went and another came before we looked: the hang-up
 *     never showed. Clients that come one after the other give open, close, open, ... without equal
 *     neighbours: nothing is merged, the count is exact, and we report LINK_CLOSED and LINK_OPENED. Only
 *     clients that overlap can make the count wrong. Then two sessions may be reported as one, or one as two;
 *     the next hang-up sets it right.
 *   - Nothing is written while an open event is unread: the new client would get bytes of the old session. */
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/inotify.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "drivers/link/link_poll.h"
#include "drivers/link/pty_device.h"
#include "drivers/link/pty_line.h"

struct pty_link {
    pthread_mutex_t naming; /* for a new device: pty_endpoint is called from other threads */
    struct pty_device device;
    struct pty_line line;
    int unplugged; /* there is no pair, and no symlink */
    int inotify, watch;
    int deaf;                   /* errno: no new client can be seen, and the next poll fails; else 0 */
    int open;                   /* a session is on, as the caller knows or is about to learn */
    unsigned count;             /* clients of the session; 0 with open set: the last seems to be gone */
    int open_event_due;         /* a client is counted whose open event may be still to come */
    int due_closed, due_opened; /* events that the caller still has to get, in this order */
};

static void pty_endpoint(const void *link, char *buf, size_t len)
{
    const struct pty_link *pty = link;
    pthread_mutex_t *naming = (pthread_mutex_t *)&pty->naming;
    pthread_mutex_lock(naming);
    snprintf(buf, len, "tty:%s", pty->device.path[0] != '\0' ? pty->device.path : pty->device.slave);
    pthread_mutex_unlock(naming);
}

static void pty_set_device(struct pty_link *pty, const struct pty_device *fresh)
{
    pthread_mutex_lock(&pty->naming);
    pty->device = *fresh;
    pthread_mutex_unlock(&pty->naming);
}

static void pty_begin(struct pty_link *pty, unsigned count)
{
    pty->open = 1;
    pty->count = count;
    pty->line.n_out = 0;
    pty->due_opened = 1;
    pty->open_event_due = 0;
}

static void pty_note(struct pty_link *pty, uint32_t mask)
{
    const int counted = pty->open_event_due;
    pty->open_event_due = 0;
    if ((mask & IN_CLOSE) != 0 && pty->count > 0) pty->count--;
    if ((mask & (IN_OPEN | IN_Q_OVERFLOW)) == 0 || counted) return; /* an overflow may have hidden an open event */
    if (!pty->open) {
        pty_begin(pty, 1);
    } else if (pty->count > 0) {
        pty->count++;
    } else {
        /* A session that the caller has not heard of gets no LINK_CLOSED: its client is gone. */
        if (!pty->due_opened) pty->due_closed = 1;
        pty_device_drop_output(&pty->device);
        pty_begin(pty, 1);
    }
}

/* Reads all that inotify has; with note = 0 throws it away. */
static void pty_read_inotify(struct pty_link *pty, int note)
{
    _Alignas(struct inotify_event) char buf[4096];
    ssize_t n;
    while ((n = read(pty->inotify, buf, sizeof buf)) > 0) {
        for (ssize_t at = 0; at < n;) {
            const struct inotify_event *event = (const void *)(buf + at);
            if (note && (event->wd == pty->watch || event->wd == -1)) pty_note(pty, event->mask);
            at += (ssize_t)(sizeof *event + event->len);
        }
    }
}

static short pty_now(const struct pty_link *pty)
{
    struct pollfd slot = {.fd = pty->device.master, .events = POLLIN};
    return poll(&slot, 1, 0) >= 0 ? slot.revents : (short)0;
}

/* Sets up the watch. A client that came before it is found by the master's state. */
static int pty_wait_for_client(struct pty_link *pty)
{
    pty->watch = inotify_add_watch(pty->inotify, pty->device.slave, IN_OPEN | IN_CLOSE);
    if (pty->watch < 0) return SH_EIO;
    pty_read_inotify(pty, 0); /* before we look: a client that comes and goes afterwards is noted */
    short now = pty_now(pty);
    if ((now & POLLHUP) == 0) {
        pty_begin(pty, 1);
        pty->open_event_due = 1;
    } else if ((now & POLLIN) != 0) {
        pty_begin(pty, 0); /* it has written and left: the next open event is another client's */
    }
    return SH_OK;
}

static int pty_open(const struct link_spec *spec, void **link, struct sh_err *err)
{
    struct pty_link *pty = calloc(1, sizeof *pty);
    if (pty == NULL) return sh_fail(err, SH_ENOMEM, "link pty:%s: no memory", spec->path);
    pty->inotify = inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
    if (pty->inotify < 0) {
        int error = errno;
        free(pty);
        return sh_fail(err, SH_EIO, "link pty:%s: inotify: %s%s", spec->path, strerror(error),
                       error == EMFILE ? "; see /proc/sys/fs/inotify/max_user_instances" : "");
    }
    int rc = pty_device_open(&pty->device, spec->path, err);
    if (rc == SH_OK && pty_wait_for_client(pty) != SH_OK) { /* a client may open it once the symlink is there */
        rc = sh_fail(err, SH_EIO, "link pty:%s: inotify on %s: %s", spec->path, pty->device.slave, strerror(errno));
        pty_device_close(&pty->device);
    }
    if (rc != SH_OK) {
        close(pty->inotify);
        free(pty);
        return rc;
    }
    pthread_mutex_init(&pty->naming, NULL);
    pty->line.baud = (uint32_t)spec->baud;
    *link = pty;
    return SH_OK;
}

/* Ends the session and stops watching the terminal. */
static void pty_let_go(struct pty_link *pty)
{
    pty->due_closed = pty->due_closed || (pty->open && !pty->due_opened);
    pty->open = pty->due_opened = 0;
    pty->open_event_due = 0; /* else the next client would be taken for one that is counted */
    pty->line.n_out = 0;
    inotify_rm_watch(pty->inotify, pty->watch);
    pty_read_inotify(pty, 0);
}

/* All clients are gone and what they wrote is read. pty_wait_for_client finds clients that come meanwhile. */
static int pty_end(struct pty_link *pty)
{
    pty_let_go(pty);
    struct pty_device device = pty->device;
    int rc = pty_device_rest(&device);
    pty_set_device(pty, &device);
    return rc == SH_OK ? pty_wait_for_client(pty) : rc;
}

/* Returns 1 when nothing is left to report. */
static int pty_report(struct pty_link *pty, struct link_events *events)
{
    const char *name = pty->device.slave;
    if (pty->due_closed) pty->due_closed = !link_events_push(events, LINK_CLOSED, 0, name);
    if (!pty->due_closed && pty->due_opened) pty->due_opened = !link_events_push(events, LINK_OPENED, 0, name);
    return !pty->due_closed && !pty->due_opened;
}

static int pty_ended(const struct pty_link *pty, short revents)
{
    if ((revents & POLLHUP) == 0 || (revents & POLLIN) != 0) return 0;
    /* The bytes and the hang-up are not looked at in one step. So, now that nobody is there, look again for
     * bytes. */
    revents = pty_now(pty);
    return (revents & POLLHUP) != 0 && (revents & POLLIN) == 0;
}

static int pty_poll(void *link, int wake_fd, uint32_t want_write, int timeout_ms, struct link_event *event, int max)
{
    struct pty_link *pty = link;
    struct link_events events = {event, 0, max};
    int reported = pty_report(pty, &events);
    struct pollfd fds[3] = {{.fd = wake_fd, .events = POLLIN},
                            {.fd = pty->inotify, .events = POLLIN},
                            {.fd = pty->open ? pty->device.master : -1, .events = POLLIN}};
    if ((want_write & 1u) != 0 || pty->line.n_out != 0) fds[2].events |= POLLOUT;
    if (pty->deaf != 0) errno = pty->deaf;
    if (pty->deaf != 0 || link_wait(fds, 3, events.n > 0 || !reported ? 0 : timeout_ms) != SH_OK) return SH_EIO;
    link_take_wake(&fds[0], &events);
    if ((fds[1].revents & POLLIN) != 0) pty_read_inotify(pty, 1);
    if (!pty_report(pty, &events) || !pty->open || fds[2].fd < 0) return events.n;
    if (pty_ended(pty, fds[2].revents)) {
        int rc = pty_end(pty);
        pty_report(pty, &events);
        return rc != SH_OK ? rc : events.n;
    }
    if ((fds[2].revents & POLLIN) != 0) link_events_push(&events, LINK_READABLE, 0, NULL);
    if ((fds[2].revents & POLLOUT) != 0 && pty_line_flush(&pty->line, pty->device.master) && (want_write & 1u) != 0)
        link_events_push(&events, LINK_WRITABLE, 0, NULL);
    return events.n;
}

static ssize_t pty_read(void *link, int session, void *buf, size_t len)
{
    struct pty_link *pty = link;
    if (session != 0 || !pty->open) return SH_ECLOSED;
    /* A client that has come meanwhile begins a session of its own, and its bytes are read there. In the old session
     * the answers to them would be dropped at its end. */
    pty_read_inotify(pty, 1);
    if (pty->due_closed || pty->due_opened) return 0;
    ssize_t n = pty_line_read(&pty->line, pty->device.master, buf, len);
    if (n >= 0) return n;
    return errno == EAGAIN || errno == EINTR ? 0 : SH_ECLOSED; /* EIO: hung up, and all is read */
}

static ssize_t pty_write(void *link, int session, const void *buf, size_t len)
{
    struct pty_link *pty = link;
    if (session != 0 || !pty->open) return SH_ECLOSED;
    pty_read_inotify(pty, 1);
    if (pty->due_closed || pty->due_opened) return 0;
    ssize_t n = pty_line_write(&pty->line, pty->device.master, buf, len);
    if (n >= 0) return n;
    return errno == EAGAIN || errno == EINTR ? 0 : SH_ECLOSED;
}

/* When the master is closed the kernel throws away what waits in the terminal. The kernel tells only through the slave
 * how much waits, so we open the slave. We do so only at the end, when no new client is expected, since the watch would
 * see our own opening. A slave that a client holds exclusively (TIOCEXCL) can't be opened. */
static int pty_unread(void *link, int session)
{
    struct pty_link *pty = link;
    int n = 0;
    if (session != 0 || !pty->open || (pty_now(pty) & POLLHUP) != 0) return 0;
    if (pty->watch >= 0) inotify_rm_watch(pty->inotify, pty->watch);
    pty->watch = -1;
    const int fd = open(pty->device.slave, O_RDONLY | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) return 0;
    if (ioctl(fd, FIONREAD, &n) != 0) n = 0;
    close(fd);
    return n + (int)pty->line.n_out;
}

/* ---- injected faults */

static int pty_cut(struct pty_link *pty)
{
    struct pty_device device = pty->device;
    if (!pty->open || pty_device_renew(&device) != SH_OK) return SH_ESTATE; /* the session goes on */
    pty_let_go(pty);
    pty_set_device(pty, &device);
    pty->deaf = pty_wait_for_client(pty) != SH_OK ? errno : 0;
    return pty->deaf != 0 ? SH_ESTATE : SH_OK;
}

static int pty_unplug(struct pty_link *pty)
{
    if (pty->unplugged) return SH_ESTATE;
    pty_let_go(pty);
    pty_device_close(&pty->device);
    pty->unplugged = 1;
    return SH_OK;
}

static int pty_plug(struct pty_link *pty)
{
    struct pty_device fresh;
    struct sh_err err;
    if (!pty->unplugged) return SH_OK;
    if (pty_device_open(&fresh, pty->device.path, &err) != SH_OK) return SH_ESTATE;
    pty_set_device(pty, &fresh);
    pty->unplugged = 0;
    if (pty_wait_for_client(pty) == SH_OK) return SH_OK;
    pty_unplug(pty); /* else the next call would take it for plugged in, and no client would be seen */
    return SH_ESTATE;
}

static int pty_fault(void *link, enum link_fault what, int session, uint32_t n, double for_ms)
{
    (void)n, (void)for_ms;
    switch (what) {
    case LINK_FAULT_DISCONNECT:
    case LINK_FAULT_REFUSE:
        return session == 0 ? pty_cut(link) : SH_ESTATE;
    case LINK_FAULT_UNPLUG:
        return pty_unplug(link);
    case LINK_FAULT_PLUG:
        return pty_plug(link);
    default:
        return SH_ESTATE;
    }
}

static void pty_close(void *link)
{
    struct pty_link *pty = link;
    close(pty->inotify);
    if (!pty->unplugged) pty_device_close(&pty->device);
    pthread_mutex_destroy(&pty->naming);
    free(pty->line.out);
    free(pty);
}

const struct link_ops link_pty = {
    .name = "pty",
    .faults =
        LINK_FAULT_BIT(LINK_FAULT_DISCONNECT) | LINK_FAULT_BIT(LINK_FAULT_REFUSE) | LINK_FAULT_BIT(LINK_FAULT_UNPLUG),
    .open = pty_open,
    .endpoint = pty_endpoint,
    .poll = pty_poll,
    .read = pty_read,
    .write = pty_write,
    .unread = pty_unread,
    .fault = pty_fault,
    .close = pty_close,
};
