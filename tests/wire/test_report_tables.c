/* SPDX-License-Identifier: MIT */
/* The rows of a report's text and page, beside the figures of report_rig.c: each figure stands in its column, under the
 * name of its group, and groups without points have no row. */
#include <math.h>

#include "tests/common/leap_zone.h"
#include "tests/wire/report_rig.h"

enum { LINE_LEN = 600 };

static void has_once(const char *text, const char *line)
{
    const char *at = strstr(text, line);
    if (at == NULL) fail_msg("not there: %s", line);
    if (strstr(at + 1, line) != NULL) fail_msg("twice: %s", line);
}

/* ---- text: millimetres with four decimals */

static void has_row(const char *text, const char *name, const struct wanted *w, const char *end)
{
    char line[LINE_LEN];
    if (w->points == 0.0) {
        snprintf(line, sizeof line, "\n%-34s ", name);
        assert_null(strstr(text, line));
        return;
    }
    snprintf(line, sizeof line, "\n%-34s %10g %10.4f %10.4f %10.4f %10.4f | %10g %+10.4f %10.4f %10.4f%s\n", name,
             w->points, 1e3 * w->mean_m, 1e3 * w->rms_m, 1e3 * w->p95_m, 1e3 * w->max_m, w->near, 1e3 * w->along_mean_m,
             1e3 * w->along_rms_m, 1e3 * w->expected_rms_m, end);
    has_once(text, line);
}

static void has_summary(const char *text, const struct made *all)
{
    char line[LINE_LEN];
    const struct wanted w = report_want(all, BY_NOTHING, 0, 1);
    const struct density d = report_density(all, -1, 0.0, INFINITY);
    int beyond = 1;
    for (int i = 0; i < N_NEAR; i++)
        beyond += all[i].distance_m > REPORT_TOLERANCE_M;
    snprintf(line, sizeof line,
             "points     %g\nempty      1 shots without echo\nmean       %.6f mm\nRMS        %.6f mm\n"
             "50 %%       %.6f mm\n95 %%       %.6f mm\n99.9 %%     %.6f mm\nmax        %.6f mm\n"
             "worst      point %d at 900.000000 0.000000 0.100000 on east | paint-east\n"
             "beyond     %d farther than 0.001 m\nfar        1 farther than 10 m from everything\n"
             "coverage   4 of 6 surfaces, ",
             w.points, 1e3 * w.mean_m, 1e3 * w.rms_m, 1e3 * w.p50_m, 1e3 * w.p95_m, 1e3 * w.p999_m, 1e3 * w.max_m,
             N_NEAR + 2, beyond);
    if (strncmp(text, line, strlen(line)) != 0) fail_msg("not %s but %.900s", line, text);
    snprintf(
        line, sizeof line,
        "\ndensity    half of the points lie where a station has %.4g points/m2 or more, 95 %% where %.4g (cells of "
        "1 m)\n",
        d.p50, d.p5);
    has_once(text, line);
}

static void has_times(const char *text, const struct made *all)
{
    char line[LINE_LEN];
    for (int s = 0; s < N_STATIONS; s++) {
        const struct times t = report_times(all, s);
        snprintf(
            line, sizeof line,
            "\ntime       station %d: %.6g s, %.6g points/s; %g pauses over 0.02 s, the longest %.3g s at %.6f s\n",
            s + 1, t.span_s, t.n / t.span_s, t.gaps, t.longest_s, t.longest_at_s);
        has_once(text, line);
    }
}

static void has_echoes(const char *text, const struct made *all, const char *begin, const char *shot, const char *apart,
                       const char *end)
{
    int shots[16] = {0}, first = 1;
    char line[LINE_LEN];
    size_t len = (size_t)snprintf(line, sizeof line, "%s", begin);
    for (int i = 0; i < N_POINTS; i++)
        shots[all[i].echo_count < 15 ? all[i].echo_count : 15] += all[i].echo <= 1;
    for (int k = 0; k < 16; k++) {
        if (shots[k] == 0) continue;
        len += (size_t)snprintf(line + len, sizeof line - len, "%s%d %s %d%s", first ? "" : apart, shots[k], shot, k,
                                k == 15 ? " or more" : "");
        first = 0;
    }
    snprintf(line + len, sizeof line - len, "%s", end);
    has_once(text, line);
}

