/* SPDX-License-Identifier: MIT */
/* Options of a replay: some are refused, and none may change the recording. */
#include "tests/wire/replay_rig.h"

static char file[352];

static void record(struct wire *wire)
{
    snprintf(file, sizeof file, "%s", replay_room(wire, "head.shs", 3));
}

static void test_wrong_options(void **state)
{
    struct wire *wire = *state;
    static const char *const wrong[][6] = {
        {"--journal", "x"},
        {"--replay-journal", "x"},
        {"--frames", "3"},
        {"--from", "2", "--to", "1"},
        {"--from", "2", "--to", "2"},
        {"--from", "-1"},
        {"--from", "nan"},
        {"--to", "inf"},
        {"--speed", "0"},
        {"--speed", "1e9"},
        {"--speed", "2", "--pace", "fast"},
        {"--speed", "2", "--pace", "step"},
        {"--link", "foo"},
        {"--link", ""},
        {"--link", "type: udp, protocol: velodyne"},
        {"--link", "type: udp, port: 9, protocol: cola"},
        {"--link", "type: web, protocol: cola"},
        {"--link", "type: 'null', protocol: scip"},
        {"--link", "tcp", "--config", "x.yaml"},
        {"--set", "head.prr_hz=1"},
        {"--scenario", "none"},
    };
    record(wire);
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        const char *args[12] = {"run", file, "--start", "--quiet"};
        for (int k = 0; k < 6 && wrong[i][k] != NULL; k++)
            args[4 + k] = wrong[i][k];
        const int status = replay_call(wire, args);
        char *text = wire_read(wire_path(wire, "err"), NULL);
        if (status != 2 || strchr(text, '\n') == NULL || strchr(text, '\n')[1] != '\0')
            fail_msg("%s %s: status %d, %s", wrong[i][0], wrong[i][1], status, text);
        free(text);
    }
    /* The times are within the recording, so nothing else is wrong. */
    const char *const backward[] = {"run", file, "--start", "--quiet", "--from", "0.002", "--to", "0.001", NULL};
    assert_int_equal(replay_call(wire, backward), 2);
    replay_said(wire, "is not after --from");
    static const char *const captures[][2] = {{"--unknown", "x"}, {"--device-port", "5"}};
    for (size_t i = 0; i < sizeof captures / sizeof *captures; i++) {
        const char *const args[] = {"run", file, "--start", "--pace", "fast", captures[i][0], captures[i][1], NULL};
        assert_int_equal(replay_call(wire, args), 2);
        replay_said(wire, "is for a capture of packets");
    }
    static const char *const heads[][2] = {{"--speed", "2"},  {"--from", "1"},   {"--to", "1"},
                                           {"--link", "tcp"}, {"--config", "x"}, {"--loop", NULL}};
    for (size_t i = 0; i < sizeof heads / sizeof *heads; i++) {
        const char *const args[] = {"run", "x.yaml", heads[i][0], heads[i][1], NULL};
        assert_int_equal(replay_call(wire, args), 2);
        replay_said(wire, "is for a recording");
    }
}

/* A link does not overwrite the replayed file. */
static void test_recording_stays(void **state)
{
    struct wire *wire = *state;
    struct tape tape = {0};
    char link[400];
    record(wire);
    snprintf(link, sizeof link, "type: file, path: '%s'", file);
    const char *const args[] = {"run", file, "--start", "--pace", "fast", "--link", link, NULL};
    assert_int_equal(replay_call(wire, args), 2);
    replay_said(wire, "would be overwritten");
    tape_read(file, &tape);
    assert_true(tape.n > 10);
    tape_free(&tape);
}

/* The page's link is added to the others, wherever they come from and whatever they are called. */
static void test_view(void **state)
{
    struct wire *wire = *state;
    struct room_config config = {.prr_hz = 10000, .lines_hz = 100, .links = LINK_YAML_TCP};
    char link[400], yaml[352];
    record(wire);
    snprintf(yaml, sizeof yaml, "%s", room_config_write(wire, &config));
    snprintf(link, sizeof link, "type: pty, path: '%s'", wire_path(wire, "web0"));
    const char *const more[][3] = {{NULL}, {"--link", link}, {"--config", yaml}};
    static const char *const beside[] = {"link tcp:", "link tty:", "link tcp:"};
    for (size_t i = 0; i < sizeof more / sizeof *more; i++) {
        const char *const args[] = {"run", file, "--start", "--pace", "fast", "--view", more[i][0], more[i][1], NULL};
        assert_int_equal(replay_call(wire, args), 0);
        replay_said(wire, "link http://");
        replay_said(wire, beside[i]);
    }
}

static uint32_t grant(struct scanhead *sh, const char *step, uint64_t *last_ns)
{
    struct scanhead_frame frame;
    uint32_t n = 0;
    client_tell(sh, step);
    for (; scanhead_next(sh, &frame, 0) == SCANHEAD_OK; n++)
        *last_ns = (uint64_t)frame.t_ns;
    return n;
}

/* It begins once both are there, and lasts its time from then on. Waiting, of any length, does not count. */
static void test_clients_and_duration(void **state)
{
    static const char *const args[] = {"--start", "--clients", "2",      "--duration",         "0.1",
                                       "--pace",  "step",      "--link", "type: tcp, port: 0", "--quiet",
                                       NULL};
    uint64_t last_ns = 0;
    record(*state);
    struct head head = head_start(*state, file, args);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    assert_int_equal(grant(sh, "TIME:STEP 500 MS", &last_ns), 0);
    struct scanhead *other = client_open(head_endpoint(&head, "tcp"));
    client_ask(other, "*IDN?");
    assert_true(grant(sh, "TIME:STEP 500 MS", &last_ns) > 0);
    assert_in_range(last_ns, 0, 100000000);
    head_end(&head, 0);
    scanhead_close(sh);
    scanhead_close(other);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_wrong_options, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_clients_and_duration, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_recording_stays, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_view, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
