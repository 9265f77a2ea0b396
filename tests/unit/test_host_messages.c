/* SPDX-License-Identifier: MIT */
/* Messages of libscanhead are compared whole: what is refused, where, and what is allowed. */
#include <fcntl.h>
#include <sys/stat.h>

#include "core/bytes.h"
#include "drivers/protocol/pcapng.h"
#include "tests/unit/host_rig.h"

static char dir[] = "/tmp/test_host_messages_XXXXXX";

/* The text of `format` with the folder of the test in place of its one %s. */
static const char *in_dir(const char *format)
{
    static char text[4][600];
    static int turn;
    turn = (turn + 1) % 4;
    const char *at = strstr(format, "%s");
    snprintf(text[turn], sizeof text[0], "%.*s%s%s", (int)(at - format), format, dir, at + 2);
    return text[turn];
}

static void expect_refusal(const char *source, int code, const char *want)
{
    struct scanhead *sh;
    char err[600];
    assert_int_equal(scanhead_open(source, &sh, err, sizeof err), code);
    assert_string_equal(err, want);
}

static void test_sources(void **state)
{
    (void)state;
#define ALLOWED " (a source is usb, tty:PATH, tcp:HOST:PORT, fd:N or the path of a .shs or .pcapng file)"
    assert_int_equal(mkfifo(in_dir("%s/fifo"), 0600), 0);
    expect_refusal(in_dir("%s/none.shs"), SCANHEAD_EINPUT,
                   in_dir("%s/none.shs: cannot open: No such file or directory" ALLOWED));
    expect_refusal(in_dir("%s"), SCANHEAD_EINPUT, in_dir("%s: is a directory, not a recorded stream"));
    expect_refusal(in_dir("%s/fifo"), SCANHEAD_EINPUT,
                   in_dir("%s/fifo: is a FIFO, not a recorded stream; fd:N reads one that is open"));
    expect_refusal("/dev/null", SCANHEAD_EINPUT, "/dev/null: is a device, not a recorded stream");
    expect_refusal("tty:/dev/null", SCANHEAD_EINPUT,
                   "tty:/dev/null: not a terminal device: Inappropriate ioctl for device");
    expect_refusal("fd:999", SCANHEAD_EINPUT, "fd:999: not an open descriptor");
#define ADDRESS ": not an address; allowed are tcp:HOST:PORT or tcp:[IPV6]:PORT, port 1 to 65535"
    expect_refusal("tcp:h:0", SCANHEAD_EINPUT, "tcp:h:0" ADDRESS);
    expect_refusal("tcp:h:65536", SCANHEAD_EINPUT, "tcp:h:65536" ADDRESS);
    expect_refusal("tcp:[::1]4000", SCANHEAD_EINPUT, "tcp:[::1]4000" ADDRESS);
    unlink(in_dir("%s/fifo"));
}

static const char *write_file(const char *name, const void *bytes, size_t len)
{
    const char *path = in_dir(name);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, len, file), len);
    fclose(file);
    return path;
}

/* Files that are no stream. In a capture its first interface shows that, in a .shs only its end. */
static void test_files(void **state)
{
    (void)state;
    uint8_t bytes[1024];
    size_t len = pcapng_put_section(bytes, "test");
    expect_refusal(write_file("%s/a.pcapng", bytes, len), SCANHEAD_EFORMAT,
                   in_dir("%s/a.pcapng: not a pcapng file: no interface is described at its beginning"));
    len += pcapng_put_interface(bytes + len, 1, 0, NULL, NULL);
    expect_refusal(write_file("%s/a.PCAPNG", bytes, len), SCANHEAD_EFORMAT,
                   in_dir("%s/a.PCAPNG: its packets are of link type 1; allowed are frames of the head's stream, link "
                          "type 147, as record writes them without --raw"));
    struct scanhead *sh;
    struct scanhead_frame f;
    assert_int_equal(scanhead_open(write_file("%s/a.shs", "PK\3\4 something else", 18), &sh, NULL, 0), 0);
    assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_EFORMAT);
    assert_string_equal(scanhead_error(sh), in_dir("%s/a.shs: no frame in 18 bytes: this is not a scan head's stream"));
    scanhead_close(sh);
    unlink(in_dir("%s/a.pcapng"));
    unlink(in_dir("%s/a.PCAPNG"));
    unlink(in_dir("%s/a.shs"));
}

