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
    refuse(wire, (const char *const[]){send, "waveform.after_ns=3000", NULL}, "waveform: 5 ns kept before an echo");
    refuse(wire, (const char *const[]){send, "waveform.near_m=1", "waveform.far_m=2000", NULL},
           "a window from 1 to 2000 m");
}

/* A link that can't carry the samples is refused, with the rate of both. 100 kHz of which 100 of 240 deg are used:
 * 41,667 pulses with 20 + 4 bytes for a point and its attributes, and 28 + 2 x 28 for 28 samples, 5 + 3 x 4 + 10 ns
 * and one. */
static void test_capacity(void **state)
{
    struct wire *wire = *state;
    struct room_config scan = SCAN;
    char config[352];
    room_write(wire);
    scan.links = "links: [{type: usb, port: 0, speed: full}]\n";
    snprintf(config, sizeof config, "%s", room_config_write(wire, &scan));
    const char *const args[] = {"run", config, "--duration", "0.01", "--quiet", "--set", "waveform.send=on", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 2);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    if (strstr(err, "the stream has 4.50 MB/s, the link carries 1.22 MB/s") == NULL ||
        strstr(err, ", or leave out waveform.send\n") == NULL)
        fail_msg("%s", err);
    free(err);
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_refused, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_capacity, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_plan_row, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
