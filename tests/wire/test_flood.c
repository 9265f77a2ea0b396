/* SPDX-License-Identifier: MIT */
/* A client that sends errors as fast as it can, beside one that reads a scan. The reader gets a bounded number of
 * errors and the exact count of all. Neither the stream nor the loop's beat is disturbed. */
#include "tests/wire/room.h"

#include <pthread.h>
#include <stdatomic.h>

enum { LINES = 100000, ERRORS_A_SECOND = 10, WRONG_AT_ONCE = 128, REST_MS = 2 };
static const char WRONG[] = "NO:SUCH 1\n", REPLY[] = "ERR -113,";

static const struct room_config RATE = {.prr_hz = 100000,
                                        .lines_hz = 100,
                                        .pan_deg_s = 10,
                                        .pan_stop_deg = 360,
                                        .frames = 0,
                                        .links = LINK_YAML_TCP,
                                        .more = "loop: {late_ms: 200, queue_ms: 5000}\n"};

struct flood {
    int fd;
    size_t sent; /* bytes */
    uint64_t replies, wrong;
    char line[1024]; /* text of the reply at hand */
    size_t len;
    size_t frame_left; /* bytes of a frame still to skip */
    _Atomic int over;
};

/* Frames lie between reply lines. Frames are skipped by the length in their header. */
static void take_bytes(struct flood *f, const unsigned char *bytes, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        if (f->frame_left != 0) {
            size_t skip = f->frame_left < n - i ? f->frame_left : n - i;
            f->frame_left -= skip;
            i += skip - 1;
            continue;
        }
        f->line[f->len++] = (char)bytes[i];
        if ((unsigned char)f->line[0] == 0xd5) {
            if (f->len < 8) continue;
            const unsigned char *h = (const unsigned char *)f->line;
            f->frame_left = 28 - 8 + ((size_t)h[4] | (size_t)h[5] << 8 | (size_t)h[6] << 16);
            f->len = 0;
        } else if (bytes[i] == '\n' || f->len == sizeof f->line) {
            f->replies++;
            f->wrong += strncmp(f->line, REPLY, sizeof REPLY - 1) != 0;
            f->len = 0;
        }
    }
}

static void *flood(void *arg)
{
    struct flood *f = arg;
    static char text[4096 * (sizeof WRONG - 1)];
    static unsigned char in[1 << 20];
    const size_t unit = sizeof WRONG - 1, all = (size_t)LINES * unit;
    for (size_t at = 0; at < sizeof text; at += unit)
        memcpy(text + at, WRONG, unit);
    while (f->replies < LINES) {
        struct pollfd slot = {.fd = f->fd, .events = (short)(POLLIN | (f->sent < all ? POLLOUT : 0))};
        if (poll(&slot, 1, DEADLINE_MS) != 1) break;
        if (slot.revents & POLLOUT) {
            size_t from = f->sent % unit, n = sizeof text - from < all - f->sent ? sizeof text - from : all - f->sent;
            ssize_t put = send(f->fd, text + from, n, MSG_DONTWAIT | MSG_NOSIGNAL);
            if (put > 0) f->sent += (size_t)put;
        }
        ssize_t got = slot.revents & POLLIN ? recv(f->fd, in, sizeof in, MSG_DONTWAIT) : 0;
        if (got > 0) take_bytes(f, in, (size_t)got);
    }
    atomic_store(&f->over, 1);
    return NULL;
}

/* The errors that the reader gets. */
struct told {
    uint64_t events, single, held, session;
    int64_t first_ns, last_ns;
    uint64_t next_pulse, pulses;
};

static void take(struct told *t, const struct scanhead_frame *frame)
{
    if (frame->type == SCANHEAD_POINTS) t->pulses += frame->n_pulses;
    if (!is_event(frame, SCANHEAD_EV_ERROR) || frame->event_value[1] == 0) return; /* 0: the head's own */
    assert_int_equal((int64_t)frame->event_value[0], -113);
    if (t->events++ == 0) {
        t->first_ns = frame->t_ns;
        t->session = frame->event_value[1];
    }
    t->last_ns = frame->t_ns;
    assert_int_equal(frame->event_value[1], t->session);
    t->single += frame->event_value[2] == 0;
    t->held += frame->event_value[2];
}

static void test_a_flood_of_errors(void **state)
{
    struct wire *wire = *state;
    struct told told = {0};
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &RATE), NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_START, &frame);
    struct flood f = {.fd = raw_connect(head_endpoint(&head, "tcp"))};
    pthread_t thread;
    const int64_t start_ms = wire_now_ms();
    assert_int_equal(pthread_create(&thread, NULL, flood, &f), 0);
    for (int64_t end_ms = wire_now_ms() + DEADLINE_MS; !atomic_load(&f.over) || told.single + told.held < LINES;) {
        if (wire_now_ms() > end_ms) fail_msg("%" PRIu64 " errors told of", told.single + told.held);
        client_next(sh, &frame);
        take(&told, &frame);
    }
    pthread_join(thread, NULL);
    /* The head rests after each 128 errors, to save processor time. The flood takes these rests at least, less a
     * clock's step. */
    assert_true(wire_now_ms() - start_ms >= (LINES / WRONG_AT_ONCE - 1) * REST_MS - 1);
    assert_int_equal(f.replies, LINES); /* a client with errors gets each of its replies */
    assert_int_equal(f.wrong, 0);
    client_tell(sh, "SCAN:STOP");
    do {
        client_next(sh, &frame);
        take(&told, &frame);
    } while (!is_event(&frame, SCANHEAD_EV_SCAN_END));
    assert_int_equal(told.single + told.held, LINES);
    uint64_t seconds = (uint64_t)((told.last_ns - told.first_ns) / 1000000000) + 1;
    assert_in_range(told.events, 2, seconds * (ERRORS_A_SECOND + 1) + 1);
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.seq_lost + stats.reader_lost + stats.dropped + stats.bad_bytes, 0);
    close(f.fd);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    assert_int_equal(stats_uint(wire, "lost_pulses"), 0);
    assert_int_equal(stats_uint(wire, "pulses"), told.pulses);
    print_message("# %u events for %u errors; half of the ticks were late by %u us at most\n", (unsigned)told.events,
                  (unsigned)LINES, (unsigned)stats_uint(wire, "late_p50_us"));
    assert_true(stats_uint(wire, "late_p50_us") < 1000); /* a tick: the beat is kept */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_a_flood_of_errors, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests_name("flood", tests, NULL, NULL);
}
