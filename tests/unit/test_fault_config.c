/* SPDX-License-Identifier: MIT */
/* Faults on request as the configuration, scenarios and FAULt:ADD read them: refusals, and where they
 * stand. test_config_fault_kinds.c has the keys of each kind. */
#include "firmware_sim/command/command.h"
#include "firmware_sim/config/load.h"
#include "tests/unit/config_rig.h"

static struct fault fault;

static int read_fault(const char *text)
{
    memset(&err, 0, sizeof err);
    return config_read_fault(cfg, text, &fault, &err);
}

static void load_base(void)
{
    assert_int_equal(load_text(base), SH_OK);
}

/* Only a scanner that speaks cola sends dates, which a time server could set. */
static void a_time_server_needs_dates(void **state)
{
    (void)state;
    const char *const client[] = {"ntp.role=client"};
    write_file(config_path, base, strlen(base));
    assert_int_equal(load_sets(client, 1), SH_EINPUT);
    assert_says("ntp.role: client, but no link sends dates; allowed with a link of protocol: cola");
}

/* Only a scanner that speaks cola asks a time server. Its role may be set later, by telegram. */
static void its_faults_need_somebody_who_asks(void **state)
{
    (void)state;
    static const char *const list[] = {"{kind: ntp_silent}", "{kind: ntp_kiss}", "{kind: ntp_unsync}",
                                       "{kind: ntp_step, jump_s: 1}"};
    static const char *const cola[] = {"links=[{type: tcp, port: 0, protocol: cola}]"};
    for (size_t i = 0; i < sizeof list / sizeof *list; i++) {
        assert_int_equal(load_with_head("sick-tim781", "", ""), SH_OK);
        assert_int_equal(read_fault(list[i]), SH_EINPUT);
        assert_says("faults[0].kind: ntp_");
        assert_says("needs a scanner that can ask a time server; allowed with a link of protocol: cola, and "
                    "loop.pace: realtime");
        assert_int_equal(load_sets(cola, 1), SH_OK);
        assert_int_equal(read_fault(list[i]), SH_OK);
        cfg->loop.pace = PACE_FAST;
        assert_int_equal(read_fault(list[i]), SH_EINPUT);
    }
}

/* The list is not cut off. */
static void an_unknown_kind_is_told_all_kinds(void **state)
{
    (void)state;
    load_base();
    assert_int_equal(read_fault("{kind: no_such}"), SH_EINPUT);
    for (int k = 0; k < FAULT_N_KINDS; k++)
        if (strstr(err.text, fault_names[k]) == NULL) fail_msg("%s is not in: %s", fault_names[k], err.text);
}

/* The keys that say when a fault strikes (fault/README.md): each place has its own, and a refusal says which. */
static void a_place_has_its_keys_and_no_others(void **state)
{
    (void)state;
    static const char counted[] = "link, at, from, until, every, probability, count, seed, from_s, until_s";
    static const char moment[] = "from_s, until_s, from_pulse, until_pulse";
    static const struct {
        const char *key, *value, *places; /* f: of a stream frame, r: of a reply, c: of a connection, m: a moment */
    } when[] = {{"link", "1", "frc"},          {"of", "notices", "f"},     {"at", "3", "frc"},
                {"from", "2", "frc"},          {"until", "4", "frc"},      {"every", "2", "frc"},
                {"probability", "0.5", "frc"}, {"count", "2", "frc"},      {"seed", "7", "frc"},
                {"from_pulse", "5", "fm"},     {"until_pulse", "9", "fm"}, {"from_s", "1", "frcm"},
                {"until_s", "2", "frcm"}};
    static const char *const kind[] = {"drop", "no_reply", "refuse", "counters_high"};
    load_base();
    for (size_t i = 0; i < sizeof when / sizeof *when; i++)
        for (size_t k = 0; k < sizeof kind / sizeof *kind; k++) {
            char text[100], want[200];
            const int allowed = strchr(when[i].places, "frcm"[k]) != NULL;
            snprintf(text, sizeof text, "{kind: %s, %s: %s}", kind[k], when[i].key, when[i].value);
            const int code = read_fault(text);
            if ((code == SH_OK) != allowed) fail_msg("%s: %s", text, err.text);
            snprintf(want, sizeof want, "faults[0].%s: %s has no such key; allowed %s", when[i].key, kind[k],
                     k == 3 ? moment : counted);
            if (!allowed) assert_says(want);
        }
}

