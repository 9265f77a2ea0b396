/* SPDX-License-Identifier: MIT */
/* These tests run the console of a gadget, with a socket pair in place of the kernel's tty. A second passes where a
 * look at the host is due at once. A socket pair also reports how much was not taken yet (TIOCOUTQ is SIOCOUTQ).
 * Clients stop reading, and others come after them. */
#include "tests/unit/usb_host.h"

#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/protocol/native.h"
#include "drivers/usb/functionfs_private.h"
#include "drivers/usb/head_device.h"

enum { CONSOLE = 0 }; /* the session */

struct port {
    struct scanhead_usb head;
    struct ffs_console console;
    int host;
};

static void on_complete(void *ctx, struct usb_transfer *transfer)
{
    struct port *port = ctx;
    assert_int_equal(ffs_console_complete(&port->console, transfer), 1);
}

static void control(struct port *port, unsigned type, unsigned request, unsigned value)
{
    struct usb_ctrlrequest setup = {.bRequestType = (uint8_t)type, .bRequest = (uint8_t)request};
    le_put16(&setup.wValue, (uint16_t)value);
    assert_int_equal(usb_device_control(port->head.device, &setup, NULL, 0), 0);
}

/* pair: the console's descriptor, and the host's. */
static int open_port_on(void **state, const int pair[2])
{
    static struct port port;
    const struct usb_identity id = {.vid = 1, .pid = 1, .highest = USB_RATE_HIGH};
    struct sh_err err = {0, ""};
    memset(&port, 0, sizeof port);
    *state = &port;
    if (scanhead_usb_create(usb_personality_get(USB_PERSONALITY_NATIVE), &id, &port.head, &err) != SH_OK)
        fail_msg("%s", err.text);
    port.console.device = port.head.device;
    port.console.fd = pair[0];
    port.host = pair[1];
    port.console.look_ns = INT64_MAX;
    usb_device_attach(port.head.device, USB_RATE_HIGH, on_complete, &port);
    control(&port, 0x00, USB_REQ_SET_ADDRESS, 5);
    control(&port, 0x00, USB_REQ_SET_CONFIGURATION, 1);
    port.console.number = -1; /* so that nothing is looked for below /dev */
    return 0;
}

static int open_port_of(void **state, int type)
{
    int pair[2];
    assert_int_equal(socketpair(AF_UNIX, type | SOCK_NONBLOCK, 0, pair), 0);
    return open_port_on(state, pair);
}

static int open_port(void **state)
{
    return open_port_of(state, SOCK_STREAM);
}

/* A socket of TCP counts what waits in bytes, as a tty does. The host takes some KiB, and then no more. */
static int open_port_of_bytes(void **state)
{
    const int least = 1, much = 1 << 17;
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t len = sizeof at;
    int pair[2], listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(listener, (struct sockaddr *)&at, len), 0);
    assert_int_equal(listen(listener, 1), 0);
    assert_int_equal(getsockname(listener, (struct sockaddr *)&at, &len), 0);
    pair[1] = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(setsockopt(pair[1], SOL_SOCKET, SO_RCVBUF, &least, sizeof least), 0);
    assert_int_equal(connect(pair[1], (struct sockaddr *)&at, len), 0);
    pair[0] = accept4(listener, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    assert_int_equal(setsockopt(pair[0], SOL_SOCKET, SO_SNDBUF, &much, sizeof much), 0);
    close(listener);
    return open_port_on(state, pair);
}

/* On this port each write is a packet of its own, as it is a request of its own in the kernel's tty. */
static int open_port_of_packets(void **state)
{
    return open_port_of(state, SOCK_SEQPACKET);
}

static int close_port(void **state)
{
    struct port *port = *state;
    usb_device_free(port->head.device); /* it frees the waiting bytes */
    ffs_console_stop(&port->console);
    close(port->host);
    return 0;
}

/* The client sends a line, and the head reads all of it. */
static void client_says(struct port *port, const char *text)
{
    char heard[64];
    const size_t len = strlen(text);
    assert_int_equal(write(port->host, text, len), len);
    ffs_console_handle(&port->console, POLLIN);
    assert_int_equal(usb_device_read(port->head.device, CONSOLE_OUT, heard, sizeof heard), len);
    assert_memory_equal(heard, text, len);
    assert_int_equal(port->head.session[CONSOLE].open, 1);
}

static void second_passes(struct port *port)
{
    port->console.look_ns = 0;
    ffs_console_handle(&port->console, 0);
    assert_true(port->console.look_ns > 0); /* the next look */
    port->console.look_ns = INT64_MAX;
}

