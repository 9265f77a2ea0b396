/* SPDX-License-Identifier: MIT */
/* Programs of a head, by command. HEAD:PRR within a scan changes reach, echoes and smallest range as the table of the
 * head says, from the pulse on at which the rate changes. The tables below were typed from the profiles' sources, not
 * read from the program. */
#include <math.h>

#include "tests/common/thorough.h"
#include "tests/unit/device_rig.h"

/* The scene is a strip of a cylinder about the mirror's axis, a metre away, of facets of 0.5 deg. So each pulse of a
 * line meets it head on to 0.25 deg, and its range is that of the cylinder less 1e-5 of it at most. */
enum { FACETS = 220 };
static const double FACET_DEG = 0.5, FIRST_DEG = -42.0;

static void put_strip(double radius, int k, FILE *f)
{
    const int first = 2 * (FACETS + 1) * k;
    for (int i = 0; i <= FACETS; i++) {
        const double at = (FIRST_DEG + FACET_DEG * i) * M_PI / 180.0;
        for (int side = -1; side <= 1; side += 2)
            fprintf(f, "v %.12g %.12g %.12g\n", 0.02 * radius * side, radius * cos(at), radius * sin(at));
    }
    for (int i = 0; i < FACETS; i++)
        fprintf(f, "f %d %d %d %d\n", first + 2 * i + 1, first + 2 * i + 2, first + 2 * i + 4, first + 2 * i + 3);
}

static int write_strips(const char *name, const char *const *object, int n)
{
    char path[96];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *f = fopen(path, "w");
    if (f == NULL) return -1;
    for (int k = 0; k < n; k++) {
        fprintf(f, "o %s\n", object[k]);
        put_strip(1.0 + 0.1 * k, k, f);
    }
    return fclose(f);
}

static const char *const panes[] = {"pane-1", "pane-2", "pane-3", "pane-4", "wall"};

static int make_strip(void **state)
{
    char path[96];
    if (make_folder(state) != 0 || write_strips("strip.obj", panes + 4, 1) != 0 ||
        write_strips("panes.obj", panes, 5) != 0)
        return -1;
    snprintf(path, sizeof path, "%s/run.yaml", folder);
    FILE *f = fopen(path, "w");
    if (f == NULL) return -1;
    fputs("head: {profile: riegl-vz400i, lines_hz: 50, pan_deg_s: 0, frames: 0}\n"
          "scene: {meshes: [{file: strip.obj, up: z, scale: 1}]}\n"
          "stations: [{position_m: [0, 0, 0]}]\nbeam: {mode: single}\n"
          "signal: {model: on}\nsurfaces: [{reflectance: 0.9}]\n",
          f);
    return fclose(f);
}

static int remove_strip(void **state)
{
    static const char *const names[] = {"strip.obj", "panes.obj", "bars.obj"};
    char path[96];
    for (int i = 0; i < 3; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        unlink(path);
    }
    return remove_folder(state);
}

struct program {
    int prr_hz, echoes;
    double reach_90_m, reach_20_m, nearest_m;
};
static const struct head {
    const char *name;
    int n;
    struct program program[5];
} heads[] = {
    {"riegl-vz400i",
     4,
     {{100000, 15, 800, 400, 1.5},
      {300000, 15, 480, 230, 1.2},
      {600000, 8, 350, 160, 0.5},
      {1200000, 4, 250, 120, 0.5}}},
    {"riegl-vz600i",
     4,
     {{140000, 15, 1000, 500, 0.5},
      {600000, 15, 480, 235, 0.5},
      {1200000, 10, 340, 165, 0.5},
      {2200000, 5, 250, 120, 0.5}}},
    {"riegl-vz2000i",
     5,
     {{50000, 15, 2500, 1300, 1.5},
      {100000, 15, 1800, 920, 1.5},
      {300000, 15, 1050, 520, 1.5},
      {600000, 8, 750, 365, 1.5},
      {1200000, 4, 530, 255, 1.5}}},
};
enum { HEADS = sizeof heads / sizeof *heads };

static struct rig *open_at(const char *head, double range_m, double reflectance, const char *more)
{
    char set[5][64];
    const char *const sets[] = {set[0], set[1], set[2], more};
    snprintf(set[0], sizeof set[0], "head.profile=%s", head);
    snprintf(set[1], sizeof set[1], "scene.meshes[0].scale=%.12g", range_m);
    snprintf(set[2], sizeof set[2], "surfaces[0].reflectance=%.12g", reflectance);
    struct rig *rig = rig_open(NULL, sets, more != NULL ? 4 : 3);
    rig_go_to(rig, 300);
    rig_tell(rig, "SCAN:START", rig->next);
    while (!rig->work.scanning)
        assert_true(rig_claim(rig));
    return rig;
}

