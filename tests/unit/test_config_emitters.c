/* SPDX-License-Identifier: MIT */
/* Emitters of head profiles: derived figures, and refusals with file, line and key. */
#include "firmware_sim/config/load.h"
#include "tests/unit/config_rig.h"

static void rates_and_angles_follow(void **state)
{
    (void)state;
    assert_loads(load_with_head("hokuyo-ust-20lx", "", ""));
    assert_int_equal(cfg->head.settings.prr_uhz, INT64_C(1440) * 40 * 1000000);
    assert_int_equal(cfg->profile.fov_min_udeg, -135000000);
    assert_int_equal(cfg->profile.fov_max_udeg, 135000000);
    assert_int_equal(cfg->head.settings.line_start_udeg, -135000000);
    assert_string_equal(cfg->profile.firmware, "4.1.0b-A");
    assert_loads(load_with_head("hokuyo-urg-04lx", "  lines_hz: 9.25\n", ""));
    assert_int_equal(cfg->head.settings.prr_uhz, INT64_C(1024) * 9250000);
    assert_int_equal(cfg->profile.fov_min_udeg, -119531250); /* (44 - 384) 360 / 1024 deg */
    assert_loads(load_with_head("hokuyo-urg-04lx", "  lines_hz: 9.25\n  prr_hz: 9472\n", ""));
    assert_loads(load_with_head("velodyne-vlp16", "  lines_hz: 10\n", ""));
    assert_int_equal(cfg->head.settings.prr_uhz, 289351851852);
    assert_int_equal(cfg->profile.emitter.sequence_ticks, 24);
    assert_loads(load_with_head("riegl-vz400i", "", ""));
    assert_int_equal(cfg->profile.emitter.kind, EMITTER_LINE);
    assert_string_equal(cfg->profile.firmware, "1.0.0");
}

struct wrong {
    const char *profile, *old, *with, *key, *fragment;
};

/* Checks one of the errors; others may follow from the same change. */
static void check_wrong(const struct wrong *w)
{
    char start[256];
    if (load_changed(w->profile, w->old, w->with) != SH_EINPUT) fail_msg("%s was taken", w->with);
    place_in_profile(w->key, start, sizeof start);
    for (uint32_t i = 0; i < diagnostics.n && i < CONFIG_MAX_DIAGNOSTICS; i++) {
        const char *text = diagnostics.err[i].text;
        if (strncmp(text, start, strlen(start)) == 0 && strstr(text, w->fragment) != NULL) return;
    }
    fail_msg("%s: none of %u faults is \"%s...%s\"; the first: %s", w->with, diagnostics.n, start, w->fragment,
             err.text);
}

