/* Rivals: triangles that somewhere lie so near to each other that float can't order them along a ray: faces
 * that overlap in one plane, a pole through a floor, a thin sheet. Their pairs are found once; a hit on one
 * of them compares the planes.
 *
 * Embree's collision of the scene with itself gives pairs whose boxes meet; of those stay the pairs that no
 * axis separates by more than what float may blur there (separating axes of two triangles: normals, edges
 * crossed, edges in their planes).
 *
 * Neighbours that share a corner or an edge touch in any case. Two sheets with the angle a between them are met by
 * a ray at the distance b from their edge, across the ray; float may misjudge their order where b is less than
 * width / sin(a / 2). The border test looks anyway where b is less than the width, twice what float needs in
 * practice. So what is folded by less than 60 degrees is a pair of rivals, and so is what crosses, or lies beside
 * the corner one over the other. */
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "core/bvh/bvh_inside.h"
#include "core/grow.h"
#include "core/vec3.h"

enum { PART = 1 << 15 }; /* triangles: about a tenth of a second */

struct pairs {
    const struct bvh *bvh;
    const struct sh_report *report;
    uint32_t first; /* triangle of the part at hand */
    pthread_mutex_t lock;
    uint32_t (*pair)[2];
    size_t n, capacity;
    int failed;
};

/* Gap between the triangles along an axis; negative where they overlap by more than that. -inf for no axis.
 */
static double gap_along(double a[3][3], double b[3][3], const double axis[3])
{
    double length = sqrt(vec3_dot(axis, axis)), lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY};
    if (!(length > 0.0)) return -INFINITY;
    for (int i = 0; i < 3; i++) {
        double x = vec3_dot(a[i], axis), y = vec3_dot(b[i], axis);
        lo[0] = fmin(lo[0], x);
        hi[0] = fmax(hi[0], x);
        lo[1] = fmin(lo[1], y);
        hi[1] = fmax(hi[1], y);
    }
    return fmax(lo[0] - hi[1], lo[1] - hi[0]) / length;
}

struct shape {
    double v[3][3], e[3][3], n[3];
};

static void look_at(const struct bvh *bvh, uint32_t prim, struct shape *s)
{
    bvh_corners(bvh, prim, s->v);
    for (int i = 0; i < 3; i++)
        vec3_sub(s->v[(i + 1) % 3], s->v[i], s->e[i]);
    vec3_cross(s->e[0], s->e[1], s->n);
}

/* True when the triangles come nearer than blur_m. */
static int no_axis_separates(struct shape *a, struct shape *b, double blur_m)
{
    double axis[3];
    if (gap_along(a->v, b->v, a->n) > blur_m || gap_along(a->v, b->v, b->n) > blur_m) return 0;
    for (int i = 0; i < 3; i++) {
        vec3_cross(a->e[i], a->n, axis);
        if (gap_along(a->v, b->v, axis) > blur_m) return 0;
        vec3_cross(b->e[i], b->n, axis);
        if (gap_along(a->v, b->v, axis) > blur_m) return 0;
        for (int j = 0; j < 3; j++) {
            vec3_cross(a->e[i], b->e[j], axis);
            /* Edges that are almost parallel have no axis of their own to speak of. */
            if (vec3_dot(axis, axis) < 1e-12 * vec3_dot(a->e[i], a->e[i]) * vec3_dot(b->e[j], b->e[j])) continue;
            if (gap_along(a->v, b->v, axis) > blur_m) return 0;
        }
    }
    return 1;
}

/* Corners that both have: how many, and where the last one is. */
static int shared_corners(const struct shape *a, const struct shape *b, int *in_a, int *in_b)
{
    int n = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            if (memcmp(a->v[i], b->v[j], sizeof a->v[i]) == 0) {
                n++;
                *in_a = i;
                *in_b = j;
            }
    return n;
}

static const double LATERAL = -1e-7, FOLDED = 0.5, ABOVE = 0.866; /* cosine and sine of 60 degrees */

static void unit(const double a[3], double out[3])
{
    const double length = vec3_length(a);
    for (int i = 0; i < 3; i++)
        out[i] = a[i] / length;
}

/* From corner k along both edges, unit vectors. */
static void edges_from(const struct shape *s, int k, double out[2][3])
{
    const double *e = s->e[(k + 2) % 3], back[3] = {-e[0], -e[1], -e[2]};
    unit(s->e[k], out[0]);
    unit(back, out[1]);
}

