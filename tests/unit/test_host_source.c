/* SPDX-License-Identifier: MIT */
/* Sources of libscanhead by name: what is open afterwards, and how it is set up. */
#include "tests/common/cases.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include "drivers/host/source.h"

static struct host_source source;
static struct sh_err err;

static void open_it(const char *name)
{
    if (host_source_open(name, &source, &err) != 0) fail_msg("%s", err.text);
    assert_string_equal(source.name, name);
    assert_ptr_equal(source.ops, &host_fd_ops);
    assert_true((fcntl(source.fd, F_GETFL) & O_NONBLOCK) != 0);
}

static void expect_failure(const char *name, int code, const char *text)
{
    assert_int_equal(host_source_open(name, &source, &err), code);
    assert_string_equal(err.text, text);
    assert_int_equal(source.fd, -1);
    assert_null(source.ops);
}

static void test_usb_names(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        int is_usb;
    } rows[] = {{"usb", 1}, {"usb:", 1}, {"usb:1209:0001", 1}, {"usb.shs", 0}, {"us", 0}, {"tty:usb", 0}, {"USB", 0}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        assert_int_equal(host_source_is_usb(rows[i].name), rows[i].is_usb);
}

/* Numbers are decimal, and name an open descriptor. */
static void test_descriptors(void **state)
{
    (void)state;
    enum { HIGH = 121 };
    int pair[2];
    char name[32];
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, pair), 0);
    assert_int_equal(dup2(pair[0], HIGH), HIGH);
    open_it("fd:121");
    assert_int_equal(source.fd, HIGH);
    assert_int_equal(source.is_socket, 1);
    assert_int_equal(source.is_file, 0);
    assert_int_equal(source.unsettled, 0);
    expect_failure("fd:7a", SH_EINPUT, "fd:7a: not an open descriptor"); /* HIGH in base 16 */
    expect_failure("fd:+121", SH_EINPUT, "fd:+121: not an open descriptor");
    expect_failure("fd:-1", SH_EINPUT, "fd:-1: not an open descriptor");
    expect_failure("fd:121 ", SH_EINPUT, "fd:121 : not an open descriptor");
    expect_failure("fd:4294967417", SH_EINPUT, "fd:4294967417: not an open descriptor"); /* 2^32 more */
    close(HIGH);
    expect_failure("fd:121", SH_EINPUT, "fd:121: not an open descriptor");
    close(pair[0]);
    close(pair[1]);
    assert_int_equal(pipe(pair), 0);
    snprintf(name, sizeof name, "fd:%d", pair[0]);
    open_it(name);
    assert_int_equal(source.is_socket | source.is_file, 0);
    close(pair[0]);
    close(pair[1]);
    FILE *file = tmpfile();
    snprintf(name, sizeof name, "fd:%d", fileno(file));
    open_it(name);
    assert_int_equal(source.is_file, 1);
    fclose(file);
}

static void test_files(void **state)
{
    (void)state;
    char path[] = "/tmp/test_host_source.XXXXXX", text[200];
    const int fd = mkstemp(path);
    open_it(path);
    assert_int_equal(source.is_file, 1);
    assert_int_equal(source.is_socket, 0);
    assert_true((fcntl(source.fd, F_GETFD) & FD_CLOEXEC) != 0);
    close(source.fd);
    close(fd);
    unlink(path);
    snprintf(
        text, sizeof text,
        "%s: cannot open: No such file or directory (a source is usb, tty:PATH, tcp:HOST:PORT, fd:N or the path of a "
        ".shs or .pcapng file)",
        path);
    assert_int_equal(host_source_open(path, &source, &err), SH_EINPUT);
    assert_string_equal(err.text, text);
    assert_int_equal(mkfifo(path, 0600), 0);
    snprintf(text, sizeof text, "%s: is a FIFO, not a recorded stream; fd:N reads one that is open", path);
    expect_failure(path, SH_EINPUT, text);
    unlink(path);
    expect_failure("/dev/null", SH_EINPUT, "/dev/null: is a device, not a recorded stream");
    expect_failure("/tmp", SH_EINPUT, "/tmp: is a directory, not a recorded stream");
}

