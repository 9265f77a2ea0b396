/* SPDX-License-Identifier: MIT */
/* Cases with moving heads and bodies, far stations, and heads with long ways. Each may cost hardly more than a head
 * that stands near the scene. Each is a whole configuration, loaded as for a run, so that it includes all that loading
 * sets up. Units are metres and seconds. */
#ifndef TESTS_COMMON_REACH_CASES_H
#define TESTS_COMMON_REACH_CASES_H

#include "core/cast.h"
#include "firmware_sim/site/look.h"
#include "firmware_sim/site/site.h"

enum { REACH_LINES = 48 }; /* of a case: two fifths of a second, 24 degrees of pan */

struct reach_case {
    const char *name;
    int standing; /* of its group: the first case, in which head and bodies stand */
    int near;     /* the case that it may cost as much as */
    int ball;     /* triangles of a ball beside the head, about; 0: none */
    int head_moves;
    int keeps_still;      /* the body's mesh doesn't move */
    const char *stations; /* more of them */
    const char *platform;
};
extern const struct reach_case REACH_CASE[];
extern const int REACH_CASES;

/* The folder of the cases' files, and the mesh that they scan; NULL is a room of 10,000 triangles. All stand in the
 * middle of 1.2 km of ground. */
struct reach_folder {
    char path[64];
    const char *house;
};
int reach_folder_make(struct reach_folder *folder, const char *house, struct sh_err *err);
void reach_folder_remove(const struct reach_folder *folder);

struct reach_run {
    const struct reach_case *of;
    struct config *cfg;
    struct site *site;
    struct site_look look;
    struct cast_setup setup;
    struct caster *caster;
    struct line_block block;
    struct pose_knot live[2];
    struct bvh_counters counted; /* of all lines that were cast */
    uint64_t pulses;             /* likewise */
    double load_s;               /* reading, building, planning: processor time of all threads */
    uint64_t bytes;              /* of all BVHs */
    uint32_t packet;             /* rays of one */
    uint32_t triangles;          /* of all that stands and moves */
};
/* The caller must release it with reach_close, also after an error. */
int reach_open(const struct reach_folder *folder, const struct reach_case *of, struct reach_run *out,
               struct sh_err *err);
void reach_close(struct reach_run *run);
/* Casts line l of REACH_LINES. Returns its pulses. */
uint32_t reach_cast(struct reach_run *run, uint32_t l);
/* The leaves that a packet is tested against, and the pairs per ray that are decided one by one. */
double reach_leaves(const struct reach_run *run);
double reach_decided(const struct reach_run *run);

#endif
