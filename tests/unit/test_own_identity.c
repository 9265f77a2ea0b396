/* SPDX-License-Identifier: MIT */
/* Serial numbers and numbers of heads that have none configured. The machine's id is the test's, and the names that the
 * kernel keeps have this process's number at their end, so that heads beside the test don't matter. */
#include "tests/common/cases.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <unistd.h>

#include "drivers/usb/own_identity.h"
#include "drivers/usb/sysfile.h"

static const char *machine_id, *boot_id; /* NULL: there is no such file */
static int bind_error;

int sysfile_read(const char *dir, const char *file, char *text, size_t len)
{
    const int is_machine = strcmp(dir, "/etc") == 0 && strcmp(file, "machine-id") == 0;
    assert_true(is_machine || (strcmp(dir, "/proc/sys/kernel/random") == 0 && strcmp(file, "boot_id") == 0));
    const char *given = is_machine ? machine_id : boot_id;
    if (given == NULL) return -1;
    snprintf(text, len, "%s", given);
    return 0;
}

int bind(int fd, const struct sockaddr *at, socklen_t len)
{
    struct sockaddr_un own = *(const struct sockaddr_un *)(const void *)at;
    assert_int_equal(own.sun_family, AF_UNIX);
    assert_int_equal(own.sun_path[0], 0); /* outside the file system */
    if (bind_error != 0) return errno = bind_error, -1;
    const size_t used = len - offsetof(struct sockaddr_un, sun_path);
    const int more = snprintf(own.sun_path + used, sizeof own.sun_path - used, "-%d", (int)getpid());
    return (int)syscall(SYS_bind, fd, &own, len + (socklen_t)more);
}

struct one {
    struct usb_identity id;
    struct usb_claims claims;
};

static struct one begin(const char *whose)
{
    struct one one = {.id = {.serial = "SH"}, .claims = USB_NO_CLAIMS};
    struct sh_err err = {0, ""};
    if (usb_own_identity(&one.id, whose, &one.claims, &err) != SH_OK) fail_msg("%s", err.text);
    return one;
}

static void expect_form(const char *serial)
{
    assert_int_equal(strlen(serial), 11);
    assert_memory_equal(serial, "SH-", 3);
    assert_int_equal(strspn(serial + 3, "0123456789abcdef"), 8);
}

static int set_up(void **state)
{
    (void)state;
    machine_id = "0123456789abcdef0123456789abcdef";
    boot_id = "11111111-2222-3333-4444-555555555555";
    bind_error = 0;
    return 0;
}

/* The serial number depends on the machine and on the text, and not on the heads that run. */
static void test_serials(void **state)
{
    (void)state;
    struct one a = begin("a.yaml"), b = begin("b.yaml");
    char serial[2][64];
    expect_form(a.id.serial);
    expect_form(b.id.serial);
    assert_string_not_equal(a.id.serial, b.id.serial);
    /* Later versions keep them: printf 'scanhead MACHINE 1 a.yaml' | sha256sum */
    assert_string_equal(a.id.serial, "SH-fa0955cb");
    assert_int_equal(a.id.number, 1);
    assert_int_equal(b.id.number, 2);
    strcpy(serial[0], a.id.serial);
    strcpy(serial[1], b.id.serial);
    usb_give_up(&a.claims);
    usb_give_up(&b.claims);
    assert_int_equal(a.claims.number, -1);
    assert_int_equal(a.claims.place, -1);
    usb_give_up(&a.claims); /* which may be repeated */
    b = begin("b.yaml");
    a = begin("a.yaml");
    assert_int_equal(b.id.number, 1); /* the lowest that is free */
    assert_int_equal(a.id.number, 2);
    assert_string_equal(a.id.serial, serial[0]);
    assert_string_equal(b.id.serial, serial[1]);
    usb_give_up(&a.claims);
    usb_give_up(&b.claims);
    machine_id = "fedcba9876543210fedcba9876543210";
    a = begin("a.yaml");
    assert_string_not_equal(a.id.serial, serial[0]);
    usb_give_up(&a.claims);
}

