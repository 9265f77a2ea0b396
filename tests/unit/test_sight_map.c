/* SPDX-License-Identifier: MIT */
/* These tests compare what each cell of a map says, in a scene of four triangles, with geometry on the cube's faces. A
 * map that asks the BVH more often than it needs to has the right hits all the same. Only these tests show it. */
#include <malloc.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/sight.h"
#include "core/sight/sight_inside.h"
#include "core/vec3.h"
#include "tests/common/made.h"

/* As core/sight.h and core/sight/README.md have them: a face has CELLS x CELLS cells, in regions of 8 x 8 here. Of a
 * tile of 8 x 8 cells, one word is kept where all its cells say the same, else 64 more. */
enum { FACES = 6, CELLS = 128, TILE = 8, TILES = CELLS / TILE, TRIANGLES = 4, ENOUGH = 1 << 24 };

/* A triangle on a face: face 2 axis + 1 looks to the negative side. A corner lies at (sign, u, v) times its distance.
 */
struct piece {
    int face;
    double u[3], v[3], distance_m[3];
};
static const struct piece pieces[TRIANGLES] = {
    {0, {-0.88, 0.897, 0.025}, {-0.789, -0.695, 0.917}, {10.0, 11.0, 10.5}}, /* a wall */
    {0, {-0.217, 0.32, 0.105}, {-0.369, -0.256, 0.208}, {5.0, 5.2, 4.9}},    /* before it */
    {3, {-0.41, 0.707, 0.067}, {-0.312, 0.14, 0.779}, {7.0, 3.0, 5.0}},
    {4, {0.122, 0.886, 0.409}, {0.067, 0.126, 0.809}, {20.0, 22.0, 18.0}}};

static const double STATION_M[3] = {3.0, -2.0, 1.0};

static void direction(int face, double u, double v, double d[3])
{
    const int axis = face / 2;
    d[axis] = face % 2 ? -1.0 : 1.0;
    d[(axis + 1) % 3] = u;
    d[(axis + 2) % 3] = v;
}

static struct scene *make_pieces(void)
{
    static double corner[3 * TRIANGLES][3];
    static uint32_t triangle[TRIANGLES][3];
    for (uint32_t t = 0; t < TRIANGLES; t++)
        for (uint32_t i = 0; i < 3; i++) {
            double d[3];
            direction(pieces[t].face, pieces[t].u[i], pieces[t].v[i], d);
            for (int k = 0; k < 3; k++)
                corner[3 * t + i][k] = STATION_M[k] + pieces[t].distance_m[i] * d[k];
            triangle[t][i] = 3 * t + i;
        }
    return made_scene(&(struct scene_arrays){(const double(*)[3])corner, 3 * TRIANGLES, (const uint32_t(*)[3])triangle,
                                             TRIANGLES, NULL, NULL, 0});
}

/* How a cell and a triangle of its face lie: all corners of the cell are beyond one edge; all are inside; or neither.
 */
enum lies { BESIDE, COVERS, CROSSES };

static enum lies lies(const struct piece *p, int i, int j)
{
    int inside = 0, beside = 0;
    const double turn = (p->u[1] - p->u[0]) * (p->v[2] - p->v[0]) - (p->v[1] - p->v[0]) * (p->u[2] - p->u[0]);
    for (int k = 0; k < 3; k++) {
        const int m = (k + 1) % 3;
        const double eu = p->u[m] - p->u[k], ev = p->v[m] - p->v[k], length = hypot(eu, ev) * (turn > 0.0 ? 1.0 : -1.0);
        int in = 0;
        for (int c = 0; c < 4; c++) {
            const double u = 2.0 * (i + (c & 1)) / CELLS - 1.0, v = 2.0 * (j + (c >> 1)) / CELLS - 1.0;
            const double side = (eu * (v - p->v[k]) - ev * (u - p->u[k])) / length;
            assert_true(fabs(side) > 1e-5); /* leaves are valid for 1e-6 beyond their borders */
            in += side > 0.0;
        }
        inside += in == 4;
        beside += in == 0;
    }
    return beside > 0 ? BESIDE : inside == 3 ? COVERS : CROSSES;
}

enum { NOTHING = -1, SEVERAL = -2 };

/* Returns what a cell says: the one triangle that all its rays hit, or NOTHING, or SEVERAL. */
static int says(int face, int i, int j)
{
    int sees = NOTHING;
    for (int t = TRIANGLES - 1; t >= 0; t--) { /* the wall last, since it hides nothing */
        if (pieces[t].face != face) continue;
        const enum lies how = lies(&pieces[t], i, j);
        if (how == COVERS && sees == NOTHING) sees = t;
        if (how == CROSSES) sees = SEVERAL;
    }
    return sees;
}

struct counts {
    uint32_t one, nothing, several, records, lists, blocks;
};

/* Tiles and regions are the same here. A region has one record for each triangle in its lists, and a list for each
 * set of triangles. */
