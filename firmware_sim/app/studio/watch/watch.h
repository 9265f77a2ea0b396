/* SPDX-License-Identifier: MIT */
/* A page gets this beside the stream of a running head: the head and its stations (/head), a coarse scene (/scene), the
 * plan (/plan), how good the scan is while it is on (/quality), the points so far (/past, /save), and previews.
 * README.md has the formats.
 *
 * In: configuration and site. Out: a link for the loop (a client like any other, whose other end the observer
 * reads), and a source for web links. README.md describes the observer. Where nobody opens a watch, nothing of this
 * costs anything. */
#ifndef FIRMWARE_SIM_APP_STUDIO_WATCH_WATCH_H
#define FIRMWARE_SIM_APP_STUDIO_WATCH_WATCH_H

#include "firmware_sim/app/run/page.h"

/* The lowest priority, as setpriority() has it: a busy head is not disturbed. */
enum { WATCH_NICE = 19 };

/* main.c gives it to run_take_page. */
extern const struct run_page watch_page;

#endif
