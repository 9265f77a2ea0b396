/* SPDX-License-Identifier: MIT */
/* Colours from the configuration to the files, through the real program. Texels are exact, and the smallest and the
 * largest figure are at the ends of the ramp. Each format has the same colours, and the points are the same with
 * colours and without. */
#include "core/colour.h"
#include "tests/common/chart.h"
#include "tests/wire/readers.h"

#include <math.h>

enum { MOST = 60000, MOST_ARGS = 40 };

/* Vertices of the PLY that was read last. */
static struct vertex {
    double p[3], range_m;
    int rgb[3];
} vertex[MOST];
static int n_vertices;

static int set_up(void **state)
{
    int rc = wire_setup(state);
    return rc == 0 ? chart_make_folder(state) : rc;
}

static int tear_down(void **state)
{
    *state = wire;
    chart_remove_folder(state);
    return wire_teardown(state);
}

/* The board is 10 m before the head and has the chart as PNG. There is a floor without texture and colour. */
static void write_config(const char *more)
{
    char text[2048], mesh[256];
    scene_free(chart_load_board("chart.png", "", 10.0,
                                "v -9 1 -2\nv 9 1 -2\nv 9 20 -2\nv -9 20 -2\nusemtl none\nf 5 6 7 8\n"));
    snprintf(mesh, sizeof mesh, "%s", chart_path("board.obj"));
    snprintf(text, sizeof text,
             "head: {profile: full-sweep, prr_hz: 20000, lines_hz: 25, pan_deg_s: 20, frames: 1, line_start_deg: -12,\n"
             "       line_stop_deg: 12, pan_start_deg: 0, pan_stop_deg: 24}\n"
             "scene: {meshes: [{file: %s, up: z, scale: 1}]}\n"
             "stations: [{position_m: [0, 0, 0], heading_deg: 348}]\n"
             "noise: {range: off}\n%s",
             mesh, more);
    wire_write_text(wire, "config.yaml", text);
}

/* Records with these words of a command line, which end with NULL. Words of files are paths in the folder. Returns the
 * status. */
static int record(const char *source, const char *const *words, const char *const *files)
{
    static char path[8][352];
    char from[352];
    const char *args[MOST_ARGS] = {"record", from, "--quiet"};
    int n = 3, k = 0, ascii = 0;
    snprintf(from, sizeof from, "%s", wire_path(wire, source));
    for (int i = 0; words != NULL && words[i] != NULL; i++)
        args[n++] = words[i];
    for (int i = 0; files[i] != NULL; i++) {
        snprintf(path[k], sizeof path[k], "%s", wire_path(wire, files[i]));
        args[n++] = strcmp(files[i] + strlen(files[i]) - 5, ".json") == 0 ? "--stats" : "-o";
        args[n++] = path[k++];
        ascii |= strcmp(files[i] + strlen(files[i]) - 4, ".ply") == 0;
    }
    args[n] = ascii ? "--ascii" : NULL;
    return wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
}

#define FILES(...) ((const char *const[]){__VA_ARGS__, NULL})
#define WORDS(...) ((const char *const[]){__VA_ARGS__, NULL})

/* The columns are x y z range reflectance time echo count label station red green blue. Returns the header's text of
 * colours. */
static char *read_ply(const char *name, int coloured)
{
    char *text = wire_read(wire_path(wire, name), NULL), *at = strstr(text, "end_header\n");
    assert_non_null(at);
    n_vertices = 0;
    for (at += 11; *at != 0; n_vertices++) {
        struct vertex *v = &vertex[n_vertices];
        int used = 0;
        assert_true(n_vertices < MOST);
        assert_int_equal(
            sscanf(at, "%lf %lf %lf %lf %*s %*s %*s %*s %*s %*s%n", &v->p[0], &v->p[1], &v->p[2], &v->range_m, &used),
            4);
        at += used;
        used = 0;
        if (coloured) assert_int_equal(sscanf(at, "%d %d %d%n", &v->rgb[0], &v->rgb[1], &v->rgb[2], &used), 3);
        at = strchr(at, '\n') + 1;
    }
    assert_true(n_vertices > 1000);
    return text;
}

static int is_rgb(const struct vertex *v, const uint8_t want[3])
{
    return v->rgb[0] == want[0] && v->rgb[1] == want[1] && v->rgb[2] == want[2];
}

