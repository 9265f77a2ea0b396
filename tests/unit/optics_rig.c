/* SPDX-License-Identifier: MIT */
#include "tests/unit/optics_rig.h"

#include "tests/common/made.h"

const double STATION[3] = {0.5, 0.25, 0.125};
const double LO[3] = {-4, -5, -2}, HI[3] = {6, 5, 3};

void open_optics(struct optics *o, struct scene *scene)
{
    struct sh_err err;
    uint32_t n = scene->n_surfaces;
    o->rig = cast_rig_open(scene, STATION);
    if (surface_table_alloc(n, &o->table, &err) != 0) fail_msg("%s", err.text);
    line_block_free(&o->rig->block);
    assert_int_equal(line_block_alloc(&o->rig->block, RIG_LINE * (1 + CAST_MAX_DEPTH), &err), 0);
    for (uint32_t i = 0; i < n; i++)
        o->table.surface[i].reflectance = 0.5;
    o->detect =
        (struct cast_detect){.surfaces = &o->table, .depth = CAST_MAX_DEPTH, .ghost_label = n, .max_echoes = 15};
    o->rig->setup.detect = &o->detect;
}

void close_optics(struct optics *o)
{
    surface_table_free(&o->table);
    cast_rig_close(o->rig);
}

void direction(const struct cast_rig *rig, const struct schedule_line *line, uint32_t i, long double d[3])
{
    long double turn = 6.283185307179586476925286766559L;
    long double m = turn * (long double)schedule_mirror_turn(&rig->segment, line->cast0 + i);
    long double p = turn * (long double)schedule_pan_turn(&rig->segment, line->cast0 + i);
    d[0] = sinl(p) * cosl(m);
    d[1] = cosl(p) * cosl(m);
    d[2] = sinl(m);
}

void near_range(const struct cast_rig *rig, uint32_t entry, long double range_m)
{
    double told = rig->block.a[entry] * 1e-5;
    if (!(fabs(told - (double)range_m) < 0.51e-5)) fail_msg("entry %u: %.6f m, not %.6Lf m", entry, told, range_m);
}

uint32_t shoot_line(struct optics *o, uint64_t number, struct schedule_line *line)
{
    schedule_get_line(&o->rig->segment, number, line);
    uint32_t n = (uint32_t)(line->cast_end - line->cast0);
    cast_some(o->rig, line, line->cast0, n);
    return n;
}

struct scene *sheets(const double y[3], const uint16_t label[3])
{
    double vertex[12][3];
    uint32_t triangle[6][3];
    uint16_t labels[6];
    static const struct scene_surface surface[3] = {{.object = "window", .material = "glass"},
                                                    {.object = "wall", .material = "brick"},
                                                    {.object = "mirror", .material = "silver"}};
    for (uint32_t p = 0; p < 3; p++) {
        for (uint32_t v = 0; v < 4; v++) {
            vertex[4 * p + v][0] = v == 1 || v == 2 ? 30.0 : -30.0;
            vertex[4 * p + v][1] = y[p];
            vertex[4 * p + v][2] = v >= 2 ? 30.0 : -30.0;
        }
        for (uint32_t t = 0; t < 2; t++)
            for (uint32_t v = 0; v < 3; v++)
                triangle[2 * p + t][v] = 4 * p + (v == 0 ? 0 : v + t);
        labels[2 * p] = labels[2 * p + 1] = label[p];
    }
    return made_scene(
        &(struct scene_arrays){(const double(*)[3])vertex, 12, (const uint32_t(*)[3])triangle, 6, labels, surface, 3});
}

struct scene *window(void)
{
    return sheets((const double[]){2.0, 2.004, 5.0}, (const uint16_t[]){0, 0, 1});
}
