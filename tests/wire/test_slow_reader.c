/* SPDX-License-Identifier: MIT */
/* A reader that cannot follow. In real time it loses whole frames and gets their exact number, and other readers lose
 * none. At the pace `fast` the run waits for it and nothing is lost. */
#include "tests/wire/room.h"

#include <pthread.h>
#include <stdatomic.h>

/* The rate makes 20 MB/s. While the slow reader reads nothing, the buffers to it and the queue of 500 ms fill in a
 * second. The buffers are 1 MiB of the head, and at most 6 of the kernel's for a receiver that asks for none. */
static const struct room_config RATE = {
    .prr_hz = 1000000, .lines_hz = 200, .pan_deg_s = 90, .pan_stop_deg = 360, .frames = 0, .links = LINK_YAML_TCP};
enum { HOLD_BYTES = 40 << 20 };

/* A reader's counts. */
struct tally {
    struct scanhead *sh;
    uint64_t frames, local, pulses, told_lost, told_pulses, told_events, told_total;
    uint32_t first_seq, last_seq;
    int over;
    int hold_fd; /* written to once HOLD_BYTES have come; -1: not */
    uint64_t bytes;
    _Atomic int stop; /* asks it to end the scan, being in control */
    const char *wrong;
};

static void take(struct tally *t, const struct scanhead_frame *frame)
{
    t->bytes += frame->raw_len;
    t->local += (frame->flags & SCANHEAD_LOCAL) != 0;
    if (is_event(frame, SCANHEAD_EV_READER_LOST)) {
        if ((frame->flags & SCANHEAD_LOCAL) == 0) t->wrong = "a loss of one reader was told to all";
        t->told_lost += frame->event_value[0];
        t->told_pulses += frame->event_value[1];
        t->told_total = frame->event_value[2];
        t->told_events++;
        return;
    }
    if ((frame->flags & SCANHEAD_LOCAL) != 0) return;
    if (t->frames != 0 && frame->seq <= t->last_seq) t->wrong = "frames went back";
    if (t->frames++ == 0) t->first_seq = frame->seq;
    t->last_seq = frame->seq;
    if (frame->type == SCANHEAD_POINTS) t->pulses += frame->n_pulses;
    t->over |= is_event(frame, SCANHEAD_EV_SCAN_END);
}

static void *follow(void *arg)
{
    struct tally *t = arg;
    struct scanhead_frame frame;
    const int64_t end_ms = wire_now_ms() + DEADLINE_MS;
    while (!t->over && t->wrong == NULL) {
        if (wire_now_ms() > end_ms) t->wrong = "no end of the scan came";
        if (scanhead_next(t->sh, &frame, DEADLINE_MS) != SCANHEAD_OK) {
            t->wrong = scanhead_error(t->sh);
            break;
        }
        take(t, &frame);
        char reply[600];
        if (atomic_exchange(&t->stop, 0) != 0 &&
            scanhead_command(t->sh, "SCAN:STOP", reply, sizeof reply, DEADLINE_MS) != SCANHEAD_OK)
            t->wrong = scanhead_error(t->sh);
        if (t->hold_fd < 0 || (t->bytes < HOLD_BYTES && !t->over)) continue;
        if (write(t->hold_fd, "h", 1) != 1) t->wrong = "pipe";
        t->hold_fd = -1;
    }
    return NULL;
}

static void check_nothing_bad(const struct tally *t)
{
    struct scanhead_stats stats;
    if (t->wrong != NULL) fail_msg("%s", t->wrong);
    scanhead_get_stats(t->sh, &stats);
    assert_int_equal(stats.bad_payload, 0);
    assert_int_equal(stats.bad_bytes, 0); /* whole frames only */
    assert_int_equal(stats.dropped, 0);
}

static void check_lost_nothing(const struct tally *t)
{
    check_nothing_bad(t);
    assert_int_equal(t->told_events, 0);
    assert_int_equal(t->last_seq - t->first_seq + 1, t->frames);
}

/* Checks the errors once the scan is over, for a reader that was not there. There is an error for each episode, which
 * may lose frames more than once. */
