/* SPDX-License-Identifier: MIT */
/* scanhead soak: each scenario runs for two seconds, and the sheet is compared with the truth about the injected
 * faults.
 *
 * The heads run beside each other and mostly wait. Their ticks may be late, so that a busy machine costs no pulses. */
#include "tests/wire/room.h"

enum { N_SCENARIOS = 11 };

static const struct {
    const char *name;
    const char *must[16]; /* kinds that strike within two seconds of a scan over TCP */
} SCENARIOS[N_SCENARIOS] = {
    {"hostile-wire",
     {"drop", "truncate", "flip", "duplicate", "reorder", "garbage", "stall", "delay", "jitter", "split", "merge",
      "no_reply", "late_reply", "wrong_reply", "echo"}},
    {"lossy-udp", {"drop", "duplicate", "reorder", "jitter", "truncate"}},
    {"flaky-usb", {"flip", "truncate", "garbage", "stall", "unplug", "disconnect"}},
    {"brown-out", {"power_cycle", "disconnect", "truncate"}},
    {"slow-boot", {"slow_boot", "self_test", "refuse", "late_reply", "no_reply"}},
    {"dying-motor", {"mirror_wobble", "mirror_slow", "mirror_stuck", "pan_slip", "laser_off"}},
    {"pulled-cable", {"cable"}},
    {"clock-step", {"clock_jump", "pps_lost", "clock_drift", "clock_stop"}},
    {"gnss-outage", {"pps_jitter", "nmea_late", "nmea_void", "nmea_checksum", "nmea_lost"}},
    {"time-server", {"ntp_step"}},
    {"ptp-holdover", {"ptp_jitter", "ptp_faulty"}},
};

/* Some 1300 frames a second. */
static const struct room_config SLOW = {.prr_hz = 30000,
                                        .lines_hz = 90,
                                        .pan_deg_s = 10,
                                        .pan_stop_deg = 360,
                                        .frames = 1,
                                        .links = LINK_YAML_BOTH,
                                        .more = "loop: {late_ms: 900, queue_ms: 2000}\n"
                                                "time: {epoch: \"2026-01-01T00:00:00Z\", ptp: {follower: on}}\n"};

/* A link of protocol cola makes a head one that may ask a time server. */
static const struct room_config SCANNER = {
    .profile = "sick-lms111",
    .prr_hz = 36000,
    .lines_hz = 50,
    .links = "links: [{type: tcp, port: 0}, {type: pty, path: port}, {type: tcp, port: 0, protocol: cola}]\n",
    .more = "loop: {late_ms: 900, queue_ms: 2000}\n"};

static const char *path_of(const struct wire *wire, const char *name, const char *ending)
{
    char file[64];
    snprintf(file, sizeof file, "%s.%s", name, ending);
    return wire_path(wire, file);
}

/* Starts one of the scenarios that come with this source. */
static pid_t start(struct wire *wire, const char *name, const char *seconds, const char *link)
{
    char config[352], file[352], json[352], truth[352], out[64], err[64];
    snprintf(config, sizeof config, "%s",
             wire_path(wire, strcmp(name, "time-server") == 0 ? "scanner.yaml" : "config.yaml"));
    snprintf(json, sizeof json, "%s", path_of(wire, name, "json"));
    snprintf(truth, sizeof truth, "%s", path_of(wire, name, "truth"));
    snprintf(file, sizeof file, strchr(name, '/') != NULL ? "%s" : "config/faults/%s.yaml", name);
    snprintf(out, sizeof out, "%s.out", name);
    snprintf(err, sizeof err, "%s.err", name);
    char port[64];
    snprintf(port, sizeof port, "links.1.path=%s-port", name);
    const char *const args[] = {"soak",    config,  "--scenario", file,     "--duration", seconds,
                                "--link",  link,    "--json",     json,     "--truth",    truth,
                                "--quiet", "--set", port,         "--pace", "realtime",   NULL};
    return wire_spawn(wire, args, out, err, -1);
}

/* ---- the sheet, and the truth */

