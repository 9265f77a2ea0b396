/* SPDX-License-Identifier: MIT */
/* Answers of a recording to commands. The recording answers queries as the head did, and takes no settings. Commands
 * play it. */
#include "drivers/protocol/native_encode.h"
#include "tests/wire/replay_rig.h"

static const char *const LINK[] = {"--link", "type: tcp, port: 0", "--pace", "step", "--quiet", NULL};

/* The head is the same as replay_room's. */
static const struct room_config ROOM = {
    .prr_hz = 10000, .lines_hz = 100, .pan_deg_s = 10, .pan_stop_deg = 3, .frames = 1, .links = LINK_YAML_TCP};
static const struct room_config BEAMS = {
    .profile = "velodyne-vlp16", .prr_hz = 289351.851852, .lines_hz = 10, .frames = 1, .links = LINK_YAML_TCP};

static void starts_with(struct scanhead *sh, const char *command, const char *want, const char *has)
{
    const char *reply = client_ask(sh, command);
    if (strncmp(reply, want, strlen(want)) != 0 || strstr(reply, has) == NULL)
        fail_msg("%s: %s; wanted %s...%s", command, reply, want, has);
}

static void grant(struct scanhead *sh, int ms)
{
    char line[32];
    snprintf(line, sizeof line, "TIME:STEP %d MS", ms);
    client_tell(sh, line);
}

/* A whole run of a head in the pace step: its answers when it is idle, and its recording. */
static const char *const QUERIES[] = {
    "*IDN?",           "HEAD:PRR?",       "HEAD:LINes?",     "HEAD:PAN?",       "HEAD:STATE?",
    "HEAD:STATION?",   "HEAD:RANGe:MIN?", "HEAD:RANGe:MAX?", "SCAN:STEP:LINE?", "SCAN:LINE:STARt?",
    "SCAN:LINE:STOP?", "SCAN:PAN:STARt?", "SCAN:PAN:STOP?",  "SCAN:FRAMes?",    "SYSTem:ERRor:COUNt?",
    "SYST:ERR?",       "*OPC?",           "*STB?",           "SYST:VERS?",      "HELP?",
    "HELP:SET?",       "TIME?",           "SYST:CONT?",      "FAULT:LIST?"};
enum { N_QUERIES = sizeof QUERIES / sizeof *QUERIES };

static void same_answers(struct wire *wire, const struct room_config *config, int scan_ms)
{
    static char answer[N_QUERIES][600];
    char file[352];
    struct tape tape = {0};
    struct scanhead_frame frame;
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, config), LINK + 2);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    grant(sh, 700);
    for (int i = 0; i < N_QUERIES; i++)
        snprintf(answer[i], sizeof answer[i], "%s", client_ask(sh, QUERIES[i]));
    client_tell(sh, "SCAN:STARt");
    grant(sh, scan_ms);
    assert_string_equal(client_ask(sh, "SCAN:COUNt?"), "1");
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK)
        tape_add(&tape, &frame, 0);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    snprintf(file, sizeof file, "%s", tape_write(wire, "head.shs", &tape));
    tape_free(&tape);
    head = head_start(wire, file, LINK);
    sh = client_open(head_endpoint(&head, "tcp"));
    grant(sh, 700);
    for (int i = 0; i < N_QUERIES; i++) {
        const char *reply = client_ask(sh, QUERIES[i]);
        if (strcmp(reply, answer[i]) != 0) fail_msg("%s: %s; the head said %s", QUERIES[i], reply, answer[i]);
    }
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

static void test_same_answers(void **state)
{
    same_answers(*state, &ROOM, 700);
    same_answers(*state, &BEAMS, 700);
}

static struct scanhead *open_room(struct wire *wire, struct head *head)
{
    char file[352];
    snprintf(file, sizeof file, "%s", replay_room(wire, "head.shs", 30));
    *head = head_start(wire, file, LINK);
    return client_open(head_endpoint(head, "tcp"));
}

