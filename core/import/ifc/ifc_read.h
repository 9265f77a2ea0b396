/* SPDX-License-Identifier: MIT */
/* IFC files into a scene: each body by two independent readers, unless scene.ifc_reader names one or they are not
 * installed. README.md has the rules. */
#ifndef CORE_IMPORT_IFC_IFC_READ_H
#define CORE_IMPORT_IFC_IFC_READ_H

#include "core/import/ifc/ifc_bodies.h"
#include "core/import/ifc/ifc_choose.h"
#include "core/scene/build.h"

struct ifc_product;

/* ---- ifc_apart.c */

/* Sides of a full circle, by web-ifc, and the level of ifc-lite that goes with it. */
struct ifc_fineness {
    int segments;
    const char *level;
    double deviation_m; /* of the largest circle from its facets; 0: there is no circle */
};

/* The bodies that each reader has made. */
struct ifc_readings {
    struct ifc_bodies web, lite;
    bool has_web, has_lite;
    struct sh_err web_said, lite_said; /* why there is none; code 0: it was not asked */
};

/* Returns whether Node.js and both readers are installed. If not, `why` gets the reason, as a phrase. */
bool ifc_readers_are_there(const struct scene_import_limits *limits, char *why, size_t size);

/* Writes a reader's error with the reader's name, without the file's name and without advice. */
enum { IFC_REASON_LEN = 160 };
void ifc_reason(const struct scene_build *b, const char *name, const struct sh_err *said, char out[IFC_REASON_LEN]);

/* Runs the readers that are asked for, both at the same time. edits: changes to the file (ifc_edits_write). Fails where
 * none gives an answer. */
int ifc_run_readers(struct scene_build *b, struct ifc_fineness fineness, struct text_span edits,
                    struct ifc_readings *out, struct sh_err *err);
void ifc_readings_free(struct ifc_readings *r);

/* ---- ifc_say.c */

/* Warns of the products' findings, and names up to 100 products for each, several in a line. With strict, the first
 * line of the first doubtful finding is an error instead. */
int ifc_say_findings(struct scene_build *b, const struct ifc_product *product, size_t n_products, bool strict,
                     struct sh_err *err);
/* Names the products that have bodies for several views or scales. */
void ifc_say_levels(struct scene_build *b, const struct ifc_product *product, size_t n_products);
/* Names the curved products whose facets follow no tolerance. */
void ifc_say_coarse(struct scene_build *b, const struct ifc_product *product, size_t n_products);
/* Names the products that Assimp may read wrongly, in a warning or, with refuse, in an error. why: the reason that no
 * other reader is there. */
int ifc_say_assimp(struct scene_build *b, const struct ifc_product *product, size_t n_products, bool refuse,
                   const char *why, struct sh_err *err);

#endif
