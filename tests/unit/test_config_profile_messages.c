/* SPDX-License-Identifier: MIT */
/* Diagnostics of head profiles, and of --set, each compared whole: place, key, what is wrong, and all numbers of what
 * is allowed. The numbers were worked out by hand from config/heads. */
#include "tests/unit/config_rig.h"

/* clang-format off */
#define FARTHEST "{ value: 130, from: quoted, source: \"a reseller's page\" }"
#define FIGURE "allowed { value: V, from: data sheet }, or from: quoted, from: assumed"
#define ONE_STEP "; the head's steps_per_turn (1440) divided by this number must be a whole number that also divides first_step, last_step and front_step"
static const struct {
    const char *head, *old, *with, *key, *text;
} profiles[] = {
    {"leica-rtc360", FARTHEST, "130", "range_max_m", "here stands a single value; " FIGURE},
    {"leica-rtc360", FARTHEST, "{ value: 130 }", "range_max_m", "\"from\" is missing; " FIGURE},
    {"leica-rtc360", FARTHEST, "{ from: assumed }", "range_max_m", "\"value\" is missing; " FIGURE},
    {"leica-rtc360", FARTHEST, "{ value: 130, from: hearsay }", "range_max_m",
     "\"from\" must say where the figure is from; allowed data sheet, quoted, assumed"},
    {"leica-rtc360", FARTHEST, "{ value: 130, from: assumed, note: }", "range_max_m",
     "\"note\" must say something in words; allowed a text in one line"},
    {"leica-rtc360", FARTHEST, "{ value: 130, from: assumed, source: \"a\\nb\" }", "range_max_m",
     "\"source\" must say something in words; allowed a text in one line"},
    {"leica-rtc360", FARTHEST, "{ value: 1, value: 2, from: assumed }", "range_max_m",
     "a key that is unknown or given twice; " FIGURE ", then source, note"},
    {"leica-rtc360", "definition: 1/e2 }", "defined: 1/e2 }", "beam_exit_m",
     "a key that is unknown or given twice; " FIGURE ", then source, note, definition"},
    {"leica-rtc360", "definition: 1/e2,", "definition: 1/e3,", "beam_divergence_rad",
     "\"definition\" must say how the width is defined; allowed 1/e2, 1/e, FWHM, half angle 1/e2"},
    {"leica-rtc360", "facets: { value: 1,", "facets: { value: 2,", "fov_max_deg",
     "a field of view of 300 deg does not fit into a sweep; allowed up to 180 deg, 360 / facets * optical_gain"},
    {"leica-rtc360", "optical_gain: { value: 1,", "optical_gain: { value: 2,", "optical_gain",
     "a sweep of 360 / facets * optical_gain is 720 deg; allowed up to 360"},
    {"leica-rtc360", "pan_max_deg: { value: 180,", "pan_max_deg: { value: 0,", "pan_max_deg", "0 does not fit; allowed above 0, up to 360"},
    {"leica-rtc360", "pan_min_deg: { value: 0,", "pan_min_deg: { value: -181,", "pan_max_deg", "180 does not fit; allowed above -181, up to 179"},
    {"leica-rtc360", "lines_min_hz: { value: 5,", "lines_min_hz: { value: 101,", "lines_min_hz", "101 is too large; allowed at most 100"},
    {"leica-rtc360", "prr_min_hz: { value: 10000,", "prr_min_hz: { value: 2000001,", "prr_min_hz", "2000001 is too large; allowed at most 2000000"},
    {"leica-rtc360", "fov_min_deg: { value: -60,", "fov_min_deg: { value: 240,", "fov_min_deg", "240 is too large; allowed below 240"},
    {"leica-rtc360", "range_sigma_floor_m: { value: 0.00016,", "range_sigma_floor_m: { value: 0.002,", "range_sigma_floor_m",
     "0.002 is too large; allowed at most 0.0005"},
    {"hokuyo-urg-04lx", "lines_max_hz: { value: 10,", "lines_max_hz: { value: 9800,", "steps_per_turn",
     "1024 pulses a line and lines_max_hz 9800 make 10035200 pulses/s; allowed up to 10000000"},
    {"hokuyo-urg-04lx", "steps_per_turn: { value: 1024,", "steps_per_turn: { value: 725,", "last_step", "725, and a turn has 725 steps; allowed up to 724"},
    {"hokuyo-urg-04lx", "last_step: { value: 725,", "last_step: { value: 0,", "last_step",
     "0, so no angle lies between the first and the last step; allowed 1 to 1023"},
    {"hokuyo-urg-04lx", "first_step: { value: 44,", "first_step: { value: 726,", "first_step", "726, but last_step is 725; allowed 0 to 724"},
    {"hokuyo-urg-04lx", "front_step: { value: 384,", "front_step: { value: 1025,", "front_step", "1025, and a turn has 1024 steps; allowed up to 1023"},
    {"velodyne-vlp16", "firing_ns: { value: 55296,", "firing_ns: { value: 55296.0001,", "firing_ns", "55296.0001 is too fine; allowed multiples of 0.001 ns"},
    {"velodyne-vlp16", "firing_ns: { value: 55296,", "firing_ns: { value: 50000000.001,", "firing_ns",
     "50000000.001 ns is longer than a turn at lines_max_hz; allowed up to 50000000 ns"},
    {"velodyne-vlp16", "emitter: beams", "emitter: beams\nfacets: { value: 1, from: assumed }", "facets",
     "this emitter has no such key; allowed only with emitter: line"},
    {"velodyne-vlp16", "emitter: beams", "emitter: beams\nfirst_step: { value: 1, from: assumed }", "first_step",
     "this emitter has no such key; allowed only with emitter: planar"},
    {"sick-lms111", "lines_hz: 50,", "lines_hz: 51,", "geometries[0].lines_hz", "51 is outside of lines_min_hz and lines_max_hz; allowed 25 to 50 Hz"},
    {"sick-lms111", "- { lines_hz: 25,", "- { lines_hz: 24,", "geometries[1].lines_hz", "24 is outside of lines_min_hz and lines_max_hz; allowed 25 to 50 Hz"},
    {"sick-lms111", "steps_per_turn: 720,", "steps_per_turn: 700,", "geometries[0].steps_per_turn", "700" ONE_STEP},
    {"sick-lms111", "steps_per_turn: 720,", "steps_per_turn: 2880,", "geometries[0].steps_per_turn", "2880" ONE_STEP},
    {"sick-lms111", "lines_hz: 50,", "lines_hz: 25,", "geometries[2].lines_hz", "this geometry is given twice; allowed once"},
};
/* clang-format on */

