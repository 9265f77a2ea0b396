/* SPDX-License-Identifier: MIT */
/* The command set: one SCPI-style line in, one reply line out, and the error queue of SCPI-99 (21.8).
 *
 *   common    *IDN?  *RST  *CLS  *OPC?  *STB?  HELP?  HELP:SETtings?
 *   system    SYSTem:ERRor[:NEXT]?  SYSTem:ERRor:COUNt?  SYSTem:LOST?  SYSTem:VERSion?  SYSTem:PLAN?  SYSTem:SESSion?
 *             SYSTem:CONTrol?  SYSTem:CONTrol:WHO?  SYSTem:CONTrol:TAKE  SYSTem:CONTrol:RELease
 *   head      HEAD:PRR  HEAD:LINes  HEAD:PAN  HEAD:STATION  HEAD:STATe?  HEAD:STORe  HEAD:REBoot
 *             HEAD:RANGe:MIN  HEAD:RANGe:MAX  HEAD:NOISe  HEAD:NOISe:ANGLe  HEAD:NOISe:SIGMa  HEAD:NOISe:BALL
 *             HEAD:PHASe  HEAD:PHASe:LOCK  HEAD:PHASe:EDGE?
 *   scan      SCAN:STARt  SCAN:STOP  SCAN:COUNt?  SCAN:FRAMes  SCAN:ECHoes  SCAN:WAVeform
 *             SCAN:LINE:STARt  SCAN:LINE:STOP  SCAN:PAN:STARt  SCAN:PAN:STOP
 *             SCAN:STEP  SCAN:STEP:LINE  SCAN:STEP:PAN  SCAN:REPLay
 *   site      SITE:POSE
 *   fault     FAULt:ADD  FAULt:CLEar  FAULt:LIST?  FAULt:INJected?
 *   time      TIME?  TIME:UTC?  TIME:GPS?  TIME:PTP?  TIME:STEP  TIME:SHIFt  TIME:SERVer
 *
 * Headers have a short form (the capitals) and a long one, in any case. HEAD:STATION has no short one: STAT
 * is STATe. A query ends in '?'. Each setting has a command and a query.
 *
 * Values. A number may be MIN, MAX or DEF, and so may the parameter of a setting's query ("HEAD:PRR? MAX").
 * MIN and MAX are the limits as the profile and the other settings leave them now, so they are never refused.
 * A unit may follow as a suffix: HZ, KHZ, MHZ (mega, as in SCPI); DEG; DEG/S; M, MM, KM; for a step of time NS (the
 * default), US, MS, S. Numbers are taken exactly or refused, never rounded; only SCAN:STEP sets the nearest rates,
 * and its reply is the step that they give. SCAN:ECHoes takes ALL, FIRSt, LAST, STRongest or DEF: these echoes of a
 * pulse are sent. On a head with fixed pulse rates HEAD:PRR takes only these; another rate is -222 with the list of
 * them.
 *
 * New ranges and noise hold from the next scan on; they can't change within a scan. The same is true of the step of a
 * head whose emitter is a sphere, or is planar with several geometries (pairs of a line rate and a step).
 *
 * Stations. HEAD:STATION takes stations that have this scanner; a station with another scanner is -221.
 *
 * `SITE:POSE station, x, y, z, heading, pitch, roll` moves a station of this scanner while the head is idle: metres of
 * the scene frame, degrees as the keys of a station. `SITE:POSE station, DEF` brings it back to its place at power-up.
 * `SITE:POSE? station` replies with its place; with `, MIN`, `, MAX` or `, DEF` it replies with the limits or the place
 * at power-up. A reply can be sent back as a command.
 *
 * Steps. With a live platform a step may carry the pose at its end: `TIME:STEP 10 MS, x, y, z, roll, pitch,
 * heading`, in metres of the scene frame and degrees (core/pose.h).
 *
 * Faults. `FAULt:ADD {kind: drop, every: 10}` adds a fault, written as in the configuration's list `faults`. The fault
 * counts from then on, and the reply is its number. `FAULt:CLEar 3` or `ALL` takes faults out. `FAULt:INJected?`
 * replies with how often faults struck; with a number, how often that one did. `FAULt:LIST?` lists the faults.
 *
 * Replays. `SCAN:REPLay 12.5, 2, ON` plays a recording from 12.5 s after its first frame on, at twice its speed, and
 * anew at its end. Fields may be left empty, and stay as they are then; speed 0 pauses. The query replies with PLAYING
 * or IDLE, time, length (0: not known), speed and loop; a head replies NONE.
 *
 * Replies. The value, or "OK", or `ERR -222,"Data out of range; HEAD:PRR 5000000 Hz, allowed 1000 to
 * 1200000"`. A value outside of the profile is -222. A value that another setting or the state forbids is -221.
 * *STB?: 4: errors are queued; 128: the head scans. *CLS, like SYSTem:ERRor?, needs no control.
 *
 * Pure: no clock, no I/O, no thread. The loop owns the device, calls from one thread, and carries out the
 * effect. */
