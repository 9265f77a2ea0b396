/* SPDX-License-Identifier: MIT */
/* Stations with scanners of their own: the keys that they take from the file, errors, and the shared parts of their
 * sites. */
#include "firmware_sim/command/command.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/device/device.h"
#include "firmware_sim/site/site.h"
#include "tests/unit/config_rig.h"

static struct config own; /* of another station than head.station's */

/* Three stations in the room of config/scenes. The errors below count the lines. */
#define HEAD     "head: {profile: riegl-vz400i, prr_hz: 100000, lines_hz: 50, serial: A}\n"  /* 1 */
#define REST     "noise: {range: on, seed: 7}\ninstrument: {range_offset_m: 0.1}\n"          /* 2, 3 */
#define STATIONS "stations:\n  - {position_m: [0, 0, 1.7]}\n  - position_m: [1, 0.5, 1.7]\n" /* 4 to 6 */
#define THIRD    "\n  - {position_m: [1, -0.5, 1.7]}\n"

static char *with_scene(const char *text)
{
    static char whole[4096];
    char here[512];
    assert_non_null(getcwd(here, sizeof here));
    snprintf(whole, sizeof whole, "%sscene: {meshes: [{file: %s/config/scenes/glass_room.obj, up: z, scale: 1}]}\n",
             text, here);
    return whole;
}

static int load_second(const char *scanner, const char *const *sets, int n)
{
    char text[2048];
    snprintf(text, sizeof text, HEAD REST STATIONS "    scanner: %s" THIRD "links: [{type: tcp}]\n", scanner);
    char *whole = with_scene(text);
    write_file(config_path, whole, strlen(whole));
    return load_sets(sets, n);
}

