/* SPDX-License-Identifier: MIT */
#include "tests/unit/fake_libusb.h"

#include <fcntl.h>

struct fake_bus bus;

void fake_reset(void)
{
    memset(&bus, 0, sizeof bus);
}

void fake_expect_nothing_left(void)
{
    assert_int_equal(bus.contexts, 0);
    assert_int_equal(bus.handles, 0);
    assert_int_equal(bus.transfers, 0);
    assert_int_equal(bus.claimed, 0);
    assert_int_equal(bus.lists, 0);
    assert_int_equal(bus.configs, 0);
}

void fake_script(uint8_t endpoint, enum libusb_transfer_status status, const void *data, size_t len)
{
    assert_true(bus.n_steps < FAKE_STEPS && len <= FAKE_DATA);
    struct fake_step *step = &bus.step[bus.n_steps++];
    *step = (struct fake_step){.endpoint = endpoint, .status = status, .len = (int)len};
    if (len > 0) memcpy(step->data, data, len);
}

int libusb_init(libusb_context **ctx)
{
    if (bus.init_rc != 0) return bus.init_rc;
    *ctx = calloc(1, sizeof **ctx);
    bus.contexts++;
    return 0;
}

void libusb_exit(libusb_context *ctx)
{
    bus.contexts--;
    free(ctx);
}

int libusb_has_capability(uint32_t capability)
{
    return capability == LIBUSB_CAP_HAS_HOTPLUG && !bus.no_hotplug;
}

int libusb_hotplug_register_callback(libusb_context *ctx, int events, int flags, int vendor, int product, int class,
                                     libusb_hotplug_callback_fn callback, void *data,
                                     libusb_hotplug_callback_handle *handle)
{
    assert_int_equal(events, LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED);
    (void)flags, (void)vendor, (void)product, (void)class, (void)handle;
    ctx->arrival = callback;
    ctx->arrival_data = data;
    return 0;
}

/* Answers whether udev runs: without it libusb has no events, and does not know. Other files are as they are. */
int access(const char *path, int mode)
{
    if (strcmp(path, "/run/udev/control") != 0) return faccessat(AT_FDCWD, path, mode, 0);
    assert_int_equal(mode, F_OK);
    return bus.no_udev ? -1 : 0;
}

const char *libusb_strerror(int error)
{
    return error == LIBUSB_ERROR_ACCESS ? "Access denied (insufficient permissions)" : "some error";
}

ssize_t libusb_get_device_list(libusb_context *ctx, libusb_device ***list)
{
    ssize_t n = 0;
    ctx->listed = 1;
    bus.lists++;
    bus.n_lists++;
    *list = calloc(FAKE_DEVICES + 1, sizeof **list);
    for (int i = 0; i < FAKE_DEVICES; i++)
        if (bus.device[i].present) (*list)[n++] = &bus.device[i];
    return n;
}

void libusb_free_device_list(libusb_device **list, int unref)
{
    (void)unref;
    bus.lists--;
    free(list);
}

int libusb_get_device_descriptor(libusb_device *device, struct libusb_device_descriptor *d)
{
    *d = (struct libusb_device_descriptor){.idVendor = 0x1209,
                                           .idProduct = (uint16_t)(1 + (device - bus.device)),
                                           .iManufacturer = device->maker != NULL ? 1 : 0,
                                           .iProduct = device->product != NULL ? 2 : 0,
                                           .iSerialNumber = device->serial != NULL ? 3 : 0};
    return 0;
}

int libusb_get_active_config_descriptor(libusb_device *device, struct libusb_config_descriptor **config)
{
    static const struct libusb_endpoint_descriptor endpoints[] = {{.bEndpointAddress = FAKE_IN, .bmAttributes = 2},
                                                                  {.bEndpointAddress = FAKE_OUT, .bmAttributes = 2}};
    static const struct libusb_interface_descriptor head = {.bInterfaceNumber = 2,
                                                            .bNumEndpoints = 2,
                                                            .bInterfaceClass = 0xff,
                                                            .bInterfaceSubClass = 0x53,
                                                            .bInterfaceProtocol = 0x48,
                                                            .endpoint = endpoints},
                                                    mouse = {.bInterfaceClass = 3};
    static const struct libusb_interface heads = {.altsetting = &head, .num_altsetting = 1},
                                         mice = {.altsetting = &mouse, .num_altsetting = 1};
    *config = calloc(1, sizeof **config);
    bus.configs++;
    **config =
        (struct libusb_config_descriptor){.bNumInterfaces = 1, .interface = device->other_class ? &mice : &heads};
    return 0;
}

