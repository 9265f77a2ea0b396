/* SPDX-License-Identifier: MIT */
/* The output of `scanhead coverage`: each figure stands under its name, as JSON and as text. No two figures are the
 * same, so exchanged ones show. */
#include <fcntl.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "firmware_sim/app/studio/coverage/coverage.h"
#include "firmware_sim/app/studio/coverage/next.h"
#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/config/config.h"

static struct config cfg = {.n_stations = 2};
static struct config_station *const named = cfg.station;
static struct site_station at[2];
static struct scene_surface surface[3];
static struct scene scene = {.n_surfaces = 3, .surface = surface};
static struct site site = {.cfg = &cfg, .scene = &scene, .station = at, .n_stations = 2};
static struct coverage_result_station station[2] = {{4.0, 3.0, {201, 202, 203, 204}}, {5.0, 1.5, {301, 302, 303, 304}}};
/* The second has the largest unseen area, and the third none that is seen. */
static struct coverage_of_label label[3] = {{10.0, 8.0, 2.0, 24}, {20.0, 5.0, 1.0, 35}, {4.0, 0.0, 0.0, 0}};
static struct coverage_result result = {.site = &site,
                                        .cell_m = 0.25,
                                        .sums = {.cells = 101,
                                                 .pieces = 102,
                                                 .triangles = 103,
                                                 .area_m2 = 40.0,
                                                 .duplicate_m2 = 1.25,
                                                 .silent_m2 = 2.25,
                                                 .none_m2 = 8.0,
                                                 .one_m2 = 12.0,
                                                 .several_m2 = 20.0,
                                                 .density_1_m2 = {11, 12, 13, 14},
                                                 .incidence_rad = {M_PI / 4, M_PI / 12, M_PI / 6, M_PI / 3},
                                                 .range_m = {21, 22, 23, 24}},
                                        .station = station,
                                        .label = label};

static struct coverage_next_place place[4] = {{{1, 2, 3}, 0, 1.5, 0.5, COVERAGE_PLACE_CHOSEN},
                                              {{4, 5, 6}, 90.5, NAN, 0.25, COVERAGE_PLACE_OPEN},
                                              {{7, 8, 9}, 0, 7.5, 0.125, COVERAGE_PLACE_WITHIN},
                                              {{1.5, 2.5, 3.5}, 10, 2, 1, COVERAGE_PLACE_OPEN}};
/* Estimates differ from scans by 0.5, 0.25, 1.5 and 0.125. */
static double estimate_m2[8] = {5.5, 3.75, 0, 1, 0, 0.5, 0, 0.125};
static struct coverage_next_round rounds[3] = {{2, {{0, 6.0, 5.0}, {1, 4.5, 4.0}}, 3.0},
                                               {2, {{1, 3.5, 2.0}, {3, 0.75, 0.25}}, 1.0}};
static struct coverage_next next = {.place = place,
                                    .n = 4,
                                    .within = 1,
                                    .directions = 1234,
                                    .step_deg = 2.5,
                                    .estimate_m2 = estimate_m2,
                                    .round = rounds,
                                    .n_asked = 2,
                                    .n_rounds = 2};

static int name_them(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        snprintf(named[i].name, sizeof named[i].name, "%s", i == 0 ? "first" : "second");
        at[i].station = &named[i];
        for (int k = 0; k < 3; k++)
            at[i].at.position_m[k] = 10 * i + k + 0.5;
    }
    for (int i = 0; i < 3; i++) {
        snprintf(surface[i].object, sizeof surface[i].object, "object%d", i);
        snprintf(surface[i].material, sizeof surface[i].material, "material%d", i);
    }
    return 0;
}

static void put(struct json *json, const void *with_next)
{
    json_open_object(json, NULL);
    coverage_put(json, &result);
    if (with_next != NULL) coverage_next_put(json, &next, &result);
    json_close_object(json);
}

