/* SPDX-License-Identifier: MIT */
/* Faults on request, in the program as its users meet it. The same seed gives the same truth at any pace, with any
 * number of threads, over any link and however the client reads. A link without faults has the clean stream. A client
 * reports the injected faults, by number and length. A journal brings faults back. */
#include "drivers/protocol/native.h"
#include "tests/wire/fault_head.h"

/* ---- the truth, as far as it is the same in each run; seq is left out, as notices are numbered in the same
 * sequence */

enum { MAX_NOTES = 1000, NOTE_LEN = 160 };
struct truth {
    struct {
        char kind[24], same[NOTE_LEN];
        long seq, byte, n;
    } note[MAX_NOTES];
    int n;
};

static long number_in(const char *text, const char *key)
{
    const char *at = strstr(text, key);
    return at != NULL ? strtol(at + strlen(key), NULL, 10) : -1;
}

static void word_in(const char *text, const char *key, char *word, size_t len)
{
    const char *at = strstr(text, key);
    assert_non_null(at);
    at += strlen(key);
    snprintf(word, len, "%.*s", (int)strcspn(at, "\""), at);
}

/* Reads the truth of link 1. */
static void read_truth(const struct wire *wire, struct truth *truth)
{
    char *text = wire_read(wire_path(wire, "truth.json"), NULL), *save = NULL, of[16];
    truth->n = 0;
    for (char *at = strtok_r(text, "\n", &save); at != NULL; at = strtok_r(NULL, "\n", &save)) {
        if (number_in(at, "\"link\":") != 1) continue;
        assert_true(truth->n < MAX_NOTES);
        char kind[24];
        word_in(at, "\"kind\":\"", kind, sizeof kind);
        memcpy(truth->note[truth->n].kind, kind, sizeof kind);
        word_in(at, "\"of\":\"", of, sizeof of);
        const long byte = number_in(at, "\"byte\":"), n = number_in(at, "\"n\":");
        truth->note[truth->n].seq = number_in(at, "\"seq\":");
        truth->note[truth->n].byte = byte;
        truth->note[truth->n].n = n;
        snprintf(truth->note[truth->n++].same, NOTE_LEN, "%ld %s %s %ld type %ld pulse %ld byte %ld bit %ld n %ld",
                 number_in(at, "\"fault\":"), kind, of, number_in(at, "\"frame\":"), number_in(at, "\"type\":"),
                 number_in(at, "\"pulse\":"), byte, number_in(at, "\"bit\":"), n);
    }
    free(text);
}

static int count_kind(const struct truth *truth, const char *kind)
{
    int n = 0;
    for (int i = 0; i < truth->n; i++)
        n += strcmp(truth->note[i].kind, kind) == 0;
    return n;
}

static void expect_same(const struct truth *a, const struct truth *b, const char *who)
{
    for (int i = 0; i < a->n && i < b->n; i++)
        if (strcmp(a->note[i].same, b->note[i].same) != 0)
            fail_msg("%s: \"%s\" and \"%s\"", who, a->note[i].same, b->note[i].same);
    assert_int_equal(a->n, b->n);
}

/* ---- the head */

/* Reads in pieces of so many bytes, up to the end of the scan. */
static void scan_raw(const struct head *head, size_t piece)
{
    static struct native_parser parser;
    struct scanhead *sh = client_open(head_endpoint(head, "tcp"));
    client_wait_state(sh, "idle");
    scanhead_close(sh);
    const int fd = raw_connect(head_endpoint(head, "tcp"));
    native_parser_init(&parser);
    raw_send(fd, "SCAN:STAR\n", 10);
    for (int over = 0; !over;) {
        size_t room;
        uint8_t *to = native_parser_room(&parser, &room);
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        if (poll(&slot, 1, DEADLINE_MS) != 1) fail_msg("nothing comes");
        const ssize_t n = read(fd, to, room < piece ? room : piece);
        assert_true(n > 0);
        native_parser_added(&parser, (size_t)n);
        for (enum native_item item; (item = native_parser_next(&parser)) != NATIVE_MORE;) {
            struct native_event event;
            if (item == NATIVE_FRAME && parser.header.type == NATIVE_EVENT &&
                native_decode_event(parser.payload, parser.header.length, &event) == 0)
                over |= event.code == NATIVE_EV_SCAN_END;
        }
    }
    close(fd);
}

