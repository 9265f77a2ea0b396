/* SPDX-License-Identifier: MIT */
/* Assimp's C interface reads FBX, Collada, glTF 1.0 and Draco, and IFC where its readers are not installed. The nodes
 * of its tree are walked here.
 *
 * No post-processing: polygons are cut by our own triangulation, and node transforms are applied in double,
 * one level after the other, so that the rounding of single precision on the way is known. */
#include "core/import/import_assimp.h"

#include <math.h>
#include <string.h>
#include <sys/stat.h>

#include <assimp/config.h>
#include <assimp/scene.h>

#include "core/assimp_lib.h"
#include "core/import/import_material.h"
#include "core/import/import_open.h"
#include "core/import/import_says.h"
#include "core/scene/build_surfaces.h"

enum { MAX_DEPTH = 256 };

/* Assimp's messages while it reads; some are about geometry that it left out. */
struct import_log {
    unsigned n;
    char first[160];
};

struct import {
    struct scene_build *b;
    struct assimp_lib lib;
    const struct aiScene *in;
    const struct aiMatrix4x4 *level[MAX_DEPTH]; /* matrices from the root to the node; identities left out */
    int n_levels;
    bool is_mirrored;         /* the levels mirror the mesh at hand */
    struct import_uv uv;      /* of the mesh at hand */
    unsigned n_turned;        /* meshes whose texture is turned */
    unsigned n_boned;         /* parts of meshes, one for each material, that bones move */
    unsigned n_morphed;       /* parts with morph targets */
    double largest;           /* |coordinate| at any level, file units */
    double error;             /* of a coordinate once it is placed, file units */
    uint64_t n_faces, n_done; /* for the progress */
};

static void keep_log(const char *message, char *user)
{
    struct import_log *log = (struct import_log *)(void *)user;
    if (strncmp(message, "Warn", 4) != 0 && strncmp(message, "Error", 5) != 0) return;
    if (log->n++ > 0) return;
    const char *text = strchr(message, ':');
    text = text != NULL ? text + 1 : message;
    text += strspn(text, " ");
    size_t len = strcspn(text, "\r\n");
    if (len >= sizeof log->first) len = sizeof log->first - 1;
    memcpy(log->first, text, len);
}

static bool is_identity(const struct aiMatrix4x4 *m)
{
    return m->a1 == 1 && m->a2 == 0 && m->a3 == 0 && m->a4 == 0 && m->b1 == 0 && m->b2 == 1 && m->b3 == 0 &&
           m->b4 == 0 && m->c1 == 0 && m->c2 == 0 && m->c3 == 1 && m->c4 == 0;
}

static void transform(const struct aiMatrix4x4 *m, double v[3])
{
    double x = v[0], y = v[1], z = v[2];
    v[0] = (double)m->a1 * x + (double)m->a2 * y + (double)m->a3 * z + (double)m->a4;
    v[1] = (double)m->b1 * x + (double)m->b2 * y + (double)m->b3 * z + (double)m->b4;
    v[2] = (double)m->c1 * x + (double)m->c2 * y + (double)m->c3 * z + (double)m->c4;
}

static double determinant(const struct aiMatrix4x4 *m)
{
    return (double)m->a1 * ((double)m->b2 * (double)m->c3 - (double)m->b3 * (double)m->c2) -
           (double)m->a2 * ((double)m->b1 * (double)m->c3 - (double)m->b3 * (double)m->c1) +
           (double)m->a3 * ((double)m->b1 * (double)m->c2 - (double)m->b2 * (double)m->c1);
}

/* Whether the levels together mirror a mesh. glTF says that its triangles then face the other way. Collada and FBX say
 * nothing of it; the programs that write them draw such bodies with the same outer side as others. */
static bool is_mirrored(const struct import *im)
{
    bool is = false;
    for (int k = 0; k < im->n_levels; k++)
        if (determinant(im->level[k]) < 0.0) is = !is;
    return is;
}

static double largest_of(const double v[3], double largest)
{
    for (int k = 0; k < 3; k++)
        if (fabs(v[k]) > largest) largest = fabs(v[k]);
    return largest;
}

/* Finds the largest coordinate, and its error, that one row of a matrix makes of vertices. These reach up to `most` in
 * each direction, with errors up to `error`. The row's numbers were rounded to single precision, too; only 0 and 1 are
 * exact. */