/* The surface with the most points comes first; of equal ones, the lower label. Unknown ones have the last label. */
static void surfaces_are_in_order(const char *text, const struct made *all, const char *const name[5])
{
    double left[5];
    for (int l = 0; l < 5; l++) {
        const int label = l < 4 ? l : 0xffff;
        left[l] = report_want(all, BY_LABEL, label, label + 1).points;
    }
    for (int row = 0; row < 5; row++) {
        int best = 0;
        for (int l = 1; l < 5; l++)
            if (left[l] > left[best]) best = l;
        text = strstr(text, name[best]);
        if (text == NULL) fail_msg("row %d of the surfaces is not of %s", row, name[best]);
        left[best] = -1.0;
    }
}

static void each_row_of_the_text_is_right(void **state)
{
    struct wire *wire = *state;
    struct made all[N_POINTS];
    char name[64];
    int n;
    report_make(all);
    report_write(wire, all);
    report_run(wire, (const char *const[]){NULL});
    char *text = wire_read(wire_path(wire, "out"), NULL);
    has_summary(text, all);
    has_times(text, all);
    has_echoes(text, all, "\nechoes     ", "shots with", " ", "\n");
    for (int s = 0; s < N_STATIONS; s++) {
        const struct wanted w = report_want(all, BY_STATION, s, s + 1);
        has_row(text, s == 0 ? "1 first" : "2 second", &w, "");
    }
    const double step_m = report_range_step(all, &n);
    for (int k = 0; k < n; k++) {
        const struct wanted w = report_want(all, BY_RANGE, k * step_m, (k + 1) * step_m);
        snprintf(name, sizeof name, "%g to %g", k * step_m, (k + 1) * step_m);
        has_row(text, name, &w, "");
    }
    for (int k = 0; k < 9; k++) {
        const struct wanted w = report_want(all, BY_INCIDENCE, 10 * k, 10 * k + 10);
        snprintf(name, sizeof name, "%d to %d", 10 * k, 10 * k + 10);
        has_row(text, name, &w, "");
    }
    for (int w = 0; w < 6; w++) {
        const struct wanted figures = report_want(all, BY_LABEL, w, w + 1);
        char end[64];
        snprintf(name, sizeof name, "label %d", w);
        snprintf(end, sizeof end, "  %s | paint-%s", WALLS[w], WALLS[w]);
        has_row(text, name, &figures, end);
    }
    const struct wanted unknown = report_want(all, BY_LABEL, 0xffff, 0x10000);
    has_row(text, "not known", &unknown, "");
    surfaces_are_in_order(
        strstr(text, "by surface"), all,
        (const char *const[]){"\nlabel 0 ", "\nlabel 1 ", "\nlabel 2 ", "\nlabel 3 ", "\nnot known "});
    has_once(text, "\nstation 1 first: Not within the expected error: 1 of ");
    has_once(text, "\nstation 2 second: Not judged: only ");
    free(text);
}

/* ---- page: four digits, with three decimals at most, in the unit that gives one to three digits before the point */

static int put_length(char *out, double m, int is_signed)
{
    static const struct {
        const char *name;
        double m;
    } unit[] = {{"mm", 1e-3}, {"\xc2\xb5m", 1e-6}, {"nm", 1e-9}};
    int k = 0;
    if (isnan(m)) return snprintf(out, 32, "\xe2\x80\x93");
    while (k < 2 && fabs(m) < 0.9995 * unit[k].m)
        k++;
    const double v = m / unit[k].m, a = fabs(v);
    const int decimals = a >= 100.0 ? 1 : a >= 10.0 ? 2 : 3;
    return snprintf(out, 32, is_signed ? "%+.*f&nbsp;%s" : "%.*f&nbsp;%s", decimals, v, unit[k].name);
}

static size_t put_cell(char *row, size_t len, double m, int is_signed)
{
    len += (size_t)snprintf(row + len, LINE_LEN - len, "</td><td>");
    return len + (size_t)put_length(row + len, m, is_signed);
}