/* Recorded positions are good to a micrometre, and a texel is 98 mm wide. */
static void check_texels(void)
{
    static const enum texture_wrap wrap[2] = {TEXTURE_REPEAT, TEXTURE_REPEAT};
    int n = 0, floor = 0, column, row;
    for (int i = 0; i < n_vertices; i++) {
        const struct vertex *v = &vertex[i];
        if (fabs(v->p[1] - 10.0) > 1e-4) {
            assert_true(is_rgb(v, colour_grey));
            floor++;
            continue;
        }
        const double u = CHART_U0 + (CHART_U1 - CHART_U0) * (v->p[0] + 2.0) / 4.0;
        const double t = CHART_V0 + (CHART_V1 - CHART_V0) * (v->p[2] + 2.0) / 4.0;
        if (chart_is_near(u, CHART_WIDE) || chart_is_near(t, CHART_HIGH)) continue;
        assert_true(chart_texel_of(u, t, wrap, &column, &row));
        if (!is_rgb(v, chart[row][column]))
            fail_msg("u %.6f, v %.6f: texel %d, %d has another colour", u, t, column, row);
        n++;
    }
    assert_true(n > 1000 && floor > 100);
}

/* The colours that web-e57 reads, and those of the grid, are the same in the same order. */
static void check_other_formats(void)
{
    char *text = wire_read(wire_path(wire, "t.ptx"), NULL), *at = text;
    for (int i = 0; i < 10; i++)
        at = strchr(at, '\n') + 1;
    int n = 0, rgb[3];
    for (; *at != 0; at = strchr(at, '\n') + 1) {
        if (strncmp(at, "0 0 0 0.5 0 0 0\n", 16) == 0) continue;
        assert_int_equal(sscanf(at, "%*s %*s %*s %*s %d %d %d\n", &rgb[0], &rgb[1], &rgb[2]), 3);
        assert_memory_equal(rgb, vertex[n++].rgb, sizeof rgb);
    }
    assert_int_equal(n, n_vertices);
    free(text);
    run_reader("e57.mjs", wire_path(wire, "t.e57"), wire_path(wire, "t.xyz")); /* skips where it is not installed */
    text = wire_read(wire_path(wire, "t.xyz"), NULL);
    n = 0;
    for (at = text; *at != 0; at += strcspn(at, "\n") + 1) {
        assert_int_equal(sscanf(at, "%*s %*s %*s %d %d %d", &rgb[0], &rgb[1], &rgb[2]), 3);
        assert_memory_equal(rgb, vertex[n++].rgb, sizeof rgb);
        if (strchr(at, '\n') == NULL) break;
    }
    assert_int_equal(n, n_vertices);
    free(text);
}

static void test_texture(void **state)
{
    static struct vertex plain[MOST];
    char with[65], without[65];
    wire = *state;
    write_config("");
    assert_int_equal(record("config.yaml", NULL, FILES("n.ply", "stats.json")), 0);
    stats_hash(wire, without);
    free(read_ply("n.ply", 0));
    memcpy(plain, vertex, sizeof plain);
    const int n = n_vertices;
    assert_int_equal(
        record("config.yaml", WORDS("--colour", "texture"), FILES("t.ply", "t.ptx", "t.e57", "t.shs", "stats.json")),
        0);
    stats_hash(wire, with);
    assert_string_not_equal(with, without); /* colours are in the hash */
    char *text = read_ply("t.ply", 1);
    assert_int_equal(n_vertices, n);
    for (int i = 0; i < n; i++)
        assert_memory_equal(vertex[i].p, plain[i].p, sizeof plain[i].p);
    check_texels();
    static const char *const threads[] = {"1", "3"};
    for (int i = 0; i < 2; i++) {
        char hash[65];
        assert_int_equal(
            record("config.yaml", WORDS("--colour", "texture", "--threads", threads[i]), FILES("stats.json")),
            2); /* no file can have colours */
        assert_int_equal(record("config.yaml", WORDS("--set", "output.colour=texture", "--threads", threads[i]),
                                FILES("stats.json")),
                         0);
        stats_hash(wire, hash);
        assert_string_equal(hash, with);
    }
    /* A recorded stream has its colours, and an option overrides them. */
    assert_int_equal(record("t.shs", NULL, FILES("again.ply")), 0);
    char *again = wire_read(wire_path(wire, "again.ply"), NULL);
    assert_string_equal(strstr(again, "end_header"), strstr(text, "end_header"));
    assert_int_equal(record("t.shs", WORDS("--colour", "none"), FILES("again.ply")), 0);
    free(read_ply("again.ply", 0));
    free(text);
    free(again);
    free(read_ply("t.ply", 1));
    check_other_formats();
}

