/* SPDX-License-Identifier: MIT */
/* The scene that jobs of a campaign share. In: a combination of values. Out: its configuration and its site, which stay
 * loaded for further stations of the combination.
 *
 * The next combination takes over meshes and BVHs if all meshes are the same, and textures are wanted as before. Else
 * all meshes are read again. One thread. */
#ifndef FIRMWARE_SIM_APP_STUDIO_BATCH_LOAD_H
#define FIRMWARE_SIM_APP_STUDIO_BATCH_LOAD_H

#include "firmware_sim/app/studio/batch/batch.h"
#include "firmware_sim/site/site.h"

struct batch_loaded {
    struct config *cfg;
    struct site *site;
    uint32_t n_reads; /* how often meshes were read */
    /* inner state; all begins as zeros */
    struct batch_line *line; /* the settings that cfg was loaded with */
    uint32_t combination;
    int status; /* an exit status, or APP_GO_ON: there is a site. 0: nothing was loaded */
};

/* Returns APP_GO_ON, or the exit status of a failure. The failure is printed for the first job of a combination.
 * Further jobs of that combination get the same status. */
int batch_load(struct batch *b, uint32_t combination, struct batch_loaded *loaded);
void batch_unload(struct batch_loaded *loaded);

#endif