static size_t head_says(struct port *port, const void *text, size_t len)
{
    ffs_console_handle(&port->console, POLLOUT); /* as poll(2) has it where there is room */
    return usb_device_write(port->head.device, CONSOLE_IN, text, len);
}

/* Fills the port until it takes no more, with a part of the last text still at the console. Returns the number of bytes
 * that the head wrote. */
static size_t fill(struct port *port)
{
    static char old[1000];
    size_t written = 0, n;
    memset(old, 'o', sizeof old);
    while ((n = head_says(port, old, sizeof old)) != 0)
        written += n;
    assert_true((ffs_console_events(&port->console) & POLLOUT) != 0);
    return written;
}

static size_t client_reads(struct port *port, void *bytes, size_t room)
{
    size_t len = 0;
    ssize_t n = 1;
    while (len < room && n > 0) {
        n = recv(port->host, (char *)bytes + len, room - len, MSG_DONTWAIT);
        if (n > 0) len += (size_t)n;
        ffs_console_handle(&port->console, ffs_console_events(&port->console) & POLLOUT);
    }
    return len;
}

static char bytes[1 << 22];

/* What the head has not read yet holds the client back. It is neither lost nor mixed with what comes next. */
static void a_head_that_does_not_read_holds_back(void **state)
{
    struct port *port = *state;
    char heard[64];
    assert_int_equal(write(port->host, "first", 5), 5);
    ffs_console_handle(&port->console, POLLIN);
    assert_int_equal(ffs_console_events(&port->console), 0);
    assert_int_equal(write(port->host, "second", 6), 6);
    ffs_console_handle(&port->console, POLLIN);
    assert_int_equal(usb_device_read(port->head.device, CONSOLE_OUT, heard, sizeof heard), 5);
    assert_memory_equal(heard, "first", 5);
    assert_int_equal(ffs_console_events(&port->console), POLLIN);
    ffs_console_handle(&port->console, POLLIN);
    assert_int_equal(usb_device_read(port->head.device, CONSOLE_OUT, heard, sizeof heard), 6);
    assert_memory_equal(heard, "second", 6);
}

/* The client closed its port, which is not reported: for a second and more the port takes nothing. Bytes in the port go
 * to the next client. Bytes still to be given to the port do not. A whole frame follows the one that was cut. */
static void what_waits_at_a_close_is_void(void **state)
{
    struct port *port = *state;
    client_says(port, "SCAN:STAR\n");
    const size_t written = fill(port);
    for (int i = 0; i < 3; i++)
        second_passes(port);
    assert_int_equal(port->head.session[CONSOLE].open, 0);
    assert_int_equal(ffs_console_events(&port->console) & POLLOUT, 0);
    assert_int_equal(usb_device_can_write(port->head.device, CONSOLE_IN), 1); /* for the next session */
    const size_t held = client_reads(port, bytes, sizeof bytes);
    assert_in_range(held, 1, written - 1);
    for (size_t i = 0; i < held; i++)
        assert_int_equal(bytes[i], 'o');
    client_says(port, "*IDN?\n");
    assert_int_equal(head_says(port, "new", 3), 3);
    const size_t len = client_reads(port, bytes, sizeof bytes);
    struct native_event event;
    assert_true(len == native_frame_len((uint8_t *)bytes) + 3);
    assert_memory_equal(bytes + len - 3, "new", 3);
    assert_int_equal(native_decode_event((uint8_t *)bytes + NATIVE_HEADER_LEN, len - 3 - NATIVE_HEADER_LEN, &event),
                     SH_OK);
    assert_int_equal(event.code, NATIVE_EV_READER_LOST);
}

/* A client that is slow, or has nothing to read, keeps its session. */
static void a_slow_client_keeps_its_session(void **state)
{
    struct port *port = *state;
    client_says(port, "SCAN:STAR\n");
    const size_t written = fill(port);
    size_t got = 0;
    for (int i = 0; got < written; i++) {
        got += client_reads(port, bytes, 1000);
        second_passes(port);
        assert_int_equal(port->head.session[CONSOLE].open, 1);
        assert_true(i < 100);
    }
    assert_int_equal(got, written);
    for (int i = 0; i < 3; i++)
        second_passes(port);
    assert_int_equal(port->head.session[CONSOLE].open, 1);
    assert_int_equal(head_says(port, "new", 3), 3);
    assert_int_equal(client_reads(port, bytes, sizeof bytes), 3); /* nothing else goes before it */
}

/* A client stops reading while the head goes on writing. Its port counts as closed all the same: only bytes that the
 * client takes keep it open. TURNS is in seconds. Two of them may show progress: each of the client's last two packets
 * may be acknowledged late. */
