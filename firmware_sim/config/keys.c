/* The table of keys, config_table_profile.c the one of profiles. Parsing, defaults, errors, --set and the reference
 * come from these alone. */
#include "drivers/usb/backend.h"
#include "firmware_sim/config/table.h"

#include "core/cast.h"

#define IN_CONFIG(member)  CFG_MEMBER(struct config, member)
#define IN_MESH(member)    CFG_MEMBER(struct config_mesh, member)
#define IN_STATION(member) CFG_MEMBER(struct config_station, member)
#define IN_LINK(member)    CFG_MEMBER(struct link_spec, member)
#define IN_SURFACE(member) CFG_MEMBER(struct surface_rule, member)
#define LIST_OF(array, count)                                                                 \
    .offset = offsetof(struct config, array), .size = sizeof(((struct config *)0)->array[0]), \
    .count_offset = offsetof(struct config, count)
/* Limits of a setting: two figures of the profile. */
#define WITHIN(low, high) .min = -9e12, .max = 9e12, .min_key = low, .max_key = high

static const char *const up_names[] = {[SCENE_UP_Z] = "z", [SCENE_UP_Y] = "y", NULL};
static const char *const crs_names[] = {
    [GEOREF_LOCAL] = "local", [GEOREF_ECEF] = "ecef", [GEOREF_UTM] = "utm", [GEOREF_GEODETIC] = "geodetic", NULL};
static const char *const georef_names[] = {[GEOREF_AUTO] = "auto",
                                           [GEOREF_EXACT] = "exact",
                                           [GEOREF_ORDER1] = "order1",
                                           [GEOREF_ORDER2] = "order2",
                                           [GEOREF_ORDER3] = "order3",
                                           [GEOREF_ORDER5] = "order5",
                                           NULL};
static const char *const heights_names[] = {
    [HEIGHTS_ELLIPSOID] = "ellipsoid", [HEIGHTS_GEOID] = "geoid", [HEIGHTS_AUTO] = "auto", NULL};
static const char *const anchor_names[] = {[ANCHOR_NONE] = "none", [ANCHOR_EXPLICIT] = "explicit", [ANCHOR_IFC] = "ifc",
                                           [ANCHOR_UTM] = "utm",   [ANCHOR_ECEF] = "ecef",         NULL};
static const char *const hemisphere_names[] = {"south", "north", NULL};
static const char *const layout_names[] = {[LINE_POLAR] = "polar", [LINE_GEO] = "geo", NULL};
static const char *const link_names[] = {
    [LINK_NULL] = "null", [LINK_FILE] = "file", [LINK_PTY] = "pty", [LINK_TCP] = "tcp", [LINK_USB] = "usb", NULL};
static const char *const protocol_names[] = {[PROTOCOL_NATIVE] = "native", [PROTOCOL_NMEA] = "nmea", NULL};
static const char *const talker_names[] = {[TALKER_GN] = "GN", [TALKER_GP] = "GP", NULL};
static const char *const backend_names[] = {
    [USB_BACKEND_USBIP] = "usbip", [USB_BACKEND_USBREDIR] = "usbredir", [USB_BACKEND_FUNCTIONFS] = "functionfs", NULL};
static const char *const speed_names[] = {
    [USB_RATE_FULL] = "full", [USB_RATE_HIGH] = "high", [USB_RATE_SUPER] = "super", NULL};
static const char *const pace_names[] = {
    [PACE_REALTIME] = "realtime", [PACE_FAST] = "fast", [PACE_STEP] = "step", NULL};

static const char *const platform_names[] = {[PLATFORM_STATIC] = "static",
                                             [PLATFORM_TRAJECTORY] = "trajectory",
                                             [PLATFORM_LIVE] = "live",
                                             [PLATFORM_STOPS] = "stops",
                                             NULL};
/* A switch that has got a third way; config_signal.c makes false and true off and on. */
static const char *const range_noise_names[] = {
    [RANGE_NOISE_OFF] = "off",     [RANGE_NOISE_ON] = "on",     [RANGE_NOISE_SIGNAL] = "signal",
    [RANGE_NOISE_FALSE] = "false", [RANGE_NOISE_TRUE] = "true", NULL};
static const char *const choice_names[] = {[CHOICE_AUTO] = "auto",   [CHOICE_OFF] = "off",   [CHOICE_ON] = "on",
                                           [CHOICE_FALSE] = "false", [CHOICE_TRUE] = "true", NULL};
static const char *const axes_names[] = {"scene", "beam", NULL};
static const char *const detection_names[] = {"noisy", "sharp", NULL};
static const char *const ambiguity_names[] = {
    [DETECT_AMBIGUITY_NONE] = "none", [DETECT_FOLDED] = "folded", [DETECT_RESOLVED] = "resolved", NULL};
static const char *const beam_names[] = {
    [BEAM_SINGLE] = "single", [BEAM_RINGS] = "rings", [BEAM_ADAPTIVE] = "adaptive", [BEAM_AUTO] = "auto", NULL};
