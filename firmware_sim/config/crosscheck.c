/* What concerns more than one key, or the world: limits of the head profile, order of angles, files, keys of
 * links and platforms. Places on the Earth: places.c; noise, signal, surfaces: measurement.c. */
#include "firmware_sim/config/table.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "drivers/usb/backend.h"
#include "firmware_sim/config/epoch.h"

/* Of two keys that contradict, the one to name: the first unless only the second was given. */
static const char *given_of(const struct cfg_reader *rd, const char *first, const char *second)
{
    return !cfg_is_given(rd, first, 0) && cfg_is_given(rd, second, 0) ? second : first;
}

static double from_micro(int64_t micro)
{
    return (double)micro / 1e6;
}

static int64_t figure(const struct config_profile *profile, const char *path)
{
    int64_t value;
    memcpy(&value, (const char *)profile + cfg_find(&cfg_profile_table, path)->offset, sizeof value);
    return value;
}

/* Settings within the head profile: limits that a row of keys.c names by min_key and max_key. */
static int check_limits(const struct cfg_reader *rd, const struct config *cfg)
{
    for (size_t i = 0; i < rd->table.n; i++) {
        const struct cfg_key *key = &rd->table.keys[i];
        if (key->max_key == NULL) continue;
        int64_t value, high = figure(&cfg->profile, key->max_key);
        int64_t low = key->min_key != NULL ? figure(&cfg->profile, key->min_key) : (int64_t)(key->min * 1e6);
        memcpy(&value, cfg_address(rd, key, 0), sizeof value);
        if (value < low || value > high)
            return cfg_fail_key(rd, key->path, 0,
                                "%.15g is outside the limits of head profile %s; allowed %.15g to %.15g %s",
                                from_micro(value), cfg->profile.name, from_micro(low), from_micro(high), key->unit);
    }
    return SH_OK;
}

static int check_head(const struct cfg_reader *rd, const struct config *cfg)
{
    const struct head_settings *s = &cfg->head.settings;
    if (s->prr_uhz < s->lines_uhz)
        return cfg_fail_key(
            rd, given_of(rd, "head.prr_hz", "head.lines_hz"), 0,
            "less than a pulse per line, %.15g pulses/s and %.15g lines/s; allowed a prr_hz of at least "
            "%.15g, or a lines_hz of at most %.15g",
            from_micro(s->prr_uhz), from_micro(s->lines_uhz), from_micro(s->lines_uhz), from_micro(s->prr_uhz));
    if (s->line_start_udeg >= s->line_stop_udeg)
        return cfg_fail_key(rd, given_of(rd, "head.line_stop_deg", "head.line_start_deg"), 0,
                            "the line goes from %.15g to %.15g deg; allowed a line_start_deg below %.15g, or a "
                            "line_stop_deg above %.15g",
                            from_micro(s->line_start_udeg), from_micro(s->line_stop_udeg),
                            from_micro(s->line_stop_udeg), from_micro(s->line_start_udeg));
    int64_t span_udeg = s->pan_stop_udeg - s->pan_start_udeg;
    if (span_udeg < 0 || span_udeg > 360000000)
        return cfg_fail_key(rd, given_of(rd, "head.pan_stop_deg", "head.pan_start_deg"), 0,
                            "the pan goes from %.15g to %.15g deg; allowed a pan_stop_deg of %.15g to %.15g",
                            from_micro(s->pan_start_udeg), from_micro(s->pan_stop_udeg), from_micro(s->pan_start_udeg),
                            from_micro(s->pan_start_udeg) + 360.0);
    if (s->station > cfg->n_stations && cfg->platform.kind != PLATFORM_STOPS)
        return cfg_fail_key(rd, "head.station", 0, "there is no station %u; allowed 1 to %u", s->station,
                            cfg->n_stations);
    return SH_OK;
}

static int check_mesh(const struct cfg_reader *rd, const struct config_mesh *mesh, uint32_t i)
{
    static const char *const endings[] = {".obj", ".ply", ".stl", ".gltf", ".glb", ".fbx", ".dae", ".ifc"};
    static const char path[] = "scene.meshes[].file";
    char shown[CFG_SHOW_MAX];
    struct stat st;
    const char *slash = strrchr(mesh->file, '/'), *dot = strrchr(mesh->file, '.');
    size_t known = 0;
    while (known < 8 && (dot == NULL || (slash != NULL && dot < slash) || strcasecmp(dot, endings[known]) != 0))
        known++;
    if (known == 8)
        return cfg_fail_key(rd, path, i, "\"%s\" has no known ending; allowed .obj .ply .stl .gltf .glb .fbx .dae .ifc",
                            cfg_show(mesh->file, shown));
    if (stat(mesh->file, &st) != 0 || (S_ISREG(st.st_mode) && access(mesh->file, R_OK) != 0))
        return cfg_fail_key(rd, path, i, "%.200s: %s; allowed a mesh file that can be read", mesh->file,
                            strerror(errno));
    if (!S_ISREG(st.st_mode))
        return cfg_fail_key(rd, path, i, "%.200s is not a file; allowed a mesh file that can be read", mesh->file);
    return SH_OK;
}

