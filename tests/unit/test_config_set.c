/* SPDX-License-Identifier: MIT */
/* --set: values changed and elements added on the command line. */
#include "firmware_sim/config/table/row.h"
#include "tests/unit/config_rig.h"

#include <math.h>

static void set_changes_values(void **state)
{
    (void)state;
    assert_loads(load_set("head.prr_hz=2e5"));
    assert_int_equal(cfg->head.settings.prr_uhz, 200000000000);
    assert_loads(load_set("stations[0].heading_deg=45.5"));
    assert_true(cfg->station[0].heading_deg == 45.5);
    assert_loads(load_set("stations.0.heading_deg=-1"));
    assert_true(cfg->station[0].heading_deg == -1);
    assert_loads(load_set("stations[0].position_m=[4, 5.5, -6]"));
    assert_true(cfg->station[0].position_m[1] == 5.5 && cfg->station[0].position_m[2] == -6);
    assert_loads(load_set("stations[0].position_m=7,8,9"));
    assert_true(cfg->station[0].position_m[2] == 9);
    assert_loads(load_set("head.serial=A=B"));
    assert_string_equal(cfg->head.serial, "A=B");
    static const char *const other[] = {"head.profile=riegl-vz600i", "head.prr_hz=600000"};
    assert_loads(load_sets(other, 2));
    assert_string_equal(cfg->profile.name, "riegl-vz600i");
    assert_int_equal(cfg->head.settings.line_stop_udeg, 65000000); /* defaults follow the profile */
}

/* The longest names are those of a scanner's keys. */
static void set_takes_long_names(void **state)
{
    (void)state;
    assert_loads(load_set("stations[0].scanner.instrument.mirror_eccentricity_deg=0.5"));
    assert_true(cfg->instrument.mirror_eccentricity_deg == 0.5);
}

static void set_appends_elements(void **state)
{
    (void)state;
    static const char *const sets[] = {"links[1].path=out.bin", "links[1].type=file", "stations.1.position_m=0,0,2",
                                       "head.station=2",        "head.station=1",     "head.station=2"};
    write_file(config_path, base, strlen(base));
    assert_loads(load_sets(sets, 6));
    assert_int_equal(cfg->n_links, 2);
    assert_int_equal(cfg->link[1].type, LINK_FILE);
    assert_string_equal(cfg->link[1].path, "out.bin"); /* of the working directory, not of the file */
    assert_int_equal(cfg->n_stations, 2);
    assert_int_equal(cfg->head.settings.station, 2);
    assert_string_equal(cfg->station[1].name, "station-2");
}

