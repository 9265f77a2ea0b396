/* SPDX-License-Identifier: MIT */
/* Settings that clients make between scans, over TCP. The scan is the one that record makes with the same keys. The
 * journal brings it back. HELP? gives the values that a setting accepts. */
#include "tests/wire/room.h"

static const struct room_config SHORT = {.prr_hz = 100000,
                                         .lines_hz = 50,
                                         .pan_deg_s = 60,
                                         .pan_stop_deg = 6,
                                         .frames = 1,
                                         .links = LINK_YAML_TCP,
                                         .more = "loop: {pace: fast}\n"};

/* full-sweep has a sweep of 100 deg, so 0.25 deg at 100 kHz are 250 lines/s and 62.5 deg/s. */
static const char *const commands[] = {"SCAN:STEP 0.25", "HEAD:RANG:MIN 1.25",  "HEAD:RANG:MAX 3.5",
                                       "HEAD:NOIS ON",   "HEAD:NOIS:SIGM 7 MM", "HEAD:NOIS:BALL 0.03"};
static const char *const keys[] = {"head.lines_hz=250",       "head.pan_deg_s=62.5", "head.range_min_m=1.25",
                                   "head.range_max_m=3.5",    "noise.range=on",      "noise.sigma_m=0.007",
                                   "noise.ball.radius_m=0.03"};
enum { N_COMMANDS = sizeof commands / sizeof *commands, N_KEYS = sizeof keys / sizeof *keys };

static void record_with_keys(struct wire *wire, const char *config, char hash[65])
{
    char stats[352];
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    const char *args[8 + 2 * N_KEYS] = {"record", config, "--stats", stats, "--quiet"};
    int n = 5;
    for (int i = 0; i < N_KEYS; i++) {
        args[n++] = "--set";
        args[n++] = keys[i];
    }
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "head.out", "head.err", -1)), 0);
    stats_hash(wire, hash);
}

static void scan_by_commands(struct wire *wire, const char *config, const char *journal, char hash[65])
{
    const char *const more[] = {"--journal", journal, NULL};
    struct head head = head_start(wire, config, more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    client_wait_state(sh, "idle");
    assert_string_equal(client_ask(sh, commands[0]), "0.25");
    for (int i = 1; i < N_COMMANDS; i++)
        client_tell(sh, commands[i]);
    client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    stats_hash(wire, hash);
}

static void test_scans_are_those_of_the_keys(void **state)
{
    struct wire *wire = *state;
    char config[352], journal[352], told[65], kept[65], again[65];
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &SHORT));
    snprintf(journal, sizeof journal, "%s", wire_path(wire, "journal"));
    record_with_keys(wire, config, kept);
    scan_by_commands(wire, config, journal, told);
    assert_string_equal(told, kept);
    const char *const more[] = {"--replay-journal", journal, NULL};
    struct head head = head_start(wire, config, more);
    head_end(&head, 0);
    stats_hash(wire, again);
    assert_string_equal(again, kept);
}

/* A panel of knobs is made from HELP?: each setting's name and limits. Both limits and the default are accepted. */
static void test_knobs_draw_themselves(void **state)
{
    struct wire *wire = *state;
    char names[512], line[600], min[40], max[40], *save = NULL;
    int numbers = 0;
    room_write(wire);
    const char *const more[] = {NULL};
    struct head head = head_start(wire, room_config_write(wire, &SHORT), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    snprintf(names, sizeof names, "%s", client_ask(sh, "HELP:SETtings?"));
    for (char *name = strtok_r(names, " ", &save); name != NULL; name = strtok_r(NULL, " ", &save)) {
        snprintf(line, sizeof line, "HELP? %s", name);
        if (sscanf(client_ask(sh, line), "number,\"%*[^,],%39[^,],%39[^,],", min, max) != 2) continue;
        const char *const ends[] = {min, max, "DEF"};
        for (int i = 0; i < 3; i++) {
            snprintf(line, sizeof line, "%s %s", name, ends[i]);
            const char *reply = client_ask(sh, line);
            if (strncmp(reply, "ERR", 3) == 0) fail_msg("%s: %s", line, reply);
        }
        numbers++;
    }
    assert_true(numbers >= 15);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_scans_are_those_of_the_keys, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_knobs_draw_themselves, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
