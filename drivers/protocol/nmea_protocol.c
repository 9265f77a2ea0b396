/* SPDX-License-Identifier: MIT */
/* The GNSS receiver on a link: after each fix its sentences (nmea.h), all of them as one unit. The receiver takes no
 * commands. */
#include "drivers/protocol/protocol.h"

struct receiver {
    struct protocol_spec spec;
    int64_t from_ns; /* fixes before it were sent, or came before the client */
    int64_t next_ns; /* the next one, as far as it is known; INT64_MIN: to be asked for */
};

/* The next fix is asked for later: a link of type file opens before power-up, when the time of day is not known. */
static void open_at(void *protocol, int64_t t_ns)
{
    struct receiver *self = protocol;
    self->from_ns = t_ns;
    self->next_ns = INT64_MIN;
}

static void nmea_protocol_say(struct receiver *self, int64_t t_ns)
{
    struct nmea_fix fix;
    char text[NMEA_MAX_ALL];
    if (!self->spec.host.fix(self->spec.host.ctx, t_ns, &fix)) return;
    size_t len = nmea_encode_all(text, sizeof text, &fix);
    if (len != 0) self->spec.host.send(self->spec.host.ctx, text, len);
}

static void nmea_protocol_time(void *protocol, int64_t t_ns)
{
    struct receiver *self = protocol;
    if (self->next_ns >= t_ns) return;
    while ((self->next_ns = self->spec.host.next_fix_ns(self->spec.host.ctx, self->from_ns)) < t_ns) {
        nmea_protocol_say(self, self->next_ns);
        self->from_ns = self->next_ns + 1;
    }
}

static int64_t nmea_protocol_next_ns(const void *protocol)
{
    const struct receiver *self = protocol;
    return self->next_ns;
}

const struct protocol_ops protocol_nmea = {
    .name = "nmea",
    .needs = PROTOCOL_NEEDS_TIME | PROTOCOL_NEEDS_PLACE,
    .max_unit = NMEA_MAX_ALL,
    .content = nmea_content,
    .reseal = nmea_reseal,
    .size = sizeof(struct receiver),
    .open = open_at,
    .time = nmea_protocol_time,
    .input = protocol_lose_input,
    .next_ns = nmea_protocol_next_ns,
};
