/* SPDX-License-Identifier: MIT */
/* scanhead plan, through the program: rows and keys, the method by tolerance and extent, stations that differ, and
 * impossible demands. */
#include "tests/wire/room.h"

static char *plan(struct wire *wire, const char *const *args, int status)
{
    wire_run(wire, args, status);
    return wire_read(wire_path(wire, status == 0 ? "out" : "err"), NULL);
}

/* The ground has 600 by 600 m, with a station in its middle and one in its corner. Points are up to 430 m and 860 m
 * away, within the head's 1000 m. */
static const char *set_up_with(struct wire *wire, const char *profile)
{
    char text[1024];
    wire_write_text(wire, "room.obj",
                    "v -300 -300 -1.7\nv 300 -300 -1.7\nv 300 300 -1.7\nv -300 300 -1.7\n"
                    "o ground\nusemtl grass\nf 1 2 3 4\n");
    static char path[256];
    snprintf(text, sizeof text,
             "head: {profile: %s, prr_hz: 100000, lines_hz: 50, pan_deg_s: 100, frames: 1}\n"
             "scene:\n  meshes:\n    - {file: room.obj, up: z, scale: 1}\n"
             "  anchor: {source: explicit, lat_deg: 52.5, lon_deg: 13.4, height_m: 100}\n"
             "stations:\n  - {name: middle, position_m: [0, 0, 0]}\n"
             "  - {name: corner, position_m: [299, 299, 0]}\n"
             "links: [{type: \"null\"}]\noutput: {crs: utm, layout: geo}\n",
             profile);
    const char *config = wire_write_text(wire, "config.yaml", text);
    snprintf(path, sizeof path, "%s", config); /* wire_path uses its room again */
    return path;
}

static const char *set_up(struct wire *wire)
{
    return set_up_with(wire, "full-sweep");
}

/* This is the same head without a footprint. `plan` then tries no beams, and that saves four fifths of its time here.
 * Georef and sight are chosen as before. */
static const char *set_up_without_footprint(struct wire *wire)
{
    char *text = wire_read("config/heads/full-sweep.yaml", NULL);
    static const char *const keys[] = {"beam_exit_m: { value: ", "beam_divergence_rad: { value: "};
    for (int i = 0; i < 2; i++) {
        char *at = strstr(text, keys[i]);
        assert_non_null(at);
        at += strlen(keys[i]);
        memset(at, '0', 1);
        memset(at + 1, ' ', strcspn(at + 1, ","));
    }
    wire_write_text(wire, "narrow.yaml", text);
    free(text);
    return set_up_with(wire, "narrow.yaml");
}

/* Returns the nth object with that stage, up to its end. */
static char *row(const char *json, const char *stage, int n)
{
    char key[64];
    snprintf(key, sizeof key, "\"stage\": \"%s\"", stage);
    const char *at = json;
    for (; n >= 0; n--, at++)
        if ((at = strstr(at, key)) == NULL) return NULL;
    return strndup(at - 1, strcspn(at - 1, "}"));
}

static double number_of(const char *text, const char *key)
{
    const char *at = strstr(text, key);
    if (at == NULL) fail_msg("no %s in %s", key, text);
    return strtod(at + strlen(key), NULL);
}

static void expect_row(const char *json, const char *stage, int n, const char *method, double most_m, const char *why)
{
    char want[64], *text = row(json, stage, n);
    if (text == NULL) fail_msg("no row %d of %s in %s", n, stage, json);
    snprintf(want, sizeof want, "\"method\": \"%s", method);
    if (strstr(text, want) == NULL || strstr(text, why) == NULL || !(number_of(text, "\"error_m\": ") <= most_m))
        fail_msg("%s, row %d: %s", stage, n, text);
    assert_non_null(strstr(text, "\"cost_ns\": "));
    free(text);
}

/* The error of order n is a fraction of range^(n+1) / R^n with R = 6400 km. At 430 m that is 0.03 m for order 1 and
 * 2 um for order 2. At 860 m it is 16 um for order 2 and 2 nm for order 3. */