static void scan(const struct head *head, const char *link)
{
    struct scanhead_frame frame;
    struct scanhead *sh = client_open(head_endpoint(head, link));
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_close(sh);
}

static const char ALL_KINDS[] = "faults:\n"
                                "  - {kind: drop, every: 17}\n"
                                "  - {kind: duplicate, from: 3, every: 23, n: 2}\n"
                                "  - {kind: reorder, from: 5, every: 19, n: 4}\n"
                                "  - {kind: truncate, from: 40, every: 41}\n"
                                "  - {kind: flip, probability: 0.08, n: 3}\n"
                                "  - {kind: flip, from: 10, every: 50, reseal: on, seed: 5}\n"
                                "  - {kind: stall, at: 60, for_ms: 3}\n"
                                "  - {kind: jitter, from: 20, until: 30, for_ms: 2}\n"
                                "  - {kind: delay, from: 90, until: 95, for_ms: 1}\n"
                                "  - {kind: split, from: 7, every: 29, n: 3}\n"
                                "  - {kind: merge, from: 9, every: 31, n: 3}\n"
                                "  - {kind: garbage, from: 11, every: 37, n: 100}\n"
                                "  - {kind: drop, from_pulse: 20000, until_pulse: 20500}\n";

/* The links come in both orders; link 1 is read. */
static void test_the_same_truth(void **state)
{
    static const struct {
        const char *pace, *threads, *link;
        size_t piece; /* 0: by the library */
    } runs[] = {{"fast", "1", "tcp", 0},       {"fast", "2", "tcp", 300},   {"fast", "2", "tcp", 1 << 20},
                {"realtime", "1", "tcp", 700}, {"realtime", "2", "tcp", 0}, {"fast", "2", "pty", 0},
                {"realtime", "1", "pty", 0}};
    static struct truth first, other;
    struct wire *wire = *state;
    for (size_t i = 0; i < sizeof runs / sizeof runs[0]; i++) {
        const char *const more[] = {"--pace", runs[i].pace, "--threads", runs[i].threads, NULL};
        struct room_config c = FAULT_ROOM;
        char who[64];
        c.links = strcmp(runs[i].link, "tcp") == 0 ? LINK_YAML_TCP : LINK_YAML_PTY;
        struct head head = fault_head_start(wire, &c, ALL_KINDS, more);
        if (runs[i].piece != 0)
            scan_raw(&head, runs[i].piece);
        else
            scan(&head, runs[i].link);
        head_end(&head, SIGTERM);
        read_truth(wire, i == 0 ? &first : &other);
        snprintf(who, sizeof who, "%s, %s threads, %s", runs[i].pace, runs[i].threads, runs[i].link);
        if (i != 0) expect_same(&first, &other, who);
    }
    static const char *const kinds[] = {"drop",   "duplicate", "reorder", "truncate", "flip",   "stall",
                                        "jitter", "delay",     "split",   "merge",    "garbage"};
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++)
        assert_true(count_kind(&first, kinds[i]) > 0);
}

/* ---- the client library's report of it */

enum { SEQS = 4096, MAX_BROKEN = 500 };
struct seen {
    int gaps[SEQS], late[SEQS], repeated[SEQS];
    struct scanhead_notice broken[MAX_BROKEN];
    int n_broken, n[SCANHEAD_NOTICE_REATTACHED + 1];
};

static void see(void *ctx, const struct scanhead_notice *notice)
{
    struct seen *seen = ctx;
    seen->n[notice->kind]++;
    if (notice->kind == SCANHEAD_NOTICE_BAD_BYTES || notice->kind == SCANHEAD_NOTICE_BAD_PAYLOAD) {
        assert_true(seen->n_broken < MAX_BROKEN);
        seen->broken[seen->n_broken++] = *notice;
    }
    for (uint64_t i = 0; i < notice->n && notice->kind <= SCANHEAD_NOTICE_LATE; i++) {
        if (notice->seq + i >= SEQS) fail_msg("number %u", notice->seq);
        (notice->kind == SCANHEAD_NOTICE_GAP    ? seen->gaps
         : notice->kind == SCANHEAD_NOTICE_LATE ? seen->late
                                                : seen->repeated)[notice->seq + i]++;
    }
}