static const char SUMS[] =
    "{\"cell_m\":0.25,\"cells\":101,\"pieces\":102,\"triangles\":103,\"area_m2\":40,\"duplicate_m2\":1.25,"
    "\"silent_m2\":2.25,\"none_m2\":8,\"none_percent\":20,\"one_m2\":12,\"one_percent\":30,\"several_m2\":20,"
    "\"several_percent\":50,\"density_1_m2\":{\"mean\":11,\"p05\":12,\"p50\":13,\"p95\":14},\"incidence_deg\":{";
static const char RANGES[] =
    "\"range_m\":{\"mean\":21,\"p05\":22,\"p50\":23,\"p95\":24},\"stations\":["
    "{\"name\":\"first\",\"position_m\":[0.5,1.5,2.5],\"pulses\":201,\"met\":202,\"hits\":203,\"front_hits\":204,"
    "\"seen_m2\":4,\"seen_percent\":10,\"alone_m2\":3,\"alone_percent\":7.5},"
    "{\"name\":\"second\",\"position_m\":[10.5,11.5,12.5],\"pulses\":301,\"met\":302,\"hits\":303,\"front_hits\":304,"
    "\"seen_m2\":5,\"seen_percent\":12.5,\"alone_m2\":1.5,\"alone_percent\":3.75}],\"labels\":["
    "{\"label\":0,\"object\":\"object0\",\"material\":\"material0\",\"area_m2\":10,\"seen_m2\":8,\"seen_percent\":80,"
    "\"several_m2\":2,\"several_percent\":20,\"density_1_m2\":3},"
    "{\"label\":1,\"object\":\"object1\",\"material\":\"material1\",\"area_m2\":20,\"seen_m2\":5,\"seen_percent\":25,"
    "\"several_m2\":1,\"several_percent\":5,\"density_1_m2\":7},"
    "{\"label\":2,\"object\":\"object2\",\"material\":\"material2\",\"area_m2\":4,\"seen_m2\":0,\"seen_percent\":0,"
    "\"several_m2\":0,\"several_percent\":0,\"density_1_m2\":null}]";
static const char NEXT[] =
    ",\"next\":{\"directions\":1234,\"step_deg\":2.5,\"largest_difference_m2\":1.5,"
    "\"like\":\"first\",\"sections\":[],\"stations\":["
    "{\"position_m\":[1,2,3],\"heading_deg\":0,\"gain_m2\":5,\"gain_percent\":12.5,\"seen_m2\":6,\"none_m2\":3,"
    "\"none_percent\":7.5,\"station\":\"{name: next-1, position_m: [1.000, 2.000, 3.000]}\",\"tried\":["
    "{\"place\":0,\"gain_m2\":5,\"estimate_m2\":5.5,\"seen_m2\":6},"
    "{\"place\":1,\"gain_m2\":4,\"estimate_m2\":3.75,\"seen_m2\":4.5}]},"
    "{\"position_m\":[4,5,6],\"heading_deg\":90.5,\"gain_m2\":2,\"gain_percent\":5,\"seen_m2\":3.5,\"none_m2\":1,"
    "\"none_percent\":2.5,\"station\":\"{name: next-2, position_m: [4.000, 5.000, 6.000], heading_deg: 90.5}\","
    "\"tried\":[{\"place\":1,\"gain_m2\":2,\"estimate_m2\":0.5,\"seen_m2\":3.5},"
    "{\"place\":3,\"gain_m2\":0.25,\"estimate_m2\":0.125,\"seen_m2\":0.75}]}],\"places\":["
    "{\"position_m\":[1,2,3],\"heading_deg\":0,\"floor_m\":1.5,\"within_body\":false,\"front\":0.5,"
    "\"estimate_m2\":[5.5,0]},"
    "{\"position_m\":[4,5,6],\"heading_deg\":90.5,\"floor_m\":null,\"within_body\":false,\"front\":0.25,"
    "\"estimate_m2\":[3.75,0.5]},"
    "{\"position_m\":[7,8,9],\"heading_deg\":0,\"floor_m\":7.5,\"within_body\":true,\"front\":0.125,"
    "\"estimate_m2\":[0,0]},"
    "{\"position_m\":[1.5,2.5,3.5],\"heading_deg\":10,\"floor_m\":2,\"within_body\":false,\"front\":1,"
    "\"estimate_m2\":[1,0.125]}]}}\n";