static void tables_that_do_not_fit_are_refused(void **state)
{
    (void)state;
    static const char urg[] = "hokuyo-urg-04lx", vlp[] = "velodyne-vlp16";
    static const struct wrong wrong[] = {
        {urg, "emitter: planar", "emitter: plane", "emitter", "allowed line, planar, beams, sphere, directions"},
        {urg, "emitter: planar", "emitter: beams", "steps_per_turn", "allowed only with emitter: planar"},
        {urg, "emitter: planar\n", "", "steps_per_turn", "allowed only with emitter: planar"},
        {urg, "steps_per_turn: { value: 1024,", "steps_per_turn: { value: 0,", "steps_per_turn", "1 to 1000000"},
        {urg, "steps_per_turn: { value: 1024,", "steps_per_turn: { value: 725,", "last_step",
         "725, and a turn has 725 steps; allowed up to 724"},
        {urg, "first_step: { value: 44,", "first_step: { value: 726,", "first_step",
         "726, but last_step is 725; allowed 0 to 724"},
        {urg, "first_step: { value: 44,", "first_step: { value: 725,", "first_step",
         "725, but last_step is 725; allowed 0 to 724"},
        {urg, "last_step: { value: 725,", "last_step: { value: 0,", "last_step", "allowed 1 to 1023"},
        {urg, "front_step: { value: 384,", "front_step: { value: 1024,", "front_step", "allowed up to 1023"},
        {urg, "front_step: { value: 384, from: quoted }\n", "", "front_step", "missing"},
        {urg, "value: counter-clockwise", "value: left", "step_direction", "allowed clockwise, counter-clockwise"},
        {urg, "lines_max_hz: { value: 10,", "lines_max_hz: { value: 10000,", "steps_per_turn",
         "make 10240000 pulses/s; allowed up to 10000000"},
        {urg, "emitter: planar", "emitter: planar\nfacets: { value: 1, from: assumed }", "facets",
         "allowed only with emitter: line"},
        {urg, "emitter: planar", "emitter: planar\nprr_max_hz: { value: 10240, from: assumed }", "prr_max_hz",
         "allowed only with emitter: line"},
        {vlp, "firing_ns: { value: 55296,", "firing_ns: { value: 34560,", "beams",
         "34560 ns ends before its last firing; allowed more than 34560 ns"},
        {vlp, "firing_ns: { value: 55296,", "firing_ns: { value: 55296.0001,", "firing_ns",
         "too fine; allowed multiples of 0.001 ns"},
        {vlp, "firing_ns: { value: 55296,", "firing_ns: { value: 60000000,", "firing_ns",
         "longer than a turn at lines_max_hz; allowed up to 50000000 ns"},
        {vlp, "offset_ns: 2304,", "offset_ns: 4608,", "beams", "beam 3 fires after 4608 ns, but the beam before it"},
        {vlp, "offset_ns: 0,", "offset_ns: 1,", "beams", "the first beam fires after 1 ns; allowed 0"},
        {vlp, "offset_ns: 0,", "offset_ns: -1,", "beams[0].offset_ns", "allowed a whole number"},
        {vlp, "elevation_deg: -15,", "elevation_deg: -91,", "beams[0].elevation_deg", "allowed -90 to 90 deg"},
        {vlp, "elevation_deg: -15, ", "", "beams[0].elevation_deg", "missing"},
        {vlp, "beams:\n", "step_deg: { value: 1, from: assumed }\nbeams:\n", "step_deg",
         "allowed only with emitter: sphere"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
        check_wrong(&wrong[i]);
}

/* A head of the row's profile can't have the row's settings. The error's line is the configuration's. */
static void settings_that_do_not_fit_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *profile, *settings, *says;
    } wrong[] = {
        {"hokuyo-urg-04lx", "  prr_hz: 10000\n",
         ":3: head.prr_hz: 10000, but a line of head profile hokuyo-urg-04lx has 1024 pulses; allowed 10240"},
        {"hokuyo-urg-04lx", "  prr_hz: 10000\n  lines_hz: 9.5\n",
         ":3: head.prr_hz: 10000, but a line of head profile hokuyo-urg-04lx has 1024 pulses; allowed 9728"},
        {"hokuyo-urg-04lx", "  lines_hz: 11\n", ":3: head.lines_hz: 11 is outside the limits of head profile"},
        {"hokuyo-urg-04lx", "  pan_deg_s: 1\n", ":3: head.pan_deg_s: 1 is outside"},
        {"hokuyo-ust-20lx", "  lines_hz: 11\n",
         "11 is outside the limits of head profile hokuyo-ust-20lx; allowed 40 Hz"},
        {"hokuyo-urg-04lx", "  line_start_deg: -130\n", "allowed -119.53125 to 119.882813"},
        {"velodyne-vlp16", "  step_deg: 1\n",
         ":3: head.step_deg: head profile velodyne-vlp16 has emitter: beams; allowed only with emitter: sphere"},
        {"riegl-vz400i", "  ring_stop_deg: 1\n", ":3: head.ring_stop_deg: head profile riegl-vz400i has emitter: line"},
        {"sphere", "  step_deg: 0.009\n", "out of range; allowed 0.01 to 90 deg"},
        {"sphere", "  ring_start_deg: 1\n  ring_stop_deg: 0.5\n",
         ":4: head.ring_stop_deg: the rings go from 1 to 0.5 deg; allowed a ring_start_deg of at most 0.5, or a "
         "ring_stop_deg of at least 1"},
        {"sphere", "  ring_start_deg: 0.1\n  ring_stop_deg: 0.9\n",
         "no ring lies from 0.1 to 0.9 deg; allowed are limits around a ring, such as 0 or 1 deg"},
        {"sphere", "  line_start_deg: 90\n  line_stop_deg: 90\n",
         "the line goes from 90 to 90 deg; allowed a line_start_deg other than 90"},
        {"sphere", "  step_deg: 0.01\n  lines_hz: 278\n",
         "278 is outside the limits of head profile sphere; allowed 1 to"},
        {"velodyne-vlp16", "  prr_hz: 300000\n", ":3: head.prr_hz: 300000 is outside"},
        {"velodyne-vlp16", "  lines_hz: 9.5\n  phase_lock: on\n",
         ":4: head.phase_lock: on, but with head.lines_hz 9.5 the rotor is at another azimuth each second; allowed "},
        {"velodyne-vlp16", "  phase_deg: 360\n",
         "head.phase_deg: \"360\" is out of range; allowed 0 to 359.999999 deg"},
        {"hokuyo-urg-04lx", "  phase_lock: on\n",
         ":3: head.phase_lock: head profile hokuyo-urg-04lx has emitter: planar; allowed only with emitter: beams"},
        {"hokuyo-urg-04lx", "  motor_ppm: 1\n", ":3: head.motor_ppm: head profile hokuyo-urg-04lx has emitter: planar"},
        {"velodyne-vlp16", "  ambiguity: folded\n", ":3: head.ambiguity: the pulses of head profile velodyne-vlp16"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        if (load_with_head(wrong[i].profile, wrong[i].settings, "") != SH_EINPUT) fail_msg("%s", wrong[i].settings);
        assert_says(wrong[i].says);
    }
    const char *const sets[] = {"head.profile=sick-lms111", "head.lines_hz=25", "head.prr_hz=36000",
                                "instrument.mirror_index_deg=0.1"};
    assert_int_equal(load_sets(sets, 4), SH_EINPUT);
    assert_says(
        "--set instrument.mirror_index_deg: an error of a mirror, but head profile sick-lms111 has emitter: planar; "
        "allowed with a line head");
}

/* ---- lists of directions */

static int load_list(const char *list)
{
    char text[256];
    write_in("heads/list.txt", list);
    snprintf(text, sizeof text, "emitter: directions\ndirections: list.txt\n");
    /* in place of the beams */
    char *whole = read_source("config/heads/velodyne-vlp16.yaml"), changed[8448];
    const char *from = strstr(whole, "emitter:"), *to = strstr(whole, "lines_min_hz:");
    snprintf(changed, sizeof changed, "%.*s%s%s", (int)(from - whole), whole, text, to);
    write_in("heads/mine.yaml", changed);
    free(whole);
    return load_with_head("mine", "  lines_hz: 10\n", "");
}

static void lists_name_their_line(void **state)
{
    (void)state;
    static const struct {
        const char *list, *says;
    } wrong[] = {
        {"", "list.txt: no direction; allowed 1 to 1000000 rows"},
        {"# nothing\n", "no direction"},
        {"0 1 0\n1 0\n", "list.txt, line 2: a row with 2 numbers; allowed 3, x y z, in each row"},
        {"0 1\n\n1 0 0\n",
         "list.txt, line 3: a row with 3 numbers; allowed 2, azimuth and elevation in degrees, in each row"},
        {"0\n", "list.txt, line 1: a row with 1 number; allowed 3, x y z, or 2,"},
        {"0 1 0 0\n", "list.txt, line 1: not a direction"},
        {"0 one 0\n", "list.txt, line 1: not a direction"},
        {"0 nan 0\n", "list.txt, line 1: not a direction"},
        {"0 0 0\n", "list.txt, line 1: 0 0 0 is no direction"},
        {"0 90.5\n", "list.txt, line 1: an elevation of 90.5 deg; allowed -90 to 90"},
        {"360 0\n-360 0\n1e18 0\n", "list.txt, line 3: an azimuth of 1e+18 deg; allowed -360 to 360"},
    };
    assert_loads(load_list("0 1 0\n 1 0 0 # right\n\n-1\t-1\t-1\r\n"));
    assert_int_equal(cfg->profile.emitter.steps, 3);
    assert_int_equal(cfg->head.settings.prr_uhz, 30000000);
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        if (load_list(wrong[i].list) != SH_EINPUT) fail_msg("%s was taken", wrong[i].list);
        assert_says("heads/mine.yaml:");
        assert_says(": directions: ");
        assert_says(wrong[i].says);
    }
    assert_loads(load_list("0 1 0\n"));
    const char *const sets[] = {"head.line_start_deg=10"};
    assert_int_equal(load_sets(sets, 1), SH_EINPUT);
    assert_says("has a list of directions; allowed without it");
}

