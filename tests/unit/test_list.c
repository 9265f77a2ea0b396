/* SPDX-License-Identifier: MIT */
/* `scanhead list` on a scripted bus: what it says of the heads that USB shows, and that the rest of the list needs no
 * USB. */
#include "tests/unit/fake_libusb.h"

#include "firmware_sim/app/app.h"
#include "tests/unit/output_rig.h"

/* Returns what the command prints; free it. */
static char *print_list_with(int want)
{
    char name[] = "list", *argv[] = {name, NULL};
    struct output output;
    output_take(&output, stdout);
    const int status = app_list.run(1, argv);
    char *text = output_give(&output);
    assert_int_equal(status, want);
    fake_expect_nothing_left();
    return text;
}

static char *print_list(void)
{
    return print_list_with(APP_OK);
}

/* The last lines, from the heads on USB on, are these. */
static void expect_end(const char *want)
{
    char *text = print_list();
    const char *end = strstr(text, "heads on USB");
    assert_non_null(end);
    assert_string_equal(end, want);
    free(text);
}

static void heads_are_listed_in_their_order(void **state)
{
    (void)state;
    fake_reset();
    bus.device[0] = (struct libusb_device){.present = 1, .maker = "Maker", .product = "Head", .serial = "SH-1"};
    bus.device[1] = (struct libusb_device){.present = 1, .other_class = 1, .maker = "Mouse"};
    bus.device[2] = (struct libusb_device){.present = 1, .maker = "Other", .product = "One"};
    bus.device[3] = (struct libusb_device){.present = 1, .open_rc = LIBUSB_ERROR_IO};
    expect_end("heads on USB:\n"
               "usb:1209:0001:SH-1               bus 1 device 2, 480 Mbit/s, Maker Head\n"
               "usb:1209:0003                    bus 1 device 4, 480 Mbit/s, Other One\n"
               "usb:1209:0004                    bus 1 device 5, 480 Mbit/s; some error\n");
}

static void a_bus_may_have_no_head(void **state)
{
    (void)state;
    fake_reset();
    expect_end("heads on USB: none\n");
}

static void without_usb_the_reason_is_there(void **state)
{
    (void)state;
    fake_reset();
    bus.init_rc = LIBUSB_ERROR_ACCESS;
    expect_end("heads on USB: cannot list USB devices: Access denied (insufficient permissions)\n");
}

/* All protocols are there, with a comma between two, and a scenario. */
static void the_rest_of_the_list(void **state)
{
    (void)state;
    fake_reset();
    char *text = print_list();
    assert_non_null(strstr(text, "\nprotocols: native, nmea, scip, cola, velodyne, velodyne-position, velodyne-http"));
    assert_non_null(strstr(text, "\nscenarios: "));
    assert_non_null(strstr(text, "velodyne-vlp16"));
    free(text);
}

/* Nothing but the profiles themselves needs them. */
static void without_profiles_the_rest_is_there(void **state)
{
    (void)state;
    fake_reset();
    setenv("SCANHEAD_HEADS", "/none/at/all", 1);
    char *text = print_list_with(APP_USAGE);
    unsetenv("SCANHEAD_HEADS");
    assert_int_equal(strncmp(text, "links: pty", 10), 0);
    assert_non_null(strstr(text, "\nscenarios: "));
    assert_non_null(strstr(text, "\nheads on USB: none\n"));
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(heads_are_listed_in_their_order),    cmocka_unit_test(a_bus_may_have_no_head),
        cmocka_unit_test(without_usb_the_reason_is_there),    cmocka_unit_test(the_rest_of_the_list),
        cmocka_unit_test(without_profiles_the_rest_is_there),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
