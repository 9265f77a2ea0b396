/* SPDX-License-Identifier: MIT */
/* The usbredir back end: descriptions of the device, and control requests. */
#include "drivers/usb/backend.h"

#ifdef HAVE_USBREDIR

#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "core/monotonic.h"
#include "drivers/usb/usbredir_private.h"

/* ---- what the device is */

static void send_interfaces(struct usbredir *self)
{
    const struct usb_model *model = usb_device_model(self->device);
    struct usb_redir_interface_info_header info = {.interface_count = model->n_interfaces};
    struct usb_redir_ep_info_header eps = {0};
    memset(eps.type, usb_redir_type_invalid, sizeof eps.type);
    eps.type[0] = eps.type[16] = usb_redir_type_control;
    for (unsigned i = 0; i < model->n_interfaces; i++) {
        const struct usb_interface_row *row = usb_device_row(self->device, i);
        if (row == NULL) row = usb_find_row(model, i, 0);
        info.interface[i] = row->number;
        info.interface_class[i] = row->class;
        info.interface_subclass[i] = row->subclass;
        info.interface_protocol[i] = row->protocol;
        for (unsigned k = 0; k < row->n_endpoints; k++) {
            const struct usb_endpoint_row *ep = &row->endpoint[k];
            const unsigned at = usb_endpoint_index(ep->address);
            eps.type[at] = ep->type;
            eps.interval[at] = ep->interval[usb_device_rate(self->device)];
            eps.interface[at] = row->number;
            eps.max_packet_size[at] = ep->packet[usb_device_rate(self->device)];
        }
    }
    usbredirparser_send_interface_info(self->parser, &info);
    usbredirparser_send_ep_info(self->parser, &eps);
}

static void attach(struct usbredir *self)
{
    usb_device_attach(self->device, usb_device_identity(self->device)->highest, usbredir_on_complete, self);
    usb_device_assume_address(self->device); /* the guest's controller gives out addresses, and keeps them */
}

void usbredir_plug(struct usbredir *self)
{
    static const uint8_t speed[] = {[USB_RATE_FULL] = usb_redir_speed_full,
                                    [USB_RATE_HIGH] = usb_redir_speed_high,
                                    [USB_RATE_SUPER] = usb_redir_speed_super};
    const struct usb_model *model = usb_device_model(self->device);
    const struct usb_identity *id = usb_device_identity(self->device);
    attach(self);
    send_interfaces(self);
    struct usb_redir_device_connect_header connect = {.speed = speed[id->highest],
                                                      .device_class = model->class,
                                                      .device_subclass = model->subclass,
                                                      .device_protocol = model->protocol,
                                                      .vendor_id = id->vid,
                                                      .product_id = id->pid,
                                                      .device_version_bcd = model->bcd_device};
    usbredirparser_send_device_connect(self->parser, &connect);
}

static void on_hello(void *priv, struct usb_redir_hello_header *hello)
{
    struct usbredir *self = priv;
    (void)hello;
    self->greeted = 1;
    if (!self->unplugged) usbredir_plug(self);
}

int usbredir_is_early(struct usbredir *self)
{
    if (!self->greeted) self->broken = 1;
    return !self->greeted;
}

/* ---- requests */

static int request(struct usbredir *self, const struct usb_redir_control_packet_header *header, uint8_t *data)
{
    struct usb_ctrlrequest setup = {.bRequestType = header->requesttype, .bRequest = header->request};
    le_put16(&setup.wValue, header->value);
    le_put16(&setup.wIndex, header->index);
    le_put16(&setup.wLength, header->length);
    return usb_device_control(self->device, &setup, data, header->length);
}

static void on_reset(void *priv)
{
    struct usbredir *self = priv;
    if (usbredir_is_early(self)) return;
    usb_device_reset(self->device, usb_device_rate(self->device));
    usb_device_assume_address(self->device);
}

