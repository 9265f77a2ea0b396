/* SPDX-License-Identifier: MIT */
#include "firmware_sim/base/notify.h"

#include <errno.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

static const char *socket_name(void)
{
    const char *name = getenv("NOTIFY_SOCKET");
    return name != NULL ? name : "";
}

int notify_is_wanted(void)
{
    return socket_name()[0] != '\0';
}

/* An abstract name begins with a NUL and ends where its length says; a path ends with a NUL. */
static int read_address(const char *name, struct sockaddr_un *address, socklen_t *len, struct sh_err *err)
{
    const size_t n = strlen(name);
    if ((name[0] != '/' && name[0] != '@') || n < 2 || n >= sizeof address->sun_path)
        return sh_fail(
            err, SH_EINPUT,
            "NOTIFY_SOCKET=%s: not the name of a socket; allowed are a path from / on and @NAME, 2 to %zu bytes", name,
            sizeof address->sun_path - 1);
    *address = (struct sockaddr_un){.sun_family = AF_UNIX};
    memcpy(address->sun_path, name, n);
    *len = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + n + (name[0] == '/'));
    if (name[0] == '@') address->sun_path[0] = '\0';
    return SH_OK;
}

int notify_send(const char *lines, struct sh_err *err)
{
    static const struct timeval most = {.tv_sec = 1};
    const char *name = socket_name();
    const size_t n = strlen(lines);
    struct sockaddr_un address;
    socklen_t len = 0;
    if (!notify_is_wanted()) return SH_OK;
    const int rc = read_address(name, &address, &len, err);
    if (rc != SH_OK) return rc;
    const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (fd < 0) return sh_fail(err, SH_EIO, "NOTIFY_SOCKET=%s: %s", name, strerror(errno));
    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &most, sizeof most);
    const ssize_t sent = sendto(fd, lines, n, MSG_NOSIGNAL, (const struct sockaddr *)&address, len);
    const int why = errno;
    close(fd);
    if (sent == (ssize_t)n) return SH_OK;
    return sh_fail(err, SH_EIO, "NOTIFY_SOCKET=%s: %s", name, sent < 0 ? strerror(why) : "cut off");
}
