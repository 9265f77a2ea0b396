/* SPDX-License-Identifier: MIT */
/* Moving a station: makes the site that a configuration with the new place would have, beside the present one. */
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/config/places.h"
#include "firmware_sim/site/steps.h"

void site_get_place(const struct site *site, uint32_t station, struct site_place *out)
{
    const struct site_station *s = &site->station[station];
    memcpy(out->position_m, s->at.position_m, sizeof out->position_m);
    out->heading_deg = s->station->heading_deg;
    out->pitch_deg = s->station->pitch_deg;
    out->roll_deg = s->station->roll_deg;
}

const char *site_why_fixed(const struct site *site)
{
    static const char *const why[] = {[PLATFORM_STATIC] = NULL,
                                      [PLATFORM_TRAJECTORY] = "the head follows a trajectory (platform.kind)",
                                      [PLATFORM_LIVE] = "the head is on a live platform (platform.kind)",
                                      [PLATFORM_STOPS] = "the stations are the platform's stops (platform.kind)"};
    return why[site->cfg->platform.kind];
}

static int move_is_same(const struct site_place *a, const struct site_place *b)
{
    return memcmp(a->position_m, b->position_m, sizeof a->position_m) == 0 && a->heading_deg == b->heading_deg &&
           a->pitch_deg == b->pitch_deg && a->roll_deg == b->roll_deg;
}

/* Without an anchor the station's own place gives the scene's place on the Earth. The scene must keep its place when
 * the station moves. So the new latitude and longitude are computed as if an anchor were at the station's first place,
 * with the scene's y axis to true north there. */
static int move_on_earth(const struct placement *was, const struct site_place *to, struct config_station *s,
                         struct sh_err *err)
{
    struct geoframe frame;
    struct georef_place at;
    if (memcmp(was->position_m, to->position_m, sizeof was->position_m) == 0) return SH_OK;
    int rc = geoframe_set_tangent(&frame, was->position_m, &was->place, 0.0, err);
    if (rc == SH_OK) rc = geoframe_locate(&frame, to->position_m, &at, err);
    if (rc != SH_OK) return rc;
    s->place = PLACE_GEODETIC;
    s->lat_deg = at.lat_deg;
    s->lon_deg = at.lon_deg;
    s->height_m = at.height_m;
    return SH_OK;
}

/* Sets the station's new place in s. Before the call, s is the station as it was configured. If the new place is the
 * first one, s stays as it is, with its floor and its place on the Earth. */
static int place(const struct site *first, uint32_t station, const struct site_place *to, struct config_station *s,
                 struct sh_err *err)
{
    struct site_place was;
    int rc = SH_OK;
    site_get_place(first, station, &was);
    if (to == NULL || move_is_same(&was, to)) return SH_OK;
    if (first->anchor.known)
        s->place = PLACE_NONE;
    else if (s->place != PLACE_NONE)
        rc = move_on_earth(&first->station[station].at, to, s, err);
    s->has_position = 1;
    s->has_instrument_height = 0;
    memcpy(s->position_m, to->position_m, sizeof s->position_m);
    s->heading_deg = to->heading_deg;
    s->pitch_deg = to->pitch_deg;
    s->roll_deg = to->roll_deg;
    return rc;
}

/* An error's text begins with the file's name, which means nothing to a client of the head. */
static int fail_without_file(const struct site *site, int rc, const struct sh_err *why, struct sh_err *err)
{
    const size_t n = strlen(site->cfg->file);
    const int named = n > 0 && strncmp(why->text, site->cfg->file, n) == 0 && strncmp(why->text + n, ": ", 2) == 0;
    return sh_fail(err, rc, "%s", named ? why->text + n + 2 : why->text);
}

static int make_sights(struct site *site, const struct site *from, const struct sh_report *report, struct sh_err *err)
{
    struct sh_report quiet = {0}; /* the start has warned already of too many stations for maps */
    if (report != NULL) quiet = *report;
    quiet.warn = NULL;
    site_share_sights(site, from);
    return site_open_sights(site, 0, site->n_stations, &quiet, err);
}

int site_load_moved(const struct site *from, const struct site_station_move *move, const struct sh_report *report,
                    struct site **out, struct sh_err *err)
{
    const uint32_t station = move->station;
    struct sh_err why = {0, ""};
    *out = NULL;
    if (site_why_fixed(from) != NULL) return sh_fail(err, SH_EINPUT, "%s", site_why_fixed(from));
    struct config *cfg = malloc(sizeof *cfg);
    if (cfg == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a configuration");
    memcpy(cfg, from->cfg, sizeof *cfg); /* with its padding: world.c compares scenes byte by byte */
    cfg->head.settings.frames = from->planned_frames;
    cfg->station[station] = move->first->cfg->station[station];
    int rc = place(move->first, station, move->to, &cfg->station[station], &why);
    if (rc == SH_OK) rc = site_load_for(cfg, SITE_MOVED, from, report, out, &why);
    if (rc != SH_OK) {
        rc = fail_without_file(from, rc, &why, err);
        free(cfg);
        return rc;
    }
    (*out)->own_cfg = cfg;
    rc = make_sights(*out, from, report, &why);
    if (rc == SH_OK) return SH_OK;
    rc = fail_without_file(from, rc, &why, err);
    site_free(*out);
    *out = NULL;
    return rc;
}
