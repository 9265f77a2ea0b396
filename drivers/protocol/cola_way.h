/* SPDX-License-Identifier: MIT */
/* The encoder of a vehicle that carries the head: poses go in, path length and speed come out. The speed is taken as
 * constant from one stream frame with newer poses to the next. Times are since the scan's start, ns. Pure. */
#ifndef DRIVERS_PROTOCOL_COLA_WAY_H
#define DRIVERS_PROTOCOL_COLA_WAY_H

#include <stddef.h>
#include <stdint.h>

/* All 0 at first. */
struct cola_way {
    uint32_t scan;
    int have_pose;
    /* The last poses of the last three frames that had newer ones. The last pose of a stream frame may be later than
     * the frame's end, so a time of the next frame may be before it. */
    int64_t t_ns[3];
    double path_m[3], at_m[3];
};

struct cola_encoder {
    int32_t path_mm; /* since the head's scan began, or the client came; 0 where the head does not move */
    int16_t speed_mm_s;
};

/* Takes a payload of poses. The path begins at 0 again where the scan has another number, or where the payload's last
 * pose is earlier than the last one that was taken: a replayed recording goes back within a scan. */
void cola_way_add(struct cola_way *w, uint32_t scan, const uint8_t *payload, size_t len);
struct cola_encoder cola_way_at(const struct cola_way *w, uint32_t scan, int64_t t_ns);

#endif
