/* SPDX-License-Identifier: MIT */
/* Frames, by their numbers, of the clean stream and of the links. */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_FRAME_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_FRAME_H

#include <stdint.h>

/* Frames that are remembered, clean and by link: a power of two. Half of them at most wait to be judged. */
enum { SOAK_RING = 1 << 16 };

/* Numbers of frames as 64 bits: those on the wire wrap, these do not. */
typedef uint64_t soak_seq;

struct soak_clean_frame {
    soak_seq seq;
    uint64_t digest;
    int64_t t_ns;
    uint32_t len;
    int there;
};

#endif
