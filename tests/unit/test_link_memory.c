/* SPDX-License-Identifier: MIT */
/* The memory link: its two ends alone, and a head off line whose client reads it. */
#include "tests/unit/device_rig.h"
#include "tests/unit/link_test.h"

#include <poll.h>

#include "drivers/host/scanhead.h"
#include "drivers/link/memory.h"
#include "drivers/protocol/crc32c.h"
#include "drivers/protocol/native.h"
#include "firmware_sim/app/studio/record/offline.h"
#include "firmware_sim/fault/faulty_link.h"
#include "firmware_sim/loop/loop_inside.h"

/* ---- the two ends */

static const char WRITTEN[] = "frames and replies";

static struct bench open_memory(struct link_memory *memory)
{
    const struct link_spec spec = {.type = LINK_MEMORY, .memory = memory};
    struct bench bench = bench_open(&spec);
    char text[16];
    bench.ops->endpoint(bench.link, text, sizeof text);
    assert_string_equal(text, "memory");
    bench_expect(&bench, LINK_OPENED, 0);
    return bench;
}

/* The client gets the owner's own bytes. The bytes count as written once the client has let the owner work again. */
static void a_write_is_read_where_it_lies(void **state)
{
    (void)state;
    struct link_memory memory = {0};
    struct bench bench = open_memory(&memory);
    const uint8_t *bytes;
    assert_int_equal(memory_take(&memory, &bytes), 0);
    bench_expect(&bench, LINK_WRITABLE, 1);
    for (int round = 0; round < 3; round++) {
        const size_t len = sizeof WRITTEN - (size_t)round;
        assert_int_equal(bench.ops->write(bench.link, 0, WRITTEN, len), 0);
        assert_int_equal(bench.ops->write(bench.link, 0, WRITTEN, len), 0);
        assert_int_equal(bench_poll(&bench, 1, 0), 0); /* full: a client that does not read keeps nobody awake */
        assert_int_equal(memory_take(&memory, &bytes), len);
        assert_ptr_equal(bytes, WRITTEN);
        assert_int_equal(memory_take(&memory, &bytes), 0);
        bench_expect(&bench, LINK_WRITABLE, 1);
        assert_int_equal(bench.ops->write(bench.link, 0, WRITTEN, len), len);
    }
    assert_int_equal(bench_poll(&bench, 0, 0), 0);
    assert_int_equal(bench.ops->write(bench.link, 1, WRITTEN, 1), SH_ECLOSED);
    bench_close(&bench);
}

/* Bytes that are lent count as written at once, while there is room. Lent bytes come in order, before a write. */
static void pieces_come_in_their_order(void **state)
{
    (void)state;
    struct link_memory memory = {0};
    struct bench bench = open_memory(&memory);
    const uint8_t *bytes;
    for (int round = 0; round < 2; round++) {
        const size_t n = round == 0 ? 3 : MEMORY_PIECES;
        for (size_t i = 0; i < n; i++)
            assert_int_equal(bench.ops->lend(bench.link, 0, WRITTEN + i, i + 1), i + 1);
        assert_int_equal(bench.ops->write(bench.link, 0, WRITTEN, 9), 0);
        if (round == 1) assert_int_equal(bench.ops->lend(bench.link, 0, WRITTEN, 5), 0);
        for (size_t i = 0; i < n; i++) {
            assert_int_equal(bench_poll(&bench, 1, 0), 0);
            assert_int_equal(memory_take(&memory, &bytes), i + 1);
            assert_ptr_equal(bytes, WRITTEN + i);
        }
        if (round == 0) assert_int_equal(memory_take(&memory, &bytes), 9);
        assert_int_equal(memory_take(&memory, &bytes), 0);
        bench_expect(&bench, LINK_WRITABLE, 1);
        if (round == 0) assert_int_equal(bench.ops->write(bench.link, 0, WRITTEN, 9), 9);
    }
    bench_close(&bench);
}

