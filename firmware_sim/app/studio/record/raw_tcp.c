/* SPDX-License-Identifier: MIT */
/* `record --raw` of TCP: a connection of this program's own, or those of clients that it passes on. */
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "drivers/socket/socket.h"
#include "firmware_sim/app/studio/record/raw_talk.h"
#include "firmware_sim/base/clock.h"

enum { MAX_TALKS = 16, CONNECT_MS = 5000, RETRY_MS = 100 };

struct tcp {
    int listen_fd; /* of the relay; -1: none */
    uint64_t connections, refused, received[2];
    struct talk talk[MAX_TALKS]; /* without a relay the first one alone */
};

/* ---- opening */

static int connect_device(const struct raw *r, int *fd, struct sh_err *err)
{
    return stamped_connect(r->place.host, r->place.port[0], CONNECT_MS, fd, err);
}

/* The device may come up late. */
static int connect_first(struct raw *r, struct tcp *tcp, struct sh_err *err)
{
    const int64_t end_ns = clock_now_ns() + (int64_t)(1e9 * r->wait_s);
    int fd[2] = {-1, -1}, rc;
    int64_t began_ns;
    do {
        began_ns = stamped_now_ns();
        rc = connect_device(r, &fd[1], err);
    } while (rc != SH_OK && clock_now_ns() < end_ns && !app_interrupted() && poll(NULL, 0, RETRY_MS) >= -1);
    if (rc != SH_OK) return rc;
    tcp->connections = 1;
    return talk_open(&tcp->talk[0], r, fd, began_ns, err);
}

static int listen_for_clients(struct raw *r, struct tcp *tcp, struct sh_err *err)
{
    char name[80];
    const struct socket_place place = {.what = "--relay", .host = r->clients.host, .port = r->clients.port[0]};
    const int rc = socket_open(&place, &tcp->listen_fd, name, sizeof name, err);
    if (rc != SH_OK) return rc;
    stamped_enable(tcp->listen_fd); /* for the connections that it takes */
    snprintf(r->endpoint, sizeof r->endpoint, "tcp:%s", name);
    if (!r->quiet) fprintf(stderr, "scanhead: clients connect to %s\n", r->endpoint);
    return SH_OK;
}

static int tcp_open(struct raw *r, struct sh_err *err)
{
    struct tcp *tcp = calloc(1, sizeof *tcp);
    r->state = tcp;
    if (tcp == NULL) return sh_fail(err, SH_ENOMEM, "no memory for connections");
    tcp->listen_fd = -1;
    snprintf(r->endpoint, sizeof r->endpoint, "%s", r->in.operand[0]);
    const int rc =
        capture_add_interface(&r->capture, r->in.operand[0],
                              "TCP connections that scanhead had, as rebuilt frames; times are the kernel's.", err);
    if (rc != SH_OK) return rc;
    return r->relay != NULL ? listen_for_clients(r, tcp, err) : connect_first(r, tcp, err);
}

/* ---- clients */

static struct talk *find_unused(struct tcp *tcp)
{
    for (int i = 0; i < MAX_TALKS; i++)
        if (!tcp->talk[i].is_used) return &tcp->talk[i];
    return NULL;
}

/* Where the device takes no connection, the client's is reset. Such a reset is no failure of the recording. */
static int join(struct raw *r, struct talk *talk, int client, const char *name, struct sh_err *err)
{
    struct tcp *tcp = r->state;
    struct sh_err why = {0};
    int fd[2] = {client, -1};
    const int64_t began_ns = stamped_now_ns();
    int rc = connect_device(r, &fd[1], &why);
    if (rc == SH_OK) {
        tcp->connections++;
        socket_tune(client);
        rc = talk_open(talk, r, fd, began_ns, &why);
        if (rc == SH_OK) return SH_OK;
        if (rc != SH_ELOST) return sh_fail(err, rc, "%s", why.text);
        talk_close(talk);
    } else {
        socket_break(client);
        close(client);
    }
    tcp->refused++;
    sh_warn(&app_report_stderr, "client %s: %s", name, why.text);
    return SH_OK;
}

static int accept_clients(struct raw *r, struct sh_err *err)
{
    struct tcp *tcp = r->state;
    struct talk *talk;
    int rc = SH_OK;
    while (rc == SH_OK && tcp->listen_fd >= 0 && (talk = find_unused(tcp)) != NULL) {
        struct sockaddr_storage from;
        socklen_t len = sizeof from;
        const int fd = accept4(tcp->listen_fd, (struct sockaddr *)&from, &len, SOCK_NONBLOCK | SOCK_CLOEXEC);
        if (fd < 0) break;
        socket_address_text((struct sockaddr *)&from, len, talk->name, sizeof talk->name);
        rc = join(r, talk, fd, talk->name, err);
    }
    return rc;
}

