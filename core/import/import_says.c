/* SPDX-License-Identifier: MIT */
/* core/scene.h lists the formats that define unit and axes. An FBX file states them in its global settings, which
 * Assimp passes on as metadata. Newer versions of Assimp apply some of them; import_assimp.c undoes that. */
#include "core/import/import_says.h"

#include <math.h>
#include <string.h>

#include <assimp/scene.h>

#include "core/text.h"

/* Returns a number of the file's metadata, or `other` where it isn't there or is not a number. */
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

/* Returns an axis of the file: 1 x, 2 y, 3 z, negative in the other direction; 0: it isn't there, or is no axis. */
static int axis_of(const struct aiScene *in, const char *key, const char *sign_key)
{
    const double axis = number_of(in, key, -1.0);
    if (axis != 0.0 && axis != 1.0 && axis != 2.0) return 0;
    return ((int)axis + 1) * (number_of(in, sign_key, 1.0) < 0.0 ? -1 : 1);
}

/* The axes right (FBX: CoordAxis), up and front, in this order, are right-handed where they are an even permutation of
 * x, y and z with an even number of minus signs, or an odd one with an odd number. */
static int is_left_handed(int right, int up, int front)
{
    const int a = right < 0 ? -right : right, b = up < 0 ? -up : up, c = front < 0 ? -front : front;
    if (a * b * c != 6 || a + b + c != 6) return 0; /* they are not three different axes */
    return (b == a % 3 + 1) == ((right < 0) + (up < 0) + (front < 0)) % 2;
}

/* UnitScaleFactor is in centimetres; UpAxis counts from 0 for x. An impossible figure counts as
 * missing. */
static struct scene_says fbx_says(const struct aiScene *in)
{
    struct scene_says says = {0};
    const double unit_cm = number_of(in, "UnitScaleFactor", 0.0);
    if (unit_cm >= 1e-6 && unit_cm <= 1e9) says.unit_m = 0.01 * unit_cm;
    says.up = axis_of(in, "UpAxis", "UpAxisSign");
    says.is_left_handed =
        is_left_handed(axis_of(in, "CoordAxis", "CoordAxisSign"), says.up, axis_of(in, "FrontAxis", "FrontAxisSign"));
    return says;
}

struct scene_says import_says(const struct aiScene *in, const char *file)
{
    static const char *const metres_y_up[] = {".gltf", ".glb", ".dae", ".ifc"};
    for (size_t i = 0; i < sizeof metres_y_up / sizeof metres_y_up[0]; i++)
        if (text_has_ending(file, metres_y_up[i])) return (struct scene_says){.unit_m = 1.0, .up = 2};
    return text_has_ending(file, ".fbx") ? fbx_says(in) : (struct scene_says){0};
}
