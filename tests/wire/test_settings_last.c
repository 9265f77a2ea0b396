/* SPDX-License-Identifier: MIT */
/* A VLP-16 whose client saves its settings: they survive a reboot, the end of the head, and its being killed; and a
 * replayed journal has them without the file. */
#include "tests/wire/room.h"
#include "tests/wire/wire.h"

static const char FORM[] = "POST %s HTTP/1.0\r\nContent-Length: %zu\r\n\r\n%s", GET[] = "GET %s HTTP/1.0\r\n\r\n";

/* Returns the whole answer. After HTTP/1.0 the head ends the connection. NULL: power went before that. */
static const char *http_or_none(const struct head *head, const char *path, const char *form)
{
    static char answer[8192];
    char request[256];
    size_t len = 0;
    ssize_t n;
    const int fd = raw_try_connect(head_link(head, 0));
    if (fd < 0) return NULL;
    snprintf(request, sizeof request, form != NULL ? FORM : GET, path, form != NULL ? strlen(form) : 0, form);
    const ssize_t size = (ssize_t)strlen(request);
    struct pollfd slot = {.fd = fd, .events = POLLIN};
    n = send(fd, request, (size_t)size, MSG_NOSIGNAL) == size ? 1 : -1;
    while (n > 0) {
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        n = read(fd, answer + len, sizeof answer - 1 - len);
        if (n > 0) len += (size_t)n;
    }
    close(fd);
    answer[len] = '\0';
    return n == 0 ? answer : NULL;
}

static const char *http(const struct head *head, const char *path, const char *form)
{
    const char *answer = http_or_none(head, path, form);
    assert_non_null(answer);
    return answer;
}

static void post(const struct head *head, const char *path, const char *form)
{
    const char *answer = http(head, path, form);
    if (strncmp(answer, "HTTP/1.1 200 OK\r\n", 17) != 0) fail_msg("%s %s: %s", path, form, answer);
}

static void expect_setting(const struct head *head, const char *field)
{
    const char *settings = http(head, "/cgi/settings.json", NULL);
    if (strstr(settings, field) == NULL) fail_msg("no %s in %s", field, settings);
}

/* Waits after a power cycle. The other link may be back before this one has gone down. */
static void await_setting(const struct head *head, const char *field)
{
    const char *settings;
    const int64_t end_ms = wire_now_ms() + DEADLINE_MS;
    while ((settings = http_or_none(head, "/cgi/settings.json", NULL)) == NULL || strstr(settings, field) == NULL)
        if (wire_now_ms() > end_ms) fail_msg("no %s in %s", field, settings != NULL ? settings : "any answer");
}

static struct head start(struct wire *wire)
{
    const struct room_config config = {
        .profile = "velodyne-vlp16",
        .prr_hz = 289351.851852,
        .lines_hz = 10,
        .links = "links: [{type: tcp, port: 0, protocol: velodyne-http}, {type: tcp, port: 0}]\n"};
    char set[400];
    snprintf(set, sizeof set, "head.settings_file=%s", wire_path(wire, "set"));
    return head_start(wire, room_config_write(wire, &config), (const char *const[]){"--set", set, NULL});
}

static int has_lines_15(const char *text, const void *ctx)
{
    (void)ctx;
    return strstr(text, "head HEAD:LINes 15\n") != NULL;
}

static void what_a_client_saves_is_there_again(void **state)
{
    struct wire *wire = *state;
    room_write(wire);
    struct head head = start(wire);
    struct scanhead *sh = client_open(head_link(&head, 1));
    client_wait_state(sh, "idle");
    post(&head, "/cgi/setting", "rpm=900&returns=Last");
    post(&head, "/cgi/save", "data=submit");
    post(&head, "/cgi/setting", "rpm=300&returns=Strongest");
    post(&head, "/cgi/reset", "data=reset_system"); /* it scans from here on */
    expect_setting(&head, "\"returns\":\"Last\",\"rpm\":900,");
    post(&head, "/cgi/setting", "rpm=300");
    client_tell(sh, "HEAD:REBOOT");
    struct scanhead_frame frame;
    while (scanhead_next(sh, &frame, DEADLINE_MS) == SCANHEAD_OK) /* until power goes */
        continue;
    scanhead_close(sh);
    close(raw_connect_again(head_link(&head, 1), "SCAN:ECHOES?\n"));
    await_setting(&head, "\"returns\":\"Last\",\"rpm\":900,");
    head_end(&head, SIGTERM);

    head = start(wire);
    expect_setting(&head, "\"returns\":\"Last\",\"rpm\":900,");
    head_end(&head, SIGTERM);
}

