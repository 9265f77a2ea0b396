/* SPDX-License-Identifier: MIT */
/* The site and the loop ask a loaded configuration these questions: what moves, what is modelled, how many pulses are
 * cast, which files it names. */
#include "firmware_sim/config/check_head.h"
#include "firmware_sim/config/check_links.h"
#include "firmware_sim/config/files.h"
#include "firmware_sim/config/scanners.h"
#include "tests/unit/config_rig.h"

#include <math.h>
#include <unistd.h>

#include "drivers/protocol/protocol.h"

/* Loads a configuration of two meshes and two stations, in which nothing moves. */
static void begin(void)
{
    assert_loads(load_text(base));
    cfg->scene.mesh[1] = cfg->scene.mesh[0];
    cfg->scene.n_meshes = 2;
    cfg->station[1] = cfg->station[0];
    cfg->n_stations = 2;
}

static void expect_answer(const char *got, const char *want)
{
    if (want == NULL)
        assert_null(got);
    else
        assert_string_equal(got, want);
}

/* Sets a number of the configuration to -1, asks whether beams and rays move, and sets it back. */
static void expect_moves(double *figure, const char *beam, const char *rays)
{
    const double before = *figure;
    *figure = -1.0;
    expect_answer(config_beam_moves(cfg), beam);
    expect_answer(config_rays_move(cfg), rays);
    *figure = before;
    expect_answer(config_beam_moves(cfg), NULL);
    expect_answer(config_rays_move(cfg), NULL);
}

static void what_moves_the_beam(void **state)
{
    (void)state;
    static const char moves[] = "the head or a mesh moves";
    static const char legs[] = "a tripod's legs (stations[].tripod.legs) have outlines that are not looked for";
    static const char offset[] = "instrument.transit_offset_m or mirror_offset_m moves the beam";
    static const struct {
        enum config_platform_kind kind;
        const char *beam, *rays;
        int head;
    } kinds[] = {{PLATFORM_STATIC, NULL, NULL, 0},
                 {PLATFORM_TRAJECTORY, moves, "the head moves", 1},
                 {PLATFORM_LIVE, moves, "the head moves", 1},
                 {PLATFORM_STOPS, moves, NULL, 0}}; /* it stands while it scans, each time elsewhere */
    begin();
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
        cfg->platform.kind = kinds[i].kind;
        expect_answer(config_beam_moves(cfg), kinds[i].beam);
        expect_answer(config_rays_move(cfg), kinds[i].rays);
        assert_int_equal(config_head_moves(&cfg->platform), kinds[i].head);
    }
    cfg->platform.kind = PLATFORM_STATIC;
    for (uint32_t i = 0; i < 2; i++) {
        struct config_mesh *mesh = &cfg->scene.mesh[i];
        assert_false(config_mesh_moves(mesh));
        for (int axis = 0; axis < 3; axis++)
            expect_moves(&mesh->move_m_s[axis], moves, NULL);
        expect_moves(&mesh->turn_deg_s, moves, NULL);
        mesh->pivot_m[0] = mesh->cycle_s = 1.0; /* nothing moves by that */
        assert_false(config_mesh_moves(mesh));
    }
    expect_moves(&cfg->instrument.transit_offset_m, offset, offset);
    expect_moves(&cfg->instrument.mirror_offset_m, offset, offset);
    expect_moves(&cfg->instrument.range_offset_m, NULL, NULL);
    cfg->station[1].tripod.legs = 1; /* as by default, without a tripod */
    expect_answer(config_beam_moves(cfg), NULL);
    cfg->station[1].tripod.given = 1;
    expect_answer(config_beam_moves(cfg), legs);
    expect_answer(config_rays_move(cfg), NULL);
    cfg->station[1].tripod.legs = 0;
    expect_answer(config_beam_moves(cfg), NULL);
}

