/* SPDX-License-Identifier: MIT */
/* The bytes of a handle's connection: waiting for them, taking them into the parser, keeping frames while a command
 * waits for its reply, and the connection's end. Private to libscanhead. */
#ifndef DRIVERS_HOST_EXCHANGE_H
#define DRIVERS_HOST_EXCHANGE_H

#include "drivers/host/host.h"

/* io.c: returns whether an errno of the source's read or write means that the other side is gone. */
int host_is_hang_up(const struct scanhead *sh, int error);
/* Notes what that errno means for a head on USB: it was unplugged, or its bus was reset. */
void host_note_loss(struct scanhead *sh, int error);
/* host.c: sets and returns the error of a connection from which nothing more will come. */
int host_gone(struct scanhead *sh);
/* The same, when all items that had come were taken: also gives the notice that the connection is over. */
int host_over(struct scanhead *sh);

/* exchange.c: gives the notice, if one is due, for the parser's present line, which nobody waits for. */
void host_stray_line(struct scanhead *sh);
/* Nothing more will come: keeps the frames that are in the parser. The rest of the parser's bytes is garbage. */
int host_keep_rest(struct scanhead *sh);

/* io.c: waits for `events` on the source: 0, SH_ETIMEOUT (also for a signal, if the call has no time limit), SH_EIO. */
int host_wait(struct scanhead *sh, short events, int64_t deadline_ns, short *revents);
/* Reads what is there into the parser, waiting for it until the deadline. 0 also at the end: then sh->ended
 * is set. */
int host_fill(struct scanhead *sh, int64_t deadline_ns);

/* host.c: keeps the frame that the parser is at, for scanhead_next. */
int host_keep(struct scanhead *sh);

#endif