static const char *const echoes_names[] = {
    [BEAM_ALL] = "all", [BEAM_FIRST] = "first", [BEAM_LAST] = "last", [BEAM_STRONGEST] = "strongest", NULL};
static const char *const at_end_names[] = {[PLATFORM_STOP] = "stop", [PLATFORM_HOLD] = "hold", NULL};

/* clang-format off */
static const struct cfg_key config_keys[] = {
    {"head", CFG_MAP, .help = "The head and its settings at power-up."},
    {"head.profile", CFG_TEXT, IN_CONFIG(profile_file), .allowed = "the name of a profile, or a path that ends in .yaml",
     .help = "Head profile, looked up in $SCANHEAD_HEADS, heads/ beside this file, the installed and the source directory."},
    {"head.serial", CFG_TEXT, .def = "SIM-0001", IN_CONFIG(head.serial), .flags = CFG_ASCII,
     .help = "Serial number, as in *IDN?."},
    {"head.prr_hz", CFG_MICRO, "Hz", "@prr_max_hz", WITHIN("prr_min_hz", "prr_max_hz"), IN_CONFIG(head.settings.prr_uhz),
     .help = "Pulse repetition rate; counts every firing, also in the blind part of a sweep."},
    {"head.lines_hz", CFG_MICRO, "Hz", "@lines_max_hz", WITHIN("lines_min_hz", "lines_max_hz"),
     IN_CONFIG(head.settings.lines_uhz), .help = "Lines per second; at most prr_hz."},
    {"head.pan_deg_s", CFG_MICRO, "deg/s", "@pan_max_deg_s", 0, 9e12, NULL, "pan_max_deg_s",
     IN_CONFIG(head.settings.pan_udeg_s), .help = "Pan speed. 0: the pan stands still, each line is a frame."},
    {"head.line_start_deg", CFG_MICRO, "deg", "@fov_min_deg", WITHIN("fov_min_deg", "fov_max_deg"),
     IN_CONFIG(head.settings.line_start_udeg), .help = "First line angle cast: 0 forward, 90 up, above 90 backward."},
    {"head.line_stop_deg", CFG_MICRO, "deg", "@fov_max_deg", WITHIN("fov_min_deg", "fov_max_deg"),
     IN_CONFIG(head.settings.line_stop_udeg), .help = "Last line angle cast; above line_start_deg."},
    {"head.pan_start_deg", CFG_MICRO, "deg", "@pan_min_deg", WITHIN("pan_min_deg", "pan_max_deg"),
     IN_CONFIG(head.settings.pan_start_udeg), .help = "Pan angle where a frame starts."},
    {"head.pan_stop_deg", CFG_MICRO, "deg", "@pan_max_deg", WITHIN("pan_min_deg", "pan_max_deg"),
     IN_CONFIG(head.settings.pan_stop_udeg), .help = "Pan angle where a frame ends; at most a turn after pan_start_deg."},
    {"head.frames", CFG_COUNT, NULL, "1", 0, 1000000, IN_CONFIG(head.settings.frames),
     .help = "Frames (pan sweeps) per scan; 0: until stopped."},
    {"head.station", CFG_COUNT, NULL, "1", 1, CONFIG_MAX_STOPS, IN_CONFIG(head.settings.station),
     .help = "Station where the head stands, counted from 1."},

    {"head.ambiguity", CFG_ENUM, .def = "none", .names = ambiguity_names, IN_CONFIG(head.ambiguity),
     .help = "Echoes from beyond c / (2 prr_hz), behind the next pulse. none: told where they are; folded: less whole zones; "
             "resolved: where they are, within mta_zones. Echoes in the blind range_min_m after a pulse are lost in the latter two."},
    {"head.mta_zones", CFG_COUNT, NULL, "8", 1, 1000, IN_CONFIG(head.mta_zones),
     .help = "Zones of c / (2 prr_hz) that ambiguity: resolved can tell apart; beyond, nothing is seen."},

    {"scene", CFG_MAP, .help = "What is scanned."},
    {"scene.tolerance_m", CFG_REAL, "m", "1e-6", 1e-9, 1, IN_CONFIG(scene.tolerance_m),
     .help = "What a vertex may be off: a mesh format of single precision with larger coordinates is refused."},
    {"scene.order_exactly", CFG_ENUM, .def = "auto", .names = choice_names, IN_CONFIG(scene.order_exactly),
     .allowed = "auto, on or off",
     .help = "Order surfaces that overlap or cross in double; costs loading time, and speed where they do. auto: where "
             "float's resolution in the scene is coarser than plan.tolerance_m."},
    {"scene.meshes", CFG_LIST, .min = 1, .max = CONFIG_MAX_MESHES, LIST_OF(scene.mesh, scene.n_meshes),
     .help = "Mesh files; together they are the scene."},
    {"scene.meshes[]", CFG_MAP, .help = "A mesh file."},
    {"scene.meshes[].file", CFG_PATH, IN_MESH(file), .help = "Path: .obj .ply .stl .gltf .glb .fbx .dae .ifc"},
    {"scene.meshes[].up", CFG_ENUM, .names = up_names, IN_MESH(up),
     .help = "Axis that points up in the file; y turns (x, y, z) to (x, -z, y)."},
    {"scene.meshes[].scale", CFG_REAL, "m/unit", NULL, 1e-9, 1e9, IN_MESH(scale), .help = "Metres per unit of the file."},
    {"scene.meshes[].offset_m", CFG_VEC3, "m", "[0, 0, 0]", -1e9, 1e9, IN_MESH(offset_m),
     .help = "Added after axes and scale."},
    {"scene.meshes[].move_m_s", CFG_VEC3, "m/s", "[0, 0, 0]", -1000, 1000, IN_MESH(move_m_s),
     .help = "The mesh moves: velocity, from the scan's start. At a stop (platform.kind) it stands as at the stop's time."},
    {"scene.meshes[].turn_deg_s", CFG_REAL, "deg/s", "0", -36000, 36000, IN_MESH(turn_deg_s),
     .help = "The mesh turns about the vertical through pivot_m, clockwise seen from above."},
    {"scene.meshes[].pivot_m", CFG_VEC3, "m", "[0, 0, 0]", -1e9, 1e9, IN_MESH(pivot_m), .help = "Where it turns."},
    {"scene.meshes[].cycle_s", CFG_REAL, "s", "0", 0, 86400, IN_MESH(cycle_s),
     .help = "Motion goes forth and back within this time; 0: on and on."},

    {"scene.anchor", CFG_MAP, .help = "How the scene lies on the Earth; all stations follow from it."},
    {"scene.anchor.source", CFG_ENUM, .def = "none", .names = anchor_names, IN_CONFIG(scene.anchor.source),
     .help = "none: each station stands for itself; explicit: origin_m is at lat_deg, lon_deg, height_m; ifc: as the IFC "
             "mesh's IFCSITE says; utm, ecef: the meshes' own coordinates are UTM (or UPS), ECEF."},
    {"scene.anchor.origin_m", CFG_VEC3, "m", "[0, 0, 0]", -1e9, 1e9, IN_CONFIG(scene.anchor.origin_m),
     .help = "explicit: the scene's point that lies at lat_deg, lon_deg, height_m."},
    {"scene.anchor.lat_deg", CFG_REAL, "deg", "", -90, 90, IN_CONFIG(scene.anchor.lat_deg), .help = "explicit: its latitude, WGS 84."},
    {"scene.anchor.lon_deg", CFG_REAL, "deg", "", -180, 180, IN_CONFIG(scene.anchor.lon_deg), .help = "explicit: its longitude."},
    {"scene.anchor.height_m", CFG_REAL, "m", "", -1000, 10000, IN_CONFIG(scene.anchor.height_m),
     .help = "explicit: its height above the ellipsoid; ifc: the same, in place of RefElevation, which counts from the sea."},
    {"scene.anchor.north_deg", CFG_REAL, "deg", "0", -360, 360, IN_CONFIG(scene.anchor.north_deg),
     .help = "explicit: where true north lies, clockwise from the scene's y axis."},
    {"scene.anchor.utm_zone", CFG_COUNT, NULL, "", 0, 60, IN_CONFIG(scene.anchor.utm_zone),
     .help = "utm: zone of the meshes' coordinates; 0: UPS. Required there."},
    {"scene.anchor.hemisphere", CFG_ENUM, .def = "", .names = hemisphere_names, IN_CONFIG(scene.anchor.north),
     .help = "utm: where their northing counts from. Required there."},

    {"stations", CFG_LIST, .min = 1, .max = CONFIG_MAX_STATIONS, LIST_OF(station, n_stations),
     .help = "Places where the head can stand."},
    {"stations[]", CFG_MAP, .help = "A station."},
    {"stations[].name", CFG_TEXT, .def = "", IN_STATION(name), .help = "Name; station-N when not given."},
    {"stations[].position_m", CFG_VEC3, "m", "", -1e9, 1e9, IN_STATION(position_m),
     .help = "The head's origin in the scene frame; required, unless scene.anchor gives it from the place on the Earth."},
    {"stations[].instrument_height_m", CFG_REAL, "m", "", 0, 1000, IN_STATION(instrument_height_m),
     .help = "The head's origin stands this high above the first surface below its place; z (or the height) then is only "
             "where the search downward begins, with 1 cm to spare."},
    {"stations[].heading_deg", CFG_REAL, "deg", "0", -360, 360, IN_STATION(heading_deg),
     .help = "Of the head's y axis, clockwise from the scene's y axis: north without scene.anchor, grid north with utm, "
             "true north with ecef."},
    {"stations[].pitch_deg", CFG_REAL, "deg", "0", -90, 90, IN_STATION(pitch_deg),
     .help = "After the heading, about the head's x axis: the y axis (forward) rises."},
    {"stations[].roll_deg", CFG_REAL, "deg", "0", -180, 180, IN_STATION(roll_deg),
     .help = "After the pitch, about the head's y axis: the x axis (right) sinks."},
    {"stations[].lat_deg", CFG_REAL, "deg", "", -90, 90, IN_STATION(lat_deg),
     .help = "Geodetic latitude of the head's origin, WGS 84. A place on the Earth, in one form, is required without "
             "scene.anchor unless output.crs is local."},
    {"stations[].lon_deg", CFG_REAL, "deg", "", -180, 180, IN_STATION(lon_deg), .help = "Longitude; with lat_deg."},
    {"stations[].height_m", CFG_REAL, "m", "", -1000, 10000, IN_STATION(height_m),
     .help = "Height above the ellipsoid; with lat_deg or easting_m."},
    {"stations[].utm_zone", CFG_COUNT, NULL, "", 0, 60, IN_STATION(utm_zone),
     .help = "UTM zone, 0: UPS; with easting_m. That of a scene.anchor of source utm when not given."},
    {"stations[].hemisphere", CFG_ENUM, .def = "", .names = hemisphere_names, IN_STATION(north),
     .help = "Of the zone; as utm_zone."},
    {"stations[].easting_m", CFG_REAL, "m", "", -1e7, 1e7, IN_STATION(easting_m),
     .help = "UTM or UPS easting of the head's origin, with false origin."},
    {"stations[].northing_m", CFG_REAL, "m", "", -1e7, 2e7, IN_STATION(northing_m), .help = "Northing; with easting_m."},
    {"stations[].ecef_m", CFG_VEC3, "m", "", -1e7, 1e7, IN_STATION(ecef_m),
     .help = "The head's origin in ECEF, WGS 84: X, Y, Z."},

    {"platform", CFG_MAP, .help = "What the head stands on: a tripod, or something that moves."},
    {"platform.kind", CFG_ENUM, .def = "static", .names = platform_names, IN_CONFIG(platform.kind),
     .help = "static: at the station; trajectory: along a file; stops: standing at some of its poses, the scan's stations; live: as a peer says, by UDP or (pace step) with TIME:STEP."},
    {"platform.file", CFG_PATH, .def = "", IN_CONFIG(platform.file),
     .help = "trajectory, stops: CSV with t_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg (or qw,qx,qy,qz), scene frame."},
    {"platform.waypoints", CFG_PATH, .def = "", IN_CONFIG(platform.waypoints),
     .help = "trajectory, stops: CSV with x_m,y_m,z_m,speed_m_s[,pause_s] instead; heading along the path, level as a station there."},
    {"platform.start_s", CFG_REAL, "s", "0", 0, 1e9, IN_CONFIG(platform.start_s),
     .help = "trajectory, stops: where a scan starts on it, or the first stop; after its first sample."},
    {"platform.end_s", CFG_REAL, "s", "0", 0, 1e9, IN_CONFIG(platform.end_s),
     .help = "trajectory, stops: where it ends, likewise; without the key, with its last sample."},
    {"platform.step_s", CFG_REAL, "s", "0", 0, 1e9, IN_CONFIG(platform.step_s),
     .help = "stops: from each to the next, at start_s, start_s + step_s, ... up to end_s; required there."},
    {"platform.at_end", CFG_ENUM, .def = "stop", .names = at_end_names, IN_CONFIG(platform.at_end),
     .help = "trajectory: at its end the scan stops, or the platform holds its last pose."},
    {"platform.mount_m", CFG_VEC3, "m", "[0, 0, 0]", -1000, 1000, IN_CONFIG(platform.mount_m),
     .help = "The head's origin on the platform: right, forward, up."},
    {"platform.mount_heading_deg", CFG_REAL, "deg", "0", -360, 360, IN_CONFIG(platform.mount_heading_deg),
     .help = "Of the head on the platform, clockwise; then pitch, then roll."},
    {"platform.mount_pitch_deg", CFG_REAL, "deg", "0", -90, 90, IN_CONFIG(platform.mount_pitch_deg),
     .help = "Positive: nose up."},
    {"platform.mount_roll_deg", CFG_REAL, "deg", "0", -360, 360, IN_CONFIG(platform.mount_roll_deg),
     .help = "Positive: right side down."},
    {"platform.reach_m", CFG_REAL, "m", "100", 1, 1000, IN_CONFIG(platform.reach_m),
     .help = "live: how far from the station the head may come."},
    {"platform.extrapolate_ms", CFG_REAL, "ms", "100", 0, 10000, IN_CONFIG(platform.extrapolate_ms),
     .help = "live: how long the last two poses are taken to go on; later the platform stands, and is late. Between two poses it goes on evenly."},
    {"platform.address", CFG_TEXT, .def = "127.0.0.1", IN_CONFIG(platform.address),
     .help = "live, in real time: address where poses come in by UDP, lines of t_s x y z roll pitch heading, up to 3600 s ahead of device time."},
    {"platform.port", CFG_COUNT, NULL, "0", 0, 65535, IN_CONFIG(platform.port), .help = "live: its port; 0: the system chooses."},

    {"output", CFG_MAP, .help = "Form of the points."},
    {"output.crs", CFG_ENUM, .def = "local", .names = crs_names, IN_CONFIG(output.crs),
     .help = "Coordinate reference system of the anchor and of geo points."},
    {"output.utm_zone", CFG_COUNT, NULL, "0", 0, 60, IN_CONFIG(output.utm_zone),
     .help = "UTM zone, only with crs: utm; 0: by position, UPS near the poles."},
    {"output.layout", CFG_ENUM, .def = "polar", .names = layout_names, IN_CONFIG(output.layout),
     .help = "polar: range and encoders, as a head measures; geo: coordinates from the anchor."},
    {"output.heights", CFG_ENUM, .def = "ellipsoid", .names = heights_names, IN_CONFIG(output.heights),
     .help = "Of utm and geodetic points; geoid needs GeographicLib's data, auto takes them where they are installed."},
    {"output.tolerance_m", CFG_REAL, "m", "", 1e-7, 1, IN_CONFIG(output.tolerance_m),
     .help = "What georeferencing may add to a point's error: the cheapest method that keeps it is used. A thousandth of "
             "plan.tolerance_m, 1e-7 m at least, when not given."},
    {"output.georef", CFG_ENUM, .def = "auto", .names = georef_names, IN_CONFIG(output.georef),
     .help = "Method of utm and geodetic points; auto: as `scanhead plan` says."},
    {"output.attributes", CFG_BOOL, .def = "off", IN_CONFIG(output.attributes),
     .help = "on: each points frame is followed by one with amplitude (needs signal.model: on) and width of its echoes, 4 bytes "
             "a point; .ply and .las recordings have them."},
    {"output.scale_m", CFG_REAL, "m", "0", 0, 1, IN_CONFIG(output.scale_m), .allowed = "0 (automatic) or 1e-6 to 1 m",
     .help = "Metres per count of a coordinate, at most, and of a range; range_max_m of the profile must fit into 31 bits."},

    {"links", CFG_LIST, .min = 0, .max = CONFIG_MAX_LINKS, LIST_OF(link, n_links),
     .help = "Where the head can be reached; none is needed to record off line."},
    {"links[]", CFG_MAP, .help = "A link."},
    {"links[].type", CFG_ENUM, .names = link_names, IN_LINK(type), .help = "Kind of link."},
    {"links[].protocol", CFG_ENUM, .def = "native", .names = protocol_names, IN_LINK(protocol),
     .help = "native: the head's stream and commands; nmea: the GNSS receiver, NMEA 0183 out, nothing in."},
    {"links[].path", CFG_PATH, .def = "", IN_LINK(path),
     .help = "pty: symbolic link to the terminal (optional); file: file to write (required); usbredir: Unix socket, instead of a port."},
    {"links[].address", CFG_TEXT, .def = "", IN_LINK(address),
     .help = "tcp, usb: address to listen on, or with attach to connect to; 127.0.0.1 when not given."},
    {"links[].port", CFG_COUNT, NULL, "0", 0, 65535, IN_LINK(port),
     .help = "tcp, usb: port; 0: the system chooses; usbip, when not given: 3240."},
    {"links[].max_sessions", CFG_COUNT, NULL, "4", 1, LINK_MAX_SESSIONS, IN_LINK(max_sessions),
     .help = "tcp: clients at a time."},
    {"links[].backend", CFG_ENUM, .def = "usbip", .names = backend_names, IN_LINK(backend),
     .help = "usb: how the device reaches a host."},
    {"links[].attach", CFG_BOOL, .def = "off", IN_LINK(attach),
     .help = "usbip: plug into this machine's vhci_hcd; usbredir: connect to the guest's socket instead of listening; and "
             "once more whenever the host lets go."},
    {"links[].udc", CFG_TEXT, .def = "", IN_LINK(udc), .help = "functionfs: USB device controller; when not given, the first free one."},
    {"links[].speed", CFG_ENUM, .def = "high", .names = speed_names, IN_LINK(speed),
     .help = "usb: full (12 Mbit/s), high (480) or super (5000); the fastest the device can do."},
    {"links[].vid", CFG_COUNT, NULL, "0x1209", 1, 65535, IN_LINK(vid), .flags = CFG_HEX, .allowed = "0x0001 to 0xffff",
     .help = "usb: vendor id; the default pair is set aside for private tests."},
    {"links[].pid", CFG_COUNT, NULL, "0x0001", 0, 65535, IN_LINK(pid), .flags = CFG_HEX, .allowed = "0x0000 to 0xffff",
     .help = "usb: product id."},
    {"links[].serial", CFG_TEXT, .def = "", IN_LINK(serial), .help = "usb: serial number; head.serial when not given."},

    {"beam", CFG_MAP, .help = "The footprint of the pulses."},
    {"beam.mode", CFG_ENUM, .def = "single", .names = beam_names, IN_CONFIG(beam.mode),
     .help = "single: one ray per pulse; rings: sub-rays over the footprint; adaptive: where it reaches over an edge, "
             "or onto glass or a mirror; auto: as `scanhead plan` says."},
    {"beam.rings", CFG_COUNT, NULL, "4", 0, BEAM_MAX_RINGS, IN_CONFIG(beam.rings),
     .help = "Rings of sub-rays, 1 + 3 n (n + 1) in all; adaptive: where a footprint holds more edges than it can tell "
             "apart."},
    {"beam.echoes", CFG_ENUM, .def = "all", .names = echoes_names, IN_CONFIG(head.settings.echoes),
     .help = "Which echoes of a pulse are sent, also of glass and what is behind: all, first, last, strongest."},

    {"plan", CFG_MAP, .help = "What the methods of all stages may be off; each stage takes the cheapest that holds it "
                              "(`scanhead plan`)."},
    {"plan.tolerance_m", CFG_REAL, "m", "1e-3", 1e-6, 1, IN_CONFIG(plan.tolerance_m),
     .help = "RMS error of the echo ranges, against a footprint of 1,000 sub-rays."},
    {"plan.echo_tolerance", CFG_REAL, NULL, "1e-3", 1e-4, 1, IN_CONFIG(plan.echo_tolerance),
     .help = "Share of the pulses that may have another number of echoes than with 1,000 sub-rays; 1e-3 is what the "
             "plan's sample can tell."},

    {"noise", CFG_MAP, .help = "Noise of the measurement."},
    {"noise.range", CFG_ENUM, .def = "off", .names = range_noise_names, IN_CONFIG(noise.range), .allowed = "on or off, or signal",
     .help = "Range noise. on: the profile's range_sigma_m and ppm, whatever the target; signal: that figure holds at "
             "range_sigma_at_m, and noise grows as the signal fades (signal.model: on); off: exact ranges."},
    {"noise.angle", CFG_BOOL, .def = "off", IN_CONFIG(noise.angle),
     .help = "Angle noise after the profile's mirror_sigma_deg and pan_sigma_deg: the beam goes astray, the encoders don't know."},
    {"noise.seed", CFG_COUNT, NULL, "1", 0, 18446744073709551615.0, IN_CONFIG(noise.seed), .help = "Seed of the random numbers."},
    {"noise.ball", CFG_MAP, .help = "Ball-shaped noise: each point moves to anywhere in a ball around it."},
    {"noise.ball.radius_m", CFG_REAL, "m", "0", 0, 100, IN_CONFIG(noise.ball.radius_m), .help = "Radius of the ball; 0: none."},
    {"noise.ball.distance_1_m", CFG_REAL, "1/m", "0", 0, 100, IN_CONFIG(noise.ball.distance_1_m),
     .help = "Distance factor: the radius grows by this share of itself per metre of range."},
    {"noise.ball.factor", CFG_VEC3, NULL, "[1, 1, 1]", 0, 1000, IN_CONFIG(noise.ball.factor), .help = "Stretches the ball along its axes."},
    {"noise.ball.axes", CFG_ENUM, .def = "scene", .names = axes_names, IN_CONFIG(noise.ball.local),
     .help = "Its axes: x, y, z of the scene; or of the beam: along it, to the right, up."},
    {"noise.ball.seed", CFG_COUNT, NULL, "", 0, 18446744073709551615.0, IN_CONFIG(noise.ball.seed),
     .help = "Seed of the ball's random numbers; noise.seed when not given."},

    {"signal", CFG_MAP, .help = "What comes back: amplitude, reflectance, detection threshold."},
    {"signal.model", CFG_BOOL, .def = "off", IN_CONFIG(signal.on),
     .help = "on: range equation, reflectance in the points, targets vanish where the profile's reaches say; off: each hit "
             "within range_max_m is an echo, without reflectance."},
    {"signal.detection", CFG_ENUM, .def = "noisy", .names = detection_names, IN_CONFIG(signal.sharp),
     .help = "noisy: by chance near the threshold, half of the pulses at the profile's reach; sharp: all up to there."},
    {"signal.reflectance", CFG_REAL, NULL, "0.5", 0, 1, IN_CONFIG(signal.reflectance),
     .help = "Of surfaces without a texture or colour in the mesh and without a word in surfaces."},
    {"signal.visibility_m", CFG_REAL, "m", "0", 0, 1e6, IN_CONFIG(signal.visibility_m),
     .help = "Of the air, for its extinction at the profile's wavelength; 0: as for the profile's reaches."},
    {"signal.extinction_1_km", CFG_REAL, "1/km", "", 0, 1000, IN_CONFIG(signal.extinction_1_km),
     .help = "The extinction itself, absorption and scattering, in place of visibility_m."},

    {"surfaces", CFG_LIST, .min = 0, .max = CONFIG_MAX_SURFACES, LIST_OF(surface, n_surfaces),
     .help = "What surfaces are like, by name; the first entry that fits counts, what it doesn't say stays."},
    {"surfaces[]", CFG_MAP, .help = "An entry."},
    {"surfaces[].material", CFG_TEXT, .def = "*", IN_SURFACE(material), .help = "Material's name; * and ? stand for others, as in a shell."},
    {"surfaces[].object", CFG_TEXT, .def = "*", IN_SURFACE(object), .help = "Object's name, likewise."},
    {"surfaces[].reflectance", CFG_REAL, NULL, "", 0, 1, IN_SURFACE(surface.reflectance),
     .help = "Lambertian; luminance of the mesh's texture (PNG) or colour when not given. 0 absorbs."},
    {"surfaces[].specular", CFG_REAL, NULL, "", 0, 1, IN_SURFACE(surface.specular), .help = "Share that is reflected in a lobe."},
    {"surfaces[].gloss", CFG_REAL, NULL, "", 0, 1e6, IN_SURFACE(surface.gloss),
     .help = "Exponent of the lobe's cosine; 100 when not given."},
    {"surfaces[].retro", CFG_REAL, NULL, "", 0, 1e6, IN_SURFACE(surface.retro),
     .help = "Retro-reflector: signal of a white target times this, at any incidence; foils have 100 to 1000."},
    {"surfaces[].glass", CFG_REAL, NULL, "", 0, 1, IN_SURFACE(surface.glass),
     .help = "Share of the power that passes, at each surface: an echo of the pane, and of what lies behind."},
    {"surfaces[].mirror", CFG_REAL, NULL, "", 0, 1, IN_SURFACE(surface.mirror),
     .help = "Share of the power that is mirrored: ghost points, with surfaces of their own."},

    {"optics", CFG_MAP, .help = "Pulses that meet glass or a mirror."},
    {"optics.depth", CFG_COUNT, NULL, "4", 0, CAST_MAX_DEPTH, IN_CONFIG(optics.depth),
     .help = "How many of them a pulse is followed through, at most; 0: glass and mirrors are like other surfaces. When not "
             "given, as many as count here, as `scanhead plan` says."},

    {"instrument", CFG_MAP, .help = "Errors of the head's geometry (core/instrument.h): the beam goes where its mechanics point, "
                                    "the points are computed as if there were none."},
#define ANGLE(key, member, text) \
    {"instrument." key, CFG_REAL, "deg", "0", -10, 10, IN_CONFIG(instrument.member), .help = text}
    ANGLE("collimation_deg", collimation_deg, "The beam leaves the plane across the mirror's axis, to the right."),
    ANGLE("trunnion_deg", trunnion_deg, "The mirror's axis is not level: its right end sinks."),
    {"instrument.transit_offset_m", CFG_REAL, "m", "0", -1, 1, IN_CONFIG(instrument.transit_offset_m),
     .help = "The mirror's axis passes this far ahead of the pan's axis."},
    {"instrument.mirror_offset_m", CFG_REAL, "m", "0", -1, 1, IN_CONFIG(instrument.mirror_offset_m),
     .help = "The beam leaves this far to the right of the pan's axis."},
    ANGLE("mirror_index_deg", mirror_index_deg, "The line encoder reads too much by this."),
    {"instrument.mirror_scale_ppm", CFG_REAL, "ppm", "0", -1e4, 1e4, IN_CONFIG(instrument.mirror_scale_ppm),
     .help = "And by this share of the angle."},
    ANGLE("mirror_eccentricity_deg", mirror_eccentricity_deg, "And by this times sin(angle - mirror_phase_deg)."),
    {"instrument.mirror_phase_deg", CFG_REAL, "deg", "0", -360, 360, IN_CONFIG(instrument.mirror_phase_deg),
     .help = "Phase of the eccentricity."},
    ANGLE("pan_index_deg", pan_index_deg, "The pan encoder, likewise."),
    {"instrument.pan_scale_ppm", CFG_REAL, "ppm", "0", -1e4, 1e4, IN_CONFIG(instrument.pan_scale_ppm), .help = "Likewise."},
    ANGLE("pan_eccentricity_deg", pan_eccentricity_deg, "Likewise."),
    {"instrument.pan_phase_deg", CFG_REAL, "deg", "0", -360, 360, IN_CONFIG(instrument.pan_phase_deg), .help = "Likewise."},
    {"instrument.range_offset_m", CFG_REAL, "m", "0", -10, 10, IN_CONFIG(instrument.range_offset_m),
     .help = "Ranges are told too long by this."},
    {"instrument.range_scale_ppm", CFG_REAL, "ppm", "0", -1e4, 1e4, IN_CONFIG(instrument.range_scale_ppm),
     .help = "And by this share: a clock that runs too fast."},

    {"loop", CFG_MAP, .help = "The fixed-rate loop."},
    {"loop.tick_hz", CFG_REAL, "Hz", "1000", 100, 10000, IN_CONFIG(loop.tick_hz),
     .allowed = "a divisor of 1e9 from 100 to 10000 Hz, such as 500, 1000, 2000",
     .help = "Rate of the loop. Its ticks cut the stream into frames: another rate is another hash of the stream, though the "
             "points are the same (but of a live platform, whose poses are one for each tick)."},
    {"loop.ahead_ms", CFG_REAL, "ms", "64", 2, 90, IN_CONFIG(loop.ahead_ms),
     .help = "How far casting runs ahead of the beam; a command takes that long to reach the beam."},
    {"loop.queue_ms", CFG_REAL, "ms", "250", 10, 10000, IN_CONFIG(loop.queue_ms), .help = "What each link can hold back."},
    {"loop.late_ms", CFG_REAL, "ms", "100", 0, 10000, IN_CONFIG(loop.late_ms),
     .help = "Lateness up to which blocks are still sent; pulses later than that are lost, counted and announced."},
    {"loop.threads", CFG_COUNT, NULL, "0", 0, 64, IN_CONFIG(loop.threads), .help = "Casting threads; 0: one per processor."},
    {"loop.pace", CFG_ENUM, .def = "realtime", .names = pace_names, IN_CONFIG(loop.pace),
     .help = "realtime: by the clock; fast: as fast as it computes; step: a client grants time."},

    {"time", CFG_MAP, .help = "Time of day: UTC and PPS; and errors of the head's clock, for tests of synchronisation."},
    {"time.epoch", CFG_TEXT, .def = "none", IN_CONFIG(time.epoch),
     .allowed = "none, utc, tai, or a time after 1980-01-06 such as 2026-01-01T00:00:00Z",
     .help = "Time of power-up: UTC, or utc or tai for the system's clock at that moment; none: the head doesn't know."},
    {"time.offset_s", CFG_REAL, "s", "0", -1e6, 1e6, IN_CONFIG(time.offset_s),
     .help = "The head's clock is ahead of the true time. Concerns UTC, GPS time and PPS of the head, not the receiver."},
    {"time.drift_ppm", CFG_REAL, "ppm", "0", -1000, 1000, IN_CONFIG(time.drift_ppm), .help = "And gains, from power-up."},
    {"time.jump_s", CFG_REAL, "s", "0", -1e6, 1e6, IN_CONFIG(time.jump_s), .help = "And is set on by this, once,"},
    {"time.jump_at_s", CFG_REAL, "s", "0", 0, 1e8, IN_CONFIG(time.jump_at_s), .help = "so long after power-up."},

    {"gnss", CFG_MAP, .help = "The GNSS receiver, which speaks on links of protocol nmea; it needs the time."},
    {"gnss.rate_hz", CFG_COUNT, "Hz", "1", 1, 20, IN_CONFIG(gnss.rate_hz), .allowed = "1, 2, 4, 5, 10 or 20 Hz",
     .help = "Positions per second."},
    {"gnss.talker", CFG_ENUM, .def = "GN", .names = talker_names, IN_CONFIG(gnss.talker),
     .help = "First letters of its sentences."},
    {"gnss.quality", CFG_COUNT, NULL, "1", 0, 5, IN_CONFIG(gnss.quality),
     .allowed = "0 none, 1 autonomous, 2 differential, 4 RTK fixed, 5 RTK float", .help = "Quality of the fix, as in GGA."},
    {"gnss.satellites", CFG_COUNT, NULL, "12", 0, 99, IN_CONFIG(gnss.satellites), .help = "Satellites used, as in GGA."},
    {"gnss.hdop", CFG_REAL, NULL, "0.7", 0.1, 99.9, IN_CONFIG(gnss.hdop), .help = "Horizontal dilution of precision."},
    {"gnss.accuracy_m", CFG_REAL, "m", "0", 0, 1000, IN_CONFIG(gnss.accuracy_m),
     .help = "One sigma of the noise east, north and up, each position by itself; reproducible by noise.seed. 0: exact."},
    {"gnss.lever_arm_m", CFG_VEC3, "m", "[0, 0, 0]", -100, 100, IN_CONFIG(gnss.lever_arm_m),
     .help = "The antenna from the head's origin, in the head's frame: right, forward, up."},
    {"gnss.geoid_separation_m", CFG_REAL, "m", "0", -120, 120, IN_CONFIG(gnss.geoid_separation_m),
     .help = "Geoid above the ellipsoid: altitude in GGA is the ellipsoidal height less this."},
};
/* clang-format on */

_Static_assert(CFG_LEN(config_keys) <= CFG_MAX_ROWS, "room for every row");
_Static_assert((int)CONFIG_MAX_MESHES <= (int)CFG_MAX_ITEMS && (int)CONFIG_MAX_STATIONS <= (int)CFG_MAX_ITEMS &&
                   (int)CONFIG_MAX_LINKS <= (int)CFG_MAX_ITEMS && (int)CONFIG_MAX_SURFACES <= (int)CFG_MAX_ITEMS,
               "room for every element");

const struct cfg_table cfg_config_table = {config_keys, CFG_LEN(config_keys)};
