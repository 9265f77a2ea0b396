/* SPDX-License-Identifier: MIT */
/* For tests of a replay: the frames of a session, each with the tick in which it came, and files of them. */
#ifndef TESTS_WIRE_REPLAY_RIG_H
#define TESTS_WIRE_REPLAY_RIG_H

#include "tests/wire/room.h"

struct tape_frame {
    size_t at;
    uint32_t len, seq;
    int type, flags, tick;
    int64_t t_ns;
};

/* The frames of a session. Zeros are an empty one. */
struct tape {
    uint8_t *bytes;
    size_t len, room;
    struct tape_frame *frame;
    uint32_t n, n_room;
};

/* A command that is sent before the tick of this number is granted. */
struct tape_line {
    int tick;
    const char *command;
};

void tape_add(struct tape *tape, const struct scanhead_frame *frame, int tick);
void tape_free(struct tape *tape);
/* Writes the file with its frames, including those that were for this reader alone. */
const char *tape_write(const struct wire *wire, const char *name, const struct tape *tape);
/* Keeps the same frames without those for this reader alone; tape may be the same. */
void tape_keep_common(struct tape *tape);
/* Reads the frames of a file, one after the other; they have no ticks. */
void tape_read(const char *path, struct tape *tape);

/* Runs `scanhead run` with a configuration, or a recording, in the pace step: n ticks of a millisecond, granted one at
 * a time. lines end with a NULL. */
void tape_step(struct wire *wire, const char *what, const char *const *more, const struct tape_line *lines, int n,
               struct tape *tape);

/* Both tapes have the same frames with the same bytes, and as many ticks between them. */
void tape_same_ticks(const struct tape *tape, const struct tape *want);
/* Both tapes have the same bytes. */
void tape_same_bytes(const struct tape *tape, const struct tape *want);

/* Runs `scanhead ...` to its end and returns the exit status. The program's messages are in "err". */
int replay_call(struct wire *wire, const char *const *args);
/* The messages of the last call have the text. */
void replay_said(const struct wire *wire, const char *text);
/* Runs `scanhead run FILE --start --pace fast` into a file link. more may be NULL. */
void replay_to_file(struct wire *wire, const char *file, const char *const *more, const char *out);

/* Two files of the folder have the same frames, more than 100. */
void replay_same_file(const struct wire *wire, const char *out, const char *of);

/* Records a scan of `lines` lines of 10 ms in the room, at 10 kHz, into name.shs. The recording goes from the head's
 * power-up until it is idle again. */
const char *replay_room(struct wire *wire, const char *name, unsigned lines);

#endif