static void tell_rate(struct rig *rig, int prr_hz)
{
    char line[32];
    snprintf(line, sizeof line, "HEAD:PRR %d", prr_hz);
    rig_tell(rig, line, rig->next);
}

struct seen {
    uint64_t shots, echoes;
};

/* Adds up the points of the last claimed tick, one for each pulse. */
static void add_tick(struct rig *rig, struct seen *seen)
{
    const struct ring_tick *tick = rig_fill(rig);
    for (uint32_t at = 0; at < tick->len; at += (uint32_t)native_frame_len(tick->bytes + at)) {
        const uint8_t *frame = tick->bytes + at, *payload = frame + NATIVE_HEADER_LEN;
        struct native_points points;
        if (frame[1] != NATIVE_POINTS) continue;
        assert_int_equal(native_decode_points(payload, native_frame_len(frame) - NATIVE_HEADER_LEN, &points), 0);
        assert_int_equal(points.n_points, points.n_pulses);
        for (uint32_t i = 0; i < points.n_points; i++) {
            struct native_point point;
            native_decode_point(payload, i, &point);
            seen->shots++;
            seen->echoes += point.echo != 0;
        }
    }
}

/* Computes the expected share by core/detect.h. First comes the reflectance that is just seen, from the two reaches
 * of the program. Then comes the share of pulses that see the target, with noise of 1/8 of the threshold
 * (threshold_snr). */
static double expected_share(const struct program *p, double reflectance, double range_m)
{
    if (range_m > p->reach_90_m) return 0.0; /* nothing is seen beyond it */
    const double slope = (log(0.9 / 0.2) - 2.0 * log(p->reach_90_m / p->reach_20_m)) / (p->reach_90_m - p->reach_20_m);
    const double least = 0.9 * pow(range_m / p->reach_90_m, 2) * exp(slope * (range_m - p->reach_90_m));
    return 0.5 * erfc(-8.0 * (reflectance / least - 1.0) / M_SQRT2);
}

/* Targets of 90 and 20 % stand 2 % before the reach and 2 % behind it. Each rate is set by command within the scan,
 * which began at another one. With 20,000 pulses each, 4.75 standard errors are 0.017 at p = 1/2; without THOROUGH=1
 * they are 0.034, with 5,000. The 52 comparisons together have a false alarm with 1e-4. Facets and cosines move the
 * range by 1e-5 of it, and so the share by 1e-4. */
static void targets_vanish_at_the_reach_of_each_program(void **state)
{
    (void)state;
    for (int k = 0; k < 4 * 13; k += SANITIZED ? 5 : 1) {
        static const double where[] = {0.98, 1.02};
        int i = k / 4, h = 0;
        for (; i >= heads[h].n; h++)
            i -= heads[h].n;
        const struct program *p = &heads[h].program[i];
        const double reflectance = k & 1 ? 0.2 : 0.9,
                     range_m = where[k >> 1 & 1] * (k & 1 ? p->reach_20_m : p->reach_90_m);
        struct rig *rig = open_at(heads[h].name, range_m, reflectance, NULL);
        struct seen seen = {0};
        tell_rate(rig, heads[h].program[(i + 1) % heads[h].n].prr_hz);
        assert_true(rig_claim(rig));
        tell_rate(rig, p->prr_hz);
        while (seen.shots < (uint64_t)fewer(thorough(20000, 5000))) {
            assert_true(rig_claim(rig));
            add_tick(rig, &seen);
        }
        const double share = (double)seen.echoes / (double)seen.shots,
                     expected = expected_share(p, reflectance, range_m);
        if (fabs(share - expected) > 4.75 * sqrt(0.25 / (double)seen.shots) + 1e-4)
            fail_msg("%s at %d Hz, %g at %g m: %.4f of the pulses see it, expected %.4f", heads[h].name, p->prr_hz,
                     reflectance, range_m, share, expected);
        rig_close(rig);
    }
    /* The cases differ: not all of them expect half of the pulses. */
    assert_true(expected_share(&heads[0].program[0], 0.9, 784.0) > 0.6);
    assert_true(expected_share(&heads[0].program[0], 0.2, 408.0) < 0.4);
}

