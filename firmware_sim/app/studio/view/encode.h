/* SPDX-License-Identifier: MIT */
/* Encodes what `scanhead view` serves: points, triangles, and the description of both. In: a recording. Out: bodies
 * that the caller frees. The formats are in README.md; all numbers are little-endian. */
#ifndef FIRMWARE_SIM_APP_STUDIO_VIEW_ENCODE_H
#define FIRMWARE_SIM_APP_STUDIO_VIEW_ENCODE_H

#include "drivers/link/web.h"
#include "firmware_sim/app/studio/view/viewed.h"

struct json;

enum {
    VIEW_MAX_POINTS = 1 << 20,    /* in an answer */
    VIEW_MAX_TRIANGLES = 1 << 20, /* the same */
    VIEW_MAX_SPARSE = 4000000,    /* points spread over meshes at once */
    VIEW_CLOUD_HEAD = 56,
    VIEW_CLOUD_COLUMN = 32,
    VIEW_MESH_HEAD = 40
};

/* Types of columns. */
enum view_type { VIEW_UINT8 = 1, VIEW_UINT16, VIEW_UINT32, VIEW_FLOAT32 };

struct view_column {
    const char *name, *unit; /* unit NULL: none */
    enum view_type type;
    uint32_t components;
};
/* view_columns has a row for each enum cloud_column. An answer has the column of positions before all of these. */
extern const struct view_column view_columns[CLOUD_COLUMNS], view_position;
const char *view_type_name(enum view_type type);

/* The points that an answer has: numbers `first`, `first` + `every` and so on, at most `most` of them, and no more than
 * an answer holds. every >= 1. */
struct view_part {
    uint32_t first, every, most;
};
/* Positions are relative to origin_m, times to t0_s. SH_ENOMEM. */
int view_encode_points(const struct cloud *points, const double origin_m[3], double t0_s, const struct view_part *part,
                       struct web_body *body, struct sh_err *err);
/* Encodes up to `most` triangles of a mesh from number `first` on, in the order of their edge ratio (viewed.h), the
 * smallest first. SH_ENOMEM. */
int view_encode_mesh(const struct viewed_mesh *mesh, uint32_t first, uint32_t most, struct web_body *body,
                     struct sh_err *err);
/* Writes the JSON of /head, for page_json; viewed is the struct viewed. */
void view_put_head(struct json *json, const void *viewed);

#endif
