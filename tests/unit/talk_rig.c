/* SPDX-License-Identifier: MIT */
#include "tests/unit/talk_rig.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "drivers/protocol/pcapng.h"

const struct ethernet_end DRIVER = {.address = {10, 0, 0, 2}, .port = 40000};
const struct ethernet_end DEVICE = {.address = {10, 0, 0, 1}, .port = 2112};

void made_begin(struct made *m)
{
    memset(m, 0, sizeof *m);
    m->len = pcapng_put_section(m->bytes, "test");
    m->len += pcapng_put_interface(m->bytes + m->len, PCAPNG_ETHERNET, 0, NULL, NULL);
    m->talk.end[0] = DRIVER;
    m->talk.end[1] = DEVICE;
    m->talk.next[0] = 0xfffffff0u; /* its numbers wrap */
    m->talk.next[1] = 77;
}

void made_add(struct made *m, int64_t t_ms, const uint8_t *frame, size_t len)
{
    assert_true(m->len + len + 64 < sizeof m->bytes);
    m->len += pcapng_put_packet(m->bytes + m->len, 0, t_ms * MS, frame, len, 0);
}

void made_connect(struct made *m, int64_t t_ms)
{
    uint8_t frame[ETHERNET_MAX_FRAME];
    made_add(m, t_ms, frame, tcp_put_syn(&m->talk, 0, frame));
    made_add(m, t_ms, frame, tcp_put_syn(&m->talk, 1, frame));
    made_add(m, t_ms, frame, tcp_put_ack(&m->talk, 0, frame));
}

void made_say(struct made *m, int64_t t_ms, int side, const char *text)
{
    uint8_t frame[ETHERNET_MAX_FRAME];
    made_add(m, t_ms, frame, tcp_put_data(&m->talk, side, text, strlen(text), frame));
}

const char *made_write(const struct made *m, size_t len)
{
    static char path[64];
    snprintf(path, sizeof path, "/tmp/test_capture.%d.pcapng", (int)getpid());
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(m->bytes, 1, len, file), len);
    fclose(file);
    return path;
}

struct replay_capture *made_load(const struct made *m)
{
    struct replay_capture *capture;
    struct sh_err err = {0};
    const char *path = made_write(m, m->len);
    const int rc = capture_load(path, NULL, &capture, &err);
    unlink(path);
    if (rc != SH_OK) fail_msg("%s", err.text);
    return capture;
}

/* ---- a client */

static int client_send(void *ctx, const void *unit, size_t len)
{
    struct client *c = ctx;
    const size_t n = strlen(c->got);
    if (c->n_sent < 8) c->sent[c->n_sent++] = len;
    c->last = ((const char *)unit)[len - 1];
    snprintf(c->got + n, sizeof c->got - n, "%d:%.*s|", (int)c->now_ms, (int)len, (const char *)unit);
    return 0;
}

static void client_count(void *ctx, enum protocol_count what, uint64_t n)
{
    struct client *c = ctx;
    c->wrong += what == PROTOCOL_WRONG ? (int)n : 0;
    c->lost += what == PROTOCOL_INPUT_LOST ? n : 0;
}

static void client_hang_up(void *ctx)
{
    ((struct client *)ctx)->ended = 1;
}

static void client_tell_once(void *ctx, const char *text)
{
    snprintf(((struct client *)ctx)->told, 120, "%s", text);
}

void client_open(struct client *c, const struct made *m, uint32_t i, const struct talk_options *options)
{
    static const struct talk_options none = {0};
    struct replay_capture *capture = made_load(m);
    const struct protocol_spec spec = {.host = {.ctx = c,
                                                .send = client_send,
                                                .count = client_count,
                                                .hang_up = client_hang_up,
                                                .tell_once = client_tell_once},
                                       .talk = &capture_place(capture, i)->talk,
                                       .talk_options = options != NULL ? options : &none};
    struct sh_err err;
    memset(c, 0, sizeof *c);
    c->capture = capture;
    c->ops = protocol_ops_get(PROTOCOL_CAPTURE);
    assert_int_equal(protocol_create(c->ops, &spec, &c->protocol, &err), SH_OK);
    c->ops->open(c->protocol, 0);
}

const char *client_ask(struct client *c, const char *text, int ms)
{
    c->got[0] = '\0';
    for (; *text != '\0'; text++)
        c->ops->input(c->protocol, (const uint8_t *)text, 1);
    for (int i = 0; i < ms; i++) {
        c->ops->time(c->protocol, c->now_ms * MS);
        c->now_ms++;
    }
    return c->got;
}

void client_close(struct client *c)
{
    protocol_destroy(c->ops, c->protocol);
    capture_free(c->capture);
}
