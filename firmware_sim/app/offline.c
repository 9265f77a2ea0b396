#include "firmware_sim/app/offline.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "firmware_sim/loop/loop.h"

static int connect_client(struct offline *off, int fd, struct sh_err *err)
{
    char source[32], why[256];
    snprintf(source, sizeof source, "fd:%d", fd);
    int rc = scanhead_open(source, &off->sh, why, sizeof why);
    if (rc != SCANHEAD_OK) close(fd);
    return rc == SCANHEAD_OK ? SH_OK : sh_fail(err, rc, "off line: %s", why);
}

int offline_open(struct config *cfg, double scan_s, const struct sh_report *report, struct offline *off,
                 struct sh_err *err)
{
    int fd[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, fd) != 0)
        return sh_fail(err, SH_EIO, "socket pair: %s", strerror(errno));
    struct link_spec spec = {.type = LINK_FD, .fd = fd[0]};
    struct device_options device = {.scan_s = scan_s};
    struct loop_options options = {.extra = &spec, .report = report};
    cfg->loop.pace = PACE_FAST;
    cfg->n_links = 0;
    int rc = site_load(cfg, report, &off->site, err);
    if (rc == SH_OK) rc = device_create(off->site, &device, &off->device, err);
    if (rc == SH_OK) rc = loop_create(off->site, off->device, &options, &off->loop, err);
    if (rc != SH_OK) {
        close(fd[0]);
        close(fd[1]);
        return rc;
    }
    rc = connect_client(off, fd[1], err);
    return rc == SH_OK ? loop_start(off->loop, err) : rc;
}

int offline_prepare(struct offline *off, uint32_t station, const struct sh_report *report, struct sh_err *err)
{
    if (station == 0) station = off->site->cfg->head.settings.station;
    return site_open_sights(off->site, station - 1, 1, report, err);
}

void offline_close(struct offline *offline)
{
    struct loop_stats stats;
    if (offline->sh != NULL) scanhead_close(offline->sh); /* a loop that waited for this reader goes on */
    if (offline->loop != NULL) {
        loop_end(offline->loop);
        loop_join(offline->loop, &stats);
    }
    loop_free(offline->loop);
    device_free(offline->device);
    site_free(offline->site);
}