static size_t put_count_cell(char *row, size_t len, double n)
{
    return len + (size_t)snprintf(row + len, LINE_LEN - len, "</td><td>%g", n);
}

static void has_page_row(const char *page, const char *name, const struct wanted *w, const struct density *d)
{
    char row[LINE_LEN];
    size_t len = (size_t)snprintf(row, sizeof row, "<tr><td>%s", name);
    if (w->points == 0.0) {
        snprintf(row + len, sizeof row - len, "</td>");
        assert_null(strstr(page, row));
        return;
    }
    len = put_count_cell(row, len, w->points);
    len = put_cell(row, len, w->mean_m, 0);
    len = put_cell(row, len, w->rms_m, 0);
    len = put_cell(row, len, w->p95_m, 0);
    len = put_cell(row, len, w->max_m, 0);
    len = put_count_cell(row, len, w->near);
    len = put_cell(row, len, w->along_mean_m, 1);
    len = put_cell(row, len, w->along_rms_m, 0);
    len = put_count_cell(row, len, w->near);
    len = put_cell(row, len, w->along_rms_m, 0);
    len = put_cell(row, len, w->expected_rms_m, 0);
    if (d != NULL && isnan(d->p50)) /* its points lie in cells whose mean range is of another bin */
        snprintf(row + len, sizeof row - len,
                 "</td><td>\xe2\x80\x93</td><td>\xe2\x80\x93</td><td>\xe2\x80\x93</td></tr>\n");
    else if (d != NULL)
        snprintf(row + len, sizeof row - len, "</td><td>%.4g</td><td>%.4g</td><td>%.4g</td></tr>\n", d->p5, d->p50,
                 d->p95);
    else
        snprintf(row + len, sizeof row - len, "</td></tr>\n");
    has_once(page, row);
}

static void has_card(const char *page, const char *name, const char *value, const char *more)
{
    char card[LINE_LEN];
    snprintf(card, sizeof card, "<div><span>%s</span><b>%s</b>%s</div>\n", name, value, more);
    has_once(page, card);
}

static void has_cards(const char *page, const struct made *all)
{
    const struct wanted w = report_want(all, BY_NOTHING, 0, 1);
    const struct {
        const char *name;
        double m;
        int is_signed;
    } length[] = {{"Distance, mean", w.mean_m, 0},
                  {"Distance, RMS", w.rms_m, 0},
                  {"Distance, 95 % within", w.p95_m, 0},
                  {"Distance, largest", w.max_m, 0},
                  {"Along the beam, mean", w.along_mean_m, 1},
                  {"Along the beam, RMS", w.along_rms_m, 0}};
    char text[64];
    int beyond = 1;
    for (size_t k = 0; k < sizeof length / sizeof length[0]; k++) {
        put_length(text, length[k].m, length[k].is_signed);
        has_card(page, length[k].name, text, "");
    }
    for (int i = 0; i < N_NEAR; i++)
        beyond += all[i].distance_m > REPORT_TOLERANCE_M;
    snprintf(text, sizeof text, "%d", beyond);
    has_card(page, "Farther", text, "<span>than 0.001 m</span>");
    snprintf(text, sizeof text, "%g", w.points);
    has_card(page, "Points", text, "");
    has_card(page, "Shots without echo in the file", "1", "");
    snprintf(text, sizeof text, "%.4g", report_density(all, -1, 0.0, INFINITY).p50);
    has_card(page, "Density, median", text, "<span>points/m\xc2\xb2</span>");
    has_card(page, "Surfaces", "4", "<span>of 6 have points</span>");
}

static void has_page_times(const char *page, const struct made *all)
{
    static const char *const names[] = {"first", "second"};
    char row[LINE_LEN];
    for (int s = 0; s < N_STATIONS; s++) {
        const struct times t = report_times(all, s);
        snprintf(row, sizeof row,
                 "<tr><td>%d %s</td><td>%g</td><td>%g</td><td>%.6g</td><td>%.4g</td><td>%g</td><td>%.3g</td>"
                 "<td>%.6f</td></tr>\n",
                 s + 1, names[s], t.n, t.scans, t.span_s, t.n / t.span_s, t.gaps, t.longest_s, t.longest_at_s);
        has_once(page, row);
    }
}

