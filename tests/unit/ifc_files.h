/* SPDX-License-Identifier: MIT */
/* IFC files for tests, with one product a shape. Records have local numbers, and are written with a project around
 * them. */
#ifndef TESTS_UNIT_IFC_FILES_H
#define TESTS_UNIT_IFC_FILES_H

#include <stddef.h>

/* A product: records a line each, as "50=IFCBLOCK(@51,...)". @n is a record of its own, and #n one of the file's
 * common ones: #9 the origin, #10 and #11 the z and x directions, #12 a placement at the origin, #16, #17 the same in
 * two dimensions, #13 the context, #19 the placement of the site. `items` are the parts of its body, "@50" as a rule.
 * area_m2 and volume_m3 are those of the described shape, exact. circle_m is the radius of its curves; 0: it has
 * none. */
struct ifc_shape {
    const char *name, *items, *records;
    double area_m2, volume_m3, circle_m;
};

/* These are rows of records: a rectangle, a placement, and as item 60 a box of 4 x 2 x 1 m from the origin. */
#define IFC_RECT(id, x, y)     #id "=IFCRECTANGLEPROFILEDEF(.AREA.,$,#17," #x "," #y ")\n"
#define IFC_AT(id, point, xyz) #id "=IFCAXIS2PLACEMENT3D(@" #point ",$,$)\n" #point "=IFCCARTESIANPOINT((" xyz "))\n"
#define IFC_BOX_ROWS           "60=IFCEXTRUDEDAREASOLID(@61,@62,#10,1.)\n" IFC_RECT(61, 4., 2.) IFC_AT(62, 63, "2.,1.,0.")

/* The first is a box, and the names describe the others. */
enum { IFC_SHAPES = 34 };
extern const struct ifc_shape ifc_shapes[IFC_SHAPES];

enum { IFC_TEXT_ROOM = 1 << 17 };

/* Writes a file of n shapes. schema: IFC2X3, IFC4, IFC4X3. unit: the record of the unit of length, NULL: metres.
 * placed: the site's location, NULL: the origin. Products' numbers are 1000 (i + 1). more: NULL, or records in global
 * numbers. */
void ifc_write_text(char *text, const char *schema, const char *unit, const char *placed, const struct ifc_shape *shape,
                    size_t n, const char *more);

#endif
