/* SPDX-License-Identifier: MIT */
/* Leaves some surfaces out of copies. */
#include <stdlib.h>
#include <string.h>

#include "core/scene/copies.h"
#include "core/scene/hull.h"

/* Keeps the copies that keep some surface, with new labels. kept: the surfaces of the mesh that they
 * keep. */
static int keep_some(struct scene_copied *of, const uint8_t *keep, const uint16_t *label, const uint8_t **kept,
                     struct sh_err *err)
{
    const uint32_t surfaces = of->mesh->n_surfaces;
    uint32_t n = 0;
    *kept = NULL;
    for (uint32_t k = 0; k < of->n; k++) {
        const uint8_t *here = keep + of->copy[k].label0, *first = memchr(here, 1, surfaces);
        if (first == NULL) continue;
        if (*kept == NULL) *kept = here;
        if (memcmp(*kept, here, surfaces) != 0)
            return sh_fail(
                err, SH_EINPUT,
                "scene.target.objects: copy %u of a mesh would keep other objects than an earlier copy; allowed are "
                "patterns that fit the same objects of each copy",
                k + 1);
        of->copy[n] = of->copy[k];
        of->copy[n++].label0 = label[first - keep];
    }
    of->n = n;
    return SH_OK;
}

int scene_keep_copies(struct scene *scene, const uint8_t *keep, const uint16_t *label, struct sh_err *err)
{
    const uint32_t was = scene->n_copied;
    uint32_t n = 0;
    int rc = SH_OK;
    scene->n_copies = 0;
    for (uint32_t i = 0; i < was && rc == SH_OK; i++) {
        struct scene_copied *of = &scene->copied[n];
        const uint8_t *kept;
        if (n != i) {
            /* The two entries change places, so that each mesh is freed once, also after an error. */
            const struct scene_copied gone = *of;
            *of = scene->copied[i];
            scene->copied[i] = gone;
        }
        rc = keep_some(of, keep, label, &kept, err);
        if (rc == SH_OK && kept != NULL) rc = scene_keep(of->mesh, kept, err);
        if (rc == SH_OK && kept != NULL) rc = scene_bound_copies(scene, of->mesh, of->copy, of->n, NULL, err);
        if (rc != SH_OK || kept == NULL || of->mesh->n_all == 0) continue;
        of->first = scene->n_all;
        scene->n_all += of->n * of->mesh->n_triangles;
        scene->n_copies += of->n;
        n++;
    }
    for (uint32_t i = n; i < was && rc == SH_OK; i++) {
        scene_free(scene->copied[i].mesh);
        free(scene->copied[i].copy);
    }
    if (rc == SH_OK) scene->n_copied = n;
    return rc;
}