static void set_refuses(void **state)
{
    (void)state;
    static const struct {
        const char *set, *key, *fragment;
    } wrong[] = {
        {"head.prr_hz", "head.prr_hz", "no '='"},
        {"=5", "=5", "no key"},
        {"", "", "no '='"},
        {"head.prr=5", "head.prr", "did you mean head.prr_hz?"},
        {"prr_hz=5", "prr_hz", "did you mean head.prr_hz?"},
        {"head.prr_hz=30 kHz", "head.prr_hz", "not a number"},
        {"head.prr_hz=", "head.prr_hz", "not a number"},
        {"head.prr_hz=5e6", "head.prr_hz", "allowed 100000 to 1200000 Hz"},
        {"head=5", "head", "here stands a single value; allowed a section with keys"},
        {"links[0]=tcp", "links[0]", "here stands a single value; allowed a section with keys"},
        {"links=tcp", "links", "here stands a single value; allowed a list of 0 to 8"},
        {"links=", "links", "here stands nothing; allowed a list of 0 to 8"},
        {"head=[1]", "head", "here stands a list"},
        {"links=[{type: nul}]", "links[0].type", "\"nul\" is not known; allowed null, file"},
        {"links=[{type: \"null\"}, {typ: tcp}]", "links[1].typ", "did you mean links[1].type?"},
        {"links.1={type: tcp, type: tcp}", "links[1].type", "given twice; allowed once"},
        {"links.2=[]", "links.2", "allowed indices 0 to 1"},
        {"links=[{type: tcp}", "links", "character 13 of the value: not YAML: "},
        {"links=[] []", "links", "character 4 of the value: not YAML: "},
        {"links=--- []\n--- []", "links", "character 12 of the value: a second document; allowed one"},
        {"links=[[[[[[[[[[[[[[[[[", "links", "character 17 of the value: nested too deep; allowed 16 levels"},
        {"links=[\xff]", "links", "character 2 of the value: not YAML: "},
        {"links=!x []", "links", "has a tag"},
        {"noise={ball: {radius_m: x}}", "noise.ball.radius_m", "not a number"},
        {"head={prr_hz: 300000}", "head.profile", "missing"},
        {"stations=[]", "stations", "missing"},
        {"stations[0].scanner=1", "stations[0].scanner", "here stands a single value"},
        {"stations[0].scanner={links: []}", "stations[0].scanner.links", "the same for all scanners"},
        {"stations[0].scanner.noise={}", "stations[0].scanner.noise", "is a section of a scanner; set one of its keys"},
        {"stations[0].scanner.surfaces.0.gloss=1", "stations[0].scanner.surfaces.0.gloss", "are set as one list"},
        {"stations[0].scanner.loop.tick_hz=500", "stations[0].scanner.loop.tick_hz",
         "the same for all scanners; allowed "},
        {"stations[2].heading_deg=0", "stations[2].heading_deg", "allowed indices 0 to 1, the last appends one"},
        {"links[99999999999999999999].type=tcp", "links[99999999999999999999].type", "allowed indices 0 to 1"},
        {"links[500].typ=tcp", "links[500].typ", "allowed indices 0 to 1"},
        {"links[-1].type=tcp", "links[-1].type", "unknown key"},
        {"links[].type=tcp", "links[].type", "no index"},
        {"links[0.type=tcp", "links[0.type", "unknown key"},
        {"links[0]type=tcp", "links[0]type", "unknown key"},
        {"links..type=tcp", "links..type", "unknown key"},
        {"links.type=tcp", "links.type", "unknown key; links is a list; allowed an index, as in links[0]"},
        {"head.prr_hz.max=1", "head.prr_hz.max", "unknown key; head.prr_hz has no keys that can be set"},
        {"scene.meshes.0.copies.0.heading_deg=1", "scene.meshes.0.copies.0.heading_deg",
         "unknown key; scene.meshes[0].copies has no keys that can be set; allowed scene.meshes[0].copies=VALUE"},
        {"scene.meshes.0.foo.bar=1", "scene.meshes[0].foo.bar", "unknown key; allowed file, up"},
        {"head[prr]=1", "head[prr]", "unknown key, did you mean head?"},
        {"links[0].typ=tcp", "links[0].typ", "did you mean links[0].type?"},
        {"links[1].port=5", "links[1].type", "missing"},
        {"stations[0].position_m=1,2", "stations[0].position_m", "[x, y, z]"},
        {"stations[0].position_m=[1,2,3", "stations[0].position_m", "[x, y, z]"},
        {"stations[0].position_m=1,2,3,4", "stations[0].position_m", "not a number"},
        {"stations[0].name=\xff", "stations[0].name", "not UTF-8"},
        {"stations[0].name=a\nb", "stations[0].name", "control characters"},
        {"head\x1f.\x7f=1", "head?.?", "unknown key"},
        {"\x01=1", "?", "unknown key"},
        {"head.prr_hz.\x1f=1", "head.prr_hz.?", "has no keys that can be set"},
        {"head.prr_hz.\x7f=1", "head.prr_hz.?", "has no keys that can be set"},
        {"\x1f[].x=1", "?[].x", "no index"},
        {"head.prr_hz ~=1", "head.prr_hz ~", "unknown key"},
        {"output.crs=utm", "stations[0].lat_deg", "missing"},
        {"head.profile=nosuch", "head.profile", "no profile \"nosuch\""},
        {"output.scale_m=1e-7", "output.scale_m", "1e-6 to 1 m"},
        {"loop.tick_hz=999", "loop.tick_hz", "a divisor of 1e9"},
        {"links[0].type=pty", "links[0].port", "a pty link has no such key"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        char start[128], in_file[192];
        snprintf(start, sizeof start, "--set %s: ", wrong[i].key);
        snprintf(in_file, sizeof in_file, "%s:", config_path); /* with --set, an error in the file names the file */
        if (load_set(wrong[i].set) != SH_EINPUT) fail_msg("%s was taken", wrong[i].set);
        int elsewhere = strcmp(wrong[i].set, "output.crs=utm") == 0 || strcmp(wrong[i].set, "links[0].type=pty") == 0;
        const char *expected = elsewhere ? in_file : start;
        if (strncmp(err.text, expected, strlen(expected)) != 0) fail_msg("%s: %s", wrong[i].set, err.text);
        assert_says(wrong[i].fragment);
        assert_says(wrong[i].key);
    }
}

/* Names up to the length that the error says are compared with the keys; longer ones are not. */
static void a_name_has_a_longest_length(void **state)
{
    (void)state;
    enum { LONGEST = 120 };
    static const char says[] = "unknown key; allowed up to ";
    char name[LONGEST + 1], set[LONGEST + 3];
    unsigned most = 0;
    for (unsigned len = LONGEST; len > 60; len--) {
        memset(name, 'a', len);
        memcpy(name, "links.0.", 8);
        name[len] = '\0';
        snprintf(set, sizeof set, "%s=1", name);
        assert_int_equal(load_set(set), SH_EINPUT);
        const char *at = strstr(err.text, says);
        if (at != NULL && most == 0) most = (unsigned)strtoul(at + strlen(says), NULL, 10);
        if ((at != NULL) != (len > most)) fail_msg("%u characters: %s", len, err.text);
    }
    assert_true(most > 60 && most < CFG_PATH_MAX); /* one that is taken has room, its end included */
}

/* YAML in a --set replaces a list or section, with earlier --set in it. Later --set changes the new one. */
static void yaml_replaces(void **state)
{
    (void)state;
    static const char *const sets[] = {
        "links.1.type=file",
        "links=[{type: \"null\"}, {type: tcp, port: 0},\n {type: file, path: out.bin}]",
        "links.1.port=7",
        "noise.sigma_m=0.5",
        "noise.range=on",
        "noise={angle: off, ball: {radius_m: 0.25}}",
        "noise.ball.radius_m=0.125",
        "stations.0.name=gone",
        "stations.0={position_m: [4, 5, 6], tripod: {leg_m: 1.5}}",
        "stations.1={position_m: [7, 8, 9], name: new}",
        "scene.target.objects=[a, 'b, c']",
    };
    write_file(config_path, base, strlen(base));
    assert_loads(load_sets(sets, sizeof sets / sizeof sets[0]));
    assert_int_equal(cfg->n_links, 3);
    assert_int_equal(cfg->link[0].type, LINK_NULL);
    assert_int_equal(cfg->link[1].port, 7);
    assert_string_equal(cfg->link[2].path, "out.bin"); /* of the working directory */
    assert_int_equal(cfg->noise.range, 0);
    assert_true(cfg->noise.sigma_m == cfg->profile.range_sigma_m && cfg->noise.ball.radius_m == 0.125);
    assert_int_equal(cfg->n_stations, 2);
    assert_string_equal(cfg->station[0].name, "station-1");
    assert_true(cfg->station[0].position_m[0] == 4 && cfg->station[0].tripod.leg_m == 1.5);
    assert_string_equal(cfg->station[1].name, "new");
    assert_int_equal(cfg->scene.target.n_objects, 2);
    assert_string_equal(cfg->scene.target.object[1], "b, c");
    assert_loads(load_set("links=[]"));
    assert_int_equal(cfg->n_links, 0);
}

/* The sections `scanner` are replaced with their stations. */
static void yaml_replaces_scanners(void **state)
{
    (void)state;
    static const struct {
        const char *set[4];
        int64_t prr_hz; /* of station 2 */
        uint32_t n_surfaces;
    } is[] = {
        {{"stations.1.scanner.head.lines_hz=50"}, 200000, 1},
        {{"stations.1.scanner.head.prr_hz=150000", "stations.1.scanner={noise: {range: on}}"}, 500000, 0},
        {{"stations.1.scanner={noise: {range: on}}", "stations.1.scanner.head.prr_hz=150000"}, 150000, 0},
        {{"stations.1.scanner.surfaces=[{object: b, reflectance: 0.5}, {object: c, reflectance: 0.5}]"}, 200000, 2},
        {{"stations.1={position_m: [1, 1, 1]}"}, 500000, 0},
        {{"stations=[{position_m: [0, 0, 1]}, {position_m: [1, 1, 1], scanner: {head: {prr_hz: 250000}}}]"}, 250000, 0},
    };
    char *text = edited("    heading_deg: 90\n",
                        "    heading_deg: 90\n"
                        "  - {position_m: [3, 2, 1], scanner: {head: {prr_hz: 200000}, surfaces: [{object: a, "
                        "reflectance: 0.5}]}}\n");
    write_file(config_path, text, strlen(text));
    free(text);
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        const char *sets[4] = {"head.station=2"};
        int n = 1;
        for (int k = 0; k < 3 && is[i].set[k] != NULL; k++)
            sets[n++] = is[i].set[k];
        assert_loads(load_sets(sets, n));
        if (cfg->head.settings.prr_uhz != is[i].prr_hz * 1000000) fail_msg("set %zu: another pulse rate", i);
        if (cfg->n_surfaces != is[i].n_surfaces) fail_msg("set %zu: %u surfaces", i, cfg->n_surfaces);
    }
    write_file(config_path, base, strlen(base));
}

