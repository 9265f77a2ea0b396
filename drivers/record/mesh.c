/* SPDX-License-Identifier: MIT */
/* Meshes of scans: .obj, .gltf, .glb and .fbx, and .ply with --mesh; points spread over the mesh: .ply with --sparse.
 *
 * The first echo of each shot is a point of the scan's grid (mesh_grid.h); core/studio/scan_mesh.h makes triangles of
 * the grid. A mesh is made when its scan is over, and the file when all scans are. Until then memory holds all points
 * of the present scan, and the points in triangles of earlier scans. A point takes about 110 bytes, its triangles 24.
 *
 * Points without a triangle are left out and counted. So are echoes after the first. Each scan is a part (an object of
 * the file) by itself. So is each sweep of the pan. Where line or row numbers go back, another part begins, too. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/grow.h"
#include "core/studio/mesh.h"
#include "core/newfile.h"
#include "drivers/record/mesh_recorder.h"
#include "drivers/record/ply_columns.h"
#include "drivers/record/mesh_texture.h"

static const double GIB = 1073741824.0;
/* Memory per point, measured with 6.5 million points. BYTES_A_POINT includes the point's place in the grid, its
 * triangles and the spare room of growing arrays. The exporter takes BYTES_OF_EXPORTER in addition. */
enum { BYTES_A_POINT = 170, BYTES_OF_EXPORTER = 900 };

static int check_points(const char *path, double n, struct sh_err *err)
{
    const double each = BYTES_A_POINT + (mesh_is_float(path) ? BYTES_OF_EXPORTER : 0);
    const double bytes = n * each, there = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    if (n > MESH_MAX_VERTICES)
        return sh_fail(
            err, SH_EINPUT,
            "%s: up to %.0f points; a mesh holds up to %d: scan fewer stations, more coarsely, or with --split", path,
            n, MESH_MAX_VERTICES);
    if (there > 0 && bytes > there)
        return sh_fail(
            err, SH_EINPUT,
            "%s: a mesh of up to %.0f points takes %.1f GiB of memory, and this machine has %.1f GiB: scan fewer "
            "stations, more coarsely, or with --split",
            path, n, bytes / GIB, there / GIB);
    return SH_OK;
}

/* Checks the size that the descriptor gives for the scan, before the scan is made. */
static int check_size(const struct mesh_recorder *m, struct sh_err *err)
{
    const struct track *t = &m->base.track;
    if (t->max_lines == UINT32_MAX || t->max_pulses == UINT32_MAX) return SH_OK;
    return check_points(t->path, m->points.n + t->cast_share * t->max_lines * (double)t->max_pulses, err);
}

/* Checks that the format's numbers can hold the places within the head's range. */
static int check_place(const char *path, int moves, const double place_m[3], double range_max_m, struct sh_err *err)
{
    double low[3], high[3];
    if (moves) return SH_OK; /* known at the end */
    for (int k = 0; k < 3; k++) {
        low[k] = place_m[k] - range_max_m;
        high[k] = place_m[k] + range_max_m;
    }
    return mesh_check_box(path, low, high, err);
}

/* Checks a scan by itself, as if every shot had an echo. Whether the scan fits after the earlier scans can't be known
 * yet: shots without echo take no room. So that is checked when the scan begins (check_size). */
static int mesh_fits(const char *path, const struct recorder_options *options, const struct recorder_scan *first,
                     const struct recorder_scan *scan, struct sh_err *err)
{
    (void)options;
    (void)first;
    int rc = check_place(path, scan->moves, scan->place_m, scan->range_max_m, err);
    return rc == SH_OK && isfinite(scan->n_shots) ? check_points(path, scan->n_shots, err) : rc;
}

/* ---- a grid is complete */

