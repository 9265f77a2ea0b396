/* SPDX-License-Identifier: MIT */
/* The functionfs back end from its opening to its end, with a kernel's configfs in a folder. A socket pair stands for
 * ep0, FIFOs for the endpoints, and a pseudo terminal for the port of f_acm. */
#include "tests/unit/configfs_rig.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/usb/functionfs.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/bytes.h"
#include "core/monotonic.h"
#include "drivers/usb/backend.h"
#include "drivers/usb/functionfs_private.h"
#include "drivers/usb/head_device.h"

enum { AT_EP0, AT_AIO, AT_TTY, AT_TIMER };
enum { ROOM = 64 }; /* for an answer */

extern const struct usb_backend_ops usb_backend_functionfs;
static const struct usb_backend_ops *const ops = &usb_backend_functionfs;
static struct scanhead_usb head;
static void *backend;
static struct sh_err err;
static int kernel, master; /* the other ends of ep0 and of the port */
static char said[300];
static int n_said;

static int go_on(void *ctx)
{
    (void)ctx;
    return 1;
}

static void say(void *ctx, const char *text)
{
    (void)ctx;
    snprintf(said, sizeof said, "%s", text);
    n_said++;
}

static const struct usb_owner owner = {.go_on = go_on, .say = say};

static void make_head(enum usb_personality_id id, enum usb_rate highest)
{
    const struct usb_identity identity = {.vid = 0x1209, .pid = 1, .serial = "S1", .highest = highest};
    int pair[2];
    head = (struct scanhead_usb){0};
    if (scanhead_usb_create(usb_personality_get(id), &identity, &head, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, pair), 0);
    configfs.ep0 = pair[0];
    kernel = pair[1];
    master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    assert_int_equal(grantpt(master) | unlockpt(master), 0);
    configfs.tty = ptsname(master);
    configfs_add_udc("udc.0", "not attached\n", "UNKNOWN\n", "high-speed\n");
    n_said = 0;
}

static int open_backend(const char *udc)
{
    struct usb_backend_spec spec = {.type = USB_BACKEND_FUNCTIONFS};
    snprintf(spec.udc, sizeof spec.udc, "%s", udc);
    err = (struct sh_err){0, ""};
    return ops->open(&spec, head.device, &backend, &err);
}

static void begin(enum usb_personality_id id)
{
    make_head(id, USB_RATE_HIGH);
    if (open_backend("udc.0") != SH_OK) fail_msg("%s", err.text);
}

/* Frees the head. Nothing of the gadget may be left in the kernel. */
static void end_head(void)
{
    assert_int_equal(configfs_count(), 0);
    assert_int_equal(configfs.was_bound, 0);
    usb_device_free(head.device);
    close(configfs.ep0);
    close(kernel);
    close(master);
}

static void end(void)
{
    ops->close(backend);
    end_head();
}

/* Makes one call, as after poll(2). state, tty: more events of the controller and of the port. */
static void handle(short state, short tty)
{
    struct pollfd fds[USB_BACKEND_MAX_FDS];
    const int n = ops->prepare(backend, fds);
    for (int i = 0; i < n; i++)
        fds[i].revents = 0;
    assert_true(poll(fds, (nfds_t)n, 0) >= 0);
    fds[AT_EP0].revents = (short)(fds[AT_EP0].revents | state);
    fds[AT_TTY].revents = (short)(fds[AT_TTY].revents | tty);
    assert_int_equal(ops->handle(backend, fds, n, &owner), SH_OK);
    scanhead_usb_update(&head);
}

static void event(enum usb_functionfs_event_type type)
{
    const struct usb_functionfs_event e = {.type = (uint8_t)type};
    assert_int_equal(send(kernel, &e, sizeof e, 0), sizeof e);
    handle(0, 0);
}

/* The state of the controller changes; the kernel reports it through ep0 where there is one. */
static void set_state(const char *state)
{
    configfs_add_udc("udc.0", state, "high-speed\n", "high-speed\n");
}