static void load_own(uint32_t station)
{
    if (config_load_scanner(cfg, station, &own, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(own.head.settings.station, station);
    assert_int_equal(own.n_links, 0);
}

static void its_keys_stand_in_for_the_files(void **state)
{
    (void)state;
    assert_loads(load_second("{head: {lines_hz: 20}, noise: {range: off}, beam: {mode: rings}}", NULL, 0));
    assert_true(cfg->head.settings.lines_uhz == 50000000 && cfg->noise.range == RANGE_NOISE_ON);
    assert_true(cfg->beam.mode == BEAM_SINGLE && cfg->n_links == 1);
    load_own(2);
    assert_true(own.head.settings.lines_uhz == 20000000 && own.noise.range == RANGE_NOISE_OFF);
    assert_true(own.beam.mode == BEAM_RINGS);
    /* The rest is the file's. */
    assert_true(own.head.settings.prr_uhz == 100000000000 && own.noise.seed == 7);
    assert_string_equal(own.head.serial, "A");
    assert_true(own.instrument.range_offset_m == 0.1);
    assert_true(config_serves(cfg, 0) && !config_serves(cfg, 1) && config_serves(cfg, 2) && !config_is_alone(cfg));
    assert_true(!config_serves(&own, 0) && config_serves(&own, 1) && !config_serves(&own, 2));
    load_own(3);
    assert_true(own.head.settings.lines_uhz == 50000000);
}

static void with_a_profile_of_its_own_it_begins_anew(void **state)
{
    (void)state;
    assert_loads(load_second("{head: {profile: velodyne-vlp16, lines_hz: 20}}", NULL, 0));
    load_own(2);
    assert_string_equal(own.profile.name, "velodyne-vlp16");
    assert_string_equal(own.head.serial, "SIM-0001");
    assert_true(own.head.settings.lines_uhz == 20000000 && own.instrument.range_offset_m == 0.0);
    assert_true(own.noise.range == RANGE_NOISE_ON);
    /* 16 pulses in 55.296 us, by the manual. */
    assert_true(llabs(own.head.settings.prr_uhz - 289351851852) < 1000000);
    /* The scanner takes no key without a default, either. The file's head keeps all of it. */
    const char *const sets[] = {"head={profile: sphere, step_deg: 2, name: N, settings_file: f}",
                                "instrument.pan_index_deg=1"};
    assert_loads(load_second("{head: {profile: velodyne-vlp16}}", sets, 2));
    assert_true(strcmp(cfg->head.name, "N") == 0 && strcmp(cfg->head.settings_file, "f") == 0);
    assert_true(cfg->instrument.pan_index_deg == 1.0 && cfg->head.step_udeg == 2000000);
    load_own(2);
    assert_true(own.head.name[0] == '\0' && own.head.settings_file[0] == '\0' && own.head.step_udeg == 0);
    assert_true(own.instrument.pan_index_deg == 0.0);
}

static void head_station_says_whose_configuration_it_is(void **state)
{
    (void)state;
    const char *const sets[] = {"head.station=2"};
    assert_loads(load_second("{head: {lines_hz: 20}}", sets, 1));
    assert_true(cfg->head.settings.lines_uhz == 20000000 && cfg->n_links == 1);
    assert_true(!config_serves(cfg, 0) && config_serves(cfg, 1));
    load_own(1);
    assert_true(own.head.settings.lines_uhz == 50000000);
}

/* The only station has the head's scanner, even where it stops on a trajectory. */
static void stops_have_the_scanner_of_their_station(void **state)
{
    (void)state;
    const char *text = "head: {profile: riegl-vz400i, station: 3}\nplatform: {kind: stops, file: cube.obj, step_s: 1}\n"
                       "stations: [{position_m: [0, 0, 1], scanner: {head: {lines_hz: 30}}}]\n";
    assert_loads(load_text(with_scene(text)));
    assert_true(cfg->head.settings.lines_uhz == 30000000 && cfg->head.settings.station == 3);
    assert_true(config_is_alone(cfg) && config_serves(cfg, 2));
    /* Without a trajectory all stations are scanned at each stop: the fifth is the second one's again. */
    text = "head: {profile: riegl-vz400i, station: 5}\nplatform: {kind: stops, step_s: 1, end_s: 3}\nstations:\n"
           "  - {position_m: [0, 0, 1]}\n  - {position_m: [1, 0, 1], scanner: {head: {lines_hz: 30}}}\n"
           "  - {position_m: [0, 1, 1]}\n";
    assert_loads(load_text(with_scene(text)));
    assert_true(cfg->head.settings.lines_uhz == 30000000 && cfg->head.settings.station == 5);
    assert_true(config_serves(cfg, 1) && !config_serves(cfg, 0));
}

static void sets_reach_the_file_or_one_scanner(void **state)
{
    (void)state;
    const char *const sets[] = {"stations.1.scanner.head.lines_hz=10", "head.lines_hz=40", "head.prr_hz=300000",
                                "stations[2].scanner.cast.sight=off"};
    assert_loads(load_second("{head: {lines_hz: 20}}", sets, 4));
    assert_true(cfg->head.settings.lines_uhz == 40000000);
    load_own(2);
    assert_true(own.head.settings.lines_uhz == 10000000 && own.head.settings.prr_uhz == 300000000000);
    load_own(3);
    assert_true(own.head.settings.lines_uhz == 40000000 && own.cast.sight == CHOICE_OFF);
    assert_true(!config_serves(cfg, 2));
}

/* A list of the scanner replaces all of the file's. */
static void lists_are_replaced(void **state)
{
    (void)state;
    const char *const sets[] = {"surfaces.0.material=glass", "surfaces.0.glass=0.9", "surfaces.1.reflectance=0.3"};
    assert_loads(load_second("{surfaces: [{object: sheet, mirror: 0.5}]}", sets, 3));
    assert_int_equal(cfg->n_surfaces, 2);
    load_own(2);
    assert_int_equal(own.n_surfaces, 1);
    assert_string_equal(own.surface[0].material, "*");
    assert_true(own.surface[0].surface.mirror == 0.5 && own.surface[0].surface.glass != own.surface[0].surface.glass);
}

/* A command may change output and loop after the load, for all scanners. The tolerance of positions comes from each
 * scanner's plan. */
static void changes_of_output_and_loop_hold_for_all(void **state)
{
    (void)state;
    assert_loads(load_second("{plan: {tolerance_m: 0.02}}", NULL, 0));
    assert_true(cfg->output.tolerance_m == 1e-6 && cfg->scene.shared_textures == 0);
    cfg->loop.threads = 3;
    cfg->loop.pace = PACE_FAST;
    cfg->loop.tick_hz = 500.0;
    cfg->output.layout = LINE_GEO;
    cfg->output.attributes = 1;
    cfg->scene.shared_textures = 1;
    load_own(2);
    assert_memory_equal(&own.loop, &cfg->loop, sizeof own.loop);
    assert_true(own.output.layout == LINE_GEO && own.output.attributes == 1 && own.output.tolerance_m == 2e-5);
    assert_true(own.scene.shared_textures == 1 && own.scenario_file[0] == '\0');
    for (uint32_t i = 0; i < 3; i++)
        assert_int_equal(own.station[i].scanner, cfg->station[i].scanner);
}

static void the_same_settings_are_one_scanner(void **state)
{
    (void)state;
    const char *text = HEAD "stations:\n  - {position_m: [0, 0, 1], scanner: &a {noise: {range: on}}}\n"
                            "  - {position_m: [1, 0, 1], scanner: {}}\n  - {position_m: [1, 1, 1], scanner: *a}\n"
                            "  - {position_m: [2, 1, 1]}\n";
    assert_loads(load_text(with_scene(text)));
    assert_true(config_serves(cfg, 0) && !config_serves(cfg, 1) && config_serves(cfg, 2) && !config_serves(cfg, 3));
    assert_int_equal(cfg->station[3].scanner, 2);
    assert_loads(load_second("{}", NULL, 0));
    assert_true(config_is_alone(cfg));
    assert_false(cfg->scene.shared_textures); /* nothing is made for scanners that aren't there */
}

/* A scanner with the file's profile is the file's scanner, whatever lay in the memory that a load used: values are the
 * same, and so are the bytes between them. */
static void no_profile_differs_from_itself(void **state)
{
    (void)state;
    static const char *const profiles[] = {"any-rate",        "riegl-vz400i", "riegl-vz600i", "velodyne-vlp16",
                                           "hokuyo-urg-04lx", "sick-lms111",  "sphere",       "leica-rtc360"};
    for (size_t i = 0; i < sizeof profiles / sizeof *profiles; i++) {
        char text[512];
        snprintf(
            text, sizeof text,
            "head: {profile: %s}\nstations:\n  - {position_m: [0, 0, 1]}\n"
            "  - {position_m: [1, 0, 1], scanner: {head: {profile: %s}}}\n  - {position_m: [1, 1, 1], scanner: {}}\n",
            profiles[i], profiles[i]);
        assert_loads(load_text(with_scene(text)));
        if (!config_is_alone(cfg)) fail_msg("%s: %u %u", profiles[i], cfg->station[1].scanner, cfg->station[2].scanner);
    }
}

static void wrong_ones_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *scanner;
        int line;
        const char *says;
    } wrong[] = {
        {"7", 7, "stations[1].scanner: here stands a single value; allowed a section"},
        {"{hed: {lines_hz: 1}}", 7,
         "stations[1].scanner.hed: unknown key, did you mean stations[1].scanner.head? allowed head, beam, cast"},
        {"{head: {lines: 1}}", 7,
         "stations[1].scanner.head.lines: unknown key, did you mean stations[1].scanner.head.lines_hz?"},
        {"{head: {optics: {}}}", 7, "scanner.head.optics: unknown key, did you mean stations[1].scanner.optics?"},
        /* A scanner has no section scene: the file has it. */
        {"{head: {scene: {}}}", 7, "scanner.head.scene: unknown key, did you mean scene at the top of the file?"},
        {"{scene: {cutouts: off}}", 7, "stations[1].scanner.scene: the same for all scanners; allowed sections head"},
        {"{head: {station: 2}}", 7, "stations[1].scanner.head.station: the same for all scanners"},
        {"{head: {lines_hz: 2000}}", 7, "stations[1].scanner.head.lines_hz: 2000 is outside the limits"},
        {"{head: {lines_hz: 20, lines_hz: 30}}", 7, "stations[1].scanner.head.lines_hz: given twice, first on line 7"},
        {"{head: {profile: nobody}}", 7, "stations[1].scanner.head.profile: no profile \"nobody\""},
        {"{surfaces: [{glass: 2}]}", 7, "stations[1].scanner.surfaces[0].glass: \"2\" is out of range; allowed 0 to 1"},
        {"{noise: {range: signal}}", 7, "stations[1].scanner.noise.range: signal, but no signal is modelled"},
        /* One of two contradicting keys is the file's. */
        {"{head: {prr_hz: 123}}", 7, "stations[1].scanner.head.prr_hz: 123 is not a pulse rate of head profile"},
        {"{signal: {visibility_m: 9, extinction_1_km: 1}}", 7,
         "stations[1].scanner.signal.extinction_1_km: given togeth"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        char place[16];
        assert_int_equal(load_second(wrong[i].scanner, NULL, 0), SH_EINPUT);
        assert_says(wrong[i].says);
        snprintf(place, sizeof place, ".yaml:%d: ", wrong[i].line);
        assert_says(place);
        assert_int_equal(diagnostics.n, 1);
    }
    const char *const sets[] = {"noise.angle=on"};
    assert_int_equal(load_second("{head: {profile: velodyne-vlp16}}", sets, 1), SH_EINPUT);
    assert_says("--set noise.angle, for stations[1].scanner: head profile velodyne-vlp16 gives no angle noise");
}

static void faults_of_all_are_told_once(void **state)
{
    (void)state;
    const char *text =
        "head: {profile: riegl-vz400i, lines_hz: 9000}\n"
        "stations:\n  - {position_m: [0, 0, 1]}\n  - {position_m: [1, 0, 1], scanner: {beam: {mode: x}}}\n"
        "  - {position_m: [1, 1, 1], scanner: {cast: {sight: x}}}\n";
    assert_int_equal(load_text(with_scene(text)), SH_EINPUT);
    assert_int_equal(diagnostics.n, 3);
    assert_non_null(strstr(diagnostics.err[0].text, ":1: head.lines_hz: "));
    assert_non_null(strstr(diagnostics.err[1].text, ":4: stations[1].scanner.beam.mode: "));
    assert_non_null(strstr(diagnostics.err[2].text, ":5: stations[2].scanner.cast.sight: "));
}

/* ---- sites */

static struct site *load_site(const struct config *of, const struct site *other)
{
    struct site *site;
    if (site_load_for(of, SITE_FOR_SCANS, other, NULL, &site, &err) != SH_OK) fail_msg("%s", err.text);
    return site;
}

/* The faults of all scanners are those of the file and of a scenario, but for the faults of links. */
static void each_has_the_faults(void **state)
{
    (void)state;
    char scenario[sizeof dir + 16];
    snprintf(scenario, sizeof scenario, "%s/faults.yaml", dir);
    write_in("faults.yaml", "faults:\n  - {kind: drop, link: 1}\n  - {kind: mirror_slow, factor: 0.5}\n");
    const char *whole =
        with_scene(HEAD REST STATIONS "    scanner: {head: {lines_hz: 20}}" THIRD "links: [{type: tcp}]\n"
                                      "faults: [{kind: stall, link: 1, for_ms: 5}]\n");
    assert_loads(load_text(whole));
    assert_int_equal(config_add_scenario(cfg, scenario, &diagnostics), SH_OK);
    for (uint32_t station = 1; station <= 3; station++) {
        load_own(station);
        assert_int_equal(own.faults.n, 3);
        assert_int_equal(own.faults.fault[0].kind, FAULT_STALL);
        assert_int_equal(own.faults.fault[2].kind, FAULT_MIRROR_SLOW);
    }
    /* A fault that one of them can't have is reported when it is loaded. */
    assert_loads(load_second("{head: {profile: sphere}}", NULL, 0));
    assert_int_equal(config_add_scenario(cfg, scenario, &diagnostics), SH_OK);
    assert_int_equal(config_load_scanner(cfg, 2, &own, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "mirror_slow, but head profile sphere (sphere) has no mirror"));
    unlink(scenario);
}

/* One load of the scene and one BVH serve all, whatever the second scanner needs. */
static void sites_share_scene_and_bvh(void **state)
{
    (void)state;
    static const char *const scanner[] = {
        "{head: {profile: velodyne-vlp16}}",
        "{signal: {model: on}, beam: {mode: rings}}",                       /* textures; rays beside the head */
        "{surfaces: [{material: glass, glass: 0.9}], optics: {depth: 3}}",  /* rays that begin far away */
        "{instrument: {mirror_offset_m: 0.3}, head: {profile: leica-p40}}", /* likewise */
        "{plan: {tolerance_m: 0.02}, cast: {sight: on}}",
    };
    for (size_t i = 0; i < sizeof scanner / sizeof *scanner; i++)
        for (int first_goes_first = 0; first_goes_first < 2; first_goes_first++) {
            assert_loads(load_second(scanner[i], NULL, 0));
            load_own(2);
            struct site *a = load_site(cfg, NULL), *b = load_site(&own, a);
            assert_ptr_equal(a->world, b->world);
            assert_ptr_equal(a->scene, b->scene);
            assert_true(a->bvh != NULL && a->bvh == b->bvh);
            assert_int_equal(site_n_served(a), 2);
            assert_int_equal(site_n_served(b), 1);
            site_free(first_goes_first ? a : b);
            site_free(first_goes_first ? b : a);
        }
}

static void another_scene_is_not_shared(void **state)
{
    (void)state;
    assert_loads(load_second("{noise: {range: off}}", NULL, 0));
    struct site *a = load_site(cfg, NULL);
    static struct config other;
    other = *cfg;
    other.scene.mesh[0].scale = 2.0;
    struct site *b = load_site(&other, a);
    assert_ptr_not_equal(a->world, b->world);
    assert_true(b->scene->max_m[0] == 2.0 * a->scene->max_m[0]);
    site_free(a);
    site_free(b);
}

static void the_head_stays_at_its_stations(void **state)
{
    (void)state;
    struct command_device dev = {
        .limits = {.n_stations = 4, .elsewhere = 1 | 4}, .settings.station = 2, .state = HEAD_IDLE};
    static const struct {
        const char *line, *reply;
    } say[] = {{"HEAD:STATION 4", "OK"},
               {"HEAD:STATION?", "4"},
               {"HEAD:STATION 3", "HEAD:STATION 3 has another scanner; run that: --set head.station=3"},
               {"HEAD:STATION 5", "allowed 1 to 4"},
               {"HEAD:STATION MIN", "OK"},
               {"HEAD:STATION?", "2"},
               {"HEAD:STATION? MAX", "4"}};
    for (size_t i = 0; i < sizeof say / sizeof *say; i++) {
        struct command_result result;
        command_execute(&dev, 1, say[i].line, &result);
        if (strstr(result.reply, say[i].reply) == NULL) fail_msg("%s: %s", say[i].line, result.reply);
    }
    assert_int_equal(dev.settings.station, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(its_keys_stand_in_for_the_files),
        cmocka_unit_test(with_a_profile_of_its_own_it_begins_anew),
        cmocka_unit_test(head_station_says_whose_configuration_it_is),
        cmocka_unit_test(stops_have_the_scanner_of_their_station),
        cmocka_unit_test(sets_reach_the_file_or_one_scanner),
        cmocka_unit_test(lists_are_replaced),
        cmocka_unit_test(changes_of_output_and_loop_hold_for_all),
        cmocka_unit_test(the_same_settings_are_one_scanner),
        cmocka_unit_test(no_profile_differs_from_itself),
        cmocka_unit_test(wrong_ones_are_refused),
        cmocka_unit_test(faults_of_all_are_told_once),
        cmocka_unit_test(each_has_the_faults),
        cmocka_unit_test(sites_share_scene_and_bvh),
        cmocka_unit_test(another_scene_is_not_shared),
        cmocka_unit_test(the_head_stays_at_its_stations),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
