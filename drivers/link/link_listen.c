/* SPDX-License-Identifier: MIT */
#include "drivers/link/link_listen.h"

int link_listen(const char *what, const struct link_spec *spec, struct link_listener *out, struct sh_err *err)
{
    const char *host = spec->address[0] != '\0' ? spec->address : "127.0.0.1";
    if (spec->port < 0 || spec->port > 65535)
        return sh_fail(err, SH_EINPUT, "%s:%s:%d: allowed ports are 0 to 65535", what, host, spec->port);
    if (spec->max_sessions < 1 || spec->max_sessions > LINK_MAX_SESSIONS)
        return sh_fail(err, SH_EINPUT, "%s:%s:%d: %d sessions; allowed are 1 to %d", what, host, spec->port,
                       spec->max_sessions, LINK_MAX_SESSIONS);
    const struct socket_place place = {.what = what, .host = host, .port = spec->port};
    const int rc = socket_open(&place, &out->fd, out->at, sizeof out->at, err);
    if (rc != SH_OK) return rc;
    socket_note_address(out->fd, &out->address);
    out->reserve_fd = socket_reserve();
    return SH_OK;
}
