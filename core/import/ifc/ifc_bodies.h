/* SPDX-License-Identifier: MIT */
/* Bodies of products, as one reader makes them. In: its result (result.mjs has the form). Out: parts by product, and
 * the figures by which two readings are compared. */
#ifndef CORE_IMPORT_IFC_IFC_BODIES_H
#define CORE_IMPORT_IFC_IFC_BODIES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/err.h"
#include "core/text.h"

struct ifc_part {
    uint32_t n_vertices, n_triangles;
    float colour[4];  /* red, green, blue, opacity, 0..1 */
    double largest_m; /* largest coordinate that was rounded to single precision */
    const double (*vertex_m)[3];
    const uint32_t (*triangle)[3];
};

struct ifc_figures {
    double area_m2, volume_m3; /* signed: above 0 where the faces look outward */
    double min_m[3], max_m[3];
    double open_m2; /* an estimate of the area that would close it; rounding leaves some 1e-7 of the area */
};

struct ifc_body {
    uint64_t id;
    struct text_span type; /* as a reader writes it, in mixed case */
    uint32_t n_failures;
    size_t first, n_parts; /* in part; 0 parts where one of its numbers is wrong */
    struct ifc_figures figures;
};

/* All bodies of one reader. */
struct ifc_bodies {
    uint8_t *bytes; /* of the file; parts point into it */
    size_t size;
    struct ifc_part *part;
    size_t n_parts, room_parts;
    struct ifc_body *body; /* [n] by id */
    size_t n, room;
    size_t n_wrong; /* bodies that are left out since one of their numbers is wrong */
};

/* Nothing in the file is trusted: SH_EINPUT says what is wrong with its form. A wrong number (a coordinate beyond 1e9 m
 * or NaN, a colour that is NaN, a corner that is no vertex) takes its body away, not the others. ifc_bodies_free is due
 * in any case. */
int ifc_bodies_read(struct ifc_bodies *b, int fd, struct sh_err *err);
void ifc_bodies_free(struct ifc_bodies *b);
const struct ifc_body *ifc_bodies_find(const struct ifc_bodies *b, uint64_t id);

/* ---- ifc_figures.c */
void ifc_figures(const struct ifc_part *part, size_t n_parts, struct ifc_figures *f);
/* Closed, but for rounding. */
bool ifc_is_closed(const struct ifc_figures *f);

#endif