static void a_full_list_takes_no_more(void **state)
{
    (void)state;
    char text[8][32];
    const char *sets[8];
    for (int i = 0; i < 8; i++) {
        snprintf(text[i], sizeof text[i], "links[%d].type=null", i + 1);
        sets[i] = text[i];
    }
    write_file(config_path, base, strlen(base));
    assert_loads(load_sets(sets, 7));
    assert_int_equal(cfg->n_links, 8);
    assert_int_equal(load_sets(sets, 8), SH_EINPUT);
    assert_says("--set links[8].type: links has 8 elements; allowed indices 0 to 7");
}

/* When not given, the tolerance of positions is a thousandth of the plan's, at least 1e-7 m. The tolerance of meshes is
 * a tenth of the plan's, or 1 m where the plan's is not given either. */
static void tolerances_follow_the_plan(void **state)
{
    (void)state;
    static const struct {
        const char *set[2];
        int n;
        double output_m, scene_m;
    } is[] = {{{NULL}, 0, 1e-6, 1.0},
              {{"plan.tolerance_m=0.02"}, 1, 2e-5, 2e-3},
              {{"plan.tolerance_m=1e-5"}, 1, 1e-7, 1e-6},
              {{"plan.tolerance_m=0.02", "output.tolerance_m=0.003"}, 2, 0.003, 2e-3},
              {{"plan.tolerance_m=0.02", "scene.tolerance_m=0.004"}, 2, 2e-5, 0.004}};
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        assert_loads(load_sets(is[i].set, is[i].n));
        assert_true(fabs(cfg->output.tolerance_m / is[i].output_m - 1.0) < 1e-12);
        assert_true(fabs(cfg->scene.tolerance_m / is[i].scene_m - 1.0) < 1e-12);
    }
}

