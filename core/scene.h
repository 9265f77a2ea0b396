/* SPDX-License-Identifier: MIT */
/* The scene: meshes from files, as one list of triangles with surfaces. In: files and how to place them. Out:
 * vertices in double, in the project frame (prcs): metres, z up.
 *
 * A file's vertex v becomes R(up) * v * scale + offset_m, in double. `up: z` leaves the axes, `up: y` turns
 * (x, y, z) to (x, -z, y). Units and axes are what the spec says, never guessed. Readers give v in these
 * units and axes:
 *   Collada  comes in metres and y up: Assimp (5.2) applies its unit and up_axis
 *   IFC      comes in metres and y up, from web-ifc and ifc-lite as from Assimp
 *   FBX      keeps the file's unit (mostly centimetres: scale 0.01) and axes (mostly y up)
 *   glTF     is metres and y up by definition; its tree is multiplied in double (core/import/gltf)
 *   STL      has neither
 * Every placement of a mesh in a node tree counts: an object that is there five times gives its triangles
 * five times. Polygons are cut into triangles. A pair of object and material that is there already, in
 * this file or an earlier one, is the same surface, with the same label. Ownership: scene_load allocates everything,
 * scene_free releases it. After the load a scene is constant and may be read from any thread. */
#ifndef CORE_SCENE_H
#define CORE_SCENE_H

#include <stdint.h>
#include <stddef.h>

#include "core/err.h"
#include "core/texture.h"

enum scene_up { SCENE_UP_Z, SCENE_UP_Y };

enum {
    /* The room of an object's or a material's name, with its NUL. A longer name is cut and counted. The cut name then
     * ends in a hash of the whole name, so that two names never become one. */
    SCENE_NAME_LEN = 256,
    SCENE_TYPE_LEN = 64,        /* of a product's type, with its NUL */
    SCENE_GUID_LEN = 24,        /* of its GlobalId, likewise */
    SCENE_MAX_SURFACES = 65534, /* labels are 16 bits on the wire; 0xffff means "none" */
};
#define SCENE_MAX_COORDINATE_M 1e9

/* The readers of IFC bodies: web-ifc, ifc-lite and Assimp. AUTO: web-ifc and ifc-lite both read, or Assimp where they
 * are not installed. Each other value names the one reader that reads alone. */
enum scene_ifc_reader { IFC_READER_AUTO, IFC_READER_WEB, IFC_READER_LITE, IFC_READER_ASSIMP };

/* Limits for readers in processes of their own: Assimp, and the readers of glTF, GeoTIFF and IFC. */
struct scene_import_limits {
    uint32_t memory_mib; /* on top of the program's own; the file that hands the scene back may be as large */
    double time_s;       /* the most seconds, both of time and of processor time */
    uint32_t files;      /* open at a time in such a process; the programs of IFC have a limit of their own */
    enum scene_ifc_reader ifc_reader;
    int ifc_strict;         /* 1: a difference between the readers of IFC is an error */
    const char *ifc_folder; /* with the IFC readers; NULL: installed, or built, beside the program */
};
extern const struct scene_import_limits scene_import_defaults;

/* Where a copy of a mesh stands: its vertex v is at scale * (v, turned about the vertical) + at_m. */
struct scene_place {
    double at_m[3], turn_deg, scale; /* clockwise seen from above; scale > 0 */
};

/* Copies of a mesh. */
struct scene_places {
    struct scene_place *place; /* NULL: the mesh stands where its file says */
    size_t n;
    int own_surfaces; /* each copy has surfaces of its own: "OBJECT 1", "OBJECT 2" ... */
    const char *says; /* the name of this list, for errors */
};

struct scene_mesh_spec {
    /* The ending chooses the reader: .obj .ply .stl .tif in double; .ifc by two readers; .gltf .glb by their own; the
     * others by Assimp. */
    const char *file;
    enum scene_up up;
    double scale;       /* metres per unit of the file, > 0 */
    double offset_m[3]; /* added after axes and scale */
    int textures; /* keep texture coordinates, names of textures and colours of vertices, of all but .stl and .ifc */
    int cutouts;  /* look for holes in textures; without `textures` only what has holes is kept */
    const struct scene_import_limits *limits; /* NULL: the defaults */
    struct scene_places places;
};

