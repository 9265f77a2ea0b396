/* SPDX-License-Identifier: MIT */
/* The packets of a capture: the file's blocks in, flows out. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/infile.h"
#include "drivers/protocol/pcap.h"
#include "firmware_sim/replay/capture_inside.h"

enum { FRONT_BYTES = 4096, MAX_FLOWS = 1000 };
static const size_t MAX_FILE = (size_t)2 << 30;
static const int64_t MAX_SPAN_NS = INT64_C(10000000000000000); /* sums of times then fit */
static const int64_t LEAST_STEP_NS = 100000000;                /* packets in a wrong order differ by less */

/* Reads until the file's first interface says which packets it has. */
static int is_of_packets(FILE *file, uint8_t **bytes)
{
    struct pcapng_reader reader = {0};
    struct pcapng_packet packet;
    struct sh_err err;
    size_t room = 0, n = 0, at = 0, used;
    for (;;) {
        if (!grow(bytes, &room, n + FRONT_BYTES, 1)) return 0;
        const size_t got = fread(*bytes + n, 1, room - n, file);
        n += got;
        if (at == 0 && n >= 4 && pcap_is(*bytes)) return 1;
        for (int item = PCAPNG_OTHER; item > 0; at += used) {
            item = pcapng_read(&reader, *bytes + at, n - at, &packet, &used, &err);
            if (item < 0) return 0;
            if (reader.n_interfaces != 0) return reader.interface[0].link != PCAPNG_USER0;
        }
        if (got == 0) return 0;
    }
}

int capture_is(const char *path)
{
    const char *why;
    uint8_t *bytes = NULL;
    FILE *file = infile_open(path, &why);
    if (file == NULL) return 0;
    const int is = is_of_packets(file, &bytes);
    free(bytes);
    fclose(file);
    return is;
}

static int read_file(struct replay_capture *c, const char *path, struct sh_err *err)
{
    const char *why;
    FILE *file = infile_open(path, &why);
    size_t room = 0, n = 1;
    if (file == NULL) return sh_fail(err, SH_EINPUT, "%s: cannot open: %s", path, why);
    int rc = SH_OK;
    while (n != 0 && rc == SH_OK) {
        if (c->file_len > MAX_FILE)
            rc = sh_fail(err, SH_EINPUT, "%s: the file is too long; allowed are up to 2 GiB", path);
        else if (!grow(&c->file, &room, c->file_len + (1 << 20), 1))
            rc = sh_fail(err, SH_ENOMEM, "%s: no memory for it", path);
        else
            c->file_len += n = fread(c->file + c->file_len, 1, room - c->file_len, file);
    }
    if (rc == SH_OK && ferror(file)) rc = sh_fail(err, SH_EIO, "%s: cannot read it", path);
    fclose(file);
    return rc;
}

/* ---- flows */

static int same_end(const struct ethernet_end *a, const struct ethernet_end *b)
{
    return a->is_v6 == b->is_v6 && a->port == b->port && memcmp(a->address, b->address, sizeof a->address) == 0;
}

/* Finds the flow of a packet, and the side that sent it. NULL: the packet begins a flow. A new connection may have the
 * addresses and ports of an older one. */
static struct capture_flow *find_flow(struct replay_capture *c, const struct ip_packet *p, uint8_t *side)
{
    const int begins = p->is_tcp && (p->flags & (TCP_SYN | TCP_ACK)) == TCP_SYN;
    for (size_t i = c->n_flows; i-- > 0;) {
        struct capture_flow *f = &c->flow[i];
        if (f->is_tcp != p->is_tcp) continue;
        const int forth = same_end(&f->end[0], &p->from) && same_end(&f->end[1], &p->to);
        const int back = same_end(&f->end[1], &p->from) && same_end(&f->end[0], &p->to);
        if (!forth && !back) continue;
        if (begins && (f->is_closed || f->n_sent[0] + f->n_sent[1] != 0)) return NULL;
        *side = !forth;
        return f;
    }
    return NULL;
}

static struct capture_flow *add_flow(struct replay_capture *c, const struct ip_packet *p, int64_t t_ns)
{
    if (!grow(&c->flow, &c->flow_room, c->n_flows + 1, sizeof *c->flow)) return NULL;
    struct capture_flow *f = &c->flow[c->n_flows++];
    *f = (struct capture_flow){.is_tcp = p->is_tcp, .end = {p->from, p->to}, .t0_ns = t_ns};
    return f;
}

