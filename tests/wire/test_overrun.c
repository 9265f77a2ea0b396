/* SPDX-License-Identifier: MIT */
/* A head that cannot keep up, and one that stood still. Losses are announced, and the accounts balance to the pulse.
 * Cast pulses by exact arithmetic = pulses received + pulses lost, whatever happened. */
#include "tests/wire/room.h"

#include "drivers/protocol/native.h"

/* Thin triangles across a room of 40 m: their boxes all overlap, which no bounding volume hierarchy can sort. The
 * station's visibility map (cast.sight) would make them cheap, so it is off. Two casters are to be too slow by far. Yet
 * each tick must take much less than the 164 ms that it has (loop.ahead_ms and late_ms), also where others use the
 * processors: hence ticks are short. */
enum { NEEDLES = 8000 };

static double between(uint64_t *x, double lo, double hi)
{
    *x ^= *x << 13, *x ^= *x >> 7, *x ^= *x << 17;
    return lo + (hi - lo) * (double)(*x >> 11) * 0x1p-53;
}

static void needles_write(const struct wire *wire)
{
    uint64_t x = 88172645463325252u;
    FILE *f = fopen(wire_path(wire, "room.obj"), "w");
    assert_non_null(f);
    for (int i = 0; i < NEEDLES; i++) {
        double p[6];
        for (int k = 0; k < 6; k++)
            p[k] = between(&x, -20, 20);
        fprintf(f, "v %.4f %.4f %.4f\nv %.4f %.4f %.4f\nv %.4f %.4f %.4f\nf -3 -2 -1\n", p[0], p[1], p[2], p[3], p[4],
                p[5], p[3] + 0.01, p[4], p[5]);
    }
    assert_int_equal(fclose(f), 0);
}

/* A client's account of a scan. */
struct account {
    struct oracle oracle;
    uint64_t received, next, gaps, missing;   /* pulses; the last two from jumps of the pulse number */
    uint64_t first_missing, told, told_first; /* by overrun events */
    uint64_t scan_cast, scan_lost;            /* by the telemetry before the scan's end */
    int events, scan_over;
    uint64_t end_lost;  /* by the scan's end */
    uint64_t readers;   /* that were there for the whole scan */
    int in_second_half; /* points frames */
    int64_t t_ns, line;
    uint64_t whole_lines, broken_lines;
    uint32_t echoes;
    int line_broken;
};

/* Cast pulses from a->next up to `end` did not come. */
static void note_gap(struct account *a, uint64_t end)
{
    uint64_t missing = oracle_count_cast(&a->oracle, a->next, end);
    if (missing != 0 && a->gaps++ == 0)
        for (a->first_missing = a->next; !oracle_is_cast(&a->oracle, a->first_missing);)
            a->first_missing++;
    a->missing += missing;
    a->line_broken |= missing != 0;
}

static void take_points(struct account *a, struct scanhead *sh, const struct scanhead_frame *frame)
{
    static struct scanhead_point point[4096];
    assert_true(frame->pulse0 >= a->next); /* nothing comes twice or back to front */
    assert_true(frame->t_ns >= a->t_ns);
    a->t_ns = frame->t_ns;
    note_gap(a, frame->pulse0);
    assert_int_equal(frame->scan_t0_ns, oracle_time_ns(&a->oracle, frame->pulse0));
    assert_int_equal(frame->scan_line, oracle_line(&a->oracle, frame->pulse0));
    if (frame->scan_line != a->line) a->echoes = 0;
    a->line = frame->scan_line;
    a->received += frame->n_pulses;
    a->in_second_half += frame->pulse0 > oracle_end(&a->oracle) / 2;
    a->next = frame->pulse0 + frame->n_pulses;
    int n = scanhead_points(sh, frame, 0, point, 4096);
    for (int i = 0; i < n; i++) /* no points before descriptor and anchor: then n is negative */
        a->echoes += point[i].echo_count != 0;
}

/* A line that came whole reports how many echoes it has; else it reports 0, which is never wrong. The first line may do
 * that, too, when a tick before the scan was lost. */
