/* SPDX-License-Identifier: MIT */
/* scanhead soak --client: each planted fault of a client gives its finding and no other; a right client gives none. */
#include "tests/wire/faulty_client.h"
#include "tests/wire/room.h"

static const char *program; /* of this test, which is also the client */

/* Some 600 frames a second, of 16 points. No two pulses have the same direction. */
static const struct room_config ROOM = {
    .prr_hz = 10000,
    .lines_hz = 50,
    .pan_deg_s = 20,
    .pan_stop_deg = 360,
    .frames = 1,
    .links = LINK_YAML_TCP,
    .more = "output: {layout: geo, crs: local}\nloop: {late_ms: 5000, queue_ms: 5000}\n"};

/* The byte is in x of a frame's first point, where a bit is some 3 m or more: PROTOCOL.md, POINTS.md (28 + 40 + 2). */
static const char FAULTS[] = "faults:\n"
                             "  - {kind: flip, byte: 70, from: 20, every: 40, from_pulse: 1}\n"
                             "  - {kind: duplicate, from: 30, every: 40, from_pulse: 1}\n"
                             "  - {kind: drop, from: 35, every: 40, from_pulse: 1}\n"
                             "  - {kind: disconnect, at: 300, count: 1}\n";

/* 40 scans a second. Noise of 0.1 m tells apart the scans of a head that stands still. */
static const char SCIP[] =
    "head: {profile: hokuyo-utm-30lx}\n"
    "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\nstations: [{position_m: [0, 0, 0.2]}]\n"
    "noise: {range: on, sigma_m: 0.1}\nbeam: {mode: single}\n"
    "loop: {late_ms: 5000, queue_ms: 5000}\nlinks: [{type: tcp, port: 0, protocol: scip}]\n";

/* The byte is the first of a value, where a bit is 4 m or more: SCIP.md, 16 + 4 + 6 bytes and then lines of 66. */
static const char SCIP_FAULTS[] = "faults:\n"
                                  "  - {kind: flip, byte: 500, from: 4, every: 6}\n"
                                  "  - {kind: duplicate, from: 5, every: 6}\n"
                                  "  - {kind: disconnect, at: 18, count: 1}\n";

static void write_files(const struct wire *wire)
{
    room_write(wire);
    room_config_write(wire, &ROOM);
    wire_write_text(wire, "scip.yaml", SCIP);
}

static const char *in_folder(const struct wire *wire, const char *name, const char *ending)
{
    char file[64];
    snprintf(file, sizeof file, "%s.%s", name, ending);
    return wire_path(wire, file);
}

/* A right client needs none of its limits, which are far beyond the time of a busy machine. Where the fault is that
 * nothing happens, the whole limit is waited for. The same limit holds for the client's first connection, so it has to
 * be longer than a client takes to start. */
struct planted {
    const char *faults, *findings, *limit_s, *grace_s;
};

/* Each has a scenario file of its own, whose name is also that of the log. */
static pid_t start_case(struct wire *wire, const struct planted *planted, const char *config, const char *client)
{
    const char *faults = strcmp(config, "config.yaml") == 0 ? FAULTS : SCIP_FAULTS;
    char config_path[352], scenario[352], command[512], json[352], junit[352], name[64], err[64];
    snprintf(config_path, sizeof config_path, "%s", wire_path(wire, config));
    snprintf(name, sizeof name, "%s.yaml", planted->faults);
    snprintf(scenario, sizeof scenario, "%s", wire_write_text(wire, name, faults));
    snprintf(command, sizeof command, "exec %s {host} {port} {out} %s", client, planted->faults);
    snprintf(json, sizeof json, "%s", in_folder(wire, planted->faults, "json"));
    snprintf(junit, sizeof junit, "%s", in_folder(wire, planted->faults, "xml"));
    snprintf(name, sizeof name, "%s.out", planted->faults);
    snprintf(err, sizeof err, "%s.err", planted->faults);
    const char *const args[] = {"soak",
                                config_path,
                                "--scenario",
                                scenario,
                                "--client",
                                command,
                                "--json",
                                json,
                                "--junit",
                                junit,
                                "--client-file",
                                "{out}",
                                "--client-folder",
                                wire->dir,
                                "--reconnect-limit",
                                planted->limit_s,
                                "--client-grace",
                                planted->grace_s,
                                "--duration",
                                "0.8",
                                "--quiet",
                                NULL};
    return wire_spawn(wire, args, name, err, -1);
}

