/* Bytes in: waiting and reading, with deadlines on the monotonic clock. */
#include <errno.h>
#include <poll.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "drivers/host/host.h"

int64_t host_deadline_ns(int timeout_ms)
{
    if (timeout_ms < 0) return INT64_MAX;
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec + (int64_t)timeout_ms * 1000000;
}

int host_wait(struct scanhead *sh, short events, int64_t deadline_ns, short *revents)
{
    for (;;) {
        struct timespec left = {0}, *wait = NULL;
        if (deadline_ns != INT64_MAX) {
            int64_t left_ns = deadline_ns - host_deadline_ns(0);
            if (left_ns < 0) left_ns = 0;
            left.tv_sec = left_ns / 1000000000;
            left.tv_nsec = left_ns % 1000000000;
            wait = &left;
        }
        struct pollfd p = {.fd = sh->source.fd, .events = events};
        int n = ppoll(&p, 1, wait, NULL);
        *revents = p.revents;
        if (n > 0) return 0;
        if (n == 0) return sh_fail(&sh->err, SH_ETIMEOUT, "%s: nothing came in time", sh->source.name);
        if (errno != EINTR) return sh_fail(&sh->err, SH_EIO, "%s: %s", sh->source.name, strerror(errno));
        /* without a deadline a signal is the only way for the program to get a word in */
        if (wait == NULL) return sh_fail(&sh->err, SH_ETIMEOUT, "%s: a signal came", sh->source.name);
    }
}

/* A pty whose master is closed says EIO; a reset connection is as gone as a closed one. */
static int is_hang_up(const struct scanhead *sh, int error)
{
    return !sh->source.is_file && (error == EIO || error == ECONNRESET || error == EPIPE || error == ENODEV ||
                                   error == ENXIO || error == ETIMEDOUT);
}

int host_fill(struct scanhead *sh, int64_t deadline_ns)
{
    size_t room;
    uint8_t *to = native_parser_room(&sh->parser, &room);
    for (;;) {
        ssize_t n = read(sh->source.fd, to, room);
        if (n > 0) {
            native_parser_added(&sh->parser, (size_t)n);
            return 0;
        }
        if (n == 0 || is_hang_up(sh, errno)) {
            native_parser_finish(&sh->parser);
            sh->ended = 1;
            return 0;
        }
        if (errno == EINTR) continue;
        if (errno != EAGAIN) return sh_fail(&sh->err, SH_EIO, "%s: cannot read: %s", sh->source.name, strerror(errno));
        short revents;
        int rc = host_wait(sh, POLLIN, deadline_ns, &revents);
        if (rc != 0) return rc;
    }
}
