/* SPDX-License-Identifier: MIT */
/* The clients that hold the connections of a web link, and which one makes room for another. Private to the web link.
 *
 * Pure; times are of one clock, in us, since many clients may come within a millisecond. */
#ifndef DRIVERS_LINK_WEB_PLACES_H
#define DRIVERS_LINK_WEB_PLACES_H

#include <stddef.h>
#include <stdint.h>
#include <sys/socket.h>

enum {
    WEB_PLACES = 48,        /* connections at a time */
    WEB_PLACES_OF_ONE = 40, /* of one address; the others are left for the rest of the world */
    WEB_GOODBYE_MS = 2000,  /* for clients to take what was written before an end; see also web_places_take */
};

enum web_phase {
    WEB_NOBODY,
    WEB_ASKING,    /* its request has not come whole */
    WEB_ANSWERING, /* its answer is on its way */
    WEB_TALKING,   /* a WebSocket */
    WEB_PARTING,   /* a WebSocket whose session has ended */
    WEB_LINGERING, /* all has gone out; the client has yet to end */
};

struct web_place {
    enum web_phase phase;
    unsigned char address[8]; /* web_address() */
    int64_t since_us;         /* ANSWERING: when it last took something. Else: when the phase began */
};

/* Fills in what counts as one address: the 4 bytes of IPv4, also within IPv6, or the network's half of IPv6. */
void web_address(const struct sockaddr_storage *from, unsigned char address[8]);

/* WEB_PLACES places, each `stride` bytes after the one before. */
struct web_places {
    struct web_place *first;
    size_t stride;
};

/* Returns the index of a place for a new client from this address. If that place's phase isn't NOBODY, its present
 * client has to go. The client that goes is one of this address if the address holds as many as it may, else one of the
 * address that holds the most. Clients go in this order: those that are PARTING or LINGERING, those that are ASKING,
 * and those that took nothing of their answer for WEB_GOODBYE_MS; the oldest first in each group. -1: no client may
 * go. */
int web_places_take(struct web_places places, const unsigned char address[8], int64_t now_us);

#endif
