/* SPDX-License-Identifier: MIT */
/* Each kind of injected fault: the keys that it has, its limits, and what the configuration must have for it. The table
 * was typed from fault/README.md, device/README.md and the help of the keys. */
#include "firmware_sim/config/load.h"
#include "tests/unit/config_rig.h"

static const struct kind {
    const char *name, *keys;
    char place;          /* f: a frame, a: an act of the link at a frame, r: a reply, c: a connection, m: a moment */
    double n_max;        /* 0: it has no n */
    int n;               /* where n is not given */
    const char *most_ms; /* NULL: for_ms is not needed */
    char needs;          /* t: a time of day, p: a follower of PTP, s: a scanner that asks a time server */
} kinds[FAULT_N_KINDS] = {
    {"drop", "", 'f', 0, 1, NULL, 0},
    {"duplicate", "n", 'f', 100, 1, NULL, 0},
    {"reorder", "n", 'f', 1000, 1, NULL, 0},
    {"delay", "for_ms", 'f', 0, 1, "1e8", 0},
    {"jitter", "for_ms", 'f', 0, 1, "1e8", 0},
    {"truncate", "n", 'f', 1e6, 0, NULL, 0},
    {"flip", "n, byte, reseal", 'f', 1000, 1, NULL, 0},
    {"stall", "for_ms", 'f', 0, 1, "1e8", 0},
    {"split", "n", 'f', 64, 2, NULL, 0},
    {"merge", "n", 'f', 64, 2, NULL, 0},
    {"garbage", "n", 'f', 1024, 16, NULL, 0},
    {"no_reply", "", 'r', 0, 1, NULL, 0},
    {"late_reply", "for_ms", 'r', 0, 1, "1e8", 0},
    {"wrong_reply", "", 'r', 0, 1, NULL, 0},
    {"echo", "", 'r', 0, 1, NULL, 0},
    {"disconnect", "for_ms", 'a', 0, 1, NULL, 0},
    {"unplug", "for_ms", 'a', 0, 1, "1e8", 0},
    {"cable", "for_ms, reset", 'a', 0, 1, "1e8", 0},
    {"usb_reset", "", 'a', 0, 1, NULL, 0},
    {"endpoint_stall", "", 'a', 0, 1, NULL, 0},
    {"short_packets", "n", 'a', 1e6, 1, NULL, 0},
    {"refuse", "", 'c', 0, 1, NULL, 0},
    {"slow_enumeration", "for_ms", 'c', 0, 1, "1e8", 0},
    {"descriptor_length", "n", 'c', 1000, 1, NULL, 0},
    {"slow_boot", "for_ms", 'm', 0, 1, "1e8", 0},
    {"power_cycle", "for_ms", 'm', 0, 1, "1e8", 0},
    {"self_test", "", 'm', 0, 1, NULL, 0},
    {"mirror_slow", "factor", 'm', 0, 1, NULL, 0},
    {"mirror_stuck", "", 'm', 0, 1, NULL, 0},
    {"mirror_wobble", "deg, hz", 'm', 0, 1, NULL, 0},
    {"pan_slip", "deg", 'm', 0, 1, NULL, 0},
    {"laser_off", "", 'm', 0, 1, NULL, 0},
    {"window_soiled", "loss_db", 'm', 0, 1, NULL, 0},
    {"clock_jump", "jump_s", 'm', 0, 1, NULL, 't'},
    {"clock_drift", "ppm", 'm', 0, 1, NULL, 't'},
    {"clock_stop", "", 'm', 0, 1, NULL, 't'},
    {"pps_lost", "", 'm', 0, 1, NULL, 't'},
    {"pps_jitter", "for_ms", 'm', 0, 1, "400", 't'},
    {"nmea_lost", "", 'm', 0, 1, NULL, 't'},
    {"nmea_late", "for_ms", 'm', 0, 1, "5000", 't'},
    {"nmea_void", "", 'm', 0, 1, NULL, 't'},
    {"nmea_checksum", "", 'm', 0, 1, NULL, 't'},
    {"ptp_lost", "ppm", 'm', 0, 1, NULL, 'p'},
    {"ptp_no_sync", "ppm", 'm', 0, 1, NULL, 'p'},
    {"ptp_faulty", "ppm", 'm', 0, 1, NULL, 'p'},
    {"ptp_grandmaster", "ns, grandmaster, clock_class", 'm', 0, 1, NULL, 'p'},
    {"ptp_step", "ns", 'm', 0, 1, NULL, 'p'},
    {"ptp_asymmetry", "ns", 'm', 0, 1, NULL, 'p'},
    {"ptp_jitter", "ns", 'm', 0, 1, NULL, 'p'},
    {"leap_second", "", 'm', 0, 1, NULL, 't'},
    {"counters_high", "n", 'm', 1e9, 1, NULL, 0},
    {"ntp_silent", "", 'm', 0, 1, NULL, 's'},
    {"ntp_kiss", "", 'm', 0, 1, NULL, 's'},
    {"ntp_unsync", "", 'm', 0, 1, NULL, 's'},
    {"ntp_step", "jump_s", 'm', 0, 1, NULL, 's'},
};

