/* SPDX-License-Identifier: MIT */
/* The arrays of points: room for them, their columns by number. */
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "firmware_sim/app/studio/view/viewed.h"

/* Returns the address of a column's pointer; *size: bytes of a value. */
static void *points_place_of(struct viewed_points *p, enum viewed_column column, size_t *size)
{
    const struct {
        void *at;
        size_t size;
    } all[VIEWED_COLUMNS] = {
        [VIEWED_RANGE] = {&p->range_m, sizeof *p->range_m},
        [VIEWED_REFLECTANCE] = {&p->reflectance_db, sizeof *p->reflectance_db},
        [VIEWED_AMPLITUDE] = {&p->amplitude_db, sizeof *p->amplitude_db},
        [VIEWED_T] = {&p->t_s, sizeof *p->t_s},
        [VIEWED_LABEL] = {&p->label, sizeof *p->label},
        [VIEWED_STATION] = {&p->station, sizeof *p->station},
        [VIEWED_ECHO] = {&p->echo, sizeof *p->echo},
        [VIEWED_ECHOES] = {&p->echoes, sizeof *p->echoes},
        [VIEWED_RGB] = {&p->rgb, sizeof *p->rgb},
    };
    *size = all[column].size;
    return all[column].at;
}

static void *pointer_at(const void *place)
{
    void *array;
    memcpy(&array, place, sizeof array);
    return array;
}

const void *viewed_array(const struct viewed_points *points, enum viewed_column column, size_t *size)
{
    struct viewed_points copy = *points; /* the same pointers */
    return pointer_at(points_place_of(&copy, column, size));
}

int viewed_points_room(struct viewed_points *p, size_t n, unsigned has, struct sh_err *err)
{
    bool ok = resize(&p->xyz_m, n, sizeof *p->xyz_m);
    for (int c = 0; c < VIEWED_COLUMNS && ok; c++) {
        size_t size;
        void *place = points_place_of(p, (enum viewed_column)c, &size);
        if ((has >> c & 1u) != 0) ok = resize(place, n, size);
    }
    return ok ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for %zu points", n);
}

void viewed_points_free(struct viewed_points *p)
{
    free(p->xyz_m);
    for (int c = 0; c < VIEWED_COLUMNS; c++) {
        size_t size;
        free(pointer_at(points_place_of(p, (enum viewed_column)c, &size)));
    }
    memset(p, 0, sizeof *p);
}
