/* SPDX-License-Identifier: MIT */
/* No thread sleeps for ever. The tests have wake-ups alone, and the whole loop with queues of a few ticks, where each
 * thread waits for each other one again and again. A lost wake-up shows as a time-out. */
#include "tests/unit/device_rig.h"

#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <sys/socket.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/loop/wakeup.h"
#include "firmware_sim/loop/loop_inside.h"
#include "tests/common/cases.h"
#include "tests/common/thorough.h"

static const int64_t DEADLINE_NS = 240000000000;

/* ---- wake-ups */

enum { TURNS = 20000, SLEEPERS = 3 };

static struct {
    struct wakeup here, there;
    _Atomic uint32_t ball;
    _Atomic int in_time;
} game;

static void *play(void *arg)
{
    const uint32_t mine = (uint32_t)(intptr_t)arg;
    struct wakeup *own = mine == 0 ? &game.here : &game.there, *other = mine == 0 ? &game.there : &game.here;
    const int64_t until_ns = clock_now_ns() + DEADLINE_NS;
    for (uint32_t ball; (ball = atomic_load(&game.ball)) < TURNS;) {
        if (ball % 2 == mine) {
            atomic_store(&game.ball, ball + 1);
            wakeup_signal(other, 1);
        } else if (wakeup_sleep_until(own, until_ns)) {
            atomic_store(&game.in_time, 0);
            break;
        }
    }
    return NULL;
}

static void a_signal_is_never_lost(void **state)
{
    (void)state;
    pthread_t player[2];
    wakeup_create(&game.here);
    wakeup_create(&game.there);
    atomic_store(&game.in_time, 1);
    for (intptr_t i = 0; i < 2; i++)
        assert_int_equal(pthread_create(&player[i], NULL, play, (void *)i), 0);
    for (int i = 0; i < 2; i++)
        pthread_join(player[i], NULL);
    wakeup_free(&game.here);
    wakeup_free(&game.there);
    assert_true(game.in_time && game.ball == TURNS);
}

static void signals_are_not_counted(void **state)
{
    (void)state;
    struct wakeup wakeup;
    wakeup_create(&wakeup);
    for (int i = 0; i < 1000; i++)
        wakeup_signal(&wakeup, SLEEPERS);
    for (int i = 0; i < SLEEPERS; i++)
        wakeup_sleep(&wakeup); /* each finds one */
    assert_true(wakeup_sleep_until(&wakeup, clock_now_ns() + 1000000));
    wakeup_free(&wakeup);
}

/* ---- the loop */

struct peer {
    int fd;
    uint64_t seed, received, leaves; /* after so many bytes it goes away */
    uint32_t steps;                  /* to be granted; 0: it only reads */
    _Atomic int end;
};

/* Reads a little at a time, and now and then nothing for a while. Before it goes away it lets the loop wait for it. */
static void *read_slowly(void *arg)
{
    struct peer *peer = arg;
    static uint8_t bytes[65536];
    for (ssize_t n = 1; n > 0; peer->received += (uint64_t)n) {
        if (peer->received > peer->leaves) {
            clock_sleep_until_ns(clock_now_ns() + 20000000);
            shutdown(peer->fd, SHUT_RDWR);
            break;
        }
        if (case_between(&peer->seed, 0, 40) == 0) clock_sleep_until_ns(clock_now_ns() + 3000000);
        n = read(peer->fd, bytes, (size_t)case_between(&peer->seed, 1, sizeof bytes));
    }
    return NULL;
}

static int is_reply(const uint8_t *bytes, ssize_t n)
{
    for (ssize_t i = 1; i < n; i++)
        if (bytes[i - 1] == '\r' && bytes[i] == '\n') return 1;
    return 0;
}

/* Grants one step after the other, each after the reply to the last one. The head boots and spins up in 230 ms. */
static void *grant_steps(void *arg)
{
    struct peer *peer = arg;
    static uint8_t bytes[65536];
    ssize_t n = 1;
    for (uint32_t step = 0; step < peer->steps && n > 0; step++) {
        char line[64];
        const int len = snprintf(line, sizeof line, "TIME:STEP %d US\n", (int)case_between(&peer->seed, 1, 4000));
        assert_int_equal(write(peer->fd, line, (size_t)len), len);
        do {
            n = read(peer->fd, bytes, sizeof bytes);
            peer->received += n > 0 ? (uint64_t)n : 0;
        } while (n > 0 && !is_reply(bytes, n));
    }
    atomic_store(&peer->end, 1);
    return read_slowly(arg);
}

struct loop_case {
    const char *sets[6];
    uint32_t steps;
    uint64_t leaves;
};

/* The extra link is the last one. */
static int extra_lost_nothing(const struct loop *loop)
{
    struct link_counts counts;
    uint32_t i = 0;
    while (loop_get_counts(loop, i, &counts))
        i++;
    assert_int_equal(loop_get_counts(loop, i - 1, &counts), 1);
    return counts.left_out_frames == 0 && counts.lost_units == 0;
}