static void a_client_sends_until_there_is_no_room(void **state)
{
    (void)state;
    struct link_memory memory = {0};
    struct bench bench = open_memory(&memory);
    uint8_t line[1000], back[sizeof line];
    size_t sent = 0, got = 0;
    ssize_t n;
    for (int k = 0; (n = (ssize_t)memory_send(&memory, line, sizeof line)) != 0; k++) {
        assert_true(k < 5);
        sent += (size_t)n;
    }
    assert_int_equal(sent, MEMORY_ROOM);
    for (int last = 0; got < sent; last = (int)n) {
        assert_true(got == 0 || last > 0);
        bench_expect(&bench, LINK_READABLE, 0);
        n = bench.ops->read(bench.link, 0, back, 999);
        got += (size_t)n;
    }
    assert_int_equal(got, sent);
    assert_int_equal(bench.ops->read(bench.link, 0, back, 1), 0);
    assert_int_equal(bench_poll(&bench, 0, 0), 0);
    assert_int_equal(memory_send(&memory, "abc", 3), 3);
    assert_int_equal(bench.ops->read(bench.link, 0, back, 2),
                     2); /* the rest comes next, and not the first bytes again */
    assert_int_equal(memory_send(&memory, "d", 1), 1);
    assert_int_equal(bench.ops->read(bench.link, 0, back + 2, 9), 2);
    assert_memory_equal(back, "abcd", 4);
    bench_close(&bench);
}

/* The client is gone. The owner gets a turn, and must not wait. */
static void note_turn(void *owner, int timeout_ms)
{
    assert_int_equal(timeout_ms, 0);
    ++*(int *)owner;
}

static void each_end_may_go(void **state)
{
    (void)state;
    struct link_memory memory = {0};
    struct bench bench = open_memory(&memory);
    const uint8_t *bytes;
    char byte;
    assert_int_equal(memory_send(&memory, "x", 1), 1);
    assert_int_equal(bench.ops->write(bench.link, 0, WRITTEN, 5), 0);
    int n_turns = 0;
    memory.turn = note_turn;
    memory.owner = &n_turns;
    memory_leave(&memory);
    memory_leave(&memory);
    assert_int_equal(n_turns, 1);
    assert_int_equal(memory_take(&memory, &bytes), 0);
    bench_expect(&bench, LINK_CLOSED, 1);
    assert_int_equal(bench.ops->write(bench.link, 0, WRITTEN, 5), SH_ECLOSED);
    assert_int_equal(bench.ops->read(bench.link, 0, &byte, 1), SH_ECLOSED);
    assert_int_equal(bench_poll(&bench, 1, 0), 0); /* once */
    bench_close(&bench);

    memory = (struct link_memory){0};
    bench = open_memory(&memory);
    assert_false(memory.over);
    assert_int_equal(bench.ops->write(bench.link, 0, WRITTEN, 5), 0);
    bench.ops->end(bench.link, 0);
    assert_true(memory.over);
    assert_int_equal(memory_take(&memory, &bytes), 5); /* bytes written before still come */
    memory.turn = note_turn;
    bench_close(&bench);
    assert_int_equal(memory_take(&memory, &bytes), 0);
    memory_turn(&memory, -1); /* nobody is there to work, or to wait */
}

/* ---- a head and its client */

/* A queue of ten ticks is full at once when its reader does not read. So is one of two long ticks, which are lent. */
static const char *const SETS[][5] = {
    {"loop.pace=fast", "head.frames=1", "loop.queue_ms=10", "loop.threads=2", "loop.ahead_ms=5"},
    {"loop.pace=fast", "head.frames=1", "loop.queue_ms=10", "loop.threads=2", "loop.tick_hz=100"}};

enum { FRAMES_MOST = 1000000, NEXT_MS = 60000 };

struct seen {
    uint64_t pulses, frames;
    char sha256[65];
};