static void test_method_by_tolerance(void **state)
{
    struct wire *wire = *state;
    const char *config = set_up_without_footprint(wire);
    static const struct {
        const char *set, *method, *why;
        double most_m;
    } cases[] = {{"output.tolerance_m=1e-7", "order3", "all stations: the cheapest that meets the tolerance", 1e-7},
                 {"output.tolerance_m=0.001", "order2", "all stations: the cheapest that meets the tolerance", 1e-3},
                 {"output.tolerance_m=1", "order1", "all stations: the cheapest that meets the tolerance", 1.0},
                 {"output.georef=exact", "exact", "asked for by output.georef", 1e-7},
                 {"output.georef=order3", "order3", "asked for by output.georef", 1e-7},
                 {"output.crs=ecef", "rotation", "ECEF is a rotation", 1e-8},
                 {"output.crs=local", "none", "points stay in the scene frame", 0.0},
                 {"output.layout=polar", "none", "output.layout is polar", 0.0}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const char *const args[] = {"plan", config, "--json", "--set", cases[i].set, NULL};
        char *json = plan(wire, args, 0);
        assert_int_equal(json[0], '[');
        expect_row(json, "cast", 0, "packets of ", 1e-6, "in double");
        expect_row(json, "georef", 0, cases[i].method, cases[i].most_m, cases[i].why);
        char *second = row(json, "georef", 1);
        if (second != NULL) fail_msg("%s: %s", cases[i].set, second);
        free(json);
    }
}

static void test_stations_that_differ(void **state)
{
    struct wire *wire = *state;
    const char *config = set_up_without_footprint(wire);
    const char *const args[] = {"plan", config, "--json", "--set", "output.tolerance_m=4e-6", NULL};
    char *json = plan(wire, args, 0);
    expect_row(json, "georef", 0, "order2", 4e-6, "station 1 middle");
    expect_row(json, "georef", 1, "order3", 4e-6, "station 2 corner");
    free(json);
}

/* The table for people has the same rows. */
static void test_text(void **state)
{
    struct wire *wire = *state;
    const char *config = set_up(wire);
    const char *const args[] = {"plan", config, NULL}, *const help[] = {"plan", "--help", NULL};
    static const char *const words[] = {"stage", "cast", "sight", "movers", "beam", "noise", "\ngeoref   order3"};
    char *text = plan(wire, args, 0);
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
        if (strstr(text, words[i]) == NULL) fail_msg("no %s in %s", words[i], text);
    free(text);
    text = plan(wire, help, 0);
    assert_non_null(strstr(text, "make chart"));
    free(text);
}

static void test_what_cannot_be(void **state)
{
    struct wire *wire = *state;
    const char *config = set_up(wire);
    const char *const args[] = {"plan", config, "--set", "output.georef=order5", NULL};
    char *text = plan(wire, args, 2);
    assert_non_null(strstr(text, "output.georef"));
    assert_non_null(strstr(text, "allowed exact"));
    assert_ptr_equal(strchr(text, '\n'), text + strlen(text) - 1);
    free(text);
}

/* The expected method of a stage; a method that is left out there, and words of the reason why. */
struct want {
    const char *stage, *method, *left_out, *why_left_out;
};

/* Plans the room with glass as its file has it, once for all tests of it. */
static const char *plan_of_glass(struct wire *wire)
{
    static char *json;
    const char *const args[] = {"plan", "config/glass.yaml", "--json", NULL};
    if (json == NULL) json = plan(wire, args, 0);
    return json;
}

static void expect_plan(struct wire *wire, const char *config, const struct want *want, size_t n)
{
    const char *const args[] = {"plan", config, "--json", NULL};
    const int is_glass = strcmp(config, "config/glass.yaml") == 0;
    char *json = is_glass ? strdup(plan_of_glass(wire)) : plan(wire, args, 0);
    for (size_t i = 0; i < n; i++) {
        char method[64], *text = row(json, want[i].stage, 0);
        if (text == NULL) fail_msg("%s: no row of %s in %s", config, want[i].stage, json);
        snprintf(method, sizeof method, "\"method\": \"%s\"", want[i].method);
        if (strstr(text, method) == NULL || strstr(text, "\"forced\": false") == NULL) fail_msg("%s: %s", config, text);
        free(text);
        if (want[i].left_out == NULL) continue;
        snprintf(method, sizeof method, "\"method\": \"%s\"", want[i].left_out);
        const char *stage = strstr(json, want[i].stage), *left = strstr(stage, method);
        if (left == NULL || strstr(left, want[i].why_left_out) == NULL ||
            strstr(left, want[i].why_left_out) > strchr(left, '}'))
            fail_msg("%s: %s is left out, but not because %s", config, want[i].left_out, want[i].why_left_out);
    }
    free(json);
}

