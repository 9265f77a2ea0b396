/* SPDX-License-Identifier: MIT */
#include "tests/common/reach_cases.h"

#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "core/cast/caster.h"
#include "core/studio/mesh.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "tests/common/generate.h"

#define LIVE(reach) "platform: {kind: live, reach_m: " reach "}\n"
#define PATH(file) \
    "platform: {kind: trajectory, waypoints: " file ", mount_heading_deg: -90}\n" /* the view of the others */

#define STANDING_BALL(n, i, triangles)                                                                              \
    {                                                                                                               \
        .name = "ball of " n " stands", .standing = BALL + i, .near = BALL + i, .ball = triangles, .keeps_still = 1 \
    }
#define TURNING_BALL(n, i, triangles)                                                            \
    {                                                                                            \
        .name = "ball of " n " turns", .standing = BALL + i, .near = BALL + i, .ball = triangles \
    }

enum { STANDS, LIVE_NEAR, LIVE_KM, LIVE_FAR, PATH_NEAR, PATH_FAR, SECOND, BALL };
const struct reach_case REACH_CASE[] = {
    {.name = "head stands"},
    {.name = "live, reach 10 m", .head_moves = 1, .platform = LIVE("10")},
    {.name = "live, reach 1 km", .near = LIVE_NEAR, .head_moves = 1, .platform = LIVE("1000")},
    {.name = "live, reach 100 km", .near = LIVE_NEAR, .head_moves = 1, .platform = LIVE("100000")},
    {.name = "trajectory of 15 m", .head_moves = 1, .platform = PATH("near.csv")},
    {.name = "trajectory of 1 km", .near = PATH_NEAR, .head_moves = 1, .platform = PATH("far.csv")},
    {.name = "second station 400 m away", .stations = "  - {position_m: [400, 0, 5]}\n"},
    STANDING_BALL("1,000", 0, 1000),
    TURNING_BALL("1,000", 0, 1000),
    STANDING_BALL("100,000", 2, 100000),
    TURNING_BALL("100,000", 2, 100000),
    STANDING_BALL("1 million", 4, 1000000),
    TURNING_BALL("1 million", 4, 1000000),
};
const int REACH_CASES = sizeof REACH_CASE / sizeof REACH_CASE[0];

/* The head is in the living room of the house. A ball is in its first 24 degrees. */
static const double HEAD_M[3] = {5.5, 2.2, 1.6}, BALL_M[3] = {6.1, 4.2, 1.6}, BALL_RADIUS_M = 0.7;

/* ---- files */

static const char *in(const struct reach_folder *folder, const char *name, char path[128])
{
    snprintf(path, 128, "%s/%s", folder->path, name);
    return path;
}

static int write_text(const struct reach_folder *folder, const char *name, const char *text, struct sh_err *err)
{
    char path[128];
    FILE *f = fopen(in(folder, name, path), "w");
    if (f == NULL || (fputs(text, f) < 0) + fclose(f) != 0)
        return sh_fail(err, SH_EIO, "%s: %s", path, strerror(errno));
    return SH_OK;
}

/* A closed room, 12 m wide. */
static int write_room(const struct reach_folder *folder, struct sh_err *err)
{
    struct scene *scene = NULL;
    char path[128];
    int rc = generate_terrain(10000, 12.0, 0.3, HEAD_M, 1, &scene, err);
    if (rc != SH_OK) return rc;
    const struct mesh mesh = {.n_vertices = scene->n_vertices,
                              .n_faces = scene->n_triangles,
                              .xyz_m = (const double(*)[3])scene->vertex_m,
                              .face = (const uint32_t(*)[3])scene->triangle};
    rc = mesh_write(in(folder, "room.ply", path), &mesh, NULL, err);
    scene_free(scene);
    return rc;
}