/* Copies a name of n bytes, and a NUL, into `room` bytes, at least 32. Returns 1 where it was too long: it is cut
 * between two characters of UTF-8, and ends in a hash of all its bytes. */
int scene_copy_name(char *out, size_t room, const char *name, size_t n);

/* Returns whether a whole name fits a pattern of a configuration: * stands for any characters, also none, and ? for one
 * character of UTF-8. \* and \? stand for * and ?. All other characters stand for themselves, also [ ] and \. */
int scene_name_fits(const char *pattern, const char *name);

/* Which of a surface's triangles have colours at their corners. */
enum scene_vertex_colours { SCENE_COLOURS_NONE, SCENE_COLOURS_SOME, SCENE_COLOURS_ALL };

/* One surface label: an object of the file with one material.
 * Object: .obj the last o or g, .stl the name of the solid, else (and for .ply) the file's name without folder and
 * ending; for the others the node's name, or the mesh's where that is empty.
 * Material: for a .ply with several textures, the name of the surface's texture. */
struct scene_surface {
    char object[SCENE_NAME_LEN];
    char material[SCENE_NAME_LEN];
    float colour[3]; /* diffuse, sRGB, 0..1: of glTF, FBX, Collada and IFC, and of OBJ with an mtllib (Kd) */
    int has_colour;
    uint16_t vertex_colours; /* enum scene_vertex_colours, once the load is over; colours of corners replace `colour` */
    uint16_t texture;        /* of the diffuse colour: 1 + its number in the scene's textures; 0: none */
    uint16_t opacity;        /* of the opacity map that cuts holes, likewise; 0: the alpha of `texture` cuts them */
    float clear;             /* share of the light that goes through it, as the file says, 0..1. core doesn't use it */
    float solid;             /* a texel of less opacity is a hole: 0.5, or the format's figure; 0: there are no holes */
    /* Type and GlobalId of a product of IFC; else empty. */
    char type[SCENE_TYPE_LEN], guid[SCENE_GUID_LEN];
};

/* An image that lies on surfaces. */
struct scene_texture {
    char *file;     /* as found beside the mesh's file */
    uint8_t *bytes; /* of an image that lies within the mesh's file; else NULL */
    size_t n_bytes;
    uint32_t raw_width, raw_height; /* struct texture_source */
    enum texture_wrap wrap[2];
    int unreadable; /* 1: it can't be read, and a warning was given */
};

/* Counts of what the import left out or changed; each kind that is not 0 is also reported as one warning
 * per file. */
struct scene_counts {
    uint64_t zero_area;     /* triangles without area, left out */
    uint64_t not_triangles; /* points and lines, left out */
    uint64_t names_cut;     /* object or material names cut to SCENE_NAME_LEN - 1 bytes */
};

/* The unit and axes that a file, or its format by definition, states. The load doesn't apply them. */
struct scene_says {
    double unit_m;      /* metres per unit; 0: it doesn't say */
    int up;             /* the axis that points up: 1 x, 2 y, 3 z; negative: down; 0: it doesn't say */
    int is_left_handed; /* its axes, so that the mesh is mirrored */
};

/* A copy as it stands in the scene: x = scale * turned(v) + shift_m. */
struct scene_copy {
    double shift_m[3], scale, cosine, sine;
    double min_m[3], max_m[3]; /* bounds, prcs */
    uint32_t label0;           /* added to the mesh's labels */
};

/* A mesh that is kept once and stands in the scene any number of times. The mesh's frame: metres, z up, as loaded. */
struct scene_copied {
    struct scene *mesh;      /* owned; its surfaces and textures are the scene's */
    struct scene_copy *copy; /* [n] owned */
    uint32_t n;
    uint32_t first; /* triangle of the first copy; those of the others follow, copy by copy */
};

/* Triangles are numbered: the scene's own first, then those of the copies. The arrays hold the scene's own triangles
 * alone. */
