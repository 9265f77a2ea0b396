/* SPDX-License-Identifier: MIT */
/* Private to this folder: a soak, and how its parts meet.
 *
 *   soak.c     the command; runs the head and all threads
 *   clean.c    a thread that reads the clean stream within this process
 * client.c a thread per link: a recorder that does all that a good one does
 *   datagrams.c  the same for a link that sends datagrams
 *   usb.c      how a client finds the head on USB, and enumerations
 *   ask.c      its questions and their answers
 * ledger.c for each link and frame: the injected faults, and what the client saw of them
 *   judge.c    compares the two, frame by frame
 *   head.c     faults in the head, and what the client saw of them
 * sheet.c the results, as text and as JSON */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_SOAK_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_SOAK_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>

#include "drivers/host/scanhead.h"
#include "firmware_sim/base/json.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/fault/board.h"
#include "firmware_sim/loop/loop.h"

/* A row of the sheet is a kind of fault; flips with right checksums have one of their own. */
enum { SOAK_RESEALED = FAULT_N_KINDS, SOAK_N_ROWS };

/* Frames that are remembered, clean and by link: a power of two. Half of them at most wait to be judged. */
enum {
    SOAK_RING = 1 << 16,
    SOAK_MAX_RUNS = 1024,
    SOAK_MAX_ACTS = 64,
    SOAK_MAX_REPLY_NOTES = 16,
    SOAK_MAX_MOMENTS = 64,
    SOAK_MAX_PLUGS = 8,
    SOAK_REPLY_LEN = 600
};

struct soak_row {
    uint64_t injected;
    uint64_t noticed;  /* by the client, at its place */
    uint64_t hidden;   /* that no client could notice there; `why` says the last reason */
    uint64_t missed;   /* that it should have noticed */
    uint64_t lost;     /* frames that the client did not get because of it */
    uint64_t accepted; /* frames that it took, and that differ from the clean ones */
    const char *why;
};

/* Numbers of frames as 64 bits: those on the wire wrap, these do not. */
typedef uint64_t soak_seq;

/* ---- the clean stream */

struct soak_clean_frame {
    soak_seq seq;
    uint64_t digest;
    int64_t t_ns;
    uint32_t len;
    int there;
};

struct soak_clean {
    pthread_mutex_t lock;
    struct soak_clean_frame *ring;
    soak_seq top; /* the last one */
    uint64_t frames, points_frames;
    /* the thread's own */
    struct link_spec link;
    struct scanhead *sh;
    pthread_t thread;
    int running;
    atomic_int want_health;   /* 1: asks the head how it is; 2: it has */
    char idn[256], state[64]; /* as it answered then */
    char sha256[65];
    uint64_t reader_lost;
    int64_t first_points_ns, last_t_ns; /* device time; 0: none so far */
    char failed[256];                   /* why it ended before the head did; empty: it did not */
};

/* ---- one link */

/* A frame of a link. */
struct soak_fact {
    soak_seq seq;
    int there;
    /* what the client saw */
    uint64_t digest;
    uint32_t got, gap, repeated, late;
    int64_t after_ns; /* from the time that the frame itself says to its arrival, by another clock: link->offset_ns */
    int away;         /* there was no session then */
    /* what was done to it */
    int64_t t_ns;
    uint8_t times[FAULT_REFUSE]; /* by kind */
    uint8_t resealed, merged;    /* merged: it went into one datagram with others */
    uint32_t copies, behind, garbage;
    uint32_t cut_to; /* bytes that truncation left; 0: all */
    double for_ms;   /* delay, jitter and stall: the longest */
};

/* Bytes that belong to no frame, as the client noticed them: after the frame of that time. */
struct soak_run {
    int64_t t_ns;
    uint64_t n;
};

struct soak_act {
    enum fault_kind kind;
    int64_t t_ns; /* device time */
};

/* A fault in the head that the client has not noticed yet. */
struct soak_moment {
    enum fault_kind kind;
    uint32_t fault;         /* its number */
    struct fault what;      /* as configured */
    int64_t from_ns, to_ns; /* device time; INT64_MAX: it is at work */
    double for_ms;
};

/* The head's clock, as it last said. */
struct soak_times {
    int have;
    int64_t at_ns, gps_ns; /* device time, GPS time */
    int have_pps;
    int64_t pps_ns, leap_s; /* device time of the last PPS; GPS time less UTC then */
};

