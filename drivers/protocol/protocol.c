#include "drivers/protocol/protocol.h"

/* The one list of protocols. A new one is a file of this folder that defines its protocol_ops, an id in protocol.h, and
 * a row here. */
extern const struct protocol_ops protocol_native, protocol_nmea;
static const struct protocol_ops *const protocols[PROTOCOL_N] = {
    [PROTOCOL_NATIVE] = &protocol_native,
    [PROTOCOL_NMEA] = &protocol_nmea,
};

const struct protocol_ops *protocol_ops_get(enum protocol_id id)
{
    return (unsigned)id < PROTOCOL_N ? protocols[id] : NULL;
}
