/* SPDX-License-Identifier: MIT */
/* `scanhead run` in this process: a head that scans once, and a recording that takes its place. All that they print is
 * compared, and what a link gets. Run from the top of the source tree. */
#include "tests/unit/commands_rig.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "firmware_sim/app/run/page.h"

/* Steps of 10 degrees: the 8 rings of 36 shots below the horizon meet the floor, and so does the shot straight down. */
enum { POINTS = 8 * 36 + 1 };

static const char SCENE[] =
    "head: {profile: sphere, step_deg: 10}\nscene: {meshes: [{file: floor.obj, up: z, scale: 1}]}\n"
    "stations: [{name: one, position_m: [0, 0, 2]}, {name: two, position_m: [4, 0, 2]%s}]\n"
    "output: {crs: local}\nlinks: [%s]\n";

static int go_there(void **state)
{
    (void)state;
    static const struct {
        const char *name, *of_second, *links;
    } files[] = {
        {"c.yaml", "", "{type: file, path: out.shs}"},
        {"two.yaml", ", scanner: {head: {profile: sphere, step_deg: 5}}", "{type: file, path: out.shs}"},
        {"file.yaml", "", "{type: file, path: again.shs}"},
        {"web.yaml", "", "{type: web, waits: no}, {type: \"null\"}"},
        {"waits.yaml", "", "{type: \"null\"}, {type: web, waits: yes}"},
        {"tcp.yaml", "", "{type: tcp, max_sessions: 3}, {type: pty}, {type: \"null\"}"},
    };
    char text[1024];
    if (commands_begin() != 0) return -1;
    write_text("floor.obj", "o floor\nv -30 -30 0\nv 30 -30 0\nv 30 30 0\nv -30 30 0\nf 1 2 3 4\n");
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        snprintf(text, sizeof text, SCENE, files[i].of_second, files[i].links);
        write_text(files[i].name, text);
    }
    does(&app_record, "c.yaml --station 1 -o s.shs --quiet", 0);
    return 0;
}

/* Removes the figures after these texts: times, and sizes of the BVH, which depend on the machine. */
static void without_figures(char *text)
{
    static const char *const before[] = {"BVH in ", " s, ", "packets of "};
    char *at = text;
    for (int i = 0; i < 3 && (at = strstr(at, before[i])) != NULL; i++) {
        at += strlen(before[i]);
        const size_t n = strspn(at, "0123456789.");
        assert_true(n > 0);
        memmove(at, at + n, strlen(at + n) + 1);
    }
}

static void expect_said(const char *want)
{
    without_figures(on_err);
    assert_string_equal(on_err, want);
}

/* One frame is one scan. Its time is that of 19 rings of 36 pulses, 19 ms. */
static void a_head_says_what_it_is_and_when_it_ends(void **state)
{
    static const char plan[] = "scanhead: plan: sight none; beam single; optics none; georef none\n";
    char want[1024];
    (void)state;
    does(&app_run, "c.yaml --pace fast --start --frames 1 --surfaces s.csv --duration 10", 0);
    snprintf(want, sizeof want,
             "scanhead: scanhead sphere, sphere, 2 triangles, 1 surfaces; BVH in  s,  bytes per triangle, packets of \n"
             "%sscanhead: link file:out.shs, native\n"
             "scanhead: the scan was over after 0.019 s, before --duration 10: all its frames were scanned\n",
             plan);
    expect_said(want);
    char *csv = contents("s.csv");
    has(csv, "\n0,floor,");
    free(csv);
    does(&app_run, "two.yaml --pace fast --start --frames 1", 0);
    snprintf(
        want, sizeof want,
        "scanhead: scanhead sphere, sphere, 2 triangles, 1 surfaces; BVH in  s,  bytes per triangle, packets of \n"
        "scanhead: it is the scanner of 1 of 2 stations; --set head.station=N serves the scanner of another station\n"
        "%sscanhead: link file:out.shs, native\n",
        plan);
    expect_said(want);
    does(&app_run, "c.yaml --pace fast --start --frames 1 --quiet --duration 10", 0);
    expect_said("");
    /* A scan that ends within a tick and a half of the time that is given is not short. A tick is 1 ms. */
    for (const char *const *not_short = (const char *const[]){"0.019", "0.02", NULL}; *not_short != NULL; not_short++) {
        snprintf(want, sizeof want, "c.yaml --pace fast --start --frames 1 --duration %s", *not_short);
        does(&app_run, want, 0);
        assert_null(strstr(on_err, "the scan was over"));
    }
    does(&app_run, "c.yaml --pace fast --start --frames 1 --duration 0.021", 0);
    has(on_err, "scanhead: the scan was over after 0.019 s, before --duration 0.021: all its frames were scanned\n");
}