static void profiles_are_refused_word_by_word(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof profiles / sizeof *profiles; i++) {
        char place[256];
        load_changed(profiles[i].head, profiles[i].old, profiles[i].with);
        place_in_profile(profiles[i].key, place, sizeof place);
        place[strlen(place) - strlen(profiles[i].key) - 2] = '\0';
        expect_only(place, profiles[i].key, profiles[i].text);
    }
}

/* 10^7 pulses/s are the most. */
static void so_many_beams_fire_so_often(void **state)
{
    (void)state;
    static const struct {
        const char *firing_ns, *beams, *says; /* NULL: it is taken */
    } rows[] = {
        {"100", "  - {elevation_deg: 0, offset_ns: 0, from: assumed}\n", NULL},
        {"99", "  - {elevation_deg: 0, offset_ns: 0, from: assumed}\n",
         "1 beam in 99 ns make 10101010.1 pulses/s; allowed up to 10000000"},
        {"199",
         "  - {elevation_deg: 0, offset_ns: 0, from: assumed}\n  - {elevation_deg: 1, offset_ns: 9, from: assumed}\n",
         "2 beams in 199 ns make 10050251.26 pulses/s; allowed up to 10000000"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char text[8448], place[256];
        char *whole = read_source("config/heads/velodyne-vlp16.yaml");
        snprintf(text, sizeof text, "%.*sfiring_ns: {value: %s, from: assumed}\nbeams:\n%s%s",
                 (int)(strstr(whole, "firing_ns:") - whole), whole, rows[i].firing_ns, rows[i].beams,
                 strstr(whole, "lines_min_hz:"));
        write_in("heads/mine.yaml", text);
        free(whole);
        load_with_head("mine", "", "");
        if (rows[i].says == NULL) {
            assert_loads(err.code);
            continue;
        }
        place_in_profile("firing_ns", place, sizeof place);
        place[strlen(place) - strlen("firing_ns: ")] = '\0';
        expect_only(place, "firing_ns", rows[i].says);
    }
}

/* 40 ms are a turn of 25 Hz, and 20 Hz are the most: the rotor may turn a quarter too fast, more than any motor_ppm.
 * 49,999,900 ns are a turn of 20.00004 Hz: 2 ppm. */
static void a_turn_has_a_firing_sequence(void **state)
{
    (void)state;
    static const struct {
        const char *firing_ns, *ppm, *allowed; /* NULL: it is taken */
    } rows[] = {{"40000000", "10000", NULL}, {"50000000", "1", "0"},   {"50000000", "0", NULL},
                {"50000000", "-5", NULL},    {"49999900", "2.1", "2"}, {"49999900", "2", NULL}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char text[8448], settings[64], says[256];
        char *whole = read_source("config/heads/velodyne-vlp16.yaml");
        snprintf(
            text, sizeof text,
            "%.*sfiring_ns: {value: %s, from: assumed}\nbeams: [{elevation_deg: 0, offset_ns: 0, from: assumed}]\n%s",
            (int)(strstr(whole, "firing_ns:") - whole), whole, rows[i].firing_ns, strstr(whole, "lines_min_hz:"));
        write_in("heads/mine.yaml", text);
        free(whole);
        snprintf(settings, sizeof settings, "  motor_ppm: %s\n", rows[i].ppm);
        const int code = load_with_head("mine", settings, "");
        if (rows[i].allowed == NULL) {
            assert_loads(code);
            continue;
        }
        snprintf(says, sizeof says,
                 ":3: head.motor_ppm: %s makes a turn at 20 lines per second shorter than the firing sequence of head "
                 "profile mine; allowed up to %s",
                 rows[i].ppm, rows[i].allowed);
        assert_says(says);
    }
}

/* Velodyne's packets have 16 beams. */
static void a_protocol_has_its_beams(void **state)
{
    (void)state;
    static const char *const sets[] = {"links=[{type: udp, port: 1, protocol: velodyne}]"};
    char text[8448], *whole = read_source("config/heads/velodyne-vlp16.yaml");
    snprintf(
        text, sizeof text,
        "%.*sfiring_ns: {value: 55296, from: assumed}\nbeams:\n"
        "  - {elevation_deg: 0, offset_ns: 0, from: assumed}\n  - {elevation_deg: 1, offset_ns: 9, from: assumed}\n%s",
        (int)(strstr(whole, "firing_ns:") - whole), whole, strstr(whole, "lines_min_hz:"));
    write_in("heads/mine.yaml", text);
    free(whole);
    assert_loads(load_with_head("mine", "", ""));
    assert_int_equal(load_sets(sets, 1), SH_EINPUT);
    expect_only("--set ", "links[0].protocol",
                "velodyne has 16 beams, but head profile mine (line 2) has 2; allowed 16");
}

static const char other_sequence[] =
    "another firing sequence; allowed is that of a VLP-16: clockwise, 55.296 us, with a "
    "beam each 2.304 us, all at azimuth 0";
static const struct {
    const char *profile, *old, *with, *link, *has; /* NULL: it loads */
} described[] = {
    {"velodyne-vlp16", "firing_ns: { value: 55296", "firing_ns: { value: 60000", "{type: udp, protocol: velodyne}",
     other_sequence},
    {"velodyne-vlp16", "{ elevation_deg: 15,", "{ elevation_deg: 15, azimuth_deg: 1,",
     "{type: udp, protocol: velodyne}", other_sequence},
    {"velodyne-vlp16", "offset_ns: 2304,", "offset_ns: 2305,", "{type: udp, protocol: velodyne}", other_sequence},
    {"velodyne-vlp16", "emitter: beams", "emitter: beams\nstep_direction: { value: counter-clockwise, from: quoted }",
     "{type: udp, protocol: velodyne}", other_sequence},
    {"velodyne-vlp16", "elevation_deg: 15,", "elevation_deg: 25,", "{type: udp, protocol: velodyne}", NULL},
    {"velodyne-vlp16", "firing_ns: { value: 55296", "firing_ns: { value: 60000",
     "{type: udp, protocol: velodyne-position}", NULL}, /* it says nothing of firings */
    {"hokuyo-ust-10lx", "steps_per_turn: { value: 1440", "steps_per_turn: { value: 2880", "{type: tcp, protocol: scip}",
     NULL},
    {"hokuyo-ust-10lx", "steps_per_turn: { value: 1440", "steps_per_turn: { value: 2881", "{type: tcp, protocol: scip}",
     "steps up to 1080 of 2881 a turn; allowed are 2880 a turn at most"},
    {"sick-lms111", "{ lines_hz: 25, steps_per_turn: 720,", "{ lines_hz: 25, steps_per_turn: 72,",
     "{type: tcp, protocol: cola}", NULL},
    {"sick-lms111", "{ lines_hz: 25, steps_per_turn: 720,", "{ lines_hz: 25, steps_per_turn: 48,",
     "{type: tcp, protocol: cola}", "48 steps a turn; allowed are 55 and more, of 6.5535 degrees at most"},
};

/* Configurations refuse the heads whose recordings replay refuses: firing times other than those of the formula in
 * VELODYNE.md, more than 2880 steps (SCIP.md), steps of more than 6.5535 deg (CoLa), of any of the geometries. Beams may
 * have any elevation, which clients read from a calibration file. */
static void a_protocol_can_describe_the_head(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof described / sizeof *described; i++) {
        char set[96], says[300];
        snprintf(set, sizeof set, "links=[%s]", described[i].link);
        const char *const sets[] = {set, "links.0.port=1", "time.epoch=utc", "output.layout=polar",
                                    "stations[0]={position_m: [1, 2, 3], lat_deg: 1, lon_deg: 2, height_m: 3}"};
        assert_loads(load_changed(described[i].profile, described[i].old, described[i].with));
        const int code = load_sets(sets, sizeof sets / sizeof *sets);
        if (described[i].has == NULL) {
            assert_loads(code);
            continue;
        }
        if (code != SH_EINPUT) fail_msg("row %zu was taken", i);
        snprintf(says, sizeof says, "protocol %s does not support head profile mine (line 2), which has %s",
                 strstr(described[i].link, "velodyne") != NULL ? "velodyne"
                 : strstr(described[i].link, "scip") != NULL   ? "scip"
                                                               : "cola",
                 described[i].has);
        expect_only("--set ", "links[0].protocol", says);
    }
}

