/* SPDX-License-Identifier: MIT */
/* This fuzzes the USB device core with the head on it, in each of its looks. The input is a byte (look, speeds), then
 * records of a host's acts: control transfers, bulk and interrupt transfers, cancellations, resets, suspend, faults.
 * Each transfer must come back once, and nothing may be written beyond the room that the host gave. */
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "drivers/usb/head_device.h"
#include "tests/fuzz/rig.h"

enum { GUARD = 0xa5, GUARDED = 32, MAX_TRANSFERS = 64, MAX_RECORDS = 400 };

struct host {
    struct scanhead_usb head;
    unsigned n_pending, n_done;
    uint64_t next_id;
};

/* Each transfer has memory of its own, so that the sanitizer sees its bounds. */
struct own_transfer {
    struct usb_transfer transfer;
    uint8_t *bytes;
    int pending;
};

static void complete(void *ctx, struct usb_transfer *transfer)
{
    struct host *host = ctx;
    struct own_transfer *own = (struct own_transfer *)transfer;
    fuzz_must(own->pending, "a transfer comes back once");
    fuzz_must(transfer->actual <= transfer->length, "no more than its length");
    own->pending = 0;
    host->n_pending--;
    host->n_done++;
    free(own->bytes);
    free(own);
}

static void control(struct host *host, struct fuzz_bytes *in)
{
    struct usb_ctrlrequest setup;
    uint8_t head[8] = {0};
    size_t got;
    memcpy(head, in->p, in->n < 8 ? in->n : 8);
    fuzz_take(in, 8, &got);
    memcpy(&setup, head, sizeof setup);
    if (le_get16(&setup.wLength) > 1024) setup.wLength = 1024;
    const unsigned length = le_get16(&setup.wLength);
    uint8_t *data = malloc(length + GUARDED);
    memset(data, GUARD, length + GUARDED);
    if ((setup.bRequestType & USB_DIR_IN) == 0) {
        const uint8_t *from = fuzz_take(in, length, &got);
        memcpy(data, from, got);
    }
    const int n = usb_device_control(host->head.device, &setup, data, length);
    fuzz_must(n == USB_STALL || (n >= 0 && n <= (int)length), "an answer within wLength, or a stall");
    fuzz_must((setup.bRequestType & USB_DIR_IN) != 0 || n <= 0, "nothing comes from an OUT request");
    for (int i = 0; i < GUARDED; i++)
        fuzz_must(data[length + (unsigned)i] == GUARD, "nothing is written after wLength");
    free(data);
}

static void submit(struct host *host, struct fuzz_bytes *in)
{
    const unsigned endpoint = fuzz_u8(in), length = fuzz_u16(in) % 2048;
    size_t got;
    if (host->n_pending >= MAX_TRANSFERS) return;
    struct own_transfer *own = calloc(1, sizeof *own);
    own->bytes = calloc(1, length + 1);
    own->pending = 1;
    own->transfer = (struct usb_transfer){
        .id = host->next_id++, .endpoint = (uint8_t)endpoint, .length = length, .data = own->bytes};
    if ((endpoint & USB_DIR_IN) == 0) {
        const uint8_t *from = fuzz_take(in, length, &got);
        memcpy(own->bytes, from, got);
    }
    host->n_pending++;
    usb_device_submit(host->head.device, &own->transfer);
}

/* This is the function's side: it reads the bytes that have come, and writes. */
static void serve(struct host *host, unsigned how)
{
    const struct usb_session_row *row =
        &host->head.personality->session[how % (unsigned)host->head.personality->n_sessions];
    uint8_t bytes[1500];
    memset(bytes, 'x', sizeof bytes);
    const size_t waits = usb_device_can_read(host->head.device, row->out, NULL);
    const size_t n = usb_device_read(host->head.device, row->out, bytes, sizeof bytes);
    fuzz_must(n <= sizeof bytes && (n > 0 || waits == 0), "what waits is read");
    const size_t len = 1 + how * 7 % sizeof bytes;
    const size_t wrote = usb_device_write(host->head.device, row->in, bytes, len);
    fuzz_must(wrote <= len, "no more is written than given");
    if (how & 1) usb_device_next_epoch(host->head.device, row->out);
    if (how & 2) usb_device_drop(host->head.device, row->out);
    scanhead_usb_update(&host->head);
    scanhead_usb_cut(&host->head);
    if (how & 4) scanhead_usb_ended(&host->head, (int)(how % (unsigned)host->head.personality->n_sessions));
}

static void act(struct host *host, struct fuzz_bytes *in)
{
    struct usb_device *device = host->head.device;
    const unsigned what = fuzz_u8(in);
    const enum usb_rate rate = (enum usb_rate)((what >> 5) % USB_N_RATES);
    switch (what & 15) {
    case 0:
    case 1:
    case 2:
        control(host, in);
        break;
    case 3:
    case 4:
        submit(host, in);
        break;
    case 5:
    case 6:
        serve(host, fuzz_u8(in));
        break;
    case 7:
        usb_device_cancel(device, host->next_id - 1 - fuzz_u8(in));
        break;
    case 8:
        usb_device_reset(device);
        break;
    case 9:
        usb_device_suspend(device, (int)(what >> 7));
        break;
    case 10:
        usb_device_assume_address(device);
        break;
    case 11:
        usb_device_restart(device);
        break;
    case 12:
        usb_device_halt(device, (uint8_t)fuzz_u8(in));
        break;
    case 13:
        usb_device_shorten(device, (uint8_t)fuzz_u8(in), 1 + (what >> 4));
        break;
    case 14:
        usb_device_lengthen(device, what >> 4);
        break;
    default:
        usb_device_detach(device);
        fuzz_must(host->n_pending == 0, "unplugging brings all transfers back");
        usb_device_attach(device, rate, complete, host);
        break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct fuzz_bytes in = {data, size};
    const unsigned how = fuzz_u8(&in);
    struct host host = {.next_id = 1};
    struct usb_identity id = {
        .vid = 0x1209, .pid = 1, .serial = "S1", .highest = (enum usb_rate)((how >> 2) % USB_N_RATES)};
    struct sh_err err = {0};
    if (scanhead_usb_create(usb_personality_get((enum usb_personality_id)((how & 3) % USB_N_PERSONALITIES)), &id,
                            &host.head, &err) != SH_OK) {
        fuzz_must_be_line(&err);
        return 0;
    }
    usb_device_attach(host.head.device, (enum usb_rate)((how >> 4) % USB_N_RATES), complete, &host);
    for (int i = 0; i < MAX_RECORDS && in.n > 0; i++)
        act(&host, &in);
    usb_device_free(host.head.device);
    fuzz_must(host.n_pending == 0, "each transfer has come back");
    return 0;
}
