/* SPDX-License-Identifier: MIT */
/* The pacing thread allocates nothing, takes no lock, and calls the system only for the clock, the semaphores of
 * sleeping threads, and wake-ups. The thread is watched (pacing_rig.h) while a head with several links, clients, faults
 * and a hash works. The head starts and stops scans, changes its rate so that slots grow, is late and catches up
 * again. */
#include "tests/unit/pacing_rig.h"

#ifndef SH_SANITIZE

#include <arpa/inet.h>
#include <fcntl.h>
#include <linux/futex.h>
#include <malloc.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/syscall.h>

#include "firmware_sim/base/clock.h"

static const char LINKS[] = "links: [{type: tcp, port: 0, max_sessions: 2}, {type: pty}, {type: web, port: 0}]\n"
                            "faults: [{kind: drop, every: 20}, {kind: flip, every: 17}, {kind: stall, for_ms: 20, "
                            "every: 50}, {kind: split, n: 7, every: 13}, {kind: disconnect, every: 300}]\n";

/* ---- the run */

struct run {
    struct rig *rig;
    struct loop *loop;
    struct loop_stats stats;
};

static void start(struct run *run, const char *const *sets, int n_sets, double duration_s)
{
    static const struct link_spec null_link = {.type = LINK_NULL};
    const struct loop_options options = {.hash = 1, .extra = &null_link};
    struct sh_err err;
    *run = (struct run){.rig = rig_open(&(struct device_options){.start = 1, .duration_s = duration_s}, sets, n_sets)};
    need(loop_create(run->rig->site, run->rig->device, &options, &run->loop, &err), &err);
    need(loop_start(run->loop, &err), &err);
}

/* The run's own end is far away, and its clients end it. */
enum { ENDLESS_S = 3600 };

/* Between two beats clients of the run act, every 5 ms at most. A beat that returns 0 ends the run. The run fails after
 * minutes. */
static void finish(struct run *run, int (*beat)(struct run *run, int turn))
{
    const int64_t until_ns = clock_now_ns() + 240000000000;
    int ended = 0;
    for (int turn = 0; !loop_is_over(run->loop) && clock_now_ns() < until_ns;) {
        poll(NULL, 0, 5);
        if (beat == NULL || beat(run, turn++) || ended) continue; /* at its end clients still take what they can */
        loop_end(run->loop);
        ended = 1;
    }
    assert_true(loop_is_over(run->loop));
    loop_join(run->loop, &run->stats);
    loop_free(run->loop);
    rig_close(run->rig);
}

/* ---- planted calls are found */

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static int pipe_fd[2];
static void *volatile block;

static pthread_cond_t changed = PTHREAD_COND_INITIALIZER;
static pthread_rwlock_t shared = PTHREAD_RWLOCK_INITIALIZER;
static pthread_once_t first_time = PTHREAD_ONCE_INIT;
static void *aligned;

static void nothing(void)
{
}

static void plant_all(int sleep)
{
    char text[8];
    uint32_t word = 1;
    switch (sleep) {
    case 5:
        block = malloc(1);
        break;
    case 6:
        free(block);
        break;
    case 7:
        pthread_mutex_lock(&lock);
        break;
    case 8:
        pthread_mutex_unlock(&lock);
        break;
    case 9:
        block = strcpy(text, snprintf(text, sizeof text, "%d", sleep) == 1 ? "x" : "y");
        break;
    case 10:
        syscall(SYS_write, pipe_fd[1], "12345678", 8);
        break; /* as long as a wake-up */
    case 11:
        sched_yield();
        break;
    case 12:
        syscall(SYS_futex, &word, FUTEX_WAIT_PRIVATE, 0, NULL);
        break; /* as of a mutex that is taken */
    case 13:
        syscall(SYS_getpid);
        break;
    case 14:
        pthread_cond_signal(&changed);
        break;
    case 15:
        aligned = memalign(64, 64);
        break;
    case 16:
        pthread_rwlock_tryrdlock(&shared);
        break;
    case 17:
        pthread_once(&first_time, nothing);
        break;
    case 18:
        text[0] = (char)sprintf(text, "%d", sleep); /* as above, in the unbounded form */
        break;
    default:
        break;
    }
}

static int until_all_are_planted(struct run *run, int turn)
{
    (void)run, (void)turn;
    return pacing_sleeps() <= 18;
}