int cfg_nmea_link(const struct config *cfg)
{
    for (uint32_t i = 0; i < cfg->n_links; i++)
        if (cfg->link[i].protocol == PROTOCOL_NMEA && cfg->link[i].type != LINK_USB) return (int)i; /* check_link */
    return -1;
}

static int check_names(const struct cfg_reader *rd, struct config *cfg)
{
    for (uint32_t i = 0; i < cfg->n_stations; i++) {
        struct config_station *station = &cfg->station[i];
        if (station->name[0] == '\0') snprintf(station->name, sizeof station->name, "station-%u", i + 1);
        for (uint32_t k = 0; k < i; k++)
            if (strcmp(cfg->station[k].name, station->name) == 0)
                return cfg_fail_key(rd, "stations[].name", i, "stations[%u] has the same name; allowed different names",
                                    k);
    }
    return SH_OK;
}

static int check_output(const struct cfg_reader *rd, struct config *cfg)
{
    cfg->output.layout_given = cfg_is_given(rd, "output.layout", 0);
    if (!cfg_is_given(rd, "output.tolerance_m", 0)) cfg->output.tolerance_m = fmax(1e-7, 1e-3 * cfg->plan.range_m);
    if (!cfg_is_given(rd, "scene.tolerance_m", 0))
        cfg->scene.tolerance_m = cfg_is_given(rd, "plan.tolerance_m", 0) ? 0.1 * cfg->plan.range_m : 1.0;
    cfg->optics.depth_given = cfg_is_given(rd, "optics.depth", 0);
    if (cfg->output.utm_zone != 0 && cfg->output.crs != GEOREF_UTM)
        return cfg_fail_key(rd, "output.utm_zone", 0, "a zone, but output.crs is not utm; allowed only with crs: utm");
    if (cfg->output.heights == HEIGHTS_GEOID && cfg->output.crs != GEOREF_UTM && cfg->output.crs != GEOREF_GEODETIC)
        return cfg_fail_key(rd, "output.heights", 0,
                            "geoid, but output.crs has no heights; allowed only with crs: utm, geodetic");
    if (cfg->output.scale_m == 0.0) return SH_OK;
    if (cfg->output.scale_m < 1e-6)
        return cfg_fail_key(rd, "output.scale_m", 0, "%.10g is out of range; allowed 0 (automatic) or 1e-6 to 1 m",
                            cfg->output.scale_m);
    const int bits = cfg->output.layout == LINE_POLAR ? 32 : 31; /* a range has no sign */
    const double counts = ldexp(1.0, bits);
    if (cfg->profile.range_max_m / cfg->output.scale_m >= counts)
        return cfg_fail_key(
            rd, "output.scale_m", 0,
            "%.10g is too fine: %.10g m of head profile %s do not fit into %d bits; allowed above %.4g to "
            "1 m, or 0 (automatic)",
            cfg->output.scale_m, cfg->profile.range_max_m, cfg->profile.name, bits, cfg->profile.range_max_m / counts);
    return SH_OK;
}

/* A key that only some kinds (of link, back end, platform) have. */
struct owned_key {
    const char *path;
    unsigned kinds; /* bit per kind that has it */
};

/* The first of these keys that is given though the kind does not have it; NULL: none. */
static const char *find_stray(const struct cfg_reader *rd, const struct owned_key *key, size_t n, int kind,
                              uint32_t item)
{
    for (size_t i = 0; i < n; i++)
        if (cfg_is_given(rd, key[i].path, item) && !(key[i].kinds & 1u << kind)) return key[i].path;
    return NULL;
}

enum { OF_USBIP = 1u << USB_BACKEND_USBIP, OF_USBREDIR = 1u << USB_BACKEND_USBREDIR };
enum { OF_FUNCTIONFS = 1u << USB_BACKEND_FUNCTIONFS };

