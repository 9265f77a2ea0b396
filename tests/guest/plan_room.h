/* SPDX-License-Identifier: MIT */
/* This is the room of room.obj in the plane of the head, worked out by hand: it says how far the wall is in a
 * direction. The file shares nothing with the program. head.yaml has the head at (0.31, -0.42), heading 30 deg. The
 * walls stand at x -4.37 and 5.83, y -6.21 and 3.94 m. */
#ifndef TESTS_GUEST_PLAN_ROOM_H
#define TESTS_GUEST_PLAN_ROOM_H

/* left_rad counts from the head's forward direction, counter-clockwise as seen from above. */
double plan_room_range_m(double left_rad);

#endif
