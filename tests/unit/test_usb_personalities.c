/* SPDX-License-Identifier: MIT */
/* The identities of a head on USB: their descriptors, byte by byte, and the begin and end of their sessions.
 *
 * The bytes are written out by hand from the layouts of USB 2.0 (tables 9-8, 9-10, 9-12, 9-13) and CDC 1.20 (tables 15
 * to 18 and PSTN 1.20, tables 3 and 4). The figures are those of real devices: a TiM571 by its `lsusb -v` in
 * uos/sick_tim issue 29, an URG's device descriptor by UrgNetwork/urg_library issue 29. */
#include <endian.h>

#include "tests/unit/usb_host.h"

#include "drivers/usb/head_device.h"

enum { LANG = 0x0409 };

struct shape {
    enum usb_personality_id personality;
    const char *serial; /* "": none */
    const uint8_t *device, *full, *high;
    size_t config_len;
};

/* ---- native: unchanged since before there were others */

static const uint8_t native_device[18] = {18, 1, 0x10, 0x02, 0xef, 2, 1, 64, 0x09, 0x12, 0x01, 0, 0, 1, 1, 2, 5, 1};

#define PORT_BYTES(control_string, notify_interval, bulk_low, bulk_high)                                  \
    9, 4, 0, 0, 1, 2, 2, 0, (control_string),      /* interface 0: communications, ACM, no AT commands */ \
        5, 0x24, 0, 0x20, 0x01,                    /* header: CDC 1.20 */                                 \
        5, 0x24, 1, 0, 1,                          /* call management: none, data on interface 1 */       \
        4, 0x24, 2, 0x06,                          /* ACM: line coding, serial state, break */            \
        5, 0x24, 6, 0, 1,                          /* union: 0 controls 1 */                              \
        7, 5, 0x82, 3, 16, 0, (notify_interval),   /* interrupt IN */                                     \
        9, 4, 1, 0, 2, 10, 0, 0, 0,                /* interface 1: data */                                \
        7, 5, 0x81, 2, (bulk_low), (bulk_high), 0, /* bulk IN */                                          \
        7, 5, 0x01, 2, (bulk_low), (bulk_high), 0  /* bulk OUT */

#define NATIVE_BYTES(notify_interval, bulk_low, bulk_high)                                              \
    9, 2, 98, 0, 3, 1, 0, 0xc0, 0,                           /* 98 bytes, 3 interfaces, self-powered */ \
        8, 11, 0, 2, 2, 2, 0, 3,                             /* interfaces 0 and 1 belong together */   \
        PORT_BYTES(3, notify_interval, bulk_low, bulk_high), /* the console */                          \
        9, 4, 2, 0, 2, 0xff, 0x53, 0x48, 4,                  /* interface 2: the stream */              \
        7, 5, 0x83, 2, (bulk_low), (bulk_high), 0, 7, 5, 0x03, 2, (bulk_low), (bulk_high), 0

static const uint8_t native_full[] = {NATIVE_BYTES(16, 64, 0)}, native_high[] = {NATIVE_BYTES(8, 0, 2)};

/* ---- hokuyo: class 2, ids 15d1:0000, release 1.00, strings 1 and 2, no serial number, USB 2.00 */

static const uint8_t hokuyo_device[18] = {18, 1, 0, 2, 2, 0, 0, 64, 0xd1, 0x15, 0, 0, 0, 1, 1, 2, 0, 1};

#define HOKUYO_BYTES(notify_interval, bulk_low, bulk_high) \
    9, 2, 67, 0, 2, 1, 0, 0xc0, 0, /* 67 bytes, 2 interfaces */ PORT_BYTES(0, notify_interval, bulk_low, bulk_high)

static const uint8_t hokuyo_full[] = {HOKUYO_BYTES(16, 64, 0)}, hokuyo_high[] = {HOKUYO_BYTES(8, 0, 2)};

/* ---- sick: as in the TiM571's listing, whose 32 bytes are a configuration, an interface and two endpoints */

