/* SPDX-License-Identifier: MIT */
/* `record --raw` of UDP: one socket for each port. Each datagram becomes one Ethernet frame of the capture. */
#include <stdlib.h>
#include <string.h>

#include "drivers/socket/socket.h"
#include "firmware_sim/app/studio/record/raw.h"
#include "firmware_sim/app/studio/record/raw_order.h"
#include "firmware_sim/base/clock.h"

enum { RETRY_MS = 100 };

struct port {
    struct raw_input input; /* the first member: a pointer to it also points to the struct port */
    struct raw *r;
    struct stamped_socket socket;
    struct stamped_datagram datagram;
    uint64_t packets, bytes;
    uint32_t dropped; /* before the last packet */
    uint32_t interface;
    char name[160];
    uint8_t data[65536];
};

struct udp {
    uint32_t n;
    struct port *port;
    uint8_t frame[ETHERNET_MAX_FRAME];
};

static int raw_udp_take(struct raw_input *input, struct sh_err *err)
{
    struct port *p = (struct port *)input;
    const int rc = stamped_take(&p->socket, p->data, sizeof p->data, &p->datagram, err);
    input->t_ns = p->datagram.t_ns;
    return rc;
}

static int pass(struct raw_input *input, struct sh_err *err)
{
    struct port *p = (struct port *)input;
    struct udp *udp = p->r->state;
    const struct ethernet_end from = raw_end_of(&p->datagram.from), to = raw_end_of(&p->datagram.to);
    const size_t len = ethernet_put_udp(udp->frame, &from, &to, p->data, p->datagram.len);
    p->packets++;
    p->bytes += p->datagram.len;
    const struct capture_frame frame = {.interface = p->interface,
                                        .t_ns = input->t_ns,
                                        .bytes = udp->frame,
                                        .len = len,
                                        .lost = p->datagram.dropped - p->dropped};
    p->dropped = p->datagram.dropped;
    return raw_write(p->r, &frame, p->datagram.len, err);
}

static int open_port(struct raw *r, struct port *p, int number, struct sh_err *err)
{
    char at[80];
    p->r = r;
    p->input = (struct raw_input){.take = raw_udp_take, .pass = pass};
    const int rc = stamped_open(r->place.host, number, &p->socket, err);
    if (rc != SH_OK) return rc;
    socket_address_text((struct sockaddr *)&p->socket.own, p->socket.own_len, at, sizeof at);
    snprintf(p->name, sizeof p->name, "udp:%s", at);
    p->interface = r->capture.n_interfaces;
    return capture_add_interface(
        &r->capture, p->name, "Datagrams that scanhead received, with rebuilt headers; times are the kernel's.", err);
}

/* The address may appear late, with an interface that is not up yet. Where it never appears, open_port says why. */
static void wait_for_address(const struct raw *r)
{
    struct stamped_socket probe;
    struct sh_err why;
    const int64_t end_ns = clock_now_ns() + (int64_t)(1e9 * r->wait_s);
    while (stamped_open(r->place.host, 0, &probe, &why) != SH_OK && clock_now_ns() < end_ns && !app_interrupted())
        poll(NULL, 0, RETRY_MS);
    stamped_close(&probe);
}

static int udp_open(struct raw *r, struct sh_err *err)
{
    struct udp *udp = calloc(1, sizeof *udp);
    r->state = udp;
    if (udp == NULL || (udp->port = calloc((size_t)r->place.n_ports, sizeof *udp->port)) == NULL)
        return sh_fail(err, SH_ENOMEM, "no memory for %d sockets", r->place.n_ports);
    wait_for_address(r);
    int rc = SH_OK;
    for (int i = 0; i < r->place.n_ports && rc == SH_OK; i++) {
        udp->port[i].socket.fd = -1;
        udp->n++;
        rc = open_port(r, &udp->port[i], r->place.port[i], err);
    }
    if (rc == SH_OK) snprintf(r->endpoint, sizeof r->endpoint, "%s", udp->port[0].name);
    for (uint32_t i = 1; i < udp->n && rc == SH_OK; i++) {
        const size_t at = strlen(r->endpoint);
        snprintf(r->endpoint + at, sizeof r->endpoint - at, ",%s", strrchr(udp->port[i].name, ':') + 1);
    }
    if (rc == SH_OK && !r->quiet) fprintf(stderr, "scanhead: datagrams are taken at %s\n", r->endpoint);
    return rc;
}

static int udp_wait_for(struct raw *r, struct pollfd *fds, int *timeout_ms)
{
    const struct udp *udp = r->state;
    (void)timeout_ms;
    for (uint32_t i = 0; i < udp->n; i++)
        fds[i] = (struct pollfd){.fd = udp->port[i].socket.fd, .events = POLLIN};
    return (int)udp->n;
}

static int udp_work(struct raw *r, struct sh_err *err)
{
    struct udp *udp = r->state;
    struct raw_input *input[RAW_MAX_PORTS];
    for (uint32_t i = 0; i < udp->n; i++)
        input[i] = &udp->port[i].input;
    return raw_pass_in_order(input, (int)udp->n, RAW_MAX_PASSES, err);
}

static int udp_finish(struct raw *r, struct sh_err *err)
{
    const struct udp *udp = r->state;
    const int64_t now_ns = stamped_now_ns(), t_ns = now_ns > r->last_t_ns ? now_ns : r->last_t_ns;
    int rc = SH_OK;
    for (uint32_t i = 0; i < udp->n && rc == SH_OK; i++) {
        const struct port *p = &udp->port[i];
        const uint64_t dropped = stamped_dropped(&p->socket);
        rc = capture_add_statistics(&r->capture, p->interface, t_ns, p->packets + dropped, dropped, err);
    }
    return rc;
}

static uint64_t udp_dropped(const struct raw *r)
{
    const struct udp *udp = r->state;
    uint64_t sum = 0;
    for (uint32_t i = 0; udp != NULL && i < udp->n; i++)
        sum += stamped_dropped(&udp->port[i].socket);
    return sum;
}

static int udp_check(const struct raw *r, struct sh_err *err)
{
    const uint64_t dropped = udp_dropped(r);
    if (dropped == 0) return SH_OK;
    return sh_fail(
        err, SH_ELOST,
        "%s: the recording is not complete: the system dropped %llu packets; a larger net.core.rmem_max gives it more "
        "room",
        r->in.operand[0], (unsigned long long)dropped);
}

static void udp_put(struct json *json, const struct raw *r)
{
    const struct udp *udp = r->state;
    json_open_array(json, "sources");
    for (uint32_t i = 0; i < udp->n; i++) {
        const struct port *p = &udp->port[i];
        json_open_object(json, NULL);
        json_string(json, "endpoint", p->name);
        json_uint(json, "packets", p->packets);
        json_uint(json, "bytes", p->bytes);
        json_uint(json, "dropped", stamped_dropped(&p->socket));
        json_close_object(json);
    }
    json_close_array(json);
}

static void udp_close(struct raw *r)
{
    struct udp *udp = r->state;
    for (uint32_t i = 0; udp != NULL && i < udp->n; i++)
        stamped_close(&udp->port[i].socket);
    if (udp != NULL) free(udp->port);
    free(udp);
}

const struct raw_ops raw_udp = {
    .open = udp_open,
    .wait_for = udp_wait_for,
    .work = udp_work,
    .finish = udp_finish,
    .check = udp_check,
    .put = udp_put,
    .dropped = udp_dropped,
    .close = udp_close,
};
