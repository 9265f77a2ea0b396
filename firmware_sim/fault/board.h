/* SPDX-License-Identifier: MIT */
/* The board of a run's injected faults: the list, which commands may change, and counts of the injections so far.
 *
 * In: faults, with the device time from which they count; notes of injections. Out: a copy of the list for each
 * injector; counts; the truth (truth.h), and lines for the journal. Thread: any. A run without faults only reads the
 * version, which is one atomic load. */
#ifndef FIRMWARE_SIM_FAULT_BOARD_H
#define FIRMWARE_SIM_FAULT_BOARD_H

#include "firmware_sim/fault/truth.h"

enum {
    FAULT_KEPT = 2 * FAULT_MAX,   /* faults in the list, and those that were taken out last */
    FAULT_MOST_OF_A_RUN = 1000000 /* each number has a count until the run's end: this bounds their memory */
};

struct fault_entry {
    uint32_t number;  /* first member, for fault_find. From 1, in the order of adding; never used again */
    int64_t since_ns; /* device time from which it counts: 0, or when it was added */
    int64_t until_ns; /* when it was taken out; INT64_MAX: it is in the list */
    int from_start;   /* it was in the list at power-up: it counts a session's frames from the first */
    struct fault fault;
};

struct fault_board;

/* truth_path NULL: no file; else *lost counts the lines that are not in it (truth.h). list may be empty. */
int fault_board_create(const struct fault_list *list, const char *truth_path, _Atomic uint64_t *lost,
                       struct fault_board **out, struct sh_err *err);
/* Closes the file of the truth, once nothing is injected any more. Returns the first error in writing it. board may be
 * NULL. */
int fault_board_close(struct fault_board *board, struct sh_err *err);
/* 1: the queue of lines for the truth's file is filling; callers that can wait should, so that no line is dropped. */
int fault_board_is_filling(const struct fault_board *board);
void fault_board_free(struct fault_board *board);

/* Returns a number that changes with the list; 0: the list has always been empty. Real-time safe. */
uint32_t fault_board_version(const struct fault_board *board);
/* Copies the list, and returns its version. */
uint32_t fault_board_copy(struct fault_board *board, struct fault_entry entries[FAULT_MAX], uint32_t *n);

/* The same, with the faults that were taken out last. Such faults still hit frames from before. */
uint32_t fault_board_copy_all(struct fault_board *board, struct fault_entry entries[FAULT_KEPT], uint32_t *n);

/* Finds the item of a fault among n items of `size` bytes that begin with the faults' numbers. NULL: there is none. For
 * callers that keep a state per fault and take over a changed list. */
const void *fault_find(const void *items, uint32_t n, size_t size, uint32_t number);

/* Adds a fault that counts from t_ns. SH_EINPUT: there are FAULT_MAX, or the run has had FAULT_MOST_OF_A_RUN. */
int fault_board_add(struct fault_board *board, const struct fault *fault, int64_t t_ns, uint32_t *number,
                    struct sh_err *err);
/* Takes out the fault of that number; 0: all. Frames from before device time t_ns are still hit, since they are on
 * their way; INT64_MIN: none is hit any more. Returns how many faults were taken out. */
uint32_t fault_board_end(struct fault_board *board, uint32_t number, int64_t t_ns);

/* Notes an injection, or its end (note->ended): writes the note to the truth, and passes it to the listeners. Only
 * injections are counted. note->fault is the number of a fault of this board. */
void fault_board_note(struct fault_board *board, const struct fault_note *note);
/* Returns the number of the fault that was added last; 0: there never was one. */
uint32_t fault_board_last(struct fault_board *board);
/* Returns how often the fault of that number was injected; 0: all together. Faults that were taken out count, too. */
uint64_t fault_board_injected(struct fault_board *board, uint32_t number);
/* Adds a listener, which is called for each note in the thread that injected it. Before the run; up to 4. */
void fault_board_listen(struct fault_board *board, void (*heard)(void *ctx, const struct fault_note *note), void *ctx);

#endif