/* Limits that doubles don't hold exactly are allowed values. */
static void spheres_go_to_their_limits(void **state)
{
    (void)state;
    static const char own[] =
        "emitter: sphere\nrange_min_m: {value: 0.1, from: assumed}\nrange_max_m: {value: 100, from: assumed}\n"
        "range_sigma_m: {value: 0.01, from: assumed}\nrange_sigma_ppm: {value: 0, from: assumed}\n"
        "wavelength_nm: {value: 903, from: assumed}\nmirror_counts: {value: 0, from: assumed}\n"
        "pan_counts: {value: 0, from: assumed}\nbeam_exit_m: {value: 0.01, from: assumed}\n"
        "beam_divergence_rad: {value: 0.003, from: assumed}\npulse_width_ns: {value: 6, from: assumed}\n"
        "max_echoes: {value: 2, from: assumed}\nboot_s: {value: 0.2, from: assumed}\n"
        "spin_up_s: {value: 0.03, from: assumed}\nspin_down_s: {value: 0.2, from: assumed}\n"
        "lines_min_hz: {value: 1, from: assumed}\nlines_max_hz: {value: 20, from: assumed}\n"
        "maker: A\nmodel: B\nfirmware: \"1\"\nstep_deg: {value: %s, from: assumed}\n";
    static const struct {
        const char *step_deg;
        uint32_t steps; /* 0: refused */
    } cases[] = {{"0.01", 36000}, {"0.009999", 0}, {"90", 4}, {"90.000001", 0}, {"2.2", 164}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char text[2048];
        snprintf(text, sizeof text, own, cases[i].step_deg);
        write_in("heads/mine.yaml", text);
        const int rc = load_edited("any-rate\n" PRR LINES, "mine\n");
        assert_int_equal(rc, cases[i].steps != 0 ? SH_OK : SH_EINPUT);
        if (rc == SH_OK) assert_int_equal(cfg->profile.emitter.steps, cases[i].steps);
    }
}