#ifndef FIRMWARE_SIM_COMMAND_COMMAND_H
#define FIRMWARE_SIM_COMMAND_COMMAND_H

#include <stddef.h>
#include <stdint.h>

#include "firmware_sim/command/head.h"

enum {
    COMMAND_MAX_LINE = 256, /* of a line without its end; a longer one is -363 and dropped whole */
    COMMAND_MAX_REPLY = 500,
    COMMAND_QUEUE_LEN = 32, /* errors kept; in a full queue the last one becomes -350 and counts the rest */
};

enum command_error {
    CMD_E_NONE = 0,
    CMD_E_SYNTAX = -102,
    CMD_E_DATA_TYPE = -104,
    CMD_E_NOT_ALLOWED = -108,
    CMD_E_MISSING = -109,
    CMD_E_HEADER = -113,
    CMD_E_SUFFIX = -131,
    CMD_E_PROTECTED = -203, /* another session has control */
    CMD_E_SETTINGS = -221,  /* conflicts with the state or another setting */
    CMD_E_RANGE = -222,
    CMD_E_SELF_TEST = -330,
    CMD_E_QUEUE = -350,
    CMD_E_OVERRUN = -363,
    /* the device's own, positive (SCPI-99 21.8.2) */
    CMD_E_CLIENT_LOST = 101, /* a client went away */
    CMD_E_READER = 102,      /* a reader could not follow; frames lost */
    CMD_E_PULSES = 103,      /* the head could not keep up; pulses lost */
    CMD_E_REFUSED = 104,     /* a client was turned away: all sessions taken */
    CMD_E_PARTIAL = 105,     /* a client went away in the middle of a command */
    CMD_E_LINES = 106,       /* lines of a file were dropped: it is too slow, or full */
    CMD_E_TIME = 107,        /* the time server does not answer, or its answer is refused */
};

struct command_queue {
    struct {
        int number;
        char text[400];
    } entry[COMMAND_QUEUE_LEN];
    uint32_t first, count, overflow;
};

/* Puts number and text (may be NULL) in the queue: `number,"<standard text>; <text>"`. */
void command_queue_push(struct command_queue *queue, int number, const char *text);
/* Takes the oldest as `number,"text"`; `0,"No error"` when empty. */
void command_queue_pop(struct command_queue *queue, char *buf, size_t len);
const char *command_error_text(int number);

/* Where a station stands: x, y, z (m, scene frame), heading, pitch, roll (degrees). */
struct command_place {
    double v[6];
};

/* The operations on injected faults, which their owner provides. */
struct command_faults {
    /* text: "{kind: drop, every: 10}". Returns 0 and the fault's number, or -1 and why not. */
    int (*add)(void *owner, const char *text, uint32_t *number, char *why, size_t len);
    uint32_t (*remove)(void *owner, uint32_t number); /* 0: all. Returns how many */
    /* How often so far; 0: all together. Returns 0, or -1: there never was one of that number. */
    int (*injected)(void *owner, uint32_t number, uint64_t *n);
    /* "1 drop, 2 flip"; empty: none. Faults without room are counted at the end: ", and 3 more". */
    void (*list)(void *owner, char *text, size_t len);
};

