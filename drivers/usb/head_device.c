#include "drivers/usb/head_device.h"

#include <linux/usb/cdc.h>
#include <string.h>

#include "drivers/protocol/bytes.h"

enum { SERIAL_STATE_READY = 3, DTR = 1 }; /* carrier and data set ready */
/* bInterfaceProtocol: no AT commands (1). Modem managers send those to every port that says it takes them. */
enum { CONSOLE_PROTOCOL = USB_CDC_PROTO_NONE };

static const char *const strings[] = {"scanhead", "Laser scanner head", "Scanner console", "Scanner stream", NULL};
enum { STRING_MAKER = 1, STRING_PRODUCT, STRING_CONSOLE, STRING_STREAM };

/* clang-format off */
static const uint8_t console_extra[] = {
    5, USB_DT_CS_INTERFACE, USB_CDC_HEADER_TYPE, 0x20, 0x01, /* CDC 1.20 */
    5, USB_DT_CS_INTERFACE, USB_CDC_CALL_MANAGEMENT_TYPE, 0, CONSOLE_DATA_INTERFACE, /* no call management */
    4, USB_DT_CS_INTERFACE, USB_CDC_ACM_TYPE, USB_CDC_CAP_LINE | USB_CDC_CAP_BRK, /* line coding and state, break */
    5, USB_DT_CS_INTERFACE, USB_CDC_UNION_TYPE, CONSOLE_INTERFACE, CONSOLE_DATA_INTERFACE, /* both interfaces */
};
static const uint8_t state_notice[] = {
    USB_DIR_IN | USB_TYPE_CLASS | USB_RECIP_INTERFACE, USB_CDC_NOTIFY_SERIAL_STATE,
    0, 0, CONSOLE_INTERFACE, 0, 2, 0, /* wValue, wIndex, wLength */
    SERIAL_STATE_READY, 0,
};
/* clang-format on */

#define BULK(number, bursts)                                                                              \
    {                                                                                                     \
        .address = (number), .type = USB_ENDPOINT_XFER_BULK, .packet = {64, 512, 1024}, .burst = (bursts) \
    }

/* An interrupt every 16 ms: in frames at full speed, as 2^(n-1) microframes above. */
static const struct usb_endpoint_row notify_endpoints[] = {
    {.address = CONSOLE_NOTIFY, .type = USB_ENDPOINT_XFER_INT, .packet = {16, 16, 16}, .interval = {16, 8, 8}}};
static const struct usb_endpoint_row console_endpoints[] = {BULK(CONSOLE_IN, 0), BULK(CONSOLE_OUT, 0)};
static const struct usb_endpoint_row stream_endpoints[] = {BULK(STREAM_IN, 15), BULK(STREAM_OUT, 0)};

static const struct usb_interface_row interfaces[] = {
    {.number = CONSOLE_INTERFACE,
     .class = USB_CLASS_COMM,
     .subclass = USB_CDC_SUBCLASS_ACM,
     .protocol = CONSOLE_PROTOCOL,
     .string = STRING_CONSOLE,
     .extra = console_extra,
     .extra_len = sizeof console_extra,
     .endpoint = notify_endpoints,
     .n_endpoints = 1},
    {.number = CONSOLE_DATA_INTERFACE, .class = USB_CLASS_CDC_DATA, .endpoint = console_endpoints, .n_endpoints = 2},
    {.number = STREAM_INTERFACE,
     .class = USB_CLASS_VENDOR_SPEC,
     .subclass = SCANHEAD_USB_SUBCLASS,
     .protocol = SCANHEAD_USB_PROTOCOL,
     .string = STRING_STREAM,
     .endpoint = stream_endpoints,
     .n_endpoints = 2},
};

static const struct usb_function_row functions[] = {
    {.first = CONSOLE_INTERFACE,
     .count = 2,
     .class = USB_CLASS_COMM,
     .subclass = USB_CDC_SUBCLASS_ACM,
     .protocol = CONSOLE_PROTOCOL,
     .string = STRING_CONSOLE},
    {.first = STREAM_INTERFACE,
     .count = 1,
     .class = USB_CLASS_VENDOR_SPEC,
     .subclass = SCANHEAD_USB_SUBCLASS,
     .protocol = SCANHEAD_USB_PROTOCOL,
     .string = STRING_STREAM,
     .compatible_id = "WINUSB",
     .guid = "{6FBB5A1C-2E0D-4C55-9E0B-6C7B1D5A7A53}"},
};

/* Class triple EF 02 01: look for interface association descriptors. */
const struct usb_model scanhead_usb_model = {
    .class = USB_CLASS_MISC,
    .subclass = 2,
    .protocol = 1,
    .bcd_device = 0x0100,
    .string = strings,
    .manufacturer = STRING_MAKER,
    .product = STRING_PRODUCT,
    .function = functions,
    .interface = interfaces,
    .n_functions = 2,
    .n_interfaces = 3,
    .n_rows = 3,
    .ms_vendor_code = 0x20,
};

static void set_open(struct scanhead_usb *head, int index, int open)
{
    struct scanhead_usb_session *session = &head->session[index];
    if (session->open == open && !session->again) return;
    session->open = open;
    session->again = 0;
    if (open) return;
    usb_device_next_epoch(head->device, session->out);
    usb_device_next_epoch(head->device, session->in);
}

