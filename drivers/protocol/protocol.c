#include "drivers/protocol/protocol.h"

#include "drivers/protocol/velodyne.h"

/* The one list of protocols. */
static const struct protocol_ops *const protocols[PROTOCOL_N] = {
    [PROTOCOL_NATIVE] = NULL,
    [PROTOCOL_VELODYNE] = &protocol_velodyne,
    [PROTOCOL_VELODYNE_POSITION] = &protocol_velodyne_position,
    [PROTOCOL_VELODYNE_HTTP] = &protocol_velodyne_http,
};

const struct protocol_ops *protocol_ops_get(enum protocol_id id)
{
    return (unsigned)id < PROTOCOL_N ? protocols[id] : NULL;
}
