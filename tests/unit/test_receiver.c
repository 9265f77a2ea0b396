/* SPDX-License-Identifier: MIT */
/* A VLP-16 that follows a GNSS receiver: pulses and sentences that are missing, late or wrong, tick by tick, and what
 * they do to its state, its time since the top of the hour and its sentences. Power comes at 00:59:57.5, so that full
 * seconds lie at device times 0.5, 1.5 and so on, and the hour is full at 2.5 s. */
#include <math.h>

#include "tests/unit/device_rig.h"

enum { TICK_NS = 1000000 };
static const int64_t SECOND_NS = 1000000000;

static int make_vlp16(void **state)
{
    char path[96];
    if (make_folder(state) != 0) return -1;
    snprintf(path, sizeof path, "%s/run.yaml", folder);
    FILE *f = fopen(path, "w");
    if (f == NULL) return -1;
    fprintf(f, "head: {profile: velodyne-vlp16, lines_hz: 10, frames: 0}\n"
               "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
               "stations: [{position_m: [0, 0, 0], lat_deg: 48.1, lon_deg: 11.5, height_m: 500}]\n"
               "links: [{type: null, protocol: velodyne-position}]\n"
               "time: {epoch: 2026-01-01T00:59:57.5Z}\n");
    return fclose(f);
}

static struct rig *open_with(const char *const *sets, int n_sets)
{
    static const struct device_options start = {.start = 1};
    return rig_open(&start, sets, n_sets);
}

/* At a device time: the state, and the time since the top of the hour. */
struct moment {
    double t_s;
    int state; /* enum protocol_pps */
    double hour_s;
};

static void expect(struct rig *rig, const struct moment *m)
{
    int64_t hour_ns, want_ns = llround(1e9 * m->hour_s);
    const int64_t t_ns = llround(1e9 * m->t_s);
    rig_go_to(rig, (uint64_t)(t_ns / TICK_NS) + 1);
    const int state = (int)device_pps(rig->device, t_ns, &hour_ns);
    if (state != m->state || hour_ns != want_ns)
        fail_msg("at %.6f s: state %d, %.9f s; not %d, %.9f s", m->t_s, state, 1e-9 * (double)hour_ns, m->state,
                 m->hour_s);
}

enum {
    ABSENT = PROTOCOL_PPS_ABSENT,
    SYNC = PROTOCOL_PPS_SYNCHRONISING,
    LOCKED = PROTOCOL_PPS_LOCKED,
    ERROR = PROTOCOL_PPS_ERROR
};

/* The columns: settings, ended by NULL; moments, ended by a time of 0. Times are worked out by hand: UTC is device time
 * + 3597.5 s, and a device that was never set counts device time. */