/* Returns whether one of the diagnostics ends with this text. */
static int is_said(const char *text)
{
    const size_t len = strlen(text);
    for (uint32_t i = 0; i < diagnostics.n && i < CONFIG_MAX_DIAGNOSTICS; i++) {
        const size_t of = strlen(diagnostics.err[i].text);
        if (of >= len && strcmp(diagnostics.err[i].text + of - len, text) == 0) return 1;
    }
    return 0;
}

/* Reads a scenario whose second fault is of this kind; any diagnostic is of that one, and of its line. */
static void read_kind(const struct kind *kind, const char *rest)
{
    char text[400], path[128], place[160];
    snprintf(text, sizeof text, "faults:\n  - {kind: drop}\n  - {kind: %s%s}\n", kind->name, rest);
    write_in("cube.yaml", text);
    snprintf(path, sizeof path, "%s/cube.yaml", dir);
    snprintf(place, sizeof place, "%s:3: faults[1].", path);
    cfg->faults.n = 0;
    config_add_scenario(cfg, path, &diagnostics);
    remove(path);
    for (uint32_t i = 0; i < diagnostics.n && i < CONFIG_MAX_DIAGNOSTICS; i++)
        if (strncmp(diagnostics.err[i].text, place, strlen(place)) != 0) fail_msg("%s", diagnostics.err[i].text);
}

static void load_base(void)
{
    assert_loads(load_text(base));
}

static void kinds_have_places_and_numbers(void **state)
{
    (void)state;
    for (int k = 0; k < FAULT_N_KINDS; k++) {
        const struct fault fault = {.kind = (enum fault_kind)k}, given = {.kind = (enum fault_kind)k, .n = 7};
        const enum fault_place place = fault_place_of(fault.kind);
        assert_string_equal(fault_names[k], kinds[k].name);
        assert_int_equal("frcm"[place], kinds[k].place == 'a' ? 'f' : kinds[k].place);
        assert_int_equal(fault_is_act(fault.kind), kinds[k].place == 'a');
        assert_int_equal(fault_n(&fault), kinds[k].n);
        assert_int_equal(fault_n(&given), 7);
    }
}

static void kinds_have_their_keys(void **state)
{
    (void)state;
    static const char *const what[] = {"n",  "byte",    "reseal", "for_ms", "reset", "factor",      "deg",
                                       "hz", "loss_db", "jump_s", "ppm",    "ns",    "clock_class", "grandmaster"};
    load_base();
    for (int k = 0; k < FAULT_N_KINDS; k++) {
        read_kind(&kinds[k],
                  ", n: 5, byte: 30, reseal: on, for_ms: 3, reset: on, factor: 0.5, deg: 1, hz: 2, loss_db: 3, "
                  "jump_s: 1, ppm: 5, ns: 7, clock_class: 7, grandmaster: 0x12");
        for (size_t i = 0; i < sizeof what / sizeof *what; i++) {
            char want[128], has[64], word[32];
            snprintf(want, sizeof want, "faults[1].%s: %s has no such key; allowed %s", what[i], kinds[k].name,
                     kinds[k].keys[0] != '\0' ? kinds[k].keys : "only keys that say when and where");
            snprintf(has, sizeof has, ", %s,", kinds[k].keys);
            snprintf(word, sizeof word, ", %s,", what[i]);
            if (is_said(want) != (strstr(has, word) == NULL)) fail_msg("%s: %s", kinds[k].name, what[i]);
        }
    }
}

