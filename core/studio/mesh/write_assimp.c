/* SPDX-License-Identifier: MIT */
/* Writes .gltf, .glb and .fbx through Assimp's exporter. The mesh becomes a scene of Assimp, with one mesh and one node
 * for each part. The exporter writes its files through assimp_files.h, so that they appear whole or not at all. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <assimp/material.h>
#include <assimp/scene.h>

#include "core/assimp_lib.h"
#include "core/colour.h"
#include "core/studio/mesh/assimp_files.h"

static const double MAX_BYTES = 4294000000.0; /* 2^32 less 967,296 bytes, which the rest of a .glb may take */

/* ---- the scene */

enum { N_AXES = 8, N_UNITS = 2, N_META = N_AXES + N_UNITS, N_PROPERTIES = 4 };

/* Assimp's objects for one part; the scene has pointers to them. */
struct export_part {
    struct aiNode node;
    struct aiMesh mesh;
    struct aiMaterial material;
    struct aiMaterialProperty property[N_PROPERTIES], *properties[N_PROPERTIES];
    struct aiTexture texture; /* of .glb, which holds its images */
    unsigned index;           /* of its mesh */
};

struct export_scene {
    struct aiScene scene;
    struct aiNode root, **child;
    struct export_part *part;
    struct aiMesh **meshes;
    struct aiMaterial **materials;
    struct aiTexture **textures;
    struct aiMetadata meta;
    struct aiString meta_key[N_META];
    struct aiMetadataEntry meta_value[N_META];
    int32_t axis[N_AXES];
    double unit_cm;
    int is_fbx, is_gltf, holds_images;
};

static void set_string(struct aiString *to, const char *text)
{
    size_t n = strlen(text);
    if (n > sizeof to->data - 1) n = sizeof to->data - 1;
    memcpy(to->data, text, n);
    to->data[n] = '\0';
    to->length = (ai_uint32)n;
}

static struct aiVector3D turned(const struct export_scene *s, double x, double y, double z)
{
    return !s->is_fbx ? (struct aiVector3D){(float)x, (float)z, (float)(0 - y)}
                      : (struct aiVector3D){(float)x, (float)y, (float)z};
}

/* Sets vertices from `first` on. Returns 0 where there is no memory. Where there is a texture, colours are left out,
 * since glTF multiplies the two. */
static int fill_vertices(const struct export_scene *s, const struct mesh *m, int textured, uint32_t first,
                         struct aiMesh *to)
{
    const uint32_t n = to->mNumVertices;
    const uint8_t(*rgb)[3] = textured ? NULL : m->rgb;
    to->mVertices = malloc(n * sizeof *to->mVertices);
    if (m->normal != NULL) to->mNormals = malloc(n * sizeof *to->mNormals);
    if (m->uv != NULL) to->mTextureCoords[0] = malloc(n * sizeof *to->mTextureCoords[0]);
    if (rgb != NULL) to->mColors[0] = malloc(n * sizeof *to->mColors[0]);
    if (to->mVertices == NULL || (m->normal != NULL && to->mNormals == NULL) ||
        (m->uv != NULL && to->mTextureCoords[0] == NULL) || (rgb != NULL && to->mColors[0] == NULL))
        return 0;
    if (m->uv != NULL) to->mNumUVComponents[0] = 2;
    float light[256];
    for (int i = 0; i < 256; i++)
        light[i] = !s->is_fbx ? (float)colour_srgb_decode(i / 255.0) : (float)i / 255.0f;
    for (uint32_t i = 0; i < n; i++) {
        const uint32_t v = first + i;
        to->mVertices[i] = turned(s, m->xyz_m[v][0], m->xyz_m[v][1], m->xyz_m[v][2]);
        if (m->normal != NULL)
            to->mNormals[i] = turned(s, (double)m->normal[v][0], (double)m->normal[v][1], (double)m->normal[v][2]);
        if (m->uv != NULL) to->mTextureCoords[0][i] = (struct aiVector3D){m->uv[v][0], m->uv[v][1], 0};
        if (rgb != NULL)
            to->mColors[0][i] = (struct aiColor4D){light[rgb[v][0]], light[rgb[v][1]], light[rgb[v][2]], 1.0f};
    }
    return 1;
}

