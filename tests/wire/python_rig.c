/* SPDX-License-Identifier: MIT */
#include "tests/wire/python_rig.h"

const char python[] = "/usr/bin/python3";

const char *const flavours[2] = {"numpy", "plain"};

const struct room_config SMALL = {
    .prr_hz = 20000, .lines_hz = 50, .pan_deg_s = 100, .pan_stop_deg = 5, .frames = 1, .links = LINK_YAML_TCP};

const struct room_config RIDE = {.prr_hz = 20000,
                                 .lines_hz = 50,
                                 .pan_deg_s = 50,
                                 .pan_stop_deg = 4,
                                 .frames = 1,
                                 .links = LINK_YAML_TCP,
                                 .more = "platform: {kind: trajectory, file: ride.csv}\n"};

const char *ask_python(struct wire *wire, const char *flavour, const char *what, const char *a, const char *b)
{
    static char *text;
    const char *const args[] = {"tests/wire/python_client.py", "drivers/host/python", flavour, what, a, b, NULL};
    const char *const probe[] = {"-c", "import numpy", NULL};
    static int has_numpy = -1;
    free(text);
    text = NULL;
    if (has_numpy < 0)
        has_numpy = wire_wait(wire, wire_spawn_program(wire, python, probe, "probe.out", "probe.err", -1)) == 0;
    if (strcmp(flavour, "numpy") == 0 && !has_numpy) return NULL;
    wire_run_program(wire, python, args, 0);
    return text = wire_read(wire_path(wire, "out"), NULL);
}

int setup(void **state)
{
    if (access(python, X_OK) == 0) return wire_setup(state);
    print_message("# %s is missing\n", python);
    return wire_setup(state);
}

void need_python(void)
{
    if (access(python, X_OK) == 0) return;
    print_message("# %s is missing (Debian: python3-numpy)\n", python);
    skip();
}

const char *record(struct wire *wire, const struct room_config *c, const char *name, const char *keys)
{
    char config[352], path[352], stats[352], set[512], *rest = set;
    snprintf(config, sizeof config, "%s", room_config_write(wire, c));
    snprintf(path, sizeof path, "%s", wire_path(wire, name));
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    snprintf(set, sizeof set, "%s", keys);
    const char *args[32] = {"record", config, "-o", path, "--stats", stats, "--quiet"};
    for (int n = 7; (args[n + 1] = strtok_r(rest, " ", &rest)) != NULL; n += 2)
        args[n] = "--set";
    wire_run(wire, args, 0);
    return wire_path(wire, name);
}

void write_ride(const struct wire *wire)
{
    wire_write_text(wire, "ride.csv",
                    "t_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg\n0,0.1,-0.5,0,0,0,10\n0.05,0.3,-0.4,0,4,0,40\n"
                    "0.1,0.4,-0.2,0.1,4,-5,80\n0.15,0.2,0,0.1,0,-3,60\n0.2,0,0.2,0,0,0,10\n");
}
