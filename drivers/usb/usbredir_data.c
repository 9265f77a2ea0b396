/* SPDX-License-Identifier: MIT */
/* The usbredir back end: bulk and interrupt packets.
 *
 * Interrupt endpoints are not asked packet by packet here: the guest starts and stops receiving, and between
 * the two one transfer of our own waits at the core. */
#include "drivers/usb/backend.h"

#ifdef HAVE_USBREDIR

#include <stdlib.h>
#include <string.h>

#include "drivers/usb/usbredir_private.h"

enum { MAX_PENDING = 4096, MAX_PENDING_BYTES = 64 << 20, MAX_INTERRUPT = 1024 };
/* Ids of our own transfers. A guest whose ids count from 0 never reaches them. */
#define OWN_ID (1ull << 63)

struct redir_transfer {
    struct usb_transfer transfer;
    struct usb_redir_bulk_packet_header bulk;
    uint8_t *packet; /* the parser's: what an OUT carries */
    uint32_t held;   /* counted in n_bytes */
    uint8_t bytes[];
};

static int status_of(enum usb_status status)
{
    static const int numbers[] = {[USB_OK] = usb_redir_success,
                                  [USB_CANCELLED] = usb_redir_cancelled,
                                  [USB_STALLED] = usb_redir_stall,
                                  [USB_GONE] = usb_redir_ioerror,
                                  [USB_OVERFLOW] = usb_redir_babble};
    return numbers[status];
}

/* Makes a transfer. room: bytes of room for data to the host. bytes: what is added to n_bytes, in either direction. */
static struct redir_transfer *new_transfer(struct usbredir *self, uint32_t room, uint32_t bytes)
{
    if (self->n_pending >= MAX_PENDING || self->n_bytes + bytes > MAX_PENDING_BYTES) return NULL;
    struct redir_transfer *transfer = malloc(sizeof *transfer + room);
    if (transfer == NULL) return NULL;
    memset(transfer, 0, sizeof *transfer);
    transfer->held = bytes;
    self->n_pending++;
    self->n_bytes += bytes;
    return transfer;
}

static void free_transfer(struct usbredir *self, struct redir_transfer *transfer)
{
    self->n_pending--;
    self->n_bytes -= transfer->held;
    if (transfer->packet != NULL) usbredirparser_free_packet_data(self->parser, transfer->packet);
    free(transfer);
}

static void complete_bulk(struct usbredir *self, struct redir_transfer *transfer)
{
    const struct usb_transfer *t = &transfer->transfer;
    struct usb_redir_bulk_packet_header header = transfer->bulk;
    const int in = (t->endpoint & USB_DIR_IN) != 0;
    header.status = (uint8_t)status_of(t->status);
    header.length = (uint16_t)t->actual;
    header.length_high = (uint16_t)(t->actual >> 16);
    /* An OUT's answer carries no data, which must be NULL: the library drops it otherwise. */
    usbredirparser_send_bulk_packet(self->parser, t->id, &header, in ? t->data : NULL, in ? (int)t->actual : 0);
    free_transfer(self, transfer);
}

static void complete_interrupt(struct usbredir *self, struct redir_transfer *transfer)
{
    struct usb_transfer *t = &transfer->transfer;
    const unsigned number = t->endpoint & USB_ENDPOINT_NUMBER_MASK;
    if (t->status == USB_OK) {
        struct usb_redir_interrupt_packet_header header = {.endpoint = t->endpoint, .length = (uint16_t)t->actual};
        usbredirparser_send_interrupt_packet(self->parser, self->next_id++, &header, t->data, (int)t->actual);
        usb_device_submit(self->device, t);
        return;
    }
    if (t->status == USB_STALLED) {
        struct usb_redir_interrupt_receiving_status_header header = {.status = usb_redir_stall,
                                                                     .endpoint = t->endpoint};
        usbredirparser_send_interrupt_receiving_status(self->parser, 0, &header);
    }
    self->receiving[number] = NULL;
    free_transfer(self, transfer);
}

