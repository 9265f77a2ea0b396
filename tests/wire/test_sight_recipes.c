/* SPDX-License-Identifier: MIT */
/* Scans with and without a visibility map. The ready configurations give the same stream with cast.sight on and off,
 * and a head that can have no map says so. */
#include "tests/common/thorough.h"
#include "tests/wire/wire.h"

static const char HOUSE[] = "/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc";

struct recipe {
    const char *config;
    int house;
    const char *sets[5]; /* short scans, of which a map shows all */
};

/* A recipe is a ready configuration with some keys changed. Those of demo, foliage and glass set beam.mode, which saves
 * seconds of planning. The last three take half of the time, and show only what others show, so they run with
 * THOROUGH=1. */
static const struct recipe RECIPES[] = {
    {"demo", 1, {"head.station=3", "head.pan_stop_deg=30", "beam.mode=single"}},
    {"demo", 1, {"head.pan_stop_deg=1", "beam.mode=single", "output.layout=polar"}},
    {"foliage", 0, {"beam.mode=single", "head.pan_start_deg=20", "head.pan_stop_deg=30"}},
    {"foliage", 0, {"beam.mode=adaptive", "head.pan_start_deg=28", "head.pan_stop_deg=30"}},
    {"glass", 0, {"optics.depth=4", "head.pan_stop_deg=40", "beam.mode=single"}},
    {"glass", 0, {"optics.depth=0", "head.pan_stop_deg=40", "beam.mode=single"}},
    {"glass",
     0,
     {"instrument.collimation_deg=0.1", "instrument.trunnion_deg=-0.2", "noise.angle=on", "beam.mode=single"}},
    {"hokuyo", 1, {"head.frames=20"}},
    {"velodyne", 1, {"head.frames=1"}},
    {"vz600i_house", 1, {"head.frames=1", "head.pan_stop_deg=6"}},
    {"demo", 1, {"head.station=1", "head.pan_stop_deg=20", "output.layout=polar", "beam.mode=adaptive"}},
    {"sick", 1, {"head.frames=20"}},
    {"speed", 1, {"head.frames=1", "head.pan_stop_deg=2"}},
};

/* Records it. Returns the number of pulses, and writes the hash. */
static uint64_t record(struct wire *wire, const struct recipe *recipe, const char *sight, char hash[65])
{
    char config[128], stats[352];
    const char *args[WIRE_MAX_ARGS] = {"record", config, "--stats", stats,        "--quiet",
                                       "--set",  sight,  "--set",   IFC_BY_ASSIMP};
    int n = 9;
    snprintf(config, sizeof config, "config/%s.yaml", recipe->config);
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    for (int i = 0; recipe->sets[i] != NULL; i++) {
        args[n++] = "--set";
        args[n++] = recipe->sets[i];
    }
    wire_run(wire, args, 0);
    stats_hash(wire, hash);
    return stats_uint(wire, "pulses");
}

static void test_recipes(void **state)
{
    struct wire *wire = *state;
    const int no_house = access(HOUSE, R_OK) != 0;
    if (no_house) printf("# %s is not there: package assimp-testmodels\n", HOUSE);
    const size_t n = sizeof RECIPES / sizeof RECIPES[0] - (size_t)thorough(0, 3);
    for (size_t i = 0; i < n; i++) {
        char with[65], without[65];
        if (RECIPES[i].house && no_house) continue;
        const uint64_t pulses = record(wire, &RECIPES[i], "cast.sight=on", with);
        const uint64_t as_many = record(wire, &RECIPES[i], "cast.sight=off", without);
        if (pulses < 1000 || pulses != as_many || strcmp(with, without) != 0)
            fail_msg("%s %s: %" PRIu64 " pulses; with a map %s, without %s", RECIPES[i].config, RECIPES[i].sets[0],
                     pulses, with, without);
    }
}

/* There is one line: key, reason, allowed values. */
static void test_not_possible(void **state)
{
    struct wire *wire = *state;
    static const struct {
        const char *config, *set, *why;
    } cases[] = {{"config/car.yaml", "head.frames=1", "cast.sight: on, but the head moves; allowed auto, off\n"},
                 {"config/glass.yaml", "instrument.mirror_offset_m=0.01", "mirror_offset_m moves the beam; allowed"},
                 {"config/glass.yaml", "beam.mode=rings", "no ray for the centre; allowed auto, off\n"}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const char *const args[] = {"check", cases[i].config, "--set", "cast.sight=on", "--set", cases[i].set, NULL};
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 2);
        char *text = wire_read(wire_path(wire, "err"), NULL);
        if (strstr(text, cases[i].why) == NULL || strchr(text, '\n')[1] != '\0') fail_msg("%s", text);
        free(text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_recipes, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_not_possible, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