static void follows_what_comes(void **state)
{
    (void)state;
    static const struct {
        const char *sets[8];
        struct moment moment[8];
    } cases[] = {
        {{NULL}, {{0.4, SYNC, 3597.9}, {2.4, SYNC, 3599.9}, {2.5, LOCKED, 0}, {3.7, LOCKED, 1.2}}},
        /* Neither came before power-up: from the third pulse on it has the time. */
        {{"gnss.cold=on", NULL}, {{0.4, SYNC, 0.4}, {2.4, SYNC, 2.4}, {2.5, LOCKED, 0}, {3.7, LOCKED, 1.2}}},
        /* Sentences without pulses. */
        {{"gnss.pps=off", NULL}, {{0.4, ABSENT, 0.4}, {4.4, ABSENT, 4.4}}},
        /* Pulses without sentences: full seconds are full, and count from power-up. */
        {{"gnss.nmea=off", NULL}, {{2.4, SYNC, 2.4}, {2.5, LOCKED, 3}, {3.7, LOCKED, 4.2}}},
        /* The pulses of 3.5 and 4.5 s are lost: absent, and relocked after three more. The time goes on. */
        {{"faults[0].kind=pps_lost", "faults[0].from_s=3.2", "faults[0].until_s=5.2", NULL},
         {{3.4, LOCKED, 0.9}, {3.502, ABSENT, 1.002}, {5.5, SYNC, 3}, {7.4, SYNC, 4.9}, {7.5, LOCKED, 5}}},
        /* The first pulse is 5 ms late, and every second one after it: none agrees with the one before. */
        {{"faults[0].kind=pps_jitter", "faults[0].for_ms=5", "faults[0].from_s=3", "faults[0].until_s=6", NULL},
         {{3.4, LOCKED, 0.9},
          {3.502, ABSENT, 1.002},
          {3.6, ERROR, 1.1},
          {4.6, ERROR, 2.1},
          {6.6, ERROR, 4.1},
          {7.6, SYNC, 5.1},
          {8.6, LOCKED, 6.1}}},
        /* The pulse is 0.5 ms late, and taken for the second. */
        {{"faults[0].kind=pps_jitter", "faults[0].for_ms=0.5", "faults[0].from_s=3", NULL},
         {{3.5, LOCKED, 1}, {3.6, LOCKED, 1.0995}, {4.6, LOCKED, 2.1}}},
        /* A sentence that comes after the next pulse names the second before it, so the time is a second behind. */
        {{"faults[0].kind=nmea_late", "faults[0].for_ms=1200", "faults[0].from_s=3", "faults[0].until_s=6", NULL},
         {{4.4, LOCKED, 1.9},
          {4.6, LOCKED, 2.1},
          {4.7, LOCKED, 1.2},
          {5.6, LOCKED, 2.1},
          {6.4, LOCKED, 2.9},
          {7.6, LOCKED, 5.1}}},
        {{"gnss.nmea_late_ms=300", "gnss.cold=on", NULL}, {{2.6, LOCKED, 3.1}, {2.8, LOCKED, 0.3}, {3.6, LOCKED, 1.1}}},
        /* Sentences are missing, wrong or void at first; void ones do no harm. */
        {{"gnss.cold=on", "faults[0].kind=nmea_lost", "faults[0].until_s=4", NULL},
         {{3.6, LOCKED, 4.1}, {4.4, LOCKED, 4.9}, {4.6, LOCKED, 2.1}}},
        {{"gnss.cold=on", "faults[0].kind=nmea_checksum", "faults[0].until_s=4", NULL},
         {{3.6, LOCKED, 4.1}, {4.4, LOCKED, 4.9}, {4.6, LOCKED, 2.1}}},
        {{"gnss.cold=on", "faults[0].kind=nmea_void", NULL}, {{2.4, SYNC, 2.4}, {2.6, LOCKED, 0.1}}},
        /* The head's own clock gains 400 ppm: 0.4 ms a second, that a locked pulse takes back. */
        {{"time.drift_ppm=400", "faults[0].kind=pps_lost", "faults[0].from_s=5", NULL},
         {{2.4, SYNC, 3599.90096}, {2.5, LOCKED, 0}, {3.25, LOCKED, 0.7503}, {3.5, LOCKED, 1}, {10.5, ABSENT, 8.0024}}},
        /* The clock jumps by 0.3 s. Three pulses later all is well again. */
        {{"faults[0].kind=clock_jump", "faults[0].jump_s=0.3", "faults[0].from_s=3", NULL},
         {{3.2, LOCKED, 1}, {3.6, ERROR, 1.4}, {4.6, SYNC, 2.4}, {5.6, LOCKED, 3.1}}},
        /* A second 60 that no table has comes at 2.5 s: 00:59:60 is 0 s, and so is 01:00:00 after it. */
        {{"faults[0].kind=leap_second", "faults[0].from_s=1", NULL},
         {{2.4, SYNC, 3599.9}, {2.6, LOCKED, 0.1}, {3.4, LOCKED, 0.9}, {3.5, LOCKED, 0}, {4.6, LOCKED, 1.1}}},
        {{"time.epoch=none", NULL}, {{0.4, ABSENT, 0.4}, {4.4, ABSENT, 4.4}}},
        /* Power comes back at 3.3 s, and the device knows nothing. */
        {{"faults[0].kind=power_cycle", "faults[0].from_s=3", "faults[0].for_ms=300", NULL},
         {{3.4, SYNC, 0.1}, {5.4, SYNC, 2.1}, {5.6, LOCKED, 3.1}}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        int n = 0;
        while (cases[i].sets[n] != NULL)
            n++;
        print_message("%s\n", n > 0 ? cases[i].sets[n - 1] : "as it is");
        struct rig *rig = open_with(cases[i].sets, n);
        for (const struct moment *m = cases[i].moment; m->t_s > 0.0; m++)
            expect(rig, m);
        rig_close(rig);
    }
}

static int second_at(struct rig *rig, double t_s, struct nmea_fix *fix)
{
    const int64_t t_ns = llround(1e9 * t_s);
    rig_go_to(rig, (uint64_t)(t_ns / TICK_NS) + 1);
    return device_fix(rig->device, t_ns, fix) ? fix->minute * 60 + fix->second : -1;
}

/* Sentences name second n at device time n + 2.5 - 3600. The link of a receiver sends each one as it arrives. */
static void sentences_go_wrong(void **state)
{
    (void)state;
    static const char *const sets[] = {"faults[0].kind=nmea_lost",     "faults[0].from_s=2",   "faults[0].until_s=4",
                                       "faults[1].kind=nmea_void",     "faults[1].from_s=5",   "faults[1].until_s=6",
                                       "faults[2].kind=nmea_checksum", "faults[2].from_s=5.2", "faults[2].until_s=7",
                                       "faults[3].kind=nmea_late",     "faults[3].from_s=8",   "faults[3].until_s=9",
                                       "faults[3].for_ms=1250"};
    struct nmea_fix fix;
    struct rig *rig = open_with(sets, sizeof sets / sizeof *sets);
    assert_int_equal(second_at(rig, 0.4, &fix), -1);
    assert_int_equal(second_at(rig, 1.5, &fix), 3599);
    assert_true(device_next_fix_ns(rig->device, 2 * SECOND_NS) == 2 * SECOND_NS + SECOND_NS / 2); /* not known yet */
    assert_int_equal(second_at(rig, 4.4, &fix), 3599); /* the last one stays */
    assert_true(device_next_fix_ns(rig->device, 2 * SECOND_NS) == 4 * SECOND_NS + SECOND_NS / 2);
    assert_int_equal(second_at(rig, 4.6, &fix), 2);
    assert_true(fix.quality == 1 && !fix.is_spoilt);
    assert_int_equal(second_at(rig, 5.5, &fix), 3);
    assert_true(fix.quality == 0 && fix.is_spoilt);
    assert_int_equal(second_at(rig, 6.5, &fix), 4);
    assert_true(fix.quality == 1 && fix.is_spoilt);
    assert_int_equal(second_at(rig, 8.5, &fix), 5);
    /* The sentence of 8.5 arrives at 9.75, and the next one does not overtake it. */
    assert_int_equal(second_at(rig, 9.749, &fix), 5);
    assert_int_equal(second_at(rig, 9.75, &fix), 6);
    assert_int_equal(second_at(rig, 9.751, &fix), 7);
    assert_int_equal(second_at(rig, 1.5, &fix), 3599); /* a session that is late asks for the past */
    assert_string_equal(rig_tell(rig, "FAULt:INJected?", rig->next), "4");
    rig_close(rig);
}

/* Power is off from 2.2 to 3.6 s. So what arrived at 2.5 and 3.5 s reaches nobody, and the first sentence since power-up
 * is that of 4.5 s. Sessions that are late still get what was before. */
static void a_head_without_power_hears_nothing(void **state)
{
    (void)state;
    static const char *const sets[] = {"faults[0].kind=power_cycle", "faults[0].from_s=2.2", "faults[0].for_ms=1400"};
    struct nmea_fix fix;
    struct rig *rig = open_with(sets, sizeof sets / sizeof *sets);
    assert_int_equal(second_at(rig, 2.19, &fix), 3599);
    assert_int_equal(second_at(rig, 2.2, &fix), -1);
    assert_int_equal(second_at(rig, 2.5, &fix), -1);
    assert_int_equal(second_at(rig, 3.5, &fix), -1);
    assert_int_equal(second_at(rig, 3.6, &fix), -1);
    assert_int_equal(second_at(rig, 4.499, &fix), -1);
    assert_int_equal(second_at(rig, 4.5, &fix), 2);
    assert_int_equal(second_at(rig, 2.19, &fix), 3599);
    rig_close(rig);
}

/* Power is off from 1 to 1.1 s and from 1.4 to 1.7 s. A session that is late gets the same as one that is not: nothing
 * from 1 s on, as the sentence of 0.5 s is from before that, and the next ones arrive at 1.5 s, without power, and at
 * 2.5 s. */
static void each_power_cycle_counts(void **state)
{
    (void)state;
    static const char *const sets[] = {"faults[0].kind=power_cycle", "faults[0].from_s=1",   "faults[0].for_ms=100",
                                       "faults[1].kind=power_cycle", "faults[1].from_s=1.4", "faults[1].for_ms=300"};
    static const struct {
        double t_s;
        int second, ons;
    } row[] = {{0.9, 3598, 1}, {1.05, -1, 1}, {1.2, -1, 2}, {1.45, -1, 2}, {1.65, -1, 2}, {1.8, -1, 3}, {2.6, 0, 3}};
    struct rig *rig = open_with(sets, sizeof sets / sizeof *sets);
    for (int late = 0; late < 2; late++)
        for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
            struct nmea_fix fix;
            assert_int_equal(second_at(rig, row[i].t_s, &fix), row[i].second);
            assert_int_equal(device_last_power(rig->device, llround(1e9 * row[i].t_s)).ons, row[i].ons);
        }
    assert_int_equal(device_last_power(rig->device, SECOND_NS - 1).t_ns, 0);
    assert_int_equal(device_last_power(rig->device, SECOND_NS).t_ns, SECOND_NS / 10 * 11);
    assert_int_equal(device_last_power(rig->device, INT64_MAX).t_ns, SECOND_NS / 10 * 17);
    rig_close(rig);
}

