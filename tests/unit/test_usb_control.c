/* SPDX-License-Identifier: MIT */
/* Control requests against chapter 9: each standard request in each state and at each speed, right and malformed. */
#include "tests/unit/usb_host.h"
#include "tests/unit/usb_models.h"

#include "drivers/usb/head_device.h"
#include "tests/common/thorough.h"

enum { EVERY = SANITIZED ? 7 : 1 };

enum { DEF = 1, ADR = 2, CFG = 4, ALL = 7 };      /* states in which a case succeeds */
enum { FS = 1, HS = 2, SS = 4, ANY = 7, NO = 0 }; /* and rates */

static const struct request_case {
    const char *what;
    unsigned type, request, value, index, length;
    unsigned states, rates;
    int n; /* bytes, or 0 for OUT */
} cases[] = {
    {"device status", 0x80, 0, 0, 0, 2, ADR | CFG, ANY, 2},
    {"device status, value", 0x80, 0, 1, 0, 2, NO, ANY, 0},
    {"device status, index", 0x80, 0, 0, 1, 2, NO, ANY, 0},
    {"device status, short", 0x80, 0, 0, 0, 1, NO, ANY, 0},
    {"device status, long", 0x80, 0, 0, 0, 3, NO, ANY, 0},
    {"device status as OUT", 0x00, 0, 0, 0, 0, NO, ANY, 0},
    {"interface status", 0x81, 0, 0, 1, 2, CFG, ANY, 2},
    {"interface status, none such", 0x81, 0, 0, 2, 2, NO, ANY, 0},
    {"interface status, high byte", 0x81, 0, 0, 0x100, 2, NO, ANY, 0},
    {"interface status, length", 0x81, 0, 0, 0, 1, NO, ANY, 0},
    {"endpoint 0 status", 0x82, 0, 0, 0, 2, ADR | CFG, ANY, 2},
    {"endpoint 0 IN status", 0x82, 0, 0, 0x80, 2, ADR | CFG, ANY, 2},
    {"endpoint status", 0x82, 0, 0, 0x82, 2, CFG, ANY, 2},
    {"endpoint status, other direction", 0x82, 0, 0, 0x02, 2, NO, ANY, 0},
    {"endpoint status, reserved bits", 0x82, 0, 0, 0xf2, 2, NO, ANY, 0},
    {"endpoint status, high byte", 0x82, 0, 0, 0x182, 2, NO, ANY, 0},
    {"status of other recipient", 0x83, 0, 0, 0, 2, NO, ANY, 0},
    {"remote wake-up", 0x00, 3, 1, 0, 0, NO, ANY, 0},
    {"clear remote wake-up", 0x00, 1, 1, 0, 0, NO, ANY, 0},
    {"test mode", 0x00, 3, 2, 0x0100, 0, NO, ANY, 0},
    {"unknown feature", 0x00, 3, 77, 0, 0, NO, ANY, 0},
    {"U1", 0x00, 3, 48, 0, 0, CFG, SS, 0},
    {"U2", 0x00, 3, 49, 0, 0, CFG, SS, 0},
    {"clear U1", 0x00, 1, 48, 0, 0, CFG, SS, 0},
    {"U1, index", 0x00, 3, 48, 1, 0, NO, ANY, 0},
    {"U1, length", 0x00, 3, 48, 0, 1, NO, ANY, 0},
    {"latency messages", 0x00, 3, 50, 0, 0, NO, ANY, 0},
    {"suspend function", 0x01, 3, 0, 0x0100, 0, CFG, SS, 0},
    {"resume function", 0x01, 3, 0, 0x0001, 0, CFG, SS, 0},
    {"wake from function", 0x01, 3, 0, 0x0200, 0, NO, ANY, 0},
    {"suspend no function", 0x01, 3, 0, 0x0102, 0, NO, ANY, 0},
    {"interface feature", 0x01, 3, 1, 0, 0, NO, ANY, 0},
    {"clear interface feature", 0x01, 1, 0, 0, 0, NO, ANY, 0},
    {"halt", 0x02, 3, 0, 0x82, 0, CFG, ANY, 0},
    {"clear halt", 0x02, 1, 0, 0x82, 0, CFG, ANY, 0},
    {"halt endpoint 0", 0x02, 3, 0, 0, 0, NO, ANY, 0},
    {"halt none such", 0x02, 3, 0, 0x85, 0, NO, ANY, 0},
    {"halt, feature", 0x02, 3, 1, 0x82, 0, NO, ANY, 0},
    {"halt, length", 0x02, 3, 0, 0x82, 1, NO, ANY, 0},
    {"clear halt, none such", 0x02, 1, 0, 0x02, 0, NO, ANY, 0},
    {"address", 0x00, 5, 127, 0, 0, DEF | ADR, ANY, 0},
    {"address beyond", 0x00, 5, 128, 0, 0, NO, ANY, 0},
    {"address, index", 0x00, 5, 1, 1, 0, NO, ANY, 0},
    {"address, length", 0x00, 5, 1, 0, 1, NO, ANY, 0},
    {"address of interface", 0x01, 5, 1, 0, 0, NO, ANY, 0},
    {"device descriptor", 0x80, 6, 0x0100, 0, 64, ALL, ANY, 18},
    {"device descriptor, nothing of it", 0x80, 6, 0x0100, 0, 0, ALL, ANY, 0},
    {"device descriptor, index", 0x80, 6, 0x0101, 0, 18, NO, ANY, 0},
    {"device descriptor, language", 0x80, 6, 0x0100, 1, 18, NO, ANY, 0},
    {"second configuration", 0x80, 6, 0x0201, 0, 9, NO, ANY, 0},
    {"qualifier", 0x80, 6, 0x0600, 0, 10, ALL, FS | HS, 10},
    {"other speed", 0x80, 6, 0x0700, 0, 9, ALL, FS | HS, 9},
    {"BOS", 0x80, 6, 0x0f00, 0, 5, ALL, ANY, 5},
    {"interface descriptor by itself", 0x80, 6, 0x0400, 0, 9, NO, ANY, 0},
    {"endpoint descriptor by itself", 0x80, 6, 0x0500, 0, 7, NO, ANY, 0},
    {"unknown descriptor", 0x80, 6, 0x2100, 0, 9, NO, ANY, 0},
    {"descriptor of interface", 0x81, 6, 0x0100, 0, 18, NO, ANY, 0},
    {"descriptor as OUT", 0x00, 6, 0x0100, 0, 18, NO, ANY, 0},
    {"set descriptor", 0x00, 7, 0x0100, 0, 18, NO, ANY, 0},
    {"get configuration", 0x80, 8, 0, 0, 1, ADR | CFG, ANY, 1},
    {"get configuration, value", 0x80, 8, 1, 0, 1, NO, ANY, 0},
    {"get configuration, index", 0x80, 8, 0, 1, 1, NO, ANY, 0},
    {"get configuration, length", 0x80, 8, 0, 0, 2, NO, ANY, 0},
    {"set configuration 1", 0x00, 9, 1, 0, 0, ADR | CFG, ANY, 0},
    {"set configuration 0", 0x00, 9, 0, 0, 0, ADR | CFG, ANY, 0},
    {"set configuration 2", 0x00, 9, 2, 0, 0, NO, ANY, 0},
    {"set configuration, high byte", 0x00, 9, 0x0101, 0, 0, NO, ANY, 0},
    {"set configuration, index", 0x00, 9, 1, 1, 0, NO, ANY, 0},
    {"set configuration, length", 0x00, 9, 1, 0, 1, NO, ANY, 0},
    {"get interface", 0x81, 10, 0, 1, 1, CFG, ANY, 1},
    {"get interface, none such", 0x81, 10, 0, 2, 1, NO, ANY, 0},
    {"get interface, value", 0x81, 10, 1, 0, 1, NO, ANY, 0},
    {"get interface, length", 0x81, 10, 0, 0, 2, NO, ANY, 0},
    {"set interface", 0x01, 11, 0, 0, 0, CFG, ANY, 0},
    {"set interface, no such alt", 0x01, 11, 1, 0, 0, NO, ANY, 0},
    {"set interface, none such", 0x01, 11, 0, 2, 0, NO, ANY, 0},
    {"set interface, length", 0x01, 11, 0, 0, 1, NO, ANY, 0},
    {"synch frame", 0x82, 12, 0, 0x82, 2, NO, ANY, 0},
    {"exit latencies", 0x00, 0x30, 0, 0, 6, ADR | CFG, SS, 0},
    {"exit latencies, length", 0x00, 0x30, 0, 0, 5, NO, ANY, 0},
    {"exit latencies, value", 0x00, 0x30, 1, 0, 6, NO, ANY, 0},
    {"isochronous delay", 0x00, 0x31, 40, 0, 0, ALL, SS, 0},
    {"isochronous delay, index", 0x00, 0x31, 40, 1, 0, NO, ANY, 0},
    {"reserved type", 0xe0, 0, 0, 0, 2, NO, ANY, 0},
    {"vendor of device", 0xc0, 0x55, 1, 2, 8, ALL, ANY, 4},
    {"vendor of device, short", 0xc0, 0x55, 1, 2, 3, ALL, ANY, 3},
    {"vendor out", 0x40, 0x66, 1, 2, 8, ALL, ANY, 0},
    {"vendor unknown", 0xc0, 0x77, 0, 0, 8, NO, ANY, 0},
    {"class of interface", 0xa1, 0x55, 0, 1, 8, CFG, ANY, 4},
    {"class of interface that is none", 0xa1, 0x55, 0, 2, 8, NO, ANY, 0},
    {"class of endpoint", 0xa2, 0x55, 0, 0x82, 8, CFG, ANY, 4},
    {"class of endpoint that is none", 0xa2, 0x55, 0, 0x81, 8, NO, ANY, 0},
};

