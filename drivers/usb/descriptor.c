/* SPDX-License-Identifier: MIT */
/* A model as descriptors, byte by byte. */
#include <string.h>

#include "drivers/usb/model.h"

enum {
    BCD_USB_2 = 0x0200,
    BCD_USB_2_BOS = 0x0210, /* the least that may have a BOS */
    BCD_USB_3 = 0x0320,     /* at super speed */
    PACKET_0 = 64,          /* bMaxPacketSize0, full and high speed */
    PACKET_0_SUPER = 9,     /* the same at super speed: 2^9 */
    SELF_POWERED = 0x40,    /* a bit of bmAttributes, whose bit 7 is always set, too */
    CAP_USB_2_EXTENSION = 2,
    CAP_SUPER_SPEED = 3,
    CAP_PLATFORM = 5,
    LPM = 2,             /* super-speed devices must know link power management at high speed */
    WORKS_FROM_FULL = 1, /* bFunctionalitySupport: complete at full speed already */
    U1_EXIT_US = 10,
    U2_EXIT_US = 2047,
    NO_LATENCY_MESSAGES = 0,
    FULL_TO_SUPER = 0x000e, /* wSpeedsSupported: full, high and super speed */
    NO_STREAMS = 0,
    N_CONFIGURATIONS = 1,
    MS_WINDOWS = 0x06030000, /* the oldest that knows the set: 8.1 */
    LATER = 0,               /* a length that patch16 puts in at the end */
};

/* Bytes that do not fit are counted and not written. */
struct sink {
    uint8_t *out;
    size_t room, len;
};

static void descriptor_put(struct sink *to, const void *bytes, size_t n)
{
    if (to->len < to->room) memcpy(to->out + to->len, bytes, n < to->room - to->len ? n : to->room - to->len);
    to->len += n;
}

/* Fields of a descriptor as its bytes. */
#define PUT(to, ...) descriptor_put(to, (const uint8_t[]){__VA_ARGS__}, sizeof((const uint8_t[]){__VA_ARGS__}))
#define U8(v)        (uint8_t)(v)
#define U16(v)       U8(v), U8((v) >> 8)
#define U32(v)       U16(v), U16((v) >> 16)

/* Fills in a length that was not known when its place was put. */
static void patch16(struct sink *to, size_t at, unsigned v)
{
    if (at < to->room) to->out[at] = (uint8_t)v;
    if (at + 1 < to->room) to->out[at + 1] = (uint8_t)(v >> 8);
}

static unsigned count_strings(const struct usb_model *model)
{
    unsigned n = 0;
    while (model->string != NULL && model->string[n] != NULL)
        n++;
    return n;
}

static unsigned serial_index(const struct usb_model *model, const struct usb_identity *id)
{
    return id->serial[0] != '\0' ? count_strings(model) + 1 : 0;
}

/* Below super speed the one thing that a BOS can say is the platform capability. */
static int has_bos(const struct usb_model *model, const struct usb_identity *id)
{
    return id->highest == USB_RATE_SUPER || usb_describe_ms_os(model, NULL, 0) != 0;
}

static unsigned bcd_usb(const struct usb_model *model, const struct usb_identity *id, enum usb_rate rate)
{
    return rate == USB_RATE_SUPER ? BCD_USB_3 : has_bos(model, id) ? BCD_USB_2_BOS : BCD_USB_2;
}

size_t usb_describe_device(const struct usb_model *model, const struct usb_identity *id, enum usb_rate rate,
                           uint8_t *out, size_t room)
{
    struct sink to = {out, room, 0};
    const int super = rate == USB_RATE_SUPER;
    PUT(&to, USB_DT_DEVICE_SIZE, USB_DT_DEVICE, U16(bcd_usb(model, id, rate)), model->class, model->subclass,
        model->protocol, super ? PACKET_0_SUPER : PACKET_0, U16(id->vid), U16(id->pid), U16(model->bcd_device),
        model->manufacturer, model->product, U8(serial_index(model, id)), N_CONFIGURATIONS);
    return to.len;
}

/* Describes the device at the other one of full and high speed. */
size_t usb_describe_qualifier(const struct usb_model *model, const struct usb_identity *id, enum usb_rate rate,
                              uint8_t *out, size_t room)
{
    struct sink to = {out, room, 0};
    if (id->highest < USB_RATE_HIGH || rate == USB_RATE_SUPER) return 0;
    PUT(&to, 10, USB_DT_DEVICE_QUALIFIER, U16(bcd_usb(model, id, rate)), model->class, model->subclass, model->protocol,
        PACKET_0, N_CONFIGURATIONS, 0);
    return to.len;
}