/* All indices of a mesh are one array. */
static int fill_faces(const struct mesh *m, uint32_t first_face, uint32_t first_vertex, struct aiMesh *to)
{
    const uint32_t n = to->mNumFaces;
    unsigned *corner = malloc((n > 0 ? n : 1) * sizeof m->face[0]);
    to->mFaces = malloc((n > 0 ? n : 1) * sizeof *to->mFaces);
    if (corner == NULL || to->mFaces == NULL) {
        free(corner);
        free(to->mFaces);
        to->mFaces = NULL;
        return 0;
    }
    for (uint32_t i = 0; i < n; i++) {
        to->mFaces[i] = (struct aiFace){3, corner + 3 * (size_t)i};
        for (int k = 0; k < 3; k++)
            to->mFaces[i].mIndices[k] = m->face[first_face + i][k] - first_vertex;
    }
    if (n == 0) free(corner);
    return 1;
}

static void free_mesh(struct aiMesh *mesh)
{
    free(mesh->mVertices);
    free(mesh->mNormals);
    free(mesh->mTextureCoords[0]);
    free(mesh->mColors[0]);
    if (mesh->mFaces != NULL && mesh->mNumFaces > 0) free(mesh->mFaces[0].mIndices);
    free(mesh->mFaces);
}

struct property {
    enum aiPropertyTypeInfo type;
    const void *data;
    size_t n; /* bytes */
};

static int put_property(struct aiMaterial *to, struct aiMaterialProperty *at, const char *key, unsigned semantic,
                        struct property value)
{
    set_string(&at->mKey, key);
    at->mSemantic = semantic;
    at->mIndex = 0;
    at->mType = value.type;
    at->mDataLength = (unsigned)value.n;
    at->mData = malloc(value.n);
    if (at->mData == NULL) return 0;
    memcpy(at->mData, value.data, value.n);
    to->mProperties[to->mNumProperties++] = at;
    return 1;
}

/* A string property is its length, then its characters with a NUL. */
static int put_string(struct aiMaterial *to, struct aiMaterialProperty *at, const char *key, unsigned semantic,
                      const char *text)
{
    struct aiString string;
    set_string(&string, text);
    return put_property(to, at, key, semantic, (struct property){aiPTI_String, &string, 4 + (size_t)string.length + 1});
}

/* Puts an image into the scene, as a PNG. A material names the PNG by its number. Returns 0 if there is no memory. */
static int add_image(struct export_scene *s, const struct picture *image, struct aiTexture *texture, char name[16])
{
    char *png = NULL;
    size_t n = 0;
    FILE *out = open_memstream(&png, &n);
    int rc = out != NULL ? picture_put_png(out, image, NULL) : SH_ENOMEM;
    /* The numbers that follow in a .glb must begin at multiples of 4 bytes, which Assimp does not see to. So zeros are
     * added here; readers of PNG ignore them. */
    if (rc == SH_OK) fwrite("\0\0\0", 1, (4 - n % 4) % 4, out);
    if (out != NULL && fclose(out) != 0) rc = SH_ENOMEM;
    texture->pcData = (struct aiTexel *)(void *)png;
    if (rc != SH_OK || n > UINT32_MAX) {
        free(png);
        texture->pcData = NULL;
        return 0;
    }
    texture->mWidth = (unsigned)n; /* bytes, as height is 0 */
    strcpy(texture->achFormatHint, "png");
    snprintf(name, 16, "*%u", s->scene.mNumTextures);
    s->textures[s->scene.mNumTextures++] = texture;
    s->scene.mTextures = s->textures;
    return 1;
}

static int fill_material(struct export_scene *s, const struct mesh_part *part, struct export_part *own)
{
    static const float white[4] = {1, 1, 1, 1}, rough = 1;
    const int is_within = s->holds_images && part->image != NULL;
    struct aiMaterialProperty *at = own->property;
    struct aiMaterial *to = &own->material;
    char within[16] = "", *uri = NULL;
    const char *name = is_within ? within : part->texture;
    if (is_within && !add_image(s, part->image, &own->texture, within)) return 0;
    if (s->is_gltf && name != NULL && (name = uri = mesh_uri_of(name)) == NULL) return 0;
    const int done =
        put_string(to, &at[0], "?mat.name", 0, part->name) &&
        put_property(to, &at[1], "$clr.diffuse", 0, (struct property){aiPTI_Float, white, sizeof white}) &&
        put_property(to, &at[2], "$mat.roughnessFactor", 0, (struct property){aiPTI_Float, &rough, sizeof rough}) &&
        (part->texture == NULL || put_string(to, &at[3], "$tex.file", (unsigned)aiTextureType_DIFFUSE, name));
    free(uri);
    return done;
}

