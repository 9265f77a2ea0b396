/* SPDX-License-Identifier: MIT */
/* `scanhead run`: its options, and what its files share. */
#ifndef FIRMWARE_SIM_APP_RUN_RUN_H
#define FIRMWARE_SIM_APP_RUN_RUN_H

#include "firmware_sim/app/app.h"
#include "firmware_sim/loop/loop.h"
#include "firmware_sim/replay/replay.h"

enum run_kind { RUN_HEAD, RUN_RECORDING, RUN_CAPTURE };

struct run_options {
    struct app_input in;
    struct device_options device;
    struct replay_options replay; /* speed 0: not given */
    const char *config;           /* of a recording's links; NULL: none */
    long clients;
    char links[4096]; /* --link, as YAML; empty: none */
    const char *stats;
    const char *surfaces; /* --surfaces */
    long ready_fd;
    int quiet, no_hash, frames_given, view;
    long device_port; /* 0: not given */
};

/* serve.c: runs the loop from its start to its end, writes the statistics, and warns of losses. */
int run_serve(const struct run_options *o, struct loop *loop, struct sh_err *err);
/* Adds a web link for --view, where there is none. SH_EINPUT: no link at all, or no room for the one of --view. */
int run_complete_links(const struct run_options *o, struct config *cfg, struct sh_err *err);
void run_say_links(const struct loop *loop);

/* replay.c */
/* --link: adds one to the options. */
int run_take_link(void *values, const char *text);
/* Refuses options that are for something else than what is run, and those that contradict each other: APP_GO_ON, or
 * APP_USAGE with the reason printed. */
int run_check_options(const struct run_options *o, enum run_kind kind);
/* Serves a recording. Returns the exit status. */
int run_replay(struct run_options *o);

/* capture.c: serves a capture of another device's traffic. Returns the exit status. */
int run_capture(struct run_options *o);

#endif