static void fill_ball(uint32_t rows, double (*v)[3], uint32_t (*t)[3])
{
    const uint32_t columns = 2 * rows;
    for (uint32_t r = 0; r <= rows; r++)
        for (uint32_t c = 0; c < columns; c++) {
            const double up = M_PI * (r / (double)rows - 0.5), around = 2.0 * M_PI * c / columns;
            double *p = v[r * columns + c];
            p[0] = BALL_M[0] + BALL_RADIUS_M * cos(up) * cos(around);
            p[1] = BALL_M[1] + BALL_RADIUS_M * cos(up) * sin(around);
            p[2] = BALL_M[2] + BALL_RADIUS_M * sin(up);
        }
    for (uint32_t r = 0; r < rows; r++)
        for (uint32_t c = 0; c < columns; c++) {
            const uint32_t a = r * columns + c, b = r * columns + (c + 1) % columns;
            uint32_t *two = *t;
            memcpy(two, (const uint32_t[]){a, b, b + columns, a, b + columns, a + columns}, 6 * sizeof *two);
            t += 2;
        }
}

/* A ball of 4 rows^2 triangles. */
static int write_ball(const struct reach_folder *folder, int triangles, struct sh_err *err)
{
    const uint32_t rows = (uint32_t)sqrt(triangles / 4.0), n_v = 2 * rows * (rows + 1), n_t = 4 * rows * rows;
    double(*v)[3] = malloc(n_v * sizeof *v);
    uint32_t(*t)[3] = malloc(n_t * sizeof *t);
    char path[128];
    int rc = v != NULL && t != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for a ball");
    if (rc == SH_OK) {
        fill_ball(rows, v, t);
        const struct mesh mesh = {
            .n_vertices = n_v, .n_faces = n_t, .xyz_m = (const double(*)[3])v, .face = (const uint32_t(*)[3])t};
        rc = mesh_write(in(folder, "ball.ply", path), &mesh, NULL, err);
    }
    free(v);
    free(t);
    return rc;
}

int reach_folder_make(struct reach_folder *folder, const char *house, struct sh_err *err)
{
    char text[256];
    *folder = (struct reach_folder){.path = "/tmp/scanhead-reach-XXXXXX", .house = house};
    if (mkdtemp(folder->path) == NULL) return sh_fail(err, SH_EIO, "%s: %s", folder->path, strerror(errno));
    int rc = write_room(folder, err);
    if (rc == SH_OK)
        rc = write_text(folder, "ground.obj",
                        "v -600 -600 -3\nv 600 -600 -3\nv 600 600 -3\nv -600 600 -3\nf 1 2 3\nf 1 3 4\n", err);
    for (int far = 0; far < 2 && rc == SH_OK; far++) {
        snprintf(text, sizeof text, "x_m,y_m,z_m,speed_m_s\n%g,%g,%g,0.2\n%g,%g,%g,0.2\n%g,%g,%g,0.2\n", HEAD_M[0],
                 HEAD_M[1], HEAD_M[2], HEAD_M[0] + 15.0, HEAD_M[1], HEAD_M[2], HEAD_M[0] + (far ? 1000.0 : 15.5),
                 HEAD_M[1], HEAD_M[2]);
        rc = write_text(folder, far ? "far.csv" : "near.csv", text, err);
    }
    return rc;
}

void reach_folder_remove(const struct reach_folder *folder)
{
    DIR *dir = opendir(folder->path);
    char path[512];
    for (const struct dirent *e; dir != NULL && (e = readdir(dir)) != NULL;) {
        snprintf(path, sizeof path, "%s/%s", folder->path, e->d_name);
        if (e->d_name[0] != '.') unlink(path);
    }
    if (dir != NULL) closedir(dir);
    rmdir(folder->path);
}

static int write_config(const struct reach_folder *folder, const struct reach_case *of, struct sh_err *err)
{
    char text[2048], ball[256] = "";
    const int house = folder->house != NULL && of->ball == 0;
    if (of->ball != 0)
        snprintf(ball, sizeof ball, "    - {file: ball.ply, up: z, scale: 1%s%s}\n",
                 of->keeps_still ? "" : ", turn_deg_s: 30, pivot_m: ", of->keeps_still ? "" : "[6.1, 4.2, 1.6]");
    snprintf(text, sizeof text,
             "head: {profile: riegl-vz400i, prr_hz: 300000, lines_hz: 120, pan_deg_s: 60, frames: 0}\n"
             "scene:\n  meshes:\n    - {file: %s, up: %s, scale: 1}\n    - {file: ground.obj, up: z, scale: 1}\n%s"
             "stations:\n  - {position_m: [%g, %g, %g], heading_deg: 0}\n%s%s"
             "output: {crs: local, layout: polar}\ncast: {sight: off}\nbeam: {mode: single}\nnoise: {range: off}\n",
             house ? folder->house : "room.ply", house ? "y" : "z", ball, HEAD_M[0], HEAD_M[1], HEAD_M[2],
             of->stations != NULL ? of->stations : "", of->platform != NULL ? of->platform : "");
    int rc = write_text(folder, "case.yaml", text, err);
    return rc == SH_OK && of->ball != 0 ? write_ball(folder, of->ball, err) : rc;
}