static void add_rounding(const ai_real row[4], const double most[3], const double error[3], double *out_most,
                         double *out_error)
{
    *out_most = fabs((double)row[3]);
    *out_error = BUILD_SINGLE_ROUNDING * fabs((double)row[3]);
    for (int k = 0; k < 3; k++) {
        double factor = fabs((double)row[k]);
        *out_most += factor * most[k];
        *out_error += factor * error[k];
        if (factor != 0.0 && factor != 1.0) *out_error += BUILD_SINGLE_ROUNDING * factor * most[k];
    }
}

/* Finds the error of a mesh's vertices, up to `most_in` in each direction, once all levels have placed them. */
static void keep_error(struct import *im, const double most_in[3])
{
    double most[3], error[3], next_most[3], next_error[3];
    for (int i = 0; i < 3; i++) {
        most[i] = most_in[i];
        error[i] = BUILD_SINGLE_ROUNDING * most[i];
    }
    for (int k = im->n_levels - 1; k >= 0; k--) {
        const struct aiMatrix4x4 *m = im->level[k];
        const ai_real row[3][4] = {
            {m->a1, m->a2, m->a3, m->a4}, {m->b1, m->b2, m->b3, m->b4}, {m->c1, m->c2, m->c3, m->c4}};
        for (int i = 0; i < 3; i++)
            add_rounding(row[i], most, error, &next_most[i], &next_error[i]);
        memcpy(most, next_most, sizeof most);
        memcpy(error, next_error, sizeof error);
    }
    im->error = largest_of(error, im->error);
}

static int add_vertices(struct import *im, const struct aiMesh *mesh, struct sh_err *err)
{
    double most[3] = {0.0, 0.0, 0.0};
    im->b->mesh_vertex0 = im->b->scene->n_vertices;
    int rc = build_reserve(im->b, mesh->mNumVertices, mesh->mNumFaces, err);
    for (unsigned i = 0; i < mesh->mNumVertices && rc == SH_OK; i++) {
        const struct aiVector3D *in = &mesh->mVertices[i];
        double v[3] = {(double)in->x, (double)in->y, (double)in->z};
        for (int k = 0; k < 3; k++)
            most[k] = fmax(most[k], fabs(v[k]));
        im->largest = largest_of(v, im->largest);
        for (int k = im->n_levels - 1; k >= 0; k--) {
            transform(im->level[k], v);
            im->largest = largest_of(v, im->largest);
        }
        rc = build_vertex(im->b, v, err);
    }
    keep_error(im, most);
    return rc;
}

static int add_face(struct import *im, const struct aiFace *face, const struct aiMesh *mesh, uint16_t label,
                    struct sh_err *err)
{
    struct scene_build *b = im->b;
    if (face->mNumIndices < 3) {
        b->counts.not_triangles++;
        return SH_OK;
    }
    int rc = build_corners(b, face->mNumIndices, err);
    if (rc != SH_OK) return rc;
    const struct aiVector3D *uv = build_wants_textures(b) ? mesh->mTextureCoords[im->uv.set] : NULL;
    b->has_uv = uv != NULL;
    const struct aiColor4D *colour = build_wants_colours(b) ? mesh->mColors[0] : NULL;
    b->has_rgb = colour != NULL;
    for (unsigned i = 0; i < face->mNumIndices; i++) {
        unsigned index = face->mIndices[i];
        if (index >= mesh->mNumVertices)
            return build_fail(b, SH_EINPUT, err, "index %u out of range; there are %u vertices", index,
                              mesh->mNumVertices);
        b->corner[i] = b->mesh_vertex0 + index;
        if (colour != NULL) import_rgb(b, &colour[index], b->corner_rgb[i]);
        if (uv == NULL) continue;
        b->corner_uv[i][0] = (float)((double)uv[index].x * im->uv.scale[0] + im->uv.shift[0]);
        b->corner_uv[i][1] = (float)((double)uv[index].y * im->uv.scale[1] + im->uv.shift[1]);
    }
    if (im->is_mirrored) build_turn_over(b, face->mNumIndices);
    return build_polygon(b, face->mNumIndices, label, err);
}

static struct text_span span_of(const struct aiString *text)
{
    return (struct text_span){text->data, strnlen(text->data, text->length)};
}

