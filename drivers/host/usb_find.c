/* SPDX-License-Identifier: MIT */
/* Finds the heads among the USB devices, and the one that is wanted. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/host/scanhead.h"
#include "drivers/host/usb_inside.h"

#define RULE                                                                                                   \
    "no permission; a udev rule gives it: run `sudo make install`, or copy drivers/host/70-scanhead.rules to " \
    "/etc/udev/rules.d; then `sudo udevadm control --reload`, and plug the head in again"

/* Reads the number of "1209:" or "1209". Returns where it ends; NULL: it isn't one to four hexadecimal digits. */
static const char *parse_id(const char *text, int *id)
{
    size_t digits = strspn(text, "0123456789abcdefABCDEF");
    if (digits < 1 || digits > 4) return NULL;
    *id = (int)strtol(text, NULL, 16);
    return text + digits;
}

int host_usb_parse(const char *source, struct usb_wanted *wanted, struct sh_err *err)
{
    *wanted = (struct usb_wanted){.vid = -1, .pid = -1};
    const char *p = source + 3;
    if (*p == 0) return SH_OK;
    if (*p == ':') p = parse_id(p + 1, &wanted->vid);
    if (p != NULL && *p == ':') p = parse_id(p + 1, &wanted->pid);
    if (p != NULL && *p == ':' && p[1] != 0 && strlen(p + 1) < sizeof wanted->serial) {
        snprintf(wanted->serial, sizeof wanted->serial, "%s", p + 1);
        return SH_OK;
    }
    if (p != NULL && *p == 0 && wanted->pid >= 0) return SH_OK;
    return sh_fail(
        err, SH_EINPUT,
        "%s: not a USB head; allowed are usb, usb:VID:PID and usb:VID:PID:SERIAL, with the ids that lsusb shows",
        source);
}

static int take_endpoints(const struct libusb_interface_descriptor *d, struct usb_interface *out)
{
    *out = (struct usb_interface){.number = d->bInterfaceNumber};
    for (int i = 0; i < d->bNumEndpoints; i++) {
        const struct libusb_endpoint_descriptor *e = &d->endpoint[i];
        if ((e->bmAttributes & LIBUSB_TRANSFER_TYPE_MASK) != LIBUSB_TRANSFER_TYPE_BULK) continue;
        if ((e->bEndpointAddress & LIBUSB_ENDPOINT_DIR_MASK) == LIBUSB_ENDPOINT_IN)
            out->in = e->bEndpointAddress;
        else
            out->out = e->bEndpointAddress;
    }
    return out->in != 0 && out->out != 0;
}

int host_usb_interface(libusb_device *device, struct usb_interface *interface)
{
    struct libusb_config_descriptor *config;
    int found = 0;
    if (libusb_get_active_config_descriptor(device, &config) != 0) return 0;
    for (int i = 0; i < config->bNumInterfaces && !found; i++) {
        const struct libusb_interface_descriptor *d = config->interface[i].altsetting;
        if (d != NULL && d->bInterfaceClass == USB_CLASS && d->bInterfaceSubClass == USB_SUBCLASS &&
            d->bInterfaceProtocol == USB_PROTOCOL)
            found = take_endpoints(d, interface);
    }
    libusb_free_config_descriptor(config);
    return found;
}

static int is_wanted_id(const struct usb_wanted *wanted, const struct libusb_device_descriptor *d)
{
    return (wanted->vid < 0 || wanted->vid == d->idVendor) && (wanted->pid < 0 || wanted->pid == d->idProduct);
}

/* A device may call itself anything. Texts for terminals and logs must be printable, yet differ between two devices:
 * other characters, and backslashes, are written as \xNN. A text that is too long is cut. */
static void read_string(libusb_device_handle *handle, uint8_t index, char *text, size_t len)
{
    unsigned char ascii[128];
    int n = index != 0 ? libusb_get_string_descriptor_ascii(handle, index, ascii, sizeof ascii) : 0;
    size_t used = 0;
    for (int i = 0; i < n; i++) {
        const int plain = ascii[i] >= 0x20 && ascii[i] < 0x7f && ascii[i] != '\\';
        if (used + (plain ? 1 : 4) >= len) break;
        used += (size_t)snprintf(text + used, len - used, plain ? "%c" : "\\x%02x", ascii[i]);
    }
    text[used] = '\0';
}

struct search {
    const struct usb_wanted *wanted;
    struct usb_found *found; /* the first that is wanted */
    int n, error;            /* how many were found; why one could not be opened */
    char others[256];
    char refused[64];
};

/* Adds a head to the list in the message that several are plugged in. The list ends in "..." where it has no room. */
static void name_another(struct search *s, const char *name)
{
    const size_t used = strlen(s->others), room = sizeof s->others - used;
    if ((size_t)snprintf(s->others + used, room, "%s%s", used > 0 ? ", " : "", name) >= room)
        memcpy(s->others + sizeof s->others - sizeof "...", "...", sizeof "...");
}

