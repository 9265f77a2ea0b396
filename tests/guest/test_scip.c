/* SPDX-License-Identifier: MIT */
/* Tests of a head that shows itself as a Hokuyo URG-04LX: what its users' programs find and do, through the system's
 * own driver.
 *
 * The sequence is urg_library's: open without waiting, set the line, throw away what is there, a bare line end, QT, PP,
 * then measurements. The layouts are those of SCIP 2.0: a reply is echo, status with sum, lines with sums, and an empty
 * line. A sum is 30h plus the low six bits. A distance has three characters of six bits, the highest first, each plus
 * 30h. The distances must be those of the room, at the right angles: counter-clockwise from step 384, 1024 steps a
 * turn.
 *
 * The environment gives TTY (default /dev/ttyACM0). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>
#include <cmocka.h>

#include "tests/guest/plan_room.h"

/* This is ample for an emulated machine, so only a head that never answers reaches it. */
enum { WAIT_MS = 240000 };
enum { FIRST = 44, LAST = 725, FRONT = 384, STEPS = 1024, DMIN = 20, DMAX = 5600, SCAN_MS = 100, SCANS = 5 };

static int tty = -1;

static const char *tty_path(void)
{
    const char *path = getenv("TTY");
    return path != NULL ? path : "/dev/ttyACM0";
}

static void open_tty(speed_t speed)
{
    struct termios line;
    tty = open(tty_path(), O_RDWR | O_NONBLOCK | O_NOCTTY);
    if (tty < 0) fail_msg("%s can't be opened", tty_path());
    assert_int_equal(tcgetattr(tty, &line), 0);
    cfmakeraw(&line);
    line.c_cflag = (line.c_cflag & ~(tcflag_t)(CSIZE | CSTOPB | PARENB)) | CS8 | CREAD | CLOCAL;
    cfsetispeed(&line, speed);
    cfsetospeed(&line, speed);
    assert_int_equal(tcsetattr(tty, TCSADRAIN, &line), 0);
    assert_int_equal(tcdrain(tty), 0);
    assert_int_equal(tcflush(tty, TCIOFLUSH), 0);
}

static int close_tty(void **state)
{
    (void)state;
    if (tty >= 0) close(tty);
    tty = -1;
    return 0;
}

static void send(const char *text)
{
    assert_int_equal(write(tty, text, strlen(text)), strlen(text));
}

/* Returns a line without its end. "" is an empty line. */
static const char *take_line(void)
{
    static char line[256];
    size_t n = 0;
    for (;;) {
        struct pollfd slot = {.fd = tty, .events = POLLIN};
        if (poll(&slot, 1, WAIT_MS) != 1) fail_msg("no answer in time; so far: %.*s", (int)n, line);
        if (read(tty, &line[n], 1) != 1) fail_msg("the terminal is gone");
        if (line[n] == '\n') break;
        assert_true(++n < sizeof line);
    }
    line[n] = '\0';
    return line;
}

/* The last character of a line is the sum of the characters before it. */
static void check_sum(const char *line, size_t n)
{
    unsigned sum = 0;
    for (size_t i = 0; i < n; i++)
        sum += (unsigned char)line[i];
    if ((unsigned char)line[strlen(line) - 1] != (sum & 63) + 48) fail_msg("wrong sum: %s", line);
}

static void expect_status(const char *echo, const char *status)
{
    assert_string_equal(take_line(), echo);
    const char *line = take_line();
    assert_int_equal(strlen(line), 3);
    assert_memory_equal(line, status, 2);
    check_sum(line, 2);
}

/* Takes lines KEY:VALUE;S up to the empty one, and returns how many there were. Puts the value of key into value. */
static int take_keys(const char *key, char *value, size_t len)
{
    int n = 0;
    for (const char *line; (line = take_line())[0] != '\0'; n++) {
        assert_true(strlen(line) > 2);
        const char *end = line + strlen(line) - 2; /* the sum may be a ';' as well */
        assert_int_equal(*end, ';');
        check_sum(line, (size_t)(end - line));
        if (strncmp(line, key, strlen(key)) == 0 && line[strlen(key)] == ':')
            snprintf(value, len, "%.*s", (int)(end - line - (long)strlen(key) - 1), line + strlen(key) + 1);
    }
    return n;
}

static void ask_key(const char *command, const char *key, const char *want, int n_keys)
{
    char text[16], value[64] = "";
    snprintf(text, sizeof text, "%s\n", command);
    send(text);
    expect_status(command, "00");
    assert_int_equal(take_keys(key, value, sizeof value), n_keys);
    assert_string_equal(value, want);
}

/* ---- the attributes that the system shows */