static void an_adaptive_beam_and_a_map_stand_still(void **state)
{
    (void)state;
    static const struct {
        const char *settings, *text;
        int line;
        const char *key;
    } cases[] = {
        {"beam: {mode: adaptive}\n", NULL, 0, NULL},
        {"instrument: {transit_offset_m: 0.1}\nbeam: {mode: adaptive}\n",
         "adaptive, but instrument.transit_offset_m or mirror_offset_m moves the beam; allowed single, rings, auto", 15,
         "beam.mode"},
        {"instrument: {mirror_offset_m: 0.1}\nbeam: {mode: auto}\n", NULL, 0, NULL},
        {"platform: {kind: live}\nbeam: {mode: adaptive}\n",
         "adaptive, but the head or a mesh moves; allowed single, rings, auto", 15, "beam.mode"},
        {"platform: {kind: live}\ncast: {sight: on}\n", "on, but the head moves; allowed auto, off", 15, "cast.sight"},
        {"beam: {mode: rings}\ncast: {sight: on}\n",
         "on, but beam.mode is rings, which have no ray for the centre; allowed auto, off", 15, "cast.sight"},
        {"beam: {mode: adaptive}\ncast: {sight: on}\n", NULL, 0, NULL},
        {"beam: {mode: rings}\ncast: {sight: auto}\n", NULL, 0, NULL},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char place[256];
        const int code = load_with_head("riegl-vz400i", "", cases[i].settings);
        snprintf(place, sizeof place, "%s:%d: ", config_path, cases[i].line);
        if (cases[i].text == NULL)
            assert_loads(code);
        else
            expect_only(place, cases[i].key, cases[i].text);
    }
    char *text = edited("      scale: 1\n", "      scale: 1\n      turn_deg_s: 5\n");
    char *whole = replaced(text, "any-rate\n" PRR LINES, "riegl-vz400i\n"), *all;
    assert_true(asprintf(&all, "%sbeam: {mode: adaptive}\n", whole) > 0);
    assert_int_equal(load_text(all), SH_EINPUT);
    assert_says(": beam.mode: adaptive, but the head or a mesh moves; allowed single, rings, auto");
    free(text);
    free(whole);
    free(all);
}

static void what_is_modelled(void **state)
{
    (void)state;
    begin();
    struct config_profile *p = &cfg->profile;
    p->beam_exit_m = p->beam_divergence_rad = 0.0;
    assert_false(config_has_footprint(cfg));
    p->beam_exit_m = 0.001;
    assert_true(config_has_footprint(cfg));
    p->beam_exit_m = 0.0;
    p->beam_divergence_rad = 0.001;
    assert_true(config_has_footprint(cfg));
    assert_false(config_has_waves(cfg));
    cfg->head.settings.waves = 1;
    assert_true(config_has_waves(cfg));
    cfg->head.settings.waves = 0;
    cfg->waveform.echoes = WAVE_ECHOES_FRACTION;
    assert_true(config_has_waves(cfg));
    assert_false(config_wants_textures(cfg));
    cfg->signal.on = 1;
    assert_true(config_wants_textures(cfg));
    cfg->signal.on = 0;
    cfg->scene.shared_textures = 1;
    assert_true(config_wants_textures(cfg));
    cfg->scene.shared_textures = 0;
    cfg->output.colour = COLOUR_TEXTURE;
    assert_true(config_wants_textures(cfg));
    cfg->output.colour = COLOUR_SOLID;
    assert_false(config_wants_textures(cfg));
}

static void a_range_is_limited_at_either_end(void **state)
{
    (void)state;
    static const struct {
        const char *settings;
        int is_limited;
    } cases[] = {{"", 0},
                 {"  range_min_m: 0.5\n  range_max_m: 800\n", 0}, /* the profile's own */
                 {"  range_min_m: 0.6\n", 1},
                 {"  range_max_m: 799\n", 1}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        assert_loads(load_with_head("riegl-vz400i", cases[i].settings, ""));
        assert_int_equal(config_limits_range(cfg), cases[i].is_limited);
    }
}