/* Runs it to its end in time, and writes the stream's hash. */
static void run_case(const struct loop_case *c, uint64_t seed, char sha256[65])
{
    int fd[2], n_sets = 0;
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, fd), 0);
    const struct link_spec spec = {.type = LINK_FD, .fd = fd[0]};
    const struct loop_options options = {.hash = 1, .extra = &spec};
    struct peer peer = {.fd = fd[1], .seed = seed, .steps = c->steps, .leaves = c->leaves};
    struct sh_err err;
    struct loop *loop;
    struct loop_stats stats;
    pthread_t thread;
    while (n_sets < 6 && c->sets[n_sets] != NULL)
        n_sets++;
    struct rig *rig =
        rig_open(&(struct device_options){.start = 1, .duration_s = c->steps != 0 ? 0.0 : 0.2}, c->sets, n_sets);
    need(loop_create(rig->site, rig->device, &options, &loop, &err), &err);
    assert_int_equal(pthread_create(&thread, NULL, c->steps != 0 ? grant_steps : read_slowly, &peer), 0);
    need(loop_start(loop, &err), &err);
    const int64_t until_ns = clock_now_ns() + DEADLINE_NS;
    for (int ending = 0; !loop_is_over(loop) && clock_now_ns() < until_ns; poll(NULL, 0, 2))
        if (atomic_load(&peer.end) && !ending) {
            ending = 1;
            loop_end(loop);
        }
    if (!loop_is_over(loop)) fail_msg("%s %s %s: it stands still", c->sets[0], c->sets[1], c->sets[2]);
    loop_join(loop, &stats);
    const int is_whole = extra_lost_nothing(loop);
    loop_free(loop); /* closes the peer's other end */
    pthread_join(thread, NULL);
    close(fd[1]);
    rig_close(rig);
    assert_true(stats.have_hash && stats.counters.lost_ticks == 0 && is_whole);
    assert_true(peer.received > 0 && stats.counters.pulses > 0);
    memcpy(sha256, stats.sha256, sizeof stats.sha256);
}

enum { EVERY = SANITIZED ? 5 : 1, STEPS = SANITIZED ? 250 : 600 };

/* All of them have the same ticks, so the same bytes. */
static void a_fast_loop_never_stands_still(void **state)
{
    (void)state;
    static const char *const ahead[] = {"loop.ahead_ms=2", "loop.ahead_ms=9", "loop.ahead_ms=64"};
    static const char *const queue[] = {"loop.queue_ms=10", "loop.queue_ms=15", "loop.queue_ms=250"};
    static const char *const threads[] = {"loop.threads=1", "loop.threads=2", "loop.threads=5"};
    static const char *const ticks[] = {"loop.tick_hz=100", "loop.tick_hz=1000", "loop.tick_hz=10000"};
    char first[3][65] = {{0}}, sha256[65];
    for (int i = 0; i < 81; i += EVERY) {
        const int t = i % 3;
        const struct loop_case c = {
            .sets = {ahead[i / 3 % 3], queue[i / 9 % 3], threads[i / 27], ticks[t], "loop.pace=fast", "head.frames=0"},
            .leaves = i % 2 == 0 ? UINT64_MAX : 200000};
        run_case(&c, (uint64_t)i + 1, sha256);
        if (first[t][0] == '\0') memcpy(first[t], sha256, sizeof sha256);
        assert_string_equal(sha256, first[t]);
    }
}

static void a_stepped_loop_never_stands_still(void **state)
{
    (void)state;
    char sha256[65];
    for (int i = 0; i < 3; i++) {
        const struct loop_case c = {.sets = {"loop.pace=step", i == 0 ? "loop.ahead_ms=2" : "loop.ahead_ms=64",
                                             i == 2 ? "loop.threads=3" : "loop.threads=1", "loop.queue_ms=10",
                                             "head.frames=0"},
                                    .steps = STEPS,
                                    .leaves = UINT64_MAX};
        run_case(&c, (uint64_t)i + 1, sha256);
    }
}

/* ---- a protocol */

/* Reads all that comes. */
static void *read_on(void *arg)
{
    static uint8_t bytes[65536];
    while (read(*(const int *)arg, bytes, sizeof bytes) > 0)
        continue;
    return NULL;
}

/* Returns once nothing was released for a while. A machine that is too slow for that makes the test weaker, not wrong.
 */
static void wait_held_back(const struct loop *loop)
{
    for (uint64_t before = 0, now; (now = stream_released(&loop->stream)) == 0 || now != before; before = now)
        poll(NULL, 0, 100);
}

/* The client reads nothing until the head waits for it. By then more than half of the session's queue is full. Then all
 * of it goes out at once, and no link reports room for further ticks. 100 s of sentences are far more than queue and
 * socket hold. */
