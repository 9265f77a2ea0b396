/* SPDX-License-Identifier: MIT */
/* An injected fault as data: what goes wrong, where, and when.
 *
 * In: a fault of the list, and a place where it may strike (a frame, a reply, a connection, a moment of the head).
 * Out: whether it strikes there, and random numbers that belong to that place. Pure; any thread.
 *
 * All numbers count from 1. Times are device time in seconds from power-up, or from the command that added the
 * fault. */
#ifndef FIRMWARE_SIM_FAULT_FAULT_H
#define FIRMWARE_SIM_FAULT_FAULT_H

#include <stddef.h>
#include <stdint.h>

enum { FAULT_MAX = 32 };

enum fault_kind {
    /* on the wire: of a frame of the native protocol, or a unit of another (a datagram, a packet, a telegram) */
    FAULT_DROP,
    FAULT_DUPLICATE, /* n copies more */
    FAULT_REORDER,   /* comes after up to n later ones */
    FAULT_DELAY,     /* it comes for_ms later; none overtakes it */
    FAULT_JITTER,    /* the same, by a random time of up to for_ms */
    FAULT_TRUNCATE,  /* its last n bytes are missing; n = 0: a random number */
    FAULT_FLIP,      /* n bits change, at `byte` or anywhere; reseal: its checksums are made right again */
    FAULT_STALL,     /* nothing is written for for_ms before it */
    FAULT_SPLIT,     /* it goes out in n writes */
    FAULT_MERGE,     /* it and the next n - 1 go out in one write */
    FAULT_GARBAGE,   /* n random bytes before it */
    /* on the wire: of a reply to a client */
    FAULT_NO_REPLY,
    FAULT_LATE_REPLY,  /* by for_ms; frames overtake it */
    FAULT_WRONG_REPLY, /* the reply before it comes instead */
    FAULT_ECHO,        /* the client's line comes back before its reply */
    /* of the link, at a frame: for all its sessions where not said otherwise */
    FAULT_DISCONNECT,     /* the session at hand ends before the frame */
    FAULT_UNPLUG,         /* the link is not there for for_ms */
    FAULT_CABLE,          /* nothing comes or goes for for_ms; reset: what was connected is reset after that */
    FAULT_USB_RESET,      /* the bus is reset */
    FAULT_ENDPOINT_STALL, /* the endpoint of the stream is halted, until the host clears it */
    FAULT_SHORT_PACKETS,  /* each of the next n transfers ends early, and goes on in the next */
    /* of the link, at a connection (USB: at an enumeration) */
    FAULT_REFUSE,            /* a client is turned away */
    FAULT_SLOW_ENUMERATION,  /* each control request takes for_ms */
    FAULT_DESCRIPTOR_LENGTH, /* the configuration says that it is n bytes longer than it is */
    /* in the head: these change what is measured, or what the head says of the time and of its state */
    FAULT_SLOW_BOOT,     /* takes for_ms longer */
    FAULT_POWER_CYCLE,   /* everything is off for for_ms, and boots again */
    FAULT_SELF_TEST,     /* fails at the end of boot */
    FAULT_MIRROR_SLOW,   /* turns at `factor` of its speed */
    FAULT_MIRROR_STUCK,  /* stands where it is */
    FAULT_MIRROR_WOBBLE, /* swings about its even turn by deg, hz times a second; the encoder shows it */
    FAULT_PAN_SLIP,      /* the head looks deg farther than the pan's encoder says */
    FAULT_LASER_OFF,
    FAULT_WINDOW_SOILED, /* loss_db on the way there and back; noise grows as the signal fades */
    FAULT_CLOCK_JUMP,    /* the time of day, by jump_s */
    FAULT_CLOCK_DRIFT,   /* gains ppm */
    FAULT_CLOCK_STOP,
    FAULT_PPS_LOST,
    FAULT_PPS_JITTER,      /* the first pulse and every second one after it are late by for_ms */
    FAULT_NMEA_LOST,       /* the receiver sends no sentence */
    FAULT_NMEA_LATE,       /* by for_ms */
    FAULT_NMEA_VOID,       /* it has no fix */
    FAULT_NMEA_CHECKSUM,   /* its sentences have wrong checksums */
    FAULT_PTP_LOST,        /* nothing comes from the master; the clock gains ppm meanwhile */
    FAULT_PTP_NO_SYNC,     /* the same, but its Announce messages come */
    FAULT_PTP_FAULTY,      /* the port is faulty; the clock gains ppm meanwhile */
    FAULT_PTP_GRANDMASTER, /* another one is better; its time is ahead by ns */
    FAULT_PTP_STEP,        /* the master's time is ahead by ns */
    FAULT_PTP_ASYMMETRY,   /* the way from the master is longer than the mean by ns */
    FAULT_PTP_JITTER,      /* of each measurement, up to ns to either side */
    FAULT_LEAP_SECOND,     /* at the end of the minute at hand; no table has it */
    FAULT_COUNTERS_HIGH,   /* counters begin n below their wrap at power-up */
    /* the answer of a SICK scanner's time server is: */
    FAULT_NTP_SILENT, /* nothing */
    FAULT_NTP_KISS,   /* DENY */
    FAULT_NTP_UNSYNC, /* that it is not synchronised */
    FAULT_NTP_STEP,   /* a time that is ahead by jump_s */
    FAULT_N_KINDS
};