static const uint8_t sick_device[18] = {18, 1, 0, 2, 0, 0, 0, 64, 0xa2, 0x19, 0x01, 0x50, 0x09, 0x01, 0, 2, 3, 1};

#define SICK_BYTES(bulk_low, bulk_high)                                                                         \
    9, 2, 32, 0, 1, 1, 1, 0xc0, 1, /* 32 bytes, configuration 1, "Default Configuration", self-powered, 2 mA */ \
        9, 4, 0, 0, 2, 0xff, 0, 0, 0, 7, 5, 0x81, 2, (bulk_low), (bulk_high), 0, 7, 5, 0x02, 2, (bulk_low),     \
        (bulk_high), 0

static const uint8_t sick_full[] = {SICK_BYTES(64, 0)}, sick_high[] = {SICK_BYTES(0, 2)};

static const struct shape shapes[] = {
    {USB_PERSONALITY_NATIVE, "S", native_device, native_full, native_high, sizeof native_full},
    {USB_PERSONALITY_HOKUYO, "", hokuyo_device, hokuyo_full, hokuyo_high, sizeof hokuyo_full},
    {USB_PERSONALITY_SICK, "15340291", sick_device, sick_full, sick_high, sizeof sick_full},
};

struct rig {
    struct scanhead_usb head;
    uint8_t in[1024];
};

static void rig_complete(void *ctx, struct usb_transfer *transfer)
{
    int *n_done = ctx;
    (void)transfer;
    ++*n_done;
}

static int n_done;

static void rig_open(struct rig *rig, enum usb_personality_id id, const char *serial, enum usb_rate rate)
{
    const struct usb_personality *personality = usb_personality_get(id);
    struct usb_identity identity = {.vid = personality->vid, .pid = personality->pid, .highest = USB_RATE_HIGH};
    struct sh_err err = {0, ""};
    memset(rig, 0, sizeof *rig);
    n_done = 0;
    snprintf(identity.serial, sizeof identity.serial, "%s", serial);
    if (scanhead_usb_create(personality, &identity, &rig->head, &err) != SH_OK) fail_msg("%s", err.text);
    usb_device_attach(rig->head.device, rate, rig_complete, &n_done);
}

static int control(struct rig *rig, unsigned type, unsigned request, unsigned value, unsigned index, unsigned length)
{
    struct usb_ctrlrequest setup = {.bRequestType = (uint8_t)type, .bRequest = (uint8_t)request};
    le_put16(&setup.wValue, (uint16_t)value);
    le_put16(&setup.wIndex, (uint16_t)index);
    le_put16(&setup.wLength, (uint16_t)length);
    return usb_device_control(rig->head.device, &setup, rig->in, length);
}

static void configure(struct rig *rig)
{
    assert_int_equal(control(rig, 0, USB_REQ_SET_ADDRESS, 5, 0, 0), 0);
    assert_int_equal(control(rig, 0, USB_REQ_SET_CONFIGURATION, 1, 0, 0), 0);
}

static void expect_bytes(struct rig *rig, unsigned value, const uint8_t *bytes, size_t n)
{
    assert_int_equal(control(rig, 0x80, USB_REQ_GET_DESCRIPTOR, value, 0, sizeof rig->in), (int)n);
    for (size_t i = 0; i < n; i++)
        if (rig->in[i] != bytes[i])
            fail_msg("descriptor %04x: byte %zu is %02x, not %02x", value, i, rig->in[i], bytes[i]);
}

static void test_descriptors(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof shapes / sizeof shapes[0]; i++)
        for (int high = 0; high < 2; high++) {
            const struct shape *s = &shapes[i];
            struct rig rig;
            rig_open(&rig, s->personality, s->serial, high ? USB_RATE_HIGH : USB_RATE_FULL);
            expect_bytes(&rig, 0x0100, s->device, 18);
            expect_bytes(&rig, 0x0200, high ? s->high : s->full, s->config_len);
            /* Only the native identity has content for a BOS (Binary device Object Store), so only it has one. */
            const int bos = control(&rig, 0x80, USB_REQ_GET_DESCRIPTOR, 0x0f00, 0, 255);
            assert_true((bos == USB_STALL) == (s->personality != USB_PERSONALITY_NATIVE));
            usb_device_free(rig.head.device);
        }
}

