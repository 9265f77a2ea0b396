/* SPDX-License-Identifier: MIT */
/* Plugging into vhci_hcd, with files in place of the kernel's. The lines of `status` are those that Linux 6.1
 * prints. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "drivers/usb/sysfile.h"
#include "drivers/usb/vhci.h"

static const char STATUS[] = "hub port sta spd dev      sockfd local_busid\n"
                             "hs  0000 006 003 00010002 000003 1-1\n"
                             "hs  0001 004 000 00000000 000000 0-0\n"
                             "hs  0002 004 000 00000000 000000 0-0\n"
                             "ss  0008 006 005 00010002 000005 1-1\n"
                             "ss  0009 004 000 00000000 000000 0-0\n";
static const char FULL[] = "hub port sta spd dev      sockfd local_busid\n"
                           "hs  0000 006 003 00010002 000003 1-1\n"
                           "ss  0008 005 000 00000000 000000 0-0\n";

static char dir[64], path[128];

static const char *file(const char *name)
{
    snprintf(path, sizeof path, "%s/%s", dir, name);
    return path;
}

static void put(const char *name, const char *text)
{
    FILE *f = fopen(file(name), "w");
    assert_non_null(f);
    fputs(text, f);
    fclose(f);
}

static int setup(void **state)
{
    (void)state;
    strcpy(dir, "/tmp/test_vhci.XXXXXX");
    return mkdtemp(dir) == NULL;
}

static int teardown(void **state)
{
    (void)state;
    unlink(file("status"));
    unlink(file("attach"));
    return rmdir(dir);
}

static void test_attach(void **state)
{
    (void)state;
    static const struct {
        enum usb_rate rate;
        unsigned port;
        const char *text; /* port, descriptor, device, speed: USB_SPEED_FULL 2, HIGH 3, SUPER 5 */
    } cases[] = {
        {USB_RATE_FULL, 1, "1 7 65538 2"}, {USB_RATE_HIGH, 1, "1 7 65538 3"}, {USB_RATE_SUPER, 9, "9 7 65538 5"}};
    for (int i = 0; i < 3; i++) {
        char text[64] = "";
        unsigned port = 99;
        struct sh_err err = {0, ""};
        put("status", STATUS);
        put("attach", "");
        assert_int_equal(vhci_attach(dir, 7, 0x10002, cases[i].rate, &port, &err), SH_OK);
        assert_int_equal(port, cases[i].port);
        FILE *f = fopen(file("attach"), "r");
        assert_non_null(fgets(text, sizeof text, f));
        fclose(f);
        assert_string_equal(text, cases[i].text);
    }
}

static void test_refusals(void **state)
{
    (void)state;
    unsigned port;
    struct sh_err err = {0, ""};
    put("status", FULL);
    put("attach", "");
    assert_int_equal(vhci_attach(dir, 7, 0x10002, USB_RATE_HIGH, &port, &err), SH_EIO);
    assert_string_equal(err.text, "usbip: no free port on vhci_hcd.0; detach one (usbip detach -p N)");
    assert_int_equal(vhci_attach(dir, 7, 0x10002, USB_RATE_SUPER, &port, &err), SH_EIO);
    put("status", STATUS);
    unlink(file("attach"));
    assert_int_equal(vhci_attach(dir, 7, 0x10002, USB_RATE_HIGH, &port, &err), SH_EINPUT);
    unlink(file("status"));
    assert_int_equal(vhci_attach(dir, 7, 0x10002, USB_RATE_HIGH, &port, &err), SH_EINPUT);
    char want[200];
    snprintf(want, sizeof want, "usbip: %s/status is not there: load the module, modprobe vhci-hcd (as root)", dir);
    assert_string_equal(err.text, want);
}

/* A value for such a file is written whole or not at all: half of a name would be another one. */
static void test_long_values(void **state)
{
    (void)state;
    char text[256], back[256];
    memset(text, 'x', sizeof text);
    for (size_t len = 127; len < 130; len++) {
        put("status", "");
        text[len] = '\0';
        errno = 0;
        assert_int_equal(sysfile_write(dir, "status", "%s", text), len == 127 ? 0 : -1);
        if (len > 127) assert_int_equal(errno, ENAMETOOLONG);
        assert_int_equal(sysfile_read(dir, "status", back, sizeof back), 0);
        assert_int_equal(strlen(back), len == 127 ? 127 : 0);
        text[len] = 'x';
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_attach, setup, teardown),
        cmocka_unit_test_setup_teardown(test_refusals, setup, teardown),
        cmocka_unit_test_setup_teardown(test_long_values, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