/* The nearest point is blue and the farthest red, as the file says. The colours are so by --colour, by the
 * configuration, and again from the stream. */
static void test_own_limits(void **state)
{
    wire = *state;
    write_config("");
    assert_int_equal(record("config.yaml", WORDS("--colour", "range"), FILES("a.ply", "a.las")), 0);
    char *a = read_ply("a.ply", 1);
    double low = INFINITY, high = 0.0, told_low, told_high;
    for (int i = 0; i < n_vertices; i++) {
        low = fmin(low, vertex[i].range_m);
        high = fmax(high, vertex[i].range_m);
    }
    for (int i = 0; i < n_vertices; i++) {
        uint8_t rgb[3];
        colour_between(low, high, vertex[i].range_m, rgb);
        for (int c = 0; c < 3; c++) /* the text has whole micrometres */
            assert_true(abs(vertex[i].rgb[c] - rgb[c]) <= 1);
        if (vertex[i].range_m == low) assert_true(is_rgb(&vertex[i], (const uint8_t[]){0, 0, 255}));
        if (vertex[i].range_m == high) assert_true(is_rgb(&vertex[i], (const uint8_t[]){255, 0, 0}));
    }
    assert_int_equal(
        sscanf(strstr(a, "show the range, blue is "), "show the range, blue is %lf, red %lf m", &told_low, &told_high),
        2);
    assert_true(fabs(told_low - low) < 1e-6 && fabs(told_high - high) < 1e-6);
    assert_int_equal(record("config.yaml", WORDS("--set", "output.colour=range"), FILES("b.ply", "b.shs")), 0);
    char *b = wire_read(wire_path(wire, "b.ply"), NULL);
    assert_string_equal(a, b);
    free(b);
    assert_int_equal(record("b.shs", WORDS("--colour", "range"), FILES("b.ply")), 0);
    b = wire_read(wire_path(wire, "b.ply"), NULL);
    assert_string_equal(a, b);
    free(b);
    free(a);
}

/* In a stream limits are fixed: the head's ranges, which reach so far that all is blue here; the scene's bounds, from
 * -2 to 2 m; or given ones. */
static void test_stated_limits(void **state)
{
    wire = *state;
    write_config("");
    assert_int_equal(record("config.yaml", WORDS("--set", "output.colour=range"), FILES("r.shs")), 0);
    assert_int_equal(record("r.shs", NULL, FILES("r.ply")), 0);
    free(read_ply("r.ply", 1));
    for (int i = 0; i < n_vertices; i++)
        assert_true(vertex[i].rgb[0] == 0 && vertex[i].rgb[2] > 128);
    for (int given = 0; given < 2; given++) {
        const double high = given ? 6.0 : 2.0;
        const char *const limits[] = {"head.frames=1", "output.colour_limits=[-2, 6]"};
        assert_int_equal(record("config.yaml", WORDS("--set", "output.colour=height", "--set", limits[given]),
                                FILES("h.ply", "h.shs")),
                         0);
        if (!given) assert_int_equal(record("h.shs", NULL, FILES("h.ply")), 0);
        free(read_ply("h.ply", 1));
        for (int i = 0; i < n_vertices; i++) {
            uint8_t rgb[3];
            colour_between(-2.0, high, vertex[i].p[2], rgb);
            for (int c = 0; c < 3; c++)
                assert_true(abs(vertex[i].rgb[c] - rgb[c]) <= 1);
        }
    }
}

/* The head sends the colours that a recording computes from the same points. On the ramp they may differ by a step, as
 * the stream has micrometres and 0.01 dB. */
