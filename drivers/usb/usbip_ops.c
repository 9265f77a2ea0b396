/* SPDX-License-Identifier: MIT */
/* Requests of a USB/IP client before it has the device: the list of devices (DEVLIST), and one of them (IMPORT). */
#include <stdio.h>

#include "drivers/usb/usbip_private.h"

/* The port of this head on the server's side: 1 unless it has a number of its own. */
static unsigned port_of(const struct usb_device *device)
{
    const unsigned number = usb_facts(device)->id.number;
    return number != 0 ? number : 1;
}

uint32_t usbip_devid(const struct usb_device *device)
{
    return (uint32_t)USBIP_BUS << 16 | (port_of(device) + 1);
}

static void put_bus_id(const struct usb_device *device, char *out, size_t len)
{
    snprintf(out, len, "%d-%u", USBIP_BUS, port_of(device));
}

static void describe_device(const struct usbip_conn *conn, uint8_t *out)
{
    static const uint8_t speed[] = {
        [USB_RATE_FULL] = USB_SPEED_FULL, [USB_RATE_HIGH] = USB_SPEED_HIGH, [USB_RATE_SUPER] = USB_SPEED_SUPER};
    const struct usb_model *model = usb_facts(conn->device)->model;
    const struct usb_identity *id = &usb_facts(conn->device)->id;
    char bus_id[BUSID_LEN];
    memset(out, 0, OP_DEVICE);
    put_bus_id(conn->device, bus_id, sizeof bus_id);
    snprintf((char *)out, 256, "/sys/devices/scanhead/%s", bus_id);
    snprintf((char *)out + 256, BUSID_LEN, "%s", bus_id);
    be_put32(out + 288, USBIP_BUS);
    be_put32(out + 292, usbip_devid(conn->device) & 0xffff);
    be_put32(out + 296, speed[id->highest]);
    be_put16(out + 300, id->vid);
    be_put16(out + 302, id->pid);
    be_put16(out + 304, model->bcd_device);
    out[306] = model->class;
    out[307] = model->subclass;
    out[308] = model->protocol;
    out[309] = (uint8_t)usb_facts(conn->device)->configuration;
    out[310] = 1;
    out[311] = model->n_interfaces;
}

static void put_op(uint8_t *out, unsigned code, uint32_t status)
{
    be_put16(out, USBIP_VERSION);
    be_put16(out + 2, code);
    be_put32(out + 4, status);
}

static void list_devices(struct usbip_conn *conn)
{
    const struct usb_model *model = usb_facts(conn->device)->model;
    uint8_t *out = usbip_queue_plain(conn, OP_HEADER + 4 + OP_DEVICE + (uint32_t)model->n_interfaces * OP_INTERFACE);
    if (out == NULL) return;
    put_op(out, OP_REP_DEVLIST, OP_OK);
    be_put32(out + 8, 1);
    describe_device(conn, out + 12);
    for (unsigned i = 0; i < model->n_interfaces; i++) {
        const struct usb_interface_row *row = &model->interface[i];
        uint8_t *at = out + 12 + OP_DEVICE + i * OP_INTERFACE;
        at[0] = row->class;
        at[1] = row->subclass;
        at[2] = row->protocol;
        at[3] = 0;
    }
}

static void import_device(struct usbip_conn *conn, const uint8_t *busid)
{
    char own[BUSID_LEN];
    put_bus_id(conn->device, own, sizeof own);
    const int known = strncmp((const char *)busid, own, BUSID_LEN) == 0;
    const uint32_t status = !known ? OP_NO_DEVICE : *conn->taken ? OP_BUSY : OP_OK;
    uint8_t *out = usbip_queue_plain(conn, OP_HEADER + (status == OP_OK ? OP_DEVICE : 0));
    if (out == NULL) return;
    put_op(out, OP_REP_IMPORT, status);
    if (status != OP_OK) return;
    describe_device(conn, out + OP_HEADER);
    usbip_conn_import(conn);
}

uint32_t usbip_op_need(const struct usbip_conn *conn)
{
    if (conn->head_len < OP_HEADER) return OP_HEADER;
    return be_get16(conn->head + 2) == OP_REQ_IMPORT ? OP_IMPORT : OP_HEADER;
}

void usbip_op_take(struct usbip_conn *conn)
{
    const unsigned code = be_get16(conn->head + 2);
    conn->head_len = 0;
    if (be_get16(conn->head) != USBIP_VERSION || (code != OP_REQ_DEVLIST && code != OP_REQ_IMPORT))
        usbip_conn_break(conn, "an operation of another version or number");
    else if (code == OP_REQ_DEVLIST)
        list_devices(conn);
    else
        import_device(conn, conn->head + OP_HEADER);
}
