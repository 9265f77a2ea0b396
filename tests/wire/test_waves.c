/* SPDX-License-Identifier: MIT */
/* waveform.send and waveform.echoes go from the configuration to a client. The tests check the frames that stay the
 * same, the energy of the samples, the echoes that are found, and losses. */
#include "tests/wire/room.h"

enum { MOST = 40000, POINTS = 4096, WINDOWS = 4096, CONTENT_WAVES = 4 };

/* Walls of 2 % at 2.7 to 7 m are up to 33 dB above the threshold. 14 bits of 36 dB have counts of a quarter of it. */
static const char MORE[] = "beam: {mode: adaptive}\nsignal: {model: on, detection: sharp}\n"
                           "surfaces: [{reflectance: 0.02}]\n"
                           "waveform: {bits: 14, full_scale_db: 36, keep_db: 0}\n"
                           "output: {attributes: on}\n";

static const struct room_config SCAN = {.profile = "riegl-vz400i",
                                        .prr_hz = 100000,
                                        .lines_hz = 50,
                                        .pan_deg_s = 150,
                                        .pan_stop_deg = 30,
                                        .frames = 1,
                                        .links = "links: []\n",
                                        .more = MORE};

/* Records the scan with these settings (ends with NULL) to a file. */
static void record(struct wire *wire, const struct room_config *scan, const char *name, const char *const *sets)
{
    char config[352], path[352], stats[352];
    const char *args[24] = {"record", config, "-o", path, "--stats", stats, "--quiet"};
    int n = 7;
    snprintf(config, sizeof config, "%s", room_config_write(wire, scan));
    snprintf(path, sizeof path, "%s", wire_path(wire, name));
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    for (int i = 0; sets[i] != NULL; i++) {
        args[n++] = "--set";
        args[n++] = sets[i];
    }
    args[n] = NULL;
    wire_run(wire, args, 0);
}

/* A pulse as the stream has it. */
struct shot {
    int echoes, windows;
    double range_m, width_ns, amplitude; /* of its first echo; the sum of all */
    double energy_ns, from_m, to_m;      /* of its windows: signal times time; their place */
};
static struct shot shots[2][MOST];

static void take_waves(struct scanhead *sh, const struct scanhead_frame *frame, struct shot *shot)
{
    static struct scanhead_wave wave[WINDOWS];
    const int n = scanhead_waves(sh, frame, 0, wave, WINDOWS);
    assert_true(n >= 0);
    for (int i = 0; i < n; i++) {
        assert_true(wave[i].pulse < MOST);
        struct shot *s = &shot[wave[i].pulse];
        s->from_m = s->windows == 0 ? wave[i].range_m : s->from_m;
        s->to_m = wave[i].range_m + wave[i].n * wave[i].step_m;
        for (uint32_t k = 0; k < wave[i].n; k++)
            s->energy_ns += 1e-3 * wave[i].sample_ps * scanhead_wave_signal(&wave[i], k);
        s->windows++;
    }
}

/* Reads a recording. Returns the samples that it says are lost. */
static uint64_t read_shots(const struct wire *wire, const char *name, struct shot *shot)
{
    static struct scanhead_point point[POINTS];
    static struct scanhead_attribute attribute[POINTS];
    struct scanhead *sh = client_open(wire_path(wire, name));
    struct scanhead_frame frame;
    uint64_t lost = 0, pulse = 0;
    uint32_t n = 0;
    memset(shot, 0, MOST * sizeof *shot);
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        if (frame.type == SCANHEAD_POINTS) {
            n = frame.n_points;
            pulse = frame.pulse0;
            assert_int_equal(scanhead_points(sh, &frame, 0, point, POINTS), n);
        }
        if (frame.type == SCANHEAD_WAVES) {
            lost += (uint64_t)scanhead_waves_lost(sh, &frame);
            take_waves(sh, &frame, shot);
        }
        if (frame.type != SCANHEAD_ATTRIBUTES) continue;
        assert_int_equal(scanhead_attributes(sh, &frame, 0, attribute, POINTS), n);
        for (uint32_t i = 0; i < n; i++) {
            pulse += point[i].echo < 2;
            assert_true(pulse <= MOST);
            struct shot *s = &shot[pulse - 1];
            s->echoes = point[i].echo_count;
            if (s->echoes == 0) continue;
            s->amplitude += pow(10.0, 0.1 * attribute[i].amplitude_db);
            if (point[i].echo > 1) continue;
            s->range_m = point[i].range_m;
            s->width_ns = attribute[i].width_ns;
        }
    }
    scanhead_close(sh);
    return lost;
}