/* Signals have no noise. Each pulse of one rate sees a target between the reaches of two rates, and no pulse of the
 * other rate does. The change holds from the very pulse at which the command took effect. */
static void a_rate_changes_the_reach_at_its_pulse(void **state)
{
    (void)state;
    struct rig *rig = open_at("riegl-vz400i", 300.0, 0.9, "signal.detection=sharp");
    static const struct {
        int prr_hz, seen;
    } turns[] = {{600000, 1}, {1200000, 0}, {100000, 1}, {1200000, 0}, {300000, 1}};
    for (size_t i = 0; i < sizeof turns / sizeof *turns; i++) {
        struct seen seen = {0};
        tell_rate(rig, turns[i].prr_hz);
        do {
            assert_true(rig_claim(rig));
            add_tick(rig, &seen);
        } while (seen.shots < 3000);
        assert_true(rig->work.segment.spec.prr_uhz == turns[i].prr_hz * INT64_C(1000000));
        assert_int_equal(seen.echoes, turns[i].seen ? seen.shots : 0);
    }
    rig_close(rig);
}

/* The descriptor after a change has the new rate's figures. */
static void the_descriptor_follows(void **state)
{
    (void)state;
    for (int h = 0; h < HEADS; h++) {
        struct rig *rig = open_at(heads[h].name, 100.0, 0.9, NULL);
        for (int i = 0; i < 2 * heads[h].n; i++) {
            const struct program *p = &heads[h].program[i % heads[h].n];
            tell_rate(rig, p->prr_hz);
            do
                assert_true(rig_claim(rig));
            while (!rig->work.describe);
            const struct native_descriptor *d = &rig->work.descriptor;
            assert_true(d->prr_uhz == (uint64_t)p->prr_hz * 1000000);
            assert_int_equal(d->max_echoes, p->echoes);
            assert_true(d->range_max_m == p->reach_90_m && d->range_min_m == p->nearest_m);
        }
        rig_close(rig);
    }
}

/* Six upright bars are side by side across one footprint (18 mm of radius at 100 m), each a metre farther. */
static int write_bars(void)
{
    char path[96];
    snprintf(path, sizeof path, "%s/bars.obj", folder);
    FILE *f = fopen(path, "w");
    if (f == NULL) return -1;
    for (int k = 0; k < 6; k++)
        for (int corner = 0; corner < 4; corner++)
            fprintf(f, "v %.12g %d %d\n", (100.0 + k) * 6e-5 * (k - 3 + (corner == 1 || corner == 2)), 100 + k,
                    corner < 2 ? -5 : 5);
    for (int k = 0; k < 6; k++)
        fprintf(f, "f %d %d %d %d\n", 4 * k + 1, 4 * k + 2, 4 * k + 3, 4 * k + 4);
    return fclose(f);
}

/* Counts points a pulse, in rates one after the other: `many` at 600 kHz, which has 8 echoes, and 4 at 1.2 MHz. */
static void expect_echoes(struct rig *rig, uint64_t many)
{
    for (int i = 0; i < 6; i++) {
        uint64_t n = 0, pulses = 0;
        tell_rate(rig, i & 1 ? 1200000 : 600000);
        while (pulses < 500) {
            assert_true(rig_claim(rig));
            const struct ring_tick *tick = rig_fill(rig);
            for (uint32_t at = 0; at < tick->len; at += (uint32_t)native_frame_len(tick->bytes + at)) {
                struct native_points points;
                const uint8_t *frame = tick->bytes + at, *payload = frame + NATIVE_HEADER_LEN;
                const size_t len = native_frame_len(frame) - NATIVE_HEADER_LEN;
                if (frame[1] != NATIVE_POINTS) continue;
                assert_int_equal(native_decode_points(payload, len, &points), 0);
                pulses += points.n_pulses;
                n += points.n_points;
            }
        }
        assert_int_equal(n, pulses * (i & 1 ? 4 : many));
    }
}

/* Four panes and a wall, 2 m apart, are five echoes, and the bars are six. A rate that reports four leaves out the
 * weakest. */
