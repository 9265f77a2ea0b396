/* SPDX-License-Identifier: MIT */
/* The text of a first configuration. In: the mesh, what is known or assumed of it, and a place to stand. Out:
 * commented YAML. */
#ifndef FIRMWARE_SIM_APP_STUDIO_INIT_TEXT_H
#define FIRMWARE_SIM_APP_STUDIO_INIT_TEXT_H

#include <stdio.h>

#include "core/studio/viewpoint.h"
#include "firmware_sim/app/studio/init/mesh.h"

struct config;

/* A coarse scan of what the station sees. */
struct init_scan {
    double prr_hz, lines_hz, pan_deg_s, step_deg, duration_s;
    double pan_stop_deg, line_start_deg, line_stop_deg; /* from a station outside: a part of the profile's view */
};

struct init_text {
    const char *mesh_name, *mesh_path; /* as shown; as it stands in the file */
    const char *link_name;
    const struct scene *scene; /* in metres, z up */
    const struct init_mesh *mesh;
    const struct config_profile *profile;
    const struct viewpoint *at;
    struct init_scan scan;
};

/* Chooses the settings of a scan, within the profile's limits and with up to about 200,000 cast pulses. */
void init_choose_scan(const struct config_profile *profile, const struct viewpoint *at, struct init_scan *scan);

/* Where the head stands, in words. */
void init_describe(const struct viewpoint *at, char *buf, size_t len);

void init_write_text(const struct init_text *text, FILE *out);

#endif
