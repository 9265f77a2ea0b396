/* SPDX-License-Identifier: MIT */
/* The usbredir back end: descriptions of the device, and control requests. */
#include "drivers/usb/backend.h"

#ifdef HAVE_USBREDIR

#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "drivers/usb/usbredir_private.h"

/* ---- what the device is */

static void send_interfaces(struct usbredir *self)
{
    const struct usb_model *model = usb_facts(self->device)->model;
    struct usb_redir_interface_info_header info = {.interface_count = model->n_interfaces};
    struct usb_redir_ep_info_header eps = {0};
    memset(eps.type, usb_redir_type_invalid, sizeof eps.type);
    eps.type[0] = eps.type[16] = usb_redir_type_control;
    for (unsigned i = 0; i < model->n_interfaces; i++) {
        const struct usb_interface_row *row = &model->interface[i];
        info.interface[i] = row->number;
        info.interface_class[i] = row->class;
        info.interface_subclass[i] = row->subclass;
        info.interface_protocol[i] = row->protocol;
        for (unsigned k = 0; k < row->n_endpoints; k++) {
            const struct usb_endpoint_row *ep = &row->endpoint[k];
            const unsigned at = usb_endpoint_index(ep->address);
            eps.type[at] = ep->type;
            eps.interval[at] = ep->interval[usb_facts(self->device)->rate];
            eps.interface[at] = row->number;
            eps.max_packet_size[at] = ep->packet[usb_facts(self->device)->rate];
        }
    }
    usbredirparser_send_interface_info(self->parser, &info);
    usbredirparser_send_ep_info(self->parser, &eps);
}

void usbredir_plug(struct usbredir *self)
{
    static const uint8_t speed[] = {[USB_RATE_FULL] = usb_redir_speed_full,
                                    [USB_RATE_HIGH] = usb_redir_speed_high,
                                    [USB_RATE_SUPER] = usb_redir_speed_super};
    const struct usb_model *model = usb_facts(self->device)->model;
    const struct usb_identity *id = &usb_facts(self->device)->id;
    usb_device_attach(self->device, id->highest, usbredir_on_complete, self);
    usb_device_assume_address(self->device); /* the guest's controller does not send SET_ADDRESS on */
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
    usb_device_reset(self->device);
    usb_device_assume_address(self->device);
}

static void set_configuration(struct usbredir *self, uint64_t id, const struct usb_redir_control_packet_header *header)
{
    const int rc = request(self, header, NULL);
    if (rc == 0) send_interfaces(self);
    struct usb_redir_configuration_status_header status = {.status = rc == 0 ? usb_redir_success : usb_redir_stall,
                                                           .configuration =
                                                               (uint8_t)usb_facts(self->device)->configuration};
    usbredirparser_send_configuration_status(self->parser, id, &status);
}

static void send_alt(struct usbredir *self, uint64_t id, unsigned interface, int ok)
{
    const int is_there =
        usb_facts(self->device)->configuration != 0 && interface < usb_facts(self->device)->model->n_interfaces;
    struct usb_redir_alt_setting_status_header status = {.status = ok && is_there ? usb_redir_success : usb_redir_stall,
                                                         .interface = (uint8_t)interface};
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

enum { MAX_HELD = 256 };

enum request_kind { CONTROL, SET_CONFIGURATION, SET_ALT };

struct redir_request {
    struct usb_transfer held; /* its id is `id` where kind is CONTROL: no other kind can be cancelled by its id */
    enum request_kind kind;
    uint64_t id;
    struct usb_redir_control_packet_header header;
    uint8_t *data; /* the parser's; NULL: none */
    int len;
};

/* Takes the data over. */
static void usbredir_requests_answer(struct usbredir *self, struct redir_request *r)
{
    if (r->kind == SET_CONFIGURATION)
        set_configuration(self, r->id, &r->header);
    else if (r->kind == SET_ALT)
        set_alt(self, r->id, &r->header);
    else
        answer_control(self, r->id, &r->header, r->data, r->len);
    usbredirparser_free_packet_data(self->parser, r->data);
}

static void hold(struct usbredir *self, const struct redir_request *given)
{
    struct redir_request *r = self->n_held < MAX_HELD ? malloc(sizeof *r) : NULL;
    if (r == NULL) {
        usbredirparser_free_packet_data(self->parser, given->data);
        usbredir_break(self, "more than 256 control packets wait, or there is no memory");
        return;
    }
    *r = *given;
    r->held.id = r->kind == CONTROL ? r->id : UINT64_MAX;
    usb_hold(self->device, &self->held, &r->held);
    self->n_held++;
}

static void usbredir_requests_take(struct usbredir *self, struct redir_request r)
{
    if (usb_has_to_wait(self->device, self->held))
        hold(self, &r);
    else
        usbredir_requests_answer(self, &r);
}

static void free_held(struct usbredir *self, struct redir_request *r)
{
    self->n_held--;
    free(r);
}

void usbredir_answer_slow(struct usbredir *self)
{
    struct usb_transfer *request;
    while (!self->broken && self->held != NULL && self->owner->go_on(self->owner->ctx) &&
           (request = usb_take_due(&self->held)) != NULL) {
        usbredir_requests_answer(self, (struct redir_request *)request);
        free_held(self, (struct redir_request *)request);
    }
}

int usbredir_cancel_slow(struct usbredir *self, uint64_t id)
{
    struct redir_request *r = (struct redir_request *)usb_let_go(&self->held, id);
    if (r == NULL) return 0;
    r->header.status = usb_redir_cancelled;
    r->header.length = 0;
    usbredirparser_send_control_packet(self->parser, id, &r->header, NULL, 0);
    usbredirparser_free_packet_data(self->parser, r->data);
    free_held(self, r);
    return 1;
}

void usbredir_forget_slow(struct usbredir *self)
{
    while (self->held != NULL) {
        struct redir_request *r = (struct redir_request *)usb_let_go(&self->held, self->held->id);
        usbredirparser_free_packet_data(self->parser, r->data);
        free_held(self, r);
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
        .status = usb_redir_success, .configuration = (uint8_t)usb_facts(self->device)->configuration};
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
