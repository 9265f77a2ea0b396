/* SPDX-License-Identifier: MIT */
#include "drivers/usb/head_device.h"

#include <linux/usb/cdc.h>
#include <string.h>

#include "core/bytes.h"

enum { SERIAL_STATE_READY = 3, DTR = 1 }; /* carrier and data set ready */

static void set_open(struct scanhead_usb *head, int index, int open)
{
    const struct usb_session_row *row = &head->personality->session[index];
    struct scanhead_usb_session *session = &head->session[index];
    if (session->open == open && !session->again) return;
    session->open = open;
    session->again = 0;
    if (open) return;
    usb_device_next_epoch(head->device, row->out);
    usb_device_next_epoch(head->device, row->in);
}

/* ---- requests */

/* Any rate is accepted: there is no serial line that it could apply to. */
static int set_line_coding(struct scanhead_usb *head, const uint8_t *data)
{
    if (data == NULL) return 0;
    const unsigned stop_bits = data[4], parity = data[5], bits = data[6];
    if (stop_bits > 2 || parity > 4 || !((bits >= 5 && bits <= 8) || bits == 16)) return USB_STALL;
    memcpy(head->line_coding, data, sizeof head->line_coding);
    return 0;
}

static int get_line_coding(const struct scanhead_usb *head, unsigned length, uint8_t *data)
{
    const unsigned n = length < sizeof head->line_coding ? length : sizeof head->line_coding;
    memcpy(data, head->line_coding, n);
    return (int)n;
}

static int set_line_state(struct scanhead_usb *head, int index, unsigned value)
{
    const int dtr = (value & DTR) != 0;
    if (dtr && !head->session[index].open) head->session[index].state_due = 1; /* for the client that opens the port */
    set_open(head, index, dtr);
    return 0;
}

static int port_request(struct scanhead_usb *head, int index, const struct usb_ctrlrequest *setup, uint8_t *data)
{
    const unsigned value = le_get16(&setup->wValue), length = le_get16(&setup->wLength);
    if ((setup->bRequestType & USB_DIR_IN) != 0)
        return setup->bRequest == USB_CDC_REQ_GET_LINE_CODING && value == 0 ? get_line_coding(head, length, data)
                                                                            : USB_STALL;
    switch (setup->bRequest) {
    case USB_CDC_REQ_SET_LINE_CODING:
        return value == 0 && length == sizeof head->line_coding ? set_line_coding(head, data) : USB_STALL;
    case USB_CDC_REQ_SET_CONTROL_LINE_STATE:
        return length == 0 ? set_line_state(head, index, value) : USB_STALL;
    case USB_CDC_REQ_SEND_BREAK: /* there is no line to hold */
        return length == 0 ? 0 : USB_STALL;
    default:
        return USB_STALL;
    }
}

static int stream_request(struct scanhead_usb *head, int index, const struct usb_ctrlrequest *setup, uint8_t *data)
{
    const unsigned value = le_get16(&setup->wValue);
    const int asks = (setup->bRequestType & USB_DIR_IN) != 0;
    if (setup->bRequest != SCANHEAD_USB_STREAM || value > !asks || le_get16(&setup->wLength) != asks) return USB_STALL;
    if (asks) {
        data[0] = (uint8_t)(head->session[index].open || head->session[index].again);
        return 1;
    }
    const int again = value == 1 && head->session[index].open;
    usb_device_set_gone_due(head->device, head->personality->session[index].in, 0);
    set_open(head, index, value == 1 && !again);
    head->session[index].again = again;
    return 0;
}