/* At the highest rate sentences are as late as can be: 5 s by the setting, and 10 s by faults that add up to 20 s. All
 * sentences under way are still there. */
static void late_sentences_are_not_lost(void **state)
{
    (void)state;
    static const char *const sets[] = {"gnss.rate_hz=20",    "gnss.nmea_late_ms=5000", "faults[0].kind=nmea_late",
                                       "faults[0].from_s=4", "faults[0].for_ms=5000",  "faults[1].kind=nmea_late",
                                       "faults[1].from_s=4", "faults[1].for_ms=5000",  "faults[2].kind=nmea_late",
                                       "faults[2].from_s=4", "faults[2].for_ms=5000",  "faults[3].kind=nmea_late",
                                       "faults[3].from_s=4", "faults[3].for_ms=5000"};
    struct nmea_fix fix;
    struct rig *rig = open_with(sets, sizeof sets / sizeof *sets);
    assert_int_equal(second_at(rig, 19.49, &fix), 1); /* that of 4.45 */
    assert_int_equal(second_at(rig, 19.5, &fix), 2);  /* that of 4.5 */
    rig_close(rig);
}

/* Turns of the rotor at the full second at device time t_s, by the segment that has the pulses around it. */
static double turn_at(struct rig *rig, double t_s)
{
    const int64_t t_ns = llround(1e9 * t_s);
    rig_go_to(rig, (uint64_t)(t_ns / TICK_NS) + 1);
    if (schedule_time_ns(&rig->work.segment, rig->work.pulse_end) <= t_ns - rig->work.scan_t0_ns) rig_claim(rig);
    const struct schedule_segment *seg = &rig->work.segment;
    const uint64_t k = rig->work.pulse0;
    const int64_t since_ns = t_ns - rig->work.scan_t0_ns - schedule_time_ns(seg, k);
    const double turn = schedule_sweep_turn(seg, k) + 1e-15 * (double)seg->spec.lines_uhz * (double)since_ns;
    return turn - floor(turn);
}

