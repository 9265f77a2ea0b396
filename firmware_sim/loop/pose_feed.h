/* SPDX-License-Identifier: MIT */
/* Poses of a live platform over UDP.
 *
 * In: datagrams. Each one holds one or more lines
 *
 *   t_s x y z roll pitch heading
 *
 * with the device time in seconds (TIME? asks for it), and the numbers of pose_line.h. Out: calls of device_pose. A
 * thread of its own takes the datagrams in.
 *
 * A line that is malformed, or a pose that device_pose refuses, is not used. It is counted (bad_poses), and reported
 * once per second at most. */
#ifndef FIRMWARE_SIM_LOOP_POSE_FEED_H
#define FIRMWARE_SIM_LOOP_POSE_FEED_H

#include <stddef.h>

#include "firmware_sim/device/device.h"

struct pose_feed;

/* Listens at platform.address and platform.port. */
int pose_feed_open(struct device *device, const struct config *cfg, struct pose_feed **out, struct sh_err *err);
int pose_feed_start(struct pose_feed *feed, struct sh_err *err);
/* Writes where the feed listens, such as "udp:127.0.0.1:4711". */
void pose_feed_endpoint(const struct pose_feed *feed, char *buf, size_t len);
/* Ends the thread; feed may be NULL. */
void pose_feed_close(struct pose_feed *feed);

#endif
