/* SPDX-License-Identifier: MIT */
/* A site with other ranges, noise or step of a sphere: plans again what depends on them, and shares all else. */
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/site/steps.h"

struct site_vary {
    struct site site; /* the first member: site_vary_free gets its address */
    struct config cfg;
    uint32_t station; /* this site has georeferences of its own for this station alone */
};

int site_varies(const struct head_settings *a, const struct head_settings *b)
{
    return a->range_min_nm != b->range_min_nm || a->range_max_nm != b->range_max_nm || a->noise != b->noise ||
           a->angle_noise != b->angle_noise || a->sigma_nm != b->sigma_nm || a->ball_nm != b->ball_nm ||
           a->step_udeg != b->step_udeg;
}

/* Returns the settings that the new plan is made for. Settings that no plan depends on stay those of power-up, as in
 * the site itself. */
static struct head_settings planned_of(const struct head_settings *own, const struct head_settings *now)
{
    struct head_settings s = *own;
    s.range_min_nm = now->range_min_nm;
    s.range_max_nm = now->range_max_nm;
    s.noise = now->noise;
    s.angle_noise = now->angle_noise;
    s.sigma_nm = now->sigma_nm;
    s.ball_nm = now->ball_nm;
    s.step_udeg = now->step_udeg;
    return s;
}

static int plan_again(struct site_vary *v, const struct site *from, struct sh_err *err)
{
    struct site *site = &v->site;
    const size_t n = from->n_stations;
    site->station = malloc(n * sizeof *site->station);
    if (site->station == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %zu stations", n);
    memcpy(site->station, from->station, n * sizeof *site->station);
    site->station[v->station].georef = NULL;
    /* Georeferencing writes a scale to each stretch of a path. The copied pointers lead to the stretches of `from`,
     * whose scales must not change. */
    for (size_t i = 0; i < n; i++)
        site->station[i].on_stretch = NULL;
    int rc = site_vary_detect(site, err);
    return rc == SH_OK ? site_georeference_one(site, v->station, err) : rc;
}

int site_vary(const struct site *from, const struct head_settings *settings, uint32_t station, struct site **out,
              struct sh_err *err)
{
    const struct head_settings s = planned_of(&from->cfg->head.settings, settings);
    struct site_vary *v = calloc(1, sizeof *v);
    *out = NULL;
    if (v == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    v->site = *from;
    v->cfg = *from->cfg;
    v->site.cfg = &v->cfg;
    v->site.station = NULL;
    v->station = station;
    int rc = config_apply_settings(&v->cfg, &s, err);
    if (rc == SH_OK && s.step_udeg != from->cfg->head.settings.step_udeg) v->site.emitter = v->cfg.profile.emitter;
    if (rc == SH_OK) rc = plan_again(v, from, err);
    if (rc == SH_OK)
        *out = &v->site;
    else
        site_vary_free(&v->site);
    return rc;
}

void site_vary_free(struct site *site)
{
    struct site_vary *v = (struct site_vary *)(void *)site;
    if (v == NULL) return;
    if (site->station != NULL) {
        site_free_georeference(site, v->station);
        free(site->station);
    }
    free(v);
}
