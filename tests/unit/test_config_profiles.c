/* SPDX-License-Identifier: MIT */
/* Head profiles: those that come with the program, and refused ones. */
#include "firmware_sim/config/load.h"
#include "firmware_sim/config/reference.h"
#include "tests/unit/config_rig.h"

#include <dirent.h>

static void shipped_files_load(void **state)
{
    (void)state;
    static const char *const heads[] = {"riegl-vz400i",    "riegl-vz600i",       "leica-rtc360",    "riegl-vz2000i",
                                        "leica-p40",       "leica-blk360",       "faro-focus-s350", "zf-imager-5016",
                                        "any-rate",        "hokuyo-urg-04lx",    "hokuyo-utm-30lx", "hokuyo-ust-20lx",
                                        "hokuyo-ust-10lx", "hokuyo-utm-30lx-ew", "sick-tim561",     "sick-tim571",
                                        "sick-tim781",     "sick-lms111",        "velodyne-vlp16",  "full-sweep"};
    assert_loads(load_set("head.profile=full-sweep"));
    for (size_t i = 0; i < sizeof heads / sizeof *heads; i++) {
        static struct config_profile profile;
        assert_int_equal(config_load_profile(heads[i], "config/demo.yaml", &profile, &err), SH_OK);
        assert_string_equal(profile.name, heads[i]);
        assert_true(profile.spin_up_s + cfg->loop.ahead_ms * 1e-3 < 0.1); /* command to beam */
    }
    /* The whole sweep is the field of view, without rounding. */
    assert_true(360.0 / cfg->profile.facets * cfg->profile.optical_gain == 100.0);
    assert_int_equal(cfg->profile.fov_max_udeg - cfg->profile.fov_min_udeg, 100000000);
    static const char *const ready[] = {"config/demo.yaml", "config/vz600i_house.yaml"};
    if (access("/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc", R_OK) != 0) {
        print_message("the house model is not installed: ready configurations not loaded\n");
        return;
    }
    for (size_t i = 0; i < 2; i++)
        assert_loads(config_load(ready[i], NULL, 0, cfg, &err));
}

static void profiles_give_their_figures(void **state)
{
    (void)state;
    assert_loads(load_set("head.profile=leica-rtc360"));
    /* Leica RTC360: 0.5 to 130 m, 300 deg; 1.0 mm + 10 ppm is its accuracy, and none of it is noise */
    const struct config_profile *p = &cfg->profile;
    assert_true(p->range_min_m == 0.5 && p->range_max_m == 130 && p->accuracy_m == 0.001 && p->accuracy_ppm == 10);
    assert_true(p->range_sigma_m < p->accuracy_m && p->range_sigma_ppm == 0.0);
    assert_int_equal(p->fov_max_udeg - p->fov_min_udeg, 300000000);
    assert_string_equal(p->maker, "Leica");
}

static int load_profile(const char *old, const char *with)
{
    return load_changed("leica-rtc360", old, with);
}

#define FARTHEST "{ value: 130, from: quoted, source: \"a reseller's page\" }"
#define SIGMA    "range_sigma_floor_m: { value: 0.00016,"