/* ---- the file's name and path */

static void the_file_names_the_profile(void **state)
{
    (void)state;
    static const char ascii[] = ": the file's name is the name of the profile; allowed printable ASCII";
    static const char length[] = ": the file's name is the name of the profile; allowed 1 to 31 characters and .yaml";
    static const struct {
        const char *name, *says; /* NULL: it loads */
    } names[] = {{"0123456789012345678901234567890", NULL},
                 {"01234567890123456789012345678901", length},
                 {"~!", NULL},
                 {"a b", ascii},
                 {"a\xc3\xa4", ascii}};
    char *text = read_source("config/heads/any-rate.yaml");
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        char file[64], head[80], path[160];
        snprintf(file, sizeof file, "heads/%s.yaml", names[i].name);
        snprintf(head, sizeof head, "\"%s\"", file);
        snprintf(path, sizeof path, "%s/%s", dir, file);
        write_in(file, text);
        const int code = load_with_head(head, "", "");
        remove(path);
        if (names[i].says == NULL) {
            assert_loads(code);
            assert_string_equal(cfg->profile.name, names[i].name);
            continue;
        }
        assert_int_equal(code, SH_EINPUT);
        assert_int_equal(strncmp(err.text, path, strlen(path)), 0);
        assert_string_equal(err.text + strlen(path), names[i].says);
    }
    free(text);
}

