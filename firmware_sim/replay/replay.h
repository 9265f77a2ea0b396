/* SPDX-License-Identifier: MIT */
/* A recording as a source of the loop (loop/source.h): the same bytes, with the timing that they had.
 *
 * In: a recording, and commands of clients. Out: ticks with its frames. The recording is played when a client commands
 * SCAN:STARt, or at once; SCAN:STARt begins it anew at any time. Queries are answered from its descriptor, and no
 * setting changes.
 *
 * In its first round, each frame has the bytes that were recorded. In each further round the sequence numbers of frames
 * go back by 2^30; a reader takes that for a head that was started again. All else is as it was recorded, device times,
 * too.
 *
 * Threads: next() belongs to the player; commands come from links. One lock, held for microseconds; files are read
 * without it. */
#ifndef FIRMWARE_SIM_REPLAY_REPLAY_H
#define FIRMWARE_SIM_REPLAY_REPLAY_H

#include "drivers/link/link.h"
#include "drivers/protocol/talk.h"
#include "firmware_sim/loop/source.h"

struct replay;

struct replay_options {
    const char *path;
    double speed;        /* > 0; 1 in all paces but realtime */
    double from_s, to_s; /* device time since the recording's first frame; to_s 0: up to its end */
    int loop;            /* at its end it begins anew */
    int start;           /* play at once; and end the run at the end, unless loop */
    uint32_t clients;    /* with start: once so many clients are there; 0: at once */
    double duration_s;   /* > 0: end the run after that time; with start: after that time of playing */
    /* In place of a recording: a talk for each link of cfg, which says what the link sends (drivers/protocol/talk.h).
     * talk_options holds for all of them. NULL: a recording. */
    const struct talk *const *talk;
    struct talk_options talk_options;
    const char *truth;              /* file for the faults that are injected; NULL: none */
    const struct sh_report *report; /* warnings while it is played, from the player's thread */
};

/* Whether clients connect to the link: a null, file or udp link opens a session for itself. */
static inline int replay_has_clients(const struct link_spec *link)
{
    return link->type != LINK_NULL && link->type != LINK_FILE && link->type != LINK_UDP;
}

/* Opens the recording and reads it until a descriptor and an anchor have come, or to its end. Of cfg, links, loop and
 * faults are used; its profile and settings are set from the recording, as far as links need them. cfg, and what
 * options points to, must live until replay_free. SH_EINPUT: faults in the head, a link whose protocol can't show the
 * recorded head, or a file without a descriptor. */
int replay_open(struct config *cfg, const struct replay_options *options, struct replay **out, struct sh_err *err);
void replay_free(struct replay *replay);

extern const struct loop_source_ops replay_source; /* self: the struct replay */

/* For messages. */
struct replay_summary {
    char idn[96];
    uint32_t times;          /* how often it was begun */
    uint64_t frames;         /* frames sent, over all times */
    uint64_t bad_bytes;      /* bytes of the file that are in no frame, in the last time */
    uint64_t repeated, late; /* frames of the file that were left out, since they came twice or too late */
    uint64_t refused;        /* frames left out for wrong contents or another version */
    int cut;                 /* the file ends within a frame */
};
void replay_get_summary(struct replay *replay, struct replay_summary *summary);
/* After the loop is joined: 0, or why it could not be read to its end. */
int replay_check(struct replay *replay, struct sh_err *err);

#endif
