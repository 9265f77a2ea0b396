/* SPDX-License-Identifier: MIT */
/* The USB/IP protocol, version 1.1.1, as Linux describes it (Documentation/usb/usbip_protocol.rst): sizes,
 * offsets and numbers. Everything is big-endian. Private to the back end and its tests. */
#ifndef DRIVERS_USB_USBIP_H
#define DRIVERS_USB_USBIP_H

enum {
    USBIP_VERSION = 0x0111,
    /* operations: u16 version, u16 code, u32 status */
    OP_HEADER = 8,
    OP_REQ_DEVLIST = 0x8005,
    OP_REP_DEVLIST = 0x0005,
    OP_REQ_IMPORT = 0x8003,
    OP_REP_IMPORT = 0x0003,
    OP_OK = 0,
    OP_FAILED = 1,
    OP_BUSY = 2,
    BUSID_LEN = 32,
    /* a device: char[256] path, char[32] bus id, u32 bus, device, speed, u16 vid, pid, bcd, u8 class,
     * subclass, protocol, configuration, configurations, interfaces */
    OP_DEVICE = 312,
    OP_INTERFACE = 4,
    OP_IMPORT = OP_HEADER + BUSID_LEN,
    /* URBs: u32 command, seqnum, devid, direction, ep, then 28 bytes by command */
    URB_HEADER = 48,
    CMD_SUBMIT = 1,       /* u32 flags, length, start frame, packets, interval, u8[8] setup */
    CMD_UNLINK = 2,       /* u32 seqnum */
    RET_SUBMIT = 3,       /* i32 status, u32 actual length, start frame, packets, errors */
    RET_UNLINK = 4,       /* i32 status */
    URB_SHORT_NOT_OK = 1, /* of the flags */
    DIR_OUT = 0,
    DIR_IN = 1,
};

/* Place of head number N on the server's side: bus 1, device N + 1 (the root hub is device 1), port N, bus id "1-N". */
enum { USBIP_BUS = 1 };

#endif
