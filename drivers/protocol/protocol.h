/* SPDX-License-Identifier: MIT */
/* Protocols: what a head speaks on a link. Native frames of the stream, bytes from a client and device time go
 * in; units for the client and calls on the device come out.
 *
 * Each protocol has one `const struct protocol_ops` in one of the files of this folder. The struct's members are the
 * contract, and protocol.c has the list. Each session of a link has an instance of its own. A protocol does no I/O and
 * has no clock: a test drives it from bytes to bytes with a struct protocol_host of its own. One thread makes all calls
 * on an instance. Nothing is allocated after protocol_create().
 *
 * A unit is what must stay together: a datagram on udp, a transfer on USB (which a short packet ends). On byte
 * streams units follow each other without a mark. */
#ifndef DRIVERS_PROTOCOL_PROTOCOL_H
#define DRIVERS_PROTOCOL_PROTOCOL_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"
#include "drivers/protocol/nmea.h"

enum protocol_id {
    PROTOCOL_NATIVE,
    PROTOCOL_NMEA,
    PROTOCOL_SCIP,              /* Hokuyo */
    PROTOCOL_COLA,              /* SICK: CoLa-A and CoLa-B on one port */
    PROTOCOL_VELODYNE,          /* data packets */
    PROTOCOL_VELODYNE_POSITION, /* position packets */
    PROTOCOL_VELODYNE_HTTP,     /* settings */
    PROTOCOL_CAPTURE,           /* what a device said in a capture (talk.h) */
    PROTOCOL_N
};

/* Requirements of a protocol on the stream. */
enum protocol_needs {
    PROTOCOL_NEEDS_POLAR = 1 << 0, /* output.layout: polar */
    PROTOCOL_NEEDS_TIME = 1 << 1,  /* time.epoch is not none */
    PROTOCOL_NEEDS_PLACE = 1 << 2, /* each station has a place on the Earth */
    PROTOCOL_NEEDS_LAST = 1 << 3,  /* beam.echoes is not first */
};

/* States of the pulses per second that the head's clock follows. The values are those of a VLP-16. */
enum protocol_pps {
    PROTOCOL_PPS_ABSENT,
    PROTOCOL_PPS_SYNCHRONISING,
    PROTOCOL_PPS_LOCKED,
    PROTOCOL_PPS_ERROR, /* they come at other times than the clock's full seconds */
};

/* The dialect that a link speaks. */
enum protocol_dialect {
    PROTOCOL_DIALECT_ANY, /* all of them: an answer has that of its request */
    PROTOCOL_COLA_A,
    PROTOCOL_COLA_B,
};

/* States of the head, in the order of telemetry. */
enum protocol_head_state {
    PROTOCOL_HEAD_UNKNOWN = -1,
    PROTOCOL_HEAD_OFF,
    PROTOCOL_HEAD_BOOT,
    PROTOCOL_HEAD_IDLE,
    PROTOCOL_HEAD_SPIN_UP,
    PROTOCOL_HEAD_SCANNING,
    PROTOCOL_HEAD_SPIN_DOWN,
    PROTOCOL_HEAD_FAULT
};

/* Counts of a session, besides the frames it lost. */
enum protocol_count {
    PROTOCOL_UNITS_LOST,    /* units that were not sent: no room, or parts of them were missing */
    PROTOCOL_INPUT_LOST,    /* bytes from the client that were thrown away: overlong, outside of telegrams, garbage */
    PROTOCOL_WRONG,         /* requests that were answered with an error */
    PROTOCOL_POINTS_LOST,   /* echoes sent as "no echo": the protocol has no number for their range */
    PROTOCOL_PULSES_UNSENT, /* pulses that went into no unit, though the reader was not too slow: their unit never got
                             * full, or the protocol can't express them */
    PROTOCOL_N_COUNTS
};

/* Services of a session's owner for its protocol. ctx is the owner's. All of them may be called from within any
 * op but begin and end. */
