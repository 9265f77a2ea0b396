/* SPDX-License-Identifier: MIT */
/* The room of room.obj in the plane of the head, by hand: how far the wall is in a direction. Shares nothing with the
 * program. head.yaml has the head at (0.31, -0.42), heading 30 deg; the walls stand at x -4.37 and 5.83, y -6.21 and
 * 3.94 m. */
#ifndef TESTS_GUEST_PLAN_ROOM_H
#define TESTS_GUEST_PLAN_ROOM_H

/* left_rad: from the head's forward direction counter-clockwise, seen from above. */
double plan_room_range_m(double left_rad);

#endif
