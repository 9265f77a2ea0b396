/* SPDX-License-Identifier: MIT */
/* The table of a configuration's keys; profile_keys.c has that of head profiles. A row has the key's path,
 * type, unit, default, limits and member of struct config. Parsing, defaults, errors, --set and `scanhead
 * check --help` come from the rows alone. Checks of more than one key are in the files that check.h and check_*.h
 * name. */
#include "core/cast.h"
#include "drivers/protocol/protocol.h"
#include "drivers/usb/backend.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/keys.h"
#include "firmware_sim/config/table/row.h"

/* The beginning of a row: path, offset and size. Where path and member have different names, the row writes the path
 * itself. */
#define IN_CONFIG(member)  CFG_MEMBER(struct config, member)
#define IN_STATION(member) CFG_MEMBER(struct config_station, member)
#define SETTING(member)    IN_CONFIG(head.settings.member)
#define KEY(member)        #member, IN_CONFIG(member)
#define MESH(member)       "scene.meshes[]." #member, CFG_MEMBER(struct config_mesh, member)
#define STATION(member)    "stations[]." #member, IN_STATION(member)
#define TRIPOD(member)     "stations[].tripod." #member, IN_STATION(tripod.member)
#define LINK(member)       "links[]." #member, CFG_MEMBER(struct link_spec, member)
#define FIELD(member)      "fields[]." #member, CFG_MEMBER(struct config_field, member)
#define INPUT(member)      "inputs[]." #member, CFG_MEMBER(struct config_input, member)
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

/* The links that have an address and a port, and the back ends of USB that have them. */
#define NETWORK (CFG_KIND(LINK_TCP) | CFG_KIND(LINK_USB) | CFG_KIND(LINK_UDP) | CFG_KIND(LINK_WEB))
#define SOCKETS (CFG_KIND(USB_BACKEND_USBIP) | CFG_KIND(USB_BACKEND_USBREDIR))
/* The platforms with a trajectory. */
#define ON_PATH (CFG_KIND(PLATFORM_TRAJECTORY) | CFG_KIND(PLATFORM_STOPS))