static void take_line_end(struct account *a, const struct scanhead_frame *frame)
{
    struct line_end end;
    assert_int_equal(native_decode_line_end(frame->payload, frame->payload_len, &end), 0);
    note_gap(a, end.pulse0 + end.n_fired);
    int skipped =
        a->line != end.line || oracle_count_cast(&a->oracle, end.pulse0, end.pulse0 + end.n_fired) != end.n_cast;
    if (!a->line_broken && !skipped) {
        if (end.line != 0 || end.n_echoes != 0) assert_int_equal(end.n_echoes, a->echoes);
        a->whole_lines++;
    } else {
        assert_int_equal(end.n_echoes, 0);
        a->broken_lines++;
    }
    a->next = end.pulse0 + end.n_fired;
    a->echoes = 0;
    a->line_broken = 0;
    a->line = end.line + 1;
}

static void take(struct account *a, struct scanhead *sh, const struct scanhead_frame *frame)
{
    if (frame->type == SCANHEAD_POINTS) take_points(a, sh, frame);
    if (frame->type == SCANHEAD_LINE_END) take_line_end(a, frame);
    if (is_event(frame, SCANHEAD_EV_OVERRUN)) {
        if (a->events++ == 0 || frame->event_value[0] < a->told_first) a->told_first = frame->event_value[0];
        a->told += frame->event_value[1];
    }
    if (frame->type == SCANHEAD_TELEMETRY) {
        struct native_telemetry t;
        assert_int_equal(native_decode_telemetry(frame->payload, frame->payload_len, &t), 0);
        a->scan_cast = t.scan_cast;
        a->scan_lost = t.scan_lost;
    }
    if (is_event(frame, SCANHEAD_EV_SCAN_END)) {
        assert_int_equal(frame->event_value[1], oracle_end(&a->oracle));
        a->end_lost = frame->event_value[2];
        a->scan_over = 1;
    }
}

static const struct room_config CONFIG = {.prr_hz = 1999999.9,
                                          .lines_hz = 333.3,
                                          .pan_deg_s = 360,
                                          .pan_stop_deg = 180,
                                          .frames = 1,
                                          .links = LINK_YAML_TCP,
                                          .more = "loop: {queue_ms: 10000, tick_hz: 5000}\ncast: {sight: off}\n"};

/* Follows one scan to its end, and on until the head is idle and has reported all its losses. */
static void follow(struct account *a, struct scanhead *sh)
{
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    while (!a->scan_over) {
        client_next(sh, &frame);
        take(a, sh, &frame);
    }
    note_gap(a, oracle_end(&a->oracle));
    for (int64_t end_ms = wire_now_ms() + DEADLINE_MS; a->told < a->missing;) {
        if (wire_now_ms() > end_ms) fail_msg("%" PRIu64 " of %" PRIu64 " lost pulses told", a->told, a->missing);
        if (scanhead_next(sh, &frame, 100) == SCANHEAD_OK) take(a, sh, &frame);
    }
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.bad_payload + stats.bad_bytes + stats.seq_lost + stats.dropped + stats.reader_lost, 0);
    assert_int_equal(stats.pulses_lost, a->told);
}

/* The statistics: fired = blind + cast, cast = delivered + lost. For each of so many readers, delivered = received +
 * lost with frames. */
static void check_sums(const struct wire *wire, const struct oracle *oracle, uint64_t readers)
{
    uint64_t fired = oracle_end(oracle), cast = oracle_count_cast(oracle, 0, fired);
    assert_int_equal(stats_uint(wire, "fired_pulses"), fired);
    assert_int_equal(stats_uint(wire, "blind_pulses"), fired - cast);
    assert_int_equal(stats_uint(wire, "cast_pulses"), cast);
    assert_int_equal(stats_uint(wire, "pulses") + stats_uint(wire, "lost_pulses"), cast);
    assert_int_equal(stats_link_uint(wire, "received_pulses") + stats_link_uint(wire, "left_out_pulses"),
                     readers * stats_uint(wire, "pulses"));
    assert_int_equal(stats_link_uint(wire, "left_out_pulses"), stats_uint(wire, "reader_lost_pulses"));
}

