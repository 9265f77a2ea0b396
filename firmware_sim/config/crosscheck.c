/* What concerns more than one key, or the world: limits of the profile, order of angles, files, keys of
 * links. */
#include "firmware_sim/config/table.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "drivers/usb/backend.h"
#include "firmware_sim/device/head_clock.h"

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

/* Settings within the profile, by the rows' min_key and max_key. */
static int check_limits(const struct cfg_reader *rd, const struct config *cfg)
{
    for (size_t i = 0; i < rd->table.n; i++) {
        const struct cfg_key *key = &rd->table.keys[i];
        if (key->max_key == NULL) continue;
        int64_t value, high = figure(&cfg->profile, key->max_key);
        int64_t low = key->min_key != NULL ? figure(&cfg->profile, key->min_key) : (int64_t)(key->min * 1e6);
        memcpy(&value, cfg_address(rd, key, 0), sizeof value);
        if (value < low || value > high)
            return cfg_fail_key(rd, key->path, 0, "%.15g is outside of head profile %s; allowed %.15g to %.15g %s",
                                from_micro(value), cfg->profile.name, from_micro(low), from_micro(high), key->unit);
    }
    return SH_OK;
}

static int check_head(const struct cfg_reader *rd, const struct config *cfg)
{
    const struct head_settings *s = &cfg->head.settings;
    if (s->prr_uhz < s->lines_uhz)
        return cfg_fail_key(rd, given_of(rd, "head.prr_hz", "head.lines_hz"), 0,
                            "less than a pulse per line, %.15g pulses/s and %.15g lines/s; allowed prr_hz of at least "
                            "lines_hz",
                            from_micro(s->prr_uhz), from_micro(s->lines_uhz));
    if (s->line_start_udeg >= s->line_stop_udeg)
        return cfg_fail_key(rd, given_of(rd, "head.line_stop_deg", "head.line_start_deg"), 0,
                            "the line goes from %.15g to %.15g deg; allowed line_start_deg below line_stop_deg",
                            from_micro(s->line_start_udeg), from_micro(s->line_stop_udeg));
    int64_t span_udeg = s->pan_stop_udeg - s->pan_start_udeg;
    if (span_udeg < 0 || span_udeg > 360000000)
        return cfg_fail_key(rd, given_of(rd, "head.pan_stop_deg", "head.pan_start_deg"), 0,
                            "the pan goes from %.15g to %.15g deg; allowed pan_start_deg at most pan_stop_deg, 360 deg "
                            "apart at most",
                            from_micro(s->pan_start_udeg), from_micro(s->pan_stop_udeg));
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

static void tidy_choice(enum config_choice *choice)
{
    if (*choice == CHOICE_FALSE) *choice = CHOICE_OFF;
    if (*choice == CHOICE_TRUE) *choice = CHOICE_ON;
}

static int check_output(const struct cfg_reader *rd, struct config *cfg)
{
    cfg->output.layout_given = cfg_is_given(rd, "output.layout", 0);
    if (!cfg_is_given(rd, "output.tolerance_m", 0)) cfg->output.tolerance_m = fmax(1e-7, 1e-3 * cfg->plan.tolerance_m);
    cfg->optics.depth_given = cfg_is_given(rd, "optics.depth", 0);
    tidy_choice(&cfg->scene.order_exactly);
    if (cfg->output.utm_zone != 0 && cfg->output.crs != GEOREF_UTM)
        return cfg_fail_key(rd, "output.utm_zone", 0, "a zone, but output.crs is not utm; allowed only with crs: utm");
    if (cfg->output.heights == HEIGHTS_GEOID && cfg->output.crs != GEOREF_UTM && cfg->output.crs != GEOREF_GEODETIC)
        return cfg_fail_key(rd, "output.heights", 0,
                            "geoid, but output.crs has no heights; allowed only with crs: utm, geodetic");
    if (cfg->output.scale_m == 0.0) return SH_OK;
    if (cfg->output.scale_m < 1e-6)
        return cfg_fail_key(rd, "output.scale_m", 0, "%.10g is out of range; allowed 0 (automatic) or 1e-6 to 1 m",
                            cfg->output.scale_m);
    if (cfg->profile.range_max_m / cfg->output.scale_m >= 0x1p31)
        return cfg_fail_key(
            rd, "output.scale_m", 0,
            "%.10g is too fine: %.10g m of head profile %s do not fit into 31 bits; allowed above %.4g to "
            "1 m",
            cfg->output.scale_m, cfg->profile.range_max_m, cfg->profile.name, cfg->profile.range_max_m / 0x1p31);
    return SH_OK;
}

enum { OF_USBIP = 1u << USB_BACKEND_USBIP, OF_USBREDIR = 1u << USB_BACKEND_USBREDIR };
enum { OF_FUNCTIONFS = 1u << USB_BACKEND_FUNCTIONFS };

static int check_usb_link(const struct cfg_reader *rd, const struct config *cfg, struct link_spec *link, uint32_t i)
{
    static const struct {
        const char *path;
        unsigned backends; /* bit per back end that has the key */
    } keys[] = {
        {"links[].path", OF_USBREDIR},
        {"links[].address", OF_USBIP | OF_USBREDIR},
        {"links[].port", OF_USBIP | OF_USBREDIR},
        {"links[].attach", OF_USBIP | OF_USBREDIR},
        {"links[].udc", OF_FUNCTIONFS},
    };
    const char *name = cfg_find(&rd->table, "links[].backend")->names[link->backend];
    for (size_t k = 0; k < sizeof keys / sizeof keys[0]; k++)
        if (cfg_is_given(rd, keys[k].path, i) && !(keys[k].backends & 1u << link->backend))
            return cfg_fail_key(rd, keys[k].path, i, "the back end %s has no such key; allowed without it", name);
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
    if (link->serial[0] == '\0') snprintf(link->serial, sizeof link->serial, "%s", cfg->head.serial);
    return SH_OK;
}

static int check_link(const struct cfg_reader *rd, struct config *cfg, uint32_t i)
{
    static const struct {
        const char *path;
        unsigned types; /* bit per link type that has the key */
    } keys[] = {
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
    const char *type = cfg_find(&rd->table, "links[].type")->names[link->type];
    for (size_t k = 0; k < sizeof keys / sizeof keys[0]; k++)
        if (cfg_is_given(rd, keys[k].path, i) && !(keys[k].types & 1u << link->type))
            return cfg_fail_key(rd, keys[k].path, i, "a %s link has no such key; allowed %s", type, has[link->type]);
    if (link->type == LINK_FILE && link->path[0] == '\0')
        return cfg_fail_key(rd, "links[].path", i, "missing; required for a file link is the file to write");
    for (uint32_t k = 0; k < i && link->path[0] != '\0'; k++)
        if (strcmp(cfg->link[k].path, link->path) == 0)
            return cfg_fail_key(rd, "links[].path", i, "links[%u] has the same path; allowed a path of its own", k);
    return link->type == LINK_USB ? check_usb_link(rd, cfg, link, i) : SH_OK;
}

/* Which part of the trajectory, and where on it to stop. How long it is, its file says (site_platform.c). */
static int check_part(const struct cfg_reader *rd, struct config *cfg)
{
    struct config_platform *p = &cfg->platform;
    int stops = p->kind == PLATFORM_STOPS;
    p->has_end = cfg_is_given(rd, "platform.end_s", 0);
    if (p->has_end && (stops ? p->end_s < p->start_s : p->end_s <= p->start_s))
        return cfg_fail_key(rd, "platform.end_s", 0, "%.9g s, and platform.start_s is %.9g; allowed %s", p->end_s,
                            p->start_s, stops ? "start_s or more" : "more than start_s");
    if (!stops) return SH_OK;
    if (!(p->step_s > 0.0))
        return cfg_fail_key(rd, cfg_is_given(rd, "platform.step_s", 0) ? "platform.step_s" : "platform.kind", 0,
                            "stops need the time from each to the next, platform.step_s; allowed above 0 to 1e9 s");
    if (cfg->n_stations > 1)
        return cfg_fail_key(rd, "stations", 0,
                            "%u of them, but platform.kind is stops, which are the stations; allowed one, which says "
                            "where on the Earth the scene lies",
                            cfg->n_stations);
    return SH_OK;
}

static int check_platform(const struct cfg_reader *rd, struct config *cfg)
{
    static const struct {
        const char *path;
        unsigned kinds; /* bit per kind of platform that has the key */
    } keys[] = {
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
    const struct config_platform *p = &cfg->platform;
    for (size_t k = 0; k < sizeof keys / sizeof keys[0]; k++)
        if (cfg_is_given(rd, keys[k].path, 0) && !(keys[k].kinds & 1u << p->kind))
            return cfg_fail_key(rd, keys[k].path, 0, "a %s platform has no such key; allowed %s",
                                cfg_find(&rd->table, "platform.kind")->names[p->kind], has[p->kind]);
    if (p->kind == PLATFORM_LIVE && cfg->loop.pace == PACE_FAST)
        return cfg_fail_key(rd, "loop.pace", 0,
                            "nobody can say in time where a live platform is; allowed realtime, step");
    if (p->kind != PLATFORM_TRAJECTORY && p->kind != PLATFORM_STOPS) return SH_OK;
    if ((p->file[0] != '\0') == (p->waypoints[0] != '\0'))
        return cfg_fail_key(rd, p->file[0] != '\0' ? "platform.waypoints" : "platform.kind", 0,
                            "a trajectory comes from one file; allowed either platform.file or platform.waypoints");
    return check_part(rd, cfg);
}

int config_moves(const struct config *cfg)
{
    int moves = cfg->platform.kind != PLATFORM_STATIC;
    for (uint32_t i = 0; i < cfg->scene.n_meshes; i++) {
        const struct config_mesh *m = &cfg->scene.mesh[i];
        moves |= m->turn_deg_s != 0.0 || m->move_m_s[0] != 0.0 || m->move_m_s[1] != 0.0 || m->move_m_s[2] != 0.0;
    }
    return moves;
}

int config_beam_fixed(const struct config *cfg)
{
    return !config_moves(cfg) && cfg->instrument.transit_offset_m == 0.0 && cfg->instrument.mirror_offset_m == 0.0;
}

static const double LEAST_PULSE_NS = 0.1; /* 15 mm of range */

/* Sub-rays that meet one oblique surface have ranges apart: with hardly a range resolution each would be an echo, or,
 * too weak for one, lost. */
static int check_pulse_width(const struct cfg_reader *rd, const struct config *cfg)
{
    const struct config_profile *p = &cfg->profile;
    const int footprint = p->beam_exit_m != 0.0 || p->beam_divergence_rad != 0.0;
    if (cfg->beam.mode == BEAM_SINGLE || !footprint || p->pulse_width_ns >= LEAST_PULSE_NS) return SH_OK;
    return cfg_fail_key(rd, "beam.mode", 0,
                        "pulse_width_ns of head profile %s is %.10g: too short to tell the echoes of a footprint; "
                        "allowed single, or a pulse_width_ns of at least %.10g",
                        p->name, p->pulse_width_ns, LEAST_PULSE_NS);
}

/* Outlines are those that are seen from one place. */
static int check_beam(const struct cfg_reader *rd, const struct config *cfg)
{
    if (cfg->beam.mode == BEAM_SINGLE || cfg->beam.mode == BEAM_AUTO) return SH_OK;
    if (cfg->profile.beam_exit_m == 0.0 && cfg->profile.beam_divergence_rad == 0.0)
        return cfg_fail_key(rd, "beam.mode", 0, "head profile %s has no footprint; allowed single", cfg->profile.name);
    if (cfg->beam.mode == BEAM_ADAPTIVE && !config_beam_fixed(cfg))
        return cfg_fail_key(rd, "beam.mode", 0, "adaptive, but %s; allowed single, rings, auto",
                            config_moves(cfg) ? "the head or a mesh moves"
                                              : "instrument.transit_offset_m or mirror_offset_m moves the beam");
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
    enum head_clock_source source;
    struct sh_err why;
    char shown[CFG_SHOW_MAX];
    if (head_clock_parse(cfg->time.epoch, utc_table_builtin(), &source, NULL, &why) != SH_OK)
        return cfg_fail_key(
            rd, "time.epoch", 0,
            "\"%s\": %.80s; allowed none, utc, tai, or a time after 1980-01-06 such as 2026-01-01T00:00:00Z",
            cfg_show(cfg->time.epoch, shown), why.text);
    int link = cfg_nmea_link(cfg);
    if (source == HEAD_CLOCK_NONE && link >= 0)
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
