/* SPDX-License-Identifier: MIT */
/* Keys that say where things are on the Earth: the scene's anchor, and each station in one of several
 * forms. */
#include "firmware_sim/config/check_links.h"
#include "firmware_sim/config/check_places.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"
#include "firmware_sim/config/table/value.h"

#include <stdio.h>
#include <string.h>

/* Reports a missing key: why it is required, and what is allowed. */
static int fail_required(struct cfg_reader *rd, const char *path, uint32_t item, const char *why)
{
    char allowed[CFG_ALLOWED_MAX];
    return cfg_fail_item(rd, path, item, "missing, and %s; required, %s", why,
                         cfg_allowed(cfg_find(&rd->table, path), rd->profile, allowed));
}

static void check_anchor(struct cfg_reader *rd, struct config *cfg)
{
    enum {
        IN_EXPLICIT = 1u << ANCHOR_EXPLICIT,
        IN_IFC = 1u << ANCHOR_IFC,
        IN_UTM = 1u << ANCHOR_UTM,
        IN_GEOTIFF = 1u << ANCHOR_GEOTIFF
    };
    static const struct {
        const char *path;
        unsigned taken, required; /* bits of sources */
    } keys[] = {
        {"scene.anchor.origin_m", IN_EXPLICIT, 0},
        {"scene.anchor.lat_deg", IN_EXPLICIT, IN_EXPLICIT},
        {"scene.anchor.lon_deg", IN_EXPLICIT, IN_EXPLICIT},
        {"scene.anchor.height_m", IN_EXPLICIT | IN_IFC | IN_GEOTIFF, IN_EXPLICIT},
        {"scene.anchor.north_deg", IN_EXPLICIT, 0},
        {"scene.anchor.utm_zone", IN_UTM, IN_UTM},
        {"scene.anchor.hemisphere", IN_UTM, IN_UTM},
    };
    const char *source = cfg_word(rd, "scene.anchor.source", (int)cfg->scene.anchor.source);
    char why[64], has[64] = "";
    cfg->scene.anchor.height_given = cfg_is_given(rd, "scene.anchor.height_m");
    if (!CFG_SOUND(rd, "scene.anchor.source")) return;
    for (size_t k = 0; k < CFG_LEN(keys); k++)
        if (keys[k].taken & 1u << cfg->scene.anchor.source)
            cfg_list_add(has, sizeof has, strrchr(keys[k].path, '.') + 1);
    for (size_t k = 0; k < CFG_LEN(keys); k++) {
        int given = cfg_is_given(rd, keys[k].path);
        if (given && !(keys[k].taken & 1u << cfg->scene.anchor.source))
            cfg_fail_key(rd, keys[k].path, "an anchor of source %s has no such key; allowed %s", source,
                         has[0] != '\0' ? has : "source alone");
        snprintf(why, sizeof why, "the anchor's source is %s", source);
        if (!given && (keys[k].required & 1u << cfg->scene.anchor.source)) fail_required(rd, keys[k].path, 0, why);
    }
}

/* The keys that belong to one form. height_m is not among them, since it belongs to two. */
static const struct {
    const char *path;
    enum config_place place;
} form_keys[] = {
    {"stations[].lat_deg", PLACE_GEODETIC}, {"stations[].lon_deg", PLACE_GEODETIC},
    {"stations[].utm_zone", PLACE_UTM},     {"stations[].hemisphere", PLACE_UTM},
    {"stations[].easting_m", PLACE_UTM},    {"stations[].northing_m", PLACE_UTM},
    {"stations[].ecef_m", PLACE_ECEF},
};