static int check_usb_link(const struct cfg_reader *rd, const struct config *cfg, struct link_spec *link, uint32_t i)
{
    static const struct owned_key keys[] = {
        {"links[].path", OF_USBREDIR},
        {"links[].address", OF_USBIP | OF_USBREDIR},
        {"links[].port", OF_USBIP | OF_USBREDIR},
        {"links[].attach", OF_USBIP | OF_USBREDIR},
        {"links[].udc", OF_FUNCTIONFS},
    };
    const char *name = cfg_word(rd, "links[].backend", link->backend);
    const char *stray = find_stray(rd, keys, CFG_LEN(keys), link->backend, i);
    if (stray != NULL) return cfg_fail_key(rd, stray, i, "the back end %s has no such key; allowed without it", name);
    const int has_port = cfg_is_given(rd, "links[].port", i), has_address = cfg_is_given(rd, "links[].address", i);
    if (link->path[0] != '\0' && (has_port || has_address))
        return cfg_fail_key(rd, "links[].path", i, "both a path and a port or address; allowed one of them");
    if (link->backend == USB_BACKEND_USBIP && link->attach && (has_port || has_address))
        return cfg_fail_key(rd, "links[].attach", i,
                            "a device that is attached here listens nowhere; allowed without port and address");
    if (link->backend == USB_BACKEND_USBREDIR && link->path[0] == '\0' && !has_port)
        return cfg_fail_key(rd, "links[].backend", i, "usbredir needs a path or a port; allowed with one of them");
    if (link->backend == USB_BACKEND_USBREDIR && link->attach && link->path[0] == '\0' && link->port == 0)
        return cfg_fail_key(rd, "links[].port", i, "0, and the head is to connect to it; allowed 1 to 65535");
    if (link->backend == USB_BACKEND_USBIP && !has_port) link->port = USB_BACKEND_USBIP_PORT;
    if (link->serial[0] == '\0') {
        snprintf(link->serial, sizeof link->serial, "%s", cfg->head.serial);
        link->own_serial = !cfg_is_given(rd, "head.serial", 0);
    }
    return SH_OK;
}

static int check_link(const struct cfg_reader *rd, struct config *cfg, uint32_t i)
{
    static const struct owned_key keys[] = {
        {"links[].path", 1u << LINK_FILE | 1u << LINK_PTY | 1u << LINK_USB},
        {"links[].address", 1u << LINK_TCP | 1u << LINK_USB},
        {"links[].port", 1u << LINK_TCP | 1u << LINK_USB},
        {"links[].max_sessions", 1u << LINK_TCP},
        {"links[].protocol", 1u << LINK_NULL | 1u << LINK_FILE | 1u << LINK_PTY | 1u << LINK_TCP},
        {"links[].backend", 1u << LINK_USB},
        {"links[].attach", 1u << LINK_USB},
        {"links[].udc", 1u << LINK_USB},
        {"links[].speed", 1u << LINK_USB},
        {"links[].vid", 1u << LINK_USB},
        {"links[].pid", 1u << LINK_USB},
        {"links[].serial", 1u << LINK_USB},
    };
    static const char *const has[] = {[LINK_NULL] = "type, protocol",
                                      [LINK_FILE] = "type, path, protocol",
                                      [LINK_PTY] = "type, path, protocol",
                                      [LINK_TCP] = "type, address, port, max_sessions, protocol",
                                      [LINK_USB] =
                                          "type, backend, address, port, path, attach, udc, speed, vid, pid, serial"};
    struct link_spec *link = &cfg->link[i];
    const char *type = cfg_word(rd, "links[].type", (int)link->type);
    const char *stray = find_stray(rd, keys, CFG_LEN(keys), (int)link->type, i);
    if (stray != NULL)
        return cfg_fail_key(rd, stray, i, "a %s link has no such key; allowed %s", type, has[link->type]);
    if (link->type == LINK_FILE && link->path[0] == '\0')
        return cfg_fail_key(rd, "links[].path", i, "missing; required for a file link is the file to write");
    for (uint32_t k = 0; k < i && link->path[0] != '\0'; k++)
        if (strcmp(cfg->link[k].path, link->path) == 0)
            return cfg_fail_key(rd, "links[].path", i, "links[%u] has the same path; allowed a path of its own", k);
    return link->type == LINK_USB ? check_usb_link(rd, cfg, link, i) : SH_OK;
}

/* Which part of the trajectory, and where on it to stop. How long it is, its file says
 * (firmware_sim/site/platform.c). */