/* Once the file has them, the head may be killed at any time. */
static void a_killed_head_has_them_too(void **state)
{
    struct wire *wire = *state;
    room_write(wire);
    struct head head = start(wire);
    post(&head, "/cgi/setting", "rpm=900");
    post(&head, "/cgi/save", "data=submit");
    free(wire_read_with(wire_path(wire, "set"), has_lines_15, NULL));
    kill(head.pid, SIGKILL);
    assert_int_equal(wire_wait(wire, head.pid), 256 + SIGKILL);
    head = start(wire);
    expect_setting(&head, "\"rpm\":900,");
    head_end(&head, SIGTERM);
}

/* Runs to the end of one turn, with the file, and with a journal to write or to replay. */
static void run_turn(struct wire *wire, const char *journal, const char *says, char hash[65])
{
    char set[400], path[400];
    snprintf(set, sizeof set, "head.settings_file=%s", wire_path(wire, "set"));
    snprintf(path, sizeof path, "%s=%s", journal, wire_path(wire, "journal"));
    const char *const args[] = {"run",     wire_path(wire, "config.yaml"),
                                "--set",   set,
                                "--pace",  "fast",
                                "--start", "--frames",
                                "1",       "--quiet",
                                "--stats", wire_path(wire, "stats.json"),
                                path,      NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    assert_true(says == NULL ? err[0] == '\0' : strstr(err, says) != NULL);
    free(err);
    stats_hash(wire, hash);
}

static void a_replay_needs_no_file(void **state)
{
    struct wire *wire = *state;
    char once[65], again[65], without[65];
    const struct room_config config = {.profile = "velodyne-vlp16",
                                       .prr_hz = 289351.851852,
                                       .lines_hz = 10,
                                       .frames = 1,
                                       .links = "links: [{type: \"null\"}]\n"};
    room_write(wire);
    room_config_write(wire, &config);
    wire_write_text(wire, "set", "");
    run_turn(wire, "--journal", NULL, without);
    wire_write_text(wire, "set", "scanhead settings 1\nprofile velodyne-vlp16\nhead HEAD:LINes 15\nend\n");
    run_turn(wire, "--journal", NULL, once);
    assert_string_not_equal(once, without);
    wire_write_text(wire, "set", "scanhead settings 1\nprofile velodyne-vlp16\nhead HEAD:LINes 5\nend\n");
    run_turn(wire, "--replay-journal", "set: is not used: the journal that is replayed has the settings", again);
    assert_string_equal(once, again);
}

/* A recording off line depends on the configuration alone. */
static void a_recording_off_line_says_that_it_has_none(void **state)
{
    struct wire *wire = *state;
    char set[400], file[400], without[65], with[65];
    const struct room_config config = {
        .profile = "velodyne-vlp16", .prr_hz = 289351.851852, .lines_hz = 20, .frames = 1, .links = "links: []\n"};
    room_write(wire);
    room_config_write(wire, &config);
    snprintf(set, sizeof set, "head.settings_file=%s", wire_path(wire, "set"));
    snprintf(file, sizeof file, "%s", wire_path(wire, "x.shs"));
    for (int i = 0; i < 2; i++) {
        const char *const args[] = {"record",
                                    wire_path(wire, "config.yaml"),
                                    "-o",
                                    file,
                                    "--quiet",
                                    "--stats",
                                    wire_path(wire, "stats.json"),
                                    i == 0 ? NULL : "--set",
                                    set,
                                    NULL};
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
        stats_hash(wire, i == 0 ? without : with);
        char *err = wire_read(wire_path(wire, "err"), NULL);
        assert_int_equal(strstr(err, "set: is not used: a recording off line has the settings") != NULL, i);
        free(err);
        wire_write_text(wire, "set", "scanhead settings 1\nprofile velodyne-vlp16\nhead HEAD:LINes 5\nend\n");
    }
    assert_string_equal(with, without);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_a_client_saves_is_there_again, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_killed_head_has_them_too, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_replay_needs_no_file, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_recording_off_line_says_that_it_has_none, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