/* Degrees are rounded somewhere between 15 and 17 digits. */
static const char *next_degrees(const char *text, const char *key, double deg)
{
    char *end;
    char quoted[32];
    snprintf(quoted, sizeof quoted, "\"%s\":", key);
    if (strncmp(text, quoted, strlen(quoted)) != 0) fail_msg("no %s in %s", key, text);
    if (fabs(strtod(text + strlen(quoted), &end) - deg) > 1e-13 * deg) fail_msg("%s is not %g: %s", key, deg, text);
    return end + 1;
}

static void each_key(void **state)
{
    struct web_body body;
    struct sh_err err;
    (void)state;
    assert_int_equal(page_json(put, &next, &body, &err), 0);
    const char *text = body.bytes;
    if (strncmp(text, SUMS, sizeof SUMS - 1) != 0) fail_msg("%s", text);
    text = next_degrees(text + sizeof SUMS - 1, "mean", 45);
    text = next_degrees(text, "p05", 15);
    text = next_degrees(text, "p50", 30);
    text = next_degrees(text, "p95", 60) + 1;
    if (strncmp(text, RANGES, sizeof RANGES - 1) != 0) fail_msg("%s", text);
    assert_string_equal(text + sizeof RANGES - 1, NEXT);
    free(body.bytes);
}

/* Rays that are pulses have no step. Without labels there is no list of them. */
static void keys_that_are_not_there(void **state)
{
    struct web_body body;
    struct sh_err err;
    (void)state;
    result.label = NULL;
    next.whole_cells = 1;
    assert_int_equal(page_json(put, &next, &body, &err), 0);
    assert_non_null(strstr(body.bytes, "\"alone_percent\":3.75}],\"next\":{\"directions\":1234,\"step_deg\":null,"));
    free(body.bytes);
    result.label = label;
    next.whole_cells = 0;
}

/* ---- text, which goes to standard output */

static char *printed(int with_next)
{
    char *text = calloc(1, 8192);
    FILE *file = tmpfile();
    assert_true(text != NULL && file != NULL);
    fflush(stdout);
    const int before = dup(STDOUT_FILENO);
    assert_true(before >= 0 && dup2(fileno(file), STDOUT_FILENO) >= 0);
    if (with_next)
        coverage_next_print(&next, &result);
    else
        coverage_print_text(&result);
    fflush(stdout);
    assert_true(dup2(before, STDOUT_FILENO) >= 0);
    close(before);
    rewind(file);
    assert_true(fread(text, 1, 8191, file) > 0);
    fclose(file);
    return text;
}

static void each_line(void **state)
{
    (void)state;
    char *text = printed(0);
    assert_string_equal(text,
                        "surface          40.000 m2 in 101 cells of 0.25 m\n"
                        "                  1.250 m2 left out: faces with the corners of another one\n"
                        "                  2.250 m2 left out: not among scene.target\n"
                        "none              8.000 m2   20.000 %\n"
                        "one              12.000 m2   30.000 %\n"
                        "several          20.000 m2   50.000 %\n"
                        "density    mean 11, 5 % 12, 50 % 13, 95 % 14 points/m2\n"
                        "incidence  mean 45, 5 % 15, 50 % 30, 95 % 60 deg\n"
                        "range      mean 21, 5 % 22, 50 % 23, 95 % 24 m\n"
                        "\nstation               sees m2        %     alone m2        %       pulses   with a hit\n"
                        "first                   4.000   10.000        3.000    7.500          201          202\n"
                        "second                  5.000   12.500        1.500    3.750          301          302\n"
                        "\n     area m2    unseen m2   seen %    points/m2  object | material\n"
                        "      20.000       15.000   25.000            7  object1 | material1\n"
                        "       4.000        4.000    0.000            -  object2 | material2\n"
                        "      10.000        2.000   80.000            3  object0 | material0\n");
    free(text);
}

