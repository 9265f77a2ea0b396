/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/time_client.h"

#include <arpa/inet.h>
#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "drivers/protocol/ntp.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/device/scanner_clock.h"

#define SECOND_NS INT64_C(1000000000)
enum { MOST_HALVINGS = 10, MAX_PACKET = 512 };
static const int64_t LEAST_NS = SECOND_NS; /* between two requests, whatever changes meanwhile */

struct time_client {
    struct device *device;
    int64_t epoch_ns;
    int wake_fd, fd; /* fd: -1: no server is asked */
    _Atomic int ending;
    pthread_t thread;
    struct device_time_server server;
    struct command_time_answers answers;
    int64_t ask_ns;     /* clock: when to ask next; INT64_MAX: never */
    int64_t asked_ns;   /* clock: when it asked last */
    int64_t give_up_ns; /* clock: until when an answer is awaited; INT64_MAX: none is */
    int64_t t1_ns;      /* of the request, UTC by the scanner's clock */
    int64_t zone_ns;    /* how far the scanner's clock is ahead of UTC since it was set */
    int is_set;
    unsigned halvings; /* of the rate of requests */
};

static int64_t utc_now_ns(const struct time_client *c)
{
    return device_date_ns(c->device, clock_now_ns() - c->epoch_ns) - c->zone_ns;
}

/* `text` is reported where the state is a new one. */
static void time_client_say(struct time_client *c, const char *state, const char *text)
{
    char report[128];
    const uint8_t *a = c->server.set.address;
    const int is_new = c->answers.state == NULL || strcmp(c->answers.state, state) != 0;
    c->answers.state = state;
    if (text != NULL) snprintf(report, sizeof report, "%u.%u.%u.%u: %s", a[0], a[1], a[2], a[3], text);
    device_put_time_answers(c->device, &c->answers, is_new && text != NULL ? report : NULL);
}

/* ---- the server */

static int64_t period_ns(const struct time_client *c)
{
    return c->server.set.update_s * SECOND_NS << c->halvings;
}

static void close_server(struct time_client *c)
{
    if (c->fd >= 0) close(c->fd);
    c->fd = -1;
    c->ask_ns = c->give_up_ns = INT64_MAX;
    c->halvings = 0;
}

/* Where the machine has no route yet, the connection is tried again a period later. */
static void open_server(struct time_client *c)
{
    const int64_t now_ns = clock_now_ns(), soonest_ns = c->asked_ns + LEAST_NS;
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons(c->server.port)};
    memcpy(&at.sin_addr, c->server.set.address, sizeof c->server.set.address);
    c->fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (c->fd < 0 || connect(c->fd, (struct sockaddr *)&at, sizeof at) != 0) {
        close_server(c);
        c->ask_ns = now_ns + period_ns(c);
        time_client_say(c, "SILENT", "there is no way to this server");
        return;
    }
    c->ask_ns = now_ns > soonest_ns ? now_ns : soonest_ns;
    time_client_say(c, "ASKING", NULL);
}

/* Takes the settings as they are now. Where any of them has changed, or power was cycled, the requests begin anew. */
static void take_settings(struct time_client *c)
{
    struct device_time_server now;
    device_get_time_server(c->device, &now);
    const int same = now.asks == c->server.asks && now.refused == c->server.refused &&
                     now.power_ons == c->server.power_ons && memcmp(&now.set, &c->server.set, sizeof now.set) == 0;
    if (same) return;
    if (now.power_ons != c->server.power_ons) {
        c->answers = (struct command_time_answers){.max_offset_ns = now.max_offset_ns};
        c->zone_ns = c->is_set = 0;
    }
    if (now.set.n_roles != c->server.set.n_roles) c->is_set = 0;
    c->server = now;
    close_server(c);
    if (now.asks)
        open_server(c);
    else if (now.refused)
        time_client_say(c, "REFUSED", "is not asked, since it is not on this machine; see ntp.anywhere");
    else
        time_client_say(c, "OFF", NULL);
}

/* ---- requests and answers */

static void ask(struct time_client *c, int64_t now_ns)
{
    uint8_t packet[NTP_LEN];
    if (c->fd < 0) { /* there was no way to it */
        open_server(c);
        if (c->fd < 0) return;
    }
    c->asked_ns = now_ns;
    c->t1_ns = utc_now_ns(c);
    ntp_write_request(packet, c->t1_ns);
    (void)!send(c->fd, packet, sizeof packet, 0); /* if it is lost, no answer comes, which is reported */
    c->give_up_ns = now_ns + SECOND_NS;
    c->ask_ns += period_ns(c);
    if (c->ask_ns <= now_ns) c->ask_ns = now_ns + period_ns(c); /* the machine stood still */
}

static void give_up(struct time_client *c)
{
    c->give_up_ns = INT64_MAX;
    c->answers.none++;
    time_client_say(c, "SILENT", "no answer");
}

