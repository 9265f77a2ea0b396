/* SPDX-License-Identifier: MIT */
/* This makes a scan of the room with faults, off line, as a native client receives it. The run has its shots by pulse
 * number, its line ends, and the truth about the faults. */
#ifndef TESTS_WIRE_BEAM_RUN_H
#define TESTS_WIRE_BEAM_RUN_H

#include "tests/wire/room.h"

enum { BEAM_MAX_PULSES = 100000, BEAM_MAX_LINES = 200, BEAM_MAX_NOTES = 32 };

struct beam_shot {
    int is_there, is_empty;
    double range_m, mirror_rad, pan_rad, reflectance_db, amplitude_db;
    int64_t t_ns;
};

struct beam_note {
    char kind[32];
    uint64_t pulse;
    int64_t t_ns;
    int ended;
};

struct beam_run {
    struct beam_shot shot[BEAM_MAX_PULSES];
    uint64_t pulses; /* one after the last pulse that is there */
    /* Device time of pulse 0. */
    int64_t start_ns;
    struct scanhead_line_end line[BEAM_MAX_LINES];
    uint32_t lines;
    struct scanhead_info info;
    struct beam_note note[BEAM_MAX_NOTES];
    uint32_t notes;
    char sha256[65];
};

/* 20 kHz and 50 lines per second over 24 deg: 8,000 pulses, 400 a line. */
extern const struct room_config BEAM_ROOM;

/* Records the room with these faults (YAML of the list's items; NULL: none) and settings (KEY=VALUE, ends with NULL; or
 * NULL). The run is the callee's, one for each `slot` of 0 and 1, until the next call. */
const struct beam_run *beam_record(struct wire *wire, int slot, const char *faults, const char *const *sets);
/* Does the same for another room. */
const struct beam_run *beam_record_room(struct wire *wire, int slot, const struct room_config *room, const char *faults,
                                        const char *const *sets);
/* The same for a stream and a truth that are there already. */
const struct beam_run *beam_read(const struct wire *wire, int slot, const char *stream, const char *truth);
/* Returns note n, from 0, of a kind's begins (ended 0) or ends (1). The call fails where there is no such note. */
const struct beam_note *beam_note(const struct beam_run *run, const char *kind, uint32_t n, int ended);

#endif
