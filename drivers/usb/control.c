/* SPDX-License-Identifier: MIT */
/* Control requests: chapter 9, strictly. Requests that the specification leaves open stall.
 *
 * These requests are not supported, and stall, too: remote wake-up, latency tolerance messages, test modes (there is no
 * transceiver to test), SET_DESCRIPTOR, SYNCH_FRAME (no isochronous endpoints). */

#include "core/bytes.h"
#include "drivers/usb/usb_core.h"

struct setup {
    uint8_t type, request;
    uint16_t value, index, length;
};

typedef int (*handler)(struct usb_device *device, const struct setup *s, uint8_t *data);

/* Writes a status of two bytes. Returns how many bytes the answer has. */
static int put_status(uint8_t *data, unsigned status)
{
    le_put16(data, (uint16_t)status);
    return 2;
}

/* The pipe that an endpoint request names; NULL where there is none in this state. */
static struct usb_pipe *named_pipe(struct usb_device *device, const struct setup *s)
{
    if (device->state != USB_CONFIGURED || (s->index & ~(USB_DIR_IN | USB_ENDPOINT_NUMBER_MASK)) != 0) return NULL;
    struct usb_pipe *pipe = usb_pipe(device, s->index);
    return pipe->row != NULL ? pipe : NULL;
}

static int names_interface(const struct usb_device *device, const struct setup *s)
{
    return device->state == USB_CONFIGURED && s->index < device->facts.model->n_interfaces;
}

/* ---- device */

static int get_device_status(struct usb_device *device, const struct setup *s, uint8_t *data)
{
    if (device->state == USB_DEFAULT || s->value != 0 || s->index != 0 || s->length != 2) return USB_STALL;
    unsigned status = (unsigned)usb_is_self_powered(device->facts.model);
    status |= (unsigned)device->u1_enabled << USB_DEV_STAT_U1_ENABLED;
    status |= (unsigned)device->u2_enabled << USB_DEV_STAT_U2_ENABLED;
    return put_status(data, status);
}

static int device_feature(struct usb_device *device, const struct setup *s, uint8_t *data)
{
    (void)data;
    const int super = device->facts.rate == USB_RATE_SUPER && device->state == USB_CONFIGURED;
    if (s->length != 0 || s->index != 0 || !super) return USB_STALL;
    if (s->value != USB_DEVICE_U1_ENABLE && s->value != USB_DEVICE_U2_ENABLE) return USB_STALL;
    *(s->value == USB_DEVICE_U1_ENABLE ? &device->u1_enabled : &device->u2_enabled) = s->request == USB_REQ_SET_FEATURE;
    return 0;
}

static int set_address(struct usb_device *device, const struct setup *s, uint8_t *data)
{
    (void)data;
    if (s->value > 127 || s->index != 0 || s->length != 0 || device->state == USB_CONFIGURED) return USB_STALL;
    device->state = s->value != 0 ? USB_ADDRESSED : USB_DEFAULT;
    return 0;
}

/* Makes wTotalLength wrong if an injected fault has asked for that (usb_device_lengthen). Returns len. */
static size_t lengthen(const struct usb_device *device, uint8_t *out, size_t room, size_t len)
{
    if (device->lengthen != 0 && len != 0 && room >= 4) le_put16(out + 2, (uint16_t)(len + device->lengthen));
    return len;
}

static size_t control_describe(const struct usb_device *device, const struct setup *s, uint8_t *out)
{
    const struct usb_model *model = device->facts.model;
    const struct usb_identity *id = &device->facts.id;
    const uint8_t type = (uint8_t)(s->value >> 8), index = (uint8_t)s->value;
    const size_t room = s->length;
    if (type == USB_DT_STRING)
        return index == 0 || s->index == USB_LANGID ? usb_describe_string(model, id, index, out, room) : 0;
    if (index != 0 || s->index != 0) return 0;
    switch (type) {
    case USB_DT_DEVICE:
        return usb_describe_device(model, id, device->facts.rate, out, room);
    case USB_DT_CONFIG:
    case USB_DT_OTHER_SPEED_CONFIG:
        return lengthen(device, out, room, usb_describe_config(model, id, device->facts.rate, type, out, room));
    case USB_DT_DEVICE_QUALIFIER:
        return usb_describe_qualifier(model, id, device->facts.rate, out, room);
    case USB_DT_BOS:
        return usb_describe_bos(model, id, out, room);
    default:
        return 0;
    }
}

