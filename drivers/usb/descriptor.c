/* A model as descriptors, byte by byte. */
#include <string.h>

#include "drivers/protocol/bytes.h"
#include "drivers/usb/usb.h"

enum {
    BCD_USB_2 = 0x0210,  /* the least that may have a BOS */
    BCD_USB_3 = 0x0320,  /* at super speed */
    PACKET_0 = 64,       /* bMaxPacketSize0, full and high speed */
    PACKET_0_SUPER = 9,  /* the same at super speed: 2^9 */
    SELF_POWERED = 0x40, /* bmAttributes, with bit 7, which is always set */
    CAP_USB_2_EXTENSION = 2,
    CAP_SUPER_SPEED = 3,
    CAP_PLATFORM = 5,
    LPM = 2,             /* super-speed devices must know link power management at high speed */
    WORKS_FROM_FULL = 1, /* bFunctionalitySupport: complete at full speed already */
    U1_EXIT_US = 10,
    U2_EXIT_US = 2047,
};

/* What does not fit is counted and not written. */
struct sink {
    uint8_t *out;
    size_t room, len;
};

static void put(struct sink *to, const void *bytes, size_t n)
{
    if (to->len < to->room) memcpy(to->out + to->len, bytes, n < to->room - to->len ? n : to->room - to->len);
    to->len += n;
}

static void put8(struct sink *to, unsigned v)
{
    const uint8_t byte = (uint8_t)v;
    put(to, &byte, 1);
}

static void put16(struct sink *to, unsigned v)
{
    uint8_t bytes[2];
    le_put16(bytes, (uint16_t)v);
    put(to, bytes, 2);
}

static void put32(struct sink *to, uint32_t v)
{
    uint8_t bytes[4];
    le_put32(bytes, v);
    put(to, bytes, 4);
}

/* A field that was put before its value was known. */
static void patch16(struct sink *to, size_t at, unsigned v)
{
    if (at < to->room) to->out[at] = (uint8_t)v;
    if (at + 1 < to->room) to->out[at + 1] = (uint8_t)(v >> 8);
}