static void a_rate_changes_the_echoes(void **state)
{
    (void)state;
    char mesh[128];
    const char *const through[] = {mesh,
                                   "scene.meshes[0].scale=20",
                                   "surfaces[0].object=pane-*",
                                   "surfaces[0].glass=0.9",
                                   "surfaces[0].reflectance=0.1",
                                   "optics.depth=4",
                                   "head.prr_hz=600000"};
    const char *const across[] = {mesh,
                                  "signal.model=off",
                                  "beam.mode=rings",
                                  "beam.rings=12",
                                  "head.line_start_deg=-1",
                                  "head.line_stop_deg=1",
                                  "head.prr_hz=600000"};
    const struct device_options start = {.start = 1};
    snprintf(mesh, sizeof mesh, "scene.meshes[0].file=%s/panes.obj", folder);
    struct rig *rig = rig_open(&start, through, sizeof through / sizeof *through);
    expect_echoes(rig, 5);
    rig_close(rig);
    assert_int_equal(write_bars(), 0);
    snprintf(mesh, sizeof mesh, "scene.meshes[0].file=%s/bars.obj", folder);
    rig = rig_open(&start, across, sizeof across / sizeof *across);
    expect_echoes(rig, 6);
    rig_close(rig);
}

/* The target is nearer than the smallest range of one rate, but not of the other. No signal is modelled here. */
static void a_rate_changes_the_smallest_range(void **state)
{
    (void)state;
    struct rig *rig = open_at("riegl-vz400i", 1.3, 0.9, "signal.model=off");
    for (int i = 0; i < 4; i++) {
        static const int rates[] = {100000, 300000, 600000, 100000};
        struct seen seen = {0};
        tell_rate(rig, rates[i]);
        do {
            assert_true(rig_claim(rig));
            add_tick(rig, &seen);
        } while (seen.shots < 1000);
        assert_int_equal(seen.echoes, rates[i] == 100000 ? 0 : seen.shots);
    }
    rig_close(rig);
}

static void a_rate_between_them_is_refused(void **state)
{
    (void)state;
    struct rig *rig = open_at("riegl-vz400i", 100.0, 0.9, NULL);
    struct command_result result;
    tell_rate(rig, 300000);
    device_command(rig->device, 1, "HEAD:PRR 500000", rig->next, &result);
    assert_string_equal(result.reply, "ERR -222,\"Data out of range; HEAD:PRR 500000, allowed 100000, 300000, 600000, "
                                      "1200000 Hz\"");
    assert_string_equal(rig_tell(rig, "HEAD:PRR?", rig->next), "300000");
    assert_true(rig_claim(rig) && rig->work.segment.spec.prr_uhz == INT64_C(300000000000));
    rig_close(rig);
}

enum { TICKS = 160 };

/* Runs a session that goes through all rates or, without a command, the replay of its journal. `seen` gets the counts
 * of each tick. */
static void run_session(const struct device_options *options, struct seen seen[TICKS])
{
    static const char *const sets[] = {"scene.meshes[0].scale=230", "surfaces[0].reflectance=0.2"};
    struct rig *rig = rig_open(options, sets, 2);
    rig_go_to(rig, 300);
    memset(seen, 0, TICKS * sizeof *seen);
    for (int i = 0; i < TICKS; i++) {
        if (options->journal != NULL && i == 0) rig_tell(rig, "SCAN:START", rig->next);
        if (options->journal != NULL && i % 30 == 25) tell_rate(rig, heads[0].program[i / 30 % 4].prr_hz);
        assert_true(rig_claim(rig));
        add_tick(rig, &seen[i]);
    }
    rig_close(rig);
}

static void a_journal_replayed_gives_the_same_echoes(void **state)
{
    (void)state;
    static struct seen first[TICKS], again[TICKS];
    uint64_t some = 0, none = 0;
    run_session(&(struct device_options){.journal = journal_path}, first);
    run_session(&(struct device_options){.replay = journal_path}, again);
    assert_memory_equal(first, again, sizeof first);
    for (int i = 0; i < TICKS; i++) {
        some += first[i].echoes;
        none += first[i].shots - first[i].echoes;
    }
    assert_true(some > 1000 && none > 1000); /* 230 m on 20 %: seen at some rates, at others not */
}

int main(void)
{
    setenv("SCANHEAD_HEADS", "config/heads", 1);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(targets_vanish_at_the_reach_of_each_program),
        cmocka_unit_test(a_rate_changes_the_reach_at_its_pulse),
        cmocka_unit_test(the_descriptor_follows),
        cmocka_unit_test(a_rate_changes_the_echoes),
        cmocka_unit_test(a_rate_changes_the_smallest_range),
        cmocka_unit_test(a_rate_between_them_is_refused),
        cmocka_unit_test(a_journal_replayed_gives_the_same_echoes),
    };
    return cmocka_run_group_tests(tests, make_strip, remove_strip);
}
