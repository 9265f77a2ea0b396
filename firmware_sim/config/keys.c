/* The table of a configuration's keys; profile_keys.c has that of head profiles. A row has the key's path,
 * type, unit, default, limits and member of struct config. Parsing, defaults, errors, --set and `scanhead
 * check --help` come from the rows alone; what concerns more than one key stands in crosscheck.c, places.c
 * and measurement.c. */
#include "core/cast.h"
#include "drivers/usb/backend.h"
#include "firmware_sim/config/table.h"

/* How a row begins: path, offset and size. Where path and member have different names, the path stands
 * before. */
#define IN_CONFIG(member)  CFG_MEMBER(struct config, member)
#define IN_STATION(member) CFG_MEMBER(struct config_station, member)
#define SETTING(member)    IN_CONFIG(head.settings.member)
#define KEY(member)        #member, IN_CONFIG(member)
#define MESH(member)       "scene.meshes[]." #member, CFG_MEMBER(struct config_mesh, member)
#define STATION(member)    "stations[]." #member, IN_STATION(member)
#define TRIPOD(member)      "stations[].tripod." #member, IN_STATION(tripod.member)
#define LINK(member)       "links[]." #member, CFG_MEMBER(struct link_spec, member)
#define RULE(member)       "surfaces[]." #member, CFG_MEMBER(struct surface_rule, member)
#define SURFACE(member)    "surfaces[]." #member, CFG_MEMBER(struct surface_rule, surface.member)
#define LIST_OF(array, count)                                                                 \
    .offset = offsetof(struct config, array), .size = sizeof(((struct config *)0)->array[0]), \
    .count_offset = offsetof(struct config, count)
/* The words of a key, by their value. */
#define WORDS(...)                 \
    .names = (const char *const[]) \
    {                              \
        __VA_ARGS__, NULL          \
    }
/* Limits of a setting: two figures of the profile. */
#define WITHIN(low, high) .min = -9e12, .max = 9e12, .min_key = low, .max_key = high