/* Settings that a client has changed, in nanometres, become lengths as from a file. A pulse rate whose range is shorter
 * keeps its own limits. */
static void settings_become_lengths(void **state)
{
    (void)state;
    static const char *const sets[] = {"head.profile=riegl-vz600i", "head.prr_hz=600000"};
    assert_loads(load_sets(sets, 2));
    struct head_settings settings = cfg->head.settings;
    const double shortest_m = cfg->profile.program[cfg->profile.n_programs - 1].own_max_m;
    const double longest_m = cfg->profile.program[0].own_max_m;
    assert_true(cfg->profile.n_programs > 1 && shortest_m < longest_m);
    settings.range_min_nm = 1234567891;
    settings.range_max_nm = (int64_t)(5e8 * (shortest_m + longest_m)) + 7;
    settings.sigma_nm = 3000001;
    settings.ball_nm = 3;
    assert_int_equal(config_apply_settings(cfg, &settings, &err), SH_OK);
    assert_true(cfg->head.range_min_m == 1.234567891 && cfg->noise.sigma_m == 0.003000001);
    assert_true(cfg->noise.ball.radius_m == 3e-9);
    for (uint32_t i = 0; i < cfg->profile.n_programs; i++) {
        const double own_m = cfg->profile.program[i].own_max_m, set_m = (double)settings.range_max_nm / 1e9;
        assert_true(cfg->profile.program[i].range_max_m == (own_m < set_m ? own_m : set_m));
    }
}

