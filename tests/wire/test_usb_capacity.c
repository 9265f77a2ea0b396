/* SPDX-License-Identifier: MIT */
/* A head whose stream is too fast for its USB speed says so at start, with both figures. A head whose stream fits runs.
 *
 * The figures are worked out by hand. A point has 20 bytes (POINTS.md), and full-sweep's mirror (36 facets, gain 10)
 * fires over its whole sweep of 100 deg. USB 2.0 fits 19 bulk packets of 64 bytes into a frame of 1 ms at full speed
 * (table 5-9): 1.216 MB/s. At high speed host controllers reach 10 packets of 512 in a microframe of 125 us: 40.96
 * MB/s. Super speed, some 400 MB/s, carries more than any profile may fire (10 MHz, 200 MB/s). */
#include "tests/wire/room.h"

static void write_config(const struct wire *wire, const char *speed, int prr_hz)
{
    char text[512];
    snprintf(text, sizeof text,
             "head: {profile: full-sweep, prr_hz: %d, lines_hz: 50, pan_deg_s: 100, frames: 1}\n"
             "scene:\n  meshes:\n    - {file: room.obj, up: z, scale: 1}\n"
             "stations:\n  - {position_m: [0, 0, 0]}\n"
             "links: [{type: usb, port: 0, speed: %s}]\n",
             prr_hz, speed);
    wire_write_text(wire, "config.yaml", text);
}

static int run(struct wire *wire, char **err)
{
    char config[352];
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    const char *const args[] = {"run", config, "--duration", "0.01", "--pace", "fast", "--quiet", NULL};
    int status = wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
    *err = wire_read(wire_path(wire, "err"), NULL);
    return status;
}

static void test_capacity(void **state)
{
    static const struct {
        const char *speed;
        int prr_hz;
        const char *stream, *link; /* NULL: it fits */
        int most_hz;
    } cases[] = {
        {"full", 60000, NULL, NULL, 0},
        {"full", 61000, "1.22 MB/s", "1.22 MB/s", 60800},
        {"full", 500000, "10.00 MB/s", "1.22 MB/s", 60800},
        {"high", 2000000, NULL, NULL, 0},
        {"high", 2200000, "44.00 MB/s", "40.96 MB/s", 2048000},
        {"super", 2200000, NULL, NULL, 0},
    };
    struct wire *wire = *state;
    room_write(wire);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char *err, want[128];
        write_config(wire, cases[i].speed, cases[i].prr_hz);
        const int status = run(wire, &err);
        snprintf(want, sizeof want, "the stream has %s, the link carries %s; lower head.prr_hz to %d\n",
                 cases[i].stream, cases[i].link, cases[i].most_hz);
        if (status != (cases[i].stream != NULL ? 2 : 0)) fail_msg("%s: status %d: %s", cases[i].speed, status, err);
        if (cases[i].stream != NULL) {
            if (strstr(err, want) == NULL) fail_msg("%s", err);
            assert_non_null(strstr(err, "usbip:127.0.0.1:"));
            assert_ptr_equal(strchr(err, '\n'), err + strlen(err) - 1); /* one line */
        }
        free(err);
    }
}

/* A sphere of 0.1 deg steps, 1,000 rings a second, is 3.6 MHz. The steps from 350 to 10 deg are sent: 200,000 points, 4
 * MB a second. */
static void test_across_azimuth_0(void **state)
{
    struct wire *wire = *state;
    char *err;
    room_write(wire);
    wire_write_text(wire, "config.yaml",
                    "head: {profile: sphere, step_deg: 0.1, lines_hz: 1000, line_start_deg: 350, line_stop_deg: 10}\n"
                    "scene:\n  meshes:\n    - {file: room.obj, up: z, scale: 1}\n"
                    "stations:\n  - {position_m: [0, 0, 0]}\n"
                    "links: [{type: usb, port: 0, speed: full}]\n");
    assert_int_equal(run(wire, &err), 2);
    if (strstr(err, "the stream has 4.00 MB/s, the link carries 1.22 MB/s; lower head.lines_hz to 304\n") == NULL)
        fail_msg("%s", err);
    free(err);
}

/* A VLP-16 has one pulse rate: 16 in 55.296 us, 5.79 MB a second. Lowering it is no advice. */
static void test_one_rate(void **state)
{
    struct wire *wire = *state;
    char *err;
    room_write(wire);
    wire_write_text(wire, "config.yaml",
                    "head: {profile: velodyne-vlp16}\nscene:\n  meshes:\n    - {file: room.obj, up: z, scale: 1}\n"
                    "stations:\n  - {position_m: [0, 0, 0]}\nlinks: [{type: usb, port: 0, speed: full}]\n");
    assert_int_equal(run(wire, &err), 2);
    if (strstr(err, "the stream has 5.79 MB/s, the link carries 1.22 MB/s; no rate of the head is low enough; allowed "
                    "is a faster link\n") == NULL)
        fail_msg("%s", err);
    free(err);
}

/* The allowed share of the speed has two digits, however small it is. 60 kHz are 1.2 MB/s, so 0.0011 of 900 times
 * that speed are allowed. */
static void test_fast_recording(void **state)
{
    struct wire *wire = *state;
    char config[352], file[352];
    room_write(wire);
    write_config(wire, "high", 60000);
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(file, sizeof file, "%s", wire_path(wire, "a.shs"));
    const char *const record[] = {"record", config, "--duration", "0.02", "-o", file, "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, record, "out", "err", -1)), 0);
    const char *const run_it[] = {"run",     file,  "--link",  "type: usb, port: 0, speed: full",
                                  "--speed", "900", "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, run_it, "out", "err", -1)), 2);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    if (strstr(err, "allowed is 0.0011 times this speed") == NULL) fail_msg("%s", err);
    free(err);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_capacity, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_across_azimuth_0, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_one_rate, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_fast_recording, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
