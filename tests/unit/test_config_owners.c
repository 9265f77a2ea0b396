/* SPDX-License-Identifier: MIT */
/* Some keys belong to some kinds of platform, link, back end or anchor alone: each key is tried with each kind. The
 * tables below were written by hand from the help of the keys. */
#include "firmware_sim/config/load.h"
#include "tests/unit/config_rig.h"

#define N_OF(array) (sizeof(array) / sizeof(array)[0])

struct owned {
    const char *key, *value;
    const char *kinds; /* a letter for each kind that has the key */
};

/* Writes the allowed keys of a kind, in the order of the table. */
static void list_of(const struct owned *keys, size_t n, char kind, const char *before, char list[512])
{
    size_t used = (size_t)snprintf(list, 512, "%s", before);
    for (size_t i = 0; i < n; i++)
        if (strchr(keys[i].kinds, kind) != NULL)
            used += (size_t)snprintf(list + used, 512 - used, "%s%s", used > 0 ? ", " : "", keys[i].key);
}

/* Returns how many of the diagnostics say this. */
static int n_said(const char *text)
{
    int said = 0;
    for (uint32_t i = 0; i < diagnostics.n && i < CONFIG_MAX_DIAGNOSTICS; i++)
        said += strstr(diagnostics.err[i].text, text) != NULL;
    return said;
}

/* Writes "key: value, key: value" of the keys that a kind has, or of those that it lacks. */
static void write_keys(const struct owned *keys, size_t n, char kind, int has, char text[1024])
{
    size_t used = 0;
    text[0] = '\0';
    for (size_t i = 0; i < n; i++)
        if ((strchr(keys[i].kinds, kind) != NULL) == has)
            used += (size_t)snprintf(text + used, 1024 - used, ", %s: %s", keys[i].key, keys[i].value);
}

/* Loads an edit of base, "BEGINNING, key: value, ...END", with the keys that a kind has, none of which is refused, and
 * with those that it lacks, each of which is. */
static void expect_owners(const char *old, const char *begin, const char *end, const char *path,
                          const struct owned *keys, size_t n, char kind, const char *owner, const char *allowed)
{
    char text[1024], with[1400], want[800];
    for (int has = 1; has >= 0; has--) {
        int lacks = 0;
        write_keys(keys, n, kind, has, text);
        snprintf(with, sizeof with, "%s%s%s", begin, text, end);
        load_edited(old, with);
        for (size_t i = 0; i < n && !has; i++) {
            if (strchr(keys[i].kinds, kind) != NULL) continue;
            snprintf(want, sizeof want, ": %s.%s: %s has no such key; allowed %s", path, keys[i].key, owner, allowed);
            if (n_said(want) != 1) fail_msg("\"%s\" is not said of %s", want, with);
            lacks++;
        }
        snprintf(want, sizeof want, ": %s has no such key", owner);
        if (n_said(want) != lacks) fail_msg("%s: %s", with, err.text);
    }
}

/* ---- platforms: static, trajectory, live, stops (p) */

static void platforms(void **state)
{
    (void)state;
    static const struct owned keys[] = {{"file", "a", "tp"},
                                        {"waypoints", "a", "tp"},
                                        {"start_s", "1", "tp"},
                                        {"end_s", "2", "tp"},
                                        {"step_s", "1", "p"},
                                        {"frames_per_s", "1", "p"},
                                        {"first_frame", "1", "p"},
                                        {"last_frame", "2", "p"},
                                        {"frame_step", "1", "p"},
                                        {"at_end", "hold", "t"},
                                        {"mount_m", "[0, 0, 1]", "tlp"},
                                        {"mount_heading_deg", "1", "tlp"},
                                        {"mount_pitch_deg", "1", "tlp"},
                                        {"mount_roll_deg", "1", "tlp"},
                                        {"reach_m", "10", "l"},
                                        {"extrapolate_ms", "10", "l"},
                                        {"address", "127.0.0.1", "l"},
                                        {"port", "9", "l"}};
    static const char *const kinds[] = {"static", "trajectory", "live", "stops"};
    for (int k = 0; k < 4; k++) {
        char begin[64], owner[32], allowed[512];
        snprintf(begin, sizeof begin, "platform: {kind: %s", kinds[k]);
        snprintf(owner, sizeof owner, "a %s platform", kinds[k]);
        list_of(keys, N_OF(keys), "stlp"[k], "kind", allowed);
        expect_owners("output:", begin, "}\noutput:", "platform", keys, N_OF(keys), "stlp"[k], owner, allowed);
    }
}

