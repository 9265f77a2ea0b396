/* SPDX-License-Identifier: MIT */
/* Gadgets through configfs, made and removed: each attribute as the kernel's documentation (gadget_configfs.rst and
 * ABI/testing/configfs-usb-gadget) asks for it, errors, and what dead processes have left. */
#include "tests/unit/configfs_rig.h"
#include "tests/unit/usb_models.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "drivers/usb/gadget.h"
#include "drivers/usb/personalities.h"

static struct gadget gadget;
static struct sh_err err;
static const struct usb_identity identity = {.vid = 0x1209, .pid = 0x00a1, .serial = "S1", .highest = USB_RATE_HIGH};

static int make(const struct usb_model *model)
{
    err = (struct sh_err){0, ""};
    return gadget_create(&gadget, model, &identity, &err);
}

/* Nothing of it is left. */
static void expect_gone(void)
{
    assert_int_equal(configfs_count(), 0);
    assert_int_equal(configfs.was_bound, 0);
    if (configfs.at[0] != '\0') {
        char once[80];
        snprintf(once, sizeof once, "%s ", configfs.at);
        assert_string_equal(configfs.unmounted, once);
        assert_int_not_equal(access(configfs.at, F_OK), 0);
    }
}

static void expect_failure(int rc, int code, const char *text)
{
    assert_int_equal(rc, code);
    assert_string_equal(err.text, text);
    assert_string_equal(gadget.dir, "");
    expect_gone();
}

/* $ stands for the gadget's name. */
static const char *filled(const char *text)
{
    static char out[2][300];
    static int i;
    i = !i;
    const char *at = strchr(text, '$');
    if (at == NULL) return text;
    snprintf(out[i], sizeof out[i], "%.*s%s%s", (int)(at - text), text, gadget.name, at + 1);
    return out[i];
}

struct pair {
    const char *file, *text;
};

static void expect_files(const struct pair *rows, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const char *text = configfs_get(gadget.dir, filled(rows[i].file));
        if (text == NULL || rows[i].text == NULL ? text != rows[i].text : strcmp(text, rows[i].text) != 0)
            fail_msg("%s: \"%s\", not \"%s\"", rows[i].file, text, rows[i].text);
    }
}

#define EXPECT_FILES(rows) expect_files(rows, sizeof(rows) / sizeof(rows)[0])

/* The head: its console is f_acm, its stream goes through FunctionFS, from interface 0 on. */
static void test_console_and_stream(void **state)
{
    (void)state;
    static const struct pair files[] = {{"max_speed", "high-speed"},
                                        {"idVendor", "0x1209"},
                                        {"idProduct", "0x00a1"},
                                        {"bcdUSB", "0x0210"},
                                        {"bcdDevice", "0x0100"},
                                        {"bDeviceClass", "0xef"},
                                        {"bDeviceSubClass", "0x02"},
                                        {"bDeviceProtocol", "0x01"},
                                        {"strings/0x409/manufacturer", "scanhead"},
                                        {"strings/0x409/product", "Laser scanner head"},
                                        {"strings/0x409/serialnumber", "S1"},
                                        {"configs/c.1/bmAttributes", "0xc0"},
                                        {"configs/c.1/MaxPower", "0"},
                                        {"configs/c.1/strings/0x409/configuration", NULL},
                                        {"os_desc/use", "1"},
                                        {"os_desc/b_vendor_code", "0x20"},
                                        {"os_desc/qw_sign", "MSFT100"},
                                        {"functions/acm.$/protocol", "0"},
                                        {"UDC", ""}};
    static const struct pair links[] = {{"configs/c.1/acm.$", "functions/acm.$"},
                                        {"configs/c.1/ffs.$", "functions/ffs.$"},
                                        {"os_desc/c.1", "configs/c.1"}};
    assert_int_equal(make(&scanhead_usb_model), SH_OK);
    EXPECT_FILES(files);
    for (size_t i = 0; i < 3; i++)
        assert_string_equal(configfs_link(gadget.dir, filled(links[i].file)), filled(links[i].text));
    assert_int_equal(gadget.tty_number, 3);
    assert_int_equal(gadget.state_fd, -1);
    assert_string_equal(configfs.mounted, gadget.name);
    assert_string_equal(configfs.at, gadget.mount);
    assert_int_equal(gadget_has_functionfs(&gadget), 1);
    assert_int_equal(gadget.part.n_functions, 1);
    assert_int_equal(gadget.part.n_interfaces, 1);
    assert_int_equal(gadget.interface[0], 2);
    assert_int_equal(gadget.part.interface[0].number, 0);
    assert_int_equal(gadget.part.function[0].first, 0);
    assert_string_equal(gadget.part.string[gadget.part.function[0].string - 1], "Scanner stream");
    assert_string_equal(gadget.part.string[gadget.part.interface[0].string - 1], "Scanner stream");
    assert_null(gadget.part.string[2]);
    gadget_remove(&gadget);
    expect_gone();
}