/* Sets z up, y to the back (FrontAxis 1, sign -1: the front is -y), and a unit of 100 cm. */
static void fill_meta(struct export_scene *s)
{
    static const struct {
        const char *key;
        int32_t value;
    } axes[N_AXES] = {{"UpAxis", 2},    {"UpAxisSign", 1},    {"FrontAxis", 1},      {"FrontAxisSign", -1},
                      {"CoordAxis", 0}, {"CoordAxisSign", 1}, {"OriginalUpAxis", 2}, {"OriginalUpAxisSign", 1}};
    static const char *const units[N_UNITS] = {"UnitScaleFactor", "OriginalUnitScaleFactor"};
    for (int i = 0; i < N_AXES; i++) {
        set_string(&s->meta_key[i], axes[i].key);
        s->axis[i] = axes[i].value;
        s->meta_value[i] = (struct aiMetadataEntry){AI_INT32, &s->axis[i]};
    }
    s->unit_cm = 100;
    for (int i = N_AXES; i < N_META; i++) {
        set_string(&s->meta_key[i], units[i - N_AXES]);
        s->meta_value[i] = (struct aiMetadataEntry){AI_DOUBLE, &s->unit_cm};
    }
    s->meta = (struct aiMetadata){N_META, s->meta_key, s->meta_value};
    s->scene.mMetaData = &s->meta;
}

static void free_scene(struct export_scene *s)
{
    for (unsigned i = 0; s->part != NULL && i < s->scene.mNumMeshes; i++) {
        free_mesh(&s->part[i].mesh);
        for (int k = 0; k < N_PROPERTIES; k++)
            free(s->part[i].property[k].mData);
        free(s->part[i].texture.pcData);
    }
    free(s->part);
    free(s->child);
    free(s->meshes);
    free(s->materials);
    free(s->textures);
}

static int allocate(struct export_scene *s, unsigned n)
{
    s->part = calloc(n, sizeof *s->part);
    s->child = calloc(n, sizeof *s->child);
    s->meshes = calloc(n, sizeof *s->meshes);
    s->materials = calloc(n, sizeof *s->materials);
    s->textures = calloc(n, sizeof *s->textures);
    s->scene.mNumMeshes = s->scene.mNumMaterials = s->root.mNumChildren = n;
    return s->part != NULL && s->child != NULL && s->meshes != NULL && s->materials != NULL && s->textures != NULL;
}

static const struct aiMatrix4x4 identity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

static int fill_part(struct export_scene *s, const struct mesh *m, unsigned i, const struct mesh_part *part,
                     uint32_t first_vertex, uint32_t first_face)
{
    struct export_part *own = &s->part[i];
    struct aiMesh *mesh = s->meshes[i] = &own->mesh;
    struct aiNode *node = s->child[i] = &own->node;
    struct aiMaterial *material = s->materials[i] = &own->material;
    material->mProperties = own->properties;
    material->mNumAllocated = N_PROPERTIES;
    own->index = i;
    set_string(&node->mName, part->name);
    node->mTransformation = identity;
    node->mParent = &s->root;
    node->mNumMeshes = 1;
    node->mMeshes = &own->index;
    set_string(&mesh->mName, part->name);
    mesh->mPrimitiveTypes = aiPrimitiveType_TRIANGLE;
    mesh->mNumVertices = part->n_vertices;
    mesh->mNumFaces = part->n_faces;
    mesh->mMaterialIndex = i;
    return fill_vertices(s, m, part->texture != NULL, first_vertex, mesh) &&
           fill_faces(m, first_face, first_vertex, mesh) && fill_material(s, part, own);
}

