/* A head with a GNSS receiver, for the wire tests. */
#ifndef TESTS_WIRE_GNSS_RIG_H
#define TESTS_WIRE_GNSS_RIG_H

#include "tests/wire/room.h"

/* Neither at the pole nor near zero; seven decimals of a degree and no rounding that helps. */
#define LAT_DEG  (-33.8567844)
#define LON_DEG  151.2152967
#define HEIGHT_M 87.6543
#define PLACE                                                                                        \
    "--set", "stations[0].lat_deg=-33.8567844", "--set", "stations[0].lon_deg=151.2152967", "--set", \
        "stations[0].height_m=87.6543"

#define NMEA_PTY "links: [{type: tcp, port: 0}, {type: pty, path: gnss, protocol: nmea}]\n"

static const struct room_config ROOM = {
    .prr_hz = 20000, .lines_hz = 50, .pan_deg_s = 60, .pan_stop_deg = 360, .frames = 0, .links = NMEA_PTY};

static inline const char *write_room(const struct wire *wire, const char *links)
{
    struct room_config config = ROOM;
    config.links = links;
    config.more = "loop: {late_ms: 10000, queue_ms: 3000}\n" /* patient with a machine that stands still */
                  "time: {epoch: 2026-01-01T00:00:00Z}\n";
    room_write(wire);
    return room_config_write(wire, &config); /* its station has no place on the earth yet: PLACE */
}

#endif
