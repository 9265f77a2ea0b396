/* SPDX-License-Identifier: MIT */
/* Programs of head profiles as the configuration reads them: completed values, refusals with their line, widths by
 * their definitions, grades of the profiles that come with the program. */
#include <dirent.h>
#include <math.h>

#include "firmware_sim/config/load.h"
#include "tests/unit/config_rig.h"

/* A profile with programs; each case changes one line. Line 17 is the first program. */
static const char head[] = "maker: M\nmodel: H\n"                          /* 1 */
                           "prr_min_hz: { value: 100000, from: quoted }\n" /* 3 */
                           "prr_max_hz: { value: 400000, from: quoted }\n" /* 4 */
                           "lines_min_hz: { value: 3, from: assumed }\n"   /* 5 */
                           "lines_max_hz: { value: 200, from: assumed }\n" /* 6 */
                           "pan_max_deg_s: { value: 60, from: assumed }\n" /* 7 */
                           "fov_min_deg: { value: -40, from: assumed }\n"  /* 8 */
                           "fov_max_deg: { value: 60, from: assumed }\n"   /* 9 */
                           "pan_min_deg: { value: 0, from: assumed }\n"    /* 10 */
                           "pan_max_deg: { value: 360, from: assumed }\n"  /* 11 */
                           "facets: { value: 3, from: assumed }\n"         /* 12 */
                           "optical_gain: { value: 2, from: assumed }\n"   /* 13 */
                           "range_min_m: { value: 0.5, from: assumed }\n"  /* 14 */
                           "range_max_m: { value: 600, from: assumed }\n"  /* 15 */
                           "programs:\n"                                   /* 16 */
                           "  - prr_hz: { value: 100000, from: data sheet, source: \"a sheet\", note: \"a note\" }\n"
                           "    max_echoes: { value: 7, from: quoted }\n"      /* 18 */
                           "    reach_90_m: { value: 600, from: assumed }\n"   /* 19 */
                           "    reach_20_m: { value: 300, from: quoted }\n"    /* 20 */
                           "    range_min_m: { value: 1.5, from: assumed }\n"  /* 21 */
                           "    used_hz: { value: 42000, from: assumed }\n"    /* 22 */
                           "  - prr_hz: { value: 400000, from: quoted }\n"     /* 23 */
                           "    reach_90_m: { value: 200, from: assumed }\n"   /* 24 */
                           "range_sigma_m: { value: 0.003, from: assumed }\n"  /* 25 */
                           "range_sigma_ppm: { value: 0, from: assumed }\n"    /* 26 */
                           "mirror_counts: { value: 720000, from: assumed }\n" /* 27 */
                           "pan_counts: { value: 720000, from: assumed }\n"    /* 28 */
                           "beam_exit_m: { value: 0.007, from: assumed }\n"    /* 29 */
                           "beam_divergence_rad: { value: 0.0003, from: data sheet }\n"
                           "pulse_width_ns: { value: 4, from: assumed }\n" /* 31 */
                           "max_echoes: { value: 9, from: assumed }\n"     /* 32 */
                           "boot_s: { value: 0.2, from: assumed }\n"       /* 33 */
                           "spin_up_s: { value: 0.03, from: assumed }\n"   /* 34 */
                           "spin_down_s: { value: 0.2, from: assumed }\n"; /* 35 */

static int load_head(const char *old, const char *with, const char *settings)
{
    char *text = replaced(head, old, with);
    write_in("heads/mine.yaml", text);
    free(text);
    return load_with_head("mine", settings, "");
}

static void what_the_file_leaves_out_is_the_heads(void **state)
{
    (void)state;
    assert_loads(load_head("maker", "maker", ""));
    const struct config_profile *p = &cfg->profile;
    const struct config_program *slow = &p->program[0], *fast = &p->program[1];
    assert_int_equal(p->n_programs, 2);
    assert_true(slow->prr_uhz == 100000000000 && slow->max_echoes == 7 && slow->range_min_m == 1.5);
    assert_true(slow->range_max_m == 600.0 && slow->n_reaches == 2 && slow->used_uhz == 42000000000);
    assert_true(slow->reach[0].reflectance == 0.9 && slow->reach[0].range_m == 600.0);
    assert_true(slow->reach[1].reflectance == 0.2 && slow->reach[1].range_m == 300.0);
    assert_true(slow->reach[0].from == FROM_ASSUMED && slow->reach[1].from == FROM_QUOTED);
    assert_true(fast->max_echoes == 9 && fast->range_min_m == 0.5 && fast->range_max_m == 200.0);
    /* 100 of 240 deg of 400 kHz, to half a micro-hertz */
    assert_true(fast->n_reaches == 1 && llabs(fast->used_uhz - 166666666667) <= 1);
    assert_true(cfg->head.settings.prr_uhz == 400000000000); /* the default: the fastest */
    assert_int_equal(config_program_of(p, 100000000000), 0);
    assert_int_equal(config_program_of(p, 400000000000), 1);
    assert_true(config_rate_below(p, 399999999999) == 100000000000);
    assert_true(config_rate_below(p, 400000000000) == 400000000000);
    assert_true(config_rate_below(p, 1) == 100000000000 && config_rate_below(p, INT64_MAX) == 400000000000);
}