static void links_and_their_protocols(void **state)
{
    (void)state;
    begin();
    cfg->n_links = 3;
    cfg->link[0] = (struct link_spec){.type = LINK_FILE, .protocol = PROTOCOL_NATIVE};
    cfg->link[1] = (struct link_spec){.type = LINK_TCP, .protocol = PROTOCOL_NMEA};
    cfg->link[2] = (struct link_spec){.type = LINK_UDP, .protocol = PROTOCOL_NMEA};
    assert_true(config_speaks(cfg, PROTOCOL_NATIVE) && config_speaks(cfg, PROTOCOL_NMEA));
    assert_false(config_speaks(cfg, PROTOCOL_COLA));
    assert_int_equal(cfg_link_that_needs(cfg, PROTOCOL_NEEDS_PLACE), 1);
    assert_int_equal(cfg_link_that_needs(cfg, PROTOCOL_NEEDS_POLAR), -1);
    cfg->link[1].type = LINK_USB; /* which doesn't speak it */
    assert_int_equal(cfg_link_that_needs(cfg, PROTOCOL_NEEDS_PLACE), 2);
    cfg->n_links = 2;
    assert_int_equal(cfg_link_that_needs(cfg, PROTOCOL_NEEDS_PLACE), -1);
    assert_true(config_speaks(cfg, PROTOCOL_NMEA));
    cfg->n_links = 1;
    assert_false(config_speaks(cfg, PROTOCOL_NMEA));
}

static void a_protocol_fits_emitters_and_beams(void **state)
{
    (void)state;
    const struct protocol_ops any = {.emitters = 0}, beams = {.emitters = 1u << EMITTER_BEAMS, .n_beams = 16};
    static const struct config_profile sixteen = {.emitter = {.kind = EMITTER_BEAMS, .n_beams = 16}},
                                       two = {.emitter = {.kind = EMITTER_BEAMS, .n_beams = 2}},
                                       line = {.emitter = {.kind = EMITTER_LINE}};
    struct sh_err why;
    assert_true(cfg_protocol_fits(&any, &sixteen, &why) && cfg_protocol_fits(&any, &line, &why));
    assert_true(cfg_protocol_fits(&beams, &sixteen, &why));
    assert_false(cfg_protocol_fits(&beams, &two, &why) || cfg_protocol_fits(&beams, &line, &why));
    const struct protocol_ops some = {.emitters = 1u << EMITTER_BEAMS | 1u << EMITTER_LINE, .n_beams = 16};
    assert_true(cfg_protocol_fits(&some, &line, &why) && !cfg_protocol_fits(&some, &two, &why));
}

/* A sweep of the VZ-400i is 240 deg (facets 3, gain 2), of which 100 are used: its profile says so. */
static void pulses_outside_the_window_are_not_cast(void **state)
{
    (void)state;
    assert_loads(load_with_head("riegl-vz400i", "  prr_hz: 300000\n", ""));
    assert_true(fabs(config_cast_hz(cfg) - 300000.0 * 100.0 / 240.0) < 1e-6);
    assert_true(fabs(cfg_used_share(&cfg->profile) - 100.0 / 240.0) < 1e-12);
    assert_loads(load_with_head("riegl-vz400i", "  prr_hz: 300000\n  line_start_deg: -10\n  line_stop_deg: 14\n", ""));
    assert_true(fabs(config_cast_hz(cfg) - 30000.0) < 1e-6);
    /* The whole ring goes from 0 to 360 deg; a window across azimuth 0 has 20 deg. */
    assert_loads(load_with_head("sphere", "  step_deg: 1\n  lines_hz: 10\n", ""));
    assert_true(fabs(config_cast_hz(cfg) - 3600.0) < 1e-9);
    assert_loads(
        load_with_head("sphere", "  step_deg: 1\n  lines_hz: 10\n  line_start_deg: 350\n  line_stop_deg: 10\n", ""));
    assert_true(fabs(config_cast_hz(cfg) - 200.0) < 1e-9);
    cfg->profile.optical_gain = 0.0; /* a profile that is being read */
    assert_true(cfg_used_share(&cfg->profile) == 1.0);
}

static void threads_are_as_given_or_one_per_processor(void **state)
{
    (void)state;
    const long n = sysconf(_SC_NPROCESSORS_ONLN);
    begin();
    assert_int_equal(cfg->loop.threads, 0);
    assert_int_equal(config_threads(cfg), n < CONFIG_MAX_THREADS ? n : CONFIG_MAX_THREADS);
    cfg->loop.threads = 1;
    assert_int_equal(config_threads(cfg), 1);
    cfg->loop.threads = CONFIG_MAX_THREADS;
    assert_int_equal(config_threads(cfg), CONFIG_MAX_THREADS);
    cfg->loop.threads = CONFIG_MAX_THREADS + 1;
    assert_int_equal(config_threads(cfg), CONFIG_MAX_THREADS);
}

