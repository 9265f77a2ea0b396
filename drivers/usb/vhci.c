/* SPDX-License-Identifier: MIT */
#include "drivers/usb/vhci.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "drivers/usb/sysfile.h"

static const char DIR_DEFAULT[] = "/sys/devices/platform/vhci_hcd.0";
enum { PORT_FREE = 4 }; /* VDEV_ST_NULL */

static int vhci_fail(const char *dir, const char *file, struct sh_err *err)
{
    if (errno == ENOENT)
        return sh_fail(err, SH_EINPUT, "usbip: %s/%s is not there: load the module, modprobe vhci-hcd (as root)", dir,
                       file);
    if (errno == EACCES || errno == EPERM)
        return sh_fail(
            err, SH_EPERM,
            "usbip: %s/%s: %s; run as root, or serve on a port and attach as root (usbip attach -r 127.0.0.1 -b 1-1)",
            dir, file, strerror(errno));
    return sh_fail(err, SH_EIO, "usbip: %s/%s: %s", dir, file, strerror(errno));
}

/* Lines "hs  0000 004 000 00000000 000000 0-0": hub, port, state, ... */
static int find_port(const char *dir, enum usb_rate rate, unsigned *port, struct sh_err *err)
{
    char path[320], line[256], hub[8];
    unsigned number = 0, state;
    int found = 0;
    snprintf(path, sizeof path, "%s/status", dir);
    FILE *in = fopen(path, "r");
    if (in == NULL) return vhci_fail(dir, "status", err);
    while (!found && fgets(line, sizeof line, in) != NULL)
        found = sscanf(line, "%7s %u %u", hub, &number, &state) == 3 && state == PORT_FREE &&
                strcmp(hub, rate == USB_RATE_SUPER ? "ss" : "hs") == 0;
    fclose(in);
    *port = number;
    return found ? SH_OK : sh_fail(err, SH_EIO, "usbip: no free port on vhci_hcd.0; detach one (usbip detach -p N)");
}

int vhci_attach(const char *dir, int fd, uint32_t devid, enum usb_rate rate, unsigned *port, struct sh_err *err)
{
    static const int speed[] = {
        [USB_RATE_FULL] = USB_SPEED_FULL, [USB_RATE_HIGH] = USB_SPEED_HIGH, [USB_RATE_SUPER] = USB_SPEED_SUPER};
    enum { TRIES = 8 }; /* somebody else may have taken the port meanwhile */
    int rc = SH_OK;
    if (dir == NULL) dir = DIR_DEFAULT;
    for (int i = 0; i < TRIES; i++) {
        rc = find_port(dir, rate, port, err);
        if (rc != SH_OK) return rc;
        if (sysfile_write(dir, "attach", "%u %d %u %d", *port, fd, devid, speed[rate]) == 0) return SH_OK;
        const int is_taken = errno == EBUSY;
        rc = vhci_fail(dir, "attach", err);
        if (!is_taken) return rc;
    }
    return rc;
}
