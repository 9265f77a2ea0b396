/* SPDX-License-Identifier: MIT */
/* The test listens as the service manager does, on a path and on an abstract name. Names of no socket are refused. */
#include "firmware_sim/base/notify.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cmocka.h>

static struct sh_err err;

/* Listens on the name as NOTIFY_SOCKET has it. */
static int listen_on(const char *name)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    const size_t n = strlen(name);
    const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    assert_true(fd >= 0 && n < sizeof at.sun_path);
    memcpy(at.sun_path, name, n);
    if (name[0] == '@') at.sun_path[0] = '\0';
    /* An abstract name is as long as the address says; a path ends with its NUL. */
    const socklen_t len = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + n + (name[0] == '@' ? 0 : 1));
    assert_int_equal(bind(fd, (const struct sockaddr *)&at, len), 0);
    return fd;
}

static void expect_datagram(const char *name)
{
    static const char lines[] = "READY=1\nSTATUS=scans";
    char got[64] = "";
    const int fd = listen_on(name);
    assert_int_equal(setenv("NOTIFY_SOCKET", name, 1), 0);
    assert_true(notify_is_wanted());
    if (notify_send(lines, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(recv(fd, got, sizeof got - 1, 0), strlen(lines));
    assert_string_equal(got, lines);
    assert_int_equal(notify_send("STOPPING=1", &err), SH_OK);
    assert_int_equal(recv(fd, got, sizeof got - 1, 0), 10);
    assert_true(recv(fd, got, sizeof got - 1, 0) < 0); /* one datagram each */
    close(fd);
}

static void lines_come_as_one_datagram(void **state)
{
    (void)state;
    char folder[] = "/tmp/test_notify.XXXXXX", name[64];
    assert_non_null(mkdtemp(folder));
    snprintf(name, sizeof name, "%s/s", folder);
    expect_datagram(name);
    unlink(name);
    rmdir(folder);
    snprintf(name, sizeof name, "@scanhead-test-%d", (int)getpid());
    expect_datagram(name);
}

static void without_a_name_nothing_is_sent(void **state)
{
    (void)state;
    unsetenv("NOTIFY_SOCKET");
    assert_false(notify_is_wanted());
    assert_int_equal(notify_send("READY=1", &err), SH_OK);
    setenv("NOTIFY_SOCKET", "", 1);
    assert_false(notify_is_wanted());
    assert_int_equal(notify_send("READY=1", &err), SH_OK);
}

static void expect_refused(const char *name, int code, const char *text)
{
    char want[400];
    assert_int_equal(setenv("NOTIFY_SOCKET", name, 1), 0);
    assert_int_equal(notify_send("READY=1", &err), code);
    snprintf(want, sizeof want, "NOTIFY_SOCKET=%s: %s", name, text);
    assert_string_equal(err.text, want);
}

static void a_wrong_name_is_refused(void **state)
{
    (void)state;
    static const char none[] = "not the name of a socket; allowed are a path from / on and @NAME, 2 to 107 bytes";
    char name[109];
    expect_refused("run/notify", SH_EINPUT, none);
    expect_refused("vsock:2:1", SH_EINPUT, none);
    expect_refused("/", SH_EINPUT, none);
    expect_refused("@", SH_EINPUT, none);
    memset(name, 'x', sizeof name);
    name[0] = '/';
    name[108] = '\0';
    expect_refused(name, SH_EINPUT, none); /* sun_path has 108 bytes, its NUL among them */
    name[107] = '\0';
    expect_refused(name, SH_EIO, "No such file or directory");
    expect_refused("@x", SH_EIO, "Connection refused");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_come_as_one_datagram),
        cmocka_unit_test(without_a_name_nothing_is_sent),
        cmocka_unit_test(a_wrong_name_is_refused),
    };
    return cmocka_run_group_tests_name("notify", tests, NULL, NULL);
}
