/* SPDX-License-Identifier: MIT */
/* The faults of a run: the list, which commands may change, and what was injected so far.
 *
 * In: faults, with the device time from which they count; notes of what was injected. Out: a copy of the list for each
 * who injects; counts; the truth (truth.h), and lines for the journal. Thread: any. Without faults a look at the
 * version, which is one atomic load, is all that it costs. */
#ifndef FIRMWARE_SIM_FAULT_BOARD_H
#define FIRMWARE_SIM_FAULT_BOARD_H

#include "firmware_sim/fault/truth.h"

enum { FAULT_KEPT = 2 * FAULT_MAX }; /* faults that there are, and those that were taken out last */

struct fault_entry {
    uint32_t number;  /* first, for fault_find. From 1, in the order in which they were added; never used again */
    int64_t since_ns; /* device time from which it counts: 0, or when it was added */
    int64_t until_ns; /* when it was taken out; INT64_MAX: it is there */
    int from_start;   /* it was there at power-up: it counts a session's frames from the first */
    struct fault fault;
};

struct fault_board;

/* truth_path NULL: no file; else *lost counts the lines that are not in it (truth.h). list may be empty. */
int fault_board_create(const struct fault_list *list, const char *truth_path, _Atomic uint64_t *lost,
                       struct fault_board **out, struct sh_err *err);
/* Closes the file of the truth; the first error in writing it. Nothing is injected any more. board may be NULL. */
int fault_board_close(struct fault_board *board, struct sh_err *err);
/* The truth's file is behind: who can wait should. */
int fault_board_is_filling(const struct fault_board *board);
void fault_board_free(struct fault_board *board);

/* Changes with the list; 0: it has always been empty. Real-time safe. */
uint32_t fault_board_version(const struct fault_board *board);
/* A copy of the list, of the version that it returns. */
uint32_t fault_board_copy(struct fault_board *board, struct fault_entry entries[FAULT_MAX], uint32_t *n);

/* With those that were taken out last, which still hold for frames from before that. */
uint32_t fault_board_copy_all(struct fault_board *board, struct fault_entry entries[FAULT_KEPT], uint32_t *n);

/* For one who keeps something of each fault, and takes over a list that has changed: what was kept of the fault of that
 * number, among n items of `size` bytes that begin with their numbers. NULL: nothing. */
const void *fault_find(const void *items, uint32_t n, size_t size, uint32_t number);

/* Adds a fault that counts from t_ns. SH_EINPUT: there are FAULT_MAX. */
int fault_board_add(struct fault_board *board, const struct fault *fault, int64_t t_ns, uint32_t *number,
                    struct sh_err *err);
/* Takes out the fault of that number; 0: all. Frames from before device time t_ns are on their way, and are still hit.
 * Returns how many went. */
uint32_t fault_board_end(struct fault_board *board, uint32_t number, int64_t t_ns);
/* The same, at once. */
uint32_t fault_board_remove(struct fault_board *board, uint32_t number);

/* It was injected: counted, written to the truth, and given to the listener. */
void fault_board_note(struct fault_board *board, const struct fault_note *note);
/* The number of the fault that was added last; 0: there never was one. */
uint32_t fault_board_last(struct fault_board *board);
/* How often the fault of that number was injected; 0: all together. Those that were taken out count, too. */
uint64_t fault_board_injected(struct fault_board *board, uint32_t number);
/* Who hears of each note, in the thread that injected it: journal and soak. Before the run; up to 4. */
void fault_board_listen(struct fault_board *board, void (*heard)(void *ctx, const struct fault_note *note), void *ctx);

#endif