static void what_is_not_given_is_as_said(void **state)
{
    (void)state;
    load_base();
    for (int k = 0; k < FAULT_N_KINDS; k++) {
        if (kinds[k].place == 'm') continue; /* some need more than base has */
        read_kind(&kinds[k], kinds[k].most_ms != NULL ? ", for_ms: 2.5" : "");
        assert_true(diagnostics.n == 0 && cfg->faults.n == 2);
        const struct fault *f = &cfg->faults.fault[1];
        assert_int_equal(f->kind, k);
        assert_true(f->link == 0 && f->of == FAULT_OF_STREAM && f->at == 0 && f->from == 1 && f->until == 0);
        assert_true(f->every == 1 && f->probability == 1.0 && f->count == 0 && f->seed == 1 && f->from_pulse == 0);
        assert_true(f->until_pulse == UINT64_MAX && f->from_s == 0.0 && f->until_s == 0.0 && f->n == 0);
        assert_true(f->byte == -1 && !f->reseal && !f->reset);
        assert_true(f->for_ms == (kinds[k].most_ms != NULL ? 2.5 : 0.0));
    }
}

static void numbers_and_times_have_limits(void **state)
{
    (void)state;
    load_base();
    for (int k = 0; k < FAULT_N_KINDS; k++) {
        const struct kind *kind = &kinds[k];
        char rest[64], want[128];
        for (int over = 0; over < 2 && kind->n_max > 0.0 && kind->n_max < 1e9; over++) {
            snprintf(rest, sizeof rest, ", n: %.0f", kind->n_max + over);
            snprintf(want, sizeof want, "faults[1].n: %.0f is too many for %s; allowed up to %.0f", kind->n_max + 1,
                     kind->name, kind->n_max);
            read_kind(kind, rest);
            if (is_said(want) != over) fail_msg("%s%s: %s", kind->name, rest, err.text);
        }
        snprintf(want, sizeof want, ": %s needs for_ms; allowed above 0 to %s ms", kind->name,
                 kind->most_ms != NULL ? kind->most_ms : "1e8");
        read_kind(kind, "");
        assert_int_equal(is_said(want), kind->most_ms != NULL);
        if (kind->most_ms == NULL) continue;
        read_kind(kind, ", for_ms: 0");
        assert_true(is_said(want));
        read_kind(kind, ", for_ms: 1e-3");
        assert_false(is_said(want));
        for (int over = 0; over < 2 && strcmp(kind->most_ms, "1e8") != 0; over++) {
            snprintf(rest, sizeof rest, ", for_ms: %s.%d", kind->most_ms, over);
            snprintf(want, sizeof want, "faults[1].for_ms: %s.1 is too long for %s; allowed above 0 to %s ms",
                     kind->most_ms, kind->name, kind->most_ms);
            read_kind(kind, rest);
            assert_int_equal(is_said(want), over);
        }
    }
}

static void kinds_need_what_they_change(void **state)
{
    (void)state;
    static const struct {
        char needs;
        const char *says;
    } rows[] = {{'t', "needs a time of day; allowed where time.epoch is not none"},
                {'p', "needs a follower of PTP; allowed where time.ptp.follower is on"},
                {'s', "needs a scanner that can ask a time server; allowed with a link of protocol: cola, and "
                      "loop.pace: realtime"}};
    load_base();
    for (int k = 0; k < FAULT_N_KINDS; k++) {
        read_kind(&kinds[k], kinds[k].most_ms != NULL ? ", for_ms: 3" : "");
        for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
            char want[200];
            snprintf(want, sizeof want, "faults[1].kind: %s %s", kinds[k].name, rows[i].says);
            if (is_said(want) != (kinds[k].needs == rows[i].needs)) fail_msg("%s: %s", kinds[k].name, want);
        }
    }
}