/* clang-format off */
#define FAULT_LIST_AT(member) offsetof(struct config, faults.member)
static const struct cfg_key config_keys[] = {
    {"head", .type = CFG_MAP, .help = "The head and its settings at power-up."},
    {"head.profile", IN_CONFIG(profile_file), CFG_TEXT, .example = "riegl-vz400i",
     .allowed = "the name of a profile, or a path that ends in .yaml",
     .help = "Head profile, from $SCANHEAD_HEADS, heads/ beside this file, ../share/scanhead/heads or ../config/heads "
             "from the program's folder, or config/heads from the working directory."},
    {KEY(head.serial), CFG_TEXT, .def = "SIM-0001", .flags = CFG_ASCII, .help = "Serial number, as in *IDN?."},
    {"head.prr_hz", SETTING(prr_uhz), CFG_MICRO, "Hz", "@prr_max_hz", WITHIN("prr_min_hz", "prr_max_hz"),
     .help = "Pulse repetition rate. It counts every firing, also those in the blind part of a sweep. It follows from "
             "lines_hz where a line has a fixed number of pulses, and from the firing sequence of beams."},
    {"head.lines_hz", SETTING(lines_uhz), CFG_MICRO, "Hz", "@lines_max_hz", WITHIN("lines_min_hz", "lines_max_hz"),
     .help = "Lines per second, at most one per pulse. Turns per second of a planar or a spinning head."},
    {"head.pan_deg_s", SETTING(pan_udeg_s), CFG_MICRO, "deg/s", "@pan_max_deg_s", 0, 9e12, NULL, "pan_max_deg_s",
     .help = "Pan speed. 0: the pan stands still, and each line counts as a frame (a pan sweep)."},
    {"head.line_start_deg", SETTING(line_start_udeg), CFG_MICRO, "deg", "@fov_min_deg",
     WITHIN("fov_min_deg", "fov_max_deg"), .help = "First line angle cast: 0 forward, 90 up, above 90 backward. A "
             "planar head counts it from its front step, in the direction of its steps. For beams and spheres it is "
             "an azimuth, 0 to 360."},
    {"head.line_stop_deg", SETTING(line_stop_udeg), CFG_MICRO, "deg", "@fov_max_deg",
     WITHIN("fov_min_deg", "fov_max_deg"), .help = "Last line angle cast, above the first one. On a sphere it may be "
             "below: 350 to 10 goes across 0."},
    {"head.step_deg", IN_CONFIG(head.step_udeg), CFG_MICRO, "deg", "", 0.01, 90, .example = "0.1",
     .help = "sphere: angle from pulse to pulse and from ring to ring, in place of the profile's. It is rounded to "
             "whole steps of a turn and of half a turn; a warning gives the rounded step. planar: one of the "
             "profile's geometries."},
    {"head.ring_start_deg", IN_CONFIG(head.ring_start_udeg), CFG_MICRO, "deg", "-90", -90, 90,
     .help = "sphere: elevation of the lowest ring. Rings outside of the limits are not scanned and take no time."},
    {"head.ring_stop_deg", IN_CONFIG(head.ring_stop_udeg), CFG_MICRO, "deg", "90", -90, 90,
     .help = "sphere: elevation of the highest ring. If it equals ring_start_deg there is one ring, a circle."},
    {"head.pan_start_deg", SETTING(pan_start_udeg), CFG_MICRO, "deg", "@pan_min_deg",
     WITHIN("pan_min_deg", "pan_max_deg"), .help = "Pan angle where a frame (a pan sweep) starts."},
    {"head.pan_stop_deg", SETTING(pan_stop_udeg), CFG_MICRO, "deg", "@pan_max_deg",
     WITHIN("pan_min_deg", "pan_max_deg"), .help = "Pan angle where a frame ends; at most a turn after its start."},
    {KEY(head.range_min_m), CFG_REAL, "m", "@range_min_m", 0, 1e5,
     .allowed = "range_min_m to range_max_m of the head profile, in m",
     .help = "Pulses that hit something nearer are shots without echo. A larger limit that the profile has for a "
             "pulse rate replaces this one."},
    {KEY(head.range_max_m), CFG_REAL, "m", "@range_max_m", 0, 1e5,
     .allowed = "range_min_m to range_max_m of the head profile, in m",
     .help = "Pulses that hit something farther are shots without echo. The descriptor on the wire has these limits."},
    {"head.frames", SETTING(frames), CFG_COUNT, NULL, "1", 0, HEAD_MAX_FRAMES,
     .help = "Frames (pan sweeps, or turns of a head without a pan) per scan; 0: until stopped."},
    {"head.station", SETTING(station), CFG_COUNT, NULL, "1", 1, CONFIG_MAX_STOPS,
     .help = "Station where the head stands, counted from 1."},

    {"head.phase_lock", SETTING(phase_lock), CFG_ENUM, .def = "off",
     WORDS([0] = "off", [1] = "on"),
     .help = "beams: holds the rotor's phase. At each PPS pulse the rotor is at phase_deg, while the head is locked to "
             "PPS. It needs a whole number of turns per second (lines_hz)."},
    {"head.phase_deg", SETTING(phase_udeg), CFG_MICRO, "deg", "0", 0, 359.999999,
     .help = "Azimuth of the rotor at a PPS pulse, with phase_lock: on."},
    {KEY(head.motor_ppm), CFG_REAL, "ppm", "0", -10000, 10000,
     .help = "beams: how much too fast the rotor turns while nothing holds its phase. At lines_max_hz a turn must "
             "still be as long as a firing sequence (firing_ns)."},
    {KEY(head.ambiguity), CFG_ENUM, .def = "none",
     WORDS([DETECT_AMBIGUITY_NONE] = "none", [DETECT_FOLDED] = "folded", [DETECT_RESOLVED] = "resolved"),
     .help = "Echoes from beyond c / (2 prr_hz), which return after the next pulse. none: they have their true range; "
             "folded: their range is shorter by whole zones; resolved: they have their true range, within mta_zones. "
             "folded and resolved lose echoes that return within range_min_m after a pulse."},
    {KEY(head.mta_zones), CFG_COUNT, NULL, "8", 1, 1000,
     .help = "resolved: number of zones of c / (2 prr_hz) that the head can resolve; it detects nothing beyond them."},
    {KEY(head.name), CFG_TEXT, .def = "", .example = "north-gate", .flags = CFG_ASCII,
     .help = "The user's name of the head, for protocols that can ask for it (cola: LocationName)."},
    {KEY(head.settings_file), CFG_PATH, .def = "", .flags = CFG_WRITTEN, .example = "settings.txt",
     .help = "File for settings that clients store, so that they survive a power cycle and a new start: HEAD:STORe, "
             "and the store commands of other protocols. They are then the settings of power-up, in place of those "
             "here. Without it nothing is stored. `scanhead run` alone reads and writes it."},
    {KEY(head.start), CFG_BOOL, .def = "off",
     .help = "on: `scanhead run` scans at once when the head has booted, as with --start."},

#include "firmware_sim/config/place_rows.h"

    {"output", .type = CFG_MAP, .help = "Form of the points."},
    {KEY(output.crs), CFG_ENUM, .def = "local",
     WORDS([GEOREF_LOCAL] = "local", [GEOREF_ECEF] = "ecef", [GEOREF_UTM] = "utm", [GEOREF_GEODETIC] = "geodetic"),
     .help = "Coordinate reference system of the anchor and of geo points."},
    {KEY(output.utm_zone), CFG_COUNT, NULL, "0", 0, 60,
     .help = "UTM zone, only with crs: utm; 0: that of a scene in UTM, else by position, UPS near the poles."},
    {KEY(output.layout), CFG_ENUM, .def = "polar", WORDS([LINE_POLAR] = "polar", [LINE_GEO] = "geo"),
     .help = "polar: range and encoder angles, as a head measures; geo: coordinates relative to the anchor."},
    {KEY(output.heights), CFG_ENUM, .def = "ellipsoid",
     WORDS([HEIGHTS_ELLIPSOID] = "ellipsoid", [HEIGHTS_GEOID] = "geoid", [HEIGHTS_AUTO] = "auto"),
     .help = "Heights of utm and geodetic points. geoid needs GeographicLib's data; auto uses them where they are "
             "installed."},
    {KEY(output.tolerance_m), CFG_REAL, "m", "", 1e-7, 1, .example = "1e-6",
     .help = "Largest error that georeferencing adds to a point; the cheapest method that keeps it is used. When not "
             "given: a thousandth of plan.tolerance_m, but at least 1e-7 m."},
    {KEY(output.georef), CFG_ENUM, .def = "auto",
     WORDS([GEOREF_AUTO] = "auto", [GEOREF_EXACT] = "exact", [GEOREF_ORDER1] = "order1", [GEOREF_ORDER2] = "order2",
           [GEOREF_ORDER3] = "order3", [GEOREF_ORDER5] = "order5"),
     .help = "Method of utm and geodetic points; auto: as `scanhead plan` says."},
    {KEY(output.attributes), CFG_BOOL, .def = "off",
     .help = "on: each points frame is followed by one with amplitude (needs signal.model: on) and width of its "
             "echoes, 4 bytes a point (6 where waveform.echoes is not model); .ply and .las recordings have them."},
    {KEY(output.colour), CFG_ENUM, .def = "none",
     WORDS([COLOUR_NONE] = "none", [COLOUR_SOLID] = "solid", [COLOUR_RANGE] = "range", [COLOUR_HEIGHT] = "height",
           [COLOUR_REFLECTANCE] = "reflectance", [COLOUR_LABEL] = "label", [COLOUR_FRAME] = "frame",
           [COLOUR_TEXTURE] = "texture"),
     .help = "Colours of points. With any value but none each points frame is followed by one with 3 bytes a point; "
             "recordings have them. range, height, frame (of a trajectory or stops): blue, green, yellow, red "
             "between two limits; reflectance: grey, -30 to 0 dB; label: a hue for each surface; texture: the texel "
             "that is hit; without a texture the mesh's colour, without a colour grey."},
    {KEY(output.colour_rgb), CFG_VEC3, NULL, "[255, 255, 255]", 0, 255,
     .help = "solid: the colour, as red, green and blue, whole numbers."},
    {KEY(output.colour_limits), CFG_PAIR, NULL, "", -1e9, 1e9, .example = "[0, 30]",
     .help = "Limits of colour: range (m), height (m, z of the scene's frame) or frame. Not given: a stream takes the "
             "head's range limits, the scene's lowest and highest point, the first and last frame of the trajectory; "
             "a recording the smallest and largest value in it."},
    {KEY(output.scale_m), CFG_REAL, "m", "0", 0, 1, .allowed = "0 (automatic) or 1e-6 to 1 m",
     .help = "Metres per count of a range. A count of a coordinate is at most this long; only one of longitude near a "
             "pole may be longer. The largest range must fit into 32 bits, a coordinate into 31. automatic: 1e-6 m "
             "for ranges up to 4294 m (geo: 2147 m), ten times as much for each tenfold range."},

    {"links", .type = CFG_LIST, .min = 0, .max = CONFIG_MAX_LINKS, LIST_OF(link, n_links),
     .help = "Links by which clients reach the head; recording off line needs none."},
    {"links[]", .type = CFG_MAP, .help = "A link."},
    {LINK(type), CFG_ENUM, .example = "tcp",
     WORDS([LINK_NULL] = "null", [LINK_FILE] = "file", [LINK_PTY] = "pty", [LINK_TCP] = "tcp", [LINK_USB] = "usb",
           [LINK_UDP] = "udp", [LINK_WEB] = "web"),
     .help = "Kind of link; web: a page for a browser, which shows the scan and sets the head."},
    {LINK(protocol), CFG_ENUM, .def = "native",
     WORDS([PROTOCOL_NATIVE] = "native", [PROTOCOL_NMEA] = "nmea", [PROTOCOL_SCIP] = "scip", [PROTOCOL_COLA] = "cola",
           [PROTOCOL_VELODYNE] = "velodyne", [PROTOCOL_VELODYNE_POSITION] = "velodyne-position",
           [PROTOCOL_VELODYNE_HTTP] = "velodyne-http", [PROTOCOL_CAPTURE] = "capture"),
     .allowed = "native, nmea, scip, cola, velodyne, velodyne-position, velodyne-http; with `run FILE.pcap`: capture",
     .help = "native: the head's own stream and commands; nmea: the GNSS receiver, which sends NMEA 0183 and takes no "
             "commands; scip: as a Hokuyo; cola: as a SICK scanner, CoLa-A and CoLa-B; velodyne: data packets, "
             "velodyne-position: position packets, velodyne-http: settings, as a VLP-16; capture: what a device said, "
             "only with `run FILE.pcap`."},
    {LINK(dialect), CFG_ENUM, .def = "any",
     WORDS([PROTOCOL_DIALECT_ANY] = "any", [PROTOCOL_COLA_A] = "cola-a", [PROTOCOL_COLA_B] = "cola-b"),
     .help = "cola: any: each request is answered in its own dialect. cola-a, cola-b: the link understands that one "
             "alone, until EIHstCola changes it."},
    {LINK(path), CFG_PATH, .def = "", .flags = CFG_WRITTEN, .example = "port",
     .of = CFG_KIND(LINK_FILE) | CFG_KIND(LINK_PTY) | CFG_KIND(LINK_USB), .of_backend = CFG_KIND(USB_BACKEND_USBREDIR),
     .help = "pty: symbolic link to the terminal (optional); file: file to write (required); usbredir: Unix socket, "
             "instead of a port."},
    {LINK(baud), CFG_COUNT, NULL, "0", 0, 4000000, .example = "115200", .of = CFG_KIND(LINK_PTY),
     .help = "pty: bit rate of the head's serial port. Where a client sets another rate, each side reads the other's "
             "bytes as a UART at the wrong rate does. 0: any rate will do."},
    {LINK(address), CFG_TEXT, .def = "", .example = "127.0.0.1",
     .of = NETWORK, .of_backend = SOCKETS,
     .help = "tcp, usb, web: address to listen on, or with attach to connect to; udp: where the packets go. 127.0.0.1 "
             "when not given."},
    {LINK(port), CFG_COUNT, NULL, "0", 0, 65535,
     .of = NETWORK, .of_backend = SOCKETS,
     .help = "tcp, usb, web: port; 0: the system chooses; usbip, when not given: 3240. udp: the receiver's "
             "(required)."},
    {LINK(interface), CFG_TEXT, .def = "", .example = "eth1", .of = CFG_KIND(LINK_UDP),
     .help = "udp: the packets' source is this interface's address. Required where they are broadcast, to "
             "255.255.255.255 or to its own broadcast address, and where they go to a multicast group. For packets to "
             "other addresses the system's routes still choose the interface, since only a program with privileges can "
             "bind a socket to an interface."},
    {LINK(source), CFG_TEXT, .def = "", .example = "192.168.1.201", .of = CFG_KIND(LINK_UDP),
     .help = "udp: numeric address of this machine that packets come from, so that receivers can distinguish heads. "
             "When not given: the interface's, or as the system chooses. If this gives the receiver's own address "
             "and port on the IPv4 loopback, packets come from the next address, such as 127.0.0.2 after 127.0.0.1."},
    {LINK(source_port), CFG_COUNT, NULL, "0", 0, 65535, .of = CFG_KIND(LINK_UDP),
     .help = "udp: port that packets come from; 0: the system chooses. When not given: velodyne 2368, "
             "velodyne-position 8308, as the device's. If that port is taken, another one is used, with a warning. For "
             "a receiver on this machine the system chooses where neither source nor interface is given. A receiver "
             "that listens on the same port at all addresses must share it (SO_REUSEADDR)."},
    {LINK(ttl), CFG_COUNT, NULL, "", 1, 255, .example = "4", .of = CFG_KIND(LINK_UDP),
     .help = "udp: time to live of the packets, in networks. When not given: 1 to a multicast group, else the "
             "system's."},
    {LINK(max_sessions), CFG_COUNT, NULL, "4", 1, LINK_MAX_SESSIONS, .of = CFG_KIND(LINK_TCP) | CFG_KIND(LINK_WEB),
     .help = "tcp, web: clients at a time; scip, when not given: 1."},
    {LINK(waits), CFG_ENUM, .def = "by-type",
     WORDS([LINK_WAITS_BY_TYPE] = "by-type", [LINK_WAITS_YES] = "yes", [LINK_WAITS_NO] = "no"),
     .help = "Whether a slow reader holds back the head in the paces fast and step. yes: it does; no: it loses "
             "frames, as in real time; by-type: readers of web links lose frames, all others hold the head back."},
    {LINK(latency_ms), CFG_COUNT, "ms", "0", 0, 20, .of = ~(CFG_KIND(LINK_NULL) | CFG_KIND(LINK_FILE)),
     .help = "How long a stream frame may wait for later ones in real time, so that one wake-up and one write serve "
             "several ticks. That takes less processor time. 0: a frame goes out with its tick. A frame never waits "
             "longer than an eighth of loop.queue_ms. Null and file links have no such key: their frames always wait "
             "that eighth."},
    {LINK(backend), CFG_ENUM, .def = "usbip",
     WORDS([USB_BACKEND_USBIP] = "usbip", [USB_BACKEND_USBREDIR] = "usbredir", [USB_BACKEND_FUNCTIONFS] = "functionfs"),
     .of = CFG_KIND(LINK_USB),
     .help = "usb: how the device reaches a host."},
    {LINK(attach), CFG_BOOL, .def = "off",
     .of = CFG_KIND(LINK_USB), .of_backend = SOCKETS,
     .help = "usbip: plugs into this machine's vhci_hcd; usbredir: connects to the guest's socket instead of "
             "listening. Both do so again whenever the host disconnects."},
    {LINK(udc), CFG_TEXT, .def = "", .example = "dummy_udc.0",
     .of = CFG_KIND(LINK_USB), .of_backend = CFG_KIND(USB_BACKEND_FUNCTIONFS),
     .help = "functionfs: USB device controller; when not given, the first free one."},
    {LINK(speed), CFG_ENUM, .def = "high",
     WORDS([USB_RATE_FULL] = "full", [USB_RATE_HIGH] = "high", [USB_RATE_SUPER] = "super"), .of = CFG_KIND(LINK_USB),
     .help = "usb: full (12 Mbit/s), high (480) or super (5000): the fastest that the device offers."},
    {LINK(vid), CFG_COUNT, NULL, "0x1209", 1, 65535, .flags = CFG_HEX, .allowed = "0x0001 to 0xffff",
     .of = CFG_KIND(LINK_USB),
     .help = "usb: vendor id. When not given, it depends on the protocol: native 0x1209 (with pid 0x0001 set aside for "
             "private tests), scip 0x15d1, cola 0x19a2."},
    {LINK(pid), CFG_COUNT, NULL, "0x0001", 0, 65535, .flags = CFG_HEX, .allowed = "0x0000 to 0xffff",
     .of = CFG_KIND(LINK_USB),
     .help = "usb: product id. When not given: native 0x0001, scip 0x0000, cola 0x5001."},
    {LINK(serial), CFG_TEXT, .def = "", .example = "SIM-0002", .flags = CFG_ASCII, .of = CFG_KIND(LINK_USB),
     .help = "usb: serial number. When not given: head.serial where that is given, else SIM-0001 and eight "
             "hexadecimal digits that identify this head on this machine; with scip none, as the real device. Only the "
             "USB device has these digits, not *IDN?."},

#include "firmware_sim/config/measurement_rows.h"

#include "firmware_sim/config/field_rows.h"

    {"loop", .type = CFG_MAP, .help = "The fixed-rate loop."},
    {KEY(loop.tick_hz), CFG_REAL, "Hz", "1000", 100, 10000,
     .allowed = "a divisor of 1e9 from 100 to 10000 Hz, such as 500, 1000, 2000",
     .help = "Rate of the loop. Its ticks cut the stream into stream frames, so another rate gives another hash of the "
             "stream. The points are the same, with two exceptions. A live platform has one pose per tick. Meshes that "
             "move stand still during each tick, where they are at its start."},
    {KEY(loop.ahead_ms), CFG_REAL, "ms", "64", 2, 90,
     .help = "How far casting runs ahead of the beam; a command takes that long to reach the beam. Off line it is "
             "256 ms at least."},
    {KEY(loop.queue_ms), CFG_REAL, "ms", "250", 10, 10000,
     .help = "How much of the stream is stored for a link whose reader is slow."},
    {KEY(loop.late_ms), CFG_REAL, "ms", "100", 0, 10000,
     .help = "With pace: realtime, blocks of points that are later than this are not sent: their pulses are lost, "
             "counted and announced."},
    {KEY(loop.threads), CFG_COUNT, NULL, "0", 0, CONFIG_MAX_THREADS, .help = "Casting threads; 0: one per processor."},
    {KEY(loop.pace), CFG_ENUM, .def = "realtime",
     WORDS([PACE_REALTIME] = "realtime", [PACE_FAST] = "fast", [PACE_STEP] = "step"),
     .help = "realtime: by the clock; fast: as fast as it computes; step: a client grants time."},

    {"time", .type = CFG_MAP,
     .help = "Time of day (UTC and PPS), and errors of the head's clock for tests of synchronisation."},
    {KEY(time.epoch), CFG_TEXT, .def = "none",
     .allowed = "none, utc, tai, or a time after 1980-01-06 such as 2026-01-01T00:00:00Z",
     .help = "Time of power-up: a date (UTC), or utc or tai for the system's clock at that moment; none: the head "
             "doesn't know the time of day."},
    {KEY(time.offset_s), CFG_REAL, "s", "0", -1e6, 1e6,
     .help = "The head's clock is ahead of the true time by this much. It shows in UTC, GPS time and PPS of the head, "
             "not in those of the receiver."},
    {KEY(time.drift_ppm), CFG_REAL, "ppm", "0", -1000, 1000,
     .help = "The head's clock runs fast by this, from power-up."},
    {KEY(time.jump_s), CFG_REAL, "s", "0", -1e6, 1e6, .help = "The head's clock jumps ahead by this, once."},
    {KEY(time.jump_at_s), CFG_REAL, "s", "0", 0, 1e8, .help = "Time of the jump, after power-up."},
    {"time.ptp", .type = CFG_MAP,
     .help = "A PTP follower that disciplines the head's clock. No PTP messages are on any network: master and path "
             "are simulated. It needs time.epoch."},
    {KEY(time.ptp.follower), CFG_BOOL, .def = "off", .help = "The head's clock follows a PTP master, which has the "
                                                            "true time."},
    {KEY(time.ptp.grandmaster), CFG_COUNT, NULL, "0x00b0aefffe000001", 1, 18446744073709551615.0, .flags = CFG_HEX,
     .allowed = "0x1 to 0xffffffffffffffff", .help = "The grandmaster's identity, an EUI-64."},
    {KEY(time.ptp.clock_class), CFG_COUNT, NULL, "6", 0, 255,
     .help = "The grandmaster's clock class by IEEE 1588: 6 follows a primary reference, 7 is in holdover, 248 is the "
             "default."},
    {KEY(time.ptp.clock_accuracy), CFG_COUNT, NULL, "0x21", 0, 255, .flags = CFG_HEX, .allowed = "0x00 to 0xff",
     .help = "The grandmaster's clock accuracy by IEEE 1588: 0x21 is within 100 ns, 0xfe is unknown."},
    {KEY(time.ptp.utc_valid), CFG_BOOL, .def = "on", .help = "The master says that its offset to UTC is valid."},
    {KEY(time.ptp.announce_ms), CFG_COUNT, "ms", "2000", 100, 64000,
     .help = "Time between Announce messages. The second one selects a master. Without an Announce for 3 of these "
             "times the master is lost."},
    {KEY(time.ptp.sync_ms), CFG_COUNT, "ms", "1000", 250, 64000,
     .help = "Time between Sync messages. At each the follower measures its offset and corrects its rate."},
    {KEY(time.ptp.path_delay_ns), CFG_COUNT, "ns", "0", 0, 1e9, .help = "Mean delay of the two ways, as reported."},
    {KEY(time.ptp.asymmetry_ns), CFG_REAL, "ns", "0", -1e9, 1e9,
     .help = "The way from the master is longer than the mean by this much; the head's clock ends up that late."},
    {KEY(time.ptp.jitter_ns), CFG_COUNT, "ns", "0", 0, 1e9,
     .help = "Largest random deviation of a measurement to either side (noise.seed)."},
    {KEY(time.ptp.first_step_threshold_ns), CFG_COUNT, "ns", "20000", 0, 1e15,
     .help = "Before its first lock the servo steps the clock where the offset is larger; 0: only "
             "step_threshold_ns decides."},
    {KEY(time.ptp.step_threshold_ns), CFG_COUNT, "ns", "0", 0, 1e15,
     .help = "At any time the servo steps the clock where the offset is larger; a locked servo unlocks first. 0: "
             "after the first lock it slews."},
    {KEY(time.ptp.max_ppm), CFG_REAL, "ppm", "500", 1, 100000, .help = "The most that the servo changes the rate."},

    {"gnss", .type = CFG_MAP,
     .help = "The GNSS receiver, which sends on links of protocol nmea. Such a link needs time.epoch."},
    {KEY(gnss.rate_hz), CFG_COUNT, "Hz", "1", 1, 20, .allowed = "1, 2, 4, 5, 10 or 20 Hz",
     .help = "Positions per second."},
    {KEY(gnss.talker), CFG_ENUM, .def = "GN", WORDS([TALKER_GN] = "GN", [TALKER_GP] = "GP"),
     .help = "First letters (talker) of its sentences."},
    {KEY(gnss.quality), CFG_COUNT, NULL, "1", 0, 5,
     .allowed = "0 none, 1 autonomous, 2 differential, 4 RTK fixed, 5 RTK float",
     .help = "Quality of the fix, as in GGA."},
    {KEY(gnss.satellites), CFG_COUNT, NULL, "12", 0, 99, .help = "Satellites used, as in GGA."},
    {KEY(gnss.hdop), CFG_REAL, NULL, "0.7", 0.1, 99.9, .help = "Horizontal dilution of precision."},
    {KEY(gnss.accuracy_m), CFG_REAL, "m", "0", 0, 1000,
     .help = "One sigma of the noise east, north and up, independent from position to position; reproducible by "
             "noise.seed. 0: exact."},
    {KEY(gnss.lever_arm_m), CFG_VEC3, "m", "[0, 0, 0]", -100, 100,
     .help = "Position of the antenna relative to the head's origin, in the head's coordinate frame: right, forward, "
             "up."},
    {KEY(gnss.geoid_separation_m), CFG_REAL, "m", "0", -120, 120,
     .help = "Height of the geoid above the ellipsoid: altitude in GGA is the ellipsoidal height minus this."},
    {KEY(gnss.pps), CFG_BOOL, .def = "on",
     .help = "Its PPS pulses reach the head. off: no pulse ever does. For a loss of limited time use the fault "
             "pps_lost."},
    {KEY(gnss.nmea), CFG_BOOL, .def = "on",
     .help = "It sends sentences. off: it never does. For a loss of limited time use the fault nmea_lost."},
    {KEY(gnss.nmea_late_ms), CFG_REAL, "ms", "0", 0, 5000,
     .help = "Delay of a sentence after the time that it reports, at clients and at the head."},
    {KEY(gnss.cold), CFG_BOOL, .def = "off",
     .help = "on: the run begins with a head that has had no pulse and no sentence, and a VLP-16 counts from power-up; "
             "off: it was synchronised before. After a power cycle it always begins cold."},

#include "firmware_sim/config/ntp_rows.h"
#include "firmware_sim/config/fault_rows.h"
};
/* clang-format on */

_Static_assert(CFG_LEN(config_keys) <= CFG_MAX_ROWS, "room for every row");
_Static_assert((int)CONFIG_MAX_MESHES <= (int)CFG_MAX_ITEMS && (int)CONFIG_MAX_STATIONS <= (int)CFG_MAX_ITEMS &&
                   (int)CONFIG_MAX_LINKS <= (int)CFG_MAX_ITEMS && (int)CONFIG_MAX_SURFACES <= (int)CFG_MAX_ITEMS &&
                   (int)FAULT_MAX <= (int)CFG_MAX_ITEMS,
               "room for every element");

const struct cfg_table cfg_config_table = {config_keys, CFG_LEN(config_keys)};