/* Takes the next frame that the hash includes and that is no waveform. Returns 0 at the end. */
static int next_old(struct scanhead *sh, struct scanhead_frame *frame, uint32_t *waves)
{
    for (;;) {
        if (scanhead_next(sh, frame, 0) != SCANHEAD_OK) return 0;
        *waves += frame->type == SCANHEAD_WAVES;
        if ((frame->flags & 3) == 0 && frame->type != SCANHEAD_TELEMETRY && frame->type != SCANHEAD_EVENT &&
            frame->type != SCANHEAD_SURFACES && frame->type != SCANHEAD_WAVES)
            return 1;
    }
}

/* On, all that there is without waveforms is there byte for byte, except the bit in the descriptor's last field but
 * one that announces them. */
static void test_off_and_on(void **state)
{
    struct wire *wire = *state;
    room_write(wire);
    record(wire, &SCAN, "off.shs", (const char *const[]){NULL});
    record(wire, &SCAN, "on.shs", (const char *const[]){"waveform.send=on", NULL});
    struct scanhead *off = client_open(wire_path(wire, "off.shs")), *on = client_open(wire_path(wire, "on.shs"));
    struct scanhead_frame a, b;
    uint32_t waves[2] = {0, 0}, points = 0;
    while (next_old(off, &a, &waves[0])) {
        assert_true(next_old(on, &b, &waves[1]));
        assert_int_equal(a.type, b.type);
        assert_int_equal(a.payload_len, b.payload_len);
        if (a.type == SCANHEAD_DESCRIPTOR) {
            assert_int_equal(a.payload[a.payload_len - 8] | CONTENT_WAVES, b.payload[b.payload_len - 8]);
            assert_memory_equal(a.payload, b.payload, a.payload_len - 8);
        } else {
            assert_memory_equal(a.payload, b.payload, a.payload_len);
        }
        points += a.type == SCANHEAD_POINTS;
    }
    assert_false(next_old(on, &b, &waves[1]));
    assert_true(points > 50 && waves[0] == 0 && waves[1] >= points);
    assert_int_equal(scanhead_has_waves(off), 0);
    assert_int_equal(scanhead_has_waves(on), 1);
    scanhead_close(off);
    scanhead_close(on);
}

/* A Gaussian pulse of 4 ns has an area of 4 ns sqrt(pi / (4 ln 2)). The amplitude is sent in steps of 0.01 dB, which
 * is 0.12 %. The energy agrees with it to a further 0.1 %. A dozen samples of the pulse are rounded to a count of a
 * quarter: 1 ns at most. */
static void test_energy(void **state)
{
    struct wire *wire = *state;
    const double area_ns = 4.0 * sqrt(M_PI / (4.0 * M_LN2));
    uint32_t n = 0;
    room_write(wire);
    record(wire, &SCAN, "on.shs", (const char *const[]){"waveform.send=on", NULL});
    assert_int_equal(read_shots(wire, "on.shs", shots[0]), 0);
    assert_int_equal(stats_uint(wire, "lost_samples"), 0);
    for (const struct shot *s = shots[0]; s < shots[0] + MOST; s++) {
        if (s->echoes == 0) continue;
        assert_int_equal(s->echoes, 1);
        assert_int_equal(s->windows, 1);
        assert_true(s->from_m < s->range_m && s->range_m < s->to_m);
        const double off = s->energy_ns / (s->amplitude * area_ns) - 1.0;
        if (!(fabs(off) < 0.0022 + 1.0 / (s->amplitude * area_ns)))
            fail_msg("pulse %td: energy is off by %.3f %%", s - shots[0], 100.0 * off);
        n++;
    }
    assert_true(n > 5000);
}

/* A pane stands 2 m before a wall. The samples have the light of pane and wall. They have up to 3 % more where the
 * model leaves out light: at the pane's edge, echoes with less than 1 % of a footprint; where pane and floor are one
 * echo, 1 / R^2 of both is more than that of their mean, by 3 (0.3 m / R)^2 at most. */
