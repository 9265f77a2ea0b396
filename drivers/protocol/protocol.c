#include "drivers/protocol/protocol.h"

extern const struct protocol_ops protocol_scip;

/* The one list of protocols. */
static const struct protocol_ops *const protocols[PROTOCOL_N] = {
    [PROTOCOL_NATIVE] = NULL,
    [PROTOCOL_SCIP] = &protocol_scip,
};

const struct protocol_ops *protocol_ops_get(enum protocol_id id)
{
    return (unsigned)id < PROTOCOL_N ? protocols[id] : NULL;
}
