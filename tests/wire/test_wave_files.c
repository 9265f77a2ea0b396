/* SPDX-License-Identifier: MIT */
/* Waveforms go from a configuration to files. The packet of each point in LAS, which a reader of its own takes from
 * the specification, and each row of .waves.csv are those of the stream. */
#include "tests/wire/python_rig.h"
#include "tests/wire/readers.h"

static const struct room_config SCAN = {.profile = "riegl-vz400i",
                                        .prr_hz = 100000,
                                        .lines_hz = 50,
                                        .pan_deg_s = 150,
                                        .pan_stop_deg = 6,
                                        .frames = 1,
                                        .links = "links: [{type: \"null\"}]\n",
                                        .more = "beam: {mode: adaptive}\nsignal: {model: on}\n"
                                                "waveform: {send: on}\n"};

enum { MOST = 60000, MOST_SAMPLES = 4000000 };
struct echo {
    uint64_t pulse;
    double xyz[3]; /* in the file's frame */
};
struct window {
    uint64_t pulse;
    uint32_t n, at;                  /* of its first sample in `sample` */
    double first[3], step_m, signal; /* the first sample's place in the file's frame; sum of all, in thresholds */
};
static struct echo echo[MOST];
static struct window window[MOST];
static uint16_t sample[MOST_SAMPLES];
static size_t n_echoes, n_windows, n_samples;
static struct scanhead_info info;

/* Turns the head's frame into the scene's, in the polar layout. */
static void to_file(const double p[3], double out[3])
{
    for (int i = 0; i < 3; i++) {
        out[i] = info.geo ? p[i] : info.station_m[i];
        for (int k = 0; k < 3 && !info.geo; k++)
            out[i] += info.rotation[3 * i + k] * p[k];
    }
}

static void keep_points(struct scanhead *sh, const struct scanhead_frame *frame)
{
    static struct scanhead_point point[4096];
    const int n = scanhead_points(sh, frame, 0, point, 4096);
    uint64_t pulse = frame->pulse0 - 1;
    assert_int_equal(n, frame->n_points);
    for (int i = 0; i < n; i++) {
        pulse += point[i].echo <= 1;
        if (point[i].echo_count == 0) continue;
        assert_true(n_echoes < MOST);
        echo[n_echoes].pulse = pulse;
        to_file((const double[]){point[i].x, point[i].y, point[i].z}, echo[n_echoes++].xyz);
    }
}

static void keep_windows(struct scanhead *sh, const struct scanhead_frame *frame)
{
    static struct scanhead_wave wave[2048];
    const int n = scanhead_waves(sh, frame, 0, wave, 2048);
    assert_int_equal(n, frame->n_points);
    for (int i = 0; i < n; i++) {
        struct window *w = &window[n_windows++];
        double p[3];
        assert_true(n_windows <= MOST && n_samples + wave[i].n <= MOST_SAMPLES);
        for (int k = 0; k < 3; k++) /* in the geo layout the anchor is the station */
            p[k] = (info.geo ? info.anchor[k] : 0) + wave[i].range_m * wave[i].direction[k];
        *w = (struct window){wave[i].pulse, wave[i].n, (uint32_t)n_samples, .step_m = wave[i].step_m};
        to_file(p, w->first);
        for (uint32_t k = 0; k < w->n; k++) {
            sample[n_samples++] = (uint16_t)(wave[i].sample[2 * k] | wave[i].sample[2 * k + 1] << 8);
            w->signal += scanhead_wave_signal(&wave[i], k);
        }
    }
}

static void read_stream(const char *path)
{
    struct scanhead_frame frame;
    struct scanhead *sh = client_open(path);
    n_echoes = n_windows = n_samples = 0;
    while (scanhead_next(sh, &frame, -1) == 0) {
        if (frame.type != SCANHEAD_POINTS && frame.type != SCANHEAD_WAVES) continue;
        assert_int_equal(scanhead_get_info(sh, &info), 0);
        if (frame.type == SCANHEAD_POINTS) keep_points(sh, &frame);
        if (frame.type == SCANHEAD_WAVES) keep_windows(sh, &frame);
    }
    scanhead_close(sh);
    size_t n_more = 0;
    for (size_t i = 1; i < n_echoes; i++)
        n_more += echo[i].pulse == echo[i - 1].pulse;
    assert_true(n_echoes > 1000 && n_windows > 1000 && n_more > 10);
}

