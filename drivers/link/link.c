#include <string.h>

#include "drivers/link/link_util.h"

static const struct link_ops *const links[] = {
    [LINK_NULL] = &link_null, [LINK_FILE] = &link_file, [LINK_PTY] = &link_pty,
    [LINK_TCP] = &link_tcp,   [LINK_USB] = &link_usb,   [LINK_FD] = &link_fd,
};
enum { N_LINKS = sizeof links / sizeof links[0] };

const struct link_ops *link_ops_get(enum link_type type)
{
    return (unsigned)type < N_LINKS ? links[type] : NULL;
}

int link_type_parse(const char *name)
{
    for (int type = 0; type < N_LINKS; type++)
        if (strcmp(links[type]->name, name) == 0) return type;
    return -1;
}