struct soak_ask {
    int active;   /* a question is out */
    int settling; /* the library first comes into step, with questions of its own */
    uint32_t n;   /* faults that hit replies since the question went out */
    struct fault_note note[SOAK_MAX_REPLY_NOTES];
    uint32_t echoes; /* noticed since then, and: */
    uint64_t bad_bytes;
    uint64_t others;             /* faults of any other kind since then */
    int64_t ended_ns;            /* clock: when a session last ended, or a client was turned away; 0: not yet */
    char before[SOAK_REPLY_LEN]; /* the last reply that came */
    uint64_t asked, answered, timeouts, wrong, hurt, odd;
    uint32_t next;
};

struct soak_link {
    struct soak *soak;
    uint32_t number; /* from 1 */
    char type[16], endpoint[512];
    char source[192];       /* what the client opens */
    const char *not_soaked; /* why; NULL: it is */
    int usable;             /* 1: it has a client */
    pthread_t thread;
    int running;
    atomic_int done; /* the client has seen the end */

    pthread_mutex_t lock; /* of all that follows */
    struct soak_row row[SOAK_N_ROWS];
    struct soak_fact *fact;
    int begun, in_session;
    soak_seq judged, first, last, top; /* the next to be judged; of the frames received; known of at all */
    uint64_t frames, bytes, refused_frames, sessions, closings, refused;
    uint64_t refused_now;       /* frames since the last one that was taken */
    uint64_t lost_plain;        /* without a fault ... */
    uint64_t reader_lost;       /* ... and those that the head said it left out, as the client was too slow */
    uint64_t wrong_plain;       /* differ from the clean frame without a fault, or came twice */
    uint64_t unknown;           /* the clean reader did not get them */
    uint64_t odd_closings;      /* the connection was closed without a fault */
    int64_t odd_ns, no_open_ns; /* when that last was, and when there was no connection; 0: never */
    uint64_t away;              /* frames that came while there was no session */
    /* Bytes that belong to no frame: noticed, and by the faults. Beside them a reply may be hurt, too. */
    uint64_t bad_bytes, expected_bad_min, expected_bad_max;
    struct soak_run run[SOAK_MAX_RUNS];
    uint32_t n_runs;
    struct soak_act act[SOAK_MAX_ACTS], refusal[SOAK_MAX_ACTS];
    uint32_t n_acts, n_refusals;
    struct fault_note plug[SOAK_MAX_PLUGS]; /* of the enumeration at hand, until a client opens the device */
    uint32_t n_plugs;
    int was_cut; /* an act that keeps clients out for a while may still do so */
    struct soak_moment moment[SOAK_MAX_MOMENTS];
    uint32_t n_moments;
    struct soak_times times;
    int have_pulse;
    uint64_t pulse0;   /* of the last points frame */
    double usual_rate; /* of the mirror, rad/s; 0: not known */
    int64_t last_t_ns; /* device time of the last frame */
    int64_t offset_ns; /* the smallest time from a frame's own to its arrival */
    int have_offset;
    struct soak_ask ask;
    char failed[256];                 /* why the client gave up; empty: it did not */
    uint64_t bad_units;               /* datagrams that are none of the clean ones */
    struct soak_datagrams *datagrams; /* NULL: the link speaks the native protocol */
    /* the client's own */
    struct scanhead *sh;
    char idn[256];
};

/* ---- the whole */

enum soak_phase { SOAK_RUNS, SOAK_DRAINS, SOAK_ENDS };

struct soak {
    const struct config *cfg;
    struct fault_board *board;
    struct soak_clean clean;
    struct soak_link link[CONFIG_MAX_LINKS];
    struct soak_datagrams *datagrams[CONFIG_MAX_LINKS]; /* by link, before the clients are there */
    uint32_t n_links;
    int realtime;
    atomic_int phase;         /* enum soak_phase */
    _Atomic uint64_t until;   /* SOAK_DRAINS: clients go on up to this frame */
    _Atomic uint64_t base;    /* of soak_seq; 0: nothing came so far */
    struct fault_list faults; /* as configured */
    struct loop_stats stats;
    double wall_s;
    int healthy, hash_is_same;
    const char *failures[16];
    uint32_t n_failures;
};

soak_seq soak_seq_of(struct soak *soak, uint32_t seq);