/* The gap between two angles with one corner, along an axis through it: a on one side, b on the other. */
static double angle_gap(double a[2][3], double b[2][3], const double axis[3])
{
    const double a0 = vec3_dot(a[0], axis), a1 = vec3_dot(a[1], axis), b0 = vec3_dot(b[0], axis),
                 b1 = vec3_dot(b[1], axis);
    const double up = fmin(fmin(a0, a1), fmin(-b0, -b1)), down = fmin(fmin(-a0, -a1), fmin(b0, b1));
    return fmax(up, down) / vec3_length(axis);
}

/* Triangles with one corner in common. Beside each other, one of their edges has them on either side; else one lies
 * over the other, or they cross. */
static int meet_beyond_corner(const struct shape *s, const struct shape *t, int in_s, int in_t)
{
    double a[2][3], b[2][3], axis[3];
    edges_from(s, in_s, a);
    edges_from(t, in_t, b);
    for (int i = 0; i < 2; i++) {
        vec3_cross(a[i], s->n, axis);
        if (angle_gap(a, b, axis) > LATERAL) return 0;
        vec3_cross(b[i], t->n, axis);
        if (angle_gap(a, b, axis) > LATERAL) return 0;
    }
    unit(s->n, axis);
    const double over_s =
        fmax(fmin(vec3_dot(b[0], axis), vec3_dot(b[1], axis)), -fmax(vec3_dot(b[0], axis), vec3_dot(b[1], axis)));
    unit(t->n, axis);
    const double over_t =
        fmax(fmin(vec3_dot(a[0], axis), vec3_dot(a[1], axis)), -fmax(vec3_dot(a[0], axis), vec3_dot(a[1], axis)));
    return over_s < ABOVE && over_t < ABOVE;
}

/* Triangles with an edge in common: the angle between them, from that edge. The corner that is not shared: from the
 * last shared one, across the edge. */
static int fold_back(const struct shape *s, const struct shape *t)
{
    const struct shape *of[2] = {s, t};
    double across[2][3], edge[3];
    int other[2] = {0, 0};
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < 3; i++) {
            int shared = 0;
            for (int j = 0; j < 3; j++)
                shared |= memcmp(of[k]->v[i], of[1 - k]->v[j], sizeof of[k]->v[i]) == 0;
            if (!shared) other[k] = i;
        }
    unit(s->e[(other[0] + 1) % 3], edge);
    for (int k = 0; k < 2; k++) {
        const double *tip = of[k]->v[other[k]], *foot = s->v[(other[0] + 1) % 3];
        double from[3];
        vec3_sub(tip, foot, from);
        const double along = vec3_dot(from, edge);
        for (int i = 0; i < 3; i++)
            from[i] -= along * edge[i];
        unit(from, across[k]);
    }
    return vec3_dot(across[0], across[1]) > FOLDED;
}

int bvh_are_rivals(const struct bvh *bvh, uint32_t i, uint32_t j)
{
    struct shape a, b;
    int in_a = 0, in_b = 0;
    if (bvh_is_twin(bvh, i) || bvh_is_twin(bvh, j)) return 0;
    look_at(bvh, i, &a);
    look_at(bvh, j, &b);
    const int shared = shared_corners(&a, &b, &in_a, &in_b);
    if (shared >= 2) return fold_back(&a, &b);
    if (shared == 1) return meet_beyond_corner(&a, &b, in_a, in_b);
    return no_axis_separates(&a, &b, 2.0 * fmax(bvh_width_m(bvh, i), bvh_width_m(bvh, j)));
}

static void add_pair(struct pairs *p, uint32_t i, uint32_t j)
{
    pthread_mutex_lock(&p->lock);
    if (grow(&p->pair, &p->capacity, p->n + 1, sizeof *p->pair)) {
        p->pair[p->n][0] = i;
        p->pair[p->n++][1] = j;
    } else {
        p->failed = 1;
    }
    pthread_mutex_unlock(&p->lock);
}

/* From Embree's threads. Each pair comes in both orders, from the parts of both. */
static void on_collision(void *user, struct RTCCollision *collision, unsigned n)
{
    struct pairs *p = user;
    if (sh_stopped(p->report)) return;
    for (unsigned k = 0; k < n; k++) {
        uint32_t i = p->first + collision[k].primID0, j = collision[k].primID1;
        if (i != j && bvh_are_rivals(p->bvh, i, j)) add_pair(p, i, j);
    }
}

/* Embree's boxes of some triangles. */
struct boxes {
    const struct bvh *bvh;
    uint32_t first, n;
    RTCScene rtc;
};

