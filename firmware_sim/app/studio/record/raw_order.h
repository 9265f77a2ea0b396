/* SPDX-License-Identifier: MIT */
/* Puts data from several sockets into the order in which it came. Each socket is an input that holds one piece at most.
 *
 * A piece is passed on only after every empty input was asked again. So any earlier piece is known by then.
 * In: inputs. Out: calls of `pass`. */
#ifndef FIRMWARE_SIM_APP_STUDIO_RECORD_RAW_ORDER_H
#define FIRMWARE_SIM_APP_STUDIO_RECORD_RAW_ORDER_H

#include <stdint.h>

#include "core/err.h"

struct raw_input {
    int is_full; /* it has a piece, of t_ns */
    int64_t t_ns;
    /* Asks an empty input for a piece. Returns 1, with t_ns set, where there is one now; 0: none; or SH_E. */
    int (*take)(struct raw_input *input, struct sh_err *err);
    /* Passes the piece on. The input is empty after that. Returns SH_OK or SH_E. */
    int (*pass)(struct raw_input *input, struct sh_err *err);
};

/* Passes on up to `most` pieces. Returns how many, or SH_E of an input. */
int raw_pass_in_order(struct raw_input *const *input, int n, int most, struct sh_err *err);

#endif