static void wrong_ones_are_refused_with_what_is_allowed(void **state)
{
    (void)state;
    static const struct {
        const char *text, *says;
    } wrong[] = {
        {"{}", "faults[0].kind"},
        {"{every: 10}", "faults[0].kind"},
        {"{kind: dorp}", "faults[0].kind: "},
        {"{kind: dorp}", "leap_second, counters_high"}, /* the list is whole */
        {"{kind: drop, evry: 10}", "faults[0].evry: unknown key, did you mean faults[0].every?"},
        {"{kind: drop, every: 0}", "faults[0].every: \"0\" is out of range; allowed a whole number, 1 to"},
        {"{kind: drop, every: -1}", "faults[0].every: "},
        {"{kind: drop, from: 0}", "faults[0].from: \"0\" is out of range"},
        {"{kind: drop, at: 1.5}", "faults[0].at: "},
        {"{kind: drop, probability: 1.1}", "faults[0].probability: \"1.1\" is out of range; allowed 0 to 1"},
        {"{kind: drop, probability: .nan}", "faults[0].probability: "},
        {"{kind: drop, of: points}", "faults[0].of: "},
        {"{kind: drop, link: 2}", "faults[0].link: there is no link 2; allowed 0 to 1"},
        {"{kind: drop, link: 9}", "faults[0].link: "},
        {"{kind: cable}", "cable needs for_ms"},
        {"{kind: unplug, for_ms: 1, reset: on}", "unplug has no such key; allowed for_ms"},
        {"{kind: drop, at: 3, every: 2}",
         "faults[0].at: is a single number; allowed only without from, until and every"},
        {"{kind: drop, at: 3, from: 2}", "faults[0].at: is a single number"},
        {"{kind: drop, from: 5, until: 4}", "faults[0].until: is before from, which is 5"},
        {"{kind: drop, from_s: 2, until_s: 2}", "faults[0].until_s: is not after from_s, which is 2 s"},
        {"{kind: drop, from_pulse: 7, until_pulse: 6}", "faults[0].until_pulse: is before from_pulse, which is 7"},
        {"{kind: no_reply, of: notices}", "faults[0].of: no_reply has no such key"},
        {"{kind: no_reply, from_pulse: 1}", "faults[0].from_pulse: no_reply has no such key"},
        {"{kind: delay}", "faults[0].kind: delay needs for_ms; allowed above 0 to 1e8 ms"},
        {"{kind: delay, for_ms: 0}", "faults[0].for_ms: delay needs for_ms"},
        {"{kind: delay, for_ms: 2e8}", "faults[0].for_ms: "},
        {"{kind: pps_jitter}", "faults[0].kind: pps_jitter needs for_ms; allowed above 0 to 400 ms"},
        {"{kind: pps_jitter, for_ms: 400.5}", "400.5 is too long for pps_jitter; allowed above 0 to 400 ms"},
        {"{kind: nmea_late, for_ms: 5001}", "5001 is too long for nmea_late; allowed above 0 to 5000 ms"},
        {"{kind: nmea_void, for_ms: 1}", "faults[0].for_ms: nmea_void has no such key"},
        {"{kind: nmea_checksum}", "faults[0].kind: nmea_checksum needs a time of day"},
        {"{kind: duplicate, n: 101}", "faults[0].n: 101 is too many for duplicate; allowed up to 100"},
        {"{kind: reorder, n: 1001}", "allowed up to 1000"},
        {"{kind: split, n: 65}", "allowed up to 64"},
        {"{kind: merge, n: 65}", "allowed up to 64"},
        {"{kind: garbage, n: 1025}", "allowed up to 1024"},
        {"{kind: flip, n: 1001}", "allowed up to 1000"},
        {"{kind: flip, byte: -1}", "faults[0].byte: "},
        {"{kind: endpoint_stall, link: 1}", "link 1 can't have endpoint_stall; allowed 0, or a link that can"},
        {"drop", "faults[0]"},
        {"{kind: drop}, {kind: flip}", "2 faults; allowed one"},
        {"{kind: drop", "not YAML"},
        {"{kind: drop}} #", "not YAML"},
        {"", "0 faults; allowed one"},
    };
    load_base();
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        if (read_fault(wrong[i].text) == SH_OK) fail_msg("'%s' is taken", wrong[i].text);
        if (strstr(err.text, wrong[i].says) == NULL) fail_msg("'%s': %s", wrong[i].text, err.text);
    }
}