static void expect_text(struct rig *rig, unsigned index, const char *text)
{
    const int n = control(rig, 0x80, USB_REQ_GET_DESCRIPTOR, 0x0300 | index, LANG, 255);
    if (text == NULL) {
        assert_int_equal(n, USB_STALL);
        return;
    }
    assert_int_equal(n, 2 + 2 * (int)strlen(text));
    for (int k = 0; text[k] != '\0'; k++)
        assert_int_equal(le_get16(rig->in + 2 + 2 * k), text[k]);
}

static void test_strings(void **state)
{
    (void)state;
    static const struct {
        enum usb_personality_id personality;
        const char *serial, *string[4];
    } cases[] = {
        {USB_PERSONALITY_HOKUYO, "", {"Hokuyo Data Flex for USB", "URG-Series USB Driver", NULL, NULL}},
        {USB_PERSONALITY_HOKUYO, "H0807111", {"Hokuyo Data Flex for USB", "URG-Series USB Driver", "H0807111", NULL}},
        {USB_PERSONALITY_SICK, "15340291", {"Default Configuration", "TIM3xx", "15340291", NULL}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct rig rig;
        rig_open(&rig, cases[i].personality, cases[i].serial, USB_RATE_HIGH);
        for (unsigned k = 0; k < 4; k++)
            expect_text(&rig, k + 1, cases[i].string[k]);
        control(&rig, 0x80, USB_REQ_GET_DESCRIPTOR, 0x0100, 0, 18);
        assert_int_equal(rig.in[16], cases[i].string[2] != NULL ? 3 : 0);
        usb_device_free(rig.head.device);
    }
}

/* The status of a configured device says that it is self-powered: USB 2.0, figure 9-4, bit 0. */
static void test_status(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof shapes / sizeof shapes[0]; i++) {
        struct rig rig;
        rig_open(&rig, shapes[i].personality, "", USB_RATE_HIGH);
        configure(&rig);
        assert_int_equal(control(&rig, 0x80, USB_REQ_GET_STATUS, 0, 0, 2), 2);
        assert_int_equal(rig.in[0], 1);
        usb_device_free(rig.head.device);
    }
}

/* Submits an OUT transfer of the host; the transfer stays the test's. */
static void send(struct rig *rig, struct usb_transfer *transfer, uint8_t endpoint, const char *text)
{
    static uint8_t bytes[256];
    memcpy(bytes, text, strlen(text));
    *transfer = (struct usb_transfer){.id = 1, .endpoint = endpoint, .length = (uint32_t)strlen(text), .data = bytes};
    usb_device_submit(rig->head.device, transfer);
    scanhead_usb_update(&rig->head);
}

/* The port of the URG is opened by DTR, or by data where a host does not use DTR, and closed by DTR. */
static void test_port(void **state)
{
    (void)state;
    struct rig rig;
    struct usb_transfer out;
    char text[8];
    rig_open(&rig, USB_PERSONALITY_HOKUYO, "", USB_RATE_FULL);
    configure(&rig);
    assert_int_equal(rig.head.personality->n_sessions, 1);
    assert_int_equal(control(&rig, 0x21, 0x22, 1, 0, 0), 0);
    assert_true(rig.head.session[0].open);
    const uint32_t in = usb_device_epoch(rig.head.device, CONSOLE_IN);
    const uint32_t heard = usb_device_epoch(rig.head.device, CONSOLE_OUT);
    assert_int_equal(control(&rig, 0x21, 0x22, 0, 0, 0), 0);
    assert_false(rig.head.session[0].open);
    assert_int_not_equal(usb_device_epoch(rig.head.device, CONSOLE_IN),
                         in); /* what is on its way is not the next one's */
    assert_int_not_equal(usb_device_epoch(rig.head.device, CONSOLE_OUT), heard);
    send(&rig, &out, CONSOLE_OUT, "VV\n");
    assert_true(rig.head.session[0].open);
    assert_int_equal(usb_device_read(rig.head.device, CONSOLE_OUT, text, sizeof text), 3);
    assert_memory_equal(text, "VV\n", 3);
    assert_int_equal(control(&rig, 0, USB_REQ_SET_CONFIGURATION, 0, 0, 0), 0);
    assert_false(rig.head.session[0].open);
    assert_non_null(scanhead_usb_cut(&rig.head));
    usb_device_free(rig.head.device);
}

