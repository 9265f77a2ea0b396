/* SPDX-License-Identifier: MIT */
/* Commands change what a scan is planned by. The scan has the same bytes as if the configuration had these values. The
 * ranges of the scans before and after it stay as they were. A setting of the next scan leaves the scan alone that is
 * still on. */
#include "tests/unit/device_rig.h"

#include "drivers/protocol/crc32c.h"

enum { BOOTED = 300, LONGEST = 2000, EACH = 1000 }; /* ticks; a scan takes at most 600 */

struct scan {
    uint32_t crc;
    uint64_t bytes;
    struct native_descriptor descriptor;
    uint32_t echoes; /* which echoes it was told to keep */
};

/* Sends the commands and scans. Returns its ticks, from SCAN_START to SCAN_END. */
static struct scan scan(struct rig *rig, const char *const *lines)
{
    struct scan scan = {0};
    int in_scan = 0;
    rig_go_to(rig, (rig->next / EACH + 1) * EACH); /* at rest, and at the same time whatever was scanned before */
    for (; *lines != NULL; lines++)
        rig_tell(rig, *lines, rig->next - 1);
    rig_tell(rig, "SCAN:START", rig->next - 1);
    for (int i = 0; i < LONGEST && rig_claim(rig); i++) {
        const struct ring_tick *tick = rig_fill(rig);
        if (rig->work.scanning) {
            if (!in_scan) scan.descriptor = rig->work.descriptor;
            if (!in_scan) scan.echoes = (uint32_t)rig->work.echoes;
            in_scan = 1;
            scan.crc = crc32c(scan.crc, tick->bytes, tick->len);
            scan.bytes += tick->len;
        }
        device_done(&rig->work);
        if (in_scan && rig_event(rig, NATIVE_EV_SCAN_END) != NULL) return scan;
    }
    fail_msg("no end of the scan");
    return scan;
}

static void expect_same(const struct scan *a, const struct scan *b)
{
    assert_true(a->bytes > 10000 && a->bytes == b->bytes && a->crc == b->crc);
    assert_true(a->descriptor.range_min_m == b->descriptor.range_min_m);
    assert_true(a->descriptor.range_max_m == b->descriptor.range_max_m);
}

#define LINES(...) ((const char *const[]){__VA_ARGS__, NULL})
#define SETS(...)  ((const char *const[]){__VA_ARGS__})

static const char *const as_it_was[] = {"*RST", NULL};

/* Scans after these commands. number 2: another scan, without them, comes first. */
static struct scan told(int number, const char *const *sets, int n_sets, const char *const *lines)
{
    struct rig *rig = rig_open(NULL, sets, n_sets);
    rig_go_to(rig, BOOTED);
    if (number > 1) scan(rig, as_it_was);
    struct scan got = scan(rig, lines);
    rig_close(rig);
    return got;
}

static void commands_are_keys(void **state)
{
    (void)state;
    static const struct {
        const char *command[3], *key[3];
    } cases[] = {
        {{"HEAD:RANG:MAX 4.5", "HEAD:RANG:MIN 3.123456789"}, {"head.range_max_m=4.5", "head.range_min_m=3.123456789"}},
        {{"HEAD:NOIS ON", "HEAD:NOIS:SIGM 0.0123"}, {"noise.range=on", "noise.sigma_m=0.0123"}},
        {{"HEAD:NOIS:BALL 0.1", "HEAD:RANG:MAX 6"}, {"noise.ball.radius_m=0.1", "head.range_max_m=6"}},
        {{"SCAN:STEP 0.12", "SCAN:PAN:STOP 10"}, {"head.lines_hz=150", "head.pan_deg_s=18"}},
    };
    static const char *const layouts[] = {"output.layout=polar", "output.layout=geo"};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        for (int k = 0; k < 2; k++) {
            const char *const *c = cases[i].command, *const *key = cases[i].key;
            const char *stop = i == 3 ? "head.pan_stop_deg=10" : "head.frames=1";
            /* Rates change the counts of a first scan, which telemetry reports. */
            const int number = i == 3 ? 1 : 2;
            const struct scan by_commands = told(number, SETS("output.crs=local", layouts[k]), 2, LINES(c[0], c[1]));
            const struct scan by_keys =
                told(number, SETS("output.crs=local", layouts[k], key[0], key[1], stop), 5, as_it_was);
            expect_same(&by_commands, &by_keys);
        }
}

