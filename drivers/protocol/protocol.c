/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/protocol.h"

#include <stdlib.h>
#include <string.h>

/* The one list of protocols. A new one is a file of this folder that defines its protocol_ops, an id in protocol.h, and
 * two rows here. */
extern const struct protocol_ops protocol_native, protocol_nmea, protocol_scip, protocol_cola, protocol_velodyne,
    protocol_velodyne_position, protocol_velodyne_http, protocol_capture;

static const struct protocol_ops *const protocols[PROTOCOL_N] = {
    [PROTOCOL_NATIVE] = &protocol_native,
    [PROTOCOL_NMEA] = &protocol_nmea,
    [PROTOCOL_SCIP] = &protocol_scip,
    [PROTOCOL_COLA] = &protocol_cola,
    [PROTOCOL_VELODYNE] = &protocol_velodyne,
    [PROTOCOL_VELODYNE_POSITION] = &protocol_velodyne_position,
    [PROTOCOL_VELODYNE_HTTP] = &protocol_velodyne_http,
    [PROTOCOL_CAPTURE] = &protocol_capture,
};

enum protocol_head_state protocol_ask_state(const struct protocol_host *host)
{
    static const char *const names[] = {"off", "boot", "idle", "spin-up", "scanning", "spin-down", "fault"};
    char state[PROTOCOL_REPLY];
    if (host->command(host->ctx, "HEAD:STATE?", state, sizeof state) != 0) return PROTOCOL_HEAD_UNKNOWN;
    for (int i = PROTOCOL_HEAD_OFF; i <= PROTOCOL_HEAD_FAULT; i++)
        if (strcmp(names[i], state) == 0) return (enum protocol_head_state)i;
    return PROTOCOL_HEAD_UNKNOWN;
}

void protocol_lose_input(void *protocol, const uint8_t *bytes, size_t len)
{
    const struct protocol_host *host = &((const struct protocol_spec *)protocol)->host;
    (void)bytes;
    host->count(host->ctx, PROTOCOL_INPUT_LOST, len);
}

uint8_t protocol_digit_bits(uint8_t c)
{
    return c >= '0' && c <= '7' ? 7 : c == '8' || c == '9' || (c >= 'B' && c <= 'E') ? 1 : 0;
}

const struct protocol_ops *protocol_ops_get(enum protocol_id id)
{
    return (unsigned)id < PROTOCOL_N ? protocols[id] : NULL;
}

int protocol_create(const struct protocol_ops *ops, const struct protocol_spec *spec, void **protocol,
                    struct sh_err *err)
{
    void *self = calloc(1, ops->size);
    if (self == NULL) return sh_fail(err, SH_ENOMEM, "protocol %s: no memory for %zu bytes", ops->name, ops->size);
    memcpy(self, spec, sizeof *spec);
    const int rc = ops->begin != NULL ? ops->begin(self, err) : SH_OK;
    if (rc == SH_OK)
        *protocol = self;
    else
        free(self);
    return rc;
}

void protocol_destroy(const struct protocol_ops *ops, void *protocol)
{
    if (ops->end != NULL) ops->end(protocol);
    free(protocol);
}