/* Faults of a PTP follower. Their keys are those of device/README.md. */
static void a_follower_has_its_own_faults(void **state)
{
    (void)state;
    static const char *const sets[] = {"time.epoch=2026-01-01T00:00:00Z", "time.ptp.follower=on"};
    static const struct {
        const char *text, *says; /* NULL: it is taken */
    } list[] = {
        {"{kind: ptp_lost, ppm: -0.5}", NULL},
        {"{kind: ptp_no_sync, ppm: 2}", NULL},
        {"{kind: ptp_faulty, ppm: 0}", NULL},
        {"{kind: ptp_step, ns: -1e15}", NULL},
        {"{kind: ptp_asymmetry, ns: -1}", NULL},
        {"{kind: ptp_jitter, ns: 1e9}", NULL},
        {"{kind: ptp_grandmaster, ns: 5, grandmaster: 0xffffffffffffffff, clock_class: 255}", NULL},
        {"{kind: ptp_lost, ns: 1}", "faults[0].ns: ptp_lost has no such key; allowed ppm"},
        {"{kind: ptp_lost, every: 2}", "faults[0].every: ptp_lost has no such key"},
        {"{kind: ptp_step, grandmaster: 0x1}", "allowed ns"},
        {"{kind: ptp_jitter, ns: -1}", "faults[0].ns: -1 is out of range for ptp_jitter; allowed 0 to 1e9 ns"},
        {"{kind: ptp_jitter, ns: 1.1e9}", "allowed 0 to 1e9 ns"},
        {"{kind: ptp_step, ns: 1.1e15}", "faults[0].ns: "},
        {"{kind: ptp_grandmaster, grandmaster: 1209}", "without 0x"},
        {"{kind: ptp_grandmaster, grandmaster: 0x0}", "allowed 0x1 to 0xffffffffffffffff"},
        {"{kind: ptp_grandmaster, grandmaster: 0x10000000000000000}", "out of range"},
        {"{kind: ptp_grandmaster, clock_class: 256}", "faults[0].clock_class: "},
    };
    load_base();
    assert_int_equal(load_sets(sets, 1), SH_OK);
    assert_int_equal(read_fault("{kind: ptp_lost}"), SH_EINPUT);
    assert_says("ptp_lost needs a follower of PTP; allowed where time.ptp.follower is on");
    assert_int_equal(load_sets(&sets[1], 1), SH_EINPUT);
    assert_says("time.ptp.follower: is on, but the time is not known");
    assert_int_equal(load_sets(sets, 2), SH_OK);
    for (size_t i = 0; i < sizeof list / sizeof list[0]; i++) {
        const int code = read_fault(list[i].text);
        if ((code == SH_OK) != (list[i].says == NULL)) fail_msg("%s: %s", list[i].text, err.text);
        if (list[i].says != NULL) assert_says(list[i].says);
    }
    assert_int_equal(read_fault("{kind: ptp_grandmaster, grandmaster: 0xfedcba9876543210}"), SH_OK);
    assert_true(fault.grandmaster == UINT64_C(0xfedcba9876543210) && fault.clock_class == 6 && fault.ns == 1000.0);
}

/* A command line is long enough for many keys, and no longer text is cut. */
static void the_longest_fault_fits_a_command_line(void **state)
{
    (void)state;
    static const char text[] =
        "{kind: flip, link: 1, of: stream, from: 10, until: 900000000000000, every: 7, probability: 0.123456, count: 10, "
        "from_pulse: 1000000, until_pulse: 20000000, from_s: 1.5, until_s: 123456, seed: 1234567, n: 9, byte: 50, "
        "reseal: on}";
    load_base();
    assert_true(strlen("FAUL:ADD ") + strlen(text) <= COMMAND_MAX_LINE);
    assert_int_equal(read_fault(text), SH_OK);
    assert_true(fault.until == 900000000000000 && fault.probability == 0.123456 && fault.until_s == 123456.0 &&
                fault.seed == 1234567 && fault.byte == 50 && fault.reseal == 1);
    enum { MOST = 1010 };
    char padded[MOST + 2];
    memset(padded, ' ', sizeof padded);
    memcpy(padded, "{kind: drop", 11);
    strcpy(padded + MOST - 1, "}");
    assert_int_equal(read_fault(padded), SH_OK);
    strcpy(padded + MOST - 1, " }");
    assert_int_equal(read_fault(padded), SH_EINPUT);
    assert_string_equal(err.text, "longer than 1010 characters");
}