/* Degrees beyond an azimuth, -180..180. */
static double beyond(double turn, double deg)
{
    return 360.0 * (turn - deg / 360.0 - round(turn - deg / 360.0));
}

/* Half a micro-hertz for a second, and the rounding of a pulse's time to a nanosecond at 20 turns a second: 7.2e-6
 * degree. */
static const double EXACT_DEG = 2e-4 + 1e-5;

/* Pulses are locked from 2.5 s on. The rotor is at its azimuth at the next one, whatever its speed and phase were, and
 * as long as there are pulses. */
static void the_rotor_is_where_the_lock_wants_it(void **state)
{
    (void)state;
    static const struct {
        const char *lines, *phase, *epoch;
        double deg, edge_s;
        int turns;
    } cases[] = {
        {"head.lines_hz=5", "head.phase_deg=0", "time.epoch=2026-01-01T00:59:57.5Z", 0, 0.5, 5},
        /* The last pulses of the tick with the edge come before it. */
        {"head.lines_hz=10", "head.phase_deg=90.01", "time.epoch=2026-01-01T00:59:57.49902Z", 90.01, 0.50098, 10},
        {"head.lines_hz=20", "head.phase_deg=359.99", "time.epoch=2026-01-01T00:59:57.5Z", 359.99, 0.5, 20},
        {"head.lines_hz=20", "head.phase_deg=180", "time.epoch=2026-01-01T00:59:57.5Z", 180, 0.5, 20}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *sets[] = {cases[i].lines, cases[i].phase, cases[i].epoch, "head.phase_lock=on",
                              "head.motor_ppm=-300"};
        struct rig *rig = open_with(sets, 5);
        assert_true(fabs(beyond(turn_at(rig, 2 + cases[i].edge_s), cases[i].deg)) > 0.01);
        assert_string_equal(rig_tell(rig, "HEAD:PHAS:LOCK?", rig->next), "ON");
        for (int s = 3; s < 7; s++) {
            const double beyond_deg = beyond(turn_at(rig, s + cases[i].edge_s), cases[i].deg);
            if (fabs(beyond_deg) > EXACT_DEG)
                fail_msg("%s: at second %d it is %.6f degrees beyond", cases[i].lines, s, beyond_deg);
            if (s == 3) continue;
            /* The speed of the second before lasts for two ticks at most, and was wrong by up to a turn a second. */
            const int64_t uhz = rig->work.segment.spec.lines_uhz, set_uhz = 1000000 * cases[i].turns;
            if (llabs(uhz - set_uhz) > 2000)
                fail_msg("%s: at second %d it turns %lld uHz", cases[i].lines, s, (long long)uhz);
        }
        assert_memory_equal(rig_tell(rig, "HEAD:PHAS:EDGE?", rig->next), "LOCKED,", 7);
        rig_close(rig);
    }
}

