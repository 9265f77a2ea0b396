/* SPDX-License-Identifier: MIT */
/* Trouble while a recording is replayed: faults on the wire, readers that are too slow or leave, an end. */
#include "tests/wire/replay_rig.h"

enum { MOST = 400 };

/* A set of frame numbers. */
struct numbers {
    uint32_t seq[MOST];
    int n;
};

static void put(struct numbers *numbers, uint32_t seq)
{
    for (int i = 0; i < numbers->n; i++)
        if (numbers->seq[i] == seq) return;
    assert_true(numbers->n < MOST);
    numbers->seq[numbers->n++] = seq;
}

static void same_numbers(const struct numbers *a, const struct numbers *b, const char *what)
{
    for (int i = 0; i < a->n; i++) {
        int k = 0;
        while (k < b->n && b->seq[k] != a->seq[i])
            k++;
        if (k == b->n) fail_msg("%s: frame %u is not in both", what, a->seq[i]);
    }
    if (a->n != b->n) fail_msg("%s: %d frames and %d", what, a->n, b->n);
}

/* ---- the truth, and the client's notices */

struct seen {
    struct numbers missing, repeated, broken;
};

static void see(void *ctx, const struct scanhead_notice *notice)
{
    struct seen *seen = ctx;
    if (notice->kind == SCANHEAD_NOTICE_GAP)
        for (uint64_t i = 0; i < notice->n; i++)
            put(&seen->missing, notice->seq + (uint32_t)i);
    if (notice->kind == SCANHEAD_NOTICE_REPEATED) put(&seen->repeated, notice->seq);
    if (notice->kind == SCANHEAD_NOTICE_BAD_PAYLOAD) put(&seen->broken, notice->seq);
}

/* Reads the truth's lines about this link. */
static void read_truth(const struct wire *wire, int link, struct seen *truth)
{
    char *text = wire_read(wire_path(wire, "truth.json"), NULL), *save = NULL, of[16];
    snprintf(of, sizeof of, "\"link\":%d,", link);
    for (char *at = strtok_r(text, "\n", &save); at != NULL; at = strtok_r(NULL, "\n", &save)) {
        const char *seq = strstr(at, "\"seq\":");
        if (strstr(at, of) == NULL) continue;
        assert_non_null(seq);
        const uint32_t number = (uint32_t)strtoul(seq + 6, NULL, 10);
        if (strstr(at, "\"kind\":\"duplicate\"") != NULL) put(&truth->repeated, number);
        if (strstr(at, "\"kind\":\"flip\"") != NULL) put(&truth->broken, number);
        if (strstr(at, "\"kind\":\"duplicate\"") == NULL) put(&truth->missing, number);
    }
    free(text);
}

/* Byte 40 is of the payload: the header is right, and tells which frame it was. The last frames are spared, as no frame
 * after them would show that they are missing. */
static const char SCENARIO[] = "faults:\n"
                               "  - {link: 1, kind: drop, from: 5, every: 17, until: 420}\n"
                               "  - {link: 1, kind: flip, byte: 40, from: 12, every: 17, until: 420}\n"
                               "  - {link: 1, kind: duplicate, n: 1, from: 8, every: 17, until: 420}\n";

static void test_a_client_notices_what_the_truth_says(void **state)
{
    struct wire *wire = *state;
    static struct seen seen, truth;
    char file[352], scenario[352], told[352], clean[65], hash[65];
    struct scanhead_frame frame;
    snprintf(file, sizeof file, "%s", replay_room(wire, "head.shs", 30));
    snprintf(scenario, sizeof scenario, "%s", wire_write_text(wire, "faults.yaml", SCENARIO));
    snprintf(told, sizeof told, "%s", wire_path(wire, "truth.json"));
    const char *const more[] = {"--link",     "type: tcp, port: 0",
                                "--link",     "type: tcp, port: 0",
                                "--pace",     "fast",
                                "--scenario", scenario,
                                "--truth",    told,
                                "--quiet",    NULL};
    struct head head = head_start(wire, file, more);
    struct scanhead *hit = client_open(head_link(&head, 0)), *other = client_open(head_link(&head, 1));
    memset(&seen, 0, sizeof seen);
    memset(&truth, 0, sizeof truth);
    scanhead_on_notice(hit, see, &seen);
    client_ask(hit, "*OPC?");
    client_ask(other, "*OPC?");
    scanhead_hash_start(other);
    for (int time = 0; time < 2; time++) { /* the second time has other sequence numbers */
        client_tell(hit, "SCAN:STARt");
        client_until(other, SCANHEAD_EV_SCAN_END, &frame);
        client_until(hit, SCANHEAD_EV_SCAN_END, &frame);
        client_wait_state(hit, "idle");
        client_wait_state(other, "idle");
    }
    while (scanhead_next(hit, &frame, 0) == SCANHEAD_OK || scanhead_next(other, &frame, 0) == SCANHEAD_OK)
        ;
    scanhead_hash_hex(other, clean);
    scanhead_close(hit);
    scanhead_close(other);
    head_end(&head, SIGTERM);
    stats_hash(wire, hash);
    assert_string_equal(hash, clean);
    read_truth(wire, 1, &truth);
    assert_true(truth.missing.n > 30 && truth.repeated.n > 15 && truth.broken.n > 15);
    same_numbers(&truth.missing, &seen.missing, "missing");
    same_numbers(&truth.repeated, &seen.repeated, "repeated");
    same_numbers(&truth.broken, &seen.broken, "broken");
}