/* Returns the text that the reader prints of a LAS file. */
static char *read_las(const char *las)
{
    char script[PATH_MAX], path[352], text[352];
    if (realpath("tests/readers/las_waves.py", script) == NULL) fail_msg("tests/readers/las_waves.py is not there");
    snprintf(path, sizeof path, "%s", wire_path(wire, las));
    snprintf(text, sizeof text, "%s", wire_path(wire, "read.txt"));
    const char *const args[] = {script, path, text, NULL};
    wire_run_program(wire, python, args, 0);
    return wire_read(text, NULL);
}

static double far_from(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
}

/* Returns whether the samples of one line are those of the window; it may be filled up behind them. */
static int has_samples(const struct window *w, const char *at, unsigned n)
{
    if (n < w->n) return 0;
    for (uint32_t k = 0; k < w->n; k++) {
        char *end;
        if (strtoul(at, &end, 10) != sample[w->at + k]) return 0;
        at = end;
    }
    return 1;
}

/* Checks one line of the reader: echo i of the stream with one of its pulse's windows, in which it lies. *w moves on
 * to the pulse's first window. tolerance_m: of the first sample's place. */
static void check_line(const char *line, size_t i, size_t *w, double tolerance_m)
{
    double p[3], first[3], signal;
    unsigned index, n, spacing_ps;
    int used;
    while (*w < n_windows && window[*w].pulse < echo[i].pulse)
        ++*w;
    assert_int_equal(sscanf(line, "%lf %lf %lf %u %lf %lf %lf %u %u %lf%n", &p[0], &p[1], &p[2], &index, &first[0],
                            &first[1], &first[2], &n, &spacing_ps, &signal, &used),
                     10);
    assert_int_equal(spacing_ps, 1000);
    assert_true(far_from(p, echo[i].xyz) < 1e-3); /* counts of the file: half a millimetre on each axis */
    for (size_t k = *w; k < n_windows && window[k].pulse == echo[i].pulse; k++) {
        if (!has_samples(&window[k], line + used, n) || far_from(first, window[k].first) > tolerance_m) continue;
        const double along = far_from(p, window[k].first) / window[k].step_m;
        assert_true(along < window[k].n);
        /* Samples that fill a packet up are the baseline, a whole number of counts here. */
        assert_true(fabs(signal - window[k].signal) <= 1e-9 * fabs(window[k].signal) + 1e-9);
        return;
    }
    fail_msg("point %zu has no window of its pulse %llu: %.200s", i, (unsigned long long)echo[i].pulse, line);
}

/* Checks all lines of the reader. The first sample's place has the error of the point that it is computed from. */
static void check_las(const char *name, double tolerance_m)
{
    char *text = read_las(name), *at = text, *end;
    size_t n = 0, w = 0;
    for (; (end = strchr(at, '\n')) != NULL; at = end + 1, n++) {
        *end = '\0';
        assert_true(n < n_echoes);
        check_line(at, n, &w, tolerance_m);
    }
    assert_int_equal(n, n_echoes);
    free(text);
}

/* Rows are the stream's windows, in order. */
static void check_csv(void)
{
    char *text = wire_read(wire_path(wire, "a.waves.csv"), NULL), *at = strchr(text, '\n') + 1, *end;
    size_t n = 0;
    for (; (end = strchr(at, '\n')) != NULL; at = end + 1, n++) {
        unsigned long long pulse;
        double t_s, range_m, step_m, baseline, count_signal, d[3];
        unsigned n_in_row;
        int used;
        *end = '\0';
        assert_true(n < n_windows);
        assert_int_equal(sscanf(at, "1,1,%llu,%lf,%lf,%lf,%u,%lf,%lf,%lf,%lf,%lf,%n", &pulse, &t_s, &range_m, &step_m,
                                &n_in_row, &baseline, &count_signal, &d[0], &d[1], &d[2], &used),
                         10);
        assert_int_equal(pulse, window[n].pulse);
        assert_int_equal(n_in_row, window[n].n);
        assert_true(has_samples(&window[n], at + used, n_in_row));
    }
    assert_int_equal(n, n_windows);
    free(text);
}

