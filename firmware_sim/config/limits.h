/* SPDX-License-Identifier: MIT */
/* The largest numbers of meshes, links, stations and so on in a configuration, for modules that keep arrays of them. */
#ifndef FIRMWARE_SIM_CONFIG_LIMITS_H
#define FIRMWARE_SIM_CONFIG_LIMITS_H

enum { CONFIG_PATH_LEN = 512 };

enum {
    CONFIG_MAX_MESHES = 64,
    CONFIG_MAX_COPIES = 256, /* copies listed in the configuration itself, of all meshes together */
    CONFIG_MAX_LINKS = 8,
    CONFIG_MAX_STATIONS = 64,
    CONFIG_MAX_SURFACES = 64,
    CONFIG_MAX_STOPS = 4096,
    CONFIG_MAX_THREADS = 64
};

#endif