static void what_is_planted_is_found(void **state)
{
    (void)state;
    static const char *const sets[] = {"head.prr_hz=1000", "head.frames=0", "loop.threads=1"};
    static const struct {
        const char *name;
        int nr;
    } planted[] = {{"malloc", -1},
                   {"free", -1},
                   {"pthread_mutex_lock", -1},
                   {"snprintf", -1},
                   {NULL, SYS_write},
                   {NULL, SYS_sched_yield},
                   {NULL, SYS_futex},
                   {NULL, SYS_getpid},
                   {"pthread_cond_signal", -1},
                   {"memalign", -1},
                   {"pthread_rwlock_tryrdlock", -1},
                   {"pthread_once", -1},
                   {"sprintf", -1}};
    struct run run;
    if (!pacing_filter_works()) skip();
    assert_int_equal(pipe2(pipe_fd, O_CLOEXEC), 0);
    pacing_watch(plant_all);
    start(&run, sets, 3, ENDLESS_S);
    finish(&run, until_all_are_planted);
    const int n = pacing_found();
    for (size_t i = 0; i < sizeof planted / sizeof *planted; i++) {
        char call[40];
        snprintf(call, sizeof call, "system call %d", planted[i].nr);
        const char *name = planted[i].name != NULL ? planted[i].name : call;
        if (!pacing_has(name)) fail_msg("%s was not found", name);
    }
    assert_int_equal(n,
                     sizeof planted / sizeof *planted + 2); /* snprintf and sprintf each call one more, with a list */
    free(aligned);
    close(pipe_fd[0]);
    close(pipe_fd[1]);
}

/* ---- a busy head */

enum { CLIENTS = 4 };
static int client[CLIENTS];

static int open_socket(const char *endpoint)
{
    const char *port = strrchr(endpoint, ':');
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)atoi(port + 1))};
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(connect(fd, (struct sockaddr *)&at, sizeof at), 0);
    fcntl(fd, F_SETFL, O_NONBLOCK);
    return fd;
}

static const struct timespec STILL_60_MS = {.tv_nsec = 60000000}, STILL_200_MS = {.tv_nsec = 200000000};