static void put_endpoint(struct sink *to, const struct usb_endpoint_row *row, enum usb_rate rate)
{
    PUT(to, USB_DT_ENDPOINT_SIZE, USB_DT_ENDPOINT, row->address, row->type, U16(row->packet[rate]),
        row->interval[rate]);
    if (rate != USB_RATE_SUPER) return;
    const unsigned per_interval = row->type == USB_ENDPOINT_XFER_INT ? row->packet[rate] * (row->burst + 1u) : 0;
    PUT(to, USB_DT_SS_EP_COMP_SIZE, USB_DT_SS_ENDPOINT_COMP, row->burst, NO_STREAMS, U16(per_interval));
}

static void put_interface(struct sink *to, const struct usb_interface_row *row, enum usb_rate rate)
{
    PUT(to, USB_DT_INTERFACE_SIZE, USB_DT_INTERFACE, row->number, 0, row->n_endpoints, row->class, row->subclass,
        row->protocol, row->string);
    if (row->extra != NULL) descriptor_put(to, row->extra, row->extra_len);
    for (unsigned i = 0; i < row->n_endpoints; i++)
        put_endpoint(to, &row->endpoint[i], rate);
}

static void put_association(struct sink *to, const struct usb_model *model, unsigned interface)
{
    for (unsigned i = 0; i < model->n_functions; i++) {
        const struct usb_function_row *function = &model->function[i];
        if (function->first != interface || function->count < 2 || model->class != USB_CLASS_MISC) continue;
        PUT(to, USB_DT_INTERFACE_ASSOCIATION_SIZE, USB_DT_INTERFACE_ASSOCIATION, function->first, function->count,
            function->class, function->subclass, function->protocol, function->string);
    }
}

size_t usb_describe_config(const struct usb_model *model, const struct usb_identity *id, enum usb_rate rate,
                           uint8_t type, uint8_t *out, size_t room)
{
    struct sink to = {out, room, 0};
    if (type == USB_DT_OTHER_SPEED_CONFIG) {
        if (id->highest < USB_RATE_HIGH || rate == USB_RATE_SUPER) return 0;
        rate = rate == USB_RATE_HIGH ? USB_RATE_FULL : USB_RATE_HIGH;
    }
    const unsigned unit_ma = rate == USB_RATE_SUPER ? 8 : 2;
    PUT(&to, USB_DT_CONFIG_SIZE, type, U16(LATER), model->n_interfaces, USB_CONFIGURATION, model->configuration,
        0x80 | (usb_is_self_powered(model) ? SELF_POWERED : 0), U8((model->max_power_ma + unit_ma - 1) / unit_ma));
    for (unsigned i = 0; i < model->n_interfaces; i++) {
        put_association(&to, model, i);
        put_interface(&to, &model->interface[i], rate);
    }
    patch16(&to, 2, (unsigned)to.len);
    return to.len;
}

/* Microsoft OS 2.0 platform capability, D8DD60DF-4589-4CC7-9CD2-659D9E648A9F, Windows 8.1 and later. */
static void put_ms_platform(struct sink *to, const struct usb_model *model, size_t set_len)
{
    static const uint8_t uuid[16] = {0xdf, 0x60, 0xdd, 0xd8, 0x89, 0x45, 0xc7, 0x4c,
                                     0x9c, 0xd2, 0x65, 0x9d, 0x9e, 0x64, 0x8a, 0x9f};
    PUT(to, 28, USB_DT_DEVICE_CAPABILITY, CAP_PLATFORM, 0);
    descriptor_put(to, uuid, sizeof uuid);
    PUT(to, U32(MS_WINDOWS), U16(set_len), model->ms_vendor_code, 0); /* 0: no alternate enumeration */
}

size_t usb_describe_bos(const struct usb_model *model, const struct usb_identity *id, uint8_t *out, size_t room)
{
    struct sink to = {out, room, 0};
    const int super = id->highest == USB_RATE_SUPER;
    const size_t ms_len = usb_describe_ms_os(model, NULL, 0);
    if (!has_bos(model, id)) return 0;
    PUT(&to, USB_DT_BOS_SIZE, USB_DT_BOS, U16(LATER), U8(2 * super + (ms_len != 0)));
    if (super) {
        PUT(&to, USB_DT_USB_EXT_CAP_SIZE, USB_DT_DEVICE_CAPABILITY, CAP_USB_2_EXTENSION, U32(LPM));
        PUT(&to, USB_DT_USB_SS_CAP_SIZE, USB_DT_DEVICE_CAPABILITY, CAP_SUPER_SPEED, NO_LATENCY_MESSAGES,
            U16(FULL_TO_SUPER), WORKS_FROM_FULL, U1_EXIT_US, U16(U2_EXIT_US));
    }
    if (ms_len != 0) put_ms_platform(&to, model, ms_len);
    patch16(&to, 2, (unsigned)to.len);
    return to.len;
}

