/* SPDX-License-Identifier: MIT */
/* The device's descriptions that FunctionFS gets through ep0, in the format of <linux/usb/functionfs.h>. */
#include <errno.h>
#include <linux/usb/functionfs.h>
#include <string.h>
#include <unistd.h>

#include "core/bytes.h"
#include "drivers/usb/gadget.h"

static uint32_t count_descriptors(const uint8_t *bytes, size_t len)
{
    uint32_t n = 0;
    for (size_t at = 0; at < len; at += bytes[at])
        n++;
    return n;
}

/* Announces WinUSB by Microsoft OS 1.0, the older way, since the kernel's gadgets know no other. A function has at
 * most one compatible id, and with that id at most one property, its guid. Returns the new end. */
static size_t put_os_descriptors(const struct usb_function_row *function, uint8_t *out, size_t at, uint32_t *count)
{
    static const char name[] = "DeviceInterfaceGUID";
    if (function->compatible_id == NULL) return at;
    const uint32_t data_len = function->guid != NULL ? (uint32_t)strlen(function->guid) + 1 : 0;
    const uint32_t property = 14 + (uint32_t)sizeof name + data_len;
    memset(out + at, 0, 11 + 24 + 11 + property);
    out[at] = function->first;
    le_put32(out + at + 1, 11 + 24);
    le_put16(out + at + 5, 1); /* version */
    le_put16(out + at + 7, 4); /* compatible ids */
    out[at + 9] = 1;
    out[at + 11] = function->first;
    out[at + 12] = 1;
    memcpy(out + at + 13, function->compatible_id, strnlen(function->compatible_id, 8));
    at += 11 + 24;
    ++*count;
    if (function->guid == NULL) return at;
    out[at] = function->first;
    le_put32(out + at + 1, 11 + property);
    le_put16(out + at + 5, 1);
    le_put16(out + at + 7, 5); /* properties */
    le_put16(out + at + 9, 1);
    at += 11;
    le_put32(out + at, property);
    le_put32(out + at + 4, 1); /* REG_SZ */
    le_put16(out + at + 8, (uint16_t)sizeof name);
    memcpy(out + at + 10, name, sizeof name);
    le_put32(out + at + 10 + sizeof name, data_len);
    memcpy(out + at + 14 + sizeof name, function->guid, data_len);
    ++*count;
    return at + property;
}

static int write_all(int fd, const void *bytes, size_t len)
{
    return write(fd, bytes, len) == (ssize_t)len ? 0 : -1;
}

static int write_descriptors(const struct gadget *gadget, int ep0, const struct usb_identity *id)
{
    uint8_t out[4 * USB_MAX_CONFIG + 256];
    const unsigned n_rates = (unsigned)id->highest + 1;
    uint32_t os_count = 0, flags = 0;
    size_t at = 12 + 4 * n_rates; /* after the counts */
    const int has_os = usb_describe_ms_os(&gadget->part, NULL, 0) != 0;
    if (has_os) {
        flags |= FUNCTIONFS_HAS_MS_OS_DESC;
        at += 4;
    }
    for (unsigned rate = 0; rate < n_rates; rate++) {
        uint8_t config[USB_MAX_CONFIG];
        size_t len = usb_describe_config(&gadget->part, id, (enum usb_rate)rate, USB_DT_CONFIG, config, sizeof config);
        if (len > sizeof config) return -1;
        len -= USB_DT_CONFIG_SIZE;
        memcpy(out + at, config + USB_DT_CONFIG_SIZE, len);
        le_put32(out + 12 + 4 * rate, count_descriptors(out + at, len));
        flags |= 1u << rate; /* FUNCTIONFS_HAS_FS_DESC, _HS_, _SS_ */
        at += len;
    }
    for (unsigned i = 0; i < gadget->part.n_functions && i < 2; i++)
        at = put_os_descriptors(&gadget->function[i], out, at, &os_count);
    le_put32(out, FUNCTIONFS_DESCRIPTORS_MAGIC_V2);
    le_put32(out + 4, (uint32_t)at);
    le_put32(out + 8, flags);
    if (has_os) le_put32(out + 12 + 4 * n_rates, os_count);
    return write_all(ep0, out, at);
}

static int write_strings(const struct gadget *gadget, int ep0)
{
    uint8_t out[1024];
    uint32_t n = 0;
    size_t at = 18;
    for (; gadget->string[n] != NULL; n++) {
        const size_t len = strlen(gadget->string[n]) + 1;
        if (at + len > sizeof out) return -1;
        memcpy(out + at, gadget->string[n], len);
        at += len;
    }
    if (n == 0) at = 16;
    le_put32(out, FUNCTIONFS_STRINGS_MAGIC);
    le_put32(out + 4, (uint32_t)at);
    le_put32(out + 8, n);
    le_put32(out + 12, n != 0);
    le_put16(out + 16, USB_LANGID);
    return write_all(ep0, out, at);
}

int gadget_describe(const struct gadget *gadget, int ep0, const struct usb_identity *id, struct sh_err *err)
{
    if (write_descriptors(gadget, ep0, id) != 0)
        return sh_fail(err, SH_EIO, "functionfs: the kernel refuses the descriptors: %s", strerror(errno));
    if (write_strings(gadget, ep0) != 0)
        return sh_fail(err, SH_EIO, "functionfs: the kernel refuses the strings: %s", strerror(errno));
    return SH_OK;
}
