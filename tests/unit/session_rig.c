/* SPDX-License-Identifier: MIT */
#include "tests/unit/session_rig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/native_encode.h"

enum { CAP = 4096 };

struct pump pump;
struct stream stream;
struct links links;
static struct device_counters counters;
struct session *const s = &pump.session[2];
struct protocol_spec spec;
char logged[2048], stored[SETTINGS_FILE_TEXT], warned[256];
int n_warned;

__attribute__((format(printf, 1, 2))) static void note(const char *fmt, ...)
{
    const size_t len = strlen(logged);
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(logged + len, sizeof logged - len, fmt, ap);
    va_end(ap);
}

void expect_log(const char *text)
{
    assert_string_equal(logged, text);
    logged[0] = '\0';
}

/* ---- the protocol */

struct doings does;

static int create(void *protocol, struct sh_err *err)
{
    (void)err;
    memcpy(&spec, protocol, sizeof spec);
    note("create %s|", spec.stored);
    return SH_OK;
}

static void destroy(void *protocol)
{
    (void)protocol;
    note("destroy|");
}

static void opened(void *protocol, int64_t t_ns)
{
    (void)protocol;
    note("open %lld|", (long long)t_ns / TICK_NS);
}

static void take_frame(void *protocol, const uint8_t *frame, size_t len)
{
    struct native_header h;
    (void)protocol;
    native_read_header(frame, &h);
    assert_int_equal(len, native_frame_len(frame));
    note("frame %u at %lld|", h.seq, (long long)h.t_ns);
}

static void gap(void *protocol, uint32_t n)
{
    (void)protocol;
    note("gap %u|", n);
}

static void pass(void *protocol, int64_t t_ns)
{
    (void)protocol;
    note("%lld|", (long long)t_ns / TICK_NS);
}

static void input(void *protocol, const uint8_t *bytes, size_t len)
{
    (void)protocol;
    note("in %zu %c|", len, bytes[0]);
    if (bytes[0] == '!') spec.host.hang_up(spec.host.ctx);
    for (int i = 0; i < does.n_answers; i++)
        spec.host.send(spec.host.ctx, "answer", 6);
}

static size_t takes(const void *protocol)
{
    (void)protocol;
    return does.takes;
}

static int owes(const void *protocol)
{
    (void)protocol;
    return does.owes;
}

static int64_t next_ns(const void *protocol)
{
    (void)protocol;
    return does.next_ns;
}

static const struct protocol_ops all = {.name = "own",
                                        .max_unit = 256,
                                        .size = sizeof(struct protocol_spec),
                                        .begin = create,
                                        .end = destroy,
                                        .open = opened,
                                        .frame = take_frame,
                                        .gap = gap,
                                        .time = pass,
                                        .input = input,
                                        .takes = takes,
                                        .owes = owes,
                                        .next_ns = next_ns};

/* ---- the link */

size_t link_room;
ssize_t link_fails;

static ssize_t link_write(void *link, int session, const void *buf, size_t len)
{
    const size_t n = len < link_room ? len : link_room;
    (void)link;
    assert_int_equal(session, 2);
    if (link_fails != 0) return link_fails;
    note("out %.*s|", (int)n, (const char *)buf);
    return (ssize_t)n;
}

static void link_end(void *link, int session)
{
    (void)link;
    note("end %d|", session);
}

static void link_endpoint(const void *link, char *buf, size_t len)
{
    (void)link;
    snprintf(buf, len, "here");
}

struct link_ops own_link = {.name = "own", .write = link_write, .end = link_end, .endpoint = link_endpoint};

/* ---- the source: each call has self, and the answer depends on what it was given */

static int self;

static void command_once(void *me, uint32_t session, const char *line, uint64_t released, struct command_result *out)
{
    assert_ptr_equal(me, &self);
    memset(out, 0, sizeof *out);
    out->error = -7;
    snprintf(out->reply, sizeof out->reply, "%u %s %u", session, line, (unsigned)released);
}

static int64_t plus_1(void *me, int64_t t_ns)
{
    assert_ptr_equal(me, &self);
    return t_ns + 1;
}

static int64_t plus_2(void *me, int64_t t_ns)
{
    assert_ptr_equal(me, &self);
    return t_ns + 2;
}

static int give_fix(void *me, int64_t t_ns, struct nmea_fix *fix)
{
    assert_ptr_equal(me, &self);
    fix->lat_deg = (double)t_ns;
    return 5;
}

static enum protocol_pps give_pps(void *me, int64_t t_ns, int64_t *hour_ns)
{
    assert_ptr_equal(me, &self);
    *hour_ns = t_ns + 3;
    return PROTOCOL_PPS_ERROR;
}

static struct device_power_up last_power(void *me, int64_t t_ns)
{
    assert_ptr_equal(me, &self);
    assert_int_equal(t_ns, (int64_t)s->cursor * TICK_NS);
    return (struct device_power_up){.t_ns = 4 * TICK_NS, .ons = 3, .near_wrap = 9};
}

static int store(void *me, const char *name, const char *text)
{
    assert_ptr_equal(me, &self);
    note("store %s %s|", name, text);
    return 0;
}

static int give_stored(const void *me, const char *name, char text[SETTINGS_FILE_TEXT])
{
    assert_ptr_equal(me, &self);
    assert_string_equal(name, "own");
    strcpy(text, stored);
    return 0;
}

