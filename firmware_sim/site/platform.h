/* SPDX-License-Identifier: MIT */
/* A head that moves while it scans, or that scans where its platform stops (platform.kind: stops). In: the configured
 * trajectory and times. Out: its poses (scene frame, metres), or a station for each stop, placed in the scene. */
#ifndef FIRMWARE_SIM_SITE_PLATFORM_H
#define FIRMWARE_SIM_SITE_PLATFORM_H

struct sh_err;
struct sh_report;
struct site;

/* Replaces the stations, once they are placed, by the stops. Without a trajectory these are all stations at the first
 * time, then all at the next. Along a trajectory there is one station, and the head stops on the way. Without an anchor
 * that station gives the scene's place on the Earth, as an anchor at its position with the scene's y axis to true north
 * would. */
int site_load_stops(struct site *site, const struct sh_report *report, struct sh_err *err);

/* Reads the trajectory, and cuts the path into stretches. */
int site_load_platform(struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