static int add_faces(struct mesh_recorder *m, const struct scan_faces *faces, struct sh_err *err)
{
    if (m->n_faces + faces->n_faces > UINT32_MAX)
        return sh_fail(err, SH_EINPUT, "%s: more than %u triangles; a mesh holds no more", m->base.track.path,
                       UINT32_MAX);
    if (!grow(&m->face, &m->room_faces, m->n_faces + faces->n_faces, sizeof *m->face))
        return sh_fail(err, SH_ENOMEM, "%s: no memory for %zu triangles", m->base.track.path,
                       m->n_faces + faces->n_faces);
    for (uint32_t i = 0; i < faces->n_faces; i++)
        for (int k = 0; k < 3; k++)
            m->face[m->n_faces + i][k] = faces->face[i][k] + m->grid.first;
    m->n_faces += faces->n_faces;
    return SH_OK;
}

/* Leaves out the points that no triangle uses. The others keep their order. */
static int drop_loose(struct mesh_recorder *m, struct scan_faces *faces, struct sh_err *err)
{
    struct mesh_grid *g = &m->grid;
    uint32_t *to = malloc((size_t)g->n * sizeof *to);
    if (to == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory for a grid of %u points", m->base.track.path, g->n);
    const uint32_t n = scan_drop_loose(g->n, faces->face, faces->n_faces, to);
    for (uint32_t i = 0; i < g->n; i++) {
        if (to[i] == SCAN_MESH_NONE) continue;
        mesh_points_move(&m->points, g->first + i, g->first + to[i]);
        g->row[to[i]] = g->row[i];
        g->line[to[i]] = g->line[i];
    }
    free(to);
    m->n_loose += g->n - n;
    g->n = n;
    m->points.n = g->first + n;
    return SH_OK;
}

static int mesh_add_part(struct mesh_recorder *m, struct part **part, struct sh_err *err)
{
    if (!grow(&m->part, &m->room_parts, m->n_parts + 1, sizeof *m->part))
        return sh_fail(err, SH_ENOMEM, "%s: no memory for another scan", m->base.track.path);
    *part = &m->part[m->n_parts++];
    **part = (struct part){.station = m->grid.station, .scan = m->grid.scan, .sweep = m->grid.sweep};
    memcpy((*part)->profile, m->profile, sizeof m->profile);
    return SH_OK;
}

/* Finishes the grid's triangles: points get normals, and texture coordinates and colours if there is a texture. */
static int finish_grid(struct mesh_recorder *m, struct scan_faces *faces, struct sh_err *err)
{
    const struct mesh_grid *g = &m->grid;
    struct part *part = NULL;
    uint32_t every = 1;
    const size_t first_face = m->n_faces;
    scan_normals((const double(*)[3])m->points.xyz_m + g->first, g->n, (const uint32_t(*)[3])faces->face,
                 faces->n_faces, m->points.normal + g->first);
    int rc = mesh_add_part(m, &part, err);
    if (rc == SH_OK && is_textured(m))
        rc = name_path(m, mesh_texture_draw(g, &m->points, &part->image, &every, err), err);
    if (every > m->every) m->every = every;
    if (rc == SH_OK) rc = drop_loose(m, faces, err);
    if (rc == SH_OK) rc = add_faces(m, faces, err);
    if (rc == SH_OK && is_textured(m) && faces->n_faces > 0)
        rc = name_path(m, mesh_texture_unwrap(g, &m->points, m->face + first_face, faces->n_faces, err), err);
    if (rc != SH_OK) return rc;
    part->n_points = m->points.n - g->first;
    part->n_faces = faces->n_faces;
    return SH_OK;
}

static int end_grid(struct mesh_recorder *m, struct sh_err *err)
{
    struct scan_faces faces = {0};
    if (m->grid.n == 0) return SH_OK;
    const struct scan_grid grid =
        mesh_grid_of(&m->grid, (const double(*)[3])m->points.xyz_m, m->base.options.long_edge);
    int rc = name_path(m, scan_faces_make(&grid, &faces, m->base.options.report, err), err);
    if (rc == SH_OK) {
        m->n_long += faces.n_long;
        m->n_flat += faces.n_flat;
        m->n_edges += faces.n_edges;
        m->edges_m += faces.mean_edge_m * (double)faces.n_edges;
        rc = finish_grid(m, &faces, err);
    }
    m->grid.n = 0;
    m->base.has_failed |= rc != SH_OK; /* the grid's points may have no part */
    scan_faces_free(&faces);
    return rc;
}

/* ---- points come */

/* Checks before the scan that a file beside the mesh can be written at the end. */
static int try_sidecar(const struct mesh_recorder *m, const char *ending, struct sh_err *err)
{
    const char *path = m->base.file.path;
    const int stem = (int)(strlen(path) - strlen(m->base.ops->ending));
    char *to;
    if (asprintf(&to, "%.*s%s", stem, path, ending) < 0)
        return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", path);
    const int rc = newfile_check(to, err);
    free(to);
    return rc;
}

static int mesh_begin(void *rec, struct sh_err *err)
{
    const struct mesh_recorder *m = rec;
    int rc = mesh_check_name(m->base.file.path, err);
    const int has_image = is_textured(m) && strcmp(m->base.ops->ending, ".glb") != 0;
    if (rc == SH_OK && has_image) rc = try_sidecar(m, ".png", err);
    if (rc == SH_OK && is_textured(m) && strcmp(m->base.ops->ending, ".obj") == 0) rc = try_sidecar(m, ".mtl", err);
    return rc == SH_OK && strcmp(m->base.ops->ending, ".gltf") == 0 ? try_sidecar(m, ".bin", err) : rc;
}

static int mesh_scan(void *rec, struct sh_err *err)
{
    struct mesh_recorder *m = rec;
    const struct track *t = &m->base.track;
    int rc = end_grid(m, err);
    if (rc == SH_OK) rc = mesh_grid_check(t, err);
    if (rc == SH_OK) rc = check_place(t->path, t->info.moving, t->pose.shift_m, t->info.range_max_m, err);
    if (rc == SH_OK) rc = check_size(m, err);
    if (rc != SH_OK) return rc;
    if (m->begun && strcmp(m->profile, t->info.profile) != 0) m->several = 1;
    snprintf(m->idn, sizeof m->idn, "%s", t->info.idn);
    snprintf(m->profile, sizeof m->profile, "%s", t->info.profile);
    m->points.has_frame = t->info.moving || t->info.stop;
    mesh_grid_begin(&m->grid, t, m->points.n);
    m->begun = 1;
    return SH_OK;
}

static void set_colour(const struct mesh_recorder *m, int i, uint8_t rgb[3])
{
    static const struct colour_scale labels = {.mode = COLOUR_LABEL};
    const struct track *t = &m->base.track;
    if (t->has_colours)
        memcpy(rgb, t->rgb[i], 3);
    else
        colour_of_point(&labels, t, i, rgb);
}

static int take_point(struct mesh_recorder *m, int i, struct sh_err *err)
{
    struct track *t = &m->base.track;
    const struct track_points *p = &t->points;
    struct mesh_point point = {.xyz_m = {p->x[i], p->y[i], p->z[i]},
                               .range_m = p->range_m[i],
                               .reflectance_db = (float)p->reflectance_db[i],
                               .label = p->label[i],
                               .station = (uint16_t)t->info.station,
                               .frame = t->info.moving ? t->frame[i] : t->info.frame};
    if (!t->info.geo) station_pose_forward(&t->pose, point.xyz_m);
    if (track_is_nowhere(t, point.xyz_m[0], point.xyz_m[1], point.xyz_m[2])) return SH_OK;
    set_colour(m, i, point.rgb);
    int is_in = mesh_grid_add(&m->grid, t, i, point.xyz_m, err);
    if (is_in < 0) return is_in;
    m->n_lost += is_in == 0;
    const int rc = is_in ? name_path(m, mesh_points_add(&m->points, &point, err), err) : SH_OK;
    m->base.has_failed |= rc != SH_OK; /* the grid has a point more than the mesh */
    return rc;
}

static int mesh_take_points(void *rec, int n, struct sh_err *err)
{
    struct mesh_recorder *m = rec;
    const struct track *t = &m->base.track;
    int rc = SH_OK;
    for (int i = 0; rc == SH_OK && i < n; i++) {
        if (t->points.echo[i] > 1) m->n_later++;
        if (t->points.echo[i] > 1 || t->points.echo_count[i] == 0) continue;
        if (!mesh_grid_takes(&m->grid, t, i)) {
            m->n_split += t->sweep == m->grid.sweep;
            rc = end_grid(m, err);
            mesh_grid_begin(&m->grid, t, m->points.n);
        }
        if (rc == SH_OK) rc = take_point(m, i, err);
    }
    return rc;
}

/* ---- the end */

static void mesh_report(const struct mesh_recorder *m)
{
    const struct recorder *r = &m->base;
    char what[160];
    if (m->n_faces == 0) sh_warn(r->options.report, "%s: it has no triangles", r->file.path);
    if (m->n_edges > 0) {
        snprintf(what, sizeof what,
                 "triangles left out, with an edge over %g times their scan's mean edge, %.4g m (--long-edge)",
                 r->options.long_edge, m->edges_m / (double)m->n_edges);
        recorder_report(r, m->n_long, what);
    }
    recorder_report(r, m->n_flat, "triangles left out that have no area or are seen edge-on");
    recorder_report(r, m->n_loose, "points left out that belong to no triangle");
    recorder_report(r, m->n_later, "echoes left out; a mesh holds the first of a shot");
    recorder_report(r, m->n_lost, "points left out whose pose was lost");
    recorder_report(r, m->n_split, "additional meshes begun within a scan, since its line or row numbers went back");
    if (mesh_takes_points(r->file.path)) /* the other formats have no header */
        recorder_report(r, ply_count_unnamed(&r->track), PLY_UNNAMED);
    if (m->every > 1) {
        snprintf(what, sizeof what, "lines and rows share one texel, since a texture has up to %d texels a side",
                 MESH_TEXTURE_SIDE);
        recorder_report(r, m->every, what);
    }
}

static int mesh_finish(void *rec, struct sh_err *err)
{
    struct mesh_recorder *m = rec;
    int rc = end_grid(m, err);
    if (rc != SH_OK) return rc;
    outfile_yield(&m->base.file); /* removes FILE.part, which kept other recordings away from the path until now */
    if (m->n_faces == 0 && !mesh_takes_points(m->base.file.path))
        return sh_fail(err, SH_EINPUT, "%s: this scan has no triangles, and a %s file can't be empty",
                       m->base.file.path, m->base.ops->ending);
    rc = mesh_recorder_write(m, err);
    if (rc == SH_OK) mesh_report(m);
    return rc;
}

static void mesh_release(void *rec)
{
    struct mesh_recorder *m = rec;
    for (size_t i = 0; i < m->n_parts; i++)
        picture_free(&m->part[i].image);
    free(m->part);
    free(m->face);
    mesh_points_free(&m->points);
    mesh_grid_free(&m->grid);
}

/* Without REPAIR: an exporter writes the file in one piece at its end, so a kill leaves no mesh. */
#define MESH_OPS(ENDING, REPAIR)                                                                                 \
    {                                                                                                            \
        .ending = ENDING, .is_mesh = 1, .size = sizeof(struct mesh_recorder),                                    \
        .track = {.scan = mesh_scan, .points = mesh_take_points, .metres = 1, .grid = 1, .wants_colours = 1},    \
        .fits = mesh_fits, .begin = mesh_begin, .finish = mesh_finish, .release = mesh_release, .repair = REPAIR \
    }

const struct recorder_ops recorder_mesh_ply = MESH_OPS(".ply", ply_repair), recorder_obj = MESH_OPS(".obj", obj_repair),
                          recorder_gltf = MESH_OPS(".gltf", NULL), recorder_glb = MESH_OPS(".glb", NULL),
                          recorder_fbx = MESH_OPS(".fbx", NULL);
