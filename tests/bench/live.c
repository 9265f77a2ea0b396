/* SPDX-License-Identifier: MIT */
/* This measures a live client with libscanhead alone: how many points a second it takes from a socket and from USB.
 *
 *   build/tests/bench/live [options]
 *
 * The stream of a head of 20 million points a second is made beforehand. On sockets another process only writes its
 * bytes again and again, a megabyte at a time, on another processor where there is one. On USB the stand-in for libusb
 * of the unit tests copies them into each transfer, as the kernel does; no bus is in these figures. The client decodes
 * all points into columns or into structs, or none. Figures are the client's and the sender's processor time, the
 * kernel's included, and the time that passes. */
#include <arpa/inet.h>
#include <getopt.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/monotonic.h"
#include "drivers/host/scanhead.h"
#include "tests/bench/bench.h"
#include "tests/bench/made_stream.h"
#include "tests/bench/options.h"
#include "tests/bench/pin.h"
#include "tests/unit/fake_libusb.h"

enum { MAX_ROUNDS = 99, TICKS = 100, WRITE_BYTES = 1 << 20, WAIT_MS = 60000 };
enum way { BY_TCP, BY_UNIX, BY_USB, WAYS };
enum take { TAKE_COLUMNS, TAKE_POINTS, TAKE_FRAMES, TAKES };

static const char *const WAY[WAYS] = {"tcp", "unix", "usb"};
static const char *const TAKE[TAKES] = {"columns", "points", "frames"};

static const char HELP[] =
    "live [options]: points a second that a client with libscanhead takes\n\n"
    "  --rounds N   default 15, at most 99\n"
    "  --times N    how often a round sends the stream of 2 million points, default 5, at most 1000\n"
    "  --raw        each round's figures, a line each, in place of medians\n\n"
    "tcp: a socket on loopback; unix: a socket pair; usb: the library's transfers, with a stand-in for libusb.\n"
    "columns: all columns of scanhead_columns(); points: scanhead_points(); frames: no point is decoded.\n";

struct options {
    uint32_t rounds, times;
    int raw;
};

struct figures {
    double ns[MAX_ROUNDS], wall_ns[MAX_ROUNDS], sender_ns[MAX_ROUNDS];
};

static struct made_stream stream;
static cpu_set_t allowed;

/* ---- senders */

/* This does not return. */
static void write_all(int fd, uint32_t times)
{
    cpu_set_t here = allowed;
    CPU_CLR((unsigned)sched_getcpu(), &here);
    if (CPU_COUNT(&here) > 0) sched_setaffinity(0, sizeof here, &here);
    for (uint32_t i = 0; i < times; i++)
        for (size_t at = 0; at < stream.len;) {
            const size_t left = stream.len - at;
            const ssize_t n = write(fd, stream.bytes + at, left < WRITE_BYTES ? left : WRITE_BYTES);
            if (n <= 0) _exit(1);
            at += (size_t)n;
        }
    _exit(0);
}

/* Sets `source`, which the client opens. Returns the sender, or -1. */
static pid_t send_by_tcp(uint32_t times, char *source, size_t len)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t at_len = sizeof at;
    const int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (listener < 0 || bind(listener, (struct sockaddr *)&at, sizeof at) != 0 || listen(listener, 1) != 0 ||
        getsockname(listener, (struct sockaddr *)&at, &at_len) != 0)
        return -1;
    snprintf(source, len, "tcp:127.0.0.1:%u", ntohs(at.sin_port));
    const pid_t pid = fork();
    if (pid == 0) write_all(accept(listener, NULL, NULL), times);
    close(listener);
    return pid;
}

static pid_t send_by_unix(uint32_t times, char *source, size_t len)
{
    int fd[2];
    if (socketpair(AF_UNIX, SOCK_STREAM, 0, fd) != 0) return -1;
    const pid_t pid = fork();
    if (pid == 0) {
        close(fd[1]);
        write_all(fd[0], times);
    }
    close(fd[0]);
    snprintf(source, len, "fd:%d", fd[1]);
    return pid;
}

static size_t fed;

static const uint8_t *feed(size_t *len)
{
    if (fed == stream.len) fed = 0;
    const uint8_t *data = stream.bytes + fed;
    if (*len > stream.len - fed) *len = stream.len - fed;
    fed += *len;
    return data;
}

static void send_by_usb(char *source, size_t len)
{
    fake_reset();
    bus.device[0] = (struct libusb_device){.present = 1, .maker = "scanhead", .product = "made", .serial = "1"};
    bus.feed = feed;
    fed = 0;
    snprintf(source, len, "usb");
}

/* ---- the client */

static struct scanhead_point points[MADE_BATCH];

static int take_frame(struct scanhead *sh, const struct scanhead_frame *frame, enum take take)
{
    int n = 0;
    for (uint32_t first = 0; take != TAKE_FRAMES && n >= 0 && first < frame->n_points; first += (uint32_t)n)
        n = take == TAKE_COLUMNS ? scanhead_columns(sh, frame, first, &made_columns, MADE_BATCH)
                                 : scanhead_points(sh, frame, first, points, MADE_BATCH);
    return n < 0 ? n : 0;
}

/* Takes frames until `wanted` points have come. */
static int take_points(struct scanhead *sh, enum take take, uint64_t wanted)
{
    struct scanhead_frame frame;
    int rc = 0;
    for (uint64_t taken = 0; rc == 0 && taken < wanted;) {
        rc = scanhead_next(sh, &frame, WAIT_MS);
        if (rc != 0 || frame.type != SCANHEAD_POINTS) continue;
        rc = take_frame(sh, &frame, take);
        taken += frame.n_points;
    }
    return rc;
}

