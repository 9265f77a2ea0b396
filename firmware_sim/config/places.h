/* SPDX-License-Identifier: MIT */
/* Where things stand, as a configuration has it: meshes, the anchor, stations with their tripods, the platform. */
#ifndef FIRMWARE_SIM_CONFIG_PLACES_H
#define FIRMWARE_SIM_CONFIG_PLACES_H

#include <stdint.h>

#include "core/scene.h"
#include "firmware_sim/config/limits.h"

struct config_mesh {
    char file[CONFIG_PATH_LEN];
    enum scene_up up;
    double scale, offset_m[3];
    /* Motion, at time t of the scan: turned by turn_deg_s * t about the vertical through pivot_m, clockwise
     * seen from above, then shifted by move_m_s * t; with cycle_s, back and forth. All zero: the mesh stands
     * still. */
    double move_m_s[3], turn_deg_s, pivot_m[3], cycle_s;
    char copies[CONFIG_PATH_LEN]; /* CSV file of places; empty: they are in struct config_scene, or there are none */
    int copy_labels;              /* each copy has surfaces of its own */
};

static inline int config_mesh_moves(const struct config_mesh *mesh)
{
    return mesh->turn_deg_s != 0.0 || mesh->move_m_s[0] != 0.0 || mesh->move_m_s[1] != 0.0 || mesh->move_m_s[2] != 0.0;
}

/* A copy of a mesh that is listed in the configuration itself. */
struct config_copy {
    uint32_t mesh;
    struct scene_place place;
};
enum { CONFIG_COPY_SCALES = 1000 }; /* a copy's scale: from 1 / CONFIG_COPY_SCALES to CONFIG_COPY_SCALES */

/* How the scene lies on the Earth; core/geoframe.h. */
enum config_anchor_source { ANCHOR_NONE, ANCHOR_EXPLICIT, ANCHOR_IFC, ANCHOR_UTM, ANCHOR_ECEF, ANCHOR_GEOTIFF };
struct config_anchor {
    enum config_anchor_source source;
    double origin_m[3], lat_deg, lon_deg, height_m, north_deg;
    uint32_t utm_zone; /* 0: UPS */
    int north;         /* hemisphere */
    int height_given;  /* height_m is given: ifc uses it in place of RefElevation, geotiff in place of 0 */
};

/* The form in which a station's place on the Earth is given. */
enum config_place { PLACE_NONE, PLACE_GEODETIC, PLACE_UTM, PLACE_ECEF };

enum config_choice { CHOICE_AUTO, CHOICE_OFF, CHOICE_ON };

/* The tripod under a station's head (firmware_sim/site/tripod.c). */
struct config_tripod {
    int given; /* 0: no tripod, so nothing is hidden */
    double leg_m, opening_min_deg;
    double head_above_m;     /* the head's origin above the tripod's top */
    enum config_choice cone; /* hides what is below the head; auto: where there are no legs to hide it */
    int legs;                /* three prisms that the head can scan */
    double leg_diameter_m, legs_heading_deg;
};

enum {
    CONFIG_NAME_LEN = 32,        /* room of the name that a configuration gives to a station */
    CONFIG_STATION_NAME_LEN = 64 /* the same, with " frame N" after it, as stops at stations have it */
};

struct config_station {
    char name[CONFIG_STATION_NAME_LEN];
    double position_m[3];                    /* of the head's origin in the scene frame; with instrument_height_m only
                                              * of a point above the floor */
    int has_position;                        /* 0: it follows from the place on the Earth, through the anchor */
    double heading_deg, pitch_deg, roll_deg; /* pose_attitude */
    double instrument_height_m;              /* of the head's origin above the floor below position_m */
    int has_instrument_height;
    enum config_place place;
    double lat_deg, lon_deg, height_m; /* of the head's origin; height_m also with PLACE_UTM */
    uint32_t utm_zone;                 /* 0: UPS */
    int north;                         /* hemisphere */
    double easting_m, northing_m;
    double ecef_m[3];
    struct config_tripod tripod;
    int has_scanner;  /* there is a section `scanner` */
    uint32_t scanner; /* the first station, from 1, of those with the same scanner */
};

enum config_platform_kind { PLATFORM_STATIC, PLATFORM_TRAJECTORY, PLATFORM_LIVE, PLATFORM_STOPS };
enum config_at_end { PLATFORM_STOP, PLATFORM_HOLD };

/* The platform under the head. Attitudes as core/pose.h defines them. */
struct config_platform {
    enum config_platform_kind kind;
    char file[CONFIG_PATH_LEN], waypoints[CONFIG_PATH_LEN];   /* trajectory, stops: one of them */
    double start_s, end_s;                                    /* part of the trajectory, after its first sample */
    int has_end;                                              /* 0: to its last sample */
    double step_s;                                            /* stops: from each to the next */
    double frames_per_s, first_frame, last_frame, frame_step; /* stops: the same in frames; frames_per_s 0: unused */
    enum config_at_end at_end;
    double mount_m[3], mount_heading_deg, mount_pitch_deg, mount_roll_deg; /* of the head on the platform */
    double reach_m, extrapolate_ms;                                        /* live */
    char address[64];
    uint32_t port; /* live, in real time: UDP; 0: the system chooses */
};

/* Returns whether the head moves while it scans. */
static inline int config_head_moves(const struct config_platform *platform)
{
    return platform->kind == PLATFORM_TRAJECTORY || platform->kind == PLATFORM_LIVE;
}

#endif