/* A head of one beam with one speed, and a file in the folder. */
static void write_beam(int lines_hz, const char *firing_ns)
{
    char path[96];
    snprintf(path, sizeof path, "%s/head.yaml", folder);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f, "maker: none\nmodel: beam\nfirmware: 1\nemitter: beams\nfiring_ns: {value: %s, from: assumed}\n",
            firing_ns);
    fprintf(f, "beams: [{elevation_deg: 0, offset_ns: 0, from: assumed}]\n");
    static const struct {
        const char *key;
        double value;
    } figure[] = {{"range_min_m", 0.5},   {"range_max_m", 100},   {"range_sigma_m", 0},
                  {"range_sigma_ppm", 0}, {"wavelength_nm", 903}, {"mirror_counts", 0},
                  {"pan_counts", 0},      {"beam_exit_m", 0.01},  {"beam_divergence_rad", 0.003},
                  {"pulse_width_ns", 6},  {"max_echoes", 2},      {"boot_s", 0.2},
                  {"spin_up_s", 0.03},    {"spin_down_s", 0.2}};
    for (size_t i = 0; i < sizeof figure / sizeof *figure; i++)
        fprintf(f, "%s: {value: %g, from: assumed}\n", figure[i].key, figure[i].value);
    fprintf(f, "lines_min_hz: {value: %d, from: assumed}\nlines_max_hz: {value: %d, from: assumed}\n", lines_hz,
            lines_hz);
    assert_int_equal(fclose(f), 0);
}