/* ---- links: null, file, pty, tcp, usb (s), udp (u), web */

static void links(void **state)
{
    (void)state;
    static const struct owned keys[] = {{"protocol", "native", "nfptsuw"},
                                        {"dialect", "any", "nfptsuw"},
                                        {"path", "a", "fps"},
                                        {"baud", "9600", "p"},
                                        {"address", "127.0.0.1", "tsuw"},
                                        {"port", "9", "tsuw"},
                                        {"interface", "lo", "u"},
                                        {"source", "127.0.0.1", "u"},
                                        {"source_port", "9", "u"},
                                        {"ttl", "9", "u"},
                                        {"max_sessions", "2", "tw"},
                                        {"waits", "no", "nfptsuw"},
                                        {"latency_ms", "1", "ptsuw"},
                                        {"backend", "usbip", "s"},
                                        {"attach", "on", "s"},
                                        {"udc", "a", "s"},
                                        {"speed", "high", "s"},
                                        {"vid", "0x1209", "s"},
                                        {"pid", "0x0001", "s"},
                                        {"serial", "a", "s"}};
    static const char *const types[] = {"\"null\"", "file", "pty", "tcp", "usb", "udp", "web"};
    static const char ours[] = "  - type: tcp\n    port: 0\n";
    for (int k = 0; k < 7; k++) {
        char begin[64], owner[32], allowed[512];
        const char *type = types[k] + (k == 0);
        snprintf(begin, sizeof begin, "  - {type: %s", types[k]);
        snprintf(owner, sizeof owner, "a %.*s link", (int)strcspn(type, "\""), type);
        list_of(keys, N_OF(keys), "nfptsuw"[k], "type", allowed);
        expect_owners(ours, begin, "}\n", "links[0]", keys, N_OF(keys), "nfptsuw"[k], owner, allowed);
    }
}

/* ---- back ends of USB links: usbip, usbredir, functionfs */

static void back_ends(void **state)
{
    (void)state;
    static const struct owned keys[] = {
        {"path", "a", "r"},        {"address", "127.0.0.1", "ir"}, {"port", "9", "ir"},   {"attach", "on", "ir"},
        {"udc", "a", "f"},         {"speed", "high", "irf"},       {"vid", "0x1", "irf"}, {"serial", "a", "irf"},
        {"latency_ms", "1", "irf"}};
    static const char *const backends[] = {"usbip", "usbredir", "functionfs"};
    for (int k = 0; k < 3; k++) {
        char begin[64], owner[40];
        snprintf(begin, sizeof begin, "  - {type: usb, backend: %s", backends[k]);
        snprintf(owner, sizeof owner, "the back end %s", backends[k]);
        expect_owners("  - type: tcp\n    port: 0\n", begin, "}\n", "links[0]", keys, N_OF(keys), "irf"[k], owner,
                      "without it");
    }
}

/* ---- anchors: none (n), explicit (x), ifc, utm, ecef, geotiff */