/* The ranges, noise and step of a configuration are the settings of power-up. */
static void keys_become_settings(void **state)
{
    (void)state;
    static const char *const sets[] = {"head={profile: riegl-vz600i, range_min_m: 2.5, range_max_m: 123.456789012}",
                                       "noise.range=on", "noise.angle=on", "noise.sigma_m=0.0125",
                                       "noise.ball.radius_m=0.5"};
    write_file(config_path, base, strlen(base));
    assert_loads(load_sets(sets, 5));
    const struct head_settings *s = &cfg->head.settings;
    assert_true(s->range_min_nm == 2500000000 && s->range_max_nm == 123456789012);
    assert_true(s->noise == RANGE_NOISE_ON && s->angle_noise == 1 && s->step_udeg == 0 && s->waves == 0);
    assert_true(s->sigma_nm == 12500000 && s->ball_nm == 500000000);
    static const char *const none[] = {"head={profile: riegl-vz600i}"};
    assert_loads(load_sets(none, 1));
    assert_true(s->noise == RANGE_NOISE_OFF && s->angle_noise == 0 && s->ball_nm == 0);
    assert_true(s->range_min_nm == 500000000 && s->range_max_nm == 1000000000000);
    static const char *const planar[] = {"head={profile: sick-lms111}"};
    assert_loads(load_sets(planar, 1));
    assert_int_equal(s->step_udeg, 500000);
    static const char *const round[] = {"head={profile: sphere, step_deg: 2.2}"};
    assert_loads(load_sets(round, 1));
    assert_int_equal(s->step_udeg, 2200000); /* as it was asked for */
}

/* Frames that an animation is scanned at become seconds. */
static void frames_become_seconds(void **state)
{
    (void)state;
    static const char *const sets[] = {"platform={kind: stops, frames_per_s: 8, first_frame: 4, last_frame: 34, "
                                       "frame_step: 2}"};
    write_file(config_path, base, strlen(base));
    assert_loads(load_sets(sets, 1));
    const struct config_platform *p = &cfg->platform;
    assert_true(p->has_end && p->start_s == 0.5 && p->end_s == 4.25 && p->step_s == 0.25);
}

/* A station in UTM takes zone and hemisphere from an anchor in UTM, north or south. */
static void stations_take_the_grid_of_the_anchor(void **state)
{
    (void)state;
    static const char *const sets[2][3] = {
        {"scene.anchor.source=utm", "scene.anchor.utm_zone=33", "scene.anchor.hemisphere=north"},
        {"scene.anchor.source=utm", "scene.anchor.utm_zone=19", "scene.anchor.hemisphere=south"}};
    char *text = edited("  - position_m: [1, 2, 3]\n", "  - easting_m: 5e5\n    northing_m: 4e6\n    height_m: 9\n");
    write_file(config_path, text, strlen(text));
    for (int south = 0; south < 2; south++) {
        assert_loads(load_sets(sets[south], 3));
        assert_int_equal(cfg->station[0].utm_zone, south ? 19 : 33);
        assert_int_equal(cfg->station[0].north, !south);
    }
    free(text);
    write_file(config_path, base, strlen(base));
}

/* There are as many stations as there is room for. Among them the first and the last one are checked as all others
 * are. */
static void all_stations_are_checked(void **state)
{
    (void)state;
    enum { N = CONFIG_MAX_STATIONS, ROOM = 96 };
    static char text[N][ROOM];
    const char *sets[N + 1];
    for (int i = 0; i < N; i++) {
        snprintf(text[i], ROOM, "stations[%d]={position_m: [%d, 0, 2], tripod: {leg_m: 1.5, legs: on}}", i, i);
        sets[i] = text[i];
    }
    write_file(config_path, base, strlen(base));
    assert_loads(load_sets(sets, N));
    assert_int_equal(cfg->n_stations, N);
    for (int i = 0; i < N; i++)
        assert_true(cfg->station[i].position_m[0] == i && cfg->station[i].tripod.given);
    static const char *const wrong[] = {"stations[0].tripod.leg_diameter_m=0.75",
                                        "stations[63].tripod.leg_diameter_m=0.75"};
    for (int k = 0; k < 2; k++) {
        sets[N] = wrong[k];
        assert_int_equal(load_sets(sets, N + 1), SH_EINPUT);
        assert_says(k == 0 ? "stations[0].tripod" : "stations[63].tripod");
        assert_says("0.75 m, but a leg is 1.5 m long; allowed is less than half of that, 0.75 m");
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(set_changes_values),          cmocka_unit_test(set_takes_long_names),
        cmocka_unit_test(set_appends_elements),        cmocka_unit_test(set_refuses),
        cmocka_unit_test(a_name_has_a_longest_length), cmocka_unit_test(yaml_replaces),
        cmocka_unit_test(yaml_replaces_scanners),      cmocka_unit_test(tolerances_follow_the_plan),
        cmocka_unit_test(settings_become_lengths),     cmocka_unit_test(keys_become_settings),
        cmocka_unit_test(frames_become_seconds),       cmocka_unit_test(stations_take_the_grid_of_the_anchor),
        cmocka_unit_test(a_full_list_takes_no_more),   cmocka_unit_test(all_stations_are_checked),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
