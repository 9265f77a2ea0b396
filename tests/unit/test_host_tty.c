/* SPDX-License-Identifier: MIT */
/* libscanhead on a terminal that was in its usual mode, with echo, while the head was sending. Echoes that the head
 * took for commands are answered with errors. The first command gets its own reply all the same. */
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/host/scanhead.h"
#include "drivers/protocol/native_encode.h"

enum { FRAMES = 40, TIMEOUT_MS = 120000 };

#define ERROR_REPLY "ERR -113,\"Undefined header\"\r\n"

/* The far end: a head that answers line by line until the terminal is closed. */
struct head {
    int master;
    pthread_t thread;
    char line[512]; /* the part of a command that has come */
    size_t len;
    const char *late; /* comes before the answer to the first line; NULL: nothing */
    size_t half;      /* bytes of a frame that is never ended, before the first answer */
    int slow;         /* the first *IDN? gets no answer; it comes before that of the next command */
    int owed;
    int identities, errors;
};

static void put(struct head *head, const char *text)
{
    assert_int_equal(write(head->master, text, strlen(text)), strlen(text));
}

static size_t make_event(uint8_t raw[512], uint32_t seq)
{
    struct native_event e = {.code = NATIVE_EV_ERROR, .text = "a line\r\nSCAN:STOP\r\n*RST\n"};
    size_t len = native_encode_event(raw, 512, &e, 1, 0);
    native_finish_frame(raw, seq);
    return len;
}

static void put_events(int fd, int n)
{
    uint8_t raw[512];
    for (int i = 0; i < n; i++) {
        size_t len = make_event(raw, (uint32_t)i);
        assert_int_equal(write(fd, raw, len), len);
    }
}

static void answer(struct head *head)
{
    head->line[head->len] = 0;
    const size_t len = head->len;
    head->len = 0;
    if (len == 0) return;
    if (head->late != NULL) {
        put_events(head->master, 1);
        put(head, head->late);
        head->late = NULL;
    }
    if (head->half != 0) {
        uint8_t raw[512];
        assert_in_range(head->half, 1, make_event(raw, 0) - 1);
        assert_int_equal(write(head->master, raw, head->half), head->half);
        head->half = 0;
    } else {
        put_events(head->master, 1);
    }
    if (strcmp(head->line, "*IDN?") == 0 && head->slow && head->identities == 0) {
        head->identities++;
        head->owed = 1;
        return;
    }
    if (strcmp(head->line, "*IDN?") != 0)
        for (; head->owed > 0; head->owed--)
            put(head, "Maker,Model,SN1,scanhead native 1\r\n");
    if (strcmp(head->line, "*IDN?") == 0) {
        head->identities++;
        put(head, "Maker,Model,SN1,scanhead native 1\r\n");
    } else if (strcmp(head->line, "TIME?") == 0) {
        put(head, "12\r\n");
    } else if (strcmp(head->line, "SYST:ERR?") == 0) {
        put(head, "-222,\"Data out of range; 1,2,3\"\r\n");
    } else {
        head->errors++;
        put(head, ERROR_REPLY);
    }
}

static void *play(void *arg)
{
    struct head *head = arg;
    char c;
    while (read(head->master, &c, 1) == 1) {
        if (c == '\n' || c == '\r')
            answer(head);
        else if (head->len < sizeof head->line - 1)
            head->line[head->len++] = c;
    }
    return NULL;
}

/* A terminal in its usual mode. *slave holds it open, as the kernel's own side of a serial line does. */
static int make_terminal(char *source, size_t len, int *slave)
{
    int master = posix_openpt(O_RDWR | O_NOCTTY);
    if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0) skip();
    snprintf(source, len, "tty:%s", ptsname(master));
    *slave = open(ptsname(master), O_RDWR | O_NOCTTY);
    assert_true(*slave >= 0);
    struct termios tio;
    assert_int_equal(tcgetattr(*slave, &tio), 0);
    assert_true((tio.c_lflag & ECHO) != 0 && (tio.c_lflag & ICANON) != 0);
    return master;
}

static struct scanhead *open_head(const char *source)
{
    struct scanhead *sh;
    char err[256];
    if (scanhead_open(source, &sh, err, sizeof err) != 0) fail_msg("%s", err);
    return sh;
}

static void expect_reply(struct scanhead *sh, const char *command, const char *wanted)
{
    char reply[128];
    if (scanhead_command(sh, command, reply, sizeof reply, TIMEOUT_MS) != 0) fail_msg("%s", scanhead_error(sh));
    assert_string_equal(reply, wanted);
}

static void end(struct head *head, struct scanhead *sh, int slave)
{
    scanhead_close(sh);
    close(slave); /* the last one: the head's read ends */
    pthread_join(head->thread, NULL);
    close(head->master);
}

/* An echo of the head's own frames, half a line of another client, and errors were on their way. */
static void test_replies_in_order(void **state)
{
    char source[64];
    int slave;
    struct head head = {.line = "HEAD:PR\xd5garbage", .late = ERROR_REPLY "12345\r\nOK\r\n0,\"a,b,c\"\r\n"};
    (void)state;
    head.len = strlen(head.line);
    head.master = make_terminal(source, sizeof source, &slave);
    put_events(head.master, FRAMES); /* echoed */
    struct scanhead *sh = open_head(source);
    assert_int_equal(pthread_create(&head.thread, NULL, play, &head), 0);
    expect_reply(sh, "TIME?", "12");
    expect_reply(sh, "SYST:ERR?", "-222,\"Data out of range; 1,2,3\"");
    expect_reply(sh, "NOSUCH", "ERR -113,\"Undefined header\"");
    end(&head, sh, slave);
    assert_true(head.identities >= 1); /* on a slow machine it asks again */
    assert_true(head.errors >= 2);     /* the half line, and NOSUCH */
}