/* The path of a profile has the same limit as other paths, and the configuration's folder counts. */
static void the_longest_path_of_a_profile(void **state)
{
    (void)state;
    static const char file[] = "/any.yaml";
    char *text = read_source("config/heads/any-rate.yaml"), head[CONFIG_PATH_LEN + 2];
    write_in("heads/any.yaml", text);
    free(text);
    for (size_t more = 0; more <= 1; more++) {
        const size_t len = CONFIG_PATH_LEN - 1 + more - (strlen(dir) + 1);
        memset(head, '/', len);
        memcpy(head, "heads", 5);
        strcpy(head + len - (sizeof file - 1), file);
        char *whole = replaced(base, "any-rate\n" PRR LINES, "@\n"), *named = replaced(whole, "@", head);
        const int code = load_text(named);
        free(whole);
        free(named);
        if (more == 0) {
            assert_loads(code);
            assert_int_equal(strlen(cfg->profile_file), CONFIG_PATH_LEN - 1);
        } else {
            assert_int_equal(code, SH_EINPUT);
            assert_says(":2: head.profile: its path is too long; allowed up to 511 bytes");
        }
    }
    char path[128];
    snprintf(path, sizeof path, "%s/heads/any.yaml", dir);
    remove(path);
}

/* ---- keys of --set: an error names the line of another key, or that this key comes from --set, too */

