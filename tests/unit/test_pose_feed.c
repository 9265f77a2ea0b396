/* SPDX-License-Identifier: MIT */
/* Poses of a live platform as lines over UDP: which lines are poses, and how the others are reported. A datagram ends
 * with a pose that has a time of its own: once this pose is there, all lines before it were read. */
#include <arpa/inet.h>
#include <errno.h>
#include <math.h>
#include <sched.h>
#include <sys/socket.h>

#include "core/angle.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/device/device_state.h"
#include "firmware_sim/loop/pose_feed.h"
#include "tests/unit/device_rig.h"

static const int64_t DEADLINE_NS = INT64_C(120000000000); /* when a test gives up, far beyond a busy machine's time */

static struct rig *rig;
static struct pose_feed *feed;
static struct sh_err err;
static int fd;
static int last_s; /* time of the last pose */

static int begin(void **state)
{
    (void)state;
    static const char *const live[] = {"platform.kind=live", "platform.reach_m=5", "platform.port=0"};
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    char endpoint[96];
    unsigned port;
    rig = rig_open(NULL, live, 3);
    last_s = 1;
    need(pose_feed_open(rig->device, rig->cfg, &feed, &err), &err);
    need(pose_feed_start(feed, &err), &err);
    pose_feed_endpoint(feed, endpoint, sizeof endpoint);
    assert_int_equal(sscanf(endpoint, "udp:127.0.0.1:%u", &port), 1);
    at.sin_port = htons((uint16_t)port);
    fd = socket(AF_INET, SOCK_DGRAM, 0);
    return connect(fd, (struct sockaddr *)&at, sizeof at);
}

static int end(void **state)
{
    (void)state;
    close(fd);
    pose_feed_close(feed);
    rig_close(rig);
    return 0;
}

/* Copies the latest pose. Returns how many came. */
static uint64_t latest(struct device_sample *sample)
{
    struct device *device = rig->device;
    pthread_mutex_lock(&device->lock);
    const struct device_live *live = &device->live;
    const uint64_t n = live->n;
    if (n > 0) *sample = live->sample[(n - 1) % DEVICE_POSES_KEPT];
    pthread_mutex_unlock(&device->lock);
    return n;
}

/* Sends the lines and a last one, and waits until that has been read. Returns how many poses came before it. */
static uint64_t take(const char *lines, size_t len)
{
    char text[1024];
    struct device_sample sample = {0};
    const uint64_t before = latest(&sample);
    const int64_t until_ns = clock_now_ns() + DEADLINE_NS;
    last_s++;
    memcpy(text, lines, len);
    const int n = (int)len + snprintf(text + len, sizeof text - len, "\n%d 0 0 0 0 0 0", last_s);
    assert_int_equal(send(fd, text, (size_t)n, 0), n);
    for (;;) {
        const uint64_t is = latest(&sample);
        if (sample.t_ns == last_s * INT64_C(1000000000)) return is - before - 1;
        if (clock_now_ns() > until_ns) fail_msg("no pose came after: %s", lines);
        sched_yield();
    }
}

static uint64_t count_bad(void)
{
    return atomic_load(&device_counters(rig->device)->bad_poses);
}

/* Seven numbers, with blanks, tabs or a comma between them. Angles at their limits are taken. */
static void these_lines_are_poses(void **state)
{
    (void)state;
    static const char *const good[] = {
        "%s 1 2 3 4 5 6",         "%s,1,2,3,4,5,6",       " \t%s\t1 , 2 ,3,\t4 5,6 \t\r", "%s 1 2 3 360 90 360",
        "%s 1 2 3 -360 -90 -360", "%s 1e0 2.0 +3 4. 5 6", "\n\n \t\r\n%s 1 2 3 4 5 6\n\n"};
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
        char time[32], text[128];
        snprintf(time, sizeof time, "%d.5", last_s);
        snprintf(text, sizeof text, good[i], time);
        assert_int_equal(take(text, strlen(text)), 1);
    }
    assert_int_equal(send(fd, "", 1, 0), 1); /* an empty text, with its NUL */
    assert_int_equal(take("", 0), 0);
    assert_int_equal(count_bad(), 0);
    /* A line's numbers are time, place, roll, pitch and heading. */
    char text[128];
    struct device_sample sample;
    double quat[4];
    snprintf(text, sizeof text, "%d.25 1 -2 3 4 5 6\n%d.5 0 0 0 0 0 0", last_s, last_s);
    assert_int_equal(take(text, strlen(text)), 2);
    const struct device_live *live = &rig->device->live;
    sample = live->sample[(live->n - 3) % DEVICE_POSES_KEPT];
    pose_from_angles(angle_rad(6), angle_rad(5), angle_rad(4), quat);
    assert_true(sample.t_ns == (last_s - 1) * INT64_C(1000000000) + 250000000);
    assert_true(sample.pose.position_m[0] == 1 && sample.pose.position_m[1] == -2 && sample.pose.position_m[2] == 3);
    assert_memory_equal(sample.pose.quat, quat, sizeof quat);
}