/* Heads of the same text have numbers in the order in which they start. A place that is free again is taken. */
static void test_the_same_text(void **state)
{
    (void)state;
    struct one one[3] = {begin("a.yaml"), begin("a.yaml"), begin("a.yaml")};
    char second[64];
    strcpy(second, one[1].id.serial);
    assert_string_equal(second, "SH-11c7bc0c"); /* 'scanhead MACHINE 2 a.yaml' */
    for (int i = 0; i < 3; i++) {
        assert_int_equal(one[i].id.number, i + 1);
        assert_string_not_equal(one[i].id.serial, one[(i + 1) % 3].id.serial);
    }
    usb_give_up(&one[1].claims);
    one[1] = begin("a.yaml");
    assert_int_equal(one[1].id.number, 2);
    assert_string_equal(one[1].id.serial, second);
    for (int i = 0; i < 3; i++)
        usb_give_up(&one[i].claims);
}

/* A machine without a permanent id has one until it is started again. */
static void test_machines_without_id(void **state)
{
    (void)state;
    char with_boot_id[64];
    machine_id = NULL;
    struct one a = begin("a.yaml");
    strcpy(with_boot_id, a.id.serial);
    usb_give_up(&a.claims);
    machine_id = ""; /* as in images that have not started yet */
    a = begin("a.yaml");
    assert_string_equal(a.id.serial, with_boot_id);
    usb_give_up(&a.claims);
    boot_id = "99999999-2222-3333-4444-555555555555";
    a = begin("a.yaml");
    assert_string_not_equal(a.id.serial, with_boot_id);
    usb_give_up(&a.claims);
    boot_id = NULL;
    a = begin("a.yaml");
    expect_form(a.id.serial);
    usb_give_up(&a.claims);
}

/* A long beginning of a serial number is cut, so that the rest fits. A long text counts to its last byte. */
static void test_long_texts(void **state)
{
    (void)state;
    struct one one = {.claims = USB_NO_CLAIMS};
    struct sh_err err;
    char whose[2][300];
    memset(one.id.serial, 'S', sizeof one.id.serial - 1);
    assert_int_equal(usb_own_identity(&one.id, "a", &one.claims, &err), SH_OK);
    assert_int_equal(strlen(one.id.serial), 63);
    assert_int_equal(one.id.serial[53], 'S');
    assert_int_equal(one.id.serial[54], '-');
    usb_give_up(&one.claims);
    for (int i = 0; i < 2; i++) {
        memset(whose[i], 'w', sizeof whose[i]);
        whose[i][298] = (char)('0' + i);
        whose[i][299] = '\0';
    }
    struct one a = begin(whose[0]), b = begin(whose[1]);
    assert_string_not_equal(a.id.serial, b.id.serial);
    usb_give_up(&a.claims);
    usb_give_up(&b.claims);
}

static void test_errors(void **state)
{
    (void)state;
    static struct one all[USB_MAX_HEADS];
    struct one more = {.claims = USB_NO_CLAIMS};
    struct sh_err err;
    for (int i = 0; i < USB_MAX_HEADS; i++) {
        all[i] = begin("a.yaml");
        assert_int_equal(all[i].id.number, i + 1);
    }
    assert_int_equal(usb_own_identity(&more.id, "a.yaml", &more.claims, &err), SH_EINPUT);
    assert_string_equal(err.text, "usb: 126 heads on USB run on this machine; allowed are 126: end one, or set "
                                  "links[].serial");
    usb_give_up(&more.claims);
    for (int i = 0; i < USB_MAX_HEADS; i++)
        usb_give_up(&all[i].claims);
    bind_error = EACCES;
    assert_int_equal(usb_own_identity(&more.id, "a.yaml", &more.claims, &err), SH_EIO);
    assert_string_equal(err.text, "usb: no serial number can be chosen for this head: Permission denied");
    assert_int_equal(more.claims.number, -1);
    usb_give_up(&more.claims);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(test_serials, set_up),    cmocka_unit_test_setup(test_the_same_text, set_up),
        cmocka_unit_test_setup(test_long_texts, set_up), cmocka_unit_test_setup(test_machines_without_id, set_up),
        cmocka_unit_test_setup(test_errors, set_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