static int set_line_coding(struct scanhead_usb *head, const uint8_t *data)
{
    if (data == NULL) return 0;
    const unsigned stop_bits = data[4], parity = data[5], bits = data[6];
    if (stop_bits > 2 || parity > 4 || !((bits >= 5 && bits <= 8) || bits == 16)) return USB_STALL;
    memcpy(head->line_coding, data, sizeof head->line_coding);
    return 0;
}

static int console_request(struct scanhead_usb *head, uint8_t request, unsigned value, unsigned length, uint8_t *data)
{
    switch (request) {
    case USB_CDC_REQ_SET_LINE_CODING:
        return value == 0 && length == sizeof head->line_coding ? set_line_coding(head, data) : USB_STALL;
    case USB_CDC_REQ_SET_CONTROL_LINE_STATE:
        if (length != 0 || (value & ~3u) != 0) return USB_STALL;
        if ((value & DTR) != 0 && !head->session[CONSOLE_SESSION].open) head->state_due = 1; /* to who opens the port */
        set_open(head, CONSOLE_SESSION, (value & DTR) != 0);
        return 0;
    case USB_CDC_REQ_SEND_BREAK: /* there is no line to hold */
        return length == 0 ? 0 : USB_STALL;
    default:
        return USB_STALL;
    }
}

static int on_request(void *ctx, const struct usb_ctrlrequest *setup, uint8_t *data)
{
    struct scanhead_usb *head = ctx;
    const unsigned value = le_get16(&setup->wValue), index = le_get16(&setup->wIndex),
                   length = le_get16(&setup->wLength);
    if (setup->bRequestType == (USB_DIR_OUT | USB_TYPE_CLASS | USB_RECIP_INTERFACE) && index == CONSOLE_INTERFACE)
        return console_request(head, setup->bRequest, value, length, data);
    if (setup->bRequestType == (USB_DIR_IN | USB_TYPE_CLASS | USB_RECIP_INTERFACE) && index == CONSOLE_INTERFACE &&
        setup->bRequest == USB_CDC_REQ_GET_LINE_CODING && value == 0) {
        const unsigned n = length < sizeof head->line_coding ? length : sizeof head->line_coding;
        memcpy(data, head->line_coding, n);
        return (int)n;
    }
    if (setup->bRequestType == (USB_DIR_OUT | USB_TYPE_VENDOR | USB_RECIP_INTERFACE) && index == STREAM_INTERFACE &&
        setup->bRequest == SCANHEAD_USB_STREAM && value <= 1 && length == 0) {
        const int again = value == 1 && head->session[STREAM_SESSION].open;
        set_open(head, STREAM_SESSION, value == 1 && !again);
        head->session[STREAM_SESSION].again = again;
        return 0;
    }
    return USB_STALL;
}

void scanhead_usb_ended(struct scanhead_usb *head, int session)
{
    if (head->session[session].again) set_open(head, session, 1);
}

/* 115200 8N1, as a serial port that nobody has set. */
static const uint8_t line_coding_at_rest[7] = {0x00, 0xc2, 0x01, 0x00, 0, 0, 8};

static void on_interface(void *ctx, unsigned interface, int active)
{
    struct scanhead_usb *head = ctx;
    if (interface == CONSOLE_INTERFACE) {
        head->state_due = active;
        memcpy(head->line_coding, line_coding_at_rest, sizeof head->line_coding);
    }
    const int session = interface == STREAM_INTERFACE ? STREAM_SESSION : CONSOLE_SESSION;
    if (active) return;
    if (head->session[session].open) {
        head->cut_due = 1;
        head->cut = usb_device_end(head->device);
    }
    set_open(head, session, 0);
}

const char *scanhead_usb_cut(struct scanhead_usb *head)
{
    static const char *const why[] = {
        [USB_END_CONFIGURED] = "the host configured the device anew: sessions ended, the device stays plugged in",
        [USB_END_RESET] = "the host reset the bus: sessions ended, the device stays plugged in",
        [USB_END_UNPLUGGED] = "unplugged: sessions ended"};
    if (!head->cut_due) return NULL;
    head->cut_due = 0;
    return why[head->cut];
}

int scanhead_usb_create(const struct usb_identity *id, struct scanhead_usb *head, struct sh_err *err)
{
    static const struct usb_hooks hooks = {.request = on_request, .interface = on_interface};
    head->session[CONSOLE_SESSION] = (struct scanhead_usb_session){.in = CONSOLE_IN, .out = CONSOLE_OUT};
    head->session[STREAM_SESSION] = (struct scanhead_usb_session){.in = STREAM_IN, .out = STREAM_OUT};
    memcpy(head->line_coding, line_coding_at_rest, sizeof head->line_coding);
    return usb_device_create(&scanhead_usb_model, id, &hooks, head, &head->device, err);
}

void scanhead_usb_update(struct scanhead_usb *head)
{
    uint32_t epoch = 0;
    if (head->state_due &&
        usb_device_write(head->device, CONSOLE_NOTIFY, state_notice, sizeof state_notice) == sizeof state_notice)
        head->state_due = 0;
    if (!head->session[STREAM_SESSION].open && usb_device_can_read(head->device, STREAM_OUT, &epoch) != 0 &&
        epoch == usb_device_epoch(head->device, STREAM_OUT))
        set_open(head, STREAM_SESSION, 1);
}