/* A port tells its serial state (PSTN 1.20, table 30) when it comes to life, and to each client that opens it by DTR:
 * carrier and data set ready. */
static void test_serial_state(void **state)
{
    (void)state;
    static const uint8_t ready[10] = {0xa1, 0x20, 0, 0, CONSOLE_INTERFACE, 0, 2, 0, 3, 0};
    static const struct {
        unsigned value; /* bit 0: DTR */
        int want;
    } steps[] = {{1, 1}, {1, 0}, {3, 0}, {0, 0}, {2, 0}, {3, 1}};
    struct rig rig;
    uint8_t bytes[16];
    struct usb_transfer note = {.endpoint = CONSOLE_NOTIFY, .length = sizeof bytes, .data = bytes};
    rig_open(&rig, USB_PERSONALITY_NATIVE, "S", USB_RATE_HIGH);
    configure(&rig);
    scanhead_usb_update(&rig.head); /* nobody listens yet: it is kept */
    for (size_t i = 0; i <= sizeof steps / sizeof steps[0]; i++) {
        if (i > 0) assert_int_equal(control(&rig, 0x21, 0x22, steps[i - 1].value, CONSOLE_INTERFACE, 0), 0);
        n_done = 0;
        memset(bytes, 0xee, sizeof bytes);
        usb_device_submit(rig.head.device, &note);
        scanhead_usb_update(&rig.head);
        if (i > 0 && !steps[i - 1].want) {
            assert_int_equal(n_done, 0);
            assert_int_equal(usb_device_cancel(rig.head.device, note.id), 1);
            continue;
        }
        assert_int_equal(n_done, 1);
        assert_int_equal(note.actual, sizeof ready);
        assert_memory_equal(bytes, ready, sizeof ready);
    }
    /* Either interface ends the session when it is set anew. Only the control one also resets the port's state. */
    for (unsigned interface = CONSOLE_DATA_INTERFACE + 1; interface-- > 0;) {
        memcpy(rig.in, ((const uint8_t[]){1, 2, 3, 4, 0, 0, 8}), 7);
        assert_int_equal(control(&rig, 0x21, 0x20, 0, CONSOLE_INTERFACE, 7), 0);
        assert_int_equal(control(&rig, 0x01, USB_REQ_SET_INTERFACE, 0, interface, 0), 0);
        assert_false(rig.head.session[0].open);
        assert_int_equal(control(&rig, 0xa1, 0x21, 0, CONSOLE_INTERFACE, 7), 7);
        assert_int_equal(rig.in[0], interface == CONSOLE_INTERFACE ? 0x00 : 1); /* at rest, or as it was set */
        n_done = 0;
        usb_device_submit(rig.head.device, &note);
        scanhead_usb_update(&rig.head);
        assert_int_equal(n_done, interface == CONSOLE_INTERFACE);
        usb_device_cancel(rig.head.device, note.id);
    }
    usb_device_free(rig.head.device);
}

/* Any bit rate is set as drivers do, and read back. PSTN 1.20, table 17: 1, 1.5 or 2 stop bits are 0 to 2, parities 0
 * to 4; and there are 5 to 8 data bits, or 16. */
