/* SPDX-License-Identifier: MIT */
/* soak --client: a verdict on a client for each scenario, one after the other. */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_VERDICTS_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_VERDICTS_H

#include <stdio.h>

#include "firmware_sim/app/options.h"
#include "firmware_sim/app/studio/verdict/verdict.h"

enum { VERDICTS_MAX_SCENARIOS = 16 };

struct verdicts {
    struct verdict_options options;
    const char *scenario[VERDICTS_MAX_SCENARIOS]; /* as the command line has them */
    uint32_t n;                                   /* 0: a single run, with the configuration's own faults */
    const char *json, *junit;                     /* NULL: none */
};

/* Returns where sheets go: to standard output, or to standard error where --json or --truth writes to standard
 * output. */
FILE *verdicts_out(const struct verdicts *verdicts);
/* Returns SH_EINPUT where the configuration has no link of that number, from 1. 0 is allowed: none is named. */
int soak_check_link(const struct config *cfg, uint32_t number, struct sh_err *err);
/* Prints the sheets. Returns the exit status: APP_FAILED where there are findings. */
int verdicts_run(struct verdicts *verdicts, struct app_input *in);

#endif