static void malformed_profiles_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *old, *with, *key, *fragment;
    } wrong[] = {
        {FARTHEST, "130", "range_max_m", "allowed { value: V, from: data sheet }"},
        {FARTHEST, "{ value: 130 }", "range_max_m", "\"from\" is missing"},
        {FARTHEST, "{ from: assumed }", "range_max_m", "\"value\" is missing"},
        {FARTHEST, "{ value: 130, from: hearsay }", "range_max_m", "allowed data sheet, quoted, assumed"},
        {FARTHEST, "{ value: 130, from: [] }", "range_max_m", "allowed data sheet, quoted, assumed"},
        {FARTHEST, "{ value: 130 m, from: assumed }", "range_max_m", "not a number"},
        {FARTHEST, "{ value: 1, value: 2, from: assumed }", "range_max_m", "given twice"},
        {FARTHEST, "{ value: 1, remark: 2, from: assumed }", "range_max_m", "unknown"},
        {FARTHEST, "{ value: 1, from: assumed, definition: FWHM }", "range_max_m", "unknown"},
        {FARTHEST, "{ value: 1, from: assumed, note: }", "range_max_m", "allowed a text in one line"},
        {FARTHEST, "{ value: 1, from: assumed, source: [a] }", "range_max_m", "allowed a text in one line"},
        {"definition: 1/e2,", "definition: 1/e3,", "beam_divergence_rad", "allowed 1/e2, 1/e, FWHM, half angle 1/e2"},
        {"definition: 1/e2 }", "definition: half angle 1/e2 }", "beam_exit_m", "allowed 1/e2, 1/e, FWHM, radius 1/e2"},
        {FARTHEST, "{ value: 0.4, from: assumed }", "range_min_m", "0.5 is too large; allowed below 0.4"},
        {SIGMA, "range_sigma_floor_m: { value: 0.002,", "range_sigma_floor_m", "allowed at most 0.0005"},
        {"range_m: 130, from: assumed", "range_m: 130", "reaches[0].from", "missing"},
        {"range_m: 130, from: assumed", "range_m: 130, from: memory", "reaches[0].from",
         "allowed data sheet, quoted, assumed"},
        {"range_m: 130, from: assumed }",
         "range_m: 130, from: assumed }\n  - { reflectance: 0.2, range_m: 140, from: assumed }", "reaches",
         "must fall at least with the square of the range"},
        {"range_max_m:", "range_mx_m:", "range_mx_m", "did you mean range_max_m?"},
        {"range_max_m: " FARTHEST "\n", "", "range_max_m", "missing"},
        {"facets: { value: 1,", "facets: { value: 2,", "fov_max_deg", "allowed up to 180 deg"},
        {"facets: { value: 1,", "facets: { value: 0,", "facets", "1 to 360"},
        {"optical_gain: { value: 1,", "optical_gain: { value: 2,", "optical_gain", "allowed up to 360"},
        {"beam_divergence_rad: { value: 0.0005,", "beam_divergence_rad: { value: 0.5,", "beam_divergence_rad",
         "0 to 0.01"},
        {"max_echoes: { value: 1,", "max_echoes: { value: 16,", "max_echoes", "1 to 15"},
        {"lines_min_hz: { value: 5,", "lines_min_hz: { value: 0.2,", "lines_min_hz", "allowed 0.25 to"},
        {"lines_min_hz: { value: 5,", "lines_min_hz: { value: 101,", "lines_min_hz", "allowed at most 100"},
        {"prr_min_hz: { value: 10000,", "prr_min_hz: { value: 2000001,", "prr_min_hz", "allowed at most 2000000"},
        {"pan_max_deg: { value: 180,", "pan_max_deg: { value: 0,", "pan_max_deg", "allowed above 0, up to 360"},
        {"fov_min_deg: { value: -60,", "fov_min_deg: { value: 240,", "fov_min_deg", "allowed below 240"},
        {"model: RTC360", "model: a,b", "model", "without comma"},
        {"model: RTC360", "model: { value: RTC360, from: data sheet }", "model", "here stands a section"},
    };
    assert_loads(load_profile("RTC360", "RTC360"));
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        char start[256];
        if (load_profile(wrong[i].old, wrong[i].with) != SH_EINPUT) fail_msg("%s was taken", wrong[i].with);
        place_in_profile(wrong[i].key, start, sizeof start);
        if (strncmp(err.text, start, strlen(start)) != 0) fail_msg("%s: not %s: %s", wrong[i].with, start, err.text);
        assert_says(wrong[i].fragment);
    }
}

static void a_range_beyond_its_bits_is_refused(void **state)
{
    (void)state;
    /* Polar: 2^32 * 1e-6 m = 4294.97 m. Geo, whose coordinates have a sign: 2^31 * 1e-6 m = 2147.48 m. */
    static const struct {
        const char *layout;
        int far_m, fits;
    } cases[] = {{"output.layout=polar", 4294, 1},
                 {"output.layout=polar", 4295, 0},
                 {"output.layout=geo", 2147, 1},
                 {"output.layout=geo", 2148, 0}};
    char *text = edited("any-rate\n  prr_hz: 500000\n  lines_hz: 100", "mine");
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char value[64];
        snprintf(value, sizeof value, "range_max_m: { value: %d,", cases[i].far_m);
        assert_loads(load_profile("range_max_m: { value: 130,", value));
        const char *const sets[] = {"output.scale_m=1e-6", cases[i].layout};
        write_file(config_path, text, strlen(text));
        assert_int_equal(load_sets(sets, 2), cases[i].fits ? SH_OK : SH_EINPUT);
        if (!cases[i].fits) assert_says("--set output.scale_m: 1e-06 is too fine");
    }
    free(text);
}

static void a_slow_pulse_rate_needs_slow_lines(void **state)
{
    (void)state;
    assert_loads(load_profile("prr_min_hz: { value: 10000,", "prr_min_hz: { value: 10,"));
    char *text = edited("any-rate\n  prr_hz: 500000\n  lines_hz: 100", "mine\n  prr_hz: 50\n  lines_hz: 50.000001");
    assert_int_equal(load_text(text), SH_EINPUT);
    assert_says(":3: head.prr_hz: less than a pulse per line");
    free(text);
}

