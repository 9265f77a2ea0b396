/* SPDX-License-Identifier: MIT */
/* The figures of a triangle as seen from the station: its edges, its plane and its distance. Doubts bound the rounding
 * errors of edges and plane (sight_inside.h). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/sight/build_inside.h"
#include "core/vec3.h"

/* Figures of triangles that lie in MANY_REGIONS or more are kept, where they take at most 1 / FIGURES_SHARE of the
 * memory that the map may take. */
enum { MANY_REGIONS = 4, FIGURES_SHARE = 8 };

void sight_corners(const struct sight *sight, uint32_t triangle, double v[3][3])
{
    const struct scene *scene = bvh_scene(sight->bvh);
    for (int i = 0; i < 3; i++)
        vec3_sub(scene->vertex_m[scene->triangle[triangle][i]], sight->station_m, v[i]);
}

/* Turns the coefficients of a linear function of the direction from the axes of prcs to those of a face. */
static void to_face(const double f[3], uint32_t face, double out[3])
{
    const uint32_t axis = face / 2;
    out[0] = face & 1 ? -f[axis] : f[axis];
    out[1] = f[(axis + 1) % 3];
    out[2] = f[(axis + 2) % 3];
}

static void from_face(const double f[3], uint32_t face, double out[3])
{
    const uint32_t axis = face / 2;
    out[axis] = face & 1 ? -f[0] : f[0];
    out[(axis + 1) % 3] = f[1];
    out[(axis + 2) % 3] = f[2];
}

/* The side of edge a-b, in units of its doubt (sight_inside.h). */
static void set_edge(const double a[3], const double b[3], double sign, double side[3])
{
    double e[3];
    vec3_sub(b, a, e);
    vec3_cross(a, e, side);
    const double aa = vec3_dot(a, a), bb = vec3_dot(b, b), far_m = sqrt(aa > bb ? aa : bb);
    const double scale = sign / (SIGHT_EDGE_DOUBT * far_m * vec3_length(e));
    for (int i = 0; i < 3; i++)
        side[i] *= scale;
}

static int set_plane(const struct sight *sight, struct build_candidate *c)
{
    const struct bvh_plane *p = bvh_plane(sight->bvh, c->triangle);
    double o_local[3], m[3];
    vec3_sub(sight->station_m, bvh_origin(sight->bvh), o_local);
    const double length = vec3_length(p->n), off = p->d - vec3_dot(p->n, o_local);
    if (!(length > 0.0)) return 0;
    const double height_m = fabs(off) / length;
    for (int i = 0; i < 3; i++)
        m[i] = p->n[i] / off;
    if (!(vec3_length(m) < 1e300)) { /* the station lies in the plane: undecided unless the edges decide */
        c->plane[0] = c->plane[1] = c->plane[2] = c->slack = 0.0;
        c->graze = 1e300;
        return 1;
    }
    memcpy(c->plane, m, sizeof m);
    c->slack = SIGHT_PLANE_DOUBT / height_m;
    c->graze = SIGHT_GRAZE / height_m;
    return 1;
}

/* For a triangle where double precision can't say from which side the station sees it, the sides of its edges have no
 * certain sign. Two strips of directions each hold all rays that may hit it. The narrower one replaces the edges:
 * a direction outside this strip is certainly outside the triangle, and no direction counts as certainly inside.
 * - One strip holds directions at small angles to the plane. A ray at a larger angle hits the plane where the ray
 *   begins (SIGHT_NEAR). This also holds where the plane is at the station up to rounding.
 * - The other strip holds directions that pass the longest edge at most the triangle's width away. Inside the triangle
 *   the sides of its three edges have one sign and add up to n . d, so no side is larger than that. */
static void set_strip(const struct sight *sight, struct build_candidate *c, double v[3][3])
{
    const struct bvh_plane *p = bvh_plane(sight->bvh, c->triangle);
    double e[3], side[3], far_m = 0.0, longest = 0.0;
    int k = 0;
    for (int i = 0; i < 3; i++) {
        const double length = vec3_distance(v[(i + 1) % 3], v[i]);
        far_m = fmax(far_m, vec3_length(v[i]));
        if (length > longest) k = i;
        longest = fmax(longest, length);
    }
    const double area2 = vec3_length(p->n), height_m = fabs(vec3_dot(p->n, v[k])) / area2;
    const double sine = fmax(SIGHT_GRAZE, (height_m + SIGHT_TILT_DOUBT * longest + 0x1p-47 * far_m) * 4.0 * SIGHT_NEAR);
    vec3_sub(v[(k + 1) % 3], v[k], e);
    vec3_cross(v[k], e, side);
    const double past = 1.0 / (2.0 * area2 + 2.0 * SIGHT_EDGE_DOUBT * far_m * longest);
    const int slim = vec3_length(side) * past > 1.0 / sine;
    for (int i = 0; i < 3; i++)
        e[i] = slim ? side[i] * past : p->n[i] / (area2 * sine);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            c->edge[i][j] = i == 1 ? -e[j] : e[j];
    }
}

