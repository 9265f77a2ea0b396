/* SPDX-License-Identifier: MIT */
/* A pose of a live platform as text: `x y z roll pitch heading`, in metres of the scene frame and in degrees as
 * core/pose.h defines them. Lines over UDP have the device time in seconds before these six numbers. Numbers are
 * decimal, as those of TIME:STEP are. Blanks, or a comma, stand between them. Pure; any thread. */
#ifndef FIRMWARE_SIM_DEVICE_POSE_LINE_H
#define FIRMWARE_SIM_DEVICE_POSE_LINE_H

#include <stddef.h>

#include "core/err.h"

enum { POSE_LINE_LEN = 192 };

/* Read the whole line. SH_EFORMAT: it has another form. SH_EINPUT: a number is beyond its limit: 1e9 s, 1e9 m, 90 degrees
 * of pitch, 360 of roll and heading. */
int pose_line_read(const char *line, double v[6], struct sh_err *err);
int pose_line_read_timed(const char *line, double *t_s, double v[6], struct sh_err *err);

/* Writes the six numbers so that pose_line_read gives the same doubles. */
void pose_line_write(const double v[6], char text[POSE_LINE_LEN]);

#endif