static void sets_are_refused_word_by_word(void **state)
{
    (void)state;
    static const struct {
        const char *sets[3];
        int n;
        const char *key, *text;
    } rows[] = {
        {{"links[2].type=tcp"},
         1,
         "links[2].type",
         "links has 1 element; allowed indices 0 to 1, the last appends one"},
        {{"links[].type=tcp"}, 1, "links[].type", "no index; allowed as in links[0].type"},
        {{"links.type=tcp"}, 1, "links.type", "unknown key; links is a list; allowed an index, as in links[0]"},
        {{"head.prr_hz.x=1"},
         1,
         "head.prr_hz.x",
         "unknown key; head.prr_hz has no keys that can be set; allowed head.prr_hz=VALUE"},
        {{"head"}, 1, "head", "no '='; allowed KEY=VALUE, as in head.prr_hz=300000"},
        {{"=5"}, 1, "=5", "no key; allowed KEY=VALUE, as in head.prr_hz=300000"},
        {{"links=[{type: tcp, protocol: scip}]"},
         1,
         "links[0].protocol",
         "protocol scip does not support head profile any-rate (line 2), whose emitter is line; allowed emitters: planar"},
        {{"links=[{type: tcp, protocol: scip}]", "head.profile=sphere", "head={profile: sphere}"},
         3,
         "links[0].protocol",
         "protocol scip does not support head profile sphere (--set), whose emitter is sphere; allowed emitters: planar"},
        {{"links=[{type: udp, port: 1, protocol: velodyne}]", "head={profile: velodyne-vlp16}", "output.layout=geo"},
         3,
         "links[0].protocol",
         "velodyne needs ranges, but output.layout is geo (--set); required is layout: polar"},
        {{"links=[{type: udp, port: 1, protocol: velodyne}]", "head={profile: velodyne-vlp16}", "beam.echoes=first"},
         3,
         "links[0].protocol",
         "velodyne has no first echoes, but beam.echoes is first (--set); required is all, last or strongest"},
        {{"links=[{type: null}, {type: tcp, protocol: capture}]"},
         1,
         "links[1].protocol",
         "capture is for `run FILE.pcap`; allowed for a head are all other protocols"},
        {{"head={profile: sick-lms111}", "links=[{type: tcp, protocol: cola}]", "ntp={role: client}"}, 3, NULL, NULL},
        {{"head={profile: sick-lms111}", "instrument.collimation_deg=1"},
         2,
         "instrument.collimation_deg",
         "an error of a mirror, but head profile sick-lms111 has emitter: planar; allowed with a line head"},
        {{"head={profile: sick-lms111}", "instrument.trunnion_deg=1"},
         2,
         "instrument.trunnion_deg",
         "an error of a mirror, but head profile sick-lms111 has emitter: planar; allowed with a line head"},
        {{"head={profile: sick-lms111}", "instrument.mirror_offset_m=1"},
         2,
         "instrument.mirror_offset_m",
         "an error of a mirror, but head profile sick-lms111 has emitter: planar; allowed with a line head"},
        {{"head={profile: sick-lms111}", "instrument.mirror_phase_deg=1"},
         2,
         "instrument.mirror_phase_deg",
         "an error of a mirror, but head profile sick-lms111 has emitter: planar; allowed with a line head"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        write_file(config_path, base, strlen(base));
        load_sets(rows[i].sets, rows[i].n);
        if (rows[i].key == NULL)
            assert_loads(err.code);
        else
            expect_only("--set ", rows[i].key, rows[i].text);
    }
    /* a server's time runs on */
    static const char *const fast[] = {"head={profile: sick-lms111}", "links=[{type: tcp, protocol: cola}]",
                                       "ntp.role=client", "loop.pace=fast"};
    load_sets(fast, 4);
    expect_only("--set ", "ntp.role",
                "client, but loop.pace is fast; allowed with realtime, as a server's time runs on");
}

/* A long value is cut to 60 bytes, but not within a character of UTF-8, and its control characters are replaced. */
static void values_are_shown_safe_and_short(void **state)
{
    (void)state;
    char set[128], text[256], value[80];
    for (int len = 59; len <= 62; len++) {
        memset(value, 'x', sizeof value);
        value[len] = '\0';
        snprintf(set, sizeof set, "head.lines_hz=%s", value);
        snprintf(text, sizeof text, "\"%.*s%s\" is not a number; allowed 3 to 240 Hz", len < 60 ? len : 60, value,
                 len > 60 ? "..." : "");
        load_set(set);
        expect_only("--set ", "head.lines_hz", text);
    }
    memcpy(value + 59, "\xc3\xbcx", 4); /* two bytes, which would be cut in the middle */
    snprintf(set, sizeof set, "head.lines_hz=%s", value);
    snprintf(text, sizeof text, "\"%.59s...\" is not a number; allowed 3 to 240 Hz", value);
    load_set(set);
    expect_only("--set ", "head.lines_hz", text);
    load_set("head.lines_hz=\x01"
             "a\x1f\x7f~");
    expect_only("--set ", "head.lines_hz", "\"?a??~\" is not a number; allowed 3 to 240 Hz");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(profiles_are_refused_word_by_word), cmocka_unit_test(so_many_beams_fire_so_often),
        cmocka_unit_test(a_turn_has_a_firing_sequence),      cmocka_unit_test(a_protocol_has_its_beams),
        cmocka_unit_test(a_protocol_can_describe_the_head),  cmocka_unit_test(the_file_names_the_profile),
        cmocka_unit_test(the_longest_path_of_a_profile),     cmocka_unit_test(values_are_shown_safe_and_short),
        cmocka_unit_test(sets_are_refused_word_by_word),
    };
    return cmocka_run_group_tests_name("messages of head profiles", tests, set_up, tear_down);
}