static void check_errors(const struct head *head, uint64_t losses)
{
    struct scanhead *sh = client_open(head_endpoint(head, "tcp"));
    uint64_t n = 0;
    int number;
    while ((number = atoi(client_ask(sh, "SYST:ERR?"))) == 102)
        n++;
    assert_int_equal(number, 0);
    assert_in_range(n, 1, losses);
    scanhead_close(sh);
}

static void overtake(struct wire *wire, const char *more_yaml)
{
    struct room_config config = RATE;
    /* The fast reader has the same queue of 500 ms, but a receive buffer of megabytes and a thread that does nothing
     * else. */
    config.more = more_yaml;
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    struct tally fast = {.sh = client_open(head_endpoint(&head, "tcp"))}, slow = {.hold_fd = -1};
    int slow_fd = raw_connect(head_endpoint(&head, "tcp"));
    slow.sh = client_from_fd(slow_fd);
    client_ask(slow.sh, "*OPC?");
    client_wait_state(fast.sh, "idle");
    int hold[2];
    char byte;
    assert_int_equal(pipe2(hold, O_CLOEXEC), 0);
    fast.hold_fd = hold[1];
    client_tell(fast.sh, "SCAN:STAR");
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, follow, &fast), 0);
    assert_int_equal(read(hold[0], &byte, 1), 1); /* meanwhile the slow one reads nothing */
    struct scanhead_frame frame;
    while (slow.told_events == 0) {
        client_next(slow.sh, &frame);
        take(&slow, &frame);
    }
    atomic_store(&fast.stop, 1);
    follow(&slow);
    pthread_join(thread, NULL);
    /* A machine that is busy for 500 ms may make the fast one slow for once. Then losses are announced to the fast
     * reader, too. */
    check_nothing_bad(&fast);
    /* The announced losses may begin before the first frame that is counted here, but never end before a gap. */
    assert_true(fast.frames + fast.told_lost >= fast.last_seq - fast.first_seq + 1);
    if (fast.told_events == 0) check_lost_nothing(&fast);
    check_nothing_bad(&slow);
    assert_true(slow.told_lost > 0);
    assert_int_equal(slow.told_total, slow.told_lost);
    assert_int_equal(slow.last_seq - slow.first_seq + 1, slow.frames + slow.told_lost);
    assert_int_equal(slow.last_seq, fast.last_seq);
    struct scanhead_stats stats;
    scanhead_get_stats(slow.sh, &stats);
    assert_int_equal(stats.seq_lost, slow.told_lost); /* both ways of counting agree */
    assert_int_equal(stats.reader_lost, slow.told_lost);
    check_errors(&head, slow.told_events + fast.told_events);
    scanhead_close(fast.sh);
    scanhead_close(slow.sh);
    close(hold[0]);
    close(hold[1]);
    head_end(&head, SIGTERM);
    assert_int_equal(stats_uint(wire, "reader_lost_frames"), slow.told_lost + fast.told_lost);
    assert_int_equal(stats_uint(wire, "lost_pulses"), 0);
    assert_int_equal(stats_uint(wire, "cast_pulses"), stats_uint(wire, "pulses"));
    /* For each reader, received and announced pulses are those that the head delivered, to the pulse. */
    assert_int_equal(slow.pulses + slow.told_pulses, stats_uint(wire, "pulses"));
    assert_int_equal(fast.pulses + fast.told_pulses, stats_uint(wire, "pulses"));
}

static void test_realtime(void **state)
{
    overtake(*state, "loop: {queue_ms: 500, late_ms: 10000}\n");
}

/* Half of the frames are attributes, and count like any other. */
static void test_attributes(void **state)
{
    overtake(*state, "loop: {queue_ms: 500, late_ms: 10000}\noutput: {attributes: on}\n");
}

/* Asks and does not read, until the answers fill all buffers on the way. */
static void fill_with_answers(int fd)
{
    char lines[600];
    for (size_t i = 0; i < sizeof lines; i++)
        lines[i] = "*IDN?\n"[i % 6];
    struct pollfd slot = {.fd = fd, .events = POLLOUT};
    while (poll(&slot, 1, 300) == 1)
        send(fd, lines, sizeof lines, MSG_DONTWAIT);
}