static void test_settings_are_refused(void **state)
{
    struct head head;
    struct scanhead *sh = open_room(*state, &head);
    static const char *const changes[][3] = {
        {"HEAD:PRR 20000", "HEAD:PRR", "it is 10000"},
        {"HEAD:LINes 50", "HEAD:LINes", "it is 100"},
        {"HEAD:PAN 5", "HEAD:PAN", "it is 10"},
        {"HEAD:STATION 2", "HEAD:STATION", "it is 1"},
        {"HEAD:RANGe:MIN 1", "HEAD:RANGe:MIN", "it is "},
        {"HEAD:RANGe:MAX 5", "HEAD:RANGe:MAX", "it is "},
        {"SCAN:LINE:STARt 0", "SCAN:LINE:STARt", "it is -40"},
        {"SCAN:LINE:STOP 0", "SCAN:LINE:STOP", "it is 60"},
        {"SCAN:PAN:STARt 1", "SCAN:PAN:STARt", "it is 0"},
        {"SCAN:PAN:STOP 1", "SCAN:PAN:STOP", "it is 3"},
        {"SCAN:PAN:STOP MIN", "SCAN:PAN:STOP", "it is 3"},
        {"SCAN:FRAMes MAX", "SCAN:FRAMes", "it is 1"},
        {"SCAN:FRAMes 0", "SCAN:FRAMes", "it is 1"},
        {"SITE:POSE 1,0,0,0,0,0,0", "SITE:POSE", "its stations are fixed"},
    };
    static const char *const same[] = {"HEAD:PRR 10000",  "HEAD:PRR 10 KHZ",     "HEAD:PRR MAX",   "HEAD:PRR MIN",
                                       "HEAD:LINes 100",  "HEAD:PAN 10",         "HEAD:STATION 1", "SCAN:LINE:STOP 60",
                                       "SCAN:PAN:STOP 3", "SCAN:LINE:STARt -40", "SCAN:FRAMes 1"};
    static const char *const unknown[] = {"HEAD:NOISe", "HEAD:NOISe:ANGLe", "HEAD:NOISe:SIGMa", "HEAD:NOISe:BALL",
                                          "SCAN:ECHoes"};
    for (size_t i = 0; i < sizeof changes / sizeof *changes; i++) {
        starts_with(sh, changes[i][0], "ERR -221,\"Settings conflict; ", "a recording is replayed; its ");
        starts_with(sh, "SYST:ERR?", "-221,\"Settings conflict; ", changes[i][1]);
        starts_with(sh, changes[i][0], "ERR -221", changes[i][2]);
        client_tell(sh, "*CLS");
    }
    for (size_t i = 0; i < sizeof same / sizeof *same; i++)
        client_tell(sh, same[i]);
    for (size_t i = 0; i < sizeof unknown / sizeof *unknown; i++) {
        char line[64];
        snprintf(line, sizeof line, "%s?", unknown[i]);
        starts_with(sh, line, "ERR -221", "the recording does not have this value");
        snprintf(line, sizeof line, "%s DEF", unknown[i]);
        starts_with(sh, line, "ERR -221", "the recording does not have this value");
    }
    client_tell(sh, "*CLS");
    starts_with(sh, "HEAD:PRR fast", "ERR -104", "");
    starts_with(sh, "HEAD:PRR 5 S", "ERR -131", "");
    starts_with(sh, "HEAD:PRR", "ERR -109", "");
    starts_with(sh, "NONE:SUCH", "ERR -113", "");
    assert_string_equal(client_ask(sh, "SYST:ERR:COUN?"), "4");
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* Takes the frames up to the reply of the last grant. */
static uint32_t take_all(struct scanhead *sh, uint64_t *first_t_ns, uint64_t *last_t_ns)
{
    struct scanhead_frame frame;
    uint32_t n = 0;
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        if ((frame.flags & SCANHEAD_LOCAL) != 0) continue;
        if (n++ == 0) *first_t_ns = (uint64_t)frame.t_ns;
        *last_t_ns = (uint64_t)frame.t_ns;
    }
    return n;
}

