/* SPDX-License-Identifier: MIT */
/* Rows of the table of keys: the scene, the stations in it, and the platform. Private to keys.c, whose macros they are
 * written with. */
/* clang-format off */
    {"scene", .type = CFG_MAP, .help = "What is scanned."},
    {KEY(scene.tolerance_m), CFG_REAL, "m", "", 1e-9, 1, .example = "1e-4",
     .help = "Largest allowed error of a vertex. Formats of single precision are refused where coordinates are too "
             "large. When not given: a tenth of plan.tolerance_m, or 1 m where that isn't given either. Errors above "
             "1e-6 m give a warning."},
    {KEY(scene.cutouts), CFG_BOOL, .def = "on",
     .help = "Rays pass through a surface where its texture's alpha or opacity map is below a half (glTF: below the "
             "material's alphaCutoff), as between leaves. Textures are then read when the scene is loaded; scenes "
             "without such a texture take no more time."},
    {"scene.import_memory_mib", IN_CONFIG(scene.import.memory_mib), CFG_COUNT, "MiB", "8192", 16, 1 << 24,
     .help = "Memory that the reader of a mesh may take (all formats but .obj, .ply and .stl), or each of the readers "
             "of an .ifc; more is an error. Readers run in their own processes, since broken files make them crash, "
             "run without end or take all memory."},
    {"scene.import_s", IN_CONFIG(scene.import.time_s), CFG_REAL, "s", "300", 0.1, 1e6,
     .help = "Time that a reader may take for one mesh; more is an error."},
    {"scene.import_files", IN_CONFIG(scene.import.files), CFG_COUNT, NULL, "64", 4, 1000,
     .help = "Files that a reader may have open at a time: a mesh and the files that it names. web-ifc and "
             "ifc-lite have a limit of their own."},
    {"scene.ifc_reader", IN_CONFIG(scene.import.ifc_reader), CFG_ENUM,
     .def = "auto", WORDS([IFC_READER_AUTO] = "auto", [IFC_READER_WEB] = "web-ifc", [IFC_READER_LITE] = "ifc-lite",
     [IFC_READER_ASSIMP] = "assimp"),
     .help = "Reader of bodies of .ifc. auto: web-ifc and ifc-lite, compared product by product. Where these two "
             "are not installed, Assimp reads the bodies; then products with shapes that Assimp is known to read wrong "
             "are an error. web-ifc, ifc-lite: that one alone, not cross-checked. assimp: Assimp; a warning names such "
             "products."},
    {"scene.ifc_strict", IN_CONFIG(scene.import.ifc_strict), CFG_BOOL, .def = "off",
     .help = "on: a product that the readers of .ifc make differently, or that only one of them makes, is an error, "
             "and so is a file that only one could read. off: these are warnings."},
    {"scene.meshes", .type = CFG_LIST, .min = 1, .max = CONFIG_MAX_MESHES, LIST_OF(scene.mesh, scene.n_meshes),
     .help = "Mesh files; together they are the scene."},
    {"scene.meshes[]", .type = CFG_MAP, .help = "A mesh file."},
    {MESH(file), CFG_PATH, .example = "scenes/glass_room.obj",
     .help = "Path: .obj .ply .stl .gltf .glb .fbx .dae .ifc .tif .tiff"},
    {MESH(up), CFG_ENUM, .example = "z", WORDS([SCENE_UP_Z] = "z", [SCENE_UP_Y] = "y"),
     .help = "Axis that points up in the file; y turns (x, y, z) to (x, -z, y)."},
    {MESH(scale), CFG_REAL, "m/unit", NULL, 1e-9, 1e9, .example = "1", .help = "Metres per unit of the file."},
    {MESH(offset_m), CFG_VEC3, "m", "[0, 0, 0]", -1e9, 1e9, .help = "Shift, added after axes and scale."},
    {MESH(copies), CFG_PATH, .def = "", .example = "trees.csv",
     .allowed = "a CSV file, or a list as [{ offset_m: [5, 0, 0], turn_deg: 30, scale: 1.2 }, ...]",
     .help = "The mesh stands at each of these places, and nowhere else; it is stored once. The CSV file has the "
             "columns x_m,y_m,z_m and may have turn_deg,scale. A copy is the mesh as placed by the keys above, then "
             "scaled, turned about the vertical, clockwise seen from above, then shifted."},
    {MESH(copy_labels), CFG_BOOL, .def = "off",
     .help = "on: each copy has its own surfaces, with objects \"NAME 1\", \"NAME 2\" ...; off: all copies share the "
             "mesh's surfaces."},
    {MESH(move_m_s), CFG_VEC3, "m/s", "[0, 0, 0]", -1000, 1000,
     .help = "Velocity of the mesh, from the scan's start. For a stop of the platform the mesh is moved to its "
             "place at the stop's time, and stands there."},
    {MESH(turn_deg_s), CFG_REAL, "deg/s", "0", -36000, 36000,
     .help = "The mesh turns about the vertical through pivot_m, clockwise seen from above."},
    {MESH(pivot_m), CFG_VEC3, "m", "[0, 0, 0]", -1e9, 1e9, .help = "The point that it turns about."},
    {MESH(cycle_s), CFG_REAL, "s", "0", 0, 86400,
     .help = "The motion goes back and forth with this period; 0: it continues."},

    {"scene.target", .type = CFG_MAP, .help = "The objects that are scanned. Without this section all are."},
    {"scene.target.objects", .type = CFG_LIST, .min = 0, .max = CONFIG_MAX_OBJECTS,
     LIST_OF(scene.target.object, scene.target.n_objects), .help = "Objects by name."},
    {"scene.target.objects[]", 0, SCENE_NAME_LEN, CFG_TEXT, .def = "", .example = "Wall*",
     .help = "Name, which must fit an object. * stands for any characters and ? for one; \\* and \\? are the "
             "characters themselves."},
    {KEY(scene.target.others), CFG_ENUM, .def = "left_out",
     WORDS([OTHERS_LEFT_OUT] = "left_out", [OTHERS_HIDE] = "hide"),
     .help = "All other objects. left_out: they are not part of the scene, so they give no points and hide nothing; "
             "hide: they hide the surfaces behind them, and a pulse that hits them is a shot without echo."},

    {"scene.anchor", .type = CFG_MAP, .help = "How the scene lies on the Earth; all stations follow from it."},
    {KEY(scene.anchor.source), CFG_ENUM, .def = "none",
     WORDS([ANCHOR_NONE] = "none", [ANCHOR_EXPLICIT] = "explicit", [ANCHOR_IFC] = "ifc", [ANCHOR_UTM] = "utm",
           [ANCHOR_ECEF] = "ecef", [ANCHOR_GEOTIFF] = "geotiff"),
     .help = "none: each station has a place of its own; explicit: origin_m lies at lat_deg, lon_deg, height_m; ifc: "
             "as the IFC mesh's IFCMAPCONVERSION says, or else its IFCSITE; utm, ecef: the meshes' coordinates are "
             "UTM (or UPS), or ECEF; geotiff: as the system of the .tif says."},
    {KEY(scene.anchor.origin_m), CFG_VEC3, "m", "[0, 0, 0]", -1e9, 1e9,
     .help = "explicit: the scene's point that lies at lat_deg, lon_deg, height_m."},
    {KEY(scene.anchor.lat_deg), CFG_REAL, "deg", "", -90, 90, .example = "49.1",
     .help = "explicit: its latitude, WGS 84."},
    {KEY(scene.anchor.lon_deg), CFG_REAL, "deg", "", -180, 180, .example = "8.436", .help = "explicit: its longitude."},
    {KEY(scene.anchor.height_m), CFG_REAL, "m", "", -1000, 10000, .example = "110",
     .help = "Height above the ellipsoid. explicit: of origin_m; ifc: of the model, in place of the file's height "
             "above the sea; geotiff: of the raster's height 0."},
    {KEY(scene.anchor.north_deg), CFG_REAL, "deg", "0", -360, 360,
     .help = "explicit: direction of true north, clockwise from the scene's y axis."},
    {KEY(scene.anchor.utm_zone), CFG_COUNT, NULL, "", 0, 60, .example = "32",
     .help = "utm: zone of the meshes' coordinates; 0: UPS. Required with source: utm."},
    {"scene.anchor.hemisphere", IN_CONFIG(scene.anchor.north), CFG_ENUM, .def = "",
     .example = "north", WORDS("south", "north"),
     .help = "utm: hemisphere of the zone. Required with source: utm."},

    {"stations", .type = CFG_LIST, .min = 1, .max = CONFIG_MAX_STATIONS, LIST_OF(station, n_stations),
     .help = "Places where the head can stand."},
    {"stations[]", .type = CFG_MAP, .help = "A station."},
    {"stations[].name", offsetof(struct config_station, name), CONFIG_NAME_LEN, CFG_TEXT, .def = "",
     .example = "gate", .help = "Name; station-N when not given."},
    {STATION(position_m), CFG_VEC3, "m", "", -1e9, 1e9, .example = "[0, 0, 1.7]", .flags = CFG_NEEDED,
     .help = "The head's origin in the scene frame. Required, unless scene.anchor gives it from a place on Earth."},
    {STATION(instrument_height_m), CFG_REAL, "m", "", 0, 1000, .example = "1.7",
     .help = "Height of the head's origin above the first surface below its place. The search downward begins 1 cm "
             "above z (or height_m)."},
    {STATION(heading_deg), CFG_REAL, "deg", "0", -360, 360,
     .help = "Direction of the head's y axis, clockwise from the scene's y axis. That is north without scene.anchor, "
             "grid north with utm, true north with ecef."},
    {STATION(pitch_deg), CFG_REAL, "deg", "0", -90, 90,
     .help = "Rotation after the heading, about the head's x axis; positive: the y axis (forward) rises."},
    {STATION(roll_deg), CFG_REAL, "deg", "0", -180, 180,
     .help = "Rotation after the pitch, about the head's y axis; positive: the x axis (right) sinks."},
    {STATION(lat_deg), CFG_REAL, "deg", "", -90, 90, .example = "49.1",
     .help = "Geodetic latitude of the head's origin, WGS 84. A place on the Earth, in one form, is required without "
             "scene.anchor unless output.crs is local."},
    {STATION(lon_deg), CFG_REAL, "deg", "", -180, 180, .example = "8.436", .help = "Longitude; with lat_deg."},
    {STATION(height_m), CFG_REAL, "m", "", -1000, 10000, .example = "110",
     .help = "Height above the ellipsoid; with lat_deg or easting_m."},
    {STATION(utm_zone), CFG_COUNT, NULL, "", 0, 60, .example = "32",
     .help = "UTM zone, 0: UPS; with easting_m. When not given, it is the zone of a scene.anchor of source utm."},
    {"stations[].hemisphere", IN_STATION(north), CFG_ENUM, .def = "", .example = "north", WORDS("south", "north"),
     .help = "Hemisphere of the zone. When not given, it is that of a scene.anchor of source utm."},
    {STATION(easting_m), CFG_REAL, "m", "", -1e7, 1e7, .example = "458835",
     .help = "UTM or UPS easting of the head's origin, with false origin."},
    {STATION(northing_m), CFG_REAL, "m", "", -1e7, 2e7, .example = "5438800", .help = "Northing; with easting_m."},
    {STATION(ecef_m), CFG_VEC3, "m", "", -1e7, 1e7, .example = "[4138400, 613700, 4798000]",
     .help = "The head's origin in ECEF, WGS 84: X, Y, Z."},

    {"stations[].tripod", .type = CFG_MAP,
     .help = "Tripod of the head. Its legs open as the head is lowered; the area below the head between them is "
             "hidden."},
    {TRIPOD(leg_m), CFG_REAL, "m", "", 0.01, 100, .example = "1.8",
     .help = "Length of a leg. Required with the other keys. The cosine of the opening, from the vertical, is the "
             "top's height above the ground divided by leg_m."},
    {TRIPOD(opening_min_deg), CFG_REAL, "deg", "15", 0, 89,
     .help = "Smallest opening. Where the head is higher than the legs reach with it, the tripod hovers, which gives "
             "a warning."},
    {TRIPOD(head_above_m), CFG_REAL, "m", "0", 0, 100, .help = "The head's origin above the tripod's top."},
    {TRIPOD(cone), CFG_ENUM, .def = "auto",
     WORDS([CHOICE_AUTO] = "auto", [CHOICE_OFF] = "off", [CHOICE_ON] = "on"),
     .help = "on: pulses closer to straight down than the opening are shots without echo. auto: on where legs is off."},
    {TRIPOD(legs), CFG_BOOL, .def = "off",
     .help = "Three legs as a mesh: they hide the surfaces behind them, and points on them have the object tripod, "
             "material leg."},
    {TRIPOD(leg_diameter_m), CFG_REAL, "m", "0.03", 0.001, 1,
     .help = "legs: width of a leg, a prism of six sides, from edge to edge."},
    {TRIPOD(legs_heading_deg), CFG_REAL, "deg", "0", -360, 360,
     .help = "legs: direction of the first leg, clockwise from the scene's y axis; the others follow by 120 deg."},
    {"stations[].scanner", 0, sizeof(struct config_station), CFG_MAP, .example = "{}",
     .help = "The scanner of this station: sections head (without station, start), beam, cast (without sight_mib), "
             "plan, noise, signal, surfaces, optics, instrument with keys that differ from the file's. With its own "
             "head.profile it takes nothing from the file's head and instrument. --set "
             "stations.1.scanner.head.lines_hz=10 works, too."},

    {"platform", .type = CFG_MAP, .help = "What carries the head: a tripod, or something that moves."},
    {KEY(platform.kind), CFG_ENUM,
     .def = "static", WORDS([PLATFORM_STATIC] = "static", [PLATFORM_TRAJECTORY] = "trajectory", [PLATFORM_LIVE] =
     "live", [PLATFORM_STOPS] = "stops"),
     .help = "static: at the station; trajectory: along a file; stops: at poses of the file, where "
             "the platform stands; these are the scan's stations. Without a file, stops: at the stations, once for "
             "each time, while meshes move. live: at poses that a peer sends, by UDP or, with pace step, by "
             "TIME:STEP."},
    {KEY(platform.file), CFG_PATH, .def = "", .example = "path.csv", .of = ON_PATH,
     .help = "trajectory, stops: CSV with t_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg (or qw,qx,qy,qz), scene "
             "frame."},
    {KEY(platform.waypoints), CFG_PATH, .def = "", .example = "way.csv",
     .of = ON_PATH,
     .help = "trajectory, stops: CSV with x_m,y_m,z_m,speed_m_s[,pause_s] in place of file. The heading follows the "
             "path. The platform is level, like a station there with pitch and roll 0. The path is a smooth curve, and "
             "speed_m_s the straight distance to the next point per time."},
    {KEY(platform.start_s), CFG_REAL, "s", "0", 0, 1e9, .of = ON_PATH,
     .help = "trajectory, stops: start of a scan, or the first stop, on the trajectory: seconds after its first "
             "sample."},
    {KEY(platform.end_s), CFG_REAL, "s", "0", 0, 1e9, .of = ON_PATH,
     .help = "trajectory, stops: end of a scan, or of the stops, in the same way; the last sample when not given. "
             "Required for stops without a trajectory."},
    {KEY(platform.step_s), CFG_REAL, "s", "0", 0, 1e9, .of = CFG_KIND(PLATFORM_STOPS),
     .help = "stops: time from each stop to the next, up to end_s. Required with kind: stops, unless frames_per_s "
             "is given."},
    {KEY(platform.frames_per_s), CFG_REAL, "1/s", "0", 0, 1e6, .example = "25", .of = CFG_KIND(PLATFORM_STOPS),
     .help = "stops: first_frame, last_frame and frame_step give the times of the stops, in place of start_s, end_s "
             "and step_s. Frame 0 is at the trajectory's first sample, or at time 0. The points' frame scalar "
             "counts in the same way."},
    {KEY(platform.first_frame), CFG_REAL, NULL, "0", 0, 1e9, .of = CFG_KIND(PLATFORM_STOPS),
     .help = "stops, with frames_per_s: frame of the first stop."},
    {KEY(platform.last_frame), CFG_REAL, NULL, "0", 0, 1e9, .of = CFG_KIND(PLATFORM_STOPS),
     .help = "stops, with frames_per_s: no stop is after this frame; the trajectory's last sample when not given."},
    {KEY(platform.frame_step), CFG_REAL, NULL, "1", 1e-6, 1e9, .of = CFG_KIND(PLATFORM_STOPS),
     .help = "stops, with frames_per_s: frames from each stop to the next."},
    {KEY(platform.at_end), CFG_ENUM, .def = "stop", WORDS([PLATFORM_STOP] = "stop", [PLATFORM_HOLD] = "hold"),
     .of = CFG_KIND(PLATFORM_TRAJECTORY),
     .help = "trajectory: at its end the scan stops, or the platform holds its last pose."},
    {KEY(platform.mount_m), CFG_VEC3, "m", "[0, 0, 0]", -1000, 1000, .of = ~CFG_KIND(PLATFORM_STATIC),
     .help = "The head's origin on the platform: right, forward, up."},
    {KEY(platform.mount_heading_deg), CFG_REAL, "deg", "0", -360, 360, .of = ~CFG_KIND(PLATFORM_STATIC),
     .help = "Heading of the head on the platform, clockwise; then pitch, then roll."},
    {KEY(platform.mount_pitch_deg), CFG_REAL, "deg", "0", -90, 90, .of = ~CFG_KIND(PLATFORM_STATIC),
     .help = "Positive: nose up."},
    {KEY(platform.mount_roll_deg), CFG_REAL, "deg", "0", -360, 360, .of = ~CFG_KIND(PLATFORM_STATIC),
     .help = "Positive: right side down."},
    {KEY(platform.reach_m), CFG_REAL, "m", "100", 1, 1e5, .of = CFG_KIND(PLATFORM_LIVE),
     .help = "live: largest distance of the platform from the station of head.station."},
    {KEY(platform.extrapolate_ms), CFG_REAL, "ms", "100", 0, 10000, .of = CFG_KIND(PLATFORM_LIVE),
     .help = "live: how long the motion between the last two poses is continued after the last one. After that the "
             "platform stands, and its poses count as late. Between two poses it moves evenly."},
    {KEY(platform.address), CFG_TEXT, .def = "127.0.0.1", .of = CFG_KIND(PLATFORM_LIVE),
     .help = "live, in real time: address where poses arrive by UDP, as lines of t_s x y z roll pitch heading, up "
             "to 3600 s and 65536 poses ahead of device time."},
    {KEY(platform.port), CFG_COUNT, NULL, "0", 0, 65535, .of = CFG_KIND(PLATFORM_LIVE),
     .help = "live: its port; 0: the system chooses."},
    /* clang-format on */