static void writing_is_not_taking(void **state)
{
    enum { FULL = 65536, TURNS = 6 };
    struct port *port = *state;
    client_says(port, "SCAN:STAR\n");
    for (size_t n = 0; n < FULL;) {
        const size_t more = head_says(port, bytes, 1000);
        assert_true(more > 0);
        n += more;
    }
    for (int i = 0; i < TURNS && port->head.session[CONSOLE].open; i++) {
        second_passes(port);
        if (port->head.session[CONSOLE].open) assert_int_equal(head_says(port, "0123456789", 10), 10);
    }
    assert_int_equal(port->head.session[CONSOLE].open, 0);
}

/* The port takes a part of the frame that comes first in a new session, and later the rest of it. */
static void a_lead_in_goes_in_parts(void **state)
{
    enum { PART = 10 };
    struct port *port = *state;
    client_says(port, "SCAN:STAR\n");
    fill(port);
    second_passes(port);
    second_passes(port);
    assert_int_equal(port->head.session[CONSOLE].open, 0);
    client_says(port, "*IDN?\n"); /* there is no room for the frame */
    assert_true((ffs_console_events(&port->console) & POLLOUT) != 0);
    assert_int_equal(port->console.lead_pos, 0);
    const uint32_t lead_len = port->console.lead_len;
    port->console.lead_pos = PART;
    size_t old = 0;
    for (ssize_t n; (n = recv(port->host, bytes, sizeof bytes, MSG_DONTWAIT)) > 0;)
        old += (size_t)n;
    assert_true(old > 0);
    assert_int_equal(head_says(port, "new", 3), 3);
    assert_int_equal(ffs_console_events(&port->console), POLLIN);
    assert_int_equal(client_reads(port, bytes, sizeof bytes), lead_len - PART + 3);
    assert_memory_equal(bytes, port->console.lead + PART, lead_len - PART);
    assert_memory_equal(bytes + lead_len - PART, "new", 3);
}

/* The tty has 16 requests, and shows that nobody reads only when all are in use. So a short text is split to use all of
 * them, if need be byte by byte. A text of a KiB or more goes out at once. */
static void a_short_text_takes_all_requests(void **state)
{
    struct port *port = *state;
    static const size_t len[] = {1, 15, 16, 17, 100, 1023, 1024, 1025, 4000};
    enum { REQUESTS = 16 };
    char text[4000];
    for (size_t i = 0; i < sizeof text; i++)
        text[i] = (char)('a' + i % 23);
    client_says(port, "SCAN:STAR\n");
    for (size_t i = 0; i < sizeof len / sizeof len[0]; i++) {
        size_t got = 0, writes = 0;
        ssize_t n;
        assert_int_equal(head_says(port, text, len[i]), len[i]);
        for (; (n = recv(port->host, bytes + got, sizeof bytes - got, MSG_DONTWAIT)) > 0; writes++)
            got += (size_t)n;
        assert_int_equal(got, len[i]);
        assert_memory_equal(bytes, text, len[i]);
        if (len[i] < 1024)
            assert_true(writes >= (len[i] < REQUESTS ? len[i] : REQUESTS));
        else
            assert_int_equal(writes, 1);
        assert_int_equal(ffs_console_events(&port->console), POLLIN); /* nothing waits */
    }
}

static void a_missing_tty_is_reported(void **state)
{
    (void)state;
    struct ffs_console console;
    struct sh_err err = {0, ""};
    assert_int_equal(ffs_console_open(&console, NULL, 987654, &err), SH_EIO);
    assert_string_equal(err.text,
                        "functionfs: console /dev/ttyGS987654: No such file or directory; is devtmpfs mounted "
                        "on /dev?");
    ffs_console_stop(&console);
    assert_int_equal(ffs_console_open(&console, NULL, -1, &err), SH_OK); /* a device without a console */
    ffs_console_start(&console);
    assert_int_equal(console.fd, -1);
    ffs_console_stop(&console);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_waits_at_a_close_is_void, open_port, close_port),
        cmocka_unit_test_setup_teardown(a_head_that_does_not_read_holds_back, open_port, close_port),
        cmocka_unit_test_setup_teardown(a_slow_client_keeps_its_session, open_port, close_port),
        cmocka_unit_test_setup_teardown(writing_is_not_taking, open_port_of_bytes, close_port),
        cmocka_unit_test_setup_teardown(a_lead_in_goes_in_parts, open_port, close_port),
        cmocka_unit_test_setup_teardown(a_short_text_takes_all_requests, open_port_of_packets, close_port),
        cmocka_unit_test(a_missing_tty_is_reported),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
