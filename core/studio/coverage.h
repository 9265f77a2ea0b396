/* SPDX-License-Identifier: MIT */
/* Coverage: the part of a scene's surface that pulses hit, and where a head would see most of the rest.
 *
 * In: a scene with its BVH (prcs, metres), and scans as setups and schedules. Out: figures of each cell of the surface,
 * sums over all cells, a mesh of the cells.
 *
 * Cells. Each triangle is cut into pieces that are at most cell_m across (core/studio/coverage/cut.h); the sum of their
 * areas is its area. Pieces make one cell where their centres lie in one cube of side cell_m, they have one label, and
 * their normals have the same largest component with the same sign. So small triangles share
 * a cell, and the two sides of a wall never do. A cell reaches at most 2.5 cell_m along each axis. Area counts, not
 * the number of cells.
 *
 * A cell is seen where the centre of a pulse hits one of its pieces, from either side, and the head can report it
 * (caster_meet: within its ranges and above its threshold, both without noise; through glass, not in mirrors).
 * Triangles with the same corners are one surface: all but one are left out (scene_find_duplicate_faces). Moving bodies
 * hide the surfaces behind them, and have no cells. Faces between bodies, such as the inner faces of a wall's layers,
 * count as surface that is never seen.
 *
 * A coverage belongs to one thread. Functions that cast start threads of their own; results do not depend on their
 * number. */
#ifndef CORE_STUDIO_COVERAGE_H
#define CORE_STUDIO_COVERAGE_H

#include <stdatomic.h>
#include <stdint.h>

#include "core/bvh.h"
#include "core/cast.h"
#include "core/err.h"
#include "core/schedule.h"

struct coverage;

struct coverage_spec {
    const struct bvh *bvh; /* its scene is cut; both must outlive the coverage */
    const uint8_t *silent; /* by label: surfaces that give no echo (cast_setup), and so have no cells; NULL: none */
    double cell_m;
    double memory_mib; /* for cells and pieces */
    unsigned threads;  /* at least 1 */
};

/* SH_EINPUT: the cells need more memory than allowed; the text has the figures and a cell that would do. SH_ESTOPPED
 * where report asks to stop. */
int coverage_create(const struct coverage_spec *spec, const struct sh_report *report, struct coverage **out,
                    struct sh_err *err);
void coverage_free(struct coverage *coverage);

/* A scan: its setup, and its pulses. */
struct coverage_scan {
    struct cast_setup setup;
    struct schedule_segment segment; /* has an end */
    /* Sets the poses of what moves at a time of the scan; NULL: nothing moves. Any thread may call it, each with a
     * setup of its own. */
    void (*enter)(void *ctx, int64_t t_ns, struct cast_setup *setup);
    void *ctx;
    /* Gets the scan's hits as well, also those on bodies, from the threads that cast. NULL: they are not wanted. */
    void (*take)(void *take_ctx, const struct cast_hit *hit, uint32_t n);
    void *take_ctx;
};

struct coverage_pulses {
    uint64_t cast, met;   /* pulses; those with a hit that counts, on the scene that stands still */
    uint64_t hits, front; /* such hits; those on the front of a triangle */
};

/* Casts a scan. The scan's result waits until it is kept or dropped; casting another scan drops it. Reports progress
 * after a second. SH_ENOMEM; SH_ESTOPPED where report asks to stop. */
int coverage_look(struct coverage *coverage, const struct coverage_scan *scan, const char *what,
                  const struct sh_report *report, struct coverage_pulses *pulses, struct sh_err *err);
/* Gives figures of the waiting scan: the area that it sees, and the part of it that no scan before has seen. */
void coverage_waiting(const struct coverage *coverage, double *seen_m2, double *gain_m2);
/* Keeps the waiting scan as the scan of the next station. Stations are numbered from 1 in the order of these calls. */
void coverage_keep(struct coverage *coverage);
void coverage_drop(struct coverage *coverage);

/* For stations that are tried and changed one by one. cells[(coverage_cells + 63) / 64]: a bit for each cell that the
 * waiting scan sees. A scan whose cells are stored can be kept again later, with these cells but without its pulses. */
void coverage_waiting_cells(const struct coverage *coverage, uint64_t *cells);
void coverage_keep_cells(struct coverage *coverage, const uint64_t *cells);
/* Forgets all stations, and the scan that waits. */
void coverage_forget(struct coverage *coverage);

/* ---- figures */

/* The spread of a figure over the area that is seen. Cells count by their area. On 5 %, 50 % and 95 % of the area the
 * figure is at most p05, p50 and p95. */
struct coverage_spread {
    double mean, p05, p50, p95; /* NaN: nothing is seen */
};