/* Parts without a face are left out. */
static int make_scene(struct export_scene *s, const struct mesh *m)
{
    const struct mesh_part *part = m->part;
    unsigned n = 0;
    for (uint32_t i = 0; i < m->n_parts; i++)
        n += part[i].n_faces > 0;
    if (!allocate(s, n)) return 0;
    set_string(&s->root.mName, "scan");
    s->root.mTransformation = identity;
    s->root.mChildren = s->child;
    s->scene.mRootNode = &s->root;
    s->scene.mMeshes = s->meshes;
    s->scene.mMaterials = s->materials;
    uint32_t vertex = 0, face = 0;
    unsigned at = 0;
    for (uint32_t i = 0; i < m->n_parts; i++) {
        if (part[i].n_faces > 0 && !fill_part(s, m, at++, &part[i], vertex, face)) return 0;
        vertex += part[i].n_vertices;
        face += part[i].n_faces;
    }
    return 1;
}

static int export_scene(const struct mesh_format *format, struct mesh_output *out, const struct export_scene *s,
                        const struct mesh_work *work, struct sh_err *err)
{
    struct assimp_lib lib;
    int rc = assimp_lib_load(&lib, err);
    if (rc != SH_OK) return rc;
    char *path = s->is_gltf ? mesh_uri_of(out->path) : strdup(out->path);
    if (path == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory to export it", out->path);
    struct exporter e = {
        .out = out, .is_uri = s->is_gltf, .is_raw = s->is_fbx, .io = {assimp_open, assimp_close, NULL}};
    e.io.UserData = (char *)(void *)&e;
    sh_progress(work->report, work->what, -1);
    const enum aiReturn done = lib.aiExportSceneEx(&s->scene, format->exporter, path, &e.io, 0);
    free(path);
    if (e.rc != SH_OK) return sh_fail(err, e.rc, "%s", e.err.text);
    rc = assimp_check_files(&e, err);
    if (rc != SH_OK) return rc;
    if (done == aiReturn_OUTOFMEMORY) return sh_fail(err, SH_ENOMEM, "%s: no memory to export it", out->path);
    if (done != aiReturn_SUCCESS || e.n_files == 0)
        return sh_fail(err, SH_EIO, "%s: Assimp cannot export it: %.200s", out->path, lib.aiGetErrorString());
    rc = sh_check_stop(work->report, err);
    return rc == SH_OK && e.is_raw ? assimp_copy_raw(&e, err) : rc;
}

/* In FBX the length of an array has 32 bits, and normals and colours are doubles for each corner of each face. In glTF
 * the length of everything together has 32 bits. */
static int check_size(const struct mesh_format *format, const char *path, const struct mesh *m, int is_fbx,
                      struct sh_err *err)
{
    const int colours = m->rgb != NULL && m->texture == NULL;
    const double face = is_fbx ? (colours ? 96 : 72) : 12,
                 vertex = is_fbx ? 0 : 12 + (m->normal != NULL ? 12 : 0) + (m->uv != NULL ? 8 : 0) + (colours ? 16 : 0);
    const double bytes = face * m->n_faces + vertex * m->n_vertices;
    if (bytes < MAX_BYTES) return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "%s: %u faces and %u vertices take %.1f GiB%s; %s holds up to 4 GiB: write .ply or .obj, or scan "
                   "more coarsely",
                   path, m->n_faces, m->n_vertices, bytes / 1073741824, is_fbx ? " in an array" : "", format->ending);
}

int mesh_write_assimp(const struct mesh_format *format, struct mesh_output *out, const struct mesh *mesh,
                      struct mesh_work *work, struct sh_err *err)
{
    struct export_scene s = {.is_fbx = strcmp(format->exporter, "fbx") == 0,
                             .is_gltf = strcmp(format->exporter, "gltf2") == 0,
                             .holds_images = strcmp(format->exporter, "glb2") == 0};
    int rc = check_size(format, out->path, mesh, s.is_fbx, err);
    if (rc != SH_OK) return rc;
    if (s.is_fbx) fill_meta(&s);
    rc = make_scene(&s, mesh) ? export_scene(format, out, &s, work, err)
                              : sh_fail(err, SH_ENOMEM, "%s: no memory to write it", out->path);
    free_scene(&s);
    return rc == SH_OK && !s.holds_images ? mesh_output_images(out, mesh, err) : rc;
}
