/* SPDX-License-Identifier: MIT */
/* This runs a head with a GNSS receiver, for the wire tests. */
#ifndef TESTS_WIRE_GNSS_RIG_H
#define TESTS_WIRE_GNSS_RIG_H

#include "tests/wire/room.h"

/* The place is neither at the pole nor near zero. The place has seven decimals of a degree, so that no rounding hides
 * an error. */
#define LAT_DEG  (-33.8567844)
#define LON_DEG  151.2152967
#define HEIGHT_M 87.6543
#define PLACE                                                                                        \
    "--set", "stations[0].lat_deg=-33.8567844", "--set", "stations[0].lon_deg=151.2152967", "--set", \
        "stations[0].height_m=87.6543"

#define NMEA_PTY "links: [{type: tcp, port: 0}, {type: pty, path: gnss, protocol: nmea}]\n"

const char *write_room(const struct wire *wire, const char *links);

#endif
