/* SPDX-License-Identifier: MIT */
/* libscanhead: its counts, hash and refusals of a stream. */
#include <fcntl.h>
#include <nettle/sha2.h>

#include "tests/unit/host_rig.h"

static void test_stats(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_stats s;
    put_event(head, NATIVE_EV_READER_LOST, 5, 500, 5, NATIVE_LOCAL);
    put_event(head, NATIVE_EV_READER_LOST, 3, 300, 8, NATIVE_LOCAL);
    put_event(head, NATIVE_EV_OVERRUN, 1000, 20, 1, 0);
    struct native_event e = {.code = NATIVE_EV_OVERRUN, .b = 22};
    size_t len = native_encode_event(out, sizeof out, &e, 1, 0);
    native_finish_frame(out, 4); /* after 0: three are missing */
    put_all(head, out, len);
    out[30] ^= 1;
    put_all(head, out, len);
    close(head);
    for (int i = 0; i < 4; i++)
        expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_ECLOSED);
    scanhead_get_stats(sh, &s);
    assert_int_equal(s.bytes, 5 * 156);
    assert_int_equal(s.frames, 4);
    assert_int_equal(s.bad_payload, 1);
    assert_int_equal(s.bad_bytes, 156);
    assert_int_equal(s.seq_gaps, 1);
    assert_int_equal(s.seq_lost, 3);
    assert_int_equal(s.reader_lost, 8);
    assert_int_equal(s.pulses_lost, 42);
    scanhead_close(sh);
}

static void test_version_and_types(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct native_event e = {.code = 1};
    size_t len = native_encode_event(out, sizeof out, &e, 1, 0);
    out[2] = 2;
    native_finish_frame(out, 0);
    put_all(head, out, len);
    out[2] = 1;
    out[1] = 99; /* an unknown type of later times is passed on unchanged */
    native_finish_frame(out, 1);
    put_all(head, out, len);
    assert_int_equal(scanhead_next(sh, &f, WAIT_MS), SCANHEAD_EFORMAT);
    assert_non_null(strstr(scanhead_error(sh), "version 2"));
    expect_frame(sh, 99, &f);
    close(head);
    scanhead_close(sh);
}

/* The head starts again, or another recording follows. Until its descriptor and anchor have come, its points have no
 * place, and the clock that it had before does not count. */
static void test_restart(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_point point[3];
    double gps_s;
    struct line_block block = make_block(3, 200);
    for (int again = 0; again < 2; again++) {
        put_descriptor(head, 0, 1, again ? NATIVE_REPEAT : 0);
        expect_frame(sh, SCANHEAD_DESCRIPTOR, &f);
        put_anchor(head, again ? NATIVE_REPEAT : 0);
        expect_frame(sh, SCANHEAD_ANCHOR, &f);
        put_event(head, NATIVE_EV_TIME, 0, 1, 1000000000, 0);
        expect_frame(sh, SCANHEAD_EVENT, &f);
        put_points(head, 3, 100);
        expect_frame(sh, SCANHEAD_POINTS, &f);
        assert_int_equal(scanhead_points(sh, &f, 0, point, 3), 3);
        assert_int_equal(scanhead_gps_time(sh, 0, &gps_s), 0);
        const size_t len = native_encode_points(out, sizeof out, &block, 500);
        native_finish_frame(out, 0);
        put_all(head, out, len);
        expect_frame(sh, SCANHEAD_POINTS, &f);
        assert_int_equal(scanhead_points(sh, &f, 0, point, 3), SCANHEAD_ESTATE);
        assert_int_equal(scanhead_gps_time(sh, 0, &gps_s), SCANHEAD_ESTATE);
        block.pulse0++; /* the same frame again would count as repeated */
    }
    close(head);
    scanhead_close(sh);
}

/* Puts descriptor, anchor, clock and points, numbers 0 to 3; the first `leave_out` of them are not there. */
static void put_sequence(int fd, int leave_out, uint64_t pulse0)
{
    rig_begin_sequence();
    for (int i = 0; i < leave_out; i++)
        rig_next_seq();
    if (leave_out <= 0) put_descriptor(fd, 0, 1, 0);
    if (leave_out <= 1) put_anchor(fd, 0);
    if (leave_out <= 2) put_event(fd, NATIVE_EV_TIME, 0, 1, 1000000000, 0);
    put_points(fd, 3, pulse0);
}

/* Reads frames until the recording ends, and returns how many of its points have a place. The last points must have a
 * time of the head's clock where `has_clock` says so. */
static int count_places(struct scanhead *sh, int has_clock)
{
    struct scanhead_frame f;
    struct scanhead_point point[3];
    double gps_s;
    int n = 0, rc;
    while ((rc = scanhead_next(sh, &f, WAIT_MS)) == 0)
        if (f.type == SCANHEAD_POINTS) n += scanhead_points(sh, &f, 0, point, 3) == 3 ? 3 : 0;
    assert_int_equal(rc, SCANHEAD_ECLOSED);
    assert_int_equal(scanhead_gps_time(sh, 0, &gps_s), has_clock ? 0 : SCANHEAD_ESTATE);
    scanhead_close(sh);
    return n;
}

