/* SPDX-License-Identifier: MIT */
#include "tests/wire/captured.h"

#include "drivers/protocol/pcapng.h"

static void wait_ready(struct raw_recorder *recorder, int fd)
{
    char line[256] = "";
    size_t n = 0;
    for (ssize_t got = 1; got > 0 && n < sizeof line - 1; n += (size_t)(got > 0 ? got : 0)) {
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        if (poll(&slot, 1, DEADLINE_MS) != 1) fail_msg("the recorder does not get ready");
        got = read(fd, line + n, sizeof line - 1 - n);
    }
    close(fd);
    if (sscanf(line, "{\"endpoint\":\"%127[^\"]", recorder->endpoint) != 1) {
        wire_show(recorder->wire, "record.err");
        fail_msg("no line of the recorder: %s", line);
    }
}

static struct raw_recorder start(struct wire *wire, const char *program, const char *const *args)
{
    struct raw_recorder recorder = {.wire = wire};
    int ready[2];
    assert_int_equal(pipe2(ready, O_CLOEXEC), 0);
    recorder.pid = wire_spawn_program(wire, program, args, "record.out", "record.err", ready[1]);
    close(ready[1]);
    wait_ready(&recorder, ready[0]);
    return recorder;
}

struct raw_recorder raw_recorder_start(struct wire *wire, const char *source, const char *const *more)
{
    char file[352], stats[352];
    snprintf(file, sizeof file, "%s", wire_path(wire, "cap.pcapng"));
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    const char *args[WIRE_MAX_ARGS] = {"record", source, "--raw", "-o", file, "--stats", stats, "--ready-fd", "3"};
    for (int n = 9; more != NULL && *more != NULL; n++)
        args[n] = *more++;
    return start(wire, wire_program(), args);
}

struct raw_recorder raw_recorder_start_limited(struct wire *wire, const char *source, const char *blocks)
{
    char command[1024];
    snprintf(command, sizeof command, "ulimit -f %s; exec %s record %s --raw -o %s --ready-fd 3 3>&3", blocks,
             wire_program(), source, wire_path(wire, "cap.pcapng"));
    return start(wire, "/bin/sh", (const char *const[]){"-c", command, NULL});
}

void raw_recorder_end(struct raw_recorder *recorder, int signal_number, int status, const char *says)
{
    if (signal_number != 0) assert_int_equal(kill(recorder->pid, signal_number), 0);
    const int is = wire_wait(recorder->wire, recorder->pid);
    char *said = wire_read(wire_path(recorder->wire, "record.err"), NULL);
    if (is != status || (says != NULL && strstr(said, says) == NULL))
        fail_msg("status %d instead of %d, and it said, instead of \"%s\":\n%s", is, status, says != NULL ? says : "",
                 said);
    free(said);
}

void raw_recorder_stop(const struct raw_recorder *recorder)
{
    siginfo_t stopped;
    assert_int_equal(kill(recorder->pid, SIGSTOP), 0);
    assert_int_equal(waitid(P_PID, (id_t)recorder->pid, &stopped, WSTOPPED | WNOWAIT), 0);
}