void usbredir_on_complete(void *ctx, struct usb_transfer *t)
{
    struct usbredir *self = ctx;
    struct redir_transfer *transfer = (struct redir_transfer *)t;
    if (self->receiving[t->endpoint & USB_ENDPOINT_NUMBER_MASK] == transfer)
        complete_interrupt(self, transfer);
    else
        complete_bulk(self, transfer);
}

/* The endpoint's descriptor; NULL: there is none in the present configuration. */
static const struct usb_endpoint_row *find_endpoint(const struct usbredir *self, unsigned address)
{
    const struct usb_model *model = usb_facts(self->device)->model;
    for (unsigned i = 0; i < model->n_interfaces && usb_facts(self->device)->configuration != 0; i++)
        for (unsigned k = 0; k < model->interface[i].n_endpoints; k++)
            if (model->interface[i].endpoint[k].address == address) return &model->interface[i].endpoint[k];
    return NULL;
}

/* Refuses a bulk packet to an endpoint of another type. A packet to an endpoint that is not there fails at the core. */
static int refuse_bulk(struct usbredir *self, uint64_t id, struct usb_redir_bulk_packet_header *header)
{
    const struct usb_endpoint_row *row = self->greeted ? find_endpoint(self, header->endpoint) : NULL;
    if (row == NULL || row->type == USB_ENDPOINT_XFER_BULK) return 0;
    header->status = usb_redir_inval;
    header->length = header->length_high = 0;
    usbredirparser_send_bulk_packet(self->parser, id, header, NULL, 0);
    return 1;
}

static void on_bulk(void *priv, uint64_t id, struct usb_redir_bulk_packet_header *header, uint8_t *data, int len)
{
    struct usbredir *self = priv;
    const uint32_t length = (uint32_t)header->length_high << 16 | header->length;
    const int in = (header->endpoint & USB_DIR_IN) != 0;
    if (refuse_bulk(self, id, header)) {
        usbredirparser_free_packet_data(self->parser, data);
        return;
    }
    struct redir_transfer *transfer = !self->greeted || (!in && (uint32_t)len != length) || length > MAX_PENDING_BYTES
                                          ? NULL
                                          : new_transfer(self, in ? length : 0, length);
    if (transfer == NULL) {
        usbredirparser_free_packet_data(self->parser, data);
        usbredir_break(
            self, "more than 4096 bulk packets or 64 MiB wait, a packet has another length, or there is no memory");
        return;
    }
    transfer->bulk = *header;
    transfer->packet = data;
    transfer->transfer = (struct usb_transfer){
        .id = id, .endpoint = header->endpoint, .length = length, .data = in ? transfer->bytes : data};
    usb_device_submit(self->device, &transfer->transfer);
}

/* A guest sends such a packet only to an interrupt OUT endpoint. No model has one, so each packet is refused. */
static void on_interrupt(void *priv, uint64_t id, struct usb_redir_interrupt_packet_header *header, uint8_t *data,
                         int len)
{
    struct usbredir *self = priv;
    (void)len;
    header->status = usb_redir_inval;
    usbredirparser_send_interrupt_packet(self->parser, id, header, NULL, 0);
    usbredirparser_free_packet_data(self->parser, data);
}

