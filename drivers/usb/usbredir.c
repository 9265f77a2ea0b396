/* The usbredir back end: the device for a virtual machine (QEMU's usb-redir), over a Unix socket or TCP; no root
 * needed. One guest at a time. libusbredirparser does the wire format, which spice/usbredir's
 * usb-redirection-protocol.md describes; this is its "usb-host" end.
 *
 * Interrupt endpoints are not asked packet by packet here: the guest starts and stops receiving, and between the two
 * one transfer of our own waits at the core. */
#include "drivers/usb/backend.h"

#ifdef HAVE_USBREDIR

#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>
#include <usbredirparser.h>

#include "drivers/protocol/bytes.h"

enum {
    MAX_PENDING = 4096,
    MAX_PENDING_BYTES = 64 << 20,
    MAX_INTERRUPT = 1024,
    CLOSE_WAIT_MS = 500,
    SEND_BUFFER_BYTES = 1 << 20,
};
/* Ids of our own transfers, apart from the guest's as long as it counts from 0. */
#define OWN_ID (1ull << 63)

struct usbredir {
    struct usb_device *device;
    int listener, fd; /* -1: none */
    struct usbredirparser *parser;
    int broken;
    int greeted; /* its hello has come */
    int (*go_on)(void *ctx);
    void *go_on_ctx;
    uint32_t n_pending;
    uint64_t n_bytes;
    struct redir_transfer *receiving[16]; /* by number of the interrupt IN endpoint */
    uint64_t next_id;                     /* of interrupt packets */
    char path[256];                       /* to be removed; empty: none */
    char name[USB_BACKEND_NAME_MAX];
};