void libusb_free_config_descriptor(struct libusb_config_descriptor *config)
{
    bus.configs--;
    free(config);
}

uint8_t libusb_get_bus_number(libusb_device *device)
{
    (void)device;
    return 1;
}

uint8_t libusb_get_device_address(libusb_device *device)
{
    return (uint8_t)(2 + (device - bus.device));
}

int libusb_get_device_speed(libusb_device *device)
{
    (void)device;
    return LIBUSB_SPEED_HIGH;
}

int libusb_open(libusb_device *device, libusb_device_handle **handle)
{
    if (device->open_rc != 0) return device->open_rc;
    *handle = calloc(1, sizeof **handle);
    (*handle)->device = device;
    bus.handles++;
    return 0;
}

void libusb_close(libusb_device_handle *handle)
{
    bus.handles--;
    if (!bus.will_not_cancel) assert_int_equal(bus.n_flying, 0);
    assert_int_equal(bus.claimed, 0); /* libusb's documentation: release all interfaces before */
    bus.n_flying = 0;                 /* the kernel takes them back */
    free(handle);
}

int libusb_get_string_descriptor_ascii(libusb_device_handle *handle, uint8_t index, unsigned char *data, int length)
{
    const struct libusb_device *d = handle->device;
    const char *text = index == 1 ? d->maker : index == 2 ? d->product : d->serial;
    int n = 0;
    for (; n < length && text[n] != '\0'; n++)
        data[n] = text[n] == FAKE_NUL ? '\0' : (unsigned char)text[n];
    return n;
}

int libusb_claim_interface(libusb_device_handle *handle, int number)
{
    (void)handle;
    assert_int_equal(number, 2);
    bus.claimed += bus.claim_rc == 0;
    return bus.claim_rc;
}

int libusb_release_interface(libusb_device_handle *handle, int number)
{
    (void)handle;
    assert_int_equal(number, 2);
    bus.claimed--;
    return 0;
}

int libusb_control_transfer(libusb_device_handle *handle, uint8_t type, uint8_t request, uint16_t value, uint16_t index,
                            unsigned char *data, uint16_t length, unsigned timeout)
{
    (void)handle, (void)timeout;
    if (type == 0x80 && request == LIBUSB_REQUEST_GET_STATUS) { /* whether the device is still there */
        assert_true(value == 0 && index == 0 && length == 2);   /* USB 2.0, 9.4.5; else a device may refuse it */
        if (bus.gone) return LIBUSB_ERROR_NO_DEVICE;
        memset(data, 0, 2);
        return 2;
    }
    assert_int_equal(request, 0x22);
    assert_int_equal(index, 2);
    if (type == 0xc1) { /* whether a session is open */
        assert_true(value == 0 && length == 1);
        data[0] = !bus.was_reset;
        return bus.gone ? LIBUSB_ERROR_NO_DEVICE : bus.no_question ? LIBUSB_ERROR_PIPE : 1;
    }
    assert_int_equal(type, 0x41);
    assert_int_equal(length, 0);
    if (bus.gone) return LIBUSB_ERROR_NO_DEVICE;
    if (value != 0 && bus.session_rc != 0) return bus.session_rc;
    bus.sessions += value ? 1 : -1;
    bus.was_reset = 0;
    return 0;
}

struct libusb_transfer *libusb_alloc_transfer(int iso_packets)
{
    (void)iso_packets;
    bus.transfers++;
    return calloc(1, sizeof(struct libusb_transfer));
}

static int fake_find(const struct libusb_transfer *transfer)
{
    for (int i = 0; i < bus.n_flying; i++)
        if (bus.flying[i] == transfer) return i;
    return -1;
}

void libusb_free_transfer(struct libusb_transfer *transfer)
{
    if (transfer == NULL) return;
    assert_int_equal(fake_find(transfer), -1);
    bus.transfers--;
    free(transfer);
}

int libusb_submit_transfer(struct libusb_transfer *transfer)
{
    assert_int_equal(fake_find(transfer), -1);
    if (bus.gone) return LIBUSB_ERROR_NO_DEVICE;
    if (bus.submit_rc != 0 && bus.submit_fails != 0) {
        bus.submit_fails -= bus.submit_fails > 0;
        return bus.submit_rc;
    }
    if (bus.submit_room > 0 && bus.n_flying >= bus.submit_room) return LIBUSB_ERROR_NO_MEM;
    assert_true(bus.n_flying < FAKE_FLYING);
    bus.cancelled[bus.n_flying] = 0;
    bus.flying[bus.n_flying++] = transfer;
    return 0;
}

