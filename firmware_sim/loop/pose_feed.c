/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/pose_feed.h"

#include <errno.h>
#include <math.h>
#include <netdb.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/socket/socket.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/device/pose_line.h"

enum { DATAGRAM = 65536 };

struct pose_feed {
    struct device *device;
    int fd, stop_fd;
    char endpoint[96];
    pthread_t thread;
    int running;
    int64_t reported_ns; /* when a bad line was reported last */
    char text[DATAGRAM + 1];
};

static void report_bad(struct pose_feed *feed, int number, const char *what)
{
    int64_t now_ns = clock_now_ns();
    if (feed->reported_ns != 0 && now_ns - feed->reported_ns < 1000000000) return;
    feed->reported_ns = now_ns;
    device_report(feed->device, number, what);
}

static void pose_feed_take_line(struct pose_feed *feed, const char *line)
{
    double t_s, v[6];
    struct sh_err err;
    if (line[strspn(line, " \t\r")] == '\0') return;
    int rc = pose_line_read_timed(line, &t_s, v, &err);
    if (rc != SH_OK)
        atomic_fetch_add(&device_counters(feed->device)->bad_poses, 1);
    else
        rc = device_pose(feed->device, llround(1e9 * t_s), v, &err); /* counts it, too */
    const int number = rc == SH_EFORMAT ? CMD_E_DATA_TYPE : rc == SH_ESTATE ? CMD_E_SETTINGS : CMD_E_RANGE;
    if (rc != SH_OK) report_bad(feed, number, err.text);
}

static void take_datagram(struct pose_feed *feed)
{
    ssize_t n = recv(feed->fd, feed->text, DATAGRAM, MSG_DONTWAIT);
    if (n <= 0) return;
    feed->text[n] = '\0';
    /* The text may end with NULs, as that of a C program does. Other NULs would hide what follows them: they are
     * errors. */
    while (n > 0 && feed->text[n - 1] == '\0')
        n--;
    for (ssize_t i = 0; i < n; i++)
        if (feed->text[i] == '\0') feed->text[i] = '?';
    for (char *line = feed->text, *next; line != NULL; line = next) {
        next = strchr(line, '\n');
        if (next != NULL) *next++ = '\0';
        pose_feed_take_line(feed, line);
    }
}

static void *feed_main(void *arg)
{
    struct pose_feed *feed = arg;
    struct pollfd slot[2] = {{.fd = feed->fd, .events = POLLIN}, {.fd = feed->stop_fd, .events = POLLIN}};
    for (;;) {
        if (poll(slot, 2, -1) < 0 && errno != EINTR) break;
        if (slot[1].revents != 0) break;
        if (slot[0].revents != 0) take_datagram(feed);
    }
    return NULL;
}

static int bind_to(struct pose_feed *feed, const char *address, unsigned port, struct sh_err *err)
{
    char service[8];
    snprintf(service, sizeof service, "%u", port & 0xffffu);
    struct addrinfo hints = {.ai_socktype = SOCK_DGRAM, .ai_flags = AI_PASSIVE | AI_NUMERICSERV}, *at = NULL;
    int rc = getaddrinfo(address, service, &hints, &at);
    if (rc != 0) return sh_fail(err, SH_EINPUT, "platform.address %s: no such address: %s", address, gai_strerror(rc));
    feed->fd = socket(at->ai_family, at->ai_socktype | SOCK_CLOEXEC, at->ai_protocol);
    if (feed->fd < 0 || bind(feed->fd, at->ai_addr, at->ai_addrlen) != 0)
        rc = sh_fail(err, errno == EADDRINUSE || errno == EADDRNOTAVAIL ? SH_EINPUT : SH_EIO,
                     "platform udp:%s:%u: cannot listen: %s", address, port, strerror(errno));
    freeaddrinfo(at);
    if (rc != 0) return rc;
    struct sockaddr_storage own;
    socklen_t len = sizeof own;
    char text[80];
    getsockname(feed->fd, (struct sockaddr *)&own, &len);
    socket_address_text((struct sockaddr *)&own, len, text, sizeof text);
    snprintf(feed->endpoint, sizeof feed->endpoint, "udp:%s", text);
    return SH_OK;
}

int pose_feed_open(struct device *device, const struct config *cfg, struct pose_feed **out, struct sh_err *err)
{
    *out = NULL;
    struct pose_feed *feed = calloc(1, sizeof *feed);
    if (feed == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    feed->device = device;
    feed->fd = -1;
    feed->stop_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    int rc = feed->stop_fd < 0 ? sh_fail(err, SH_EIO, "eventfd: %s", strerror(errno)) : SH_OK;
    if (rc == SH_OK) rc = bind_to(feed, cfg->platform.address, cfg->platform.port, err);
    if (rc != SH_OK) {
        pose_feed_close(feed);
        return rc;
    }
    *out = feed;
    return SH_OK;
}

int pose_feed_start(struct pose_feed *feed, struct sh_err *err)
{
    int rc = pthread_create(&feed->thread, NULL, feed_main, feed);
    if (rc != 0) return sh_fail(err, SH_EIO, "no thread for the platform's poses: %s", strerror(rc));
    feed->running = 1;
    return SH_OK;
}

void pose_feed_endpoint(const struct pose_feed *feed, char *buf, size_t len)
{
    snprintf(buf, len, "%s", feed->endpoint);
}

void pose_feed_close(struct pose_feed *feed)
{
    if (feed == NULL) return;
    if (feed->running && eventfd_write(feed->stop_fd, 1) == 0) pthread_join(feed->thread, NULL);
    if (feed->fd >= 0) close(feed->fd);
    if (feed->stop_fd >= 0) close(feed->stop_fd);
    free(feed);
}