/* Programs without reaches of their own have the head's. */
static void reaches_may_be_the_heads(void **state)
{
    (void)state;
    assert_loads(load_head("    reach_90_m: { value: 600, from: assumed }\n"
                           "    reach_20_m: { value: 300, from: quoted }\n"
                           "    range_min_m: { value: 1.5, from: assumed }\n"
                           "    used_hz: { value: 42000, from: assumed }\n"
                           "  - prr_hz: { value: 400000, from: quoted }\n"
                           "    reach_90_m: { value: 200, from: assumed }\n",
                           "  - prr_hz: { value: 400000, from: quoted }\n"
                           "reaches: [{ reflectance: 0.5, range_m: 250, from: quoted }]\n",
                           ""));
    for (int i = 0; i < 2; i++) {
        const struct config_program *p = &cfg->profile.program[i];
        assert_true(p->n_reaches == 1 && p->reach[0].reflectance == 0.5 && p->reach[0].range_m == 250.0);
        assert_true(p->range_max_m == 600.0);
    }
}

static void tables_that_do_not_fit_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *old, *with;
        int line;
        const char *key, *fragment;
    } wrong[] = {
        {"prr_hz: { value: 400000,", "prr_hz: { value: 100000,", 23, "programs[1].prr_hz", "allowed above 100000 Hz"},
        {"prr_hz: { value: 400000,", "prr_hz: { value: 500000,", 23, "programs[1].prr_hz",
         "outside of prr_min_hz and prr_max_hz; allowed 100000 to 400000 Hz"},
        {"prr_hz: { value: 400000,", "prr_hz: { value: 300000,", 4, "prr_max_hz", "allowed 300000, the fastest"},
        {"prr_min_hz: { value: 100000,", "prr_min_hz: { value: 90000,", 3, "prr_min_hz", "allowed 100000, the slowest"},
        {"  - prr_hz: { value: 400000, from: quoted }\n", "  - max_echoes: { value: 2, from: quoted }\n", 23,
         "programs[1].prr_hz", "missing"},
        {"reach_90_m: { value: 600,", "reach_90_m: { value: 601,", 19, "programs[0].reach_90_m",
         "601 m is beyond range_max_m; allowed up to 600 m"},
        {"    reach_90_m: { value: 200, from: assumed }\n", "", 23, "programs[1].reach_90_m",
         "missing; required, since other programs have this key"},
        {"reach_20_m: { value: 300,", "reach_20_m: { value: 600,", 20, "programs[0].reach_20_m", "allowed below 600 m"},
        /* sqrt(0.9 / 0.2) = 2.121: 600 m on 90 % are 283 m on 20 % in clear air, more in haze; 10 % are rounding */
        {"reach_20_m: { value: 300,", "reach_20_m: { value: 265,", 19, "programs[0].reach_90_m",
         "not faster than its square root"},
        {"max_echoes: { value: 7,", "max_echoes: { value: 10,", 18, "programs[0].max_echoes", "allowed up to 9"},
        {"range_min_m: { value: 1.5,", "range_min_m: { value: 0.4,", 21, "programs[0].range_min_m", "at least 0.5"},
        {"range_min_m: { value: 1.5,", "range_min_m: { value: 700,", 21, "programs[0].range_min_m", "below 600 m"},
        /* 100 / 240 of 100 kHz: 41,667 Hz */
        {"used_hz: { value: 42000,", "used_hz: { value: 100000,", 22, "programs[0].used_hz",
         "allowed 40833.4 to 42500 Hz"},
        {"prr_hz: { value: 100000,", "prr_hz: { valu: 100000,", 17, "programs[0].prr_hz", "unknown"},
        {"max_echoes: { value: 7, from: quoted }", "max_echoes: 7", 18, "programs[0].max_echoes",
         "allowed { value: V, from: data sheet }"},
        {"max_echoes: { value: 7, from: quoted }", "max_echos: { value: 7, from: quoted }", 18, "programs[0].max_echos",
         "did you mean programs[0].max_echoes?"},
        {"range_sigma_m:", "reaches: [{ reflectance: 0.9, range_m: 600, from: quoted }]\nrange_sigma_m:", 25, "reaches",
         "allowed one of them"},
        {"lines_min_hz: { value: 3, from: assumed }\nlines_max_hz: { value: 200,",
         "lines_min_hz: { value: 9000, from: assumed }\nlines_max_hz: { value: 200,", 5, "lines_min_hz",
         "allowed at most 200"},
        {"prr_min_hz: { value: 100000, from: quoted }\n"
         "prr_max_hz: { value: 400000, from: quoted }\n",
         "prr_min_hz: { value: 1, from: quoted }\nprr_max_hz: { value: 2, from: quoted }\n", 0, "prr_max_hz",
         "less than a pulse per line; allowed at least 3"},
        {"facets: { value: 3, from: assumed }", "facets: { value: 3, from: assumed }\nemitter: planar", 0, "programs",
         "allowed only with emitter: line"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        char start[160];
        if (load_head(wrong[i].old, wrong[i].with, "") != SH_EINPUT) fail_msg("%s was taken", wrong[i].with);
        snprintf(start, sizeof start, "%s/heads/mine.yaml:%d: %s: ", dir, wrong[i].line, wrong[i].key);
        int found = 0;
        for (uint32_t k = 0; k < diagnostics.n && k < CONFIG_MAX_DIAGNOSTICS; k++)
            found |= (wrong[i].line == 0 || strncmp(diagnostics.err[k].text, start, strlen(start)) == 0) &&
                     strstr(diagnostics.err[k].text, wrong[i].key) != NULL &&
                     strstr(diagnostics.err[k].text, wrong[i].fragment) != NULL;
        if (!found) fail_msg("%s: not \"%s...%s\" but %s", wrong[i].with, start, wrong[i].fragment, err.text);
        if (wrong[i].line != 0 && diagnostics.n != 1) fail_msg("%s: also %s", wrong[i].with, diagnostics.err[1].text);
    }
}

