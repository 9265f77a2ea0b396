/* SPDX-License-Identifier: MIT */
/* Sources by name: usb..., tty:PATH, tcp:HOST:PORT, fd:N, or the path of a recorded stream (.shs, .pcapng). */
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include "drivers/host/source.h"

enum { CONNECT_TIMEOUT_MS = 10000, RECEIVE_BUFFER = 4 << 20 };
enum { IDLE_S = 10, INTERVAL_S = 5, PROBES = 3 }; /* of keep-alive: about 25 s, as the head has for its clients */

static int fail_open(struct sh_err *err, int code, const char *name)
{
    return sh_fail(
        err, code,
        "%s: cannot open: %s (a source is usb, tty:PATH, tcp:HOST:PORT, fd:N or the path of a .shs or .pcapng file)",
        name, strerror(errno));
}

static int open_tty(const char *path, struct host_source *out, struct sh_err *err)
{
    out->fd = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (out->fd < 0)
        return fail_open(err,
                         errno == EACCES || errno == EPERM ? SH_EPERM
                         : errno == ENOENT                 ? SH_ELOST
                                                           : SH_EIO,
                         out->name);
    struct termios tio;
    if (tcgetattr(out->fd, &tio) != 0)
        return sh_fail(err, SH_EINPUT, "%s: not a terminal device: %s", out->name, strerror(errno));
    const int cooked = (tio.c_lflag & (ICANON | ECHO)) != 0;
    cfmakeraw(&tio);
    tio.c_cflag |= CLOCAL | CREAD;
    tio.c_cc[VMIN] = 1; /* else a read without data looks like the end */
    tio.c_cc[VTIME] = 0;
    if (tcsetattr(out->fd, TCSANOW, &tio) != 0)
        return sh_fail(err, SH_EIO, "%s: cannot set raw mode: %s", out->name, strerror(errno));
    /* The terminal has changed earlier bytes and echoed them to the head. So these bytes are dropped. */
    if (cooked) tcflush(out->fd, TCIOFLUSH);
    out->unsettled = 1;
    return 0;
}

/* "host:port" or "[v6]:port" -> the two parts. */
static int split_address(const char *address, char host[256], char port[8], struct sh_err *err)
{
    const char *begin = address, *end, *colon;
    if (*address == '[') {
        begin = address + 1;
        end = strchr(begin, ']');
        colon = end != NULL ? end + 1 : NULL;
    } else {
        end = colon = strrchr(address, ':');
    }
    int bad = end == NULL || *colon != ':' || end == begin || end - begin > 255;
    if (!bad && *address != '[' && memchr(begin, ':', (size_t)(end - begin)) != NULL) bad = 1;
    size_t digits = bad ? 0 : strspn(colon + 1, "0123456789");
    if (bad || digits < 1 || digits > 5 || colon[1 + digits] != 0 || atoi(colon + 1) < 1 || atoi(colon + 1) > 65535)
        return sh_fail(err, SH_EINPUT,
                       "tcp:%s: not an address; allowed are tcp:HOST:PORT or tcp:[IPV6]:PORT, port 1 to 65535",
                       address);
    memcpy(host, begin, (size_t)(end - begin));
    host[end - begin] = 0;
    memcpy(port, colon + 1, digits + 1);
    return 0;
}

/* A head that vanishes without a word, as by a loss of power, ends the connection (ETIMEDOUT). Errors are ignored: a
 * small buffer costs speed, not correctness. */
static void tune_socket(int fd)
{
    const int size = RECEIVE_BUFFER, on = 1, idle_s = IDLE_S, interval_s = INTERVAL_S, probes = PROBES;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
    setsockopt(fd, IPPROTO_TCP, TCP_KEEPIDLE, &idle_s, sizeof idle_s);
    setsockopt(fd, IPPROTO_TCP, TCP_KEEPINTVL, &interval_s, sizeof interval_s);
    setsockopt(fd, IPPROTO_TCP, TCP_KEEPCNT, &probes, sizeof probes);
    setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &size, sizeof size);
#ifdef SO_BUF_LOCK
    /* The system may have allowed far less than asked; then let it still grow the buffer by itself. */
    int unlock = 0;
    setsockopt(fd, SOL_SOCKET, SO_BUF_LOCK, &unlock, sizeof unlock);
#endif
}

static int wait_connected(int fd, int64_t deadline_ns)
{
    for (;;) {
        int64_t left_ms = (deadline_ns - host_deadline_ns(0)) / 1000000;
        struct pollfd p = {.fd = fd, .events = POLLOUT};
        int n = left_ms > 0 ? poll(&p, 1, (int)left_ms) : 0;
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return errno;
        if (n == 0) return ETIMEDOUT;
        int error = 0;
        socklen_t len = sizeof error;
        getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &len);
        return error;
    }
}

/* Whether the socket is connected to itself. TCP does that where nobody listens, and the system gives the socket the
 * same port that it connects to. */