/* 3600 pulses a ring at a thousand rings a second are allowed; 36000 at no more than 1e7 pulses a second. */
static void the_step_of_a_sphere_is_a_setting(void **state)
{
    (void)state;
    assert_loads(load_with_head("sphere", "", ""));
    assert_int_equal(cfg->profile.emitter.steps, 360);
    assert_loads(load_with_head("sphere", "  step_deg: 0.1\n", ""));
    assert_int_equal(cfg->profile.emitter.steps, 3600);
    assert_int_equal(cfg->profile.emitter.rings, 1801);
    assert_int_equal(cfg->head.settings.prr_uhz, INT64_C(3600000) * 1000000);
    assert_loads(load_with_head("sphere", "  step_deg: 0.01\n", ""));
    assert_int_equal(cfg->head.settings.lines_uhz, 277777777);
    assert_int_equal(cfg->head.settings.prr_uhz, INT64_C(36000) * 277777777);
    assert_loads(
        load_with_head("sphere", "  step_deg: 2.2\n  lines_hz: 20\n  line_start_deg: 350\n  line_stop_deg: 10\n", ""));
    assert_int_equal(cfg->head.settings.prr_uhz, INT64_C(164) * 20000000);
    assert_int_equal(cfg->profile.emitter.rings, 83);
}

