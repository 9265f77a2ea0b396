/* SPDX-License-Identifier: MIT */
/* Faults of the beam with other heads, other ways to cast and other paces. The faults hit the same pulses and give the
 * same bytes. */
#include "tests/wire/beam_run.h"
#include "tests/wire/emitter_rig.h"

static const double RAD = M_PI / 180.0;

/* All kinds at once, overlapping. None of them begins at a whole packet or tick. */
static const char ALL[] = "  - {kind: mirror_slow, factor: 0.37, from_pulse: 1003, until_pulse: 3008}\n"
                          "  - {kind: mirror_slow, factor: 1.7, from_pulse: 2500, until_pulse: 3500}\n"
                          "  - {kind: mirror_stuck, from_pulse: 2000, until_pulse: 2222}\n"
                          "  - {kind: mirror_wobble, deg: 3, hz: 21, from_pulse: 1900, until_pulse: 5001}\n"
                          "  - {kind: mirror_wobble, deg: -1, hz: 77, from_pulse: 2100, until_pulse: 4001}\n"
                          "  - {kind: pan_slip, deg: -2, from_pulse: 4321}\n"
                          "  - {kind: laser_off, from_pulse: 6001, until_pulse: 6077}\n"
                          "  - {kind: window_soiled, loss_db: 2, from_pulse: 5555, until_pulse: 7001}\n";

static double angle_between(double a, double b)
{
    return fabs(remainder(a - b, 2.0 * M_PI));
}

/* ---- the same bytes */

static void keep_truth(const struct beam_run *run, char *text, size_t len)
{
    size_t used = 0;
    text[0] = '\0';
    for (uint32_t i = 0; i < run->notes && used < len; i++)
        used += (size_t)snprintf(text + used, len - used, "%s %" PRIu64 " %d\n", run->note[i].kind, run->note[i].pulse,
                                 run->note[i].ended);
}