static int add_packet(struct replay_capture *c, const struct ip_packet *p, int64_t t_ns, struct sh_err *err)
{
    uint8_t side = 0;
    struct capture_flow *f = find_flow(c, p, &side);
    if (f == NULL && c->n_flows == MAX_FLOWS)
        return sh_fail(
            err, SH_EINPUT,
            "too many connections; allowed are up to %d; a filter of tcpdump or Wireshark makes a smaller file",
            (int)MAX_FLOWS);
    if (f == NULL) f = add_flow(c, p, t_ns);
    if (f == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    if (p->is_tcp && (p->flags & TCP_SYN) != 0) {
        f->device = (p->flags & TCP_ACK) != 0 ? side : !side;
        f->has_begin = 1;
    }
    if (p->is_tcp && (p->flags & (TCP_FIN | TCP_RST)) != 0) f->is_closed = 1;
    /* Bytes that TCP lacks are counted when a stream is put together, since they may come again. */
    const uint32_t missing = p->is_tcp ? p->missing : 0;
    c->counts.missing_bytes += p->missing - missing;
    if (p->len + missing == 0 && (p->flags & TCP_SYN) == 0) return SH_OK;
    f->n_sent[side] += p->len != 0;
    f->bytes_sent[side] += p->len;
    if (!grow(&f->segment, &f->room, f->n + 1, sizeof *f->segment)) return sh_fail(err, SH_ENOMEM, "no memory");
    f->segment[f->n++] = (struct capture_segment){t_ns, p->data, p->len, p->seq, missing, (uint8_t)p->flags, side};
    return SH_OK;
}

/* Sets c->now_ns, the time of a packet since the first one. The time never goes back, since packets lie in the order in
 * which they came, whatever their times are. Where the clock was set back, later times count from there, so that the
 * delays between later packets are right. */
static int pass_time(struct replay_capture *c, const struct pcapng_packet *packet, struct sh_err *err)
{
    if (!packet->has_time) {
        c->counts.untimed++;
        return SH_OK;
    }
    if (packet->t_ns < 0)
        return sh_fail(err, SH_EFORMAT, "packet %llu has a time before 1970; allowed are times from then on",
                       (unsigned long long)c->counts.packets);
    if (!c->has_clock) c->clock_ns = packet->t_ns;
    c->has_clock = 1;
    const int64_t passed_ns = packet->t_ns - c->clock_ns; /* fits: both times are 0 or more */
    c->counts.backward += passed_ns < 0;
    if (passed_ns > MAX_SPAN_NS - c->now_ns)
        return sh_fail(err, SH_EFORMAT, "packet %llu comes %.3g s after the first; allowed are up to %.3g s",
                       (unsigned long long)c->counts.packets, 1e-9 * ((double)c->now_ns + (double)passed_ns),
                       1e-9 * (double)MAX_SPAN_NS);
    if (passed_ns > 0) c->now_ns += passed_ns;
    if (passed_ns > 0 || passed_ns < -LEAST_STEP_NS) c->clock_ns = packet->t_ns;
    return SH_OK;
}

static int take_packet(struct replay_capture *c, const struct pcapng_packet *packet, struct sh_err *err)
{
    struct ip_packet p;
    c->counts.packets++;
    const int rc = pass_time(c, packet, err);
    if (rc != SH_OK) return rc;
    switch (ip_packet_read(packet->link, packet->data, packet->len, &p)) {
    case IP_PACKET_FOUND:
        return add_packet(c, &p, c->now_ns, err);
    case IP_PACKET_FRAGMENT:
        c->counts.fragments++;
        return SH_OK;
    case IP_PACKET_DAMAGED:
        c->counts.damaged++;
        return SH_OK;
    case IP_PACKET_LINK:
        c->counts.unknown_links++;
        c->counts.unknown_link = packet->link;
        return SH_OK;
    case IP_PACKET_OTHER:
        c->counts.others++;
    }
    return SH_OK;
}

int capture_read_flows(struct replay_capture *c, const char *path, struct sh_err *err)
{
    struct pcapng_reader ng = {0};
    struct pcap_reader classic = {0};
    struct pcapng_packet packet;
    struct sh_err why = {0};
    int rc = read_file(c, path, err);
    if (rc != SH_OK) return rc;
    const int is_classic = c->file_len >= 4 && pcap_is(c->file);
    size_t at = 0, used;
    int item = PCAPNG_OTHER;
    while (at < c->file_len && item > 0 && rc == SH_OK) {
        item = is_classic ? pcap_read(&classic, c->file + at, c->file_len - at, &packet, &used, &why)
                          : pcapng_read(&ng, c->file + at, c->file_len - at, &packet, &used, &why);
        at += used;
        if (item == PCAPNG_PACKET) rc = take_packet(c, &packet, &why);
        if (rc == SH_OK) rc = sh_check_stop(c->report, &why);
    }
    if (item < 0 || rc != SH_OK) return sh_fail(err, item < 0 ? item : rc, "%s: %s", path, why.text);
    if (at < c->file_len)
        return sh_fail(err, SH_EFORMAT, "%s: at byte %zu: the file ends within a packet; allowed are whole files", path,
                       at);
    return SH_OK;
}