/* Scans in one run change back and forth. Each has its own settings, and its descriptor has its ranges. */
static void each_scan_has_its_own(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, BOOTED);
    const struct scan plain = scan(rig, as_it_was), near = scan(rig, LINES("HEAD:RANG:MAX 4.5"));
    const struct scan again = scan(rig, LINES("HEAD:RANG:MAX 5.5")), back = scan(rig, LINES("HEAD:RANG:MAX 4.5"));
    const struct scan reset = scan(rig, as_it_was);
    rig_close(rig);
    assert_true(plain.descriptor.range_max_m == 100.0 && near.descriptor.range_max_m == 4.5);
    assert_true(again.descriptor.range_max_m == 5.5 && reset.descriptor.range_max_m == 100.0);
    assert_true(near.descriptor.range_min_m == 0.5 && back.bytes == near.bytes);
}

static void a_scan_keeps_the_echoes_that_were_told(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, BOOTED);
    assert_int_equal(scan(rig, LINES("SCAN:ECH LAST")).echoes, BEAM_LAST);
    assert_int_equal(scan(rig, LINES("SCAN:ECH STR")).echoes, BEAM_STRONGEST);
    assert_int_equal(scan(rig, as_it_was).echoes, BEAM_ALL);
    rig_close(rig);
}

/* The tick in which a scan ends has the scan's counts, also where it is no tick of telemetry. */
static void a_scan_ends_with_its_counts(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, BOOTED);
    memset(&rig->work.telemetry_frame, 0, sizeof rig->work.telemetry_frame);
    scan(rig, LINES("SCAN:FRAM 1"));
    const struct native_event *end = rig_event(rig, NATIVE_EV_SCAN_END);
    assert_true(!rig->work.telemetry && end->b > 1000);
    assert_true(rig->work.telemetry_frame.scan_fired == end->b);
    rig_close(rig);
}

/* A limit of the configuration can be undone, up to that of the profile. */
static void ranges_widen_up_to_the_profile(void **state)
{
    (void)state;
    const struct scan wide = told(2, SETS("head.range_max_m=4"), 1, LINES("HEAD:RANG:MAX MAX"));
    const struct scan plain = told(2, NULL, 0, as_it_was);
    expect_same(&wide, &plain);
}

/* The descriptor between scans is that of the last one, whatever was set since. */
static void the_last_scan_is_described_as_it_was(void **state)
{
    (void)state;
    struct device_work work;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, BOOTED);
    scan(rig, LINES("HEAD:RANG:MAX 4.5"));
    rig_go_to(rig, rig->next + 100);
    rig_tell(rig, "HEAD:RANG:MAX 5.5", rig->next - 1);
    rig_tell(rig, "HEAD:RANG:MAX 6.5", rig->next - 1);
    device_describe_now(rig->device, &work);
    assert_true(work.descriptor.range_max_m == 4.5);
    rig_close(rig);
}

/* During a scan these commands are refused. A range that the scale has no room for gives -221, too. */
static void what_can_not_be_is_refused(void **state)
{
    (void)state;
    struct command_result result;
    struct rig *rig = rig_open(NULL, SETS("head.range_max_m=4", "output.scale_m=1e-6", "noise.range=on"), 3);
    rig_go_to(rig, BOOTED);
    device_command(rig->device, 1, "HEAD:NOIS:SIGM 10", rig->next - 1, &result); /* ten sigma: 104 m, which fit */
    assert_int_equal(result.error, 0);
    device_command(rig->device, 1, "HEAD:NOIS:BALL 100", rig->next - 1, &result); /* 204 m fit into 4294 m */
    assert_int_equal(result.error, 0);
    rig_tell(rig, "SCAN:START", rig->next - 1);
    rig_wait(rig, NATIVE_EV_SCAN_START, 100);
    device_command(rig->device, 1, "HEAD:RANG:MAX 3", rig->next - 1, &result);
    assert_int_equal(result.error, CMD_E_SETTINGS);
    assert_non_null(strstr(result.reply, "can't change in state scanning"));
    rig_close(rig);
    rig = rig_open(NULL, SETS("head.range_max_m=4", "noise.ball.distance_1_m=1", "output.scale_m=1e-6"), 3);
    rig_go_to(rig, BOOTED);
    /* 100 (1 + 1 x 100) m of ball at 100 m: more than the 4294.97 m of 32 bits */
    device_command(rig->device, 1, "HEAD:NOIS:BALL 100", rig->next - 1, &result);
    assert_int_equal(result.error, 0); /* at 4 m it is 500 m */
    device_command(rig->device, 1, "HEAD:RANG:MAX 100", rig->next - 1, &result);
    assert_int_equal(result.error, CMD_E_SETTINGS);
    assert_non_null(strstr(result.reply, "output.scale_m"));
    assert_string_equal(rig_tell(rig, "HEAD:RANG:MAX?", rig->next - 1), "4");
    rig_close(rig);
}