static void stops_go_through_the_stations(void **state)
{
    (void)state;
    begin();
    cfg->n_stations = 3;
    for (uint32_t number = 1; number <= 7; number++) {
        cfg->platform.kind = PLATFORM_STATIC;
        assert_int_equal(cfg_station_at(cfg, number), number - 1);
        cfg->platform.kind = PLATFORM_STOPS;
        assert_int_equal(cfg_station_at(cfg, number), (number - 1) % 3);
    }
    cfg->n_stations = 1; /* all stops belong to a single station */
    assert_int_equal(cfg_station_at(cfg, 5), 0);
    /* A head that is at none of the stations serves all of them. */
    cfg->n_stations = 2;
    cfg->platform.kind = PLATFORM_STATIC;
    cfg->station[0].scanner = 1;
    cfg->station[1].scanner = 2;
    cfg->head.settings.station = 2;
    assert_true(config_serves(cfg, 1) && !config_serves(cfg, 0) && !config_is_alone(cfg));
    cfg->head.settings.station = 3;
    assert_true(config_serves(cfg, 0) && config_serves(cfg, 1) && config_is_alone(cfg));
    cfg->head.settings.station = 0;
    assert_true(config_serves(cfg, 0) && config_serves(cfg, 1));
    cfg->head.settings.station = 1;
    cfg->n_stations = 1;
    assert_true(config_serves(cfg, 1));
}

/* Some keys count only where they are given, even if their value is the default. */
static void what_is_given_is_noted(void **state)
{
    (void)state;
    const struct {
        const char *key, *value, *with; /* with: what else the key needs */
        const int *member;
    } keys[] = {
        {"output.layout", "polar", NULL, &cfg->output.layout_given},
        {"output.colour_limits", "[1, 2]", "output.colour=range", &cfg->output.colour_limited},
        {"scene.anchor.height_m", "0", "scene.anchor.source=ifc", &cfg->scene.anchor.height_given},
        {"optics.depth", "1", NULL, &cfg->optics.depth_given},
        {"signal.extinction_1_km", "0", NULL, &cfg->signal.has_extinction},
        {"platform.end_s", "5", "platform={kind: trajectory, file: a}", &cfg->platform.has_end},
        {"platform.last_frame", "5", "platform={kind: stops, file: a, frames_per_s: 1, frame_step: 1}",
         &cfg->platform.has_end},
        {"stations[0].instrument_height_m", "0", NULL, &cfg->station[0].has_instrument_height},
        {"stations[0].tripod.leg_m", "1", NULL, &cfg->station[0].tripod.given},
    };
    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++)
        for (int given = 0; given < 2; given++) {
            char set[64];
            snprintf(set, sizeof set, "%s=%s", keys[i].key, keys[i].value);
            const char *const sets[] = {keys[i].with != NULL ? keys[i].with : "head.frames=1", set};
            write_file(config_path, base, strlen(base));
            load_sets(sets, 1 + given);
            if (*keys[i].member != given) fail_msg("%s: %d; %s", keys[i].key, *keys[i].member, err.text);
        }
    assert_loads(load_text(base));
    assert_int_equal(cfg->station[0].has_position, 1);
    assert_int_equal(cfg->station[0].place, PLACE_NONE);
}

/* ---- files */

struct files {
    char text[2048];
    int most;
};

static int note_file(void *ctx, const char *key, const char *path, int is_written)
{
    struct files *f = ctx;
    const size_t used = strlen(f->text);
    snprintf(f->text + used, sizeof f->text - used, "%s=%s%s\n", key, path, is_written ? " (written)" : "");
    return --f->most > 0 ? SH_OK : SH_ELOST;
}

