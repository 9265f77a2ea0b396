/* SPDX-License-Identifier: MIT */
/* A head writes files beside its stream, and nobody reads them: a FIFO takes the place of a slow disk. The FIFO costs
 * no pulse, and no client waits. Lines that the files lack are counted in them, by SYST:LOST? and in the statistics. */
#include <pthread.h>

#include "drivers/protocol/native.h"
#include "tests/common/thorough.h"
#include "tests/wire/room.h"

enum { PIPE_BYTES = 4096, MOST_BYTES = 64 << 20 };

/* ---- a file that stands still until somebody reads it */

struct fifo {
    char path[352];
    int fd;
    pthread_t thread;
    char *text;
};

static void fifo_make(const struct wire *wire, const char *name, struct fifo *fifo)
{
    snprintf(fifo->path, sizeof fifo->path, "%s", wire_path(wire, name));
    assert_int_equal(mkfifo(fifo->path, 0600), 0);
    fifo->fd = open(fifo->path, O_RDONLY | O_NONBLOCK);
    assert_true(fifo->fd >= 0);
    assert_true(fcntl(fifo->fd, F_SETPIPE_SZ, PIPE_BYTES) >= 0);
    assert_int_equal(fcntl(fifo->fd, F_SETFL, 0), 0);
}

static void *fifo_main(void *arg)
{
    struct fifo *fifo = arg;
    size_t len = 0;
    ssize_t n;
    while ((n = read(fifo->fd, fifo->text + len, MOST_BYTES - 1 - len)) > 0)
        len += (size_t)n;
    fifo->text[len] = '\0';
    return NULL;
}

/* From now on it is read, to its end. */
static void fifo_read(struct fifo *fifo)
{
    fifo->text = malloc(MOST_BYTES);
    assert_non_null(fifo->text);
    assert_int_equal(pthread_create(&fifo->thread, NULL, fifo_main, fifo), 0);
}

/* Returns all bytes that were in it; free() it. */
static char *fifo_join(struct fifo *fifo)
{
    assert_int_equal(pthread_join(fifo->thread, NULL), 0);
    close(fifo->fd);
    return fifo->text;
}

/* ---- the files' contents */

struct lines {
    uint64_t commands, lost_commands; /* of a journal; the end of the run is none of them */
    uint64_t notes, lost_notes;       /* of faults */
    int has_end;
};

static uint64_t number_behind(const char *at, const char *begin)
{
    return strncmp(at, begin, strlen(begin)) == 0 ? strtoull(at + strlen(begin), NULL, 10) : 0;
}

static struct lines count_lines(const char *text)
{
    struct lines n = {0};
    for (const char *at = text; *at != '\0'; at = strchr(at, '\n') + 1) {
        const char *end = strchr(at, '\n');
        assert_non_null(end); /* whole lines */
        n.lost_commands += number_behind(at, "LOST ");
        n.lost_notes += number_behind(at, "# missing here: ") + number_behind(at, "{\"missing\":");
        n.notes += strncmp(at, "# fault ", 8) == 0 || strncmp(at, "{\"fault\":", 9) == 0;
        const int is_end = end - at > 6 && strncmp(end - 6, " 0 END", 6) == 0;
        n.has_end |= is_end;
        n.commands += *at >= '0' && *at <= '9' && !is_end;
    }
    return n;
}

/* Asks for the losses: "of the journal,of the truth". */
static uint64_t ask_lost(struct scanhead *sh, int which)
{
    unsigned long long lost[2];
    assert_int_equal(sscanf(client_ask(sh, "SYST:LOST?"), "%llu,%llu", &lost[0], &lost[1]), 2);
    return lost[which];
}

static uint64_t lost_lines(const struct scanhead_frame *frame)
{
    struct native_telemetry t;
    if (frame->type != SCANHEAD_TELEMETRY) return 0;
    assert_int_equal(native_decode_telemetry(frame->payload, frame->payload_len, &t), 0);
    return t.lost_lines;
}

/* A scan of 36 s in a room of twelve triangles. With THOROUGH=1 the journal stands still for longer than late_ms. */
static const char *write_config(const struct wire *wire, double prr_hz, const char *links)
{
    static char path[352], more[256];
    const struct room_config c = {.prr_hz = prr_hz,
                                  .lines_hz = 200,
                                  .pan_deg_s = 10,
                                  .pan_stop_deg = 360,
                                  .frames = 1,
                                  .links = links,
                                  .more = more};
    room_write(wire);
    snprintf(more, sizeof more, "loop: {queue_ms: 1000, late_ms: %d}\n", thorough(2000, 10000));
    snprintf(path, sizeof path, "%s", room_config_write(wire, &c));
    return path;
}

/* ---- the tests */

