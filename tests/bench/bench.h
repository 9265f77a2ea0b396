/* SPDX-License-Identifier: MIT */
/* All programs of tests/bench share this: what is measured, and the means. README.md describes the method. Lengths are
 * in metres, times in nanoseconds per pulse, and positions in the scene frame. */
#ifndef TESTS_BENCH_BENCH_H
#define TESTS_BENCH_BENCH_H

#include "core/cast.h"
#include "core/scene.h"
#include "core/schedule.h"
#include "core/studio/mesh.h"
#include "tests/common/embree_alone.h"

enum { BENCH_LINES = 400, BENCH_LINE_PULSES = 2500, BENCH_MIN_ROUNDS = 7, BENCH_MAX_ROUNDS = 101 };

/* This is beyond any wall of the scenes, and is the same for Embree and for us. */
#define BENCH_RANGE_MAX_M 10000.0
#define BENCH_SCALE_M     1e-5 /* the range fits into 31 bits with it */

/* ---- scene.c: the places that are scanned */
struct bench_target {
    char name[32];
    struct scene *scene;
    double station_m[3];
    double load_s;
};
/* Returns the number of triangles that a name like 10k, 1M or 25000 stands for. Returns 0 if it is no number of 100 to
 * 100M. */
uint32_t bench_count(const char *name);
int bench_is_house(const char *name); /* whether it is house or garden, which need the IFC file */
int bench_is_made(const char *name);  /* whether it is foliage or huge, which are generated */
/* "house" reads the IFC file and is seen from its living room, "garden" from outside. A number makes closed terrain,
 * 200 m wide and 3 m rough, seen from 4.7 m above its middle. "foliage" is three crowns of 20,000 leaves in a box.
 * "huge" is a triangle of 2,000 km below 4,000 triangles of some centimetres. */
int bench_target_load(const char *name, const char *house, const struct sh_report *report, struct bench_target *out,
                      struct sh_err *err);
void bench_target_free(struct bench_target *target);
struct mesh bench_target_mesh(const struct bench_target *target);
/* The ending chooses the format (core/studio/mesh.h). */
int bench_target_write(const struct bench_target *target, const char *path, struct sh_err *err);

/* ---- rays.c: a normal scan of lines of 100 degrees, spread over a turn of the pan */
enum { BENCH_LOWEST_DEG = -40, BENCH_HIGHEST_DEG = 60, BENCH_MAX_LINE = 6000 /* pulses */ };
struct bench_rays {
    struct schedule_segment segment;
    uint32_t lines, line_pulses, n;
    double *dx, *dy, *dz; /* unit vectors, prcs */
    float *fx, *fy, *fz;  /* the same for Embree */
};
/* Sets a turn of so many lines, with `pulses` each. */
void bench_schedule(uint32_t lines, uint32_t pulses, uint32_t frames, struct schedule_spec *spec);
/* The first makes room for some lines of a turn. The second fills in the rays of the lines from first_line on. */
int bench_rays_room(const struct schedule_spec *spec, uint32_t lines, uint32_t line_pulses, struct bench_rays *out,
                    struct sh_err *err);
void bench_rays_aim(struct bench_rays *rays, uint32_t first_line);
/* Fills in the rays of the first `bundle` lines in each group of bundle * every lines. */
void bench_rays_spread(struct bench_rays *rays, uint32_t bundle, uint32_t every);
/* Makes the rays of a whole turn of so many lines. */
int bench_rays_create(uint32_t lines, struct bench_rays *out, struct sh_err *err);
void bench_rays_free(struct bench_rays *rays);
/* One block of rays is worked on while it lies in the cache, as the pipeline has its rays. */
enum { BENCH_BLOCK = 2000 }; /* it divides the pulses of 4 lines and is a multiple of 16 */
struct bench_block {
    double dx[BENCH_BLOCK], dy[BENCH_BLOCK], dz[BENCH_BLOCK];
    float fx[BENCH_BLOCK], fy[BENCH_BLOCK], fz[BENCH_BLOCK];
};
/* Takes up to a block's rays. Returns how many. */
uint32_t bench_rays_block(const struct bench_rays *rays, uint32_t first, struct bench_block *out);

/* ---- setup.c: the other parts that a scan needs, with the figures of a real head */
struct bench_case {
    const struct bench_target *target;
    const struct bench_rays *rays;
    struct embree_alone *embree, *fast; /* robust, which all is compared with; without that flag */
    struct bvh *bvh;
    double seconds; /* it measures for so long, but at least BENCH_MIN_ROUNDS */
};
#define BENCH_ENCODER 1048576.0 /* counts per turn, as in most profiles with encoders in config/heads */
/* Sets Embree up alone over a mesh, with the bench's longest range and all threads for the build. */
int bench_embree(const struct scene *scene, const double origin_m[3], int robust, struct embree_alone *out,
                 struct sh_err *err);
