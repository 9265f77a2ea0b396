/* Sockets of the back ends that talk over one. */
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
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
    if (at->sa_family != AF_UNIX) setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one); /* inherited */
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

/* Nobody answers on it: its owner is gone without removing it. */
static int is_left_behind(const struct sockaddr_un *at)
{
    struct stat st;
    if (lstat(at->sun_path, &st) != 0 || !S_ISSOCK(st.st_mode)) return 0;
    int fd = open_socket((const struct sockaddr *)at, sizeof *at, 1);
    if (fd >= 0) close(fd);
    return fd < 0 && errno == ECONNREFUSED;
}

static int unix_socket(const struct usb_backend_spec *spec, const char *what, int *fd, struct sh_err *err)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    if (strlen(spec->path) >= sizeof at.sun_path)
        return sh_fail(err, SH_EINPUT, "%s:%s: the path is too long for a socket; allowed %zu bytes", what, spec->path,
                       sizeof at.sun_path - 1);
    strcpy(at.sun_path, spec->path);
    if (!spec->attach && is_left_behind(&at)) unlink(at.sun_path);
    *fd = open_socket((struct sockaddr *)&at, sizeof at, spec->attach);
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