static void try_device(struct search *s, libusb_device *device)
{
    struct libusb_device_descriptor d;
    struct usb_interface interface;
    libusb_device_handle *handle;
    char serial[128], name[sizeof s->found->name];
    if (libusb_get_device_descriptor(device, &d) != 0 || !is_wanted_id(s->wanted, &d) ||
        !host_usb_interface(device, &interface))
        return;
    int rc = libusb_open(device, &handle);
    if (rc != 0) {
        if (rc != LIBUSB_ERROR_NO_DEVICE) s->error = rc;
        snprintf(s->refused, sizeof s->refused, "%04x:%04x, bus %d device %d", d.idVendor, d.idProduct,
                 libusb_get_bus_number(device), libusb_get_device_address(device));
        return;
    }
    read_string(handle, d.iSerialNumber, serial, sizeof serial);
    if (s->wanted->serial[0] != 0 && strcmp(s->wanted->serial, serial) != 0) {
        libusb_close(handle);
        return;
    }
    snprintf(name, sizeof name, "usb:%04x:%04x%s%s", d.idVendor, d.idProduct, serial[0] != 0 ? ":" : "", serial);
    name_another(s, name);
    if (s->n++ > 0) {
        libusb_close(handle);
        return;
    }
    *s->found = (struct usb_found){.handle = handle, .interface = interface};
    snprintf(s->found->name, sizeof s->found->name, "%s", name);
}

int host_usb_find(libusb_context *ctx, const char *asked, const struct usb_wanted *wanted, struct usb_found *found,
                  struct sh_err *err)
{
    libusb_device **list;
    struct search s = {.wanted = wanted, .found = found};
    ssize_t n = libusb_get_device_list(ctx, &list);
    if (n < 0) return sh_fail(err, SH_EIO, "%s: cannot list USB devices: %s", asked, libusb_strerror((int)n));
    for (ssize_t i = 0; i < n; i++)
        try_device(&s, list[i]);
    libusb_free_device_list(list, 1);
    if (s.n == 1) return SH_OK;
    if (found->handle != NULL) libusb_close(found->handle);
    found->handle = NULL;
    if (s.n > 1)
        return sh_fail(err, SH_EINPUT, "%s: %d heads are plugged in; name one of them: %s", asked, s.n, s.others);
    if (s.error == LIBUSB_ERROR_ACCESS) return sh_fail(err, SH_EPERM, "%s: the head %s: " RULE, asked, s.refused);
    if (s.error != 0)
        return sh_fail(err, SH_EIO, "%s: cannot open the head %s: %s", asked, s.refused, libusb_strerror(s.error));
    return sh_fail(err, SH_ELOST, "%s: no such head on USB; scanhead list shows the heads", asked);
}

static void usb_find_describe(libusb_device *device, const struct libusb_device_descriptor *d,
                              struct scanhead_usb_head *head)
{
    libusb_device_handle *handle;
    *head = (struct scanhead_usb_head){.vid = d->idVendor,
                                       .pid = d->idProduct,
                                       .bus = libusb_get_bus_number(device),
                                       .device = libusb_get_device_address(device)};
    static const double rates[] = {0, 1.5e6, 12e6, 480e6, 5e9, 10e9};
    int speed = libusb_get_device_speed(device);
    if (speed > 0 && (size_t)speed < sizeof rates / sizeof rates[0]) head->speed_bit_s = rates[speed];
    int rc = libusb_open(device, &handle);
    if (rc != 0) {
        snprintf(head->problem, sizeof head->problem, "%s", rc == LIBUSB_ERROR_ACCESS ? RULE : libusb_strerror(rc));
    } else {
        read_string(handle, d->iSerialNumber, head->serial, sizeof head->serial);
        read_string(handle, d->iManufacturer, head->maker, sizeof head->maker);
        read_string(handle, d->iProduct, head->product, sizeof head->product);
        libusb_close(handle);
    }
    snprintf(head->source, sizeof head->source, "usb:%04x:%04x%s%s", d->idVendor, d->idProduct,
             head->serial[0] != 0 ? ":" : "", head->serial);
}

int scanhead_list_usb(struct scanhead_usb_head *heads, int max, char *err, size_t err_len)
{
    libusb_context *ctx;
    libusb_device **list;
    int n_heads = 0;
    int rc = libusb_init(&ctx);
    ssize_t n = rc == 0 ? libusb_get_device_list(ctx, &list) : rc;
    if (n < 0 && err != NULL) snprintf(err, err_len, "cannot list USB devices: %s", libusb_strerror((int)n));
    for (ssize_t i = 0; i < n; i++) {
        struct libusb_device_descriptor d;
        struct usb_interface interface;
        if (libusb_get_device_descriptor(list[i], &d) != 0 || !host_usb_interface(list[i], &interface)) continue;
        if (n_heads < max) usb_find_describe(list[i], &d, &heads[n_heads]);
        n_heads++;
    }
    if (n >= 0) libusb_free_device_list(list, 1);
    if (rc == 0) libusb_exit(ctx);
    return n < 0 ? SCANHEAD_EIO : n_heads;
}