static void test_glass(void **state)
{
    struct wire *wire = *state;
    static const char *const modes[] = {"beam.mode=single", "beam.mode=adaptive"};
    const double area_ns = 4.0 * sqrt(M_PI / (4.0 * M_LN2));
    room_write(wire);
    FILE *f = fopen(wire_path(wire, "room.obj"), "a");
    assert_non_null(f);
    fputs("v 1 2 -1.4\nv 2.5 2 -1.4\nv 2.5 2 2\nv 1 2 2\no pane\nusemtl pane\nf 9 10 11 12\n", f);
    assert_int_equal(fclose(f), 0);
    for (int mode = 0; mode < 2; mode++) {
        uint32_t several = 0;
        record(wire, &SCAN, "glass.shs",
               (const char *const[]){"waveform.send=on", "surfaces.0.material=paint-*", "surfaces.1.material=pane",
                                     "surfaces.1.glass=0.9", "surfaces.1.reflectance=0.01", "optics.depth=4",
                                     modes[mode], NULL});
        read_shots(wire, "glass.shs", shots[0]);
        for (const struct shot *s = shots[0]; s < shots[0] + MOST; s++) {
            if (s->echoes == 0) continue;
            const double off = s->energy_ns / (s->amplitude * area_ns) - 1.0, slack = 2.0 / (s->amplitude * area_ns);
            if (!(off > -0.0022 - slack && off < 0.03 + slack))
                fail_msg("%s, pulse %td: energy is off by %.3f %%", modes[mode], s - shots[0], 100.0 * off);
            several += s->echoes > 1;
        }
        assert_true(several > 300);
    }
}

/* Without noise, echoes that are found are those of the model, but for digits. Half a count is an eighth of a
 * threshold. From the sample below the threshold to the one above it the signal rises by 1 or more, so half a count
 * is 19 mm there at most. A detector that takes a straight line at half of the peak, between samples 1 ns apart, has
 * an error of 3.6 mm. Amplitudes agree to 1 %, widths to 2 %. */
static void test_echoes(void **state)
{
    struct wire *wire = *state;
    static const double most_m[] = {38e-3, 3.6e-3, 1e-3};
    static const char *const how[] = {"waveform.echoes=threshold", "waveform.echoes=fraction",
                                      "waveform.echoes=gaussians"};
    room_write(wire);
    record(wire, &SCAN, "model.shs", (const char *const[]){NULL});
    read_shots(wire, "model.shs", shots[0]);
    for (int i = 0; i < 3; i++) {
        record(wire, &SCAN, "found.shs", (const char *const[]){how[i], NULL});
        read_shots(wire, "found.shs", shots[1]);
        for (int k = 0; k < MOST; k++) {
            const struct shot *a = &shots[0][k], *b = &shots[1][k];
            assert_int_equal(b->windows, 0); /* they are not sent */
            if (a->echoes != b->echoes) fail_msg("%s: pulse %d has %d echoes, not %d", how[i], k, b->echoes, a->echoes);
            if (a->echoes == 0) continue;
            if (!(fabs(a->range_m - b->range_m) < most_m[i] && fabs(b->amplitude / a->amplitude - 1.0) < 0.01 &&
                  fabs(b->width_ns - a->width_ns) < 0.08))
                fail_msg("%s: pulse %d: %.4f m, not %.4f; amplitude %.1f, not %.1f; %.2f ns, not %.2f", how[i], k,
                         b->range_m, a->range_m, b->amplitude, a->amplitude, b->width_ns, a->width_ns);
        }
    }
}

/* A pulse of 10 ns has a tail of 1,400 ns 30 dB below its peak. A usual return of 20 dB has that tail below keep_db,
 * near walls have it above. So their windows are longer than a block has room for. The lost samples are reported by
 * the frames, by the statistics and in a warning. The first two agree.
 */
static void test_lost(void **state)
{
    struct wire *wire = *state;
    char pulse[400];
    room_write(wire);
    FILE *f = fopen(wire_path(wire, "long.csv"), "w");
    assert_non_null(f);
    fputs("t_ns,power\n", f);
    for (int i = 0; i <= 140; i++)
        fprintf(f, "%d,%g\n", 10 * i, i == 0 || i == 140 ? 0.0 : i == 1 ? 1.0 : 0.001);
    assert_int_equal(fclose(f), 0);
    snprintf(pulse, sizeof pulse, "waveform.pulse_file=%s", wire_path(wire, "long.csv"));
    record(wire, &SCAN, "long.shs",
           (const char *const[]){"waveform.send=on", "waveform.pulse=table", pulse, "beam.mode=single", NULL});
    const uint64_t lost = read_shots(wire, "long.shs", shots[0]);
    assert_true(lost > 0);
    assert_int_equal(stats_uint(wire, "lost_samples"), lost);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(err, "samples of waveforms left out"));
    free(err);
}