/* The slowest program fires once a line, and not less. */
static void a_slow_program_has_slow_lines(void **state)
{
    (void)state;
    static const char used[] = "    used_hz: { value: 42000, from: assumed }\n";
    for (int rate = 3; rate >= 2; rate--) {
        char min[64], first[64];
        snprintf(min, sizeof min, "prr_min_hz: { value: %d,", rate);
        snprintf(first, sizeof first, "  - prr_hz: { value: %d,", rate);
        char *text = replaced(head, "prr_min_hz: { value: 100000,", min);
        char *second = replaced(text, "  - prr_hz: { value: 100000,", first), *whole = replaced(second, used, "");
        write_in("heads/mine.yaml", whole);
        free(text);
        free(second);
        free(whole);
        const int code = load_with_head("mine", "", "");
        if (rate == 3) {
            assert_loads(code);
            continue;
        }
        assert_int_equal(code, SH_EINPUT);
        assert_says(
            "heads/mine.yaml:17: programs[0].prr_hz: less than a pulse per line; allowed at least 3 Hz, lines_min_hz");
        assert_int_equal(diagnostics.n, 1);
    }
}

/* A head without programs has any rate within its limits. */
static void the_rate_below_any_rate_is_itself(void **state)
{
    (void)state;
    assert_loads(load_text(base));
    const struct config_profile *p = &cfg->profile;
    assert_int_equal(p->n_programs, 0);
    assert_true(config_rate_below(p, 123456789012) == 123456789012);
    assert_true(config_rate_below(p, 100000000000) == 100000000000 &&
                config_rate_below(p, 99999999999) == 100000000000);
    assert_true(config_rate_below(p, 1200000000000) == 1200000000000);
    assert_true(config_rate_below(p, 1200000000001) == 1200000000000);
    assert_int_equal(config_program_of(p, 123456789012), 0);
}

