/* SPDX-License-Identifier: MIT */
/* The truth: a file that says what was injected, where, and when.
 *
 * In: a note of one fault. Out: a line of JSON in a file, and a line of text for the journal. Thread: any number of
 * threads may write notes. They never wait for the file, which a thread of its own writes (line_writer.h). Where
 * the file is slower than faults strike, {"missing":n} stands for n lines that were dropped. */
#ifndef FIRMWARE_SIM_FAULT_TRUTH_H
#define FIRMWARE_SIM_FAULT_TRUTH_H

#include "core/err.h"
#include "firmware_sim/fault/fault.h"

/* One injection. Members that don't concern the kind are 0, unless their comment says otherwise. */
struct fault_note {
    uint32_t fault; /* number of the entry, from 1 */
    enum fault_kind kind;
    int64_t t_ns;           /* device time */
    uint32_t link, session; /* from 1; 0: none, as in the head */
    int of;                 /* enum fault_of */
    uint64_t number;        /* of the frame or reply, as this fault counts them; of the connection on its link */
    int has_seq;            /* a frame of the native protocol, with its sequence number and type: */
    uint32_t seq, type;
    int has_pulse;
    uint64_t pulse; /* first of the frame, or the one that a fault of the head begins with */
    int64_t byte;   /* offset in the frame; -1: none */
    uint32_t bit;   /* of that byte, the first that a flip changed; 0 is the one of value 1 */
    uint64_t n;     /* bytes, bits, copies, frames, or changes at the end: as the kind has it */
    double for_ms;
    int ended;     /* a fault of the head is over */
    char text[64]; /* anything more, plain ASCII without quotes; empty: nothing */
};

struct truth;
/* Opens a new file; path "-" is standard output. path NULL: nothing is written, and *out is NULL. *lost counts the
 * lines that are not in the file; it may be NULL. path and *lost must outlive the truth. */
int truth_open(const char *path, _Atomic uint64_t *lost, struct truth **out, struct sh_err *err);
/* truth may be NULL. */
void truth_write(struct truth *truth, const struct fault_note *note);
/* 1: a caller that can wait should, so that nothing is dropped. truth may be NULL. */
int truth_is_filling(const struct truth *truth);
/* Writes what is left, as long as the file takes some of it every 2 s. Returns the first error in writing it. truth may
 * be NULL. */
int truth_close(struct truth *truth, struct sh_err *err);

/* "fault 1 drop: t_ns 1, link 1, ...": at most 255 characters of printable ASCII. */
enum { TRUTH_TEXT_LEN = 256 };
void truth_text(const struct fault_note *note, char text[TRUTH_TEXT_LEN]);

#endif