/* The kernel passes a request on, with these bytes after it if it is OUT. Returns the length of the answer, or -1. */
static ssize_t request(unsigned type, unsigned what, unsigned value, unsigned index, unsigned length, const void *out,
                       void *answer)
{
    struct usb_functionfs_event e = {.type = FUNCTIONFS_SETUP};
    e.u.setup = (struct usb_ctrlrequest){.bRequestType = (uint8_t)type, .bRequest = (uint8_t)what};
    le_put16(&e.u.setup.wValue, (uint16_t)value);
    le_put16(&e.u.setup.wIndex, (uint16_t)index);
    le_put16(&e.u.setup.wLength, (uint16_t)length);
    while (recv(kernel, answer, ROOM, MSG_DONTWAIT) >= 0) /* what was written before */
        continue;
    assert_int_equal(send(kernel, &e, sizeof e, 0), sizeof e);
    if (out != NULL) assert_int_equal(send(kernel, out, length, 0), length);
    handle(0, 0);
    return recv(kernel, answer, ROOM, MSG_DONTWAIT);
}

static size_t take_text(int fd, char *text, size_t room)
{
    const ssize_t n = read(fd, text, room - 1);
    text[n > 0 ? n : 0] = '\0';
    return n > 0 ? (size_t)n : 0;
}

static void test_opening(void **state)
{
    (void)state;
    char text[300], bytes[2048];
    begin(USB_PERSONALITY_NATIVE);
    const struct functionfs *self = backend;
    ops->endpoint(backend, text, sizeof text);
    assert_string_equal(text, "functionfs:udc.0");
    assert_string_equal(configfs_get(self->gadget.dir, "UDC"), "udc.0\n");
    const ssize_t n = recv(kernel, bytes, sizeof bytes, 0); /* the descriptors, whole */
    assert_int_equal(le_get32((uint8_t *)bytes), FUNCTIONFS_DESCRIPTORS_MAGIC_V2);
    assert_int_equal(le_get32((uint8_t *)bytes + 4), n);
    recv(kernel, bytes, sizeof bytes, 0);
    assert_int_equal(le_get32((uint8_t *)bytes), FUNCTIONFS_STRINGS_MAGIC);
    assert_int_equal(usb_facts(head.device)->configuration, 0);
    end();
}

/* The host configures the device. Its console has a terminal without any processing of lines, and its stream. */
static void test_sessions(void **state)
{
    (void)state;
    char text[ROOM];
    begin(USB_PERSONALITY_NATIVE);
    set_state("configured\n");
    event(FUNCTIONFS_ENABLE);
    assert_int_equal(usb_facts(head.device)->configuration, 1);
    assert_int_equal(usb_facts(head.device)->rate, USB_RATE_HIGH);
    assert_int_equal(write(master, "*IDN?\n", 6), 6);
    handle(0, 0);
    assert_int_equal(head.session[0].open, 1);
    assert_int_equal(usb_device_read(head.device, CONSOLE_OUT, text, sizeof text), 6);
    assert_memory_equal(text, "*IDN?\n", 6);
    assert_int_equal(take_text(master, text, sizeof text), 0); /* no echo */
    assert_int_equal(usb_device_write(head.device, CONSOLE_IN, "a\nb\n", 4), 4);
    handle(0, 0);
    size_t n = 0;
    for (size_t more = 1; more > 0; n += more)
        more = take_text(master, text + n, sizeof text - n);
    assert_int_equal(n, 4);
    assert_memory_equal(text, "a\nb\n", 4);
    /* Requests have FunctionFS's own numbers: interface 0 there is the stream. */
    const unsigned vendor = USB_TYPE_VENDOR | USB_RECIP_INTERFACE;
    assert_int_equal(head.session[1].open, 0);
    request(USB_DIR_OUT | vendor, SCANHEAD_USB_STREAM, 1, 0, 0, NULL, text);
    assert_int_equal(head.session[1].open, 1);
    assert_int_equal(request(USB_DIR_IN | vendor, SCANHEAD_USB_STREAM, 0, 0, 1, NULL, text), 1);
    assert_int_equal(text[0], 1);
    assert_int_equal(request(USB_DIR_IN | vendor, SCANHEAD_USB_STREAM, 0, 1, 1, NULL, text), -1);
    request(USB_DIR_OUT | vendor, SCANHEAD_USB_STREAM, 0, 0, 0, NULL, text);
    assert_int_equal(head.session[1].open, 0);
    /* A suspended device has no room. */
    assert_int_equal(usb_device_can_write(head.device, STREAM_IN), 1);
    event(FUNCTIONFS_SUSPEND);
    assert_int_equal(usb_device_can_write(head.device, STREAM_IN), 0);
    event(FUNCTIONFS_RESUME);
    assert_int_equal(usb_device_can_write(head.device, STREAM_IN), 1);
    assert_int_equal(n_said, 0);
    end();
}