static void programs_without_any_reach_are_refused(void **state)
{
    (void)state;
    char text[8192];
    snprintf(text, sizeof text, "%s", head);
    for (char *at; (at = strstr(text, "    reach_")) != NULL;)
        memmove(at, strchr(at, '\n') + 1, strlen(strchr(at, '\n') + 1) + 1);
    write_in("heads/mine.yaml", text);
    assert_int_equal(load_edited("any-rate\n" PRR LINES, "mine\n"), SH_EINPUT);
    assert_says("heads/mine.yaml:16: programs: no program has a reach; required is reach_90_m in each");
}

static void only_rates_of_programs_are_taken(void **state)
{
    (void)state;
    assert_loads(load_head("maker", "maker", "  prr_hz: 100000\n"));
    static const char *const rates[] = {"100001", "250000", "399999.999999", "99999", "5000000", "1"};
    for (size_t i = 0; i < sizeof rates / sizeof *rates; i++) {
        char setting[64];
        snprintf(setting, sizeof setting, "  prr_hz: %s\n", rates[i]);
        assert_int_equal(load_head("maker", "maker", setting), SH_EINPUT);
        assert_int_equal(diagnostics.n, 1);
        assert_says(":3: head.prr_hz: ");
        assert_says(" is not a pulse rate of head profile mine; allowed 100000, 400000 Hz");
    }
}

/* ---- widths, worked out by hand: sqrt(2) = 1.41421356; sqrt(2 / ln 2) = sqrt(2 / 0.69314718) = 1.69864360 */

static void widths_become_full_ones_at_1_e2(void **state)
{
    (void)state;
    static const struct {
        const char *exit, *divergence;
        double exit_m, divergence_rad;
    } cases[] = {
        {"0.007, from: assumed", "0.0003, from: data sheet", 0.007, 0.0003},
        {"0.007, definition: 1/e2, from: assumed", "0.0003, from: quoted, definition: 1/e2", 0.007, 0.0003},
        /* FARO: 2.12 mm and 0.3 mrad at 1/e are 3.0 mm and 0.42 mrad */
        {"0.00212, from: quoted, definition: 1/e", "0.0003, from: quoted, definition: 1/e", 0.00299813275,
         0.000424264069},
        /* P40: 3.5 mm and 0.23 mrad FWHM are 5.9 mm and 0.39 mrad */
        {"0.0035, from: quoted, definition: FWHM", "0.00023, from: quoted, definition: FWHM", 0.0059452526,
         0.000390688028},
        /* Z+F: 0.3 mrad of half angle are 0.6 mrad */
        {"0.00175, from: quoted, definition: radius 1/e2", "0.0003, from: quoted, definition: half angle 1/e2", 0.0035,
         0.0006},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char with[256];
        snprintf(with, sizeof with, "beam_exit_m: { value: %s }\nbeam_divergence_rad: { value: %s }\n", cases[i].exit,
                 cases[i].divergence);
        assert_loads(load_head("beam_exit_m: { value: 0.007, from: assumed }\n"
                               "beam_divergence_rad: { value: 0.0003, from: data sheet }\n",
                               with, ""));
        const struct config_profile *p = &cfg->profile;
        assert_true(fabs(p->beam_exit_m / cases[i].exit_m - 1.0) < 1e-8); /* nine digits, by hand */
        assert_true(fabs(p->beam_divergence_rad / cases[i].divergence_rad - 1.0) < 1e-8);
    }
}

/* The definitions again, from irradiance alone: at half the given width it has fallen to the definition's share. */
static void irradiance_falls_as_defined(void **state)
{
    (void)state;
    static const struct {
        enum beam_definition definition;
        double given, radius, share; /* radius: of the given figure, where irradiance is that share of the peak */
    } cases[] = {{BEAM_AT_1_E2, 1.0, 0.5, 0.1353352832},
                 {BEAM_AT_1_E, 1.0, 0.5, 0.3678794412},
                 {BEAM_AT_HALF_MAXIMUM, 1.0, 0.5, 0.5},
                 {BEAM_HALF_AT_1_E2, 1.0, 1.0, 0.1353352832}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const double w = 0.5 * cases[i].given * beam_widening(cases[i].definition), r = cases[i].radius;
        assert_true(fabs(exp(-2.0 * r * r / (w * w)) - cases[i].share) < 1e-9);
    }
}

/* ---- the profiles that come with the program */