static void has_page_rows(const char *page, const struct made *all)
{
    char name[64];
    int n;
    for (int s = 0; s < N_STATIONS; s++) {
        const struct wanted w = report_want(all, BY_STATION, s, s + 1);
        const struct density d = report_density(all, s, 0.0, INFINITY);
        has_page_row(page, s == 0 ? "1 first" : "2 second", &w, &d);
    }
    const double step_m = report_range_step(all, &n);
    for (int k = 0; k < n; k++) {
        const struct wanted w = report_want(all, BY_RANGE, k * step_m, (k + 1) * step_m);
        const struct density d = report_density(all, -1, k * step_m, (k + 1) * step_m);
        snprintf(name, sizeof name, "%g\xe2\x80\x93%g", k * step_m, (k + 1) * step_m);
        has_page_row(page, name, &w, &d);
    }
    for (int k = 0; k < 9; k++) {
        const struct wanted w = report_want(all, BY_INCIDENCE, 10 * k, 10 * k + 10);
        snprintf(name, sizeof name, "%d\xe2\x80\x93%d\xc2\xb0", 10 * k, 10 * k + 10);
        has_page_row(page, name, &w, NULL);
    }
    for (int l = 0; l < 6; l++) {
        const struct wanted w = report_want(all, BY_LABEL, l, l + 1);
        snprintf(name, sizeof name, "%s | paint-%s", WALLS[l], WALLS[l]);
        has_page_row(page, name, &w, NULL);
    }
    const struct wanted unknown = report_want(all, BY_LABEL, 0xffff, 0x10000);
    has_page_row(page, "surface not known", &unknown, NULL);
}

/* The page's top says which files it is of, and when the recording was written. */
static void has_files(const struct wire *wire, const char *page)
{
    char text[512], day[64];
    struct stat file;
    assert_int_equal(stat(wire_path(wire, "made.ply"), &file), 0);
    assert_true(strftime(day, sizeof day, "%F %T UTC", gmtime(&file.st_mtime)) > 0);
    has_once(page, "<h1>Scan report: made.ply</h1>\n");
    snprintf(text, sizeof text, "<dt>Recording</dt><dd>%s</dd>\n<dt>Written</dt><dd>%s</dd>\n",
             wire_path(wire, "made.ply"), day);
    has_once(page, text);
    snprintf(text, sizeof text, "<dt>Configuration</dt><dd>%s</dd>\n<dt>Scene</dt><dd>%s</dd>\n",
             wire_path(wire, "made.yaml"), wire_path(wire, "room.obj"));
    has_once(page, text);
}

static void each_row_of_the_page_is_right(void **state)
{
    struct wire *wire = *state;
    struct made all[N_POINTS];
    char html[256];
    report_make(all);
    report_write(wire, all);
    snprintf(html, sizeof html, "%s", wire_path(wire, "page.html"));
    assert_true(leap_zone_begin(wire_path(wire, "zone"))); /* the page has UTC in any zone */
    report_run(wire, (const char *const[]){"--html", html, NULL});
    leap_zone_end();
    char *page = wire_read(html, NULL);
    has_cards(page, all);
    has_page_times(page, all);
    has_page_rows(page, all);
    has_echoes(page, all, "<p>Echoes per shot: ", "shots have", ", ", ".</p>\n");
    surfaces_are_in_order(strstr(page, "<h2>Surfaces</h2>"), all,
                          (const char *const[]){"<tr><td>west |", "<tr><td>east |", "<tr><td>south |",
                                                "<tr><td>north |", "<tr><td>surface not known<"});
    has_once(page, "<p>The first point farther than 10 m from everything is number 62 of the file, at 900.000000 "
                   "0.000000 0.100000, on east | paint-east.</p>\n");
    has_files(wire, page);
    has_once(page, "<span>of 12 have points</span>");
    has_once(page, "<dt>Scanner</dt><dd>scanhead full sweep, range noise on, angle noise off, ball noise off</dd>\n");
    has_once(page, "<dt>Coordinates</dt><dd>the scene's own frame</dd>\n");
    has_once(page, "<div class=\"verdict beyond\"><b>\xe2\x9c\x97 Not within the expected error</b>Of 2 stations, 0 ");
    has_once(page, "<p>Station 2, second. Not judged: only ");
    has_once(page, "squares with sides of 1 m.");
    free(page);
}