/* A bad value gives no other fault, also where it is not in the first item of its list. */
static void a_bad_value_in_a_list_is_one_fault(void **state)
{
    (void)state;
    static const struct wrong wrong[] = {
        {"velodyne-vlp16", "offset_ns: 4608,", "offset_ns: x,", "beams[2].offset_ns", "not a number"},
        {"sick-lms111", "lines_hz: 25, steps_per_turn: 1440", "lines_hz: 25, steps_per_turn: x",
         "geometries[1].steps_per_turn", "not a number"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        check_wrong(&wrong[i]);
        if (diagnostics.n != 1) fail_msg("%s: also %s", wrong[i].key, diagnostics.err[1].text);
    }
}

/* With 10^7 pulses a second, the most that a head has, 300 lines have 33,333 pulses each: steps of 0.0108 deg. */
static void a_step_that_leaves_no_line_rate_is_refused(void **state)
{
    (void)state;
    assert_int_equal(load_changed("sphere", "lines_min_hz: { value: 1,", "lines_min_hz: { value: 300,"), SH_OK);
    assert_int_equal(load_with_head("mine", "  step_deg: 0.01\n", ""), SH_EINPUT);
    assert_int_equal(diagnostics.n, 1);
    assert_says(
        ":3: head.step_deg: 0.01 makes more than 10000000 pulses/s at 300 lines/s, lines_min_hz of head profile "
        "mine; allowed at least 0.0108 deg");
    assert_loads(load_with_head("mine", "  step_deg: 0.0125\n", "")); /* the next that divides 180 deg */
}

/* Checks a line rate, and the steps of a turn at it. */
static void expect_geometry(const char *settings, int lines_hz, uint32_t steps)
{
    assert_loads(load_with_head("sick-lms111", settings, ""));
    assert_int_equal(cfg->head.settings.lines_uhz, lines_hz * INT64_C(1000000));
    assert_int_equal(cfg->head.settings.prr_uhz, lines_hz * INT64_C(1000000) * steps);
    assert_int_equal(cfg->head.settings.step_udeg, 360000000 / steps);
    assert_int_equal(cfg->profile.emitter.steps, steps);
    assert_int_equal(cfg->profile.emitter.last_step, steps * 3 / 4);
    assert_int_equal(cfg->profile.emitter.front_step, steps * 3 / 8);
    assert_int_equal(cfg->profile.fov_max_udeg, 135000000);
}

static void a_planar_head_has_its_geometries(void **state)
{
    (void)state;
    static const char lms[] = "sick-lms111", list[] = "50 Hz at 0.5 deg, 25 Hz at 0.25 deg, 25 Hz at 0.5 deg";
    static const struct wrong wrong[] = {
        {lms, "lines_hz: 50,", "lines_hz: 51,", "geometries[0].lines_hz", "allowed 25 to 50 Hz"},
        {lms, "steps_per_turn: 720,", "steps_per_turn: 700,", "geometries[0].steps_per_turn",
         "700; the head's steps_per_turn (1440) divided"},
        {lms, "steps_per_turn: 720,", "steps_per_turn: 2880,", "geometries[0].steps_per_turn",
         "2880; the head's steps_per_turn (1440) divided"},
        {lms, "front_step: { value: 540,", "front_step: { value: 541,", "geometries[0].steps_per_turn", "front_step"},
        {lms, "lines_hz: 50,", "lines_hz: 25,", "geometries[2].lines_hz", "is given twice"},
        {lms, "emitter: planar", "emitter: flat", "emitter", "allowed line, "},
        {lms, "front_step: { value: 540,", "front_step: { value: x,", "front_step", "not a number"},
        {"velodyne-vlp16", "beams:\n", "geometries: []\nbeams:\n", "geometries", "allowed only with emitter: planar"},
    };
    expect_geometry("", 50, 720); /* the first one: what the device has from the factory */
    expect_geometry("  lines_hz: 25\n", 25, 1440);
    expect_geometry("  step_deg: 0.25\n", 25, 1440);
    expect_geometry("  step_deg: 0.5\n", 50, 720);
    expect_geometry("  lines_hz: 25\n  step_deg: 0.5\n", 25, 720);
    assert_int_equal(load_with_head(lms, "  lines_hz: 50\n  step_deg: 0.25\n", ""), SH_EINPUT);
    assert_says(list);
    assert_int_equal(load_with_head(lms, "  lines_hz: 30\n", ""), SH_EINPUT);
    assert_says(list);
    assert_int_equal(load_with_head(lms, "  ring_start_deg: 0\n", ""), SH_EINPUT);
    assert_says("allowed only with emitter: sphere");
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
        check_wrong(&wrong[i]);
}

/* There is room for 128 beams, and all of them arrive. */
static void the_most_beams(void **state)
{
    (void)state;
    char text[16384], *whole = read_source("config/heads/velodyne-vlp16.yaml");
    for (int n = EMITTER_MAX_BEAMS; n <= EMITTER_MAX_BEAMS + 1; n++) {
        size_t len = (size_t)snprintf(text, sizeof text, "%.*sfiring_ns: {value: 55296, from: assumed}\nbeams:\n",
                                      (int)(strstr(whole, "firing_ns:") - whole), whole);
        for (int i = 0; i < n; i++)
            len += (size_t)snprintf(text + len, sizeof text - len,
                                    "  - {elevation_deg: %d, azimuth_deg: %d, offset_ns: %d, from: assumed}\n",
                                    i % 60 - 30, i % 5, 400 * i);
        snprintf(text + len, sizeof text - len, "%s", strstr(whole, "lines_min_hz:"));
        write_in("heads/mine.yaml", text);
        const int code = load_with_head("mine", "", "");
        if (n > EMITTER_MAX_BEAMS) break;
        assert_loads(code);
        assert_int_equal(cfg->profile.emitter.n_beams, n);
        for (int i = 0; i < n; i++) {
            const struct config_profile_beam *beam = &cfg->profile.arrangement.beam[i];
            assert_true(beam->elevation_udeg == (i % 60 - 30) * 1000000 && beam->azimuth_udeg == i % 5 * 1000000);
            assert_true(beam->offset_ns == (uint32_t)(400 * i));
        }
    }
    free(whole);
    assert_says(": beams: 129 elements are too many; allowed a list of 0 to 128");
}

/* Seen from above, a rotor turns clockwise unless the profile says otherwise. */
static void a_rotor_turns_as_its_profile_says(void **state)
{
    (void)state;
    static const char against[] = "step_direction: { value: counter-clockwise, from: quoted }";
    assert_loads(load_changed("velodyne-vlp16", "emitter: beams", "emitter: beams"));
    assert_int_equal(cfg->profile.emitter.turn, 1);
    assert_loads(load_changed("velodyne-vlp16", "emitter: beams",
                              "emitter: beams\nstep_direction: { value: counter-clockwise, from: quoted }"));
    assert_int_equal(cfg->profile.emitter.turn, -1);
    assert_loads(load_changed("hokuyo-urg-04lx", against, against));
    assert_int_equal(cfg->profile.emitter.turn, -1);
    assert_loads(load_changed("hokuyo-urg-04lx", against, "step_direction: { value: clockwise, from: quoted }"));
    assert_int_equal(cfg->profile.emitter.turn, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rates_and_angles_follow),
        cmocka_unit_test(tables_that_do_not_fit_are_refused),
        cmocka_unit_test(settings_that_do_not_fit_are_refused),
        cmocka_unit_test(lists_name_their_line),
        cmocka_unit_test(spheres_go_to_their_limits),
        cmocka_unit_test(the_step_of_a_sphere_is_a_setting),
        cmocka_unit_test(a_bad_value_in_a_list_is_one_fault),
        cmocka_unit_test(a_step_that_leaves_no_line_rate_is_refused),
        cmocka_unit_test(a_planar_head_has_its_geometries),
        cmocka_unit_test(the_most_beams),
        cmocka_unit_test(a_rotor_turns_as_its_profile_says),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