/* The same faults with the same seeds hit the replay where they hit the head. The bytes of the replay's link, and the
 * truth, are the same. */
static void test_hit_as_the_head_was(void **state)
{
    struct wire *wire = *state;
    static const char faults[] = "faults:\n"
                                 "  - {kind: drop, every: 17}\n"
                                 "  - {kind: flip, probability: 0.08, n: 3}\n"
                                 "  - {kind: reorder, from: 5, every: 19, n: 4}\n"
                                 "  - {kind: truncate, from: 40, every: 41}\n"
                                 "  - {kind: garbage, from: 11, every: 37, n: 100}\n"
                                 "  - {kind: drop, from_pulse: 2000, until_pulse: 2050}\n";
    char config[352], scenario[352], truth[352], file[352], text[400];
    size_t n[2], m[2];
    char *hurt[2], *told[2];
    snprintf(file, sizeof file, "%s", replay_room(wire, "head.shs", 30));
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml")); /* the configuration that it has left */
    snprintf(scenario, sizeof scenario, "%s", wire_write_text(wire, "faults.yaml", faults));
    snprintf(truth, sizeof truth, "%s", wire_path(wire, "truth.json"));
    snprintf(text, sizeof text, "links.0.path=%s", wire_path(wire, "hurt.shs"));
    const char *const run[] = {"run", config,    "--start",    "--frames", "1",       "--pace", "fast", "--set",
                               text,  "--quiet", "--scenario", scenario,   "--truth", truth,    NULL};
    assert_int_equal(replay_call(wire, run), 0);
    hurt[0] = wire_read(wire_path(wire, "hurt.shs"), &n[0]);
    told[0] = wire_read(truth, &m[0]);
    const char *const more[] = {"--scenario", scenario, "--truth", truth, NULL};
    replay_to_file(wire, file, more, "hurt.shs");
    hurt[1] = wire_read(wire_path(wire, "hurt.shs"), &n[1]);
    told[1] = wire_read(truth, &m[1]);
    assert_true(m[0] > 1000);
    assert_string_equal(told[1], told[0]);
    assert_int_equal(n[0], n[1]);
    assert_memory_equal(hurt[0], hurt[1], n[0]);
    for (int i = 0; i < 2; i++)
        free(hurt[i]), free(told[i]);
}

/* ---- readers */

/* The recording is half a second of 1 MHz, 10 MB, in open ground. */
static const char *record_much(struct wire *wire)
{
    struct room_config config = {.prr_hz = 1000000, .lines_hz = 200, .pan_deg_s = 90, .pan_stop_deg = 45, .frames = 1};
    char links[400];
    ground_write(wire);
    snprintf(links, sizeof links, "links: [{type: file, path: '%s'}]\n", wire_path(wire, "much.shs"));
    config.links = links;
    const char *const args[] = {
        "run", room_config_write(wire, &config), "--start", "--frames", "1", "--pace", "fast", "--quiet", NULL};
    assert_int_equal(replay_call(wire, args), 0);
    return wire_path(wire, "much.shs");
}

/* Connects a receiver whose buffer takes 4 KiB, so that little is on its way to it. The head keeps the frames that it
 * does not read. */
static int connect_small(const char *endpoint)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)endpoint_port(endpoint))};
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), size = 4096;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    assert_int_equal(setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &size, sizeof size), 0);
    assert_int_equal(connect(fd, (struct sockaddr *)&at, sizeof at), 0);
    return fd;
}

/* On a busy machine this reader loses frames, too. So no event of the stream is waited for. */
static void until_played(struct scanhead *sh)
{
    const int64_t end_ms = wire_now_ms() + DEADLINE_MS;
    struct scanhead_frame frame;
    while (strncmp(client_ask(sh, "SCAN:REPLay?"), "IDLE,", 5) != 0) {
        if (wire_now_ms() > end_ms) fail_msg("it plays for ever");
        scanhead_next(sh, &frame, 10);
    }
}

