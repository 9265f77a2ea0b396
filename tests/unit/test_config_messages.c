/* SPDX-License-Identifier: MIT */
/* Diagnostics of checks between keys, each compared whole: file, line, key, what is wrong, and all numbers of what is
 * allowed. The numbers were worked out by hand from config/heads and from the rows of the keys. */
#include "tests/unit/config_rig.h"

static void expect_at(int line, const char *key, const char *text)
{
    char place[200];
    snprintf(place, sizeof place, "%s:%d: ", config_path, line);
    expect_only(place, key, text);
}

/* clang-format off */
#define RATES "allowed 100000 to 1200000 Hz"
#define AT_16(text) "output:", text "\noutput:"
#define AT_17(text) "crs: local", text
#define AT_12(text) "heading_deg: 90", text
#define ANCHOR(text) "scene:\n", "scene:\n  anchor: {" text "}\n"
#define STOPS "platform:\n  kind: stops\n  file: a\n"
#define WAVES "signal: {model: on}\nwaveform: {send: on, "
#define FRAMES "with platform.frames_per_s the stops are given in frames; allowed is platform."
#define NO_FRAMES "frames need platform.frames_per_s; allowed above 0, up to 1e6"
#define NO_MOUNT "without a trajectory the head is at its station; allowed is stations[]"
#define UTM_TOGETHER "missing, and utm_zone, hemisphere, easting_m, northing_m, height_m go together; required, "
#define FORMS "; allowed one of lat_deg with lon_deg, easting_m with northing_m, ecef_m"
#define ENDINGS ".obj .ply .stl .gltf .glb .fbx .dae .ifc .tif .tiff"
static const struct {
    const char *old, *with;
    int line;
    const char *key, *text;
} edits[] = {
    /* values of other kinds */
    {PRR, "  prr_hz: [1]\n", 3, "head.prr_hz", "here stands a list; " RATES},
    {PRR, "  prr_hz: {a: 1}\n", 3, "head.prr_hz", "here stands a section with keys; " RATES},
    {PRR, "  prr_hz:\n", 3, "head.prr_hz", "here stands nothing; " RATES},
    {PRR, "  prr_hz: \"5\"\n", 3, "head.prr_hz", "\"5\" is a text in quotes or of several lines; " RATES},
    {PRR, "  prr_hz: !!int 5\n", 3, "head.prr_hz", "\"5\" is a value with a tag, which is not supported; " RATES},
    {PRR, "  prr_hz: 500000.0000001\n", 3, "head.prr_hz", "\"500000.0000001\" is finer than 6 decimals; " RATES},
    {PRR, "  prr_hz: 1e30\n", 3, "head.prr_hz", "\"1e30\" is out of range; " RATES},
    {PRR, "  prr_hz: 5 kHz\n", 3, "head.prr_hz", "\"5 kHz\" is not a number; " RATES},
    {"[1, 2, 3]", "[1, 2]", 11, "stations[0].position_m", "has 2 numbers instead of 3; allowed [x, y, z], each -1000000000 to 1000000000 m"},
    {"[1, 2, 3]", "[1, [2], 3]", 11, "stations[0].position_m", "here stands a list; allowed [x, y, z], each -1000000000 to 1000000000 m"},
    {AT_17("colour: range\n  colour_limits: [1]"), 18, "output.colour_limits",
     "has 1 numbers instead of 2; allowed [low, high], each -1000000000 to 1000000000"},
    {"links:\n  - type: tcp\n    port: 0\n", "links: [{type: null}, {type: null}, {type: null}, {type: null}, {type: null}, "
     "{type: null}, {type: null}, {type: null}, {type: null}]\n", 13, "links", "9 elements are too many; allowed a list of 0 to 8"},
    {"  - type: tcp\n    port: 0\n", "  - 5\n", 14, "links[0]", "here stands a single value; allowed a section with keys"},
    {"type: tcp", "type: uart", 14, "links[0].type", "\"uart\" is not known; allowed null, file, pty, tcp, usb, udp, web"},
    {"port: 0", "port: 1.5", 15, "links[0].port", "\"1.5\" is not a whole number; allowed a whole number, 0 to 65535"},
    {AT_16("loop: !map {late_ms: 1}"), 16, "loop", "has a tag; allowed none"},
    {AT_16("head: {frames: 1}"), 16, "head", "given twice, first on line 1; allowed once"},
    {AT_16("loop: {late_ms: 1,\n  queue_ms: 10, late_ms: 2}"), 17, "loop.late_ms", "given twice, first on line 16; allowed once"},
    {"scale: 1", "scale: 1\n      copies: []", 10, "scene.meshes[0].copies",
     "a list of 0 copies; allowed 1 to 256 of all meshes together, more in a CSV file"},
    {"scale: 1", "scale: 1\n      copies: [5]", 10, "scene.meshes[0].copies[0]",
     "here stands a single value; allowed a section with offset_m, turn_deg, scale"},
    {"      scale: 1\n", "", 7, "scene.meshes[0].scale", "missing, and it has no default; allowed 1e-09 to 1000000000 m/unit"},
    {AT_16("fields: [{number: 1, shape: polygon, points_m: [[0, 1], [1]]}]"), 16, "fields[0].points_m",
     "point 2 is not two numbers; allowed [[x, y], ...], each -1000 to 1000 m"},
    {LINES, "  line_start_deg: 20\n  line_stop_deg: 20\n", 5, "head.line_stop_deg",
     "the line goes from 20 to 20 deg; allowed a line_start_deg below 20, or a line_stop_deg above 20"},
    {LINES, "  line_start_deg: 60\n", 4, "head.line_start_deg",
     "the line goes from 60 to 60 deg; allowed a line_start_deg below 60, or a line_stop_deg above 60"},
    {LINES, "  pan_start_deg: 20\n  pan_stop_deg: 10\n", 5, "head.pan_stop_deg",
     "the pan goes from 20 to 10 deg; allowed a pan_stop_deg of 20 to 360"},
    {LINES, "  station: 2\n", 4, "head.station", "there is no station 2; allowed 1 to 1"},
    {LINES, "  range_min_m: 9\n  range_max_m: 8\n", 5, "head.range_max_m",
     "the head measures from 9 to 8 m; allowed a range_min_m below 8, or a range_max_m above 9"},
    {LINES, "  range_min_m: 800\n", 4, "head.range_min_m",
     "the head measures from 800 to 800 m; allowed a range_min_m below 800, or a range_max_m above 800"},
    {LINES, "  range_min_m: 1.4\n", 4, "head.range_min_m",
     "1.4 is outside the limits of head profile any-rate; allowed 1.5 to 800 m"},
    /* output */
    {AT_17("colour: solid\n  colour_rgb: [1.5, 2, 3]"), 18, "output.colour_rgb", "[1.5, 2, 3]; allowed whole numbers from 0 to 255"},
    {AT_17("colour: solid\n  colour_rgb: [1, 2.5, 3]"), 18, "output.colour_rgb", "[1, 2.5, 3]; allowed whole numbers from 0 to 255"},
    {AT_17("colour: solid\n  colour_rgb: [1, 2, 3.5]"), 18, "output.colour_rgb", "[1, 2, 3.5]; allowed whole numbers from 0 to 255"},
    {AT_17("colour: range\n  colour_rgb: [1, 2, 3]"), 18, "output.colour_rgb",
     "a colour, but output.colour is range; allowed only with colour: solid"},
    {AT_17("colour: solid\n  colour_limits: [1, 2]"), 18, "output.colour_limits",
     "limits, but output.colour is solid; allowed only with colour: range, height, frame"},
    {AT_17("colour: height\n  colour_limits: [3, 2.5]"), 18, "output.colour_limits", "[3, 2.5]; allowed a second number above the first"},
    {AT_17("colour: height\n  colour_limits: [3, 3]"), 18, "output.colour_limits", "[3, 3]; allowed a second number above the first"},
    {AT_17("colour: frame"), 17, "output.colour",
     "frame, but points have no frame scalar: platform.kind is static; allowed with trajectory, stops"},
    {AT_17("heights: geoid"), 17, "output.heights", "geoid, but output.crs has no heights; allowed only with crs: utm, geodetic"},
    {AT_17("crs: ecef"), 11, "stations[0].lat_deg",
     "missing, and output.crs is not local and there is no scene.anchor; required, allowed -90 to 90 deg"},
    {AT_17("scale_m: 1e-7"), 17, "output.scale_m", "1e-07 is out of range; allowed 0 (automatic) or 1e-6 to 1 m"},
    {AT_17("utm_zone: 33"), 17, "output.utm_zone", "a zone, but output.crs is not utm; allowed only with crs: utm"},
    /* beam, sight, loop, time */
    {AT_16("instrument: {mirror_offset_m: 0.001}\nbeam: {mode: adaptive}"), 17, "beam.mode",
     "adaptive, but instrument.transit_offset_m or mirror_offset_m moves the beam; allowed single, rings, auto"},
    {AT_16("platform: {kind: live}\nbeam: {mode: adaptive}"), 17, "beam.mode",
     "adaptive, but the head or a mesh moves; allowed single, rings, auto"},
    {"scale: 1\n", "scale: 1\n      move_m_s: [1, 0, 0]\nbeam: {mode: adaptive}\n", 11, "beam.mode",
     "adaptive, but the head or a mesh moves; allowed single, rings, auto"},
    {AT_12("tripod: {leg_m: 1.8, legs: on}\nbeam: {mode: adaptive}"), 13, "beam.mode",
     "adaptive, but a tripod's legs (stations[].tripod.legs) have outlines that are not looked for; allowed single, "
     "rings, auto"},
    {AT_16("instrument: {transit_offset_m: 0.001}\ncast: {sight: on}"), 17, "cast.sight",
     "on, but instrument.transit_offset_m or mirror_offset_m moves the beam; allowed auto, off"},
    {AT_16("beam: {mode: rings}\ncast: {sight: on}"), 17, "cast.sight",
     "on, but beam.mode is rings, which have no ray for the centre; allowed auto, off"},
    {AT_16("loop: {tick_hz: 300}"), 16, "loop.tick_hz",
     "300 does not divide 1e9; allowed a divisor of 1e9 from 100 to 10000 Hz, such as 500, 1000, 2000"},
    {AT_16("time: {epoch: noon}"), 16, "time.epoch",
     "\"noon\": not a time as 2026-01-01T00:00:00Z, with up to 9 decimals; allowed none, utc, tai, or a time after "
     "1980-01-06 such as 2026-01-01T00:00:00Z"},
    {AT_16("time: {epoch: 1970-01-01T00:00:00Z}"), 16, "time.epoch",
     "\"1970-01-01T00:00:00Z\": not after 1980-01-06T00:00:00Z, where GPS time begins; allowed none, utc, tai, or a time "
     "after 1980-01-06 such as 2026-01-01T00:00:00Z"},
    {AT_16("time: {epoch: 2200-01-01T00:00:00Z}"), 16, "time.epoch",
     "\"2200-01-01T00:00:00Z\": after 2199-12-31; allowed none, utc, tai, or a time after 1980-01-06 such as "
     "2026-01-01T00:00:00Z"},
    {AT_16("gnss: {rate_hz: 3}"), 16, "gnss.rate_hz", "3 is not a rate of the receiver; allowed 1, 2, 4, 5, 10 or 20 Hz"},
    {AT_16("gnss: {quality: 3}"), 16, "gnss.quality",
     "3 is not a fix of position; allowed 0 none, 1 autonomous, 2 differential, 4 RTK fixed, 5 RTK float"},
    {AT_16("time: {ptp: {follower: on}}"), 16, "time.ptp.follower",
     "is on, but the time is not known; required is time.epoch: utc, tai, or a time such as 2026-01-01T00:00:00Z"},
    {AT_16("ntp: {address: 1.2.3}"), 16, "ntp.address", "\"1.2.3\"; allowed a numeric IPv4 address such as 127.0.0.1"},
    {AT_16("ntp: {zone_h: 1.5}"), 16, "ntp.zone_h", "1.5; allowed whole hours from -12 to 12"},
    {AT_16("ntp: {role: client}"), 16, "ntp.role", "client, but no link sends dates; allowed with a link of protocol: cola"},
    {AT_16("loop: {pace: fast}\nplatform: {kind: live}"), 16, "loop.pace", "a live platform gets its poses in real time; allowed realtime, step"},
    /* links */
    {"heading_deg: 90\nlinks:\n  - type: tcp\n", "lat_deg: 1\n    lon_deg: 2\n    height_m: 3\nlinks:\n  - type: tcp\n    protocol: nmea\n",
     17, "links[0].protocol",
     "nmea, but the time is not known; required is time.epoch: utc, tai, or a time such as 2026-01-01T00:00:00Z"},
    {"type: tcp\n    port: 0", "type: file\n    path: a\n  - type: file\n    path: b\n  - type: file\n    path: b", 19, "links[2].path",
     "links[1] has the same path; allowed a path of its own"},
    {"    port: 0\n", "    port: 7000\n  - {type: web, port: 7001}\n  - {type: web, port: 7001}\n", 17, "links[2].port",
     "links[1] listens on the same port; allowed a port of its own, or 0"},
    {"type: tcp\n    port: 0", "type: usb\n    backend: usbredir\n    path: a\n    port: 1", 16, "links[0].path",
     "both a path and a port or address; allowed one of them"},
    {"type: tcp\n    port: 0", "type: usb\n    backend: usbredir\n    path: a\n    address: 127.0.0.1", 16, "links[0].path",
     "both a path and a port or address; allowed one of them"},
    {"type: tcp\n    port: 0", "type: usb\n    attach: on\n    address: 127.0.0.1", 15, "links[0].attach",
     "an attached device does not listen; allowed without port and address"},
    {"type: tcp\n    port: 0", "type: usb\n    backend: usbredir", 15, "links[0].backend",
     "usbredir needs a path or a port; allowed with one of them"},
    {"type: tcp\n    port: 0", "type: usb\n    backend: usbredir\n    port: 0\n    attach: on", 16, "links[0].port",
     "0, but the head must connect to this port; allowed 1 to 65535"},
    {"type: tcp\n    port: 0", "type: usb\n    udc: a", 15, "links[0].udc", "the back end usbip has no such key; allowed without it"},
    {"type: tcp\n    port: 0", "type: null\n    port: 0", 15, "links[0].port",
     "a null link has no such key; allowed type, protocol, dialect, waits"},
    {"    port: 0", "    dialect: cola-a", 15, "links[0].dialect",
     "cola-a, but the protocol is native; allowed with protocol: cola, or any"},
    /* places */
    {AT_12("name: a\n  - position_m: [0, 0, 0]\n    name: b\n  - position_m: [0, 0, 0]\n    name: b"), 16, "stations[2].name",
     "stations[1] has the same name; allowed different names"},
    {AT_12("lat_deg: 50"), 11, "stations[0].lon_deg",
     "missing, and lat_deg, lon_deg and height_m go together; required, allowed -180 to 180 deg"},
    {AT_12("lat_deg: 50\n    lon_deg: 5"), 11, "stations[0].height_m",
     "missing, and lat_deg, lon_deg and height_m go together; required, allowed -1000 to 10000 m"},
    {AT_12("easting_m: 5e5"), 11, "stations[0].utm_zone", UTM_TOGETHER "allowed a whole number, 0 to 60"},
    {AT_12("utm_zone: 33\n    easting_m: 5e5\n    northing_m: 5e6"), 11, "stations[0].hemisphere", UTM_TOGETHER "allowed south, north"},
    {AT_12("utm_zone: 33\n    easting_m: 5e5\n    hemisphere: north"), 11, "stations[0].northing_m",
     UTM_TOGETHER "allowed -10000000 to 20000000 m"},
    {AT_12("utm_zone: 33\n    easting_m: 5e5\n    hemisphere: north\n    northing_m: 5e6"), 11, "stations[0].height_m",
     UTM_TOGETHER "allowed -1000 to 10000 m"},
    {AT_12("utm_zone: 33\n    lat_deg: 5"), 12, "stations[0].utm_zone", "given together with lat_deg" FORMS},
    {AT_12("lon_deg: 5\n    ecef_m: [6378137, 0, 0]"), 13, "stations[0].ecef_m", "given together with lon_deg" FORMS},
    {AT_12("ecef_m: [6378137, 0, 0]\n    height_m: 5"), 13, "stations[0].height_m", "ecef_m also gives the height; allowed one of them"},
    {"position_m: [1, 2, 3]\n    heading_deg: 90", "ecef_m: [6378137, 0, 0]", 11, "stations[0].position_m",
     "missing, and there is no scene.anchor to compute it; required, allowed [x, y, z], each -1000000000 to 1000000000 m"},
    {"    port: 0\n", "    protocol: nmea\ntime: {epoch: utc}\n", 11, "stations[0].lat_deg",
     "missing, and a link has the protocol nmea and there is no scene.anchor; required, allowed -90 to 90 deg"},
    {ANCHOR("source: explicit, lon_deg: 5, height_m: 5"), 6, "scene.anchor.lat_deg",
     "missing, and the anchor's source is explicit; required, allowed -90 to 90 deg"},
    {ANCHOR("source: explicit, lat_deg: 5, height_m: 5"), 6, "scene.anchor.lon_deg",
     "missing, and the anchor's source is explicit; required, allowed -180 to 180 deg"},
    {ANCHOR("source: utm, hemisphere: north"), 6, "scene.anchor.utm_zone",
     "missing, and the anchor's source is utm; required, allowed a whole number, 0 to 60"},
    {ANCHOR("source: utm, utm_zone: 33"), 6, "scene.anchor.hemisphere",
     "missing, and the anchor's source is utm; required, allowed south, north"},
    {ANCHOR("source: utm, utm_zone: 33, hemisphere: north, north_deg: 1"), 6, "scene.anchor.north_deg",
     "an anchor of source utm has no such key; allowed utm_zone, hemisphere"},
    {ANCHOR("source: explicit, lat_deg: 5, lon_deg: 5, height_m: 5, utm_zone: 3"), 6, "scene.anchor.utm_zone",
     "an anchor of source explicit has no such key; allowed origin_m, lat_deg, lon_deg, height_m, north_deg"},
    {ANCHOR("source: ifc, lat_deg: 1"), 6, "scene.anchor.lat_deg", "an anchor of source ifc has no such key; allowed height_m"},
    {ANCHOR("source: geotiff, lon_deg: 1"), 6, "scene.anchor.lon_deg", "an anchor of source geotiff has no such key; allowed height_m"},
    {ANCHOR("origin_m: [1, 2, 3]"), 6, "scene.anchor.origin_m", "an anchor of source none has no such key; allowed source alone"},
    /* the platform */
    {AT_16("platform:\n  kind: trajectory\n  file: a\n  start_s: 2\n  end_s: 2"), 20, "platform.end_s",
     "2 s, and platform.start_s is 2; allowed more than 2 s"},
    {AT_16(STOPS "  step_s: 1\n  start_s: 2\n  end_s: 1.5"), 21, "platform.end_s",
     "1.5 s, and platform.start_s is 2; allowed at least 2 s"},
    {AT_16(STOPS "  frames_per_s: 10\n  frame_step: 1\n  first_frame: 5\n  last_frame: 3"), 22, "platform.last_frame",
     "3, and platform.first_frame is 5; allowed at least 5"},
    {AT_16(STOPS "  frames_per_s: 10\n  frame_step: 1\n  start_s: 5"), 21, "platform.start_s", FRAMES "first_frame"},
    {AT_16(STOPS "  frames_per_s: 10\n  frame_step: 1\n  end_s: 5"), 21, "platform.end_s", FRAMES "last_frame"},
    {AT_16(STOPS "  frames_per_s: 10\n  frame_step: 1\n  step_s: 5"), 21, "platform.step_s", FRAMES "frame_step"},
    {AT_16(STOPS "  step_s: 1\n  first_frame: 5"), 20, "platform.first_frame", NO_FRAMES},
    {AT_16(STOPS "  step_s: 1\n  last_frame: 5"), 20, "platform.last_frame", NO_FRAMES},
    {AT_16(STOPS "  step_s: 1\n  frame_step: 5"), 20, "platform.frame_step", NO_FRAMES},
    {AT_16("platform:\n  kind: stops\n  step_s: 1\n  end_s: 2\n  mount_m: [0, 0, 1]"), 20, "platform.mount_m", NO_MOUNT},
    {AT_16("platform:\n  kind: stops\n  step_s: 1\n  end_s: 2\n  mount_heading_deg: 1"), 20, "platform.mount_heading_deg", NO_MOUNT},
    {AT_16("platform:\n  kind: stops\n  step_s: 1\n  end_s: 2\n  mount_pitch_deg: 1"), 20, "platform.mount_pitch_deg", NO_MOUNT},
    {AT_16("platform:\n  kind: stops\n  step_s: 1\n  end_s: 2\n  mount_roll_deg: 1"), 20, "platform.mount_roll_deg", NO_MOUNT},
    {"stations:", "platform: {kind: stops, file: a, step_s: 1}\nstations:\n  - {name: b, position_m: [1, 2, 3]}", 11, "stations",
     "2 stations, but with platform.kind: stops the stops are the stations; allowed one station, which gives the place of "
     "the scene on the Earth"},
    /* noise, signal, waveform */
    {AT_16("signal: {model: on}\nnoise: {sigma_m: 0.001}"), 17, "noise.sigma_m",
     "0.001 is below range_sigma_floor_m of head profile any-rate; allowed 0.00295 to 10 m"},
    {AT_16("platform: {kind: live}\nnoise: {ball: {radius_m: 1, axes: scene}}"), 17, "noise.ball.axes",
     "axes of the scene on a platform that moves; allowed axes: beam"},
    {AT_16("surfaces: [{reflectance: 0.25, specular: 0.25, glass: 0.625}]"), 16, "surfaces[0]",
     "reflectance, specular, glass and mirror add up to 1.125; allowed at most 1"},
    {AT_16("surfaces: [{}, {reflectance: 0.25, specular: 0.25, mirror: 0.625}]"), 16, "surfaces[1]",
     "reflectance, specular, glass and mirror add up to 1.125; allowed at most 1"},
    {AT_16("waveform: {pulse_file: a.csv}"), 16, "waveform.pulse_file", "a file, but waveform.pulse is gaussian; allowed with pulse: table"},
    {AT_16("waveform: {skew: 2}"), 16, "waveform.skew", "a skew, but waveform.pulse is gaussian; allowed with pulse: asymmetric"},
    {AT_16("waveform: {sample_ns: 0.0625}"), 16, "waveform.sample_ns",
     "0.0625 is no whole number of ps; allowed 0.05 to 100 in steps of 0.001"},
    {AT_16("waveform: {baseline_counts: 1.03}"), 16, "waveform.baseline_counts",
     "1.03 with 12 bits; allowed 0 to 2047.5, half of the largest count, in steps of 1/16"},
    {AT_16("waveform: {bits: 8, baseline_counts: 127.5625}"), 16, "waveform.baseline_counts",
     "127.5625 with 8 bits; allowed 0 to 127.5, half of the largest count, in steps of 1/16"},
    {AT_16("waveform: {bandwidth_mhz: 0.5}"), 16, "waveform.bandwidth_mhz", "0.5 MHz; allowed 1 to 100000, or 0 for no limit"},
    {AT_16(WAVES "after_ns: 2044}"), 17, "waveform.after_ns",
     "5 ns before an echo and 2044 ns after it; allowed together up to 2048, 2048 samples"},
    {AT_16(WAVES "before_ns: 2039}"), 17, "waveform.before_ns",
     "2039 ns before an echo and 10 ns after it; allowed together up to 2048, 2048 samples"},
    {AT_16(WAVES "near_m: 1, far_m: 2000}"), 17, "waveform.far_m",
     "a window from 1 to 2000 m; allowed are 0.1499 to 613.825 m of length, 1 to 4095 samples"},
    {AT_16(WAVES "near_m: 5}"), 17, "waveform.near_m", "a window from 5 to 0 m; allowed a far_m above 5, or 0 for both"},
    {AT_16(WAVES "near_m: 9, far_m: 9}"), 17, "waveform.far_m", "a window from 9 to 9 m; allowed a far_m above 9, or 0 for both"},
    {AT_16("waveform: {send: on}"), 16, "waveform.send", "on, but no signal is modelled; required is signal.model: on"},
    {AT_16("waveform: {echoes: threshold}"), 16, "waveform.echoes", "threshold, but no signal is modelled; required is signal.model: on"},
    {AT_16("waveform: {echoes: threshold, send: on}"), 16, "waveform.send", "on, but no signal is modelled; required is signal.model: on"},
    {AT_16("noise: {range: signal}\nsignal: {model: on}\nwaveform: {echoes: fraction}"), 16, "noise.range",
     "signal, but echoes are found in samples, which have noise already (waveform.echoes); allowed off"},
};
/* clang-format on */

