/* SPDX-License-Identifier: MIT */
/* These tests give damaged frames to the dissector in Wireshark. It marks them, and reads a damaged stream as
 * libscanhead does, in one pass and in two. */
#include "tests/wire/wireshark_rig.h"

#include "drivers/protocol/native.h"
#include "firmware_sim/command/head.h"

enum { N_HURT = 1000, N_ROUNDS = 3 };

/* Damages one frame in some way, so that it differs from any whole frame. Returns the new length. */
static size_t hurt(uint8_t *frame, size_t len, uint64_t *random)
{
    const uint32_t kind = capture_random(random, 5), at = capture_random(random, (uint32_t)len);
    const uint32_t n = 1 + capture_random(random, 20);
    if (kind == 0) frame[at] ^= (uint8_t)(1u << capture_random(random, 8));
    if (kind == 1)
        for (uint32_t i = at; i < at + n && i < len; i++)
            frame[i] ^= (uint8_t)(1 + capture_random(random, 255));
    if (kind == 2) return 1 + capture_random(random, (uint32_t)len - 1); /* the rest is missing */
    if (kind == 3 && n < len) {                                          /* a part is missing */
        const size_t from = capture_random(random, (uint32_t)(len - n));
        memmove(frame + from, frame + from + n, len - n - from);
        return len - n;
    }
    if (kind < 3) return len;
    memmove(frame + at + n, frame + at, len - at); /* bytes have come in, also where n did not fit */
    for (uint32_t i = at; i < at + n; i++)
        frame[i] = (uint8_t)capture_random(random, 256);
    return len + n;
}

/* Writes 1,000 frames of all types, each damaged, in packets of their own. */
static void put_hurt(struct capture *c, uint32_t interface)
{
    static uint8_t copy[NATIVE_MAX_FRAME + 32];
    uint64_t random = 19;
    char *bytes[2];
    size_t len[2], at[2] = {0, 0};
    for (int i = 0; i < 2; i++)
        bytes[i] = wire_read(wire_path(wire, i == 0 ? "polar.shs" : "samples.shs"), &len[i]);
    for (int i = 0; i < N_HURT; i++) {
        const int of = i % 2;
        const uint8_t *frame = (uint8_t *)bytes[of] + at[of];
        const size_t n = native_frame_len(frame);
        memcpy(copy, frame, n);
        at[of] += n;
        if (at[of] == len[of]) at[of] = 0;
        capture_packet(c, interface, copy, hurt(copy, n, &random));
    }
    free(bytes[0]);
    free(bytes[1]);
}

/* Writes one frame, damaged or not. Returns how many bytes there are. older: a frame that may come again before it. */
static size_t put_one(uint8_t *out, const uint8_t *frame, const uint8_t *older, int what, uint64_t *random)
{
    size_t to = 0;
    if (what == 0) return 0;
    if (what == 2) { /* an older one once more */
        memcpy(out, older, native_frame_len(older));
        to += native_frame_len(older);
    }
    for (int g = 0; what == 4 && g < 40; g++)
        out[to++] = (uint8_t)capture_random(random, 256);
    memcpy(out + to, frame, native_frame_len(frame));
    return to + (what == 1 ? hurt(out + to, native_frame_len(frame), random) : native_frame_len(frame));
}

static void set_round(uint8_t *frame, int round)
{
    frame[18] ^= (uint8_t)(round << 4); /* 0.8 ms and more */
    seal_frame(frame);
}

/* Takes the 1 to 3 frames after a frame of n bytes, but none beyond end. The last of them is to be sent first. The
 * others lie after the n bytes, and *between is their length. Returns where the last one begins. */
static size_t take_ahead(uint8_t *frame, size_t n, const uint8_t *end, int round, uint64_t *random, size_t *between)
{
    size_t last = n;
    for (uint32_t k = capture_random(random, 3); k > 0 && frame + last + native_frame_len(frame + last) < end; k--) {
        set_round(frame + last, round);
        last += native_frame_len(frame + last);
    }
    set_round(frame + last, round);
    *between = last - n;
    return last;
}