/* The kernel reports three causes alike; the state of the controller tells a reset from an unplugging. */
static void test_ends_of_sessions(void **state)
{
    (void)state;
    static const struct {
        enum usb_functionfs_event_type event;
        const char *state, *cut;
    } rows[] = {{FUNCTIONFS_DISABLE, "default\n", "the host reset the bus"},
                {FUNCTIONFS_DISABLE, "not attached\n", "unplugged"},
                {FUNCTIONFS_UNBIND, "configured\n", "unplugged"},
                {FUNCTIONFS_ENABLE, "configured\n", "the host reset the bus"}};
    begin(USB_PERSONALITY_NATIVE);
    const struct functionfs *self = backend;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char text[ROOM];
        set_state("configured\n");
        event(FUNCTIONFS_ENABLE);
        scanhead_usb_cut(&head); /* of the round before */
        request(USB_TYPE_VENDOR | USB_RECIP_INTERFACE, SCANHEAD_USB_STREAM, 1, 0, 0, NULL, text);
        assert_int_equal(head.session[1].open, 1);
        event(FUNCTIONFS_BIND); /* which changes nothing */
        assert_int_equal(head.session[1].open, 1);
        assert_true(self->console.fd >= 0);
        set_state(rows[i].state);
        event(rows[i].event);
        assert_int_equal(head.session[1].open, 0);
        const char *cut = scanhead_usb_cut(&head);
        assert_non_null(cut);
        assert_int_equal(strncmp(cut, rows[i].cut, strlen(rows[i].cut)), 0);
        assert_int_equal(usb_facts(head.device)->configuration, rows[i].event == FUNCTIONFS_ENABLE);
        if (rows[i].event != FUNCTIONFS_ENABLE) assert_int_equal(self->console.fd, -1);
    }
    end();
}

/* Injected faults take the device off its controller, and put it back. */
static void test_faults(void **state)
{
    (void)state;
    begin(USB_PERSONALITY_NATIVE);
    const struct functionfs *self = backend;
    set_state("configured\n");
    event(FUNCTIONFS_ENABLE);
    assert_int_equal(ops->fault(backend, USB_FAULT_UNPLUG), SH_OK);
    assert_string_equal(configfs_get(self->gadget.dir, "UDC"), "\n");
    assert_int_equal(usb_facts(head.device)->configuration, 0);
    assert_int_equal(usb_facts(head.device)->end, USB_END_UNPLUGGED);
    assert_int_equal(ops->fault(backend, USB_FAULT_UNPLUG), SH_ESTATE);
    assert_int_equal(ops->fault(backend, USB_FAULT_RESET), SH_ESTATE);
    configfs.busy = "udc.0"; /* another gadget has taken the controller */
    assert_int_equal(ops->fault(backend, USB_FAULT_PLUG), SH_ESTATE);
    configfs.busy = NULL;
    assert_int_equal(ops->fault(backend, USB_FAULT_PLUG), SH_OK);
    assert_string_equal(configfs_get(self->gadget.dir, "UDC"), "udc.0\n");
    assert_int_equal(ops->fault(backend, USB_FAULT_PLUG), SH_OK); /* it is there */
    event(FUNCTIONFS_ENABLE);
    assert_int_equal(usb_facts(head.device)->configuration, 1);
    assert_int_equal(ops->fault(backend, USB_FAULT_RESET), SH_OK);
    assert_int_equal(usb_facts(head.device)->configuration, 0);
    assert_string_equal(configfs_get(self->gadget.dir, "UDC"), "udc.0\n");
    end();
}

/* A port alone has no ep0. The state of the controller shows what the host does. A hang-up shows that the device was
 * not configured for a while. */