static void each_file_has_its_key(void **state)
{
    (void)state;
    static const char all[] = "head.settings_file=set (written)\nscene.meshes[0].file=cube\n"
                              "scene.meshes[1].file=tree\nscene.meshes[1].copies=trees\nplatform.file=path\n"
                              "platform.waypoints=way\nlinks[1].path=out (written)\nwaveform.pulse_file=pulse\n"
                              "head.profile: directions=rays\nhead.profile=mine\n--scenario=worse\n";
    struct files f = {"", 100};
    begin();
    strcpy(cfg->head.settings_file, "set");
    strcpy(cfg->scene.mesh[0].file, "cube");
    strcpy(cfg->scene.mesh[1].file, "tree");
    strcpy(cfg->scene.mesh[1].copies, "trees");
    strcpy(cfg->scene.mesh[2].file, "beyond");
    strcpy(cfg->platform.file, "path");
    strcpy(cfg->platform.waypoints, "way");
    cfg->n_links = 2;
    strcpy(cfg->link[1].path, "out");
    strcpy(cfg->waveform.pulse_file, "pulse");
    strcpy(cfg->profile.arrangement.directions, "rays");
    strcpy(cfg->profile_file, "mine");
    strcpy(cfg->scenario_file, "worse");
    assert_int_equal(config_each_file(cfg, note_file, &f), SH_OK);
    assert_string_equal(f.text, all);
    /* A result other than SH_OK ends the walk, wherever it is. */
    const char *end = all;
    for (int n = 1; *end != '\0'; n++) {
        end = strchr(end, '\n') + 1;
        f = (struct files){"", n};
        assert_int_equal(config_each_file(cfg, note_file, &f), SH_ELOST);
        assert_int_equal(strlen(f.text), end - all);
    }
}

/* ---- profiles */

static void the_signal_of_a_program(void **state)
{
    (void)state;
    struct detect_signal_spec spec;
    const struct config_profile p = {.threshold_snr = 1,
                                     .overlap_m = 2,
                                     .range_sigma_m = 3,
                                     .range_sigma_at_m = 4,
                                     .range_sigma_reflectance = 5,
                                     .range_sigma_floor_m = 6,
                                     .range_sigma_ppm = 7};
    const struct config_program program = {.n_reaches = 2, .reach = {{0.9, 100.0, 0}, {0.2, 50.0, 0}}};
    config_signal_spec(&p, &program, &spec);
    assert_true(spec.threshold_snr == 1 && spec.overlap_m == 2 && spec.sigma_m == 3 && spec.sigma_at_m == 4);
    assert_true(spec.sigma_reflectance == 5 && spec.sigma_floor_m == 6 && spec.sigma_ppm == 7 && spec.n_reaches == 2);
    assert_true(spec.reach[0].reflectance == 0.9 && spec.reach[0].range_m == 100.0);
    assert_true(spec.reach[1].reflectance == 0.2 && spec.reach[1].range_m == 50.0);
}

/* A coarser geometry divides all step numbers by the same number. */
static void steps_are_divided(void **state)
{
    (void)state;
    static const int turns[] = {1, -1};
    for (int i = 0; i < 2; i++) {
        struct emitter want;
        struct config_profile p = {.arrangement = {.steps_per_turn = 1440,
                                                   .first_step = 180,
                                                   .last_step = 1260,
                                                   .front_step = 720,
                                                   .step_direction = i == 0 ? TURN_CLOCKWISE : TURN_COUNTER_CLOCKWISE}};
        config_set_steps(&p, 720);
        memset(&want, 0, sizeof want);
        emitter_set_planar(&want, 720, 90, 630, 360, turns[i]);
        assert_memory_equal(&p.emitter, &want, sizeof want);
        config_set_steps(&p, 1440);
        emitter_set_planar(&want, 1440, 180, 1260, 720, turns[i]);
        assert_memory_equal(&p.emitter, &want, sizeof want);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_moves_the_beam),
        cmocka_unit_test(an_adaptive_beam_and_a_map_stand_still),
        cmocka_unit_test(what_is_modelled),
        cmocka_unit_test(a_range_is_limited_at_either_end),
        cmocka_unit_test(links_and_their_protocols),
        cmocka_unit_test(a_protocol_fits_emitters_and_beams),
        cmocka_unit_test(pulses_outside_the_window_are_not_cast),
        cmocka_unit_test(threads_are_as_given_or_one_per_processor),
        cmocka_unit_test(stops_go_through_the_stations),
        cmocka_unit_test(what_is_given_is_noted),
        cmocka_unit_test(each_file_has_its_key),
        cmocka_unit_test(the_signal_of_a_program),
        cmocka_unit_test(steps_are_divided),
    };
    return cmocka_run_group_tests_name("answers of a configuration", tests, set_up, tear_down);
}