/* Writes the recordings one after the other, N_ROUNDS times with other device times. Each frame may be dropped or
 * damaged, or come after an older one, after garbage, or after one of the next three. The last 30 are whole, so that
 * nothing waits for bytes that never come. */
static size_t put_damage(uint8_t *out)
{
    uint64_t random = 4;
    size_t to = 0, len;
    for (int i = 0; i < N_ROUNDS * N_RECORDINGS; i++) {
        char *bytes = wire_read(wire_path(wire, stream_name[i % N_RECORDINGS]), &len);
        const uint8_t *older = (uint8_t *)bytes;
        for (size_t at = 0, n; at < len; at += n) {
            uint8_t *frame = (uint8_t *)bytes + at;
            const size_t own = native_frame_len(frame);
            size_t between = 0;
            n = own;
            set_round(frame, i / N_RECORDINGS);
            const int is_quiet = i + 1 == N_ROUNDS * N_RECORDINGS && at + 4000 > len;
            const int what = is_quiet ? 5 : (int)capture_random(&random, 24);
            if (what == 3 && at + n < len) { /* one of the next three first */
                n = take_ahead(frame, n, (uint8_t *)bytes + len, i / N_RECORDINGS, &random, &between);
                const size_t n_ahead = native_frame_len(frame + n);
                memcpy(out + to, frame + n, n_ahead);
                to += n_ahead;
                n += n_ahead;
            }
            to += put_one(out + to, frame, older, what, &random);
            memcpy(out + to, frame + own, between);
            to += between;
            if (capture_random(&random, 2) == 0) older = frame;
        }
        free(bytes);
    }
    return to;
}

static struct {
    size_t n[16], frames_missing;
} noticed;

static void keep_notice(void *ctx, const struct scanhead_notice *notice)
{
    (void)ctx;
    noticed.n[notice->kind]++;
    if (notice->kind == SCANHEAD_NOTICE_GAP) noticed.frames_missing += notice->n;
}

/* Takes the next header with a good checksum. Returns 1 where its payload is good, too. Other headers have no payload
 * status. */
static int take_good_header(size_t *n_bad_payloads)
{
    while (dissected_left(S "header_crc.status") > 0) {
        const int is_header = atoi(take_text(S "header_crc.status"));
        const int is_good = is_header && atoi(take_text(S "payload_crc.status"));
        if (is_good) return 1;
        *n_bad_payloads += (size_t)is_header;
        take_text(S "seq");
        take_text(S "type");
    }
    return 0;
}

/* The dissector finds the same frames of a damaged stream as libscanhead, in order. */
static void expect_frames(const char *name, size_t *n_bad)
{
    struct scanhead_frame frame;
    struct scanhead *sh = client_open(wire_path(wire, name));
    size_t n_dropped = 0, n = 0;
    memset(&noticed, 0, sizeof noticed);
    scanhead_on_notice(sh, keep_notice, NULL);
    for (; scanhead_next(sh, &frame, 0) == 0; n++) {
        const size_t dropped = noticed.n[SCANHEAD_NOTICE_REPEATED] + noticed.n[SCANHEAD_NOTICE_LATE];
        for (; n_dropped < dropped; n_dropped++) {
            assert_true(take_good_header(n_bad));
            take_text(S "seq");
            take_text(S "type");
        }
        assert_true(take_good_header(n_bad));
        expect_uint(S "seq", frame.seq);
        expect_int(S "type", frame.type);
    }
    scanhead_close(sh);
    assert_true(n > 100);
}

