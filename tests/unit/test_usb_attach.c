/* SPDX-License-Identifier: MIT */
/* A device plugs itself in (`attach: on`), and its host lets go of it. The device comes back by itself, and reports
 * that. */
#include "tests/unit/usbip_client.h"

#include <fcntl.h>
#include <poll.h>

#include "core/monotonic.h"
#include "drivers/usb/retry.h"
#include "drivers/usb/vhci.h"

/* This fake replaces the kernel's virtual host controller, and the module that talks to it. The fake takes the other
 * end of the socket pair, as the kernel does. */
static struct {
    int fd, attempts, refuses;
} vhci = {.fd = -1};

int vhci_attach(const char *dir, int fd, uint32_t devid, enum usb_rate rate, unsigned *port, struct sh_err *err)
{
    assert_null(dir);
    assert_int_equal(devid, DEVID);
    assert_int_equal(rate, USB_RATE_HIGH);
    *port = (unsigned)vhci.attempts++;
    if (vhci.refuses > 0) {
        vhci.refuses--;
        return sh_fail(err, SH_EINPUT, "no such module %d", vhci.refuses);
    }
    assert_int_equal(vhci.fd, -1);
    vhci.fd = dup(fd);
    return SH_OK;
}

static struct reply r;

static struct client host_of(struct bench *bench)
{
    struct client c = {.bench = bench, .fd = vhci.fd};
    vhci.fd = -1;
    assert_true(c.fd >= 0);
    assert_int_equal(client_control(&c, &r, 0x80, 6, 0x0100, 0, 18, NULL), 0);
    client_configure(&c);
    client_open_stream(&c);
    return c;
}

static struct bench open_attached(int retry_ms)
{
    struct link_spec spec = {.type = LINK_USB,
                             .backend = USB_BACKEND_USBIP,
                             .speed = USB_RATE_HIGH,
                             .vid = 0x1209,
                             .pid = 1,
                             .attach = 1,
                             .retry_ms = retry_ms};
    return bench_open(&spec);
}

static void test_usbip(void **state)
{
    (void)state;
    struct bench bench = open_attached(1);
    for (int round = 0; round < 3; round++) {
        char name[300], want[40];
        struct client c = host_of(&bench);
        bench.ops->endpoint(bench.link, name, sizeof name);
        snprintf(want, sizeof want, "usbip:vhci_hcd.0:%d", vhci.attempts - 1);
        assert_string_equal(name, want);
        client_submit(&c, 1, 3, NULL, NULL, 512); /* in flight */
        vhci.refuses = 2 * round;
        close(c.fd); /* as `usbip detach` does */
        assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, 1);
        bench_expect_notice(&bench, "detached");
        if (round > 0) bench_expect_notice(&bench, "no such module"); /* once, however often it is tried */
        bench_expect_notice(&bench, "plugged in again");
        assert_int_equal(vhci.refuses, 0);
    }
    close(vhci.fd);
    vhci.fd = -1;
    bench_close(&bench);
}

/* A device that can't be plugged in at all gives an error at once, and nothing is tried again. */
static void test_usbip_refused(void **state)
{
    (void)state;
    struct link_spec spec = {
        .type = LINK_USB, .backend = USB_BACKEND_USBIP, .speed = USB_RATE_HIGH, .vid = 1, .attach = 1};
    struct sh_err err = {0, ""};
    void *link;
    vhci.refuses = 1;
    assert_int_equal(link_ops_get(LINK_USB)->open(&spec, &link, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "no such module"));
}

/* Within the time between two attempts an injected fault unplugs the device and plugs it in. The device is plugged in
 * once: a second vhci_attach would fail the test. */
static void test_unplugged_meanwhile(void **state)
{
    (void)state;
    struct bench bench = open_attached(1);
    struct client c = host_of(&bench);
    const int attempts = vhci.attempts;
    close(c.fd);
    assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, 1);
    bench_expect_notice(&bench, "detached");
    assert_int_equal(bench.ops->fault(bench.link, LINK_FAULT_UNPLUG, 0, 0, 0.0), 0);
    assert_int_equal(bench.ops->fault(bench.link, LINK_FAULT_PLUG, 0, 0, 0.0), 0);
    bench_expect_notice(&bench, "plugged in again");
    assert_int_equal(vhci.attempts, attempts + 1);
    close(host_of(&bench).fd);
    bench_close(&bench);
}

/* Between attempts nothing spins: the head's owner may stop it, and the processor rests. */
static void test_pace(void **state)
{
    (void)state;
    struct bench bench = open_attached(3600000);
    const int attempts = vhci.attempts;
    struct client c = host_of(&bench);
    close(c.fd);
    assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, 1);
    bench_expect_notice(&bench, "detached");
    for (int i = 0; i < 3; i++)
        assert_int_equal(bench_poll(&bench, 3, 1), 0);
    assert_int_equal(vhci.attempts, attempts);
    bench_close(&bench);
}

static void hear(void *ctx, const char *text)
{
    char *heard = ctx;
    strcat(strcat(heard, text), "\n");
}

/* Whether the next attempt is due pace_ms after a moment between from_ns and now. */
static int is_due_after(const struct usb_retry *retry, int64_t from_ns, int pace_ms)
{
    const int64_t start_ns = retry->due_ns - (int64_t)pace_ms * 1000000;
    return start_ns >= from_ns && start_ns <= monotonic_ns();
}

/* Attempts have the pace that was asked for, or one second, until the device is plugged in. Only the first failure is
 * reported, after each start anew. */
static void test_retry(void **state)
{
    (void)state;
    static const struct {
        int ms, pace_ms;
    } cases[] = {{0, 1000}, {-1, 1000}, {1, 1}, {2999, 2999}, {60000, 60000}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct usb_retry retry;
        char heard[1000] = "";
        const struct usb_owner owner = {.say = hear, .ctx = heard};
        usb_retry_init(&retry, cases[i].ms);
        assert_int_equal(usb_retry_is_due(&retry), 0); /* it has not been started */
        for (int k = 0; k < 2; k++) {
            const int64_t from_ns = monotonic_ns();
            usb_retry_start(&retry, &owner);
            assert_true(is_due_after(&retry, from_ns, cases[i].pace_ms));
            usb_retry_failed(&retry, "no host", &owner);
            usb_retry_failed(&retry, "no host yet", &owner);
        }
        const int64_t late_ns = monotonic_ns();
        retry.due_ns = late_ns;
        assert_int_equal(usb_retry_is_due(&retry), 1);
        assert_true(is_due_after(&retry, late_ns, cases[i].pace_ms));
        usb_retry_done(&retry, &owner);
        assert_int_equal(retry.due_ns, INT64_MAX);
        assert_int_equal(usb_retry_is_due(&retry), 0);
        assert_string_equal(heard, "the host has detached the device; it will plug itself in again\n"
                                   "not plugged in, will try again: no host\n"
                                   "the host has detached the device; it will plug itself in again\n"
                                   "not plugged in, will try again: no host\n"
                                   "plugged in again\n");
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_usbip), cmocka_unit_test(test_usbip_refused), cmocka_unit_test(test_unplugged_meanwhile),
        cmocka_unit_test(test_pace),  cmocka_unit_test(test_retry),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