/* Sends a command of 256 bytes that changes nothing in the scan, and is in the journal. */
static void command(struct scanhead *sh)
{
    char line[257];
    snprintf(line, sizeof line, "%-256s", "FAUL:CLE ALL");
    client_tell(sh, line);
}

/* In real time nothing waits for the journal. The thorough form is that of a head at its limit for 10 s. */
static void test_journal(void **state)
{
    struct wire *wire = *state;
    const int64_t for_ns = thorough(10, 0) * INT64_C(1000000000);
    const uint64_t least = 2 * (1 << 20) / 256; /* twice as much as there is room for */
    struct fifo fifo;
    fifo_make(wire, "journal", &fifo);
    const char *const more[] = {"--journal", fifo.path, NULL};
    struct head head = head_start(wire, write_config(wire, thorough(2200000, 100000), LINK_YAML_TCP), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    const int64_t from_ns = client_time_ns(sh);
    uint64_t sent = 1;
    for (; sent < least || client_time_ns(sh) - from_ns < for_ns; sent++)
        command(sh);
    const uint64_t lost = ask_lost(sh, 0);
    assert_true(lost > 0);
    const char *reply = client_ask(sh, "SYST:ERR?");
    if (strncmp(reply, "106,\"Lines lost; so far of the journal ", 39) != 0) fail_msg("%s", reply);
    assert_string_equal(client_ask(sh, "HEAD:STAT?"), "scanning");
    fifo_read(&fifo);
    client_tell(sh, "SCAN:STOP");
    client_wait_state(sh, "idle");
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    char *text = fifo_join(&fifo);
    const struct lines n = count_lines(text);
    assert_int_equal(stats_uint(wire, "lost_pulses"), 0);
    assert_int_equal(n.commands + n.lost_commands, sent + 1);
    assert_int_equal(n.lost_commands, stats_uint(wire, "lost_journal_lines"));
    assert_true(n.lost_commands >= lost && n.has_end);
    wire_write_text(wire, "holed", text);
    free(text);
    const char *const again[] = {"run", wire_path(wire, "config.yaml"), "--replay-journal", wire_path(wire, "holed"),
                                 NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, again, "out", "err", -1)), 2);
    char *said = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(said, "commands are missing here, which could not be written in time"));
    free(said);
}

static const char FAULTS[] = "faults:\n"
                             "  - {kind: flip, every: 1, link: 1, of: stream}\n"
                             "  - {kind: flip, every: 1, link: 1, of: stream}\n"
                             "  - {kind: flip, every: 1, link: 1, of: stream}\n"
                             "  - {kind: flip, every: 1, link: 1, of: stream}\n";
static const char LINKS[] = "links: [{type: 'null'}, {type: tcp, port: 0}]\n";

static struct head start_truth(struct wire *wire, const struct fifo *fifo, const char *pace, const char *start)
{
    static char faults[352], journal[352];
    const char *config = write_config(wire, 100000, LINKS);
    snprintf(faults, sizeof faults, "%s", wire_write_text(wire, "faults.yaml", FAULTS));
    snprintf(journal, sizeof journal, "%s", wire_path(wire, "journal"));
    const char *const more[] = {"--scenario",           faults,   "--truth", fifo->path, "--journal", journal, "--set",
                                "head.pan_stop_deg=60", "--pace", pace,      start,      NULL};
    return head_start(wire, config, more);
}