/* Calls of a program that are wrong, with the source's name in front where the stream is at fault. */
static void test_calls(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f, last;
    struct scanhead_point point;
    struct scanhead_pose pose = {.t_ns = 1, .flags = 1}, zero;
    struct scanhead_attribute attribute;
    struct scanhead_colour colour;
    struct scanhead_line_end end;
    char source[100], want[200], reply[4], line[258];
    put_descriptor(head, 1, 1, 0);
    put_anchor(head, 0);
    put_points(head, 1, 0);
    for (int i = 0; i < 2; i++)
        assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    assert_int_equal(scanhead_points(sh, &f, 0, &point, 1), SCANHEAD_EINPUT);
    assert_string_equal(scanhead_error(sh), "this is not the points frame that scanhead_next returned last");
    expect_frame(sh, SCANHEAD_POINTS, &last);
    assert_int_equal(scanhead_attributes(sh, &last, 0, &attribute, 1), SCANHEAD_EINPUT);
    assert_string_equal(scanhead_error(sh), "this is not the attributes frame that scanhead_next returned last");
    assert_int_equal(scanhead_colours(sh, &last, 0, &colour, 1), SCANHEAD_EINPUT);
    assert_string_equal(scanhead_error(sh), "this is not the colours frame that scanhead_next returned last");
    assert_int_equal(scanhead_poses(sh, &last, 0, &pose, 1), SCANHEAD_EINPUT);
    assert_string_equal(scanhead_error(sh), "this is not the poses frame that scanhead_next returned last");
    assert_int_equal(scanhead_line_end(sh, &last, &end), SCANHEAD_EINPUT);
    assert_string_equal(scanhead_error(sh), "this is not a line end frame");

    assert_int_equal(scanhead_pose(sh, 1234567891, &pose), SCANHEAD_ESTATE);
    assert_int_equal(sscanf(scanhead_error(sh), "%99[^ ]", source), 1); /* fd:N: */
    snprintf(want, sizeof want, "%s there is no pose of the head at 1.234567891 s of the scan", source);
    assert_string_equal(scanhead_error(sh), want);
    memset(&zero, 0, sizeof zero);
    assert_memory_equal(&pose, &zero, sizeof pose); /* so a program that overlooks the error has no old one */
    assert_int_equal(scanhead_to_scene(sh, &point, 1, NULL), SCANHEAD_ESTATE);
    snprintf(want, sizeof want, "%s only points of the polar layout can be converted to the scene frame", source);
    assert_string_equal(scanhead_error(sh), want);

#define NO_COMMAND "not a command: one line of 1 to 256 printable ASCII characters"
    static const char *const wrong[] = {"", "  ", "a\n", "a\x1f", "a\x7f"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        assert_int_equal(scanhead_command(sh, wrong[i], reply, sizeof reply, 1), SCANHEAD_EINPUT);
        assert_string_equal(scanhead_error(sh), NO_COMMAND);
    }
    memset(line, 'a', 257); /* COMMANDS.md: a head takes 256 */
    line[257] = '\0';
    assert_int_equal(scanhead_command(sh, line, reply, sizeof reply, 1), SCANHEAD_EINPUT);
    assert_string_equal(scanhead_error(sh), NO_COMMAND);
    line[256] = '\0';
    assert_int_equal(scanhead_command(sh, line, reply, sizeof reply, 1), SCANHEAD_ETIMEOUT); /* it was sent */
    close(head);
    scanhead_close(sh);
}

/* The header never changes, so a frame of another version is known as one. */
static void test_version(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    char source[100], want[200];
    memset(out, 0, 256);
    out[0] = NATIVE_SYNC;
    out[1] = NATIVE_LINE_END;
    out[2] = 2;
    le_put32(out + 4, 68);
    native_reseal(out, NATIVE_HEADER_LEN + 68);
    put_all(head, out, NATIVE_HEADER_LEN + 68);
    assert_int_equal(scanhead_next(sh, &f, WAIT_MS), SCANHEAD_EFORMAT);
    assert_int_equal(sscanf(scanhead_error(sh), "%99[^ ]", source), 1);
    snprintf(want, sizeof want, "%s the head speaks version 2 of the protocol; this library reads 1", source);
    assert_string_equal(scanhead_error(sh), want);
    close(head);
    scanhead_close(sh);
}

static void expect_end(struct scanhead *sh, int code, const char *source, const char *why)
{
    struct scanhead_frame f;
    char want[700];
    snprintf(want, sizeof want, "%s: %s", source, why);
    assert_int_equal(scanhead_next(sh, &f, 0), code);
    assert_string_equal(scanhead_error(sh), want);
}

/* The error says why no frame comes: not yet, never again, or the recording is over. Commands have the same reasons. */
static void test_ends(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    char source[32], want[700], reply[8];
    assert_int_equal(scanhead_next(sh, &f, 0), SCANHEAD_ETIMEOUT);
    assert_int_equal(sscanf(scanhead_error(sh), "%31[^ ]", source), 1);
    source[strlen(source) - 1] = '\0';
    expect_end(sh, SCANHEAD_ETIMEOUT, source, "no data came within the time limit");
    close(head);
    for (int i = 0; i < 2; i++)
        expect_end(sh, SCANHEAD_ECLOSED, source, "the head is gone");
    assert_int_equal(scanhead_command(sh, "*IDN?", reply, sizeof reply, 0), SCANHEAD_ECLOSED);
    snprintf(want, sizeof want, "%s: the head is gone", source);
    assert_string_equal(scanhead_error(sh), want);
    scanhead_close(sh);

    const struct native_event e = {.code = NATIVE_EV_ERROR};
    const size_t len = native_encode_event(out, sizeof out, &e, 1, 0);
    native_finish_frame(out, 0);
    const char *path = write_file("%s/b.shs", out, len);
    assert_int_equal(scanhead_open(path, &sh, NULL, 0), 0);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    expect_end(sh, SCANHEAD_ECLOSED, path, "end of the recording");
    assert_int_equal(scanhead_command(sh, "*IDN?", reply, sizeof reply, 0), SCANHEAD_ESTATE);
    snprintf(want, sizeof want, "%s: a recording takes no commands", path);
    assert_string_equal(scanhead_error(sh), want);
    scanhead_close(sh);
    unlink(path);
#define NO_USB ": not a USB head; allowed are usb, usb:VID:PID and usb:VID:PID:SERIAL, with the ids that lsusb shows"
    expect_refusal("usb:x", SCANHEAD_EINPUT, "usb:x" NO_USB);
    expect_refusal("usb:1209", SCANHEAD_EINPUT, "usb:1209" NO_USB);
    expect_refusal("usb:12090:1", SCANHEAD_EINPUT, "usb:12090:1" NO_USB);
}

static int set_up(void **state)
{
    (void)state;
    return mkdtemp(dir) == NULL;
}

static int tear_down(void **state)
{
    (void)state;
    return rmdir(dir);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sources), cmocka_unit_test(test_files), cmocka_unit_test(test_calls),
        cmocka_unit_test(test_version), cmocka_unit_test(test_ends),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
