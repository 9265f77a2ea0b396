/* SPDX-License-Identifier: MIT */
/* rawlog-grabber of Debian's mrpt-apps, unmodified. The grabber is started with a configuration of the test's, ended as
 * its user ends it, and its recording is read. A rawlog is a gzip stream of MRPT's serialised objects. The rig reads
 * scans, turns and GPS observations. */
#ifndef TESTS_WIRE_GRABBER_H
#define TESTS_WIRE_GRABBER_H

#include "tests/wire/wire.h"

struct grabber {
    struct wire *wire;
    pid_t pid;
    int in_fd, out_fd; /* its standard input and output */
    char name[16];
    char said[1 << 16]; /* on standard output and standard error */
    size_t n_said;
};

/* Skips the test where the program is not installed. */
void grabber_or_skip(void);

/* Starts it. `name` is that of its section, its label and its files. `sensor` has the lines of its section for the
 * driver. */
void grabber_start(struct wire *wire, const char *name, const char *sensor, struct grabber *grabber);

/* Waits until it has saved so many observations. Returns 0 when it complained before. */
int grabber_wait(struct grabber *grabber, int n_saved);

/* Lets all threads of a process go before others, where the kernel permits that (root, RLIMIT_RTPRIO). The grabber goes
 * before others, too. It waits only 100 ms for the reply to a command, and then does without one. So its head has to
 * hurry. */
void grabber_hurry(pid_t pid);

/* Starts the grabber and waits; where it complains, it is started anew. Beside eight busy processes, and without the
 * right to hurry, it gets its replies in about one of three tries. It has fifteen tries. */
void grabber_start_and_wait(struct wire *wire, const char *name, const char *sensor, int n_saved,
                            struct grabber *grabber);

/* Returns how many datagrams the kernel threw away because a socket's owner did not read them in time. Such losses
 * happen on a busy machine. */
uint32_t grabber_dropped_at(int port);

/* Ends the grabber by a key, as a user does. The grabber must end with status 0. */
void grabber_end(struct grabber *grabber);

enum { RAWLOG_PACKET_LEN = 1206 };

/* This is one observation. */
struct rawlog_item {
    enum { RAWLOG_SCAN, RAWLOG_TURN, RAWLOG_GPS } kind;
    int64_t t_100ns; /* since 1601 */
    uint32_t n;      /* ranges of a scan; packets of a turn */
    /* of a scan: */
    double aperture_rad;
    int right_to_left;
    const uint8_t *range, *valid; /* n floats, little-endian; n bytes */
    const uint8_t *packets;       /* of a turn */
};

struct rawlog {
    uint8_t *bytes;
    size_t len;
    struct rawlog_item *item;
    uint32_t n_items;
};

/* Reads the file of a grabber that has ended, in its order. */
void rawlog_read(const struct grabber *grabber, struct rawlog *log);
void rawlog_free(struct rawlog *log);

double rawlog_range_m(const struct rawlog_item *scan, uint32_t i);

#endif