int64_t raw_recorder_go_on(const struct raw_recorder *recorder)
{
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    assert_int_equal(kill(recorder->pid, SIGCONT), 0);
    return t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

/* ---- packets */

static uint32_t be(const uint8_t *at, int n)
{
    uint32_t v = 0;
    while (n-- > 0)
        v = v << 8 | *at++;
    return v;
}

static struct captured_packet dissect(const struct pcapng_packet *from)
{
    const uint8_t *ip = from->data + 14, *at = ip + 20;
    struct captured_packet p = {.t_ns = from->t_ns};
    assert_true(from->link == PCAPNG_ETHERNET && from->len == from->original_len && from->len >= 42);
    assert_int_equal(be(from->data + 12, 2), 0x0800);
    assert_int_equal(ip[0], 0x45);
    assert_int_equal(be(ip + 2, 2), from->len - 14);
    p.is_udp = ip[9] == 17;
    assert_true(p.is_udp || ip[9] == 6);
    p.from = be(ip + 12, 4);
    p.to = be(ip + 16, 4);
    p.from_port = (uint16_t)be(at, 2);
    p.to_port = (uint16_t)be(at + 2, 2);
    if (!p.is_udp) {
        p.seq = be(at + 4, 4);
        p.ack = be(at + 8, 4);
        p.flags = at[13];
    }
    p.data = at + (p.is_udp ? 8 : at[12] / 16 * 4);
    p.len = (size_t)(from->data + from->len - p.data);
    return p;
}

void captured_read(const struct wire *wire, struct captured *captured)
{
    struct pcapng_reader reader = {0};
    struct pcapng_packet packet;
    struct sh_err err = {0};
    size_t len, at = 0, used;
    int item;
    *captured = (struct captured){.bytes = wire_read(wire_path(wire, "cap.pcapng"), &len)};
    const uint8_t *bytes = (const uint8_t *)captured->bytes;
    while ((item = pcapng_read(&reader, bytes + at, len - at, &packet, &used, &err)) > 0) {
        at += used;
        if (item != PCAPNG_PACKET) continue;
        captured->packet = realloc(captured->packet, (captured->n + 1) * sizeof *captured->packet);
        assert_non_null(captured->packet);
        captured->packet[captured->n++] = dissect(&packet);
    }
    if (item < 0) fail_msg("%s", err.text);
    assert_int_equal(at, len);
}

void captured_free(struct captured *captured)
{
    free(captured->bytes);
    free(captured->packet);
}

uint8_t *captured_stream(const struct captured *captured, uint16_t from_port, size_t *len)
{
    uint8_t *bytes = malloc(strlen("") + 1);
    *len = 0;
    for (uint32_t i = 0; i < captured->n; i++) {
        const struct captured_packet *p = &captured->packet[i];
        if (p->from_port != from_port) continue;
        bytes = realloc(bytes, *len + p->len + 1);
        assert_non_null(bytes);
        memcpy(bytes + *len, p->data, p->len);
        *len += p->len;
    }
    return bytes;
}

void captured_check_order(const struct captured *captured)
{
    for (uint32_t i = 1; i < captured->n; i++)
        if (captured->packet[i].t_ns < captured->packet[i - 1].t_ns)
            fail_msg("packet %u is %lld ns older than the one before", i,
                     (long long)(captured->packet[i - 1].t_ns - captured->packet[i].t_ns));
}

void captured_check_talk(const struct captured *captured, uint16_t client_port, uint16_t server_port, int resets)
{
    enum { FIN = 1, SYN = 2, RST = 4, ACK = 16 };
    uint32_t next[2] = {0}, n = 0, last = 0, syns[2] = {0}, fins = 0;
    for (uint32_t i = 0; i < captured->n; i++) {
        const struct captured_packet *p = &captured->packet[i];
        const int side = p->from_port == server_port && p->to_port == client_port;
        if (p->is_udp || (!side && (p->from_port != client_port || p->to_port != server_port))) continue;
        assert_int_equal((p->flags & ACK) != 0, n > 0);
        assert_int_equal(p->flags & SYN, n < 2 ? SYN : 0); /* a SYN, one with an ACK, and no more */
        if (n < 2) assert_int_equal(side, n);
        if (syns[side]) assert_int_equal(p->seq, next[side]);
        if (n > 0) assert_int_equal(p->ack, next[!side]);
        next[side] = p->seq + (uint32_t)p->len + ((p->flags & (FIN | SYN)) != 0);
        syns[side] = 1;
        fins += p->flags & FIN;
        last = p->flags;
        n++;
    }
    assert_true(n > 3);
    if (resets)
        assert_true((last & RST) != 0);
    else
        assert_true(fins >= 1 && (last & RST) == 0);
}

int captured_check_tshark(const struct wire *wire)
{
    if (access("/usr/bin/tshark", X_OK) != 0) {
        print_message("/usr/bin/tshark is not there, so nobody else looks at the capture\n");
        return 0;
    }
    char file[352];
    snprintf(file, sizeof file, "%s", wire_path(wire, "cap.pcapng"));
    const char *const args[] = {
        "-n",
        "-r",
        file,
        "-o",
        "ip.check_checksum:TRUE",
        "-o",
        "udp.check_checksum:TRUE",
        "-o",
        "tcp.check_checksum:TRUE",
        "-Y",
        "_ws.malformed or tcp.analysis.flags or ip.checksum.status != 1 or udp.checksum.status != 1 or "
        "tcp.checksum.status != 1 or udp.length.bad",
        NULL};
    assert_int_equal(
        wire_wait((struct wire *)(uintptr_t)wire, wire_spawn_program((struct wire *)(uintptr_t)wire, "/usr/bin/tshark",
                                                                     args, "tshark.out", "tshark.err", -1)),
        0);
    char *found = wire_read(wire_path(wire, "tshark.out"), NULL);
    if (found[0] != '\0') fail_msg("tshark finds fault with:\n%.2000s", found);
    free(found);
    return 1;
}
