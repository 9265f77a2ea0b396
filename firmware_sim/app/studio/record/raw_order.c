/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/record/raw_order.h"

#include <stddef.h>

/* Asks all empty inputs, until none of them has a new piece. */
static int raw_order_fill(struct raw_input *const *input, int n, struct sh_err *err)
{
    for (int found = 1; found;) {
        found = 0;
        for (int i = 0; i < n; i++) {
            if (input[i]->is_full) continue;
            const int rc = input[i]->take(input[i], err);
            if (rc < 0) return rc;
            input[i]->is_full = rc;
            found |= rc;
        }
    }
    return SH_OK;
}

static struct raw_input *find_oldest(struct raw_input *const *input, int n)
{
    struct raw_input *oldest = NULL;
    for (int i = 0; i < n; i++)
        if (input[i]->is_full && (oldest == NULL || input[i]->t_ns < oldest->t_ns)) oldest = input[i];
    return oldest;
}

int raw_pass_in_order(struct raw_input *const *input, int n, int most, struct sh_err *err)
{
    for (int passed = 0; passed < most; passed++) {
        int rc = raw_order_fill(input, n, err);
        if (rc < 0) return rc;
        struct raw_input *oldest = find_oldest(input, n);
        if (oldest == NULL) return passed;
        oldest->is_full = 0;
        rc = oldest->pass(oldest, err);
        if (rc < 0) return rc;
    }
    return most;
}