/* The notices are libscanhead's, too. The stream is there twice, on two carriers. */
static void expect_damaged(const char *name)
{
    size_t n_bad = 0, kinds[5] = {0}, missing = 0;
    expect_frames(name, &n_bad);
    expect_frames(name, &n_bad);
    while (dissected_left(S "seq.notice") > 0)
        kinds[atoi(take_text(S "seq.notice"))]++;
    while (dissected_left(S "seq.lost") > 0)
        missing += strtoull(take_text(S "seq.lost"), NULL, 10);
    for (int kind = SCANHEAD_NOTICE_GAP; kind <= SCANHEAD_NOTICE_RESTARTED; kind++) {
        assert_int_equal(kinds[kind], 2 * noticed.n[kind]);
        assert_true(kinds[kind] > 0);
    }
    assert_int_equal(missing, 2 * noticed.frames_missing);
    assert_int_equal(n_bad, 2 * noticed.n[SCANHEAD_NOTICE_BAD_PAYLOAD]);
    assert_true(n_bad > 3);
}

/* Frames with good checksums and wrong or unknown contents: the sample of a type, with one value or its length
 * changed. */
static const struct {
    uint8_t type;
    uint32_t at, n, value; /* changes n bytes of the payload; n is 4: value as a number; else each byte is value */
    int longer;            /* by so many bytes */
    const char *says;
} wrong[] = {
    {1, 128, 4, 2, 0, "layout 2, allowed 0 to 1"},
    {1, 252, 4, 65536, 0, "n_surfaces 65536, allowed 0 to 65535"},
    {1, 0, 0, 0, -200, "80 bytes, allowed 272 and more"},
    {1, 272, 4, 24, 0, "Reserved bits are set"}, /* attributes have deviations then */
    {9, 12, 4, 5, 0, "5 deviations, and room for 4"},
    {2, 0, 4, 4, 0, "crs 4, allowed 0 to 3"},
    {2, 20, 4, 0x7ff80000, 0, "x: not a finite number"},
    {3, 36, 4, 5, 0, "5 points, and room for 4"},
    {3, 32, 4, 2, 0, "3 pulses begin, and n_pulses is 2"},
    {5, 0, 0, 0, -30, "66 bytes, allowed 96 and more"},
    {6, 0, 4, 99, 0, "An event that version 1 does not have yet"},
    {6, 32, 96, 'A', 0, "text: a text without NUL"}, /* up to the packet's end */
    {6, 0, 0, 0, 4, "Longer than version 1 has it"},
    {7, 4, 4, 3, 0, "shorter than its names"},
    {7, 27, 1, 4, 0, "shorter than its names"}, /* the last one, of 3 bytes */
    {8, 0, 4, 1, 0, "1 poses, allowed 2 to 2"},
    {8, 44, 4, 0x40000000, 0, "a quaternion that is not of length one"},
    {10, 24, 4, 0, 0, "turn 0, allowed 1 and -1"},
    {10, 4, 4, 4, 0, "4 beams, and room for 3"},
    {11, 12, 4, 5, 0, "5 points, and room for 4"},
    {12, 12, 4, 4, 0, "a window of 0 samples, allowed 1 to 4096"},
    {12, 24, 4, 0, 0, "a count without signal"},
    {12, 24, 4, 0x7fc00000, 0, "count_signal: not a finite number"},
    {12, 22, 1, 15, 0, "bits 15, allowed 8 to 14"},
    {12, 120, 1, 7, 0, "shorter than its windows"}, /* samples of the last window, of 6 */
};
enum { N_WRONG = sizeof wrong / sizeof wrong[0] };

static void put_wrong(struct capture *c, uint32_t interface)
{
    size_t len;
    char *bytes = wire_read(wire_path(wire, "samples.shs"), &len);
    for (int i = 0; i < N_WRONG; i++) {
        uint8_t copy[NATIVE_HEADER_LEN + 512] = {0}, *frame = (uint8_t *)bytes;
        while (frame[1] != wrong[i].type)
            frame += native_frame_len(frame);
        memcpy(copy, frame, native_frame_len(frame));
        le_put32(copy + 4, le_get32(copy + 4) + (uint32_t)wrong[i].longer);
        if (wrong[i].n == 4)
            le_put32(copy + NATIVE_HEADER_LEN + wrong[i].at, wrong[i].value);
        else
            memset(copy + NATIVE_HEADER_LEN + wrong[i].at, (int)wrong[i].value, wrong[i].n);
        seal_frame(copy);
        capture_packet(c, interface, copy, native_frame_len(copy));
    }
    free(bytes);
}

