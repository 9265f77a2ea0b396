/* SPDX-License-Identifier: MIT */
/* A client of SCIP asks for a reboot, and for the head's state, from the program. Most tests run in the pace step,
 * where nothing depends on when a client connects. */
#include "tests/wire/room.h"
#include "tests/wire/usbip_host.h"

static struct head start(struct wire *wire, const char *profile, const char *links, const char *more, const char *pace)
{
    const struct room_config config = {
        .profile = profile, .prr_hz = 57600, .lines_hz = 40, .links = links, .more = more};
    const char *const args[] = {"--pace", pace, NULL};
    room_write(wire);
    return head_start(wire, room_config_write(wire, &config), args);
}

/* ---- a client of SCIP */

struct client {
    int fd;
    char bytes[1 << 14];
    size_t len;
};

/* Returns whether the connection ends within a time. Bytes before the end are thrown away. */
static int is_over(int fd, int within_ms)
{
    char bytes[4096];
    struct pollfd slot = {.fd = fd, .events = POLLIN};
    while (poll(&slot, 1, within_ms) == 1)
        if (read(fd, bytes, sizeof bytes) <= 0) return 1;
    return 0;
}

/* Returns the next answer up to its empty line, which is good until the next call. */
static const char *answer(struct client *c)
{
    static char text[sizeof c->bytes + 1];
    for (;;) {
        const char *end = memmem(c->bytes, c->len, "\n\n", 2);
        if (end != NULL) {
            const size_t n = (size_t)(end - c->bytes) + 2;
            memcpy(text, c->bytes, n);
            text[n] = '\0';
            memmove(c->bytes, c->bytes + n, c->len -= n);
            return text;
        }
        struct pollfd slot = {.fd = c->fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        const ssize_t got = read(c->fd, c->bytes + c->len, sizeof c->bytes - c->len);
        assert_true(got > 0);
        c->len += (size_t)got;
    }
}

static const char *ask(struct client *c, const char *line)
{
    raw_send(c->fd, line, strlen(line));
    return answer(c);
}

static void expect_in(struct client *c, const char *line, const char *piece)
{
    const char *said = ask(c, line);
    if (strstr(said, piece) == NULL) fail_msg("%s: no %s in %s", line, piece, said);
}

static void expect_not_in(struct client *c, const char *line, const char *piece)
{
    const char *said = ask(c, line);
    if (strstr(said, piece) != NULL) fail_msg("%s: %s in %s", line, piece, said);
}

/* Returns the time stamp of TM1 in ms. */
static uint32_t time_ms(struct client *c)
{
    uint32_t ms = 0;
    const char *said = ask(c, "TM1\n");
    assert_memory_equal(said, "TM1\n00P\n", 8);
    for (int i = 0; i < 4; i++)
        ms = ms * 64 + (uint32_t)(said[8 + i] - '0');
    return ms;
}

static void connect_to(struct client *c, const struct head *head)
{
    *c = (struct client){.fd = raw_connect(head_endpoint(head, "tcp"))};
}

/* ---- the client that grants time has control, and its session ends with the head's power, too */

static void step(struct scanhead *sh, int ms)
{
    char line[32];
    snprintf(line, sizeof line, "TIME:STEP %d MS", ms);
    client_tell(sh, line);
}

/* Grants time until the client is hung up: a second, and the delay of the client's link. The delay is at most half a
 * second, since a link holds the head back when it is later than loop.queue_ms. */
static void reboot(struct scanhead *sh, struct client *c, const struct head *head)
{
    char reply[64];
    assert_string_equal(ask(c, "RB\n"), "RB\n01Q\n\n");
    assert_string_equal(ask(c, "RB\n"), "RB\n00P\n\n");
    step(sh, 990);
    assert_string_equal(ask(c, "QT\n"), "QT\n00P\n\n"); /* not yet */
    for (int over = 0, n = 0; !over; n++) {
        assert_in_range(n, 0, 50);
        if (scanhead_command(sh, "TIME:STEP 10 MS", reply, sizeof reply, DEADLINE_MS) != SCANHEAD_OK)
            while (scanhead_reattach(sh, DEADLINE_MS) != SCANHEAD_OK)
                continue;
        over = is_over(c->fd, 100);
    }
    close(c->fd);
    *c = (struct client){.fd = raw_connect_again(head_endpoint(head, "tcp"), "QT\n")};
    assert_string_equal(answer(c), "QT\n00P\n\n");
}

static const char LINKS[] = "links: [{type: tcp, port: 0, protocol: scip}, {type: pty, path: native}]\n";

/* The device takes its own time to boot, and its clock starts from 0. */
static void reboots(void **state)
{
    struct wire *wire = *state;
    static struct client c;
    struct head head = start(wire, "hokuyo-utm-30lx-ew", LINKS, "", "step");
    struct scanhead *sh = client_open(head_endpoint(&head, "pty"));
    connect_to(&c, &head);
    step(sh, 1000);
    for (int times = 0; times < 2; times++) {
        expect_in(&c, "II\n", "\nMESM:001 Booting;");
        expect_not_in(&c, "II\n", "STAT:Stable");
        expect_in(&c, "%ST\n", "\n001A\n");
        expect_in(&c, "TM0\n", "\n10Q\n");
        expect_in(&c, "BM\n", "\n10Q\n");
        assert_in_range(time_ms(&c), 0, 1000);
        step(sh, 2000);
        expect_in(&c, "II\n", "\nMESM:000 Idle;");
        expect_in(&c, "II\n", "\nSTAT:Stable 000 no error.;");
        expect_in(&c, "TM0\n", "\n00P\n");
        expect_in(&c, "TM2\n", "\n00P\n");
        assert_in_range(time_ms(&c), 2000, 3000);
        if (times == 0) reboot(sh, &c, &head);
    }
    close(c.fd);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* urg_library's urg_reboot() closes once it has the second answer. */
static void reboots_though_its_client_has_gone(void **state)
{
    struct wire *wire = *state;
    static struct client c;
    char reply[64];
    int hung_up = 0;
    struct head head = start(wire, "hokuyo-ust-10lx", LINKS, "", "step");
    struct scanhead *sh = client_open(head_endpoint(&head, "pty"));
    connect_to(&c, &head);
    step(sh, 1000);
    assert_string_equal(ask(&c, "RB\n"), "RB\n01Q\n\n");
    assert_string_equal(ask(&c, "RB\n"), "RB\n00P\n\n");
    close(c.fd);
    for (int n = 0; n < 50 && !hung_up; n++)
        hung_up = scanhead_command(sh, "TIME:STEP 100 MS", reply, sizeof reply, DEADLINE_MS) != SCANHEAD_OK;
    assert_true(hung_up);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* The first boot ends within the fault's window, the second one after it. */
static void fails_its_self_test(void **state)
{
    struct wire *wire = *state;
    static struct client c;
    struct head head = start(wire, "hokuyo-utm-30lx", LINKS, "faults: [{kind: self_test, until_s: 1}]\n", "step");
    struct scanhead *sh = client_open(head_endpoint(&head, "pty"));
    connect_to(&c, &head);
    step(sh, 300);
    expect_not_in(&c, "II\n", "STAT:Sensor works well.");
    expect_in(&c, "BM\n", "\n01Q\n");
    reboot(sh, &c, &head);
    step(sh, 300);
    expect_in(&c, "II\n", "\nSTAT:Sensor works well.;8\n");
    expect_in(&c, "TM0\n", "\n00P\n");
    close(c.fd);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* ---- USB: the device is unplugged, and the same device comes back */

static void usb_goes_and_comes(void **state)
{
    struct wire *wire = *state;
    char text[512] = "";
    size_t n = 0;
    struct head head =
        start(wire, "hokuyo-utm-30lx", "links: [{type: usb, port: 0, protocol: scip}]\n", "", "realtime");
    struct usbip_host host = usbip_host_open(&head);
    assert_int_equal(usbip_host_control(&host, 0x00, 9, 1, 0, NULL, 0), 0);
    assert_int_equal(usbip_host_control(&host, 0x21, 0x22, 1, 0, NULL, 0), 0); /* DTR */
    usbip_host_send(&host, 1, "RB\nRB\n", 6);
    while (strstr(text, "RB\n01Q\n\nRB\n00P\n\n") == NULL) {
        n += usbip_host_receive(&host, 1, text + n, (uint32_t)(sizeof text - 1 - n));
        assert_true(n < sizeof text - 1);
        text[n] = '\0';
    }
    assert_true(is_over(host.fd, DEADLINE_MS));
    usbip_host_close(&host);
    host = usbip_host_open_within(&head, DEADLINE_MS);
    assert_int_equal(usbip_host_control(&host, 0x00, 9, 1, 0, NULL, 0), 0);
    usbip_host_close(&host);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(reboots, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(reboots_though_its_client_has_gone, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(fails_its_self_test, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(usb_goes_and_comes, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