static struct host *host_in_state(const struct usb_model *model, int at, int rate)
{
    struct host *host = host_new(model, USB_RATE_SUPER, (enum usb_rate)rate);
    if (at >= 1) assert_int_equal(host_control(host, 0, USB_REQ_SET_ADDRESS, 5, 0, 0, NULL), 0);
    if (at >= 2) assert_int_equal(host_control(host, 0, USB_REQ_SET_CONFIGURATION, 1, 0, 0, NULL), 0);
    return host;
}

static void test_requests(void **state)
{
    (void)state;
    static const uint8_t out[64];
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        for (int at = 0; at < 3; at++)
            for (int rate = 0; rate < 3; rate++) {
                const struct request_case *c = &cases[i];
                struct host *host = host_in_state(&two_model, at, rate);
                const int want = (c->states >> at & 1u) != 0 && (c->rates >> rate & 1u) != 0 ? c->n : USB_STALL;
                int got =
                    host_control(host, c->type, c->request, c->value, c->index, c->length, c->type & 0x80 ? NULL : out);
                if (got != want) fail_msg("%s, state %d, rate %d: %d instead of %d", c->what, at, rate, got, want);
                host_free(host);
            }
}

/* The effects of the requests are checked, not only whether they are accepted. */
static void test_effects(void **state)
{
    (void)state;
    struct host *host = host_new(&two_model, USB_RATE_SUPER, USB_RATE_SUPER);
    host_configure(host);
    assert_true(host->active[0] && host->active[1]);
    assert_int_equal(host_control(host, 0x80, 8, 0, 0, 1, NULL), 1);
    assert_int_equal(host_in[0], 1);
    assert_int_equal(host_control(host, 0x80, 0, 0, 0, 2, NULL), 2);
    assert_int_equal(le_get16(host_in), 1); /* self-powered */
    host_control(host, 0x00, 3, 48, 0, 0, NULL);
    host_control(host, 0x00, 3, 49, 0, 0, NULL);
    host_control(host, 0x00, 1, 48, 0, 0, NULL);
    host_control(host, 0x80, 0, 0, 0, 2, NULL);
    assert_int_equal(le_get16(host_in), 1 | 8); /* U2 is left */
    host_control(host, 0x02, 3, 0, 0x82, 0, NULL);
    assert_int_equal(host_control(host, 0x82, 0, 0, 0x82, 2, NULL), 2);
    assert_int_equal(le_get16(host_in), 1);
    /* A set interface resets its endpoints, and so does a new configuration. */
    for (unsigned configures = 0; configures < 2; configures++) {
        host_control(host, 0x02, 3, 0, 0x82, 0, NULL);
        assert_int_equal(host_control(host, configures ? 0 : 1, configures ? 9 : 11, configures, !configures, 0, NULL),
                         0);
        assert_int_equal(host_control(host, 0x81, 10, 0, 1, 1, NULL), 1);
        assert_int_equal(host_in[0], 0);
        host_control(host, 0x82, 0, 0, 0x82, 2, NULL);
        assert_int_equal(le_get16(host_in), 0);
    }
    host_control(host, 0x00, 3, 48, 0, 0, NULL);
    host_control(host, 0x00, 3, 49, 0, 0, NULL);
    host_control(host, 0x80, 0, 0, 0, 2, NULL);
    assert_int_equal(le_get16(host_in), 1 | 4 | 8);
    usb_device_reset(host->device);
    assert_true(!host->active[0] && !host->active[1]);
    assert_int_equal(host_control(host, 0x80, 8, 0, 0, 1, NULL), USB_STALL); /* default state */
    host_control(host, 0x00, USB_REQ_SET_ADDRESS, 5, 0, 0, NULL);
    host_control(host, 0x80, 0, 0, 0, 2, NULL);
    assert_int_equal(le_get16(host_in), 1); /* U1 and U2 went with the reset */
    host_configure(host);
    host_control(host, 0x00, 9, 0, 0, 0, NULL);
    assert_true(!host->active[0]);
    host_control(host, 0x80, 8, 0, 0, 1, NULL);
    assert_int_equal(host_in[0], 0);
    host_control(host, 0x00, 5, 0, 0, 0, NULL); /* address 0: back to default */
    assert_int_equal(host_control(host, 0x00, 9, 1, 0, 0, NULL), USB_STALL);
    usb_device_detach(host->device);
    assert_int_equal(host_control(host, 0x80, 6, 0x0100, 0, 18, NULL), USB_STALL);
    host_free(host);
}

