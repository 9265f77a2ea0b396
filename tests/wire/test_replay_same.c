/* SPDX-License-Identifier: MIT */
/* The replayed bytes are the recorded ones: over each link, in each pace, from each kind of recording, and once more
 * from a recording of the replay. */
#include "tests/wire/replay_rig.h"

enum { LINES = 15 }; /* a scan of 150 ms of device time: 1500 pulses */

/* The stream as a client receives it. */
struct heard {
    struct tape tape; /* without frames for this client alone */
    char hash[65];
    struct scanhead_stats stats;
};

static void hear(struct wire *wire, const char *file, const char *link, const char *const *more, uint32_t n_frames,
                 struct heard *heard)
{
    const char *args[WIRE_MAX_ARGS] = {"--link",
                                       link,
                                       "--quiet",
                                       "--set",
                                       "loop.late_ms=10000",
                                       "--set",
                                       "loop.queue_ms=10000"}; /* on a busy machine, too */
    struct scanhead_frame frame;
    char hash[65];
    for (int i = 7; more != NULL && *more != NULL; i++)
        args[i] = *more++;
    const int is_step = strcmp(args[8], "step") == 0;
    struct head head = head_start(wire, file, args);
    struct scanhead *sh = client_open(head_link(&head, 0));
    memset(heard, 0, sizeof *heard);
    scanhead_hash_start(sh);
    client_tell(sh, "SCAN:STARt");
    for (uint32_t n = 0; n < n_frames;) {
        const int rc = scanhead_next(sh, &frame, is_step ? 0 : DEADLINE_MS);
        if (rc == SCANHEAD_ETIMEOUT && is_step) {
            client_tell(sh, "TIME:STEP 50 MS");
            continue;
        }
        if (rc != SCANHEAD_OK) fail_msg("%u of %u frames: %s", n, n_frames, scanhead_error(sh));
        if ((frame.flags & SCANHEAD_LOCAL) != 0) continue;
        tape_add(&heard->tape, &frame, 0);
        n++;
    }
    assert_int_equal(scanhead_next(sh, &frame, 0), SCANHEAD_ETIMEOUT); /* no more than there is */
    scanhead_hash_hex(sh, heard->hash);
    scanhead_get_stats(sh, &heard->stats);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    stats_hash(wire, hash);
    assert_string_equal(hash, heard->hash);
}

/* Makes the recording of the head, with its hash. */
static void original(struct wire *wire, struct tape *tape, char file[352], char hash[65])
{
    snprintf(file, 352, "%s", replay_room(wire, "head.shs", LINES));
    struct scanhead *sh = client_open(file);
    struct scanhead_frame frame;
    memset(tape, 0, sizeof *tape);
    scanhead_hash_start(sh);
    while (scanhead_next(sh, &frame, DEADLINE_MS) == SCANHEAD_OK)
        tape_add(tape, &frame, 0);
    scanhead_hash_hex(sh, hash);
    scanhead_close(sh);
    assert_true(tape->n > 3 * LINES);
}

static void link_of(const struct wire *wire, const char *link, char text[400])
{
    if (strcmp(link, "pty") == 0)
        snprintf(text, 400, "type: pty, path: '%s'", wire_path(wire, "port"));
    else
        snprintf(text, 400, "%s", link);
}

static void test_links_and_paces(void **state)
{
    struct wire *wire = *state;
    static const char *const cases[][4] = {
        {"type: tcp, port: 0", "--pace", "fast", NULL},
        {"type: tcp, port: 0", "--pace", "step", NULL},
        {"pty", "--pace", "fast", NULL},
        {"pty", "--pace", "step", NULL},
        {"pty", "--speed", "20", NULL},
        {"type: tcp, port: 0", "--speed", "20", NULL},
        {"type: tcp, port: 0, waits: yes", "--speed", "1000", NULL},
    };
    struct tape head;
    struct heard first, second;
    char file[352], hash[65], link[400];
    original(wire, &head, file, hash);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char again[352];
        link_of(wire, cases[i][0], link);
        hear(wire, file, link, cases[i] + 1, head.n, &first);
        tape_same_bytes(&first.tape, &head);
        assert_string_equal(first.hash, hash);
        if (i % 4 == 0) { /* a replay of this replay */
            snprintf(again, sizeof again, "%s", tape_write(wire, "replay.shs", &first.tape));
            hear(wire, again, link, cases[i] + 1, head.n, &second);
            tape_same_bytes(&second.tape, &head);
            assert_string_equal(second.hash, hash);
            tape_free(&second.tape);
        }
        tape_free(&first.tape);
    }
    tape_free(&head);
}

static void record(struct wire *wire, const char *source, const char *out, char hash[65])
{
    char path[352], stats[352];
    snprintf(path, sizeof path, "%s", wire_path(wire, out));
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    const char *const args[] = {"record", source, "-o", path, "--stats", stats, "--quiet", NULL};
    const int status = replay_call(wire, args);
    if (status != 0) wire_show(wire, "err");
    assert_int_equal(status, 0);
    stats_hash(wire, hash);
}

static void same_file(const struct wire *wire, const char *a, const char *b)
{
    size_t n, m;
    char *first = wire_read(wire_path(wire, a), &n), *second = wire_read(wire_path(wire, b), &m);
    assert_int_equal(n, m);
    assert_memory_equal(first, second, n);
    free(first);
    free(second);
}

/* Our own recorder ends with the scan. It records twice in a row, each time a further repetition of the replay. The
 * replay of a .pcapng has the bytes of the .shs that it was made from. */
static void test_recorder(void **state)
{
    struct wire *wire = *state;
    static const char *const files[] = {"first.shs", "first.pcapng"};
    static const char *const more[] = {"--link", "type: tcp, port: 0", "--pace", "fast", "--quiet", NULL};
    struct tape head, replay = {0};
    char file[352], hash[65], other[65];
    original(wire, &head, file, hash);
    tape_free(&head);
    for (int i = 0; i < 2; i++) {
        struct head run = head_start(wire, file, more);
        char source[64];
        snprintf(source, sizeof source, "%s", head_endpoint(&run, "tcp"));
        record(wire, source, files[i], other);
        assert_string_equal(other, hash);
        record(wire, source, "second.shs", other);
        assert_string_equal(other, hash);
        head_end(&run, SIGTERM);
        snprintf(file, sizeof file, "%s", wire_path(wire, files[i])); /* from here on this is replayed */
        replay_to_file(wire, file, NULL, "again.shs");
        stats_hash(wire, other);
        assert_string_equal(other, hash);
    }
    same_file(wire, "first.shs", "again.shs");
    tape_read(wire_path(wire, "again.shs"), &replay);
    tape_read(wire_path(wire, "first.shs"), &head);
    tape_same_bytes(&replay, &head);
    tape_free(&replay);
    tape_free(&head);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_links_and_paces, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_recorder, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
