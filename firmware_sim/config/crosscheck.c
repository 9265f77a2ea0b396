/* SPDX-License-Identifier: MIT */
/* Checks that concern more than one key, or files: limits of the head profile, order of angles, meshes, output, beam,
 * time. cfg_check has the order of these checks and of those in the other files. */
#include "firmware_sim/config/check.h"
#include "firmware_sim/config/check_faults.h"
#include "firmware_sim/config/check_head.h"
#include "firmware_sim/config/check_links.h"
#include "firmware_sim/config/check_places.h"
#include "firmware_sim/config/check_signal.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"
#include "firmware_sim/config/table/value.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "firmware_sim/config/epoch.h"

/* Returns the key to name where two contradict each other: the first, unless only the second was given. */
static const char *given_of(const struct cfg_reader *rd, const char *first, const char *second)
{
    return !cfg_is_given(rd, first) && cfg_is_given(rd, second) ? second : first;
}

/* Checks settings against the limits of the head profile that their rows in keys.c name (min_key, max_key). */
static void check_limits(struct cfg_reader *rd, const struct config *cfg)
{
    for (size_t i = 0; i < rd->table.n && cfg_has_profile(rd); i++) {
        const struct cfg_key *key = &rd->table.keys[i];
        if (key->max_key == NULL) continue;
        int64_t value, high = cfg_figure(&cfg->profile, key->max_key);
        int64_t low = key->min_key != NULL ? cfg_figure(&cfg->profile, key->min_key) : (int64_t)(key->min * 1e6);
        memcpy(&value, cfg_address(rd, key, 0), sizeof value);
        char from[40] = "";
        if (low < high) snprintf(from, sizeof from, "%.15g to ", from_micro(low));
        if (value < low || value > high)
            cfg_fail_key(rd, key->path, "%.15g is outside the limits of head profile %s; allowed %s%.15g %s",
                         from_micro(value), cfg->profile.name, from, from_micro(high), key->unit);
    }
}

/* A frame has a turn at most, and ends within the limits of the head profile. */
static void check_pan(struct cfg_reader *rd, const struct config *cfg)
{
    const int64_t start = cfg->head.settings.pan_start_udeg, stop = cfg->head.settings.pan_stop_udeg;
    const int64_t most = cfg_has_profile(rd) ? cfg->profile.pan_max_udeg : INT64_MAX;
    if ((stop >= start && stop - start <= 360000000) || !CFG_SOUND(rd, "head.pan_start_deg", "head.pan_stop_deg"))
        return;
    cfg_fail_key(rd, given_of(rd, "head.pan_stop_deg", "head.pan_start_deg"),
                 "the pan goes from %.15g to %.15g deg; allowed a pan_stop_deg of %.15g to %.15g", from_micro(start),
                 from_micro(stop), from_micro(start), from_micro(start + 360000000 < most ? start + 360000000 : most));
}

static void check_head(struct cfg_reader *rd, const struct config *cfg)
{
    const struct head_settings *s = &cfg->head.settings;
    if (s->prr_uhz < s->lines_uhz && CFG_SOUND(rd, "head.prr_hz", "head.lines_hz"))
        cfg_fail_key(rd, given_of(rd, "head.prr_hz", "head.lines_hz"),
                     "less than a pulse per line, %.15g pulses/s and %.15g lines/s; allowed a prr_hz of at least "
                     "%.15g, or a lines_hz of at most %.15g",
                     from_micro(s->prr_uhz), from_micro(s->lines_uhz), from_micro(s->lines_uhz),
                     from_micro(s->prr_uhz));
    if (!cfg_line_has_width(cfg) && CFG_SOUND(rd, "head.line_start_deg", "head.line_stop_deg"))
        cfg_fail_key(
            rd, given_of(rd, "head.line_stop_deg", "head.line_start_deg"),
            "the line goes from %.15g to %.15g deg; allowed a line_start_deg %s %.15g, or a "
            "line_stop_deg %s %.15g",
            from_micro(s->line_start_udeg), from_micro(s->line_stop_udeg),
            cfg->profile.emitter.kind == EMITTER_SPHERE ? "other than" : "below", from_micro(s->line_stop_udeg),
            cfg->profile.emitter.kind == EMITTER_SPHERE ? "other than" : "above", from_micro(s->line_start_udeg));
    check_pan(rd, cfg);
    if (s->station > cfg->n_stations && cfg->platform.kind != PLATFORM_STOPS &&
        CFG_SOUND(rd, "stations", "platform.kind"))
        cfg_fail_key(rd, "head.station", "there is no station %u; allowed 1 to %u", s->station, cfg->n_stations);
}