/* ---- a page: the functions that `run` calls, in their order */

static struct watch_options asked;
static const struct config *asked_cfg;
static char calls[16];
static int begun; /* what start returns */

static int page_open(const struct config *cfg, const struct site *site, const struct watch_options *options,
                     struct watch **out, struct sh_err *err)
{
    assert_true(site->cfg == cfg);
    (void)err;
    asked = *options;
    asked_cfg = cfg;
    strcat(calls, "o");
    *out = (struct watch *)calls;
    return SH_OK;
}

static const struct link_spec *page_link(struct watch *watch)
{
    static const struct link_spec none = {.type = LINK_NULL};
    assert_ptr_equal(watch, calls);
    strcat(calls, "l");
    return &none;
}

static const struct web_source *page_source(const struct watch *watch)
{
    static const struct web_source nothing = {.ctx = NULL};
    assert_ptr_equal(watch, calls);
    strcat(calls, "w");
    return &nothing;
}

static int page_start(struct watch *watch, struct sh_err *err)
{
    assert_ptr_equal(watch, calls);
    strcat(calls, "s");
    return begun == SH_OK ? SH_OK : sh_fail(err, begun, "it doesn't start");
}

static void page_close(struct watch *watch)
{
    assert_ptr_equal(watch, calls);
    strcat(calls, "c");
}

/* If the clients of a web link may hold the head back, so may the observer. Unless the pace is realtime, it then has as
 * much of a processor as it needs. Without a web link there is no page. */
static void a_page_is_opened_for_web_links(void **state)
{
    static const struct run_page fake = {page_open, page_link, page_source, page_start, page_close};
    static const struct {
        const char *words, *calls;
        int waits;
        double share;
    } rows[] = {{"c.yaml --pace fast --start --frames 1", "", 0, 0},
                {"web.yaml --pace fast --start --frames 1", "olwsc", 0, 0.05},
                {"waits.yaml --pace fast --start --frames 1", "olwsc", 1, 0},
                {"web.yaml --start --frames 1", "olwsc", 0, 0.05},
                {"waits.yaml --start --frames 1", "olwsc", 1, 0.05}};
    (void)state;
    run_take_page(&fake);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        calls[0] = '\0';
        does(&app_run, rows[i].words, 0);
        assert_string_equal(calls, rows[i].calls);
        if (calls[0] == '\0') continue;
        assert_true(asked.waits == rows[i].waits && asked.cpu_share == rows[i].share && asked.device != NULL);
        assert_true(asked.scene_triangles == 100000 && asked.report == &app_report_seconds && asked_cfg != NULL);
    }
    begun = SH_EIO;
    calls[0] = '\0';
    does(&app_run, "web.yaml --pace fast --start --frames 1", 1);
    assert_string_equal(on_err, "scanhead: it doesn't start\n");
    assert_string_equal(calls, "olwsc");
    begun = SH_OK;
    run_take_page(NULL);
}

/* ---- a recording */