/* Both clients read at once: each holds the head back. */
static void read_both(struct scanhead *a, struct scanhead *b)
{
    struct scanhead_frame frame;
    for (int over = 0; over != 3;) {
        for (int i = 0; i < 2; i++) {
            struct scanhead *sh = i == 0 ? a : b;
            for (int rc; (over & 1 << i) == 0 && (rc = scanhead_next(sh, &frame, 1)) != SCANHEAD_ETIMEOUT;) {
                if (rc != SCANHEAD_OK) fail_msg("%s", scanhead_error(sh));
                over |= is_event(&frame, SCANHEAD_EV_SCAN_END) << i;
            }
        }
    }
}

/* One frame in six is hit, each by one fault beside jitter, so that the notices can be told apart. */
static const char APART[] = "faults:\n"
                            "  - {kind: drop, link: 1, from: 2, every: 60}\n"
                            "  - {kind: duplicate, link: 1, from: 12, every: 60, n: 2}\n"
                            "  - {kind: reorder, link: 1, from: 22, every: 60, n: 5}\n"
                            "  - {kind: truncate, link: 1, from: 32, every: 60}\n"
                            "  - {kind: flip, link: 1, from: 45, every: 30, n: 3}\n"
                            "  - {kind: garbage, link: 1, from: 52, every: 60, n: 100}\n"
                            "  - {kind: flip, link: 1, from: 57, every: 60, reseal: on}\n"
                            "  - {kind: split, link: 1, from: 58, every: 60}\n"
                            "  - {kind: merge, link: 1, from: 59, every: 60}\n"
                            "  - {kind: jitter, link: 1, for_ms: 0.1, probability: 0.1}\n";

static void expect_broken(const struct scanhead_notice *got, const struct truth *truth, int i)
{
    const long seq = truth->note[i].seq, byte = truth->note[i].byte;
    const char *kind = truth->note[i].kind;
    const int is_garbage = strcmp(kind, "garbage") == 0, cut = strcmp(kind, "truncate") == 0;
    /* A fault in the header leaves no frame; else its number is known. */
    const int no_header = is_garbage || byte < NATIVE_HEADER_LEN;
    if (got->kind != (no_header ? SCANHEAD_NOTICE_BAD_BYTES : SCANHEAD_NOTICE_BAD_PAYLOAD))
        fail_msg("%s: %s", truth->note[i].same, scanhead_notice_name((int)got->kind));
    if (!no_header) assert_int_equal(got->seq, seq);
    if (is_garbage) assert_int_equal(got->n, 100);
    if (cut) assert_int_equal(got->n, byte); /* the rest of it */
    if (!is_garbage && !cut) assert_true((long)got->n > byte && got->n >= NATIVE_HEADER_LEN);
}

static void compare(const struct seen *seen, const struct truth *truth)
{
    int gaps[SEQS] = {0}, late[SEQS] = {0}, repeated[SEQS] = {0}, n_broken = 0;
    for (int i = 0; i < truth->n; i++) {
        const char *kind = truth->note[i].kind;
        const long seq = truth->note[i].seq;
        const int is_resealed = strncmp(truth->note[i].same, "7 ", 2) == 0;
        assert_in_range(seq, 0, SEQS - 1);
        const int broken = strcmp(kind, "truncate") == 0 || (strcmp(kind, "flip") == 0 && !is_resealed);
        gaps[seq] += broken || strcmp(kind, "drop") == 0 || strcmp(kind, "reorder") == 0;
        late[seq] += strcmp(kind, "reorder") == 0;
        if (strcmp(kind, "duplicate") == 0) repeated[seq] += (int)truth->note[i].n;
        if (!broken && strcmp(kind, "garbage") != 0) continue;
        assert_true(n_broken < seen->n_broken);
        expect_broken(&seen->broken[n_broken++], truth, i);
    }
    assert_int_equal(seen->n_broken, n_broken);
    for (int seq = 0; seq < SEQS; seq++)
        if (seen->gaps[seq] != gaps[seq] || seen->late[seq] != late[seq] || seen->repeated[seq] != repeated[seq])
            fail_msg("frame %d: missing %d, late %d, repeated %d; injected %d, %d, %d", seq, seen->gaps[seq],
                     seen->late[seq], seen->repeated[seq], gaps[seq], late[seq], repeated[seq]);
    assert_int_equal(seen->n[SCANHEAD_NOTICE_RESTARTED] + seen->n[SCANHEAD_NOTICE_CUT], 0);
}