static void test_how_it_is_played(void **state)
{
    struct head head;
    struct scanhead *sh = open_room(*state, &head);
    struct scanhead_stats stats;
    uint64_t first_ns, last_ns;
    /* Nothing comes before it is commanded. */
    grant(sh, 50);
    assert_int_equal(take_all(sh, &first_ns, &last_ns), 0);
    assert_string_equal(client_ask(sh, "HEAD:STATe?"), "idle");
    starts_with(sh, "SCAN:STOP", "ERR -221", "");
    client_tell(sh, "SCAN:STARt");
    grant(sh, 1);
    /* The state is the recorded head's: boot, idle, and so on. A reader that asks gets the state of its frames. */
    assert_string_equal(client_ask(sh, "HEAD:STATe?"), "boot");
    /* A playing recording can be stopped, whatever the head's state was. So can one that is about to play. */
    client_tell(sh, "SCAN:STOP");
    client_tell(sh, "SCAN:STARt");
    client_tell(sh, "SCAN:STOP");
    take_all(sh, &first_ns, &last_ns);
    grant(sh, 300);
    assert_int_equal(take_all(sh, &first_ns, &last_ns), 0);
    assert_string_equal(client_ask(sh, "HEAD:STATe?"), "idle");
    client_tell(sh, "SCAN:STARt");
    grant(sh, 250);
    assert_string_equal(client_ask(sh, "HEAD:STATe?"), "scanning");
    assert_string_equal(client_ask(sh, "SCAN:COUNt?"), "0"); /* frames that are done */
    assert_true(take_all(sh, &first_ns, &last_ns) > 10);
    assert_int_equal(first_ns, 0);
    assert_in_range(last_ns, 245000000, 250000000);
    /* The recording starts anew while it plays. */
    client_tell(sh, "SCAN:STARt");
    grant(sh, 300);
    assert_true(take_all(sh, &first_ns, &last_ns) > 30);
    assert_int_equal(first_ns, 0);
    assert_in_range(last_ns, 295000000, 300000000);
    /* The recording is stopped: no more frames come, and the head is idle. */
    client_tell(sh, "SCAN:STOP");
    grant(sh, 1);
    take_all(sh, &first_ns, &last_ns);
    grant(sh, 300);
    assert_int_equal(take_all(sh, &first_ns, &last_ns), 0);
    assert_string_equal(client_ask(sh, "HEAD:STATe?"), "idle");
    /* *RST stops it, too. */
    client_tell(sh, "SCAN:STARt");
    grant(sh, 250);
    assert_true(take_all(sh, &first_ns, &last_ns) > 10);
    client_tell(sh, "*RST");
    grant(sh, 1);
    take_all(sh, &first_ns, &last_ns);
    grant(sh, 300);
    assert_int_equal(take_all(sh, &first_ns, &last_ns), 0);
    /* The recording plays to its end. */
    client_tell(sh, "SCAN:STARt");
    grant(sh, 600);
    assert_true(take_all(sh, &first_ns, &last_ns) > 200);
    assert_string_equal(client_ask(sh, "HEAD:STATe?"), "idle");
    assert_string_equal(client_ask(sh, "SCAN:COUNt?"), "1");
    assert_string_equal(client_ask(sh, "SYST:ERR?"),
                        "-221,\"Settings conflict; SCAN:STOP is not possible in state idle\"");
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.restarts, 4);
    assert_int_equal(stats.seq_lost + stats.repeated + stats.late + stats.bad_bytes, 0);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* Takes the frames up to the reply of the last grant. Returns how many points can't be placed; `placed` counts the
 * others. */
static uint64_t take_points(struct scanhead *sh, uint64_t *placed)
{
    struct scanhead_frame frame;
    struct scanhead_info info;
    uint64_t unplaced = 0;
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        if (frame.type != SCANHEAD_POINTS) continue;
        *(scanhead_get_info(sh, &info) == SCANHEAD_OK ? placed : &unplaced) += frame.n_points;
    }
    return unplaced;
}