static void a_protocol_goes_on_once_its_client_reads(void **state)
{
    (void)state;
    static const char *const sets[] = {"loop.pace=fast",
                                       "loop.tick_hz=100",
                                       "head.prr_hz=1000",
                                       "head.frames=0",
                                       "time.epoch=2026-01-01T00:00:00Z",
                                       "gnss.rate_hz=20",
                                       "links[0].type=null",
                                       "links[0].protocol=nmea",
                                       "stations[0].lat_deg=1",
                                       "stations[0].lon_deg=2",
                                       "stations[0].height_m=3",
                                       "stations[1].lat_deg=1",
                                       "stations[1].lon_deg=2",
                                       "stations[1].height_m=3"};
    int fd[2];
    pthread_t thread;
    struct sh_err err;
    struct loop *loop;
    struct loop_stats stats;
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, fd), 0);
    /* The system allows so much at least, and doubles it. Three quarters of that are more than half of the queue. */
    assert_int_equal(setsockopt(fd[0], SOL_SOCKET, SO_SNDBUF, &(int){212992}, sizeof(int)), 0);
    const struct link_spec spec = {.type = LINK_FD, .fd = fd[0], .protocol = PROTOCOL_NMEA};
    const struct loop_options options = {.extra = &spec};
    struct rig *rig =
        rig_open(&(struct device_options){.start = 1, .duration_s = 100.0}, sets, sizeof sets / sizeof *sets);
    need(loop_create(rig->site, rig->device, &options, &loop, &err), &err);
    need(loop_start(loop, &err), &err);
    wait_held_back(loop);
    assert_false(loop_is_over(loop));
    assert_int_equal(pthread_create(&thread, NULL, read_on, &fd[1]), 0);
    for (int64_t until_ns = clock_now_ns() + DEADLINE_NS; !loop_is_over(loop) && clock_now_ns() < until_ns;)
        poll(NULL, 0, 2);
    assert_true(loop_is_over(loop));
    loop_join(loop, &stats);
    const int is_whole = extra_lost_nothing(loop);
    loop_free(loop);
    pthread_join(thread, NULL);
    close(fd[1]);
    rig_close(rig);
    assert_true(is_whole);
}

/* ---- ticks that go out together */

/* Returns how many ticks the pacing thread released for each time that it slept, over a run in real time. */
static double ticks_a_sleep(const struct link_spec *link)
{
    static const char *const sets[] = {"head.prr_hz=1000", "head.frames=0"};
    const struct loop_options options = {.extra = link};
    const int64_t until_ns = clock_now_ns() + DEADLINE_NS;
    struct sh_err err;
    struct loop *loop;
    struct loop_stats stats;
    struct rig *rig = rig_open(&(struct device_options){.start = 1, .duration_s = 0.3}, sets, 2);
    need(loop_create(rig->site, rig->device, &options, &loop, &err), &err);
    need(loop_start(loop, &err), &err);
    while (!loop_is_over(loop) && clock_now_ns() < until_ns)
        poll(NULL, 0, 2);
    assert_true(loop_is_over(loop));
    loop_join(loop, &stats);
    const double ticks = (double)lateness_count(stats.late), sleeps = (double)lateness_count(stats.wake);
    assert_int_equal(stats.counters.lost_ticks, 0);
    loop_free(loop);
    rig_close(rig);
    return ticks / sleeps;
}

/* A machine that stands still only makes sleeps fewer. Casters are woken once 17 of 65 ticks ahead are free. A null
 * link is woken every 32nd tick: an eighth of 250 ms, and the current one. A link with a latency of 8 ms is woken every
 * 9th. So there are at least 17 * 32 / (17 + 32) = 11.1, and 17 * 9 / (17 + 9) = 5.9 ticks a sleep, less some at both
 * ends of the run. */
static void ticks_that_nobody_awaits_go_out_together(void **state)
{
    (void)state;
    int fd[2];
    pthread_t thread;
    assert_true(ticks_a_sleep(&(struct link_spec){.type = LINK_NULL}) > 10.0);
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, fd), 0);
    assert_int_equal(pthread_create(&thread, NULL, read_on, &fd[1]), 0);
    assert_true(ticks_a_sleep(&(struct link_spec){.type = LINK_FD, .fd = fd[0], .latency_ms = 8}) > 5.0);
    pthread_join(thread, NULL);
    close(fd[1]);
}

int main(void)
{
    signal(SIGPIPE, SIG_IGN);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_signal_is_never_lost),
        cmocka_unit_test(signals_are_not_counted),
        cmocka_unit_test(a_fast_loop_never_stands_still),
        cmocka_unit_test(a_stepped_loop_never_stands_still),
        cmocka_unit_test(a_protocol_goes_on_once_its_client_reads),
        cmocka_unit_test(ticks_that_nobody_awaits_go_out_together),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