static void test_a_client_reports_what_was_injected(void **state)
{
    static struct seen seen, clean;
    static struct truth truth;
    struct wire *wire = *state;
    char faulty_hash[65], clean_hash[65], hash[65], stats[352];
    memset(&seen, 0, sizeof seen);
    memset(&clean, 0, sizeof clean);
    const char *const more[] = {"--pace", "fast", NULL};
    struct head head = fault_head_start(wire, &FAULT_ROOM, APART, more);
    struct scanhead *faulty = client_open(head_endpoint(&head, "tcp"));
    struct scanhead *other = client_open(head_endpoint(&head, "pty"));
    scanhead_on_notice(faulty, see, &seen);
    scanhead_on_notice(other, see, &clean);
    scanhead_hash_start(faulty);
    scanhead_hash_start(other);
    client_ask(other, "*IDN?"); /* is there before the scan */
    client_wait_state(faulty, "idle");
    client_tell(faulty, "SCAN:STAR");
    read_both(faulty, other);
    scanhead_hash_hex(faulty, faulty_hash);
    scanhead_hash_hex(other, clean_hash);
    scanhead_close(faulty);
    scanhead_close(other);
    head_end(&head, SIGTERM);
    stats_hash(wire, hash);
    assert_string_equal(clean_hash, hash);
    assert_string_not_equal(faulty_hash, hash);
    for (int kind = 1; kind < SCANHEAD_NOTICE_CLOSED; kind++)
        assert_int_equal(clean.n[kind], 0);
    read_truth(wire, &truth);
    assert_true(truth.n > 40);
    compare(&seen, &truth);
    /* Off line the stream is the same, too. */
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    const char *const args[] = {"record", wire_path(wire, "config.yaml"), "--stats", stats, "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "head.out", "head.err", -1)), 0);
    stats_hash(wire, hash);
    assert_string_equal(clean_hash, hash);
}

/* ---- a journal */

static void test_a_journal_brings_faults_back(void **state)
{
    static struct truth first, again;
    static char journal[352];
    struct wire *wire = *state;
    struct room_config c = FAULT_ROOM;
    c.links = "links: [{type: file, path: out.bin}, {type: tcp, port: 0}]\n";
    snprintf(journal, sizeof journal, "%s", wire_path(wire, "session.txt"));
    const char *const play[] = {"--pace", "fast", "--journal", journal, NULL};
    struct head head = fault_head_start(wire, &c, NULL, play);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    struct scanhead_frame frame;
    fault_head_add(sh, "{kind: drop, link: 1, every: 7}", "1");
    fault_head_add(sh, "{kind: flip, link: 1, probability: 0.2, from_s: 0.05, seed: 9}", "2");
    client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    client_tell(sh, "FAUL:CLE 1");
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    read_truth(wire, &first);
    char *text = wire_read(journal, NULL); /* each fault is a remark in it */
    assert_non_null(strstr(text, "\n# fault 1 drop: t_ns "));
    free(text);
    const char *const replay[] = {"--pace", "fast", "--replay-journal", journal, NULL};
    head = fault_head_start(wire, &c, NULL, replay);
    head_end(&head, 0);
    read_truth(wire, &again);
    assert_true(count_kind(&first, "drop") > 20 && count_kind(&first, "flip") > 50);
    expect_same(&first, &again, "replayed");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_the_same_truth, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_client_reports_what_was_injected, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_journal_brings_faults_back, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests_name("faults on request", tests, NULL, NULL);
}