static void test_sent_and_made(void **state)
{
    static const struct {
        const char *set[2], *option[5];
        int off;
    } cases[] = {
        {{"output.colour=solid", "output.colour_rgb=[9, 200, 77]"},
         {"--colour", "solid", "--colour-rgb", "9,200,77"},
         0},
        {{"output.colour=label", "head.frames=1"}, {"--colour", "label"}, 0},
        {{"output.colour=reflectance", "signal.model=on"}, {"--colour", "reflectance", "--set", "signal.model=on"}, 0},
        {{"output.colour=range", "output.colour_limits=[3, 12]"}, {"--colour", "range", "--colour-limits", "3,12"}, 1},
    };
    static struct vertex sent[MOST];
    wire = *state;
    write_config("");
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        assert_int_equal(
            record("config.yaml", WORDS("--set", cases[k].set[0], "--set", cases[k].set[1]), FILES("s.ply")), 0);
        free(read_ply("s.ply", 1));
        memcpy(sent, vertex, sizeof sent);
        const int n = n_vertices;
        assert_int_equal(record("config.yaml", cases[k].option, FILES("m.ply")), 0);
        free(read_ply("m.ply", 1));
        assert_int_equal(n_vertices, n);
        int differ = 0;
        for (int i = 0; i < n; i++) {
            for (int c = 0; c < 3; c++)
                if (abs(sent[i].rgb[c] - vertex[i].rgb[c]) > cases[k].off)
                    fail_msg("case %zu, point %d: %d, not %d", k, i, sent[i].rgb[c], vertex[i].rgb[c]);
            differ += memcmp(sent[i].rgb, vertex[0].rgb, sizeof sent[i].rgb) != 0;
        }
        assert_int_equal(differ > 100, k != 0); /* only the first case has one colour for all */
    }
}

/* Wrong words on the command line end with status 2 and the allowed ones. */
static void test_refused(void **state)
{
    static const struct {
        const char *words[5], *says;
    } cases[] = {
        {{"--colour", "red"}, "allowed are none, solid, range, height, reflectance, label, frame, texture"},
        {{"--colour", "solid"}, "--colour solid needs --colour-rgb R,G,B"},
        {{"--colour-rgb", "1,2,3"}, "--colour-rgb needs --colour solid"},
        {{"--colour", "solid", "--colour-rgb", "1,2,256"}, "three whole numbers from 0 to 255"},
        {{"--colour", "solid", "--colour-rgb", "1,2,3,4"}, "three whole numbers from 0 to 255"},
        {{"--colour", "range", "--colour-limits", "5,5"}, "the second one above the first"},
        {{"--colour", "range", "--colour-limits", "0,nan"}, "the second one above the first"},
        {{"--colour", "label", "--colour-limits", "0,5"}, "--colour-limits needs --colour range, height or frame"},
        {{"--colour", "frame"}, "it needs platform.kind trajectory or stops"},
        {{"--set", "output.colour=frame"}, "allowed with trajectory, stops"},
        {{"--set", "output.colour=pink"}, "allowed none, solid, range"},
        {{"--set", "output.colour_rgb=[1, 2, 3]"}, "allowed only with colour: solid"},
        {{"--set", "output.colour_limits=[1, 2]"}, "allowed only with colour: range, height, frame"},
        {{"--set", "output.colour_limits=[1, 2, 3]"}, "allowed [low, high], each"},
    };
    wire = *state;
    write_config("");
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        assert_int_equal(record("config.yaml", cases[i].words, FILES("x.ply")), 2);
        char *text = wire_read(wire_path(wire, "err"), NULL);
        if (strstr(text, cases[i].says) == NULL) fail_msg("case %zu: %s", i, text);
        free(text);
    }
    assert_int_equal(record("config.yaml", WORDS("--colour", "label"), FILES("x.shs")), 2);
    assert_int_equal(access(wire_path(wire, "x.ply"), F_OK), -1);
}

/* An error about a part has the name of that part. A file may have 512 or 1024 bytes here, by the shell, so that
 * there is no room to keep its frames. The messages don't go to a file at once: that would cut them off. */
static void test_names_of_parts(void **state)
{
    (void)state;
    char from[352], to[352];
    write_config("");
    snprintf(from, sizeof from, "%s", wire_path(wire, "config.yaml"));
    snprintf(to, sizeof to, "%s", wire_path(wire, "part.ply"));
    static const char script[] =
        "said=$(ulimit -f 1; exec \"$0\" record \"$1\" --split --colour range --quiet -o \"$2\" 2>&1)\n"
        "status=$?; echo \"$said\" >&2; exit $status";
    const char *const words[] = {"-c", script, wire_program(), from, to, NULL};
    assert_int_not_equal(wire_wait(wire, wire_spawn_program(wire, "/bin/sh", words, "out", "err", -1)), 0);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(err, "part-1.ply: cannot keep the frames"));
    free(err);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_texture),       cmocka_unit_test(test_own_limits), cmocka_unit_test(test_stated_limits),
        cmocka_unit_test(test_sent_and_made), cmocka_unit_test(test_refused),    cmocka_unit_test(test_names_of_parts),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