/* The place where a kind strikes. */
enum fault_place {
    FAULT_AT_FRAME,      /* at frames, or units */
    FAULT_AT_REPLY,      /* at replies */
    FAULT_AT_CONNECTION, /* at connections */
    FAULT_AT_MOMENT      /* in the head, in device time */
};

/* Frames of the stream, notices (telemetry, events, repetitions) and replies are numbered separately. A fault of frames
 * counts either frames of the stream or notices: the member `of` of struct fault says which. */
enum fault_of { FAULT_OF_STREAM, FAULT_OF_NOTICES, FAULT_OF_REPLIES, FAULT_N_OF };

struct fault {
    enum fault_kind kind;
    uint32_t link; /* from 1; 0: all that can have it */
    int of;        /* enum fault_of, without replies */
    /* when: all of these together */
    uint64_t at;          /* one number alone; 0: not given */
    uint64_t from, until; /* numbers; until 0: no end */
    uint64_t every;       /* from `from` on */
    double probability;
    /* The fault strikes at most so often; 0: no limit. The limit is for each session. For acts of the link
     * (fault_is_act), and for faults at connections, it is for the link. */
    uint64_t count;
    uint64_t from_pulse, until_pulse; /* of a scan, from 0; until UINT64_MAX: no end. Other frames have no pulses */
    double from_s, until_s;           /* until 0: no end */
    uint64_t seed;
    /* what: as the kinds say */
    uint32_t n;   /* 0: the kind's own */
    int64_t byte; /* from 0; -1: any */
    int reseal, reset;
    double for_ms;
    double factor, deg, hz, loss_db, jump_s, ppm, ns;
    uint64_t grandmaster; /* its identity */
    uint32_t clock_class;
};

struct fault_list {
    struct fault fault[FAULT_MAX];
    uint32_t n;
};

/* A place where faults may strike. */
struct fault_spot {
    uint64_t number; /* of the frame, reply or connection; 0: it has none */
    int64_t t_ns;    /* device time */
    int has_pulses;
    uint64_t pulse0, n_pulses; /* of the frame */
};

extern const char *const fault_names[]; /* by kind, NULL at the end */
enum fault_place fault_place_of(enum fault_kind kind);
/* Whether the kind is an act of the link, at a frame: disconnect to short_packets. */
int fault_is_act(enum fault_kind kind);
/* The kind by which a link carries out an act. acts: those that it can do; bit 0 is FAULT_DISCONNECT, and so on. For a
 * link that can't fall silent, a pulled cable is an unplugging. */
enum fault_kind fault_act_of(enum fault_kind kind, uint32_t acts);
/* Returns n; if that is 0, the default of the kind. */
uint32_t fault_n(const struct fault *fault);

/* Whether the fault strikes there, without regard to its count. index: in the list; link: the spot's. */
int fault_strikes(const struct fault *fault, uint32_t index, uint32_t link, const struct fault_spot *spot);
/* Returns a random number that belongs to fault and place; `draw` tells the draws of one place apart, from 1. */
uint64_t fault_random(const struct fault *fault, uint32_t index, uint32_t link, uint64_t number, uint32_t draw);

#endif