static void count(int face, struct counts *c)
{
    for (int tile = 0; tile < TILES * TILES; tile++) {
        int first = 0, differs = 0, used[TRIANGLES] = {0}, alone = 0, both = 0;
        for (int k = 0; k < TILE * TILE; k++) {
            const int i = tile % TILES * TILE + k % TILE, j = tile / TILES * TILE + k / TILE, is = says(face, i, j);
            int seen = 0;
            if (k == 0) first = is;
            differs |= is != first;
            c->one += is >= 0;
            c->nothing += is == NOTHING;
            c->several += is == SEVERAL;
            for (int t = 0; t < TRIANGLES && is == SEVERAL; t++)
                if (pieces[t].face == face && lies(&pieces[t], i, j) != BESIDE) {
                    used[t] = 1;
                    seen++;
                }
            alone |= seen == 1;
            both |= seen == 2;
        }
        c->blocks += (uint32_t)differs;
        c->lists += (uint32_t)(2 * alone + 3 * both);
        for (int t = 0; t < TRIANGLES; t++)
            c->records += (uint32_t)used[t];
    }
}

static struct sight *make_map(const struct bvh *bvh, uint64_t memory_bytes)
{
    struct sight *sight = NULL;
    struct sh_err err;
    struct sight_spec spec = {.bvh = bvh, .rays = 1e6, .memory_bytes = memory_bytes};
    memcpy(spec.station_m, STATION_M, sizeof STATION_M);
    if (sight_create(&spec, 1, NULL, &sight, &err) != SH_OK) fail_msg("%s", err.text);
    return sight;
}

/* Kinds of cells, and the memory that they take: a word for each tile, 64 for a tile of different cells, 128 bytes for
 * a record. Where a tile's region is divided, equal lists are made once for each part, so there may be some more. */
static void each_cell_says_what_is_there(void **state)
{
    (void)state;
    struct scene *scene = make_pieces();
    struct bvh *bvh = made_bvh(scene);
    struct sight *sight = make_map(bvh, ENOUGH);
    struct sight_info info;
    struct counts want = {0};
    const double all = FACES * CELLS * CELLS;
    for (int face = 0; face < FACES; face++)
        count(face, &want);
    assert_true(want.one > 1000 && want.several > 500 && want.one + want.nothing + want.several == (uint32_t)all);
    info = *sight_get_info(sight);
    assert_int_equal(info.cells, CELLS);
    assert_int_equal(lround(info.one * all), want.one);
    assert_int_equal(lround(info.nothing * all), want.nothing);
    assert_int_equal(lround(info.few * all), want.several);
    assert_true(info.ask == 0.0);
    assert_int_equal(info.records, want.records);
    if (info.lists < want.lists || info.lists > 2 * want.lists)
        fail_msg("%u words of lists, not %u", (unsigned)info.lists, want.lists);
    const uint64_t bytes =
        4 * FACES * TILES * TILES + 4 * TILE * TILE * want.blocks + 4 * info.lists + 128 * info.records;
    assert_true(info.bytes == bytes && info.bytes < info.peak_bytes);
    assert_true(info.build_s >= 0.0 && info.build_s < 100.0);
    sight_free(sight);
    bvh_free(bvh);
    scene_free(scene);
}

/* A map that needs a number of bytes is the same with just that many. With fewer its cells are coarser, and some of
 * them ask the BVH where the memory does not hold the coarser ones either. */
static void the_memory_holds(void **state)
{
    (void)state;
    struct scene *scene = make_pieces();
    struct bvh *bvh = made_bvh(scene);
    struct sight_info info;
    struct sight *sight = make_map(bvh, ENOUGH);
    info = *sight_get_info(sight);
    sight_free(sight);
    const uint64_t enough = info.peak_bytes;
    int coarser = 0, asks = 0;
    for (uint64_t memory_bytes = enough; memory_bytes > enough / 16; memory_bytes -= enough / 32) {
        sight = make_map(bvh, memory_bytes);
        info = *sight_get_info(sight);
        sight_free(sight);
        assert_true(info.peak_bytes <= memory_bytes);
        assert_int_equal(info.cells == CELLS && info.ask == 0.0, memory_bytes == enough);
        coarser += info.cells < CELLS && info.ask == 0.0;
        asks += info.cells < CELLS && info.ask > 0.0;
    }
    assert_true(coarser > 0 && asks > 0);
    sight = make_map(bvh, enough - 1);
    info = *sight_get_info(sight);
    sight_free(sight);
    assert_int_equal(info.cells, CELLS / 2);
    bvh_free(bvh);
    scene_free(scene);
}

/* Room in its arrays that a map does not use is given back, but for what rounds a block up to a page. A head that locks
 * its memory would hold that room. */