static void test_line_coding(void **state)
{
    (void)state;
    static const uint32_t rates[] = {1, 19200, 57600, 115200, 250000, 500000, 750000, 12345678, UINT32_MAX};
    struct rig rig;
    rig_open(&rig, USB_PERSONALITY_HOKUYO, "", USB_RATE_FULL);
    configure(&rig);
    for (size_t i = 0; i < sizeof rates / sizeof rates[0]; i++) {
        const uint8_t coding[7] = {
            (uint8_t)rates[i], (uint8_t)(rates[i] >> 8), (uint8_t)(rates[i] >> 16), (uint8_t)(rates[i] >> 24), 0, 0, 8};
        memcpy(rig.in, coding, 7);
        assert_int_equal(control(&rig, 0x21, 0x20, 0, 0, 7), 0);
        memset(rig.in, 0, 7);
        assert_int_equal(control(&rig, 0xa1, 0x21, 0, 0, 7), 7);
        assert_memory_equal(rig.in, coding, 7);
    }
    static const struct {
        uint8_t stop_bits, parity, bits;
        int want;
    } forms[] = {{2, 4, 8, 0},          {3, 4, 8, USB_STALL}, {2, 5, 8, USB_STALL}, {0, 0, 4, USB_STALL},
                 {1, 3, 5, 0},          {0, 1, 6, 0},         {0, 2, 7, 0},         {0, 0, 9, USB_STALL},
                 {0, 0, 15, USB_STALL}, {0, 0, 16, 0},        {0, 0, 17, USB_STALL}};
    uint8_t last[7] = {0};
    for (size_t i = 0; i < sizeof forms / sizeof forms[0]; i++) {
        const uint8_t coding[7] = {1, 2, 3, 4, forms[i].stop_bits, forms[i].parity, forms[i].bits};
        memcpy(rig.in, coding, 7);
        assert_int_equal(control(&rig, 0x21, 0x20, 0, 0, 7), forms[i].want);
        if (forms[i].want == 0) memcpy(last, coding, 7);
        assert_int_equal(control(&rig, 0xa1, 0x21, 0, 0, 7), 7);
        assert_memory_equal(rig.in, last, 7); /* a refused one changes nothing */
    }
    static const uint8_t at_rest[7] = {0x00, 0xc2, 0x01, 0x00, 0, 0, 8}; /* 115200: configured anew nobody has set it */
    assert_int_equal(control(&rig, 0x00, 9, 1, 0, 0), 0);
    assert_int_equal(control(&rig, 0xa1, 0x21, 0, 0, 7), 7);
    assert_memory_equal(rig.in, at_rest, 7);
    memset(rig.in, 0xff, 7);
    assert_int_equal(control(&rig, 0xa1, 0x21, 0, 0, 2), 2); /* a host may read a part, or ask for more */
    assert_memory_equal(rig.in, ((const uint8_t[]){0x00, 0xc2, 0xff, 0xff, 0xff, 0xff, 0xff}), 7);
    assert_int_equal(control(&rig, 0xa1, 0x21, 0, 0, 64), 7);
    usb_device_free(rig.head.device);
}

/* The reason why a session was cut off is told once, and only where one was open. */
static void test_cut(void **state)
{
    (void)state;
    static const char *const why[] = {
        "the host configured the device again: sessions ended, the device stays plugged in",
        "the host reset the bus: sessions ended, the device stays plugged in", "unplugged: sessions ended"};
    struct rig rig;
    rig_open(&rig, USB_PERSONALITY_HOKUYO, "", USB_RATE_FULL);
    for (int way = 0; way < 3; way++)
        for (int open = 0; open < 2; open++) {
            configure(&rig);
            assert_int_equal(control(&rig, 0x21, 0x22, (unsigned)open, 0, 0), 0);
            if (way == 0) assert_int_equal(control(&rig, 0, USB_REQ_SET_CONFIGURATION, 0, 0, 0), 0);
            if (way <= 1) usb_device_reset(rig.head.device); /* after way 0 no session is left for it */
            if (way == 2) usb_device_attach(rig.head.device, USB_RATE_FULL, rig_complete, &n_done);
            const char *is = scanhead_usb_cut(&rig.head);
            if (open)
                assert_string_equal(is, why[way]);
            else
                assert_null(is);
            assert_null(scanhead_usb_cut(&rig.head));
        }
    usb_device_free(rig.head.device);
}