/* Few edges and a tolerance of a centimetre give single rays. Leaves need more. Glass is followed as far as it
 * matters. */
static void test_three_plans(void **state)
{
    struct wire *wire = *state;
    static const struct want demo[] = {{"program", "600 kHz", NULL, NULL},
                                       {"beam", "single", "adaptive", "costs more"},
                                       {"optics", "none", NULL, NULL},
                                       {"signal", "none", NULL, NULL},
                                       {"georef", "order2", "order1", "its error is above the tolerance"}};
    static const struct want foliage[] = {{"program", "300 kHz", NULL, NULL},
                                          {"beam", "adaptive", "single", "its range error is above 0.005 m"},
                                          {"beam", "adaptive", "rings 12 (469 rays)", "costs more"},
                                          {"optics", "none", NULL, NULL},
                                          {"georef", "none", NULL, NULL}};
    static const struct want glass[] = {{"beam", "single", "adaptive", "costs more"},
                                        {"optics", "depth 3", "depth 1", "its range error is above"},
                                        {"optics", "depth 3", "depth 2", "get another echo count"},
                                        {"optics", "depth 3", "depth 4", "costs more"},
                                        {"signal", "range equation", NULL, NULL},
                                        {"noise", "gauss, by signal", NULL, NULL},
                                        {"georef", "rotation", NULL, NULL}};
    expect_plan(wire, "config/foliage.yaml", foliage, sizeof foliage / sizeof foliage[0]);
    expect_plan(wire, "config/glass.yaml", glass, sizeof glass / sizeof glass[0]);
    if (access("/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc", R_OK) != 0) {
        printf("# no house (package assimp-testmodels): the demo's plan is not looked at\n");
        skip();
    }
    expect_plan(wire, "config/demo.yaml", demo, sizeof demo / sizeof demo[0]);
}

/* Checks the row `sight`: its method, map or none, and words of the reason. */
static void expect_sight(struct wire *wire, const char *config, const char *const *sets, const char *const *sight)
{
    const char *const args[] = {"plan", config, "--json", "--set", sets[0], "--set", sets[1], NULL};
    char *json = plan(wire, args, 0), *text = row(json, "sight", 0), method[64];
    assert_non_null(text);
    snprintf(method, sizeof method, "\"method\": \"%s\"", sight[0]);
    if (strstr(text, method) == NULL || strstr(text, sight[1]) == NULL) fail_msg("%s %s: %s", config, sets[0], text);
    free(text);
    free(json);
}

