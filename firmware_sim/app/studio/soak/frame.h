/* SPDX-License-Identifier: MIT */
/* A frame of the clean stream, and the numbers by which frames are known. */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_FRAME_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_FRAME_H

#include <stdint.h>

/* The clean stream and each link remember this many frames, a power of two. At most half of them wait to be judged. */
enum { SOAK_RING = 1 << 16 };

/* Numbers of frames as 64 bits: those on the wire wrap, these do not. */
typedef uint64_t soak_seq;

struct soak_clean_frame {
    soak_seq seq;
    uint64_t digest;
    int64_t t_ns;
    uint32_t len;
    uint64_t end_byte; /* of the clean stream, counted from its first frame on; not for datagrams */
    int there;
};

#endif
