/* SPDX-License-Identifier: MIT */
#include "tests/unit/cola_rig.h"

struct protocol_rig cola;

static struct protocol_rig_reply replies[] = {{"HEAD:STATE?", "scanning", 0}, {NULL, NULL, 0}};

void cola_head_state(const char *state)
{
    replies[0].reply = state;
}

int cola_teardown(void **state)
{
    (void)state;
    if (cola.protocol != NULL) protocol_rig_close(&cola);
    return 0;
}

void cola_open(const char *model)
{
    cola_teardown(NULL);
    protocol_rig_open(&cola, PROTOCOL_COLA, "SICK", model);
}

static void open_model(const char *model, uint32_t steps, int first, int last, int front, uint32_t hz)
{
    cola_open(model);
    cola_head_state("scanning");
    cola.replies = replies;
    protocol_rig_planar(&cola, steps, first, last, front, -1, hz);
    protocol_rig_describe(&cola, 0);
}

void cola_open_tim(const char *model)
{
    open_model(model, 1080, 0, 810, 405, 15);
}

void cola_open_lms(void)
{
    open_model("LMS111", 1440, 0, 1080, 540, 25);
}

void cola_input(const void *bytes, size_t len)
{
    cola.ops->input(cola.protocol, bytes, len);
}

const char *cola_ask(const char *request)
{
    static char text[70000];
    protocol_rig_clear(&cola);
    snprintf(text, sizeof text, "\2%s\3", request);
    cola_input(text, strlen(text));
    assert_int_equal(cola.n_units, 1);
    assert_int_equal(cola.bytes[0], 2);
    assert_int_equal(cola.bytes[cola.len - 1], 3);
    memcpy(text, cola.bytes + 1, cola.len - 2);
    text[cola.len - 2] = 0;
    return text;
}

void cola_expect(const char *request, const char *answer)
{
    assert_string_equal(cola_ask(request), answer);
}

size_t cola_frame_b(uint8_t *dst, const void *payload, size_t len)
{
    memcpy(dst, "\2\2\2\2\0\0", 6);
    dst[6] = (uint8_t)(len / 256);
    dst[7] = (uint8_t)(len % 256);
    memcpy(dst + 8, payload, len);
    dst[8 + len] = 0;
    for (size_t i = 0; i < len; i++)
        dst[8 + len] ^= dst[8 + i];
    return len + 9;
}

void cola_expect_b(const void *request, size_t len, const void *answer, size_t answer_len)
{
    uint8_t frame[4096];
    protocol_rig_clear(&cola);
    cola_input(frame, cola_frame_b(frame, request, len));
    assert_int_equal(cola.n_units, 1);
    assert_int_equal(cola.len, cola_frame_b(frame, answer, answer_len));
    assert_memory_equal(cola.bytes, frame, cola.len);
}

void cola_authorise(void)
{
    cola_expect("sMN SetAccessMode 03 F4724744", "sAN SetAccessMode 1");
}

void cola_stream(int is_b)
{
    if (is_b)
        EXPECT_B("sEN LMDscandata \1", "sEA LMDscandata \1");
    else
        cola_expect("sEN LMDscandata 1", "sEA LMDscandata 1");
}

/* ---- the reader. `at` walks over the values; next() returns one of so many bytes. */

static const uint8_t *at;
static int is_b;

static uint32_t next(int bytes)
{
    uint32_t v = 0;
    if (is_b) {
        for (int i = 0; i < bytes; i++)
            v = v * 256 + *at++;
        return v;
    }
    char *end;
    assert_int_equal(*at, ' ');
    v = (uint32_t)strtoul((const char *)at + 1, &end, 16);
    assert_true(end - (const char *)at - 1 <= 2 * bytes && end > (const char *)at + 1);
    at = (const uint8_t *)end;
    return v;
}

static void next_word(char *dst, size_t len)
{
    if (!is_b) assert_int_equal(*at++, ' ');
    memcpy(dst, at, len);
    dst[len] = 0;
    at += len;
}

static double next_float(void)
{
    const uint32_t bits = next(4);
    float v;
    memcpy(&v, &bits, sizeof v);
    return v;
}

static void next_channel(struct cola_channel *c, int bytes)
{
    next_word(c->name, 5);
    c->scale = next_float();
    c->offset = next_float();
    c->start_e4 = (int32_t)next(4);
    c->step_e4 = next(2);
    c->n = next(2);
    assert_true(c->n <= 3000);
    for (uint32_t i = 0; i < c->n; i++)
        c->value[i] = next(bytes);
}

static void read_head(struct cola_lmd *out)
{
    assert_int_equal(next(2), 1); /* version */
    assert_int_equal(next(2), 1); /* device */
    out->serial = next(4);
    assert_int_equal(next(1), 0);
    assert_int_equal(next(1), 0);
    out->telegram = next(2);
    out->scan = next(2);
    out->scan_us = next(4);
    out->send_us = next(4);
    for (int i = 0; i < 4; i++)
        assert_int_equal(next(1), 0);
    assert_int_equal(next(2), 0); /* layer */
    out->scan_chz = next(4);
    out->meas_100hz = next(4);
    out->n_encoders = next(2);
    if (out->n_encoders == 0) return;
    assert_int_equal(out->n_encoders, 1);
    out->position = (int32_t)next(4);
    out->speed = (int16_t)next(2);
}

static void read_tail(struct cola_lmd *out)
{
    assert_int_equal(next(2), 0); /* position */
    out->has_name = next(2);
    if (out->has_name) {
        const uint32_t len = next(2);
        assert_true(len < sizeof out->name);
        next_word(out->name, len);
    }
    assert_int_equal(next(2), 0); /* comment */
    out->has_time = next(2);
    static const int bytes[7] = {2, 1, 1, 1, 1, 1, 4};
    for (int i = 0; out->has_time && i < 7; i++)
        out->date[i] = next(bytes[i]);
    assert_int_equal(next(2), 0); /* event */
}

void cola_read_lmd(uint32_t unit, struct cola_lmd *out)
{
    assert_true(unit < cola.n_units);
    const size_t from = unit == 0 ? 0 : cola.end[unit - 1];
    const uint8_t *frame = cola.bytes + from, *const end = cola.bytes + cola.end[unit];
    memset(out, 0, sizeof *out);
    is_b = frame[1] == 2;
    at = frame + (is_b ? 8 : 1);
    memcpy(out->verb, at, 3);
    assert_memory_equal(at + 3, " LMDscandata", 12);
    at += is_b ? 16 : 15;
    read_head(out);
    out->n_16 = next(2);
    assert_true(out->n_16 <= 4);
    for (uint32_t i = 0; i < out->n_16; i++)
        next_channel(&out->channel[i], 2);
    out->n_8 = next(2);
    assert_true(out->n_16 + out->n_8 <= 4);
    for (uint32_t i = 0; i < out->n_8; i++)
        next_channel(&out->channel[out->n_16 + i], 1);
    read_tail(out);
    assert_ptr_equal(at + 1, end);
}

void cola_turn(uint32_t line, double base_m)
{
    static struct protocol_rig_shot shot[3000];
    for (int i = 0; i <= cola.emitter.last_step - cola.emitter.first_step; i++)
        shot[i] = (struct protocol_rig_shot){
            .n = 1, .range_m = {base_m + 0.01 * i}, .refl_cdb = {0}, .amplitude_cdb = {2000}};
    protocol_rig_turn(&cola, line, shot, 100);
}

void cola_scan(uint32_t line, double base_m, struct cola_lmd *out)
{
    protocol_rig_clear(&cola);
    cola_turn(line, base_m);
    cola_read_lmd(0, out);
}
