/* SPDX-License-Identifier: MIT */
/* Private to core/sight: how a sight is made.
 *
 * Triangles are sorted into regions, squares of cells on the faces (bins.c). Each region is then divided as Warnock's
 * algorithm does (J. Warnock, A hidden surface algorithm, 1969): a square is a leaf where no triangle may be seen in
 * it, or where one covers it and hides the others. A square is also a leaf where a few triangles all cover it. Where
 * only groups may be seen in a square, it is a leaf if one of them fills it, or if it is small. Else its quarters are
 * examined, down to a cell (region.c).
 *
 * Triangles that follow each other in the scene's list make a group. Where a group's triangles are so small that too
 * few rays meet each, the group is a candidate as a whole: the box around it says where it may be seen, and how near it
 * begins. A group hides nothing; rays that may meet it ask the BVH. So most triangles of a large scene cost
 * little. */
#ifndef CORE_SIGHT_BUILD_INSIDE_H
#define CORE_SIGHT_BUILD_INSIDE_H

#include "core/sight/sight_inside.h"

enum {
    BUILD_REGIONS = 16, /* along an edge of a face, at most */
    BUILD_NO_RECORD = 0xffffffff,
    BUILD_NOT_KEPT = 0xffffffff,
    BUILD_GROUP = 32, /* triangles of a group */
    BUILD_GROUP_BIT = 31,
};
/* In build_shared.binned this bit says that the number is that of a group. */
#define BUILD_IS_GROUP (1U << BUILD_GROUP_BIT)

/* The side planes of a face's pyramid are a little wider than the face. */
#define BUILD_WIDER  (1.0 + 4.0 * SIGHT_PAD)
#define BUILD_BESIDE (1e6 * SIGHT_TILT_DOUBT)

/* The box around a group, from the station. */
struct build_group {
    double lo_m[3], hi_m[3];
    double far_m;   /* no coordinate is larger */
    int8_t whole;   /* it is a candidate itself */
    uint8_t beside; /* a bit for each face that shows nothing of it */
};

/* A triangle in a region: functions linear in u and v, as constant and slopes f[0] + f[1] u + f[2] v. The functions
 * have the meaning and the scale of those in struct sight_record. */
struct build_candidate {
    union {
        double edge[3][3];
        double rect[2][2]; /* of a group: middle and half the width of u and v where it is seen */
    };
    double edge_slope[3]; /* |f[1]| + |f[2]| */
    double plane[3], plane_slope;
    double slack, graze;
    double near_m;     /* no point of it is nearer to the station */
    uint32_t triangle; /* BVH_NO_TRIANGLE: it is a group */
    uint32_t record;   /* BUILD_NO_RECORD: not yet in a list */
};

/* Arrays that all threads take elements from, up to a fixed size. */
struct build_arena {
    _Atomic uint64_t used;
    uint64_t room; /* elements */
};

struct build_shared {
    struct sight *sight;
    const struct sight_spec *spec;
    const struct sh_report *report;
    uint32_t regions, region_cells;  /* along an edge of a face; cells along an edge of a region */
    struct build_candidate *figures; /* of triangles in many regions, in prcs, without slopes */
    uint32_t *kept;                  /* [of all triangles] place in figures, or BUILD_NOT_KEPT; NULL: none are kept */
    uint8_t *seen;                   /* [regions of all faces] 0: no ray goes there */
    uint64_t *bin;                   /* [regions of all faces + 1] of binned */
    uint32_t *binned;                /* triangles and groups by region */
    struct build_group *group;       /* [n_groups] */
    uint32_t n_groups;
    _Atomic uint32_t next;       /* region to be divided */
    _Atomic uint64_t bytes;      /* taken, of spec->memory_bytes */
    _Atomic uint64_t given_back; /* of these, freed at the end */
    struct build_arena leaf, list, record;
    _Atomic uint64_t cells[4]; /* by what they say: one, nothing, few, ask */
    int may_coarsen;           /* 1: where the memory is full, the build begins again with larger cells */
    _Atomic int full;          /* bytes would have become more than the memory */
    _Atomic int failed;        /* SH_ENOMEM, SH_ESTOPPED */
};

/* Takes n elements of `size` bytes. UINT64_MAX: there is no more room. */
uint64_t build_take(struct build_shared *b, struct build_arena *arena, uint64_t n, uint64_t size);

/* ---- groups.c */
int build_groups(struct build_shared *b, struct sh_err *err);
/* Finds where a group is seen on a face: u from rect[0][0] to rect[0][1], v in rect[1]. Returns 0 where no bounds are
 * known. */
int build_group_rect(const struct build_group *g, uint32_t face, double rect[2][2]);
void build_group_candidate(const struct build_group *g, uint32_t face, struct build_candidate *c);

/* ---- bins.c: fills seen, bin and binned, and counts each triangle's regions in kept. Where binned and kept need more
 * memory than is allowed, seen becomes 0 for all regions. */
int build_bins(struct build_shared *b, struct sh_err *err);

/* ---- candidate.c */
/* Corners relative to the station. */
void sight_corners(const struct sight *sight, uint32_t triangle, double v[3][3]);
/* Computes the figures of triangles in many regions in advance. */
void build_figures(struct build_shared *b);
/* False where no ray meets the triangle: it has no area, or a corner is at the station. */
int build_candidate(const struct build_shared *b, uint32_t face, uint32_t triangle, struct build_candidate *c);
void build_record(const struct build_candidate *c, uint32_t face, struct sight_record *r);

/* ---- region.c */
/* Working memory of one thread. */
struct build_work {
    struct build_candidate *candidate;
    size_t n, room, groups; /* groups: how many of the n */
    uint16_t *where;        /* [where_room] of candidates, while a square is looked at */
    size_t where_room;
    uint32_t *stack; /* numbers of candidates, square within square */
    size_t stack_room;
    uint64_t taken; /* bytes of build_shared's */
};
void build_work_free(struct build_work *w);
/* Divides one region, numbered as in bin. 0 or SH_ENOMEM. */
int build_region(struct build_shared *b, struct build_work *w, uint32_t region);

#endif
