/* SPDX-License-Identifier: MIT */
/* A configuration asks for waveforms. The tests check what is refused, the link's rate, and the plan's row. */
#include "tests/wire/room.h"

static const struct room_config SCAN = {.profile = "riegl-vz400i",
                                        .prr_hz = 100000,
                                        .lines_hz = 50,
                                        .pan_deg_s = 150,
                                        .pan_stop_deg = 30,
                                        .frames = 1,
                                        .links = "links: []\n",
                                        .more = "signal: {model: on}\noutput: {attributes: on}\n"};

static void refuse(struct wire *wire, const char *const *sets, const char *says)
{
    char config[352];
    const char *args[16] = {"check", config};
    int n = 2;
    snprintf(config, sizeof config, "%s", room_config_write(wire, &SCAN));
    for (int i = 0; sets[i] != NULL; i++) {
        args[n++] = "--set";
        args[n++] = sets[i];
    }
    args[n] = NULL;
    wire_expect_usage(wire, args, says);
}

/* Some figures are wrong by themselves, which core/waveform knows. config_cases.h has those that contradict each
 * other. */
static void test_refused(void **state)
{
    struct wire *wire = *state;
    room_write(wire);
    wire_write_text(wire, "few.csv", "t_ns,power\n0,1\n1,2\n");
    wire_write_text(wire, "uneven.csv", "t_ns,power\n0,1\n1,2\n2.5,1\n");
    wire_write_text(wire, "dark.csv", "t_ns,power\n0,1\n1,-2\n2,1\n");
    char few[400], uneven[400], dark[400];
    snprintf(few, sizeof few, "waveform.pulse_file=%s", wire_path(wire, "few.csv"));
    snprintf(uneven, sizeof uneven, "waveform.pulse_file=%s", wire_path(wire, "uneven.csv"));
    snprintf(dark, sizeof dark, "waveform.pulse_file=%s", wire_path(wire, "dark.csv"));
    const char *table = "waveform.pulse=table", *send = "waveform.send=on";
    refuse(wire, (const char *const[]){send, table, few, NULL}, "few.csv: 2 lines; allowed are 3 to 1024");
    refuse(wire, (const char *const[]){send, table, uneven, NULL}, "uneven.csv:4: t_ns is 2.5");
    refuse(wire, (const char *const[]){send, table, dark, NULL}, "dark.csv:3: a power of -2");
    refuse(wire, (const char *const[]){send, "waveform.sample_ns=3", NULL},
           "waveform.sample_ns: samples 3 ns apart are too coarse");
    refuse(wire,
           (const char *const[]){send, "waveform.sample_ns=0.7", "waveform.pulse=asymmetric", "waveform.skew=3", NULL},
           "waveform.sample_ns: samples 0.7 ns apart are too coarse");
    refuse(wire,
           (const char *const[]){send, "head.prr_hz=1200000", "waveform.sample_ns=0.05", "waveform.after_ns=90", NULL},
           "waveform.after_ns: windows of");
    refuse(wire,
           (const char *const[]){send, "head.prr_hz=1200000", "waveform.sample_ns=0.05", "waveform.near_m=1",
                                 "waveform.far_m=30", NULL},
           "waveform.far_m: windows of");
}

/* 200 ns at full power, with edges of 1 ns. */
static void write_flat_pulse(struct wire *wire)
{
    char text[4096] = "t_ns,power\n";
    for (int i = 0; i <= 201; i++)
        snprintf(text + strlen(text), sizeof text - strlen(text), "%d,%d\n", i, i > 0 && i < 201);
    wire_write_text(wire, "flat.csv", text);
}

/* A link that can't carry the samples is refused, with the rate of both. 100 kHz of which 100 of 240 deg are used:
 * 41,667 pulses with 20 + 4 bytes for a point and its attributes, and 28 + 2 x 28 for 27 samples and one to fill
 * up: 5 + 10 ns, and 11.8 in which a Gaussian of 4 ns is within 26 dB of its peak. A measured pulse has its own length:
 * its 201 ns make 216 samples, 28 + 2 x 216. */
