/* SPDX-License-Identifier: MIT */
/* `record --raw` writes the traffic of any protocol to a .pcapng, which other programs read.
 *
 * In: the command line. Out: Ethernet frames (drivers/protocol/ethernet.h) with the kernel's times of receiving. A
 * source is UDP, on sockets of its own, or TCP. TCP is a connection of its own or, with --relay, the connections of
 * other programs, which reach the device through `record --raw`. */
#ifndef FIRMWARE_SIM_APP_STUDIO_RECORD_RAW_H
#define FIRMWARE_SIM_APP_STUDIO_RECORD_RAW_H

#include <poll.h>

#include "drivers/protocol/ethernet.h"
#include "drivers/record/capture.h"
#include "drivers/socket/stamped.h"
#include "firmware_sim/app/app.h"

enum { RAW_MAX_PORTS = 16, RAW_MAX_SENDS = 64, RAW_MAX_POLLS = 64, RAW_MAX_PASSES = 512 };

struct raw_send {
    uint8_t *bytes;
    size_t len;
};

/* Where the bytes come from, or clients. */
struct raw_place {
    char host[128];          /* "": none is given */
    int port[RAW_MAX_PORTS]; /* TCP: one */
    int n_ports;
};

struct raw;

/* The operations of a source, UDP or TCP. Functions return SH_OK or SH_E. */
struct raw_ops {
    /* Opens sockets and connections; may wait up to r->wait_s. close follows in any case. */
    int (*open)(struct raw *r, struct sh_err *err);
    /* Fills in the descriptors to wait for, up to RAW_MAX_POLLS; returns how many. The function may make *timeout_ms
     * shorter. */
    int (*wait_for)(struct raw *r, struct pollfd *fds, int *timeout_ms);
    /* Writes the data that came, up to RAW_MAX_PASSES pieces, to the file. Returns how many, or SH_E. */
    int (*work)(struct raw *r, struct sh_err *err);
    /* The recording ends: writes what is still to be written. */
    int (*finish)(struct raw *r, struct sh_err *err);
    /* Called once the file is closed. Fails if something is missing in the recording. */
    int (*check)(const struct raw *r, struct sh_err *err);
    /* Writes figures of the source into the statistics. */
    void (*put)(struct json *json, const struct raw *r);
    uint64_t (*dropped)(const struct raw *r);
    void (*close)(struct raw *r);
};

struct raw {
    /* the command line */
    struct app_input in;
    const char *path, *stats, *relay;
    struct raw_send send[RAW_MAX_SENDS];
    int n_sends;
    double duration_s, wait_s; /* 0: not given */
    long ready_fd;
    int raw, quiet;
    struct raw_place place, clients; /* of the source; of --relay */
    const struct raw_ops *ops;
    /* the recording */
    struct capture capture;
    uint64_t bytes;     /* of payload */
    int64_t first_ns;   /* monotonic, of the first packet; 0: none came */
    int64_t last_t_ns;  /* of the last packet */
    int over;           /* 1: the source ended by itself */
    char endpoint[160]; /* where it listens; for --ready-fd */
    void *state;        /* of ops */
    double wall_s;
};

extern const struct raw_ops raw_udp, raw_tcp;

/* Whether --raw is among the arguments. */
int raw_is_wanted(int argc, char **argv);
/* `record` with --raw. Returns the exit status. */
int raw_record(int argc, char **argv);

/* ---- inside */

/* Makes the recording. SH_ELOST, SH_ECLOSED: something is missing or was not sent, and the file keeps the rest.
 * SH_ETIMEOUT: no packet came, and there is no file; or the device itself sent nothing. */
int raw_run(struct raw *r, struct sh_err *err);
/* Writes a frame to the file. payload: how many of its bytes count as received. */
int raw_write(struct raw *r, const struct capture_frame *frame, size_t payload, struct sh_err *err);
struct ethernet_end raw_end_of(const struct sockaddr_storage *at);
/* Turns a text with escapes into *len bytes; `out` has room for as many bytes as the text has. Returns NULL, or what is
 * wrong with the text. */
const char *raw_unescape(const char *text, uint8_t *out, size_t *len);

#endif