/* Two recordings are put together, and the second begins with frames of the first. These are dropped as repeated, and
 * hold for the second one, too. Where only the descriptor is the same, the points wait for their own anchor. */
static void test_alike(void **state)
{
    (void)state;
    for (uint64_t pulse0 = 50; pulse0 <= 150; pulse0 += 100) {
        const int fd = rig_write_recording();
        put_sequence(fd, 0, 100);
        put_sequence(fd, 0, pulse0);
        assert_int_equal(count_places(rig_read_recording(fd), 1), 6);
    }
    for (int has_anchor = 0; has_anchor <= 1; has_anchor++) {
        const int fd = rig_write_recording();
        put_sequence(fd, 0, 100);
        rig_begin_sequence();
        put_descriptor(fd, 0, 1, 0);
        if (has_anchor) put_event(fd, NATIVE_EV_TIME, 0, 1, 5, 0);
        if (has_anchor) put_anchor(fd, 0);
        put_points(fd, 3, 150);
        assert_int_equal(count_places(rig_read_recording(fd), has_anchor), has_anchor ? 6 : 3);
    }
}

/* A new sequence voids what the stream said before. It may begin with the last frame's own number, after a frame that
 * came twice, or after copies that don't lead up to it. */
static void test_void_after_restart(void **state)
{
    (void)state;
    int fd = rig_write_recording(); /* numbers 0 1 2 3, then 3 with other points */
    put_sequence(fd, 0, 100);
    put_sequence(fd, 3, 150);
    assert_int_equal(count_places(rig_read_recording(fd), 0), 3);
    fd = rig_write_recording(); /* numbers 0 1 2 3 3, then 2 */
    put_sequence(fd, 0, 100);
    put_all(fd, out, native_frame_len(out));
    rig_begin_sequence();
    rig_next_seq();
    rig_next_seq();
    put_points(fd, 3, 150);
    assert_int_equal(count_places(rig_read_recording(fd), 0), 3);
    fd = rig_write_recording(); /* numbers 0 1 2 3 0 1, then 3 with other points */
    put_sequence(fd, 0, 100);
    rig_begin_sequence();
    put_descriptor(fd, 0, 1, 0);
    put_anchor(fd, 0);
    put_sequence(fd, 3, 150);
    assert_int_equal(count_places(rig_read_recording(fd), 0), 3);
}

/* A descriptor for this reader alone holds for a sequence that begins right after it. Once another frame has come
 * between, it doesn't hold, nor does a frame that came twice. */
static void test_alike_long_ago(void **state)
{
    (void)state;
    for (int alone = 0; alone <= 1; alone++) {
        int head;
        struct scanhead *sh = open_pair(&head);
        struct scanhead_frame f;
        struct scanhead_point point[3];
        const struct line_block block = make_block(3, 120);
        put_descriptor(head, 0, 1, 0);
        expect_frame(sh, SCANHEAD_DESCRIPTOR, &f);
        put_anchor(head, 0);
        expect_frame(sh, SCANHEAD_ANCHOR, &f);
        put_points(head, 3, 100);
        expect_frame(sh, SCANHEAD_POINTS, &f);
        if (!alone) put_all(head, out, native_frame_len(out)); /* once more */
        if (alone) put_descriptor(head, 0, 1, NATIVE_LOCAL | NATIVE_REPEAT);
        if (alone) expect_frame(sh, SCANHEAD_DESCRIPTOR, &f);
        put_points(head, 3, 110);
        expect_frame(sh, SCANHEAD_POINTS, &f);
        assert_int_equal(scanhead_points(sh, &f, 0, point, 3), 3);
        const size_t len = native_encode_points(out, sizeof out, &block, 500);
        native_finish_frame(out, 0);
        put_all(head, out, len);
        expect_frame(sh, SCANHEAD_POINTS, &f);
        assert_int_equal(scanhead_points(sh, &f, 0, point, 3), SCANHEAD_ESTATE);
        close(head);
        scanhead_close(sh);
    }
}

/* A sequence whose scan a descriptor for this reader alone has named has pulses and a start of its own: neither lower
 * pulses nor a late SCAN_START show another scan. */
