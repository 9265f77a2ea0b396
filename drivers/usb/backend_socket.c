/* Sockets of the back ends that talk over one. */
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "drivers/usb/backend.h"

enum { BACKLOG = 16 };

static int error_code(int error)
{
    return error == EACCES || error == EPERM                                                           ? SH_EPERM
           : error == EADDRINUSE || error == EADDRNOTAVAIL || error == ENOENT || error == ECONNREFUSED ? SH_EINPUT
                                                                                                       : SH_EIO;
}

static int start(int fd, const struct sockaddr *at, socklen_t len, int connecting)
{
    const int one = 1;
    if (connecting) return connect(fd, at, len);
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    return bind(fd, at, len) == 0 ? listen(fd, BACKLOG) : -1;
}

/* Connects while blocking, since the other end is on this machine or near; not blocking from then on. */
static int open_socket(const struct sockaddr *at, socklen_t len, int connecting)
{
    int fd = socket(at->sa_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0) return -1;
    if (start(fd, at, len, connecting) == 0 && fcntl(fd, F_SETFL, O_NONBLOCK) == 0) return fd;
    int error = errno;
    close(fd);
    errno = error;
    return -1;
}

int usb_backend_connect(const struct usb_backend_address *to, int *fd)
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

/* Where nobody listens on a port of this machine, TCP may connect a socket to itself, from that very port. */
static int is_own(int fd)
{
    struct sockaddr_storage here = {0}, there = {0};
    socklen_t len = sizeof here;
    if (getsockname(fd, (struct sockaddr *)&here, &len) != 0 || here.ss_family == AF_UNIX) return 0;
    len = sizeof there;
    return getpeername(fd, (struct sockaddr *)&there, &len) == 0 && memcmp(&here, &there, sizeof here) == 0;
}

int usb_backend_connect_error(int fd)
{
    int error = 0;
    socklen_t len = sizeof error;
    if (getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &len) != 0) return errno;
    return error == 0 && is_own(fd) ? ECONNREFUSED : error;
}

static int unix_address(const char *path, struct usb_backend_address *out)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    if (strlen(path) >= sizeof at.sun_path) return 0;
    strcpy(at.sun_path, path);
    memcpy(&out->at, &at, sizeof at);
    out->len = sizeof at;
    return 1;
}

void usb_backend_peer(const struct usb_backend_spec *spec, int fd, struct usb_backend_address *out)
{
    if (spec->path[0] != '\0') {
        unix_address(spec->path, out); /* it has fitted before */
        return;
    }
    out->len = sizeof out->at;
    if (getpeername(fd, (struct sockaddr *)&out->at, &out->len) != 0) out->len = 0;
}

/* Nobody answers on it: its owner is gone without removing it. One whose queue is full lives; that is not waited for.
 */
static int is_left_behind(const char *path, const struct usb_backend_address *at)
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
    struct usb_backend_address at;
    if (!unix_address(spec->path, &at))
        return sh_fail(err, SH_EINPUT, "%s:%s: the path is too long for a socket; allowed %zu bytes", what, spec->path,
                       sizeof((struct sockaddr_un *)0)->sun_path - 1);
    if (!spec->attach && is_left_behind(spec->path, &at)) unlink(spec->path);
    *fd = open_socket((struct sockaddr *)&at.at, at.len, spec->attach);
    if (*fd >= 0) return SH_OK;
    return sh_fail(err, error_code(errno), "%s:%s: cannot %s: %s%s", what, spec->path,
                   spec->attach ? "connect" : "listen", strerror(errno),
                   errno == EADDRINUSE ? "; it is in use, or not a socket: choose another path" : "");
}

static void name_socket(int fd, int connecting, char *name, size_t len)
{
    struct sockaddr_storage at;
    socklen_t at_len = sizeof at;
    char host[64], port[8];
    int rc = connecting ? getpeername(fd, (struct sockaddr *)&at, &at_len)
                        : getsockname(fd, (struct sockaddr *)&at, &at_len);
    if (rc != 0 || getnameinfo((struct sockaddr *)&at, at_len, host, sizeof host, port, sizeof port,
                               NI_NUMERICHOST | NI_NUMERICSERV) != 0)
        return;
    snprintf(name, len, strchr(host, ':') != NULL ? "[%s]:%s" : "%s:%s", host, port);
}

static int tcp_socket(const struct usb_backend_spec *spec, const char *what, int *fd, char *name, size_t len,
                      struct sh_err *err)
{
    const char *host = spec->address[0] != '\0' ? spec->address : "127.0.0.1";
    char service[8];
    snprintf(service, sizeof service, "%u", (unsigned)spec->port & 0xffffu);
    struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = AI_PASSIVE | AI_NUMERICSERV}, *list = NULL;
    int rc = getaddrinfo(host, service, &hints, &list);
    if (rc != 0)
        return sh_fail(err, SH_EINPUT, "%s:%s:%d: no such address: %s", what, host, spec->port,
                       rc == EAI_SYSTEM ? strerror(errno) : gai_strerror(rc));
    *fd = -1;
    for (const struct addrinfo *at = list; at != NULL && *fd < 0; at = at->ai_next)
        *fd = open_socket(at->ai_addr, at->ai_addrlen, spec->attach);
    int error = errno;
    freeaddrinfo(list);
    if (*fd < 0)
        return sh_fail(err, error_code(error), "%s:%s:%d: cannot %s: %s%s", what, host, spec->port,
                       spec->attach ? "connect" : "listen", strerror(error),
                       error == EADDRINUSE ? "; port 0 lets the system choose" : "");
    name_socket(*fd, spec->attach, name, len);
    return SH_OK;
}

int usb_backend_socket(const struct usb_backend_spec *spec, const char *what, int *fd, char *name, size_t len,
                       struct sh_err *err)
{
    if (spec->path[0] != '\0') {
        snprintf(name, len, "%s", spec->path);
        return unix_socket(spec, what, fd, err);
    }
    return tcp_socket(spec, what, fd, name, len, err);
}

void usb_backend_hang_up(int fd, int timeout_ms)
{
    enum { READS = 8 }; /* a peer that goes on sending is waited for no longer */
    char waste[65536];
    struct pollfd slot = {.fd = fd, .events = POLLIN};
    if (shutdown(fd, SHUT_WR) != 0) return;
    for (int i = 0; i < READS; i++)
        if (poll(&slot, 1, timeout_ms) <= 0 || recv(fd, waste, sizeof waste, MSG_DONTWAIT) <= 0) return;
}