/* Each maker's figures, and their value at 1/e2, worked out by hand. */
static void shipped_widths_are_the_makers(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        enum beam_definition definition;
        double given_rad, full_rad;
    } cases[] = {{"riegl-vz400i", BEAM_AT_1_E2, 0.35e-3, 0.35e-3},
                 {"riegl-vz2000i", BEAM_AT_1_E2, 0.27e-3, 0.27e-3},
                 {"leica-p40", BEAM_AT_HALF_MAXIMUM, 0.23e-3, 0.391e-3},
                 {"leica-blk360", BEAM_AT_HALF_MAXIMUM, 0.4e-3, 0.679e-3},
                 {"faro-focus-s350", BEAM_AT_1_E, 0.3e-3, 0.424e-3},
                 {"zf-imager-5016", BEAM_HALF_AT_1_E2, 0.3e-3, 0.6e-3}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        static struct config_profile p;
        assert_int_equal(config_load_profile(cases[i].name, NULL, &p, &err), SH_OK);
        assert_true(p.beam_divergence_definition == cases[i].definition);
        assert_true(p.beam_divergence_given_rad == cases[i].given_rad);
        assert_true(fabs(p.beam_divergence_rad - cases[i].full_rad) < 0.5e-6); /* three digits */
    }
}

/* Returns whether the file's first lines give the source of all figures of a grade. */
static int is_said_of_all(const char *text, const char *grade)
{
    char said[32];
    snprintf(said, sizeof said, "\"%s\": ", grade);
    const char *at = strstr(text, said);
    return at != NULL && at < strstr(text, "maker:");
}

static void check_grade(const char *path, const char *text, const char *figure)
{
    static const char *const sourced[] = {"data sheet", "quoted"};
    const char *end = strchr(figure, '}'), *from = strstr(figure, "from: "), *source = strstr(figure, "source: ");
    if (end == NULL || from == NULL || from > end) fail_msg("%s: no grade: %.60s", path, figure);
    for (int i = 0; i < 2; i++)
        if (strncmp(from + strlen("from: "), sourced[i], strlen(sourced[i])) == 0 &&
            !is_said_of_all(text, sourced[i]) && (source == NULL || source > end))
            fail_msg("%s: %s without a source: %.60s", path, sourced[i], figure);
}

/* Every line of a profile that has a value has a grade. A figure of a data sheet, or a quoted one, names its source:
 * beside it, or before the first key for all of its grade. */
static void shipped_figures_have_a_grade(void **state)
{
    (void)state;
    DIR *folder = opendir("config/heads");
    assert_non_null(folder);
    int files = 0;
    for (struct dirent *entry; (entry = readdir(folder)) != NULL;) {
        char path[320], text[16384];
        if (strstr(entry->d_name, ".yaml") == NULL) continue;
        snprintf(path, sizeof path, "config/heads/%s", entry->d_name);
        FILE *file = fopen(path, "rb");
        assert_non_null(file);
        const size_t len = fread(text, 1, sizeof text - 1, file);
        fclose(file);
        assert_true(len < sizeof text - 1);
        text[len] = '\0';
        files++;
        for (const char *at = text; (at = strstr(at, "{ value: ")) != NULL; at++)
            check_grade(path, text, at);
    }
    closedir(folder);
    assert_true(files >= 10);
}

/* Accuracy is shown and never drawn. If a profile has both, the noise is less. */
static void accuracy_is_not_noise(void **state)
{
    (void)state;
    static const char *const names[] = {"riegl-vz400i", "riegl-vz600i", "riegl-vz2000i",   "leica-rtc360",
                                        "leica-p40",    "leica-blk360", "faro-focus-s350", "zf-imager-5016"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        static struct config_profile p;
        assert_int_equal(config_load_profile(names[i], NULL, &p, &err), SH_OK);
        assert_true(p.accuracy_m > 0.0 && p.range_sigma_m < p.accuracy_m);
        assert_true(p.range_sigma_ppm == 0.0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_the_file_leaves_out_is_the_heads),
        cmocka_unit_test(reaches_may_be_the_heads),
        cmocka_unit_test(tables_that_do_not_fit_are_refused),
        cmocka_unit_test(a_slow_program_has_slow_lines),
        cmocka_unit_test(the_rate_below_any_rate_is_itself),
        cmocka_unit_test(programs_without_any_reach_are_refused),
        cmocka_unit_test(only_rates_of_programs_are_taken),
        cmocka_unit_test(widths_become_full_ones_at_1_e2),
        cmocka_unit_test(irradiance_falls_as_defined),
        cmocka_unit_test(shipped_widths_are_the_makers),
        cmocka_unit_test(shipped_figures_have_a_grade),
        cmocka_unit_test(accuracy_is_not_noise),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
