/* SPDX-License-Identifier: MIT */
/* scene.target: scans objects by name. The others are left out of the scene, or stay in it and give no echo. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/base/nearest.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/site/steps.h"

enum { MOST_NEAR = 3, NEAR_LETTERS = 2 };

/* The distance of a pattern from a name, without wildcards and in small letters. */
static size_t distance_of(const char *pattern, const char *name)
{
    char a[SCENE_NAME_LEN], b[SCENE_NAME_LEN];
    size_t n = 0;
    for (const char *p = pattern; *p != '\0' && n + 1 < sizeof a; p++)
        if (*p != '*' && *p != '?') a[n++] = (char)(*p >= 'A' && *p <= 'Z' ? *p + 'a' - 'A' : *p);
    a[n] = '\0';
    for (n = 0; name[n] != '\0' && n + 1 < sizeof b; n++)
        b[n] = (char)(name[n] >= 'A' && name[n] <= 'Z' ? name[n] + 'a' - 'A' : name[n]);
    b[n] = '\0';
    if (a[0] != '\0' && strstr(b, a) != NULL) return 0;
    /* A pattern may also be similar to the beginning of the name. */
    const size_t whole = nearest_distance(a, b);
    b[strlen(a)] = '\0';
    const size_t part = nearest_distance(a, b);
    return whole < part ? whole : part;
}

/* Lists objects whose names are within `within` letters of the pattern, nearest first, each once: "a", "b". */
static void list_near(const struct site *site, const char *pattern, size_t within, char *text, size_t len)
{
    const struct scene_surface *near[MOST_NEAR] = {NULL};
    text[0] = '\0';
    for (int k = 0; k < MOST_NEAR; k++) {
        size_t best = within + 1;
        for (uint32_t i = 0; i < site->n_surfaces; i++) {
            const struct scene_surface *s = site_surface(site, i);
            int is_new = 1;
            for (int j = 0; j < k; j++)
                is_new &= strcmp(near[j]->object, s->object) != 0;
            const size_t d = is_new ? distance_of(pattern, s->object) : best;
            if (d >= best) continue;
            best = d;
            near[k] = s;
        }
        if (near[k] == NULL) return;
        const size_t used = strlen(text);
        snprintf(text + used, len - used, "%s\"%s\"", k > 0 ? ", " : "", near[k]->object);
    }
}

static uint32_t count_objects(const struct site *site)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < site->n_surfaces; i++) {
        uint32_t k = 0;
        while (k < i && strcmp(site_surface(site, k)->object, site_surface(site, i)->object) != 0)
            k++;
        n += k == i;
    }
    return n;
}

static int fail_unknown(const struct site *site, uint32_t i, struct sh_err *err)
{
    char near[3 * SCENE_NAME_LEN + 16];
    const char *pattern = site->cfg->scene.target.object[i];
    const char *what = "similar ones are";
    list_near(site, pattern, NEAR_LETTERS, near, sizeof near);
    if (near[0] == '\0') {
        what = "as";
        list_near(site, pattern, NEAREST_MAX, near, sizeof near);
    }
    return sh_fail(
        err, SH_EINPUT,
        "%s: scene.target.objects[%u]: no object fits \"%s\"; allowed names of the scene's %u objects, %s %s",
        site->cfg->file, i, pattern, count_objects(site), what, near);
}

static int find_targets(const struct site *site, uint8_t *is_target, struct sh_err *err)
{
    const struct config_target *target = &site->cfg->scene.target;
    for (uint32_t k = 0; k < target->n_objects; k++) {
        int found = 0;
        for (uint32_t i = 0; i < site->n_surfaces; i++) {
            if (!scene_name_fits(target->object[k], site_surface(site, i)->object)) continue;
            is_target[i] = 1;
            found = 1;
        }
        if (!found) return fail_unknown(site, k, err);
    }
    return SH_OK;
}

