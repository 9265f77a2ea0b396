/* Cases of test_config.c: a configuration that loads, and edits of it that must not. */
#ifndef TESTS_UNIT_CONFIG_CASES_H
#define TESTS_UNIT_CONFIG_CASES_H

#include <stddef.h>

/* clang-format off */
static const char base[] = "head:\n"                        /* 1 */
                           "  profile: riegl-vz400i\n"      /* 2 */
                           "  prr_hz: 500000\n"             /* 3 */
                           "  lines_hz: 100\n"              /* 4 */
                           "scene:\n"                       /* 5 */
                           "  meshes:\n"                    /* 6 */
                           "    - file: cube.obj\n"         /* 7 */
                           "      up: z\n"                  /* 8 */
                           "      scale: 1\n"               /* 9 */
                           "stations:\n"                    /* 10 */
                           "  - position_m: [1, 2, 3]\n"    /* 11 */
                           "    heading_deg: 90\n"          /* 12 */
                           "links:\n"                       /* 13 */
                           "  - type: tcp\n"                /* 14 */
                           "    port: 0\n"                  /* 15 */
                           "output:\n"                      /* 16 */
                           "  crs: local\n";                /* 17 */

struct bad {
    const char *old, *with; /* edit of base; old NULL: with is the whole file */
    int line;
    const char *key;        /* NULL: the error is about the file */
    const char *fragment;
};