const struct usb_interface_row *usb_find_row(const struct usb_model *model, unsigned interface, unsigned alt)
{
    for (unsigned i = 0; i < model->n_rows; i++)
        if (model->interface[i].number == interface && model->interface[i].alt == alt) return &model->interface[i];
    return NULL;
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

size_t usb_describe_device(const struct usb_model *model, const struct usb_identity *id, enum usb_rate rate,
                           uint8_t *out, size_t room)
{
    struct sink to = {out, room, 0};
    put8(&to, USB_DT_DEVICE_SIZE);
    put8(&to, USB_DT_DEVICE);
    put16(&to, rate == USB_RATE_SUPER ? BCD_USB_3 : BCD_USB_2);
    put8(&to, model->class);
    put8(&to, model->subclass);
    put8(&to, model->protocol);
    put8(&to, rate == USB_RATE_SUPER ? PACKET_0_SUPER : PACKET_0);
    put16(&to, id->vid);
    put16(&to, id->pid);
    put16(&to, model->bcd_device);
    put8(&to, model->manufacturer);
    put8(&to, model->product);
    put8(&to, serial_index(model, id));
    put8(&to, 1); /* configurations */
    return to.len;
}

/* What the device would be at the other one of full and high speed. */
size_t usb_describe_qualifier(const struct usb_model *model, const struct usb_identity *id, enum usb_rate rate,
                              uint8_t *out, size_t room)
{
    struct sink to = {out, room, 0};
    if (id->highest < USB_RATE_HIGH || rate == USB_RATE_SUPER) return 0;
    put8(&to, 10);
    put8(&to, USB_DT_DEVICE_QUALIFIER);
    put16(&to, BCD_USB_2);
    put8(&to, model->class);
    put8(&to, model->subclass);
    put8(&to, model->protocol);
    put8(&to, PACKET_0);
    put8(&to, 1); /* configurations */
    put8(&to, 0);
    return to.len;
}

static void put_endpoint(struct sink *to, const struct usb_endpoint_row *row, enum usb_rate rate)
{
    put8(to, USB_DT_ENDPOINT_SIZE);
    put8(to, USB_DT_ENDPOINT);
    put8(to, row->address);
    put8(to, row->type);
    put16(to, row->packet[rate]);
    put8(to, row->interval[rate]);
    if (rate != USB_RATE_SUPER) return;
    const unsigned per_interval = row->type == USB_ENDPOINT_XFER_INT ? row->packet[rate] * (row->burst + 1u) : 0;
    put8(to, USB_DT_SS_EP_COMP_SIZE);
    put8(to, USB_DT_SS_ENDPOINT_COMP);
    put8(to, row->burst);
    put8(to, 0); /* no streams */
    put16(to, per_interval);
}

static void put_interface(struct sink *to, const struct usb_interface_row *row, enum usb_rate rate)
{
    put8(to, USB_DT_INTERFACE_SIZE);
    put8(to, USB_DT_INTERFACE);
    put8(to, row->number);
    put8(to, row->alt);
    put8(to, row->n_endpoints);
    put8(to, row->class);
    put8(to, row->subclass);
    put8(to, row->protocol);
    put8(to, row->string);
    if (row->extra_len > 0) put(to, row->extra, row->extra_len);
    for (unsigned i = 0; i < row->n_endpoints; i++)
        put_endpoint(to, &row->endpoint[i], rate);
}

static void put_association(struct sink *to, const struct usb_model *model, unsigned interface)
{
    for (unsigned i = 0; i < model->n_functions; i++) {
        const struct usb_function_row *function = &model->function[i];
        if (function->first != interface || function->count < 2) continue;
        put8(to, USB_DT_INTERFACE_ASSOCIATION_SIZE);
        put8(to, USB_DT_INTERFACE_ASSOCIATION);
        put8(to, function->first);
        put8(to, function->count);
        put8(to, function->class);
        put8(to, function->subclass);
        put8(to, function->protocol);
        put8(to, function->string);
    }
}

static enum usb_rate other_rate(enum usb_rate rate)
{
    return rate == USB_RATE_HIGH ? USB_RATE_FULL : USB_RATE_HIGH;
}

size_t usb_describe_config(const struct usb_model *model, const struct usb_identity *id, enum usb_rate rate,
                           uint8_t type, uint8_t *out, size_t room)
{
    struct sink to = {out, room, 0};
    if (type == USB_DT_OTHER_SPEED_CONFIG) {
        if (id->highest < USB_RATE_HIGH || rate == USB_RATE_SUPER) return 0;
        rate = other_rate(rate);
    }
    const unsigned unit_ma = rate == USB_RATE_SUPER ? 8 : 2;
    put8(&to, USB_DT_CONFIG_SIZE);
    put8(&to, type);
    put16(&to, 0); /* wTotalLength, below */
    put8(&to, model->n_interfaces);
    put8(&to, USB_CONFIGURATION);
    put8(&to, 0);
    put8(&to, 0x80 | (model->max_power_ma == 0 ? SELF_POWERED : 0));
    put8(&to, (model->max_power_ma + unit_ma - 1) / unit_ma);
    for (unsigned i = 0; i < model->n_rows; i++) {
        if (model->interface[i].alt == 0) put_association(&to, model, model->interface[i].number);
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
    put8(to, 28);
    put8(to, USB_DT_DEVICE_CAPABILITY);
    put8(to, CAP_PLATFORM);
    put8(to, 0);
    put(to, uuid, sizeof uuid);
    put32(to, 0x06030000);
    put16(to, (unsigned)set_len);
    put8(to, model->ms_vendor_code);
    put8(to, 0); /* no alternate enumeration */
}

size_t usb_describe_bos(const struct usb_model *model, const struct usb_identity *id, uint8_t *out, size_t room)
{
    struct sink to = {out, room, 0};
    const int super = id->highest == USB_RATE_SUPER;
    const size_t ms_len = usb_describe_ms_os(model, NULL, 0);
    put8(&to, USB_DT_BOS_SIZE);
    put8(&to, USB_DT_BOS);
    put16(&to, 0); /* wTotalLength, below */
    put8(&to, 1u + (unsigned)super + (ms_len != 0));
    put8(&to, USB_DT_USB_EXT_CAP_SIZE);
    put8(&to, USB_DT_DEVICE_CAPABILITY);
    put8(&to, CAP_USB_2_EXTENSION);
    put32(&to, super ? LPM : 0);
    if (super) {
        put8(&to, USB_DT_USB_SS_CAP_SIZE);
        put8(&to, USB_DT_DEVICE_CAPABILITY);
        put8(&to, CAP_SUPER_SPEED);
        put8(&to, 0);       /* no latency tolerance messages */
        put16(&to, 0x000e); /* full, high and super speed */
        put8(&to, WORKS_FROM_FULL);
        put8(&to, U1_EXIT_US);
        put16(&to, U2_EXIT_US);
    }
    if (ms_len != 0) put_ms_platform(&to, model, ms_len);
    patch16(&to, 2, (unsigned)to.len);
    return to.len;
}

/* ---- strings */

/* The next code point of UTF-8; anything malformed is one U+FFFD per byte. */
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

/* As many whole characters as fit into `max` bytes of UTF-16LE. */
static void put_utf16(struct sink *to, const char *text, size_t max)
{
    const size_t end = to->len + max;
    for (const uint8_t *at = (const uint8_t *)text; *at != 0;) {
        uint32_t code = take_utf8(&at);
        if (to->len + (code > 0xffff ? 4 : 2) > end) return;
        if (code > 0xffff) {
            put16(to, 0xd800 + ((code - 0x10000) >> 10));
            code = 0xdc00 + ((code - 0x10000) & 0x3ff);
        }
        put16(to, code);
    }
}

size_t usb_describe_string(const struct usb_model *model, const struct usb_identity *id, uint8_t index, uint8_t *out,
                           size_t room)
{
    struct sink to = {out, room, 0};
    const unsigned n = count_strings(model), serial = serial_index(model, id);
    if (index > n && (serial == 0 || index != serial)) return 0;
    put8(&to, 0); /* bLength, below */
    put8(&to, USB_DT_STRING);
    if (index == 0)
        put16(&to, USB_LANGID);
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
    put16(to, 10 + name_len + data_len);
    put16(to, MS_PROPERTY);
    put16(to, MS_MULTI_SZ);
    put16(to, name_len);
    put_utf16(to, name, name_len);
    put16(to, 0);
    put16(to, data_len);
    put_utf16(to, guid, data_len);
    put32(to, 0); /* end of the string, end of the list */
}

static void put_ms_function(struct sink *to, const struct usb_function_row *function)
{
    char id[16] = {0};
    const size_t start = to->len;
    put16(to, 8);
    put16(to, MS_FUNCTION);
    put8(to, function->first);
    put8(to, 0);
    put16(to, 0); /* length, below */
    put16(to, 20);
    put16(to, MS_COMPATIBLE_ID);
    memcpy(id, function->compatible_id, strnlen(function->compatible_id, 8));
    put(to, id, sizeof id);
    if (function->guid != NULL) put_property(to, function->guid);
    patch16(to, start + 6, (unsigned)(to->len - start));
}

size_t usb_describe_ms_os(const struct usb_model *model, uint8_t *out, size_t room)
{
    struct sink to = {out, room, 0};
    unsigned n = 0;
    put16(&to, 10);
    put16(&to, MS_SET_HEADER);
    put32(&to, 0x06030000);
    put16(&to, 0); /* length of the set, below */
    put16(&to, 8);
    put16(&to, MS_CONFIGURATION);
    put8(&to, 0); /* index, not value, of the configuration */
    put8(&to, 0);
    put16(&to, 0); /* length of the subset, below */
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
