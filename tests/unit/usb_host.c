/* SPDX-License-Identifier: MIT */
#include "tests/unit/usb_host.h"

static void host_complete(void *ctx, struct usb_transfer *transfer)
{
    struct host *host = ctx;
    assert_in_range(host->n_done, 0, HOST_MAX_DONE - 1);
    host->done[host->n_done++] = transfer;
}

static void host_interface(void *ctx, unsigned interface, int active)
{
    struct host *host = ctx;
    host->active[interface] = active;
    host->n_changes++;
}

int host_request(void *ctx, const struct usb_ctrlrequest *setup, uint8_t *data)
{
    struct host *host = ctx;
    host->last = *setup;
    host->n_requests++;
    if (setup->bRequest == 0x55 && (setup->bRequestType & USB_DIR_IN)) {
        for (unsigned i = 0; i < 4 && i < setup->wLength; i++)
            data[i] = (uint8_t)(0xc0 + i);
        return 4;
    }
    return setup->bRequest == 0x66 && !(setup->bRequestType & USB_DIR_IN) ? 0 : USB_STALL;
}

struct host *host_new(const struct usb_model *model, enum usb_rate highest, enum usb_rate rate)
{
    static const struct usb_hooks hooks = {host_request, host_interface};
    struct host *host = calloc(1, sizeof *host);
    struct usb_identity id = {.vid = 0x1209, .pid = 0x0001, .serial = "S1", .highest = highest};
    struct sh_err err = {0, ""};
    assert_non_null(host);
    if (usb_device_create(model, &id, &hooks, host, &host->device, &err) != SH_OK) fail_msg("%s", err.text);
    host_attach(host, rate);
    return host;
}

void host_attach(struct host *host, enum usb_rate rate)
{
    usb_device_attach(host->device, rate, host_complete, host);
}

void host_free(struct host *host)
{
    usb_device_free(host->device);
    free(host);
}

uint8_t host_in[70000];

int host_control(struct host *host, unsigned type, unsigned request, unsigned value, unsigned index, unsigned length,
                 const void *out)
{
    struct usb_ctrlrequest setup = {.bRequestType = (uint8_t)type, .bRequest = (uint8_t)request};
    le_put16(&setup.wValue, (uint16_t)value);
    le_put16(&setup.wIndex, (uint16_t)index);
    le_put16(&setup.wLength, (uint16_t)length);
    memset(host_in, GUARD, length + 64);
    if (out != NULL) memcpy(host_in, out, length);
    int n = usb_device_control(host->device, &setup, host_in, length);
    for (unsigned i = 0; i < 64; i++)
        assert_int_equal(host_in[length + i], GUARD);
    if (n > 0 && !(type & USB_DIR_IN)) fail_msg("bytes from an OUT request");
    assert_true(n <= (int)length);
    return n;
}

void host_configure(struct host *host)
{
    assert_int_equal(host_control(host, 0x00, USB_REQ_SET_ADDRESS, 5, 0, 0, NULL), 0);
    assert_int_equal(host_control(host, 0x00, USB_REQ_SET_CONFIGURATION, 1, 0, 0, NULL), 0);
}

struct usb_transfer *host_submit(struct host *host, uint64_t id, uint8_t endpoint, const void *out, uint32_t length)
{
    struct usb_transfer *transfer = calloc(1, sizeof *transfer + length + 1);
    assert_non_null(transfer);
    /* Fields that the core sets itself may hold anything before. */
    *transfer = (struct usb_transfer){.actual = 77, .status = USB_OVERFLOW, .zero_packet = 1, .next = transfer};
    transfer->id = id;
    transfer->endpoint = endpoint;
    transfer->length = length;
    transfer->data = (uint8_t *)(transfer + 1);
    if (out != NULL) memcpy(transfer->data, out, length);
    usb_device_submit(host->device, transfer);
    return transfer;
}

void host_expect(struct host *host, uint64_t id, enum usb_status status, uint32_t actual)
{
    assert_true(host->n_done > 0);
    struct usb_transfer *transfer = host->done[0];
    memmove(host->done, host->done + 1, (size_t)--host->n_done * sizeof host->done[0]);
    assert_int_equal(transfer->id, id);
    assert_int_equal(transfer->status, status);
    assert_int_equal(transfer->actual, actual);
    if (status != USB_OK || actual == 0) assert_int_equal(transfer->zero_packet, 0);
    free(transfer);
}