/* A reader whose first frames are lost is told so, too: no frame came before them whose number could show it. */
static void test_first_frames_lost(void **state)
{
    struct wire *wire = *state;
    struct room_config config = RATE;
    struct scanhead_frame frame;
    config.frames = 1;
    config.pan_stop_deg = 45;
    config.more = "loop: {queue_ms: 50, late_ms: 10000}\n";
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    struct tally fast = {.sh = client_open(head_endpoint(&head, "tcp")), .hold_fd = -1}, slow = {.hold_fd = -1};
    client_wait_state(fast.sh, "idle");
    const int fd = raw_connect(head_endpoint(&head, "tcp"));
    fill_with_answers(fd);
    client_tell(fast.sh, "SCAN:STAR");
    follow(&fast);
    check_nothing_bad(&fast);
    slow.sh = client_from_fd(fd);
    while (slow.pulses + slow.told_pulses < fast.pulses + fast.told_pulses) {
        client_next(slow.sh, &frame);
        take(&slow, &frame);
    }
    assert_int_equal(slow.pulses + slow.told_pulses, fast.pulses + fast.told_pulses);
    assert_true(slow.told_pulses > 0);
    scanhead_close(fast.sh);
    scanhead_close(slow.sh);
    head_end(&head, SIGTERM);
    assert_int_equal(stats_uint(wire, "pulses"), slow.pulses + slow.told_pulses);
}

static void test_fast(void **state)
{
    struct wire *wire = *state;
    struct room_config config = RATE;
    struct scanhead_frame frame;
    config.frames = 1;
    config.pan_stop_deg = 90; /* a million pulses */
    config.more = "loop: {pace: fast, queue_ms: 50}\n";
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    struct tally fast = {.sh = client_open(head_endpoint(&head, "tcp")), .hold_fd = -1}, slow = {.hold_fd = -1};
    slow.sh = client_from_fd(raw_connect(head_endpoint(&head, "tcp")));
    client_ask(slow.sh, "*OPC?");
    client_wait_state(fast.sh, "idle");
    client_tell(fast.sh, "SCAN:STAR");
    while (scanhead_next(fast.sh, &frame, 1000) == SCANHEAD_OK && !fast.over) /* until the run is held back */
        take(&fast, &frame);
    assert_false(fast.over);
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, follow, &fast), 0);
    follow(&slow);
    pthread_join(thread, NULL);
    check_lost_nothing(&fast);
    check_lost_nothing(&slow);
    assert_int_equal(fast.pulses, slow.pulses);
    scanhead_close(fast.sh);
    scanhead_close(slow.sh);
    head_end(&head, SIGTERM);
    assert_int_equal(stats_uint(wire, "pulses"), slow.pulses);
    assert_int_equal(stats_uint(wire, "reader_lost_frames"), 0);
}

/* The recorder's counts equal the head's. The recorder was there for the whole scan. */
static void check_recorder(struct wire *wire, const char *stats)
{
    uint64_t fired = stats_uint(wire, "fired_pulses"), cast = stats_uint(wire, "cast_pulses"),
             delivered = stats_uint(wire, "pulses"), lost = stats_uint(wire, "lost_pulses");
    uint64_t left_out = stats_link_uint(wire, "left_out_pulses");
    assert_int_equal(cast, delivered + lost);
    assert_int_equal(stats_link_uint(wire, "received_pulses") + left_out, 2 * delivered); /* and a reader beside it */
    assert_int_equal(rename(stats, wire_path(wire, "stats.json")), 0);
    assert_int_equal(stats_uint(wire, "scans"), 1);
    assert_int_equal(stats_uint(wire, "fired_pulses"), fired);
    assert_int_equal(stats_uint(wire, "cast_pulses"), cast);
    assert_int_equal(stats_uint(wire, "lost_pulses"), lost);
    assert_in_range(stats_uint(wire, "missing_pulses"), 1, left_out);
    assert_int_equal(stats_uint(wire, "pulses") + stats_uint(wire, "missing_pulses"), delivered);
    assert_int_equal(stats_uint(wire, "reader_lost_pulses"), stats_uint(wire, "missing_pulses"));
}

