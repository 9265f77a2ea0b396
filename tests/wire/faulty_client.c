/* SPDX-License-Identifier: MIT */
#include "tests/wire/faulty_client.h"

#include <arpa/inet.h>
#include <poll.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/bytes.h"

/* Offsets and types are those of PROTOCOL.md, ANCHOR.md and POINTS.md. */
enum { SYNC = 0xd5, HEADER = 28, ANCHOR = 2, POINTS = 3, LOCAL = 2, AGAIN_MS = 20, ASK_MS = 50, ROOM = 1 << 17 };

struct client {
    const char *faults;
    FILE *out;
    struct sockaddr_in head;
    int fd;
    uint8_t in[ROOM];
    size_t n;
    int have_seq, have_anchor, have_points, scans;
    uint32_t seq;
    double anchor[3], scale[3];
};

static volatile sig_atomic_t is_over;

static void end(int number)
{
    (void)number;
    is_over = 1;
}

static int has_fault(const struct client *c, char fault)
{
    return strcmp(c->faults, "none") != 0 && strchr(c->faults, fault) != NULL;
}

/* Bit by bit, so that nothing of the product is in it. */
static uint32_t crc32c(const uint8_t *p, size_t n)
{
    uint32_t crc = 0xffffffff;
    for (size_t i = 0; i < n; i++) {
        crc ^= p[i];
        for (int bit = 0; bit < 8; bit++)
            crc = crc >> 1 ^ (0x82f63b78 & (0 - (crc & 1)));
    }
    return ~crc;
}

static void take_anchor(struct client *c, const uint8_t *p)
{
    for (int k = 0; k < 3; k++) {
        c->anchor[k] = le_get_double(p + 16 + 8 * k);
        c->scale[k] = le_get_double(p + 168 + 8 * k);
        if (c->scale[k] <= 0.0) c->scale[k] = le_get_double(p + 40);
    }
    c->have_anchor = 1;
}

static void take_points(struct client *c, const uint8_t *p, size_t len)
{
    const uint32_t n = le_get32(p + 36);
    if (!c->have_anchor || 40 + (size_t)20 * n > len) return;
    for (uint32_t i = 0; i < n; i++) {
        const uint8_t *at = p + 40 + (size_t)20 * i;
        if (le_get32(at + 16) >> 28 == 0) continue; /* a shot without echo */
        c->have_points = 1;
        for (int k = 0; k < 3; k++)
            fprintf(c->out, "%.6f%c", c->anchor[k] + c->scale[k] * (double)(int32_t)le_get32(at + 4 * k),
                    k < 2 ? ' ' : '\n');
    }
}

static void take_frame(struct client *c, const uint8_t *frame, size_t len)
{
    const uint32_t seq = le_get32(frame + 8);
    const int is_local = (frame[3] & LOCAL) != 0;
    if (crc32c(frame + HEADER, len) != le_get32(frame + 12) && !has_fault(c, 'c')) return;
    if (!is_local && c->have_seq && (int32_t)(seq - c->seq) <= 0 && !has_fault(c, 't')) return;
    if (!is_local) c->seq = seq;
    c->have_seq |= !is_local;
    if (frame[1] == ANCHOR) take_anchor(c, frame + HEADER);
    if (frame[1] == POINTS) take_points(c, frame + HEADER, len);
}

/* Replies are printable. Any other byte is skipped. */
static size_t take_line(struct client *c, const uint8_t *p, size_t n)
{
    size_t len = 0;
    while (len < n && p[len] >= 0x20 && p[len] <= 0x7e)
        len++;
    if (len == n) return 0;
    if (len >= 8 && memcmp(p, "scanning", 8) == 0) c->scans = 1;
    return len > 0 ? len : 1;
}

/* Returns how many bytes the piece at p takes; 0: it is not whole. */
static size_t take_piece(struct client *c, const uint8_t *p, size_t n)
{
    if (*p != SYNC) return take_line(c, p, n);
    if (n < HEADER) return 0;
    const size_t len = le_get32(p + 4);
    if (crc32c(p, 24) != le_get32(p + 24) || len > 65536) return 1;
    if (n < HEADER + len) return 0;
    take_frame(c, p, len);
    return HEADER + len;
}

static void take_bytes(struct client *c)
{
    size_t at = 0, piece;
    while (at < c->n && (piece = take_piece(c, c->in + at, c->n - at)) != 0)
        at += piece;
    if (at == 0 && c->n == ROOM) at = 1;
    memmove(c->in, c->in + at, c->n - at);
    c->n -= at;
}

/* Asks until the head scans. A command that the state does not allow changes nothing. */
static void ask(const struct client *c)
{
    const char *lines = has_fault(c, 'a')   ? "SCAN:BEGIN\nSCAN:STARt\nHEAD:STATe?\n"
                        : has_fault(c, 'n') ? "HEAD:STATe?\n"
                                            : "SCAN:STARt\nHEAD:STATe?\n";
    if (write(c->fd, lines, strlen(lines)) < 0) return; /* the next read shows why */
}

/* Reads until the connection ends. */
static void follow(struct client *c)
{
    c->n = 0;
    c->have_seq = c->have_anchor = c->scans = 0;
    ask(c);
    while (!is_over) {
        struct pollfd on = {c->fd, POLLIN, 0};
        const int ready = poll(&on, 1, ASK_MS);
        if (ready == 0 && !c->scans) ask(c);
        if (ready <= 0) continue;
        const ssize_t got = read(c->fd, c->in + c->n, ROOM - c->n);
        if (got <= 0) return;
        c->n += (size_t)got;
        take_bytes(c);
        if (c->have_points && has_fault(c, 'd')) raise(SIGKILL);
    }
}

static int client_connect(struct client *c)
{
    c->fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (c->fd >= 0 && connect(c->fd, (const struct sockaddr *)&c->head, sizeof c->head) == 0) return 1;
    close(c->fd);
    poll(NULL, 0, AGAIN_MS);
    return 0;
}

int faulty_client(int argc, char **argv)
{
    int pair[2]; /* event loops wake themselves by such a pair: it is no old connection */
    if (argc != 6 || socketpair(AF_UNIX, SOCK_STREAM, 0, pair) != 0) return 2;
    struct client *c = calloc(1, sizeof *c);
    if (c == NULL) return 1;
    c->faults = argv[5];
    c->out = fopen(argv[4], "w");
    c->head = (struct sockaddr_in){.sin_family = AF_INET, .sin_port = htons((uint16_t)atoi(argv[3]))};
    if (c->out == NULL || inet_pton(AF_INET, argv[2], &c->head.sin_addr) != 1) return 1;
    setvbuf(c->out, NULL, _IOLBF, ROOM); /* lines are whole even when it is killed */
    signal(SIGTERM, has_fault(c, 'k') ? SIG_IGN : end);
    signal(SIGPIPE, SIG_IGN);
    for (int met = 0; !is_over;) {
        if (met && has_fault(c, 's')) {
            pause();
            continue;
        }
        if (!client_connect(c)) continue;
        met = 1;
        follow(c);
        while (!is_over && has_fault(c, 'h'))
            pause();
        close(c->fd);
    }
    const int status = fclose(c->out) == 0 ? 0 : 1;
    close(pair[0]);
    close(pair[1]);
    free(c);
    return status;
}