/* ---- clean.c */
int soak_clean_open(struct soak *soak, struct sh_err *err);
int soak_clean_start(struct soak *soak, struct sh_err *err);
/* After the head has ended. */
void soak_clean_join(struct soak *soak);
void soak_clean_close(struct soak *soak);
/* Of the clean stream that the link's is compared with. 0: it is not known (any more, or not yet). */
int soak_clean_get(struct soak_link *link, soak_seq seq, struct soak_clean_frame *out);
soak_seq soak_clean_top(struct soak *soak);
/* Device time of the last frame. */
int64_t soak_clean_t_ns(struct soak *soak);
uint64_t soak_digest(const struct scanhead_frame *frame);

/* ---- client.c */
/* A client for each link that can have one. only: number of the one link; 0: all. */
int soak_clients_open(struct soak *soak, const struct loop *loop, uint32_t only, struct sh_err *err);
int soak_clients_start(struct soak *soak, struct sh_err *err);
void soak_clients_join(struct soak *soak);
void soak_clients_close(struct soak *soak);

/* ---- datagrams.c */
/* Receives what a link sends, and what a second link of the same protocol will send, which is to be opened beside it.
 * NULL: it can't. */
struct soak_datagrams *soak_datagrams_open(const struct link_spec *spec, struct link_spec *twin);
void soak_datagrams_close(struct soak_datagrams *datagrams);
int soak_datagrams_get(const struct soak_datagrams *datagrams, soak_seq seq, struct soak_clean_frame *out);
void soak_datagrams_step(struct soak_link *link);
/* Takes what is on its way still. */
void soak_datagrams_finish(struct soak_link *link);
uint64_t soak_datagrams_top(struct soak_link *link);
soak_seq soak_unit(uint64_t number);

/* ---- usb.c */
/* Whether the link's device is attached to this machine, and has the native stream. */
int soak_usb_is_here(const struct link_spec *spec);
/* Gives it a serial number where none is configured, so that its client can name it. number: of the link, from 1. */
void soak_usb_name(struct link_spec *spec, uint32_t number);
/* What its client opens. */
void soak_usb_source(const struct link_spec *spec, char *source, size_t len);
/* A fault of an enumeration, as it begins; the caller has the link's lock. */
void soak_usb_plugged(struct soak_link *link, const struct fault_note *note);
/* The client has opened the device. Notes what it noticed of the enumeration, by the time that this took. */
void soak_usb_opened(struct soak_link *link, double opened_ms);
/* No client will notice them; the caller has the link's lock. */
void soak_usb_forget(struct soak_link *link, const char *why);

/* ---- ask.c */
/* Asks the next question, and judges its answer. */
void soak_ask_next(struct soak_link *link);
/* Sees to it that the head scans. */
void soak_ask_scan(struct soak_link *link);

/* ---- ledger.c */
/* The listener of the board. */
void soak_heard(void *soak, const struct fault_note *note);
void soak_saw_frame(struct soak_link *link, const struct scanhead_frame *frame, int64_t now_ns);
/* A datagram; the caller has the link's lock. */
void soak_saw_unit(struct soak_link *link, soak_seq seq, uint64_t digest, uint32_t len);
void soak_saw_notice(void *link, const struct scanhead_notice *notice);
/* A connection came about; it ended; it did not even begin. */
void soak_saw_open(struct soak_link *link);
void soak_saw_end(struct soak_link *link);
void soak_saw_no_open(struct soak_link *link);
struct soak_fact *soak_fact_at(struct soak_link *link, soak_seq seq); /* NULL: not known */
void soak_hide(struct soak_row *row, uint64_t n, const char *why);

/* ---- head.c: the caller of the first three has the link's lock */
void soak_heard_head(struct soak_link *link, const struct fault_note *note);
/* Its client's first frame. */
void soak_head_begins(struct soak_link *link, const struct scanhead_frame *frame);
/* A power cycle that began before that device time, and was not noticed, is. 0: there is none. */
int soak_saw_power_go(struct soak_link *link, int64_t before_ns);
void soak_saw_inside(struct soak_link *link, const struct scanhead_frame *frame);
void soak_saw_state(struct soak_link *link, const char *state);
int soak_is_head_seen(struct soak_link *link);
/* At the end. */
void soak_judge_head(struct soak_link *link);

/* ---- judge.c */
/* Judges the frames about which no more news will come. With `all` those up to the end, too. The caller has the link's
 * lock. */
void soak_judge(struct soak_link *link, int all);

/* ---- sheet.c */
/* Fills soak->failures. */
void soak_conclude(struct soak *soak);
void soak_print(const struct soak *soak, FILE *out);
void soak_put(struct json *json, const void *soak);
/* A line on standard error. */
void soak_say_progress(struct soak *soak, double s);

#endif