static void test_hurt(void **state)
{
    (void)state;
    static const char *const marks[] = {"_ws.expert.severity", "_ws.expert.message", NULL};
    struct capture c = {0};
    int n_packets = 0, n_marked = 0;
    char error[16];
    capture_begin(&c);
    const uint32_t interface = capture_interface(&c, CAPTURE_USER0);
    put_hurt(&c, interface);
    put_wrong(&c, interface);
    wire_write(wire, "hurt.pcapng", c.bytes, c.len);
    free(c.bytes);
    dissect("hurt.pcapng", 1, marks);
    snprintf(error, sizeof error, "%d", EXPERT_ERROR);
    char *all = strdup(dissected_text()), *rest = all;
    for (char *line; (line = strsep(&rest, "\n")) != NULL && rest != NULL; n_packets++)
        if (n_packets < N_HURT)
            n_marked += strstr(line, error) != NULL;
        else if (strstr(line, wrong[n_packets - N_HURT].says) == NULL)
            fail_msg("%s: not said in %s", wrong[n_packets - N_HURT].says, line);
    free(all);
    assert_int_equal(n_packets, N_HURT + N_WRONG);
    assert_int_equal(n_marked, N_HURT);
}

static void test_damage(void **state)
{
    (void)state;
    static const char *const fields[] = {
        S "header_crc.status", S "payload_crc.status", S "seq",           S "type", S "seq.notice",
        S "seq.lost",          "_ws.expert.message",   S "point.range_m", NULL};
    static uint8_t damaged[1 << 20];
    struct capture c = {0};
    const size_t len = put_damage(damaged);
    wire_write(wire, "damaged.shs", damaged, len);
    capture_begin(&c);
    put_tcp(&c, capture_interface(&c, CAPTURE_ETHERNET), 0, damaged, len);
    put_usb(&c, capture_interface(&c, CAPTURE_USBMON), 1, damaged, len);
    wire_write(wire, "damaged.pcapng", c.bytes, c.len);
    free(c.bytes);
    dissect("damaged.pcapng", 1, fields);
    char *all = strdup(dissected_text());
    dissect("damaged.pcapng", 2, fields);
    assert_string_equal(dissected_text(), all);
    free(all);
    expect_damaged("damaged.shs");
}

/* Another head's points, or those after a power cut, are not placed by the descriptor and the anchor of before. */
static void test_restart(void **state)
{
    (void)state;
    static const char *const fields[] = {"_ws.expert.message", NULL};
    struct capture c = {0};
    size_t len;
    uint8_t *bytes = (uint8_t *)wire_read(wire_path(wire, "polar.shs"), &len), *points = NULL;
    capture_begin(&c);
    const uint32_t interface = capture_interface(&c, CAPTURE_USER0);
    for (uint8_t *at = bytes; at < bytes + len; at += native_frame_len(at)) {
        capture_packet(&c, interface, at, native_frame_len(at));
        if (at[1] == NATIVE_POINTS) points = at;
    }
    assert_non_null(points);
    le_put32(points + 8, le_get32(points + 8) - 100000); /* no frame of this recording has that number */
    seal_frame(points);
    capture_packet(&c, interface, points, native_frame_len(points));
    wire_write(wire, "restart.pcapng", c.bytes, c.len);
    free(c.bytes);
    free(bytes);
    dissect("restart.pcapng", 1, fields);
    const char *last = strstr(dissected_text(), "The sequence begins anew");
    assert_non_null(last);
    assert_non_null(strstr(last, "Points that nobody can place yet"));
}