static void set_configuration(struct usbredir *self, uint64_t id, const struct usb_redir_control_packet_header *header)
{
    const int rc = request(self, header, NULL);
    if (rc == 0) send_interfaces(self);
    struct usb_redir_configuration_status_header status = {.status = rc == 0 ? usb_redir_success : usb_redir_stall,
                                                           .configuration =
                                                               (uint8_t)usb_device_configuration(self->device)};
    usbredirparser_send_configuration_status(self->parser, id, &status);
}

static void send_alt(struct usbredir *self, uint64_t id, unsigned interface, int ok)
{
    const struct usb_interface_row *row = usb_device_row(self->device, interface);
    struct usb_redir_alt_setting_status_header status = {.status =
                                                             ok && row != NULL ? usb_redir_success : usb_redir_stall,
                                                         .interface = (uint8_t)interface,
                                                         .alt = row != NULL ? row->alt : 0};
    usbredirparser_send_alt_setting_status(self->parser, id, &status);
}

static void set_alt(struct usbredir *self, uint64_t id, const struct usb_redir_control_packet_header *header)
{
    const int rc = request(self, header, NULL);
    if (rc == 0) send_interfaces(self);
    send_alt(self, id, header->index, rc == 0);
}

static void answer_control(struct usbredir *self, uint64_t id, struct usb_redir_control_packet_header *header,
                           const uint8_t *out, int len)
{
    const int in = (header->requesttype & USB_DIR_IN) != 0;
    uint8_t *room = malloc((size_t)header->length + 1);
    int n = USB_STALL;
    if (room != NULL && !in && len == header->length && len > 0) memcpy(room, out, (size_t)len);
    if (room != NULL && len == (in ? 0 : header->length)) n = request(self, header, room);
    header->status = n >= 0 ? usb_redir_success : usb_redir_stall;
    header->length = n < 0 ? 0 : in ? (uint16_t)n : header->length;
    /* As with bulk: no data pointer in the answer to an OUT. */
    usbredirparser_send_control_packet(self->parser, id, header, in && n > 0 ? room : NULL, in && n > 0 ? n : 0);
    free(room);
}

/* ---- requests held by an injected fault */

enum { MAX_SLOW = 256 };

enum request_kind { CONTROL, SET_CONFIGURATION, SET_ALT };

struct redir_request {
    struct redir_request *next;
    int64_t due_ns;
    enum request_kind kind;
    uint64_t id;
    struct usb_redir_control_packet_header header;
    uint8_t *data; /* the parser's; NULL: none */
    int len;
};

/* Takes the data over. */
static void answer(struct usbredir *self, struct redir_request *r)
{
    if (r->kind == SET_CONFIGURATION)
        set_configuration(self, r->id, &r->header);
    else if (r->kind == SET_ALT)
        set_alt(self, r->id, &r->header);
    else
        answer_control(self, r->id, &r->header, r->data, r->len);
    usbredirparser_free_packet_data(self->parser, r->data);
}

/* Held requests are answered one after the other: each takes the delay that was asked for. */
static void hold(struct usbredir *self, const struct redir_request *given)
{
    const int64_t now_ns = monotonic_ns();
    const int64_t from_ns =
        self->slow_last != NULL && self->slow_last->due_ns > now_ns ? self->slow_last->due_ns : now_ns;
    struct redir_request *r = self->n_slow < MAX_SLOW ? malloc(sizeof *r) : NULL;
    if (r == NULL) {
        usbredirparser_free_packet_data(self->parser, given->data);
        self->broken = 1;
        return;
    }
    *r = *given;
    r->next = NULL;
    r->due_ns = from_ns + (int64_t)(usb_device_slow_ms(self->device) * 1e6);
    *(self->slow_last != NULL ? &self->slow_last->next : &self->slow_first) = r;
    self->slow_last = r;
    self->n_slow++;
}

static void usbredir_requests_take(struct usbredir *self, struct redir_request r)
{
    if (usb_device_slow_ms(self->device) > 0.0 || self->slow_first != NULL)
        hold(self, &r);
    else
        answer(self, &r);
}

/* Takes a request out of those that are held; before: the one before it, NULL for the first. */
static struct redir_request *let_go(struct usbredir *self, struct redir_request *before)
{
    struct redir_request *r = before != NULL ? before->next : self->slow_first;
    *(before != NULL ? &before->next : &self->slow_first) = r->next;
    if (self->slow_last == r) self->slow_last = before;
    self->n_slow--;
    return r;
}