/* Writes the names of findings, in the order of the sheet and with blanks between them. */
static void find_names(const char *json, char *names, size_t cap)
{
    size_t len = 0;
    names[0] = '\0';
    for (const char *at = json; (at = strstr(at, "\"check\": \"")) != NULL;) {
        const char *name = at + strlen("\"check\": \""), *result = strstr(name, "\"result\": \"");
        at = result;
        if (strncmp(result, "\"result\": \"finding\"", 19) != 0) continue;
        len += (size_t)snprintf(names + len, cap - len, "%s%.*s", len > 0 ? " " : "", (int)strcspn(name, "\""), name);
    }
}

static int count_of(const char *text, const char *what)
{
    int n = 0;
    for (const char *at = text; (at = strstr(at, what)) != NULL; at += strlen(what))
        n++;
    return n;
}

/* The XML has a test case for each check, and a failure for each finding. */
static void expect_junit(const struct wire *wire, const char *name, const char *findings)
{
    char *xml = wire_read(in_folder(wire, name, "xml"), NULL), total[64];
    const int n = findings[0] != '\0' ? 1 + count_of(findings, " ") : 0;
    snprintf(total, sizeof total, "<testsuites tests=\"11\" failures=\"%d\">", n);
    assert_int_equal(count_of(xml, total), 1);
    assert_int_equal(count_of(xml, "<testcase classname="), 11);
    assert_int_equal(count_of(xml, "<failure message="), n);
    free(xml);
}

static void expect(struct wire *wire, pid_t pid, const char *name, const char *findings)
{
    char names[256];
    const int status = wire_wait(wire, pid);
    char *json = status <= 1 ? wire_read(in_folder(wire, name, "json"), NULL) : NULL;
    if (json != NULL) find_names(json, names, sizeof names);
    if (json == NULL || strcmp(names, findings) != 0 || status != (findings[0] != '\0')) {
        char file[64];
        snprintf(file, sizeof file, "%s.out", name);
        wire_show(wire, file);
        snprintf(file, sizeof file, "%s.err", name);
        wire_show(wire, file);
        fail_msg("%s: status %d, findings '%s' instead of '%s'", name, status, json != NULL ? names : "?", findings);
    }
    free(json);
    expect_junit(wire, name, findings);
}

static const struct planted PLANTED[] = {
    {"none", "", "60", "60"},
    {"c", "points-known", "60", "60"},
    {"s", "comes-back", "5", "60"},
    {"t", "points-once", "60", "60"},
    {"cst", "comes-back points-known points-once", "5", "60"},
};
static const struct planted OTHERS[] = {
    {"h", "lets-go", "5", "60"}, {"a", "asks-right", "60", "60"},       {"d", "lives", "60", "60"},
    {"k", "ends", "60", "0.5"},  {"n", "scans points-read", "5", "60"},
};
enum { N_CASES = 5 };

/* All at once: they mostly wait. */
static void try_cases(struct wire *wire, const char *config, const char *client, const struct planted cases[N_CASES])
{
    pid_t pid[N_CASES];
    write_files(wire);
    for (int i = 0; i < N_CASES; i++)
        pid[i] = start_case(wire, &cases[i], config, client);
    for (int i = 0; i < N_CASES; i++)
        expect(wire, pid[i], cases[i].faults, cases[i].findings);
}

static const char *client_in_c(void)
{
    static char client[352];
    snprintf(client, sizeof client, "%s client", program);
    return client;
}

static void test_a_client_in_c(void **state)
{
    try_cases(*state, "config.yaml", client_in_c(), PLANTED);
}

static void test_other_faults(void **state)
{
    try_cases(*state, "config.yaml", client_in_c(), OTHERS);
}

