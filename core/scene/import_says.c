/* Which formats define unit and axes: core/scene.h has the list. FBX says them in its global settings, which
 * Assimp hands on as metadata; what newer ones apply of them is taken back (import_assimp.c). */
#include "core/scene/import_says.h"

#include <math.h>
#include <string.h>
#include <strings.h>

#include <assimp/scene.h>

/* A number of the file's metadata; `other` where it isn't there or is none. */
static double number_of(const struct aiScene *in, const char *key, double other)
{
    const struct aiMetadata *all = in->mMetaData;
    for (unsigned i = 0; all != NULL && i < all->mNumProperties; i++) {
        const struct aiMetadataEntry *entry = &all->mValues[i];
        if (entry->mData == NULL || strcmp(all->mKeys[i].data, key) != 0) continue;
        int32_t whole;
        float single;
        double value = other;
        if (entry->mType == AI_INT32) {
            memcpy(&whole, entry->mData, sizeof whole);
            value = whole;
        } else if (entry->mType == AI_FLOAT) {
            memcpy(&single, entry->mData, sizeof single);
            value = (double)single;
        } else if (entry->mType == AI_DOUBLE) {
            memcpy(&value, entry->mData, sizeof value);
        }
        return isfinite(value) ? value : other;
    }
    return other;
}

/* UnitScaleFactor is in centimetres; UpAxis counts from 0 for x. A figure that can't be is none. */
static struct scene_says fbx_says(const struct aiScene *in)
{
    struct scene_says says = {0};
    double unit_cm = number_of(in, "UnitScaleFactor", 0.0), axis = number_of(in, "UpAxis", -1.0);
    if (unit_cm >= 1e-6 && unit_cm <= 1e9) says.unit_m = 0.01 * unit_cm;
    if (axis == 0.0 || axis == 1.0 || axis == 2.0)
        says.up = ((int)axis + 1) * (number_of(in, "UpAxisSign", 1.0) < 0.0 ? -1 : 1);
    return says;
}

struct scene_says import_says(const struct aiScene *in, const char *file)
{
    static const char *const metres_y_up[] = {".gltf", ".glb", ".dae", ".ifc"};
    const char *dot = strrchr(file, '.');
    for (size_t i = 0; dot != NULL && i < sizeof metres_y_up / sizeof metres_y_up[0]; i++)
        if (strcasecmp(dot, metres_y_up[i]) == 0) return (struct scene_says){1.0, 2};
    return dot != NULL && strcasecmp(dot, ".fbx") == 0 ? fbx_says(in) : (struct scene_says){0};
}
