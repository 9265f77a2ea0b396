/* SPDX-License-Identifier: MIT */
#include "tests/wire/gnss_rig.h"

static const struct room_config ROOM = {
    .prr_hz = 20000, .lines_hz = 50, .pan_deg_s = 60, .pan_stop_deg = 360, .frames = 0, .links = NMEA_PTY};

const char *write_room(const struct wire *wire, const char *links)
{
    struct room_config config = ROOM;
    config.links = links;
    config.more = "loop: {late_ms: 10000, queue_ms: 10000}\n" /* a machine may stand still for so long */
                  "time: {epoch: 2026-01-01T00:00:00Z}\n";
    room_write(wire);
    return room_config_write(wire, &config); /* the option PLACE gives the station its place on the earth */
}