static void check_balance(const struct account *a, const struct wire *wire)
{
    uint64_t cast = oracle_count_cast(&a->oracle, 0, oracle_end(&a->oracle));
    assert_int_equal(a->received + a->missing, cast);
    assert_int_equal(a->told, a->missing);
    assert_int_equal(a->end_lost, a->missing); /* however late it was lost */
    assert_int_equal(a->scan_cast, cast);
    assert_int_equal(a->scan_lost, a->missing);
    assert_int_equal(stats_uint(wire, "pulses"), a->received);
    assert_int_equal(stats_uint(wire, "lost_pulses"), a->missing);
    assert_int_equal(stats_uint(wire, "reader_lost_frames"), 0);
    check_sums(wire, &a->oracle, a->readers);
}

/* A recorder counts the head's figures and this reader's. */
static void check_recorder(const struct account *a, const struct wire *wire)
{
    assert_int_equal(stats_uint(wire, "fired_pulses"), oracle_end(&a->oracle));
    assert_int_equal(stats_uint(wire, "cast_pulses"), a->scan_cast);
    assert_int_equal(stats_uint(wire, "lost_pulses"), a->missing);
    assert_int_equal(stats_uint(wire, "pulses") + stats_uint(wire, "missing_pulses"), a->received);
    assert_int_equal(stats_uint(wire, "missing_pulses"), stats_uint(wire, "reader_lost_pulses"));
}

static void check_overload(struct account *a, struct scanhead *sh)
{
    assert_true(a->missing > 0); /* two casters compute at most half of them in time, on fast machines */
    assert_int_equal(a->told_first, a->first_missing);
    /* Pulses that can be computed go on coming. The stream does not end with those computed ahead at the start. */
    assert_true(a->in_second_half > 0);                       /* how many, depends on the machine */
    assert_int_equal(atoi(client_ask(sh, "SYST:ERR?")), 103); /* one error for each episode */
}

static struct head start_overload(struct wire *wire, const char *threads)
{
    needles_write(wire);
    const char *const more[] = {"--threads", threads, NULL};
    return head_start(wire, room_config_write(wire, &CONFIG), more);
}

static void test_overload_recorded(void **state)
{
    struct wire *wire = *state;
    struct account a = {.oracle = oracle_of(&CONFIG, -40, 60, 100), .readers = 2};
    struct head head = start_overload(wire, "1");
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    char stats[352];
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "recorder.json"));
    const char *const args[] = {"record", head_endpoint(&head, "tcp"), "--quiet", "--stats", stats, NULL};
    pid_t recorder = wire_spawn(wire, args, "record.out", "record.err", -1);
    follow(&a, sh);
    assert_int_equal(wire_wait(wire, recorder), 1); /* not complete */
    check_overload(&a, sh);
    assert_int_equal(atoi(client_ask(sh, "SYST:ERR?")), 101); /* the recorder left */
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    check_balance(&a, wire);
    assert_int_equal(rename(stats, wire_path(wire, "stats.json")), 0);
    check_recorder(&a, wire);
}

static void test_overload_two_casters(void **state)
{
    struct wire *wire = *state;
    struct account a = {.oracle = oracle_of(&CONFIG, -40, 60, 100), .readers = 1};
    struct head head = start_overload(wire, "2");
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    follow(&a, sh);
    check_overload(&a, sh);
    assert_int_equal(atoi(client_ask(sh, "SYST:ERR?")), 0);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    check_balance(&a, wire);
}