static int check_part(const struct cfg_reader *rd, struct config *cfg)
{
    struct config_platform *p = &cfg->platform;
    int stops = p->kind == PLATFORM_STOPS;
    p->has_end = cfg_is_given(rd, "platform.end_s", 0);
    if (p->has_end && (stops ? p->end_s < p->start_s : p->end_s <= p->start_s))
        return cfg_fail_key(rd, "platform.end_s", 0, "%.9g s, and platform.start_s is %.9g; allowed %s %.9g s",
                            p->end_s, p->start_s, stops ? "at least" : "more than", p->start_s);
    if (!stops) return SH_OK;
    if (!(p->step_s > 0.0))
        return cfg_fail_key(rd, cfg_is_given(rd, "platform.step_s", 0) ? "platform.step_s" : "platform.kind", 0,
                            "stops need the time from each to the next, platform.step_s; allowed above 0, up to 1e9 s");
    if (cfg->n_stations > 1)
        return cfg_fail_key(rd, "stations", 0,
                            "%u of them, but platform.kind is stops, which are the stations; allowed one, which says "
                            "where on the Earth the scene lies",
                            cfg->n_stations);
    return SH_OK;
}

/* Keys that this kind of platform does not have. */
static int check_platform_keys(const struct cfg_reader *rd, const struct config_platform *p)
{
    static const struct owned_key keys[] = {
        {"platform.file", 1u << PLATFORM_TRAJECTORY | 1u << PLATFORM_STOPS},
        {"platform.waypoints", 1u << PLATFORM_TRAJECTORY | 1u << PLATFORM_STOPS},
        {"platform.start_s", 1u << PLATFORM_TRAJECTORY | 1u << PLATFORM_STOPS},
        {"platform.end_s", 1u << PLATFORM_TRAJECTORY | 1u << PLATFORM_STOPS},
        {"platform.step_s", 1u << PLATFORM_STOPS},
        {"platform.at_end", 1u << PLATFORM_TRAJECTORY},
        {"platform.reach_m", 1u << PLATFORM_LIVE},
        {"platform.extrapolate_ms", 1u << PLATFORM_LIVE},
        {"platform.address", 1u << PLATFORM_LIVE},
        {"platform.port", 1u << PLATFORM_LIVE},
        {"platform.mount_m", ~1u},
        {"platform.mount_heading_deg", ~1u},
        {"platform.mount_pitch_deg", ~1u},
        {"platform.mount_roll_deg", ~1u},
    };
    static const char *const has[] = {
        [PLATFORM_STATIC] = "kind alone; the station says where the head stands",
        [PLATFORM_TRAJECTORY] = "file or waypoints, start_s, end_s, at_end, mount_...",
        [PLATFORM_LIVE] = "reach_m, extrapolate_ms, address, port, mount_...",
        [PLATFORM_STOPS] = "file or waypoints, start_s, end_s, step_s, mount_...",
    };
    const char *stray = find_stray(rd, keys, CFG_LEN(keys), (int)p->kind, 0);
    if (stray == NULL) return SH_OK;
    return cfg_fail_key(rd, stray, 0, "a %s platform has no such key; allowed %s",
                        cfg_word(rd, "platform.kind", (int)p->kind), has[p->kind]);
}

static int check_platform(const struct cfg_reader *rd, struct config *cfg)
{
    const struct config_platform *p = &cfg->platform;
    int code = check_platform_keys(rd, p);
    if (code != SH_OK) return code;
    if (p->kind == PLATFORM_LIVE && cfg->loop.pace == PACE_FAST)
        return cfg_fail_key(rd, "loop.pace", 0,
                            "the poses of a live platform come in real time; allowed realtime, step");
    if (p->kind != PLATFORM_TRAJECTORY && p->kind != PLATFORM_STOPS) return SH_OK;
    if ((p->file[0] != '\0') == (p->waypoints[0] != '\0'))
        return cfg_fail_key(rd, p->file[0] != '\0' ? "platform.waypoints" : "platform.kind", 0,
                            "a trajectory comes from one file; allowed either platform.file or platform.waypoints");
    return check_part(rd, cfg);
}

const char *config_beam_moves(const struct config *cfg)
{
    int moves = cfg->platform.kind != PLATFORM_STATIC;
    for (uint32_t i = 0; i < cfg->scene.n_meshes; i++)
        moves |= config_mesh_moves(&cfg->scene.mesh[i]);
    if (moves) return "the head or a mesh moves";
    if (cfg->instrument.transit_offset_m == 0.0 && cfg->instrument.mirror_offset_m == 0.0) return NULL;
    return "instrument.transit_offset_m or mirror_offset_m moves the beam";
}

static const double LEAST_PULSE_NS = 0.1; /* 15 mm of range */

