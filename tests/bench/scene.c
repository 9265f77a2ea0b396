/* SPDX-License-Identifier: MIT */
/* These are the places that are scanned. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/rng.h"
#include "tests/common/generate.h"
#include "tests/bench/bench.h"
#include "firmware_sim/base/clock.h"

uint32_t bench_count(const char *name)
{
    char *end;
    if (name[0] < '0' || name[0] > '9') return 0;
    unsigned long n = strtoul(name, &end, 10);
    if (n > 100000000) return 0;
    if (strcmp(end, "k") == 0)
        n *= 1000;
    else if (strcmp(end, "M") == 0)
        n *= 1000000;
    else if (*end != '\0')
        return 0;
    return n >= 100 && n <= 100000000 ? (uint32_t)n : 0;
}

int bench_is_house(const char *name)
{
    return strcmp(name, "house") == 0 || strcmp(name, "garden") == 0;
}

static int load_house(const char *file, const struct sh_report *report, struct bench_target *t, struct sh_err *err)
{
    static const double living_room_m[3] = {5.5, 2.2, 1.6}; /* as in config/demo.yaml */
    static const double garden_m[3] = {6.0, -2.6, 1.7};
    struct scene_mesh_spec spec = {.file = file, .up = SCENE_UP_Y, .scale = 1.0};
    memcpy(t->station_m, strcmp(t->name, "garden") == 0 ? garden_m : living_room_m, sizeof t->station_m);
    return scene_load(&spec, 1, 1e-4, report, &t->scene, err);
}

int bench_is_made(const char *name)
{
    return strcmp(name, "foliage") == 0 || strcmp(name, "huge") == 0;
}

static int make_foliage(struct scene **out, struct sh_err *err)
{
    static const struct generate_crown crown[3] = {{{-4.0, 14.0, 1.0}, 3.0, 0.06, 20000},
                                                   {{3.0, 18.0, 0.0}, 4.0, 0.06, 20000},
                                                   {{0.0, 30.0, 2.0}, 5.0, 0.06, 20000}};
    return generate_foliage(crown, 3, 60.0, 1, out, err);
}

static double part(uint64_t i)
{
    return (double)(rng_u64(rng_key(1, RNG_SCENE), i) >> 11) * 0x1p-53 - 0.5;
}

/* The small triangles lie at random, up to 5 m away, over ground a metre below the head. */
static int make_huge(struct scene **out, struct sh_err *err)
{
    enum { SMALL = 4000 };
    static double v[3 * SMALL + 3][3] = {{-1e6, -1e6, -1.0}, {1e6, -1e6, -1.0}, {0.0, 1e6, -1.0}};
    static uint32_t t[SMALL + 1][3];
    uint64_t n = 0;
    for (uint32_t i = 0; i < 3 * (SMALL + 1); i++) {
        t[i / 3][i % 3] = i;
        for (int k = 0; k < 3 && i >= 3; k++)
            v[i][k] = i % 3 != 0 ? v[i - i % 3][k] + 0.05 * part(n++) : (k == 2 ? 1.5 : 10.0) * part(n++);
    }
    return scene_from_arrays(
        &(struct scene_arrays){(const double(*)[3])v, 3 * SMALL + 3, (const uint32_t(*)[3])t, SMALL + 1, NULL, NULL, 0},
        out, err);
}

int bench_target_load(const char *name, const char *house, const struct sh_report *report, struct bench_target *out,
                      struct sh_err *err)
{
    static const double centre_m[2] = {0.0, 0.0};
    memset(out, 0, sizeof *out);
    snprintf(out->name, sizeof out->name, "%s", name);
    int64_t start_ns = clock_now_ns();
    int rc;
    if (bench_is_house(name)) {
        rc = load_house(house, report, out, err);
    } else if (bench_is_made(name)) {
        rc = (strcmp(name, "huge") == 0 ? make_huge : make_foliage)(&out->scene, err);
    } else {
        out->station_m[2] = 4.7;
        rc = generate_terrain(bench_count(name), 200.0, 3.0, centre_m, 1, &out->scene, err);
    }
    out->load_s = 1e-9 * (double)(clock_now_ns() - start_ns);
    return rc;
}

void bench_target_free(struct bench_target *target)
{
    scene_free(target->scene);
    target->scene = NULL;
}

struct mesh bench_target_mesh(const struct bench_target *target)
{
    const struct scene *scene = target->scene;
    return (struct mesh){.n_vertices = scene->n_vertices,
                         .n_faces = scene->n_triangles,
                         .xyz_m = (const double(*)[3])scene->vertex_m,
                         .face = (const uint32_t(*)[3])scene->triangle};
}

int bench_target_write(const struct bench_target *target, const char *path, struct sh_err *err)
{
    const struct mesh mesh = bench_target_mesh(target);
    return mesh_write(path, &mesh, NULL, err);
}