int64_t usbredir_slow_due_ns(const struct usbredir *self)
{
    return self->slow_first != NULL ? self->slow_first->due_ns : INT64_MAX;
}

void usbredir_answer_slow(struct usbredir *self)
{
    while (self->slow_first != NULL && !self->broken && self->slow_first->due_ns <= monotonic_ns() &&
           self->go_on(self->go_on_ctx)) {
        struct redir_request *r = let_go(self, NULL);
        answer(self, r);
        free(r);
    }
}

int usbredir_cancel_slow(struct usbredir *self, uint64_t id)
{
    struct redir_request *before = NULL;
    for (struct redir_request *r = self->slow_first; r != NULL; before = r, r = r->next) {
        if (r->id != id || r->kind != CONTROL) continue;
        r->header.status = usb_redir_cancelled;
        r->header.length = 0;
        usbredirparser_send_control_packet(self->parser, id, &r->header, NULL, 0);
        usbredirparser_free_packet_data(self->parser, r->data);
        free(let_go(self, before));
        return 1;
    }
    return 0;
}

void usbredir_forget_slow(struct usbredir *self)
{
    while (self->slow_first != NULL) {
        struct redir_request *r = let_go(self, NULL);
        usbredirparser_free_packet_data(self->parser, r->data);
        free(r);
    }
}

/* ---- what the guest asks for */

static void on_set_configuration(void *priv, uint64_t id, struct usb_redir_set_configuration_header *set)
{
    struct usbredir *self = priv;
    if (usbredir_is_early(self)) return;
    usbredir_requests_take(
        self, (struct redir_request){.kind = SET_CONFIGURATION,
                                     .id = id,
                                     .header = {.request = USB_REQ_SET_CONFIGURATION, .value = set->configuration}});
}

static void on_get_configuration(void *priv, uint64_t id)
{
    struct usbredir *self = priv;
    struct usb_redir_configuration_status_header status = {
        .status = usb_redir_success, .configuration = (uint8_t)usb_device_configuration(self->device)};
    if (usbredir_is_early(self)) return;
    usbredirparser_send_configuration_status(self->parser, id, &status);
}

static void on_set_alt(void *priv, uint64_t id, struct usb_redir_set_alt_setting_header *set)
{
    struct usbredir *self = priv;
    if (usbredir_is_early(self)) return;
    usbredir_requests_take(self, (struct redir_request){.kind = SET_ALT,
                                                        .id = id,
                                                        .header = {.requesttype = USB_RECIP_INTERFACE,
                                                                   .request = USB_REQ_SET_INTERFACE,
                                                                   .value = set->alt,
                                                                   .index = set->interface}});
}

static void on_get_alt(void *priv, uint64_t id, struct usb_redir_get_alt_setting_header *get)
{
    struct usbredir *self = priv;
    if (usbredir_is_early(self)) return;
    send_alt(self, id, get->interface, 1);
}

/* There is one control endpoint. */
static void on_control(void *priv, uint64_t id, struct usb_redir_control_packet_header *header, uint8_t *data, int len)
{
    struct usbredir *self = priv;
    if (!usbredir_is_early(self) && (header->endpoint & ~USB_DIR_IN) == 0) {
        usbredir_requests_take(self, (struct redir_request){.id = id, .header = *header, .data = data, .len = len});
        return;
    }
    if (self->greeted) {
        header->status = usb_redir_inval;
        header->length = 0;
        usbredirparser_send_control_packet(self->parser, id, header, NULL, 0);
    }
    usbredirparser_free_packet_data(self->parser, data);
}

void usbredir_take_requests(struct usbredirparser *parser)
{
    parser->hello_func = on_hello;
    parser->reset_func = on_reset;
    parser->set_configuration_func = on_set_configuration;
    parser->get_configuration_func = on_get_configuration;
    parser->set_alt_setting_func = on_set_alt;
    parser->get_alt_setting_func = on_get_alt;
    parser->control_packet_func = on_control;
}

#endif
