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
        {"--link", "pty", "--clients", "2"}, /* they can't be there together */
        {"--link", "null", "--clients", "1"},
        {"--set", "head.prr_hz=1"},
        {"--scenario", "none"},
        {"--scenario", "config/faults/brown-out.yaml"}, /* of the head */
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
    static const char *const captures[][2] = {{"--unknown", "close"}, {"--device-port", "5"}};
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

/* The replay begins once both clients are there, and lasts its time from then on. Waiting, of any length, does not
 * count. */
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

/* A client that sends nothing more still reads, as `nc -N` does: it counts as long as it is there. */
static void test_client_that_has_sent_all(void **state)
{
    static const char *const args[] = {"--start", "--clients",          "2",       "--pace", "fast",
                                       "--link",  "type: tcp, port: 0", "--quiet", NULL};
    char text[2048];
    record(*state);
    struct head head = head_start(*state, file, args);
    const int fd = raw_connect(head_endpoint(&head, "tcp"));
    raw_send(fd, "*IDN?\n", 6);
    assert_int_equal(shutdown(fd, SHUT_WR), 0);
    for (size_t n = 0; n == 0 || text[n - 1] != '\n';) { /* so it was heard to the end */
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, SOON_MS), 1);
        const ssize_t got = read(fd, text + n, sizeof text - n);
        assert_true(got > 0);
        n += (size_t)got;
    }
    struct scanhead *other = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    int rc;
    uint32_t n = 0;
    while ((rc = scanhead_next(other, &frame, SOON_MS)) == SCANHEAD_OK)
        n++;
    assert_int_equal(rc, SCANHEAD_ECLOSED); /* it was played, and the run is over */
    assert_true(n > 10);
    scanhead_close(other);
    close(fd);
    head_end(&head, 0);
}

/* Waits until the head has closed its ends of all connections to a port that their clients have closed. */
static void wait_closed(int port)
{
    const int64_t end_ms = wire_now_ms() + DEADLINE_MS;
    for (int n = 1; n != 0; poll(NULL, 0, n)) {
        char line[512];
        FILE *f = fopen("/proc/net/tcp", "r");
        assert_non_null(f);
        for (n = 0; fgets(line, sizeof line, f) != NULL;) {
            unsigned local, state;
            if (sscanf(line, "%*d: %*8x:%x %*8x:%*x %x", &local, &state) != 2) continue;
            n += local == (unsigned)port && state == 8; /* CLOSE_WAIT */
        }
        fclose(f);
        assert_true(wire_now_ms() < end_ms);
    }
}

/* Clients of a device's protocol that came and went are no longer there. The head finds that out with the first
 * sentences that it sends them, one a second. */
static void test_clients_that_are_gone(void **state)
{
    enum { CLIENTS = 5, GONE = 3 };
    static const char *const args[] = {"--start",
                                       "--clients",
                                       "5",
                                       "--pace",
                                       "step",
                                       "--link",
                                       "type: tcp, port: 0",
                                       "--link",
                                       "type: tcp, port: 0, protocol: nmea",
                                       "--quiet",
                                       NULL};
    static const char config[] =
        "head: {profile: full-sweep, prr_hz: 10000, lines_hz: 100, frames: 1}\n"
        "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
        "stations: [{position_m: [0.31, -0.42, 0.17], lat_deg: 48.1, lon_deg: 11.6, height_m: 500}]\n"
        "time: {epoch: 2026-05-04T03:02:01Z}\nlinks: [{type: file, path: rec.shs}]\n";
    struct wire *wire = *state;
    uint64_t last_ns = 0;
    int fd[CLIENTS - 1];
    room_write(wire);
    const char *const recording[] = {
        "run", wire_write_text(wire, "c.yaml", config), "--start", "--pace", "fast", "--duration", "2", "--quiet",
        NULL};
    assert_int_equal(replay_call(wire, recording), 0);
    struct head head = head_start(wire, wire_path(wire, "rec.shs"), args);
    for (int i = 0; i < GONE; i++)
        close(raw_connect(head_link(&head, 1)));
    struct scanhead *sh = client_open(head_link(&head, 0));
    for (int i = 0; i < 5; i++)
        assert_int_equal(grant(sh, "TIME:STEP 1 S", &last_ns), 0);
    wait_closed(endpoint_port(head_link(&head, 1)));
    for (int i = 0; i < CLIENTS - 1; i++) {
        fd[i] = raw_connect(head_link(&head, 1));
        for (int k = 0; k < 3 && i < CLIENTS - 2; k++)
            assert_int_equal(grant(sh, "TIME:STEP 1 S", &last_ns), 0);
    }
    for (int64_t since_ns = 0; grant(sh, "TIME:STEP 100 MS", &last_ns) == 0;)
        wire_soon(&since_ns, client_time_ns(sh), "the recording");
    for (int i = 0; i < CLIENTS - 1; i++)
        close(fd[i]);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_wrong_options, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_clients_and_duration, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_client_that_has_sent_all, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_clients_that_are_gone, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_recording_stays, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_view, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
