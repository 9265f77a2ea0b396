/* SPDX-License-Identifier: MIT */
#include "drivers/link/link.h"

/* The one list of links. A new one is a file of this folder that defines its link_ops, a type in link.h, and
 * a row here. */
extern const struct link_ops link_null, link_file, link_pty, link_tcp, link_usb, link_fd, link_udp, link_web,
    link_memory;
static const struct link_ops *const links[] = {
    [LINK_NULL] = &link_null, [LINK_FILE] = &link_file, [LINK_PTY] = &link_pty,
    [LINK_TCP] = &link_tcp,   [LINK_USB] = &link_usb,   [LINK_FD] = &link_fd,
    [LINK_UDP] = &link_udp,   [LINK_WEB] = &link_web,   [LINK_MEMORY] = &link_memory,
};
enum { N_LINKS = sizeof links / sizeof links[0] };

const struct link_ops *link_ops_get(enum link_type type)
{
    return (unsigned)type < N_LINKS ? links[type] : NULL;
}

uint32_t link_faults(const struct link_spec *spec)
{
    const struct link_ops *ops = link_ops_get(spec->type);
    if (ops == NULL) return 0;
    return ops->can != NULL ? ops->faults & ops->can(spec) : ops->faults;
}