static void test_too_slow(void **state)
{
    struct wire *wire = *state;
    char file[352];
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    struct tape all = {0};
    uint64_t told = 0, frames = 0, pulses = 0;
    uint32_t first = 0;
    snprintf(file, sizeof file, "%s", record_much(wire));
    tape_read(file, &all);
    static const char *const more[] = {"--link", "type: tcp, port: 0", "--speed", "2", "--set", "loop.queue_ms=50",
                                       "--set",  "loop.late_ms=10000", "--quiet", NULL};
    struct head head = head_start(wire, file, more);
    struct scanhead *slow = client_from_fd(connect_small(head_endpoint(&head, "tcp")));
    struct scanhead *fast = client_open(head_endpoint(&head, "tcp"));
    client_ask(slow, "*OPC?");
    client_tell(fast, "SCAN:STARt");
    until_played(fast); /* it went on, while nobody read from the other one */
    do {
        client_next(slow, &frame);
        if (is_event(&frame, SCANHEAD_EV_READER_LOST)) told += frame.event_value[0];
        if (is_event(&frame, SCANHEAD_EV_READER_LOST)) pulses += frame.event_value[1];
        if ((frame.flags & SCANHEAD_LOCAL) != 0) continue;
        if (frames++ == 0) first = frame.seq;
        pulses += frame.type == SCANHEAD_POINTS ? frame.n_pulses : 0;
    } while (frames + told < all.n);
    scanhead_get_stats(slow, &stats);
    assert_true(told > 0);
    assert_true(first <= told); /* on a busy machine even the first frames may be too late; they are told then */
    assert_int_equal(frames + told, all.n);
    assert_true(stats.seq_lost <= told);                      /* no gap shows what is missing at the end */
    assert_int_equal(stats.bad_payload + stats.bad_bytes, 0); /* whole frames */
    assert_int_equal(pulses, 500000);
    scanhead_close(slow);
    scanhead_close(fast);
    tape_free(&all);
    head_end(&head, SIGTERM);
    assert_true(stats_uint(wire, "reader_lost_frames") >= told);
    assert_int_equal(stats_uint(wire, "lost_pulses"), 0);
}

/* The client that commanded leaves in the middle. The other one gets all of it, and an error names the session. */
static void test_a_client_leaves(void **state)
{
    struct wire *wire = *state;
    char file[352];
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    snprintf(file, sizeof file, "%s", replay_room(wire, "head.shs", 30));
    static const char *const more[] = {"--link", "type: tcp, port: 0",  "--speed", "10", "--quiet",
                                       "--set",  "loop.queue_ms=10000", NULL}; /* on a busy machine, too */
    struct head head = head_start(wire, file, more);
    struct scanhead *first = client_open(head_endpoint(&head, "tcp")),
                    *second = client_open(head_endpoint(&head, "tcp"));
    client_ask(second, "*OPC?");
    client_tell(first, "SCAN:STARt");
    client_until(first, SCANHEAD_EV_SCAN_START, &frame);
    scanhead_close(first);
    client_until(second, SCANHEAD_EV_SCAN_END, &frame);
    assert_int_equal(frame.event_value[1], 3000);
    client_wait_state(second, "idle");
    const char *reply = client_ask(second, "SYST:ERR?");
    if (strstr(reply, "session 1") == NULL) fail_msg("%s", reply);
    client_tell(second, "SCAN:STARt");
    client_until(second, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_get_stats(second, &stats);
    assert_int_equal(stats.seq_lost + stats.bad_bytes, 0);
    scanhead_close(second);
    head_end(&head, SIGTERM);
}

/* The head is ended while it plays. Its file link has the recording up to there, in whole frames. */
static void test_ended_while_it_plays(void **state)
{
    struct wire *wire = *state;
    char file[352], link[400];
    struct scanhead_frame frame;
    struct tape all = {0}, part = {0};
    snprintf(file, sizeof file, "%s", replay_room(wire, "head.shs", 30));
    snprintf(link, sizeof link, "type: file, path: '%s'", wire_path(wire, "part.shs"));
    const char *const more[] = {"--link", "type: tcp, port: 0", "--link", link, "--pace", "step", "--quiet", NULL};
    struct head head = head_start(wire, file, more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_tell(sh, "SCAN:STARt");
    client_tell(sh, "TIME:STEP 300 MS"); /* of 530 */
    head_end(&head, SIGTERM);
    while (scanhead_next(sh, &frame, DEADLINE_MS) == SCANHEAD_OK)
        ;
    scanhead_close(sh);
    tape_read(file, &all);
    tape_read(wire_path(wire, "part.shs"), &part);
    assert_true(part.n > 5 && part.n < all.n);
    all.n = part.n;
    tape_same_bytes(&part, &all);
    tape_free(&all);
    tape_free(&part);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_a_client_notices_what_the_truth_says, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_hit_as_the_head_was, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_too_slow, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_client_leaves, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_ended_while_it_plays, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