/* ---- casting */

static double process_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Poses that come from outside. The way is as slow as a trajectory's, so that all see nearly the same. */
static void walk(struct reach_run *run)
{
    for (int i = 0; i < 2; i++) {
        struct pose_knot *knot = &run->live[i];
        *knot = (struct pose_knot){.t_ns = i * INT64_C(1000000000)};
        memcpy(knot->pose.position_m, run->setup.station_m, sizeof knot->pose.position_m);
        knot->pose.position_m[0] += 0.2 * i;
        knot->pose.quat[0] = 1.0;
    }
    run->setup.knot = run->live;
    run->setup.n_knots = 2;
}

static int load(struct reach_run *run, const char *path, struct sh_err *err)
{
    const double start_s = process_s();
    struct bvh_info info;
    run->cfg = calloc(1, sizeof *run->cfg);
    if (run->cfg == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    int rc = config_load(path, NULL, 0, run->cfg, err);
    if (rc == SH_OK) rc = site_load(run->cfg, NULL, &run->site, err);
    if (rc != SH_OK) return rc;
    run->load_s = process_s() - start_s;
    for (uint32_t k = 0; k <= run->site->n_movers; k++) {
        const struct bvh *bvh = k == 0 ? run->site->bvh : run->site->mover[k - 1].bvh;
        info = *bvh_get_info(bvh);
        run->bytes += info.bytes;
        run->triangles += bvh_scene(bvh)->n_triangles;
    }
    run->packet = info.packet;
    return SH_OK;
}

int reach_open(const struct reach_folder *folder, const struct reach_case *of, struct reach_run *run,
               struct sh_err *err)
{
    char path[128];
    *run = (struct reach_run){.of = of};
    int rc = write_config(folder, of, err);
    if (rc == SH_OK) rc = load(run, in(folder, "case.yaml", path), err);
    if (rc == SH_OK) rc = caster_create(&run->caster, err);
    if (rc != SH_OK) return rc;
    site_look_open(&run->look, run->site);
    run->setup = run->look.place[0].setup;
    if (of->head_moves && run->site->n_knots == 0) walk(run);
    struct schedule_line line;
    schedule_get_line(&run->look.place[0].segment, 0, &line);
    return line_block_alloc(&run->block, (uint32_t)(line.cast_end - line.cast0) * site_points_per_pulse(run->site),
                            err);
}

void reach_close(struct reach_run *run)
{
    caster_free(run->caster);
    line_block_free(&run->block);
    site_free(run->site);
    free(run->cfg);
    memset(run, 0, sizeof *run);
}

uint32_t reach_cast(struct reach_run *run, uint32_t l)
{
    const struct plan_place *place = &run->look.place[0];
    const struct bvh_counters before = *bvh_work_counters(run->caster->nearest.bvh);
    struct schedule_line line;
    struct schedule_run pulses;
    schedule_get_line(&place->segment, l, &line);
    schedule_get_run(&place->segment, &line, line.cast0, (uint32_t)(line.cast_end - line.cast0), &pulses);
    if (place->enter != NULL) place->enter(place->ctx, pulses.t0_ns, &run->setup);
    caster_cast(run->caster, &run->setup, &pulses, &run->block);
    run->counted.leaves += bvh_work_counters(run->caster->nearest.bvh)->leaves - before.leaves;
    run->counted.decided += bvh_work_counters(run->caster->nearest.bvh)->decided - before.decided;
    run->pulses += pulses.n;
    return pulses.n;
}

double reach_leaves(const struct reach_run *run)
{
    return (double)run->counted.leaves * run->packet / (double)run->pulses;
}

double reach_decided(const struct reach_run *run)
{
    return (double)run->counted.decided / (double)run->pulses;
}