static void edits_are_refused_word_by_word(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof edits / sizeof *edits; i++) {
        load_edited(edits[i].old, edits[i].with);
        expect_at(edits[i].line, edits[i].key, edits[i].text);
    }
    char text[200];
    snprintf(text, sizeof text, "\"%s/cube.xyz\" has no known ending; allowed " ENDINGS, dir);
    load_edited("cube.obj", "cube.xyz");
    expect_at(7, "scene.meshes[0].file", text);
}

/* ---- other heads */

/* clang-format off */
#define GEOMETRIES "; allowed with head profile sick-lms111: 50 Hz at 0.5 deg, 25 Hz at 0.25 deg, 25 Hz at 0.5 deg"
#define SEGMENT "number: 1, shape: segment, angles_deg: [0, 90], radii_m: [0, 1]"
static const char vlp[] = "velodyne-vlp16", lms[] = "sick-lms111", tim[] = "sick-tim781";
static const struct {
    const char *head, *settings, *with; /* line 14 is the first of `with`, where there are no settings */
    int line;
    const char *key, *text;
} heads[] = {
    {"riegl-vz600i", "  range_min_m: 300\n", "", 3, "head.range_min_m",
     "300 excludes all of the 0.5 to 250 m that the head measures at 2200000 Hz; allowed below 250 m"},
    {"riegl-vz400i", "  range_max_m: 1.3\n", "", 3, "head.range_max_m",
     "1.3 excludes all of the 1.5 to 800 m that the head measures at 100000 Hz; allowed above 1.5 m"},
    {"riegl-vz400i", "  range_min_m: 0.6\n  range_max_m: 1.3\n", "", 4, "head.range_max_m",
     "1.3 excludes all of the 1.5 to 800 m that the head measures at 100000 Hz; allowed above 1.5 m"},
    {"riegl-vz400i", "  prr_hz: 200000\n", "", 3, "head.prr_hz",
     "200000 is not a pulse rate of head profile riegl-vz400i; allowed 100000, 300000, 600000, 1200000 Hz"},
    {lms, "  lines_hz: 50\n  step_deg: 0.25\n", "", 4, "head.step_deg", "0.25, with a lines_hz of 50" GEOMETRIES},
    {lms, "  lines_hz: 30\n", "", 3, "head.lines_hz", "30" GEOMETRIES},
    {lms, "  step_deg: 1\n", "", 3, "head.step_deg", "1" GEOMETRIES},
    {lms, "", "noise: {angle: on}\n", 14, "noise.angle",
     "head profile sick-lms111 gives no angle noise; required is mirror_sigma_deg or pan_sigma_deg there"},
    {vlp, "  step_deg: 1\n", "", 3, "head.step_deg",
     "head profile velodyne-vlp16 has emitter: beams; allowed only with emitter: sphere, or a planar one with geometries"},
    {vlp, "  ring_start_deg: 1\n", "", 3, "head.ring_start_deg", "head profile velodyne-vlp16 has emitter: beams; allowed only with emitter: sphere"},
    {vlp, "  ambiguity: folded\n", "", 3, "head.ambiguity",
     "the pulses of head profile velodyne-vlp16 are not evenly spaced in time; allowed none"},
    {vlp, "  lines_hz: 9.5\n  phase_lock: on\n", "", 4, "head.phase_lock",
     "on, but with head.lines_hz 9.5 the rotor is at another azimuth each second; allowed with whole turns per second"},
    {lms, "  phase_deg: 1\n", "", 3, "head.phase_deg", "head profile sick-lms111 has emitter: planar; allowed only with emitter: beams"},
    {"hokuyo-urg-04lx", "  prr_hz: 10000\n", "", 3, "head.prr_hz",
     "10000, but a line of head profile hokuyo-urg-04lx has 1024 pulses; allowed 10240, or none: it follows from head.lines_hz"},
    {"hokuyo-urg-04lx", "  lines_hz: 11\n", "", 3, "head.lines_hz",
     "11 is outside the limits of head profile hokuyo-urg-04lx; allowed 9 to 10 Hz"},
    {vlp, "  lines_hz: 4\n", "", 3, "head.lines_hz", "4 is outside the limits of head profile velodyne-vlp16; allowed 5 to 20 Hz"},
    {"sphere", "  line_start_deg: 90\n  line_stop_deg: 90\n", "", 4, "head.line_stop_deg",
     "the line goes from 90 to 90 deg; allowed a line_start_deg other than 90, or a line_stop_deg other than 90"},
    {"sphere", "", "beam: {mode: rings}\n", 14, "beam.mode", "head profile sphere has no footprint; allowed single"},
    /* fields */
    {tim, "", "fields: [{" SEGMENT ", size_m: [1, 1]}]\n", 14, "fields[0].size_m", "given, but the field is a segment; allowed with shape: rectangle"},
    {tim, "", "fields: [{" SEGMENT ", turn_deg: 5}]\n", 14, "fields[0].turn_deg", "given, but the field is a segment; allowed with shape: rectangle"},
    {tim, "", "fields: [{number: 1, shape: rectangle, corner_m: [0, 0], size_m: [1, 1], points_m: [[0, 1], [1, 0], [1, 1]]}]\n", 14,
     "fields[0].points_m", "given, but the field is a rectangle; allowed with shape: polygon"},
    {tim, "", "fields: [{number: 1, shape: segment, angles_deg: [0, 90]}]\n", 14, "fields[0].radii_m", "missing; required with shape: segment"},
    {tim, "", "fields: [{number: 1, shape: segment, radii_m: [0, 9]}]\n", 14, "fields[0].angles_deg", "missing; required with shape: segment"},
    {tim, "", "fields: [{number: 1, shape: rectangle, size_m: [1, 9]}]\n", 14, "fields[0].corner_m", "missing; required with shape: rectangle"},
    {tim, "", "fields: [{number: 1, shape: rectangle, corner_m: [0, 9]}]\n", 14, "fields[0].size_m", "missing; required with shape: rectangle"},
    {tim, "", "fields: [{number: 1, shape: polygon, points_m: [[0, 1], [1, 1]]}]\n", 14, "fields[0].points_m", "2 corners; allowed 3 to 62"},
    {tim, "", "fields: [{number: 1, shape: polygon, points_m: [[0, 0], [1, 1], [2, 2], [3, 3]]}]\n", 14, "fields[0].points_m",
     "its 4 corners enclose no area; allowed are corners that do not lie on one line"},
    {tim, "", "fields: [{number: 1, shape: segment, angles_deg: [90, 89.5], radii_m: [0, 1]}]\n", 14, "fields[0].angles_deg",
     "90 to 89.5; allowed a second angle of 0 to 360 deg more"},
    {tim, "", "fields: [{number: 1, shape: segment, angles_deg: [0, 360.5], radii_m: [0, 1]}]\n", 14, "fields[0].angles_deg",
     "0 to 360.5; allowed a second angle of 0 to 360 deg more"},
    {tim, "", "fields: [{number: 1, shape: segment, angles_deg: [0, 9], radii_m: [2, 1.5]}]\n", 14, "fields[0].radii_m",
     "2 to 1.5; allowed an outer radius that is not below the inner one"},
    {tim, "", "fields:\n  - {" SEGMENT "}\n  - {number: 2, shape: segment, angles_deg: [0, 90], radii_m: [0, 1]}\n  - {number: 2, "
     "shape: segment, angles_deg: [0, 90], radii_m: [0, 1]}\n", 17, "fields[2].number", "2 is the number of fields[1], too; allowed once"},
    {lms, "", "fields: [{number: 11, shape: segment, angles_deg: [0, 90], radii_m: [0, 1]}]\n", 14, "fields[0].number",
     "11, but a LMS111 has 10 fields; allowed 1 to 10"},
    {tim, "", "fields: [{" SEGMENT ", output: 1}]\n", 14, "fields[0].output",
     "given, but a TiM781 has an output for each field of a set; allowed with an LMS1xx"},
    {"sick-tim571", "", "fields: [{" SEGMENT "}]\n", 14, "fields", "a TiM571 evaluates no fields; allowed with another head.profile"},
    {tim, "", "inputs:\n  - {input: 1, from_s: 1, until_s: 2}\n  - {input: 1, from_s: 3, until_s: 2}\n", 16, "inputs[1].until_s",
     "2 s, but it begins at 3 s; allowed a later time"},
};
/* clang-format on */

static void heads_refuse_word_by_word(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof heads / sizeof *heads; i++) {
        load_with_head(heads[i].head, heads[i].settings, heads[i].with);
        expect_at(heads[i].line, heads[i].key, heads[i].text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(edits_are_refused_word_by_word),
        cmocka_unit_test(heads_refuse_word_by_word),

    };
    return cmocka_run_group_tests_name("messages of the configuration", tests, set_up, tear_down);
}
