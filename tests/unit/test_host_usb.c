/* SPDX-License-Identifier: MIT */
/* libscanhead: names of USB heads, and a head that goes away and comes back. tests/guest has a real bus. */
#include <arpa/inet.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/host/scanhead.h"
#include "drivers/host/usb_inside.h"
#include "drivers/protocol/native_encode.h"

static void test_names(void **state)
{
    static const struct {
        const char *source;
        int vid, pid;
        const char *serial;
    } good[] = {{"usb", -1, -1, ""},
                {"usb:1209:0001", 0x1209, 1, ""},
                {"usb:1209:aB", 0x1209, 0xab, ""},
                {"usb:1209:1:SH-000:7", 0x1209, 1, "SH-000:7"}};
    static const char *const bad[] = {
        "usb:",        "usb:1209", "usb:1209:",  "usb:1209:1:", "usb:g:1",       "usb:12090:1",
        "usb:1209:1 ", "usb::1",   "usb:0x12:1", "usb:-1:1",    "usb:1209:1209g"};
    struct usb_wanted wanted;
    struct sh_err err;
    (void)state;
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
        assert_int_equal(host_usb_parse(good[i].source, &wanted, &err), SH_OK);
        assert_int_equal(wanted.vid, good[i].vid);
        assert_int_equal(wanted.pid, good[i].pid);
        assert_string_equal(wanted.serial, good[i].serial);
    }
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        assert_int_equal(host_usb_parse(bad[i], &wanted, &err), SH_EINPUT);
        assert_non_null(strstr(err.text, bad[i]));
    }
}

/* ---- a head on TCP that closes the connection in the middle of a frame and takes another one */

static int listen_somewhere(char *source, size_t len)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof at;
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    assert_true(fd >= 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(listen(fd, 4), 0);
    assert_int_equal(getsockname(fd, (struct sockaddr *)&at, &size), 0);
    snprintf(source, len, "tcp:127.0.0.1:%d", ntohs(at.sin_port));
    return fd;
}

static size_t make_event(uint8_t *to, size_t room, uint32_t seq)
{
    struct native_event e = {.code = NATIVE_EV_ERROR, .a = seq};
    size_t len = native_encode_event(to, room, &e, 1, 0);
    native_finish_frame(to, seq);
    return len;
}

static void send_events(int fd, uint32_t from, uint32_t to)
{
    uint8_t raw[512];
    for (uint32_t seq = from; seq < to; seq++) {
        size_t len = make_event(raw, sizeof raw, seq);
        assert_int_equal(send(fd, raw, len, MSG_NOSIGNAL), len);
    }
}

static void expect_events(struct scanhead *sh, uint32_t from, uint32_t to)
{
    struct scanhead_frame frame;
    for (uint32_t seq = from; seq < to; seq++) {
        assert_int_equal(scanhead_next(sh, &frame, 120000), 0);
        assert_int_equal(frame.seq, seq);
    }
}

static void test_reattach(void **state)
{
    char source[64], err[256];
    uint8_t raw[512];
    struct scanhead *sh;
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    (void)state;
    int door = listen_somewhere(source, sizeof source);
    assert_int_equal(scanhead_open(source, &sh, err, sizeof err), 0);
    int fd = accept(door, NULL, NULL);
    send_events(fd, 100, 105);
    size_t len = make_event(raw, sizeof raw, 105);
    assert_int_equal(send(fd, raw, len / 2, MSG_NOSIGNAL), len / 2);
    close(fd);
    expect_events(sh, 100, 105);
    assert_int_equal(scanhead_next(sh, &frame, 120000), SCANHEAD_ECLOSED);
    assert_int_equal(scanhead_reattach(sh, 120000), 0);
    fd = accept(door, NULL, NULL);
    send_events(fd, 110, 113); /* 105 was cut, 106 to 109 never came */
    expect_events(sh, 110, 113);
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.frames, 8);
    assert_int_equal(stats.seq_lost, 5);
    assert_int_equal(stats.bad_bytes, len / 2);
    /* Nobody listens there. The handle gives the reason, and can be asked again and closed. */
    close(fd);
    close(door);
    assert_int_equal(scanhead_next(sh, &frame, 120000), SCANHEAD_ECLOSED);
    assert_int_equal(scanhead_reattach(sh, 0), SCANHEAD_EIO);
    assert_non_null(strstr(scanhead_error(sh), source));
    assert_int_equal(scanhead_next(sh, &frame, 120000), SCANHEAD_ECLOSED);
    assert_int_equal(scanhead_command(sh, "*IDN?", err, sizeof err, 100), SCANHEAD_ECLOSED);
    scanhead_close(sh);
}

static void test_no_way_back(void **state)
{
    char source[32], err[256];
    int fd[2];
    struct scanhead *sh;
    (void)state;
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, fd), 0);
    snprintf(source, sizeof source, "fd:%d", fd[1]);
    assert_int_equal(scanhead_open(source, &sh, err, sizeof err), 0);
    assert_int_equal(scanhead_reattach(sh, 0), SCANHEAD_ESTATE);
    close(fd[0]);
    scanhead_close(sh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_names),
        cmocka_unit_test(test_reattach),
        cmocka_unit_test(test_no_way_back),
    };
    return cmocka_run_group_tests_name("host_usb", tests, NULL, NULL);
}