/* Sub-rays that meet one oblique surface have different ranges. Where the pulse is too short to join them,
 * each would be an echo of its own, or be lost because it is too weak. */
static int check_pulse_width(const struct cfg_reader *rd, const struct config *cfg)
{
    const struct config_profile *p = &cfg->profile;
    if (cfg->beam.mode == BEAM_SINGLE || !config_has_footprint(cfg) || p->pulse_width_ns >= LEAST_PULSE_NS)
        return SH_OK;
    return cfg_fail_key(rd, "beam.mode", 0,
                        "pulse_width_ns of head profile %s is %.10g: too short to tell echoes of a footprint apart; "
                        "allowed single, or a pulse_width_ns of at least %.10g",
                        p->name, p->pulse_width_ns, LEAST_PULSE_NS);
}

/* An adaptive beam needs outlines, which are those seen from one place. */
static int check_beam(const struct cfg_reader *rd, const struct config *cfg)
{
    if (cfg->beam.mode == BEAM_SINGLE || cfg->beam.mode == BEAM_AUTO) return SH_OK;
    if (!config_has_footprint(cfg))
        return cfg_fail_key(rd, "beam.mode", 0, "head profile %s has no footprint; allowed single", cfg->profile.name);
    const char *why = config_beam_moves(cfg);
    if (cfg->beam.mode == BEAM_ADAPTIVE && why != NULL)
        return cfg_fail_key(rd, "beam.mode", 0, "adaptive, but %s; allowed single, rings, auto", why);
    return SH_OK;
}

static int check_loop(const struct cfg_reader *rd, const struct config *cfg)
{
    if (fmod(1e9, cfg->loop.tick_hz) == 0.0 && floor(cfg->loop.tick_hz) == cfg->loop.tick_hz) return SH_OK;
    return cfg_fail_key(
        rd, "loop.tick_hz", 0,
        "%.15g does not divide 1e9; allowed a divisor of 1e9 from 100 to 10000 Hz, such as 500, 1000, 2000",
        cfg->loop.tick_hz);
}

static int check_time(const struct cfg_reader *rd, const struct config *cfg)
{
    enum epoch_source source;
    struct sh_err why;
    char shown[CFG_SHOW_MAX];
    if (epoch_parse(cfg->time.epoch, utc_table_builtin(), &source, NULL, &why) != SH_OK)
        return cfg_fail_key(
            rd, "time.epoch", 0,
            "\"%s\": %.80s; allowed none, utc, tai, or a time after 1980-01-06 such as 2026-01-01T00:00:00Z",
            cfg_show(cfg->time.epoch, shown), why.text);
    int link = cfg_nmea_link(cfg);
    if (source == EPOCH_NONE && link >= 0)
        return cfg_fail_key(rd, "links[].protocol", (uint32_t)link,
                            "nmea, but the time is not known; required is time.epoch: utc, tai, or a time such as "
                            "2026-01-01T00:00:00Z");
    if (1000 % cfg->gnss.rate_hz != 0 || cfg->gnss.rate_hz == 8)
        return cfg_fail_key(rd, "gnss.rate_hz", 0, "%u is not a rate it has; allowed 1, 2, 4, 5, 10 or 20 Hz",
                            cfg->gnss.rate_hz);
    if (cfg->gnss.quality == 3)
        return cfg_fail_key(rd, "gnss.quality", 0,
                            "3 is no fix of position; allowed 0 none, 1 autonomous, 2 differential, 4 RTK fixed, 5 RTK "
                            "float");
    return SH_OK;
}

int cfg_check(const struct cfg_reader *rd, struct config *cfg)
{
    int code = check_limits(rd, cfg);
    if (code == SH_OK) code = check_head(rd, cfg);
    for (uint32_t i = 0; i < cfg->scene.n_meshes && code == SH_OK; i++)
        code = check_mesh(rd, &cfg->scene.mesh[i], i);
    if (code == SH_OK) code = cfg_check_places(rd, cfg);
    if (code == SH_OK) code = check_names(rd, cfg);
    if (code == SH_OK) code = check_output(rd, cfg);
    if (code == SH_OK) code = check_platform(rd, cfg);
    for (uint32_t i = 0; i < cfg->n_links && code == SH_OK; i++)
        code = check_link(rd, cfg, i);
    if (code == SH_OK) code = check_beam(rd, cfg);
    if (code == SH_OK) code = check_pulse_width(rd, cfg);
    if (code == SH_OK) code = check_loop(rd, cfg);
    if (code == SH_OK) code = check_time(rd, cfg);
    if (code == SH_OK) code = cfg_check_signal(rd, cfg);
    return code;
}
