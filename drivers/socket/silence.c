/* SPDX-License-Identifier: MIT */
#include "drivers/socket/silence.h"

#include <linux/sockios.h>
#include <netinet/in.h>
#include <poll.h>
#include <stddef.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include "core/err.h"

/* A peer that reads confirms within 40 ms as a rule. After 200 ms (TCP_RTO_MIN) the system begins to repeat. */
enum { CONFIRM_MS = 200, MOST_HOPS = 255 };

/* A socket of IPv6 may have a peer of IPv4, so it needs the options of both. */
static int take_from(int fd, int least_ttl)
{
    int family = AF_INET;
    socklen_t len = sizeof family;
    getsockopt(fd, SOL_SOCKET, SO_DOMAIN, &family, &len);
    const int by_v4 = setsockopt(fd, IPPROTO_IP, IP_MINTTL, &least_ttl, sizeof least_ttl);
    const int by_v6 =
        family == AF_INET6 ? setsockopt(fd, IPPROTO_IPV6, IPV6_MINHOPCOUNT, &least_ttl, sizeof least_ttl) : 0;
    return by_v4 == 0 && by_v6 == 0 ? SH_OK : SH_ESTATE;
}

static int is_any_unconfirmed(const int *fds, int n)
{
    for (int i = 0; i < n; i++) {
        int bytes = 0;
        if (fds[i] >= 0 && ioctl(fds[i], SIOCOUTQ, &bytes) == 0 && bytes > 0) return 1;
    }
    return 0;
}

static void speak(const int *fds, int n)
{
    const int on = 1;
    for (int i = 0; i < n; i++) {
        if (fds[i] < 0) continue;
        take_from(fds[i], 0);
        setsockopt(fds[i], SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
    }
}

static int silence(const int *fds, int n)
{
    const int off = 0;
    for (int i = 0; i < n; i++) {
        if (fds[i] < 0) continue;
        if (take_from(fds[i], MOST_HOPS) != SH_OK) {
            speak(fds, i + 1); /* this one too: one of the two options of an IPv6 socket may have been set */
            return SH_ESTATE;
        }
        setsockopt(fds[i], SOL_SOCKET, SO_KEEPALIVE, &off, sizeof off);
    }
    return SH_OK;
}

int sockets_silence(int listener, const int *fds, int n)
{
    if (silence(&listener, 1) != SH_OK) return SH_ESTATE; /* first: no new client comes while it waits */
    for (int ms = 0; ms < CONFIRM_MS && is_any_unconfirmed(fds, n); ms++)
        poll(NULL, 0, 1);
    if (silence(fds, n) == SH_OK) return SH_OK;
    speak(&listener, 1);
    return SH_ESTATE;
}

void sockets_speak(int listener, const int *fds, int n)
{
    speak(&listener, 1);
    speak(fds, n);
}