/* All types and requests are tried with few and odd parameters. Nothing is overrun (host_control checks), and nothing
 * is answered that is not in the table of chapter 9. */
static void test_all(void **state)
{
    (void)state;
    static const unsigned words[] = {0, 1, 2, 7, 0x80, 0x81, 0x82, 0x0100, 0x0200, 0x0303, 0x0f00, 0x8000, 0xffff};
    static const unsigned lengths[] = {0, 1, 2, 6, 7, 18, 255, 0xffff};
    static const uint8_t known[] = {0, 1, 3, 5, 6, 8, 9, 10, 11, 0x30, 0x31};
    static uint8_t zeros[65536];
    struct host *host = host_in_state(&scanhead_usb_model, 2, USB_RATE_SUPER);
    unsigned answered = 0;
    for (unsigned type = 0; type < 256; type++)
        for (unsigned request = 0; request < 256; request++)
            for (unsigned k = (type + request) % EVERY; k < 13 * 13; k += EVERY) {
                const unsigned length = lengths[(k + request) % 8];
                if (length > 255 && k % 8 != 0) continue;
                int n =
                    host_control(host, type, request, words[k % 13], words[k / 13], length, type & 0x80 ? NULL : zeros);
                if (n == USB_STALL) continue;
                answered++;
                if ((type & USB_TYPE_MASK) == 0 && memchr(known, (int)request, sizeof known) == NULL)
                    fail_msg("request %02x %02x is answered", type, request);
                if ((type & USB_TYPE_MASK) == USB_TYPE_MASK || (type & 0x1f) > 3) fail_msg("type %02x", type);
                if (usb_facts(host->device)->configuration == 0) {
                    usb_device_reset(host->device);
                    host_configure(host);
                }
            }
    assert_in_range(answered, 100, 100000);
    host_free(host);
}

/* The data stage of an OUT request is not as long as its setup says. */
static void test_data_stage(void **state)
{
    (void)state;
    struct host *host = host_in_state(&two_model, 2, USB_RATE_HIGH);
    struct usb_ctrlrequest setup = {.bRequestType = 0x40, .bRequest = 0x66};
    uint8_t data[8] = {0};
    le_put16(&setup.wLength, 8);
    assert_int_equal(usb_device_control(host->device, &setup, data, 7), USB_STALL);
    assert_int_equal(usb_device_control(host->device, &setup, data, 0), USB_STALL);
    assert_int_equal(host->n_requests, 0);
    assert_int_equal(usb_device_control(host->device, &setup, data, 8), 0);
    assert_int_equal(host->n_requests, 1);
    host_free(host);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_requests),
        cmocka_unit_test(test_effects),
        cmocka_unit_test(test_all),
        cmocka_unit_test(test_data_stage),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
