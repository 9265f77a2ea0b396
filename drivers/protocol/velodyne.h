/* SPDX-License-Identifier: MIT */
/* Velodyne VLP-16 as protocols: data packets, position packets, settings over HTTP. VELODYNE.md has the
 * layouts, their sources, and what the real device does and this one doesn't.
 *
 * This header has what the three share. Pure; any thread; real-time safe but for what HTTP asks of the device. */
#ifndef DRIVERS_PROTOCOL_VELODYNE_H
#define DRIVERS_PROTOCOL_VELODYNE_H

#include <stdint.h>

#include "drivers/protocol/protocol.h"

enum {
    VELODYNE_BEAMS = 16,
    VELODYNE_BLOCKS = 12,
    VELODYNE_BLOCK_LEN = 100,
    VELODYNE_BLOCK_FIRINGS = 2 * VELODYNE_BEAMS,
    VELODYNE_PACKET_FIRINGS = VELODYNE_BLOCKS * VELODYNE_BLOCK_FIRINGS, /* single return; dual: half of it */
    VELODYNE_DATA_LEN = 1206,
    VELODYNE_POSITION_LEN = 512,
    VELODYNE_POSITION_NS = 14 * 24 * 55296, /* one position packet for 14 data packets of single return */
    VELODYNE_DATA_PORT = 2368,
    VELODYNE_POSITION_PORT = 8308,
};

enum velodyne_return_mode { VELODYNE_STRONGEST = 0x37, VELODYNE_LAST = 0x38, VELODYNE_DUAL = 0x39 };

/* Microseconds since the top of the hour at a device time, rounded down, 0..3599999999: the head's counter, which
 * begins at power-up, and which the receiver's pulses and sentences set (protocol_host). */
uint32_t velodyne_hour_us(const struct protocol_host *host, int64_t t_ns);

/* State of the pulses per second at a device time; absent where UTC is not known. */
enum protocol_pps velodyne_pps(const struct protocol_host *host, int64_t t_ns);

/* Calibrated reflectivity of a reflectance in 0.01 dB (struct native_point): 0..100 for 0..100 % of a white
 * Lambertian target; above it 101..255 in steps of 0.2 dB, with 255 from 30.8 dB on. 0 where it is not
 * modelled. */
uint8_t velodyne_reflectivity(int refl_cdb);

#endif
