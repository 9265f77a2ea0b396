/* The header of a PLY file: elements with their properties, in file order. */
#ifndef CORE_SCENE_PLY_HEADER_H
#define CORE_SCENE_PLY_HEADER_H

#include "core/scene/text.h"

enum { PLY_MAX_ELEMENTS = 16, PLY_MAX_PROPERTIES = 512 };

enum ply_format { PLY_ASCII, PLY_LITTLE, PLY_BIG };

enum ply_type { PLY_INT8, PLY_UINT8, PLY_INT16, PLY_UINT16, PLY_INT32, PLY_UINT32, PLY_FLOAT, PLY_DOUBLE };

/* What a property is to us. */
enum ply_use {
    PLY_SKIP,
    PLY_X, /* of vertices, as the others up to PLY_SCALARS */
    PLY_Y,
    PLY_Z,
    PLY_STATION,
    PLY_ECHO,
    PLY_LABEL,
    PLY_SCALARS,
    PLY_CORNERS = PLY_SCALARS /* the list of a face */
};

struct ply_property {
    enum ply_type type, count_type;
    bool is_list;
    enum ply_use use;
};

enum ply_kind { PLY_OTHER, PLY_VERTEX, PLY_FACE };

struct ply_element {
    char name[32];
    enum ply_kind kind;
    uint64_t count;
    int first, n_properties; /* in property[] */
};

struct ply_header {
    enum ply_format format;
    int n_elements, n_properties;
    struct ply_element element[PLY_MAX_ELEMENTS];
    struct ply_property property[PLY_MAX_PROPERTIES];
};

extern const uint8_t ply_type_size[8]; /* bytes, by ply_type */

/* Leaves t at the first byte of data. A vertex has x, y and z afterwards; faces may lack their list. */
int ply_header_read(struct ply_header *h, struct text *t, struct sh_err *err);

/* The element's property of that use, or NULL. */
const struct ply_property *ply_find(const struct ply_header *h, const struct ply_element *e, enum ply_use use);

#endif
