/* SPDX-License-Identifier: MIT */
/* Readers that come late and streams that lost bytes. All that a reader needs comes again, and only the damaged frames
 * are missing. */
#include "tests/wire/room.h"

#include "drivers/protocol/native.h"

static const struct room_config ENDLESS = {.prr_hz = 200000,
                                           .lines_hz = 100,
                                           .pan_deg_s = 20,
                                           .pan_stop_deg = 360,
                                           .frames = 0,
                                           .links = LINK_YAML_BOTH,
                                           .more = "loop: {queue_ms: 10000, late_ms: 10000}\n"};

/* From the first frame on nothing is missing. Descriptor, anchor and names come within a second of device time (and the
 * tick that the repetition falls in). Points can be had from then on. */
static void follow(struct scanhead *sh)
{
    struct scanhead_frame frame;
    struct scanhead_info info;
    struct scanhead_point point;
    const char *object, *material;
    int64_t first_ns = 0;
    uint32_t next_seq = 0;
    int named = 0, after = 0;
    for (int n = 0; after < 200; n++) {
        client_next(sh, &frame);
        if (n == 0) first_ns = frame.t_ns;
        if (n != 0) assert_int_equal(frame.seq, next_seq);
        next_seq = frame.seq + 1;
        int ready = scanhead_get_info(sh, &info) == SCANHEAD_OK;
        named |= scanhead_surface(sh, 0, &object, &material);
        if (!ready || !named) assert_true(frame.t_ns - first_ns <= 1001000000);
        if (frame.type != SCANHEAD_POINTS) continue;
        assert_int_equal(scanhead_points(sh, &frame, 0, &point, 1), ready ? 1 : SCANHEAD_ESTATE);
        after += ready && named;
    }
    assert_true(info.prr_hz == 200000.0 && info.scan == 1 && info.n_surfaces == 6);
    assert_memory_equal(info.station_m, STATION, sizeof STATION);
    assert_true(scanhead_surface(sh, 5, &object, &material));
    assert_string_equal(object, "ceiling");
}

static void test_late_reader(void **state)
{
    struct wire *wire = *state;
    struct scanhead_frame frame;
    room_write(wire);
    const char *const more[] = {"--start", NULL};
    struct head head = head_start(wire, room_config_write(wire, &ENDLESS), more);
    struct scanhead *tcp = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(tcp, "scanning");
    for (int n = 0; n < 200; n += frame.type == SCANHEAD_POINTS)
        client_next(tcp, &frame);
    struct scanhead *late = client_open(head_endpoint(&head, "tcp")), *pty = client_open(head_endpoint(&head, "pty"));
    follow(late);
    follow(pty);
    scanhead_close(late);
    scanhead_close(pty);
    scanhead_close(tcp);
    head_end(&head, SIGTERM);
}

/* ---- one byte lost, in a recording that the file link wrote */

enum { MAX_FRAMES = 4000 };

struct recording {
    uint8_t *bytes;
    size_t len;
    int n_frames;
    size_t at[MAX_FRAMES + 1]; /* of each frame; the last entry is the end */
};

/* Finds where each frame of the file link's recording begins. */
static void read_frames(const struct wire *wire, struct recording *r)
{
    r->bytes = (uint8_t *)wire_read(wire_path(wire, "stream.shs"), &r->len);
    for (size_t at = 0; at < r->len; r->n_frames++) { /* as PROTOCOL.md has it: the length is at 4 */
        assert_true(r->n_frames < MAX_FRAMES);
        assert_int_equal(r->bytes[at], NATIVE_SYNC);
        r->at[r->n_frames] = at;
        at += NATIVE_HEADER_LEN + (r->bytes[at + 4] | (size_t)r->bytes[at + 5] << 8 | (size_t)r->bytes[at + 6] << 16);
    }
    r->at[r->n_frames] = r->len;
    assert_true(r->n_frames > 0);
    assert_int_equal(r->bytes[8] | r->bytes[9] | r->bytes[10] | r->bytes[11], 0); /* from the very first frame on */
}