/* clang-format off */
#define FAULT_LIST_AT(member) offsetof(struct config, faults.member)
static const struct cfg_key config_keys[] = {
    {"head", .type = CFG_MAP, .help = "The head and its settings at power-up."},
    {"head.profile", IN_CONFIG(profile_file), CFG_TEXT, .example = "riegl-vz400i",
     .allowed = "the name of a profile, or a path that ends in .yaml",
     .help = "Head profile, from $SCANHEAD_HEADS, heads/ beside this file, the installed or the source directory."},
    {KEY(head.serial), CFG_TEXT, .def = "SIM-0001", .flags = CFG_ASCII, .help = "Serial number, as in *IDN?."},
    {"head.prr_hz", SETTING(prr_uhz), CFG_MICRO, "Hz", "@prr_max_hz", WITHIN("prr_min_hz", "prr_max_hz"),
     .help = "Pulse repetition rate. It counts every firing, also those in the blind part of a sweep. It follows from "
             "lines_hz where a line has a fixed number of pulses, and from the firing sequence of beams."},
    {"head.lines_hz", SETTING(lines_uhz), CFG_MICRO, "Hz", "@lines_max_hz", WITHIN("lines_min_hz", "lines_max_hz"),
     .help = "Lines per second, at most one per pulse. Turns per second of a planar or a spinning head."},
    {"head.pan_deg_s", SETTING(pan_udeg_s), CFG_MICRO, "deg/s", "@pan_max_deg_s", 0, 9e12, NULL, "pan_max_deg_s",
     .help = "Pan speed. 0: the pan stands still, each line is a frame."},
    {"head.line_start_deg", SETTING(line_start_udeg), CFG_MICRO, "deg", "@fov_min_deg",
     WITHIN("fov_min_deg", "fov_max_deg"), .help = "First line angle cast: 0 forward, 90 up, above 90 backward. Of a planar head: from its front step, in the "
             "direction of its steps; of beams and spheres an azimuth, 0 to 360."},
    {"head.line_stop_deg", SETTING(line_stop_udeg), CFG_MICRO, "deg", "@fov_max_deg",
     WITHIN("fov_min_deg", "fov_max_deg"), .help = "Last line angle cast; above the first one, but of a sphere: 350 to 10 goes across 0."},
    {"head.step_deg", IN_CONFIG(head.step_udeg), CFG_MICRO, "deg", "", 0.01, 90, .example = "0.1",
     .help = "sphere: from pulse to pulse and from ring to ring, in place of the profile's. Rounded to whole steps of a turn "
             "and of half a turn, which is said."},
    {"head.ring_start_deg", IN_CONFIG(head.ring_start_udeg), CFG_MICRO, "deg", "-90", -90, 90,
     .help = "sphere: elevation of the lowest ring. Rings outside of the limits are no lines and cost no time."},
    {"head.ring_stop_deg", IN_CONFIG(head.ring_stop_udeg), CFG_MICRO, "deg", "90", -90, 90,
     .help = "sphere: elevation of the highest ring. As ring_start_deg: one ring, a circle, at just that elevation."},
    {"head.pan_start_deg", SETTING(pan_start_udeg), CFG_MICRO, "deg", "@pan_min_deg",
     WITHIN("pan_min_deg", "pan_max_deg"), .help = "Pan angle where a frame starts."},
    {"head.pan_stop_deg", SETTING(pan_stop_udeg), CFG_MICRO, "deg", "@pan_max_deg",
     WITHIN("pan_min_deg", "pan_max_deg"), .help = "Pan angle where a frame ends; at most a turn after its start."},
    {KEY(head.range_min_m), CFG_REAL, "m", "@range_min_m", 0, 1e5,
     .allowed = "range_min_m to range_max_m of the head profile, in m",
     .help = "Nothing nearer is an echo: such pulses are shots without echo. It holds at every pulse rate, where the "
             "profile doesn't have a larger one."},
    {KEY(head.range_max_m), CFG_REAL, "m", "@range_max_m", 0, 1e5,
     .allowed = "range_min_m to range_max_m of the head profile, in m",
     .help = "Nothing farther is an echo, likewise. The descriptor on the wire has these limits."},
    {"head.frames", SETTING(frames), CFG_COUNT, NULL, "1", 0, HEAD_MAX_FRAMES,
     .help = "Frames (pan sweeps, or turns of a head without a pan) per scan; 0: until stopped."},
    {"head.station", SETTING(station), CFG_COUNT, NULL, "1", 1, CONFIG_MAX_STOPS,
     .help = "Station where the head stands, counted from 1."},

    {KEY(head.ambiguity), CFG_ENUM, .def = "none",
     WORDS([DETECT_AMBIGUITY_NONE] = "none", [DETECT_FOLDED] = "folded", [DETECT_RESOLVED] = "resolved"),
     .help = "Echoes from beyond c / (2 prr_hz), which return after the next pulse. none: they have their true range; "
             "folded: their range is less by whole zones; resolved: they have their true range, within mta_zones. "
             "folded and resolved lose echoes that return within range_min_m after a pulse."},
    {KEY(head.mta_zones), CFG_COUNT, NULL, "8", 1, 1000,
     .help = "resolved: zones of c / (2 prr_hz) that the head tells apart; nothing is seen beyond them."},
    {KEY(head.name), CFG_TEXT, .def = "", .example = "north-gate", .flags = CFG_ASCII,
     .help = "What its user calls the head, for protocols that can ask for it (cola: LocationName)."},
    {KEY(head.start), CFG_BOOL, .def = "off",
     .help = "on: `scanhead run` scans at once when the head has booted, as with --start."},

    {"scene", .type = CFG_MAP, .help = "What is scanned."},
    {KEY(scene.tolerance_m), CFG_REAL, "m", "", 1e-9, 1, .example = "1e-4",
     .help = "Largest error of a vertex. Formats of single precision are refused where coordinates are too large. When "
             "not given: a tenth of plan.tolerance_m, or 1 m where that isn't given either. Above 1e-6 m is a warning."},
    {KEY(scene.order_exactly), CFG_ENUM, .def = "auto",
     WORDS([CHOICE_AUTO] = "auto", [CHOICE_OFF] = "off", [CHOICE_ON] = "on"),
     .help = "Orders surfaces that overlap or cross in double. It costs loading time, and speed where surfaces "
             "overlap. auto: on where float's resolution in the scene is coarser than plan.tolerance_m, and where a map "
             "of what the station sees (cast.sight) gives it at no cost."},
    {KEY(scene.cutouts), CFG_BOOL, .def = "on",
     .help = "Rays pass where a texture's alpha or opacity map is below a half, as between leaves. Textures are then "
             "read when the scene is loaded; without such a texture it costs nothing more."},
    {"scene.import_memory_mib", IN_CONFIG(scene.import.memory_mib), CFG_COUNT, "MiB", "8192", 16, 1 << 24,
     .help = "Memory that Assimp may take for one mesh (all formats but .obj and .ply); more is an error. Assimp reads "
             "in a process of its own, since broken files make it crash, hang or take all memory."},
    {"scene.import_s", IN_CONFIG(scene.import.time_s), CFG_REAL, "s", "300", 0.1, 1e6,
     .help = "Time that Assimp may take for one mesh; more is an error."},
    {"scene.import_files", IN_CONFIG(scene.import.files), CFG_COUNT, NULL, "64", 4, 1000,
     .help = "Files that Assimp may have open at a time: a mesh and those that it names."},
    {"scene.meshes", .type = CFG_LIST, .min = 1, .max = CONFIG_MAX_MESHES, LIST_OF(scene.mesh, scene.n_meshes),
     .help = "Mesh files; together they are the scene."},
    {"scene.meshes[]", .type = CFG_MAP, .help = "A mesh file."},
    {MESH(file), CFG_PATH, .example = "scenes/glass_room.obj", .help = "Path: .obj .ply .stl .gltf .glb .fbx .dae .ifc"},
    {MESH(up), CFG_ENUM, .example = "z", WORDS([SCENE_UP_Z] = "z", [SCENE_UP_Y] = "y"),
     .help = "Axis that points up in the file; y turns (x, y, z) to (x, -z, y)."},
    {MESH(scale), CFG_REAL, "m/unit", NULL, 1e-9, 1e9, .example = "1", .help = "Metres per unit of the file."},
    {MESH(offset_m), CFG_VEC3, "m", "[0, 0, 0]", -1e9, 1e9, .help = "Added after axes and scale."},
    {MESH(move_m_s), CFG_VEC3, "m/s", "[0, 0, 0]", -1000, 1000,
     .help = "Velocity of the mesh, from the scan's start. At a stop it stands where it is at the stop's time."},
    {MESH(turn_deg_s), CFG_REAL, "deg/s", "0", -36000, 36000,
     .help = "The mesh turns about the vertical through pivot_m, clockwise seen from above."},
    {MESH(pivot_m), CFG_VEC3, "m", "[0, 0, 0]", -1e9, 1e9, .help = "The point that it turns about."},
    {MESH(cycle_s), CFG_REAL, "s", "0", 0, 86400,
     .help = "The motion goes back and forth within this time; 0: it goes on."},

    {"scene.target", .type = CFG_MAP, .help = "What of the meshes is scanned; without objects all of them."},
    {"scene.target.objects", .type = CFG_LIST, .min = 0, .max = CONFIG_MAX_OBJECTS,
     LIST_OF(scene.target.object, scene.target.n_objects), .help = "Objects by name."},
    {"scene.target.objects[]", 0, SCENE_NAME_LEN, CFG_TEXT, .def = "", .example = "Wall*",
     .help = "Name; * and ? stand for others, as in a shell. It must fit an object."},
    {KEY(scene.target.others), CFG_ENUM, .def = "left_out",
     WORDS([OTHERS_LEFT_OUT] = "left_out", [OTHERS_HIDE] = "hide"),
     .help = "All other objects. left_out: they are no part of the scene, so they give no points and hide nothing; hide: they "
             "hide what is behind them; a pulse that meets them is a shot without echo."},

    {"scene.anchor", .type = CFG_MAP, .help = "How the scene lies on the Earth; all stations follow from it."},
    {KEY(scene.anchor.source), CFG_ENUM, .def = "none",
     WORDS([ANCHOR_NONE] = "none", [ANCHOR_EXPLICIT] = "explicit", [ANCHOR_IFC] = "ifc", [ANCHOR_UTM] = "utm",
           [ANCHOR_ECEF] = "ecef"),
     .help = "none: each station has a place of its own; explicit: origin_m lies at lat_deg, lon_deg, height_m; ifc: "
             "as the IFC mesh's IFCSITE says; utm, ecef: the meshes' coordinates are UTM (or UPS), or ECEF."},
    {KEY(scene.anchor.origin_m), CFG_VEC3, "m", "[0, 0, 0]", -1e9, 1e9,
     .help = "explicit: the scene's point that lies at lat_deg, lon_deg, height_m."},
    {KEY(scene.anchor.lat_deg), CFG_REAL, "deg", "", -90, 90, .example = "49.1", .help = "explicit: its latitude, WGS 84."},
    {KEY(scene.anchor.lon_deg), CFG_REAL, "deg", "", -180, 180, .example = "8.436", .help = "explicit: its longitude."},
    {KEY(scene.anchor.height_m), CFG_REAL, "m", "", -1000, 10000, .example = "110",
     .help = "explicit: its height above the ellipsoid; ifc: the same, instead of RefElevation (above the sea)."},
    {KEY(scene.anchor.north_deg), CFG_REAL, "deg", "0", -360, 360,
     .help = "explicit: where true north lies, clockwise from the scene's y axis."},
    {KEY(scene.anchor.utm_zone), CFG_COUNT, NULL, "", 0, 60, .example = "32",
     .help = "utm: zone of the meshes' coordinates; 0: UPS. Required with source: utm."},
    {"scene.anchor.hemisphere", IN_CONFIG(scene.anchor.north), CFG_ENUM, .def = "", .example = "north", WORDS("south", "north"),
     .help = "utm: hemisphere that their northing counts from. Required with source: utm."},

    {"stations", .type = CFG_LIST, .min = 1, .max = CONFIG_MAX_STATIONS, LIST_OF(station, n_stations),
     .help = "Places where the head can stand."},
    {"stations[]", .type = CFG_MAP, .help = "A station."},
    {STATION(name), CFG_TEXT, .def = "", .example = "gate", .help = "Name; station-N when not given."},
    {STATION(position_m), CFG_VEC3, "m", "", -1e9, 1e9, .example = "[0, 0, 1.7]", .flags = CFG_NEEDED,
     .help = "The head's origin in the scene frame. Required, unless scene.anchor gives it from a place on Earth."},
    {STATION(instrument_height_m), CFG_REAL, "m", "", 0, 1000, .example = "1.7",
     .help = "The head's origin is this high above the first surface below its place. The search downward begins at z "
             "(or height_m), with 1 cm to spare."},
    {STATION(heading_deg), CFG_REAL, "deg", "0", -360, 360,
     .help = "Of the head's y axis, clockwise from the scene's y axis: north without scene.anchor, grid north with "
             "utm, true north with ecef."},
    {STATION(pitch_deg), CFG_REAL, "deg", "0", -90, 90,
     .help = "After the heading, about the head's x axis: the y axis (forward) rises."},
    {STATION(roll_deg), CFG_REAL, "deg", "0", -180, 180,
     .help = "After the pitch, about the head's y axis: the x axis (right) sinks."},
    {STATION(lat_deg), CFG_REAL, "deg", "", -90, 90, .example = "49.1",
     .help = "Geodetic latitude of the head's origin, WGS 84. A place on the Earth, in one form, is required without "
             "scene.anchor unless output.crs is local."},
    {STATION(lon_deg), CFG_REAL, "deg", "", -180, 180, .example = "8.436", .help = "Longitude; with lat_deg."},
    {STATION(height_m), CFG_REAL, "m", "", -1000, 10000, .example = "110",
     .help = "Height above the ellipsoid; with lat_deg or easting_m."},
    {STATION(utm_zone), CFG_COUNT, NULL, "", 0, 60, .example = "32",
     .help = "UTM zone, 0: UPS; with easting_m. That of a scene.anchor of source utm when not given."},
    {"stations[].hemisphere", IN_STATION(north), CFG_ENUM, .def = "", .example = "north", WORDS("south", "north"),
     .help = "Hemisphere of the zone; that of a scene.anchor of source utm when not given."},
    {STATION(easting_m), CFG_REAL, "m", "", -1e7, 1e7, .example = "458835",
     .help = "UTM or UPS easting of the head's origin, with false origin."},
    {STATION(northing_m), CFG_REAL, "m", "", -1e7, 2e7, .example = "5438800", .help = "Northing; with easting_m."},
    {STATION(ecef_m), CFG_VEC3, "m", "", -1e7, 1e7, .example = "[4138400, 613700, 4798000]", .help = "The head's origin in ECEF, WGS 84: X, Y, Z."},

    {"stations[].tripod", .type = CFG_MAP,
     .help = "What the head stands on. Its legs open as the head is lowered; what is below the head between them is hidden."},
    {TRIPOD(leg_m), CFG_REAL, "m", "", 0.01, 100, .example = "1.8",
     .help = "Length of a leg. Required with the other keys. Opening, from the vertical: its cosine is the top's height above "
             "the ground divided by leg_m."},
    {TRIPOD(opening_min_deg), CFG_REAL, "deg", "15", 0, 89,
     .help = "Smallest opening. Where the head is higher than the legs then reach, the tripod hovers, which is a warning."},
    {TRIPOD(head_above_m), CFG_REAL, "m", "0", 0, 100, .help = "The head's origin above the tripod's top."},
    {TRIPOD(cone), CFG_ENUM, .def = "auto",
     WORDS([CHOICE_AUTO] = "auto", [CHOICE_OFF] = "off", [CHOICE_ON] = "on"),
     .help = "Pulses closer to straight down than the opening are shots without echo. auto: on where legs is off."},
    {TRIPOD(legs), CFG_BOOL, .def = "off",
     .help = "Three legs as a mesh: they hide what is behind them, and points on them have the object tripod, material leg."},
    {TRIPOD(leg_diameter_m), CFG_REAL, "m", "0.03", 0.001, 1, .help = "legs: of a leg, a prism of six sides, from edge to edge."},
    {TRIPOD(legs_heading_deg), CFG_REAL, "deg", "0", -360, 360,
     .help = "legs: where the first one goes, clockwise from the scene's y axis; the others follow by 120 deg."},
    {"stations[].scanner", 0, sizeof(struct config_station), CFG_MAP, .example = "{}",
     .help = "A scanner of its own at this station: sections head, beam, cast, plan, noise, signal, surfaces, optics, "
             "instrument with keys that differ from the file's. With a head.profile of its own, nothing of the file's "
             "head and instrument holds for it. --set stations.1.scanner.head.lines_hz=10 works, too."},

    {"platform", .type = CFG_MAP, .help = "What the head stands on: a tripod, or something that moves."},
    {KEY(platform.kind), CFG_ENUM, .def = "static",
     WORDS([PLATFORM_STATIC] = "static", [PLATFORM_TRAJECTORY] = "trajectory", [PLATFORM_LIVE] = "live",
           [PLATFORM_STOPS] = "stops"),
     .help = "static: at the station; trajectory: along a file; stops: standing at some of its poses, which are the "
             "scan's stations, or without a file at the stations themselves, while meshes move; live: as a peer says, by UDP or, with pace step, by TIME:STEP."},
    {KEY(platform.file), CFG_PATH, .def = "", .example = "path.csv",
     .help = "trajectory, stops: CSV with t_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg (or qw,qx,qy,qz), scene "
             "frame."},
    {KEY(platform.waypoints), CFG_PATH, .def = "", .example = "way.csv",
     .help = "trajectory, stops: CSV with x_m,y_m,z_m,speed_m_s[,pause_s] in place of file. The heading follows the "
             "path; the platform is level as a station there."},
    {KEY(platform.start_s), CFG_REAL, "s", "0", 0, 1e9,
     .help = "trajectory, stops: where a scan, or the first stop, is on the trajectory: seconds after its first "
             "sample."},
    {KEY(platform.end_s), CFG_REAL, "s", "0", 0, 1e9,
     .help = "trajectory, stops: where it ends, likewise; at the last sample when not given. Required for stops without "
             "a trajectory."},
    {KEY(platform.step_s), CFG_REAL, "s", "0", 0, 1e9,
     .help = "stops: time from each stop to the next, up to end_s. Required with kind: stops, unless frames_per_s is."},
    {KEY(platform.frames_per_s), CFG_REAL, "1/s", "0", 0, 1e6, .example = "25",
     .help = "stops: first_frame, last_frame and frame_step say when they are, in place of start_s, end_s and step_s. "
             "Frame 0 is at the trajectory's first sample, or at time 0. The points' frame scalar counts so, too."},
    {KEY(platform.first_frame), CFG_REAL, NULL, "0", 0, 1e9, .help = "stops, with frames_per_s: the first one."},
    {KEY(platform.last_frame), CFG_REAL, NULL, "0", 0, 1e9,
     .help = "stops, with frames_per_s: none is after it; the trajectory's last sample when not given."},
    {KEY(platform.frame_step), CFG_REAL, NULL, "1", 1e-6, 1e9, .help = "stops, with frames_per_s: from each to the next."},
    {KEY(platform.at_end), CFG_ENUM, .def = "stop", WORDS([PLATFORM_STOP] = "stop", [PLATFORM_HOLD] = "hold"),
     .help = "trajectory: at its end the scan stops, or the platform holds its last pose."},
    {KEY(platform.mount_m), CFG_VEC3, "m", "[0, 0, 0]", -1000, 1000,
     .help = "The head's origin on the platform: right, forward, up."},
    {KEY(platform.mount_heading_deg), CFG_REAL, "deg", "0", -360, 360,
     .help = "Of the head on the platform, clockwise; then pitch, then roll."},
    {KEY(platform.mount_pitch_deg), CFG_REAL, "deg", "0", -90, 90, .help = "Positive: nose up."},
    {KEY(platform.mount_roll_deg), CFG_REAL, "deg", "0", -360, 360, .help = "Positive: right side down."},
    {KEY(platform.reach_m), CFG_REAL, "m", "100", 1, 1000, .help = "live: how far from the station the head may come."},
    {KEY(platform.extrapolate_ms), CFG_REAL, "ms", "100", 0, 10000,
     .help = "live: how long the motion between the last two poses is taken to go on. Later the platform stands, and "
             "is late. Between two poses it moves evenly."},
    {KEY(platform.address), CFG_TEXT, .def = "127.0.0.1",
     .help = "live, in real time: address where poses arrive by UDP, as lines of t_s x y z roll pitch heading, up to "
             "3600 s ahead of device time."},
    {KEY(platform.port), CFG_COUNT, NULL, "0", 0, 65535, .help = "live: its port; 0: the system chooses."},

    {"output", .type = CFG_MAP, .help = "Form of the points."},
    {KEY(output.crs), CFG_ENUM, .def = "local",
     WORDS([GEOREF_LOCAL] = "local", [GEOREF_ECEF] = "ecef", [GEOREF_UTM] = "utm", [GEOREF_GEODETIC] = "geodetic"),
     .help = "Coordinate reference system of the anchor and of geo points."},
    {KEY(output.utm_zone), CFG_COUNT, NULL, "0", 0, 60,
     .help = "UTM zone, only with crs: utm; 0: by position, UPS near the poles."},
    {KEY(output.layout), CFG_ENUM, .def = "polar", WORDS([LINE_POLAR] = "polar", [LINE_GEO] = "geo"),
     .help = "polar: range and encoders, as a head measures; geo: coordinates from the anchor."},
    {KEY(output.heights), CFG_ENUM, .def = "ellipsoid",
     WORDS([HEIGHTS_ELLIPSOID] = "ellipsoid", [HEIGHTS_GEOID] = "geoid", [HEIGHTS_AUTO] = "auto"),
     .help = "Heights of utm and geodetic points. geoid needs GeographicLib's data; auto uses them where they are "
             "installed."},
    {KEY(output.tolerance_m), CFG_REAL, "m", "", 1e-7, 1, .example = "1e-6",
     .help = "What georeferencing may add to a point's error; the cheapest method that holds it is used. When not "
             "given: a thousandth of plan.tolerance_m, but at least 1e-7 m."},
    {KEY(output.georef), CFG_ENUM, .def = "auto",
     WORDS([GEOREF_AUTO] = "auto", [GEOREF_EXACT] = "exact", [GEOREF_ORDER1] = "order1", [GEOREF_ORDER2] = "order2",
           [GEOREF_ORDER3] = "order3", [GEOREF_ORDER5] = "order5"),
     .help = "Method of utm and geodetic points; auto: as `scanhead plan` says."},
    {KEY(output.attributes), CFG_BOOL, .def = "off",
     .help = "on: each points frame is followed by one with amplitude (needs signal.model: on) and width of its "
             "echoes, 4 bytes a point; .ply and .las recordings have them."},
    {KEY(output.colour), CFG_ENUM, .def = "none",
     WORDS([COLOUR_NONE] = "none", [COLOUR_SOLID] = "solid", [COLOUR_RANGE] = "range", [COLOUR_HEIGHT] = "height",
           [COLOUR_REFLECTANCE] = "reflectance", [COLOUR_LABEL] = "label", [COLOUR_FRAME] = "frame",
           [COLOUR_TEXTURE] = "texture"),
     .help = "Colours of points. Other than none: each points frame is followed by one of 3 bytes a point; recordings "
             "have them. range, height, frame (of a trajectory): red, yellow, green, blue between two limits; "
             "reflectance: grey, -30 to 0 dB; label: a hue for each surface; texture: the texel that is hit, where "
             "there is none the mesh's colour, or else grey."},
    {KEY(output.colour_rgb), CFG_VEC3, NULL, "[255, 255, 255]", 0, 255,
     .help = "The colour of colour: solid: red, green and blue, whole numbers."},
    {KEY(output.colour_limits), CFG_PAIR, NULL, "", -1e9, 1e9, .example = "[0, 30]",
     .help = "Limits of colour: range (m), height (m, z of the scene's frame) or frame. Not given: a stream takes the "
             "head's range limits, the scene's lowest and highest point, the first and last frame of the trajectory; a "
             "recording the smallest and largest figure in it."},
    {KEY(output.scale_m), CFG_REAL, "m", "0", 0, 1, .allowed = "0 (automatic) or 1e-6 to 1 m",
     .help = "Metres per count of a range; a count of a coordinate is no larger. The largest range must fit into 32 "
             "bits, a coordinate into 31. automatic: 1e-6 m up to 4294 m of range (geo: 2147 m), then ten times as "
             "much."},

    {"links", .type = CFG_LIST, .min = 0, .max = CONFIG_MAX_LINKS, LIST_OF(link, n_links),
     .help = "Where the head can be reached; none is needed to record off line."},
    {"links[]", .type = CFG_MAP, .help = "A link."},
    {LINK(type), CFG_ENUM, .example = "tcp",
     WORDS([LINK_NULL] = "null", [LINK_FILE] = "file", [LINK_PTY] = "pty", [LINK_TCP] = "tcp", [LINK_USB] = "usb",
           [LINK_UDP] = "udp", [LINK_WEB] = "web"),
     .help = "Kind of link; web: a page for a browser, which shows the scan and sets the head."},
    {LINK(protocol), CFG_ENUM, .def = "native",
     WORDS([PROTOCOL_NATIVE] = "native", [PROTOCOL_NMEA] = "nmea", [PROTOCOL_SCIP] = "scip", [PROTOCOL_COLA] = "cola",
           [PROTOCOL_VELODYNE] = "velodyne", [PROTOCOL_VELODYNE_POSITION] = "velodyne-position",
           [PROTOCOL_VELODYNE_HTTP] = "velodyne-http"),
     .help = "native: the head's stream and commands; nmea: the GNSS receiver, NMEA 0183 out, nothing in; scip: as a "
             "Hokuyo; cola: as a SICK scanner, CoLa-A and CoLa-B; velodyne: data packets, velodyne-position: position "
             "packets, velodyne-http: settings, as a VLP-16."},
    {LINK(path), CFG_PATH, .def = "", .example = "port",
     .help = "pty: symbolic link to the terminal (optional); file: file to write (required); usbredir: Unix socket, "
             "instead of a port."},
    {LINK(address), CFG_TEXT, .def = "", .example = "127.0.0.1",
     .help = "tcp, usb, web: address to listen on, or with attach to connect to; udp: where the packets go. 127.0.0.1 when "
             "not given."},
    {LINK(port), CFG_COUNT, NULL, "0", 0, 65535,
     .help = "tcp, usb, web: port; 0: the system chooses; usbip, when not given: 3240. udp: the receiver's (required)."},
    {LINK(interface), CFG_TEXT, .def = "", .example = "eth1",
     .help = "udp: the packets' source is this interface's address. Required where they are broadcast, to "
             "255.255.255.255 or to its own broadcast address. Routes still say where packets to other addresses go: "
             "to bind a socket to an interface takes a privilege."},
    {LINK(max_sessions), CFG_COUNT, NULL, "4", 1, LINK_MAX_SESSIONS,
     .help = "tcp, web: clients at a time; scip, when not given: 1."},
    {LINK(waits), CFG_ENUM, .def = "by-type",
     WORDS([LINK_WAITS_BY_TYPE] = "by-type", [LINK_WAITS_YES] = "yes", [LINK_WAITS_NO] = "no"),
     .help = "Whether a reader that can't follow holds back the paces fast and step; no: it loses frames, as in real "
             "time. by-type: those of web links lose, all others hold back."},
    {LINK(backend), CFG_ENUM, .def = "usbip",
     WORDS([USB_BACKEND_USBIP] = "usbip", [USB_BACKEND_USBREDIR] = "usbredir", [USB_BACKEND_FUNCTIONFS] = "functionfs"),
     .help = "usb: how the device reaches a host."},
    {LINK(attach), CFG_BOOL, .def = "off",
     .help = "usbip: plugs into this machine's vhci_hcd; usbredir: connects to the guest's socket instead of "
             "listening. Both do so again whenever the host disconnects."},
    {LINK(udc), CFG_TEXT, .def = "", .example = "dummy_udc.0", .help = "functionfs: USB device controller; when not given, the first free one."},
    {LINK(speed), CFG_ENUM, .def = "high",
     WORDS([USB_RATE_FULL] = "full", [USB_RATE_HIGH] = "high", [USB_RATE_SUPER] = "super"),
     .help = "usb: full (12 Mbit/s), high (480) or super (5000): the fastest that the device offers."},
    {LINK(vid), CFG_COUNT, NULL, "0x1209", 1, 65535, .flags = CFG_HEX, .allowed = "0x0001 to 0xffff",
     .help = "usb: vendor id. When not given, that of the device whose protocol it is: native 0x1209 (with pid 0x0001 "
             "set aside for private tests), scip 0x15d1, cola 0x19a2."},
    {LINK(pid), CFG_COUNT, NULL, "0x0001", 0, 65535, .flags = CFG_HEX, .allowed = "0x0000 to 0xffff",
     .help = "usb: product id. When not given: native 0x0001, scip 0x0000, cola 0x5001."},
    {LINK(serial), CFG_TEXT, .def = "", .example = "SIM-0002",
     .help = "usb: serial number. When not given: head.serial where that is given, else SIM-0001 and eight digits that "
             "are this head's own on this machine; with scip none, as the device. Only the USB device has them, not *IDN?."},

    {"beam", .type = CFG_MAP, .help = "The footprint of the pulses."},
    {KEY(beam.mode), CFG_ENUM, .def = "single",
     WORDS([BEAM_SINGLE] = "single", [BEAM_RINGS] = "rings", [BEAM_ADAPTIVE] = "adaptive", [BEAM_AUTO] = "auto"),
     .help = "single: one ray per pulse; rings: sub-rays over the footprint; adaptive: sub-rays where the footprint "
             "reaches over an edge, or onto glass or a mirror; auto: as `scanhead plan` says."},
    {KEY(beam.rings), CFG_COUNT, NULL, "4", 0, BEAM_MAX_RINGS,
     .help = "Rings of sub-rays: n rings have 1 + 3 n (n + 1). At a plane's end a range is wrong by up to "
             "0.35 / n^0.75 of the footprint's radius times the tangent of the incidence: 9 mm with 4 rings, "
             "0.35 mrad, 100 m and 77 deg. Outlines are exact. adaptive: used where a footprint holds more edges than it can tell "
             "apart."},
    {"beam.echoes", SETTING(echoes), CFG_ENUM, .def = "all",
     WORDS([BEAM_ALL] = "all", [BEAM_FIRST] = "first", [BEAM_LAST] = "last", [BEAM_STRONGEST] = "strongest"),
     .help = "Which echoes of a pulse are sent. Those of glass, and of what is seen through it, are among them."},

    {"cast", .type = CFG_MAP, .help = "How a ray finds what it meets."},
    {KEY(cast.sight), CFG_ENUM, .def = "auto",
     WORDS([CHOICE_AUTO] = "auto", [CHOICE_OFF] = "off", [CHOICE_ON] = "on"),
     .help = "on: before a scan the head maps what its station sees of each direction, and looks rays up in that. Only "
             "where head and beam stand still, and no texture cuts holes. Hits are the same, to the last bit. off: the "
             "BVH is asked for each ray. auto: on where the scan's pulses pay for the map, as `scanhead plan` says."},
    {KEY(cast.sight_mib), CFG_REAL, "MiB", "64", 1, 65536,
     .help = "Memory that the maps of all stations may take together, also while they are made. Directions that don't "
             "fit are left to the BVH."},

    {"coverage", .type = CFG_MAP, .help = "How `scanhead coverage` cuts the scene's surface."},
    {KEY(coverage.cell_m), CFG_REAL, "m", "0.25", 1e-4, 1e4,
     .help = "Size of a cell. A cell is seen where a pulse meets it, so it should be several times as wide as the points "
             "are apart."},
    {KEY(coverage.memory_mib), CFG_REAL, "MiB", "2048", 1, 1048576,
     .help = "Memory that cells, or a mesh of them, may take. Cells too small for that are refused."},

    {"plan", .type = CFG_MAP,
     .help = "Tolerances. Each stage uses the cheapest method that holds them (`scanhead plan`)."},
    {"plan.tolerance_m", IN_CONFIG(plan.range_m), CFG_REAL, "m", "1e-3", 1e-6, 1,
     .help = "RMS error of the echo ranges, against a footprint of 1,000 sub-rays."},
    {"plan.echo_tolerance", IN_CONFIG(plan.echo_share), CFG_REAL, NULL, "1e-3", 1e-4, 1,
     .help = "Share of the pulses that may have another number of echoes than with 1,000 sub-rays. The plan's sample "
             "is too small to show less than 1e-3."},

    {"noise", .type = CFG_MAP, .help = "Noise of the measurement."},
    {KEY(noise.range), CFG_ENUM, .def = "off",
     WORDS([RANGE_NOISE_OFF] = "off", [RANGE_NOISE_ON] = "on", [RANGE_NOISE_SIGNAL] = "signal"),
     .help = "Range noise. on: the profile's range_sigma_m and ppm, for any target; signal: that figure holds at "
             "range_sigma_at_m, and noise grows as the signal fades (signal.model: on); off: exact ranges."},
    {KEY(noise.sigma_m), CFG_REAL, "m", "@range_sigma_m", 0, 10,
     .help = "One sigma of the range noise, its fixed part, in place of the profile's range_sigma_m. With a signal model "
             "at least the profile's range_sigma_floor_m."},
    {KEY(noise.angle), CFG_BOOL, .def = "off",
     .help = "Angle noise of the profile's mirror_sigma_deg and pan_sigma_deg: the beam deviates, the encoders do not "
             "show it."},
    {KEY(noise.seed), CFG_COUNT, NULL, "1", 0, 18446744073709551615.0, 
     .help = "Seed of the random numbers. Noise also differs by station, and by scan since power-up at a station."},
    {"noise.ball", .type = CFG_MAP, .help = "Ball-shaped noise: each point moves to anywhere in a ball around it."},
    {KEY(noise.ball.radius_m), CFG_REAL, "m", "0", 0, 100, .help = "Radius of the ball; 0: none."},
    {KEY(noise.ball.distance_1_m), CFG_REAL, "1/m", "0", 0, 100,
     .help = "The radius grows by this share of itself per metre of range."},
    {KEY(noise.ball.factor), CFG_VEC3, NULL, "[1, 1, 1]", 0, 1000, .help = "Stretches the ball along its axes."},
    {"noise.ball.axes", IN_CONFIG(noise.ball.local), CFG_ENUM, .def = "scene", WORDS("scene", "beam"),
     .help = "Its axes: x, y, z of the scene; or of the beam: along it, to the right, up."},
    {KEY(noise.ball.seed), CFG_COUNT, NULL, "", 0, 18446744073709551615.0, .example = "1",
     .help = "Seed of the ball's random numbers; noise.seed when not given."},

    {"signal", .type = CFG_MAP, .help = "What comes back: amplitude, reflectance, detection threshold."},
    {"signal.model", IN_CONFIG(signal.on), CFG_BOOL, .def = "off",
     .help = "on: amplitude by the range equation, reflectance in the points, and targets vanish beyond the reaches of "
             "the profile; off: each hit within the largest range is an echo, without reflectance."},
    {"signal.detection", IN_CONFIG(signal.sharp), CFG_ENUM, .def = "noisy", WORDS("noisy", "sharp"),
     .help = "noisy: by chance near the threshold, half of the pulses at the profile's reach; sharp: all up to the "
             "reach, none beyond."},
    {KEY(signal.reflectance), CFG_REAL, NULL, "0.5", 0, 1,
     .help = "Reflectance of surfaces that have no texture or colour in the mesh and no reflectance in surfaces."},
    {KEY(signal.visibility_m), CFG_REAL, "m", "0", 0, 1e6,
     .help = "Visibility of the air, for its extinction at the profile's wavelength; 0: as the profile's reaches have "
             "it."},
    {KEY(signal.extinction_1_km), CFG_REAL, "1/km", "", 0, 1000, .example = "0.5",
     .help = "Extinction of the air (absorption and scattering), in place of visibility_m."},

    {"surfaces", .type = CFG_LIST, .min = 0, .max = CONFIG_MAX_SURFACES, LIST_OF(surface, n_surfaces),
     .help = "Properties of surfaces, by name. The first entry that fits counts; what it leaves out is as without an "
             "entry."},
    {"surfaces[]", .type = CFG_MAP, .help = "An entry."},
    {RULE(material), CFG_TEXT, .def = "*", .help = "Material's name; * and ? stand for others, as in a shell."},
    {RULE(object), CFG_TEXT, .def = "*", .help = "Object's name, in the same way."},
    {SURFACE(reflectance), CFG_REAL, NULL, "", 0, 1, .example = "0.4",
     .help = "Lambertian reflectance; 0 absorbs. When not given: luminance of the mesh's texture or colour."},
    {SURFACE(specular), CFG_REAL, NULL, "", 0, 1, .example = "0.1", .help = "Share that is reflected in a lobe."},
    {SURFACE(gloss), CFG_REAL, NULL, "", 0, 1e6, .example = "100",
     .help = "Exponent of the lobe's cosine; 100 when not given."},
    {SURFACE(retro), CFG_REAL, NULL, "", 0, 1e6, .example = "300",
     .help = "Retro-reflector: its signal is that of a white target times this, at any incidence; foils have 100 to "
             "1000."},
    {SURFACE(glass), CFG_REAL, NULL, "", 0, 1, .example = "0.9",
     .help = "Share of the power that passes each surface: the pane and what is seen through it give echoes. It counts "
             "on the way there and back: beyond two surfaces (a pane) of 0.9 an echo has 0.9^4 of its power."},
    {SURFACE(mirror), CFG_REAL, NULL, "", 0, 1, .example = "0.9",
     .help = "Share of the power that is mirrored: ghost points, with surfaces of their own. It counts on the way "
             "there and back: in a mirror of 0.9 an echo has 0.81 of its power."},

    {"optics", .type = CFG_MAP, .help = "Pulses that meet glass or a mirror."},
    {KEY(optics.depth), CFG_COUNT, NULL, "4", 0, CAST_MAX_DEPTH,
     .help = "Largest number of such surfaces on the way of a pulse; 0: glass and mirrors are like other surfaces. "
             "When not given: as many as `scanhead plan` finds necessary."},

    {"instrument", .type = CFG_MAP,
     .help = "Errors of the head's geometry (core/instrument.h). The beam goes where the mechanics point; points are "
             "computed as if there were no errors."},
#define ANGLE(name, text) {KEY(instrument.name), CFG_REAL, "deg", "0", -10, 10, .help = text}
    ANGLE(collimation_deg, "The beam leaves the plane across the mirror's axis, to the right."),
    ANGLE(trunnion_deg, "The mirror's axis is not level: its right end is lower by this."),
    {KEY(instrument.transit_offset_m), CFG_REAL, "m", "0", -1, 1,
     .help = "The mirror's axis passes this far ahead of the pan's axis."},
    {KEY(instrument.mirror_offset_m), CFG_REAL, "m", "0", -1, 1,
     .help = "The beam leaves this far to the right of the pan's axis."},
    ANGLE(mirror_index_deg, "The line encoder reads too much by this."),
    {KEY(instrument.mirror_scale_ppm), CFG_REAL, "ppm", "0", -1e4, 1e4,
     .help = "The line encoder reads too much by this share of the angle."},
    ANGLE(mirror_eccentricity_deg, "The line encoder reads too much by this times sin(angle - mirror_phase_deg)."),
    {KEY(instrument.mirror_phase_deg), CFG_REAL, "deg", "0", -360, 360, .help = "Phase of the eccentricity."},
    ANGLE(pan_index_deg, "The pan encoder reads too much by this."),
    {KEY(instrument.pan_scale_ppm), CFG_REAL, "ppm", "0", -1e4, 1e4,
     .help = "The pan encoder reads too much by this share of the angle."},
    ANGLE(pan_eccentricity_deg, "The pan encoder reads too much by this times sin(angle - pan_phase_deg)."),
    {KEY(instrument.pan_phase_deg), CFG_REAL, "deg", "0", -360, 360, .help = "Phase of the eccentricity."},
    {KEY(instrument.range_offset_m), CFG_REAL, "m", "0", -10, 10, .help = "Measured ranges are too long by this."},
    {KEY(instrument.range_scale_ppm), CFG_REAL, "ppm", "0", -1e4, 1e4,
     .help = "Measured ranges are too long by this share: a clock that runs too fast."},

    {"loop", .type = CFG_MAP, .help = "The fixed-rate loop."},
    {KEY(loop.tick_hz), CFG_REAL, "Hz", "1000", 100, 10000,
     .allowed = "a divisor of 1e9 from 100 to 10000 Hz, such as 500, 1000, 2000",
     .help = "Rate of the loop. Its ticks cut the stream into frames: another rate gives another hash of the stream. "
             "The points are the same, except on a live platform, which has one pose per tick."},
    {KEY(loop.ahead_ms), CFG_REAL, "ms", "64", 2, 90,
     .help = "How far casting runs ahead of the beam; a command takes that long to reach the beam."},
    {KEY(loop.queue_ms), CFG_REAL, "ms", "250", 10, 10000,
     .help = "How much of the stream is kept for a link whose reader is slow."},
    {KEY(loop.late_ms), CFG_REAL, "ms", "100", 0, 10000,
     .help = "Blocks that are later than this are not sent: their pulses are lost, counted and announced."},
    {KEY(loop.threads), CFG_COUNT, NULL, "0", 0, CONFIG_MAX_THREADS, .help = "Casting threads; 0: one per processor."},
    {KEY(loop.pace), CFG_ENUM, .def = "realtime",
     WORDS([PACE_REALTIME] = "realtime", [PACE_FAST] = "fast", [PACE_STEP] = "step"),
     .help = "realtime: by the clock; fast: as fast as it computes; step: a client grants time."},

    {"time", .type = CFG_MAP,
     .help = "Time of day (UTC and PPS), and errors of the head's clock for tests of synchronisation."},
    {KEY(time.epoch), CFG_TEXT, .def = "none",
     .allowed = "none, utc, tai, or a time after 1980-01-06 such as 2026-01-01T00:00:00Z",
     .help = "Time of power-up: a date (UTC), or utc or tai for the system's clock at that moment; none: the head "
             "doesn't know the time."},
    {KEY(time.offset_s), CFG_REAL, "s", "0", -1e6, 1e6,
     .help = "The head's clock is ahead of the true time by this. It shows in UTC, GPS time and PPS of the head, not "
             "in those of the receiver."},
    {KEY(time.drift_ppm), CFG_REAL, "ppm", "0", -1000, 1000, .help = "The head's clock gains this, from power-up."},
    {KEY(time.jump_s), CFG_REAL, "s", "0", -1e6, 1e6, .help = "The head's clock jumps ahead by this, once."},
    {KEY(time.jump_at_s), CFG_REAL, "s", "0", 0, 1e8, .help = "Time of the jump, after power-up."},

    {"gnss", .type = CFG_MAP, .help = "The GNSS receiver, which sends on links of protocol nmea; it needs the time."},
    {KEY(gnss.rate_hz), CFG_COUNT, "Hz", "1", 1, 20, .allowed = "1, 2, 4, 5, 10 or 20 Hz",
     .help = "Positions per second."},
    {KEY(gnss.talker), CFG_ENUM, .def = "GN", WORDS([TALKER_GN] = "GN", [TALKER_GP] = "GP"),
     .help = "First letters of its sentences."},
    {KEY(gnss.quality), CFG_COUNT, NULL, "1", 0, 5,
     .allowed = "0 none, 1 autonomous, 2 differential, 4 RTK fixed, 5 RTK float",
     .help = "Quality of the fix, as in GGA."},
    {KEY(gnss.satellites), CFG_COUNT, NULL, "12", 0, 99, .help = "Satellites used, as in GGA."},
    {KEY(gnss.hdop), CFG_REAL, NULL, "0.7", 0.1, 99.9, .help = "Horizontal dilution of precision."},
    {KEY(gnss.accuracy_m), CFG_REAL, "m", "0", 0, 1000,
     .help = "One sigma of the noise east, north and up, independent from position to position; reproducible by "
             "noise.seed. 0: exact."},
    {KEY(gnss.lever_arm_m), CFG_VEC3, "m", "[0, 0, 0]", -100, 100,
     .help = "The antenna from the head's origin, in the head's frame: right, forward, up."},
    {KEY(gnss.geoid_separation_m), CFG_REAL, "m", "0", -120, 120,
     .help = "Height of the geoid above the ellipsoid: altitude in GGA is the ellipsoidal height less this."},

#include "firmware_sim/config/fault_rows.h"
};
/* clang-format on */

_Static_assert(CFG_LEN(config_keys) <= CFG_MAX_ROWS, "room for every row");
_Static_assert((int)CONFIG_MAX_MESHES <= (int)CFG_MAX_ITEMS && (int)CONFIG_MAX_STATIONS <= (int)CFG_MAX_ITEMS &&
                   (int)CONFIG_MAX_LINKS <= (int)CFG_MAX_ITEMS && (int)CONFIG_MAX_SURFACES <= (int)CFG_MAX_ITEMS &&
                   (int)FAULT_MAX <= (int)CFG_MAX_ITEMS,
               "room for every element");

const struct cfg_table cfg_config_table = {config_keys, CFG_LEN(config_keys)};