static uint32_t count_copied(const struct scene_copied *of, const uint8_t *is_target)
{
    uint32_t *of_label = calloc((size_t)of->mesh->n_surfaces + 1, sizeof *of_label), n = 0;
    for (uint32_t i = 0; of_label != NULL && i < of->mesh->n_triangles; i++)
        of_label[of->mesh->label[i]]++;
    for (uint32_t k = 0; of_label != NULL && k < of->n; k++)
        for (uint32_t j = 0; j < of->mesh->n_surfaces; j++)
            n += is_target[of->copy[k].label0 + j] ? of_label[j] : 0;
    free(of_label);
    return n;
}

static uint32_t count_triangles(const struct scene *scene, const uint8_t *is_target)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < scene->n_triangles; i++)
        n += is_target[scene->label[i]];
    for (uint32_t i = 0; i < scene->n_copied; i++)
        n += count_copied(&scene->copied[i], is_target);
    return n;
}

static void target_count(const struct site *site, const uint8_t *is_target, struct site_target *t)
{
    uint32_t first = site->scene->n_surfaces;
    t->all_surfaces = site->n_surfaces;
    t->all_triangles = site->scene->n_all;
    t->triangles = count_triangles(site->scene, is_target);
    for (uint32_t k = 0; k < site->n_movers; k++) {
        const struct scene *scene = site->mover[k].scene;
        t->all_triangles += scene->n_all;
        t->triangles += count_triangles(scene, is_target + first);
        first += scene->n_surfaces;
    }
    for (uint32_t i = 0; i < site->n_surfaces; i++)
        t->surfaces += is_target[i];
}

/* Leaves out all that is no target. Movers without any triangle left go, too. */
static int leave_out(struct site *site, const uint8_t *is_target, struct sh_err *err)
{
    uint32_t first = site->scene->n_surfaces, n = 0;
    int rc = scene_keep(site->scene, is_target, err);
    for (uint32_t k = 0; k < site->n_movers; k++) {
        const struct site_mover m = site->mover[k];
        const uint32_t was = m.scene->n_surfaces;
        if (rc == SH_OK) rc = scene_keep(m.scene, is_target + first, err);
        first += was;
        if (rc == SH_OK && m.scene->n_all == 0)
            scene_free(m.scene);
        else
            site->mover[n++] = m;
    }
    site->n_movers = n;
    site->n_surfaces = site->scene->n_surfaces;
    for (uint32_t k = 0; k < n; k++)
        site->n_surfaces += site->mover[k].scene->n_surfaces;
    if (rc != SH_OK || site->scene->n_all > 0) return rc;
    return sh_fail(
        err, SH_EINPUT,
        "%s: scene.target.objects: none of them stands still; allowed with an object that does, or with others: hide",
        site->cfg->file);
}

int site_select_target(struct site *site, struct sh_err *err)
{
    const struct config_target *target = &site->cfg->scene.target;
    struct site_target *t = &site->world->target;
    if (target->n_objects == 0) return SH_OK;
    uint8_t *is_target = calloc(site->n_surfaces, 1);
    if (is_target == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %u surfaces", site->n_surfaces);
    int rc = find_targets(site, is_target, err);
    if (rc == SH_OK) target_count(site, is_target, t);
    if (rc == SH_OK && target->others == OTHERS_LEFT_OUT) rc = leave_out(site, is_target, err);
    if (rc == SH_OK && target->others == OTHERS_HIDE && t->surfaces < t->all_surfaces) {
        t->is_target = is_target;
        return SH_OK;
    }
    free(is_target);
    return rc;
}

int site_set_up_silent(struct site *site, struct sh_err *err)
{
    const struct site_target *t = &site->world->target;
    const uint32_t n_real = site->detect.ghost != NULL ? site->detect.n_real : site->n_surfaces;
    if (t->is_target == NULL) return SH_OK;
    site->silent = calloc((size_t)site->n_surfaces + 1, 1);
    if (site->silent == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %u surfaces", site->n_surfaces);
    /* Labels of tripods' legs come after those of the scene's objects. Legs are no such object: they give echoes. */
    for (uint32_t i = 0; i < site->n_surfaces; i++)
        site->silent[i] = i % n_real < t->all_surfaces && !t->is_target[i % n_real];
    return SH_OK;
}