static void profiles_are_looked_up_in_order(void **state)
{
    (void)state;
    char env[256], path[128];
    assert_loads(load_profile("model: RTC360", "model: mine"));
    assert_string_equal(cfg->profile.model, "mine"); /* heads/ beside the configuration */
    snprintf(path, sizeof path, "%s/heads/mine.yaml", dir);
    assert_string_equal(cfg->profile_file, path);
    assert_loads(load_edited("any-rate\n  prr_hz: 500000", "heads/mine.yaml")); /* relative to the file */
    assert_string_equal(cfg->profile.name, "mine");
    assert_int_equal(load_edited("any-rate", "nosuch"), SH_EINPUT);
    assert_says("zf-imager-5016, mine"); /* the list of names is whole */
    snprintf(env, sizeof env, "%s", getenv("SCANHEAD_HEADS"));
    snprintf(path, sizeof path, "%s/first", dir);
    mkdir(path, 0700);
    write_in("first/mine.yaml", "maker: first\n");
    setenv("SCANHEAD_HEADS", path, 1);
    assert_int_equal(load_edited("any-rate", "mine"), SH_EINPUT);
    assert_says("first/mine.yaml:1: model: missing"); /* the variable goes before heads/ */
    setenv("SCANHEAD_HEADS", env, 1);
    write_in("first/.yaml", "maker: nameless\n");
    assert_int_equal(load_edited("any-rate", "first/.yaml"), SH_EINPUT);
    assert_says("the file's name is the name of the profile; allowed 1 to ");
    remove(strcat(path, "/.yaml"));
}

static void an_error_without_profiles_says_where_to_look(void **state)
{
    (void)state;
    static struct config_profile profile;
    char env[256], cwd[512];
    snprintf(env, sizeof env, "%s", getenv("SCANHEAD_HEADS"));
    assert_non_null(getcwd(cwd, sizeof cwd));
    unsetenv("SCANHEAD_HEADS");
    assert_int_equal(chdir("/"), 0);
    config_load_profile("any-rate", NULL, &profile, &err);
    assert_int_equal(chdir(cwd), 0);
    setenv("SCANHEAD_HEADS", env, 1);
    assert_says("no head profile \"any-rate\"; no profiles were found at all; SCANHEAD_HEADS can name their directory");
}

static int is_yaml_file(const struct dirent *entry)
{
    const char *dot = strrchr(entry->d_name, '.');
    return dot != NULL && strcmp(dot, ".yaml") == 0;
}

static int count_profiles(const char *heads)
{
    struct dirent **entries = NULL;
    int n = scandir(heads, &entries, is_yaml_file, NULL);
    for (int i = 0; i < n; i++)
        free(entries[i]);
    free(entries);
    return n;
}

static void profiles_are_listed(void **state)
{
    (void)state;
    char *text = NULL;
    size_t len = 0;
    const int n = count_profiles("config/heads");
    FILE *out = open_memstream(&text, &len);
    assert_int_equal(config_list_profiles("config/heads", out, &err), n);
    fclose(out);
    static const char *const whole[] = {
        "any-rate: scanhead any rate\n"
        "  line       -40 to 60 deg; pan 0 to 360 deg, up to 150 deg/s; 3 to 240 lines/s\n"
        "  beam       exit 7 mm 1/e2, divergence 0.35 mrad 1/e2, 1550 nm\n"
        "  noise      3 mm at 100 m\n"
        "  protocols  native, nmea\n"
        "  pulse rate, kHz      used kHz echoes   nearest  reach\n"
        "  100 to 1200                500     15     1.5 m  800 m on 90 %, 400 m on 20 %\n",
        "\n  planar     1440 steps a turn, 0 to 1080 cast, 540 ahead, counter-clockwise; 25 to 50 lines/s\n",
        "\n  beams      16 beams, 55296 ns a sequence, clockwise; 5 to 20 lines/s\n",
        "\n  sphere     360 pulses a ring, 181 rings; any step by head.step_deg; 1 to 1000 lines/s\n",
    };
    for (size_t i = 0; i < sizeof whole / sizeof *whole; i++)
        if (strstr(text, whole[i]) == NULL) fail_msg("not listed: %s", whole[i]);
    /* A head with programs: each with rate, used rate, echoes, nearest range and reach. */
    const char *head = strstr(text, "\nriegl-vz400i: RIEGL VZ-400i\n");
    assert_non_null(head);
    assert_non_null(
        strstr(head, "\n  600                        250      8     0.5 m  350 m on 90 %, 160 m on 20 %\n"));
    assert_non_null(strstr(head, "\n  data sheet 10: prr_min_hz, prr_max_hz, fov_min_deg,"));
    assert_non_null(strstr(head, "protocols  native, nmea\n"));
    head =
        strstr(text, "\nhokuyo-urg-04lx: Hokuyo URG-04LX\n  planar     1024 steps a turn, 44 to 725 cast, 384 ahead, ");
    assert_non_null(head);
    /* A link may have any protocol of the head's emitter, whoever made the head. */
    assert_non_null(strstr(head, "protocols  native, nmea, scip, cola\n"));
    assert_non_null(strstr(strstr(text, "\nsick-tim561: "), "protocols  native, nmea, scip, cola\n"));
    assert_non_null(strstr(strstr(text, "\nvelodyne-vlp16: "), "\n  beams      16 beams, 55296 ns a sequence"));
    assert_non_null(strstr(strstr(text, "\nvelodyne-vlp16: "), "nmea, velodyne, velodyne-position, velodyne-http\n"));
    /* The maker's figures with their definition, then those at 1/e2; accuracy beside the noise. */
    head = strstr(text, "\nleica-p40: ");
    assert_non_null(head);
    assert_non_null(strstr(head, "exit 3.5 mm FWHM (5.95 mm at 1/e2), divergence 0.23 mrad FWHM (0.391 mrad at 1/e2)"));
    assert_non_null(strstr(head, "\n  noise      0.4 mm at 10 m; accuracy 1.2 mm + 10 ppm, angles 0.0022 deg\n"));
    assert_non_null(strstr(text, "\n  10 to 2000                1667      1     0.5 m  130 m on 90 %\n"));
    for (const char *p = text, *end; *p != '\0'; p = end + 1) {
        end = strchr(p, '\n');
        assert_true(end - p <= 120);
    }
    free(text);
    assert_int_equal(config_list_profiles("/nonexistent", stdout, &err), SH_EINPUT);
    assert_says("/nonexistent");
}