struct redir_transfer {
    struct usb_transfer transfer;
    struct usbredir *owner;
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

/* ---- transfers */

/* room: for what goes to the host; bytes: what it holds in all, also of what came. */
static struct redir_transfer *new_transfer(struct usbredir *self, uint32_t room, uint32_t bytes)
{
    if (self->n_pending >= MAX_PENDING || self->n_bytes + bytes > MAX_PENDING_BYTES) return NULL;
    struct redir_transfer *transfer = malloc(sizeof *transfer + room);
    if (transfer == NULL) return NULL;
    memset(transfer, 0, sizeof *transfer);
    transfer->owner = self;
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

static void on_complete(void *ctx, struct usb_transfer *t)
{
    struct usbredir *self = ctx;
    struct redir_transfer *transfer = (struct redir_transfer *)t;
    if (self->receiving[t->endpoint & USB_ENDPOINT_NUMBER_MASK] == transfer)
        complete_interrupt(self, transfer);
    else
        complete_bulk(self, transfer);
}

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
            const unsigned at = (ep->address & USB_ENDPOINT_NUMBER_MASK) + (ep->address & USB_DIR_IN ? 16u : 0u);
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
    usb_device_attach(self->device, usb_device_identity(self->device)->highest, on_complete, self);
    usb_device_assume_address(self->device); /* the guest's controller gives out addresses, and keeps them */
}

static void on_hello(void *priv, struct usb_redir_hello_header *hello)
{
    static const uint8_t speed[] = {[USB_RATE_FULL] = usb_redir_speed_full,
                                    [USB_RATE_HIGH] = usb_redir_speed_high,
                                    [USB_RATE_SUPER] = usb_redir_speed_super};
    struct usbredir *self = priv;
    const struct usb_model *model = usb_device_model(self->device);
    const struct usb_identity *id = usb_device_identity(self->device);
    (void)hello;
    self->greeted = 1;
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

/* The library passes on packets from before the hello, too. */
static int is_early(struct usbredir *self)
{
    if (!self->greeted) self->broken = 1;
    return !self->greeted;
}

/* ---- requests */

static int request(struct usbredir *self, unsigned type, unsigned code, unsigned value, unsigned index, uint8_t *data,
                   unsigned length)
{
    struct usb_ctrlrequest setup = {.bRequestType = (uint8_t)type, .bRequest = (uint8_t)code};
    le_put16(&setup.wValue, (uint16_t)value);
    le_put16(&setup.wIndex, (uint16_t)index);
    le_put16(&setup.wLength, (uint16_t)length);
    return usb_device_control(self->device, &setup, data, length);
}

static void on_reset(void *priv)
{
    struct usbredir *self = priv;
    if (is_early(self)) return;
    usb_device_reset(self->device, usb_device_rate(self->device));
    usb_device_assume_address(self->device);
}

static void on_set_configuration(void *priv, uint64_t id, struct usb_redir_set_configuration_header *set)
{
    struct usbredir *self = priv;
    if (is_early(self)) return;
    int rc = request(self, USB_DIR_OUT, USB_REQ_SET_CONFIGURATION, set->configuration, 0, NULL, 0);
    if (rc == 0) send_interfaces(self);
    struct usb_redir_configuration_status_header status = {.status = rc == 0 ? usb_redir_success : usb_redir_stall,
                                                           .configuration =
                                                               (uint8_t)usb_device_configuration(self->device)};
    usbredirparser_send_configuration_status(self->parser, id, &status);
}

static void on_get_configuration(void *priv, uint64_t id)
{
    struct usbredir *self = priv;
    struct usb_redir_configuration_status_header status = {
        .status = usb_redir_success, .configuration = (uint8_t)usb_device_configuration(self->device)};
    if (is_early(self)) return;
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

static void on_set_alt(void *priv, uint64_t id, struct usb_redir_set_alt_setting_header *set)
{
    struct usbredir *self = priv;
    if (is_early(self)) return;
    int rc = request(self, USB_DIR_OUT | USB_RECIP_INTERFACE, USB_REQ_SET_INTERFACE, set->alt, set->interface, NULL, 0);
    if (rc == 0) send_interfaces(self);
    send_alt(self, id, set->interface, rc == 0);
}

static void on_get_alt(void *priv, uint64_t id, struct usb_redir_get_alt_setting_header *get)
{
    send_alt(priv, id, get->interface, 1);
}

static void on_control(void *priv, uint64_t id, struct usb_redir_control_packet_header *header, uint8_t *data, int len)
{
    struct usbredir *self = priv;
    if (is_early(self)) {
        usbredirparser_free_packet_data(self->parser, data);
        return;
    }
    const int in = (header->requesttype & USB_DIR_IN) != 0;
    uint8_t *room = in ? malloc((size_t)header->length + 1) : NULL;
    int n = USB_STALL;
    if ((in && room != NULL && len == 0) || (!in && len == header->length))
        n = request(self, header->requesttype, header->request, header->value, header->index, in ? room : data,
                    header->length);
    header->status = n >= 0 ? usb_redir_success : usb_redir_stall;
    header->length = n < 0 ? 0 : in ? (uint16_t)n : header->length;
    /* As with bulk: no data pointer in the answer to an OUT. */
    usbredirparser_send_control_packet(self->parser, id, header, in && n > 0 ? room : NULL, in && n > 0 ? n : 0);
    free(room);
    usbredirparser_free_packet_data(self->parser, data);
}

/* ---- data */

static void on_bulk(void *priv, uint64_t id, struct usb_redir_bulk_packet_header *header, uint8_t *data, int len)
{
    struct usbredir *self = priv;
    const uint32_t length = (uint32_t)header->length_high << 16 | header->length;
    const int in = (header->endpoint & USB_DIR_IN) != 0;
    struct redir_transfer *transfer = !self->greeted || (!in && (uint32_t)len != length) || length > MAX_PENDING_BYTES
                                          ? NULL
                                          : new_transfer(self, in ? length : 0, length);
    if (transfer == NULL) {
        usbredirparser_free_packet_data(self->parser, data);
        self->broken = 1;
        return;
    }
    transfer->bulk = *header;
    transfer->packet = data;
    transfer->transfer = (struct usb_transfer){
        .id = id, .endpoint = header->endpoint, .length = length, .data = in ? transfer->bytes : data};
    usb_device_submit(self->device, &transfer->transfer);
}

/* OUT only; IN is received as started. The model has none so far, and then it is refused as not there. */
static void on_interrupt(void *priv, uint64_t id, struct usb_redir_interrupt_packet_header *header, uint8_t *data,
                         int len)
{
    struct usbredir *self = priv;
    (void)len;
    header->status = usb_redir_inval;
    usbredirparser_send_interrupt_packet(self->parser, id, header, NULL, 0);
    usbredirparser_free_packet_data(self->parser, data);
}

static int has_interrupt(const struct usbredir *self, unsigned address)
{
    for (unsigned i = 0; i < usb_device_model(self->device)->n_interfaces; i++) {
        const struct usb_interface_row *row = usb_device_row(self->device, i);
        for (unsigned k = 0; row != NULL && k < row->n_endpoints; k++)
            if (row->endpoint[k].address == address && row->endpoint[k].type == USB_ENDPOINT_XFER_INT) return 1;
    }
    return 0;
}

static void on_start_interrupt(void *priv, uint64_t id, struct usb_redir_start_interrupt_receiving_header *start)
{
    struct usbredir *self = priv;
    const unsigned number = start->endpoint & USB_ENDPOINT_NUMBER_MASK;
    struct usb_redir_interrupt_receiving_status_header status = {.status = usb_redir_success,
                                                                 .endpoint = start->endpoint};
    struct redir_transfer *transfer = NULL;
    const int allowed = (start->endpoint & USB_DIR_IN) != 0 && has_interrupt(self, start->endpoint);
    if (is_early(self)) return;
    if (allowed && self->receiving[number] == NULL) transfer = new_transfer(self, MAX_INTERRUPT, MAX_INTERRUPT);
    if (!allowed || (transfer == NULL && self->receiving[number] == NULL)) status.status = usb_redir_inval;
    usbredirparser_send_interrupt_receiving_status(self->parser, id, &status);
    if (transfer == NULL) return;
    transfer->transfer = (struct usb_transfer){
        .id = OWN_ID | number, .endpoint = start->endpoint, .length = MAX_INTERRUPT, .data = transfer->bytes};
    self->receiving[number] = transfer;
    usb_device_submit(self->device, &transfer->transfer);
}

static void on_stop_interrupt(void *priv, uint64_t id, struct usb_redir_stop_interrupt_receiving_header *stop)
{
    struct usbredir *self = priv;
    struct usb_redir_interrupt_receiving_status_header status = {.status = usb_redir_success,
                                                                 .endpoint = stop->endpoint};
    if (is_early(self)) return;
    usb_device_cancel(self->device, OWN_ID | (stop->endpoint & USB_ENDPOINT_NUMBER_MASK));
    usbredirparser_send_interrupt_receiving_status(self->parser, id, &status);
}

/* A packet that was under way is answered as cancelled; one that is answered already needs no more. */
static void on_cancel(void *priv, uint64_t id)
{
    struct usbredir *self = priv;
    usb_device_cancel(self->device, id);
}

/* What a device without isochronous endpoints, streams and filters is not asked for, unless to annoy it. */
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

/* ---- the socket */

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

static int on_read(void *priv, uint8_t *data, int count)
{
    struct usbredir *self = priv;
    if (self->broken || !self->go_on(self->go_on_ctx)) return 0;
    ssize_t n = recv(self->fd, data, (size_t)count, MSG_DONTWAIT);
    if (n > 0) return (int)n;
    if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) return 0;
    self->broken = 1;
    return -1;
}

static int on_write(void *priv, uint8_t *data, int count)
{
    struct usbredir *self = priv;
    ssize_t n = send(self->fd, data, (size_t)count, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (n >= 0) return (int)n;
    if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR || errno == ENOBUFS) return 0;
    self->broken = 1;
    return -1;
}

/* The library's remarks concern broken peers, which are cut off. */
static void on_log(void *priv, int level, const char *text)
{
    (void)priv;
    (void)level;
    (void)text;
}

static int start(struct usbredir *self, int fd)
{
    static char version[] = "scanhead";
    const int one = 1, size = SEND_BUFFER_BYTES;
    uint32_t caps[USB_REDIR_CAPS_SIZE] = {0};
    struct usbredirparser *parser = usbredirparser_create();
    if (parser == NULL) return SH_ENOMEM;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &size, sizeof size);
    parser->priv = self;
    parser->log_func = on_log;
    parser->read_func = on_read;
    parser->write_func = on_write;
    parser->hello_func = on_hello;
    parser->reset_func = on_reset;
    parser->set_configuration_func = on_set_configuration;
    parser->get_configuration_func = on_get_configuration;
    parser->set_alt_setting_func = on_set_alt;
    parser->get_alt_setting_func = on_get_alt;
    parser->start_iso_stream_func = refuse_iso;
    parser->stop_iso_stream_func = ignore_stop_iso;
    parser->start_interrupt_receiving_func = on_start_interrupt;
    parser->stop_interrupt_receiving_func = on_stop_interrupt;
    parser->alloc_bulk_streams_func = refuse_streams;
    parser->free_bulk_streams_func = refuse_no_streams;
    parser->cancel_data_packet_func = on_cancel;
    parser->control_packet_func = on_control;
    parser->bulk_packet_func = on_bulk;
    parser->iso_packet_func = ignore_iso;
    parser->interrupt_packet_func = on_interrupt;
    usbredirparser_caps_set_cap(caps, usb_redir_cap_connect_device_version);
    usbredirparser_caps_set_cap(caps, usb_redir_cap_ep_info_max_packet_size);
    usbredirparser_caps_set_cap(caps, usb_redir_cap_64bits_ids);
    usbredirparser_caps_set_cap(caps, usb_redir_cap_32bits_bulk_length);
    self->fd = fd;
    self->parser = parser;
    self->broken = self->greeted = 0;
    usbredirparser_init(parser, version, caps, USB_REDIR_CAPS_SIZE, usbredirparser_fl_usb_host);
    return SH_OK;
}

static void stop(struct usbredir *self)
{
    if (self->fd < 0) return;
    usb_device_detach(self->device);
    usbredirparser_destroy(self->parser);
    close(self->fd);
    self->parser = NULL;
    self->fd = -1;
}

static int open_socket(struct usbredir *self, const struct usb_backend_spec *spec, struct sh_err *err)
{
    int fd;
    char at[USB_BACKEND_NAME_MAX - 16] = "";
    int rc = usb_backend_socket(spec, "usbredir", &fd, at, sizeof at, err);
    if (rc != SH_OK) return rc;
    snprintf(self->name, sizeof self->name, "usbredir:%s", at);
    if (!spec->attach) {
        self->listener = fd;
        snprintf(self->path, sizeof self->path, "%s", spec->path);
        return SH_OK;
    }
    rc = start(self, fd);
    if (rc == SH_OK) return rc;
    close(fd);
    return sh_fail(err, rc, "usbredir: no memory");
}

static int usbredir_open(const struct usb_backend_spec *spec, struct usb_device *device, void **backend,
                         struct sh_err *err)
{
    struct usbredir *self = calloc(1, sizeof *self);
    if (self == NULL) return sh_fail(err, SH_ENOMEM, "usbredir: no memory");
    self->device = device;
    self->listener = self->fd = -1;
    int rc = open_socket(self, spec, err);
    if (rc != SH_OK) {
        free(self);
        return rc;
    }
    *backend = self;
    return SH_OK;
}

static void usbredir_endpoint(const void *backend, char *buf, size_t len)
{
    const struct usbredir *self = backend;
    snprintf(buf, len, "%s", self->name);
}

static int usbredir_prepare(void *backend, struct pollfd *fds)
{
    struct usbredir *self = backend;
    fds[0] = (struct pollfd){.fd = self->fd, .events = POLLIN};
    if (self->fd >= 0 && usbredirparser_has_data_to_write(self->parser) > 0) fds[0].events |= POLLOUT;
    fds[1] = (struct pollfd){.fd = self->fd < 0 ? self->listener : -1, .events = POLLIN};
    return 2;
}

static void usbredir_flush(void *backend)
{
    struct usbredir *self = backend;
    if (self->fd >= 0 && !self->broken && usbredirparser_has_data_to_write(self->parser) > 0)
        usbredirparser_do_write(self->parser);
}

static int usbredir_handle(void *backend, const struct pollfd *fds, int n, int (*go_on)(void *ctx), void *ctx)
{
    struct usbredir *self = backend;
    self->go_on = go_on;
    self->go_on_ctx = ctx;
    if (self->fd >= 0 && n > 0 && (fds[0].revents & ~POLLOUT) != 0 && usbredirparser_do_read(self->parser) != 0)
        self->broken = 1;
    if (n > 1 && fds[1].fd >= 0 && fds[1].revents != 0) {
        int fd = accept4(self->listener, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
        if (fd >= 0 && start(self, fd) != SH_OK) close(fd);
    }
    usbredir_flush(self);
    if (self->broken) stop(self);
    return SH_OK;
}

/* The socket keeps what was not read, and poll says so. */
static int usbredir_more(const void *backend)
{
    (void)backend;
    return 0;
}

static const char *usbredir_news(void *backend)
{
    (void)backend;
    return NULL;
}

static void usbredir_close(void *backend)
{
    struct usbredir *self = backend;
    if (self->fd >= 0 && !self->broken) {
        struct pollfd slot = {.fd = self->fd, .events = POLLOUT};
        usb_device_detach(self->device);
        usbredirparser_send_device_disconnect(self->parser);
        usbredir_flush(self);
        while (!self->broken && usbredirparser_has_data_to_write(self->parser) > 0 && poll(&slot, 1, CLOSE_WAIT_MS) > 0)
            usbredir_flush(self);
        if (!self->broken) usb_backend_hang_up(self->fd, CLOSE_WAIT_MS);
    }
    stop(self);
    if (self->listener >= 0) close(self->listener);
    if (self->path[0] != '\0') unlink(self->path);
    free(self);
}

const struct usb_backend_ops usb_backend_usbredir = {
    .name = "usbredir",
    .open = usbredir_open,
    .endpoint = usbredir_endpoint,
    .prepare = usbredir_prepare,
    .handle = usbredir_handle,
    .more = usbredir_more,
    .news = usbredir_news,
    .flush = usbredir_flush,
    .close = usbredir_close,
};

#else

static int usbredir_open(const struct usb_backend_spec *spec, struct usb_device *device, void **backend,
                         struct sh_err *err)
{
    (void)spec;
    (void)device;
    (void)backend;
    return sh_fail(err, SH_EINPUT, "usbredir: built without it; install libusbredirparser-dev and build again");
}

const struct usb_backend_ops usb_backend_usbredir = {.name = "usbredir", .open = usbredir_open};

#endif