/* A rotor that has one speed can only turn slower, but never slower than half of it. So a phase may need two seconds.
 * A head whose turn is one firing sequence can't turn faster at all: it would have turns without a pulse. */
static void a_rotor_at_its_limits(void **state)
{
    (void)state;
    char profile[128];
    snprintf(profile, sizeof profile, "head.profile=%s/head.yaml", folder);
    static const char *const phases[] = {"head.phase_deg=0", "head.phase_deg=100", "head.phase_deg=200"};
    static const struct {
        const char *lines, *firing_ns;
        int lines_hz, spare_uhz;
    } heads[] = {{"head.lines_hz=1", "55296", 1, 2000}, {"head.lines_hz=20", "50000000", 20, 0}};
    for (size_t i = 0; i < 6; i++) {
        const char *const sets[] = {profile, phases[i % 3], heads[i / 3].lines, "head.phase_lock=on", "links=[]"};
        const int64_t set_uhz = 1000000 * heads[i / 3].lines_hz;
        write_beam(heads[i / 3].lines_hz, heads[i / 3].firing_ns);
        struct rig *rig = open_with(sets, 5);
        for (int s = 1; s < 9; s++) {
            const double beyond_deg = beyond(turn_at(rig, s + 0.6), 0);
            const int64_t uhz = rig->work.segment.spec.lines_uhz;
            if (uhz < set_uhz / 2 || uhz > set_uhz + heads[i / 3].spare_uhz || !isfinite(beyond_deg))
                fail_msg("%s, %s: at second %d it turns %lld uHz", sets[1], sets[2], s, (long long)uhz);
            if (s >= 5 && uhz < set_uhz - 2000)
                fail_msg("%s, %s: at second %d it still turns %lld uHz", sets[1], sets[2], s, (long long)uhz);
        }
        if (i < 3) assert_true(fabs(beyond(turn_at(rig, 9.5), 100.0 * (double)i)) <= EXACT_DEG);
        rig_close(rig);
    }
}

/* Without pulses, and without the lock, the motor drifts by its own error: 300 ppm of 10 turns are 1.08 degrees a
 * second. */
static void the_phase_is_lost_with_the_pulses(void **state)
{
    (void)state;
    static const char *const sets[] = {"head.phase_lock=on",      "head.phase_deg=180", "head.motor_ppm=300",
                                       "faults[0].kind=pps_lost", "faults[0].from_s=5", "faults[0].until_s=8"};
    struct rig *rig = open_with(sets, 6);
    assert_true(fabs(beyond(turn_at(rig, 4.5), 180)) <= EXACT_DEG);
    assert_true(fabs(beyond(turn_at(rig, 5.5), 180)) <= 1.08 * 0.002); /* free from 5.501 s on */
    const double lost = beyond(turn_at(rig, 6.5), 180);
    assert_true(fabs(lost - 1.08) <= 1.08 * 0.003);
    assert_true(fabs(beyond(turn_at(rig, 7.5), 180) - lost - 1.08) <= EXACT_DEG);
    rig_go_to(rig, 8600);
    assert_memory_equal(rig_tell(rig, "HEAD:PHAS:EDGE?", rig->next), "FREE,183.2", 10); /* of the pulse at 8.5 s */
    assert_true(fabs(beyond(turn_at(rig, 11.5), 180)) <= EXACT_DEG);                    /* locked at 10.5 */
    rig_tell(rig, "HEAD:PHAS:LOCK OFF", rig->next);
    turn_at(rig, 12.5);
    assert_true(fabs(beyond(turn_at(rig, 14.5), 180) - beyond(turn_at(rig, 12.5), 180)) > 2.0);
    rig_close(rig);
}

