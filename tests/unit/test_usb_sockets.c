/* SPDX-License-Identifier: MIT */
/* Sockets of the USB back ends: Unix paths that others have left, connections that are tried again, and hanging up. */
#include "tests/common/cases.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "drivers/socket/socket.h"
#include "drivers/usb/backend.h"

static struct usb_backend_spec spec;
static struct sh_err err;
static char dir[] = "/tmp/test_usb_sockets.XXXXXX", name[USB_BACKEND_NAME_MAX];

static int set_up(void **state)
{
    (void)state;
    strcpy(dir + sizeof dir - 7, "XXXXXX");
    if (mkdtemp(dir) == NULL) return -1;
    spec = (struct usb_backend_spec){.type = USB_BACKEND_USBREDIR};
    snprintf(spec.path, sizeof spec.path, "%s/s", dir);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    char path[64];
    snprintf(path, sizeof path, "%s/s", dir);
    unlink(path);
    return rmdir(dir);
}

static int open_one(void)
{
    int fd;
    if (usb_backend_socket(&spec, "usbredir", &fd, name, sizeof name, &err) != SH_OK) fail_msg("%s", err.text);
    return fd;
}

static void expect_failure(const char *text)
{
    char want[400];
    int fd;
    assert_int_equal(usb_backend_socket(&spec, "usbredir", &fd, name, sizeof name, &err), SH_EINPUT);
    snprintf(want, sizeof want, "usbredir:%s: %s", spec.path, text);
    assert_string_equal(err.text, want);
}

/* The socket of a process that is gone is taken over. A live one's is not, nor is anything else at that path. */
static void test_paths(void **state)
{
    (void)state;
    static const char in_use[] =
        "cannot listen: Address already in use; it is in use, or not a socket: choose another path";
    struct stat st;
    int fd = open_one();
    assert_string_equal(name, spec.path);
    expect_failure(in_use);
    close(fd); /* and its file stays */
    assert_int_equal(lstat(spec.path, &st), 0);
    fd = open_one();
    close(fd);
    unlink(spec.path);
    assert_int_equal(mkdir(spec.path, 0700), 0);
    expect_failure(in_use);
    assert_int_equal(rmdir(spec.path), 0);
    const int file = open(spec.path, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    close(file);
    expect_failure(in_use);
    assert_int_equal(lstat(spec.path, &st), 0);
    assert_true(S_ISREG(st.st_mode));
    /* unix(7): 108 bytes with the zero byte */
    memset(spec.path, 'a', 108);
    spec.path[108] = '\0';
    expect_failure("the path is too long for a socket; allowed 107 bytes");
    spec.path[107] = '\0';
    assert_int_equal(usb_backend_socket(&spec, "usbredir", &fd, name, sizeof name, &err), SH_OK);
    close(fd);
    unlink(spec.path);
}

static void test_connecting(void **state)
{
    (void)state;
    struct socket_address to = {.len = 0};
    int fd, reserve = -1;
    spec.attach = 1;
    expect_failure("cannot connect: No such file or directory");
    spec.attach = 0;
    const int listener = open_one();
    spec.attach = 1;
    const int first = open_one();
    usb_backend_peer(&spec, first, &to);
    assert_int_equal(usb_backend_connect(&to, &fd), 0);
    assert_int_equal(usb_backend_connect_error(fd), 0);
    assert_true((fcntl(fd, F_GETFL) & O_NONBLOCK) != 0);
    assert_true((fcntl(fd, F_GETFD) & FD_CLOEXEC) != 0);
    for (int i = 0; i < 2; i++) { /* both have arrived */
        const int client = usb_backend_accept(listener, &reserve, NULL);
        assert_true(client >= 0);
        close(client);
    }
    assert_int_equal(usb_backend_accept(listener, &reserve, NULL), -1);
    close(fd);
    close(first);
    close(listener);
    close(reserve);
    assert_int_equal(usb_backend_connect(&to, &fd), ECONNREFUSED);
    assert_int_equal(fd, -1);
    expect_failure("cannot connect: Connection refused");
    unlink(spec.path);
    assert_int_equal(usb_backend_connect(&to, &fd), ENOENT);
    assert_int_equal(fd, -1);
}

static int await_connection(int fd)
{
    struct pollfd slot = {.fd = fd, .events = POLLOUT};
    assert_int_equal(poll(&slot, 1, 60000), 1);
    return usb_backend_connect_error(fd);
}

/* By TCP a connection is under way for a while. A connection to its own port counts as refused. */
static void test_tcp(void **state)
{
    (void)state;
    struct socket_address to = {.len = 0};
    int fd, port;
    spec.path[0] = '\0';
    const int listener = open_one();
    assert_int_equal(sscanf(name, "127.0.0.1:%d", &port), 1);
    spec.attach = 1;
    spec.port = port;
    const int first = open_one();
    usb_backend_peer(&spec, first, &to);
    assert_int_equal(((const struct sockaddr_in *)&to.at)->sin_port, htons((uint16_t)port));
    assert_int_equal(usb_backend_connect(&to, &fd), EINPROGRESS);
    assert_true(fd >= 0);
    assert_int_equal(await_connection(fd), 0);
    close(fd);
    close(first);
    close(listener);
    const int rc = usb_backend_connect(&to, &fd);
    if (rc == EINPROGRESS) {
        assert_int_equal(await_connection(fd), ECONNREFUSED);
        close(fd);
    } else {
        assert_int_equal(rc, ECONNREFUSED);
    }
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t len = sizeof at;
    const int own = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(own, (struct sockaddr *)&at, len), 0);
    assert_int_equal(getsockname(own, (struct sockaddr *)&at, &len), 0);
    assert_int_equal(connect(own, (struct sockaddr *)&at, len), 0);
    assert_int_equal(usb_backend_connect_error(own), ECONNREFUSED);
    close(own);
    usb_backend_peer(&spec, own, &to); /* closed: no address */
    assert_int_equal(to.len, 0);
    assert_int_equal(usb_backend_connect_error(own), EBADF);
}

/* Bytes that a peer still sends are read, in eight pieces at most, and the peer sees the end. */
static void test_hanging_up(void **state)
{
    (void)state;
    char byte;
    for (int n = 0; n <= 10; n += 5) {
        int fd[2], left = 0;
        assert_int_equal(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, fd), 0); /* keeps pieces apart */
        for (int i = 0; i < n; i++)
            assert_int_equal(send(fd[1], "x", 1, 0), 1);
        usb_backend_hang_up(fd[0], 0);
        assert_int_equal(recv(fd[1], &byte, 1, 0), 0);
        while (recv(fd[0], &byte, 1, 0) == 1)
            left++;
        assert_int_equal(left, n > 8 ? n - 8 : 0);
        close(fd[0]);
        close(fd[1]);
    }
    int fd[2];
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, fd), 0);
    assert_int_equal(send(fd[1], "x", 1, 0), 1);
    close(fd[1]);
    usb_backend_hang_up(fd[0], 60000); /* it is gone, so nothing is waited for */
    assert_int_equal(recv(fd[0], &byte, 1, 0), 0);
    close(fd[0]);
    usb_backend_hang_up(fd[0], 60000);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {TEST(test_paths), TEST(test_connecting), TEST(test_tcp), TEST(test_hanging_up)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
