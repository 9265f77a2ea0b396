/* SPDX-License-Identifier: MIT */
/* scanhead soak --client: each planted fault of a client gives its finding and no other; a right client gives none. */
#include "tests/wire/faulty_client.h"
#include "tests/wire/room.h"

static const char *program; /* of this test, which is also the client */

/* Some 600 frames a second, of 16 points. No two pulses have the same direction. */
static const struct room_config ROOM = {.prr_hz = 10000,
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

static void write_files(const struct wire *wire)
{
    room_write(wire);
    room_config_write(wire, &ROOM);
}

static const char *in_folder(const struct wire *wire, const char *name, const char *ending)
{
    char file[64];
    snprintf(file, sizeof file, "%s.%s", name, ending);
    return wire_path(wire, file);
}

static pid_t start(struct wire *wire, const char *name, const char *client, const char *file, const char *scenario)
{
    char config[352], scenario_path[352], folder[352], json[352], junit[352], out[64], err[64];
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(scenario_path, sizeof scenario_path, "%s",
             strchr(scenario, '.') != NULL ? wire_path(wire, scenario) : scenario);
    snprintf(folder, sizeof folder, "%s", wire->dir);
    snprintf(json, sizeof json, "%s", in_folder(wire, name, "json"));
    snprintf(junit, sizeof junit, "%s", in_folder(wire, name, "xml"));
    snprintf(out, sizeof out, "%s.out", name);
    snprintf(err, sizeof err, "%s.err", name);
    const char *const args[] = {"soak",          config,       "--scenario",        scenario_path, "--client",   client,
                                "--client-file", file,         "--client-folder",   folder,        "--json",     json,
                                "--junit",       junit,        "--reconnect-limit", "2",           "--duration", "0.8",
                                "--quiet",       NULL};
    return wire_spawn(wire, args, out, err, -1);
}

/* Each has a scenario file of its own, whose name is also that of the log. */
static pid_t start_case(struct wire *wire, const char *faults, const char *client)
{
    char command[512], scenario[64];
    snprintf(scenario, sizeof scenario, "%s.yaml", faults);
    wire_write_text(wire, scenario, FAULTS);
    snprintf(command, sizeof command, "exec %s {host} {port} {out} %s", client, faults);
    return start(wire, faults, command, "{out}", scenario);
}

/* What the sheet has as findings, in its order and with blanks between them. */
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
}

static const struct {
    const char *faults, *findings;
} CASES[] = {
    {"none", ""},
    {"c", "points-known"},
    {"s", "comes-back"},
    {"t", "points-once"},
    {"cst", "comes-back points-known points-once"},
};
enum { N_CASES = sizeof CASES / sizeof CASES[0] };

/* All at once: they mostly wait. */
static void try_cases(struct wire *wire, const char *client)
{
    pid_t pid[N_CASES];
    write_files(wire);
    for (int i = 0; i < N_CASES; i++)
        pid[i] = start_case(wire, CASES[i].faults, client);
    for (int i = 0; i < N_CASES; i++)
        expect(wire, pid[i], CASES[i].faults, CASES[i].findings);
}

static void test_a_client_in_c(void **state)
{
    char client[352];
    snprintf(client, sizeof client, "%s client", program);
    try_cases(*state, client);
}

static void test_a_client_in_python(void **state)
{
    if (access("/usr/bin/python3", X_OK) != 0) {
        print_message("# /usr/bin/python3 is missing\n");
        skip();
    }
    try_cases(*state, "/usr/bin/python3 tests/wire/faulty_client.py");
}

int main(int argc, char **argv)
{
    program = argv[0];
    if (argc > 1 && strcmp(argv[1], "client") == 0) return faulty_client(argc, argv);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_a_client_in_c, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_client_in_python, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
