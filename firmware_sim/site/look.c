/* SPDX-License-Identifier: MIT */
#include "firmware_sim/site/look.h"
#include "firmware_sim/site/site.h"

static void enter(void *ctx, int64_t t_ns, struct cast_setup *setup)
{
    const struct site_look_at *at = ctx;
    const struct site *site = at->site;
    site_move(site, at->station, 1e-9 * (double)t_ns, setup);
    if (site->n_knots == 0) return;
    site_enter(site, at->station, site_stretch_at(site, t_ns), setup);
    setup->knot = site->knot;
    setup->n_knots = (uint32_t)site->n_knots;
}

/* Fills a place: its pulses are those of one pan sweep, or of the whole trajectory where there is one. */
static void fill_place(const struct site *site, struct site_look_at *at, struct plan_place *place)
{
    struct head_settings settings = *site_settings(site);
    struct schedule_spec spec;
    if (settings.frames != 1) settings.frames = site->n_knots != 0 ? 0 : 1;
    site_fill_spec(site, &settings, &spec);
    *place = (struct plan_place){.beam = site->station[at->station].beam, .ctx = at};
    schedule_start(&place->segment, &spec);
    place->pulses = place->segment.end_pulse;
    if (site->n_knots != 0)
        place->pulses = schedule_pulse_at(&place->segment, site->knot[site->n_knots - 1].t_ns - site->knot[0].t_ns) + 1;
    if (site->n_movers > 0 || site->n_knots != 0) place->enter = enter;
    site_cast_setup(site, at->station, &place->setup);
}

/* The k-th station that this scanner scans from, k from 0. */
static uint32_t served_station(const struct site *site, uint32_t k)
{
    uint32_t i = 0;
    while (!site_serves(site, i) || k-- > 0)
        i++;
    return i;
}

void site_look_open(struct site_look *look, const struct site *site)
{
    const uint32_t served = site_n_served(site);
    look->n = served < SITE_LOOK_STATIONS ? served : SITE_LOOK_STATIONS;
    for (uint32_t i = 0; i < look->n; i++) {
        look->at[i] = (struct site_look_at){site, served_station(site, i * served / look->n)};
        fill_place(site, &look->at[i], &look->place[i]);
    }
}
