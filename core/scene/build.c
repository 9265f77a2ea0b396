/* SPDX-License-Identifier: MIT */
#include "core/scene/build_load.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/digits.h"
#include "core/grow.h"
#include "core/huge_pages.h"
#include "core/monotonic.h"
#include "core/scene/build_surfaces.h"
#include "core/vec3.h"

int build_init(struct scene_build *b, double tolerance_m, const struct sh_report *report, struct sh_err *err)
{
    *b = (struct scene_build){.tolerance_m = tolerance_m, .report = report, .start_ns = monotonic_ns()};
    b->polygon.report = report;
    b->scene = calloc(1, sizeof *b->scene);
    if (b->scene == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a scene");
    return SH_OK;
}

void build_release(struct scene_build *b)
{
    build_forget_surfaces(b);
    triangulate_free(&b->polygon);
    free(b->corner);
    free(b->corner_uv);
    free(b->corner_rgb);
    scene_free(b->scene);
    b->scene = NULL;
}

void build_begin_file(struct scene_build *b, const struct scene_mesh_spec *spec)
{
    size_t len = strlen(spec->file);
    if (len < sizeof b->name)
        memcpy(b->name, spec->file, len + 1);
    else
        snprintf(b->name, sizeof b->name, "...%s", spec->file + len - (sizeof b->name - 4));
    b->spec = spec;
    b->line = 0;
    b->mesh = NULL;
    b->vertex0 = b->mesh_vertex0 = b->scene->n_vertices;
    b->triangle0 = b->scene->n_triangles;
    b->n_welded = 0;
    b->counts = (struct scene_counts){0};
    b->scene->says = (struct scene_says){0};
    b->has_uv = b->has_rgb = false;
    b->not_simple = b->n_rgb_limited = 0;
    b->file_ns = monotonic_ns();
}

void build_report(struct scene_build *b, double fraction)
{
    char what[sizeof b->name + 16];
    snprintf(what, sizeof what, "reading %s", b->name);
    b->reported_ns = monotonic_ns();
    sh_progress(b->report, what, fraction);
}

int build_end_file(struct scene_build *b, struct sh_err *err)
{
    b->line = 0;
    b->mesh = NULL;
    if (b->counts.zero_area > 0)
        build_warn(b, "%llu triangles without area left out", (unsigned long long)b->counts.zero_area);
    if (b->counts.not_triangles > 0)
        build_warn(b, "%llu points and lines left out", (unsigned long long)b->counts.not_triangles);
    if (b->counts.names_cut > 0)
        build_warn(b, "%llu names cut to %d bytes", (unsigned long long)b->counts.names_cut, SCENE_NAME_LEN - 1);
    if (b->not_simple > 0)
        build_warn(b, "the outlines of %llu polygons cross themselves; their triangles overlap",
                   (unsigned long long)b->not_simple);
    if (b->n_rgb_limited > 0)
        build_warn(b, "%llu colour%s of corners or vertices beyond the range of 0 to %g, limited to it",
                   (unsigned long long)b->n_rgb_limited, b->n_rgb_limited > 1 ? "s" : "", b->rgb_most);
    b->scene->counts.zero_area += b->counts.zero_area;
    b->scene->counts.not_triangles += b->counts.not_triangles;
    b->scene->counts.names_cut += b->counts.names_cut;
    if (b->reported_ns > b->file_ns) build_report(b, 1);
    if (b->scene->n_triangles == b->triangle0)
        return build_fail(b, SH_EINPUT, err, "it has no triangles (%llu without area, %llu points and lines)",
                          (unsigned long long)b->counts.zero_area, (unsigned long long)b->counts.not_triangles);
    return SH_OK;
}

/* Gives the array its final place: without room to grow, and in memory where random reads are quick. */
static int build_settle(const struct scene_build *b, void **array, size_t n, size_t size, struct sh_err *err)
{
    const size_t step = (size_t)16 << 20;
    char *last = huge_pages_alloc(n * size);
    if (last == NULL) return SH_OK;
    for (size_t at = 0; at < n * size; at += step) {
        if (sh_check_stop(b->report, err) != SH_OK) {
            free(last);
            return SH_ESTOPPED;
        }
        memcpy(last + at, (char *)*array + at, n * size - at < step ? n * size - at : step);
    }
    free(*array);
    *array = last;
    return SH_OK;
}

static int settle_all(const struct scene_build *b, struct sh_err *err)
{
    struct scene *s = b->scene;
    int rc = build_settle(b, (void **)&s->surface, s->n_surfaces, sizeof *s->surface, err);
    if (rc == SH_OK) rc = build_settle(b, (void **)&s->vertex_m, s->n_vertices, sizeof *s->vertex_m, err);
    if (rc == SH_OK) rc = build_settle(b, (void **)&s->triangle, s->n_triangles, sizeof *s->triangle, err);
    if (rc == SH_OK) rc = build_settle(b, (void **)&s->label, s->n_triangles, sizeof *s->label, err);
    if (rc == SH_OK && s->uv != NULL) rc = build_settle(b, (void **)&s->uv, s->n_triangles, sizeof *s->uv, err);
    if (rc == SH_OK && s->rgb != NULL) rc = build_settle(b, (void **)&s->rgb, s->n_triangles, sizeof *s->rgb, err);
    return rc;
}

static int find_bounds(const struct scene_build *b, struct sh_err *err)
{
    struct scene *s = b->scene;
    int rc = SH_OK;
    vec3_bound_nothing(s->min_m, s->max_m);
    for (uint32_t i = 0; i < s->n_triangles && rc == SH_OK; i++) {
        for (int c = 0; c < 3; c++)
            vec3_bound(s->min_m, s->max_m, s->vertex_m[s->triangle[i][c]]);
        if ((i & 0xfffff) == 0) rc = sh_check_stop(b->report, err);
    }
    return rc;
}

int build_finish(struct scene_build *b, int may_be_empty, struct scene **out, struct sh_err *err)
{
    struct scene *s = b->scene;
    if (s->n_triangles == 0 && !may_be_empty) return sh_fail(err, SH_EINPUT, "the scene has no triangles");
    build_forget_surfaces(b);
    if (s->n_textures == 0) {
        free(s->uv);
        s->uv = NULL;
    }
    build_note_colours(s);
    int rc = settle_all(b, err);
    if (rc == SH_OK) rc = find_bounds(b, err);
    if (rc != SH_OK) return rc;
    s->n_all = s->n_triangles;
    *out = s;
    b->scene = NULL;
    return SH_OK;
}

int build_fail(struct scene_build *b, int code, struct sh_err *err, const char *fmt, ...)
{
    char place[96] = "", text[320];
    if (b->line > 0)
        snprintf(place, sizeof place, ", line %llu", (unsigned long long)b->line);
    else if (b->mesh != NULL)
        snprintf(place, sizeof place, ", mesh '%.64s'", b->mesh);
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(text, sizeof text, fmt, ap);
    va_end(ap);
    return sh_fail(err, code, "%s%s: %s", b->name, place, text);
}

void build_warn(const struct scene_build *b, const char *fmt, ...)
{
    char text[512];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(text, sizeof text, fmt, ap);
    va_end(ap);
    sh_warn(b->report, "%s: %s", b->name, text);
}

int build_single(struct scene_build *b, double largest, double error, bool refuse, struct sh_err *err)
{
    const double most_m = 1.0;    /* the largest scene.tolerance_m */
    const double coarse_m = 1e-3; /* a larger error is visible in a scan */
    double error_m = error * b->spec->scale;
    char set[48] = "";
    if (!(error_m > 0.0)) return SH_OK;
    error_m = digits_up(error_m, 2);
    if (error_m > b->tolerance_m && refuse) {
        if (error_m <= most_m) snprintf(set, sizeof set, "set it to %.2g, ", error_m);
        return build_fail(b, SH_EINPUT, err,
                          "coordinates up to %.9g are read in single precision, with errors up to %.2g m; allowed are "
                          "%.2g m (scene.tolerance_m, or else a tenth of plan.tolerance_m): %smove the mesh near its "
                          "origin, or convert it to .obj or .ply",
                          largest, error_m, b->tolerance_m, set);
    }
    b->scene->error_m = fmax(b->scene->error_m, error_m);
    if (error_m > 1e-6)
        build_warn(b, "read in single precision, with errors up to %.2g m: coordinates go up to %.9g%s", error_m,
                   largest, error_m > coarse_m ? "; move it near its origin, then export it again" : "");
    return SH_OK;
}

static int grow_vertices(struct scene_build *b, uint64_t need, struct sh_err *err)
{
    if (need > UINT32_MAX - 1)
        return build_fail(b, SH_EINPUT, err, "too many vertices: a scene holds up to %u", UINT32_MAX - 1);
    if (grow(&b->scene->vertex_m, &b->cap_vertices, need, sizeof *b->scene->vertex_m)) return SH_OK;
    return build_fail(b, SH_ENOMEM, err, "no memory for %llu vertices", (unsigned long long)need);
}

static int grow_triangles(struct scene_build *b, uint64_t need, struct sh_err *err)
{
    struct scene *s = b->scene;
    size_t cap_uv = b->cap_triangles, cap_rgb = b->cap_triangles, cap_label = b->cap_triangles;
    if (need > UINT32_MAX - 1)
        return build_fail(b, SH_EINPUT, err, "too many triangles: a scene holds up to %u", UINT32_MAX - 1);
    if ((s->uv == NULL || grow(&s->uv, &cap_uv, need, sizeof *s->uv)) &&
        (s->rgb == NULL || grow(&s->rgb, &cap_rgb, need, sizeof *s->rgb)) &&
        grow(&s->label, &cap_label, need, sizeof *s->label) &&
        grow(&s->triangle, &b->cap_triangles, need, sizeof *s->triangle))
        return SH_OK;
    return build_fail(b, SH_ENOMEM, err, "no memory for %llu triangles", (unsigned long long)need);
}

int build_reserve(struct scene_build *b, uint64_t vertices, uint64_t triangles, struct sh_err *err)
{
    int rc = grow_vertices(b, b->scene->n_vertices + vertices, err);
    return rc == SH_OK ? grow_triangles(b, b->scene->n_triangles + triangles, err) : rc;
}

int build_vertex(struct scene_build *b, const double v[3], struct sh_err *err)
{
    struct scene *s = b->scene;
    const struct scene_mesh_spec *spec = b->spec;
    unsigned long long number = s->n_vertices - b->mesh_vertex0 + b->n_welded + 1ull;
    if (!isfinite(v[0]) || !isfinite(v[1]) || !isfinite(v[2]))
        return build_fail(b, SH_EINPUT, err, "vertex %llu (%g %g %g) is not finite", number, v[0], v[1], v[2]);
    int rc = grow_vertices(b, s->n_vertices + 1ull, err);
    if (rc != SH_OK) return rc;
    bool y_up = spec->up == SCENE_UP_Y;
    double turned[3] = {v[0], y_up ? -v[2] : v[1], y_up ? v[1] : v[2]};
    double *p = s->vertex_m[s->n_vertices];
    for (int k = 0; k < 3; k++) {
        p[k] = turned[k] * spec->scale + spec->offset_m[k];
        if (!(fabs(p[k]) <= SCENE_MAX_COORDINATE_M))
            return build_fail(
                b, SH_EINPUT, err,
                "vertex %llu is at %g m; allowed are coordinates up to %g m: check the scale of %g metres per unit",
                number, p[k], SCENE_MAX_COORDINATE_M, spec->scale);
    }
    s->n_vertices++;
    return SH_OK;
}

/* Without area: the height over the longest edge is below 1e-12 of that edge. Rounding of the differences and
 * products stays under 1e-15 of the edge, so a triangle that only rounding gives a height has no area here. No real
 * needle is that thin: over 100 m it would be narrower than an atom. The test asks for "greater", so that underflow
 * counts as zero. */
static bool has_area(const double *a, const double *b, const double *c)
{
    double u[3], v[3], w[3];
    vec3_sub(b, a, u);
    vec3_sub(c, a, v);
    vec3_sub(c, b, w);
    double n[3], longest2 = fmax(fmax(vec3_dot(u, u), vec3_dot(v, v)), vec3_dot(w, w));
    vec3_cross(u, v, n);
    return sqrt(vec3_dot(n, n)) > 1e-12 * longest2;
}

static const float no_uv[3][2] = {{NAN, NAN}, {NAN, NAN}, {NAN, NAN}};

/* Keeps texture coordinates. The first triangle that has some makes room for all triangles. */
static int keep_uv(struct scene_build *b, const float uv[3][2], struct sh_err *err)
{
    struct scene *s = b->scene;
    if (s->uv == NULL) {
        if (uv == no_uv) return SH_OK;
        s->uv = malloc(b->cap_triangles * sizeof *s->uv);
        if (s->uv == NULL) return build_fail(b, SH_ENOMEM, err, "no memory for texture coordinates");
        for (uint32_t i = 0; i < s->n_triangles; i++)
            memcpy(s->uv[i], no_uv, sizeof no_uv);
    }
    memcpy(s->uv[s->n_triangles], uv, sizeof no_uv);
    return SH_OK;
}

/* Keeps colours likewise. */
static int keep_rgb(struct scene_build *b, const uint8_t rgb[3][4], struct sh_err *err)
{
    struct scene *s = b->scene;
    if (s->rgb == NULL) {
        if (!b->has_rgb) return SH_OK;
        s->rgb = calloc(b->cap_triangles, sizeof *s->rgb);
        if (s->rgb == NULL) return build_fail(b, SH_ENOMEM, err, "no memory for colours");
    }
    memcpy(s->rgb[s->n_triangles], rgb, sizeof *s->rgb);
    return SH_OK;
}

int build_corners(struct scene_build *b, size_t n, struct sh_err *err)
{
    size_t cap_uv = b->cap_corners, cap_rgb = b->cap_corners;
    if (grow(&b->corner_uv, &cap_uv, n, sizeof *b->corner_uv) &&
        grow(&b->corner_rgb, &cap_rgb, n, sizeof *b->corner_rgb) &&
        grow(&b->corner, &b->cap_corners, n, sizeof *b->corner))
        return SH_OK;
    return build_fail(b, SH_ENOMEM, err, "no memory for a face of %zu corners", n);
}

/* Swaps elements i and k of an array of elements of up to 8 bytes. */
static void swap(void *array, size_t size, size_t i, size_t k)
{
    uint8_t *a = (uint8_t *)array + i * size, *b = (uint8_t *)array + k * size, old[8];
    memcpy(old, a, size);
    memcpy(a, b, size);
    memcpy(b, old, size);
}

void build_turn_over(struct scene_build *b, size_t n)
{
    for (size_t i = 1, k = n - 1; i < k; i++, k--) {
        swap(b->corner, sizeof *b->corner, i, k);
        if (b->has_uv) swap(b->corner_uv, sizeof *b->corner_uv, i, k);
        if (b->has_rgb) swap(b->corner_rgb, sizeof *b->corner_rgb, i, k);
    }
}

/* at: which three of the polygon's corners. */
static int add_triangle(struct scene_build *b, const uint32_t at[3], uint16_t label, struct sh_err *err)
{
    struct scene *s = b->scene;
    uint32_t corner[3];
    float uv[3][2];
    uint8_t rgb[3][4] = {{0}};
    for (int k = 0; k < 3; k++) {
        corner[k] = b->corner[at[k]];
        if (b->has_uv) memcpy(uv[k], b->corner_uv[at[k]], sizeof uv[k]);
        if (b->has_rgb) memcpy(rgb[k], b->corner_rgb[at[k]], sizeof rgb[k]);
    }
    if (!has_area(s->vertex_m[corner[0]], s->vertex_m[corner[1]], s->vertex_m[corner[2]])) {
        b->counts.zero_area++;
        return SH_OK;
    }
    int rc = grow_triangles(b, s->n_triangles + 1ull, err);
    if (rc == SH_OK) rc = keep_uv(b, b->has_uv ? (const float(*)[2])uv : no_uv, err);
    if (rc == SH_OK) rc = keep_rgb(b, (const uint8_t(*)[4])rgb, err);
    if (rc != SH_OK) return rc;
    memcpy(s->triangle[s->n_triangles], corner, sizeof *s->triangle);
    s->label[s->n_triangles++] = label;
    return SH_OK;
}

int build_polygon(struct scene_build *b, size_t n, uint16_t label, struct sh_err *err)
{
    if (n == 3) return add_triangle(b, (const uint32_t[3]){0, 1, 2}, label, err);
    if (n > SCENE_MAX_CORNERS)
        return build_fail(b, SH_EINPUT, err, "a polygon has %zu corners; allowed are up to %d", n, SCENE_MAX_CORNERS);
    struct triangulate *t = &b->polygon;
    if (triangulate_reserve(t, n) != SH_OK)
        return build_fail(b, SH_ENOMEM, err, "no memory for a polygon of %zu corners", n);
    for (size_t i = 0; i < n; i++)
        memcpy(t->at[i].p, b->scene->vertex_m[b->corner[i]], sizeof t->at->p);
    triangulate_polygon(t, (uint32_t)n);
    if (t->stopped) return sh_fail_stopped(err);
    if (!t->simple) b->not_simple++;
    int rc = SH_OK;
    for (size_t i = 0; i + 2 < n && rc == SH_OK; i++)
        rc = add_triangle(b, t->at[i].triangle, label, err);
    return rc;
}

int build_progress(void *build, double fraction, struct sh_err *err)
{
    struct scene_build *b = build;
    int64_t now = monotonic_ns();
    if (now - b->start_ns >= 1000000000 && now - b->reported_ns >= 250000000) build_report(b, fraction);
    return sh_check_stop(b->report, err);
}

struct text_span build_base_name(const struct scene_build *b)
{
    const char *name = basename(b->spec->file), *dot = strrchr(name, '.');
    return (struct text_span){name, dot != NULL && dot > name ? (size_t)(dot - name) : strlen(name)};
}