/* The head runs in real time. The journal, a regular file, has a remark for each fault as well. */
static void test_truth(void **state)
{
    struct wire *wire = *state;
    struct fifo fifo;
    fifo_make(wire, "truth", &fifo);
    struct head head = start_truth(wire, &fifo, "realtime", NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    uint64_t told = 0; /* by telemetry */
    for (int64_t since_ns = 0; told == 0; told = lost_lines(&frame)) {
        client_next(sh, &frame);
        wire_soon(&since_ns, frame.t_ns, "a note without room");
    }
    assert_true(ask_lost(sh, 1) >= told);
    fifo_read(&fifo);
    client_tell(sh, "SCAN:STOP");
    client_wait_state(sh, "idle");
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    char *text = fifo_join(&fifo), *journal = wire_read(wire_path(wire, "journal"), NULL);
    const struct lines n = count_lines(text), all = count_lines(journal);
    assert_int_equal(stats_uint(wire, "lost_pulses"), 0);
    assert_true(n.lost_notes > 0);
    assert_int_equal(n.lost_notes, stats_uint(wire, "lost_truth_lines"));
    assert_int_equal(n.notes + n.lost_notes, all.notes + all.lost_notes);
    free(text);
    free(journal);
}

/* As fast as it computes, the head waits for the file, as it does for readers. Clients have their answers meanwhile. */
static void test_fast_waits(void **state)
{
    struct wire *wire = *state;
    struct fifo fifo;
    struct scanhead *sh;
    char a[32], b[32];
    fifo_make(wire, "truth", &fifo);
    struct head head = start_truth(wire, &fifo, "fast", "--start");
    sh = client_open(head_endpoint(&head, "tcp"));
    do { /* until time stands still */
        snprintf(a, sizeof a, "%s", client_ask(sh, "TIME?"));
        poll(NULL, 0, 200);
        snprintf(b, sizeof b, "%s", client_ask(sh, "TIME?"));
    } while (strcmp(a, b) != 0);
    assert_string_equal(client_ask(sh, "HEAD:STAT?"), "scanning");
    fifo_read(&fifo);
    client_wait_state(sh, "idle");
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    char *text = fifo_join(&fifo), *journal = wire_read(wire_path(wire, "journal"), NULL);
    const struct lines n = count_lines(text), all = count_lines(journal);
    assert_true(n.notes > (1 << 20) / 100); /* more than there is room for */
    assert_int_equal(n.lost_notes + all.lost_notes, 0);
    assert_int_equal(n.notes, all.notes);
    assert_int_equal(stats_uint(wire, "lost_truth_lines") + stats_uint(wire, "lost_journal_lines"), 0);
    free(text);
    free(journal);
}

/* Nobody ever reads it. The head ends all the same, and reports what is missing. */
static void test_end(void **state)
{
    struct wire *wire = *state;
    struct fifo fifo;
    fifo_make(wire, "journal", &fifo);
    const char *const more[] = {"--journal", fifo.path, NULL};
    struct head head = head_start(wire, write_config(wire, 100000, LINK_YAML_TCP), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    for (int i = 0; i < 100; i++)
        command(sh);
    scanhead_close(sh);
    kill(head.pid, SIGTERM);
    assert_int_equal(wire_wait(wire, head.pid), 1);
    char *said = wire_read(wire_path(wire, "head.err"), NULL), want[64];
    snprintf(want, sizeof want, "its reader took no data for 2 s; %llu lines are missing",
             (unsigned long long)stats_uint(wire, "lost_journal_lines"));
    if (strstr(said, want) == NULL) fail_msg("%s, not %s", said, want);
    free(said);
    fifo_read(&fifo);
    char *text = fifo_join(&fifo);
    assert_int_equal(count_lines(text).commands + stats_uint(wire, "lost_journal_lines"), 100 + 1); /* and the end */
    free(text);
}

/* The head's messages go into the FIFO. Each pose is far from all surfaces, which causes a warning. */
static void test_messages(void **state)
{
    struct wire *wire = *state;
    struct fifo fifo;
    enum { N = 100 };
    fifo_make(wire, "head.err", &fifo);
    const char *const more[] = {"--quiet", NULL};
    struct head head = head_start(wire, write_config(wire, 100000, LINK_YAML_TCP), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    for (int i = 0; i < N; i++) {
        char line[64];
        snprintf(line, sizeof line, "SITE:POSE 1, %d, 0, 0, 0, 0, 0", 100000 + i);
        client_tell(sh, line);
    }
    scanhead_close(sh);
    fifo_read(&fifo);
    head_end(&head, SIGTERM);
    char *text = fifo_join(&fifo), *at = text;
    int n = 0;
    while ((at = strstr(at, "no surface within range_max_m")) != NULL)
        n++, at++;
    assert_int_equal(n, N);
    free(text);
}

/* Nobody ever reads them, and there is no room in the pipe. The run ends all the same, with a warning as its last
 * message: the recording's end is cut off. */
static void test_last_message(void **state)
{
    struct wire *wire = *state;
    struct fifo fifo;
    char whole[352], links[400];
    size_t len;
    snprintf(whole, sizeof whole, "%s", wire_path(wire, "head.shs"));
    snprintf(links, sizeof links, "links: [{type: file, path: '%s'}]\n", whole);
    const char *const record[] = {
        "run", write_config(wire, 100000, links), "--start", "--duration", "0.1", "--pace", "fast", "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, record, "out", "err", -1)), 0);
    char *bytes = wire_read(whole, &len);
    wire_write(wire, "head.shs", bytes, len - 20);
    free(bytes);
    fifo_make(wire, "stalled", &fifo);
    const int fd = open(fifo.path, O_WRONLY | O_NONBLOCK);
    while (write(fd, "x", 1) == 1) {
    }
    const char *const replay[] = {"run", whole, "--start", "--pace", "fast", "--quiet", "--link", "null", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, replay, "out", "stalled", -1)), 0);
    close(fd);
    close(fifo.fd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_journal, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_truth, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_fast_waits, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_end, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_messages, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_last_message, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests_name("stalled_files", tests, NULL, NULL);
}