static void ask(struct scanhead *sh, const char *line, const char *wanted)
{
    char reply[256];
    if (scanhead_command(sh, line, reply, sizeof reply, NEXT_MS) != SCANHEAD_OK) fail_msg("%s", scanhead_error(sh));
    if (wanted != NULL) assert_string_equal(reply, wanted);
}

static void wait_idle(struct scanhead *sh)
{
    char reply[256] = "";
    struct scanhead_frame frame;
    for (int k = 0; strcmp(reply, "idle") != 0; k++) {
        assert_true(k < FRAMES_MOST);
        assert_int_equal(scanhead_command(sh, "HEAD:STAT?", reply, sizeof reply, NEXT_MS), SCANHEAD_OK);
        scanhead_next(sh, &frame, 0);
    }
}

/* Reads to the scan's end. With `pauses` it pauses now and then, so that the head must wait, and asks, so that frames
 * are kept. */
static void scan(struct scanhead *sh, int pauses, struct seen *seen)
{
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    memset(seen, 0, sizeof *seen);
    wait_idle(sh);
    scanhead_hash_start(sh);
    ask(sh, "SCAN:STAR", "OK");
    do {
        if (scanhead_next(sh, &frame, NEXT_MS) != SCANHEAD_OK) fail_msg("%s", scanhead_error(sh));
        assert_true(seen->frames++ < FRAMES_MOST);
        if (frame.type == SCANHEAD_POINTS) seen->pulses += frame.n_pulses;
        if (pauses && seen->frames % 64 == 0) poll(NULL, 0, 1);
        if (pauses && seen->frames % 200 == 0) ask(sh, "HEAD:STAT?", NULL);
    } while (frame.type != SCANHEAD_EVENT || frame.event != SCANHEAD_EV_SCAN_END);
    assert_int_equal(frame.event_value[2], 0);
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.seq_lost + stats.reader_lost + stats.bad_bytes + stats.repeated + stats.late, 0);
    scanhead_hash_hex(sh, seen->sha256);
}

static struct rig *open_rig(int has_long_ticks)
{
    return rig_open(&(struct device_options){.start = 0}, SETS[has_long_ticks], 5);
}

/* The same through the socket pair, whose link has a thread of its own. */
static void scan_through_socket(int has_long_ticks, struct seen *seen)
{
    struct rig *rig = open_rig(has_long_ticks);
    struct link_spec spec = {.fd = -1};
    const struct loop_options options = {.extra = &spec};
    struct scanhead *sh;
    struct sh_err err;
    struct loop *loop;
    struct loop_stats stats;
    assert_true(offline_connect("a test", &spec, &sh, &err) >= 0);
    need(loop_create(rig->site, rig->device, &options, &loop, &err), &err);
    need(loop_start(loop, &err), &err);
    scan(sh, 0, seen);
    scanhead_close(sh);
    loop_end(loop);
    loop_join(loop, &stats);
    loop_free(loop);
    rig_close(rig);
}

static void the_stream_is_that_of_a_socket(void **state)
{
    (void)state;
    struct seen wanted, seen;
    struct sh_err err;
    for (int i = 0; i < 4; i++) {
        if (i % 2 == 0) scan_through_socket(i / 2, &wanted);
        assert_true(wanted.pulses > 1000);
        struct rig *rig = open_rig(i / 2);
        struct offline off = {.site = rig->site};
        need(offline_open(NULL, NULL, 0.0, NULL, &off, &err), &err);
        scan(off.sh, i % 2, &seen);
        assert_int_equal(seen.pulses, wanted.pulses);
        assert_string_equal(seen.sha256, wanted.sha256);
        offline_close(&off);
        rig_close(rig);
    }
}