/* The first command takes control, and a tick has to bring the event of that. */
static void a_head_settles_after_a_command(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    assert_false(device_settles(rig->device)); /* it boots */
    rig_go_to(rig, BOOTED);
    assert_true(device_is_idle(rig->device) && !device_settles(rig->device));
    rig_tell(rig, "HEAD:RANG:MAX 4.5", rig->next - 1);
    assert_true(!device_is_idle(rig->device) && device_settles(rig->device));
    assert_true(rig_claim(rig));
    assert_non_null(rig_event(rig, NATIVE_EV_CONTROL));
    assert_true(device_is_idle(rig->device) && !device_settles(rig->device));
    rig_tell(rig, "SCAN:START", rig->next - 1);
    assert_false(device_settles(rig->device)); /* it spins up */
    rig_close(rig);
}

/* ---- settings of the next scan that come while a scan is on */

/* 25 lines per second at 0.25 or 0.5 degrees, and 50 at 0.5. */
static struct rig *open_planar(const struct device_options *options)
{
    char path[96];
    snprintf(path, sizeof path, "%s/planar.yaml", folder);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f, "head: {profile: sick-lms111, lines_hz: 25, step_deg: 0.5, frames: 0}\n"
               "scene:\n  meshes: [{file: room.obj, up: z, scale: 1}]\nstations: [{position_m: [0, 0, 0]}]\n");
    assert_int_equal(fclose(f), 0);
    struct rig *rig = rig_open_file("planar.yaml", options, NULL, 0);
    unlink(path);
    return rig;
}

/* The head fires once a step. So the pulse rate is the line rate times the steps of a turn, in the descriptor and in
 * the schedule of the pulses. */
static void expect_descriptor(const struct device_work *work, uint32_t steps)
{
    assert_true(work->describe);
    assert_int_equal(work->emitter.steps, steps);
    assert_int_equal(work->descriptor.lines_uhz, 25000000);
    assert_int_equal(work->descriptor.prr_uhz, 25000000 * (int64_t)steps);
}

static void expect_pulses(const struct device_work *work, uint32_t steps)
{
    const struct schedule_spec *spec = &work->segment.spec;
    assert_true(work->scanning && work->pulse_end > work->pulse0);
    assert_int_equal(spec->emitter->steps, steps);
    assert_int_equal(spec->lines_uhz, 25000000);
    assert_int_equal(spec->prr_uhz, 25000000 * (int64_t)steps);
}

struct stopped {
    const char *step, *line[3];
    int changes; /* the last line changes the stopped scan */
    uint32_t steps, then_steps;
};

/* Scans with a step, and gives the three lines before the last tick. At 18 or 36 pulses per tick, an incomplete packet
 * of 16 is left for that tick 1003 ticks after the scan's start. */
static void stop_a_scan(const struct stopped *row)
{
    char step[32];
    snprintf(step, sizeof step, "SCAN:STEP %s", row->step);
    struct rig *rig = open_planar(NULL);
    rig_go_to(rig, BOOTED);
    rig_tell(rig, step, BOOTED);
    rig_tell(rig, "SCAN:START", BOOTED);
    rig_go_to(rig, BOOTED + 30 + 1003);
    for (int k = 0; k < 3; k++)
        rig_tell(rig, row->line[k], rig->next - 1);
    assert_true(rig_claim(rig));
    assert_non_null(rig_event(rig, NATIVE_EV_SCAN_END));
    assert_int_equal(rig_event(rig, NATIVE_EV_SETTINGS) != NULL, row->changes);
    expect_pulses(&rig->work, row->steps);
    if (row->changes) expect_descriptor(&rig->work, row->steps);
    rig_go_to(rig, 2001); /* at rest the last scan is described again, each full second */
    expect_descriptor(&rig->work, row->steps);
    rig_tell(rig, "SCAN:START", rig->next - 1);
    rig_wait(rig, NATIVE_EV_SCAN_START, 300);
    assert_int_equal(rig->work.emitter.steps, row->then_steps);
    rig_close(rig);
}