static void check_mesh(struct cfg_reader *rd, const struct config_mesh *mesh, uint32_t i)
{
    static const char *const endings[] = {".obj", ".ply", ".stl", ".gltf", ".glb",
                                          ".fbx", ".dae", ".ifc", ".tif",  ".tiff"};
    static const char path[] = "scene.meshes[].file";
    char shown[CFG_SHOW_MAX], allowed[96] = "";
    const char *dot = strrchr(basename(mesh->file), '.');
    int is_known = 0;
    for (size_t k = 0; k < CFG_LEN(endings); k++) {
        is_known |= dot != NULL && strcasecmp(dot, endings[k]) == 0;
        snprintf(allowed + strlen(allowed), sizeof allowed - strlen(allowed), " %s", endings[k]);
    }
    if (is_known)
        cfg_check_readable(rd, path, i, mesh->file, "mesh");
    else
        cfg_fail_item(rd, path, i, "\"%s\" has no known ending; allowed%s", cfg_show(mesh->file, shown), allowed);
}

static void check_names(struct cfg_reader *rd, struct config *cfg)
{
    for (uint32_t i = 0; i < cfg->n_stations; i++) {
        struct config_station *station = &cfg->station[i];
        if (station->name[0] == '\0') snprintf(station->name, sizeof station->name, "station-%u", i + 1);
        for (uint32_t k = 0; k < i; k++)
            if (strcmp(cfg->station[k].name, station->name) == 0)
                cfg_fail_item(rd, "stations[].name", i, "stations[%u] has the same name; allowed different names", k);
    }
}

static void check_colour(struct cfg_reader *rd, struct config *cfg)
{
    struct config_output *o = &cfg->output;
    const double *c = o->colour_rgb, *l = o->colour_limits;
    o->colour_limited = cfg_is_given(rd, "output.colour_limits");
    if (c[0] != floor(c[0]) || c[1] != floor(c[1]) || c[2] != floor(c[2]))
        cfg_fail_key(rd, "output.colour_rgb", "[%.9g, %.9g, %.9g]; allowed whole numbers from 0 to 255", c[0], c[1],
                     c[2]);
    if (!CFG_SOUND(rd, "output.colour")) return;
    if (cfg_is_given(rd, "output.colour_rgb") && o->colour != COLOUR_SOLID)
        cfg_fail_key(rd, "output.colour_rgb", "a colour, but output.colour is %s; allowed only with colour: solid",
                     colour_words[o->colour]);
    if (o->colour_limited && !colour_has_limits(o->colour))
        cfg_fail_key(rd, "output.colour_limits",
                     "limits, but output.colour is %s; allowed only with colour: range, height, frame",
                     colour_words[o->colour]);
    else if (o->colour_limited && !(l[0] < l[1]) && CFG_SOUND(rd, "output.colour_limits"))
        cfg_fail_key(rd, "output.colour_limits", "[%.9g, %.9g]; allowed a second number above the first", l[0], l[1]);
    if (o->colour == COLOUR_FRAME && cfg->platform.kind != PLATFORM_TRAJECTORY &&
        cfg->platform.kind != PLATFORM_STOPS && CFG_SOUND(rd, "platform.kind"))
        cfg_fail_key(rd, "output.colour",
                     "frame, but points have no frame scalar: platform.kind is %s; allowed with trajectory, stops",
                     cfg_word(rd, "platform.kind", (int)cfg->platform.kind));
}

