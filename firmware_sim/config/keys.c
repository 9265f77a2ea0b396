/* The table of a configuration's keys; profile_keys.c has that of head profiles. A row has the key's path, type, unit,
 * default, limits and member of struct config. Parsing, defaults, errors, --set and `scanhead check --help` come from
 * the rows alone; what concerns more than one key stands in crosscheck.c, places.c and measurement.c. */
#include "core/cast.h"
#include "firmware_sim/config/table.h"
#include "firmware_sim/config/words.h"

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

/* clang-format off */
static const struct cfg_key config_keys[] = {
    {"head", CFG_MAP, .help = "The head and its settings at power-up."},
    {"head.profile", CFG_TEXT, IN_CONFIG(profile_file),
     .allowed = "the name of a profile, or a path that ends in .yaml",
     .help = "Head profile, from $SCANHEAD_HEADS, heads/ beside this file, the installed or the source directory."},
    {"head.serial", CFG_TEXT, .def = "SIM-0001", IN_CONFIG(head.serial), .flags = CFG_ASCII,
     .help = "Serial number, as in *IDN?."},
    {"head.prr_hz", CFG_MICRO, "Hz", "@prr_max_hz", WITHIN("prr_min_hz", "prr_max_hz"),
     IN_CONFIG(head.settings.prr_uhz),
     .help = "Pulse repetition rate. It counts every firing, also those in the blind part of a sweep."},
    {"head.lines_hz", CFG_MICRO, "Hz", "@lines_max_hz", WITHIN("lines_min_hz", "lines_max_hz"),
     IN_CONFIG(head.settings.lines_uhz),
     .help = "Lines per second; at most one per pulse."},
    {"head.pan_deg_s", CFG_MICRO, "deg/s", "@pan_max_deg_s", 0, 9e12, NULL, "pan_max_deg_s",
     IN_CONFIG(head.settings.pan_udeg_s),
     .help = "Pan speed. 0: the pan stands still, each line is a frame."},
    {"head.line_start_deg", CFG_MICRO, "deg", "@fov_min_deg", WITHIN("fov_min_deg", "fov_max_deg"),
     IN_CONFIG(head.settings.line_start_udeg),
     .help = "First line angle cast: 0 forward, 90 up, above 90 backward."},
    {"head.line_stop_deg", CFG_MICRO, "deg", "@fov_max_deg", WITHIN("fov_min_deg", "fov_max_deg"),
     IN_CONFIG(head.settings.line_stop_udeg),
     .help = "Last line angle cast; above the first one."},
    {"head.pan_start_deg", CFG_MICRO, "deg", "@pan_min_deg", WITHIN("pan_min_deg", "pan_max_deg"),
     IN_CONFIG(head.settings.pan_start_udeg),
     .help = "Pan angle where a frame starts."},
    {"head.pan_stop_deg", CFG_MICRO, "deg", "@pan_max_deg", WITHIN("pan_min_deg", "pan_max_deg"),
     IN_CONFIG(head.settings.pan_stop_udeg),
     .help = "Pan angle where a frame ends; at most a turn after its start."},
    {"head.frames", CFG_COUNT, NULL, "1", 0, 1000000, IN_CONFIG(head.settings.frames),
     .help = "Frames (pan sweeps) per scan; 0: until stopped."},
    {"head.station", CFG_COUNT, NULL, "1", 1, CONFIG_MAX_STOPS, IN_CONFIG(head.settings.station),
     .help = "Station where the head stands, counted from 1."},

    {"head.ambiguity", CFG_ENUM, .def = "none", .names = cfg_ambiguity_words, IN_CONFIG(head.ambiguity),
     .help = "Echoes from beyond c / (2 prr_hz), which return after the next pulse. none: they have their true "
             "range; folded: their range is less by whole zones; resolved: they have their true range, within "
             "mta_zones. folded and resolved lose echoes that return within range_min_m after a pulse."},
    {"head.mta_zones", CFG_COUNT, NULL, "8", 1, 1000, IN_CONFIG(head.mta_zones),
     .help = "resolved: zones of c / (2 prr_hz) that the head tells apart; nothing is seen beyond them."},

    {"scene", CFG_MAP, .help = "What is scanned."},
    {"scene.tolerance_m", CFG_REAL, "m", "1e-6", 1e-9, 1, IN_CONFIG(scene.tolerance_m),
     .help = "Largest error of a vertex. Formats of single precision are refused where coordinates are too large."},
    {"scene.order_exactly", CFG_ENUM, .def = "auto", .names = cfg_choice_words, IN_CONFIG(scene.order_exactly),
     .help = "Orders surfaces that overlap or cross in double. It costs loading time, and speed where surfaces "
             "overlap. auto: on where float's resolution in the scene is coarser than plan.tolerance_m."},
    {"scene.meshes", CFG_LIST, .min = 1, .max = CONFIG_MAX_MESHES, LIST_OF(scene.mesh, scene.n_meshes),
     .help = "Mesh files; together they are the scene."},
    {"scene.meshes[]", CFG_MAP, .help = "A mesh file."},
    {"scene.meshes[].file", CFG_PATH, IN_MESH(file), .help = "Path: .obj .ply .stl .gltf .glb .fbx .dae .ifc"},
    {"scene.meshes[].up", CFG_ENUM, .names = cfg_up_words, IN_MESH(up),
     .help = "Axis that points up in the file; y turns (x, y, z) to (x, -z, y)."},
    {"scene.meshes[].scale", CFG_REAL, "m/unit", NULL, 1e-9, 1e9, IN_MESH(scale),
     .help = "Metres per unit of the file."},
    {"scene.meshes[].offset_m", CFG_VEC3, "m", "[0, 0, 0]", -1e9, 1e9, IN_MESH(offset_m),
     .help = "Added after axes and scale."},
    {"scene.meshes[].move_m_s", CFG_VEC3, "m/s", "[0, 0, 0]", -1000, 1000, IN_MESH(move_m_s),
     .help = "Velocity of the mesh, from the scan's start. At a stop it stands where it is at the stop's time."},
    {"scene.meshes[].turn_deg_s", CFG_REAL, "deg/s", "0", -36000, 36000, IN_MESH(turn_deg_s),
     .help = "The mesh turns about the vertical through pivot_m, clockwise seen from above."},
    {"scene.meshes[].pivot_m", CFG_VEC3, "m", "[0, 0, 0]", -1e9, 1e9, IN_MESH(pivot_m),
     .help = "The point that it turns about."},
    {"scene.meshes[].cycle_s", CFG_REAL, "s", "0", 0, 86400, IN_MESH(cycle_s),
     .help = "The motion goes back and forth within this time; 0: it goes on."},

    {"scene.anchor", CFG_MAP, .help = "How the scene lies on the Earth; all stations follow from it."},
    {"scene.anchor.source", CFG_ENUM, .def = "none", .names = cfg_anchor_words, IN_CONFIG(scene.anchor.source),
     .help = "none: each station has a place of its own; explicit: origin_m lies at lat_deg, lon_deg, height_m; "
             "ifc: as the IFC mesh's IFCSITE says; utm, ecef: the meshes' coordinates are UTM (or UPS), or ECEF."},
    {"scene.anchor.origin_m", CFG_VEC3, "m", "[0, 0, 0]", -1e9, 1e9, IN_CONFIG(scene.anchor.origin_m),
     .help = "explicit: the scene's point that lies at lat_deg, lon_deg, height_m."},
    {"scene.anchor.lat_deg", CFG_REAL, "deg", "", -90, 90, IN_CONFIG(scene.anchor.lat_deg),
     .help = "explicit: its latitude, WGS 84."},
    {"scene.anchor.lon_deg", CFG_REAL, "deg", "", -180, 180, IN_CONFIG(scene.anchor.lon_deg),
     .help = "explicit: its longitude."},
    {"scene.anchor.height_m", CFG_REAL, "m", "", -1000, 10000, IN_CONFIG(scene.anchor.height_m),
     .help = "explicit: its height above the ellipsoid; ifc: the same, instead of RefElevation (above the sea)."},
    {"scene.anchor.north_deg", CFG_REAL, "deg", "0", -360, 360, IN_CONFIG(scene.anchor.north_deg),
     .help = "explicit: where true north lies, clockwise from the scene's y axis."},
    {"scene.anchor.utm_zone", CFG_COUNT, NULL, "", 0, 60, IN_CONFIG(scene.anchor.utm_zone),
     .help = "utm: zone of the meshes' coordinates; 0: UPS. Required with source: utm."},
    {"scene.anchor.hemisphere", CFG_ENUM, .def = "", .names = cfg_hemisphere_words, IN_CONFIG(scene.anchor.north),
     .help = "utm: hemisphere that their northing counts from. Required with source: utm."},

    {"stations", CFG_LIST, .min = 1, .max = CONFIG_MAX_STATIONS, LIST_OF(station, n_stations),
     .help = "Places where the head can stand."},
    {"stations[]", CFG_MAP, .help = "A station."},
    {"stations[].name", CFG_TEXT, .def = "", IN_STATION(name), .help = "Name; station-N when not given."},
    {"stations[].position_m", CFG_VEC3, "m", "", -1e9, 1e9, IN_STATION(position_m),
     .help = "The head's origin in the scene frame. Required, unless scene.anchor gives it from a place on Earth."},
    {"stations[].instrument_height_m", CFG_REAL, "m", "", 0, 1000, IN_STATION(instrument_height_m),
     .help = "The head's origin is this high above the first surface below its place. The search downward begins "
             "at z (or height_m), with 1 cm to spare."},
    {"stations[].heading_deg", CFG_REAL, "deg", "0", -360, 360, IN_STATION(heading_deg),
     .help = "Of the head's y axis, clockwise from the scene's y axis: north without scene.anchor, grid north with "
             "utm, true north with ecef."},
    {"stations[].pitch_deg", CFG_REAL, "deg", "0", -90, 90, IN_STATION(pitch_deg),
     .help = "After the heading, about the head's x axis: the y axis (forward) rises."},
    {"stations[].roll_deg", CFG_REAL, "deg", "0", -180, 180, IN_STATION(roll_deg),
     .help = "After the pitch, about the head's y axis: the x axis (right) sinks."},
    {"stations[].lat_deg", CFG_REAL, "deg", "", -90, 90, IN_STATION(lat_deg),
     .help = "Geodetic latitude of the head's origin, WGS 84. A place on the Earth, in one form, is required "
             "without scene.anchor unless output.crs is local."},
    {"stations[].lon_deg", CFG_REAL, "deg", "", -180, 180, IN_STATION(lon_deg), .help = "Longitude; with lat_deg."},
    {"stations[].height_m", CFG_REAL, "m", "", -1000, 10000, IN_STATION(height_m),
     .help = "Height above the ellipsoid; with lat_deg or easting_m."},
    {"stations[].utm_zone", CFG_COUNT, NULL, "", 0, 60, IN_STATION(utm_zone),
     .help = "UTM zone, 0: UPS; with easting_m. That of a scene.anchor of source utm when not given."},
    {"stations[].hemisphere", CFG_ENUM, .def = "", .names = cfg_hemisphere_words, IN_STATION(north),
     .help = "Hemisphere of the zone; that of a scene.anchor of source utm when not given."},
    {"stations[].easting_m", CFG_REAL, "m", "", -1e7, 1e7, IN_STATION(easting_m),
     .help = "UTM or UPS easting of the head's origin, with false origin."},
    {"stations[].northing_m", CFG_REAL, "m", "", -1e7, 2e7, IN_STATION(northing_m),
     .help = "Northing; with easting_m."},
    {"stations[].ecef_m", CFG_VEC3, "m", "", -1e7, 1e7, IN_STATION(ecef_m),
     .help = "The head's origin in ECEF, WGS 84: X, Y, Z."},

    {"platform", CFG_MAP, .help = "What the head stands on: a tripod, or something that moves."},
    {"platform.kind", CFG_ENUM, .def = "static", .names = cfg_platform_words, IN_CONFIG(platform.kind),
     .help = "static: at the station; trajectory: along a file; stops: standing at some of its poses, which are "
             "the scan's stations; live: as a peer says, by UDP or, with pace step, by TIME:STEP."},
    {"platform.file", CFG_PATH, .def = "", IN_CONFIG(platform.file),
     .help = "trajectory, stops: CSV with t_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg (or qw,qx,qy,qz), scene "
             "frame."},
    {"platform.waypoints", CFG_PATH, .def = "", IN_CONFIG(platform.waypoints),
     .help = "trajectory, stops: CSV with x_m,y_m,z_m,speed_m_s[,pause_s] in place of file. The heading follows "
             "the path; the platform is level as a station there."},
    {"platform.start_s", CFG_REAL, "s", "0", 0, 1e9, IN_CONFIG(platform.start_s),
     .help = "trajectory, stops: where a scan, or the first stop, is on the trajectory: seconds after its first "
             "sample."},
    {"platform.end_s", CFG_REAL, "s", "0", 0, 1e9, IN_CONFIG(platform.end_s),
     .help = "trajectory, stops: where it ends, likewise; at the last sample when not given."},
    {"platform.step_s", CFG_REAL, "s", "0", 0, 1e9, IN_CONFIG(platform.step_s),
     .help = "stops: time from each stop to the next, up to end_s. Required with kind: stops."},
    {"platform.at_end", CFG_ENUM, .def = "stop", .names = cfg_at_end_words, IN_CONFIG(platform.at_end),
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
     .help = "live: how long the motion between the last two poses is taken to go on. Later the platform stands, "
             "and is late. Between two poses it moves evenly."},
    {"platform.address", CFG_TEXT, .def = "127.0.0.1", IN_CONFIG(platform.address),
     .help = "live, in real time: address where poses arrive by UDP, as lines of t_s x y z roll pitch heading, up "
             "to 3600 s ahead of device time."},
    {"platform.port", CFG_COUNT, NULL, "0", 0, 65535, IN_CONFIG(platform.port),
     .help = "live: its port; 0: the system chooses."},

    {"output", CFG_MAP, .help = "Form of the points."},
    {"output.crs", CFG_ENUM, .def = "local", .names = cfg_crs_words, IN_CONFIG(output.crs),
     .help = "Coordinate reference system of the anchor and of geo points."},
    {"output.utm_zone", CFG_COUNT, NULL, "0", 0, 60, IN_CONFIG(output.utm_zone),
     .help = "UTM zone, only with crs: utm; 0: by position, UPS near the poles."},
    {"output.layout", CFG_ENUM, .def = "polar", .names = cfg_layout_words, IN_CONFIG(output.layout),
     .help = "polar: range and encoders, as a head measures; geo: coordinates from the anchor."},
    {"output.heights", CFG_ENUM, .def = "ellipsoid", .names = cfg_heights_words, IN_CONFIG(output.heights),
     .help = "Heights of utm and geodetic points. geoid needs GeographicLib's data; auto uses them where they are "
             "installed."},
    {"output.tolerance_m", CFG_REAL, "m", "", 1e-7, 1, IN_CONFIG(output.tolerance_m),
     .help = "What georeferencing may add to a point's error; the cheapest method that holds it is used. When not "
             "given: a thousandth of plan.tolerance_m, but at least 1e-7 m."},
    {"output.georef", CFG_ENUM, .def = "auto", .names = cfg_georef_words, IN_CONFIG(output.georef),
     .help = "Method of utm and geodetic points; auto: as `scanhead plan` says."},
    {"output.attributes", CFG_BOOL, .def = "off", IN_CONFIG(output.attributes),
     .help = "on: each points frame is followed by one with amplitude (needs signal.model: on) and width of its "
             "echoes, 4 bytes a point; .ply and .las recordings have them."},
    {"output.scale_m", CFG_REAL, "m", "0", 0, 1, IN_CONFIG(output.scale_m), .allowed = "0 (automatic) or 1e-6 to 1 m",
     .help = "Metres per count of a range; a count of a coordinate is no larger. The largest range must fit into 31 "
             "bits."},

    {"links", CFG_LIST, .min = 0, .max = CONFIG_MAX_LINKS, LIST_OF(link, n_links),
     .help = "Where the head can be reached; none is needed to record off line."},
    {"links[]", CFG_MAP, .help = "A link."},
    {"links[].type", CFG_ENUM, .names = cfg_link_words, IN_LINK(type), .help = "Kind of link."},
    {"links[].protocol", CFG_ENUM, .def = "native", .names = cfg_protocol_words, IN_LINK(protocol),
     .help = "native: the head's stream and commands; nmea: the GNSS receiver, NMEA 0183 out, nothing in."},
    {"links[].path", CFG_PATH, .def = "", IN_LINK(path),
     .help = "pty: symbolic link to the terminal (optional); file: file to write (required); usbredir: Unix "
             "socket, instead of a port."},
    {"links[].address", CFG_TEXT, .def = "", IN_LINK(address),
     .help = "tcp, usb: address to listen on, or with attach to connect to; 127.0.0.1 when not given."},
    {"links[].port", CFG_COUNT, NULL, "0", 0, 65535, IN_LINK(port),
     .help = "tcp, usb: port; 0: the system chooses; usbip, when not given: 3240."},
    {"links[].max_sessions", CFG_COUNT, NULL, "4", 1, LINK_MAX_SESSIONS, IN_LINK(max_sessions),
     .help = "tcp: clients at a time."},
    {"links[].backend", CFG_ENUM, .def = "usbip", .names = cfg_backend_words, IN_LINK(backend),
     .help = "usb: how the device reaches a host."},
    {"links[].attach", CFG_BOOL, .def = "off", IN_LINK(attach),
     .help = "usbip: plugs into this machine's vhci_hcd; usbredir: connects to the guest's socket instead of "
             "listening. Both do so again whenever the host disconnects."},
    {"links[].udc", CFG_TEXT, .def = "", IN_LINK(udc),
     .help = "functionfs: USB device controller; when not given, the first free one."},
    {"links[].speed", CFG_ENUM, .def = "high", .names = cfg_speed_words, IN_LINK(speed),
     .help = "usb: full (12 Mbit/s), high (480) or super (5000): the fastest that the device offers."},
    {"links[].vid", CFG_COUNT, NULL, "0x1209", 1, 65535, IN_LINK(vid), .flags = CFG_HEX,
     .allowed = "0x0001 to 0xffff",
     .help = "usb: vendor id; the default pair is set aside for private tests."},
    {"links[].pid", CFG_COUNT, NULL, "0x0001", 0, 65535, IN_LINK(pid), .flags = CFG_HEX,
     .allowed = "0x0000 to 0xffff",
     .help = "usb: product id."},
    {"links[].serial", CFG_TEXT, .def = "", IN_LINK(serial),
     .help = "usb: serial number; head.serial when not given."},

    {"beam", CFG_MAP, .help = "The footprint of the pulses."},
    {"beam.mode", CFG_ENUM, .def = "single", .names = cfg_beam_words, IN_CONFIG(beam.mode),
     .help = "single: one ray per pulse; rings: sub-rays over the footprint; adaptive: sub-rays where the "
             "footprint reaches over an edge, or onto glass or a mirror; auto: as `scanhead plan` says."},
    {"beam.rings", CFG_COUNT, NULL, "4", 0, BEAM_MAX_RINGS, IN_CONFIG(beam.rings),
     .help = "Rings of sub-rays: n rings have 1 + 3 n (n + 1). adaptive: used where a footprint holds more edges "
             "than it can tell apart."},
    {"beam.echoes", CFG_ENUM, .def = "all", .names = cfg_echoes_words, IN_CONFIG(head.settings.echoes),
     .help = "Which echoes of a pulse are sent. Those of glass, and of what is seen through it, are among them."},

    {"plan", CFG_MAP, .help = "Tolerances. Each stage uses the cheapest method that holds them (`scanhead plan`)."},
    {"plan.tolerance_m", CFG_REAL, "m", "1e-3", 1e-6, 1, IN_CONFIG(plan.range_m),
     .help = "RMS error of the echo ranges, against a footprint of 1,000 sub-rays."},
    {"plan.echo_tolerance", CFG_REAL, NULL, "1e-3", 1e-4, 1, IN_CONFIG(plan.echo_share),
     .help = "Share of the pulses that may have another number of echoes than with 1,000 sub-rays. The plan's "
             "sample is too small to show less than 1e-3."},

    {"noise", CFG_MAP, .help = "Noise of the measurement."},
    {"noise.range", CFG_ENUM, .def = "off", .names = cfg_range_noise_words, IN_CONFIG(noise.range),
     .help = "Range noise. on: the profile's range_sigma_m and ppm, for any target; signal: that figure holds at "
             "range_sigma_at_m, and noise grows as the signal fades (signal.model: on); off: exact ranges."},
    {"noise.angle", CFG_BOOL, .def = "off", IN_CONFIG(noise.angle),
     .help = "Angle noise of the profile's mirror_sigma_deg and pan_sigma_deg: the beam deviates, the encoders do "
             "not show it."},
    {"noise.seed", CFG_COUNT, NULL, "1", 0, 18446744073709551615.0, IN_CONFIG(noise.seed),
     .help = "Seed of the random numbers."},
    {"noise.ball", CFG_MAP, .help = "Ball-shaped noise: each point moves to anywhere in a ball around it."},
    {"noise.ball.radius_m", CFG_REAL, "m", "0", 0, 100, IN_CONFIG(noise.ball.radius_m),
     .help = "Radius of the ball; 0: none."},
    {"noise.ball.distance_1_m", CFG_REAL, "1/m", "0", 0, 100, IN_CONFIG(noise.ball.distance_1_m),
     .help = "The radius grows by this share of itself per metre of range."},
    {"noise.ball.factor", CFG_VEC3, NULL, "[1, 1, 1]", 0, 1000, IN_CONFIG(noise.ball.factor),
     .help = "Stretches the ball along its axes."},
    {"noise.ball.axes", CFG_ENUM, .def = "scene", .names = cfg_axes_words, IN_CONFIG(noise.ball.local),
     .help = "Its axes: x, y, z of the scene; or of the beam: along it, to the right, up."},
    {"noise.ball.seed", CFG_COUNT, NULL, "", 0, 18446744073709551615.0, IN_CONFIG(noise.ball.seed),
     .help = "Seed of the ball's random numbers; noise.seed when not given."},

    {"signal", CFG_MAP, .help = "What comes back: amplitude, reflectance, detection threshold."},
    {"signal.model", CFG_BOOL, .def = "off", IN_CONFIG(signal.on),
     .help = "on: amplitude by the range equation, reflectance in the points, and targets vanish beyond the "
             "reaches of the profile; off: each hit within the largest range is an echo, without reflectance."},
    {"signal.detection", CFG_ENUM, .def = "noisy", .names = cfg_detection_words, IN_CONFIG(signal.sharp),
     .help = "noisy: by chance near the threshold, half of the pulses at the profile's reach; sharp: all up to the "
             "reach, none beyond."},
    {"signal.reflectance", CFG_REAL, NULL, "0.5", 0, 1, IN_CONFIG(signal.reflectance),
     .help = "Reflectance of surfaces that have no texture or colour in the mesh and no reflectance in surfaces."},
    {"signal.visibility_m", CFG_REAL, "m", "0", 0, 1e6, IN_CONFIG(signal.visibility_m),
     .help = "Visibility of the air, for its extinction at the profile's wavelength; 0: as the profile's reaches "
             "have it."},
    {"signal.extinction_1_km", CFG_REAL, "1/km", "", 0, 1000, IN_CONFIG(signal.extinction_1_km),
     .help = "Extinction of the air (absorption and scattering), in place of visibility_m."},

    {"surfaces", CFG_LIST, .min = 0, .max = CONFIG_MAX_SURFACES, LIST_OF(surface, n_surfaces),
     .help = "Properties of surfaces, by name. The first entry that fits counts; what it leaves out is as without "
             "an entry."},
    {"surfaces[]", CFG_MAP, .help = "An entry."},
    {"surfaces[].material", CFG_TEXT, .def = "*", IN_SURFACE(material),
     .help = "Material's name; * and ? stand for others, as in a shell."},
    {"surfaces[].object", CFG_TEXT, .def = "*", IN_SURFACE(object), .help = "Object's name, in the same way."},
    {"surfaces[].reflectance", CFG_REAL, NULL, "", 0, 1, IN_SURFACE(surface.reflectance),
     .help = "Lambertian reflectance; 0 absorbs. When not given: luminance of the mesh's texture (PNG) or colour."},
    {"surfaces[].specular", CFG_REAL, NULL, "", 0, 1, IN_SURFACE(surface.specular),
     .help = "Share that is reflected in a lobe."},
    {"surfaces[].gloss", CFG_REAL, NULL, "", 0, 1e6, IN_SURFACE(surface.gloss),
     .help = "Exponent of the lobe's cosine; 100 when not given."},
    {"surfaces[].retro", CFG_REAL, NULL, "", 0, 1e6, IN_SURFACE(surface.retro),
     .help = "Retro-reflector: its signal is that of a white target times this, at any incidence; foils have 100 "
             "to 1000."},
    {"surfaces[].glass", CFG_REAL, NULL, "", 0, 1, IN_SURFACE(surface.glass),
     .help = "Share of the power that passes each surface: the pane and what is seen through it give echoes."},
    {"surfaces[].mirror", CFG_REAL, NULL, "", 0, 1, IN_SURFACE(surface.mirror),
     .help = "Share of the power that is mirrored: ghost points, with surfaces of their own."},

    {"optics", CFG_MAP, .help = "Pulses that meet glass or a mirror."},
    {"optics.depth", CFG_COUNT, NULL, "4", 0, CAST_MAX_DEPTH, IN_CONFIG(optics.depth),
     .help = "Largest number of such surfaces on the way of a pulse; 0: glass and mirrors are like other surfaces. "
             "When not given: as many as `scanhead plan` finds necessary."},

    {"instrument", CFG_MAP,
     .help = "Errors of the head's geometry (core/instrument.h). The beam goes where the mechanics point; points "
             "are computed as if there were no errors."},
#define ANGLE(key, member, text) \
    {"instrument." key, CFG_REAL, "deg", "0", -10, 10, IN_CONFIG(instrument.member), .help = text}
    ANGLE("collimation_deg", collimation_deg, "The beam leaves the plane across the mirror's axis, to the right."),
    ANGLE("trunnion_deg", trunnion_deg, "The mirror's axis is not level: its right end is lower by this."),
    {"instrument.transit_offset_m", CFG_REAL, "m", "0", -1, 1, IN_CONFIG(instrument.transit_offset_m),
     .help = "The mirror's axis passes this far ahead of the pan's axis."},
    {"instrument.mirror_offset_m", CFG_REAL, "m", "0", -1, 1, IN_CONFIG(instrument.mirror_offset_m),
     .help = "The beam leaves this far to the right of the pan's axis."},
    ANGLE("mirror_index_deg", mirror_index_deg, "The line encoder reads too much by this."),
    {"instrument.mirror_scale_ppm", CFG_REAL, "ppm", "0", -1e4, 1e4, IN_CONFIG(instrument.mirror_scale_ppm),
     .help = "The line encoder reads too much by this share of the angle."},
    ANGLE("mirror_eccentricity_deg", mirror_eccentricity_deg,
          "The line encoder reads too much by this times sin(angle - mirror_phase_deg)."),
    {"instrument.mirror_phase_deg", CFG_REAL, "deg", "0", -360, 360, IN_CONFIG(instrument.mirror_phase_deg),
     .help = "Phase of the eccentricity."},
    ANGLE("pan_index_deg", pan_index_deg, "The pan encoder reads too much by this."),
    {"instrument.pan_scale_ppm", CFG_REAL, "ppm", "0", -1e4, 1e4, IN_CONFIG(instrument.pan_scale_ppm),
     .help = "The pan encoder reads too much by this share of the angle."},
    ANGLE("pan_eccentricity_deg", pan_eccentricity_deg,
          "The pan encoder reads too much by this times sin(angle - pan_phase_deg)."),
    {"instrument.pan_phase_deg", CFG_REAL, "deg", "0", -360, 360, IN_CONFIG(instrument.pan_phase_deg),
     .help = "Phase of the eccentricity."},
    {"instrument.range_offset_m", CFG_REAL, "m", "0", -10, 10, IN_CONFIG(instrument.range_offset_m),
     .help = "Measured ranges are too long by this."},
    {"instrument.range_scale_ppm", CFG_REAL, "ppm", "0", -1e4, 1e4, IN_CONFIG(instrument.range_scale_ppm),
     .help = "Measured ranges are too long by this share: a clock that runs too fast."},

    {"loop", CFG_MAP, .help = "The fixed-rate loop."},
    {"loop.tick_hz", CFG_REAL, "Hz", "1000", 100, 10000, IN_CONFIG(loop.tick_hz),
     .allowed = "a divisor of 1e9 from 100 to 10000 Hz, such as 500, 1000, 2000",
     .help = "Rate of the loop. Its ticks cut the stream into frames: another rate gives another hash of the "
             "stream. The points are the same, except on a live platform, which has one pose per tick."},
    {"loop.ahead_ms", CFG_REAL, "ms", "64", 2, 90, IN_CONFIG(loop.ahead_ms),
     .help = "How far casting runs ahead of the beam; a command takes that long to reach the beam."},
    {"loop.queue_ms", CFG_REAL, "ms", "250", 10, 10000, IN_CONFIG(loop.queue_ms),
     .help = "How much of the stream is kept for a link whose reader is slow."},
    {"loop.late_ms", CFG_REAL, "ms", "100", 0, 10000, IN_CONFIG(loop.late_ms),
     .help = "Blocks that are later than this are not sent: their pulses are lost, counted and announced."},
    {"loop.threads", CFG_COUNT, NULL, "0", 0, 64, IN_CONFIG(loop.threads),
     .help = "Casting threads; 0: one per processor."},
    {"loop.pace", CFG_ENUM, .def = "realtime", .names = cfg_pace_words, IN_CONFIG(loop.pace),
     .help = "realtime: by the clock; fast: as fast as it computes; step: a client grants time."},

    {"time", CFG_MAP,
     .help = "Time of day (UTC and PPS), and errors of the head's clock for tests of synchronisation."},
    {"time.epoch", CFG_TEXT, .def = "none", IN_CONFIG(time.epoch),
     .allowed = "none, utc, tai, or a time after 1980-01-06 such as 2026-01-01T00:00:00Z",
     .help = "Time of power-up: a date (UTC), or utc or tai for the system's clock at that moment; none: the head "
             "doesn't know the time."},
    {"time.offset_s", CFG_REAL, "s", "0", -1e6, 1e6, IN_CONFIG(time.offset_s),
     .help = "The head's clock is ahead of the true time by this. It shows in UTC, GPS time and PPS of the head, "
             "not in those of the receiver."},
    {"time.drift_ppm", CFG_REAL, "ppm", "0", -1000, 1000, IN_CONFIG(time.drift_ppm),
     .help = "The head's clock gains this, from power-up."},
    {"time.jump_s", CFG_REAL, "s", "0", -1e6, 1e6, IN_CONFIG(time.jump_s),
     .help = "The head's clock jumps ahead by this, once."},
    {"time.jump_at_s", CFG_REAL, "s", "0", 0, 1e8, IN_CONFIG(time.jump_at_s),
     .help = "Time of the jump, after power-up."},

    {"gnss", CFG_MAP, .help = "The GNSS receiver, which sends on links of protocol nmea; it needs the time."},
    {"gnss.rate_hz", CFG_COUNT, "Hz", "1", 1, 20, IN_CONFIG(gnss.rate_hz), .allowed = "1, 2, 4, 5, 10 or 20 Hz",
     .help = "Positions per second."},
    {"gnss.talker", CFG_ENUM, .def = "GN", .names = cfg_talker_words, IN_CONFIG(gnss.talker),
     .help = "First letters of its sentences."},
    {"gnss.quality", CFG_COUNT, NULL, "1", 0, 5, IN_CONFIG(gnss.quality),
     .allowed = "0 none, 1 autonomous, 2 differential, 4 RTK fixed, 5 RTK float",
     .help = "Quality of the fix, as in GGA."},
    {"gnss.satellites", CFG_COUNT, NULL, "12", 0, 99, IN_CONFIG(gnss.satellites),
     .help = "Satellites used, as in GGA."},
    {"gnss.hdop", CFG_REAL, NULL, "0.7", 0.1, 99.9, IN_CONFIG(gnss.hdop),
     .help = "Horizontal dilution of precision."},
    {"gnss.accuracy_m", CFG_REAL, "m", "0", 0, 1000, IN_CONFIG(gnss.accuracy_m),
     .help = "One sigma of the noise east, north and up, independent from position to position; reproducible by "
             "noise.seed. 0: exact."},
    {"gnss.lever_arm_m", CFG_VEC3, "m", "[0, 0, 0]", -100, 100, IN_CONFIG(gnss.lever_arm_m),
     .help = "The antenna from the head's origin, in the head's frame: right, forward, up."},
    {"gnss.geoid_separation_m", CFG_REAL, "m", "0", -120, 120, IN_CONFIG(gnss.geoid_separation_m),
     .help = "Height of the geoid above the ellipsoid: altitude in GGA is the ellipsoidal height less this."},
};
/* clang-format on */

_Static_assert(CFG_LEN(config_keys) <= CFG_MAX_ROWS, "room for every row");
_Static_assert((int)CONFIG_MAX_MESHES <= (int)CFG_MAX_ITEMS && (int)CONFIG_MAX_STATIONS <= (int)CFG_MAX_ITEMS &&
                   (int)CONFIG_MAX_LINKS <= (int)CFG_MAX_ITEMS && (int)CONFIG_MAX_SURFACES <= (int)CFG_MAX_ITEMS,
               "room for every element");

const struct cfg_table cfg_config_table = {config_keys, CFG_LEN(config_keys)};