/* A speed that is no whole number of turns a second is at another azimuth at each pulse: nothing holds it. A new speed
 * is held from the second pulse after its command. Another head has no such rotor. */
static void only_whole_turns_are_held(void **state)
{
    (void)state;
    static const char *const sets[] = {"head.lines_hz=9.5"};
    struct rig *rig = open_with(sets, 1);
    rig_tell(rig, "HEAD:PHAS:LOCK ON", 0);
    assert_string_equal(rig_tell(rig, "HEAD:PHAS:EDGE?", 0), "NONE");
    assert_true(fabs(beyond(turn_at(rig, 4.5), 360.0 * turn_at(rig, 3.5))) > 1.0);
    assert_int_equal(rig->work.segment.spec.lines_uhz, 9500000);
    rig_tell(rig, "HEAD:LIN 12", rig->next);
    rig_tell(rig, "HEAD:PHAS 45", rig->next);
    turn_at(rig, 5.5);
    assert_true(fabs(beyond(turn_at(rig, 6.5), 45)) <= EXACT_DEG);
    rig_go_to(rig, 6600);
    rig_tell(rig, "HEAD:LIN 10", rig->next); /* it does not go on at the speed that held it */
    rig_claim(rig);
    assert_int_equal(rig->work.segment.spec.lines_uhz, 10000000);
    rig_close(rig);
}

/* Power comes a quarter after the full second, so pulses are due at 0.75 s, 1.75 s, ... A late one has
 * its own second all the same. GPS time is 18 s ahead of UTC, and counts from 1980-01-06. */
static void late_pulses_have_their_second(void **state)
{
    (void)state;
    const char *const sets[] = {"time.epoch=2026-01-01T00:00:00.25Z", "faults[0].kind=pps_jitter",
                                "faults[0].for_ms=50"};
    struct rig *rig = open_with(sets, 3);
    int late_ticks = 0;
    for (uint64_t k = 1; k <= 4; k++) {
        const struct native_event *pps = rig_wait(rig, NATIVE_EV_PPS, 1100);
        const uint64_t due_ns = k * (uint64_t)SECOND_NS - 250000000;
        assert_true(pps->a == 1767225600 + k && pps->c == 1767225600 - 315964800 + 18 + k);
        assert_true(pps->b >= due_ns && pps->b <= due_ns + 50000000);
        late_ticks += pps->b >= due_ns + 1000000;
    }
    assert_true(late_ticks >= 2); /* in a later tick than was due, as 49 of 50 pulses are */
    rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(follows_what_comes),
        cmocka_unit_test(sentences_go_wrong),
        cmocka_unit_test(a_head_without_power_hears_nothing),
        cmocka_unit_test(each_power_cycle_counts),
        cmocka_unit_test(late_sentences_are_not_lost),
        cmocka_unit_test(late_pulses_have_their_second),
        cmocka_unit_test(the_rotor_is_where_the_lock_wants_it),
        cmocka_unit_test(a_rotor_at_its_limits),
        cmocka_unit_test(the_phase_is_lost_with_the_pulses),
        cmocka_unit_test(only_whole_turns_are_held),
    };
    return cmocka_run_group_tests(tests, make_vlp16, remove_folder);
}