/* For each key one value changes nothing, and the nearest ones change something. The state of a port that loses its
 * master changes whatever its clock gains, so 0 ppm is no such value there. */
static void a_fault_has_an_effect(void **state)
{
    (void)state;
    static const struct {
        const char *kind, *key, *none, *some[2];
    } rows[] = {
        {"mirror_slow", "factor", "1", {"0.99", "1.01"}}, {"mirror_wobble", "deg", "0", {"-0.001", "1"}},
        {"pan_slip", "deg", "0", {"-0.001", "1"}},        {"window_soiled", "loss_db", "0", {"0.001", "60"}},
        {"clock_jump", "jump_s", "0", {"-1e-9", "1e-9"}}, {"clock_jump", "jump_s", "4e-10", {"-1e-9", "1e-9"}},
        {"clock_drift", "ppm", "0", {"-0.001", "1"}},     {"ptp_step", "ns", "0", {"-1", "1"}},
        {"ptp_asymmetry", "ns", "-0.4", {"-1", "1"}},     {"ptp_jitter", "ns", "0", {"0.5", "1"}},
        {"ntp_step", "jump_s", "0", {"-1e-9", "1"}},      {"ptp_lost", "ppm", "", {"0", "0"}},
        {"ptp_no_sync", "ppm", "", {"0", "0"}},           {"ptp_faulty", "ppm", "", {"0", "0"}},
        {"ptp_grandmaster", "ns", "", {"0", "0"}},
    };
    load_base();
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct kind kind = {.name = rows[i].kind};
        char rest[64], want[160];
        for (int v = 0; v < 3; v++) {
            const char *value = v == 0 ? rows[i].none : rows[i].some[v - 1];
            if (value[0] == '\0') continue;
            snprintf(rest, sizeof rest, ", %s: %s", rows[i].key, value);
            snprintf(want, sizeof want, "faults[1].%s: %s would have no effect with %s; allowed are other values",
                     rows[i].key, rows[i].kind, value);
            read_kind(&kind, rest);
            if (is_said(want) != (v == 0)) fail_msg("%s%s: %s", rows[i].kind, rest, err.text);
        }
    }
}

/* Kinds that a link can have; others are not of links. A terminal can't fall silent: there `cable` does what `unplug`
 * does. */
static void links_have_the_faults_that_they_can(void **state)
{
    (void)state;
    static const struct {
        const char *link, *can;
    } rows[] = {{"type: null", ""},
                {"type: file\n    path: x", ""},
                {"type: pty", " disconnect unplug cable refuse "},
                {"type: tcp", " disconnect unplug cable refuse "},
                {"type: web", " disconnect unplug cable refuse "}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        assert_loads(load_edited("type: tcp\n    port: 0", rows[i].link));
        for (int k = 0; k < FAULT_N_KINDS; k++) {
            char want[128], word[32];
            const int is_of_link = kinds[k].place == 'a' || kinds[k].place == 'c';
            read_kind(&kinds[k], kinds[k].most_ms != NULL ? ", link: 1, for_ms: 3" : ", link: 1");
            snprintf(want, sizeof want, "faults[1].link: link 1 can't have %s; allowed 0, or a link that can",
                     kinds[k].name);
            snprintf(word, sizeof word, " %s ", kinds[k].name);
            if (is_said(want) != (is_of_link && strstr(rows[i].can, word) == NULL))
                fail_msg("%s: %s", rows[i].link, kinds[k].name);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(kinds_have_places_and_numbers),
        cmocka_unit_test(kinds_have_their_keys),
        cmocka_unit_test(a_fault_has_an_effect),
        cmocka_unit_test(what_is_not_given_is_as_said),
        cmocka_unit_test(numbers_and_times_have_limits),
        cmocka_unit_test(kinds_need_what_they_change),
        cmocka_unit_test(links_have_the_faults_that_they_can),
    };
    return cmocka_run_group_tests_name("kinds of faults in the configuration", tests, set_up, tear_down);
}