static int get_descriptor(struct usb_device *device, const struct setup *s, uint8_t *data)
{
    size_t len = control_describe(device, s, data);
    if (len == 0) return USB_STALL;
    return (int)(len < s->length ? len : s->length);
}

static int get_configuration(struct usb_device *device, const struct setup *s, uint8_t *data)
{
    if (device->state == USB_DEFAULT || s->value != 0 || s->index != 0 || s->length != 1) return USB_STALL;
    data[0] = device->state == USB_CONFIGURED ? USB_CONFIGURATION : 0;
    return 1;
}

static int set_configuration(struct usb_device *device, const struct setup *s, uint8_t *data)
{
    (void)data;
    if (device->state == USB_DEFAULT || s->index != 0 || s->length != 0) return USB_STALL;
    if (s->value != 0 && s->value != USB_CONFIGURATION) return USB_STALL;
    usb_enter(device, s->value != 0 ? USB_CONFIGURED : USB_ADDRESSED, USB_END_CONFIGURED);
    return 0;
}

static int set_sel(struct usb_device *device, const struct setup *s, uint8_t *data)
{
    (void)data; /* exit latencies of the path; nothing here depends on them */
    const int allowed = device->facts.rate == USB_RATE_SUPER && device->state != USB_DEFAULT;
    return allowed && s->value == 0 && s->index == 0 && s->length == 6 ? 0 : USB_STALL;
}

static int set_isoch_delay(struct usb_device *device, const struct setup *s, uint8_t *data)
{
    (void)data;
    return device->facts.rate == USB_RATE_SUPER && s->index == 0 && s->length == 0 ? 0 : USB_STALL;
}

/* ---- interface */

static int get_interface_status(struct usb_device *device, const struct setup *s, uint8_t *data)
{
    if (!names_interface(device, s) || s->value != 0 || s->length != 2) return USB_STALL;
    return put_status(data, 0);
}

/* Accepts FUNCTION_SUSPEND, which a host sends at super speed to the first interface of a function. The request has no
 * effect here. */
static int set_interface_feature(struct usb_device *device, const struct setup *s, uint8_t *data)
{
    (void)data;
    const unsigned interface = s->index & 0xff, options = s->index >> 8;
    if (device->facts.rate != USB_RATE_SUPER || device->state != USB_CONFIGURED || s->length != 0) return USB_STALL;
    if (s->value != USB_INTRF_FUNC_SUSPEND || (options & ~1u) != 0) return USB_STALL; /* bit 0: low power */
    for (unsigned i = 0; i < device->facts.model->n_functions; i++)
        if (device->facts.model->function[i].first == interface) return 0;
    return USB_STALL;
}

static int get_interface(struct usb_device *device, const struct setup *s, uint8_t *data)
{
    if (!names_interface(device, s) || s->value != 0 || s->length != 1) return USB_STALL;
    data[0] = 0; /* the only alternate setting */
    return 1;
}

static int set_interface(struct usb_device *device, const struct setup *s, uint8_t *data)
{
    (void)data;
    if (!names_interface(device, s) || s->value != 0 || s->length != 0) return USB_STALL;
    usb_restart_interface(device, s->index);
    return 0;
}

/* ---- endpoint */

static int get_endpoint_status(struct usb_device *device, const struct setup *s, uint8_t *data)
{
    if (device->state == USB_DEFAULT || s->value != 0 || s->length != 2) return USB_STALL;
    if ((s->index & ~USB_DIR_IN) == 0) return put_status(data, 0); /* endpoint 0 never stays halted */
    const struct usb_pipe *pipe = named_pipe(device, s);
    return pipe != NULL ? put_status(data, (unsigned)pipe->halted) : USB_STALL;
}

static int endpoint_feature(struct usb_device *device, const struct setup *s, uint8_t *data)
{
    (void)data;
    struct usb_pipe *pipe = named_pipe(device, s);
    if (pipe == NULL || s->value != USB_ENDPOINT_HALT || s->length != 0) return USB_STALL;
    usb_set_halt(device, pipe, s->request == USB_REQ_SET_FEATURE);
    return 0;
}

/* ---- all of them */

enum { TO_DEVICE = USB_DIR_OUT, FROM_DEVICE = USB_DIR_IN };

