/* SPDX-License-Identifier: MIT */
#include "tests/unit/ring_rig.h"

const struct ring_size SIZE = {AHEAD, QUEUE, SPARE, SLOT_BYTES};

struct ring ring;

int open_ring(void **state)
{
    (void)state;
    struct sh_err err;
    return ring_create(&ring, &SIZE, &err);
}

int close_ring(void **state)
{
    (void)state;
    ring_free(&ring);
    return 0;
}