/* A serial number may be as short as one character, and may be missing. */
static void test_serial_numbers(void **state)
{
    (void)state;
    static const char *const serial[] = {"", "7"};
    for (int i = 0; i < 2; i++) {
        struct usb_identity id = identity;
        snprintf(id.serial, sizeof id.serial, "%s", serial[i]);
        assert_int_equal(gadget_create(&gadget, &scanhead_usb_model, &id, &err), SH_OK);
        const char *written = configfs_get(gadget.dir, "strings/0x409/serialnumber");
        if (written == NULL || strcmp(written, serial[i]) != 0) fail_msg("'%s', not '%s'", written, serial[i]);
        gadget_remove(&gadget);
    }
}

/* A gadget with only a port needs no FunctionFS. */
static void test_port_alone(void **state)
{
    (void)state;
    static const struct pair files[] = {{"bcdUSB", "0x0200"},
                                        {"bDeviceClass", "0x02"},
                                        {"bDeviceSubClass", "0x00"},
                                        {"bDeviceProtocol", "0x00"},
                                        {"os_desc/use", ""},
                                        {"os_desc/qw_sign", ""},
                                        {"functions/ffs.$/ready", NULL},
                                        {"functions/acm.$/port_num", "3\n"}};
    assert_int_equal(make(usb_personality_get(USB_PERSONALITY_HOKUYO)->model), SH_OK);
    EXPECT_FILES(files);
    assert_null(configfs_link(gadget.dir, "os_desc/c.1"));
    assert_int_equal(gadget_has_functionfs(&gadget), 0);
    assert_string_equal(gadget.mount, "");
    assert_string_equal(configfs.at, "");
    gadget_remove(&gadget);
    expect_gone();
    assert_string_equal(configfs.unmounted, "");
}

/* Models differ: one has no port, one has a name for its configuration and no maker, and one has two functions. */
static void test_other_models(void **state)
{
    (void)state;
    static const struct pair pair_files[] = {{"configs/c.1/bmAttributes", "0x80"},
                                             {"configs/c.1/MaxPower", "100"},
                                             {"bcdDevice", "0x0234"},
                                             {"os_desc/b_vendor_code", "0x42"},
                                             {"strings/0x409/product", "B\xc3\xa4r \xf0\x9f\x90\xbb"},
                                             {"functions/acm.$/protocol", NULL}};
    static const struct pair sick_files[] = {{"configs/c.1/bmAttributes", "0xc0"},
                                             {"configs/c.1/MaxPower", "2"},
                                             {"configs/c.1/strings/0x409/configuration", "Default Configuration"},
                                             {"strings/0x409/manufacturer", ""},
                                             {"strings/0x409/product", "TIM3xx"}};
    assert_int_equal(make(&pair_model), SH_OK);
    EXPECT_FILES(pair_files);
    assert_int_equal(gadget.tty_number, -1);
    gadget_remove(&gadget);
    expect_gone();
    configfs.unmounted[0] = '\0';
    assert_int_equal(make(usb_personality_get(USB_PERSONALITY_SICK)->model), SH_OK);
    EXPECT_FILES(sick_files);
    gadget_remove(&gadget);
    expect_gone();
    configfs.unmounted[0] = '\0';
    assert_int_equal(make(&two_model), SH_OK); /* two functions, of one interface each */
    assert_int_equal(gadget.part.n_functions, 2);
    assert_int_equal(gadget.part.n_interfaces, 2);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(gadget.part.function[i].first, i);
        assert_int_equal(gadget.part.interface[i].number, i);
        assert_int_equal(gadget.interface[i], i);
    }
    assert_int_equal(gadget.part.interface[1].endpoint[0].address, 0x82);
    gadget_remove(&gadget);
    expect_gone();
}

/* Kernels before 5.12 have no max_speed, and those before 6.12 no protocol: the gadget is made without them. */
static void test_older_kernels(void **state)
{
    (void)state;
    static const char *const files[] = {"max_speed", "protocol"};
    for (int i = 0; i < 2; i++) {
        configfs.no_file = files[i];
        assert_int_equal(make(&scanhead_usb_model), SH_OK);
        gadget_remove(&gadget);
        configfs.unmounted[0] = '\0';
    }
    configfs.no_file = NULL;
    configfs.is_unmounted = 1; /* make() must mount configfs */
    assert_int_equal(make(&scanhead_usb_model), SH_OK);
    assert_int_equal(configfs.is_unmounted, 0);
    configfs.taken = 99; /* by other heads of this process */
    struct gadget first = gadget;
    assert_int_equal(make(&pair_model), SH_OK);
    assert_string_not_equal(first.name, gadget.name);
    assert_string_equal(strrchr(gadget.name, '-'), "-99");
    assert_string_equal(strrchr(first.name, '-'), "-0");
    gadget_remove(&gadget);
    assert_int_equal(configfs_count(), 1);
    gadget_remove(&first);
    assert_int_equal(configfs_count(), 0);
}