#define PRR "  prr_hz: 500000\n"
#define LINES "  lines_hz: 100\n"
#define FRAMES_AT_4(text) LINES, "  " text "\n" LINES
static const struct bad bad[] = {
    /* numbers */
    {PRR, "  prr_hz: 30 kHz\n", 3, "head.prr_hz", "allowed prr_min_hz to prr_max_hz"},
    {PRR, "  prr_hz: 300000 Hz\n", 3, "head.prr_hz", "\"300000 Hz\" is not a number"},
    {PRR, "  prr_hz: nan\n", 3, "head.prr_hz", "not a number"},
    {PRR, "  prr_hz: .nan\n", 3, "head.prr_hz", "not a number"},
    {PRR, "  prr_hz: inf\n", 3, "head.prr_hz", "not a number"},
    {PRR, "  prr_hz: 0x10\n", 3, "head.prr_hz", "not a number"},
    {PRR, "  prr_hz: 300_000\n", 3, "head.prr_hz", "not a number"},
    {PRR, "  prr_hz: 300,000\n", 3, "head.prr_hz", "not a number"},
    {PRR, "  prr_hz: 0300000\n", 3, "head.prr_hz", "not a number"},
    {PRR, "  prr_hz: 5.\n", 3, "head.prr_hz", "not a number"},
    {PRR, "  prr_hz: 1e\n", 3, "head.prr_hz", "not a number"},
    {PRR, "  prr_hz: --5\n", 3, "head.prr_hz", "not a number"},
    {PRR, "  prr_hz: 500000.0000001\n", 3, "head.prr_hz", "finer than 6 decimals"},
    {PRR, "  prr_hz: 1e30\n", 3, "head.prr_hz", "out of range"},
    {PRR, "  prr_hz: 99999999999999999999999999999999999999999\n", 3, "head.prr_hz", "out of range"},
    {PRR, "  prr_hz: \"500000\"\n", 3, "head.prr_hz", "in quotes"},
    {PRR, "  prr_hz:\n", 3, "head.prr_hz", "here stands nothing"},
    {PRR, "  prr_hz: [1]\n", 3, "head.prr_hz", "here stands a list"},
    {PRR, "  prr_hz: {a: 1}\n", 3, "head.prr_hz", "here stands a section"},
    {PRR, "  prr_hz: !!int 5\n", 3, "head.prr_hz", "tag"},
    {"heading_deg: 90", "heading_deg: 1e999", 12, "stations[0].heading_deg", "allowed -360 to 360 deg"},
    {"heading_deg: 90", "heading_deg: 361", 12, "stations[0].heading_deg", "allowed -360 to 360 deg"},
    {"heading_deg: 90", "lat_deg: -90.5", 12, "stations[0].lat_deg", "allowed -90 to 90 deg"},
    {"heading_deg: 90", "lon_deg: 181", 12, "stations[0].lon_deg", "allowed -180 to 180 deg"},
    {"heading_deg: 90", "height_m: 10001", 12, "stations[0].height_m", "allowed -1000 to 10000 m"},
    {"scale: 1", "scale: 0", 9, "scene.meshes[0].scale", "allowed 1e-09 to"},
    {"scale: 1", "scale: -1", 9, "scene.meshes[0].scale", "out of range"},
    {"port: 0", "port: 65536", 15, "links[0].port", "0 to 65535"},
    {"port: 0", "port: 1.5", 15, "links[0].port", "not a whole number"},
    {"port: 0", "max_sessions: 9", 15, "links[0].max_sessions", "1 to 8"},
    {"port: 0", "max_sessions: 0", 15, "links[0].max_sessions", "1 to 8"},
    {"crs: local", "utm_zone: 61", 17, "output.utm_zone", "0 to 60"},
    {FRAMES_AT_4("frames: -1"), 4, "head.frames", "0 to 1000000"},
    {"output:", "noise: {seed: 18446744073709551616}\noutput:", 16, "noise.seed", "0 to 18446744073709551615"},
    {"output:", "noise: {seed: -1}\noutput:", 16, "noise.seed", "0 to 18446744073709551615"},
    {"output:", "loop: {ahead_ms: 91}\noutput:", 16, "loop.ahead_ms", "allowed 2 to 90 ms"},
    {"output:", "loop: {queue_ms: 9}\noutput:", 16, "loop.queue_ms", "allowed 10 to 10000 ms"},
    {"output:", "loop: {late_ms: -1}\noutput:", 16, "loop.late_ms", "allowed 0 to 10000 ms"},
    {"output:", "loop: {threads: 65}\noutput:", 16, "loop.threads", "0 to 64"},
    /* words, texts, vectors */
    {"up: z", "up: x", 8, "scene.meshes[0].up", "allowed z, y"},
    {"up: z", "up: Z", 8, "scene.meshes[0].up", "allowed z, y"},
    {"crs: local", "crs: wgs84", 17, "output.crs", "allowed local, ecef, utm"},
    {"crs: local", "layout: xyz", 17, "output.layout", "allowed polar, geo"},
    {"type: tcp", "type: udp", 14, "links[0].type", "allowed null, file, pty, tcp, usb"},
    {"output:", "loop: {pace: slow}\noutput:", 16, "loop.pace", "allowed realtime, fast, step"},
    {"output:", "noise: {range: 1}\noutput:", 16, "noise.range", "allowed on or off"},
    {"output:", "noise: {angle: 1}\noutput:", 16, "noise.angle", "allowed on or off"},
    {"[1, 2, 3]", "[1, 2]", 11, "stations[0].position_m", "2 numbers instead of 3"},
    {"[1, 2, 3]", "[1, 2, 3, 4]", 11, "stations[0].position_m", "4 numbers instead of 3"},
    {"[1, 2, 3]", "[1, 2, nan]", 11, "stations[0].position_m", "\"nan\" is not a number"},
    {"[1, 2, 3]", "[1, [2], 3]", 11, "stations[0].position_m", "here stands a list"},
    {"[1, 2, 3]", "[1, 2, 1e10]", 11, "stations[0].position_m", "each -1000000000 to 1000000000 m"},
    {"[1, 2, 3]", "5", 11, "stations[0].position_m", "[x, y, z]"},
    {"heading_deg: 90", "name: 12345678901234567890123456789012", 12, "stations[0].name", "text of 1 to 31 bytes"},
    {"heading_deg: 90", "name: ''", 12, "stations[0].name", "text of 1 to 31 bytes"},
    {"heading_deg: 90", "name: \"a\\nb\"", 12, "stations[0].name", "control characters"},
    {"heading_deg: 90", "name: \"a\\0b\"", 12, "stations[0].name", "control characters"},
    {FRAMES_AT_4("serial: a,b"), 4, "head.serial", "without comma"},
    /* keys */
    {PRR, "  prr: 500000\n", 3, "head.prr", "did you mean head.prr_hz?"},
    {PRR, "  pr_hz: 500000\n", 3, "head.pr_hz", "did you mean head.prr_hz?"},
    {PRR, "  zzz: 500000\n", 3, "head.zzz", "allowed profile, serial, prr_hz, lines_hz"},
    {"output:", "lines_hz: 5\noutput:", 16, "lines_hz", "did you mean head.lines_hz?"},
    {"output:", "station:\noutput:", 16, "station", "did you mean stations?"},
    {"output:", "head.serial: a\noutput:", 16, "head.serial", "unknown key"},
    {"output:", "\"links[]\": {type: pty}\noutput:", 16, "links[]", "unknown key"},
    {"output:", "? [a]\n: b\noutput:", 16, "configuration", "a key that is a list"},
    {"up: z", "upp: z", 8, "scene.meshes[0].upp", "did you mean scene.meshes[0].up?"},
    {"heading_deg: 90", "heading: 90", 12, "stations[0].heading", "did you mean stations[0].heading_deg?"},
    {LINES, LINES PRR, 5, "head.prr_hz", "given twice, first on line 3"},
    {"output:", "head: {frames: 1}\noutput:", 16, "head", "given twice, first on line 1"},
    {"output:", "<<: {a: 1}\noutput:", 16, "<<", "unknown key"},
    /* kinds of nodes */
    {NULL, "head: 5\n", 1, "head", "allowed a section with keys"},
    {NULL, "head: [1]\n", 1, "head", "allowed a section with keys"},
    {NULL, "links: {a: 1}\n", 1, "links", "allowed a list of 0 to 8"},
    {NULL, "links:\n  - 5\n", 2, "links[0]", "allowed a section with keys"},
    {NULL, "links: [{type: tcp}, {type: tcp}, {type: tcp}, {type: tcp}, {type: tcp}, {type: tcp}, {type: tcp}, "
           "{type: tcp}, {type: tcp}]\n",
     1, "links", "9 elements are too many; allowed a list of 0 to 8"},
    {NULL, "head: &a\n  head: *a\n", 2, "head.head", "unknown key"},
    {NULL, "links: &a\n  - *a\n", 1, "links[0]", "here stands a list"},
    {NULL, "head: !map {prr_hz: 1}\n", 1, "head", "has a tag"},
    {NULL, "- 1\n", 1, NULL, "allowed sections with keys"},
    {NULL, "text\n", 1, NULL, "allowed sections with keys"},
    /* missing */
    {"  profile: riegl-vz400i\n", "", 1, "head.profile", "missing"},
    {"      scale: 1\n", "", 7, "scene.meshes[0].scale", "missing"},
    {"      up: z\n", "", 7, "scene.meshes[0].up", "missing"},
    {"  - type: tcp\n    port: 0", "  - port: 0", 14, "links[0].type", "missing"},
    {"  - position_m: [1, 2, 3]\n    ", "  - ", 11, "stations[0].position_m", "missing"},
    {"  meshes:\n    - file: cube.obj\n      up: z\n      scale: 1\n", "  meshes: []\n", 6, "scene.meshes", "list of 1 to 64"},
    {"stations:\n  - position_m: [1, 2, 3]\n    heading_deg: 90\n", "", 1, "stations", "list of 1 to 64"},
    {"crs: local", "crs: utm", 11, "stations[0].lat_deg", "required, allowed -90 to 90 deg"},
    /* YAML itself */
    {PRR, "\tprr_hz: 500000\n", 3, NULL, "not with tabs"},
    {PRR, "  prr_hz: [1\n", 4, NULL, "not YAML"},
    {PRR, "  prr_hz: *nowhere\n", 3, NULL, "undefined alias"},
    {PRR, "  profile: \xff\xfe\n", 3, NULL, "UTF-8"},
    {"output:", "--- {}\noutput:", 16, NULL, "second document"},
    {NULL, "head: {}\n...\n---\nhead: {}\n", 4, NULL, "second document"},
    {NULL, "", 1, NULL, "empty"},
    {NULL, "# nothing\n", 1, NULL, "empty"},
    {NULL, "\xff\xfeh\n", 1, NULL, "UTF-8"},
    {NULL, "\n\nhead: \x01\n", 3, NULL, "control characters"},
    /* within the profile: VZ-400i, 100 kHz to 1.2 MHz, 3 to 240 lines/s, -40 to 60 deg, 0 to 360 deg */
    {PRR, "  prr_hz: 1200000.000001\n", 3, "head.prr_hz", "allowed 100000 to 1200000 Hz"},
    {PRR, "  prr_hz: 99999.999999\n", 3, "head.prr_hz", "99999.999999 is outside of head profile riegl-vz400i"},
    {LINES, "  lines_hz: 241\n", 4, "head.lines_hz", "allowed 3 to 240 Hz"},
    {LINES, "  line_start_deg: -40.000001\n", 4, "head.line_start_deg", "allowed -40 to 60 deg"},
    {LINES, "  line_stop_deg: 61\n", 4, "head.line_stop_deg", "allowed -40 to 60 deg"},
    {LINES, "  pan_stop_deg: 361\n", 4, "head.pan_stop_deg", "allowed 0 to 360 deg"},
    {LINES, "  pan_deg_s: 151\n", 4, "head.pan_deg_s", "allowed 0 to 150 deg/s"},
    {LINES, "  pan_deg_s: -1\n", 4, "head.pan_deg_s", "allowed 0 to"},
    {LINES, "  profile_x: 1\n", 4, "head.profile_x", "did you mean head.profile?"},
    /* between keys */
    {LINES, "  line_start_deg: 20\n  line_stop_deg: 20\n", 5, "head.line_stop_deg", "below line_stop_deg"},
    {LINES, "  line_start_deg: 60\n", 4, "head.line_start_deg", "below line_stop_deg"},
    {LINES, "  pan_start_deg: 20\n  pan_stop_deg: 10\n", 5, "head.pan_stop_deg", "at most pan_stop_deg"},
    {LINES, "  station: 2\n", 4, "head.station", "allowed 1 to 1"},
    {LINES, "  station: 0\n", 4, "head.station", "1 to 4096"},
    {"crs: local", "utm_zone: 33", 17, "output.utm_zone", "only with crs: utm"},
    /* 800 m / 2^31 = 3.7e-7 m fits; the row's lower limit is 1e-6 */
    {"crs: local", "scale_m: 1e-7", 17, "output.scale_m", "1e-6 to 1 m"},
    {"output:", "platform:\n  kind: trajectory\noutput:", 17, "platform.kind", "either platform.file or platform.waypoints"},
    {"output:", "platform:\n  kind: trajectory\n  file: a\n  waypoints: b\noutput:", 19, "platform.waypoints", "either"},
    {"output:", "platform:\n  file: a\noutput:", 17, "platform.file", "a static platform has no such key"},
    {"output:", "platform:\n  kind: live\n  at_end: hold\noutput:", 18, "platform.at_end", "a live platform has no such key"},
    {"output:", "platform:\n  mount_m: [0, 0, 1]\noutput:", 17, "platform.mount_m", "a static platform"},
    {"output:", "platform:\n  end_s: 1\noutput:", 17, "platform.end_s", "a static platform has no such key"},
    {"output:", "platform:\n  kind: live\n  end_s: 1\noutput:", 18, "platform.end_s", "a live platform has no such key"},
    {"output:", "platform:\n  kind: trajectory\n  file: a\n  step_s: 1\noutput:", 19, "platform.step_s", "a trajectory platform has no such key"},
    {"output:", "platform:\n  kind: trajectory\n  file: a\n  start_s: 2\n  end_s: 2\noutput:", 20, "platform.end_s", "allowed more than start_s"},
    {"output:", "platform:\n  kind: stops\n  file: a\n  step_s: 1\n  start_s: 2\n  end_s: 1.5\noutput:", 21, "platform.end_s", "allowed start_s or more"},
    {"output:", "platform:\n  kind: stops\n  file: a\noutput:", 17, "platform.kind", "platform.step_s; allowed above 0"},
    {"output:", "platform:\n  kind: stops\n  file: a\n  step_s: 0\noutput:", 19, "platform.step_s", "allowed above 0"},
    {"output:", "platform:\n  kind: stops\n  file: a\n  step_s: -1\noutput:", 19, "platform.step_s", "allowed 0 to 1000000000 s"},
    {"output:", "platform:\n  kind: stops\n  step_s: 1\noutput:", 17, "platform.kind", "either platform.file or platform.waypoints"},
    {"output:", "platform:\n  kind: stops\n  file: a\n  step_s: 1\n  at_end: hold\noutput:", 20, "platform.at_end", "a stops platform has no such key"},
    {"stations:", "platform: {kind: stops, file: a, step_s: 1}\nstations:\n  - {name: b, position_m: [1, 2, 3]}", 11, "stations", "2 of them"},
    {"output:", "beam:\n  mode: cone\noutput:", 17, "beam.mode", "single, rings, adaptive, auto"},
    {"output:", "beam:\n  rings: 19\noutput:", 17, "beam.rings", "0 to 18"},
    {"output:", "cast: {refine: maybe}\noutput:", 16, "cast.refine", "auto, on or off"},
    {"output:", "cast: {refine: off}\nbeam: {mode: auto}\noutput:", 16, "cast.refine", "allowed with beam.mode: single"},
    {"output:", "cast: {refine: off}\nbeam: {mode: rings}\noutput:", 16, "cast.refine", "allowed with beam.mode: single"},
    {"output:", "plan:\n  tolerance_m: 0\noutput:", 17, "plan.tolerance_m", "1e-06 to 1 m"},
    {"output:", "plan:\n  echo_tolerance: 1e-5\noutput:", 17, "plan.echo_tolerance", "0.0001 to 1"},
    {"output:", "plan:\n  cost_ns: 1\noutput:", 17, "plan.cost_ns", "tolerance_m, echo_tolerance"},
    {"output:", "beam:\n  mode: adaptive\ninstrument: {mirror_offset_m: 0.001}\noutput:", 17, "beam.mode", "mirror_offset_m moves the beam; allowed single, rings, auto"},
    {"output:", "platform: {kind: live}\nbeam:\n  mode: adaptive\noutput:", 18, "beam.mode", "allowed single, rings, auto"},
    {"output:", "platform:\n  kind: boat\noutput:", 17, "platform.kind", "static"},
    {"output:", "loop:\n  tick_hz: 300\noutput:", 17, "loop.tick_hz", "a divisor of 1e9"},
    {"output:", "loop:\n  tick_hz: 312.5\noutput:", 17, "loop.tick_hz", "a divisor of 1e9"},
    {"output:", "loop:\n  tick_hz: 50\noutput:", 17, "loop.tick_hz", "from 100 to 10000"},
    {"type: tcp", "type: pty", 15, "links[0].port", "a pty link has no such key; allowed type, path"},
    {"type: tcp", "type: null", 15, "links[0].port", "a null link has no such key"},
    {"port: 0", "path: /tmp/x", 15, "links[0].path", "a tcp link has no such key; allowed type, address, port"},
    /* the time and the receiver */
    {"output:", "time: {epoch: noon}\noutput:", 16, "time.epoch", "not a time as 2026-01-01T00:00:00Z"},
    {"output:", "time: {epoch: 2026-02-30T00:00:00Z}\noutput:", 16, "time.epoch", "there is no 2026-02-30"},
    {"output:", "time: {epoch: 2026-06-30T23:59:60Z}\noutput:", 16, "time.epoch", "has no 23:59:60"},
    {"output:", "time: {epoch: 1980-01-06T00:00:00Z}\noutput:", 16, "time.epoch", "after 1980-01-06"},
    {"output:", "time: {epoch: 2026-01-01T00:00:00+01:00}\noutput:", 16, "time.epoch", "none, utc, tai"},
    {"output:", "time: {epoch: utc, drift_ppm: 1001}\noutput:", 16, "time.drift_ppm", "-1000 to 1000 ppm"},
    {"output:", "gnss: {rate_hz: 3}\noutput:", 16, "gnss.rate_hz", "1, 2, 4, 5, 10 or 20 Hz"},
    {"output:", "gnss: {rate_hz: 8}\noutput:", 16, "gnss.rate_hz", "1, 2, 4, 5, 10 or 20 Hz"},
    {"output:", "gnss: {quality: 3}\noutput:", 16, "gnss.quality", "4 RTK fixed"},
    {"output:", "gnss: {talker: GL}\noutput:", 16, "gnss.talker", "allowed GN, GP"},
    {"    port: 0\n", "    protocol: nmea\n", 11, "stations[0].lat_deg", "a link has the protocol nmea"},
    {"heading_deg: 90\nlinks:\n  - type: tcp\n", "lat_deg: 1\n    lon_deg: 2\n    height_m: 3\n"
     "links:\n  - type: tcp\n    protocol: nmea\n", 17, "links[0].protocol", "time.epoch"},
    {"type: tcp", "type: tcp\n    protocol: scip", 15, "links[0].protocol", "allowed native, nmea"},
    {"port: 0", "backend: usbip", 15, "links[0].backend", "a tcp link has no such key"},
    {"type: tcp", "type: usb\n    max_sessions: 2", 15, "links[0].max_sessions", "a usb link has no such key; allowed type, b"},
    {"type: tcp", "type: usb\n    protocol: nmea", 15, "links[0].protocol", "a usb link has no such key"},
    {"type: tcp", "type: usb\n    speed: fast", 15, "links[0].speed", "allowed full, high, super"},
    {"type: tcp", "type: usb\n    vid: 0x0", 15, "links[0].vid", "0x0001 to 0xffff"},
    {"type: tcp", "type: usb\n    vid: 0x10000", 15, "links[0].vid", "0x0001 to 0xffff"},
    {"type: tcp", "type: usb\n    pid: 0xg", 15, "links[0].pid", "not a number"},
    {"type: tcp", "type: usb\n    vid: 1209", 15, "links[0].vid", "\"1209\" is without 0x; allowed 0x0001 to 0xffff"},
    {"type: tcp", "type: usb\n    attach: on", 15, "links[0].attach", "allowed without port and address"},
    {"type: tcp", "type: usb\n    path: /tmp/x", 15, "links[0].path", "the back end usbip has no such key"},
    {"type: tcp\n    port: 0", "type: usb\n    backend: usbredir", 15, "links[0].backend", "with one of them"},
    {"type: tcp", "type: usb\n    backend: usbredir\n    path: /tmp/x", 16, "links[0].path", "allowed one of them"},
    {"type: tcp", "type: usb\n    backend: usbredir\n    attach: on", 17, "links[0].port", "allowed 1 to 65535"},
    {"type: tcp", "type: usb\n    backend: functionfs", 16, "links[0].port", "the back end functionfs has no such key"},
    {"type: tcp", "type: usb\n    udc: dummy_udc.0", 15, "links[0].udc", "the back end usbip has no such key"},
    {"type: tcp\n    port: 0", "type: file", 14, "links[0].path", "required for a file link"},
    {"type: tcp\n    port: 0", "type: file\n    path: a\n  - type: file\n    path: a", 17, "links[1].path", "same path"},
    {"heading_deg: 90", "name: a\n  - position_m: [0, 0, 0]\n    name: a", 14, "stations[1].name", "same name"},
    /* noise, signal, surfaces, instrument */
#define AT_16(text) "output:", text "\noutput:"
    {AT_16("noise: {range: loud}"), 16, "noise.range", "allowed on or off, or signal"},
    {AT_16("noise: {range: signal}"), 16, "noise.range", "allowed with signal.model: on"},
    {AT_16("noise: {ball: {radius_m: -1}}"), 16, "noise.ball.radius_m", "allowed 0 to 100 m"},
    {AT_16("noise: {ball: {axes: head}}"), 16, "noise.ball.axes", "allowed scene, beam"},
    {AT_16("noise: {ball: {factor: [1, 1, -1]}}"), 16, "noise.ball.factor", "each 0 to 1000"},
    {AT_16("noise: {ball: {radius_m: 1}}\nplatform: {kind: live}"), 16, "noise.ball.radius_m", "allowed axes: beam"},
    {AT_16("signal: {model: dim}"), 16, "signal.model", "allowed on or off"},
    {AT_16("signal: {detection: good}"), 16, "signal.detection", "allowed noisy, sharp"},
    {AT_16("signal: {reflectance: 1.1}"), 16, "signal.reflectance", "allowed 0 to 1"},
    {AT_16("signal: {visibility_m: 500, extinction_1_km: 3}"), 16, "signal.extinction_1_km", "allowed one of them"},
    {AT_16("surfaces: {material: a}"), 16, "surfaces", "allowed a list of 0 to 64"},
    {AT_16("surfaces: [{reflectance: 0.5}, {glass: 0.5, mirror: 0.5}]"), 16, "surfaces[1].mirror", "either glass or mirror"},
    {AT_16("surfaces: [{reflectance: 0.5, glass: 0.6}]"), 16, "surfaces[0]", "add up to 1.1; allowed at most 1"},
    {AT_16("surfaces: [{retro: -1}]"), 16, "surfaces[0].retro", "allowed 0 to 1000000"},
    {AT_16("surfaces: [{reflektance: 1}]"), 16, "surfaces[0].reflektance", "did you mean surfaces[0].reflectance?"},
    {AT_16("optics: {depth: 5}"), 16, "optics.depth", "0 to 4"},
    {AT_16("instrument: {collimation_deg: 11}"), 16, "instrument.collimation_deg", "allowed -10 to 10 deg"},
    {AT_16("instrument: {transit_offset_m: 2}"), 16, "instrument.transit_offset_m", "allowed -1 to 1 m"},
    {FRAMES_AT_4("ambiguity: some"), 4, "head.ambiguity", "allowed none, folded, resolved"},
    {FRAMES_AT_4("mta_zones: 0"), 4, "head.mta_zones", "1 to 1000"},
    /* places: the anchor, the forms of a station's place */
#define ANCHOR(text) "scene:\n", "scene:\n  anchor: {" text "}\n"
#define UTM_PLACE "utm_zone: 33\n    hemisphere: north\n    easting_m: 5e5\n    northing_m: 5e6\n    height_m: 0\n"
    {"heading_deg: 90", "lat_deg: 50", 11, "stations[0].lon_deg", "go together; required, allowed -180 to 180 deg"},
    {"heading_deg: 90", "lat_deg: 50\n    lon_deg: 5", 11, "stations[0].height_m", "go together"},
    {"heading_deg: 90", "height_m: 50", 11, "stations[0].lat_deg", "go together"},
    {"heading_deg: 90", "easting_m: 5e5", 11, "stations[0].utm_zone", "go together"},
    {"heading_deg: 90", "utm_zone: 33\n    easting_m: 5e5\n    northing_m: 5", 11, "stations[0].hemisphere", "allowed south, north"},
    {"heading_deg: 90", "utm_zone: 61", 12, "stations[0].utm_zone", "0 to 60"},
    {"heading_deg: 90", "hemisphere: N", 12, "stations[0].hemisphere", "allowed south, north"},
    {"heading_deg: 90", UTM_PLACE "    lat_deg: 5\n", 12, "stations[0].utm_zone", "together with lat_deg"},
    {"heading_deg: 90", "ecef_m: [6378137, 0, 0]\n    height_m: 5", 13, "stations[0].height_m", "ecef_m says the height"},
    {"heading_deg: 90", "ecef_m: [6378137, 0, 1e8]", 12, "stations[0].ecef_m", "each -10000000 to 10000000 m"},
    {"heading_deg: 90", "pitch_deg: 91", 12, "stations[0].pitch_deg", "allowed -90 to 90 deg"},
    {"heading_deg: 90", "roll_deg: -181", 12, "stations[0].roll_deg", "allowed -180 to 180 deg"},
    {"heading_deg: 90", "instrument_height_m: -1", 12, "stations[0].instrument_height_m", "allowed 0 to 1000 m"},
    {"position_m: [1, 2, 3]\n    heading_deg: 90", "ecef_m: [6378137, 0, 0]", 11, "stations[0].position_m", "no scene.anchor"},
    {ANCHOR("source: mesh"), 6, "scene.anchor.source", "allowed none, explicit, ifc, utm, ecef"},
    {ANCHOR("source: explicit, lon_deg: 5, height_m: 5"), 6, "scene.anchor.lat_deg", "required, allowed -90 to 90 deg"},
    {ANCHOR("source: explicit, lat_deg: 5, lon_deg: 5"), 6, "scene.anchor.height_m", "required"},
    {ANCHOR("source: utm, hemisphere: north"), 6, "scene.anchor.utm_zone", "required, allowed a whole number, 0 to 60"},
    {ANCHOR("source: utm, utm_zone: 33"), 6, "scene.anchor.hemisphere", "required"},
    {ANCHOR("source: utm, utm_zone: 33, hemisphere: north, north_deg: 1"), 6, "scene.anchor.north_deg",
     "no such key; allowed utm_zone, hemisphere"},
    {ANCHOR("lat_deg: 1"), 6, "scene.anchor.lat_deg", "source none has no such key"},
    {ANCHOR("source: ecef, height_m: 1"), 6, "scene.anchor.height_m", "allowed source alone"},
    {ANCHOR("source: ifc, lat_deg: 1"), 6, "scene.anchor.lat_deg", "allowed height_m"},
    {"cube.obj", "none.obj", 7, "scene.meshes[0].file", "No such file"},
    {"cube.obj", "cube.xyz", 7, "scene.meshes[0].file", "allowed .obj .ply .stl"},
    {"cube.obj", "cube", 7, "scene.meshes[0].file", "no known ending"},
    {"cube.obj", "dir.obj", 7, "scene.meshes[0].file", "is not a file"},
    {"riegl-vz400i", "riegl-vz400", 2, "head.profile", "full-sweep, leica-rtc360, riegl-vz400i, riegl-vz600i"},
    {"riegl-vz400i", "heads/none.yaml", 2, "head.profile", "no profile"},
    {"riegl-vz400i", "../heads/x", 2, "head.profile", "no profile"},
};
/* clang-format on */

#endif