static void record(struct wire *wire, struct recording *r)
{
    struct room_config config = {.profile = "riegl-vz400i",
                                 .prr_hz = 100000,
                                 .lines_hz = 200,
                                 .pan_deg_s = 150,
                                 .pan_stop_deg = 60,
                                 .frames = 1,
                                 .links = "links: [{type: file, path: stream.shs}]\n"};
    room_write(wire);
    const char *const more[] = {"--start", "--frames", "1", "--pace", "fast", NULL};
    struct head head = head_start(wire, room_config_write(wire, &config), more);
    head_end(&head, 0);
    read_frames(wire, r);
}

/* Parses the frames first .. last - 1 without the byte at `lost`. Every other frame must come unchanged. There is one
 * exception: a frame whose last byte looks like a sync byte is whole again with the next one's first, and then the next
 * is missing. */
static void check_without(const struct recording *r, int first, int last, size_t lost)
{
    static struct native_parser parser;
    native_parser_init(&parser);
    size_t in = r->at[first], end = r->at[last];
    int next = first, missing = -1;
    while (in < end || !parser.finished) {
        size_t room;
        uint8_t *to = native_parser_room(&parser, &room);
        size_t upto = in <= lost ? lost : end, n = upto - in < room ? upto - in : room;
        memcpy(to, r->bytes + in, n);
        in += n;
        if (in == lost) in++;
        native_parser_added(&parser, n);
        if (in >= end) native_parser_finish(&parser);
        for (enum native_item item; (item = native_parser_next(&parser)) != NATIVE_MORE; next++) {
            assert_int_equal(item, NATIVE_FRAME);
            size_t len = NATIVE_HEADER_LEN + parser.header.length;
            if (len != r->at[next + 1] - r->at[next] || memcmp(parser.frame, r->bytes + r->at[next], len) != 0) {
                assert_int_equal(missing, -1);
                missing = next++;
                assert_int_equal(len, r->at[next + 1] - r->at[next]);
                assert_memory_equal(parser.frame, r->bytes + r->at[next], len);
            }
        }
    }
    if (next == last - 1) missing = next++;
    assert_int_equal(next, last);
    assert_true(missing >= 0);
    int hit = lost >= r->at[missing] && lost < r->at[missing + 1];
    assert_true(hit || (lost == r->at[missing] - 1 && r->bytes[lost] == NATIVE_SYNC));
}

static void test_lost_byte(void **state)
{
    struct recording r = {0};
    record(*state, &r);
    assert_true(r.n_frames > 200);
    uint64_t x = 88172645463325252u; /* xorshift64, a fixed seed */
    for (int i = 0; i < 200; i++) {
        x ^= x << 13, x ^= x >> 7, x ^= x << 17;
        check_without(&r, 0, r.n_frames, x % r.len);
    }
    for (int i = 0; i < r.n_frames; i++) /* every byte of every header, among the frames around it */
        for (size_t k = 0; k < NATIVE_HEADER_LEN; k++)
            check_without(&r, i > 2 ? i - 2 : 0, i + 3 < r.n_frames ? i + 3 : r.n_frames, r.at[i] + k);
    free(r.bytes);
}

/* The same file goes through the library. The recording of the file link is the sent stream, and has its hash. */
static void test_recording_is_whole(void **state)
{
    struct wire *wire = *state;
    struct recording r = {0};
    struct scanhead_frame frame;
    char head[65], client[65];
    record(wire, &r);
    struct scanhead *sh = client_open(wire_path(wire, "stream.shs"));
    scanhead_hash_start(sh);
    int n = 0;
    uint64_t pulses = 0;
    for (; scanhead_next(sh, &frame, 0) == SCANHEAD_OK; n++) {
        pulses += frame.type == SCANHEAD_POINTS ? frame.n_pulses : 0;
        /* only what describes the stream comes again */
        if (frame.type == SCANHEAD_POINTS || frame.type == SCANHEAD_TELEMETRY || frame.type == SCANHEAD_EVENT ||
            frame.type == SCANHEAD_LINE_END)
            assert_int_equal(frame.flags & SCANHEAD_REPEAT, 0);
    }
    scanhead_hash_hex(sh, client);
    scanhead_close(sh);
    stats_hash(wire, head);
    assert_string_equal(client, head);
    assert_int_equal(n, r.n_frames);
    assert_int_equal(pulses, stats_uint(wire, "pulses"));
    free(r.bytes);
}