struct coverage_sums {
    uint32_t stations, cells;
    uint64_t pieces, triangles;
    double area_m2, duplicate_m2, silent_m2; /* of all cells; of duplicate faces, and faces without echo: left out */
    double none_m2, one_m2, several_m2;      /* area that no, one, or several stations see */
    struct coverage_spread density_1_m2;     /* pulses per area, of all stations; over the area that is seen */
    struct coverage_spread incidence_rad;    /* the smallest of each cell, over the area that is seen */
    struct coverage_spread range_m;          /* the smallest of each cell, over the area that is seen */
};
int coverage_sum(const struct coverage *coverage, struct coverage_sums *sums, struct sh_err *err);

/* Sets alone_m2[n], n the number of stations that were kept, to the area that only that station sees. */
void coverage_alone(const struct coverage *coverage, double *alone_m2);

struct coverage_of_label {
    double area_m2, seen_m2, several_m2;
    uint64_t pulses;
};
/* Sets label[n_surfaces], by label of the scene. */
void coverage_by_label(const struct coverage *coverage, struct coverage_of_label *label);

/* One cell, for tests and pictures. */
struct coverage_cell {
    double area_m2;
    uint32_t pulses, stations;
    double incidence_rad, range_m; /* NaN: not seen */
    uint16_t label, first_station; /* 0: none */
};
uint32_t coverage_cells(const struct coverage *coverage);
void coverage_get(const struct coverage *coverage, uint32_t cell, struct coverage_cell *out);

/* Returns the cell that has the place p_m of a triangle of the scene. p_m may lie a little beside the triangle, as a
 * measured point does. COVERAGE_NO_CELL: the triangle is left out, since it lies on another one or is silent. Any
 * thread. */
enum { COVERAGE_NO_CELL = 0xffffffff };
uint32_t coverage_cell_at(const struct coverage *coverage, uint32_t triangle, const double p_m[3]);

/* Calls `piece` for all pieces in their order, with the cell and n = 3 or 4 corners (prcs), counter-clockwise where the
 * triangle's are. Neighbouring pieces of one triangle and one cell may come as one. */
typedef void coverage_piece(void *ctx, uint32_t cell, int n, const double corner[4][3]);
void coverage_pieces(const struct coverage *coverage, coverage_piece *piece, void *ctx);

/* ---- a picture: the cells as a mesh with colours and the scalars stations, density, incidence_deg, range_m and cell.
 * Where a figure is not there it is -1. The ending says the format (core/studio/mesh.h); scalars are of .ply alone. */

/* SEEN: seen by none red, by one yellow, by several green. COUNT: how many stations, blue none to red all. DENSITY:
 * pulses per area, on a logarithmic scale: blue at its 5 % percentile of the area that is seen, red at 95 %. INCIDENCE:
 * blue at 0 degrees, red at 90 degrees. Where nothing is seen the last two are grey. */
enum coverage_colour { COVERAGE_SEEN, COVERAGE_COUNT, COVERAGE_DENSITY, COVERAGE_INCIDENCE };
int coverage_write_mesh(const struct coverage *coverage, const char *path, enum coverage_colour colour,
                        const struct sh_report *report, struct sh_err *err);

/* ---- the next station */

/* Directions of a head, prcs, and the solid angle that each stands for. */
struct coverage_directions {
    uint32_t n;
    const double (*dir)[3]; /* [n] unit vectors */
    const double *each_sr;  /* [n] */
    double range_min_m, range_max_m;
};

/* The unseen surface that a head at a place would see, estimated by far fewer rays than a scan has. A ray that hits a
 * cell which no station sees stands for the area range^2 each_sr / cos(incidence), cos at least 0.02. Where this area
 * is less than the cell's, several rays hit the cell, and it counts as a whole, as it does in a scan. Where the area is
 * more, the ray stands for the cells around, too, and counts with its area. An infinite each_sr lets each cell that is
 * hit count as a whole. The estimate misses cells that lie between rays, if only a corner of them is seen. The estimate
 * is too large by cells that a scan's points miss, and by the parts of rays' areas that reach beyond a surface's
 * outline: on average half a ray's area along all outlines. Glass counts as a wall, and moving bodies as nothing. */
struct coverage_gain {
    double gain_m2;
    double front; /* share of the rays' hits that are on the front of a triangle; NaN: no ray hits */
};
/* Places of a head, prcs. */
struct coverage_places {
    uint32_t n;
    const double (*place_m)[3]; /* [n] */
    _Atomic uint64_t *cells;    /* gets a bit for each cell that a ray hits, seen before or not; NULL: not asked for */
};
/* Sets gain[places->n]. */
int coverage_gains(const struct coverage *coverage, const struct coverage_directions *directions,
                   const struct coverage_places *places, const struct sh_report *report, struct coverage_gain *gain,
                   struct sh_err *err);

#endif