static void open_clients(const struct run *run)
{
    static const char upgrade[] = "GET /ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: "
                                  "Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: "
                                  "scanhead-native-1\r\nSec-WebSocket-Version: 13\r\n\r\n";
    struct link_place place;
    int n = 0;
    for (uint32_t i = 0; loop_get_place(run->loop, i, &place); i++) {
        if (strcmp(place.type, "tcp") == 0)
            for (int k = 0; k < 2; k++)
                client[n++] = open_socket(place.endpoint);
        if (strcmp(place.type, "pty") == 0)
            client[n++] = open(place.endpoint + strlen("tty:"), O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
        if (strcmp(place.type, "web") == 0) {
            client[n] = open_socket(place.endpoint);
            assert_int_equal(write(client[n++], upgrade, sizeof upgrade - 1), sizeof upgrade - 1);
        }
    }
    assert_int_equal(n, CLIENTS);
}

/* Sends a line. A client that was cut off comes back first. */
static void say(struct run *run, const char *line)
{
    struct link_place place;
    if (write(client[0], line, strlen(line)) > 0) return;
    close(client[0]);
    loop_get_place(run->loop, 0, &place);
    client[0] = open_socket(place.endpoint);
    (void)!write(client[0], line, strlen(line));
}

/* The head has booted after 0.2 s: 40 turns. The run goes on until all lines are sent, two scans have begun, and the
 * pacing thread has stood still. */
static int use(struct run *run, int turn)
{
    static const char *const said[] = {"HEAD:PRR MAX\n",   "SCAN:STOP\n", "HEAD:STATE?\n", "SCAN:START\n",
                                       "HEAD:LINES 300\n", "SCAN:STOP\n", "nonsense\n",    "*RST\n",
                                       "HEAD:STATION 2\n", "SCAN:START\n"};
    static char bytes[65536];
    if (turn == 0) open_clients(run);
    if (turn == 88) pacing_slow_locks(10000000); /* casters are so slow that the ring comes round before them */
    if (turn == 108) pacing_slow_locks(0);
    for (int i = 0; i < CLIENTS; i++) {
        if (i == 1 && turn < 100) continue; /* it does not read, and loses frames */
        for (ssize_t n = 1; n > 0;)
            n = read(client[i], bytes, sizeof bytes);
    }
    if (turn >= 50 && turn % 10 == 0) say(run, said[(turn / 10 - 5) % 10]);
    if (turn % 10 == 3) say(run, "*IDN?\n");
    if (turn % 10 == 6) (void)!write(client[2], "HEAD:PRR?\n", 10);
    return turn < 160 || device_last_scan(run->rig->device, NULL) < 2 || pacing_sleeps() < 350;
}

/* The thread is late, and catches up. */
static void stand_still(int sleep)
{
    if (sleep == 300) syscall(SYS_clock_nanosleep, CLOCK_MONOTONIC, 0, &STILL_60_MS, NULL);
}

static void the_pacing_thread_does_nothing_else(void **state)
{
    (void)state;
    static const char *const sets[] = {"head.prr_hz=1000", "head.frames=0",  "loop.queue_ms=20",
                                       "loop.threads=1",   "loop.late_ms=1", "loop.ahead_ms=4"};
    struct run run;
    if (!pacing_filter_works()) skip();
    pacing_watch(stand_still);
    start(&run, sets, 6, ENDLESS_S);
    finish(&run, use);
    const int n = pacing_found();
    for (int i = 0; i < CLIENTS; i++)
        close(client[i]);
    print_message("# %d sleeps, %u pulses, %u scans, %u ticks lost, %u frames lost by readers\n", pacing_sleeps(),
                  (unsigned)run.stats.counters.fired, (unsigned)run.stats.scans,
                  (unsigned)run.stats.counters.lost_ticks, (unsigned)run.stats.counters.reader_lost_frames);
    assert_true(pacing_sleeps() > 100 && run.stats.counters.fired > 10000 && run.stats.scans > 1);
    assert_true(run.stats.counters.lost_ticks > 54); /* so many slots there are */
    assert_int_equal(run.stats.counters.cast, run.stats.counters.pulses + run.stats.counters.lost_pulses);
    assert_int_equal(n, 0);
}

/* ---- a stall in the real loop */

static void stand_still_for_200_ms(int sleep)
{
    if (sleep == 25) syscall(SYS_clock_nanosleep, CLOCK_MONOTONIC, 0, &STILL_200_MS, NULL);
}

/* With one tick of 10 ms ahead, 20 ticks are late, and some more until the thread has caught up. If it waited for a
 * beat before each tick, it would be late to the end of the run: some 58 ticks. A machine with other work only adds
 * late ones, so one of TRIES runs has to show it. */
enum { TRIES = 20 };

static int caught_up(void)
{
    static const char *const sets[] = {"head.prr_hz=1000", "head.frames=0",  "loop.tick_hz=100",
                                       "loop.ahead_ms=2",  "loop.threads=1", "loop.late_ms=10000"};
    struct run run;
    pacing_watch(stand_still_for_200_ms);
    start(&run, sets, 6, 0.6);
    finish(&run, NULL);
    assert_int_equal(pacing_found(), 0);
    print_message("# %u of %u ticks late\n", (unsigned)run.stats.counters.late_blocks,
                  (unsigned)lateness_count(run.stats.late));
    assert_int_equal(run.stats.counters.lost_ticks, 0);
    return run.stats.counters.late_blocks >= 19 && run.stats.counters.late_max_ns >= 190000000 &&
           run.stats.counters.late_blocks < 50;
}

static void it_catches_up(void **state)
{
    int tries = 0;
    (void)state;
    if (!pacing_filter_works()) skip();
    while (!caught_up())
        assert_true(++tries < TRIES);
}

static int make_busy_folder(void **state)
{
    char path[96];
    if (make_folder(state) != 0) return -1;
    snprintf(path, sizeof path, "%s/run.yaml", folder);
    FILE *f = fopen(path, "a");
    return f != NULL && fputs(LINKS, f) >= 0 && fclose(f) == 0 ? 0 : -1;
}

int main(void)
{
    signal(SIGPIPE, SIG_IGN);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_planted_is_found),
        cmocka_unit_test(the_pacing_thread_does_nothing_else),
        cmocka_unit_test(it_catches_up),
    };
    return cmocka_run_group_tests(tests, make_busy_folder, remove_folder);
}

#else

int main(void)
{
    print_message("1..0 # SKIP sanitizers have an allocator and locks of their own\n");
    return 0;
}

#endif