/* ---- the map: places are in units of the bar that shows its scale, with one decimal */

static double number_after(const char **at, const char *what)
{
    *at = strstr(*at, what);
    if (*at == NULL) fail_msg("no %s", what);
    return strtod(*at += strlen(what), (char **)at);
}

/* The station's triangle, whose middle is 9 units below its first corner, with its name to the right. */
static void next_station(const char **at, const char *name, double place[2])
{
    char text[128];
    place[0] = number_after(at, "<polygon class=\"station\" points=\"");
    place[1] = number_after(at, ",") + 9.0;
    snprintf(text, sizeof text,
             " %.1f,%.1f %.1f,%.1f\"><title>%s</title></polygon>\n"
             "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"start\">%s</text>\n",
             place[0] - 8.0, place[1] + 6.0, place[0] + 8.0, place[1] + 6.0, name, place[0] + 12.0, place[1] + 5.0,
             name);
    if (strncmp(*at, text, strlen(text)) != 0) fail_msg("not %s but %.250s", text, *at);
}

/* The second station is 1 m to the east and 1 m to the north of the first. Colours end at the figure that 99.9 % of the
 * distances do not exceed, rounded up to 1, 2 or 5 mm. */
static void the_map_shows_the_stations(void **state)
{
    struct wire *wire = *state;
    struct made all[N_POINTS];
    char html[256], text[128];
    double first[2], second[2];
    report_make(all);
    all[N_NEAR + 1] = all[0]; /* no point is far, which would make the rest of the map small */
    report_write(wire, all);
    snprintf(html, sizeof html, "%s", wire_path(wire, "page.html"));
    report_run(wire, (const char *const[]){"--html", html, NULL});
    char *page = wire_read(html, NULL);
    const char *at = strstr(page, "<svg class=\"map\" viewBox=\"0 0 900 ");
    assert_non_null(at);
    next_station(&at, "1 first", first);
    next_station(&at, "2 second", second);
    const double bar = number_after(&at, "<line class=\"mark\" x1=\"20\" y1=\"");
    const double length = number_after(&at, "x2=\"") - 20.0, end = number_after(&at, "<text x=\"");
    assert_true(fabs(end - 28.0 - length) < 0.11); /* both are rounded to 0.1 */
    assert_true(fabs(number_after(&at, "y=\"") - 5.0 - bar) < 0.11);
    const double unit_m = length / number_after(&at, ">");
    assert_true(fabs(second[0] - first[0] - unit_m) < 0.21 && fabs(first[1] - second[1] - unit_m) < 0.21);
    const double p999_m = report_want(all, BY_NOTHING, 0, 1).p999_m;
    snprintf(text, sizeof text, ">%g mm</text>\n</svg><figcaption>The cloud from above, the scene's y axis up.",
             p999_m > 0.005   ? 10.0
             : p999_m > 0.002 ? 5.0
                              : 2.0);
    has_once(page, text);
    has_once(page, "black: nothing within 10 m. Red triangles are the stations.</figcaption>");
    free(page);
    /* Stations beside all points are on the map, too. */
    report_run(wire, (const char *const[]){"--html", html, "--set", "stations.0.position_m=[-30,0,0.1]", "--set",
                                           "stations.1.position_m=[50,0,0.2]", NULL});
    page = wire_read(html, NULL);
    at = page;
    const double west = number_after(&at, "<polygon class=\"station\" points=\"");
    const double east = number_after(&at, "<polygon class=\"station\" points=\"");
    assert_true(west >= 0.0 && east <= 900.0 && east - west > 800.0); /* the map is little wider than these 80 m */
    free(page);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(each_row_of_the_text_is_right, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(each_row_of_the_page_is_right, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(the_map_shows_the_stations, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