static void expect_attribute(const char *name, const char *want)
{
    char path[128], text[128] = "";
    const char *base = strrchr(tty_path(), '/');
    snprintf(path, sizeof path, "/sys/class/tty%s/device/../%s", base, name);
    FILE *file = fopen(path, "r");
    if (file != NULL && fgets(text, sizeof text, file) == NULL) text[0] = '\0';
    if (file != NULL) fclose(file);
    text[strcspn(text, "\n")] = '\0';
    while (text[0] == ' ')
        memmove(text, text + 1, strlen(text));
    assert_string_equal(text, want);
}

static void test_identity(void **state)
{
    (void)state;
    expect_attribute("idVendor", "15d1");
    expect_attribute("idProduct", "0000");
    expect_attribute("manufacturer", "Hokuyo Data Flex for USB");
    expect_attribute("product", "URG-Series USB Driver");
    expect_attribute("serial", ""); /* it has no serial number */
    expect_attribute("bNumInterfaces", "2");
}

/* ---- the questions of urg_library */

static void test_start(void **state)
{
    (void)state;
    open_tty(B115200);
    send("\n"); /* no reply comes */
    send("QT\n");
    expect_status("QT", "00");
    assert_string_equal(take_line(), "");
    ask_key("PP", "ARES", "1024", 8);
    ask_key("PP", "SCAN", "600", 8);
    ask_key("VV", "PROT", "SCIP 2.0", 5);
}

/* urg_library tries one rate after the other. */
static void test_rates(void **state)
{
    static const speed_t speeds[] = {B19200, B57600, B115200, B500000};
    for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++) {
        open_tty(speeds[i]);
        ask_key("VV", "PROT", "SCIP 2.0", 5);
        close_tty(state);
    }
}

static uint32_t decode(const char *text, int n)
{
    uint32_t value = 0;
    for (int i = 0; i < n; i++)
        value = value << 6 | ((uint32_t)(unsigned char)text[i] - 48);
    return value;
}

/* Takes the distances of the blocks that follow, in mm, at most max of them. Returns how many there were. */
static int take_distances(uint32_t *mm, int max)
{
    static char data[3 * (LAST - FIRST + 1) + 64];
    size_t n = 0;
    for (const char *line; (line = take_line())[0] != '\0';) {
        const size_t len = strlen(line) - 1;
        assert_true(len >= 1 && len <= 64 && n + len <= sizeof data);
        check_sum(line, len);
        memcpy(data + n, line, len);
        n += len;
    }
    assert_int_equal(n % 3, 0);
    assert_true((int)n / 3 <= max);
    for (size_t i = 0; i < n / 3; i++)
        mm[i] = decode(data + 3 * i, 3);
    return (int)n / 3;
}

/* No noise is configured. Rounding takes half a millimetre, and a ray that meets a corner as much again. */
static void check_room(const uint32_t *mm)
{
    int measured = 0;
    for (int i = 0; i <= LAST - FIRST; i++) {
        const double want_mm = 1000 * plan_room_range_m((FIRST + i - FRONT) * 2 * acos(-1) / STEPS);
        if (fabs(want_mm - DMAX) < 1) continue; /* either is right */
        if (want_mm > DMAX ? mm[i] >= DMIN : fabs(mm[i] - want_mm) > 1)
            fail_msg("step %d: %u mm, the wall is at %.1f", FIRST + i, mm[i], want_mm);
        measured += want_mm < DMAX;
    }
    assert_true(measured > 100);
}

static void test_scans(void **state)
{
    (void)state;
    uint32_t mm[LAST - FIRST + 1], before_ms = 0;
    open_tty(B115200);
    send("MD0044072501005\n");
    expect_status("MD0044072501005", "00");
    assert_string_equal(take_line(), "");
    for (int left = SCANS - 1; left >= 0; left--) {
        char echo[20];
        snprintf(echo, sizeof echo, "MD00440725010%02d", left);
        expect_status(echo, "99");
        const char *line = take_line();
        assert_int_equal(strlen(line), 5);
        check_sum(line, 4);
        const uint32_t ms = decode(line, 4);
        if (left < SCANS - 1)
            assert_in_range(ms - before_ms, SCAN_MS - 1, SCAN_MS + 1); /* no scan between them is missing */
        before_ms = ms;
        assert_int_equal(take_distances(mm, LAST - FIRST + 1), LAST - FIRST + 1);
        check_room(mm);
    }
    send("QT\n");
    expect_status("QT", "00");
    assert_string_equal(take_line(), "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_identity),
        cmocka_unit_test_teardown(test_start, close_tty),
        cmocka_unit_test_teardown(test_rates, close_tty),
        cmocka_unit_test_teardown(test_scans, close_tty),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