/* A terminal becomes raw. Bytes from before that were echoed and changed, so they are dropped. */
static void test_terminals(void **state)
{
    (void)state;
    const int master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    char name[80], bytes[16];
    struct termios tio;
    assert_int_equal(grantpt(master) | unlockpt(master), 0);
    snprintf(name, sizeof name, "tty:%s", ptsname(master));
    for (int raw_before = 0; raw_before <= 1; raw_before++) {
        const int held = open(ptsname(master), O_RDWR | O_NOCTTY); /* so that the settings last */
        assert_int_equal(write(master, "old\n", 4), 4);
        open_it(name);
        assert_int_equal(source.unsettled, 1);
        assert_int_equal(source.is_socket | source.is_file, 0);
        assert_int_equal(tcgetattr(source.fd, &tio), 0);
        assert_int_equal(tio.c_lflag & (ICANON | ECHO | ISIG | IEXTEN), 0);
        assert_int_equal(tio.c_iflag & (ICRNL | INLCR | IXON | ISTRIP), 0);
        assert_int_equal(tio.c_oflag & OPOST, 0);
        assert_int_equal(tio.c_cflag & (CSIZE | CLOCAL | CREAD), CS8 | CLOCAL | CREAD);
        assert_int_equal(tio.c_cc[VMIN], 1);
        assert_int_equal(tio.c_cc[VTIME], 0);
        assert_int_equal(read(source.fd, bytes, sizeof bytes), raw_before ? 4 : -1);
        if (!raw_before) assert_int_equal(errno, EAGAIN);
        if (!raw_before) tcflush(held, TCIOFLUSH); /* the echo */
        close(source.fd);
        if (raw_before) close(held);
    }
    close(master);
    expect_failure("tty:/dev/null", SH_EINPUT, "tty:/dev/null: not a terminal device: Inappropriate ioctl for device");
}

static int listen_at(int family, int *port)
{
    struct sockaddr_in v4 = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    struct sockaddr_in6 v6 = {.sin6_family = AF_INET6, .sin6_addr = in6addr_loopback};
    struct sockaddr *at = family == AF_INET ? (struct sockaddr *)&v4 : (struct sockaddr *)&v6;
    socklen_t len = family == AF_INET ? sizeof v4 : sizeof v6;
    const int fd = socket(family, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0 || bind(fd, at, len) != 0 || listen(fd, 4) != 0 || getsockname(fd, at, &len) != 0) {
        if (fd >= 0) close(fd);
        return -1;
    }
    *port = ntohs(family == AF_INET ? v4.sin_port : v6.sin6_port);
    return fd;
}

/* A head that vanishes is noticed after about 25 s: 10 s of rest, and three probes 5 s apart. */
static void test_tcp(void **state)
{
    (void)state;
    static const struct {
        int level, option, value;
    } rows[] = {{IPPROTO_TCP, TCP_KEEPIDLE, 10}, {IPPROTO_TCP, TCP_KEEPINTVL, 5}, {IPPROTO_TCP, TCP_KEEPCNT, 3}};
    static const int families[] = {AF_INET, AF_INET6};
    char name[64], text[120];
    int port = 0, value;
    socklen_t len = sizeof value;
    for (int i = 0; i < 2; i++) {
        const int listener = listen_at(families[i], &port);
        if (listener < 0 && i == 1) continue; /* a machine without IPv6 */
        assert_true(listener >= 0);
        snprintf(name, sizeof name, i == 0 ? "tcp:127.0.0.1:%d" : "tcp:[::1]:%d", port);
        open_it(name);
        assert_int_equal(source.is_socket, 1);
        assert_int_equal(source.is_file, 0);
        for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
            assert_int_equal(getsockopt(source.fd, rows[k].level, rows[k].option, &value, &len), 0);
            assert_int_equal(value, rows[k].value);
        }
        assert_int_equal(getsockopt(source.fd, IPPROTO_TCP, TCP_NODELAY, &value, &len), 0);
        assert_true(value != 0);
        assert_int_equal(getsockopt(source.fd, SOL_SOCKET, SO_KEEPALIVE, &value, &len), 0);
        assert_true(value != 0);
        close(source.fd);
        close(listener);
        snprintf(text, sizeof text, "%s: cannot connect: Connection refused", name);
        expect_failure(name, SH_EIO, text);
    }
}

static void test_addresses(void **state)
{
    (void)state;
    static const char *const bad[] = {"h",    "h:",     "h:0",  "h:65536", "h:000001", "h:1x",    "h: 1",  ":1",
                                      "[]:1", "[::1]1", "[::1", "::1:1",   "[::1]:",   "[::1]:0", "h:1:2", "h:-1"};
    char name[300], text[500];
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        snprintf(name, sizeof name, "tcp:%s", bad[i]);
        snprintf(text, sizeof text, "%s: not an address; allowed are tcp:HOST:PORT or tcp:[IPV6]:PORT, port 1 to 65535",
                 name);
        expect_failure(name, SH_EINPUT, text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_usb_names), cmocka_unit_test(test_descriptors), cmocka_unit_test(test_files),
        cmocka_unit_test(test_terminals), cmocka_unit_test(test_tcp),         cmocka_unit_test(test_addresses),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
