/* SPDX-License-Identifier: MIT */
/* Sight: a visibility map. The map holds what a standing station sees in each direction, before rays are cast.
 *
 * In: a BVH (core/bvh.h), the one point where all rays begin, and which directions matter. Out: a map of
 * directions. For a ray the map says which triangle it meets, or that it meets nothing, without a walk through
 * the BVH. The hits are those of bvh_hits, bit by bit: range, triangle, label.
 *
 * Directions are the cells of a cube around the station. Each cell says one of four things: this triangle
 * alone; nothing; one of a list of candidates (decided ray by ray in double); ask the BVH. The proof that
 * cells are right is in core/sight/sight_inside.h.
 *
 * A sight is constant after it is made, and may be used from any thread; each thread has working memory of
 * its own. The scene must stand still. It must have no surface with holes and no copies of meshes. */
#ifndef CORE_SIGHT_H
#define CORE_SIGHT_H

#include <stdint.h>

#include "core/bvh.h"

struct sight;

/* The map leaves a group of triangles to the BVH where the group gets fewer rays than this for each of its triangles.
 * Examining a triangle costs as much as it saves for this many rays. */
#define SIGHT_GROUP_RAYS 64.0

struct sight_spec {
    const struct bvh *bvh; /* must outlive the sight */
    double station_m[3];   /* where the rays begin, prcs */
    /* The number of rays that will be cast, as if spread evenly over all directions. Cells are made no finer
     * than that many rays pay for. */
    double rays;
    uint64_t memory_bytes; /* the most that the sight takes, also while it is made; cells that don't fit ask the BVH */
    /* False where no ray goes within radius_rad of the unit vector dir (prcs). NULL: rays go everywhere. Rays
     * outside of these directions ask the BVH. */
    int (*sees)(const void *ctx, const double dir[3], double radius_rad);
    const void *ctx;
};

struct sight_info {
    uint32_t cells;                /* along an edge of the cube's faces */
    double one, nothing, few, ask; /* shares of the directions that were looked at */
    uint64_t lists, records;       /* candidate lists; triangles in them, each counted once a region */
    uint64_t bytes, peak_bytes;    /* kept; while it was made */
    double build_s;
};

/* True where a sight is possible: no surface has holes, no mesh has copies, and triangles are few enough to be
 * numbered. */
int sight_possible(const struct scene *scene);
/* Cells along an edge of the cube's faces, for rays and memory_bytes as of struct sight_spec. */
uint32_t sight_cells(double rays, uint64_t memory_bytes);
/* Returns about how many triangles a sight would examine one by one: those that are not in a group for the BVH.
 * The function looks at a few thousand triangles. */
double sight_examined(const struct sight_spec *spec);
/* Made by `threads` threads (0: all). SH_ESTOPPED where report asks to stop, SH_ENOMEM. */
int sight_create(const struct sight_spec *spec, unsigned threads, const struct sh_report *report, struct sight **out,
                 struct sh_err *err);
/* Counts one more owner, and returns the sight. Any thread. */
struct sight *sight_share(struct sight *sight);
/* Frees the sight with its last owner. Any thread. */
void sight_free(struct sight *sight);
const struct sight_info *sight_get_info(const struct sight *sight);

/* How often the cell of a ray did not give the answer by itself. */
struct sight_counters {
    uint64_t few;   /* rays decided among a few triangles */
    uint64_t asked; /* the BVH was asked: the cell says so, or double precision can't separate two edges or planes */
};

/* Working memory of one thread. */
struct sight_work;
int sight_work_create(struct sight_work **out, struct sh_err *err);
void sight_work_free(struct sight_work *work);
const struct sight_counters *sight_work_counters(const struct sight_work *work);

/* Exact hits, as bvh_hits. The rays begin at the station (rays->from.own.x is NULL, at_m the station's, bit by
 * bit); rays->scattered is not used. Hits beyond range_max_m may or may not be reported.
 * bvh_work: for rays that ask the BVH. Where rays->steep is given, bvh_work_directions are then those of the last
 * chunk, as after bvh_hits.
 * Allocates nothing. */
void sight_hits(struct sight_work *work, struct bvh_work *bvh_work, const struct sight *sight,
                const struct bvh_rays *rays);

#endif