static void unused_room_is_given_back(void **state)
{
    (void)state;
    struct scene *scene = make_pieces();
    struct bvh *bvh = made_bvh(scene);
    struct sight *sight = make_map(bvh, ENOUGH);
    struct sight_info info;
    info = *sight_get_info(sight);
    assert_true(malloc_usable_size(sight->leaf) + malloc_usable_size(sight->list) + malloc_usable_size(sight->record) <
                info.bytes + 3 * 4096);
    sight_free(sight);
    bvh_free(bvh);
    scene_free(scene);
}

/* A ray through each cell, off its middle: hits are those of the BVH, bit by bit, and only rays of cells with several
 * triangles look at lists. No ray is so near to an edge that the BVH would be asked. */
static void rays_through_each_cell(void **state)
{
    (void)state;
    enum { N = CELLS * CELLS };
    static double d[3][N], range_m[2][N];
    static uint32_t triangle[2][N];
    struct scene *scene = make_pieces();
    struct bvh *bvh = made_bvh(scene);
    struct sight *sight = make_map(bvh, ENOUGH);
    struct bvh_work *bvh_work = made_bvh_work();
    struct sight_work *work;
    struct sh_err err;
    uint64_t several = 0;
    assert_int_equal(sight_work_create(&work, &err), SH_OK);
    for (int face = 0; face < FACES; face++) {
        for (int k = 0; k < N; k++) {
            double to[3];
            direction(face, (2.0 * (k % CELLS) + 1.1) / CELLS - 1.0, (2.0 * (k / CELLS) + 0.9) / CELLS - 1.0, to);
            for (int c = 0; c < 3; c++)
                d[c][k] = to[c] / vec3_length(to);
            several += says(face, k % CELLS, k / CELLS) == SEVERAL;
        }
        for (int way = 0; way < 2; way++) {
            struct bvh_rays rays = {.n = N,
                                    .dir = {d[0], d[1], d[2]},
                                    .range_max_m = 100.0,
                                    .range_m = range_m[way],
                                    .triangle = triangle[way]};
            memcpy(rays.from.at_m, STATION_M, sizeof STATION_M);
            if (way == 0)
                bvh_hits(bvh_work, bvh, &rays);
            else
                sight_hits(work, bvh_work, sight, &rays);
        }
        assert_memory_equal(triangle[0], triangle[1], sizeof triangle[0]);
        for (int k = 0; k < N; k++)
            assert_true(range_m[0][k] == range_m[1][k] || (isnan(range_m[0][k]) && isnan(range_m[1][k])));
        assert_int_equal(sight_work_counters(work)->few, several);
        assert_int_equal(sight_work_counters(work)->asked, 0);
    }
    sight_work_free(work);
    bvh_work_free(bvh_work);
    sight_free(sight);
    bvh_free(bvh);
    scene_free(scene);
}

/* Cells are halved as long as four rays come to each, and while the words of tiles leave three quarters of the memory
 * free: from 64 to 2048 along an edge. */
static void cells_by_rays_and_memory(void **state)
{
    (void)state;
    const uint64_t enough = (uint64_t)1 << 30;
    assert_int_equal(sight_cells(0.0, enough), 64);
    assert_int_equal(sight_cells(1e15, enough), 2048);
    assert_int_equal(sight_cells(1e15, 0), 64);
    for (uint32_t cells = 128; cells <= 2048; cells *= 2) {
        const double rays = 6.0 * cells * cells * 4.0;
        const uint64_t bytes = 6ULL * (cells / 8) * (cells / 8) * 4 * 4;
        assert_int_equal(sight_cells(rays, enough), cells);
        assert_int_equal(sight_cells(rays - 0.5, enough), cells / 2);
        assert_int_equal(sight_cells(1e15, bytes), cells);
        assert_int_equal(sight_cells(1e15, bytes - 1), cells / 2);
    }
}

static int stops_later(void *ctx)
{
    return --*(int *)ctx < 0;
}

/* The regions after the first three are missing, so there is no map. */
static void a_stop_leaves_no_map(void **state)
{
    (void)state;
    int regions = 3;
    const struct sh_report report = {.ctx = &regions, .stop = stops_later};
    struct scene *scene = make_pieces();
    struct bvh *bvh = made_bvh(scene);
    struct sight *sight = NULL;
    struct sh_err err;
    struct sight_spec spec = {.bvh = bvh, .rays = 1e6, .memory_bytes = 1 << 24};
    memcpy(spec.station_m, STATION_M, sizeof STATION_M);
    assert_int_equal(sight_create(&spec, 1, &report, &sight, &err), SH_ESTOPPED);
    assert_null(sight);
    assert_true(regions < 0);
    bvh_free(bvh);
    scene_free(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_cell_says_what_is_there), cmocka_unit_test(the_memory_holds),
        cmocka_unit_test(unused_room_is_given_back),    cmocka_unit_test(rays_through_each_cell),
        cmocka_unit_test(a_stop_leaves_no_map),         cmocka_unit_test(cells_by_rays_and_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