/* Finds the form in which the place is given, and checks that it is only one. */
static int find_form(struct cfg_reader *rd, struct config_station *station, uint32_t i)
{
    const char *first = NULL;
    station->place = PLACE_NONE;
    for (size_t k = 0; k < CFG_LEN(form_keys); k++) {
        if (!cfg_is_item_given(rd, form_keys[k].path, i)) continue;
        if (first != NULL && station->place != form_keys[k].place)
            return cfg_fail_item(
                rd, form_keys[k].path, i,
                "given together with %s; allowed one of lat_deg with lon_deg, easting_m with northing_m, ecef_m",
                strrchr(first, '.') + 1);
        first = form_keys[k].path;
        station->place = form_keys[k].place;
    }
    if (!cfg_is_item_given(rd, "stations[].height_m", i)) return SH_OK;
    if (station->place == PLACE_ECEF)
        return cfg_fail_item(rd, "stations[].height_m", i, "ecef_m also gives the height; allowed one of them");
    if (station->place == PLACE_NONE) station->place = PLACE_GEODETIC;
    return SH_OK;
}

/* Checks that the form is complete. Zone and hemisphere may come from an anchor in UTM. */
static int complete_form(struct cfg_reader *rd, const struct config *cfg, struct config_station *station, uint32_t i)
{
    static const char *const why[] = {[PLACE_GEODETIC] = "lat_deg, lon_deg and height_m go together",
                                      [PLACE_UTM] = "utm_zone, hemisphere, easting_m, northing_m, height_m go together",
                                      [PLACE_ECEF] = ""};
    int from_anchor = cfg->scene.anchor.source == ANCHOR_UTM;
    for (size_t k = 0; k < CFG_LEN(form_keys); k++) {
        const char *path = form_keys[k].path;
        if (form_keys[k].place != station->place || cfg_is_item_given(rd, path, i)) continue;
        if (from_anchor && strcmp(path, "stations[].utm_zone") == 0)
            station->utm_zone = cfg->scene.anchor.utm_zone;
        else if (from_anchor && strcmp(path, "stations[].hemisphere") == 0)
            station->north = cfg->scene.anchor.north;
        else
            return fail_required(rd, path, i, why[station->place]);
    }
    int has_height = station->place == PLACE_GEODETIC || station->place == PLACE_UTM;
    if (has_height && !cfg_is_item_given(rd, "stations[].height_m", i))
        return fail_required(rd, "stations[].height_m", i, why[station->place]);
    return SH_OK;
}

/* Without an anchor a station needs its place in the scene. For a CRS, or a link's protocol that needs it, the station
 * needs its place on the Earth, too. With an anchor the station needs one of them; the other follows. */
static int check_station(struct cfg_reader *rd, const struct config *cfg, struct config_station *station, uint32_t i)
{
    int code = find_form(rd, station, i);
    int anchored = cfg->scene.anchor.source != ANCHOR_NONE, nowhere = station->place == PLACE_NONE;
    station->has_position = cfg_is_item_given(rd, "stations[].position_m", i);
    station->has_instrument_height = cfg_is_item_given(rd, "stations[].instrument_height_m", i);
    if (code == SH_OK && !nowhere) code = complete_form(rd, cfg, station, i);
    if (code != SH_OK || !CFG_ITEM_SOUND(rd, i, "stations[]", "scene.anchor.source")) return code;
    if (!station->has_position && (!anchored || nowhere))
        return fail_required(rd, "stations[].position_m", i,
                             anchored ? "no place on the Earth is given" : "there is no scene.anchor to compute it");
    if (anchored && station->has_position && !nowhere)
        return cfg_fail_item(
            rd, "stations[].position_m", i,
            "given together with a place on the Earth, but scene.anchor computes one from the other; allowed one of "
            "them");
    if (anchored || !nowhere) return SH_OK;
    if (cfg->output.crs != GEOREF_LOCAL)
        return fail_required(rd, "stations[].lat_deg", i, "output.crs is not local and there is no scene.anchor");
    const int link = cfg_link_that_needs(cfg, PROTOCOL_NEEDS_PLACE);
    if (link >= 0) {
        char why[96];
        snprintf(why, sizeof why, "a link has the protocol %s and there is no scene.anchor",
                 cfg_word(rd, "links[].protocol", cfg->link[link].protocol));
        return fail_required(rd, "stations[].lat_deg", i, why);
    }
    return SH_OK;
}

void cfg_check_places(struct cfg_reader *rd, struct config *cfg)
{
    check_anchor(rd, cfg);
    for (uint32_t i = 0; i < cfg->n_stations; i++)
        check_station(rd, cfg, &cfg->station[i], i);
}