static int is_own_end(int fd, const struct addrinfo *ai)
{
    struct sockaddr_storage own = {0};
    socklen_t len = sizeof own;
    return getsockname(fd, (struct sockaddr *)&own, &len) == 0 && len == ai->ai_addrlen &&
           memcmp(&own, ai->ai_addr, len) == 0;
}

/* Returns a connected socket, or -1 with errno. */
static int connect_one(const struct addrinfo *ai, int64_t deadline_ns)
{
    int fd = socket(ai->ai_family, ai->ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, ai->ai_protocol);
    if (fd < 0) return -1;
    tune_socket(fd);
    int error = 0;
    if (connect(fd, ai->ai_addr, ai->ai_addrlen) != 0)
        error = errno == EINPROGRESS ? wait_connected(fd, deadline_ns) : errno;
    if (error == 0 && is_own_end(fd, ai)) error = ECONNREFUSED;
    if (error == 0) return fd;
    close(fd);
    errno = error;
    return -1;
}

static int open_tcp(const char *address, struct host_source *out, struct sh_err *err)
{
    char host[256], port[8];
    int rc = split_address(address, host, port, err);
    if (rc != 0) return rc;
    struct addrinfo hints = {.ai_family = AF_UNSPEC, .ai_socktype = SOCK_STREAM}, *list;
    int gai = getaddrinfo(host, port, &hints, &list);
    if (gai != 0) return sh_fail(err, SH_EIO, "%s: cannot find the host: %s", out->name, gai_strerror(gai));
    const int64_t deadline_ns = host_deadline_ns(CONNECT_TIMEOUT_MS);
    int n = 0;
    for (const struct addrinfo *ai = list; ai != NULL; ai = ai->ai_next)
        n++;
    for (const struct addrinfo *ai = list; ai != NULL && out->fd < 0; ai = ai->ai_next, n--) {
        const int64_t now_ns = host_deadline_ns(0);
        out->fd = connect_one(ai, now_ns + (deadline_ns - now_ns) / n); /* the other addresses share what is left */
    }
    int error = errno;
    freeaddrinfo(list);
    out->is_socket = 1;
    if (out->fd >= 0) return 0;
    return sh_fail(err, error == ETIMEDOUT ? SH_ETIMEOUT : SH_EIO, "%s: cannot connect: %s", out->name,
                   strerror(error));
}

static int open_fd(const char *number, struct host_source *out, struct sh_err *err)
{
    char *end;
    errno = 0;
    long n = strtol(number, &end, 10);
    struct stat st;
    if (errno != 0 || *number < '0' || *number > '9' || *end != 0 || n > 1 << 20 || fstat((int)n, &st) != 0)
        return sh_fail(err, SH_EINPUT, "%s: not an open descriptor", out->name);
    int flags = fcntl((int)n, F_GETFL);
    if (flags < 0 || fcntl((int)n, F_SETFL, flags | O_NONBLOCK) != 0)
        return sh_fail(err, SH_EIO, "%s: %s", out->name, strerror(errno));
    out->fd = (int)n;
    out->was_blocking = (flags & O_NONBLOCK) == 0;
    out->is_socket = S_ISSOCK(st.st_mode);
    out->is_file = S_ISREG(st.st_mode);
    return 0;
}

/* Opens a regular file only: a FIFO would wait for its writer (fd:N takes one), a device may have no end. */
static int open_file(const char *path, struct host_source *out, struct sh_err *err)
{
    out->fd = open(path, O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    if (out->fd < 0) return fail_open(err, SH_EINPUT, out->name);
    struct stat st;
    if (fstat(out->fd, &st) == 0 && !S_ISREG(st.st_mode))
        return sh_fail(err, SH_EINPUT, "%s: is a %s, not a recorded stream%s", out->name,
                       S_ISDIR(st.st_mode)    ? "directory"
                       : S_ISFIFO(st.st_mode) ? "FIFO"
                                              : "device",
                       S_ISFIFO(st.st_mode) ? "; fd:N reads one that is open" : "");
    out->is_file = 1;
    const char *ending = strrchr(path, '.');
    return ending != NULL && strcasecmp(ending, ".pcapng") == 0 ? host_capture_open(out, err) : 0;
}

int host_source_is_usb(const char *source)
{
    return strcmp(source, "usb") == 0 || strncmp(source, "usb:", 4) == 0;
}

int host_source_open(const char *source, struct host_source *out, struct sh_err *err)
{
    memset(out, 0, sizeof *out);
    out->fd = -1;
    snprintf(out->name, sizeof out->name, "%s", source);
    int rc;
    if (host_source_is_usb(source)) return host_usb_open(source, out, err);
    out->ops = &host_fd_ops;
    if (strncmp(source, "tty:", 4) == 0)
        rc = open_tty(source + 4, out, err);
    else if (strncmp(source, "tcp:", 4) == 0)
        rc = open_tcp(source + 4, out, err);
    else if (strncmp(source, "fd:", 3) == 0)
        rc = open_fd(source + 3, out, err);
    else
        rc = open_file(source, out, err);
    if (rc != 0 && out->fd >= 0) {
        close(out->fd);
        out->fd = -1;
    }
    if (rc != 0) out->ops = NULL;
    return rc;
}