static const struct {
    uint8_t type, request;
    handler handle;
} requests[] = {
    {FROM_DEVICE | USB_RECIP_DEVICE, USB_REQ_GET_STATUS, get_device_status},
    {TO_DEVICE | USB_RECIP_DEVICE, USB_REQ_CLEAR_FEATURE, device_feature},
    {TO_DEVICE | USB_RECIP_DEVICE, USB_REQ_SET_FEATURE, device_feature},
    {TO_DEVICE | USB_RECIP_DEVICE, USB_REQ_SET_ADDRESS, set_address},
    {FROM_DEVICE | USB_RECIP_DEVICE, USB_REQ_GET_DESCRIPTOR, get_descriptor},
    {FROM_DEVICE | USB_RECIP_DEVICE, USB_REQ_GET_CONFIGURATION, get_configuration},
    {TO_DEVICE | USB_RECIP_DEVICE, USB_REQ_SET_CONFIGURATION, set_configuration},
    {TO_DEVICE | USB_RECIP_DEVICE, USB_REQ_SET_SEL, set_sel},
    {TO_DEVICE | USB_RECIP_DEVICE, USB_REQ_SET_ISOCH_DELAY, set_isoch_delay},
    {FROM_DEVICE | USB_RECIP_INTERFACE, USB_REQ_GET_STATUS, get_interface_status},
    {TO_DEVICE | USB_RECIP_INTERFACE, USB_REQ_SET_FEATURE, set_interface_feature},
    {FROM_DEVICE | USB_RECIP_INTERFACE, USB_REQ_GET_INTERFACE, get_interface},
    {TO_DEVICE | USB_RECIP_INTERFACE, USB_REQ_SET_INTERFACE, set_interface},
    {FROM_DEVICE | USB_RECIP_ENDPOINT, USB_REQ_GET_STATUS, get_endpoint_status},
    {TO_DEVICE | USB_RECIP_ENDPOINT, USB_REQ_CLEAR_FEATURE, endpoint_feature},
    {TO_DEVICE | USB_RECIP_ENDPOINT, USB_REQ_SET_FEATURE, endpoint_feature},
};

static int standard(struct usb_device *device, const struct setup *s, uint8_t *data)
{
    for (size_t i = 0; i < sizeof requests / sizeof requests[0]; i++)
        if (requests[i].type == s->type && requests[i].request == s->request)
            return requests[i].handle(device, s, data);
    return USB_STALL;
}

static int get_ms_os(const struct usb_device *device, const struct setup *s, uint8_t *data)
{
    const size_t len = usb_describe_ms_os(device->facts.model, data, s->length);
    if (s->value != 0) return USB_STALL;
    return (int)(len < s->length ? len : s->length);
}

/* The interface or endpoint must be there; the rest is the function's to judge. */
static int class_or_vendor(struct usb_device *device, const struct usb_ctrlrequest *raw, const struct setup *s,
                           uint8_t *data)
{
    enum { MS_OS_20_DESCRIPTOR_INDEX = 7 };
    if (s->type == (USB_DIR_IN | USB_TYPE_VENDOR | USB_RECIP_DEVICE) &&
        s->request == device->facts.model->ms_vendor_code && s->index == MS_OS_20_DESCRIPTOR_INDEX &&
        usb_describe_ms_os(device->facts.model, NULL, 0) != 0)
        return get_ms_os(device, s, data);
    const struct setup low = {.index = s->index & 0xff};
    if ((s->type & USB_RECIP_MASK) == USB_RECIP_INTERFACE && !names_interface(device, &low)) return USB_STALL;
    if ((s->type & USB_RECIP_MASK) == USB_RECIP_ENDPOINT && named_pipe(device, s) == NULL) return USB_STALL;
    if (device->hooks.request == NULL || (s->type & USB_RECIP_MASK) > USB_RECIP_OTHER) return USB_STALL;
    int n = device->hooks.request(device->ctx, raw, data);
    return n > s->length ? s->length : n;
}

int usb_device_control(struct usb_device *device, const struct usb_ctrlrequest *setup, uint8_t *data, uint32_t len)
{
    const struct setup s = {setup->bRequestType, setup->bRequest, le_get16(&setup->wValue), le_get16(&setup->wIndex),
                            le_get16(&setup->wLength)};
    if (device->state == USB_DETACHED) return USB_STALL;
    if ((s.type & USB_DIR_IN) == 0 && len != s.length) return USB_STALL;
    switch (s.type & USB_TYPE_MASK) {
    case USB_TYPE_STANDARD:
        return standard(device, &s, data);
    case USB_TYPE_CLASS:
    case USB_TYPE_VENDOR:
        return class_or_vendor(device, setup, &s, data);
    default:
        return USB_STALL;
    }
}