static void test_capacity(void **state)
{
    struct wire *wire = *state;
    struct room_config scan = SCAN;
    char config[352], file[400];
    room_write(wire);
    write_flat_pulse(wire);
    snprintf(file, sizeof file, "waveform.pulse_file=%s", wire_path(wire, "flat.csv"));
    scan.links = "links: [{type: usb, port: 0, speed: full}]\n";
    snprintf(config, sizeof config, "%s", room_config_write(wire, &scan));
    const char *const args[] = {
        "run",   config, "--duration", "0.01", "--quiet", "--set", "waveform.send=on", "--set", "waveform.pulse=table",
        "--set", file,   NULL};
    for (int is_table = 0; is_table < 2; is_table++) {
        const char *some[12] = {NULL};
        memcpy(some, args, (is_table ? 11 : 7) * sizeof *some);
        assert_int_equal(wire_wait(wire, wire_spawn(wire, some, "out", "err", -1)), 2);
        char *err = wire_read(wire_path(wire, "err"), NULL);
        if (strstr(err, is_table ? "the stream has 20.17 MB/s, the link carries 1.22 MB/s"
                                 : "the stream has 4.50 MB/s, the link carries 1.22 MB/s") == NULL ||
            strstr(err, ", or leave out waveform.send\n") == NULL)
            fail_msg("%s", err);
        free(err);
    }
}

/* A usual return is one of 20 dB, so keep_db says how long its window is. A Gaussian of 4 ns falls by x dB in 4 ns
 * sqrt(x / 12.04): with -40 dB it is above for 17.9 ns, with -6 for 11.8, with 17 for 4. Before it lie 5 ns, behind it
 * 10. The asymmetric pulse works with all other keys left out. With its skew s of 1.5 it is above from -a to b, a = 4
 * ns (1 - s^-q) / (s - 1 / s), b = 4 ns (s^q - 1) / (s - 1 / s), q = sqrt(26 / 3.01): for 14.3 ns. */
static void test_usual(void **state)
{
    struct wire *wire = *state;
    static const struct {
        const char *set, *says;
    } cases[] = {{"waveform.keep_db=-40", "waveforms 33 samples"},
                 {"waveform.keep_db=-6", "waveforms 27 samples"},
                 {"waveform.keep_db=17", "waveforms 19 samples"},
                 {"waveform.pulse=asymmetric", "waveforms 30 samples"}};
    char config[352];
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &SCAN));
    for (int i = 0; i < 4; i++) {
        const char *const args[] = {"check", config, "--set", "waveform.send=on", "--set", cases[i].set, NULL};
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
        char *out = wire_read(wire_path(wire, "out"), NULL);
        if (strstr(out, cases[i].says) == NULL) fail_msg("%s: %s", cases[i].set, out);
        free(out);
    }
}

/* The plan has a row for waveforms. */
static void test_plan_row(void **state)
{
    struct wire *wire = *state;
    static const struct {
        const char *set, *row;
    } cases[] = {{"waveform.send=off", "\"method\": \"none\""},
                 {"waveform.send=on", "\"method\": \"closed form\""},
                 {"beam.mode=rings", "\"method\": \"sub-rays\""}};
    char config[352];
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &SCAN));
    for (int i = 0; i < 3; i++) {
        const char *const args[] = {"plan", config, "--json", "--set", "waveform.send=on", "--set", cases[i].set, NULL};
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
        char *out = wire_read(wire_path(wire, "out"), NULL);
        const char *row = strstr(out, "\"stage\": \"waveform\"");
        assert_non_null(row);
        const char *method = strstr(row, "\"method\"");
        assert_non_null(method);
        if (strncmp(method, cases[i].row, strlen(cases[i].row)) != 0) fail_msg("%.80s", row);
        free(out);
    }
}

/* The figure behind a key of the plan's stage. */
static double figure_of(const char *plan, const char *stage, const char *key)
{
    char name[40];
    snprintf(name, sizeof name, "\"stage\": \"%s\"", stage);
    const char *row = strstr(plan, name);
    if (row == NULL || (row = strstr(row, key)) == NULL) fail_msg("no %s of %s: %s", key, stage, plan);
    return strtod(row + strlen(key), NULL);
}

/* A single ray misses the other surfaces in its footprint: its samples are as wrong as its points. The samples of rings
 * are not. */
static void test_plan_single(void **state)
{
    struct wire *wire = *state;
    char config[352];
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &SCAN));
    for (int single = 0; single < 2; single++) {
        const char *const args[] = {"plan",
                                    config,
                                    "--json",
                                    "--set",
                                    "waveform.send=on",
                                    "--set",
                                    single ? "beam.mode=single" : "beam.mode=rings",
                                    NULL};
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
        char *out = wire_read(wire_path(wire, "out"), NULL);
        const double error_m = figure_of(out, "waveform", "\"error_m\": ");
        if (single) {
            assert_true(error_m > 0.0);
            assert_true(error_m == figure_of(out, "beam", "\"error_m\": "));
        } else {
            assert_true(error_m == 0.0);
        }
        assert_int_equal(strstr(out, "an edge has no second return") != NULL, single);
        free(out);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_refused, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_capacity, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_usual, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_plan_row, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_plan_single, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