/* ---- strings */

/* Takes the next code point of UTF-8. A byte that begins none is U+FFFD. */
static uint32_t take_utf8(const uint8_t **at)
{
    const uint8_t *p = *at;
    const int n = p[0] < 0x80 ? 1 : p[0] >> 5 == 6 ? 2 : p[0] >> 4 == 14 ? 3 : p[0] >> 3 == 30 ? 4 : 0;
    uint32_t code = n == 1 ? p[0] : (uint32_t)p[0] & (0x7fu >> n);
    for (int i = 1; i < n; i++) {
        if (p[i] >> 6 != 2) {
            *at = p + 1;
            return 0xfffd;
        }
        code = code << 6 | (p[i] & 0x3fu);
    }
    *at = p + (n > 0 ? n : 1);
    return n > 0 && code <= 0x10ffff ? code : 0xfffd;
}

/* Puts as many whole characters as fit into `max` bytes of UTF-16LE. */
static void put_utf16(struct sink *to, const char *text, size_t max)
{
    const size_t end = to->len + max;
    for (const uint8_t *at = (const uint8_t *)text; *at != 0;) {
        uint32_t code = take_utf8(&at);
        if (to->len + (code > 0xffff ? 4 : 2) > end) return;
        if (code > 0xffff) {
            PUT(to, U16(0xd800 + ((code - 0x10000) >> 10)));
            code = 0xdc00 + ((code - 0x10000) & 0x3ff);
        }
        PUT(to, U16(code));
    }
}

size_t usb_describe_string(const struct usb_model *model, const struct usb_identity *id, uint8_t index, uint8_t *out,
                           size_t room)
{
    struct sink to = {out, room, 0};
    const unsigned n = count_strings(model), serial = serial_index(model, id);
    if (index > n && (serial == 0 || index != serial)) return 0;
    PUT(&to, LATER, USB_DT_STRING);
    if (index == 0)
        PUT(&to, U16(USB_LANGID));
    else
        put_utf16(&to, index == serial ? id->serial : model->string[index - 1], 252);
    if (room > 0) out[0] = (uint8_t)to.len;
    return to.len;
}

/* ---- Microsoft OS 2.0: one function subset for each function with a compatible id */

enum { MS_SET_HEADER, MS_CONFIGURATION, MS_FUNCTION, MS_COMPATIBLE_ID, MS_PROPERTY };
enum { MS_MULTI_SZ = 7 };

static void put_property(struct sink *to, const char *guid)
{
    static const char name[] = "DeviceInterfaceGUIDs";
    const unsigned name_len = 2 * sizeof name, data_len = 2 * ((unsigned)strlen(guid) + 2);
    PUT(to, U16(10 + name_len + data_len), U16(MS_PROPERTY), U16(MS_MULTI_SZ), U16(name_len));
    put_utf16(to, name, name_len);
    PUT(to, U16(0), U16(data_len));
    put_utf16(to, guid, data_len);
    PUT(to, U16(0), U16(0)); /* end of the string, end of the list */
}

static void put_ms_function(struct sink *to, const struct usb_function_row *function)
{
    char id[16] = {0};
    const size_t start = to->len;
    PUT(to, U16(8), U16(MS_FUNCTION), function->first, 0, U16(LATER));
    PUT(to, U16(20), U16(MS_COMPATIBLE_ID));
    memcpy(id, function->compatible_id, strnlen(function->compatible_id, 8));
    descriptor_put(to, id, sizeof id);
    if (function->guid != NULL) put_property(to, function->guid);
    patch16(to, start + 6, (unsigned)(to->len - start));
}

size_t usb_describe_ms_os(const struct usb_model *model, uint8_t *out, size_t room)
{
    struct sink to = {out, room, 0};
    unsigned n = 0;
    PUT(&to, U16(10), U16(MS_SET_HEADER), U32(MS_WINDOWS), U16(LATER));
    PUT(&to, U16(8), U16(MS_CONFIGURATION), 0, 0, U16(LATER)); /* index, not value, of the configuration */
    for (unsigned i = 0; i < model->n_functions; i++) {
        if (model->function[i].compatible_id == NULL) continue;
        put_ms_function(&to, &model->function[i]);
        n++;
    }
    if (n == 0) return 0;
    patch16(&to, 8, (unsigned)to.len);
    patch16(&to, 16, (unsigned)to.len - 10);
    return to.len;
}