/* Requests of the native identity's console and stream, right and with one wrong field each. */
static void test_own_requests(void **state)
{
    (void)state;
    static const struct {
        unsigned type, request, value, index, length;
        int want;
    } cases[] = {
        {0x21, 0x22, 0xfffe, 0, 0, 0}, /* RTS alone, and reserved bits */
        {0x21, 0x22, 3, 0, 0, 0},           {0x21, 0x22, 0, 0, 1, USB_STALL}, {0x21, 0x22, 1, 0, 1, USB_STALL},
        {0x21, 0x22, 1, 1, 0, USB_STALL},   {0x21, 0x23, 100, 0, 0, 0}, /* break */
        {0x21, 0x23, 100, 0, 1, USB_STALL}, {0x21, 0x20, 1, 0, 7, USB_STALL}, {0x21, 0x20, 0, 0, 6, USB_STALL},
        {0x21, 0x20, 0, 0, 8, USB_STALL},   {0xa1, 0x21, 1, 0, 7, USB_STALL}, {0xa1, 0x20, 0, 0, 7, USB_STALL},
        {0x21, 0x24, 0, 0, 0, USB_STALL},   {0x41, 0x22, 0, 2, 0, 0},         {0x41, 0x22, 2, 2, 0, USB_STALL},
        {0x41, 0x22, 1, 2, 1, USB_STALL},   {0x41, 0x22, 1, 0, 0, USB_STALL}, {0x41, 0x23, 1, 2, 0, USB_STALL},
        {0x21, 0x22, 1, 2, 0, USB_STALL}, /* the stream has no DTR */
        {0xc1, 0x22, 1, 2, 1, USB_STALL},   {0xc1, 0x22, 0, 2, 0, USB_STALL}, {0xc1, 0x22, 0, 2, 2, USB_STALL},
    };
    static const uint8_t valid[7] = {0, 0, 0, 0, 0, 0, 8};
    const struct usb_ctrlrequest coding = {.bRequestType = 0x21, .bRequest = 0x20, .wLength = htole16(7)};
    struct rig rig;
    rig_open(&rig, USB_PERSONALITY_NATIVE, "S", USB_RATE_HIGH);
    configure(&rig);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        memcpy(rig.in, valid, sizeof valid);
        const int got = control(&rig, cases[i].type, cases[i].request, cases[i].value, cases[i].index, cases[i].length);
        if (got != cases[i].want) fail_msg("case %zu: %d, not %d", i, got, cases[i].want);
    }
    assert_int_equal(rig.head.personality->n_sessions, 2);
    assert_true(rig.head.session[0].open); /* value 3 opened it, and no wrong request has ended it */
    assert_false(rig.head.session[1].open);
    /* A right request whose data are still to come is answered as right, and nothing is done yet. */
    assert_int_equal(usb_device_control(rig.head.device, &coding, NULL, 7), 0);
    assert_int_equal(control(&rig, 0xa1, 0x21, 0, 0, 7), 7);
    assert_int_equal(le_get32(rig.in), 115200);
    for (int begun = 0; begun < 3; begun++) { /* a stream stays begun when it is begun again */
        memset(rig.in, 0xee, 2);
        assert_int_equal(control(&rig, 0xc1, 0x22, 0, 2, 1), 1);
        assert_int_equal(rig.in[0], begun > 0);
        assert_int_equal(rig.in[1], 0xee);
        assert_int_equal(control(&rig, 0x41, 0x22, 1, 2, 0), 0);
    }
    /* A transfer that tells of a reset is due. If a new reader begins first, its transfer does not. */
    uint8_t bytes[8];
    struct usb_transfer in = {.endpoint = STREAM_IN, .length = sizeof bytes, .data = bytes};
    usb_device_set_gone_due(rig.head.device, STREAM_IN, 1);
    assert_int_equal(control(&rig, 0x41, 0x22, 1, 2, 0), 0);
    n_done = 0;
    usb_device_submit(rig.head.device, &in);
    assert_int_equal(n_done, 0);
    usb_device_free(rig.head.device);
}