struct scene {
    uint32_t n_vertices, n_triangles, n_surfaces;
    struct scene_copied *copied;   /* [n_copied] */
    uint32_t n_copied, n_copies;   /* meshes that have copies; copies of all of them */
    uint32_t n_all;                /* triangles, with those of the copies */
    uint32_t n_meshes;             /* placements in node trees, solids of .stl, bodies of IFC; other files: 1 */
    double (*vertex_m)[3];         /* [n_vertices] prcs */
    uint32_t (*triangle)[3];       /* [n_triangles] indices into vertex_m */
    uint16_t *label;               /* [n_triangles] index into surface */
    struct scene_surface *surface; /* [n_surfaces] */
    /* Only where a spec asks for textures, or a texture has holes; else NULL, 0. */
    float (*uv)[3][2]; /* [n_triangles] of the corners; the image's lower left corner is 0, 0; NaN: none */
    /* Only where a spec asks for textures and a mesh has colours of its vertices; else NULL. sRGB; the fourth is 0
     * where the corner has none, else 255. */
    uint8_t (*rgb)[3][4];          /* [n_triangles] of the corners */
    struct scene_texture *texture; /* [n_textures] */
    uint32_t n_textures;
    /* [n_surfaces] the holes of each surface, owned by `mask`. An entry is NULL where the surface has none. The array
     * is NULL where no surface has holes: they then cost nothing. */
    const struct texture_mask **cutout;
    struct texture_mask **mask; /* [n_masks] */
    uint32_t n_masks;
    uint32_t label0;           /* added to all labels by a user: label[i] - label0 is an index into surface */
    double error_m;            /* of the vertices, by rounding to single precision; 0: none */
    double min_m[3], max_m[3]; /* bounds of the used vertices, prcs */
    struct scene_counts counts;
    struct scene_says says; /* of the last file */
};

/* Loads all meshes into one scene.
 * tolerance_m: the largest error of a vertex that is allowed. All files but .obj, .ply, .stl and .tif are read in
 *   single precision. The error of those files is 6e-8 of their coordinates, and of the numbers that place them. A file
 *   whose error is larger than tolerance_m is refused. The message names the error.
 *   An error above 1e-6 m is warned of, also that of a binary .ply with float coordinates, and of a binary .stl.
 * Errors (SH_EINPUT, naming the file): missing or unreadable, not a mesh, no triangles, a coordinate that is
 *   not finite, an index out of range, |coordinate| beyond 1e9 m, too many surfaces, more than
 *   2^32-2 vertices or triangles.
 * Progress goes to report about four times a second once a load takes longer than a second. SH_ESTOPPED where
 *   report asks to stop.
 * Assimp and the readers of glTF, GeoTIFF and IFC read in processes of their own, started here, since some broken files
 *   make decoders crash, never end or take all memory. A crash, or a limit that is reached, is SH_EINPUT, too. The
 *   children are reaped, and do not outlive the calling thread. */
int scene_load(const struct scene_mesh_spec *specs, size_t n_specs, double tolerance_m, const struct sh_report *report,
               struct scene **out, struct sh_err *err);

/* A mesh as arrays. */
struct scene_arrays {
    const double (*vertex_m)[3]; /* [n_vertices] prcs */
    uint32_t n_vertices;
    const uint32_t (*triangle)[3]; /* [n_triangles] indices into vertex_m */
    uint32_t n_triangles;
    const uint16_t *label;               /* [n_triangles] index into surface; NULL: all 0 */
    const struct scene_surface *surface; /* [n_surfaces] NULL: there is one, "object"/"material" */
    uint32_t n_surfaces;
};

/* Builds a scene from arrays, all copied, with the checks of scene_load. */
int scene_from_arrays(const struct scene_arrays *arrays, struct scene **out, struct sh_err *err);

/* Keeps the surfaces that keep[n_surfaces] marks, by label, and leaves out all others. The kept surfaces get new labels
 * and vertices, in the old order, and the scene new bounds. There may be nothing left (n_all 0). SH_EINPUT where copies
 * of a mesh would keep different surfaces of it. After an error the scene is only to be freed. To be called before
 * anyone uses the scene, and before label0 is set. */