/* The figures in prcs. False where no ray meets the triangle: it has no area, or a corner is at the station. */
static int find_figures(const struct sight *sight, uint32_t triangle, struct build_candidate *c)
{
    double v[3][3], n[3], longest2 = 0.0, near2 = INFINITY;
    c->triangle = triangle;
    c->record = BUILD_NO_RECORD;
    sight_corners(sight, triangle, v);
    if (vec3_is_any_zero(v) || !set_plane(sight, c)) return 0;
    vec3_cross(v[1], v[2], n);
    const double volume = vec3_dot(v[0], n), sign = volume < 0.0 ? -1.0 : 1.0;
    double doubt = SIGHT_VOLUME_DOUBT * vec3_length(v[0]) * vec3_length(v[1]) * vec3_length(v[2]);
    for (int i = 0; i < 3; i++) {
        double e[3];
        set_edge(v[i], v[(i + 1) % 3], sign, c->edge[i]);
        if (!(fabs(c->edge[i][0]) + fabs(c->edge[i][1]) + fabs(c->edge[i][2]) < INFINITY))
            return 0; /* two corners in one place: no area */
        vec3_sub(v[(i + 1) % 3], v[i], e);
        longest2 = fmax(longest2, vec3_dot(e, e));
        near2 = fmin(near2, vec3_dot(v[i], v[i]));
    }
    doubt += SIGHT_TILT_DOUBT * sqrt(longest2) * vec3_length(bvh_plane(sight->bvh, triangle)->n);
    if (!(fabs(volume) > doubt)) set_strip(sight, c, v);
    c->near_m = fmax(0.0, (sqrt(near2) - sqrt(longest2)) * (1.0 - 1e-12));
    return 1;
}

/* Turns the figures of a candidate to the axes of a face, and computes its slopes there. */
static void candidate_turn(const struct build_candidate *from, uint32_t face, struct build_candidate *c)
{
    *c = *from;
    for (int i = 0; i < 3; i++) {
        to_face(from->edge[i], face, c->edge[i]);
        c->edge_slope[i] = fabs(c->edge[i][1]) + fabs(c->edge[i][2]);
    }
    to_face(from->plane, face, c->plane);
    c->plane_slope = fabs(c->plane[1]) + fabs(c->plane[2]);
}

int build_candidate(const struct build_shared *b, uint32_t face, uint32_t triangle, struct build_candidate *c)
{
    struct build_candidate figures;
    const uint32_t kept = b->kept == NULL ? BUILD_NOT_KEPT : b->kept[triangle];
    if (kept == BUILD_NOT_KEPT) {
        if (!find_figures(b->sight, triangle, &figures)) return 0;
        candidate_turn(&figures, face, c);
        return 1;
    }
    if (b->figures[kept].triangle == BVH_NO_TRIANGLE) return 0;
    candidate_turn(&b->figures[kept], face, c);
    return 1;
}

/* Before the call, kept[i] is the number of regions that triangle i lies in. After the call, kept[i] is the triangle's
 * place in figures, or BUILD_NOT_KEPT. Where the figures need more than their share, or there is no memory for them,
 * kept becomes NULL. */
void build_figures(struct build_shared *b)
{
    const uint32_t n = bvh_scene(b->sight->bvh)->n_triangles;
    uint32_t places = 0;
    for (uint32_t i = 0; i < n; i++)
        b->kept[i] = b->kept[i] >= MANY_REGIONS ? places++ : BUILD_NOT_KEPT;
    const uint64_t bytes = places * sizeof *b->figures;
    if (bytes <= b->spec->memory_bytes / FIGURES_SHARE) b->figures = malloc(bytes + 1);
    if (b->figures == NULL) {
        free(b->kept);
        b->kept = NULL;
        return;
    }
    b->bytes += bytes;
    b->given_back += bytes;
    for (uint32_t i = 0; i < n; i++) {
        const uint32_t at = b->kept[i];
        if (at != BUILD_NOT_KEPT && !find_figures(b->sight, i, &b->figures[at]))
            b->figures[at].triangle = BVH_NO_TRIANGLE;
    }
}

void build_record(const struct build_candidate *c, uint32_t face, struct sight_record *r)
{
    for (int i = 0; i < 3; i++)
        from_face(c->edge[i], face, r->edge[i]);
    from_face(c->plane, face, r->plane);
    r->slack = c->slack;
    r->graze = c->graze;
    r->triangle = c->triangle;
}
