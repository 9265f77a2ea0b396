/* SPDX-License-Identifier: MIT */
/* A sight's answers for rays at corners and edges, and within 4 units in the last place of its cells' borders, against
 * long double: the triangle that is met, and its range.
 *
 * SIGHT_RAYS: rays of each kind in each scene (default 1000; 125000: a million in all). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/common/generate.h"
#include "tests/common/made.h"
#include "tests/common/odd_rays.h"
#include "tests/common/reference.h"
#include "tests/common/sight_beside.h"

enum { PART = 4096 };

#ifdef SH_SANITIZE
static const long RAYS = 200;
#else
static const long RAYS = 1000;
#endif

static const double RANGE_MAX_M = 1e4;
/* The bound is that of single rays (test_range). A plane's components are doubles, and the error grows by the inverse
 * of the incidence's cosine. */
static const double BOUND_M = 1e-6;
/* This is a share of the range. Surfaces nearer to each other than this are met at once, and the lowest number is
 * reported. */
static const double TIED = 2e-12;

static const struct {
    const char *name;
    enum odd_kind kind;
} KIND[] = {
    {"corners", ODD_CORNERS}, {"edges", ODD_EDGES}, {"borders", ODD_BORDERS}, {"edges at borders", ODD_BORDERED}};
enum { KINDS = sizeof KIND / sizeof KIND[0] };

struct tally {
    uint64_t rays, tied, undecidable, wrong;
    double max_m;
};

struct look {
    const struct reference *reference;
    struct sight_beside beside;
    double x[PART], y[PART], z[PART], range_m[PART];
    uint32_t triangle[PART];
};

static long rays_each(void)
{
    const char *text = getenv("SIGHT_RAYS");
    return text != NULL && atol(text) > 0 ? atol(text) : RAYS;
}

static void judge(const struct look *look, uint32_t i, struct tally *t)
{
    const double dir[3] = {look->x[i], look->y[i], look->z[i]}, *at = look->beside.station_m;
    const struct reference_hit truth = reference_cast(look->reference, at, dir);
    const double error_m = reference_error(&truth, look->range_m[i]);
    t->rays++;
    if (look->triangle[i] == truth.triangle && error_m <= BOUND_M) {
        t->max_m = fmax(t->max_m, error_m);
        return;
    }
    if (truth.triangle == REFERENCE_NONE && look->triangle[i] == REFERENCE_NONE) return;
    if (error_m <= TIED * look->range_m[i]) {
        t->tied++;
        return;
    }
    if (reference_is_undecidable(look->reference, at, dir, &truth, look->range_m[i])) {
        t->undecidable++;
        return;
    }
    if (t->wrong++ < 3)
        printf("# along %a %a %a: %.12g m, triangle %u; truth %.12Lg m, triangle %u\n", dir[0], dir[1], dir[2],
               look->range_m[i], look->triangle[i], truth.range_m, truth.triangle);
}

static void look_at(const struct scene *scene, const double station_m[3], const char *name)
{
    static struct look look;
    struct sh_err err;
    struct sight_spec spec = {.rays = 1e6, .memory_bytes = 64 << 20};
    struct reference *reference = reference_create((const double(*)[3])scene->vertex_m,
                                                   (const uint32_t(*)[3])scene->triangle, scene->n_triangles);
    assert_non_null(reference);
    look.reference = reference;
    memcpy(spec.station_m, station_m, sizeof spec.station_m);
    struct bvh *bvh = made_bvh(scene);
    spec.bvh = bvh;
    assert_int_equal(sight_beside_create(&spec, &look.beside, &err), SH_OK);
    struct odd_rays odd = {.scene = scene, .cells = look.beside.info.cells, .random = 99};
    memcpy(odd.station_m, station_m, sizeof odd.station_m);
    for (int k = 0; k < KINDS; k++) {
        struct tally tally = {0};
        for (long left = rays_each(); left > 0; left -= PART) {
            const uint32_t n = left < PART ? (uint32_t)left : PART;
            odd_rays_fill(&odd, KIND[k].kind, n, look.x, look.y, look.z);
            sight_beside_cast(&look.beside, n, &(const struct vec3_in){look.x, look.y, look.z}, RANGE_MAX_M,
                              look.range_m, look.triangle);
            for (uint32_t i = 0; i < n; i++)
                judge(&look, i, &tally);
        }
        printf("# %-8s %-16s %llu rays: %llu wrong, %llu met another at the same range, %llu beyond double precision; "
               "largest error %.2g m\n",
               name, KIND[k].name, (unsigned long long)tally.rays, (unsigned long long)tally.wrong,
               (unsigned long long)tally.tied, (unsigned long long)tally.undecidable, tally.max_m);
        assert_true(tally.wrong == 0);
    }
    assert_true(look.beside.differ == 0);
    sight_beside_free(&look.beside);
    bvh_free(bvh);
    reference_free(reference);
}

static void test_terrain(void **state)
{
    (void)state;
    static const double CENTRE_M[2] = {391431.25, 5819712.5};
    const double station_m[3] = {CENTRE_M[0] + 3.1, CENTRE_M[1] - 2.3, 9.7};
    struct scene *scene;
    struct sh_err err;
    assert_int_equal(generate_terrain(10000, 110.0, 3.0, CENTRE_M, 7, &scene, &err), SH_OK);
    look_at(scene, station_m, "terrain");
    scene_free(scene);
}

/* Outlines everywhere: each leaf is in front of others and of a wall. */
static void test_foliage(void **state)
{
    (void)state;
    const struct generate_crown crown[2] = {{{12.0, 3.0, 1.0}, 4.0, 0.2, 3000}, {{-5.0, 9.0, 0.0}, 3.0, 0.1, 2000}};
    const double station_m[3] = {0.3, -0.2, 0.1};
    struct scene *scene;
    struct sh_err err;
    assert_int_equal(generate_foliage(crown, 2, 40.0, 3, &scene, &err), SH_OK);
    look_at(scene, station_m, "foliage");
    scene_free(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_terrain),
        cmocka_unit_test(test_foliage),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