static uint64_t value_after(const char *text, const char *key)
{
    char quoted[64];
    snprintf(quoted, sizeof quoted, "\"%s\": ", key);
    const char *at = strstr(text, quoted);
    assert_non_null(at);
    return strtoull(at + strlen(quoted), NULL, 10);
}

/* The sum over the whole sheet comes after all rows. */
static uint64_t total(const char *json, const char *key)
{
    const char *at = strstr(json, "\"clean_sha256\"");
    assert_non_null(at);
    return value_after(at, key);
}

/* Returns how many lines of the truth have all of these texts, but not the last. */
static uint64_t count_lines(const char *truth, const char *has, const char *and, const char *but)
{
    uint64_t n = 0;
    for (const char *line = truth; *line != '\0';) {
        const char *end = strchr(line, '\n');
        char text[1024];
        snprintf(text, sizeof text, "%.*s", (int)(end - line), line);
        n += strstr(text, has) != NULL && strstr(text, and) != NULL && strstr(text, but) == NULL;
        line = end + 1;
    }
    return n;
}

static void check_kind(const char *name, const char *json, const char *truth, const char *kind)
{
    char quoted[64], row[64];
    snprintf(quoted, sizeof quoted, "\"kind\":\"%s\"", kind);
    snprintf(row, sizeof row, "\"fault\": \"%s\"", kind);
    /* Faults in the head have no link, and each link has a row of them. Only one link has a client here. */
    uint64_t n = count_lines(truth, quoted, "\"link\":1", "resealed") + count_lines(truth, quoted, "", "\"link\":");
    n -= count_lines(truth, quoted, "\"ended\"", "resealed");
    const char *at = strstr(json, row);
    if (n == 0 || at == NULL) fail_msg("%s: %s never struck", name, kind);
    assert_int_equal(value_after(at, "injected"), n);
    assert_int_equal(value_after(at, "missed"), 0);
    assert_int_equal(value_after(at, "noticed") + value_after(at, "hidden"), n);
}

static void check(struct wire *wire, const char *name, const char *const *must)
{
    char *json = wire_read(path_of(wire, name, "json"), NULL), *truth = wire_read(path_of(wire, name, "truth"), NULL);
    assert_non_null(strstr(json, "\"good\": true"));
    for (int i = 0; i < 16 && must[i] != NULL; i++)
        check_kind(name, json, truth, must[i]);
    /* Frames that differ and were accepted are exactly the resealed ones. */
    const uint64_t resealed = count_lines(truth, "resealed", "", "?");
    assert_int_equal(total(json, "wrongly_accepted"), resealed);
    if (strcmp(name, "hostile-wire") == 0) assert_true(resealed != 0);
    const char *faulty = strstr(json, "\"fault\": \"ptp_faulty\""); /* the client saw the port's event */
    if (strcmp(name, "ptp-holdover") == 0) assert_int_equal(value_after(faulty, "noticed"), 1);
    assert_int_equal(total(json, "missed"), 0);
    free(json);
    free(truth);
}

static void test_each_scenario_over_tcp(void **state)
{
    struct wire *wire = *state;
    pid_t pid[N_SCENARIOS];
    char scanner[352];
    room_write(wire);
    snprintf(scanner, sizeof scanner, "%s", wire_path(wire, "scanner.yaml"));
    assert_int_equal(rename(room_config_write(wire, &SCANNER), scanner), 0);
    room_config_write(wire, &SLOW);
    for (int i = 0; i < N_SCENARIOS; i++)
        pid[i] = start(wire, SCENARIOS[i].name, "3", "1");
    for (int i = 0; i < N_SCENARIOS; i++) {
        const int status = wire_wait(wire, pid[i]);
        if (status != 0) {
            wire_show(wire, strrchr(path_of(wire, SCENARIOS[i].name, "out"), '/') + 1);
            wire_show(wire, strrchr(path_of(wire, SCENARIOS[i].name, "err"), '/') + 1);
            fail_msg("%s: status %d", SCENARIOS[i].name, status);
        }
        check(wire, SCENARIOS[i].name, SCENARIOS[i].must);
    }
}