static void take_kiss(struct time_client *c, const char *kiss)
{
    char text[64];
    c->answers.refused++;
    const int ends = strcmp(kiss, "DENY") == 0 || strcmp(kiss, "RSTR") == 0;
    if (ends) c->ask_ns = INT64_MAX;
    if (strcmp(kiss, "RATE") == 0 && c->halvings < MOST_HALVINGS) {
        c->ask_ns += period_ns(c);
        c->halvings++;
    }
    snprintf(text, sizeof text, "kiss-o'-death %s%s", kiss, ends ? ", it is asked no more" : "");
    time_client_say(c, "KISS", text);
}

static void take_good(struct time_client *c, const struct ntp_answer *answer)
{
    const int64_t zone_ns = c->server.set.zone_h * 3600 * SECOND_NS, off_ns = answer->offset_ns;
    if (c->is_set && llabs(off_ns) > c->answers.max_offset_ns) {
        char text[96];
        snprintf(text, sizeof text, "%.6f s from the clock is beyond the limit of %.6f s", 1e-9 * (double)off_ns,
                 1e-9 * (double)c->answers.max_offset_ns);
        c->answers.refused++;
        time_client_say(c, "OFFSET", text);
        return;
    }
    if (!device_shift_date(c->device, &c->server, off_ns + zone_ns - c->zone_ns)) return;
    c->zone_ns = zone_ns;
    c->is_set = 1;
    c->answers.good++;
    c->answers.offset_ns = off_ns;
    c->answers.delay_ns = answer->delay_ns;
    time_client_say(c, "SET", NULL);
}

static void take_answer(struct time_client *c)
{
    uint8_t packet[MAX_PACKET];
    struct ntp_answer answer;
    const ssize_t len = recv(c->fd, packet, sizeof packet, 0);
    const int64_t t4_ns = utc_now_ns(c);
    if (len < NTP_LEN || c->give_up_ns == INT64_MAX) return; /* too short, or after the client gave up */
    /* Injected faults strike at answers to this request alone, and count them. */
    if (ntp_read_answer(packet, (size_t)len, c->t1_ns, t4_ns, &answer) == NTP_FOREIGN) return;
    if (device_change_time_answer(c->device, clock_now_ns() - c->epoch_ns, packet)) return;
    const enum ntp_kind kind = ntp_read_answer(packet, (size_t)len, c->t1_ns, t4_ns, &answer);
    c->give_up_ns = INT64_MAX;
    if (kind == NTP_GOOD) {
        take_good(c, &answer);
    } else if (kind == NTP_KISS) {
        take_kiss(c, answer.kiss);
    } else {
        c->answers.refused++;
        time_client_say(c, "UNSYNCHRONISED", "is not synchronised");
    }
}

/* ---- the thread */

/* Returns the milliseconds until a request is due or the wait for an answer ends, rounded up; -1: neither will. */
static int wait_ms(const struct time_client *c, int64_t now_ns)
{
    const int64_t at_ns = c->ask_ns < c->give_up_ns ? c->ask_ns : c->give_up_ns, most_ms = 1000000;
    if (at_ns == INT64_MAX) return -1;
    const int64_t ms = at_ns <= now_ns ? 0 : (at_ns - now_ns + 999999) / 1000000;
    return (int)(ms < most_ms ? ms : most_ms);
}

static void *time_client_main(void *arg)
{
    struct time_client *c = arg;
    eventfd_t n;
    take_settings(c);
    while (!atomic_load(&c->ending)) {
        struct pollfd slot[2] = {{.fd = c->wake_fd, .events = POLLIN}, {.fd = c->fd, .events = POLLIN}};
        if (poll(slot, 2, wait_ms(c, clock_now_ns())) < 0 && errno != EINTR) break;
        if (slot[1].revents != 0) take_answer(c);
        if (slot[0].revents != 0) eventfd_read(c->wake_fd, &n);
        if (slot[0].revents != 0) take_settings(c);
        const int64_t now_ns = clock_now_ns();
        if (now_ns >= c->give_up_ns) give_up(c);
        if (now_ns >= c->ask_ns) ask(c, now_ns);
    }
    return NULL;
}

static void time_client_free(struct time_client *c)
{
    close_server(c);
    if (c->wake_fd >= 0) close(c->wake_fd);
    free(c);
}

int time_client_start(struct device *device, int64_t epoch_ns, struct time_client **out, struct sh_err *err)
{
    struct time_client *c = calloc(1, sizeof *c);
    *out = NULL;
    if (c == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    c->device = device;
    c->epoch_ns = epoch_ns;
    c->fd = -1;
    c->ask_ns = c->give_up_ns = INT64_MAX;
    c->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    device_watch_time_server(device, c->wake_fd);
    const int rc = c->wake_fd < 0 ? errno : pthread_create(&c->thread, NULL, time_client_main, c);
    if (rc == 0) {
        *out = c;
        return SH_OK;
    }
    device_watch_time_server(device, -1);
    time_client_free(c);
    return sh_fail(err, SH_EIO, "no thread for the time server: %s", strerror(rc));
}

void time_client_join(struct time_client *c)
{
    if (c == NULL) return;
    device_watch_time_server(c->device, -1);
    atomic_store(&c->ending, 1);
    eventfd_write(c->wake_fd, 1);
    pthread_join(c->thread, NULL);
    time_client_free(c);
}