static int label_of(struct import *im, const struct aiNode *node, const struct aiMesh *mesh, uint16_t *label,
                    struct sh_err *err)
{
    const struct aiString *object = node->mName.length > 0 ? &node->mName : &mesh->mName;
    const struct aiMaterial *material = NULL;
    struct aiString name = {0};
    if (mesh->mMaterialIndex < im->in->mNumMaterials) material = im->in->mMaterials[mesh->mMaterialIndex];
    import_uv(&im->lib, material, &im->uv);
    im->n_turned += im->uv.is_turned && build_wants_textures(im->b);
    if (im->uv.set >= AI_MAX_NUMBER_OF_TEXTURECOORDS || mesh->mTextureCoords[im->uv.set] == NULL) im->uv.set = 0;
    if (material != NULL) im->lib.aiGetMaterialString(material, AI_MATKEY_NAME, &name);
    int rc = build_label(im->b, span_of(object), span_of(&name), label, err);
    if (rc != SH_OK || material == NULL) return rc;
    return import_material(&im->lib, im->b, im->in, material, &im->b->scene->surface[*label], err);
}

static int add_mesh(struct import *im, const struct aiNode *node, const struct aiMesh *mesh, struct sh_err *err)
{
    uint16_t label;
    im->n_boned += mesh->mNumBones > 0; /* neither bones nor morph targets are applied */
    im->n_morphed += mesh->mNumAnimMeshes > 0;
    im->b->mesh = mesh->mName.length > 0 ? mesh->mName.data : node->mName.data;
    int rc = label_of(im, node, mesh, &label, err);
    if (rc == SH_OK) rc = add_vertices(im, mesh, err);
    im->is_mirrored = is_mirrored(im);
    for (unsigned i = 0; i < mesh->mNumFaces && rc == SH_OK; i++) {
        rc = add_face(im, &mesh->mFaces[i], mesh, label, err);
        if (rc == SH_OK && (im->n_done++ & 0xffff) == 0)
            rc = build_progress(im->b, (double)im->n_done / (double)im->n_faces, err);
    }
    im->b->scene->n_meshes++;
    im->b->mesh = NULL;
    return rc;
}

static int add_node(struct import *im, const struct aiNode *node, int depth, struct sh_err *err)
{
    if (depth == MAX_DEPTH) return build_fail(im->b, SH_EINPUT, err, "nodes are nested deeper than %d", MAX_DEPTH);
    bool moved = !is_identity(&node->mTransformation);
    if (moved) im->level[im->n_levels++] = &node->mTransformation;
    int rc = SH_OK;
    for (unsigned i = 0; i < node->mNumMeshes && rc == SH_OK; i++)
        rc = add_mesh(im, node, im->in->mMeshes[node->mMeshes[i]], err);
    for (unsigned i = 0; i < node->mNumChildren && rc == SH_OK; i++)
        rc = add_node(im, node->mChildren[i], depth + 1, err);
    if (moved) im->n_levels--;
    return rc;
}

/* Counts the faces of every instance, as add_mesh does for its progress. */
static uint64_t count_faces(const struct aiScene *in, const struct aiNode *node)
{
    uint64_t n = 0;
    for (unsigned i = 0; i < node->mNumMeshes; i++)
        n += in->mMeshes[node->mMeshes[i]]->mNumFaces;
    for (unsigned i = 0; i < node->mNumChildren; i++)
        n += count_faces(in, node->mChildren[i]);
    return n;
}

static const struct aiScene *import_file(const struct assimp_lib *lib, struct scene_build *b, struct import_log *log,
                                         struct sh_err *err)
{
    struct import_open open;
    struct aiLogStream stream = {.callback = keep_log, .user = (char *)(void *)log};
    import_open_set_up(&open, b->spec->file, b->instead);
    lib->aiAttachLogStream(&stream);
    struct aiPropertyStore *options = lib->aiCreatePropertyStore();
    lib->aiSetImportPropertyInteger(options, AI_CONFIG_IMPORT_COLLADA_USE_COLLADA_NAMES, 1); /* not the ids */
    lib->aiSetImportPropertyInteger(options, AI_CONFIG_IMPORT_IFC_SKIP_SPACE_REPRESENTATIONS,
                                    1); /* a space is the air of a room */
    /* Assimp would make a body of each node of a file without a mesh. */
    lib->aiSetImportPropertyInteger(options, AI_CONFIG_IMPORT_NO_SKELETON_MESHES, 1);
    const struct aiScene *in = lib->aiImportFileExWithProperties(b->spec->file, 0, &open.io, options);
    lib->aiReleasePropertyStore(options);
    lib->aiDetachLogStream(&stream);
    if (in == NULL || in->mRootNode == NULL) {
        const char *why = in == NULL ? lib->aiGetErrorString() : "nothing in it";
        const char *hint = strstr(why, "could not open referenced file") != NULL
                               ? "; its geometry is in that file, which belongs in the same folder: copy it there"
                               : "";
        if (open.refused[0] != '\0')
            build_fail(b, SH_EINPUT, err, "%s; allowed are regular files", open.refused);
        else
            build_fail(b, SH_EINPUT, err, "%s%s", *why != '\0' ? why : "not readable", hint);
        if (in != NULL) lib->aiReleaseImport(in);
        in = NULL;
    }
    return in;
}