static void each_line_of_next(void **state)
{
    (void)state;
    char *text = printed(1);
    assert_string_equal(
        text,
        "\nplaces     4 to stand at, 1 of them left out: they see mostly backs of faces, so they are within bodies\n"
        "estimates  1234 rays from each place, 2.5 deg apart; whole scans differ by up to 1.500 m2\n"
        "\nnext station 1: the best places, by a whole scan from each\n"
        "       x m        y m        z m  height m     gains m2        %    estimated      sees m2\n"
        "     1.000      2.000      3.000     1.500        5.000   12.500        5.500        6.000\n"
        "     4.000      5.000      6.000         -        4.000   10.000        3.750        4.500\n"
        "with the first of them 3.000 m2 (7.500 %) are seen by no station:\n"
        "  - {name: next-1, position_m: [1.000, 2.000, 3.000]}\n"
        "\nnext station 2: the best places, by a whole scan from each\n"
        "       x m        y m        z m  height m     gains m2        %    estimated      sees m2\n"
        "     4.000      5.000      6.000         -        2.000    5.000        0.500        3.500\n"
        "     1.500      2.500      3.500     1.500        0.250    0.625        0.125        0.750\n"
        "with the first of them 1.000 m2 (2.500 %) are seen by no station:\n"
        "  - {name: next-2, position_m: [4.000, 5.000, 6.000], heading_deg: 90.5}\n");
    free(text);
}

/* The scans of places have the scanner and the tripod's cone of a station, and the line for `stations` has neither. So
 * they are named, by the station of the configuration that the third of two stations' stops is at. */
static void sections_that_belong_to_a_line(void **state)
{
    static const struct {
        int tripod, scanner;
        const char *says, *list;
    } rows[] = {{1, 0, "tripod\n", "[\"tripod\"]"},
                {0, 1, "scanner\n", "[\"scanner\"]"},
                {1, 1, "tripod and scanner\n", "[\"tripod\",\"scanner\"]"}};
    static const char note[] =
        "3.000]}\n    the scans have the scanner and the tripod's cone of station first: add its ";
    (void)state;
    result.base = 2;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        named[0].tripod.given = rows[i].tripod;
        named[0].has_scanner = rows[i].scanner;
        char *text = printed(1), *from = strstr(text, note), list[80];
        assert_non_null(from);
        assert_memory_equal(from + strlen(note), rows[i].says, strlen(rows[i].says));
        free(text);
        struct web_body body;
        struct sh_err err;
        snprintf(list, sizeof list, ",\"like\":\"first\",\"sections\":%s,", rows[i].list);
        assert_int_equal(page_json(put, &next, &body, &err), 0);
        assert_non_null(strstr(body.bytes, list));
        free(body.bytes);
    }
    named[0].tripod.given = named[0].has_scanner = 0;
    result.base = 0;
}

/* A place of --candidates is scanned where it is. So its line has micrometres, and the line of a grid has millimetres. */
static void finer_places_have_more_digits(void **state)
{
    (void)state;
    place[0].position_m[0] = 7.9996;
    char *text = printed(1);
    assert_non_null(strstr(text, "  - {name: next-1, position_m: [7.999600, 2.000000, 3.000000]}\n"));
    assert_non_null(strstr(text, "  - {name: next-2, position_m: [4.000, 5.000, 6.000], heading_deg: 90.5}\n"));
    free(text);
    place[0].position_m[0] = 1;
}

