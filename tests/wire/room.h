/* SPDX-License-Identifier: MIT */
/* The scenes of the wire tests, their configurations, and the results that they must have: a closed room whose walls
 * are known planes, and a schedule in exact rational arithmetic that shares nothing with core/schedule. */
#ifndef TESTS_WIRE_ROOM_H
#define TESTS_WIRE_ROOM_H

#include <math.h>

#include "tests/wire/wire.h"

__extension__ typedef __int128 i128;

/* ---- the room: scene frame, metres. No two walls are at the same distance, and no wall is at a round one. */
extern const double ROOM_MIN[3], ROOM_MAX[3];
extern const char *const WALLS[6];

/* Writes one object per wall, each of its own material. */
void room_write(const struct wire *wire);

/* Writes open ground 1.7 m below the station, so that every shot above the horizon is empty. */
void ground_write(const struct wire *wire);

struct room_config {
    const char *profile; /* NULL: full-sweep */
    double prr_hz, lines_hz, pan_deg_s, pan_stop_deg;
    double line_start_deg, line_stop_deg; /* both 0: the profile's */
    unsigned frames;
    const char *links; /* YAML of the list */
    const char *noise; /* noise besides range, ", KEY: VALUE"; NULL: none */
    const char *more;  /* further YAML; NULL: none */
};

#define LINK_YAML_TCP  "links: [{type: tcp, port: 0}]\n"
#define LINK_YAML_PTY  "links: [{type: pty, path: port}]\n"
#define LINK_YAML_BOTH "links: [{type: tcp, port: 0}, {type: pty, path: port}]\n"

extern const double STATION[3], HEADING_DEG;

/* Writes config.yaml in the folder, for room.obj beside it. The file's path is good as long as those of wire_path. */
const char *room_config_write(const struct wire *wire, const struct room_config *c);

/* ---- the range along a direction given in the head's frame by mirror and pan angle */

struct room_ray {
    double range_m; /* to the nearest wall */
    int wall;
    double plane_m[6]; /* to each wall's plane; infinity behind */
};

void room_cast(double mirror_rad, double pan_rad, struct room_ray *ray);

/* ---- the schedule, exactly: everything follows from k * lines / prr and k / prr in integers */

struct oracle {
    int64_t prr_uhz, lines_uhz, pan_udeg_s, pan_stop_udeg; /* pan from 0 */
    int64_t fov_min_udeg, sweep_udeg, start_udeg, stop_udeg;
    uint32_t frames;
};

int64_t micro(double value);

/* fov_min and sweep are the profile's: 240 deg for three facets of a polygon and 100 for full-sweep. */
struct oracle oracle_of(const struct room_config *c, double fov_min_deg, double fov_max_deg, double sweep_deg);

uint64_t oracle_line(const struct oracle *o, uint64_t k);

uint64_t oracle_first_pulse(const struct oracle *o, uint64_t line);

/* Returns the lines until the pan has gone from 0 to its stop. */
uint64_t oracle_frame_lines(const struct oracle *o);

/* Returns the first pulse after the scan's last frame. */
uint64_t oracle_end(const struct oracle *o);

/* Returns floor(k / prr) in ns. */
int64_t oracle_time_ns(const struct oracle *o, uint64_t k);

/* Returns whether the mirror is within the cast window: angle * prr_uhz compared in integers. */
int oracle_is_cast(const struct oracle *o, uint64_t k);

double oracle_mirror_deg(const struct oracle *o, uint64_t k);

/* The pan starts anew with each frame's first pulse. */
double oracle_pan_deg(const struct oracle *o, uint64_t k);

uint64_t oracle_count_cast(const struct oracle *o, uint64_t from, uint64_t to);

#endif