static void faults_stand_in_the_configuration_and_in_scenarios(void **state)
{
    (void)state;
    char path[256];
    struct config_diagnostics wrong;
    assert_int_equal(load_edited("output:", "faults:\n  - {kind: drop, every: 7}\n  - {kind: echo}\noutput:"), SH_OK);
    assert_int_equal(cfg->faults.n, 2);
    assert_true(cfg->faults.fault[0].every == 7 && cfg->faults.fault[1].kind == FAULT_ECHO);
    write_in("scenario.yaml", "faults:\n  - {kind: flip, n: 2}\n");
    snprintf(path, sizeof path, "%s/scenario.yaml", dir);
    assert_int_equal(config_add_scenario(cfg, path, &wrong), SH_OK);
    assert_true(cfg->faults.n == 3 && cfg->faults.fault[2].n == 2 && cfg->faults.fault[2].until_pulse == UINT64_MAX);
    write_in("scenario.yaml", "faults:\n  - {kind: flip, m: 2}\n");
    assert_int_equal(config_add_scenario(cfg, path, &wrong), SH_EINPUT);
    assert_non_null(strstr(wrong.err[0].text, "scenario.yaml:2: faults[0].m: unknown key"));
    write_in("scenario.yaml", "faults:\n  - {kind: flip, n: 2}\n---\n{}\n");
    assert_int_equal(config_add_scenario(cfg, path, &wrong), SH_EINPUT);
    assert_non_null(strstr(wrong.err[0].text, "scenario.yaml:4: a second document; allowed one"));
    write_in("scenario.yaml", "head: {}\n");
    assert_int_equal(config_add_scenario(cfg, path, &wrong), SH_EINPUT);
    write_in("scenario.yaml", "faults: []\n");
    assert_int_equal(config_add_scenario(cfg, path, &wrong), SH_EINPUT);
    assert_non_null(strstr(wrong.err[0].text, "allowed a list of 1 to 32 under faults:"));
    char many[4096] = "faults:\n";
    for (int i = 0; i < 30; i++)
        strcat(many, "  - {kind: drop}\n");
    write_in("scenario.yaml", many);
    assert_int_equal(config_add_scenario(cfg, path, &wrong), SH_EINPUT);
    assert_non_null(strstr(wrong.err[0].text, "30 faults, and the configuration has 3; allowed 32 together"));
    assert_int_equal(cfg->faults.n, 3); /* the list is as it was */
    snprintf(path, sizeof path, "%s/none.yaml", dir);
    assert_int_equal(config_add_scenario(cfg, path, &wrong), SH_EINPUT);
    assert_int_equal(config_add_scenario(cfg, "nosuch", &wrong), SH_EINPUT);
    static const char unknown[] = "nosuch: no such scenario; allowed the path of a file, or one of these: ";
    assert_int_equal(strncmp(wrong.err[0].text, unknown, sizeof unknown - 1), 0);
    assert_true(wrong.n == 1 && cfg->faults.n == 3);
    assert_int_equal(load_edited("output:", "faults:\n  - {kind: drop, link: 2}\noutput:"), SH_EINPUT);
    assert_says(":17: faults[0].link: there is no link 2");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_unknown_kind_is_told_all_kinds),
        cmocka_unit_test(a_time_server_needs_dates),
        cmocka_unit_test(its_faults_need_somebody_who_asks),
        cmocka_unit_test(a_place_has_its_keys_and_no_others),
        cmocka_unit_test(wrong_ones_are_refused_with_what_is_allowed),
        cmocka_unit_test(a_follower_has_its_own_faults),
        cmocka_unit_test(the_longest_fault_fits_a_command_line),
        cmocka_unit_test(faults_stand_in_the_configuration_and_in_scenarios),
    };
    return cmocka_run_group_tests_name("faults in the configuration", tests, set_up, tear_down);
}
