/* SPDX-License-Identifier: MIT */
/* Parts of recordings, several in one file, and the same one again and again. */
#include "tests/wire/replay_rig.h"

#include "drivers/protocol/native_encode.h"

enum { LINES = 30 }; /* scans of 300 ms, 3000 pulses of 100 us; they begin after the head's boot, at 0.23 s or so */
static const int64_t PACKET_NS = 1600000; /* 16 pulses go out together */

static char file[352];

static void record(struct wire *wire, const char *name)
{
    snprintf(file, sizeof file, "%s", replay_room(wire, name, LINES));
}

/* Returns the pulses of a file, and the device times of the first and the last one. The file must be without errors. */
static uint64_t pulses_of(const char *path, int64_t *first_ns, int64_t *last_ns, uint64_t restarts)
{
    struct scanhead *sh = client_open(path);
    struct scanhead_frame frame;
    struct scanhead_point point[256];
    struct scanhead_stats stats;
    uint64_t n = 0;
    while (scanhead_next(sh, &frame, DEADLINE_MS) == SCANHEAD_OK) {
        if (frame.type != SCANHEAD_POINTS) continue;
        const int got = scanhead_points(sh, &frame, 0, point, 256);
        if (got <= 0) fail_msg("points can't be read: %s", scanhead_error(sh));
        const int64_t t0_ns = frame.t_ns - frame.scan_t0_ns;
        if (n == 0) *first_ns = t0_ns + point[0].t_ns;
        *last_ns = t0_ns + point[got - 1].t_ns;
        n += frame.n_pulses;
    }
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.restarts, restarts);
    assert_int_equal(stats.seq_lost + stats.repeated + stats.late + stats.bad_bytes, 0);
    scanhead_close(sh);
    return n;
}

/* A part of a recording begins with what a reader needs. Then come the points of that time. */
static void test_from_and_to(void **state)
{
    struct wire *wire = *state;
    static const struct {
        const char *from, *to;
        int64_t from_ns, to_ns;
    } ranges[] = {{"0.3", "0.4", 300000000, 400000000}, {"0.37777", "0.41", 377770000, 410000000}};
    int64_t first_ns, last_ns;
    record(wire, "head.shs");
    const uint64_t all = pulses_of(file, &first_ns, &last_ns, 0);
    const int64_t begin_ns = first_ns, end_ns = last_ns;
    assert_int_equal(all, 3000);
    for (size_t i = 0; i < sizeof ranges / sizeof *ranges; i++) {
        const char *const more[] = {"--from", ranges[i].from, "--to", ranges[i].to, NULL};
        const int64_t from_ns = ranges[i].from_ns, to_ns = ranges[i].to_ns;
        replay_to_file(wire, file, more, "part.shs");
        const uint64_t n = pulses_of(wire_path(wire, "part.shs"), &first_ns, &last_ns, 0);
        /* The time that counts is the one of sending: that of the packet's last pulse, or later. */
        assert_in_range(first_ns, from_ns - PACKET_NS, from_ns + PACKET_NS);
        assert_in_range(last_ns, to_ns - 2 * PACKET_NS, to_ns);
        assert_int_equal(n, (last_ns - first_ns) / 100000 + 1);
    }
    const char *const from[] = {"--from", "0.35", NULL}, *const to[] = {"--to", "0.35", NULL};
    replay_to_file(wire, file, from, "part.shs");
    const uint64_t late = pulses_of(wire_path(wire, "part.shs"), &first_ns, &last_ns, 0);
    assert_int_equal(last_ns, end_ns);
    replay_to_file(wire, file, to, "part.shs");
    assert_int_equal(pulses_of(wire_path(wire, "part.shs"), &first_ns, &last_ns, 0) + late, all);
    assert_int_equal(first_ns, begin_ns);
}

/* ---- again and again */

/* Collects the frames of repetition `time` from 0, in the order of the tape. A repetition begins where numbers go
 * back. */