static void box_of(const struct RTCBoundsFunctionArguments *args)
{
    const struct boxes *boxes = args->geometryUserPtr;
    const uint32_t prim = boxes->first + args->primID;
    struct RTCBounds *box = args->bounds_o;
    double v[3][3], blur_m = 2.0 * bvh_width_m(boxes->bvh, prim), lo[3], hi[3];
    bvh_corners(boxes->bvh, prim, v);
    for (int j = 0; j < 3; j++) {
        lo[j] = fmin(v[0][j], fmin(v[1][j], v[2][j])) - blur_m;
        hi[j] = fmax(v[0][j], fmax(v[1][j], v[2][j])) + blur_m;
    }
    box->lower_x = (float)lo[0];
    box->lower_y = (float)lo[1];
    box->lower_z = (float)lo[2];
    box->upper_x = (float)hi[0];
    box->upper_y = (float)hi[1];
    box->upper_z = (float)hi[2];
}

static int order_pairs(const void *a, const void *b)
{
    const uint32_t *p = a, *q = b;
    if (p[0] != q[0]) return p[0] < q[0] ? -1 : 1;
    return p[1] < q[1] ? -1 : p[1] > q[1];
}

/* Sorted pairs -> lists by triangle, each rival once. One list more than there are triangles, for a miss. */
static int make_lists(struct bvh *bvh, struct pairs *p, struct sh_err *err)
{
    if (p->n == 0) return SH_OK;
    uint32_t n = bvh->scene->n_triangles;
    qsort(p->pair, p->n, sizeof *p->pair, order_pairs);
    bvh->rival_first = calloc((size_t)n + 2, sizeof *bvh->rival_first);
    bvh->rival = malloc(p->n * sizeof *bvh->rival);
    if (bvh->rival_first == NULL || bvh->rival == NULL)
        return sh_fail(err, SH_ENOMEM, "cast: no memory for %zu rivals", p->n);
    uint32_t kept = 0;
    for (size_t k = 0; k < p->n; k++) {
        if (k > 0 && order_pairs(p->pair[k - 1], p->pair[k]) == 0) continue;
        bvh->rival[kept++] = p->pair[k][1];
        bvh->rival_first[p->pair[k][0] + 1]++;
    }
    for (uint32_t i = 0; i <= n; i++)
        bvh->rival_first[i + 1] += bvh->rival_first[i];
    return SH_OK;
}

static int make_boxes(struct bvh *bvh, struct boxes *boxes, const struct sh_report *report, struct sh_err *err)
{
    RTCGeometry geometry = rtcNewGeometry(bvh->device, RTC_GEOMETRY_TYPE_USER);
    boxes->rtc = rtcNewScene(bvh->device);
    rtcSetGeometryUserPrimitiveCount(geometry, boxes->n);
    rtcSetGeometryUserData(geometry, boxes);
    rtcSetGeometryBoundsFunction(geometry, box_of, NULL);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(boxes->rtc, geometry);
    rtcReleaseGeometry(geometry);
    return bvh_commit(bvh, boxes->rtc, report, err);
}

/* Part by part against all: a collision of Embree's can't be ended on the way. */
static int collide(struct bvh *bvh, struct pairs *p, struct sh_err *err)
{
    const uint32_t n = bvh->scene->n_triangles;
    struct boxes all = {.bvh = bvh, .n = n};
    int rc = make_boxes(bvh, &all, p->report, err);
    for (p->first = 0; p->first < n && rc == SH_OK; p->first += n - p->first < PART ? n - p->first : PART) {
        struct boxes part = {.bvh = bvh, .first = p->first, .n = n - p->first < PART ? n - p->first : PART};
        rc = make_boxes(bvh, &part, p->report, err);
        if (rc == SH_OK) rtcCollide(part.rtc, all.rtc, on_collision, p);
        rtcReleaseScene(part.rtc);
        if (rc == SH_OK) rc = sh_check_stop(p->report, err);
    }
    rtcReleaseScene(all.rtc);
    return rc == SH_OK && p->failed ? sh_fail(err, SH_ENOMEM, "bvh: no memory for pairs of triangles") : rc;
}

int bvh_order_exactly(struct bvh *bvh, const struct sh_report *report, struct sh_err *err)
{
    struct pairs p = {.bvh = bvh, .report = report};
    pthread_mutex_init(&p.lock, NULL);
    int rc = collide(bvh, &p, err);
    if (rc == SH_OK) rc = make_lists(bvh, &p, err);
    bvh->ordered = rc == SH_OK;
    free(p.pair);
    pthread_mutex_destroy(&p.lock);
    return rc;
}