static void check_output(struct cfg_reader *rd, struct config *cfg)
{
    const struct config_output *output = &cfg->output;
    const int bits = output->layout == LINE_POLAR ? 32 : 31; /* a range has no sign */
    const double counts = ldexp(1.0, bits);
    cfg->output.layout_given = cfg_is_given(rd, "output.layout");
    check_colour(rd, cfg);
    if (!cfg_is_given(rd, "output.tolerance_m")) cfg->output.tolerance_m = fmax(1e-7, 1e-3 * cfg->plan.range_m);
    if (!cfg_is_given(rd, "scene.tolerance_m"))
        cfg->scene.tolerance_m = cfg_is_given(rd, "plan.tolerance_m") ? 0.1 * cfg->plan.range_m : 1.0;
    cfg->optics.depth_given = cfg_is_given(rd, "optics.depth");
    if (output->utm_zone != 0 && output->crs != GEOREF_UTM && CFG_SOUND(rd, "output.crs"))
        cfg_fail_key(rd, "output.utm_zone", "a zone, but output.crs is not utm; allowed only with crs: utm");
    if (output->heights == HEIGHTS_GEOID && output->crs != GEOREF_UTM && output->crs != GEOREF_GEODETIC &&
        CFG_SOUND(rd, "output.crs"))
        cfg_fail_key(rd, "output.heights",
                     "geoid, but output.crs has no heights; allowed only with crs: utm, geodetic");
    if (output->scale_m != 0.0 && output->scale_m < 1e-6)
        cfg_fail_key(rd, "output.scale_m", "%.10g is out of range; allowed 0 (automatic) or 1e-6 to 1 m",
                     output->scale_m);
    else if (output->scale_m != 0.0 && cfg_has_profile(rd) && cfg->profile.range_max_m / output->scale_m >= counts)
        cfg_fail_key(rd, "output.scale_m",
                     "%.10g is too fine: %.10g m of head profile %s do not fit into %d bits; allowed above %.4g to "
                     "1 m, or 0 (automatic)",
                     output->scale_m, cfg->profile.range_max_m, cfg->profile.name, bits,
                     cfg->profile.range_max_m / counts);
}

static const char *offset_of(const struct config *cfg)
{
    if (cfg->instrument.transit_offset_m == 0.0 && cfg->instrument.mirror_offset_m == 0.0) return NULL;
    return "instrument.transit_offset_m or mirror_offset_m moves the beam";
}

const char *config_beam_moves(const struct config *cfg)
{
    int moves = cfg->platform.kind != PLATFORM_STATIC;
    for (uint32_t i = 0; i < cfg->scene.n_meshes; i++)
        moves |= config_mesh_moves(&cfg->scene.mesh[i]);
    if (moves) return "the head or a mesh moves";
    for (uint32_t i = 0; i < cfg->n_stations; i++)
        if (cfg->station[i].tripod.given && cfg->station[i].tripod.legs)
            return "a tripod's legs (stations[].tripod.legs) have outlines that are not looked for";
    return offset_of(cfg);
}

const char *config_rays_move(const struct config *cfg)
{
    return config_head_moves(&cfg->platform) ? "the head moves" : offset_of(cfg);
}

/* All other checks of cast.sight need the loaded scene and the plan (firmware_sim/site/sights.c). */
static void check_sight(struct cfg_reader *rd, const struct config *cfg)
{
    const char *why = config_rays_move(cfg);
    if (cfg->cast.sight != CHOICE_ON || !CFG_SOUND(rd, "platform.kind", "beam.mode")) return;
    if (why == NULL && cfg->beam.mode == BEAM_RINGS) why = "beam.mode is rings, which have no ray for the centre";
    if (why != NULL) cfg_fail_key(rd, "cast.sight", "on, but %s; allowed auto, off", why);
}

static const double LEAST_PULSE_NS = 0.1; /* 15 mm of range */

/* Modes with sub-rays need a head profile with a footprint, and a pulse that is not too short. Sub-rays that hit one
 * oblique surface have different ranges: where the pulse is too short to join them, each would be an echo of its own,
 * or be lost because it is too weak. An adaptive beam needs outlines, which are found from one place. */
static void check_beam(struct cfg_reader *rd, const struct config *cfg)
{
    const struct config_profile *p = &cfg->profile;
    const char *why = config_beam_moves(cfg);
    const int has_footprint = config_has_footprint(cfg);
    if (cfg->beam.mode == BEAM_SINGLE) return;
    if (cfg_has_profile(rd) && !has_footprint && cfg->beam.mode != BEAM_AUTO)
        cfg_fail_key(rd, "beam.mode", "head profile %s has no footprint; allowed single", p->name);
    else if (cfg->beam.mode == BEAM_ADAPTIVE && why != NULL && CFG_SOUND(rd, "platform.kind"))
        cfg_fail_key(rd, "beam.mode", "adaptive, but %s; allowed single, rings, auto", why);
    else if (cfg_has_profile(rd) && has_footprint && p->pulse_width_ns < LEAST_PULSE_NS)
        cfg_fail_key(
            rd, "beam.mode",
            "pulse_width_ns of head profile %s is %.10g: too short to join a footprint's echoes of one surface; "
            "allowed single, or a pulse_width_ns of at least %.10g",
            p->name, p->pulse_width_ns, LEAST_PULSE_NS);
}