/* Two scenarios in turn; points on standard output; a finding that the user allows. */
static void test_scenarios_in_turn(void **state)
{
    struct wire *wire = *state;
    char config[352], first[352], second[352], json[352], command[512];
    write_files(wire);
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(first, sizeof first, "%s", wire_write_text(wire, "first.yaml", FAULTS));
    snprintf(second, sizeof second, "%s", wire_write_text(wire, "second.yaml", "faults: [{kind: refuse, at: 1}]\n"));
    snprintf(json, sizeof json, "%s", wire_path(wire, "turn.json"));
    snprintf(command, sizeof command, "exec %s {host} {port} /dev/stdout c", client_in_c());
    const char *args[] = {"soak",       config,     "--scenario",      first,     "--scenario",
                          second,       "--client", command,           "--json",  json,
                          "--duration", "0.3",      "--client-folder", wire->dir, "--client-file",
                          "-",          "--allow",  "points-known",    "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
    char *text = wire_read(json, NULL);
    assert_int_equal(count_of(text, "\"result\": \"allowed\""), 1);
    assert_int_equal(count_of(text, "\"scenario\": \"1-first\""), 1);
    assert_int_equal(count_of(text, "\"scenario\": \"2-second\""), 1);
    assert_int_equal(count_of(text, "at most (refuse)"), 1);
    assert_int_equal(count_of(text, "\"kind\": \"refuse\""), 1);
    free(text);
}

/* A file of points that was there before, and that the client left as it was, is not judged as its own. */
static void test_a_file_from_before(void **state)
{
    struct wire *wire = *state;
    char config[352], old[352], command[512], names[256];
    write_files(wire);
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(old, sizeof old, "%s", wire_write_text(wire, "old.points", "1 2 3\n"));
    snprintf(command, sizeof command, "exec %s {host} {port} {out} none", client_in_c());
    const char *const args[] = {"soak",          config, "--client",   command, "--json",          "-",
                                "--client-file", old,    "--duration", "0.1",   "--client-folder", wire->dir,
                                "--quiet",       NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 1);
    char *text = wire_read(wire_path(wire, "out"), NULL);
    find_names(text, names, sizeof names);
    assert_string_equal(names, "points-read");
    assert_int_equal(count_of(text, "old.points: the client did not write it"), 1);
    free(text);
}

static void test_a_client_that_stays_away(void **state)
{
    struct wire *wire = *state;
    char config[352], names[256];
    write_files(wire);
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    const char *const args[] = {
        "soak",    config,       "--client", "exec sleep 600",    "--json", "-",       "--client-folder",
        wire->dir, "--duration", "0.3",      "--reconnect-limit", "0.3",    "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 1);
    char *text = wire_read(wire_path(wire, "out"), NULL);
    assert_true(text[0] == '{' && strcmp(text + strlen(text) - 3, "\n}\n") == 0); /* nothing else is there */
    find_names(text, names, sizeof names);
    assert_string_equal(names, "connects");
    assert_int_equal(count_of(text, "no frame was left out"), 0); /* nor is a speed judged that nobody saw */
    free(text);
}

/* The second scenario's client asks for the end as a user does, at the program that has started it. */
static void test_a_stop_in_the_second_scenario(void **state)
{
    struct wire *wire = *state;
    char config[352], first[352], second[352], json[352];
    write_files(wire);
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(first, sizeof first, "%s",
             wire_write_text(wire, "first.yaml", "faults: [{kind: stall, for_ms: 1, at: 1}]\n"));
    snprintf(second, sizeof second, "%s",
             wire_write_text(wire, "second.yaml", "faults: [{kind: stall, for_ms: 1, at: 1}]\n"));
    snprintf(json, sizeof json, "%s", wire_path(wire, "json"));
    const char *const args[] = {"soak",
                                config,
                                "--scenario",
                                first,
                                "--scenario",
                                second,
                                "--client",
                                "case {out} in *2-second*) kill -INT $PPID;; esac; exec sleep 600",
                                "--json",
                                json,
                                "--duration",
                                "0.1",
                                "--reconnect-limit",
                                "0.1",
                                "--client-folder",
                                wire->dir,
                                "--quiet",
                                NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 1);
    char *text = wire_read(json, NULL), *err = wire_read(wire_path(wire, "err"), NULL);
    assert_int_equal(count_of(text, "\"scenario\": \"1-first\""), 1);
    assert_int_equal(count_of(text, "\"scenario\": \"2-second\""), 0);
    assert_int_equal(count_of(err, "soak: stopped; of 2 scenarios 1 were judged"), 1);
    free(text);
    free(err);
}

static void test_wrong_usage(void **state)
{
    static const struct {
        const char *args[7], *says;
    } cases[] = {
        {{"--junit", "x"}, "need --client"},
        {{"--reconnect-limit", "3"}, "need --client"},
        {{"--scenario", "a", "--scenario", "b"}, "need --client"},
        {{"--client", "true", "--allow", "speed"}, "--allow speed: allowed are connects"},
        {{"--client", "true", "--pace", "fast"}, "allowed is realtime"},
        {{"--client", "true", "--link", "2"}, "allowed 1 to 1"},
        {{"--client", "true", "--set", "links=[]"}, "links: there are none; needed is one"},
        {{"--client", "true", "--set", "links=[{type: 'null'}]"}, "allowed are tcp, pty"},
        {{"--client", "true", "--set", "links=[{type: web}]"}, "allowed are tcp, pty, udp and usb"},
        {{"--client", "true", "--truth", "t", "--scenario=flaky-usb", "--scenario=brown-out"}, "--truth is one file"},
    };
    struct wire *wire = *state;
    char c[352];
    write_files(wire);
    snprintf(c, sizeof c, "%s", wire_path(wire, "config.yaml"));
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const char *args[10] = {"soak", c};
        memcpy(args + 2, cases[i].args, sizeof cases[i].args);
        wire_expect_usage(wire, args, cases[i].says);
    }
}

/* None of them runs the client, whose log would be there. */
static void test_files_that_do_not_go_together(void **state)
{
    struct wire *wire = *state;
    char c[352], printed[352], points[352], bad[352], folder[402];
    write_files(wire);
    snprintf(c, sizeof c, "%s", wire_path(wire, "config.yaml"));
    snprintf(printed, sizeof printed, "%s", wire_path(wire, "configuration.stdout"));
    snprintf(points, sizeof points, "%s", wire_path(wire, "configuration.points"));
    snprintf(bad, sizeof bad, "%s", wire_write_text(wire, "bad.yaml", "faults: [{kind: nonsense}]\n"));
    memset(folder, 'x', sizeof folder - 1);
    folder[sizeof folder - 1] = '\0';
    const char *const dir = wire->dir;
    wire_expect_usage(wire,
                      (const char *const[]){"soak", c, "--client", "true", "--client-folder", dir, "--client-file", "-",
                                            "--json", printed, NULL},
                      "configuration.stdout");
    wire_expect_usage(
        wire,
        (const char *const[]){"soak", c, "--client", "true {out}", "--client-folder", dir, "--truth", points, NULL},
        "configuration.points");
    wire_expect_usage(wire, (const char *const[]){"soak", c, "--client", "true", "--client-folder", folder, NULL},
                      "has 401 characters; allowed are 400");
    wire_expect_usage(wire,
                      (const char *const[]){"soak", c, "--client", "true", "--client-folder", dir, "--scenario",
                                            "brown-out", "--scenario", bad, NULL},
                      "bad.yaml:1");
    assert_int_equal(access(wire_path(wire, "1-brown-out.log"), F_OK), -1);
    assert_int_equal(access(wire_path(wire, "configuration.log"), F_OK), -1);
}

/* --client-file may be the path for which {out} stands. The sheet may have the name of the file for the client's
 * output, which no run writes while --client-file names another file. */
static void test_files_that_go_together(void **state)
{
    struct wire *wire = *state;
    char c[352], printed[352], points[352];
    write_files(wire);
    snprintf(c, sizeof c, "%s", wire_path(wire, "config.yaml"));
    snprintf(printed, sizeof printed, "%s", wire_path(wire, "configuration.stdout"));
    snprintf(points, sizeof points, "%s", wire_path(wire, "configuration.points"));
    const char *const args[] = {
        "soak",   c,       "--client",   "true {out}", "--client-folder",   wire->dir, "--client-file", points,
        "--json", printed, "--duration", "0.1",        "--reconnect-limit", "0.1",     "--quiet",       NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 1); /* the client never connects */
    char *text = wire_read(printed, NULL);
    assert_int_equal(count_of(text, "\"scenario\": \"configuration\""), 1);
    free(text);
}

static void need_python(void)
{
    if (access("/usr/bin/python3", X_OK) == 0) return;
    print_message("# /usr/bin/python3 is missing\n");
    skip();
}

static void test_a_client_in_python(void **state)
{
    need_python();
    try_cases(*state, "config.yaml", "/usr/bin/python3 -B tests/wire/faulty_client.py", PLANTED);
}

static void test_a_client_of_scip(void **state)
{
    need_python();
    try_cases(*state, "scip.yaml", "/usr/bin/python3 -B tests/wire/faulty_scip.py", PLANTED);
}

int main(int argc, char **argv)
{
    program = argv[0];
    if (argc > 1 && strcmp(argv[1], "client") == 0) return faulty_client(argc, argv);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_a_client_in_c, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_other_faults, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_scenarios_in_turn, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_file_from_before, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_client_that_stays_away, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_stop_in_the_second_scenario, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_wrong_usage, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_files_that_do_not_go_together, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_files_that_go_together, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_client_in_python, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_client_of_scip, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