static void test_no_configfs(void **state)
{
    (void)state;
    configfs.has_none = 1;
    assert_int_equal(make(&scanhead_usb_model), SH_EINPUT);
    assert_string_equal(err.text, "functionfs: " CONFIGFS_GADGETS " is not there: modprobe libcomposite, and mount -t "
                                  "configfs none /sys/kernel/config (as root)");
    configfs.has_none = 0;
    configfs.is_read_only = 1;
    expect_failure(make(&scanhead_usb_model), SH_EPERM,
                   "functionfs: " CONFIGFS_GADGETS ": Permission denied; only root may make gadgets");
    configfs.is_read_only = 0;
    static const struct {
        int error, code;
        const char *text;
    } rows[] = {{EPERM, SH_EPERM, "Operation not permitted"},
                {EACCES, SH_EPERM, "Permission denied"},
                {ENOSPC, SH_EIO, "No space left on device"}};
    for (int i = 0; i < 3; i++) {
        char text[120];
        snprintf(text, sizeof text, "functionfs: no gadget in " CONFIGFS_GADGETS ": %s", rows[i].text);
        configfs.mkdir_error = rows[i].error;
        expect_failure(make(&scanhead_usb_model), rows[i].code, text);
    }
    configfs.mkdir_error = 0;
    configfs.taken = 100;
    expect_failure(make(&scanhead_usb_model), SH_EIO, "functionfs: no gadget in " CONFIGFS_GADGETS ": File exists");
}

/* Each attribute that can't be written ends the making; all that was made is removed. */
static void test_refused_attributes(void **state)
{
    (void)state;
    static const char *const files[] = {"max_speed", "idVendor",     "idProduct",       "bcdUSB",
                                        "bcdDevice", "bDeviceClass", "bDeviceSubClass", "manufacturer",
                                        "product",   "serialnumber", "bDeviceProtocol", "bmAttributes",
                                        "MaxPower",  "use",          "b_vendor_code",   "qw_sign"};
    char text[200];
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        configfs.fails = files[i];
        const int rc = make(&scanhead_usb_model);
        snprintf(text, sizeof text, "functionfs: %s/%s cannot be filled in: Input/output error", CONFIGFS_GADGETS,
                 gadget.name);
        expect_failure(rc, SH_EIO, text);
    }
    configfs.fails = "configuration";
    assert_int_equal(make(usb_personality_get(USB_PERSONALITY_SICK)->model), SH_EIO);
    configfs.fails = "protocol";
    const int rc = make(&scanhead_usb_model);
    snprintf(text, sizeof text, "functionfs: %s/%s/functions/acm.%s/protocol: Input/output error", CONFIGFS_GADGETS,
             gadget.name, gadget.name);
    expect_failure(rc, SH_EIO, text);
    configfs.fails = NULL;
    configfs.no_file = "port_num";
    const int no_number = make(&scanhead_usb_model);
    snprintf(text, sizeof text, "functionfs: %s/%s/functions/acm.%s/port_num: No such file or directory",
             CONFIGFS_GADGETS, gadget.name, gadget.name);
    expect_failure(no_number, SH_EIO, text);
}

static void test_missing_modules(void **state)
{
    (void)state;
    configfs.no_function = "acm";
    expect_failure(make(&scanhead_usb_model), SH_EINPUT,
                   "functionfs: the kernel has no such function: modprobe usb_f_acm");
    configfs.no_function = "ffs";
    expect_failure(make(&scanhead_usb_model), SH_EINPUT,
                   "functionfs: the kernel has no such function: modprobe usb_f_fs");
    configfs.no_function = NULL;
    static const struct {
        int error, code;
        const char *text;
    } rows[] = {{ENODEV, SH_EIO, "functionfs: cannot be mounted: No such device; modprobe usb_f_fs"},
                {EPERM, SH_EPERM, "functionfs: cannot be mounted: Operation not permitted"},
                {EBUSY, SH_EIO, "functionfs: cannot be mounted: Device or resource busy"}};
    for (int i = 0; i < 3; i++) {
        configfs.mount_error = rows[i].error;
        expect_failure(make(&scanhead_usb_model), rows[i].code, rows[i].text);
        assert_int_equal(strncmp(configfs.refused, "/tmp/", 5), 0);
        assert_int_not_equal(access(configfs.refused, F_OK), 0);
    }
}