static void test_told_alone(void **state)
{
    (void)state;
    const struct line_block block = make_block(3, 50);
    const struct native_event e = {.code = NATIVE_EV_SCAN_START, .a = 1, .b = 77};
    for (int starts = 0; starts <= 1; starts++) {
        int head;
        struct scanhead *sh = open_pair(&head);
        struct scanhead_frame f;
        struct scanhead_point point[3];
        put_descriptor(head, 0, 1, 0);
        expect_frame(sh, SCANHEAD_DESCRIPTOR, &f);
        put_anchor(head, 0);
        expect_frame(sh, SCANHEAD_ANCHOR, &f);
        put_points(head, 3, 100);
        expect_frame(sh, SCANHEAD_POINTS, &f);
        put_descriptor(head, 0, 1, NATIVE_LOCAL | NATIVE_REPEAT);
        expect_frame(sh, SCANHEAD_DESCRIPTOR, &f);
        size_t len = native_encode_event(out, sizeof out, &e, 500, 0);
        native_finish_frame(out, 0);
        if (starts) put_all(head, out, len);
        if (starts) expect_frame(sh, SCANHEAD_EVENT, &f);
        len = native_encode_points(out, sizeof out, &block, 500);
        native_finish_frame(out, (uint32_t)starts);
        put_all(head, out, len);
        expect_frame(sh, SCANHEAD_POINTS, &f);
        assert_int_equal(scanhead_points(sh, &f, 0, point, 3), 3);
        close(head);
        scanhead_close(sh);
    }
}

/* Numbers may begin anywhere: what came before the first one holds. */
static void test_any_start(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_point point[3];
    const struct line_block block = make_block(3, 100);
    put_descriptor(head, 0, 1, NATIVE_LOCAL);
    expect_frame(sh, SCANHEAD_DESCRIPTOR, &f);
    put_anchor(head, NATIVE_LOCAL);
    expect_frame(sh, SCANHEAD_ANCHOR, &f);
    const size_t len = native_encode_points(out, sizeof out, &block, 500);
    native_finish_frame(out, 1u << 31 | 5);
    put_all(head, out, len);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    assert_int_equal(scanhead_points(sh, &f, 0, point, 3), 3);
    close(head);
    scanhead_close(sh);
}

/* The handle does not wait on its descriptor, though a copy of it may belong to the caller. Once closed, the copy is as
 * it was. */
static void test_flags_of_a_copy(void **state)
{
    (void)state;
    for (int blocks = 0; blocks <= 1; blocks++) {
        int fd[2];
        char source[32];
        struct scanhead *sh;
        assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | (blocks ? 0 : SOCK_NONBLOCK), 0, fd), 0);
        const int copy = dup(fd[0]), before = fcntl(copy, F_GETFL);
        snprintf(source, sizeof source, "fd:%d", fd[0]);
        assert_int_equal(scanhead_open(source, &sh, NULL, 0), 0);
        assert_int_equal(fcntl(copy, F_GETFL), before | O_NONBLOCK);
        scanhead_close(sh);
        assert_int_equal(fcntl(copy, F_GETFL), before);
        close(copy);
        close(fd[1]);
    }
}

static void hash_frame(struct sha256_ctx *ctx, const uint8_t *frame, size_t len)
{
    sha256_update(ctx, 1, frame + 1);
    sha256_update(ctx, 4, frame + 4);
    sha256_update(ctx, len - 28, frame + 28);
}

static void test_hash(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    char hex[65], want[65];
    struct sha256_ctx ctx;
    sha256_init(&ctx);
    scanhead_hash_start(sh);
    scanhead_hash_hex(sh, hex);
    /* FIPS 180: the digest of nothing */
    assert_string_equal(hex, "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    struct native_descriptor d = make_descriptor(1, 1);
    struct native_anchor anchor = make_anchor();
    struct line_end end = {.line = 3};
    struct line_block block = make_block(9, 0);
    size_t len;
    for (int part = 0; part < 4; part++) {
        if (part == 0) len = native_encode_descriptor(out, sizeof out, &d, 5, 0);
        if (part == 1) len = native_encode_anchor(out, sizeof out, &anchor, 5, 0);
        if (part == 2) len = native_encode_points(out, sizeof out, &block, 5);
        if (part == 3) len = native_encode_line_end(out, sizeof out, &end, 5);
        hash_frame(&ctx, out, len);
        native_finish_frame(out, rig_next_seq());
        put_all(head, out, len);
        put_event(head, 1, 2, 3, 4, 0);            /* outside */
        put_descriptor(head, 1, 1, NATIVE_REPEAT); /* outside */
    }
    close(head);
    int n = 0;
    while (scanhead_next(sh, &f, WAIT_MS) == 0)
        n++;
    assert_int_equal(n, 12);
    uint8_t digest[32];
    sha256_digest(&ctx, sizeof digest, digest);
    for (int i = 0; i < 32; i++)
        snprintf(want + 2 * i, 3, "%02x", digest[i]);
    for (int i = 0; i < 2; i++) { /* asking does not end it */
        scanhead_hash_hex(sh, hex);
        assert_string_equal(hex, want);
    }
    scanhead_close(sh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_stats),
        cmocka_unit_test(test_version_and_types),
        cmocka_unit_test(test_restart),
        cmocka_unit_test(test_alike_long_ago),
        cmocka_unit_test(test_told_alone),
        cmocka_unit_test(test_alike),
        cmocka_unit_test(test_any_start),
        cmocka_unit_test(test_hash),
        cmocka_unit_test(test_void_after_restart),
        cmocka_unit_test(test_flags_of_a_copy),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