/* After the first points come the scan's own SCAN_START once more, or late, and then points; or one with another start.
 * PROTOCOL.md: the anchor is void then. The pulses before the scan's own one count, so that none is missing. */
static void expect_after_start(int is_other)
{
    static const char *const fields[] = {S "missing_pulses", "_ws.expert.message", NULL};
    struct capture c = {0};
    size_t len;
    uint32_t seq = 0;
    uint8_t *bytes = (uint8_t *)wire_read(wire_path(wire, "polar.shs"), &len), *start = NULL, *at = bytes;
    capture_begin(&c);
    const uint32_t interface = capture_interface(&c, CAPTURE_USER0);
    for (int more = 2; at < bytes + len; at += native_frame_len(at)) {
        if (at[1] == NATIVE_EVENT && le_get32(at + NATIVE_HEADER_LEN) == NATIVE_EV_SCAN_START) start = at;
        if (at[1] == NATIVE_POINTS && --more == 0) {
            assert_non_null(start);
            start[NATIVE_HEADER_LEN + 18] ^= (uint8_t)is_other; /* 65536 ns earlier or later */
            le_put32(start + 8, seq++);
            memcpy(start + 16, at + 16, 8); /* its device time is later than that of the first points */
            seal_frame(start);
            capture_packet(&c, interface, start, native_frame_len(start));
        }
        le_put32(at + 8, seq++);
        seal_frame(at);
        capture_packet(&c, interface, at, native_frame_len(at));
    }
    wire_write(wire, "start.pcapng", c.bytes, c.len);
    free(c.bytes);
    free(bytes);
    dissect("start.pcapng", 1, fields);
    assert_int_equal(strstr(dissected_text(), "Points that nobody can place yet") != NULL, is_other);
    if (!is_other) assert_string_equal(take_text(S "missing_pulses"), "0");
}

static void test_the_same_number_again(void **state)
{
    (void)state;
    expect_after_start(0);
    expect_after_start(1);
}

/* The telemetry before the end of a scan has its final counts. If that one is missing, an earlier one does not stand
 * for it: here it is made one from within the scan, before 7 of the pulses. */
static void test_counts_that_are_not_final(void **state)
{
    (void)state;
    static const char *const fields[] = {S "missing_pulses", "_ws.expert.message", NULL};
    struct capture c = {0};
    size_t len, n = 0;
    uint8_t *bytes = (uint8_t *)wire_read(wire_path(wire, "polar.shs"), &len);
    capture_begin(&c);
    const uint32_t interface = capture_interface(&c, CAPTURE_USER0);
    for (uint8_t *at = bytes; at < bytes + len; at += native_frame_len(at)) {
        uint8_t *t = at + NATIVE_HEADER_LEN; /* state at 0; scan_fired and scan_cast at 72 and 80 */
        if (at[1] == NATIVE_TELEMETRY && le_get32(t) == HEAD_SPIN_DOWN) {
            le_put32(t, HEAD_SCANNING);
            for (int k = 72; k <= 80; k += 8)
                le_put32(t + k, le_get32(t + k) - 7);
            seal_frame(at);
            n++;
        }
        capture_packet(&c, interface, at, native_frame_len(at));
    }
    assert_true(n > 0);
    wire_write(wire, "counts.pcapng", c.bytes, c.len);
    free(c.bytes);
    free(bytes);
    dissect("counts.pcapng", 1, fields);
    assert_int_equal(dissected_count(S "missing_pulses"), 0);
    assert_null(strstr(dissected_text(), "telemetry: "));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_hurt), cmocka_unit_test(test_damage),
                                       cmocka_unit_test(test_restart), cmocka_unit_test(test_the_same_number_again),
                                       cmocka_unit_test(test_counts_that_are_not_final)};
    return cmocka_run_group_tests(tests, wireshark_setup, wire_teardown);
}
