/* SPDX-License-Identifier: MIT */
/* A SCIP session: what scip.c, scip_command.c, scip_info.c, scip_measure.c and scip_simulate.c share. Not for
 * others. Device times in ns; a status is two characters. */
#ifndef DRIVERS_PROTOCOL_SCIP_SESSION_H
#define DRIVERS_PROTOCOL_SCIP_SESSION_H

#include "drivers/protocol/planar_scan.h"
#include "drivers/protocol/protocol.h"
#include "drivers/protocol/scan_wish.h"
#include "drivers/protocol/scip_model.h"
#include "drivers/protocol/scip_reply.h"

/* A G, H, M or N command that waits for scans. */
struct scip_request {
    int active;
    char echo[SCIP_MAX_LINE];
    size_t echo_len;
    int n_chars, intensity, multi_echo;
    int time_us;        /* %MD %ME: its times are in microseconds */
    int32_t start, end; /* steps, both included */
    int32_t cluster;    /* steps that become one value, 1 and more */
    uint32_t skip;      /* scans left out before each that is sent */
    uint32_t count;     /* scans in all; 0: endless */
    uint32_t remaining, skipped, sent;
    int64_t after_ns; /* step 0 of its scans is at this time or later */
    int64_t until_ns; /* G, H: answered by then */
};

/* DB: the malfunction that is simulated. */
struct scip_simulation {
    int mode;           /* of DB: 2 to 5; 0: none */
    int broken;         /* the laser is out of order */
    uint32_t n_waiting; /* scans since processing was stopped to verify the error; 0: it was not */
};

struct scip {
    struct protocol_spec spec;
    const struct scip_model *model;
    uint32_t features; /* enum scip_feature: those of the model with this firmware */
    int64_t now_ns;
    int64_t epoch_ns, epoch_us_ns; /* when the time stamps are 0: that in ms, and that in us */
    int64_t laser_ns;              /* since when the laser is on */
    int64_t try_ns;                /* when to look at the head again for a request that waits for its first scan */
    int laser, time_mode, asleep;
    uint32_t bit_rate;
    int64_t rb_ns, reboot_ns; /* time of the last single RB; time of the reboot that RB RB asked for; INT64_MIN: none */
    struct scip_request stream, single;
    struct scan_wish wish; /* of stream */
    struct scip_simulation simulation;
    /* the line at hand */
    char line[SCIP_MAX_LINE];
    size_t n_line;
    int is_over; /* it has more bytes than fit; they are counted already */
    int foul;    /* a byte that is not printable was in it */
    struct planar_scan scan;
    struct scip_reply reply;
};

/* scip.c */
uint32_t scip_time_ms(const struct scip *s, int64_t t_ns);
uint64_t scip_time_us(const struct scip *s, int64_t t_ns);
/* Sends the reply at hand, after ending it. */
void scip_send(struct scip *s);
/* A whole reply without data. Counts what is an error. */
void scip_answer(struct scip *s, const char *echo, size_t len, const char *status);

/* scip_command.c: carries out the line at hand. */
void scip_command(struct scip *s);
/* A command of the line at hand. Returns the status of the reply to it; NULL: it has replied by itself. */
typedef const char *scip_handler(struct scip *s);
/* Reads len decimal digits; -1: another character is among them. */
int32_t scip_number(const char *text, size_t len);

/* scip_info.c: VV, PP, II, %ST. */
/* Whether the head boots, or has no power. */
static inline int scip_boots(enum protocol_head_state head)
{
    return head == PROTOCOL_HEAD_BOOT || head == PROTOCOL_HEAD_OFF;
}
scip_handler scip_info_version, scip_info_parameters, scip_info_state, scip_info_state_number;
/* Returns lines per second in 1e-6 Hz. query: HEAD:LINES? (the present rate), or HEAD:LINES? DEF (that at power-up). */
uint64_t scip_lines_uhz(struct scip *s, const char *query);
/* A range in whole millimetres, rounded; 0 where it is not above 0, or not below 4000 km. */
uint32_t scip_millimetres(double range_m);

/* scip_measure.c */
/* 0: there is no head yet, or it has steps that no command can name. */
int scip_has_head(const struct scip *s);
/* Switches the laser on, for BM and for commands that imply it. Returns NULL, or the status to refuse with: 10 while
 * the head can't scan, 50 while it is out of order. */
const char *scip_laser_on(struct scip *s);
/* Ends stream and laser; a G or H that waits is answered with status 10. */
void scip_laser_off(struct scip *s);
scip_handler scip_measure;
/* Answers requests with the scans at hand. */
void scip_scans_came(struct scip *s, struct planar_news news);
/* Serves a request that waits: starts the head again if it has stopped meanwhile, and ends a G or H that waited too
 * long. */
void scip_measure_time(struct scip *s);

/* scip_simulate.c */
scip_handler scip_simulate;
/* Is called before each scan of the stream. NULL: the scan is sent; "": nothing is sent; else this status is sent in
 * its place, and 50 ends the stream. */
const char *scip_simulated(struct scip *s);

#endif