/* The whole process stands still for 400 ms, twice, in mid-scan. The stalls may or may not cost pulses. */
static void test_stall(void **state)
{
    struct wire *wire = *state;
    struct room_config config = CONFIG;
    config.prr_hz = 500000;
    config.more = "loop: {ahead_ms: 2, late_ms: 1, queue_ms: 10000}\n";
    struct account a = {.oracle = oracle_of(&config, -40, 60, 100), .readers = 1};
    struct scanhead_frame frame;
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    for (int stall = 1; stall <= 2; stall++) {
        while (a.received + a.missing < (uint64_t)stall * 100000) {
            client_next(sh, &frame);
            take(&a, sh, &frame);
        }
        assert_int_equal(kill(head.pid, SIGSTOP), 0);
        clock_nanosleep(CLOCK_MONOTONIC, 0, &(struct timespec){.tv_nsec = 400000000}, NULL); /* the stall itself */
        assert_int_equal(kill(head.pid, SIGCONT), 0);
    }
    follow(&a, sh);
    assert_true(a.received > 0 && a.whole_lines > 0);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    check_balance(&a, wire);
}

/* Returns how many ticks were late by from_ns or more, by the histogram. A row counts the ticks of the octave below its
 * number. */
static uint64_t late_ticks(const struct wire *wire, uint64_t from_ns)
{
    static const char key[] = "\"late_below_ns\": {";
    char *text = wire_read(wire_path(wire, "stats.json"), NULL), *at = strstr(text, key);
    unsigned long long below_ns, count;
    uint64_t n = 0;
    assert_non_null(at);
    at += strlen(key);
    for (int used = 0; sscanf(at, " \"%llu\": %llu%n", &below_ns, &count, &used) == 2; at += used + (at[used] == ','))
        if (below_ns / 2 >= from_ns) n += count;
    assert_int_equal(at[strspn(at, " \n")], '}');
    free(text);
    return n;
}

/* A stall alone costs nothing where pulses may be late enough: those that were due are sent when the head goes on. */
static void test_stall_with_patience(void **state)
{
    struct wire *wire = *state;
    struct room_config config = CONFIG;
    config.prr_hz = 200000;
    config.more = "loop: {queue_ms: 10000, late_ms: 10000}\n";
    struct account a = {.oracle = oracle_of(&config, -40, 60, 100), .readers = 1};
    struct scanhead_frame frame;
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    while (a.received < 20000) {
        client_next(sh, &frame);
        take(&a, sh, &frame);
    }
    assert_int_equal(kill(head.pid, SIGSTOP), 0);
    clock_nanosleep(CLOCK_MONOTONIC, 0, &(struct timespec){.tv_nsec = 400000000}, NULL); /* the stall itself */
    assert_int_equal(kill(head.pid, SIGCONT), 0);
    follow(&a, sh);
    assert_int_equal(a.missing, 0);
    assert_int_equal(a.broken_lines, 0);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    check_balance(&a, wire);
    assert_true(stats_uint(wire, "late_max_us") >= 300000); /* the statistics show the stall */
    /* 400 ms without a tick: more than 100 of the 400 are late by 2^28 ns or more, which is 268 ms */
    assert_in_range(late_ticks(wire, UINT64_C(1) << 28), 100, late_ticks(wire, 0) - 1);
    assert_true(stats_uint(wire, "late_p50_us") <= stats_uint(wire, "late_p99_us") &&
                stats_uint(wire, "late_p99_us") <= stats_uint(wire, "late_p999_us"));
}

/* A run that ends with its scan still announces the scan's end, however late it is. */
static void test_end_of_an_overloaded_run(void **state)
{
    struct wire *wire = *state;
    struct room_config config = CONFIG;
    struct scanhead_frame frame;
    needles_write(wire);
    config.pan_stop_deg = 36;
    config.more = "loop: {ahead_ms: 2, late_ms: 1, queue_ms: 10000}\n"; /* nearly every block comes too late */
    const char *const more[] = {"--start", "--frames", "1", "--threads", "2", NULL};
    struct head head = head_start(wire, room_config_write(wire, &config), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    uint64_t lost = frame.event_value[2];
    scanhead_close(sh);
    head_end(&head, 0);
    struct oracle oracle = oracle_of(&config, -40, 60, 100);
    check_sums(wire, &oracle, 1);
    assert_int_equal(lost, stats_uint(wire, "lost_pulses"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_overload_recorded, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_overload_two_casters, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_stall, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_stall_with_patience, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_end_of_an_overloaded_run, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
