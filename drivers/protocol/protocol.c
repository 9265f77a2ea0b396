#include "drivers/protocol/protocol.h"

/* The one list of protocols. */
extern const struct protocol_ops protocol_cola;
static const struct protocol_ops *const protocols[PROTOCOL_N] = {
    [PROTOCOL_NATIVE] = NULL,
    [PROTOCOL_COLA] = &protocol_cola,
};

const struct protocol_ops *protocol_ops_get(enum protocol_id id)
{
    return (unsigned)id < PROTOCOL_N ? protocols[id] : NULL;
}