/* Bytes from before raw mode were changed on their way, CR to LF and so on. None of them become frames, and later ones
 * come whole. */
static void test_frames_after(void **state)
{
    char source[64];
    int slave;
    struct head head = {0};
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    (void)state;
    head.master = make_terminal(source, sizeof source, &slave);
    put_events(head.master, 3);
    struct scanhead *sh = open_head(source);
    put_events(head.master, FRAMES);
    for (uint32_t i = 0; i < FRAMES; i++) {
        assert_int_equal(scanhead_next(sh, &frame, TIMEOUT_MS), 0);
        assert_int_equal(frame.seq, i);
    }
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.bad_bytes, 0);
    assert_int_equal(pthread_create(&head.thread, NULL, play, &head), 0);
    end(&head, sh, slave);
}

/* There is no answer: the time-out is the command's, and the next command asks again. The earlier question may be lost,
 * or be answered now. */
static void check_late_head(int lost)
{
    char source[64], reply[64];
    int slave;
    struct head head = {0};
    head.master = make_terminal(source, sizeof source, &slave);
    struct scanhead *sh = open_head(source);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, 20), SCANHEAD_ETIMEOUT);
        assert_non_null(strstr(scanhead_error(sh), "TIME?"));
    }
    /* A command whose time is over before it could ask sends nothing: on a busy machine 20 ms may go by at once. */
    const int question = (int)strlen("\n*IDN?\n");
    int waiting = 0;
    assert_int_equal(ioctl(head.master, FIONREAD, &waiting), 0);
    assert_in_range(waiting, question, 3 * question);
    assert_int_equal(waiting % question, 0);
    if (lost) {
        char questions[64];
        assert_int_equal(read(head.master, questions, sizeof questions), waiting);
        waiting = 0;
    }
    assert_int_equal(pthread_create(&head.thread, NULL, play, &head), 0);
    expect_reply(sh, "TIME?", "12");
    expect_reply(sh, "*IDN?", "Maker,Model,SN1,scanhead native 1");
    expect_reply(sh, "TIME?", "12");
    end(&head, sh, slave);
    assert_true(head.identities >= waiting / question + 2);
    assert_int_equal(head.errors, 0);
}

static void test_late_head(void **state)
{
    (void)state;
    check_late_head(0);
    check_late_head(1);
}

/* The head was in the middle of a frame for the program before. The first answer is lost in the rest of it. */
static void test_half_a_frame(void **state)
{
    uint8_t raw[512];
    (void)state;
    const size_t whole = make_event(raw, 0), halves[] = {NATIVE_HEADER_LEN - 1, whole - 1};
    for (size_t i = 0; i < sizeof halves / sizeof *halves; i++) {
        char source[64];
        int slave;
        struct head head = {.half = halves[i]};
        head.master = make_terminal(source, sizeof source, &slave);
        struct scanhead *sh = open_head(source);
        assert_int_equal(pthread_create(&head.thread, NULL, play, &head), 0);
        expect_reply(sh, "TIME?", "12");
        end(&head, sh, slave);
        assert_true(head.identities >= 2);
    }
}

/* A head is so slow that it is asked twice. The answer that comes last does not count as the reply to a command. */
static void test_slow_head(void **state)
{
    char source[64];
    int slave;
    struct head head = {.slow = 1};
    (void)state;
    head.master = make_terminal(source, sizeof source, &slave);
    struct scanhead *sh = open_head(source);
    assert_int_equal(pthread_create(&head.thread, NULL, play, &head), 0);
    expect_reply(sh, "TIME?", "12");
    expect_reply(sh, "SYST:ERR?", "-222,\"Data out of range; 1,2,3\"");
    expect_reply(sh, "*IDN?", "Maker,Model,SN1,scanhead native 1");
    expect_reply(sh, "TIME?", "12");
    end(&head, sh, slave);
    assert_true(head.identities >= 3);
}

/* Makes a terminal, and path a symlink to it. Returns its master. */
static int make_terminal_at(const char *path)
{
    const int master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    assert_true(master >= 0 && grantpt(master) == 0 && unlockpt(master) == 0);
    unlink(path);
    assert_int_equal(symlink(ptsname(master), path), 0);
    return master;
}

/* A head is found again by the whole of its name. */
static void test_long_path(void **state)
{
    (void)state;
    char top[] = "/tmp/test_host_tty.XXXXXX", dir[300], path[600], source[620], err[256];
    struct scanhead *sh;
    struct scanhead_frame frame;
    assert_non_null(mkdtemp(top));
    snprintf(dir, sizeof dir, "%s/%0200d", top, 0);
    snprintf(path, sizeof path, "%s/%0200d", dir, 0);
    snprintf(source, sizeof source, "tty:%s", path);
    assert_int_equal(mkdir(dir, 0700), 0);
    int master = make_terminal_at(path);
    assert_int_equal(scanhead_open(source, &sh, err, sizeof err), 0);
    close(master);
    assert_int_equal(scanhead_next(sh, &frame, TIMEOUT_MS), SCANHEAD_ECLOSED);
    master = make_terminal_at(path);
    assert_int_equal(scanhead_reattach(sh, 0), 0);
    scanhead_close(sh);
    close(master);
    unlink(path);
    rmdir(dir);
    rmdir(top);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_replies_in_order), cmocka_unit_test(test_slow_head), cmocka_unit_test(test_half_a_frame),
        cmocka_unit_test(test_frames_after),     cmocka_unit_test(test_late_head), cmocka_unit_test(test_long_path),
    };
    return cmocka_run_group_tests_name("host_tty", tests, NULL, NULL);
}