/* Each of these counts as a bad pose, and none is taken. */
static void these_lines_are_none(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        size_t len; /* 0: that of the text, which begins with the time */
    } bad[] = {{"T", 0},
               {"T 1 2 3 4 5", 0},
               {"T 1 2 3 4 5 6 7", 0},
               {"T 1 2 3 4 5 6,", 0},
               {"T 1 2 3 4 5 6x", 0},
               {"T,,1,2,3,4,5,6", 0},
               {"T 1-2 3 4 5 6", 0},
               {",1.5 1 2 3 4 5 6", 0},
               {"T x 2 3 4 5 6", 0},
               {"T 1 2 nan 4 5 6", 0},
               {"T 0x1 2 3 4 5 6", 0}, /* decimal numbers alone, as TIME:STEP takes them */
               {"0x10 1 2 3 4 5 6", 0},
               {"T 1 2 3 4 5 0x1p2", 0},
               {"T 1 2 3 4 5 1e", 0},
               {"T 1 2 3 4 5 1e999", 0},
               {"inf 1 2 3 4 5 6", 0},
               {"T 1 2 3 360.01 5 6", 0},
               {"T 1 2 3 4 90.01 6", 0},
               {"T 1 2 3 4 -90.01 6", 0},
               {"T 1 2 3 4 5 -360.01", 0},
               {"T 1 2 3 4 5 6\0", 14},
               {"T 1 2 3 4 5 6\0 7", 16},
               {"T 1 2 6 4 5 6", 0},     /* 6 m away */
               {"1 1 2 3 4 5 6", 0},     /* not after the last one, or at the head's begin */
               {"3700 1 2 3 4 5 6", 0}}; /* over 1 h ahead */
    assert_int_equal(take("1 0 0 0 0 0 0", 13), 1);
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        char text[128];
        const size_t skip = bad[i].text[0] == 'T', len = bad[i].len != 0 ? bad[i].len : strlen(bad[i].text);
        const size_t at = skip ? (size_t)sprintf(text, "%d.5", last_s) : 0;
        memcpy(text + at, bad[i].text + skip, len - skip);
        if (take(text, at + len - skip) != 0 || count_bad() != i + 1) fail_msg("a pose: %s", bad[i].text);
    }
}

/* The head's error queue says what was wrong with the first one. */
static void the_first_is_reported(void **state)
{
    (void)state;
    static const struct {
        const char *lines, *says;
        uint64_t n; /* good ones */
    } rows[] = {
        {"1.5 1 2 3 4 5\n1.6 1 2", "-104,\"Data type error; a pose is not of the form t_s x y z roll pitch heading", 0},
        {"1.5 0 0 0 0 0 361", "-222,\"Data out of range; heading of a pose is 361, allowed -360 to 360 deg", 0},
        {"1.5 0 0 0 0 -90.5 0", "pitch of a pose is -90.5, allowed -90 to 90 deg", 0},
        {"1.5 0 0 0 0 90.00000001 0", "pitch of a pose is 90.00000001, allowed -90 to 90 deg", 0}, /* all digits */
        {"1.5 0 0 0 361 0", "a pose is not of the form", 0},
        {"2e9 0 0 0 0 0 0", "t_s of a pose is 2000000000, allowed -1000000000 to 1000000000 s", 0},
        {"1.5 7 2 3 4 5 6\n1.6 9 9 9 4 5 6", "-222,\"Data out of range; a pose is over 5 m from the station", 0},
        {"1.5 0 0 0 0 0 0\n1.5 1 0 0 0 0 0", "a pose is not after the last pose, of 1.5 s", 1},
        {"1.000000001 0 0 0 0 0 0\n1.000000001 0 0 0 0 0 0", "after the last pose, of 1.000000001 s", 1},
        {"-0.5 0 0 0 0 0 0", "a pose is before power-up; allowed is 0 s on", 0},
        {"3700 0 0 0 0 0 0", "a pose is over 3600 s ahead", 0}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct command_result result;
        if (i > 0) begin(state);
        assert_int_equal(take(rows[i].lines, strlen(rows[i].lines)), rows[i].n);
        device_command(rig->device, 1, "SYST:ERR?", rig->next, &result);
        if (strstr(result.reply, rows[i].says) == NULL) fail_msg("%s", result.reply);
        if (i + 1 < sizeof rows / sizeof rows[0]) end(state);
    }
}

/* A pose that has no room is a conflict with the present state, as in a reply to TIME:STEP. */
static void a_pose_without_room_is_reported(void **state)
{
    (void)state;
    static const char line[] = "80 0 0 0 0 0 0";
    struct command_result result = {0};
    const int64_t until_ns = clock_now_ns() + DEADLINE_NS;
    for (int i = 1; i <= DEVICE_POSES_KEPT; i++)
        assert_int_equal(device_pose(rig->device, i * INT64_C(1000000), (double[6]){0}, &err), SH_OK);
    assert_int_equal(send(fd, line, strlen(line), 0), (int)strlen(line));
    do {
        device_command(rig->device, 1, "SYST:ERR?", rig->next, &result);
        if (clock_now_ns() > until_ns) fail_msg("no error: %s", result.reply);
        sched_yield();
    } while (strstr(result.reply, "No error") != NULL);
    if (strstr(result.reply, "-221,") == NULL || strstr(result.reply, "a pose has no room") == NULL)
        fail_msg("%s", result.reply);
}

static void a_port_in_use_is_refused(void **state)
{
    (void)state;
    char endpoint[96], says[160];
    struct pose_feed *other;
    pose_feed_endpoint(feed, endpoint, sizeof endpoint);
    rig->cfg->platform.port = (uint32_t)atoi(strrchr(endpoint, ':') + 1);
    assert_int_equal(pose_feed_open(rig->device, rig->cfg, &other, &err), SH_EINPUT);
    assert_null(other);
    snprintf(says, sizeof says, "platform %s: cannot listen: %s", endpoint, strerror(EADDRINUSE));
    assert_string_equal(err.text, says);
}

int main(void)
{
#define CASE(f) cmocka_unit_test_setup_teardown(f, begin, end)
    const struct CMUnitTest tests[] = {
        CASE(these_lines_are_poses),           CASE(these_lines_are_none),     CASE(the_first_is_reported),
        CASE(a_pose_without_room_is_reported), CASE(a_port_in_use_is_refused),
    };
    return cmocka_run_group_tests_name("poses over UDP", tests, make_folder, remove_folder);
}