/* After each jump back within a scan the first points already can be placed: descriptor and anchor come before them. */
static void test_no_point_is_lost_by_a_seek(void **state)
{
    static const char *const seeks[] = {"SCAN:REPLay 0.3", "SCAN:REPLay 0.25", "SCAN:REPLay 0.28", "SCAN:REPLay 0.22"};
    struct head head;
    struct scanhead *sh = open_room(*state, &head);
    for (size_t i = 0; i < sizeof seeks / sizeof *seeks; i++) {
        uint64_t placed = 0;
        client_tell(sh, seeks[i]);
        grant(sh, 30);
        assert_int_equal(take_points(sh, &placed), 0);
        assert_true(placed > 100); /* of 300 pulses */
    }
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* The end of a part lies between two frames: to seek it plays nothing more, and is no error. */
static void test_the_end_of_a_part(void **state)
{
    char file[352];
    snprintf(file, sizeof file, "%s", replay_room(*state, "head.shs", 30));
    struct head head = head_start(
        *state, file,
        (const char *const[]){"--link", "type: tcp, port: 0", "--pace", "step", "--to", "0.3001", "--quiet", NULL});
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_tell(sh, "SCAN:REPLay 0.3001");
    grant(sh, 50);
    starts_with(sh, "SCAN:REPLay?", "IDLE,0.300100,0.300100", "");
    assert_string_equal(client_ask(sh, "SYST:ERR:COUN?"), "0");
    client_tell(sh, "SCAN:REPLay ,,ON");
    client_tell(sh, "SCAN:REPLay 0.3001");
    grant(sh, 50);
    starts_with(sh, "SCAN:REPLay?", "PLAYING,0.0", ",ON");
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* A client seeks: its stream goes on there, as another sequence, and nothing counts as lost. */
static void test_seek(void **state)
{
    struct head head;
    struct scanhead *sh = open_room(*state, &head);
    struct scanhead_stats stats;
    uint64_t first_ns, last_ns;
    starts_with(sh, "SCAN:REPLay?", "IDLE,0.000000,0.", ",1,OFF");
    client_tell(sh, "SCAN:REPLay 0.3"); /* it is not played yet */
    grant(sh, 50);
    assert_true(take_all(sh, &first_ns, &last_ns) > 10);
    assert_in_range(first_ns, 300000000, 302000000);
    assert_in_range(last_ns, 345000000, 350000000);
    starts_with(sh, "SCAN:REPLay?", "PLAYING,0.3", ",1,OFF");
    client_tell(sh, "SCAN:REPLay 0.25,1,ON");
    grant(sh, 20);
    take_all(sh, &first_ns, &last_ns);
    assert_in_range(first_ns, 250000000, 252000000);
    starts_with(sh, "SCAN:REPLay?", "PLAYING,0.2", ",1,ON");
    starts_with(sh, "SCAN:REPLay ,2", "ERR -221", "only the pace realtime");
    client_tell(sh, "SCAN:STOP");
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.restarts, 1);
    assert_int_equal(stats.seq_lost + stats.repeated + stats.late + stats.bad_bytes, 0);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* Writes a descriptor and, where e is not NULL, an emitter of the same moment. */
static const char *write_moment(struct wire *wire, const struct native_emitter *e)
{
    struct tape tape = {0};
    uint8_t bytes[4096];
    uint32_t i = 0;
    tape_read(replay_room(wire, "head.shs", 3), &tape);
    while (tape.frame[i].type != NATIVE_DESCRIPTOR)
        i++;
    size_t len = tape.frame[i].len;
    memcpy(bytes, tape.bytes + tape.frame[i].at, len);
    if (e != NULL) {
        const size_t n = native_encode_emitter(bytes + len, sizeof bytes - len, e, NULL, tape.frame[i].t_ns, 0);
        assert_true(n > 0);
        native_finish_frame(bytes + len, tape.frame[i].seq + 1);
        len += n;
    }
    tape_free(&tape);
    return wire_write(wire, "moment.shs", bytes, len);
}

/* A recording that is over in a tick is never seen to play, and yet it can be stopped. */
static void test_a_loop_is_stopped(void **state)
{
    const char *const args[] = {"--link", "type: tcp, port: 0", "--loop", "--pace", "step", "--quiet", NULL};
    uint64_t first_ns, last_ns;
    struct head head = head_start(*state, write_moment(*state, NULL), args);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_tell(sh, "SCAN:STARt");
    grant(sh, 10);
    assert_in_range(take_all(sh, &first_ns, &last_ns), 9, 10);
    client_tell(sh, "SCAN:STOP");
    grant(sh, 1);
    take_all(sh, &first_ns, &last_ns);
    grant(sh, 10);
    assert_int_equal(take_all(sh, &first_ns, &last_ns), 0);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* A number of echoes that stands for no word counts as if the recording did not have it. */
static void test_unknown_echoes(void **state)
{
    const struct native_emitter e = {
        .kind = NATIVE_EMIT_PLANAR, .steps = 360, .turn = 1, .sequence_ns_den = 1, .echoes = 4000000000};
    struct head head = head_start(*state, write_moment(*state, &e), LINK);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    starts_with(sh, "SCAN:ECHoes?", "ERR -221", "does not have this value");
    starts_with(sh, "SCAN:ECHoes ALL", "ERR -221", "does not have this value");
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

static void test_control_and_steps(void **state)
{
    struct head head;
    struct scanhead *sh = open_room(*state, &head), *other = client_open(head_endpoint(&head, "tcp"));
    grant(sh, 1);
    starts_with(other, "SCAN:STARt", "ERR -203", "");
    starts_with(other, "TIME:STEP 1 MS", "ERR -203", "");
    starts_with(sh, "TIME:STEP 0", "ERR -222", "");
    starts_with(sh, "TIME:STEP 1 MS, 1, 2, 3, 4, 5, 6", "ERR ", "");
    assert_string_equal(client_ask(sh, "TIME?"), "1000000");
    client_tell(sh, "SYST:CONT:REL");
    client_tell(other, "SCAN:STARt");
    client_tell(other, "TIME:STEP 250 MS");
    uint64_t first_ns, last_ns;
    client_ask(sh, "*IDN?");
    assert_true(take_all(sh, &first_ns, &last_ns) > 10); /* both hear it */
    assert_true(take_all(other, &first_ns, &last_ns) > 10);
    scanhead_close(sh);
    scanhead_close(other);
    head_end(&head, SIGTERM);
}

static void test_faults_by_command(void **state)
{
    struct head head;
    struct scanhead *sh = open_room(*state, &head);
    struct scanhead_stats stats;
    uint64_t first_ns, last_ns;
    starts_with(sh, "FAULt:ADD {kind: mirror_stop, every: 10}", "ERR ", "");
    starts_with(sh, "HEAD:REBOOT", "ERR -221", "a recording is replayed");
    starts_with(sh, "FAULt:ADD {kind: power_cycle, for_ms: 200, from_s: 1}", "ERR ", "a recording has no head");
    starts_with(sh, "FAULt:ADD {kind: ptp_lost}", "ERR ", "a recording has no head");
    starts_with(sh, "FAULt:ADD {kind: clock_stop}", "ERR ", "a recording has no head");
    starts_with(sh, "FAULt:ADD {kind: none_such}", "ERR ", "");
    assert_string_equal(client_ask(sh, "FAULt:LIST?"), "none");
    assert_string_equal(client_ask(sh, "FAULt:ADD {kind: drop, every: 10}"), "1");
    client_tell(sh, "SCAN:STARt");
    grant(sh, 600);
    const uint32_t n = take_all(sh, &first_ns, &last_ns);
    const uint64_t injected = (uint64_t)atoll(client_ask(sh, "FAULt:INJected? 1"));
    scanhead_get_stats(sh, &stats);
    assert_true(n > 100 && injected > 10);
    assert_in_range(stats.seq_lost, injected - 2, injected); /* the first and the last frame leave no gap */
    client_tell(sh, "FAULt:CLEar 1");
    client_tell(sh, "SCAN:STARt");
    grant(sh, 600);
    assert_true(take_all(sh, &first_ns, &last_ns) > n);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_same_answers, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_settings_are_refused, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_how_it_is_played, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_seek, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_the_end_of_a_part, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_no_point_is_lost_by_a_seek, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_loop_is_stopped, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_unknown_echoes, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_control_and_steps, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_faults_by_command, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