static void anchors(void **state)
{
    (void)state;
    static const struct owned keys[] = {{"origin_m", "[1, 2, 3]", "x"}, {"lat_deg", "49", "x"},
                                        {"lon_deg", "8", "x"},          {"height_m", "100", "xig"},
                                        {"north_deg", "5", "x"},        {"utm_zone", "32", "u"},
                                        {"hemisphere", "north", "u"}};
    static const struct {
        const char *key, *kinds, *allowed;
    } needed[] = {{"lat_deg", "x", "allowed -90 to 90 deg"},
                  {"lon_deg", "x", "allowed -180 to 180 deg"},
                  {"height_m", "x", "allowed -1000 to 10000 m"},
                  {"utm_zone", "u", "allowed a whole number, 0 to 60"},
                  {"hemisphere", "u", "allowed south, north"}};
    static const char *const sources[] = {"none", "explicit", "ifc", "utm", "ecef", "geotiff"};
    for (int k = 0; k < 6; k++) {
        char begin[64], owner[48], allowed[512], want[200];
        const char letter = "nxiueg"[k];
        snprintf(begin, sizeof begin, "  anchor: {source: %s", sources[k]);
        snprintf(owner, sizeof owner, "an anchor of source %s", sources[k]);
        list_of(keys, N_OF(keys), letter, "", allowed);
        if (allowed[0] == '\0') strcpy(allowed, "source alone");
        expect_owners("stations:", begin, "}\nstations:", "scene.anchor", keys, N_OF(keys), letter, owner, allowed);
        /* The keys that it lacks are given, and those that it needs are not. */
        int n = 0;
        for (size_t m = 0; m < N_OF(needed); m++) {
            if (strchr(needed[m].kinds, letter) == NULL) continue;
            snprintf(want, sizeof want, "scene.anchor.%s: missing, and the anchor's source is %s; required, %s",
                     needed[m].key, sources[k], needed[m].allowed);
            if (n_said(want) != 1) fail_msg("%s is not said", want);
            n++;
        }
        assert_int_equal(n_said("missing, and the anchor's source"), n);
        load_edited("stations:", letter == 'x'
                                     ? "  anchor: {source: explicit, lat_deg: 1, lon_deg: 2, height_m: 3}\nstations:"
                                 : letter == 'u' ? "  anchor: {source: utm, utm_zone: 0, hemisphere: south}\nstations:"
                                                 : "stations:");
        assert_int_equal(n_said("missing, and the anchor's source"), 0);
    }
}

/* Points have the number of a frame on a trajectory and at stops. */
static void colours_of_frames(void **state)
{
    (void)state;
    static const struct {
        const char *kind, *rest;
        int has_frames;
    } kinds[] = {
        {"static", "", 0}, {"live", "", 0}, {"trajectory", ", file: a", 1}, {"stops", ", file: a, step_s: 1", 1}};
    for (size_t i = 0; i < N_OF(kinds); i++) {
        char with[128], want[160];
        snprintf(with, sizeof with, "  crs: local\n  colour: frame\nplatform: {kind: %s%s}\n", kinds[i].kind,
                 kinds[i].rest);
        snprintf(
            want, sizeof want,
            ":18: output.colour: frame, but points have no frame scalar: platform.kind is %s; allowed with trajectory, "
            "stops",
            kinds[i].kind);
        load_edited("  crs: local\n", with);
        assert_int_equal(n_said(want), !kinds[i].has_frames);
        assert_int_equal(diagnostics.n, !kinds[i].has_frames);
    }
}

/* ---- coordinate systems of the output: heights above the geoid, and a zone */

static void coordinate_systems(void **state)
{
    (void)state;
    static const struct {
        const char *crs;
        int has_heights, has_zone;
    } systems[] = {{"local", 0, 0}, {"ecef", 0, 0}, {"utm", 1, 1}, {"geodetic", 1, 0}};
    for (size_t i = 0; i < N_OF(systems); i++)
        for (int given = 0; given < 2; given++) {
            char with[96];
            snprintf(with, sizeof with, "  crs: %s\n%s", systems[i].crs,
                     given ? "  heights: geoid\n  utm_zone: 32\n" : "  heights: ellipsoid\n  utm_zone: 0\n");
            load_edited("  crs: local\n", with);
            assert_int_equal(
                n_said(":18: output.heights: geoid, but output.crs has no heights; allowed only with crs: utm, "
                       "geodetic"),
                given && !systems[i].has_heights);
            assert_int_equal(
                n_said(":19: output.utm_zone: a zone, but output.crs is not utm; allowed only with crs: utm"),
                given && !systems[i].has_zone);
            assert_int_equal(n_said(": output."), given * (2 - systems[i].has_heights - systems[i].has_zone));
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(platforms),         cmocka_unit_test(links),
        cmocka_unit_test(back_ends),         cmocka_unit_test(anchors),
        cmocka_unit_test(colours_of_frames), cmocka_unit_test(coordinate_systems),
    };
    return cmocka_run_group_tests_name("owners of keys", tests, set_up, tear_down);
}