static void of_time(const struct tape *all, int time, struct tape *out)
{
    *out = (struct tape){.bytes = all->bytes, .frame = calloc(all->n, sizeof *out->frame)};
    int t = 0;
    for (uint32_t i = 0; i < all->n; i++) {
        t += i > 0 && (int32_t)(all->frame[i].seq - all->frame[i - 1].seq) < 0;
        if (t == time) out->frame[out->n++] = all->frame[i];
    }
}

/* Frames are the same but for their numbers, and the header's checksum, which depends on them. */
static void same_but_numbers(const struct tape *a, const struct tape *b)
{
    assert_int_equal(a->n, b->n);
    for (uint32_t i = 0; i < a->n; i++) {
        const struct tape_frame *p = &a->frame[i], *q = &b->frame[i];
        assert_int_equal(p->len, q->len);
        assert_int_equal(p->seq - a->frame[0].seq, q->seq - b->frame[0].seq);
        assert_int_equal(p->tick - a->frame[0].tick, q->tick - b->frame[0].tick);
        assert_memory_equal(a->bytes + p->at, b->bytes + q->at, 8);
        assert_memory_equal(a->bytes + p->at + 12, b->bytes + q->at + 12, 12);
        assert_memory_equal(a->bytes + p->at + 28, b->bytes + q->at + 28, p->len - 28);
    }
}

/* The recording plays three times, tick by tick, each as the first time. Numbers go back by 2^30 from where they
 * were. */
static void three_times(struct wire *wire, const char *path, const char *const *more, int n_ticks)
{
    static const struct tape_line start[] = {{0, "SCAN:STARt"}, {0, NULL}};
    const char *args[WIRE_MAX_ARGS] = {"--link", "type: tcp, port: 0", "--loop"};
    struct tape all = {0}, first, second;
    for (int i = 3; more != NULL && *more != NULL; i++)
        args[i] = *more++;
    tape_step(wire, path, args, start, 3 * n_ticks + 20, &all);
    tape_keep_common(&all);
    of_time(&all, 0, &first);
    assert_true(first.n > 10);
    for (int time = 1; time < 3; time++) {
        of_time(&all, time, &second);
        same_but_numbers(&first, &second);
        assert_int_equal(second.frame[0].seq, first.frame[first.n - 1].seq + (uint32_t)(time - 1) * first.n + 1 -
                                                  (uint32_t)time * (UINT32_C(1) << 30));
        free(second.frame);
    }
    of_time(&all, 3, &second); /* it has begun */
    assert_true(second.n > 0);
    free(second.frame);
    free(first.frame);
    tape_free(&all);
}

static void test_loop(void **state)
{
    static const char *const part[] = {"--from", "0.4", "--to", "0.45", NULL};
    record(*state, "head.shs");
    three_times(*state, file, NULL, 545);
    three_times(*state, file, part, 52);
}

/* A recording that begins within a scan, as that of a reader who joined: it has frames for that reader alone. */
static void test_begun_within_a_scan(void **state)
{
    struct wire *wire = *state;
    struct tape all = {0};
    record(wire, "head.shs");
    tape_read(file, &all);
    const char *path = wire_path(wire, "joined.shs");
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    for (uint32_t i = 0; i < all.n; i++) {
        struct tape_frame *frame = &all.frame[i];
        uint8_t *bytes = all.bytes + frame->at;
        const int is_front = frame->type == SCANHEAD_DESCRIPTOR || frame->type == SCANHEAD_ANCHOR;
        if (i < 100 && !is_front) continue;
        if (i < 100) {
            bytes[3] |= SCANHEAD_REPEAT | SCANHEAD_LOCAL;
            native_finish_frame(bytes, 0);
        }
        assert_int_equal(fwrite(bytes, 1, frame->len, f), frame->len);
    }
    assert_int_equal(fclose(f), 0);
    static const char *const part[] = {"--from", "0.05", "--to", "0.1", NULL};
    snprintf(file, sizeof file, "%s", path);
    three_times(wire, file, NULL, (int)((all.frame[all.n - 1].t_ns - all.frame[100].t_ns) / 1000000) + 4);
    three_times(wire, file, part, 52);
    tape_free(&all);
}