int scene_keep(struct scene *scene, const uint8_t *keep, struct sh_err *err);

/* Marks duplicate faces: triangles that have the same three corners, in any order, and the same holes as one with a
 * lower number. Triangle i has bit i % 64 of (*duplicate)[i / 64], to be freed. SH_ENOMEM, SH_ESTOPPED. */
int scene_find_duplicate_faces(const struct scene *scene, const struct sh_report *report, uint64_t **duplicate,
                               struct sh_err *err);

/* (*same)[i] is the first of the scene's own vertices with the coordinates of vertex i, where -0 equals 0; to be freed.
 * SH_ENOMEM, SH_ESTOPPED. */
int scene_find_same(const struct scene *scene, const struct sh_report *report, uint32_t **same, struct sh_err *err);

void scene_free(struct scene *scene);

/* Finds a file that a mesh or its library names. The file is searched by its name in n <= 4 folders, then by the name's
 * last part there; then, with any_case, both without regard to case, which reads the folders. Folders are paths up to
 * their last slash, and may be empty. To be freed; NULL: it is nowhere. */
char *scene_find_file(const char *const *folder, size_t n, const char *name, int any_case);

/* Reads the image of a texture, as texture_read does. */
int scene_read_texture(const struct scene_texture *texture, int alpha_only, struct texture_image *image,
                       struct sh_err *err);

/* ---- copies. */

/* The mesh, copy and triangle that a triangle's number stands for. */
struct scene_part {
    const struct scene *scene;     /* the mesh, or the scene itself */
    const struct scene_copy *copy; /* NULL: the scene itself */
    uint32_t triangle;             /* in the mesh */
    uint32_t copied;               /* number of the mesh among those that have copies */
};
void scene_find_part(const struct scene *scene, uint32_t triangle, struct scene_part *part);
/* The label of any triangle below n_all. */
uint32_t scene_label(const struct scene *scene, uint32_t triangle);
/* Corners of any triangle, prcs. */
void scene_corners(const struct scene *scene, uint32_t triangle, double corner[3][3]);
/* Triangles that are kept in memory: the scene's own, and those of each mesh that has copies. */
uint64_t scene_n_kept(const struct scene *scene);

/* Turns a direction from the mesh's frame into the scene's. out may be v. */
static inline void scene_copy_turn(const struct scene_copy *c, const double v[3], double out[3])
{
    const double x = v[0], y = v[1];
    out[0] = c->cosine * x + c->sine * y;
    out[1] = c->cosine * y - c->sine * x;
    out[2] = v[2];
}

/* A point from the mesh's frame into the scene's, and back. out may be the point. */
static inline void scene_copy_put(const struct scene_copy *c, const double v[3], double out[3])
{
    scene_copy_turn(c, v, out);
    for (int k = 0; k < 3; k++)
        out[k] = c->scale * out[k] + c->shift_m[k];
}

static inline void scene_copy_put_back(const struct scene_copy *c, const double p[3], double out[3])
{
    const double x = p[0] - c->shift_m[0], y = p[1] - c->shift_m[1];
    out[0] = (c->cosine * x - c->sine * y) / c->scale;
    out[1] = (c->cosine * y + c->sine * x) / c->scale;
    out[2] = (p[2] - c->shift_m[2]) / c->scale;
}

/* Texture coordinates at point p of a triangle's plane; scene->uv must be there. corner and p are in the
 * same frame, whichever it is. */
void scene_uv_at(const struct scene *scene, uint32_t triangle, const double *const corner[3], const double p[3],
                 double uv[2]);

/* Interpolates the colour at point p of a triangle's plane between the colours of its corners, sRGB; scene->rgb must be
 * there. Returns 0 where a corner has none. */
int scene_rgb_at(const struct scene *scene, uint32_t triangle, const double *const corner[3], const double p[3],
                 uint8_t rgb[3]);

/* The mask with the holes of one of the scene's own triangles; NULL: it has none. scene->cutout must be
 * there. */
static inline const struct texture_mask *scene_cutout(const struct scene *scene, uint32_t triangle)
{
    return scene->cutout[scene->label[triangle] - scene->label0];
}

#endif