/* The link of a replay gets the recording's own frames. */
static void a_recording_is_replayed(void **state)
{
    (void)state;
    char want[256];
    unsigned frames;
    does(&app_run, "s.shs --start --pace fast --config file.yaml", 0);
    const char *at = strstr(on_err, " frames replayed, ");
    assert_non_null(at);
    while (at > on_err && at[-1] != ' ')
        at--;
    assert_int_equal(sscanf(at, "%u", &frames), 1);
    assert_true(frames > 20);
    snprintf(want, sizeof want, "scanhead: %u frames replayed, begun 1 time\n", frames);
    has(on_err, want);
    has(on_err, "scanhead: replay of s.shs: scanhead,sphere,");
    has(on_err, "\nscanhead: link file:again.shs, native\n");
    assert_null(strstr(on_err, "it is played when"));
    does(&app_record, "again.shs -o a.ply --quiet", 0);
    does(&app_record, "s.shs -o b.ply --quiet", 0);
    char *one = contents("a.ply"), *other = contents("b.ply");
    snprintf(want, sizeof want, "element vertex %d\n", POINTS);
    has(one, want);
    assert_string_equal(strstr(one, want), strstr(other, want)); /* up to the first zero byte */
    free(one);
    free(other);
    does(&app_run, "s.shs --start --pace fast --config file.yaml --quiet", 0);
    assert_string_equal(on_err, "");
}

/* Links of tcp have room for their sessions, a pty for one client, and null for none. */
static void options_that_do_not_fit(void **state)
{
    static const struct {
        const char *words, *said;
    } rows[] = {
        {"s.shs --start --journal j", "--journal is for a configuration, but s.shs is a recording of a head"},
        {"s.shs --start --frames 2", "--frames is for a configuration, but s.shs is a recording of a head"},
        {"s.shs --start --surfaces x.csv", "--surfaces is for a configuration, but s.shs is a recording of a head"},
        {"s.shs --start --unknown error", "--unknown is for a capture of packets, but s.shs is a recording of a head"},
        {"c.yaml --speed 2", "--speed is for a recording of a head, but c.yaml is a configuration"},
        {"c.yaml --clients 2", "--clients is for a recording of a head, but c.yaml is a configuration"},
        {"c.yaml --loop", "--loop is for a recording or a capture, but c.yaml is a configuration"},
        {"c.yaml --link tcp", "--link is for a recording or a capture, but c.yaml is a configuration"},
        {"s.shs --config tcp.yaml --link tcp", "--config and --link: both give the links; allowed is one of them"},
        {"s.shs --clients 2",
         "--clients: without --start a client's SCAN:STARt begins the replay; allowed with --start"},
        {"s.shs --from 2 --to 2", "--to 2 is not after --from, which is 2; allowed is a larger number"},
        {"s.shs --start --from 3 --to 2", "--to 2 is not after --from, which is 3; allowed is a larger number"},
        {"s.shs --start --clients 5 --config tcp.yaml",
         "--clients 5: the links have room for 4; allowed is that many, or more links"},
        {"s.shs --start --clients 1 --link null",
         "--clients 1: the links have room for 0; allowed is that many, or more links"},
        {"s.shs --link null", "s.shs: without --start a client begins the replay, and null, file and udp links have"},
        {"s.shs --link pty --link bogus", "--link:2: links[1].type: \"bogus\" is not known"},
        {"s.shs --start --speed 2 --pace fast --link null", "--speed: allowed only with the pace realtime"},
        {"s.shs --link a#b", "--link 'a#b': allowed are pty, tcp, ... or keys such as 'type: tcp, port: 5025'"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        does(&app_run, rows[i].words, 2);
        has(on_err, rows[i].said);
        assert_ptr_equal(strchr(on_err, '\n'), on_err + strlen(on_err) - 1); /* one line */
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_head_says_what_it_is_and_when_it_ends),
        cmocka_unit_test(a_page_is_opened_for_web_links),
        cmocka_unit_test(a_recording_is_replayed),
        cmocka_unit_test(options_that_do_not_fit),
    };
    return cmocka_run_group_tests_name("run commands", tests, go_there, commands_end);
}