/* The time server that a SICK scanner asks. The words of TIME:SERVer are in the order of the numbers. */
enum command_time_role { COMMAND_TIME_NONE, COMMAND_TIME_CLIENT, COMMAND_TIME_SERVER };
struct command_time_server {
    uint32_t role;      /* enum command_time_role */
    uint32_t interface; /* 0: Ethernet; 1: CAN, where no server is asked */
    uint8_t address[4];
    uint32_t update_s; /* from request to request */
    int32_t zone_h;    /* how far local time is ahead of UTC */
    uint32_t n_roles;  /* how often the role has changed, also where it changed and changed back */
};
/* The time server's answers since power-up. */
struct command_time_answers {
    int64_t max_offset_ns;       /* once the clock is set, an answer that is farther from it is refused */
    int64_t offset_ns, delay_ns; /* of the last answer that set the clock */
    uint64_t good, refused, none;
    const char *state; /* one word; NULL: OFF */
};

/* The sessions' clients by kind of link and address, "tcp 127.0.0.1:40312"; empty: not known. Sessions count from 1.
 * There are 8 on each of 9 links, one of which is the page's (STREAM_MAX_LINKS). */
enum { COMMAND_PEERS = 73, COMMAND_PEER_LEN = 80 };
struct command_peers {
    char name[COMMAND_PEERS][COMMAND_PEER_LEN];
};

/* The phase of a rotor at the last pulse per second. */
struct command_phase {
    int is_known;      /* 1: a pulse has come since the rotor turns */
    int is_held;       /* 1: the rotor was then within 0.01 degree of the lock's azimuth */
    int64_t edge_udeg; /* its azimuth then */
};

/* The recording that is replayed. Times count from its first frame. */
struct command_replay {
    int is_there;            /* 0: a head, or a capture of packets */
    int plays;               /* after the last command, which may not have been carried out yet */
    double position_s;       /* of the frame that was sent last */
    double length_s;         /* 0: not known */
    double speed;            /* 0: it is paused */
    const char *fixed_speed; /* why the speed does not change; NULL: it may */
    int loop;
};
/* Where a value is negative, that part stays as it is. */
struct command_replay_change {
    double position_s, speed;
    int loop;
};

/* These two constants stand for the value of a setting that is not in the recording. */
#define COMMAND_NOT_RECORDED     INT64_MIN
#define COMMAND_NOT_RECORDED_U32 UINT32_MAX

/* The device as the command set sees it. The loop keeps it up to date. */
struct command_device {
    const char *idn;
    const char *plan; /* the methods in use, in one line; NULL: not known */
    struct head_limits limits;
    struct command_phase phase;
    /* Whether a scan can be planned with these settings, whose values are within the limits. Returns 0, or -1 and why
     * not. NULL: all can. */
    int (*can_plan)(void *owner, const struct head_settings *settings, char *why, size_t len);
    void *owner;
    const struct command_faults *faults; /* NULL: it has none */
    void *faults_owner;
    struct head_settings settings; /* as they are now; a refused command leaves them */
    struct head_settings defaults; /* what *RST restores */
    enum head_state state;
    int stops; /* 1: the state is spin-down by a command, and the scan's last pulses are still on their way */
    const char *why_fault; /* why the state is fault, and what ends it; NULL: not known */
    struct command_queue queue;
    uint32_t control; /* session that has control; 0: none, and the next one that changes something takes it */
    struct command_peers peers;
    uint64_t frames_done;                          /* of the scan at hand or the last one */
    uint64_t lost_journal_lines, lost_truth_lines; /* lines that these files lack */
    int64_t t_ns;                                  /* device time */
    char utc[40], gps[40]; /* the same as time of day, by the clock of the head; empty: unknown */
    char ptp[128];         /* its PTP follower then; empty: it has none */
    struct command_time_server server, server_default, server_configured; /* now; at power-up; of the configuration */
    int asks_server; /* 1: the loop can ask a time server, so TIME:SERVer may be CLIENT */
    struct command_time_answers answers;
    int64_t shift_ns;                        /* how far the scanner's clock is ahead of that of power-up */
    int keeps;                               /* 1: the head can keep settings without power */
    int step_allowed;                        /* 1 when the pace is `step` */
    int pose_allowed;                        /* 1 when the platform is live: a step may carry a pose */
    int poses_replayed;                      /* but not while a journal that is being replayed has the poses */
    double pose_centre_m[3], pose_reach_m;   /* the pose must be within pose_reach_m of the centre; scene frame */
    const struct command_place *place;       /* [limits.n_stations] as they are now; NULL: not known */
    const struct command_place *first_place; /* at power-up */
    struct command_replay replay;
    const char *recorded; /* a recording is replayed: why no setting changes; NULL: none is */
    int is_played;        /* the recording is playing, whatever its head's state was: SCAN:STOP ends it */
    const char *fixed;    /* why no station can be moved; NULL: they can */
    uint32_t moving;      /* the station that is being moved; 0: none. Meanwhile no scan starts */
};

