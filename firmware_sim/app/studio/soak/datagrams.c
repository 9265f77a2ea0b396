/* SPDX-License-Identifier: MIT */
/* Compares the datagrams of a link that has faults with those of a second link, the clean one, which has none. Both
 * links speak the same protocol and begin at power-up. So datagram n of the clean link is unit n of the other, before
 * faults hit it. Datagrams have no numbers: each is found among the clean ones by its content, near the place where it
 * is expected. Datagrams of the link with faults wait for WAIT_NS here, so that the clean ones are there first. */
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

#include <arpa/inet.h>

#include "drivers/link/link.h"
#include "drivers/protocol/crc32c.h"
#include "firmware_sim/app/studio/soak/datagrams.h"
#include "firmware_sim/app/studio/soak/frame.h"
#include "firmware_sim/app/studio/soak/ledger.h"
#include "firmware_sim/app/studio/soak/link.h"
#include "firmware_sim/base/clock.h"

enum { LONGEST = 65536, RECEIVE_BYTES = 4 << 20, POLL_MS = 20, LOOK_BACK = 4096, WAITING = 1 << 14 };
static const int64_t WAIT_NS = 300000000;

/* The number of unit n is UNITS + n, so that 0 stays free for `none`. */
static const soak_seq UNITS = (soak_seq)1 << 32;

struct datagram {
    uint64_t digest;
    uint32_t len;
    int64_t at_ns;
};

struct soak_datagrams {
    int fd, clean_fd;
    struct soak_clean_frame ring[SOAK_RING];
    soak_seq top;                  /* number of the last clean one */
    struct datagram wait[WAITING]; /* in order; from `first` on */
    uint32_t first, n;
};

soak_seq soak_unit(uint64_t number)
{
    return UNITS + number;
}

int soak_datagrams_get(const struct soak_datagrams *d, soak_seq seq, struct soak_clean_frame *out)
{
    *out = d->ring[seq % SOAK_RING];
    return out->there && out->seq == seq;
}

/* ---- opening */

static int bind_to(const char *address, int port, int *fd)
{
    const int size = RECEIVE_BYTES;
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    if (inet_pton(AF_INET, address, &at.sin_addr) != 1) return -1;
    *fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (*fd < 0) return -1;
    setsockopt(*fd, SOL_SOCKET, SO_RCVBUF, &size, sizeof size);
    return bind(*fd, (struct sockaddr *)&at, sizeof at);
}

static int port_of(int fd)
{
    struct sockaddr_in at;
    socklen_t len = sizeof at;
    return getsockname(fd, (struct sockaddr *)&at, &len) == 0 ? ntohs(at.sin_port) : 0;
}

struct soak_datagrams *soak_datagrams_open(const struct link_spec *spec, struct link_spec *clean_link)
{
    struct soak_datagrams *d = calloc(1, sizeof *d);
    if (d == NULL) return NULL;
    d->fd = d->clean_fd = -1;
    *clean_link = *spec;
    clean_link->clean = 1;
    snprintf(clean_link->address, sizeof clean_link->address, "127.0.0.1");
    clean_link->interface[0] = clean_link->source[0] = '\0';
    clean_link->source_port = clean_link->ttl = 0;
    if (bind_to(spec->address[0] != '\0' ? spec->address : "127.0.0.1", spec->port, &d->fd) == 0 &&
        bind_to("127.0.0.1", 0, &d->clean_fd) == 0 && (clean_link->port = port_of(d->clean_fd)) != 0)
        return d;
    soak_datagrams_close(d);
    return NULL;
}

void soak_datagrams_close(struct soak_datagrams *d)
{
    if (d == NULL) return;
    if (d->fd >= 0) close(d->fd);
    if (d->clean_fd >= 0) close(d->clean_fd);
    free(d);
}

/* ---- reading */

/* 0: none is there. */
static int receive(int fd, struct datagram *out)
{
    static _Thread_local uint8_t bytes[LONGEST];
    const ssize_t n = recv(fd, bytes, sizeof bytes, 0);
    if (n < 0) return 0;
    *out = (struct datagram){(uint64_t)crc32c(0, bytes, (size_t)n) << 32 | crc32c(~UINT32_C(0), bytes, (size_t)n / 2),
                             (uint32_t)n, clock_now_ns()};
    return 1;
}

/* The caller has the link's lock. */
static void take_clean(struct soak_datagrams *d)
{
    struct datagram got;
    while (receive(d->clean_fd, &got)) {
        if (d->top == 0) d->top = UNITS;
        d->top++;
        d->ring[d->top % SOAK_RING] =
            (struct soak_clean_frame){.seq = d->top, .digest = got.digest, .t_ns = 0, .len = got.len, .there = 1};
    }
}

static void take_others(struct soak_datagrams *d)
{
    while (d->n < WAITING && receive(d->fd, &d->wait[(d->first + d->n) % WAITING]))
        d->n++;
}

/* The number of the same clean datagram, nearest to the one expected; 0: there is none. */
static soak_seq datagrams_find(const struct soak_link *link, const struct datagram *got)
{
    const struct soak_datagrams *d = link->datagrams;
    struct soak_clean_frame clean;
    const soak_seq next = link->begun ? link->last + 1 : UNITS + 1;
    for (soak_seq i = 0; i < LOOK_BACK; i++) {
        if (next + i <= d->top && soak_datagrams_get(d, next + i, &clean) && clean.digest == got->digest)
            return next + i;
        if (i < next - UNITS && soak_datagrams_get(d, next - i, &clean) && clean.digest == got->digest) return next - i;
    }
    return 0;
}

static void take_one(struct soak_link *link, const struct datagram *got)
{
    struct soak_clean_frame clean;
    const soak_seq next = link->begun ? link->last + 1 : UNITS + 1, is = datagrams_find(link, got);
    if (is != 0) {
        soak_saw_unit(link, is, got->digest, got->len);
    } else if (soak_datagrams_get(link->datagrams, next, &clean) && clean.len == got->len) {
        soak_saw_unit(link, next, got->digest, got->len); /* nothing in it says that it is wrong */
    } else {
        link->bad_bytes += got->len;
        link->bad_units++;
    }
}

void soak_datagrams_step(struct soak_link *link)
{
    struct soak_datagrams *d = link->datagrams;
    struct pollfd p[2] = {{.fd = d->clean_fd, .events = POLLIN}, {.fd = d->fd, .events = POLLIN}};
    poll(p, 2, POLL_MS);
    pthread_mutex_lock(&link->lock);
    take_clean(d);
    take_others(d);
    const int64_t until_ns = clock_now_ns() - WAIT_NS;
    while (d->n != 0 && d->wait[d->first].at_ns <= until_ns) {
        take_one(link, &d->wait[d->first]);
        d->first = (d->first + 1) % WAITING;
        d->n--;
    }
    pthread_mutex_unlock(&link->lock);
}

void soak_datagrams_finish(struct soak_link *link)
{
    const int64_t end_ns = clock_now_ns() + 2 * WAIT_NS;
    while (clock_now_ns() < end_ns)
        soak_datagrams_step(link);
}

uint64_t soak_datagrams_top(struct soak_link *link)
{
    pthread_mutex_lock(&link->lock);
    const uint64_t top = link->datagrams->top;
    pthread_mutex_unlock(&link->lock);
    return top;
}