/* A handle that hung up within a scan keeps its counts, and gives neither frames nor replies. */
static void a_client_may_go_within_a_scan(void **state)
{
    (void)state;
    struct rig *rig = open_rig(1);
    struct offline off = {.site = rig->site};
    struct scanhead_frame frame = {0};
    struct scanhead_stats before, after;
    struct sh_err err;
    char reply[64];
    need(offline_open(NULL, NULL, 0.0, NULL, &off, &err), &err);
    wait_idle(off.sh);
    ask(off.sh, "SCAN:STAR", "OK");
    while (frame.type != SCANHEAD_POINTS)
        assert_int_equal(scanhead_next(off.sh, &frame, NEXT_MS), SCANHEAD_OK);
    scanhead_get_stats(off.sh, &before);
    need(offline_finish(&off, &err), &err);
    assert_int_equal(scanhead_next(off.sh, &frame, NEXT_MS), SCANHEAD_ECLOSED);
    assert_int_equal(scanhead_command(off.sh, "*IDN?", reply, sizeof reply, NEXT_MS), SCANHEAD_ECLOSED);
    assert_int_equal(scanhead_reattach(off.sh, 0), SCANHEAD_ESTATE);
    scanhead_get_stats(off.sh, &after);
    assert_int_equal(after.frames, before.frames);
    assert_int_equal(after.bad_bytes, 0);
    offline_close(&off);
    rig_close(rig);
}

/* Frames that were released before the head's end still come, also to a client that reads late. */
static void a_head_may_end_within_a_scan(void **state)
{
    (void)state;
    struct rig *rig = open_rig(1);
    struct offline off = {.site = rig->site};
    struct scanhead_frame frame = {0};
    struct scanhead_stats stats;
    struct sh_err err;
    int rc;
    need(offline_open(NULL, NULL, 0.0, NULL, &off, &err), &err);
    wait_idle(off.sh);
    ask(off.sh, "SCAN:STAR", "OK");
    loop_end(off.loop);
    for (uint64_t n = 0; (rc = scanhead_next(off.sh, &frame, NEXT_MS)) == SCANHEAD_OK;)
        assert_true(n++ < FRAMES_MOST);
    assert_int_equal(rc, SCANHEAD_ECLOSED);
    scanhead_get_stats(off.sh, &stats);
    assert_int_equal(stats.seq_lost + stats.reader_lost + stats.bad_bytes, 0);
    offline_close(&off);
    rig_close(rig);
}

/* Between two turns a client may work for longer than the head's last wait for other readers. The run is over
 * meanwhile: its queue has room for all ticks. */
static void a_client_that_works_for_long_still_gets_the_end(void **state)
{
    (void)state;
    static const char *const sets[] = {"loop.pace=fast", "head.frames=0", "loop.queue_ms=1000"};
    struct link_memory memory = {0};
    const struct link_spec spec = {.type = LINK_MEMORY, .memory = &memory};
    const struct loop_options options = {.extra = &spec};
    struct rig *rig = rig_open(&(struct device_options){.start = 1, .duration_s = 0.1}, sets, 3);
    struct sh_err err;
    struct loop *loop;
    struct loop_stats stats;
    const uint8_t *bytes;
    uint64_t got = 0;
    need(loop_create(rig->site, rig->device, &options, &loop, &err), &err);
    need(loop_start(loop, &err), &err);
    for (int k = 0; !atomic_load(&loop->stream.over); k++) {
        assert_true(k < NEXT_MS);
        poll(NULL, 0, 1);
    }
    poll(NULL, 0, 2100); /* DRAIN_NS of pump.c is 2 s */
    while (!memory.over) {
        memory_turn(&memory, NEXT_MS);
        for (size_t n; (n = memory_take(&memory, &bytes)) != 0;)
            got += n;
    }
    loop_join(loop, &stats);
    loop_free(loop);
    rig_close(rig);
    assert_int_equal(stats.counters.reader_lost_frames, 0);
    assert_true(got > 20 * stats.counters.pulses && stats.counters.pulses > 1000); /* 20 bytes for each, and more */
}