/* Sub-rays need a footprint, and a pulse of 0.1 ns or more: 15 mm of range. A single ray is always allowed. */
static void a_footprint_needs_a_head_that_has_one(void **state)
{
    (void)state;
    static const char exit[] = "beam_exit_m: { value: 0.007,", narrow[] = "beam_divergence_rad: { value: 0.00035,";
    static const struct {
        const char *pulse, *exit, *divergence, *mode, *says; /* says NULL: it is taken */
    } is[] = {
        {"4", "0", "0", "rings", "head profile mine has no footprint; allowed single"},
        {"4", "0", "0", "adaptive", "head profile mine has no footprint; allowed single"},
        {"4", "0", "0", "single", NULL},
        {"4", "0", "0", "auto", NULL},
        {"4", "0.007", "0", "rings", NULL},
        {"4", "0", "0.00035", "rings", NULL},
        {"0.1", "0.007", "0.00035", "rings", NULL},
        {"0.099", "0.007", "0.00035", "single", NULL},
        {"0.099", "0.007", "0.00035", "rings",
         "pulse_width_ns of head profile mine is 0.099: too short to join a footprint's echoes of one surface; allowed "
         "single, or a pulse_width_ns of at least 0.1"},
    };
    char *text = read_source("config/heads/any-rate.yaml"), *parts[3], with[64], beam[64], want[320];
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        snprintf(with, sizeof with, "beam_exit_m: { value: %s,", is[i].exit);
        parts[0] = replaced(text, exit, with);
        snprintf(with, sizeof with, "beam_divergence_rad: { value: %s,", is[i].divergence);
        parts[1] = replaced(parts[0], narrow, with);
        snprintf(with, sizeof with, "pulse_width_ns: { value: %s,", is[i].pulse);
        parts[2] = replaced(parts[1], "pulse_width_ns: { value: 4,", with);
        write_in("heads/mine.yaml", parts[2]);
        for (int k = 0; k < 3; k++)
            free(parts[k]);
        snprintf(beam, sizeof beam, "beam:\n  mode: %s\n%s", is[i].mode,
                 is[i].says != NULL ? "cast: {sight: on}\n" : "");
        const int code = load_with_head("mine", PRR LINES, beam);
        if ((code == SH_OK) != (is[i].says == NULL)) fail_msg("case %zu: %s", i, err.text);
        if (is[i].says == NULL) continue;
        snprintf(want, sizeof want, "%s:17: beam.mode: %s", config_path, is[i].says); /* the line of the key */
        assert_string_equal(err.text, want);
        assert_int_equal(diagnostics.n, 1); /* cast.sight, which rings refuse, follows from it */
    }
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shipped_files_load),
        cmocka_unit_test(profiles_give_their_figures),
        cmocka_unit_test(malformed_profiles_are_refused),
        cmocka_unit_test(a_range_beyond_its_bits_is_refused),
        cmocka_unit_test(a_slow_pulse_rate_needs_slow_lines),
        cmocka_unit_test(a_footprint_needs_a_head_that_has_one),
        cmocka_unit_test(profiles_are_looked_up_in_order),
        cmocka_unit_test(an_error_without_profiles_says_where_to_look),
        cmocka_unit_test(profiles_are_listed),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
