/* SPDX-License-Identifier: MIT */
/* A protocol is driven from bytes to bytes. The rig is its host, and keeps the bytes that the protocol sends and the
 * calls that it makes. Native frames of heads that spin are made from ranges by hand. */
#ifndef TESTS_COMMON_PROTOCOL_RIG_H
#define TESTS_COMMON_PROTOCOL_RIG_H

#include "core/line.h"
#include "drivers/protocol/native.h"
#include "drivers/protocol/protocol.h"

enum { RIG_UNITS = 4096, RIG_BYTES = 1 << 22, RIG_LINES = 256 };

struct protocol_rig {
    const struct protocol_ops *ops; /* &checked */
    void *protocol;
    enum protocol_id id;
    struct protocol_ops checked; /* the protocol's own, but time() asserts that next_ns() had foretold what it does */
    int64_t latest_ns;           /* of time() */
    struct protocol_identity identity;
    struct protocol_spec spec;
    /* what it sent */
    uint8_t *bytes; /* [cap + 1] from open to close; they move when they grow */
    size_t len, cap;
    size_t end[RIG_UNITS]; /* of each unit in bytes */
    uint32_t n_units;
    size_t room; /* for further bytes; a unit that is longer is refused. SIZE_MAX at first */
    int hung_up;
    uint64_t count[PROTOCOL_N_COUNTS];
    /* lines of the calls that it made, and the answers: the reply of the first row whose prefix begins the line (the
     * last row is {NULL, ...}), or "OK" where there is none */
    char line[RIG_LINES][64];
    uint32_t n_lines;
    const struct protocol_rig_reply {
        const char *prefix, *reply;
        int error;
    } * replies;
    int64_t utc0_ns;              /* UTC of device time 0; INT64_MIN at first: not known */
    int64_t shift_ns;             /* TIME:SHIFt of the device's own clock, which begins with utc0_ns, or at power-up */
    enum protocol_pps pps;        /* of all times; locked at first */
    int pps_unset;                /* the time of day was never set */
    struct nmea_fix fix;          /* of all times; quality 0 at first: there is none */
    char stored[PROTOCOL_STORED]; /* what it has stored; spec.keeps is 0 at first */
    /* the head */
    struct native_descriptor descriptor;
    struct native_emitter emitter;
    struct native_beam beam[NATIVE_MAX_BEAMS];
    int attributes;
    int64_t scan_t0_ns; /* device time of the scan's start */
    uint32_t seq;
};

/* RTK fixed at 2026-01-02 03:04:05, 33.8567844 degrees south and 151.2152967 east; all else has a value, too. */
extern const struct nmea_fix protocol_rig_fix;

/* `model` is the profile's. The rig is large: allocate it, or make it static. The call asserts that the protocol
 * opens. */
void protocol_rig_open(struct protocol_rig *rig, enum protocol_id id, const char *maker, const char *model);
void protocol_rig_close(struct protocol_rig *rig);
/* Forgets all bytes and calls so far. */
void protocol_rig_clear(struct protocol_rig *rig);
void protocol_rig_input(struct protocol_rig *rig, const char *text);

/* Sets the head; call it before protocol_rig_describe. Range counts are 1e-6 m, and a turn has 2^32 counts. */
void protocol_rig_planar(struct protocol_rig *rig, uint32_t steps, int first, int last, int front, int turn,
                         uint32_t lines_hz);
/* Sets a VLP-16: 16 beams in 55,296 ns. */
void protocol_rig_beams(struct protocol_rig *rig, uint32_t lines_hz);
/* Feeds the descriptor and emitter frames. */
void protocol_rig_describe(struct protocol_rig *rig, int64_t t_ns);

/* Echoes of one pulse, in order of range. */
struct protocol_rig_shot {
    uint32_t n; /* 0: without echo */
    double range_m[3];
    int16_t refl_cdb[3], amplitude_cdb[3];
};
/* One points frame of consecutive pulses of one line, with attributes where the rig has some. mirror_turn is the
 * elevation of each pulse, and pan_turn its pan. */
struct protocol_rig_run {
    uint32_t frame, line;
    uint64_t pulse0;
    uint32_t n;
    int64_t t0_ns, line_t0_ns; /* since the scan's start */
    const int64_t *dt_ns;      /* after t0_ns */
    const double *mirror_turn, *pan_turn;
    const struct protocol_rig_shot *shot;
};
void protocol_rig_points(struct protocol_rig *rig, const struct protocol_rig_run *run);
void protocol_rig_line_end(struct protocol_rig *rig, const struct line_end *end);

/* Feeds one frame of points of a planar head: n shots of turn `line`, which counts from 0. The first shot is at step
 * first_step + from. */
void protocol_rig_part(struct protocol_rig *rig, uint32_t line, uint32_t from, uint32_t n,
                       const struct protocol_rig_shot *shot);
/* Feeds a turn's line end. Returns the device time of the turn's end. */
int64_t protocol_rig_turn_end(struct protocol_rig *rig, uint32_t line, uint32_t status);
/* Feeds a whole turn: shots of the steps first..last, in frames of `part` pulses, and the line end. At last time() is
 * called with the turn's end. */
void protocol_rig_turn(struct protocol_rig *rig, uint32_t line, const struct protocol_rig_shot *shot, uint32_t part);

#endif