void cfg_check_loop(struct cfg_reader *rd, const struct config *cfg)
{
    if (fmod(1e9, cfg->loop.tick_hz) == 0.0 && floor(cfg->loop.tick_hz) == cfg->loop.tick_hz) return;
    cfg_fail_key(rd, "loop.tick_hz",
                 "%.15g does not divide 1e9; allowed a divisor of 1e9 from 100 to 10000 Hz, such as 500, 1000, 2000",
                 cfg->loop.tick_hz);
}

static void check_time(struct cfg_reader *rd, const struct config *cfg)
{
    enum epoch_source source;
    struct sh_err why;
    char shown[CFG_SHOW_MAX];
    const int link = cfg_link_that_needs(cfg, PROTOCOL_NEEDS_TIME);
    if (epoch_parse(cfg->time.epoch, utc_table_builtin(), &source, NULL, &why) != SH_OK)
        cfg_fail_key(rd, "time.epoch",
                     "\"%s\": %.80s; allowed none, utc, tai, or a time after 1980-01-06 such as 2026-01-01T00:00:00Z",
                     cfg_show(cfg->time.epoch, shown), why.text);
    else if (source == EPOCH_NONE && link >= 0 && CFG_SOUND(rd, "time.epoch"))
        cfg_fail_item(rd, "links[].protocol", (uint32_t)link,
                      "%s, but the time is not known; required is time.epoch: utc, tai, or a time such as "
                      "2026-01-01T00:00:00Z",
                      cfg_word(rd, "links[].protocol", cfg->link[link].protocol));
    else if (source == EPOCH_NONE && cfg->time.ptp.follower && CFG_SOUND(rd, "time.epoch"))
        cfg_fail_key(rd, "time.ptp.follower",
                     "is on, but the time is not known; required is time.epoch: utc, tai, or a time such as "
                     "2026-01-01T00:00:00Z");
    if (1000 % cfg->gnss.rate_hz != 0 || cfg->gnss.rate_hz == 8)
        cfg_fail_key(rd, "gnss.rate_hz", "%u is not a rate of the receiver; allowed 1, 2, 4, 5, 10 or 20 Hz",
                     cfg->gnss.rate_hz);
    if (cfg->gnss.quality == 3)
        cfg_fail_key(
            rd, "gnss.quality",
            "3 is not a fix of position; allowed 0 none, 1 autonomous, 2 differential, 4 RTK fixed, 5 RTK float");
}

static void check_target(struct cfg_reader *rd, const struct config *cfg)
{
    if (cfg_is_given(rd, "scene.target.others") && cfg->scene.target.n_objects == 0)
        cfg_fail_key(rd, "scene.target.others", "given, but there are no scene.target.objects; allowed with objects");
    for (uint32_t i = 0; i < cfg->scene.target.n_objects; i++)
        if (cfg->scene.target.object[i][0] == '\0')
            cfg_fail_item(rd, "scene.target.objects[]", i, "empty; allowed a name, with * and ?");
}

void cfg_check(struct cfg_reader *rd, struct config *cfg)
{
    cfg_check_emitter_settings(rd, cfg); /* first, since it sets the rates, and their limits, that follow from others */
    cfg_check_rate(rd, cfg);
    check_limits(rd, cfg);
    check_head(rd, cfg);
    cfg_limit_range(rd, cfg); /* before check_output, whose scale must hold the ranges that are left */
    for (uint32_t i = 0; i < cfg->scene.n_meshes; i++)
        check_mesh(rd, &cfg->scene.mesh[i], i);
    cfg_check_copies(rd, cfg);
    check_target(rd, cfg);
    cfg_check_places(rd, cfg);
    cfg_check_tripods(rd, cfg);
    check_names(rd, cfg);
    check_output(rd, cfg);
    cfg_check_platform(rd, cfg);
    cfg_check_links(rd, cfg);
    cfg_check_link_protocols(rd, cfg);
    check_beam(rd, cfg);
    check_sight(rd, cfg);
    cfg_check_loop(rd, cfg);
    check_time(rd, cfg);
    cfg_check_ntp(rd, cfg);
    cfg_check_signal(rd, cfg);
    cfg_check_waveform(rd, cfg);
    cfg_check_fields(rd, cfg);
    cfg_check_faults(rd, &cfg->faults);
    cfg_check_fault_links(rd, cfg, &cfg->faults);
    cfg_check_fault_beams(rd, cfg, &cfg->faults);
    if (rd->diagnostics->n == 0) cfg_take_scan_settings(cfg); /* last, since it copies values that the checks derive */
}