static void test_port_alone(void **state)
{
    (void)state;
    begin(USB_PERSONALITY_HOKUYO);
    const struct functionfs *self = backend;
    struct pollfd fds[USB_BACKEND_MAX_FDS];
    ops->prepare(backend, fds);
    assert_int_equal(fds[AT_EP0].fd, self->gadget.state_fd);
    assert_int_equal(fds[AT_EP0].events, POLLPRI);
    assert_int_equal(recv(kernel, said, 1, MSG_DONTWAIT), -1); /* nothing is described */
    set_state("configured\n");
    handle(0, 0);
    assert_int_equal(usb_facts(head.device)->configuration, 0); /* no change was reported */
    assert_int_equal(ops->due_ns(backend), INT64_MAX);
    const int64_t from_ns = monotonic_ns();
    handle(POLLPRI | POLLERR, 0);
    assert_int_equal(usb_facts(head.device)->configuration, 1);
    assert_in_range(ops->due_ns(backend), from_ns + 1000000000, monotonic_ns() + 1000000000); /* a look at the host */
    const uint32_t first = usb_facts(head.device)->attaches;
    set_state("suspended\n");
    handle(POLLPRI, 0);
    assert_int_equal(usb_facts(head.device)->configuration, 1);
    set_state("configured\n");
    handle(POLLPRI, 0);
    assert_int_equal(usb_facts(head.device)->attaches, first);
    handle(0, POLLHUP); /* it was not configured for a while */
    assert_int_equal(usb_facts(head.device)->configuration, 1);
    assert_int_equal(usb_facts(head.device)->attaches, first + 1);
    set_state("addressed\n");
    handle(POLLPRI, 0);
    assert_int_equal(usb_facts(head.device)->configuration, 0);
    assert_int_equal(self->console.fd, -1);
    set_state("configured\n");
    handle(POLLPRI, 0);
    set_state("not attached\n");
    handle(POLLPRI, 0);
    assert_int_equal(usb_facts(head.device)->configuration, 0);
    assert_int_equal(usb_facts(head.device)->end, USB_END_UNPLUGGED);
    end();
}

/* Clients of a TiM know its endpoints by their addresses. A controller that gives others is named, once. */
static void test_moved_endpoints(void **state)
{
    (void)state;
    static const struct {
        uint8_t given[2];
        const char *said;
    } rows[] = {
        {{0, 0}, NULL}, {{0x81, 0x02}, NULL}, {{0x83, 0x02}, "83 in place of 81"}, {{0x81, 0x04}, "04 in place of 02"}};
    char text[200];
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        memcpy(configfs.given, rows[i].given, sizeof configfs.given);
        begin(USB_PERSONALITY_SICK);
        for (int times = 0; times < 2; times++) {
            configfs.n_given = 0;
            event(FUNCTIONFS_ENABLE);
        }
        assert_int_equal(n_said, rows[i].said != NULL);
        snprintf(text, sizeof text,
                 "the controller udc.0 gives endpoint %s; clients that look for the device's own endpoints don't find "
                 "it: use backend usbip or usbredir",
                 rows[i].said);
        if (rows[i].said != NULL) assert_string_equal(said, text);
        end();
    }
    begin(USB_PERSONALITY_NATIVE); /* its clients ask the descriptors */
    event(FUNCTIONFS_ENABLE);
    assert_int_equal(n_said, 0);
    end();
}

static void expect_no_opening(const char *udc, int code, const char *text)
{
    assert_int_equal(open_backend(udc), code);
    if (strstr(err.text, text) == NULL) fail_msg("%s", err.text);
    assert_int_equal(configfs_count(), 0);
    assert_int_equal(configfs.was_bound, 0);
}

static void test_failures(void **state)
{
    (void)state;
    make_head(USB_PERSONALITY_NATIVE, USB_RATE_SUPER);
    expect_no_opening("udc.0", SH_EINPUT,
                      "functionfs: device controller udc.0 does not reach super speed; allowed full, high");
    expect_no_opening("udc.1", SH_EINPUT, "functionfs: there is no device controller udc.1; ");
    configfs.tty = NULL;
    expect_no_opening("udc.0", SH_EIO, "functionfs: console /dev/ttyGS3: No such file or directory; is devtmpfs");
    close(configfs.ep0);
    configfs.ep0 = 0;
    expect_no_opening("udc.0", SH_EIO, "/ep0: No such file or directory");
    configfs.ep0 = dup(kernel);
    end_head();
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, configfs_set_up, configfs_tear_down)
    const struct CMUnitTest tests[] = {TEST(test_opening), TEST(test_sessions),   TEST(test_ends_of_sessions),
                                       TEST(test_faults),  TEST(test_port_alone), TEST(test_moved_endpoints),
                                       TEST(test_failures)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
