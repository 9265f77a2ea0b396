/* SPDX-License-Identifier: MIT */
/* The arrays of points: room for them, their columns by number. */
#include <string.h>

#include "core/grow.h"
#include "firmware_sim/app/studio/view/viewed.h"

#define COLUMN(member) offsetof(struct cloud, member), sizeof *((struct cloud *)0)->member

/* Where the pointer of a column lies, and the bytes of a value. */
static const struct {
    size_t at, size;
} columns[VIEWED_COLUMNS] = {
    [VIEWED_RANGE] = {COLUMN(range_m)},
    [VIEWED_REFLECTANCE] = {COLUMN(reflectance_db)},
    [VIEWED_AMPLITUDE] = {COLUMN(amplitude_db)},
    [VIEWED_T] = {COLUMN(time_s)},
    [VIEWED_LABEL] = {COLUMN(label)},
    [VIEWED_STATION] = {COLUMN(station)},
    [VIEWED_ECHO] = {COLUMN(echo)},
    [VIEWED_ECHOES] = {COLUMN(echo_count)},
    [VIEWED_RGB] = {COLUMN(rgb)},
};

static void *pointer_of(const struct cloud *p, int column)
{
    void *array;
    memcpy(&array, (const char *)p + columns[column].at, sizeof array);
    return array;
}

const void *viewed_array(const struct cloud *points, enum viewed_column column, size_t *size)
{
    *size = columns[column].size;
    return pointer_of(points, (int)column);
}

int viewed_points_room(struct cloud *p, size_t n, unsigned has, struct sh_err *err)
{
    bool ok = resize(&p->xyz_m, n, sizeof *p->xyz_m);
    for (int c = 0; c < VIEWED_COLUMNS && ok; c++)
        if ((has >> c & 1u) != 0) ok = resize((char *)p + columns[c].at, n, columns[c].size);
    return ok ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for %zu points", n);
}