/* ---- the time of day, for a reader that joins in the middle of a scan */

/* Reads the stream from frame `first` on. With the first points that can be placed the time is known, too. Returns how
 * many points frames came. */
static int check_time(const struct wire *wire, const struct recording *r, int first, int64_t gps_of_t0_ns)
{
    size_t at = r->at[first];
    struct scanhead *sh = client_open(wire_write(wire, "late.shs", r->bytes + at, r->len - at));
    struct scanhead_frame frame;
    struct scanhead_info info;
    int n = 0;
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        double adjusted_s;
        if (frame.type != SCANHEAD_POINTS || scanhead_get_info(sh, &info) != SCANHEAD_OK) continue;
        n++;
        if (scanhead_gps_time(sh, 0, &adjusted_s) != SCANHEAD_OK)
            fail_msg("from frame %d on: points at %.3f s, and no time yet", first, 1e-9 * (double)frame.scan_t0_ns);
        /* a double of 5e8 has steps of 2^-24 s */
        assert_true(fabs(adjusted_s - ((double)(gps_of_t0_ns / 1000000000 - 1000000000) +
                                       1e-9 * (double)(gps_of_t0_ns % 1000000000))) < 2e-7);
    }
    scanhead_close(sh);
    return n;
}

static void expect_time_in_files(struct wire *wire, int64_t gps_of_t0_ns)
{
    char shs[352], las[352], ply[352], line[96];
    snprintf(shs, sizeof shs, "%s", wire_path(wire, "late.shs"));
    snprintf(las, sizeof las, "%s", wire_path(wire, "late.las"));
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "late.ply"));
    const char *const args[] = {"record", shs, "-o", las, "-o", ply, "--quiet", NULL};
    wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)); /* 1 if frames at the cut are taken as lost */
    char *text = wire_read(las, NULL);
    assert_int_equal(text[6] & 1, 1); /* adjusted standard GPS time, LAS 1.4 R15 table 4 */
    free(text);
    const int64_t week_ns = INT64_C(604800) * 1000000000;
    int64_t of_week_us = gps_of_t0_ns % week_ns / 1000;
    snprintf(line, sizeof line, "\ncomment the first scan starts at GPS week %lld second %lld.%06lld\n",
             (long long)(gps_of_t0_ns / week_ns), (long long)(of_week_us / 1000000), (long long)(of_week_us % 1000000));
    text = wire_read(ply, NULL);
    if (strstr(text, line) == NULL) fail_msg("no '%s' in: %.600s", line, text);
    free(text);
}

static void test_time_of_late_reader(void **state)
{
    struct wire *wire = *state;
    struct recording r = {0};
    struct room_config config = ENDLESS;
    struct scanhead_frame frame;
    config.prr_hz = 20000;
    config.lines_hz = 50;
    config.links = "links: [{type: file, path: stream.shs}]\n";
    config.more = "time: {epoch: \"2026-01-01T00:00:00Z\"}\n";
    room_write(wire);
    const char *const more[] = {"--start", "--duration", "3.5", "--pace", "fast", NULL};
    struct head head = head_start(wire, room_config_write(wire, &config), more);
    head_end(&head, 0);
    read_frames(wire, &r);
    struct scanhead *sh = client_open(wire_path(wire, "stream.shs"));
    client_until(sh, SCANHEAD_EV_SCAN_START, &frame);
    int64_t gps_of_t0_ns = (int64_t)frame.event_value[2];
    scanhead_close(sh);
    for (int first = 0; first < r.n_frames; first += r.n_frames / 60)
        check_time(wire, &r, first, gps_of_t0_ns);
    assert_true(check_time(wire, &r, r.n_frames / 3, gps_of_t0_ns) > 100);
    expect_time_in_files(wire, gps_of_t0_ns);
    free(r.bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_late_reader, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_lost_byte, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_time_of_late_reader, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_recording_is_whole, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