/* ---- the recording */

static int tcp_wait_for(struct raw *r, struct pollfd *fds, int *timeout_ms)
{
    struct tcp *tcp = r->state;
    int n = 0;
    for (int i = 0; i < MAX_TALKS; i++)
        if (tcp->talk[i].is_used) n += talk_wait_for(&tcp->talk[i], fds + n, timeout_ms);
    if (tcp->listen_fd >= 0 && find_unused(tcp) != NULL)
        fds[n++] = (struct pollfd){.fd = tcp->listen_fd, .events = POLLIN};
    return n;
}

static void end_talk(struct raw *r, struct talk *talk)
{
    struct tcp *tcp = r->state;
    for (int i = 0; i < 2; i++)
        tcp->received[i] += talk->end[i].received;
    if (talk->was_reset && tcp->listen_fd >= 0)
        sh_warn(&app_report_stderr, "client %s: the connection was reset", talk->name);
    r->over = tcp->listen_fd < 0;
    talk_close(talk);
}

static int tcp_work(struct raw *r, struct sh_err *err)
{
    struct tcp *tcp = r->state;
    struct raw_input *input[2 * MAX_TALKS];
    int n = 0, rc = accept_clients(r, err);
    for (int i = 0; i < MAX_TALKS && rc == SH_OK; i++) {
        struct talk *talk = &tcp->talk[i];
        if (!talk->is_used) continue;
        rc = talk_push(talk, err);
        input[n++] = &talk->end[0].input;
        input[n++] = &talk->end[1].input;
    }
    const int passed = rc == SH_OK ? raw_pass_in_order(input, n, RAW_MAX_PASSES, err) : rc;
    for (int i = 0; i < MAX_TALKS; i++)
        if (tcp->talk[i].is_used && tcp->talk[i].is_over) end_talk(r, &tcp->talk[i]);
    return passed;
}

static int tcp_finish(struct raw *r, struct sh_err *err)
{
    struct tcp *tcp = r->state;
    int rc = SH_OK;
    for (int i = 0; i < MAX_TALKS && rc == SH_OK; i++) {
        if (!tcp->talk[i].is_used) continue;
        rc = talk_finish(&tcp->talk[i], err);
        tcp->talk[i].was_reset = 0;
        end_talk(r, &tcp->talk[i]);
    }
    return rc;
}

static int tcp_check(const struct raw *r, struct sh_err *err)
{
    const struct tcp *tcp = r->state;
    const struct talk *talk = &tcp->talk[0];
    const char *source = r->in.operand[0];
    if (tcp->listen_fd >= 0) return SH_OK;
    if (talk->was_reset) return sh_fail(err, SH_ELOST, "%s: the device broke the connection", source);
    if (talk->next_send < r->n_sends)
        return sh_fail(err, SH_ECLOSED, "%s: %d of %d --send were not sent: the recording ended before", source,
                       r->n_sends - talk->next_send, r->n_sends);
    if (tcp->received[1] != 0) return SH_OK;
    return sh_fail(
        err, SH_ETIMEOUT,
        "%s: the device sent nothing; most devices send only after a command: use --send TEXT, or --relay PORT for "
        "their driver",
        source);
}

static void tcp_put(struct json *json, const struct raw *r)
{
    const struct tcp *tcp = r->state;
    json_uint(json, "connections", tcp->connections);
    json_uint(json, "refused_connections", tcp->refused);
    json_uint(json, "sent_bytes", tcp->received[0]);
    json_uint(json, "received_bytes", tcp->received[1]);
}

static uint64_t tcp_dropped(const struct raw *r)
{
    (void)r;
    return 0; /* TCP loses nothing */
}

static void tcp_close(struct raw *r)
{
    struct tcp *tcp = r->state;
    if (tcp == NULL) return;
    for (int i = 0; i < MAX_TALKS; i++)
        talk_close(&tcp->talk[i]);
    if (tcp->listen_fd >= 0) close(tcp->listen_fd);
    free(tcp);
}

const struct raw_ops raw_tcp = {
    .open = tcp_open,
    .wait_for = tcp_wait_for,
    .work = tcp_work,
    .finish = tcp_finish,
    .check = tcp_check,
    .put = tcp_put,
    .dropped = tcp_dropped,
    .close = tcp_close,
};