/* Takes frames up to a new descriptor that says so, and then up to the end of a whole line. Returns the frames of
 * waveforms since that descriptor. */
static uint32_t count_waves(struct scanhead *sh, int has)
{
    struct scanhead_frame frame;
    int64_t since_ns = 0;
    uint32_t n = 0;
    do {
        client_next(sh, &frame);
        wire_soon(&since_ns, frame.t_ns, "a descriptor");
    } while (frame.type != SCANHEAD_DESCRIPTOR || scanhead_has_waves(sh) != has);
    for (int lines = 0; lines < 2; lines += frame.type == SCANHEAD_LINE_END) {
        client_next(sh, &frame);
        n += frame.type == SCANHEAD_WAVES;
    }
    return n;
}

/* A client switches waveforms off and on again while the head scans. The descriptor says so where it happens. */
static void test_switched(void **state)
{
    struct wire *wire = *state;
    struct room_config scan = SCAN;
    char config[352];
    room_write(wire);
    scan.links = LINK_YAML_TCP;
    scan.frames = 0;
    snprintf(config, sizeof config, "%s", room_config_write(wire, &scan));
    struct head head = head_start(wire, config, (const char *const[]){"--set", "waveform.send=on", "--start", NULL});
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    assert_true(count_waves(sh, 1) > 0);
    assert_string_equal(client_ask(sh, "SCAN:WAV OFF"), "OK");
    assert_int_equal(count_waves(sh, 0), 0);
    assert_string_equal(client_ask(sh, "SCAN:WAV ON"), "OK");
    assert_true(count_waves(sh, 1) > 0);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* In UTM the head stands at the anchor. A window's direction, times the range of its pulse's echo, leads to the point.
 * Over the room's 9 m the ellipsoid falls away by 6 um. Floats leave 0.5 um, counts of coordinates 1 um. */
static void test_directions(void **state)
{
    struct wire *wire = *state;
    static struct scanhead_point point[POINTS];
    static struct scanhead_wave wave[WINDOWS];
    struct scanhead_info info;
    struct scanhead_frame frame, points = {0};
    uint32_t n = 0;
    room_write(wire);
    record(wire, &SCAN, "utm.shs",
           (const char *const[]){"waveform.send=on", "output.layout=geo", "output.crs=utm", "stations.0.lat_deg=48.2",
                                 "stations.0.lon_deg=6.1", "stations.0.height_m=300", NULL});
    struct scanhead *sh = client_open(wire_path(wire, "utm.shs"));
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        if (frame.type == SCANHEAD_POINTS) {
            points = frame;
            assert_int_equal(scanhead_points(sh, &frame, 0, point, POINTS), frame.n_points);
        }
        if (frame.type != SCANHEAD_WAVES) continue;
        assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_OK);
        const int windows = scanhead_waves(sh, &frame, 0, wave, WINDOWS);
        for (int i = 0; i < windows; i++, n++) {
            const struct scanhead_point *p = &point[wave[i].pulse - points.pulse0]; /* one echo each */
            const double *d = wave[i].direction,
                         at[3] = {p->x - info.anchor[0], p->y - info.anchor[1], p->z - info.anchor[2]};
            const double range_m =
                sqrt((at[0] * at[0] + at[1] * at[1] + at[2] * at[2]) / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]));
            for (int a = 0; a < 3; a++)
                assert_true(fabs(at[a] - range_m * d[a]) < 1e-5);
        }
    }
    assert_true(n > 5000);
    scanhead_close(sh);
}

/* A recording that runs as a head sends the frames of waveforms on as they are. */
static void test_replayed(void **state)
{
    struct wire *wire = *state;
    char path[352], hash[2][65], stats[352];
    room_write(wire);
    record(wire, &SCAN, "on.shs", (const char *const[]){"waveform.send=on", NULL});
    stats_hash(wire, hash[0]);
    snprintf(path, sizeof path, "%s", wire_path(wire, "on.shs"));
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    const char *const args[] = {"run", path, "--start", "--pace", "fast", "--quiet", "--stats", stats, NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
    stats_hash(wire, hash[1]);
    assert_string_equal(hash[0], hash[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_off_and_on, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_energy, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_glass, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_echoes, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_lost, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_switched, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_directions, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_replayed, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