static void run_live(struct wire *wire, const char *config, const char *pace, const char *threads, char hash[65])
{
    char truth[352];
    snprintf(truth, sizeof truth, "%s", wire_path(wire, "live.json"));
    const char *const more[] = {"--pace", pace,    "--threads",      threads, "--truth",
                                truth,    "--set", "noise.range=on", NULL};
    struct head head = head_start(wire, config, more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    scanhead_hash_start(sh);
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_hash_hex(sh, hash);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    assert_int_equal(stats_uint(wire, "lost_pulses"), 0);
}

static void any_pace_and_threads_give_the_same_bytes(void **state)
{
    static const char *const one[] = {"noise.range=on", "loop.threads=1", NULL};
    static const char *const two[] = {"noise.range=on", "loop.threads=2", NULL};
    struct wire *wire = *state;
    static char truth[2048], other[2048];
    char hash[65], live[65], config[352];
    const struct beam_run *run = beam_record(wire, 0, ALL, one);
    keep_truth(run, truth, sizeof truth);
    strcpy(hash, run->sha256);
    assert_int_equal(run->notes, 16);
    run = beam_record(wire, 1, ALL, two);
    keep_truth(run, other, sizeof other);
    assert_string_equal(run->sha256, hash);
    assert_string_equal(other, truth);
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    static const char *const how[][2] = {{"fast", "1"}, {"fast", "2"}, {"realtime", "2"}};
    for (int i = 0; i < 3; i++) {
        run_live(wire, config, how[i][0], how[i][1], live);
        if (strcmp(live, hash) != 0) fail_msg("%s, %s threads: another stream", how[i][0], how[i][1]);
        run = beam_read(wire, 1, "run.shs", "live.json");
        keep_truth(run, other, sizeof other);
        assert_string_equal(other, truth);
    }
}

/* A fault whose pulses never come changes nothing, and the truth does not have it. */
static void a_fault_that_is_not_due_changes_nothing(void **state)
{
    char hash[65];
    strcpy(hash, beam_record(*state, 0, NULL, NULL)->sha256);
    const struct beam_run *run = beam_record(*state, 0,
                                             "  - {kind: laser_off, from_pulse: 8000}\n"
                                             "  - {kind: mirror_slow, from_s: 1000}\n"
                                             "  - {kind: pan_slip, from_pulse: 10, until_pulse: 20, from_s: 1000}\n",
                                             NULL);
    assert_int_equal(run->notes, 0);
    assert_string_equal(run->sha256, hash);
}

static void record_hash(struct wire *wire, const char *const *sets, const char *threads, char hash[65])
{
    const char *args[WIRE_MAX_ARGS] = {"record"};
    char config[352], stats[352];
    int n = 1;
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    const char *const fixed[] = {config, "--stats", stats, "--quiet", "--threads", threads, "--set", "noise.range=on"};
    for (size_t i = 0; i < sizeof fixed / sizeof fixed[0]; i++)
        args[n++] = fixed[i];
    for (; *sets != NULL; sets++) {
        args[n++] = "--set";
        args[n++] = *sets;
    }
    wire_run(wire, args, 0);
    stats_hash(wire, hash);
}

/* With a visibility map the hits are the same as without. Footprints and the geo layout are the same with any number of
 * threads. */
static void ways_to_cast_agree(void **state)
{
    static const char *const noisy[] = {"noise.range=on", NULL};
    static const char *const ways[][3] = {{"cast.sight=on", NULL},
                                          {"cast.sight=off", NULL},
                                          {"beam.mode=rings", NULL},
                                          {"beam.mode=adaptive", NULL},
                                          {"output.layout=geo", "output.crs=local", NULL}};
    struct wire *wire = *state;
    char one[5][65], two[65];
    beam_record(wire, 0, ALL, noisy);
    for (int i = 0; i < 5; i++) {
        record_hash(wire, ways[i], "1", one[i]);
        record_hash(wire, ways[i], "2", two);
        assert_string_equal(one[i], two);
    }
    assert_string_equal(one[0], one[1]);
    assert_string_not_equal(one[1], one[2]);
}

/* ---- other heads */

static const struct room_config VLP = {.profile = "velodyne-vlp16",
                                       .prr_hz = 289351.851852,
                                       .lines_hz = 10,
                                       .frames = 2,
                                       .links = "links: []\n",
                                       .more = "output: {scale_m: 1e-6}\n"};

/* The rotor of a VLP-16 is slow, stuck, or wobbles from pulse 10000 to 29999 (sequences 625 to 1874). Firings keep
 * their times. Half a count of 2^-32 turns is 8e-10 rad; a change of speed keeps the phase to 2^-40. */
static double rotor_rad(const char *kind, uint64_t k)
{
    struct shot s, begin, end;
    shot_vlp(k, &s);
    shot_vlp(10000, &begin);
    shot_vlp(30000, &end);
    const double per_ns = 2.0 * M_PI / 1e8, t = (double)s.t_ns, b = (double)begin.t_ns, e = (double)end.t_ns;
    const int inside = k >= 10000 && k < 30000;
    if (strcmp(kind, "mirror_slow") == 0)
        return per_ns * (k < 10000 ? t : inside ? b + 0.25 * (t - b) : b + 0.25 * (e - b) + (t - e));
    if (!inside) return per_ns * t;
    if (strcmp(kind, "mirror_stuck") == 0) return per_ns * b;
    return per_ns * t + 1.5 * RAD * sin(2.0 * M_PI * 12.0 * 1e-9 * (t - b));
}

static void check_rotor(struct wire *wire, const char *kind, const char *keys)
{
    char faults[160];
    snprintf(faults, sizeof faults, "  - {kind: %s, %sfrom_pulse: 10000, until_pulse: 29999}\n", kind, keys);
    const struct beam_run *run = beam_record_room(wire, 0, &VLP, faults, NULL);
    assert_int_equal(beam_note(run, kind, 0, 0)->pulse, 10000);
    assert_int_equal(beam_note(run, kind, 0, 1)->pulse, 30000);
    assert_true(run->info.lines_hz == 10.0);
    assert_true(run->pulses > 57000);
    for (uint64_t k = 0; k < run->pulses; k++) {
        const struct beam_shot *shot = &run->shot[k];
        struct shot s;
        struct room_ray ray;
        shot_vlp(k, &s);
        if (angle_between(shot->pan_rad, rotor_rad(kind, k)) > ANGLE_RAD)
            fail_msg("%s: pulse %" PRIu64 ": %.9f deg", kind, k, shot->pan_rad / RAD);
        assert_true(angle_between(shot->mirror_rad, RAD * s.elevation_deg) <= ANGLE_RAD);
        assert_int_equal(shot->t_ns, s.t_ns);
        room_cast(shot->mirror_rad, shot->pan_rad, &ray);
        assert_true(fabs(shot->range_m - ray.range_m) < 1e-5);
    }
    for (uint32_t i = 0; i < run->lines; i++) { /* a turn's end has the angle of its last point */
        const struct scanhead_line_end *line = &run->line[i];
        const struct beam_shot *last = &run->shot[line->pulse0 + line->n_fired - 1];
        assert_true(angle_between(last->pan_rad, 2.0 * M_PI * 0x1p-32 * line->pan_count) <= ANGLE_RAD);
        assert_true(angle_between(last->mirror_rad, 2.0 * M_PI * 0x1p-32 * line->mirror_count) <= ANGLE_RAD);
    }
}

static void a_rotor_may_be_slow_stuck_or_wobble(void **state)
{
    check_rotor(*state, "mirror_slow", "factor: 0.25, ");
    check_rotor(*state, "mirror_stuck", "");
    check_rotor(*state, "mirror_wobble", "deg: 1.5, hz: 12, ");
}

/* A planar head fires at steps of its mirror. A slow mirror makes it fire slowly, and a turn has as many pulses. */
static void a_planar_head_fires_as_slowly_as_it_turns(void **state)
{
    static const struct room_config UTM = {.profile = "hokuyo-utm-30lx",
                                           .prr_hz = 57600,
                                           .lines_hz = 40,
                                           .frames = 20,
                                           .links = "links: []\n",
                                           .more = "output: {scale_m: 1e-6}\n"};
    const struct beam_run *run = beam_record_room(
        *state, 0, &UTM, "  - {kind: mirror_slow, factor: 0.5, from_pulse: 4320, until_pulse: 10079}\n", NULL);
    assert_int_equal(beam_note(run, "mirror_slow", 0, 0)->pulse, 4320);
    assert_int_equal(beam_note(run, "mirror_slow", 0, 1)->pulse, 10080);
    assert_true(run->info.prr_hz == 57600.0 && run->info.lines_hz == 40.0);
    assert_int_equal(run->lines, 20);
    for (uint32_t i = 0; i < run->lines; i++) {
        const struct scanhead_line_end *line = &run->line[i];
        const int64_t want_ns = i >= 3 && i < 7 ? 50000000 : 25000000; /* a turn; times are cut to whole ns */
        assert_int_equal(line->n_fired, 1440);
        if (llabs(line->t1_ns - line->t0_ns - want_ns) > 1) fail_msg("line %u", i);
    }
    for (uint64_t k = 0; k < run->pulses; k++) {
        struct shot s;
        shot_utm(k, &s);
        assert_int_equal(run->shot[k].is_there, s.cast);
        if (s.cast) assert_true(angle_between(run->shot[k].pan_rad, RAD * s.azimuth_deg) <= ANGLE_RAD);
    }
}

/* ---- commands */

static uint32_t dark_shots(struct scanhead *sh)
{
    struct scanhead_frame frame = {0};
    struct scanhead_point point[256];
    uint32_t dark = 0;
    client_tell(sh, "SCAN:STAR");
    while (!is_event(&frame, SCANHEAD_EV_SCAN_END)) {
        client_next(sh, &frame);
        for (uint32_t first = 0; frame.type == SCANHEAD_POINTS && first < frame.n_points; first += 256) {
            const int got = scanhead_points(sh, &frame, first, point, 256);
            for (int i = 0; i < got; i++) {
                const uint64_t k = frame.pulse0 + first + (uint32_t)i;
                if (point[i].echo_count != 0) continue;
                assert_in_range(k, 1500, 2600);
                dark++;
            }
        }
    }
    client_wait_state(sh, "idle");
    return dark;
}

static void commands_add_and_clear(void **state)
{
    struct wire *wire = *state;
    char truth[352];
    beam_record(wire, 0, NULL, NULL); /* writes the configuration */
    snprintf(truth, sizeof truth, "%s", wire_path(wire, "live.json"));
    const char *const more[] = {"--pace", "fast", "--truth", truth, NULL};
    struct head head = head_start(wire, wire_path(wire, "config.yaml"), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    assert_string_equal(client_ask(sh, "FAULt:ADD {kind: laser_off, from_pulse: 1500, until_pulse: 2600}"), "1");
    assert_int_equal(dark_shots(sh), 1101);
    assert_int_equal(dark_shots(sh), 1101);
    assert_string_equal(client_ask(sh, "FAULt:INJected? 1"), "2");
    client_tell(sh, "FAULt:CLEar ALL");
    assert_int_equal(dark_shots(sh), 0);
    const char *refused = client_ask(sh, "FAULt:ADD {kind: window_soiled}");
    assert_non_null(strstr(refused, "window_soiled would have no effect"));
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    const struct beam_run *run = beam_read(wire, 0, "run.shs", "live.json");
    assert_int_equal(run->notes, 4);
    for (int i = 0; i < 4; i++)
        assert_int_equal(run->note[i].pulse, i % 2 == 0 ? 1500 : 2601);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_pace_and_threads_give_the_same_bytes),
        cmocka_unit_test(a_fault_that_is_not_due_changes_nothing),
        cmocka_unit_test(ways_to_cast_agree),
        cmocka_unit_test(a_rotor_may_be_slow_stuck_or_wobble),
        cmocka_unit_test(a_planar_head_fires_as_slowly_as_it_turns),
        cmocka_unit_test(commands_add_and_clear),
    };
    return cmocka_run_group_tests(tests, wire_setup, wire_teardown);
}