/* A client reads it three times: there are two restarts, and nothing is missing. */
static void test_twice(void **state)
{
    static const char *const more[] = {"--link", "type: tcp, port: 0", "--pace", "fast", "--quiet", NULL};
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    record(*state, "head.shs");
    struct head head = head_start(*state, file, more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    for (uint64_t time = 0; time < 3; time++) {
        client_tell(sh, "SCAN:STARt");
        client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
        client_wait_state(sh, "idle");
        scanhead_get_stats(sh, &stats);
        assert_int_equal(stats.restarts, time);
        assert_int_equal(stats.seq_lost + stats.repeated + stats.late + stats.bad_bytes + stats.reader_lost, 0);
    }
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* ---- several in one file */

/* Three scans of a head that was commanded are in one file. */
static void test_several_scans(void **state)
{
    struct wire *wire = *state;
    static const struct room_config config = {.profile = "any-rate",
                                              .prr_hz = 100000,
                                              .lines_hz = 97.7,
                                              .pan_deg_s = 150,
                                              .pan_stop_deg = 15,
                                              .frames = 1,
                                              .links = LINK_YAML_TCP};
    static const struct tape_line lines[] = {
        {300, "SCAN:STARt"}, {700, "HEAD:PRR 200000"}, {701, "SCAN:STARt"}, {1100, "SCAN:STARt"}, {0, NULL}};
    struct tape tape = {0};
    room_write(wire);
    tape_step(wire, room_config_write(wire, &config), NULL, lines, 1500, &tape);
    tape_keep_common(&tape);
    snprintf(file, sizeof file, "%s", tape_write(wire, "scans.shs", &tape));
    tape_free(&tape);
    replay_to_file(wire, file, NULL, "out.shs");
    replay_same_file(wire, "out.shs", "scans.shs");
    assert_int_equal(stats_uint(wire, "scans"), 3);
}

/* All stations come one after the other into one file, as record writes it. */
static void test_several_stations(void **state)
{
    struct wire *wire = *state;
    static const struct room_config config = {
        .prr_hz = 10000, .lines_hz = 100, .pan_deg_s = 10, .pan_stop_deg = 1, .frames = 1, .links = "links: []\n"};
    room_write(wire);
    char path[352];
    snprintf(path, sizeof path, "%s", room_config_write(wire, &config));
    char *text = wire_read(path, NULL), *at = strstr(text, "noise:");
    assert_non_null(at);
    FILE *f = fopen(path, "w");
    fprintf(f, "%.*s  - {position_m: [1.1, 1.2, 0.3], heading_deg: 10}\n%s", (int)(at - text), text, at);
    assert_int_equal(fclose(f), 0);
    free(text);
    snprintf(file, sizeof file, "%s", wire_path(wire, "stations.shs"));
    const char *const args[] = {"record", path, "-o", file, "--station", "all", "--quiet", NULL};
    assert_int_equal(replay_call(wire, args), 0);
    replay_to_file(wire, file, NULL, "out.shs");
    replay_same_file(wire, "out.shs", "stations.shs");
    /* The answers to commands follow the stream. */
    static const char *const more[] = {"--link", "type: tcp, port: 0", "--pace", "fast", "--quiet", NULL};
    struct head head = head_start(wire, file, more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    assert_string_equal(client_ask(sh, "HEAD:STATION?"), "1");
    client_tell(sh, "SCAN:STARt");
    for (int i = 0; i < 2; i++)
        client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    client_wait_state(sh, "idle");
    assert_string_equal(client_ask(sh, "HEAD:STATION?"), "2");
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* Two recordings of different heads come one after the other. The second one's time goes on at once. */
static void test_concatenated(void **state)
{
    struct wire *wire = *state;
    static const struct tape_line start[] = {{0, "SCAN:STARt"}, {0, NULL}};
    static const char *const link[] = {"--link", "type: tcp, port: 0", NULL};
    struct tape a = {0}, b = {0}, both = {0};
    record(wire, "a.shs");
    tape_read(file, &a);
    tape_read(replay_room(wire, "b.shs", 7), &b);
    uint32_t from = 0; /* the common beginning of both would be taken for a repetition */
    while (b.frame[from].type != SCANHEAD_DESCRIPTOR)
        from++;
    const size_t at = b.frame[from].at;
    char *bytes = malloc(a.len + b.len);
    memcpy(bytes, a.bytes, a.len);
    memcpy(bytes + a.len, b.bytes + at, b.len - at);
    snprintf(file, sizeof file, "%s", wire_write(wire, "both.shs", bytes, a.len + b.len - at));
    free(bytes);
    replay_to_file(wire, file, NULL, "out.shs");
    replay_same_file(wire, "out.shs", "both.shs");
    tape_step(wire, file, link, start, 900, &both);
    tape_keep_common(&both);
    assert_int_equal(both.n, a.n + b.n - from);
    /* b begins with the tick after the last one of a, and lasts as long as it did. */
    const struct tape_frame *last_a = &both.frame[a.n - 1], *first_b = last_a + 1, *last_b = &both.frame[both.n - 1];
    const int lasts_ms = (int)((b.frame[b.n - 1].t_ns - b.frame[from].t_ns) / 1000000);
    assert_int_equal(first_b->tick, last_a->tick + 1);
    assert_in_range(last_b->tick - first_b->tick, lasts_ms, lasts_ms + 2);
    tape_free(&a);
    tape_free(&b);
    tape_free(&both);
}

/* ---- how long it lasts */

static void test_duration(void **state)
{
    struct wire *wire = *state;
    static const char *const duration[] = {"--duration", "0.3", NULL};
    static const char *const loop[] = {"--loop", "--duration", "2", NULL};
    int64_t first_ns, last_ns;
    record(wire, "head.shs");
    replay_to_file(wire, file, duration, "out.shs");
    pulses_of(wire_path(wire, "out.shs"), &first_ns, &last_ns, 0);
    assert_in_range(last_ns, 300000000 - 2 * PACKET_NS, 300000000);
    /* The recording lasts 0.53 s, and begins anew with the next tick: three whole times, and a fourth. */
    replay_to_file(wire, file, loop, "out.shs");
    assert_in_range(pulses_of(wire_path(wire, "out.shs"), &first_ns, &last_ns, 3), 3 * 3000 + 1000, 4 * 3000);
}

/* The replay begins with the second client, for both from the first frame on, and ends by itself. */
static void test_waits_for_clients(void **state)
{
    static const char *const more[] = {
        "--link", "type: tcp, port: 0", "--start", "--clients", "2", "--pace", "fast", "--quiet", NULL};
    struct scanhead *sh[2];
    struct scanhead_frame frame;
    struct tape all = {0};
    int rc;
    record(*state, "head.shs");
    tape_read(file, &all);
    struct head head = head_start(*state, file, more);
    sh[0] = client_open(head_endpoint(&head, "tcp"));
    assert_string_equal(client_ask(sh[0], "HEAD:STATe?"), "idle");
    while ((rc = scanhead_next(sh[0], &frame, 50)) == SCANHEAD_OK)
        assert_true((frame.flags & SCANHEAD_LOCAL) != 0); /* clients that join are told this */
    assert_int_equal(rc, SCANHEAD_ETIMEOUT);
    sh[1] = client_open(head_endpoint(&head, "tcp"));
    for (int i = 0; i < 2; i++) {
        struct tape heard = {0};
        while ((rc = scanhead_next(sh[i], &frame, DEADLINE_MS)) == SCANHEAD_OK)
            tape_add(&heard, &frame, 0);
        assert_int_equal(rc, SCANHEAD_ECLOSED);
        tape_keep_common(&heard);
        tape_same_bytes(&heard, &all);
        tape_free(&heard);
        scanhead_close(sh[i]);
    }
    head_end(&head, 0);
    tape_free(&all);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_from_and_to, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_loop, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_begun_within_a_scan, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_twice, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_several_scans, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_several_stations, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_concatenated, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_waits_for_clients, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_duration, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