/* Requests of other identities are refused: a TiM has no requests of a stream or a port. */
static void test_foreign_requests(void **state)
{
    (void)state;
    struct rig rig;
    rig_open(&rig, USB_PERSONALITY_SICK, "", USB_RATE_HIGH);
    configure(&rig);
    assert_int_equal(control(&rig, 0x41, SCANHEAD_USB_STREAM, 1, 0, 0), USB_STALL);
    assert_int_equal(control(&rig, 0x21, 0x22, 1, 0, 0), USB_STALL);
    assert_int_equal(control(&rig, 0xc0, 0x20, 0, 7, 255), USB_STALL); /* Microsoft OS descriptors */
    assert_false(rig.head.session[0].open);
    usb_device_free(rig.head.device);
    rig_open(&rig, USB_PERSONALITY_HOKUYO, "", USB_RATE_HIGH);
    configure(&rig);
    assert_int_equal(control(&rig, 0x41, SCANHEAD_USB_STREAM, 1, 0, 0), USB_STALL);
    assert_int_equal(control(&rig, 0xc0, 0x20, 0, 7, 255), USB_STALL);
    usb_device_free(rig.head.device);
}

/* Each interface is in one function, which has the interface's class, in the order of the numbers. */
static void test_functions(void **state)
{
    (void)state;
    for (int id = 0; id < USB_N_PERSONALITIES; id++) {
        const struct usb_personality *personality = usb_personality_get((enum usb_personality_id)id);
        const struct usb_model *model = personality->model;
        unsigned next = 0;
        for (unsigned i = 0; i < model->n_functions; i++) {
            const struct usb_function_row *f = &model->function[i];
            assert_int_equal(f->first, next);
            assert_true(f->count >= 1 && next + f->count <= model->n_interfaces);
            assert_int_equal(f->class, model->interface[next].class);
            assert_int_equal(f->subclass, model->interface[next].subclass);
            assert_int_equal(f->protocol, model->interface[next].protocol);
            next += f->count;
        }
        assert_int_equal(next, model->n_interfaces);
        for (unsigned i = 0; i < model->n_interfaces; i++)
            assert_int_equal(model->interface[i].number, i);
    }
    assert_null(usb_personality_get(USB_N_PERSONALITIES));
}

/* A session with an interrupt endpoint is that of a port: the first of its interfaces has it, and no other endpoint. */
static void test_notifications(void **state)
{
    (void)state;
    for (int id = 0; id < USB_N_PERSONALITIES; id++) {
        const struct usb_personality *p = usb_personality_get((enum usb_personality_id)id);
        for (int s = 0; s < p->n_sessions; s++) {
            const struct usb_interface_row *of = &p->model->interface[p->session[s].interface];
            if (of->class == USB_CLASS_COMM) {
                assert_true(of->n_endpoints == 1 && of->endpoint[0].type == USB_ENDPOINT_XFER_INT);
                assert_int_equal(p->session[s].notify, of->endpoint[0].address);
            } else
                assert_int_equal(p->session[s].notify, 0);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_descriptors),      cmocka_unit_test(test_strings),
        cmocka_unit_test(test_status),           cmocka_unit_test(test_port),
        cmocka_unit_test(test_line_coding),      cmocka_unit_test(test_serial_state),
        cmocka_unit_test(test_foreign_requests), cmocka_unit_test(test_cut),
        cmocka_unit_test(test_functions),        cmocka_unit_test(test_notifications),
        cmocka_unit_test(test_own_requests),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