struct protocol_host {
    void *ctx;
    /* Queues one unit for the client, whole or not at all. 0; or 1: the unit is lost, since there is no room, an
     * earlier unit has waited for too long, or hang_up was called. The owner counts units that are lost before
     * hang_up. */
    int (*send)(void *ctx, const void *unit, size_t len);
    /* Carries out one line of the native command set (COMMANDS.md), "HEAD:LINES 20" for example, as this
     * session, which then releases control. reply (cap PROTOCOL_REPLY; or NULL and 0: not looked at) gets the reply
     * line without its end. Returns 0, or the SCPI error number. */
    int (*command)(void *ctx, const char *line, char *reply, size_t cap);
    /* The last fix of the GNSS receiver at or before a device time. Returns 1, or 0: there is none (no time, or no fix
     * since power-up). Quality 0 where the head has no place on the Earth. */
    int (*fix)(void *ctx, int64_t t_ns, struct nmea_fix *fix);
    /* Counts n. */
    void (*count)(void *ctx, enum protocol_count what, uint64_t n);
    /* Ends the session once what was sent has gone out. A pty or a USB device has no way to end a session: there
     * nothing happens. */
    void (*hang_up)(void *ctx);
    /* Device time at which the receiver's first fix at or after t_ns is known; INT64_MAX: the receiver has none. A time
     * that lies ahead may still change: asked again, the answer may be a later time. */
    int64_t (*next_fix_ns)(void *ctx, int64_t t_ns);
    /* Returns the state of the receiver's pulses per second at a device time. *hour_ns is the head's time since the top
     * of the hour at that time. Pulses set this time's fraction of a second, and sentences its minutes and seconds.
     * Until they do, the time counts from power-up. */
    enum protocol_pps (*pps)(void *ctx, int64_t t_ns, int64_t *hour_ns);
    /* The date by the device's own clock (COMMANDS.md, TIME:SHIFt) at a device time, ns since 1970. Until somebody has
     * set the clock, the date is UTC, or the time since power-up. */
    int64_t (*date_ns)(void *ctx, int64_t t_ns);
    /* Stores this protocol's settings, which then outlast a power cycle. The new settings replace those stored before,
     * and each new session gets them (spec.stored). lines: printable ASCII with '\n' at each end, at most
     * PROTOCOL_STORED bytes with the NUL; "": none. 0; or 1: the head stores none (spec.keeps is 0), or these are no
     * such lines. May be NULL: the head stores none. The command HEAD:STORe stores settings of the head itself, which
     * native commands set. */
    int (*store)(void *ctx, const char *lines);
    /* Loss of optical power at the window, both ways together, dB. May be NULL: 0. */
    double (*window_loss_db)(void *ctx);
    /* Tells the user a line about this link; the same one only once. May be NULL. */
    void (*tell_once)(void *ctx, const char *text);
};

enum { PROTOCOL_REPLY = 512, PROTOCOL_STORED = 2048 };

enum { PROTOCOL_MAX_GEOMETRIES = 8 };
struct cola_fields;

/* Facts about the head that the descriptor doesn't have; constant, and outlives the instance. */
struct protocol_identity {
    char maker[32], model[64]; /* of the head profile */
    char firmware[32];
    char serial[32];
    char name[32]; /* of the device, as its user calls it */
    /* The line rates that a planar head can be set to, with the steps of a turn at each. n_geometries 0: none. */
    struct protocol_geometry {
        int64_t lines_uhz;
        uint32_t steps;
    } geometry[PROTOCOL_MAX_GEOMETRIES];
    uint32_t n_geometries;
    int64_t spin_up_ns;               /* from SCAN:STARt to the mirror's speed; 0: a recording */
    int64_t queue_ns;                 /* how far a session may be behind the head before it loses frames */
    const struct cola_fields *fields; /* monitored fields and inputs of the configuration; NULL: none */
};

struct talk;
struct talk_options;

struct protocol_spec {
    const struct protocol_identity *identity;
    struct protocol_host host;
    int64_t power_ns;         /* device time of the last power-up, from which the device's counters count */
    uint32_t power_ons;       /* how often power has come, by power cycles and reboots, with the first time */
    uint32_t near_wrap;       /* how far below their wrap counters begin; 0: they begin at 0 */
    int keeps;                /* 1: store() and HEAD:STORe work; else the device forgets all settings without power */
    const char *stored;       /* what store() has kept; "": nothing. NULL: as "". Valid during begin() */
    int dialect;              /* enum protocol_dialect: the one that the link is configured for */
    _Atomic uint32_t *shared; /* a word of the link that all of its sessions share; 0 at first. NULL: there is none */
    /* 1: the head waits for clients (paces fast and step). Device time then says nothing of how long a client takes, so
     * a protocol sets clients no time limit. */
    int waits;
    /* velodyne_http: address and port of the link `velodyne`, to which the data go, and the port of the link
     * `velodyne-position`; "" and 0: not known */
    char address[64];
    int port, position_port;
    /* capture: what to say; outlive the instance. NULL for all others */
    const struct talk *talk;
    const struct talk_options *talk_options;
};

struct native_descriptor;
struct native_emitter;