/* Returns whether nothing is missing. The stream comes again and again, so its numbers begin again each time. */
static int is_whole(const struct scanhead *sh, uint32_t times)
{
    struct scanhead_stats stats;
    scanhead_get_stats(sh, &stats);
    return stats.seq_lost == 0 && stats.bad_bytes == 0 && stats.restarts < times + 1;
}

static int run_once(const struct options *o, enum way way, enum take take, struct figures *f, uint32_t round)
{
    char source[64], err[256] = "no sender";
    struct scanhead *sh = NULL;
    struct rusage sender = {.ru_utime = {0, 0}};
    pid_t pid = 0;
    if (way == BY_USB) send_by_usb(source, sizeof source);
    if (way == BY_TCP) pid = send_by_tcp(o->times, source, sizeof source);
    if (way == BY_UNIX) pid = send_by_unix(o->times, source, sizeof source);
    int rc = pid >= 0 ? scanhead_open(source, &sh, err, sizeof err) : SCANHEAD_EIO;
    if (rc != 0) fprintf(stderr, "live: %s: %s\n", WAY[way], err);
    const double begin_s = bench_thread_s(), n = (double)o->times * (double)stream.n_points;
    const int64_t begin_ns = monotonic_ns();
    if (rc == 0) rc = take_points(sh, take, o->times * stream.n_points);
    f->ns[round] = 1e9 * (bench_thread_s() - begin_s) / n;
    f->wall_ns[round] = (double)(monotonic_ns() - begin_ns) / n;
    if (sh != NULL && (rc != 0 || !is_whole(sh, o->times))) {
        fprintf(stderr, "live: %s: %s\n", WAY[way], rc != 0 ? scanhead_error(sh) : "frames are missing");
        rc = SCANHEAD_EFORMAT;
    }
    scanhead_close(sh);
    if (pid > 0) {
        if (rc != 0) kill(pid, SIGKILL);
        wait4(pid, NULL, 0, &sender);
    }
    f->sender_ns[round] = (1e9 * (double)(sender.ru_utime.tv_sec + sender.ru_stime.tv_sec) +
                           1e3 * (double)(sender.ru_utime.tv_usec + sender.ru_stime.tv_usec)) /
                          n;
    return rc;
}

static void print(const struct options *o, struct figures figures[WAYS][TAKES])
{
    if (!o->raw)
        printf("%-6s %-8s %10s %14s %12s %12s\n", "from", "as", "ns a point", "M points/s", "by the clock",
               "sender's ns");
    for (int way = 0; way < WAYS; way++)
        for (int take = 0; take < TAKES; take++) {
            struct figures *f = &figures[way][take];
            for (uint32_t i = 0; o->raw && i < o->rounds; i++)
                printf("%s:%s_ns %.3f\n", WAY[way], TAKE[take], f->ns[i]);
            if (o->raw) continue;
            const double ns = bench_median(f->ns, o->rounds), wall_ns = bench_median(f->wall_ns, o->rounds);
            printf("%-6s %-8s %10.2f %14.1f %12.1f %12.2f\n", WAY[way], TAKE[take], ns, 1e3 / ns, 1e3 / wall_ns,
                   bench_median(f->sender_ns, o->rounds));
        }
}

static int parse(struct options *o, int argc, char **argv)
{
    static const struct option table[] = {{"rounds", required_argument, NULL, 'r'},
                                          {"times", required_argument, NULL, 't'},
                                          {"raw", no_argument, NULL, 'w'},
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
    *o = (struct options){.rounds = 15, .times = 5};
    for (int c; (c = getopt_long(argc, argv, "", table, NULL)) >= 0;) {
        if (c == 'r') o->rounds = (uint32_t)strtoul(optarg, NULL, 10);
        if (c == 't') o->times = (uint32_t)strtoul(optarg, NULL, 10);
        if (c == 'w') o->raw = 1;
        if (c == 'h') fputs(HELP, stdout);
        if (c == 'h' || c == '?') return c == 'h' ? BENCH_OK : BENCH_USAGE;
    }
    if (optind == argc && o->rounds >= 1 && o->rounds <= MAX_ROUNDS && o->times >= 1 && o->times <= 1000) return -1;
    fprintf(stderr, "live: allowed are --rounds 1 to %d and --times 1 to 1000; see --help\n", MAX_ROUNDS);
    return BENCH_USAGE;
}

int main(int argc, char **argv)
{
    static struct figures figures[WAYS][TAKES];
    struct options o;
    int status = parse(&o, argc, argv);
    if (status >= 0) return status;
    signal(SIGPIPE, SIG_IGN);
    pin(&allowed);
    if (made_stream_create(MADE_POLAR, TICKS, &stream) != 0) {
        fprintf(stderr, "live: no memory\n");
        return BENCH_FAILED;
    }
    status = BENCH_OK;
    for (uint32_t round = 0; round < o.rounds && status == BENCH_OK; round++)
        for (int way = 0; way < WAYS && status == BENCH_OK; way++)
            for (int take = 0; take < TAKES && status == BENCH_OK; take++)
                if (run_once(&o, (enum way)way, (enum take)take, &figures[way][take], round) != 0)
                    status = BENCH_FAILED;
    if (status == BENCH_OK) print(&o, figures);
    free(stream.bytes);
    return status;
}
