/* SPDX-License-Identifier: MIT */
#include "firmware_sim/config/config.h"
#include "firmware_sim/site/look.h"
#include "firmware_sim/site/steps.h"
#include "firmware_sim/site/view.h"

#include <stdatomic.h>
#include <string.h>

enum { LINES = 64 };
/* Assumed length of a scan without end. */
static const int64_t ENDLESS_NS = 3600000000000;
/* Approximate width of the squares of directions in which a map is made (core/sight). */
static const double SQUARE_RAD = 0.1;

/* Returns why no station can have a map; NULL: stations may have one. */
static const char *why_not(const struct site *site)
{
    const char *moves = config_rays_move(site->cfg);
    if (moves != NULL) return moves;
    if (!sight_possible(site->scene))
        return site->scene->cutout != NULL ? "textures cut holes into surfaces (scene.cutouts)"
               : site->scene->n_copies > 0 ? "meshes have copies (scene.meshes[].copies)"
                                           : "the scene has too many triangles";
    return site->plan.methods.beam == BEAM_RINGS ? "the beam is rings, which have no ray for the centre" : NULL;
}

/* ---- the plan */

/* Returns how many pulses a scan casts: those of its pan sweeps; without an end, those of an hour. */
static double pulses_of(const struct plan_place *place, uint32_t frames)
{
    const struct schedule_segment *seg = &place->segment;
    const uint64_t lines = schedule_line_of(seg, place->pulses - 1) + 1, n = lines < LINES ? lines : LINES;
    const double fired = frames == 0 ? (double)schedule_pulse_at(seg, ENDLESS_NS) : (double)place->pulses * frames;
    uint64_t all = 0, cast = 0;
    for (uint64_t i = 0; i < n; i++) {
        struct schedule_line line;
        schedule_get_line(seg, i * lines / n, &line);
        all += line.pulse_end - line.pulse0;
        cast += line.cast_end > line.cast0 ? line.cast_end - line.cast0 : 0;
    }
    return all != 0 ? fired * (double)cast / (double)all : 0.0;
}

/* Returns the memory of all maps together. */
static uint64_t memory_bytes(const struct site *site)
{
    return (uint64_t)(site->cfg->cast.sight_mib * 0x1p20);
}

int site_plan_sight(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    const enum config_choice asked = cfg->cast.sight;
    const char *why = why_not(site);
    struct site_look look;
    struct site_view view;
    if (asked == CHOICE_ON && why != NULL)
        return sh_fail(err, SH_EINPUT, "%s: cast.sight: on, but %s; allowed auto, off", cfg->file, why);
    site_look_open(&look, site);
    site_view_of(site, look.at[0].station, &view);
    const struct plan_sight_need need = {.pulses = pulses_of(&look.place[0], cfg->head.settings.frames),
                                         .share = site_view_share(&view, SQUARE_RAD),
                                         .n_triangles = site->scene->n_all,
                                         .packet = bvh_get_info(site->bvh)->packet,
                                         .memory_bytes = memory_bytes(site),
                                         .forced = asked == CHOICE_AUTO ? -1 : asked == CHOICE_ON,
                                         .why_not = why};
    site->plan.sight_rays = need.pulses / need.share;
    return plan_sight(&need, &(struct plan_places){look.place, look.n}, report, &site->plan.methods.sight,
                      &site->plan.sight, err);
}

/* ---- making them */

static int make(struct site *site, uint32_t station, uint32_t of, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct site_station *s = &site->station[station];
    struct site_view view;
    struct sight *sight;
    struct sh_err why;
    site_view_of(site, station, &view);
    struct sight_spec spec = {.bvh = site->bvh,
                              .rays = site->plan.sight_rays,
                              .memory_bytes = memory_bytes(site) / of,
                              .sees = site_view_sees,
                              .ctx = &view};
    memcpy(spec.station_m, s->at.position_m, sizeof spec.station_m);
    int rc = sight_create(&spec, cfg->loop.threads, report, &sight, &why);
    s->sight = sight;
    if (rc == SH_ESTOPPED) return sh_fail_stopped(err);
    return rc == SH_OK ? rc
                       : sh_fail(err, rc, "%s: station %u %s: %.300s; cast.sight: off needs no map", cfg->file,
                                 station + 1, s->station->name, why.text);
}

static void close_sight(struct site_station *s)
{
    sight_free(atomic_exchange(&s->sight, NULL));
}

/* Whether a map can be reused: it depends on the BVH, the place and the directions of rays. The map's fineness changes
 * no hit. */
static int still_holds(const struct site *site, const struct site *from, uint32_t i)
{
    const struct site_station *a = &site->station[i], *b = &from->station[i];
    return b->sight != NULL && site->bvh == from->bvh &&
           memcmp(&a->at.position_m, &b->at.position_m, sizeof a->at.position_m) == 0 &&
           memcmp(&a->at.rotation, &b->at.rotation, sizeof a->at.rotation) == 0;
}

void site_share_sights(struct site *site, const struct site *from)
{
    if (!site->plan.methods.sight) return;
    for (uint32_t i = 0; i < site->n_stations; i++)
        if (still_holds(site, from, i)) site->station[i].sight = sight_share(from->station[i].sight);
}

int site_open_sights(struct site *site, uint32_t first, uint32_t n, const struct sh_report *report, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t i = 0; i < site->n_stations; i++)
        if (i < first || i - first >= n) close_sight(&site->station[i]);
    if (!site->plan.methods.sight) return SH_OK;
    uint32_t served = 0;
    for (uint32_t i = first; i - first < n; i++)
        served += config_serves(site->cfg, i) != 0;
    if (served > SITE_MAX_SIGHTS) {
        sh_warn(
            report,
            "%s: stations: a run makes no maps (cast.sight) for %u stations, allowed are up to %d; their rays go to "
            "the BVH, with the same hits",
            site->cfg->file, served, SITE_MAX_SIGHTS);
        return SH_OK;
    }
    for (uint32_t i = first; i - first < n && rc == SH_OK; i++)
        if (site->station[i].sight == NULL && config_serves(site->cfg, i)) rc = make(site, i, served, report, err);
    return rc;
}

void site_retire(const struct site *site)
{
    for (uint32_t i = 0; i < site->n_stations; i++)
        close_sight(&site->station[i]);
}