int libusb_cancel_transfer(struct libusb_transfer *transfer)
{
    const int i = fake_find(transfer);
    if (i < 0) return LIBUSB_ERROR_NOT_FOUND;
    bus.cancelled[i] = !bus.will_not_cancel;
    return 0;
}

int libusb_clear_halt(libusb_device_handle *handle, unsigned char endpoint)
{
    (void)handle;
    assert_true(endpoint == FAKE_IN || endpoint == FAKE_OUT);
    for (int i = 0; i < bus.n_flying; i++) /* libusb's documentation: cancel all transfers before */
        assert_true(bus.flying[i]->endpoint != endpoint || bus.gone || bus.will_not_cancel);
    bus.n_clear_halts++;
    return bus.gone ? LIBUSB_ERROR_NO_DEVICE : bus.clear_halt_rc;
}

static void fake_complete(int i, enum libusb_transfer_status status, const void *data, int len)
{
    struct libusb_transfer *transfer = bus.flying[i];
    bus.n_flying--;
    memmove(&bus.flying[i], &bus.flying[i + 1], sizeof bus.flying[0] * (size_t)(bus.n_flying - i));
    memmove(&bus.cancelled[i], &bus.cancelled[i + 1], sizeof bus.cancelled[0] * (size_t)(bus.n_flying - i));
    transfer->status = status;
    transfer->actual_length = len;
    if (len > 0 && transfer->endpoint == FAKE_IN) memcpy(transfer->buffer, data, (size_t)len);
    if (transfer->endpoint == FAKE_OUT && status == LIBUSB_TRANSFER_COMPLETED) {
        const size_t used = strlen(bus.written);
        assert_true(used + (size_t)transfer->length < sizeof bus.written);
        memcpy(bus.written + used, transfer->buffer, (size_t)transfer->length);
        const int settles = transfer->length == 7 && memcmp(transfer->buffer, "\n*IDN?\n", 7) == 0;
        const char *answer = settles ? "Maker,Model,SN1,scanhead native 1\r\n" : bus.answer;
        if (answer != NULL) fake_script(FAKE_IN, LIBUSB_TRANSFER_COMPLETED, answer, strlen(answer));
    }
    transfer->callback(transfer);
}

/* Carries out one scripted step. Returns 0 where there is none. Writes succeed unless the script says otherwise. */
static int fake_happen(void)
{
    for (int i = 0; i < bus.n_flying; i++) {
        if (!bus.gone && !bus.cancelled[i]) continue;
        fake_complete(i, bus.gone ? LIBUSB_TRANSFER_NO_DEVICE : LIBUSB_TRANSFER_CANCELLED, NULL, 0);
        return 1;
    }
    const struct fake_step *step = &bus.step[bus.done];
    for (int i = 0; bus.done < bus.n_steps && i < bus.n_flying; i++) {
        if (bus.flying[i]->endpoint != step->endpoint) continue;
        bus.done++;
        fake_complete(i, step->status, step->data, step->len);
        return 1;
    }
    for (int i = 0; i < bus.n_flying && !bus.hold_writes; i++) {
        if (bus.flying[i]->endpoint != FAKE_OUT) continue;
        fake_complete(i, LIBUSB_TRANSFER_COMPLETED, NULL, 0);
        return 1;
    }
    for (int i = 0; i < bus.n_flying && bus.feed != NULL; i++) {
        if (bus.flying[i]->endpoint != FAKE_IN) continue;
        size_t len = (size_t)bus.flying[i]->length;
        const uint8_t *data = bus.feed(&len);
        fake_complete(i, LIBUSB_TRANSFER_COMPLETED, data, (int)len);
        return 1;
    }
    return 0;
}

int libusb_handle_events_timeout_completed(libusb_context *ctx, struct timeval *wait, int *completed)
{
    (void)completed;
    int n = 0;
    if (bus.events_rc != 0 && bus.events_in-- == 0) {
        const int rc = bus.events_rc;
        bus.events_rc = 0;
        return rc;
    }
    while (fake_happen())
        n++;
    if (n > 0) return 0;
    bus.n_waits++;
    bus.last_wait_ms = (int)(1000 * wait->tv_sec + wait->tv_usec / 1000);
    const int present = bus.device[0].present;
    if (bus.idle != NULL) bus.idle();
    if (!present && bus.device[0].present && ctx->arrival != NULL)
        ctx->arrival(ctx, &bus.device[0], LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED, ctx->arrival_data);
    return 0;
}