static void on_start_interrupt(void *priv, uint64_t id, struct usb_redir_start_interrupt_receiving_header *start)
{
    struct usbredir *self = priv;
    const unsigned number = start->endpoint & USB_ENDPOINT_NUMBER_MASK;
    struct usb_redir_interrupt_receiving_status_header status = {.status = usb_redir_success,
                                                                 .endpoint = start->endpoint};
    struct redir_transfer *transfer = NULL;
    const struct usb_endpoint_row *row = find_endpoint(self, start->endpoint);
    const int allowed = (start->endpoint & USB_DIR_IN) != 0 && row != NULL && row->type == USB_ENDPOINT_XFER_INT;
    if (usbredir_is_early(self)) return;
    if (allowed && self->receiving[number] == NULL) transfer = new_transfer(self, MAX_INTERRUPT, MAX_INTERRUPT);
    if (!allowed || (transfer == NULL && self->receiving[number] == NULL)) status.status = usb_redir_inval;
    usbredirparser_send_interrupt_receiving_status(self->parser, id, &status);
    if (transfer == NULL) return;
    transfer->transfer = (struct usb_transfer){
        .id = OWN_ID | number,
        .endpoint = start->endpoint,
        .length =
            row->packet[usb_facts(self->device)->rate], /* one packet at a time, as the guest's controller takes them */
        .data = transfer->bytes};
    self->receiving[number] = transfer;
    usb_device_submit(self->device, &transfer->transfer);
}

static void on_stop_interrupt(void *priv, uint64_t id, struct usb_redir_stop_interrupt_receiving_header *stop)
{
    struct usbredir *self = priv;
    struct usb_redir_interrupt_receiving_status_header status = {.status = usb_redir_success,
                                                                 .endpoint = stop->endpoint};
    if (usbredir_is_early(self)) return;
    usb_device_cancel(self->device, OWN_ID | (stop->endpoint & USB_ENDPOINT_NUMBER_MASK));
    usbredirparser_send_interrupt_receiving_status(self->parser, id, &status);
}

/* Cancels a packet that is under way. A packet that is answered already needs no second answer. */
static void on_cancel(void *priv, uint64_t id)
{
    struct usbredir *self = priv;
    if (!usbredir_cancel_slow(self, id)) usb_device_cancel(self->device, id);
}

/* Requests that no correct guest makes: this device has no isochronous endpoints, streams or filters. */
static void refuse_iso(void *priv, uint64_t id, struct usb_redir_start_iso_stream_header *start)
{
    struct usbredir *self = priv;
    struct usb_redir_iso_stream_status_header status = {.status = usb_redir_inval, .endpoint = start->endpoint};
    usbredirparser_send_iso_stream_status(self->parser, id, &status);
}

static void ignore_stop_iso(void *priv, uint64_t id, struct usb_redir_stop_iso_stream_header *stop)
{
    (void)priv;
    (void)id;
    (void)stop;
}

static void ignore_iso(void *priv, uint64_t id, struct usb_redir_iso_packet_header *header, uint8_t *data, int len)
{
    struct usbredir *self = priv;
    (void)id;
    (void)header;
    (void)len;
    usbredirparser_free_packet_data(self->parser, data);
}

/* No endpoint has streams. */
static void refuse_streams(void *priv, uint64_t id, struct usb_redir_alloc_bulk_streams_header *alloc)
{
    struct usbredir *self = priv;
    struct usb_redir_bulk_streams_status_header status = {.endpoints = alloc->endpoints, .status = usb_redir_inval};
    usbredirparser_send_bulk_streams_status(self->parser, id, &status);
}

static void refuse_no_streams(void *priv, uint64_t id, struct usb_redir_free_bulk_streams_header *none)
{
    struct usbredir *self = priv;
    struct usb_redir_bulk_streams_status_header status = {.endpoints = none->endpoints, .status = usb_redir_inval};
    usbredirparser_send_bulk_streams_status(self->parser, id, &status);
}

void usbredir_take_data(struct usbredirparser *parser)
{
    parser->bulk_packet_func = on_bulk;
    parser->interrupt_packet_func = on_interrupt;
    parser->start_interrupt_receiving_func = on_start_interrupt;
    parser->stop_interrupt_receiving_func = on_stop_interrupt;
    parser->cancel_data_packet_func = on_cancel;
    parser->start_iso_stream_func = refuse_iso;
    parser->stop_iso_stream_func = ignore_stop_iso;
    parser->iso_packet_func = ignore_iso;
    parser->alloc_bulk_streams_func = refuse_streams;
    parser->free_bulk_streams_func = refuse_no_streams;
}

#endif