/* A recorder that stands still until the scan is over has lost its end. After that a head sends nothing by itself. The
 * recorder is told the loss, asks, and ends. */
static void test_end_lost(void **state)
{
    struct wire *wire = *state;
    struct room_config config = RATE;
    struct scanhead_frame frame;
    config.frames = 1;
    config.pan_stop_deg = 270; /* 3 s, 60 MB: more than the buffers between */
    config.more = "loop: {queue_ms: 50, late_ms: 10000}\n";
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    char stats[352];
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "recorder.json"));
    const char *const args[] = {"record", head_endpoint(&head, "tcp"), "--quiet", "--stats", stats, NULL};
    pid_t pid = wire_spawn(wire, args, "record.out", "record.err", -1);
    client_until(sh, SCANHEAD_EV_SCAN_START, &frame);
    assert_int_equal(kill(pid, SIGSTOP), 0);
    client_wait_state(sh, "idle"); /* the scan's end may be lost to this one, too */
    assert_int_equal(kill(pid, SIGCONT), 0);
    assert_int_equal(wire_wait(wire, pid), 1);
    char *said = wire_read(wire_path(wire, "record.err"), NULL);
    assert_non_null(strstr(said, "the scan's end was lost"));
    assert_non_null(strstr(said, "frames lost to this reader"));
    free(said);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    check_recorder(wire, stats);
}

/* A reader that takes nothing until the head is gone finds the bytes that the kernel had by then. The head counts
 * exactly these pulses as received, and the rest as left out. */
static void test_head_ends_first(void **state)
{
    struct wire *wire = *state;
    struct room_config config = RATE;
    struct scanhead_frame frame;
    char source[32];
    uint64_t received = 0;
    config.frames = 1;
    config.pan_stop_deg = 54; /* 0.6 s, 12 MB: more than the buffers between */
    config.more = "loop: {queue_ms: 10000, late_ms: 10000}\n";
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    snprintf(source, sizeof source, "fd:%d", raw_connect(head_endpoint(&head, "tcp")));
    client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    const uint64_t delivered = stats_uint(wire, "pulses"), left_out = stats_link_uint(wire, "left_out_pulses");
    sh = client_open(source);
    while (scanhead_next(sh, &frame, DEADLINE_MS) == SCANHEAD_OK)
        if (frame.type == SCANHEAD_POINTS) received += frame.n_pulses;
    scanhead_close(sh);
    assert_in_range(left_out, 1, delivered - 1);
    assert_int_equal(received + left_out, delivered);
    assert_int_equal(stats_link_uint(wire, "received_pulses"), delivered + received); /* and the reader beside it */
    assert_int_equal(stats_uint(wire, "reader_lost_pulses"), left_out);
}

/* A reader that never reads, and leaves: it takes no further tick, whose number would show the loss. */
static void test_gone(void **state)
{
    struct wire *wire = *state;
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &RATE), NULL);
    struct tally other = {.sh = client_open(head_endpoint(&head, "tcp")), .hold_fd = -1};
    const int fd = raw_connect(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    client_wait_state(other.sh, "idle");
    client_tell(other.sh, "SCAN:START");
    while (other.bytes < HOLD_BYTES) {
        client_next(other.sh, &frame);
        take(&other, &frame);
    }
    close(fd);
    int number;
    for (int64_t since_ns = 0; (number = atoi(client_ask(other.sh, "SYST:ERR?"))) != 102;) {
        if (number == 0) client_next(other.sh, &frame);
        wire_soon(&since_ns, client_time_ns(other.sh), "an error of the reader");
    }
    scanhead_close(other.sh);
    head_end(&head, SIGTERM);
    assert_true(stats_uint(wire, "reader_lost_frames") > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_realtime, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_attributes, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_first_frames_lost, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_fast, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_end_lost, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_head_ends_first, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_gone, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