/* The last lines say where it ended early. */
static void nothing_left_to_gain(void **state)
{
    (void)state;
    next.within = 0;
    next.n_asked = 3;
    char *text = printed(1);
    assert_non_null(strstr(text, "\nplaces     4 to stand at\n"));
    assert_non_null(
        strstr(text, "\nno further station: all that can be seen from these places is seen by a station already\n"));
    free(text);
    next.n_rounds = 0;
    next.whole_cells = 1;
    rounds[0].n_tried = 0;
    text = printed(1);
    assert_string_equal(text,
                        "\nplaces     4 to stand at\n"
                        "estimates  1234 rays from each place, pulses of the head; each cell that they hit counts\n"
                        "\nno station: all that can be seen from these places is seen by a station already\n");
    free(text);
}

/* Nothing is said about what stations see where no place was compared, where no ray from one hits anything, and where
 * only some places were scanned. */
static void other_reasons_for_no_station(void **state)
{
    (void)state;
    struct coverage_next_place none[2] = {{.front = 0.1, .state = COVERAGE_PLACE_WITHIN},
                                          {.front = (double)NAN, .state = COVERAGE_PLACE_WITHIN}};
    struct coverage_next_round round = {.n_tried = 0};
    const struct coverage_next before = next;
    static const struct {
        uint32_t within, n_tried;
        enum coverage_place second;
        const char *says;
    } rows[] = {{2, 0, COVERAGE_PLACE_WITHIN, "no place is left to compare;"},
                {1, 0, COVERAGE_PLACE_OPEN, "no ray from these places hits a surface"},
                {1, 1, COVERAGE_PLACE_CHOSEN, "whole scans from the best places add nothing\n"}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        none[1].state = rows[i].second;
        if (rows[i].n_tried > 0) none[1].front = 1.0;
        round.n_tried = rows[i].n_tried;
        next = (struct coverage_next){.place = none, .n = 2, .within = rows[i].within, .round = &round, .n_asked = 1};
        char *text = printed(1), *from = strstr(text, "\nno station: ");
        if (from == NULL || strncmp(from + 13, rows[i].says, strlen(rows[i].says)) != 0) fail_msg("%zu: %s", i, text);
        free(text);
    }
    next = before;
}

/* Labels stand by their unseen area, the largest first, and of equal ones as they are numbered. Neither the whole area
 * nor the seen one gives this order. */
static void the_order_of_labels(void **state)
{
    static const struct {
        struct coverage_of_label label[3];
        int order[3];
    } rows[] = {{{{10, 9, 0, 1}, {5, 0, 0, 0}, {8, 3, 0, 1}}, {1, 2, 0}},
                {{{6, 2, 0, 1}, {30, 29, 0, 1}, {20, 15, 0, 1}}, {2, 0, 1}},
                {{{1, 1, 0, 1}, {2, 2, 0, 1}, {3, 3, 0, 1}}, {0, 1, 2}}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct coverage_of_label some[3];
        memcpy(some, rows[i].label, sizeof some);
        result.label = some;
        char *text = printed(0), *from = text;
        for (int k = 0; k < 3; k++) {
            from = strstr(from, surface[rows[i].order[k]].object);
            if (from == NULL) fail_msg("row %zu: label %d is not in its place: %s", i, rows[i].order[k], text);
        }
        free(text);
    }
    result.label = label;
}

/* A scene without area has 0 percent. */
static void parts_in_percent(void **state)
{
    (void)state;
    assert_true(coverage_percent(1.0, 4.0) == 25.0 && coverage_percent(0.0, 4.0) == 0.0);
    assert_true(coverage_percent(0.0, 0.0) == 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(parts_in_percent),
        cmocka_unit_test(the_order_of_labels),
        cmocka_unit_test(each_key),
        cmocka_unit_test(keys_that_are_not_there),
        cmocka_unit_test(each_line),
        cmocka_unit_test(each_line_of_next),
        cmocka_unit_test(sections_that_belong_to_a_line),
        cmocka_unit_test(finer_places_have_more_digits),
        cmocka_unit_test(nothing_left_to_gain),
        cmocka_unit_test(other_reasons_for_no_station),
    };
    return cmocka_run_group_tests(tests, name_them, NULL);
}