struct protocol_ops {
    const char *name;  /* of links[].protocol */
    uint32_t needs;    /* enum protocol_needs */
    uint32_t emitters; /* bit per enum native_emitter_kind of the heads that it can speak for; 0: all */
    uint32_t n_beams;  /* beams that a head of beams must have; 0: any number */
    uint32_t max_unit; /* bytes; no unit is longer */
    int brief;         /* 1: clients come for one request, and a silent one may have to make room for another */
    /* For the injected fault that checksums can't show: bits of a unit are changed, then its checksums are made right
     * again. Both functions are pure, and take any bytes.
     * content: sets the bits of mask (len bytes, all 0 before) that may be changed: those of measured values. Marks,
     * lengths, names and checksums are left out, so that the unit stays well-formed. NULL: all bits may be changed.
     * reseal: makes the checksums right. NULL: units have none. */
    void (*content)(const uint8_t *unit, size_t len, uint8_t *mask);
    void (*reseal)(uint8_t *unit, size_t len);
    /* Checks whether the protocol can speak for a head: SH_OK, or SH_EINPUT with what is not allowed, and what is. Kind
     * and number of beams of the emitter are allowed already (emitters, n_beams); beams are those of its payload.
     * NULL: the protocol can speak for each such head. Pure. */
    int (*check_head)(const struct native_descriptor *descriptor, const struct native_emitter *emitter,
                      const uint8_t *beams, struct sh_err *err);
    int passes_native; /* 1: the native protocol, which its owner speaks; no member below is set */

    size_t size; /* of the protocol's own struct, which has a struct protocol_spec as its first member */
    /* Sets up an instance, which is all 0 but for the spec. When it fails, nothing of it stays. May be NULL. */
    int (*begin)(void *protocol, struct sh_err *err);
    /* Frees what the instance holds, but not the instance itself. `protocol` may be NULL, as may this function. */
    void (*end)(void *protocol);

    /* The client is there. t_ns: device time of the tick from which on the client gets frames. A session that outlasts
     * a loss of power, as that of a file does, gets a new instance when power comes. May be NULL. */
    void (*open)(void *protocol, int64_t t_ns);
    /* One whole native frame, checked, in the order of the stream. A client that joins late gets descriptor,
     * emitter and anchor first. Never called with frames of the geo layout where needs has POLAR. May be NULL: the
     * protocol needs none. */
    void (*frame)(void *protocol, const uint8_t *frame, size_t len);
    /* Frames are missing before the next one: the client, or the head, was too slow. May be NULL, as frame. */
    void (*gap)(void *protocol, uint32_t n_frames);
    /* All frames before device time t_ns have come. Called for each tick, also for a tick without frames. Where the
     * client was too slow, time jumps after a gap. May be NULL. */
    void (*time)(void *protocol, int64_t t_ns);
    /* Bytes from the client, in pieces of any size; from a link of datagrams each call has a whole one. */
    void (*input)(void *protocol, const uint8_t *bytes, size_t len);
    /* How many bytes input() can take now. Until it takes some, the client's bytes wait, in the end on the wire. Not
     * asked for datagrams. May be NULL: any number. */
    size_t (*takes)(const void *protocol);
    /* Whether units may still come for a client that sends nothing more: a stream that it asked for, or an answer that
     * takes time. 0: its session ends. May be NULL: units come without being asked for. */
    int (*owes)(const void *protocol);
    /* The client has gone. Something that it asked for may still be due, such as a reboot. May be NULL. */
    void (*gone)(void *protocol);
    /* Device time that must have passed before time() has something to do, unless frames or bytes come. May be NULL:
     * each tick, or where there is no time(), never. next_ns saves wake-ups, no more: time() is called for the other
     * ticks, too. */
    int64_t (*next_ns)(const void *protocol);
};

/* Asks the head for its state (HEAD:STATe?). */
enum protocol_head_state protocol_ask_state(const struct protocol_host *host);

/* Makes an instance. When it fails, nothing of it stays. */
int protocol_create(const struct protocol_ops *ops, const struct protocol_spec *spec, void **protocol,
                    struct sh_err *err);
void protocol_destroy(const struct protocol_ops *ops, void *protocol);

/* protocol_ops.input of a protocol that takes no bytes: counts them as lost. */
void protocol_lose_input(void *protocol, const uint8_t *bytes, size_t len);

/* For protocol_ops.content: the bits of a hexadecimal digit that may change in any way. The character is then still a
 * digit, of 0 to 9 if it was. */
uint8_t protocol_digit_bits(uint8_t c);

/* The XOR of n bytes, with which sentences of NMEA 0183 and telegrams of CoLa-B end. */
static inline uint8_t protocol_xor(const void *bytes, size_t n)
{
    uint8_t sum = 0;
    for (size_t i = 0; i < n; i++)
        sum ^= ((const uint8_t *)bytes)[i];
    return sum;
}

/* From the one list, in protocol.c. NULL for an unknown id. */
const struct protocol_ops *protocol_ops_get(enum protocol_id id);

#endif
