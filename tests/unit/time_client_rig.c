/* SPDX-License-Identifier: MIT */
#include "tests/unit/time_client_rig.h"

#include <arpa/inet.h>
#include <dlfcn.h>
#include <errno.h>
#include <poll.h>
#include <semaphore.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <time.h>

#include "core/bytes.h"

#define SECONDS_1900 INT64_C(2208988800) /* from 1900 to 1970 */

const int64_t time_client_epoch_ns = 70 * S; /* device time 0 by the machine's clock */

int64_t now_ns; /* by the machine's clock, as the client sees it */
static sem_t waits, goes;
int waits_ms;       /* for so long the client wants to wait; -1: for ever */
static int is_free; /* its waits are the system's */
int is_interrupted; /* its next wait is */
int has_no_way, has_no_descriptors;
static _Thread_local int is_client;

/* These functions take the places of the C library's. ISO C has no cast from void * to a function. */
#define NEXT(name, next)                          \
    void *found_##name = dlsym(RTLD_NEXT, #name); \
    memcpy(&(next), &found_##name, sizeof(next))

int clock_gettime(clockid_t id, struct timespec *t)
{
    int (*next)(clockid_t, struct timespec *);
    NEXT(clock_gettime, next);
    if (!is_client || id != CLOCK_MONOTONIC) return next(id, t);
    *t = (struct timespec){.tv_sec = now_ns / S, .tv_nsec = now_ns % S};
    return 0;
}

int poll(struct pollfd *slot, nfds_t n, int ms)
{
    int (*next)(struct pollfd *, nfds_t, int);
    NEXT(poll, next);
    if (n != 2 || is_free) return next(slot, n, ms);
    is_client = 1;
    waits_ms = ms;
    sem_post(&waits);
    while (sem_wait(&goes) != 0)
        continue;
    if (!is_interrupted) return next(slot, n, 0);
    is_interrupted = 0;
    errno = EINTR;
    return -1;
}

int connect(int fd, const struct sockaddr *to, socklen_t len)
{
    int (*next)(int, const struct sockaddr *, socklen_t);
    NEXT(connect, next);
    errno = ENETUNREACH;
    return has_no_way ? -1 : next(fd, to, len);
}

int eventfd(unsigned count, int flags)
{
    int (*next)(unsigned, int);
    NEXT(eventfd, next);
    errno = EMFILE;
    return has_no_descriptors ? -1 : next(count, flags);
}

/* ---- the client */

struct rig *rig;
static struct time_client *client;

static void await_client(void)
{
    while (sem_wait(&waits) != 0)
        continue;
}

void turn_after(int64_t ns)
{
    now_ns += ns;
    sem_post(&goes);
    await_client();
}

/* ---- the server */

static int server_fd;
uint8_t request[48];
static struct sockaddr_in asker;

static int64_t time_at(const uint8_t *p)
{
    return ((int64_t)be_get32(p) - SECONDS_1900) * S + (int64_t)((be_get32(p + 4) * (uint64_t)S) >> 32);
}

static void put_time(uint8_t *p, int64_t ns)
{
    be_put32(p, (uint32_t)(ns / S + SECONDS_1900));
    be_put32(p + 4, (uint32_t)(((uint64_t)(ns % S) << 32) / (uint64_t)S));
}

int has_asked(void)
{
    socklen_t len = sizeof asker;
    return recvfrom(server_fd, request, sizeof request, MSG_DONTWAIT, (struct sockaddr *)&asker, &len) ==
           (ssize_t)sizeof request;
}

void expect_request(int64_t t1_ns)
{
    assert_true(has_asked());
    assert_int_equal(request[0], 0x23); /* version 4, client */
    assert_true(time_at(request + 40) == t1_ns);
    assert_false(has_asked());
}

void answer_after(int64_t ns, struct answer a)
{
    uint8_t packet[48] = {0};
    packet[0] = (uint8_t)(a.leap << 6 | 4 << 3 | 4);
    packet[1] = (uint8_t)a.stratum;
    if (a.kiss != NULL) memcpy(packet + 12, a.kiss, 4);
    memcpy(packet + 24, request + 40, 8);
    put_time(packet + 32, a.t2_ns);
    put_time(packet + 40, a.t3_ns);
    assert_int_equal(sendto(server_fd, packet, a.len, 0, (struct sockaddr *)&asker, sizeof asker), a.len);
    turn_after(ns);
}

void answer_with(int64_t t_ns)
{
    answer_after(0, (struct answer){t_ns, t_ns, 0, 1, NULL, 48});
}

void kiss_with(const char *kiss)
{
    answer_after(0, (struct answer){0, 0, 0, 0, kiss, 48});
}

/* ---- a test */

static int first_free; /* descriptor, before the test */

static int find_free(void)
{
    const int fd = dup(STDIN_FILENO);
    close(fd);
    return fd;
}

int time_client_setup(void **state)
{
    (void)state;
    struct sockaddr_in at = {.sin_family = AF_INET};
    socklen_t len = sizeof at;
    char port[32];
    struct sh_err err;
    is_free = is_interrupted = has_no_way = has_no_descriptors = 0;
    now_ns = time_client_epoch_ns + S;
    server_fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    inet_pton(AF_INET, "127.1.2.3", &at.sin_addr);
    if (bind(server_fd, (struct sockaddr *)&at, sizeof at) != 0 ||
        getsockname(server_fd, (struct sockaddr *)&at, &len) != 0)
        return -1;
    snprintf(port, sizeof port, "ntp.port=%d", ntohs(at.sin_port));
    const char *const sets[] = {port, "ntp.max_offset_s=2", "ntp.address=127.1.2.3"};
    first_free = find_free();
    sem_init(&waits, 0, 0);
    sem_init(&goes, 0, 0);
    rig = rig_open(NULL, sets, 3);
    rig_go_to(rig, 300); /* it has booted */
    need(time_client_start(rig->device, time_client_epoch_ns, &client, &err), &err);
    await_client();
    return 0;
}

int time_client_teardown(void **state)
{
    (void)state;
    is_free = 1;
    sem_post(&goes);
    time_client_join(client);
    rig_close(rig);
    sem_destroy(&waits);
    sem_destroy(&goes);
    assert_int_equal(find_free(), first_free); /* the client has closed what it opened */
    return close(server_fd);
}

void set_server(const char *role, int period_s, int zone_h)
{
    char line[80];
    snprintf(line, sizeof line, "TIME:SERV %s,127.1.2.3,%d,%d,ETH", role, period_s, zone_h);
    rig_tell(rig, line, rig->next);
    turn_after(0);
}

void expect_state(const char *state, int64_t offset_ns, int64_t delay_ns, int good, int refused, int none)
{
    char text[160];
    snprintf(text, sizeof text, "%s,2000000000,%lld,%lld,%d,%d,%d", state, (long long)offset_ns, (long long)delay_ns,
             good, refused, none);
    assert_string_equal(rig_tell(rig, "TIME:SERV? STATE", rig->next), text);
}

void expect_error(const char *text)
{
    char error[160];
    snprintf(error, sizeof error, text != NULL ? "107,\"Time server; %s\"" : "0,\"No error\"", text);
    assert_string_equal(rig_tell(rig, "SYST:ERR?", rig->next), error);
}

int64_t date_ns(void)
{
    return device_date_ns(rig->device, now_ns - time_client_epoch_ns);
}

void set_clock(int period_s, int zone_h, int64_t t_ns)
{
    set_server("CLIENT", period_s, zone_h);
    assert_true(has_asked());
    answer_with(t_ns);
}
