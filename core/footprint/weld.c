/* SPDX-License-Identifier: MIT */
/* Finds the edges of a mesh that are outlines, seen from a station.
 *
 * An edge and the station span a plane. With triangles on both sides of it, the surface goes on beyond the
 * edge, without a step in range; with triangles on one side only, it ends there. Where triangles on both
 * sides are of different kinds, one kind of surface ends there. The rule needs neither normals nor an order of
 * corners. Corners at the same place, bit by bit, are one. */
#include <stdlib.h>
#include <string.h>

#include "core/footprint/outlines.h"
#include "core/grow.h"
#include "core/rng.h"
#include "core/vec3.h"

enum { NONE = 0xffffffff, TWO_KINDS = 4 };

struct slot {
    uint32_t low, high; /* corners; low NONE: free */
};

struct weld {
    const struct scene *scene;
    const double *station_m;
    const struct sh_report *report;
    uint32_t *same; /* [n_vertices] the first vertex at the same place */
    struct slot *slot;
    uint8_t *sides; /* of a slot, bits: 1 and 2: a triangle on that side; 4: triangles of two kinds */
    const uint16_t *kind;
    uint16_t *of; /* of a slot: kind of its first triangle that is not seen edge-on; NULL: not asked for */
    uint64_t mask;
};

static uint64_t find_edge(struct weld *w, uint32_t low, uint32_t high)
{
    uint64_t at = rng_mix((uint64_t)low << 32 | high) & w->mask;
    while (w->slot[at].low != NONE && (w->slot[at].low != low || w->slot[at].high != high))
        at = (at + 1) & w->mask;
    w->slot[at] = (struct slot){low, high};
    return at;
}

static void from_station(const struct weld *w, uint32_t vertex, double p[3])
{
    vec3_sub(w->scene->vertex_m[vertex], w->station_m, p);
}

/* Returns the side of the edge that the triangle lies on, 1 or 2. 0: it is seen edge-on, and covers nothing. */
static uint8_t side_of(const struct weld *w, uint32_t low, uint32_t high, uint32_t third)
{
    double p[3], q[3], r[3], n[3];
    from_station(w, low, p);
    from_station(w, high, q);
    from_station(w, third, r);
    vec3_cross(p, q, n);
    double off = vec3_dot(n, r), length2 = vec3_dot(n, n), far2 = vec3_dot(r, r);
    if (off * off <= 1e-20 * length2 * far2) return 0;
    return off > 0.0 ? 1 : 2;
}

static int add_triangles(struct weld *w, struct sh_err *err)
{
    for (uint32_t t = 0; t < w->scene->n_triangles; t++) {
        if ((t & 0xffff) == 0 && sh_check_stop(w->report, err) != SH_OK) return SH_ESTOPPED;
        uint32_t v[3];
        for (int i = 0; i < 3; i++)
            v[i] = w->same[w->scene->triangle[t][i]];
        for (int i = 0; i < 3; i++) {
            uint32_t a = v[i], b = v[(i + 1) % 3], low = a < b ? a : b, high = a < b ? b : a;
            uint64_t at = find_edge(w, low, high);
            uint8_t before = w->sides[at], side = side_of(w, low, high, v[(i + 2) % 3]);
            w->sides[at] = before | side;
            if (w->of == NULL || side == 0) continue;
            uint16_t kind = w->kind[w->scene->label[t]];
            if (before == 0) w->of[at] = kind;
            if (w->of[at] != kind) w->sides[at] |= TWO_KINDS;
        }
    }
    return SH_OK;
}

static int collect(const struct weld *w, struct beam_outlines *o, struct sh_err *err)
{
    uint64_t found = 0;
    for (uint64_t i = 0; i <= w->mask; i++)
        found += w->slot[i].low != NONE && w->sides[i] != 3;
    if (found >= NONE) return sh_fail(err, SH_EINPUT, "beam: too many outlines");
    o->edge = malloc((size_t)(found + 1) * sizeof *o->edge);
    if (o->edge == NULL) return sh_fail(err, SH_ENOMEM, "beam: no memory for outlines");
    for (uint64_t i = 0; i <= w->mask; i++) {
        if (w->slot[i].low == NONE || w->sides[i] == 3) continue;
        double a[3], b[3];
        from_station(w, w->slot[i].low, a);
        from_station(w, w->slot[i].high, b);
        for (int j = 0; j < 3; j++) {
            o->edge[o->n_edges].a[j] = (float)a[j];
            o->edge[o->n_edges].b[j] = (float)b[j];
        }
        o->n_edges++;
    }
    return SH_OK;
}

int outline_find(const struct beam_outlines_spec *spec, struct beam_outlines *o, struct sh_err *err)
{
    const struct scene *scene = spec->scene;
    const uint16_t *kind = spec->kind;
    struct weld w = {.scene = scene, .station_m = spec->station_m, .report = spec->report, .kind = kind};
    const size_t size = grow_table(4 * (uint64_t)scene->n_triangles);
    w.mask = size - 1;
    w.slot = malloc(size * sizeof *w.slot);
    w.sides = calloc(size, 1);
    w.of = kind != NULL ? malloc(size * sizeof *w.of) : NULL;
    int rc = w.slot == NULL || w.sides == NULL || (kind != NULL && w.of == NULL)
                 ? sh_fail(err, SH_ENOMEM, "beam: no memory for the edges of %u triangles", scene->n_triangles)
                 : scene_find_same(scene, spec->report, &w.same, err);
    if (rc == SH_OK) {
        memset(w.slot, 0xff, size * sizeof *w.slot);
        rc = add_triangles(&w, err);
    }
    if (rc == SH_OK) rc = collect(&w, o, err);
    free(w.same);
    free(w.slot);
    free(w.sides);
    free(w.of);
    return rc;
}
