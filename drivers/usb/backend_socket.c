/* SPDX-License-Identifier: MIT */
/* The sockets over which the back ends usbip and usbredir reach a host. */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "drivers/socket/socket.h"
#include "drivers/usb/backend.h"

int usb_backend_connect(const struct socket_address *to, int *fd)
{
    *fd = socket(to->at.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (*fd < 0) return errno;
    if (connect(*fd, (const struct sockaddr *)&to->at, to->len) == 0) return 0;
    const int error = errno;
    if (error == EINPROGRESS) return error;
    close(*fd);
    *fd = -1;
    return error;
}

int usb_backend_connect_error(int fd)
{
    int error = 0;
    socklen_t len = sizeof error;
    if (getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &len) != 0) return errno;
    return error == 0 && socket_is_own_end(fd) ? ECONNREFUSED : error;
}

static int unix_address(const char *path, struct socket_address *out)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    if (strlen(path) >= sizeof at.sun_path) return 0;
    strcpy(at.sun_path, path);
    memcpy(&out->at, &at, sizeof at);
    out->len = sizeof at;
    return 1;
}

void usb_backend_peer(const struct usb_backend_spec *spec, int fd, struct socket_address *out)
{
    if (spec->path[0] != '\0') {
        unix_address(spec->path, out); /* it has fitted before */
        return;
    }
    out->len = sizeof out->at;
    if (getpeername(fd, (struct sockaddr *)&out->at, &out->len) != 0) out->len = 0;
}

/* Whether nobody answers on the socket at that path, since its owner ended without removing it. A socket whose queue is
 * full has an owner; is_left_behind does not wait for that owner. */
static int is_left_behind(const char *path, const struct socket_address *at)
{
    struct stat st;
    int fd;
    if (lstat(path, &st) != 0 || !S_ISSOCK(st.st_mode)) return 0;
    const int error = usb_backend_connect(at, &fd);
    if (fd >= 0) close(fd);
    return error == ECONNREFUSED;
}

static int unix_socket(const struct usb_backend_spec *spec, const char *what, int *fd, struct sh_err *err)
{
    struct socket_address at;
    if (!unix_address(spec->path, &at))
        return sh_fail(err, SH_EINPUT, "%s:%s: the path is too long for a socket; allowed %zu bytes", what, spec->path,
                       sizeof((struct sockaddr_un *)0)->sun_path - 1);
    if (!spec->attach && is_left_behind(spec->path, &at)) unlink(spec->path);
    *fd = socket_open_at((struct sockaddr *)&at.at, at.len, spec->attach);
    if (*fd >= 0) return SH_OK;
    return sh_fail(err, socket_error_code(errno), "%s:%s: cannot %s: %s%s", what, spec->path,
                   spec->attach ? "connect" : "listen", strerror(errno),
                   errno == EADDRINUSE ? "; it is in use, or not a socket: choose another path" : "");
}

int usb_backend_socket(const struct usb_backend_spec *spec, const char *what, int *fd, char *name, size_t len,
                       struct sh_err *err)
{
    if (spec->path[0] != '\0') {
        snprintf(name, len, "%s", spec->path);
        return unix_socket(spec, what, fd, err);
    }
    const struct socket_place place = {what, spec->address, spec->port, spec->attach};
    return socket_open(&place, fd, name, len, err);
}

int usb_backend_accept(int listener, int *reserve, const struct usb_owner *owner)
{
    enum { AT_ONCE = 16 }; /* clients that one call turns away; more of them wait for the next call */
    struct sockaddr_storage from;
    socklen_t len = sizeof from;
    char client[64];
    int fd = -1;
    for (int i = 0; i < AT_ONCE && socket_accept(listener, reserve, &fd, &from, &len) && fd < 0; i++) {
        socket_address_text((const struct sockaddr *)&from, len, client, sizeof client);
        owner->refuse(owner->ctx, client);
        len = sizeof from;
    }
    return fd;
}

void usb_backend_hang_up(int fd, int timeout_ms)
{
    enum { READS = 8 }; /* the most reads: a peer may go on sending for ever */
    char waste[65536];
    struct pollfd slot = {.fd = fd, .events = POLLIN};
    if (shutdown(fd, SHUT_WR) != 0) return;
    for (int i = 0; i < READS; i++)
        if (poll(&slot, 1, timeout_ms) <= 0 || recv(fd, waste, sizeof waste, MSG_DONTWAIT) <= 0) return;
}
