/* SPDX-License-Identifier: MIT */
#include "tests/unit/cola_fields_rig.h"

struct protocol_rig_shot fields_shot[FIELDS_BEAMS];
double fields_loss_db;

static uint32_t line;

void fields_wall(double range_m)
{
    for (int i = 0; i < FIELDS_BEAMS; i++)
        fields_shot[i] = (struct protocol_rig_shot){.n = range_m > 0.0, .range_m = {range_m}};
}

void fields_object(int from, int n, double range_m)
{
    fields_wall(10.0);
    for (int i = from; i < from + n; i++)
        fields_shot[i].range_m[0] = range_m;
}

void fields_turn(void)
{
    protocol_rig_turn(&cola, line++, fields_shot, 100);
}

static double read_loss(void *ctx)
{
    (void)ctx;
    return fields_loss_db;
}

void fields_open(const struct cola_fields *fields)
{
    struct sh_err err;
    protocol_destroy(cola.ops, cola.protocol);
    cola.identity.fields = fields;
    cola.spec.host.window_loss_db = read_loss;
    fields_loss_db = 0.0;
    line = 0;
    fields_wall(10.0);
    assert_int_equal(protocol_create(cola.ops, &cola.spec, &cola.protocol, &err), 0);
    cola.ops->open(cola.protocol, 0);
    protocol_rig_describe(&cola, 0);
}

int fields_result(const uint8_t *payload, int k)
{
    assert_memory_equal(payload + 4, "LFErec \0\3", 9);
    assert_int_equal(payload[13 + 43 * k + 2], k + 1);
    return payload[13 + 43 * k + 2 + 1 + 4 + 16];
}

void fields_expect(const char *results)
{
    uint8_t frame[64];
    protocol_rig_clear(&cola);
    cola_input(frame, cola_frame_b(frame, "sRN LFErec", 10));
    assert_int_equal(cola.n_units, 1);
    for (int k = 0; k < 3; k++)
        assert_int_equal('0' + fields_result(cola.bytes + 8, k), results[k]);
}