/* Prepares Embree for the packets at which it is fastest: 4, 8 or 16 rays, from memory or filled on the way. cost()
 * measures a pass with the present *width and *feed. */
int bench_choose_embree(struct embree_alone *e, uint32_t *width, enum embree_feed *feed, double (*cost)(void *ctx),
                        void *ctx, struct sh_err *err);
/* The station is at 52.5 N, 13.4 E, and positions are in ECEF. */
int bench_georef(const struct bench_target *target, struct georef **out, struct sh_err *err);
void bench_setup(const struct bench_case *c, const struct georef *georef, struct cast_setup *setup);
double bench_thread_s(void); /* processor time of this thread */
void bench_sort(double *values, size_t n);
double bench_median(double *values, uint32_t n); /* sorts them */

/* ---- measure.c: one thread, everything in turns, medians of the rounds' ratios */
enum bench_stage {
    STAGE_SCHEDULE,   /* line, run, firing times */
    STAGE_DIRECTIONS, /* angles, sines, rotation, rounding to float */
    STAGE_EMBREE,     /* the way to the leaves, and what they decide */
    STAGE_REFINE,     /* labels and incidence */
    STAGE_DETECT,     /* limits, echo, label */
    STAGE_NOISE,
    STAGE_GEOREF, /* encoder readings, their sines, position, CRS, counts */
    STAGE_ENCODE, /* the frame but its checksum */
    STAGE_CRC,
    BENCH_STAGES
};
extern const char *const bench_stage_name[BENCH_STAGES];

struct bench_result {
    uint32_t rounds, pulses; /* pulses of a pass */
    uint32_t embree_width;
    enum embree_feed embree_feed;
    double embree_ns, fast_ns, cast_ns, pipeline_ns, ideal_ns, staged_ns; /* per pulse: medians */
    double cast_ratio, pipeline_ratio, ideal_ratio,
        fast_ratio; /* Embree's time by ours: medians of the rounds' ratios */
    double stage_ns[BENCH_STAGES];
    int same_bytes;                /* the staged pipeline gave the same bytes as the whole one */
    struct cast_counters counters; /* of one pass */
};
/* The caller must pin the thread first. */
int bench_measure(const struct bench_case *c, struct bench_result *out, struct sh_err *err);

/* ---- stages.c: the whole pipeline again, with the cycle counter read between its stages */
struct bench_stages;
int bench_stages_create(struct bench_stages **out, struct sh_err *err);
void bench_stages_free(struct bench_stages *stages);
/* Makes one line and adds the cycles of each stage. The block and its bytes are as the pipeline makes them. Returns the
 * number of bytes. */
size_t bench_stages_line(struct bench_stages *stages, const struct cast_setup *setup,
                         const struct schedule_segment *segment, uint64_t line, uint64_t cycles[BENCH_STAGES],
                         struct line_block *block, uint8_t *bytes, size_t cap);
uint64_t bench_cycles(void);

/* ---- real_loop.c: the real loop with the null link, as fast as it goes, beside Embree on as many threads */
struct bench_threads {
    uint32_t threads;
    double embree_mrays_s, pulses_per_s, ratio; /* ratio: median of the rounds */
    double cpu_ns;                              /* processor time of all threads per pulse */
};
int bench_loop(const struct bench_case *c, const struct bench_result *one, uint32_t threads, struct bench_threads *out,
               struct sh_err *err);

/* ---- leaks.c: rays aimed at edges and corners of closed meshes */
enum { BENCH_LEAK_MESHES = 4 };
struct bench_leaks {
    const char *mesh;
    uint32_t triangles;
    uint64_t rays, leaks, passed; /* passed: hit the inside of the mesh behind the target, which is wrong as well */
    double ns_per_ray;            /* processor time */
    struct cast_counters counters;
    uint64_t plain_rays, plain_leaks;               /* Embree alone, robust, in packets */
    uint64_t sight_rays, sight_differ, sight_asked; /* by sight: a bit differs from the cast; the BVH was asked */
};
int bench_leaks(uint64_t rays, uint64_t seed, uint32_t threads, const struct sh_report *report,
                struct bench_leaks out[BENCH_LEAK_MESHES], struct sh_err *err);

#endif
