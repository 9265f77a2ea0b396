/* SPDX-License-Identifier: MIT */
/* The limits of settings that commands change: those of the head profile, and those for which the site was planned. */
#ifndef FIRMWARE_SIM_DEVICE_LIMITS_H
#define FIRMWARE_SIM_DEVICE_LIMITS_H

struct head_limits;
struct site;

void device_set_limits(const struct site *site, struct head_limits *limits);

#endif
