/* SPDX-License-Identifier: MIT */
/* The gadget and its controller: plugging in and out, speeds, states. */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>

#include "drivers/usb/gadget.h"
#include "drivers/usb/sysfile.h"

static const char CONTROLLERS[] = "/sys/class/udc";

const char *gadget_rate_name(enum usb_rate rate)
{
    static const char *const names[] = {[USB_RATE_FULL] = "full", [USB_RATE_HIGH] = "high", [USB_RATE_SUPER] = "super"};
    return names[rate];
}

static int bind_to(struct gadget *gadget, const char *udc)
{
    if (sysfile_write(gadget->dir, "UDC", "%s\n", udc) != 0) return -1;
    snprintf(gadget->udc, sizeof gadget->udc, "%s", udc);
    return 0;
}

static int bind_first_free(struct gadget *gadget, struct sh_err *err)
{
    DIR *dir = opendir(CONTROLLERS);
    int n = 0, error = 0;
    for (struct dirent *entry; dir != NULL && gadget->udc[0] == '\0' && (entry = readdir(dir)) != NULL;) {
        if (entry->d_name[0] == '.') continue;
        n++;
        if (bind_to(gadget, entry->d_name) != 0) error = errno;
    }
    if (dir != NULL) closedir(dir);
    if (gadget->udc[0] != '\0') return SH_OK;
    if (n == 0)
        return sh_fail(err, SH_EINPUT,
                       "functionfs: no USB device controller in %s: the machine has none, or its driver is not loaded "
                       "(dwc2 on a Raspberry Pi; dummy_hcd to try without one)",
                       CONTROLLERS);
    return sh_fail(err, SH_EIO, "functionfs: none of the %d device controllers accepts the gadget: %s", n,
                   strerror(error));
}

int gadget_bind(struct gadget *gadget, const char *udc, struct sh_err *err)
{
    if (udc[0] == '\0') return bind_first_free(gadget, err);
    if (bind_to(gadget, udc) == 0) return SH_OK;
    if (errno == ENODEV || errno == ENOENT)
        return sh_fail(err, SH_EINPUT, "functionfs: there is no device controller %s; %s lists the controllers", udc,
                       CONTROLLERS);
    return sh_fail(err, SH_EIO, "functionfs: device controller %s: %s", udc, strerror(errno));
}

static enum usb_rate read_rate(const struct gadget *gadget, const char *file)
{
    char dir[320], text[32] = "";
    snprintf(dir, sizeof dir, "%s/%s", CONTROLLERS, gadget->udc);
    sysfile_read(dir, file, text, sizeof text);
    return strncmp(text, "super", 5) == 0  ? USB_RATE_SUPER
           : strncmp(text, "high", 4) == 0 ? USB_RATE_HIGH
                                           : USB_RATE_FULL;
}

/* udc_state_attr of the kernel: "not attached", "configured", and what lies between. Empty: not to be had. */
static void read_state(const struct gadget *gadget, char *state, size_t len)
{
    char dir[320];
    snprintf(dir, sizeof dir, "%s/%s", CONTROLLERS, gadget->udc);
    if (sysfile_read(dir, "state", state, len) != 0) state[0] = '\0';
}

int gadget_is_on_bus(const struct gadget *gadget)
{
    char state[32];
    read_state(gadget, state, sizeof state);
    return state[0] != '\0' && strcmp(state, "not attached") != 0;
}

int gadget_is_configured(const struct gadget *gadget, int before)
{
    char state[32];
    read_state(gadget, state, sizeof state);
    return strcmp(state, "configured") == 0 || (before && strcmp(state, "suspended") == 0);
}

int gadget_watch_state(struct gadget *gadget, struct sh_err *err)
{
    char path[330];
    snprintf(path, sizeof path, "%s/%s/state", CONTROLLERS, gadget->udc);
    gadget->state_fd = open(path, O_RDONLY | O_CLOEXEC);
    return gadget->state_fd >= 0 ? SH_OK : sh_fail(err, SH_EIO, "functionfs: %s: %s", path, strerror(errno));
}

enum usb_rate gadget_rate(const struct gadget *gadget)
{
    return read_rate(gadget, "current_speed");
}

int gadget_check_rate(const struct gadget *gadget, enum usb_rate wanted, struct sh_err *err)
{
    const enum usb_rate fastest = read_rate(gadget, "maximum_speed");
    if (fastest >= wanted) return SH_OK;
    return sh_fail(err, SH_EINPUT, "functionfs: device controller %s does not reach %s speed; allowed %s%s",
                   gadget->udc, gadget_rate_name(wanted), fastest == USB_RATE_FULL ? "" : "full, ",
                   gadget_rate_name(fastest));
}

void gadget_unbind(struct gadget *gadget)
{
    if (gadget->udc[0] != '\0') (void)sysfile_write(gadget->dir, "UDC", "\n");
    gadget->udc[0] = '\0';
}
