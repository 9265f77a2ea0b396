/* SPDX-License-Identifier: MIT */
/* Keys that only some kinds of platform, link, back end or anchor have: each key with each kind. The tables below were
 * written by hand from the help of the keys. */
#include "firmware_sim/config/load.h"
#include "tests/unit/config_rig.h"

struct owned {
    const char *key, *value;
    const char *kinds; /* a letter for each kind that has the key */
};

/* The allowed keys of a kind, in the order of the table. */
static void list_of(const struct owned *keys, size_t n, char kind, const char *before, char list[512])
{
    size_t used = (size_t)snprintf(list, 512, "%s", before);
    for (size_t i = 0; i < n; i++)
        if (strchr(keys[i].kinds, kind) != NULL)
            used += (size_t)snprintf(list + used, 512 - used, "%s%s", used > 0 ? ", " : "", keys[i].key);
}

/* Whether one of the diagnostics is this one; else whether one says that a key is not there. */
static int is_said(const char *text)
{
    int said = 0;
    for (uint32_t i = 0; i < diagnostics.n && i < CONFIG_MAX_DIAGNOSTICS; i++) {
        if (strstr(diagnostics.err[i].text, text) == NULL) continue;
        said++;
    }
    return said;
}

/* Expects that a key is refused by exactly the kinds that don't have it. */
static void expect_owner(const char *path, const struct owned *key, char kind, const char *owner, const char *allowed)
{
    char want[800];
    const int has = strchr(key->kinds, kind) != NULL;
    snprintf(want, sizeof want, ": %s.%s: %s has no such key; allowed %s", path, key->key, owner, allowed);
    if (!has && is_said(want) != 1) fail_msg("\"%s\", not \"%s\"", err.text, want);
    if (is_said("has no such key") != !has) fail_msg("%s of %s: %s", key->key, owner, err.text);
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
    enum { N = sizeof keys / sizeof keys[0] };
    for (int k = 0; k < 4; k++)
        for (size_t i = 0; i < N; i++) {
            char with[128], owner[32], allowed[512];
            snprintf(with, sizeof with, "platform: {kind: %s, %s: %s}\noutput:", kinds[k], keys[i].key, keys[i].value);
            snprintf(owner, sizeof owner, "a %s platform", kinds[k]);
            list_of(keys, N, "stlp"[k], "kind", allowed);
            load_edited("output:", with);
            expect_owner("platform", &keys[i], "stlp"[k], owner, allowed);
        }
}

/* ---- links: null, file, pty, tcp, usb (s), udp (u), web */

static void links(void **state)
{
    (void)state;
    static const struct owned keys[] = {{"type", "", "nfptsuw"},
                                        {"protocol", "native", "nfptsuw"},
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
    enum { N = sizeof keys / sizeof keys[0] };
    for (int k = 0; k < 7; k++)
        for (size_t i = 1; i < N; i++) {
            char with[128], owner[32], allowed[512];
            /* A key of another back end is the business of the test below. */
            const char *backend = k != 4                             ? ""
                                  : strcmp(keys[i].key, "udc") == 0  ? ", backend: functionfs"
                                  : strcmp(keys[i].key, "path") == 0 ? ", backend: usbredir"
                                                                     : "";
            snprintf(with, sizeof with, "  - {type: %s%s, %s: %s}\n", types[k], backend, keys[i].key, keys[i].value);
            snprintf(owner, sizeof owner, "a %.*s link", (int)strcspn(types[k] + (k == 0), "\""), types[k] + (k == 0));
            list_of(keys, N, "nfptsuw"[k], "", allowed);
            load_edited(ours, with);
            expect_owner("links[0]", &keys[i], "nfptsuw"[k], owner, allowed);
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
    for (int k = 0; k < 3; k++)
        for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++) {
            char with[128], owner[40];
            snprintf(with, sizeof with, "  - {type: usb, backend: %s, %s: %s}\n", backends[k], keys[i].key,
                     keys[i].value);
            snprintf(owner, sizeof owner, "the back end %s", backends[k]);
            load_edited("  - type: tcp\n    port: 0\n", with);
            expect_owner("links[0]", &keys[i], "irf"[k], owner, "without it");
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
    enum { N = sizeof keys / sizeof keys[0] };
    for (int k = 0; k < 6; k++)
        for (size_t i = 0; i <= N; i++) {
            char with[128], owner[48], allowed[512], want[200];
            const char letter = "nxiueg"[k];
            snprintf(with, sizeof with, "  anchor: {source: %s%s%s%s%s}\nstations:", sources[k], i < N ? ", " : "",
                     i < N ? keys[i].key : "", i < N ? ": " : "", i < N ? keys[i].value : "");
            snprintf(owner, sizeof owner, "an anchor of source %s", sources[k]);
            list_of(keys, N, letter, "", allowed);
            if (allowed[0] == '\0') strcpy(allowed, "source alone");
            load_edited("stations:", with);
            if (i < N) expect_owner("scene.anchor", &keys[i], letter, owner, allowed);
            int n = 0;
            for (size_t m = 0; m < sizeof needed / sizeof needed[0]; m++) {
                if (strchr(needed[m].kinds, letter) == NULL) continue;
                if (i < N && strcmp(keys[i].key, needed[m].key) == 0) continue;
                snprintf(want, sizeof want, "scene.anchor.%s: missing, and the anchor's source is %s; required, %s",
                         needed[m].key, sources[k], needed[m].allowed);
                if (is_said(want) != 1) fail_msg("%s is not said of \"%s\"", want, with);
                n++;
            }
            assert_int_equal(is_said("missing, and the anchor's source"), n);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(platforms),
        cmocka_unit_test(links),
        cmocka_unit_test(back_ends),
        cmocka_unit_test(anchors),
    };
    return cmocka_run_group_tests_name("owners of keys", tests, set_up, tear_down);
}
