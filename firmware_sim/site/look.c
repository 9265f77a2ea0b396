#include "firmware_sim/site/look.h"

#include <stdlib.h>

static void enter(void *ctx, int64_t t_ns, struct cast_setup *setup)
{
    const struct site_look_at *at = ctx;
    const struct site *site = at->site;
    site_move(site, site_mover_time(site, at->station, 1e-9 * (double)t_ns), setup);
    if (site->n_knots == 0) return;
    site_enter(site, at->station, site_stretch_at(site, t_ns), setup);
    setup->knot = site->knot;
    setup->n_knots = (uint32_t)site->n_knots;
}

/* One frame; along a trajectory all of it. */
static void fill_place(const struct site *site, struct site_look_at *at, struct plan_place *place)
{
    struct head_settings settings = site->cfg->head.settings;
    struct schedule_spec spec;
    if (settings.frames != 1) settings.frames = site->n_knots != 0 ? 0 : 1;
    config_fill_spec(&site->cfg->profile, &settings, &spec);
    *place = (struct plan_place){.beam = site->station[at->station].beam, .ctx = at};
    schedule_start(&place->segment, &spec);
    place->pulses = place->segment.end_pulse;
    if (site->n_knots != 0)
        place->pulses = schedule_pulse_at(&place->segment, site->knot[site->n_knots - 1].t_ns - site->knot[0].t_ns) + 1;
    if (site->n_movers > 0 || site->n_knots != 0) place->enter = enter;
    site_cast_setup(site, at->station, &place->setup);
}

uint32_t site_look_count(const struct site *site, uint32_t most)
{
    return site->n_stations < most ? site->n_stations : most;
}

uint32_t site_look_station(const struct site *site, uint32_t most, uint32_t i)
{
    return i * site->n_stations / site_look_count(site, most);
}

int site_look_open(struct site_look *look, struct site *site, uint32_t most, const struct sh_report *report,
                   struct sh_err *err)
{
    if (site->scene->n_triangles > 1000000) sh_progress(report, "trying methods on the scene", -1.0);
    *look = (struct site_look){.site = site, .n = site_look_count(site, most)};
    look->place = calloc(look->n, sizeof *look->place);
    look->at = calloc(look->n, sizeof *look->at);
    if (look->place == NULL || look->at == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    for (uint32_t i = 0; i < look->n; i++) {
        look->at[i] = (struct site_look_at){site, site_look_station(site, most, i)};
        fill_place(site, &look->at[i], &look->place[i]);
    }
    return plan_sample_create(look->place, look->n, &look->sample, err);
}

void site_look_close(struct site_look *look)
{
    plan_sample_free(look->sample);
    free(look->place);
    free(look->at);
}