static int on_request(void *ctx, const struct usb_ctrlrequest *setup, uint8_t *data)
{
    struct scanhead_usb *head = ctx;
    const unsigned type = setup->bRequestType & ~(unsigned)USB_DIR_IN, index = le_get16(&setup->wIndex);
    for (int i = 0; i < head->personality->n_sessions; i++) {
        const struct usb_session_row *row = &head->personality->session[i];
        if (index != row->interface) continue;
        if (type == (USB_TYPE_CLASS | USB_RECIP_INTERFACE) && (row->begins & USB_BEGINS_DTR) != 0)
            return port_request(head, i, setup, data);
        if (type == (USB_TYPE_VENDOR | USB_RECIP_INTERFACE) && (row->begins & USB_BEGINS_REQUEST) != 0)
            return stream_request(head, i, setup, data);
    }
    return USB_STALL;
}

/* ---- interfaces that come and go */

/* 115200 8N1, as a serial port that nobody has set. */
static const uint8_t line_coding_at_rest[7] = {0x00, 0xc2, 0x01, 0x00, 0, 0, 8};

static void on_interface(void *ctx, unsigned interface, int active)
{
    struct scanhead_usb *head = ctx;
    for (int i = 0; i < head->personality->n_sessions; i++) {
        const struct usb_session_row *row = &head->personality->session[i];
        struct scanhead_usb_session *session = &head->session[i];
        if (interface != row->interface && interface != row->also) continue;
        if (interface == row->interface && row->notify != 0) {
            session->state_due = active;
            memcpy(head->line_coding, line_coding_at_rest, sizeof head->line_coding);
        }
        if (active) continue;
        if (session->open) {
            head->cut_due = 1;
            head->cut = usb_facts(head->device)->end;
        }
        set_open(head, i, 0);
    }
}

const char *scanhead_usb_cut(struct scanhead_usb *head)
{
    static const char *const why[] = {
        [USB_END_CONFIGURED] = "the host configured the device again: sessions ended, the device stays plugged in",
        [USB_END_RESET] = "the host reset the bus: sessions ended, the device stays plugged in",
        [USB_END_UNPLUGGED] = "unplugged: sessions ended"};
    if (!head->cut_due) return NULL;
    head->cut_due = 0;
    return why[head->cut];
}

/* ---- the head */

int scanhead_usb_create(const struct usb_personality *personality, const struct usb_identity *id,
                        struct scanhead_usb *head, struct sh_err *err)
{
    static const struct usb_hooks hooks = {.request = on_request, .interface = on_interface};
    head->personality = personality;
    memcpy(head->line_coding, line_coding_at_rest, sizeof head->line_coding);
    return usb_device_create(personality->model, id, &hooks, head, &head->device, err);
}

void scanhead_usb_ended(struct scanhead_usb *head, int session)
{
    if (head->session[session].again) set_open(head, session, 1);
}

static void send_state(struct scanhead_usb *head, int index)
{
    const struct usb_session_row *row = &head->personality->session[index];
    /* bmRequestType, bNotification; wValue, wIndex and wLength of two bytes each; the state */
    const uint8_t type = USB_DIR_IN | USB_TYPE_CLASS | USB_RECIP_INTERFACE;
    const uint8_t notice[] = {type, USB_CDC_NOTIFY_SERIAL_STATE, 0, 0, row->interface, 0, 2, 0, SERIAL_STATE_READY, 0};
    if (usb_device_write(head->device, row->notify, notice, sizeof notice) == sizeof notice)
        head->session[index].state_due = 0;
}

static int has_data(const struct scanhead_usb *head, const struct usb_session_row *row)
{
    uint32_t epoch = 0;
    return usb_device_can_read(head->device, row->out, &epoch) != 0 &&
           epoch == usb_device_epoch(head->device, row->out);
}

void scanhead_usb_update(struct scanhead_usb *head)
{
    for (int i = 0; i < head->personality->n_sessions; i++) {
        const struct usb_session_row *row = &head->personality->session[i];
        if (head->session[i].state_due) send_state(head, i);
        if (!head->session[i].open && (row->begins & USB_BEGINS_DATA) != 0 && has_data(head, row)) set_open(head, i, 1);
    }
}