static void test_a_terminal(void **state)
{
    struct wire *wire = *state;
    room_write(wire);
    room_config_write(wire, &SLOW);
    const pid_t hostile = start(wire, "hostile-wire", "2", "2"), flaky = start(wire, "flaky-usb", "2", "2");
    if (wire_wait(wire, hostile) != 0) {
        wire_show(wire, "hostile-wire.out");
        fail();
    }
    if (wire_wait(wire, flaky) != 0) {
        wire_show(wire, "flaky-usb.out");
        fail();
    }
}

/* In the pace fast the client holds the head back. Faults strike all the same. JSON has standard output for itself. */
static void test_the_pace_fast(void **state)
{
    struct wire *wire = *state;
    room_write(wire);
    char config[352];
    snprintf(config, sizeof config, "%s", room_config_write(wire, &SLOW));
    const char *const args[] = {"soak",       config,   "--scenario", "config/faults/lossy-udp.yaml",
                                "--duration", "5",      "--json",     "-",
                                "--quiet",    "--pace", "fast",       NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
    char *text = wire_read(wire_path(wire, "out"), NULL);
    assert_true(text[0] == '{' && strcmp(text + strlen(text) - 3, "\n}\n") == 0);
    assert_true(total(text, "injected") > 100);
    free(text);
}

/* Packets of a VLP-16, beside those of a second link without faults. */
static void test_datagrams(void **state)
{
    struct wire *wire = *state;
    char config[352], json[352], links[128];
    int port;
    close(wire_bind(SOCK_DGRAM, &port)); /* a port that is free */
    snprintf(links, sizeof links, "links: [{type: udp, protocol: velodyne, address: 127.0.0.1, port: %d}]\n", port);
    room_write(wire);
    snprintf(config, sizeof config, "%s", wire_path(wire, "beams.yaml"));
    FILE *f = fopen(config, "w");
    assert_non_null(f);
    fprintf(f,
            "head: {profile: velodyne-vlp16, lines_hz: 10, frames: 0}\n"
            "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\nstations: [{position_m: [0, 0, 0.2]}]\n"
            "loop: {late_ms: 900, queue_ms: 2000}\nbeam: {mode: single, echoes: strongest}\n%s",
            links);
    assert_int_equal(fclose(f), 0);
    snprintf(json, sizeof json, "%s", wire_path(wire, "udp.json"));
    const char *const args[] = {"soak",       config, "--scenario", "config/faults/hostile-wire.yaml",
                                "--duration", "2",    "--json",     json,
                                "--truth",    "-",    "--quiet",    NULL};
    const int status = wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
    if (status != 0) wire_show(wire, "err");
    assert_int_equal(status, 0);
    char *text = wire_read(json, NULL), *said = wire_read(wire_path(wire, "out"), NULL);
    assert_null(strstr(said, "noticed")); /* the sheet is elsewhere */
    assert_int_equal(total(text, "injected"), count_lines(said, "\"link\":1", "", "?"));
    assert_int_equal(total(text, "wrongly_accepted"), count_lines(said, "resealed", "", "?"));
    assert_true(total(text, "noticed") > 10);
    free(text);
    free(said);
}

static void test_wrong_usage(void **state)
{
    struct wire *wire = *state;
    room_write(wire);
    char config[352];
    snprintf(config, sizeof config, "%s", room_config_write(wire, &SLOW));
    wire_expect_usage(wire, (const char *const[]){"soak", config, "--scenario", "nothing", NULL}, "no such scenario");
    wire_expect_usage(wire, (const char *const[]){"soak", config, "--link", "3", NULL}, "allowed 1 to 2");
    wire_expect_usage(wire, (const char *const[]){"soak", config, "--pace", "step", NULL}, "allowed realtime and fast");
    struct room_config none = SLOW;
    none.links = "links: [{type: null}]\n";
    snprintf(config, sizeof config, "%s", room_config_write(wire, &none));
    wire_expect_usage(wire, (const char *const[]){"soak", config, NULL}, "soak can use none of them");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_each_scenario_over_tcp, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_terminal, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_the_pace_fast, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_datagrams, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_wrong_usage, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