static void test_sight(void **state)
{
    struct wire *wire = *state;
    char config[256];
    static const struct {
        const char *sets[2], *sight[2];
    } cases[] = {
        {{"cast.sight=on", "beam.mode=single"}, {"map", "forced by cast.sight"}},
        {{"cast.sight=off", "beam.mode=single"}, {"none", "forced by cast.sight"}},
        {{"instrument.mirror_offset_m=0.01", "head.frames=0"}, {"none", "moves the beam"}},
        {{"beam.mode=rings", "head.frames=0"}, {"none", "no ray for the centre"}},
        {{"head.frames=1", "head.pan_stop_deg=1"}, {"none", "too few: a map would cost"}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const int is_rings = strcmp(cases[i].sets[0], "beam.mode=rings") == 0;
        snprintf(config, sizeof config, "%s", is_rings ? set_up(wire) : set_up_without_footprint(wire));
        expect_sight(wire, config, cases[i].sets, cases[i].sight);
    }
}

/* The plan has the program of the set pulse rate, with its properties, and the other rates. */
static void test_program(void **state)
{
    struct wire *wire = *state;
    const char *const args[] = {"plan",  "config/foliage.yaml", "--json", "--set", "head.prr_hz=1200000",
                                "--set", "beam.mode=single", /* planned in a fifth of the time */
                                NULL};
    char *json = plan(wire, args, 0), *text = row(json, "program", 0);
    assert_non_null(text);
    assert_non_null(strstr(text, "\"method\": \"1200 kHz\""));
    assert_non_null(strstr(text, "4 echoes, 0.5 to 250 m, 500 kHz used; riegl-vz400i also has 100, 300, 600 kHz\""));
    free(text);
    free(json);
}

/* The methods that a run reports are the planned ones. A wider echo tolerance changes both. */
static void test_run_follows_plan(void **state)
{
    struct wire *wire = *state;
    static const struct {
        const char *set, *line;
    } cases[] = {{"cast.sight=on", "# plan: sight map; beam single; optics depth 3; georef rotation\n"},
                 {"optics.depth=1", "# plan: sight none; beam single; optics depth 1; georef rotation\n"},
                 {"plan.echo_tolerance=0.01", "# plan: sight none; beam single; optics depth 2; georef rotation\n"},
                 {"plan.tolerance_m=1e-6", "# plan: sight none; beam single; optics depth 3; georef rotation\n"}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char journal[256];
        const char *sight = i == 0 ? "beam.rings=4" : "cast.sight=off"; /* a sight may pay or not, by the machine */
        snprintf(journal, sizeof journal, "%s", wire_path(wire, "journal"));
        const char *const args[] = {"run",   "config/glass.yaml", "--start",   "--duration", "0.05",  "--pace",
                                    "fast",  "--quiet",           "--journal", journal,      "--set", cases[i].set,
                                    "--set", "beam.mode=single",  "--set",     sight,        NULL};
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
        char *text = wire_read(journal, NULL);
        if (strstr(text, cases[i].line) == NULL) fail_msg("%s: %s", cases[i].set, text);
        free(text);
    }
}

/* The example has one in eight of its leaves, and few sub-rays, so planning takes a fraction of the time. */
static const char *few_leaves(struct wire *wire)
{
    char *whole = wire_read("config/foliage.yaml", NULL), *text = calloc(1, 1 << 16), *rest = whole, here[1024], *line;
    static char path[256];
    assert_non_null(getcwd(here, sizeof here));
    for (unsigned leaves = 0; (line = strsep(&rest, "\n")) != NULL;) {
        char *file = strstr(line, "scenes/"), *end = text + strlen(text);
        if (strstr(line, "leaves.obj") != NULL && leaves++ % 8 != 0) continue;
        if (file == NULL)
            sprintf(end, "%s\n%s", line, strcmp(line, "beam:") == 0 ? "  rings: 1\n" : "");
        else
            sprintf(end, "%.*s%s/config/%s\n", (int)(file - line), line, here, file);
    }
    snprintf(path, sizeof path, "%s", wire_write_text(wire, "few.yaml", text));
    free(text);
    free(whole);
    return path;
}

/* Beams are tried on random pulses, but the same ones each time. */
static void test_same_plan_again(void **state)
{
    struct wire *wire = *state;
    const char *const args[] = {"plan", few_leaves(wire), "--json", "--set", "beam.mode=rings", NULL};
    char *json[2];
    for (int i = 0; i < 2; i++) {
        json[i] = plan(wire, args, 0);
        *strstr(json[i], "\"total\"") = '\0'; /* which is measured */
    }
    assert_string_equal(json[0], json[1]);
    free(json[0]);
    free(json[1]);
}

/* Forced methods have bounds, too, and the plan says whether they hold. */
static void test_forced(void **state)
{
    struct wire *wire = *state;
    const char *config = few_leaves(wire);
    static const struct {
        const char *set, *method, *why;
    } cases[] = {{"beam.mode=rings", "rings 1 (7 rays)", "forced by beam.mode; does not hold"},
                 {"beam.mode=adaptive", "adaptive", "forced by beam.mode; holds"},
                 {"beam.mode=single", "single", "forced by beam.mode; does not hold"}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const char *const args[] = {
            "plan", config, "--json", "--set", cases[i].set, "--set", "plan.echo_tolerance=0.002", NULL};
        char *json = plan(wire, args, 0), *text = row(json, "beam", 0), method[64];
        snprintf(method, sizeof method, "\"method\": \"%s\"", cases[i].method);
        if (strstr(text, method) == NULL || strstr(text, cases[i].why) == NULL ||
            strstr(text, "\"forced\": true") == NULL)
            fail_msg("%s: %s", cases[i].set, text);
        free(text);
        free(json);
    }
}

/* The plan chooses single rays for the room with glass. Forced, they are tried on the same pulses and have the same
 * error. The plan also casts footprints, to compare with them. The memory that these need changes nothing
 * else. */
static void test_forced_as_chosen(void **state)
{
    static const char *const keys[] = {"\"error_m\": ", "\"echo_share\": "};
    struct wire *wire = *state;
    double figure[2][2];
    for (int i = 0; i < 2; i++) {
        const char *const args[] = {"plan", "config/glass.yaml", "--json", "--set", "beam.mode=single", NULL};
        char *json = i == 0 ? strdup(plan_of_glass(wire)) : plan(wire, args, 0), *text = row(json, "beam", 0);
        assert_non_null(strstr(text, "\"method\": \"single\""));
        assert_non_null(strstr(text, i == 0 ? "\"forced\": false" : "\"forced\": true"));
        for (int k = 0; k < 2; k++)
            figure[i][k] = number_of(text, keys[k]);
        free(text);
        free(json);
    }
    assert_true(figure[0][0] > 0.0 && figure[0][1] > 0.0);
    assert_true(figure[0][0] == figure[1][0] && figure[0][1] == figure[1][1]);
}

/* Returns the share at the end of the last row's reason, in percent, and its cost. */
static double total_of(struct wire *wire, const char *config, const char *set, double *cost_ns)
{
    const char *const args[] = {"plan", config, "--json", "--set", set, "--set", "beam.rings=4", NULL};
    char *json = plan(wire, args, 0), *text = row(json, "total", 0);
    assert_non_null(text);
    assert_null(strstr(strstr(json, text) + 1, "\"stage\"")); /* the last row */
    assert_non_null(strstr(text, "\"method\": \"measured\""));
    assert_non_null(strstr(text, "\"error_m\": null"));
    assert_non_null(strstr(text, "\"echo_share\": null"));
    *cost_ns = number_of(text, "\"cost_ns\": ");
    double share = number_of(text, "need ");
    free(text);
    free(json);
    return share;
}

/* 61 rays cost at least 5 times one, on any machine. The head fires two fifths of its sweep at the ground. */
static void test_total(void **state)
{
    struct wire *wire = *state;
    char config[256];
    double single_ns, rings_ns;
    snprintf(config, sizeof config, "%s", set_up(wire));
    double single = total_of(wire, config, "beam.mode=single", &single_ns);
    double rings = total_of(wire, config, "beam.mode=rings", &rings_ns);
    printf("# 61 rays: %.0f ns, one: %.0f ns\n", rings_ns, single_ns);
    assert_true(isfinite(single_ns) && isfinite(rings_ns) && single_ns > 0.0 && single > 0.0);
    assert_true(rings_ns >= 5.0 * single_ns && rings >= 5.0 * single);
}

/* A thousand million rays per second on one thread are too many for any machine; 50,000 are few. */
static void test_run_warns(void **state)
{
    struct wire *wire = *state;
    char config[256];
    snprintf(config, sizeof config, "%s", set_up(wire));
    static const struct {
        const char *set[3];
        int warns;
    } cases[] = {{{"beam.mode=rings", "beam.rings=18", "head.prr_hz=1000000"}, 1},
                 {{"beam.mode=single", "beam.rings=1", "head.prr_hz=50000"}, 0}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const char *const args[] = {"run",   config,          "--duration", "0.05",          "--set", "loop.threads=1",
                                    "--set", cases[i].set[0], "--set",      cases[i].set[1], "--set", cases[i].set[2],
                                    NULL};
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
        char *text = wire_read(wire_path(wire, "err"), NULL), *at = strstr(text, "needs about");
        if ((at != NULL) != cases[i].warns) fail_msg("%s", text);
        if (at != NULL) assert_null(strstr(at + 1, "needs about"));
        free(text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_method_by_tolerance, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_stations_that_differ, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_text, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_three_plans, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_sight, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_program, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_run_follows_plan, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_forced, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_same_plan_again, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_total, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_run_warns, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_forced_as_chosen, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_what_cannot_be, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