/* A board stands before the wall. The board's edges cut footprints, so some pulses have two returns. */
static void write_scene(void)
{
    room_write(wire);
    FILE *f = fopen(wire_path(wire, "room.obj"), "a");
    assert_non_null(f);
    fputs("v 1.5 1.5 -1.4\nv 1.6 1.5 -1.4\nv 1.6 1.5 2.5\nv 1.5 1.5 2.5\no board\nf 9 10 11 12\n", f);
    assert_int_equal(fclose(f), 0);
}

static void record_all(const char *keys)
{
    char config[352], path[4][352];
    static const char *const name[] = {"a.shs", "in.las", "a.waves.csv", "out.las"};
    write_scene();
    snprintf(config, sizeof config, "%s", room_config_write(wire, &SCAN));
    for (int i = 0; i < 4; i++)
        snprintf(path[i], sizeof path[i], "%s", wire_path(wire, name[i]));
    wire_run(wire,
             (const char *const[]){"record", config, "--quiet", "--set", keys, "--set", "output.crs=local", "-o",
                                   path[0], "-o", path[1], "-o", path[2], NULL},
             0);
    wire_run(wire,
             (const char *const[]){"record", path[0], "--quiet", "--wdp", "--colour", "label", "-o", path[3], NULL}, 0);
}

static void check_layout(const char *keys)
{
    need_python();
    record_all(keys);
    read_stream(wire_path(wire, "a.shs"));
    /* A point is half a count wrong on each axis, and so is the sample's place: sqrt(3) / 2 of the scale, at most 1
     * mm. */
    check_las("in.las", 1e-3);
    check_las("out.las", 1e-3);
    assert_int_equal(access(wire_path(wire, "out.wdp"), F_OK), 0);
    assert_int_equal(access(wire_path(wire, "in.wdp"), F_OK), -1);
    check_csv();
}

static void test_polar(void **state)
{
    wire = *state;
    check_layout("output.layout=polar");
}

static void test_geo(void **state)
{
    wire = *state;
    check_layout("output.layout=geo");
}

/* npm's reader takes the points of formats 9 and 10 as they are. */
static void test_npm(void **state)
{
    static const char *const name[] = {"in.las", "out.las"};
    wire = *state;
    record_all("output.layout=polar");
    read_stream(wire_path(wire, "a.shs"));
    for (int i = 0; i < 2; i++) {
        char las[352], xyz[352];
        snprintf(las, sizeof las, "%s", wire_path(wire, name[i]));
        snprintf(xyz, sizeof xyz, "%s", wire_path(wire, "las.xyz"));
        run_reader("las.mjs", las, xyz);
        char *text = wire_read(xyz, NULL), *at = strchr(strchr(text, '\n') + 1, '\n') + 1;
        assert_int_equal(strtoull(text, NULL, 10), n_echoes);
        for (size_t k = 0; k < n_echoes; k++) {
            double p[3];
            for (int axis = 0; axis < 3; axis++)
                p[axis] = strtod(at, &at);
            assert_true(far_from(p, echo[k].xyz) < 1e-3);
        }
        free(text);
    }
}

/* --wdp is for LAS 1.4. */
static void test_options(void **state)
{
    static const struct {
        const char *args[6], *says;
    } cases[] = {{{"-o", "a.ply"}, "--wdp: no .las is among the files"},
                 {{"-o", "a.las", "--las-version", "1.2"}, "--wdp: LAS 1.2 has no waveforms"}};
    wire = *state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const char *args[12] = {"record", "a.shs", "--wdp"};
        for (int k = 0; k < 6; k++)
            args[3 + k] = cases[i].args[k];
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 2);
        char *said = wire_read(wire_path(wire, "err"), NULL);
        if (strstr(said, cases[i].says) == NULL) fail_msg("case %zu: %s", i, said);
        free(said);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_polar, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_geo, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_npm, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_options, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
