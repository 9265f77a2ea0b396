/* SPDX-License-Identifier: MIT */
/* The scanner's clock, and the time server that sets it: both belong to the head, not to this session. COLA.md says
 * where each variable comes from. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "drivers/protocol/cola.h"
#include "drivers/protocol/cola_clock.h"

enum { N_ROLES = 3, N_INTERFACES = 2, ZONE_0 = 12, N_ZONES = 25 };

/* ---- the clock */

int64_t cola_clock_ns(const struct cola *self, int64_t t_ns)
{
    return self->spec.host.date_ns(self->spec.host.ctx, t_ns);
}

void cola_put_time(const struct cola *self, int64_t t_ns, struct cola_out *out)
{
    const struct cola_date d = cola_date_of(cola_clock_ns(self, t_ns));
    cola_put_u(out, 2, d.year);
    cola_put_u(out, 1, d.month);
    cola_put_u(out, 1, d.day);
    cola_put_u(out, 1, d.hour);
    cola_put_u(out, 1, d.minute);
    cola_put_u(out, 1, d.second);
    cola_put_u(out, 4, d.us);
}

/* 1: the clock shows that time now. */
static int set_clock(struct cola *self, int64_t ns)
{
    char line[48], reply[PROTOCOL_REPLY];
    int64_t shift_ns;
    if (self->spec.host.command(self->spec.host.ctx, "TIME:SHIFt?", reply, sizeof reply) != 0 ||
        sscanf(reply, "%" SCNd64, &shift_ns) != 1)
        return 0;
    /* In this order no difference overflows. The one in brackets is the clock's time without a shift. */
    shift_ns = ns - (cola_clock_ns(self, self->now_ns) - shift_ns);
    snprintf(line, sizeof line, "TIME:SHIFt %" PRId64, shift_ns);
    return self->spec.host.command(self->spec.host.ctx, line, NULL, 0) == 0;
}

/* ---- the time server */

/* The settings of TIME:SERVer, in SOPAS' numbers. */
struct cola_server {
    uint32_t role, interface, address[4], update_s, zone; /* zone: hours ahead of UTC plus 12 */
};

static const char *const roles[N_ROLES] = {"NONE", "CLIENT", "SERVER"}, *const interfaces[N_INTERFACES] = {"ETH",
                                                                                                           "CAN"};

static uint32_t cola_time_word_of(const char *const words[], uint32_t n, const char *word)
{
    uint32_t i = 0;
    while (i < n && strcmp(words[i], word) != 0)
        i++;
    return i;
}

static enum cola_error get_server(struct cola *self, struct cola_server *s)
{
    char reply[PROTOCOL_REPLY], role[8], interface[4];
    uint32_t *const a = s->address;
    int zone_h;
    if (self->spec.host.command(self->spec.host.ctx, "TIME:SERVer?", reply, sizeof reply) != 0 ||
        sscanf(reply, "%7[A-Z],%3u.%3u.%3u.%3u,%6u,%3d,%3[A-Z]", role, &a[0], &a[1], &a[2], &a[3], &s->update_s,
               &zone_h, interface) != 8)
        return COLA_CONDITION;
    s->role = cola_time_word_of(roles, N_ROLES, role);
    s->interface = cola_time_word_of(interfaces, N_INTERFACES, interface);
    s->zone = (uint32_t)(zone_h + ZONE_0);
    return COLA_OK;
}

static enum cola_error put_server(struct cola *self, const struct cola_server *s)
{
    char line[96];
    const uint32_t *const a = s->address;
    if (s->role >= N_ROLES || s->interface >= N_INTERFACES || s->zone >= N_ZONES) return COLA_INVALID_DATA;
    snprintf(line, sizeof line, "TIME:SERVer %s,%u.%u.%u.%u,%u,%d,%s", roles[s->role], a[0], a[1], a[2], a[3],
             s->update_s, (int)s->zone - ZONE_0, interfaces[s->interface]);
    const int error = self->spec.host.command(self->spec.host.ctx, line, NULL, 0);
    return error == 0 ? COLA_OK : error == -221 ? COLA_CONDITION : COLA_INVALID_DATA;
}

/* Answers a variable of n numbers of `bytes` bytes each. member: their place in struct cola_server. */
static enum cola_error read_numbers(struct cola *self, size_t member, int n, unsigned bytes)
{
    struct cola_server s;
    const enum cola_error error = get_server(self, &s);
    for (int i = 0; i < n && error == COLA_OK; i++)
        cola_put_u(&self->out, bytes, ((const uint32_t *)((const char *)&s + member))[i]);
    return error;
}

static enum cola_error write_numbers(struct cola *self, size_t member, int n)
{
    struct cola_server s;
    const enum cola_error error = get_server(self, &s);
    if (error != COLA_OK) return error;
    memcpy((char *)&s + member, self->arg, (size_t)n * sizeof self->arg[0]);
    return put_server(self, &s);
}

#define NUMBERS(name, member, n, bytes)                                            \
    enum cola_error cola_read_##name(struct cola *self)                            \
    {                                                                              \
        return read_numbers(self, offsetof(struct cola_server, member), n, bytes); \
    }                                                                              \
    enum cola_error cola_write_##name(struct cola *self)                           \
    {                                                                              \
        return write_numbers(self, offsetof(struct cola_server, member), n);       \
    }
NUMBERS(time_role, role, 1, 1)
NUMBERS(time_interface, interface, 1, 1)
NUMBERS(time_zone, zone, 1, 1)
NUMBERS(time_update, update_s, 1, 4)
NUMBERS(time_address, address, 4, 1)

/* Writes one of the times of TIME:SERVer? STATe as a float, in seconds. which: 0 the limit, 1 the offset, 2 the
 * delay. */
static enum cola_error put_answered(struct cola *self, int which)
{
    char reply[PROTOCOL_REPLY];
    int64_t ns[3];
    if (self->spec.host.command(self->spec.host.ctx, "TIME:SERVer? STATe", reply, sizeof reply) != 0 ||
        sscanf(reply, "%*[A-Z],%" SCNd64 ",%" SCNd64 ",%" SCNd64, &ns[0], &ns[1], &ns[2]) != 3)
        return COLA_CONDITION;
    cola_put_float(&self->out, (float)(1e-9 * (double)ns[which]));
    return COLA_OK;
}

enum cola_error cola_read_time_limit(struct cola *self)
{
    return put_answered(self, 0);
}

enum cola_error cola_read_time_delay(struct cola *self)
{
    return put_answered(self, 2);
}

/* The request has u16 year; u8 month, day, hour, minute, second; u32 us. The answer is u8 1 if the clock was set, else
 * 0. A client can't set the clock while TSCRole is 1, whether or not a time server answers. */
enum cola_error cola_set_clock(struct cola *self)
{
    const uint32_t *const v = self->arg;
    const struct cola_date d = {v[0], v[1], v[2], v[3], v[4], v[5], v[6]};
    struct cola_server server;
    int64_t ns;
    const int is_synchronised = get_server(self, &server) == COLA_OK && server.role == 1;
    cola_put_u(&self->out, 1, (uint32_t)(!is_synchronised && cola_date_ns(&d, &ns) && set_clock(self, ns)));
    return COLA_OK;
}