/* A new list of faults sets the rates again, also before its fault begins. */
static void a_step_of_the_next_scan_leaves_the_last_pulses_alone(void **state)
{
    (void)state;
    static const struct stopped rows[] = {
        {"0.5", {"SCAN:STOP", "SCAN:STEP 0.25", "*OPC?"}, 0, 720, 1440},
        {"0.5", {"SCAN:STOP", "SCAN:STEP 0.25", "SCAN:FRAMES 1000"}, 1, 720, 1440},
        {"0.5", {"SCAN:STOP", "SCAN:STEP 0.25", "SCAN:ECHOES LAST"}, 1, 720, 1440},
        {"0.5", {"SCAN:STOP", "SCAN:STEP 0.25", "FAUL:ADD {kind: mirror_slow, factor: 0.5}"}, 0, 720, 1440},
        {"0.25", {"SCAN:STOP", "SCAN:STEP 0.5", "HEAD:LINES 50"}, 1, 1440, 720},
        {"0.25", {"*RST", "*OPC?", "SCAN:FRAMES 1000"}, 1, 1440, 720},
        {"0.25", {"*RST", "*OPC?", "FAUL:ADD {kind: mirror_slow, factor: 0.5}"}, 0, 1440, 720},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        stop_a_scan(&rows[i]);
}

/* PROTOCOL.md: between scans the description is that of the last scan, and before the first one that of power-up. What
 * the next scan sends of a pulse comes with the next scan. */
static void a_description_at_rest_is_of_the_last_scan(void **state)
{
    (void)state;
    struct rig *rig = open_planar(NULL);
    rig_go_to(rig, BOOTED);
    rig_tell(rig, "SCAN:ECHOES LAST", BOOTED);
    rig_go_to(rig, 1001);
    assert_true(rig->work.describe && rig->work.emitter.echoes == NATIVE_ECHOES_ALL);
    rig_tell(rig, "SCAN:START", 1000);
    rig_wait(rig, NATIVE_EV_SCAN_START, 300);
    assert_int_equal(rig->work.emitter.echoes, NATIVE_ECHOES_LAST);
    rig_tell(rig, "SCAN:STOP", rig->next);
    rig_wait(rig, NATIVE_EV_SCAN_END, 300);
    rig_tell(rig, "SCAN:ECHOES FIRST", rig->next);
    rig_go_to(rig, 2001);
    assert_true(rig->work.describe && rig->work.describe_flags == NATIVE_REPEAT);
    assert_int_equal(rig->work.emitter.echoes, NATIVE_ECHOES_LAST);
    rig_tell(rig, "SCAN:START", 2000);
    rig_wait(rig, NATIVE_EV_SCAN_START, 300);
    assert_int_equal(rig->work.emitter.echoes, NATIVE_ECHOES_FIRST);
    rig_close(rig);
}

/* A scan from power-up begins at tick 230, in ticks that are claimed ahead. The client still sees the boot, which
 * allows a step of the next scan. */
static void a_step_in_the_boot_leaves_the_claimed_scan_alone(void **state)
{
    (void)state;
    struct rig *rig = open_planar(&(struct device_options){.start = 1});
    rig_go_to(rig, 240);
    assert_true(rig->work.scanning);
    assert_string_equal(rig_state(rig, 190), "boot");
    rig_tell(rig, "SCAN:STEP 0.25", 190);
    assert_true(rig_claim(rig) && !rig->work.describe);
    assert_null(rig_event(rig, NATIVE_EV_SETTINGS));
    rig_tell(rig, "SCAN:ECHOES LAST", 240); /* this one may change within a scan */
    assert_true(rig_claim(rig) && rig->work.echoes == BEAM_LAST);
    assert_non_null(rig_event(rig, NATIVE_EV_SETTINGS));
    expect_descriptor(&rig->work, 720);
    expect_pulses(&rig->work, 720);
    rig_close(rig);
}

/* The descriptor says which echoes are sent. A reset, which has no descriptor, leaves the echoes of the last pulses. */
static void a_reset_leaves_the_last_pulses_their_echoes(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, BOOTED);
    rig_tell(rig, "SCAN:ECHOES LAST", BOOTED);
    rig_tell(rig, "SCAN:START", BOOTED);
    rig_go_to(rig, BOOTED + 100);
    rig_tell(rig, "*RST", rig->next - 1);
    assert_true(rig_claim(rig) && rig->work.scanning && !rig->work.describe);
    assert_int_equal(rig->work.echoes, BEAM_LAST);
    rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(commands_are_keys),
        cmocka_unit_test(each_scan_has_its_own),
        cmocka_unit_test(a_scan_keeps_the_echoes_that_were_told),
        cmocka_unit_test(a_scan_ends_with_its_counts),
        cmocka_unit_test(ranges_widen_up_to_the_profile),
        cmocka_unit_test(the_last_scan_is_described_as_it_was),
        cmocka_unit_test(what_can_not_be_is_refused),
        cmocka_unit_test(a_head_settles_after_a_command),
        cmocka_unit_test(a_step_of_the_next_scan_leaves_the_last_pulses_alone),
        cmocka_unit_test(a_description_at_rest_is_of_the_last_scan),
        cmocka_unit_test(a_step_in_the_boot_leaves_the_claimed_scan_alone),
        cmocka_unit_test(a_reset_leaves_the_last_pulses_their_echoes),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