/* Waits until the casters have claimed all ticks that the one reader leaves room for, or until the scan is over. */
static void wait_full(struct loop *loop)
{
    struct stream *stream = &loop->stream;
    int is_full = 0;
    while (!is_full && !device_is_idle(loop->device)) {
        poll(NULL, 0, 1);
        pthread_mutex_lock(&loop->casters.claim_lock);
        const uint64_t claimed = loop->casters.next_tick;
        pthread_mutex_unlock(&loop->casters.claim_lock);
        for (int i = 0; i < RING_MAX_READERS; i++)
            is_full |= atomic_load(&stream->reader[i].active) && claimed == atomic_load(&stream->reader[i].cursor) +
                                                                                stream->ring.queue_ticks - 1 +
                                                                                loop->casters.ahead_ticks;
    }
}

/* Each line has two ticks of more bytes than a turn of the link takes, a shorter one that is lent, and 97 empty ones,
 * which the same turn may take. The queue is long: ticks that are 300 apart (three lines) have the same slot. */
static void a_lent_tick_stays_while_its_client_reads(void **state)
{
    (void)state;
    static const char *const sets[] = {
        "loop.pace=fast",  "head.frames=1",     "loop.queue_ms=2650",    "loop.ahead_ms=5",      "loop.tick_hz=100",
        "head.lines_hz=1", "head.pan_deg_s=10", "head.line_start_deg=0", "head.line_stop_deg=4", "head.prr_hz=1000000"};
    struct rig *rig = rig_open(NULL, sets, sizeof sets / sizeof *sets);
    struct offline off = {.site = rig->site};
    struct scanhead_frame frame;
    struct sh_err err;
    uint64_t pulses = 0;
    need(offline_open(NULL, NULL, 0.0, NULL, &off, &err), &err);
    wait_idle(off.sh);
    ask(off.sh, "SCAN:STAR", "OK");
    assert_int_equal(off.loop->stream.ring.n_slots, 300);
    do {
        struct native_header header;
        wait_full(off.loop);
        if (scanhead_next(off.sh, &frame, NEXT_MS) != SCANHEAD_OK) fail_msg("%s", scanhead_error(off.sh));
        wait_full(off.loop);
        native_read_header(frame.raw, &header);
        assert_int_equal(crc32c(0, frame.payload, frame.payload_len), header.payload_crc);
        if (frame.type == SCANHEAD_POINTS) pulses += frame.n_pulses;
    } while (frame.type != SCANHEAD_EVENT || frame.event != SCANHEAD_EV_SCAN_END);
    assert_true(pulses > 9 * 10000);
    offline_close(&off);
    rig_close(rig);
}

static int64_t no_time(void *owner)
{
    (void)owner;
    return 0;
}

/* At the end of a run a reader has time while bytes move. Bytes that are lent count as moved, too. */
static void bytes_that_are_lent_move(void **state)
{
    (void)state;
    struct link_memory memory = {0};
    const struct link_spec spec = {.type = LINK_MEMORY, .memory = &memory};
    const struct faulty_spec faults = {.protocol = protocol_ops_get(PROTOCOL_NATIVE), .time_ns = no_time};
    struct faulty_link *link;
    struct sh_err err;
    need(faulty_open(&faults, &spec, &link, &err), &err);
    const struct link_ops *ops = faulty_ops(link);
    assert_int_equal(faulty_look(link, 0).moved_ns, 0);
    assert_int_equal(ops->lend(link, 0, WRITTEN, 5), 5);
    assert_true(faulty_look(link, 0).moved_ns != 0);
    ops->close(link);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_write_is_read_where_it_lies),
        cmocka_unit_test(a_client_sends_until_there_is_no_room),
        cmocka_unit_test(pieces_come_in_their_order),
        cmocka_unit_test(each_end_may_go),
        cmocka_unit_test(the_stream_is_that_of_a_socket),
        cmocka_unit_test(a_client_may_go_within_a_scan),
        cmocka_unit_test(a_head_may_end_within_a_scan),
        cmocka_unit_test(a_lent_tick_stays_while_its_client_reads),
        cmocka_unit_test(bytes_that_are_lent_move),
        cmocka_unit_test(a_client_that_works_for_long_still_gets_the_end),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
