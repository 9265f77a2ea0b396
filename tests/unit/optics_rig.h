/* SPDX-License-Identifier: MIT */
/* For tests of glass and mirrors: a head in a room, whose surfaces are set by hand, and sheets across its way. */
#ifndef TESTS_UNIT_OPTICS_RIG_H
#define TESTS_UNIT_OPTICS_RIG_H

#include "tests/unit/cast_rig.h"

#include "core/surface.h"

extern const double STATION[3], LO[3], HI[3];

struct optics {
    struct cast_rig *rig;
    struct surface_table table;
    struct cast_detect detect;
};

/* Takes the scene over. Its surfaces have a reflectance of 0.5. */
void open_optics(struct optics *o, struct scene *scene);
void close_optics(struct optics *o);

/* Writes the direction of cast pulse i of a line. */
void direction(const struct cast_rig *rig, const struct schedule_line *line, uint32_t i, long double d[3]);

/* The entry has that range, to half a count. */
void near_range(const struct cast_rig *rig, uint32_t entry, long double range_m);

/* Casts a whole line; line 5 looks along y, line 40 beside it. Returns its pulses. */
uint32_t shoot_line(struct optics *o, uint64_t number, struct schedule_line *line);

/* Makes squares of 60 m across y, at these places. Surfaces: window, wall, mirror. */
struct scene *sheets(const double y[3], const uint16_t label[3]);

/* Panes at y = 2 and 2.004 m, as a box of glass has them, with a wall behind. */
struct scene *window(void);

#endif