enum command_effect {
    COMMAND_NONE,
    COMMAND_SETTINGS, /* settings changed */
    COMMAND_START,    /* state event START was accepted by head_next_state */
    COMMAND_STOP,
    COMMAND_RESET,   /* settings are the defaults again; state event RESET accepted */
    COMMAND_REBOOT,  /* power goes for a moment; state event POWER_OFF accepted */
    COMMAND_STORE,   /* settings are now those of power-up, and are to be kept */
    COMMAND_STEP,    /* let step_ns of device time pass, then send the reply */
    COMMAND_MOVE,    /* move a station; the reply is that of success */
    COMMAND_TAKE,    /* control was taken; nothing else has changed */
    COMMAND_FAULTS,  /* faults were added or taken out */
    COMMAND_CLOCK,   /* the scanner's clock was set */
    COMMAND_SERVER,  /* its time server has changed */
    COMMAND_REPLAY,  /* a recording goes on at another time or speed, or its loop was set */
    COMMAND_RELEASE, /* control was given back */
};

struct command_result {
    enum command_effect effect;
    int for_next_scan; /* COMMAND_SETTINGS: this value can't change within a scan, and holds from the next one on */
    int64_t step_ns;
    int have_pose;
    double pose[6];   /* of the platform at the end of the step: x, y, z (m), roll, pitch, heading (degrees) */
    uint32_t station; /* that is moved, from 1 */
    int to_first;     /* it goes back to its place at power-up; else to `place` */
    struct command_place place;
    struct command_replay_change replay;
    int error;                     /* 0, or the number that was queued */
    int took_control;              /* this command gave the session control */
    int changes;                   /* belongs in the journal: effect is not NONE, TAKE or RELEASE */
    char reply[COMMAND_MAX_REPLY]; /* one line without its end; empty for an empty line (no reply at all) */
};

/* Carries out one line (without its end) from a session. Sessions count from 1; 0 is the device itself, which
 * is never refused control. In dev it changes settings, defaults, server, server_default, shift_ns, queue and
 * control; the loop changes state. A change of settings that is refused (-222, -221) leaves them as they were.
 * While scanning, a change of station is -221. */
void command_execute(struct command_device *dev, uint32_t session, const char *line, struct command_result *out);

void command_set_peer(struct command_device *dev, uint32_t session, const char *name);
/* Returns the name that command_set_peer gave to a session's client; empty: none. */
const char *command_peer(const struct command_device *dev, uint32_t session);

/* Work that a command began could not be done: puts the error into the queue, and makes it the command's reply. */
void command_refuse(struct command_device *dev, int number, const char *text, struct command_result *out);

/* Collects bytes into lines: LF, CR or CR LF end a line. */
struct command_lines {
    char buf[COMMAND_MAX_LINE + 1];
    size_t len;
    int overrun, last_cr;
};
enum command_line_kind { COMMAND_LINE_NONE, COMMAND_LINE_READY, COMMAND_LINE_OVERRUN };
/* Takes one byte. READY: the line is in buf, NUL-terminated, until the next call. OVERRUN: a line that was too long has
 * ended, and buf is empty. A tab becomes a blank. Any other byte that is not printable ASCII becomes '~', which is in
 * no command: the line is then a wrong command. */
enum command_line_kind command_lines_feed(struct command_lines *lines, unsigned char byte);

#endif
