#include "firmware_sim/site/site_inside.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { LINES = 64 };
/* A scan without end is taken to last so long. */
static const int64_t ENDLESS_NS = 3600000000000;
/* The map's maker looks at directions in squares about so wide (core/sight). */
static const double SQUARE_RAD = 0.1;

/* Why no station has a map; NULL: they may. */
static const char *why_not(const struct site *site)
{
    const char *moves = config_rays_move(site->cfg);
    if (moves != NULL) return moves;
    if (!sight_possible(site->scene))
        return site->scene->cutout != NULL ? "textures cut holes into surfaces (scene.cutouts)"
                                           : "the scene has too many triangles";
    return site->plan.methods.beam == BEAM_RINGS ? "the beam is rings, which have no ray for the centre" : NULL;
}

/* Whether all rays are pulses' first hits of what stands still, which a sight takes over. */
static int only_first_hits(const struct site *site)
{
    return site->plan.methods.beam == BEAM_SINGLE && site->plan.methods.depth == 0 && site->n_movers == 0 &&
           site->n_stations <= SITE_MAX_SIGHTS;
}

int site_order_can_wait(const struct site *site)
{
    const int single = site->cfg->beam.mode == BEAM_SINGLE || !config_has_footprint(site->cfg);
    return single && !site->detect.surfaces.has_optics && site->cfg->cast.sight != CHOICE_OFF &&
           why_not(site) == NULL && only_first_hits(site);
}

/* ---- the plan */

/* Pulses that a scan casts: of its frames; of an hour where it has no end. */
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

static void ask_need(struct site *site, const struct site_look *look, struct plan_sight_need *need)
{
    const struct config *cfg = site->cfg;
    struct site_view view;
    site_view_of(site, look->at[0].station, &view);
    const double share = site_view_share(&view, SQUARE_RAD);
    need->pulses = pulses_of(&look->place[0], cfg->head.settings.frames);
    site->plan.sight_rays = need->pulses / share;
    const double edge = sight_cells(site->plan.sight_rays, (uint64_t)(cfg->cast.sight_mib * 0x1p20));
    need->cells = 6.0 * edge * edge * share;
    need->cell_rad = sqrt(4.0 * M_PI / (6.0 * edge * edge));
    need->n_triangles = site->scene->n_triangles;
    need->saves_order = site->plan.methods.order_exactly && site_order_can_wait(site);
}

static int choose(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const enum config_choice asked = site->cfg->cast.sight;
    struct plan_sight_need need = {.forced = asked == CHOICE_AUTO ? -1 : asked == CHOICE_ON, .why_not = why_not(site)};
    struct plan_sight_found found;
    struct plan_sample *sample = NULL;
    struct site_look look;
    int rc = SH_OK, looks = 0;
    if (need.why_not == NULL) {
        site_look_open(&look, site);
        ask_need(site, &look, &need);
        looks = asked != CHOICE_OFF && plan_sight_may_pay(&need);
    }
    if (looks) rc = plan_sample_create(look.place, look.n, report, &sample, err);
    if (looks && rc == SH_OK) plan_sample_sight(sample, need.cell_rad, &found);
    plan_sample_free(sample);
    if (rc == SH_OK) rc = sh_check_stop(report, err);
    if (rc == SH_OK) site->plan.methods.sight = plan_sight(&need, looks ? &found : NULL, &site->plan.sight);
    return rc;
}

/* Surfaces are ordered in double by the map, which costs nothing. */
static void order_for_nothing(struct site *site)
{
    struct plan_row *row = &site->plan.order;
    if (!site->plan.methods.sight || !only_first_hits(site)) return;
    if (!site->plan.methods.order_exactly && site->cfg->scene.order_exactly == CHOICE_AUTO) {
        struct plan_option none = {.method = "none", .error_m = row->error_m};
        snprintf(none.why_not, sizeof none.why_not, "saves nothing where there is a map");
        plan_say(row, "order", "double", 0.0, 0.0, "");
        row->left[row->n_left++] = none;
        site->plan.methods.order_exactly = 1;
    }
    if (!site->plan.methods.order_exactly) return;
    row->cost_ns = 0.0;
    const size_t used = strlen(row->why);
    snprintf(row->why + used, sizeof row->why - used, "%sfree: the map of sight has the order", used != 0 ? "; " : "");
}

int site_plan_sight(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const char *why = why_not(site);
    const int waits = site->plan.methods.order_exactly && site_order_can_wait(site);
    if (site->cfg->cast.sight == CHOICE_ON && why != NULL)
        return sh_fail(err, SH_EINPUT, "%s: cast.sight: on, but %s; allowed auto, off", site->cfg->file, why);
    int rc = choose(site, report, err);
    if (rc != SH_OK) return rc;
    order_for_nothing(site);
    return waits && !site->plan.methods.sight ? site_order_bvhs(site, report, err) : SH_OK;
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
    struct sight_spec spec = {.bvh = s->bvh,
                              .rays = site->plan.sight_rays,
                              .memory_bytes = (uint64_t)(cfg->cast.sight_mib * 0x1p20) / of,
                              .exact = site->plan.methods.order_exactly,
                              .sees = site_view_sees,
                              .ctx = &view};
    memcpy(spec.station_m, s->at.position_m, sizeof spec.station_m);
    int rc = sight_create(&spec, cfg->loop.threads, report, &sight, &why);
    if (rc == SH_OK) s->sight = sight;
    if (rc == SH_ESTOPPED) return sh_fail_stopped(err);
    return rc == SH_OK ? rc
                       : sh_fail(err, rc, "%s: station %u %s: %.300s; cast.sight: off does without", cfg->file,
                                 station + 1, s->station->name, why.text);
}

static void close_sight(struct site_station *s)
{
    struct sight *sight = s->sight;
    s->sight = NULL;
    sight_free(sight);
}

int site_open_sights(struct site *site, uint32_t first, uint32_t n, const struct sh_report *report, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t i = 0; i < site->n_stations; i++)
        if (i < first || i - first >= n) close_sight(&site->station[i]);
    if (!site->plan.methods.sight || n > SITE_MAX_SIGHTS) return SH_OK;
    for (uint32_t i = first; i - first < n && rc == SH_OK; i++)
        if (site->station[i].sight == NULL) rc = make(site, i, n, report, err);
    return rc;
}

void site_close_sights(struct site *site)
{
    for (uint32_t i = 0; i < site->n_stations; i++)
        close_sight(&site->station[i]);
}