/* f_acm has the first interfaces, so a port comes first, and only one is allowed. */
static void test_where_a_port_is(void **state)
{
    (void)state;
    struct usb_function_row functions[2] = {{.first = 0, .count = 1, .class = 0xff},
                                            {.first = 1, .count = 1, .class = USB_CLASS_COMM, .subclass = 2}};
    struct usb_model model = two_model;
    model.function = functions;
    static const char text[] = "functionfs: allowed is one console, before all other interfaces of the device";
    expect_failure(make(&model), SH_EINPUT, text);
    functions[0] = functions[1];
    functions[0].first = 0;
    expect_failure(make(&model), SH_EINPUT, text);
    functions[1] = (struct usb_function_row){.first = 1, .count = 1, .class = USB_CLASS_COMM, .subclass = 6};
    assert_int_equal(make(&model), SH_OK); /* subclass 6 is no serial port: CDC 1.2, table 4 */
    assert_int_equal(gadget.part.n_interfaces, 1);
    assert_int_equal(gadget.interface[0], 1);
    gadget_remove(&gadget);
    expect_gone();
}

/* ---- what dead processes left */

static unsigned long long start_of(long pid)
{
    char path[40], text[400] = "";
    unsigned long long start = 0;
    snprintf(path, sizeof path, "/proc/%ld/stat", pid);
    FILE *in = fopen(path, "r");
    assert_non_null(in);
    assert_non_null(fgets(text, sizeof text, in));
    fclose(in);
    /* proc(5): fields 3 to 22 follow the name */
    assert_int_equal(sscanf(strrchr(text, ')') + 2,
                            "%*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %llu", &start),
                     1);
    return start;
}

static int exists(const char *name)
{
    char path[200];
    snprintf(path, sizeof path, "%s/%s", CONFIGFS_GADGETS, name);
    return configfs_get(path, "idVendor") != NULL;
}

/* A process makes a gadget, binds it and dies. Returns its number. */
static pid_t leave_one(void)
{
    configfs_add_udc("udc.0", "configured\n", "high-speed\n", "high-speed\n");
    const pid_t child = fork();
    if (child == 0) {
        const int rc = make(&scanhead_usb_model) == SH_OK && gadget_bind(&gadget, "udc.0", &err) == SH_OK;
        umount2(gadget.mount, MNT_DETACH);
        rmdir(gadget.mount);
        _exit(rc ? 0 : 1);
    }
    int status = -1;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
    assert_int_equal(configfs_count(), 1);
    return child;
}

static void make_empty(const char *name)
{
    char path[200];
    snprintf(path, sizeof path, "%s/%s", CONFIGFS_GADGETS, name);
    assert_int_equal(mkdir(path, 0755), 0);
}

/* A gadget whose process is gone is removed, whatever there is of it. One of a live process stays, and so do foreign
 * ones. */
static void test_left_behind(void **state)
{
    (void)state;
    char mounts[400], folder[] = "/tmp/test_gadget.XXXXXX", kept[100], expected[100], gone[60], before[60];
    const long me = (long)getpid(), dead = (long)leave_one();
    const unsigned long long start = start_of(me);
    snprintf(kept, sizeof kept, "scanhead-%ld-%llu-77", me, start);
    snprintf(gone, sizeof gone, "scanhead-%ld-1-5", dead);
    snprintf(before, sizeof before, "scanhead-%ld-%llu-0", me, start - 1); /* one that had our number */
    const char *const stay[] = {kept, "scanhead-x", "scanhead--1-5-0", "scanhead-0-5-0", "g1", "another-99999999-1-1"};
    const int n = (int)(sizeof stay / sizeof stay[0]);
    for (int i = 0; i < n; i++)
        make_empty(stay[i]);
    make_empty(gone);
    make_empty(before);
    assert_non_null(mkdtemp(folder));
    snprintf(mounts, sizeof mounts,
             "none /else functionfs rw 0 0\n%s /tmpfs tmpfs rw,size=5k 0 0\n%s %s functionfs rw 0 0\n", gone, gone,
             folder);
    configfs.mounts = mounts;
    assert_int_equal(make(&pair_model), SH_OK);
    assert_int_equal(configfs_count(), n + 1);
    for (int i = 0; i < n; i++)
        assert_int_equal(exists(stay[i]), 1);
    assert_int_equal(configfs.was_bound, 0);
    snprintf(expected, sizeof expected, "%s ", folder);
    assert_string_equal(configfs.unmounted, expected);
    assert_int_not_equal(access(folder, F_OK), 0);
    gadget_remove(&gadget);
    assert_int_equal(configfs_count(), n);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, configfs_set_up, configfs_tear_down)
    const struct CMUnitTest tests[] = {
        TEST(test_console_and_stream), TEST(test_port_alone),      TEST(test_other_models),
        TEST(test_older_kernels),      TEST(test_no_configfs),     TEST(test_refused_attributes),
        TEST(test_missing_modules),    TEST(test_where_a_port_is), TEST(test_left_behind),
        TEST(test_serial_numbers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