/* Assimp (5.2) ends with an assertion where a Collada node has a skew. It finds no geometry in a <morph>. */
static int check_collada(struct scene_build *b, struct sh_err *err)
{
    struct text t;
    if (!text_has_ending(b->spec->file, ".dae")) return SH_OK;
    int rc = text_open(&t, b->spec->file, NULL, NULL, err);
    const bool has_skew = rc == SH_OK && memmem(t.data, t.size, "<skew", 5) != NULL;
    const bool has_morph = rc == SH_OK && memmem(t.data, t.size, "<morph", 6) != NULL;
    text_close(&t);
    if (has_morph)
        return build_fail(b, SH_EINPUT, err,
                          "it has a <morph>, which Assimp can't read; allowed are meshes without morph targets: export "
                          "it with the pose applied, or as glTF 2.0");
    if (!has_skew) return rc;
    return build_fail(b, SH_EINPUT, err,
                      "it has a <skew>, which Assimp can't read; allowed are <matrix>, <translate>, <rotate>, <scale> "
                      "and <lookat>: write the same as a <matrix>, or convert it to .obj or .ply");
}

/* The tree's root. An FBX file has no root itself. Assimp adds one, and from 5.4 on turns the file's axes to y up in
 * that root. This turn is undone: the file's axes stay, as with older versions. */
static struct aiNode root_of(const struct aiScene *in, const char *file)
{
    struct aiNode root = *in->mRootNode;
    if (text_has_ending(file, ".fbx")) root.mTransformation = (struct aiMatrix4x4){.a1 = 1, .b2 = 1, .c3 = 1, .d4 = 1};
    return root;
}

/* The reader of glTF has warned of all this, with the file's own words. */
static void warn_movers(const struct import *im)
{
    if (text_has_ending(im->b->spec->file, ".gltf") || text_has_ending(im->b->spec->file, ".glb")) return;
    if (im->n_boned > 0)
        build_warn(im->b, "the bones of %u parts of meshes are not applied: these are read as if they had none",
                   im->n_boned);
    if (im->n_morphed > 0)
        build_warn(im->b, "the morph targets of %u parts of meshes are not applied, whatever their weights",
                   im->n_morphed);
}

int import_assimp(struct scene_build *b, struct sh_err *err)
{
    struct import im = {.b = b};
    struct import_log log = {0};
    struct stat st;
    /* Assimp's C interface reports no progress, so a message at the start says that a large file takes a while. */
    if (stat(b->spec->file, &st) == 0 && st.st_size > 8 << 20) build_report(b, -1);
    int rc = check_collada(b, err);
    if (rc == SH_OK) rc = assimp_lib_load(&im.lib, err);
    if (rc != SH_OK) return rc;
    im.in = import_file(&im.lib, b, &log, err);
    if (im.in == NULL) return SH_EINPUT;
    b->scene->says = import_says(im.in, b->spec->file);
    im.n_faces = count_faces(im.in, im.in->mRootNode);
    const struct aiNode root = root_of(im.in, b->spec->file);
    rc = add_node(&im, &root, 0, err);
    if (rc == SH_OK) rc = build_single(b, im.largest, im.error, true, err);
    if (rc == SH_OK && log.n > 0) build_warn(b, "%u warnings while it was read, the first: %s", log.n, log.first);
    if (rc == SH_OK) warn_movers(&im);
    if (rc == SH_OK) import_say_colours(&im.lib, b, im.in);
    if (rc == SH_OK && im.n_turned > 0)
        build_warn(b, "the textures of %u meshes are rotated: they are read without the rotation", im.n_turned);
    im.lib.aiReleaseImport(im.in);
    return rc;
}