static double loss(void *me)
{
    assert_ptr_equal(me, &self);
    return 1.5;
}

static void report(void *me, int number, const char *text)
{
    assert_ptr_equal(me, &self);
    note("report %s|", number == CMD_E_READER ? "reader" : text);
}

static void session_opened(void *me, uint32_t session, const char *who)
{
    assert_ptr_equal(me, &self);
    note("session %u %s|", session, who);
}

uint64_t n_refused;

static void observe_refused(void *ctx, uint32_t session, const char *line, const char *reply)
{
    (void)ctx;
    assert_true(session == 3 && line == NULL && reply == NULL);
    n_refused++;
}

static void observe_session(void *ctx, uint32_t session, int begins, const char *peer, int64_t t_ns)
{
    (void)ctx, (void)session, (void)begins, (void)peer, (void)t_ns;
}

static void observe_heard(void *ctx, uint32_t session, const void *bytes, size_t len)
{
    (void)ctx;
    note("heard %u %.*s|", session, (int)len, (const char *)bytes);
}

struct loop_source_ops own_source;
static const struct loop_source source = {&own_source, &self};
static const struct links_observer observer = {NULL, observe_session, observe_heard, observe_refused};

static void warn(void *ctx, const char *text)
{
    (void)ctx;
    snprintf(warned, sizeof warned, "%s", text);
    n_warned++;
}

static const struct sh_report to_test = {.warn = warn};

static int64_t no_time(void *owner)
{
    (void)owner;
    return 0;
}

/* ---- a test */

int session_setup(void **state)
{
    (void)state;
    static const struct ring_size size = {.ahead_ticks = 2, .queue_ticks = QUEUE, .spare_ticks = 1, .usual_bytes = 256};
    static const struct link_spec null_link = {.type = LINK_NULL};
    struct sh_err err;
    memset(&pump, 0, sizeof pump);
    memset(&stream, 0, sizeof stream);
    memset(&counters, 0, sizeof counters);
    memset(&does, 0, sizeof does);
    does.takes = SIZE_MAX;
    stored[0] = logged[0] = warned[0] = '\0';
    n_warned = 0;
    n_refused = 0;
    link_room = SIZE_MAX;
    link_fails = 0;
    own_link.end = link_end;
    own_link.datagrams = 0;
    own_source = (struct loop_source_ops){.command_once = command_once,
                                          .fix = give_fix,
                                          .next_fix_ns = plus_1,
                                          .date_ns = plus_2,
                                          .pps = give_pps,
                                          .last_power = last_power,
                                          .store = store,
                                          .stored = give_stored,
                                          .window_loss_db = loss,
                                          .session_opened = session_opened,
                                          .report = report};
    stream.counters = &counters;
    stream.tick_bytes = CAP;
    links = (struct links){.stream = &stream, .source = &source, .report = &to_test, .observer = &observer};
    pump.links = &links;
    pump.stream = &stream;
    pump.protocol = &all;
    pump.out_cap = CAP;
    pump.tick = malloc(CAP);
    s->reader = 1;
    s->id = 3;
    const struct faulty_spec faults = {.protocol = pump.protocol, .time_ns = no_time};
    if (pump.tick == NULL || faulty_open(&faults, &null_link, &pump.link, &err) != SH_OK) return -1;
    pump.ops = &own_link;
    return stream_create(&stream, &size, TICK_NS, &err);
}

int session_teardown(void **state)
{
    (void)state;
    session_close_protocol(&pump, s);
    faulty_ops(pump.link)->close(pump.link);
    unit_queue_free(&s->units);
    free(pump.tick);
    stream_free(&stream);
    return 0;
}

uint32_t next_seq;

void release(uint32_t n)
{
    release_shifted(n, 0);
}

void release_shifted(uint32_t n, int64_t shift_ns)
{
    const uint64_t tick = stream_released(&stream);
    struct ring_slot *slot = ring_claim(&stream.ring, tick);
    assert_non_null(slot);
    ring_begin(slot);
    for (uint32_t i = 0; i < n; i++) {
        size_t room;
        uint8_t *at = ring_grow(slot, 200, &room) == SH_OK ? slot->tick.bytes + slot->tick.len : NULL;
        const struct native_event event = {.code = NATIVE_EV_CONTROL};
        const size_t len = native_encode_event(at, room, &event, 100 + i, 0);
        assert_true(len > 0);
        native_finish_frame(at, next_seq + i);
        slot->tick.len += (uint32_t)len;
    }
    assert_int_equal(ring_end(slot), SH_OK);
    assert_int_equal(ring_ready(slot, tick), 1);
    assert_ptr_equal(ring_peek(&stream.ring, tick), slot);
    slot->tick.shift_ns = shift_ns;
    slot->first_seq = next_seq;
    slot->n_frames = n;
    next_seq += n;
    ring_release(&stream.ring, tick);
}

void open_session(void)
{
    struct sh_err err;
    next_seq = 10;
    assert_int_equal(session_open_protocol(&pump, s, &err), SH_OK);
    s->open = 1;
}

void say(const char *text)
{
    struct session_commands *c = &s->commands;
    memcpy(c->in, text, strlen(text));
    c->in_pos = 0;
    c->in_len = (uint32_t)strlen(text);
}
